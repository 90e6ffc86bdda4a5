//! The write over one box: figures of the middle by simulation, and how far any member's may lie above.
//!
//! A bin is the middle's plus, for each factor, a term of its own plus a rest: X = X(middle) - Σ_i F_i(box_i) ± R. Cut pairs give one F for
//! each piece; pieces of different pairs never meet, so their number adds and does not multiply.

use super::contour::{Contour, Task};
use super::cut::Cut;
use super::family::{Family, PAIRS, Ranges};
use super::moves::size;
use super::spectrum_box::{Beside, OnCircle};
use super::write::{Bands, bin, simulate};
use nalgebra::Complex;

/// What is asked of a write.
pub(super) struct Question<'a> {
    pub task: &'a Task<'a>,
    pub circle: &'a Contour,
    pub beside: &'a Beside,
    pub family: &'a Family,
    /// Bins on the circle.
    pub bins: &'a [usize],
    pub bands_hz: Bands,
    /// Groups of bins, by index: the norm over each is a figure.
    pub groups: &'a [Vec<usize>],
    /// Which figures the box is split for; the command's peak is the last.
    pub judged: &'a [bool],
    /// Bound of |S| over the box.
    pub ms: f64,
    /// What has turned round the circle and is in every sum: of a bin (unscaled) and of a command.
    pub turned: [f64; 2],
}

/// A box and its figures; the command's peak is the last.
pub(super) struct Piece {
    pub ranges: Ranges,
    /// Of the middle, simulated.
    pub middle: Vec<f64>,
    /// No member has more.
    pub most: Vec<f64>,
    /// For each figure which coordinate leaves the largest share of the rest.
    pub widest: Vec<usize>,
    /// For each figure a corner where it may be largest.
    pub corner: Vec<Vec<f64>>,
}

/// What a factor, or a piece of its range, adds to the bins: a middle, one vector a coordinate, and a rest.
struct Term {
    coordinates: Vec<usize>,
    /// Where the first coordinate's middle lies, and its half width, as shares of the whole half width.
    place: [f64; 2],
    middle: Vec<Complex<f64>>,
    along: Vec<Vec<Complex<f64>>>,
    rest: Vec<f64>,
}

fn dot(a: &[Complex<f64>], b: &[Complex<f64>]) -> Complex<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Sums of a series over both kernels of every bin.
fn sums(circle: &Contour, series: &[Complex<f64>]) -> Vec<Complex<f64>> {
    circle.kernels.iter().map(|[up, down]| dot(up, series) + dot(down, series).conj()).collect()
}

/// The middle of a box.
pub(super) fn middle(ranges: &Ranges) -> Vec<f64> {
    ranges.iter().map(|r| 0.5 * (r.low + r.high)).collect()
}

/// Terms of a cut pair, one a piece; `far` are the sums of its linear parts away from the near points.
fn pieces(q: &Question<'_>, on: &OnCircle, c: &Cut, far: &[Vec<Complex<f64>>; 3]) -> Vec<Term> {
    let count = c.pieces.len() as f64;
    let first = PAIRS + 3 * c.pair;
    let near_sums = |series: &[Complex<f64>]| -> Vec<Complex<f64>> {
        let over = |k: &[Complex<f64>]| c.near.iter().zip(series).map(|(i, x)| k[*i] * x).sum::<Complex<f64>>();
        q.circle.kernels.iter().map(|[up, down]| over(up) + over(down).conj()).collect()
    };
    c.pieces
        .iter()
        .map(|p| {
            let series = |f: &dyn Fn(usize) -> Complex<f64>| -> Vec<Complex<f64>> {
                near_sums(&c.near.iter().enumerate().map(|(slot, i)| on.series[*i] * f(slot)).collect::<Vec<_>>())
            };
            let mut middle = series(&|slot| p.at[slot].0 - 1.0);
            for (m, f) in middle.iter_mut().zip(&far[0]) {
                *m += f * p.middle;
            }
            let along = (0..3)
                .map(|k| {
                    let mut own = series(&|slot| p.at[slot].0 * p.at[slot].1.linear[k]);
                    let share = if k == 0 { 1.0 / count } else { 1.0 };
                    for (o, f) in own.iter_mut().zip(&far[k]) {
                        *o += f * share;
                    }
                    own
                })
                .collect();
            let weights: Vec<f64> =
                (c.near.iter().zip(&p.at)).map(|(i, (at, m))| on.series[*i].norm() * at.norm() * m.rest).collect();
            let over = |k: &Vec<f64>| c.near.iter().zip(&weights).map(|(i, w)| k[*i] * w).sum::<f64>();
            let rest = q.circle.sizes.iter().map(over).collect();
            let place = [p.middle, 1.0 / count];
            Term { coordinates: vec![first, first + 1, first + 2], place, middle, along, rest }
        })
        .collect()
}

