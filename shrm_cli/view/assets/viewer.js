// One view on a page: its state, and when it is drawn.

var SMOOTH = 60; // Milliseconds that a picture may take while something moves.
var STILL = 180; // Milliseconds without a change after which it is drawn in full.
var PATIENCE = 2500; // Milliseconds that may be spent on smoothing the edges of a mesh.
var MEASURED = 128; // Pixels along the edge of the pictures by which A is compared with B.
var TURNING = 30; // Degrees a second of a light that turns.
var COARSEST = 4; // Pixels of the screen along the edge of one that is drawn while things move.

var MODE = { divider: 0, absolute: 1, relative: 2, blend: 3 };

function isDifference(mode) {
  return mode === MODE.absolute || mode === MODE.relative;
}

function startState(scene) {
  var start = scene.start;
  return {
    view: { azimuth: start.view[0], elevation: start.view[1], zoom: 1 },
    shape: start.shape,
    light: 0, // degrees that it is turned by
    exposure: start.exposure || 0,
    roughness: start.roughness,
    anisotropy: start.anisotropy,
    brush: start.brush, // a direction, "uv", or null for around +Y
    f0: start.f0.slice(),
    values: start.values.slice(), // of parameters that vary, as `scene.ways` has them
    background: scene.sky ? "probe" : "plain",
    a: { kind: "map", number: 0 },
    b: scene.truths.length
      ? { kind: "truth", number: 0 }
      : scene.maps.length > 1 ? { kind: "map", number: 1 } : null,
    divider: 0.5,
    mode: MODE.divider,
    scale: 0.1,
  };
}

