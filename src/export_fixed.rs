//! The controller in integers: a word a coefficient, what rounding does to it, and a C99 header that the test vector holds to every bit.
//!
//! Each section runs y 2^f = b0 x + b1 x1 + b2 x2 - a1 y1 - a2 y2 + rest in 64 bits (direct form I); what the shift cuts off is the next sample's rest, so
//! that an integrator loses nothing.

use super::Failure;
use super::exported::{Exported, numbers};
use serde::Serialize;
use servotune::controller::ControlLaw;
use servotune::feedback::{Margins, ModelLoop, confirmed_margins};
use servotune::lti::{DiscretePlant, FrequencyResponse, Plant, Section, Sections};
use std::f64::consts::PI;

/// Largest signal (2^28 of 31 bits): five products of it and a 32-bit word stay in 64 bits.
const SIGNAL_BITS: i32 = 28;
/// Room of a signal above what the test vector needs (bits).
const HEADROOM_BITS: i32 = 3;

/// One section in words.
struct FixedSection {
    /// b0 b1 b2 a1 a2 times 2^fraction.
    words: [i64; 5],
    fraction: u32,
}

/// The law in words.
pub(super) struct FixedLaw {
    sections: Vec<FixedSection>,
    /// Signals are counted in 2^-signal_fraction.
    signal_fraction: i32,
    limit: i64,
    word_length: u32,
    sample_time_s: f64,
    /// Errors of the test vector and the commands that the words give.
    test: Vec<(i64, i64)>,
}

/// What rounding does.
#[derive(Serialize)]
pub(super) struct Effect {
    word_length: u32,
    fraction_bits: Vec<u32>,
    signal_fraction_bits: i32,
    /// Largest |C_rounded/C - 1| from a ten thousandth of half the sample rate up to it, and where (Hz).
    response_deviation: f64,
    response_deviation_hz: f64,
    /// Rms of the command's difference over the test vector, as a share of the command's rms.
    command_deviation: f64,
    /// Margins with the exact and with the rounded coefficients; only with a plant.
    margins: Option<[Margins; 2]>,
}

impl FixedLaw {
    pub(super) fn of(x: &Exported<'_>, law: &ControlLaw<'_>, word_length: u32) -> FixedLaw {
        let sections: Vec<FixedSection> = law.chain.iter().map(|s| FixedSection::of(s, word_length)).collect();
        let bits = peak(law, &x.test.error).log2().ceil() as i32;
        let signal_fraction = (SIGNAL_BITS - HEADROOM_BITS - bits).clamp(-30, 60);
        let scale = 2f64.powi(signal_fraction);
        let most = 1i64 << SIGNAL_BITS;
        let limit = if law.limit.is_finite() { ((law.limit * scale).round() as i64).min(most) } else { most };
        let sample_time_s = x.controller.sample_time_s;
        let mut fixed = FixedLaw { sections, signal_fraction, limit, word_length, sample_time_s, test: Vec::new() };
        let errors: Vec<i64> = x.test.error.iter().map(|e| (e * scale).round() as i64).collect();
        fixed.test = errors.iter().copied().zip(fixed.run(&errors)).collect();
        fixed
    }

    /// The commands of the words from rest, exactly as the C code does it.
    fn run(&self, errors: &[i64]) -> Vec<i64> {
        let most = 1i64 << SIGNAL_BITS;
        let mut memory = vec![[0i64; 5]; self.sections.len()];
        let step = |&e: &i64| {
            let mut x = e.clamp(-most, most);
            for (s, m) in self.sections.iter().zip(&mut memory) {
                let [b0, b1, b2, a1, a2] = s.words;
                let [x1, x2, y1, y2, rest] = *m;
                let sum = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2 + rest;
                let y = (sum >> s.fraction).clamp(-most, most);
                *m = [x, x1, y, y1, sum & ((1i64 << s.fraction) - 1)];
                x = y;
            }
            x.clamp(-self.limit, self.limit)
        };
        errors.iter().map(step).collect()
    }

