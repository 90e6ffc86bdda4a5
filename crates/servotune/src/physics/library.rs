//! The list of effects, one line each in the order of the report, and the one type that the list makes of all laws.
//!
//! In: the files of the laws ([`Parametric`]). Out: [`AnyLaw`], a law of any of them with its numbers; [`Effect`], what is known of one before
//! it has numbers. A new law is a file and a line here (`specs/mismatch.md`, "Adding a law").

use super::effect::{Facts, Given, Law, Parametric, PhysicsError, ShownOver};
use super::parameter::Parameter;
use super::sample::MotionScene;
use super::share::Share;
use super::{
    aliased_mode, broadband_disturbance, controller_mismatch, encoder_noise, free_form, jitter, linear_parameters,
    lost_samples, misalignment, quantisation, time_base_drift, unexplained,
};
use std::marker::PhantomData;

/// Makes one type of all laws, the lists of their effects, and `each!`, which does the same with whichever law it is.
macro_rules! laws {
    (
        ($d:tt)
        searched { $(use super::$file:ident::$law:ident;)* }
        estimated { $(use super::$curve_file:ident::$curve:ident;)* }
        unnamed { $(use super::$free_file:ident::$free:ident;)* }
    ) => {
        $(use super::$file::$law;)*
        $(use super::$curve_file::$curve;)*
        $(use super::$free_file::$free;)*

        /// A law of the library with its numbers.
        #[derive(Clone, Debug, PartialEq)]
        #[allow(missing_docs, reason = "each is documented in its own file")]
        pub enum AnyLaw {
            $($law($law),)*
            $($curve($curve),)*
            $($free($free),)*
        }

        laws! { @from $($law)* $($curve)* $($free)* }

        static SEARCHED: &[&dyn Effect] = &[$(&Kind::<$law>(PhantomData),)*];
        static ESTIMATED: &[&dyn Effect] = &[$(&Kind::<$curve>(PhantomData),)*];

        macro_rules! each {
            ($d any:expr, $d law:ident => $d what:expr) => {
                match $d any {
                    $(AnyLaw::$law($d law) => $d what,)*
                    $(AnyLaw::$curve($d law) => $d what,)*
                    $(AnyLaw::$free($d law) => $d what,)*
                }
            };
        }
    };
    (@from $($law:ident)*) => {
        $(impl From<$law> for AnyLaw {
            fn from(law: $law) -> AnyLaw {
                AnyLaw::$law(law)
            }
        })*
    };
}

// The lines begin at the margin, where the test of circles reads them.
laws! {
    ($)
    searched {
use super::pivot_friction::PivotFriction;
use super::coulomb_friction::CoulombFriction;
use super::bearing_bias::BearingBias;
use super::cable_spring::CableSpring;
use super::nonlinear_spring::NonlinearSpring;
use super::torque_factor_rolloff::TorqueFactorRolloff;
use super::torque_ripple::TorqueRipple;
use super::current_saturation::CurrentSaturation;
use super::slew_limit::SlewLimit;
use super::dead_band::DeadBand;
use super::amplifier_lag::AmplifierLag;
use super::extra_delay::ExtraDelay;
use super::sensor_lag::SensorLag;
use super::gain_drift::GainDrift;
use super::parametric_gain::ParametricGain;
use super::encoder_cyclic_error::EncoderCyclicError;
use super::encoder_scale_error::EncoderScaleError;
use super::unmodelled_resonance::UnmodelledResonance;
use super::mode_shift::ModeShift;
use super::base_mode::BaseMode;
use super::modal_damping::ModalDamping;
use super::backlash::Backlash;
use super::repeatable_runout::RepeatableRunout;
use super::line_disturbance::LineDisturbance;
use super::shock::Shock;
use super::offset_drift::OffsetDrift;
use super::aerodynamic_drag::AerodynamicDrag;
    }
    estimated {
use super::sensor_curve::SensorCurve;
    }
    unnamed {
use super::free_form::FreeForm;
    }
}

/// A law with its numbers and its strengths, one a column.
#[derive(Clone, Debug, PartialEq)]
pub struct LawSetting {
    /// The law.
    pub law: AnyLaw,
    /// Strengths, in the law's own order; of every record one after another where they differ from record to record.
    pub strengths: Vec<f64>,
}

impl LawSetting {
    /// A law with strengths.
    pub fn new(law: impl Into<AnyLaw>, strengths: Vec<f64>) -> LawSetting {
        LawSetting { law: law.into(), strengths }
    }

    /// A law whose strength is 1 by definition.
    pub fn fixed(law: impl Into<AnyLaw>) -> LawSetting {
        LawSetting::new(law, vec![1.0])
    }

