//! What a box does at every point of the circle: each factor's linear part and rest, and what a loop closed around them leaves.
//!
//! In: a box about its middle, the circle. Out: for each point the series that the linear parts are summed with and the weight of everything that is not
//! linear. The mathematics stands in `specs/certificate.md`.

use super::Interval;
use super::contour::{Contour, Window};
use super::core_moves::{Bend, Core, Sum};
use super::cut::{Cut, cut};
use super::family::{DELAY, Family, GAIN, PAIRS, share};
use super::moves::{Shares, size as modulus};
use nalgebra::Complex;

/// Aliases beside the first, bounded over a box at every point.
pub(super) struct Beside {
    /// Bound of how far the sums of two members lie apart.
    apart: Vec<f64>,
    /// Their sum's linear part along each coordinate at its half width, and what is not linear.
    linear: Vec<Vec<Complex<f64>>>,
    bent: Vec<f64>,
    /// For each bin the same two, each alias weighed with the sizes of its own two kernels.
    pub heard: Vec<[Vec<f64>; 2]>,
    /// Aliases summed one by one on each side.
    whole: i64,
    /// Bound of those beyond.
    far: f64,
}

/// Aliases taken one by one beyond those that the modes ask for: each has its own kernel, those beyond only the largest.
const NEARBY: i64 = 2;
/// Aliases whose sizes are added one by one.
const LISTED: i64 = 200;

/// (1 - 1/z)/(s T), with the alias k of s.
fn hold(x: &Contour, i: usize, k: i64) -> (Complex<f64>, Complex<f64>) {
    let s = x.s[i] + Complex::new(0.0, std::f64::consts::TAU * k as f64 / x.t);
    (s, (1.0 - (x.s[i] * -x.t).exp()) / (s * x.t))
}

impl Beside {
    pub fn of(x: &Contour, window: &Window, bins: &[usize], family: &Family, ranges: &[Interval]) -> Beside {
        let whole = family.whole() + NEARBY;
        // Linear part of an alias's move along each coordinate, and the sizes of all of it.
        let moved = |s: Complex<f64>, linear: &mut [Complex<f64>]| {
            let mut all = Sum::default();
            linear[GAIN] = share(&ranges[GAIN]).into();
            all.add(share(&ranges[GAIN]), 0.0);
            linear[DELAY] = s * -(family.delay_s() * share(&ranges[DELAY]));
            // |e^x - 1| <= e^|x| - 1, and neither |e^-s delay| is above 1.
            let late = modulus(linear[DELAY]);
            all.add(late.exp_m1().min(2.0 + late), (late.exp_m1() - late).min(2.0 + late));
            for (j, p) in family.pairs.iter().enumerate() {
                let shares = Family::shares(ranges, j);
                let m = p.moved(s, shares, p.reach(s, shares));
                linear[PAIRS + 3 * j..][..3].copy_from_slice(&m.linear);
                all.add(m.most, m.rest);
            }
            all
        };
        // Beyond the last one summed one by one: sizes by the asymptote, moves by the pairs' at the nearest and the dead time's at each.
        let w = std::f64::consts::TAU * (whole as f64 + 0.5) / x.t;
        let pairs = family.pairs.iter().enumerate().map(|(j, p)| 1.0 + p.far(w, Family::shares(ranges, j)));
        let still = (1.0 + share(&ranges[GAIN])) * pairs.product::<f64>();
        let late = family.delay_s() * share(&ranges[DELAY]);
        let last = whole + LISTED;
        let mut far = family.far(last, ranges);
        let mut far_moves = 2.0 * far;
        for k in whole + 1..=last {
            let one = 2.0 * family.alias(k, ranges);
            let turned = ((x.right + std::f64::consts::TAU * (k as f64 + 0.5) / x.t) * late).exp_m1().min(2.0);
            far += one;
            far_moves += one * (still * (1.0 + turned) - 1.0).min(2.0);
        }
        let n = x.s.len();
        let (mut apart, mut bent) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let mut linear = vec![vec![Complex::new(0.0, 0.0); n]; ranges.len()];
        let mut along = vec![Complex::new(0.0, 0.0); ranges.len()];
        let mut heard = vec![[Vec::with_capacity(n), Vec::with_capacity(n)]; bins.len()];
        for i in 0..n {
            let held = modulus(1.0 - (x.s[i] * -x.t).exp());
            let mut moves = far_moves * held;
            let mut beyond = moves;
            let loudest = 2.0 * held * x.kernel_most;
            let mut own = vec![[far * loudest, far_moves * loudest]; bins.len()];
            for k in (1..=whole).flat_map(|k| [k, -k]) {
                let (s, hold) = hold(x, i, k);
                let (value, sizes) = (hold * family.value(s), moved(s, &mut along));
                for (all, one) in linear.iter_mut().zip(&along) {
                    all[i] += value * one;
                }
                let (p, m) = (modulus(value), sizes.most());
                beyond += p * sizes.beyond();
                let (p, a) = (p * (1.0 + m), 2.0 * p * m);
                moves += a;
                for (own, bin) in own.iter_mut().zip(bins) {
                    let bin = *bin as f64;
                    let kernel = modulus(window.kernel(s, bin)) + modulus(window.kernel(s, -bin));
                    (own[0], own[1]) = (own[0] + p * kernel, own[1] + a * kernel);
                }
            }
            apart.push(moves);
            bent.push(beyond);
            for (heard, own) in heard.iter_mut().zip(own) {
                heard[0].push(own[0]);
                heard[1].push(own[1]);
            }
        }
        Beside { apart, linear, bent, heard, whole, far }
    }
}

