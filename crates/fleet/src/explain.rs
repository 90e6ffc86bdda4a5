//! Why no table serves a slot: the limit that binds, what in the machine causes it, and the smallest change of the machine that would help.
//!
//! In: an untunable slot with its cases. Out: [`Explained`]. The slot is first searched in full, by the widest search there is; only what that
//! leaves untunable is explained. Each change is tried at its largest; where a table is then found, the smallest change is sought by bisection,
//! with a table polished anew for every trial and judged at the end.

use super::certified::{Certified, certified};
use super::row::{OwnTable, SlotRow};
use super::slot::{Prepared, search};
use super::worst_case::{WorstCase, worst_case};
use super::{Context, Evidence, Ready};
use serde::{Deserialize, Serialize};
use servotune::controller::Controller;
use servotune::lti::{Mode, Plant};
use servotune::tune::{Spec, What};
use std::f64::consts::TAU;

/// What can be changed in a machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Change {
    /// More damping of a mode: pole and zero alike.
    Damping {
        /// The mode's frequency (Hz).
        mode_hz: f64,
    },
    /// A higher frequency of a mode: a stiffer part.
    Frequency {
        /// The mode's frequency (Hz).
        mode_hz: f64,
    },
    /// Less dead time.
    Delay {
        /// Dead time now (s).
        delay_s: f64,
    },
    /// Less noise: of the encoder and of the air.
    Noise,
    /// More gain: torque constant, amplifier.
    Gain,
}

impl Change {
    /// What a person would do, with how much.
    pub fn words(self, factor: f64) -> String {
        match self {
            Change::Damping { mode_hz } => format!("damp the mode at {mode_hz:.0} Hz {factor:.2} times as much"),
            Change::Frequency { mode_hz } => {
                format!("stiffen the mode at {mode_hz:.0} Hz: to {:.0} Hz, a factor of {factor:.3}", mode_hz * factor)
            }
            Change::Delay { delay_s } => {
                format!("cut the dead time from {:.1} to {:.1} us", 1e6 * delay_s, 1e6 * delay_s / factor)
            }
            Change::Noise => format!("bring encoder noise and windage down by a factor of {factor:.2}"),
            Change::Gain => format!("raise the gain of motor and amplifier by a factor of {factor:.3}"),
        }
    }
}

/// What in the machine causes the limit to bind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Cause {
    /// A mode near the frequency where the limit is missed.
    Mode {
        /// Its frequency (Hz).
        hz: f64,
        /// Share of the plant's |ln P| and phase there that is this mode's (ratio, rough).
        share: f64,
    },
    /// The dead time: it takes more phase there than any mode.
    Delay {
        /// Phase that it takes at the frequency (deg).
        phase_deg: f64,
    },
    /// Noise: without it the limit is met.
    Noise,
    /// The move itself: the limit is missed without noise as well, and no frequency stands out.
    Move,
}

/// One change that makes the slot tunable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Remedy {
    /// What.
    pub change: Change,
    /// By which factor, above 1; of delay and noise its inverse.
    pub factor: f64,
    /// In words.
    pub words: String,
    /// The table that is accepted after the change, and what it reaches.
    pub after: OwnTable,
}

/// An explanation.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Explained {
    /// Tester and slot.
    pub slot: String,
    /// A table that the full search found after all; then there is nothing to explain.
    pub table: Option<OwnTable>,
    /// What `verify` proves of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certified: Option<Certified>,
    /// The nearest that any search came.
    pub nearest: Option<OwnTable>,
    /// The cause.
    pub cause: Option<Cause>,
    /// Changes that would help, the smallest factor first.
    pub remedies: Vec<Remedy>,
}

/// Steps of a bisection: the factor is found to within 3 % of its logarithm.
const BISECTIONS: usize = 5;
/// Steps of a polish for a trial.
const STEPS: usize = 15;
/// A mode this far from a frequency (ratio) has nothing to say there.
const NEAR: f64 = 1.5;

