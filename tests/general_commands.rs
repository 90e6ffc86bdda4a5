//! Plants of any poles and zeros through the commands: from a file, from sweeps of the loop, or refused.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::general_common::*;
use nalgebra::Complex;
use servotune::controller::Controller;
use servotune::lti::{DiscretePlant, FrequencyResponse};
use servotune::numeric::random::Random;
use std::f64::consts::TAU;

fn servotune(args: &[&str]) -> (i32, serde_json::Value, String) {
    let out = std::process::Command::new(env!("CARGO_BIN_EXE_servotune")).args(args).arg("--json").output().unwrap();
    let json = serde_json::from_slice(&out.stdout).unwrap_or(serde_json::Value::Null);
    (out.status.code().unwrap(), json, String::from_utf8(out.stderr).unwrap())
}

/// A sweep file of real and imaginary parts, all digits.
fn write_sweep(file: &std::path::Path, w: &[f64], value: impl Fn(f64) -> Complex<f64>) {
    let rows: Vec<String> =
        w.iter().map(|&w| (w, value(w))).map(|(w, v)| format!("{},{},{}", w / TAU, v.re, v.im)).collect();
    std::fs::write(file, format!("frequency_hz,re,im\n{}\n", rows.join("\n"))).unwrap();
}

const CONTROLLER: &str = "sample_time_s = 1e-4\n[pid]\nkp = 1.7\nki_per_s = 100.0\nkd_s = 4e-3\nderivative_filter_s = 5e-5\n[[lowpass]]\nfrequency_hz = 3000.0\ndamping_ratio = 0.8\n";

