//! The readers under test, each with small files that it accepts and what is asked of what it accepts.
//!
//! In: built-in machines and files made here. Out: [`Reader`]s. What is asked is what a wrong acceptance would show in: a loop of a killed channel must not be stable,
//! a changed table must not be proved beside its certificate, an identified plant must be one.

use super::StudyError;
use super::reached::Reached;
use servotune::controller::Controller;
use servotune::document::parse_toml;
use servotune::feedback::{LoopVerdict, MeasuredLoop, ModelLoop, confirmed_margins, measured_margins};
use servotune::frf::{PhaseDisplay, ReadSettings, Sweep, read_bytes, write_bod_as};
use servotune::gate::features::read_machine;
use servotune::gate::{Gate, Table, TrainSettings, train};
use servotune::identify::{IdentifySettings, OrderChoice, identify};
use servotune::lti::{DiscretePlant, Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::pes::{Profile, simulate};
use servotune::recording::{Case, RecordSettings, gzip, read_columns};
use servotune::tune::{GainTable, InputDigest, Machine, Spec, TuneSettings, tune};
use servotune::twin::plants::{log_grid, measure};
use servotune::twin::{MachineClass, nominal_controller, paper_machine};
use servotune::verify::{Certificate, Inputs, SourceFile, Uncertainty, VerifySettings, Word, certify};
use servotune_fleet::{FileSource, Fleet, SlotSource};
use std::path::Path;

/// Names and bytes of the files of one sample.
pub(super) type Files = Vec<(&'static str, Vec<u8>)>;

/// One reader.
pub(super) struct Reader {
    pub name: &'static str,
    /// Share of the runs.
    pub weight: f64,
    /// Whether its files are tables of numbers.
    pub table: bool,
    pub corpus: Vec<Files>,
    /// Reads the files, the changed one among them, and asks; `dead` as in `Mutated`; the folder is for those that read from disk.
    pub take: fn(&Files, bool, &Path) -> Reached,
}

const HEALTHY: &str = include_str!("../../../specs/machines/healthy.toml");
const NOMINAL: &str = include_str!("../../../specs/controllers/nominal.toml");
const PAPER: &str = include_str!("../../../specs/limits/paper.toml");
const SPIRAL: &str = include_str!("../../../specs/profiles/spiral.toml");
const UNIVERSAL: [&[u8]; 3] = [
    include_bytes!("../../../tests/invalid_sweeps/uneven_double_text.uff"),
    include_bytes!("../../../tests/invalid_sweeps/uneven_double_binary.uff"),
    include_bytes!("../../../tests/invalid_sweeps/even_single_binary.uff"),
];

/// Largest write that is simulated in a trial (samples): a longer one is only checked.
const SIMULATED: f64 = 20_000.0;

fn refused(e: impl std::fmt::Display) -> Reached {
    Reached::Refused(e.to_string())
}

/// The value or the refusal that ends the trial.
macro_rules! or_refused {
    ($e:expr) => {
        match $e {
            Ok(x) => x,
            Err(e) => return refused(e),
        }
    };
}

/// Every reader with its corpus.
pub(super) fn readers() -> Result<Vec<Reader>, StudyError> {
    let plant = paper_machine(MachineClass::Healthy)?;
    let sweep = measure(&plant, &log_grid(40.0, 5000.0, 140), 0.003, &mut Random::new(5))?;
    let mut bod = Vec::new();
    write_bod_as(&sweep, PhaseDisplay::Response, &mut bod)?;
    let bod = String::from_utf8_lossy(&bod).into_owned();
    let semicolon = bod.replace('\t', ";").replace('.', ",").into_bytes();
    let csv = {
        let mut text = "frequency_hz,real,imag\n".to_owned();
        for (w, v) in sweep.w_rad_s().iter().zip(sweep.value()) {
            text += &format!("{},{},{}\n", w / std::f64::consts::TAU, v.re, v.im);
        }
        text.into_bytes()
    };
    let packed = gzip(bod.as_bytes()).map_err(|source| StudyError::Thread { source })?;
    let mut sweeps: Vec<Files> = [bod.clone().into_bytes(), bod.clone().into_bytes(), semicolon, csv, packed]
        .into_iter()
        .map(|b| vec![("sweep", b)])
        .collect();
    sweeps.extend(UNIVERSAL.map(|b| vec![("sweep.uff", b.to_vec())]));
    let text = |name, text: &str| (name, text.as_bytes().to_vec());
    let spec = || vec![text("spec.toml", PAPER), text("profile.toml", SPIRAL)];
    let pes: String = (0..600).map(|k| format!("{},{}\n", k as f64 / 27_480.0, (k as f64 * 0.3).sin())).collect();
    let folder = vec![
        ("response.bod", bod.into_bytes()),
        ("pes.csv", format!("time_s,pes\n{pes}").into_bytes()),
        text("log.toml", "FF_Factor = 0.9\ntemperature_c = 24.5\nlabel = 3\n"),
    ];
    let [record, packed] = record()?;
    let case = |record: (&'static str, Vec<u8>)| {
        let case = format!(
            "id = \"P\"\nplant = \"plant.toml\"\ncontroller = \"controller.toml\"\nspindle_hz = 120.0\n[[records]]\nfile = \"{}\"\nrole = \"fit\"\n",
            record.0
        );
        vec![("case.toml", case.into_bytes()), record]
    };
    let table = features(3);
    let fleet = "spec = \"spec.toml\"\ncontroller = \"controller.toml\"\ngate = \"gate.json\"\n[input]\ntable = \"slots.csv\"\n[robust]\ndraws = 8\n[temperature]\ncases_c = [20.0, 30.0]\n[tables]\npilots = 4\nscouts = 8\nmost = 8\n[untunable]\nexplained = 2\n";
    let slots = "tester,slot,response,pes,log,controller,temperature_c\nT001,S01,a/response.bod,a/pes.csv,,,24.5\nT001,S02,b/response.bod,b/pes.csv,,,22\n";
    let reader = |name, weight, table, corpus, take| Reader { name, weight, table, corpus, take };
    Ok(vec![
        reader("sweeps: bod, csv, semicolon, gz, UFF 58 and 58b", 30.0, true, sweeps, take_sweep),
        reader("plant.toml", 12.0, false, vec![vec![text("plant.toml", HEALTHY)]], take_plant),
        reader("controller.toml", 12.0, false, vec![vec![text("controller.toml", NOMINAL)]], take_controller),
        reader("spec.toml, profile.toml", 12.0, false, vec![spec()], take_spec),
        reader("profile.toml, simulated", 4.0, false, vec![vec![text("profile.toml", SPIRAL)]], take_profile),
        reader("gains, certificate, plant, spec, profile, proved", 2.0, false, vec![certified(&plant)?], take_proof),
        reader("gate.json", 8.0, false, vec![gate(&table)?], take_gate),
        reader("features.csv", 8.0, true, vec![vec![("features.csv", table.into_bytes())]], take_features),
        reader("machine folder: response.bod, pes.csv, log.toml", 6.0, true, vec![folder], take_folder),
        reader("case.toml, record.csv, record.csv.gz", 10.0, true, vec![case(record), case(packed)], take_case),
        reader("FLEET.toml", 6.0, false, vec![vec![text("FLEET.toml", fleet)]], take_fleet),
        reader("slots.csv", 6.0, true, vec![vec![text("slots.csv", slots)]], take_slots),
    ])
}

fn take_sweep(files: &Files, dead: bool, _: &Path) -> Reached {
    let sweep: Sweep = or_refused!(read_bytes("sweep", &files[0].1, &ReadSettings::default()));
    let controller = or_refused!(nominal_controller());
    let sections = or_refused!(controller.sections());
    let judged = or_refused!(MeasuredLoop::new(&sweep.frf, &sections).and_then(|l| measured_margins(&l)));
    if dead && judged.verdict == LoopVerdict::Stable {
        return Reached::Wrong(format!("a dead channel is stable, phase margin {:?}", judged.margins.phase_margin_deg));
    }
    // The whole fit is slow: every eighth file, by its digest.
    if sweep.source_digest.starts_with(['0', '8']) {
        let few = IdentifySettings { order: OrderChoice::Auto { max: 3 }, ..IdentifySettings::default() };
        let id = or_refused!(identify(&sweep.frf, &few));
        if let Err(e) = id.plant.check() {
            return Reached::Wrong(format!("identified no plant: {e}"));
        }
    }
    Reached::Accepted
}

fn plant_of(bytes: &[u8]) -> Result<Plant, String> {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let file: PlantFile = parse_toml(Path::new("plant.toml"), text).map_err(|e| e.to_string())?;
    Plant::try_from(file).map_err(|e| e.to_string())
}

fn take_plant(files: &Files, _: bool, _: &Path) -> Reached {
    let plant = or_refused!(plant_of(&files[0].1));
    let controller = or_refused!(nominal_controller());
    let sections = or_refused!(controller.sections());
    let sampled = or_refused!(DiscretePlant::of(&plant, controller.sample_time_s));
    or_refused!(ModelLoop::new(&sampled, &sections).and_then(|l| confirmed_margins(&l)));
    Reached::Accepted
}

fn take_controller(files: &Files, _: bool, _: &Path) -> Reached {
    let text = or_refused!(std::str::from_utf8(&files[0].1));
    let controller: Controller = or_refused!(parse_toml(Path::new("controller.toml"), text));
    let sections = or_refused!(controller.sections());
    let plant = or_refused!(paper_machine(MachineClass::Healthy));
    let sampled = or_refused!(DiscretePlant::of(&plant, controller.sample_time_s));
    or_refused!(ModelLoop::new(&sampled, &sections).and_then(|l| confirmed_margins(&l)));
    Reached::Accepted
}

fn take_spec(files: &Files, _: bool, _: &Path) -> Reached {
    let (spec, profile) =
        (or_refused!(std::str::from_utf8(&files[0].1)), or_refused!(std::str::from_utf8(&files[1].1)));
    let spec = or_refused!(Spec::parse(spec, profile));
    let l = &spec.limits;
    for (limit, band) in [(l.dft_low, servotune::pes::LOW_BAND_HZ), (l.dft_high, servotune::pes::HIGH_BAND_HZ)] {
        if limit.is_some() && spec.profile.as_ref().is_none_or(|p| p.bins_in(band) == 0) {
            return Reached::Wrong("a limit on a band without a bin".into());
        }
    }
    Reached::Accepted
}

fn take_profile(files: &Files, _: bool, _: &Path) -> Reached {
    let text = or_refused!(std::str::from_utf8(&files[0].1));
    let profile: Profile = or_refused!(parse_toml(Path::new("profile.toml"), text));
    or_refused!(profile.check());
    let (plant, controller) = (or_refused!(paper_machine(MachineClass::Healthy)), or_refused!(nominal_controller()));
    if profile.spiral.duration_s * profile.pes.sample_rate_hz.max(1.0 / controller.sample_time_s) < SIMULATED {
        or_refused!(simulate(&plant, &controller, &profile));
    }
    Reached::Accepted
}

/// Tunes the tunable machine briefly and proves the table: the sample of a certificate.
fn certified(_: &Plant) -> Result<Files, StudyError> {
    let plant = paper_machine(MachineClass::Tunable)?;
    let plant_text = toml::to_string(&PlantFile::from(&plant)).unwrap_or_default();
    let spec = Spec::parse(PAPER, SPIRAL)?;
    let settings = TuneSettings { starts: 2, ..TuneSettings::default() };
    let outcome = tune(&Machine::Model(&plant), &spec, Some(&nominal_controller()?), &settings)?;
    let sha = |text: &str| servotune::document::sha256_hex(text.as_bytes());
    let inputs = vec![InputDigest { role: "plant".into(), sha256: sha(&plant_text) }];
    let gains = GainTable::of(&outcome, 1, sha(PAPER), inputs)?.text()?;
    let mut files: Files = vec![
        ("gains.toml", gains.into_bytes()),
        ("plant.toml", plant_text.into_bytes()),
        ("spec.toml", PAPER.as_bytes().to_vec()),
        ("profile.toml", SPIRAL.as_bytes().to_vec()),
    ];
    let certificate = proof(&files)?;
    files.push(("certificate.json", certificate.text()?.into_bytes()));
    // The table first, several times: it is what runs on the machine.
    Ok(files)
}

fn proof(files: &Files) -> Result<Certificate, servotune::verify::VerifyError> {
    let source =
        |i: usize| SourceFile { file: files[i].0.into(), text: String::from_utf8_lossy(&files[i].1).into_owned() };
    let (gains, plant, spec, profile) = (source(0), source(1), source(2), source(3));
    let inputs = Inputs {
        gains: &gains,
        plants: &[plant],
        sweeps: &[],
        least_damping: 0.005,
        spec: &spec,
        profile: Some(&profile),
        word: Word::Double,
        uncertainty: Uncertainty::default(),
    };
    certify(&inputs, &VerifySettings::default())
}

fn take_proof(files: &Files, _: bool, _: &Path) -> Reached {
    // A write that the profile makes too long would only be slow.
    if let Ok(text) = std::str::from_utf8(&files[3].1)
        && let Ok(p) = parse_toml::<Profile>(Path::new("profile.toml"), text)
        && p.spiral.duration_s * p.pes.sample_rate_hz > SIMULATED
    {
        return refused("longer than a trial simulates");
    }
    let c = or_refused!(proof(files));
    let old = or_refused!(std::str::from_utf8(&files[4].1));
    let unfit = or_refused!(c.compare(Path::new("certificate.json"), old));
    if !c.proved || !unfit.is_empty() {
        return refused("not proved");
    }
    // Proved, and everything is as the certificate says: then table, plant and spec are what they were, byte by byte, for it carries their digests.
    let shas = [("gains", 0), ("spec", 2), ("profile", 3)];
    let sha = |i: usize| servotune::document::sha256_hex(&files[i].1);
    match shas.into_iter().find(|(_, i)| !old.contains(&sha(*i))) {
        Some((name, _)) => Reached::Wrong(format!("{name} is not the one certified, and is proved")),
        None => Reached::Accepted,
    }
}

/// A table of machines of three classes that differ in every feature.
fn features(seed: u64) -> String {
    let mut random = Random::new(seed);
    let mut text = "id,label,f0,f1,f2,f3,f4,f5\n".to_owned();
    for i in 0..90 {
        let class = i % 3;
        text += &format!("m{i},{class}");
        (0..6).for_each(|j| text += &format!(",{}", 10.0 + f64::from((class * (j + 1)) % 5) + 0.3 * random.normal()));
        text.push('\n');
    }
    text
}

fn gate(table: &str) -> Result<Files, StudyError> {
    let read = Table::parse(Path::new("features.csv"), table, Some("label"))?;
    let settings =
        TrainSettings { hidden: vec![4], epochs: Some(5), folds: 0, features: Some(4), ..TrainSettings::default() };
    let gate = train(&read, &settings)?.gate;
    Ok(vec![("gate.json", gate.to_json()?.into_bytes()), ("features.csv", table.as_bytes().to_vec())])
}

fn take_gate(files: &Files, _: bool, _: &Path) -> Reached {
    let (text, table) = (or_refused!(std::str::from_utf8(&files[0].1)), or_refused!(std::str::from_utf8(&files[1].1)));
    let gate = or_refused!(Gate::parse(Path::new("gate.json"), text));
    let table = or_refused!(Table::parse(Path::new("features.csv"), table, Some(&gate.label)));
    let rows = or_refused!(gate.classify(&table));
    match rows.iter().find(|v| !(0.0..=1.0).contains(&v.probability)) {
        Some(v) => Reached::Wrong(format!("a probability of {}", v.probability)),
        None => Reached::Accepted,
    }
}

fn take_features(files: &Files, _: bool, _: &Path) -> Reached {
    let text = or_refused!(std::str::from_utf8(&files[0].1));
    let table = or_refused!(Table::parse(Path::new("features.csv"), text, Some("label")));
    or_refused!(table.all_numbers());
    Reached::Accepted
}

/// Puts the files into the folder.
fn lay(files: &Files, folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    files.iter().try_for_each(|(name, bytes)| std::fs::write(folder.join(name), bytes))
}

fn take_folder(files: &Files, _: bool, folder: &Path) -> Reached {
    or_refused!(lay(files, folder));
    let (machine, problems) = read_machine(folder);
    servotune::gate::features::features(&[machine]);
    match problems.first() {
        Some(p) => refused(p),
        None => Reached::Accepted,
    }
}

/// A record of some hundred samples, and the same packed.
fn record() -> Result<[(&'static str, Vec<u8>); 2], StudyError> {
    let mut random = Random::new(8);
    let mut text = "time_s,reference,excitation,command,position,pes\n".to_owned();
    for k in 0..300 {
        let x = (k as f64 * 0.05).sin();
        text += &format!("{},{x},0,{},{},\n", k as f64 * 4e-5, 0.3 * x, x + 0.01 * random.normal());
    }
    let packed = gzip(text.as_bytes()).map_err(|source| StudyError::Thread { source })?;
    Ok([("record.csv", text.into_bytes()), ("record.csv.gz", packed)])
}

fn take_case(files: &Files, _: bool, folder: &Path) -> Reached {
    or_refused!(lay(files, folder));
    or_refused!(read_columns(&folder.join(files[1].0), &["command", "position"]));
    or_refused!(Case::read(folder, &RecordSettings::default()));
    Reached::Accepted
}

fn take_fleet(files: &Files, _: bool, _: &Path) -> Reached {
    let text = or_refused!(std::str::from_utf8(&files[0].1));
    or_refused!(Fleet::parse(Path::new("FLEET.toml"), text));
    Reached::Accepted
}

fn take_slots(files: &Files, _: bool, folder: &Path) -> Reached {
    or_refused!(lay(files, folder));
    let input = servotune_fleet::Input { table: Some(folder.join("slots.csv")), ..servotune_fleet::Input::default() };
    let source = or_refused!(FileSource::of(Path::new("FLEET.toml"), &input));
    (0..source.count().min(3)).for_each(|i| drop(source.load(i)));
    Reached::Accepted
}
