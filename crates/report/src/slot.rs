//! The page of one slot: identification, loop, PES, gains, before and after.
//!
//! In: views of one loop each, made by the caller. Out: a [`Page`]. Spec: `specs/report.md`.

use super::ReportError;
use super::bode::{BodeCurve, BodeMarks, bode};
use super::figure::{Figure, Ink};
use super::margins::margins_table;
use super::number::NumberFormat;
use super::nyquist::{NyquistMarks, nyquist};
use super::page::{Block, Card, Page, Section};
use super::sensitivity::sensitivity;
use super::spectrum_bars::{SpectrumBars, spectrum_bars};
use super::table::Verdict;
use super::time::{CurveKind, TimeCurve, TimePanel, time};
use super::tuned::{Units, limits_table};
use nalgebra::Complex;
use servotune::feedback::Margins;
use servotune::pes::{ClosedLoop, PesFigures, Profile};
use servotune::tune::{Judged, Spec};

/// One controller on one machine, with all that is drawn of it.
#[derive(Clone, Debug)]
pub struct LoopView {
    /// "before", "after", or a name.
    pub name: String,
    /// Frequencies of the curves (Hz).
    pub hz: Vec<f64>,
    /// L at them.
    pub open_loop: Vec<Complex<f64>>,
    /// Its margins.
    pub margins: Margins,
    /// The write; none where the loop is unstable.
    pub write: Option<(ClosedLoop, PesFigures)>,
    /// The limits, judged; none where there is no spec.
    pub judged: Option<Judged>,
}

/// What a slot's page shows.
#[derive(Debug)]
pub struct SlotView<'a> {
    /// Name of the slot or machine.
    pub name: &'a str,
    /// The verdict in one sentence, and whether it is good.
    pub verdict: (Verdict, String),
    /// What the certificate says of the gain table; none without one.
    pub certificate: Option<&'a str>,
    /// On what the limits were judged, where that is not what the curves show.
    pub judged_on: Option<&'a str>,
    /// Sections about where the plant comes from, shown first.
    pub plant: Vec<Section>,
    /// The controller before.
    pub before: Option<&'a LoopView>,
    /// The controller after.
    pub after: &'a LoopView,
    /// Limits and write.
    pub spec: &'a Spec,
    /// Units of position and command.
    pub units: Units<'a>,
    /// Sections about the gains, shown last.
    pub gains: Vec<Section>,
    /// Inputs with digests, program, seed.
    pub provenance: Vec<(String, String)>,
}

/// The page of one slot.
pub fn slot_page(view: &SlotView<'_>) -> Result<Page, ReportError> {
    let limits = limits_table(view.before.and_then(|b| b.judged.as_ref()), view.after.judged.as_ref(), view.units)?;
    let mut verdict = vec![Block::Notice(view.verdict.0, view.verdict.1.clone()), Block::Table(limits)];
    // Without it, the table's figures would seem to contradict the cards and the curves.
    verdict.extend(view.judged_on.map(|said| Block::Prose(said.to_owned())));
    verdict.extend(view.certificate.map(|said| Block::Prose(said.to_owned())));
    let mut sections = vec![Section { heading: "Verdict".into(), blocks: verdict }];
    sections.extend(view.plant.iter().cloned());
    sections.push(loop_section(view)?);
    if let Some(profile) = &view.spec.profile {
        sections.push(pes_section(view, profile)?);
    }
    sections.extend(view.gains.iter().cloned());
    Ok(Page {
        title: format!("Servo tuning report: {}", view.name),
        subtitle: "Margins of the open loop, simulated PES, gain table".into(),
        cards: cards(view),
        sections,
        provenance: view.provenance.clone(),
    })
}

