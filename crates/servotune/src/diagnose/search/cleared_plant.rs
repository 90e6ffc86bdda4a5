//! A plant cleared of what acted while it was fitted: body, delay and one law, or a curve without a name, together, by the balance of torques.
//!
//! In: records and the given plant, of which nothing but its modes is used: where it was fitted under dry friction or a dead band, gain and delay may be
//! anything. Out: the plant from which the search sets out. What explains most is fitted by plain simulation and kept only where it
//! simulates far better than the best linear plant. It names nothing: the search begins anew from the plant alone.

use super::curve_balance::curves;
use super::torque_balance::{Balance, Balanced, SLOWEST_RAD_S, SMOOTHINGS, recorded_means, with_freedom};
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::refit;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_problem::{Problem, descended};
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::fit::simulation::size;
use crate::diagnose::free_form::estimation::Curved;
use crate::diagnose::rules::{CLEARED_BETTER, CLEARED_BY_CURVE, CLEARED_FAR, CLEARED_FULLER, CLEARED_TELLS};
use crate::lti::{Body, Plant};
use crate::physics::{AnyLaw, Setting};

/// Laws that are tried by simulation, as they stand and fitted.
const TRIED: usize = 16;
const FITTED: usize = 3;
/// Speeds at which the arm surely slides, over what the sensor's noise makes of the smoothed speed at rest: where it may stick, a drag is
/// whatever holds it, and its rows tell of no law. Both balances are tried.
const SLIDES: [f64; 2] = [0.0, 6.0];

/// Curves that are tried by simulation where no law clears the plant as well.
const CURVES: usize = 2;

/// A plant from which the search sets out, and what it was cleared of.
pub(in crate::diagnose) struct Cleared {
    pub plant: Plant,
    /// The law, where it has a name.
    pub law: Option<SelectedEffect>,
    /// Whether it was a curve without one.
    pub curve: bool,
}

