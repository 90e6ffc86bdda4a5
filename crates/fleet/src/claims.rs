//! Who works on what: two processes on one store share the work, and a dead one's work is taken over at once.
//!
//! In: the store. Out: claims on tasks. Each process holds a lock on a file of its own beside the store for as long as it lives; the
//! operating system lets go of it when the process ends, however it ends. A claim whose owner's file can be locked is nobody's. No clock
//! is needed, and no lease can run out under a slow worker. The store must lie on a file system with working locks.

use super::{FleetError, Store};
use rusqlite::{OptionalExtension, params};
use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};

/// A living process at a store.
#[derive(Debug)]
pub struct Worker {
    name: String,
    /// Held, never read: the lock says that this process lives.
    _lock: File,
    file: PathBuf,
}

/// Folder of the lock files of a store.
fn folder(store: &Path) -> PathBuf {
    let mut name = store.file_name().unwrap_or_default().to_os_string();
    name.push(".workers");
    store.with_file_name(name)
}

/// Taken while lock files come and go, so that nobody locks a file that another one is removing.
fn door(folder: &Path) -> Result<File, FleetError> {
    let file = folder.join("door");
    let fail = |action| {
        let file = file.clone();
        move |source| FleetError::Lock { file, action, source }
    };
    let door = open(&file).map_err(fail("opened"))?;
    door.lock().map_err(fail("locked"))?;
    Ok(door)
}

/// Files that are nobody's: locks that several processes take in turn.
const STAY: [&str; 2] = ["door", "install"];

/// A lock that is given back when this is dropped. Closing the file is not enough: a child that is being started has it open too, until it
/// runs its own program.
#[derive(Debug)]
pub(super) struct Held(File);

impl Drop for Held {
    fn drop(&mut self) {
        // Where this fails, the system gives the lock back when the last one closes the file.
        let _ = self.0.unlock();
    }
}

/// The lock that one process holds while it installs; none where another holds it and `wait` is not asked for.
pub(super) fn install_lock(store: &Path, wait: bool) -> Result<Option<Held>, FleetError> {
    locked(store, "install", wait)
}

/// A lock of a store by its name; none where another process holds it and `wait` is not asked for.
fn locked(store: &Path, name: &str, wait: bool) -> Result<Option<Held>, FleetError> {
    let folder = folder(store);
    let file = folder.join(name);
    let fail = |action| {
        let file = file.clone();
        move |source| FleetError::Lock { file, action, source }
    };
    std::fs::create_dir_all(&folder).map_err(fail("made"))?;
    let lock = open(&file).map_err(fail("opened"))?;
    if wait {
        lock.lock().map_err(fail("locked"))?;
        return Ok(Some(Held(lock)));
    }
    match lock.try_lock() {
        Ok(()) => Ok(Some(Held(lock))),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(source)) => Err(fail("locked")(source)),
    }
}

fn open(file: &Path) -> std::io::Result<File> {
    OpenOptions::new().write(true).create(true).truncate(false).open(file)
}

impl Worker {
    /// Announces a process at a store. `name` tells it from others, such as its process id; a number is added until it is new.
    pub fn at(store: &Path, name: &str) -> Result<Worker, FleetError> {
        let folder = folder(store);
        let list = |source| FleetError::Folder { folder: folder.clone(), source };
        std::fs::create_dir_all(&folder).map_err(list)?;
        let _door = door(&folder)?;
        // What dead processes left behind.
        for entry in std::fs::read_dir(&folder).map_err(list)? {
            let path = entry.map_err(list)?.path();
            let dead = || File::open(&path).is_ok_and(|f| f.try_lock().is_ok());
            if path.file_name().is_some_and(|n| !STAY.contains(&n.to_string_lossy().as_ref())) && dead() {
                // A file that stays is harmless: nobody holds it.
                let _ = std::fs::remove_file(&path);
            }
        }
        let mut number = 0;
        loop {
            let name = format!("{name}-{number}");
            let file = folder.join(&name);
            let fail = |action| {
                let file = file.clone();
                move |source| FleetError::Lock { file, action, source }
            };
            let lock = open(&file).map_err(fail("opened"))?;
            match lock.try_lock() {
                Ok(()) => return Ok(Worker { name, _lock: lock, file }),
                // A living worker of the same name, in this process or on another machine.
                Err(TryLockError::WouldBlock) => number += 1,
                Err(TryLockError::Error(source)) => return Err(fail("locked")(source)),
            }
        }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let door = self.file.parent().map(door);
        if matches!(door, Some(Ok(_))) {
            let _ = std::fs::remove_file(&self.file);
        }
    }
}

/// Whether the process of that name lives.
fn lives(store: &Path, name: &str) -> bool {
    match File::open(folder(store).join(name)) {
        Ok(file) => matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)),
        Err(_) => false,
    }
}

impl Store {
    /// Claims a task; false where a living process has it.
    pub(super) fn claim(&mut self, run: &str, task: &str, worker: &Worker) -> Result<bool, FleetError> {
        let file = self.file.clone();
        self.write("claim a task", |c| {
            let query = "SELECT owner FROM claims WHERE run = ?1 AND task = ?2";
            let owner: Option<String> = c.query_row(query, params![run, task], |r| r.get(0)).optional()?;
            if owner.is_some_and(|o| o != worker.name && lives(&file, &o)) {
                return Ok(false);
            }
            let query = "INSERT OR REPLACE INTO claims (run, task, owner) VALUES (?1, ?2, ?3)";
            c.execute(query, params![run, task, worker.name])?;
            Ok(true)
        })
    }
}
