//! One machine of a certificate: every bound that its spec asks for, and what in the table's figures is not its own.
//!
//! In: the table, the sections that the firmware holds, a plant or a sweep. Out: [`CaseProof`] with findings. Spec: `specs/certificate.md`.

use super::bounds::{BoundedFigure, LoopBounds, Stability};
use super::case_proof::CaseProof;
use super::prove::prove;
use super::proven_limits::{Known, Magnitudes, proven_limits};
use super::step_box::Members;
use super::table::{self, TableFinding};
use super::write::{Bands, write};
use super::write_box::{BoxSettings, BoxWatch, BoxedLoop, bound_write};
use super::{Uncertainty, VerifyError, VerifySettings, modelled, step, taken};
use crate::controller::Controller;
use crate::frf::Sweep;
use crate::lti::{Plant, Section};
use crate::tune::{Disturbance, GainTable, Requirement, Spec, What};

/// Ms taken for the search for bands where the spec names none.
const MS_UNSAID: f64 = 2.5;

/// What is the same for every machine.
pub(super) struct Job<'a> {
    pub table: &'a GainTable,
    pub controller: &'a Controller,
    /// The sections in the firmware's words.
    pub held: &'a [Section],
    pub spec: &'a Spec,
    pub wanted: &'a [Requirement],
    pub least_damping: f64,
    pub uncertainty: &'a Uncertainty,
    /// The firmware holds the table's own numbers, and nothing is uncertain.
    pub plain: bool,
    pub settings: &'a VerifySettings,
    pub watch: &'a BoxWatch<'a>,
}

impl Job<'_> {
    /// The case of a plant model.
    pub fn of_plant(&self, plant: &Plant, sha256: String) -> Result<(CaseProof, Vec<TableFinding>), VerifyError> {
        let (c, u, t) = (self.controller, self.uncertainty, self.controller.sample_time_s);
        let (profile, bands_hz) = (self.spec.profile.as_ref(), self.bands_hz());
        let l = modelled(plant, self.held, t, u)?;
        let bounds = prove(&l, self.settings)?;
        let stable = bounds.stability == Stability::Stable;
        let magnitudes = Magnitudes::of(&l, self.spec, self.settings);
        let figures = profile.map(|p| write(plant, self.held, c, p, &bands_hz));
        // The table states figures of its own coefficients on the plant as it stands.
        let findings = if self.plain {
            table::figures(&self.table.after, &bounds, figures.as_ref())
        } else {
            let own = self.table.sections();
            let bounds = prove(&modelled(plant, own, t, &Uncertainty::default())?, self.settings)?;
            let figures = profile.map(|p| write(plant, own, c, p, &bands_hz));
            table::figures(&self.table.after, &bounds, figures.as_ref())
        };
        let write_box = profile.filter(|_| u.any()).map(|profile| {
            let boxed = BoxedLoop {
                plant,
                sections: self.held,
                controller: c,
                profile,
                bands_hz,
                uncertainty: u,
                max_sensitivity: bounds.max_sensitivity.high.filter(|_| stable),
            };
            bound_write(&boxed, &self.bins(), &BoxSettings::default(), self.watch)
        });
        let (step, at_end, command_rms) = if stable { self.records(plant, &bounds) } else { Default::default() };
        let known = Known {
            bounds: &bounds,
            magnitudes: &magnitudes,
            model: true,
            write: figures.as_ref(),
            write_box: write_box.as_ref(),
            step,
            at_end,
            command_rms,
        };
        let limits = proven_limits(self.spec, self.wanted, &known);
        Ok((CaseProof { sha256, bounds, write: figures, write_box, limits, sweep_again: vec![] }, findings))
    }

    /// The case of a sweep.
    pub fn of_sweep(&self, sweep: &Sweep) -> Result<(CaseProof, Vec<TableFinding>), VerifyError> {
        let t = self.controller.sample_time_s;
        let swept = |sections, u| taken(&sweep.frf, sections, t, self.least_damping, u);
        let l = swept(self.held, self.uncertainty)?;
        let bounds = prove(&l, self.settings)?;
        let of_table = if self.plain {
            bounds.clone()
        } else {
            prove(&swept(self.table.sections(), &Uncertainty::default())?, self.settings)?
        };
        let findings = table::figures(&self.table.after, &of_table, None);
        let magnitudes = Magnitudes::of(&l, self.spec, self.settings);
        let known = Known {
            bounds: &bounds,
            magnitudes: &magnitudes,
            model: false,
            write: None,
            write_box: None,
            step: Default::default(),
            at_end: Default::default(),
            command_rms: BoundedFigure::default(),
        };
        let limits = proven_limits(self.spec, self.wanted, &known);
        // Without a limit on Ms, a hidden mode that brings L this near to -1 is one to look for.
        let sweep_again = l.again(1.0 / self.spec.margins.max_sensitivity.unwrap_or(MS_UNSAID));
        let sha256 = sweep.source_digest.clone();
        Ok((CaseProof { sha256, bounds, write: None, write_box: None, limits, sweep_again }, findings))
    }

    /// First and second band of the spec; of one that it does not name there is no bin.
    fn bands_hz(&self) -> Bands {
        [0, 1].map(|i| self.spec.objective.bands_hz.get(i).copied().unwrap_or_default())
    }

    /// Harmonics that the spec limits.
    fn bins(&self) -> Vec<usize> {
        let bin = |r: &Requirement| if let What::Harmonic { k } = r.what { Some(k) } else { None };
        self.wanted.iter().filter_map(bin).collect()
    }

    /// Overshoot and settling of a step and of the move, and the command's rms under the disturbance, where limits ask for them: the last one of a box by the
    /// plant as it stands only, which bounds from below.
    fn records(&self, plant: &Plant, bounds: &LoopBounds) -> ([BoundedFigure; 2], [BoundedFigure; 2], BoundedFigure) {
        let (c, limits) = (self.controller, &self.spec.limits);
        let members = Members {
            plant,
            sections: self.held,
            controller: c,
            uncertainty: self.uncertainty,
            max_sensitivity: bounds.max_sensitivity.high,
        };
        let members = self.uncertainty.any().then_some(&members);
        let own = |b: BoundedFigure| if self.uncertainty.any() { BoundedFigure { high: None, ..b } } else { b };
        let stepped = limits.overshoot_percent.is_some() || limits.settling_s.is_some();
        let of_step = if stepped { step::step(plant, self.held, c, members) } else { Default::default() };
        let of_end = match &self.spec.profile {
            Some(profile) if limits.at_end.any() => {
                let band = limits.at_end.band.unwrap_or(f64::INFINITY);
                step::move_end(plant, self.held, c, profile, band, members)
            }
            _ => Default::default(),
        };
        let command = match &self.spec.disturbance {
            Some(Disturbance::Coloured { rms, corner_hz })
                if limits.command_rms.is_some() && self.spec.profile.is_none() =>
            {
                own(step::command_rms(plant, self.held, c, *rms, *corner_hz))
            }
            // The sum over a tabulated density is not bounded.
            _ => BoundedFigure::default(),
        };
        (of_step, of_end, command)
    }
}
