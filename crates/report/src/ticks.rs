//! Where tick marks stand and what is written beside them.
//!
//! In: a stretch of an axis and its length in pixels. Out: [`Tick`]s inside it. `assets/ticks.js` does the same for a
//! stretch that the reader has zoomed to. Convention: frequencies at 1, 2, 5 per decade, phases at 45, 90, ...
//! Spec: `specs/report.md`.

use super::figure::{Axis, Scale, Ticks};
use super::number::typographic;
use super::text_width::fitted;
use super::view::View;

/// One tick mark; without words it is a fine grid line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    /// Where, in the unit of the axis.
    pub value: f64,
    /// What is written there.
    pub label: Option<String>,
}

/// Ticks for a view that is `length` pixels long, about `spacing` pixels apart.
pub(super) fn ticks(view: &View, policy: Ticks, length: f64, spacing: f64) -> Vec<Tick> {
    match view.scale {
        Scale::Linear => linear(view.lo, view.hi, policy, length, spacing),
        Scale::Log10 => logarithmic(view, policy, length, spacing),
    }
}

/// Ticks of an axis: its names where it has any, each cut to `room` pixels, numbers otherwise. A name that is a number stays
/// whole, since the start of a number is another number; what then does not fit is left out when drawn.
pub(super) fn axis_ticks(axis: &Axis, view: &View, length: f64, spacing: f64, room: f64) -> Vec<Tick> {
    if axis.names.is_empty() {
        return ticks(view, axis.ticks, length, spacing);
    }
    let tick = |(i, name): (usize, &String)| {
        let number = name.parse::<f64>().is_ok();
        Tick { value: i as f64, label: Some(if number { name.clone() } else { fitted(name, 11.5, room) }) }
    };
    axis.names.iter().enumerate().map(tick).filter(|t| view.holds(t.value)).collect()
}

/// The smallest allowed step that is not below `raw`.
pub(super) fn step(policy: Ticks, raw: f64) -> f64 {
    let raw = if policy == Ticks::Whole { raw.max(1.0) } else { raw };
    let (fixed, unit): (&[f64], f64) = match policy {
        Ticks::Decimal => (&[], 1.0),
        Ticks::Decibels => (&[2.0, 5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 100.0], 1.0),
        Ticks::Whole => (&[], 1.0),
        Ticks::Degrees => (&[2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0, 180.0], 360.0),
    };
    if raw > 1.0
        && let Some(&found) = fixed.iter().find(|&&s| s >= raw)
    {
        return found;
    }
    let unit = if raw > 1.0 { unit } else { 1.0 };
    let power = 10f64.powf((raw / unit).log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power * unit).find(|&s| s >= raw * (1.0 - 1e-9)).unwrap_or(raw)
}

fn linear(lo: f64, hi: f64, policy: Ticks, length: f64, spacing: f64) -> Vec<Tick> {
    let step = step(policy, (hi - lo) / (length / spacing).floor().max(2.0));
    if !step.is_finite() || step <= 0.0 {
        return Vec::new();
    }
    // A tick on the edge counts although rounding may put it a hair outside.
    let (first, last) = ((lo / step - 1e-6).ceil(), (hi / step + 1e-6).floor());
    let count = (last - first).clamp(-1.0, 200.0) as i64;
    (0..=count)
        .map(|k| {
            let value = (first + k as f64) * step;
            Tick { value, label: Some(label(value, step)) }
        })
        .collect()
}

fn logarithmic(view: &View, policy: Ticks, length: f64, spacing: f64) -> Vec<Tick> {
    let per_decade = length / (view.hi - view.lo).max(1e-12);
    let labelled: &[u8] = if per_decade >= 1.7 * spacing { &[1, 2, 5] } else { &[1] };
    let stride = (0.7 * spacing / per_decade).ceil().max(1.0) as i64;
    let mut found = Vec::new();
    for decade in view.lo.floor() as i64..=view.hi.ceil() as i64 {
        for m in 1..=9u8 {
            let value = f64::from(m) * 10f64.powi(decade as i32);
            if !view.holds(value) {
                continue;
            }
            let wanted = labelled.contains(&m) && decade.rem_euclid(stride) == 0;
            if wanted || per_decade >= spacing {
                found.push(Tick { value, label: wanted.then(|| label(value, value)) });
            }
        }
    }
    if found.iter().filter(|tick| tick.label.is_some()).count() >= 2 {
        return found;
    }
    linear(10f64.powf(view.lo), 10f64.powf(view.hi), policy, length, spacing)
}

