// Loads what `shrm export --for three` wrote, for three.js r187 and later.
import {
  CompressedCubeTexture, HalfFloatType, LightProbe, LinearFilter, LinearMipmapLinearFilter,
  LinearSRGBColorSpace, RGBA_ASTC_4x4_Format, RGBA_ASTC_6x6_Format, RGBAFormat,
  RGB_BPTC_UNSIGNED_Format, SphericalHarmonics3,
} from "three";
import { read } from "three/addons/libs/ktx-parse.module.js";
import { ZSTDDecoder } from "three/addons/libs/zstddec.module.js";

// By Vulkan's number: the texture's format, and the texels along an edge of a block of 16 bytes.
const FORMATS = {
  97: [RGBAFormat, 0],
  143: [RGB_BPTC_UNSIGNED_Format, 4],
  1000066000: [RGBA_ASTC_4x4_Format, 4],
  1000066004: [RGBA_ASTC_6x6_Format, 6],
};

/** A prefiltered cube of a .ktx2 file, for `scene.environment` and `scene.background`. */
export async function loadEnvironment(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
  const file = read(new Uint8Array(await response.arrayBuffer()));
  const zstd = new ZSTDDecoder();
  await zstd.init();
  const width = file.pixelWidth;
  const [format, edge] = FORMATS[file.vkFormat];
  const faces = Array.from({ length: 6 }, () => ({ width, height: width, mipmaps: [] }));
  file.levels.forEach(({ levelData, uncompressedByteLength }, level) => {
    const isPacked = file.supercompressionScheme === 2;
    // A copy, because the numbers may lie at an odd byte of the file.
    const bytes = isPacked ? zstd.decode(levelData, uncompressedByteLength) : levelData.slice();
    const size = width >> level;
    const length = uncompressedByteLength / 6;
    faces.forEach((face, k) => {
      const at = bytes.byteOffset + k * length;
      const data = edge ? new Uint8Array(bytes.buffer, at, length)
        : new Uint16Array(bytes.buffer, at, length / 2);
      face.mipmaps.push({ data, width: size, height: size });
    });
  });
  // Despite its name it also takes plain texels, and it is the one cube whose levels are files'.
  const texture = new CompressedCubeTexture(faces, format, HalfFloatType);
  texture.isPMREMTexture = true;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.magFilter = LinearFilter;
  texture.colorSpace = LinearSRGBColorSpace;
  texture.needsUpdate = true;
  return texture;
}

/** Diffuse light of a _sh.json file, for scenes without `scene.environment`. */
export async function loadLightProbe(url) {
  const { three } = await (await fetch(url)).json();
  return new LightProbe(new SphericalHarmonics3().fromArray(three));
}
