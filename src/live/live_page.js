// SPDX-License-Identifier: Apache-2.0
// Draws what `blindcorner live` sends: bird's-eye view, presence, light, counts. Needs D3 version 3,
// poses.js, the JSON in #data and server-sent events from the same server; no other network. Lengths are
// metres, angles radians.
(function () {
  "use strict";

  var data = JSON.parse(document.getElementById("data").textContent);
  var scene = data.scene, objects = scene.objects, unknowns = data.unknowns;
  var poses = Poses(objects, unknowns), finite = poses.finite, place = poses.place;
  var point = poses.point, eachObject = poses.eachObject;
  var ellipse = poses.ellipse, placedObject = poses.placedObject;
  var TRAIL = 60;        // answers that the trail shows
  var MINUTE = 60;       // seconds that the curves show
  var MOST_POINTS = 3600;
  var latest = null, light = null, status = { counts: {}, state: "connecting" };
  var history = [];      // {time_s, presence_probability, pose, latency_ms}
  var look = { log: false, paused: false, all: false };

  function element(parent, tag, className, text) {
    var node = parent.append(tag);
    if (className) node.attr("class", className);
    if (text !== undefined) node.text(text);
    return node;
  }
  function percent(p) {
    if (!finite(p)) return "–";
    if (p > 0.999 && p < 1) return "> 99.9 %";
    return (100 * p).toFixed(p < 0.1 ? 1 : 0) + " %";
  }
  function fixed(value, sigma) {
    var digits = finite(sigma) && sigma > 0
      ? Math.max(0, Math.min(4, 1 - Math.floor(Math.log(sigma) / Math.LN10))) : 2;
    return finite(value) ? value.toFixed(digits).replace("-", "−") : "–";
  }

  // ---------------------------------------------------------------- poses

  function bounds(name, o) {
    var i = place(name, o), known = objects[o].known[name];
    return i >= 0 ? scene.bounds[i] : [known, known];
  }

  // ---------------------------------------------------------------- what stands on the page

  var root = d3.select("#page");
  element(root, "h1", "", (scene.name || "scene") + ", live");
  var subtitle = element(root, "p", "subtitle", "");
  var headline = element(root, "p", "headline", "Waiting for frames.").attr("role", "status");
  var tools = element(root, "div", "tools");
  function toggle(text, key) {
    var button = element(tools, "button", "", text).attr("type", "button").attr("aria-pressed", "false");
    button.on("click", function () {
      look[key] = !look[key];
      button.attr("aria-pressed", String(look[key]));
      drawAll();
    });
  }
  toggle("Pause the pictures", "paused");
  toggle("All the light", "all");
  toggle("Logarithmic counts", "log");

  var columns = element(root, "div", "columns");
  var left = element(columns, "section", "picture"), right = element(columns, "section", "rest");
  element(left, "h2", "", "From above");
  var mapHolder = element(left, "div");
  var legend = element(left, "div", "legend");
  [["--found", "heaviest mode, 95 %"], ["--rival", "rival modes"], ["--occupied", "cells that may be occupied"],
   ["--model", "where it was"], ["--search", "search region"], ["--field", "what the sensor sees"],
   ["--relay", "relay and walls"]]
    .forEach(function (entry) {
      var item = element(legend, "span");
      element(item, "i", "swatch").style("background", "var(" + entry[0] + ")");
      element(item, "span", "", entry[1]);
    });
  var numbers = element(right, "dl", "numbers");
  var shown = {};
  ["Presence", "Position (m)", "Speed (m/s)", "Answers / s", "Latency (ms)", "Frames", "Skipped", "Time (s)"]
    .forEach(function (name) {
      var box = element(numbers, "div");
      element(box, "dt", "", name);
      shown[name] = element(box, "dd", "", "–");
    });
  var presenceHolder = element(right, "section");
  element(presenceHolder, "h2", "", "Presence over the last minute");
  presenceHolder = element(presenceHolder, "div");
  var latencyHolder = element(right, "section");
  element(latencyHolder, "h2", "", "Latency from the last byte to the answer, ms");
  latencyHolder = element(latencyHolder, "div");
  var countSection = element(right, "section");
  element(countSection, "h2", "", "Counts");
  var countList = element(countSection, "dl", "facts counts");
  var lightSection = element(root, "section");
  element(lightSection, "h2", "", "Light in each zone");
  var lightNote = element(lightSection, "p", "soft", "");
  var lightLegend = element(lightSection, "div", "legend");
  [["--measured", "measured"], ["--model", "fitted"], ["--object", "of the object"]]
    .forEach(function (entry) {
      var item = element(lightLegend, "span");
      element(item, "i", "swatch").style("background", "var(" + entry[0] + ")");
      element(item, "span", "", entry[1]);
    });
  var zonesHolder = element(lightSection, "div", "zones");

  // ---------------------------------------------------------------- map

  function extent() {
    var points = [data.view.position.slice(0, 2)];
    eachObject(function (o) {
      var x = bounds("x_m", o), y = bounds("y_m", o);
      var reach = d3.max(objects[o].outline, function (p) { return Math.sqrt(p[0] * p[0] + p[1] * p[1]); }) || 0;
      points.push([x[0] - reach, y[0] - reach], [x[1] + reach, y[1] + reach]);
    });
    data.view.zones.forEach(function (zone) { points = points.concat(d3.merge(zone)); });
    var x = d3.extent(points, function (p) { return p[0]; });
    var y = d3.extent(points, function (p) { return p[1]; });
    var pad = 0.06 * Math.max(x[1] - x[0], y[1] - y[0]);
    return [[x[0] - pad, y[0] - pad], [x[1] + pad, y[1] + pad]];
  }
  function widthIn(parent, most) {
    return Math.max(240, Math.min(most, Math.floor(parent.node().clientWidth || most)));
  }
  function path(points, x, y, open) {
    return "M" + points.map(function (p) { return x(p[0]) + "," + y(p[1]); }).join("L") +
      (points.length > 2 && !open ? "Z" : "");
  }

  // The grid as a picture: one pixel a cell, opaque where a cell is surely occupied.
  function gridPicture(grid) {
    var canvas = document.createElement("canvas");
    canvas.width = grid.columns;
    canvas.height = grid.rows;
    var context = canvas.getContext("2d"), image = context.createImageData(grid.columns, grid.rows);
    var colour = getComputedStyle(document.documentElement).getPropertyValue("--occupied").trim();
    var rgb = d3.rgb(colour);
    grid.occupied_percent.forEach(function (p, i) {
      var row = Math.floor(i / grid.columns), column = i % grid.columns;
      var at = 4 * ((grid.rows - 1 - row) * grid.columns + column);  // row 0 has the lowest y
      image.data[at] = rgb.r;
      image.data[at + 1] = rgb.g;
      image.data[at + 2] = rgb.b;
      image.data[at + 3] = Math.round(2.3 * Math.min(100, p));
    });
    context.putImageData(image, 0, 0);
    return canvas.toDataURL();
  }

  function drawMap() {
    var box = extent(), width = widthIn(mapHolder, 760);
    var spanX = box[1][0] - box[0][0], spanY = box[1][1] - box[0][1];
    var height = Math.max(220, Math.min(width * spanY / spanX, 620));
    var perMetre = Math.min(width / spanX, height / spanY);
    var cx = (box[0][0] + box[1][0]) / 2, cy = (box[0][1] + box[1][1]) / 2;
    var x = function (v) { return width / 2 + (v - cx) * perMetre; };
    var y = function (v) { return height / 2 - (v - cy) * perMetre; };
    mapHolder.html("");
    var svg = mapHolder.append("svg").attr("class", "map").attr("width", width).attr("height", height)
      .attr("role", "img").attr("aria-label", "The scene from above, with the tracked object");
    drawGridLines(svg, x, y, perMetre, width, height, cx, cy);
    svg.append("path").attr("d", path(data.view.field_of_view, x, y)).style("fill", "var(--field)")
      .style("opacity", 0.25);
    scene.surfaces.forEach(function (s) {
      svg.append("path").attr("d", path(s.outline, x, y)).style("fill", s.occluder ? "var(--occluder)" : "none")
        .style("stroke", "var(--relay)").style("stroke-width", s.relay ? 3 : 1.5);
    });
    eachObject(function (o) {
      var bx = bounds("x_m", o), by = bounds("y_m", o);
      svg.append("rect").attr("x", x(bx[0])).attr("y", y(by[1])).attr("width", x(bx[1]) - x(bx[0]))
        .attr("height", y(by[0]) - y(by[1])).style("fill", "none").style("stroke", "var(--search)")
        .style("stroke-dasharray", "4 3");
    });
    if (light && light.grid) {
      var g = light.grid;
      svg.append("image").attr("x", x(g.origin_m[0])).attr("y", y(g.origin_m[1] + g.rows * g.cell_size_m))
        .attr("width", g.columns * g.cell_size_m * perMetre).attr("height", g.rows * g.cell_size_m * perMetre)
        .attr("preserveAspectRatio", "none").attr("xlink:href", gridPicture(g));
    }
    drawTrail(svg, x, y);
    drawModes(svg, x, y, perMetre);
    svg.append("circle").attr("cx", x(data.view.position[0])).attr("cy", y(data.view.position[1])).attr("r", 5)
      .style("fill", "var(--sensor)");
    svg.append("text").attr("x", x(data.view.position[0]) + 8).attr("y", y(data.view.position[1]) + 4).text("sensor");
  }

  function drawGridLines(svg, x, y, perMetre, width, height, cx, cy) {
    var raw = 70 / perMetre, power = Math.pow(10, Math.floor(Math.log(raw) / Math.LN10));
    var step = [1, 2, 5, 10].map(function (f) { return f * power; }).filter(function (s) { return s >= raw * 0.999; })[0];
    var lines = svg.append("g");
    var halfX = width / perMetre / 2, halfY = height / perMetre / 2;
    d3.range(Math.ceil((cx - halfX) / step), (cx + halfX) / step).forEach(function (i) {
      lines.append("line").attr("x1", x(i * step)).attr("x2", x(i * step)).attr("y2", height).style("stroke", "var(--grid)");
      lines.append("text").attr("class", "soft").attr("x", x(i * step) + 3).attr("y", height - 5)
        .text(String(+(i * step).toFixed(6)).replace("-", "−") + " m");
    });
    d3.range(Math.ceil((cy - halfY) / step), (cy + halfY) / step).forEach(function (i) {
      lines.append("line").attr("y1", y(i * step)).attr("y2", y(i * step)).attr("x2", width).style("stroke", "var(--grid)");
      lines.append("text").attr("class", "soft").attr("x", 4).attr("y", y(i * step) - 3)
        .text(String(+(i * step).toFixed(6)).replace("-", "−") + " m");
    });
  }

  function drawTrail(svg, x, y) {
    var recent = history.slice(-TRAIL);
    eachObject(function (o) {
      for (var i = 1; i < recent.length; ++i) {
        if (!recent[i].pose || !recent[i - 1].pose) continue;
        svg.append("path").attr("d", path([point(recent[i - 1].pose, o), point(recent[i].pose, o)], x, y))
          .style("fill", "none").style("stroke", "var(--model)").style("stroke-width", 2)
          .style("opacity", 0.15 + 0.75 * i / recent.length);
      }
    });
  }

  function drawModes(svg, x, y, perMetre) {
    if (!latest) return;
    latest.modes.slice().reverse().forEach(function (mode, k) {
      var colour = k === latest.modes.length - 1 ? "var(--found)" : "var(--rival)";
      eachObject(function (o) {
        var at = point(mode.pose, o), e = ellipse(mode, o);
        svg.append("path").attr("d", path(placedObject(mode.pose, o), x, y)).style("fill", colour)
          .style("fill-opacity", 0.25).style("stroke", colour).style("opacity", 0.3 + 0.7 * mode.weight);
        svg.append("ellipse").attr("rx", Math.max(1.5, e.long * perMetre)).attr("ry", Math.max(1.5, e.short * perMetre))
          .attr("transform", "translate(" + x(at[0]) + "," + y(at[1]) + ") rotate(" + (-e.angle * 180 / Math.PI) + ")")
          .style("fill", "none").style("stroke", colour).style("stroke-width", 2)
          .style("opacity", 0.35 + 0.65 * mode.weight);
      });
    });
  }

  // ---------------------------------------------------------------- curves

  function drawCurve(holder, value, top, label, colour) {
    var width = widthIn(holder, 620), height = 96, margin = { left: 40, right: 6, top: 6, bottom: 18 };
    holder.html("");
    var svg = holder.append("svg").attr("width", width).attr("height", height).attr("role", "img").attr("aria-label", label);
    var end = history.length ? history[history.length - 1].time_s : 0;
    var x = d3.scale.linear().domain([end - MINUTE, end]).range([margin.left, width - margin.right]);
    var y = d3.scale.linear().domain([0, top]).range([height - margin.bottom, margin.top]);
    [0, top / 2, top].forEach(function (v) {
      svg.append("line").attr("x1", margin.left).attr("x2", width - margin.right).attr("y1", y(v)).attr("y2", y(v))
        .style("stroke", "var(--grid)");
      svg.append("text").attr("class", "soft").attr("x", margin.left - 5).attr("y", y(v) + 4).attr("text-anchor", "end")
        .text(+v.toPrecision(3));
    });
    [-60, -40, -20, 0].forEach(function (s) {
      svg.append("text").attr("class", "soft").attr("x", x(end + s)).attr("y", height - 4)
        .attr("text-anchor", s === 0 ? "end" : s === -60 ? "start" : "middle").text((s + " s").replace("-", "−"));
    });
    var points = history.filter(function (h) { return h.time_s >= end - MINUTE && finite(value(h)); })
      .map(function (h) { return [h.time_s, Math.min(top, value(h))]; });
    if (points.length > 1) {
      svg.append("path").attr("d", path(points, x, y, true)).style("fill", "none").style("stroke", colour)
        .style("stroke-width", 1.8);
    }
  }
  function drawCurves() {
    drawCurve(presenceHolder, function (h) { return h.presence_probability; }, 1, "Probability of presence over time",
              "var(--found)");
    var end = history.length ? history[history.length - 1].time_s : 0;
    var most = d3.max(history.filter(function (h) { return h.time_s >= end - MINUTE; }),
                      function (h) { return h.latency_ms || 0; }) || 1;
    var power = Math.pow(10, Math.floor(Math.log(most) / Math.LN10));
    var top = [1, 2, 5, 10].map(function (f) { return f * power; }).filter(function (t) { return t >= most; })[0];
    drawCurve(latencyHolder, function (h) { return h.latency_ms; }, top || most, "Latency over time", "var(--model)");
  }

  // ---------------------------------------------------------------- light

  function drawLight() {
    zonesHolder.html("");
    if (!light || !light.histograms) {
      element(zonesHolder, "p", "soft", "Nothing is tracked, so nothing is fitted.");
      return;
    }
    lightNote.text(look.all ? "Counts in each bin, ambient and static light included."
      : "Counts in each bin beyond the fitted ambient and static light: what the object adds.");
    var h = light.histograms, wide = widthIn(zonesHolder, 1344);
    var across = Math.min(h.columns, wide < 640 ? (h.columns > 4 ? 2 : h.columns) : 8);
    zonesHolder.style("grid-template-columns", "repeat(" + across + ", minmax(0, 1fr))");
    var width = Math.floor((wide - 12 * (across - 1)) / across), height = wide < 640 ? 84 : 110;
    h.zones.forEach(function (zone) { drawZone(zone, width, height); });
  }
  function drawZone(zone, width, height) {
    var panel = element(zonesHolder, "div", "wide-axis" + (zone.used ? "" : " unused"));
    var svg = panel.append("svg").attr("width", width).attr("height", height).attr("role", "img")
      .attr("aria-label", "Zone " + zone.zone + ": measured and fitted counts");
    var first = zone.first_bin, end = Math.max(zone.end_bin, first + 1);
    var scale = function (v) { return look.log ? Math.log(1 + Math.max(0, v)) : v; };
    var rest = zone.model.map(function (m, k) { return m - zone.object[k]; });
    var slice = function (list) {
      return list.map(function (v, k) { return look.all ? v : v - rest[k]; }).slice(first, end).map(scale);
    };
    var measured = slice(zone.measured), model = slice(zone.model);
    rest = slice(rest);
    var low = d3.min(measured.concat(model)), high = d3.max(measured.concat(model));
    if (!(high > low)) high = low + 1;
    var x = function (k) { return (width - 2) * k / (end - first) + 1; };
    var y = d3.scale.linear().domain([low, high]).range([height - 4, 16]);
    var step = function (list) {
      return "M" + list.map(function (v, k) { return x(k) + "," + y(v) + "H" + x(k + 1); }).join("L");
    };
    svg.append("rect").attr("width", width).attr("height", height).style("fill", "none").style("stroke", "var(--faint)");
    var area = model.map(function (v, k) { return x(k + 0.5) + "," + y(v); })
      .concat(rest.map(function (v, k) { return x(k + 0.5) + "," + y(v); }).reverse());
    svg.append("path").attr("d", "M" + area.join("L") + "Z").style("fill", "var(--object)").style("opacity", 0.55);
    svg.append("path").attr("d", step(measured)).style("fill", "none").style("stroke", "var(--measured)");
    svg.append("path").attr("d", "M" + model.map(function (v, k) { return x(k + 0.5) + "," + y(v); }).join("L"))
      .style("fill", "none").style("stroke", "var(--model)").style("stroke-width", 1.4);
    svg.append("text").attr("class", "soft").attr("x", 5).attr("y", 12).text("zone " + zone.zone);
  }

  // ---------------------------------------------------------------- numbers

  function positionText(mode) {
    return ["x_m", "y_m"].filter(function (name) { return place(name, 0) >= 0; }).map(function (name) {
      var i = place(name, 0);
      return fixed(mode.pose[i], Math.sqrt(mode.covariance[i][i]));
    }).join(", ");
  }
  function speedOf(track) {
    if (!track || !track.velocity) return NaN;
    var sum = 0, any = false;
    track.velocity.forEach(function (v) { if (finite(v)) { sum += v * v; any = true; } });
    return any ? Math.sqrt(sum) : NaN;
  }
  function sentence() {
    if (!latest) return "State: " + status.state + ".";
    if (latest.error) return "The latest frame could not be used: " + latest.error;
    var name = objects.length > 1 ? "objects" : objects[0].name || "object";
    if (!latest.modes.length) {
      return "Nothing is tracked. Probability that the " + name + " is there: " + percent(latest.presence_probability) + ".";
    }
    var mode = latest.modes[0], e = ellipse(mode, 0);
    return "The " + name + " is there (" + percent(latest.presence_probability) + "), at " + positionText(mode) +
      " m; 95 % within " + fixed(e.long, e.long) + " m by " + fixed(e.short, e.short) + " m" +
      (latest.modes.length > 1 ? "; " + (latest.modes.length - 1) + " rival explanation" +
        (latest.modes.length > 2 ? "s" : "") : "") + ".";
  }
  function drawNumbers() {
    subtitle.text("Input " + data.input + " · " + status.state);
    headline.text(sentence());
    shown.Frames.text(status.counts.frames || 0);
    shown.Skipped.text(status.counts.skipped_frames || 0);
    shown["Answers / s"].text(finite(status.answers_per_s) ? status.answers_per_s.toFixed(1) : "–");
    if (latest) {
      shown.Presence.text(percent(latest.presence_probability));
      shown["Position (m)"].text(latest.modes.length ? positionText(latest.modes[0]) : "–");
      shown["Speed (m/s)"].text(fixed(speedOf(latest.track)));
      shown["Latency (ms)"].text(finite(latest.latency_ms) ? latest.latency_ms.toFixed(1) : "–");
      shown["Time (s)"].text(finite(latest.time_s) ? latest.time_s.toFixed(1) : "–");
    }
    countList.html("");
    Object.keys(status.counts).forEach(function (name) {
      if (!status.counts[name] && name !== "skipped_frames") return;
      element(countList, "dt", "", name.replace(/_/g, " "));
      element(countList, "dd", "", status.counts[name]);
    });
  }

  // ---------------------------------------------------------------- events

  function drawAll() { drawMap(); drawCurves(); drawNumbers(); drawLight(); }
  var due = {};
  // At most one drawing of a kind in a picture of the screen, and none where nobody looks.
  function draw(kind, action) {
    if (due[kind] || look.paused) return;
    due[kind] = true;
    window.requestAnimationFrame(function () {
      due[kind] = false;
      action();
    });
  }
  function remember(answer) {
    history.push({ time_s: answer.time_s, presence_probability: answer.presence_probability,
                   latency_ms: answer.latency_ms, pose: answer.modes && answer.modes.length ? answer.modes[0].pose : null });
    if (history.length > MOST_POINTS) history.splice(0, history.length - MOST_POINTS);
  }
  function listen() {
    var events = new EventSource("events");
    events.addEventListener("history", function (e) { history = JSON.parse(e.data); });
    events.addEventListener("status", function (e) {
      status = JSON.parse(e.data);
      draw("numbers", drawNumbers);
    });
    events.addEventListener("answer", function (e) {
      latest = JSON.parse(e.data);
      remember(latest);
      draw("map", function () { drawMap(); drawCurves(); drawNumbers(); });
    });
    events.addEventListener("light", function (e) {
      light = JSON.parse(e.data);
      draw("light", drawLight);
    });
    events.onerror = function () {
      status.state = "no connection to blindcorner live; trying again";
      draw("numbers", drawNumbers);
    };
  }
  var resize = null;
  window.addEventListener("resize", function () {
    window.clearTimeout(resize);
    resize = window.setTimeout(drawAll, 150);
  });
  drawAll();
  listen();
}());
