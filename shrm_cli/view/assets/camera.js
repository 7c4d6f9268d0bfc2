// The cameras of `shrm render`: a distant viewer of a sphere, and a perspective eye before a mesh.
// Angles are in degrees, and lengths on the screen in pixels.

var SPHERE_FILL = 0.9; // Diameter of the sphere as a fraction of the picture's shorter edge.
var SPHERE_FOV = 50; // Angle that the surroundings of a sphere span across the shorter edge.
var MESH_FOV = 35; // The same for a mesh and its surroundings.
var LIMITS = { elevation: 89.9, zoom: [0.25, 16] };

function radians(degrees) {
  return (degrees * Math.PI) / 180;
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

// Right, up and V in world axes, one after the other: the columns of a matrix for WebGL.
// V is +Z at azimuth 0 and elevation 0; the azimuth turns towards +X.
function cameraAxes(azimuth, elevation) {
  var a = radians(azimuth), e = radians(elevation);
  var v = [Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)];
  var right = [Math.cos(a), 0, -Math.sin(a)];
  var up = [
    v[1] * right[2] - v[2] * right[1],
    v[2] * right[0] - v[0] * right[2],
    v[0] * right[1] - v[1] * right[0],
  ];
  return right.concat(up, v);
}

// The matrix that takes directions to where they were before the light was turned about +Y, from +Z
// towards +X: the surface and the viewer are turned back instead. No form of map is about a direction
// of the world but +Y, so that all of them are turned exactly.
function lightTurn(degrees) {
  var c = Math.cos(radians(degrees)), s = Math.sin(radians(degrees));
  return [c, 0, s, 0, 1, 0, -s, 0, c];
}

function wrapped(degrees) {
  return ((((degrees + 180) % 360) + 360) % 360) - 180;
}

// Distance of the eye from the picture's plane, whose shorter edge spans an angle of view.
function focalLength(width, height, fov, zoom) {
  return (zoom * Math.min(width, height)) / 2 / Math.tan(radians(fov / 2));
}

function sphereRadius(width, height, zoom) {
  return (zoom * SPHERE_FILL * Math.min(width, height)) / 2;
}

// A new view, turned by some degrees; it never tips over the poles.
function turned(view, azimuth, elevation) {
  return {
    azimuth: wrapped(view.azimuth + azimuth),
    elevation: clamp(view.elevation + elevation, -LIMITS.elevation, LIMITS.elevation),
    zoom: view.zoom,
  };
}

function zoomed(view, factor) {
  return {
    azimuth: view.azimuth,
    elevation: view.elevation,
    zoom: clamp(view.zoom * factor, LIMITS.zoom[0], LIMITS.zoom[1]),
  };
}

function isSameView(one, azimuth, elevation) {
  return Math.abs(one.azimuth - azimuth) < 1e-3 && Math.abs(one.elevation - elevation) < 1e-3;
}
