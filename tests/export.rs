//! Exported code gives the library's commands: to the last bit in C, to the bit in integers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stderr)]

use crate::program_common::{folder, root, servotune};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

const NOMINAL: &str = "specs/controllers/nominal.toml";

fn export(gains: &str, form: &str, out: &Path, more: &[&str]) -> Value {
    let words = ["export", gains, "--as", form, "--out", out.to_str().unwrap(), "--json"];
    let ran = servotune(&[&words[..], more].concat());
    assert_eq!(ran.code, 0, "{}", ran.err);
    serde_json::from_str(&ran.out).unwrap()
}

/// Compiles a header with its test and runs it: the samples that differ, and what it printed.
fn run_header(header: &Path, main: &str) -> String {
    let dir = header.parent().unwrap();
    let source = dir.join("main.c");
    std::fs::write(&source, main).unwrap();
    let program = dir.join("run");
    let cc = Command::new("cc")
        .args(["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-ffp-contract=off", "-o"])
        .args([&program, &source])
        .output()
        .expect("a C compiler, cc: apt has gcc");
    assert!(cc.status.success(), "{}", String::from_utf8_lossy(&cc.stderr));
    String::from_utf8(Command::new(&program).output().unwrap().stdout).unwrap()
}

/// Nominal gains with a limit that bites and a feed-forward.
fn whole_controller(dir: &Path) -> String {
    let text = std::fs::read_to_string(root(NOMINAL)).unwrap();
    let file = dir.join("controller.toml");
    std::fs::write(
        &file,
        text + "\n[feedforward]\nfactor = 0.9\nvelocity_s = 1e-3\nacceleration_s2 = 2e-6\nahead_samples = 3\n",
    )
    .unwrap();
    file.to_str().unwrap().to_owned()
}

#[test]
fn the_c_header_gives_the_library_s_commands_to_the_last_bit() {
    let dir = folder("export_c");
    for (case, gains) in
        [NOMINAL.to_owned(), whole_controller(&dir), "examples/galvo/controller.toml".to_owned()].iter().enumerate()
    {
        let header = dir.join(format!("controller{case}.h"));
        export(gains, "c", &header, &["--name", "axis1"]);
        let main = format!(
            "#define AXIS1_TEST\n#include \"controller{case}.h\"\n#include <stdio.h>\nint main(void) {{ printf(\"%d of %d\\n\", axis1_test(), AXIS1_TEST_SAMPLES); return 0; }}\n"
        );
        assert_eq!(run_header(&header, &main), "0 of 64\n", "{gains}");
    }
}

/// Not against the vector in the header, which the same program wrote, but against the closed loop of the library's own law.
#[test]
fn the_c_code_runs_a_long_record_as_the_library_does() {
    use servotune::controller::{ControlLaw, Controller};
    let dir = folder("export_long");
    let header = dir.join("controller.h");
    export(NOMINAL, "c", &header, &[]);
    let controller: Controller = toml::from_str(&std::fs::read_to_string(root(NOMINAL)).unwrap()).unwrap();
    let law = ControlLaw::new(&controller).unwrap();
    let error: Vec<f64> = (0..5000).map(|k| 0.02 * (f64::from(k) * 0.01).sin() + 0.5 / (1.0 + f64::from(k))).collect();
    let command = law.replay_from(law.rest(), &vec![0.0; error.len()], &error);
    let main = "#include \"controller.h\"\n#include <stdio.h>\n#include <math.h>\nint main(void) { servo_state s = {{{0.0}}}; double e; \
                while (scanf(\"%lf\", &e) == 1) printf(\"%.17g\\n\", servo_limit(servo_step(&s, e))); return 0; }\n";
    run_header(&header, main);
    let input: String = error.iter().map(|e| format!("{e:e}\n")).collect();
    std::fs::write(dir.join("errors.txt"), input).unwrap();
    let ran =
        Command::new(dir.join("run")).stdin(std::fs::File::open(dir.join("errors.txt")).unwrap()).output().unwrap();
    let found: Vec<f64> = String::from_utf8(ran.stdout).unwrap().lines().map(|l| l.parse().unwrap()).collect();
    assert_eq!(found.len(), command.len());
    let wrong = found.iter().zip(&command).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    assert_eq!(wrong, 0);
}

#[test]
fn fixed_words_run_to_the_bit_and_say_what_they_cost() {
    let dir = folder("export_fixed");
    let mut deviation = Vec::new();
    for bits in ["16", "24", "32"] {
        let header = dir.join(format!("fixed{bits}.h"));
        let plant = ["--word-length", bits, "--plant", "specs/machines/healthy.toml"];
        let document = export(NOMINAL, "fixed", &header, &plant);
        let effect = &document["effect"];
        assert_eq!(effect["margins"].as_array().unwrap().len(), 2);
        deviation.push(effect["response_deviation"].as_f64().unwrap());
        let main = format!(
            "#define SERVO_TEST\n#include \"fixed{bits}.h\"\n#include <stdio.h>\nint main(void) {{ printf(\"%d\\n\", servo_test()); return 0; }}\n"
        );
        assert_eq!(run_header(&header, &main), "0\n", "{bits} bits");
        if bits == "32" {
            assert!(effect["command_deviation"].as_f64().unwrap() < 1e-4, "{effect}");
            let phase = |i: usize| effect["margins"][i]["phase_margin_deg"].as_f64().unwrap();
            assert!((phase(0) - phase(1)).abs() < 1e-2, "{effect}");
        }
    }
    assert!(deviation[0] > deviation[1] && deviation[1] > deviation[2], "{deviation:?}");
}

