//! The nine cases of the public HDD benchmark plant: one controller judged on all of them, tuned on all of them.
//!
//! Data: T. Atsumi's benchmark as carried by its Python port, MIT licence (see the page). Nine cases are three temperatures
//! times three gains of the second actuator; its loop is closed by a fixed lag, so that the main loop sees nine plants.

use super::{Study, StudyError};
use nalgebra::Complex;
use servotune::controller::Controller;
use servotune::feedback::{MeasuredLoop, measured_margins};
use servotune::frf::{Frf, Hold};
use servotune::lti::{DiscretePlant, FrequencyResponse, ModalForm, ModalTerm};
use servotune::recording::read_columns;
use servotune::tune::{Machine, Outcome, Spec, TuneSettings, tune, tune_jointly};
use servotune_report::bode::{BodeCurve, BodeMarks, bode};
use servotune_report::number::NumberFormat;
use servotune_report::table::{Column, Table};
use servotune_report::tuned::gains_table;
use std::f64::consts::TAU;
use std::path::Path;

/// Controller rate: 420 sectors at 7200 rpm (Hz).
pub(super) const RATE_HZ: f64 = 50_400.0;
/// Gain of the main actuator in the benchmark.
const VCM_GAIN: f64 = 3.7976e7;
/// The fixed lag of the second actuator's loop: gain at rest (ratio) and corner (Hz).
const LAG: (f64, f64) = (4.0, 120.0);

/// One mode: frequency (Hz), residue, damping.
type ModeRow = (f64, f64, f64);

/// A case of the benchmark.
pub(super) struct Case {
    pub name: String,
    /// The main actuator with the second one's loop closed, at the controller's rate, hold included.
    pub frf: Frf,
}

/// The nine cases from the folder of published parameters.
pub(super) fn cases(data: &Path) -> Result<Vec<Case>, StudyError> {
    let read = |name: &str| -> Result<Vec<ModeRow>, StudyError> {
        let file = data.join("hdd_benchmark_model").join(name);
        if !file.exists() {
            return Err(StudyError::Absent { file });
        }
        let c = read_columns(&file, &["f_Hz", "kappa", "zeta"])?;
        Ok(c.get("f_Hz").iter().zip(c.get("kappa")).zip(c.get("zeta")).map(|((f, k), z)| (*f, *k, *z)).collect())
    };
    let (vcm, pzt) = (read("vcm_modes.csv")?, read("pzt_modes.csv")?);
    let mut cases = Vec::new();
    for (temperature, vcm_f, pzt_f, damping) in
        [("room", 1.0, 1.0, 1.0), ("low", 1.04, 1.06, 0.8), ("high", 0.96, 0.94, 1.2)]
    {
        for gain in [1.0, 1.05, 0.95] {
            let main = sampled(&vcm, VCM_GAIN, vcm_f, damping)?;
            let fine = sampled(&pzt, 1.0, pzt_f, damping)?;
            let at_rest = fine.at(1e-3).norm();
            let name = format!("{temperature} temperature, second actuator {:+.0} %", 100.0 * (gain - 1.0));
            cases.push(Case { name, frf: response(&main, &fine, gain / at_rest)? });
        }
    }
    Ok(cases)
}

/// One controller for all cases.
pub(super) fn joint(cases: &[Case]) -> Result<Outcome, StudyError> {
    let spec = Spec::parse(include_str!("specs/hdd.toml"), include_str!("specs/hdd_profile.toml"))?;
    let settings = TuneSettings { sample_time_s: Some(1.0 / RATE_HZ), ..TuneSettings::default() };
    let machines: Vec<Machine<'_>> =
        cases.iter().map(|c| Machine::Response { frf: &c.frf, continuation: None }).collect();
    Ok(tune_jointly(&machines, &spec, None, &settings)?)
}

/// Makes the study from the folder of published parameters.
pub fn hdd(data: &Path) -> Result<Study, StudyError> {
    let cases = cases(data)?;
    let spec = Spec::parse(include_str!("specs/hdd.toml"), include_str!("specs/hdd_profile.toml"))?;
    let settings = TuneSettings { sample_time_s: Some(1.0 / RATE_HZ), ..TuneSettings::default() };
    let first = Machine::Response { frf: &cases[0].frf, continuation: None };
    let alone = tune(&first, &spec, None, &settings)?;
    let jointly = joint(&cases)?;
    let mut study = Study::default();
    study.page("hdd_benchmark.md", page(&cases, &alone, &jointly)?);
    let curves: Vec<(Vec<f64>, &Case)> =
        [0, 3, 6].map(|i| (cases[i].frf.w_rad_s().iter().map(|w| w / TAU).collect(), &cases[i])).into();
    let curves: Vec<BodeCurve> = curves
        .iter()
        .map(|(hz, c)| BodeCurve { name: &c.name, frequency_hz: hz, response: c.frf.value(), relative_std: None })
        .collect();
    let title = "HDD benchmark: main actuator, second actuator's loop closed";
    study.picture("hdd_benchmark", &bode(title, "", &curves, &BodeMarks::default())?);
    Ok(study)
}

