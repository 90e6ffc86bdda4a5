//! Rules of the fits: which plant and which simulation is offered.
//!
//! In: nothing. Out: a constant and a row of the table for each rule. Convention: thresholds in the unit of their row. Spec:
//! `specs/rules.md`.

use super::consequence::Consequence;
use super::rule::{Floor, Rule, rules};

rules! {
    Floor::Fit;

    [Anything]
    MEASURED_COMMAND: f64 = 0.9, "share",
        "error of a held command that a moving one must stay below to count as measured",
        "judgement: another way to hold it moves the error by less";
    ONE_NUMBER: f64 = 250.0, "sum of squares",
        "fall by one number in the place of all others that is no chance",
        "16 standard deviations of one number: laws differ from machines by more than noise does";

    [Cleared]
    CLEARED_ALONE: f64 = 1.1, "ratio",
        "simulation error of the same plant fitted without the law over that with it, up to which it is taken without: the given plant was far off, and nothing bent it",
        "judgement: a law that is worth a tenth is found from that plant as well";
    CLEARED_BETTER: f64 = 0.5, "ratio",
        "simulation error with the law over that of the best linear plant below which its plant is taken",
        "a bent plant leaves several times the noise; half cannot be one more number's luck";
    CLEARED_BY_CURVE: f64 = 0.25, "ratio",
        "squared simulation error with a curve over that of the best law, below which the plant is cleared of the curve instead",
        "judgement: a curve has thirty numbers and no name; half the error is more than a law's form leaves";
    CLEARED_FAR: f64 = 3.0, "noise",
        "simulation error of the best linear plant over the sensor's noise from which a plant is cleared at all",
        "nearer to the noise the search starts well enough";

    [Law]
    FOLD_NAMED: f64 = 1.15, "ratio",
        "squared error of a folded or limited reading over that of the free curve up to which it is the curve",
        "a form with three numbers against one with seventeen may leave a little more";
    CURVE_NAMED: f64 = 2.0, "noise",
        "error on held-out records under a loading curve, or a law found from the plant beside a curve, up to which it is a drag, or that law, by name",
        "as for laws: a name leaves no several times the noise";
    ALONE_LEFT: f64 = 1.2, "noise",
        "error on held-out records under the law alone that the plant was cleared of, up to which it is named where the search of all laws found no name",
        "a friction beside a run-out left 1.01, a friction that acts one way only, which the library lacks, 1.9";
    LOADING_FALLS: f64 = 0.15, "share",
        "deepest fall of a loading curve beyond the errors of its knots over its height, below which it is a drag",
        "judgement: a drag takes energy; noise moves single knots";
    LOADING_LEVEL: f64 = 0.6, "share",
        "its value at the middle knot, an eighth of the way, over its height, above which it is a drag and no spring",
        "a spring has an eighth there, a drag that slides all of it";

    [Curve]
    CURVE_CLEARLY: f64 = 0.6, "share",
        "squared error on parts left out over that of the best linear plant that a curve must stay below; over that of a curve, one of twice its knots",
        "judgement: a curve has seventeen numbers and no name";

    [Untried]
    COUPLING_SHORTER: f64 = 0.999, "ratio",
        "squares left out at the best length of the impulse responses of further inputs over those at a shorter one, from which the shorter one is taken",
        "judgement: what a short response cuts off is taken for something else; a few numbers too many cost little";
    COUPLING_CHANCE: f64 = 1e-6, "chance",
        "chance (Chernoff's bound of chi-square) of as large a fall of the squares by the response of one further input, below which it may move the position",
        "nominal: what is left is whitened first, and the squares left out decide with it";
    COUPLING_LEFT_OUT: f64 = 0.998, "ratio",
        "squares left out with a further input over those without it, below which, and if they fall on both halves, it moves the position",
        "an input that moves nothing raises them by one over the samples a tap";

    [Trial]
    CLEARED_TELLS: f64 = 0.7, "share",
        "equation error of the linear balance below which a law bends the plant, and is simulated near the given plant's noise too",
        "it only saves simulations: they decide";
    OTHER_START: f64 = 5.0, "standard deviations",
        "excess from which a fit with laws is made from the given plant too",
        "it only saves a fit: the lower error decides";
    FAR_OFF: f64 = 5.0, "standard deviations",
        "excess from which delay and gain are looked for far from the given ones",
        "it only opens a fit: the lower error decides";
    UNSETTLED: f64 = 5.0, "standard deviations",
        "excess from which a fit by simulation is made from the given plant too",
        "it only saves a fit: the lower error decides";
    REFIT_FAR: f64 = 3.0, "noise",
        "error of a linear refit over noise from which a fit by simulation is tried beside it",
        "it only saves a fit: errors decide";
    BALANCES: f64 = 0.3, "share",
        "squares of the linear balance of torques that a curve leaves, below which it balances well and is the start of its fit",
        "judgement: it saves fits, and the error on parts left out decides";
    BALANCES_NOT: f64 = 0.8, "share",
        "the same above which a port is left out beside one that balances well",
        "judgement: what explains a fifth of the balance is not what acts where another explains most";
    SECOND_CURVE: f64 = 2.0, "ratio",
        "squared error of a folded or limited reading over that of the free curve up to which a curve at another port is looked for beside it",
        "judgement";

    [Words]
    FREE_BODY: f64 = 0.02, "share",
        "stiffness over the given one below which a body counts as free",
        "judgement";
    CLEARED_FULLER: f64 = 0.5, "ratio",
        "squared simulation error of a fuller form of the law over that of the plain one, below which it is taken",
        "judgement: what a drag leaves out leaves many times what it explains, and a fit that has not come down gains by any further number";
    CLEARED_DONE: f64 = 1.1, "noise",
        "simulation error with the law over the sensor's noise below which no other law and no curve is tried",
        "nothing leaves less than the noise; what is left to win is a tenth of it";
    LAG_INSTEAD: f64 = 0.95, "share",
        "squared simulation error that a lag of the reading takes off the given plant's, over what a linear refit takes, from which a remark says so",
        "judgement: one number that does nearly all of what several do is the likelier cause";
    LAGS_ALIKE: f64 = 0.1, "share",
        "share of the best lag's gain by which another may fall short",
        "before or behind the arm a lag is the same to the records";
    REFIT_BETTER: f64 = 0.95, "ratio",
        "share of the refit's error that the fit by simulation must stay below",
        "another kind of fit needs a reason";
    HEARD_AGAIN: f64 = 0.95, "ratio",
        "open-loop error of the fit records with numbers fitted once more under the noise that repeats show around the model, over that before, below which they are taken",
        "judgement: less is not worth another answer";
    CURVE_LAG: f64 = 0.85, "share",
        "error on parts left out that a lag must stay below to stay",
        "judgement: a lag must pay for itself on parts that it was not fitted to";
    CURVE_LIKE: f64 = 0.5, "share",
        "share of a curve that a shape must explain to be called like it",
        "half of it is the least that the word allows";
    CURVE_FORETELLS: f64 = 0.8, "share",
        "share of a curve, alike on both sides, that a law's shape must hold for another search to set out from the plant beside the curve",
        "judgement: a ground is tried, not a name; of 24 curves outside the library four pass it, each some 90 % weaker on one side";
    CURVE_LOPSIDED: f64 = 0.1, "share",
        "difference of the two sides that is reported",
        "judgement";

    [Caution]
    RUNS_AWAY: f64 = 100.0, "ratio",
        "whitened simulation error over that along the motion above which a simulation runs away",
        "a body that drifts; it then fits nothing";
    SIMULATION_SILENT: f64 = 1.2, "ratio",
        "the same above which a fit that wins nothing says nothing",
        "judgement";
    SIMULATION_ALIKE: f64 = 0.01, "share",
        "difference of two simulation errors without one being worse",
        "judgement";
    SIMULATION_SAMPLING: f64 = 2.0, "standard deviations",
        "the same over the root of the samples",
        "two standard deviations of a mean square of so many samples, at the least";
    CURVE_NO_WORSE: f64 = 1.0, "ratio",
        "error on held-out records over that of the better linear model",
        "never worse than what was there";
    CURVE_NEAR: f64 = 1.1, "ratio",
        "the same over that of a mixture of laws",
        "one curve instead of several laws may cost a tenth";
}
