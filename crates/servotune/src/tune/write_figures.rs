//! The figures of a spiral write for one candidate, and their slopes.
//!
//! Model: the write without noise and the one with the profile's draw, simulated side by side; the objective is of the first, with the noise by its
//! expected power, the limits are of the second, which is what `simulate` reports. Response: the write read off the spectrum, noise by its
//! expected power throughout. A search whose objective looked at one draw alone would learn it by heart.

use super::objective::Minimise;
use super::record_figures::{Asked, RecordFigure};
use super::section_slope::in_parameters;
use super::section_slope::{SECTION_STEP, SectionSlope};
use crate::controller::Controller;
use crate::feedback::{LoopOnGrid, ResponseCurve, SampledPlant, SectionGradients};
use crate::lti::{DiscretePlant, Section};
use crate::numeric::statistics::rms;
use crate::pes::{
    self, Figure, NoisePower, NoisePowerWork, PesError, Profile, QuickScene, QuickWork, Slopes, SpectralPes,
    SpectralWork, WindowDft, WriteRecord,
};

/// A write made ready for one machine.
#[derive(Clone, Debug)]
pub(super) enum WriteSource {
    Model(Box<ModelWrite>),
    Response(Box<SpectralPes>),
}

/// A simulated write.
#[derive(Clone, Debug)]
pub(super) struct ModelWrite {
    scene: QuickScene,
    dft: WindowDft,
    /// Expected power of the noise, where there is any.
    noise: Option<NoisePower>,
    records: pes::Asked,
}

/// Buffers for one thread.
#[derive(Clone, Debug, Default)]
pub(super) struct WriteBuffers {
    work: QuickWork,
    noise: NoisePowerWork,
    noise_slopes: Slopes,
    moved: Vec<f64>,
    spectral: SpectralWork,
    /// Amplitudes of the bins: of the objective's record, and of the limits'.
    expected: Vec<f64>,
    drawn: Vec<f64>,
    shares: Vec<f64>,
    weights: Vec<f64>,
    slopes: Vec<Slopes>,
    gradients: SectionGradients,
}

impl WriteSource {
    /// A write simulated on a model.
    pub fn model(
        profile: &Profile,
        plant: &DiscretePlant,
        sampled: &SampledPlant,
        asked: &Asked,
    ) -> Result<WriteSource, PesError> {
        let scene = QuickScene::new(profile, plant)?;
        let [first, last] = profile.pes.window;
        let (n, rate) = (last - first, profile.pes.sample_rate_hz);
        let dft = WindowDft::new(n, rate, bins(asked, n, rate));
        let noise = if asked.minimise.of_write() { NoisePower::of(profile, sampled, &dft) } else { None };
        let limited = |f: RecordFigure| f != RecordFigure::Objective && !f.of_reference();
        let whole = |f| matches!(f, RecordFigure::CommandPeak | RecordFigure::CommandRms);
        let records = pes::Asked {
            still: asked.minimise.of_write(),
            drawn: asked.any(limited),
            whole: asked.any(whole),
            slopes: false,
        };
        Ok(WriteSource::Model(Box::new(ModelWrite { scene, dft, noise, records })))
    }

    /// A write read off the spectrum of a measured response.
    pub fn response(
        profile: &Profile,
        curve: &ResponseCurve,
        base: &Controller,
        asked: &Asked,
    ) -> Result<WriteSource, PesError> {
        let [first, last] = profile.pes.window;
        let n = last - first;
        let bins = if asked.minimise == Minimise::PesRms {
            // By Parseval's theorem the window's mean square is the sum over all bins.
            (0..=n / 2).collect()
        } else {
            bins(asked, n, profile.pes.sample_rate_hz)
        };
        let peak = asked.any(|f| f == RecordFigure::CommandPeak);
        Ok(WriteSource::Response(Box::new(SpectralPes::new(profile, curve, base, bins, peak)?)))
    }

    /// All figures of one candidate, into their places.
    pub fn figures(
        &self,
        c: &Controller,
        chain: &[Section],
        asked: &Asked,
        on: &LoopOnGrid,
        b: &mut WriteBuffers,
        figures: &mut [f64],
    ) {
        match self {
            WriteSource::Model(m) => m.figures(c, chain, asked, on, b, figures),
            WriteSource::Response(s) => {
                let peak = s.write(chain, &mut b.spectral, &mut b.expected);
                b.drawn.clone_from(&b.expected);
                band_figures(s.dft(), asked, &b.expected, &b.drawn, figures);
                if asked.minimise == Minimise::PesRms {
                    let power = |(i, a): (usize, &f64)| parseval(s.dft(), i) * a * a;
                    figures[0] = b.expected.iter().enumerate().map(power).sum::<f64>().sqrt();
                }
                if let Some(at) = asked.place(RecordFigure::CommandPeak) {
                    figures[at] = peak;
                }
            }
        }
    }

