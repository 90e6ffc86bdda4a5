//! The report's own figures, for a notebook.

use nalgebra::Complex;
use servotune::controller::Controller;
use servotune::feedback::{Margins, MeasuredLoop, ModelLoop, OpenLoop};
use servotune::frf::Frf;
use servotune::lti::{DiscretePlant, FrequencyResponse, Plant};
use servotune_report::bode::{BodeCurve, BodeMarks, bode};
use servotune_report::figure::Ink;
use servotune_report::svg::{Size, standalone};
use servotune_report::time::{CurveKind, TimeCurve, TimePanel, time};
use servotune_report::{Figure, ReportError};
use std::f64::consts::TAU;

/// Points of a drawn curve for each decade.
const PER_DECADE: f64 = 200.0;

/// A figure as SVG.
pub fn svg(figure: &Figure) -> String {
    standalone(figure, Size::WIDE)
}

/// Angular frequencies (rad/s), evenly in the logarithm.
fn grid(from: f64, to: f64) -> Vec<f64> {
    let n = (PER_DECADE * (to / from).log10()).ceil().max(1.0) as usize;
    (0..=n).map(|i| from * (to / from).powf(i as f64 / n as f64)).collect()
}

fn curve(name: &str, w: &[f64], value: &[Complex<f64>], std: Option<&[f64]>) -> Result<String, ReportError> {
    let hz: Vec<f64> = w.iter().map(|w| w / TAU).collect();
    let curve = BodeCurve { name, frequency_hz: &hz, response: value, relative_std: std };
    Ok(svg(&bode(name, "", &[curve], &BodeMarks::default())?))
}

/// Magnitude and phase of a sweep.
pub fn of_sweep(frf: &Frf) -> Result<String, ReportError> {
    curve("measured", frf.w_rad_s(), frf.value(), frf.relative_std())
}

/// Magnitude and phase of a plant, a decade and more around what loops of it use.
pub fn of_plant(plant: &Plant) -> Result<String, ReportError> {
    let w = grid(TAU, TAU * 20e3);
    let value: Vec<Complex<f64>> = w.iter().map(|&w| plant.at(w)).collect();
    curve("plant", &w, &value, None)
}

/// Magnitude and phase of a controller up to half its rate; nothing but axes for one that cannot run.
pub fn of_controller(controller: &Controller) -> Result<String, ReportError> {
    let w = grid(TAU, std::f64::consts::PI / controller.sample_time_s);
    let value: Vec<Complex<f64>> = controller
        .sections()
        .map(|s| w.iter().map(|&w| s.at(w)).collect())
        .unwrap_or_else(|_| vec![Complex::ZERO; w.len()]);
    curve("controller", &w, &value, None)
}

/// The open loop with its margins, from ten hertz or the loop's first frequency on.
fn of_loop(l: &impl OpenLoop, m: &Margins) -> Result<Figure, ReportError> {
    let from = l.grid().first().copied().unwrap_or(TAU).max(TAU * 10.0).min(0.5 * l.end_rad_s());
    let w = grid(from, l.end_rad_s());
    let (hz, value): (Vec<f64>, Vec<Complex<f64>>) = w.iter().map(|&w| (w / TAU, l.at(w))).unzip();
    let marks = BodeMarks {
        trusted_hz: None,
        phase_margin: m.gain_crossover_hz.zip(m.phase_margin_deg),
        gain_margin: m.phase_crossover_hz.zip(m.gain_margin_db),
    };
    let curve = BodeCurve { name: "L", frequency_hz: &hz, response: &value, relative_std: None };
    bode("Open loop", "", &[curve], &marks)
}

/// What cannot be drawn because the loop itself cannot be made: it was made before, so this is no one's mistake but ours.
fn unmade() -> ReportError {
    ReportError::Domain { figure: "open loop", what: "the loop", found: f64::NAN, expected: "one that can be closed" }
}

/// The open loop of a plant model.
pub fn of_model_loop(plant: &Plant, controller: &Controller, m: &Margins) -> Result<String, ReportError> {
    let sections = controller.sections().map_err(|_| unmade())?;
    let sampled = DiscretePlant::of(plant, controller.sample_time_s).map_err(|_| unmade())?;
    let l = ModelLoop::new(&sampled, &sections).map_err(|_| unmade())?;
    Ok(svg(&of_loop(&l, m)?))
}

/// The open loop of a sweep.
pub fn of_measured_loop(frf: &Frf, controller: &Controller, m: &Margins) -> Result<String, ReportError> {
    let sections = controller.sections().map_err(|_| unmade())?;
    let l = MeasuredLoop::new(frf, &sections).map_err(|_| unmade())?;
    Ok(svg(&of_loop(&l, m)?))
}

/// A PES over time.
pub fn of_pes(pes: &[f64], sample_rate_hz: f64, unit: &str) -> Result<String, ReportError> {
    let time_s: Vec<f64> = (0..pes.len()).map(|j| j as f64 / sample_rate_hz).collect();
    let curve = TimeCurve { name: "PES", time_s: &time_s, value: pes, ink: Ink::Data(0), kind: CurveKind::Line };
    let panel = TimePanel { quantity: "PES", unit, curves: &[curve], limits: &[] };
    Ok(svg(&time("Position error", "", &[panel], None)?))
}
