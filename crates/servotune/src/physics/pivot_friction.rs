//! Pre-sliding friction of the pivot bearing: hysteresis over the distance since the last reversal.
//!
//! Dahl's law (P. Dahl, Aerospace Corp. TOR-0158, 1968): dz/dx = (1 - sgn(dx) z)/x_s with z = friction torque over its sliding
//! level; exact over a step: z1 = s - (s - z0) exp(-|dx|/x_s), s = sgn(dx). Maxwell-slip form (Al-Bender, Lampaert, Swevers
//! 2005): a row of spring-slider elements with evenly spread yield lengths up to 2 x_s, whose first loading is the parabola
//! z = d/x_s - (d/x_s)²/4. In every shape x_s is the sliding level over the first stiffness. In files `shape`
//! chooses: 0 is Dahl's law; above 0 it is Maxwell slip with the first loading z = 1 - (1 + m d/x_s)^(-1/m), m = shape/2 - 1
//! (survival of a generalised Pareto law of yield lengths, Pickands 1975): 1 the parabola, 2 Dahl's 1 - exp(-d/x_s), towards 0 one
//! spring that slips at once, above 2 elements that yield ever later. A break-away length cuts the curve off: behind it all elements slide.
//! Bristles that are damped (LuGre: Canudas de Wit, Olsson, Astrom, Lischinsky 1995) add `bristle_time_s` dz/dt to z: it damps what swings
//! on the bearing while it sticks and is gone once it slides.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, Prior, ScanEnd, Takes};
use super::maxwell_slip::MaxwellSlip;
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use super::sliders::Sliders;

/// The bearing. Its strength is the sliding level.
#[derive(Clone, Debug, PartialEq)]
pub struct PivotFriction {
    /// Sliding level over the first stiffness (position_unit), above 0.
    pub sliding_length: f64,
    /// The form of the first loading.
    pub loading: Loading,
    /// Damping of the bristles over their stiffness (s), above 0; none without.
    pub bristle_time_s: Option<f64>,
}

/// The first loading of a bearing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loading {
    /// Dahl's law.
    Dahl,
    /// A row of Maxwell-slip elements.
    MaxwellSlip {
        /// 1 for the parabola, 2 for 1 - exp(-d/x_s), between 0.1 and 8.
        shape: f64,
        /// Way behind which all of it slides (position_unit); none where its curve alone ends it. Up to the sliding length it is one spring.
        break_away_length: Option<f64>,
    },
}

const SLIDING_LENGTH: Key = Key::new("sliding_length", Unit::Position, "sliding level over the first stiffness")
    .positive()
    .scan(ScanEnd::Greatest(&[(12.0, Measure::Noise), (2e-3, Measure::Travel)]), ScanEnd::At(4.0, Measure::Travel));
const LEVEL_COMMAND: Key = Key::new("level_command", Unit::Command, "drag once it slides, F");
const SHAPE: Key = Key::new("shape", Unit::Ratio, "0: Dahl; above 0 a Maxwell-slip row with the first loading 1 - (1 + m d/x_s)^(-1/m), m = shape/2 - 1: 1 a parabola, 2 the curve of Dahl, towards 0 one spring that slips; the last fit moves it between 0.1 and 8").or(0.0).points(&[0.0, 1.0, 2.0]);
const BREAK_AWAY_LENGTH: Key = Key::new(
    "break_away_length",
    Unit::Position,
    "way after a rest behind which all of a Maxwell-slip row slides: its curve is cut off there",
)
.or_else("its curve ends it")
.beside("shape")
.takes(Takes::Law("a finite number above 0, beside a shape above 0"))
.prior(Prior::Words("in fuller forms, from the travel and a quarter of it"));
/// Damping of the bristles, of every drag that sticks.
pub(super) const BRISTLE_TIME_S: Key = Key::new(
    "bristle_time_s",
    Unit::Second,
    "damping of the bristles over their stiffness: z + bristle_time dz/dt in the place of z; 0 for none",
)
.or(0.0)
.takes(Takes::Law("a finite number of at least 0; a film that creeps has no bristles"))
.prior(Prior::Words("in fuller forms, from one sample on"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "pivot_friction",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -F z, dz/dx = (1 - sgn(dx) z)/x_s (Dahl) or a row of Maxwell-slip elements; z + tau_b dz/dt of damped bristles",
    keys: &[SLIDING_LENGTH, LEVEL_COMMAND, SHAPE, BREAK_AWAY_LENGTH, BRISTLE_TIME_S],
    source: "P. R. Dahl, A Solid Friction Model, Aerospace Corporation TOR-0158, 1968; F. Al-Bender, V. Lampaert, J. Swevers, The Generalized Maxwell-Slip Model, IEEE Transactions on Automatic Control 50(11), 2005; D. Abramovitch, F. Wang, G. Franklin, Disk Drive Pivot Nonlinearity Modeling, ACC 1994",
    says: "the arm behaves like a bearing that sticks: after each reversal it first acts as a spring, then slides at a constant drag",
    confused_with: &["coulomb_friction", "cable_spring", "nonlinear_spring", "linear_parameters"],
    experiment: "the same multisine at three amplitudes over a decade, and a slow triangle with small nested reversals",
    band_hz: [1.0, 150.0],
};

struct Dahl {
    length: f64,
    bristle_time_s: f64,
    z: f64,
}

/// Dahl's law over a step `dx`, exact.
pub(super) fn dahl(z: f64, dx: f64, length: f64) -> f64 {
    let (s, path) = (dx.signum(), dx.abs() / length);
    if path > SLID { s } else { s - (s - z) * (-path).exp() }
}

/// Mean of dz/dt over a step (1/s): exact however z went. Along a cycle, where time stands still, the mean speed tells how long it took.
pub(super) fn bristle_rate(z: [f64; 2], from: &Sample, to: &Sample) -> f64 {
    let (t, dx) = (to.t - from.t, to.x - from.x);
    if t > 0.0 {
        (z[1] - z[0]) / t
    } else if dx != 0.0 {
        (z[1] - z[0]) * 0.5 * (from.v + to.v) / dx
    } else {
        0.0
    }
}

/// What a bearing adds by its damped bristles to a column; the column to the last bit where they are not damped.
fn damped(column: f64, bristle_time_s: f64, z: [f64; 2], from: &Sample, to: &Sample) -> f64 {
    if bristle_time_s > 0.0 { column - bristle_time_s * bristle_rate(z, from, to) } else { column }
}

/// Path in lengths behind which nothing is left of the past in double precision.
pub(super) const SLID: f64 = 45.0;

impl Law for Dahl {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let z = dahl(self.z, to.x - from.x, self.length);
        out[0] = damped(-0.5 * (self.z + z), self.bristle_time_s, [self.z, z], from, to);
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.went(to.x - from.x);
    }

    fn went(&mut self, way: f64) {
        self.z = dahl(self.z, way, self.length);
    }
}

