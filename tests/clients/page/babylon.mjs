// Babylon.js in the page: loads a glTF with MSFT_lod to the end (coarse levels come first and are replaced), draws it
// from fixed cameras. Knows nothing of files and verdicts; load.mjs drives it through `globalThis.client`.
import {
  AppendSceneAsync,
  Color4,
  DirectionalLight,
  DracoDecoder,
  Engine,
  FreeCamera,
  HemisphericLight,
  KhronosTextureContainer2,
  Logger,
  MeshoptCompression,
  Scene,
  SceneLoader,
  Vector3,
} from '@babylonjs/core';
import '@babylonjs/loaders/glTF/index.js';
import { FIELD_OF_VIEW } from './views.mjs';
import { client, covered } from './check.mjs';

const FRAMES_PER_SECOND = 60; // what the loader converts animation times with
const MAX_LIGHTS = 4;

let engine;
let scene = null;
let plan = null;
let head;

function start(urls) {
  const canvas = document.createElement('canvas');
  engine = new Engine(canvas, false, { preserveDrawingBuffer: true, stencil: false, powerPreference: 'low-power', audioEngine: false });
  engine.enableOfflineSupport = false;
  engine.disableManifestCheck = true;
  Logger.LogLevels = Logger.ErrorLogLevel;
  DracoDecoder.DefaultConfiguration = {
    wasmUrl: `${urls.babylon}Draco/draco_wasm_wrapper_gltf.js`,
    wasmBinaryUrl: `${urls.babylon}Draco/draco_decoder_gltf.wasm`,
    fallbackUrl: `${urls.babylon}Draco/draco_decoder_gltf.js`,
  };
  MeshoptCompression.Configuration = { decoder: { url: `${urls.babylon}meshopt/meshopt_decoder.js` } };
  // No package carries Babylon's KTX2 transcoder, only its content network. One grey pixel stands for such an image, so
  // that the rest of the file is checked; three.js shows the images themselves.
  KhronosTextureContainer2.prototype._decodeAsync = async () => ({
    transcodedFormat: 0x8058,
    isInGammaSpace: false,
    hasAlpha: false,
    mipmaps: [{ data: new Uint8Array([128, 128, 128, 255]), width: 1, height: 1 }],
  });
}

/** Loads `url` to the end; `options.lods` limits the levels, coarsest first. Returns how many levels arrived. */
async function load(url, options) {
  scene?.dispose();
  plan = options;
  scene = new Scene(engine);
  scene.useRightHandedSystem = true;
  scene.clearColor = new Color4(0, 0, 0, 0);
  scene.skipFrustumClipping = true;
  head = new DirectionalLight('head', new Vector3(0, 0, -1), scene);
  head.intensity = 3;
  new HemisphericLight('ambient', new Vector3(0, 1, 0), scene).intensity = 0.6;
  let complete = null;
  let arrived = 0;
  SceneLoader.OnPluginActivatedObservable.addOnce((plugin) => {
    // Asked for now: a file without images can be complete before the scene is handed over, and it is told only once.
    complete = plugin.whenCompleteAsync();
    complete.catch(() => {}); // a file that does not load is told by AppendSceneAsync
    plugin.onExtensionLoadedObservable.add((extension) => {
      if (extension.name !== 'MSFT_lod') return;
      extension.onNodeLODsLoadedObservable.add((level) => (arrived = Math.max(arrived, level + 1)));
    });
  });
  const gltf = {
    animationStartMode: 0,
    // Instances batched in the order of loading would draw coplanar faces in another order than the source.
    createInstances: false,
    useRangeRequests: options.ranges ?? false,
    extensionOptions: { MSFT_lod: { maxLODsToLoad: options.lods ?? 100 } },
  };
  await AppendSceneAsync(url, scene, { pluginOptions: { gltf } });
  await complete;
  // A file's own lights raise this without limit, and with it the shader past what the driver takes.
  for (const material of scene.materials) material.maxSimultaneousLights = MAX_LIGHTS;
  const key = sortKeys();
  const bySource = (a, b) => key(a) - key(b);
  const byDepth = (a, b) => b._distanceToCamera - a._distanceToCamera || bySource(a, b);
  scene.setRenderingOrder(0, bySource, bySource, byDepth);
  return arrived;
}

