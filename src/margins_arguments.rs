//! The words of `servotune margins`.

use super::sweep_arguments::{MeasuredArguments, ReadingArguments};
use clap::Args;
use std::path::PathBuf;

/// Margins of the open loop: crossings, gain, phase, delay, modulus and disk margin
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("machine").required(true))]
#[command(after_help = "Examples:
  servotune margins --plant specs/machines/healthy.toml --controller specs/controllers/nominal.toml
  servotune margins --plant plant_corrected.toml --controller specs/controllers/nominal.toml --amplitudes 0.02:15
  servotune margins --plant plant.toml --controller today.toml --controller gains.toml --report margins.html
  servotune margins --frf slot07.bod --controller specs/controllers/nominal.toml
  servotune margins --frf sensitivity.csv --measured S --controller specs/controllers/nominal.toml
  servotune margins --frf bearing.bod --unstable-poles 1 --controller bearing_controller.toml")]
pub(super) struct MarginsArguments {
    /// Plant model (plant.toml)
    #[arg(long, value_name = "PLANT", group = "machine")]
    pub plant: Option<PathBuf>,
    /// Swept-sine file: margins of the measured response, each with a 95 % interval
    #[arg(long, value_name = "FRF", group = "machine")]
    pub frf: Option<PathBuf>,
    /// The sweep was taken through the controller's own hold, which is then not applied again
    #[arg(long, requires = "frf")]
    pub hold_included: bool,
    /// Controller (controller.toml) or gain table (gains.toml); of a model it may be given several times: each is judged, and the page shows
    /// all of them in the same pictures
    #[arg(long, value_name = "CONTROLLER", required = true)]
    pub controller: Vec<PathBuf>,
    /// HTML page to write: the loop of a model, its sensitivity functions, its steps
    #[arg(long, value_name = "FILE", conflicts_with = "frf")]
    pub report: Option<PathBuf>,
    /// Replace what stands at the place of the page; it is kept under another name, which is said
    #[arg(long)]
    pub force: bool,
    /// Amplitudes of the position at which physics beyond linear is described (position_unit)
    #[arg(long, value_name = "LOW:HIGH", default_value = "0.15:15", value_parser = amplitudes, conflicts_with = "frf")]
    pub amplitudes: (f64, f64),
    /// Poles of the plant in the right half-plane: no sweep shows them, and the count of the loop's unstable poles needs them
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with = "plant")]
    pub unstable_poles: usize,
    #[command(flatten)]
    pub reading: ReadingArguments,
    #[command(flatten)]
    pub taken: MeasuredArguments,
}

fn amplitudes(text: &str) -> Result<(f64, f64), String> {
    let wrong = || format!("found `{text}`; expected LOW:HIGH with 0 < LOW <= HIGH, such as 0.15:15");
    let (low, high) = text.split_once(':').ok_or_else(wrong)?;
    match (low.parse::<f64>(), high.parse::<f64>()) {
        (Ok(low), Ok(high)) if 0.0 < low && low <= high && high.is_finite() => Ok((low, high)),
        _ => Err(wrong()),
    }
}
