//! The same machine in other units and at another rate: positions, commands and times of a case, its plant and its controller, times constants.
//!
//! Physics knows no unit: what is found in tracks and volts at 25 kHz is to be found in millimetres and amperes at 1 kHz.

use servotune::controller::{Controller, Pid};
use servotune::lti::{Body, Plant};
use servotune::recording::{Case, Record};

/// Factors from a machine's own units to others.
#[derive(Clone, Copy)]
pub(super) struct Scale {
    pub position_unit: &'static str,
    pub command_unit: &'static str,
    pub position: f64,
    pub command: f64,
    pub time: f64,
}

impl Scale {
    /// Case, plant without modes, and controller in the other units.
    pub fn applied(&self, (case, plant, controller): (Case, Plant, Controller)) -> (Case, Plant, Controller) {
        let records = case.records.into_iter().map(|(entry, record)| (entry, self.record(record))).collect();
        let case = Case { spindle_hz: case.spindle_hz.map(|hz| hz / self.time), records, ..case };
        (case, self.plant(plant), self.controller(controller))
    }

    fn record(&self, r: Record) -> Record {
        let times = |series: Vec<f64>, by: f64| series.into_iter().map(|v| v * by).collect::<Vec<f64>>();
        Record {
            sample_time_s: r.sample_time_s * self.time,
            reference: r.reference.map(|s| times(s, self.position)),
            excitation: times(r.excitation, self.command),
            command: times(r.command, self.command),
            position: times(r.position, self.position),
            ..r
        }
    }

    fn plant(&self, p: Plant) -> Plant {
        let gain = self.position / self.command;
        let body = match p.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } => Body::SecondOrder {
                dc_gain: dc_gain * gain,
                natural_frequency_rad_s: natural_frequency_rad_s / self.time,
                damping_ratio,
            },
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => Body::FreeInertia {
                acceleration_gain: acceleration_gain * gain / self.time.powi(2),
                viscous_rate_per_s: viscous_rate_per_s / self.time,
            },
            other => other,
        };
        Plant {
            position_unit: self.position_unit.into(),
            command_unit: self.command_unit.into(),
            body,
            delay_s: p.delay_s * self.time,
            ..p
        }
    }

    fn controller(&self, c: Controller) -> Controller {
        let gain = self.command / self.position;
        Controller {
            sample_time_s: c.sample_time_s * self.time,
            output_limit: c.output_limit.map(|u| u * self.command),
            pid: Pid {
                kp: c.pid.kp * gain,
                ki_per_s: c.pid.ki_per_s * gain / self.time,
                kd_s: c.pid.kd_s * gain * self.time,
                derivative_filter_s: c.pid.derivative_filter_s * self.time,
            },
            ..c
        }
    }
}
