//! What a table must stand in one slot: the response as measured, and the same machine warmer, colder and as far off as the model may be.
//!
//! In: the measured response, the identified plant with plants drawn from its covariance, temperatures. Out: [`Evidence`], the cases.
//! A warmer machine is the measured response with its gain, its frequency axis and its dead time moved; a drawn plant acts as the ratio of
//! its response to the identified one, so that every case keeps what was measured. Case 0 is the response as it is.

use super::settings::{Robust, Temperature};
use nalgebra::Complex;
use servotune::frf::{Frf, FrfShapeError};
use servotune::lti::{Body, FrequencyResponse, Plant};
use servotune::tune::Machine;

/// One case.
#[derive(Clone, Debug)]
struct Case {
    name: String,
    frf: Frf,
    /// How the plant goes on outside the sweep.
    plant: Plant,
}

impl Case {
    fn machine(&self) -> Machine<'_> {
        Machine::Response { frf: &self.frf, continuation: Some(&self.plant) }
    }
}

/// All cases of a slot.
#[derive(Clone, Debug)]
pub struct Evidence {
    cases: Vec<Case>,
}

/// A change of temperature as it acts on a response.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shift {
    gain: f64,
    frequency: f64,
    delay_s: f64,
}

impl Temperature {
    fn shift(&self, from_c: f64, to_c: f64) -> Shift {
        let by = to_c - from_c;
        Shift {
            gain: (self.gain_per_c * by).exp(),
            frequency: (self.frequency_per_c * by).exp(),
            delay_s: self.delay_per_c * by,
        }
    }
}

impl Shift {
    const NONE: Shift = Shift { gain: 1.0, frequency: 1.0, delay_s: 0.0 };

    /// The plant with its gain, natural frequencies and dead time moved.
    fn of_plant(self, plant: &Plant) -> Plant {
        let mut p = plant.clone();
        match &mut p.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s, .. } => {
                *dc_gain *= self.gain;
                *natural_frequency_rad_s *= self.frequency;
            }
            // A free inertia has no frequency of its own.
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
                *acceleration_gain *= self.gain * self.frequency * self.frequency;
                *viscous_rate_per_s *= self.frequency;
            }
            // As a stretch of the frequency axis: P(s/f) gain.
            Body::Rational(r) => {
                r.gain *= self.gain * self.frequency.powi(r.relative_degree() as i32);
                r.zeros.iter_mut().chain(&mut r.poles).for_each(|x| *x *= self.frequency);
            }
        }
        for m in &mut p.modes {
            m.zero_rad_s *= self.frequency;
            m.pole_rad_s *= self.frequency;
        }
        p.delay_s = (p.delay_s + self.delay_s).max(0.0);
        p
    }

    /// The same for a response: P'(jw) = gain P(jw / f), with the dead time as it was plus the change.
    fn of_frf(self, frf: &Frf, delay_s: f64) -> Result<Frf, FrfShapeError> {
        let f = self.frequency;
        // On the stretched axis the dead time has become delay / f.
        let late = (delay_s + self.delay_s).max(0.0) - delay_s / f;
        let w: Vec<f64> = frf.w_rad_s().iter().map(|w| w * f).collect();
        let turned = |(v, w): (&Complex<f64>, &f64)| v * Complex::from_polar(self.gain, -w * late);
        let value = frf.value().iter().zip(&w).map(turned).collect();
        frf.alike(w, value, frf.relative_std().map(<[f64]>::to_vec))
    }
}

impl Evidence {
    /// The cases: as measured; then temperatures and drawn plants dealt out together, as many as the longer list has.
    pub fn of(
        frf: &Frf,
        plant: &Plant,
        drawn: &[Plant],
        measured_c: f64,
        temperature: &Temperature,
    ) -> Result<Evidence, FrfShapeError> {
        let mut cases = vec![Case { name: "as measured".into(), frf: frf.clone(), plant: plant.clone() }];
        let temperatures = &temperature.cases_c;
        for i in 0..temperatures.len().max(drawn.len()) {
            let to_c = (!temperatures.is_empty()).then(|| temperatures[i % temperatures.len()]);
            let shift = to_c.map_or(Shift::NONE, |c| temperature.shift(measured_c, c));
            let draw = (!drawn.is_empty()).then(|| &drawn[i % drawn.len()]);
            let (mut case, mut model) = (frf.clone(), plant.clone());
            if let Some(draw) = draw {
                let value = frf.w_rad_s().iter().zip(frf.value()).map(|(&w, v)| v * draw.at(w) / plant.at(w)).collect();
                case = frf.alike(frf.w_rad_s().to_vec(), value, frf.relative_std().map(<[f64]>::to_vec))?;
                model = draw.clone();
            }
            let words =
                [to_c.map(|c| format!("at {c} deg C")), draw.map(|_| format!("model draw {}", i % drawn.len() + 1))];
            let name = words.into_iter().flatten().collect::<Vec<_>>().join(", ");
            cases.push(Case { name, frf: shift.of_frf(&case, model.delay_s)?, plant: shift.of_plant(&model) });
        }
        Ok(Evidence { cases })
    }

    /// The cases as machines to be tuned or judged; the first is the response as measured.
    pub fn machines(&self) -> Vec<Machine<'_>> {
        self.cases.iter().map(Case::machine).collect()
    }

    /// The same cases, each with another response and another plant.
    pub(super) fn each(
        &self,
        change: impl Fn(&Frf, &Plant) -> Result<(Frf, Plant), FrfShapeError>,
    ) -> Result<Evidence, FrfShapeError> {
        let of = |c: &Case| {
            let (frf, plant) = change(&c.frf, &c.plant)?;
            Ok(Case { name: c.name.clone(), frf, plant })
        };
        Ok(Evidence { cases: self.cases.iter().map(of).collect::<Result<_, _>>()? })
    }

    /// The plants of the cases, in their order.
    pub fn plants(&self) -> impl Iterator<Item = &Plant> {
        self.cases.iter().map(|c| &c.plant)
    }

    /// How many cases.
    pub fn count(&self) -> usize {
        self.cases.len()
    }

    /// Name of a case.
    pub fn case(&self, index: usize) -> &str {
        self.cases.get(index).map_or("", |c| &c.name)
    }

    /// The response as measured.
    pub fn frf(&self) -> &Frf {
        &self.cases[0].frf
    }
}

impl Robust {
    /// Seed of the draws of one slot: the same slot draws the same plants in every run.
    pub(super) fn seed_of(&self, index: usize) -> u64 {
        self.seed ^ (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    }
}
