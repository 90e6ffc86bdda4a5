//! A record made ready: what acted on the plant, what it answered, and whose repeat it is.

use super::lap;
use super::turning_points::{newest, turning_points};
use crate::numeric::statistics::mean;
use crate::recording::{Case, Record, Role};

/// One record of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Name for reports.
    pub name: String,
    /// Fitting or judging.
    pub role: Role,
    /// When it began in its session, the records taken one after another in the order of the case (s).
    pub began_s: f64,
    /// When it begins in the record that it is an excerpt of (s).
    pub from_s: f64,
    /// Positions at which it turned round before then, oldest first, from where the record began; none where it begins with its record.
    pub turned: Vec<f64>,
    /// Index of its repeat group; each record without one is a group of its own.
    pub group: usize,
    /// Reference (position_unit), where recorded.
    pub reference: Option<Vec<f64>>,
    /// Command of the controller (command_unit).
    pub command: Vec<f64>,
    /// Excitation behind the controller (command_unit).
    pub excitation: Vec<f64>,
    /// Command plus excitation: what goes into the amplifier.
    pub input: Vec<f64>,
    /// Position as recorded.
    pub position: Vec<f64>,
    /// The command that is taken to have stood before the record began (command_unit).
    pub before: f64,
    /// The position at which it stood then.
    pub origin: f64,
    /// Whether it stood at rest as the record began: the forces on it were in balance then.
    pub rested: bool,
    /// Whether a push from outside falls into it, which no repeat shares: no model is fitted to it nor judged by it.
    pub shocked: bool,
    /// PES where recorded; NaN between servo samples.
    pub pes: Option<Vec<f64>>,
    /// Spindle angle (rad), where recorded.
    pub spindle_rad: Option<Vec<f64>>,
    /// Temperature above the record's first (°C), where recorded.
    pub temperature: Option<Vec<f64>>,
    /// Further inputs that act on the position, in the order of the case, each as long as the position (unit of their column).
    pub further: Vec<Vec<f64>>,
    /// What further inputs move the position by, where that was taken out of it (position_unit); empty where nothing was.
    pub coupled: Vec<f64>,
}

impl Run {
    /// The same run with a command that was measured at the samples and moves between them, instead of being held.
    ///
    /// A held value answers like the command half a sample later, weakened by sin(a)/a with a = pi f T. The value to hold is
    /// therefore the command half a sample ahead with its upper band raised: the filter of eight taps whose response meets
    /// a/sin(a) to the seventh order (1e-4 off at an eighth of the sample rate).
    pub fn measured(&self) -> Run {
        let u = &self.input;
        let at = |k: isize| u[k.clamp(0, u.len() as isize - 1) as usize];
        let value = |k: isize| (0..4).map(|j| AHEAD[j as usize] * (at(k - j) + at(k + 1 + j))).sum();
        Run { input: (0..u.len() as isize).map(value).collect(), ..self.clone() }
    }

    /// A part of the record, as one of its own; it does not begin at rest.
    pub fn stretch(&self, from: usize, to: usize, sample_time_s: f64) -> Run {
        let cut = |x: &[f64]| x[from..to].to_vec();
        let may = |x: &Option<Vec<f64>>| x.as_deref().map(cut);
        let before = turning_points(&self.position[..from]);
        Run {
            turned: newest([&self.turned[..], &before].concat()),
            began_s: self.began_s + from as f64 * sample_time_s,
            from_s: self.from_s + from as f64 * sample_time_s,
            reference: may(&self.reference),
            command: cut(&self.command),
            excitation: cut(&self.excitation),
            input: cut(&self.input),
            position: cut(&self.position),
            before: if from == 0 { self.before } else { self.input[from - 1] },
            origin: if from == 0 { self.origin } else { self.position[from] },
            rested: self.rested && from == 0,
            pes: may(&self.pes),
            spindle_rad: may(&self.spindle_rad),
            temperature: may(&self.temperature),
            further: self.further.iter().map(|x| cut(x)).collect(),
            coupled: if self.coupled.is_empty() { Vec::new() } else { cut(&self.coupled) },
            name: self.name.clone(),
            role: self.role,
            group: self.group,
            shocked: self.shocked,
        }
    }

    /// The same run without a motion of the position that the controller goes on hearing.
    pub fn without(&self, motion: &[f64]) -> Run {
        let position = self.position.iter().zip(motion).map(|(y, m)| y - m).collect();
        let origin =
            self.origin - mean(&motion[..quiet(self.reference.as_deref().unwrap_or_default(), &self.excitation)]);
        let coupled = match self.coupled.is_empty() {
            true => motion.to_vec(),
            false => self.coupled.iter().zip(motion).map(|(c, m)| c + m).collect(),
        };
        Run { position, origin, coupled, ..self.clone() }
    }

    /// Samples.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// The lap of what drives the record, where that repeats at least once: of reference and excitation, or of the command where nothing else is
    /// known or these do not repeat.
    pub fn lap(&self) -> Option<usize> {
        let known = self.reference.as_ref().map_or(vec![&self.command[..]], |r| vec![r, &self.excitation]);
        lap::exact(&known).or_else(|| lap::measured(&self.command))
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }
}

/// Half the taps of [`Run::measured`]; they solve the four equations of the Taylor series.
const AHEAD: [f64; 4] = [533.0 / 840.0, -139.0 / 840.0, 29.0 / 840.0, -1.0 / 280.0];

/// Samples at the start over which a command at rest is averaged.
const AT_REST: usize = 16;

