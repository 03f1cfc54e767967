#!/usr/bin/env node
// The Khronos glTF-Validator on every output and its source: an output may have no error that its source has not.
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import validator from 'gltf-validator';
import { pairUp, readDocument } from './document.mjs';

const SEVERITY_ERROR = 0;
const USAGE = 'usage: node validate.mjs SOURCE_DIR OUTPUT_DIR';

async function report(file) {
  const folder = path.dirname(file);
  const options = {
    uri: path.basename(file),
    format: /\.glb$/i.test(file) ? 'glb' : 'gltf',
    maxIssues: 0,
    writeTimestamp: false,
    externalResourceFunction: async (uri) => new Uint8Array(await readFile(path.join(folder, decodeURIComponent(uri)))),
  };
  const result = await validator.validateBytes(new Uint8Array(await readFile(file)), options).catch((error) => ({
    issues: { messages: [{ code: 'UNREADABLE', severity: SEVERITY_ERROR, message: String(error.message ?? error), pointer: '' }] },
  }));
  return result.issues.messages.filter((message) => message.severity === SEVERITY_ERROR);
}

/** Messages by code. */
function byCode(messages) {
  const codes = new Map();
  for (const message of messages) codes.set(message.code, [...(codes.get(message.code) ?? []), message]);
  return codes;
}

/**
 * Errors of the output beyond the source's, by code and count. A level repeats the attributes of its mesh, so an error
 * *on a primitive* that the source has may come back once per level: a code known from the source counts only
 * where an output has it in a place that the source also has, that is below its array lengths, and there more often.
 */
export function offenders(source, output, counts) {
  const before = byCode(source);
  const found = [];
  for (const [code, messages] of byCode(output)) {
    const known = before.get(code) ?? [];
    if (known.length === 0) found.push({ code, before: 0, after: messages.length, example: messages[0] });
    else {
      const inherited = messages.filter((message) => !isAppended(message.pointer, counts));
      if (inherited.length > known.length) found.push({ code, before: known.length, after: inherited.length, example: inherited.at(-1) });
    }
  }
  return found;
}

/** Whether a JSON pointer leads into an array element that the source does not have. */
function isAppended(pointer, counts) {
  const match = /^\/(\w+)\/(\d+)/.exec(pointer ?? '');
  return match !== null && Number(match[2]) >= (counts[match[1]] ?? 0);
}

/** What is wrong with one output, a line each. */
export async function judgePair(pair) {
  const found = offenders(await report(pair.source), await report(pair.output), await arrayLengths(pair.source));
  return found.map(({ code, before, after, example }) => {
    return `${code}: ${before} in the source, ${after} in the output; ${example.pointer}: ${example.message}`;
  });
}

async function main() {
  const [source, output] = process.argv.slice(2);
  if (!output) throw new Error(USAGE);
  const { pairs, missing } = await pairUp(source, output);
  let failed = 0;
  for (const pair of pairs) {
    const found = await judgePair(pair);
    if (found.length > 0) failed++;
    for (const line of found) console.log(`${pair.name}: ${line}`);
  }
  if (missing.length > 0) console.log(`${missing.length} source(s) without an output: ${missing.join(', ')}`);
  if (pairs.length === 0) throw new Error(`no output of ${source} found in ${output}`);
  console.log(`validator ${validator.version()}: ${pairs.length} outputs against their sources`);
  console.log(`${pairs.length - failed} passed, ${failed} failed`);
  process.exitCode = failed > 0 ? 1 : 0;
}

async function arrayLengths(file) {
  const { json } = await readDocument(file).catch(() => ({ json: {} }));
  return Object.fromEntries(Object.entries(json ?? {}).filter(([, v]) => Array.isArray(v)).map(([key, v]) => [key, v.length]));
}

if (process.argv[1] === import.meta.filename) {
  await main().catch((error) => {
    console.error(error.message);
    process.exit(2);
  });
}
