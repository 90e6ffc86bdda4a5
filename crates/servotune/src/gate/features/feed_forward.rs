//! FF_Factor_estimated: how much velocity feed-forward would take out of the PES.
//!
//! In: the record. Out: the amount, in the PES's unit, that leaves the least PES. Feed-forward of the velocity shifts the reference by
//! f h(t), h the speed of the move over its full speed as far as the loop passes it on: 1 - e^(-t/tau). The least squares over the
//! write gives f = <pes, h> / <h, h>, and tau is the one that leaves least. The factor of a log is a ratio: the two never share a column.

use super::machine::PesRecord;
use crate::numeric::golden::golden_section;

/// Samples of the write that count: from the start of the move to the end of the window.
const SAMPLES: usize = super::pes::WINDOW[1];
/// Shortest and longest time constant tried (s).
const TAU_S: (f64, f64) = (1e-4, 2e-2);

/// The estimate; NaN where the record is too short.
pub(super) fn feed_forward(record: Option<&PesRecord>) -> f64 {
    let Some(record) = record else { return f64::NAN };
    let Some(pes) = record.moving().get(..SAMPLES) else { return f64::NAN };
    let step_s = 1.0 / record.rate_hz();
    let best = |tau: f64| {
        let (mut ph, mut hh) = (0.0, 0.0);
        for (i, p) in pes.iter().enumerate() {
            let h = 1.0 - (-(i as f64) * step_s / tau).exp();
            ph += p * h;
            hh += h * h;
        }
        (ph / hh, ph * ph / hh)
    };
    let log_tau = golden_section(|x| -best(x.exp()).1, TAU_S.0.ln(), TAU_S.1.ln(), 1e-3).x;
    best(log_tau.exp()).0
}
