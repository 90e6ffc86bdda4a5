//! The write in a search's inner loop: the same equations as [`Scene::run`], laid out for speed.
//!
//! In: a scene and its plant, once; then a chain of sections, thousands of times. Out: the window's PES and the largest command.
//! Terms lie in arrays of fixed length, readings are kept for the window only. Sums run in another order than in
//! [`Scene::run`], so the two agree to rounding, not to the bit; a test holds them together.

use super::Scene;
use super::simulation::Workspace;
use crate::controller::Feedforward;
use crate::lti::{DiscretePlant, Section};

/// A scene laid out for one plant.
#[derive(Clone, Debug)]
pub struct QuickScene(Layout);

#[derive(Clone, Debug)]
enum Layout {
    Two(Box<Terms<2>>),
    Four(Box<Terms<4>>),
    Eight(Box<Terms<8>>),
    Sixteen(Box<Terms<16>>),
    /// A double integrator or more terms than any of the above: the plain way.
    Any(Box<(Scene, DiscretePlant)>),
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub struct QuickWork {
    /// The window's PES.
    pub window: Vec<f64>,
    /// Commands with windage, D + 1 zeros ahead of sample 0.
    acting: Vec<f64>,
    plain: Option<Box<Workspace>>,
}

#[derive(Clone, Debug)]
struct Terms<const N: usize> {
    lambda: [[f64; N]; 2],
    now: [[f64; N]; 2],
    before: [[f64; N]; 2],
    whole: usize,
    /// Reference less encoder noise.
    target: Vec<f64>,
    windage: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    /// First sample at which anything moves.
    first: usize,
    readings: Vec<Reading<N>>,
}

#[derive(Clone, Debug)]
struct Reading<const N: usize> {
    sample: usize,
    target: f64,
    states: [[f64; N]; 2],
    inputs: [f64; 2],
}

fn padded<const N: usize>(x: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| x.get(i).copied().unwrap_or(0.0))
}

impl QuickScene {
    /// Lays a scene out for its plant.
    pub fn of(scene: Scene, plant: &DiscretePlant) -> QuickScene {
        let n = plant.numbers();
        QuickScene(match n.lambda[0].len() {
            _ if n.rigid => Layout::Any(Box::new((scene, plant.clone()))),
            0..=2 => Layout::Two(Box::new(Terms::of(&scene, plant))),
            3..=4 => Layout::Four(Box::new(Terms::of(&scene, plant))),
            5..=8 => Layout::Eight(Box::new(Terms::of(&scene, plant))),
            9..=16 => Layout::Sixteen(Box::new(Terms::of(&scene, plant))),
            _ => Layout::Any(Box::new((scene, plant.clone()))),
        })
    }

    /// Runs the write; the window's PES lies in `work`, the largest |command| is returned.
    pub fn run(
        &self,
        chain: &[Section],
        feedforward: Option<&Feedforward>,
        output_limit: Option<f64>,
        work: &mut QuickWork,
    ) -> f64 {
        match &self.0 {
            Layout::Two(t) => t.run(chain, feedforward, output_limit, work),
            Layout::Four(t) => t.run(chain, feedforward, output_limit, work),
            Layout::Eight(t) => t.run(chain, feedforward, output_limit, work),
            Layout::Sixteen(t) => t.run(chain, feedforward, output_limit, work),
            Layout::Any(any) => {
                let (scene, plant) = any.as_ref();
                let plain = work.plain.get_or_insert_with(|| Box::new(scene.workspace(plant, chain.len())));
                scene.run(plant, chain, feedforward, output_limit, plain);
                work.window.clear();
                work.window.extend_from_slice(scene.window(plain));
                plain.command.iter().fold(0.0, |a, u| u.abs().max(a))
            }
        }
    }
}

impl<const N: usize> Terms<N> {
    fn of(scene: &Scene, plant: &DiscretePlant) -> Terms<N> {
        let n = plant.numbers();
        let pair = |x: [&[f64]; 2]| [padded(x[0]), padded(x[1])];
        let [from, to] = scene.window;
        let reading = |s: &super::simulation::ServoSample| Reading {
            sample: s.controller_sample,
            target: s.target,
            states: pair(s.reading.states()),
            inputs: s.reading.inputs(),
        };
        Terms {
            lambda: pair(n.lambda),
            now: pair(n.now),
            before: pair(n.before),
            whole: n.whole,
            target: scene.reference.iter().zip(&scene.encoder).map(|(r, e)| r - e).collect(),
            windage: scene.windage.clone(),
            velocity: scene.velocity.clone(),
            acceleration: scene.acceleration.clone(),
            first: scene.first,
            readings: scene.servo[from..to].iter().map(reading).collect(),
        }
    }

