#!/usr/bin/env node
// Bundles viewer.mjs with three.js into viewer.min.js, with the packages that tests/clients locks:
//   node assets/viewer/build.mjs            writes it
//   node assets/viewer/build.mjs --check    says whether the file that is checked in is what this makes
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { createRequire } from 'node:module';
import { fileURLToPath } from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url));
const clients = path.join(here, '..', '..', 'tests', 'clients');
const { build } = createRequire(path.join(clients, 'package.json'))('esbuild');
const target = path.join(here, 'viewer.min.js');

const made = await build({
  entryPoints: [path.join(here, 'viewer.mjs')],
  nodePaths: [path.join(clients, 'node_modules')],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2022',
  charset: 'utf8',
  legalComments: 'inline',
  banner: { js: '/* three.js and the decoder of meshoptimizer, MIT: see assets/viewer/LICENSE of lodbake. Made by assets/viewer/build.mjs. */' },
  write: false,
  logLevel: 'error',
});
const text = Buffer.from(made.outputFiles[0].contents);
if (process.argv.includes('--check')) {
  const same = text.equals(await readFile(target));
  console.log(same ? '1 passed, 0 failed' : `${target} is not what build.mjs makes\n0 passed, 1 failed`);
  process.exitCode = same ? 0 : 1;
} else {
  await writeFile(target, text);
  console.log(`wrote ${target}: ${text.length} bytes`);
}
