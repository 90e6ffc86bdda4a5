//! Tuning over a model: limits met by the exact judgement, verdicts, bounds, determinism.
#![allow(clippy::unwrap_used)]

mod tune_common;
use servotune::tune::{Machine, Outcome, TuneSettings, judge, tune};
use tune_common::{paper_plant, paper_spec, start_controller};

#[test]
fn a_feasible_spec_is_met_by_exact_margins_and_lowers_the_dft() {
    let (plant, spec) = (paper_plant(), paper_spec());
    let machine = Machine::Model(&plant);
    let start = start_controller();
    let t0 = std::time::Instant::now();
    let outcome = tune(&machine, &spec, Some(&start), &TuneSettings::default()).unwrap();
    eprintln!("{:?}", t0.elapsed());
    match &outcome {
        Outcome::Tuned(t) => eprintln!(
            "{:#?}\n{:?}\nbefore {:?}\nafter {:?}\n{:?}",
            t.controller,
            t.at_bounds,
            t.before.as_ref().map(|b| &b[0].judged.found),
            t.after[0].judged.found,
            t.work
        ),
        Outcome::Infeasible(i) => eprintln!("{:#?}", i),
    }
    let Outcome::Tuned(tuned) = outcome else { panic!("feasible") };
    let proof = judge(&machine, &tuned.controller, &spec).unwrap();
    assert!(proof.judged.passes());
}