/// The plant to set out from, where the given one conceals what acts; none where the given one, or a refit of it, does.
pub(in crate::diagnose) fn cleared(
    bench: &DiagnosisData,
    iterations: usize,
    say: &mut dyn FnMut(&str),
) -> Option<Cleared> {
    let means = recorded_means(bench);
    let balances = SMOOTHINGS.iter().flat_map(|&w| SLIDES.map(|s| Balance::of(bench, &means, w, s)));
    let mut laws: Vec<(f64, Balanced)> = balances.flat_map(|b| b.laws()).collect();
    let bent = curves(&SMOOTHINGS.map(|w| Balance::of(bench, &means, w, 0.0)));
    let bent: Vec<Curved> = bent.into_iter().filter(|c| c.share < CLEARED_TELLS).collect();
    let nothing_bends = bent.is_empty() && laws.iter().all(|(_, b)| b.law.is_none());
    let zero = vec![0.0; bench.form.knobs.len()];
    let near = bench.fit(vec![]).cost(&zero) < CLEARED_FAR * CLEARED_FAR * bench.stack.total as f64;
    if laws.is_empty() || nothing_bends && near {
        return None;
    }
    let mut own = bench.clone();
    let linear = refit(&mut own, iterations);
    let whole: Vec<(&Run, usize)> = means.iter().zip(&own.stack.segments).map(|(m, s)| (m, s.runs.len())).collect();
    let mut given = linear.clone();
    given.refitted.p.fill(0.0);
    let plain = |b: &DiagnosisData, m: &Model| {
        let mut problem = Problem::plain_error(b, m, None, &whole);
        let x = problem.start();
        size(&problem.settle(&x))
    };
    let samples: f64 = whole.iter().map(|(r, n)| (r.len() * n) as f64).sum();
    let least =
        [plain(&own, &linear), plain(&own, &given)].into_iter().filter(|v| v.is_finite()).fold(f64::MAX, f64::min);
    // Sums of squares count in the sensor's noise.
    if least < CLEARED_FAR * CLEARED_FAR * samples {
        return None;
    }
    say("a plant cleared of what bends it");
    laws.sort_by(|a, b| a.0.total_cmp(&b.0));
    laws.truncate(TRIED);
    let model_of = |b: &Balanced| -> Option<(DiagnosisData, Model)> {
        let ground = around(&own, &b.plant);
        let zero = vec![0.0; ground.form.knobs.len()];
        let mut model = linear.clone();
        model.chosen = b.law.iter().cloned().collect();
        (model.refitted.p, model.refitted.plant) = (zero, b.plant.clone());
        Some((ground, model))
    };
    let mut tried: Vec<(f64, DiagnosisData, Model)> = Vec::new();
    for (_, b) in &laws {
        if let Some((ground, model)) = model_of(b) {
            let left = plain(&ground, &model);
            if left.is_finite() {
                tried.push((left, ground, model));
            }
        }
    }
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut settled: Vec<(f64, DiagnosisData, Model)> = Vec::new();
    for (left, ground, model) in tried.into_iter().take(FITTED) {
        let fitted = descended(&ground, &model, None, &whole).unwrap_or(model);
        settled.push((plain(&ground, &fitted).min(left), ground, fitted));
    }
    settled.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best: Option<(f64, Cleared)> = None;
    let cleared = |ground: &DiagnosisData, m: &Model| Cleared {
        plant: not_too_slow(ground.form.plant(&m.refitted.p)),
        law: m.chosen.first().cloned(),
        curve: false,
    };
    if let Some((least, ground, model)) = settled.first() {
        best = Some((*least, cleared(ground, model)));
        let fuller = |law: &SelectedEffect| {
            let of = |full: AnyLaw| SelectedEffect {
                setting: Setting::new(full, law.setting.strengths.clone()),
                ..law.clone()
            };
            law.setting.law.fuller(&own.scene).into_iter().map(of).collect::<Vec<_>>()
        };
        for full in model.chosen.first().map(fuller).unwrap_or_default() {
            let model = Model { chosen: vec![with_freedom(full, &own.scene)], ..model.clone() };
            let Some(fitted) = descended(ground, &model, None, &whole) else { continue };
            let after = plain(ground, &fitted);
            if after < CLEARED_FULLER * best.as_ref().map_or(f64::MAX, |b| b.0) {
                best = Some((after, cleared(ground, &fitted)));
            }
        }
    }
    let most = best.as_ref().map_or(f64::INFINITY, |b| b.0);
    for c in bent.into_iter().take(CURVES) {
        let Some(setting) = c.shape.effect() else { continue };
        let ground = around(&own, &c.plant);
        let mut model = linear.clone();
        model.chosen = vec![SelectedEffect { setting, continuous: Vec::new(), range: Vec::new(), step: 0 }];
        (model.refitted.p, model.refitted.plant) = (vec![0.0; ground.form.knobs.len()], c.plant);
        if !plain(&ground, &model).is_finite() {
            continue;
        }
        let fitted = descended(&ground, &model, None, &whole).unwrap_or(model);
        let left = plain(&ground, &fitted);
        if left < CLEARED_BY_CURVE * most && left < best.as_ref().map_or(f64::INFINITY, |b| b.0) {
            best = Some((left, Cleared { law: None, curve: true, ..cleared(&ground, &fitted) }));
        }
    }
    best.filter(|(left, _)| *left < CLEARED_BETTER * CLEARED_BETTER * least).map(|(_, cleared)| cleared)
}

/// The same acceleration and viscous rate on a spring that a plant may have: a fit may end at none.
fn not_too_slow(plant: Plant) -> Plant {
    let Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } = plant.body else { return plant };
    let by = SLOWEST_RAD_S / w;
    if by <= 1.0 {
        return plant;
    }
    let (dc_gain, damping_ratio) = (dc_gain / (by * by), damping_ratio / by);
    Plant { body: Body::SecondOrder { dc_gain, natural_frequency_rad_s: SLOWEST_RAD_S, damping_ratio }, ..plant }
}

/// The same ground around another plant, for simulations of plain errors: its noise and its motion stay.
fn around(bench: &DiagnosisData, plant: &Plant) -> DiagnosisData {
    let mut ground = bench.clone();
    ground.form = crate::diagnose::data::linear_form::LinearForm::new(plant, bench.scene.sample_time_s);
    ground.scene.plant = plant.clone();
    ground
}
