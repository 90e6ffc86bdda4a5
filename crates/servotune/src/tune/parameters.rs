//! The decision vector: which numbers of a controller are free, in which ranges, and the way there and back.
//!
//! Every free number is searched as its logarithm: gains and frequencies matter by ratio, and none may change its sign.
//! A cascade (`p_pi`) is searched in its own gains: position gain a (1/s), velocity gain b, velocity integral c; with velocity fed
//! forward it is the PID with kp = a b + c, ki = a c, kd = b (Ellis, Control System Design Guide, ch. 17).

use super::bounds::Ranges;
use super::spec::Spec;
use super::structure::{ControllerKind, FixedOrSearched};
use crate::controller::{Controller, Lowpass, Notch, Pid};
use crate::lti::Section;
use serde::Serialize;
use std::f64::consts::TAU;

/// One free number of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the names are those of controller.toml; filters are counted from 0")]
pub enum TunedNumber {
    Kp,
    Ki,
    Kd,
    /// Position gain of the cascade (1/s).
    PositionGain,
    /// Velocity gain of the cascade (command_unit s per position_unit).
    VelocityGain,
    /// Integral gain of the cascade's velocity loop (command_unit per position_unit).
    VelocityIntegral,
    DerivativeFilter,
    LowpassFrequency {
        filter: usize,
    },
    NotchFrequency {
        filter: usize,
    },
    /// Zero damping over pole damping, the gain at the centre: below 1 for a notch, above 1 for a peak filter.
    NotchDepth {
        filter: usize,
    },
    NotchPoleDamping {
        filter: usize,
    },
}

impl std::fmt::Display for TunedNumber {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            TunedNumber::Kp => f.write_str("kp"),
            TunedNumber::Ki => f.write_str("ki"),
            TunedNumber::Kd => f.write_str("kd"),
            TunedNumber::PositionGain => f.write_str("position gain"),
            TunedNumber::VelocityGain => f.write_str("velocity gain"),
            TunedNumber::VelocityIntegral => f.write_str("velocity integral gain"),
            TunedNumber::DerivativeFilter => f.write_str("derivative filter"),
            TunedNumber::LowpassFrequency { filter } => write!(f, "low-pass {} corner", filter + 1),
            TunedNumber::NotchFrequency { filter } => write!(f, "notch {} centre", filter + 1),
            TunedNumber::NotchDepth { filter } => write!(f, "notch {} depth", filter + 1),
            TunedNumber::NotchPoleDamping { filter } => write!(f, "notch {} pole damping", filter + 1),
        }
    }
}

/// Range of a notch's depth: from 40 dB deep to no notch at all.
pub const NOTCH_DEPTH: [f64; 2] = [0.01, 1.0];
/// Range of a notch's pole damping: narrower would miss a mode that drifts by 3 %, wider eats phase a decade below.
pub const NOTCH_POLE_DAMPING: [f64; 2] = [0.05, 1.0];
/// Range of a peak filter's height (gain at its centre) and of its pole damping.
const PEAK_HEIGHT: [f64; 2] = [1.0, 30.0];
const PEAK_POLE_DAMPING: [f64; 2] = [0.002, 0.1];
/// Derivative filter where neither start controller nor spec names one, in sample times.
pub const DERIVATIVE_FILTER: f64 = 0.3;
/// Its range (sample times) for a PID where no table with that one meets the limits, and for a lead.
pub(super) const PID_FILTER: [f64; 2] = [0.1, 10.0];
const LEAD_FILTER: [f64; 2] = [0.1, 100.0];
/// Damping of a low-pass where no start controller names one.
pub const LOWPASS_DAMPING: f64 = 0.7;
/// Centres may not come closer to half the sample rate than this share of it: the prewarping ends there.
pub(super) const BELOW_HALF_RATE: f64 = 0.99;

/// The free numbers and everything that stays.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// The controller that the free numbers are put into.
    base: Controller,
    kind: ControllerKind,
    free: Vec<TunedNumber>,
    /// Logarithms of the ranges, [from, to].
    bounds: Vec<[f64; 2]>,
    ranges: Ranges,
}

