//! A play whose masses rattle, found under an observer: no simulation over a whole record repeats what depends on the smallest start.
//!
//! In: a diagnosis that ended without a name, or at a part of the structure, and what its linear plants leave in open loop. Out: the finding, and a plant
//! that was fitted beside what the observer saw. A resonance under the same observer is the rival; held-out records must agree.
//! Spec: `specs/mismatch.md`.

use super::diagnosis_json::Diagnosis;
use super::finding::{Estimate, Finding, Verdict};
use super::localisation::place;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::{Corrected, corrected};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::refit;
use crate::diagnose::fit::simulation::{SimulatedModel, errors};
use crate::diagnose::rules::{PLAY_CLEARLY, PLAY_HELD_OUT, PLAY_LEAST, PLAY_TOUCHES};
use crate::lti::{PhysicsEntry, Plant};
use crate::numeric::statistics::median;
use crate::physics::backlash::{Backlash, Contact, FACTS};
use crate::physics::{Parametric, PlayObserver, Port, Readings, Setting, logarithmic};
use crate::recording::Role;
use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::neldermead::NelderMead;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Samples of the fitted records that the numbers are searched on.
const SAMPLES: usize = 8000;
/// Shortest record.
const SHORTEST: usize = 64;
/// Gaps of the grid, from the sensor's noise on.
const GAPS: usize = 12;
/// Frequencies of the grid over the sample rate.
const CONTACTS: [f64; 2] = [0.02, 0.3];
const FREQUENCIES: usize = 11;
const DAMPING: f64 = 0.03;
/// Drives of the grid: behind the play, and before it.
const DRIVES: [f64; 3] = [-1.0, 0.15, 0.35];
/// Noise of the acceleration over a sample, in the sensor's noise.
const SHAKES: [f64; 2] = [0.03, 0.25];
/// Starts of the simplex, its edge (ln of a number), its steps and the spread at which it ends.
const STARTS: usize = 3;
const EDGE: f64 = 0.2;
const REFLECTIONS: u64 = 300;
const SPREAD: f64 = 1e-2;
/// Ranges of the numbers: contact over the sample rate, damping, the share of the load, the gap over what is left (rms). What rests at an
/// end of them, by a tenth, is no play that these records show: a slow motion in a wide gap follows any drift.
const RATES: [f64; 2] = [0.01, 0.45];
const DAMPINGS: [f64; 2] = [1e-3, 0.5];
const LOADS: [f64; 2] = [0.03, 0.6];
const WIDEST: f64 = 5.0;
const AT_END: f64 = 1.1;
/// Frequency of a rival from which it is a drift, over the sample rate, and how many of the grid.
const DRIFT: f64 = 5e-4;
const RIVALS: usize = 20;
/// Noise of the acceleration in a record that was not used, over that of the fitted ones: each record may have its own.
const OWN: [f64; 4] = [1.0, 3.0, 10.0, 30.0];
/// Linear plants that the search sets out from: those that leave least.
const PLANTS: usize = 2;
/// Rounds of plant and play after one another.
const ROUNDS: usize = 3;
/// Steps of the curvature (ln of a number).
const CURVATURE: f64 = 0.02;
/// What the observer errs by: it takes a kink for its mean (shares of gap and frequency).
const FORM: [f64; 2] = [0.06, 0.12];
/// The load's share where nothing tells it: the value, and the range.
const LOAD: f64 = 0.2;
const LOAD_RANGE: [f64; 2] = [0.0, 0.5];

/// Which side of the play the encoder reads, or that there is none: a resonance.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    Before,
    Behind,
    Resonance,
}

/// A play under the observer.
pub(in crate::diagnose) struct ObservedPlay {
    finding: Finding,
    remark: String,
    /// The plant beside it, with the play.
    pub corrected: Corrected,
}

/// Fitted numbers of the observer.
#[derive(Clone, Copy)]
struct Fitted {
    side: Side,
    observer: PlayObserver,
    deviance: f64,
}

