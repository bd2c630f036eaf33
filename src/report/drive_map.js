// SPDX-License-Identifier: Apache-2.0
// Draws the map of a drive: known scene, vehicle, plan, what is hidden and where it is taken to be.
// The pages that play drives share it. Lengths are metres, angles radians, times seconds.
var DriveMap = (function () {
  "use strict";

  var CHI2_95 = 5.991;  // 95 % quantile of chi-square, two degrees of freedom
  var SHARED = ["path", "vehicle", "field", "field-edge", "goal", "measured", "object", "found",
                "rival", "truth", "occupied", "relay", "ink", "soft", "faint"];

  // Colours by meaning, the same on all pages (theme.css). A canvas needs their values.
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
    return COLOUR;
  }

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

  // One entry of a legend: the mark as it is drawn, and what it means.
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

  // ---------------------------------------------------------------- one drive

  // Draws one drive. `data` holds `drive`, `world` and `pictures`.
  function painter(data) {
    var drive = data.drive, world = data.world, frames = drive.frames, pictures = data.pictures;
    var trace = world.trace, step = world.trace_step_s, now = 0;
    var duration = Math.max(drive.time_s, step);

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
    // Variance of x, covariance of x and y, and variance of y.
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
    // Error of the heaviest mode at the frame's time: distance from the truth, and two standard
    // deviations of it. Null: there is nothing to compare.
    function errorOf(i, object) {
      var truth = frames[i].truth, mode = pictures[i].now[0];
      if (!truth || !mode || !holds(mode, object)) return null;
      var a = placed(truth, object), b = placed(mode.pose, object), v = covariance(mode, object);
      return { error: Math.hypot(a.x_m - b.x_m, a.y_m - b.y_m), band: 2 * Math.sqrt(v[0] + v[2]) };
    }

    function first(condition) {
      var i = frames.findIndex(condition);
      return i < 0 ? null : frames[i];
    }
    function isBraking(frame) { return frame.braking_for && !/curve/.test(frame.braking_for); }

    var HIDDEN = world.objects.length === 1 ? world.objects[0].name : "hidden objects";

    // Moments to look at. `matters` is the time that explains the drive.
    function moments() {
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

    var g = world.map, ratio = window.devicePixelRatio || 1;
    // The view that is drawn into: its canvas, pixels per metre, and the pixel of the origin.
    var view = { canvas: null, scale: 1, x: 0, y: 0 };
    // A view of a part of the world, given by its [x, y] corners, as large as the canvas allows.
    function viewOf(canvas, lower, upper) {
      ratio = window.devicePixelRatio || 1;
      var scale = Math.min(canvas.width / (upper[0] - lower[0]), canvas.height / (upper[1] - lower[1]));
      return { canvas: canvas, scale: scale,
               x: canvas.width / 2 - (lower[0] + upper[0]) / 2 * scale,
               y: canvas.height / 2 + (lower[1] + upper[1]) / 2 * scale };
    }
    function wholeMap(canvas) {
      return viewOf(canvas, g.origin_m,
        [g.origin_m[0] + g.columns * g.cell_m, g.origin_m[1] + g.rows * g.cell_m]);
    }
    // A view of the vehicle, and of the nearest hidden object if that is not far.
    function closeUp(canvas, i) {
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
      var half = (reach + 2.5 * length) / 2;
      return viewOf(canvas, [middle[0] - half, middle[1] - half],
        [middle[0] + half, middle[1] + half]);
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
    // Draws the cells from runs of a letter and a count: "a" to "p" by probability, "-" for
    // unknown.
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
    // An arrow from where an object is to where it is half a second later, with the ellipse there.
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
    // Draws the modes, moved on from the capture to the time of the frame. The heaviest lies on
    // top.
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
    // A path through points in pixels.
    function line(ctx, points) {
      ctx.beginPath();
      points.forEach(function (p) { ctx.lineTo(p[0], p[1]); });
    }
    // Lengths along the vehicle are in units of its length, those across it in units of its width.
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
    // Draws frame i at a time into a view.
    function drawMap(i, as, time) {
      view = as; now = time;
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

    return { frameAt: frameAt, vehicleAt: vehicleAt, errorOf: errorOf, viewOf: viewOf,
             moments: moments, isBraking: isBraking, hidden: HIDDEN, duration: duration,
             wholeMap: wholeMap, closeUp: closeUp, draw: drawMap, fill: fill, stroke: stroke,
             forgetGrid: function () { gridFrame = -1; } };
  }

  // Controls of a replay in a bar of the page: a button, the time as a slider (with this label) and
  // in words, and the speed.
  function controls(bar, label) {
    var play = element(bar, "button", "play", "Play"), slider = element(bar, "input");
    play.type = "button";
    slider.type = "range"; slider.min = 0;
    slider.setAttribute("aria-label", label);
    var clock = element(bar, "span", "clock"), speed = element(bar, "select");
    speed.setAttribute("aria-label", "speed of the replay");
    [0.25, 0.5, 1, 2].forEach(function (r) {
      var option = element(speed, "option", "", r + "×");
      option.value = r; option.selected = r === 1;
    });
    return { play: play, slider: slider, clock: clock, speed: speed };
  }
  // A canvas that says what it shows.
  function picture(parent, label) {
    var canvas = element(parent, "canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", label);
    return canvas;
  }

  // Lets a page's clock run while its button says "Pause". `clock` is the page's own: now(),
  // duration() (s), rate() (seconds in a second), and show(time), which draws.
  function player(clock, button) {
    var playing = false, last = null;
    function tick(stamp) {
      if (!playing) return;
      var passed = last !== null ? clock.rate() * (stamp - last) / 1000 : 0;
      last = stamp;
      clock.show(Math.min(clock.duration(), clock.now() + passed));
      if (clock.now() >= clock.duration()) set(false); else window.requestAnimationFrame(tick);
    }
    function set(on) {
      if (on === playing) return;
      if (on && clock.now() >= clock.duration()) clock.show(0);
      playing = on; last = null;
      button.textContent = on ? "Pause" : "Play";
      if (on) window.requestAnimationFrame(tick);
    }
    function toggle() { set(!playing); }
    button.onclick = toggle;
    return { set: set, toggle: toggle };
  }

  return { painter: painter, readColours: readColours, dark: dark, element: element, drawn: drawn,
           explain: explain, controls: controls, picture: picture, player: player };
})();
