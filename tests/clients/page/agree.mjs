// three.js as an independent judge of looks: draws a reference and candidates from the 24 views and answers d_RMS.
// Camera, lamp and backdrop follow ARCHITECTURE.md, "How looks are measured"; everything else is three.js's own.
import * as THREE from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { DRACOLoader } from 'three/examples/jsm/loaders/DRACOLoader.js';
import { KTX2Loader } from 'three/examples/jsm/loaders/KTX2Loader.js';
import { MeshoptDecoder } from 'meshoptimizer/decoder';
import GLTFLodExtension from 'three-gltf-extensions/loaders/MSFT_lod/MSFT_lod.js';
import { rhombicuboctahedron } from './views.mjs';

const FIELD_OF_VIEW = 45;
const MARGIN = 1.02;
const LAMP = 0.9;
const EVEN = 0.1;
const BACKDROP = 192 / 255;

let renderer;
let loader;
let even;

function start(urls) {
  renderer = new THREE.WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
  renderer.setPixelRatio(1);
  renderer.setClearColor(new THREE.Color().setRGB(BACKDROP, BACKDROP, BACKDROP, THREE.SRGBColorSpace), 1);
  const draco = new DRACOLoader().setDecoderPath(urls.draco);
  const ktx2 = new KTX2Loader().setTranscoderPath(urls.basis).detectSupport(renderer);
  loader = new GLTFLoader().setDRACOLoader(draco).setKTX2Loader(ktx2).setMeshoptDecoder(MeshoptDecoder);
  loader.register((parser) => new GLTFLodExtension(parser));
  const white = new THREE.Scene();
  white.background = new THREE.Color(1, 1, 1);
  even = new THREE.PMREMGenerator(renderer).fromScene(white).texture;
}

/** The scene of `url` with level `level` of every group shown. */
async function load(url, level) {
  const gltf = await loader.loadAsync(url);
  const stage = new THREE.Scene();
  stage.environment = even;
  stage.environmentIntensity = EVEN;
  stage.add(gltf.scene);
  gltf.scene.traverse((object) => {
    object.frustumCulled = false;
    if (object.isLight) object.visible = false;
    for (const material of [object.material ?? []].flat()) material.aoMap = null;
    if (!object.isLOD) return;
    object.autoUpdate = false;
    object.levels.forEach((one, i) => (one.object.visible = i === Math.min(level, object.levels.length - 1)));
  });
  stage.updateMatrixWorld(true);
  return stage;
}

function free(stage) {
  stage.traverse((object) => {
    object.geometry?.dispose();
    for (const material of [object.material ?? []].flat()) {
      for (const value of Object.values(material)) if (value?.isTexture) (value.dispose(), value.image?.close?.());
      material.dispose();
    }
  });
  renderer.renderLists.dispose();
}

/** Every vertex that is drawn, in world space. */
function points(stage, visit) {
  const point = new THREE.Vector3();
  const place = new THREE.Matrix4();
  stage.traverseVisible((object) => {
    if (!object.isMesh) return;
    for (let k = 0; k < (object.isInstancedMesh ? object.count : 1); k++) {
      place.copy(object.matrixWorld);
      if (object.isInstancedMesh) (object.getMatrixAt(k, place), place.premultiply(object.matrixWorld));
      const index = object.geometry.index;
      const count = index ? index.count : object.geometry.attributes.position.count;
      for (let i = 0; i < count; i++) visit(object.getVertexPosition(index ? index.getX(i) : i, point).applyMatrix4(place));
    }
  });
}

/** The sphere round the middle of the box, up to the farthest vertex. */
function frameOf(stage) {
  const box = new THREE.Box3();
  points(stage, (p) => box.expandByPoint(p));
  const center = box.getCenter(new THREE.Vector3());
  let most = 0;
  points(stage, (p) => (most = Math.max(most, p.distanceToSquared(center))));
  return { center, radius: Math.sqrt(most) || 1 };
}

/** Luminance of every pixel from one direction, 0..255. */
function luminance(stage, frame, direction, size) {
  const distance = (frame.radius * MARGIN) / Math.sin((FIELD_OF_VIEW / 2) * (Math.PI / 180));
  const camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, distance - 1.5 * frame.radius, distance + 1.5 * frame.radius);
  camera.position.copy(frame.center).addScaledVector(new THREE.Vector3(...direction), distance);
  camera.lookAt(frame.center);
  camera.updateMatrixWorld(true);
  const lamp = new THREE.PointLight(0xffffff, Math.PI * LAMP, 0, 0);
  lamp.position.copy(camera.position);
  stage.add(lamp);
  renderer.setSize(size, size, false);
  renderer.render(stage, camera);
  stage.remove(lamp);
  const gl = renderer.getContext();
  const rgba = new Uint8Array(4 * size * size);
  gl.readPixels(0, 0, size, size, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
  const values = new Float32Array(size * size);
  for (let i = 0; i < values.length; i++) values[i] = 0.2126 * rgba[4 * i] + 0.7152 * rgba[4 * i + 1] + 0.0722 * rgba[4 * i + 2];
  return values;
}

/** d_RMS of each of `candidates` = [{ url, level }] against `reference` = { url, level }. */
async function measure(reference, candidates, size) {
  const directions = rhombicuboctahedron();
  const source = await load(reference.url, reference.level);
  const frame = frameOf(source);
  const views = directions.map((direction) => luminance(source, frame, direction, size));
  free(source);
  const found = [];
  for (const { url, level } of candidates) {
    const stage = await load(url, level);
    let sum = 0;
    directions.forEach((direction, v) => luminance(stage, frame, direction, size).forEach((y, i) => (sum += (y - views[v][i]) ** 2)));
    free(stage);
    found.push(Math.sqrt(sum / (24 * size * size)));
  }
  return found;
}

globalThis.client = { start, measure };
