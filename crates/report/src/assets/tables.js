// Tables that sort, filter and fit their width; folds on paper; the numbers of a figure as CSV. The page is complete without it.
function each(list, f) { Array.prototype.forEach.call(list, f); }
function words(cell) { return cell ? cell.textContent.trim() : ""; }
function valueOf(cell) {
  var v = cell && cell.getAttribute("data-v");
  return v === null || v === undefined || v === "" ? null : Number(v);
}
function sortBy(table, column, down) {
  var body = table.tBodies[0], rows = Array.prototype.slice.call(body.rows);
  rows.forEach(function (r, i) { if (r.dataset.at === undefined) r.dataset.at = i; });
  rows.sort(function (a, b) {
    var x = valueOf(a.cells[column]), y = valueOf(b.cells[column]), d;
    if (x !== null && y !== null) d = x - y;
    // What is missing comes last either way.
    else if (x !== null || y !== null) return x === null ? 1 : -1;
    else d = words(a.cells[column]).localeCompare(words(b.cells[column]), "en", { numeric: true });
    return (down ? -d : d) || a.dataset.at - b.dataset.at;
  });
  rows.forEach(function (r) { body.appendChild(r); });
}
function sortable(table) {
  var heads = table.tHead.rows[0].cells;
  each(heads, function (th, k) {
    var b = document.createElement("button");
    b.type = "button"; b.className = "sort"; b.title = "Sort by this column";
    while (th.firstChild) b.appendChild(th.firstChild);
    th.appendChild(b);
    b.addEventListener("click", function () {
      var down = th.getAttribute("aria-sort") === "ascending";
      each(heads, function (h) { h.removeAttribute("aria-sort"); });
      th.setAttribute("aria-sort", down ? "descending" : "ascending");
      sortBy(table, k, down);
    });
  });
}
function filterable(table, scroll) {
  var label = document.createElement("label"), input = document.createElement("input"), said = document.createElement("span");
  label.className = "filter"; input.type = "search"; input.placeholder = "words in a row";
  label.appendChild(document.createTextNode("Filter ")); label.appendChild(input); label.appendChild(said);
  scroll.parentNode.insertBefore(label, scroll);
  input.addEventListener("input", function () {
    var wanted = input.value.toLowerCase().split(/\s+/), shown = 0, rows = table.tBodies[0].rows;
    each(rows, function (r) {
      var text = r.textContent.toLowerCase(), fits = wanted.every(function (w) { return text.indexOf(w) >= 0; });
      r.hidden = !fits; shown += fits ? 1 : 0;
    });
    said.textContent = input.value ? " " + shown + " of " + rows.length : "";
  });
}
// Too wide for its card: smaller first, then a row for each value, so that no column is cut.
function fit(scroll) {
  var table = scroll.querySelector("table");
  table.classList.remove("tight", "stack");
  if (scroll.scrollWidth <= scroll.clientWidth + 1) return;
  table.classList.add("tight");
  if (scroll.scrollWidth <= scroll.clientWidth + 1) return;
  table.classList.remove("tight");
  table.classList.add("stack");
}
var scrolls = document.querySelectorAll(".scroll");
each(scrolls, function (scroll) {
  var table = scroll.querySelector("table"), rows = table.tBodies[0].rows;
  var heads = Array.prototype.map.call(table.tHead.rows[0].cells, words);
  each(rows, function (r) { each(r.cells, function (c, k) { if (k > 0 && heads[k]) c.setAttribute("data-h", heads[k]); }); });
  if (rows.length > 2) sortable(table);
  if (rows.length > 12) filterable(table, scroll);
});
function fitAll() { each(scrolls, fit); }
fitAll();
window.addEventListener("resize", fitAll);
// What is folded has no width yet: it is fitted when it opens.
each(document.querySelectorAll("details"), function (d) {
  d.addEventListener("toggle", function () { if (d.open) each(d.querySelectorAll(".scroll"), fit); });
});
window.addEventListener("beforeprint", function () {
  each(document.querySelectorAll("details:not([open])"), function (d) { d.dataset.shut = "1"; d.open = true; });
  // The width of a sheet of A4 within its margins.
  document.body.classList.add("paper");
  fitAll();
});
window.addEventListener("afterprint", function () {
  each(document.querySelectorAll("details[data-shut]"), function (d) { delete d.dataset.shut; d.open = false; });
  document.body.classList.remove("paper");
  fitAll();
});
function quoted(text) { return /[",\n]/.test(text) ? '"' + text.replace(/"/g, '""') + '"' : text; }
// One block of columns for each panel: abscissa, then every curve on it.
function csvOf(data) {
  return data.panels.map(function (p) {
    var groups = {};
    p.series.forEach(function (s) { (groups[s.x] = groups[s.x] || []).push(s); });
    return Object.keys(groups).map(function (x) {
      var all = groups[x], unit = function (l, u) { return quoted(u ? l + " (" + u + ")" : l); };
      var head = [unit(p.xl, p.xu)].concat(all.map(function (s) { return unit(s.name + ", " + p.yl, p.yu); }));
      var rows = data.xs[x].map(function (v, i) {
        return [v].concat(all.map(function (s) { return s.y[i]; })).map(function (n) { return n === null ? "" : n; }).join(",");
      });
      return [head.join(",")].concat(rows).join("\n");
    }).join("\n\n");
  }).join("\n\n") + "\n";
}
each(document.querySelectorAll("figure.fig"), function (fig, at) {
  var button = fig.querySelector("button.csv");
  if (!button) return;
  button.hidden = false;
  button.addEventListener("click", function () {
    var data = JSON.parse(fig.querySelector("script.plot-data").textContent), a = document.createElement("a");
    a.href = URL.createObjectURL(new Blob([csvOf(data)], { type: "text/csv" }));
    a.download = "figure" + (at + 1) + ".csv";
    a.click();
    setTimeout(function () { URL.revokeObjectURL(a.href); }, 1000);
  });
});
