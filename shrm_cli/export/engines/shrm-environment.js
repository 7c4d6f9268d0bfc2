// Loads what `shrm export --for three` wrote, for three.js r187 and later.
import {
  CompressedCubeTexture, HalfFloatType, LightProbe, LinearFilter, LinearMipmapLinearFilter,
  LinearSRGBColorSpace, RGBAFormat, SphericalHarmonics3,
} from "three";
import { read } from "three/addons/libs/ktx-parse.module.js";
import { ZSTDDecoder } from "three/addons/libs/zstddec.module.js";

/** A prefiltered cube of a .ktx2 file, for `scene.environment` and `scene.background`. */
export async function loadEnvironment(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
  const file = read(new Uint8Array(await response.arrayBuffer()));
  const zstd = new ZSTDDecoder();
  await zstd.init();
  const width = file.pixelWidth;
  const faces = Array.from({ length: 6 }, () => ({ width, height: width, mipmaps: [] }));
  file.levels.forEach(({ levelData, uncompressedByteLength }, level) => {
    const isPacked = file.supercompressionScheme === 2;
    // A copy, because the numbers may lie at an odd byte of the file.
    const bytes = isPacked ? zstd.decode(levelData, uncompressedByteLength) : levelData.slice();
    const texels = new Uint16Array(bytes.buffer, bytes.byteOffset, uncompressedByteLength / 2);
    const size = width >> level;
    const count = 4 * size * size;
    faces.forEach((face, k) => {
      const data = texels.subarray(k * count, (k + 1) * count);
      face.mipmaps.push({ data, width: size, height: size });
    });
  });
  // Despite its name it also takes plain texels, and it is the one cube whose levels are files'.
  const texture = new CompressedCubeTexture(faces, RGBAFormat, HalfFloatType);
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
