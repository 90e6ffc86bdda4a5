//! What rounding may do to a simulated write: the rounding of each step, times what the closed loop makes of it.
//!
//! The computed states obey the exact recursion but for a small residual in each step: a few last digits of the sums formed there. The loop is linear as
//! long as no command is clipped, so that the error of the window is the residuals' sum under the loop's own responses, and these are simulated, one
//! for each place where a residual enters (Higham, Accuracy and Stability of Numerical Algorithms, 3.1 and 3.5; `specs/certificate.md`).

use super::cascade::Loop;
use super::write_record::{Clock, Record};
use crate::controller::Controller;
use crate::pes::Profile;
use nalgebra::DVector;

/// One rounding, with room for the next orders.
const DIGIT: f64 = 1.01 * f64::EPSILON;
/// Share of the travel taken where commands are clipped: there the loop is not linear, and this is an assumption.
const CLIPPED: f64 = 1e-9;

/// Sums of absolute responses to a unit in one place: of the position read anywhere in a sample, and of the command.
#[derive(Clone, Copy, Default)]
struct Gain {
    position: f64,
    command: f64,
}

/// Half widths of the window's amplitudes (position_unit) and of a command (command_unit).
pub(super) fn bound(l: &Loop<'_>, record: &Record, c: &Controller, profile: &Profile) -> [f64; 2] {
    let z = &record.sizes;
    let peak = record.command.iter().fold(0.0f64, |m, u| m.max(u.abs()));
    if z.clipped {
        return [CLIPPED * profile.spiral.distance, 1e-7 * peak];
    }
    let n = l.cascade.output.len();
    let clock = Clock::of(c, profile);
    let sum = |row: &mut dyn Iterator<Item = (f64, f64)>| row.map(|(a, x)| a.abs() * x).sum::<f64>();
    // Reference: differences of areas under the speed, each right to some digits of the largest.
    let s = &profile.spiral;
    let end = clock.ticks as f64 * c.sample_time_s;
    let wanted = 24.0 * DIGIT * (s.velocity.abs() / s.acceleration_time_s * end * end + s.distance);
    // Transitions: a dot product of n + 1 terms and coefficients right to a last digit. The two times add up to the sample only to a digit, which moves every
    // state by its rate times that.
    let late = 8.0 * DIGIT * (c.sample_time_s + profile.spiral.duration_s);
    let rate: Vec<f64> = (0..n)
        .map(|i| {
            let row = l.cascade.rates.row(i);
            sum(&mut row.iter().copied().zip(z.state.iter().copied().chain([z.input])))
        })
        .collect();
    let step = |(f, g): &(nalgebra::DMatrix<f64>, DVector<f64>)| -> Vec<f64> {
        (0..n)
            .map(|i| {
                let terms = sum(&mut f.row(i).iter().copied().zip(z.state.iter().copied())) + g[i].abs() * z.input;
                (n + 4) as f64 * DIGIT * terms + late * rate[i]
            })
            .collect()
    };
    let (first, second) = (step(&l.first), step(&l.second));
    let state: Vec<f64> =
        (0..n).map(|i| second[i] + sum(&mut l.second.0.row(i).iter().copied().zip(first.iter().copied()))).collect();
    let (memory, entering, size) = through(l, record, wanted);
    let forward = c.feedforward.as_ref().map_or(0.0, |f| {
        let t = c.sample_time_s;
        (f.factor * f.velocity_s).abs() * wanted / t + (f.factor * f.acceleration_s2).abs() * 4.0 * wanted / (t * t)
    });
    let command = entering + 3.0 * DIGIT * (size + z.input) + 2.0 * forward;
    // Reading: Taylor's series about a state; its sizes from the terms themselves.
    let span = c.sample_time_s;
    let terms: Vec<f64> =
        (0..=n).map(|i| l.onward.iter().rev().fold(0.0, |s: f64, row| s * span + row[i].abs())).collect();
    let most: Vec<f64> = z.state.iter().copied().chain([z.input]).collect();
    let last = l.onward.last().map_or(0.0, |row| {
        sum(&mut row.iter().copied().zip(most.iter().copied())) * span.powi(l.onward.len() as i32 - 1)
    });
    let read = (l.onward.len() + n) as f64 * 2.0 * DIGIT * sum(&mut terms.iter().copied().zip(most.iter().copied()))
        + 2.0 * last
        + sum(&mut terms.iter().copied().zip(first.iter().copied()))
        + sum(&mut l.cascade.output.iter().copied().zip(rate.iter().copied())) * late;
    let head: f64 = profile.noise.runout.iter().map(|r| r.amplitude.abs() * f64::from(r.order)).sum();
    let head = 16.0 * DIGIT * head * (2.0 + 7.0 * profile.noise.spindle_hz * profile.spiral.duration_s);
    let mut total = Gain { position: read + wanted + head, command };
    let mut add = |by: f64, g: Gain| {
        total.position += by * g.position;
        total.command += by * g.command;
    };
    for (i, by) in state.iter().enumerate() {
        add(*by, gain(l, clock.ticks, &terms, Place::State(i)));
    }
    for (i, by) in memory.iter().enumerate() {
        add(*by, gain(l, clock.ticks, &terms, Place::Memory(i)));
    }
    add(command, gain(l, clock.ticks, &terms, Place::Command));
    // The transform: N terms by Horner's rule with a factor right to some digits; no amplitude moves by more than the mean of |pes| times them.
    let mean = record.window.iter().map(|x| x.abs()).sum::<f64>() / record.window.len().max(1) as f64;
    let transform = 8.0 * (record.window.len() as f64 + 4.0) * DIGIT * mean;
    // A norm over bins moves by no more than the window's own norm over sqrt N, which its largest error bounds.
    let window = total.position * (1.0 + 1e-6);
    let finite = |x: f64| if x.is_finite() { x } else { f64::MAX };
    let bins = (record.window.len() as f64 / 2.0).sqrt();
    [finite(window + transform * bins), finite(total.command * (1.0 + 1e-6))]
}

