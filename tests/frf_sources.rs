//! Layouts, mutations, round trips, time records and the measured files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stderr, missing_docs)]

use crate::frf_plants::{Draw, Plant};
use flate2::read::MultiGzDecoder;
use nalgebra::Complex;
use servotune::frf::*;
use std::f64::consts::TAU;
use std::io::{Read, Write};
use std::path::PathBuf;

fn shared(path: &str) -> Option<PathBuf> {
    let found = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared").join(path);
    if found.exists() {
        return Some(found);
    }
    eprintln!("SKIPPED: {path} is not here");
    None
}

fn response() -> ReadSettings {
    ReadSettings { phase: PhaseConvention::Response, ..Default::default() }
}

/// Rows (hertz, dB, deg) in many layouts must all give the same response.
#[test]
fn every_layout_reads_the_same() {
    let rows = [[40.5, 12.25, -30.5], [80.0, 6.5, -90.0], [160.0, -0.5, -120.25]];
    let lay = |sep: &str, comma: bool, quote: bool| -> String {
        rows.iter()
            .map(|r| {
                let cells: Vec<String> = r
                    .iter()
                    .map(|x| {
                        let text = if comma { x.to_string().replace('.', ",") } else { x.to_string() };
                        if quote { format!("\"{text}\"") } else { text }
                    })
                    .collect();
                cells.join(sep) + "\n"
            })
            .collect()
    };
    let plain = lay("\t", false, false);
    let expected = read_bytes("plain", plain.as_bytes(), &response()).unwrap().frf;
    let mut zipped = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    zipped.write_all(plain.as_bytes()).unwrap();
    let files: Vec<(&str, Vec<u8>)> = vec![
        ("comma", lay(",", false, false).into()),
        ("comma and blank", lay(", ", false, false).into()),
        ("semicolon", lay(";", false, false).into()),
        ("blanks", lay("   ", false, false).into()),
        ("european semicolon", lay(";", true, false).into()),
        ("european tab", lay("\t", true, false).into()),
        ("european blanks", lay("  ", true, false).into()),
        ("quoted", lay(",", false, true).into()),
        ("quoted european", lay(";", true, true).into()),
        ("trailing separator", lay(",", false, false).replace('\n', ",\n").into()),
        ("crlf", plain.replace('\n', "\r\n").into()),
        ("cr only", plain.replace('\n', "\r").into()),
        ("byte order mark", [b"\xef\xbb\xbf".to_vec(), plain.clone().into()].concat()),
        ("comments", format!("# a\n% b\n// c\n! d\n; e\n\n{plain}\n\n# end\n").into()),
        ("latin-1 header", [b"# Phase in \xb0\n".to_vec(), plain.clone().into()].concat()),
        ("header", format!("Frequency (Hz)\tMagnitude (dB)\tPhase (deg)\n{plain}").into()),
        ("commented header", format!("# Frequency (Hz)\tMagnitude (dB)\tPhase (deg)\n{plain}").into()),
        ("header and units", format!("Frequency\tMagnitude\tPhase\nHz\tdB\tdeg\n{plain}").into()),
        ("blank header", format!("Frequency (Hz)  Magnitude (dB)  Phase (deg)\n{}", lay(" ", false, false)).into()),
        ("title", format!("Sweep of slot 3\nFrequency (Hz)\tMagnitude (dB)\tPhase (deg)\n{plain}").into()),
        ("gzip", zipped.finish().unwrap()),
    ];
    for (name, bytes) in files {
        match read_bytes(name, &bytes, &response()) {
            Ok(sweep) => assert_eq!(sweep.frf, expected, "{name}"),
            Err(e) => panic!("{name}: {e}"),
        }
    }
    // Other columns of the same response: order by header, real and imaginary parts, kilohertz and linear magnitude.
    let mixed: String = rows.iter().map(|r| format!("{},{},{}\n", r[2], r[0] / 1e3, 10f64.powf(r[1] / 20.0))).collect();
    let mixed = format!("Phase (deg),Frequency (kHz),Magnitude (abs)\n{mixed}");
    let parts: String =
        expected.w_rad_s().iter().zip(expected.value()).map(|(w, v)| format!("{w};{};{}\n", v.re, v.im)).collect();
    let parts = format!("w (rad/s);Re(G);Im(G)\n{parts}");
    for text in [mixed, parts] {
        let frf = read_bytes("mixed", text.as_bytes(), &response()).unwrap().frf;
        for ((w, v), (x, y)) in
            frf.w_rad_s().iter().zip(frf.value()).zip(expected.w_rad_s().iter().zip(expected.value()))
        {
            assert!((w / x - 1.0).abs() < 1e-14 && (v / y - 1.0).norm() < 1e-13, "{text}"); // a few roundings
        }
    }
}

