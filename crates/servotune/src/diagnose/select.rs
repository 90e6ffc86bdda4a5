//! Which effects the model lacks: scan, refit with each of the best, keep the best, scan again.

use super::bench::Bench;
use super::bootstrap::{Bootstrap, bootstrap};
use super::deep::{FELT, by_simulation_first, deep, felt_scan, felt_trial, foretold, scan, together};
use super::fitted::{fitted, fitted_from_both, refit, settled, taken_by_last};
use super::leftover::{Leftover, leftover};
use super::locked::follows_motion;
use super::name::same_drag;
use super::refit::{Chosen, Refitted};
use super::rival::{Rival, by_simulation, numbers as free_numbers};
use super::rules::{
    BESIDE_DRAG, CONFOUNDED, CONFOUNDED_NEAR_NOISE, DOWN_TO_NOISE, EXPLAINS, FALSE_ALARM, FAR_FROM_NOISE,
    FORM_OF_SIMULATED, FOURTH_ADDS, GAIN_WITHOUT_REPEATS, LINEAR_FURTHER, LINEAR_OF_GAIN, MIXTURE_LAWS, MIXTURE_LEADS,
    NEAR_NOISE, OWN_OF_RECORD, REST_BESIDE_DRAG, SECOND_ADDS, THIRD_ADDS,
};
use super::scan::{Candidate, log_tail};
use super::settle::{exchange, prune, spare};
use super::simulated::simulated;
use crate::physics::{Effect, Setting};

/// How the search decides.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectSettings {
    /// Most effects at once.
    pub most: usize,
    /// Candidates that are refitted in full after each scan.
    pub refits: usize,
    /// Chance of a false name over the whole search.
    pub false_alarm: f64,
    /// Share of the error in excess of noise that each further effect must explain.
    pub share: f64,
    /// Iterations of each refit.
    pub iterations: usize,
    /// Draws of the parametric bootstrap; 0 for none.
    pub bootstrap: usize,
    /// Whether laws are fitted by simulation before one is taken, where none comes near the noise.
    pub by_simulation: bool,
}

impl Default for SelectSettings {
    fn default() -> SelectSettings {
        SelectSettings {
            most: 4,
            refits: 5,
            false_alarm: FALSE_ALARM,
            share: EXPLAINS,
            iterations: 8,
            bootstrap: 0,
            by_simulation: true,
        }
    }
}

/// A model that was fitted: effects, linear parameters and what is left.
#[derive(Clone)]
pub struct Model {
    /// Effects.
    pub chosen: Vec<Chosen>,
    /// Where the refit ended.
    pub refitted: Refitted,
    /// Sum of squares of the whitened error.
    pub cost: f64,
    /// Minus twice the logarithm of the likelihood, up to a constant: `cost` where the noise is known from repeats; where it is
    /// not, a model that leaves less is one under less noise, and the noise's own level counts.
    pub evidence: f64,
    /// Samples less directions used up.
    pub freedom: f64,
    /// Standard deviation of the cost under noise alone, the noise's own level being an estimate from so many repeats.
    pub sigma: f64,
}

impl Model {
    /// Whether a machine can be so in every one of its effects.
    pub(super) fn possible(&self) -> bool {
        let knobs = self.refitted.p.len();
        let mut from = knobs;
        self.chosen.iter().all(|c| {
            let count = if c.effect.facts().fixed { 0 } else { c.setting.strengths.len() };
            let errors: Vec<f64> = (from..from + count).map(|i| self.refitted.spread(i)).collect();
            from += count;
            c.effect.possible(&c.setting, &errors)
        })
    }

    /// The error in excess of the noise, in units of the noise's variance.
    pub fn excess(&self) -> f64 {
        self.cost - self.freedom
    }

    /// The excess over its own standard deviation under noise alone.
    pub fn excess_sigma(&self) -> f64 {
        self.excess() / self.sigma
    }
}

/// One step of the search.
#[derive(Clone)]
pub struct Step {
    /// Sum of squares of the whitened error before it.
    pub before: f64,
    /// The scan, best first; refined where it was worth it.
    pub candidates: Vec<Candidate>,
    /// The full refits: index into the candidates and the model.
    pub tried: Vec<(usize, Model)>,
    /// Which of the tried was taken.
    pub taken: Option<usize>,
}

