// What the pointer is at, and how pointer, wheel and keys zoom.
function number(v) {
  if (v === null || v === undefined || !isFinite(v)) return "\u2014";
  var size = Math.abs(v);
  return minus(size !== 0 && (size < 1e-4 || size >= 1e6) ? v.toExponential(3) : String(Number(v.toPrecision(5))));
}
function withUnit(v, unit) { return number(v) + (unit ? "\u202f" + unit : ""); }
Plot.prototype.leave = function () {
  this.readout.hidden = true;
  this.panels.forEach(function (p) { p.over.textContent = ""; });
  this.tell(NaN);
};
// The index whose x is nearest, or of the x that is held; x ascends.
function nearest(axis, xs, u, held) {
  var best = -1, least = Infinity;
  if (!xs.length) return best;
  var lo = 0, hi = xs.length - 1;
  while (hi - lo > 1) { var mid = (lo + hi) >> 1; if (bend(axis, xs[mid]) <= u || isNaN(bend(axis, xs[mid]))) lo = mid; else hi = mid; }
  if (held) return bend(axis, xs[hi]) <= u ? hi : lo;
  for (var i = Math.max(0, lo - 1); i <= Math.min(xs.length - 1, hi + 1); i++) {
    var d = Math.abs(bend(axis, xs[i]) - u);
    if (d < least) { least = d; best = i; }
  }
  return best;
}
Plot.prototype.hover = function (p, x, y) {
  this.leave();
  if (this.scattered(p)) this.hoverPoint(p, x, y); else this.hoverColumn(p, x, y);
};
// Whether the panel must be read point by point: a curve with a parameter, or one whose x does not ascend.
Plot.prototype.scattered = function (p) {
  var xs = this.xs;
  if (p.points === undefined) p.points = p.data.series.some(function (s) {
    return s.along || xs[s.x].some(function (x, i, all) { return i > 0 && x !== null && all[i - 1] !== null && x < all[i - 1]; });
  });
  return p.points;
};
Plot.prototype.hoverPoint = function (p, x, y) {
  var self = this, best = null, least = 80 * 80;
  p.data.series.forEach(function (s) {
    if (self.hidden[s.key]) return;
    var xs = self.xs[s.x];
    for (var i = 0; i < xs.length; i++) {
      var dx = self.column(p, bend(p.ax, xs[i])) - x, dy = self.row(p, bend(p.ay, s.y[i])) - y, d = dx * dx + dy * dy;
      if (d < least) { least = d; best = { s: s, i: i, x: x + dx, y: y + dy }; }
    }
  });
  if (!best) return;
  make(p.over, "circle", { cx: best.x, cy: best.y, r: 4.5, "class": "spot " + best.s.ink });
  var d = p.data, i = best.i, s = best.s;
  var lines = [[s.name, "", s.ink]];
  if (s.along) lines.push([s.along.label, withUnit(s.along.v[i], s.along.unit)]);
  lines.push([d.xl, withUnit(this.xs[s.x][i], d.xu)], [d.yl, withUnit(s.y[i], d.yu)]);
  if (p.equal) lines.push(["distance from \u22121", number(Math.hypot(1 + this.xs[s.x][i], s.y[i]))]);
  this.say(lines, best.x, best.y);
  if (s.along && s.along.unit === "Hz") this.tell(Math.abs(s.along.v[i]));
};
Plot.prototype.hoverColumn = function (p, x, y) {
  var self = this, u = this.atColumn(p, x), panels = this.share ? this.panels : [p], at = NaN, least = Infinity;
  panels.forEach(function (q) {
    q.data.series.forEach(function (s) {
      if (self.hidden[s.key]) return;
      var v = bend(q.ax, self.xs[s.x][nearest(q.ax, self.xs[s.x], u)]);
      if (Math.abs(v - u) < least) { least = Math.abs(v - u); at = v; }
    });
  });
  if (isNaN(at)) return;
  var lines = [[p.data.xl, withUnit(p.ax.log ? Math.pow(10, at) : at, p.data.xu)]], near = 8 / p.w * (p.ax.to - p.ax.from);
  panels.forEach(function (q) {
    var column = self.column(q, at);
    make(q.over, "path", { "class": "cross", d: "M" + column + " " + q.y + "v" + q.h });
    q.data.series.forEach(function (s) {
      var i = nearest(q.ax, self.xs[s.x], at, s.kind === "stairs");
      if (self.hidden[s.key] || i < 0 || (s.kind !== "stairs" && Math.abs(bend(q.ax, self.xs[s.x][i]) - at) > near)) return;
      var value = withUnit(s.y[i], q.data.yu);
      if (s.upper) value = number(s.y[i]) + " to " + withUnit(s.upper[i], q.data.yu);
      var named = panels.length > 1 && q.data.yl.toLowerCase() !== s.name.toLowerCase();
      lines.push([s.name + (named ? ", " + q.data.yl : ""), value, s.ink]);
      var row = self.row(q, bend(q.ay, s.y[i]));
      if (!s.upper && row >= q.y && row <= q.y + q.h) make(q.over, "circle", { cx: column, cy: row, r: 3.5, "class": "spot " + s.ink });
    });
  });
  this.say(lines, this.column(p, at), y);
  if (overFrequency(p)) this.tell(p.ax.log ? Math.pow(10, at) : at);
};
Plot.prototype.say = function (lines, x, y) {
  var box = this.readout, scale = this.svg.getBoundingClientRect().width / this.svg.viewBox.baseVal.width;
  box.textContent = "";
  lines.forEach(function (l) {
    var row = box.appendChild(document.createElement("div"));
    var name = row.appendChild(document.createElement("span"));
    if (l[2]) name.appendChild(document.createElement("i")).className = l[2];
    name.appendChild(document.createTextNode(l[0]));
    row.appendChild(document.createElement("b")).textContent = l[1];
  });
  box.hidden = false;
  var whole = this.svg.parentNode.clientWidth, left = x * scale + 16;
  if (left + box.offsetWidth > whole) left = x * scale - box.offsetWidth - 16;
  box.style.left = Math.max(0, Math.min(left, whole - box.offsetWidth)) + "px";
  box.style.top = Math.max(0, y * scale - box.offsetHeight - 12) + "px";
};
Plot.prototype.place = function (event) {
  var r = this.svg.getBoundingClientRect(), k = this.svg.viewBox.baseVal.width / r.width;
  return { x: (event.clientX - r.left) * k, y: (event.clientY - r.top) * k };
};
Plot.prototype.panelAt = function (at) {
  return this.panels.filter(function (p) { return at.x >= p.x && at.x <= p.x + p.w && at.y >= p.y - 4 && at.y <= p.y + p.h + 4; })[0];
};
function about(from, to, at, factor) { return [at - (at - from) * factor, at + (to - at) * factor]; }
Plot.prototype.scale = function (p, at, factor, both) {
  var x = about(p.ax.from, p.ax.to, this.atColumn(p, at.x), factor), y = about(p.ay.from, p.ay.to, this.atRow(p, at.y), factor);
  this.show(p, x, p.equal || both ? y : null);
};
Plot.prototype.shift = function (p, dx, dy) {
  var ux = dx / p.w * (p.ax.to - p.ax.from), uy = dy / p.h * (p.ay.to - p.ay.from);
  this.show(p, [p.ax.from - ux, p.ax.to - ux], [p.ay.from + uy, p.ay.to + uy]);
};
Plot.prototype.listen = function () {
  var self = this, svg = this.svg, fingers = {}, drag = null, pinch = null;
  function pair() { return Object.keys(fingers).map(function (k) { return fingers[k]; }); }
  svg.addEventListener("pointerdown", function (e) {
    var at = self.place(e), p = self.panelAt(at);
    if (!p || e.button > 1) return;
    fingers[e.pointerId] = at;
    try { svg.setPointerCapture(e.pointerId); } catch (ignored) { /* A pointer that is gone cannot be held. */ }
    if (pair().length === 2) { drag = null; pinch = { p: p, before: pair() }; return; }
    if (e.pointerType === "touch") { self.hover(p, at.x, at.y); return; }
    svg.focus({ preventScroll: true });
    drag = { p: p, at: at, last: at, pan: e.shiftKey || e.button === 1, box: null };
    e.preventDefault();
  });
  svg.addEventListener("pointermove", function (e) {
    var at = self.place(e), p = self.panelAt(at);
    if (fingers[e.pointerId]) fingers[e.pointerId] = at;
    if (pinch && pair().length === 2) {
      var a = pinch.before, b = pair(), span = function (q) { return Math.hypot(q[0].x - q[1].x, q[0].y - q[1].y); };
      var mid = function (q) { return { x: (q[0].x + q[1].x) / 2, y: (q[0].y + q[1].y) / 2 }; };
      self.shift(pinch.p, mid(b).x - mid(a).x, pinch.p.equal ? mid(b).y - mid(a).y : 0);
      self.scale(pinch.p, mid(b), span(a) / Math.max(span(b), 1), false);
      pinch.before = b.map(function (f) { return { x: f.x, y: f.y }; });
    } else if (drag && drag.pan) {
      self.shift(drag.p, at.x - drag.last.x, at.y - drag.last.y);
      drag.last = at;
    } else if (drag) {
      self.leave();
      drag.box = self.boxTo(drag, at);
    } else if (p) self.hover(p, at.x, at.y); else self.leave();
  });
  function up(e) {
    delete fingers[e.pointerId];
    if (pair().length < 2) pinch = null;
    if (!drag) return;
    var d = drag, box = d.box;
    drag = null;
    d.p.over.textContent = "";
    if (box && e.type !== "pointercancel" && (box.w > 8 || box.h > 8)) {
      self.show(d.p, box.w > 8 ? [self.atColumn(d.p, box.x), self.atColumn(d.p, box.x + box.w)] : null,
        box.h > 8 ? [self.atRow(d.p, box.y + box.h), self.atRow(d.p, box.y)] : null);
    }
  }
  svg.addEventListener("pointerup", up);
  svg.addEventListener("pointercancel", up);
  // A finger that is lifted leaves its readout; the next touch elsewhere takes it away.
  svg.addEventListener("pointerleave", function (e) { if (!drag && e.pointerType !== "touch") self.leave(); });
  document.addEventListener("pointerdown", function (e) { if (!svg.contains(e.target)) self.leave(); });
  svg.addEventListener("dblclick", function (e) { self.reset(); e.preventDefault(); });
  // A page that scrolls must not be caught by a picture: the wheel zooms once the picture has been clicked, or with Ctrl.
  svg.addEventListener("wheel", function (e) {
    var at = self.place(e), p = self.panelAt(at);
    if (!p || !(e.ctrlKey || e.metaKey || document.activeElement === svg)) return;
    e.preventDefault();
    self.scale(p, at, Math.exp(Math.max(-1, Math.min(1, e.deltaY * (e.deltaMode === 1 ? 0.05 : 0.002)))), e.shiftKey);
  }, { passive: false });
  svg.addEventListener("keydown", function (e) {
    var p = self.panels[0], mid = { x: p.x + p.w / 2, y: p.y + p.h / 2 }, known = true;
    if (e.target !== svg || e.ctrlKey || e.metaKey || e.altKey) return;
    if (e.key === "+" || e.key === "=") self.scale(p, mid, 0.7, false);
    else if (e.key === "-") self.scale(p, mid, 1 / 0.7, false);
    else if (e.key === "ArrowLeft") self.shift(p, p.w / 10, 0);
    else if (e.key === "ArrowRight") self.shift(p, -p.w / 10, 0);
    else if (e.key === "Escape" || e.key === "0") self.reset();
    else known = false;
    if (known) e.preventDefault();
  });
};
// The box that a drag has drawn; a drag along one axis only takes the whole of the other.
Plot.prototype.boxTo = function (drag, at) {
  var p = drag.p, x = Math.min(Math.max(at.x, p.x), p.x + p.w), y = Math.min(Math.max(at.y, p.y), p.y + p.h);
  var box = { x: Math.min(x, drag.at.x), y: Math.min(y, drag.at.y), w: Math.abs(x - drag.at.x), h: Math.abs(y - drag.at.y) };
  if (!p.equal && box.h < 12 && box.w > box.h) { box.h = 0; }
  if (!p.equal && box.w < 12 && box.h > box.w) { box.w = 0; }
  p.over.textContent = "";
  make(p.over, "rect", { "class": "box", x: box.w ? box.x : p.x, y: box.h ? box.y : p.y, width: box.w || p.w, height: box.h || p.h });
  return box;
};
var every = [];
Array.prototype.forEach.call(document.querySelectorAll("figure.fig"), function (fig) {
  var data = JSON.parse(fig.querySelector("script.plot-data").textContent), hidden = {};
  var plots = Array.prototype.map.call(fig.querySelectorAll("svg.plot"), function (svg) { return new Plot(fig, svg, data, hidden, data.share); });
  plots.forEach(function (plot) { plot.others = plots; every.push(plot); });
  var button = fig.querySelector("button.reset");
  if (button) button.addEventListener("click", function () { plots.forEach(function (plot) { plot.reset(); }); });
});
document.documentElement.classList.add("js");
