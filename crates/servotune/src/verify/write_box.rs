//! The write over a whole box of parameters: DFT norms, harmonics and the command's peak of every member, by branch and bound.
//!
//! In: the plant, its box, the write, and the loop's proven Ms over the box. Out: for each figure what no member exceeds, and the largest that a
//! simulated member shows; or why there is none. The mathematics: `specs/certificate.md`.

use super::Uncertainty;
use super::contour::{Contour, Task};
use super::family::{Family, Ranges};
use super::spectrum_box::Beside;
use super::write::{Bands, bands, of_window, simulate};
use super::write_piece::{Piece, Question};
use crate::controller::Controller;
use crate::lti::{Plant, Section};
use crate::pes::Profile;
use serde::{Deserialize, Serialize};

/// One figure over the box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxFigure {
    /// No member of the box has more (unit of the figure).
    pub most: f64,
    /// The largest of the members that were simulated.
    pub seen: f64,
}

/// One harmonic over the box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxHarmonic {
    /// Number, from 1.
    pub k: usize,
    /// |X_k|/N (position_unit).
    pub most: f64,
    /// The largest simulated.
    pub seen: f64,
}

/// Why a box has no figures of its write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WriteOpen {
    /// The box is not proved stable.
    NotProvedStable,
    /// A member may clip its command at `output_limit`.
    MayClip,
    /// A pair of the plant's poles does not decay.
    NoDecay,
    /// The plant falls with less than 1/s².
    ShallowRollOff,
    /// The record is too long for the circles that the proof has.
    TooLong,
}

/// The write over the box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WriteBox {
    /// Why nothing is proved; then the rest is absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub open: Option<WriteOpen>,
    /// Norm over the first band (position_unit).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dft_low: Option<BoxFigure>,
    /// Norm over the second band (position_unit).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dft_high: Option<BoxFigure>,
    /// Bins of both bands, and those that are asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub harmonics: Vec<BoxHarmonic>,
    /// Largest |command| (command_unit).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_peak: Option<BoxFigure>,
    /// Boxes that the proof looked at.
    #[serde(default)]
    pub boxes: usize,
}

impl WriteBox {
    /// Harmonic `k`, where it was bounded.
    pub fn harmonic(&self, k: usize) -> Option<BoxFigure> {
        self.harmonics.iter().find(|h| h.k == k).map(|h| BoxFigure { most: h.most, seen: h.seen })
    }

    fn open(why: WriteOpen) -> WriteBox {
        WriteBox { open: Some(why), dft_low: None, dft_high: None, harmonics: vec![], command_peak: None, boxes: 0 }
    }
}

/// The loop over which the write is to be bounded.
#[derive(Clone, Copy, Debug)]
pub struct BoxedLoop<'a> {
    /// The plant as it stands.
    pub plant: &'a Plant,
    /// Sections of the law.
    pub sections: &'a [Section],
    /// Sample time, feed-forward and output limit.
    pub controller: &'a Controller,
    /// The write.
    pub profile: &'a Profile,
    /// First and second band of the DFT norms (Hz).
    pub bands_hz: Bands,
    /// The box.
    pub uncertainty: &'a Uncertainty,
    /// |S| of no member is above this anywhere; none where the box is not proved stable.
    pub max_sensitivity: Option<f64>,
}

/// Told after each box: how many, and how many at most.
pub type BoxWatch<'a> = dyn Fn(usize, usize) + Sync + 'a;

/// How far the proof goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxSettings {
    /// A figure is tight enough at this ratio of bound to largest seen.
    pub ratio: f64,
    /// Boxes looked at, at most.
    pub boxes: usize,
}

impl Default for BoxSettings {
    /// 5 % and 48 boxes.
    fn default() -> Self {
        BoxSettings { ratio: 1.05, boxes: 48 }
    }
}

/// Share of the travel, and of the nominal peak, that may have turned round the circle.
const TURNED: f64 = 1e-9;

