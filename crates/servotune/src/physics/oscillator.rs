//! A mass on a spring, exactly sampled: w²/(s² + 2 z w s + w²) and w s/(s² + 2 z w s + w²) of an input held between samples.
//!
//! In: frequency, damping ratio, sample time. Out: two responses in the unit of the input. Closed form of the matrix
//! exponential about the forced rest position; `specs/mismatch.md`.

/// The oscillator's state and its step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Oscillator {
    /// Own, cross and rate terms of the step.
    own: f64,
    cross: f64,
    rate: f64,
    /// Response of w²/(...) and of w s/(...).
    state: [f64; 2],
}

impl Oscillator {
    /// At rest; `damping` within 0 to 1, both excluded.
    pub(super) fn at_rest(w: f64, damping: f64, step: f64) -> Oscillator {
        let damping = damping.clamp(0.0, 1.0 - 1e-9);
        let root = ((1.0 - damping) * (1.0 + damping)).sqrt();
        let (sin, cos) = (w * root * step).sin_cos();
        let keep = (-damping * w * step).exp();
        let lean = damping / root * sin;
        Oscillator { own: keep * (cos + lean), cross: keep * sin / root, rate: keep * (cos - lean), state: [0.0; 2] }
    }

    /// Both responses one sample on, under a constant input.
    pub(super) fn next(&self, input: f64) -> [f64; 2] {
        let off = self.state[0] - input;
        [input + self.own * off + self.cross * self.state[1], -self.cross * off + self.rate * self.state[1]]
    }

    /// Takes the step.
    pub(super) fn advance(&mut self, input: f64) {
        self.state = self.next(input);
    }
}
