// The panel beside the picture: it shows the state, and changes it.

// An element with text; texts of files are never taken for HTML.
function element(name, text, parent) {
  var made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.appendChild(made);
  return made;
}

function sideValue(side) {
  return side ? (side.kind === "truth" ? "truth" : String(side.number)) : "";
}

function sideOf(value) {
  if (value === "") return null;
  return value === "truth" ? { kind: "truth", number: 0 } : { kind: "map", number: Number(value) };
}

function signed(value, digits) {
  return (value > 0 ? "+" : "") + value.toFixed(digits);
}

// A radiance with four digits.
function shortNumber(value) {
  if (value === 0 || !isFinite(value)) return String(value);
  var size = Math.abs(value);
  return size >= 1e5 || size < 1e-4 ? value.toExponential(2) : value.toPrecision(4);
}

function Controls(viewer) {
  var self = this;
  this.viewer = viewer;
  this.root = viewer.root;
  this.form = this.root.querySelector(".panel");
  this.fields = this.form.elements;
  this.fill();
  this.form.addEventListener("submit", function (event) { event.preventDefault(); });
  this.form.addEventListener("input", function (event) { self.changed(event.target); });
  this.root.addEventListener("click", function (event) {
    var button = event.target.closest("[data-do]");
    if (button) self.act(button.dataset.do);
  });
  viewer.listeners.push(function () { self.update(); });
  viewer.onTurned = function () { self.turned(); };
  viewer.onDivided = function () { self.divided(); };
  viewer.onDrawn = function () { self.drawn(); };
  this.update();
}

// ---- what is there to choose from ---------------------------------------------------------------

Controls.prototype.fill = function () {
  var viewer = this.viewer, scene = viewer.scene, fields = this.fields;
  function option(select, value, text) {
    element("option", text, select).value = value;
  }
  this.root.querySelector("h1").textContent = scene.title;
  option(fields.b, "", "\u2013");
  scene.maps.forEach(function (map, number) {
    option(fields.a, String(number), map.name);
    option(fields.b, String(number), map.name);
  });
  if (scene.truths.length) {
    option(fields.a, "truth", "Truth");
    option(fields.b, "truth", "Truth");
  }
  scene.shapes.forEach(function (shape, number) { option(fields.shape, String(number), shape.name); });
  if (scene.sky) option(fields.background, "probe", scene.sky.name);
  option(fields.background, "plain", "Plain");
  scene.metals.forEach(function (metal, number) { option(fields.metal, String(number), metal.name); });
  option(fields.metal, "", "Own colour");
  var brushes = [["null", "Around +Y"], ["[1,0,0]", "X"], ["[0,1,0]", "Y"], ["[0,0,1]", "Z"]];
  if (scene.shapes.some(function (shape) { return shape.tangents !== undefined; }))
    brushes.push(['"uv"', "Texture u"]);
  var first = JSON.stringify(scene.start.brush);
  if (brushes.every(function (each) { return each[0] !== first; }))
    brushes.push([first, scene.start.brush.map(function (x) { return shortNumber(x); }).join(" ")]);
  brushes.forEach(function (each) { option(fields.brush, each[0], each[1]); });
  scene.ways.forEach(this.addWay, this);
  this.root.querySelector('[data-group="ways"]').hidden = !scene.ways.length;
  this.root.querySelector('[data-row="brush"]').hidden = !viewer.hasTangents();
  this.root.querySelector('[data-group="surface"]').hidden = !viewer.needsSurface();
  this.root.querySelector('[data-row="anisotropy"]').hidden = !viewer.canBeBrushed();
  if (scene.maps.length + scene.truths.length < 2)
    this.root.querySelector('[data-group="compare"]').hidden = true;
  var bar = this.root.querySelector(".legend canvas"), pen = bar.getContext("2d");
  for (var y = 0; y < bar.height; y++) {
    pen.fillStyle = hexColor(turbo(1 - y / (bar.height - 1)));
    pen.fillRect(0, y, bar.width, 1);
  }
};

