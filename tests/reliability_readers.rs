//! What a hostile trial found in the readers and writers of files, each as its reproduction: the refusal, its variant and its fields.
#![allow(clippy::unwrap_used)]

use crate::program_common::folder;
use crate::reliability_common::*;
use nalgebra::Complex;
use servotune::document::{DocumentError, FileSet, OverLimit, parse_toml, read_text, size_limits, write_whole};
use servotune::frf::{
    Channel, Conjugate, Dead, Frf, FrfError, FrfShapeError, Note, Outliers, PhaseConvention, ReadSettings,
};
use servotune::identify::{IdentifySettings, identify};
use servotune::lti::{LtiError, Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::recording::{Record, RecordSettings, RecordingError, gzip, read_columns};
use servotune::twin::plants::{log_grid, measure};
use servotune_report::table::{Column, Table};
use std::f64::consts::TAU;
use std::io::Read;
use std::path::Path;

// H6

#[test]
fn a_dead_channel_is_refused_by_name() {
    let sound = rows(400, 0.003);
    assert!(read(&bod(&sound), &ReadSettings::default()).is_ok());
    let refusal = |change: &dyn Fn(usize, &mut [f64; 3])| {
        let mut all = sound.clone();
        all.iter_mut().enumerate().for_each(|(i, r)| change(i, r));
        match read(&bod(&all), &ReadSettings::default()).unwrap_err() {
            FrfError::DeadChannel { channel, dead, .. } => (channel, dead),
            e => panic!("{e}"),
        }
    };
    for value in [0.0, 1.0, 45.0, 180.0, 9e15] {
        assert_eq!(refusal(&|_, r| r[2] = value), (Channel::Phase, Dead::Constant { found: value, rows: 400 }));
    }
    let held = sound[200];
    for (k, channel) in [(1, Channel::Magnitude), (2, Channel::Phase)] {
        // From a row to the end, and over a stretch in the middle.
        for end in [400, 300] {
            let (found, dead) = refusal(&|i, r| r[k] = if (200..end).contains(&i) { held[k] } else { r[k] });
            match dead {
                Dead::Stuck { found: value, rows, lines, hz, expected_change } => {
                    assert_eq!((found, value, rows, lines), (channel, held[k], end - 200, [202, end as u64 + 1]));
                    assert!(
                        (hz[0] - held[0]).abs() < 1e-9 * held[0] && expected_change > 1.0,
                        "{hz:?} {expected_change}"
                    );
                }
                other => panic!("{other:?}"),
            }
        }
    }
    let (channel, dead) = refusal(&|_, r| r[2] = (r[2] / 45.0).round() * 45.0);
    assert!(channel == Channel::Phase && matches!(dead, Dead::Steps { values: 2..=12, rows: 400 }), "{dead:?}");
}

/// Found by the changed files: an imaginary part that is held where it is small and flat.
#[test]
fn a_part_held_where_it_hardly_moves_is_dead_beside_noise() {
    let frf = measure(&healthy(), &log_grid(40.0, 5000.0, 140), 0.003, &mut Random::new(5)).unwrap();
    for from in 35..70 {
        let mut text = "frequency_hz,real,imag\n".to_owned();
        for (i, (w, v)) in frf.w_rad_s().iter().zip(frf.value()).enumerate() {
            text += &format!("{},{},{}\n", w / TAU, v.re, if i < from { v.im } else { frf.value()[from].im });
        }
        let e = read(&text, &ReadSettings::default()).unwrap_err();
        assert!(matches!(e, FrfError::DeadChannel { channel: Channel::Imaginary, .. }), "{from}: {e}");
    }
}

#[test]
fn a_coarse_display_is_no_dead_channel() {
    // Tenths of a decibel and whole degrees, as old analysers print them, with and without noise: the truth moves, and slowly in places.
    for noise in [0.0, 0.003] {
        for (points, db, deg) in [(400, 0.1, 1.0), (1500, 0.01, 0.1), (200, 0.5, 1.0)] {
            let coarse = |x: f64, q: f64| (x / q).round() * q;
            let all: Vec<_> =
                rows(points, noise).into_iter().map(|[f, m, p]| [f, coarse(m, db), coarse(p, deg)]).collect();
            read(&bod(&all), &ReadSettings::default()).unwrap_or_else(|e| panic!("{points} {db} {deg} {noise}: {e}"));
        }
    }
}

#[test]
fn a_single_point_is_left_out_with_its_frequency() {
    let mut all = rows(400, 0.003);
    let clean = read(&bod(&all), &ReadSettings::default()).unwrap();
    let hz = all[150][0];
    all[150][1] += 60.0;
    let settings = |outliers| ReadSettings { outliers, ..ReadSettings::default() };
    let sweep = read(&bod(&all), &settings(Outliers::Drop)).unwrap();
    let said = sweep.notes.iter().find_map(|n| match n {
        Note::Outlier { line, at_hz, factor } => Some((*line, *at_hz, *factor)),
        _ => None,
    });
    let (line, at_hz, factor) = said.unwrap();
    assert!(
        line == 152 && (at_hz / hz - 1.0).abs() < 1e-9 && (factor / 1000.0 - 1.0).abs() < 0.1,
        "{line} {at_hz} {factor}"
    );
    assert_eq!(sweep.frf.len(), 399);
    assert!(clean.notes.iter().all(|n| !matches!(n, Note::Outlier { .. })));
    assert_eq!(read(&bod(&all), &settings(Outliers::Keep)).unwrap().frf.len(), 400);
    assert!(matches!(
        read(&bod(&all), &settings(Outliers::Refuse)),
        Err(FrfError::Outlier { line: 152, at_hz, .. }) if (at_hz / hz - 1.0).abs() < 1e-9
    ));
    // What is identified is the machine, not the spike.
    let few = IdentifySettings::default();
    let (a, b) = (identify(&clean.frf, &few).unwrap().plant, identify(&sweep.frf, &few).unwrap().plant);
    assert_eq!(a.modes.len(), b.modes.len());
    // One point in twenty is a bad sweep.
    (0..400).step_by(20).for_each(|i| all[i][1] += 40.0);
    let said = ReadSettings { phase: PhaseConvention::Response, conjugate: Conjugate::No, ..ReadSettings::default() };
    assert!(matches!(read(&bod(&all), &said), Err(FrfError::Outliers { points: 400, .. })));
}

// M3

#[test]
fn a_record_that_unpacks_without_end_stays_small() {
    let place = folder("reliability_bomb");
    let file = place.join("zeros.csv.gz");
    std::fs::write(&file, gzip(std::io::repeat(0).take(50_000_000)).unwrap()).unwrap();
    let limit = size_limits::ROW_BYTES;
    for e in [Record::read(&file, &RecordSettings::default()).unwrap_err(), read_columns(&file, &["t"]).unwrap_err()] {
        assert!(
            matches!(e, RecordingError::Size { source: OverLimit::Row { limit: found }, .. } if found == limit),
            "{e}"
        );
    }
    // One field behind a sound header.
    let long = b"time_s,command,position\n0,0,".chain(std::io::repeat(b'1').take(3_000_000));
    std::fs::write(&file, gzip(long).unwrap()).unwrap();
    let e = Record::read(&file, &RecordSettings::default()).unwrap_err();
    assert!(matches!(e, RecordingError::Size { source: OverLimit::Row { .. }, .. }), "{e}");
}

#[cfg(unix)]
#[test]
fn a_document_without_end_is_refused() {
    let limit = size_limits::DOCUMENT_BYTES;
    assert!(
        matches!(read_text(Path::new("/dev/zero")), Err(DocumentError::TooLong { limit: found, .. }) if found == limit)
    );
}

// M4 and M5: the equations of a diagnosis are tested where they stand (`crates/servotune/src/diagnose/data/stacked_records.rs`).

#[test]
fn values_and_frequencies_beyond_any_machine_are_no_response() {
    let frf = |w: f64, v: f64| Frf::new(vec![1.0, w], vec![Complex::new(1.0, 0.0), Complex::new(v, 0.0)], None);
    assert!(frf(2.0, 1e29).is_ok());
    for v in [1e160, 1e31, 1e-31, f64::NAN] {
        assert!(matches!(frf(2.0, v), Err(FrfShapeError::Value { index: 1, .. })), "{v}");
    }
    for w in [1e151, 1e11, 0.5, f64::INFINITY] {
        assert!(matches!(frf(w, 1.0), Err(FrfShapeError::Frequency { index: 1, .. })), "{w}");
    }
    // A huge value that is kept as it is ends in a plant or a refusal.
    let mut all = rows(120, 0.003);
    all[60][1] = 580.0;
    let kept = ReadSettings { outliers: Outliers::Keep, phase: PhaseConvention::Response, ..ReadSettings::default() };
    if let Ok(id) = identify(&read(&bod(&all), &kept).unwrap().frf, &IdentifySettings::default()) {
        id.plant.check().unwrap();
    }
}

// M9

#[test]
fn long_pieces_are_cut_in_tables_and_messages() {
    let mut table = Table::new("t", vec![Column::words("a"), Column::words("b")]);
    table.push(vec!["x".repeat(70_000).as_str().into(), "y".into()]).unwrap();
    assert!(table.text().lines().all(|l| l.chars().count() < 500));
    let long = format!("{}\n{}", bod(&rows(40, 0.0)), "9".repeat(1_000_000));
    let e = read(&long, &ReadSettings::default()).unwrap_err().to_string();
    assert!(e.chars().count() < 1000 && e.contains("characters"), "{e}");
    let key = format!("{} = 1\n{HEALTHY}", "k".repeat(100_000));
    let e = parse_toml::<PlantFile>(Path::new("p"), &key).unwrap_err().to_string();
    assert!(e.chars().count() < 1000, "{}", e.chars().count());
}

// L1

#[cfg(unix)]
#[test]
fn links_are_followed_and_devices_left_alone() {
    let place = folder("reliability_links");
    let (real, link, lost) = (place.join("real.txt"), place.join("link.txt"), place.join("lost.txt"));
    std::fs::write(&real, "old").unwrap();
    std::os::unix::fs::symlink("real.txt", &link).unwrap();
    std::os::unix::fs::symlink("nowhere/at/all", &lost).unwrap();
    write_whole(&link, b"new").unwrap();
    assert_eq!(std::fs::read(&real).unwrap(), b"new");
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    for (file, found) in
        [(lost.as_path(), "a link that leads to no file"), (Path::new("/dev/null"), "a device, a pipe or a socket")]
    {
        let e = write_whole(file, b"x").unwrap_err();
        assert!(matches!(&e, DocumentError::NoFile { found: f, .. } if *f == found), "{e}");
    }
    assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
    assert_eq!(std::fs::read_dir(&place).unwrap().count(), 3);
}

// L3

#[test]
fn files_of_one_result_appear_together_or_not_at_all() {
    let place = folder("reliability_set");
    let (gains, certificate, old) =
        (place.join("gains.toml"), place.join("gains.certificate.json"), place.join("old.json"));
    std::fs::write(&gains, "old gains").unwrap();
    std::fs::write(&old, "old").unwrap();
    std::fs::create_dir(&certificate).unwrap();
    let set = || {
        let mut set = FileSet::default();
        set.write(&gains, "new gains");
        set.remove(&old);
        set.write(&certificate, "new certificate");
        set
    };
    let names = || {
        let mut all: Vec<String> =
            std::fs::read_dir(&place).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        all.sort();
        all
    };
    let before = names();
    assert!(set().commit().is_err());
    assert_eq!((std::fs::read_to_string(&gains).unwrap(), names()), ("old gains".to_owned(), before));
    std::fs::remove_dir(&certificate).unwrap();
    set().commit().unwrap();
    assert_eq!(std::fs::read_to_string(&gains).unwrap(), "new gains");
    assert_eq!(names(), ["gains.certificate.json", "gains.toml"]);
}

// L5, L6, L14

#[test]
fn a_plant_without_a_dead_time_is_none() {
    let without = HEALTHY.lines().filter(|l| !l.starts_with("delay_s")).collect::<Vec<_>>().join("\n");
    let e = parse_toml::<PlantFile>(Path::new("plant.toml"), &without).unwrap_err();
    assert!(matches!(&e, DocumentError::Content { found, .. } if found.contains("delay_s")), "{e}");
}

#[test]
fn two_columns_of_one_name_are_refused() {
    let file = folder("reliability_twice").join("r.csv");
    let rows: String = (0..80).map(|k| format!("{},1,2,3\n", f64::from(k) * 1e-4)).collect();
    std::fs::write(&file, format!("time_s,position,command,position\n{rows}")).unwrap();
    for e in
        [Record::read(&file, &RecordSettings::default()).unwrap_err(), read_columns(&file, &["position"]).unwrap_err()]
    {
        assert!(
            matches!(&e, RecordingError::ColumnTwice { column, first: 2, second: 4, .. } if column == "position"),
            "{e}"
        );
    }
}

#[test]
fn a_gain_beyond_numbers_is_never_written() {
    for gain in ["inf", "nan", "0", "1e31"] {
        let text = HEALTHY.replacen("dc_gain = 75", &format!("dc_gain = {gain}"), 1);
        let plant = Plant::try_from(parse_toml::<PlantFile>(Path::new("p"), &text).unwrap());
        assert!(matches!(plant, Err(LtiError::Range { key, .. }) if key == "plant.dc_gain"), "{gain}");
    }
    // The sweep that made the program write one: an imaginary part beyond numbers.
    let text = rows(60, 0.0)
        .iter()
        .fold("frequency_hz,real,imag\n".to_owned(), |t, r| t + &format!("{},{},-1e308\n", r[0], r[1]));
    let e = read(&text, &ReadSettings::default()).unwrap_err();
    assert!(matches!(e, FrfError::DeadChannel { channel: Channel::Imaginary, .. }), "{e}");
}
