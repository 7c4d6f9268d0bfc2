// A ball under an exported light in three.js, and the pixels of its linear colours. Where "three" is
// bundled as three.js' build for WebGPU, it is drawn by that.
import * as THREE from "three";
import { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";
import { loadEnvironment, loadLightProbe } from "../../../shrm_cli/export/engines/shrm-environment.js";
import { base64 } from "./base64.js";

let renderer, scene, camera, target;

// The camera looks at the ball at the origin from `from`; y is up on the picture.
window.start = async (size, from) => {
  renderer = new (THREE.WebGPURenderer ?? THREE.WebGLRenderer)();
  await renderer.init?.();
  scene = new THREE.Scene();
  camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 20);
  camera.position.set(...from).normalize().multiplyScalar(10);
  camera.lookAt(0, 0, 0);
  target = new THREE.WebGLRenderTarget(size, size, { type: THREE.FloatType });
};

window.environment = async (url) => {
  scene.environment = await loadEnvironment(url);
  return { isPMREM: scene.environment.isPMREMTexture };
};

// The same by three.js' own loader; `transcoder` is the folder of what it runs. It may be told that
// there are no blocks on the device.
window.stock = async (url, transcoder, hasBlocks = true) => {
  const loader = new KTX2Loader().setTranscoderPath(transcoder).detectSupport(renderer);
  if (!hasBlocks) Object.assign(loader.workerConfig, { bptcSupported: false, astcHDRSupported: false });
  scene.environment = await loader.loadAsync(url);
  scene.environment.isPMREMTexture = true;
  const { image, format } = scene.environment;
  return { format, blocks: image.map((face) => face.mipmaps.map(({ data }) => base64(data))) };
};

// three.js' own filter of a lat-long of half floats, its first row on top.
window.filtered = (half, width) => {
  const bytes = Uint8Array.from(atob(half), (each) => each.charCodeAt(0));
  const light = new THREE.DataTexture(new Uint16Array(bytes.buffer), width, width / 2,
    THREE.RGBAFormat, THREE.HalfFloatType, THREE.EquirectangularReflectionMapping);
  Object.assign(light, { magFilter: THREE.LinearFilter, minFilter: THREE.LinearFilter,
    flipY: true, needsUpdate: true });
  scene.environment = new THREE.PMREMGenerator(renderer).fromEquirectangular(light).texture;
};

window.lightProbe = async (url) => {
  scene.environment = null;
  scene.add(await loadLightProbe(url));
};

// Shade with a metal of colour white and some roughness; with diffuse white where it is null; by
// the environment's diffuse light alone where it is "environment".
window.shade = (roughness) => {
  if (roughness === null) return draw(new THREE.MeshLambertMaterial({ color: "white" }));
  if (roughness !== "environment") {
    return draw(new THREE.MeshStandardMaterial({ color: "white", metalness: 1, roughness }));
  }
  const diffuse = { color: "white", metalness: 0, roughness: 1, specularIntensity: 0 };
  return draw(new THREE.MeshPhysicalMaterial(diffuse));
};

// Shade a brushed white metal; its stretched axis runs around y.
window.brush = (roughness, anisotropy) =>
  draw(new THREE.MeshPhysicalMaterial({ color: "white", metalness: 1, roughness, anisotropy }));

// Run a patch of docs/anisotropy.md, which knows the code TAPS.
window.patch = (text, taps) => new Function("THREE", "TAPS", text)(THREE, taps);

// Run lines of a README that make lights.
window.lights = (lines) => new Function("THREE", "scene", lines)(THREE, scene);

// The light itself, or that of some roughness, 90 degrees across, along a horizontal direction.
window.background = async (to, roughness = 0) => {
  scene.background = scene.environment;
  scene.backgroundBlurriness = roughness;
  const eye = new THREE.PerspectiveCamera(90, 1, 0.1, 10);
  eye.lookAt(...to);
  const pixels = await seenBy(eye);
  scene.background = null;
  return pixels;
};

async function draw(material) {
  const ball = new THREE.Mesh(new THREE.SphereGeometry(1, 512, 256), material);
  scene.add(ball);
  const pixels = await seenBy(camera);
  scene.remove(ball);
  return pixels;
}

async function seenBy(eye) {
  const { width, height } = target;
  renderer.setRenderTarget(target);
  if (renderer.isWebGPURenderer) {
    renderer.render(scene, eye);
    const found = await renderer.readRenderTargetPixelsAsync(target, 0, 0, width, height);
    // WebGPU has the first row on top.
    const rows = Array.from({ length: height }, (_, k) =>
      found.subarray(4 * width * (height - 1 - k), 4 * width * (height - k)));
    return base64(Float32Array.from(rows.flatMap((row) => [...row])));
  }
  renderer.render(scene, eye);
  const pixels = new Float32Array(4 * width * height);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  return base64(pixels);
}
