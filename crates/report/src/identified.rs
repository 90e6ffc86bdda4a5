//! An identified plant in words and pictures.

use super::ReportError;
use super::bode::{BodeCurve, BodeMarks, bode_with_residual};
use super::figure::Figure;
use super::number::NumberFormat;
use super::table::{Cell, Column, Table, Verdict};
use servotune::frf::Frf;
use servotune::identify::{Identified, ModeIntervals, ParameterEstimate};
use servotune::lti::{Body, FrequencyResponse};
use std::f64::consts::TAU;

/// The ladder of norm errors, the paper's Table 1.
pub fn ladder_table(id: &Identified) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "Ladder of errors (norm error: eq. 19)",
        vec![
            Column::words("model"),
            Column::numbers("order", "", NumberFormat::Decimals(0)),
            Column::numbers("norm error", &unit_of_response(id), digits),
            Column::numbers("relative rms error", "%", digits),
        ],
    );
    for rung in &id.ladder {
        let relative = 100.0 * rung.relative_rms;
        table.push(vec![rung.model.into(), (rung.order as f64).into(), rung.norm_error.into(), relative.into()])?;
    }
    Ok(table)
}

fn unit_of_response(id: &Identified) -> String {
    format!("{}/{}", id.plant.position_unit, id.plant.command_unit)
}

/// Largest ratio of an interval's ends, and largest width in multiples of the value where it holds 0: beyond it the sweep says nothing of the number.
const TELLING: f64 = 100.0;

fn tells_nothing(i: ParameterEstimate) -> bool {
    let ends = (i.low.abs(), i.high.abs());
    let wide = i.high - i.low > TELLING * i.value.abs().max(f64::MIN_POSITIVE);
    let one_side = i.low * i.high > 0.0;
    !(i.low.is_finite() && i.high.is_finite())
        || if one_side { ends.0.max(ends.1) > TELLING * ends.0.min(ends.1) } else { wide && i.value != 0.0 }
}

/// The keys of which the sweep says nothing, in short names.
fn untold(id: &Identified) -> Vec<String> {
    let i = &id.intervals;
    let body = [
        ("dc_gain", i.dc_gain),
        ("acceleration gain", Some(i.acceleration_gain)),
        ("natural frequency", i.natural_frequency_rad_s),
        ("damping ratio", i.damping_ratio),
        ("viscous rate", i.viscous_rate_per_s),
    ];
    let mut all: Vec<String> =
        body.iter().filter(|(_, x)| x.is_some_and(tells_nothing)).map(|(name, _)| (*name).to_owned()).collect();
    let of_mode = |m: &ModeIntervals| [m.zero_rad_s, m.zero_damping_ratio, m.pole_rad_s, m.pole_damping_ratio];
    let modes = i.modes.iter().enumerate().filter(|(_, m)| of_mode(m).into_iter().any(tells_nothing));
    all.extend(modes.map(|(n, _)| format!("mode {}", n + 1)));
    all
}

/// The gain at rest, where it is not the file's `dc_gain`.
fn gain_at_rest(id: &Identified) -> Option<String> {
    let Body::SecondOrder { dc_gain, .. } = id.plant.body else { return None };
    let rest = id.plant.at(0.0).re;
    let digits = NumberFormat::Significant(5);
    ((rest / dc_gain - 1.0).abs() > 1e-3).then(|| {
        format!(
            "Gain at rest: {} {}. The key dc_gain ({}) is the body's alone; the resonance pairs, which are 1 at high frequency, bring the rest.",
            digits.text(rest),
            unit_of_response(id),
            digits.text(dc_gain)
        )
    })
}

/// Parameters with their 95 % intervals.
pub fn parameter_table(id: &Identified) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(6);
    let mut table = Table::new(
        "Parameters with 95 % intervals",
        vec![
            Column::words("parameter"),
            Column::numbers("value", "", digits),
            Column::numbers("low", "", digits),
            Column::numbers("high", "", digits),
            Column::words("unit"),
        ],
    );
    let mut row = |name: String, key: String, i: ParameterEstimate, scale: f64, unit: &str| {
        let value = Cell::from(i.value * scale);
        let value = if id.at_bound.contains(&key) { value.flagged(Verdict::Warn, "at bound") } else { value };
        if tells_nothing(i) {
            let none = || Cell::from(f64::NAN);
            let value = Cell::from(i.value * scale).flagged(Verdict::Warn, "not told by this sweep");
            return table.push(vec![name.as_str().into(), value, none(), none(), unit.into()]);
        }
        table.push(vec![name.as_str().into(), value, (i.low * scale).into(), (i.high * scale).into(), unit.into()])
    };
    let response = unit_of_response(id);
    let i = &id.intervals;
    if let Some(k) = i.dc_gain {
        row("dc_gain of the body".into(), "plant.dc_gain".into(), k, 1.0, &response)?;
    }
    row(
        "acceleration gain".into(),
        "plant.acceleration_gain".into(),
        i.acceleration_gain,
        1.0,
        &format!("{response}/s^2"),
    )?;
    if let Some(w) = i.natural_frequency_rad_s {
        row("natural frequency".into(), "plant.natural_frequency_rad_s".into(), w, 1.0 / TAU, "Hz")?;
    }
    if let Some(d) = i.damping_ratio {
        row("damping ratio".into(), "plant.damping_ratio".into(), d, 1.0, "")?;
    }
    if let Some(v) = i.viscous_rate_per_s {
        row("viscous rate".into(), "plant.viscous_rate_per_s".into(), v, 1.0, "1/s")?;
    }
    row("delay".into(), "plant.delay_s".into(), i.delay_s, 1e6, "us")?;
    for (n, m) in i.modes.iter().enumerate() {
        let key = |name: &str| format!("plant.modes[{n}].{name}");
        let name = |what: &str| format!("mode {} {what}", n + 1);
        row(name("zero"), key("zero_rad_s"), m.zero_rad_s, 1.0 / TAU, "Hz")?;
        row(name("zero damping"), key("zero_damping_ratio"), m.zero_damping_ratio, 1.0, "")?;
        row(name("pole"), key("pole_rad_s"), m.pole_rad_s, 1.0 / TAU, "Hz")?;
        row(name("pole damping"), key("pole_damping_ratio"), m.pole_damping_ratio, 1.0, "")?;
    }
    Ok(table)
}

