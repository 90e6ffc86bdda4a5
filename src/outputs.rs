//! Outputs of a command before it starts: none is an input, none is lost that somebody else wrote.
//!
//! In: the files that a command will write and those that it reads. Out: permission, or a refusal that says the way on. The rule is in
//! `specs/files.md`, "Nothing lost".

use super::{Failure, Screen};
use servotune::document::{check_target, parse_toml, read_text};
use servotune::lti::PlantFile;
use servotune::tune::GainTable;
use std::path::{Path, PathBuf};

/// The files that a command is about to write.
pub(super) struct Outputs {
    /// What stands there and is somebody else's: moved aside before the first write.
    foreign: Vec<PathBuf>,
}

impl Outputs {
    /// Refuses what would lose something. A long command asks before it starts.
    pub(super) fn new(outputs: &[&PathBuf], inputs: &[PathBuf], force: bool) -> Result<Outputs, Failure> {
        let mut foreign = Vec::new();
        for out in outputs {
            if out.as_os_str() == "-" {
                return Err(Failure::NoStdout);
            }
            if let Some(input) = inputs.iter().find(|input| same(out, input)) {
                return Err(Failure::OutputIsInput { out: (*out).clone(), input: input.clone() });
            }
            check_target(out)?;
            if out.exists() && !own(out) {
                if !force {
                    return Err(Failure::Kept { file: (*out).clone() });
                }
                foreign.push((*out).clone());
            }
        }
        for (i, out) in outputs.iter().enumerate() {
            if let Some(twin) = outputs[..i].iter().find(|o| same(out, o)) {
                return Err(Failure::OutputIsInput { out: (*out).clone(), input: (*twin).clone() });
            }
        }
        Ok(Outputs { foreign })
    }

    /// The same for a folder of files whose texts are known beforehand: what stands there with the same text is nobody's loss.
    pub(super) fn known(texts: &[(PathBuf, &[u8])], force: bool) -> Result<Outputs, Failure> {
        let changed =
            |(file, text): &&(PathBuf, &[u8])| file.exists() && std::fs::read(file).ok().as_deref() != Some(*text);
        let changed: Vec<&PathBuf> = texts.iter().filter(changed).map(|(file, _)| file).collect();
        Outputs::new(&changed, &[], force)
    }

    /// Copies what is about to be replaced, and says where; called when the results are there, so that a refusal changes nothing.
    pub(super) fn keep_old(&self, screen: &mut Screen) -> Result<(), Failure> {
        for file in &self.foreign {
            let kept = free_name(file);
            let fail = |source| servotune::document::DocumentError::Io {
                file: kept.clone(),
                action: "keep the old file",
                source,
            };
            std::fs::copy(file, &kept).map_err(fail)?;
            screen.say(&format!("{} is replaced; what stood there is kept as {}", file.display(), kept.display()));
        }
        Ok(())
    }
}

/// NAME.old, or with a number where that is taken.
fn free_name(file: &Path) -> PathBuf {
    let name = |ending: String| {
        let mut name = file.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    let mut free = name(".old".to_owned());
    let mut number = 2;
    while free.symlink_metadata().is_ok() {
        free = name(format!(".old{number}"));
        number += 1;
    }
    free
}

/// Whether two paths are one file: the same name, a link, or a second name of it.
fn same(a: &Path, b: &Path) -> bool {
    if a == b {
        return true;
    }
    let (Ok(x), Ok(y)) = (a.canonicalize(), b.canonicalize()) else { return false };
    if x == y {
        return true;
    }
    #[cfg(unix)]
    if let (Ok(x), Ok(y)) = (x.metadata(), y.metadata()) {
        use std::os::unix::fs::MetadataExt;
        return (x.dev(), x.ino()) == (y.dev(), y.ino());
    }
    false
}

/// Whether the program wrote the file and nobody has changed it in a way that shows: a gain table or a plant that comes out to the byte when it is read and
/// written again, a page or a document with our mark, code that we exported. Such a file can be made again.
fn own(file: &Path) -> bool {
    let Ok(text) = read_text(file) else { return false };
    if text.is_empty() {
        return true;
    }
    let head = &text[..text.char_indices().nth(2000).map_or(text.len(), |(i, _)| i)];
    let marked = [
        "\"schema\": \"servotune.",
        "Made by a program: change the gains and export again",
        "<meta name=\"generator\" content=\"servotune",
    ];
    if marked.iter().any(|mark| head.contains(mark)) {
        return true;
    }
    let table = GainTable::parse(file, &text).ok().and_then(|t| t.text().ok());
    let plant = || parse_toml::<PlantFile>(file, &text).ok().and_then(|p| toml::to_string(&p).ok());
    table.or_else(plant).is_some_and(|again| again == text)
}
