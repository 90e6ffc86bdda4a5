//! The page of a diagnosis says what diagnosis.json says, in words, with units, and needs nothing else.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use servotune::diagnose::{DiagnoseSettings, Diagnosed, Verdict, diagnose};
use servotune::lti::{Body, DiscretePlant, Plant, PlantState};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};
use servotune_report::diagnosis::diagnosis_page;
use std::f64::consts::TAU;
use std::path::PathBuf;

const T: f64 = 1e-4;
const NOISE: f64 = 2e-3;
const LIMIT: f64 = 0.7;

fn plant() -> Plant {
    Plant {
        position_unit: "mrad".into(),
        command_unit: "A".into(),
        body: Body::SecondOrder { dc_gain: 12.0, natural_frequency_rad_s: TAU * 35.0, damping_ratio: 0.3 },
        delay_s: 0.4 * T,
        resonance_gain: 1.0,
        modes: Vec::new(),
        physics: Vec::new(),
    }
}

/// A machine that clips its command at `limit`, driven by a few tones; the name carries what a page must escape.
fn record(role: Role, group: Option<&str>, phase: f64, seed: u64, limit: f64) -> (RecordEntry, Record) {
    let sampled = DiscretePlant::of(&plant(), T).unwrap();
    let mut state = PlantState::at_rest(&sampled);
    let mut random = Random::new(seed);
    let tones = [7.0, 19.0, 43.0, 97.0, 230.0, 610.0];
    let command: Vec<f64> = (0..3000)
        .map(|k| {
            tones.iter().enumerate().map(|(j, f)| 0.25 * (TAU * f * T * f64::from(k) + phase * j as f64).sin()).sum()
        })
        .collect();
    let position = command
        .iter()
        .map(|u: &f64| {
            let y = state.position() + NOISE * random.normal();
            state.command(u.clamp(-limit, limit));
            state.advance(&sampled);
            y
        })
        .collect();
    let file = PathBuf::from(format!("tones<{seed}>.csv"));
    let n = command.len();
    let record = Record {
        file: file.clone(),
        sample_time_s: T,
        gaps: Vec::new(),
        reference: None,
        excitation: vec![0.0; n],
        command,
        position,
        pes: None,
        spindle_rad: None,
        temperature_c: None,
        further: vec![],
    };
    (RecordEntry { file, role, repeat_group: group.map(str::to_owned) }, record)
}

fn made(limit: f64) -> Diagnosed {
    made_of(&plant(), limit)
}

fn made_of(given: &Plant, limit: f64) -> Diagnosed {
    let case = Case {
        id: "bench & <1>".into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs: vec![],
        records: vec![
            record(Role::Fit, Some("a"), 1.7, 1, limit),
            record(Role::Fit, Some("a"), 1.7, 2, limit),
            record(Role::Holdout, None, 2.9, 3, limit),
        ],
    };
    diagnose(&case, given, None, &DiagnoseSettings::default(), |_| {}).unwrap()
}

fn html(made: &Diagnosed) -> String {
    diagnosis_page(made, vec![("program".into(), "test".into())]).unwrap().html()
}

#[test]
fn a_clipping_amplifier_stands_on_the_page_with_its_limit_and_its_curve() {
    let made = made(LIMIT);
    let d = &made.diagnosis;
    assert_eq!((d.verdict, d.findings[0].effect.as_str()), (Verdict::Named, "current_saturation"));
    let page = html(&made);
    assert!(page.contains("The machine does something that the model lacks: current saturation"));
    for heading in
        ["Findings", "What to record next", "Before and after", "Where it shows", "The law behind it", "The search"]
    {
        assert!(page.contains(&format!(">{heading}</h2>")), "{heading}");
    }
    assert!(
        page.contains("Output of the amplifier (A)") && page.contains("Error (mrad)") && page.contains("noise floor")
    );
    // The limit as the finding gives it, five digits as the page writes numbers.
    let limit = d.findings[0].parameters["limit"].value;
    assert!((limit - LIMIT).abs() < 0.01 * LIMIT, "{limit}");
    assert!(page.contains(&format!("{limit:.5}")), "{limit}");
    // The hold-out record is drawn, its name escaped; nothing is fetched.
    assert!(page.contains("tones&lt;3&gt; (hold-out)") && !page.contains("tones<"));
    assert!(
        page.contains("bench &amp; &lt;1&gt;")
            && !page.contains("src=")
            && page.matches("url(").count() == page.matches("url(#").count()
    );
    assert!(!page.contains(">NaN"));
    assert_eq!(page, html(&made), "the same bytes");
}

#[test]
fn a_machine_as_modelled_has_a_page_without_findings() {
    let made = made(f64::INFINITY);
    assert_eq!(made.diagnosis.verdict, Verdict::NoMismatch);
    let page = html(&made);
    assert!(page.contains("nothing is missing") && !page.contains(">Findings</h2>"));
    assert!(page.contains("Noise floor rms") && page.contains("Spectrum of the error"));
}

/// The values of a curve, from the data that the page carries for its pictures.
fn curve(page: &str, name: &str) -> Vec<f64> {
    let tag = "type=\"application/json\">";
    let figures = page.match_indices(tag).map(|(at, _)| {
        let json = &page[at + tag.len()..];
        serde_json::from_str::<serde_json::Value>(&json[..json.find("</script>").unwrap()]).unwrap()
    });
    let panels: Vec<serde_json::Value> = figures.flat_map(|f| f["panels"].as_array().unwrap().clone()).collect();
    let series = panels.iter().flat_map(|p| p["series"].as_array().unwrap());
    let found = series.into_iter().find(|s| s["name"] == name).expect("the page holds the curve");
    found["y"].as_array().unwrap().iter().filter_map(serde_json::Value::as_f64).collect()
}

#[test]
fn a_stiffness_that_was_refitted_is_no_torque_that_nobody_explains() {
    // The same inertia on a softer spring: the given model leaves the torque (k - k0) x/b, the refitted one nothing.
    let softer = TAU * 30.0;
    let (dc_gain, stiff) = (12.0, TAU * 35.0);
    let given = Plant {
        body: Body::SecondOrder {
            dc_gain: dc_gain * (stiff / softer).powi(2),
            natural_frequency_rad_s: softer,
            damping_ratio: 0.3 * stiff / softer,
        },
        ..plant()
    };
    let made = made_of(&given, f64::INFINITY);
    assert_eq!(made.diagnosis.verdict, Verdict::Refit);
    let largest = record(Role::Fit, None, 1.7, 1, f64::INFINITY).1.position.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let torque = (1.0 - (softer / stiff).powi(2)) * largest / dc_gain;
    let drawn = curve(&html(&made), "torque beyond the linear plant");
    let most = drawn.iter().fold(0.0f64, |m, t| m.max(t.abs()));
    // What stays is the sensor's noise through a smoother.
    assert!(most < 0.1 * torque, "{most} of {torque} A");
}

#[test]
fn a_simulation_that_runs_away_is_still_a_page() {
    let mut made = made(LIMIT);
    for model in &mut made.errors {
        model.iter_mut().for_each(|e| e.fill(f64::INFINITY));
    }
    for r in &mut made.diagnosis.fit.records {
        (r.rms_before, r.rms_after) = (f64::INFINITY, f64::INFINITY);
    }
    made.diagnosis.findings[0].place.time_s.clear();
    let page = html(&made);
    assert!(page.contains("Record by record") && page.contains(">inf"));
}
