// SPDX-License-Identifier: Apache-2.0
// Plays two drives through the same world side by side, with one clock. Needs the JSON in #pairs,
// an element #side-by-side and drive_map.js; no network. Lengths are metres, times seconds.
(function () {
  "use strict";

  var data = JSON.parse(document.getElementById("pairs").textContent), pairs = data.pairs;
  var element = DriveMap.element, drawn = DriveMap.drawn, explain = DriveMap.explain;
  var root = document.getElementById("side-by-side");
  var INKS = ["series-0", "found"];  // of the first and the second drive
  var WORDS = { reached: "goal reached", collision: "collision", stopped: "stands",
                timeout: "time over" };

  // ---------------------------------------------------------------- page

  root.className = "pair player";
  var chooserLine = element(root, "label", "chooser", "Seed ");
  var chooser = element(chooserLine, "select");
  pairs.forEach(function (pair, k) {
    element(chooser, "option", "", pair.seed + ": " + pair.why).value = k;
  });
  chooserLine.hidden = pairs.length < 2;
  // On a page of its own, the headline stands above already.
  var headline = data.plays && document.querySelector("p.headline") ||
    element(root, "p", "headline");
  var panels = element(root, "div", "panels");
  var bar = element(root, "div", "card bar");
  var controls = DriveMap.controls(bar, "time of both drives"), play = controls.play, slider = controls.slider;
  var clock = controls.clock, speed = controls.speed;
  slider.step = 0.02;
  var lower = element(root, "div", "card controls");
  var moments = element(lower, "div", "moments");
  var timelines = element(lower, "div", "timelines");
  var legend = element(root, "div", "legend");
  [["fill", "vehicle", "the vehicle, and its way"], ["line", "path", "its plan"],
   ["line", "goal", "goal"], ["fill", "field", "field of view"],
   ["outline", "truth", "the hidden object, truly"],
   ["mode", "found", "where it is taken to be: footprint, 95 % ellipse"],
   ["mode", "rival", "other explanations"]
  ].forEach(function (entry) { explain(legend, entry[0], entry[1], entry[2]); });

  // ---------------------------------------------------------------- drives

  var pair, sides, duration, now = 0, rate = 1, cursor;

  // One drive's map, and the line below that says what happens.
  function sideOf(replay, k) {
    var card = element(panels, "div", "card panel");
    var title = element(card, data.plays ? "h2" : "h3");
    element(title, "i", "swatch").style.background = "var(--" + INKS[k] + ")";
    title.appendChild(document.createTextNode(replay.name));
    var side = { replay: replay, painter: DriveMap.painter(replay), ink: INKS[k] };
    side.chip = element(title, "span", "outcome");
    side.canvas = DriveMap.picture(card, replay.name + ", from above");
    side.line = element(card, "p", "now");
    var more = element(card, "p", "story", replay.drive.headline);
    if (replay.page) {
      more.appendChild(document.createTextNode(" "));
      element(more, "a", "", "All about this drive").href = replay.page;
    }
    return side;
  }
  function choose(k) {
    pair = pairs[k];
    player.set(false);
    panels.textContent = "";
    headline.textContent = pair.headline;
    sides = pair.drives.map(sideOf);
    duration = Math.max.apply(null, sides.map(function (side) { return side.painter.duration; }));
    slider.max = duration;
    listMoments();
    layout();
  }
  // The moment that tells the two drives apart: the first end that is not at the goal.
  function matters() {
    var ends = sides.filter(function (side) { return side.replay.drive.outcome !== "reached"; })
      .map(function (side) { return side.painter.duration; });
    return ends.length ? Math.min.apply(null, ends) : sides[1].painter.moments().matters;
  }
  function listMoments() {
    var list = [];
    moments.textContent = "";
    sides.forEach(function (side) {
      side.painter.moments().forEach(function (moment) {
        list.push({ time: moment.time, words: moment.words, ink: side.ink });
      });
    });
    list.sort(function (a, b) { return a.time - b.time; });
    list.forEach(function (moment) {
      var button = element(moments, "button", moment.time === matters() ? "matters" : "");
      element(button, "i", "swatch").style.background = "var(--" + moment.ink + ")";
      element(button, "b", "", moment.time.toFixed(1) + " s");
      button.appendChild(document.createTextNode(" " + moment.words));
      button.onclick = function () { jump(moment.time); };
    });
  }
  function said(side, frame, over) {
    var drive = side.replay.drive, car = side.replay.world.vehicle.kind === "car";
    function spoken(v) { return car ? (3.6 * v).toFixed(0) + " km/h" : v.toFixed(2) + " m/s"; }
    if (over && drive.outcome === "collision") {
      return "hit the " + (drive.hit || "wall") + " at " + spoken(drive.end_speed_m_per_s);
    }
    if (over) return WORDS[drive.outcome] + " after " + drive.time_s.toFixed(1) + " s";
    var p = frame.presence_probability;
    return spoken(frame.speed_m_per_s) +
      (frame.braking_for ? " · brakes for " + frame.braking_for : "") +
      (frame.frame === "in_sight" ? " · sees the " + side.painter.hidden
        : p === null ? " · knows of nothing"
        : " · " + side.painter.hidden + " there with " + (100 * p).toFixed(0) + " %");
  }

  // ---------------------------------------------------------------- timelines

  var STRIPS = [
    { name: "speed, m/s", of: function (frame) { return frame.speed_m_per_s; } },
    { name: "clearance, m", of: function (frame) { return frame.clearance_m; } },
    { name: "probability of presence", top: 1,
      of: function (frame) { return frame.presence_probability; } }
  ];
  var LEFT = 40, RIGHT = 10, STRIP = 66, TITLE = 18, width = 0;
  function timeX(time) { return LEFT + (width - LEFT - RIGHT) * time / duration; }
  function known(value) { return typeof value === "number" && isFinite(value); }
  function drawStrip(svg, strip, y) {
    var bottom = y + STRIP - 6, top = y + TITLE, most = strip.top || 0.01;
    sides.forEach(function (side) {
      side.replay.drive.frames.map(strip.of).filter(known).forEach(function (value) {
        most = Math.max(most, value);
      });
    });
    [0, strip.top || +most.toPrecision(2)].forEach(function (tick) {
      var at = bottom - (bottom - top) * Math.min(1, tick / most);
      drawn(svg, "line", { "class": "grid", x1: LEFT, x2: width - RIGHT, y1: at, y2: at });
      drawn(svg, "text", { "class": "soft", x: LEFT - 5, y: at + 4, "text-anchor": "end" }, tick);
    });
    sides.forEach(function (side) {
      var d = "", open = false;
      side.replay.drive.frames.forEach(function (frame) {
        var value = strip.of(frame);
        if (known(value)) {
          d += (open ? "L" : "M") + timeX(frame.time_s).toFixed(1) + " " +
            (bottom - (bottom - top) * Math.max(0, value / most)).toFixed(1);
        }
        open = known(value);
      });
      drawn(svg, "path", { d: d, "class": "line strong", stroke: "var(--" + side.ink + ")" });
    });
    drawn(svg, "text", { x: LEFT, y: y + 11 }, strip.name);
  }
  function drawTimelines() {
    width = Math.max(260, timelines.clientWidth);
    var bottom = STRIPS.length * STRIP, height = bottom + 20;
    timelines.textContent = "";
    var svg = drawn(timelines, "svg", { width: width, height: height, role: "img",
      "aria-label": "speed, clearance and presence of both drives over time" });
    STRIPS.forEach(function (strip, k) { drawStrip(svg, strip, k * STRIP); });
    sides.forEach(function (side) {
      var x = timeX(side.painter.duration);
      drawn(svg, "line", { "class": "line", x1: x, x2: x, y1: TITLE, y2: bottom,
                           "stroke-dasharray": "2 3", stroke: "var(--" + side.ink + ")" });
    });
    var every = [0.5, 1, 2, 5, 10, 20, 60].find(function (s) {
      return duration / s * 36 <= width - LEFT - RIGHT;
    }) || duration;
    for (var t = 0; t <= duration + 1e-9; t += every) {
      drawn(svg, "text", { "class": "soft", x: timeX(t), y: bottom + 14, "text-anchor": "middle" },
            +t.toFixed(1) + (t ? "" : " s"));
    }
    cursor = drawn(svg, "line", { "class": "cursor", y1: 4, y2: bottom + 2 });
    svg.onpointerdown = svg.onpointermove = function (event) {
      if (!event.buttons) return;
      var x = event.clientX - svg.getBoundingClientRect().left;
      jump(duration * (x - LEFT) / (width - LEFT - RIGHT));
    };
  }

  // ---------------------------------------------------------------- playing

  var player = DriveMap.player({
    now: function () { return now; },
    duration: function () { return duration; },
    rate: function () { return rate; },
    show: function (time) { now = time; draw(); }
  }, play);

  function layout() {
    var ratio = window.devicePixelRatio || 1, lower = pair.lower_m, upper = pair.upper_m;
    sides.forEach(function (side) {
      var wide = side.canvas.clientWidth;
      var tall = Math.min(wide * (upper[1] - lower[1]) / (upper[0] - lower[0]),
                          Math.max(240, 0.55 * window.innerHeight));
      side.canvas.width = wide * ratio; side.canvas.height = tall * ratio;
      side.canvas.style.height = tall + "px";
    });
    drawTimelines();
    draw();
  }
  function draw() {
    sides.forEach(function (side) {
      var time = Math.min(now, side.painter.duration), i = side.painter.frameAt(time);
      var over = now >= side.painter.duration - 1e-9, outcome = side.replay.drive.outcome;
      side.painter.draw(i, side.painter.viewOf(side.canvas, pair.lower_m, pair.upper_m), time);
      side.line.textContent = said(side, side.replay.drive.frames[i], over);
      side.chip.className = "outcome" + (over ? " " + outcome : " driving");
      side.chip.textContent = over ? WORDS[outcome] : "drives";
    });
    slider.value = now;
    cursor.setAttribute("x1", timeX(now)); cursor.setAttribute("x2", timeX(now));
    clock.textContent = now.toFixed(1) + " / " + duration.toFixed(1) + " s";
  }
  function jump(time) {
    player.set(false);
    now = Math.max(0, Math.min(duration, time));
    draw();
  }

  // The slider's steps may not reach the end, so its last step stands for the end.
  slider.oninput = function () {
    jump(+slider.value > duration - slider.step ? duration : +slider.value);
  };
  speed.onchange = function () { rate = +speed.value; };
  chooser.onchange = function () { now = 0; choose(+chooser.value); jump(matters()); };
  root.onkeydown = function (event) {
    if (event.key !== " " || /BUTTON|SELECT|A/.test(event.target.tagName)) return;
    player.toggle();
    event.preventDefault();
  };
  DriveMap.dark.addEventListener("change", function () { DriveMap.readColours(); draw(); });
  window.addEventListener("resize", layout);

  DriveMap.readColours();
  choose(0);
  // If the two drives are part of another page, they show the moment that matters and wait.
  var wanted = /t=([0-9.]+)/.exec(window.location.hash);
  var still = !data.plays || window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  jump(wanted ? +wanted[1] : still ? matters() : 0);
  if (!wanted && !still) player.set(true);
})();
