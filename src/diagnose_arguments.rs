//! Words of `servotune diagnose`.

use clap::Args;
use servotune::recording::{ColumnNames, RecordSettings};
use std::path::PathBuf;

/// Where simulation and recordings differ, what physics is missing, the fit before and after
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("records").required(true).multiple(true))]
#[command(after_help = "Examples:
  servotune diagnose P001 --out P001_diagnosis
  servotune diagnose P001 --bootstrap 199 --out P001_diagnosis
  servotune diagnose --plant axis.toml --record lap.csv.gz --columns time=t_s,reference=qg_m,position=qm_m,command=vir_V --rows 0:12480 --holdout-rows 12480:24841 --out axis
  servotune diagnose --plant box.toml --record box.csv.gz --columns position=V2_V,command=V1_V --sample-rate-hz 610.35 --rows 40650:105712 --holdout-rows 105712:127400 --out box
  servotune diagnose --rules
  servotune diagnose --effects

CASE_DIR holds case.toml. Written: diagnosis.json, plant_corrected.toml where the model changed, report.html,
coupling.csv where `further_inputs` of case.toml move the position (impulse responses over time).
Ends with 1 where the verdict is data_fault, located_unexplained or undecidable.")]
pub(super) struct DiagnoseArguments {
    /// Folder with case.toml
    #[arg(value_name = "CASE_DIR", group = "records", conflicts_with_all = ["record", "plant"])]
    pub case: Option<PathBuf>,
    /// Record to fit, straight from a CSV; may be repeated
    #[arg(long, value_name = "FILE", group = "records", requires = "plant")]
    pub record: Vec<PathBuf>,
    /// Record to judge on, never used for the fit; may be repeated
    #[arg(long, value_name = "FILE", requires = "record")]
    pub holdout: Vec<PathBuf>,
    /// The records of --record are repeats of one another
    #[arg(long, requires = "record")]
    pub repeats: bool,
    /// Plant model for --record
    #[arg(long, value_name = "PLANT", requires = "record")]
    pub plant: Option<PathBuf>,
    /// Controller for --record; the command is taken as given without it
    #[arg(long, value_name = "CONTROLLER", requires = "record")]
    pub controller: Option<PathBuf>,
    /// Names of the file's columns, as time=NAME,reference=NAME,excitation=NAME,command=NAME,position=NAME
    #[arg(long, value_name = "MAP", value_parser = columns)]
    pub columns: Option<ColumnNames>,
    /// Sample rate where the file has no clock (Hz)
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub sample_rate_hz: Option<f64>,
    /// Rows of --record to fit, FIRST:LAST, the last one excluded
    #[arg(long, value_name = "FIRST:LAST", value_parser = rows, requires = "record")]
    pub rows: Option<[usize; 2]>,
    /// Rows of --record to judge on
    #[arg(long, value_name = "FIRST:LAST", value_parser = rows, requires = "record")]
    pub holdout_rows: Option<[usize; 2]>,
    /// Spindle frequency (Hz) for --record
    #[arg(long, value_name = "HZ", value_parser = positive, requires = "record")]
    pub spindle_hz: Option<f64>,
    /// Draws of the parametric bootstrap: the whole search on so many sets of records without physics, as a check of its false
    /// alarms; 99 or more let findings be withdrawn that noise gives as often as once in a hundred times
    #[arg(long, value_name = "DRAWS", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    pub bootstrap: u32,
    /// Print the decision rules of the diagnosis, and do nothing else
    #[arg(long, group = "records", conflicts_with_all = ["case", "record"])]
    pub rules: bool,
    /// Print the catalogue of effects: laws, keys, ranges, experiments, sources, and do nothing else
    #[arg(long, group = "records", conflicts_with_all = ["case", "record", "rules"])]
    pub effects: bool,
    /// Folder to write to
    #[arg(
        long,
        value_name = "DIR",
        required = false,
        required_unless_present_any = ["rules", "effects"],
        default_value_ifs([("rules", "true", "."), ("effects", "true", ".")])
    )]
    pub out: PathBuf,
}

impl DiagnoseArguments {
    /// A case folder, nothing else asked for.
    pub(super) fn of_case(case: PathBuf, out: PathBuf) -> DiagnoseArguments {
        DiagnoseArguments {
            case: Some(case),
            record: Vec::new(),
            holdout: Vec::new(),
            repeats: false,
            plant: None,
            controller: None,
            columns: None,
            sample_rate_hz: None,
            rows: None,
            holdout_rows: None,
            spindle_hz: None,
            bootstrap: 0,
            rules: false,
            effects: false,
            out,
        }
    }

    /// How records are read.
    pub(super) fn settings(&self, rows: Option<[usize; 2]>) -> RecordSettings {
        RecordSettings {
            names: self.columns.clone().unwrap_or_default(),
            sample_time_s: self.sample_rate_hz.map(f64::recip),
            rows,
            further: vec![],
        }
    }
}

fn columns(text: &str) -> Result<ColumnNames, String> {
    let mut names = ColumnNames::default();
    for pair in text.split(',') {
        let wrong = || {
            format!("found `{pair}`; expected KEY=NAME with KEY one of time, reference, excitation, command, position")
        };
        let (key, name) = pair.split_once('=').ok_or_else(wrong)?;
        let place = match key.trim() {
            "time" => &mut names.time,
            "reference" => &mut names.reference,
            "excitation" => &mut names.excitation,
            "command" => &mut names.command,
            "position" => &mut names.position,
            _ => return Err(wrong()),
        };
        *place = name.trim().to_owned();
    }
    Ok(names)
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() && v > 0.0 => Ok(v),
        _ => Err(format!("found `{text}`; expected a number above 0")),
    }
}

fn rows(text: &str) -> Result<[usize; 2], String> {
    let wrong = || format!("found `{text}`; expected FIRST:LAST, such as 0:12480");
    let (first, last) = text.split_once(':').ok_or_else(wrong)?;
    match (first.parse::<usize>(), last.parse::<usize>()) {
        (Ok(first), Ok(last)) if first < last => Ok([first, last]),
        _ => Err(wrong()),
    }
}