fn cards(view: &SlotView<'_>) -> Vec<Card> {
    let m = &view.after.margins;
    let short = NumberFormat::Significant(3);
    let judged = |good: bool| Some(if good { Verdict::Ok } else { Verdict::Fail });
    let wanted = &view.spec.margins;
    let card = |label: &str, value: Option<f64>, unit: &str, note: String, verdict| Card {
        label: label.into(),
        value: value.map_or_else(|| super::number::MISSING.to_owned(), |v| short.page(v)),
        unit: unit.into(),
        note,
        verdict,
    };
    let at_least = |found: Option<f64>, limit: Option<f64>| match (found, limit) {
        (Some(f), Some(l)) => (format!("at least {l}"), judged(f >= l)),
        _ => (String::new(), None),
    };
    let at_most = |found: Option<f64>, limit: Option<f64>| match (found, limit) {
        (Some(f), Some(l)) => (format!("at most {l}"), judged(f <= l)),
        _ => (String::new(), None),
    };
    let figures = view.after.write.as_ref().map(|(_, f)| f);
    let low = figures.and_then(|f| f.dft_low);
    let high = figures.and_then(|f| f.dft_high);
    let (pm_note, pm) = at_least(m.phase_margin_deg, wanted.phase_margin_deg);
    let (gm_note, gm) = at_least(m.gain_margin_db, wanted.gain_margin_db);
    let (ms_note, ms) = at_most(Some(m.max_sensitivity), wanted.max_sensitivity);
    let (low_note, low_verdict) = at_most(low, view.spec.limits.dft_low);
    let (high_note, high_verdict) = at_most(high, view.spec.limits.dft_high);
    vec![
        card("Phase margin", m.phase_margin_deg, "deg", pm_note, pm),
        card("Gain margin", m.gain_margin_db, "dB", gm_note, gm),
        card("Sensitivity peak Ms", Some(m.max_sensitivity), "", ms_note, ms),
        card("DFT 600-1500 Hz", low, view.units.position, low_note, low_verdict),
        card("DFT 1500-3000 Hz", high, view.units.position, high_note, high_verdict),
    ]
}

fn loop_section(view: &SlotView<'_>) -> Result<Section, ReportError> {
    let after = view.after;
    let curve = |v: &'_ LoopView| (v.name.clone(), v.hz.clone(), v.open_loop.clone());
    let all: Vec<_> = std::iter::once(after).chain(view.before).map(curve).collect();
    let curves: Vec<BodeCurve> =
        all.iter().map(|(name, hz, l)| BodeCurve { name, frequency_hz: hz, response: l, relative_std: None }).collect();
    let m = &after.margins;
    let marks = BodeMarks {
        trusted_hz: None,
        phase_margin: m.gain_crossover_hz.zip(m.phase_margin_deg),
        gain_margin: m.phase_crossover_hz.zip(m.gain_margin_db),
    };
    let open = bode("Open loop", "The marked margins are those after tuning.", &curves, &marks)?;
    let limit = view.spec.margins.max_sensitivity;
    let disk_margin = (m.disk_margin > 0.0 && m.disk_margin < 2.0).then_some(m.disk_margin);
    let nyquist_marks = NyquistMarks { max_sensitivity_limit: limit, disk_margin, points: vec![] };
    let one = Complex::new(1.0, 0.0);
    let s: Vec<_> = after.open_loop.iter().map(|l| one / (one + l)).collect();
    let t: Vec<_> = after.open_loop.iter().map(|l| l / (one + l)).collect();
    let mut blocks = vec![
        Block::Figure(open),
        Block::Pair(
            nyquist("Nyquist curve", "", &after.hz, &after.open_loop, &nyquist_marks)?,
            sensitivity("Sensitivity functions", "", &after.hz, &s, &t, limit)?,
        ),
        Block::Table(margins_table(m)?),
        Block::Details("All crossings".into(), vec![Block::Table(super::margins::crossings_table(m)?)]),
    ];
    if let Some(before) = view.before {
        let table = Block::Table(margins_table(&before.margins)?);
        blocks.push(Block::Details("Margins before tuning".into(), vec![table]));
    }
    Ok(Section { heading: "Loop".into(), blocks })
}

