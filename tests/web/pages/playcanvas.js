// A ball under an exported light in PlayCanvas, and the pixels of its linear colours.
import * as pc from "playcanvas";
import { base64 } from "./base64.js";

let app, camera, colors;

window.start = (size) => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  app = new pc.Application(canvas, { graphicsDeviceOptions: { antialias: false } });
  app.scene.ambientLight = pc.Color.BLACK;
  colors = new pc.Texture(app.graphicsDevice, {
    width: size,
    height: size,
    format: pc.PIXELFORMAT_RGBA32F,
    mipmaps: false,
  });
  camera = new pc.Entity();
  camera.addComponent("camera", {
    projection: pc.PROJECTION_ORTHOGRAPHIC,
    orthoHeight: 1,
    nearClip: 990,
    farClip: 1010,
    clearColor: pc.Color.BLACK,
    gammaCorrection: pc.GAMMA_NONE,
    toneMapping: pc.TONEMAP_NONE,
    renderTarget: new pc.RenderTarget({ colorBuffer: colors, depth: true }),
  });
  app.root.addChild(camera);
};

// As the README of an export has it.
window.environment = (url) =>
  new Promise((done, failed) => {
    const atlas = new pc.Asset(
      "light",
      "texture",
      { url },
      {
        type: pc.TEXTURETYPE_RGBP,
        mipmaps: false,
        projection: pc.TEXTUREPROJECTION_EQUIRECT,
        addressu: "clamp",
        addressv: "clamp",
      },
    );
    atlas.on("error", failed);
    atlas.ready(() => {
      app.scene.envAtlas = atlas.resource;
      done();
    });
    app.assets.add(atlas);
    app.assets.load(atlas);
  });

// Shade with a metal of colour white and some roughness, or diffuse white where it is null. The
// camera looks at the ball at the origin from `from`; y is up on the picture.
window.shade = async (roughness, from) => {
  camera.setPosition(new pc.Vec3(...from).normalize().mulScalar(1000));
  camera.lookAt(pc.Vec3.ZERO);
  const material = new pc.StandardMaterial();
  material.useMetalness = material.useMetalnessSpecularColor = true;
  material.metalness = roughness === null ? 0 : 1;
  material.gloss = 1 - (roughness ?? 1);
  material.specular = roughness === null ? pc.Color.BLACK : pc.Color.WHITE;
  material.update();
  const sphere = new pc.SphereGeometry({ radius: 1, latitudeBands: 256, longitudeBands: 512 });
  const mesh = pc.Mesh.fromGeometry(app.graphicsDevice, sphere);
  const ball = new pc.Entity();
  ball.addComponent("render", { meshInstances: [new pc.MeshInstance(mesh, material)] });
  app.root.addChild(ball);
  app.render();
  const options = { renderTarget: camera.camera.renderTarget, immediate: true };
  const pixels = await colors.read(0, 0, colors.width, colors.height, options);
  ball.destroy();
  return base64(pixels);
};
