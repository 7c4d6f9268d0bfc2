// Models under an exported light in CesiumJS, and the pixels of their linear colours. The package is
// the global `Cesium`, which stands before this script.
import { base64 } from "./base64.js";

const { Cartesian3, Matrix4 } = Cesium;
const AWAY = 1000;
const FRAME = Cesium.Transforms.eastNorthUpToFixedFrame(Cartesian3.fromDegrees(20, 40, 100));

let scene, light;

window.start = (size) => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  document.body.append(canvas);
  scene = new Cesium.Scene({ canvas, msaaSamples: 1 });
  scene.highDynamicRange = true; // what is drawn before tone mapping has linear colours
  scene.backgroundColor = Cesium.Color.BLACK;
  scene.fog.enabled = false; // which takes a hundredth of the light 1000 metres away
};

// As the README of an export has it; the module imports a name of the package.
window.environment = async (levels, coefficients) => {
  const map = document.createElement("script");
  map.type = "importmap";
  const named = "data:text/javascript,export const Cartesian3 = globalThis.Cesium.Cartesian3";
  map.textContent = JSON.stringify({ imports: { cesium: named } });
  document.head.append(map);
  const { sphericalHarmonicCoefficients } = await import(coefficients);
  light = { specularEnvironmentMaps: levels, sphericalHarmonicCoefficients };
};

// Shade what a glTF file shows. The camera looks at the model's origin from the world direction
// `from` and sees a height of 2; y is up on the picture.
window.shade = async (url, [x, y, z]) => {
  const model = await Cesium.Model.fromGltfAsync({ url, modelMatrix: FRAME });
  model.lightColor = Cartesian3.ZERO;
  model.imageBasedLighting = new Cesium.ImageBasedLighting(light);
  scene.primitives.add(model);
  const towards = unit(new Cartesian3(x, -z, y)); // east, north, up
  const right = unit(Cartesian3.cross(Cartesian3.UNIT_Z, towards, new Cartesian3()));
  const up = Cartesian3.cross(towards, right, new Cartesian3());
  const destination = Cartesian3.multiplyByScalar(towards, AWAY, new Cartesian3());
  scene.camera.setView({
    destination: Matrix4.multiplyByPoint(FRAME, destination, new Cartesian3()),
    orientation: {
      direction: turned(Cartesian3.negate(towards, new Cartesian3())),
      up: turned(up),
    },
  });
  // It comes last, because setView() gives a width of its own.
  scene.camera.frustum = new Cesium.OrthographicFrustum({ width: 2, aspectRatio: 1, near: 1 });
  while (!model.ready || !model.imageBasedLighting.specularEnvironmentCubeMap.ready) {
    scene.render();
    await new Promise((next) => setTimeout(next, 20));
  }
  scene.render();
  scene.render();
  const halves = scene.context.readPixels(scene.view.sceneFramebuffer);
  scene.primitives.remove(model);
  return base64(Float32Array.from(new Float16Array(halves.buffer)));
};

function unit(v) {
  return Cartesian3.normalize(v, v);
}

function turned(v) {
  return Matrix4.multiplyByPointAsVector(FRAME, v, new Cartesian3());
}
