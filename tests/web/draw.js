// Draws one pixel for each pair of a normal and a view, into floats, and returns them.
// `job` has the code, the call, the textures and the pairs; arrays of floats come in base64.
async (job) => {
  const floats = (text) =>
    new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("no float colour buffers");
  const program = gl.createProgram();
  const head = "#version 300 es\nprecision highp float;\nprecision highp int;\n";
  const sources = {
    [gl.VERTEX_SHADER]: head + "in vec2 at;\nvoid main() { gl_Position = vec4(at, 0.0, 1.0); }\n",
    [gl.FRAGMENT_SHADER]:
      head + "uniform highp sampler2D pairs;\nout vec4 color;\n" + job.code +
      "void main() {\n  int x = int(gl_FragCoord.x);\n" +
      "  vec3 n = texelFetch(pairs, ivec2(x, 0), 0).xyz, v = texelFetch(pairs, ivec2(x, 1), 0).xyz;\n" +
      "  color = vec4(" + job.call + ", 1.0);\n}\n",
  };
  for (const [kind, source] of Object.entries(sources)) {
    const shader = gl.createShader(Number(kind));
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    const log = gl.getShaderInfoLog(shader);
    if (log) throw new Error(log);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const nearest = (kind) => {
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(kind, name, gl.NEAREST);
    }
  };
  job.textures.forEach(({ name, shape: [layers, height, width], values }, unit) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, gl.createTexture());
    gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGB32F, width, height, layers, 0, gl.RGB, gl.FLOAT, floats(values));
    nearest(gl.TEXTURE_2D_ARRAY);
    gl.uniform1i(gl.getUniformLocation(program, name), unit);
  });
  if (job.lighting) gl.uniform3fv(gl.getUniformLocation(program, "shrm_lighting"), floats(job.lighting));
  gl.activeTexture(gl.TEXTURE0 + job.textures.length);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB32F, job.count, 2, 0, gl.RGB, gl.FLOAT, floats(job.pairs));
  nearest(gl.TEXTURE_2D);
  gl.uniform1i(gl.getUniformLocation(program, "pairs"), job.textures.length);
  const target = gl.createRenderbuffer();
  gl.bindRenderbuffer(gl.RENDERBUFFER, target);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA32F, job.count, 1);
  gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, target);
  gl.viewport(0, 0, job.count, 1);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
  const at = gl.getAttribLocation(program, "at");
  gl.enableVertexAttribArray(at);
  gl.vertexAttribPointer(at, 2, gl.FLOAT, false, 0, 0);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  const pixels = new Float32Array(4 * job.count);
  gl.readPixels(0, 0, job.count, 1, gl.RGBA, gl.FLOAT, pixels);
  const error = gl.getError();
  if (error) throw new Error("WebGL error " + error);
  return Array.from(pixels);
}
