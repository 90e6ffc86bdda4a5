//! What the studies of measured machines share: one axis identified, a controller tuned on its response, a page.

use super::StudyError;
use nalgebra::Complex;
use servotune::controller::Controller;
use servotune::feedback::{MeasuredLoop, MeasuredMargins, measured_margins};
use servotune::frf::{Frf, Hold};
use servotune::identify::Identified;
use servotune::tune::{Machine, Outcome, Spec, TuneSettings, tune};
use servotune_report::identified::{
    identified_figure, identified_sentences, ladder_table, order_table, parameter_table,
};
use servotune_report::margins::measured_table;
use servotune_report::number::NumberFormat;
use servotune_report::page::{Block, Page, Section};
use servotune_report::table::{Column, Table, Verdict};
use servotune_report::tuned::{Units, gains_table, limits_table};

/// One measured response with its model.
pub(super) struct Axis {
    pub name: String,
    /// Whether a controller is tuned for it.
    pub diagonal: bool,
    /// A machine held by springs, whose response at rest has a sign; a free inertia starts at -180 deg.
    pub flat_at_rest: bool,
    pub frf: Frf,
    pub identified: Identified,
}

/// An axis with its controller.
pub(super) struct Tuned {
    pub name: String,
    pub frf: Frf,
    pub identified: Identified,
    /// The machine moves against its command: the controller is tuned for the turned sign.
    pub turned: bool,
    pub outcome: Outcome,
    pub margins: MeasuredMargins,
}

/// Tunes straight on the response, whose command was held at the controller's rate.
pub(super) fn tune_axis(axis: &Axis, spec: &str, profile: &str, sample_time_s: f64) -> Result<Tuned, StudyError> {
    let spec = Spec::parse(spec, profile)?;
    // Gains are positive: a machine that moves against its command has its sign turned first.
    let turned = axis.flat_at_rest && axis.frf.value()[0].re < 0.0;
    let frf = if turned {
        let value = axis.frf.value().iter().map(|v| -v).collect();
        Frf::new(axis.frf.w_rad_s().to_vec(), value, axis.frf.relative_std().map(<[f64]>::to_vec))?
    } else {
        axis.frf.clone()
    };
    let frf = frf.with_hold(Hold::Included { sample_time_s });
    let mut model = axis.identified.plant.clone();
    if turned {
        model.resonance_gain = -model.resonance_gain;
    }
    let machine = Machine::Response { frf: &frf, continuation: Some(&model) };
    let outcome =
        tune(&machine, &spec, None, &TuneSettings { sample_time_s: Some(sample_time_s), ..TuneSettings::default() })?;
    let sections = outcome.controller().sections()?;
    let margins = measured_margins(&MeasuredLoop::new(&frf, &sections)?)?;
    let (name, frf, identified) = (axis.name.clone(), axis.frf.clone(), axis.identified.clone());
    Ok(Tuned { name, frf, identified, turned, outcome, margins })
}

/// Quantile `q` of |residual| in per cent.
pub(super) fn percent(residual: &[Complex<f64>], q: f64) -> f64 {
    let mut sizes: Vec<f64> = residual.iter().map(|r| 100.0 * r.norm()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(((q * sizes.len() as f64).ceil() as usize).max(1) - 1).copied().unwrap_or(f64::NAN)
}

/// Margins of every tuned axis, measured, with intervals.
pub(super) fn tuned_table(tuned: &[Tuned]) -> Result<Table, StudyError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "Controllers tuned on the responses",
        vec![
            Column::words("axis"),
            Column::words("sign"),
            Column::words("verdict"),
            Column::numbers("crossover", "Hz", digits),
            Column::numbers("phase margin", "deg", digits),
            Column::numbers("95 % from", "deg", digits),
            Column::numbers("to", "deg", digits),
            Column::numbers("gain margin", "dB", digits),
            Column::numbers("Ms", "ratio", digits),
        ],
    );
    for t in tuned {
        let (m, i) = (&t.margins.margins, &t.margins.intervals);
        table.push(vec![
            t.name.as_str().into(),
            if t.turned { "turned" } else { "as measured" }.into(),
            if t.outcome.tuned().is_some() { "every limit met" } else { "infeasible" }.into(),
            m.gain_crossover_hz.into(),
            m.phase_margin_deg.into(),
            i.phase_margin_deg.map(|i| i.low).into(),
            i.phase_margin_deg.map(|i| i.high).into(),
            m.gain_margin_db.into(),
            m.max_sensitivity.into(),
        ])?;
    }
    Ok(table)
}

/// One axis as a page.
pub(super) fn axis_page(t: &Tuned) -> Result<String, StudyError> {
    let id = &t.identified;
    let units = Units { position: &id.plant.position_unit, command: &id.plant.command_unit };
    let controller: &Controller = t.outcome.controller();
    let (verdict, words) = match &t.outcome {
        Outcome::Tuned(_) | Outcome::TunedWithoutGuard(_) => {
            (Verdict::Ok, "Every limit is met on the measured response.")
        }
        Outcome::Infeasible(_) => (Verdict::Fail, "The limits are not met; the best compromise is shown."),
    };
    let after = t.outcome.after().first().map(|p| &p.judged);
    let mut plant = vec![
        Block::Prose(identified_sentences(id).join(" ")),
        Block::Figure(identified_figure(&t.frf, id, "Measured response and model")?),
        Block::Table(ladder_table(id)?),
    ];
    if !id.held_out.is_empty() {
        plant.push(Block::Details("Choice of the order".into(), vec![Block::Table(order_table(id)?)]));
    }
    plant.push(Block::Details("Parameters with 95 % intervals".into(), vec![Block::Table(parameter_table(id)?)]));
    let page = Page {
        title: format!("Measured response {}", t.name),
        subtitle: "Identified, and a controller tuned straight on the measurement".into(),
        cards: vec![],
        sections: vec![
            Section {
                heading: "Controller".into(),
                blocks: vec![
                    Block::Notice(verdict, words.into()),
                    Block::Table(limits_table(None, after, units)?),
                    Block::Table(measured_table(&t.margins)?),
                    Block::Table(gains_table(None, controller, &[])?),
                ],
            },
            Section { heading: "Plant".into(), blocks: plant },
        ],
        provenance: vec![("program".into(), format!("servotune {}", env!("CARGO_PKG_VERSION")))],
    };
    Ok(page.html())
}
