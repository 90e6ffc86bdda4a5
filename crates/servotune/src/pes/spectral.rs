//! The PES of a write from the spectrum: what a measured response says without any model.
//!
//! The move there and the same move back, half a period later, make the reference periodic; E = S (1 - P F) R on its lines.
//! Between its lines nothing is left out; what is neglected: images above half the sample rate, the output limit, and the rest
//! of one move that the next one still sees. Noise enters as expected power. Spec: `specs/tuning.md`, "The measured route".

use super::spectral_adjoint::Adjoint;
use super::window_frame::{FrameKey, LANES, WindowFrame, frame, kernel};
use super::{Noise, PesError, Profile, Reference, WindowDft};
use crate::controller::{Controller, Feedforward};
use crate::feedback::{LoopOnGrid, ResponseCurve, SampledPlant};
use crate::lti::{FrequencyResponse, Section};
use crate::numeric::spectrum::Backward;
use crate::numeric::wide::wide;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Everything of a write that does not depend on the gains.
#[derive(Clone, Debug)]
pub struct SpectralPes {
    lines: SampledPlant,
    dft: WindowDft,
    /// (1 - P F) R on every line, real and imaginary part; filled up with zeros to the frame's width, as are the arrays of `SpectralWork`.
    pub(super) error: [Vec<f64>; 2],
    /// Run-out of every bin, added at the head.
    pub(super) runout: Vec<Complex<f64>>,
    /// What the window sees of every line.
    pub(super) frame: Arc<WindowFrame>,
    /// Densities (per hertz, both signs) of the encoder noise, and of the windage times |P|² on every line.
    pub(super) encoder: f64,
    pub(super) windage: Vec<f64>,
    command: Option<Box<CommandLines>>,
    /// Which lines lie outside the sweep.
    outside: Vec<bool>,
}

/// What the command's peak needs.
#[derive(Clone, Debug)]
struct CommandLines {
    /// The feed-forward's share of the command on every line.
    forward: Vec<Complex<f64>>,
    /// Density of the windage on every line.
    windage: Vec<f64>,
    /// The lines' sum at all instants of half a period at once; instant m lies at m period/(2 N), N the plan's length.
    together: Backward,
    /// e^{j w t} of the first line at the instants at which the command is looked at, and the first of these.
    turns: Vec<Complex<f64>>,
    first: usize,
    /// The plant next to rest, and the mean of the reference: half the distance.
    rest: SampledPlant,
    mean: f64,
    /// Line spacing, both signs counted (Hz).
    spacing_hz: f64,
    samples: f64,
}

/// Buffers for one thread; after [`SpectralPes::write`] they hold what [`SpectralPes::slopes`] needs.
#[derive(Clone, Debug, Default)]
pub struct SpectralWork {
    pub(super) lines: LoopOnGrid,
    rest: LoopOnGrid,
    /// S on every line.
    pub(super) s_re: Vec<f64>,
    pub(super) s_im: Vec<f64>,
    /// What the window's frame is applied to: the line S E, folded, and the density of the noise, folded.
    pub(super) g_re: Vec<f64>,
    pub(super) g_im: Vec<f64>,
    pub(super) density: Vec<f64>,
    /// X of every bin, run-out included, and its expected power.
    pub(super) x: Vec<Complex<f64>>,
    pub(super) power: Vec<f64>,
    pub(super) adjoint: Adjoint,
    /// The command's lines, then its instants; and the transform's own memory.
    command: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

/// Rest after the move before the way back, where the record itself leaves less (s).
const REST_S: f64 = 0.02;
/// How near to rest, as a share of the first line, the command that holds the mean position is taken.
const NEAR_REST: f64 = 1e-2;
/// Instants at which the command is looked at in half a period, at least.
const INSTANTS: usize = 1024;

impl SpectralPes {
    /// The write of `profile` on a measured plant; `bins` of the window are read.
    pub fn new(
        profile: &Profile,
        plant: &ResponseCurve,
        controller: &Controller,
        bins: Vec<usize>,
        command: bool,
    ) -> Result<SpectralPes, PesError> {
        SpectralPes::lasting(profile, plant, controller, bins, command, 1.0)
    }

