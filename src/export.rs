//! `servotune export`: the controller as code, with a test vector that the code must give to the last bit.

use super::check_kind::{FileKind, kind_of};
use super::export_fixed::{Effect, FixedLaw};
use super::exported::{Exported, SAMPLES, TestVector};
use super::outputs::Outputs;
use super::start_arguments::{ExportArguments, ExportForm};
use super::{Ending, Failure, Screen, export_c, export_matlab, export_plant, export_st, load};
use serde::Serialize;
use servotune::controller::ControlLaw;
use servotune::document::{read_text, sha256_hex, write_text};
use std::path::{Path, PathBuf};

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

pub(super) fn run(a: &ExportArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let inputs: Vec<PathBuf> = [Some(a.gains.clone()), a.plant.clone()].into_iter().flatten().collect();
    let outputs = Outputs::new(&[&a.out], &inputs, a.force)?;
    if kind_of(&a.gains)? == FileKind::Plant {
        return plant(a, &outputs, screen);
    }
    let controller = load::controller(&a.gains)?;
    let law = ControlLaw::new(&controller).map_err(|source| Failure::Controller { file: a.gains.clone(), source })?;
    let exported = Exported {
        name: a.name.as_deref().unwrap_or("servo"),
        controller: &controller,
        source: source(&a.gains)?,
        test: TestVector::of(&law),
    };
    let mut effect = None;
    let (form, text) = match a.form {
        ExportForm::C => ("c", export_c::header(&exported, &law)),
        ExportForm::St => ("st", export_st::block(&exported, &law)),
        ExportForm::Matlab => ("matlab", export_matlab::function(&exported, &law)),
        ExportForm::Python | ExportForm::Zpk | ExportForm::Tf | ExportForm::Ss => {
            let said = "a controller goes out as c, fixed, st or matlab; python, zpk, tf and ss are forms of a plant";
            return Err(Failure::Unfit { said: format!("{}: {said}", a.gains.display()) });
        }
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

/// Where the code came from, a line.
fn source(file: &Path) -> Result<String, Failure> {
    let sha256 = sha256_hex(read_text(file)?.as_bytes());
    let name = file.file_name().map(|n| n.to_string_lossy().replace(char::is_control, " ")).unwrap_or_default();
    Ok(format!("servotune {} from {name} (SHA-256 {})", env!("CARGO_PKG_VERSION"), &sha256[..16]))
}

#[derive(Serialize)]
struct PlantDocument<'a> {
    schema: &'static str,
    written: &'a Path,
    form: &'static str,
    order: usize,
    delay_s: f64,
    /// Largest difference of the response read back from the plant's, of itself, and where.
    response_deviation: f64,
    response_deviation_hz: f64,
    inputs: Vec<PathBuf>,
}

fn plant(a: &ExportArguments, outputs: &Outputs, screen: &mut Screen) -> Result<Ending, Failure> {
    let plant = load::plant(&a.gains)?;
    let found = export_plant::text(&plant, a.form, a.name.as_deref().unwrap_or("P"), &source(&a.gains)?)?;
    if !plant.physics.is_empty() {
        let effects: Vec<&str> = plant.physics.iter().map(|p| p.effect.as_str()).collect();
        screen.warn(&format!("warning: {}: left out, being beyond linear: {}", a.gains.display(), effects.join(", ")));
    }
    outputs.keep_old(screen)?;
    write_text(&a.out, &found.text)?;
    let shown = format!(
        "{}: order {} and a dead time of {:.6} us; read back, its response is the plant's within {:.1e} of itself (worst at {:.1} Hz).\n",
        a.out.display(),
        plant.order(),
        1e6 * plant.delay_s,
        found.deviation,
        found.at_hz
    );
    let document = PlantDocument {
        schema: "servotune.export_plant/1",
        written: &a.out,
        form: found.form,
        order: plant.order(),
        delay_s: plant.delay_s,
        response_deviation: found.deviation,
        response_deviation_hz: found.at_hz,
        inputs: vec![a.gains.clone()],
    };
    screen.result(&document, &shown)?;
    Ok(Ending::Accepted)
}
