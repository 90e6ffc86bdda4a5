//! Curves in plant files: read and written, refused by name, simulated as an independent integrator does, with the describing functions
//! of textbooks.
#![allow(clippy::unwrap_used)]

use servotune::document::parse_toml;
use servotune::feedback::DescribedPlant;
use servotune::lti::{Body, FrequencyResponse, Plant, PlantFile};
use servotune::physics::{Context, CurvePort, Restored, SimulatedMachine, describing};
use std::f64::consts::{PI, TAU};
use std::path::Path;

const T: f64 = 1e-4;
const STEPS: usize = 32;

fn file(curve: &str) -> String {
    format!(
        "position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\ndc_gain = 60.0\nnatural_frequency_rad_s = 380.0\ndamping_ratio = 0.2\ndelay_s = 0.0\n\
         [[plant.physics]]\n{curve}"
    )
}

fn read(curve: &str) -> Result<Plant, String> {
    let file: PlantFile = parse_toml(Path::new("plant.toml"), &file(curve)).map_err(|e| e.to_string())?;
    Plant::try_from(file).map_err(|e| e.to_string())
}

fn restored(curve: &str) -> Result<Restored, String> {
    Restored::of(&read(curve)?, &Context { sample_time_s: T, ..Context::default() }).map_err(|e| e.to_string())
}

/// A curve with many knots of a function.
fn curve(port: &str, argument: &str, from: f64, to: f64, f: impl Fn(f64) -> f64) -> String {
    let knot = |k: i32| {
        let at = from + (to - from) * f64::from(k) / 160.0;
        format!("{{at = {at}, value = {}}}", f(at))
    };
    let knots: Vec<String> = (0..=160).map(knot).collect();
    format!(
        "effect = \"free_form\"\nport = \"{port}\"\nargument = \"{argument}\"\nunit = \"A\"\nknots = [{}]\n",
        knots.join(", ")
    )
}

/// A torque over position and velocity with many knots of a function.
fn surface(reach: [f64; 2], f: impl Fn(f64, f64) -> f64) -> String {
    let place = |k: i32, reach: f64| reach * (f64::from(k) / 40.0 - 1.0);
    let knot = |i: i32, j: i32| {
        let (at, velocity) = (place(i, reach[0]), place(j, reach[1]));
        format!("{{at = {at}, velocity = {velocity}, value = {}}}", f(at, velocity))
    };
    let knots: Vec<String> = (0..=80).flat_map(|i| (0..=80).map(move |j| (i, j))).map(|(i, j)| knot(i, j)).collect();
    format!(
        "effect = \"free_form\"\nport = \"torque\"\nargument = \"position_and_velocity\"\nunit = \"A\"\nknots = [{}]\n",
        knots.join(", ")
    )
}

#[test]
fn a_curve_survives_the_way_to_the_file_and_back() {
    let text = "effect = \"free_form\"\nport = \"torque\"\nargument = \"velocity\"\nunit = \"A\"\nknots = [{at = -1.0, value = 0.5, low = 0.4, high = 0.6}, {at = 2.0, value = -0.5}]\n\
                [[plant.physics]]\neffect = \"dead_band\"\nhalf_width = 0.01\n";
    let plant = read(text).unwrap();
    let written = toml::to_string(&PlantFile::from(&plant)).unwrap();
    let again = Plant::try_from(parse_toml::<PlantFile>(Path::new("p"), &written).unwrap()).unwrap();
    assert_eq!(plant, again);
    let knots = &again.physics[0].curve.as_ref().unwrap().knots;
    assert_eq!((knots[0].low, knots[1].high), (Some(0.4), None));
    let plant = read(&surface([2.0, 30.0], |x, v| x * v)).unwrap();
    let written = toml::to_string(&PlantFile::from(&plant)).unwrap();
    assert_eq!(plant, Plant::try_from(parse_toml::<PlantFile>(Path::new("p"), &written).unwrap()).unwrap());
}