/// The window of the DFT in seconds, in words.
pub(crate) fn window_words(p: &Profile) -> (f64, f64, String) {
    let at = |n: usize| (p.first_servo_sample() + n) as f64 / p.pes.sample_rate_hz;
    let [first, last] = p.pes.window;
    (at(first), at(last), format!("DFT window, servo samples {first} to {last}"))
}

fn pes_section(view: &SlotView<'_>, profile: &Profile) -> Result<Section, ReportError> {
    let heading = "PES of a spiral write".to_owned();
    let Some((write, figures)) = &view.after.write else {
        let notice = Block::Notice(Verdict::Fail, "The closed loop is unstable: there is no PES to show.".into());
        return Ok(Section { heading, blocks: vec![notice] });
    };
    let before = view.before.and_then(|b| b.write.as_ref());
    let hz: Vec<f64> = figures.harmonics.iter().map(|h| h.hz).collect();
    let amplitudes = |f: &PesFigures| f.harmonics.iter().map(|h| h.amplitude).collect::<Vec<f64>>();
    let (after_bars, before_bars) = (amplitudes(figures), before.map(|(_, f)| amplitudes(f)));
    let at = |k: usize| k as f64 * profile.pes.sample_rate_hz / (2 * hz.len()) as f64;
    let limits: Vec<(f64, f64)> =
        view.spec.limits.harmonics.iter().map(|h| (hz.get(h.k - 1).copied().unwrap_or(at(h.k)), h.amplitude)).collect();
    let bars = SpectrumBars {
        names: ["before", "after"],
        frequency_hz: &hz,
        before: before_bars.as_deref(),
        after: &after_bars,
        limits: &limits,
        unit: view.units.position,
        until_hz: 3300.0,
    };
    let spectrum = spectrum_bars("DFT of the window", "Amplitude |X_k|/N of each harmonic.", &bars)?;
    let mut blocks =
        vec![Block::Figure(record_figure(view, profile, write, before.map(|(w, _)| w))?), Block::Figure(spectrum)];
    blocks.push(Block::Table(super::pes::pes_table(figures, view.units.position)?));
    let harmonics = super::pes::harmonics_table(figures, 24, view.units.position)?;
    blocks.push(Block::Details("Harmonics".into(), vec![Block::Table(harmonics)]));
    Ok(Section { heading, blocks })
}

fn record_figure(
    view: &SlotView<'_>,
    profile: &Profile,
    after: &ClosedLoop,
    before: Option<&ClosedLoop>,
) -> Result<Figure, ReportError> {
    let rate = profile.pes.sample_rate_hz;
    let servo: Vec<f64> = (0..after.pes.len()).map(|j| j as f64 / rate).collect();
    let tick: Vec<f64> = (0..after.command.len()).map(|k| k as f64 * after.sample_time_s).collect();
    let held = CurveKind::Held;
    let mut pes = vec![];
    let mut command = vec![];
    if let Some(b) = before {
        pes.push(TimeCurve { name: "before", time_s: &servo, value: &b.pes, ink: Ink::Muted, kind: CurveKind::Line });
        command.push(TimeCurve { name: "before", time_s: &tick, value: &b.command, ink: Ink::Muted, kind: held });
    }
    pes.push(TimeCurve { name: "after", time_s: &servo, value: &after.pes, ink: Ink::Data(0), kind: CurveKind::Line });
    command.push(TimeCurve { name: "after", time_s: &tick, value: &after.command, ink: Ink::Data(0), kind: held });
    let limit = view.spec.limits.command_peak.map(|l| [(l, "limit"), (-l, "limit")]);
    let none: [(f64, &str); 0] = [];
    let panels = [
        TimePanel { quantity: "PES", unit: view.units.position, curves: &pes, limits: &none },
        TimePanel {
            quantity: "Command",
            unit: view.units.command,
            curves: &command,
            limits: limit.as_ref().map_or(&none[..], |l| &l[..]),
        },
    ];
    let (from, to, words) = window_words(profile);
    time("Record of the write", "Simulated.", &panels, Some((from, to, &words)))
}
