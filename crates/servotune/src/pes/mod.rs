//! The position error signal of a spiral write: reference, closed loop in time, figures of the window.
//!
//! In: a sampled plant, a controller, a profile. Out: PES at the servo clock and its DFT, eqs. (40)-(44).
//! Convention: PES = reference - position (+ run-out), amplitude |X_k|/N; spec: `specs/pes.md`.

mod backward;
mod budget;
mod correlate;
mod dft;
mod expected;
mod figures;
mod forward;
mod kernel;
mod noise;
mod noise_power;
mod physical;
mod profile;
mod profile_keys;
mod quick;
mod reference;
mod simulation;
mod spectral;
mod spectral_adjoint;
mod spectral_parts;
mod spectral_slopes;
mod step;
mod window_frame;

pub use budget::{
    Budget, PesSource, PredictSettings, PredictedRange, Prediction, SourceShare, budget, predict, predict_each,
};
pub use dft::{Harmonic, WindowDft};
pub use expected::{ExpectedNoise, NoiseWork};
pub use figures::{HIGH_BAND_HZ, LOW_BAND_HZ, PesFigures, figures};
pub use kernel::Slopes;
pub use noise::runout;
pub use noise_power::{NoisePower, NoisePowerWork, coloured, tabulated};
pub use physical::{context, simulate_physical};
pub use profile::{Noise, PesClock, Profile, ProfileError, Runout, Spiral};
pub use profile_keys::PROFILE_KEYS;
pub use quick::{Asked, Figure, QuickScene, QuickWork, WriteRecord};
pub use reference::Reference;
pub use simulation::{ClosedLoop, PesError, WriteScene, WriteWorkspace, simulate};
pub use spectral::{SpectralPes, SpectralWork};
pub use spectral_parts::{BinParts, SpectralParts};
pub use step::{StepScene, StepWork};