/// What some readings say of observers.
struct Ground {
    fit: Vec<Readings>,
    held: Vec<Readings>,
    sample_time_s: f64,
    /// Noise of a reading, as differences of neighbours show it, and what is left altogether (rms).
    noise: f64,
    rest: f64,
}

/// A stretch of a record as the observer reads it: the linear plant's own motion is what the record holds beside the rest.
fn readings(run: &Run, rest: &[f64], over: std::ops::Range<usize>, sample_time_s: f64) -> Readings {
    let n = run.len();
    let moved = |k: usize| run.position[k] - rest[k];
    let second = |k: usize| {
        let k = k.clamp(1, n - 2);
        (moved(k + 1) - 2.0 * moved(k) + moved(k - 1)) / (sample_time_s * sample_time_s)
    };
    let acceleration = over.clone().map(|k| 0.5 * (second(k) + second((k + 1).min(n - 1)))).collect();
    Readings { rest: rest[over].to_vec(), acceleration }
}

/// Noise of white readings under a slower motion: fourth differences, whose squares add up to 70 (the median is free of contacts).
fn white(readings: &[Readings]) -> f64 {
    let differences = |r: &Readings| -> Vec<f64> {
        r.rest.windows(5).map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs()).collect()
    };
    let all: Vec<f64> = readings.iter().flat_map(differences).collect();
    median(&all).unwrap_or(0.0) / (0.6745 * 70f64.sqrt())
}

impl Ground {
    /// The ground of what a linear plant leaves; none where it leaves nothing finite, or records are too short to tell.
    fn of(data: &DiagnosisData, rest: &[Vec<f64>]) -> Option<Ground> {
        let t = data.scene.sample_time_s;
        let of = |role: Role| -> Vec<usize> {
            (0..data.runs.len()).filter(|&i| data.runs[i].role == role && !data.runs[i].shocked).collect()
        };
        let stretches = |which: Vec<usize>| -> Vec<Readings> {
            let each = SAMPLES / which.len().max(1);
            let stretch = |&i: &usize| {
                let n = data.runs[i].len();
                let from = n.saturating_sub(each) / 2;
                readings(&data.runs[i], &rest[i], from..(from + each).min(n), t)
            };
            which.iter().filter(|&&i| data.runs[i].len() > 8).map(stretch).collect()
        };
        let (fit, held) = (stretches(of(Role::Fit)), stretches(of(Role::Holdout)));
        let all: Vec<f64> = fit.iter().flat_map(|r| r.rest.iter().copied()).collect();
        let left = (all.iter().map(|v| v * v).sum::<f64>() / all.len().max(1) as f64).sqrt();
        let noise = white(&fit);
        let sound = left.is_finite() && noise > 0.0 && noise.is_finite();
        sound.then_some(Ground { fit, held, sample_time_s: t, noise, rest: left })
    }

    fn samples(readings: &[Readings]) -> f64 {
        readings.iter().map(|r| r.rest.len()).sum::<usize>() as f64
    }

    fn deviance(&self, observer: &PlayObserver, readings: &[Readings]) -> f64 {
        readings.iter().map(|r| observer.deviance(r, self.sample_time_s)).sum()
    }

    /// Deviance of the held-out readings, each stretch with the noise of the acceleration that suits it best.
    fn held_out(&self, observer: &PlayObserver) -> f64 {
        let own = |r: &Readings| {
            let each = OWN.map(|by| PlayObserver { process: by * observer.process, ..*observer });
            each.iter().map(|o| o.deviance(r, self.sample_time_s)).fold(f64::INFINITY, f64::min)
        };
        self.held.iter().map(own).sum()
    }

    /// Whether a play's numbers rest at an end of their ranges.
    fn at_end(&self, play: &Fitted) -> bool {
        let o = &play.observer;
        let load = o.drive / (1.0 + o.drive);
        let before = play.side == Side::Before;
        o.contact_hz * self.sample_time_s < RATES[0] * AT_END
            || o.damping_ratio * AT_END > DAMPINGS[1]
            || o.gap * AT_END > WIDEST * self.rest
            || before && (load < LOADS[0] * AT_END || load * AT_END > LOADS[1])
    }

