//! Sweeps of other programs: MATLAB files made by scipy and by a writer of this file, Touchstone files. The truth is the closed form of `data/make_sweeps.py`.
#![allow(clippy::unwrap_used, clippy::panic)]

use nalgebra::Complex;
use servotune::frf::{
    ColumnChoice, FrequencyUnit, FrfError as E, NotText, Note, ReadSettings, Sweep, read_bytes, read_file,
};
use std::f64::consts::TAU;
use std::path::PathBuf;

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn read_with(name: &str, settings: &ReadSettings) -> Result<Sweep, E> {
    read_file(&path(name), settings)
}

fn truth(w: f64) -> Complex<f64> {
    let s = Complex::new(0.0, w);
    let square = |zeta: f64, w0: f64| s * s + 2.0 * zeta * w0 * s + w0 * w0;
    4e6 * (s * -5e-5).exp() / (s * s + 60.0 * s + 360.0 * 360.0) * square(0.03, 7000.0) / square(0.02, 7600.0)
}

/// The sweep is the closed form, times `factor`, within `share` of itself.
fn agrees(sweep: &Sweep, factor: f64, share: f64) {
    assert_eq!(sweep.frf.len(), 120);
    let [low, high] = [sweep.frf.w_rad_s()[0], sweep.frf.w_rad_s()[119]];
    assert!((low / TAU - 20.0).abs() < 1e-5 && (high / TAU - 4000.0).abs() < 1e-3, "{low} {high}");
    for (w, v) in sweep.frf.w_rad_s().iter().zip(sweep.frf.value()) {
        let off = (v / (factor * truth(*w)) - 1.0).norm();
        assert!(off < share, "{w}: {off}");
    }
}

#[test]
fn fields_of_frd_are_read_packed_or_not() {
    for name in ["frd.mat", "frd_plain.mat"] {
        let sweep = read_with(name, &ReadSettings::default()).unwrap();
        agrees(&sweep, 1.0, 1e-12);
        let title =
            sweep.notes.iter().find_map(|n| if let Note::Dataset { title, .. } = n { Some(title) } else { None });
        assert_eq!(title.unwrap(), "G.ResponseData over G.Frequency");
    }
}

#[test]
fn vectors_of_the_workspace_are_read_by_their_names() {
    let sweep = read_with("vectors.mat", &ReadSettings::default()).unwrap();
    agrees(&sweep, 1.0, 1e-12);
    assert_eq!(sweep.coherence.unwrap(), vec![0.98; 120]);
    // What `bode` gives: a bare `w` stands for either unit, and is asked for.
    let e = read_with("bode.mat", &ReadSettings::default()).unwrap_err().to_string();
    assert!(e.contains("bode.mat") && e.contains("--frequency rad_per_s"), "{e}");
    let rad = ReadSettings { frequency: FrequencyUnit::RadPerSec, ..Default::default() };
    agrees(&read_with("bode.mat", &rad).unwrap(), 1.0, 1e-9);
    // Single precision: seven digits, of decibels and degrees up to some hundreds.
    agrees(&read_with("table.mat", &ReadSettings::default()).unwrap(), 1.0, 2e-6);
    let choice = ColumnChoice {
        frequency: "f_hz".into(),
        real: Some("H".into()),
        imaginary: Some("H".into()),
        ..Default::default()
    };
    let settings = ReadSettings { columns: Some(choice), ..Default::default() };
    agrees(&read_with("vectors.mat", &settings).unwrap(), 1.0, 1e-12);
}

#[test]
fn several_responses_are_chosen_among() {
    let e = read_with("two_outputs.mat", &ReadSettings::default()).unwrap_err();
    let E::ResponseChoice { wanted: None, responses, .. } = &e else { panic!("{e}") };
    assert_eq!(responses[1], "2: G.ResponseData(2,1,:) over G.Frequency");
    for (dataset, factor) in [(1, 1.0), (2, 2.0)] {
        let settings = ReadSettings { dataset: Some(dataset), ..Default::default() };
        agrees(&read_with("two_outputs.mat", &settings).unwrap(), factor, 1e-12);
    }
    let settings = ReadSettings { dataset: Some(3), ..Default::default() };
    assert!(matches!(read_with("two_outputs.mat", &settings), Err(E::ResponseChoice { wanted: Some(3), .. })));
}

