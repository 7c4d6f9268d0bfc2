// A ball under an exported light in Babylon.js, and the pixels of its linear colours.
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { Scene } from "@babylonjs/core/scene.js";
import { FreeCamera } from "@babylonjs/core/Cameras/freeCamera.js";
import { Camera } from "@babylonjs/core/Cameras/camera.js";
import { DirectionalLight } from "@babylonjs/core/Lights/directionalLight.js";
import { Vector3 } from "@babylonjs/core/Maths/math.vector.js";
import { Color3, Color4 } from "@babylonjs/core/Maths/math.color.js";
import { CreateSphere } from "@babylonjs/core/Meshes/Builders/sphereBuilder.js";
import { PBRMaterial } from "@babylonjs/core/Materials/PBR/pbrMaterial.js";
import { CubeTexture } from "@babylonjs/core/Materials/Textures/cubeTexture.js";
import { RenderTargetTexture } from "@babylonjs/core/Materials/Textures/renderTargetTexture.js";
import { AppendSceneAsync } from "@babylonjs/core/Loading/sceneLoader.js";
import "@babylonjs/core/Materials/Textures/baseTexture.polynomial.js";
import "@babylonjs/core/Materials/Textures/Loaders/envTextureLoader.js";
import "@babylonjs/core/Materials/Textures/Loaders/ddsTextureLoader.js";
import "@babylonjs/core/Helpers/sceneHelpers.js";
import "@babylonjs/core/Loading/loadingScreen.js";
import "@babylonjs/loaders/glTF/2.0/index.js";
import { base64 } from "./base64.js";

let scene, target;

// The camera looks at the ball at the origin from `from`; y is up on the picture.
window.start = (size, rightHanded, from) => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const engine = new Engine(canvas, false, { preserveDrawingBuffer: true });
  scene = new Scene(engine);
  scene.useRightHandedSystem = rightHanded;
  scene.clearColor = new Color4(0, 0, 0, 1);
  scene.imageProcessingConfiguration.applyByPostProcess = true; // linear colours, no tone mapping
  const camera = new FreeCamera("camera", new Vector3(...from).normalize().scale(1000), scene);
  camera.setTarget(Vector3.Zero());
  camera.mode = Camera.ORTHOGRAPHIC_CAMERA;
  camera.orthoLeft = camera.orthoBottom = -1;
  camera.orthoRight = camera.orthoTop = 1;
  camera.minZ = 990;
  camera.maxZ = 1010;
  target = new RenderTargetTexture("target", size, scene, { generateMipMaps: false, type: 1 });
  target.activeCamera = camera;
  target.clearColor = scene.clearColor;
};

window.environment = async (url) => {
  scene.environmentTexture = CubeTexture.CreateFromPrefilteredData(url, scene);
  while (!scene.environmentTexture.isReady()) await new Promise((next) => setTimeout(next, 20));
  return { width: scene.environmentTexture.getSize().width };
};

window.environmentOfGltf = async (url) => {
  await AppendSceneAsync(url, scene);
  while (!scene.environmentTexture.isReady()) await new Promise((next) => setTimeout(next, 20));
  const texture = scene.environmentTexture;
  texture.gammaSpace = false; // the loader forgets that RGBD was unpacked to linear colours
  return { width: texture.getSize().width, level: texture.level };
};

// Shade with a metal of colour white and some roughness, or diffuse white where it is null.
// Light that meets several facets is left out unless it is asked for.
window.shade = async (roughness, multiscatter = false) => {
  const ball = CreateSphere("ball", { diameter: 2, segments: 96 }, scene);
  const material = new PBRMaterial("material", scene);
  material.albedoColor = Color3.White();
  material.metallic = roughness === null ? 0 : 1;
  material.roughness = roughness === null ? 1 : roughness;
  if (roughness === null) material.metallicF0Factor = 0;
  material.useRadianceOcclusion = material.useHorizonOcclusion = false;
  material.enableSpecularAntiAliasing = false;
  material.brdf.useEnergyConservation = multiscatter;
  material.brdf.baseDiffuseModel = 2; // Lambert
  material.brdf.mixIblRadianceWithIrradiance = false;
  ball.material = material;
  target.renderList = [ball];
  await material.forceCompilationAsync(ball);
  await scene.whenReadyAsync();
  target.render();
  const pixels = await target.readPixels();
  ball.dispose();
  material.dispose();
  return base64(pixels);
};

// Run lines of a README that make lights.
window.lights = (lines) =>
  new Function("BABYLON", "scene", lines)({ Color3, DirectionalLight, Vector3 }, scene);

// The light itself, 90 degrees across, along a horizontal direction.
window.background = async (to) => {
  const sky = scene.createDefaultSkybox(scene.environmentTexture, true, 100, 0);
  const camera = new FreeCamera("eye", Vector3.Zero(), scene);
  camera.setTarget(new Vector3(...to));
  camera.fov = Math.PI / 2;
  const distant = target.activeCamera;
  target.activeCamera = camera;
  target.renderList = [sky];
  await sky.material.forceCompilationAsync(sky);
  await scene.whenReadyAsync();
  target.render();
  const pixels = await target.readPixels();
  target.activeCamera = distant;
  sky.dispose();
  camera.dispose();
  return base64(pixels);
};

// The texels of a level, as Babylon has unpacked them.
window.texels = async (face, level) =>
  base64(Float32Array.from(await scene.environmentTexture.readPixels(face, level)));
