#!/usr/bin/env node
// Do lodbake's figures of looks put levels in the same order as an independent renderer does? Draws what
// `lodbake evaluate --json` compared once more with three.js and correlates the ranks (Spearman).
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { open } from './browser.mjs';

const USAGE = `usage: node agree.mjs EVALUATION.json.. [--size N] [--least R]
  EVALUATION  what \`lodbake evaluate --json REFERENCE CANDIDATE..\` printed; paths in it are relative to this folder
  --size      pixels a side (default: as in the evaluation)
  --least     fails if the rank correlation over all candidates is less (default 0.95)`;

/** `file.glb@2` → { file, level } */
function subject(name) {
  const match = /^(.*)@(\d+)$/.exec(name);
  return match ? { file: match[1], level: Number(match[2]) } : { file: name, level: 0 };
}

/** Ranks from 1; equals share the mean of theirs. */
function ranks(values) {
  return values.map((value) => {
    const less = values.filter((v) => v < value).length;
    const equal = values.filter((v) => v === value).length;
    return less + (equal + 1) / 2;
  });
}

function correlation(a, b) {
  const mean = (values) => values.reduce((sum, v) => sum + v, 0) / values.length;
  const [p, q] = [mean(a), mean(b)];
  const dot = (f) => a.reduce((sum, _, i) => sum + f(i), 0);
  const [both, left, right] = [dot((i) => (a[i] - p) * (b[i] - q)), dot((i) => (a[i] - p) ** 2), dot((i) => (b[i] - q) ** 2)];
  return both / Math.sqrt(left * right);
}

const spearman = (a, b) => correlation(ranks(a), ranks(b));

async function main() {
  const options = { size: { type: 'string' }, least: { type: 'string', default: '0.95' }, help: { type: 'boolean', short: 'h' } };
  const { values, positionals } = parseArgs({ allowPositionals: true, options });
  if (values.help || positionals.length === 0) throw new Error(USAGE);
  const browser = await open(['agree']);
  const [ours, theirs] = [[], []];
  try {
    const page = await browser.page('agree', (kind, text) => console.error(`${kind}: ${browser.server.anonymous(text)}`));
    page.setDefaultTimeout(0);
    for (const file of positionals) {
      const { reference, candidates, size } = JSON.parse(await readFile(file, 'utf8'));
      const where = (name) => {
        const { file: scene, level } = subject(name);
        return { url: browser.server.url(path.resolve(scene)), level };
      };
      const request = [where(reference.name), candidates.map((c) => where(c.name)), Number(values.size ?? size)];
      const found = await page.evaluate(([r, c, s]) => globalThis.client.measure(r, c, s), request);
      found.forEach((rms, i) => {
        ours.push(candidates[i].d_rms);
        theirs.push(rms);
        console.log(`${candidates[i].d_rms.toFixed(3).padStart(8)} ${rms.toFixed(3).padStart(8)}  ${candidates[i].name}`);
      });
    }
  } finally {
    await browser.close();
  }
  const ratios = ours.map((value, i) => value / theirs[i]).filter((r) => Number.isFinite(r) && r > 0);
  const mean = Math.exp(ratios.reduce((sum, r) => sum + Math.log(r), 0) / ratios.length);
  const agreement = spearman(ours, theirs);
  console.log(`${ours.length} pairs: rank correlation ${agreement.toFixed(4)}; lodbake / three.js ${mean.toFixed(3)} (geometric mean), ${Math.min(...ratios).toFixed(3)} to ${Math.max(...ratios).toFixed(3)}`);
  const agrees = agreement >= Number(values.least);
  console.log(`${agrees ? 1 : 0} passed, ${agrees ? 0 : 1} failed`);
  if (!agrees) process.exitCode = 1;
}

main().catch((error) => {
  console.error(error.message);
  process.exit(2);
});
