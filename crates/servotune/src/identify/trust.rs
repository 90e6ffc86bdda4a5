//! The trusted band: where the model follows the data closely enough to be used.
//!
//! In: relative errors on the sweep. Out: lowest and highest frequency with the reason for each.

use crate::numeric::statistics::median;
use serde::Serialize;
use std::f64::consts::TAU;

/// Why the band ends where it does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BandEdge {
    /// The sweep ends there.
    SweepEnds,
    /// Beyond it the local error exceeds the limit.
    Error {
        /// Local error just beyond the edge (ratio).
        found: f64,
        /// The limit (ratio).
        limit: f64,
    },
    /// Beyond it the file's own noise exceeds the limit.
    Noise {
        /// Relative noise deviation just beyond the edge (ratio).
        found: f64,
        /// The limit (ratio).
        limit: f64,
    },
}

/// Reasons of both edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BandReason {
    /// Why not lower.
    pub low: BandEdge,
    /// Why not higher.
    pub high: BandEdge,
}

/// Where the model may be trusted; both frequencies are 0 when it may not be trusted anywhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrustedBand {
    /// Lowest frequency (Hz).
    pub low_hz: f64,
    /// Highest frequency (Hz).
    pub high_hz: f64,
    /// Why it ends there.
    pub reason: BandReason,
}

/// Half of the running median's window (points): a single bad point or a narrow peak's flank does not end the band.
const HALF_WINDOW: usize = 5;

/// The longest run, in octaves, of points whose running median error and noise stay below `limit`.
pub(super) fn band(w: &[f64], error: &[f64], relative_std: Option<&[f64]>, limit: f64) -> TrustedBand {
    let n = w.len();
    let local =
        |v: &[f64], i: usize| median(&v[i.saturating_sub(HALF_WINDOW)..(i + HALF_WINDOW + 1).min(n)]).unwrap_or(0.0);
    let state: Vec<BandEdge> = (0..n)
        .map(|i| {
            let (e, s) = (local(error, i), relative_std.map_or(0.0, |s| local(s, i)));
            if s > limit {
                BandEdge::Noise { found: s, limit }
            } else if e.is_nan() || e > limit {
                BandEdge::Error { found: e, limit }
            } else {
                BandEdge::SweepEnds
            }
        })
        .collect();
    let good = |i: usize| state[i] == BandEdge::SweepEnds;
    let mut best: Option<(usize, usize)> = None;
    let mut i = 0;
    while i < n {
        if !good(i) {
            i += 1;
            continue;
        }
        let from = i;
        while i < n && good(i) {
            i += 1;
        }
        let span = |(a, b): (usize, usize)| w[b] / w[a];
        if best.is_none_or(|b| span((from, i - 1)) > span(b)) {
            best = Some((from, i - 1));
        }
    }
    match best {
        None => TrustedBand { low_hz: 0.0, high_hz: 0.0, reason: BandReason { low: state[0], high: state[n - 1] } },
        Some((from, to)) => TrustedBand {
            low_hz: w[from] / TAU,
            high_hz: w[to] / TAU,
            reason: BandReason {
                low: if from == 0 { BandEdge::SweepEnds } else { state[from - 1] },
                high: if to + 1 == n { BandEdge::SweepEnds } else { state[to + 1] },
            },
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_ends_where_the_error_begins() {
        let w: Vec<f64> = (1..=100).map(|i| TAU * f64::from(i)).collect();
        let error: Vec<f64> = (1..=100).map(|i| if i > 80 { 0.5 } else { 0.01 }).collect();
        let b = band(&w, &error, None, 0.1);
        // The median of eleven points turns when six of them lie beyond 80.
        assert_eq!((b.low_hz, b.high_hz.round()), (1.0, 80.0));
        assert_eq!(b.reason.low, BandEdge::SweepEnds);
        assert!(matches!(b.reason.high, BandEdge::Error { found, .. } if found == 0.5));
        assert_eq!(band(&w, &[0.5; 100], None, 0.1).high_hz, 0.0);
    }
}
