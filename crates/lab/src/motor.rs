//! The motor bench: its response from the record, a two-mass model, a controller.
//!
//! Data: T. Beauduin, W. Ohnishi, Hori-Fujimoto Lab, MIT licence (see the page).

use super::measured::{Axis, axis_page, percent, tune_axis, tuned_table};
use super::{Study, StudyError};
use servotune::frf::{PeriodicSettings, periodic};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, identify};
use servotune::recording::read_columns;
use servotune_report::identified::{identified_figure, identified_sentences, order_table, parameter_table};
use std::f64::consts::TAU;
use std::path::Path;

/// Samples in one period of the multisine, periods left out at the start, first and last excited line (Hz).
const PERIOD: usize = 2500;
const DISCARD: usize = 2;
const LINES: std::ops::RangeInclusive<usize> = 11..=250;

/// Makes the study from the folder of measured records.
pub fn motor(data: &Path) -> Result<Study, StudyError> {
    let file = data.join("motor_bench/motor_bench_multisineA.csv.gz");
    if !file.exists() {
        return Err(StudyError::Absent { file });
    }
    let record = read_columns(&file, &["t_s", "iq_meas_A", "theta_motor_rad"])?;
    let sample_time_s = record.sample_time_s("t_s", &file)?;
    let how = PeriodicSettings {
        period: PERIOD,
        discard: DISCARD,
        lines: Some(LINES.collect()),
        ..PeriodicSettings::default()
    };
    let estimate = periodic(record.get("iq_meas_A"), record.get("theta_motor_rad"), sample_time_s, &how)?;
    let settings = IdentifySettings {
        position_unit: "rad".into(),
        command_unit: "A".into(),
        body: BodyChoice::FreeInertia,
        order: OrderChoice::Fixed(1),
        ..IdentifySettings::default()
    };
    let identified = identify(&estimate.frf, &settings)?;
    let freely = identify(&estimate.frf, &IdentifySettings { order: OrderChoice::Auto { max: 6 }, ..settings })?;
    let (dip, peak) =
        identified.plant.modes.first().map_or((f64::NAN, f64::NAN), |m| (m.zero_rad_s / TAU, m.pole_rad_s / TAU));
    let axis = Axis { name: "motor".into(), diagonal: true, flat_at_rest: false, frf: estimate.frf, identified };
    let spec = include_str!("specs/motor.toml");
    let tuned = tune_axis(&axis, spec, include_str!("specs/motor_profile.toml"), sample_time_s)?;
    let id = &axis.identified;
    let mut study = Study::default();
    study.picture("motor_bench", &identified_figure(&axis.frf, id, "Motor bench: motor angle over current")?);
    let blocks = [parameter_table(id)?, order_table(&freely)?].map(|t| format!("```text\n{}```\n", t.text()));
    let text = format!(
        "# Motor bench with flexible coupling: measured response\n\n\
         Made by `lab motor --data DATA --out results`, DATA being the folder with `motor_bench/`. Source: FdiTools, Hori-Fujimoto Lab \
         (T. Beauduin, W. Ohnishi), MIT licence.\n\n\
         Response of the motor angle to the measured current, {} periods of 1 s averaged after {DISCARD} left out, lines 11 to 250 Hz; its \
         deviation comes from the scatter between periods. {}\n\nMedian error {:.2} %. Anti-resonance {dip:.2} Hz and resonance {peak:.2} Hz; the \
         data's description gives 53 and 77 Hz on its 1 Hz grid. The model is that of two masses and a shaft, order 4; left free, the program takes order {} \
         ({:.2} % rms), see the second table.\n\n{}\n```text\n{}```\n\n{WORDS}\n",
        estimate.averaged,
        identified_sentences(id).join(" "),
        percent(&id.residual, 0.5),
        freely.plant.order(),
        100.0 * freely.rms_relative_error,
        blocks.join("\n"),
        tuned_table(std::slice::from_ref(&tuned))?.text(),
    );
    study.page("motor_bench.md", text);
    study.page("motor_bench.html", axis_page(&tuned)?);
    Ok(study)
}

/// What fits, what does not, and why.
const WORDS: &str = "What fits: the rigid body below 46 Hz and the pair of anti-resonance and resonance, both within 1 Hz of the values given with the data. What \
does not: between and around the two the two-mass model errs by up to a fifth, far more than the scatter between periods (0.6 % of a line at the median \
after averaging). Left free, the order grows to 12 and still leaves 5 %: the record holds something that no linear model of moderate order follows, friction \
and backlash being the usual suspects; nothing here tells which, and none is named. The controller is tuned on the measured response, not on that model.";
