//! The decision vector: which numbers of a controller are free, between which bounds, and the way there and back.
//!
//! Every free number is searched as its logarithm: gains and frequencies matter by ratio, and none may change its sign.

use super::spec::Spec;
use crate::controller::{Controller, Lowpass, Notch, Pid};
use crate::lti::Section;
use serde::Serialize;

/// One free number of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the names are those of controller.toml; filters are counted from 0")]
pub enum Parameter {
    Kp,
    Ki,
    Kd,
    LowpassFrequency {
        filter: usize,
    },
    NotchFrequency {
        filter: usize,
    },
    /// Zero damping over pole damping, the gain at the centre.
    NotchDepth {
        filter: usize,
    },
    NotchPoleDamping {
        filter: usize,
    },
}

impl std::fmt::Display for Parameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Parameter::Kp => f.write_str("pid.kp"),
            Parameter::Ki => f.write_str("pid.ki_per_s"),
            Parameter::Kd => f.write_str("pid.kd_s"),
            Parameter::LowpassFrequency { filter } => write!(f, "lowpass[{filter}].frequency_hz"),
            Parameter::NotchFrequency { filter } => write!(f, "notch[{filter}].frequency_hz"),
            Parameter::NotchDepth { filter } => {
                write!(f, "notch[{filter}].zero_damping_ratio / pole_damping_ratio")
            }
            Parameter::NotchPoleDamping { filter } => write!(f, "notch[{filter}].pole_damping_ratio"),
        }
    }
}

/// Bounds of a notch's depth: from 40 dB deep to no notch at all.
pub const NOTCH_DEPTH: [f64; 2] = [0.01, 1.0];
/// Bounds of a notch's pole damping: narrower would miss a mode that drifts by 3 %, wider eats phase a decade below.
pub const NOTCH_POLE_DAMPING: [f64; 2] = [0.05, 1.0];
/// Derivative filter where no start controller names one (s), the value of the contract's example.
pub const DERIVATIVE_FILTER_S: f64 = 12e-6;
/// Damping of a low-pass where no start controller names one.
pub const LOWPASS_DAMPING: f64 = 0.7;
/// Centres may not come closer to half the sample rate than this share of it: the prewarping ends there.
pub(super) const BELOW_HALF_RATE: f64 = 0.99;

/// The free numbers and everything that stays.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// The controller that the free numbers are put into.
    base: Controller,
    free: Vec<Parameter>,
    /// Logarithms of the bounds, [from, to].
    bounds: Vec<[f64; 2]>,
}

impl Parameters {
    /// The search of a spec around `start`, or around the defaults at `sample_time_s`.
    ///
    /// The first `search.lowpasses` low-passes and `search.notches` notches are set by the search, further ones of
    /// `start` stay as they are. Derivative filter, low-pass damping, feed-forward and output limit stay `start`'s.
    pub fn of(spec: &Spec, start: Option<&Controller>, sample_time_s: f64) -> Parameters {
        let (s, b) = (&spec.search, &spec.search.bounds);
        let mut base = start.cloned().unwrap_or(Controller {
            sample_time_s,
            output_limit: None,
            pid: Pid {
                kp: b.kp[0],
                ki_per_s: b.ki_per_s[0],
                kd_s: b.kd_s[0],
                derivative_filter_s: DERIVATIVE_FILTER_S,
            },
            lowpass: vec![],
            notch: vec![],
            feedforward: None,
        });
        let end_hz = BELOW_HALF_RATE * 0.5 / base.sample_time_s;
        let frequency = |[from, to]: [f64; 2]| [from.min(end_hz), to.min(end_hz)];
        let (lowpass_hz, notch_hz) = (frequency(b.lowpass_hz), frequency(b.notch_hz));
        while base.lowpass.len() < s.lowpasses {
            base.lowpass.push(Lowpass { frequency_hz: lowpass_hz[1], damping_ratio: LOWPASS_DAMPING });
        }
        while base.notch.len() < s.notches {
            let pole_damping_ratio = 0.3;
            base.notch.push(Notch {
                frequency_hz: notch_hz[1],
                zero_damping_ratio: pole_damping_ratio,
                pole_damping_ratio,
            });
        }
        let mut p = Parameters { base, free: Vec::new(), bounds: Vec::new() };
        p.add(Parameter::Kp, b.kp);
        p.add(Parameter::Ki, b.ki_per_s);
        p.add(Parameter::Kd, b.kd_s);
        for filter in 0..s.lowpasses {
            p.add(Parameter::LowpassFrequency { filter }, lowpass_hz);
        }
        for filter in 0..s.notches {
            p.add(Parameter::NotchFrequency { filter }, notch_hz);
            p.add(Parameter::NotchDepth { filter }, NOTCH_DEPTH);
            p.add(Parameter::NotchPoleDamping { filter }, NOTCH_POLE_DAMPING);
        }
        p
    }