/// The number with as many decimals as its step needs.
pub(super) fn label(value: f64, step: f64) -> String {
    let size = value.abs();
    if value != 0.0 && !(1e-5..1e7).contains(&size.max(step)) {
        // As many digits as the step asks for: 5e-6 is not 4.9999999999999996e-6.
        let digits = (size.log10().floor() - step.abs().log10().floor()).clamp(0.0, 12.0) as usize;
        let text = format!("{value:.digits$e}");
        let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
        let short =
            if mantissa.contains('.') { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
        return typographic(&format!("{short}e{power}"));
    }
    let decimals = (-(step.abs().log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    typographic(if text.trim_start_matches('-').bytes().all(|b| b == b'0' || b == b'.') {
        text.trim_start_matches('-')
    } else {
        &text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(view: View, policy: Ticks, length: f64, spacing: f64) -> Vec<String> {
        ticks(&view, policy, length, spacing).into_iter().filter_map(|t| t.label).collect()
    }

    #[test]
    fn a_sweep_axis_is_labelled_at_one_two_five() {
        let view = View::new(Scale::Log10, 40.0, 5000.0);
        let text = labels(view, Ticks::Decimal, 600.0, 60.0);
        assert_eq!(text, ["50", "100", "200", "500", "1000", "2000", "5000"]);
    }

    #[test]
    fn small_numbers_have_the_digits_of_their_step() {
        let label = |value: f64, step: f64| label(value, step).replace('\u{2212}', "-");
        assert_eq!(label(5.0 * 10f64.powi(-6), 5.0 * 10f64.powi(-6)), "5e-6");
        assert_eq!(label(2.5e-8, 5e-9), "2.5e-8");
    }

    #[test]
    fn phase_stands_at_multiples_of_forty_five_or_ninety() {
        let view = View::new(Scale::Linear, -400.0, 0.0);
        assert_eq!(
            labels(view, Ticks::Degrees, 200.0, 40.0),
            ["\u{2212}360", "\u{2212}270", "\u{2212}180", "\u{2212}90", "0"]
        );
        let view = View::new(Scale::Linear, -200.0, 0.0);
        assert_eq!(labels(view, Ticks::Degrees, 230.0, 40.0).len(), 5);
    }

    #[test]
    fn what_is_counted_has_no_halves() {
        assert_eq!(labels(View::new(Scale::Linear, 0.0, 2.1), Ticks::Whole, 600.0, 60.0), ["0", "1", "2"]);
        assert_eq!(labels(View::new(Scale::Linear, 0.0, 40.0), Ticks::Whole, 200.0, 60.0), ["0", "20", "40"]);
    }

    #[test]
    fn a_narrow_stretch_of_a_logarithmic_axis_gets_linear_steps() {
        let view = View::new(Scale::Log10, 1150.0, 1290.0);
        assert_eq!(
            labels(view, Ticks::Decimal, 700.0, 100.0),
            ["1160", "1180", "1200", "1220", "1240", "1260", "1280"]
        );
    }

    #[test]
    fn every_step_is_at_least_what_was_asked_and_at_most_two_and_a_half_times_it() {
        for policy in [Ticks::Decimal, Ticks::Decibels, Ticks::Degrees] {
            for k in -60..60 {
                let raw = 10f64.powf(f64::from(k) * 0.1);
                let found = step(policy, raw);
                // 360 follows 180 and 5 follows 2, so that no two steps differ by more than 2.5; the rest is rounding.
                assert!(found >= raw * (1.0 - 1e-8) && found <= 2.6 * raw, "{policy:?} {raw} {found}");
            }
        }
    }
}