#[test]
fn coherence_and_deviation_are_carried() {
    let text = "f (Hz),Magnitude (abs),Phase (rad),Std,Coherence\n10,2,-0.1,0.02,0.9\n20,1,-0.2,0.02,0.8\n";
    let sweep = read_bytes("x", text.as_bytes(), &response()).unwrap();
    assert_eq!(sweep.coherence, Some(vec![0.9, 0.8]));
    let std = sweep.frf.relative_std().unwrap();
    assert!((std[0] - 0.01).abs() < 1e-15 && (std[1] - 0.02).abs() < 1e-15);
    assert!(sweep.notes.iter().any(|n| matches!(n, Note::Deviation { relative: false, .. })));
    assert!(sweep.notes.contains(&Note::ConjugateUntested));
}

#[test]
fn descending_sweeps_and_gaps_are_noted() {
    let row = |i: usize| format!("{} {} {}\n", 100 + 10 * i, 20 - i as i64, -10 - i as i64);
    let falling: String = (0..30).rev().map(row).collect();
    let sweep = read_bytes("x", falling.as_bytes(), &response()).unwrap();
    assert!(sweep.notes.contains(&Note::Descending { points: 30 }));
    let torn: String = (0..30).filter(|i| !(10..15).contains(i)).map(row).collect();
    let notes = read_bytes("x", torn.as_bytes(), &response()).unwrap().notes;
    assert!(
        notes.contains(&Note::Gap { from_hz: 190.0, to_hz: 250.0, missing: 5 })
            || notes.iter().any(|n| matches!(n, Note::Gap { missing: 3..=5, .. })),
        "{notes:?}"
    );
}

/// Written with full digits, a response comes back to rounding, as response and as margin display, with its deviations.
#[test]
fn a_written_file_comes_back() {
    for seed in 0..20 {
        let plant = Plant::random(seed);
        let w: Vec<f64> = (0..200).map(|i| TAU * 40.0 * 125f64.powf(f64::from(i) / 199.0)).collect();
        let value: Vec<Complex<f64>> = w.iter().map(|&w| plant.at(w)).collect();
        let std = (seed % 2 == 0).then(|| (0..200).map(|i| 0.01 + 1e-5 * f64::from(i)).collect::<Vec<f64>>());
        let frf = Frf::new(w, value, std).unwrap();
        for (display, phase) in
            [(PhaseDisplay::Response, PhaseConvention::Response), (PhaseDisplay::Margin, PhaseConvention::Margin)]
        {
            let mut out = Vec::new();
            write_bod_as(&frf, display, &mut out).unwrap();
            for phase in [phase, PhaseConvention::Auto] {
                let back = read_bytes("written", &out, &ReadSettings { phase, ..Default::default() }).unwrap().frf;
                assert_eq!(back.relative_std(), frf.relative_std());
                for ((w, v), (x, y)) in
                    back.w_rad_s().iter().zip(back.value()).zip(frf.w_rad_s().iter().zip(frf.value()))
                {
                    // dB and degrees round the logarithm and the angle: up to 60 dB and 180 deg in half units of 1e-16 each.
                    assert!((w / x - 1.0).abs() < 3e-16 && (v / y - 1.0).norm() < 4e-15);
                }
            }
        }
    }
}