/// Bounds the write over the box; `harmonics` are further bins that are asked for.
///
/// `watch` is told how many boxes of how many at most have been looked at.
pub fn bound_write(l: &BoxedLoop<'_>, harmonics: &[usize], settings: &BoxSettings, watch: &BoxWatch<'_>) -> WriteBox {
    let Some(ms) = l.max_sensitivity else { return WriteBox::open(WriteOpen::NotProvedStable) };
    let plant = &l.plant.paired();
    let family = Family::of(plant, l.controller.sample_time_s);
    if !family.decays() {
        return WriteBox::open(WriteOpen::NoDecay);
    }
    if family.falls() < 2 {
        return WriteBox::open(WriteOpen::ShallowRollOff);
    }
    let ranges = family.ranges(l.uncertainty);
    let task = Task::of(l.controller, l.sections, l.profile);
    let [first, last] = task.clock.window;
    let (n, rate) = (last - first, l.profile.pes.sample_rate_hz);
    let groups = bands(&l.bands_hz, n, rate);
    let mut bins: Vec<usize> = groups.iter().flatten().chain(harmonics).copied().collect();
    bins.sort_unstable();
    bins.dedup();
    bins.retain(|k| (1..=n / 2).contains(k));
    let place = |k: &usize| bins.iter().position(|b| b == k).unwrap_or_default();
    let mut indices: Vec<Vec<usize>> = groups.iter().map(|g| g.iter().map(place).collect()).collect();
    indices.extend((0..bins.len()).map(|i| vec![i]));
    // Both bands, the harmonics asked for and the peak decide when it is enough.
    let mut judged: Vec<bool> = vec![true, true];
    judged.extend(bins.iter().map(|k| harmonics.contains(k)));
    judged.push(true);
    let [window_enough, command_enough] = {
        let nominal = simulate(plant, l.sections, l.controller, l.profile);
        let peak = nominal.command.iter().fold(0.0f64, |m, u| m.max(u.abs()));
        [TURNED * l.profile.spiral.distance * n as f64, TURNED * peak]
    };
    let window = task.window();
    let end = task.clock.ticks as f64 * task.c.sample_time_s;
    let last_instant = window.instants().last().unwrap_or_default();
    // Of two members: each |S| is at most Ms, by the maximum principle outside the unit circle too.
    let rough = |right: f64| {
        let entered = 2.0 * ms * task.entering.most(right);
        let kernels: f64 = window.instants().map(|at| (right * at).exp()).sum();
        [entered * kernels * family.roughly(right, &ranges), entered * (right * end).exp()]
    };
    let enough = [window_enough, command_enough];
    let Some((points, right)) = Contour::wrapped(task.c.sample_time_s, last_instant, &rough, enough) else {
        return WriteBox::open(WriteOpen::TooLong);
    };
    let circle = Contour::of(&task.entering, &window, points, right, &bins);
    let beside = Beside::of(&circle, &window, &bins, &family, &ranges);
    let question = Question {
        task: &task,
        circle: &circle,
        beside: &beside,
        family: &family,
        bins: &bins,
        bands_hz: l.bands_hz,
        groups: &indices,
        judged: &judged,
        ms,
        turned: enough,
    };
    branch(&question, ranges, settings, watch).map_or_else(
        || WriteBox::open(WriteOpen::MayClip),
        |(most, seen, boxes)| {
            let limit = l.controller.output_limit.unwrap_or(f64::INFINITY);
            let peak = most.len() - 1;
            if most[peak] >= limit {
                return WriteBox { boxes, ..WriteBox::open(WriteOpen::MayClip) };
            }
            let figure = |i: usize| Some(BoxFigure { most: most[i], seen: seen[i] });
            let harmonics =
                bins.iter().enumerate().map(|(i, k)| BoxHarmonic { k: *k, most: most[2 + i], seen: seen[2 + i] });
            WriteBox {
                open: None,
                dft_low: figure(0),
                dft_high: figure(1),
                harmonics: harmonics.collect(),
                command_peak: figure(peak),
                boxes,
            }
        },
    )
}

/// Splits the box that is worst for the loosest figure until every judged one is tight enough. Bounds, largest seen, boxes.
fn branch(
    q: &Question<'_>,
    ranges: Ranges,
    settings: &BoxSettings,
    watch: &BoxWatch<'_>,
) -> Option<(Vec<f64>, Vec<f64>, usize)> {
    let root = Piece::of(q, ranges)?;
    let mut seen = root.middle.clone();
    for corner in &root.corner {
        look(q, corner, &mut seen);
    }
    let (mut boxes, mut leaves) = (1, vec![root]);
    loop {
        let top = |i: usize| {
            (0..leaves.len()).max_by(|a, b| leaves[*a].most[i].total_cmp(&leaves[*b].most[i])).unwrap_or_default()
        };
        let loosest = (0..q.judged.len())
            .filter(|i| q.judged[*i])
            .map(|i| (i, top(i), leaves[top(i)].most[i] / seen[i]))
            .max_by(|a, b| a.2.total_cmp(&b.2))?;
        let (figure, leaf, ratio) = loosest;
        let width = |p: &Piece| p.ranges.iter().any(|r| r.width() > 0.0);
        if ratio <= settings.ratio || boxes + 2 > settings.boxes || !width(&leaves[leaf]) {
            let most = (0..q.judged.len()).map(|i| leaves[top(i)].most[i].max(seen[i])).collect();
            return Some((most, seen, boxes));
        }
        watch(boxes, settings.boxes);
        let parent = leaves.swap_remove(leaf);
        let along = parent.widest[figure];
        let cut = 0.5 * (parent.ranges[along].low + parent.ranges[along].high);
        for high in [false, true] {
            let mut ranges = parent.ranges.clone();
            if high {
                ranges[along].low = cut;
            } else {
                ranges[along].high = cut;
            }
            let mut child = Piece::of(q, ranges)?;
            for (i, m) in child.most.iter_mut().enumerate() {
                *m = m.min(parent.most[i]);
                seen[i] = seen[i].max(child.middle[i]);
            }
            look(q, &child.corner[figure], &mut seen);
            leaves.push(child);
        }
        boxes += 2;
    }
}

/// Simulates one member and keeps what it shows.
fn look(q: &Question<'_>, at: &[f64], seen: &mut [f64]) {
    let record = simulate(&q.family.member(at), q.task.entering.sections, q.task.c, q.task.profile);
    let peak = record.command.iter().fold(0.0f64, |m, u| m.max(u.abs()));
    let w = of_window(&record.window, q.task.profile.pes.sample_rate_hz, &q.bands_hz, peak, 0.0);
    let figures = [w.dft_low, w.dft_high].into_iter().chain(q.bins.iter().map(|k| w.harmonics[k - 1])).chain([peak]);
    for (s, x) in seen.iter_mut().zip(figures) {
        *s = s.max(x);
    }
}