    /// Slopes of the wanted figures of the candidate seen last, into their places.
    #[allow(clippy::too_many_arguments, reason = "one call site's locals")]
    pub fn slopes(
        &self,
        c: &Controller,
        chain: &[Section],
        sections: &[SectionSlope],
        asked: &Asked,
        sampled: &SampledPlant,
        on: &LoopOnGrid,
        wanted: &[bool],
        figures: &[f64],
        b: &mut WriteBuffers,
        out: &mut [Vec<f64>],
    ) {
        match self {
            WriteSource::Model(m) => m.slopes(c, chain, sections, asked, sampled, on, wanted, figures, b, out),
            WriteSource::Response(s) => {
                let around: Vec<[Section; 2]> = sections.iter().map(|s| s.around).collect();
                s.lines().section_gradients(&around, SECTION_STEP, &mut b.gradients);
                for (at, figure) in asked.figures.iter().enumerate().filter(|(at, _)| wanted[*at]) {
                    match figure {
                        RecordFigure::CommandPeak => {
                            peak_slopes(s, chain, sections, figures[at], b, &mut out[at]);
                        }
                        RecordFigure::CommandRms => continue,
                        f if f.of_reference() => continue,
                        _ => {
                            shares(*figure, asked, s.dft(), &b.expected, figures[at], &mut b.shares);
                            let of = b.shares.iter().copied().enumerate().filter(|(_, q)| *q != 0.0);
                            s.slopes(of, &b.gradients, &mut b.spectral, &mut out[at]);
                        }
                    }
                }
            }
        }
    }
}

impl ModelWrite {
    fn figures(
        &self,
        c: &Controller,
        chain: &[Section],
        asked: &Asked,
        on: &LoopOnGrid,
        b: &mut WriteBuffers,
        figures: &mut [f64],
    ) {
        self.scene.run(chain, c.feedforward.as_ref(), c.output_limit, self.records, &mut b.work);
        if self.records.still && asked.minimise == Minimise::Dft {
            self.dft.amplitudes(b.work.window(WriteRecord::Still), &mut b.expected);
            if let Some(noise) = &self.noise {
                noise.bins(on, &mut b.noise, &mut b.shares);
                let powers = b.expected.iter_mut().zip(&b.shares);
                powers.for_each(|(a, p)| *a = (*a * *a + p.max(0.0)).sqrt());
            }
        }
        if self.records.drawn {
            self.dft.amplitudes(b.work.window(WriteRecord::Drawn), &mut b.drawn);
        }
        band_figures(&self.dft, asked, &b.expected, &b.drawn, figures);
        if asked.minimise == Minimise::PesRms {
            let window = b.work.window(WriteRecord::Still);
            let mean = window.iter().map(|e| e * e).sum::<f64>() / window.len() as f64;
            let variance = self.noise.as_ref().map_or(0.0, |n| n.position.variance(on).max(0.0));
            figures[0] = (mean + variance).sqrt();
        }
        if let Some(at) = asked.place(RecordFigure::CommandPeak) {
            figures[at] = b.work.peak(WriteRecord::Drawn).1;
        }
        if let Some(at) = asked.place(RecordFigure::CommandRms) {
            let u = b.work.command(WriteRecord::Drawn);
            figures[at] = rms(u);
        }
    }

    #[allow(clippy::too_many_arguments, reason = "one call site's locals")]
    fn slopes(
        &self,
        c: &Controller,
        chain: &[Section],
        sections: &[SectionSlope],
        asked: &Asked,
        sampled: &SampledPlant,
        on: &LoopOnGrid,
        wanted: &[bool],
        figures: &[f64],
        b: &mut WriteBuffers,
        out: &mut [Vec<f64>],
    ) {
        let asks = pes::Asked { slopes: true, ..self.records };
        self.scene.run(chain, c.feedforward.as_ref(), c.output_limit, asks, &mut b.work);
        let mut weights = std::mem::take(&mut b.weights);
        for (at, figure) in asked.figures.iter().enumerate().filter(|(at, _)| wanted[*at]) {
            let objective = *figure == RecordFigure::Objective;
            let record = if objective { WriteRecord::Still } else { WriteRecord::Drawn };
            let (mut from, mut command) = (0, Vec::new());
            weights.clear();
            match figure {
                RecordFigure::CommandPeak => {
                    let (sample, _) = b.work.peak(record);
                    (from, command) = (sample, vec![b.work.command(record)[sample].signum()]);
                }
                RecordFigure::CommandRms => {
                    let u = b.work.command(record);
                    let scale = 1.0 / (u.len() as f64 * figures[at].max(f64::MIN_POSITIVE));
                    command = u.iter().map(|u| u * scale).collect();
                }
                f if f.of_reference() => continue,
                _ if objective && asked.minimise == Minimise::PesRms => {
                    let window = b.work.window(record);
                    let scale = 1.0 / (window.len() as f64 * figures[at].max(f64::MIN_POSITIVE));
                    weights.extend(window.iter().map(|e| e * scale));
                }
                _ if objective && asked.minimise != Minimise::Dft => continue,
                _ => {
                    let amplitude = if objective { &b.expected } else { &b.drawn };
                    shares(*figure, asked, &self.dft, amplitude, figures[at], &mut b.shares);
                    self.dft.slopes(b.work.window(record), &b.shares, &mut weights);
                }
            }
            let seen = Figure { record, window: &weights, command: (from, &command) };
            let mut slopes = std::mem::take(&mut b.slopes);
            self.scene.backward(chain, &[seen], &mut b.work, &mut slopes);
            in_parameters(&slopes[0], sections, &mut out[at]);
            b.slopes = slopes;
            if let Some(noise) = self.noise.as_ref().filter(|_| objective) {
                // The shares of the bins' powers still stand in the buffers; of the rms the variance has one.
                let of_rms = asked.minimise == Minimise::PesRms;
                let position = if of_rms { 0.5 / figures[at].max(f64::MIN_POSITIVE) } else { 0.0 };
                let bins: &[f64] = if of_rms { &[] } else { &b.shares };
                let mut slopes = std::mem::take(&mut b.noise_slopes);
                noise.slopes(sampled, chain, on, bins, [position, 0.0], &mut b.noise, &mut slopes.sections);
                in_parameters(&slopes, sections, &mut b.moved);
                out[at].iter_mut().zip(&b.moved).for_each(|(o, d)| *o += d);
                b.noise_slopes = slopes;
            }
        }
        b.weights = weights;
    }
}

