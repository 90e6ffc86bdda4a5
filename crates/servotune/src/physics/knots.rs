//! Where the values of a curve stand: at places over one argument, or at every pair of a position and a velocity.
//!
//! In: places. Out: their roughness, and what lies between them. Convention: over two arguments the position is outermost. A surface is a
//! natural cubic spline over the position at every velocity, straight between neighbouring velocities, level beyond the last of either.

use crate::lti::CurveKnot;
use crate::numeric::spline::{Spline, roughness_rows};
use nalgebra::DMatrix;

/// The places of a curve's values.
#[derive(Clone, Debug, PartialEq)]
pub struct Knots {
    /// The argument, strictly ascending; over two arguments the positions.
    pub at: Vec<f64>,
    /// The velocities, strictly ascending; none of a curve over one argument.
    pub velocity: Vec<f64>,
}

impl Knots {
    /// Over one argument.
    pub fn line(at: Vec<f64>) -> Knots {
        Knots { at, velocity: Vec::new() }
    }

    /// As a plant file gives those of a curve over one argument; what is wrong with them otherwise.
    pub(super) fn line_of(knots: &[CurveKnot]) -> Result<Knots, String> {
        if let Some(k) = knots.iter().find(|k| k.velocity.is_some()) {
            return Err(format!(
                "found a velocity in the knot at {}; expected none but in torque over position_and_velocity",
                k.at
            ));
        }
        if let Some(w) = knots.windows(2).find(|w| w[1].at <= w[0].at) {
            return Err(format!("found a knot at {} behind one at {}; expected them ascending", w[1].at, w[0].at));
        }
        Ok(Knots::line(knots.iter().map(|k| k.at).collect()))
    }

    /// The same over position and velocity: the same velocities at every position.
    pub(super) fn grid_of(knots: &[CurveKnot]) -> Result<Knots, String> {
        let place = |k: &CurveKnot| match k.velocity {
            Some(v) if v.is_finite() => Ok((k.at, v)),
            Some(v) => Err(format!("found velocity = {v} in the knot at {}; expected a finite number", k.at)),
            None => Err(format!("the knot at {} has no velocity; over position_and_velocity every knot has one", k.at)),
        };
        let places = knots.iter().map(place).collect::<Result<Vec<_>, _>>()?;
        let across = places.iter().take_while(|p| p.0 == places[0].0).count();
        let velocity: Vec<f64> = places[..across].iter().map(|p| p.1).collect();
        let at: Vec<f64> = places.iter().step_by(across).map(|p| p.0).collect();
        if at.len() < 2 || across < 2 {
            return Err(format!(
                "found {} positions with {across} velocities; expected at least 2 of each, the positions outermost",
                at.len()
            ));
        }
        let of = Knots { at, velocity };
        let whole = places.len() == of.count() && places.iter().enumerate().all(|(i, p)| of.place(i) == [p.0, p.1]);
        let ascending = |all: &[f64]| all.windows(2).all(|w| w[0] < w[1]);
        if !whole || !ascending(&of.at) || !ascending(&of.velocity) {
            return Err(
                "the knots make no grid; expected positions ascending and at each of them the same velocities, ascending"
                    .into(),
            );
        }
        Ok(of)
    }

    /// Values to a place of `at`.
    fn across(&self) -> usize {
        self.velocity.len().max(1)
    }

    /// How many values there are.
    pub fn count(&self) -> usize {
        self.at.len() * self.across()
    }

    /// Argument and velocity of one value; the velocity is 0 over one argument.
    pub fn place(&self, i: usize) -> [f64; 2] {
        [self.at[i / self.across()], self.velocity.get(i % self.across()).copied().unwrap_or(0.0)]
    }

    /// First and last place of `at`.
    pub fn ends(&self) -> [f64; 2] {
        [self.at[0], self.at[self.at.len() - 1]]
    }

