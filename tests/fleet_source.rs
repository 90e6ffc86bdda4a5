//! What a fleet is read from: FLEET.toml, a tree of folders, a table; and what its cases are.
#![allow(clippy::unwrap_used)]

use servotune::frf::Frf;
use servotune::lti::{Body, FrequencyResponse, Plant};
use servotune::tune::Machine;
use servotune::twin::fleet::FleetSettings;
use servotune::twin::{MachineClass, paper_machine};
use servotune_fleet::{Evidence, FileSource, Fleet, FleetError, Input, SlotSource, Temperature};
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fleet_source").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn refused(text: &str) -> FleetError {
    Fleet::parse(Path::new("floor/FLEET.toml"), text).unwrap_err()
}

#[test]
fn a_document_that_is_none_is_refused_by_its_key() {
    let head = "spec = \"s.toml\"\ncontroller = \"c.toml\"\n";
    let good = Fleet::parse(Path::new("floor/FLEET.toml"), &format!("{head}[input]\ntree = \"testers\"\n")).unwrap();
    assert_eq!(good.file.input.tree.as_deref(), Some(Path::new("floor/testers")));
    assert_eq!(good.file.spec, Path::new("floor/s.toml"));
    let two = refused(&format!("{head}[input]\ntree = \"a\"\ntable = \"b\"\n"));
    assert!(matches!(two, FleetError::Inputs { found: 2, .. }));
    let guard = refused(&format!("{head}[input]\ntree = \"a\"\n[robust]\nguard = 0.5\n"));
    assert!(matches!(guard, FleetError::Range { key: "robust.guard", found, .. } if found == 0.5));
    let unknown = refused(&format!("{head}[input]\ntree = \"a\"\nfolder = \"b\"\n")).to_string();
    assert!(unknown.starts_with("floor/FLEET.toml:5:1:") && unknown.contains("folder"), "{unknown}");
}

#[test]
fn a_tree_and_a_table_give_the_same_slots() {
    let place = folder("tree");
    let floor = FleetSettings { testers: 1, slots: 2, ..FleetSettings::default() };
    let mut table = "tester,slot,response,pes,log,controller,temperature_c\n".to_owned();
    for i in 0..floor.count() {
        let slot = floor.slot(i).unwrap();
        let own = format!("testers/T{:03}/slots/S{:02}", slot.tester, slot.slot);
        for (name, text) in slot.files().unwrap().files {
            let file = place.join(&own).join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        }
        table +=
            &format!("T001,S{:02},{own}/response.bod,{own}/pes.csv,{own}/log.toml,{own}/controller.toml,\n", i + 1);
    }
    let file = place.join("slots.csv");
    std::fs::write(&file, &table).unwrap();
    let tree = FileSource::tree(&place.join("testers")).unwrap();
    let of = |table: &Path| FileSource::of(Path::new("f"), &Input { table: Some(table.into()), ..Input::default() });
    let rows = of(&file).unwrap();
    assert_eq!((tree.count(), rows.count()), (2, 2));
    for i in 0..2 {
        let (a, b) = (tree.load(i), rows.load(i));
        assert_eq!(
            (a.machine, a.controller, a.temperature_c, a.digest),
            (b.machine, b.controller, b.temperature_c, b.digest)
        );
        assert!(a.problems.is_empty() && a.temperature_c.is_some());
    }
    // A slot that stands twice, a column that is not there, a file that is not there.
    std::fs::write(&file, format!("{table}T001,S01,a,b,,,\n")).unwrap();
    assert!(matches!(of(&file), Err(FleetError::TwiceSlot { line: 4, first: 2, slot, .. }) if slot == "T001/S01"));
    std::fs::write(&file, "tester,slot,response\nT001,S01,a\n").unwrap();
    assert!(matches!(of(&file), Err(FleetError::Column { column: "pes", .. })));
    std::fs::write(&file, "tester,slot,response,pes\nT001,S01,nowhere.bod,nowhere.csv\n").unwrap();
    let absent = of(&file).unwrap().load(0);
    assert!(absent.machine.response.is_none() && absent.problems.iter().any(|p| p.contains("nowhere.bod")));
    assert!(matches!(FileSource::tree(&folder("empty")), Err(FleetError::NoSlot { .. })));
}

/// The response of a plant on a grid of 200 points.
fn response(plant: &Plant) -> Frf {
    let w: Vec<f64> = (0..200).map(|i| 300.0 * 1.02f64.powi(i)).collect();
    let value = w.iter().map(|&w| plant.at(w)).collect();
    Frf::new(w, value, None).unwrap()
}

#[test]
fn a_warmer_machine_is_the_plant_with_its_gain_frequencies_and_dead_time_moved() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let temperature = Temperature {
        cases_c: vec![34.0],
        measured_c: 24.0,
        gain_per_c: -2e-3,
        frequency_per_c: -3e-4,
        delay_per_c: 1e-7,
    };
    let e = Evidence::of(&response(&plant), &plant, &[], 24.0, &temperature).unwrap();
    assert_eq!((e.count(), e.case(0), e.case(1)), (2, "as measured", "at 34 deg C"));
    let (gain, frequency) = ((-2e-3f64 * 10.0).exp(), (-3e-4f64 * 10.0).exp());
    let mut warm = plant.clone();
    let Body::SecondOrder { dc_gain, natural_frequency_rad_s, .. } = &mut warm.body else { panic!() };
    *dc_gain *= gain;
    *natural_frequency_rad_s *= frequency;
    for m in &mut warm.modes {
        m.zero_rad_s *= frequency;
        m.pole_rad_s *= frequency;
    }
    warm.delay_s += 1e-6;
    let machines = e.machines();
    let Machine::Response { frf, continuation: Some(model), .. } = machines[1] else { panic!() };
    assert_eq!(model.delay_s, warm.delay_s);
    for (&w, v) in frf.w_rad_s().iter().zip(frf.value()) {
        // A product of a dozen factors: rounding only.
        assert!((v / warm.at(w) - 1.0).norm() < 1e-12, "{w}");
    }
}

#[test]
fn a_drawn_plant_acts_as_the_ratio_to_the_identified_one() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let mut drawn = plant.clone();
    drawn.delay_s *= 1.1;
    drawn.modes[0].pole_damping_ratio *= 0.8;
    let e = Evidence::of(&response(&plant), &plant, &[drawn.clone()], 24.0, &Temperature::default());
    let e = e.unwrap();
    let machines = e.machines();
    let Machine::Response { frf, .. } = machines[1] else { panic!() };
    for (&w, v) in frf.w_rad_s().iter().zip(frf.value()) {
        assert!((v / drawn.at(w) - 1.0).norm() < 1e-12);
    }
}

#[test]
fn a_slot_of_the_made_up_floor_is_the_same_alone_and_wears_from_run_to_run() {
    let floor = FleetSettings { testers: 2, ..FleetSettings::default() };
    let later = FleetSettings { run: 20, ..floor.clone() };
    let gain = |p: &Plant| p.body.acceleration_gain().ln();
    let mut fallen = 0;
    for i in [3, 17, 31] {
        let (a, b) = (floor.slot(i).unwrap(), FleetSettings { testers: 9, ..floor.clone() }.slot(i).unwrap());
        assert_eq!(a, b);
        let worn = later.slot(i).unwrap();
        assert_eq!(worn.machine.truth.class, a.machine.truth.class);
        fallen += usize::from(gain(&worn.machine.truth.plant) < gain(&a.machine.truth.plant));
    }
    assert_eq!(fallen, 3);
}
