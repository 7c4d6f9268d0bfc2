// The shaders of the page around the code of a map, which is what `--shader` prints.
// `shrm_shown(n, v, p)` is the radiance of the map that is drawn; every map defines it by its own call.

var HEAD = [
  "#version 300 es",
  "precision highp float;",
  "precision highp int;",
  "precision highp sampler2D;",
  "precision highp sampler2DArray;",
  "",
].join("\n");

var FULL_SCREEN = HEAD + [
  "void main() {",
  "  vec2 corner = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));",
  "  gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0);",
  "}",
].join("\n");

// What all pictures share. Lengths are pixels, from the middle of the picture.
var COMMON = [
  "uniform vec2 view_size;",
  "uniform mat3 view_axes;", // right, up and V
  "uniform mat3 view_turn;", // from the world to where the light is as it was made
  "uniform float view_focal;",
  "uniform float view_roughness;",
  "uniform vec3 view_f0;",
  "uniform float view_anisotropy;",
  "uniform vec2 view_shares;", // where parameters that vary are on their ways
  "uniform bool view_boxed;", // whether maps are looked up in the boxes of their rooms
  "uniform bool view_has_sky;",
  "uniform sampler2D view_sky;",
  "",
  // Tangents follow a direction or the mesh's own, or run around +Y, as those of `shrm render` do.
  "uniform vec3 view_brush;", // 0 for none
  "vec3 view_along = vec3(0.0);", // of a mesh
  "vec3 view_tangent(vec3 n) {",
  "  vec3 along = view_turn * (view_brush + view_along);",
  "  along -= dot(along, n) * n;",
  "  float size = length(along);",
  "  if (size > 1e-6) return along / size;",
  "  size = length(n.xz);",
  "  return size > 0.0 ? vec3(n.z, 0.0, -n.x) / size : vec3(1.0, 0.0, 0.0);",
  "}",
  "",
  "vec2 view_point() { return gl_FragCoord.xy - 0.5 * view_size; }",
  "",
  // Bilinear, around the seam and over the poles, as `shrm render --background` filters it.
  "vec3 view_texel(ivec2 at, ivec2 size) {",
  "  if (at.y < 0 || at.y >= size.y) at.x += size.x / 2;",
  "  at.y = at.y < 0 ? -1 - at.y : min(at.y, 2 * size.y - 1 - at.y);",
  "  at.x = (at.x % size.x + size.x) % size.x;",
  "  return texelFetch(view_sky, at, 0).rgb;",
  "}",
  "vec3 view_surroundings(vec3 d) {",
  "  if (!view_has_sky) return vec3(0.0);",
  "  ivec2 size = textureSize(view_sky, 0);",
  "  d = view_turn * d;",
  "  float across = -atan(d.x, d.z) / 3.141592653589793;",
  "  float down = atan(length(d.xz), d.y) / 1.5707963267948966 - 1.0;",
  "  vec2 at = 0.5 * (vec2(across, down) + 1.0) * vec2(size) - 0.5;",
  "  ivec2 low = ivec2(floor(at));",
  "  vec2 part = at - vec2(low);",
  "  return mix(mix(view_texel(low, size), view_texel(low + ivec2(1, 0), size), part.x),",
  "             mix(view_texel(low + ivec2(0, 1), size), view_texel(low + ivec2(1, 1), size), part.x),",
  "             part.y);",
  "}",
  "vec3 view_behind() {",
  "  return view_surroundings(normalize(view_axes * vec3(view_point(), -view_focal)));",
  "}",
  "",
].join("\n");

// A sphere, exactly as `shrm render` draws it: one sample a pixel, sixteen within two pixels of
// the silhouette, and the share of each pixel that the sphere covers.
var SPHERE = [
  "uniform float view_radius;",
  "out vec4 view_result;",
  "",
  "float view_coverage(vec2 p) {",
  "  float away = length(p) - view_radius;",
  "  if (abs(away) >= 1.0) return away < 0.0 ? 1.0 : 0.0;",
  "  p = abs(p);",
  "  float along = max(p.x, p.y), across = min(p.x, p.y), sum = 0.0;",
  "  for (int k = 0; k < 16; ++k) {",
  "    float strip = across + (float(k) + 0.5) / 16.0 - 0.5;",
  "    float chord = sqrt(max(view_radius * view_radius - strip * strip, 0.0));",
  "    sum += clamp(chord - along + 0.5, 0.0, 1.0);",
  "  }",
  "  return sum / 16.0;",
  "}",
  "",
  "void main() {",
  "  vec2 p = view_point();",
  "  float covered = view_coverage(p);",
  "  vec3 behind = view_behind();",
  "  if (covered == 0.0) { view_result = vec4(behind, 0.0); return; }",
  "  int edge = length(p) > view_radius - 2.0 ? 4 : 1;",
  "  vec3 sum = vec3(0.0);",
  "  float weights = 0.0;",
  "  for (int k = 0; k < edge * edge; ++k) {",
  "    vec2 offset = (vec2(float(k % edge), float(k / edge)) + 0.5) / float(edge) - 0.5;",
  "    vec2 q = (p + offset) / view_radius;",
  "    float away = length(q), weight = 1.0;",
  "    if (edge > 1 && away > 1.0) {",
  "      weight = 1e-6;",
  "      q *= (1.0 - 0.0625 / view_radius) / away;",
  "    }",
  "    sum += weight * view_seen(q);",
  "    weights += weight;",
  "  }",
  "  view_result = vec4(mix(behind, sum / weights, covered), covered);",
  "}",
].join("\n");

