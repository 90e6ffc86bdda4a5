//! The oracle's lambda with a linear refit projected out, and the linear fit that absorbs an effect.

use crate::machine::Plant;
use crate::physics::Physics;
use crate::world::{Drive, Noise, run};

/// A record as delivered, without its base noise.
#[derive(Clone, Debug, Default)]
pub struct Recorded {
    pub reference: Vec<f64>,
    pub excitation: Vec<f64>,
    pub command: Vec<f64>,
    pub clean: Vec<f64>,
    pub noise: Vec<f64>,
    pub head: Vec<f64>,
    pub spindle: Vec<f64>,
    pub start: f64,
}

/// Steps a sample for linear replays.
const COARSE: usize = 4;

/// Open-loop response of a linear plant to the record's own command.
pub fn replay(plant: &Plant, rec: &Recorded, ts: f64) -> Option<Vec<f64>> {
    let drive = Drive {
        reference: vec![0.0; rec.command.len()],
        excitation: rec.excitation.clone(),
        command: Some(rec.command.clone()),
        start: rec.start,
        settle: 0,
        clock: 0.0,
        seed: 1,
    };
    let quiet = Noise { sigma: 0.0, colour: 0.0 };
    run(plant, &Physics::default(), None, &drive, quiet, ts, COARSE).map(|t| t.clean)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn whiten(x: &mut [f64], noise: Noise) {
    let s = 1.0 / (noise.sigma * (1.0 - noise.colour * noise.colour).sqrt());
    for i in (1..x.len()).rev() {
        x[i] = (x[i] - noise.colour * x[i - 1]) * s;
    }
    x[0] /= noise.sigma;
}

/// Orthonormal columns of what a record may shift by itself: offset, initial state, constant torque.
fn local(plant: &Plant, n: usize, ts: f64, noise: Noise) -> Vec<Vec<f64>> {
    let fine = 4;
    let h = ts / fine as f64;
    let free = |mut x: f64, mut v: f64, a: f64| {
        let mut out = Vec::with_capacity(n);
        for _ in 0..n {
            out.push(x);
            for _ in 0..fine {
                let a0 = a - plant.k * x - plant.c * v;
                let x1 = x + h * v + 0.5 * h * h * a0;
                let a1 = a - plant.k * x1 - plant.c * (v + h * a0);
                v += 0.5 * h * (a0 + a1);
                x = x1;
            }
        }
        out
    };
    let mut kept: Vec<Vec<f64>> = Vec::new();
    for mut c in [vec![1.0; n], free(1.0, 0.0, 0.0), free(0.0, 100.0, 0.0), free(0.0, 0.0, 1e4)] {
        whiten(&mut c, noise);
        let before = dot(&c, &c).sqrt();
        for _ in 0..2 {
            for q in &kept {
                let p = dot(q, &c);
                c.iter_mut().zip(q).for_each(|(c, q)| *c -= p * q);
            }
        }
        let norm = dot(&c, &c).sqrt();
        if norm > 1e-7 * before {
            c.iter_mut().for_each(|c| *c /= norm);
            kept.push(c);
        }
    }
    kept
}

fn project(x: &mut [f64], q: &[Vec<f64>]) {
    for q in q {
        let p = dot(q, x);
        x.iter_mut().zip(q).for_each(|(x, q)| *x -= p * q);
    }
}

/// Solves the symmetric positive system with a ridge relative to its diagonal.
pub fn solve(a: &[Vec<f64>], b: &[f64], ridge: f64) -> Vec<f64> {
    let n = b.len();
    let scale: Vec<f64> = (0..n).map(|i| 1.0 / a[i][i].max(1e-300).sqrt()).collect();
    let mut m: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| a[i][j] * scale[i] * scale[j] + if i == j { ridge } else { 0.0 }).collect())
        .collect();
    let mut y: Vec<f64> = (0..n).map(|i| b[i] * scale[i]).collect();
    for i in 0..n {
        let p = (i..n).max_by(|&p, &q| m[p][i].abs().total_cmp(&m[q][i].abs())).unwrap_or(i);
        m.swap(i, p);
        y.swap(i, p);
        for j in i + 1..n {
            let f = m[j][i] / m[i][i];
            for k in i..n {
                m[j][k] -= f * m[i][k];
            }
            y[j] -= f * y[i];
        }
    }
    for i in (0..n).rev() {
        for j in i + 1..n {
            y[i] -= m[i][j] * y[j];
        }
        y[i] /= m[i][i];
    }
    (0..n).map(|i| y[i] * scale[i]).collect()
}

