"use strict";
(function () {
  var root = document.documentElement, button = document.getElementById("theme"), kept = null;
  var system = window.matchMedia("(prefers-color-scheme: dark)");
  try { kept = window.localStorage.getItem("hrg-theme"); } catch (error) { kept = null; }
  function dark() { return root.dataset.theme ? root.dataset.theme === "dark" : system.matches; }
  function show() { button.textContent = dark() ? "Light page" : "Dark page"; }
  if (kept === "dark" || kept === "light") { root.dataset.theme = kept; }
  button.hidden = false;
  button.addEventListener("click", function () {
    root.dataset.theme = dark() ? "light" : "dark";
    try { window.localStorage.setItem("hrg-theme", root.dataset.theme); } catch (error) { /* a page opened without storage */ }
    show();
  });
  system.addEventListener("change", show);
  window.addEventListener("beforeprint", function () {
    document.querySelectorAll("details").forEach(function (part) { part.open = true; });
  });
  show();
})();
(function () {
  function mark(part) {
    var hidden = part.scrollWidth - part.clientWidth;
    part.classList.toggle("more", hidden > 1 && part.scrollLeft < hidden - 1);
  }
  var sizes = new ResizeObserver(function (changed) { changed.forEach(function (one) { mark(one.target); }); });
  document.querySelectorAll(".scroll").forEach(function (part) {
    sizes.observe(part);
    part.addEventListener("scroll", function () { mark(part); }, {passive: true});
  });
})();
