//! Coordinates in which the programme is well conditioned: around the best unconstrained taps, scaled by what each direction costs.
//!
//! The window's error is thousands of limits under no control and a fraction of one under good control; a solver that starts from taps
//! of 0 loses all digits to that. q = centre + W y, with W such that the energy of the move in both bands, a share of the energy of S and a
//! little of the taps are y'y. Without the share of S, what the bands do not see would be measured by taps alone, and a demand on |S| would stand thousands
//! of times larger in the programme than the objective.

use super::energy::Affine;
use nalgebra::{DMatrix, DVector};

/// The coordinates.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    centre: DVector<f64>,
    /// Taps of each coordinate, by columns.
    way: DMatrix<f64>,
}

/// Share of the length of S in that of a point. Loops of the class have a length of S below their Ms (Parseval).
const SENSITIVITY: f64 = 0.3;
/// Share of the taps (in their unit): only for directions that neither the bands nor S sees.
const TAPS: f64 = 1e-6;

impl Basis {
    /// `rows` over the taps, each times its `scale`; `plant`: the pulse response that the taps pass; `unit`: the size of ordinary taps.
    pub fn of(rows: &[(&Affine, f64)], plant: &[f64], unit: f64) -> Basis {
        // The taps' own rows stand below: the singular values then never vanish, and no square is formed.
        let (count, taps) = (rows.len(), plant.len());
        let stack = DMatrix::from_fn(count + 2 * taps, taps, |i, j| match rows.get(i) {
            Some((a, scale)) => a.row[j] * scale * unit,
            None if i - count < taps => {
                let k = i - count;
                if k >= j { -SENSITIVITY * plant[k - j] * unit } else { 0.0 }
            }
            None if i - count - taps == j => TAPS,
            None => 0.0,
        });
        let constant = DVector::from_fn(count + 2 * taps, |i, _| match rows.get(i) {
            Some((a, scale)) => a.constant * scale,
            None if i == count => SENSITIVITY,
            None => 0.0,
        });
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

    /// Affine functions of the taps, by rows, over the coordinates: coefficients, the constants in a last column.
    pub fn turned(&self, rows: &DMatrix<f64>, constant: &DVector<f64>) -> DMatrix<f64> {
        let n = self.way.ncols();
        let mut all = (rows * &self.way).insert_column(n, 0.0);
        all.set_column(n, &(constant + rows * &self.centre));
        all
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
