//! Whether records and plant are a ground on which anything can be computed.
//!
//! In: the diagnosis data, before the first fit. Out: nothing, or a refusal: numbers that overflowed would be none everywhere after, and decompositions of them need not end.

use super::DiagnoseError;
use super::rules::BEYOND_MOTION;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::numeric::statistics::{deviation, rms_of};

/// Refuses a ground on which nothing can be computed.
pub(super) fn check(data: &DiagnosisData) -> Result<(), DiagnoseError> {
    alike(data)?;
    finite(data)
}

/// Refuses a ground on which nothing can be computed: what is no number here would be none everywhere after.
fn finite(data: &DiagnosisData) -> Result<(), DiagnoseError> {
    let (l, s) = (&data.levels, &data.scene);
    let numbers = [
        ("the level of the sensor's noise", l.sensor_rms),
        ("the level of the torque's noise", l.torque_rms),
        ("the corner of the torque's noise", l.torque_corner_hz),
        ("the noise of the records", s.noise),
        ("the travel of the records", s.travel),
        ("the speed of the records", s.speed),
        ("the motion of the arm per recorded position", s.arm_over_record()),
    ];
    let moving = data.trajectories.iter().flat_map(|t| &t.samples);
    let lost = moving.map(|m| m.x + m.v + m.u + m.i).find(|sum| !sum.is_finite()).map(|x| ("the motion of the arm", x));
    match numbers.into_iter().find(|(_, x)| !x.is_finite()).or(lost) {
        Some((what, found)) => Err(DiagnoseError::NotFinite { what, found }),
        None => Ok(()),
    }
}

/// Refuses a plant that simulates something else than these records.
fn alike(data: &DiagnosisData) -> Result<(), DiagnoseError> {
    let none = vec![0.0; data.form.free_parameters.len()];
    for (record, error) in data.means.iter().zip(data.clone().fit(vec![]).errors(&none)) {
        let moved = deviation(&record.position);
        let ratio = rms_of(error) / moved;
        if moved > 0.0 && (!ratio.is_finite() || ratio > BEYOND_MOTION) {
            return Err(DiagnoseError::Unlike { record: record.name.clone(), ratio });
        }
    }
    Ok(())
}
