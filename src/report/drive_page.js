// SPDX-License-Identifier: Apache-2.0
// Plays a drive: a map as people know them, timelines, histograms. Needs the JSON in #data; no
// network, no library. Lengths are metres, angles radians, times seconds.
(function () {
  "use strict";

  var data = JSON.parse(document.getElementById("data").textContent);
  var drive = data.drive, world = data.world, frames = drive.frames, pictures = data.pictures;
  var trace = world.trace, step = world.trace_step_s, duration = Math.max(drive.time_s, step);
  var CHI2_95 = 5.991;    // 95 % quantile of chi-square, two degrees of freedom
  var LIGHT = 0.299792458;  // m/ns
  var SHARED = ["path", "vehicle", "field", "field-edge", "goal", "measured", "object", "found",
                "rival", "truth", "occupied", "relay", "ink", "soft", "faint"];

  // Colours by meaning, the same on all pages (theme.css); a canvas needs their values.
  var COLOUR, dark = window.matchMedia("(prefers-color-scheme: dark)");
  function readColours() {
    var style = window.getComputedStyle(document.documentElement);
    COLOUR = dark.matches
      ? { land: "#20262b", road: "#2c343b", building: "#4a4d4f", buildingEdge: "#63676a",
          glass: "#1b2025", halo: "#14181c", unseen: "rgba(160,175,190,.13)" }
      : { land: "#eef0ee", road: "#ffffff", building: "#d9d5cd", buildingEdge: "#bdb6a8",
          glass: "#d2e3fc", halo: "#ffffff", unseen: "rgba(90,105,120,.13)" };
    SHARED.forEach(function (name) {
      COLOUR[name] = style.getPropertyValue("--" + name).trim();
    });
  }

  // ---------------------------------------------------------------- page

  function element(parent, tag, className, text) {
    var node = document.createElement(tag);
    if (className) node.className = className;
    if (text !== undefined) node.textContent = text;
    parent.appendChild(node);
    return node;
  }
  function drawn(parent, tag, attributes, text) {
    var node = document.createElementNS("http://www.w3.org/2000/svg", tag);
    Object.keys(attributes).forEach(function (key) { node.setAttribute(key, attributes[key]); });
    if (text !== undefined) node.textContent = text;
    parent.appendChild(node);
    return node;
  }
  var page = document.getElementById("page");
  var title = element(page, "h1", "", drive.drive.replace(/_/g, " "));
  element(title, "span", "outcome " + drive.outcome, drive.outcome);
  element(title, "small", "", "perception: " + drive.perception + " · seed " + drive.seed);
  element(page, "p", "headline", drive.headline);
  var columns = element(page, "div", "columns");
  var mapCard = element(columns, "div", "card map");
  var map = element(mapCard, "canvas");
  var bar = element(mapCard, "div", "bar");
  var play = element(bar, "button", "play", "Play");
  var slider = element(bar, "input");
  slider.type = "range"; slider.min = 0; slider.max = duration; slider.step = step;
  slider.setAttribute("aria-label", "time");
  var clock = element(bar, "span", "clock");
  var speed = element(bar, "select");
  speed.setAttribute("aria-label", "speed of the replay");
  [0.25, 0.5, 1, 2].forEach(function (r) {
    var option = element(speed, "option", "", r + "×");
    option.value = r; option.selected = r === 1;
  });
  var moments = element(mapCard, "div", "moments");
  var timelines = element(mapCard, "div", "timelines");
    var side = element(columns, "div", "card side");
  element(side, "h2", "", "Now");
  var facts = element(side, "dl");
  var heading = element(side, "h2", "plots");
  var plots = element(side, "canvas");
  var plotLegend = element(side, "div", "legend");
  element(side, "h2", "", "Map");
  var mapLegend = element(side, "div", "legend");
  element(side, "div", "keys", "Space plays and pauses, arrows go from frame to frame, Home and " +
    "End to begin and end; a click into a timeline goes there.");

  // One entry: the mark as it is drawn, and what it means.
  function explain(legend, shape, colour, words) {
    var item = element(legend, "span");
    var svg = drawn(item, "svg", { width: 22, height: 12, "aria-hidden": true });
    var ink = "var(--" + colour + ")";
    var line = { x1: 1, x2: 21, y1: 6, y2: 6, stroke: ink, "stroke-width": 3 };
    var box = { x: 4, y: 1.5, width: 14, height: 9, rx: 1, stroke: ink, "stroke-width": 2 };
    if (shape === "line") drawn(svg, "line", line);
    if (shape === "dashes") {
      line["stroke-width"] = 1.5; line["stroke-dasharray"] = "4 3";
      drawn(svg, "line", line);
    }
    if (shape === "outline") { box.fill = "none"; drawn(svg, "rect", box); }
    if (shape === "fill") {
      box.fill = ink; box.stroke = "var(--edge)"; box["stroke-width"] = 0.7;
      drawn(svg, "rect", box);
    }
    if (shape === "tick") drawn(svg, "path", { d: "M11 2l4 8h-8z", fill: ink });
    if (shape === "mode") {
      drawn(svg, "rect", { x: 7, y: 3, width: 8, height: 6, fill: ink, "fill-opacity": 0.35,
                           stroke: ink, "stroke-width": 2 });
      drawn(svg, "ellipse", { cx: 11, cy: 6, rx: 10, ry: 5.3, fill: "none", stroke: ink,
                              "stroke-dasharray": "3 2" });
    }
    element(item, "span", "", words);
  }
  function drawLegends() {
    var several = pictures.some(function (picture) { return picture.now.length > 1; });
    var move = pictures.some(function (picture) { return picture.later.length > 0; });
    [["fill", "vehicle", "the vehicle, and its way"], ["line", "path", "its plan"],
     ["line", "goal", "goal"], ["line", "relay", "walls"], ["fill", "field", "field of view"],
     ["outline", "truth", "the hidden object, truly"],
     ["mode", "found", "where it is taken to be: footprint, 95 % ellipse" +
       (move ? "; arrow and dots: in half a second" : "")],
     several && ["mode", "rival", "other explanations"],
     ["fill", "occupied", "cells taken for occupied, stronger where surer"]
    ].forEach(function (entry) {
      if (entry) explain(mapLegend, entry[0], entry[1], entry[2]);
    });
    if (!bins) return;
    explain(plotLegend, "line", "measured", "counts of the sensor");
    explain(plotLegend, "fill", "object", "expected of the hidden object, on its own scale");
  }

  // ---------------------------------------------------------------- drive

  function frameAt(time) {
    var i = 0;
    while (i + 1 < frames.length && frames[i + 1].time_s <= time + 1e-9) ++i;
    return i;
  }
  function vehicleAt(time) {
    var first = [frames[0].x_m, frames[0].y_m, frames[0].yaw_rad];
    if (!trace.length) return first;
    var at = time / step - 1, i = Math.floor(at);
    var a = i < 0 ? first : trace[Math.min(i, trace.length - 1)];
    var b = trace[Math.max(0, Math.min(i + 1, trace.length - 1))], s = at - i;
    return [0, 1, 2].map(function (k) { return a[k] + (b[k] - a[k]) * s; });
  }
  // Place of one object in a pose vector.
  function placed(pose, object) {
    var rest = world.objects[object].known;
    var at = { x_m: rest.x_m, y_m: rest.y_m, yaw_rad: rest.yaw_rad, size: rest.size };
    world.unknowns.forEach(function (u, i) {
      if (u.object === object && pose[i] !== null) at[u.component] = pose[i];
    });
    return at;
  }
  function holds(mode, object) {
    var first = world.unknowns.findIndex(function (u) { return u.object === object; });
    return first < 0 || mode.pose[first] !== null;
  }
  function outlineAt(object, at) {
    var c = Math.cos(at.yaw_rad) * at.size, s = Math.sin(at.yaw_rad) * at.size;
    return world.objects[object].outline.map(function (p) {
      return [at.x_m + c * p[0] - s * p[1], at.y_m + s * p[0] + c * p[1]];
    });
  }
  // Variances of x, and of both, and of y.
  function covariance(mode, object) {
    var ix = -1, iy = -1;
    world.unknowns.forEach(function (u, i) {
      if (u.object !== object) return;
      if (u.component === "x_m") ix = i;
      if (u.component === "y_m") iy = i;
    });
    function c(a, b) { return a >= 0 && b >= 0 ? mode.covariance[a][b] || 0 : 0; }
    return [c(ix, ix), c(ix, iy), c(iy, iy)];
  }
  // Of the heaviest mode as of the frame's time: distance from the truth, and two standard
  // deviations of it; null: there is nothing to compare.
  function errorOf(i, object) {
    var truth = frames[i].truth, mode = pictures[i].now[0];
    if (!truth || !mode || !holds(mode, object)) return null;
    var a = placed(truth, object), b = placed(mode.pose, object), v = covariance(mode, object);
    return { error: Math.hypot(a.x_m - b.x_m, a.y_m - b.y_m), band: 2 * Math.sqrt(v[0] + v[2]) };
  }
  function known(value) { return typeof value === "number" && isFinite(value); }
  function first(condition) {
    var i = frames.findIndex(condition);
    return i < 0 ? null : frames[i];
  }
  function isBraking(frame) { return frame.braking_for && !/curve/.test(frame.braking_for); }

  var HIDDEN = world.objects.length === 1 ? world.objects[0].name : "hidden objects";

  // Where to look; `matters`: the one of them that explains the drive.
  function findMoments() {
    var WORDS = { reached: "goal", stopped: "stands", timeout: "time over" };
    var sight = first(function (frame) { return frame.frame === "in_sight"; });
    var sure = drive.sure_from_s;
    var brakes = first(isBraking);
    var nearest = frames.reduce(function (best, frame) {
      return frame.clearance_m !== null && frame.clearance_m < best.clearance_m ? frame : best;
    });
    var hidden = !sight ? function () { return true; }
      : function (frame) { return frame.time_s < sight.time_s; };
    var list = [];
    if (sure !== null) list.push({ time: sure, words: "sure of the " + HIDDEN });
    if (sight) list.push({ time: sight.time_s, words: "direct sight" });
    if (brakes) list.push({ time: brakes.time_s, words: "brakes for " + brakes.braking_for });
    if (nearest.clearance_m !== null && drive.outcome !== "collision") {
      var metres = nearest.clearance_m.toFixed(2);
      list.push({ time: nearest.time_s, words: "nearest, " + metres + " m" });
    }
    list.sort(function (a, b) { return a.time - b.time; });
    list.push({ time: duration, words: WORDS[drive.outcome] || drive.outcome });
    list.matters = drive.outcome !== "reached" ? duration
      : brakes && hidden(brakes) ? brakes.time_s
      : sure !== null ? sure : nearest.time_s;
    return list;
  }

  // ---------------------------------------------------------------- map

  var g = world.map, ratio = window.devicePixelRatio || 1;
  // What is drawn into at present, and how: pixels per metre, and where the origin is.
  var view = { canvas: map, scale: 1, x: 0, y: 0 };
  function wholeMap() {
    var scale = Math.min(map.width / (g.columns * g.cell_m), map.height / (g.rows * g.cell_m));
    return { canvas: map, scale: scale,
             x: (map.width - g.columns * g.cell_m * scale) / 2 - g.origin_m[0] * scale,
             y: (map.height + g.rows * g.cell_m * scale) / 2 + g.origin_m[1] * scale };
  }
  // The vehicle, and the nearest hidden object where that is not far.
  function closeUp(i) {
    var at = vehicleAt(now), length = world.vehicle.length_m;
    var far = 6 * length, middle = at, reach = 0;
    world.objects.forEach(function (unused, object) {
      if (!frames[i].truth) return;
      var other = placed(frames[i].truth, object);
      var d = Math.hypot(other.x_m - at[0], other.y_m - at[1]);
      if (d >= far) return;
      far = reach = d;
      middle = [(at[0] + other.x_m) / 2, (at[1] + other.y_m) / 2];
    });
    var scale = Math.min(plots.width, plots.height) / (reach + 2.5 * length);
    return { canvas: plots, scale: scale, x: plots.width / 2 - middle[0] * scale,
             y: plots.height / 2 + middle[1] * scale };
  }
  function X(x) { return view.x + x * view.scale; }
  function Y(y) { return view.y - y * view.scale; }
  function trail(ctx, points, close) {
    ctx.beginPath();
    points.forEach(function (p, i) {
      if (i) ctx.lineTo(X(p[0]), Y(p[1])); else ctx.moveTo(X(p[0]), Y(p[1]));
    });
    if (close) ctx.closePath();
  }
  function stroke(ctx, colour, width) {
    ctx.strokeStyle = colour; ctx.lineWidth = width * ratio; ctx.stroke();
  }
  function fill(ctx, colour, alpha) {
    ctx.save(); ctx.globalAlpha *= alpha; ctx.fillStyle = colour; ctx.fill(); ctx.restore();
  }
  function drawGround(ctx) {
    ctx.fillStyle = COLOUR.land; ctx.fillRect(0, 0, view.canvas.width, view.canvas.height);
    world.surfaces.forEach(function (s) {
      if (s.body || s.outline.length < 3) return;
      trail(ctx, s.outline, true); fill(ctx, COLOUR.road, 1);
    });
  }
  function drawBuildings(ctx) {
    ctx.lineCap = "round";
    world.surfaces.forEach(function (s) {
      trail(ctx, s.outline, s.body);
      if (s.body) { fill(ctx, COLOUR.building, 1); stroke(ctx, COLOUR.buildingEdge, 1.5); }
      else if (s.outline.length === 2) stroke(ctx, COLOUR.relay, 5);
    });
  }
  var gridImage = document.createElement("canvas"), gridFrame = -1;
  gridImage.width = g.columns; gridImage.height = g.rows;
  // Cells as runs of a letter and a count: "a" to "p" by probability, "-" for what is unknown.
  function prepareGrid(i) {
    if (i === gridFrame) return;
    gridFrame = i;
    var ctx = gridImage.getContext("2d"), pattern = /([a-p-])(\d*)/g, cell = 0, run;
    ctx.clearRect(0, 0, g.columns, g.rows);
    while ((run = pattern.exec(pictures[i].grid))) {
      var level = run[1] === "-" ? -1 : run[1].charCodeAt(0) - 97;
      ctx.globalAlpha = level < 0 ? 1 : Math.min(0.8, 0.12 + 0.05 * level);
      ctx.fillStyle = level < 0 ? COLOUR.unseen : COLOUR.occupied;
      for (var count = run[2] ? +run[2] : 1; count > 0;) {
        var column = cell % g.columns, length = Math.min(count, g.columns - column);
        if (level) ctx.fillRect(column, g.rows - 1 - Math.floor(cell / g.columns), length, 1);
        cell += length; count -= length;
      }
    }
  }
  function drawGrid(ctx, i) {
    if (!pictures[i].grid) return;
    prepareGrid(i);
    ctx.imageSmoothingEnabled = false;
    ctx.drawImage(gridImage, X(g.origin_m[0]), Y(g.origin_m[1] + g.rows * g.cell_m),
      g.columns * g.cell_m * view.scale, g.rows * g.cell_m * view.scale);
  }
  function drawEllipse(ctx, mode, object, dash) {
    var at = placed(mode.pose, object), v = covariance(mode, object);
    var half = Math.hypot((v[0] - v[2]) / 2, v[1]), mean = (v[0] + v[2]) / 2;
    ctx.save();
    ctx.translate(X(at.x_m), Y(at.y_m));
    ctx.rotate(-Math.atan2(2 * v[1], v[0] - v[2]) / 2);
    ctx.beginPath();
    ctx.ellipse(0, 0, Math.sqrt(CHI2_95 * Math.max(mean + half, 0)) * view.scale,
      Math.sqrt(CHI2_95 * Math.max(mean - half, 0)) * view.scale, 0, 0, 2 * Math.PI);
    ctx.setLineDash(dash.map(function (d) { return d * ratio; })); ctx.stroke();
    ctx.restore();
  }
  // From where an object is to where it is half a second later, with the ellipse there.
  function drawMotion(ctx, mode, later, object) {
    var a = placed(mode.pose, object), b = placed(later.pose, object), head = 9 * ratio;
    var x = X(b.x_m), y = Y(b.y_m), dx = x - X(a.x_m), dy = y - Y(a.y_m);
    var length = Math.hypot(dx, dy);
    ctx.lineWidth = 1.5 * ratio;
    drawEllipse(ctx, later, object, [1.5, 4]);
    if (length < head) return;
    dx *= head / length; dy *= head / length;
    ctx.beginPath(); ctx.moveTo(X(a.x_m), Y(a.y_m)); ctx.lineTo(x - dx, y - dy);
    stroke(ctx, ctx.strokeStyle, 3);
    ctx.beginPath(); ctx.moveTo(x, y);
    ctx.lineTo(x - dx - 0.5 * dy, y - dy + 0.5 * dx);
    ctx.lineTo(x - dx + 0.5 * dy, y - dy - 0.5 * dx);
    ctx.closePath(); fill(ctx, ctx.strokeStyle, 1);
  }
  // Moved on from the capture to the time of the frame; the heaviest lies on top.
  function drawModes(ctx, i) {
    var modes = pictures[i].now, later = pictures[i].later;
    for (var k = modes.length - 1; k >= 0; --k) {
      world.objects.forEach(function (unused, object) {
        if (!holds(modes[k], object)) return;
        var colour = k ? COLOUR.rival : COLOUR.found;
        ctx.save();
        ctx.globalAlpha = (0.25 + 0.75 * modes[k].weight) *
          Math.max(frames[i].presence_probability, 0.15);
        trail(ctx, outlineAt(object, placed(modes[k].pose, object)), true);
        fill(ctx, colour, 0.35); stroke(ctx, colour, 2);
        drawEllipse(ctx, modes[k], object, [6, 4]);
        if (later[k]) drawMotion(ctx, modes[k], later[k], object);
        ctx.restore();
      });
    }
  }
  function drawTruth(ctx, frame) {
    if (!frame.truth) return;
    world.objects.forEach(function (object, k) {
      var at = placed(frame.truth, k);
      trail(ctx, outlineAt(k, at), true); stroke(ctx, COLOUR.truth, 2.5);
      if (world.objects.length === 1) return;
      ctx.font = 12 * ratio + "px sans-serif"; ctx.textAlign = "left"; ctx.fillStyle = COLOUR.truth;
      ctx.fillText(object.name, X(at.x_m) + 12 * ratio, Y(at.y_m) - 8 * ratio);
    });
  }
  function drawField(ctx, i) {
    var field = pictures[i].field;
    if (!field || field.length < 3) return;
    trail(ctx, field, true); fill(ctx, COLOUR.field, 0.16); stroke(ctx, COLOUR["field-edge"], 1);
  }
  function roundRect(ctx, x, y, w, h, r) {
    ctx.beginPath();
    ctx.moveTo(x + r, y);
    ctx.arcTo(x + w, y, x + w, y + h, r); ctx.arcTo(x + w, y + h, x, y + h, r);
    ctx.arcTo(x, y + h, x, y, r); ctx.arcTo(x, y, x + w, y, r);
    ctx.closePath();
  }
  // Points in pixels.
  function line(ctx, points) {
    ctx.beginPath();
    points.forEach(function (p) { ctx.lineTo(p[0], p[1]); });
  }
  // Lengths along it are in its own, across it in its width.
  function drawVehicle(ctx, at, frame) {
    var l = world.vehicle.length_m * view.scale, w = world.vehicle.width_m * view.scale;
    var isCar = world.vehicle.kind === "car";
    function part(x, y, length, width, colour) {
      ctx.fillStyle = colour; ctx.fillRect(x * l, y * w, length * l, width * w);
    }
    ctx.save();
    ctx.translate(X(at[0]), Y(at[1])); ctx.rotate(-at[2]);
    ctx.shadowColor = "rgba(0,0,0,.35)"; ctx.shadowBlur = 6 * ratio;
    if (isCar) {
      [[0.31, 1], [0.31, -1], [-0.31, 1], [-0.31, -1]].forEach(function (p) {
        ctx.save(); ctx.translate(p[0] * l, p[1] * w * 0.44);
        if (p[0] > 0) ctx.rotate(-(frame.steering_rad || 0));
        part(-0.07, -0.08, 0.14, 0.16, "#2b2f33"); ctx.restore();
      });
    } else {
      part(-0.2, -0.55, 0.4, 0.16, "#2b2f33"); part(-0.2, 0.39, 0.4, 0.16, "#2b2f33");
    }
    roundRect(ctx, -l / 2, -w / 2, l, w, 0.28 * w); fill(ctx, COLOUR.vehicle, 1);
    ctx.shadowBlur = 0;
    line(ctx, isCar
      ? [[0.2 * l, -0.4 * w], [0.06 * l, -0.33 * w], [0.06 * l, 0.33 * w], [0.2 * l, 0.4 * w]]
      : [[0.38 * l, 0], [0.05 * l, -0.26 * w], [0.05 * l, 0.26 * w]]);
    fill(ctx, COLOUR.glass, 1);
    if (isCar) {
      roundRect(ctx, -0.4 * l, -0.33 * w, 0.1 * l, 0.66 * w, 0.08 * w); fill(ctx, COLOUR.glass, 1);
      part(0.46, -0.42, 0.03, 0.2, "#fff8e1"); part(0.46, 0.22, 0.03, 0.2, "#fff8e1");
    }
    ctx.restore();
  }
  function drawGoal(ctx) {
    var line = world.finish_line_m, goal = line
      ? [(line[0][0] + line[1][0]) / 2, (line[0][1] + line[1][1]) / 2]
      : world.route_m[world.route_m.length - 1];
    var x = X(goal[0]), y = Y(goal[1]), r = 9 * ratio;
    if (line) { trail(ctx, line, false); stroke(ctx, COLOUR.goal, 4); }
    else {
      ctx.beginPath(); ctx.arc(x, y, world.goal_tolerance_m * view.scale, 0, 2 * Math.PI);
      fill(ctx, COLOUR.goal, 0.2);
    }
    ctx.beginPath(); ctx.arc(x, y - 2.1 * r, r, Math.PI * 0.86, Math.PI * 0.14); ctx.lineTo(x, y);
    ctx.closePath(); fill(ctx, COLOUR.goal, 1);
    ctx.beginPath(); ctx.arc(x, y - 2.1 * r, 0.38 * r, 0, 2 * Math.PI); fill(ctx, "#fff", 1);
  }
  function drawScale(ctx) {
    var most = view.canvas.width / view.scale / 4;
    var length = Math.pow(10, Math.floor(Math.log(most) / Math.LN10));
    length *= most >= 5 * length ? 5 : most >= 2 * length ? 2 : 1;
    var x = view.canvas.width - 16 * ratio - length * view.scale, tall = 5 * ratio;
    var y = view.canvas.height - 16 * ratio, end = x + length * view.scale;
    line(ctx, [[x, y - tall], [x, y], [end, y], [end, y - tall]]);
    ctx.lineCap = "butt"; stroke(ctx, COLOUR.ink, 2);
    ctx.fillStyle = COLOUR.ink; ctx.font = 12 * ratio + "px sans-serif"; ctx.textAlign = "center";
    ctx.fillText(length + " m", (x + end) / 2, y - tall);
  }
  function drawMap(i, as) {
    view = as;
    var ctx = view.canvas.getContext("2d"), frame = frames[i];
    ctx.lineJoin = "round";
    drawGround(ctx);
    drawGrid(ctx, i);
    drawField(ctx, i);
    drawBuildings(ctx);
    trail(ctx, trace.slice(0, Math.max(0, Math.round(now / step))), false);
    stroke(ctx, COLOUR.vehicle, 4);
    trail(ctx, frame.plan.path_m, false);
    stroke(ctx, COLOUR.halo, 7); stroke(ctx, COLOUR.path, 4.5);
    drawGoal(ctx);
    drawModes(ctx, i);
    drawTruth(ctx, frame);
    drawVehicle(ctx, vehicleAt(now), frame);
    drawScale(ctx);
  }

  // ---------------------------------------------------------------- histograms

  var DECADES = 3;  // of the object's light that are shown, below its largest counts

  // Bins in which something happens in any frame, and the most light from the object; null: no
  // frame has histograms.
  var bins = (function () {
    var from = Infinity, to = 0, object = 0, length = 0;
    function widen(histograms, floorOf) {
      histograms.forEach(function (counts) {
        var floor = floorOf(counts);
        length = counts.length;
        counts.forEach(function (count, k) {
          if (count <= floor) return;
          from = Math.min(from, k); to = Math.max(to, k + 1);
        });
      });
    }
    pictures.forEach(function (picture) {
      picture.object.forEach(function (counts) {
        object = Math.max(object, Math.max.apply(null, counts));
      });
    });
    pictures.forEach(function (picture) {
      widen(picture.measured, function (counts) {
        return 1.5 * Math.max(1, Math.min.apply(null, counts));
      });
      widen(picture.object, function () { return object / Math.pow(10, DECADES); });
    });
    if (!length) return null;
    return from < to ? { from: Math.max(0, from - 3), to: Math.min(length, to + 3), object: object }
      : { from: 0, to: length, object: object };
  })();
  function said(count) {
    return count >= 1e6 ? (count / 1e6).toPrecision(2) + " million"
      : count >= 1e4 ? (count / 1e3).toFixed(0) + " thousand"
      : count >= 10 ? count.toFixed(0) : String(+count.toPrecision(2));
  }
  // The frame whose histograms are shown at frame i: the last one before where none arrived; -1:
  // they are not looked at.
  function histogramFrame(i) {
    while (i > 0 && !pictures[i].measured.length && /missing|busy/.test(frames[i].frame)) --i;
    return pictures[i].measured.length ? i : -1;
  }
  function drawHistograms(i) {
    var ctx = plots.getContext("2d"), picture = pictures[i], count = picture.measured.length;
    var wide = Math.ceil(Math.sqrt(count)), w = plots.width / wide;
    var h = plots.height / Math.ceil(count / wide), n = bins.to - bins.from;
    var top = 1, floor = Infinity;
    picture.measured.forEach(function (all) {
      all.slice(bins.from, bins.to).forEach(function (v) {
        top = Math.max(top, v); if (v > 0) floor = Math.min(floor, v);
      });
    });
    floor = Math.min(Math.max(0.5, 0.9 * floor), top / 2);
    var ns = world.bin_width_ns;
    heading.textContent = "Histograms ";
    element(heading, "small", "", "of the zones with most light from the object; " +
      (bins.from * ns).toFixed(0) + " to " + (bins.to * ns).toFixed(0) + " ns (" +
      (bins.from * ns * LIGHT).toFixed(0) + " to " + (bins.to * ns * LIGHT).toFixed(0) +
      " m of path), counts from " + said(floor) + " to " + said(top) + ", logarithmic" +
      (bins.object ? "; the object's from " + said(bins.object / Math.pow(10, DECADES)) + " to " +
                     said(bins.object) : ""));
    ctx.clearRect(0, 0, plots.width, plots.height);
    ctx.font = 10.5 * ratio + "px sans-serif"; ctx.textAlign = "left";
    picture.measured.forEach(function (counts, z) {
      var x = z % wide * w + 3 * ratio, bottom = (Math.floor(z / wide) + 1) * h - 3 * ratio;
      var width = w - 6 * ratio, tall = h - 18 * ratio;
      function curve(values, height) {
        ctx.beginPath();
        values.slice(bins.from, bins.to).forEach(function (v, k) {
          var y = bottom - tall * Math.max(0, Math.min(1, height(v)));
          ctx.lineTo(x + k * width / n, y); ctx.lineTo(x + (k + 1) * width / n, y);
        });
      }
      ctx.fillStyle = COLOUR.soft;
      ctx.fillText("zone " + data.zones[z], x, bottom - tall - 3 * ratio);
      ctx.strokeStyle = COLOUR.faint; ctx.lineWidth = ratio;
      ctx.strokeRect(x, bottom - tall, width, tall);
      curve(picture.object[z], function (v) {
        return v > 0 ? 1 + Math.log(v / bins.object) / Math.LN10 / DECADES : 0;
      });
      ctx.lineTo(x + width, bottom); ctx.lineTo(x, bottom); fill(ctx, COLOUR.object, 0.6);
      curve(counts, function (v) {
        return v > 0 ? Math.log(v / floor) / Math.log(top / floor) : 0;
      });
      stroke(ctx, COLOUR.measured, 1.1);
    });
  }
  // Histograms, or what is near where direct sight says more than they do.
  function drawPlots(i, again) {
    var from = histogramFrame(i);
    if (again) plotLegend.style.visibility = from < 0 ? "hidden" : "";
    if (from >= 0) {
      if (again) drawHistograms(from);
      return;
    }
    if (again) {
      heading.textContent = "Close-up ";
      element(heading, "small", "", "histograms are not looked at: direct sight says more");
    }
    drawMap(i, closeUp(i));
  }

  // ---------------------------------------------------------------- timelines

  // One strip each: what it is called, its unit, its lines as functions of a frame's number, and
  // for the error what it should stay below.
  var single = world.objects.length === 1;
  var STRIPS = [
    { name: "speed", unit: "m/s", colour: "vehicle", digits: 2,
      lines: [function (i) { return frames[i].speed_m_per_s; }],
      dashed: function (i) { return frames[i].target_speed_m_per_s; } },
    { name: "clearance", unit: "m", colour: "vehicle", digits: 2,
      lines: [function (i) { return frames[i].clearance_m; }] },
    { name: "probability that the " + HIDDEN + (single ? " is" : " are") + " there", unit: "",
      colour: "found", digits: 3, top: 1,
      lines: [function (i) { return frames[i].presence_probability; }] },
    { name: "error of the place" + (single ? "" : "s"), unit: "m", colour: "found", digits: 2,
      logarithmic: true,
      lines: world.objects.map(function (unused, object) {
        return function (i) { var e = errorOf(i, object); return e && e.error; };
      }),
      band: function (i) { var e = errorOf(i, 0); return e && e.band; } }
  ];
  var LEFT = 44, RIGHT = 10, TOP = 18, STRIP = 76, TITLE = 20;
  var cursor, readings = [], width = 0;
  function timeX(time) { return LEFT + (width - LEFT - RIGHT) * time / duration; }

  // Stretches of frames that meet a condition, as begin and end.
  function spans(condition) {
    var list = [];
    frames.forEach(function (frame, i) {
      if (!condition(frame)) return;
      var end = i + 1 < frames.length ? frames[i + 1].time_s : duration;
      var latest = list[list.length - 1];
      if (latest && latest[1] >= frame.time_s - 1e-9) latest[1] = end;
      else list.push([frame.time_s, end]);
    });
    return list;
  }
  function valuesOf(of) { return of ? frames.map(function (unused, i) { return of(i); }) : []; }

  function drawStrip(svg, strip, y) {
    var bottom = y + STRIP - 6, top = y + TITLE;
    var all = strip.lines.concat([strip.band, strip.dashed]).map(valuesOf)
      .reduce(function (a, b) { return a.concat(b); }).filter(known);
    var most = strip.top || Math.max.apply(null, all.concat(0.01)) * 1.05;
    var least = strip.logarithmic ? Math.max(most / 1000, 0.001) : 0;
    function at(value) {
      var share = strip.logarithmic
        ? Math.log(Math.max(value, least) / least) / Math.log(most / least) : value / most;
      return (bottom - (bottom - top) * Math.max(0, Math.min(1, share))).toFixed(1);
    }
    // A line breaks where nothing is known.
    function path(values, toBottom) {
      var d = "", open = null;
      values.concat(null).forEach(function (value, i) {
        if (known(value)) {
          var x = timeX(frames[i].time_s).toFixed(1);
          if (!open) d += "M" + x + " " + (toBottom ? bottom : at(value));
          d += "L" + x + " " + at(value);
          open = x;
        } else if (open) {
          if (toBottom) d += "L" + open + " " + bottom + "Z";
          open = null;
        }
      });
      return d;
    }
    var ink = "var(--" + strip.colour + ")";
    var scale = drawn(svg, "g", { "class": "axis" });
    var ticks = strip.logarithmic
      ? [0.001, 0.01, 0.1, 1, 10, 100].filter(function (t) { return t >= least && t <= most; })
      : [0, strip.top || +(most / 1.05).toPrecision(2)];
    ticks.forEach(function (tick) {
      drawn(scale, "line", { x1: LEFT, x2: width - RIGHT, y1: at(tick), y2: at(tick) });
      drawn(scale, "text", { x: LEFT - 5, y: +at(tick) + 4, "text-anchor": "end" }, tick);
    });
    if (strip.band) {
      drawn(svg, "path", { d: path(valuesOf(strip.band), true), fill: ink, "fill-opacity": 0.18 });
    }
    if (strip.dashed) {
      drawn(svg, "path", { d: path(valuesOf(strip.dashed)), "class": "line",
                           stroke: "var(--path)", "stroke-dasharray": "4 3" });
    }
    strip.lines.forEach(function (line, k) {
      drawn(svg, "path", { d: path(valuesOf(line)), "class": "line strong", stroke: ink,
                           "stroke-dasharray": k ? "7 2" : "none" });
    });
    drawn(svg, "text", { x: LEFT, y: y + 11 }, strip.name + (strip.unit ? ", " + strip.unit : ""));
    readings.push(drawn(svg, "text", { x: width - RIGHT, y: y + 11, "text-anchor": "end",
                                       "class": "reading" }));
  }
  function drawTimelines() {
    width = Math.max(280, timelines.clientWidth);
    var bottom = TOP + STRIPS.length * STRIP, height = bottom + 30;
    timelines.textContent = ""; readings = [];
    var svg = drawn(timelines, "svg", { width: width, height: height, role: "img",
      "aria-label": "speed, clearance, presence and error over time" });
    function span(times, y, tall, colour, name) {
      var box = drawn(svg, "rect", { x: timeX(times[0]), y: y, height: tall, "class": name,
        width: Math.max(1, timeX(times[1]) - timeX(times[0])), fill: "var(--" + colour + ")" });
      drawn(box, "title", {}, name + " from " + times[0].toFixed(1) + " s to " +
        times[1].toFixed(1) + " s");
    }
    spans(function (frame) { return frame.frame === "in_sight"; }).forEach(function (times, k) {
      span(times, TOP - 14, bottom - TOP + 8, "shade", "direct sight");
      if (k) return;
      drawn(svg, "text", { x: timeX(times[0]) + 4, y: TOP - 3, "class": "soft" }, "direct sight");
    });
    STRIPS.forEach(function (strip, k) { drawStrip(svg, strip, TOP + k * STRIP); });
    spans(isBraking).forEach(function (times) {
      span(times, TOP + STRIP - 9, 5, "ink", "brakes");
    });
    frames.forEach(function (frame) {
      if (!/^replan/.test(frame.plan.decision)) return;
      var x = timeX(frame.time_s);
      var mark = drawn(svg, "path", { d: "M" + x + " " + (bottom - 3) + "l4 7h-8z",
                                      fill: "var(--path)" });
      drawn(mark, "title", {}, frame.plan.decision.replace(/_/g, " "));
    });
    var every = [0.5, 1, 2, 5, 10, 20, 60, 300, 600].find(function (s) {
      return duration / s * 36 <= width - LEFT - RIGHT;
    }) || duration;
    for (var t = 0; t <= duration + 1e-9; t += every) {
      drawn(svg, "text", { x: timeX(t), y: bottom + 17, "text-anchor": "middle", "class": "soft" },
            +t.toFixed(1) + (t ? "" : " s"));
    }
    cursor = drawn(svg, "line", { "class": "cursor", y1: TOP - 14, y2: bottom + 4 });
    svg.onpointerdown = svg.onpointermove = function (event) {
      if (!event.buttons) return;
      setPlaying(false);
      var x = event.clientX - svg.getBoundingClientRect().left;
      goTo(duration * (x - LEFT) / (width - LEFT - RIGHT));
    };
    var legend = element(timelines, "div", "legend");
    explain(legend, "dashes", "path", "speed that it wants now");
    explain(legend, "fill", "ink", "brakes for something");
    explain(legend, "tick", "path", "new plan");
    explain(legend, "fill", "shade", "direct sight");
    if (frames.some(function (unused, i) { return errorOf(i, 0); })) {
      explain(legend, "line", "found", single ? "error; shaded: two standard deviations"
        : "errors: " + world.objects.map(function (o) { return o.name; }).join(", and dashed ") +
          "; shaded: two standard deviations of the first");
    }
  }
  function showTime(i) {
    cursor.setAttribute("x1", timeX(now)); cursor.setAttribute("x2", timeX(now));
    STRIPS.forEach(function (strip, k) {
      readings[k].textContent = strip.lines.map(function (line) {
        var value = line(i);
        return known(value) ? value.toFixed(strip.digits) : "–";
      }).join(", ") + (strip.unit ? " " + strip.unit : "");
    });
  }

  // ---------------------------------------------------------------- facts

  var FATE = { used: "used by the perception", in_sight: "the object is in direct sight",
               seen_before: "the object has been in direct sight",
               busy: "skipped: perception was busy", missing: "never arrived" };
  function drawFacts(i) {
    var frame = frames[i], t = frame.time_ms;
    facts.textContent = "";
    [["sensor frame", i + " of " + (frames.length - 1) + ", " + FATE[frame.frame]],
     ["hidden object", frame.presence_probability === null ? "nothing known"
       : "present with " + (100 * frame.presence_probability).toFixed(1) + " %, " +
         frame.modes.length + " mode" + (frame.modes.length === 1 ? "" : "s")],
     ["plan", frame.plan.decision.replace(/_/g, " ")],
     ["brakes for", frame.braking_for || "nothing"],
     ["run time", "perceive " + t.perceive.toFixed(0) + ", map " + t.map.toFixed(1) + ", plan " +
       t.plan.toFixed(1) + " ms"]
    ].forEach(function (fact) {
      element(facts, "dt", "", fact[0]); element(facts, "dd", "", fact[1]);
    });
  }

  // ---------------------------------------------------------------- playing

  var now = 0, playing = false, rate = 1, last = null, shown = -1;
  function layout() {
    ratio = window.devicePixelRatio || 1;
    var wide = mapCard.clientWidth;
    var tall = Math.min(wide * g.rows / g.columns, Math.max(320, 0.6 * window.innerHeight));
    map.width = wide * ratio; map.height = tall * ratio; map.style.height = tall + "px";
    wide = plots.clientWidth; tall = Math.min(0.95 * wide, 520);
    plots.width = wide * ratio; plots.height = tall * ratio; plots.style.height = tall + "px";
    drawTimelines();
    shown = -1;
  }
  function draw() {
    var i = frameAt(now);
    drawMap(i, wholeMap());
    drawPlots(i, i !== shown);
    if (i !== shown) drawFacts(i);
    shown = i;
    showTime(i);
    slider.value = now;
    clock.textContent = now.toFixed(1) + " / " + duration.toFixed(1) + " s";
  }
  function tick(stamp) {
    if (!playing) return;
    if (last !== null) now = Math.min(duration, now + rate * (stamp - last) / 1000);
    last = stamp;
    draw();
    if (now >= duration) setPlaying(false); else window.requestAnimationFrame(tick);
  }
  function setPlaying(on) {
    if (on === playing) return;
    if (on && now >= duration) now = 0;
    playing = on; last = null;
    play.textContent = on ? "Pause" : "Play";
    if (on) window.requestAnimationFrame(tick);
  }
  function goTo(time) { now = Math.max(0, Math.min(duration, time)); draw(); }
  function jump(time) { setPlaying(false); goTo(time); }

  play.onclick = function () { setPlaying(!playing); };
  slider.oninput = function () { jump(+slider.value); };
  speed.onchange = function () { rate = +speed.value; };
  var found = findMoments();
  found.forEach(function (moment) {
    var button = element(moments, "button", moment.time === found.matters ? "matters" : "");
    element(button, "b", "", moment.time.toFixed(1) + " s");
    button.appendChild(document.createTextNode(" " + moment.words));
    button.onclick = function () { jump(moment.time); };
  });
  dark.addEventListener("change", function () { readColours(); gridFrame = shown = -1; draw(); });
  window.onresize = function () { layout(); draw(); };
  document.onkeydown = function (event) {
    var i = frameAt(now), tag = event.target.tagName;
    if (event.ctrlKey || event.altKey || event.metaKey || tag === "SELECT") return;
    if (event.key === " " && tag !== "BUTTON") setPlaying(!playing);
    else if (event.key === "ArrowRight") jump(frames[Math.min(i + 1, frames.length - 1)].time_s);
    else if (event.key === "ArrowLeft") jump(frames[Math.max(i - 1, 0)].time_s);
    else if (event.key === "Home") jump(0);
    else if (event.key === "End") jump(duration);
    else return;
    event.preventDefault();
  };

  readColours();
  drawLegends();
  layout();
  // It plays from the beginning. "#t=3.2" opens the page at that time; who wants nothing to move by
  // itself sees the moment that explains the drive.
  var wanted = /t=([0-9.]+)/.exec(window.location.hash);
  var still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  goTo(wanted ? +wanted[1] : still ? found.matters : 0);
  if (!wanted && !still) setPlaying(true);
})();