#[test]
fn what_makes_no_curve_is_refused_by_name() {
    let knots = "knots = [{at = 0.0, value = 0.0}, {at = 1.0, value = 1.0}]\n";
    let form = |keys: &str| format!("effect = \"free_form\"\nunit = \"A\"\n{keys}");
    for (text, word) in [
        (form(&format!("port = \"torque\"\n{knots}")), "argument"),
        (form(&format!("port = \"torque\"\nargument = \"weather\"\n{knots}")), "weather"),
        (form("port = \"torque\"\nargument = \"position\"\nknots = [{at = 0.0, value = 0.0}]\n"), "1 knots"),
        (
            form(
                "port = \"torque\"\nargument = \"position\"\nknots = [{at = 1.0, value = 0.0}, {at = 1.0, value = 2.0}]\n",
            ),
            "ascending",
        ),
        (form(&format!("port = \"torque\"\nargument = \"position\"\nlevel = 2.0\n{knots}")), "level"),
        ("effect = \"free_form\"\n".into(), "knots"),
        (
            format!("effect = \"dead_band\"\nport = \"torque\"\nargument = \"position\"\nunit = \"A\"\n{knots}"),
            "dead_band",
        ),
        (form(&format!("port = \"torque\"\nargument = \"position_and_velocity\"\n{knots}")), "no velocity"),
        (
            form(
                "port = \"torque\"\nargument = \"position_and_velocity\"\nknots = [{at = 0.0, velocity = 0.0, value = 0.0}, {at = 0.0, velocity = 1.0, value = 1.0}, {at = 1.0, velocity = 0.0, value = 2.0}]\n",
            ),
            "grid",
        ),
        (
            form(
                "port = \"torque\"\nargument = \"position\"\nknots = [{at = 0.0, value = 0.0}, {at = 1.0, velocity = 1.0, value = 1.0}]\n",
            ),
            "found a velocity",
        ),
        (
            form(&format!(
                "port = \"torque\"\nargument = \"position\"\n{}",
                knots.replace("value = 1.0", "worth = 1.0")
            )),
            "worth",
        ),
    ] {
        let refused = restored(&text).err().unwrap_or_else(|| panic!("taken: {text}"));
        assert!(refused.contains(word), "{refused}");
    }
}

/// Positions at the samples by an integrator of the test's own.
fn runge_kutta(u: &[f64], law: impl Fn(f64, f64, f64) -> f64) -> Vec<f64> {
    let (w, z, dc) = (380.0f64, 0.2, 60.0);
    let slope = |u: f64, x: f64, v: f64| dc * w * w * law(u, x, v) - 2.0 * z * w * v - w * w * x;
    let h = T / STEPS as f64;
    let (mut x, mut v) = (0.0, 0.0);
    let mut out = Vec::new();
    for u in u {
        out.push(x);
        for _ in 0..STEPS {
            let (k1x, k1v) = (v, slope(*u, x, v));
            let (k2x, k2v) = (v + 0.5 * h * k1v, slope(*u, x + 0.5 * h * k1x, v + 0.5 * h * k1v));
            let (k3x, k3v) = (v + 0.5 * h * k2v, slope(*u, x + 0.5 * h * k2x, v + 0.5 * h * k2v));
            let (k4x, k4v) = (v + h * k3v, slope(*u, x + h * k3x, v + h * k3v));
            x += h / 6.0 * (k1x + 2.0 * k2x + 2.0 * k3x + k4x);
            v += h / 6.0 * (k1v + 2.0 * k2v + 2.0 * k3v + k4v);
        }
    }
    out
}

#[test]
fn the_machine_with_a_curve_agrees_with_an_independent_simulation() {
    let u: Vec<f64> = (0..3000)
        .map(|k| 0.3 * (TAU * 45.0 * T * f64::from(k)).sin() + 0.1 * (TAU * 130.0 * T * f64::from(k)).cos())
        .collect();
    let bump = |x: f64| 0.1 * (-(x / 9.0).powi(2)).exp() - 1e-5 * x.powi(3);
    let drag = |v: f64| -0.05 * (v / 2e3).tanh() - 1e-9 * v * v.abs();
    let bent = |u: f64| u + 0.3 * u * u;
    let even = |x: f64| 1.0 - 1e-4 * x * x;
    let uneven = |x: f64, v: f64| -0.05 * (1.0 + 0.6 * (x / 20.0).tanh()) * (v / 4e3).tanh();
    type Law<'a> = Box<dyn Fn(f64, f64, f64) -> f64 + 'a>;
    let cases: [(String, Law, f64); 5] = [
        (curve("torque", "position", -60.0, 60.0, bump), Box::new(|u, x, _| u + bump(x)), 1e-3),
        (curve("torque", "velocity", -3e4, 3e4, drag), Box::new(|u, _, v| u + drag(v)), 2e-3),
        (surface([60.0, 3e4], uneven), Box::new(|u, x, v| u + uneven(x, v)), 4e-3),
        (curve("amplifier", "command", -0.5, 0.5, bent), Box::new(|u, _, _| bent(u)), 1e-6),
        (curve("gain", "position", -60.0, 60.0, even), Box::new(|u, x, _| even(x) * u), 1e-3),
    ];
    for (text, law, tolerance) in cases {
        let truth = runge_kutta(&u, law);
        let r = restored(&text).unwrap();
        let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
        let (mut worst, mut size) = (0.0f64, 0.0f64);
        for (u, y) in u.iter().zip(&truth) {
            worst = worst.max((machine.measure(0.0, 0.0) - y).abs());
            size = size.max(y.abs());
            machine.command(*u);
        }
        assert!(worst < tolerance * size, "{}: {:e}", &text[..60], worst / size);
    }
}

