//! A curve in the place of the law that has no name: taken where it foretells clearly better than any linear plant and simulates no record
//! worse that was not used.
//!
//! In: a diagnosis that ended without a name. Out: the corrected model with the curve, its errors, and what diagnosis.json says of it;
//! a reading that folds or ends at limits has a name and is found here too.

use super::finding::{Estimate, Finding};
use super::judgement::{Judgement, Later};
use super::naming::everywhere;
use crate::controller::ControlLaw;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::{Corrected, entry};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::simulation::{errors, rms};
use crate::diagnose::free_form::curve::FreeFormFound;
use crate::diagnose::free_form::estimation::{Curved, Estimated, estimated, grounds};
use crate::diagnose::free_form::foretelling::Foretelling;
use crate::diagnose::free_form::gauge::Plain;
use crate::diagnose::free_form::likeness::likeness;
use crate::diagnose::free_form::shape::{Shape, lag};
use crate::diagnose::free_form::stretches::Stretches;
use crate::diagnose::free_form::surface_likeness::surface_likeness;
use crate::diagnose::rules::{
    CURVE_CLEARLY, CURVE_NAMED, CURVE_NEAR, CURVE_NO_WORSE, LOADING_FALLS, LOADING_LEVEL, NAMED_SHARE,
};
use crate::diagnose::search::curve_balance::{curves, surface};
use crate::diagnose::search::selection::Selection;
use crate::diagnose::search::torque_balance::{Balance, SMOOTHINGS, recorded_means};
use crate::lti::{CurveKnot, Plant};
use crate::physics::pivot_friction::{HELD, dahl_length};
use crate::physics::sensor_curve::{self, SensorCurve};
use crate::physics::{CurvePort, Facts, LawSetting, coulomb_friction, pivot_friction, shortest_loop};

/// A model with a curve.
pub(in crate::diagnose) struct StandIn {
    /// It.
    pub corrected: Corrected,
    /// Recorded less simulated position of every run: as the report shows it, and in open loop.
    pub errors: [Vec<Vec<f64>>; 2],
    /// What is said of it; none where what was found has a name.
    pub curve: Option<FreeFormFound>,
    /// What was found, where it has a name.
    pub finding: Option<Finding>,
}

/// What both figures of a simulation are judged by.
pub(in crate::diagnose) struct Standing<'a> {
    /// The controller, where records are shown in closed loop.
    pub closed: Option<&'a ControlLaw<'a>>,
    /// Errors of all runs under the given plant, the linear refit and the laws that were found.
    pub errors: &'a [Vec<Vec<f64>>; 3],
    /// What of the records counts as noise (rms).
    pub floor: f64,
    /// Whether names stand, which only a far better curve outdoes: none is then sought on short pieces.
    pub named: bool,
}

/// Looks for a curve and takes it where it is worth it: on whole records, then in the loop that they were recorded in, then on short pieces of
/// them, for a law under which simulations of whole records part. It is estimated on the ground of the search, which may be of excerpts, and
/// judged on the same with whole runs.
pub(in crate::diagnose) fn stand_in(
    [data, whole]: [&DiagnosisData; 2],
    selection: &Selection,
    standing: &Standing,
    progress: &mut dyn FnMut(&str),
) -> Option<StandIn> {
    let [ground, one_place] = grounds(data);
    let (starts, balanced) = (starts(data, selection), balanced(data));
    let on = |ground: &Stretches, sensor: Option<&Stretches>, progress: &mut dyn FnMut(&str)| {
        let found = estimated(data, (ground, sensor), &starts, &balanced, progress)?;
        stands(whole, &found, &one_place, standing)
    };
    on(&ground, Some(&one_place), progress)
        .or_else(|| {
            progress("a curve without a name, in the loop of the records");
            on(&ground.in_loop(standing.closed?), None, progress)
        })
        .or_else(|| {
            let pieces = ground.in_short_pieces(data.scene.sample_time_s).filter(|_| !standing.named)?;
            progress("a curve without a name, on short pieces of the records");
            on(&pieces, None, progress)
        })
}

