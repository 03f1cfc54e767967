// Applies the shape of a baked file to a glTF without simplifying anything: level k draws the first part of each
// index buffer. With it the client checks can be tested on their own. The rules stand in ARCHITECTURE.md, "Levels".
import { cp, mkdir, rm } from 'node:fs/promises';
import path from 'node:path';
import { readDocument, scenes, writeDocument } from './document.mjs';

const RATIOS = [0.5, 0.25, 0.1, 0.05];
const MOVED = ['mesh', 'skin', 'weights'];
const MODE_TRIANGLES = 4;

/** The primitive with fewer triangles; the same one where its indices cannot be cut short. */
function cut(json, primitive, ratio) {
  const compressed = primitive.extensions?.KHR_draco_mesh_compression;
  const indices = json.accessors?.[primitive.indices];
  if (compressed || (primitive.mode ?? MODE_TRIANGLES) !== MODE_TRIANGLES || !indices || indices.sparse) return { ...primitive };
  const { min: _min, max: _max, ...rest } = indices;
  const count = 3 * Math.max(1, Math.floor((indices.count / 3) * ratio));
  json.accessors.push({ ...rest, count: Math.min(count, indices.count) });
  return { ...primitive, indices: json.accessors.length - 1 };
}

/** One appended mesh per level for mesh `index`, made once. */
function levelMeshes(json, index, made) {
  if (!made.has(index)) {
    const ids = RATIOS.map((ratio) => {
      const mesh = json.meshes[index];
      json.meshes.push({ ...mesh, primitives: mesh.primitives.map((primitive) => cut(json, primitive, ratio)) });
      return json.meshes.length - 1;
    });
    made.set(index, ids);
  }
  return made.get(index);
}

/** The channels that drive the morph weights of `node`, each with its animation. */
function weightChannels(json, node) {
  const of = (animation) => animation.channels.filter(({ target }) => target?.node === node && target.path === 'weights');
  return (json.animations ?? []).flatMap((animation) => of(animation).map((channel) => ({ animation, channel })));
}

/** Repeats channels that drive morph weights for each node that now carries the mesh. */
function retarget(channels, carriers) {
  for (const { animation, channel } of channels) {
    channel.target.node = carriers[0];
    for (const node of carriers.slice(1)) animation.channels.push({ ...channel, target: { ...channel.target, node } });
  }
}

/** Gives every node with a mesh its child and levels; returns how many groups were made. */
export function addLevels(json) {
  const made = new Map();
  const nodes = (json.nodes ?? []).length;
  let count = 0;
  for (let anchor = 0; anchor < nodes; anchor++) {
    const node = json.nodes[anchor];
    if (!json.meshes?.[node.mesh]?.primitives || node.extensions?.MSFT_lod) continue;
    const carried = Object.fromEntries(MOVED.filter((key) => key in node).map((key) => [key, node[key]]));
    MOVED.forEach((key) => delete node[key]);
    const instancing = node.extensions?.EXT_mesh_gpu_instancing;
    if (instancing) {
      delete node.extensions.EXT_mesh_gpu_instancing;
      carried.extensions = { EXT_mesh_gpu_instancing: instancing };
    }
    const meshes = levelMeshes(json, carried.mesh, made);
    const channels = weightChannels(json, anchor);
    const child = json.nodes.length;
    const ids = meshes.map((_, k) => child + 1 + k);
    const group = { extensions: { MSFT_lod: { ids } }, extras: { MSFT_screencoverage: [...RATIOS, 0] } };
    const levels = meshes.map((mesh) => ({ ...carried, mesh }));
    if (channels.length === 0) {
      json.nodes.push({ ...carried, ...group, extensions: { ...carried.extensions, ...group.extensions } }, ...levels);
    } else {
      // three.js finds no morph weights on a node that became a LOD: the mesh must sit one node further down.
      json.nodes.push({ ...group, children: [child + 1 + meshes.length] }, ...levels, carried);
      retarget(channels, [child + 1 + meshes.length, ...ids]);
    }
    node.children = [...(node.children ?? []), child];
    count++;
  }
  if (count > 0) json.extensionsUsed = [...new Set([...(json.extensionsUsed ?? []), 'MSFT_lod'])];
  return count;
}

/** Copies `source` to `output` (made anew) and applies the form to every scene that `chosen` names. */
export async function formFolder(source, output, chosen = () => true) {
  await rm(output, { recursive: true, force: true });
  await mkdir(output, { recursive: true });
  const names = (await scenes(source)).filter(chosen);
  for (const name of names) {
    await cp(path.join(source, path.dirname(name)), path.join(output, path.dirname(name)), { recursive: true });
  }
  const kept = new Set(names);
  for (const name of await scenes(output)) {
    if (!kept.has(name)) await rm(path.join(output, name));
  }
  for (const name of names) {
    const document = await readDocument(path.join(source, name));
    addLevels(document.json);
    await writeDocument(path.join(output, name), document);
  }
  return names;
}

if (process.argv[1] === import.meta.filename) {
  const [source, output] = process.argv.slice(2);
  const names = await formFolder(source, output);
  console.log(`gave ${names.length} file(s) the form of a baked one`);
}
