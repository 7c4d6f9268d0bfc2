// Pictures of a map, or of the truth, on a sphere or a mesh.

var SAMPLES = 16; // Frames whose mean makes the edges of a mesh smooth, once nothing moves.
var SPHERE_SHAPE = 0;

function Renderer(gl, scene, blocks) {
  this.gl = gl;
  this.scene = scene;
  this.blocks = blocks;
  this.programs = {};
  this.mapTextures = {};
  this.truthTextures = {};
  this.meshes = {};
  this.sky = scene.sky ? makeTexture(gl, scene.sky, blocks) : null;
  this.nothing = makeTexture(
    gl, { format: "rgb16f", width: 1, height: 1, depth: 0, block: 0 }, [new Uint16Array(4).buffer]
  );
  gl.bindVertexArray(null);
}

// ---- what is uploaded when it is first shown ----------------------------------------------------

Renderer.prototype.program = function (key, vertex, fragment) {
  if (!this.programs[key]) this.programs[key] = makeProgram(this.gl, vertex, fragment());
  return this.programs[key];
};

Renderer.prototype.texturesOf = function (number) {
  var self = this;
  if (!this.mapTextures[number]) {
    var made = {};
    this.scene.maps[number].textures.forEach(function (each) {
      made[each.name] = makeTexture(self.gl, each, self.blocks);
    });
    this.mapTextures[number] = made;
  }
  return this.mapTextures[number];
};

Renderer.prototype.truthTexture = function (number) {
  var truth = this.scene.truths[number];
  if (!this.truthTextures[number])
    this.truthTextures[number] = makeTexture(this.gl, truth.picture, this.blocks);
  return this.truthTextures[number];
};

Renderer.prototype.meshOf = function (number) {
  if (this.meshes[number]) return this.meshes[number];
  var gl = this.gl, shape = this.scene.shapes[number];
  var buffer = function (kind, block) {
    gl.bindBuffer(kind, gl.createBuffer());
    gl.bufferData(kind, block, gl.STATIC_DRAW);
  };
  var made = { array: gl.createVertexArray(), count: 3 * shape.triangles };
  made.type = shape.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT;
  gl.bindVertexArray(made.array);
  buffer(gl.ARRAY_BUFFER, this.blocks[shape.positions]);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
  buffer(gl.ARRAY_BUFFER, this.blocks[shape.normals]);
  gl.enableVertexAttribArray(1);
  gl.vertexAttribPointer(1, 4, gl.SHORT, true, 0, 0); // the fourth number keeps them aligned
  if (shape.tangents !== undefined) { // without, all are 0
    buffer(gl.ARRAY_BUFFER, this.blocks[shape.tangents]);
    gl.enableVertexAttribArray(2);
    gl.vertexAttribPointer(2, 4, gl.SHORT, true, 0, 0);
  }
  buffer(gl.ELEMENT_ARRAY_BUFFER, this.blocks[shape.indices]);
  gl.bindVertexArray(null);
  this.meshes[number] = made;
  return made;
};

// The map's own code, and its call. The user's mesh stands in the room of the map's probe.
function shownCode(map, isBrushed) {
  var call = isBrushed ? map.brushed_call
    : map.boxed_call ? "view_boxed ? " + map.boxed_call + " : " + map.call : map.call;
  return map.code + "\nvec3 shrm_shown(vec3 n, vec3 v, vec3 p) {\n" +
    "  n = view_turn * n;\n  v = view_turn * v;\n  return " + call + ";\n}\n";
}

// How far the parameters of a map that vary are on their ways, which may end before those of others.
function sharesOf(map, values) {
  var shares = map.ways.map(function (way) {
    return clamp((values[way.number] - way.low) / (way.high - way.low), 0, 1);
  });
  return [shares[0] || 0, shares[1] || 0];
}

// ---- drawing ------------------------------------------------------------------------------------

// The uniforms of every picture of a state, at some size.
Renderer.prototype.common = function (state, width, height) {
  var isSphere = state.shape === SPHERE_SHAPE, shape = this.scene.shapes[state.shape];
  var fov = isSphere ? SPHERE_FOV : MESH_FOV;
  return {
    view_size: [width, height],
    view_axes: cameraAxes(state.view.azimuth, state.view.elevation),
    view_turn: lightTurn(state.light),
    view_focal: focalLength(width, height, fov, state.view.zoom),
    view_radius: sphereRadius(width, height, state.view.zoom),
    view_distance: shape.distance || 1,
    view_middle: shape.middle || [0, 0, 0],
    view_scale: shape.radius || 1,
    view_boxed: !!shape.file && state.light % 360 === 0,
    view_roughness: state.roughness,
    view_f0: state.f0,
    view_anisotropy: state.anisotropy,
    view_brush: Array.isArray(state.brush) ? state.brush : [0, 0, 0],
    view_follows_u: state.brush === "uv",
    view_has_sky: state.background === "probe" && this.sky !== null,
  };
};

Renderer.prototype.textures = function (more) {
  return Object.assign({ view_sky: this.sky || this.nothing }, more);
};

