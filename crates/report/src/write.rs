//! One spiral write drawn: its record with the window, the DFT with bands and limits, the cumulative spectrum, the move and the error under it.
//!
//! In: the closed loop's record and its figures, one controller or two. Out: blocks of a page. Convention: PES at the servo clock; position, reference
//! and command at the controller's samples; error = reference - position. Spec: `specs/report.md`, `specs/pes.md`.

use super::ReportError;
use super::cumulative::cumulative_spectrum;
use super::figure::{Figure, Ink};
use super::page::Block;
use super::pes::{harmonics_table, pes_table};
use super::spectrum_bars::{SpectrumBars, spectrum_bars};
use super::time::{CurveKind, TimeCurve, TimePanel, time};
use super::tuned::Units;
use servotune::pes::{ClosedLoop, PesFigures, Profile};
use servotune::tune::Limits;

/// A record and its figures under a name.
#[derive(Clone, Copy, Debug)]
pub struct NamedWrite<'a> {
    /// For the legend.
    pub name: &'a str,
    /// The record.
    pub run: &'a ClosedLoop,
    /// Figures of its window.
    pub figures: &'a PesFigures,
}

/// A write as a page shows it.
#[derive(Clone, Copy, Debug)]
pub struct WriteView<'a> {
    /// The move, the servo clock, the window.
    pub profile: &'a Profile,
    /// Drawn in front.
    pub front: NamedWrite<'a>,
    /// Drawn behind it, in grey.
    pub behind: Option<NamedWrite<'a>>,
    /// Limits that are drawn; nothing where there is no spec.
    pub limits: &'a Limits,
    /// Bands of the DFT norms (Hz).
    pub bands_hz: &'a [[f64; 2]],
    /// Units of position and command.
    pub units: Units<'a>,
}

/// Harmonics in the table: up to 3 kHz at the paper's window.
const LISTED: usize = 24;
/// Last frequency of the bars (Hz), unless a band reaches further.
const UNTIL_HZ: f64 = 3300.0;

/// The window of the DFT in seconds, in words.
pub(crate) fn window_words(p: &Profile) -> (f64, f64, String) {
    let at = |n: usize| (p.first_servo_sample() + n) as f64 / p.pes.sample_rate_hz;
    let [first, last] = p.pes.window;
    (at(first), at(last), format!("DFT window, servo samples {first} to {last}"))
}

/// Record, DFT, cumulative spectrum, figures of the window.
pub(super) fn write_blocks(v: &WriteView<'_>) -> Result<Vec<Block>, ReportError> {
    let unit = v.units.position;
    let mut spectra = vec![(v.front.name, Ink::Data(0), &v.front.figures.harmonics[..])];
    spectra.extend(v.behind.map(|b| (b.name, Ink::Muted, &b.figures.harmonics[..])));
    Ok(vec![
        Block::Figure(record_figure(v)?),
        Block::Figure(spectrum_figure(v)?),
        Block::Figure(cumulative_spectrum(&spectra, v.profile.pes.sample_rate_hz, unit)?),
        Block::Table(pes_table(v.front.figures, unit)?),
        Block::Details("Harmonics".into(), vec![Block::Table(harmonics_table(v.front.figures, LISTED, unit)?)]),
    ])
}

fn spectrum_figure(v: &WriteView<'_>) -> Result<Figure, ReportError> {
    let figures = v.front.figures;
    let hz: Vec<f64> = figures.harmonics.iter().map(|h| h.hz).collect();
    let amplitudes = |f: &PesFigures| f.harmonics.iter().map(|h| h.amplitude).collect::<Vec<f64>>();
    let (front, behind) = (amplitudes(figures), v.behind.map(|b| amplitudes(b.figures)));
    let at = |k: usize| k as f64 * v.profile.pes.sample_rate_hz / (2 * hz.len()) as f64;
    let limits: Vec<(f64, f64)> =
        v.limits.harmonics.iter().map(|h| (hz.get(h.k - 1).copied().unwrap_or(at(h.k)), h.amplitude)).collect();
    let bars = SpectrumBars {
        names: [v.behind.map_or("", |b| b.name), v.front.name],
        frequency_hz: &hz,
        before: behind.as_deref(),
        after: &front,
        limits: &limits,
        bands_hz: v.bands_hz,
        unit: v.units.position,
        until_hz: v.bands_hz.iter().map(|b| 1.1 * b[1]).fold(UNTIL_HZ, f64::max),
    };
    spectrum_bars("DFT of the window", "Amplitude |X_k|/N of each harmonic.", &bars)
}

fn record_figure(v: &WriteView<'_>) -> Result<Figure, ReportError> {
    let rate = v.profile.pes.sample_rate_hz;
    let front = v.front.run;
    let servo: Vec<f64> = (0..front.pes.len()).map(|j| j as f64 / rate).collect();
    let tick = ticks(front);
    let behind = v.behind.map(|b| (b.name, b.run, ticks(b.run)));
    let (held, line) = (CurveKind::Held, CurveKind::Line);
    let (mut pes, mut command) = (vec![], vec![]);
    if let Some((name, b, tick)) = &behind {
        pes.push(TimeCurve { name, time_s: &servo, value: &b.pes, ink: Ink::Muted, kind: line });
        command.push(TimeCurve { name, time_s: tick, value: &b.command, ink: Ink::Muted, kind: held });
    }
    let (name, ink) = (v.front.name, Ink::Data(0));
    pes.push(TimeCurve { name, time_s: &servo, value: &front.pes, ink, kind: line });
    command.push(TimeCurve { name, time_s: &tick, value: &front.command, ink, kind: held });
    let limit = v.limits.command_peak.map(|l| [(l, "limit"), (-l, "limit")]);
    let none: [(f64, &str); 0] = [];
    let panels = [
        TimePanel { quantity: "PES", unit: v.units.position, curves: &pes, limits: &none },
        TimePanel {
            quantity: "Command",
            unit: v.units.command,
            curves: &command,
            limits: limit.as_ref().map_or(&none[..], |l| &l[..]),
        },
    ];
    let (from, to, words) = window_words(v.profile);
    time("Record of the write", "Simulated.", &panels, Some((from, to, &words)))
}

/// Reference and position, and the error between them, at the controller's samples.
pub(super) fn move_figure(v: &WriteView<'_>) -> Result<Figure, ReportError> {
    let run = v.front.run;
    let tick = ticks(run);
    let error: Vec<f64> = run.reference.iter().zip(&run.position).map(|(r, y)| r - y).collect();
    let curve = |name, value, ink, kind| TimeCurve { name, time_s: &tick, value, ink, kind };
    let position = [
        curve("reference", &run.reference[..], Ink::Muted, CurveKind::Dashed),
        curve("position", &run.position, Ink::Data(0), CurveKind::Line),
    ];
    let error = [curve("reference - position", &error[..], Ink::Data(1), CurveKind::Line)];
    let none: [(f64, &str); 0] = [];
    let unit = v.units.position;
    let panels = [
        TimePanel { quantity: "Position", unit, curves: &position, limits: &none },
        TimePanel { quantity: "Position error", unit, curves: &error, limits: &none },
    ];
    let (from, to, words) = window_words(v.profile);
    let caption = "At the controller's samples; run-out at the head is in the PES, not here.";
    time("The move", caption, &panels, Some((from, to, &words)))
}

fn ticks(run: &ClosedLoop) -> Vec<f64> {
    (0..run.command.len()).map(|k| k as f64 * run.sample_time_s).collect()
}
