//! Draws every kind of figure from formulas: a resonant plant with delay under PID control.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::Complex;
use servotune_report::bode::{BodeCurve, BodeMarks, bode_with_residual};
use servotune_report::figure::{Figure, Ink};
use servotune_report::number::NumberFormat;
use servotune_report::nyquist::{NyquistMarks, nyquist};
use servotune_report::page::{Block, Card, Page, Section};
use servotune_report::sensitivity::sensitivity;
use servotune_report::spectrum_bars::{SpectrumBars, spectrum_bars};
use servotune_report::svg::{Size, standalone};
use servotune_report::table::{Cell, Column, Table, Verdict};
use servotune_report::time::{CurveKind, TimeCurve, TimePanel, time};
use std::f64::consts::TAU;

type C = Complex<f64>;

fn second_order(s: C, w: f64, z: f64) -> C {
    s * s + s * (2.0 * z * w) + w * w
}

fn plant(hz: f64, mode: f64) -> C {
    let s = C::new(0.0, TAU * hz);
    let (w0, wz, wp) = (369.0, 7483.0 * mode, 7681.0 * mode);
    (-s * 65e-6).exp() * 75.0 * w0 * w0 / second_order(s, w0, 0.22) * second_order(s, wz, 0.038)
        / second_order(s, wp, 0.02)
}

fn controller(hz: f64) -> C {
    let s = C::new(0.0, TAU * hz);
    let w = TAU * 7000.0;
    (0.27 + C::from(60.0) / s + 3.7e-4 * s / (1.0 + 12e-6 * s)) * w * w / second_order(s, w, 0.7)
}

/// A reproducible stand-in for noise, in [-1, 1].
fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn sweep() -> Vec<f64> {
    (0..500).map(|k| 40.0 * (5000.0f64 / 40.0).powf(f64::from(k) / 499.0)).collect()
}

fn bode_demo() -> Figure {
    let hz = sweep();
    let mut seed = 7;
    let spread: Vec<f64> = hz.iter().map(|f| 0.01 + 0.12 * (f / 5000.0).powi(2)).collect();
    let measured: Vec<C> = hz
        .iter()
        .zip(&spread)
        .map(|(&f, s)| {
            if (2000.0..2150.0).contains(&f) {
                return C::new(f64::NAN, f64::NAN);
            }
            plant(f, 1.012) * (1.0 + C::new(noise(&mut seed), noise(&mut seed)) * *s)
        })
        .collect();
    let model: Vec<C> = hz.iter().map(|&f| plant(f, 1.0)).collect();
    let measured = BodeCurve { name: "measured", frequency_hz: &hz, response: &measured, relative_std: Some(&spread) };
    let model = BodeCurve { name: "model", frequency_hz: &hz, response: &model, relative_std: None };
    let marks = BodeMarks { trusted_hz: Some((60.0, 3500.0)), ..BodeMarks::default() };
    bode_with_residual(
        "Plant",
        "Measured response and model; the gap is where the sweep lost lock.",
        measured,
        model,
        &marks,
    )
    .unwrap()
}