    fn add(&mut self, parameter: Parameter, [from, to]: [f64; 2]) {
        if from == to {
            *Self::raw(&mut self.base, parameter) = from;
        } else {
            self.free.push(parameter);
            self.bounds.push([from.ln(), to.ln()]);
        }
    }

    /// Where the number stands; the depth of a notch is stored as its zero damping and set by [`Self::put`].
    fn raw(c: &mut Controller, parameter: Parameter) -> &mut f64 {
        match parameter {
            Parameter::Kp => &mut c.pid.kp,
            Parameter::Ki => &mut c.pid.ki_per_s,
            Parameter::Kd => &mut c.pid.kd_s,
            Parameter::LowpassFrequency { filter } => &mut c.lowpass[filter].frequency_hz,
            Parameter::NotchFrequency { filter } => &mut c.notch[filter].frequency_hz,
            Parameter::NotchDepth { filter } => &mut c.notch[filter].zero_damping_ratio,
            Parameter::NotchPoleDamping { filter } => &mut c.notch[filter].pole_damping_ratio,
        }
    }

    /// The free numbers, in the order of the vector.
    pub fn free(&self) -> &[Parameter] {
        &self.free
    }

    /// Logarithms of the bounds.
    pub fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    /// The controller that carries the fixed numbers.
    pub fn base(&self) -> &Controller {
        &self.base
    }

    /// The vector of a controller of this shape, moved into the bounds.
    pub fn vector(&self, c: &Controller) -> Vec<f64> {
        let of = |parameter: &Parameter| match *parameter {
            Parameter::Kp => c.pid.kp,
            Parameter::Ki => c.pid.ki_per_s,
            Parameter::Kd => c.pid.kd_s,
            Parameter::LowpassFrequency { filter } => c.lowpass[filter].frequency_hz,
            Parameter::NotchFrequency { filter } => c.notch[filter].frequency_hz,
            Parameter::NotchDepth { filter } => c.notch[filter].zero_damping_ratio / c.notch[filter].pole_damping_ratio,
            Parameter::NotchPoleDamping { filter } => c.notch[filter].pole_damping_ratio,
        };
        let clamped = |(p, [from, to]): (&Parameter, &[f64; 2])| of(p).max(f64::MIN_POSITIVE).ln().clamp(*from, *to);
        self.free.iter().zip(&self.bounds).map(clamped).collect()
    }

    /// Puts the vector into `c`, a copy of [`Parameters::base`], without allocating.
    pub fn put(&self, x: &[f64], c: &mut Controller) {
        for (i, &parameter) in self.free.iter().enumerate() {
            *Self::raw(c, parameter) = x[i].exp();
        }
        for (x, parameter) in x.iter().zip(&self.free) {
            if let Parameter::NotchDepth { filter } = *parameter {
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
            Parameter::Kp | Parameter::Ki | Parameter::Kd => 0,
            Parameter::LowpassFrequency { filter } => 1 + filter,
            Parameter::NotchFrequency { filter }
            | Parameter::NotchDepth { filter }
            | Parameter::NotchPoleDamping { filter } => 1 + self.base.lowpass.len() + filter,
        }
    }
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
    true
}