/// Every factor's terms: one, or one a piece.
fn terms(q: &Question<'_>, on: &OnCircle) -> Vec<Vec<Term>> {
    let zero = Complex::new(0.0, 0.0);
    let bins = q.bins.len();
    let mut all = Vec::new();
    let along = |j: usize, left_out: &[usize]| -> Vec<Complex<f64>> {
        let mut series: Vec<Complex<f64>> = on.series.iter().zip(&on.linear[j]).map(|(a, b)| a * b).collect();
        left_out.iter().for_each(|i| series[*i] = zero);
        if series.iter().all(|x| *x == zero) { vec![zero; bins] } else { sums(q.circle, &series) }
    };
    for c in &on.cuts {
        let far = [0, 1, 2].map(|k| along(PAIRS + 3 * c.pair + k, &c.near));
        all.push(pieces(q, on, c, &far));
    }
    for (pair, factor) in &on.second {
        let series: Vec<Complex<f64>> = on.series.iter().zip(factor).map(|(a, b)| a * b).collect();
        let whole = sums(q.circle, &series);
        // A square lies between 0 and 1, a product between -1 and 1.
        let (from, part) = if pair[0] == pair[1] { (0.5, 0.5) } else { (0.0, 1.0) };
        let middle = whole.iter().map(|x| x * from).collect();
        let along = vec![whole.iter().map(|x| x * part).collect()];
        all.push(vec![Term { coordinates: vec![], place: [0.0, 1.0], middle, along, rest: vec![0.0; bins] }]);
    }
    for j in 0..on.linear.len() {
        if j >= PAIRS && on.cuts.iter().any(|c| c.pair == (j - PAIRS) / 3) {
            continue;
        }
        let middle = vec![zero; bins];
        let (place, along) = ([0.0, 1.0], vec![along(j, &[])]);
        all.push(vec![Term { coordinates: vec![j], place, middle, along, rest: vec![0.0; bins] }]);
    }
    all
}

