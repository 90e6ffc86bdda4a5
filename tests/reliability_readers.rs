//! What a hostile trial found in the readers, each as its reproduction: the refusal, its variant and its fields.
#![allow(clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::controller::{Controller, ControllerError};
use servotune::document::{DocumentError, FileSet, OverLimit, parse_toml, read_text, size_limits, write_whole};
use servotune::feedback::{FeedbackError, LoopVerdict, MeasuredLoop, ModelLoop, confirmed_margins, measured_margins};
use servotune::frf::{
    Channel, Conjugate, Dead, Frf, FrfError, FrfShapeError, GATHERED_ABOVE, Note, Outliers, PhaseConvention,
    ReadSettings, read_bytes,
};
use servotune::identify::{IdentifySettings, identify};
use servotune::lti::{DiscretePlant, FrequencyResponse, LtiError, Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::pes::{Profile, figures};
use servotune::recording::{Record, RecordSettings, RecordingError, gzip, read_columns};
use servotune::tune::{Machine, Spec, SpecError, judge};
use servotune::twin::plants::{log_grid, measure};
use servotune::twin::{MachineClass, nominal_controller, paper_machine};
use servotune::verify::{Uncertainty, VerifyError, VerifySettings, prove_loop};
use servotune_report::table::{Column, Table};
use std::f64::consts::TAU;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;

const HEALTHY: &str = include_str!("../specs/machines/healthy.toml");
const NOMINAL: &str = include_str!("../specs/controllers/nominal.toml");
const PAPER: &str = include_str!("../specs/limits/paper.toml");
const SPIRAL: &str = include_str!("../specs/profiles/spiral.toml");

fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("reliability_{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Exit code and stderr.
fn servotune(words: &[&str]) -> (i32, String, String) {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let ran = Command::new(env!("CARGO_BIN_EXE_servotune")).current_dir(root).args(words).output().unwrap();
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    (ran.status.code().unwrap(), text(&ran.stdout), text(&ran.stderr))
}

fn healthy() -> Plant {
    paper_machine(MachineClass::Healthy).unwrap()
}

/// Rows (Hz, dB, deg) of the healthy machine.
fn rows(points: usize, noise: f64) -> Vec<[f64; 3]> {
    let frf = measure(&healthy(), &log_grid(40.0, 5000.0, points), noise, &mut Random::new(3)).unwrap();
    let one = |(w, v): (&f64, &Complex<f64>)| [w / TAU, 20.0 * v.norm().log10(), v.arg().to_degrees()];
    frf.w_rad_s().iter().zip(frf.value()).map(one).collect()
}

fn bod(rows: &[[f64; 3]]) -> String {
    let head = "Frequency (Hz)\tMagnitude (dB)\tPhase (deg)\n".to_owned();
    rows.iter().fold(head, |t, [f, m, p]| t + &format!("{f}\t{m}\t{p}\n"))
}

fn read(text: &str, settings: &ReadSettings) -> Result<servotune::frf::Sweep, FrfError> {
    read_bytes("sweep", text.as_bytes(), settings)
}

// H5

#[test]
fn a_limit_on_a_band_without_a_bin_is_no_limit() {
    let short = SPIRAL.replace("window = [200, 400]", "window = [200, 210]");
    match Spec::parse(PAPER, short.as_str()).unwrap_err() {
        SpecError::EmptyBand { key, samples, rate_hz, band } => {
            assert_eq!((key.as_str(), samples, rate_hz, band), ("limits.dft_low", 10, 27_480.0, [600.0, 1500.0]));
        }
        e => panic!("{e}"),
    }
    assert!(Spec::parse(PAPER, SPIRAL).is_ok());
    // 30 samples: a bin at 916 Hz and one at 1832 Hz, so both bands have a figure; 20: one at 1374 Hz only, and the next at 2748 Hz.
    for (window, low, high) in [("[200, 210]", 0, 1), ("[200, 201]", 0, 0), ("[200, 230]", 1, 2), ("[200, 220]", 1, 1)]
    {
        let p: Profile = parse_toml(Path::new("p"), &SPIRAL.replace("[200, 400]", window)).unwrap();
        assert_eq!((p.bins_in([600.0, 1500.0]), p.bins_in([1500.0, 3000.0])), (low, high), "{window}");
        let f = figures(&vec![0.5; p.servo_samples()], &p);
        assert_eq!((f.dft_low.is_some(), f.dft_high.is_some()), (low > 0, high > 0), "{window}");
    }
}

#[test]
fn a_gain_margin_beyond_the_sweep_is_that_of_its_last_point() {
    let rows: Vec<[f64; 3]> = rows(400, 0.0).into_iter().filter(|r| r[0] < 700.0).collect();
    let frf = read(&bod(&rows), &ReadSettings::default()).unwrap().frf;
    let c = nominal_controller().unwrap();
    let machine = Machine::Response { frf: &frf, continuation: None };
    let p = judge(&machine, &c, &Spec::parse(PAPER, SPIRAL).unwrap()).unwrap();
    assert_eq!(p.margins.gain_margin_db, None);
    // The last point of the sweep itself, by the plant's closed form, hold and sections.
    let (w, t) = (TAU * rows[rows.len() - 1][0], c.sample_time_s);
    let hold = Complex::from_polar((0.5 * w * t).sin() / (0.5 * w * t), -0.5 * w * t);
    let size = (healthy().at(w) * hold * c.sections().unwrap().at(w)).norm();
    let found = p.judged.found.gain_margin_db.unwrap();
    assert!((found + 20.0 * size.log10()).abs() < 1e-6, "{found} {size}");
}

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

// M1

#[test]
fn a_filter_that_rings_is_no_controller_and_both_judges_agree() {
    let controller = |damping: &str| -> Controller {
        parse_toml(Path::new("c"), &NOMINAL.replacen("damping_ratio = 0.7", &format!("damping_ratio = {damping}"), 1))
            .unwrap()
    };
    for tiny in ["5e-324", "1e-17", "1e-13", "9e-7"] {
        let e = controller(tiny).check().unwrap_err();
        assert!(matches!(e, ControllerError::Range { key: "lowpass.damping_ratio", .. }), "{e}");
    }
    let slow = NOMINAL.replacen("frequency_hz = 7000.0", "frequency_hz = 1e-9", 1);
    let e = parse_toml::<Controller>(Path::new("c"), &slow).unwrap().check().unwrap_err();
    assert!(matches!(e, ControllerError::Rings { filter: "low-pass", .. }), "{e}");
    let spec = Spec::parse(PAPER, SPIRAL).unwrap();
    let plant = healthy();
    for damping in ["1e-6", "1e-5", "1e-4", "1e-3", "0.01"] {
        let c = controller(damping);
        let (sampled, sections) = (DiscretePlant::of(&plant, c.sample_time_s).unwrap(), c.sections().unwrap());
        let by_margins = confirmed_margins(&ModelLoop::new(&sampled, &sections).unwrap());
        match (by_margins, judge(&Machine::Model(&plant), &c, &spec)) {
            (Ok(m), Ok(p)) => assert_eq!(m.stable, p.margins.stable),
            (Err(FeedbackError::Disagreement { .. }), Err(_)) => {}
            (m, p) => panic!("{damping}: {m:?} {p:?}"),
        }
    }
}

// M2

#[test]
fn the_second_prover_holds_the_limits_of_the_first() {
    let c = nominal_controller().unwrap();
    let sections = c.sections().unwrap().chain;
    let prove =
        |p: &Plant| prove_loop(p, &sections, c.sample_time_s, &Uncertainty::default(), &VerifySettings::default());
    let with = |change: &dyn Fn(&mut Plant)| {
        let mut p = healthy();
        change(&mut p);
        match prove(&p).unwrap_err() {
            VerifyError::Plant(e) => e,
            e => panic!("{e}"),
        }
    };
    for delay_s in [0.05, 1e3, 1e5] {
        let e = with(&|p| p.delay_s = delay_s);
        assert!(
            matches!(e, LtiError::Delay { delay_s: found, limit: size_limits::DELAY_SAMPLES, .. } if found == delay_s),
            "{e}"
        );
    }
    // Beyond any plant, and within a plant but beyond what is summed.
    for w in [1e30, 1e12, 1e8] {
        let e = with(&|p| p.modes[0].zero_rad_s = w);
        assert!(matches!(&e, LtiError::Range { found, .. } if *found == w), "{e}");
    }
    let e = with(&|p| p.modes[1].pole_damping_ratio = 1e9);
    assert!(matches!(&e, LtiError::Range { key, .. } if key == "plant.modes[1].pole_damping_ratio"), "{e}");
    let e = with(&|p| p.modes[1].pole_damping_ratio = 9e3);
    assert!(matches!(&e, LtiError::Range { key, .. } if key.contains("modes[1]")), "{e}");
    assert!(prove(&healthy()).is_ok());
}

// M3

#[test]
fn a_record_that_unpacks_without_end_stays_small() {
    let place = folder("bomb");
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

// M6

#[test]
fn five_points_do_not_tell_stability() {
    let c = nominal_controller().unwrap();
    let sections = c.sections().unwrap();
    let verdict = |points: usize| {
        let frf = measure(&healthy(), &log_grid(40.0, 5000.0, points), 0.003, &mut Random::new(3)).unwrap();
        let m = measured_margins(&MeasuredLoop::new(&frf, &sections).unwrap()).unwrap();
        assert_eq!(m.margins.stable, m.verdict == LoopVerdict::Stable);
        m.verdict
    };
    assert_eq!((verdict(5), verdict(400)), (LoopVerdict::NotKnown, LoopVerdict::Stable));
    let place = folder("five");
    let file = place.join("five.csv");
    let frf = measure(&healthy(), &log_grid(40.0, 5000.0, 5), 0.003, &mut Random::new(3)).unwrap();
    let text = frf
        .w_rad_s()
        .iter()
        .zip(frf.value())
        .fold("frequency_hz,real,imag\n".to_owned(), |t, (w, v)| t + &format!("{},{},{}\n", w / TAU, v.re, v.im));
    std::fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap();
    let (code, out, _) = servotune(&["margins", "--frf", file, "--controller", "specs/controllers/nominal.toml"]);
    assert!(code == 1 && out.contains("NOT KNOWN"), "{code} {out}");
    let (code, ..) = servotune(&["next-sweep", "--frf", file, "--controller", "specs/controllers/nominal.toml"]);
    assert_eq!(code, 1);
    let out = place.join("p.toml");
    let (code, _, err) = servotune(&["identify", file, "--out", out.to_str().unwrap()]);
    assert!(code == 2 && err.contains("5 points") && !out.exists(), "{code} {err}");
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
    let place = folder("links");
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
    let place = folder("set");
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

// L4, L5, L6, L14

#[test]
fn a_share_given_twice_is_refused() {
    let words = ["verify", "g.toml", "--plant", "p.toml", "--spec", "s.toml", "--uncertainty", "gain=5%,gain=1%"];
    let (code, _, err) = servotune(&words);
    assert!(code == 2 && err.contains("`gain` twice"), "{code} {err}");
}

#[test]
fn a_plant_without_a_dead_time_is_none() {
    let without = HEALTHY.lines().filter(|l| !l.starts_with("delay_s")).collect::<Vec<_>>().join("\n");
    let e = parse_toml::<PlantFile>(Path::new("plant.toml"), &without).unwrap_err();
    assert!(matches!(&e, DocumentError::Content { found, .. } if found.contains("delay_s")), "{e}");
}

#[test]
fn two_columns_of_one_name_are_refused() {
    let file = folder("twice").join("r.csv");
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

// The cost of a long sweep

#[test]
fn a_long_sweep_is_gathered_and_gives_the_same_machine() {
    let truth = healthy();
    let frf = |points: usize| measure(&truth, &log_grid(40.0, 5000.0, points), 0.003, &mut Random::new(3)).unwrap();
    let id = identify(&frf(20_000), &IdentifySettings::default()).unwrap();
    assert_eq!(id.gathered_from, Some(20_000));
    assert!(id.w_rad_s.len() < GATHERED_ABOVE, "{}", id.w_rad_s.len());
    assert_eq!(identify(&frf(401), &IdentifySettings::default()).unwrap().gathered_from, None);
    // The truth itself: 0.3 % noise over 20 000 points, averaged some 35 times, leaves well below 0.1 % of the response between the ends.
    for hz in [60.0, 200.0, 560.0, 1200.0, 1800.0, 3000.0, 4500.0] {
        let off = (id.plant.at(TAU * hz) / truth.at(TAU * hz) - 1.0).norm();
        assert!(off < 2e-3, "{hz} Hz: {off}");
    }
}
