//! Plants as other programs write them: MATLAB text (`.m`), python-control text (`.py`), JSON (`.json`).
//!
//! In: the text and the file's name. Out: [`PlantFile`]. Units: the text says `position_unit`, `command_unit`, and its dead time in seconds.
//! Spec: `specs/files.md`, "Plants of other programs".

use super::PlantFile;
use super::script::{Call, Cell, names};
use super::script_words::Language;
use crate::document::DocumentError;
use serde_json::{Map, Value, json};
use std::path::Path;

/// The plant in a text of another program, by the ending of the file's name; none where the ending is none of theirs.
pub fn imported_plant(file: &Path, text: &str) -> Option<Result<PlantFile, DocumentError>> {
    let ending = file.extension()?.to_string_lossy().to_lowercase();
    Some(match ending.as_str() {
        "m" => of_text(file, text, Language::Matlab),
        "py" => of_text(file, text, Language::Python),
        "json" => of_json(file, text),
        _ => return None,
    })
}

fn content(file: &Path, (line, column): (usize, usize), found: String) -> DocumentError {
    DocumentError::Content { file: file.into(), line, column, found }
}

fn of_json(file: &Path, text: &str) -> Result<PlantFile, DocumentError> {
    let value: Value = serde_json::from_str(text)
        .map_err(|e| content(file, (e.line(), e.column().max(1)), format!("found no JSON document: {e}")))?;
    // plant.toml's own keys in JSON, else the names of the other programs.
    if value.get("plant").is_some() {
        return serde_json::from_value(value).map_err(|e| content(file, (1, 1), e.to_string()));
    }
    let Value::Object(map) = value else {
        return Err(content(file, (1, 1), "expected an object with the keys of a plant".into()));
    };
    document(file, &map)
}

/// Longest text (bytes): sixty states with all their digits take a tenth.
const LONGEST: usize = 1 << 20;

fn of_text(file: &Path, text: &str, language: Language) -> Result<PlantFile, DocumentError> {
    if text.len() > LONGEST {
        return Err(DocumentError::TooLong { file: file.into(), limit: LONGEST });
    }
    let all = names(text, language).map_err(|m| {
        let at = (m.place.line, m.place.column);
        content(file, at, format!("found {}; expected {}", m.found, m.expected))
    })?;
    let refuse = |found: &str| content(file, (1, 1), found.to_owned());
    let mut map = Map::new();
    // `P.InputDelay = 1e-4` names the property of a model above.
    for (name, value) in &all {
        match value {
            Cell::Model(_) => {}
            value => {
                let name = name.rsplit('.').next().unwrap_or_default();
                map.insert(
                    name.to_owned(),
                    plain(value)
                        .ok_or_else(|| refuse(&format!("`{name}` holds a model within a list; expected numbers")))?,
                );
            }
        }
    }
    let models: Vec<(&String, &Call)> =
        all.iter().filter_map(|(name, v)| if let Cell::Model(call) = v { Some((name, call)) } else { None }).collect();
    match models[..] {
        [] => {}
        [(_, call)] => of_call(file, call, &mut map)?,
        _ => {
            let names: Vec<&str> = models.iter().map(|(name, _)| name.as_str()).collect();
            return Err(refuse(&format!(
                "found {} models, {}; expected one, the plant",
                names.len(),
                names.join(", ")
            )));
        }
    }
    document(file, &map)
}

