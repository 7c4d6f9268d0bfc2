// A white ball under a grid of probes in three.js, and the pixels of its linear colours.
import * as THREE from "three";
import { LightProbeGridWebGL } from "three/addons/lighting/LightProbeGridWebGL.js";
import { base64 } from "./base64.js";

// `code` is that of docs/grid.md, without its imports.
window.shade = (size, from, code, held) => {
  const names = Object.keys(THREE);
  const values = names.map((name) => THREE[name]);
  const make = new Function("LightProbeGridWebGL", ...names, `${code}; return probeGrid;`);
  const scene = new THREE.Scene();
  scene.add(make(LightProbeGridWebGL, ...values)(held));
  const white = new THREE.MeshLambertMaterial({ color: "white" });
  scene.add(new THREE.Mesh(new THREE.SphereGeometry(1, 512, 256), white));
  const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 20);
  camera.position.set(...from).normalize().multiplyScalar(10);
  camera.lookAt(0, 0, 0);
  const renderer = new THREE.WebGLRenderer();
  const target = new THREE.WebGLRenderTarget(size, size, { type: THREE.FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const pixels = new Float32Array(4 * size * size);
  renderer.readRenderTargetPixels(target, 0, 0, size, size, pixels);
  return base64(pixels);
};
