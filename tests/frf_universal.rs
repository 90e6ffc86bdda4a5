//! Universal files written by another program (see `invalid_sweeps/make_uff.py`), and damaged ones.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use nalgebra::Complex;
use servotune::frf::*;
use std::f64::consts::TAU;
use std::path::PathBuf;

fn read(name: &str, settings: &ReadSettings) -> Result<Sweep, FrfError> {
    read_file(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/invalid_sweeps").join(name), settings)
}

/// The response that the script writes.
fn truth(w: f64) -> Complex<f64> {
    let s = Complex::new(0.0, w);
    Complex::new(4e6, 0.0) / (s * s + s * 40.0 + 200.0 * 200.0) * (-s * 50e-6).exp()
}

#[test]
fn every_form_gives_back_the_written_response() {
    for spacing in ["even", "uneven"] {
        for precision in ["single", "double"] {
            for form in ["text", "binary"] {
                let name = format!("{spacing}_{precision}_{form}.uff");
                let sweep = read(&name, &ReadSettings::default()).unwrap();
                assert_eq!(sweep.frf.len(), 40, "{name}");
                // Text: five decimals of a mantissa (single) or twelve (double). Binary: half a unit of 2^-23 or 2^-52; the values
                // carry the rounding of the transfer function besides. An uneven abscissa has five decimals in any text.
                let tolerance = match (precision, form) {
                    ("single", "text") => 1e-5,
                    ("single", _) => 2e-7,
                    (_, "text") => 1e-11,
                    _ => 1e-13,
                };
                let grid: Vec<f64> = match spacing {
                    "even" => (1..=40).map(|i| 12.5 * f64::from(i)).collect(),
                    _ => (0..40).map(|i| (1e4 * 100f64.powf(f64::from(i) / 39.0)).round() / 1e3).collect(),
                };
                for ((w, v), hz) in sweep.frf.w_rad_s().iter().zip(sweep.frf.value()).zip(grid) {
                    // Six significant digits of the abscissa in text, single precision in single binary.
                    assert!((w / TAU / hz - 1.0).abs() < 6e-6, "{name}");
                    assert!(
                        (v / truth(TAU * hz) - 1.0).norm() < tolerance,
                        "{name} {hz}: {}",
                        (v / truth(TAU * hz) - 1.0).norm()
                    );
                }
            }
        }
    }
}

#[test]
fn several_responses_ask_for_a_choice() {
    match read("two_responses.uff", &ReadSettings::default()) {
        Err(FrfError::DatasetChoice { found: 2, datasets, .. }) => {
            assert!(datasets[0].contains("first") && datasets[1].contains("second"), "{datasets:?}");
        }
        other => panic!("{other:?}"),
    }
    let second = read("two_responses.uff", &ReadSettings { dataset: Some(2), ..Default::default() }).unwrap();
    assert!((second.frf.w_rad_s()[0] / TAU - 10.0).abs() < 1e-9);
    let third = read("two_responses.uff", &ReadSettings { dataset: Some(3), ..Default::default() });
    assert!(matches!(third, Err(FrfError::DatasetAbsent { wanted: 3, .. })));
}

#[test]
fn other_functions_and_zero_hertz_are_told() {
    assert!(matches!(
        read("coherence_only.uff", &ReadSettings::default()),
        Err(FrfError::DatasetChoice { found: 0, .. })
    ));
    let chosen = read("coherence_only.uff", &ReadSettings { dataset: Some(1), ..Default::default() });
    assert!(matches!(chosen, Err(FrfError::DatasetFunction { found: 6, .. })));
    // Doubles under a header that says single: no length that the header allows ends at the closing mark.
    let wrong = read("doubles_called_single.uff", &ReadSettings::default());
    assert!(matches!(wrong, Err(FrfError::DatasetBytes { expected: 160, .. })), "{wrong:?}");
    // Half the true length is declared here, and the file is read with a note.
    let short = read("even_double_binary.uff", &ReadSettings::default()).unwrap();
    assert!(short.notes.contains(&Note::DatasetBytes { declared: 320, found: 640 }));
    let sweep = read("from_zero.uff", &ReadSettings::default()).unwrap();
    assert!(sweep.notes.contains(&Note::ZeroHertz));
    assert_eq!(sweep.frf.len(), 19);
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for name in ["even_double_text.uff", "uneven_single_binary.uff"] {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/invalid_sweeps").join(name);
        let bytes = std::fs::read(path).unwrap();
        let end = bytes.iter().rposition(|&b| b == b'-').unwrap();
        for cut in (0..end).step_by(7) {
            assert!(read_bytes(name, &bytes[..cut], &ReadSettings::default()).is_err(), "{name} cut at {cut}");
        }
    }
}
