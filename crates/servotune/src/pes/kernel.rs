//! The closed loop laid out for vector registers: what drives it, what a run leaves behind, the buffers of a thread.
//!
//! In: a plant in lanes, what drives the records, a chain. Out: readings, commands and the signals between sections ([`super::forward`]);
//! the slope of a figure in every coefficient of the chain ([`super::backward`]). Products and sums are fused where that is written: the
//! bits do not depend on the processor.

use crate::lti::{CHUNK, PlantLanes, Section};

/// States of one chunk in R records: real, imaginary.
pub(super) type States<const R: usize> = [[[f64; CHUNK]; R]; 2];

/// One reading of the position between controller samples.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub sample: usize,
    pub target: f64,
    /// Gains of u[k-D] and u[k-D-1].
    pub gains: [f64; 2],
}

/// What a loop needs that is the same for all its records.
#[derive(Clone, Debug)]
pub(super) struct Loop {
    pub plant: PlantLanes,
    pub readings: Vec<Reading>,
    /// Weights of the states in each reading, chunk by chunk.
    pub weights: Vec<[[f64; CHUNK]; 2]>,
    /// Of the reference: central differences, as many samples longer than the records as a feed-forward may be ahead.
    pub velocity: Vec<f64>,
    pub acceleration: Vec<f64>,
}

/// What drives R records side by side.
#[derive(Clone, Debug)]
pub(super) struct Drive<const R: usize> {
    /// Reference less encoder noise.
    pub target: Vec<[f64; R]>,
    pub windage: Vec<[f64; R]>,
    /// First sample at which anything moves.
    pub first: usize,
}

/// What one record leaves behind.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    /// First sample that was run; everything before it is 0.
    pub first: usize,
    /// One more than the last sample that was run.
    pub end: usize,
    /// Readings.
    pub readings: Vec<f64>,
    /// Command at every sample.
    pub command: Vec<f64>,
    /// Signals before, between and after the sections, one row each with two zeros ahead; empty where not asked for.
    pub signals: Vec<f64>,
    /// Length of a row.
    pub stride: usize,
    /// The output limit it ran under.
    pub limit: f64,
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffers<const R: usize> {
    pub acting: Vec<[f64; R]>,
    pub memory: Vec<[[f64; R]; 2]>,
    pub law: Vec<[f64; 5]>,
    pub states: Vec<States<R>>,
    /// Backward: weights of readings and of positions, adjoints by section.
    pub weighed: Vec<[f64; R]>,
    pub placed: Vec<[f64; R]>,
    pub rows: Vec<f64>,
}

impl<const R: usize> Buffers<R> {
    /// Ready for a run of `acting` samples that act on the plant.
    pub fn begin(&mut self, run: &Run<'_>, acting: usize) {
        self.law.clear();
        self.law.extend(run.chain.iter().map(|s| [s.b0, s.b1, s.b2, -s.a1, -s.a2]));
        self.memory.clear();
        self.memory.resize(run.chain.len(), [[0.0; R]; 2]);
        self.acting.clear();
        self.acting.resize(acting, [0.0; R]);
    }
}

/// How one run goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run<'a> {
    pub chain: &'a [Section],
    /// Gains of the reference's velocity and acceleration.
    pub forward: [f64; 2],
    /// Samples they are ahead.
    pub ahead: usize,
    pub limit: f64,
    /// Samples to run.
    pub end: usize,
    /// Whether signals are kept for a backward pass.
    pub kept: bool,
}

/// A figure's slopes in what a record gave, each empty where the figure does not see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<'a> {
    pub readings: &'a [f64],
    /// Slopes in commands, from a sample on.
    pub command: (usize, &'a [f64]),
    /// Slopes in positions at controller samples.
    pub positions: &'a [f64],
}

/// Slopes of one figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Slopes {
    /// In b0, b1, b2, a1, a2 of every section, in the chain's order.
    pub sections: Vec<[f64; 5]>,
    /// In the feed-forward's gains of velocity and acceleration, factor included: factor velocity_s and factor acceleration_s2.
    pub forward: [f64; 2],
}

/// a b + c, number by number, each rounded once. Arrays by value: what the compiler keeps in one register.
#[inline(always)]
pub(super) fn fused<const N: usize>(a: [f64; N], b: [f64; N], c: [f64; N]) -> [f64; N] {
    let mut out = c;
    for j in 0..N {
        out[j] = a[j].mul_add(b[j], c[j]);
    }
    out
}

/// a b, number by number.
#[inline(always)]
pub(super) fn times<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    let mut out = a;
    for j in 0..N {
        out[j] = a[j] * b[j];
    }
    out
}

/// a + b, number by number.
#[inline(always)]
pub(super) fn plus<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    let mut out = a;
    for j in 0..N {
        out[j] = a[j] + b[j];
    }
    out
}

/// The sum of a chunk, in a fixed order.
#[inline(always)]
pub(super) fn across(x: &[f64; CHUNK]) -> f64 {
    (x[0] + x[1]) + (x[2] + x[3])
}