/// Numbers of the other forms, since no PLC and no MATLAB is at hand: every coefficient stands there with all its digits.
#[test]
fn structured_text_and_matlab_carry_every_coefficient() {
    use servotune::controller::Controller;
    let dir = folder("export_text");
    let gains = whole_controller(&dir);
    let controller: Controller = toml::from_str(&std::fs::read_to_string(&gains).unwrap()).unwrap();
    let chain = controller.sections().unwrap().chain;
    for form in ["st", "matlab"] {
        let out = dir.join(form);
        export(&gains, form, &out, &[]);
        let text = std::fs::read_to_string(&out).unwrap();
        let numbers: Vec<f64> = text
            .split(|c: char| !(c.is_ascii_alphanumeric() || "+-.".contains(c)))
            .filter_map(|w| w.parse().ok())
            .collect();
        for s in &chain {
            for c in [s.b0, s.b1, s.b2, s.a1, s.a2] {
                assert!(numbers.contains(&c), "{form}: {c:e} is missing");
            }
        }
    }
    let block = std::fs::read_to_string(dir.join("st")).unwrap();
    assert!(block.contains("FUNCTION_BLOCK servo") && block.contains("END_FUNCTION_BLOCK") && block.contains("LIMIT("));
}

#[test]
fn an_export_never_takes_the_place_of_its_gains() {
    let dir = folder("export_lost");
    let gains = whole_controller(&dir);
    let ran = servotune(&["export", &gains, "--as", "c", "--out", &gains, "--force"]);
    assert!(ran.code == 2 && ran.err.contains("also given as"), "{}", ran.err);
    let ran = servotune(&["export", &gains, "--as", "c", "--out", dir.join("x.h").to_str().unwrap(), "--name", "9x"]);
    assert!(ran.code == 2 && ran.err.contains("a letter"), "{}", ran.err);
}

/// Every form read again by the program gives the same margins; the text of python-control is run by it where it is installed.
#[test]
fn a_plant_goes_out_and_comes_back() {
    let dir = folder("export_plant");
    let plant = "specs/machines/healthy.toml";
    let margins = |plant: &str| -> Value {
        let ran = servotune(&["margins", "--plant", plant, "--controller", NOMINAL, "--json"]);
        serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{e}: {}", ran.err))
    };
    let truth = margins(plant);
    for (form, ending) in [("matlab", "m"), ("python", "py"), ("zpk", "json"), ("ss", "json"), ("tf", "json")] {
        let out = dir.join(format!("plant_{form}.{ending}"));
        let words = ["export", plant, "--as", form, "--out", out.to_str().unwrap(), "--json"];
        let ran = servotune(&words);
        if form == "tf" && ran.code == 2 {
            // Twenty poles: coefficients may lose them, and then it says so.
            assert!(ran.err.contains("loses digits"), "{}", ran.err);
            continue;
        }
        assert_eq!(ran.code, 0, "{form}: {}", ran.err);
        let said: Value = serde_json::from_str(&ran.out).unwrap();
        assert!(said["response_deviation"].as_f64().unwrap() < 1e-6);
        let found = margins(out.to_str().unwrap());
        for key in ["phase_margin_deg", "gain_margin_db", "max_sensitivity", "gain_crossover_hz"] {
            let (a, b) = (truth[key].as_f64().unwrap(), found[key].as_f64().unwrap());
            assert!((a / b - 1.0).abs() < 1e-5, "{form} {key}: {a} {b}");
        }
        assert_eq!(servotune(&["check", out.to_str().unwrap()]).code, 0, "{form}");
    }
    let small = dir.join("small.toml");
    let text = "position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\ngain = 8.0\nzeros_rad_s = [-900]\npoles_rad_s = [0, -40, [-100, 5000]]\ndelay_s = 1e-4\n";
    std::fs::write(&small, text).unwrap();
    for (form, ending) in [("tf", "json"), ("python", "py")] {
        let out = dir.join(format!("small_{form}.{ending}"));
        let words = ["export", small.to_str().unwrap(), "--as", form, "--out", out.to_str().unwrap()];
        assert_eq!(servotune(&words).code, 0, "{form}");
    }
    // (j w + 900) 8/(j w (j w + 40) (...)) at 1000 rad/s, by numpy's own solver of the states.
    let script = "exec(open('small_python.py').read())\ns = 1000j\nwant = 8*(s+900)/(s*(s+40)*((s+100)**2+25e6))\nassert abs(P(s)/want-1) < 1e-9, (P(s), want)\nprint('same')\n";
    match Command::new("python3").args(["-c", script]).current_dir(&dir).output() {
        Ok(ran) if ran.status.success() => assert_eq!(String::from_utf8_lossy(&ran.stdout), "same\n"),
        Ok(ran) if String::from_utf8_lossy(&ran.stderr).contains("No module named") => {
            eprintln!("skipped: python-control is not installed (pip install control)");
        }
        Ok(ran) => panic!("{}", String::from_utf8_lossy(&ran.stderr)),
        Err(_) => eprintln!("skipped: no python3"),
    }
}

#[test]
fn forms_of_plants_and_of_controllers_are_told_apart() {
    let dir = folder("export_forms");
    let out = dir.join("x.txt");
    let out = out.to_str().unwrap();
    let ran = servotune(&["export", "specs/machines/healthy.toml", "--as", "c", "--out", out]);
    assert!(ran.code == 2 && ran.err.contains("forms of a controller"), "{}", ran.err);
    let ran = servotune(&["export", NOMINAL, "--as", "ss", "--out", out]);
    assert!(ran.code == 2 && ran.err.contains("forms of a plant"), "{}", ran.err);
}
