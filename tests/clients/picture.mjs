#!/usr/bin/env node
// Draws glTF files with three.js, so that people can look at levels and sample scenes.
// Each file is a row; its columns are levels × views. Judges nothing.
import { readFile, stat, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { open } from './browser.mjs';

const USAGE = `usage: node picture.mjs FILE.. OUT.png [--level K,..|all] [--view I,..|all] [--size N] [--time S] [--wire] [--same-frame]
  FILE          .gltf or .glb; several make a contact sheet, one row each
  --level       levels of detail to show, 0 = the source (default 0); \`all\` = each one
  --view        which of the 24 vertices of a rhombicuboctahedron to look from, 0..23 (default 0)
  --size        side of one cell in pixels (default 512; on a sheet 320)
  --time        plays every animation up to this second (default: the pose at rest)
  --wire        draws edges only
  --same-frame  frames every row as the first one`;

function numbers(text, all) {
  if (text === 'all') return all;
  const list = text.split(',').map(Number);
  if (!list.every((n) => Number.isInteger(n) && n >= 0)) throw new Error(`\`${text}\` is not a list of numbers`);
  return list;
}

function request() {
  const { values, positionals } = parseArgs({
    allowPositionals: true,
    options: {
      level: { type: 'string', default: '0' },
      view: { type: 'string', default: '0' },
      size: { type: 'string' },
      time: { type: 'string', default: '0' },
      wire: { type: 'boolean', default: false },
      'same-frame': { type: 'boolean', default: false },
      help: { type: 'boolean', short: 'h', default: false },
    },
  });
  if (values.help || positionals.length < 2) throw new Error(USAGE);
  const out = positionals.pop();
  const levels = numbers(values.level, null);
  const views = numbers(values.view, [...Array(24).keys()]);
  const cells = positionals.length * views.length * (levels?.length ?? 2);
  return {
    files: positionals,
    out,
    levels,
    time: Number(values.time),
    sheet: { size: Number(values.size ?? (cells > 1 ? 320 : 512)), views, wire: values.wire, sameFrame: values['same-frame'] },
  };
}

async function main() {
  const { files, out, levels, time, sheet } = request();
  for (const file of files) await stat(file);
  const browser = await open(['three']);
  try {
    const page = await browser.page('three', (kind, text) => console.error(`${kind}: ${browser.server.anonymous(text)}`));
    const rows = files.map((file) => ({ url: browser.server.url(file), label: path.basename(file), levels, time }));
    const { png, facts } = await page.evaluate(([r, s]) => globalThis.client.picture(r, s), [rows, sheet]);
    await writeFile(out, Buffer.from(png, 'base64'));
    facts.forEach((fact, i) => console.log(`${files[i]}: ${fact.levels} level(s), ${fact.animations} animation(s)`));
    console.log(`wrote ${out} (${(await readFile(out)).length} bytes)`);
  } finally {
    await browser.close();
  }
}

main().catch((error) => {
  console.error(error.message);
  process.exit(2);
});