// What is seen at a point of the sphere, in radii from its centre: a map, or a picture of the truth.
var SEEN_MAP = [
  "vec3 view_seen(vec2 q) {",
  "  vec3 local = vec3(q, sqrt(max(1.0 - dot(q, q), 0.0)));",
  "  return shrm_shown(normalize(view_axes * local), view_axes[2], vec3(0.0));",
  "}",
  "",
].join("\n");

var SEEN_TRUTH = [
  "uniform sampler2D view_truth;", // the first row is the highest
  // Its points are at equal angles of the normal, which are close together at the silhouette.
  "vec3 view_seen(vec2 q) {",
  "  ivec2 size = textureSize(view_truth, 0);",
  "  float sine = length(q);",
  "  q *= sine > 1e-4 ? asin(min(sine, 1.0)) / (1.5707963267948966 * sine) : 0.6366197723675814;",
  "  vec2 at = clamp(0.5 * (vec2(q.x, -q.y) + 1.0) * vec2(size) - 0.5, vec2(0.0), vec2(size - 1));",
  "  ivec2 low = min(ivec2(at), size - 2);",
  "  vec2 part = at - vec2(low);",
  "  vec3 a = texelFetch(view_truth, low, 0).rgb, b = texelFetch(view_truth, low + ivec2(1, 0), 0).rgb;",
  "  vec3 c = texelFetch(view_truth, low + ivec2(0, 1), 0).rgb;",
  "  vec3 d = texelFetch(view_truth, low + ivec2(1, 1), 0).rgb;",
  "  return mix(mix(a, b, part.x), mix(c, d, part.x), part.y);",
  "}",
  "",
].join("\n");

var MESH_VERTEX = HEAD + [
  "in vec3 position;",
  "in vec3 normal;",
  "in vec3 tangent;",
  "uniform vec2 view_size;",
  "uniform mat3 view_axes;",
  "uniform float view_focal;",
  "uniform float view_distance;",
  "uniform vec2 view_shift;", // of the samples within a pixel
  "out vec3 mesh_position;",
  "out vec3 mesh_normal;",
  "out vec3 mesh_tangent;",
  "void main() {",
  "  vec3 local = transpose(view_axes) * position;",
  "  float depth = view_distance - local.z, near = max(view_distance - 1.01, 0.01 * view_distance);",
  "  float far = view_distance + 1.01;",
  "  vec2 flat_point = (local.xy * view_focal + view_shift * depth) * 2.0 / view_size;",
  "  float z = (depth * (far + near) - 2.0 * far * near) / (far - near);",
  "  gl_Position = vec4(flat_point, z, depth);",
  "  mesh_position = position;",
  "  mesh_normal = normal;",
  "  mesh_tangent = tangent;",
  "}",
].join("\n");

// Both sides of a surface look alike; smooth normals that face away are bent towards the viewer.
var MESH = [
  "uniform float view_distance;",
  "uniform bool view_follows_u;",
  "uniform vec3 view_middle;", // of the mesh in world axes, and the length that is 1 here
  "uniform float view_scale;",
  "in vec3 mesh_position;",
  "in vec3 mesh_normal;",
  "in vec3 mesh_tangent;",
  "out vec4 view_result;",
  "void main() {",
  "  vec3 flat_normal = normalize(cross(dFdx(mesh_position), dFdy(mesh_position)));",
  "  vec3 v = normalize(view_axes[2] * view_distance - mesh_position);",
  "  vec3 n = normalize(mesh_normal);",
  "  if (dot(flat_normal, v) * dot(flat_normal, n) < 0.0) n = -n;",
  "  float cosine = dot(n, v);",
  "  if (cosine < 0.01) n = 0.01 * v + sqrt(1.0 - 0.0001) * normalize(n - cosine * v);",
  "  if (view_follows_u) view_along = mesh_tangent;",
  "  view_result = vec4(shrm_shown(n, v, view_middle + view_scale * mesh_position), 1.0);",
  "}",
].join("\n");

var BEHIND = [
  "out vec4 view_result;",
  "void main() { view_result = vec4(view_behind(), 0.0); }",
].join("\n");

