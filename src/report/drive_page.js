// SPDX-License-Identifier: Apache-2.0
// Plays a drive: a map as people know them, timelines, histograms. Needs the JSON in #data and
// drive_map.js; no network. Lengths are metres, angles radians, times seconds.
(function () {
  "use strict";

  var data = JSON.parse(document.getElementById("data").textContent);
  var drive = data.drive, world = data.world, frames = drive.frames, pictures = data.pictures;
  var step = data.world.trace_step_s, duration = Math.max(drive.time_s, step);
  var LIGHT = 0.299792458;  // m/ns
  var element = DriveMap.element, drawn = DriveMap.drawn, explain = DriveMap.explain;
  var COLOUR, ratio = 1, painter = DriveMap.painter(data);
  var frameAt = painter.frameAt, errorOf = painter.errorOf, isBraking = painter.isBraking;
  var HIDDEN = painter.hidden;

  // ---------------------------------------------------------------- page

  var page = document.getElementById("page");
  var title = element(page, "h1", "", drive.drive.replace(/_/g, " "));
  element(title, "span", "outcome " + drive.outcome, drive.outcome);
  element(title, "small", "", "perception: " + drive.perception + " · seed " + drive.seed);
  element(page, "p", "headline", drive.headline);
  var columns = element(page, "div", "columns player");
  var mapCard = element(columns, "div", "card map");
  var map = DriveMap.picture(mapCard, "the drive from above");
  var bar = element(mapCard, "div", "bar");
  var controls = DriveMap.controls(bar, "time"), play = controls.play, slider = controls.slider;
  var clock = controls.clock, speed = controls.speed;
  slider.max = duration; slider.step = step;
  var moments = element(mapCard, "div", "moments");
  var timelines = element(mapCard, "div", "timelines");
  var side = element(columns, "div", "card side");
  element(side, "h2", "", "Now");
  var facts = element(side, "dl", "facts");
  var heading = element(side, "h2", "plots");
  var plots = DriveMap.picture(side, "histograms of zones, or a close-up");
  var plotLegend = element(side, "div", "legend");
  element(side, "h2", "", "Map");
  var mapLegend = element(side, "div", "legend");
  element(side, "div", "keys", "Space plays and pauses, arrows go from frame to frame, Home and " +
    "End to begin and end; a click into a timeline goes there.");

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

  function known(value) { return typeof value === "number" && isFinite(value); }

  // ---------------------------------------------------------------- histograms

  var DECADES = 3;  // of the object's light, that are shown below its largest counts

  // Range of bins in which something happens in any frame, and the most light from the object.
  // Null: no frame has histograms.
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
  // The frame whose histograms are shown at frame i: i or, if its histograms are missing or were
  // skipped, the last frame before it that has some. -1: histograms are not looked at.
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
      ctx.lineTo(x + width, bottom); ctx.lineTo(x, bottom); painter.fill(ctx, COLOUR.object, 0.6);
      curve(counts, function (v) {
        return v > 0 ? Math.log(v / floor) / Math.log(top / floor) : 0;
      });
      painter.stroke(ctx, COLOUR.measured, 1.1);
    });
  }
  // Draws the histograms or, where direct sight says more than they do, a close-up.
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
    painter.draw(i, painter.closeUp(plots, i), now);
  }

  // ---------------------------------------------------------------- timelines

  // Each strip has a name, a unit, and lines as functions of a frame's number. That of the error
  // has a band, which the error should stay below.
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
    var scale = drawn(svg, "g", {});
    var ticks = strip.logarithmic
      ? [0.001, 0.01, 0.1, 1, 10, 100].filter(function (t) { return t >= least && t <= most; })
      : [0, strip.top || +(most / 1.05).toPrecision(2)];
    ticks.forEach(function (tick) {
      drawn(scale, "line", { "class": "grid", x1: LEFT, x2: width - RIGHT, y1: at(tick), y2: at(tick) });
      drawn(scale, "text", { "class": "soft", x: LEFT - 5, y: +at(tick) + 4, "text-anchor": "end" }, tick);
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
      player.set(false);
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

  var now = 0, rate = 1, shown = -1;
  var player = DriveMap.player({
    now: function () { return now; },
    duration: function () { return duration; },
    rate: function () { return rate; },
    show: function (time) { now = time; draw(); }
  }, play);

  function layout() {
    ratio = window.devicePixelRatio || 1;
    var wide = mapCard.clientWidth;
    var g = world.map, most = Math.max(320, 0.6 * window.innerHeight);
    var tall = Math.min(wide * g.rows / g.columns, most);
    map.width = wide * ratio; map.height = tall * ratio; map.style.height = tall + "px";
    wide = plots.clientWidth; tall = Math.min(0.95 * wide, 520);
    plots.width = wide * ratio; plots.height = tall * ratio; plots.style.height = tall + "px";
    drawTimelines();
    shown = -1;
  }
  function draw() {
    var i = frameAt(now);
    painter.draw(i, painter.wholeMap(map), now);
    drawPlots(i, i !== shown);
    if (i !== shown) drawFacts(i);
    shown = i;
    showTime(i);
    slider.value = now;
    clock.textContent = now.toFixed(1) + " / " + duration.toFixed(1) + " s";
  }
  function goTo(time) { now = Math.max(0, Math.min(duration, time)); draw(); }
  function jump(time) { player.set(false); goTo(time); }

  slider.oninput = function () { jump(+slider.value); };
  speed.onchange = function () { rate = +speed.value; };
  var found = painter.moments();
  found.forEach(function (moment) {
    var button = element(moments, "button", moment.time === found.matters ? "matters" : "");
    element(button, "b", "", moment.time.toFixed(1) + " s");
    button.appendChild(document.createTextNode(" " + moment.words));
    button.onclick = function () { jump(moment.time); };
  });
  DriveMap.dark.addEventListener("change", function () {
    COLOUR = DriveMap.readColours(); painter.forgetGrid(); shown = -1; draw();
  });
  window.onresize = function () { layout(); draw(); };
  document.onkeydown = function (event) {
    var i = frameAt(now), tag = event.target.tagName;
    if (event.ctrlKey || event.altKey || event.metaKey || tag === "SELECT") return;
    if (event.key === " " && tag !== "BUTTON") player.toggle();
    else if (event.key === "ArrowRight") jump(frames[Math.min(i + 1, frames.length - 1)].time_s);
    else if (event.key === "ArrowLeft") jump(frames[Math.max(i - 1, 0)].time_s);
    else if (event.key === "Home") jump(0);
    else if (event.key === "End") jump(duration);
    else return;
    event.preventDefault();
  };

  COLOUR = DriveMap.readColours();
  drawLegends();
  layout();
  // The page plays from the beginning. "#t=3.2" opens it at that time. A reader who prefers reduced
  // motion sees the moment that explains the drive.
  var wanted = /t=([0-9.]+)/.exec(window.location.hash);
  var still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  goTo(wanted ? +wanted[1] : still ? found.matters : 0);
  if (!wanted && !still) player.set(true);
})();