    /// A noise of the acceleration that moves a reading by a share of its noise within a sample.
    fn shake(&self, share: f64) -> f64 {
        share * self.noise / self.sample_time_s.powf(1.5)
    }

    /// Observers of a grid.
    fn grid(&self, side: Side) -> Vec<PlayObserver> {
        let rate = self.sample_time_s.recip();
        let gaps = match side {
            Side::Resonance => vec![0.0],
            _ => logarithmic(self.noise, (WIDEST * self.rest).max(2.0 * self.noise), GAPS),
        };
        let drives: Vec<f64> = match side {
            Side::Before => DRIVES[1..].to_vec(),
            Side::Behind => DRIVES[..1].to_vec(),
            Side::Resonance => DRIVES.to_vec(),
        };
        let contacts = match side {
            Side::Resonance => logarithmic(DRIFT * rate, CONTACTS[1] * rate, RIVALS),
            _ => logarithmic(CONTACTS[0] * rate, CONTACTS[1] * rate, FREQUENCIES),
        };
        let mut all = Vec::new();
        for drive in drives {
            for gap in &gaps {
                for contact_hz in &contacts {
                    all.extend(SHAKES.map(|share| PlayObserver {
                        gap: *gap,
                        contact_hz: *contact_hz,
                        damping_ratio: DAMPING,
                        drive,
                        process: self.shake(share),
                        sensor_rms: self.noise,
                    }));
                }
            }
        }
        all
    }

    /// The best observer of a side.
    fn fitted(&self, side: Side) -> Option<Fitted> {
        let mut all: Vec<(f64, PlayObserver)> =
            self.grid(side).into_par_iter().map(|o| (self.deviance(&o, &self.fit), o)).collect();
        all.retain(|(d, _)| d.is_finite());
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut starts: Vec<PlayObserver> = Vec::new();
        for (_, o) in all {
            let near = |s: &PlayObserver| s.drive == o.drive && (s.contact_hz / o.contact_hz).ln().abs() < EDGE;
            if starts.len() < STARTS && !starts.iter().any(near) {
                starts.push(o);
            }
        }
        let ends: Vec<Fitted> = starts.par_iter().filter_map(|o| self.settled(side, o)).collect();
        ends.into_iter().min_by(|a, b| a.deviance.total_cmp(&b.deviance))
    }

    /// A simplex from an observer.
    fn settled(&self, side: Side, from: &PlayObserver) -> Option<Fitted> {
        let x = numbers(side, from);
        let mut vertices = vec![x.clone()];
        vertices.extend((0..x.len()).map(|i| {
            let mut v = x.clone();
            v[i] += EDGE;
            v
        }));
        let solver = NelderMead::new(vertices).with_sd_tolerance(SPREAD).ok()?;
        let run = Executor::new(Likelihood { ground: self, side }, solver);
        let found = run.configure(|s| s.max_iters(REFLECTIONS)).timer(false).run().ok()?.state;
        let observer = observer(side, found.best_param.as_ref()?);
        let deviance = self.deviance(&observer, &self.fit);
        deviance.is_finite().then_some(Fitted { side, observer, deviance })
    }

    /// Standard deviations of the numbers (of their logarithms), from the curvature of the deviance.
    fn spread(&self, fitted: &Fitted) -> Option<Vec<f64>> {
        let x = numbers(fitted.side, &fitted.observer);
        let n = x.len();
        let at = |moves: &[(usize, f64)]| {
            let mut y = x.clone();
            moves.iter().for_each(|(i, by)| y[*i] += by * CURVATURE);
            self.deviance(&observer(fitted.side, &y), &self.fit)
        };
        let curvature = DMatrix::from_fn(n, n, |i, j| {
            let four = [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)].map(|(a, b)| at(&[(i, a), (j, b)]));
            (four[0] + four[1] - four[2] - four[3]) / (4.0 * CURVATURE * CURVATURE)
        });
        // Half the deviance is minus the log-likelihood.
        let covariance = (0.5 * curvature).cholesky()?.inverse();
        Some((0..n).map(|i| covariance[(i, i)].sqrt()).collect())
    }
}

