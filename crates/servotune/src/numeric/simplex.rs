//! The least of a function without slopes: the simplex of Nelder and Mead.
//!
//! In: the first vertices and the function. Out: the best vertex. Source: J. Nelder, R. Mead, The Computer Journal 7, 1965.

use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::neldermead::NelderMead;
use std::cell::RefCell;

/// A function as argmin wants it.
struct Function<F>(RefCell<F>);

impl<F: FnMut(&[f64]) -> f64> CostFunction for Function<F> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        Ok((self.0.borrow_mut())(x))
    }
}

/// The vertex with the least value after at most `steps` rounds from these `vertices`, one more than there are numbers; earlier where the values
/// spread by less than `spread` (standard deviation). None where the method cannot begin.
pub fn simplex(
    vertices: Vec<Vec<f64>>,
    spread: f64,
    steps: u64,
    function: impl FnMut(&[f64]) -> f64,
) -> Option<Vec<f64>> {
    let solver = NelderMead::new(vertices).with_sd_tolerance(spread).ok()?;
    let run = Executor::new(Function(RefCell::new(function)), solver);
    run.configure(|s| s.max_iters(steps)).timer(false).run().ok()?.state.best_param
}
