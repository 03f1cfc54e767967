#!/usr/bin/env node
// Lets the real readers of each report format read what lodbake writes: ajv with the official schema (SARIF), junitparser
// (JUnit), the real pre-commit (hooks), headless Chromium (the page). In a repository of its own with three planted
// regressions: a mesh simplified worse, an asset that grew by 12 %, one that vanished.
import { spawnSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { cp, mkdir, mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import addFormats from 'ajv-formats';
import Ajv from 'ajv-draft-04';
import { checkPage } from './report_page.mjs';

const HERE = path.dirname(fileURLToPath(import.meta.url));
const ROOT = path.join(HERE, '..', '..');
const SARIF = path.join(HERE, 'node_modules/@microsoft/jest-sarif/lib/schemas/sarif-2.1.0-rtm.5.json');
/** Made by .ci/run: junitparser and pre-commit, from PyPI. */
const TOOLS = process.env.LODBAKE_TOOLS ?? path.join(HERE, '.venv/bin');

const { positionals, values } = parseArgs({ allowPositionals: true, options: { pictures: { type: 'string' }, keep: { type: 'boolean' } } });
if (positionals.length !== 1) {
  console.error('usage: node report.mjs PATH_OF_LODBAKE [--pictures DIR] [--keep]');
  process.exit(2);
}
const lodbake = path.resolve(positionals[0]);
const folder = await mkdtemp(path.join(tmpdir(), 'lodbake-report-'));
let [passed, failed] = [0, 0];

function judge(what, isTrue, more = '') {
  if (isTrue) passed++;
  else (failed++, console.log(`FAILED ${what}${more ? `: ${more}` : ''}`));
}

const environment = { ...process.env, PATH: `${path.dirname(lodbake)}${path.delimiter}${process.env.PATH}`, GIT_AUTHOR_NAME: 'A', GIT_AUTHOR_EMAIL: 'a@example.org', GIT_COMMITTER_NAME: 'A', GIT_COMMITTER_EMAIL: 'a@example.org', PRE_COMMIT_HOME: path.join(folder, 'hooks') };
for (const name of ['GITHUB_STEP_SUMMARY', 'LODBAKE_CACHE', 'GIT_DIR', 'GIT_INDEX_FILE']) delete environment[name];

/** Runs a program in the repository; its exit code and all that it said. */
function run(program, ...words) {
  const done = spawnSync(program, words, { cwd: path.join(folder, 'art'), env: environment, encoding: 'utf8', maxBuffer: 1 << 28 });
  if (done.error) throw done.error;
  return { code: done.status, out: done.stdout, all: done.stdout + done.stderr };
}

function fine(program, ...words) {
  const done = run(program, ...words);
  if (done.code !== 0) throw new Error(`${program} ${words.join(' ')}: exit code ${done.code}\n${done.all}`);
  return done.out;
}

const at = (...names) => path.join(folder, 'art', ...names);

/** The same GLB with so many bytes more, in `extras`. */
function grown(glb, bytes) {
  const length = glb.readUInt32LE(12);
  const json = JSON.parse(glb.subarray(20, 20 + length).toString('utf8'));
  json.asset.extras = { ...json.asset.extras, padding: 'x'.repeat(bytes) };
  const text = Buffer.from(JSON.stringify(json));
  const chunk = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, 0x20)]);
  const rest = glb.subarray(20 + length);
  const head = Buffer.alloc(20);
  glb.copy(head, 0, 0, 20);
  head.writeUInt32LE(20 + chunk.length + rest.length, 8);
  head.writeUInt32LE(chunk.length, 12);
  return Buffer.concat([head, chunk, rest]);
}

const PIPELINE = `input = "scenes"
output = "out"
baseline = "lodbake.report.json"

[appearance]
size = 64

[[budget]]
d_rms = { grow_percent = 10 }
file_bytes = { grow_percent = 10 }
`;
const PLANTED = `
[[override]]
match = "vase.glb"
lod = [{ ratio = 0.3 }, { ratio = 0.15 }, { ratio = 0.06 }]
`;
const REGRESSIONS = [['regression/vanished', 'boulder.glb'], ['regression/uglier', 'vase.glb'], ['regression/grew', 'fern.glb']];