/// (projected, raw) lambda of what the records hold beyond `plant`, and raw lambda of each record. Projected: what a linear
/// refit (gain, spring, damping, delay unless `hold_delay`, all modes if `modes`) and each record's own offset, torque and initial state leave over.
pub fn lambda(
    plant: &Plant,
    recs: &[Recorded],
    noise: Noise,
    ts: f64,
    hold_delay: bool,
    modes: bool,
) -> Option<(f64, f64, Vec<f64>)> {
    let free: Vec<usize> =
        (0..if modes { 4 + 4 * plant.modes.len() } else { 4 }).filter(|&i| i != 3 || !hold_delay).collect();
    let (mut best, raw, each, mut at) = pass(plant, recs, noise, ts, &free)?;
    // A far refit is not the tangent's: go there and look again.
    for _ in 0..2 {
        if raw < 5.0 * best {
            break;
        }
        let Some(next) = at.take().and_then(|p| pass(&p, recs, noise, ts, &free)) else { break };
        if next.0 < best {
            best = next.0;
            at = next.3;
        }
    }
    Some((best, raw, each))
}

type Pass = (f64, f64, Vec<f64>, Option<Plant>);

fn pass(plant: &Plant, recs: &[Recorded], noise: Noise, ts: f64, free: &[usize]) -> Option<Pass> {
    let count = free.len();
    let step = |which: usize| if which < 4 { 1e-3 } else { 1e-4 };
    let mut a = vec![vec![0.0; count]; count];
    let (mut b, mut raw, mut rest) = (vec![0.0; count], Vec::new(), 0.0);
    for rec in recs {
        let q = local(plant, rec.clean.len(), ts, noise);
        let base = replay(plant, rec, ts)?;
        let mut e: Vec<f64> = rec.clean.iter().zip(&base).map(|(a, b)| a - b).collect();
        whiten(&mut e, noise);
        project(&mut e, &q);
        let own = dot(&e, &e);
        raw.push(own);
        rest += own;
        let mut columns = Vec::new();
        for &i in free {
            let (p, step) = (moved(plant, i, step(i)), step(i));
            let mut c: Vec<f64> = replay(&p, rec, ts)?.iter().zip(&base).map(|(a, b)| (a - b) / step).collect();
            whiten(&mut c, noise);
            project(&mut c, &q);
            columns.push(c);
        }
        for i in 0..count {
            b[i] += dot(&columns[i], &e);
            for j in 0..count {
                a[i][j] += dot(&columns[i], &columns[j]);
            }
        }
    }
    let x = solve(&a, &b, 1e-9);
    let mut there = plant.clone();
    for (&i, x) in free.iter().zip(&x) {
        let most = if i >= 4 && (i - 4) % 4 < 2 { 0.05 } else { 0.6 };
        there = moved(&there, i, x.clamp(-most, most));
    }
    Some(((rest - dot(&x, &b)).max(0.0), rest, raw, (there.k >= 0.0 && there.delay > 0.0).then_some(there)))
}

