// SPDX-License-Identifier: Apache-2.0
// Parts of pages that draw a scene with poses in it: numbers, buttons, legends, a map with its known
// surroundings and with modes. `scene` and `unknowns` are those of the page's data. Needs D3 version 3 and
// poses.js. Lengths are metres, angles radians.
function SceneParts(scene, unknowns) {
  "use strict";
  var objects = scene.objects, poses = Poses(objects, unknowns), finite = poses.finite, place = poses.place;
  var point = poses.point, eachObject = poses.eachObject, ellipse = poses.ellipse;
  var placedObject = poses.placedObject;

  // Colours by meaning, the same on all pages (theme.css, which also has their dark values).
  var COLOUR = {
    heaviest: "var(--found)", rival: "var(--rival)", truth: "var(--truth)", relay: "var(--relay)",
    occluder: "var(--relay)", body: "var(--occluder)", sensor: "var(--sensor)", field: "var(--field)",
    fieldEdge: "var(--field-edge)", search: "var(--search)", object: "var(--object)", model: "var(--model)",
    measured: "var(--measured)", paper: "var(--paper)", grid: "var(--grid)", line: "var(--line)",
    shade: "var(--shade)", ink: "var(--ink)", edge: "var(--edge)"
  };
  function digits(sigma) {
    if (!finite(sigma) || sigma <= 0) return 3;
    return Math.max(0, Math.min(6, 1 - Math.floor(Math.log(sigma) / Math.LN10)));
  }
  function fixed(value, sigma) {
    return finite(value) ? value.toFixed(digits(sigma)).replace("-", "−") : "–";
  }
  function compact(value) {
    if (value === 0) return "0";
    var size = Math.abs(value);
    if (size >= 1e4 || size < 1e-3) return value.toExponential(1).replace("e+", "e");
    return String(+value.toPrecision(3));
  }
  function element(parent, tag, className, text) {
    var node = parent.append(tag);
    if (className) node.attr("class", className);
    if (text !== undefined) node.text(text);
    return node;
  }
  // An object with the keys of both. Values of `b` replace those of `a`.
  function merged(a, b) {
    var all = {};
    [a, b].forEach(function (part) { Object.keys(part).forEach(function (key) { all[key] = part[key]; }); });
    return all;
  }
  function button(parent, text, on, action) {
    var made = element(parent, "button", "", text).attr("type", "button").on("click", action);
    if (typeof on === "boolean") made.attr("aria-pressed", on);
    return made;
  }
  // Lets a box that scrolls by itself be reached by keyboard.
  function scrolling(box, label) { return box.attr({ tabindex: 0, role: "group", "aria-label": label }); }
  // Pixels that a picture in `parent` may be wide, at most `most`.
  function widthIn(parent, most) {
    return Math.max(260, Math.min(most, Math.floor(parent.node().clientWidth || most)));
  }
  function polygon(points, x, y) {
    return "M" + points.map(function (p) { return x(p[0]) + "," + y(p[1]); }).join("L") +
      (points.length > 2 ? "Z" : "");
  }
  // Entries are lists of an element's name, its attributes and what it means.
  function legend(parent, entries) {
    var box = element(parent, "div", "legend");
    entries.forEach(function (entry) {
      var span = box.append("span");
      span.append("svg").attr({ width: 26, height: 14 }).append(entry[0]).attr(entry[1]);
      span.append("span").text(entry[2]);
    });
  }
  // Whether a pose has object `o`. With several objects, a mode may leave one out: its values are
  // null.
  function holds(vector, o) {
    return unknowns.every(function (name, i) {
      return name.indexOf(objects[o].prefix) !== 0 || objects.length === 1 || finite(vector[i]);
    });
  }
  // Extent [[x0, y0], [x1, y1]] of points, with a margin: a share of the larger side, but at least
  // `least` m.
  function extentOf(points, margin, least) {
    var x = d3.extent(points, function (p) { return p[0]; });
    var y = d3.extent(points, function (p) { return p[1]; });
    var pad = Math.max(least || 0, margin * Math.max(x[1] - x[0], y[1] - y[0]));
    return [[x[0] - pad, y[0] - pad], [x[1] + pad, y[1] + pad]];
  }
  function searchRegion(o) {
    var bounds = ["x_m", "y_m"].map(function (name) {
      var i = place(name, o), known = objects[o].known[name];
      return i >= 0 ? scene.bounds[i] : [known, known];
    });
    return [[bounds[0][0], bounds[1][0]], [bounds[0][1], bounds[1][0]],
            [bounds[0][1], bounds[1][1]], [bounds[0][0], bounds[1][1]]];
  }
  // A map to scale in `parent`. draw(group, x, y, metresPerPixel) is called again after each zoom.
  function Map(parent, options) {
    var margin = { left: 58, right: 10, top: 10, bottom: 34 };
    var width = options.width, height = options.height;
    var inner = { w: width - margin.left - margin.right, h: height - margin.top - margin.bottom };
    var svg = parent.append("svg").attr("class", "map").attr("width", width).attr("height", height)
      .attr({ tabindex: 0, role: "group", "aria-roledescription": "map", "aria-label": options.label +
              ": arrows move it, plus and minus change its scale" });
    var clipId = "clip" + Map.count++;
    svg.append("clipPath").attr("id", clipId).append("rect")
      .attr("width", inner.w).attr("height", inner.h);
    var root = svg.append("g").attr("transform", "translate(" + margin.left + "," + margin.top + ")");
    root.append("rect").attr("width", inner.w).attr("height", inner.h).attr("fill", COLOUR.paper);
    var grid = root.append("g");
    var content = root.append("g").attr("clip-path", "url(#" + clipId + ")");
    var axes = root.append("g");
    var x = d3.scale.linear().range([0, inner.w]);
    var y = d3.scale.linear().range([inner.h, 0]);
    var zoom = d3.behavior.zoom().on("zoom", function () { render(); });
    svg.call(zoom).on("wheel.zoom", null).on("mousewheel.zoom", null).on("DOMMouseScroll.zoom", null);

    // Lines at round metres, no closer than 70 pixels (45 in a small map).
    function step(pixelsPerMetre) {
      var raw = (height < 350 ? 45 : 70) / pixelsPerMetre, power = Math.pow(10, Math.floor(Math.log(raw) / Math.LN10));
      return [1, 2, 5, 10].map(function (f) { return f * power; })
        .filter(function (s) { return s >= raw * 0.999; })[0];
    }
    function render() {
      var perMetre = inner.w / (x.domain()[1] - x.domain()[0]);
      var distance = step(perMetre);
      grid.html("");
      axes.html("");
      content.html("");
      var shown = Math.max(0, Math.ceil(-Math.log(distance) / Math.LN10 - 1e-9));
      function ticks(domain) {
        return d3.range(Math.ceil(domain[0] / distance - 1e-6), Math.floor(domain[1] / distance + 1e-6) + 1)
          .map(function (k) { return k * distance; });
      }
      ticks(x.domain()).forEach(function (t) {
        grid.append("line").attr({ x1: x(t), x2: x(t), y1: 0, y2: inner.h, stroke: COLOUR.grid });
        axes.append("text").attr({ x: x(t), y: inner.h + 15, "text-anchor": "middle", "class": "soft" })
          .text(t.toFixed(shown));
      });
      ticks(y.domain()).forEach(function (t) {
        grid.append("line").attr({ x1: 0, x2: inner.w, y1: y(t), y2: y(t), stroke: COLOUR.grid });
        axes.append("text").attr({ x: -6, y: y(t) + 4, "text-anchor": "end", "class": "soft" })
          .text(t.toFixed(shown));
      });
      axes.append("rect").attr({ width: inner.w, height: inner.h, fill: "none", stroke: COLOUR.line,
                                 "shape-rendering": "crispEdges" });
      axes.append("text").attr({ x: inner.w / 2, y: inner.h + 30, "text-anchor": "middle" }).text("x (m)");
      axes.append("text").attr({ transform: "translate(-46," + inner.h / 2 + ")rotate(-90)",
                                 "text-anchor": "middle" }).text("y (m)");
      options.draw(content, x, y, perMetre);
      drawScaleBar(axes.append("g"), distance, perMetre);
    }
    function drawScaleBar(group, distance, perMetre) {
      var w = distance * perMetre;
      var text = distance >= 1 ? distance + " m" : distance >= 0.01 ? +(distance * 100).toPrecision(2) + " cm"
        : distance >= 1e-3 ? +(distance * 1000).toPrecision(2) + " mm" : +(distance * 1e6).toPrecision(2) + " µm";
      group.attr("transform", "translate(" + (inner.w - w - 14) + "," + (inner.h - 14) + ")");
      group.append("rect").attr({ x: -7, y: -20, width: w + 14, height: 28, fill: COLOUR.paper, opacity: 0.8 });
      group.append("path").attr({ d: "M0,-4V4M0,0H" + w + "M" + w + ",-4V4", stroke: COLOUR.sensor,
                                  "stroke-width": 1.6, fill: "none" });
      group.append("text").attr({ x: w / 2, y: -7, "text-anchor": "middle" }).text(text);
    }
    // Arrow keys move the map by a tenth of the picture. Plus and minus change the scale by a
    // quarter.
    var KEYS = { 37: [-1, 0], 38: [0, 1], 39: [1, 0], 40: [0, -1] };
    svg.on("keydown", function () {
      var key = d3.event.key, move = KEYS[d3.event.keyCode];
      var factor = key === "+" || key === "=" ? 0.8 : key === "-" ? 1.25 : 1;
      if ((!move && factor === 1) || d3.event.ctrlKey || d3.event.altKey || d3.event.metaKey) return;
      d3.event.preventDefault();
      d3.event.stopPropagation();
      [x, y].forEach(function (scale, axis) {
        var d = scale.domain(), middle = (d[0] + d[1]) / 2, half = (d[1] - d[0]) / 2;
        middle += move ? 0.2 * half * move[axis] : 0;
        scale.domain([middle - factor * half, middle + factor * half]);
      });
      zoom.x(x).y(y);
      render();
    });
    this.draw = render;
    this.show = function (extent) {
      var w = extent[1][0] - extent[0][0], h = extent[1][1] - extent[0][1];
      var perPixel = Math.max(w / inner.w, h / inner.h);
      var cx = (extent[0][0] + extent[1][0]) / 2, cy = (extent[0][1] + extent[1][1]) / 2;
      x.domain([cx - perPixel * inner.w / 2, cx + perPixel * inner.w / 2]);
      y.domain([cy - perPixel * inner.h / 2, cy + perPixel * inner.h / 2]);
      zoom.x(x).y(y);
      render();
    };
  }
  Map.count = 0;
  // Height that shows an extent to scale in a map of the given width, within limits.
  function heightFor(extent, width, least, most) {
    var ratio = (extent[1][1] - extent[0][1]) / (extent[1][0] - extent[0][0]);
    return Math.round(Math.min(most, Math.max(least, (width - 68) * ratio + 44)));
  }
  // Seen from above an upright plane is a line; all else is an area.
  function isThin(surface) { return surface.outline.length < 3; }
  // How a known surface looks, in the picture and in its legend.
  function surfaceStyle(surface) {
    var thin = isThin(surface);
    return {
      fill: thin ? "none" : COLOUR.body,
      "fill-opacity": surface.occluder ? 0.9 : 0.25,
      stroke: surface.relay || surface.occluder ? COLOUR.relay : COLOUR.line,
      "stroke-width": thin ? (surface.relay ? 4 : 3) : 1,
      "stroke-dasharray": thin && surface.occluder && !surface.relay ? "8,2" : null
    };
  }
  var AREA = { x: 2, y: 2, width: 22, height: 10 };
  var SEARCH = { fill: COLOUR.search, "fill-opacity": 0.07, stroke: COLOUR.search, "stroke-dasharray": "5,4",
                 "stroke-width": 1.2 };
  var SWATCH = {
    sensor: ["path", { d: "M21,7L7,12L10,7L7,2Z", fill: COLOUR.sensor }, "sensor"],
    field: ["rect", merged(AREA, { fill: COLOUR.field, "fill-opacity": 0.22, stroke: COLOUR.fieldEdge }),
            "field of view, zones on the surfaces"],
    search: ["rect", merged(AREA, SEARCH), "search region"],
    heaviest: ["ellipse", { cx: 13, cy: 7, rx: 10, ry: 5, fill: COLOUR.heaviest, "fill-opacity": 0.28,
                            stroke: COLOUR.heaviest, "stroke-width": 2 }, ""],
    rival: ["ellipse", { cx: 13, cy: 7, rx: 10, ry: 5, fill: COLOUR.rival, "fill-opacity": 0.2,
                         stroke: COLOUR.rival }, "other places that explain the light, fainter with less weight"],
    yaw: ["path", { d: "M2,7H23m-6,-4l6,4l-6,4", stroke: COLOUR.heaviest, "stroke-width": 1.6, fill: "none" },
          "which way it faces; fan: 95 %"],
    truth: ["path", { d: "M5,7H21M13,0V14", stroke: COLOUR.truth, "stroke-width": 2.4 }, "truth"]
  };
  // Legend entries for each kind of known surfaces, with the symbol that the picture has for it.
  function surfaceEntries() {
    var seen = {}, entries = [];
    scene.surfaces.forEach(function (surface) {
      var roles = [surface.relay ? "relay surface" : "", surface.occluder ? "occluder" : ""].filter(String);
      var name = roles.join(" and ") || "other surface", key = name + isThin(surface);
      if (seen[key]) return;
      seen[key] = true;
      var shape = isThin(surface) ? ["path", { d: "M2,7H24" }] : ["rect", AREA];
      entries.push([shape[0], merged(shape[1], surfaceStyle(surface)), name + (isThin(surface) ? ", edge on" : "")]);
    });
    return entries;
  }
  // Search regions, known surfaces, and what the sensor sees from each of its places.
  function drawSurroundings(group, x, y, views) {
    eachObject(function (o) {
      group.append("path").attr("d", polygon(searchRegion(o), x, y)).attr(SEARCH);
    });
    views.forEach(function (view) {
      group.append("path").attr({ d: polygon(view.field_of_view, x, y), fill: COLOUR.field,
                                  "fill-opacity": 0.22, stroke: COLOUR.fieldEdge, "stroke-opacity": 0.7 });
    });
    scene.surfaces.forEach(function (surface) {
      group.append("path").attr("d", polygon(surface.outline, x, y)).attr(surfaceStyle(surface))
        .append("title").text(surface.name + (surface.relay ? ", relay" : "") +
                              (surface.occluder ? ", occluder" : ""));
    });
    views.forEach(function (view) {
      view.zones.forEach(function (outlines, z) {
        if (views.length > 3) return;
        outlines.forEach(function (zone) {
          var g = zone.length === 1
            ? group.append("circle").attr({ cx: x(zone[0][0]), cy: y(zone[0][1]), r: 2.2, fill: COLOUR.fieldEdge })
            : group.append("path").attr({ d: polygon(zone, x, y), fill: COLOUR.fieldEdge, "fill-opacity": 0.12,
                                          stroke: COLOUR.fieldEdge, "stroke-width": 1.2, "stroke-opacity": 0.8 });
          g.append("title").text("zone " + z);
        });
      });
    });
    views.forEach(function (view) {
      var p = view.position, f = view.forward;
      var angle = -Math.atan2(f[1], f[0]) * 180 / Math.PI;
      group.append("path").attr({ d: "M11,0L-6,7L-3,0L-6,-7Z", fill: COLOUR.sensor, stroke: COLOUR.paper,
        transform: "translate(" + x(p[0]) + "," + y(p[1]) + ")rotate(" + angle + ")" })
        .append("title").text("sensor at " + p.map(function (c) { return c.toFixed(3); }).join(", ") + " m");
    });
  }
  function drawEllipse(group, x, y, perMetre, mode, style, o) {
    var e = ellipse(mode, o), p = point(mode.pose, o);
    return group.append("ellipse").attr({
      rx: Math.max(3, e.long * perMetre), ry: Math.max(3, e.short * perMetre),
      transform: "translate(" + x(p[0]) + "," + y(p[1]) + ")rotate(" + -e.angle * 180 / Math.PI + ")"
    }).attr(style);
  }
  function arrowLength(perMetre) { return Math.max(34, Math.min(120, 0.35 * perMetre)); }  // pixels
  function facing(mode, o) {
    var i = place("yaw_rad", o);
    return i >= 0 && mode.undetermined.indexOf(unknowns[i]) < 0 && objects[o].yaw_period > 0;
  }
  // Draws which way the object faces, if the data determine an unknown yaw: an arrow, with a fan of
  // 95 % if that is less than half a turn.
  function drawYaw(group, x, y, perMetre, mode, colour, opacity, o) {
    if (!facing(mode, o)) return;
    var i = place("yaw_rad", o);
    var p = point(mode.pose, o), yaw = mode.pose[i], spread = 1.96 * Math.sqrt(mode.covariance[i][i]);
    var r = arrowLength(perMetre);
    if (spread < Math.PI / 2) {
      group.append("path").attr({ fill: colour, opacity: 0.16 * opacity, d: d3.svg.arc().innerRadius(0)
        .outerRadius(r).startAngle(Math.PI / 2 - yaw - spread).endAngle(Math.PI / 2 - yaw + spread)(),
        transform: "translate(" + x(p[0]) + "," + y(p[1]) + ")" });
    }
    group.append("path").attr({ d: "M0,0H" + r + "m-7,-4l7,4l-7,4", fill: "none", stroke: colour,
      "stroke-width": 1.6, opacity: opacity,
      transform: "translate(" + x(p[0]) + "," + y(p[1]) + ")rotate(" + -yaw * 180 / Math.PI + ")" });
  }
  function drawMode(group, x, y, perMetre, mode, first, o) {
    var colour = first ? COLOUR.heaviest : COLOUR.rival;
    var opacity = 0.3 + 0.7 * Math.sqrt(Math.max(0, Math.min(1, mode.weight)));
    var p = point(mode.pose, o);
    drawYaw(group, x, y, perMetre, mode, colour, opacity, o);
    group.append("path").attr({ d: polygon(placedObject(mode.pose, o), x, y), fill: colour,
      "fill-opacity": first ? 0.16 : 0.06, stroke: colour, "stroke-opacity": opacity,
      "stroke-width": objects[o].outline.length < 3 ? 3 : 1.2 });
    drawEllipse(group, x, y, perMetre, mode, { fill: colour, "fill-opacity": 0.28 * opacity,
      stroke: colour, "stroke-opacity": opacity, "stroke-width": first ? 2 : 1.3 }, o);
    group.append("circle").attr({ cx: x(p[0]), cy: y(p[1]), r: first ? 3.2 : 2.4, fill: colour,
                                  opacity: opacity, stroke: COLOUR.paper, "stroke-width": 0.7 });
  }
  return { poses: poses, COLOUR: COLOUR, AREA: AREA, SEARCH: SEARCH, SWATCH: SWATCH, digits: digits, fixed: fixed,
           compact: compact, element: element, merged: merged, button: button, scrolling: scrolling,
           widthIn: widthIn, polygon: polygon, legend: legend, holds: holds, extentOf: extentOf,
           searchRegion: searchRegion, Map: Map, heightFor: heightFor, surfaceEntries: surfaceEntries,
           drawSurroundings: drawSurroundings, drawEllipse: drawEllipse, arrowLength: arrowLength,
           facing: facing, drawMode: drawMode };
}
