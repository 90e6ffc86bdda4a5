//! A product of factors around the middle of a cell: value, slope, and bounds over the whole cell.
//!
//! Away from its root a factor is carried as its logarithm: values multiply, slopes and bounds of the second derivative add, and the
//! latter is one over the squared distance of the root from the cell, which is exact. A zero in or beside the cell has no
//! logarithm there and is carried plainly, by the bounds of its value and its first two derivatives. No grid enters.

use nalgebra::Complex;

/// A zero carried plainly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Jet {
    pub value: Complex<f64>,
    /// Derivative at the middle.
    pub first: Complex<f64>,
    /// Bounds of |f|, |f'| and |f''| over the cell.
    pub bounds: [f64; 3],
    /// Bound of the rounding of `value`.
    pub rounding: f64,
}

impl Jet {
    /// From the derivatives at the middle and the bound of the second over the cell.
    pub fn of(value: Complex<f64>, first: Complex<f64>, second: f64, half: f64, rounding: f64) -> Jet {
        let steep = first.norm() + half * second;
        Jet { value, first, bounds: [value.norm() + half * steep + rounding, steep, second], rounding }
    }

    fn times(self, o: Jet) -> Jet {
        let ([a0, a1, a2], [b0, b1, b2]) = (self.bounds, o.bounds);
        Jet {
            value: self.value * o.value,
            first: self.first * o.value + self.value * o.first,
            bounds: [a0 * b0, a1 * b0 + a0 * b1, a2 * b0 + 2.0 * a1 * b1 + a0 * b2],
            rounding: self.rounding * b0 + a0 * o.rounding,
        }
    }
}

/// A product of factors over one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Expansion {
    /// The product at the middle, without the zeros carried plainly.
    pub value: Complex<f64>,
    /// d ln / d angle of that, angle = w T.
    pub slope: Complex<f64>,
    /// Bound of |d² ln / d angle²| over the cell.
    pub bend: f64,
    /// Bound of the relative rounding of `value`.
    pub rounding: f64,
    /// Zeros in or beside the cell.
    pub zeros: Option<Jet>,
}

/// A product evaluated: value, derivative, and bounds over the cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Term {
    pub value: Complex<f64>,
    pub first: Complex<f64>,
    /// Largest size over the cell.
    pub most: f64,
    /// Bound of |f(x) - f(c) - f'(c)(x - c)| over the cell, rounding included.
    pub remainder: f64,
}

impl Expansion {
    /// The factor 1.
    pub const ONE: Expansion = Expansion {
        value: Complex::new(1.0, 0.0),
        slope: Complex::new(0.0, 0.0),
        bend: 0.0,
        rounding: 4.0 * f64::EPSILON,
        zeros: None,
    };

    /// A zero carried plainly.
    pub fn plain(jet: Jet) -> Expansion {
        Expansion { zeros: Some(jet), ..Expansion::ONE }
    }

    /// The product of two.
    #[inline]
    pub fn times(self, o: Expansion) -> Expansion {
        Expansion {
            value: self.value * o.value,
            slope: self.slope + o.slope,
            bend: self.bend + o.bend,
            rounding: self.rounding + o.rounding + 2.0 * f64::EPSILON,
            zeros: match (self.zeros, o.zeros) {
                (Some(a), Some(b)) => Some(a.times(b)),
                (a, b) => a.or(b),
            },
        }
    }

    /// The quotient by a product without plain zeros.
    #[inline]
    pub fn over(self, o: Expansion) -> Expansion {
        Expansion {
            value: self.value / o.value,
            slope: self.slope - o.slope,
            bend: self.bend + o.bend,
            rounding: self.rounding + o.rounding + 8.0 * f64::EPSILON,
            zeros: self.zeros,
        }
    }

    /// The product over the cell of this half width: remainder half² / 2 max|f''|, with f'' = f ((ln f)'² + (ln f)'') for the
    /// logarithmic part.
    #[inline]
    pub fn term(&self, half: f64) -> Term {
        let steep = self.slope.norm_sqr().sqrt() + half * self.bend;
        let size = self.value.norm();
        let most = size * (half * steep).exp() * (1.0 + self.rounding);
        let bounds = [most, most * steep, most * (steep * steep + self.bend)];
        let first = self.value * self.slope;
        match self.zeros {
            None => {
                Term { value: self.value, first, most, remainder: 0.5 * half * half * bounds[2] + self.rounding * size }
            }
            Some(z) => {
                let whole = Jet { value: self.value, first, bounds, rounding: self.rounding * size }.times(z);
                let [most, _, second] = whole.bounds;
                let remainder = 0.5 * half * half * second + whole.rounding;
                Term { value: whole.value, first: whole.first, most, remainder }
            }
        }
    }
}