/// The plant with one linear parameter moved by a relative step.
fn moved(plant: &Plant, which: usize, step: f64) -> Plant {
    let mut p = plant.clone();
    match which {
        0 => p.b *= 1.0 + step,
        1 => p.k += step * if p.k > 0.0 { p.k } else { 1e4 },
        2 => p.c *= 1.0 + step,
        3 => p.delay *= 1.0 + step,
        _ => {
            let m = &mut p.modes[(which - 4) / 4];
            match (which - 4) % 4 {
                0 => m.wp *= 1.0 + step,
                1 => m.wz *= 1.0 + step,
                2 => m.zp *= 1.0 + step,
                _ => m.zz *= 1.0 + step,
            }
        }
    }
    p
}

fn vary(plant: &Plant, theta: &[f64]) -> Plant {
    let mut p = plant.clone();
    p.b *= theta[0].exp();
    p.k *= theta[1].exp();
    p.c *= theta[2].exp();
    p.delay *= theta[3].exp();
    for (m, t) in p.modes.iter_mut().zip(theta[4..].chunks(4)) {
        m.wp *= t[0].exp();
        m.wz *= t[1].exp();
        m.zp *= t[2].exp();
        m.zz *= t[3].exp();
    }
    p
}

/// Linear model fitted to records by damped Gauss-Newton on the simulation error, with weak priors on the modes.
/// `rigid`: only the spring and the damping are fitted.
pub fn absorb(start: &Plant, recs: &[Recorded], noise: Noise, ts: f64, rounds: usize, rigid: bool) -> Option<Plant> {
    let n = 4 + 4 * start.modes.len();
    let prior: Vec<f64> = (0..n)
        .map(|i| {
            if i < 3 {
                1.0
            } else if i == 3 {
                0.3
            } else if (i - 4) % 4 < 2 {
                0.02
            } else {
                0.3
            }
        })
        .collect();
    let steps: Vec<f64> = (0..n).map(|i| if i < 4 || (i - 4) % 4 >= 2 { 1e-3 } else { 1e-4 }).collect();
    let residual = |theta: &[f64]| -> Option<Vec<f64>> {
        let p = vary(start, theta);
        let mut all = Vec::new();
        for rec in recs {
            let q = local(&p, rec.clean.len(), ts, noise);
            let y = replay(&p, rec, ts)?;
            let mut e: Vec<f64> = (0..y.len()).map(|i| rec.clean[i] + rec.noise[i] - y[i]).collect();
            whiten(&mut e, noise);
            project(&mut e, &q);
            all.extend(e);
        }
        all.extend(theta.iter().zip(&prior).map(|(t, s)| -t / s));
        Some(all)
    };
    let mut theta = vec![0.0; n];
    let mut e = residual(&theta)?;
    let mut damping = 1e-4;
    for _ in 0..rounds {
        let mut columns = Vec::with_capacity(n);
        for i in 0..n {
            if start.k == 0.0 && i == 1 || rigid && i != 1 && i != 2 {
                columns.push((0..e.len()).map(|j| if j == e.len() - n + i { 1.0 } else { 0.0 }).collect());
                continue;
            }
            let mut t = theta.clone();
            t[i] += steps[i];
            let f = residual(&t)?;
            columns.push(f.iter().zip(&e).map(|(a, b)| (b - a) / steps[i]).collect::<Vec<f64>>());
        }
        let a: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| dot(&columns[i], &columns[j])).collect()).collect();
        let g: Vec<f64> = columns.iter().map(|c| dot(c, &e)).collect();
        let now = dot(&e, &e);
        let mut better = false;
        for _ in 0..5 {
            let d = solve(&a, &g, damping);
            let t: Vec<f64> = theta.iter().zip(&d).map(|(t, d)| t + d.clamp(-0.3, 0.3)).collect();
            if let Some(f) = residual(&t).filter(|f| dot(f, f) < now) {
                better = dot(&f, &f) < now * (1.0 - 1e-4);
                (theta, e) = (t, f);
                damping = (damping / 10.0).max(1e-9);
                break;
            }
            damping *= 20.0;
        }
        if !better {
            break;
        }
    }
    Some(vary(start, &theta))
}
