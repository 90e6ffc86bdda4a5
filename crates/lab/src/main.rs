//! `lab`: the tables and pictures of `results/`, made again.

use clap::{Parser, ValueEnum};
use servotune::document::write_text;
use servotune_lab as study;
use servotune_lab::{Study, StudyError};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Makes a table or picture of results/ again
#[derive(Debug, Parser)]
#[command(name = "lab", version, arg_required_else_help = true)]
#[command(after_help = "Example:\n  lab classes --out results")]
struct StudyArguments {
    /// Which study
    #[arg(value_enum)]
    study: StudyName,
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Sizes of the floor (study `fleet-scale`)
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [1_000, 10_000, 100_000])]
    sizes: Vec<usize>,
    /// Kills (studies `fleet-kills`, 500 unless told, and `reliability-fleet`, 300)
    #[arg(long, value_name = "N")]
    kills: Option<usize>,
    /// Changed bytes (study `reliability-fleet`)
    #[arg(long, value_name = "N", default_value_t = 1000)]
    changes: usize,
    /// Changed files (study `reliability-readers`)
    #[arg(long, value_name = "N", default_value_t = 12_000)]
    runs: usize,
    /// Cases to make again, all unless told: the others keep their lines (study `abroad`), or cases and diagnoses are written instead of the page (study `sealed`)
    #[arg(long, value_name = "ID,ID,...", value_delimiter = ',')]
    cases: Vec<String>,
    /// Seed of the set (studies `sealed`, `sealed-digests` and `false-alarms`)
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Cases of the set (studies `sealed` and `sealed-digests`, 208 unless told, and `false-alarms`, 260)
    #[arg(long, value_name = "N")]
    count: Option<usize>,
    /// Lines that a run printed: the page is of these cases, and nothing is run (studies `sealed` and `false-alarms`)
    #[arg(long, value_name = "FILE")]
    lines: Option<PathBuf>,
    /// Folder with the measured records (studies `mirror`, `mirror-inputs`, `motor`, `hdd`)
    #[arg(long, value_name = "DIR", default_value = "../shared/data")]
    data: PathBuf,
}

/// The studies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum StudyName {
    /// Diagnoses of machines of another make and of real recordings in the folder --data, before and after
    Abroad,
    /// The four machine classes under one controller (figures 16-22)
    Classes,
    /// Real recordings whose missing law has no name or is the sensor's: curves, and the fit before and after
    FreeForm,
    /// The gate on the production line (Table 3, figures 24, 35-39)
    Gate,
    /// The gate over 20 seeds, on fresh lines and on unknown kinds
    GateSeeds,
    /// 100 000 random loops of known truth against the certificate; mutated tables; the four machines
    Certificate,
    /// The write over boxes of parameters: proved bounds against members drawn from the box
    CertificateWrite,
    /// The ladder of Table 1 and figures 6, 9, 12-14
    Ladder,
    /// The production line in features (figures 24-34)
    Line,
    /// The DFT under gains never run, predicted and recorded
    Prediction,
    /// 200 random plants of order 22: response, frequency and margin errors
    Plants,
    /// The nine measured responses of a fast steering mirror
    Mirror,
    /// The same mirror with its three inputs at once, each axis diagnosed
    MirrorInputs,
    /// 64 testers of 16 slots from raw files, three times
    Fleet,
    /// A run killed 500 times
    FleetKills,
    /// Kills of run, approve, apply and rollback, and changed bytes of the store
    ReliabilityFleet,
    /// Slots per second and memory over the size of the floor
    FleetScale,
    /// Coverage over the number of shared tables for 1000 slots
    FleetShared,
    /// What the diagnosis says of cases on which nothing acts, and how often it is an alarm
    FalseAlarms,
    /// Changed files through every reader; memory and time of the largest inputs
    ReliabilityReaders,
    /// Diagnoses of the cases in the folder --data, beside their answers
    Mismatch,
    /// The digests of a sealed set of other forms, to be published before it is run
    SealedDigests,
    /// The diagnosis on a sealed set of other forms
    Sealed,
    /// Real recordings: EMPS, Silverbox, motor bench, pulley drive, linear guide, diagnosed from a linear model; the mirror's response
    Recordings,
    /// The motor bench with flexible coupling, measured
    Motor,
    /// The nine cases of the public HDD benchmark plant
    Hdd,
}

fn main() -> ExitCode {
    let mut say = |text: &str| {
        // There is nowhere to report that stderr is closed.
        let _ = writeln!(std::io::stderr().lock(), "{text}");
    };
    match run(&StudyArguments::parse(), &mut say) {
        Ok(files) => {
            let lines: String = files.iter().map(|f| format!("{}\n", f.display())).collect();
            let _ = std::io::stdout().lock().write_all(lines.as_bytes());
            ExitCode::SUCCESS
        }
        Err(e) => {
            say(&format!("error: {e}"));
            ExitCode::from(2)
        }
    }
}

