// Balls under an exported panorama in glTF-Sample-Viewer, and the pixels of their linear colours.
import { GltfState, GltfView, ResourceLoader } from "@khronosgroup/gltf-viewer";
import { base64 } from "./base64.js";

const GAMMA = 2.2; // of the viewer's linearTosRGB
const BLACK =
  "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYGD4DwABCQEBtxmN7wAAAABJRU5ErkJggg==";

let gl, view, state, loader, size;

// The camera looks at the ball at the origin from `from`, 1000 away; y is up on the picture.
window.start = (pixels, from, libraries) => {
  size = pixels;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
  drawIntoFloats();
  view = new GltfView(gl);
  state = view.createState();
  loader = new ResourceLoader(view, libraries);
  const wanted = state.renderingParameters;
  wanted.toneMap = GltfState.ToneMaps.NONE;
  wanted.usePunctual = false;
  wanted.renderEnvironmentMap = false;
  wanted.clearColor = [0, 0, 0, 1];
  const camera = state.userCamera;
  camera.type = "orthographic";
  camera.orthographic.znear = 990;
  camera.orthographic.zfar = 1010;
  look(unit(from), from);
};

// Its lookAt() makes the inverse of the matrix that the camera keeps.
function look(back, from) {
  const right = unit([back[2], 0, -back[0]]);
  const up = cross(back, right);
  state.userCamera.transform.set([...right, 0, ...up, 0, ...back, 0, ...from, 1]);
}

function unit(v) {
  return v.map((x) => x / Math.hypot(...v));
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

// The viewer draws into the canvas, of 8 bits up to 1; here it gets 32-bit floats in its place.
function drawIntoFloats() {
  gl.getExtension("EXT_color_buffer_float");
  const framebuffer = gl.createFramebuffer();
  const bind = gl.bindFramebuffer.bind(gl);
  bind(gl.FRAMEBUFFER, framebuffer);
  const formats = [
    [gl.COLOR_ATTACHMENT0, gl.RGBA32F],
    [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24],
  ];
  for (const [attachment, format] of formats) {
    const buffer = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
    gl.renderbufferStorage(gl.RENDERBUFFER, format, size, size);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, buffer);
  }
  gl.bindFramebuffer = (target, given) => bind(target, given ?? framebuffer);
}

// The table for sheen, which no material here has, would be asked for elsewhere.
window.environment = async (url) => {
  state.environment = await loader.loadEnvironment(url, { lut_sheen_E_file: BLACK });
  return { mips: state.environment.mipCount };
};

// Shade what a glTF file shows.
window.shade = async (url) => {
  state.gltf = await loader.loadGltf(url);
  return drawn();
};

// The light itself, 90 degrees across, along a horizontal direction. A file must be loaded.
window.background = (to) => {
  state.renderingParameters.renderEnvironmentMap = true;
  state.renderingParameters.blurEnvironmentMap = false;
  state.userCamera.type = "perspective";
  // cubemap.vert adds 0.1 to w, so that what lies straight ahead is drawn 1.1 times smaller.
  state.userCamera.perspective.yfov = 2 * Math.atan(1 / 1.1);
  look(
    to.map((x) => -x),
    [0, 0, 0],
  );
  return drawn();
};

function drawn() {
  view.renderFrame(state, size, size);
  const pixels = new Float32Array(4 * size * size);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.readPixels(0, 0, size, size, gl.RGBA, gl.FLOAT, pixels);
  return base64(pixels.map((value) => Math.pow(Math.max(value, 0), GAMMA)));
}