impl Parameters {
    /// The search of a spec around `start`, or around the defaults at `sample_time_s`, in these ranges.
    ///
    /// The first `search.lowpasses` low-passes and `search.notches` notches are set by the search, then `structure.peaks` peak filters among the
    /// notches; further ones of `start` stay as they are. Low-pass damping, feed-forward and output limit stay `start`'s.
    pub fn of(spec: &Spec, start: Option<&Controller>, sample_time_s: f64, ranges: &Ranges) -> Parameters {
        let (s, r) = (&spec.search, *ranges);
        let t = start.map_or(sample_time_s, |c| c.sample_time_s);
        let mut base = start.cloned().unwrap_or(Controller {
            sample_time_s,
            output_limit: None,
            pid: Pid {
                kp: r.kp[0],
                ki_per_s: r.ki_per_s[0],
                kd_s: r.kd_s[0],
                derivative_filter_s: DERIVATIVE_FILTER * t,
            },
            lowpass: vec![],
            notch: vec![],
            biquad: vec![],
            feedforward: None,
        });
        let end_hz = BELOW_HALF_RATE * 0.5 / t;
        let frequency = |[from, to]: [f64; 2]| [from.min(end_hz), to.min(end_hz)];
        let (lowpass_hz, notch_hz) = (frequency(r.lowpass_hz), frequency(r.notch_hz));
        while base.lowpass.len() < s.lowpasses {
            base.lowpass.push(Lowpass { frequency_hz: lowpass_hz[1], damping_ratio: LOWPASS_DAMPING });
        }
        let flat = |frequency_hz: f64, damping: f64| Notch {
            frequency_hz,
            zero_damping_ratio: damping,
            pole_damping_ratio: damping,
        };
        while base.notch.len() < s.notches {
            base.notch.push(flat(notch_hz[1], 0.3));
        }
        let orders = strongest_orders(spec);
        for i in 0..spec.structure.peaks {
            let at = s.notches + i;
            let hz = orders.get(i).copied().filter(|hz| *hz < end_hz);
            if base.notch.len() <= at {
                base.notch.push(flat(hz.unwrap_or(0.3 * r.crossover_hz[0]), 0.02));
            }
            if let Some(hz) = hz {
                base.notch[at].frequency_hz = hz;
            }
        }
        let structure = &spec.structure;
        let kind = structure.controller;
        let mut p = Parameters { base, kind, free: Vec::new(), bounds: Vec::new(), ranges: r };
        p.add_gains();
        let filter = match (structure.derivative_filter_s, kind) {
            (_, ControllerKind::Pi | ControllerKind::PPi) => None,
            (None, ControllerKind::Lead) if start.is_none() => Some(LEAD_FILTER.map(|share| share * t)),
            (None, _) => None,
            (Some(FixedOrSearched::Fixed(x)), _) => Some([x, x]),
            (Some(FixedOrSearched::Range(range)), _) => Some(range),
        };
        if let Some(range) = filter {
            p.add(TunedNumber::DerivativeFilter, range);
        }
        for filter in 0..s.lowpasses {
            p.add(TunedNumber::LowpassFrequency { filter }, lowpass_hz);
        }
        for filter in 0..s.notches {
            p.add(TunedNumber::NotchFrequency { filter }, notch_hz);
            p.add(TunedNumber::NotchDepth { filter }, NOTCH_DEPTH);
            p.add(TunedNumber::NotchPoleDamping { filter }, NOTCH_POLE_DAMPING);
        }
        for i in 0..structure.peaks {
            let filter = s.notches + i;
            if orders.get(i).is_none() {
                let [low, high] = r.crossover_hz;
                p.add(TunedNumber::NotchFrequency { filter }, [0.05 * low, high]);
            }
            p.add(TunedNumber::NotchDepth { filter }, PEAK_HEIGHT);
            p.add(TunedNumber::NotchPoleDamping { filter }, PEAK_POLE_DAMPING);
        }
        p
    }

    /// The gains that a controller of this kind has free.
    fn add_gains(&mut self) {
        let r = self.ranges;
        match self.kind {
            ControllerKind::Pid => {
                self.add(TunedNumber::Kp, r.kp);
                self.add(TunedNumber::Ki, r.ki_per_s);
                self.add(TunedNumber::Kd, r.kd_s);
            }
            ControllerKind::Pi => {
                self.base.pid.kd_s = 0.0;
                self.add(TunedNumber::Kp, r.kp);
                self.add(TunedNumber::Ki, r.ki_per_s);
            }
            ControllerKind::PPi => {
                self.base.pid.derivative_filter_s = 0.0;
                let [low, high] = r.crossover_hz;
                self.add(TunedNumber::PositionGain, [0.02 * TAU * low, TAU * high]);
                self.add(TunedNumber::VelocityGain, r.kd_s);
                self.add(TunedNumber::VelocityIntegral, [1e-3 * r.kp[0], r.kp[1]]);
            }
            ControllerKind::Lead => {
                self.base.pid.ki_per_s = 0.0;
                self.add(TunedNumber::Kp, r.kp);
                self.add(TunedNumber::Kd, r.kd_s);
            }
        }
    }

