//! Interpolation that does not overshoot: monotone cubics between given points.
//!
//! In: points with ascending x. Out: values between them; nothing is extrapolated.

/// A monotone piecewise cubic (Steffen, Astron. Astrophys. 239, 1990): between two points it never leaves their range.
#[derive(Clone, Debug, PartialEq)]
pub struct MonotoneCubic {
    x: Vec<f64>,
    y: Vec<f64>,
    slope: Vec<f64>,
}

impl MonotoneCubic {
    /// Through the points; `x` ascends strictly and both columns have one length, at least 1.
    pub fn new(x: Vec<f64>, y: Vec<f64>) -> MonotoneCubic {
        let n = x.len().min(y.len());
        let mut slope = vec![0.0; n];
        let chord = |i: usize| (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
        for i in 0..n {
            slope[i] = match (i, n) {
                (_, 1) => 0.0,
                (0, _) => chord(0),
                (i, n) if i + 1 == n => chord(i - 1),
                _ => {
                    let (left, right) = (chord(i - 1), chord(i));
                    let (a, b) = (x[i] - x[i - 1], x[i + 1] - x[i]);
                    let parabola = (left * b + right * a) / (a + b);
                    let sign = if left * right > 0.0 { left.signum() } else { 0.0 };
                    sign * 2.0 * left.abs().min(right.abs()).min(0.5 * parabola.abs())
                }
            };
        }
        MonotoneCubic { x, y, slope }
    }

    /// Index of the interval that holds `x`; the first or last one outside.
    pub fn interval(&self, x: f64) -> usize {
        self.x.partition_point(|&k| k <= x).saturating_sub(1).min(self.x.len().saturating_sub(2))
    }

    /// The value at `x`; beyond the points, the value of the nearest one.
    pub fn at(&self, x: f64) -> f64 {
        if self.x.len() < 2 {
            return self.y.first().copied().unwrap_or(f64::NAN);
        }
        let i = self.interval(x);
        let h = self.x[i + 1] - self.x[i];
        let t = ((x - self.x[i]) / h).clamp(0.0, 1.0);
        let (y0, y1, m0, m1) = (self.y[i], self.y[i + 1], self.slope[i] * h, self.slope[i + 1] * h);
        let u = 1.0 - t;
        u * u * ((1.0 + 2.0 * t) * y0 + t * m0) + t * t * ((3.0 - 2.0 * t) * y1 - u * m1)
    }

    /// Given y values.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// Given x values.
    pub fn x(&self) -> &[f64] {
        &self.x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_a_line_and_no_value_leaves_the_range_of_its_neighbours() {
        let line = MonotoneCubic::new(vec![0.0, 1.0, 3.0, 4.0], vec![1.0, 3.0, 7.0, 9.0]);
        for i in 0..=40 {
            let x = 0.1 * f64::from(i);
            assert!((line.at(x) - (1.0 + 2.0 * x)).abs() < 1e-14);
        }
        let step = MonotoneCubic::new(vec![0.0, 1.0, 2.0, 3.0], vec![0.0, 0.0, 1.0, 1.0]);
        assert!((0..=300).map(|i| step.at(0.01 * f64::from(i))).all(|y| (0.0..=1.0).contains(&y)));
        assert_eq!((step.at(-1.0), step.at(9.0)), (0.0, 1.0));
    }
}