/// Logarithms of the numbers that a simplex moves; behind the play the drive is known.
fn numbers(side: Side, o: &PlayObserver) -> Vec<f64> {
    let mut x = vec![o.contact_hz.ln(), o.damping_ratio.ln(), o.process.ln(), o.sensor_rms.ln()];
    match side {
        Side::Behind => x.push(o.gap.ln()),
        Side::Before => x.extend([o.gap.ln(), o.drive.ln()]),
        // The drive of a resonance has either sign.
        Side::Resonance => x.push(o.drive),
    }
    x
}

fn observer(side: Side, x: &[f64]) -> PlayObserver {
    let (gap, drive) = match side {
        Side::Behind => (x[4].exp(), -1.0),
        Side::Before => (x[4].exp(), x[5].exp()),
        Side::Resonance => (0.0, x[4]),
    };
    let [contact_hz, damping_ratio, process, sensor_rms] = [x[0], x[1], x[2], x[3]].map(f64::exp);
    PlayObserver { gap, contact_hz, damping_ratio, drive, process, sensor_rms }
}

/// The deviance as argmin wants it: numbers that no machine has cost without bound.
struct Likelihood<'a> {
    ground: &'a Ground,
    side: Side,
}

impl CostFunction for Likelihood<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        let o = observer(self.side, x);
        let load = o.drive / (1.0 + o.drive);
        let free = self.side == Side::Resonance;
        let rate = o.contact_hz * self.ground.sample_time_s;
        let possible = (DAMPINGS[0]..=DAMPINGS[1]).contains(&o.damping_ratio)
            && rate < RATES[1]
            && (free || rate >= RATES[0] && o.gap <= WIDEST * self.ground.rest)
            && (self.side != Side::Before || (LOADS[0]..=LOADS[1]).contains(&load));
        Ok(if possible { self.ground.deviance(&o, &self.ground.fit).min(1e15) } else { 1e15 })
    }
}

/// What a plant leaves of every run in open loop.
fn left(data: &DiagnosisData, made: &Corrected) -> Vec<Vec<f64>> {
    let every: Vec<&Run> = data.runs.iter().collect();
    let effects = made.effects.iter().collect();
    let alone = SimulatedModel { plant: &made.plant, effects, own: vec![], lines: &[], fit: None, scene: &data.scene };
    errors(&alone, &every, None)
}

/// The plant that is fitted to what the records hold beside the play.
fn beside(data: &DiagnosisData, rest: &[Vec<f64>], play: &PlayObserver, iterations: usize) -> Option<Corrected> {
    let t = data.scene.sample_time_s;
    let cleared = |(run, rest): (&Run, &Vec<f64>)| {
        let added = play.follow(&readings(run, rest, 0..run.len(), t), t).added;
        let position = run.position.iter().zip(&added).map(|(y, q)| y - q).collect();
        Run { position, ..run.clone() }
    };
    let runs = data.runs.iter().zip(rest).map(cleared).collect();
    let ground = DiagnosisData::new(&data.form.given, runs, t, data.scene.spindle_hz).ok()?;
    let (ground, linear) = refit(ground, iterations);
    Some(corrected(&ground.form, &linear.refitted.p, &[], &ground.scene))
}

/// A play with the plant beside it.
struct Found {
    ground: Ground,
    plant: Corrected,
    play: Fitted,
}

