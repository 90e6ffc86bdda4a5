//! Which named law a curve is most like, in one sentence.
//!
//! In: a curve in its plain form. Out: the law, the share of the curve that its shape holds, and how the two sides differ. Shapes are the
//! textbook ones, fitted to the knots beside what a linear plant could hold.

use super::gauge::Plain;
use crate::diagnose::rules::{CURVE_LIKE, CURVE_LOPSIDED};
use crate::numeric::digits::said;
use crate::numeric::least_squares::Qr;
use crate::physics::{
    CurvePort, Facts, aerodynamic_drag, cable_spring, coulomb_friction, current_saturation, dead_band,
    encoder_scale_error, gain_drift, nonlinear_spring, pivot_friction, sensor_curve, shock, torque_factor_rolloff,
    torque_ripple, unexplained,
};

/// The nearest law of the library.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Likeness {
    /// Its name.
    pub effect: &'static str,
    /// Share of the curve's square that its shape holds.
    pub share: f64,
    /// Whether its two sides are alike.
    #[serde(skip)]
    pub even: bool,
    /// One plain sentence.
    pub says: String,
}

impl Likeness {
    /// Like none of them, the nearest one holding too small a share.
    pub(super) fn far(facts: &Facts, words: &str, share: f64) -> Likeness {
        let percent = 100.0 * share;
        let says = format!("like none of the named laws: the nearest, {words}, holds {percent:.0} % of the curve");
        Likeness { effect: facts.name, share, even: false, says }
    }

    /// Like none of them.
    pub(super) fn none() -> Likeness {
        Likeness {
            effect: unexplained::FACTS.name,
            share: 0.0,
            even: false,
            says: "like none of the named laws".into(),
        }
    }
}

/// One shape to compare with.
struct Form {
    facts: &'static Facts,
    words: String,
    value: Vec<f64>,
    /// Whether its sign is part of the law: no friction gives energy, no end of a stroke pulls.
    directed: bool,
    /// Whether it lies around a place of its own: it has no two sides.
    local: bool,
}

/// Places of a kink, as shares of the range.
pub(super) const KINKS: [f64; 7] = [0.02, 0.05, 0.1, 0.2, 0.35, 0.55, 0.75];

/// A shape whose two sides differ by themselves.
const TWO_GAINS: &str = "an amplifier with asymmetric gain";

/// First knot, middle and half width of a curve.
fn range(c: &Plain) -> (f64, f64, f64) {
    let [low, high] = c.knots.ends();
    (low, 0.5 * (low + high), 0.5 * (high - low))
}

impl Plain {
    /// A shape at the curve's knots.
    fn form(&self, facts: &'static Facts, words: &str, f: &dyn Fn(f64) -> f64) -> Form {
        let either = [torque_ripple::FACTS.name, shock::FACTS.name].contains(&facts.name);
        let directed = self.port != CurvePort::SensorOverPosition && !either;
        Form {
            facts,
            words: words.into(),
            value: self.knots.at.iter().map(|a| f(*a)).collect(),
            directed,
            local: facts.name == shock::FACTS.name,
        }
    }

    /// A shape of either sign that no law of the library has.
    fn nameless(&self, words: &str, f: &dyn Fn(f64) -> f64) -> Form {
        Form { directed: false, ..self.form(&unexplained::FACTS, words, f) }
    }
}

/// The textbook shapes at a curve's port.
fn forms(c: &Plain, unit: &str) -> Vec<Form> {
    let of_torque = torque_forms(c, unit);
    if of_torque.is_empty() { other_forms(c) } else { of_torque }
}