    pub(super) fn effect(
        &self,
        x: &Exported<'_>,
        law: &ControlLaw<'_>,
        plant: Option<&Plant>,
    ) -> Result<Effect, Failure> {
        let exact = Sections { chain: law.chain.clone(), sample_time_s: self.sample_time_s };
        let chain = self.sections.iter().map(FixedSection::section).collect();
        let rounded = Sections { chain, sample_time_s: self.sample_time_s };
        let (mut worst, mut at) = (0.0, 0.0);
        for i in 0..=400 {
            let w = PI / self.sample_time_s * 10f64.powf(-4.0 + 4.0 * f64::from(i) / 400.0);
            let off = (rounded.at(w) / exact.at(w) - 1.0).norm();
            if off > worst {
                (worst, at) = (off, w / (2.0 * PI));
            }
        }
        let scale = 2f64.powi(-self.signal_fraction);
        // The words know nothing of the reference: the feed-forward is added behind them.
        let still = vec![0.0; x.test.error.len()];
        let command = law.replay_from(law.rest(), &still, &x.test.error);
        let off: f64 = self.test.iter().zip(&command).map(|((_, u), exact)| (*u as f64 * scale - exact).powi(2)).sum();
        let all: f64 = command.iter().map(|u| u * u).sum();
        let judged = |sections: &Sections, plant: &Plant| -> Result<Margins, Failure> {
            let sampled = DiscretePlant::of(plant, self.sample_time_s)?;
            Ok(confirmed_margins(&ModelLoop::new(&sampled, sections)?)?)
        };
        let margins = match plant {
            Some(p) => Some([judged(&exact, p)?, judged(&rounded, p)?]),
            None => None,
        };
        Ok(Effect {
            word_length: self.word_length,
            fraction_bits: self.sections.iter().map(|s| s.fraction).collect(),
            signal_fraction_bits: self.signal_fraction,
            response_deviation: worst,
            response_deviation_hz: at,
            command_deviation: if all > 0.0 { (off / all).sqrt() } else { 0.0 },
            margins,
        })
    }

    /// The header.
    pub(super) fn header(&self, x: &Exported<'_>, effect: &Effect) -> String {
        let (n, big) = (x.name, x.name.to_uppercase());
        let rows = self.sections.iter().map(|s| format!("    {{{}}}", s.words.map(|w| w.to_string()).join(", ")));
        let rows = rows.collect::<Vec<_>>().join(",\n");
        let shifts = self.sections.iter().map(|s| s.fraction.to_string()).collect::<Vec<_>>().join(", ");
        let list = |pick: fn(&(i64, i64)) -> i64| numbers(self.test.iter().map(|t| pick(t).to_string()), "    ");
        format!(
            "/* {source}.\n   Made by a program: change the gains and export again.\n   {effect}\n\n   \
             e = reference - position in units of 2^-{signal}, once in {t:e} s; the command comes in the same units.\n   \
             A word is its coefficient times 2^shift. >> of a negative number must keep its sign, as every common compiler does.\n   \
             A feed-forward is not in here. */\n\
             #ifndef {big}_H\n#define {big}_H\n#include <stdint.h>\n\n#define {big}_SECTIONS {count}\n#define {big}_SIGNAL_FRACTION_BITS {signal}\n\
             #define {big}_LIMIT INT64_C({limit})\n#define {big}_MOST INT64_C({most})\n\n\
             /* b0, b1, b2, a1, a2 */\nstatic const int32_t {n}_word[{big}_SECTIONS][5] = {{\n{rows}\n}};\n\
             static const unsigned {n}_shift[{big}_SECTIONS] = {{{shifts}}};\n\n\
             /* x1, x2, y1, y2, rest of each section; all zeros: at rest */\ntypedef struct {{ int64_t m[{big}_SECTIONS][5]; }} {n}_state;\n\n\
             static inline int64_t {n}_within(int64_t v, int64_t most) {{ return v > most ? most : v < -most ? -most : v; }}\n\n\
             static inline int64_t {n}_step({n}_state *s, int64_t e) {{\n    int i;\n    int64_t x = {n}_within(e, {big}_MOST);\n    \
             for (i = 0; i < {big}_SECTIONS; i++) {{\n        const int32_t *c = {n}_word[i];\n        int64_t *m = s->m[i];\n        \
             const int64_t sum = c[0] * x + c[1] * m[0] + c[2] * m[1] - c[3] * m[2] - c[4] * m[3] + m[4];\n        \
             const int64_t y = {n}_within(sum >> {n}_shift[i], {big}_MOST);\n        \
             m[1] = m[0]; m[0] = x; m[3] = m[2]; m[2] = y; m[4] = sum & ((INT64_C(1) << {n}_shift[i]) - 1);\n        x = y;\n    }}\n    \
             return {n}_within(x, {big}_LIMIT);\n}}\n\n\
             #ifdef {big}_TEST\nstatic const int64_t {n}_test_error[{samples}] = {{\n{errors}\n}};\n\
             static const int64_t {n}_test_command[{samples}] = {{\n{commands}\n}};\n\n\
             /* samples that differ; 0 is right */\nstatic inline int {n}_test(void) {{\n    {n}_state s = {{{{{{0}}}}}};\n    int k, wrong = 0;\n    \
             for (k = 0; k < {samples}; k++)\n        if ({n}_step(&s, {n}_test_error[k]) != {n}_test_command[k]) wrong++;\n    return wrong;\n}}\n#endif\n#endif\n",
            source = x.source,
            effect = effect.sentences().join("\n   "),
            signal = self.signal_fraction,
            t = self.sample_time_s,
            count = self.sections.len(),
            limit = self.limit,
            most = 1i64 << SIGNAL_BITS,
            samples = self.test.len(),
            errors = list(|t| t.0),
            commands = list(|t| t.1),
        )
    }
}