/// What was estimated, where it is worth it.
fn stands(data: &DiagnosisData, found: &Estimated, one_place: &Stretches, standing: &Standing) -> Option<StandIn> {
    let best = taken(found)?;
    let model = model(data, best, &found.plain);
    let errors = [standing.closed, None].map(|closed| shown(data, &model, best, one_place, closed));
    let which = data.judging();
    let of = |e: &[Vec<f64>]| rms(&which.iter().map(|&i| e[i].clone()).collect::<Vec<_>>());
    let [given, refit, laws] = [0, 1, 2].map(|m| of(&standing.errors[m]));
    let (linear, after) = (given.min(refit), of(&errors[0]));
    if !(after.is_finite() && after <= CURVE_NO_WORSE * linear && (after <= CURVE_NEAR * laws || laws >= linear)) {
        return None;
    }
    let floor = standing.floor.min(after);
    let explained_share =
        1.0 - (after * after - floor * floor) / (linear * linear - floor * floor).max(f64::MIN_POSITIVE);
    let reading = found.reading.as_ref().map(|_| reading_finding(data, best, found));
    let near = explained_share >= NAMED_SHARE && after <= CURVE_NAMED * standing.floor;
    let finding = reading.or_else(|| bearing_finding(data, best, found).filter(|_| near));
    let curved = matches!(best.trial.shape, Shape::Curve(..));
    let named = finding.is_some();
    let curve = curved.then(|| described(data, found, explained_share.clamp(-1.0, 1.0), named));
    Some(StandIn { corrected: model, errors, curve, finding })
}

/// What is taken of an estimate: the curve where it foretells clearly better than what stands without it, a named reading or the linear
/// plant; else the reading alone, if that does; else nothing.
fn taken<'e, 'a>(found: &'e Estimated<'a>) -> Option<&'e Foretelling<'a>> {
    let linear = CURVE_CLEARLY * found.linear.left_out;
    match &found.reading {
        None => Some(&found.curve).filter(|c| c.left_out <= linear),
        Some(r) if found.curve.left_out <= CURVE_CLEARLY * r.left_out && found.curve.left_out <= linear => {
            Some(&found.curve)
        }
        Some(r) => Some(r).filter(|r| r.left_out <= linear),
    }
}

/// Recorded less simulated position of every run under the model.
fn shown(
    data: &DiagnosisData,
    model: &Corrected,
    best: &Foretelling,
    one_place: &Stretches,
    closed: Option<&ControlLaw>,
) -> Vec<Vec<f64>> {
    if best.trial.reads() && closed.is_none() {
        // Where the arm stands is not known from what is read: every place that gives the first reading is a start.
        let place = &one_place.runs[0];
        let runs: Vec<Run> =
            data.runs.iter().map(|r| Run { origin: place.origin, before: place.before, ..r.clone() }).collect();
        let all = Stretches { blocks: runs.iter().map(|r| (r.len(), 0)).collect(), closed: None, runs };
        return best.trial.clone().over(&all).shown();
    }
    let every: Vec<&Run> = data.runs.iter().collect();
    errors(&model.alone(data), &every, closed)
}

fn knots(c: &Plain) -> Vec<CurveKnot> {
    let off = |i: usize| 1.96 * c.spread[i];
    (0..c.value.len())
        .map(|i| CurveKnot {
            at: c.knots.place(i)[0],
            velocity: c.knots.velocity.get(i % c.knots.velocity.len().max(1)).copied(),
            value: c.value[i],
            low: Some(c.value[i] - off(i)),
            high: Some(c.value[i] + off(i)),
        })
        .collect()
}

/// The plant with everything that the fit put beside it.
fn model(data: &DiagnosisData, best: &Foretelling, c: &Plain) -> Corrected {
    let trial = &best.trial;
    let curved = matches!(trial.shape, Shape::Curve(..));
    let mut plant: Plant = data.form.plant(if curved { &c.p } else { &trial.p });
    let (position, command) = (plant.position_unit.clone(), plant.command_unit.clone());
    let behind = trial.lag_s.filter(|_| curved && c.port == CurvePort::AmplifierOverCommand);
    let mut effects: Vec<LawSetting> = trial.lag_s.filter(|_| behind.is_none()).map(lag).into_iter().collect();
    plant.physics = effects.iter().map(|s| entry(s, &data.scene)).collect();
    if curved {
        let mut curve = c.port.curve(&c.knots, &c.value);
        curve.lag_s = behind;
        plant.physics.push(c.port.entry(knots(c), behind, &position, &command));
        effects.push(LawSetting::fixed(curve));
    }
    if let Some(s) = trial.reading.effect() {
        plant.physics.push(entry(&s, &data.scene));
        effects.push(s);
    }
    Corrected { plant, effects }
}