    fn add(&mut self, parameter: TunedNumber, [from, to]: [f64; 2]) {
        if from == to {
            if let Some(number) = Self::raw(&mut self.base, parameter) {
                *number = from;
            }
        } else {
            self.free.push(parameter);
            self.bounds.push([from.ln(), to.ln()]);
        }
    }

    /// Where the number stands; none for those of a cascade. The depth of a notch is stored as its zero damping and set by [`Self::put`].
    fn raw(c: &mut Controller, parameter: TunedNumber) -> Option<&mut f64> {
        Some(match parameter {
            TunedNumber::Kp => &mut c.pid.kp,
            TunedNumber::Ki => &mut c.pid.ki_per_s,
            TunedNumber::Kd => &mut c.pid.kd_s,
            TunedNumber::DerivativeFilter => &mut c.pid.derivative_filter_s,
            TunedNumber::LowpassFrequency { filter } => &mut c.lowpass[filter].frequency_hz,
            TunedNumber::NotchFrequency { filter } => &mut c.notch[filter].frequency_hz,
            TunedNumber::NotchDepth { filter } => &mut c.notch[filter].zero_damping_ratio,
            TunedNumber::NotchPoleDamping { filter } => &mut c.notch[filter].pole_damping_ratio,
            TunedNumber::PositionGain | TunedNumber::VelocityGain | TunedNumber::VelocityIntegral => return None,
        })
    }

    /// The free numbers, in the order of the vector.
    pub fn free(&self) -> &[TunedNumber] {
        &self.free
    }

    /// Logarithms of the ranges.
    pub fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    /// The ranges that the search was given.
    pub fn ranges(&self) -> &Ranges {
        &self.ranges
    }

    /// The controller that carries the fixed numbers.
    pub fn base(&self) -> &Controller {
        &self.base
    }

    /// The kind of controller.
    pub fn kind(&self) -> ControllerKind {
        self.kind
    }

    /// Position gain, velocity gain and velocity integral of a cascade with these PID gains: kp = a b + c, ki = a c, kd = b. Gains
    /// without real corners are moved to the nearest ones that have them.
    fn cascade(pid: &Pid) -> [f64; 3] {
        let b = pid.kd_s.max(f64::MIN_POSITIVE);
        let half = 0.5 * pid.kp / b;
        let root = (half * half - pid.ki_per_s / b).max(0.0).sqrt();
        // The velocity loop's integral corner is the slower of the two.
        let a = half + root;
        [a, b, (pid.kp - a * b).max(f64::MIN_POSITIVE)]
    }

    /// The vector of a controller of this shape, moved into the ranges.
    pub fn vector(&self, c: &Controller) -> Vec<f64> {
        let outside = self.vector_outside(c);
        outside.iter().zip(&self.bounds).map(|(x, [from, to])| x.clamp(*from, *to)).collect()
    }

    /// The same, wherever it lies.
    pub(super) fn vector_outside(&self, c: &Controller) -> Vec<f64> {
        let [position, velocity, integral] = Self::cascade(&c.pid);
        let of = |parameter: &TunedNumber| match *parameter {
            TunedNumber::Kp => c.pid.kp,
            TunedNumber::Ki => c.pid.ki_per_s,
            TunedNumber::Kd => c.pid.kd_s,
            TunedNumber::PositionGain => position,
            TunedNumber::VelocityGain => velocity,
            TunedNumber::VelocityIntegral => integral,
            TunedNumber::DerivativeFilter => c.pid.derivative_filter_s,
            TunedNumber::LowpassFrequency { filter } => c.lowpass[filter].frequency_hz,
            TunedNumber::NotchFrequency { filter } => c.notch[filter].frequency_hz,
            TunedNumber::NotchDepth { filter } => {
                c.notch[filter].zero_damping_ratio / c.notch[filter].pole_damping_ratio
            }
            TunedNumber::NotchPoleDamping { filter } => c.notch[filter].pole_damping_ratio,
        };
        self.free.iter().map(|p| of(p).max(f64::MIN_POSITIVE).ln()).collect()
    }

