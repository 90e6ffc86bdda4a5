//! The four machine classes under one controller: crossover, margins, PES and DFT (figures 16, 18, 20-22, Table 2).

use super::{Study, StudyError};
use nalgebra::Complex;
use servotune::feedback::{Margins, ModelLoop, OpenLoop, margins};
use servotune::lti::{DiscretePlant, FrequencyResponse};
use servotune::pes::{HIGH_BAND_HZ, LOW_BAND_HZ, PesFigures, figures, simulate};
use servotune::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};
use servotune_report::bode::{BodeCurve, BodeMarks, bode};
use servotune_report::figure::Ink;
use servotune_report::number::NumberFormat;
use servotune_report::spectrum_bars::{SpectrumBars, spectrum_bars};
use servotune_report::table::{Column, Table};
use servotune_report::time::{CurveKind, TimeCurve, TimePanel, time};
use std::f64::consts::TAU;

/// One class, judged.
struct Judged {
    class: MachineClass,
    margins: Margins,
    figures: PesFigures,
    pes: Vec<f64>,
    response: Vec<Complex<f64>>,
    open_loop: Vec<Complex<f64>>,
}

/// Makes the study; everything it needs is built in.
pub fn classes() -> Result<Study, StudyError> {
    let controller = nominal_controller()?;
    let sections = controller.sections()?;
    let hz: Vec<f64> = (0..600).map(|i| 40.0 * 125f64.powf(f64::from(i) / 599.0)).collect();
    let mut judged = Vec::new();
    for class in MachineClass::ALL {
        let plant = paper_machine(class)?;
        let profile = paper_profile(class)?;
        let sampled = DiscretePlant::of(&plant, controller.sample_time_s)?;
        let l = ModelLoop::new(&sampled, &sections)?;
        let run = simulate(&plant, &controller, &profile)?;
        judged.push(Judged {
            class,
            margins: margins(&l),
            figures: figures(&run.pes, &profile),
            pes: run.pes,
            response: hz.iter().map(|f| plant.at(f * TAU)).collect(),
            open_loop: hz.iter().map(|f| l.at(f * TAU)).collect(),
        });
    }
    let mut study = Study::default();
    study.page("classes.md", page(&judged)?);
    let healthy = &judged[0];
    let rate = paper_profile(MachineClass::Healthy)?.pes.sample_rate_hz;
    let time_s: Vec<f64> = (0..healthy.pes.len()).map(|j| j as f64 / rate).collect();
    for (other, response_figure, pes_figure) in
        [(&judged[1], "16a", "16b"), (&judged[2], "18a", "18b"), (&judged[3], "20a", "20b")]
    {
        let name = other.class.name();
        let curve = |name, response| BodeCurve { name, frequency_hz: &hz, response, relative_std: None };
        let curves = [curve(name, &other.response), curve("healthy", &healthy.response)];
        let title = format!("Figure {response_figure}: response of a machine with {name} and of a healthy one");
        study.picture(&format!("figure_{response_figure}"), &bode(&title, "", &curves, &BodeMarks::default())?);
        let line = |name, value, ink| TimeCurve { name, time_s: &time_s, value, ink, kind: CurveKind::Line };
        let curves = [line(name, &other.pes, Ink::Data(1)), line("healthy", &healthy.pes, Ink::Data(0))];
        let panel = TimePanel { quantity: "PES", unit: "track", curves: &curves, limits: &[] };
        let title = format!("Figure {pes_figure}: PES of a spiral write, {name} and healthy");
        let window = window_s()?;
        study.picture(&format!("figure_{pes_figure}"), &time(&title, "", &[panel], Some(window))?);
    }
    let curve = |j: &'_ Judged| (j.class.name(), j.open_loop.clone());
    let (tunable, base) = (curve(&judged[3]), curve(healthy));
    let curves = [
        BodeCurve { name: tunable.0, frequency_hz: &hz, response: &tunable.1, relative_std: None },
        BodeCurve { name: base.0, frequency_hz: &hz, response: &base.1, relative_std: None },
    ];
    let marks = BodeMarks {
        phase_margin: judged[3].margins.gain_crossover_hz.zip(judged[3].margins.phase_margin_deg),
        ..BodeMarks::default()
    };
    let title = "Figure 21: open loop of the tunable and of the healthy machine";
    study.picture("figure_21", &bode(title, "The marked margin is the tunable machine's.", &curves, &marks)?);
    let amplitudes = |j: &Judged| j.figures.harmonics.iter().map(|h| h.amplitude).collect::<Vec<f64>>();
    let bins: Vec<f64> = healthy.figures.harmonics.iter().map(|h| h.hz).collect();
    for other in &judged[1..] {
        let (before, after) = (amplitudes(healthy), amplitudes(other));
        let bars = SpectrumBars {
            names: ["healthy", other.class.name()],
            frequency_hz: &bins,
            before: Some(&before),
            after: &after,
            limits: &[],
            bands_hz: &[LOW_BAND_HZ, HIGH_BAND_HZ],
            unit: "track",
            until_hz: 3300.0,
        };
        let title = format!("Figure 22: DFT of the window, {} (colour) and healthy (grey)", other.class.name());
        study.picture(&format!("figure_22_{}", other.class.file_name()), &spectrum_bars(&title, "", &bars)?);
    }
    Ok(study)
}

