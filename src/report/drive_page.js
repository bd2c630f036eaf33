// SPDX-License-Identifier: Apache-2.0
// Plays a drive: a map as people know them, histograms, a time slider. Needs the JSON in #data; no
// network, no library. Lengths are metres, angles radians, times seconds.
(function () {
  "use strict";

  var data = JSON.parse(document.getElementById("data").textContent);
  var drive = data.drive, world = data.world, frames = drive.frames, pictures = data.pictures;
  var trace = world.trace, step = world.trace_step_s, duration = Math.max(drive.time_s, step);
  // Colours by meaning, the same on all pages (theme.css); a canvas needs their values.
  var COLOUR = {}, OBJECT, TRUTH;
  var dark = window.matchMedia("(prefers-color-scheme: dark)");
  function readColours() {
    var style = window.getComputedStyle(document.documentElement);
    function of(name) { return style.getPropertyValue("--" + name).trim(); }
    COLOUR = {
      land: dark.matches ? "#20262b" : "#eef0ee", road: dark.matches ? "#2c343b" : "#ffffff",
      building: dark.matches ? "#4a4d4f" : "#d9d5cd", buildingEdge: dark.matches ? "#63676a" : "#bdb6a8",
      wall: of("relay"), route: of("path"), trace: of("vehicle"), field: of("field"), fieldEdge: of("field-edge"),
      car: of("vehicle"), glass: dark.matches ? "#1b2025" : "#d2e3fc", goal: of("goal"), paper: of("paper"),
      measured: of("measured"), object: of("object"), ink: of("ink"), soft: of("soft"), faint: of("faint"),
      occupied: of("found"), halo: dark.matches ? "#14181c" : "#ffffff"
    };
    // Of the hidden objects, one after the other: what is said of it, and where it really is.
    OBJECT = [of("found"), of("series-3"), of("series-6"), of("series-5")];
    TRUTH = [of("truth"), of("series-0"), of("series-4"), of("ink")];
  }
  readColours();
  var CHI2_95 = 5.991;  // 95 % quantile of chi-square, two degrees of freedom

  var now = 0, playing = false, rate = 1, last = null;

  // ---------------------------------------------------------------- page

  function element(parent, tag, className, text) {
    var node = document.createElement(tag);
    if (className) node.className = className;
    if (text !== undefined) node.textContent = text;
    parent.appendChild(node);
    return node;
  }
  var page = document.getElementById("page");
  var title = element(page, "h1", "", drive.drive.replace(/_/g, " "));
  element(title, "span", "outcome " + drive.outcome, drive.outcome);
  var WORDS = { reached: "reached its goal", collision: "hit something", stopped: "stopped and did not go on",
                timeout: "ran out of time" };
  element(page, "p", "headline", "The " + world.vehicle.kind + " " + (WORDS[drive.outcome] || drive.outcome) + " after " +
    drive.time_s.toFixed(1) + " s and " + drive.length_m.toFixed(1) + " m" + (drive.clearance_m === null ? "."
    : drive.clearance_m > 0 ? "; it was never nearer to anything than " + drive.clearance_m.toFixed(2) + " m." : "."));
  element(title, "small", "", "perception: " + drive.perception + " · " + drive.length_m.toFixed(1) + " m in " +
    drive.time_s.toFixed(1) + " s · clearance " + (drive.clearance_m === null ? "–" : drive.clearance_m.toFixed(2) + " m"));
  var columns = element(page, "div", "columns");
  var mapCard = element(columns, "div", "card map");
  var map = element(mapCard, "canvas");
  var bar = element(mapCard, "div", "bar");
  var play = element(bar, "button", "play", "Play");
  var slider = element(bar, "input");
  slider.type = "range"; slider.min = 0; slider.max = duration; slider.step = step; slider.value = 0;
  var clock = element(bar, "span", "clock");
  var speed = element(bar, "select");
  [0.25, 0.5, 1, 2].forEach(function (r) {
    var option = element(speed, "option", "", r + "×"); option.value = r; option.selected = r === 1;
  });
  var side = element(columns, "div", "card side");
  element(side, "h2", "", "Now");
  var facts = element(side, "dl");
  var heading = element(side, "h2", "", "Histograms ");
  var headingNote = element(heading, "small");
  var plots = element(side, "canvas");
  var legend = element(side, "div", "legend");
  function drawLegend() {
  legend.textContent = "";
  [[COLOUR.measured, "counts of the sensor"], [COLOUR.object, "of them from the hidden object (expected)"],
   [COLOUR.occupied, "occupied cells, stronger where that is more probable"]
  ].concat([].concat.apply([], world.objects.map(function (object, i) {
    var name = world.objects.length > 1 ? object.name + ", " : "";
    return [[TRUTH[i % TRUTH.length], name + "true hidden object"],
            [OBJECT[i % OBJECT.length], name + "modes: 95 % ellipse, footprint; arrow and dots: in half a second"]];
  }))).concat([[COLOUR.route, "plan"], [COLOUR.field, "field of view"], [COLOUR.goal, "goal"]]).forEach(function (entry) {
    var item = element(legend, "span"), mark = element(item, "i");
    mark.style.background = entry[0];
    item.appendChild(document.createTextNode(entry[1]));
  });
  }
  drawLegend();
  element(side, "div", "keys", "Space plays and pauses, arrows go from frame to frame.");

  // ---------------------------------------------------------------- drive

  function frameAt(time) {
    var i = 0;
    while (i + 1 < frames.length && frames[i + 1].time_s <= time + 1e-9) ++i;
    return i;
  }
  function vehicleAt(time) {
    if (!trace.length) return [frames[0].x_m, frames[0].y_m, frames[0].yaw_rad];
    var at = time / step - 1, i = Math.floor(at);
    var first = [frames[0].x_m, frames[0].y_m, frames[0].yaw_rad];
    var a = i < 0 ? first : trace[Math.min(i, trace.length - 1)];
    var b = trace[Math.max(0, Math.min(i + 1, trace.length - 1))], s = at - i;
    return [0, 1, 2].map(function (k) { return a[k] + (b[k] - a[k]) * s; });
  }
  // Place of one object in a pose vector.
  function placed(pose, object) {
    var at = { x_m: world.objects[object].known.x_m, y_m: world.objects[object].known.y_m,
               yaw_rad: world.objects[object].known.yaw_rad, size: world.objects[object].known.size };
    world.unknowns.forEach(function (u, i) { if (u.object === object && pose[i] !== null) at[u.component] = pose[i]; });
    return at;
  }
  function outlineAt(object, at) {
    var c = Math.cos(at.yaw_rad) * at.size, s = Math.sin(at.yaw_rad) * at.size;
    return world.objects[object].outline.map(function (p) {
      return [at.x_m + c * p[0] - s * p[1], at.y_m + s * p[0] + c * p[1]];
    });
  }

  // ---------------------------------------------------------------- map

  var g = world.map, view = { scale: 1, x: 0, y: 0 };
  var ratio = window.devicePixelRatio || 1;
  function layout() {
    var width = mapCard.clientWidth, aspect = g.rows / g.columns;
    var height = Math.min(width * aspect, window.innerHeight - 150);
    height = Math.max(height, Math.min(320, 1.2 * width));
    map.width = width * ratio; map.height = height * ratio; map.style.height = height + "px";
    view.scale = Math.min(map.width / (g.columns * g.cell_m), map.height / (g.rows * g.cell_m));
    view.x = (map.width - g.columns * g.cell_m * view.scale) / 2 - g.origin_m[0] * view.scale;
    view.y = (map.height + g.rows * g.cell_m * view.scale) / 2 + g.origin_m[1] * view.scale;
    plots.width = plots.clientWidth * ratio;
    plots.height = Math.min(plots.clientWidth * 0.95, 460) * ratio;
    plots.style.height = plots.height / ratio + "px";
  }
  function X(x) { return view.x + x * view.scale; }
  function Y(y) { return view.y - y * view.scale; }
  function trail(ctx, points, close) {
    ctx.beginPath();
    points.forEach(function (p, i) { if (i) ctx.lineTo(X(p[0]), Y(p[1])); else ctx.moveTo(X(p[0]), Y(p[1])); });
    if (close) ctx.closePath();
  }
  var pixel = 1;
  function drawWorld(ctx) {
    ctx.fillStyle = COLOUR.land; ctx.fillRect(0, 0, map.width, map.height);
    world.surfaces.forEach(function (s) {
      if (s.body || s.outline.length < 3) return;
      trail(ctx, s.outline, true); ctx.fillStyle = COLOUR.road; ctx.fill();
    });
  }
  function drawBuildings(ctx) {
    world.surfaces.forEach(function (s) {
      if (s.body) {
        trail(ctx, s.outline, true);
        ctx.fillStyle = COLOUR.building; ctx.fill();
        ctx.strokeStyle = COLOUR.buildingEdge; ctx.lineWidth = 1.5 * pixel; ctx.stroke();
      } else if (s.outline.length === 2) {
        trail(ctx, s.outline, false);
        ctx.strokeStyle = COLOUR.wall; ctx.lineWidth = 5 * pixel; ctx.lineCap = "round"; ctx.stroke();
      }
    });
  }
  var gridImage = document.createElement("canvas");
  gridImage.width = g.columns; gridImage.height = g.rows;
  var gridFrame = -1;
  function prepareGrid(i) {
    if (i === gridFrame) return;
    gridFrame = i;
    var ctx = gridImage.getContext("2d"), image = ctx.createImageData(g.columns, g.rows);
    var occupied = [1, 3, 5].map(function (at) { return parseInt(COLOUR.occupied.slice(at, at + 2), 16); });
    var text = pictures[i].grid, cell = 0, pattern = /([a-p-])(\d*)/g, run;
    while ((run = pattern.exec(text))) {
      var count = run[2] ? +run[2] : 1, level = run[1] === "-" ? -1 : run[1].charCodeAt(0) - 97;
      for (; count > 0; --count, ++cell) {
        var column = cell % g.columns, row = g.rows - 1 - Math.floor(cell / g.columns);
        var k = 4 * (row * g.columns + column);
        if (level < 0) { image.data[k] = 90; image.data[k + 1] = 105; image.data[k + 2] = 120; image.data[k + 3] = 34; }
        else if (level > 0) {
          image.data[k] = occupied[0]; image.data[k + 1] = occupied[1]; image.data[k + 2] = occupied[2];
          image.data[k + 3] = Math.min(200, 30 + 12 * level);
        }
      }
    }
    ctx.putImageData(image, 0, 0);
  }
  function drawGrid(ctx, i) {
    if (!pictures[i].grid) return;
    prepareGrid(i);
    ctx.imageSmoothingEnabled = false;
    ctx.drawImage(gridImage, X(g.origin_m[0]), Y(g.origin_m[1] + g.rows * g.cell_m),
      g.columns * g.cell_m * view.scale, g.rows * g.cell_m * view.scale);
  }
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
  function drawEllipse(ctx, mode, object, dash) {
    var at = placed(mode.pose, object), v = covariance(mode, object);
    var half = Math.sqrt(Math.pow((v[0] - v[2]) / 2, 2) + v[1] * v[1]), mean = (v[0] + v[2]) / 2;
    ctx.save();
    ctx.translate(X(at.x_m), Y(at.y_m));
    ctx.rotate(-Math.atan2(2 * v[1], v[0] - v[2]) / 2);
    ctx.beginPath();
    ctx.ellipse(0, 0, Math.sqrt(CHI2_95 * Math.max(mean + half, 0)) * view.scale,
      Math.sqrt(CHI2_95 * Math.max(mean - half, 0)) * view.scale, 0, 0, 2 * Math.PI);
    ctx.setLineDash(dash); ctx.stroke();
    ctx.restore();
  }
  // From where an object is to where it is half a second later, with the ellipse there.
  function drawMotion(ctx, now, later, object) {
    var a = placed(now.pose, object), b = placed(later.pose, object);
    var x = X(b.x_m), y = Y(b.y_m), dx = x - X(a.x_m), dy = y - Y(a.y_m), length = Math.hypot(dx, dy), head = 9 * pixel;
    ctx.lineWidth = 1.5 * pixel;
    drawEllipse(ctx, later, object, [1.5 * pixel, 4 * pixel]);
    if (length < head) return;
    dx /= length; dy /= length; ctx.lineWidth = 3 * pixel;
    ctx.beginPath(); ctx.moveTo(X(a.x_m), Y(a.y_m)); ctx.lineTo(x - head * dx, y - head * dy); ctx.stroke();
    ctx.beginPath(); ctx.moveTo(x, y);
    ctx.lineTo(x - head * dx - 0.5 * head * dy, y - head * dy + 0.5 * head * dx);
    ctx.lineTo(x - head * dx + 0.5 * head * dy, y - head * dy - 0.5 * head * dx);
    ctx.closePath(); ctx.fillStyle = ctx.strokeStyle; ctx.fill();
  }
  // Moved on from the capture to the time of the frame.
  function drawModes(ctx, i) {
    var frame = frames[i], later = pictures[i].later;
    pictures[i].now.map(function (mode, k) { return [mode, later[k]]; }).reverse().forEach(function (pair) {
      var mode = pair[0];
      world.objects.forEach(function (unused, object) {
        var first = world.unknowns.findIndex(function (u) { return u.object === object; });
        if (first >= 0 && mode.pose[first] === null) return;
        ctx.save();
        ctx.globalAlpha = (0.25 + 0.75 * mode.weight) * Math.max(frame.presence_probability, 0.15);
        trail(ctx, outlineAt(object, placed(mode.pose, object)), true);
        var colour = OBJECT[object % OBJECT.length];
        ctx.save(); ctx.globalAlpha *= 0.35; ctx.fillStyle = colour; ctx.fill(); ctx.restore();
        ctx.strokeStyle = colour; ctx.lineWidth = 2 * pixel; ctx.stroke();
        drawEllipse(ctx, mode, object, [6 * pixel, 4 * pixel]);
        if (pair[1]) drawMotion(ctx, mode, pair[1], object);
        ctx.restore();
      });
    });
  }
  function drawTruth(ctx, frame) {
    if (!frame.truth) return;
    world.objects.forEach(function (unused, object) {
      trail(ctx, outlineAt(object, placed(frame.truth, object)), true);
      ctx.strokeStyle = TRUTH[object % TRUTH.length]; ctx.lineWidth = 2.5 * pixel; ctx.stroke();
    });
  }
  function drawField(ctx, i) {
    var field = pictures[i].field;
    if (!field || field.length < 3) return;
    trail(ctx, field, true);
    ctx.save(); ctx.globalAlpha = 0.16; ctx.fillStyle = COLOUR.field; ctx.fill(); ctx.restore();
    ctx.strokeStyle = COLOUR.fieldEdge; ctx.lineWidth = 1 * pixel; ctx.stroke();
  }
  function roundRect(ctx, x, y, w, h, r) {
    ctx.beginPath();
    ctx.moveTo(x + r, y); ctx.arcTo(x + w, y, x + w, y + h, r); ctx.arcTo(x + w, y + h, x, y + h, r);
    ctx.arcTo(x, y + h, x, y, r); ctx.arcTo(x, y, x + w, y, r); ctx.closePath();
  }
  function drawVehicle(ctx, at, frame) {
    var l = world.vehicle.length_m * view.scale, w = world.vehicle.width_m * view.scale;
    ctx.save();
    ctx.translate(X(at[0]), Y(at[1])); ctx.rotate(-at[2]);
    ctx.shadowColor = "rgba(0,0,0,.35)"; ctx.shadowBlur = 6 * pixel;
    if (world.vehicle.kind === "car") {
      ctx.fillStyle = "#2b2f33";  // wheels
      [[0.31, 1], [0.31, -1], [-0.31, 1], [-0.31, -1]].forEach(function (p) {
        ctx.save(); ctx.translate(p[0] * l, p[1] * w * 0.44);
        if (p[0] > 0) ctx.rotate(-(frame.steering_rad || 0));
        ctx.fillRect(-0.07 * l, -0.08 * w, 0.14 * l, 0.16 * w); ctx.restore();
      });
      ctx.fillStyle = COLOUR.car; roundRect(ctx, -l / 2, -w / 2, l, w, 0.28 * w); ctx.fill();
      ctx.shadowBlur = 0;
      ctx.fillStyle = COLOUR.glass;
      ctx.beginPath(); ctx.moveTo(0.2 * l, -0.4 * w); ctx.lineTo(0.06 * l, -0.33 * w);
      ctx.lineTo(0.06 * l, 0.33 * w); ctx.lineTo(0.2 * l, 0.4 * w); ctx.closePath(); ctx.fill();
      roundRect(ctx, -0.4 * l, -0.33 * w, 0.1 * l, 0.66 * w, 0.08 * w); ctx.fill();
      ctx.fillStyle = "#fff8e1";
      ctx.fillRect(0.46 * l, -0.42 * w, 0.03 * l, 0.2 * w); ctx.fillRect(0.46 * l, 0.22 * w, 0.03 * l, 0.2 * w);
    } else {
      ctx.fillStyle = "#2b2f33";
      ctx.fillRect(-0.2 * l, -0.55 * w, 0.4 * l, 0.16 * w); ctx.fillRect(-0.2 * l, 0.39 * w, 0.4 * l, 0.16 * w);
      ctx.fillStyle = COLOUR.car; roundRect(ctx, -l / 2, -w / 2, l, w, 0.3 * w); ctx.fill();
      ctx.shadowBlur = 0; ctx.fillStyle = COLOUR.glass;
      ctx.beginPath(); ctx.moveTo(0.38 * l, 0); ctx.lineTo(0.05 * l, -0.26 * w); ctx.lineTo(0.05 * l, 0.26 * w);
      ctx.closePath(); ctx.fill();
    }
    ctx.restore();
  }
  function drawGoal(ctx) {
    var line = world.finish_line_m, goal = line ? [(line[0][0] + line[1][0]) / 2, (line[0][1] + line[1][1]) / 2]
      : world.route_m[world.route_m.length - 1];
    var x = X(goal[0]), y = Y(goal[1]), r = 9 * pixel;
    ctx.save(); ctx.beginPath();
    if (line) {
      ctx.moveTo(X(line[0][0]), Y(line[0][1])); ctx.lineTo(X(line[1][0]), Y(line[1][1]));
      ctx.strokeStyle = COLOUR.goal; ctx.lineWidth = 4 * pixel; ctx.stroke();
    } else {
      ctx.arc(x, y, world.goal_tolerance_m * view.scale, 0, 2 * Math.PI);
      ctx.globalAlpha = 0.2; ctx.fillStyle = COLOUR.goal; ctx.fill();
    }
    ctx.restore();
    ctx.beginPath(); ctx.arc(x, y - 2.1 * r, r, Math.PI * 0.86, Math.PI * 0.14); ctx.lineTo(x, y); ctx.closePath();
    ctx.fillStyle = COLOUR.goal; ctx.fill();
    ctx.beginPath(); ctx.arc(x, y - 2.1 * r, 0.38 * r, 0, 2 * Math.PI); ctx.fillStyle = "#fff"; ctx.fill();
  }
  function drawScale(ctx) {
    var length = Math.pow(10, Math.floor(Math.log(g.columns * g.cell_m / 4) / Math.LN10));
    if (g.columns * g.cell_m / 4 >= 5 * length) length *= 5; else if (g.columns * g.cell_m / 4 >= 2 * length) length *= 2;
    var x = map.width - 16 * pixel - length * view.scale, y = map.height - 16 * pixel;
    ctx.strokeStyle = COLOUR.ink; ctx.lineWidth = 2 * pixel; ctx.lineCap = "butt";
    ctx.beginPath(); ctx.moveTo(x, y - 5 * pixel); ctx.lineTo(x, y); ctx.lineTo(x + length * view.scale, y);
    ctx.lineTo(x + length * view.scale, y - 5 * pixel); ctx.stroke();
    ctx.fillStyle = COLOUR.ink; ctx.font = 12 * pixel + "px sans-serif"; ctx.textAlign = "center";
    ctx.fillText(length + " m", x + length * view.scale / 2, y - 5 * pixel);
  }
  function drawMap(i) {
    var ctx = map.getContext("2d"), frame = frames[i];
    pixel = ratio;
    drawWorld(ctx);
    drawGrid(ctx, i);
    drawField(ctx, i);
    drawBuildings(ctx);
    trail(ctx, trace.slice(0, Math.max(0, Math.round(now / step))), false);
    ctx.strokeStyle = COLOUR.trace; ctx.lineWidth = 4 * pixel; ctx.lineJoin = "round"; ctx.stroke();
    trail(ctx, frame.plan.path_m, false);
    ctx.strokeStyle = COLOUR.halo; ctx.lineWidth = 7 * pixel; ctx.stroke();
    ctx.strokeStyle = COLOUR.route; ctx.lineWidth = 4.5 * pixel; ctx.stroke();
    drawGoal(ctx);
    drawModes(ctx, i);
    drawTruth(ctx, frame);
    drawVehicle(ctx, vehicleAt(now), frame);
    drawScale(ctx);
  }

  // ---------------------------------------------------------------- histograms and facts

  function drawPlots(i) {
    var ctx = plots.getContext("2d"), picture = pictures[i];
    ctx.clearRect(0, 0, plots.width, plots.height);
    var count = picture.measured.length;
    headingNote.textContent = count ? "zones with most light from the object, logarithmic, over " +
      (picture.measured[0].length * world.bin_width_ns).toFixed(0) + " ns (" +
      (picture.measured[0].length * world.bin_width_ns * 0.299792458).toFixed(0) + " m of path)" : "none of this frame";
    if (!count) return;
    var side = Math.ceil(Math.sqrt(count)), w = plots.width / side, h = plots.height / Math.ceil(count / side);
    var top = 1, floor = Infinity;
    picture.measured.forEach(function (bins) {
      bins.forEach(function (v) { top = Math.max(top, v); if (v > 0) floor = Math.min(floor, v); });
    });
    floor = Math.max(0.5, floor / 300);
    function height(v) { return v > floor ? Math.log(v / floor) / Math.log(top / floor) : 0; }
    for (var z = 0; z < count; ++z) {
      var x0 = (z % side) * w + 4 * ratio, y1 = (Math.floor(z / side) + 1) * h - 6 * ratio;
      var ww = w - 8 * ratio, hh = h - 22 * ratio, n = picture.measured[z].length;
      ctx.fillStyle = COLOUR.soft; ctx.font = 10.5 * ratio + "px sans-serif"; ctx.textAlign = "left";
      ctx.fillText("zone " + data.zones[z], x0, y1 - hh - 3 * ratio);
      ctx.strokeStyle = COLOUR.faint; ctx.lineWidth = ratio; ctx.strokeRect(x0, y1 - hh, ww, hh);
      ctx.beginPath(); ctx.moveTo(x0, y1);
      for (var k = 0; k < n; ++k) ctx.lineTo(x0 + (k + 0.5) * ww / n, y1 - hh * height(picture.object[z][k]));
      ctx.lineTo(x0 + ww, y1); ctx.closePath(); ctx.save(); ctx.globalAlpha = 0.6; ctx.fillStyle = COLOUR.object; ctx.fill(); ctx.restore();
      ctx.beginPath();
      for (k = 0; k < n; ++k) ctx.lineTo(x0 + (k + 0.5) * ww / n, y1 - hh * height(picture.measured[z][k]));
      ctx.strokeStyle = COLOUR.measured; ctx.lineWidth = 1.1 * ratio; ctx.stroke();
    }
  }
  var FATE = { used: "used by the perception", in_sight: "the object is in direct sight",
               seen_before: "the object has been in direct sight", busy: "skipped: perception was busy", missing: "never arrived" };
  // Of each object, in the heaviest mode as of the frame's time.
  function errorOf(i) {
    var frame = frames[i], mode = pictures[i].now[0];
    if (!frame.truth || !mode) return null;
    return world.objects.map(function (unused, object) {
      var a = placed(frame.truth, object), b = placed(mode.pose, object);
      return Math.hypot(a.x_m - b.x_m, a.y_m - b.y_m).toFixed(2);
    }).join(" and ");
  }
  function drawFacts(i) {
    var frame = frames[i], error = errorOf(i), t = frame.time_ms;
    facts.textContent = "";
    [["speed", frame.speed_m_per_s.toFixed(2) + " m/s (target " + (frame.target_speed_m_per_s || 0).toFixed(2) + ")"],
     ["sensor frame", i + " of " + (frames.length - 1) + ", " + FATE[frame.frame]],
     ["hidden object", frame.presence_probability === null ? "nothing known"
       : "present with " + (100 * frame.presence_probability).toFixed(1) + " %, " + frame.modes.length + " mode" + (frame.modes.length === 1 ? "" : "s")],
     ["heaviest mode", error === null ? "–" : error + " m from the truth"],
     ["plan", frame.plan.decision],
     ["run time", "perceive " + t.perceive.toFixed(0) + ", map " + t.map.toFixed(1) + ", plan " + t.plan.toFixed(1) + " ms"]
    ].forEach(function (fact) { element(facts, "dt", "", fact[0]); element(facts, "dd", "", fact[1]); });
  }

  // ---------------------------------------------------------------- playing

  var shown = -1;
  function draw() {
    var i = frameAt(now);
    drawMap(i);
    if (i !== shown) { drawPlots(i); drawFacts(i); shown = i; }
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
    if (on && now >= duration) now = 0;
    playing = on; last = null;
    play.textContent = on ? "Pause" : "Play";
    if (on) window.requestAnimationFrame(tick);
  }
  function goTo(time) { now = Math.max(0, Math.min(duration, time)); draw(); }
  play.onclick = function () { setPlaying(!playing); };
  slider.oninput = function () { setPlaying(false); goTo(+slider.value); };
  speed.onchange = function () { rate = +speed.value; };
  (dark.addEventListener ? dark.addEventListener.bind(dark, "change") : dark.addListener.bind(dark))(function () {
    readColours(); drawLegend(); gridFrame = -1; shown = -1; draw();
  });
  window.onresize = function () { layout(); shown = -1; draw(); };
  document.onkeydown = function (event) {
    var i = frameAt(now);
    if (event.key === " ") setPlaying(!playing);
    else if (event.key === "ArrowRight") { setPlaying(false); goTo(frames[Math.min(i + 1, frames.length - 1)].time_s); }
    else if (event.key === "ArrowLeft") { setPlaying(false); goTo(frames[Math.max(i - 1, 0)].time_s); }
    else return;
    event.preventDefault();
  };
  // "#t=3.2" opens the page at that time.
  var wanted = /t=([0-9.]+)/.exec(window.location.hash);
  layout();
  goTo(wanted ? +wanted[1] : 0);
})();
