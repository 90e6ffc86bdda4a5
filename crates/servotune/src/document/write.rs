//! Writing whole files: a temporary name beside the target, flushed to disk, then renamed over it; several files as one set.
//!
//! A temporary file is locked while it is written, so that what a dead process left behind can be told from what a living one writes.

use super::{DocumentError, check_name};
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Files begun by this process: two threads that write one file must not share its temporary name.
static BEGUN: AtomicUsize = AtomicUsize::new(0);

/// The path of `names` below `folder`. Each is held to the alphabet, and none that is there may be a link: what is written there stays in the folder.
pub fn below(folder: &Path, names: &[&str]) -> Result<PathBuf, DocumentError> {
    let mut path = folder.to_path_buf();
    for name in names {
        check_name(name).map_err(|source| DocumentError::Name { folder: folder.into(), source })?;
        path.push(name);
        if path.symlink_metadata().is_ok_and(|m| m.file_type().is_symlink()) {
            return Err(DocumentError::Link { file: path });
        }
    }
    Ok(path)
}

/// A file that is not whole yet, under a hidden name beside its own, gone when it is dropped before [`Temporary::place`].
#[derive(Debug)]
pub struct Temporary {
    /// The open file; locked where the system has locks.
    pub out: File,
    path: PathBuf,
    file: PathBuf,
}

impl Temporary {
    /// Begins a file that is to be `file`; its folder is made.
    pub fn begin(file: &Path) -> Result<Temporary, DocumentError> {
        let fail = |action| move |source| DocumentError::Io { file: file.into(), action, source };
        let end = target(file)?;
        std::fs::create_dir_all(folder_of(&end)).map_err(fail("make its folder"))?;
        let path = hidden_beside(&end);
        let out = File::create(&path).map_err(fail("write"))?;
        // Without locks on this file system nothing is told apart, and nothing is cleared.
        let _ = out.try_lock();
        Ok(Temporary { out, path, file: end })
    }

    /// Flushes the file to disk.
    pub fn sync(&self) -> Result<(), DocumentError> {
        self.out.sync_all().map_err(|source| self.io(source))
    }

    /// Gives the file its own name, over what stood there; it must have been flushed.
    pub fn place(self) -> Result<PathBuf, DocumentError> {
        std::fs::rename(&self.path, &self.file).map_err(|source| self.io(source))?;
        // The name reaches the disk with its folder; where a folder cannot be flushed, the system does it in its own time.
        let _ = File::open(folder_of(&self.file)).and_then(|f| f.sync_all());
        Ok(self.file.clone())
    }

    fn io(&self, source: std::io::Error) -> DocumentError {
        DocumentError::Io { file: self.file.clone(), action: "write", source }
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // After a rename there is nothing left of that name.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// A hidden name beside `file` that nobody else writes to.
fn hidden_beside(file: &Path) -> PathBuf {
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let (process, count) = (std::process::id(), BEGUN.fetch_add(1, Ordering::Relaxed));
    file.with_file_name(format!(".{name}.{process}.{count}.part"))
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Removes from a folder what dead processes began there and did not end (`.NAME.PROCESS.COUNT.part`), and says which.
pub fn clear_abandoned(folder: &Path) -> Vec<PathBuf> {
    // A folder that cannot be listed has nothing to be cleared.
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let left = entries.map(|e| e.path()).filter(|p| abandoned(p));
    left.filter(|p| std::fs::remove_file(p).is_ok()).collect()
}

/// Whether a path is a temporary file of a process that is no more.
fn abandoned(path: &Path) -> bool {
    let Some(name) = path.file_name().and_then(|n| n.to_str()) else { return false };
    let Some(inner) = name.strip_prefix('.').and_then(|n| n.strip_suffix(".part")) else { return false };
    let mut words = inner.rsplit('.');
    let [Some(count), Some(process)] = [words.next(), words.next()] else { return false };
    let number = |w: &str| !w.is_empty() && w.bytes().all(|b| b.is_ascii_digit());
    let file = path.symlink_metadata().is_ok_and(|m| m.is_file());
    if !(file && number(count) && number(process)) {
        return false;
    }
    // A living process holds the lock, on this machine or another; one of this machine is seen even before it has it.
    let here = Path::new("/proc").join(process).exists();
    !here && File::open(path).is_ok_and(|f| f.try_lock().is_ok())
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

/// Writes `bytes` so that the file is either the old one or the new one, never a part of either.
pub fn write_whole(file: &Path, bytes: &[u8]) -> Result<(), DocumentError> {
    let mut temporary = Temporary::begin(file)?;
    temporary.out.write_all(bytes).map_err(|source| temporary.io(source))?;
    temporary.sync()?;
    temporary.place().map(|_| ())
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
        // What is begun and not placed is gone with its handle.
        let mut staged: Vec<(&Path, Temporary)> = Vec::with_capacity(self.writes.len());
        for (file, bytes) in &self.writes {
            let mut begun = Temporary::begin(file)?;
            begun.out.write_all(bytes).map_err(|source| begun.io(source))?;
            begun.sync()?;
            staged.push((file, begun));
        }
        // Everything is on the disk. What is replaced is kept under another name until all of it is in place.
        let alone = staged.len() + self.removed.len() == 1;
        let aside = |end: &Path| -> std::io::Result<Option<PathBuf>> {
            if alone || !end.exists() {
                return Ok(None);
            }
            let kept = hidden_beside(end);
            std::fs::hard_link(end, &kept).or_else(|_| std::fs::copy(end, &kept).map(|_| ()))?;
            Ok(Some(kept))
        };
        let moves = staged.iter().map(|(file, t)| (*file, t.file.as_path(), Some(t.path.as_path())));
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
        Err(error)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn only_what_dead_processes_left_is_cleared() {
        let folder = std::env::temp_dir().join(format!("servotune-parts-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        // No process has a number beyond 2^22 on Linux; one without /proc is held by its lock alone.
        for name in [".a.toml.4999999.0.part", "b.part", ".c.part", ".d.x.0.part", "e.4999999.0.part"] {
            std::fs::write(folder.join(name), "half").unwrap();
        }
        let living = Temporary::begin(&folder.join("f.toml")).unwrap();
        assert_eq!(clear_abandoned(&folder), [folder.join(".a.toml.4999999.0.part")]);
        living.sync().unwrap();
        assert_eq!(living.place().unwrap(), folder.join("f.toml"));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 5);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