    /// What is known of it beforehand.
    pub fn facts(&self) -> &'static Facts {
        self.law.facts()
    }

    /// [`Parametric::parameters`].
    pub fn parameters(&self, scene: &MotionScene) -> Vec<Parameter> {
        each!(&self.law, law => law.parameters(&self.strengths, scene))
    }

    /// [`Parametric::is_possible`].
    pub fn is_possible(&self, errors: &[f64]) -> bool {
        each!(&self.law, law => law.is_possible(&self.strengths, errors))
    }

    /// [`Parametric::stiffness`].
    pub fn stiffness(&self) -> f64 {
        each!(&self.law, law => law.stiffness(&self.strengths))
    }

    /// [`Parametric::response_share`].
    pub fn response_share(&self, scene: &MotionScene, w_rad_s: f64) -> Share {
        each!(&self.law, law => law.response_share(&self.strengths, scene, w_rad_s))
    }
}

impl AnyLaw {
    /// What is known of it beforehand.
    pub fn facts(&self) -> &'static Facts {
        each!(self, law => law.facts())
    }

    /// The effect that it is one of.
    pub fn effect(&self) -> &'static dyn Effect {
        each!(self, law => kind_of(law))
    }

    /// Its numbers that are measures, each at the place that it has in every form of the law; none where this form has it not.
    pub fn numbers(&self) -> Vec<Option<f64>> {
        self.clone().numbers_mut().into_iter().map(|n| n.copied()).collect()
    }

    /// The number at a place.
    pub fn number(&self, place: usize) -> Option<f64> {
        self.numbers().get(place).copied().flatten()
    }

    /// Its first number, by which several of one effect are told apart; 0 where it has none.
    pub fn first_number(&self) -> f64 {
        self.number(0).unwrap_or(0.0)
    }

    /// The same law with another number at a place; the law as it is where it has none there.
    pub fn with_number(&self, place: usize, number: f64) -> AnyLaw {
        let mut other = self.clone();
        if let Some(Some(n)) = other.numbers_mut().into_iter().nth(place) {
            *n = number;
        }
        other
    }

    /// The same law with other numbers, as many as [`AnyLaw::numbers`] gives; what this form has not stays out.
    pub fn with_numbers(&self, numbers: &[f64]) -> AnyLaw {
        let mut other = self.clone();
        for (slot, number) in other.numbers_mut().into_iter().zip(numbers) {
            if let Some(slot) = slot {
                *slot = *number;
            }
        }
        other
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        each!(self, law => law.numbers_mut())
    }

    /// Whether the search may go from one to the other by their numbers alone.
    pub fn same_class(&self, other: &AnyLaw) -> bool {
        let class = |any: &AnyLaw| each!(any, law => law.class());
        std::mem::discriminant(self) == std::mem::discriminant(other) && class(self) == class(other)
    }

    /// [`Parametric::member`].
    pub fn member(&self) -> usize {
        each!(self, law => law.member())
    }

    /// [`Parametric::told`].
    pub fn told(&self) -> usize {
        each!(self, law => law.told())
    }

    /// Numbers and choices of the law in its fullest form.
    pub fn size(&self) -> usize {
        self.numbers().len() + each!(self, law => law.choices()).len()
    }

    /// [`Parametric::in_motion`].
    pub fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        each!(self, law => law.in_motion(scene))
    }

    /// [`Parametric::presliding_length`].
    pub fn presliding_length(&self) -> Option<f64> {
        each!(self, law => law.presliding_length())
    }

    /// [`Parametric::form_uncertainty`].
    pub fn form_uncertainty(&self, parameter: &str) -> f64 {
        each!(self, law => law.form_uncertainty(parameter))
    }

    /// [`Parametric::measured_in_last_fit`].
    pub fn measured_in_last_fit(&self) -> Vec<(usize, [f64; 2])> {
        each!(self, law => law.measured_in_last_fit())
    }

    /// [`Parametric::fuller`].
    pub fn fuller(&self, scene: &MotionScene) -> Vec<(AnyLaw, Vec<[f64; 2]>)> {
        each!(self, law => law.fuller(scene).into_iter().map(|(law, ranges)| (law.into(), ranges)).collect())
    }

    /// [`Parametric::equivalent`].
    pub fn equivalent(&self) -> Option<AnyLaw> {
        each!(self, law => law.equivalent().map(AnyLaw::from))
    }

    /// [`Parametric::free_motions`].
    pub fn free_motions(&self, scene: &MotionScene, n: usize) -> Vec<Vec<f64>> {
        each!(self, law => law.free_motions(scene, n))
    }

    /// [`Parametric::memory_time_s`].
    pub fn memory_time_s(&self) -> Option<f64> {
        each!(self, law => law.memory_time_s())
    }
}