    /// The same with the way back so many times later: what a slow loop still remembers of one move fades before the next.
    pub fn lasting(
        profile: &Profile,
        plant: &ResponseCurve,
        controller: &Controller,
        bins: Vec<usize>,
        command: bool,
        times: f64,
    ) -> Result<SpectralPes, PesError> {
        profile.check()?;
        controller.check()?;
        let t = plant.sample_time_s();
        let spiral = &profile.spiral;
        let end_s = Reference::of(spiral).end_s();
        let period = 2.0 * times * spiral.duration_s.max(end_s + REST_S);
        // Half-wave symmetry leaves the odd lines.
        let count = ((period * 0.5 / t) as usize).div_ceil(2);
        let w: Vec<f64> = (0..count).map(|i| TAU * (2 * i + 1) as f64 / period).filter(|w| w * t < PI).collect();
        let p: Vec<Complex<f64>> = w.iter().map(|w| plant.at(*w)).collect();
        let forward: Vec<Complex<f64>> =
            w.iter().map(|w| feedforward(controller.feedforward.as_ref(), w * t, t)).collect();
        let reference: Vec<Complex<f64>> = w.iter().map(|w| line(profile, end_s, *w, period)).collect();
        let error: Vec<Complex<f64>> =
            reference.iter().zip(&p).zip(&forward).map(|((r, p), f)| r * (1.0 - p * f)).collect();

        let [first, last] = profile.pes.window;
        let (n, rate) = (last - first, profile.pes.sample_rate_hz);
        let from_s = (profile.first_servo_sample() + first) as f64 / rate;
        let dft = WindowDft::new(n, rate, bins);
        let spacing_hz = 2.0 / period;
        let frame = frame(FrameKey {
            w_rad_s: w.clone(),
            rate_hz: rate,
            samples: n,
            from_s,
            bins: dft.bins().to_vec(),
            spacing_hz,
        });
        let noise = &profile.noise;
        let runout = runout(profile, &dft, from_s, n);
        let windage = windage(noise, t, &w);
        let padded = |x: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
            x.chain(std::iter::repeat(0.0)).take(frame.width()).collect()
        };
        let command = command.then(|| {
            let together = Backward::of(count.max(INSTANTS).next_power_of_two());
            // From the move's start to a little beyond its end.
            let place = |time: f64| time * 2.0 * together.length() as f64 / period;
            let (first, last) = (place(spiral.start_s) as usize, place(end_s + 0.5 * REST_S).ceil() as usize);
            Box::new(CommandLines {
                forward: forward.iter().zip(&reference).map(|(f, r)| f * r).collect(),
                windage: windage.clone(),
                first,
                turns: (first..=last)
                    .map(|m| Complex::from_polar(1.0, PI * m as f64 / together.length() as f64))
                    .collect(),
                together,
                rest: {
                    let near = NEAR_REST * w[0];
                    SampledPlant::of_points(t, plant.integrators(), vec![near], &[plant.at(near)])
                },
                mean: 0.5 * spiral.distance.copysign(spiral.velocity),
                spacing_hz: 2.0 * spacing_hz,
                samples: spiral.duration_s / t,
            })
        });
        Ok(SpectralPes {
            outside: w.iter().map(|w| !plant.covers(*w)).collect(),
            encoder: noise.encoder_rms.powi(2) * t,
            windage: padded(&mut windage.iter().zip(&p).map(|(d, p)| d * p.norm_sqr())),
            error: [padded(&mut error.iter().map(|e| e.re)), padded(&mut error.iter().map(|e| e.im))],
            lines: SampledPlant::of_points(t, plant.integrators(), w, &p),
            frame,
            dft,
            runout,
            command,
        })
    }

    /// The window's bins.
    pub fn dft(&self) -> &WindowDft {
        &self.dft
    }

    /// The lines, with the plant on them.
    pub fn lines(&self) -> &SampledPlant {
        &self.lines
    }

    /// Root of the expected |X_k|²/N² for every bin, into `amplitude`; returns the command's peak, 0 where it is not asked for.
    pub fn write(&self, chain: &[Section], work: &mut SpectralWork, amplitude: &mut Vec<f64>) -> f64 {
        self.lines.close(chain, &mut work.lines);
        wide(|| self.fold(work));
        work.x.clear();
        work.power.clear();
        let f = &*self.frame;
        for (k, runout) in self.runout.iter().enumerate() {
            let [x, y, noise] = wide(|| seen([&work.g_re, &work.g_im, &work.density], &f.sum[k], &f.difference[k]));
            work.x.push(runout + Complex::new(x, y));
            work.power.push(noise);
        }
        for t in &f.touching {
            let z = self.line(work, t.line);
            work.x[t.bin] += t.weight * if t.mirror { z.conj() } else { z };
            work.power[t.bin] += t.leak * self.noise_density(work, t.line);
        }
        work.power.iter_mut().zip(&work.x).for_each(|(p, x)| *p += x.norm_sqr());
        amplitude.clear();
        amplitude.extend(work.power.iter().map(|p| p.sqrt()));
        self.command.as_ref().map_or(0.0, |c| self.command_peak(c, chain, work))
    }