/// What the call's arguments are called in `document`; its own words count before assignments of the same name.
fn of_call(file: &Path, call: &Call, map: &mut Map<String, Value>) -> Result<(), DocumentError> {
    let refuse = |found: String| content(file, (1, 1), found);
    for key in ["a", "b", "c", "d", "num", "den", "z", "p", "k", "A", "B", "C", "D"] {
        map.remove(key);
    }
    let order: &[&str] = match call.form {
        "tf" => &["num", "den", "Ts"],
        "zpk" => &["z", "p", "k", "Ts"],
        _ => &["a", "b", "c", "d", "Ts"],
    };
    let number =
        |cell: &Cell| plain(cell).ok_or_else(|| refuse(format!("{}(...) holds a model; expected numbers", call.form)));
    if call.given.len() > order.len() {
        let found = call.given.len();
        return Err(refuse(format!("{}(...) with {found} arguments; expected {}", call.form, order.join(", "))));
    }
    for (name, cell) in order.iter().zip(&call.given) {
        map.insert((*name).to_owned(), number(cell)?);
    }
    for (name, cell) in &call.named {
        map.insert(name.clone(), number(cell)?);
    }
    Ok(())
}

/// Numbers as JSON has them, complex ones as [re, im].
fn plain(cell: &Cell) -> Option<Value> {
    Some(match cell {
        Cell::Number(x) if x.im == 0.0 => json!(x.re),
        Cell::Number(x) => json!([x.re, x.im]),
        Cell::Text(text) => json!(text),
        Cell::List(all) => Value::Array(all.iter().map(plain).collect::<Option<_>>()?),
        Cell::Model(_) => return None,
    })
}

/// The document of the names: one form, the dead time, the units.
fn document(file: &Path, map: &Map<String, Value>) -> Result<PlantFile, DocumentError> {
    let refuse = |found: String| content(file, (1, 1), found);
    let get = |keys: &[&str]| keys.iter().find_map(|key| map.get(*key));
    if let Some(t) = get(&["Ts", "dt", "ts"]).filter(|t| !matches!(t.as_f64(), Some(0.0))) {
        return Err(refuse(format!(
            "found a sample time of {t}: a discrete model; expected a continuous one (d2c in MATLAB)"
        )));
    }
    let mut plant = Map::new();
    let mut put = |key: &str, value: Value| plant.insert(key.to_owned(), value);
    let roots = get(&["p", "poles", "poles_rad_s"]);
    let coefficients = get(&["den", "denominator"]);
    let states = get(&["A", "a"]);
    match (roots, coefficients, states) {
        (Some(poles), None, None) => {
            put("poles_rad_s", flat(poles));
            put("zeros_rad_s", get(&["z", "zeros", "zeros_rad_s"]).map_or_else(|| json!([]), flat));
            put("gain", scalar(get(&["k", "gain", "K"]).cloned().unwrap_or(Value::Null)));
        }
        (None, Some(down), None) => {
            put("denominator", flat(down));
            put("numerator", get(&["num", "numerator"]).map_or(Value::Null, flat));
        }
        (None, None, Some(a)) => {
            put("a", matrix(a));
            for (key, names) in [("b", ["B", "b"]), ("c", ["C", "c"])] {
                put(key, get(&names).map_or(Value::Null, flat));
            }
            if let Some(d) = get(&["D", "d"]) {
                put("d", flat(d));
            }
        }
        _ => {
            let found: Vec<&str> = map.keys().map(String::as_str).take(12).collect();
            return Err(refuse(format!(
                "found the names {}; expected one plant: tf(num, den), zpk(z, p, k) or ss(A, B, C, D), or their arguments by these names",
                found.join(", ")
            )));
        }
    }
    let delays: Vec<&Value> =
        ["delay_s", "InputDelay", "OutputDelay", "IODelay"].iter().filter_map(|k| map.get(*k)).collect();
    if delays.is_empty() {
        return Err(refuse("no dead time; write delay_s = 65e-6 (or 'InputDelay', 65e-6), 0 where there is none: a dead time left out makes margins too good".into()));
    }
    let sum: Option<f64> = delays.iter().map(|d| scalar((*d).clone()).as_f64()).sum();
    put("delay_s", json!(sum.ok_or_else(|| refuse("the dead time is not a number of seconds".into()))?));
    let unit = |key: &str, like: &str| {
        let words = || refuse(format!("no {key}; write {key} = '{like}'"));
        map.get(key).and_then(Value::as_str).map(str::to_owned).ok_or_else(words)
    };
    let whole = json!({
        "position_unit": unit("position_unit", "um")?,
        "command_unit": unit("command_unit", "A")?,
        "plant": plant,
    });
    serde_json::from_value(whole).map_err(|e| refuse(format!("{e}; expected {}", PlantFile::EXPECTED)))
}