/// One effect of the library, before it has numbers. Every method is the one of [`Parametric`] by the same name.
#[allow(missing_docs, reason = "documented at Parametric")]
pub trait Effect: Sync {
    /// [`Parametric::known`].
    fn facts(&self) -> &'static Facts;
    fn grid(&self, scene: &MotionScene) -> Vec<AnyLaw>;
    fn setting_of(&self, given: &Given, scene: &MotionScene) -> Result<LawSetting, PhysicsError>;
    fn finer_simulated(&self, place: usize) -> Option<f64>;
    fn shown_over(&self) -> ShownOver;
    fn is_drag(&self) -> bool;
    fn has_own_clock(&self) -> bool;
    fn is_single_event(&self) -> bool;
    fn is_tone(&self) -> bool;
    fn is_wave_over_position(&self) -> bool;
    fn independent_of_motion(&self) -> bool;
    fn is_on_every_machine(&self) -> bool;
    fn may_occur_several_times(&self) -> bool;
    fn is_hard_nonlinearity(&self) -> bool;
    fn acts_on_body(&self) -> bool;
    fn changes_with_amplitude(&self) -> bool;
}

/// The effect whose laws are these.
struct Kind<L>(PhantomData<fn() -> L>);

fn kind_of<L: Parametric + 'static>(_: &L) -> &'static dyn Effect
where
    AnyLaw: From<L>,
{
    &Kind::<L>(PhantomData)
}

impl<L: Parametric> Effect for Kind<L>
where
    AnyLaw: From<L>,
{
    fn facts(&self) -> &'static Facts {
        L::known()
    }

    fn grid(&self, scene: &MotionScene) -> Vec<AnyLaw> {
        L::grid(scene).into_iter().map(AnyLaw::from).collect()
    }

    fn setting_of(&self, given: &Given, scene: &MotionScene) -> Result<LawSetting, PhysicsError> {
        L::setting_of(given, scene).map(|(law, strengths)| LawSetting::new(law, strengths))
    }

    fn finer_simulated(&self, place: usize) -> Option<f64> {
        L::finer_simulated(place)
    }

    fn shown_over(&self) -> ShownOver {
        L::shown_over()
    }

    fn is_drag(&self) -> bool {
        L::is_drag()
    }

    fn has_own_clock(&self) -> bool {
        L::has_own_clock()
    }

    fn is_single_event(&self) -> bool {
        L::is_single_event()
    }

    fn is_tone(&self) -> bool {
        L::is_tone()
    }

    fn is_wave_over_position(&self) -> bool {
        L::is_wave_over_position()
    }

    fn independent_of_motion(&self) -> bool {
        L::independent_of_motion()
    }

    fn is_on_every_machine(&self) -> bool {
        L::is_on_every_machine()
    }

    fn may_occur_several_times(&self) -> bool {
        L::may_occur_several_times()
    }

    fn is_hard_nonlinearity(&self) -> bool {
        L::is_hard_nonlinearity()
    }

    fn acts_on_body(&self) -> bool {
        L::acts_on_body()
    }

    fn changes_with_amplitude(&self) -> bool {
        L::changes_with_amplitude()
    }
}

/// Every effect that can be simulated and found by its columns.
pub fn library() -> &'static [&'static dyn Effect] {
    SEARCHED
}

/// Effects that can be simulated and are found by the estimation of curves: along a recorded motion they have no columns.
pub fn curves() -> &'static [&'static dyn Effect] {
    ESTIMATED
}

static DATA: &[&Facts] = &[
    &quantisation::FACTS,
    &encoder_noise::FACTS,
    &jitter::FACTS,
    &time_base_drift::FACTS,
    &misalignment::FACTS,
    &lost_samples::FACTS,
    &aliased_mode::FACTS,
    &broadband_disturbance::FACTS,
    &controller_mismatch::FACTS,
    &free_form::FACTS,
    &linear_parameters::FACTS,
    &unexplained::FACTS,
];

/// Effects of data, statistics and bookkeeping: found by their own tests, without columns.
pub fn data_facts() -> &'static [&'static Facts] {
    DATA
}

/// The effect of this name.
pub fn effect(name: &str) -> Option<&'static dyn Effect> {
    library().iter().chain(curves()).copied().find(|e| e.facts().name == name)
}

/// What is known of any name of the contract's list.
pub fn facts(name: &str) -> Option<&'static Facts> {
    let law = effect(name).map(Effect::facts);
    law.or_else(|| data_facts().iter().copied().find(|f| f.name == name))
}
