//! Front, budget, prediction and next sweep: what must hold whatever the numbers are.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use servotune::feedback::{PlanSettings, sweep_plan};
use servotune::numeric::random::Random;
use servotune::pes::{PesSource, PredictSettings, Runout, budget, figures, predict, simulate};
use servotune::tune::{Machine, ParetoSettings, Spec, TuneError, TuneSettings, pareto};
use servotune::twin::plants::{log_grid, measure};
use servotune::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};

#[test]
fn along_the_front_more_margin_never_costs_nothing() {
    let plant = paper_machine(MachineClass::Tunable).unwrap();
    let text = include_str!("../specs/limits/paper.toml");
    let mut spec = Spec::parse(text, include_str!("../specs/profiles/spiral.toml")).unwrap();
    spec.margins.phase_margin_deg = None;
    let start = nominal_controller().unwrap();
    let settings = TuneSettings { starts: 4, ..TuneSettings::default() };
    let front = ParetoSettings { max_sensitivity: [1.4, 2.4], points: 5 };
    let points = pareto(&[Machine::Model(&plant)], &spec, Some(&start), &settings, &front, &|_, _| {}).unwrap();
    assert_eq!(points.len(), 5);
    let on: Vec<_> = points.iter().filter(|p| p.on_front).collect();
    assert!(!on.is_empty(), "{points:?}");
    for pair in on.windows(2) {
        assert!(pair[0].max_sensitivity < pair[1].max_sensitivity && pair[0].objective > pair[1].objective);
    }
    for p in points.iter().filter(|p| p.feasible) {
        assert!(p.max_sensitivity <= p.allowed * (1.0 + servotune::tune::MET));
    }
    let wrong = ParetoSettings { max_sensitivity: [1.0, 2.0], points: 3 };
    let e = pareto(&[Machine::Model(&plant)], &spec, None, &settings, &wrong, &|_, _| {}).unwrap_err();
    assert!(matches!(e, TuneError::Setting { key: "max_sensitivity from", found, .. } if found == 1.0), "{e}");
}

#[test]
fn the_sources_add_up_to_what_records_show() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let c = nominal_controller().unwrap();
    let mut profile = paper_profile(MachineClass::Healthy).unwrap();
    profile.noise.runout = vec![Runout { order: 9, amplitude: 1e-3, phase_deg: 20.0 }];
    let b = budget(&plant, &c, &profile).unwrap();
    assert_eq!(b.sources.len(), 4);
    for i in 0..3 {
        let sum: f64 = b.sources.iter().map(|s| s.share[i]).sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }
    // Run-out of 1e-3 at 1080 Hz is 0.5e-3 by |X|/N, spread over the neighbours: nothing of it is lost in the window's deviation.
    let runout = b.sources.iter().find(|s| s.source == PesSource::Runout).unwrap();
    assert!((runout.pes_std - 1e-3 / 2f64.sqrt()).abs() < 0.03e-3, "{runout:?}");
    // Without cross terms of move and run-out the energies add; 100 draws leave a tenth.
    let encoder = b.sources.iter().find(|s| s.source == PesSource::Encoder).unwrap();
    assert!(encoder.dft_low < b.dft_low * 1.1);
}

#[test]
fn ranges_hold_their_share_of_records_under_the_same_model() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let c = nominal_controller().unwrap();
    let mut profile = paper_profile(MachineClass::Healthy).unwrap();
    let p = predict(&plant, &c, &profile, &PredictSettings::default()).unwrap();
    let records = 300;
    let mut inside = 0;
    for seed in 0..records {
        profile.noise.seed = 90_000 + seed;
        let f = figures(&simulate(&plant, &c, &profile).unwrap().pes, &profile);
        inside += u32::from((p.dft_low.low..=p.dft_low.high).contains(&f.dft_low.unwrap()));
    }
    let share = f64::from(inside) / records as f64;
    // Binomial: 0.9 of 300 scatters by 0.017, the range of 400 draws by as much; three of both.
    assert!((share - 0.9).abs() < 0.075, "{share}");
}

#[test]
fn tones_lie_where_margins_are_read_and_narrow_them() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let sections = nominal_controller().unwrap().sections().unwrap();
    let frf = measure(&plant, &log_grid(40.0, 5000.0, 120), 0.03, &mut Random::new(3)).unwrap();
    let settings = PlanSettings { tones: 3, ..PlanSettings::default() };
    let plan = sweep_plan(&frf, &sections, &settings).unwrap();
    assert!(!plan.tones.is_empty() && plan.tones.len() <= 3);
    let mut last = 1.0;
    for t in &plan.tones {
        assert!(t.width_left < last, "{plan:?}");
        last = t.width_left;
        assert!(t.amplitude <= settings.command_limit && t.hz > 40.0 && t.hz < 5000.0);
        // Four times the amplitude leaves a quarter of the deviation.
        assert!(t.relative_std > 0.0);
    }
    assert!(plan.seconds < plan.full_seconds);
}