// A slider for a parameter that varies.
Controls.prototype.addWay = function (way, number) {
  var row = element("label", undefined, this.root.querySelector('[data-group="ways"]'));
  row.className = "row";
  element("span", way.name, row).title = way.name;
  var field = element("input", undefined, row);
  Object.assign(field, {
    type: "range", name: "way " + number, min: way.low, max: way.high,
    step: (way.high - way.low) / 200,
  });
  element("output", undefined, row);
};

// ---- from the panel to the state ----------------------------------------------------------------

Controls.prototype.changed = function (field) {
  var viewer = this.viewer, state = viewer.state, value = Number(field.value);
  var view = Object.assign({}, state.view);
  var way = /^way (\d+)$/.exec(field.name);
  if (way) return viewer.set({ values: Object.assign([], state.values, { [way[1]]: value }) });
  switch (field.name) {
    case "a": return viewer.set({ a: sideOf(field.value) });
    case "b": return viewer.set({ b: sideOf(field.value) });
    case "mode": return this.compare(value);
    case "divider": return viewer.divide(value / 100);
    case "scale": return viewer.set({ scale: Math.pow(2, value) });
    case "shape": return viewer.set({ shape: value });
    case "azimuth": view.azimuth = value; return viewer.set({ view: view });
    case "elevation": view.elevation = value; return viewer.set({ view: view });
    case "light": return viewer.turnLight(value);
    case "zoom": view.zoom = Math.pow(2, value); return viewer.set({ view: view });
    case "exposure": return viewer.set({ exposure: value });
    case "background": return viewer.set({ background: field.value });
    case "roughness": return viewer.set({ roughness: value });
    case "anisotropy": return viewer.set({ anisotropy: value });
    case "brush": return viewer.set({ brush: JSON.parse(field.value) });
    case "metal":
      if (field.value !== "") viewer.set({ f0: viewer.scene.metals[value].f0.slice() });
      return undefined;
    case "f0r": case "f0g": case "f0b":
      var f0 = state.f0.slice();
      f0["rgb".indexOf(field.name[2])] = clamp(value || 0, 0, 1);
      return viewer.set({ f0: f0 });
  }
  return undefined;
};

// Show a difference, with a scale that suits it the first time.
Controls.prototype.compare = function (mode) {
  var viewer = this.viewer;
  if (!viewer.state.b) return;
  viewer.set({ mode: mode });
  if (isDifference(mode)) {
    var found = this.measure();
    if (found && found.p99 > 0)
      viewer.set({ scale: Math.pow(2, clamp(Math.ceil(Math.log2(found.p99)), -12, 8)) });
  }
};

Controls.prototype.measure = function () {
  var viewer = this.viewer, both = viewer.resolved();
  if (!both[1] || both[0].missing || both[1].missing) return null;
  return measured(
    viewer.read(MEASURED, 0, true), viewer.read(MEASURED, 1, true), viewer.state.mode
  );
};

Controls.prototype.act = function (what) {
  if (what === "expose") this.viewer.set({ exposure: this.viewer.suitableExposure() });
  else if (what === "spin") this.viewer.spin();
  else if (what === "reset") this.viewer.reset();
  else if (what === "truth-view") this.viewer.goToTruth();
  else if (what === "help") this.toggleHelp();
  else if (what === "picture") this.savePicture();
  else if (what === "command") this.copyCommand();
};

// ---- from the state to the panel ----------------------------------------------------------------

