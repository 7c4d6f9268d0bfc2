// WebGL2: programs, textures, and pictures of floats that can be read back.

function openContext(canvas) {
  var gl = canvas.getContext("webgl2", { antialias: false, alpha: false, depth: false });
  if (!gl) throw new Error("This browser has no WebGL2.");
  if (!gl.getExtension("EXT_color_buffer_float") && !gl.getExtension("EXT_color_buffer_half_float"))
    throw new Error("This graphics device cannot draw floating-point pictures.");
  return gl;
}

function compile(gl, kind, source) {
  var shader = gl.createShader(kind);
  gl.shaderSource(shader, source);
  gl.compileShader(shader);
  if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
    throw new Error("A shader cannot be compiled: " + gl.getShaderInfoLog(shader));
  return shader;
}

// A program, and the places of its uniforms by name.
function makeProgram(gl, vertex, fragment) {
  var program = gl.createProgram();
  gl.attachShader(program, compile(gl, gl.VERTEX_SHADER, vertex));
  gl.attachShader(program, compile(gl, gl.FRAGMENT_SHADER, fragment));
  gl.bindAttribLocation(program, 0, "position");
  gl.bindAttribLocation(program, 1, "normal");
  gl.bindAttribLocation(program, 2, "tangent");
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
    throw new Error("A shader cannot be linked: " + gl.getProgramInfoLog(program));
  var places = {};
  var count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) || 0;
  for (var i = 0; i < count; i++) {
    var name = gl.getActiveUniform(program, i).name.replace("[0]", "");
    places[name] = gl.getUniformLocation(program, name);
  }
  return { program: program, places: places };
}

// Uniforms by name; a program need not have all of them. Numbers are floats, lists of 2, 3 or 4
// numbers vectors, of 9 matrices, and longer ones arrays of colours.
function setUniforms(gl, made, values) {
  Object.keys(values).forEach(function (name) {
    var place = made.places[name], value = values[name];
    if (place === undefined || place === null || value === undefined || value === null) return;
    if (typeof value === "boolean") gl.uniform1i(place, value ? 1 : 0);
    else if (typeof value === "number") gl.uniform1f(place, value);
    else if (value.length === 9) gl.uniformMatrix3fv(place, false, value);
    else if (value.length > 4) gl.uniform3fv(place, value);
    else gl["uniform" + value.length + "fv"](place, value);
  });
}

// Textures by the names of their samplers, from unit 0 on.
function bindTextures(gl, made, textures) {
  var unit = 0;
  Object.keys(textures).forEach(function (name) {
    var place = made.places[name];
    if (place === undefined || place === null) return;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(textures[name].target, textures[name].texture);
    gl.uniform1i(place, unit);
    unit += 1;
  });
}

var FORMATS = {
  rgb16f: ["RGB16F", "RGB", "HALF_FLOAT", Uint16Array],
  rgb32f: ["RGB32F", "RGB", "FLOAT", Float32Array],
};

// A texture as Python describes it: {format, width, height, depth or 0, block, maybe exponents}.
// Shaders fetch its
// texels and blend them themselves, so that no device's filter is part of a picture.
function makeTexture(gl, described, blocks) {
  var format = FORMATS[described.format];
  var target = described.depth ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D;
  var most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
  if (Math.max(described.width, described.height) > most)
    throw new Error(
      "A texture of " + described.width + " x " + described.height + " texels is larger than the " +
        most + " of this graphics device. Make the map smaller by shrm convert --size."
    );
  var texture = gl.createTexture();
  var is_rounded = described.exponents !== undefined, buffer = blocks[described.block];
  var values = is_rounded
    ? unrounded(described, new Uint16Array(buffer), new Int8Array(blocks[described.exponents]))
    : new format[3](buffer);
  var kind = is_rounded ? gl.FLOAT : gl[format[2]];
  gl.bindTexture(target, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  if (described.depth) {
    gl.texImage3D(
      target, 0, gl[format[0]], described.width, described.height, described.depth, 0,
      gl[format[1]], kind, values
    );
  } else {
    gl.texImage2D(
      target, 0, gl[format[0]], described.width, described.height, 0,
      gl[format[1]], kind, values
    );
  }
  gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.texParameteri(target, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(target, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  return { target: target, texture: texture };
}

// A picture to draw into: linear radiance in 32-bit floats, or 16-bit ones on devices that cannot
// draw others, with depth.
function makeTarget(gl, width, height) {
  var texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  var format = gl.getExtension("EXT_color_buffer_float") ? gl.RGBA32F : gl.RGBA16F;
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  var depth = gl.createRenderbuffer();
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
  var frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  return {
    target: gl.TEXTURE_2D, texture: texture, depth: depth, frame: frame,
    width: width, height: height,
  };
}

function freeTarget(gl, made) {
  gl.deleteFramebuffer(made.frame);
  gl.deleteRenderbuffer(made.depth);
  gl.deleteTexture(made.texture);
}

// RGBA of a rectangle of a picture, whose first row is the lowest.
function readTarget(gl, made, x, y, width, height) {
  var values = new Float32Array(4 * width * height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, made.frame);
  gl.readPixels(x, y, width, height, gl.RGBA, gl.FLOAT, values);
  return values;
}
