//! How far a search or a proof is: nothing in the first two seconds, then one line on a terminal, a line every ten seconds elsewhere. The clock is read here.

use servotune::tune::SearchStep;
use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Before this nothing is said: most commands are done.
const FIRST: Duration = Duration::from_secs(2);
/// Between two looks at a terminal's line, and between two plain lines.
const LINE_OF_TERMINAL: Duration = Duration::from_millis(200);
const LINE: Duration = Duration::from_secs(10);

/// Progress on stderr.
pub(super) struct Pace {
    begun: Instant,
    terminal: bool,
    quiet: bool,
    said: Mutex<Option<Instant>>,
}

impl Pace {
    /// Begins now; says nothing where `quiet`.
    pub(super) fn new(quiet: bool) -> Pace {
        Pace { begun: Instant::now(), terminal: std::io::stderr().is_terminal(), quiet, said: Mutex::new(None) }
    }

    /// A search after one of its rounds; the time left is that of the rounds that are sure.
    pub(super) fn search(&self, s: &SearchStep) {
        self.say(|seconds| {
            let mut text = format!("searching: {} polishes", s.polishes);
            text += &s.best.map_or(", no limit set is met yet".to_owned(), |b| format!(", best objective {b:.4e}"));
            if s.rounds > 0 {
                let rest = seconds / (s.rounds + 1) as f64 * s.rounds_left as f64;
                text += &format!(", {} left if nothing better is found", left(rest));
            }
            text
        });
    }

    /// `done` of at most `of` pieces of `what`.
    pub(super) fn part(&self, what: &str, done: usize, of: usize) {
        self.say(|seconds| {
            let rest = seconds / done.max(1) as f64 * of.saturating_sub(done) as f64;
            format!("{what}: {done} of {of}, at most {} left", left(rest))
        });
    }

    fn say(&self, text: impl FnOnce(f64) -> String) {
        let spent = self.begun.elapsed();
        if self.quiet || spent < FIRST {
            return;
        }
        // A poisoned lock only means that another thread failed while it printed.
        let Ok(mut said) = self.said.lock() else { return };
        let pause = if self.terminal { LINE_OF_TERMINAL } else { LINE };
        if said.is_some_and(|at| at.elapsed() < pause) {
            return;
        }
        *said = Some(Instant::now());
        let text = text(spent.as_secs_f64());
        let mut err = std::io::stderr().lock();
        // There is nowhere to report that stderr is closed.
        let _ = if self.terminal {
            write!(err, "\r{text}\x1b[K").and_then(|()| err.flush())
        } else {
            writeln!(err, "{text}")
        };
    }
}

impl Drop for Pace {
    /// The terminal's line is gone with the work.
    fn drop(&mut self) {
        if self.terminal && self.said.lock().is_ok_and(|s| s.is_some()) {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}

/// Seconds as a person says them.
pub(super) fn left(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
