//! The store: one SQLite file with every run, slot, table and revision.
//!
//! In: rows and tables. Out: the same, later, whatever happened in between. Write-ahead log with full synchronisation: what was committed
//! survives a kill and a power cut. Tables of gains are kept by the digest of their text and are never changed or deleted; triggers refuse
//! it. Every row is held to its seal when it is read, the whole file to the database's own check when it is opened. Times are handed in as
//! text: no clock is read here. Spec: `specs/fleet.md`, "The store".

use super::FleetError;
use super::schema::{self, BEFORE, SCHEMA};
use rusqlite::{Connection, ErrorCode, OpenFlags};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long a writer waits for another one; transactions are short.
const PATIENCE: Duration = Duration::from_secs(60);
/// The first bytes of every database, and the fewest that a database has.
const MAGIC: &[u8; 16] = b"SQLite format 3\0";
const LEAST_BYTES: u64 = 512;

/// An open store.
#[derive(Debug)]
pub struct Store {
    pub(super) connection: Connection,
    /// Its file.
    pub file: PathBuf,
}

impl Store {
    /// Opens the store, or makes it where there is no file. A file that is empty or cut off is refused: it is a store that was lost.
    pub fn open(file: &Path) -> Result<Store, FleetError> {
        // Looked at first: a log is never older than the file it belongs to.
        let log = beside(file, "-wal").exists();
        if !there(file)? {
            if log {
                return Err(FleetError::LogAlone { file: file.into() });
            }
            make(file)?;
        }
        Store::existing(file)
    }

    /// Opens a store that is there, to be written to.
    pub fn existing(file: &Path) -> Result<Store, FleetError> {
        let mut store = Store::connected(file, OpenFlags::SQLITE_OPEN_READ_WRITE, file)?;
        if store.version()? == BEFORE {
            store.whole()?;
            schema::migrate(&mut store.connection).map_err(|e| failure(file, "be brought up to this version", e))?;
        }
        store.known()?;
        store.writable()?;
        store.whole()?;
        Ok(store)
    }

    /// Opens a store that is there, to be read only; also where nothing can be written.
    pub fn reading(file: &Path) -> Result<Store, FleetError> {
        let store = Store::unchecked(file)?;
        store.known()?;
        store.whole()?;
        Ok(store)
    }