/// Samples for which a series stands still at the start, up to [`AT_REST`].
fn still(series: &[f64]) -> usize {
    series.iter().take(AT_REST).take_while(|v| **v == series[0]).count()
}

/// Samples from the start for which reference and excitation stand still; at least one.
fn quiet(reference: &[f64], excitation: &[f64]) -> usize {
    still(reference).min(still(excitation)).max(1).min(excitation.len())
}

/// The reference of a record, where it tells what drives the machine.
///
/// Without a controller, columns of reference and excitation that never move were filled in by whoever wrote the log: the command is the drive,
/// and where they stand still the machine need not.
fn told_reference(record: &Record, controlled: bool) -> Option<&[f64]> {
    let moves = |x: &[f64]| x.iter().any(|v| *v != x[0]);
    record.reference.as_deref().filter(|r| controlled || moves(r) || moves(&record.excitation))
}

/// Position and command before a record began.
///
/// Their means as long as reference and excitation stand still: what the controller held against springs and cables. An excitation that sets in
/// at once leaves of the position the first sample; the command that held the arm is then the mean of all that was put in, where the reference
/// never moves.
fn stood(record: &Record, reference: &[f64]) -> [f64; 2] {
    let quiet = quiet(reference, &record.excitation);
    let origin = mean(&record.position[..quiet]);
    let held = still(reference) >= AT_REST && quiet < AT_REST && reference.iter().all(|r| *r == reference[0]);
    let before = if held { mean(&record.command) + mean(&record.excitation) } else { mean(&record.command[..quiet]) };
    [origin, before]
}

/// The records of a case as runs, groups numbered in the order of their first record; `controlled` where a controller made the command.
pub fn runs(case: &Case, controlled: bool) -> Vec<Run> {
    let mut groups: Vec<String> = Vec::new();
    let mut session_s = 0.0;
    case.records
        .iter()
        .enumerate()
        .map(|(i, (entry, record))| {
            let key = entry.repeat_group.clone().unwrap_or_else(|| format!("\u{0}{i}"));
            let group = groups.iter().position(|g| *g == key).unwrap_or_else(|| {
                groups.push(key);
                groups.len() - 1
            });
            let began_s = session_s;
            session_s += record.len() as f64 * record.sample_time_s;
            let reference = told_reference(record, controlled);
            let [origin, before] = stood(record, reference.unwrap_or_default());
            let input: Vec<f64> = record.command.iter().zip(&record.excitation).map(|(c, e)| c + e).collect();
            Run {
                name: entry.name(),
                role: entry.role,
                began_s,
                from_s: 0.0,
                turned: Vec::new(),
                group,
                rested: still(reference.unwrap_or_default()) >= AT_REST.min(record.position.len()),
                shocked: false,
                before,
                origin,
                reference: reference.map(<[f64]>::to_vec),
                command: record.command.clone(),
                excitation: record.excitation.clone(),
                input,
                position: record.position.clone(),
                pes: record.pes.clone(),
                spindle_rad: record.spindle_rad.clone(),
                temperature: record.temperature_c.as_ref().map(|t| t.iter().map(|x| x - t[0]).collect()),
                further: record.further.clone(),
                coupled: Vec::new(),
            }
        })
        .collect()
}

/// The mean of repeats of equal length: one run with less noise. The logs beside the motion are the first one's.
pub fn mean_run(runs: &[Run], repeats: &[usize]) -> Run {
    let mut mean = runs[repeats[0]].clone();
    let scale = 1.0 / repeats.len() as f64;
    type Pick = fn(&Run) -> &Vec<f64>;
    let average = |pick: Pick| -> Vec<f64> {
        (0..mean.len()).map(|k| scale * repeats.iter().map(|&r| pick(&runs[r])[k]).sum::<f64>()).collect()
    };
    let (command, excitation, input, position) =
        (average(|r| &r.command), average(|r| &r.excitation), average(|r| &r.input), average(|r| &r.position));
    if !mean.coupled.is_empty() {
        mean.coupled = average(|r| &r.coupled);
    }
    (mean.command, mean.excitation, mean.input, mean.position) = (command, excitation, input, position);
    mean.began_s = scale * repeats.iter().map(|&r| runs[r].began_s).sum::<f64>();
    mean.before = scale * repeats.iter().map(|&r| runs[r].before).sum::<f64>();
    mean.origin = scale * repeats.iter().map(|&r| runs[r].origin).sum::<f64>();
    mean
}

#[cfg(test)]
pub(in crate::diagnose) mod tests {
    use super::{AHEAD, Run};
    use crate::recording::Role;

    /// A run with nothing but positions.
    pub fn run_at(position: Vec<f64>) -> Run {
        let still = vec![0.0; position.len()];
        Run {
            name: "r".into(),
            role: Role::Fit,
            began_s: 0.0,
            from_s: 0.0,
            turned: vec![],
            group: 0,
            reference: None,
            command: still.clone(),
            excitation: still.clone(),
            input: still,
            position,
            before: 0.0,
            origin: 0.0,
            rested: true,
            shocked: false,
            pes: None,
            spindle_rad: None,
            temperature: None,
            further: vec![],
            coupled: vec![],
        }
    }

    #[test]
    fn a_measured_command_is_raised_as_a_hold_weakens() {
        // At an eighth of the sample rate and below; the bound is the first term left out.
        for a in [0.05f64, 0.2, std::f64::consts::FRAC_PI_8] {
            let response: f64 = (0..4).map(|j| 2.0 * AHEAD[j] * ((2 * j + 1) as f64 * a).cos()).sum();
            assert!((response * a.sin() / a - 1.0).abs() < 2e-4, "{a}");
        }
    }
}
