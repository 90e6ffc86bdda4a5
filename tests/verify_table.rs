//! `servotune verify` as a person runs it: a table that holds, and what happens when a digit of it changes.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use servotune::document::sha256_hex;
use servotune::lti::{Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::tune::{GainTable, InputDigest, Machine, Spec, TuneSettings, tune};
use servotune::twin::nominal_controller;
use servotune::twin::plants::{log_grid, measure};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

const PLANT: &str = include_str!("../specs/machines/tunable.toml");
const SPEC: &str = include_str!("../specs/limits/paper.toml");
const PROFILE: &str = include_str!("../specs/profiles/spiral.toml");

/// The paper's spec as it stands in a folder.
fn paper_spec() -> String {
    SPEC.replace("../profiles/spiral.toml", "spiral.toml")
}

/// A table tuned to these limits, from a few starts.
fn tuned(spec_text: &str, profile: &str) -> GainTable {
    let read: PlantFile = servotune::document::parse_toml(Path::new("plant"), PLANT).unwrap();
    let plant = Plant::try_from(read).unwrap();
    let spec = Spec::parse(spec_text, profile).unwrap();
    let settings = TuneSettings { starts: 4, ..TuneSettings::default() };
    let outcome = tune(&Machine::Model(&plant), &spec, Some(&nominal_controller().unwrap()), &settings).unwrap();
    let inputs = vec![InputDigest { role: "plant".into(), sha256: sha256_hex(PLANT.as_bytes()) }];
    GainTable::of(&outcome, 1, sha256_hex(spec_text.as_bytes()), inputs).unwrap()
}

/// A folder with plant, the paper's spec, profile and a tuned table, which is made once.
fn folder(name: &str) -> PathBuf {
    static TABLE: LazyLock<GainTable> = LazyLock::new(|| tuned(&paper_spec(), PROFILE));
    folder_of(name, &paper_spec(), PROFILE, &TABLE)
}

fn folder_of(name: &str, spec_text: &str, profile: &str, table: &GainTable) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("servotune_verify_{name}_{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    table.write(&dir.join("gains.toml")).unwrap();
    for (file, text) in [("plant.toml", PLANT), ("spec.toml", spec_text), ("spiral.toml", profile)] {
        std::fs::write(dir.join(file), text).unwrap();
    }
    dir
}

fn verify(dir: &Path, more: &[&str]) -> (i32, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_servotune"))
        .current_dir(dir)
        .args(["verify", "gains.toml", "--plant", "plant.toml", "--spec", "spec.toml"])
        .args(more)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    (out.status.code().unwrap(), text)
}

#[test]
fn a_table_is_proved_and_every_change_is_seen() {
    let dir = folder("table");
    let (code, text) = verify(&dir, &["--out", "gains.certificate.json"]);
    assert_eq!(code, 0, "{text}");
    // Again, now with the certificate beside it.
    let (code, text) = verify(&dir, &[]);
    assert_eq!(code, 0, "{text}");
    let gains = std::fs::read_to_string(dir.join("gains.toml")).unwrap();
    let line = gains.lines().find(|l| l.starts_with("b0 =")).unwrap();
    let value: f64 = line[4..].trim().parse().unwrap();
    std::fs::write(dir.join("gains.toml"), gains.replacen(line, &format!("b0 = {:?}", value * 1.001), 1)).unwrap();
    let (code, text) = verify(&dir, &[]);
    assert!(code == 1 && text.contains("[[section]] 0: b0"), "{text}");
    // The last digit of a figure: nothing but the certificate sees it.
    let line = gains.lines().rfind(|l| l.starts_with("dft_low =")).unwrap();
    let last = line.chars().last().unwrap().to_digit(10).unwrap();
    let changed = format!("{}{}", &line[..line.len() - 1], (last + 1) % 10);
    std::fs::write(dir.join("gains.toml"), gains.replace(line, &changed)).unwrap();
    let (code, text) = verify(&dir, &[]);
    assert!(code == 1 && text.contains("gains_sha256"), "{text}");
    // Another plant.
    std::fs::write(dir.join("gains.toml"), &gains).unwrap();
    std::fs::write(dir.join("plant.toml"), PLANT.replace("63.75", "63.76")).unwrap();
    let (code, text) = verify(&dir, &[]);
    assert!(code == 1 && text.contains("Another plant"), "{text}");
    // Physics is refused by name.
    std::fs::write(dir.join("plant.toml"), format!("{PLANT}\n[[plant.physics]]\neffect = \"slew_limit\"\n")).unwrap();
    let (code, text) = verify(&dir, &[]);
    assert!(code == 2 && text.contains("slew_limit"), "{text}");
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_band_above_half_the_rate_of_the_record_has_no_figure_and_hinders_no_proof() {
    let spec = "sample_time_s = 3.96e-5\nprofile = \"spiral.toml\"\n[objective]\nminimise = \"pes_rms\"\n[margins]\nmax_sensitivity = 2.4\n";
    // Half of 1 kHz lies below both bands.
    let slow = PROFILE.replace("27480", "1000").replace("[200, 400]", "[20, 50]");
    assert_ne!(slow, PROFILE);
    let dir = folder_of("no_bin", spec, &slow, &tuned(spec, &slow));
    assert!(!std::fs::read_to_string(dir.join("gains.toml")).unwrap().contains("dft_low"));
    let (code, text) = verify(&dir, &[]);
    assert_eq!(code, 0, "{text}");
    std::fs::remove_dir_all(&dir).unwrap();
}

fn run(dir: &Path, words: &[&str]) -> (i32, String, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_servotune")).current_dir(dir).args(words).output().unwrap();
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    (out.status.code().unwrap(), text(&out.stdout), text(&out.stderr))
}

#[test]
fn tune_proves_its_table_and_says_so() {
    let dir = folder("beside");
    std::fs::write(dir.join("start.toml"), include_str!("../specs/controllers/nominal.toml")).unwrap();
    let words = ["tune", "--plant", "plant.toml", "--spec", "spec.toml", "--controller", "start.toml", "--starts", "4"];
    let with = |more: &[&'static str]| run(&dir, &[&words[..], more].concat());
    let (code, text, _) = with(&["--out", "mine.toml"]);
    assert!(code == 0 && text.contains("Proved: every limit holds at every frequency"), "{text}");
    // Another run of the proof repeats the certificate, value by value.
    let verify = ["verify", "mine.toml", "--plant", "plant.toml", "--spec", "spec.toml"];
    let (code, _, said) = run(&dir, &verify);
    assert!(code == 0 && said.contains("checked against mine.certificate.json"), "{said}");
    let (code, text, _) = with(&["--out", "bare.toml", "--no-certificate", "--json"]);
    let document: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(code == 0 && document["certificate"].is_null() && !dir.join("bare.certificate.json").exists());
    // Limits that nobody meets: the compromise has a certificate that names them.
    let hard = std::fs::read_to_string(dir.join("spec.toml"))
        .unwrap()
        .replace("max_sensitivity = 2.4", "max_sensitivity = 1.05");
    std::fs::write(dir.join("hard.toml"), hard).unwrap();
    let words = [
        "tune",
        "--plant",
        "plant.toml",
        "--spec",
        "hard.toml",
        "--sample-time-s",
        "3.96e-5",
        "--starts",
        "2",
        "--keep-infeasible",
        "--json",
    ];
    let (code, text, _) = run(&dir, &[&words[..], &["--out", "hard_gains.toml"]].concat());
    let document: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, document["certificate"]["proved"].as_bool()), (1, Some(false)), "{text}");
    assert!(document["certificate"]["says"].as_str().unwrap().contains("max_sensitivity at most 1.05"), "{text}");
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_table_tuned_on_a_sweep_says_what_the_sweep_does_not_prove() {
    let dir = folder("swept");
    let read: PlantFile = servotune::document::parse_toml(Path::new("plant"), PLANT).unwrap();
    let plant = Plant::try_from(read).unwrap();
    let grid = log_grid(20.0, 12_000.0, 400);
    let frf = measure(&plant, &grid, 0.0, &mut Random::new(1)).unwrap();
    let rows: Vec<String> = grid
        .iter()
        .zip(frf.value())
        .map(|(w, p)| format!("{},{},{}", w / TAU, 20.0 * p.norm().log10(), p.arg().to_degrees()))
        .collect();
    std::fs::write(dir.join("sweep.csv"), rows.join("\n") + "\n").unwrap();
    let words = [
        "tune",
        "--frf",
        "sweep.csv",
        "--phase",
        "response",
        "--spec",
        "spec.toml",
        "--sample-time-s",
        "3.96e-5",
        "--starts",
        "4",
        "--json",
    ];
    let (_, text, said) =
        run(&dir, &[&words[..], &["--out", "mine.toml", "--report", "slot.html", "--keep-infeasible"]].concat());
    let document: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{said}"));
    // The page's curves are the model's: what the table of limits was judged on is said beside it.
    let page = std::fs::read_to_string(dir.join("slot.html")).unwrap();
    assert!(page.contains("judged on the measured response"));
    let proof = &document["certificate"];
    let says = proof["says"].as_str().unwrap();
    assert!(proof["proved"] == false && says.contains("a sweep alone does not prove it"), "{says}");
    // The unit in words, not the name of a field.
    assert!(says.contains("position units") && !says.contains("position_unit"), "{says}");
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn what_is_wrong_is_named_with_its_file() {
    let dir = folder("odd");
    let gains = std::fs::read_to_string(dir.join("gains.toml")).unwrap();
    let spec = std::fs::read_to_string(dir.join("spec.toml")).unwrap();
    let changed = |text: &str, key: &str, value: &str| {
        let line = text.lines().find(|l| l.starts_with(key)).unwrap();
        text.replacen(line, &format!("{key} = {value}"), 1)
    };
    std::fs::write(dir.join("words.json"), "no certificate").unwrap();
    let good = "tests/invalid_sweeps/good.bod";
    let short: String = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(good)).unwrap();
    let short: String = short.lines().take(6).map(|l| format!("{l}\n")).collect();
    std::fs::write(dir.join("short.bod"), short).unwrap();
    for (file, text, more, said) in [
        (
            "spec.toml",
            changed(&spec, "max_sensitivity", "0.9"),
            &[][..],
            vec!["spec.toml: margins.max_sensitivity = 0.9", "expected"],
        ),
        ("gains.toml", changed(&gains, "kp", "nan"), &[], vec!["gains.toml: pid.kp = NaN", "expected"]),
        ("gains.toml", changed(&gains, "b0", "inf"), &[], vec!["gains.toml: [[section]] 0", "inf", "expected"]),
        ("spec.toml", spec.clone(), &["--certificate", "words.json"], vec!["words.json", "expected a certificate"]),
        (
            "spec.toml",
            spec.clone(),
            &["--frf", "short.bod", "--phase", "response"],
            vec!["sweep 1: 5 points", "at least", "sweep more"],
        ),
    ] {
        let old = std::fs::read_to_string(dir.join(file)).unwrap();
        std::fs::write(dir.join(file), text).unwrap();
        let (code, answer) = verify(&dir, more);
        assert_eq!(code, 2, "{said:?}: {answer}");
        for word in &said {
            assert!(answer.contains(word), "`{word}` is missing in: {answer}");
        }
        std::fs::write(dir.join(file), old).unwrap();
    }
}
