// The live view of a report page: shows a written scene and switches its levels by distance as an engine would, by the
// distances that lodbake wrote beside them. Bundled with three.js into viewer.min.js by build.mjs. Knows nothing of
// reports: it looks for `.view` elements, each with a model in base64.
import {
  Box3,
  DirectionalLight,
  HemisphereLight,
  PMREMGenerator,
  PerspectiveCamera,
  Scene,
  Sphere,
  Vector3,
  WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { RoomEnvironment } from 'three/examples/jsm/environments/RoomEnvironment.js';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/examples/jsm/libs/meshopt_decoder.module.js';

/** The slider's ends, in radii of the scene: from close by to where everything shows its coarsest level. */
const NEAREST = 1.5;
const STEPS = 1000;
const FIELD_OF_VIEW = 45;

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

/** Every MSFT_lod group: its levels as objects, finest first, and from where each of the coarser may be shown. */
async function groupsOf(gltf) {
  const { parser } = gltf;
  const found = [];
  gltf.scene.traverse((object) => {
    const index = parser.associations.get(object)?.nodes;
    const node = index === undefined ? undefined : parser.json.nodes[index];
    const ids = node?.extensions?.MSFT_lod?.ids;
    if (ids && !found.some((group) => group.index === index)) found.push({ index, node, ids, base: object });
  });
  for (const group of found) {
    group.levels = [group.base];
    for (const id of group.ids) {
      const level = await parser.getDependency('node', id);
      group.base.parent.add(level);
      group.levels.push(level);
    }
    group.distances = group.node.extras?.lodbake?.distances ?? [];
    group.base.updateWorldMatrix(true, false);
    const scale = new Vector3();
    group.base.matrixWorld.decompose(new Vector3(), group.base.quaternion.clone(), scale);
    group.scale = Math.max(Math.abs(scale.x), Math.abs(scale.y), Math.abs(scale.z));
    group.place = new Box3().setFromObject(group.base).getCenter(new Vector3());
  }
  return found;
}

function element(name, attributes, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

const figure = (number) => (number < 100 ? Number(number.toPrecision(3)) : Math.round(number)).toLocaleString('en');

async function show(view) {
  const model = bytesOf(view.querySelector('script').textContent);
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  const gltf = await loader.parseAsync(model, '');
  const scene = new Scene();
  scene.add(gltf.scene);
  gltf.scene.updateMatrixWorld(true);
  const sphere = new Box3().setFromObject(gltf.scene).getBoundingSphere(new Sphere());
  const radius = sphere.radius || 1;
  const groups = await groupsOf(gltf);

  const canvas = element('canvas', { role: 'img', 'aria-label': `${view.dataset.name}, in 3-D; drag to turn it` });
  const renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  const generator = new PMREMGenerator(renderer);
  scene.environment = generator.fromScene(new RoomEnvironment(), 0.04).texture;
  generator.dispose();
  scene.environmentIntensity = 0.7;
  const lamp = new DirectionalLight(0xffffff, 1.2);
  scene.add(new HemisphereLight(0xffffff, 0x444444, 0.4), lamp);

  // From where the last level of the last group is shown, and a little further.
  const far = Math.max(...groups.flatMap((g) => g.distances.map((d) => d * g.scale)), radius * 8) * 1.3 + radius;
  const near = NEAREST * radius;
  const camera = new PerspectiveCamera(FIELD_OF_VIEW, 1.6, radius / 100, 4 * far + 10 * radius);
  const close = (1.15 * radius) / Math.sin((FIELD_OF_VIEW * Math.PI) / 360);
  const towards = new Vector3(0.6, 0.45, 1).normalize();
  camera.position.copy(sphere.center).addScaledVector(towards, close);
  const controls = new OrbitControls(camera, canvas);
  controls.target.copy(sphere.center);
  controls.enableZoom = false; // the slider is for that, and the page must scroll

  const slider = element('input', { type: 'range', min: 0, max: STEPS, value: 0, 'aria-label': 'Distance of the camera' });
  const small = element('input', { type: 'checkbox' });
  const choice = element('select', { 'aria-label': 'Levels' }, new Option('levels as an engine shows them', ''));
  const most = Math.max(0, ...groups.map((group) => group.levels.length - 1));
  for (let k = 0; k <= most; k++) choice.append(new Option(k === 0 ? 'the source' : `level ${k}`, k));
  const output = element('output', { 'aria-live': 'polite' });
  const wires = element('input', { type: 'checkbox' });
  const controlsRow = element(
    'div',
    { class: 'controls' },
    element('label', {}, 'distance ', slider),
    choice,
    element('label', {}, small, ' as small as it would be'),
    element('label', {}, wires, ' edges'),
    output,
  );
  view.querySelector('button').replaceWith(canvas, controlsRow);

  const distance = () => near * Math.pow(far / near, slider.value / STEPS);
  const draw = () => {
    const at = distance();
    const direction = camera.position.clone().sub(controls.target).normalize();
    camera.position.copy(controls.target).addScaledVector(direction, small.checked ? at : close);
    const eye = controls.target.clone().addScaledVector(direction, at);
    let [lowest, highest] = [Infinity, 0];
    for (const group of groups) {
      const away = eye.distanceTo(group.place);
      const passed = group.distances.filter((d) => d * group.scale <= away).length;
      const wanted = choice.value === '' ? passed : Number(choice.value);
      const level = Math.min(wanted, group.levels.length - 1);
      group.levels.forEach((object, k) => (object.visible = k === level));
      [lowest, highest] = [Math.min(lowest, level), Math.max(highest, level)];
    }
    lamp.position.copy(camera.position).sub(controls.target);
    gltf.scene.traverse((object) => {
      for (const material of [object.material ?? []].flat()) material.wireframe = wires.checked;
    });
    camera.lookAt(controls.target);
    renderer.render(scene, camera);
    const { triangles, lines } = renderer.info.render;
    const drawn = (triangles || Math.round(lines / 3)).toLocaleString('en');
    const levels = groups.length === 0 ? 'no levels' : lowest === highest ? `level ${lowest}` : `levels ${lowest} to ${highest}`;
    output.textContent = `${levels}, ${drawn} triangles, from ${figure(at)} units away`;
    Object.assign(view.dataset, { lowest, highest, triangles: triangles || Math.round(lines / 3) });
  };
  const resize = () => {
    const { clientWidth, clientHeight } = canvas;
    renderer.setSize(clientWidth, clientHeight, false);
    camera.aspect = clientWidth / Math.max(1, clientHeight);
    camera.updateProjectionMatrix();
    draw();
  };
  new ResizeObserver(resize).observe(canvas);
  for (const input of [slider, small, choice, wires]) input.addEventListener('input', draw);
  controls.addEventListener('change', draw);
  slider.focus();
  resize();
}

for (const view of document.querySelectorAll('.view')) {
  const button = view.querySelector('button');
  button.addEventListener('click', () => {
    button.disabled = true;
    show(view).catch((error) => {
      // Without a graphics card, or without WebGL, the rest of the page goes on.
      const said = element('p', { role: 'alert' }, `It cannot be shown here: ${error.message}`);
      (view.querySelector('button') ?? view.lastElementChild).replaceWith(said);
    });
  });
}
