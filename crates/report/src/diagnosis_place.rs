//! Where the linear model fails: its whitened error by record and time, by place and direction.
//!
//! In: the ground of a diagnosis. Out: figures. Convention: errors in units of the noise, so that 1 is noise alone and windows and
//! records compare; what any linear model with other numbers would explain is taken out first. Spec: `specs/mismatch.md`.

use super::ReportError;
use super::diagnosis_law::{added, own};
use super::diagnosis_shown::{Shown, words};
use super::figure::{Axis, Figure, Ink, Kind, Mark, Panel, Region, Series};
use servotune::diagnose::Finding;
use servotune::lti::{DiscretePlant, PlantState};
use servotune::numeric::statistics::rms;
use servotune::physics::Entry;

/// Windows of a record, as where the findings are located.
const WINDOWS: usize = 48;
/// Zones of the stroke.
const ZONES: usize = 16;
/// Records drawn, strongest first; the others stand in the table of records.
const RECORDS: usize = 5;

/// The whitened error of the linear refit, stretch by stretch.
pub(super) struct Map {
    /// One for each segment of the stack.
    errors: Vec<Vec<f64>>,
    /// Segments, those with most error first.
    order: Vec<usize>,
}

impl Map {
    /// The error that a refit of the linear plant leaves.
    pub fn of(s: &Shown) -> Map {
        let data = &s.made.data;
        let fit = data.fit(Vec::new());
        let (error, _) = fit.screen_basis(&s.made.selection.baseline.refitted.p);
        let errors: Vec<Vec<f64>> =
            data.stack.segments.iter().map(|g| error[g.start..g.start + g.len].to_vec()).collect();
        let mean: Vec<f64> = errors.iter().map(|e| rms(e)).collect();
        let mut order: Vec<usize> = (0..errors.len()).collect();
        order.sort_by(|&a, &b| mean[b].total_cmp(&mean[a]));
        Map { errors, order }
    }
}

/// The segment that shows a finding most, which its intervals of time belong to: by what its law adds to the position, whitened;
/// by the error itself where there is no law.
fn strongest(s: &Shown, map: &Map, f: &Finding) -> Option<usize> {
    let data = &s.made.data;
    let chosen = &s.made.selection.model.chosen;
    let Some(c) = chosen.iter().find(|c| f.family.iter().any(|n| n == c.setting.facts().name)) else {
        return map.order.first().copied();
    };
    let sampled = DiscretePlant::of(&data.scene.plant, s.sample_time_s()).ok()?;
    let mut signal = data.stack.series(|i| {
        let mut y = added(&c.setting.law, own(c, i), &data.scene, &data.trajectories[i]);
        if c.setting.facts().entry != Entry::Position {
            let mut state = PlantState::at_rest(&sampled);
            for v in &mut y {
                let u = std::mem::replace(v, state.position());
                state.command(u);
                state.advance(&sampled);
            }
        }
        data.whitener.apply(&mut y);
        y
    });
    data.fit(Vec::new()).local_basis().project(&mut signal);
    let energy = |g: usize| {
        let part = &data.stack.segments[g];
        signal[part.start..part.start + part.len].iter().map(|v| v * v).sum::<f64>()
    };
    (0..data.stack.segments.len()).max_by(|&a, &b| energy(a).total_cmp(&energy(b)))
}

/// Name of a segment: its record, and how many repeats stand together.
fn name(s: &Shown, segment: usize) -> String {
    let runs = &s.made.data.stack.segments[segment].runs;
    let first = &s.made.data.runs[runs[0]].name;
    if runs.len() > 1 { format!("{first}, mean of {} repeats", runs.len()) } else { first.clone() }
}