/** Sub-meshes by the source node they belong to, whatever order they were loaded in. */
function sortKeys() {
  const keys = new Map();
  const numbers = (object, pattern) => (object?._internalMetadata?.gltf?.pointers ?? []).flatMap((p) => pattern.exec(p)?.slice(1).map(Number) ?? []);
  return (subMesh) => {
    const mesh = subMesh.getMesh();
    if (!keys.has(mesh)) {
      const [node = 1e6] = [mesh, mesh.parent].flatMap((object) => numbers(object, /^\/nodes\/(\d+)/));
      const [index = 0, primitive = 0] = numbers(mesh, /^\/meshes\/(\d+)\/primitives\/(\d+)/);
      const anchor = plan.anchors?.[node] ?? node;
      keys.set(mesh, anchor * 1e6 + (anchor === 1e6 ? index * 1e3 : 0) + primitive);
    }
    return keys.get(mesh);
  };
}

/** Meshes with geometry that are shown now. */
function shown() {
  return scene.meshes.filter((mesh) => mesh.isEnabled() && mesh.isVisible && mesh.getTotalVertices() > 0);
}

function sphere() {
  let min = null;
  let max = null;
  for (const mesh of shown()) {
    mesh.computeWorldMatrix(true);
    const box = mesh.getBoundingInfo().boundingBox;
    min = min ? Vector3.Minimize(min, box.minimumWorld) : box.minimumWorld.clone();
    max = max ? Vector3.Maximize(max, box.maximumWorld) : box.maximumWorld.clone();
  }
  if (!min) return { center: [0, 0, 0], radius: 1 };
  return { center: min.add(max).scale(0.5).asArray(), radius: max.subtract(min).length() / 2 };
}

function seek(seconds) {
  for (const group of scene.animationGroups) {
    group.start(false);
    group.pause();
    group.goToFrame(Math.min(seconds * FRAMES_PER_SECOND, group.to));
  }
}

async function draw(view, size) {
  if (engine.getRenderWidth() !== size || engine.getRenderHeight() !== size) engine.setSize(size, size);
  const camera = new FreeCamera('view', Vector3.FromArray(view.eye), scene);
  camera.setTarget(Vector3.FromArray(view.target));
  camera.fov = (FIELD_OF_VIEW * Math.PI) / 180;
  [camera.minZ, camera.maxZ] = [view.near, view.far];
  scene.activeCamera = camera;
  head.direction = Vector3.FromArray(view.target).subtract(camera.position).normalize();
  await scene.whenReadyAsync(true);
  scene.render(true, true);
  const gl = engine._gl;
  const rgba = new Uint8Array(4 * size * size);
  gl.readPixels(0, 0, size, size, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
  camera.dispose();
  return rgba;
}

const drawnTimes = (mesh) => (mesh.hasThinInstances ? mesh.thinInstanceCount : 1);

function triangles() {
  return shown().reduce((sum, mesh) => sum + (mesh.getTotalIndices() / 3) * drawnTimes(mesh), 0);
}

function facts() {
  const meshes = shown();
  const materials = new Set(meshes.map((mesh) => mesh.material));
  const textures = new Set([...materials].flatMap((material) => material?.getActiveTextures() ?? []));
  return {
    meshes: meshes.length,
    triangles: Math.round(triangles()),
    vertices: meshes.reduce((sum, mesh) => sum + mesh.getTotalVertices(), 0),
    skinned: meshes.filter((mesh) => mesh.skeleton).length,
    morphed: meshes.filter((mesh) => mesh.morphTargetManager?.numTargets > 0).length,
    drawn: meshes.reduce((sum, mesh) => sum + drawnTimes(mesh), 0),
    instances: meshes.reduce((sum, mesh) => sum + (mesh.hasThinInstances ? mesh.thinInstanceCount : 0), 0),
    materials: [...materials].map((material) => material?.name ?? '').sort(),
    textures: textures.size,
    skeletons: scene.skeletons.map((skeleton) => skeleton.bones.length).sort((a, b) => a - b),
    lights: scene.lights.length - 2,
    cameras: scene.cameras.length,
    animations: scene.animationGroups.map((group) => ({
      name: group.name,
      seconds: Math.round((1000 * (group.to - group.from)) / FRAMES_PER_SECOND) / 1000,
      tracks: group.targetedAnimations.filter((one) => one.animation.targetProperty !== 'influence').length,
    })),
  };
}

/** Babylon keeps no levels: each is seen by loading the file only as far as that level. */
async function levels(url, options, view) {
  const found = [];
  for (let lods = 1; lods < options.levels; lods++) {
    if (lods > 1 && options.coarsestOnly) break;
    const arrived = await load(url, { ...options, lods });
    const pixels = covered(await draw(view, view.size));
    found.unshift({ level: options.levels - lods, arrived, triangles: Math.round(triangles()), pixels });
  }
  return found;
}

globalThis.client = client({ start, load, facts, sphere, seek, draw, levels });