// Draw what stands on one side into a target. `side` is {kind: "map"|"truth", number}, and `shift`
// says where in the pixels the samples of a mesh lie, [0, 0] in the middle.
Renderer.prototype.draw = function (target, side, state, shift) {
  var gl = this.gl;
  var values = this.common(state, target.width, target.height);
  values.view_shift = shift || [0, 0];
  if (side.kind === "map") {
    var map = this.scene.maps[side.number];
    values.shrm_lighting = map.lighting;
    values.view_shares = sharesOf(map, state.values);
  }
  gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
  gl.viewport(0, 0, target.width, target.height);
  gl.disable(gl.BLEND);
  if (state.shape === SPHERE_SHAPE) this.drawSphere(side, values);
  else this.drawMesh(side, state, values);
};

// The program of a map. Brushed surfaces have another one, because devices compile all that a
// program might do before they draw: of a split sum that took a processor three seconds.
Renderer.prototype.mapProgram = function (shape, side, values, vertex, rest) {
  var map = this.scene.maps[side.number], isBrushed = map.brushed && values.view_anisotropy > 0;
  return this.program(shape + side.number + (isBrushed ? " brushed" : ""), vertex, function () {
    return HEAD + COMMON + shownCode(map, isBrushed) + rest;
  });
};

Renderer.prototype.drawSphere = function (side, values) {
  var isTruth = side.kind === "truth";
  var program = isTruth
    ? this.program("truth", FULL_SCREEN, function () { return HEAD + COMMON + SEEN_TRUTH + SPHERE; })
    : this.mapProgram("sphere ", side, values, FULL_SCREEN, SEEN_MAP + SPHERE);
  var own = isTruth ? { view_truth: this.truthTexture(side.number) } : this.texturesOf(side.number);
  this.fill(program, values, this.textures(own));
};

Renderer.prototype.drawMesh = function (side, state, values) {
  var gl = this.gl, mesh = this.meshOf(state.shape);
  var behind = this.program("behind", FULL_SCREEN, function () {
    return HEAD + COMMON + BEHIND;
  });
  gl.clear(gl.DEPTH_BUFFER_BIT);
  this.fill(behind, values, this.textures({}));
  if (side.kind === "truth") return; // no truth of meshes is known
  var program = this.mapProgram("mesh ", side, values, MESH_VERTEX, MESH);
  gl.useProgram(program.program);
  setUniforms(gl, program, values);
  bindTextures(gl, program, this.textures(this.texturesOf(side.number)));
  gl.enable(gl.DEPTH_TEST);
  gl.bindVertexArray(mesh.array);
  gl.drawElements(gl.TRIANGLES, mesh.count, mesh.type, 0);
  gl.bindVertexArray(null);
  gl.disable(gl.DEPTH_TEST);
};

// Draw a program over all pixels.
Renderer.prototype.fill = function (program, values, textures) {
  var gl = this.gl;
  gl.useProgram(program.program);
  setUniforms(gl, program, values);
  bindTextures(gl, program, textures);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
};

// ---- sides --------------------------------------------------------------------------------------

// The pictures of one side of the screen: one that is drawn, and two that hold means of samples.
function Side(renderer) {
  this.renderer = renderer;
  this.targets = [];
  this.samples = 0;
  this.mean = 0;
}

Side.prototype.resize = function (width, height) {
  var gl = this.renderer.gl, old = this.targets[0];
  if (old && old.width === width && old.height === height) return;
  this.targets.forEach(function (each) {
    freeTarget(gl, each);
  });
  this.targets = [makeTarget(gl, width, height)];
};

// The picture to show: the last one that was drawn, or the mean of several.
Side.prototype.picture = function () {
  return this.targets[this.mean];
};

Side.prototype.start = function (shown, state) {
  this.renderer.draw(this.targets[0], shown, state, [0, 0]);
  this.samples = 1;
  this.mean = 0;
};

// Add a sample to the mean; whether there are more to come. Spheres need none.
Side.prototype.refine = function (shown, state, samples) {
  var gl = this.renderer.gl, first = this.targets[0];
  if (state.shape === SPHERE_SHAPE || this.samples >= samples) return false;
  while (this.targets.length < 3) this.targets.push(makeTarget(gl, first.width, first.height));
  // The first sample is the middle of the pixel; the mean begins anew with the grid's own.
  var k = this.samples - 1, count = SAMPLES - 1;
  var shift = [((k + 0.5) * 0.5698403) % 1 - 0.5, (k + 0.5) / count - 0.5];
  this.renderer.draw(first, shown, state, shift);
  var next = this.mean === 1 ? 2 : 1;
  var program = this.renderer.program("mean", FULL_SCREEN, function () {
    return MEAN;
  });
  gl.bindFramebuffer(gl.FRAMEBUFFER, this.targets[next].frame);
  var before = this.mean === 0 ? this.renderer.nothing : this.targets[this.mean];
  this.renderer.fill(
    program, { view_weight: 1 / this.samples }, { view_before: before, view_sample: first }
  );
  this.mean = next;
  this.samples += 1;
  return this.samples < samples;
};
