//! The user's own second-order sections: the same loop as the notch that they are, kept by the search, proved, and refused where they ring.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use servotune::controller::{Controller, ControllerError};
use servotune::feedback::{ModelLoop, margins};
use servotune::lti::{DiscretePlant, Section};
use servotune::tune::{Machine, TuneSettings, tune};
use servotune::twin::nominal_controller;

/// The nominal controller with its notch written as coefficients.
fn own() -> Controller {
    let c = nominal_controller().unwrap();
    let n = c.notch[0];
    let biquad = Section::notch(n.frequency_hz, n.zero_damping_ratio, n.pole_damping_ratio, c.sample_time_s).unwrap();
    Controller { notch: vec![], biquad: vec![biquad], ..c }
}

#[test]
fn a_notch_in_coefficients_is_the_notch() {
    let plant = DiscretePlant::of(&crate::tune_common::paper_plant(), own().sample_time_s).unwrap();
    let of = |c: &Controller| margins(&ModelLoop::new(&plant, &c.sections().unwrap()).unwrap());
    assert_eq!(of(&own()), of(&nominal_controller().unwrap()));
}

#[test]
fn the_search_keeps_them_and_the_table_carries_them() {
    let (plant, spec) = (crate::tune_common::paper_plant(), crate::tune_common::paper_spec());
    let settings = TuneSettings { starts: 2, rounds: 1, ..TuneSettings::default() };
    let outcome = tune(&Machine::Model(&plant), &spec, Some(&own()), &settings).unwrap();
    let c = outcome.controller();
    assert_eq!(c.biquad, own().biquad);
    assert_eq!(c.sections().unwrap().chain.last(), own().biquad.last());
    let text = toml::to_string(c).unwrap();
    assert_eq!(&toml::from_str::<Controller>(&text).unwrap(), c);
}

#[test]
fn a_section_that_rings_or_is_nothing_is_refused_by_name() {
    let with = |b0: f64, a1: f64, a2: f64| Controller {
        biquad: vec![Section { b0, b1: 0.0, b2: 0.0, a1, a2 }],
        ..nominal_controller().unwrap()
    };
    // Poles on and outside the unit circle: an integrator belongs to the PID.
    for (a1, a2) in [(-1.0, 0.0), (0.0, 1.0), (-2.5, 1.0)] {
        let e = with(1.0, a1, a2).check().unwrap_err();
        assert!(matches!(e, ControllerError::Rings { filter: "biquad", .. }), "{e}");
    }
    let e = with(0.0, -0.5, 0.0).check().unwrap_err();
    assert!(e.to_string().contains("biquad.b0"), "{e}");
    assert!(with(f64::NAN, -0.5, 0.0).check().is_err());
}