/// What the sections' memories and their output are off by, and the output's size.
fn through(l: &Loop<'_>, record: &Record, wanted: f64) -> (Vec<f64>, f64, f64) {
    // Sections: three terms into the memory, three out of it; what comes out enters the next memory as it is.
    let mut memory: Vec<f64> = Vec::new();
    let mut entering = wanted + 3.0 * DIGIT * record.sizes.error;
    let mut size = record.sizes.error;
    for (section, w) in l.sections.iter().zip(&record.sizes.memory) {
        memory.push(entering + 4.0 * DIGIT * (size + (section.a1.abs() + section.a2.abs()) * w));
        size = (section.b0.abs() + section.b1.abs() + section.b2.abs()) * w;
        entering = 4.0 * DIGIT * size;
    }
    (memory, entering, size)
}

/// Where a residual enters.
#[derive(Clone, Copy)]
enum Place {
    State(usize),
    Memory(usize),
    Command,
}

/// The loop's response to a unit there, over the whole record, as sums of sizes.
fn gain(l: &Loop<'_>, ticks: usize, reading: &[f64], place: Place) -> Gain {
    let mut state = l.at_rest();
    let mut total = Gain::default();
    let mut push = 0.0;
    match place {
        Place::State(i) => state.x[i] = 1.0,
        // A unit in the newest memory is a unit in what enters the section, as of this sample.
        Place::Memory(_) | Place::Command => push = 1.0,
    }
    for k in 0..ticks {
        let y = l.cascade.output.dot(&state.x);
        let u = match place {
            Place::Memory(i) if k == 0 => entered(l, &mut state, i, push),
            Place::Command if k == 0 => push,
            _ => l.law(&mut state, -y),
        };
        let (middle, before, now) = l.hold(&mut state, u);
        let size = |x: &DVector<f64>, u: f64| {
            let n = x.len();
            x.iter().zip(reading).map(|(x, r)| x.abs() * r).sum::<f64>() + reading[n] * u.abs()
        };
        total.position += size(&state.x, before).max(size(&middle, now));
        total.command += u.abs();
        l.advance(&mut state, &middle, now);
    }
    total
}

/// A unit entering section `i` with everything else at rest: what the sections from there on answer.
fn entered(l: &Loop<'_>, state: &mut super::cascade::State, i: usize, unit: f64) -> f64 {
    let mut signal = unit;
    for (s, m) in l.sections.iter().zip(&mut state.memory).skip(i) {
        let w = signal;
        signal = s.b0 * w;
        *m = [w, 0.0];
    }
    signal
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::write::write;
    use crate::pes::{figures, simulate};
    use crate::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};

    /// Partial fractions round elsewhere; the two lie within the bound, and the bound is far below what was once assumed.
    #[test]
    fn two_simulations_lie_within_the_bound() {
        let c = nominal_controller().unwrap();
        let sections = c.sections().unwrap().chain;
        for class in MachineClass::ALL {
            let (plant, profile) = (paper_machine(class).unwrap(), paper_profile(class).unwrap());
            let w = write(&plant, &sections, &c, &profile, &[[600.0, 1500.0], [1500.0, 3000.0]]);
            let run = simulate(&plant, &c, &profile).unwrap();
            let f = figures(&run.pes, &profile);
            let peak = run.command.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            // Both round: twice the bound of one.
            let (low, high) = (f.dft_low.unwrap(), f.dft_high.unwrap());
            assert!((w.dft_low - low).abs() <= 2.0 * w.error, "{} {}", w.dft_low - low, w.error);
            assert!((w.dft_high - high).abs() <= 2.0 * w.error);
            assert!((w.command_peak - peak).abs() <= 2.0 * w.command_error.unwrap());
            assert!(w.error < 1e-9 * profile.spiral.distance, "{}", w.error);
            assert!(w.command_error.unwrap() < 1e-7 * peak, "{:?}", w.command_error);
        }
    }
}
