//! The controller as a C99 header in double precision.

use super::exported::{Exported, numbers};
use servotune::controller::{ControlLaw, Feedforward};
use std::fmt::Write;

/// The header. Operations stand in the order in which the library does them, so that the last bit agrees where the compiler fuses nothing.
pub(super) fn header(x: &Exported<'_>, law: &ControlLaw<'_>) -> String {
    let (n, big) = (x.name, x.name.to_uppercase());
    let count = law.chain.len();
    let rows = law.chain.iter().map(|s| format!("    {{{:e}, {:e}, {:e}, {:e}, {:e}}}", s.b0, s.b1, s.b2, s.a1, s.a2));
    let rows = rows.collect::<Vec<_>>().join(",\n");
    let limit = match law.limit.is_finite() {
        true => format!("    if (u > {0:e}) return {0:e};\n    if (u < -{0:e}) return -{0:e};\n", law.limit),
        false => String::new(),
    };
    let Feedforward { factor, velocity_s: velocity, acceleration_s2: acceleration, ahead_samples: ahead } =
        x.controller.feedforward.unwrap_or_default();
    let [before, now, next] = [-1, 0, 1].map(|i| sample(i64::from(ahead) + i));
    let mut text = format!(
        "/* {source}.\n   Made by a program: change the gains and export again.\n\n   \
         e = reference - position; once in {t:e} s:\n     u[k] = {n}_limit({n}_step(&state, e[k]) + {n}_ahead({before}, {now}, {next}))\n   \
         Each section: y = b0 x + m0;  m0 = b1 x - a1 y + m1;  m1 = b2 x - a2 y  (transposed direct form II).\n   \
         Last bits agree with the library where nothing is fused: cc -ffp-contract=off. */\n\
         #ifndef {big}_H\n#define {big}_H\n\n#define {big}_SECTIONS {count}\n#define {big}_SAMPLE_TIME_S {t:e}\n\n\
         /* b0, b1, b2, a1, a2 with a0 = 1, in the order in which they run */\n\
         static const double {n}_section[{big}_SECTIONS][5] = {{\n{rows}\n}};\n\n\
         /* all zeros: at rest */\ntypedef struct {{ double m[{big}_SECTIONS][2]; }} {n}_state;\n\n",
        source = x.source,
        t = x.controller.sample_time_s,
    );
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        "static inline double {n}_step({n}_state *s, double e) {{\n    int i;\n    double x = e, y;\n    for (i = 0; i < {big}_SECTIONS; i++) {{\n        \
         const double *c = {n}_section[i];\n        y = c[0] * x + s->m[i][0];\n        s->m[i][0] = c[1] * x - c[3] * y + s->m[i][1];\n        \
         s->m[i][1] = c[2] * x - c[4] * y;\n        x = y;\n    }}\n    return x;\n}}\n\n\
         /* feed-forward of a reference that is known ahead: {before}, {now}, {next} */\n\
         static inline double {n}_ahead(double before, double now, double next) {{\n    const double t = {big}_SAMPLE_TIME_S;\n    \
         return {factor:e} * ({velocity:e} * (next - before) / (2.0 * t) + {acceleration:e} * (next - 2.0 * now + before) / (t * t));\n}}\n\n\
         static inline double {n}_limit(double u) {{\n{limit}    return u;\n}}\n\n{test}\n#endif\n",
        test = test(x),
    );
    text
}

/// The reference at a sample counted from the present one.
fn sample(from_now: i64) -> String {
    if from_now == 0 { "r[k]".into() } else { format!("r[k{from_now:+}]") }
}

/// The test vector, and a function that counts the samples which differ.
fn test(x: &Exported<'_>) -> String {
    let (n, big) = (x.name, x.name.to_uppercase());
    let list = |values: &[f64]| numbers(values.iter().map(|v| format!("{v:e}")), "    ");
    let count = x.test.error.len();
    format!(
        "#ifdef {big}_TEST\n#define {big}_TEST_SAMPLES {count}\n\
         static const double {n}_test_reference[{count}] = {{\n{}\n}};\nstatic const double {n}_test_error[{count}] = {{\n{}\n}};\n\
         static const double {n}_test_command[{count}] = {{\n{}\n}};\n\n\
         /* samples that differ from the library's; 0 is right */\nstatic inline int {n}_test(void) {{\n    {n}_state s = {{{{{{0.0}}}}}};\n    int k, i, wrong = 0;\n    \
         for (k = 0; k < {count}; k++) {{\n        double r[3], u;\n        \
         for (i = 0; i < 3; i++) {{\n            const int at = k + {ahead} + i - 1;\n            \
         r[i] = {n}_test_reference[at < 0 ? 0 : at < {count} ? at : {count} - 1];\n        }}\n        \
         u = {n}_limit({n}_step(&s, {n}_test_error[k]) + {n}_ahead(r[0], r[1], r[2]));\n        \
         if (u != {n}_test_command[k]) wrong++;\n    }}\n    return wrong;\n}}\n#endif\n",
        list(&x.test.reference),
        list(&x.test.error),
        list(&x.test.command),
        ahead = x.controller.feedforward.map_or(0, |f| f.ahead_samples),
    )
}
