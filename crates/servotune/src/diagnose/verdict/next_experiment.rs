//! What to record next, and how well it would tell the survivors apart.

use super::finding::{NextExperiment, Verdict};
use super::judgement::Judgement;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::error;
use crate::diagnose::noise::whitening::Whitener;
use crate::diagnose::search::selection::Selection;
use crate::physics::facts;

/// Scales of the existing excitations that are tried.
const SCALES: [f64; 4] = [0.3, 1.0, 2.0, 4.0];

/// Reach over the largest position on record beyond which nobody would let the machine go.
const STROKE: f64 = 2.0;

/// Proposes the record that tells the final model best from its strongest rival: the existing excitations at other sizes
/// (T-optimality over a catalogue; Atkinson & Fedorov 1975), by simulating both and counting the whitened difference.
pub(in crate::diagnose) fn propose(judged: &Judgement, data: &DiagnosisData, selection: &Selection) -> NextExperiment {
    let standing = match judged.verdict {
        Verdict::DataFault => "record again with the log repaired; every other verdict rests on it".to_owned(),
        Verdict::Undecidable => {
            "the same excitation at least four times: what repeats differ by is noise, the rest is the machine".to_owned()
        }
        Verdict::NoMismatch | Verdict::Refit => {
            "the same excitation at a third and at three times its size: a linear machine scales, friction and limits do not".to_owned()
        }
        _ => judged.findings.first().and_then(|f| facts(&f.effect)).map_or_else(
            || "the same excitation at three sizes, in three zones of the stroke".to_owned(),
            |f| f.experiment.to_owned(),
        ),
    };
    let final_model = &selection.model;
    // The rival: the runner-up of the first step, or the linear refit.
    let rival = selection.steps.first().and_then(|s| {
        let taken = s.taken?;
        let best = s.tried[taken].1.chosen.last()?.setting.facts().name;
        let others = s.tried.iter().filter(|t| t.1.chosen.last().is_some_and(|c| c.setting.facts().name != best));
        others.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost)).map(|t| &t.1)
    });
    let rival = rival.unwrap_or(&selection.baseline);
    let mut best = (0.0, 1.0, 0usize);
    if !final_model.chosen.is_empty() {
        for (i, run) in data.means.iter().enumerate() {
            for scale in SCALES {
                let mut test: Run = run.clone();
                test.input.iter_mut().for_each(|u| *u *= scale);
                (test.before, test.origin) = (scale * test.before, scale * test.origin);
                let separation = difference(data, &test, final_model, rival);
                if separation > best.0 {
                    best = (separation, scale, i);
                }
            }
        }
    }
    let what = if best.0 > 0.0 {
        format!(
            "{standing}; of the excitations at hand, `{}` at {:.1} times its size separates most",
            data.means[best.2].name, best.1
        )
    } else {
        standing
    };
    NextExperiment { what, expected_separation: best.0 }
}

fn difference(
    data: &DiagnosisData,
    run: &Run,
    a: &crate::diagnose::fit::model::Model,
    b: &crate::diagnose::fit::model::Model,
) -> f64 {
    let simulate = |m: &crate::diagnose::fit::model::Model| {
        let fixed = crate::diagnose::fit::corrected_model::corrected(&data.form, &m.refitted.p, &m.chosen, &data.scene);
        error(&SimulatedModel::of(&fixed.plant, &fixed.effects, &data.scene), run, None).ok()
    };
    let (Some(x), Some(y)) = (simulate(a), simulate(b)) else { return 0.0 };
    // A record that would leave the stroke is no proposal.
    let reach = |e: &[f64]| run.position.iter().zip(e).map(|(y, e)| (y - e).abs()).fold(0.0, f64::max);
    if !(reach(&x) < STROKE * data.scene.travel && reach(&y) < STROKE * data.scene.travel) {
        return 0.0;
    }
    let mut off: Vec<f64> = x.iter().zip(&y).map(|(x, y)| x - y).collect();
    let whitener: &Whitener = &data.whitener;
    whitener.apply(&mut off);
    let sum: f64 = off.iter().map(|v| v * v).sum();
    if sum.is_finite() { sum } else { 0.0 }
}
