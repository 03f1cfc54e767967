#!/usr/bin/env node
// Shows that the client checks can fail: makes a small scene, gives it the form of a baked one, spoils copies of it in one
// way each, and expects the sound copy to pass and every other to be found out, for the expected reason.
import { mkdir, mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { writeDocument } from './document.mjs';
import { addLevels } from './form.mjs';
import { run } from './load.mjs';
import { judgePair } from './validate.mjs';

/** Rings and segments of the ball: 2 × 12 × 16 = 384 triangles a half. */
const RINGS = 12;
const SEGMENTS = 16;

/** Positions (also the normals) and indices of a ball, its upper and its lower half apart. */
function ball() {
  const positions = [];
  for (let r = 0; r <= 2 * RINGS; r++) {
    for (let s = 0; s <= SEGMENTS; s++) {
      const [polar, round] = [(Math.PI * r) / (2 * RINGS), (2 * Math.PI * s) / SEGMENTS];
      positions.push(Math.sin(polar) * Math.cos(round), Math.cos(polar), Math.sin(polar) * Math.sin(round));
    }
  }
  const halves = [0, 1].map((half) => {
    const indices = [];
    for (let r = half * RINGS; r < (half + 1) * RINGS; r++) {
      for (let s = 0; s < SEGMENTS; s++) {
        const a = r * (SEGMENTS + 1) + s;
        indices.push(a, a + 1, a + SEGMENTS + 1, a + 1, a + SEGMENTS + 2, a + SEGMENTS + 1);
      }
    }
    return indices;
  });
  return { positions, halves };
}

/** Two balls of two materials, one moving; a camera and a light. */
function scene() {
  const { positions, halves } = ball();
  const chunks = [Float32Array.from(positions), ...halves.map((half) => Uint16Array.from(half)), Float32Array.of(0, 1, 0, 0, 0, 0, 0.5, 0)];
  const bytes = Buffer.concat(chunks.map((chunk) => Buffer.from(chunk.buffer)));
  let at = 0;
  const bufferViews = chunks.map((chunk) => {
    const view = { buffer: 0, byteOffset: at, byteLength: chunk.byteLength };
    at += chunk.byteLength;
    return view;
  });
  const attributes = { POSITION: 0, NORMAL: 0 };
  const primitives = [1, 2].map((indices, material) => ({ attributes, indices, material }));
  return {
    asset: { version: '2.0' },
    extensionsUsed: ['KHR_lights_punctual'],
    extensions: { KHR_lights_punctual: { lights: [{ type: 'point', intensity: 20 }] } },
    scene: 0,
    scenes: [{ nodes: [0, 1, 2] }],
    nodes: [
      { name: 'still', mesh: 0, translation: [-1.2, 0, 0] },
      { name: 'moving', mesh: 0, translation: [1.2, 0, 0], children: [3] },
      { name: 'eye', camera: 0, translation: [0, 0, 6] },
      { name: 'lamp', extensions: { KHR_lights_punctual: { light: 0 } }, translation: [0, 2, 0] },
    ],
    cameras: [{ type: 'perspective', perspective: { yfov: 0.8, znear: 0.1 } }],
    meshes: [{ name: 'ball', primitives }],
    materials: [[0.8, 0.2, 0.1, 1], [0.1, 0.3, 0.8, 1]].map((baseColorFactor, i) => ({
      name: ['upper', 'lower'][i],
      pbrMetallicRoughness: { baseColorFactor, metallicFactor: 0 },
    })),
    animations: [{ name: 'rise', samplers: [{ input: 3, output: 4 }], channels: [{ sampler: 0, target: { node: 1, path: 'translation' } }] }],
    accessors: [
      { bufferView: 0, componentType: 5126, count: positions.length / 3, type: 'VEC3', min: [-1, -1, -1], max: [1, 1, 1] },
      ...halves.map((half, i) => ({ bufferView: i + 1, componentType: 5123, count: half.length, type: 'SCALAR' })),
      { bufferView: 3, componentType: 5126, count: 2, type: 'SCALAR', min: [0], max: [1] },
      { bufferView: 3, byteOffset: 8, componentType: 5126, count: 2, type: 'VEC3' },
    ],
    bufferViews,
    buffers: [{ byteLength: bytes.length, uri: `data:application/octet-stream;base64,${bytes.toString('base64')}` }],
  };
}

/** Lets `change` at the bytes of the only buffer. */
function editBytes(json, change) {
  const bytes = Buffer.from(json.buffers[0].uri.split(',')[1], 'base64');
  change(bytes);
  json.buffers[0].uri = `data:application/octet-stream;base64,${bytes.toString('base64')}`;
}

const firstGroup = (json) => json.nodes.find((node) => node.extensions?.MSFT_lod);

/** Ways to spoil a baked file: what is done, and the words that must be among the findings of an engine or the validator. */
const SPOILT = {
  'a-vertex-moved': [(json) => editBytes(json, (bytes) => bytes.writeFloatLE(1.3, 12 * (RINGS * (SEGMENTS + 1) + 3))), 'pixels differ'],
  'a-material-lost': [(json) => delete json.meshes[0].primitives[1].material, 'materials:'],
  'a-colour-changed': [(json) => (json.materials[1].pbrMetallicRoughness.baseColorFactor[0] = 0.11), 'pixels differ'],
  'an-animation-lost': [(json) => delete json.animations, 'animations:'],
  'a-channel-elsewhere': [(json) => (json.animations[0].channels[0].target.node = 0), 'at 0.5 s'],
  'a-camera-lost': [(json) => delete json.nodes[2].camera, 'cameras:'],
  'a-light-lost': [(json) => delete json.nodes[3].extensions, 'lights:'],
  'a-node-lost': [(json) => json.nodes[1].children.shift(), 'nodes of the source not found: 3'],
  'a-level-that-is-not': [(json) => (firstGroup(json).extensions.MSFT_lod.ids[1] = 999), 'error'],
  'a-level-shared': [(json) => json.nodes.filter((n) => n.extensions?.MSFT_lod).forEach((n, i, all) => (n.extensions.MSFT_lod.ids = all[0].extensions.MSFT_lod.ids)), 'error'],
  'levels-coarse-first': [(json) => firstGroup(json).extensions.MSFT_lod.ids.reverse(), 'more than the level above'],
  'a-coverage-short': [(json) => firstGroup(json).extras.MSFT_screencoverage.pop(), 'MSFT_screencoverage'],
  'an-index-out-of-range': [(json) => editBytes(json, (bytes) => bytes.writeUInt16LE(60000, json.bufferViews[1].byteOffset)), 'ACCESSOR_INDEX_OOB'],
};

async function main() {
  const folder = await mkdtemp(path.join(tmpdir(), 'lodbake-selftest-'));
  const [source, output] = ['source', 'output'].map((name) => path.join(folder, name));
  await Promise.all([mkdir(source), mkdir(output)]);
  const cases = { sound: [() => {}, null], ...SPOILT };
  for (const [name, [spoil]] of Object.entries(cases)) {
    const baked = scene();
    addLevels(baked);
    spoil(baked);
    await writeDocument(path.join(source, `${name}.gltf`), { json: scene() });
    await writeDocument(path.join(output, `${name}.gltf`), { json: baked });
  }
  const found = new Map(Object.keys(cases).map((name) => [name, []]));
  const { verdicts } = await run([[source, output]], {});
  for (const { pair, wrong } of verdicts) found.get(path.parse(pair.name).name).push(...wrong);
  for (const name of found.keys()) {
    const pair = { source: path.join(source, `${name}.gltf`), output: path.join(output, `${name}.gltf`) };
    found.get(name).push(...(await judgePair(pair)));
  }
  await rm(folder, { recursive: true });
  let failed = 0;
  for (const [name, [, expected]] of Object.entries(cases)) {
    const list = found.get(name);
    const right = expected === null ? list.length === 0 : list.some((text) => text.includes(expected));
    if (!right) failed++;
    if (!right) console.log(`${name}: ${expected ? `\`${expected}\` expected` : 'nothing expected'}, found: ${list.join('; ') || 'nothing'}`);
  }
  console.log(`self-test of the client checks: one sound file, ${Object.keys(SPOILT).length} spoilt ones`);
  console.log(`${Object.keys(cases).length - failed} passed, ${failed} failed`);
  process.exitCode = failed > 0 ? 1 : 0;
}

await main().catch((error) => {
  console.error(error.stack);
  process.exit(2);
});