// The mean of frames whose samples lie at other places within the pixels.
var MEAN = HEAD + [
  "uniform sampler2D view_before;",
  "uniform sampler2D view_sample;",
  "uniform float view_weight;",
  "out vec4 view_result;",
  "void main() {",
  "  ivec2 at = ivec2(gl_FragCoord.xy);",
  "  vec4 added = texelFetch(view_sample, at, 0);",
  "  vec4 before = view_weight == 1.0 ? added : texelFetch(view_before, at, 0);",
  "  view_result = mix(before, added, view_weight);",
  "}",
].join("\n");

// Exposure and sRGB, the divider between two pictures, and their difference in false colours.
var SCREEN = HEAD + [
  "uniform sampler2D view_a;",
  "uniform sampler2D view_b;",
  "uniform bool view_missing_a;",
  "uniform bool view_missing_b;",
  "uniform float view_divider;", // pixels from the left; everything to the right of it is B
  "uniform float view_gain;",
  "uniform float view_share;", // of B, where both are blended
  "uniform float view_mode;", // 0 pictures, 1 absolute difference, 2 relative difference, 3 both blended
  "uniform float view_scale;",
  "uniform float view_unit;", // of the screen: device pixels in a pixel of the page
  "uniform vec2 view_screen;", // its size; pictures may have fewer pixels
  "uniform vec3 view_paper;", // sRGB, around the shape
  "uniform bool view_has_paper;",
  "out vec4 view_result;",
  "",
  "vec3 encoded(vec3 linear) {",
  "  vec3 x = clamp(linear, 0.0, 1.0);",
  "  return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, x));",
  "}",
  "float luminance(vec3 c) { return dot(c, vec3(0.2126, 0.7152, 0.0722)); }",
  "",
  // Turbo by Anton Mikhailov (Apache 2.0), its polynomial approximation.
  "vec3 turbo(float x) {",
  "  vec4 v4 = vec4(1.0, x, x * x, x * x * x);",
  "  vec2 v2 = v4.zw * v4.z;",
  "  return clamp(vec3(",
  "    dot(v4, vec4(0.13572138, 4.61539260, -42.66032258, 132.13108234)) + dot(v2, vec2(-152.94239396, 59.28637943)),",
  "    dot(v4, vec4(0.09140261, 2.19418839, 4.84296658, -14.18503333)) + dot(v2, vec2(4.27729857, 2.82956604)),",
  "    dot(v4, vec4(0.10667330, 12.64194608, -60.58204836, 110.36276771)) + dot(v2, vec2(-89.90310912, 27.34824973))),",
  "    0.0, 1.0);",
  "}",
  "",
  "vec3 hatched() {",
  "  float stripe = step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / (14.0 * view_unit)));",
  "  return view_paper * mix(0.86, 1.0, stripe);",
  "}",
  "",
  "void main() {",
  "  ivec2 at = ivec2(gl_FragCoord.xy * vec2(textureSize(view_a, 0)) / view_screen);",
  "  vec4 a = texelFetch(view_a, at, 0), b = texelFetch(view_b, at, 0);",
  "  bool is_b = gl_FragCoord.x > view_divider;",
  "  vec3 color;",
  "  bool is_blend = view_mode > 2.5;",
  "  if (view_mode > 0.5 && !is_blend) {",
  "    float shown = max(a.a, b.a);",
  "    vec3 apart = abs(a.rgb - b.rgb);",
  "    float amount = max(apart.r, max(apart.g, apart.b));",
  "    if (view_mode > 1.5) amount = abs(luminance(a.rgb - b.rgb)) / max(abs(luminance(b.rgb)), 1e-6);",
  "    bool missing = view_missing_a || view_missing_b;",
  "    color = mix(view_paper, missing ? hatched() : turbo(clamp(amount / view_scale, 0.0, 1.0)), shown);",
  "  } else {",
  "    vec4 here = is_blend ? mix(a, b, view_share) : is_b ? b : a;",
  "    bool missing = is_blend ? view_missing_a || view_missing_b : is_b ? view_missing_b : view_missing_a;",
  "    color = encoded(here.rgb * view_gain);",
  "    if (here.a < 1.0 && view_has_paper) color = mix(encoded(view_gain * here.rgb / max(here.a, 1e-4)), view_paper, 1.0 - here.a);",
  "    if (missing) color = mix(color, hatched(), max(a.a, b.a));",
  "  }",
  "  if (view_divider > 0.0 && view_mode < 0.5) {",
  "    float away = abs(gl_FragCoord.x - view_divider) / view_unit;",
  "    color = mix(color, vec3(1.0), 0.9 * clamp(1.5 - away, 0.0, 1.0));",
  "    color = mix(color, vec3(0.0), 0.35 * clamp(1.5 - abs(away - 2.0), 0.0, 1.0));",
  "  }",
  "  view_result = vec4(color, 1.0);",
  "}",
].join("\n");