struct Row {
    row: Sliders,
    bristle_time_s: f64,
}

impl Law for Row {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let z = [self.row.held(), self.row.held_after(to.x - from.x)];
        out[0] = damped(-0.5 * (z[0] + z[1]), self.bristle_time_s, z, from, to);
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.went(to.x - from.x);
    }

    fn went(&mut self, way: f64) {
        self.row.go(way);
    }
}

/// Share of its level by which a drag has turned round.
pub(crate) const HELD: f64 = 0.9;

/// Sliding length with which Dahl's law turns round over this way.
pub(crate) fn dahl_length(way: f64) -> f64 {
    -way / (1.0 - HELD).ln()
}

/// Forms beside Dahl's law, from nearly one spring to a long tail.
const SHAPES: [f64; 2] = [0.1, 8.0];
/// Shapes that a fuller form sets out from, and ways at which it breaks away, over the travel.
const LOADED: [f64; 3] = [0.7, 2.5, 5.0];
const BREAKS_AWAY: [f64; 2] = [0.25, 1.0];

/// Shortest sliding length whose hysteresis is told from dry friction: some twelve times the sensor's noise, or a small share of the travel.
pub(crate) fn shortest_loop(scene: &MotionScene) -> f64 {
    (12.0 * scene.noise).max(2e-3 * scene.travel)
}

/// Times of bristles (samples) within which a fuller form is fitted.
pub(super) const BRISTLE_TIMES: [f64; 2] = [0.02, 200.0];

/// The damping that a file gives; none where it is 0 or left out.
pub(super) fn bristle_time_of(given: &Given) -> Result<Option<f64>, PhysicsError> {
    let time = given.or(&BRISTLE_TIME_S)?;
    if time < 0.0 {
        return Err(given.refused(&BRISTLE_TIME_S, time));
    }
    Ok(Some(time).filter(|t| *t > 0.0))
}

impl Loading {
    /// The loading that files name by this shape.
    fn of(shape: f64) -> Loading {
        if shape < 0.5 * SHAPES[0] { Loading::Dahl } else { Loading::MaxwellSlip { shape, break_away_length: None } }
    }

    /// The shape by which files name it.
    fn shape(self) -> f64 {
        match self {
            Loading::Dahl => 0.0,
            Loading::MaxwellSlip { shape, .. } => shape,
        }
    }
}

impl PivotFriction {
    /// A bearing of this sliding length (position_unit) without damping of its bristles.
    pub fn of(sliding_length: f64, loading: Loading) -> PivotFriction {
        PivotFriction { sliding_length, loading, bristle_time_s: None }
    }
}

impl Parametric for PivotFriction {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn acts_on_body() -> bool {
        true
    }

    fn shown_over() -> ShownOver {
        ShownOver::Loop
    }

