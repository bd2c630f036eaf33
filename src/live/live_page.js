// SPDX-License-Identifier: Apache-2.0
// Draws what `blindcorner live` sends: bird's-eye view, presence, light, counts. Needs D3 version 3,
// poses.js, scene_parts.js, the JSON in #data and server-sent events from the same server; no other network. Lengths are
// metres, angles radians.
(function () {
  "use strict";

  var data = JSON.parse(document.getElementById("data").textContent);
  var scene = data.scene, objects = scene.objects, unknowns = data.unknowns;
  var parts = SceneParts(scene, unknowns), element = parts.element, fixed = parts.fixed;
  var widthIn = parts.widthIn, SWATCH = parts.SWATCH;
  var poses = parts.poses, finite = poses.finite, place = poses.place, point = poses.point;
  var eachObject = poses.eachObject, ellipse = poses.ellipse;
  var TRAIL = 60;        // answers that the trail shows
  var MINUTE = 60;       // seconds that the curves show
  var MOST_POINTS = 3600;
  var latest = null, light = null, status = { counts: {}, state: "connecting" };
  var history = [];      // {time_s, presence_probability, pose, latency_ms}
  var look = { log: false, paused: false, all: false };

  function percent(p) {
    if (!finite(p)) return "–";
    if (p > 0.999 && p < 1) return "> 99.9 %";
    return (100 * p).toFixed(p < 0.1 || (p > 0.99 && p < 1) ? 1 : 0) + " %";
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
  var several = objects.length > 1;
  parts.legend(left, [
    SWATCH.heaviest.slice(0, 2).concat("heaviest mode, 95 %" + (several ? ", of each object" : "")),
    SWATCH.rival.slice(0, 2).concat("rival modes"),
    ["rect", parts.merged(parts.AREA, { fill: "var(--occupied)" }), "cells that may be occupied"],
    ["path", { d: "M2,7H24", stroke: parts.COLOUR.model, "stroke-width": 2 }, "where it was"],
    SWATCH.sensor, SWATCH.field].concat(parts.surfaceEntries(), [SWATCH.search]));
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
  parts.legend(lightSection, [
    ["path", { d: "M2,10h6v-6h8v4h8", fill: "none", stroke: parts.COLOUR.measured }, "measured"],
    ["path", { d: "M2,7H24", stroke: parts.COLOUR.model, "stroke-width": 2 }, "fitted"],
    ["rect", parts.merged(parts.AREA, { fill: parts.COLOUR.object, "fill-opacity": 0.55 }), "of the object"]]);
  var zonesHolder = element(lightSection, "div", "zones");

  // ---------------------------------------------------------------- map

  function extent() {
    var points = [data.view.position];
    eachObject(function (o) {
      var reach = d3.max(objects[o].outline, function (p) { return Math.sqrt(p[0] * p[0] + p[1] * p[1]); }) || 0;
      points = points.concat(parts.extentOf(parts.searchRegion(o), 0, reach));
    });
    data.view.zones.forEach(function (zone) { points = points.concat(d3.merge(zone)); });
    return parts.extentOf(points, 0.06, 0);
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

  var map = null, picture = { grid: null, address: null };
  // The map keeps what was moved or enlarged until the page has another width.
  function makeMap() {
    var box = extent(), width = widthIn(mapHolder, 760);
    mapHolder.html("");
    map = new parts.Map(mapHolder, { width: width, height: parts.heightFor(box, width, 260, 620),
      label: "The scene from above, with the tracked object", draw: drawContent });
    map.show(box);
  }
  function drawContent(group, x, y, perMetre) {
    if (light && light.grid) {
      var g = light.grid;
      if (g !== picture.grid) picture = { grid: g, address: gridPicture(g) };
      group.append("image").attr({ x: x(g.origin_m[0]), y: y(g.origin_m[1] + g.rows * g.cell_size_m),
        width: g.columns * g.cell_size_m * perMetre, height: g.rows * g.cell_size_m * perMetre,
        preserveAspectRatio: "none", "xlink:href": picture.address });
    }
    parts.drawSurroundings(group, x, y, [data.view]);
    drawTrail(group, x, y);
    if (!latest) return;
    latest.modes.map(function (mode, i) { return [mode, i]; }).reverse().forEach(function (pair) {
      eachObject(function (o) {
        if (parts.holds(pair[0].pose, o)) parts.drawMode(group, x, y, perMetre, pair[0], pair[1] === 0, o);
      });
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
    var panel = element(zonesHolder, "div", "zone-panel" + (zone.used ? "" : " unused"));
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

  function drawAll() { map.draw(); drawCurves(); drawNumbers(); drawLight(); }
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
      draw("map", function () { map.draw(); drawCurves(); drawNumbers(); });
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
    resize = window.setTimeout(function () { makeMap(); drawAll(); }, 150);
  });
  makeMap();
  drawAll();
  listen();
}());
