// What Python put into the page: a description in JSON, and blocks of bytes.
// Blocks are base64 in elements of the page itself, or files beside it where it is served.

function describedScene(root) {
  return JSON.parse(root.querySelector("script.shrm-scene").textContent);
}

function fromBase64(text) {
  var binary = atob(text.trim());
  var bytes = new Uint8Array(binary.length);
  for (var i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes.buffer;
}

// Deflated bytes, of which those of the same place in each number stand together, as they were.
function inflated(buffer, width) {
  var stream = new Blob([buffer]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer().then(function (found) {
    if (width === 1) return found;
    var planes = new Uint8Array(found), count = planes.length / width;
    var bytes = new Uint8Array(planes.length);
    for (var plane = 0; plane < width; plane++)
      for (var k = 0, at = plane * count; k < count; k++) bytes[k * width + plane] = planes[at + k];
    return bytes.buffer;
  });
}

// The numbers of a rounded texture: steps of 2^exponent, those of each channel together. As many
// layers as there are to an image of exponents share it.
function unrounded(described, steps, exponents) {
  var texels = described.width * described.height, count = texels * (described.depth || 1);
  var shared = count / exponents.length;
  var values = new Float32Array(3 * count), sizes = Float32Array.from(exponents, function (each) {
    return Math.pow(2, each);
  });
  for (var channel = 0, at = 0; channel < 3; channel++)
    for (var k = 0; k < count; k++, at++) {
      var step = steps[at], size = Math.floor(k / texels / shared) * texels + (k % texels);
      if (step) values[3 * k + channel] = (step & 1 ? -1 - (step >> 1) : step >> 1) * sizes[size];
    }
  return values;
}

// A promise of all blocks as ArrayBuffers, in the order of their numbers.
function loadBlocks(root, scene) {
  var inline = root.querySelectorAll("script.shrm-block");
  return Promise.all(
    scene.blocks.map(function (block, number) {
      if (!block.url) return inflated(fromBase64(inline[number].textContent), block.width);
      return fetch(block.url).then(function (answer) {
        if (!answer.ok) throw new Error("the server has no " + block.url + " any more");
        return answer.arrayBuffer();
      }).then(function (buffer) {
        return inflated(buffer, block.width);
      });
    })
  );
}