    /// The command's peak alone, 0 where it is not asked for; of the bins nothing is read.
    pub fn peak(&self, chain: &[Section], work: &mut SpectralWork) -> f64 {
        self.lines.close(chain, &mut work.lines);
        wide(|| self.fold(work));
        self.command.as_ref().map_or(0.0, |c| self.command_peak(c, chain, work))
    }

    /// Share of the energy in the bins that comes from lines outside the sweep, where the plant is a continuation.
    pub fn continuation_share(&self, chain: &[Section], work: &mut SpectralWork) -> f64 {
        self.write(chain, work, &mut Vec::new());
        let (mut outside, mut all) = (0.0, 0.0);
        for (sum, difference) in self.frame.sum.iter().zip(&self.frame.difference) {
            for (i, out) in self.outside.iter().enumerate() {
                let (re, im) = (work.g_re[i], work.g_im[i]);
                let energy = (im * sum[i] - re).powi(2) + (re * difference[i]).powi(2);
                all += energy;
                outside += if *out { energy } else { 0.0 };
            }
        }
        if all > 0.0 { outside / all } else { 0.0 }
    }

    /// S E on one line, not folded.
    pub(super) fn line(&self, work: &SpectralWork, i: usize) -> Complex<f64> {
        Complex::new(work.s_re[i], work.s_im[i]) * Complex::new(self.error[0][i], self.error[1][i])
    }

    /// Density of the noise in the PES on one line, not folded.
    pub(super) fn noise_density(&self, work: &SpectralWork, i: usize) -> f64 {
        let s = work.s_re[i] * work.s_re[i] + work.s_im[i] * work.s_im[i];
        let l = work.lines.re[i] * work.lines.re[i] + work.lines.im[i] * work.lines.im[i];
        s * (self.encoder * l + self.windage[i])
    }

    /// S on every line, and what the frame is applied to.
    #[inline(always)]
    fn fold(&self, work: &mut SpectralWork) {
        let (n, width) = (self.outside.len(), self.frame.width());
        let SpectralWork { lines, s_re, s_im, g_re, g_im, density, .. } = work;
        for a in [&mut *s_re, &mut *s_im, &mut *g_re, &mut *g_im, &mut *density] {
            a.resize(width, 0.0);
        }
        // Slices of one known length: no index is checked in the loop.
        let (l_re, l_im) = (&lines.re[..n], &lines.im[..n]);
        let (s_re, s_im, density) = (&mut s_re[..n], &mut s_im[..n], &mut density[..n]);
        let (g_re, g_im) = (&mut g_re[..n], &mut g_im[..n]);
        let ([e_re, e_im], [f_re, f_im]) = (&self.error, &self.frame.fold);
        let (e_re, e_im, f_re, f_im) = (&e_re[..n], &e_im[..n], &f_re[..n], &f_im[..n]);
        let (windage, power) = (&self.windage[..n], &self.frame.fold_power[..n]);
        for i in 0..n {
            let (x, y) = (l_re[i], l_im[i]);
            let scale = 1.0 / ((1.0 + x) * (1.0 + x) + y * y);
            let (a, b) = ((1.0 + x) * scale, -y * scale);
            let (u, v) = (a * e_re[i] - b * e_im[i], a * e_im[i] + b * e_re[i]);
            (s_re[i], s_im[i]) = (a, b);
            (g_re[i], g_im[i]) = (u * f_re[i] - v * f_im[i], u * f_im[i] + v * f_re[i]);
            // |S|² is the scale itself.
            density[i] = scale * (self.encoder * (x * x + y * y) + windage[i]) * power[i];
        }
    }

    /// The largest command of the move, and the expected largest of its noise on top.
    fn command_peak(&self, c: &CommandLines, chain: &[Section], work: &mut SpectralWork) -> f64 {
        let n = self.outside.len();
        let mut power = 0.0;
        // U = C E + F R; C from L = P C, and outside the sweep, where P is 0, nothing is known of it: the lines end there.
        let mut command = std::mem::take(&mut work.command);
        command.clear();
        for i in 0..n {
            let (p, l) = (self.lines.value(i), Complex::new(work.lines.re[i], work.lines.im[i]));
            let s = Complex::new(work.s_re[i], work.s_im[i]);
            let gain = if p.norm_sqr() > 0.0 { l / p } else { Complex::new(0.0, 0.0) };
            command.push(gain * self.line(work, i) + c.forward[i]);
            power += (self.encoder * (gain * s).norm_sqr() + c.windage[i] * (l * s).norm_sqr()) * c.spacing_hz;
        }
        // What holds the mean position: C S next to rest, where it is real.
        c.rest.close(chain, &mut work.rest);
        let l = Complex::new(work.rest.re[0], work.rest.im[0]);
        let held = c.mean * (l / (c.rest.value(0) * (1.0 + l))).re;
        // The lines are odd multiples of the first: their sum at m/(2 N) of the period is its turn there times an inverse transform of length N.
        command.resize(c.together.length(), Complex::new(0.0, 0.0));
        c.together.process(&mut command, &mut work.scratch);
        let at = |(m, turn): (usize, &Complex<f64>)| {
            let sum = command[(c.first + m) % command.len()];
            (held + 2.0 * (sum.re * turn.re - sum.im * turn.im)).abs()
        };
        let peak = c.turns.iter().enumerate().map(at).fold(0.0, f64::max);
        work.command = command;
        peak + (power * 2.0 * c.samples.max(2.0).ln()).sqrt()
    }
}

