//! Rules of the data checks: what makes a log, and not the machine, the thing that is wrong.
//!
//! In: nothing. Out: a constant and a row of the table for each rule. Convention: thresholds in the unit of their row. Spec:
//! `specs/rules.md`.

use super::consequence::Consequence;
use super::rule::{Floor, Rule, rules};

rules! {
    Floor::Data;

    [Log]
    OTHER_UNIT_GAIN: f64 = 8.0, "ratio",
        "factor of the gain between record and given plant, or its inverse, above which the log is in another unit",
        "no machine is eight times its own model; units differ by 10, 1000 or 57.3";
    OTHER_UNIT_EXPLAINED: f64 = 0.8, "share",
        "energy of the position that the scaled model must explain for it",
        "judgement: a right plant with a wrong factor leaves little";
    EARLY_LEFT: f64 = 0.3, "share",
        "error that moving an early position back may leave",
        "judgement: a shift that is the fault takes most of the error";
    REPLAY_ERROR: f64 = 5e-3, "share",
        "error of the replayed command over the command above which the controller is not the documented one",
        "logs round their numbers to three or four digits";
    STUCK_STEPS: f64 = 3.0, "counts",
        "steps of the encoder that the model moves while the position stands still, from which the value is stuck",
        "judgement: two counts may be rounding";
    JUMP_STEPS: f64 = 1.5, "counts",
        "jump of the position behind such a stretch, in steps of the encoder, from which it was stuck",
        "an arm that stands goes on by one count";
    SLIP_TAKEN: f64 = 0.7, "share",
        "squares of the error that one slip may leave",
        "judgement: each slip must earn its place";
    SLIPS_LEFT: f64 = 0.1, "share",
        "squares of the first error that all slips together may leave",
        "a machine with another gain, delay and clock leaves more";

    [Refusal]
    BEYOND_MOTION: f64 = 1e8, "ratio",
        "simulated motion over recorded motion above which a case is refused",
        "beyond it the numbers of a fit lose their digits (16 digits, half of them squared)";

    [Untried]
    LAP_DIGITS: f64 = 1e-7, "share",
        "difference between two laps of one drive up to which they are repeats",
        "digits that are printed";
    LAP_MEASURED: f64 = 0.05, "share",
        "the same for a command that was measured, root mean square over its size",
        "1 to 1.5 % on a bench with a current loop; a twentieth of a model's error is no more than its noise where the model is near";
    LIMIT_SAMPLES: usize = 3, "samples",
        "equal readings in a row at the lowest or the highest of all from which they lie on a limit",
        "judgement: noise above the last digit makes no two equal";
    LIMIT_SPEED: f64 = 0.05, "ratio",
        "step by which readings come to a limit or leave it, over the usual step, from which they do so at speed",
        "judgement: an arm that stands at the end of its way comes and goes slowly";
    LIMIT_COUNTS: f64 = 3.0, "counts",
        "the same over the count of a coarse encoder",
        "an arm that stands between two counts reads now one, now the other";
    LIMIT_CORNERS: usize = 2, "times",
        "times that a limit must be met or left at speed",
        "judgement: a stuck value does so once";
    LIMIT_SHARE: f64 = 0.8, "share",
        "times that it is met or left, of which so many must be at speed",
        "judgement: a swing just above the limit turns round slowly now and then";
    FOLD_SHARP: f64 = 3.2, "ratio",
        "width of the lowest turns at 12 % of the range over that at 3 %, from which they are corners",
        "four times at a corner, twice at a parabola";
    FOLD_SMOOTH: f64 = 2.8, "ratio",
        "the same of the highest turns, up to which they are none",
        "a motion that turns in corners itself does so at both ends";
    FOLD_ALIKE: f64 = 0.25, "share",
        "deviation of the two sides of such a corner from each other, up to which it is a fold",
        "judgement: an arm that bounces comes back more slowly";
    FOLD_CORNERS: usize = 6, "turns",
        "fewest such corners",
        "judgement";
    WRAP_JUMP: f64 = 0.5, "share",
        "jump of the position over the range of all readings, from which it may wrap round",
        "a wrap goes from one end to the other";
    WRAP_STEP: f64 = 0.25, "share",
        "longest of all other steps over a lap",
        "judgement: a motion that makes half a lap a sample cannot be laid end to end";
    WRAP_ALIKE: f64 = 0.05, "share",
        "deviation of one jump from the usual one",
        "a lap is as long as the next; 5 % leave room for noise and the motion's own step";
    WRAP_ONWARD: f64 = 0.2, "ratio",
        "step of the motion against the jump over the usual step",
        "a counter that overflows jumps back where the motion goes on; a motion that leaps goes with its leap";
    FILTER_HELPS: f64 = 0.3, "ratio",
        "error of a failing replay over the log with a low-pass undone, over what a shift or a factor leaves, below which the log is filtered",
        "judgement: the filter undone takes nearly all of the error; it has up to three numbers, a shift has one";
    FILTER_GAIN: f64 = 0.02, "share",
        "deviation of that low-pass from 1 at rest up to which it is one",
        "a filter of a log keeps what stands; 2 % leave room for rounding";
    FILTER_RAISES: f64 = 1.5, "ratio",
        "largest gain of that low-pass up to which it is one",
        "judgement: two poles of damping 0.36 raise as much, and filters of a log are damped better";
    FILTER_WEAKENS: f64 = 0.7, "ratio",
        "its gain just below half of the sample rate, up to which it is one",
        "half of the power: a filter that passes more than that filters nothing that is logged";

    [Words]
    REPLAY_HELPS: f64 = 0.3, "share",
        "error of a failing replay that a shift or a factor may leave to explain it",
        "judgement: the fault itself takes nearly all of the error";
    SHIFT_TOLD: f64 = 0.05, "samples",
        "shift of the position above which the log is late or early",
        "judgement: rounding of the log imitates hundredths of a sample";
    SHIFT_BEFORE_SCALE: f64 = 1.1, "ratio",
        "error that a shift leaves over that a factor leaves, up to which the shift is the fault",
        "judgement: of two that do as well the shift has one number, the factor two";
    SHIFT_BROKEN: f64 = 0.7, "ratio",
        "error of a replay with a shift of parts of a sample over that with the best whole one, below which the former counts",
        "judgement: logs slip by whole samples more often";
    UNIT_FACTOR: f64 = 0.02, "share",
        "deviation of a factor from 1 above which a position counts as logged in other units",
        "a factor is found to parts in a thousand; 2 % leave room for rounding";
    REPLAY_FAILS: f64 = 20.0, "ratio",
        "error of a replay over that of the quiet blocks before it, from which it fails",
        "judgement: rounding varies less from block to block";
    REPLAY_FAILS_OF_COMMAND: f64 = 1e-3, "share",
        "the same over the command",
        "below it rounding of the log alone can do it";
    STILL_SAMPLES: usize = 4, "samples",
        "equal positions in a row that count as stuck where the replay fails with them",
        "judgement: fewer equal readings happen in slow motion";
    SHIFT_LEFT: f64 = 0.05, "share",
        "squares of a failing replay that the right shift may leave",
        "the right shift is exact up to rounding, a wrong one is not";
    ROWS_MOVE: f64 = 2.0, "ratio",
        "motion over one row by its scatter, from which lost rows can be counted",
        "below it a count errs by half a row";
    ROWS_WHOLE: f64 = 0.3, "rows",
        "distance of a count of lost rows from a whole number",
        "rows are lost whole";
}