    fn run(&self, chain: &[Section], ff: Option<&Feedforward>, limit: Option<f64>, work: &mut QuickWork) -> f64 {
        // A length known to the compiler keeps the chain in registers; longer chains than any firmware's take the slice.
        match chain.len() {
            1 => self.run_chain(&mut memory::<1>(chain), ff, limit, work),
            2 => self.run_chain(&mut memory::<2>(chain), ff, limit, work),
            3 => self.run_chain(&mut memory::<3>(chain), ff, limit, work),
            4 => self.run_chain(&mut memory::<4>(chain), ff, limit, work),
            5 => self.run_chain(&mut memory::<5>(chain), ff, limit, work),
            6 => self.run_chain(&mut memory::<6>(chain), ff, limit, work),
            _ => {
                let mut long: Vec<_> = chain.iter().map(|s| (*s, [0.0; 2])).collect();
                self.run_chain(long.as_mut_slice(), ff, limit, work)
            }
        }
    }

    #[inline(always)]
    fn run_chain<M: AsMut<[(Section, [f64; 2])]> + ?Sized>(
        &self,
        memory: &mut M,
        ff: Option<&Feedforward>,
        limit: Option<f64>,
        work: &mut QuickWork,
    ) -> f64 {
        let ticks = self.target.len();
        let lag = self.whole + 1;
        work.acting.clear();
        work.acting.resize(ticks + lag, 0.0);
        work.window.clear();
        let limit = limit.unwrap_or(f64::INFINITY);
        let forward = ff.map_or([0.0; 2], |f| [f.factor * f.velocity_s, f.factor * f.acceleration_s2]);
        let forwards = forward != [0.0; 2];
        let (mut re, mut im) = ([0.0f64; N], [0.0f64; N]);
        let mut peak = 0.0f64;
        let mut next = 0;
        while next < self.readings.len() && self.readings[next].sample < self.first {
            work.window.push(self.readings[next].target);
            next += 1;
        }
        let mut due = self.readings.get(next).map_or(usize::MAX, |r| r.sample);
        let acting = &mut work.acting[..ticks + lag];
        let (target, windage) = (&self.target[..ticks], &self.windage[..ticks]);
        for k in self.first..ticks {
            let mut signal = target[k] - sum(&re);
            for (s, m) in memory.as_mut() {
                let out = s.b0 * signal + m[0];
                m[0] = (s.b1 * signal + m[1]) - s.a1 * out;
                m[1] = s.b2 * signal - s.a2 * out;
                signal = out;
            }
            if forwards {
                signal += forward[0] * self.velocity[k] + forward[1] * self.acceleration[k];
            }
            let u = signal.clamp(-limit, limit);
            peak = peak.max(u.abs());
            acting[k + lag] = u + windage[k];
            let (now, before) = (acting[k + 1], acting[k]);
            while due == k {
                let r = &self.readings[next];
                let mut position = [0.0; N];
                for i in 0..N {
                    position[i] = r.states[0][i] * re[i] + r.states[1][i] * im[i];
                }
                work.window.push(r.target - (sum(&position) + r.inputs[0] * now + r.inputs[1] * before));
                next += 1;
                due = self.readings.get(next).map_or(usize::MAX, |r| r.sample);
            }
            for i in 0..N {
                let (a, b) = (re[i], im[i]);
                let driven_re = self.now[0][i] * now + self.before[0][i] * before;
                let driven_im = self.now[1][i] * now + self.before[1][i] * before;
                re[i] = (self.lambda[0][i] * a - self.lambda[1][i] * b) + driven_re;
                im[i] = (self.lambda[1][i] * a + self.lambda[0][i] * b) + driven_im;
            }
        }
        peak
    }
}

/// The chain at rest, its length known.
fn memory<const S: usize>(chain: &[Section]) -> [(Section, [f64; 2]); S] {
    std::array::from_fn(|i| (chain[i], [0.0; 2]))
}

/// A sum by halves: short in time, and in a fixed order.
#[inline]
fn sum<const N: usize>(x: &[f64; N]) -> f64 {
    let mut partial = *x;
    let mut width = N;
    while width > 1 {
        width /= 2;
        for i in 0..width {
            partial[i] += partial[i + width];
        }
    }
    partial[0]
}
