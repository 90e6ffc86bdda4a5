//! The words of `servotune verify`.

use super::sweep_arguments::{MeasuredArguments, ReadingArguments};
use clap::Args;
use servotune::verify::{LEAST_DAMPING, Uncertainty, Word};
use std::path::PathBuf;

/// Prove a gain table again from the raw files, by algorithms that the search does not use
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune verify gains.toml --plant plant.toml --spec spec.toml
  servotune verify gains.toml --plant room.toml --plant cold.toml --plant hot.toml --spec spec.toml --uncertainty gain=5%,frequency=2%,damping=20%,delay=5%
  servotune verify gains.toml --plant cold.toml --plant hot.toml --spec spec.toml --report proof.html
  servotune verify gains.toml --frf slot07.bod --min-damping 0.01 --spec spec.toml
  servotune verify gains.toml --plant plant.toml --spec spec.toml --word-length 24 --fraction-bits 20 --out gains.certificate.json
  servotune verify gains.toml --plant plant.toml --spec spec.toml --certificate gains.certificate.json

A certificate beside the table (gains.certificate.json for gains.toml) is checked too. Exit codes: 0 proved, 1 a limit is not proved or something was
changed, 2 could not do it.")]
pub(super) struct VerifyArguments {
    /// Gain table (gains.toml)
    #[arg(value_name = "GAINS")]
    pub gains: PathBuf,
    /// Plant model; given several times, each is a case that must pass
    #[arg(long, value_name = "PLANT", required_unless_present = "frf")]
    pub plant: Vec<PathBuf>,
    /// Swept-sine file; given several times, each is a case that must pass. Of a sweep the margins are proved, not the write
    #[arg(long, value_name = "FRF")]
    pub frf: Vec<PathBuf>,
    /// No mode has less damping: what may hide between the points of a sweep follows from it
    #[arg(long, value_name = "RATIO", default_value_t = LEAST_DAMPING, requires = "frf")]
    pub min_damping: f64,
    /// The sweep was taken through the controller's own hold, which is then not applied again
    #[arg(long, requires = "frf")]
    pub hold_included: bool,
    /// Poles of the swept plant in the right half-plane: no sweep shows them
    #[arg(long, value_name = "N", default_value_t = 0, requires = "frf")]
    pub unstable_poles: usize,
    /// Controller that ran while the sweeps were taken, for --measured other than P
    #[arg(long, value_name = "CONTROLLER", requires = "frf")]
    pub controller: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArguments,
    #[command(flatten)]
    pub taken: MeasuredArguments,
    /// Limits and write (spec.toml)
    #[arg(long, value_name = "SPEC")]
    pub spec: PathBuf,
    /// Box around every plant, such as gain=5%,frequency=2%,damping=20%,delay=5%; margins, DFT figures, harmonics and the
    /// command's peak are then bounded over all of it
    #[arg(long, value_name = "SHARES", value_parser = uncertainty)]
    pub uncertainty: Option<Uncertainty>,
    /// Coefficients are held in words of this many bits (fixed point)
    #[arg(long, value_name = "BITS", requires = "fraction_bits", conflicts_with = "single")]
    pub word_length: Option<u32>,
    /// Bits behind the point
    #[arg(long, value_name = "BITS", requires = "word_length")]
    pub fraction_bits: Option<u32>,
    /// Coefficients are held in single precision
    #[arg(long)]
    pub single: bool,
    /// Certificate to check against the proof; word and uncertainty are taken from it where not given
    #[arg(long, value_name = "CERTIFICATE")]
    pub certificate: Option<PathBuf>,
    /// Certificate to write
    #[arg(long, value_name = "CERTIFICATE")]
    pub out: Option<PathBuf>,
    /// HTML page to write: every limit with its proven interval, machine by machine, what is left open, the box
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Replace what stands at the place of the page; it is kept under another name, which is said
    #[arg(long, requires = "report")]
    pub force: bool,
}

impl VerifyArguments {
    /// The word asked for.
    pub(super) fn word(&self) -> Option<Word> {
        match (self.single, self.word_length, self.fraction_bits) {
            (true, ..) => Some(Word::Single),
            (false, Some(bits), Some(fraction)) => Some(Word::Fixed { bits, fraction }),
            _ => None,
        }
    }
}

/// Shares of a box, such as gain=5%,frequency=2%.
pub(super) fn uncertainty(text: &str) -> Result<Uncertainty, String> {
    let mut u = Uncertainty::default();
    let mut seen: Vec<&str> = Vec::new();
    for part in text.split(',') {
        let wrong =
            || format!("found `{part}`; expected gain, frequency, damping or delay with a share, such as gain=5%");
        let (key, share) = part.split_once('=').ok_or_else(wrong)?;
        let (number, scale) = match share.trim().strip_suffix('%') {
            Some(n) => (n, 0.01),
            None => (share.trim(), 1.0),
        };
        let value = number.trim().parse::<f64>().map_err(|_| wrong())? * scale;
        if !(0.0..1.0).contains(&value) {
            let meant = if (1.0..100.0).contains(&value) {
                format!("; did you mean {}={value}%?", key.trim())
            } else {
                String::new()
            };
            return Err(format!("found `{part}`; expected a share of at least 0 and below 100 %{meant}"));
        }
        if seen.contains(&key.trim()) {
            return Err(format!("found `{}` twice; expected each once", key.trim()));
        }
        seen.push(key.trim());
        match key.trim() {
            "gain" => u.gain = value,
            "frequency" => u.frequency = value,
            "damping" => u.damping = value,
            "delay" => u.delay = value,
            _ => return Err(wrong()),
        }
    }
    Ok(u)
}