/// What a curve of this port is called.
pub fn curve_title(port: &str, argument: &str) -> String {
    match (port, argument) {
        ("amplifier", _) => "what the amplifier makes of the command".into(),
        ("gain", argument) => format!("the torque per command over the {argument}"),
        (_, "position_and_velocity") => "a torque over position and velocity".into(),
        (_, "time") => "a torque over the time of every record".into(),
        (_, "loading") => "a torque that resists over the way since the last turn".into(),
        ("sensor", _) => "what the sensor reads of the position".into(),
        (_, argument) => format!("a torque over the {argument}"),
    }
}

fn described(data: &DiagnosisData, found: &Estimated, explained_share: f64, named: bool) -> FreeFormFound {
    let c = &found.plain;
    let form = &data.form.given;
    let [port, argument] = c.port.names();
    let [argument_unit, unit] = c.port.units(&form.position_unit, &form.command_unit);
    let like = match c.port {
        CurvePort::TorqueOverMotion => surface_likeness(c, &argument_unit),
        _ => likeness(c, &argument_unit),
    };
    let what = curve_title(port, argument);
    let beside = if found.reading.is_some() { "beside the reading that was found" } else { "for it" };
    let begin = match named && found.reading.is_none() {
        true => "The law has a loading curve of its own".to_owned(),
        false => format!("A curve without a name stands in {beside}"),
    };
    let says = format!(
        "{begin}: {what}; it is {}. It explains {:.1} % of what the better linear model leaves beyond the noise.",
        like.says,
        100.0 * explained_share
    );
    let root = |f: f64| f.max(0.0).sqrt();
    FreeFormFound {
        port,
        argument,
        argument_unit,
        unit,
        knots: knots(c),
        explained_share,
        says,
        like,
        left_out: [root(found.linear.left_out), root(found.curve.left_out)],
        ports: found.tried.iter().map(|(p, e)| (p.names().join("_over_"), root(*e))).collect(),
    }
}

/// The finding of a reading that folds or ends at limits.
fn reading_finding(data: &DiagnosisData, best: &Foretelling, found: &Estimated) -> Finding {
    let &Facts { name: effect, says, port, .. } = &sensor_curve::FACTS;
    let none = || LawSetting::fixed(SensorCurve::Folded { lowest: 0.0, at: 0.0 });
    let setting = best.trial.reading.effect().unwrap_or_else(none);
    let from = best.trial.reading_from();
    let unit = &data.form.given.position_unit;
    let parameters = setting.parameters(&data.scene).into_iter().enumerate().map(|(i, q)| {
        let off = 1.96 * best.spread(from + i);
        let e = Estimate { value: q.value, low: q.value - off, high: q.value + off, unit: unit.clone() };
        (q.name.to_owned(), e)
    });
    let form = if matches!(best.trial.reading, Shape::Fold(_)) { "It folds" } else { "It ends at limits" };
    let samples = best.trial.stretches.total() as f64;
    // The ratio of the likelihoods of what is foretold, as a chance under noise alone.
    let log_p = -0.5 * samples * (found.linear.left_out / best.left_out).ln();
    let runs: Vec<&Run> = data.fit_runs.iter().map(|&r| &data.runs[r]).collect();
    Finding {
        effect: effect.into(),
        family: vec![effect.into()],
        port,
        p_value: log_p.min(0.0).exp().max(1e-300),
        says: format!("{form}: {says}."),
        parameters: parameters.collect(),
        place: everywhere(&runs),
    }
}

