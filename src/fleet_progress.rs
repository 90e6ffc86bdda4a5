//! How far a run is: a bar with rate and time left on a terminal, plain lines elsewhere. The clock is read here.

use super::pace::left;
use servotune_fleet::{Stage, Watch};
use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Progress on stderr.
pub(super) struct Progress {
    terminal: bool,
    state: Mutex<Option<State>>,
    /// Slots done when they were counted first and last, and when that was.
    slots: Mutex<Option<[Count; 2]>>,
}

/// Slots done, when, and the processor's time till then (s).
#[derive(Clone, Copy)]
struct Count {
    done: usize,
    at: Instant,
    cpu_s: Option<f64>,
}

struct State {
    stage: Stage,
    begun: Instant,
    /// What was done when the stage began: a resumed run has not earned it.
    before: usize,
    said: Option<Instant>,
}

/// Between two looks at the bar, and between two plain lines.
const BAR: Duration = Duration::from_millis(100);
const LINE: Duration = Duration::from_secs(10);
/// Characters of the bar.
const WIDTH: usize = 30;

impl Progress {
    pub(super) fn new() -> Progress {
        Progress { terminal: std::io::stderr().is_terminal(), state: Mutex::new(None), slots: Mutex::new(None) }
    }

    /// Slots that this process has seen done since it began.
    pub(super) fn earned(&self) -> usize {
        self.slots.lock().map_or(0, |s| s.map_or(0, |[first, last]| last.done.saturating_sub(first.done)))
    }

    /// Time from the first to the last count of slots (s).
    pub(super) fn slots_stage_s(&self) -> f64 {
        let between = |[first, last]: [Count; 2]| last.at.duration_since(first.at).as_secs_f64();
        self.slots.lock().map_or(0.0, |s| s.map_or(0.0, between))
    }

    /// Processor time of all threads from the first to the last count of slots (s), where the system tells.
    pub(super) fn slots_stage_cpu_s(&self) -> Option<f64> {
        self.slots.lock().ok()?.and_then(|[first, last]| Some(last.cpu_s? - first.cpu_s?))
    }

    /// Ends the bar's line.
    pub(super) fn close(&self) {
        if self.terminal && self.state.lock().is_ok_and(|s| s.is_some()) {
            let _ = writeln!(std::io::stderr());
        }
    }
}

/// Ticks of the kernel's clock in a second, the same on every Linux.
const TICKS: f64 = 100.0;

/// Processor time of this process so far (s), as Linux tells it.
pub(super) fn cpu_s() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name before the last bracket may hold blanks; user and system time are the 12th and 13th words after it.
    let mut words = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks = words.next()?.parse::<f64>().ok()? + words.next()?.parse::<f64>().ok()?;
    Some(ticks / TICKS)
}

fn name(stage: Stage) -> &'static str {
    match stage {
        Stage::Pilots => "pilots",
        Stage::Slots => "slots",
        Stage::Explain => "explaining",
        Stage::Share => "shared tables",
    }
}

/// The words of a line; no rate before there is one.
fn words(stage: Stage, done: usize, of: usize, before: usize, seconds: f64) -> String {
    let earned = done.saturating_sub(before);
    let mut text = format!("{} {done} of {of}", name(stage));
    if earned > 0 && seconds > 0.0 {
        let rate = earned as f64 / seconds;
        text += &format!(", {rate:.1}/s");
        if done < of {
            text += &format!(", {} left", left((of - done) as f64 / rate));
        }
    }
    text
}

impl Watch for Progress {
    fn step(&self, stage: Stage, done: usize, of: usize) {
        if stage == Stage::Slots
            && let Ok(mut slots) = self.slots.lock()
        {
            let now = Count { done, at: Instant::now(), cpu_s: cpu_s() };
            *slots = Some([slots.map_or(now, |[first, _]| first), now]);
        }
        // A poisoned lock only means that another thread failed while it printed.
        let Ok(mut state) = self.state.lock() else { return };
        let now = Instant::now();
        let new = state.as_ref().is_none_or(|s| s.stage != stage);
        if new {
            if state.is_some() && self.terminal {
                let _ = writeln!(std::io::stderr());
            }
            *state = Some(State { stage, begun: now, before: done, said: None });
        }
        let Some(s) = state.as_mut() else { return };
        let pause = if self.terminal { BAR } else { LINE };
        let due = s.said.is_none_or(|said| now.duration_since(said) >= pause) || done == of;
        if !due {
            return;
        }
        s.said = Some(now);
        let text = words(stage, done, of, s.before, now.duration_since(s.begun).as_secs_f64());
        let mut err = std::io::stderr().lock();
        // There is nowhere to report that stderr is closed.
        let _ = if self.terminal {
            let full = (WIDTH * done.min(of)).checked_div(of).unwrap_or(WIDTH);
            write!(err, "\r[{}{}] {text}\x1b[K", "#".repeat(full), "-".repeat(WIDTH - full)).and_then(|()| err.flush())
        } else {
            writeln!(err, "{text}")
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumed_run_has_not_earned_what_was_there() {
        // 300 of 1000 in 10 s, 200 of them from before: 10/s, 700 left in 70 s.
        assert_eq!(words(Stage::Slots, 300, 1000, 200, 10.0), "slots 300 of 1000, 10.0/s, 70 s left");
        assert_eq!(words(Stage::Slots, 200, 1000, 200, 10.0), "slots 200 of 1000");
        assert_eq!(words(Stage::Pilots, 8, 8, 0, 4.0), "pilots 8 of 8, 2.0/s");
    }
}