/// Held-out score of every order tried.
pub fn order_table(id: &Identified) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "Order by frequencies left out of the fit",
        vec![
            Column::numbers("order", "", NumberFormat::Decimals(0)),
            Column::numbers("held-out error", "%", digits),
            Column::numbers("above the best", "standard errors", NumberFormat::Significant(3)),
            Column::words("choice"),
        ],
    );
    for h in &id.held_out {
        let chosen = if h.order == id.plant.order() { "chosen" } else { "" };
        table.push(vec![(h.order as f64).into(), (100.0 * h.score).into(), h.above_best.into(), chosen.into()])?;
    }
    Ok(table)
}

/// In sentences: order, error, trusted band, and what a reader must not overlook.
pub fn identified_sentences(id: &Identified) -> Vec<String> {
    let percent = |x: f64| NumberFormat::Significant(3).text(100.0 * x);
    let mut said = vec![
        format!(
            "Order {} ({} resonance pairs). Model against measurement: {} % rms, {} % at the 95th percentile.",
            id.plant.order(),
            id.plant.modes.len(),
            percent(id.rms_relative_error),
            percent(id.p95_relative_error)
        ),
        if id.trusted.high_hz > 0.0 {
            format!(
                "The model is to be trusted from {} to {} Hz.",
                NumberFormat::Significant(5).text(id.trusted.low_hz),
                NumberFormat::Significant(5).text(id.trusted.high_hz)
            )
        } else {
            "The model is NOT to be trusted anywhere: no stretch of the sweep is followed closely enough.".to_owned()
        },
    ];
    if let Some(points) = id.gathered_from {
        said.push(format!(
            "The sweep's {points} points were gathered to {} for the fit: each is the mean of neighbours that lie on one line. Margins of a sweep are judged over every point.",
            id.w_rad_s.len()
        ));
    }
    if let servotune::identify::BodyEvidence::BelowSweep { lowest_hz } = id.body {
        let form =
            if matches!(id.plant.body, Body::FreeInertia { .. }) { "a free inertia" } else { "the form asked for" };
        said.push(format!(
            "The body's natural frequency lies below the sweep ({lowest_hz:.4} Hz) and is not identifiable; {form} is used. Sweep from lower frequencies to see it."
        ));
    }
    said.extend(gain_at_rest(id));
    let untold = untold(id);
    if !untold.is_empty() {
        said.push(format!(
            "This sweep does not tell {}: their intervals span more than a factor of {TELLING}. The response is followed, the numbers behind it are not to be read; a lower --order may do.",
            untold.join(", ")
        ));
    }
    if !id.at_bound.is_empty() {
        said.push(format!("On an end of its range: {}.", id.at_bound.join(", ")));
    }
    if !id.converged {
        said.push("The joint fit stopped before it met its tolerance; the intervals may be too narrow.".to_owned());
    }
    if id.correlation_inflation > 1.5 {
        said.push(format!(
            "Neighbouring residuals agree (variances are inflated by {}): something systematic is left that this order cannot follow.",
            NumberFormat::Significant(3).text(id.correlation_inflation)
        ));
    }
    said
}

/// Bode plot of measured response, model and what is left, trusted band shaded.
pub fn identified_figure(frf: &Frf, id: &Identified, title: &str) -> Result<Figure, ReportError> {
    let hz: Vec<f64> = frf.w_rad_s().iter().map(|w| w / TAU).collect();
    let model: Vec<_> = frf.w_rad_s().iter().map(|&w| id.plant.at(w)).collect();
    let trusted_hz = (id.trusted.high_hz > 0.0).then_some((id.trusted.low_hz, id.trusted.high_hz));
    bode_with_residual(
        title,
        "",
        BodeCurve { name: "measured", frequency_hz: &hz, response: frf.value(), relative_std: frf.relative_std() },
        BodeCurve { name: "model", frequency_hz: &hz, response: &model, relative_std: None },
        &BodeMarks { trusted_hz, ..BodeMarks::default() },
    )
}
