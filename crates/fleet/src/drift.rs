//! Drift: which slots moved from run to run, how fast, and when a margin will be lost at that rate.
//!
//! In: the figures of each slot over the finished runs. Out: a trend for each with its interval. Runs count as equally spaced, 1 apart. The
//! line is that of least squares; its scatter is taken from all slots together where a slot has too few runs to know its own: by the median of
//! the second differences, or, for two runs, of the differences about the floor's median.

use super::row::SlotRow;
use super::{FleetError, Store};
use serde::Serialize;
use servotune::numeric::statistics::median;
use std::collections::BTreeMap;

/// One quantity over the runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Trend {
    /// Value in the last run.
    pub now: f64,
    /// Change of one run to the next.
    pub rate: f64,
    /// 95 % interval of the rate.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

impl Trend {
    /// Whether the interval leaves out 0.
    pub fn moved(&self) -> bool {
        self.low > 0.0 || self.high < 0.0
    }
}

/// One slot over the runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SlotDrift {
    /// The slot.
    pub slot: String,
    /// Runs it was judged in.
    pub runs: usize,
    /// ln of the dc gain: a rate of -0.01 is a loss of 1 % a run.
    pub gain: Option<Trend>,
    /// ln of the first resonance's frequency.
    pub resonance: Option<Trend>,
    /// Room of the gains in the slot to the nearest limit in the worst case, as a share of the limit; below 0 it is missed.
    pub room: Option<Trend>,
    /// Runs from the last one until the room is used up, at this rate; 0 where it is already; none where it does not shrink.
    pub runs_left: Option<f64>,
    /// The earliest by the rate's interval.
    pub runs_left_low: Option<f64>,
    /// The latest; none where the interval leaves open whether it ever is.
    pub runs_left_high: Option<f64>,
}

/// Values of one quantity: run (x) and value.
type Series = Vec<(f64, f64)>;

#[derive(Clone, Debug, Default)]
struct Figures {
    gain: Series,
    resonance: Series,
    room: Series,
}

/// Two-sided 97.5 % points of Student's t for 1 to 10 degrees of freedom, then the normal's (Abramowitz & Stegun, table 26.10).
const T975: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];
const Z975: f64 = 1.960;
/// Median of |normal|.
const HALF: f64 = 0.6745;
/// A run with more slots than this is not held in memory for its trends.
const MOST_SLOTS: usize = 200_000;

/// Scatter of one value about its line, from all slots together (one standard deviation).
fn scatter<'a>(all: impl Iterator<Item = &'a Series> + Clone) -> Option<f64> {
    // e1 - 2 e2 + e3 of equally spaced runs has six times the variance of one.
    let second = all.clone().flat_map(|s| s.windows(3)).map(|w| (w[0].1 - 2.0 * w[1].1 + w[2].1).abs() / 6f64.sqrt());
    let second: Vec<f64> = second.collect();
    if !second.is_empty() {
        return median(&second).map(|m| m / HALF);
    }
    let first: Vec<f64> = all.flat_map(|s| s.windows(2)).map(|w| w[1].1 - w[0].1).collect();
    let middle = median(&first)?;
    median(&first.iter().map(|d| (d - middle).abs() / 2f64.sqrt()).collect::<Vec<_>>()).map(|m| m / HALF)
}

/// The line through a series; the floor's scatter where the slot cannot know its own.
fn trend(s: &Series, floor: Option<f64>) -> Option<Trend> {
    let n = s.len() as f64;
    if s.len() < 2 {
        return None;
    }
    let (mx, my) = (s.iter().map(|p| p.0).sum::<f64>() / n, s.iter().map(|p| p.1).sum::<f64>() / n);
    let sxx: f64 = s.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let rate = s.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / sxx;
    let rest: f64 = s.iter().map(|p| (p.1 - my - rate * (p.0 - mx)).powi(2)).sum();
    let own = s.len() - 2;
    let half = match floor {
        // With few degrees of freedom of its own a slot's t interval says nothing; the floor's scatter is known from many.
        Some(sigma) if own < T975.len() => Z975 * sigma.max((rest / n).sqrt()) / sxx.sqrt(),
        _ if own == 0 => return None,
        _ => T975.get(own - 1).copied().unwrap_or(Z975) * (rest / own as f64 / sxx).sqrt(),
    };
    let now = my + rate * (s[s.len() - 1].0 - mx);
    Some(Trend { now, rate, low: rate - half, high: rate + half })
}