/// Error by window of time, a panel for each record, the findings' intervals shaded.
pub(super) fn time_map(s: &Shown, map: &Map) -> Result<Figure, ReportError> {
    let t = s.sample_time_s();
    let shown = &map.order[..map.order.len().min(RECORDS)];
    let longest = shown.iter().map(|&g| map.errors[g].len()).max().unwrap_or(0) as f64 * t;
    let (scale, unit) = if longest < 1.0 { (1e3, "ms") } else { (1.0, "s") };
    let home: Vec<Option<usize>> = s.made.diagnosis.findings.iter().map(|f| strongest(s, map, f)).collect();
    let mut panels = Vec::new();
    for (i, &g) in shown.iter().enumerate() {
        let error = &map.errors[g];
        let width = error.len().div_ceil(WINDOWS).max(1);
        let at: Vec<f64> = (0..error.len().div_ceil(width)).map(|w| (w * width) as f64 * t * scale).collect();
        let height: Vec<f64> = error.chunks(width).map(rms).collect();
        let mut panel = Panel::new(Axis::linear("Time", unit), Axis::linear("Error / noise", ""));
        panel.height = 0.55;
        panel.x.range = Some((0.0, longest * scale));
        for (f, _) in s.made.diagnosis.findings.iter().zip(&home).filter(|(_, h)| **h == Some(g)) {
            for (k, [from, to]) in f.place.time_s.iter().enumerate() {
                let label = if k == 0 { words(&f.effect) } else { String::new() };
                panel.marks.push(Region::of_x(from * scale, to * scale, &label, Ink::Data(4)));
            }
        }
        let kind = Kind::Bars { from: 0.0, to: 0.92 * width as f64 * t * scale };
        panel.marks.push(Series::new(&name(s, g), Ink::Data((i % 6) as u8), kind, &at, &height)?.into());
        panel.marks.push(noise_line(0.0, longest * scale)?);
        panels.push(panel);
    }
    level(&mut panels);
    let caption = "What the linear refit leaves, rms in each window, in units of the noise. Records with most error first; \
                   shaded: the windows that hold nine tenths of a finding, in the record that shows it most.";
    Ok(Figure { title: "Error by record and time".into(), caption: caption.into(), share_x: true, panels })
}

/// Noise alone; a curve with a name in the legend, since words on bars are hard to read.
fn noise_line(from: f64, to: f64) -> Result<Mark, ReportError> {
    Ok(Series::new("noise alone", Ink::Limit, Kind::Dashed, &[from, to], &[1.0, 1.0])?.into())
}

/// One scale for all panels, so that bars compare.
fn level(panels: &mut [Panel]) {
    let most = panels.iter().flat_map(|p| p.series()).flat_map(|s| s.y.iter().copied()).filter(|v| v.is_finite());
    let most = most.fold(1.2, f64::max);
    panels.iter_mut().for_each(|p| p.y.range = Some((0.0, 1.08 * most)));
}

/// Error by zone of the stroke and direction of motion, the findings' zones shaded.
pub(super) fn zone_map(s: &Shown, map: &Map) -> Result<Figure, ReportError> {
    let data = &s.made.data;
    let places = || data.trajectories.iter().flat_map(|t| t.samples.iter().map(|m| m.x));
    let (low, high) = places().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let width = ((high - low) / ZONES as f64).max(f64::MIN_POSITIVE);
    let mut sums = [[(0.0, 0.0); ZONES]; 2];
    for (error, trajectory) in map.errors.iter().zip(&data.trajectories) {
        for (e, m) in error.iter().zip(&trajectory.samples) {
            let zone = (((m.x - low) / width) as usize).min(ZONES - 1);
            let sum = &mut sums[usize::from(m.v < 0.0)][zone];
            *sum = (sum.0 + e * e, sum.1 + 1.0);
        }
    }
    let mut panel = Panel::new(Axis::linear("Position", s.position), Axis::linear("Error / noise", ""));
    for f in &s.made.diagnosis.findings {
        for [from, to] in &f.place.position {
            panel.marks.push(Region::of_x(*from, *to, &words(&f.effect), Ink::Data(4)));
        }
    }
    let at: Vec<f64> = (0..ZONES).map(|z| low + (z as f64 + 0.5) * width).collect();
    for (d, (label, ink)) in [("moving up", Ink::Data(0)), ("moving down", Ink::Data(1))].into_iter().enumerate() {
        let side = d as f64;
        let kind = Kind::Bars { from: (-0.42 + 0.42 * side) * width, to: 0.42 * side * width };
        // Fewer samples than this make a bar of chance.
        let bar = |(sum, n): &(f64, f64)| if *n < 20.0 { f64::NAN } else { (sum / n).sqrt() };
        let height: Vec<f64> = sums[d].iter().map(bar).collect();
        panel.marks.push(Series::new(label, ink, kind, &at, &height)?.into());
    }
    panel.marks.push(noise_line(low, high)?);
    let mut panels = vec![panel];
    level(&mut panels);
    let caption = "The same error over all fit records, by position and direction of motion; shaded: the zone that holds nine \
                   tenths of a finding. No bar: fewer than 20 samples there.";
    Ok(Figure { title: "Error by zone and direction".into(), caption: caption.into(), share_x: false, panels })
}
