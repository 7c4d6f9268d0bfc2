// The page: it reads the panorama, hands its pixels to the worker, and offers the files.

import { FloatType } from 'three';
import { EXRLoader } from 'three/examples/jsm/loaders/EXRLoader.js';
import { HDRLoader } from 'three/examples/jsm/loaders/HDRLoader.js';

const MOST_PIXELS = 8192 * 4096;
const id = name => document.getElementById(name);
const worker = new Worker('worker.js');
let probe = null, isReady = false, isBusy = false;
let urls = [];

// What is returned is the image from its top row on, three or four floats a pixel.
function read(name, buffer) {
  if (/\.exr$/i.test(name)) {
    const { data, width, height } = new EXRLoader().setDataType(FloatType).parse(buffer);
    const values = data.length / (width * height);
    const image = new Float32Array(data.length), row = width * values;
    for (let y = 0; y < height; y++) // this loader begins with the lowest row
      image.set(data.subarray(y * row, (y + 1) * row), (height - 1 - y) * row);
    return { image, width, height };
  }
  if (!/\.(hdr|pic)$/i.test(name)) throw new Error('it is no .hdr or .exr file');
  const { data, width, height } = new HDRLoader().setDataType(FloatType).parse(buffer);
  // Radiance's format divides mantissas by 256, and this loader divides them by 255.
  for (let i = 0; i < data.length; i++) data[i] *= 255 / 256;
  return { image: data, width, height };
}

function draw({ image, width, height }) {
  const canvas = id('preview'), values = image.length / (width * height);
  canvas.hidden = false;
  canvas.height = Math.max(1, Math.round(canvas.width * height / width));
  const context = canvas.getContext('2d');
  const picture = context.createImageData(canvas.width, canvas.height);
  for (let y = 0; y < canvas.height; y++)
    for (let x = 0; x < canvas.width; x++) {
      const from = (Math.floor(y * height / canvas.height) * width
        + Math.floor(x * width / canvas.width)) * values;
      for (let c = 0; c < 4; c++)
        picture.data[4 * (y * canvas.width + x) + c] =
          c === 3 ? 255 : 255 * Math.min(Math.max(image[from + c], 0), 1) ** (1 / 2.2);
    }
  context.putImageData(picture, 0, 0);
}

function update(text) {
  if (text !== undefined) id('status').textContent = text;
  id('go').disabled = !isReady || isBusy || probe === null;
}

function fail(text) {
  isBusy = false;
  id('progress').hidden = true;
  id('error').textContent = text;
  update('');
}

function clear() {
  id('error').textContent = '';
  for (const url of urls) URL.revokeObjectURL(url);
  urls = [];
  id('files').replaceChildren();
  id('told').replaceChildren();
}

async function open(file) {
  clear();
  probe = null;
  id('preview').hidden = true;
  try {
    const found = read(file.name, await file.arrayBuffer());
    if (found.width * found.height > MOST_PIXELS) throw new Error('it has more than 8192 x 4096 pixels');
    draw(found);
    probe = { name: file.name, ...found };
    update(isReady ? `${file.name}: ${found.width} x ${found.height}` : undefined);
  } catch (error) {
    fail(`${file.name}: ${String(error.message ?? error).replace(/^THREE\.\w+: /, '')}`);
  }
}

function offer(files, told) {
  for (const { name, bytes } of files) {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([bytes]));
    urls.push(link.href);
    link.download = link.textContent = name;
    const item = document.createElement('li');
    item.append(link, ` ${bytes.length.toLocaleString('en')} bytes`);
    id('files').append(item);
  }
  for (const line of told) {
    const item = document.createElement('li');
    item.textContent = line;
    id('told').append(item);
  }
}

const heard = {
  ready({ engines }) {
    id('engine').replaceChildren(...engines.map(([name, title]) => new Option(title, name)));
    isReady = true;
    update(probe ? probe.name : 'Ready.');
  },
  progress({ done, total }) {
    id('progress').value = done / total;
  },
  made({ files, told, seconds }) {
    isBusy = false;
    id('progress').hidden = true;
    offer(files, told);
    update(`Made in ${seconds.toFixed(1)} s.`);
  },
  failed({ text }) { fail(text); },
};

worker.onmessage = event => heard[event.data.what](event.data);
worker.onerror = event => fail(`The filter could not be loaded: ${event.message}`);

id('file').onchange = event => event.target.files[0] && open(event.target.files[0]);
id('drop').ondragover = event => { event.preventDefault(); id('drop').classList.add('over'); };
id('drop').ondragleave = () => id('drop').classList.remove('over');
id('drop').ondrop = event => {
  event.preventDefault();
  id('drop').classList.remove('over');
  if (event.dataTransfer.files[0]) open(event.dataTransfer.files[0]);
};
id('form').onsubmit = event => {
  event.preventDefault();
  clear();
  isBusy = true;
  id('progress').value = 0;
  id('progress').hidden = false;
  update('Prefiltering ...');
  const { name, image, width, height } = probe;
  worker.postMessage({
    name, image, width, height, engine: id('engine').value, size: Number(id('size').value) || null,
  });
};
