//! Random loops of known truth against the certificate: no limit may be called proved that the truth misses.
//!
//! Truth is of other algorithms: partial fractions, margins refined on the function, eigenvalues of the closed loop.

use super::StudyError;
use rayon::prelude::*;
use serde::Serialize;
use servotune::controller::{Controller, Lowpass, Notch, Pid};
use servotune::feedback::{ModelLoop, OpenLoop, closed_loop_poles, margins};
use servotune::lti::{DiscretePlant, FrequencyResponse, Mode, Plant, Section};
use servotune::numeric::random::Random;
use servotune::twin::plants::random_plant;
use servotune::verify::{BoundedFigure, Stability, Uncertainty, VerifySettings, prove_loop};
use std::f64::consts::{PI, TAU};

/// Controller's sample time (s).
pub(super) const T: f64 = 39.6e-6;
/// Limits are drawn this far around the truth (share).
const AROUND: f64 = 0.03;
/// The refinement of the truth: a limit met or missed by less says nothing.
const TRUTH: f64 = 1e-7;

/// One loop, for a peer to judge again.
#[derive(Clone, Debug, Serialize)]
pub(super) struct LoopRow {
    pub body: [f64; 3],
    pub delay_s: f64,
    pub modes: Vec<Mode>,
    pub sections: Vec<Section>,
    pub stable: bool,
    pub phase_margin_deg: Option<f64>,
    pub gain_margin_db: Option<f64>,
    pub max_sensitivity: f64,
    pub proven_gain_margin_db: Option<f64>,
    pub proven_phase_margin_deg: Option<f64>,
    pub proven_max_sensitivity: Option<f64>,
}

/// A loop whose stability the proof left open.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenLoopCase {
    pub seed: u64,
    /// Size of its largest pole in truth, less 1.
    pub beyond: f64,
    /// Its largest sensitivity in truth.
    pub max_sensitivity: f64,
    pub cells: usize,
}

/// What one loop came to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LoopCase {
    pub narrow: bool,
    pub stable: bool,
    pub proved_stable: bool,
    pub undecided: Option<OpenLoopCase>,
    /// Truth outside the bounds.
    pub broken: bool,
    /// Limits met in truth, missed in truth.
    pub met: usize,
    pub missed: usize,
    /// Limits missed in truth and called proved; met and not called so.
    pub false_passes: usize,
    pub refusals: usize,
    /// The same of the table as a whole.
    pub good_table: bool,
    pub table_refused: bool,
    pub table_passed: bool,
    pub cells: usize,
}

/// The loops of these seeds, in their order.
pub(super) fn loops(seeds: std::ops::Range<u64>) -> Result<Vec<LoopCase>, StudyError> {
    seeds.into_par_iter().map(|seed| Ok(judge(seed)?.0)).collect()
}

/// The first `count` loops with their truth.
pub(super) fn rows(count: u64) -> Result<Vec<LoopRow>, StudyError> {
    (0..count).into_par_iter().map(|seed| Ok(judge(seed)?.1)).collect()
}

/// A loop near its limits; every second one has one or two modes of damping 1e-4 to 3e-3 besides.
pub(super) fn draw(seed: u64) -> Result<(Plant, Controller, bool), StudyError> {
    let mut r = Random::stream(seed, 71);
    let ordinary = 2 + (r.bits() % 8) as usize;
    let mut plant = random_plant(&mut r, ordinary);
    let narrow = r.uniform() < 0.5;
    if narrow {
        for _ in 0..1 + r.bits() % 2 {
            let w = TAU * r.between(700f64.ln(), 9000f64.ln()).exp();
            let damping = r.between(1e-4f64.ln(), 3e-3f64.ln()).exp();
            let apart = r.between(-6.0 * damping, 6.0 * damping);
            plant.modes.push(Mode {
                zero_rad_s: w * (1.0 + apart),
                zero_damping_ratio: damping,
                pole_rad_s: w,
                pole_damping_ratio: damping * r.between(0.7, 1.0),
            });
        }
    }
    let hz = r.between(150f64.ln(), 900f64.ln()).exp();
    let mut c = Controller {
        sample_time_s: T,
        output_limit: None,
        pid: Pid {
            kp: 1.0,
            ki_per_s: if r.uniform() < 0.9 { r.between(1.0, 0.3 * TAU * hz) } else { 0.0 },
            kd_s: r.between(0.5, 2.5) / (TAU * hz),
            derivative_filter_s: 12e-6,
        },
        lowpass: vec![Lowpass { frequency_hz: r.between(2500.0, 12_400.0), damping_ratio: 0.7 }],
        notch: vec![Notch {
            frequency_hz: r.between(800.0, 5000.0),
            zero_damping_ratio: r.between(0.02, 0.2),
            pole_damping_ratio: r.between(0.2, 0.6),
        }],
        biquad: vec![],
        feedforward: None,
    };
    let size = DiscretePlant::of(&plant, T)?.at(TAU * hz).norm() * c.sections()?.at(TAU * hz).norm();
    for k in [&mut c.pid.kp, &mut c.pid.ki_per_s, &mut c.pid.kd_s] {
        *k /= size;
    }
    Ok((plant, c, narrow))
}