fn figures() -> Vec<(&'static str, Figure)> {
    let dense: Vec<f64> = (0..3000).map(|k| 20.0 * (12000.0f64 / 20.0).powf(f64::from(k) / 2999.0)).collect();
    let open: Vec<C> = dense.iter().map(|&f| plant(f, 1.0) * controller(f)).collect();
    let s: Vec<C> = open.iter().map(|l| 1.0 / (1.0 + l)).collect();
    let t: Vec<C> = open.iter().map(|l| l / (1.0 + l)).collect();
    let cross = (1..open.len()).find(|&i| open[i].norm() < 1.0 && open[i - 1].norm() >= 1.0).unwrap();
    let turn = (1..open.len())
        .find(|&i| open[i].im > 0.0 && open[i - 1].im <= 0.0 && open[i].re < 0.0 && dense[i] > dense[cross]);
    let alpha = s.iter().zip(&t).map(|(s, t)| 2.0 / (s - t).norm()).fold(f64::INFINITY, f64::min);
    let worst = (0..s.len()).max_by(|&a, &b| s[a].norm().total_cmp(&s[b].norm())).unwrap();
    let marks = NyquistMarks {
        max_sensitivity_limit: Some(2.2),
        disk_margin: Some(alpha),
        points: vec![(open[worst], format!("Ms {:.2} at {:.0} Hz", s[worst].norm(), dense[worst]))],
    };
    let loop_curve = BodeCurve { name: "open loop", frequency_hz: &dense, response: &open, relative_std: None };
    let loop_marks = BodeMarks {
        trusted_hz: None,
        phase_margin: Some((dense[cross], 180.0 + open[cross].arg().to_degrees())),
        gain_margin: turn.map(|i| (dense[i], -20.0 * open[i].norm().log10())),
    };
    let rate = 27480.0;
    let at: Vec<f64> = (0..1200).map(|k| f64::from(k) / rate).collect();
    let ring = |t: f64, a: f64, f: f64, d: f64| a * (-t * d).exp() * (TAU * f * t).sin();
    let before: Vec<f64> = at.iter().map(|&t| ring(t, 0.31, 310.0, 90.0) + ring(t, 0.05, 1222.0, 30.0)).collect();
    let after: Vec<f64> = at.iter().map(|&t| ring(t, 0.17, 420.0, 260.0) + ring(t, 0.02, 1222.0, 80.0)).collect();
    let curves = [
        TimeCurve { name: "before", time_s: &at, value: &before, ink: Ink::Muted, kind: CurveKind::Line },
        TimeCurve { name: "after", time_s: &at, value: &after, ink: Ink::Data(0), kind: CurveKind::Line },
    ];
    let command: Vec<f64> = at.iter().map(|&t| ring(t, 1.4, 420.0, 200.0)).collect();
    let held = [TimeCurve { name: "command", time_s: &at, value: &command, ink: Ink::Data(1), kind: CurveKind::Held }];
    let panels = [
        TimePanel { quantity: "PES", unit: "track", curves: &curves, limits: &[(0.25, "limit"), (-0.25, "")] },
        TimePanel { quantity: "Command", unit: "V", curves: &held, limits: &[] },
    ];
    let dft = |pes: &[f64]| -> Vec<f64> {
        let n = 200;
        (1..=40)
            .map(|k| {
                let sum: C =
                    (0..n).map(|i| pes[200 + i] * C::from_polar(1.0, -TAU * f64::from(k) * i as f64 / n as f64)).sum();
                sum.norm() / n as f64
            })
            .collect()
    };
    let hz: Vec<f64> = (1..=40).map(|k| f64::from(k) * rate / 200.0).collect();
    let (dft_before, dft_after) = (dft(&before), dft(&after));
    let bars = SpectrumBars {
        names: ["before", "after"],
        frequency_hz: &hz,
        before: Some(&dft_before),
        after: &dft_after,
        limits: &[(hz[0], 0.02), (hz[1], 0.02), (hz[2], 0.02), (hz[7], 0.01), (hz[8], 0.01), (hz[15], 0.006)],
        bands_hz: &[[600.0, 1500.0], [1500.0, 3000.0]],
        unit: "track",
        until_hz: 4000.0,
    };
    vec![
        ("bode", bode_demo()),
        (
            "loop",
            servotune_report::bode::bode("Open loop", "Cut at the plant input.", &[loop_curve], &loop_marks).unwrap(),
        ),
        (
            "nyquist",
            nyquist("Nyquist plot", "The loop stays out of the forbidden disc.", &dense, &open, &marks).unwrap(),
        ),
        (
            "sensitivity",
            sensitivity("Sensitivity", "Where the loop amplifies disturbances.", &dense, &s, &t, Some(2.2), None)
                .unwrap(),
        ),
        (
            "time",
            time(
                "Position error of a spiral write",
                "The window of the DFT is shaded.",
                &panels,
                Some((200.0 / rate, 400.0 / rate, "DFT window")),
            )
            .unwrap(),
        ),
        ("dft", spectrum_bars("DFT of the PES", "Amplitude of each harmonic in the window.", &bars).unwrap()),
    ]
}

