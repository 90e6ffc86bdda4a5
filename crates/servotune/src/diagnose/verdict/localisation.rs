//! Where an effect shows: records, time, band, zone, direction; by the energy of what it adds to the whitened error.

use super::finding::Where;
use crate::diagnose::data::stacked_records::{Segment, StackedRecords};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::trajectory::Trajectory;
use crate::diagnose::rules::{ONE_DIRECTION, SHOWN_BY};
use crate::numeric::spectrum::forward;

/// Windows of a record.
const WINDOWS: usize = 48;
/// Share of the energy that an interval holds.
const HELD: f64 = 0.9;

/// Smallest and largest place between which `HELD` of the weight lies, a twentieth left out on each side.
fn range(mut weighted: Vec<(f64, f64)>) -> [f64; 2] {
    weighted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = weighted.iter().map(|w| w.1).sum();
    let at = |share: f64| {
        let mut sum = 0.0;
        weighted.iter().find(|w| {
            sum += w.1;
            sum >= share * total
        })
    };
    let tail = 0.5 * (1.0 - HELD);
    let ends = [at(tail), at(1.0 - tail)].map(|w| w.map_or(0.0, |w| w.0));
    [ends[0], ends[1]]
}

/// Width of a band of the spectrum, as a ratio; never narrower than a record resolves.
const BAND: f64 = 1.12;

/// The fewest bands of a spectrum (frequency in Hz, power) that hold `HELD` of its power, joined where they touch; strongest first.
/// `resolution` is the width that the longest record resolves (Hz).
fn bands(spectrum: &[(f64, f64)], resolution: f64) -> Vec<[f64; 2]> {
    let highest = spectrum.iter().map(|s| s.0).fold(0.0, f64::max);
    let mut edges = vec![0.5 * resolution];
    while let Some(&last) = edges.last().filter(|e| **e <= highest) {
        edges.push((BAND * last).max(last + resolution));
    }
    let mut power = vec![0.0; edges.len()];
    for (hz, p) in spectrum {
        power[edges.partition_point(|e| e <= hz).saturating_sub(1)] += p;
    }
    let total: f64 = power.iter().sum();
    let mut order: Vec<usize> = (0..power.len()).collect();
    order.sort_by(|&a, &b| power[b].total_cmp(&power[a]));
    let mut held = 0.0;
    let mut kept: Vec<usize> = order
        .into_iter()
        .take_while(|&i| {
            let more = held < HELD * total;
            held += power[i];
            more
        })
        .collect();
    kept.sort_unstable();
    let mut out: Vec<([usize; 2], f64)> = Vec::new();
    for i in kept {
        match out.last_mut() {
            Some(([_, end], p)) if *end == i => (*end, *p) = (i + 1, *p + power[i]),
            _ => out.push(([i, i + 1], power[i])),
        }
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    let edge = |i: usize| edges.get(i).copied().unwrap_or(highest).min(highest + 0.5 * resolution);
    out.into_iter().map(|([from, to], _)| [edge(from), edge(to)]).collect()
}

/// A stretch of a whitened signal.
pub struct Part<'a> {
    /// The records that it stands for.
    pub records: Vec<String>,
    /// The signal.
    pub signal: &'a [f64],
    /// When it begins in its record (s).
    pub from_s: f64,
    /// Position and velocity under each of its samples.
    pub motion: Vec<[f64; 2]>,
}

/// Where `signal`, stacked and whitened, has its energy.
pub fn place(data: &DiagnosisData, stack: &StackedRecords, signal: &[f64]) -> Where {
    let part = |(s, motion): (&Segment, &Trajectory)| Part {
        records: s.runs.iter().map(|&r| data.runs[r].name.clone()).collect(),
        signal: &signal[s.start..s.start + s.len],
        from_s: data.runs[s.runs[0]].from_s,
        motion: motion.samples.iter().map(|m| [m.x, m.v]).collect(),
    };
    let parts: Vec<Part> = stack.segments.iter().zip(&data.trajectories).map(part).collect();
    place_of(&parts, data.scene.sample_time_s)
}

/// Where whitened signals, sampled every `t` seconds, have their energy.
pub fn place_of(parts: &[Part], t: f64) -> Where {
    let energies: Vec<f64> = parts.iter().map(|p| p.signal.iter().map(|v| v * v).sum()).collect();
    let most = energies.iter().copied().fold(0.0, f64::max);
    let Some(strongest) = energies.iter().position(|e| *e == most && most > 0.0) else {
        return Where { velocity_sign: "both", ..Where::default() };
    };
    let loud = parts.iter().zip(&energies).filter(|(_, e)| **e > SHOWN_BY * most);
    let records = loud.flat_map(|(p, _)| p.records.iter().cloned()).collect();
    // Time: the fewest windows of the strongest record that hold nine tenths, joined where they touch.
    let part = parts[strongest].signal;
    let width = part.len().div_ceil(WINDOWS);
    let mut windows: Vec<(usize, f64)> =
        part.chunks(width).enumerate().map(|(i, c)| (i, c.iter().map(|v| v * v).sum())).collect();
    windows.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut held = 0.0;
    let mut kept: Vec<usize> = Vec::new();
    for (i, e) in windows {
        if held >= HELD * most {
            break;
        }
        held += e;
        kept.push(i);
    }
    kept.sort_unstable();
    let mut time_s: Vec<[f64; 2]> = Vec::new();
    for i in kept {
        let at = |k: usize| parts[strongest].from_s + k as f64 * t;
        let (from, to) = (at(i * width), at(((i + 1) * width).min(part.len())));
        match time_s.last_mut() {
            Some(last) if (last[1] - from).abs() < 0.5 * t => last[1] = to,
            _ => time_s.push([from, to]),
        }
    }
    let mut spectrum = Vec::new();
    let longest = parts.iter().map(|p| p.signal.len()).max().unwrap_or(1);
    let mut zone = Vec::new();
    let (mut ahead, mut back) = (0.0, 0.0);
    for Part { signal, motion, .. } in parts {
        let n = signal.len();
        let bins = forward(signal);
        let hz = 1.0 / (n as f64 * t);
        spectrum.extend((1..n / 2).map(|k| (k as f64 * hz, bins[k].norm_sqr() / n as f64)));
        for (v, [at, speed]) in signal.iter().zip(motion) {
            zone.push((*at, v * v));
            if *speed > 0.0 { ahead += v * v } else { back += v * v }
        }
    }
    let velocity_sign = if ahead > ONE_DIRECTION * back {
        "positive"
    } else if back > ONE_DIRECTION * ahead {
        "negative"
    } else {
        "both"
    };
    let frequency_hz = bands(&spectrum, 1.0 / (longest as f64 * t));
    Where { records, time_s, frequency_hz, position: vec![range(zone)], velocity_sign }
}