/// The box on the circle.
pub(super) struct OnCircle {
    /// For each coordinate the linear part of its factor at its half width.
    pub linear: Vec<Vec<Complex<f64>>>,
    /// What a linear part at the points is multiplied with before the sums over the kernels: P V S, about.
    pub series: Vec<Complex<f64>>,
    /// Of the series, what the second order adds for each pair of core coordinates.
    pub second: Vec<([usize; 2], Vec<Complex<f64>>)>,
    /// The same as the series for the command: -P V S C.
    pub command: Vec<Complex<f64>>,
    /// For each coordinate what the other aliases' linear parts add to the command.
    pub command_linear: Vec<Vec<Complex<f64>>>,
    /// Weight of the kernels' sizes for what is not linear, the near points of cut pairs aside.
    pub rest: Vec<f64>,
    /// The same for the command, with every pair taken as one piece.
    pub command_rest: Vec<f64>,
    /// For the command, what is left beyond the second order; of no use where a pair is cut.
    pub command_third: Vec<f64>,
    /// Weight of what each bin hears of the other aliases, and of what it hears of their moves.
    pub aside: [Vec<f64>; 2],
    pub cuts: Vec<Cut>,
}

/// Largest move of each cut pair at its near points, over its pieces; infinite at the others.
fn near_moves(cuts: &[Cut], pairs: usize, n: usize) -> Vec<Vec<f64>> {
    let mut near: Vec<Vec<f64>> = vec![Vec::new(); pairs];
    for c in cuts {
        let mut most = vec![f64::INFINITY; n];
        for (slot, i) in c.near.iter().enumerate() {
            let over = c.pieces.iter().map(|p| (p.at[slot].0 - 1.0).norm() + p.at[slot].0.norm() * p.at[slot].1.most);
            most[*i] = over.fold(0.0, f64::max);
        }
        near[c.pair] = most;
    }
    near
}

impl OnCircle {
    fn with_room(n: usize, coordinates: usize, core: &Core, cuts: Vec<Cut>) -> OnCircle {
        OnCircle {
            linear: vec![vec![Complex::new(0.0, 0.0); n]; coordinates],
            series: Vec::with_capacity(n),
            second: core.pairs().into_iter().map(|p| (p, Vec::with_capacity(n))).collect(),
            command: Vec::with_capacity(n),
            command_linear: vec![Vec::with_capacity(n); coordinates],
            rest: Vec::with_capacity(n),
            command_rest: Vec::with_capacity(n),
            command_third: Vec::with_capacity(n),
            aside: [Vec::with_capacity(n), Vec::with_capacity(n)],
            cuts,
        }
    }

    /// The linear parts of all factors at point i. Sizes, linear ones and rests of those outside the core, with near points in pieces; and of all,
    /// each taken whole.
    fn factors(
        &mut self,
        i: usize,
        s: Complex<f64>,
        core: &Core,
        family: &Family,
        shares: &[Shares],
        near: &[Vec<f64>],
    ) -> (Bend, Sum, Sum) {
        let bent = core.at(s);
        let (mut aside, mut whole) = (Sum::default(), Sum::default());
        for (j, (coordinate, linear)) in bent.linear.iter().enumerate() {
            self.linear[*coordinate][i] = *linear;
            whole.add(modulus(*linear) + bent.own[j], bent.own[j]);
        }
        for (j, p) in family.pairs.iter().enumerate() {
            if core.body == Some(j) {
                continue;
            }
            let m = p.moved(s, shares[j], p.reach(s, shares[j]));
            for k in 0..3 {
                self.linear[PAIRS + 3 * j + k][i] = m.linear[k];
            }
            whole.add(m.most, m.rest);
            match near[j].get(i) {
                // What the pieces leave is added with them.
                Some(most) if most.is_finite() => aside.add(*most, 0.0),
                _ => aside.add(m.most, m.rest),
            }
        }
        (bent, aside, whole)
    }