    /// Whether a controller has the filters that the vector sets.
    pub fn fits(&self, c: &Controller) -> bool {
        c.sample_time_s == self.base.sample_time_s
            && c.lowpass.len() == self.base.lowpass.len()
            && c.notch.len() == self.base.notch.len()
            && c.biquad == self.base.biquad
    }

    /// Puts the vector into `c`, a copy of [`Parameters::base`], without allocating.
    pub fn put(&self, x: &[f64], c: &mut Controller) {
        let mut cascade = [0.0; 3];
        for (x, &parameter) in x.iter().zip(&self.free) {
            let value = x.exp();
            match parameter {
                TunedNumber::PositionGain => cascade[0] = value,
                TunedNumber::VelocityGain => cascade[1] = value,
                TunedNumber::VelocityIntegral => cascade[2] = value,
                _ => {
                    if let Some(number) = Self::raw(c, parameter) {
                        *number = value;
                    }
                }
            }
        }
        if self.kind == ControllerKind::PPi {
            let [a, b, i] = cascade;
            (c.pid.kp, c.pid.ki_per_s, c.pid.kd_s) = (a * b + i, a * i, b);
        }
        for (x, parameter) in x.iter().zip(&self.free) {
            if let TunedNumber::NotchDepth { filter } = *parameter {
                let notch = &mut c.notch[filter];
                notch.zero_damping_ratio = x.exp() * notch.pole_damping_ratio;
            }
        }
    }

    /// The controller of a vector.
    pub fn controller(&self, x: &[f64]) -> Controller {
        let mut c = self.base.clone();
        self.put(x, &mut c);
        c
    }

    /// Index of the section that parameter `i` acts on, in the firmware's order.
    pub fn section_of(&self, i: usize) -> usize {
        match self.free[i] {
            TunedNumber::LowpassFrequency { filter } => 1 + filter,
            TunedNumber::NotchFrequency { filter }
            | TunedNumber::NotchDepth { filter }
            | TunedNumber::NotchPoleDamping { filter } => 1 + self.base.lowpass.len() + filter,
            _ => 0,
        }
    }

    /// Whether parameter `i` is one of the gains that set the loop's size.
    pub(super) fn is_gain(&self, i: usize) -> bool {
        matches!(
            self.free[i],
            TunedNumber::Kp
                | TunedNumber::Ki
                | TunedNumber::Kd
                | TunedNumber::VelocityGain
                | TunedNumber::VelocityIntegral
        )
    }

    /// ln ki and its slope over the vector, for the objective `integral`; none without an integral gain.
    pub(super) fn ln_integral(&self, c: &Controller) -> Option<(f64, Vec<f64>)> {
        if c.pid.ki_per_s <= 0.0 {
            return None;
        }
        let slope = |p: &TunedNumber| match p {
            TunedNumber::Ki | TunedNumber::PositionGain | TunedNumber::VelocityIntegral => 1.0,
            _ => 0.0,
        };
        Some((c.pid.ki_per_s.ln(), self.free.iter().map(slope).collect()))
    }
}

/// Frequencies (Hz) of the profile's run-out orders, the strongest first.
fn strongest_orders(spec: &Spec) -> Vec<f64> {
    let Some(noise) = spec.profile.as_ref().map(|p| &p.noise) else { return Vec::new() };
    let mut orders: Vec<_> = noise.runout.iter().filter(|r| r.amplitude > 0.0).collect();
    orders.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude).then(a.order.cmp(&b.order)));
    orders.iter().map(|r| f64::from(r.order) * noise.spindle_hz).filter(|hz| *hz > 0.0).collect()
}

/// The firmware's sections of a controller, into `chain`, without allocating; false where the numbers make no filter.
pub(super) fn chain_of(c: &Controller, chain: &mut Vec<Section>) -> bool {
    let t = c.sample_time_s;
    chain.clear();
    chain.push(c.pid.section(t));
    let lowpass = c.lowpass.iter().map(|l| Section::lowpass(l.frequency_hz, l.damping_ratio, t));
    let notch = c.notch.iter().map(|n| Section::notch(n.frequency_hz, n.zero_damping_ratio, n.pole_damping_ratio, t));
    for section in lowpass.chain(notch) {
        match section {
            Ok(s) => chain.push(s),
            Err(_) => return false,
        }
    }
    chain.extend(&c.biquad);
    true
}