/// A case with one thing in the machine changed.
struct Changed<'a> {
    context: &'a Context,
    slot: &'a Prepared,
    change: Change,
}

impl Changed<'_> {
    /// The plant with the change.
    fn plant(&self, plant: &Plant, factor: f64) -> Plant {
        let mut p = plant.clone();
        let nearest = |p: &Plant, hz: f64| {
            (0..p.modes.len()).min_by(|&a, &b| {
                let off = |i: usize| (p.modes[i].pole_rad_s / (hz * TAU)).ln().abs();
                off(a).total_cmp(&off(b))
            })
        };
        match self.change {
            Change::Damping { mode_hz } => {
                if let Some(i) = nearest(&p, mode_hz) {
                    p.modes[i].pole_damping_ratio *= factor;
                    p.modes[i].zero_damping_ratio *= factor;
                }
            }
            Change::Frequency { mode_hz } => {
                if let Some(i) = nearest(&p, mode_hz) {
                    p.modes[i].pole_rad_s *= factor;
                    p.modes[i].zero_rad_s *= factor;
                }
            }
            Change::Delay { .. } => p.delay_s /= factor,
            Change::Noise => {}
            Change::Gain => p.resonance_gain *= factor,
        }
        p
    }

    fn spec(&self, spec: &Spec, factor: f64) -> Spec {
        let mut s = spec.clone();
        if self.change == Change::Noise {
            for noise in s.profile.iter_mut().map(|p| &mut p.noise) {
                noise.encoder_rms /= factor;
                noise.windage_rms /= factor;
            }
        }
        s
    }

    /// An accepted table after a change by `factor`, polished from `start`.
    fn tuned(&self, factor: f64, start: &Controller) -> Option<OwnTable> {
        let evidence = self.slot.evidence.with(|p| self.plant(p, factor)).ok()?;
        let c = self.context;
        let (spec, guarded) = (self.spec(&c.spec, factor), self.spec(&c.guarded, factor));
        let mut ready = Ready::of(&evidence, &spec, &guarded, &c.base).ok()?;
        let (gains, _) = ready.polish(start, STEPS)?;
        let judged = worst_case(&mut ready, &gains).ok()?;
        judged.passes.then_some(OwnTable { gains, way: super::Way::Polished, judged })
    }

    /// The smallest factor between 1 and `largest`, if any up to there helps.
    fn smallest(&self, largest: f64, start: &Controller) -> Option<Remedy> {
        let mut after = self.tuned(largest, start)?;
        let (mut low, mut high) = (0.0, largest.ln());
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            // Polished from the table that a larger change has already made good.
            match self.tuned(middle.exp(), &after.gains).or_else(|| self.tuned(middle.exp(), start)) {
                Some(table) => (high, after) = (middle, table),
                None => low = middle,
            }
        }
        let factor = high.exp();
        Some(Remedy { change: self.change, factor, words: self.change.words(factor), after })
    }
}

/// Explains an untunable slot.
pub(super) fn explain(context: &Context, slot: &Prepared, row: &SlotRow) -> Explained {
    let mut found = Explained {
        slot: row.id(),
        table: None,
        certified: None,
        nearest: row.nearest.clone(),
        cause: None,
        remedies: Vec::new(),
    };
    if let Ok(table) = search(context, &slot.evidence) {
        if table.judged.passes {
            found.certified = Some(certified(context, &slot.evidence, &table.gains));
            found.table = Some(table);
            return found;
        }
        if found.nearest.as_ref().is_none_or(|n| table.judged.worst < n.judged.worst) {
            found.nearest = Some(table);
        }
    }
    let Some(nearest) = found.nearest.clone() else { return found };
    found.cause = Some(cause(context, slot, &nearest));
    let largest = context.file.untunable.largest_change;
    for change in changes(&slot.plant, nearest.judged.at_hz) {
        found.remedies.extend(Changed { context, slot, change }.smallest(largest, &nearest.gains));
    }
    found.remedies.sort_by(|a, b| a.factor.total_cmp(&b.factor));
    found
}