fn folder() -> std::path::PathBuf {
    let path = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("report");
    std::fs::create_dir_all(&path).unwrap();
    path
}

#[test]
fn every_figure_is_drawn_and_drawn_alike_twice() {
    for (name, figure) in figures() {
        let svg = standalone(&figure, Size::WIDE);
        assert_eq!(svg, standalone(&figure, Size::WIDE));
        assert!(!svg.contains("NaN") && !svg.contains("inf "), "{name}");
        std::fs::write(folder().join(format!("{name}.svg")), svg).unwrap();
    }
}

fn card(label: &str, value: &str, unit: &str, note: &str, verdict: Verdict) -> Card {
    Card { label: label.into(), value: value.into(), unit: unit.into(), note: note.into(), verdict: Some(verdict) }
}

fn gains() -> Table {
    let number = NumberFormat::Significant(3);
    let columns = vec![
        Column::words("Parameter"),
        Column::numbers("Before", "V/track", number),
        Column::numbers("After", "V/track", number),
        Column::numbers("Lowest allowed", "V/track", number),
    ];
    let mut table = Table::new("Gains before and after", columns);
    table.push(vec!["kp".into(), 0.21.into(), 0.27.into(), 1e-3.into()]).unwrap();
    table
        .push(vec!["kd".into(), 3.1e-4.into(), Cell::from(1e-6).flagged(Verdict::Warn, "at bound"), 1e-6.into()])
        .unwrap();
    table.push(vec!["ki".into(), None.into(), 60.0.into(), (-2.5e-7).into()]).unwrap();
    table
}

fn demo_page() -> Page {
    let mut figures = figures().into_iter().map(|(_, figure)| figure);
    let mut next = || figures.next().unwrap();
    let (plant, open, nyquist, sensitivity, time, dft) = (next(), next(), next(), next(), next(), next());
    Page {
        title: "Tuning report".into(),
        subtitle: "Tester 12, slot 7, spiral write at 350 track/s".into(),
        cards: vec![
            card("Phase margin", "59.8", "deg", "at least 35", Verdict::Ok),
            card("Gain margin", "11.1", "dB", "at least 5", Verdict::Ok),
            card("Sensitivity peak", "1.89", "", "at most 2.2", Verdict::Ok),
            card("DFT, low band", "0.0213", "track", "at most 0.02", Verdict::Fail),
            card("DFT, high band", "0.0184", "track", "within 10 % of 0.02", Verdict::Warn),
        ],
        sections: vec![
            Section {
                heading: "Verdict".into(),
                blocks: vec![
                    Block::Notice(
                        Verdict::Fail,
                        "The low band of the DFT is 6 % above its limit; no gains within the bounds reach it.".into(),
                    ),
                    Block::Table(gains()),
                ],
            },
            Section {
                heading: "Plant".into(),
                blocks: vec![
                    Block::Prose("The model follows the sweep within 1 dB up to the first resonance.".into()),
                    Block::Figure(plant),
                ],
            },
            Section { heading: "Loop".into(), blocks: vec![Block::Pair(open, nyquist), Block::Figure(sensitivity)] },
            Section {
                heading: "Position error".into(),
                blocks: vec![
                    Block::Pair(time, dft),
                    Block::Details("The gain file".into(), vec![Block::Code("[pid]\nkp = 0.27 # <b>".into())]),
                ],
            },
        ],
        provenance: vec![
            ("Program".into(), "servotune 0.1.0".into()),
            ("Sweep".into(), format!("sha256 {}", "0f".repeat(32))),
        ],
    }
}

#[test]
fn a_page_holds_every_kind_of_block() {
    let page = demo_page().html();
    assert_eq!(page, demo_page().html());
    std::fs::write(folder().join("page.html"), &page).unwrap();
    assert_eq!(page.matches("<figure").count(), 6);
}
