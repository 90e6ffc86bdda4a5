//! Time and memory of a whole diagnosis: 20 records of 6000 samples, three of 100 000, ten of 100 000; the whole library, no bootstrap.
//!
//! `cargo bench --bench diagnose [-- --out FOLDER] [--row N --keep FOLDER]` prints the table; with `--out` it is also written to
//! `FOLDER/speed.md`. `--row` makes one row only, and `--keep` writes its case and leaves it there. Machines: the
//! paper's tunable one with nothing missing and with one, two or three effects. Records are made by `twin::recording` and written to files
//! before the clock starts; reading them counts. Memory is the peak of this process since the case was begun, where the system tells it.
#![allow(clippy::print_stdout)]

use servotune::diagnose::{DiagnoseSettings, diagnose};
use servotune::document::write_text;
use servotune::numeric::random::Random;
use servotune::physics::LawSetting;
use servotune::physics::encoder_cyclic_error::{EncoderCyclicError, Harmonics};
use servotune::physics::pivot_friction::{Loading, PivotFriction};
use servotune::physics::torque_factor_rolloff::{Shape, TorqueFactorRolloff};
use servotune::recording::{Case, RecordSettings};
use servotune::twin::recording::{multisine, record, scene, stroke};
use servotune::twin::{MachineClass, nominal_controller, paper_machine};
use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Samples of a short record, and of a period of the excitation of a long one.
const SAMPLES: usize = 6000;
const LONG: usize = 100_000;
/// White noise of the encoder, rms (track).
const NOISE: f64 = 3e-3;
/// Name, rms of the excitation (V), length of the move (track), repeats, whether it is for judging only.
type Records = [(&'static str, f64, f64, usize, bool)];
/// 20 records.
const SHORT_RECORDS: &Records = &[
    ("multisine_small", 0.02, 0.0, 4, false),
    ("multisine_large", 0.08, 0.0, 4, false),
    ("move_short", 0.0, 3.0, 3, false),
    ("move_long", 0.0, 12.0, 3, false),
    ("both", 0.04, 8.0, 2, false),
    ("held_multisine", 0.05, 0.0, 2, true),
    ("held_move", 0.0, 15.0, 1, true),
    ("held_both", 0.03, 10.0, 1, true),
];
/// Three records, and ten.
const THREE: &Records =
    &[("multisine", 0.08, 0.0, 1, false), ("both", 0.04, 12.0, 1, false), ("held", 0.05, 8.0, 1, true)];
const TEN: &Records = &[
    ("multisine_small", 0.02, 0.0, 2, false),
    ("multisine_large", 0.08, 0.0, 2, false),
    ("both", 0.04, 12.0, 4, false),
    ("held", 0.05, 8.0, 2, true),
];

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Writes the case of the paper's tunable machine with these effects.
fn write_case(folder: &Path, effects: &[LawSetting], samples: usize, records: &Records) -> Outcome<()> {
    let plant = paper_machine(MachineClass::Tunable)?;
    let controller = nominal_controller()?;
    let t = controller.sample_time_s;
    write_text(&folder.join("plant.toml"), &toml::to_string(&servotune::lti::PlantFile::from(&plant))?)?;
    write_text(&folder.join("controller.toml"), &toml::to_string(&controller)?)?;
    let mut case = "id = \"speed\"\nplant = \"plant.toml\"\ncontroller = \"controller.toml\"\n".to_owned();
    let scene = scene(&plant, t, 15.0, samples, NOISE);
    let effects: Vec<&LawSetting> = effects.iter().collect();
    let mut draw = 0;
    for (name, rms, distance, repeats, held) in records {
        let period = if *rms > 0.0 { multisine(SAMPLES, 220, *rms) } else { vec![0.0; SAMPLES] };
        let excitation: Vec<f64> = period.iter().cycle().take(samples).copied().collect();
        let reference = stroke(samples, samples / 10, samples / 3, *distance);
        for i in 1..=*repeats {
            let mut random = Random::stream(71, draw);
            draw += 1;
            let rows = record(&scene, &effects, &controller, &reference, &excitation, &mut random)?;
            let mut text = "time_s,reference,excitation,command,position\n".to_owned();
            for (k, [r, d, u, y]) in rows.iter().enumerate() {
                writeln!(text, "{:.7},{r:.9},{d:.9},{u:.9},{y:.9}", k as f64 * t)?;
            }
            let file = format!("records/{name}_{i}.csv");
            write_text(&folder.join(&file), &text)?;
            let role = if *held { "holdout" } else { "fit" };
            write!(case, "\n[[records]]\nfile = \"{file}\"\nrole = \"{role}\"\nrepeat_group = \"{name}\"\n")?;
        }
    }
    Ok(write_text(&folder.join("case.toml"), &case)?)
}

/// Processor time of this process so far (s), ended threads included, where the system tells it.
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = text.rsplit(')').next().unwrap_or_default();
    let ticks: Vec<f64> = after.split_whitespace().skip(11).take(2).filter_map(|v| v.parse().ok()).collect();
    // Linux counts these in hundredths of a second on every architecture.
    if ticks.len() == 2 { ticks.iter().sum::<f64>() / 100.0 } else { f64::NAN }
}

/// Begins the peak of the memory anew, where the system can.
fn forget_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Largest memory of this process since then (MiB).
fn peak_mib() -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib = text.lines().find_map(|l| l.strip_prefix("VmHWM:")?.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kib.map_or(f64::NAN, |k| k / 1024.0)
}

fn run() -> Outcome<()> {
    let words: Vec<String> = std::env::args().collect();
    let option = |name: &str| words.iter().position(|w| w == name).and_then(|i| words.get(i + 1));
    let out = option("--out").map(PathBuf::from);
    let only: Option<usize> = option("--row").map(|n| n.parse()).transpose()?;
    let keep = option("--keep").map(PathBuf::from);
    let friction = || LawSetting::new(PivotFriction::of(2.5, Loading::Dahl), vec![0.012]);
    // 8 % less torque at the ends of the travel.
    let rolloff = || LawSetting::new(TorqueFactorRolloff { shape: Shape::Parabola }, vec![0.0, 0.08, 0.0, 0.0]);
    let grating =
        || LawSetting::new(EncoderCyclicError { period: 1.0, harmonics: Harmonics::First }, vec![0.02, 0.01, 0.0, 0.0]);
    let machines: [(&str, Vec<LawSetting>, usize, &Records); 7] = [
        ("nothing missing", vec![], SAMPLES, SHORT_RECORDS),
        ("bearing that sticks", vec![friction()], SAMPLES, SHORT_RECORDS),
        ("bearing that sticks, torque factor that falls off", vec![friction(), rolloff()], SAMPLES, SHORT_RECORDS),
        ("bearing, torque factor, grating with a wave", vec![friction(), rolloff(), grating()], SAMPLES, SHORT_RECORDS),
        ("nothing missing", vec![], LONG, THREE),
        ("bearing that sticks", vec![friction()], LONG, THREE),
        ("bearing that sticks", vec![friction()], LONG, TEN),
    ];
    let mut page = String::from(
        "| machine | records | samples of each | verdict | findings | wall (s) | processor (s) | memory (MiB) |\n|---|---|---|---|---|---|---|---|\n",
    );
    for (row, (name, effects, samples, records)) in machines.into_iter().enumerate() {
        if only.is_some_and(|n| n != row + 1) {
            continue;
        }
        let own = std::env::temp_dir().join(format!("servotune-speed-{}", std::process::id()));
        let folder = keep.clone().unwrap_or(own);
        write_case(&folder, &effects, samples, records)?;
        forget_peak();
        let (clock, cpu) = (Instant::now(), cpu_s());
        let case = Case::read(&folder, &RecordSettings::default())?;
        let done = diagnose(
            &case,
            &paper_machine(MachineClass::Tunable)?,
            Some(&nominal_controller()?),
            &DiagnoseSettings::default(),
            |_| {},
        )?;
        let names: Vec<&str> = done.diagnosis.findings.iter().map(|f| f.effect.as_str()).collect();
        let row = format!(
            "| {name} | {} | {samples} | {:?} | {} | {:.1} | {:.1} | {:.0} |",
            case.records.len(),
            done.diagnosis.verdict,
            if names.is_empty() { "none".to_owned() } else { names.join(", ") },
            clock.elapsed().as_secs_f64(),
            cpu_s() - cpu,
            peak_mib()
        );
        println!("{row}");
        writeln!(page, "{row}")?;
        if keep.is_none() {
            std::fs::remove_dir_all(&folder)?;
        }
    }
    if let Some(out) = out {
        let cores = std::thread::available_parallelism().map_or(0, usize::from);
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let load = load.split_whitespace().take(2).collect::<Vec<_>>().join(" and ");
        write_text(
            &out.join("speed.md"),
            &format!(
                "# Time and memory of a diagnosis\n\nMade by `cargo bench --bench diagnose -- --out results/mismatch`: the whole library, no bootstrap, reading of the records included, {cores} cores.\n\nThe load average of the last one and five minutes at the end was {load}; other programs lengthen the wall time where it is above {cores}.\n\nAims on 2 cores: 20 records of 6000 samples in 5 s with nothing missing and 20 s with three findings; three records of 100 000 samples in 60 s and 1024 MiB.\n\n{page}"
            ),
        )?;
    }
    Ok(())
}

fn main() -> Outcome<()> {
    run()
}
