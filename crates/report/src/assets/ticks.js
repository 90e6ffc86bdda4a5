// Tick marks for a zoomed view; the same rules as report/ticks.rs, which draws the unzoomed picture.
function step(policy, raw) {
  if (policy === "whole") raw = Math.max(raw, 1);
  var fixed = { db: [2, 5, 10, 20, 40, 60, 80, 100], deg: [2, 5, 10, 15, 30, 45, 90, 180] }[policy] || [];
  if (raw > 1) {
    for (var i = 0; i < fixed.length; i++) if (fixed[i] >= raw) return fixed[i];
  }
  var unit = raw > 1 && policy === "deg" ? 360 : 1;
  var power = Math.pow(10, Math.floor(Math.log10(raw / unit)));
  var steps = [1, 2, 5, 10];
  for (var k = 0; k < 4; k++) if (steps[k] * power * unit >= raw * (1 - 1e-9)) return steps[k] * power * unit;
  return raw;
}
function minus(text) { return text.replace(/-/g, "\u2212"); }
function label(value, size) {
  var largest = Math.max(Math.abs(value), size);
  if (value !== 0 && (largest < 1e-5 || largest >= 1e7)) return minus(Number(value.toPrecision(8)).toExponential());
  var decimals = Math.min(9, Math.max(0, -Math.floor(Math.log10(size) + 1e-9)));
  var text = value.toFixed(decimals);
  return minus(Number(text) === 0 ? text.replace("-", "") : text);
}
function linear(lo, hi, policy, length, spacing) {
  var s = step(policy, (hi - lo) / Math.max(2, Math.floor(length / spacing))), found = [];
  if (!(s > 0) || !isFinite(s)) return found;
  var first = Math.ceil(lo / s - 1e-6), last = Math.floor(hi / s + 1e-6);
  for (var k = first; k <= last && k - first < 200; k++) found.push({ value: k * s, label: label(k * s, s) });
  return found;
}
// lo and hi are logarithms where log is true.
function ticks(log, policy, lo, hi, length, spacing) {
  if (!log) return linear(lo, hi, policy, length, spacing);
  var per = length / Math.max(hi - lo, 1e-12), wide = per >= 1.7 * spacing, found = [], words = 0;
  var stride = Math.max(1, Math.ceil(0.7 * spacing / per));
  for (var d = Math.floor(lo); d <= Math.ceil(hi); d++) {
    for (var m = 1; m <= 9; m++) {
      var value = m * Math.pow(10, d), at = Math.log10(value);
      if (at < lo - 1e-9 || at > hi + 1e-9) continue;
      var worded = (m === 1 || (wide && (m === 2 || m === 5))) && d % stride === 0;
      if (worded) words++;
      if (worded || per >= spacing) found.push({ value: value, label: worded ? label(value, value) : null });
    }
  }
  return words >= 2 ? found : linear(Math.pow(10, lo), Math.pow(10, hi), policy, length, spacing);
}