async function plant() {
  await mkdir(at('scenes'), { recursive: true });
  for (const name of ['vase.glb', 'fern.glb', 'boulder.glb', 'books.glb']) await cp(path.join(ROOT, 'scenes/props', name), at('scenes', name));
  await writeFile(at('pipeline.toml'), PIPELINE);
  await writeFile(at('.gitignore'), 'out\n.lodbake\nreport.*\n');
  fine('git', 'init', '-q');
  fine(lodbake, '-q');
  fine(lodbake, 'report', '-o', 'lodbake.report.json');
  fine('git', 'add', '.');
  fine('git', 'commit', '-q', '-m', 'baseline');
}

function preCommit() {
  const program = path.join(TOOLS, 'pre-commit');
  if (!existsSync(program)) {
    console.log(`left out: pre-commit (not in ${TOOLS}; see .ci/run)`);
    if (process.env.CI) judge('pre-commit is installed', false);
    return null;
  }
  const revision = spawnSync('git', ['rev-parse', 'HEAD'], { cwd: ROOT, encoding: 'utf8' }).stdout.trim();
  // A clone, as pre-commit makes one of a remote; the hook's file is that of the working tree.
  const hooks = path.join(folder, 'lodbake');
  spawnSync('git', ['clone', '-q', ROOT, hooks]);
  spawnSync('cp', [path.join(ROOT, '.pre-commit-hooks.yaml'), hooks]);
  spawnSync('git', ['-c', 'user.name=A', '-c', 'user.email=a@example.org', 'commit', '-qam', 'hooks'], { cwd: hooks });
  const head = spawnSync('git', ['rev-parse', 'HEAD'], { cwd: hooks, encoding: 'utf8' }).stdout.trim() || revision;
  return { program, config: `repos:\n  - repo: ${hooks}\n    rev: ${head}\n    hooks:\n      - id: lodbake-check-installed\n` };
}

async function hooks(tool) {
  if (!tool) return;
  await writeFile(at('.pre-commit-config.yaml'), tool.config);
  fine('git', 'add', '.pre-commit-config.yaml');
  fine(tool.program, 'install');
  // An unchanged scene that is committed again is fine.
  const all = run(tool.program, 'run', '--all-files');
  judge('pre-commit passes what is within its budgets', all.code === 0 && /lodbake budgets\.*Passed/.test(all.all), all.all);
}

async function hooksCatch(tool) {
  if (!tool) return;
  fine('git', 'add', '-A');
  const commit = run('git', 'commit', '-q', '-m', 'regressions');
  judge('pre-commit stops the commit', commit.code !== 0 && commit.all.includes('fern.glb:') && /more than the baseline/.test(commit.all), commit.all);
  const all = run(tool.program, 'run', '--all-files');
  judge('pre-commit names the uglier mesh', all.code !== 0 && all.all.includes('vase.glb: mesh `vase`, level'), all.all);
}

