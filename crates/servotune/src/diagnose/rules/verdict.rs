//! Rules of the verdict: what may be named, and what speaks against it.
//!
//! In: nothing. Out: a constant and a row of the table for each rule. Convention: thresholds in the unit of their row. Spec:
//! `specs/rules.md`.

use super::consequence::Consequence;
use super::rule::{Floor, Rule, rules};

rules! {
    Floor::Verdict;

    [Line]
    RUN_OUT_HELPS: f64 = 0.9, "ratio",
        "error of the records that judge, as shown or in open loop, with a run-out that was taken out and all searched again, over that without, below which it is kept",
        "judgement: an order that another law's form feeds takes little with it";

    [Law]
    NAMED_SHARE: f64 = 0.955, "share",
        "excess that findings must explain to be named",
        "judgement: right laws leave up to 11 % of a weak signal, laws that only lie near leave 1 to 9 %";
    CLEAN: f64 = 3.0, "standard deviations",
        "excess below which a model is down to the noise",
        "a normal number passes it once in 740";
    CLEAN_EXPLAINS: f64 = 0.6, "share",
        "excess clearly beyond noise that a clean model must have explained",
        "being near the noise alone explains nothing";
    CLEAN_HELD_OUT: f64 = 0.5, "share",
        "part of that, where held-out records lose as large a part of their own excess",
        "the noise's level errs in the records that it is taken from";
    HELD_OUT_DOWN: f64 = 1.05, "noise",
        "error over the noise floor that is down to it",
        "judgement: the floor errs by some per cent";
    HELD_OUT_ABOVE: f64 = 1.1, "ratio",
        "error of the refit over that of the model from which a single law has answered the held-out records",
        "judgement: twice that";
    DECISIVE_SHARE: f64 = 0.75, "share",
        "excess from which a name may be given though more is left than noise",
        "the rest is then said in the remarks";
    DECISIVE_RIVAL: f64 = 0.8, "share",
        "gain of the first finding that its best rival must stay below then",
        "what the library lacks is near to several of its laws";
    DECISIVE_LEFT: f64 = 2.0, "noise",
        "error on held-out records up to which such a name may be given, in closed loop",
        "as for curves: a name leaves no several times the noise";
    PLAY_CLEARLY: f64 = 0.012, "per sample",
        "deviance of the fitted records under an observer of a play, below that of a resonance under the same observer, from which the play is named",
        "judgement: over the 8000 samples that are read, odds of e^48";
    PLAY_UNDOUBTED: f64 = 0.5, "per sample",
        "the same, from which a play is named though its load is too small to be told",
        "judgement: two opened plays of the thirteenth sealed set have 2.3 and 4.8; what drifts has no such contact",
        "not counted: the rule is newer than the count";
    PLAY_LEAST: f64 = 60.0, "twice log-likelihood",
        "the same over all samples",
        "judgement: odds of e^30";
    PLAY_HELD_OUT: f64 = 0.15, "share",
        "gain per sample on held-out records over that on fitted ones from which they agree",
        "judgement: other motions meet the contact less often";
    PLAY_TOUCHES: f64 = 0.02, "share",
        "samples in contact, and out of it, from which a gap is seen",
        "a gap that is never crossed, or never met, is no play";

    [Nameless]
    RESTLESS_SIGMA: f64 = 6.0, "standard deviations",
        "excess from which something is there though no law was found",
        "noise may differ a little from what its repeats say";
    RESTLESS_RATIO: f64 = 1.06, "whitened mean square",
        "the same per sample",
        "with 25 000 samples 6 % of noise are five standard deviations";
    LOOP_LEFT: f64 = 3.0, "noise",
        "closed-loop error of held-out records over noise from which no name stands that explains less than the next share",
        "in closed loop nothing drifts";
    LOOP_HUNTS: f64 = 1.5, "noise",
        "open-loop error of the records that judge over their noise, under a law with a threshold, up to which what it leaves in closed loop is the simulated loop's hunting",
        "five dead bands of a stage left 3.5 to 10 times the noise in closed loop, 0.98 to 0.99 along the motion";
    LOOP_EXPLAINS: f64 = 0.99, "share",
        "that share",
        "judgement";
    GIVEN_FAR: f64 = 1.5, "noise",
        "error of the given plant over noise from which it does not agree though no refit is better",
        "judgement";
    SEEN_CHANCE: f64 = 1e-9, "probability",
        "chance of a scan's best gain below which something is there",
        "noise of the records may differ from white by a little";
    ASTRAY_SIGMA: f64 = 10.0, "standard deviations",
        "excess of a held-out record under the refit from which it shows what the fitted records do not",
        "far more than errs a linear model that is continued";
    ASTRAY_SHARE: f64 = 0.3, "share",
        "the same as a share of noise",
        "as before";

    [Refit]
    LINEAR_SIGMAS: f64 = 5.0, "standard deviations",
        "rise of the sum of squares over its mean, with some linear parameters as given, up to which these agree",
        "five standard deviations of the chi-square of as many numbers are never chance";
    LINEAR_SLACK: f64 = 10.0, "sum of squares",
        "by how much more it may rise",
        "judgement: a refit's own straightness";

    [Open]
    COLOURED: f64 = 1.25, "ratio",
        "open-loop error over the sensor's white noise above which it is coloured",
        "judgement: the level of one record errs by some per cent";

    [Trial]
    NAME_FAR: f64 = 3.0, "noise",
        "error that a named law leaves on held-out records from which a curve is looked for in its place, where the noise is what repeats differ by",
        "as in closed loop: several times the noise is something that nobody explained";

    [Words]
    SHOWN_BY: f64 = 0.02, "share",
        "energy of an effect in a record over that in the strongest, above which the record shows it",
        "judgement: it only says where to look";
    ONE_DIRECTION: f64 = 6.0, "ratio",
        "energy of an effect in one direction of the motion over that in the other, above which it shows in that direction alone",
        "judgement: it only says where to look";
    FAMILY: f64 = 20.0, "twice log-likelihood",
        "difference of two fits below which they are one family",
        "judgement: odds of e^10; laws differ from machines by more than noise";
    FAMILY_SHARE: f64 = 1e-3, "share",
        "the same as a share of the gain",
        "judgement: laws are true to a part in a thousand at best";
    SLIGHT: f64 = 120.0, "sum of squares",
        "fall under which a law of a narrow band stands in a family with the linear parameters",
        "a refit's own straightness falls short of as much";
    SLIGHT_SHARE: f64 = 0.01, "share",
        "the same as a share of what the refit took",
        "judgement";
    SLIGHT_CONFOUNDED: f64 = 0.3, "share",
        "part of such a law that the refit can take from which that is so",
        "judgement";
    SLIGHT_NEAR_NOISE: f64 = 4.0, "standard deviations",
        "excess of the refit below which that is so",
        "judgement";
    MAINS_ORDER: f64 = 1.5, "ratio",
        "frequency over the spindle's from which a single order may be the mains",
        "the first order is the spindle's own";
    DRY_LENGTH: f64 = 12.0, "noise",
        "sliding length over the sensor's noise below which friction counts as dry",
        "a shorter one is not resolved";
    LEFT_IN_NUMBERS: f64 = 0.5, "share",
        "of what is left beyond the noise over what a law took, in amplitude: by how much its numbers may be off for it",
        "a fit leaves what its law's numbers cannot take; a machine of another form may hide half as much in them";
    ORDER_BESIDE: f64 = 0.2, "share",
        "size over the largest order's below which other orders do not count",
        "judgement";

    [Caution]
    HELD_OUT_HOLDS: f64 = 1.2, "whitened mean square",
        "error of held-out records up to which a model holds whatever the refit leaves",
        "judgement: noise of another record may be louder by a fifth";
    HELD_OUT_NO_WORSE: f64 = 1.05, "ratio",
        "error of held-out records over that of the refit up to which a model holds",
        "judgement: numbers of laws err";
    NAMED_SHARE_OF_SEVERAL: f64 = 0.98, "share",
        "excess that several laws together must explain to be named, where another still sees something beside them",
        "each further law is nearer to anything";
    WIND_LEFT: f64 = 1.25, "ratio",
        "simulation of held-out records under the linear refit over what repeats differ by, up to which the rest has no name beside a noise of torque",
        "0.87 to 1.21 in five machines whose model was fitted under wind";
    BELOW_NOISE: f64 = 0.7, "ratio",
        "whitened squared error of the linear refit over its freedom, below which no law is named that takes nothing of held-out records",
        "what stays so far below the noise is the encoder's rounding";
    LEFTOVER: f64 = 0.05, "share",
        "gain of the findings that another law may still see",
        "no law is a machine's own to the last part";
    LOOP_LEFT_TWICE: f64 = 2.0, "noise",
        "closed-loop error of held-out records over noise from which no name stands that explains less than a smaller share",
        "what is named must be the larger part";
    LOOP_EXPLAINS_HALF: f64 = 0.5, "share",
        "that share",
        "the larger part is more than half";
    OPEN_SHOWS: f64 = 0.25, "share",
        "squared open-loop error of held-out records, beyond the noise, that findings must take off what the better linear plant leaves, where they leave several times the noise",
        "judgement: what does not show in the simulation does not explain it";
    NAME_YIELDS: f64 = 0.25, "share",
        "error that a curve in the place of names leaves over that of the names, below which it takes their place",
        "judgement: a curve of many numbers must be far better than a name";
    BOOTSTRAP_CHANCE: f64 = 0.01, "probability",
        "chance by the bootstrap up to which findings stand",
        "judgement: one draw in a hundred as strong as the records";
    LAW_SAYS: f64 = 40.0, "sum of squares",
        "what a law must say of held-out records before they can reject it",
        "its mean is then three standard deviations above nothing (40 against 2 times the root of 40)";
    LAW_SHORT: f64 = 0.25, "share",
        "share that findings explain of what held-out records say of their law; below it they fall short",
        "judgement: where the law acts they answer with all of it",
        "1 of 96 right laws rejected on three opened sets, counted by hand (specs/decisions/mismatch.md)";
    LAW_FAR: f64 = 3.0, "standard deviations",
        "standard deviations that they fall short by",
        "a normal number passes it once in 740";
    RANGE_MARGIN: f64 = 0.1, "share",
        "range of the fit records by which a record inside it may stick out",
        "judgement";
    HELD_OUT_FAR: f64 = 5.0, "standard deviations",
        "excess of a held-out record from which it says more than noise",
        "five are never chance";
    HELD_OUT_CLEAR: f64 = 0.05, "share",
        "the same as a share of noise",
        "judgement: levels of noise err by some per cent";
    HELD_OUT_LEFT: f64 = 0.5, "share",
        "excess of the refit there that a law may leave",
        "a law of the machine takes most of what it is there for";
    BEYOND_FAR: f64 = 10.0, "standard deviations",
        "the same excess beyond the fit's range",
        "a law is continued there and its numbers err more";
    BEYOND_LEFT: f64 = 0.5, "share",
        "excess of the refit there that a law may leave",
        "as within";
    HELD_OUT_TOGETHER: f64 = 3.75, "standard deviations",
        "excess of all held-out records within the range together",
        "each may say too little alone";
    HELD_OUT_UNMOVED: f64 = 0.6, "share",
        "excess of the refit that a law leaves on all of them",
        "a law that hardly moves them is another's";
    AT_END: f64 = 1.1, "ratio",
        "distance of a play's number from an end of its range, as a ratio, within which it rests there and is not named",
        "judgement: a slow motion in a wide gap follows any drift, and then rests at an end";
}