/// Real and imaginary part of a bin, and the noise in it, from folded lines. Sums run in lanes, in a fixed order.
#[inline(always)]
fn seen([re, im, density]: [&[f64]; 3], sum: &[f64], difference: &[f64]) -> [f64; 3] {
    let chunks = sum.len() / LANES;
    let (re, im) = (&re.as_chunks::<LANES>().0[..chunks], &im.as_chunks::<LANES>().0[..chunks]);
    let density = &density.as_chunks::<LANES>().0[..chunks];
    let (sum, difference) = (&sum.as_chunks::<LANES>().0[..chunks], &difference.as_chunks::<LANES>().0[..chunks]);
    let (mut x, mut y, mut noise) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for c in 0..chunks {
        for j in 0..LANES {
            let (u, v) = (sum[c][j], difference[c][j]);
            x[j] += im[c][j] * u - re[c][j];
            y[j] -= re[c][j] * v;
            noise[j] += density[c][j] * (0.5 + 0.5 * (u * u + v * v));
        }
    }
    let total = |a: [f64; LANES]| ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7]));
    [total(x), total(y), total(noise)]
}

/// The feed-forward's response: central differences of the reference.
fn feedforward(f: Option<&Feedforward>, angle: f64, t: f64) -> Complex<f64> {
    let velocity = Complex::new(0.0, angle.sin() / t);
    let half = (0.5 * angle).sin();
    let acceleration = -4.0 * half * half / (t * t);
    f.map_or(Complex::new(0.0, 0.0), |f| {
        let ahead = Complex::from_polar(f.factor, angle * f64::from(f.ahead_samples));
        ahead * (f.velocity_s * velocity + f.acceleration_s2 * acceleration)
    })
}

/// Fourier coefficient of the there-and-back reference at line `w`, in closed form from its steps of acceleration.
fn line(profile: &Profile, end_s: f64, w: f64, period: f64) -> Complex<f64> {
    let s = &profile.spiral;
    let speed = s.velocity.abs();
    let acceleration = (speed / s.acceleration_time_s).copysign(s.velocity);
    let whole = end_s - s.start_s;
    // A move too short for the full speed is two ramps; otherwise the ramps are as long as the profile says.
    let ramp = s.acceleration_time_s.min(0.5 * whole);
    let steps = [(0.0, 1.0), (ramp, -1.0), (whole - ramp, -1.0), (whole, 1.0)];
    let sum: Complex<f64> = steps.iter().map(|(at, size)| size * Complex::from_polar(1.0, -w * (s.start_s + at))).sum();
    // Each step of acceleration contributes 1/(jw)³; the way back, half a period later and negative, doubles odd lines.
    2.0 * acceleration * sum / Complex::new(0.0, -w * w * w) / period
}

/// Density of the windage at the plant's input on every line.
fn windage(noise: &Noise, t: f64, w: &[f64]) -> Vec<f64> {
    let keep = (-TAU * noise.windage_corner_hz * t).exp();
    let coloured = |w: f64| {
        let back = Complex::new(1.0, 0.0) - keep * Complex::from_polar(1.0, -w * t);
        noise.windage_rms.powi(2) * t * (1.0 - keep * keep) / back.norm_sqr()
    };
    w.iter().map(|w| coloured(*w)).collect()
}

/// The run-out's part of every bin.
fn runout(profile: &Profile, dft: &WindowDft, from_s: f64, n: usize) -> Vec<Complex<f64>> {
    let (noise, rate) = (&profile.noise, profile.pes.sample_rate_hz);
    let of = |k: &usize| {
        let bin = TAU * *k as f64 / n as f64;
        let line = |r: &super::Runout| {
            let w = TAU * f64::from(r.order) * noise.spindle_hz;
            let phase = Complex::from_polar(0.5 * r.amplitude, w * from_s + r.phase_deg.to_radians());
            phase * kernel(w / rate - bin, n) + phase.conj() * kernel(-w / rate - bin, n)
        };
        noise.runout.iter().map(line).sum()
    };
    dft.bins().iter().map(of).collect()
}
