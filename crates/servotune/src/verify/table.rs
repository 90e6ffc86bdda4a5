//! A gain table against itself: sections recomputed from the gains, stated figures against proven bounds, digests against files.

use super::bounds::{BoundedFigure, LoopBounds, ProvenCrossing, Stability};
use super::write::WriteFigures;
use crate::controller::Controller;
use crate::lti::Section;
use crate::tune::{CrossingRow, GainTable, Summary};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Something in the table that is not what its inputs make.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "what", deny_unknown_fields)]
#[allow(missing_docs, reason = "each field is named in the report")]
pub enum TableFinding {
    /// The number of sections.
    Count { found: usize, expected: usize },
    /// A coefficient that the gains do not make.
    Section { index: usize, key: String, found: f64, expected: f64 },
    /// A figure of `[after]` outside its proven bounds on every machine given.
    Figure { name: String, stated: Option<f64>, proven: BoundedFigure },
    /// An input of the table that was not given, or not as it was.
    Digest { role: String, stated: String },
    /// A line of the certificate that the proof does not repeat.
    Certificate { path: String, stated: String, proven: String },
}

/// Relative difference allowed to a coefficient: two mathematical libraries apart.
const SAME: f64 = 1e-12;
/// Relative difference allowed to a stated figure beyond its bounds: the refinement that wrote it.
const PRINTED: f64 = 1e-7;

/// The product of two polynomials in 1/z.
fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut all = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            all[i + j] += x * y;
        }
    }
    all
}

/// The PID's law over its common denominator (1 - q)(T + Tf - Tf q), each term multiplied out.
fn pid(c: &Controller) -> Section {
    let (p, t) = (&c.pid, c.sample_time_s);
    let filter = [t + p.derivative_filter_s, -p.derivative_filter_s];
    let step = [1.0, -1.0];
    let integral = p.ki_per_s != 0.0;
    let below = if integral { product(&step, &filter) } else { filter.to_vec() };
    let mut above = vec![0.0; 3];
    let mut add = |k: f64, by: Vec<f64>| by.iter().enumerate().for_each(|(i, x)| above[i] += k * x);
    add(p.kp, below.clone());
    if integral {
        add(p.ki_per_s * t, filter.to_vec());
        add(p.kd_s, product(&step, &step));
    } else {
        add(p.kd_s, step.to_vec());
    }
    let a0 = below[0];
    let at = |x: &[f64], i: usize| x.get(i).copied().unwrap_or(0.0) / a0;
    Section { b0: at(&above, 0), b1: at(&above, 1), b2: at(&above, 2), a1: at(&below, 1), a2: at(&below, 2) }
}

/// The bilinear transform with k = tan(w T/2): s/w becomes (1 - q)/(k (1 + q)).
fn bilinear(hz: f64, t: f64, [n2, n1, n0]: [f64; 3], damping: f64) -> Section {
    let k = (PI * hz * t).tan();
    let line =
        |x2: f64, x1: f64, x0: f64| [x2 + x1 * k + x0 * k * k, 2.0 * (x0 * k * k - x2), x2 - x1 * k + x0 * k * k];
    let (above, below) = (line(n2, n1, n0), line(1.0, 2.0 * damping, 1.0));
    let a0 = below[0];
    Section { b0: above[0] / a0, b1: above[1] / a0, b2: above[2] / a0, a1: below[1] / a0, a2: below[2] / a0 }
}

/// Compares the sections of a table with those that its gains make.
pub(super) fn sections(c: &Controller, found: &[Section]) -> Vec<TableFinding> {
    let t = c.sample_time_s;
    let mut expected = vec![pid(c)];
    expected.extend(c.lowpass.iter().map(|l| bilinear(l.frequency_hz, t, [0.0, 0.0, 1.0], l.damping_ratio)));
    let notch = |n: &crate::controller::Notch| {
        bilinear(n.frequency_hz, t, [1.0, 2.0 * n.zero_damping_ratio, 1.0], n.pole_damping_ratio)
    };
    expected.extend(c.notch.iter().map(notch));
    expected.extend(&c.biquad);
    if found.len() != expected.len() {
        return vec![TableFinding::Count { found: found.len(), expected: expected.len() }];
    }
    let mut all = Vec::new();
    for (index, (f, e)) in found.iter().zip(&expected).enumerate() {
        let size = [e.b0, e.b1, e.b2, e.a1, e.a2].iter().fold(1.0f64, |m, x| m.max(x.abs()));
        for (key, found, expected) in
            [("b0", f.b0, e.b0), ("b1", f.b1, e.b1), ("b2", f.b2, e.b2), ("a1", f.a1, e.a1), ("a2", f.a2, e.a2)]
        {
            if found.is_nan() || (found - expected).abs() > SAME * size {
                all.push(TableFinding::Section { index, key: key.into(), found, expected });
            }
        }
    }
    all
}

