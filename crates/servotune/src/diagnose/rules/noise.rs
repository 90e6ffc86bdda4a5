//! Rules of the noise: pushes, lines and noise of its own kind.
//!
//! In: nothing. Out: a constant and a row of the table for each rule. Convention: thresholds in the unit of their row. Spec:
//! `specs/rules.md`.

use super::consequence::Consequence;
use super::rule::{Floor, Rule, rules};

rules! {
    Floor::Noise;

    [Anything]
    HEARD_BETTER: f64 = 0.98, "ratio",
        "what repeats differ by around the linear refit, or a model with laws, over the same around the given plant, below which that model tells the noise",
        "around the plant that is there the sensor's noise comes out smallest, whatever the controller makes of it: a monic filter adds power (Jensen)";
    FAR_FROM_REPEATS: f64 = 5.0, "ratio",
        "plain simulation error of the cleared plant and its law over what repeats differ by, from which models are judged by that error",
        "what is left then is the model's own, and its small parts at high frequencies choose no law";
    FAR_FROM_SENSOR: f64 = 30.0, "ratio",
        "the same over the sensor's noise, without repeats",
        "without repeats an uneven push counts as noise too";
    NO_FINER: f64 = 1e-3, "share",
        "plain simulation error of the cleared plant and its law, without a controller, of which the sensor's noise is at least that",
        "judgement: a speed that was filtered and summed up has a billionth of its motion at high frequencies";

    [Push]
    PUSH_CHANCE: f64 = 1e-9, "probability",
        "chance of a false push below which it is one",
        "many places, widths and records are looked at; false pushes are to be rarer than one in a thousand cases";
    PUSH_WHOLE: f64 = 0.6, "share",
        "excess of its record that one push must explain",
        "what comes and goes all the time is no push";

    [Line]
    LINE_CHANCE: f64 = 1e-6, "probability",
        "chance of a false line over all frequencies",
        "judgement: a line is taken out of every record, so chance must not make one";

    [Noise]
    COUNT_OF_NOISE: f64 = 0.01, "share",
        "noise power from which an encoder's count is worth a word",
        "below it nothing is gained by saying it";
    TORQUE_NOISE_AHEAD: f64 = 40.0, "twice log-likelihood",
        "lead of torque noise over any noise of the sensor",
        "judgement: far beyond what the few numbers of either explain by chance";
    TORQUE_NOISE_LOUD: f64 = 2.0, "ratio",
        "power over that of the sensor's noise, where it is strongest, from which torque noise is reported",
        "judgement";
    NOISE_WITH_SPEED: f64 = 0.2, "share",
        "growth of the noise power from rest to the highest speed that is reported",
        "judgement";
    NOISE_SLOPE: f64 = 7.0, "standard deviations",
        "growth of the noise with the speed from which it is no chance",
        "judgement: a normal number never does";
    NOISE_SHARED: f64 = 0.3, "share",
        "growth that neighbouring readings have in common, up to which it is the noise of readings",
        "judgement: 0 where each scatters on its own";
    NOISE_DEPARTED: f64 = 1.3, "ratio",
        "level over the stated one from which noise has departed",
        "judgement: levels from a few repeats err by a tenth";
    NOISE_LARGER: f64 = 4.0, "ratio",
        "power of the error over that of the sensor's white noise from which torque noise is by far the larger part",
        "judgement: half of the amplitude at most is the sensor's";

    [Untried]
    ROUNDING_ALIKE: f64 = 0.5, "ratio",
        "rounding over the noise of repeats from which repeats round alike",
        "a mean then does not take the rounding away (Widrow and Kollar 2008)";

    [Trial]
    PUSH_SUSPECTED: f64 = 1e-3, "probability",
        "chance below which a push is looked at again under the noise of the other records",
        "the push stands in its own noise and hides behind it";
    ORDER_STANDS_OUT: f64 = 5.0, "times",
        "power of an order of the spindle in what the offered model leaves, over the power that nine in ten frequencies around stay below, from which it is taken out and all searched again",
        "it only opens a second search, which must leave clearly less to stay";

    [Words]
    LINE_SNAP: f64 = 0.5, "line widths",
        "distance within which a line is an order of the spindle",
        "half the resolution of the record";
    HUM_SPREAD: f64 = 0.42, "share",
        "relative spread of the amplitude over the records below which a line hums",
        "a narrow band of noise has 0.52 (Rayleigh)";
    LINE_REST: f64 = 0.1, "ratio",
        "size of a line over that of one nearer than a record resolves, up to which it is what that one left, and from which both are a band of noise",
        "judgement: a frequency is found to a thousandth of what a record resolves";
    HUM_COHERENCE: f64 = 0.5, "coherence",
        "coherence of the halves of all records from which a line hums",
        "noise of the band's width has none";
    HUM_FADES: f64 = 3.0, "ratio",
        "power of one half over the other up to which a hum is steady",
        "judgement: a hum neither fades nor swells";
    HUM_PERIODS: f64 = 6.0, "periods",
        "periods in the shortest record from which a line hums",
        "judgement: drag that changes with each start looks like a period or two";
    MAINS_MULTIPLES: f64 = 12.0, "multiples",
        "multiples of the mains that are taken for hum",
        "rectifiers give 6 and 12";
    MAINS_OFF_HZ: f64 = 0.2, "Hz",
        "distance from a multiple within which a frequency is one",
        "judgement: mains wander by a tenth of a hertz";
    CORNERS_TOLD: f64 = 4.0, "twice log-likelihood",
        "fall that tells two corners",
        "the 95 % interval of one number, rounded up from 3.84";

    [Caution]
    PUSHED_RECORDS: f64 = 0.25, "share",
        "fit records that may carry a push",
        "more often it is how the machine is";
    PUSH_BY_AMPLIFIER: f64 = 0.7, "share",
        "gain of a push from which an amplifier that bends the commands explains it as well",
        "repeats differ at a limit too";
    PUSH_STAYS: f64 = 0.3, "share",
        "gain under the refit that a push must keep under the final model",
        "what the final model explains was no push";
}