/// The play beside one of some linear plants, with the grounds of all: plant and play after one another until neither gains.
fn found(data: &DiagnosisData, plants: &[Plant], iterations: usize) -> Option<(Found, Vec<Ground>)> {
    let mut begun: Vec<(Ground, Vec<Vec<f64>>, Corrected)> = Vec::new();
    for plant in plants {
        let plant = Corrected { plant: plant.clone(), effects: vec![] };
        let rest = left(data, &plant);
        if let Some(ground) = Ground::of(data, &rest)
            && begun.iter().all(|(g, ..)| g.rest != ground.rest)
        {
            begun.push((ground, rest, plant));
        }
    }
    begun.sort_by(|a, b| a.0.rest.total_cmp(&b.0.rest));
    begun.truncate(PLANTS);
    let plays = begun.iter().enumerate().flat_map(|(i, (ground, ..))| {
        [Side::Before, Side::Behind].into_iter().filter_map(move |s| ground.fitted(s).map(|play| (i, play)))
    });
    let (at, play) = plays.min_by(|a, b| a.1.deviance.total_cmp(&b.1.deviance))?;
    let (ground, mut rest, plant) = begun.swap_remove(at);
    let mut grounds: Vec<Ground> = begun.into_iter().map(|b| b.0).collect();
    let mut best = Found { ground, plant, play };
    for _ in 0..ROUNDS {
        let Some(plant) = beside(data, &rest, &best.play.observer, iterations) else { break };
        let now = left(data, &plant);
        let Some(ground) = Ground::of(data, &now) else { break };
        let Some(play) = ground.settled(best.play.side, &best.play.observer) else { break };
        if play.deviance >= best.play.deviance {
            grounds.push(ground);
            break;
        }
        grounds.push(std::mem::replace(&mut best, Found { ground, plant, play }).ground);
        rest = now;
    }
    Some((best, grounds))
}

/// Looks for a play under the observer, beside linear plants; none where a resonance follows the records as well.
pub(in crate::diagnose) fn observed_play(
    data: &DiagnosisData,
    plants: &[Plant],
    iterations: usize,
) -> Option<ObservedPlay> {
    if data.runs.iter().any(|r| r.len() < SHORTEST) {
        return None;
    }
    let (best, grounds) = found(data, plants, iterations)?;
    let (own, play) = (&best.ground, &best.play);
    let rivals: Vec<[f64; 2]> = grounds
        .iter()
        .chain([own])
        .filter_map(|g| g.fitted(Side::Resonance).map(|r| [r.deviance, g.held_out(&r.observer)]))
        .collect();
    let least = |at: usize| rivals.iter().map(|r| r[at]).fold(f64::INFINITY, f64::min);
    let (samples, held) = (Ground::samples(&own.fit), Ground::samples(&own.held));
    let gain = least(0) - play.deviance;
    let contact = |r: &Readings| play.observer.follow(r, own.sample_time_s).touching * r.rest.len() as f64;
    let touching = own.fit.iter().map(contact).sum::<f64>() / samples;
    let crossed = touching > PLAY_TOUCHES && touching < 1.0 - PLAY_TOUCHES;
    let agrees = held == 0.0 || (least(1) - own.held_out(&play.observer)) / held > PLAY_HELD_OUT * gain / samples;
    let clear = gain > PLAY_LEAST && gain > PLAY_CLEARLY * samples;
    (clear && crossed && agrees && !own.at_end(play)).then(|| told(data, &best, gain, touching))
}

/// The play as its law has it, with the share of the distance that the encoder reads.
fn law(play: &Fitted) -> (Backlash, f64) {
    let o = &play.observer;
    let (gap, load, read) = match play.side {
        Side::Before => {
            let load = o.drive / (1.0 + o.drive);
            (o.gap / load, load, load)
        }
        _ => (o.gap / (1.0 - LOAD), LOAD, LOAD - 1.0),
    };
    let contact = Contact { hz: o.contact_hz, damping_ratio: o.damping_ratio, drive: 1.0 / (1.0 - load) };
    (Backlash { gap, contact: Some(contact) }, read)
}

