// SPDX-License-Identifier: Apache-2.0
// Draws the result of a fit: bird's-eye view, histograms, tables. Needs D3 version 3, poses.js,
// scene_parts.js and the JSON in #data; no network. Lengths are metres, angles radians.
(function () {
  "use strict";

  var data = JSON.parse(document.getElementById("data").textContent);
  var scene = data.scene;
  var captures = data.result.captures;
  var objects = scene.objects;
  var unknowns = data.result.unknowns;
  var parts = SceneParts(scene, unknowns), poses = parts.poses, finite = poses.finite, place = poses.place;
  var point = poses.point, freeInPlane = poses.freeInPlane;
  var eachObject = poses.eachObject, ellipse = poses.ellipse, placedObject = poses.placedObject;
  var COLOUR = parts.COLOUR, AREA = parts.AREA, SWATCH = parts.SWATCH, Map = parts.Map;
  var digits = parts.digits, fixed = parts.fixed, compact = parts.compact;
  var element = parts.element, merged = parts.merged, button = parts.button, scrolling = parts.scrolling;
  var widthIn = parts.widthIn, polygon = parts.polygon, legend = parts.legend, holds = parts.holds;
  var extentOf = parts.extentOf, searchRegion = parts.searchRegion, heightFor = parts.heightFor;
  var surfaceEntries = parts.surfaceEntries, drawEllipse = parts.drawEllipse;
  var arrowLength = parts.arrowLength, facing = parts.facing, drawMode = parts.drawMode;
  // Dark to light through blue and green to yellow: monotone in lightness.
  var TRACK = ["#30123b", "#3b528b", "#21918c", "#5ec962", "#d8c419"];

  var chosen = 0;    // index into captures
  var inJoint = 0;   // capture within a joint fit
  var look = { log: false, window: true, background: true, shared: false, axis: "ns" };
  var LIGHT_M_PER_NS = 0.299792458;
  var printing = false;

  // ---------------------------------------------------------------- numbers and words

  function unit(name) { return /_m$/.test(name) ? "m" : /_rad$/.test(name) ? "rad" : ""; }
  // Readers see degrees.
  function shownUnit(name) { return unit(name) === "rad" ? "°" : unit(name); }
  function shown(name, value) { return unit(name) === "rad" && finite(value) ? value * 180 / Math.PI : value; }
  function titleOf(name) { return bare(name) + (unit(name) ? " (" + shownUnit(name) + ")" : ""); }
  function bare(name) { return name.replace(/_(m|rad)$/, "").replace(".", " "); }

  function probability(p) {
    if (!finite(p)) return "–";
    if (p < 1e-6) return "< 10⁻⁶";
    if (p > 0 && p < 0.001) return p.toExponential(1).replace("-", "−");
    if (p < 1 && p > 0.999999) return "> 0.999999";
    return p.toFixed(p > 0.99 && p < 1 ? 1 + Math.ceil(-Math.log(1 - p) / Math.LN10) : 3);
  }
  function milliseconds(t) {
    if (!finite(t)) return "–";
    return t >= 1000 ? (t / 1000).toFixed(2) + " s" : t.toFixed(t < 10 ? 2 : t < 100 ? 1 : 0) + " ms";
  }
  function length(metres) {
    if (!finite(metres)) return "–";
    if (metres < 0.001) return (metres * 1e6).toFixed(0) + " µm";
    if (metres < 0.1) return (metres * 1000).toFixed(metres < 0.01 ? 2 : 1) + " mm";
    return metres.toFixed(3) + " m";
  }
  function sourceOf(capture, j) {
    var source = Array.isArray(capture.source) ? capture.source[j] : capture.source;
    var index = Array.isArray(capture.index) ? capture.index[j] : capture.index;
    return (source || "capture").split("/").pop() + (index === null || index === undefined ? ""
      : " [" + index + "]");
  }
  function nameOf(capture) {
    return Array.isArray(capture.source) ? capture.source.length + " captures, fitted jointly"
      : sourceOf(capture, 0);
  }
  function isJoint(capture) { return Array.isArray(capture.source); }
  function quantile(sorted, p) { return sorted.length ? d3.quantile(sorted, p) : NaN; }

  // ---------------------------------------------------------------- poses

  function objectOf(name) {
    for (var o = 0; o < objects.length; ++o) {
      if (objects[o].prefix && name.indexOf(objects[o].prefix) === 0) return o;
    }
    return 0;
  }
  function difference(name, a, b) {
    if (!/yaw_rad$/.test(name)) return a - b;
    var period = objects[objectOf(name)].yaw_period;
    if (!(period > 0)) return 0;
    return a - b - period * Math.round((a - b) / period);
  }
  // Distance of an object from the truth over its unknown coordinates, m.
  function positionError(capture, vector, o) {
    if (!capture.truth || !vector) return NaN;
    var sum = 0, any = false;
    unknowns.forEach(function (name, i) {
      if (unit(name) !== "m" || objectOf(name) !== o) return;
      sum += Math.pow(finite(capture.truth[i]) && finite(vector[i]) ? vector[i] - capture.truth[i] : NaN, 2);
      any = true;
    });
    return any ? Math.sqrt(sum) : NaN;
  }
  // Standard deviation of an object's position over its unknown coordinates, m.
  function positionSigma(mode, o) {
    var sum = 0, any = false;
    unknowns.forEach(function (name, i) {
      if (unit(name) === "m" && objectOf(name) === o) { sum += mode.covariance[i][i]; any = true; }
    });
    return any ? Math.sqrt(sum) : NaN;
  }
  function heaviest(capture) { return capture.modes.length ? capture.modes[0] : null; }
  // Whether the fit found something. If not, its modes are places where an object cannot be
  // excluded.
  function found(capture) {
    return capture.modes.length > 0 && capture.flags.indexOf("nothing_detected") < 0 &&
      capture.flags.indexOf("no_photons") < 0;
  }
  // Whether the truth lies in the mode's 95 % ellipse (interval) in the plane; null if unknown.
  function covers(capture, o) {
    var mode = heaviest(capture);
    if (!mode || !capture.truth || !freeInPlane(o) || !holds(mode.pose, o) || !holds(capture.truth, o)) return null;
    var e = ellipse(mode, o), p = point(mode.pose, o), t = point(capture.truth, o);
    var dx = t[0] - p[0], dy = t[1] - p[1], c = Math.cos(e.angle), s = Math.sin(e.angle);
    var u = (c * dx + s * dy) / Math.max(e.long, 1e-12);
    var v = freeInPlane(o) === 2 ? (c * dy - s * dx) / Math.max(e.short, 1e-12) : 0;
    return u * u + v * v <= 1;
  }

  // ---------------------------------------------------------------- small helpers

  var tip = d3.select("body").append("div").attr("class", "tip");
  function showTip(lines) {
    tip.html("").style("display", "block");
    lines.forEach(function (line) { tip.append("div").text(line); });
    var x = d3.event.pageX + 14, y = d3.event.pageY + 12;
    if (x + 240 > window.innerWidth + window.pageXOffset) x = d3.event.pageX - 250;
    tip.style("left", x + "px").style("top", y + "px");
  }
  function hideTip() { tip.style("display", "none"); }

  // ---------------------------------------------------------------- map

  function viewsOf(numbers) { return numbers.map(function (v) { return data.views[v]; }); }
  // Places of a pose's objects.
  function placesOf(vector) {
    var list = [];
    eachObject(function (o) { if (holds(vector, o)) list.push(point(vector, o)); });
    return list;
  }
  // Extent of what the picture is about: sensors, what they see, the search region, modes and
  // truths. With `surfaces` it also holds all known surfaces, which may be much larger.
  function sceneExtent(viewNumbers, surfaces) {
    var points = [];
    eachObject(function (o) { points = points.concat(searchRegion(o)); });
    if (surfaces) scene.surfaces.forEach(function (s) { points = points.concat(s.outline); });
    viewNumbers.forEach(function (v) {
      points.push(data.views[v].position);
      data.views[v].zones.forEach(function (zone) { points = points.concat(d3.merge(zone)); });
    });
    captures.forEach(function (c) {
      c.modes.forEach(function (m) { points = points.concat(placesOf(m.pose)); });
      if (c.truth) points = points.concat(placesOf(c.truth));
    });
    return extentOf(points, surfaces ? 0.05 : 0.1, 0.05);
  }
  // Surroundings of an object of a mode: 1.7 times its ellipse, and the truth if that is near.
  function around(mode, truth, o) {
    var e = ellipse(mode, o), p = point(mode.pose, o), r = Math.max(1.7 * e.long, 1e-4);
    var points = [[p[0] - r, p[1] - r], [p[0] + r, p[1] + r]];
    if (truth && holds(truth, o)) {
      var t = point(truth, o);
      if (Math.sqrt(Math.pow(t[0] - p[0], 2) + Math.pow(t[1] - p[1], 2)) < 8 * r) points.push(t);
    }
    return extentOf(points, 0.08, 0);
  }

  function drawTruth(group, x, y, vector) {
    eachObject(function (o) {
      if (!holds(vector, o)) return;
      var p = point(vector, o), cx = x(p[0]), cy = y(p[1]);
      group.append("path").attr({ d: polygon(placedObject(vector, o), x, y), fill: "none",
                                  stroke: COLOUR.truth, "stroke-width": 1.4, "stroke-dasharray": "4,3" });
      [COLOUR.paper, COLOUR.truth].forEach(function (colour, i) {
        group.append("path").attr({ d: "M" + (cx - 8) + "," + cy + "h16M" + cx + "," + (cy - 8) + "v16",
                                    stroke: colour, "stroke-width": i ? 2.4 : 5, fill: "none" });
      });
    });
  }
  // Where nothing was found, no mode is drawn as if it were known.
  function drawModes(group, x, y, perMetre, capture) {
    if (!found(capture)) {
      var middle = searchRegion(0);
      group.append("text").attr({ x: (x(middle[0][0]) + x(middle[2][0])) / 2, y: (y(middle[0][1]) + y(middle[2][1])) / 2 + 4,
        "text-anchor": "middle", "class": "soft", "font-size": 13 }).text("nothing found");
      return;
    }
    capture.modes.map(function (mode, i) { return [mode, i]; }).reverse().forEach(function (pair) {
      eachObject(function (o) {
        if (holds(pair[0].pose, o)) drawMode(group, x, y, perMetre, pair[0], pair[1] === 0, o);
      });
    });
    labelModes(group, x, y, perMetre, capture);
  }
  // Boxes [left, top, right, bottom] in pixels.
  function boxAround(points) {
    var xs = d3.extent(points, function (p) { return p[0]; }), ys = d3.extent(points, function (p) { return p[1]; });
    return [xs[0], ys[0], xs[1], ys[1]];
  }
  function overlap(a, b) {
    return Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));
  }
  function ellipseBox(x, y, perMetre, mode, o) {
    var e = ellipse(mode, o), p = point(mode.pose, o), c = Math.cos(e.angle), s = Math.sin(e.angle);
    var w = Math.max(3, perMetre * Math.sqrt(e.long * e.long * c * c + e.short * e.short * s * s));
    var h = Math.max(3, perMetre * Math.sqrt(e.long * e.long * s * s + e.short * e.short * c * c));
    return [x(p[0]) - w, y(p[1]) - h, x(p[0]) + w, y(p[1]) + h];
  }
  function outlineBox(x, y, vector, o) {
    return boxAround(placedObject(vector, o).map(function (p) { return [x(p[0]), y(p[1])]; }));
  }
  // What labels should not cover: ellipses and outlines of the modes, arrows, and the truth.
  function drawnBoxes(x, y, perMetre, capture) {
    var boxes = [];
    eachObject(function (o) {
      capture.modes.forEach(function (mode) {
        if (!holds(mode.pose, o)) return;
        boxes.push(ellipseBox(x, y, perMetre, mode, o), outlineBox(x, y, mode.pose, o));
        if (!facing(mode, o)) return;
        var p = point(mode.pose, o), yaw = mode.pose[place("yaw_rad", o)], r = arrowLength(perMetre);
        boxes.push(boxAround([0.4, 0.7, 1].map(function (f) {
          return [x(p[0]) + f * r * Math.cos(yaw), y(p[1]) - f * r * Math.sin(yaw)];
        })));
      });
      if (capture.truth && holds(capture.truth, o)) boxes.push(outlineBox(x, y, capture.truth, o));
    });
    return boxes;
  }
  // Place of a label beside its mode's box `own`: the one in the picture that covers least of what
  // is drawn.
  function labelPlace(own, size, taken, x, y) {
    var w = size[0], h = size[1], gap = 4, cx = (own[0] + own[2]) / 2, cy = (own[1] + own[3]) / 2;
    var corners = [[cx - w / 2, own[1] - gap - h], [own[0] - gap - w, cy - h / 2], [own[2] + gap, cy - h / 2],
                   [cx - w / 2, own[3] + gap], [own[2], own[1] - h], [own[0] - w, own[1] - h]];
    var boxes = corners.map(function (at) { return [at[0], at[1], at[0] + w, at[1] + h]; }).filter(function (box) {
      return box[0] >= 0 && box[1] >= 0 && box[2] <= x.range()[1] && box[3] <= y.range()[0];
    });
    // A mode that is enlarged beyond the picture has its label at its centre.
    if (!boxes.length) return [cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2];
    function covered(box) { return d3.sum(taken, function (other) { return overlap(box, other); }); }
    return boxes.reduce(function (best, box) { return covered(box) < covered(best) ? box : best; });
  }
  function labelModes(group, x, y, perMetre, capture) {
    var labels = [], drawn = drawnBoxes(x, y, perMetre, capture);
    capture.modes.slice(0, 12).forEach(function (mode, i) {
      eachObject(function (o) {
        if (!holds(mode.pose, o) || (i > 0 && o > 0)) return;
        var share = mode.weight < 0.01 ? "< 1" : (100 * mode.weight).toFixed(mode.weight > 0.995 ? 1 : 0);
        var text = (i + 1) + ": " + share + " %";
        if (objects.length > 1) text = objects[o].name + (o === 0 ? ", " + text : "");
        var size = [6.6 * text.length, 13];
        var own = ellipseBox(x, y, perMetre, mode, o), outline = outlineBox(x, y, mode.pose, o);
        own = boxAround([own.slice(0, 2), own.slice(2), outline.slice(0, 2), outline.slice(2)]);
        var box = labelPlace(own, size, drawn.concat(labels), x, y);
        if (labels.some(function (other) { return overlap(box, other) > 0; })) return;
        labels.push(box);
        group.append("text").attr({ x: (box[0] + box[2]) / 2, y: box[3] - 3, "text-anchor": "middle", "class": "mode-label",
          "font-weight": i ? 400 : 700, stroke: COLOUR.paper, "stroke-width": 3, "paint-order": "stroke" })
          .style("fill", i ? COLOUR.rival : COLOUR.heaviest).text(text);
      });
    });
  }

  function region(o) { return "95 % " + (freeInPlane(o || 0) === 1 ? "interval" : "ellipse"); }
  function mapLegend(parent, capture, first) {
    var entries = first || [];
    if (found(capture)) entries.push(SWATCH.heaviest.slice(0, 2).concat("found: " + region() + " and outline"));
    if (found(capture) && capture.modes.length > 1) entries.push(SWATCH.rival);
    if (capture.truth) entries.push(SWATCH.truth);
    if (found(capture) && objects.some(function (unused, o) { return facing(capture.modes[0], o); })) {
      entries.push(SWATCH.yaw);
    }
    legend(parent, entries.concat([SWATCH.sensor, SWATCH.field], surfaceEntries(), [SWATCH.search]));
  }

  // ---------------------------------------------------------------- the answer for one capture

  function drawAnswer(parent, capture) {
    if (capture.error) {
      element(parent, "div", "error", capture.error);
      return;
    }
    var facts = element(parent, "dl", "facts");
    function fact(name, fill) { element(facts, "dt", "", name); fill(element(facts, "dd")); }
    fact("object present", function (dd) {
      var p = capture.presence_probability;
      dd.append("span").attr("class", "bar").append("i")
        .style("width", 100 * (finite(p) ? p : 0) + "%");
      dd.append("b").text(probability(p));
      dd.append("span").attr("class", "soft").text("  prior " + probability(scene.presence_prior));
    });
    fact("false alarm", function (dd) {
      dd.append("span").text(probability(capture.false_alarm_probability));
      dd.append("span").attr("class", "soft").text("  chance that an empty scene looks like this");
    });
    var g = capture.goodness_of_fit;
    fact("goodness of fit", function (dd) {
      var z = (g.deviance - g.expected) / g.standard_deviation;
      dd.append("b").text(finite(z) ? (z >= 0 ? "+" : "−") + Math.abs(z).toFixed(1) + " σ" : "–");
      dd.append("span").attr("class", "soft").text("  deviance " + fixed(g.deviance, 10) + ", expected " +
        fixed(g.expected, 10) + " ± " + fixed(g.standard_deviation, 10) +
        (g.inflation > 1.005 ? "; covariance × " + g.inflation.toFixed(2) : ""));
    });
    eachObject(function (o) {
      var error = positionError(capture, capture.modes.length ? capture.modes[0].pose : null, o);
      if (!finite(error)) return;
      fact(objects.length > 1 ? "error, " + objects[o].name : "error", function (dd) {
        dd.append("b").text(length(error));
        var inside = covers(capture, o);
        dd.append("span").attr("class", "soft").text("  heaviest mode to truth" + (inside === null ? ""
          : inside ? "; truth inside the " + region(o) : "; truth outside the " + region(o)));
      });
    });
    fact("flags", function (dd) {
      if (!capture.flags.length) dd.append("span").attr("class", "soft").text("none");
      capture.flags.forEach(function (flag) { element(dd, "span", "flag", flag); });
    });
    fact("time", function (dd) {
      var t = capture.time_ms;
      dd.append("b").text(milliseconds(t.total));
      dd.append("span").attr("class", "soft").text("  " + ["prepare", "score", "refine", "uncertainty", "detect"]
        .filter(function (s) { return t[s] > 0; })
        .map(function (s) { return s + " " + milliseconds(t[s]); }).join(", "));
    });
  }

  function cell(row, value, sigma, open) {
    var td = row.append("td");
    td.append("span").text(fixed(value, sigma));
    if (sigma !== undefined) td.append("small").text(" ± " + fixed(sigma, sigma));
    if (open) td.append("small").text(" open");
    return td;
  }
  function drawModeTable(parent, capture) {
    if (!capture.modes.length) return;
    element(parent, "h2", "", "Modes").append("small").text((found(capture) ? ""
      : "nothing was found: these are only what the search region and the light leave open; ") +
      "mean ± standard deviation; “open”: the data left this unknown to its prior");
    var table = scrolling(element(parent, "div", "wide"), "table of modes").append("table").attr("class", "stacked"), head = table.append("thead").append("tr");
    var titles = ["mode", "weight"].concat(unknowns.map(titleOf), "log likelihood");
    if (capture.truth) eachObject(function (o) {
      titles.push(objects.length > 1 ? objects[o].name + " to truth" : "distance to truth");
    });
    titles.forEach(function (title) { head.append("th").text(title); });
    var body = table.append("tbody");
    capture.modes.forEach(function (mode, i) {
      var row = body.append("tr").attr("class", i ? "" : "heaviest");
      row.append("td").text(i + 1).style("color", i ? COLOUR.rival : COLOUR.heaviest);
      row.append("td").text((100 * mode.weight).toFixed(mode.weight < 0.01 ? 3 : 1) + " %");
      unknowns.forEach(function (name, k) {
        cell(row, shown(name, mode.pose[k]), shown(name, Math.sqrt(mode.covariance[k][k])),
             mode.undetermined.indexOf(name) >= 0);
      });
      var drop = mode.log_likelihood - capture.modes[0].log_likelihood;
      row.append("td").text(!finite(drop) ? "–" : i ? (drop < 0 ? "−" : "+") + Math.abs(drop).toFixed(2)
        : fixed(mode.log_likelihood, 0.1));
      if (capture.truth) eachObject(function (o) {
        row.append("td").text(length(positionError(capture, mode.pose, o)));
      });
    });
    if (capture.truth) {
      var row = body.append("tr").attr("class", "truth");
      row.append("td").text("truth");
      row.append("td").text("");
      unknowns.forEach(function (name, k) {
        var mode = capture.modes[0];
        cell(row, shown(name, capture.truth[k]), undefined).append("small").text(finite(capture.truth[k])
          ? "  (heaviest " + signed(shown(name, difference(name, mode.pose[k], capture.truth[k])),
                                    shown(name, Math.sqrt(mode.covariance[k][k]))) + ")" : "");
      });
      row.append("td");
      eachObject(function () { row.append("td"); });
    }
    // On a narrow screen a row becomes a list, with each value beside its title (page.css).
    body.selectAll("tr").each(function () {
      d3.select(this).selectAll("td").attr("data-title", function (unused, k) { return titles[k]; });
    });
  }
  function signed(value, sigma) {
    return (value < 0 ? "−" : "+") + Math.abs(value).toFixed(digits(sigma));
  }

  // ---------------------------------------------------------------- histograms

  function variance(zone, mean) {
    return Math.max(zone.variance_floor + zone.variance_per_count * Math.max(mean, 0), 1e-30);
  }
  function pearson(zone, k) {
    return (zone.measured[k] - zone.model[k]) / Math.sqrt(variance(zone, zone.model[k]));
  }
  function binRange(h) {
    var bins = h.zones[0].measured.length;
    if (!look.window || !(h.end_bin > h.first_bin)) return [0, bins];
    return [Math.max(0, h.first_bin - 1), Math.min(bins, h.end_bin + 1)];
  }
  // Counts as they are, or less the light that is not the object's (direct return and ambient).
  function shownValues(zone, key, k) {
    var other = look.background ? zone.model[k] - zone.object[k] : 0;
    return zone[key][k] - other;
  }
  // Standard deviation of the light that is subtracted (direct return and ambient).
  function otherNoise(zone, k) { return Math.sqrt(variance(zone, zone.model[k] - zone.object[k])); }
  function usualNoise(zone) {
    if (zone.usual_noise === undefined) {
      zone.usual_noise = d3.median(d3.range(zone.first_bin, zone.end_bin), function (k) { return otherNoise(zone, k); }) || 0;
    }
    return zone.usual_noise;
  }
  // Whether the noise of the subtracted light is large against an axis, and against that of most
  // bins. The latter is asked because an empty zone has noise in all bins.
  function drowned(zone, k, height) {
    if (!look.background || !zone.used) return false;
    return otherNoise(zone, k) > Math.max(height / 8, 3 * usualNoise(zone));
  }
  function yRange(h, zones, range) {
    var low = Infinity, high = -Infinity, positive = Infinity;
    // The scale suits the bins that entered the fit. Others may hold the direct return's peak.
    function bins(zone) {
      var first = Math.max(range[0], zone.first_bin), end = Math.min(range[1], zone.end_bin);
      return zone.used && end > first ? [first, end] : range;
    }
    zones.forEach(function (zone) {
      for (var k = bins(zone)[0]; k < bins(zone)[1]; ++k) {
        ["measured", "model"].forEach(function (key) {
          var v = shownValues(zone, key, k);
          if (!finite(v)) return;
          low = Math.min(low, v);
          high = Math.max(high, v);
          if (v > 0) positive = Math.min(positive, v);
        });
      }
    });
    if (!(high > low)) { high = (finite(high) ? high : 0) + 1; low = Math.min(low, 0); }
    if (look.log) return [Math.max(positive === Infinity ? 0.1 : positive * 0.8, high * 1e-6), high * 1.3];
    if (look.background) {
      // Where the subtracted light was strong, its noise would dwarf the signal. The scale
      // therefore suits the object's light and the bins that are quiet against it.
      var values = [], quiet = [], top = 0, noise = 4 * d3.max(zones, usualNoise);
      zones.forEach(function (zone) {
        for (var k = bins(zone)[0]; k < bins(zone)[1]; ++k) {
          values.push(shownValues(zone, "measured", k));
          top = Math.max(top, zone.object[k]);
        }
      });
      values = values.filter(finite).sort(d3.ascending);
      var most = Math.min(high, Math.max(1.6 * top, 1.3 * quantile(values, 0.95), noise));
      zones.forEach(function (zone) {
        for (var k = bins(zone)[0]; k < bins(zone)[1]; ++k) {
          if (!drowned(zone, k, most)) quiet.push(shownValues(zone, "measured", k));
        }
      });
      quiet = quiet.filter(finite);
      high = Math.min(most, Math.max(1.05 * top, quiet.length ? d3.max(quiet) : most));
      low = Math.max(-Math.max(0.5 * high, noise), quiet.length ? d3.min(quiet) : low);
      return [1.1 * Math.min(0, low), high > 0 ? high * 1.06 : 1];
    }
    return [Math.min(0, low), high * 1.06];
  }
  // A stepped line through the bins that are `wanted` (without it, all), one line for each run of
  // bins.
  function steps(values, range, x, y, wanted) {
    var path = "", going = false;
    for (var k = range[0]; k < range[1]; ++k) {
      if (wanted && !wanted(k)) { going = false; continue; }
      var top = y(values(k));
      path += (going ? "L" : "M") + x(k) + "," + top + "L" + x(k + 1) + "," + top;
      going = true;
    }
    return path;
  }
  function band(low, high, range, x, y) {
    var there = "", back = "";
    for (var k = range[0]; k < range[1]; ++k) {
      there += (there ? "L" : "M") + x(k) + "," + y(high(k)) + "L" + x(k + 1) + "," + y(high(k));
      back = "L" + x(k + 1) + "," + y(low(k)) + "L" + x(k) + "," + y(low(k)) + back;
    }
    return there + back + "Z";
  }

  function drawZone(parent, h, zone, size, shared) {
    var box = element(parent, "div", "zone-panel" + (zone.used ? "" : " unused"));
    var residual = 36, gap = 5;
    var limitsFirst = shared || yRange(h, [zone], binRange(h));
    var labels = (look.log ? logTicks(limitsFirst) : d3.scale.linear().domain(limitsFirst).ticks(3)).map(compact);
    var widest = Math.max.apply(null, labels.map(function (t) { return t.length; }).concat(3));
    var margin = { left: 12 + 6 * widest, right: 4, top: 16, bottom: 16 };
    var w = size.w - margin.left - margin.right;
    var top = size.h - margin.top - margin.bottom - residual - gap;
    var range = binRange(h), limits = limitsFirst;
    var svg = box.append("svg").attr({ width: size.w, height: size.h, role: "img",
      "aria-label": "zone " + zone.zone + ": measured and fitted counts" });
    var g = svg.append("g").attr("transform", "translate(" + margin.left + "," + margin.top + ")");
    var x = d3.scale.linear().domain(range).range([0, w]);
    var y = (look.log ? d3.scale.log() : d3.scale.linear()).domain(limits).range([top, 0]).clamp(true);
    function value(v) { return y(look.log ? Math.max(v, limits[0]) : v); }
    function at(key) { return function (k) { return shownValues(zone, key, k); }; }

    [[range[0], zone.first_bin], [zone.end_bin, range[1]]].forEach(function (outside) {
      if (!zone.used || outside[1] <= outside[0]) return;
      g.append("rect").attr({ x: x(outside[0]), width: x(outside[1]) - x(outside[0]), height: top, fill: COLOUR.shade });
    });
    g.append("path").attr({ d: band(function (k) { return shownValues(zone, "model", k) - zone.object[k]; },
      at("model"), range, x, value), fill: COLOUR.object, "fill-opacity": 0.55 });
    // Curves are cut off at the edge of the box, not drawn along it.
    var clipId = "bins" + drawZone.count++;
    g.append("clipPath").attr("id", clipId).append("rect").attr({ width: w, height: top });
    var clipped = g.append("g").attr("clip-path", "url(#" + clipId + ")");
    var free = y.copy().clamp(false), height = limits[1] - limits[0];
    function line(v) { return look.log ? value(v) : Math.max(-top, Math.min(2 * top, free(v))); }
    function noisy(k) { return drowned(zone, k, height); }
    clipped.append("path").attr({ d: steps(at("measured"), range, x, line, noisy), fill: "none",
                                  "class": "drowned", stroke: COLOUR.edge, "stroke-width": 1 });
    clipped.append("path").attr({ d: steps(at("measured"), range, x, line, function (k) { return !noisy(k); }),
                                  fill: "none", stroke: COLOUR.measured, "stroke-width": 1 });
    g.append("path").attr({ d: "M0,0H" + w + "V" + top + "H0", fill: "none", stroke: COLOUR.grid,
                            "shape-rendering": "crispEdges" });
    g.append("path").attr({ d: steps(at("model"), range, x, value), fill: "none", stroke: COLOUR.model,
                            "stroke-width": 1.5 });
    var yTicks = look.log ? logTicks(limits) : y.ticks(3);
    var yAxis = g.append("g").attr("class", "axis");
    yAxis.append("path").attr("d", "M0,0V" + top);
    yTicks.forEach(function (t) {
      yAxis.append("line").attr({ x1: -3, x2: 0, y1: y(t), y2: y(t) });
      yAxis.append("text").attr({ x: -5, y: y(t) + 4, "text-anchor": "end", "font-size": 10 }).text(compact(t));
    });
    drawResiduals(g.append("g").attr("transform", "translate(0," + (top + gap) + ")"), h, zone, range, x, w, residual);
    var xAxis = g.append("g").attr("class", "axis").attr("transform", "translate(0," + (top + gap + residual) + ")");
    xAxis.append("path").attr("d", "M0,0H" + w);
    timeTicks(zone.zone, range, Math.max(2, Math.floor(w / 55))).forEach(function (tick) {
      var at = x(tick[0]);
      xAxis.append("line").attr({ x1: at, x2: at, y1: 0, y2: 3 });
      xAxis.append("text").attr({ x: at, y: 13, "text-anchor": at > w - 12 ? "end" : at < 4 ? "start" : "middle",
                                  "font-size": 10 }).text(tick[1]);
    });
    drawZoneTitle(g, h, zone, w);
    svg.on("mousemove", function () {
      var k = Math.floor(x.invert(d3.mouse(g.node())[0]));
      if (k < range[0] || k >= range[1]) { hideTip(); return; }
      showTip(["zone " + zone.zone + ", bin " + k + " (" +
               axisValue(zone.zone, k, "ns").toFixed(2) + " ns, path " + axisValue(zone.zone, k + 0.5, "m").toFixed(3) + " m)",
               "measured " + compact(zone.measured[k]), "model " + compact(zone.model[k]) +
               ", of this object " + compact(zone.object[k]), "residual " + pearson(zone, k).toFixed(2) + " σ"]);
    }).on("mouseleave", hideTip);
  }
  drawZone.count = 0;

  // A place on the time axis, in bins from the start, as time (ns) or as the light's path (m).
  function axisValue(zone, bins, axis) {
    var ns = bins * scene.sensor.bin_width_ps / 1000;
    return axis === "ns" ? ns : axis === "m" ? (ns - scene.sensor.time_zero_ps[zone] / 1000) * LIGHT_M_PER_NS
      : bins - 0.5;
  }
  // Ticks at round numbers of the axis, as [place in bins, text].
  function timeTicks(zone, range, count) {
    var from = axisValue(zone, range[0], look.axis), to = axisValue(zone, range[1], look.axis);
    var scale = d3.scale.linear().domain([from, to]), format = scale.tickFormat(count);
    return scale.ticks(count).filter(function (t) { return look.axis !== "bin" || t === Math.round(t); })
      .map(function (t) {
        return [range[0] + (t - from) / (to - from) * (range[1] - range[0]), format(t).replace("-", "−")];
      });
  }
  function axisName() {
    return look.axis === "ns" ? "time in ns" : look.axis === "m" ? "path of the light in m" +
      (scene.sensor.path_from_relay ? ", from the relay" : "") : "bin";
  }
  function logTicks(limits) {
    if (limits[1] / limits[0] < 150) {
      return d3.scale.log().domain(limits).ticks().filter(function (t) {
        return /^[125]/.test(t.toExponential());
      });
    }
    var low = Math.ceil(Math.log(limits[0]) / Math.LN10), high = Math.floor(Math.log(limits[1]) / Math.LN10);
    var step = Math.max(1, Math.ceil((high - low) / 3));
    return d3.range(low, high + 1, step).map(function (e) { return Math.pow(10, e); });
  }
  function drawZoneTitle(g, h, zone, w) {
    var sum = 0, n = 0;
    for (var k = zone.first_bin; k < zone.end_bin; ++k) {
      var r = pearson(zone, k);
      if (finite(r)) { sum += r * r; ++n; }
    }
    g.append("text").attr({ x: 0, y: -5, "font-weight": 600 }).text("zone " + zone.zone);
    var note = scene.sensor.dead[zone.zone] ? "dead" : !zone.used ? "not used"
      : n ? w > 90 ? (w > 150 ? "χ²/bin " : "") + (sum / n).toFixed(2) : "" : "";
    g.append("text").attr({ x: w, y: -5, "text-anchor": "end", "class": "soft" }).text(note);
  }
  function drawResiduals(g, h, zone, range, x, w, height) {
    var limit = 5, y = d3.scale.linear().domain([-limit, limit]).range([height, 0]).clamp(true);
    g.append("rect").attr({ y: y(2), width: w, height: y(-2) - y(2), fill: COLOUR.shade });
    g.append("line").attr({ x2: w, y1: y(0), y2: y(0), stroke: COLOUR.edge });
    [-limit, limit].forEach(function (t) {
      g.append("text").attr({ x: -5, y: t > 0 ? 8 : height, "text-anchor": "end", "font-size": 9, "class": "soft" })
        .text((t > 0 ? "+" : "−") + limit + "σ");
    });
    if (!zone.used) return;
    var usual = "", large = "";
    var first = Math.max(range[0], zone.first_bin), end = Math.min(range[1], zone.end_bin);
    for (var k = first; k < end; ++k) {
      var r = pearson(zone, k);
      if (!finite(r)) continue;
      var line = "M" + x(k + 0.5) + "," + y(0) + "V" + y(r);
      if (Math.abs(r) > 3) large += line; else usual += line;
    }
    var thick = Math.max(1, Math.min(5, 0.7 * w / (range[1] - range[0])));
    g.append("path").attr({ d: usual, stroke: COLOUR.line, "stroke-width": thick });
    g.append("path").attr({ d: large, stroke: COLOUR.heaviest, "stroke-width": thick });
  }

  function toggle(parent, text, key, without) {
    button(parent, text, look[key], function () {
      look[key] = !look[key];
      if (without && look[key]) look[without] = false;
      redraw();
    });
  }
  function drawHistograms(parent, capture, number) {
    if (capture.error) return;
    var list = data.histograms[number];
    var title = element(parent, "h2", "", "Histograms, measured and fitted");
    if (isJoint(capture)) drawJointSelector(parent, capture);
    var h = list[Math.min(inJoint, list.length - 1)];
    if (!h || !h.zones.length) {
      element(parent, "div", "note", data.histograms_total > data.histograms_shown
        ? "The histograms of this capture are not in the page: to bound its size it holds those of " +
          data.histograms_shown + " of " + data.histograms_total + " captures, evenly spread."
        : "There are no histograms for this capture.");
      return;
    }
    var range = [h.first_bin, h.end_bin - 1];
    title.append("small").text("bins of " + compact(scene.sensor.bin_width_ps) + " ps; bins " + range[0] +
                               " to " + range[1] + " entered the fit");
    var tools = element(parent, "div", "tools");
    toggle(tools, "background subtracted", "background", "log");
    toggle(tools, "logarithmic", "log", "background");
    toggle(tools, "only the bins used", "window");
    toggle(tools, "one scale for all zones", "shared");
    [["ns", "time (ns)"], ["m", "path (m)"], ["bin", "bins"]].forEach(function (axis) {
      button(tools, axis[1], look.axis === axis[0], function () { look.axis = axis[0]; redraw(); });
    });
    tools.append("span").attr("class", "gap");
    legendInline(tools);
    if (h.zones.length < h.rows * h.columns) {
      element(parent, "div", "note", "The " + h.zones.length + " of " + h.rows * h.columns +
              " zones with most light from the object.");
    }
    var total = parent.node().clientWidth || 1344, gap = 12, narrowest = 112;
    var regular = h.zones.length === h.rows * h.columns && h.columns <= 8 && h.columns > 1;
    var across = regular ? h.columns : Math.min(h.zones.length, 4);
    if (!regular && h.zones.length > 16) across = 8;
    // A narrow screen shows fewer zones side by side, in reading order.
    across = Math.max(1, Math.min(across, Math.floor((total + gap) / (narrowest + gap))));
    var width = Math.min(660, Math.floor((total - gap * (across - 1)) / across));
    var height = across > 4 ? 150 : across > 2 ? (printing ? 160 : 190) : 230;
    var grid = element(parent, "div", "zones")
      .style("grid-template-columns", "repeat(" + across + ", " + width + "px)");
    var shared = look.shared ? yRange(h, h.zones, binRange(h)) : null;
    h.zones.forEach(function (zone) { drawZone(grid, h, zone, { w: width, h: height }, shared); });
    element(parent, "p", "soft", "Horizontal: " + axisName() + ". Vertical: counts" + (look.background
      ? " less the fitted direct return and ambient light" : "") +
      ", to the scale of the bins that entered the fit." +
      (look.background ? " Where photon noise of the subtracted light is large against that scale, " +
        "the measured line is pale and cut off at the box: it says little about the object." : "") +
      " Bins on grey did not enter the fit. Below each: (measured − model) / σ of the bins that entered the fit, with a band of ±2 σ; " +
      "beyond ±3 σ in orange. χ²/bin is the mean of its square.");
  }
  function legendInline(parent) {
    var box = element(parent, "span", "legend").style("margin", "0");
    [["path", { d: "M2,10h6v-6h8v4h8", fill: "none", stroke: COLOUR.measured }, "measured"],
     ["path", { d: "M2,7H24", stroke: COLOUR.model, "stroke-width": 2 }, "model"],
     ["rect", { x: 2, y: 2, width: 22, height: 10, fill: COLOUR.object, "fill-opacity": 0.55 },
      "of this, light from the object"]].forEach(function (entry) {
      var span = box.append("span");
      span.append("svg").attr({ width: 26, height: 14 }).append(entry[0]).attr(entry[1]);
      span.append("span").text(entry[2]);
    });
  }
  function drawJointSelector(parent, capture) {
    var tools = element(parent, "div", "tools");
    tools.append("span").text("capture");
    var select = tools.append("select").attr("aria-label", "capture of the joint fit").on("change", function () { inJoint = +this.value; redraw(); });
    capture.source.forEach(function (_, j) {
      select.append("option").attr("value", j).property("selected", j === inJoint)
        .text((j + 1) + ": " + sourceOf(capture, j));
    });
    button(tools, "‹", null, function () { inJoint = Math.max(0, inJoint - 1); redraw(); });
    button(tools, "›", null, function () {
      inJoint = Math.min(capture.source.length - 1, inJoint + 1);
      redraw();
    });
  }

  // ---------------------------------------------------------------- overview of many captures

  var trackColour = d3.scale.linear().interpolate(d3.interpolateLab).range(TRACK)
    .domain(d3.range(TRACK.length).map(function (i) { return i * Math.max(1, captures.length - 1) / (TRACK.length - 1); }));

  function drawTrack(group, x, y, perMetre, viewNumbers) {
    parts.drawSurroundings(group, x, y, viewsOf(viewNumbers));
    eachObject(function (o) { drawTrackOf(group, x, y, perMetre, o); });
  }
  function drawTrackOf(group, x, y, perMetre, o) {
    var truths = captures.filter(function (c) { return c.truth && holds(c.truth, o); });
    if (truths.length > 1) {
      group.append("path").attr({ fill: "none", stroke: COLOUR.truth, "stroke-width": 1.2, "stroke-dasharray": "4,3",
        d: polygon(truths.map(function (c) { return point(c.truth, o); }), x, y).replace("Z", "") });
    }
    truths.forEach(function (c) {
      var p = point(c.truth, o);
      group.append("path").attr({ d: "M" + (x(p[0]) - 4) + "," + y(p[1]) + "h8M" + x(p[0]) + "," + (y(p[1]) - 4) + "v8",
                                  stroke: COLOUR.truth, "stroke-width": 1.3 });
    });
    var drawn = captures.filter(function (c) { return found(c) && holds(heaviest(c).pose, o); });
    if (drawn.length > 1) {
      group.append("path").attr({ fill: "none", stroke: COLOUR.line, "stroke-width": 1, "stroke-opacity": 0.6,
        d: polygon(drawn.map(function (c) { return point(heaviest(c).pose, o); }), x, y).replace("Z", "") });
    }
    captures.forEach(function (c, i) {
      var mode = heaviest(c);
      if (!found(c) || !holds(mode.pose, o)) return;
      var p = point(mode.pose, o), colour = trackColour(i);
      var strength = 0.25 + 0.75 * (finite(c.presence_probability) ? c.presence_probability : 0);
      drawEllipse(group, x, y, perMetre, mode, { fill: colour, "fill-opacity": 0.15 * strength, stroke: colour,
                                                 "stroke-opacity": 0.7 * strength }, o);
      group.append("circle").attr({ cx: x(p[0]), cy: y(p[1]), r: i === chosen ? 7 : 4, fill: colour,
        "fill-opacity": strength, stroke: i === chosen ? COLOUR.ink : COLOUR.paper, "stroke-width": i === chosen ? 2 : 0.8 })
        .style("cursor", "pointer")
        .on("click", function () { choose(i); })
        .on("mousemove", function () {
          showTip([(i + 1) + ": " + nameOf(c)].concat(unknowns.map(function (name, k) {
            var sigma = Math.sqrt(mode.covariance[k][k]);
            return bare(name) + " " + fixed(mode.pose[k], sigma) + " ± " + fixed(sigma, sigma) + " " + unit(name);
          }), "presence " + probability(c.presence_probability)));
        }).on("mouseleave", hideTip);
    });
  }
  function drawIndexScale(parent) {
    var w = 220, box = element(parent, "div", "legend");
    box.append("span").text("capture 1");
    var svg = box.append("svg").attr({ width: w, height: 12 });
    d3.range(44).forEach(function (k) {
      svg.append("rect").attr({ x: k * w / 44, width: w / 44 + 0.5, height: 12,
                                fill: trackColour(k / 43 * (captures.length - 1)) });
    });
    box.append("span").text(String(captures.length));
    box.append("span").text("fainter: less probably there; captures in which nothing was found are not drawn");
    if (captures.some(function (c) { return c.truth; })) {
      var truth = box.append("span");
      truth.append("svg").attr({ width: 26, height: 14 }).append("path").attr(SWATCH.truth[1]);
      truth.append("span").text("truth");
    }
  }

  // One quantity against the capture's number; click chooses the capture.
  function chart(parent, options) {
    var width = options.width, height = options.height;
    var margin = { left: 52, right: 8, top: 20, bottom: 30 };
    var w = width - margin.left - margin.right, h = height - margin.top - margin.bottom;
    var svg = parent.append("svg").attr({ width: width, height: height, role: "img",
      "aria-label": options.title + " of each capture" });
    var g = svg.append("g").attr("transform", "translate(" + margin.left + "," + margin.top + ")");
    var x = d3.scale.linear().domain([0.5, captures.length + 0.5]).range([0, w]);
    var y = options.y.range([h, 0]).clamp(true);
    g.append("text").attr({ x: 0, y: -8, "font-weight": 600, "font-size": 12 }).text(options.title);
    options.ticks.forEach(function (t) {
      g.append("line").attr({ x2: w, y1: y(t), y2: y(t), stroke: COLOUR.grid });
      g.append("text").attr({ x: -6, y: y(t) + 4, "text-anchor": "end", "class": "soft" }).text(options.format(t));
    });
    x.ticks(Math.min(10, captures.length)).forEach(function (t) {
      if (t === Math.round(t)) {
        g.append("text").attr({ x: x(t), y: h + 14, "text-anchor": x(t) > w - 14 ? "end" : "middle", "class": "soft" })
          .text(t);
      }
    });
    g.append("text").attr({ x: w / 2, y: h + 27, "text-anchor": "middle" }).text("capture");
    g.append("path").attr({ d: "M0,0V" + h + "H" + w, fill: "none", stroke: COLOUR.line, "shape-rendering": "crispEdges" });
    g.append("line").attr({ x1: x(chosen + 1), x2: x(chosen + 1), y2: h, stroke: COLOUR.ink, "stroke-dasharray": "2,3" });
    captures.forEach(function (c, i) {
      if (c.error) {
        g.append("path").attr({ d: "M-4,-4L4,4M-4,4L4,-4", stroke: COLOUR.heaviest, "stroke-width": 2,
          transform: "translate(" + x(i + 1) + "," + (h - 6) + ")" }).append("title").text("failed: " + c.error);
      }
    });
    options.series.forEach(function (series) {
      var line = d3.svg.line().defined(function (v) { return finite(v) && (!options.positive || v > 0); })
        .x(function (_, i) { return x(i + 1); }).y(function (v) { return y(v); });
      var values = captures.map(series.value);
      g.append("path").attr({ d: line(values), fill: "none", stroke: series.colour, "stroke-width": series.dots ? 1 : 1.4,
                              "stroke-opacity": series.dots ? 0.45 : 1, "stroke-dasharray": series.dash || null });
      if (series.dots) values.forEach(function (v, i) {
        if (finite(v) && (!options.positive || v > 0)) {
          g.append("circle").attr({ cx: x(i + 1), cy: y(v), r: captures.length > 150 ? 1.8 : 3, fill: series.colour });
        }
      });
    });
    var names = element(parent, "div", "legend");
    options.series.forEach(function (series) {
      var span = names.append("span");
      span.append("svg").attr({ width: 26, height: 14 }).append("path").attr({ d: "M2,7H24", stroke: series.colour,
        "stroke-width": 2, "stroke-dasharray": series.dash || null });
      span.append("span").text(series.name);
    });
    svg.style("cursor", "pointer").on("click", function () {
      choose(Math.round(x.invert(d3.mouse(g.node())[0])) - 1);
    });
  }
  function drawCharts(parent, width, height) {
    var several = objects.length > 1, series = [], lengths = [];
    // What was not found has no error.
    eachObject(function (o) {
      var ending = several ? ", " + objects[o].name : "", dash = o === 0 ? null : 2 + 2 * o + ",3";
      var sigma = function (c) { return found(c) ? positionSigma(heaviest(c), o) : NaN; };
      var error = function (c) { return found(c) ? positionError(c, heaviest(c).pose, o) : NaN; };
      series.push({ name: "claimed standard deviation" + ending, colour: COLOUR.heaviest, value: sigma, dash: dash });
      lengths = lengths.concat(captures.map(sigma), captures.map(error));
      if (captures.some(function (c) { return finite(error(c)); })) {
        series.push({ name: "distance to truth" + ending, colour: COLOUR.truth, value: error, dots: true, dash: dash });
      }
    });
    lengths = lengths.filter(function (v) { return finite(v) && v > 0; });
    if (lengths.length) {
      var limits = d3.extent(lengths);
      limits = [Math.pow(10, Math.floor(Math.log(limits[0]) / Math.LN10)), Math.pow(10, Math.ceil(Math.log(limits[1]) / Math.LN10))];
      if (limits[0] === limits[1]) limits[1] *= 10;
      chart(parent, { title: "Position (m)", width: width, height: height, y: d3.scale.log().domain(limits), positive: true,
                      ticks: logTicks(limits), format: compact, series: series });
    }
    chart(parent, { title: "Probability", width: width, height: height, y: d3.scale.linear().domain([0, 1]),
      ticks: [0, 0.25, 0.5, 0.75, 1], format: String, series: [
        { name: "object present", colour: COLOUR.ink, value: function (c) { return c.presence_probability; }, dots: true },
        { name: "weight of the heaviest mode", colour: COLOUR.heaviest,
          value: function (c) { return heaviest(c) ? heaviest(c).weight : NaN; }, dash: "5,3" }] });
  }
  function drawSummary(parent) {
    var failed = captures.filter(function (c) { return c.error; }).length;
    var parts = [captures.length + " captures, " + (failed ? failed + " failed" : "all fitted")];
    eachObject(function (o) {
      var errors = captures.map(function (c) { return heaviest(c) ? positionError(c, heaviest(c).pose, o) : NaN; })
        .filter(finite).sort(d3.ascending);
      if (!errors.length) return;
      var inside = captures.map(function (c) { return covers(c, o); }).filter(function (c) { return c !== null; });
      parts.push((objects.length > 1 ? objects[o].name + ": " : "") + "distance to truth: median " +
        length(quantile(errors, 0.5)) + ", 90th percentile " + length(quantile(errors, 0.9)));
      if (inside.length) {
        parts.push("truth inside the " + region(o) + " of the heaviest mode in " +
                   inside.filter(function (c) { return c; }).length + " of " + inside.length);
      }
    });
    var times = captures.filter(function (c) { return !c.error; })
      .map(function (c) { return c.time_ms.total; }).filter(finite).sort(d3.ascending);
    if (times.length) parts.push("median time " + milliseconds(quantile(times, 0.5)));
    element(parent, "p", "", parts.join(" · "));
    if (data.histograms_shown < data.histograms_total) {
      element(parent, "div", "note", "To bound the size of this page it holds the histograms of " + data.histograms_shown +
        " of " + data.histograms_total + " captures, evenly spread. Everything else is there for all of them.");
    }
  }
  function drawCaptureTable(parent) {
    var box = scrolling(element(parent, "div", "scroll"), "table of captures"), table = box.append("table");
    var head = table.append("thead").append("tr");
    ["capture", "source"].concat(unknowns.map(titleOf),
      ["weight", "present", "false alarm"], objects.map(function (object) {
        return objects.length > 1 ? object.name + " to truth" : "to truth";
      }), ["flags"]).forEach(function (title, i) {
      head.append("th").attr("class", i === 1 || title === "flags" ? "text" : "").text(title);
    });
    var body = table.append("tbody");
    captures.forEach(function (c, i) {
      var row = body.append("tr").attr("class", "pick" + (i === chosen ? " chosen" : ""))
        .on("click", function () { choose(i); });
      button(row.append("td"), i + 1, i === chosen, function () {
        d3.event.stopPropagation();
        choose(i);
        d3.select("tr.chosen button").node().focus();
      }).attr("aria-label", "capture " + (i + 1));
      row.append("td").attr("class", "text").text(nameOf(c));
      var mode = heaviest(c);
      if (!mode) {
        row.append("td").attr({ "class": "text", colspan: unknowns.length + 4 + objects.length }).style("color", COLOUR.heaviest)
          .text(c.error || "no mode");
        return;
      }
      unknowns.forEach(function (name, k) {
        cell(row, shown(name, mode.pose[k]), shown(name, Math.sqrt(mode.covariance[k][k])), mode.undetermined.indexOf(name) >= 0);
      });
      row.append("td").text((100 * mode.weight).toFixed(1) + " %");
      row.append("td").text(probability(c.presence_probability));
      row.append("td").text(probability(c.false_alarm_probability));
      eachObject(function (o) { row.append("td").text(length(positionError(c, mode.pose, o))); });
      row.append("td").attr("class", "text").text(c.flags.join(", "));
    });
    var picked = body.select("tr.chosen").node();
    if (picked) box.node().scrollTop = Math.max(0, picked.offsetTop - 120);
  }
  function distinct(numbers) { return d3.set(numbers).values().map(Number); }

  function drawOverview(parent) {
    element(parent, "h2", "", "All captures").append("small").text("the heaviest mode of each; click one to see it below");
    drawSummary(parent);
    var columns = element(parent, "div", "columns");
    var left = columns.append("div").attr("class", "picture"), right = columns.append("div").attr("class", "rest");
    var views = distinct(d3.merge(data.view_of));
    var extent = sceneExtent(views, false), width = widthIn(left, 720), height = heightFor(extent, width, 300, 560);
    var tools = element(left, "div", "tools");
    var map = new Map(left, { width: width, height: height, label: "All captures from above",
      draw: function (g, x, y, perMetre) { drawTrack(g, x, y, perMetre, views.length > 12 ? [data.view_of[chosen][0]] : views); } });
    var poses = [];
    captures.forEach(function (c) {
      if (found(c)) poses = poses.concat(placesOf(heaviest(c).pose));
      if (c.truth) poses = poses.concat(placesOf(c.truth));
    });
    button(tools, "overview", null, function () { map.show(extent); });
    button(tools, "whole scene", null, function () { map.show(sceneExtent(views, true)); });
    if (poses.length) button(tools, "track", null, function () { map.show(extentOf(poses, 0.12, 0.01)); });
    tools.append("span").attr("class", "soft").text("drag or arrows to move, double-click or + to enlarge");
    map.show(extent);
    drawIndexScale(left);
    drawCharts(right, widthIn(right, 590), Math.max(190, Math.round(height / 2) - 10));
    drawCaptureTable(element(parent, "div").style("margin-top", "12px"));
  }

  // ---------------------------------------------------------------- a scene by itself

  // Draws the objects where the scene file puts them. An unknown is in the middle of its range.
  function drawStated(group, x, y) {
    eachObject(function (o) {
      group.append("path").attr({ d: polygon(placedObject(null, o), x, y), fill: COLOUR.object, "fill-opacity": 0.3,
                                  stroke: COLOUR.object, "stroke-width": objects[o].outline.length < 3 ? 3 : 1.4 })
        .append("title").text(objects[o].name);
    });
  }
  function drawRanges(parent) {
    element(parent, "h2", "", "Unknowns").append("small").text("what a fit finds, and in which range");
    var body = element(parent, "table").append("tbody");
    unknowns.forEach(function (name, i) {
      var row = body.append("tr");
      row.append("td").attr("class", "text").text(titleOf(name));
      row.append("td").text(scene.bounds[i].map(function (v) { return compact(shown(name, v)).replace("-", "−"); }).join(" to "));
    });
  }
  function drawScene(parent) {
    var columns = element(parent, "div", "columns");
    var left = columns.append("div").attr("class", "picture"), right = columns.append("div").attr("class", "rest");
    var extent = sceneExtent([0], false), width = widthIn(left, 760), height = heightFor(extent, width, 300, 640);
    element(left, "h2", "", "From above");
    var tools = element(left, "div", "tools");
    var map = new Map(left, { width: width, height: height, label: "The scene from above", draw: function (g, x, y, perMetre) {
      parts.drawSurroundings(g, x, y, viewsOf([0]));
      drawStated(g, x, y);
    } });
    button(tools, "overview", null, function () { map.show(extent); });
    button(tools, "whole scene", null, function () { map.show(sceneExtent([0], true)); });
    tools.append("span").attr("class", "soft").text("drag or arrows to move, double-click or + to enlarge");
    map.show(extent);
    mapLegend(left, { modes: [], flags: [] }, [["rect", merged(AREA, { fill: COLOUR.object,
      "fill-opacity": 0.3, stroke: COLOUR.object }), "the object as the scene file puts it; what is unknown, in mid-range"]]);
    drawRanges(right);
  }

  // ---------------------------------------------------------------- page

  function drawCapture(parent, number) {
    var capture = captures[number];
    var title = element(parent, "h2", "", captures.length > 1 ? "Capture " + (number + 1) : "Result");
    title.append("small").text(nameOf(capture));
    drawHeadline(parent, capture, number);
    if (capture.error) { drawAnswer(parent, capture); return; }
    var columns = element(parent, "div", "columns");
    var left = columns.append("div").attr("class", "picture"), right = columns.append("div").attr("class", "rest");
    var views = distinct(data.view_of[number]);
    var extent = sceneExtent(views, false), width = widthIn(left, 760);
    var height = heightFor(extent, width, 300, printing ? 405 : 640);
    var tools = element(left, "div", "tools");
    var map = new Map(left, { width: width, height: height, label: "The result from above", draw: function (g, x, y, perMetre) {
      parts.drawSurroundings(g, x, y, viewsOf(views));
      if (capture.truth) drawTruth(g, x, y, capture.truth);
      drawModes(g, x, y, perMetre, capture);
    } });
    button(tools, "overview", null, function () { map.show(extent); });
    button(tools, "whole scene", null, function () { map.show(sceneExtent(views, true)); });
    if (found(capture)) {
      button(tools, "all modes", null, function () {
        var points = capture.truth ? placesOf(capture.truth) : [];
        capture.modes.forEach(function (m) { points = points.concat(placesOf(m.pose)); });
        map.show(extentOf(points, 0.25, 1.5 * ellipse(capture.modes[0], 0).long + 0.01));
      });
      eachObject(function (o) {
        button(tools, objects.length > 1 ? objects[o].name : "heaviest mode", null, function () {
          map.show(around(capture.modes[0], capture.truth, o));
        });
      });
    }
    tools.append("span").attr("class", "soft").text("drag or arrows to move, double-click or + to enlarge");
    map.show(extent);
    mapLegend(left, capture);
    drawAnswer(right, capture);
    if (found(capture)) eachObject(function (o) {
      if (freeInPlane(o) && holds(capture.modes[0].pose, o)) drawCloseUp(right, capture, o);
    });
    drawModeTable(element(parent, "div").style("margin-top", "18px"), capture);
  }
  // The sentence for everyone, and what the program noticed.
  function drawHeadline(parent, capture, number) {
    if (captures.length > 1) element(parent, "p", "headline", data.headlines[number]);
    (capture.hints || []).forEach(function (hint) { element(parent, "div", "hint", hint); });
  }
  function drawCloseUp(parent, capture, o) {
    element(parent, "h2", "", "Close-up of " + (objects.length > 1 ? objects[o].name : "the heaviest mode"))
      .style("margin-top", "16px");
    var map = new Map(parent, { width: widthIn(parent, 460), height: printing ? 210 : 300, label: "Close-up", draw: function (g, x, y, perMetre) {
      var mode = capture.modes[0];
      drawEllipse(g, x, y, perMetre, mode, { fill: COLOUR.heaviest, "fill-opacity": 0.2, stroke: COLOUR.heaviest,
                                             "stroke-width": 2 }, o);
      var p = point(mode.pose, o);
      g.append("circle").attr({ cx: x(p[0]), cy: y(p[1]), r: 3.5, fill: COLOUR.heaviest });
      if (capture.truth && holds(capture.truth, o)) {
        var t = point(capture.truth, o), cx = x(t[0]), cy = y(t[1]);
        g.append("path").attr({ d: "M" + (cx - 8) + "," + cy + "h16M" + cx + "," + (cy - 8) + "v16",
                                stroke: COLOUR.truth, "stroke-width": 2.4 });
      }
    } });
    map.show(around(capture.modes[0], capture.truth, o));
  }

  function drawControls(parent) {
    if (captures.length < 2) return;
    var box = element(parent, "div", "controls");
    button(box, "‹ previous", null, function () { choose(chosen - 1); });
    button(box, "next ›", null, function () { choose(chosen + 1); });
    box.append("input").attr({ type: "range", min: 1, max: captures.length, value: chosen + 1, "aria-label": "capture" })
      .on("change", function () { choose(+this.value - 1); });
    var select = box.append("select").attr("aria-label", "capture by name")
      .on("change", function () { choose(+this.value); });
    captures.forEach(function (c, i) {
      select.append("option").attr("value", i).property("selected", i === chosen)
        .text((i + 1) + ": " + nameOf(c) + (c.error ? " (failed)" : ""));
    });
  }
  function choose(number) {
    chosen = Math.max(0, Math.min(captures.length - 1, number));
    inJoint = 0;
    redraw();
  }

  var page = d3.select("#page");
  element(page, "h1", "", scene.name || "Fit").append("small").text("localisation around the corner");
  element(page, "p", "headline", data.headline);
  element(page, "div", "subtitle", [
    scene.sensor.name + ": " + scene.sensor.rows + " × " + scene.sensor.columns + " zones, " + scene.sensor.bins +
      " bins of " + compact(scene.sensor.bin_width_ps) + " ps" + (scene.sensor.confocal ? ", confocal" : ", flash"),
    "hidden: " + objects.map(function (object) {
      return object.name === object.shape ? object.name : object.name + " (" + object.shape + ")";
    }).join(", "),
    "unknown: " + (unknowns.map(bare).join(", ") || "nothing"),
    data.result.scene].join(" · "));
  var overview = element(page, "section");
  var controls = element(page, "div", "controls-holder");
  var detail = element(page, "section");
  var histograms = element(page, "section");

  function redraw() {
    hideTip();
    // Keep the place while the parts are replaced.
    var top = window.pageYOffset;
    [overview, controls, detail, histograms].forEach(function (part) {
      part.style("min-height", part.node().offsetHeight + "px").html("");
    });
    if (captures.length > 1) drawOverview(overview);
    drawControls(controls);
    if (captures.length) {
      drawCapture(detail, chosen);
      drawHistograms(histograms, captures[chosen], chosen);
    } else {
      drawScene(detail);
    }
    [overview, controls, detail, histograms].forEach(function (part) { part.style("min-height", null); });
    window.scrollTo(window.pageXOffset, top);
  }
  // A sheet of paper is narrower than most windows, so the pictures are drawn anew for it.
  d3.select(window).on("beforeprint", function () { printing = true; redrawForPaper(); });
  d3.select(window).on("afterprint", function () { printing = false; redrawForPaper(); });
  function redrawForPaper() {
    d3.select("body").classed("printed", printing);
    redraw();
  }
  var lastWidth = window.innerWidth;
  d3.select(window).on("resize", function () {
    if (window.innerWidth === lastWidth) return;
    lastWidth = window.innerWidth;
    redraw();
  });
  d3.select(window).on("keydown", function () {
    if (/^(INPUT|SELECT|svg)$/.test(document.activeElement.tagName)) return;
    if (d3.event.keyCode === 37) choose(chosen - 1);
    if (d3.event.keyCode === 39) choose(chosen + 1);
  });
  // The first capture that was fitted.
  captures.some(function (c, i) { chosen = i; return !c.error; }) || (chosen = 0);
  redraw();
})();
