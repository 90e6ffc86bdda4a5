//! Which figures of records a search asks for, and where each lies among them.
//!
//! In: a spec's objective and limits. Out: [`Asked`], the list of figures in a fixed order; the objective's own, if it is one, comes first.

use super::Spec;
use super::objective::Minimise;
use super::requirements::{Requirement, What};

/// A figure of a record, of a step, or a sum over frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RecordFigure {
    /// The objective, where it is a figure (pes_rms, dft, disturbance).
    Objective,
    /// Norm over a band of the write's DFT, by index.
    Band(usize),
    /// Amplitude of a limited harmonic, by its place among them.
    Harmonic(usize),
    CommandPeak,
    CommandRms,
    Overshoot,
    /// How far a step leaves the band of 2 % after the settling limit, in shares of the band.
    Envelope,
    /// How far the position goes beyond the end of the move (position_unit).
    MoveOvershoot,
    /// How far the error leaves its band after the move's settling limit, in shares of the band.
    MoveEnvelope,
}

impl RecordFigure {
    /// Whether it is of the position under a reference alone, a step or the move.
    pub fn of_reference(self) -> bool {
        use RecordFigure::{Envelope, MoveEnvelope, MoveOvershoot, Overshoot};
        matches!(self, Overshoot | Envelope | MoveOvershoot | MoveEnvelope)
    }

    /// The figure that a requirement limits; none for the loop's own. `harmonic` counts the harmonics met so far.
    pub fn of(what: What, harmonic: &mut usize) -> Option<RecordFigure> {
        match what {
            What::DftLow => Some(RecordFigure::Band(0)),
            What::DftHigh => Some(RecordFigure::Band(1)),
            What::Harmonic { .. } => {
                *harmonic += 1;
                Some(RecordFigure::Harmonic(*harmonic - 1))
            }
            What::CommandPeak => Some(RecordFigure::CommandPeak),
            What::CommandRms => Some(RecordFigure::CommandRms),
            What::Overshoot => Some(RecordFigure::Overshoot),
            What::Settling => Some(RecordFigure::Envelope),
            What::MoveOvershoot => Some(RecordFigure::MoveOvershoot),
            What::MoveSettling => Some(RecordFigure::MoveEnvelope),
            _ => None,
        }
    }
}

/// The figures that a search asks for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Asked {
    pub figures: Vec<RecordFigure>,
    pub minimise: Minimise,
    /// Weight of each band in the objective `dft`: one over its limit where it has one.
    pub weights: Vec<f64>,
    pub bands_hz: Vec<[f64; 2]>,
    /// Limited harmonics.
    pub harmonics: Vec<usize>,
    /// Samples of the simulated step; 0 where none is asked for.
    pub step_samples: usize,
}

/// A step is watched for this many periods of the lowest crossover, and this many times its settling limit.
const PERIODS: f64 = 6.0;
const SETTLINGS: f64 = 4.0;
/// Samples of a step at least and at most.
const STEP_SAMPLES: [f64; 2] = [200.0, 20_000.0];

impl Asked {
    /// The figures of a spec.
    pub fn of(spec: &Spec, wanted: &[Requirement], sample_time_s: f64) -> Asked {
        let minimise = spec.objective.minimise;
        let mut figures = Vec::new();
        if matches!(minimise, Minimise::PesRms | Minimise::Dft | Minimise::Disturbance) {
            figures.push(RecordFigure::Objective);
        }
        let mut harmonic = 0;
        figures.extend(wanted.iter().filter_map(|w| RecordFigure::of(w.what, &mut harmonic)));
        let stepped = spec.limits.overshoot_percent.is_some() || spec.limits.settling_s.is_some();
        Asked {
            figures,
            minimise,
            weights: band_weights(spec),
            bands_hz: spec.objective.bands_hz.clone(),
            harmonics: spec.limits.harmonics.iter().map(|h| h.k).collect(),
            step_samples: if stepped { step_samples(spec, sample_time_s) } else { 0 },
        }
    }

    /// Where a figure lies in the list.
    pub fn place(&self, figure: RecordFigure) -> Option<usize> {
        self.figures.iter().position(|f| *f == figure)
    }

    /// Whether the objective is the first figure.
    pub fn objective_is_figure(&self) -> bool {
        self.figures.first() == Some(&RecordFigure::Objective)
    }

    /// Whether the end of the move is limited.
    pub fn moves(&self) -> bool {
        self.any(|f| matches!(f, RecordFigure::MoveOvershoot | RecordFigure::MoveEnvelope))
    }

    /// Whether any of the figures is of this kind.
    pub fn any(&self, of: impl Fn(RecordFigure) -> bool) -> bool {
        self.figures.iter().any(|f| of(*f))
    }
}

/// Samples of the simulated step: enough for the slowest loop that is searched.
pub(super) fn step_samples(spec: &Spec, sample_time_s: f64) -> usize {
    let [lowest_hz, _] = spec.crossover_hz(sample_time_s);
    let watched = (SETTLINGS * spec.limits.settling_s.unwrap_or(0.0)).max(PERIODS / lowest_hz);
    (watched / sample_time_s).clamp(STEP_SAMPLES[0], STEP_SAMPLES[1]) as usize
}

/// One over each band's limit where it has one, else 1.
pub(super) fn band_weights(spec: &Spec) -> Vec<f64> {
    let limits = [spec.limits.dft_low, spec.limits.dft_high];
    let weight = |i: usize| limits.get(i).copied().flatten().map_or(1.0, |limit| 1.0 / limit);
    (0..spec.objective.bands_hz.len()).map(weight).collect()
}
