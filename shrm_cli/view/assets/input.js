// Mouse, touch and keyboard.

var KEYS = [
  ["Drag, arrows", "orbit (with Shift: one degree)"],
  ["Wheel, pinch, + \u2212", "zoom"],
  ["[ ]", "exposure, a quarter of a stop; E: one that suits A"],
  [", .", "roughness"],
  ["1 \u2026 9", "map on side A; with Shift on side B"],
  ["X", "exchange A and B"],
  ["D", "divider, difference, relative difference, blend"],
  ["< >", "move the divider, or blend"],
  ["L", "turn the light, or stop it"],
  ["T", "a view that the truth is known of"],
  ["S", "next shape"],
  ["B", "probe or plain behind"],
  ["P", "save the picture"],
  ["R", "reset"],
  ["?", "this list"],
];

function quoted(text) {
  return /^[\w@%+=:,.\/-]+$/.test(text) ? text : "'" + text.replace(/'/g, "'\\''") + "'";
}

// The command that draws side A as the page shows it. It knows no turned light, no zoom of a sphere, and the page's
// own figure is in no file.
function renderCommand(viewer) {
  var state = viewer.state, scene = viewer.scene;
  var side = state.a.kind === "map" ? state.a : state.b;
  var map = scene.maps[side && side.kind === "map" ? side.number : 0];
  var words = ["shrm", "render", quoted(map.file)];
  // On a sphere turned light is a turned view.
  var azimuth = state.shape === SPHERE_SHAPE ? wrapped(state.view.azimuth - state.light) : state.view.azimuth;
  words.push("--view", azimuth.toFixed(2) + "," + state.view.elevation.toFixed(2));
  if (state.exposure) words.push("--exposure", String(state.exposure));
  if (map.surface) {
    words.push("--roughness", String(Number(state.roughness.toFixed(4))));
    words.push("--f0", state.f0.map(function (x) { return Number(x.toFixed(4)); }).join("/"));
    var isBrushed = map.brushed && state.anisotropy;
    if (isBrushed) words.push("--anisotropy", String(Number(state.anisotropy.toFixed(4))));
    if (map.brushed) words.push("--taps", String(isBrushed ? map.brushed : map.even));
  }
  if (map.lighting && !map.probe && scene.sky) words.push("--probe", quoted(scene.sky.file));
  map.ways.forEach(function (way) {
    var value = clamp(state.values[way.number], way.low, way.high);
    words.push("--vary", quoted(scene.ways[way.number].name + "=" + Number(value.toPrecision(6))));
  });
  var shape = scene.shapes[state.shape];
  if (shape.file) {
    var fov = 2 * Math.atan(Math.tan(radians(MESH_FOV / 2)) / state.view.zoom) * 180 / Math.PI;
    words.push("--mesh", quoted(shape.file), "--fov", String(Number(fov.toFixed(4))));
    words.push("--distance", String(Number((shape.distance * shape.radius).toPrecision(7))));
  }
  if (map.tangents && state.brush) {
    var along = String(state.brush);
    if (shape.file) words.push("--brush", along);
    else if (along !== "uv") words.push("# with tangents along " + along);
  }
  if (state.background === "probe" && scene.sky) words.push("--background", quoted(scene.sky.file));
  if (state.light && state.shape !== SPHERE_SHAPE)
    words.push("# of a map made with --yaw " + Number(state.light.toFixed(2)));
  return words.join(" ");
}

// Where a view is all of the page, keys need no click into it first.
function keyPlace(root) {
  var others = document.body.querySelectorAll(":scope > :not(script, style)").length > 1;
  return root.parentNode === document.body && !others ? document.body : root;
}

function listenToKeys(viewer, controls) {
  keyPlace(viewer.root).addEventListener("keydown", function (event) {
    var field = event.target.closest("input, select");
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    // Fields keep the keys that they have a use for.
    if (field && (field.type === "number" || field.tagName === "SELECT" || /^Arrow|^[+\-<>\d]$/.test(event.key)))
      return;
    if (pressed(viewer, controls, event)) event.preventDefault();
  });
}

// Do what a key means; whether it means anything.
function pressed(viewer, controls, event) {
  var state = viewer.state, scene = viewer.scene, step = event.shiftKey ? 1 : 5;
  var number = /^Digit([1-9])$/.exec(event.code);
  if (number && scene.maps[number[1] - 1]) {
    var side = { kind: "map", number: number[1] - 1 };
    viewer.set(event.shiftKey ? { b: side } : { a: side });
    return true;
  }
  function orbit(azimuth, elevation) {
    viewer.set({ view: turned(state.view, azimuth, elevation) });
  }
  var actions = {
    ArrowLeft: function () { orbit(-step, 0); },
    ArrowRight: function () { orbit(step, 0); },
    ArrowUp: function () { orbit(0, step); },
    ArrowDown: function () { orbit(0, -step); },
    "+": function () { viewer.set({ view: zoomed(state.view, 1.1) }); },
    "=": function () { viewer.set({ view: zoomed(state.view, 1.1) }); },
    "-": function () { viewer.set({ view: zoomed(state.view, 1 / 1.1) }); },
    "[": function () { viewer.set({ exposure: clamp(state.exposure - 0.25, -10, 10) }); },
    "]": function () { viewer.set({ exposure: clamp(state.exposure + 0.25, -10, 10) }); },
    ",": function () { viewer.set({ roughness: clamp(state.roughness - 0.05, 0.05, 1) }); },
    ".": function () { viewer.set({ roughness: clamp(state.roughness + 0.05, 0.05, 1) }); },
    "<": function () { viewer.divide(state.divider - 0.05); },
    ">": function () { viewer.divide(state.divider + 0.05); },
    e: function () { controls.act("expose"); },
    x: function () { if (state.b) viewer.set({ a: state.b, b: state.a }); },
    d: function () { controls.compare((state.mode + 1) % 4); },
    l: function () { viewer.spin(); },
    t: function () { viewer.goToTruth(); },
    s: function () { viewer.set({ shape: (state.shape + 1) % scene.shapes.length }); },
    b: function () {
      if (scene.sky) viewer.set({ background: state.background === "probe" ? "plain" : "probe" });
    },
    p: function () { controls.savePicture(); },
    r: function () { viewer.reset(); },
    "?": function () { controls.toggleHelp(); },
    Escape: function () { viewer.root.querySelector(".help").hidden = true; },
  };
  var key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (!Object.prototype.hasOwnProperty.call(actions, key)) return false;
  actions[key]();
  return true;
}

// ---- mouse and touch ----------------------------------------------------------------------------

var NEAR_DIVIDER = { mouse: 8, pen: 12, touch: 22 }; // pixels of the page

function listenToPointers(viewer, controls) {
  var canvas = viewer.canvas, down = new Map(), drags = "";

  function place(event) {
    var box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }
  function isNearDivider(event) {
    var state = viewer.state;
    if (!state.b || state.mode !== MODE.divider) return false;
    return Math.abs(place(event)[0] - state.divider * canvas.clientWidth) <
      (NEAR_DIVIDER[event.pointerType] || NEAR_DIVIDER.mouse);
  }
  function spread() {
    var points = Array.from(down.values());
    return Math.hypot(points[0][0] - points[1][0], points[0][1] - points[1][1]);
  }

  canvas.addEventListener("pointerdown", function (event) {
    canvas.setPointerCapture(event.pointerId);
    drags = down.size ? "pinch" : isNearDivider(event) ? "divider" : "orbit";
    down.set(event.pointerId, place(event));
    viewer.pointer = place(event);
    controls.read();
  });
  canvas.addEventListener("pointermove", function (event) {
    var now = place(event), before = down.get(event.pointerId), state = viewer.state;
    viewer.pointer = now;
    if (!before) {
      canvas.dataset.over = isNearDivider(event) ? "divider" : "";
      controls.read();
      return;
    }
    if (drags === "divider") {
      viewer.divide(now[0] / canvas.clientWidth);
    } else if (drags === "orbit") {
      // A drag across the sphere turns it by half a turn.
      var degrees = 180 / (SPHERE_FILL * Math.min(canvas.clientWidth, canvas.clientHeight));
      degrees /= Math.max(state.view.zoom, 1);
      viewer.set({ view: turned(state.view, (before[0] - now[0]) * degrees, (now[1] - before[1]) * degrees) });
    } else if (drags === "pinch" && down.size === 2) {
      var apart = spread();
      down.set(event.pointerId, now);
      viewer.set({ view: zoomed(state.view, spread() / Math.max(apart, 1)) });
    }
    down.set(event.pointerId, now);
  });
  ["pointerup", "pointercancel"].forEach(function (name) {
    canvas.addEventListener(name, function (event) {
      down.delete(event.pointerId);
      if (!down.size) drags = "";
    });
  });
  canvas.addEventListener("pointerleave", function (event) {
    if (event.pointerType === "touch") return; // the last value stays to be read
    viewer.pointer = null;
    controls.read();
  });
  canvas.addEventListener("wheel", function (event) {
    event.preventDefault();
    viewer.set({ view: zoomed(viewer.state.view, Math.pow(2, -clamp(event.deltaY, -300, 300) / 400)) });
  }, { passive: false });
}
