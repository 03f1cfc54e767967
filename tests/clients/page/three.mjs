// three.js in the page: loads a glTF with MSFT_lod, shows a level, draws it from fixed cameras.
// Knows nothing of files and verdicts; load.mjs and picture.mjs drive it through `globalThis.client`.
import * as THREE from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { DRACOLoader } from 'three/examples/jsm/loaders/DRACOLoader.js';
import { KTX2Loader } from 'three/examples/jsm/loaders/KTX2Loader.js';
import { RoomEnvironment } from 'three/examples/jsm/environments/RoomEnvironment.js';
import { MeshoptDecoder } from 'meshoptimizer/decoder';
import GLTFLodExtension from 'three-gltf-extensions/loaders/MSFT_lod/MSFT_lod.js';
import { FIELD_OF_VIEW, camera as cameraOf, rhombicuboctahedron } from './views.mjs';
import { client, covered } from './check.mjs';

let renderer;
let loader;
let pictureLight;
let current = null;

function start(urls) {
  renderer = new THREE.WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
  renderer.setPixelRatio(1);
  renderer.setClearColor(0x000000, 0);
  const draco = new DRACOLoader().setDecoderPath(urls.draco);
  const ktx2 = new KTX2Loader().setTranscoderPath(urls.basis).detectSupport(renderer);
  loader = new GLTFLoader().setDRACOLoader(draco).setKTX2Loader(ktx2).setMeshoptDecoder(MeshoptDecoder);
  loader.register((parser) => new GLTFLodExtension(parser));
}

/** Frees what the last file held on the GPU. */
function clear() {
  if (!current) return;
  current.scene.traverse((object) => {
    object.geometry?.dispose();
    object.skeleton?.dispose();
    for (const material of [object.material ?? []].flat()) {
      for (const value of Object.values(material)) if (value?.isTexture) (value.dispose(), value.image?.close?.());
      material.dispose();
    }
  });
  renderer.renderLists.dispose();
  current = null;
}

/** Loads `url` and shows level 0; `anchors` (see document.mjs) puts what is drawn in the source's order. */
async function load(url, { anchors = {} } = {}) {
  clear();
  const gltf = await loader.loadAsync(url);
  gltf.scene ??= new THREE.Group(); // a file may have no scene
  const stage = new THREE.Scene();
  const lods = [];
  stage.add(gltf.scene);
  gltf.scene.traverse((object) => {
    object.frustumCulled = false;
    if (object.isLOD) (lods.push(object), (object.autoUpdate = false));
  });
  current = { gltf, stage, scene: gltf.scene, lods, mixer: null };
  const key = sortKeys(gltf.parser, anchors);
  const bySource = (a, b) => a.groupOrder - b.groupOrder || key(a.object) - key(b.object) || a.id - b.id;
  renderer.setOpaqueSort(bySource);
  renderer.setTransparentSort((a, b) => a.groupOrder - b.groupOrder || b.z - a.z || bySource(a, b));
  show(0);
  stage.updateMatrixWorld(true);
  return { levels: Math.max(1, ...lods.map((lod) => lod.levels.length)), animations: gltf.animations.length };
}

/** Objects by the source node they belong to, whatever order they were loaded in. */
function sortKeys(parser, anchors) {
  const keys = new Map();
  return (object) => {
    if (!keys.has(object)) {
      let owner = object;
      while (owner && parser.associations.get(owner)?.nodes === undefined) owner = owner.parent;
      const node = owner ? parser.associations.get(owner).nodes : 1e6;
      keys.set(object, (anchors[node] ?? node) * 1e3 + (parser.associations.get(object)?.primitives ?? 0));
    }
    return keys.get(object);
  };
}

/** Objects with geometry that are shown now. */
function shown() {
  const found = [];
  current.scene.traverseVisible((object) => object.geometry && found.push(object));
  return found;
}

/** The bounding sphere of the box round everything drawn, as drawn now. */
function sphere() {
  const box = new THREE.Box3();
  const one = new THREE.Box3();
  for (const object of shown()) {
    // Skins and instances know their own bounds; `expandByObject` would count hidden levels among the children.
    if (object.isSkinnedMesh || object.isInstancedMesh) (object.computeBoundingBox(), one.copy(object.boundingBox));
    else (object.geometry.computeBoundingBox(), one.copy(object.geometry.boundingBox));
    if (!one.isEmpty()) box.union(one.applyMatrix4(object.matrixWorld));
  }
  const ball = box.isEmpty() ? new THREE.Sphere(new THREE.Vector3(), 1) : box.getBoundingSphere(new THREE.Sphere());
  return { center: ball.center.toArray(), radius: ball.radius };
}

/** Shows level `k` of every group, the last one where a group has fewer. */
function show(k) {
  for (const lod of current.lods) {
    lod.levels.forEach((level, i) => (level.object.visible = i === Math.min(k, lod.levels.length - 1)));
  }
}

function seek(seconds) {
  const { gltf, scene } = current;
  current.mixer ??= new THREE.AnimationMixer(scene);
  for (const clip of gltf.animations) current.mixer.clipAction(clip).play();
  current.mixer.setTime(seconds);
  current.stage.updateMatrixWorld(true);
}

function triangles() {
  let count = 0;
  for (const object of shown()) {
    if (!object.isMesh) continue;
    const { index, attributes } = object.geometry;
    count += ((index ?? attributes.position).count / 3) * (object.isInstancedMesh ? object.count : 1);
  }
  return Math.round(count);
}