#[test]
fn a_bearing_goes_through_the_commands_from_its_file_and_from_its_sweeps() {
    let folder = std::env::temp_dir().join(format!("servotune_bearing_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = |name: &str| folder.join(name);
    let path = |name: &str| file(name).display().to_string();
    std::fs::write(
        file("plant.toml"),
        "position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\ngain = 2e5\npoles_rad_s = [250, -250]\nlag_rad_s = [9000]\ndelay_s = 5e-5\n",
    )
    .unwrap();
    std::fs::write(file("controller.toml"), CONTROLLER).unwrap();
    let plant = read("gain = 2e5\npoles_rad_s = [250, -250]\nlag_rad_s = [9000]\ndelay_s = 5e-5\n");
    let law: Controller = toml::from_str(CONTROLLER).unwrap();
    let sections = law.sections().unwrap();
    let sampled = DiscretePlant::of(&plant, T).unwrap();
    let w: Vec<f64> = (0..400).map(|i| TAU * 4.0 * 1200f64.powf(f64::from(i) / 399.0)).collect();
    let (plant_file, controller) = (path("plant.toml"), path("controller.toml"));
    let (code, truth, said) = servotune(&["margins", "--plant", &plant_file, "--controller", &controller]);
    assert_eq!(code, 0, "{said}");
    assert_eq!(truth["stable"], true);
    // The same from sweeps: of P, and of what a bench would measure in closed loop.
    let l = |w: f64| sampled.at(w) * sections.at(w);
    let swept = |word: &str, w: f64| match word {
        "P" => sampled.at(w),
        "L" => l(w),
        "S" => 1.0 / (1.0 + l(w)),
        "T" => l(w) / (1.0 + l(w)),
        "PS" => sampled.at(w) / (1.0 + l(w)),
        _ => sections.at(w) / (1.0 + l(w)),
    };
    let near = |found: &serde_json::Value, key: &str, share: f64| {
        let (a, b) = (found[key].as_f64().unwrap(), truth[key].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < share, "{key}: {a} {b}");
    };
    for word in ["P", "L", "S", "T", "PS", "CS"] {
        let sweep = path(&format!("{word}.csv"));
        write_sweep(&file(&format!("{word}.csv")), &w, |w| swept(word, w));
        let mut args = vec![
            "margins",
            "--frf",
            &sweep,
            "--controller",
            &controller,
            "--unstable-poles",
            "1",
            "--phase",
            "response",
        ];
        args.extend(if word == "P" { vec!["--hold-included"] } else { vec!["--measured", word] });
        let (code, found, said) = servotune(&args);
        assert_eq!(code, 0, "{word}: {said}");
        // Cubics between 130 points a decade; the deviation taken for the file is not the truth's.
        near(&found, "phase_margin_deg", 1e-4);
        near(&found, "gain_crossover_hz", 1e-4);
        near(&found, "max_sensitivity", 1e-3);
        assert_eq!(found["unstable_poles"], 0, "{word}");
        let two: Vec<&str> = args.iter().map(|a| if *a == "1" { "2" } else { a }).collect();
        assert_eq!(servotune(&two).0, 1, "{word}: the same curve does not hold two unstable poles");
    }
    // Refusals.
    let (sweep, out) = (path("S.csv"), path("out.toml"));
    let (code, _, said) = servotune(&["identify", &sweep, "--measured", "S", "--out", &out]);
    assert!(code == 2 && said.contains("--measured-with"), "{said}");
    let (code, _, said) =
        servotune(&["margins", "--frf", &sweep, "--measured", "S", "--hold-included", "--controller", &controller]);
    assert!(code == 2 && said.contains("--hold-included"), "{said}");
    let (code, _, said) =
        servotune(&["margins", "--plant", &plant_file, "--measured", "S", "--controller", &controller]);
    assert!(code == 2 && said.contains("--frf"), "{said}");
    std::fs::write(
        file("two.toml"),
        "position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\ndelay_s = 0\ngain = 1.0\npoles_hz = [-1]\nnumerator = [1]\n",
    )
    .unwrap();
    let (code, _, said) = servotune(&["margins", "--plant", &path("two.toml"), "--controller", &controller]);
    assert!(code == 2 && said.contains("two.toml") && said.contains("`gain` beside `numerator`"), "{said}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_plant_identified_from_its_sensitivity_is_the_plant() {
    let folder = std::env::temp_dir().join(format!("servotune_opened_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = |name: &str| folder.join(name).display().to_string();
    std::fs::write(folder.join("controller.toml"), CONTROLLER).unwrap();
    let law: Controller = toml::from_str(CONTROLLER).unwrap();
    let sections = law.sections().unwrap();
    let plant = read("natural_frequency_rad_s = 200\ndc_gain = 5.0\ndamping_ratio = 0.3\ndelay_s = 5e-5\n");
    let sampled = DiscretePlant::of(&plant, T).unwrap();
    let w: Vec<f64> = (0..300).map(|i| TAU * 8.0 * 150f64.powf(f64::from(i) / 299.0)).collect();
    let mut random = Random::new(7);
    let noise: Vec<Complex<f64>> = w.iter().map(|_| 1.0 + 1e-3 * c(random.normal(), random.normal())).collect();
    let at = |w0: f64| w.iter().position(|w| *w == w0).unwrap();
    write_sweep(&folder.join("S.csv"), &w, |w| noise[at(w)] / (1.0 + sampled.at(w) * sections.at(w)));
    let args = [
        "identify",
        &path("S.csv"),
        "--measured",
        "S",
        "--controller",
        &path("controller.toml"),
        "--order",
        "2",
        "--out",
        &path("plant.toml"),
    ];
    let (code, found, said) = servotune(&args);
    assert!(code < 2, "{said}");
    let gain = found["plant"]["dc_gain"].as_f64().unwrap_or_else(|| panic!("{found}"));
    let frequency = found["plant"]["natural_frequency_rad_s"].as_f64().unwrap();
    // A thousandth of noise over some hundred points that know the body.
    assert!((gain / 5.0 - 1.0).abs() < 0.01 && (frequency / 200.0 - 1.0).abs() < 0.01, "{gain} {frequency}");
    std::fs::remove_dir_all(&folder).unwrap();
}
