//! The data as every step uses them: band chosen, hold removed, weights set.
//!
//! In: [`Frf`] and settings. Out: [`Sweep`].

use super::{IdentifyError, IdentifySettings, OrderChoice};
use crate::frf::{Frf, Hold};
use crate::numeric::statistics::median;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// The points of the chosen band.
#[derive(Clone, Debug)]
pub(super) struct Sweep {
    /// rad/s, ascending.
    pub w: Vec<f64>,
    /// Response without the hold.
    pub value: Vec<Complex<f64>>,
    /// Relative standard deviations from the file, smoothed and floored; `None` where the file has none.
    pub relative_std: Option<Vec<f64>>,
}

fn require(ok: bool, key: &'static str, found: f64, expected: &'static str) -> Result<(), IdentifyError> {
    if ok { Ok(()) } else { Err(IdentifyError::Setting { key, found, expected }) }
}

fn check(s: &IdentifySettings) -> Result<(), IdentifyError> {
    require(s.low_hz >= 0.0, "low_hz", s.low_hz, "at least 0 Hz")?;
    require(s.high_hz > s.low_hz, "high_hz", s.high_hz, "above low_hz")?;
    require(s.body_high_hz > 0.0, "body_high_hz", s.body_high_hz, "above 0 Hz")?;
    require(s.delay_s.0 >= 0.0, "delay_s.0", s.delay_s.0, "at least 0 s")?;
    require(s.delay_s.1 > s.delay_s.0, "delay_s.1", s.delay_s.1, "above delay_s.0")?;
    require(s.delay_limit_s >= s.delay_s.1, "delay_limit_s", s.delay_limit_s, "at least delay_s.1")?;
    let gain = s.resonance_gain_db;
    require(gain.0.is_finite(), "resonance_gain_db.0", gain.0, "a finite gain")?;
    require(gain.1 > gain.0 && gain.1.is_finite(), "resonance_gain_db.1", gain.1, "above resonance_gain_db.0")?;
    require(s.prominence_db > 0.0, "prominence_db", s.prominence_db, "above 0 dB")?;
    require(s.group_ratio >= 1.0, "group_ratio", s.group_ratio, "at least 1")?;
    require(s.folds >= 2, "folds", s.folds as f64, "at least 2")?;
    require(s.trust_limit > 0.0, "trust_limit", s.trust_limit, "above 0")?;
    Ok(())
}

/// Points needed for `modes` pairs: twice as many real numbers as unknowns (2 a point; 4 a pair, 4 for body and delay).
pub(super) fn points_needed(modes: usize) -> usize {
    4 * (modes + 1)
}

/// Deviations from a few repeats scatter themselves, and the smallest ones would rule the fit: running median over this
/// many points on each side.
const HALF_WINDOW: usize = 5;
/// Relative deviations below this share of their median are raised to it: a file's zero would be an infinite weight.
const LEAST_SHARE: f64 = 0.05;

impl Sweep {
    /// Checks the settings and cuts out the band.
    pub fn new(frf: &Frf, settings: &IdentifySettings) -> Result<Sweep, IdentifyError> {
        check(settings)?;
        if let Hold::Included { sample_time_s: t } = frf.hold() {
            require(t > 0.0 && t.is_finite(), "hold.sample_time_s", t, "a finite time above 0 s")?;
        }
        let hz = |w: f64| w / TAU;
        let all = frf.w_rad_s();
        let keep: Vec<usize> =
            (0..all.len()).filter(|&i| hz(all[i]) >= settings.low_hz && hz(all[i]) <= settings.high_hz).collect();
        let (Some(&first), Some(&last)) = (keep.first(), keep.last()) else {
            let (low_hz, high_hz) = (settings.low_hz, settings.high_hz);
            return Err(IdentifyError::EmptyBand {
                low_hz,
                high_hz,
                from_hz: hz(all[0]),
                to_hz: hz(all[all.len() - 1]),
            });
        };
        let modes = match settings.order {
            OrderChoice::Auto { .. } => 0,
            OrderChoice::Fixed(n) => n,
        };
        // Eight points at least: the peak search and the noise estimate need neighbours.
        let needed = points_needed(modes).max(8);
        if keep.len() < needed {
            return Err(IdentifyError::TooFewPoints { found: keep.len(), needed, modes });
        }
        let w: Vec<f64> = all[first..=last].to_vec();
        let mut value = frf.value()[first..=last].to_vec();
        if let Hold::Included { sample_time_s } = frf.hold() {
            let nyquist_hz = 0.5 / sample_time_s;
            let found_hz = hz(w[w.len() - 1]);
            if found_hz >= nyquist_hz {
                return Err(IdentifyError::HoldBand { found_hz, nyquist_hz });
            }
            for (v, w) in value.iter_mut().zip(&w) {
                let half = 0.5 * w * sample_time_s;
                *v /= Complex::from_polar(half.sin() / half, -half);
            }
        }
        let relative_std = frf.relative_std().and_then(|s| {
            let s = &s[first..=last];
            let middle = median(s).unwrap_or(0.0);
            let around =
                |i: usize| median(&s[i.saturating_sub(HALF_WINDOW)..(i + HALF_WINDOW + 1).min(s.len())]).unwrap_or(0.0);
            (middle > 0.0).then(|| (0..s.len()).map(|i| around(i).max(LEAST_SHARE * middle)).collect())
        });
        Ok(Sweep { w, value, relative_std })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.w.len()
    }
}
