//! The ladder of Table 1 on the paper's machine with 1 % noise, and figures 6, 9 and 12 to 14.

use super::{Study, StudyError};
use servotune::frf::Frf;
use servotune::identify::{IdentifySettings, ZeroSide, identify};
use servotune::lti::{FrequencyResponse, Plant};
use servotune::numeric::random::Random;
use servotune::twin::plants::{log_grid, measure};
use servotune::twin::{MachineClass, paper_machine};
use servotune_report::bode::{BodeCurve, BodeMarks, bode, bode_with_residual};
use servotune_report::figure::Figure;
use servotune_report::identified::{identified_figure, identified_sentences, ladder_table, order_table};
use servotune_report::table::Table;
use std::f64::consts::TAU;

/// Relative noise of the sweep and its seed.
const NOISE: f64 = 0.01;
const SEED: u64 = 1;

/// Makes the study; everything it needs is built in.
pub fn ladder() -> Result<Study, StudyError> {
    let machine = paper_machine(MachineClass::Healthy)?;
    let frf = measure(&machine, &log_grid(40.0, 5000.0, 400), NOISE, &mut Random::new(SEED))?;
    // The paper's seven conditions keep zeros in the left half-plane.
    let id = identify(&frf, &IdentifySettings { zeros: ZeroSide::Left, ..IdentifySettings::default() })?;
    let mut study = Study::default();
    let mut text = format!(
        "# The ladder of Table 1\n\n\
         Made by `lab ladder --out results`. Machine: `specs/machines/healthy.toml`, 400 points from 40 to 5000 Hz, \
         {} % relative complex noise, seed {SEED}.\n\n{}\n",
        100.0 * NOISE,
        identified_sentences(&id).join(" ")
    );
    let block = |t: Table| format!("\n```text\n{}```\n", t.text());
    text += &block(ladder_table(&id)?);
    text += &block(order_table(&id)?);
    text += "\nThe paper's Table 1 prints 808, 206, 114 and 93 on its own unpublished sweep. The norm of eq. (19) is absolute, so it \
             is ruled by the largest response, near 40 Hz; the relative error is the honest column. The last row is ours: all parameters \
             refined jointly on the log response.\n";
    if let Some(steps) = &id.stepwise {
        let base = Plant { delay_s: 0.0, resonance_gain: 1.0, modes: vec![], ..steps.clone() };
        let delayed = Plant { delay_s: steps.delay_s, ..base.clone() };
        let resonant = Plant { resonance_gain: 1.0, ..steps.clone() };
        for (name, title, model) in [
            ("figure_06", "Figure 6: second-order standard form", &base),
            ("figure_09", "Figure 9: second-order standard form with delay", &delayed),
            ("figure_13", "Figure 13: second-order standard form with delay and resonances", &resonant),
            ("figure_14", "Figure 14: with resonance gain", steps),
        ] {
            study.picture(name, &against(&frf, model, title)?);
        }
        study.picture("figure_12", &resonances(&frf, &delayed, steps)?);
        text += "\nPictures: [6](figures/figure_06.svg), [9](figures/figure_09.svg), [12](figures/figure_12.svg), \
                 [13](figures/figure_13.svg), [14](figures/figure_14.svg), [joint refinement](figures/joint_refinement.svg).\n";
    }
    study.picture("joint_refinement", &identified_figure(&frf, &id, "Joint refinement of all parameters")?);
    study.page("ladder.md", text);
    Ok(study)
}

fn hz(frf: &Frf) -> Vec<f64> {
    frf.w_rad_s().iter().map(|w| w / TAU).collect()
}

fn against(frf: &Frf, model: &Plant, title: &str) -> Result<Figure, StudyError> {
    let hz = hz(frf);
    let values: Vec<_> = frf.w_rad_s().iter().map(|&w| model.at(w)).collect();
    let measured = BodeCurve { name: "measured", frequency_hz: &hz, response: frf.value(), relative_std: None };
    let fitted = BodeCurve { name: "model", frequency_hz: &hz, response: &values, relative_std: None };
    Ok(bode_with_residual(title, "", measured, fitted, &BodeMarks::default())?)
}

/// What is left of the measurement after the body and its delay, and the pairs fitted to it.
fn resonances(frf: &Frf, body: &Plant, steps: &Plant) -> Result<Figure, StudyError> {
    let hz = hz(frf);
    let left: Vec<_> = frf.w_rad_s().iter().zip(frf.value()).map(|(&w, v)| v / body.at(w)).collect();
    let pairs: Vec<_> = frf.w_rad_s().iter().map(|&w| steps.modes.iter().map(|m| m.at(w)).product()).collect();
    let curves = [
        BodeCurve { name: "measured over body", frequency_hz: &hz, response: &left, relative_std: None },
        BodeCurve { name: "fitted pairs", frequency_hz: &hz, response: &pairs, relative_std: None },
    ];
    Ok(bode("Figure 12: resonances", "", &curves, &BodeMarks::default())?)
}
