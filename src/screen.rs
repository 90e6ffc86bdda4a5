//! What a person sees: results on stdout, messages and progress on stderr. Names and texts of files reach a terminal as words, never as commands.

use super::Failure;
use serde::Serialize;
use servotune::document::printable;
use servotune::document::size_limits::cut;
use std::error::Error;
use std::io::Write;

/// Longest refusal (characters).
const REFUSAL: usize = 20_000;

/// The two streams. With `--json` stdout carries one document and nothing else.
#[derive(Debug)]
pub(super) struct Screen {
    json: bool,
}

impl Screen {
    pub(super) fn new(json: bool) -> Screen {
        Screen { json }
    }

    /// The result: `document` with `--json`, else `text`. A reader that went away (`| head`) is not an error.
    pub(super) fn result(&mut self, document: &impl Serialize, text: &str) -> Result<(), Failure> {
        let out = if self.json {
            serde_json::to_string_pretty(document).map_err(|source| Failure::Json { source })? + "\n"
        } else {
            printable(text)
        };
        match std::io::stdout().lock().write_all(out.as_bytes()) {
            Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::Stdout { source: e }),
            _ => Ok(()),
        }
    }

    /// A message beside the result.
    pub(super) fn say(&mut self, text: &str) {
        // There is nowhere to report that stderr is closed.
        let _ = writeln!(std::io::stderr().lock(), "{}", printable(text));
    }

    /// The refusal and its causes.
    pub(super) fn refuse(&mut self, failure: &Failure) {
        let mut text = format!("error: {failure}");
        let mut cause = failure.source();
        while let Some(c) = cause {
            let more = c.to_string();
            // A transparent wrapper repeats what it wraps.
            if !text.contains(&more) {
                text.push_str(&format!("\n  because: {more}"));
            }
            cause = c.source();
        }
        // A backstop: the rooms quote pieces of a file, never a whole one.
        self.say(&cut(&text, REFUSAL));
    }
}
