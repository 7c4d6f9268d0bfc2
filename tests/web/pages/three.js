// A ball under an exported light in three.js, and the pixels of its linear colours.
import * as THREE from "three";
import { loadEnvironment, loadLightProbe } from "../../../shrm_cli/export/engines/shrm-environment.js";
import { base64 } from "./base64.js";

let renderer, scene, camera, target;

// The camera looks at the ball at the origin from `from`; y is up on the picture.
window.start = (size, from) => {
  renderer = new THREE.WebGLRenderer();
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

// The light itself, 90 degrees across, along a horizontal direction.
window.background = (to) => {
  scene.background = scene.environment;
  const eye = new THREE.PerspectiveCamera(90, 1, 0.1, 10);
  eye.lookAt(...to);
  const pixels = seenBy(eye);
  scene.background = null;
  return pixels;
};

function draw(material) {
  const ball = new THREE.Mesh(new THREE.SphereGeometry(1, 512, 256), material);
  scene.add(ball);
  const pixels = seenBy(camera);
  scene.remove(ball);
  return pixels;
}

function seenBy(eye) {
  renderer.setRenderTarget(target);
  renderer.render(scene, eye);
  const pixels = new Float32Array(4 * target.width * target.height);
  renderer.readRenderTargetPixels(target, 0, 0, target.width, target.height, pixels);
  return base64(pixels);
}