/// The whole search.
#[derive(Clone)]
pub struct Selection {
    /// The given plant, nothing refitted.
    pub given: f64,
    /// The linear refit.
    pub baseline: Model,
    /// Steps in order.
    pub steps: Vec<Step>,
    /// Where the search ended.
    pub model: Model,
    /// The same fitted once more by simulation, where that holds: what numbers and corrected plant are taken from.
    pub simulated: Option<Model>,
    /// For each effect of the model, others in its place.
    pub rivals: Vec<Vec<Rival>>,
    /// What is still seen in the error of the final model, beyond chance.
    pub leftover: Option<Leftover>,
    /// The search on records without physics, where it was asked for.
    pub bootstrap: Option<Bootstrap>,
}

impl Selection {
    /// The model that leaves less, along the recorded motion or simulated.
    pub fn best(&self) -> &Model {
        if self.last().cost < self.model.cost { self.last() } else { &self.model }
    }

    /// What effect `at` of the model explained when it was taken: fall of minus twice the logarithm of the likelihood.
    pub fn gain(&self, at: usize) -> f64 {
        gain_of(&self.steps, &self.model.chosen[at])
    }

    /// Whether several laws share the work and none leads: one thing that the library lacks is likelier than so many that it has. Says
    /// something only where repeats tell what noise is: otherwise what laws explain is told in logarithms, not in shares.
    pub fn mixture(&self) -> bool {
        let gains: Vec<f64> = (0..self.model.chosen.len()).map(|at| self.gain(at)).collect();
        gains.len() >= MIXTURE_LAWS
            && gains.iter().copied().fold(0.0, f64::max) < MIXTURE_LEADS * gains.iter().sum::<f64>()
    }

    /// The model that numbers are taken from.
    pub fn last(&self) -> &Model {
        self.simulated.as_ref().unwrap_or(&self.model)
    }
}

/// Share of what is explained already that a first, second, third and fourth effect must add.
pub(super) const MINOR: [f64; 4] = [0.0, SECOND_ADDS, THIRD_ADDS, FOURTH_ADDS];

/// What an effect explained when it was taken.
pub(super) fn gain_of(steps: &[Step], chosen: &Chosen) -> f64 {
    let step = &steps[chosen.step];
    step.taken.map_or(0.0, |t| step.before - step.tried[t].1.evidence)
}

