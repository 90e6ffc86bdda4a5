//! The catalogue of effects: the page is what the program prints, the keys are those that the readers take, the ranges are those of the grids.
#![allow(clippy::unwrap_used)]

use crate::physics_common::scene;
use crate::program_common::{root, servotune};
use serde_json::Value;
use servotune::lti::Body;
use servotune::physics::{
    Effect, Facts, Given, Key, LawSetting, Need, PhysicsError, Prior, Restored, Takes, curves, data_facts, library,
};
use std::collections::{BTreeMap, BTreeSet};

fn effects() -> impl Iterator<Item = &'static dyn Effect> {
    library().iter().chain(curves()).copied()
}

fn facts() -> impl Iterator<Item = &'static Facts> {
    effects().map(|e| e.facts()).chain(data_facts().iter().copied())
}

/// A number that a key takes. A limit stands above a lowest reading, a mode is one of the plant, a delay is within some samples.
fn good(key: &Key) -> f64 {
    match key.name {
        "mode" => 0.0,
        "delay_s" => 5e-5,
        "highest_reading" => 0.7,
        _ => 0.3,
    }
}

/// What an entry with `head` must give: found key by key in the order of the catalogue.
fn least(f: &Facts, head: &Key) -> BTreeMap<String, f64> {
    let mut given: BTreeMap<String, f64> = [(head.name.to_owned(), good(head))].into();
    if let Some(other) = head.beside {
        let other = f.keys.iter().find(|k| k.name == other).unwrap();
        given.insert(other.name.to_owned(), good(other));
    }
    for k in f.keys {
        if needed(k, &given) {
            given.insert(k.name.to_owned(), good(k));
        }
    }
    given
}

fn needed(key: &Key, given: &BTreeMap<String, f64>) -> bool {
    let company = key.beside.is_none_or(|other| given.contains_key(other));
    company
        && match key.need {
            Need::Always => true,
            Need::Unless(others) => !others.iter().any(|o| given.contains_key(*o)),
            _ => false,
        }
}

/// What the commands say to an entry.
fn read(f: &Facts, given: &BTreeMap<String, f64>) -> Result<LawSetting, PhysicsError> {
    let mut plant = scene().plant;
    plant.physics =
        vec![servotune::lti::PhysicsEntry { effect: f.name.into(), parameters: given.clone(), curve: None }];
    Restored::of(&plant, &Default::default()).map(|mut r| r.parts.remove(0))
}

