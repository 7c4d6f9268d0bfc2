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

// A promise of all blocks as ArrayBuffers, in the order of their numbers.
function loadBlocks(root, scene) {
  var inline = root.querySelectorAll("script.shrm-block");
  return Promise.all(
    scene.blocks.map(function (block, number) {
      if (!block.url) return Promise.resolve(fromBase64(inline[number].textContent));
      return fetch(block.url).then(function (answer) {
        if (!answer.ok) throw new Error("the server has no " + block.url + " any more");
        return answer.arrayBuffer();
      });
    })
  );
}