/// The finding of a drag of any loading curve: generalised Maxwell slip, whose sliders all resist.
fn bearing_finding(data: &DiagnosisData, best: &Foretelling, found: &Estimated) -> Option<Finding> {
    let c = &found.plain;
    if c.port != CurvePort::TorqueOverLoading || !matches!(best.trial.shape, Shape::Curve(..)) {
        return None;
    }
    let last = c.value.len() - 1;
    let most = c.value.iter().fold(0.0f64, |m, v| m.max(*v));
    // The deepest fall that the errors of its knots do not make.
    let mut highest = 0.0f64;
    let falls = c.value.iter().zip(&c.spread).fold(0.0f64, |falls, (v, spread)| {
        highest = highest.max(v - 1.96 * spread);
        falls.max(highest - (v + 1.96 * spread))
    });
    // A drag rises with the way until it slides; a spring would go on rising.
    if !(falls < LOADING_FALLS * most && c.value[last / 2] > LOADING_LEVEL * most) {
        return None;
    }
    let [position, command] = [&data.form.given.position_unit, &data.form.given.command_unit];
    let level = Estimate {
        value: c.value[last],
        low: c.value[last] - 1.96 * c.spread[last],
        high: c.value[last] + 1.96 * c.spread[last],
        unit: command.clone(),
    };
    // The way at which the first slope would reach the level; half the level tells the slope better than the first knot.
    let half = (0..=last).find(|&i| c.value[i] >= 0.5 * c.value[last])?;
    let (way, off) = (c.knots.at[half] * c.value[last] / c.value[half], 1.96 * c.spread[half] / c.value[half]);
    let length = Estimate { value: way, low: way * (1.0 - off), high: way * (1.0 + off), unit: position.clone() };
    let held = (0..=last).find(|&i| c.value[i] >= HELD * c.value[last])?;
    let pivot = way.max(dahl_length(c.knots.at[held])) > shortest_loop(&data.scene);
    let facts = if pivot { &pivot_friction::FACTS } else { &coulomb_friction::FACTS };
    let samples = best.trial.stretches.total() as f64;
    let log_p = -0.5 * samples * (found.linear.left_out / best.left_out).ln();
    let runs: Vec<&Run> = data.fit_runs.iter().map(|&r| &data.runs[r]).collect();
    Some(Finding {
        effect: facts.name.into(),
        family: vec![facts.name.into()],
        port: facts.port,
        p_value: log_p.min(0.0).exp().max(1e-300),
        says: format!("{}; its loading curve has a shape of its own.", facts.says),
        parameters: [("level_command".to_owned(), level), ("sliding_length".to_owned(), length)].into(),
        place: everywhere(&runs),
    })
}

impl StandIn {
    /// The judgement with what was found, where it has a name, and with what is said of the curve.
    pub fn entered(&self, judged: Judgement) -> Judgement {
        let judged = match &self.finding {
            Some(f) => judged.after(Later::Instead(f.clone()), Vec::new()),
            None => judged,
        };
        judged.said(self.curve.as_ref().map(|c| c.says.clone()))
    }
}

/// A curve beside a linear plant and nothing else.
pub struct MissingCurve {
    /// It.
    pub curve: FreeFormFound,
    /// Recorded less simulated position of every run in open loop.
    pub errors: Vec<Vec<f64>>,
}

/// The curve at the port where it foretells best, whatever the verdict; none where it foretells no better than a linear plant.
pub fn missing_curve(data: &DiagnosisData, selection: &Selection) -> Option<MissingCurve> {
    let [ground, one_place] = grounds(data);
    let found = estimated(data, (&ground, Some(&one_place)), &starts(data, selection), &balanced(data), &mut |_| {})?;
    let best = taken(&found).filter(|b| matches!(b.trial.shape, Shape::Curve(..)))?;
    let errors = shown(data, &model(data, best, &found.plain), best, &one_place, None);
    let share = 1.0 - best.left_out / found.linear.left_out;
    Some(MissingCurve { curve: described(data, &found, share, false), errors })
}

/// Linear parameters from which curves are looked for: the given plant, the refit, and the plant beside the laws that were found.
fn starts(data: &DiagnosisData, selection: &Selection) -> Vec<Vec<f64>> {
    let mut starts = vec![vec![0.0; data.form.free_parameters.len()]];
    for p in [&selection.baseline.refitted.p, &selection.last().refitted.p] {
        if starts.iter().all(|s| s != p) {
            starts.push(p.clone());
        }
    }
    starts
}

/// Plants and curves by the balance of torques.
fn balanced(data: &DiagnosisData) -> Vec<Curved> {
    let means = recorded_means(data);
    let balances = SMOOTHINGS.map(|width| Balance::of(data, &means, width, 0.0));
    let mut all = curves(&balances);
    all.extend(surface(&balances));
    all
}