/// The window of the DFT in seconds, in words.
fn window_s() -> Result<(f64, f64, &'static str), StudyError> {
    let p = paper_profile(MachineClass::Healthy)?;
    let at = |n: usize| (p.first_servo_sample() + n) as f64 / p.pes.sample_rate_hz;
    Ok((at(p.pes.window[0]), at(p.pes.window[1]), "DFT window, servo samples 200 to 400"))
}

fn page(judged: &[Judged]) -> Result<String, StudyError> {
    let digits = NumberFormat::Significant(4);
    let mut loops = Table::new(
        "Loop",
        vec![
            Column::words("class"),
            Column::words("stable"),
            Column::numbers("crossover", "Hz", digits),
            Column::numbers("phase margin", "deg", digits),
            Column::numbers("gain margin", "dB", digits),
            Column::numbers("Ms", "ratio", digits),
            Column::numbers("delay margin", "us", digits),
        ],
    );
    let mut window = Table::new(
        "Window of the DFT",
        vec![
            Column::words("class"),
            Column::numbers("600-1500 Hz", "track", digits),
            Column::numbers("1500-3000 Hz", "track", digits),
            Column::numbers("harmonic 1", "track", digits),
            Column::numbers("harmonic 5 (687 Hz)", "track", digits),
            Column::numbers("harmonic 8 (1099 Hz)", "track", digits),
            Column::numbers("range", "track", digits),
            Column::numbers("deviation", "track", digits),
        ],
    );
    for j in judged {
        let (m, f) = (&j.margins, &j.figures);
        loops.push(vec![
            j.class.name().into(),
            if m.stable { "yes" } else { "no" }.into(),
            m.gain_crossover_hz.into(),
            m.phase_margin_deg.into(),
            m.gain_margin_db.into(),
            m.max_sensitivity.into(),
            m.delay_margin_s.map(|s| s * 1e6).into(),
        ])?;
        let harmonic = |k: usize| f.harmonics[k - 1].amplitude.into();
        window.push(vec![
            j.class.name().into(),
            f.dft_low.into(),
            f.dft_high.into(),
            harmonic(1),
            harmonic(5),
            harmonic(8),
            f.pes_range.into(),
            f.pes_std.into(),
        ])?;
    }
    Ok(format!(
        "# The four machine classes under one controller\n\n\
         Made by `lab classes --out results`. Machines: `specs/machines/`; controller: `specs/controllers/nominal.toml`;\n\
         write: `specs/profiles/` (a sensor fault has three times the encoder noise). Simulated, one draw of the noise (seed 1).\n\n\
         ```text\n{}```\n\n```text\n{}```\n\n\
         What the paper says of figures 16 to 22, and what is seen here: the sensor fault raises gain and crossover and shows\n\
         more of the band around 1100 Hz; the loose pushpin has the largest amplitude near 700 Hz and the largest range; the tunable\n\
         machine crosses lower, with more phase margin, and follows more slowly. The paper prints no numbers for these figures.\n\n\
         Pictures: [16a](figures/figure_16a.svg), [16b](figures/figure_16b.svg), [18a](figures/figure_18a.svg),\n\
         [18b](figures/figure_18b.svg), [20a](figures/figure_20a.svg), [20b](figures/figure_20b.svg), [21](figures/figure_21.svg),\n\
         22 [sensor fault](figures/figure_22_sensor_fault.svg), [loose pushpin](figures/figure_22_loose_pushpin.svg),\n\
         [tunable](figures/figure_22_tunable.svg).\n",
        loops.text(),
        window.text()
    ))
}
