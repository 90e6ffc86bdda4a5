//! Writing whole files: a temporary name beside the target, flushed to disk, then renamed over it.

use super::DocumentError;
use std::io::Write;
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

/// Refuses a name under which no file can be written: minutes of work should not end there.
pub fn check_target(file: &Path) -> Result<(), DocumentError> {
    let fail = |found: String| Err(DocumentError::Target { file: file.into(), found });
    if file.is_dir() {
        return fail("is a folder".to_owned());
    }
    if file.file_name().is_none() {
        return fail("names no file".to_owned());
    }
    match file.ancestors().skip(1).find(|a| a.exists()) {
        Some(above) if !above.is_dir() => fail(format!("{} is a file and no folder", above.display())),
        _ => Ok(()),
    }
}

/// Writes `bytes` so that the file is either the old one or the new one, never a part of either.
pub fn write_whole(file: &Path, bytes: &[u8]) -> Result<(), DocumentError> {
    check_target(file)?;
    let fail = |action| move |source| DocumentError::Io { file: file.into(), action, source };
    let folder = match file.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(fail("make the folder"))?;
    let temporary = temporary_beside(file);
    let written = std::fs::File::create(&temporary)
        .and_then(|mut f| f.write_all(bytes).and_then(|()| f.sync_all()))
        .and_then(|()| std::fs::rename(&temporary, file));
    written.map_err(|source| {
        // The half-written file is of no use to anybody; the error that matters is the one being reported.
        let _ = std::fs::remove_file(&temporary);
        fail("write")(source)
    })
}

/// [`write_whole`] for text.
pub fn write_text(file: &Path, text: &str) -> Result<(), DocumentError> {
    write_whole(file, text.as_bytes())
}
