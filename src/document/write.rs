//! Writing whole files: a temporary name beside the target, flushed to disk, then renamed over it; several files as one set.

use super::DocumentError;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Files begun by this process: two threads that write one file must not share its temporary name.
static BEGUN: AtomicUsize = AtomicUsize::new(0);

/// A name beside `file` that nobody else writes to, for what is not whole yet.
pub fn temporary_beside(file: &Path) -> PathBuf {
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let (process, count) = (std::process::id(), BEGUN.fetch_add(1, Ordering::Relaxed));
    file.with_file_name(format!(".{name}.{process}.{count}.part"))
}

/// Refuses a place where no file can be written: a folder, a device or a pipe stands there, a link leads nowhere, or the way to it leads
/// through a file. A long command asks before it starts.
pub fn check_target(file: &Path) -> Result<(), DocumentError> {
    target(file).map(|_| ())
}

/// The file that a write goes to: `file` itself, or what a link leads to. Renaming onto a link, a device or a pipe would replace it.
fn target(file: &Path) -> Result<PathBuf, DocumentError> {
    let refused = |kind: ErrorKind| DocumentError::Io { file: file.into(), action: "write", source: kind.into() };
    let no_file = |found| DocumentError::NoFile { file: file.into(), found };
    let Ok(there) = std::fs::symlink_metadata(file) else {
        return match file.ancestors().skip(1).find(|p| p.exists()) {
            Some(there) if !there.is_dir() => Err(refused(ErrorKind::NotADirectory)),
            _ => Ok(file.into()),
        };
    };
    let end = match there.is_symlink() {
        true => std::fs::canonicalize(file).map_err(|_| no_file("a link that leads to no file"))?,
        false => file.into(),
    };
    let kind =
        std::fs::metadata(&end).map_err(|source| DocumentError::Io { file: file.into(), action: "write", source })?;
    match (kind.is_dir(), kind.is_file()) {
        (true, _) => Err(refused(ErrorKind::IsADirectory)),
        (_, true) => Ok(end),
        _ => Err(no_file("a device, a pipe or a socket")),
    }
}

/// Puts `bytes` under a temporary name beside `end`, flushed.
fn stage(file: &Path, end: &Path, bytes: &[u8]) -> Result<PathBuf, DocumentError> {
    let fail = |action| move |source| DocumentError::Io { file: file.into(), action, source };
    let folder = match end.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(fail("make its folder"))?;
    let temporary = temporary_beside(end);
    let written = std::fs::File::create(&temporary).and_then(|mut f| f.write_all(bytes).and_then(|()| f.sync_all()));
    written.map_err(|source| {
        // The half-written file is of no use to anybody; the error that matters is the one being reported.
        let _ = std::fs::remove_file(&temporary);
        fail("write")(source)
    })?;
    Ok(temporary)
}

/// Writes `bytes` so that the file is either the old one or the new one, never a part of either.
pub fn write_whole(file: &Path, bytes: &[u8]) -> Result<(), DocumentError> {
    let mut set = FileSet::default();
    set.write(file, bytes);
    set.commit()
}

/// [`write_whole`] for text.
pub fn write_text(file: &Path, text: &str) -> Result<(), DocumentError> {
    write_whole(file, text.as_bytes())
}

/// Files that belong together: all of them appear whole, or none and everything is as it was.
///
/// A process that is killed between two renames leaves some new and some old files, each whole; a full disk, a folder in the way or a missing
/// permission leaves the old ones.
#[derive(Clone, Debug, Default)]
pub struct FileSet {
    writes: Vec<(PathBuf, Vec<u8>)>,
    removed: Vec<PathBuf>,
}

impl FileSet {
    /// Adds a file.
    pub fn write(&mut self, file: &Path, bytes: impl Into<Vec<u8>>) {
        self.writes.push((file.into(), bytes.into()));
    }

    /// A file that must not be there beside the new ones; nothing where it is not.
    pub fn remove(&mut self, file: &Path) {
        self.removed.push(file.into());
    }

    /// The files in the order in which they were added.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.writes.iter().map(|(file, _)| file.as_path())
    }

    /// Writes all of them, or changes nothing.
    pub fn commit(self) -> Result<(), DocumentError> {
        let mut staged: Vec<(&Path, PathBuf, PathBuf)> = Vec::with_capacity(self.writes.len());
        for (file, bytes) in &self.writes {
            match target(file).and_then(|end| stage(file, &end, bytes).map(|t| (end, t))) {
                Ok((end, temporary)) => staged.push((file, end, temporary)),
                Err(e) => {
                    staged.iter().for_each(|(_, _, temporary)| drop(std::fs::remove_file(temporary)));
                    return Err(e);
                }
            }
        }
        // Everything is on the disk. What is replaced is kept under another name until all of it is in place.
        let alone = staged.len() + self.removed.len() == 1;
        let aside = |end: &Path| -> std::io::Result<Option<PathBuf>> {
            if alone || !end.exists() {
                return Ok(None);
            }
            let kept = temporary_beside(end);
            std::fs::hard_link(end, &kept).or_else(|_| std::fs::copy(end, &kept).map(|_| ()))?;
            Ok(Some(kept))
        };
        let moves = staged.iter().map(|(file, end, temporary)| (*file, end.as_path(), Some(temporary.as_path())));
        let removals = self.removed.iter().map(|f| (f.as_path(), f.as_path(), None)).filter(|(_, end, _)| end.exists());
        let mut done: Vec<(PathBuf, Option<PathBuf>)> = Vec::new();
        let mut failed = None;
        for (file, end, temporary) in moves.chain(removals) {
            let fail = |source| DocumentError::Io { file: file.into(), action: "write", source };
            let kept = match aside(end) {
                Ok(kept) => kept,
                Err(source) => {
                    failed = Some(fail(source));
                    break;
                }
            };
            let moved = match temporary {
                Some(temporary) => std::fs::rename(temporary, end),
                None => std::fs::remove_file(end),
            };
            if let Err(source) = moved {
                kept.iter().for_each(|kept| drop(std::fs::remove_file(kept)));
                failed = Some(fail(source));
                break;
            }
            done.push((end.into(), kept));
        }
        let Some(error) = failed else {
            done.iter().filter_map(|(_, kept)| kept.as_ref()).for_each(|kept| drop(std::fs::remove_file(kept)));
            return Ok(());
        };
        for (end, kept) in done.iter().rev() {
            let _ = match kept {
                Some(kept) => std::fs::rename(kept, end),
                None => std::fs::remove_file(end),
            };
        }
        staged.iter().for_each(|(_, _, temporary)| drop(std::fs::remove_file(temporary)));
        Err(error)
    }
}