function facts() {
  const objects = shown();
  const materials = new Set(objects.flatMap((object) => object.material));
  const textures = new Set([...materials].flatMap((material) => Object.values(material).filter((value) => value?.isTexture)));
  const skeletons = new Set(objects.filter((object) => object.skeleton).map((object) => object.skeleton));
  const { gltf, scene } = current;
  const nodes = new Set();
  let lights = 0;
  scene.traverse((object) => {
    lights += object.isLight ? 1 : 0;
    const node = gltf.parser.associations.get(object)?.nodes;
    if (node !== undefined) nodes.add(node);
  });
  return {
    meshes: objects.length,
    triangles: triangles(),
    vertices: objects.reduce((sum, object) => sum + (object.geometry.attributes.position?.count ?? 0), 0),
    skinned: objects.filter((object) => object.isSkinnedMesh).length,
    morphed: objects.filter((object) => object.morphTargetInfluences?.length > 0).length,
    drawn: objects.reduce((sum, object) => sum + (object.isInstancedMesh ? object.count : 1), 0),
    instances: objects.reduce((sum, object) => sum + (object.isInstancedMesh ? object.count : 0), 0),
    materials: [...materials].map((material) => `${material.type} ${material.name}`).sort(),
    textures: textures.size,
    skeletons: [...skeletons].map((skeleton) => skeleton.bones.length).sort((a, b) => a - b),
    lights,
    cameras: gltf.cameras.length,
    animations: gltf.animations.map((clip) => ({
      name: clip.name,
      seconds: Math.round(1000 * clip.duration) / 1000,
      tracks: clip.tracks.filter((track) => !track.name.endsWith('.morphTargetInfluences')).length,
    })),
    nodes: [...nodes].sort((a, b) => a - b),
    groups: current.lods.map((lod) => [gltf.parser.associations.get(lod.levels[0].object)?.nodes, lod.levels.length]).sort((a, b) => a[0] - b[0]),
  };
}

/** Shows each level of the file that stands on the stage. */
async function levels(_url, options, view) {
  const found = [];
  for (let level = 1; level < options.levels; level++) {
    show(level);
    found.push({ level, triangles: triangles(), pixels: covered(pixelsOf(view, view.size)) });
  }
  show(0);
  return found;
}

function draw(view, size) {
  const camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, view.near, view.far);
  camera.position.fromArray(view.eye);
  if (Math.abs(view.eye[0] - view.target[0]) + Math.abs(view.eye[2] - view.target[2]) < 1e-9) camera.up.set(0, 0, -1);
  camera.lookAt(...view.target);
  camera.updateMatrixWorld(true);
  const head = new THREE.DirectionalLight(0xffffff, 3);
  head.position.copy(camera.position);
  head.target.position.fromArray(view.target);
  const lights = [head, head.target, new THREE.AmbientLight(0xffffff, 0.6)];
  current.stage.add(...lights);
  renderer.setSize(size, size, false);
  renderer.render(current.stage, camera);
  current.stage.remove(...lights);
}

function pixelsOf(view, size) {
  draw(view, size);
  const gl = renderer.getContext();
  const rgba = new Uint8Array(4 * size * size);
  gl.readPixels(0, 0, size, size, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
  return rgba;
}

/** Draws cells of one file (already loaded) onto a row of the sheet, which `picture` made. */
function paintRow(sheet, row, request) {
  const { size, levels, views, frame, label, wire } = request;
  if (!pictureLight) {
    const generator = new THREE.PMREMGenerator(renderer);
    pictureLight = generator.fromScene(new RoomEnvironment(), 0.04).texture;
  }
  current.stage.environment = pictureLight;
  current.stage.environmentIntensity = 0.5;
  current.stage.background = new THREE.Color(0xe8e8ec);
  current.scene.traverse((object) => [object.material ?? []].flat().forEach((m) => (m.wireframe = wire)));
  const directions = rhombicuboctahedron();
  let column = 0;
  for (const level of levels) {
    show(level);
    const caption = `${label}  L${level}  ${triangles().toLocaleString('en')} tri`;
    for (const view of views) {
      draw(cameraOf(frame, directions[view % 24]), size);
      const [x, y] = [column++ * size, row * (size + 16)];
      sheet.drawImage(renderer.domElement, x, y + 16);
      sheet.fillText(`${caption}  v${view}`, x + 4, y + 12, size - 8);
    }
  }
}

/** Draws `rows` = [{ url, label, levels: [..] | null for all, time }] and returns a PNG as base64. */
async function picture(rows, { size, views, wire, sameFrame }) {
  const canvas = document.createElement('canvas');
  const facts = [];
  let sheet = null;
  let first = null;
  for (const [i, row] of rows.entries()) {
    const loaded = await load(row.url);
    const levels = row.levels ?? [...Array(loaded.levels).keys()];
    if (row.time > 0) seek(row.time);
    const own = sphere();
    first ??= own;
    if (!sheet) {
      const columns = Math.max(levels.length, ...rows.map((r) => r.levels?.length ?? loaded.levels)) * views.length;
      canvas.width = columns * size;
      canvas.height = rows.length * (size + 16);
      sheet = canvas.getContext('2d');
      sheet.fillStyle = '#fff';
      sheet.fillRect(0, 0, canvas.width, canvas.height);
      sheet.fillStyle = '#000';
      sheet.font = '12px sans-serif';
    }
    paintRow(sheet, i, { size, levels, views, frame: sameFrame ? first : own, label: row.label, wire });
    facts.push(loaded);
  }
  clear();
  return { png: canvas.toDataURL('image/png').split(',')[1], facts };
}

globalThis.client = client({ start, picture, load, facts, sphere, seek, draw: pixelsOf, levels });