Controls.prototype.update = function () {
  var state = this.viewer.state, fields = this.fields, self = this;
  var differs = state.b !== null && isDifference(state.mode), blends = state.mode === MODE.blend;
  function put(name, value, text) {
    var field = fields[name], output = field.closest(".row").querySelector("output");
    if (document.activeElement !== field || field.type !== "number") field.value = String(value);
    if (output) output.textContent = text;
  }
  function show(selector, is) { self.root.querySelector(selector).hidden = !is; }
  put("a", sideValue(state.a));
  put("b", sideValue(state.b));
  fields.mode.forEach(function (each) {
    each.checked = Number(each.value) === state.mode;
    each.disabled = !state.b;
  });
  this.divided();
  put("scale", Math.log2(state.scale), this.scaleText(state.scale));
  put("shape", state.shape);
  put("azimuth", state.view.azimuth, state.view.azimuth.toFixed(0) + "\u00b0");
  put("elevation", state.view.elevation, state.view.elevation.toFixed(0) + "\u00b0");
  put("zoom", Math.log2(state.view.zoom), state.view.zoom.toFixed(2) + "\u00d7");
  this.turned();
  put("exposure", state.exposure, signed(state.exposure, 2) + " EV");
  put("background", state.background);
  put("roughness", state.roughness, state.roughness.toFixed(2));
  put("anisotropy", state.anisotropy, state.anisotropy.toFixed(2));
  state.values.forEach(function (value, k) {
    put("way " + k, value, String(Number(value.toPrecision(3))));
  });
  put("brush", JSON.stringify(state.brush));
  "rgb".split("").forEach(function (c, k) { put("f0" + c, Number(state.f0[k].toFixed(4))); });
  var metal = this.viewer.scene.metals.findIndex(function (each) {
    return each.f0.every(function (x, k) { return Math.abs(x - state.f0[k]) < 5e-5; });
  });
  put("metal", metal < 0 ? "" : metal);
  show('[data-row="divider"]', state.b !== null && !differs);
  this.root.querySelector('[data-row="divider"] span').textContent = blends ? "Part of B" : "Divider";
  show('[data-row="scale"]', differs);
  show(".legend", differs);
  show(".measure", differs);
  var ticks = this.root.querySelectorAll(".ticks span");
  ticks[0].textContent = this.scaleText(state.scale);
  ticks[1].textContent = this.scaleText(state.scale / 2);
  this.root.querySelector(".tag-a").textContent = (differs ? "|A \u2212 B|: A " : "") + this.viewer.nameOf(state.a);
  this.root.querySelector(".tag-b").textContent = (differs ? "B " : "") + this.viewer.nameOf(state.b);
  this.surfaceNote();
  this.facts();
};

Controls.prototype.turned = function () {
  var light = this.viewer.state.light, field = this.fields.light;
  field.value = String(light);
  field.nextElementSibling.textContent = light.toFixed(0) + "\u00b0";
};

Controls.prototype.divided = function () {
  var share = 100 * this.viewer.state.divider, field = this.fields.divider;
  field.value = String(share);
  field.nextElementSibling.textContent = Math.round(share) + " %";
};

Controls.prototype.scaleText = function (scale) {
  return this.viewer.state.mode === MODE.relative
    ? Number((100 * scale).toPrecision(3)) + " %"
    : String(Number(scale.toPrecision(3)));
};

Controls.prototype.surfaceNote = function () {
  var state = this.viewer.state, maps = this.viewer.scene.maps;
  var note = this.root.querySelector('[data-note="surface"]');
  var outside = [state.a, state.b].filter(function (side) {
    var map = side && side.kind === "map" ? maps[side.number] : null;
    return map && map.surface &&
      (state.roughness < map.roughness[0] - 1e-6 || state.roughness > map.roughness[1] + 1e-6);
  });
  note.hidden = outside.length === 0;
  note.textContent = outside
    .map(function (side) {
      var map = maps[side.number];
      return map.name + " was made for roughness " + map.roughness[0].toPrecision(3) + " to " +
        map.roughness[1].toPrecision(3) + ".";
    })
    .join(" ");
};

