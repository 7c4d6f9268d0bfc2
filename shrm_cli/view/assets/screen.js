// What the canvas shows of the two sides, and what is read from them.

var PAPER = { light: [0.93, 0.93, 0.925], dark: [0.105, 0.11, 0.12] };

function hexColor(rgb) {
  return "rgb(" + rgb.map(function (x) { return Math.round(255 * x); }).join(",") + ")";
}

// Turbo's colours from 0 to 1 for the bar beside the difference, the same polynomial as in SCREEN.
function turbo(x) {
  var rows = [
    [0.13572138, 4.6153926, -42.66032258, 132.13108234, -152.94239396, 59.28637943],
    [0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604],
    [0.1066733, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973],
  ];
  return rows.map(function (row) {
    var sum = 0;
    for (var k = 5; k >= 0; k--) sum = sum * x + row[k];
    return clamp(sum, 0, 1);
  });
}

function luminance(rgb) {
  return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

// Draw both sides onto the canvas. `shown` says {a, b, missing: [a, b], divider, share, mode,
// scale}.
function drawScreen(renderer, shown, state, unit) {
  var gl = renderer.gl, a = shown.a, b = shown.b || shown.a;
  var program = renderer.program("screen", FULL_SCREEN, function () {
    return SCREEN;
  });
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
  renderer.fill(
    program,
    {
      view_missing_a: shown.missing[0],
      view_missing_b: shown.missing[1],
      view_divider: shown.divider,
      view_share: shown.share,
      view_gain: Math.pow(2, state.exposure),
      view_mode: shown.mode,
      view_scale: shown.scale,
      view_unit: unit,
      view_screen: [gl.drawingBufferWidth, gl.drawingBufferHeight],
      view_paper: shown.paper,
      view_has_paper: !(state.background === "probe" && renderer.sky),
    },
    { view_a: a, view_b: b }
  );
}

// Stops that bring the upper quartile of the shape's luminance to the middle of the screen's range.
function suitableExposure(rgba) {
  var found = [];
  for (var i = 0; i < rgba.length; i += 4)
    if (rgba[i + 3] === 1) found.push(luminance([rgba[i], rgba[i + 1], rgba[i + 2]]));
  found.sort(function (x, y) { return x - y; });
  var bright = found.length ? found[Math.floor(0.75 * (found.length - 1))] : 0;
  return bright > 0 ? clamp(Math.round(4 * Math.log2(0.4 / bright)) / 4, -10, 10) : 0;
}

// Radiance of a pixel, whose row is counted from below, and how much of it the shape covers.
function pixelOf(renderer, picture, x, y) {
  var rgba = readTarget(renderer.gl, picture, x, y, 1, 1);
  return { rgb: [rgba[0], rgba[1], rgba[2]], covered: rgba[3] };
}

// How far A is from B, in pictures of the shape on black that `Viewer.read` returns: relative RMSE
// as `shrm compare` defines it, and the 99th percentile of the difference in the units of a mode.
// Pixels on the silhouette are divided by the part of them that the shape covers, and weigh as much.
function measured(one, two, mode) {
  var error = 0, whole = 0, amounts = [];
  for (var i = 0; i < one.length; i += 4) {
    var covered = one[i + 3], largest = 0;
    if (covered === 0) continue;
    for (var c = 0; c < 3; c++) {
      var apart = (one[i + c] - two[i + c]) / covered, value = two[i + c] / covered;
      error += covered * apart * apart;
      whole += covered * value * value;
      largest = Math.max(largest, Math.abs(apart));
    }
    if (mode === MODE.relative) {
      var truth = luminance([two[i], two[i + 1], two[i + 2]]);
      var found = luminance([one[i], one[i + 1], one[i + 2]]);
      largest = Math.abs(found - truth) / Math.max(Math.abs(truth), 1e-6);
    }
    amounts.push(largest);
  }
  amounts = Float32Array.from(amounts).sort();
  return {
    relative: whole > 0 ? Math.sqrt(error / whole) : error > 0 ? Infinity : 0,
    p99: amounts.length ? amounts[Math.floor(0.99 * (amounts.length - 1))] : 0,
  };
}