impl Piece {
    /// Judges one box. None where the middle itself clips its command: the loop is linear no more.
    pub fn of(q: &Question<'_>, ranges: Ranges) -> Option<Piece> {
        let at = middle(&ranges);
        let family = q.family.about(&at);
        let record = simulate(&q.family.member(&at), q.task.entering.sections, q.task.c, q.task.profile);
        let limit = q.task.c.output_limit.unwrap_or(f64::INFINITY);
        if record.command.iter().any(|u| u.abs() >= limit) {
            return None;
        }
        let n = record.window.len() as f64;
        let on = OnCircle::of(q.circle, q.beside, &family, &ranges, q.ms);
        let terms = terms(q, &on);
        let nominal: Vec<Complex<f64>> = q.bins.iter().map(|k| bin(&record.window, *k)).collect();
        let weigh = |k: &[f64], w: &[f64]| k.iter().zip(w).map(|(k, w)| k * w).sum::<f64>();
        let rest: Vec<f64> = (q.circle.sizes.iter().zip(&q.beside.heard))
            .map(|(k, [all, moves])| {
                weigh(k, &on.rest) + weigh(all, &on.aside[0]) + weigh(moves, &on.aside[1]) + q.turned[0]
            })
            .collect();
        let linear: Vec<Vec<f64>> = on.linear.iter().map(|l| l.iter().map(|x| size(*x)).collect()).collect();
        let mut piece = Piece { ranges, middle: vec![], most: vec![], widest: vec![], corner: vec![] };
        for (group, judged) in q.groups.iter().zip(q.judged) {
            let norm = |x: &dyn Fn(usize) -> f64| group.iter().map(|b| x(*b).powi(2)).sum::<f64>().sqrt();
            let own = norm(&|b| nominal[b].norm());
            let along = |x: &[Complex<f64>]| group.iter().map(|b| (nominal[*b].conj() * x[*b]).re).sum::<f64>();
            let long = |x: &[Complex<f64>]| norm(&|b| x[b].norm());
            let mut corner = at.clone();
            // The PES falls where the position rises: every term is taken away.
            let (mut lean, mut length, mut rests) = (0.0, 0.0, vec![0.0; q.bins.len()]);
            // Sizes bin by bin: modes far from each other do not meet in one.
            let mut sizes = vec![0.0; q.bins.len()];
            for factor in &terms {
                let mut worst = f64::NEG_INFINITY;
                let mut reach = 0.0f64;
                for t in factor {
                    let toward = -along(&t.middle) + t.along.iter().map(|x| along(x).abs()).sum::<f64>();
                    reach = reach.max(long(&t.middle) + t.along.iter().map(|x| long(x)).sum::<f64>());
                    if toward > worst {
                        worst = toward;
                        for (j, x) in t.coordinates.iter().zip(&t.along) {
                            let half = 0.5 * piece.ranges[*j].width();
                            let turned = along(x);
                            let [from, part] = if *j == t.coordinates[0] { t.place } else { [0.0, 1.0] };
                            corner[*j] = at[*j] + half * (from - part * turned.signum());
                        }
                    }
                }
                for b in group {
                    rests[*b] += factor.iter().map(|t| t.rest[*b]).fold(0.0, f64::max);
                    let of = |t: &Term| size(t.middle[*b]) + t.along.iter().map(|x| size(x[*b])).sum::<f64>();
                    sizes[*b] += factor.iter().map(of).fold(0.0, f64::max);
                }
                (lean, length) = (lean + worst, length + reach);
            }
            let length = length.min(norm(&|b| sizes[b]));
            let straight = (own * own + 2.0 * lean + length * length).max(0.0).sqrt().min(own + length);
            let most = straight + norm(&|b| rests[b] + rest[b]);
            piece.middle.push(own / n);
            piece.most.push(most / n);
            piece.corner.push(corner);
            if !judged {
                piece.widest.push(0);
                continue;
            }
            piece
                .widest
                .push(widest(&linear, &|i| group.iter().map(|b| q.circle.sizes[*b][i]).sum::<f64>() * on.rest[i]));
        }
        piece.command(q, &on, &linear, &record.command, &at);
        Some(piece)
    }

    /// The command's peak.
    fn command(&mut self, q: &Question<'_>, on: &OnCircle, sizes: &[Vec<f64>], command: &[f64], at: &[f64]) {
        let swell = |k: usize| (q.circle.right * q.circle.t * k as f64).exp();
        let along: Vec<Option<Vec<f64>>> = on
            .linear
            .iter()
            .map(|linear| {
                let series: Vec<Complex<f64>> = on.command.iter().zip(linear).map(|(a, b)| a * b).collect();
                if series.iter().all(|x| x.norm_sqr() == 0.0) {
                    return None;
                }
                Some(q.circle.samples(&series, command.len()))
            })
            .collect();
        let rest = 2.0 * on.command_rest.iter().sum::<f64>();
        let (mut most, mut peak, mut corner) = (0.0f64, 0.0f64, at.to_vec());
        for (k, u) in command.iter().enumerate() {
            peak = peak.max(u.abs());
            let moved: f64 = along.iter().flatten().map(|x| x[k].abs()).sum();
            let here = u.abs() + moved + rest * swell(k) + q.turned[1];
            if here > most {
                most = here;
                for (j, x) in along.iter().enumerate() {
                    let sign = x.as_ref().map_or(0.0, |x| (x[k] * u).signum());
                    corner[j] = at[j] + 0.5 * sign * self.ranges[j].width();
                }
            }
        }
        self.middle.push(peak);
        self.most.push(most);
        self.corner.push(corner);
        self.widest.push(widest(sizes, &|i| on.command_rest[i]));
    }
}

/// The coordinate whose linear part holds the largest share of the weight.
pub(super) fn widest(linear: &[Vec<f64>], weight: &dyn Fn(usize) -> f64) -> usize {
    let weights: Vec<f64> = (0..linear[0].len()).map(weight).collect();
    let all: Vec<f64> = linear.iter().map(|l| l.iter().zip(&weights).map(|(l, w)| l * w).sum()).collect();
    (0..all.len()).max_by(|a, b| all[*a].total_cmp(&all[*b])).unwrap_or_default()
}