    /// The same, whatever state it is in.
    pub(super) fn unchecked(file: &Path) -> Result<Store, FleetError> {
        let store = Store::connected(file, OpenFlags::SQLITE_OPEN_READ_ONLY, file)?;
        let seen = store.connection.query_row("SELECT count(*) FROM sqlite_master", [], |r| r.get::<_, i64>(0));
        match seen.as_ref().err().and_then(rusqlite::Error::sqlite_error_code) {
            Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly | ErrorCode::SystemIoFailure) => {
                // A log needs a shared index beside it, which cannot be made here. Without a log the file is all there is.
                if beside(file, "-wal").metadata().is_ok_and(|m| m.len() > 0) {
                    return Err(FleetError::LogUnread { file: file.into() });
                }
                Store::connected(file, OpenFlags::SQLITE_OPEN_READ_ONLY, &immutable(file))
            }
            _ => seen.map(|_| store).map_err(|e| failure(file, "be read", e)),
        }
    }

    /// Another connection to the same store, which was checked when it was opened first.
    pub(super) fn again(&self) -> Result<Store, FleetError> {
        let store = Store::connected(&self.file, OpenFlags::SQLITE_OPEN_READ_WRITE, &self.file)?;
        store.writable()?;
        Ok(store)
    }

    fn connected(file: &Path, how: OpenFlags, name: &Path) -> Result<Store, FleetError> {
        if !there(file)? {
            return Err(FleetError::NoStore { file: file.into() });
        }
        let flags = how | OpenFlags::SQLITE_OPEN_NO_MUTEX | OpenFlags::SQLITE_OPEN_URI;
        let connection = Connection::open_with_flags(name, flags).map_err(|e| failure(file, "be opened", e))?;
        connection.busy_timeout(PATIENCE).map_err(|e| failure(file, "be opened", e))?;
        Ok(Store { connection, file: file.into() })
    }

    fn version(&self) -> Result<i64, FleetError> {
        self.connection.query_row("PRAGMA user_version", [], |r| r.get(0)).map_err(self.fail("be opened"))
    }

    /// Refuses what is no store of this version; nothing is written to it.
    fn known(&self) -> Result<(), FleetError> {
        let tables = "SELECT count(*) FROM sqlite_master WHERE type = 'table'";
        let tables: i64 = self.connection.query_row(tables, [], |r| r.get(0)).map_err(self.fail("be opened"))?;
        match self.version()? {
            SCHEMA => Ok(()),
            0 if tables > 0 => Err(FleetError::Foreign { file: self.file.clone(), tables }),
            0 => Err(FleetError::Emptied { file: self.file.clone() }),
            found => Err(FleetError::Schema { file: self.file.clone(), found, expected: SCHEMA }),
        }
    }

    fn writable(&self) -> Result<(), FleetError> {
        let fail = self.fail("be opened");
        // The mode stays in the file. Another process may be setting it at the same time: the timeout covers that.
        self.connection.pragma_update(None, "journal_mode", "WAL").map_err(&fail)?;
        self.connection.pragma_update(None, "synchronous", "FULL").map_err(&fail)?;
        self.connection.pragma_update(None, "foreign_keys", true).map_err(&fail)
    }

    /// Refuses a store that the database's own check finds broken, or whose tables are not those of this program.
    fn whole(&self) -> Result<(), FleetError> {
        match self.problems(1)?.into_iter().next() {
            None => Ok(()),
            Some(what) => Err(FleetError::Damaged { file: self.file.clone(), what }),
        }
    }

    /// What the database's own check finds, at most so many, and tables whose text has changed.
    pub(super) fn problems(&self, most: usize) -> Result<Vec<String>, FleetError> {
        let fail = self.fail("be checked");
        let check = || -> Result<Vec<String>, rusqlite::Error> {
            let mut query = self.connection.prepare(&format!("PRAGMA integrity_check({most})"))?;
            let lines = query.query_map([], |r| Ok(String::from_utf8_lossy(r.get_ref(0)?.as_bytes()?).into_owned()))?;
            lines.collect()
        };
        let mut found: Vec<String> = check().map_err(&fail)?.into_iter().filter(|w| w != "ok").collect();
        if self.version()? == SCHEMA {
            let changed = schema::changed(&self.connection).map_err(&fail)?;
            found.extend(changed.into_iter().map(|name| format!("the definition of `{name}` has changed")));
        }
        Ok(found)
    }

    /// Limits the store's file to this many pages, as a full disk does; for tests of what happens then.
    pub fn limit_pages(&self, pages: u32) -> Result<(), FleetError> {
        let limit = format!("PRAGMA max_page_count = {pages}");
        self.connection.query_row(&limit, [], |_| Ok(())).map_err(self.fail("limit its pages"))
    }

    /// Pages in the file.
    pub fn pages(&self) -> Result<u32, FleetError> {
        self.connection.query_row("PRAGMA page_count", [], |r| r.get(0)).map_err(self.fail("count its pages"))
    }

    /// Runs `f` in one transaction that takes the write lock at once; nothing of it stays where it fails.
    pub(super) fn write<T>(
        &mut self,
        action: &'static str,
        f: impl FnOnce(&Connection) -> Result<T, rusqlite::Error>,
    ) -> Result<T, FleetError> {
        let fail = |source| failure(&self.file, action, source);
        let transaction =
            self.connection.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate).map_err(fail)?;
        let value = f(&transaction).map_err(fail)?;
        transaction.commit().map_err(fail)?;
        Ok(value)
    }

    pub(super) fn fail(&self, action: &'static str) -> impl Fn(rusqlite::Error) -> FleetError + '_ {
        move |source| failure(&self.file, action, source)
    }
}