/// Searches the library for what the linear model lacks.
pub fn select(
    bench: &mut Bench,
    library: &[&'static dyn Effect],
    settings: &SelectSettings,
    mut progress: impl FnMut(&str),
) -> Selection {
    let zero = vec![0.0; bench.form.knobs.len()];
    let mut given = bench.fit(vec![]).cost(&zero);
    progress("refit of the linear parameters");
    let mut baseline = refit(bench, settings.iterations);
    let calibration = (settings.bootstrap > 0).then(|| {
        progress("bootstrap: the search on records without physics");
        bootstrap(bench, library, &baseline, settings.iterations, settings.false_alarm, settings.bootstrap)
    });
    let mut model = baseline.clone();
    let (mut steps, mut retraced) = (Vec::new(), 0);
    // Whether the model stands by simulation: along a noisy motion its laws fall far short of themselves.
    let mut felt = false;
    let limit = settings.false_alarm.ln();
    while model.chosen.len() < settings.most {
        progress(&format!("scan of {} effects for finding {}", library.len(), model.chosen.len() + 1));
        let mut step = if felt { felt_scan(bench, library, &model) } else { scan(bench, library, &model) };
        let concealed = if model.excess_sigma() < NEAR_NOISE { CONFOUNDED_NEAR_NOISE } else { CONFOUNDED };
        let price = (bench.stack.total as f64).ln();
        // Two forms of the leading effect, one of each other: the one that is worth its numbers most. Each number of a law is paid for (Schwarz
        // 1978): of two that fit alike, the one with fewer.
        let best_form = |c: &Candidate| {
            let net = |c: &Candidate| c.gain - price * free_numbers(&c.chosen(0)) as f64;
            let forms = step.candidates.iter().filter(|o| o.effect.facts().name == c.effect.facts().name);
            forms.map(net).fold(f64::NEG_INFINITY, f64::max) <= net(c)
        };
        let mut worth: Vec<usize> = Vec::new();
        for (i, c) in step.candidates.iter().enumerate() {
            let name = c.effect.facts().name;
            let seen = worth.iter().filter(|&&j| step.candidates[j].effect.facts().name == name).count();
            let leads = worth.first().is_none_or(|&j| step.candidates[j].effect.facts().name == name);
            let new = model.chosen.iter().all(|m| {
                let other = m.effect.facts().name;
                !same_drag(name, other) && (other != name || again(c, &m.setting))
            });
            // A push falls into one record; what every repeat shows at the same time is none.
            let new = new && (name != "shock" || bench.stack.segments.iter().any(|s| s.runs.len() == 1) || together(c));
            if new
                && c.effect.possible(&c.setting, &[])
                && (c.log_p_value(library.len()) < limit && hums(bench, c, c.gain, library.len()) < limit
                    || (!bench.levels.from_repeats && c.gain > GAIN_WITHOUT_REPEATS))
                && c.concealed < concealed
                && match (leads, seen) {
                    (true, 0) => true,
                    (true, 1) => best_form(c) || best_form(&step.candidates[worth[0]]),
                    (false, 0) => best_form(c),
                    _ => false,
                }
                && (worth.len() < settings.refits
                    || c.effect.drag() && seen == 0 && model.excess_sigma() > FAR_FROM_NOISE)
            {
                worth.push(i);
            }
        }
        if felt {
            worth.truncate(FELT);
        }
        for &i in &worth {
            progress(&format!("refit with {}", step.candidates[i].effect.facts().name));
            let c = &step.candidates[i];
            let mut chosen = model.chosen.clone();
            chosen.push(c.chosen(steps.len()));
            if felt {
                step.tried.extend(felt_trial(bench, &model, chosen).map(|m| (i, m)));
                continue;
            }
            let mut tried = fitted_from_both(bench, &chosen, &model.refitted.p, settings.iterations);
            if !bench.levels.from_repeats {
                tried = settled(bench, tried, settings.iterations);
            }
            if tried.possible() && !follows_motion(bench, &tried, tried.chosen.len() - 1) {
                step.tried.push((i, tried));
            }
        }
        let first = settings.by_simulation && model.chosen.is_empty();
        let to_the_end = first && (foretold(bench, &model, &mut step) || deep(&step));
        if to_the_end && bench.foretold.is_none() {
            by_simulation_first(bench, &mut step);
        }
        // Repeats take part with their mean: what differs from record to record by its nature is no first thought.
        let paid = |t: &(usize, Model)| {
            let c = &step.candidates[t.0];
            let begun = begun(bench, &c.setting.inner, c.effect);
            let own = c.effect.facts().per_record || begun > 0;
            let dearer = if own { OWN_OF_RECORD * (model.evidence - t.1.evidence).max(0.0) } else { 0.0 };
            t.1.evidence + price * (numbers(c) + begun as f64) + dearer
        };
        step.taken = (0..step.tried.len()).min_by(|&a, &b| paid(&step.tried[a]).total_cmp(&paid(&step.tried[b])));
        let accepted = step.taken.and_then(|t| {
            let (i, next) = &step.tried[t];
            let c = &step.candidates[*i];
            let mut gain = model.evidence - next.evidence;
            if !bench.levels.from_repeats {
                gain = gain.min(taken_by_last(bench, next, settings.iterations));
            }
            let free = c.strengths.max(1) + begun(bench, &c.setting.inner, c.effect);
            let log_p = log_tail(gain, free) + (c.points.max(1) as f64).ln() + (library.len() as f64).ln();
            let log_p = log_p.max(hums(bench, c, gain, library.len()));
            let explained = (baseline.evidence - model.evidence).max(0.0);
            let dragged = model.chosen.iter().any(|c| c.effect.drag());
            let share = if dragged && gain < BESIDE_DRAG * explained { REST_BESIDE_DRAG } else { settings.share };
            let asked = share * (model.excess() - 2.0 * model.sigma).max(0.0);
            let minor = MINOR.get(model.chosen.len()).copied().unwrap_or(0.0) * explained;
            (log_p < limit && gain > asked && gain > minor).then(|| next.clone())
        });
        if accepted.is_none() {
            step.taken = None;
        }
        // A gain that the linear parameters alone would have made is none of the law's: the model without it had not come to its end.
        if let Some(next) = accepted.as_ref().filter(|_| retraced < AGAIN && !felt) {
            let mut without = fitted(bench, model.chosen.clone(), &next.refitted.p, settings.iterations);
            if !bench.levels.from_repeats {
                without = settled(bench, without, settings.iterations);
            }
            let linear = model.evidence - without.evidence;
            if linear > LINEAR_FURTHER.max(LINEAR_OF_GAIN * (model.evidence - next.evidence)) {
                if model.chosen.is_empty() {
                    baseline = without.clone();
                }
                (model, retraced) = (without, retraced + 1);
                continue;
            }
        }
        steps.push(step);
        match accepted {
            Some(next) => {
                bench.correct(&next.refitted.p, &next.chosen);
                if !bench.levels.from_repeats {
                    bench.renew(&next.refitted.p, &next.chosen);
                }
                model = fitted(bench, next.chosen.clone(), &next.refitted.p, settings.iterations);
                // What its column along a noisy motion falls short by is nobody's: from here on simulation tells.
                if (felt || to_the_end) && model.cost > next.cost {
                    (model, felt) = (next, true);
                    if model.excess_sigma() < DOWN_TO_NOISE || model.excess() < FORM_OF_SIMULATED * baseline.excess() {
                        break;
                    }
                }
            }
            None => break,
        }
    }
    if !felt {
        prune(bench, &mut model, baseline.cost, settings.iterations);
    }
    progress("rivals of the findings");
    let mut rivals = exchange(bench, &mut model, &steps, settings.iterations);
    // A law that has found its place may do what another was there for.
    let before = model.chosen.len();
    if !felt {
        prune(bench, &mut model, baseline.cost, settings.iterations);
    }
    if model.chosen.len() < before {
        rivals = exchange(bench, &mut model, &steps, settings.iterations);
    }
    if !bench.levels.from_repeats && !model.chosen.is_empty() {
        // By the noise that the best model leaves, what the others left too.
        given = bench.fit(vec![]).cost(&zero);
        baseline = fitted(bench, vec![], &baseline.refitted.p, settings.iterations);
    }
    if baseline.cost > given {
        baseline.cost = given;
    }
    progress("fit by simulation");
    let mut simulated = simulated(bench, &model);
    if let Some(s) = &mut simulated {
        spare(bench, &mut model, s, &mut rivals, &steps, baseline.cost, settings.iterations);
        by_simulation(bench, &mut model, s, &mut rivals, &steps);
    }
    let leftover = leftover(bench, library, &model, simulated.as_ref(), &steps, (baseline.cost, limit));
    Selection { given, baseline, steps, model, simulated, rivals, leftover, bootstrap: calibration }
}

/// Numbers of each record's own that an effect brings with it: motions that a record may begin in.
pub(super) fn begun(bench: &Bench, inner: &[f64], effect: &dyn Effect) -> usize {
    effect.free(inner, &bench.scene, 1).len() * bench.stack.segments.len()
}

/// Most times that a step is made again because the model before it was not at its best.
const AGAIN: usize = 3;

/// Free numbers of a candidate.
fn numbers(c: &Candidate) -> f64 {
    let strengths = if c.effect.facts().fixed { 0 } else { c.setting.strengths.iter().filter(|s| **s != 0.0).count() };
    (strengths + c.setting.inner.iter().filter(|v| **v != 0.0).count()) as f64
}

/// Logarithm of the chance of a hum's gain where the noise itself is stronger near its frequency, a narrow band of it being no hum;
/// -infinity for all other effects.
pub(super) fn hums(bench: &Bench, c: &Candidate, gain: f64, effects: usize) -> f64 {
    if c.effect.facts().name != "line_disturbance" {
        return f64::NEG_INFINITY;
    }
    let fair = Candidate { gain: gain / bench.noise_near(c.setting.inner[0]), ..c.clone() };
    fair.log_p_value(effects)
}

/// Whether a second one of the same effect can be another thing: another line, another mode.
fn again(c: &Candidate, first: &Setting) -> bool {
    c.effect.several() && (first.inner[0] - c.setting.inner[0]).abs() > 0.02 * first.inner[0].abs()
}

/// Logarithm of the closed-form bound of the strongest candidate beside a model.
pub(super) fn strongest(bench: &Bench, library: &[&'static dyn Effect], model: &Model) -> f64 {
    let step = scan(bench, library, model);
    let possible = step.candidates.iter().filter(|c| c.effect.possible(&c.setting, &[]) && c.concealed < CONFOUNDED);
    possible.map(|c| c.log_p_value(library.len())).fold(0.0, f64::min)
}