impl FixedSection {
    fn of(s: &Section, word_length: u32) -> FixedSection {
        let all = [s.b0, s.b1, s.b2, s.a1, s.a2];
        let largest = all.iter().fold(1.0f64, |m, c| m.max(c.abs()));
        // One bit is the sign; the largest word must stay below 2^(word_length - 1) after rounding up.
        let whole = (largest * (1.0 + 1e-9)).log2().ceil().max(0.0) as u32;
        let fraction = (word_length - 1).saturating_sub(whole);
        let mut words = all.map(|c| (c * 2f64.powi(fraction as i32)).round() as i64);
        // An integrator stays one: its pole at z = 1 to the bit.
        if (1.0 + s.a1 + s.a2).abs() < 1e-12 {
            words[3] = -(1i64 << fraction) - words[4];
        }
        FixedSection { words, fraction }
    }

    /// The section that the words stand for.
    fn section(&self) -> Section {
        let [b0, b1, b2, a1, a2] = self.words.map(|w| w as f64 * 2f64.powi(-(self.fraction as i32)));
        Section { b0, b1, b2, a1, a2 }
    }
}

/// Largest signal anywhere in the chain over these errors.
fn peak(law: &ControlLaw<'_>, error: &[f64]) -> f64 {
    let still = vec![0.0; error.len()];
    let outputs = (1..=law.chain.len()).flat_map(|count| {
        let mut part = law.clone();
        part.chain.truncate(count);
        part.limit = f64::INFINITY;
        part.replay_from(part.rest(), &still, error)
    });
    outputs.chain(error.iter().copied()).fold(f64::MIN_POSITIVE, |m, u| m.max(u.abs()))
}

impl Effect {
    pub(super) fn sentences(&self) -> Vec<String> {
        let mut all = vec![format!(
            "Words of {} bits, {} behind the point: the response differs by at most {:.2e} of itself (at {:.4} Hz), the command of the test by {:.2e}.",
            self.word_length,
            self.fraction_bits.iter().map(u32::to_string).collect::<Vec<_>>().join("/"),
            self.response_deviation,
            self.response_deviation_hz,
            self.command_deviation
        )];
        if let Some([exact, rounded]) = &self.margins {
            let shown = |x: Option<f64>| x.map_or_else(|| "none".to_owned(), |v| format!("{v:.3}"));
            all.push(format!(
                "Margins exact and rounded: {} and {}, phase {} and {} deg, gain {} and {} dB, max sensitivity {:.4} and {:.4}.",
                if exact.stable { "stable" } else { "UNSTABLE" },
                if rounded.stable { "stable" } else { "UNSTABLE" },
                shown(exact.phase_margin_deg),
                shown(rounded.phase_margin_deg),
                shown(exact.gain_margin_db),
                shown(rounded.gain_margin_db),
                exact.max_sensitivity,
                rounded.max_sensitivity
            ));
        }
        all
    }
}
