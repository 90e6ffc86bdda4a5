//! The nine measured responses of a fast steering mirror: identified, and a controller tuned for each axis.
//!
//! Data: CubeSpec fine steering mirror, M. Floren et al., ISMA-USD 2024, CC BY 4.0 (see the page).

use super::measured::{Axis, Tuned, axis_page, percent, tune_axis};
use super::{Study, StudyError};
use rayon::prelude::*;
use servotune::frf::{ColumnChoice, Frf, Hold, ReadSettings, read_file};
use servotune::identify::{IdentifySettings, OrderChoice, ZeroSide, identify};
use servotune_report::identified::identified_figure;
use servotune_report::number::NumberFormat;
use servotune_report::table::{Column, Table};
use std::f64::consts::TAU;
use std::path::Path;

/// Sample rate of the recording (Hz); the actuator's command is held over it.
pub(super) const RATE_HZ: f64 = 6400.0;
/// Band fitted (Hz): below, the two periods recorded scatter too much; above, the excitation ends.
pub(super) const BAND_HZ: (f64, f64) = (5.0, 2990.0);
/// Resonance pairs tried at most; the source fits 28 states to all nine responses together.
const PAIRS: usize = 20;

/// What fits, what does not, and why.
const WORDS: &str = "What fits: the flat part and the large resonances up to about 1 kHz, with the median error of the table, to be read beside \
the deviation of the data itself, which rests on two realisations only. What does not: deep anti-resonances, where the relative error is unbounded because the \
response is nearly nothing, and above about 1.2 kHz, where modes overlap; there the rms is ruled by a few points and the trusted band ends. The source fits 28 states \
to all nine responses at once with the absolute error of the outputs as its measure; a fit of each response alone on the log scale needs more pairs, because each \
carries its own zeros. Two of the three axes move against their command; their sign is turned before tuning.";

/// Makes the study from the folder of measured records.
pub fn mirror(data: &Path) -> Result<Study, StudyError> {
    let file = data.join("fsm_100mV/fsm_100mV_frf.csv.gz");
    if !file.exists() {
        return Err(StudyError::Absent { file });
    }
    let pairs: Vec<(usize, usize)> = (1..=3).flat_map(|i| (1..=3).map(move |j| (i, j))).collect();
    let axes = pairs.par_iter().map(|&(i, j)| axis(&file, i, j)).collect::<Result<Vec<Axis>, StudyError>>()?;
    let mut study = Study::default();
    let mut tuned = Vec::new();
    for a in axes.iter().filter(|a| a.diagonal) {
        tuned.push(tune_axis(
            a,
            include_str!("specs/mirror.toml"),
            include_str!("specs/mirror_profile.toml"),
            1.0 / RATE_HZ,
        )?);
    }
    for a in &axes {
        let figure = identified_figure(&a.frf, &a.identified, &format!("Mirror {}: measured and model", a.name))?;
        study.picture(&format!("mirror_{}", a.name), &figure);
    }
    for t in &tuned {
        study.page(&format!("mirror_{}.html", t.name), axis_page(t)?);
    }
    study.page("mirror.md", page(&axes, &tuned)?);
    Ok(study)
}

fn axis(file: &Path, i: usize, j: usize) -> Result<Axis, StudyError> {
    let name = format!("G{i}{j}");
    let measured = measured(file, &name)?;
    let settings = IdentifySettings {
        position_unit: "um".into(),
        low_hz: BAND_HZ.0,
        high_hz: BAND_HZ.1,
        order: OrderChoice::Auto { max: PAIRS },
        zeros: ZeroSide::Either,
        ..IdentifySettings::default()
    };
    let held = measured.clone().with_hold(Hold::Included { sample_time_s: 1.0 / RATE_HZ });
    let identified = identify(&held, &settings)?;
    // The first points scatter most and are outside the band; the rest of the sweep is the measurement.
    let frf = from(&measured, BAND_HZ.0)?;
    Ok(Axis { name, diagonal: i == j, flat_at_rest: true, frf, identified })
}

/// The measured response of an output to an input, `G11` to `G33` (um/V).
pub(super) fn measured(file: &Path, name: &str) -> Result<Frf, StudyError> {
    let columns = ColumnChoice {
        frequency: "f_Hz".into(),
        real: Some(format!("{name}_re_um_per_V")),
        imaginary: Some(format!("{name}_im_um_per_V")),
        std: Some(format!("{name}_total_std")),
        ..ColumnChoice::default()
    };
    Ok(read_file(file, &ReadSettings { columns: Some(columns), ..ReadSettings::default() })?.frf)
}

/// The response from `low_hz` on.
fn from(frf: &Frf, low_hz: f64) -> Result<Frf, StudyError> {
    let first = frf.w_rad_s().partition_point(|w| *w < low_hz * TAU);
    let std = frf.relative_std().map(|s| s[first..].to_vec());
    Ok(Frf::new(frf.w_rad_s()[first..].to_vec(), frf.value()[first..].to_vec(), std)?)
}

/// Median relative deviation of the points (%).
fn deviation(frf: &Frf) -> Option<f64> {
    let mut std = frf.relative_std()?.to_vec();
    std.sort_by(f64::total_cmp);
    Some(100.0 * std[std.len() / 2])
}

fn page(axes: &[Axis], tuned: &[Tuned]) -> Result<String, StudyError> {
    let digits = NumberFormat::Significant(3);
    let mut table = Table::new(
        "Nine responses",
        vec![
            Column::words("response"),
            Column::numbers("order", "", NumberFormat::Decimals(0)),
            Column::numbers("median deviation of the data", "%", digits),
            Column::numbers("median error", "%", digits),
            Column::numbers("rms error", "%", digits),
            Column::numbers("95th percentile", "%", digits),
            Column::numbers("trusted from", "Hz", digits),
            Column::numbers("to", "Hz", NumberFormat::Significant(4)),
        ],
    );
    for a in axes {
        let id = &a.identified;
        table.push(vec![
            a.name.as_str().into(),
            (id.plant.order() as f64).into(),
            deviation(&a.frf).into(),
            percent(&id.residual, 0.5).into(),
            (100.0 * id.rms_relative_error).into(),
            (100.0 * id.p95_relative_error).into(),
            id.trusted.low_hz.into(),
            id.trusted.high_hz.into(),
        ])?;
    }
    let loops = super::measured::tuned_table(tuned)?;
    Ok(format!(
        "# Fast steering mirror: measured responses\n\n\
         Made by `lab mirror --data DATA --out results`, DATA being the folder with `fsm_100mV/`. Source: M. Floren, L. Peri, J. De Maeyer, \
         W. De Munter, D. Vandepitte, J.-P. Noel, CubeSpec fine steering mirror, ISMA-USD 2024, data CC BY 4.0 (K. U. Leuven); responses computed \
         from its multisine records, deviations from two realisations.\n\n\
         Fitted from {} to {} Hz, hold at {RATE_HZ} Hz divided out, zeros in either half-plane.\n\n\
         ```text\n{}```\n\n```text\n{}```\n\n{}\n",
        BAND_HZ.0,
        BAND_HZ.1,
        table.text(),
        loops.text(),
        WORDS
    ))
}