#[test]
fn no_mutation_panics() {
    let mut draw = Draw(2024);
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/invalid_sweeps");
    let mut seeds: Vec<Vec<u8>> = ["good.bod", "even_single_text.uff", "uneven_double_binary.uff", "cut.bod.gz"]
        .iter()
        .map(|n| std::fs::read(folder.join(n)).unwrap())
        .collect();
    seeds.push(b"Frequency (Hz);Re;Im;Std;Coherence\n1,5;2;3;0,1;0,9\n2,5;\"1\";2;0,1;0,8\n".to_vec());
    let (mut read, mut refused) = (0, 0);
    for round in 0..3000 {
        let mut bytes = seeds[round % seeds.len()].clone();
        for _ in 0..1 + draw.below(6) {
            let at = draw.below(bytes.len().max(1)).min(bytes.len().saturating_sub(1));
            match draw.below(6) {
                0 => bytes[at] = draw.bits() as u8,
                1 => drop(bytes.drain(at..(at + 1 + draw.below(20)).min(bytes.len()))),
                2 => bytes.insert(at, b" \t\n,;\"-9.e"[draw.below(11) % 10]),
                3 => bytes.truncate(at),
                4 => bytes[at] = b"0123456789-+.e,;\t\n\""[draw.below(19)],
                _ => {
                    let copy = bytes[at..(at + draw.below(40)).min(bytes.len())].to_vec();
                    bytes.splice(at..at, copy);
                }
            }
            if bytes.is_empty() {
                bytes.push(b'1');
            }
        }
        match read_bytes("mutated", &bytes, &ReadSettings::default()) {
            // What passes has kept the promises of a response, and every note can be said.
            Ok(sweep) => {
                read += 1;
                assert!(sweep.frf.w_rad_s().windows(2).all(|w| w[1] > w[0]));
                sweep.notes.iter().for_each(|n| assert!(n.to_string().ends_with('.')));
            }
            Err(e) => {
                refused += 1;
                assert!(e.to_string().contains("mutated"), "{e}");
            }
        }
    }
    eprintln!("mutations: {read} read, {refused} refused");
    assert!(refused > 0 && read > 0);
}

#[test]
fn one_channel_of_the_measured_mirror_is_picked_by_name() {
    let Some(path) = shared("data/fsm_100mV/fsm_100mV_frf.csv.gz") else { return };
    let wide = read_file(&path, &ReadSettings::default());
    assert!(matches!(wide, Err(FrfError::ColumnTwice { .. })), "{wide:?}");
    let columns = ColumnChoice {
        frequency: "f_Hz".into(),
        real: Some("G11_re_um_per_V".into()),
        imaginary: Some("G11_im_um_per_V".into()),
        std: Some("G11_total_std".into()),
        ..Default::default()
    };
    match read_file(&path, &ReadSettings { columns: Some(columns), ..Default::default() }) {
        Ok(sweep) => {
            sweep.notes.iter().filter(|n| !matches!(n, Note::ColumnsIgnored { .. })).for_each(|n| eprintln!("{n}"));
            assert_eq!(sweep.frf.len(), 3839);
            let w = sweep.frf.w_rad_s();
            // The file's description: about 2.72 um/V at 2 to 6 Hz, highest peak at 999.2 Hz.
            let peak = (0..w.len())
                .max_by(|a, b| sweep.frf.value()[*a].norm().total_cmp(&sweep.frf.value()[*b].norm()))
                .unwrap();
            assert!((w[peak] / TAU - 999.2).abs() < 0.4);
            let low: Vec<f64> = w
                .iter()
                .zip(sweep.frf.value())
                .filter(|(w, _)| (2.0..6.0).contains(&(*w / TAU)))
                .map(|(_, v)| v.norm())
                .collect();
            assert!((low.iter().sum::<f64>() / low.len() as f64 - 2.72).abs() < 0.1);
        }
        Err(e) => panic!("{e}"),
    }
}