/// A sum of modes, exactly sampled; frequencies and damping scaled by the case.
fn sampled(modes: &[ModeRow], gain: f64, frequency: f64, damping: f64) -> Result<DiscretePlant, StudyError> {
    let mut form = ModalForm { terms: vec![], rigid2: 0.0, rigid1: 0.0, delay_s: 0.0 };
    for &(hz, kappa, zeta) in modes {
        if hz == 0.0 {
            form.rigid2 += gain * kappa;
            continue;
        }
        let (w, z) = (TAU * hz * frequency, zeta * damping);
        let wd = w * (1.0 - z * z).sqrt();
        // k/(s² + 2 z w s + w²) has the residue k/(2 j wd) at its upper pole.
        form.terms
            .push(ModalTerm { pole: Complex::new(-z * w, wd), residue: gain * kappa / Complex::new(0.0, 2.0 * wd) });
    }
    Ok(DiscretePlant::of_modal(&form, 1.0 / RATE_HZ)?)
}

/// The main actuator's response with the second loop closed, on a grid that resolves every mode.
fn response(main: &DiscretePlant, fine: &DiscretePlant, fine_gain: f64) -> Result<Frf, StudyError> {
    let t = 1.0 / RATE_HZ;
    let lag_pole = (-TAU * LAG.1 * t).exp();
    let sections = servotune::lti::Sections { chain: vec![], sample_time_s: t };
    let poles: Vec<Complex<f64>> = main.terms().iter().chain(fine.terms()).copied().collect();
    let mut grid = servotune::feedback::frequency_grid(&poles, &sections);
    grid.retain(|w| *w > TAU * 10.0 && *w < 0.999 * std::f64::consts::PI / t);
    let value = grid
        .iter()
        .map(|&w| {
            let lag = LAG.0 * (1.0 - lag_pole) / (Complex::from_polar(1.0, w * t) - lag_pole);
            main.at(w) / (1.0 + fine_gain * fine.at(w) * lag)
        })
        .collect();
    Ok(Frf::new(grid, value, None)?.with_hold(Hold::Included { sample_time_s: t }))
}

fn page(cases: &[Case], alone: &Outcome, jointly: &Outcome) -> Result<String, StudyError> {
    let (first, first_missed) = margin_table("Tuned on the first case alone", cases, alone.controller())?;
    let (second, second_missed) = margin_table("Tuned jointly on all nine", cases, jointly.controller())?;
    let words = |o: &Outcome| if o.tuned().is_some() { "every limit met" } else { "infeasible, best compromise" };
    Ok(format!(
        "# HDD benchmark plant: nine cases\n\n\
         Made by `lab hdd --data DATA --out results`, DATA being the folder with `hdd_benchmark_model/`. Source: T. Atsumi, IEEJ benchmark \
         (MATLAB File Exchange 111515; IEEE TIE 67(11), 2020), parameters from its Python port, MIT licence. Published parameters, not a recording.\n\n\
         Three temperatures (main actuator's frequencies 0, +4, -4 %, damping x1, x0.8, x1.2; second actuator's +-6 %) times three gains of the second \
         actuator (0, +5, -5 %). Both actuators are sampled exactly at {RATE_HZ} Hz. The loop is cut at the main actuator's input; the second actuator's own loop is \
         closed by a fixed lag (gain {} at rest, corner {} Hz), which is ours, so its gain matters and the nine cases differ. Limits: `crates/lab/src/specs/hdd.toml`.\n\n\
         Tuned on the first case alone: {}; on all nine, {first_missed} of {n} miss a margin limit. Tuned jointly: {}; {second_missed} of {n} miss one.\n\n\
         ```text\n{}```\n\n```text\n{}```\n\n```text\n{}```\n\nPicture: [responses](figures/hdd_benchmark.svg).\n",
        LAG.0,
        LAG.1,
        words(alone),
        words(jointly),
        first.text(),
        second.text(),
        gains_table(Some(alone.controller()), jointly.controller(), &[])?.text(),
        n = cases.len(),
    ))
}

/// Margins of one controller over all cases, and how many miss a limit of the spec.
fn margin_table(caption: &str, cases: &[Case], c: &Controller) -> Result<(Table, usize), StudyError> {
    let digits = NumberFormat::Significant(4);
    let spec = Spec::parse(include_str!("specs/hdd.toml"), include_str!("specs/hdd_profile.toml"))?;
    let wanted = &spec.margins;
    let mut table = Table::new(
        caption,
        vec![
            Column::words("case"),
            Column::words("stable"),
            Column::numbers("crossover", "Hz", digits),
            Column::numbers("phase margin", "deg", digits),
            Column::numbers("gain margin", "dB", digits),
            Column::numbers("Ms", "ratio", digits),
        ],
    );
    let sections = c.sections()?;
    let mut missed = 0;
    for case in cases {
        let m = measured_margins(&MeasuredLoop::new(&case.frf, &sections)?)?.margins;
        let short = |found: Option<f64>, limit: Option<f64>| found.zip(limit).is_some_and(|(f, l)| f < l);
        let over = wanted.max_sensitivity.is_some_and(|l| m.max_sensitivity > l);
        if !m.stable
            || over
            || short(m.phase_margin_deg, wanted.phase_margin_deg)
            || short(m.gain_margin_db, wanted.gain_margin_db)
        {
            missed += 1;
        }
        table.push(vec![
            case.name.as_str().into(),
            if m.stable { "yes" } else { "NO" }.into(),
            m.gain_crossover_hz.into(),
            m.phase_margin_deg.into(),
            m.gain_margin_db.into(),
            m.max_sensitivity.into(),
        ])?;
    }
    Ok((table, missed))
}
