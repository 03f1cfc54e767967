// What a page does with a source and its output, in either engine: draw both from the same cameras and compare.
// It knows no engine; three.mjs and babylon.mjs hand it one:
//   load(url, options)  a fresh stage with this file       facts()        what stands on it at level 0
//   sphere()            bounds of what is drawn            seek(seconds)  poses every animation
//   draw(view, size)    RGBA bytes, bottom row first       levels(url)    → [{ triangles, pixels }] for each level
import { camera } from './views.mjs';

// Corners that show three faces each, from above and below; the last looks straight at the front.
const DIRECTIONS = [
  [0.6, 0.45, 0.66],
  [-0.7, -0.4, -0.59],
  [0, 0, 1],
];
/** Seconds into every animation at which one more picture is compared. */
const LATER = 0.5;
/** Software GL takes seconds for a picture of more triangles than this: one view must do. */
const MANY_TRIANGLES = 300_000;

/** Luminance of the pixel at byte `i`, 0..255 (BT.709 weights). */
const luminance = (rgba, i) => 0.2126 * rgba[i] + 0.7152 * rgba[i + 1] + 0.0722 * rgba[i + 2];

/** Pixels that differ, by how much at most in one channel, and the square of the difference of luminance of each. */
function difference(a, b) {
  let pixels = 0;
  let most = 0;
  const squares = [];
  const [x, y] = [new Uint32Array(a.buffer), new Uint32Array(b.buffer)];
  for (let i = 0; i < x.length; i++) {
    if (x[i] === y[i]) continue;
    pixels++;
    for (let c = 4 * i; c < 4 * i + 4; c++) most = Math.max(most, Math.abs(a[c] - b[c]));
    squares.push((luminance(a, 4 * i) - luminance(b, 4 * i)) ** 2);
  }
  return { pixels, most, squares };
}

/** Pixels that something was drawn on. */
export function covered(rgba) {
  let pixels = 0;
  for (let i = 3; i < rgba.length; i += 4) if (rgba[i] > 0) pixels++;
  return pixels;
}

function png(rgba, size) {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = size;
  const data = new ImageData(size, size);
  for (let y = 0; y < size; y++) data.data.set(rgba.subarray(4 * y * size, 4 * (y + 1) * size), 4 * (size - 1 - y) * size);
  canvas.getContext('2d').putImageData(data, 0, 0);
  return canvas.toDataURL('image/png').split(',')[1];
}

export function client(engine) {
  const kept = { source: [], output: [] };
  let sphere = null;

  const views = (size, facts) => {
    const all = DIRECTIONS.map((direction) => ({ ...camera(sphere, direction), size }));
    return facts.triangles > MANY_TRIANGLES ? all.slice(0, 1) : all;
  };

  /** Every picture of the stage: all views at the start, and one more with the animations under way. */
  async function pictures(facts, size) {
    const shots = [];
    const shoot = async (time, view, i) => shots.push({ time, view: i, rgba: await engine.draw(view, size) });
    if (facts.animations.length > 0) engine.seek(0);
    for (const [i, view] of views(size, facts).entries()) await shoot(0, view, i);
    if (facts.animations.length > 0) {
      engine.seek(LATER);
      await shoot(LATER, views(size, facts)[0], 0);
    }
    return shots;
  }

  return {
    start: engine.start,
    picture: engine.picture,
    /** Loads the source and keeps its pictures. */
    async source(url, plan) {
      kept.source = [];
      await engine.load(url, plan);
      const facts = engine.facts();
      sphere = engine.sphere();
      kept.source = await pictures(facts, plan.size);
      return { facts, pixels: covered(kept.source[0].rgba) };
    },
    /** Loads the output and compares it with the source kept. */
    async output(url, plan) {
      kept.output = [];
      await engine.load(url, plan);
      const facts = engine.facts();
      kept.output = await pictures(facts, plan.size);
      const differing = kept.output
        .map((shot, i) => ({ shot: i, view: shot.view, time: shot.time, ...compare(kept.source[i], shot) }))
        .filter((found) => found.pixels > 0);
      return { facts, differing, pictures: kept.output.length };
    },
    /** Shows each level of the output alone, from one side: the triangles and the pixels drawn. */
    async levels(url, plan) {
      return engine.levels(url, plan, { ...camera(sphere, DIRECTIONS[0]), size: plan.size });
    },
    /** One kept picture as base64 PNG. */
    shot(which, i, size) {
      return kept[which][i] ? png(kept[which][i].rgba, size) : null;
    },
  };
}

function compare(before, after) {
  return before ? difference(before.rgba, after.rgba) : { pixels: Infinity, most: 255, squares: [Infinity] };
}
