// Zoom, readout and legend for the pictures of this page. The pictures are complete without it.
var NS = "http://www.w3.org/2000/svg";
function make(parent, tag, attributes, text) {
  var e = document.createElementNS(NS, tag);
  for (var name in attributes) e.setAttribute(name, attributes[name]);
  if (text !== undefined) e.textContent = text;
  parent.appendChild(e);
  return e;
}
function axisOf(text, names) {
  var f = text.split(" ");
  var a = { log: f[0] === "log", policy: f[1], lo: Number(f[2]), hi: Number(f[3]) };
  a.from = a.lo; a.to = a.hi;
  a.names = names === undefined ? null : names.split("|").map(function (n) {
    var at = n.indexOf("=");
    return { value: Number(n.slice(0, at)), label: n.slice(at + 1) };
  });
  return a;
}
function marksOf(a, length, spacing) {
  if (!a.names) return ticks(a.log, a.policy, a.from, a.to, length, spacing);
  return a.names.filter(function (n) { return n.value >= a.from && n.value <= a.to; });
}
function bend(axis, value) {
  if (value === null || value === undefined) return NaN;
  return axis.log ? (value > 0 ? Math.log10(value) : NaN) : value;
}
function Plot(fig, svg, data, hidden, share) {
  var self = this;
  this.svg = svg; this.fig = fig; this.hidden = hidden; this.share = share; this.others = [];
  this.readout = svg.parentNode.appendChild(document.createElement("div"));
  this.readout.className = "readout plot"; this.readout.hidden = true;
  this.panels = Array.prototype.map.call(svg.querySelectorAll("g.panel"), function (g, i) {
    var a = g.dataset.area.split(" ").map(Number);
    var p = { g: g, x: a[0], y: a[1], w: a[2], h: a[3], ax: axisOf(g.dataset.x, g.dataset.namesX), ay: axisOf(g.dataset.y, g.dataset.namesY), equal: !!g.dataset.equal,
      labelled: !!g.dataset.labelled, data: data.panels[i], grid: g.querySelector(".grid"), tick: g.querySelector(".tick"),
      layer: g.querySelector(".data"), words: g.querySelectorAll(".word") };
    p.over = make(g, "g", { "class": "over" });
    p.free = p.equal;
    return p;
  });
  this.xs = data.xs;
  svg.setAttribute("role", "group"); svg.setAttribute("tabindex", "0");
  this.keys(); this.listen();
}
Plot.prototype.column = function (p, u) { return p.x + (u - p.ax.from) / (p.ax.to - p.ax.from) * p.w; };
Plot.prototype.row = function (p, u) { return p.y + (p.ay.to - u) / (p.ay.to - p.ay.from) * p.h; };
Plot.prototype.atColumn = function (p, x) { return p.ax.from + (x - p.x) / p.w * (p.ax.to - p.ax.from); };
Plot.prototype.atRow = function (p, y) { return p.ay.to - (y - p.y) / p.h * (p.ay.to - p.ay.from); };
Plot.prototype.home = function (p) { return p.ax.from === p.ax.lo && p.ax.to === p.ax.hi && p.ay.from === p.ay.lo && p.ay.to === p.ay.hi; };
// Keeps a view inside what there is to see, and its length above a thousandth of it.
function keep(axis, from, to, out) {
  var whole = axis.hi - axis.lo, span = Math.min(Math.max(to - from, whole / 1000), whole * out), middle = (from + to) / 2;
  from = middle - span / 2; to = middle + span / 2;
  var lo = axis.lo - whole * (out - 1) / 2, hi = axis.hi + whole * (out - 1) / 2;
  if (from < lo) { to += lo - from; from = lo; }
  if (to > hi) { from -= to - hi; to = hi; }
  axis.from = Math.abs(from - axis.lo) < whole * 1e-9 ? axis.lo : from;
  axis.to = Math.abs(to - axis.hi) < whole * 1e-9 ? axis.hi : to;
}
// Shows the stretch x0..x1, y0..y1 of a panel, and x0..x1 of the panels that share its axis; null leaves an axis as it is.
Plot.prototype.show = function (p, x, y) {
  var self = this, out = p.free ? 12 : 1;
  if (p.equal && x && y) {
    var k = Math.max((x[1] - x[0]) / p.w, (y[1] - y[0]) / p.h), mx = (x[0] + x[1]) / 2, my = (y[0] + y[1]) / 2;
    x = [mx - k * p.w / 2, mx + k * p.w / 2]; y = [my - k * p.h / 2, my + k * p.h / 2];
  }
  if (y) keep(p.ay, y[0], y[1], out);
  this.panels.forEach(function (q) {
    if (x && (q === p || self.share)) keep(q.ax, x[0], x[1], out);
    if (q === p || self.share) self.draw(q);
  });
  this.leave();
  this.mark();
};
Plot.prototype.reset = function () {
  var self = this;
  this.panels.forEach(function (p) {
    p.ax.from = p.ax.lo; p.ax.to = p.ax.hi; p.ay.from = p.ay.lo; p.ay.to = p.ay.hi;
    self.draw(p);
  });
  this.leave();
  this.mark();
};
Plot.prototype.mark = function () {
  var self = this, zoomed = this.panels.some(function (p) { return !self.home(p); });
  this.svg.classList.toggle("zoomed", zoomed);
  var button = this.fig.querySelector("button.reset");
  if (button) button.hidden = !this.fig.querySelector("svg.zoomed");
};
Plot.prototype.draw = function (p) {
  var sx = (p.ax.hi - p.ax.lo) / (p.ax.to - p.ax.from), sy = (p.ay.hi - p.ay.lo) / (p.ay.to - p.ay.from);
  var tx = p.x * (1 - sx) + p.w * (p.ax.lo - p.ax.from) / (p.ax.to - p.ax.from);
  var ty = p.y * (1 - sy) + p.h * (p.ay.to - p.ay.hi) / (p.ay.to - p.ay.from);
  Array.prototype.forEach.call(p.layer.children, function (e) {
    var only = e.getAttribute("data-only");
    e.setAttribute("transform", "matrix(" + [only === "y" ? 1 : sx, 0, 0, only === "x" ? 1 : sy, only === "y" ? 0 : tx, only === "x" ? 0 : ty].join(" ") + ")");
  });
  p.grid.textContent = ""; p.tick.textContent = "";
  var free = -Infinity, self = this;
  marksOf(p.ax, p.w, 62).forEach(function (t) {
    var at = self.column(p, bend(p.ax, t.value)), half = t.label ? t.label.length * 3.5 : 0;
    if (!p.ax.names) make(p.grid, "path", { d: "M" + at + " " + p.y + "v" + p.h, "class": t.label ? "" : "fine" });
    if (p.labelled && t.label && at - half > free) {
      free = at + half + 2;
      make(p.tick, "text", { x: at, y: p.y + p.h + 16, "text-anchor": "middle" }, t.label);
    }
  });
  marksOf(p.ay, p.h, 28).forEach(function (t) {
    var at = self.row(p, bend(p.ay, t.value));
    if (!p.ay.names) make(p.grid, "path", { d: "M" + p.x + " " + at + "h" + p.w, "class": t.label ? "" : "fine" });
    if (t.label) make(p.tick, "text", { x: p.x - 6, y: at + 4, "text-anchor": "end" }, t.label);
  });
  Array.prototype.forEach.call(p.words, function (e) { self.moveWord(p, e, [sx, tx, sy, ty]); });
};
// Words keep their distance from the place they name, and go when that place is out of sight.
Plot.prototype.moveWord = function (p, e, m) {
  var dx = 0, dy = 0, seen = true;
  if (e.dataset.from !== undefined) {
    var from = Math.max(p.x, m[0] * Number(e.dataset.from) + m[1]), to = Math.min(p.x + p.w, m[0] * Number(e.dataset.to) + m[1]);
    seen = to >= from;
    dx = this.home(p) ? 0 : (from + to) / 2 - Number(e.getAttribute("x"));
  } else {
    if (e.dataset.x !== undefined) {
      var x = m[0] * Number(e.dataset.x) + m[1];
      dx = x - Number(e.dataset.x); seen = x >= p.x && x <= p.x + p.w;
    }
    var y = m[2] * Number(e.dataset.y) + m[3];
    dy = y - Number(e.dataset.y); seen = seen && y >= p.y && y <= p.y + p.h;
  }
  e.setAttribute("transform", "translate(" + dx + " " + dy + ")");
  e.style.display = seen ? "" : "none";
  if (!seen || this.home(p) || e.dataset.from !== undefined || e.dataset.x === undefined) return;
  var box = e.getBBox(), left = box.x + dx, right = left + box.width;
  if (right > p.x + p.w) dx -= right - p.x - p.w + 4; else if (left < p.x) dx += p.x - left + 4;
  e.setAttribute("transform", "translate(" + dx + " " + dy + ")");
};
Plot.prototype.keys = function () {
  var self = this;
  Array.prototype.forEach.call(this.svg.querySelectorAll("g.key"), function (g) {
    var k = g.dataset.key;
    g.setAttribute("role", "button"); g.setAttribute("tabindex", "0"); g.setAttribute("aria-pressed", "true");
    function toggle(event) {
      self.hidden[k] = !self.hidden[k];
      self.others.forEach(function (plot) { plot.applyKeys(); });
      event.stopPropagation(); event.preventDefault();
    }
    g.addEventListener("click", toggle);
    g.addEventListener("keydown", function (e) { if (e.key === "Enter" || e.key === " ") toggle(e); });
  });
};
Plot.prototype.applyKeys = function () {
  var self = this;
  Array.prototype.forEach.call(this.svg.querySelectorAll("[data-k]"), function (e) { e.style.display = self.hidden[e.dataset.k] ? "none" : ""; });
  Array.prototype.forEach.call(this.svg.querySelectorAll("g.key"), function (g) {
    g.setAttribute("aria-pressed", String(!self.hidden[g.dataset.key]));
    g.style.opacity = self.hidden[g.dataset.key] ? 0.35 : "";
  });
  this.leave();
};
