//! Four machines tuned and certified; then every table and every certificate changed in one place, and proved again.

use super::StudyError;
use rayon::prelude::*;
use servotune::document::sha256_hex;
use servotune::lti::{Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::tune::{GainTable, InputDigest, Machine, Spec, TuneSettings, tune};
use servotune::twin::{MachineClass, nominal_controller};
use servotune::verify::{Certificate, Inputs, SourceFile, Uncertainty, VerifyError, VerifySettings, Word, certify};
use std::path::Path;

/// One machine with its table and certificate.
pub(super) struct Certified {
    pub class: MachineClass,
    pub tuned: bool,
    plant: SourceFile,
    pub gains: SourceFile,
    pub certificate: Certificate,
    /// How far the certificate's DFT norms lie from those of the search's own simulation, as a share of the travel.
    pub dft_apart: f64,
    /// The same over a box of parameters, and with coefficients in 24 bits, 18 behind the point.
    pub boxed: Certificate,
    pub short: Certificate,
}

/// Counts of one kind of change.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Caught {
    pub tried: usize,
    /// Refused outright or found by the proof alone.
    pub by_proof: usize,
    /// Found with the certificate beside the table.
    pub with_certificate: usize,
}

/// Box of the study: what temperature and wear do to such a machine.
pub(super) const BOX: Uncertainty = Uncertainty { gain: 0.02, frequency: 0.01, damping: 0.1, delay: 0.02 };

fn source(file: &str, text: &str) -> SourceFile {
    SourceFile { file: file.into(), text: text.into() }
}

fn spec() -> (SourceFile, SourceFile) {
    (
        source("paper.toml", include_str!("../../../specs/limits/paper.toml")),
        source("spiral.toml", include_str!("../../../specs/profiles/spiral.toml")),
    )
}

fn prove(
    plant: &SourceFile,
    gains: &SourceFile,
    word: Word,
    uncertainty: Uncertainty,
) -> Result<Certificate, VerifyError> {
    let (spec, profile) = spec();
    let plants = [plant.clone()];
    let least_damping = 0.005;
    let sweeps = &[];
    let i = Inputs {
        gains,
        plants: &plants,
        sweeps,
        least_damping,
        spec: &spec,
        profile: Some(&profile),
        word,
        uncertainty,
    };
    certify(&i, &VerifySettings::default())
}

/// Tunes and certifies the four machines.
pub(super) fn machines() -> Result<Vec<Certified>, StudyError> {
    let start = nominal_controller()?;
    let (spec_source, profile) = spec();
    let wanted = Spec::parse(&spec_source.text, profile.text.as_str())?;
    MachineClass::ALL
        .iter()
        .map(|&class| {
            let text = match class.file_name() {
                "sensor_fault" => include_str!("../../../specs/machines/sensor_fault.toml"),
                "loose_pushpin" => include_str!("../../../specs/machines/loose_pushpin.toml"),
                "tunable" => include_str!("../../../specs/machines/tunable.toml"),
                _ => include_str!("../../../specs/machines/healthy.toml"),
            };
            let plant = source(class.file_name(), text);
            let model = Plant::try_from(servotune::document::parse_toml::<PlantFile>(&plant.file, text)?)?;
            let outcome = tune(&Machine::Model(&model), &wanted, Some(&start), &TuneSettings::default())?;
            let inputs = vec![InputDigest { role: "plant".into(), sha256: sha256_hex(text.as_bytes()) }];
            let sha = sha256_hex(spec_source.text.as_bytes());
            let table = GainTable::of(&outcome, wanted.search.seed, sha, inputs)?;
            let gains = source("gains.toml", &table.text()?);
            let none = Uncertainty::default();
            let certificate = prove(&plant, &gains, Word::Double, none)?;
            let apart = certificate.cases[0].write.as_ref().map_or(0.0, |w| {
                let off = |proved: f64, stated: Option<f64>| stated.map_or(f64::INFINITY, |x| (proved - x).abs());
                off(w.dft_low, table.after.dft_low).max(off(w.dft_high, table.after.dft_high))
            });
            Ok(Certified {
                class,
                tuned: outcome.tuned().is_some(),
                certificate,
                dft_apart: apart / wanted.write("a study")?.spiral.distance,
                boxed: prove(&plant, &gains, Word::Double, BOX)?,
                short: prove(&plant, &gains, Word::Fixed { bits: 24, fraction: 18 }, none)?,
                plant,
                gains,
            })
        })
        .collect()
}

