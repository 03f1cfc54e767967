// Reads and writes the two containers of glTF as plain JSON and bytes, and finds a source's output. Knows no engine.
import { readFile, readdir, writeFile } from 'node:fs/promises';
import { existsSync } from 'node:fs';
import path from 'node:path';

const GLB_MAGIC = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x004e4942;

/** → { json, bin } ; `bin` is null for .gltf and for a .glb without a binary chunk. */
export async function readDocument(file) {
  const bytes = await readFile(file);
  if (bytes.length < 12 || bytes.readUInt32LE(0) !== GLB_MAGIC) return { json: JSON.parse(bytes.toString('utf8')), bin: null };
  let json = null;
  let bin = null;
  for (let at = 12; at + 8 <= bytes.length; ) {
    const length = bytes.readUInt32LE(at);
    const kind = bytes.readUInt32LE(at + 4);
    const body = bytes.subarray(at + 8, at + 8 + length);
    if (kind === JSON_CHUNK) json = JSON.parse(body.toString('utf8'));
    if (kind === BIN_CHUNK) bin ??= body;
    at += 8 + length;
  }
  return { json, bin };
}

/** Writes `json` and `bin` as .glb or .gltf, by the ending of `file`. */
export async function writeDocument(file, { json, bin }) {
  if (!file.endsWith('.glb')) return writeFile(file, JSON.stringify(json));
  const text = Buffer.from(JSON.stringify(json));
  const chunks = [[JSON_CHUNK, Buffer.concat([text, Buffer.alloc(-text.length & 3, 0x20)])]];
  if (bin) chunks.push([BIN_CHUNK, Buffer.concat([bin, Buffer.alloc(-bin.length & 3)])]);
  const parts = [Buffer.alloc(12)];
  for (const [kind, body] of chunks) {
    const head = Buffer.alloc(8);
    head.writeUInt32LE(body.length, 0);
    head.writeUInt32LE(kind, 4);
    parts.push(head, body);
  }
  const whole = Buffer.concat(parts);
  whole.writeUInt32LE(GLB_MAGIC, 0);
  whole.writeUInt32LE(2, 4);
  whole.writeUInt32LE(whole.length, 8);
  return writeFile(file, whole);
}

/** Every .gltf and .glb below `folder`, as sorted relative paths. */
export async function scenes(folder) {
  const entries = await readdir(folder, { recursive: true, withFileTypes: true });
  return entries
    .filter((entry) => entry.isFile() && /\.(gltf|glb)$/i.test(entry.name))
    .map((entry) => path.relative(folder, path.join(entry.parentPath ?? entry.path, entry.name)))
    .sort((a, b) => (a < b ? -1 : 1));
}

/**
 * The outputs below `output`, each with its source: `{ name, source, output }`, and the sources that have none.
 * An output has its source's path; the ending may differ where the source has only one file of that stem.
 */
export async function pairUp(source, output) {
  const pairs = [];
  const missing = [];
  for (const name of await scenes(source)) {
    const other = /\.glb$/i.test(name) ? '.gltf' : '.glb';
    const twin = name.replace(/\.(gltf|glb)$/i, other);
    const candidates = existsSync(path.join(source, twin)) ? [name] : [name, twin];
    const found = candidates.find((candidate) => existsSync(path.join(output, candidate)));
    if (found) pairs.push({ name, source: path.join(source, name), output: path.join(output, found) });
    else missing.push(name);
  }
  return { pairs, missing };
}

/** The nodes of the default scene: engines load no others (and all of its levels). */
function inScene(json) {
  const seen = new Set();
  const open = [...(json.scenes?.[json.scene ?? 0]?.nodes ?? [])];
  while (open.length > 0) {
    const node = open.pop();
    if (seen.has(node)) continue;
    seen.add(node);
    open.push(...(json.nodes?.[node]?.children ?? []));
  }
  return seen;
}

/**
 * The groups of levels in the default scene: `{ node, anchor, levels, coverage }`; `anchor` is the parent, or -1.
 * `anchors` leads from each node of a group, and from what hangs below it, to the group's anchor.
 */
export function groups(json) {
  const nodes = json.nodes ?? [];
  const parent = new Map();
  nodes.forEach((node, i) => (node.children ?? []).forEach((child) => parent.set(child, i)));
  const found = [];
  const anchors = {};
  const claim = (node, anchor) => {
    anchors[node] = anchor;
    (nodes[node]?.children ?? []).forEach((child) => claim(child, anchor));
  };
  for (const i of [...inScene(json)].sort((a, b) => a - b)) {
    const ids = nodes[i]?.extensions?.MSFT_lod?.ids;
    if (!Array.isArray(ids)) continue;
    const anchor = parent.get(i) ?? -1;
    found.push({ node: i, anchor, levels: [i, ...ids], coverage: nodes[i].extras?.MSFT_screencoverage });
    [i, ...ids].forEach((node) => claim(node, anchor));
  }
  return { found, anchors };
}
