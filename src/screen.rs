//! What a person sees: results on stdout, messages and progress on stderr. Names and texts of files reach a terminal as words, never as commands.

use super::pace::Pace;
use super::{Failure, colour};
use serde::Serialize;
use servotune::document::printable;
use servotune::document::size_limits::cut;
use std::io::Write;

/// Longest refusal (characters).
const REFUSAL: usize = 20_000;

/// How much is said beside the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Volume {
    /// Refusals only.
    Quiet,
    /// Decisions, progress, files written.
    Usual,
    /// Also what the files state by themselves.
    Verbose,
}

/// The two streams. With `--json` stdout carries one document and nothing else.
#[derive(Debug)]
pub(super) struct Screen {
    json: bool,
    volume: Volume,
    colours: bool,
    /// Stdout has its document.
    answered: bool,
}

/// The document of a refusal.
#[derive(Serialize)]
struct Refusal<'a> {
    schema: &'static str,
    error: &'a str,
    exit_code: u8,
}

impl Screen {
    pub(super) fn new(json: bool, volume: Volume) -> Screen {
        Screen { json, volume, colours: !json && colour::wanted(), answered: false }
    }

    /// The result: `document` with `--json`, else `text`. A reader that went away (`| head`) is not an error.
    pub(super) fn result(&mut self, document: &impl Serialize, text: &str) -> Result<(), Failure> {
        let out = if self.json {
            serde_json::to_string_pretty(document).map_err(|source| Failure::Json { source })? + "\n"
        } else if self.colours {
            colour::coloured(&printable(text))
        } else {
            printable(text)
        };
        self.answered = true;
        match std::io::stdout().lock().write_all(out.as_bytes()) {
            Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::Stdout { source: e }),
            _ => Ok(()),
        }
    }

    /// Progress of a long piece of work.
    pub(super) fn pace(&self) -> Pace {
        Pace::new(self.volume < Volume::Usual)
    }

    /// A message beside the result.
    pub(super) fn say(&mut self, text: &str) {
        if self.volume >= Volume::Usual {
            self.print(text);
        }
    }

    /// A message that only `-v` asks for.
    pub(super) fn detail(&mut self, text: &str) {
        if self.volume >= Volume::Verbose {
            self.print(text);
        }
    }

    /// A message that `--quiet` does not silence: without it the result would be taken for something else.
    pub(super) fn warn(&mut self, text: &str) {
        self.print(text);
    }

    fn print(&mut self, text: &str) {
        // There is nowhere to report that stderr is closed.
        let _ = writeln!(std::io::stderr().lock(), "{}", printable(text));
    }

    /// The refusal and its causes: on stderr, and with `--json` as a document on stdout.
    pub(super) fn refuse(&mut self, failure: &Failure) {
        // A backstop: the rooms quote pieces of a file, never a whole one.
        let text = cut(&failure.whole(), REFUSAL);
        self.print(&format!("error: {text}"));
        self.refusal(&text);
    }

    /// The same for words that are none of a command, which clap has printed.
    pub(super) fn refusal(&mut self, text: &str) {
        // A second document would make stdout no JSON.
        if self.json && !self.answered {
            let document = Refusal { schema: "servotune.error/1", error: text, exit_code: 2 };
            let _ = self.result(&document, "");
        }
    }
}