async function formats() {
  fine(lodbake, 'report', '-o', 'report.html', '-o', 'report.md', '-o', 'report.sarif', '-o', 'report.xml', '-o', 'report.json', '--viewer', '--sheets', '3', 'pipeline.toml');

  const ajv = new Ajv({ strict: false, allErrors: true, unicodeRegExp: false });
  addFormats(ajv);
  const validate = ajv.compile(JSON.parse(await readFile(SARIF, 'utf8')));
  const sarif = JSON.parse(await readFile(at('report.sarif'), 'utf8'));
  judge('SARIF is valid by its official schema', validate(sarif), JSON.stringify(validate.errors?.slice(0, 3)));
  const results = sarif.runs[0].results;
  const named = results.slice(0, 20).map((r) => [r.ruleId, path.posix.basename(r.locations[0].physicalLocation.artifactLocation.uri)].join(' '));
  judge('SARIF names the vanished first', named[0] === REGRESSIONS[0].join(' '), named[0]);
  for (const one of REGRESSIONS) judge(`SARIF names ${one.join(' ')}`, named.includes(one.join(' ')), named.join('; '));

  const markdown = await readFile(at('report.md'), 'utf8');
  const rows = markdown.split('\n').filter((line) => line.startsWith('| **error** |'));
  judge('Markdown names the vanished first', rows[0]?.includes('boulder.glb'), rows[0]);
  judge('Markdown fits a comment', Buffer.byteLength(markdown) <= 65_536);

  const annotations = fine(lodbake, 'report', '-f', 'github').split('\n');
  judge('annotations name the vanished first', annotations[0].startsWith('::error file=scenes/boulder.glb,'), annotations[0]);

  const python = path.join(TOOLS, 'python');
  if (existsSync(python)) {
    const script = `import sys, json
from junitparser import JUnitXml, Failure
suites = JUnitXml.fromfile(sys.argv[1])
print(json.dumps([[c.name, [r.message for r in c.result if isinstance(r, Failure)]] for s in suites for c in s]))
assert suites.tests == sum(len(s) for s in suites) and suites.failures == 3`;
    const parsed = run(python, '-c', script, 'report.xml');
    judge('junitparser reads the JUnit file', parsed.code === 0, parsed.all);
    const cases = parsed.code === 0 ? JSON.parse(parsed.out) : [];
    judge('JUnit names the vanished first', cases[0]?.[0] === 'scenes/boulder.glb' && cases[0][1].length === 1, parsed.out);
    judge('JUnit fails the three', cases.filter(([, messages]) => messages.length).length === 3, parsed.out);
  } else {
    console.log(`left out: junitparser (not in ${TOOLS}; see .ci/run)`);
    if (process.env.CI) judge('junitparser is installed', false);
  }

  const bencher = JSON.parse(fine(lodbake, 'report', '-f', 'bencher'));
  judge('Bencher gets numbers', Object.values(bencher).every((b) => Object.values(b).every((m) => Number.isFinite(m.value))));
  const benchmark = JSON.parse(fine(lodbake, 'report', '-f', 'benchmark'));
  judge('customSmallerIsBetter is a list of figures', benchmark.length > 3 && benchmark.every((b) => b.name && b.unit && Number.isFinite(b.value)));
}

try {
  await plant();
  const unchanged = run(lodbake, 'diff', 'HEAD');
  await rm(at('out'), { recursive: true });
  await rm(at('.lodbake'), { recursive: true });
  fine(lodbake, '-q');
  const rebuilt = run(lodbake, 'diff', 'HEAD');
  judge('an unchanged rebuild has no change', unchanged.code === 0 && rebuilt.code === 0 && rebuilt.out.startsWith('no change: 4 scenes'), rebuilt.out);
  const tool = preCommit();
  await hooks(tool);

  await writeFile(at('pipeline.toml'), PIPELINE + PLANTED);
  const before = JSON.parse(await readFile(at('lodbake.report.json'), 'utf8')).scenes.find((s) => s.path === 'fern.glb');
  const bytes = before.outputs.reduce((sum, output) => sum + output.bytes, 0);
  await writeFile(at('scenes/fern.glb'), grown(await readFile(at('scenes/fern.glb')), Math.round(0.12 * bytes)));
  await rm(at('scenes/boulder.glb'));
  fine(lodbake, '-q');
  await hooksCatch(tool);
  const diff = run(lodbake, 'diff', '--json', 'HEAD');
  const changes = JSON.parse(diff.out).changes.filter((change) => change.is_regression);
  judge('diff fails', diff.code === 1);
  judge('diff names the vanished, the uglier, the grown', ['vanished', 'uglier', 'grew'].every((kind) => changes.some((c) => c.kind === kind)) && changes[0].scene === 'boulder.glb', diff.out.slice(0, 500));
  await formats();
  const page = await checkPage(at('report.html'), values.pictures);
  for (const [what, isTrue, more] of page) judge(what, isTrue, more);
} catch (error) {
  judge('the whole runs to its end', false, error.stack);
} finally {
  if (values.keep) console.log(`kept in ${folder}`);
  else await rm(folder, { recursive: true, force: true });
}
console.log(`${passed} passed, ${failed} failed`);
process.exitCode = failed === 0 ? 0 : 1;
