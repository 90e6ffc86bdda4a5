//! What a person can say about a sweep file and about the model wanted from it.

use clap::{Args, ValueEnum};
use servotune::frf::{
    AngleUnit, BadPoints, ColumnChoice, Conjugate, DeviationScale, Duplicates, FrequencyUnit, Hold, MagnitudeScale,
    Measured, Outliers, PhaseConvention, ReadSettings, Unsorted,
};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, ZeroSide};
use std::path::PathBuf;

/// How to read the sweep file; whatever is left at `auto` is decided from the file and said
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Reading the sweep")]
pub(super) struct ReadingArguments {
    /// What the phase column shows: auto, margin (response + 180 deg, wrapped) or response
    #[arg(long, default_value_t, value_name = "WORD")]
    phase: PhaseConvention,
    /// Scale of the magnitude column: auto, decibels or linear
    #[arg(long, default_value_t, value_name = "WORD")]
    magnitude: MagnitudeScale,
    /// Unit of the phase column: auto, degrees or radians
    #[arg(long, default_value_t, value_name = "WORD")]
    angle: AngleUnit,
    /// Unit of the frequency column: auto, hertz or rad_per_s
    #[arg(long, default_value_t, value_name = "WORD")]
    frequency: FrequencyUnit,
    /// Conjugated phase: auto (test, refuse when found), no (take as it is) or yes (undo)
    #[arg(long, default_value_t, value_name = "WORD")]
    conjugate: Conjugate,
    /// A frequency that stands twice: refuse or average
    #[arg(long, default_value_t, value_name = "WORD")]
    duplicates: Duplicates,
    /// Frequencies out of order: refuse or sort
    #[arg(long, default_value_t, value_name = "WORD")]
    unsorted: Unsorted,
    /// A row with NaN, an infinity or an empty field: refuse or drop
    #[arg(long, default_value_t, value_name = "WORD")]
    bad_points: BadPoints,
    /// A single point far off its neighbours: drop (with a note), keep (a resonance seen in one point) or refuse
    #[arg(long, default_value_t, value_name = "WORD")]
    outliers: Outliers,
    /// Scale of a column of deviations: auto, absolute or relative
    #[arg(long, default_value_t, value_name = "WORD")]
    deviation: DeviationScale,
    /// Columns by name: frequency=F,real=R,imaginary=I or frequency=F,magnitude=M,phase=P; also std=, coherence=
    #[arg(long, value_name = "LIST", value_parser = columns)]
    columns: Option<ColumnChoice>,
    /// Which response of a universal, MATLAB or Touchstone file, counted from 1
    #[arg(long, value_name = "N")]
    dataset: Option<usize>,
    /// Band that the sweep was meant to cover (Hz), as LOW:HIGH; an early stop is then refused
    #[arg(long, value_name = "LOW:HIGH", value_parser = band)]
    expect_hz: Option<(f64, f64)>,
}

impl ReadingArguments {
    pub(super) fn settings(&self) -> ReadSettings {
        ReadSettings {
            phase: self.phase,
            magnitude: self.magnitude,
            angle: self.angle,
            frequency: self.frequency,
            conjugate: self.conjugate,
            duplicates: self.duplicates,
            unsorted: self.unsorted,
            bad_points: self.bad_points,
            outliers: self.outliers,
            deviation: self.deviation,
            columns: self.columns.clone(),
            dataset: self.dataset,
            expected_hz: self.expect_hz,
            ..ReadSettings::default()
        }
    }
}

/// In what loop the sweep was taken
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Reading the sweep")]
pub(super) struct MeasuredArguments {
    /// What was swept: P, or in closed loop L, S, T, PS or CS with a known controller, out of which the plant is then opened
    #[arg(long, default_value_t, value_name = "WORD")]
    pub measured: Measured,
    /// Controller that ran while L, S, T, PS or CS was swept (controller.toml or gains.toml); --controller where absent
    #[arg(long, value_name = "CONTROLLER")]
    pub measured_with: Option<PathBuf>,
}

impl MeasuredArguments {
    /// Whether anything is said.
    pub(super) fn any(&self) -> bool {
        self.measured != Measured::Plant || self.measured_with.is_some()
    }
}

