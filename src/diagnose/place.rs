//! Where an effect shows: records, time, band, zone, direction; by the energy of what it adds to the whitened error.

use super::bench::Bench;
use super::finding::Where;
use super::stack::Stack;
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

/// Where `signal`, stacked and whitened, has its energy.
pub fn place(bench: &Bench, stack: &Stack, signal: &[f64]) -> Where {
    let t = bench.scene.sample_time_s;
    let energy = |i: usize| -> f64 {
        let s = &stack.segments[i];
        signal[s.start..s.start + s.len].iter().map(|v| v * v).sum()
    };
    let energies: Vec<f64> = (0..stack.segments.len()).map(energy).collect();
    let most = energies.iter().copied().fold(0.0, f64::max);
    if most.is_nan() || most <= 0.0 {
        return Where { velocity_sign: "both", ..Where::default() };
    }
    let strongest = energies.iter().position(|e| *e == most).unwrap_or(0);
    let mut records = Vec::new();
    for (s, e) in stack.segments.iter().zip(&energies) {
        if *e > 0.02 * most {
            records.extend(s.runs.iter().map(|&r| bench.runs[r].name.clone()));
        }
    }
    // Time: the fewest windows of the strongest record that hold nine tenths, joined where they touch.
    let s = &stack.segments[strongest];
    let part = &signal[s.start..s.start + s.len];
    let width = s.len.div_ceil(WINDOWS);
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
        let (from, to) = ((i * width) as f64 * t, ((i + 1) * width).min(s.len) as f64 * t);
        match time_s.last_mut() {
            Some(last) if (last[1] - from).abs() < 0.5 * t => last[1] = to,
            _ => time_s.push([from, to]),
        }
    }
    let mut spectrum = Vec::new();
    let mut zone = Vec::new();
    let (mut ahead, mut back) = (0.0, 0.0);
    for (i, s) in stack.segments.iter().enumerate() {
        let part = &signal[s.start..s.start + s.len];
        let bins = forward(part);
        let hz = 1.0 / (s.len as f64 * t);
        spectrum.extend((1..s.len / 2).map(|k| (k as f64 * hz, bins[k].norm_sqr() / s.len as f64)));
        for (v, m) in part.iter().zip(&bench.trajectories[i].samples) {
            zone.push((m.x, v * v));
            if m.v > 0.0 { ahead += v * v } else { back += v * v }
        }
    }
    let velocity_sign = if ahead > 6.0 * back {
        "positive"
    } else if back > 6.0 * ahead {
        "negative"
    } else {
        "both"
    };
    Where { records, time_s, frequency_hz: vec![range(spectrum)], position: vec![range(zone)], velocity_sign }
}