#[test]
fn touchstone_of_one_and_two_ports_is_read() {
    // Nine decimals of kHz: at 34 Hz, beside the body's resonance, 1.5e-8 of itself is a few 1e-8 of the response.
    agrees(&read_with("axis.s1p", &ReadSettings::default()).unwrap(), 1.0, 1e-7);
    let e = read_with("axis.s2p", &ReadSettings::default()).unwrap_err().to_string();
    assert!(e.contains("2: S21") && e.contains("--dataset"), "{e}");
    let settings = ReadSettings { dataset: Some(2), ..Default::default() };
    let sweep = read_with("axis.s2p", &settings).unwrap();
    agrees(&sweep, 1.0, 1e-9);
    assert!(sweep.notes.iter().any(|n| matches!(n, Note::ColumnsIgnored { names } if names == &["noise parameters"])));
}

#[test]
fn what_is_no_sweep_is_refused_with_the_way_on() {
    let read = |name: &str, bytes: &[u8]| read_bytes(name, bytes, &ReadSettings::default()).unwrap_err();
    let e = read_with("nothing.mat", &ReadSettings::default()).unwrap_err().to_string();
    assert!(e.contains("a (3x3)") && e.contains("names (a cell array)") && e.contains("struct('ResponseData'"), "{e}");
    let mut hdf5 = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".to_vec();
    hdf5.resize(124, b' ');
    hdf5.extend([0, 2, b'I', b'M']);
    let e = read("new.mat", &hdf5);
    assert!(matches!(e, E::NotText { found: NotText::Hdf5, .. }) && e.to_string().contains("'-v7'"));
    let e = read("a.s1p", b"! nothing said\n10 0 0\n20 -1 -10\n");
    assert!(matches!(e, E::Touchstone { line: 1, .. }), "{e}");
    let e = read("a.s1p", b"# Hz Z MA R 50\n10 1 0\n20 2 -10\n").to_string();
    assert!(e.contains("line 1") && e.contains("`Z`") && e.contains("scattering"), "{e}");
    let e = read("a.s1p", b"[Version] 2.0\n# Hz S MA R 50\n10 1 0\n").to_string();
    assert!(e.contains("version 1"), "{e}");
    let e = read("a.s4p", b"# Hz S MA R 50\n10 1 0 1 0 1 0 1 0\n").to_string();
    assert!(e.contains("two"), "{e}");
    assert!(matches!(read("a.s1p", b"# Hz S MA\n10 1 0\n20 x 0\n"), E::NotANumber { line: 3, column: 2, .. }));
    assert!(matches!(read("a.s1p", b"# Hz S MA\n10 1 0\n20 1\n"), E::FieldCount { line: 3, found: 2, .. }));
}

/// A writer of level 5 by the format's page, either byte order; shares nothing with the reader.
struct Writer {
    big: bool,
    bytes: Vec<u8>,
}

impl Writer {
    fn new(big: bool) -> Writer {
        let mut bytes = vec![b' '; 124];
        bytes.extend(if big { [1, 0, b'M', b'I'] } else { [0, 1, b'I', b'M'] });
        Writer { big, bytes }
    }
    fn word(&self, x: u32) -> [u8; 4] {
        if self.big { x.to_be_bytes() } else { x.to_le_bytes() }
    }
    fn element(&self, kind: u32, data: &[u8]) -> Vec<u8> {
        if (1..=4).contains(&data.len()) {
            let mut small = self.word((data.len() as u32) << 16 | kind).to_vec();
            small.extend(data);
            small.resize(8, 0);
            return small;
        }
        let mut all = self.word(kind).to_vec();
        all.extend(self.word(data.len() as u32));
        all.extend(data);
        all.resize(all.len().next_multiple_of(8), 0);
        all
    }
    fn words(&self, values: &[u32]) -> Vec<u8> {
        values.iter().flat_map(|x| self.word(*x)).collect()
    }
    /// Flags, sizes, name, then what follows.
    fn array(&self, flags: u32, sizes: &[u32], name: &str, parts: &[Vec<u8>]) -> Vec<u8> {
        let mut inside = self.element(6, &self.words(&[flags, 0]));
        inside.extend(self.element(5, &self.words(sizes)));
        inside.extend(self.element(1, name.as_bytes()));
        inside.extend(parts.concat());
        self.element(14, &inside)
    }
    fn doubles(&self, values: &[f64]) -> Vec<u8> {
        let each = |x: &f64| if self.big { x.to_be_bytes() } else { x.to_le_bytes() };
        self.element(9, &values.iter().flat_map(each).collect::<Vec<u8>>())
    }
}

