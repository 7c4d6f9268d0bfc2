// Models under an exported light in <model-viewer>, and the bytes of its pictures.
import { ModelViewerElement } from "@google/model-viewer/dist/model-viewer.min.js";
import { base64 } from "./base64.js";

const AWAY = 100; // times the ball's radius

let size, element;

window.start = (pixels, environment) => {
  size = pixels;
  ModelViewerElement.minimumRenderScale = 1;
  element = document.createElement("model-viewer");
  const attributes = {
    style: `width: ${size}px; height: ${size}px`,
    "environment-image": environment,
    "tone-mapping": "linear",
    "camera-target": "0m 0m 0m",
    "min-camera-orbit": "auto 0deg 0m",
    "max-camera-orbit": `auto 180deg ${2 * AWAY}m`,
    "min-field-of-view": "0.01deg",
    "field-of-view": `${(360 / Math.PI) * Math.asin(1 / AWAY)}deg`,
    "interaction-prompt": "none",
  };
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  document.body.append(element);
};

// Show what a glTF file shows from a world direction, with all light multiplied by `exposure`.
window.shade = async (url, [x, y, z], exposure) => {
  const azimuth = Math.atan2(x, z);
  const polar = Math.atan2(Math.hypot(x, z), y);
  element.cameraOrbit = `${azimuth}rad ${polar}rad ${AWAY}m`;
  element.exposure = exposure;
  if (element.getAttribute("src") !== url) {
    const loaded = new Promise((done, failed) => {
      element.addEventListener("load", done, { once: true });
      element.addEventListener("error", (event) => failed(event.detail.sourceError), { once: true });
    });
    element.setAttribute("src", url);
    await loaded;
  }
  await element.updateComplete;
  element.jumpCameraToGoal();
  for (let frame = 0; frame < 3; frame++) await new Promise(requestAnimationFrame);
  const picture = await createImageBitmap(await element.toBlob({ mimeType: "image/png" }));
  const context = new OffscreenCanvas(size, size).getContext("2d");
  context.drawImage(picture, 0, 0);
  return [picture.width, base64(context.getImageData(0, 0, size, size).data)];
};
