//! Features of the swept sine: body, levels, falls, crossover, resonances, noise.
//!
//! In: the response or nothing. Out: named numbers in decibels, hertz, degrees, microseconds.

use super::body::body_fit;
use super::resonance::{Resonance, noise_variance, pair_near, resonances};
use super::row::Row;
use super::view::ResponseView;
use crate::frf::Frf;
use crate::numeric::statistics::{deviation, largest, line, mean};
use std::f64::consts::TAU;

/// Fixed frequencies (Hz), thirds of an octave.
const PLACES: [u32; 22] =
    [40, 50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000, 1250, 1600, 2000, 2500, 3150, 4000, 5000];
/// Bands (Hz) in which the rest beside the body and the noise are described.
const BANDS: [(u32, u32); 8] =
    [(40, 100), (100, 250), (250, 500), (500, 900), (900, 1500), (1500, 2200), (2200, 3300), (3300, 5000)];
/// Where the paper's machines have their first resonance, loose and fast (Hz).
const KNOWN: [u32; 2] = [656, 1222];
/// Resonances described one by one.
const DESCRIBED: usize = 6;
/// Least share of stiffness in the lowest point's response for the dc gain to be seen.
const SEEN: f64 = 0.05;

/// Adds the features of a response; all are missing where there is none.
pub(super) fn response_features(frf: Option<&Frf>, row: &mut Row) {
    let view = ResponseView::of(frf);
    let body = body_fit(&view);
    let found = body.map(|b| resonances(&view, &b)).unwrap_or_default();
    let of_body = |f: &dyn Fn(&super::BodyFit) -> f64| body.as_ref().map_or(f64::NAN, f);
    let lowest = view.hz.first().map_or(f64::NAN, |f| TAU * f);
    let crossover = view.falls_through(&view.db, 0.0);
    let seen = of_body(&|b| if b.stiffness > SEEN * lowest * lowest * b.inertia { 1.0 } else { f64::NAN });
    row.push("plant_dc_gain_db", seen * of_body(&|b| b.dc_gain_db()));
    row.push("plant_first_resonance_hz", found.first().map_or(f64::NAN, |r| r.hz));
    row.push("plant_crossover_hz", crossover);
    row.push("plant_natural_frequency_hz", seen * of_body(&|b| b.natural_frequency_hz()));
    row.push("plant_damping_ratio", seen * of_body(&|b| b.damping_ratio()));
    row.push("plant_acceleration_gain_db", of_body(&|b| b.acceleration_gain_db()));
    row.push("plant_delay_us", of_body(&|b| b.delay_s * 1e6));
    row.push("plant_body_residual", of_body(&|b| b.residual));
    row.push("plant_crossover_phase_deg", view.at(&view.phase_deg, crossover));
    let turned = view.falls_through(&view.phase_deg, -180.0);
    row.push("plant_phase_crossover_hz", turned);
    row.push("plant_phase_crossover_db", view.at(&view.db, turned));
    let start = view.hz.first().map_or(f64::NAN, |f| view.at(&view.db, *f));
    for fall in [10, 20, 30, 40, 50, 60] {
        row.push(format!("response_fall_{fall}_db_hz"), view.falls_through(&view.db, start - f64::from(fall)));
    }
    for hz in PLACES {
        row.push(format!("response_{hz}_hz_db"), view.at(&view.db, f64::from(hz)));
    }
    for hz in PLACES {
        row.push(format!("response_{hz}_hz_deg"), view.at(&view.phase_deg, f64::from(hz)));
    }
    rest(&view, body.as_ref(), row);
    let known = |hz| body.as_ref().and_then(|b| pair_near(&view, b, f64::from(hz)));
    for hz in KNOWN {
        describe(&format!("near_{hz}_hz"), known(hz).as_ref(), row);
    }
    for i in 0..DESCRIBED {
        describe(&format!("resonance_{}", i + 1), found.get(i), row);
    }
    let highest = found.iter().max_by(|a, b| a.height_db.total_cmp(&b.height_db));
    describe("resonance_highest", highest, row);
    let count = if view.hz.is_empty() { f64::NAN } else { found.len() as f64 };
    row.push("resonance_count", count);
    row.push("response_points", if view.hz.is_empty() { f64::NAN } else { view.hz.len() as f64 });
    row.push("response_lowest_hz", view.hz.first().copied().unwrap_or(f64::NAN));
    row.push("response_highest_hz", view.hz.last().copied().unwrap_or(f64::NAN));
}

fn describe(name: &str, pair: Option<&Resonance>, row: &mut Row) {
    let of = |f: &dyn Fn(&Resonance) -> f64| pair.map_or(f64::NAN, f);
    row.push(format!("{name}_at_hz"), of(&|r| r.hz));
    row.push(format!("{name}_height_db"), of(&|r| r.height_db));
    row.push(format!("{name}_swing_db"), of(&|r| r.height_db - r.depth_db));
    row.push(format!("{name}_damping"), of(&|r| r.damping));
    row.push(format!("{name}_strength_db"), of(&|r| 10.0 * r.strength.log10()));
}

/// What the body leaves, slopes, and how rough the sweep is, band by band.
fn rest(view: &ResponseView, body: Option<&super::BodyFit>, row: &mut Row) {
    let ratio: Vec<_> = match body {
        Some(b) => view.hz.iter().zip(&view.value).map(|(f, g)| g * b.inverse_at(TAU * f)).collect(),
        None => Vec::new(),
    };
    let db: Vec<f64> = ratio.iter().map(|r| 20.0 * r.norm().log10()).collect();
    for (low, high) in BANDS {
        // The last point of a sweep to 5000 Hz lies at 4999.999 or 5000.001.
        let range = view.between(f64::from(low) * 0.999, f64::from(high) * 1.001);
        let name = format!("response_{low}_{high}_hz");
        let slope = line(&view.ln_hz[range.clone()], &view.db[range.clone()], 0.0).1 * std::f64::consts::LN_10;
        row.push(format!("{name}_slope_db_per_decade"), slope);
        let rest = if db.is_empty() { &db[..] } else { &db[range.clone()] };
        row.push(format!("{name}_rest_mean_db"), mean(rest));
        row.push(format!("{name}_rest_std_db"), deviation(rest));
        row.push(format!("{name}_rest_max_db"), largest(rest));
        let part = if ratio.is_empty() { &ratio[..] } else { &ratio[range] };
        let noise = if part.len() < 5 { f64::NAN } else { 100.0 * (2.0 * noise_variance(part)).sqrt() };
        row.push(format!("{name}_noise_percent"), noise);
    }
}