/// One number in any number of brackets.
fn scalar(value: Value) -> Value {
    match value {
        Value::Array(mut all) if all.len() == 1 => scalar(all.swap_remove(0)),
        other => other,
    }
}

/// A list of what stands in one row or one column; a number alone is a list of one. Pairs of numbers are complex only where they were.
fn flat(value: &Value) -> Value {
    let column = |row: &Value| matches!(row, Value::Array(one) if one.len() == 1);
    match value {
        Value::Array(rows) if rows.len() == 1 && matches!(&rows[0], Value::Array(row) if !is_pair(row)) => {
            flat(&rows[0])
        }
        Value::Array(rows) if rows.iter().all(column) => {
            Value::Array(rows.iter().map(|r| scalar_row(r.clone())).collect())
        }
        Value::Array(_) => value.clone(),
        other => json!([other]),
    }
}

fn scalar_row(value: Value) -> Value {
    match value {
        Value::Array(mut all) if all.len() == 1 => all.swap_remove(0),
        other => other,
    }
}

fn is_pair(row: &[Value]) -> bool {
    row.len() == 2 && row.iter().all(Value::is_number)
}

/// Rows of a matrix; a number alone is one of one row, a flat row too.
fn matrix(value: &Value) -> Value {
    match value {
        Value::Array(rows) if rows.iter().all(Value::is_array) => value.clone(),
        Value::Array(_) => json!([value]),
        other => json!([[other]]),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::{FrequencyResponse, Plant};
    use nalgebra::Complex;

    fn read(name: &str, text: &str) -> Result<Plant, String> {
        let file = imported_plant(Path::new(name), text).unwrap().map_err(|e| e.to_string())?;
        Plant::try_from(file).map_err(|e| e.to_string())
    }

    /// 3e9 (s + 900)/(s (s + 40) (s² + 200 s + 25e6)) with a delay.
    fn truth(w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        3e9 * (s + 900.0) / (s * (s + 40.0) * (s * s + 200.0 * s + 25e6)) * (s * -1e-4).exp()
    }

    const UNITS: &str = "position_unit = 'um'; command_unit = 'A';\n";

    #[test]
    fn one_plant_in_every_text_is_the_same_plant() {
        let im = (25e6f64 - 1e4).sqrt();
        let texts = [
            ("p.m", "% a stage\nclear all\nnum = [3e9 2.7e12]; den = [1, 240 25008e3 ... goes on\n 1e9 0];\nP = tf(num, den, 'InputDelay', 1e-4);\n".to_owned()),
            ("p.m", format!("P = zpk(-900, [0; -40; -100+{im}i; -100-{im}i], 3e9);\nP.InputDelay = 2*50e-6;\n")),
            ("p.m", "A = [0 1 0 0\n 0 0 1 0\n 0 0 0 1\n 0 -1e9 -25008e3 -240];\nB = [0 0 0 1]'; C = [2.7e12 3e9 0 0]; D = 0;\nsys = ss(A,B,C,D);\ndelay_s = 1e-4;".into()),
            ("p.py", format!("import control as ct\nimport numpy as np\nP = ct.zpk([-900], [0, -40, -100+{im}j, -100 - {im}j], gain=3e9)\ndelay_s = 1e-4 # s\n")),
            ("p.py", "from control import tf\nnum = [3e9, 2.7e12]\nden = np.array([1, 240,\n  25008e3, 1e9, 0])\nP = tf(num, den)\ndelay_s = 1e-4".into()),
            ("p.py", "P = control.ss([[0,1,0,0],[0,0,1,0],[0,0,0,1],[0,-1e9,-25008e3,-240]], [[0],[0],[0],[1]], [[2.7e12,3e9,0,0]], [[0]])\ndelay_s=1e-4".into()),
        ];
        for (name, text) in texts {
            let python = name.ends_with("py");
            let units = if python { "position_unit = 'um'\ncommand_unit = \"A\"\n" } else { UNITS };
            let p = read(name, &format!("{units}{text}")).unwrap_or_else(|e| panic!("{text}\n{e}"));
            for w in [0.5, 30.0, 800.0, 4990.0, 5e4] {
                assert!((p.at(w) / truth(w) - 1.0).norm() < 1e-11, "{text}: {w}");
            }
        }
        let json = format!(
            r#"{{"z": [-900], "p": [0, -40, [-100, {im}], [-100, -{im}]], "k": 3e9, "delay_s": 1e-4, "position_unit": "um", "command_unit": "A"}}"#
        );
        let states = r#"{"A": [[0,1,0,0],[0,0,1,0],[0,0,0,1],[0,-1e9,-25008e3,-240]], "B": [[0],[0],[0],[1]], "C": [[2.7e12,3e9,0,0]], "D": [[0]], "delay_s": 1e-4, "position_unit": "um", "command_unit": "A"}"#;
        let own = format!(
            r#"{{"position_unit": "um", "command_unit": "A", "plant": {{"gain": 3e9, "zeros_rad_s": [-900], "poles_rad_s": [0, -40, [-100, {im}]], "delay_s": 1e-4}}}}"#
        );
        for text in [json.as_str(), states, &own] {
            let p = read("p.json", text).unwrap();
            assert!((p.at(800.0) / truth(800.0) - 1.0).norm() < 1e-11, "{text}");
        }
    }

    #[test]
    fn blanks_in_a_matlab_row_separate_as_matlab_s_do() {
        let p = |den: &str| read("p.m", &format!("{UNITS}delay_s = 0; P = tf(1, [{den}]);"));
        // 1, -2 is an unstable pole; 1-2 is one number, and no plant.
        assert!(p("1 -2").is_ok_and(|p| p.at(0.0).re == -0.5));
        assert!(p("1 - 2").is_err() && p("1-2").is_err());
        assert!(p("1 2*pi*50 (10*3)^2").is_ok());
    }

    #[test]
    fn what_is_no_plant_is_refused_with_its_place() {
        let words = |name: &str, text: &str| read(name, text).unwrap_err();
        let e = words("p.m", "P = tf([1], [1 2])\nplot(P)\n");
        assert!(e.starts_with("p.m:2:1:") && e.contains("nothing else is run"), "{e}");
        assert!(words("p.m", "P = tf(1, [1 2]);").contains("no dead time"));
        assert!(words("p.m", "P = tf(1, [1 2], 1e-3); delay_s = 0;").contains("a discrete model"));
        assert!(words("p.m", "P = tf(1, [1 2]); delay_s = 0;").contains("position_unit = 'um'"));
        assert!(words("p.m", "P = tf('s');").contains("tf(num, den)"));
        assert!(words("p.py", "P = ct.tf([1, 2, [1, 2])").contains("p.py:"));
        assert!(words("p.py", "P = open('x')").contains("p.py:1:5"));
        assert!(words("p.m", "P = tf(1,[1 2]); Q = tf(1,[1 3]); delay_s=0;").contains("2 models, P, Q"));
        assert!(words("p.json", "{\"A\": 1,").contains("p.json:1:"));
        let deep = format!("P = {}1{}", "[".repeat(2000), "]".repeat(2000));
        assert!(words("p.py", &deep).contains("fewer brackets"));
        let signs = format!("P = {}1", "-".repeat(100_001));
        assert!(words("p.m", &signs).contains("no dead time") || words("p.m", &signs).contains("the names P"));
        assert!(words("p.m", "x = [1 2];\ny = [x x];").contains("p.m:2:6"));
        assert!(words("p.m", "P = 'open").contains("closing quotation mark"));
    }
}