    /// Rows whose squares, times the values, add up to the roughness. Over two arguments the position counts in its range and the velocity
    /// in knots: they lie as dense as laws turn there.
    pub fn roughness(&self) -> DMatrix<f64> {
        if self.velocity.is_empty() {
            return roughness_rows(&self.at);
        }
        let (n, across) = (self.at.len(), self.across());
        let even = |count: usize| -> Vec<f64> { (0..count).map(|k| k as f64 / (count - 1) as f64).collect() };
        let [low, high] = self.ends();
        let along = roughness_rows(&self.at.iter().map(|a| (a - low) / (high - low)).collect::<Vec<_>>());
        let over = roughness_rows(&even(across));
        let mut all = DMatrix::zeros(along.nrows() * across + over.nrows() * n, n * across);
        for j in 0..across {
            for (r, c) in (0..along.nrows()).flat_map(|r| (0..n).map(move |c| (r, c))) {
                all[(j * along.nrows() + r, c * across + j)] = along[(r, c)];
            }
        }
        let from = along.nrows() * across;
        for i in 0..n {
            all.view_mut((from + i * over.nrows(), i * across), over.shape()).copy_from(&over);
        }
        all
    }
}

/// A torque over position and velocity.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// Over the position, one a velocity.
    along: Vec<Spline>,
    velocity: Vec<f64>,
}

impl Surface {
    /// Through values at two velocities or more.
    pub fn of(knots: &Knots, value: &[f64]) -> Surface {
        let across = knots.across();
        let at = |j: usize| value.iter().skip(j).step_by(across).copied().collect();
        let along = (0..across).map(|j| Spline::new(knots.at.clone(), at(j))).collect();
        Surface { along, velocity: knots.velocity.clone() }
    }

    /// The value at a position and a velocity.
    pub fn value(&self, x: f64, v: f64) -> f64 {
        let v = v.clamp(self.velocity[0], self.velocity[self.velocity.len() - 1]);
        let j = self.velocity.partition_point(|a| *a <= v).clamp(1, self.velocity.len() - 1);
        let share = (v - self.velocity[j - 1]) / (self.velocity[j] - self.velocity[j - 1]);
        (1.0 - share) * self.along[j - 1].held(x) + share * self.along[j].held(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    fn grid() -> Knots {
        Knots { at: vec![-3.0, -1.0, 0.5, 2.0, 4.0], velocity: vec![-9.0, -1.0, 0.0, 1.0, 9.0, 20.0] }
    }

    fn values(of: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        (0..grid().count()).map(|i| grid().place(i)).map(|[x, v]| of(x, v)).collect()
    }

    #[test]
    fn a_plane_is_a_plane_inside_and_level_beyond() {
        let plane = |x: f64, v: f64| 2.0 - 0.3 * x + 0.7 * v;
        let s = Surface::of(&grid(), &values(plane));
        for (x, v) in [(-5.0_f64, -20.0_f64), (-3.0, -9.0), (0.2, 0.4), (1.9, -0.01), (8.0, 31.0)] {
            let truth = plane(x.clamp(-3.0, 4.0), v.clamp(-9.0, 20.0));
            assert!((s.value(x, v) - truth).abs() < 1e-12, "{x} {v}");
        }
    }

    #[test]
    fn what_is_straight_from_knot_to_knot_has_no_roughness_and_what_bends_has_some() {
        let place = |v: f64| grid().velocity.iter().position(|a| *a == v).map_or(0.0, |j| j as f64);
        let rough = |value: Vec<f64>| (grid().roughness() * DVector::from_vec(value)).norm_squared();
        assert!(rough(values(|x, v| 1.0 + x + place(v))) < 1e-20);
        // Both ways bend by themselves: the sum over all lines of either.
        let along = (roughness_rows(&[0.0, 2.0 / 7.0, 0.5, 5.0 / 7.0, 1.0])
            * DVector::from_vec(vec![9.0, 1.0, 0.25, 4.0, 16.0]))
        .norm_squared();
        assert!((rough(values(|x, _| x * x)) / (6.0 * along) - 1.0).abs() < 1e-12);
        assert!(rough(values(|_, v| place(v).powi(2))) > 1.0);
    }
}
