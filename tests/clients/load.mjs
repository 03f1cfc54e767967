#!/usr/bin/env node
// Loads every output and its source in three.js and in Babylon.js, in headless Chromium with software GL, and compares:
// no error that the source does not cause, the same things counted, level 0 pixel for pixel the source, each level shown.
import { mkdir, stat, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { open } from './browser.mjs';
import { groups, pairUp, readDocument } from './document.mjs';

/** d_RMS that a recovered transform may cost. */
const RECOVERED = 0.05;
/** Of the pixels of a file with batches, this share may differ in any way: an engine that multiplies the transforms of instances in
 * single precision moves edges by a hair, and without antialiasing a pixel there is one thing or the other. */
const EDGES = 1 / 2000;
/** Facts that change with recovered instances and batches: one mesh draws many, and names of nodes may be dropped. */
const CHANGED_BY_INSTANCES = ['meshes', 'vertices', 'instances', 'nodes'];

const USAGE = `usage: node load.mjs SOURCE_DIR OUTPUT_DIR [SOURCE_DIR OUTPUT_DIR]... [--engine three|babylon] [--only TEXT] [--pictures DIR] [--size N] [--slowest N] [--instances]
  --engine    one engine only (default: both, side by side)
  --only      files whose path contains TEXT
  --pictures  where to put source and output pictures that differ
  --size      side of the compared pictures in pixels (default 256)
  --slowest   lists the N files that took longest
  --instances the outputs have recovered instances or batches: what is drawn is counted and not what draws it, and
              level 0 may differ from the source by a d_RMS of less than ${RECOVERED}, and where there are batches in one pixel
              of ${1 / EDGES} besides`;

/** One file may take this long in one engine: software GL, two cores. */
const FILE_LIMIT_MS = 120_000;
/** A fresh page now and then keeps one file's leftovers from another's verdict, and memory flat. */
const FILES_PER_PAGE = 20;
/** Babylon loads a file anew for each level it shows; above this many bytes only the coarsest is tried. */
const ALL_LEVELS_BYTES = 1_000_000;
/** Share of the sources that an engine may fail to read, before the set-up is suspected. */
const MOST_UNREAD = 0.25;

class TimedOut extends Error {}

function within(milliseconds, promise) {
  let timer;
  const limit = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new TimedOut(`not done after ${milliseconds / 1000} s`)), milliseconds);
  });
  return Promise.race([promise, limit]).finally(() => clearTimeout(timer));
}

/** What the document of an output says of its levels. */
async function planOf(pair, { size, instances }) {
  const { json } = await readDocument(pair.output);
  const { found, anchors } = groups(json);
  return {
    size,
    instances,
    batches: instances && (json.nodes ?? []).some((node) => node.extensions?.EXT_mesh_gpu_instancing),
    anchors,
    groups: found,
    levels: Math.max(1, ...found.map((group) => group.levels.length)),
    coarsestOnly: (await stat(pair.output)).size > ALL_LEVELS_BYTES,
    // Babylon asks for a level's bytes in one piece, and forgets the animations that come later.
    ranges: /\.glb$/i.test(pair.output) && (json.animations ?? []).length === 0,
  };
}