function Viewer(root, scene, blocks) {
  var self = this;
  this.root = root;
  this.scene = scene;
  this.canvas = root.querySelector(".stage > canvas");
  this.gl = openContext(this.canvas);
  this.renderer = new Renderer(this.gl, scene, blocks);
  this.sides = [new Side(this.renderer), new Side(this.renderer)];
  this.state = startState(scene);
  this.pointer = null; // where the mouse is, pixels of the page from the canvas's corner
  this.listeners = [];
  this.coarse = 1; // what keeps motion smooth on this device
  this.canvas.addEventListener("webglcontextlost", function (event) {
    event.preventDefault();
    fail(root, "The graphics device was lost. Load the page again.");
  });
  new ResizeObserver(function () { self.redraw(); }).observe(this.canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", function () { self.redraw(); });
}

// ---- state --------------------------------------------------------------------------------------

// Change parts of the state, tell the controls, and draw. `set({})` draws anew.
Viewer.prototype.set = function (changes) {
  Object.assign(this.state, changes);
  this.listeners.forEach(function (each) { each(); });
  this.redraw();
};

Viewer.prototype.reset = function () {
  this.spins = false;
  this.set(startState(this.scene));
};

// Turn the light, and no more than that: it is done in every frame while the light moves.
Viewer.prototype.turnLight = function (degrees) {
  this.state.light = wrapped(degrees);
  if (this.onTurned) this.onTurned();
  this.redraw();
};

// Move the divider, or what is blended: both pictures stay as they are.
Viewer.prototype.divide = function (share) {
  this.state.divider = clamp(share, 0, 1);
  if (this.onDivided) this.onDivided();
  this.reshow();
};

// Let the light go on turning, or stop it.
Viewer.prototype.spin = function () {
  var self = this, before = performance.now();
  this.spins = !this.spins;
  function next(now) {
    if (!self.spins) return;
    self.turnLight(self.state.light + (TURNING * Math.max(now - before, 0)) / 1000);
    before = now;
    requestAnimationFrame(next);
  }
  if (this.spins) requestAnimationFrame(next);
};

Viewer.prototype.needsSurface = function () {
  return this.scene.maps.some(function (map) { return map.surface; });
};

// Whether all maps of light alone can be shown as brushed surfaces.
Viewer.prototype.canBeBrushed = function () {
  return this.needsSurface() && this.scene.maps.every(function (map) { return map.brushed || !map.surface; });
};

// Whether surfaces have tangents that can be chosen, those of maps of brushed BRDFs, too.
Viewer.prototype.hasTangents = function () {
  return this.scene.maps.some(function (map) { return map.tangents; });
};

// The number of the picture of the truth that belongs to a state, or -1.
Viewer.prototype.truthOf = function (state) {
  var scene = this.scene, needs = this.needsSurface();
  return scene.truths.findIndex(function (truth) {
    return state.shape === SPHERE_SHAPE && Math.abs(state.light) < 1e-3 &&
      isSameView(state.view, truth.view[0], truth.view[1]) &&
      String(truth.brush) === String(state.brush === "uv" ? null : state.brush) &&
      scene.ways.every(function (way, k) {
        return Math.abs(truth.values[k] - state.values[k]) < 1e-6 * (way.high - way.low);
      }) &&
      (!needs || (Math.abs(truth.roughness - state.roughness) < 1e-6 &&
        Math.abs(truth.anisotropy - state.anisotropy) < 1e-6 &&
        truth.f0.every(function (x, k) { return Math.abs(x - state.f0[k]) < 1e-6; })));
  });
};

// Go to a view that the truth is known of: the one that is nearest to the present one.
Viewer.prototype.goToTruth = function () {
  var truths = this.scene.truths, now = this.state.view;
  if (!truths.length) return;
  var axis = cameraAxes(now.azimuth, now.elevation).slice(6);
  var near = truths.map(function (truth) {
    var other = cameraAxes(truth.view[0], truth.view[1]).slice(6);
    return axis[0] * other[0] + axis[1] * other[1] + axis[2] * other[2];
  });
  var truth = truths[near.indexOf(Math.max.apply(null, near))];
  var changes = {
    view: { azimuth: truth.view[0], elevation: truth.view[1], zoom: now.zoom }, shape: SPHERE_SHAPE,
    light: 0, brush: truth.brush, values: truth.values.slice(),
  };
  if (this.needsSurface()) {
    changes.roughness = truth.roughness;
    changes.anisotropy = truth.anisotropy;
    changes.f0 = truth.f0.slice();
  }
  this.set(changes);
};

Viewer.prototype.nameOf = function (side) {
  if (!side) return "";
  return side.kind === "truth" ? "Truth" : this.scene.maps[side.number].name;
};

// ---- drawing ------------------------------------------------------------------------------------

Viewer.prototype.redraw = function () {
  this.stale = true;
  this.reshow();
};

Viewer.prototype.reshow = function () {
  var self = this;
  if (this.frame) return;
  this.frame = requestAnimationFrame(function () {
    self.frame = 0;
    self.step();
  });
};

// Draw what has changed, or else make it smoother; come back as long as there is something to do.
// Slow devices draw fewer pixels while something moves, and all of them once it has stopped.
Viewer.prototype.step = function () {
  try {
    var more = false;
    if (this.stale) {
      var start = performance.now(), drawn = this.coarse;
      this.drawSides(drawn);
      this.settle(drawn, performance.now() - start);
      more = drawn === 1;
    } else {
      more = this.refineSides();
    }
    this.show();
    if (this.onDrawn) this.onDrawn();
    if (more) this.reshow();
  } catch (error) {
    fail(this.root, error.message);
  }
};

// Choose how coarse the next picture is from the time that the last one took, and come back for the
// whole of it.
Viewer.prototype.settle = function (drawn, milliseconds) {
  var self = this, whole = milliseconds * drawn * drawn;
  this.samples = Math.min(SAMPLES, 1 + Math.floor(PATIENCE / Math.max(whole, 1)));
  this.coarse = 1;
  while (this.coarse < COARSEST && whole / (this.coarse * this.coarse) > SMOOTH) this.coarse *= 2;
  clearTimeout(this.still);
  if (drawn === 1) return;
  this.still = setTimeout(function () {
    self.drawSides(1);
    self.show();
    if (self.onDrawn) self.onDrawn();
    self.step();
  }, STILL);
};

Viewer.prototype.size = function () {
  var unit = window.devicePixelRatio || 1;
  var most = this.gl.getParameter(this.gl.MAX_RENDERBUFFER_SIZE);
  return {
    width: clamp(Math.round(this.canvas.clientWidth * unit), 1, most),
    height: clamp(Math.round(this.canvas.clientHeight * unit), 1, most),
    unit: unit,
  };
};

// What each side shows now, with the truth's picture of this view; null where there is no side B.
Viewer.prototype.resolved = function () {
  var state = this.state, truth = this.truthOf(state);
  return [state.a, state.b].map(function (side) {
    if (!side) return null;
    if (side.kind === "map") return { side: side, missing: false };
    return { side: { kind: "truth", number: Math.max(truth, 0) }, missing: truth < 0 };
  });
};

// Draw both sides, with pixels that are so many of the screen's wide.
Viewer.prototype.drawSides = function (coarse) {
  var self = this, size = this.size();
  if (this.canvas.width !== size.width || this.canvas.height !== size.height) {
    this.canvas.width = size.width;
    this.canvas.height = size.height;
  }
  this.stale = false;
  this.shown = this.resolved();
  this.shown.forEach(function (each, k) {
    if (!each) return;
    self.sides[k].resize(Math.ceil(size.width / coarse), Math.ceil(size.height / coarse));
    self.sides[k].start(each.side, self.state);
    readTarget(self.gl, self.sides[k].picture(), 0, 0, 1, 1); // waits until it is drawn
  });
};

Viewer.prototype.refineSides = function () {
  var self = this;
  return this.shown
    .map(function (each, k) { return each ? self.sides[k].refine(each.side, self.state, self.samples) : false; })
    .some(Boolean);
};

Viewer.prototype.show = function () {
  var size = this.size(), both = this.shown[1] !== null;
  var dark = matchMedia("(prefers-color-scheme: dark)").matches;
  drawScreen(
    this.renderer,
    {
      a: this.sides[0].picture(),
      b: both ? this.sides[1].picture() : null,
      missing: [this.shown[0].missing, both && this.shown[1].missing],
      divider: both ? this.state.divider * size.width : 1e9,
      share: this.state.divider,
      mode: both ? this.state.mode : MODE.divider,
      scale: this.state.scale,
      paper: dark ? PAPER.dark : PAPER.light,
    },
    this.state,
    size.unit
  );
};

// Draw the first picture at once and coarsely, and come back for the rest.
Viewer.prototype.drawFirst = function () {
  this.coarse = COARSEST;
  this.drawSides(COARSEST);
  this.show();
  this.redraw();
};

// An exposure that suits side A, in quarters of a stop.
Viewer.prototype.suitableExposure = function () {
  return suitableExposure(this.read(48, 0, true));
};

// ---- what is read from it -----------------------------------------------------------------------

// Radiance of one side in a square picture of any size: rows from the highest, RGB and coverage.
// `side` is 0 for A and 1 for B; `onBlack` leaves the probe behind the shape out. Tests compare it with the picture of `shrm render`.
Viewer.prototype.read = function (size, side, onBlack) {
  var target = makeTarget(this.gl, size, size);
  var state = onBlack ? Object.assign({}, this.state, { background: "plain" }) : this.state;
  this.renderer.draw(target, this.resolved()[side || 0].side, state, [0, 0]);
  var values = readTarget(this.gl, target, 0, 0, size, size);
  freeTarget(this.gl, target);
  var rows = new Float32Array(values.length), length = 4 * size;
  for (var row = 0; row < size; row++)
    rows.set(values.subarray((size - 1 - row) * length, (size - row) * length), row * length);
  return rows;
};

// Frames a second of a square picture of side A, each of them finished before the next one.
Viewer.prototype.framesPerSecond = function (size, frames) {
  var target = makeTarget(this.gl, size, size), start = performance.now();
  for (var k = 0; k < frames; k++) {
    var state = Object.assign({}, this.state, { view: turned(this.state.view, k, 0) });
    this.renderer.draw(target, this.state.a, state, [0, 0]);
    readTarget(this.gl, target, 0, 0, 1, 1);
  }
  freeTarget(this.gl, target);
  return (1000 * frames) / (performance.now() - start);
};
