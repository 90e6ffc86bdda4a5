//! A pair narrower than its move, cut into pieces of its stretch.
//!
//! In: a pair and its box on the circle. Out: pieces, each with a middle that is exact and a linear part of its own. Spec: `specs/certificate.md`.

use super::contour::Contour;
use super::moves::{Move, Pair, Shares};
use nalgebra::Complex;

/// A pair whose stretch is cut into pieces where its pole is near.
pub(super) struct Cut {
    /// Which pair.
    pub pair: usize,
    /// Points that are near.
    pub near: Vec<usize>,
    /// Pieces of the stretch.
    pub pieces: Vec<Piece>,
}

/// One piece: its middle as a share of the whole half width, and the moves there.
pub(super) struct Piece {
    pub middle: f64,
    /// At each near point: how far the factor has moved at the middle, and its moves about it.
    pub at: Vec<(Complex<f64>, Move)>,
}

/// Half width of a piece over the pole's own.
pub(super) const PIECE: f64 = 0.35;

/// Most pieces of a pair.
pub(super) const PIECES: usize = 64;

/// Relative move of a pole's polynomial from which a point is near it.
pub(super) const NEAR: f64 = 0.12;

pub(super) fn cut(x: &Contour, p: &Pair, shares: Shares, index: usize) -> Option<Cut> {
    let count = (shares[0] / (PIECE * p.width())).ceil() as usize;
    if !(2..=PIECES).contains(&count) {
        return None;
    }
    let near: Vec<usize> = (0..x.s.len()).filter(|i| p.stir(x.s[*i], shares) > NEAR).collect();
    let pieces = (0..count)
        .map(|k| {
            let middle = (2.0 * k as f64 + 1.0) / count as f64 - 1.0;
            let there = p.at([1.0 + middle * shares[0], 1.0, 1.0]);
            let own = [shares[0] / count as f64 / (1.0 + middle * shares[0]), shares[1], shares[2]];
            let at = near
                .iter()
                .map(|i| {
                    let s = x.s[*i];
                    let m = there.moved(s, own, there.reach(s, own));
                    (there.at_unit_rest(s) / p.at_unit_rest(s), m)
                })
                .collect();
            Piece { middle, at }
        })
        .collect();
    Some(Cut { pair: index, near, pieces })
}