/** Errors of `after` that `before` has not, numbers and paths aside (array indices move, folders differ). */
function newErrors(before, after) {
  const blur = (text) => text.replace(/\/[^\s'"]*/g, '').replace(/\d+/g, '#');
  const known = new Set(before.map(blur));
  return after.filter((text) => !known.has(blur(text)));
}

/** Facts that differ, in words. `nodes` must all be found again; `groups` are the output's own. */
function changedFacts(before, after, ignored) {
  const found = [];
  for (const [key, value] of Object.entries(before)) {
    if (key === 'nodes' || key === 'groups' || ignored.includes(key)) continue;
    // A material that is drawn with and without instances may be two in an engine.
    const once = (list) => (ignored.length > 0 && key === 'materials' ? [...new Set(list)] : list);
    const [a, b] = [JSON.stringify(once(value)), JSON.stringify(once(after[key]))];
    if (a !== b) found.push(`${key}: ${a} in the source, ${b} in the output`);
  }
  const lost = (ignored.includes('nodes') ? [] : before.nodes ?? []).filter((node) => !after.nodes.includes(node));
  if (lost.length > 0) found.push(`nodes of the source not found: ${lost.slice(0, 10).join(', ')}`);
  return found;
}

/** What is wrong with the levels that an engine showed. */
function wrongLevels(plan, level0, shown, engine) {
  const found = [];
  for (const group of plan.groups) {
    if (group.anchor < 0) found.push(`nodes[${group.node}]: levels without a parent`);
    const coverage = group.coverage ?? [];
    const falls = coverage.every((value, i) => i === 0 || value < coverage[i - 1]);
    if (coverage.length !== group.levels.length || !falls || coverage.at(-1) !== 0) {
      found.push(`nodes[${group.node}]: \`MSFT_screencoverage\` ${JSON.stringify(coverage)} for ${group.levels.length} levels`);
    }
  }
  let above = level0.triangles;
  for (const { level, triangles, pixels, arrived } of shown) {
    if (triangles === 0 && level0.triangles > 0) found.push(`level ${level}: no triangles`);
    if (triangles > above) found.push(`level ${level}: ${triangles} triangles, more than the level above (${above})`);
    if (pixels === 0 && level0.pixels > 0) found.push(`level ${level}: nothing to see`);
    if (arrived !== undefined && arrived !== plan.levels - level) found.push(`level ${level}: ${arrived} levels arrived`);
    above = triangles;
  }
  if (engine === 'three') {
    const [expected, got] = [plan.groups.map((g) => [g.node, g.levels.length]), level0.groups].map((g) => JSON.stringify(g));
    if (expected !== got) found.push(`groups of levels (node, levels): ${expected} in the file, ${got} loaded`);
  }
  return found;
}

/** Everything that is wrong with one pair in one engine; `{ listed }` where the source itself does not load. */
async function judge(client, engine, pair, plan) {
  const call = (name, ...args) => client.page.evaluate(([n, a]) => globalThis.client[n](...a), [name, args]);
  const step = async (name, file, extra) => {
    client.errors.length = 0;
    const result = await call(name, client.url(file), { ...plan, ...extra }).catch((error) => {
      if (client.page.isClosed()) throw error;
      client.errors.push(error.message.split('\n')[0]);
      return null;
    });
    return { result, errors: client.errors.map((text) => client.anonymous(text).replaceAll(pair.root, '')) };
  };
  const before = await step('source', pair.source, { anchors: {}, ranges: false });
  const after = await step('output', pair.output, { ranges: false });
  const wrong = newErrors(before.errors, after.errors).map((text) => `error: ${text}`);
  if (!before.result) return { wrong, listed: before.errors[0] ?? 'does not load', unread: true };
  if (!after.result) return { wrong: wrong.length > 0 ? wrong : ['the source loads, the output does not'] };
  wrong.push(...changedFacts(before.result.facts, after.result.facts, plan.instances ? CHANGED_BY_INSTANCES : []));
  const squares = after.result.differing.flatMap(({ squares }) => squares).sort((a, b) => b - a);
  const pixels = after.result.pictures * plan.size ** 2;
  const counted = squares.slice(plan.batches ? Math.floor(pixels * EDGES) : 0);
  const dRms = Math.sqrt(counted.reduce((sum, square) => sum + square, 0) / pixels);
  const exact = squares.length === 0;
  const mayDiffer = plan.instances && dRms < RECOVERED;
  if (plan.instances && !mayDiffer) wrong.push(`d_RMS ${dRms.toFixed(4)} from the source`);
  for (const { view, time, pixels, most, shot } of mayDiffer ? [] : after.result.differing) {
    wrong.push(`picture ${view} at ${time} s: ${pixels} pixels differ, by up to ${most}`);
    await client.keep(pair, shot);
  }
  if (plan.levels > 1) {
    const shown = await step('levels', pair.output);
    wrong.push(...newErrors(before.errors, shown.errors).map((text) => `levels: error: ${text}`));
    const level0 = { ...after.result.facts, pixels: before.result.pixels };
    if (shown.result) wrong.push(...wrongLevels(plan, level0, shown.result, engine));
  }
  return { wrong, listed: before.errors[0], levels: plan.levels, dRms, exact };
}

/** Runs every pair through one engine, one after the other. */
async function runEngine(browser, engine, pairs, options) {
  const errors = [];
  let page = null;
  let used = 0;
  const verdicts = [];
  const client = {
    errors,
    url: browser.server.url,
    anonymous: (text) => browser.server.anonymous(text),
    keep: async (pair, shot) => {
      if (!options.pictures) return;
      for (const which of ['source', 'output']) {
        const png = await page.evaluate(([w, i, s]) => globalThis.client.shot(w, i, s), [which, shot, options.size]);
        const file = path.join(options.pictures, `${pair.name.replaceAll(/[^\w.-]/g, '_')}.${engine}.${shot}.${which}.png`);
        await mkdir(options.pictures, { recursive: true });
        if (png) await writeFile(file, Buffer.from(png, 'base64'));
      }
    },
  };
  for (const pair of pairs) {
    if (!page || used === FILES_PER_PAGE) {
      await page?.close();
      page = await browser.page(engine, (kind, text) => errors.push(`${kind}: ${text}`));
      used = 0;
    }
    used++;
    client.page = page;
    const start = Date.now();
    const work = planOf(pair, options).then((plan) => judge(client, engine, pair, plan));
    const verdict = await within(FILE_LIMIT_MS, work).catch((error) => ({ wrong: [error.message] }));
    if (verdict.wrong.length > 0 || page.isClosed()) {
      // Whatever went wrong must not colour the next file.
      work.catch(() => {});
      await page.close().catch(() => {});
      page = null;
    }
    verdicts.push({ engine, pair, seconds: (Date.now() - start) / 1000, ...verdict });
  }
  await page?.close();
  return verdicts;
}

function tell(verdicts, slowest) {
  const listed = verdicts.filter((v) => v.listed);
  if (listed.length > 0) console.log(`\n${listed.length} source(s) that an engine itself does not load without an error:`);
  for (const { engine, pair, listed: reason } of listed) console.log(`  ${engine}: ${pair.name}: ${reason.slice(0, 160)}`);
  const failed = verdicts.filter((v) => v.wrong.length > 0);
  if (failed.length > 0) console.log('\nwrong:');
  for (const { engine, pair, wrong } of failed) {
    console.log(`  ${engine}: ${pair.name}`);
    for (const text of wrong.slice(0, 8)) console.log(`    ${text.slice(0, 400)}`);
    if (wrong.length > 8) console.log(`    and ${wrong.length - 8} more`);
  }
  for (const { engine, pair, seconds } of verdicts.toSorted((a, b) => b.seconds - a.seconds).slice(0, slowest)) {
    console.log(`  ${seconds.toFixed(1)} s ${engine}: ${pair.name}`);
  }
  return failed.length;
}

/** Engines that read so few of the sources that the set-up must be at fault: their silence proves nothing. */
function idleEngines(verdicts) {
  const engines = [...new Set(verdicts.map((v) => v.engine))];
  return engines.filter((engine) => {
    const own = verdicts.filter((v) => v.engine === engine);
    return own.filter((v) => v.unread).length > own.length * MOST_UNREAD;
  });
}

/** Judges every pair below `folders` = [[source, output], ..]; returns the verdicts and the sources without an output. */
export async function run(folders, options) {
  const found = await Promise.all(folders.map(([source, output]) => pairUp(source, output)));
  // Sources that were baked in several ways are told apart by their outputs.
  const several = new Set(folders.map(([source]) => path.resolve(source))).size < folders.length;
  const way = (i) => (several ? ` in ${path.relative('', folders[i][1]).split(path.sep).slice(-3).join('/')}` : '');
  const labelled = (i, name) => (folders.length > 1 ? `${path.basename(folders[i][0])}/${name}${way(i)}` : name);
  const pairs = found.flatMap((one, i) => one.pairs.map((pair) => ({ ...pair, name: labelled(i, pair.name), root: path.resolve(folders[i][0]) })));
  const missing = found.flatMap((one, i) => one.missing.map((name) => labelled(i, name)));
  const chosen = pairs.filter((pair) => !options.only || pair.name.includes(options.only));
  if (chosen.length === 0) throw new Error('no source has an output');
  const engines = options.engine ? [options.engine] : ['three', 'babylon'];
  const browser = await open(engines);
  try {
    const settings = { size: 256, ...options };
    const verdicts = (await Promise.all(engines.map((engine) => runEngine(browser, engine, chosen, settings)))).flat();
    return { verdicts, missing };
  } finally {
    await browser.close();
  }
}

async function main() {
  const { values, positionals } = parseArgs({
    allowPositionals: true,
    options: {
      engine: { type: 'string' },
      only: { type: 'string' },
      pictures: { type: 'string' },
      size: { type: 'string', default: '256' },
      slowest: { type: 'string', default: '0' },
      instances: { type: 'boolean', default: false },
    },
  });
  if (positionals.length === 0 || positionals.length % 2 !== 0) throw new Error(USAGE);
  const folders = Array.from({ length: positionals.length / 2 }, (_, i) => positionals.slice(2 * i, 2 * i + 2));
  const start = Date.now();
  const { verdicts, missing } = await run(folders, { ...values, size: Number(values.size) });
  const idle = idleEngines(verdicts);
  const failed = tell(verdicts, Number(values.slowest)) + idle.length;
  for (const engine of idle) console.log(`\n${engine} reads less than ${100 * (1 - MOST_UNREAD)} % of the sources: is it set up right?`);
  if (missing.length > 0) console.log(`\n${missing.length} source(s) without an output: ${missing.join(', ')}`);
  if (values.instances) {
    const exact = verdicts.filter((v) => v.exact).length;
    const most = Math.max(...verdicts.map((v) => v.dRms ?? 0));
    console.log(`\nlevel 0: ${exact} loads pixel for pixel as their sources, d_RMS ${most.toFixed(4)} at most`);
  }
  console.log(`\n${verdicts.length} loads against their sources in ${((Date.now() - start) / 1000).toFixed(0)} s`);
  console.log(`${verdicts.length + idle.length - failed} passed, ${failed} failed`);
  process.exitCode = failed > 0 ? 1 : 0;
}

if (process.argv[1] === import.meta.filename) {
  await main().catch((error) => {
    console.error(error.message);
    process.exit(2);
  });
}
