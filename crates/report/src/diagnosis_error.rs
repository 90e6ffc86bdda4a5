//! Before and after on one record: position and error over time, and the error's spectrum against the noise.
//!
//! In: errors of the three models. Out: figures. Convention: densities are one-sided amplitudes per root hertz; the noise floor is
//! drawn in. Spec: `specs/mismatch.md`.

use super::ReportError;
use super::diagnosis_shown::Shown;
use super::figure::{Axis, Figure, Ink, Kind, Panel, Scale, Series};
use super::number::typographic;
use super::time::{CurveKind, TimeCurve, TimePanel, time};
use servotune::diagnose::Run;
use servotune::numeric::spectrum::forward;
use std::f64::consts::TAU;

/// Colours of the three models, as everywhere on the page.
const INKS: [Ink; 3] = [Ink::Muted, Ink::Data(1), Ink::Data(0)];

/// Position and error of the drawn record over time.
pub(super) fn error_figure(s: &Shown) -> Result<Figure, ReportError> {
    let run = &s.made.data.runs[s.run];
    let at: Vec<f64> = (0..run.len()).map(|k| k as f64 * s.sample_time_s()).collect();
    let errors: [&Vec<f64>; 3] = std::array::from_fn(|m| &s.made.errors[m][s.run]);
    let simulated: Vec<f64> = run.position.iter().zip(errors[0]).map(|(y, e)| y - e).collect();
    let names = s.models();
    let curve = |name, value, ink, kind| TimeCurve { name, time_s: &at, value, ink, kind };
    let position = [
        curve("recorded", &run.position, Ink::Plain, CurveKind::Line),
        curve("simulated, model as given", &simulated, INKS[0], CurveKind::Dashed),
    ];
    let error: [TimeCurve; 3] = std::array::from_fn(|m| curve(names[m], errors[m], INKS[m], CurveKind::Line));
    let floor = s.floor();
    let limits = [(floor, "noise floor (rms)"), (-floor, "")];
    let found = !s.made.corrected.effects.is_empty();
    // The last panel is the same as the second, closer: what is left.
    let left = if found { &error[2..] } else { &error[1..2] };
    let panels = [
        TimePanel { quantity: "Position", unit: s.position, curves: &position, limits: &[] },
        TimePanel { quantity: "Error", unit: s.position, curves: &error, limits: &limits },
        TimePanel { quantity: "What is left", unit: s.position, curves: left, limits: &limits },
    ];
    let caption = "Recorded less simulated position. The lowest panel shows only what the best model leaves, beside the noise \
                   of one record.";
    time(&format!("Before and after on {} ({})", run.name, role(run)), caption, &panels, None)
}

fn role(run: &Run) -> &'static str {
    match run.role {
        servotune::recording::Role::Fit => "used for the fit",
        servotune::recording::Role::Holdout => "hold-out",
    }
}

/// Amplitude density of the error of the drawn record, three models and the noise.
pub(super) fn spectrum_figure(s: &Shown) -> Result<Figure, ReportError> {
    let t = s.sample_time_s();
    // Ticks read best near 1: the power of a thousand nearest the middle of the noise.
    let level = s.made.data.levels.sensor_rms * (2.0 * t).sqrt();
    let power = if level > 0.0 { 3 * (level.log10() / 3.0).floor() as i32 } else { 0 };
    let unit = 10f64.powi(power);
    let words = if power == 0 { String::new() } else { format!("1e{power} ") };
    let words = typographic(&words);
    let mut panel = Panel::new(
        Axis::frequency(),
        Axis { scale: Scale::Log10, ..Axis::linear("Amplitude density", &format!("{words}{}/\u{221a}Hz", s.position)) },
    );
    panel.height = 1.2;
    for (m, name) in s.models().into_iter().enumerate() {
        let (hz, amplitude) = density(&[&s.made.errors[m][s.run]], t, unit);
        if !hz.is_empty() {
            panel.marks.push(Series::new(name, INKS[m], Kind::Solid, &hz, &amplitude)?.into());
        }
    }
    let repeats = repeat_noise(&s.made.errors[2], &s.made.data.runs);
    let views: Vec<&Vec<f64>> = repeats.iter().collect();
    let (hz, amplitude) = density(&views, t, unit);
    let (name, words) = if hz.is_empty() {
        ("sensor noise", "The floor is the sensor's white noise as estimated; there are no repeats to measure it.")
    } else {
        ("noise floor", "The floor is the spread of repeated records about their mean.")
    };
    let floor = if hz.is_empty() {
        Series::new(name, Ink::Limit, Kind::Dashed, &[10.0, 0.5 / t], &[level / unit, level / unit])?
    } else {
        Series::new(name, Ink::Limit, Kind::Dashed, &hz, &amplitude)?
    };
    panel.marks.push(floor.into());
    let caption =
        format!("Error of the record above, one-sided, averaged in bands of a thirtieth of a decade. {words}");
    Ok(Figure { title: "Spectrum of the error".into(), caption, share_x: false, panels: vec![panel] })
}