/// Shapes of a torque over position, velocity, loading or time.
fn torque_forms(c: &Plain, unit: &str) -> Vec<Form> {
    let (low, centre, half) = range(c);
    let over = |facts, words, f: &dyn Fn(f64) -> f64| c.form(facts, words, f);
    let mut all = Vec::new();
    match c.port {
        CurvePort::TorqueOverVelocity => {
            for s in KINKS {
                all.push(over(&coulomb_friction::FACTS, "dry friction", &|v| -(v / (s * half)).tanh()));
            }
            all.push(over(&aerodynamic_drag::FACTS, "drag of the air", &|v| -v * v.abs()));
        }
        CurvePort::TorqueOverPosition => {
            all.push(over(&nonlinear_spring::FACTS, "a stiffening spring", &|x| -(x - centre).powi(3)));
            for s in KINKS.into_iter().chain([0.9]) {
                let depth = |d: f64| (d.abs() - s * half).max(0.0) * d.signum();
                all.push(over(&nonlinear_spring::FACTS, "a spring that meets a stop", &|x| -depth(x - centre)));
            }
            all.push(over(&cable_spring::FACTS, "a cable that pulls harder to one side", &|x| -(x - centre).powi(2)));
            for waves in 1..=6 {
                let w = std::f64::consts::PI * f64::from(waves) / half;
                all.push(over(&torque_ripple::FACTS, "a ripple of the torque", &|x| (w * (x - centre)).sin()));
                all.push(over(&torque_ripple::FACTS, "a ripple of the torque", &|x| (w * (x - centre)).cos()));
            }
            for place in &c.knots.at {
                let words = format!("a detent at {} {unit}", said(*place, 3));
                all.extend(KINKS.map(|s| {
                    let detent = c.nameless(&words, &|x| (-((x - place) / (s * half)).powi(2)).exp());
                    Form { local: true, ..detent }
                }));
            }
        }
        CurvePort::TorqueOverLoading => {
            for s in KINKS {
                let length = 2.0 * s * half;
                let first = |d: f64| -((low - d) / length).exp_m1();
                all.push(over(&pivot_friction::FACTS, "a bearing that sticks", &first));
            }
        }
        CurvePort::TorqueOverTime => {
            let strongest =
                (0..c.value.len()).max_by(|a, b| c.value[*a].abs().total_cmp(&c.value[*b].abs())).unwrap_or(0);
            for s in KINKS {
                let push = |t: f64| (-((t - c.knots.at[strongest]) / (s * half)).powi(2)).exp();
                all.push(over(&shock::FACTS, "a push at one time of every record", &push));
            }
        }
        _ => {}
    }
    all
}

/// Shapes of an amplifier, a gain or a sensor.
fn other_forms(c: &Plain) -> Vec<Form> {
    let (low, centre, half) = range(c);
    let over = |facts, words, f: &dyn Fn(f64) -> f64| c.form(facts, words, f);
    let mut all = Vec::new();
    match c.port {
        CurvePort::AmplifierOverCommand => {
            all.push(c.nameless(TWO_GAINS, &|u| u.abs()));
            for s in KINKS {
                let edge = s * half;
                all.push(over(&dead_band::FACTS, "an amplifier that ignores small commands", &|u| {
                    u - u.clamp(-edge, edge)
                }));
                all.push(over(&current_saturation::FACTS, "an amplifier that runs out of current", &|u| {
                    u.clamp(-edge, edge)
                }));
            }
        }
        CurvePort::GainOverPosition => {
            all.push(over(&torque_factor_rolloff::FACTS, "a motor that pushes less towards the ends", &|x| {
                -(x - centre).powi(2)
            }));
            all.push(over(&torque_factor_rolloff::FACTS, "a motor that pushes less towards the ends", &|x| {
                -(x - centre).powi(4)
            }));
        }
        CurvePort::GainOverTime => {
            for s in KINKS {
                let warmed = |t: f64| -((low - t) / (2.0 * s * half)).exp_m1();
                all.push(over(&gain_drift::FACTS, "a gain that drifts as the machine warms up", &warmed));
            }
        }
        CurvePort::SensorOverPosition => {
            for s in KINKS.into_iter().chain([0.0]) {
                for edge in [centre + s * half, centre - s * half] {
                    all.push(over(&sensor_curve::FACTS, "a reading folded like an absolute value", &|x| {
                        (x - edge).abs()
                    }));
                }
            }
            for s in KINKS {
                let edge = s * half;
                let read = |x: f64| (x - centre).clamp(-edge, edge);
                all.push(over(&sensor_curve::FACTS, "a reading that ends at a limit", &read));
            }
            all.push(over(&encoder_scale_error::FACTS, "a scale that stretches over the stroke", &|x| {
                (x - centre).powi(2)
            }));
            all.push(over(&encoder_scale_error::FACTS, "a scale that stretches over the stroke", &|x| {
                (x - centre).powi(3)
            }));
        }
        _ => {}
    }
    all
}

