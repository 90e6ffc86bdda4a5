// One frequency in all pictures of a section: where the pointer reads a curve over frequency, or a point of a Nyquist curve, the others show the same place.
function overFrequency(p) { return p.data.xl === "Frequency" && p.data.xu === "Hz"; }
// The narrow twin of this picture is one of them: it is out of sight, and cleared with the rest.
Plot.prototype.partners = function () {
  var self = this, section = this.fig.closest("section[id]");
  if (!this.near) this.near = every.filter(function (q) { return q !== self && q.fig.closest("section[id]") === section; });
  return this.near;
};
Plot.prototype.tell = function (hz) {
  this.partners().forEach(function (q) { q.follow(hz); });
};
// Shows a frequency (Hz) that another picture reads; not a number takes it away.
Plot.prototype.follow = function (hz) {
  var self = this;
  this.panels.forEach(function (p) {
    p.over.textContent = "";
    if (!(hz > 0)) return;
    if (overFrequency(p)) {
      var x = self.column(p, bend(p.ax, hz));
      if (x >= p.x && x <= p.x + p.w) make(p.over, "path", { "class": "cross link", d: "M" + x + " " + p.y + "v" + p.h });
    }
    p.data.series.forEach(function (s) {
      if (!s.along || s.along.unit !== "Hz" || self.hidden[s.key]) return;
      var i = nearest({ log: true }, s.along.v, Math.log10(hz), false);
      if (i < 0 || !(Math.abs(Math.log10(s.along.v[i] / hz)) < 0.02)) return;
      var cx = self.column(p, bend(p.ax, self.xs[s.x][i])), cy = self.row(p, bend(p.ay, s.y[i]));
      if (cx >= p.x && cx <= p.x + p.w && cy >= p.y && cy <= p.y + p.h) make(p.over, "circle", { cx: cx, cy: cy, r: 5, "class": "spot link " + s.ink });
    });
  });
};