fn columns(list: &str) -> Result<ColumnChoice, String> {
    let mut choice = ColumnChoice::default();
    let mut roles: Vec<&str> = Vec::new();
    for part in list.split(',') {
        let (role, name) = part.split_once('=').ok_or_else(|| format!("found `{part}`; expected ROLE=COLUMN"))?;
        if roles.contains(&role) {
            return Err(format!("found the role `{role}` twice; expected each once"));
        }
        roles.push(role);
        let name = name.to_owned();
        match role {
            "frequency" => choice.frequency = name,
            "magnitude" => choice.magnitude = Some(name),
            "phase" => choice.phase = Some(name),
            "real" => choice.real = Some(name),
            "imaginary" => choice.imaginary = Some(name),
            "std" => choice.std = Some(name),
            "coherence" => choice.coherence = Some(name),
            _ => {
                let known = "frequency, magnitude, phase, real, imaginary, std, coherence";
                return Err(format!("found the role `{role}`; expected one of: {known}"));
            }
        }
    }
    if choice.frequency.is_empty() { Err("expected frequency=COLUMN among the columns".to_owned()) } else { Ok(choice) }
}

fn band(text: &str) -> Result<(f64, f64), String> {
    let wrong = || format!("found `{text}`; expected LOW:HIGH in Hz, such as 40:5000");
    let (low, high) = text.split_once(':').ok_or_else(wrong)?;
    match (low.trim().parse::<f64>(), high.trim().parse::<f64>()) {
        (Ok(low), Ok(high)) if low >= 0.0 && low < high && high.is_finite() => Ok((low, high)),
        _ => Err(wrong()),
    }
}

/// What model to look for
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "The model")]
pub(super) struct ModelArguments {
    /// Order of the model (even); chosen by held-out frequencies where absent
    #[arg(long, value_name = "N", value_parser = order)]
    order: Option<usize>,
    /// Largest order tried where --order is absent (even)
    #[arg(long, value_name = "N", default_value = "30", value_parser = order)]
    max_order: usize,
    /// Form of the rigid body
    #[arg(long, value_enum, default_value = "auto")]
    body: BodyWord,
    /// Zeros in the left half-plane only, as the paper demands
    #[arg(long)]
    minimum_phase: bool,
    /// The sweep was taken through the controller's hold at this sample time (s); it is divided out first
    #[arg(long, value_name = "SECONDS")]
    hold_s: Option<f64>,
    /// Band to fit (Hz), as LOW:HIGH; the whole sweep where absent
    #[arg(long, value_name = "LOW:HIGH", value_parser = band)]
    band_hz: Option<(f64, f64)>,
    /// Unit of position for the plant file
    #[arg(long, value_name = "WORD", default_value = "track")]
    pub position_unit: String,
    /// Unit of the command for the plant file
    #[arg(long, value_name = "WORD", default_value = "V")]
    pub command_unit: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum BodyWord {
    /// The form that the data support
    Auto,
    /// dc_gain w0^2/(s^2 + 2 z0 w0 s + w0^2)
    SecondOrder,
    /// acceleration_gain/(s^2 + viscous_rate s)
    FreeInertia,
}

fn order(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if n >= 2 && n % 2 == 0 && n <= 80 => Ok(n),
        _ => Err(format!(
            "found `{text}`; expected an even number from 2 to 80: 2 for the body and 2 for each resonance"
        )),
    }
}

impl ModelArguments {
    pub(super) fn settings(&self) -> IdentifySettings {
        let (low_hz, high_hz) = self.band_hz.unwrap_or((0.0, f64::MAX));
        IdentifySettings {
            position_unit: self.position_unit.clone(),
            command_unit: self.command_unit.clone(),
            low_hz,
            high_hz,
            body: match self.body {
                BodyWord::Auto => BodyChoice::Auto,
                BodyWord::SecondOrder => BodyChoice::SecondOrder,
                BodyWord::FreeInertia => BodyChoice::FreeInertia,
            },
            order: self
                .order
                .map_or(OrderChoice::Auto { max: self.max_order / 2 - 1 }, |n| OrderChoice::Fixed(n / 2 - 1)),
            zeros: if self.minimum_phase { ZeroSide::Left } else { ZeroSide::Either },
            ..IdentifySettings::default()
        }
    }

    /// The hold that is in the sweep: of a stated sample time, or of the controller's clock where it is only said to be there.
    pub fn hold(&self, clock: Option<f64>) -> Hold {
        Hold::of(self.hold_s.or(clock))
    }
}
