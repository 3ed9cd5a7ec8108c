"use strict";
(function () {
  var element = PLOTS.element, short = PLOTS.short, steps = PLOTS.steps, decades = PLOTS.decades;
  var WIDE = 420, HIGH = 240, LEFT = 58, RIGHT = 8, TOP = 18, BOTTOM = 34;

  function frame(title, x, y, log) {
    var svg = element("svg", {viewBox: "0 0 " + WIDE + " " + HIGH, role: "img", "aria-label": title});
    function place(value, low, high, from, to) {
      var part = log ? (Math.log(value) - Math.log(low)) / (Math.log(high) - Math.log(low)) : (value - low) / (high - low);
      return from + part * (to - from);
    }
    var px = function (v) { return place(v, x.low, x.high, LEFT, WIDE - RIGHT); }, py = function (v) { return place(v, y.low, y.high, HIGH - BOTTOM, TOP); };
    (log ? decades(x.low, x.high) : steps(x.low, x.high)).forEach(function (v) {
      svg.append(element("line", {"class": "grid", x1: px(v), x2: px(v), y1: TOP, y2: HIGH - BOTTOM}));
      svg.append(element("text", {x: px(v), y: HIGH - BOTTOM + 13, "text-anchor": "middle"}, short(v)));
    });
    (log ? decades(y.low, y.high) : steps(y.low, y.high)).forEach(function (v) {
      svg.append(element("line", {"class": "grid", x1: LEFT, x2: WIDE - RIGHT, y1: py(v), y2: py(v)}));
      svg.append(element("text", {x: LEFT - 4, y: py(v) + 4, "text-anchor": "end"}, short(v)));
    });
    svg.append(element("path", {"class": "axis", d: "M" + LEFT + " " + TOP + "V" + (HIGH - BOTTOM) + "H" + (WIDE - RIGHT)}));
    svg.append(element("text", {x: LEFT, y: 11}, y.label));
    svg.append(element("text", {x: WIDE - RIGHT, y: HIGH - 4, "text-anchor": "end"}, x.label));
    return {svg: svg, trace: function (xs, ys, style) {
      var d = "", pen = "M";
      xs.forEach(function (v, k) {
        if (v === null || ys[k] === null || (log && !(ys[k] > 0))) { pen = "M"; return; }
        d += pen + px(v).toFixed(1) + " " + py(Math.min(Math.max(ys[k], y.low), y.high)).toFixed(1); pen = "L";
      });
      svg.append(element("path", {"class": "trace", d: d || "M0 0", style: style}));
    }};
  }

  function extent(lists, positive) {
    var low = Infinity, high = -Infinity;
    lists.forEach(function (list) { list.forEach(function (v) { if (v !== null && (!positive || v > 0)) { low = Math.min(low, v); high = Math.max(high, v); } }); });
    return low < high ? [low, high] : [low - 1, low + 1];
  }

  document.querySelectorAll("[data-living]").forEach(function (host) {
    var data = JSON.parse(host.dataset.living), boxes = Array.from(host.querySelectorAll("input")), plots = host.querySelector(".plots"), said = host.querySelector(".figures");
    var states = Object.keys(data.states).map(function (key) { return data.states[key]; });
    var time = extent(data.times), angle = extent([].concat.apply([], states.map(function (s) { return s.runs; })));
    var most = Math.max(-angle[0], angle[1]) * 1.05;
    var tau = extent(states.map(function (s) { return s.tau; }), true), allan = extent(states.map(function (s) { return s.allan; }), true);
    var all = data.states[boxes.map(function () { return "1"; }).join("")], none = data.states[boxes.map(function () { return "0"; }).join("")];

    function draw() {
      var key = boxes.map(function (box) { return box.checked ? "1" : "0"; }).join(""), state = data.states[key];
      plots.replaceChildren();
      host.dataset.state = key;
      if (!state) { said.textContent = "This combination was not computed; take in the causes one after another from the first."; return; }
      said.textContent = "over all rows: drift error " + short(state.drift) + " °/h, amplitude error " + short(state.amplitude) + " ppm";
      var left = frame("Residual of the wave angle against time", {low: time[0], high: time[1], label: "time, s"}, {low: -most, high: most, label: "m·θ measured − model, mrad"}, false);
      state.runs.forEach(function (run, k) { left.trace(data.times[k], run, "stroke: var(--series-" + (k % 6 + 1) + ")"); });
      plots.append(left.svg);
      if (state.tau.length > 1) {
        var right = frame("Allan deviation of the drift error", {low: tau[0], high: tau[1], label: "averaging time, s"}, {low: allan[0] / 1.3, high: allan[1] * 1.3, label: "Allan deviation, °/h"}, true);
        if (none) { right.trace(none.tau, none.allan, "stroke: var(--muted); stroke-dasharray: 1 4"); }
        if (all) { right.trace(all.tau, all.allan, "stroke: var(--muted); stroke-dasharray: 6 4"); }
        right.trace(state.tau, state.allan, "stroke: var(--series-1); stroke-width: 2");
        plots.append(right.svg);
      }
    }

    boxes.forEach(function (box) { box.disabled = false; box.addEventListener("change", draw); });
    draw();
  });
})();