/// Figures of `[after]` that lie outside the proven bounds of one machine.
pub(super) fn figures(s: &Summary, b: &LoopBounds, write: Option<&WriteFigures>) -> Vec<TableFinding> {
    let mut all = Vec::new();
    let mut check = |name: &str, stated: Option<f64>, proven: BoundedFigure| {
        let inside = |x: f64| {
            let slack = PRINTED * x.abs();
            proven.low.is_some_and(|l| x >= l - slack) && proven.high.is_none_or(|h| x <= h + slack)
        };
        // Without a crossing there is no bound either.
        let good = stated.map_or(proven.high.is_none(), inside);
        if !good {
            all.push(TableFinding::Figure { name: name.into(), stated, proven });
        }
    };
    let flag = |x: bool| f64::from(u8::from(x));
    // What is not decided contradicts nothing.
    let [low, high] = [Stability::Stable, Stability::Unstable].map(|s| flag(b.stability == s));
    check("stable", Some(flag(s.stable)), BoundedFigure { low: Some(low), high: Some(1.0 - high), hz: None });
    check("phase_margin_deg", s.phase_margin_deg.map(f64::abs), b.phase_margin_deg);
    check("gain_crossover_hz", s.gain_crossover_hz, b.gain_crossover_hz);
    // Half the sample rate, where L is real, is a crossing of the proof and not of the table: from above it binds nothing.
    check(
        "gain_margin_db",
        s.gain_margin_db.map(f64::abs),
        BoundedFigure { high: s.gain_margin_db.and(None), ..b.gain_margin_db },
    );
    check("max_sensitivity", Some(s.max_sensitivity), b.max_sensitivity);
    check("modulus_margin", Some(s.modulus_margin), b.modulus_margin);
    if b.stability == Stability::Stable {
        check("delay_margin_s", s.delay_margin_s, b.delay_margin_s);
        check("disk_margin", Some(s.disk_margin), b.disk_margin);
    }
    if let Some(w) = write {
        let around = |x: f64, e: f64| BoundedFigure { low: Some(x - e), high: Some(x + e), hz: None };
        for (name, stated, found) in [("dft_low", s.dft_low, w.dft_low), ("dft_high", s.dft_high, w.dft_high)] {
            // A band without a bin of the DFT sums to nothing, and the table has no figure of it.
            if stated.is_some() || found != 0.0 {
                check(name, stated, around(found, w.error));
            }
        }
        check("command_peak", s.command_peak, around(w.command_peak, w.command_error()));
    }
    let places = |all: &[ProvenCrossing], rows: &[CrossingRow]| {
        let at = |c: &ProvenCrossing, r: &CrossingRow| {
            c.hz.widened(PRINTED * r.hz).holds(r.hz) && c.value.widened(1e-3).holds(r.value.abs())
        };
        rows.iter().find(|r| !all.iter().any(|c| at(c, r))).map(|r| (r.hz, r.value))
    };
    for (name, all_proven, rows) in [
        ("gain_crossings", &b.gain_crossings, &s.gain_crossings),
        ("phase_crossings", &b.phase_crossings, &s.phase_crossings),
    ] {
        if let Some((hz, value)) = places(all_proven, rows) {
            let proven = BoundedFigure { hz: Some(hz), ..BoundedFigure::default() };
            all.push(TableFinding::Figure { name: name.into(), stated: Some(value), proven });
        }
    }
    all
}

/// Inputs of the table that are not among the digests given.
pub(super) fn digests(table: &GainTable, spec: &str, machines: &[String]) -> Vec<TableFinding> {
    let mut all = Vec::new();
    if table.provenance.spec_sha256 != spec {
        all.push(TableFinding::Digest { role: "spec".into(), stated: table.provenance.spec_sha256.clone() });
    }
    for i in table.provenance.inputs.iter().filter(|i| i.role == "plant" || i.role == "frf") {
        if !machines.contains(&i.sha256) {
            all.push(TableFinding::Digest { role: i.role.clone(), stated: i.sha256.clone() });
        }
    }
    all
}