#[test]
fn the_motor_bench_shows_its_two_inertias() {
    let Some(path) = shared("data/motor_bench/motor_bench_multisineA.csv.gz") else { return };
    let mut text = String::new();
    MultiGzDecoder::new(std::fs::File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    let column = |k: usize| -> Vec<f64> {
        text.lines().skip(1).map(|l| l.split(',').nth(k).unwrap().parse().unwrap()).collect()
    };
    let (current, angle) = (column(2), column(3));
    let settings =
        PeriodicSettings { period: 2500, discard: 2, lines: Some((11..=250).collect()), ..Default::default() };
    let estimate = periodic(&current, &angle, 4e-4, &settings).unwrap();
    assert_eq!((estimate.averaged, estimate.frf.len()), (18, 240));
    // Acceleration over current; the description names the anti-resonance at 53 Hz and the resonance at 77 Hz.
    let gain: Vec<f64> =
        estimate.frf.w_rad_s().iter().zip(estimate.frf.value()).map(|(w, v)| v.norm() * w * w).collect();
    let hz = |i: usize| (estimate.frf.w_rad_s()[i] / TAU).round();
    let span = |a: f64, b: f64| (0..gain.len()).filter(move |&i| (a..=b).contains(&hz(i)));
    let dip = span(40.0, 65.0).min_by(|a, b| gain[*a].total_cmp(&gain[*b])).unwrap();
    let peak = span(65.0, 100.0).max_by(|a, b| gain[*a].total_cmp(&gain[*b])).unwrap();
    assert!((hz(dip) - 53.0).abs() <= 1.0 && (hz(peak) - 77.0).abs() <= 1.0, "{} {}", hz(dip), hz(peak));
}

/// A first-order lag with white output noise: H1 lies within its own deviation, and the deviation is honest.
#[test]
fn both_estimators_know_their_own_error() {
    let (a, period, periods, sample) = (0.8, 512, 24, 1e-3);
    let (mut squares, mut count, mut off, mut segments_count) = (0.0, 0.0, 0.0, 0.0);
    for seed in 0..20 {
        let mut draw = Draw(seed);
        let one: Vec<f64> = (0..period).map(|_| draw.normal()).collect();
        let u: Vec<f64> = (0..period * periods).map(|i| one[i % period]).collect();
        let filter = |u: &[f64], draw: &mut Draw| -> Vec<f64> {
            let mut x = 0.0;
            u.iter()
                .map(|v| {
                    x = a * x + (1.0 - a) * v;
                    x + 0.05 * draw.normal()
                })
                .collect()
        };
        let y = filter(&u, &mut draw);
        let truth =
            |w: f64| Complex::new(1.0 - a, 0.0) / (Complex::new(1.0, 0.0) - a * Complex::from_polar(1.0, -w * sample));
        let settings = PeriodicSettings { period, discard: 2, least_amplitude: 0.2, ..Default::default() };
        let found = periodic(&u, &y, sample, &settings).unwrap();
        for ((w, v), s) in found.frf.w_rad_s().iter().zip(found.frf.value()).zip(found.frf.relative_std().unwrap()) {
            squares += ((v / truth(*w) - 1.0).norm() / s).powi(2);
            count += 1.0;
        }
        let white: Vec<f64> = (0..40_000).map(|_| draw.normal()).collect();
        let y = filter(&white, &mut draw);
        let found = segments(&white, &y, sample, &SegmentSettings { segment: 1000, band_hz: (5.0, 100.0) }).unwrap();
        for ((w, v), s) in found.frf.w_rad_s().iter().zip(found.frf.value()).zip(found.frf.relative_std().unwrap()) {
            // The published deviation is that of the magnitude: half the power of the complex error.
            off += ((v / truth(*w)).norm().ln() / s).powi(2);
            segments_count += 1.0;
        }
    }
    let ratio = squares / count;
    eprintln!("periodic: mean squared error over variance {ratio:.3}; segments {:.3}", off / segments_count);
    // 22 periods estimate each variance with 21 x 2 degrees of freedom: E[1/chi2] makes 42/40 = 1.05; thousands of lines leave 2 % scatter.
    assert!((ratio - 1.05).abs() < 0.08, "{ratio}");
    // Half-overlapping Hann windows average better than segments apart, by up to 2: the deviation is on the safe side.
    assert!((0.4..1.1).contains(&(off / segments_count)), "{}", off / segments_count);
}

#[test]
fn records_that_cannot_be_used_are_refused() {
    let x = vec![1.0; 100];
    let settings = PeriodicSettings { period: 50, discard: 1, ..Default::default() };
    assert!(matches!(
        periodic(&x, &x, 1.0, &settings),
        Err(FrfError::RecordShort { unit: "periods", found: 1, discarded: 1, needed: 2 })
    ));
    assert!(matches!(periodic(&x, &x[1..], 1.0, &settings), Err(FrfError::RecordLength { input: 100, output: 99 })));
    assert!(matches!(periodic(&x, &x, 0.0, &settings), Err(FrfError::SampleTime { .. })));
    let mut bad = x.clone();
    bad[7] = f64::NAN;
    assert!(matches!(periodic(&x, &bad, 1.0, &settings), Err(FrfError::RecordSample { record: "output", sample: 7 })));
    let sine: Vec<f64> = (0..100).map(|i| (TAU * f64::from(i) / 25.0).sin()).collect();
    let settings = PeriodicSettings { period: 25, discard: 0, lines: Some(vec![3]), ..Default::default() };
    assert!(matches!(periodic(&sine, &sine, 1.0, &settings), Err(FrfError::NotExcited { .. })));
}
