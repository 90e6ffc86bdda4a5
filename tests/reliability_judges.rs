//! What a hostile trial found in the judges of a loop, each as its reproduction: the refusal, its variant and its fields, or the truth.
#![allow(clippy::unwrap_used)]

use crate::program_common::{Ran, folder, servotune};
use crate::reliability_common::*;
use nalgebra::Complex;
use servotune::controller::{Controller, ControllerError};
use servotune::document::{parse_toml, size_limits};
use servotune::feedback::{FeedbackError, LoopVerdict, MeasuredLoop, ModelLoop, confirmed_margins, measured_margins};
use servotune::frf::{GATHERED_ABOVE, ReadSettings};
use servotune::identify::{IdentifySettings, identify};
use servotune::lti::{DiscretePlant, FrequencyResponse, LtiError, Plant};
use servotune::numeric::random::Random;
use servotune::pes::{Profile, figures};
use servotune::tune::{Machine, Spec, SpecError, judge};
use servotune::twin::nominal_controller;
use servotune::twin::plants::{log_grid, measure};
use servotune::verify::{Uncertainty, VerifyError, VerifySettings, prove_loop};
use std::f64::consts::TAU;
use std::path::Path;

// H5

#[test]
fn a_limit_on_a_band_without_a_bin_is_no_limit() {
    let short = SPIRAL.replace("window = [200, 400]", "window = [200, 210]");
    match Spec::parse(PAPER, short.as_str()).unwrap_err() {
        SpecError::EmptyBand { key, samples, rate_hz, band } => {
            assert_eq!((key.as_str(), samples, rate_hz, band), ("limits.dft_low", 10, 27_480.0, [600.0, 1500.0]));
        }
        e => panic!("{e}"),
    }
    assert!(Spec::parse(PAPER, SPIRAL).is_ok());
    // 30 samples: a bin at 916 Hz and one at 1832 Hz, so both bands have a figure; 20: one at 1374 Hz only, and the next at 2748 Hz.
    for (window, low, high) in [("[200, 210]", 0, 1), ("[200, 201]", 0, 0), ("[200, 230]", 1, 2), ("[200, 220]", 1, 1)]
    {
        let p: Profile = parse_toml(Path::new("p"), &SPIRAL.replace("[200, 400]", window)).unwrap();
        assert_eq!((p.bins_in([600.0, 1500.0]), p.bins_in([1500.0, 3000.0])), (low, high), "{window}");
        let f = figures(&vec![0.5; p.servo_samples()], &p);
        assert_eq!((f.dft_low.is_some(), f.dft_high.is_some()), (low > 0, high > 0), "{window}");
    }
}

#[test]
fn a_gain_margin_beyond_the_sweep_is_that_of_its_last_point() {
    let rows: Vec<[f64; 3]> = rows(400, 0.0).into_iter().filter(|r| r[0] < 700.0).collect();
    let frf = read(&bod(&rows), &ReadSettings::default()).unwrap().frf;
    let c = nominal_controller().unwrap();
    let machine = Machine::Response { frf: &frf, continuation: None };
    let p = judge(&machine, &c, &Spec::parse(PAPER, SPIRAL).unwrap()).unwrap();
    assert_eq!(p.margins.gain_margin_db, None);
    // The last point of the sweep itself, by the plant's closed form, hold and sections.
    let (w, t) = (TAU * rows[rows.len() - 1][0], c.sample_time_s);
    let hold = Complex::from_polar((0.5 * w * t).sin() / (0.5 * w * t), -0.5 * w * t);
    let size = (healthy().at(w) * hold * c.sections().unwrap().at(w)).norm();
    let found = p.judged.found.gain_margin_db.unwrap();
    assert!((found + 20.0 * size.log10()).abs() < 1e-6, "{found} {size}");
}

// M1

#[test]
fn a_filter_that_rings_is_no_controller_and_both_judges_agree() {
    let controller = |damping: &str| -> Controller {
        parse_toml(Path::new("c"), &NOMINAL.replacen("damping_ratio = 0.7", &format!("damping_ratio = {damping}"), 1))
            .unwrap()
    };
    for tiny in ["5e-324", "1e-17", "1e-13", "9e-7"] {
        let e = controller(tiny).check().unwrap_err();
        assert!(matches!(e, ControllerError::Range { key: "lowpass.damping_ratio", .. }), "{e}");
    }
    let slow = NOMINAL.replacen("frequency_hz = 7000.0", "frequency_hz = 1e-9", 1);
    let e = parse_toml::<Controller>(Path::new("c"), &slow).unwrap().check().unwrap_err();
    assert!(matches!(e, ControllerError::Rings { filter: "low-pass", .. }), "{e}");
    let spec = Spec::parse(PAPER, SPIRAL).unwrap();
    let plant = healthy();
    for damping in ["1e-6", "1e-5", "1e-4", "1e-3", "0.01"] {
        let c = controller(damping);
        let (sampled, sections) = (DiscretePlant::of(&plant, c.sample_time_s).unwrap(), c.sections().unwrap());
        let by_margins = confirmed_margins(&ModelLoop::new(&sampled, &sections).unwrap());
        match (by_margins, judge(&Machine::Model(&plant), &c, &spec)) {
            (Ok(m), Ok(p)) => assert_eq!(m.stable, p.margins.stable),
            (Err(FeedbackError::Disagreement { .. }), Err(_)) => {}
            (m, p) => panic!("{damping}: {m:?} {p:?}"),
        }
    }
}

