//! `servotune check`: what a file is, whether it is right, and what it means in words.

use super::check_kind::{FileKind, kind_of};
use super::check_words::{Meaning, meaning};
use super::start_arguments::CheckArguments;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::feedback::{Margins, ModelLoop, confirmed_margins};
use servotune::lti::DiscretePlant;
use std::path::{Path, PathBuf};

/// One file, looked at.
#[derive(Serialize)]
struct Looked {
    file: PathBuf,
    /// What it is; none where nobody can tell.
    kind: Option<FileKind>,
    right: bool,
    says: Vec<String>,
    error: Option<String>,
    #[serde(skip)]
    meaning: Option<Meaning>,
}

/// The margins of one plant under one controller.
#[derive(Serialize)]
struct Pair {
    plant: PathBuf,
    controller: PathBuf,
    margins: Option<Margins>,
    says: String,
}

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    right: bool,
    files: &'a [Looked],
    pairs: &'a [Pair],
}

pub(super) fn run(a: &CheckArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let mut looked = Vec::with_capacity(a.files.len());
    let mut unread = None;
    for file in &a.files {
        match look(file) {
            Ok(one) => looked.push(one),
            // The other files are looked at all the same; one that is not there decides the ending.
            Err(failure) => {
                let error = Some(failure.whole());
                looked.push(Looked {
                    file: file.clone(),
                    kind: None,
                    right: false,
                    says: vec![],
                    error,
                    meaning: None,
                });
                unread = Some(failure);
            }
        }
    }
    let pairs = pairs(&looked);
    let right = looked.iter().all(|l| l.right);
    let mut text: String = looked.iter().map(Looked::text).collect();
    text.extend(pairs.iter().map(|p| format!("{}\n", p.says)));
    if let (Some(failure), 1) = (&unread, a.files.len()) {
        return Err(Failure::Unfit { said: failure.whole() });
    }
    screen.result(&Document { schema: "servotune.check/1", right, files: &looked, pairs: &pairs }, &text)?;
    match (unread, right) {
        (Some(_), _) => Err(Failure::Unfit { said: "not every file can be read or told; see above".to_owned() }),
        (None, true) => Ok(Ending::Accepted),
        (None, false) => Ok(Ending::Rejected),
    }
}

fn look(file: &Path) -> Result<Looked, Failure> {
    let kind = kind_of(file)?;
    let (right, says, error, meaning) = match meaning(kind, file) {
        Ok(m) => (m.doubts.is_empty(), m.says.iter().chain(&m.doubts).cloned().collect(), None, Some(m)),
        Err(failure) => (false, Vec::new(), Some(failure.whole()), None),
    };
    Ok(Looked { file: file.into(), kind: Some(kind), right, says, error, meaning })
}

impl Looked {
    fn text(&self) -> String {
        let kind = self.kind.map_or("not known", FileKind::name);
        let mut text = format!("{}: {kind}, {}\n", self.file.display(), if self.right { "right" } else { "NOT right" });
        for line in self.says.iter().chain(&self.error) {
            text += &format!("  {}\n", line.replace('\n', "\n  "));
        }
        text
    }
}

/// Every plant under every controller.
fn pairs(looked: &[Looked]) -> Vec<Pair> {
    let mut all = Vec::new();
    for p in looked {
        for c in looked {
            let both = (&p.meaning, &c.meaning);
            let (Some(Meaning { plant: Some(plant), .. }), Some(Meaning { controller: Some(controller), .. })) = both
            else {
                continue;
            };
            let judged = judged(plant, controller);
            let who = format!("{} under {}", p.file.display(), c.file.display());
            let (margins, says) = match judged {
                Ok(m) => {
                    let said = in_words(&m);
                    (Some(m), format!("{who}: {said}"))
                }
                Err(failure) => (None, format!("{who}: no margins, {}", failure.whole())),
            };
            all.push(Pair { plant: p.file.clone(), controller: c.file.clone(), margins, says });
        }
    }
    all
}

fn judged(plant: &servotune::lti::Plant, controller: &servotune::controller::Controller) -> Result<Margins, Failure> {
    let sections = controller.sections().map_err(|source| Failure::Controller { file: "controller".into(), source })?;
    let sampled = DiscretePlant::of(plant, sections.sample_time_s)?;
    Ok(confirmed_margins(&ModelLoop::new(&sampled, &sections)?)?)
}

fn in_words(m: &Margins) -> String {
    if !m.stable {
        return "the loop is UNSTABLE".to_owned();
    }
    let at = |value: Option<f64>, unit: &str, hz: Option<f64>| match (value, hz) {
        (Some(v), Some(hz)) => format!("{v:.2} {unit} at {hz:.5} Hz"),
        _ => "without a crossing".to_owned(),
    };
    format!(
        "stable, phase margin {}, gain margin {}, max sensitivity {:.3}",
        at(m.phase_margin_deg, "deg", m.gain_crossover_hz),
        at(m.gain_margin_db, "dB", m.phase_crossover_hz),
        m.max_sensitivity
    )
}
