//! `servotune export`: the controller as code, with a test vector that the code must give to the last bit.

use super::export_fixed::{Effect, FixedLaw};
use super::outputs::Outputs;
use super::start_arguments::{ExportArguments, ExportForm};
use super::{Ending, Failure, Screen, export_c, export_matlab, export_st, load};
use serde::Serialize;
use servotune::controller::{Controller, Law};
use servotune::document::{read_text, sha256_hex, write_text};
use servotune::numeric::random::Random;
use std::path::{Path, PathBuf};

/// What is written out.
pub(super) struct Exported<'a> {
    pub name: &'a str,
    pub controller: &'a Controller,
    /// Where it came from, a line.
    pub source: String,
    pub test: TestVector,
}

/// Errors and references at each sample, and the command that the law gives.
pub(super) struct TestVector {
    pub reference: Vec<f64>,
    pub error: Vec<f64>,
    pub command: Vec<f64>,
}

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    written: &'a Path,
    form: &'static str,
    sections: usize,
    sample_time_s: f64,
    test_samples: usize,
    inputs: Vec<PathBuf>,
    /// What rounding does; of fixed words only.
    #[serde(skip_serializing_if = "Option::is_none")]
    effect: Option<Effect>,
}

/// Samples of a test vector, and the seed of its draws.
const SAMPLES: usize = 64;
const SEED: u64 = 7;

pub(super) fn run(a: &ExportArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let inputs: Vec<PathBuf> = [Some(a.gains.clone()), a.plant.clone()].into_iter().flatten().collect();
    let outputs = Outputs::new(&[&a.out], &inputs, a.force)?;
    let controller = load::controller(&a.gains)?;
    let law = Law::new(&controller).map_err(|source| Failure::Controller { file: a.gains.clone(), source })?;
    let sha256 = sha256_hex(read_text(&a.gains)?.as_bytes());
    let exported = Exported {
        name: &a.name,
        controller: &controller,
        source: format!(
            "servotune {} from {} (SHA-256 {})",
            env!("CARGO_PKG_VERSION"),
            a.gains.file_name().map(|n| n.to_string_lossy()).unwrap_or_default(),
            &sha256[..16]
        ),
        test: TestVector::of(&law),
    };
    let mut effect = None;
    let (form, text) = match a.form {
        ExportForm::C => ("c", export_c::header(&exported, &law)),
        ExportForm::St => ("st", export_st::block(&exported, &law)),
        ExportForm::Matlab => ("matlab", export_matlab::function(&exported, &law)),
        ExportForm::Fixed => {
            let fixed = FixedLaw::of(&exported, &law, a.word_length);
            let plant = a.plant.as_ref().map(|file| load::plant(file)).transpose()?;
            let found = fixed.effect(&exported, &law, plant.as_ref())?;
            let text = fixed.header(&exported, &found);
            effect = Some(found);
            ("fixed", text)
        }
    };
    outputs.keep_old(screen)?;
    write_text(&a.out, &text)?;
    let says = effect.as_ref().map_or_else(String::new, |e| e.sentences().join("\n") + "\n");
    let shown = format!(
        "{}: {} sections at {:.6} Hz, a test vector of {SAMPLES} samples.\n{says}",
        a.out.display(),
        law.chain.len(),
        1.0 / controller.sample_time_s
    );
    let document = Document {
        schema: "servotune.export/1",
        written: &a.out,
        form,
        sections: law.chain.len(),
        sample_time_s: controller.sample_time_s,
        test_samples: SAMPLES,
        inputs,
        effect,
    };
    screen.result(&document, &shown)?;
    Ok(Ending::Accepted)
}

impl TestVector {
    /// A jump, then noise: every coefficient takes part. Where the command is limited the size is one that reaches the limit.
    fn of(law: &Law<'_>) -> TestVector {
        let mut random = Random::new(SEED);
        let mut error: Vec<f64> = (0..SAMPLES).map(|k| if k < 8 { 1.0 } else { random.between(-1.0, 1.0) }).collect();
        let mut free = law.clone();
        free.limit = f64::INFINITY;
        let still = vec![0.0; SAMPLES];
        let peak = free.replay_from(law.rest(), &still, &error).iter().fold(0.0f64, |m, u| m.max(u.abs()));
        if law.limit.is_finite() && peak > 0.0 {
            let size = 1.5 * law.limit / peak;
            error.iter_mut().for_each(|e| *e *= size);
        }
        // The feed-forward sees a reference that bends.
        let reference: Vec<f64> = (0..SAMPLES).map(|k| 1e-3 * (0.2 * k as f64).sin()).collect();
        let command = law.replay_from(law.rest(), &reference, &error);
        TestVector { reference, error, command }
    }
}

/// A list of numbers, six in a line, each with the digits that give it back to the last bit.
pub(super) fn numbers(values: impl IntoIterator<Item = String>, indent: &str) -> String {
    let all: Vec<String> = values.into_iter().collect();
    all.chunks(6).map(|row| format!("{indent}{}", row.join(", "))).collect::<Vec<_>>().join(",\n")
}