/// What may be changed: the mode that matters, dead time, noise, gain.
fn changes(plant: &Plant, at_hz: Option<f64>) -> Vec<Change> {
    let mut all = Vec::new();
    if let Some(mode) = guilty(plant, at_hz) {
        let mode_hz = mode.pole_rad_s / TAU;
        all.extend([Change::Damping { mode_hz }, Change::Frequency { mode_hz }]);
    }
    if plant.delay_s > 0.0 {
        all.push(Change::Delay { delay_s: plant.delay_s });
    }
    all.extend([Change::Noise, Change::Gain]);
    all
}

/// How much of ln P at a frequency is a mode's.
fn weight(m: &Mode, w: f64) -> f64 {
    let quadratic = |w0: f64, z: f64| nalgebra::Complex::new((w0 - w) * (w0 + w), 2.0 * z * w0 * w);
    let ratio = quadratic(m.zero_rad_s, m.zero_damping_ratio) / quadratic(m.pole_rad_s, m.pole_damping_ratio);
    ratio.ln().norm()
}

/// The mode that matters most at a frequency, or the strongest of all where none is named.
fn guilty(plant: &Plant, at_hz: Option<f64>) -> Option<Mode> {
    let height = |m: &Mode| (m.zero_rad_s / m.pole_rad_s).ln().abs() / m.pole_damping_ratio;
    match at_hz {
        Some(hz) => {
            let w = hz * TAU;
            let near = plant.modes.iter().filter(|m| (m.pole_rad_s / w).ln().abs() < NEAR.ln());
            near.max_by(|a, b| weight(a, w).total_cmp(&weight(b, w))).copied()
        }
        None => plant.modes.iter().max_by(|a, b| height(a).total_cmp(&height(b))).copied(),
    }
}

/// The cause: of a margin the mode or the dead time at its frequency; of a figure of the write the noise, or the move.
fn cause(context: &Context, slot: &Prepared, nearest: &OwnTable) -> Cause {
    let p: &WorstCase = &nearest.judged;
    let write = matches!(p.limit, What::DftLow | What::DftHigh | What::Harmonic { .. } | What::CommandPeak);
    if write {
        let mut quiet = context.spec.clone();
        for noise in quiet.profile.iter_mut().map(|p| &mut p.noise) {
            (noise.encoder_rms, noise.windage_rms) = (0.0, 0.0);
        }
        let without = Ready::of(&slot.evidence, &quiet, &quiet, &context.base);
        let met =
            without.and_then(|mut r| worst_case(&mut r, &nearest.gains)).is_ok_and(|q| q.limit != p.limit || q.passes);
        return if met { Cause::Noise } else { Cause::Move };
    }
    let hz = p.at_hz.or(p.figures.gain_crossover_hz).unwrap_or(0.0);
    let w = hz * TAU;
    let delay = slot.plant.delay_s * w;
    let all: f64 = slot.plant.modes.iter().map(|m| weight(m, w)).sum::<f64>() + delay;
    match guilty(&slot.plant, Some(hz)) {
        Some(m) if weight(&m, w) >= delay => {
            Cause::Mode { hz: m.pole_rad_s / TAU, share: weight(&m, w) / all.max(1e-9) }
        }
        _ => Cause::Delay { phase_deg: delay.to_degrees() },
    }
}

impl Evidence {
    /// The same cases with a machine that differs: each response by the ratio of the changed plant's to its own.
    pub(super) fn with(&self, change: impl Fn(&Plant) -> Plant) -> Result<Evidence, servotune::frf::FrfShapeError> {
        self.each(|frf, plant| {
            use servotune::lti::FrequencyResponse;
            let changed = change(plant);
            let value = frf.w_rad_s().iter().zip(frf.value()).map(|(&w, v)| v * changed.at(w) / plant.at(w)).collect();
            let frf = frf.alike(frf.w_rad_s().to_vec(), value, frf.relative_std().map(<[f64]>::to_vec))?;
            Ok((frf, changed))
        })
    }
}
