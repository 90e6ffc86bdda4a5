//! The controller as a MATLAB function, which Octave runs too.

use super::exported::{Exported, numbers};
use servotune::controller::ControlLaw;

/// The function: sections, sample time, and its own test.
pub(super) fn function(x: &Exported<'_>, law: &ControlLaw<'_>) -> String {
    let n = x.name;
    let rows = law.chain.iter().map(|s| format!("  {:e}, {:e}, {:e}, 1, {:e}, {:e}", s.b0, s.b1, s.b2, s.a1, s.a2));
    let rows = rows.collect::<Vec<_>>().join("\n");
    let list = |values: &[f64]| numbers(values.iter().map(|v| format!("{v:e}")), "  ").replace(",\n", ", ...\n");
    let f = x.controller.feedforward.unwrap_or_default();
    format!(
        "function c = {n}()\n% {n}  {source}\n% Made by a program: change the gains and export again.\n%   c.sos    rows b0 b1 b2 a0 a1 a2, in the order in which they run\n%   c.ts     sample time (s)\n%   c.limit  largest command (Inf: none)\n\
         %   c.test   largest difference of filter() from the command of the test vector; NaN with a feed-forward\n\
         %   As a model:  C = tf(1, 1, c.ts); for i = 1:size(c.sos, 1), C = C*tf(c.sos(i, 1:3), c.sos(i, 4:6), c.ts, 'Variable', 'z^-1'); end\n\
         c.sos = [\n{rows}];\nc.ts = {t:e};\nc.limit = {limit};\n\
         c.feedforward = [{factor:e}, {velocity:e}, {acceleration:e}, {ahead}];  % factor, velocity_s, acceleration_s2, ahead_samples\n\
         e = [ ...\n{error}];\nu = [ ...\n{command}];\n\
         y = e;\nfor i = 1:size(c.sos, 1)\n  y = filter(c.sos(i, 1:3), c.sos(i, 4:6), y);\nend\n\
         y = min(max(y, -c.limit), c.limit);\nc.test = max(abs(y - u));\nif any(c.feedforward), c.test = NaN; end\nend\n",
        source = x.source,
        t = x.controller.sample_time_s,
        limit = if law.limit.is_finite() { format!("{:e}", law.limit) } else { "Inf".to_owned() },
        factor = f.factor,
        velocity = f.velocity_s,
        acceleration = f.acceleration_s2,
        ahead = f.ahead_samples,
        error = list(&x.test.error),
        command = list(&x.test.command),
    )
}
