(function () {
  var tables = Array.from(document.querySelectorAll("table.sortable"));
  var field = document.getElementById("filter"), choice = document.getElementById("show"), said = document.getElementById("shown");
  var what = tables.length && tables[0].dataset.rows || "gyros";

  function key(row, column) {
    var cell = row.children[column], value = cell.dataset.v;
    if (value === undefined) { return cell.textContent.trim(); }
    return value === "" ? null : Number(value);
  }

  function compare(a, b) {
    if (a === null || b === null) { return (a === null) - (b === null); }
    return typeof a === "number" ? a - b : a.localeCompare(b, undefined, {numeric: true});
  }

  function sort(table, column, direction) {
    var body = table.tBodies[0], rows = Array.from(body.rows);
    rows.map(function (row, place) { return {row: row, key: key(row, column), place: place}; }).sort(function (a, b) {
      var empty = (a.key === null || a.key === "") - (b.key === null || b.key === "");
      return empty || direction * compare(a.key, b.key) || a.place - b.place;
    }).forEach(function (one) { body.append(one.row); });
    Array.from(table.tHead.rows[0].cells).forEach(function (cell, k) {
      cell.setAttribute("aria-sort", k !== column ? "none" : direction > 0 ? "ascending" : "descending");
    });
  }

  tables.forEach(function (table) {
    Array.from(table.tHead.rows[0].cells).forEach(function (cell, column) {
      var button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.append.apply(button, Array.from(cell.childNodes));
      cell.append(button);
      button.addEventListener("click", function () {
        var now = cell.getAttribute("aria-sort"), first = cell.dataset.first === "descending" ? -1 : 1;
        sort(table, column, now === "ascending" ? -1 : now === "descending" ? 1 : first);
      });
    });
  });

  function filter() {
    var words = field.value.toLowerCase().split(/\s+/).filter(Boolean), wanted = choice.value;
    var seen = 0, all = 0, strays = 0;
    tables.forEach(function (table, number) {
      Array.from(table.tBodies[0].rows).forEach(function (row) {
        var text = row.dataset.text.toLowerCase(), tags = row.dataset.tags.split(" ");
        var there = words.every(function (word) { return text.includes(word); }) && (!wanted || tags.includes(wanted));
        row.hidden = !there;
        if (number === 0 && row.dataset.stray === undefined) { all += 1; seen += there; }
        if (number === 0 && row.dataset.stray !== undefined) { strays += there; }
      });
    });
    said.textContent = (seen === all ? "All " + all : seen + " of " + all) + " " + what
      + (strays ? " and " + strays + (strays === 1 ? " recording" : " recordings") + " of no known gyro" : "") + " are shown.";
  }

  if (field) {
    document.getElementById("controls").hidden = false;
    field.addEventListener("input", filter);
    choice.addEventListener("change", filter);
    document.getElementById("controls").addEventListener("reset", function () { window.setTimeout(filter); });
    document.getElementById("controls").addEventListener("submit", function (event) { event.preventDefault(); });
    document.querySelectorAll("button[data-filter]").forEach(function (button) {
      button.disabled = false;
      button.addEventListener("click", function () {
        choice.value = "";
        field.value = button.dataset.filter;
        filter();
        field.focus();
        document.getElementById("gyros").scrollIntoView();
      });
    });
    filter();
  }
})();