/// The bins of all bands and the limited harmonics, ascending.
fn bins(asked: &Asked, n: usize, rate: f64) -> Vec<usize> {
    let used = |band: usize| asked.minimise == Minimise::Dft || asked.place(RecordFigure::Band(band)).is_some();
    let inside = |k: usize| {
        let hz = k as f64 * rate / n as f64;
        let mut bands = asked.bands_hz.iter().enumerate().filter(|(i, _)| used(*i));
        bands.any(|(_, [from, to])| (*from..=*to).contains(&hz)) || asked.harmonics.contains(&k)
    };
    (1..=n / 2).filter(|&k| inside(k)).collect()
}

/// How often a bin's power counts in the window's mean square: twice but for rest and half the rate.
fn parseval(dft: &WindowDft, bin: usize) -> f64 {
    let k = dft.bins()[bin];
    if k == 0 || 2 * k == dft.samples() { 1.0 } else { 2.0 }
}

/// Norms, harmonics and the objective `dft` from amplitudes: expected ones for the objective, drawn ones for the limits.
fn band_figures(dft: &WindowDft, asked: &Asked, expected: &[f64], drawn: &[f64], figures: &mut [f64]) {
    for (at, figure) in asked.figures.iter().enumerate() {
        match *figure {
            RecordFigure::Objective if asked.minimise == Minimise::Dft => {
                let weighed = asked.bands_hz.iter().zip(&asked.weights);
                figures[at] = weighed.map(|(band, weight)| weight * dft.band(expected, *band)).sum();
            }
            RecordFigure::Band(i) => figures[at] = dft.band(drawn, asked.bands_hz[i]),
            RecordFigure::Harmonic(i) => {
                let k = asked.harmonics[i];
                figures[at] = dft.bins().iter().position(|b| *b == k).map_or(0.0, |i| drawn[i]);
            }
            _ => {}
        }
    }
}

/// A figure's slopes in the power of every bin; `value` is the figure itself, `amplitude` the bins of its record.
fn shares(figure: RecordFigure, asked: &Asked, dft: &WindowDft, amplitude: &[f64], value: f64, out: &mut Vec<f64>) {
    out.clear();
    out.resize(dft.bins().len(), 0.0);
    // d norm = sum of power changes over twice the norm; of a norm of 0 nothing is known.
    let half = |norm: f64| if norm > 0.0 { 0.5 / norm } else { 0.0 };
    match figure {
        RecordFigure::Objective if asked.minimise == Minimise::PesRms => {
            (0..out.len()).for_each(|i| out[i] = parseval(dft, i) * half(value));
        }
        RecordFigure::Objective => {
            for (band, weight) in asked.bands_hz.iter().zip(&asked.weights) {
                let share = weight * half(dft.band(amplitude, *band));
                dft.inside(*band).for_each(|i| out[i] += share);
            }
        }
        RecordFigure::Band(band) => dft.inside(asked.bands_hz[band]).for_each(|i| out[i] = half(value)),
        RecordFigure::Harmonic(i) => {
            let k = asked.harmonics[i];
            if let Some(bin) = dft.bins().iter().position(|b| *b == k) {
                out[bin] = half(value);
            }
        }
        _ => {}
    }
}

/// Slopes of the command's peak on a response, by forward differences: the peak is of instants between lines.
fn peak_slopes(
    s: &SpectralPes,
    chain: &[Section],
    sections: &[SectionSlope],
    peak: f64,
    b: &mut WriteBuffers,
    out: &mut Vec<f64>,
) {
    let mut moved = chain.to_vec();
    out.clear();
    for slope in sections {
        moved[slope.section] = slope.around[1];
        let there = s.peak(&moved, &mut b.spectral);
        moved[slope.section] = chain[slope.section];
        out.push((there - peak) / SECTION_STEP);
    }
    // Later figures read the candidate's own spectrum.
    s.write(chain, &mut b.spectral, &mut b.drawn);
}
