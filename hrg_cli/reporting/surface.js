"use strict";
(function () {
  var WIDE = 560, HIGH = 440, REACH = 150, RISE = 0.6, STEP = 5;
  var element = PLOTS.element, short = PLOTS.short, steps = PLOTS.steps;

  function extent(values) {
    var low = Math.min.apply(null, values), high = Math.max.apply(null, values);
    return low < high ? [low, high] : [low - 1, low + 1];
  }

  function unit(value, ends) { return 2 * (value - ends[0]) / (ends[1] - ends[0]) - 1; }

  document.querySelectorAll("[data-surface]").forEach(function (host) {
    var data = JSON.parse(host.dataset.surface), sliders = host.querySelectorAll("input[type=range]"), choices = Array.from(host.querySelectorAll("input[type=radio]"));
    var plot = host.querySelector(".plot"), said = host.querySelector(".figures"), turn = sliders[0], tilt = sliders[1];
    var angles = extent(data.angle), nodes = extent(data.node);

    function shown() { return data.quantities[choices.length ? choices.findIndex(function (box) { return box.checked; }) : 0]; }

    function draw() {
      var of = shown(), values = [].concat.apply([], of.values), ends = extent(values), middle = (ends[0] + ends[1]) / 2;
      var about = turn.valueAsNumber * Math.PI / 180, up = tilt.valueAsNumber * Math.PI / 180;
      var cos = Math.cos(about), sin = Math.sin(about), low = Math.sin(up), flat = Math.cos(up);

      // x to the right, y into the screen, z up: turned about z, then tilted towards the reader
      function seen(x, y, z) {
        var right = x * cos - y * sin, away = x * sin + y * cos;
        return {x: WIDE / 2 + REACH * right, y: HIGH / 2 - REACH * (away * low + RISE * z * flat), depth: away * flat - RISE * z * low};
      }
      function line(name, from, to) { svg.append(element("line", {"class": name, x1: from.x.toFixed(1), y1: from.y.toFixed(1), x2: to.x.toFixed(1), y2: to.y.toFixed(1)})); }
      function text(at, words, anchor) { svg.append(element("text", {x: at.x.toFixed(1), y: (at.y + 4).toFixed(1), "text-anchor": anchor || "middle"}, words)); }

      var svg = element("svg", {viewBox: "0 0 " + WIDE + " " + HIGH, role: "img", "aria-label": of.name + " over wave angle and " + data.axis + ", turned by " + turn.value + " degrees, seen from " + tilt.value + " degrees above"});
      // the floor's edges that are nearest the reader carry the scales
      var front = cos > 0 ? -1 : 1, side = sin > 0 ? -1 : 1;
      [[-1, -1, 1, -1], [-1, 1, 1, 1], [-1, -1, -1, 1], [1, -1, 1, 1]].forEach(function (e) { line("grid", seen(e[0], e[1], -1), seen(e[2], e[3], -1)); });
      if (flat > 0.2) { [[-1, -1], [1, -1], [-1, 1], [1, 1]].forEach(function (c) { line("grid", seen(c[0], c[1], -1), seen(c[0], c[1], 1)); }); }
      if (Math.abs(cos) > 0.15 || low > 0.3) { steps(angles[0], angles[1], 6).forEach(function (v) { text(seen(unit(v, angles), 1.13 * front, -1), short(v)); }); text(seen(0, 1.34 * front, -1), "θ, °"); }
      if (Math.abs(sin) > 0.15 || low > 0.3) { steps(nodes[0], nodes[1], 6).forEach(function (v) { text(seen(1.13 * side, unit(v, nodes), -1), short(v)); }); text(seen(1.36 * side, 0, -1), data.unit); }

      var faces = [];
      for (var i = 0; i + 1 < data.node.length; i += 1) {
        for (var k = 0; k + 1 < data.angle.length; k += 1) {
          var corners = [[i, k], [i, k + 1], [i + 1, k + 1], [i + 1, k]], around = corners.map(function (c) { return of.values[c[0]][c[1]]; });
          if (around.some(function (v) { return v === null; })) { continue; }
          faces.push({
            points: corners.map(function (c, n) { return seen(unit(data.angle[c[1]], angles), unit(data.node[c[0]], nodes), unit(around[n], ends)); }),
            value: (around[0] + around[1] + around[2] + around[3]) / 4
          });
        }
      }
      function depth(face) { return face.points.reduce(function (sum, p) { return sum + p.depth; }, 0); }
      faces.sort(function (a, b) { return depth(b) - depth(a); }).forEach(function (face) {
        var part = Math.round(100 * Math.min(1, Math.abs(face.value - middle) / (ends[1] - middle))), colour = face.value > middle ? "var(--series-2)" : "var(--series-1)";
        svg.append(element("path", {"class": "face", d: "M" + face.points.map(function (p) { return p.x.toFixed(1) + " " + p.y.toFixed(1); }).join("L") + "Z", style: "fill: color-mix(in srgb, " + colour + " " + part + "%, var(--paper))"}));
      });
      if (flat > 0.35) {
        // the upright edge that stands farthest to the left carries the values
        var corner = [[-1, -1], [1, -1], [-1, 1], [1, 1]].reduce(function (best, c) { return seen(c[0], c[1], 0).x < seen(best[0], best[1], 0).x ? c : best; });
        steps(ends[0], ends[1], 6).forEach(function (v) { var at = seen(corner[0], corner[1], unit(v, ends)); at.x -= 6; text(at, short(v), "end"); });
      }
      svg.append(element("text", {x: 6, y: 14}, of.label));
      plot.replaceChildren(svg);
      host.dataset.seen = turn.value + " " + tilt.value;
      said.textContent = of.name + " from " + short(ends[0]) + " to " + short(ends[1]) + " " + of.unit + ", σ " + short(of.std) + " " + of.unit;
    }

    function moved(right, upwards) {
      turn.valueAsNumber = (turn.valueAsNumber + right + 540) % 360 - 180;
      tilt.valueAsNumber = Math.min(90, Math.max(0, tilt.valueAsNumber + upwards));
      draw();
    }

    var held = null;
    plot.addEventListener("pointerdown", function (event) { held = [event.clientX, event.clientY]; plot.setPointerCapture(event.pointerId); });
    plot.addEventListener("pointermove", function (event) {
      if (held === null) { return; }
      moved((event.clientX - held[0]) / 2, (event.clientY - held[1]) / 3);
      held = [event.clientX, event.clientY];
    });
    ["pointerup", "pointercancel"].forEach(function (name) { plot.addEventListener(name, function () { held = null; }); });
    plot.addEventListener("keydown", function (event) {
      var way = {ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP]}[event.key];
      if (way) { event.preventDefault(); moved(way[0], way[1]); }
    });
    [turn, tilt].concat(choices).forEach(function (box) { box.disabled = false; box.addEventListener("input", draw); });
    plot.tabIndex = 0;
    draw();
  });
})();
