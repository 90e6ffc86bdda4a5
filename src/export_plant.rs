//! `servotune export plant.toml`: the plant in the forms of MATLAB, python-control and JSON, read back before it is said to be right.

use super::Failure;
use super::exported::numbers;
use super::start_arguments::ExportForm;
use nalgebra::Complex;
use serde_json::json;
use servotune::lti::{FrequencyResponse, Plant, Rational};
use servotune_answer as answer;
use std::path::Path;

/// A plant's text, and how far it is from the plant.
pub(super) struct PlantText {
    pub text: String,
    pub form: &'static str,
    /// Largest difference of the response of the text, read back, from the plant's, of itself.
    pub deviation: f64,
    /// Where (Hz).
    pub at_hz: f64,
}

/// Largest deviation that a form may have.
const MOST: f64 = 1e-6;

/// The plant in that form; refused where the form is one of controllers, or loses digits.
pub(super) fn text(plant: &Plant, form: ExportForm, name: &str, source: &str) -> Result<PlantText, Failure> {
    let all = plant.rational();
    let (word, ending, text) = match form {
        ExportForm::Matlab => ("matlab", "m", matlab(plant, &all, name, source)),
        ExportForm::Python => ("python", "py", python(plant, &all, name, source)),
        ExportForm::Zpk => {
            ("zpk", "json", json(plant, json!({"z": roots(&all.zeros), "p": roots(&all.poles), "k": all.gain})))
        }
        ExportForm::Tf => {
            let (num, den) = (coefficients(&all.zeros, all.gain), coefficients(&all.poles, 1.0));
            ("tf", "json", json(plant, json!({"num": num, "den": den})))
        }
        ExportForm::Ss => {
            let s = all.state_space();
            let b: Vec<[f64; 1]> = s.b.iter().map(|b| [*b]).collect();
            ("ss", "json", json(plant, json!({"A": s.a, "B": b, "C": [s.c], "D": [[0.0]]})))
        }
        ExportForm::C | ExportForm::Fixed | ExportForm::St => {
            let said = "a plant goes out as matlab, python, zpk, tf or ss; c, fixed and st are forms of a controller";
            return Err(Failure::Unfit { said: said.into() });
        }
    };
    let file = format!("the {word} text, read back.{ending}");
    let again = answer::plant(Path::new(&file), &text);
    let lost = |why: String| Failure::Unfit {
        said: format!("the form {word} loses digits of this plant ({why}): take ss, zpk or matlab"),
    };
    let again = again.map_err(|e| lost(e.to_string()))?;
    let (deviation, w) = worst(plant, &again, &all);
    if deviation.is_nan() || deviation > MOST {
        let at = w / std::f64::consts::TAU;
        return Err(lost(format!("the response read back is off by {deviation:.1e} of itself at {at:.1} Hz")));
    }
    Ok(PlantText { text, form: word, deviation, at_hz: w / std::f64::consts::TAU })
}

/// On a fine log grid over the roots and at each root itself.
fn worst(plant: &Plant, again: &Plant, all: &Rational) -> (f64, f64) {
    let sizes: Vec<f64> = all.zeros.iter().chain(&all.poles).map(|r| r.norm()).filter(|w| *w > 0.0).collect();
    let low = sizes.iter().copied().fold(1.0, f64::min) / 10.0;
    let high = sizes.iter().copied().fold(1.0, f64::max) * 3.0;
    let grid = (0..400).map(|i| low * (high / low).powf(f64::from(i) / 399.0));
    let off = |w: f64| ((again.at(w) / plant.at(w) - 1.0).norm(), w);
    grid.chain(sizes.iter().copied()).map(off).fold((0.0, low), |m, x| if x.0 > m.0 || x.0.is_nan() { x } else { m })
}

fn roots(all: &[Complex<f64>]) -> Vec<serde_json::Value> {
    all.iter().map(|r| if r.im == 0.0 { json!(r.re) } else { json!([r.re, r.im]) }).collect()
}

/// Π(s - r), highest power first, times the gain.
fn coefficients(roots: &[Complex<f64>], gain: f64) -> Vec<f64> {
    let mut all = vec![Complex::new(gain, 0.0)];
    for r in roots {
        all.push(Complex::new(0.0, 0.0));
        for i in (1..all.len()).rev() {
            let before = all[i - 1];
            all[i] -= r * before;
        }
    }
    all.iter().map(|c| c.re).collect()
}

fn json(plant: &Plant, form: serde_json::Value) -> String {
    let mut all = json!({
        "position_unit": plant.position_unit,
        "command_unit": plant.command_unit,
        "delay_s": plant.delay_s,
    });
    if let (Some(all), Some(form)) = (all.as_object_mut(), form.as_object()) {
        all.extend(form.clone());
    }
    format!("{all:#}\n")
}

/// Text in single quotes that MATLAB and Python both take: what would end it or hide a sign is left out.
fn quoted(text: &str) -> String {
    let plain: String = text.chars().filter(|c| !c.is_control() && !"'\\\"".contains(*c)).collect();
    format!("'{plain}'")
}

fn matlab(plant: &Plant, all: &Rational, name: &str, source: &str) -> String {
    let list = |all: &[Complex<f64>]| {
        let each =
            all.iter().map(|r| if r.im == 0.0 { format!("{:e}", r.re) } else { format!("{:e}{:+e}i", r.re, r.im) });
        numbers(each, "  ").replace(",\n", ", ...\n")
    };
    format!(
        "% {name}  {source}\n% rad/s; {position} per {command}. The dead time holds computation and sampling, not the hold.\n\
         position_unit = {};\ncommand_unit = {};\nz = [ ...\n{}];\np = [ ...\n{}];\nk = {:e};\n{name} = zpk(z, p, k, 'InputDelay', {:e});\n",
        quoted(&plant.position_unit),
        quoted(&plant.command_unit),
        list(&all.zeros),
        list(&all.poles),
        all.gain,
        plant.delay_s,
        position = plant.position_unit.replace('\n', " "),
        command = plant.command_unit.replace('\n', " "),
    )
}

fn python(plant: &Plant, all: &Rational, name: &str, source: &str) -> String {
    let s = all.state_space();
    let row = |values: &[f64]| values.iter().map(|v| format!("{v:e}")).collect::<Vec<_>>().join(", ");
    let a = s.a.iter().map(|r| format!("    [{}],\n", row(r))).collect::<String>();
    let b = s.b.iter().map(|b| format!("[{b:e}]")).collect::<Vec<_>>().join(", ");
    format!(
        "# {name}  {source}\n# States in real modal form; {position} per {command}. python-control has no dead time: multiply the response by\n\
         # exp(-delay_s s), or put control.pade(delay_s, n) before it.\nimport control\n\nposition_unit = {}\ncommand_unit = {}\ndelay_s = {:e}\n\
         A = [\n{a}]\nB = [{b}]\nC = [[{}]]\n{name} = control.ss(A, B, C, [[0]])\n",
        quoted(&plant.position_unit),
        quoted(&plant.command_unit),
        plant.delay_s,
        row(&s.c),
        position = plant.position_unit.replace('\n', " "),
        command = plant.command_unit.replace('\n', " "),
    )
}
