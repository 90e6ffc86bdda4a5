//! What a person sees: every command on good and on odd input, with exit codes and both streams.
#![allow(clippy::unwrap_used)]

use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

fn root(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// An empty folder of this test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

struct Ran {
    code: i32,
    out: String,
    err: String,
}

fn servotune(arguments: &[&str]) -> Ran {
    let ran = Command::new(env!("CARGO_BIN_EXE_servotune")).current_dir(root("")).args(arguments).output().unwrap();
    Ran {
        code: ran.status.code().unwrap(),
        out: String::from_utf8(ran.stdout).unwrap(),
        err: String::from_utf8(ran.stderr).unwrap(),
    }
}

fn json(ran: &Ran) -> Value {
    serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{e}: {}", ran.out))
}

const HEALTHY: &str = "specs/machines/healthy.toml";
const NOMINAL: &str = "specs/controllers/nominal.toml";
const SPIRAL: &str = "specs/profiles/spiral.toml";
const PAPER: &str = "specs/limits/paper.toml";

#[test]
fn margins_has_the_contract_s_keys_and_text_has_the_same_numbers() {
    let ran = servotune(&["margins", "--plant", HEALTHY, "--controller", NOMINAL, "--json"]);
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
    let m = json(&ran);
    for key in [
        "stable",
        "phase_margin_deg",
        "gain_crossover_hz",
        "gain_margin_db",
        "phase_crossover_hz",
        "max_sensitivity",
        "max_sensitivity_hz",
        "modulus_margin",
        "delay_margin_s",
        "disk_margin",
        "gain_crossings",
        "phase_crossings",
    ] {
        assert!(!m[key].is_null(), "{key}");
    }
    assert!((m["modulus_margin"].as_f64().unwrap() * m["max_sensitivity"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    let text = servotune(&["margins", "--plant", HEALTHY, "--controller", NOMINAL]).out;
    assert!(text.contains(&format!("{:.3}", m["phase_margin_deg"].as_f64().unwrap())), "{text}");
}

#[test]
fn an_unstable_loop_ends_with_1() {
    let dir = folder("unstable");
    let hot = std::fs::read_to_string(root(NOMINAL)).unwrap().replace("kd_s = 3.7e-4", "kd_s = 3.7e-3");
    let file = dir.join("hot.toml");
    std::fs::write(&file, hot).unwrap();
    let ran = servotune(&["margins", "--plant", HEALTHY, "--controller", file.to_str().unwrap(), "--json"]);
    assert_eq!(ran.code, 1);
    assert_eq!(json(&ran)["stable"], false);
    let ran = servotune(&["simulate", "--plant", HEALTHY, "--controller", file.to_str().unwrap(), "--profile", SPIRAL]);
    assert_eq!(ran.code, 1);
    assert!(ran.out.contains("UNSTABLE"));
}

#[test]
fn simulate_gives_pes_and_figures() {
    let ran = servotune(&["simulate", "--plant", HEALTHY, "--controller", NOMINAL, "--profile", SPIRAL, "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let s = json(&ran);
    // 60 ms at 27 480 Hz, both ends.
    assert_eq!(s["pes"].as_array().unwrap().len(), 1649);
    let harmonics = s["harmonics"].as_array().unwrap();
    assert_eq!(harmonics.len(), 100);
    assert!((harmonics[4]["hz"].as_f64().unwrap() - 5.0 * 27_480.0 / 200.0).abs() < 1e-9);
    let norm = |low: f64, high: f64| {
        let inside = harmonics.iter().filter(|h| (low..=high).contains(&h["hz"].as_f64().unwrap()));
        inside.map(|h| h["amplitude"].as_f64().unwrap().powi(2)).sum::<f64>().sqrt()
    };
    assert!((s["dft_low"].as_f64().unwrap() / norm(600.0, 1500.0) - 1.0).abs() < 1e-12);
    assert!((s["dft_high"].as_f64().unwrap() / norm(1500.0, 3000.0) - 1.0).abs() < 1e-12);
}

/// The demo, which takes a minute: made once for all that look at it.
fn demo() -> &'static (PathBuf, Ran) {
    static DEMO: OnceLock<(PathBuf, Ran)> = OnceLock::new();
    DEMO.get_or_init(|| {
        let dir = folder("demo");
        let ran = servotune(&["demo", "--out", dir.to_str().unwrap()]);
        assert_eq!(ran.code, 0, "{}\n{}", ran.out, ran.err);
        (dir, ran)
    })
}

#[test]
fn the_demo_runs_the_chain_and_names_its_report() {
    let (dir, ran) = demo();
    let last = ran.out.lines().last().unwrap();
    let report = last.strip_prefix("Open this report: ").unwrap();
    let page = std::fs::read_to_string(report).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("Model or measured response"));
    // The tester at the end has its page, which leads to the reports of its worst slots.
    let floor = std::fs::read_to_string(dir.join("floor_results/fleet.html")).unwrap();
    let reports = std::fs::read_dir(dir.join("floor_results/slots")).unwrap().count();
    assert!(reports > 0 && floor.matches("href=\"slots/").count() >= reports);
    // The table is a controller again, and meets its limits by the margins command too.
    let gains = dir.join("gains.toml");
    let machine = "specs/machines/tunable.toml";
    let m = json(&servotune(&["margins", "--plant", machine, "--controller", gains.to_str().unwrap(), "--json"]));
    assert_eq!(m["stable"], true);
    // The sweep had 1 % noise and the gains were tuned on it: the true margin may miss the limit of 34 deg by the noise.
    assert!(m["phase_margin_deg"].as_f64().unwrap() > 32.0);
}

#[test]
fn identify_and_tune_from_files() {
    let dir = folder("files");
    let (sweep, plant, gains) = (demo().0.join("response.bod"), dir.join("p.toml"), dir.join("g.toml"));
    let (sweep, plant, gains) = (sweep.to_str().unwrap(), plant.to_str().unwrap(), gains.to_str().unwrap());
    let ran = servotune(&["identify", sweep, "--out", plant, "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.err.contains("phase margin"), "the decision about the phase is said: {}", ran.err);
    let id = json(&ran);
    assert_eq!(id["position_unit"], "track");
    let search = ["tune", "--plant", plant, "--spec", PAPER, "--controller", NOMINAL, "--starts", "4"];
    let tune = [&search[..], &["--out", gains, "--json"]].concat();
    let ran = servotune(&tune);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(json(&ran)["verdict"], "tuned");
    let first = std::fs::read(gains).unwrap();
    assert_eq!(servotune(&tune).code, 0);
    assert_eq!(first, std::fs::read(gains).unwrap(), "the same input gives the same bytes");
}

#[test]
fn limits_that_cannot_be_met_are_an_answer_and_leave_no_table() {
    let dir = folder("infeasible");
    let spec = dir.join("spec.toml");
    let text = std::fs::read_to_string(root(PAPER)).unwrap();
    let profile = root(SPIRAL);
    let text = text
        .replace("../profiles/spiral.toml", profile.to_str().unwrap())
        .replace("phase_margin_deg = 34.0", "phase_margin_deg = 75.0")
        .replace("[400.0, 900.0]", "[850.0, 900.0]");
    std::fs::write(&spec, text).unwrap();
    let gains = dir.join("gains.toml");
    let ran = servotune(&[
        "tune",
        "--plant",
        HEALTHY,
        "--spec",
        spec.to_str().unwrap(),
        "--sample-time-s",
        "39.6e-6",
        "--starts",
        "2",
        "--out",
        gains.to_str().unwrap(),
        "--json",
    ]);
    assert_eq!(ran.code, 1, "{}", ran.err);
    let answer = json(&ran);
    assert_eq!(answer["verdict"], "infeasible");
    assert!(!answer["conflicts"].as_array().unwrap().is_empty());
    assert!(!gains.exists());
}

#[test]
fn refusals_name_file_place_found_and_expected() {
    let dir = folder("refusals");
    let write = |name: &str, text: &str| {
        let file = dir.join(name);
        std::fs::write(&file, text).unwrap();
        file.to_str().unwrap().to_owned()
    };
    let typo = write("typo.toml", &std::fs::read_to_string(root(HEALTHY)).unwrap().replace("delay_s", "dealy_s"));
    let negative = write(
        "negative.toml",
        &std::fs::read_to_string(root(HEALTHY)).unwrap().replace("damping_ratio = 0.22", "damping_ratio = -0.22"),
    );
    let physics = write(
        "physics.toml",
        &(std::fs::read_to_string(root(HEALTHY)).unwrap() + "\n[[plant.physics]]\neffect = \"pivot_friction\"\n"),
    );
    let fast = write(
        "fast.toml",
        &std::fs::read_to_string(root(NOMINAL)).unwrap().replace("frequency_hz = 7000.0", "frequency_hz = 17000.0"),
    );
    let words = write("words.bod", "10 20 -10\n20 oops -20\n30 10 -30\n");
    let bytes = dir.join("bytes.toml").to_str().unwrap().to_owned();
    std::fs::write(&bytes, b"[plant]\xff\n").unwrap();
    let simulate =
        |profile: &str| servotune(&["simulate", "--plant", HEALTHY, "--controller", NOMINAL, "--profile", profile]);
    // Where nothing can be written is said before anything is searched.
    let (below, here) = (format!("{typo}/gains.toml"), dir.to_str().unwrap());
    let tune_into = |out: &str| servotune(&["tune", "--plant", HEALTHY, "--spec", "nowhere.toml", "--out", out]);
    let margins = |plant: &str, controller: &str| servotune(&["margins", "--plant", plant, "--controller", controller]);
    for (ran, said) in [
        (margins("nothing.toml", NOMINAL), vec!["nothing.toml", "cannot read", "check the name"]),
        (margins("specs", NOMINAL), vec!["specs", "expected a file, not a folder"]),
        (margins(&bytes, NOMINAL), vec!["bytes.toml", "byte 7", "UTF-8"]),
        (simulate(HEALTHY), vec!["healthy.toml", "command_unit", "[spiral]"]),
        (servotune(&["fleet", "run", HEALTHY, "--out", "unused"]), vec!["healthy.toml", "command_unit", "FLEET.toml"]),
        (tune_into(&below), vec!["typo.toml", "cannot write", "a part of this path is a file"]),
        (tune_into(here), vec!["refusals", "cannot write", "not a folder"]),
        (servotune(&["diagnose", "nowhere", "--out", &typo]), vec!["typo.toml", "cannot write", "is a file"]),
        (margins(&typo, NOMINAL), vec!["typo.toml:", "dealy_s", "delay_s"]),
        (margins(&negative, NOMINAL), vec!["negative.toml", "plant.damping_ratio = -0.22", "above 0"]),
        (margins(&physics, NOMINAL), vec!["physics.toml", "pivot_friction"]),
        (margins(HEALTHY, &fast), vec!["fast.toml", "17000", "half the sample rate"]),
        (servotune(&["identify", &words, "--out", "unused.toml"]), vec!["words.bod", "oops"]),
        (servotune(&["margins", "--controller", NOMINAL]), vec!["--plant", "--frf"]),
        (servotune(&["nonsense"]), vec!["nonsense"]),
    ] {
        assert_eq!(ran.code, 2, "{}", ran.err);
        assert!(ran.out.is_empty(), "{}", ran.out);
        for word in said {
            assert!(ran.err.contains(word), "`{word}` is missing in: {}", ran.err);
        }
    }
    assert!(!root("unused.toml").exists());
}

#[test]
fn help_shows_examples_and_ends_with_0() {
    for command in
        ["", "demo", "identify", "margins", "simulate", "tune", "verify", "init", "check", "export", "completions"]
    {
        let arguments: Vec<&str> = [command, "--help"].into_iter().filter(|a| !a.is_empty()).collect();
        let ran = servotune(&arguments);
        assert_eq!(ran.code, 0);
        assert!(command.is_empty() || ran.out.contains("Example"), "{command}: {}", ran.out);
    }
}

#[test]
fn physics_of_a_plant_file_is_used_or_refused_by_name() {
    let dir = folder("physics");
    let with = |name: &str, tables: &str| {
        let file = dir.join(name);
        std::fs::write(&file, std::fs::read_to_string(root(HEALTHY)).unwrap() + tables).unwrap();
        file.to_str().unwrap().to_owned()
    };
    let dry = with(
        "dry.toml",
        "\n[[plant.physics]]\neffect = \"coulomb_friction\"\nlevel_command = 0.02\n[[plant.physics]]\neffect = \"quantisation\"\n",
    );
    let ran = servotune(&["margins", "--plant", &dry, "--controller", NOMINAL, "--amplitudes", "0.3:15", "--json"]);
    let m = json(&ran);
    assert!(ran.err.contains("quantisation"), "{}", ran.err);
    assert_eq!(m["physics"], serde_json::json!(["coulomb_friction"]));
    let rows = m["by_amplitude"].as_array().unwrap();
    for key in ["amplitude", "phase_margin_deg", "gain_margin_db", "gain_crossover_hz", "max_sensitivity", "stable"] {
        assert!(rows.iter().all(|r| !r[key].is_null()), "{key}");
    }
    let worst = rows.iter().map(|r| r["phase_margin_deg"].as_f64().unwrap()).fold(f64::INFINITY, f64::min);
    assert_eq!(m["phase_margin_deg"].as_f64().unwrap(), worst);
    let ran = servotune(&["simulate", "--plant", &dry, "--controller", NOMINAL, "--profile", SPIRAL, "--json"]);
    assert_eq!((ran.code, &json(&ran)["physics"]), (0, &serde_json::json!(["coulomb_friction"])));
    let odd = with("odd.toml", "\n[[plant.physics]]\neffect = \"gremlins\"\n");
    let ran = servotune(&["simulate", "--plant", &odd, "--controller", NOMINAL, "--profile", SPIRAL]);
    assert_eq!(ran.code, 2);
    assert!(ran.err.contains("odd.toml") && ran.err.contains("gremlins"), "{}", ran.err);
}

/// Before the search, which takes minutes, not after it.
#[test]
fn a_result_that_cannot_be_written_is_refused_before_the_work() {
    let dir = folder("targets");
    let file = dir.join("file");
    std::fs::write(&file, "").unwrap();
    let below = file.join("x.json").to_str().unwrap().to_owned();
    let dir = dir.to_str().unwrap();
    let on = ["--plant", HEALTHY, "--spec", PAPER, "--out"];
    for command in [&["pareto"][..], &["tune"], &["verify", NOMINAL]] {
        for (out, said) in [(below.as_str(), "a part of this path is a file"), (dir, "expected a file, not a folder")] {
            let ran = servotune(&[command, &on, &[out]].concat());
            assert_eq!(ran.code, 2, "{command:?}: {}", ran.err);
            for word in [out, said, "cannot write"] {
                assert!(ran.err.contains(word), "{command:?}: `{word}` is missing in: {}", ran.err);
            }
            assert!(ran.out.is_empty(), "{}", ran.out);
        }
    }
    let ran = servotune(&["tune", "--plant", HEALTHY, "--spec", PAPER, "--out", "unused.toml", "--report", dir]);
    assert!(ran.code == 2 && ran.err.contains("expected a file, not a folder"), "{}", ran.err);
}

#[test]
fn pareto_and_next_sweep_refuse_what_they_cannot_do() {
    let dir = folder("counts");
    let write = |name: &str, text: String| {
        let file = dir.join(name);
        std::fs::write(&file, text).unwrap();
        file.to_str().unwrap().to_owned()
    };
    let healthy = std::fs::read_to_string(root(HEALTHY)).unwrap();
    let metres = write("metres.toml", healthy.replace("position_unit = \"track\"", "position_unit = \"m\""));
    let dry = write("dry.toml", healthy + "\n[[plant.physics]]\neffect = \"coulomb_friction\"\nlevel_command = 0.02\n");
    let on = |command: &str, plant: &str, more: &[&str]| {
        servotune(&[&[command, "--plant", plant, "--spec", PAPER], more].concat())
    };
    let next = |more: &[&str]| {
        let given = ["next-sweep", "--frf", "tests/invalid_sweeps/good.bod", "--controller", NOMINAL];
        servotune(&[&given, more].concat())
    };
    // The first rows of a sweep: too few, and an end before the crossing.
    let good = std::fs::read_to_string(root("tests/invalid_sweeps/good.bod")).unwrap();
    let swept = |rows: usize| {
        let text: String = good.lines().take(rows).map(|l| format!("{l}\n")).collect();
        let file = write(&format!("{rows}.bod"), text);
        servotune(&["next-sweep", "--frf", &file, "--controller", NOMINAL, "--phase", "response"])
    };
    let out = dir.join("unused.html").to_str().unwrap().to_owned();
    for (ran, said) in [
        (on("pareto", HEALTHY, &["--out", &out]), vec!["sample time", "--sample-time-s"]),
        (on("tune", HEALTHY, &["--out", &out]), vec!["sample time", "--sample-time-s"]),
        (on("pareto", HEALTHY, &["--out", &out, "--points", "1"]), vec!["--points", "`1`", "at least 2"]),
        (
            on("pareto", HEALTHY, &["--sample-time-s", "39.6e-6", "--out", &out, "--from", "3", "--to", "2"]),
            vec!["max_sensitivity from = 3", "less"],
        ),
        (on("pareto", HEALTHY, &["--out", &out, "--plant", &metres]), vec!["metres.toml", "`m`", "expected `track`"]),
        (on("pareto", &dry, &["--sample-time-s", "39.6e-6", "--out", &out]), vec!["coulomb_friction", "linear"]),
        (next(&["--tones", "0"]), vec!["--tones", "`0`", "at least 1"]),
        (swept(4), vec!["3 points", "at least 4", "sweep more"]),
        (swept(12), vec!["|L| = 20", "48.94 Hz", "below 1", "sweep on"]),
    ] {
        assert_eq!(ran.code, 2, "{}", ran.err);
        assert!(ran.out.is_empty(), "{}", ran.out);
        for word in said {
            assert!(ran.err.contains(word), "`{word}` is missing in: {}", ran.err);
        }
    }
    assert!(!dir.join("unused.html").exists());
    // Where no tone is worth its time, that is said.
    let ran = next(&[]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.out.contains("No tone narrows") && !ran.out.contains("-0.00"), "{}", ran.out);
}
