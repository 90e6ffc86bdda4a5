//! The files of gains that are in the slots: FOLDER/TESTER/SLOT/controller.toml.
//!
//! In: a folder and a slot. Out: the bytes that stand there, or new ones in their place. Names are held to the alphabet, links are not followed,
//! and what is no file of gains is not touched.

use super::FleetError;
use servotune::document::{Temporary, below, clear_abandoned};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// Largest file of gains (bytes).
const LARGEST: u64 = 1 << 20;

/// Where the gains of a slot are.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub file: PathBuf,
}

/// The folder as it is kept in the store: from the root on, so that the next command finds it wherever it is started.
pub(super) fn absolute(folder: &Path) -> Result<PathBuf, FleetError> {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.into());
    if whole.to_str().is_none() {
        return Err(FleetError::FolderName { folder: folder.into() });
    }
    Ok(whole)
}

/// Whether both are one folder; one that is not there any more stands in nobody's way.
pub(super) fn same(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        (Ok(_), Err(_)) => false,
        _ => true,
    }
}

impl Target {
    /// The file of a slot, `TESTER/SLOT`.
    pub fn of(folder: &Path, slot: &str) -> Result<Target, FleetError> {
        let names: Vec<&str> = slot.split('/').chain(["controller.toml"]).collect();
        Ok(Target { file: below(folder, &names)? })
    }

    /// What stands there; nothing where there is no file.
    pub fn bytes(&self) -> Result<Option<Vec<u8>>, FleetError> {
        let refuse = |found| FleetError::Installed { file: self.file.clone(), found };
        let fail = |source| FleetError::Lock { file: self.file.clone(), action: "read", source };
        match self.file.symlink_metadata() {
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
            Err(e) => return Err(fail(e)),
            Ok(m) if !m.is_file() => return Err(refuse("found a folder, a pipe or a device")),
            Ok(m) if m.len() > LARGEST => return Err(refuse("found a large file")),
            Ok(_) => {}
        }
        let mut bytes = Vec::new();
        std::fs::File::open(&self.file).and_then(|f| f.take(LARGEST).read_to_end(&mut bytes)).map_err(fail)?;
        Ok(Some(bytes))
    }

    /// Removes the file.
    pub fn remove(&self) -> Result<(), FleetError> {
        std::fs::remove_file(&self.file).map_err(|source| FleetError::Lock {
            file: self.file.clone(),
            action: "removed",
            source,
        })
    }

    /// Removes what dead processes have left half-written beside it.
    pub fn clear(&self) {
        self.file.parent().map(clear_abandoned);
    }
}

/// The bytes on disk under another name, to be given their own.
pub(super) fn stage(target: &Target, bytes: &[u8]) -> Result<Temporary, FleetError> {
    target.clear();
    let mut temporary = Temporary::begin(&target.file)?;
    temporary.out.write_all(bytes).map_err(|source| FleetError::Lock {
        file: target.file.clone(),
        action: "written",
        source,
    })?;
    temporary.sync()?;
    Ok(temporary)
}
