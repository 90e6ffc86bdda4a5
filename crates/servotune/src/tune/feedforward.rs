//! Feed-forward set to the move: with the feedback as it stands the write is affine in the two feed-forward gains, so the best ones are the
//! answer of a convex programme.
//!
//! In: a plant, a controller, a spec with its profile. Out: velocity and acceleration gains, factor 1, and the samples that they are ahead: the
//! programme is solved for each from none to a little more than the plant's delay, and the least is taken. Minimised: the rms of the window's PES without noise,
//! or the weighted sum of its DFT norms where the objective is `dft`, subject to the command's peak where a limit holds it. Method: second-order
//! cones (clarabel). Reference: r' and r'' by central differences, as the firmware forms them.

use super::record_figures::band_weights;
use super::{Minimise, Spec, TuneError};
use crate::controller::{Controller, Feedforward};
use crate::lti::{DiscretePlant, Plant};
use crate::pes::{Asked, Profile, QuickScene, QuickWork, WriteRecord};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus, SupportedConeT,
};
use std::f64::consts::TAU;

/// The record without noise under one setting of the feed-forward: the window's PES, and the whole command.
struct Response {
    window: Vec<f64>,
    command: Vec<f64>,
}

/// Samples beyond the plant's delay that are tried: modes and filters turn the phase as a further delay does.
const BEYOND_DELAY: f64 = 3.0;

/// The best feed-forward around `c` on `plant`; none where the programme has no answer.
pub(super) fn best_feedforward(plant: &Plant, c: &Controller, spec: &Spec) -> Result<Option<Feedforward>, TuneError> {
    let profile = spec.write("feed-forward")?;
    let sampled = DiscretePlant::of(plant, c.sample_time_s)?;
    let scene = QuickScene::new(profile, &sampled)?;
    let chain = c.sections()?.chain;
    let mut work = QuickWork::default();
    let asked = Asked { still: true, drawn: false, whole: true, slopes: false };
    let mut respond = |velocity_s: f64, acceleration_s2: f64, ahead_samples: u32| {
        let forward = Feedforward { factor: 1.0, velocity_s, acceleration_s2, ahead_samples };
        // The output limit would bend what is affine; the limit on the peak is a row below.
        scene.run(&chain, Some(&forward), None, asked, &mut work);
        Response {
            window: work.window(WriteRecord::Still).to_vec(),
            command: work.command(WriteRecord::Still).to_vec(),
        }
    };
    let base = respond(0.0, 0.0, 0);
    let unit =
        |r: Response| Response { window: less(&r.window, &base.window), command: less(&r.command, &base.command) };
    let most = (plant.delay_s / c.sample_time_s + BEYOND_DELAY).clamp(0.0, f64::from(Feedforward::MOST_AHEAD)) as u32;
    let mut best: Option<(f64, Feedforward)> = None;
    for ahead_samples in 0..=most {
        let [velocity, acceleration] = [[1.0, 0.0], [0.0, 1.0]].map(|[v, a]| unit(respond(v, a, ahead_samples)));
        let Some((value, [velocity_s, acceleration_s2])) = least(&base, [&velocity, &acceleration], spec, profile)
        else {
            continue;
        };
        if best.as_ref().is_none_or(|(least, _)| value < *least) {
            best = Some((value, Feedforward { factor: 1.0, velocity_s, acceleration_s2, ahead_samples }));
        }
    }
    Ok(best.map(|(_, forward)| forward))
}

/// The least that both gains reach, and the gains; none where the programme has no answer.
fn least(base: &Response, columns: [&Response; 2], spec: &Spec, profile: &Profile) -> Option<(f64, [f64; 2])> {
    // Columns of one size keep the programme well scaled.
    let size = |r: &Response| r.window.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [velocity, acceleration] = columns;
    let scale = columns.map(size);
    if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return None;
    }
    let rate = profile.pes.sample_rate_hz;
    let blocks: Vec<(f64, Vec<[f64; 3]>)> = if spec.objective.minimise == Minimise::Dft {
        let weighed = spec.objective.bands_hz.iter().zip(band_weights(spec));
        weighed.map(|(band, w)| (w, bins(&columns, base, scale, *band, rate))).collect()
    } else {
        let n = base.window.len() as f64;
        let row = |i: usize| {
            [velocity.window[i] / scale[0], acceleration.window[i] / scale[1], base.window[i]].map(|x| x / n.sqrt())
        };
        vec![(1.0, (0..base.window.len()).map(row).collect())]
    };
    let mut peak = Vec::new();
    if let Some(limit) = spec.limits.command_peak {
        for (k, u) in base.command.iter().enumerate() {
            let row = [velocity.command[k] / scale[0], acceleration.command[k] / scale[1], *u];
            peak.push([-row[0], -row[1], limit - row[2]]);
            peak.push([row[0], row[1], limit + row[2]]);
        }
    }
    let (value, [v, a]) = solve(&blocks, &peak)?;
    Some((value, [v / scale[0], a / scale[1]]))
}

fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Real and imaginary part of every bin of a band, as rows over both gains and the constant.
fn bins(columns: &[&Response; 2], base: &Response, scale: [f64; 2], band: [f64; 2], rate: f64) -> Vec<[f64; 3]> {
    let n = base.window.len();
    let mut rows = Vec::new();
    for k in (1..=n / 2).filter(|k| (band[0]..=band[1]).contains(&(*k as f64 * rate / n as f64))) {
        let part = |x: &[f64], shift: f64| {
            let turn = |i: usize| (TAU * ((k * i) % n) as f64 / n as f64 + shift).cos();
            x.iter().enumerate().map(|(i, x)| x * turn(i)).sum::<f64>() / n as f64
        };
        for shift in [0.0, 0.25 * TAU] {
            let [v, a] = [0, 1].map(|i| part(&columns[i].window, shift) / scale[i]);
            rows.push([v, a, part(&base.window, shift)]);
        }
    }
    rows
}

/// minimise the sum of weight |rows [x; 1]| subject to half-spaces row [x; 1] >= 0: that sum, and x.
fn solve(blocks: &[(f64, Vec<[f64; 3]>)], half_spaces: &[[f64; 3]]) -> Option<(f64, [f64; 2])> {
    let n = 2 + blocks.len();
    let (mut b, mut kinds, mut entries) = (Vec::new(), Vec::<SupportedConeT<f64>>::new(), vec![Vec::new(); n]);
    // s = b - A x: of a row r [x; 1] the matrix holds -r.
    let mut put = |row: &[f64; 3], b: &mut Vec<f64>| {
        for j in 0..2 {
            entries[j].push((b.len(), -row[j]));
        }
        b.push(row[2]);
    };
    half_spaces.iter().for_each(|row| put(row, &mut b));
    if !half_spaces.is_empty() {
        kinds.push(NonnegativeConeT(half_spaces.len()));
    }
    let mut heads = Vec::new();
    for (_, rows) in blocks {
        heads.push(b.len());
        b.push(0.0);
        rows.iter().for_each(|row| put(row, &mut b));
        kinds.push(SecondOrderConeT(rows.len() + 1));
    }
    for (i, head) in heads.iter().enumerate() {
        entries[2 + i].push((*head, -1.0));
    }
    let (mut start, mut place, mut value) = (vec![0], Vec::new(), Vec::new());
    for column in &entries {
        for (row, x) in column {
            place.push(*row);
            value.push(*x);
        }
        start.push(place.len());
    }
    let a = CscMatrix::new(b.len(), n, start, place, value);
    let mut cost = vec![0.0; n];
    blocks.iter().enumerate().for_each(|(i, (weight, _))| cost[2 + i] = *weight);
    let settings = DefaultSettings::<f64> { verbose: false, max_threads: 1, ..DefaultSettings::default() };
    let mut solver = DefaultSolver::new(&CscMatrix::zeros((n, n)), &cost, &a, &b, &kinds, settings).ok()?;
    solver.solve();
    let s = &solver.solution;
    let good = matches!(s.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
    (good && s.x[..2].iter().all(|x| x.is_finite())).then(|| (s.obj_val, [s.x[0], s.x[1]]))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_nearest_point_and_the_one_behind_a_half_space() {
        // |(x - 3, y + 1)|: the truth is (3, -1), and (1, -1) where x <= 1.
        let block = vec![(2.0, vec![[1.0, 0.0, -3.0], [0.0, 1.0, 1.0]])];
        let (_, [x, y]) = solve(&block, &[]).unwrap();
        // At the point itself the norm has a kink, which the solver rounds off.
        assert!((x - 3.0).abs() < 1e-4 && (y + 1.0).abs() < 1e-4, "{x} {y}");
        let (value, [x, y]) = solve(&block, &[[-1.0, 0.0, 1.0]]).unwrap();
        assert!((x - 1.0).abs() < 1e-5 && (y + 1.0).abs() < 1e-5, "{x} {y}");
        // Twice the distance of 2.
        assert!((value - 4.0).abs() < 1e-4, "{value}");
    }
}