fn judge(seed: u64) -> Result<(LoopCase, LoopRow), StudyError> {
    let (plant, c, narrow) = draw(seed)?;
    let (sampled, sections) = (DiscretePlant::of(&plant, T)?, c.sections()?);
    let l = ModelLoop::new(&sampled, &sections)?;
    let m = margins(&l);
    let largest = closed_loop_poles(&l)?.iter().map(|z| z.norm()).fold(0.0, f64::max);
    let stable = largest < 1.0;
    // Half the sample rate is a phase crossing where L is negative there.
    let end = l.at(PI / T).re;
    let end_db = (end < 0.0).then(|| 20.0 * (-end).log10().abs());
    let gain = m.gain_margin_db.map(f64::abs).into_iter().chain(end_db).min_by(f64::total_cmp);
    let b = prove_loop(&plant, &sections.chain, T, &Uncertainty::default(), &VerifySettings::default())?;
    let mut case = LoopCase {
        narrow,
        stable,
        proved_stable: b.stability == Stability::Stable,
        undecided: (b.stability == Stability::Undecided).then_some(OpenLoopCase {
            seed,
            beyond: largest - 1.0,
            max_sensitivity: m.max_sensitivity,
            cells: b.cells,
        }),
        cells: b.cells,
        ..LoopCase::default()
    };
    case.broken = (case.proved_stable && !stable) || (b.stability == Stability::Unstable && stable);
    let mut r = Random::stream(seed, 72);
    let mut good = stable;
    let mut passed = case.proved_stable;
    let mut limit = |truth: Option<f64>, proven: BoundedFigure, at_least: bool| {
        let by = 1.0 + r.between(-AROUND, AROUND);
        let Some(truth) = truth else { return };
        // No lower end of a margin says that no crossing limits it; of a loop whose stability is open it says nothing.
        let unlimited = at_least && b.stability == Stability::Stable;
        let low = proven.low.unwrap_or(if unlimited { f64::INFINITY } else { 0.0 });
        let high = proven.high.unwrap_or(f64::INFINITY);
        case.broken |= truth < low * (1.0 - TRUTH) || truth > high * (1.0 + TRUTH);
        let required = truth * by;
        let (met, proved) =
            if at_least { (required <= truth, low >= required) } else { (required >= truth, high <= required) };
        let proved = proved && b.stability == Stability::Stable;
        case.met += usize::from(met);
        case.missed += usize::from(!met);
        case.false_passes += usize::from(proved && !met);
        case.refusals += usize::from(met && !proved && stable);
        good &= met;
        passed &= proved;
    };
    if stable {
        limit(m.phase_margin_deg.map(f64::abs), b.phase_margin_deg, true);
        limit(gain, b.gain_margin_db, true);
        limit(Some(m.max_sensitivity), b.max_sensitivity, false);
        limit(m.delay_margin_s, b.delay_margin_s, true);
        limit(Some(m.disk_margin), b.disk_margin, true);
    }
    (case.good_table, case.table_passed) = (good, passed);
    case.table_refused = good && !passed;
    let body = match plant.body {
        servotune::lti::Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } => {
            [dc_gain, natural_frequency_rad_s, damping_ratio]
        }
        servotune::lti::Body::FreeInertia { .. } | servotune::lti::Body::Rational(_) => [0.0; 3],
    };
    let row = LoopRow {
        body,
        delay_s: plant.delay_s,
        modes: plant.modes,
        sections: sections.chain.clone(),
        stable,
        phase_margin_deg: m.phase_margin_deg.map(f64::abs),
        gain_margin_db: gain,
        max_sensitivity: m.max_sensitivity,
        proven_gain_margin_db: b.gain_margin_db.low,
        proven_phase_margin_deg: b.phase_margin_deg.low,
        proven_max_sensitivity: b.max_sensitivity.high,
    };
    Ok((case, row))
}