/// A certificate as it would be found beside a changed table.
fn caught(m: &Certified, gains: &SourceFile, plant: &SourceFile) -> Result<[bool; 2], StudyError> {
    match prove(plant, gains, Word::Double, Uncertainty::default()) {
        // A refusal to read it is as good.
        Err(_) => Ok([true, true]),
        Ok(c) => {
            let alone = !c.findings.is_empty() || c.proved != m.certificate.proved;
            let text = m.certificate.text()?;
            Ok([alone, alone || !c.compare(Path::new("certificate"), &text)?.is_empty()])
        }
    }
}

/// Changes one digit of a text, not to itself.
fn digit(text: &str, r: &mut Random) -> String {
    let places: Vec<usize> = text.bytes().enumerate().filter(|(_, b)| b.is_ascii_digit()).map(|(i, _)| i).collect();
    let place = places[(r.uniform() * places.len() as f64) as usize];
    let mut bytes = text.as_bytes().to_vec();
    let old = bytes[place] - b'0';
    bytes[place] = b'0' + (old + 1 + (r.uniform() * 9.0) as u8) % 10;
    String::from_utf8_lossy(&bytes).into_owned()
}

/// One change of one machine: whether the proof alone sees it, and whether it does with the certificate.
type Change = dyn Fn(&Certified, u64) -> Result<[bool; 2], StudyError> + Sync;

/// Digits of the table, digits of its coefficients alone, digits of the certificate, other plants: `count` of each a machine.
pub(super) fn mutations(all: &[Certified], count: u64) -> Result<[(&'static str, Caught); 4], StudyError> {
    let sum = |kind: &'static str, one: &Change| {
        let jobs: Vec<(usize, u64)> = (0..all.len()).flat_map(|m| (0..count).map(move |i| (m, i))).collect();
        let found: Vec<[bool; 2]> =
            jobs.par_iter().map(|&(m, i)| one(&all[m], i)).collect::<Result<_, StudyError>>()?;
        let mut c = Caught::default();
        for [alone, with] in found {
            c.tried += 1;
            c.by_proof += usize::from(alone);
            c.with_certificate += usize::from(with);
        }
        Ok::<_, StudyError>((kind, c))
    };
    Ok([
        sum("one digit anywhere in the table", &|m, i| {
            let mut r = Random::stream(i, 81);
            caught(m, &source("gains.toml", &digit(&m.gains.text, &mut r)), &m.plant)
        })?,
        sum("one coefficient of one section by 1e-9 to 10 %", &|m, i| {
            let mut r = Random::stream(i, 82);
            let changed = coefficient(&m.gains.text, &mut r);
            caught(m, &source("gains.toml", &changed), &m.plant)
        })?,
        sum("one digit anywhere in the certificate", &|m, i| {
            let mut r = Random::stream(i, 83);
            let text = m.certificate.text()?;
            let changed = digit(&text, &mut r);
            let seen = m.certificate.compare(Path::new("certificate"), &changed);
            Ok([false, seen.map_or(true, |f| !f.is_empty())])
        })?,
        sum("another plant: one parameter by 1e-6 to 10 %", &|m, i| {
            let mut r = Random::stream(i, 84);
            caught(m, &m.gains, &source("plant.toml", &parameter(&m.plant.text, &mut r)))
        })?,
    ])
}

/// Scales one number among the lines that `take` picks.
fn scaled(text: &str, r: &mut Random, least: f64, take: impl Fn(&str) -> bool) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let picked: Vec<usize> = (0..lines.len()).filter(|i| take(lines[*i])).collect();
    let at = picked[(r.uniform() * picked.len() as f64) as usize];
    let by = 1.0 + r.between(least.ln(), 0.1f64.ln()).exp() * if r.uniform() < 0.5 { 1.0 } else { -1.0 };
    let changed: Vec<String> = lines
        .iter()
        .enumerate()
        .map(|(i, l)| match l.split_once('=') {
            Some((key, value)) if i == at => {
                let number = value.split('#').next().unwrap_or_default().trim().parse::<f64>().unwrap_or(1.0);
                format!("{key}= {:?}", number * by)
            }
            _ => (*l).to_owned(),
        })
        .collect();
    changed.join("\n") + "\n"
}

fn coefficient(text: &str, r: &mut Random) -> String {
    let named = |l: &str| ["b0 =", "b1 =", "b2 =", "a1 =", "a2 ="].iter().any(|k| l.starts_with(k));
    // A coefficient of 0 times anything is no change.
    scaled(text, r, 1e-9, |l| named(l) && l.split('=').nth(1).is_some_and(|v| v.trim().parse::<f64>() != Ok(0.0)))
}

fn parameter(text: &str, r: &mut Random) -> String {
    let number = |l: &str| {
        l.split_once('=')
            .is_some_and(|(_, v)| v.split('#').next().unwrap_or_default().trim().parse::<f64>().is_ok_and(|x| x != 0.0))
    };
    scaled(text, r, 1e-6, number)
}