    /// `family` is the one about the middle of `ranges`; no member's |S| is above `ms` anywhere outside the unit circle.
    pub fn of(x: &Contour, beside: &Beside, family: &Family, ranges: &[Interval], ms: f64) -> OnCircle {
        let n = x.s.len();
        let shares: Vec<Shares> = (0..family.pairs.len()).map(|i| Family::shares(ranges, i)).collect();
        let cuts: Vec<Cut> = family.pairs.iter().enumerate().filter_map(|(j, p)| cut(x, p, shares[j], j)).collect();
        let near = near_moves(&cuts, family.pairs.len(), n);
        let core = Core::of(family, ranges, &cuts);
        let mut all = OnCircle::with_room(n, ranges.len(), &core, cuts);
        for i in 0..n {
            let s = x.s[i];
            let one = hold(x, i, 0).1 * family.value(s);
            let aliases: Complex<f64> = (1..=beside.whole)
                .flat_map(|k| [k, -k])
                .map(|k| {
                    let (s, hold) = hold(x, i, k);
                    hold * family.value(s)
                })
                .sum();
            let law = x.law[i];
            let sensitivity = 1.0 / (1.0 + law * (one + aliases));
            let closed = modulus(law * sensitivity);
            let entered = sensitivity * x.inputs[i];
            let (bent, aside, whole) = all.factors(i, s, &core, family, &shares, &near);
            let apart = beside.apart[i];
            // S is known but for the far aliases.
            let blurred = 2.0 * closed * beside.far * (1.0 - (s * -x.t).exp()).norm();
            let about = 1.0 - one * law * sensitivity;
            let ends = if i == 0 || i == n - 1 { 0.5 } else { 1.0 };
            let scale = modulus(entered) * (1.0 + 2.0 * blurred) / x.points as f64 * ends;
            // The loop round a move of this size: what it comes to beyond the first order, and beyond the second.
            let again = |most: f64| {
                let ratio = closed * (modulus(one) * most + apart);
                let over = if ratio < 1.0 { 1.0 / (1.0 - ratio) } else { f64::INFINITY };
                let over = over.min(ms / modulus(sensitivity));
                (ratio, ratio * over)
            };
            let turn = one * law * sensitivity;
            for ((pair, into), own) in all.second.iter_mut().zip(bent.second(turn)) {
                debug_assert!(pair[0] <= pair[1]);
                into.push(own);
            }
            // (1 + core)(1 + aside) - 1, squared in the loop: kept are the core's first and second order and what is linear aside.
            let (core_most, aside_most) = (bent.most, aside.most());
            let most = (1.0 + core_most) * (1.0 + aside_most) - 1.0;
            let (ratio, round) = again(most);
            let squared = (bent.bend + bent.third + aside_most * (1.0 + core_most)) * (most + bent.straight);
            let rest = bent.third + aside.beyond() + core_most * aside_most;
            let rest = rest + modulus(turn) * squared + closed * apart * most + most * ratio * round;
            let plain = round;
            let loose = blurred * most * (modulus(about) + modulus(one) * closed);
            all.rest.push(scale * modulus(one) * (modulus(about) * rest + loose));
            // The aliases' moves reach the first kernel too, through the loop.
            let echo = scale * (1.0 + plain) * apart * closed * modulus(one);
            if let Some(rest) = all.rest.last_mut() {
                *rest += echo;
            }
            all.aside[0].push(scale * (1.0 + plain) * (modulus(one) * most + apart) * closed);
            all.aside[1].push(scale * (1.0 + plain));
            let moved = closed * modulus(one);
            all.command_third
                .push(scale * (moved * (rest + 2.0 * blurred * most) + closed * (beside.bent[i] + apart * plain)));
            let (most, rest) = (whole.most(), whole.beyond());
            let (_, round) = again(most);
            let loose = moved * (rest + 2.0 * blurred * most) + closed * apart;
            all.command_rest.push(scale * (loose + round * (moved * most + closed * apart)));
            let signed = entered / x.points as f64 * ends;
            all.series.push(signed * one * about);
            all.command.push(-signed * one * law * sensitivity);
            for (into, aliases) in all.command_linear.iter_mut().zip(&beside.linear) {
                into.push(-signed * law * sensitivity * aliases[i]);
            }
        }
        all
    }
}