/// What repeats differ by: each less the mean of its group, scaled back to the noise of one record.
fn repeat_noise(errors: &[Vec<f64>], runs: &[Run]) -> Vec<Vec<f64>> {
    let mut out = Vec::new();
    for i in 0..runs.len() {
        let same = |j: &usize| runs[*j].group == runs[i].group && runs[*j].len() == runs[i].len();
        let group: Vec<usize> = (0..runs.len()).filter(same).collect();
        if group.len() < 2 {
            continue;
        }
        let n = group.len() as f64;
        let scale = (n / (n - 1.0)).sqrt();
        let mean = |k: usize| group.iter().map(|&j| errors[j][k]).sum::<f64>() / n;
        out.push((0..runs[i].len()).map(|k| scale * (errors[i][k] - mean(k))).collect());
    }
    out
}

/// One-sided amplitude density (over `unit`, per √Hz) of series, Hann-tapered, the power averaged over series and over bands of a
/// thirtieth of a decade; series with values that are not finite are left out.
fn density(series: &[&Vec<f64>], sample_time_s: f64, unit: f64) -> (Vec<f64>, Vec<f64>) {
    let mut bins: Vec<(f64, f64)> = Vec::new();
    for x in series.iter().filter(|x| x.len() > 7 && x.iter().all(|v| v.is_finite())) {
        let n = x.len();
        let mean = x.iter().sum::<f64>() / n as f64;
        let taper = |i: usize| 1.0 - (TAU * (i as f64 + 0.5) / n as f64).cos();
        let tapered: Vec<f64> = x.iter().enumerate().map(|(i, v)| (v - mean) * taper(i)).collect();
        // The taper's mean square is 3/2; twice for the one side.
        let scale = 2.0 * sample_time_s / (1.5 * n as f64);
        let step = 1.0 / (n as f64 * sample_time_s);
        let power = forward(&tapered);
        bins.extend((1..n.div_ceil(2)).map(|k| (k as f64 * step, power[k].norm_sqr() * scale)));
    }
    bins.sort_by(|a, b| a.0.total_cmp(&b.0));
    let band = |hz: f64| (30.0 * hz.log10()).floor() as i64;
    let (mut hz, mut amplitude) = (Vec::new(), Vec::new());
    for part in bins.chunk_by(|a, b| band(a.0) == band(b.0)) {
        let count = part.len() as f64;
        hz.push(part.iter().map(|b| b.0).sum::<f64>() / count);
        amplitude.push((part.iter().map(|b| b.1).sum::<f64>() / count).sqrt() / unit);
    }
    (hz, amplitude)
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotune::numeric::random::Random;

    #[test]
    fn white_noise_has_the_density_of_its_variance_over_the_band() {
        let (t, rms) = (2e-5, 0.3);
        let mut random = Random::new(7);
        let x: Vec<f64> = (0..40_000).map(|_| rms * random.normal()).collect();
        let (hz, amplitude) = density(&[&x], t, 1.0);
        let expected = rms * (2.0 * t).sqrt();
        // Bands above 2.5 kHz average over 1e5 bins·decade/30: some hundred bins, so 5 sigma of the amplitude is below 25 %.
        for (f, a) in hz.iter().zip(&amplitude).filter(|(f, _)| **f > 2500.0) {
            assert!((a / expected - 1.0).abs() < 0.25, "{f} Hz: {a} beside {expected}");
        }
        assert!(density(&[&vec![f64::INFINITY; 100]], t, 1.0).0.is_empty());
    }
}