fn whole_numbers(big: bool) -> Vec<u8> {
    // Frequencies as 16-bit words of a double array, as MATLAB stores whole numbers; a real part as 8-bit words.
    let mut w = Writer::new(big);
    let hertz: Vec<u8> =
        [10u16, 20, 40, 300].iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }).collect();
    let f = w.array(6, &[1, 4], "f_hz", &[w.element(4, &hertz)]);
    let re = w.element(1, &[100, -50i8 as u8, 25, -1i8 as u8]);
    let im = w.doubles(&[-0.5, 1.5, -2.25, 1e-3]);
    let h = w.array(6 | 0x800, &[4, 1], "H", &[re, im]);
    w.bytes.extend(f);
    w.bytes.extend(h);
    w.bytes
}

#[test]
fn either_byte_order_small_elements_and_short_words() {
    for big in [false, true] {
        let sweep = read_bytes("a.mat", &whole_numbers(big), &ReadSettings::default()).unwrap();
        let hz: Vec<f64> = sweep.frf.w_rad_s().iter().map(|w| (w / TAU).round()).collect();
        assert_eq!(hz, [10.0, 20.0, 40.0, 300.0]);
        let c = |re, im| Complex::new(re, im);
        assert_eq!(sweep.frf.value(), [c(100.0, -0.5), c(-50.0, 1.5), c(25.0, -2.25), c(-1.0, 1e-3)]);
    }
}

#[test]
fn an_object_of_a_class_is_named_with_the_way_to_save_it() {
    let mut w = Writer::new(false);
    let mut inside = w.element(6, &w.words(&[17, 0]));
    for name in ["G", "MCOS", "frd"] {
        inside.extend(w.element(1, name.as_bytes()));
    }
    let object = w.element(14, &inside);
    w.bytes.extend(object);
    let e = read_bytes("a.mat", &w.bytes, &ReadSettings::default()).unwrap_err().to_string();
    assert!(e.contains("G (an object of class frd)") && e.contains("G.ResponseData"), "{e}");
}

/// Cut anywhere, changed anywhere: read or refused, never a panic; a cut file is never read as a shorter sweep.
#[test]
fn damaged_files_are_refused() {
    let settings = ReadSettings::default();
    for name in ["frd.mat", "frd_plain.mat", "vectors.mat"] {
        let whole = std::fs::read(path(name)).unwrap();
        for end in (0..whole.len()).step_by(23) {
            if let Ok(sweep) = read_bytes("cut.mat", &whole[..end], &settings) {
                // Only what stands behind the response may be missing.
                assert_eq!(sweep.frf.len(), 120, "{name} cut at {end}");
            }
        }
        for at in (0..whole.len()).step_by(3) {
            let mut changed = whole.clone();
            changed[at] ^= [0x01, 0x80, 0xff][at % 7 % 3];
            let _ = read_bytes("changed.mat", &changed, &settings);
        }
    }
}

/// A length that the file cannot have costs no memory and no time.
#[test]
fn declared_sizes_are_not_believed() {
    let mut w = Writer::new(false);
    let array = w.array(6, &[1 << 30, 1 << 30], "f", &[w.doubles(&[1.0])]);
    w.bytes.extend(array);
    assert!(matches!(read_bytes("a.mat", &w.bytes, &ReadSettings::default()), Err(E::MatDamaged { number: 1, .. })));
    let limit = ReadSettings { inflated_limit_bytes: 1000, ..Default::default() };
    assert!(matches!(read_with("frd.mat", &limit), Err(E::InflatedTooLarge { .. })));
}
