//! Numbers of twice the working precision: the unevaluated sum of two doubles.
//!
//! In: doubles. Out: sums and products right to about 2^-100 of themselves. Used where a computation is to be judged by a better one.
//! Source: T. J. Dekker, Numerische Mathematik 18 (1971); D. Knuth, The Art of Computer Programming 2, 4.2.2.

use std::ops::{Add, Mul, Neg, Sub};

/// `high + low`, with |low| at most half a last digit of `high`.
///
/// ```
/// use servotune::numeric::twofold::Twofold;
/// let third = Twofold::from(1.0).over(3.0);
/// let off = third * Twofold::from(3.0) - Twofold::from(1.0);
/// assert!(off.value().abs() < 1e-31);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twofold {
    high: f64,
    low: f64,
}

impl From<f64> for Twofold {
    fn from(x: f64) -> Twofold {
        Twofold { high: x, low: 0.0 }
    }
}

/// a + b and what the sum lost.
fn sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let part = s - a;
    (s, (a - (s - part)) + (b - part))
}

impl Twofold {
    /// The nearest double.
    pub fn value(self) -> f64 {
        self.high + self.low
    }

    /// Divided by a double.
    pub fn over(self, x: f64) -> Twofold {
        let first = self.high / x;
        let left = self - Twofold::from(first) * Twofold::from(x);
        let second = left.high / x;
        let left = left - Twofold::from(second) * Twofold::from(x);
        Twofold::from(first) + Twofold::from(second) + Twofold::from(left.high / x)
    }
}

impl Add for Twofold {
    type Output = Twofold;
    fn add(self, other: Twofold) -> Twofold {
        let (s, e) = sum(self.high, other.high);
        let (t, f) = sum(self.low, other.low);
        let (s, e) = sum(s, e + t);
        let (high, low) = sum(s, e + f);
        Twofold { high, low }
    }
}

impl Neg for Twofold {
    type Output = Twofold;
    fn neg(self) -> Twofold {
        Twofold { high: -self.high, low: -self.low }
    }
}

impl Sub for Twofold {
    type Output = Twofold;
    fn sub(self, other: Twofold) -> Twofold {
        self + -other
    }
}

impl Mul for Twofold {
    type Output = Twofold;
    fn mul(self, other: Twofold) -> Twofold {
        let p = self.high * other.high;
        // What the product lost, exactly.
        let e = self.high.mul_add(other.high, -p);
        let (high, low) = sum(p, e + (self.high * other.low + self.low * other.high));
        Twofold { high, low }
    }
}

/// e^A of a square matrix given by rows: Taylor's series of A/2^k, squared k times. Right to some 1e-28 of the norms that occur.
///
/// ```
/// use servotune::numeric::twofold::exponential;
/// let turn = exponential(&[vec![0.0, 1.0], vec![-1.0, 0.0]], 0.5);
/// assert!((turn[0][0].value() - 0.5f64.cos()).abs() < 1e-16 && (turn[0][1].value() - 0.5f64.sin()).abs() < 1e-16);
/// ```
pub fn exponential(rows: &[Vec<f64>], time: f64) -> Vec<Vec<Twofold>> {
    let n = rows.len();
    let norm = rows.iter().map(|r| r.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max) * time.abs();
    let halvings = norm.max(1e-300).log2().ceil().max(0.0) as i32 + 2;
    let scale = 0.5f64.powi(halvings);
    let a: Vec<Vec<Twofold>> = rows
        .iter()
        .map(|r| r.iter().map(|x| Twofold::from(*x) * Twofold::from(time) * Twofold::from(scale)).collect())
        .collect();
    let product = |x: &[Vec<Twofold>], y: &[Vec<Twofold>]| -> Vec<Vec<Twofold>> {
        (0..n)
            .map(|i| {
                let mut row = vec![Twofold::default(); n];
                for (x, y) in x[i].iter().zip(y).filter(|(x, _)| x.high != 0.0) {
                    for (r, y) in row.iter_mut().zip(y).filter(|(_, y)| y.high != 0.0) {
                        *r = *r + *x * *y;
                    }
                }
                row
            })
            .collect()
    };
    let one = |i: usize, j: usize| Twofold::from(if i == j { 1.0 } else { 0.0 });
    // Horner: 1 + A (1 + A/2 (1 + A/3 ...)). At norm 1/4, 20 terms leave 1e-31.
    let mut e: Vec<Vec<Twofold>> = (0..n).map(|i| (0..n).map(|j| one(i, j)).collect()).collect();
    for k in (1..=20).rev() {
        e = product(&a, &e);
        for (i, row) in e.iter_mut().enumerate() {
            for (j, x) in row.iter_mut().enumerate() {
                *x = x.over(f64::from(k)) + one(i, j);
            }
        }
    }
    for _ in 0..halvings {
        e = product(&e, &e);
    }
    e
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_and_products_keep_what_doubles_lose() {
        let (a, b) = (Twofold::from(1.0), Twofold::from(1e-20));
        assert_eq!(((a + b) - a).value(), 1e-20);
        // (1 + e)² - 1 - 2 e = e² with e = 2^-40: far below the last digit of a double.
        let e = Twofold::from(0.5f64.powi(40));
        let square = (a + e) * (a + e) - a - e - e;
        assert_eq!(square.value(), 0.5f64.powi(80));
    }

    #[test]
    fn the_exponential_of_a_pair_is_its_closed_form() {
        // e^{[[0, w], [-w, -2 d]] t} of a decaying turn, by its sine and cosine.
        let (w, d, t): (f64, f64, f64) = (7000.0, 60.0, 39.6e-6);
        let e = exponential(&[vec![0.0, w], vec![-w, -2.0 * d]], t);
        let v = (w * w - d * d).sqrt();
        let (s, c, f) = ((v * t).sin(), (v * t).cos(), (-d * t).exp());
        // The closed form itself is of doubles.
        assert!((e[0][0].value() - f * (c + d / v * s)).abs() < 1e-15);
        assert!((e[0][1].value() - f * w / v * s).abs() < 1e-15);
        assert!((e[1][1].value() - f * (c - d / v * s)).abs() < 1e-15);
    }
}