/// Runs until a falling line reaches 0.
fn left(now: f64, rate: f64) -> Option<f64> {
    if now <= 0.0 { Some(0.0) } else { (rate < 0.0).then(|| -now / rate) }
}

/// Trends of every slot over the given runs, oldest first; slots by name.
pub fn drift(store: &Store, runs: &[String]) -> Result<Vec<SlotDrift>, FleetError> {
    let mut slots: BTreeMap<String, Figures> = BTreeMap::new();
    for (x, run) in runs.iter().enumerate() {
        let x = x as f64;
        store.each_row(run, None, |row: SlotRow| {
            if slots.len() >= MOST_SLOTS && !slots.contains_key(&row.id()) {
                return Ok(());
            }
            let f = slots.entry(row.id()).or_default();
            let model = row.model.as_ref();
            let put = |s: &mut Series, value: Option<f64>| s.extend(value.filter(|v| v.is_finite()).map(|v| (x, v)));
            put(&mut f.gain, model.and_then(|m| m.dc_gain).map(|g| g.abs().ln()));
            put(&mut f.resonance, model.and_then(|m| m.first_resonance_hz).map(f64::ln));
            put(&mut f.room, row.current.as_ref().map(|p| -p.worst).filter(|r| *r > -1.0));
            Ok(())
        })?;
    }
    let of = |f: fn(&Figures) -> &Series| scatter(slots.values().map(f));
    let (gain, resonance, room) = (of(|f| &f.gain), of(|f| &f.resonance), of(|f| &f.room));
    let all = slots.iter().map(|(slot, f)| {
        let room = trend(&f.room, room);
        SlotDrift {
            slot: slot.clone(),
            runs: f.gain.len().max(f.room.len()),
            gain: trend(&f.gain, gain),
            resonance: trend(&f.resonance, resonance),
            runs_left: room.and_then(|r| left(r.now, r.rate)),
            runs_left_low: room.and_then(|r| left(r.now, r.low)),
            runs_left_high: room.and_then(|r| left(r.now, r.high)),
            room,
        }
    });
    Ok(all.collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_straight_line_is_found_and_its_end_foretold() {
        let s: Series = (0..5).map(|i| (f64::from(i), 0.20 - 0.03 * f64::from(i))).collect();
        let t = trend(&s, Some(1e-9)).unwrap();
        // Exact up to rounding; 0.08 left at 0.03 a run.
        assert!((t.rate + 0.03).abs() < 1e-12 && (t.now - 0.08).abs() < 1e-12 && t.moved());
        assert!((left(t.now, t.rate).unwrap() - 8.0 / 3.0).abs() < 1e-9);
        assert_eq!(left(-0.1, 0.2), Some(0.0));
        assert_eq!(left(0.1, 0.2), None);
    }

    #[test]
    fn the_floors_scatter_comes_from_all_slots() {
        let mut r = servotune::numeric::random::Random::new(4);
        let series: Vec<Series> = (0..4000)
            .map(|i| (0..3).map(|x| (f64::from(x), 0.001 * f64::from(i) * f64::from(x) + 0.02 * r.normal())).collect())
            .collect();
        let sigma = scatter(series.iter()).unwrap();
        // A median of 4000 scatters by about 2 %.
        assert!((sigma / 0.02 - 1.0).abs() < 0.06, "{sigma}");
        let missed = series.iter().enumerate().filter(|(i, s)| {
            let (t, truth) = (trend(s, Some(sigma)).unwrap(), 0.001 * *i as f64);
            t.low > truth || t.high < truth
        });
        // 5 % miss; the larger of two scatters makes it fewer. Three standard errors above.
        assert!(missed.count() < 4000 * 6 / 100);
    }
}
