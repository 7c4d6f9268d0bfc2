// Computes the radiance of each pair of a normal and a view on a WebGPU device, and returns it.
// `job` has the code, the call, the textures and the pairs; arrays of floats come in base64.
async (job) => {
  const floats = (text) =>
    new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const device = await (await navigator.gpu.requestAdapter()).requestDevice();
  const wrong = [];
  device.onuncapturederror = (event) => wrong.push(event.error.message);
  const module = device.createShaderModule({ code: job.code + `
@group(1) @binding(0) var<storage, read> pairs: array<f32>;
@group(1) @binding(1) var<storage, read_write> found: array<f32>;
fn pair(k: u32) -> vec3f { return vec3f(pairs[3 * k], pairs[3 * k + 1], pairs[3 * k + 2]); }
@compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u)
{
    let n = pair(id.x);
    let v = pair(id.x + ${job.count});
    let c = ${job.call};
    found[3 * id.x] = c.x;
    found[3 * id.x + 1] = c.y;
    found[3 * id.x + 2] = c.z;
}
` });
  const { messages } = await module.getCompilationInfo();
  if (messages.length) throw new Error(messages.map((each) => `${each.lineNum}: ${each.message}`).join("\n"));
  const pipeline = device.createComputePipeline({ layout: "auto", compute: { module } });
  const textures = job.textures.map(({ shape: [layers, height, width], values }, binding) => {
    const rgb = floats(values), rgba = new Float32Array((rgb.length / 3) * 4);
    for (let k = 0; k < rgb.length; k++) rgba[4 * Math.floor(k / 3) + (k % 3)] = rgb[k];
    const texture = device.createTexture({
      size: [width, height, layers], format: "rgba32float",
      usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
    });
    device.queue.writeTexture(
      { texture }, rgba, { bytesPerRow: 16 * width, rowsPerImage: height }, [width, height, layers]
    );
    return { binding, resource: texture.createView({ dimension: "2d-array" }) };
  });
  if (job.lighting) {
    const rgb = floats(job.lighting), rgba = new Float32Array((rgb.length / 3) * 4);
    for (let k = 0; k < rgb.length; k++) rgba[4 * Math.floor(k / 3) + (k % 3)] = rgb[k];
    const light = device.createBuffer({ size: rgba.byteLength, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
    device.queue.writeBuffer(light, 0, rgba);
    textures.push({ binding: textures.length, resource: { buffer: light } });
  }
  const pairs = floats(job.pairs), bytes = 12 * job.count;
  const buffer = (size, usage) => device.createBuffer({ size, usage });
  const given = buffer(pairs.byteLength, GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST);
  const made = buffer(bytes, GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC);
  const read = buffer(bytes, GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST);
  device.queue.writeBuffer(given, 0, pairs);
  const commands = device.createCommandEncoder(), pass = commands.beginComputePass();
  pass.setPipeline(pipeline);
  const groups = [textures, [given, made].map((each, binding) => ({ binding, resource: { buffer: each } }))];
  groups.forEach((entries, k) => {
    if (entries.length)
      pass.setBindGroup(k, device.createBindGroup({ layout: pipeline.getBindGroupLayout(k), entries }));
  });
  pass.dispatchWorkgroups(job.count);
  pass.end();
  commands.copyBufferToBuffer(made, 0, read, 0, bytes);
  device.queue.submit([commands.finish()]);
  await read.mapAsync(GPUMapMode.READ);
  const result = Array.from(new Float32Array(read.getMappedRange()));
  device.destroy();
  if (wrong.length) throw new Error(wrong.join("\n"));
  return result;
}