/// Whether there is a file that may be a database.
fn there(file: &Path) -> Result<bool, FleetError> {
    let fail = |source| FleetError::Lock { file: file.into(), action: "opened", source };
    match file.metadata() {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(false),
        Err(e) => return Err(fail(e)),
        Ok(m) if !m.is_file() => return Err(FleetError::NoDatabase { file: file.into() }),
        Ok(m) if m.len() == 0 => return Err(FleetError::Emptied { file: file.into() }),
        Ok(m) => {
            let mut head = Vec::new();
            std::fs::File::open(file).and_then(|f| f.take(16).read_to_end(&mut head)).map_err(fail)?;
            if head != MAGIC {
                return Err(FleetError::NoDatabase { file: file.into() });
            }
            if m.len() < LEAST_BYTES {
                return Err(FleetError::Emptied { file: file.into() });
            }
        }
    }
    Ok(true)
}

/// Makes an empty store whole under another name, then gives it its own; one that another process has made meanwhile stays.
fn make(file: &Path) -> Result<(), FleetError> {
    let folder = file.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let place = |source| FleetError::NoPlace { folder: folder.into(), source };
    std::fs::create_dir_all(folder).map_err(place)?;
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let thread = format!("{:?}", std::thread::current().id()).replace(|c: char| !c.is_ascii_digit(), "");
    let temporary = folder.join(format!(".{name}.{}.{thread}.part", std::process::id()));
    let _ = std::fs::remove_file(&temporary);
    let made = schema::fresh().and_then(|c| c.execute("VACUUM INTO ?1", [temporary.to_string_lossy()]).map(|_| ()));
    let made = made.map_err(|e| failure(file, "be made", e)).and_then(|()| {
        std::fs::File::open(&temporary).and_then(|f| f.sync_all()).map_err(place)?;
        match std::fs::hard_link(&temporary, file) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => Ok(()),
            // A file system without second names.
            Err(_) if !file.exists() => std::fs::rename(&temporary, file).map_err(place),
            _ => Ok(()),
        }
    });
    let _ = std::fs::remove_file(&temporary);
    made
}

/// The file of another ending, such as the log, beside a store.
fn beside(file: &Path, ending: &str) -> PathBuf {
    let mut name = file.file_name().unwrap_or_default().to_os_string();
    name.push(ending);
    file.with_file_name(name)
}

/// The name by which the database opens a file that nobody changes, without any file beside it.
fn immutable(file: &Path) -> PathBuf {
    let text = file.to_string_lossy();
    let mut name = String::from("file:");
    for c in text.chars() {
        match c {
            '?' | '#' | '%' => name += &format!("%{:02X}", c as u32),
            c => name.push(c),
        }
    }
    PathBuf::from(name + "?immutable=1")
}

pub(super) fn failure(file: &Path, action: &'static str, source: rusqlite::Error) -> FleetError {
    match source {
        rusqlite::Error::FromSqlConversionFailure(at, kind, inner) => match inner.downcast::<FleetError>() {
            Ok(own) => match *own {
                FleetError::Damaged { what, .. } => FleetError::Damaged { file: file.into(), what },
                other => other,
            },
            Err(inner) => {
                let source = rusqlite::Error::FromSqlConversionFailure(at, kind, inner);
                FleetError::Store { file: file.into(), action, source }
            }
        },
        source => match source.sqlite_error_code() {
            Some(ErrorCode::NotADatabase) => FleetError::NoDatabase { file: file.into() },
            Some(ErrorCode::DiskFull) => FleetError::Full { file: file.into(), action },
            Some(ErrorCode::DatabaseCorrupt) => FleetError::Damaged { file: file.into(), what: source.to_string() },
            _ => FleetError::Store { file: file.into(), action, source },
        },
    }
}