Controls.prototype.facts = function () {
  var viewer = this.viewer, scene = viewer.scene, state = viewer.state;
  var place = this.root.querySelector(".facts");
  var lists = [state.a, state.b].filter(Boolean).map(function (side) {
    return side.kind === "truth" ? { name: "Truth", facts: scene.truth_facts } : scene.maps[side.number];
  });
  place.replaceChildren();
  lists.filter(function (each, k) { return lists.indexOf(each) === k; }).forEach(function (each) {
    var box = element("div", undefined, place);
    element("h2", each.name, box);
    var list = element("dl", undefined, box);
    each.facts.forEach(function (fact) {
      element("dt", fact[0], list);
      element("dd", fact[1], list);
    });
  });
  if (!scene.notes.length) return;
  var said = element("div", undefined, place);
  scene.notes.forEach(function (note) { element("p", note, said).className = "note"; });
};

// ---- after each picture -------------------------------------------------------------------------

Controls.prototype.drawn = function () {
  var viewer = this.viewer, self = this;
  var missing = viewer.shown.some(function (each) { return each && each.missing; });
  var place = this.root.querySelector(".missing");
  place.hidden = !missing;
  if (missing) {
    var count = viewer.scene.truths.length;
    place.querySelector("span").textContent = "The truth is known of light that is not turned, on the sphere from " +
      (count === 1 ? "one side" : count + " sides") +
      (viewer.needsSurface() || viewer.scene.ways.length ? ", for one surface." : ".");
  }
  this.read();
  clearTimeout(this.timer);
  this.timer = setTimeout(function () { self.showMeasure(); }, 200);
};

Controls.prototype.showMeasure = function () {
  if (!isDifference(this.viewer.state.mode)) return;
  var found = this.measure(), place = this.root.querySelector(".measure");
  place.textContent = found
    ? "Relative RMSE of A from B in this view: " + (100 * found.relative).toPrecision(3) + " %"
    : "There is nothing to compare with.";
};

// The radiance under the mouse, of both sides.
Controls.prototype.read = function () {
  var viewer = this.viewer, place = this.root.querySelector(".readout"), at = viewer.pointer;
  if (!at || !viewer.shown) {
    place.textContent = "";
    return;
  }
  var first = viewer.sides[0].picture(), unit = first.width / viewer.canvas.clientWidth;
  var x = clamp(Math.floor(at[0] * unit), 0, first.width - 1);
  var y = clamp(first.height - 1 - Math.floor(at[1] * unit), 0, first.height - 1);
  var rows = [];
  viewer.shown.forEach(function (each, k) {
    if (!each || each.missing) return;
    var rgb = pixelOf(viewer.renderer, viewer.sides[k].picture(), x, y).rgb;
    var text = rgb.map(function (v) { return shortNumber(v).padStart(9); }).join(" ");
    rows.push("AB"[k] + text + "   Y" + shortNumber(luminance(rgb)).padStart(9));
  });
  place.textContent = rows.join("\n");
};

// ---- actions ------------------------------------------------------------------------------------

Controls.prototype.say = function (text) {
  this.root.querySelector('[data-note="said"]').textContent = text;
};

Controls.prototype.toggleHelp = function () {
  var place = this.root.querySelector(".help");
  if (!place.firstChild) {
    element("h2", "Keys and mouse", place);
    var list = element("dl", undefined, place);
    KEYS.forEach(function (each) {
      element("dt", each[0], list);
      element("dd", each[1], list);
    });
  }
  place.hidden = !place.hidden;
};

Controls.prototype.savePicture = function () {
  var viewer = this.viewer, self = this;
  viewer.show();
  viewer.canvas.toBlob(function (blob) {
    var link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = viewer.scene.file + ".png";
    link.click();
    setTimeout(function () { URL.revokeObjectURL(link.href); }, 1000);
    self.say("Saved " + link.download + ".");
  });
};

// The command that draws the same picture: `shrm render`, with the maps by their names.
Controls.prototype.copyCommand = function () {
  var text = renderCommand(this.viewer), self = this;
  var done = function () { self.say("Copied: " + text); };
  var failed = function () { self.say(text); };
  if (!navigator.clipboard) return failed();
  return navigator.clipboard.writeText(text).then(done, failed);
};
