//! Poles of the closed loop, by eigenvalues: another way to stability than the Nyquist count.

use super::{FeedbackError, Margins, ModelLoop, margins};
use crate::lti::{DiscretePlant, Section};
use crate::numeric::dense::eigenvalues;
use crate::numeric::powers::powers_vanish;
use nalgebra::{Complex, DMatrix};

/// The poles in z of plant, delay line and sections under negative feedback, by decreasing size.
pub fn closed_loop_poles(l: &ModelLoop<'_>) -> Result<Vec<Complex<f64>>, FeedbackError> {
    poles_of(&closed_loop_matrix(l.plant(), &l.sections().chain))
}

fn poles_of(a: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, FeedbackError> {
    let order = a.nrows();
    let mut poles = eigenvalues(a).ok_or(FeedbackError::Poles { order })?;
    poles.sort_by(|a, b| b.norm().total_cmp(&a.norm()).then(b.im.total_cmp(&a.im)));
    Ok(poles)
}

/// A pole this close to the unit circle counts for either side: the eigenvalues of a matrix of order 40 are no surer.
const ON_THE_CIRCLE: f64 = 1e-6;
/// Largest order whose eigenvalues are asked: their work grows with its cube, and a delay of a thousand samples would take minutes.
const LARGEST: usize = 400;

/// Margins whose stability verdict the closed loop's matrix confirms: two algorithms that share no code. Refused where they disagree.
pub fn confirmed_margins(l: &ModelLoop<'_>) -> Result<Margins, FeedbackError> {
    let judged = margins(l);
    let order = l.plant().poles().len() + l.plant().whole_delay_samples() + 1 + 2 * l.sections().chain.len();
    if order > LARGEST {
        return Ok(judged);
    }
    let a = closed_loop_matrix(l.plant(), &l.sections().chain);
    // Powers that vanish say that no pole is outside, in a fraction of the time; all else is told by the eigenvalues.
    if judged.unstable_poles == 0 && powers_vanish(&a) {
        return Ok(judged);
    }
    let poles = poles_of(&a)?;
    let surely = poles.iter().filter(|z| z.norm() > 1.0 + ON_THE_CIRCLE).count() as i64;
    let possibly = poles.iter().filter(|z| z.norm() > 1.0 - ON_THE_CIRCLE).count() as i64;
    if (surely..=possibly).contains(&judged.unstable_poles) {
        return Ok(judged);
    }
    let largest = poles.first().map_or(0.0, |z| z.norm());
    Err(FeedbackError::Disagreement { by_count: judged.unstable_poles, by_eigenvalues: surely, largest })
}

/// x[k+1] = A x[k]; x is modal states, the commands u[k-1]..u[k-D-1], two states a section.
fn closed_loop_matrix(plant: &DiscretePlant, chain: &[Section]) -> DMatrix<f64> {
    let rows = plant.real_form();
    let n = rows.output.len();
    let delays = plant.whole_delay_samples() + 1;
    let order = n + delays + 2 * chain.len();
    let mut a = DMatrix::zeros(order, order);

    // The command u[k] as a row over the state: sections in transposed form, output b0 x + s1, fed by e = -y.
    let mut signal = nalgebra::RowDVector::<f64>::zeros(order);
    for j in 0..n {
        signal[j] = -rows.output[j];
    }
    for (i, s) in chain.iter().enumerate() {
        let (s1, s2) = (n + delays + 2 * i, n + delays + 2 * i + 1);
        let input = signal.clone();
        signal *= s.b0;
        signal[s1] += 1.0;
        // s1' = b1 x - a1 y + s2, s2' = b2 x - a2 y.
        let mut row1 = &input * s.b1 - &signal * s.a1;
        row1[s2] += 1.0;
        let row2 = &input * s.b2 - &signal * s.a2;
        a.set_row(s1, &row1);
        a.set_row(s2, &row2);
    }
    // The delay line: its entry 0 is u[k-1]; u[k-D] is entry D-1, or the command itself where D = 0.
    let line = |lag: usize| n + lag - 1;
    a.set_row(line(1), &signal);
    for lag in 2..=delays {
        a[(line(lag), line(lag - 1))] = 1.0;
    }
    let d = plant.whole_delay_samples();
    for i in 0..n {
        for j in 0..n {
            a[(i, j)] = rows.state[(i, j)];
        }
        a[(i, line(d + 1))] += rows.before[i];
        if d == 0 {
            for j in 0..order {
                a[(i, j)] += rows.now[i] * signal[j];
            }
        } else {
            a[(i, line(d))] += rows.now[i];
        }
    }
    a
}