    fn grid(scene: &MotionScene) -> Vec<PivotFriction> {
        let lengths = logarithmic(shortest_loop(scene), 4.0 * scene.travel, 14);
        let loadings = [0.0, 1.0, 2.0].map(Loading::of);
        let each = |sliding_length| loadings.map(|loading| PivotFriction::of(sliding_length, loading));
        lengths.into_iter().flat_map(each).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        let (shape, end) = match &mut self.loading {
            Loading::Dahl => (None, None),
            Loading::MaxwellSlip { shape, break_away_length } => (Some(shape), break_away_length.as_mut()),
        };
        vec![Some(&mut self.sliding_length), shape, end, self.bristle_time_s.as_mut()]
    }

    /// Of other loadings, their shape free; one that breaks away; with damped bristles. One after the other makes all.
    fn fuller(&self, scene: &MotionScene) -> Vec<(PivotFriction, Vec<[f64; 2]>)> {
        let loaded = |loading| PivotFriction { loading, ..self.clone() };
        let mut all = Vec::new();
        match self.loading {
            Loading::MaxwellSlip { shape, break_away_length: None } => {
                let ends = BREAKS_AWAY.map(|share| Some((share * scene.travel).max(2.0 * self.sliding_length)));
                all.extend(ends.map(|break_away_length| loaded(Loading::MaxwellSlip { shape, break_away_length })));
                all.extend(LOADED.map(Loading::of).map(loaded));
            }
            Loading::MaxwellSlip { .. } => {}
            Loading::Dahl => all.extend(LOADED.map(Loading::of).map(loaded)),
        }
        if self.bristle_time_s.is_none() {
            all.push(PivotFriction { bristle_time_s: Some(scene.sample_time_s), ..self.clone() });
        }
        let [short, long] = [shortest_loop(scene), 4.0 * scene.travel];
        let times = BRISTLE_TIMES.map(|samples| samples * scene.sample_time_s);
        let ranges = vec![[short, long], SHAPES, [short, 2.0 * long], times];
        all.into_iter().map(|law| (law, ranges.clone())).collect()
    }

    fn presliding_length(&self) -> Option<f64> {
        Some(match self.loading {
            Loading::Dahl => self.sliding_length,
            Loading::MaxwellSlip { shape, break_away_length } => {
                let row = MaxwellSlip::of(shape, self.sliding_length, break_away_length);
                self.sliding_length.max(dahl_length(row.way_to(HELD)))
            }
        })
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        let (length, bristle_time_s) = (self.sliding_length, self.bristle_time_s.unwrap_or(0.0));
        match self.loading {
            Loading::Dahl => Box::new(Dahl { length, bristle_time_s, z: 0.0 }),
            Loading::MaxwellSlip { shape, break_away_length } => {
                let row = MaxwellSlip::of(shape.clamp(SHAPES[0], SHAPES[1]), length, break_away_length).row();
                Box::new(Row { row, bristle_time_s })
            }
        }
    }

    fn is_drag() -> bool {
        true
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let mut all = vec![
            SLIDING_LENGTH.at(self.sliding_length),
            LEVEL_COMMAND.at(strengths[0]),
            SHAPE.at(self.loading.shape()),
        ];
        if let Loading::MaxwellSlip { break_away_length: Some(way), .. } = self.loading {
            all.push(BREAK_AWAY_LENGTH.at(way));
        }
        all.extend(self.bristle_time_s.map(|time| BRISTLE_TIME_S.at(time)));
        all
    }

    fn measured_in_last_fit(&self) -> Vec<(usize, [f64; 2])> {
        match self.loading {
            Loading::Dahl => Vec::new(),
            Loading::MaxwellSlip { .. } => vec![(1, SHAPES)],
        }
    }

    fn is_on_every_machine() -> bool {
        true
    }

    fn is_possible(&self, strengths: &[f64], _errors: &[f64]) -> bool {
        strengths.first().is_some_and(|s| *s > 0.0)
    }

    /// The first stiffness lies below the smallest strokes: curves that agree above them differ by a tenth there. Dahl's law has one curve.
    fn form_uncertainty(&self, parameter: &str) -> f64 {
        match parameter {
            "sliding_length" if self.loading != Loading::Dahl => 0.1,
            "sliding_length" => 0.02,
            _ => 0.01,
        }
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(PivotFriction, Vec<f64>), PhysicsError> {
        let sliding_length = given.need(&SLIDING_LENGTH)?;
        let mut loading = Loading::of(given.or(&SHAPE)?);
        if let Some(way) = given.get(&BREAK_AWAY_LENGTH)? {
            match &mut loading {
                Loading::MaxwellSlip { break_away_length, .. } if way > 0.0 => *break_away_length = Some(way),
                _ => return Err(given.refused(&BREAK_AWAY_LENGTH, way)),
            }
        }
        let law = PivotFriction { sliding_length, loading, bristle_time_s: bristle_time_of(given)? };
        Ok((law, vec![given.need(&LEVEL_COMMAND)?]))
    }
}
