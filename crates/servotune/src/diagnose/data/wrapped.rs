//! Positions that wrap round: a counter that overflows, an angle that begins anew each turn.
//!
//! In: the runs as logged. Out: the same runs laid end to end, and the length of a lap. A wrap is a jump from one end of all readings to the other;
//! every one is as long as the next. One jump alone is no wrap: samples may be lost there.

use super::checks::{misfit, quantum};
use super::run::Run;
use crate::controller::ControlLaw;
use crate::diagnose::rules::{WRAP_ALIKE, WRAP_JUMP, WRAP_ONWARD, WRAP_STEP};
use crate::numeric::statistics::median;

/// Fewest wraps.
const FEWEST: usize = 2;
/// Share of a lap by which it is moved to see what the controller's commands say.
const HEARD: f64 = 1e-3;

/// Lays wrapped positions end to end; the length of a lap (position_unit), none where nothing wraps. Jumps tell it as well as the noise lets them,
/// the commands of a known controller to their last digit.
pub(in crate::diagnose) fn unwrap(runs: &mut [Run], law: Option<&ControlLaw>) -> Option<f64> {
    let all = || runs.iter().flat_map(|r| &r.position).copied();
    let span = all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min);
    let steps = || runs.iter().flat_map(|r| r.position.windows(2).map(|w| w[1] - w[0]));
    let jumps = |step: f64| step.abs() >= WRAP_JUMP * span;
    let usual = steps().map(f64::abs).filter(|s| !jumps(*s)).fold(0.0, f64::max);
    // A jump and the step that the motion makes there, from the steps before and behind; where the noise takes it back and forth nothing tells that.
    let jump = |w: &[f64]| {
        let [before, jump, behind] = [w[1] - w[0], w[2] - w[1], w[3] - w[2]];
        (jumps(jump) && !jumps(before) && !jumps(behind)).then_some((jump, 0.5 * (before + behind)))
    };
    let clean: Vec<(f64, f64)> = runs.iter().flat_map(|r| r.position.windows(4).filter_map(jump)).collect();
    let lap = median(&clean.iter().map(|(jump, step)| (step - jump).abs()).collect::<Vec<_>>())?;
    let alike = steps().filter(|s| jumps(*s)).all(|s| (s.abs() - lap).abs() < usual + WRAP_ALIKE * lap);
    // A wrap jumps back where the motion goes on.
    let onward = median(&clean.iter().map(|(jump, step)| -step * jump.signum()).collect::<Vec<_>>())?;
    let moves = median(&steps().map(f64::abs).filter(|s| !jumps(*s)).collect::<Vec<_>>())?;
    let wraps = clean.len() >= FEWEST && alike && usual < WRAP_STEP * lap && lap > span - usual;
    if !wraps || onward < WRAP_ONWARD * moves {
        return None;
    }
    // A counter's lap is a whole number of its counts.
    let count = quantum(&all().collect::<Vec<_>>()).map(|g| g.step);
    let lap = count.map_or(lap, |c| (lap / c).round() * c);
    let laid = |run: &Run, lap: f64| {
        let mut run = run.clone();
        lay(&mut run, lap, span);
        run
    };
    let heard = law.and_then(|law| heard(law, lap, |lap| runs.iter().map(|r| laid(r, lap)).collect()));
    let lap = heard.unwrap_or(lap);
    runs.iter_mut().for_each(|r| lay(r, lap, span));
    Some(lap)
}

/// The lap under which the law's commands follow best from the positions; none without a reference. Commands are linear in the lap, their misfit a
/// parabola of it.
fn heard(law: &ControlLaw, lap: f64, laid: impl Fn(f64) -> Vec<Run>) -> Option<f64> {
    let off = HEARD * lap;
    let misfit = |lap: f64| -> f64 {
        let of = |r: &Run| Some(misfit(law, r, r.reference.as_deref()?, &|k| r.position[k]).0);
        laid(lap).iter().filter_map(of).sum()
    };
    let [below, here, above] = [lap - off, lap, lap + off].map(misfit);
    let bend = below - 2.0 * here + above;
    let moved = 0.5 * off * (below - above) / bend;
    (bend > 0.0 && moved.abs() < 0.5 * WRAP_ALIKE * lap).then_some(lap + moved)
}

/// Lays one run end to end, beginning in the lap of its reference where it has one.
fn lay(run: &mut Run, lap: f64, span: f64) {
    let first = run.position[0];
    let begins = run.reference.as_ref().map_or(0.0, |r| ((r[0] - first) / lap).round() * lap);
    let (mut by, mut before) = (begins, first);
    for y in &mut run.position {
        let jump = *y - before;
        before = *y;
        if jump.abs() >= WRAP_JUMP * span {
            by -= lap.copysign(jump);
        }
        *y += by;
    }
    run.origin += begins;
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::run::tests::run_at;
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn a_swing_over_three_laps_is_laid_end_to_end() {
        let mut random = Random::new(3);
        let whole: Vec<f64> = (0..4000).map(|k| 15.0 * (k as f64 * 0.01).sin() + 0.003 * random.normal()).collect();
        let wrapped = whole.iter().map(|v| (v + 5.0).rem_euclid(10.0) - 5.0).collect();
        let mut runs = [run_at(wrapped)];
        let lap = unwrap(&mut runs, None).unwrap();
        assert!((lap - 10.0).abs() < 0.01, "{lap}");
        for (found, true_) in runs[0].position.iter().zip(&whole) {
            assert!((found - true_).abs() < 0.03, "{found} {true_}");
        }
    }

    #[test]
    fn one_jump_and_a_square_wave_are_left_alone() {
        let slipped = (0..2000).map(|k| (k as f64 * 0.01).sin() + if k > 900 { 5.0 } else { 0.0 }).collect();
        let square = (0..2000).map(|k| if k / 50 % 2 == 0 { -1.0 } else { 1.0 + 1e-3 * (k % 7) as f64 }).collect();
        for position in [slipped, square] {
            let mut runs = [run_at(position)];
            let before = runs[0].position.clone();
            assert_eq!(unwrap(&mut runs, None), None);
            assert_eq!(runs[0].position, before);
        }
    }
}
