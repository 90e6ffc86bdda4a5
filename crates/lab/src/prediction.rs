//! Prediction of the DFT under controllers never run: identified plants, held-out controllers, records of the true machine.

use super::{Study, StudyError};
use rayon::prelude::*;
use servotune::controller::Controller;
use servotune::feedback::{ModelLoop, margins};
use servotune::identify::{IdentifySettings, OrderChoice, identify};
use servotune::lti::{Body, DiscretePlant, Plant};
use servotune::numeric::random::Random;
use servotune::pes::{PredictSettings, figures, predict_each, simulate};
use servotune::twin::plants::{log_grid, measure};
use servotune::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};
use servotune_report::number::NumberFormat;
use servotune_report::table::{Column, Table};

/// Machines; the first half sets the model error, the second half is judged.
const MACHINES: u64 = 40;
/// Controllers never run, for each machine.
const CONTROLLERS: usize = 8;
/// Sweep: points and relative deviation of each.
const POINTS: usize = 300;
const DEVIATION: f64 = 0.01;
/// Model errors tried.
const ERRORS: [f64; 8] = [0.0, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15];

/// One figure of one record, for every model error tried.
struct Judged {
    machine: u64,
    /// 20 log10 of predicted median over what the record shows.
    error_db: f64,
    inside: [bool; ERRORS.len()],
}

/// Makes the study; everything is built in.
pub fn prediction() -> Result<Study, StudyError> {
    let all: Vec<Vec<Judged>> = (0..MACHINES).into_par_iter().map(machine).collect::<Result<_, StudyError>>()?;
    let all: Vec<Judged> = all.into_iter().flatten().collect();
    let half = MACHINES / 2;
    let share = |first: bool, e: usize| {
        let chosen: Vec<&Judged> = all.iter().filter(|j| (j.machine < half) == first).collect();
        chosen.iter().filter(|j| j.inside[e]).count() as f64 / chosen.len().max(1) as f64
    };
    // The smallest model error that covers nine tenths of the first half.
    let chosen = (0..ERRORS.len()).find(|e| share(true, *e) >= 0.9).unwrap_or(ERRORS.len() - 1);
    let median = |first: bool| {
        let mut db: Vec<f64> = all.iter().filter(|j| (j.machine < half) == first).map(|j| j.error_db.abs()).collect();
        db.sort_by(f64::total_cmp);
        db.get(db.len() / 2).copied()
    };
    let mut table = Table::new(
        "Figures of single records against their prediction",
        vec![
            Column::words("machines"),
            Column::numbers("figures", "", NumberFormat::Decimals(0)),
            Column::numbers("median |error|", "dB", NumberFormat::Significant(3)),
            Column::numbers("inside the 90 % interval", "%", NumberFormat::Decimals(1)),
            Column::numbers("with no model error", "%", NumberFormat::Decimals(1)),
        ],
    );
    for (name, first) in [("first half: sets the model error", true), ("second half: judged", false)] {
        let count = all.iter().filter(|j| (j.machine < half) == first).count();
        table.push(vec![
            name.into(),
            (count as f64).into(),
            median(first).into(),
            (100.0 * share(first, chosen)).into(),
            (100.0 * share(first, 0)).into(),
        ])?;
    }
    let mut study = Study::default();
    study.page(
        "prediction.md",
        format!(
            "# The DFT under gains never run\n\n\
             Made by `lab prediction --out results`. {MACHINES} machines, a quarter of each class of `specs/machines/`, every number of the plant moved by up to 5 %. \
             Each is swept ({POINTS} points, 40 to 5000 Hz, {:.0} % deviation) and identified. {CONTROLLERS} controllers a machine, gains 0.6 to 1.5 times the nominal ones, are then predicted with the \
             identified plant and run once on the true one, with a draw of the noise that no prediction used; loops with Ms above 3 are left out. The error is that of one record's norm, in both bands, \
             against the predicted median.\n\n\
             ```text\n{}```\n\n\
             Model error chosen on the first half: {}. The noise levels of the profile are taken as known; on a real machine they come from a record under the present gains.\n",
            100.0 * DEVIATION,
            table.text(),
            ERRORS[chosen]
        ),
    );
    Ok(study)
}

/// A machine of its class, every number a little off.
fn moved(class: MachineClass, random: &mut Random) -> Result<Plant, StudyError> {
    let mut plant = paper_machine(class)?;
    let mut by = |x: &mut f64| *x *= random.between(0.95, 1.05);
    match &mut plant.body {
        Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } => {
            by(dc_gain);
            by(natural_frequency_rad_s);
            by(damping_ratio);
        }
        Body::FreeInertia { acceleration_gain, .. } => by(acceleration_gain),
        Body::Rational(r) => by(&mut r.gain),
    }
    by(&mut plant.delay_s);
    for m in &mut plant.modes {
        // Both frequencies together: the distance of zero and pole is what makes the mode.
        let mut both = 1.0;
        by(&mut both);
        m.zero_rad_s *= both;
        m.pole_rad_s *= both;
    }
    Ok(plant)
}

fn machine(i: u64) -> Result<Vec<Judged>, StudyError> {
    let mut random = Random::stream(i, 31);
    let class = MachineClass::ALL[(i % 4) as usize];
    let truth = moved(class, &mut random)?;
    let sweep = measure(&truth, &log_grid(40.0, 5000.0, POINTS), DEVIATION, &mut random)?;
    let settings = IdentifySettings { order: OrderChoice::Fixed(10), ..IdentifySettings::default() };
    let model = identify(&sweep, &settings)?.plant;
    let mut judged = Vec::new();
    let mut run = 0;
    while judged.len() < 2 * CONTROLLERS && run < 20 * CONTROLLERS as u64 {
        run += 1;
        let c = controller(&mut random)?;
        let sections = c.sections()?;
        let sampled = DiscretePlant::of(&model, c.sample_time_s)?;
        let m = margins(&ModelLoop::new(&sampled, &sections)?);
        let really = margins(&ModelLoop::new(&DiscretePlant::of(&truth, c.sample_time_s)?, &sections)?);
        if !m.stable || m.max_sensitivity > 3.0 || !really.stable {
            continue;
        }
        let mut profile = paper_profile(class)?;
        let runs = predict_each(&model, &c, &profile, &PredictSettings::default(), ERRORS)?;
        profile.noise.seed = 1_000_000 + 1000 * i + run;
        let record = figures(&simulate(&truth, &c, &profile)?.pes, &profile);
        for (band, seen) in
            [(0, record.dft_low), (1, record.dft_high)].into_iter().filter_map(|(b, x)| x.map(|x| (b, x)))
        {
            let mut inside = [false; ERRORS.len()];
            let mut error_db = 0.0;
            for (k, p) in runs.iter().enumerate() {
                let r = if band == 0 { p.dft_low } else { p.dft_high };
                inside[k] = (r.low..=r.high).contains(&seen);
                if k == 0 {
                    error_db = 20.0 * (r.median / seen).log10();
                }
            }
            judged.push(Judged { machine: i, error_db, inside });
        }
    }
    Ok(judged)
}

/// Gains near the nominal ones, as an engineer might try next.
fn controller(random: &mut Random) -> Result<Controller, StudyError> {
    let mut c = nominal_controller()?;
    let mut by = |x: &mut f64| *x *= 0.6 * 2.5f64.powf(random.uniform());
    by(&mut c.pid.kp);
    by(&mut c.pid.ki_per_s);
    by(&mut c.pid.kd_s);
    Ok(c)
}
