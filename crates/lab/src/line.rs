//! The production line in features: class counts, the paper's ten features by class, figures 24 to 34.
//!
//! In: the seed of the line. Out: `gate_line.md` and a histogram and boxes of each of the ten features and of the evidence.

use super::{Study, StudyError};
use servotune::gate::features::{FeatureTable, RawMachine, features};
use servotune::twin::MachineClass;
use servotune::twin::line::{LineSettings, line};
use servotune_report::boxplot::{boxplot, summary};
use servotune_report::histogram::{Group, histogram};
use servotune_report::number::NumberFormat;
use servotune_report::table::{Column, Table};

/// The ten features of figure 24 with their figures (the captions name Harmonic 24 where the text names Harmonic 15), and units.
const FEATURES: [(&str, &str, &str); 11] = [
    ("DFT_Euclidean_Low", "25", "track"),
    ("DFT_Euclidean_High", "26", "track"),
    ("Harmonic_3", "27", "track"),
    ("PES_Range", "28", "track"),
    ("FF_Factor", "29", ""),
    ("PES_STD", "30", "track"),
    ("Harmonic_15", "31_text", "track"),
    ("Harmonic_24", "31_caption", "track"),
    ("Harmonic_1", "32", "track"),
    ("Harmonic_6", "33", "track"),
    ("Harmonic_8", "34", "track"),
];
/// What the swept sine itself says.
const EVIDENCE: [(&str, &str); 3] =
    [("plant_dc_gain_db", "dB"), ("plant_first_resonance_hz", "Hz"), ("plant_crossover_hz", "Hz")];
/// Bins of a histogram.
const BINS: usize = 30;

/// Makes the study of seed 1.
pub fn line_study() -> Result<Study, StudyError> {
    let settings = LineSettings::default();
    let machines: Vec<RawMachine> = line(&settings)?.into_iter().map(|m| m.record).collect();
    let table = features(&machines);
    let mut study = Study::default();
    study.page("gate_line.md", page(&table, &settings)?);
    for (name, figure, unit) in FEATURES {
        let groups = by_class(&table, name);
        let groups = named(&groups);
        let title = format!("Figure {}: {name} by class", figure.replace('_', ", "));
        let caption = "Made-up line, 486 machines.";
        study.picture(&format!("figure_{figure}a"), &histogram(&title, caption, (name, unit), &groups, BINS)?);
        study.picture(&format!("figure_{figure}b"), &boxplot(&title, caption, (name, unit), &groups)?);
    }
    for (name, unit) in EVIDENCE {
        let groups = by_class(&table, name);
        let title = format!("{name} by class");
        study
            .picture(&format!("gate_{name}"), &boxplot(&title, "From the swept sine.", (name, unit), &named(&groups))?);
    }
    Ok(study)
}

/// The numbers of a feature, class by class.
fn by_class(table: &FeatureTable, name: &str) -> Vec<Vec<f64>> {
    let column = table.column(name).unwrap_or_default();
    let labels = table.labels.as_deref().unwrap_or_default();
    let of = |class: MachineClass| {
        let label = (class as usize).to_string();
        column.iter().zip(labels).filter(|(_, l)| l.as_deref() == Some(label.as_str())).map(|(v, _)| *v).collect()
    };
    MachineClass::ALL.into_iter().map(of).collect()
}

fn named(groups: &[Vec<f64>]) -> Vec<Group<'_>> {
    MachineClass::ALL.into_iter().zip(groups).map(|(c, values)| Group { name: c.name(), values }).collect()
}

fn page(table: &FeatureTable, settings: &LineSettings) -> Result<String, StudyError> {
    let digits = NumberFormat::Significant(4);
    let mut columns = vec![Column::words("feature"), Column::words("unit")];
    for class in MachineClass::ALL {
        columns.push(Column::numbers(&format!("{} quartile 1", class.name()), "", digits));
        columns.push(Column::numbers("median", "", digits));
        columns.push(Column::numbers("quartile 3", "", digits));
    }
    let mut found = Table::new("Quartiles by class", columns);
    let rows = FEATURES.iter().map(|(n, _, u)| (*n, *u)).chain(EVIDENCE);
    for (name, unit) in rows {
        let mut row = vec![name.into(), unit.into()];
        for group in by_class(table, name) {
            let s = summary(&group);
            let of = |f: fn(&servotune_report::boxplot::BoxSummary) -> f64| s.as_ref().map(f);
            row.extend([of(|b| b.first).into(), of(|b| b.median).into(), of(|b| b.third).into()]);
        }
        found.push(row)?;
    }
    let missing = table.rows.iter().flatten().filter(|v| v.is_nan()).count();
    let [a, b, c, d] = settings.counts;
    let pictures: String = FEATURES
        .iter()
        .map(|(n, f, _)| format!("{n} [histogram](figures/figure_{f}a.svg), [boxes](figures/figure_{f}b.svg);\n"))
        .chain(EVIDENCE.map(|(n, _)| format!("{n} [boxes](figures/gate_{n}.svg);\n")))
        .collect();
    Ok(format!(
        "# The production line in features\n\n\
         Made by `lab line --out results`. Simulated machines (`specs/gate_twin.md`), seed {}.\n\n\
         Classes: {a} healthy, {b} sensor fault, {c} loose pushpin, {d} tunable; {} in all, as in section 2.9. {} features each, logs\n\
         included; {missing} of {} fields empty.\n\n```text\n{}```\n\n\
         The text of section 2.9 names Harmonic 15 where the caption of figure 31 names Harmonic 24; both are shown.\n\n\
         Where the twin differs from the paper: section 2.9 finds the lowest FF_Factor on loose pushpins; here sensor faults have it, because their\n\
         acceleration gain is up by half (eq. (33)) while a loose pushpin keeps torque and inertia.\n\n{pictures}",
        settings.seed,
        table.ids.len(),
        table.names.len(),
        table.ids.len() * table.names.len(),
        found.text(),
    ))
}
