// Balls under an exported light in Filament, and their linear pixels of 8 bits.
// Filament itself is a global, from a script of its own.
/* global Filament */
import { base64 } from "./base64.js";

let engine, scene, view, swapChain, renderer, canvas, light;

// The camera looks at the ball at the origin from `from`; y is up on the picture.
window.start = (size, from, assets) =>
  new Promise((resolve) =>
    Filament.init(assets, () => {
      canvas = document.createElement("canvas");
      canvas.width = canvas.height = size;
      document.body.appendChild(canvas);
      engine = Filament.Engine.create(canvas, { preserveDrawingBuffer: true, antialias: false });
      scene = engine.createScene();
      swapChain = engine.createSwapChain();
      renderer = engine.createRenderer();
      view = engine.createView();
      const camera = engine.createCamera(Filament.EntityManager.get().create());
      camera.setProjection(Filament.Camera$Projection.ORTHO, -1, 1, -1, 1, 0.1, 20);
      const length = Math.hypot(...from);
      camera.lookAt(from.map((x) => (10 * x) / length), [0, 0, 0], [0, 1, 0]);
      camera.setExposureDirect(1);
      view.setCamera(camera);
      view.setScene(scene);
      view.setViewport([0, 0, size, size]);
      view.setPostProcessingEnabled(false); // linear colours, no tone mapping
      resolve();
    }),
  );

// Returns the coefficients that Filament read.
window.environment = (file) => {
  const { shfloats } = engine.createIblFromKtx1(file); // which reads them, and leaves it at that
  light = Filament.IndirectLight.Builder()
    .reflections(engine.createTextureFromKtx1(file))
    .irradianceSh(3, shfloats)
    .build(engine);
  scene.setIndirectLight(light);
  return Array.from(shfloats);
};

// Shade a ball of a file, with all light scaled so that 8 bits hold what is to be seen.
window.shade = async (file, intensity) => {
  light.setIntensity(intensity);
  const loader = engine.createAssetLoader();
  const asset = loader.createAsset(file);
  await new Promise((resolve) => asset.loadResources(resolve, null, "", null));
  scene.addEntities(asset.getEntities());
  const pixels = await drawn(view);
  scene.removeEntities(asset.getEntities());
  return base64(pixels);
};

// The light itself, 90 degrees across, along a horizontal direction.
window.background = async (file, to) => {
  light.setIntensity(1);
  scene.setSkybox(engine.createSkyFromKtx1(file));
  const camera = engine.createCamera(Filament.EntityManager.get().create());
  camera.setProjectionFov(90, 1, 0.1, 10, Filament.Camera$Fov.VERTICAL);
  camera.lookAt([0, 0, 0], to, [0, 1, 0]);
  camera.setExposureDirect(1);
  const around = engine.createView();
  around.setCamera(camera);
  around.setScene(scene);
  around.setViewport([0, 0, canvas.width, canvas.height]);
  around.setPostProcessingEnabled(false);
  return base64(await drawn(around));
};

async function drawn(seen) {
  const pixels = new Uint8Array(4 * canvas.width * canvas.height);
  const gl = canvas.getContext("webgl2");
  for (let frame = 0; frame < 4; frame++) {
    renderer.render(swapChain, seen);
    engine.execute();
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    await new Promise(requestAnimationFrame);
  }
  return pixels;
}
