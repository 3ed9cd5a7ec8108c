"use strict";
var PLOTS = (function () {
  var SVG = "http://www.w3.org/2000/svg";

  function element(name, attributes, text) {
    var made = document.createElementNS(SVG, name);
    Object.keys(attributes).forEach(function (key) { made.setAttribute(key, attributes[key]); });
    if (text !== undefined) { made.textContent = text; }
    return made;
  }

  function short(value) {
    if (value === null) { return "–"; }
    if (value === 0) { return "0"; }
    var size = Math.abs(value), power = Math.floor(Math.log10(size) + 1e-12);
    if (size < 1e5 && size >= 1e-3) { return String(Number(value.toPrecision(3))).replace("-", "−"); }
    var raised = String(power).replace(/./g, function (c) { return "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]; });
    var front = Number((value / Math.pow(10, power)).toPrecision(2));
    return (front === 1 ? "" : front + "×") + "10" + raised;
  }

  function steps(low, high, most) {
    var raw = (high - low) / (most || 4), power = Math.pow(10, Math.floor(Math.log10(raw))), step = [1, 2, 5, 10].map(function (k) { return k * power; }).find(function (s) { return s >= raw; });
    var found = [];
    for (var v = Math.ceil(low / step) * step; v <= high + step * 1e-6; v += step) { found.push(Math.abs(v) < step * 1e-6 ? 0 : v); }
    return found;
  }

  /* Marks of a logarithmic axis: the powers of ten, with 2 and 5 between them where they are fewer than three: one mark tells no scale. */
  function decades(low, high) {
    function marks(factors) {
      var found = [];
      for (var k = Math.floor(Math.log10(low)); k <= Math.log10(high); k += 1) {
        factors.forEach(function (f) { var v = f * Math.pow(10, k); if (v >= low * (1 - 1e-9) && v <= high * (1 + 1e-9)) { found.push(v); } });
      }
      return found;
    }
    var whole = marks([1]), finer = whole.length < 3 ? marks([1, 2, 5]) : whole;
    return finer.length ? finer : [low];
  }

  return {element: element, short: short, steps: steps, decades: decades};
})();