/// What a study made: pages still to be written, or files that it wrote itself.
enum Made {
    Pages(Study),
    Files(Vec<PathBuf>),
}

fn run(a: &StudyArguments, say: &mut (dyn FnMut(&str) + Send)) -> Result<Vec<PathBuf>, StudyError> {
    use Made::{Files, Pages};
    let made = match a.study {
        StudyName::Fleet => Files(study::floor(&a.out, say)?),
        StudyName::FleetKills => Files(study::kills(&a.out, a.kills.unwrap_or(500), say)?),
        StudyName::FleetScale => Files(study::scale(&a.out, &a.sizes, say)?),
        StudyName::FleetShared => Files(study::shared(&a.out, say)?),
        StudyName::ReliabilityFleet => {
            let mut files = study::reliability(&a.out, a.kills.unwrap_or(300), a.changes, say)?;
            files.push(both_halves(&a.out)?);
            Files(files)
        }
        StudyName::ReliabilityReaders => {
            let mut files = study::readers(&a.out, a.runs, say)?;
            files.push(both_halves(&a.out)?);
            Files(files)
        }
        StudyName::Abroad => {
            let known = std::fs::read_to_string(a.out.join("mismatch/abroad.json")).ok();
            Pages(study::abroad(&a.data, &a.cases, known.as_deref(), say)?)
        }
        StudyName::SealedDigests => Pages(study::digests(a.seed, a.count)),
        StudyName::Sealed if !a.cases.is_empty() => Pages(study::sealed_cases(a.seed, a.count, &a.cases, say)?),
        StudyName::Sealed => {
            let known = std::fs::read_to_string(a.out.join("mismatch/sealed_digests.txt")).ok();
            Pages(match &a.lines {
                Some(file) => study::sealed_of_lines(a.seed, known.as_deref(), &lines_of(file)?)?,
                None => study::sealed(a.seed, a.count, known.as_deref(), say)?,
            })
        }
        StudyName::Classes => Pages(study::classes()?),
        StudyName::FreeForm => Pages(study::free_form(&a.data)?),
        StudyName::Gate => Pages(study::gate()?),
        StudyName::GateSeeds => Pages(study::gate_seeds()?),
        StudyName::Certificate => Pages(study::certificate(&a.data, say)?),
        StudyName::CertificateWrite => Pages(study::certificate_write(&a.data, say)?),
        StudyName::Ladder => Pages(study::ladder()?),
        StudyName::Line => Pages(study::line_study()?),
        StudyName::Prediction => Pages(study::prediction()?),
        StudyName::Plants => Pages(study::plants()?),
        StudyName::Mirror => Pages(study::mirror(&a.data)?),
        StudyName::MirrorInputs => Pages(study::mirror_inputs(&a.data, say)?),
        StudyName::FalseAlarms => Pages(match &a.lines {
            Some(file) => study::false_alarms_of_lines(a.seed, &lines_of(file)?)?,
            None => study::false_alarms(a.seed, a.count, say)?,
        }),
        StudyName::Mismatch => Pages(study::mismatch(&a.data)?),
        StudyName::Recordings => Pages(study::recordings(&a.data, say)?),
        StudyName::Motor => Pages(study::motor(&a.data)?),
        StudyName::Hdd => Pages(study::hdd(&a.data)?),
    };
    let pages = match made {
        Files(files) => return Ok(files),
        Pages(pages) => pages,
    };
    let write = |(name, content): &(String, String)| {
        let file = a.out.join(name);
        write_text(&file, content)?;
        Ok(file)
    };
    pages.files.iter().map(write).collect()
}

/// The lines that a run printed.
fn lines_of(file: &Path) -> Result<String, StudyError> {
    let refused = |source| StudyError::Child { what: format!("read {}", file.display()), source };
    std::fs::read_to_string(file).map_err(refused)
}

/// `reliability.md`: the halves that the folder holds, one below the other.
///
/// Each half takes minutes and is made again on its own.
fn both_halves(out: &Path) -> Result<PathBuf, StudyError> {
    let mut page = "# What a hostile trial finds\n\nThe halves are made by the commands that they name; each of them writes this page anew from what stands in the folder.\n".to_owned();
    for (name, study) in
        [("reliability_readers.md", "reliability-readers"), ("reliability_fleet.md", "reliability-fleet")]
    {
        match std::fs::read_to_string(out.join(name)) {
            // Headings go one step down, below the title.
            Ok(half) => page.extend(half.lines().flat_map(|l| ["\n", if l.starts_with('#') { "#" } else { "" }, l])),
            Err(_) => page += &format!("\nNot made yet: `lab {study} --out {}`.", out.display()),
        }
        page.push('\n');
    }
    let file = out.join("reliability.md");
    write_text(&file, &page)?;
    Ok(file)
}
