//! Rules of the search: which laws are considered, taken and kept.
//!
//! In: nothing. Out: a constant and a row of the table for each rule. Convention: thresholds in the unit of their row. Spec:
//! `specs/rules.md`.

use super::consequence::Consequence;
use super::rule::{Floor, Rule, rules};

rules! {
    Floor::Search;

    [Law]
    FALSE_ALARM: f64 = 1e-4, "probability",
        "chance of a false name over the whole search",
        "one machine in ten thousand; laws, points of their grids and strengths are all counted (Bonferroni)";
    EXPLAINS: f64 = 0.35, "share",
        "part of what is left beyond two standard deviations that each law must explain",
        "judgement: what acts explains most of what is left";
    SECOND_ADDS: f64 = 5e-3, "share",
        "what a second law must add, of what is explained",
        "judgement: no law is nearer to a machine than the first";
    THIRD_ADDS: f64 = 2e-2, "share",
        "the same of a third",
        "judgement: machines with many defects are rare";
    FOURTH_ADDS: f64 = 4e-2, "share",
        "the same of a fourth",
        "judgement, as for the third";
    WAVE_STANDS_OUT: f64 = 25.0, "times",
        "gain of a wave over the position beside another law, over the median gain of waves of other periods, from which chance alone judges it",
        "the wrong form of another law feeds waves of every period; the largest of 700 that chance makes is ten times their median";
    WAVE_TAKES: f64 = 0.5, "share",
        "what the other laws leave in excess of noise that a wave beside them must take",
        "a law of the right form leaves the wave and noise, one of the wrong form leaves more than its wave",
        "of seven opened cases, four true waves took 98 % or more and three false ones 0.3 to 16 %, counted by hand (specs/decisions/mismatch.md)";
    SWING_CHANCE: f64 = 1e-8, "probability",
        "chance of a false swing of the gain",
        "phases and frequencies of every record are looked at";
    SWING_PERIODS: f64 = 3.0, "periods",
        "periods in a record from which it swings",
        "what is slower is a drift";
    SWING_ALIKE: f64 = 1.5, "ratio",
        "depth over its spread from record to record from which all swing alike",
        "judgement";

    [Push]
    PUSH_TOGETHER: f64 = 0.5, "share",
        "strength of the strongest push that every other record must show for a push that comes with the record",
        "judgement";
    PUSH_MOVES: usize = 3, "moves",
        "fewest moves that tell it",
        "two may agree by chance";

    [Trial]
    GAIN_WITHOUT_REPEATS: f64 = 8.0, "twice log-likelihood",
        "gain of a scan from which a law is refitted where no repeat tells the noise",
        "it only opens a trial: the refit decides";
    CONFOUNDED: f64 = 0.9995, "share",
        "part of a law that the linear parameters can imitate above which it is not considered",
        "the records say nothing of it";
    CONFOUNDED_NEAR_NOISE: f64 = 0.999_999, "share",
        "the same where the refit is near the noise",
        "what is still seen then is not the linear parameters'";
    NEAR_NOISE: f64 = 5.0, "standard deviations",
        "excess below which the refit is near the noise",
        "judgement";
    FAR_FROM_NOISE: f64 = 30.0, "standard deviations",
        "excess from which no law of a step is near the noise, and laws are fitted by simulation",
        "it only opens a fit: its error decides";
    REFIT_HIDES: f64 = 3.0, "standard deviations",
        "excess above which laws are looked for around the given plant too",
        "it only opens a scan";
    RIVAL_TRIED: f64 = 0.8, "share",
        "gain of an effect from which a rival of its step is tried in its place",
        "it only opens a trial";
    RIVAL_TRIED_WITHOUT_REPEATS: f64 = 0.4, "share",
        "the same where each model leaves its own noise",
        "a poor start makes its own excuse";

    [Words]
    RIVAL_BETTER: f64 = 2.0, "sum of squares",
        "fall for which an effect is exchanged",
        "rounding of two fits";
    RIVAL_DOUBT: f64 = 0.05, "share",
        "gain within which simulation decides between two laws",
        "by as much the recorded motion errs";
    SIMULATION_NO_JUDGE: f64 = 1.2, "ratio",
        "simulation error over that along the motion above which a simulation is no judge",
        "a body that drifts";
    USUAL_LAW: f64 = 4.6, "twice log-odds",
        "lead of a law that every machine of the kind follows",
        "odds of ten to one: 2 ln 10";

    [Caution]
    BESIDE_DRAG: f64 = 0.08, "share",
        "gain beside a friction, of what is explained, below which a law must explain more of the rest",
        "what friction does at rest no motion tells";
    REST_BESIDE_DRAG: f64 = 0.75, "share",
        "part of the rest that it must explain then",
        "what is left is then nearly all its own";
    MIXTURE_LAWS: usize = 3, "laws",
        "laws that together are a mixture",
        "judgement: three defects at once are rarer than one that the library lacks";
    MIXTURE_LEADS: f64 = 0.8, "share",
        "share of all gains from which one law leads the mixture",
        "judgement";
    MIXTURE_LEFT: f64 = 0.01, "share",
        "what laws may leave on hold-out records of the linear refit's error above the noise and be no mixture, where that share of it is above HELD_OUT_CLEAR",
        "judgement: a bearing, a torque factor and a grating together leave 0.005 in the bench of short records";
    OWN_OF_RECORD: f64 = 0.05, "share",
        "gain by which an effect of each record's own must lead",
        "it has a number for each record, and a machine has its law in all";
    FORM_OF_SIMULATED: f64 = 0.045, "share",
        "excess of the refit that may be the form of the simulated laws",
        "as much as a name may leave unexplained";
    LINEAR_FURTHER: f64 = 5.0, "sum of squares",
        "fall by the linear parameters alone that is credited to them",
        "a few units are chance";
    LINEAR_OF_GAIN: f64 = 0.05, "share",
        "the same as a share of the step's gain",
        "judgement";
    DOWN_TO_NOISE: f64 = 5.0, "standard deviations",
        "excess below which a simulated model leaves nothing",
        "five are never chance";
    DRIFT_FOLLOWS_MOTION: f64 = 20.0, "ratio",
        "variance of a drift's strengths between moves over that between repeats from which it follows the motion",
        "the chance of such an F is 1 % with four repeats, less with more";
    DRIFT_REPEATS: usize = 4, "records",
        "fewest repeats beyond the first of their moves for that test",
        "with fewer F has no tail to speak of";
    SMALL_BESIDE_DRAG: f64 = 0.3, "share",
        "gain over the largest below which an effect beside a friction is in doubt",
        "judgement: the simulated friction may do without it";
}