#[test]
fn the_page_is_what_the_program_prints() {
    let page = std::fs::read_to_string(root("specs/effects.md")).unwrap();
    let ran = servotune(&["diagnose", "--effects"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(page == ran.out, "write the output of `servotune diagnose --effects` to specs/effects.md");
}

#[test]
fn the_document_has_every_effect_with_its_keys() {
    let ran = servotune(&["diagnose", "--effects", "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let all: Value = serde_json::from_str(&ran.out).unwrap();
    for (f, shown) in facts().zip(all.as_array().unwrap()) {
        assert_eq!(shown["effect"], f.name);
        let keys: Vec<&str> = shown["keys"].as_array().unwrap().iter().map(|k| k["key"].as_str().unwrap()).collect();
        assert_eq!(keys, f.keys.iter().map(|k| k.name).collect::<Vec<_>>());
        // Authors or a standard, a title, a year.
        let year = f
            .source
            .split(|c: char| !c.is_ascii_digit())
            .any(|n| n.len() == 4 && (n.starts_with("19") || n.starts_with("20")));
        assert!(year && f.source.contains(", "), "{}: {}", f.name, f.source);
    }
    assert_eq!(all.as_array().unwrap().len(), facts().count());
}

/// Every key is taken in its company, each that is needed there is asked for by a refusal, and a reader knows no other.
#[test]
fn the_keys_are_those_that_the_readers_take() {
    for f in effects().map(|e| e.facts()) {
        let own: BTreeSet<&str> = f.keys.iter().map(|k| k.name).collect();
        assert_eq!(own.len(), f.keys.len(), "{}: a key stands twice", f.name);
        let mut known = BTreeSet::new();
        for head in f.keys {
            let given = least(f, head);
            let read_back = read(f, &given).unwrap_or_else(|e| panic!("{} {given:?}: {e}", f.name));
            for p in read_back.parameters(&scene()) {
                let key = f.keys.iter().find(|k| k.name == p.name).unwrap_or_else(|| panic!("{} {}", f.name, p.name));
                assert_eq!(key.unit, p.unit, "{} {}", f.name, p.name);
                known.insert(p.name);
            }
            for (name, _) in given.iter().filter(|(n, _)| f.keys.iter().any(|k| k.name == **n)) {
                let mut without = given.clone();
                without.remove(name);
                let key = f.keys.iter().find(|k| k.name == name).unwrap();
                let refused = read(f, &without).is_err();
                let company = given.keys().any(|n| f.keys.iter().any(|k| k.name == n && k.beside == Some(key.name)));
                assert_eq!(refused, needed(key, &without) || company, "{} without {name} of {given:?}", f.name);
            }
            let mut more = given.clone();
            more.insert("no_such_key".into(), 1.0);
            let said = read(f, &more).unwrap_err();
            assert!(matches!(&said, PhysicsError::Parameter { parameter, .. } if parameter == "no_such_key"), "{said}");
        }
        assert_eq!(known, own, "{}", f.name);
    }
}

#[test]
fn values_beyond_what_a_key_takes_are_refused_by_its_name() {
    let mut seen = 0;
    for f in effects().map(|e| e.facts()) {
        for key in f.keys {
            let beyond = match key.takes {
                Takes::Any => vec![],
                Takes::Positive => vec![0.0, -1.0],
                Takes::Between(low, high, _) => vec![low, high, low - 1.0, high + 1.0],
                Takes::Law(_) => vec![-1.0],
            };
            for value in beyond.into_iter().chain([f64::NAN, f64::INFINITY]) {
                let mut given = least(f, key);
                given.insert(key.name.to_owned(), value);
                let said = read(f, &given).err().unwrap_or_else(|| panic!("{} takes {} = {value}", f.name, key.name));
                let named = match &said {
                    PhysicsError::Range { parameter, expected, .. } => {
                        *parameter == key.name && *expected == key.takes.text()
                    }
                    PhysicsError::Finite { parameter, .. } => parameter == key.name && !value.is_finite(),
                    _ => false,
                };
                assert!(named, "{} {} = {value}: {said}", f.name, key.name);
                seen += 1;
            }
        }
    }
    assert!(seen > 200, "{seen}");
}

#[test]
fn a_key_left_out_is_its_default() {
    let scene = scene();
    for e in effects() {
        for key in e.facts().keys {
            let Need::Or(default) = key.need else { continue };
            let mut with = least(e.facts(), key);
            let mut without = with.clone();
            with.insert(key.name.to_owned(), default);
            without.remove(key.name);
            let [with, without] =
                [with, without].map(|g| e.setting_of(&Given::new(e.facts().name, &g), &scene).unwrap());
            assert_eq!(with, without, "{} {}", e.facts().name, key.name);
        }
    }
}

/// A scan lies within its range and comes within a fifth of both ends: steps end up to one short of it.
#[test]
fn the_ranges_are_those_of_the_grids() {
    let (bound, free) = (scene(), {
        let mut s = scene();
        s.plant.body = Body::FreeInertia { acceleration_gain: 1e7, viscous_rate_per_s: 2.0 };
        s
    });
    for e in library() {
        let mut found: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for scene in [&bound, &free] {
            for law in e.grid(scene) {
                let strengths = vec![1.0; e.facts().columns];
                for p in LawSetting::new(law, strengths).parameters(scene) {
                    found.entry(p.name).or_default().push(p.value.abs());
                }
            }
        }
        for key in e.facts().keys {
            let values = found.get(key.name).cloned().unwrap_or_default();
            let at = format!("{} {}", e.facts().name, key.name);
            match key.prior {
                Prior::Points(points) => {
                    let tried: BTreeSet<u64> = values.iter().map(|v| v.to_bits()).collect();
                    assert_eq!(tried, points.iter().map(|v| v.to_bits()).collect(), "{at}: {values:?}");
                }
                Prior::Scan(from, to) => {
                    let (from, to) = (from.of(&bound), to.of(&bound));
                    let scanned = || values.iter().copied().filter(|v| *v > 0.0);
                    let (low, high) = (scanned().fold(f64::INFINITY, f64::min), scanned().fold(0.0, f64::max));
                    assert!(low > from * (1.0 - 1e-9) && high < to * (1.0 + 1e-9), "{at}: {low} {high}, {from} {to}");
                    assert!(low < 1.2 * from && high > to / 1.2, "{at}: {low} {high}, {from} {to}");
                }
                _ => {}
            }
        }
    }
}
