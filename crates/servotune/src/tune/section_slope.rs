//! How the sections move with the parameters.
//!
//! In: slopes of a figure over the coefficients of the sections. Out: slopes over the parameters. Spec: `specs/tuning.md`.

use crate::lti::Section;
use crate::pes::Slopes;
use nalgebra::Complex;

/// How the section that a parameter acts on moves with it: d of b0, b1, b2, a1, a2 over the parameter's logarithm.
#[derive(Clone, Copy, Debug)]
pub(super) struct SectionSlope {
    pub section: usize,
    pub of: [f64; 5],
    /// The section a little to either side.
    pub around: [Section; 2],
}

/// Step of a parameter's logarithm for the slopes of coefficients, central: errors of 1e-10 by curvature and 1e-11 by rounding.
pub(super) const SECTION_STEP: f64 = 1e-5;

impl SectionSlope {
    /// d ln of the section's response over the parameter, at z^-1 = `back`.
    pub fn pull(&self, section: &Section, back: Complex<f64>) -> Complex<f64> {
        let [b0, b1, b2, a1, a2] = self.of;
        let top = section.b0 + back * (section.b1 + back * section.b2);
        let under = 1.0 + back * (section.a1 + back * section.a2);
        (b0 + back * (b1 + back * b2)) / top - back * (a1 + back * a2) / under
    }
}

/// Slopes in parameters from slopes in coefficients.
pub(super) fn in_parameters(sections: &Slopes, slopes: &[SectionSlope], out: &mut Vec<f64>) {
    out.clear();
    out.extend(slopes.iter().map(|s| {
        let of = &sections.sections[s.section];
        of.iter().zip(&s.of).map(|(a, b)| a * b).sum::<f64>()
    }));
}