// M2

#[test]
fn the_second_prover_holds_the_limits_of_the_first() {
    let c = nominal_controller().unwrap();
    let sections = c.sections().unwrap().chain;
    let prove =
        |p: &Plant| prove_loop(p, &sections, c.sample_time_s, &Uncertainty::default(), &VerifySettings::default());
    let with = |change: &dyn Fn(&mut Plant)| {
        let mut p = healthy();
        change(&mut p);
        match prove(&p).unwrap_err() {
            VerifyError::Plant(e) => e,
            e => panic!("{e}"),
        }
    };
    for delay_s in [0.05, 1e3, 1e5] {
        let e = with(&|p| p.delay_s = delay_s);
        assert!(
            matches!(e, LtiError::Delay { delay_s: found, limit: size_limits::DELAY_SAMPLES, .. } if found == delay_s),
            "{e}"
        );
    }
    // Beyond any plant, and within a plant but beyond what is summed.
    for w in [1e30, 1e12, 1e8] {
        let e = with(&|p| p.modes[0].zero_rad_s = w);
        assert!(matches!(&e, LtiError::Range { found, .. } if *found == w), "{e}");
    }
    let e = with(&|p| p.modes[1].pole_damping_ratio = 1e9);
    assert!(matches!(&e, LtiError::Range { key, .. } if key == "plant.modes[1].pole_damping_ratio"), "{e}");
    let e = with(&|p| p.modes[1].pole_damping_ratio = 9e3);
    assert!(matches!(&e, LtiError::Range { key, .. } if key.contains("modes[1]")), "{e}");
    assert!(prove(&healthy()).is_ok());
}

// M6

#[test]
fn five_points_do_not_tell_stability() {
    let c = nominal_controller().unwrap();
    let sections = c.sections().unwrap();
    let verdict = |points: usize| {
        let frf = measure(&healthy(), &log_grid(40.0, 5000.0, points), 0.003, &mut Random::new(3)).unwrap();
        let m = measured_margins(&MeasuredLoop::new(&frf, &sections).unwrap()).unwrap();
        assert_eq!(m.margins.stable, m.verdict == LoopVerdict::Stable);
        m.verdict
    };
    assert_eq!((verdict(5), verdict(400)), (LoopVerdict::NotKnown, LoopVerdict::Stable));
    let place = folder("reliability_five");
    let file = place.join("five.csv");
    let frf = measure(&healthy(), &log_grid(40.0, 5000.0, 5), 0.003, &mut Random::new(3)).unwrap();
    let text = frf
        .w_rad_s()
        .iter()
        .zip(frf.value())
        .fold("frequency_hz,real,imag\n".to_owned(), |t, (w, v)| t + &format!("{},{},{}\n", w / TAU, v.re, v.im));
    std::fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap();
    let ran = servotune(&["margins", "--frf", file, "--controller", "specs/controllers/nominal.toml"]);
    assert!(ran.code == 1 && ran.out.contains("NOT KNOWN"), "{} {}", ran.code, ran.out);
    let ran = servotune(&["next-sweep", "--frf", file, "--controller", "specs/controllers/nominal.toml"]);
    assert_eq!(ran.code, 1);
    let out = place.join("p.toml");
    let Ran { code, err, .. } = servotune(&["identify", file, "--out", out.to_str().unwrap()]);
    assert!(code == 2 && err.contains("5 points") && !out.exists(), "{code} {err}");
}

// L4

#[test]
fn a_share_given_twice_is_refused() {
    let words = ["verify", "g.toml", "--plant", "p.toml", "--spec", "s.toml", "--uncertainty", "gain=5%,gain=1%"];
    let Ran { code, err, .. } = servotune(&words);
    assert!(code == 2 && err.contains("`gain` twice"), "{code} {err}");
}

// The cost of a long sweep

#[test]
fn a_long_sweep_is_gathered_and_gives_the_same_machine() {
    let truth = healthy();
    let frf = |points: usize| measure(&truth, &log_grid(40.0, 5000.0, points), 0.003, &mut Random::new(3)).unwrap();
    let id = identify(&frf(20_000), &IdentifySettings::default()).unwrap();
    assert_eq!(id.gathered_from, Some(20_000));
    assert!(id.w_rad_s.len() < GATHERED_ABOVE, "{}", id.w_rad_s.len());
    assert_eq!(identify(&frf(401), &IdentifySettings::default()).unwrap().gathered_from, None);
    // The truth itself: 0.3 % noise over 20 000 points, averaged some 35 times, leaves well below 0.1 % of the response between the ends.
    for hz in [60.0, 200.0, 560.0, 1200.0, 1800.0, 3000.0, 4500.0] {
        let off = (id.plant.at(TAU * hz) / truth.at(TAU * hz) - 1.0).norm();
        assert!(off < 2e-3, "{hz} Hz: {off}");
    }
}
