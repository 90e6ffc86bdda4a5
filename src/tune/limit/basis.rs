//! Coordinates in which the programme is well conditioned: around the best unconstrained taps, scaled by what each direction costs.
//!
//! The window's error is thousands of limits under no control and a fraction of one under good control; a solver that starts from taps
//! of 0 loses all digits to that. q = centre + W y, with W such that the energy of both bands plus a little of the taps is y'y.

use super::energy::Affine;
use nalgebra::{DMatrix, DVector};

/// The coordinates.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    centre: DVector<f64>,
    /// Taps of each coordinate, by columns.
    way: DMatrix<f64>,
}

/// Size of the taps (in their unit) that counts like one limit.
const TAPS: f64 = 1e-3;

impl Basis {
    /// `rows` over the taps, each times its `scale`; `unit`: the size of ordinary taps.
    pub fn of(rows: &[(&Affine, f64)], taps: usize, unit: f64) -> Basis {
        // The taps' own rows stand below: the singular values then never vanish, and no square is formed.
        let count = rows.len();
        let stack = DMatrix::from_fn(count + taps, taps, |i, j| match rows.get(i) {
            Some((a, scale)) => a.row[j] * scale * unit,
            None if i - count == j => TAPS,
            None => 0.0,
        });
        let constant = DVector::from_fn(count + taps, |i, _| rows.get(i).map_or(0.0, |(a, scale)| a.constant * scale));
        let qr = stack.qr();
        let (q, r) = (qr.q(), qr.r());
        // y = R (q - centre)/unit: the stacked length of a step is that of its coordinates.
        let back = r.clone().try_inverse().unwrap_or_else(|| DMatrix::identity(taps, taps));
        let centre = -(&back * q.tr_mul(&constant)) * unit;
        Basis { centre, way: back * unit }
    }

    /// The taps of a point.
    pub fn taps(&self, y: &[f64]) -> Vec<f64> {
        (&self.centre + &self.way * DVector::from_column_slice(y)).iter().copied().collect()
    }

    /// An affine function of the taps over the coordinates: coefficients, then `gaps` zeros, then the constant.
    pub fn row(&self, a: &Affine, scale: f64, gaps: usize) -> Vec<f64> {
        let row = DVector::from_column_slice(&a.row);
        let mut turned: Vec<f64> = self.way.tr_mul(&row).iter().map(|x| x * scale).collect();
        turned.resize(turned.len() + gaps, 0.0);
        turned.push((a.constant + row.dot(&self.centre)) * scale);
        turned
    }
}