#[test]
fn the_describing_function_of_a_cubic_curve_is_the_textbook_s() {
    let r = restored(&curve("torque", "position", -40.0, 40.0, |x| -2e-5 * x.powi(3))).unwrap();
    for a in [5.0, 20.0, 35.0] {
        let n = describing(&r.parts[0], &r.scene, a, 100.0).unwrap();
        // -3/4 k A²; 160 knots meet a cubic within their spacing's square.
        assert!((n.re / (-0.75 * 2e-5 * a * a) - 1.0).abs() < 5e-3 && n.im.abs() < 1e-9, "{a}: {n}");
    }
    // The body's stiffness with it: k + (3/4) k3 A² b.
    let plant = DescribedPlant::new(&r, 500.0).unwrap();
    let Body::SecondOrder { dc_gain, natural_frequency_rad_s: w0, .. } = r.scene.plant.body else { panic!() };
    let found = plant.at_amplitude(20.0).at(1.0).norm();
    let stiffness = w0 * w0 * (1.0 + dc_gain * 0.75 * 2e-5 * 400.0);
    assert!((found / (dc_gain * w0 * w0 / stiffness) - 1.0).abs() < 5e-3, "{found}");
}

#[test]
fn a_reading_that_folds_closes_no_loop_and_one_that_is_limited_does() {
    let folded = restored("effect = \"sensor_curve\"\nfold_position = 0.0\n").unwrap();
    let refused = folded.seen().unwrap_err().to_string();
    assert!(refused.contains("sensor_curve") && refused.contains("turns round"), "{refused}");
    let free = restored(&curve("sensor", "position", -9.0, 9.0, |x: f64| (x * x + 0.1).sqrt())).unwrap();
    assert!(free.seen().unwrap_err().to_string().contains("free_form"));
    let limited = restored("effect = \"sensor_curve\"\nlowest_reading = -5.0\nhighest_reading = 5.0\n").unwrap();
    limited.seen().unwrap();
    let n = describing(&limited.parts[0], &limited.scene, 10.0, 50.0).unwrap();
    // A clipped sine: 2/pi (asin r + r sqrt(1 - r²)), less the 1 of what is clipped; r = 1/2.
    let clip = 2.0 / PI * (0.5f64.asin() + 0.5 * 0.75f64.sqrt()) - 1.0;
    assert!((n.re - clip).abs() < 1e-5 && n.im.abs() < 1e-9, "{n}");
    assert!(restored("effect = \"sensor_curve\"\nlowest_reading = 5.0\nhighest_reading = -5.0\n").is_err());
}

#[test]
fn every_port_has_a_curve_that_changes_nothing() {
    let u: Vec<f64> = (0..400).map(|k| 0.2 * (TAU * 60.0 * T * f64::from(k)).sin()).collect();
    let run = |r: &Restored| -> Vec<f64> {
        let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
        u.iter()
            .map(|u| {
                let y = machine.measure(0.0, 0.0);
                machine.command(*u);
                y
            })
            .collect()
    };
    let plain = runge_kutta(&u, |u, _, _| u);
    for port in CurvePort::ALL {
        let [name, argument] = port.names();
        let text = match port {
            CurvePort::TorqueOverMotion => surface([50.0, 2e4], |x, _| port.idle(x)),
            _ => curve(name, argument, -50.0, 50.0, |a| port.idle(a)),
        };
        let r = restored(&text).unwrap();
        let worst = run(&r).iter().zip(&plain).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{name} over {argument}: {worst:e}");
    }
}