/// Values fitted by columns, weighted: shares, and sum of squares left.
pub(super) fn fitted(value: &[f64], columns: &[Vec<f64>], weight: &[f64]) -> (Vec<f64>, f64) {
    let n = value.len();
    let root: Vec<f64> = weight.iter().map(|w| w.sqrt()).collect();
    let mut qr = Qr::default();
    qr.factor(n, columns.len(), |a| {
        for (a, c) in a.chunks_exact_mut(n).zip(columns) {
            a.iter_mut().zip(c).zip(&root).for_each(|((a, c), w)| *a = c * w);
        }
    });
    let mut right: Vec<f64> = value.iter().zip(&root).map(|(v, w)| v * w).collect();
    let shares = qr.solve(&mut right);
    let left = |i: usize| value[i] - columns.iter().zip(&shares).map(|(c, s)| s * c[i]).sum::<f64>();
    let square = (0..n).map(|i| weight[i] * left(i).powi(2)).sum();
    (shares, square)
}

/// How the two sides of an argument are called.
fn sides(port: CurvePort) -> [&'static str; 2] {
    match port {
        CurvePort::TorqueOverVelocity => ["going up", "going down"],
        CurvePort::AmplifierOverCommand => ["for positive commands", "for negative commands"],
        CurvePort::TorqueOverLoading => ["on long ways", "on short ways"],
        CurvePort::GainOverTime | CurvePort::TorqueOverTime => ["late", "early"],
        _ => ["above the middle", "below the middle"],
    }
}

/// The law that a curve over one argument (in this unit) is most like.
pub(in crate::diagnose) fn likeness(c: &Plain, unit: &str) -> Likeness {
    let n = c.value.len();
    let line = || vec![vec![1.0; n], c.knots.at.clone()];
    let (_, whole) = fitted(&c.value, &line(), &c.weight);
    let mut best: Option<(f64, Form, Vec<f64>)> = None;
    for form in forms(c, unit) {
        let mut columns = line();
        columns.push(form.value.clone());
        let (shares, left) = fitted(&c.value, &columns, &c.weight);
        let allowed = !form.directed || shares[2] > 0.0;
        if allowed && shares.iter().all(|s| s.is_finite()) && best.as_ref().is_none_or(|b| left < b.0) {
            best = Some((left, form, shares));
        }
    }
    let Some((left, form, shares)) = best else { return Likeness::none() };
    let (beside, left) = match form.words == TWO_GAINS {
        true => (weaker((shares[1] + shares[2]) / (shares[1] - shares[2]), sides(c.port)), left),
        false => Some(&form)
            .filter(|f| !f.local)
            .and_then(|f| lopsided(c, f))
            .map_or((None, left), |(text, left)| (Some(text), left)),
    };
    let share = if whole > 0.0 { 1.0 - left / whole } else { 0.0 };
    if share < CURVE_LIKE {
        return Likeness::far(form.facts, &form.words, share);
    }
    let percent = 100.0 * share;
    let even = beside.is_none();
    let joint = if form.words == TWO_GAINS { ": it is" } else { ", but" };
    let beside = beside.map_or(String::new(), |text| format!("{joint} {text}"));
    let says = format!("like {}{beside}; that shape holds {percent:.0} % of the curve", form.words);
    Likeness { effect: form.facts.name, share, even, says }
}

/// How much weaker a shape is on one side than on the other, and the sum of squares that it leaves with a strength of its own on either.
fn lopsided(c: &Plain, form: &Form) -> Option<(String, f64)> {
    let [low, high] = c.knots.ends();
    let signed = matches!(c.port, CurvePort::TorqueOverVelocity | CurvePort::AmplifierOverCommand);
    let middle = if signed && low < 0.0 && high > 0.0 { 0.0 } else { 0.5 * (low + high) };
    let side = |up: bool| {
        c.knots.at.iter().zip(&form.value).map(|(a, v)| if (*a > middle) == up { *v } else { 0.0 }).collect()
    };
    // With a line free beside it, two halves of a straight piece could not be told apart: the sides alone, and a level.
    let (shares, left) =
        fitted(&c.value, &[vec![1.0; c.value.len()], c.knots.at.clone(), side(true), side(false)], &c.weight);
    Some((weaker(shares[2] / shares[3], sides(c.port))?, left))
}

/// On which of two sides a law is weaker, by the first over the second.
pub(super) fn weaker(ratio: f64, [above, below]: [&str; 2]) -> Option<String> {
    if ratio.is_nan() || ratio <= 0.0 {
        return None;
    }
    let (share, place) = if ratio < 1.0 { (1.0 - ratio, above) } else { (1.0 - ratio.recip(), below) };
    (share > CURVE_LOPSIDED).then(|| format!("{:.0} % weaker {place}", 100.0 * share))
}
