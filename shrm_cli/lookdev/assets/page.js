// Cells are half floats in base64. An exposure is a table from the 65536 halves to 8-bit sRGB, so
// that a cell is shown anew by one look-up for each number.
(function () {
"use strict";

function halves(text) {
  var bytes = atob(text.trim()), words = new Uint16Array(bytes.length / 2);
  for (var i = 0; i < words.length; i++) {
    words[i] = bytes.charCodeAt(2 * i) | (bytes.charCodeAt(2 * i + 1) << 8);
  }
  return words;
}

function value(half) {
  var exponent = (half >> 10) & 31, mantissa = half & 1023;
  var size = exponent ? Math.pow(2, exponent - 25) * (1024 + mantissa) : Math.pow(2, -24) * mantissa;
  return half & 0x8000 ? -size : size;
}

var linear = new Float64Array(65536);
for (var half = 0; half < 65536; half++) linear[half] = value(half);

function table(stops) {
  var scale = Math.pow(2, stops), shown = new Uint8ClampedArray(65536);
  for (var half = 0; half < 65536; half++) {
    var x = Math.min(Math.max(linear[half] * scale, 0), 1);
    var y = x <= 0.0031308 ? 12.92 * x : 1.055 * Math.pow(x, 1 / 2.4) - 0.055;
    shown[half] = Math.floor(255 * y + 0.5);
  }
  return shown;
}

function draw(canvas, words, shown) {
  var context = canvas.getContext("2d");
  var picture = context.createImageData(canvas.width, canvas.height), data = picture.data;
  for (var i = 0, j = 0; i < words.length; i += 3, j += 4) {
    data[j] = shown[words[i]];
    data[j + 1] = shown[words[i + 1]];
    data[j + 2] = shown[words[i + 2]];
    data[j + 3] = 255;
  }
  context.putImageData(picture, 0, 0);
}

document.querySelectorAll("section").forEach(function (section) {
  var slider = section.querySelector("input");
  if (!slider) return;
  var own = Number(slider.dataset.own), output = section.querySelector("output");
  var again = section.querySelector("button"), waiting = false;
  var cells = Array.from(section.querySelectorAll("canvas"), function (canvas) {
    return { canvas: canvas, words: halves(canvas.nextElementSibling.textContent) };
  });
  function show() {
    waiting = false;
    var stops = Number(slider.value), shown = table(stops);
    cells.forEach(function (cell) { draw(cell.canvas, cell.words, shown); });
    var ev = own + stops;
    output.textContent = "EV " + (ev < 0 ? "\u2212" : "+") + Math.abs(ev).toFixed(1);
    again.disabled = stops === 0;
  }
  slider.addEventListener("input", function () {
    if (!waiting) { waiting = true; requestAnimationFrame(show); }
  });
  again.addEventListener("click", function () { slider.value = 0; show(); });
  show();
});
})();
