//! The controller as a function block in structured text (IEC 61131-3).

use super::exported::Exported;
use servotune::controller::ControlLaw;

/// The block, its test vector in a comment.
pub(super) fn block(x: &Exported<'_>, law: &ControlLaw<'_>) -> String {
    let name = x.name;
    // Every LREAL literal has a point.
    let real = |v: f64| {
        let text = format!("{v:e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        let point = if digits.contains('.') { "" } else { ".0" };
        format!("{digits}{point}E{power}")
    };
    let mut body = String::from("x := Error;\n");
    for (i, s) in law.chain.iter().enumerate() {
        body += &format!(
            "(* section {i} *)\ny := {b0} * x + M[{i}, 0];\nM[{i}, 0] := {b1} * x - ({a1}) * y + M[{i}, 1];\nM[{i}, 1] := {b2} * x - ({a2}) * y;\nx := y;\n",
            b0 = real(s.b0),
            b1 = real(s.b1),
            b2 = real(s.b2),
            a1 = real(s.a1),
            a2 = real(s.a2)
        );
    }
    if let Some(f) = &x.controller.feedforward {
        let t = x.controller.sample_time_s;
        body += &format!(
            "x := x + {} * ({} * (Next - Before) / {} + {} * (Next - 2.0 * Now + Before) / {});\n",
            real(f.factor),
            real(f.velocity_s),
            real(2.0 * t),
            real(f.acceleration_s2),
            real(t * t)
        );
    }
    body += &match law.limit.is_finite() {
        true => format!("Command := LIMIT({}, x, {});\n", real(-law.limit), real(law.limit)),
        false => "Command := x;\n".to_owned(),
    };
    let ahead = x.controller.feedforward.map_or(String::new(), |f| match f.ahead_samples {
        0 => "    Before, Now, Next : LREAL; (* reference one sample ago, now, one sample ahead *)\n".into(),
        n => format!("    Before, Now, Next : LREAL; (* reference {}, {n} and {} samples ahead *)\n", n - 1, n + 1),
    });
    let rows = x.test.error.iter().zip(&x.test.command).zip(&x.test.reference);
    let rows: String = rows.map(|((e, u), r)| format!("   {} {} {}\n", real(*r), real(*e), real(*u))).collect();
    format!(
        "(* {source}.\n   Made by a program: change the gains and export again.\n   Call once in {t} s with Error := reference - position. *)\n\
         FUNCTION_BLOCK {name}\nVAR_INPUT\n    Error : LREAL;\n{ahead}END_VAR\nVAR_OUTPUT\n    Command : LREAL;\nEND_VAR\nVAR\n    \
         M : ARRAY[0..{last}, 0..1] OF LREAL; (* 0 at rest *)\n    x, y : LREAL;\nEND_VAR\n\n{body}END_FUNCTION_BLOCK\n\n\
         (* Test from rest: reference, error, command.\n{rows}*)\n",
        source = x.source,
        t = real(x.controller.sample_time_s),
        last = law.chain.len() - 1,
    )
}