/// The finding, what is said beside it, and the plant with the play.
fn told(data: &DiagnosisData, best: &Found, gain: f64, touching: f64) -> ObservedPlay {
    let (law, read) = law(&best.play);
    let (position, command) = (&best.plant.plant.position_unit, &best.plant.plant.command_unit);
    let spread = best.ground.spread(&best.play);
    // Parameters by the places of their logarithms; what the observer does not tell stands in its range.
    let off = |places: &[usize], form: f64| {
        let squares = spread.as_ref().map_or(0.25, |s| places.iter().map(|&i| s[i] * s[i]).sum());
        1.96 * f64::sqrt(squares).hypot(form)
    };
    let behind = best.play.side == Side::Behind;
    let parameters: BTreeMap<String, Estimate> = law
        .parameters(&[read], &data.scene)
        .into_iter()
        .map(|p| {
            let by = match p.name {
                "gap" if behind => off(&[4], FORM[0]),
                "gap" => off(&[4, 5], FORM[0]),
                "contact_hz" => off(&[0], FORM[1]),
                "damping_ratio" => off(&[1], FORM[1]),
                "encoder_behind" => 0.0,
                _ => off(if behind { &[] } else { &[5] }, FORM[0]),
            };
            let [mut low, mut high] = [p.value * (-by).exp(), p.value * by.exp()];
            if behind {
                // What is read behind the play is the gap less the load's share of it, and nothing tells that share.
                let read = best.play.observer.gap;
                [low, high] = match p.name {
                    "gap" => [read * (-by).exp(), read / (1.0 - LOAD_RANGE[1]) * by.exp()],
                    "load_share" => LOAD_RANGE,
                    "drive_ratio" => LOAD_RANGE.map(|s| 1.0 / (1.0 - s)),
                    _ => [low, high],
                };
            }
            (p.name.to_owned(), Estimate { value: p.value, low, high, unit: p.unit.text(position, command) })
        })
        .collect();
    let t = data.scene.sample_time_s;
    let rest = left(data, &best.plant);
    let signal = data.stack.series(|i| {
        let first = data.stack.segments[i].runs[0];
        let all = readings(&data.runs[first], &rest[first], 0..data.runs[first].len(), t);
        let mut added = best.play.observer.follow(&all, t).added;
        data.whitener.apply(&mut added);
        added
    });
    let mut corrected = best.plant.clone();
    let entries = parameters.iter().map(|(name, e)| (name.clone(), e.value)).collect();
    corrected.plant.physics.push(PhysicsEntry { effect: FACTS.name.into(), parameters: entries, curve: None });
    corrected.effects.push(Setting::new(law, vec![read]));
    let side = if behind { "behind the play" } else { "on the driven side of it" };
    let finding = Finding {
        effect: FACTS.name.into(),
        family: vec![FACTS.name.into()],
        port: FACTS.port,
        p_value: (-0.5 * gain).exp().max(1e-300),
        says: format!("The encoder sits {side}: {}.", FACTS.says),
        parameters,
        place: place(data, &data.stack, &signal),
    };
    let remark = format!(
        "the play was found under an observer that the recorded positions correct: its masses touch {:.0} % of the time and rattle, and no simulation over a whole record repeats that; a resonance under the same observer is {gain:.0} units of twice the log-likelihood worse",
        100.0 * touching
    );
    ObservedPlay { finding, remark, corrected }
}

/// Whether a diagnosis leaves room for a play: nothing was named, or a part of the structure.
pub(in crate::diagnose) fn open_to_play(d: &Diagnosis) -> bool {
    match d.verdict {
        Verdict::LocatedUnexplained | Verdict::Undecidable => true,
        Verdict::Named | Verdict::Family => d.findings.iter().any(|f| f.port == Port::Structure),
        _ => false,
    }
}

impl ObservedPlay {
    /// Takes what was found into a diagnosis.
    pub(in crate::diagnose) fn enter(&self, d: &mut Diagnosis) {
        d.verdict = Verdict::Named;
        d.findings = vec![self.finding.clone()];
        d.remarks.push(self.remark.clone());
    }
}
