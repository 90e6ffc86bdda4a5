//! Runs in the store: begun, filled slot by slot, finished.
//!
//! In: rows in any order, from any number of processes. Out: rows in order, streamed. A row is keyed by run and place; what is already
//! there is left alone, so that work done twice is kept once.

use super::explain::Explained;
use super::row::{SlotRow, Verdict};
use super::{FleetError, Store};
use rusqlite::{OptionalExtension, params};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;

/// One run as the store knows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Run {
    /// Its number, from 1.
    pub seq: i64,
    /// Its name.
    pub run: String,
    /// Digest of settings, spec, gains, gate and program.
    pub config: String,
    /// Slots of its input.
    pub slots: usize,
    /// When it was begun, as it was told.
    pub started: String,
    /// By whom.
    pub who: String,
    /// When it was finished; none while it is not.
    pub finished: Option<String>,
}

/// Who does something, and when; both as the caller says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// A person or a program.
    pub who: String,
    /// A time in words, such as 2026-11-21T07:45:00Z.
    pub at: String,
}

const RUN: &str = "SELECT seq, run, config, slots, started, who, finished FROM runs";

fn run_of(r: &rusqlite::Row<'_>) -> Result<Run, rusqlite::Error> {
    Ok(Run {
        seq: r.get(0)?,
        run: r.get(1)?,
        config: r.get(2)?,
        slots: r.get::<_, i64>(3)?.unsigned_abs() as usize,
        started: r.get(4)?,
        who: r.get(5)?,
        finished: r.get(6)?,
    })
}

pub(super) fn json(value: &impl Serialize) -> Result<String, FleetError> {
    serde_json::to_string(value).map_err(|source| FleetError::Json { source })
}

pub(super) fn of_json<T: DeserializeOwned>(text: &str) -> Result<T, FleetError> {
    serde_json::from_str(text).map_err(|source| FleetError::Json { source })
}

/// A part of a run that is kept whole, as JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Library,
    Rest,
    Shared,
}

impl Part {
    fn column(self) -> &'static str {
        match self {
            Part::Library => "library",
            Part::Rest => "rest",
            Part::Shared => "shared",
        }
    }
}

/// A table of parts of a run, one for each place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Places {
    Pilots,
    Explained,
}

impl Places {
    fn table(self) -> &'static str {
        match self {
            Places::Pilots => "pilots",
            Places::Explained => "explained",
        }
    }
}

impl Store {
    /// All runs, oldest first.
    pub fn runs(&self) -> Result<Vec<Run>, FleetError> {
        let fail = self.fail("list its runs");
        let mut query = self.connection.prepare(&format!("{RUN} ORDER BY seq")).map_err(&fail)?;
        let rows = query.query_map([], run_of).map_err(&fail)?;
        rows.collect::<Result<_, _>>().map_err(&fail)
    }

    /// A run by its name.
    pub fn run(&self, name: &str) -> Result<Run, FleetError> {
        let query = format!("{RUN} WHERE run = ?1");
        let found = self.connection.query_row(&query, [name], run_of).optional().map_err(self.fail("find a run"))?;
        match found {
            Some(run) => Ok(run),
            None => {
                let names: Vec<String> = self.runs()?.into_iter().map(|r| r.run).collect();
                Err(FleetError::NoRun { run: name.to_owned(), found: names.join(", ") })
            }
        }
    }

    /// Begins a run, or goes on with it: by its name; without one the last run where it has the same settings and is not finished, else a new
    /// one. A name that stands for other settings is refused.
    pub fn begin(&mut self, name: Option<&str>, config: &str, slots: usize, stamp: &Stamp) -> Result<Run, FleetError> {
        let run = self.write("begin a run", |c| {
            let last = c.query_row(&format!("{RUN} ORDER BY seq DESC LIMIT 1"), [], run_of).optional()?;
            let same = |r: &Run| r.config == config && r.slots == slots;
            let name = match (name, &last) {
                (Some(name), _) => name.to_owned(),
                (None, Some(r)) if same(r) && r.finished.is_none() => r.run.clone(),
                (None, last) => format!("run-{:04}", last.as_ref().map_or(0, |r| r.seq) + 1),
            };
            let query = "INSERT OR IGNORE INTO runs (run, config, slots, started, who) VALUES (?1, ?2, ?3, ?4, ?5)";
            c.execute(query, params![name, config, slots as i64, stamp.at, stamp.who])?;
            c.query_row(&format!("{RUN} WHERE run = ?1"), [&name], run_of)
        })?;
        let other = |key, stored: String, found: String| {
            Err(FleetError::OtherInputs { run: run.run.clone(), key, stored, found })
        };
        if run.config != config {
            return other("settings", run.config.clone(), config.to_owned());
        }
        if run.slots != slots {
            return other("slots", run.slots.to_string(), slots.to_string());
        }
        Ok(run)
    }

    /// Says that a run is finished, once.
    pub fn finish(&mut self, run: &str, stamp: &Stamp) -> Result<(), FleetError> {
        self.write("finish a run", |c| {
            c.execute("UPDATE runs SET finished = ?2 WHERE run = ?1 AND finished IS NULL", params![run, stamp.at])?;
            c.execute("DELETE FROM claims WHERE run = ?1", [run])
        })?;
        Ok(())
    }

    /// A part of a run.
    pub(super) fn part<T: DeserializeOwned>(&self, run: &str, part: Part) -> Result<Option<T>, FleetError> {
        let query = format!("SELECT {} FROM runs WHERE run = ?1", part.column());
        let text: Option<String> =
            self.connection.query_row(&query, [run], |r| r.get(0)).map_err(self.fail("read a part of a run"))?;
        text.map(|t| of_json(&t)).transpose()
    }

    /// Keeps a part of a run, unless it is there.
    pub(super) fn keep_part(&mut self, run: &str, part: Part, value: &impl Serialize) -> Result<(), FleetError> {
        let text = json(value)?;
        let query = format!("UPDATE runs SET {0} = ?2 WHERE run = ?1 AND {0} IS NULL", part.column());
        self.write("keep a part of a run", |c| c.execute(&query, params![run, text]))?;
        Ok(())
    }

    /// What stands in a table of places, by place.
    pub(super) fn places<T: DeserializeOwned>(&self, run: &str, places: Places) -> Result<Vec<(usize, T)>, FleetError> {
        let fail = self.fail("read a part of a run");
        let query = format!("SELECT place, found FROM {} WHERE run = ?1 ORDER BY place", places.table());
        let mut query = self.connection.prepare(&query).map_err(&fail)?;
        let rows = query.query_map([run], |r| Ok((r.get::<_, i64>(0)?, r.get::<_, String>(1)?))).map_err(&fail)?;
        let mut all = Vec::new();
        for row in rows {
            let (place, text) = row.map_err(&fail)?;
            all.push((place.unsigned_abs() as usize, of_json(&text)?));
        }
        Ok(all)
    }

    /// Which places are there.
    pub(super) fn places_done(&self, run: &str, places: Places) -> Result<BTreeSet<usize>, FleetError> {
        let fail = self.fail("read a part of a run");
        let query = format!("SELECT place FROM {} WHERE run = ?1", places.table());
        let mut query = self.connection.prepare(&query).map_err(&fail)?;
        let rows = query.query_map([run], |r| r.get::<_, i64>(0)).map_err(&fail)?;
        rows.map(|r| r.map(|p| p.unsigned_abs() as usize)).collect::<Result<_, _>>().map_err(&fail)
    }

    /// Explanations of a run, by place.
    pub fn explanations(&self, run: &str) -> Result<Vec<(usize, Explained)>, FleetError> {
        self.places(run, Places::Explained)
    }

    /// Adds explanations, and puts rows in the place of those that they go on from: of slots that the full search or a table of the rest has served
    /// after all.
    pub(super) fn add_explained(
        &mut self,
        run: &str,
        found: &[(usize, Explained)],
        served: &[SlotRow],
    ) -> Result<(), FleetError> {
        let texts = found.iter().map(|(p, f)| Ok((*p as i64, json(f)?))).collect::<Result<Vec<_>, FleetError>>()?;
        let rows = served
            .iter()
            .map(|r| Ok((r.index as i64, r.verdict.word(), json(r)?)))
            .collect::<Result<Vec<_>, FleetError>>()?;
        self.write("add explanations", |c| {
            let mut insert =
                c.prepare_cached("INSERT OR IGNORE INTO explained (run, place, found) VALUES (?1, ?2, ?3)")?;
            texts.iter().try_for_each(|(p, text)| insert.execute(params![run, p, text]).map(|_| ()))?;
            let mut update =
                c.prepare_cached("UPDATE slots SET verdict = ?3, row = ?4 WHERE run = ?1 AND place = ?2")?;
            rows.iter().try_for_each(|(p, verdict, row)| update.execute(params![run, p, verdict, row]).map(|_| ()))
        })
    }

    /// Adds to a table of places; what is there stays.
    pub(super) fn add_places<T: Serialize>(
        &mut self,
        run: &str,
        places: Places,
        found: &[(usize, T)],
    ) -> Result<(), FleetError> {
        let texts = found.iter().map(|(p, f)| Ok((*p as i64, json(f)?))).collect::<Result<Vec<_>, FleetError>>()?;
        let query = format!("INSERT OR IGNORE INTO {} (run, place, found) VALUES (?1, ?2, ?3)", places.table());
        self.write("add to a run", |c| {
            let mut insert = c.prepare_cached(&query)?;
            texts.iter().try_for_each(|(p, text)| insert.execute(params![run, p, text]).map(|_| ()))
        })
    }

    /// Adds rows in one transaction; a row that is there stays as it is.
    pub fn add_rows(&mut self, run: &str, rows: &[SlotRow]) -> Result<(), FleetError> {
        let texts = rows.iter().map(json).collect::<Result<Vec<_>, FleetError>>()?;
        self.write("add slots", |c| {
            let query =
                "INSERT OR IGNORE INTO slots (run, place, slot, digest, verdict, row) VALUES (?1, ?2, ?3, ?4, ?5, ?6)";
            let mut insert = c.prepare_cached(query)?;
            for (row, text) in rows.iter().zip(&texts) {
                insert.execute(params![run, row.index as i64, row.id(), row.digest, row.verdict.word(), text])?;
            }
            Ok(())
        })
    }

    /// Places of a run that are done, within `from..to`.
    pub(super) fn done(&self, run: &str, from: usize, to: usize) -> Result<BTreeSet<usize>, FleetError> {
        let fail = self.fail("read what is done");
        let query = "SELECT place FROM slots WHERE run = ?1 AND place >= ?2 AND place < ?3";
        let mut query = self.connection.prepare_cached(query).map_err(&fail)?;
        let rows = query.query_map(params![run, from as i64, to as i64], |r| r.get::<_, i64>(0)).map_err(&fail)?;
        rows.map(|r| r.map(|p| p.unsigned_abs() as usize)).collect::<Result<_, _>>().map_err(&fail)
    }

    /// How many slots of a run are done.
    pub fn count_done(&self, run: &str) -> Result<usize, FleetError> {
        let query = "SELECT count(*) FROM slots WHERE run = ?1";
        let count: i64 =
            self.connection.query_row(query, [run], |r| r.get(0)).map_err(self.fail("count what is done"))?;
        Ok(count.unsigned_abs() as usize)
    }

    /// Hands every row of a run to `f`, in order, one at a time.
    pub fn each_row(
        &self,
        run: &str,
        verdict: Option<Verdict>,
        mut f: impl FnMut(SlotRow) -> Result<(), FleetError>,
    ) -> Result<(), FleetError> {
        let fail = self.fail("read slots");
        let query = "SELECT row FROM slots WHERE run = ?1 AND (?2 IS NULL OR verdict = ?2) ORDER BY place";
        let mut query = self.connection.prepare(query).map_err(&fail)?;
        let mut rows = query.query(params![run, verdict.map(Verdict::word)]).map_err(&fail)?;
        while let Some(row) = rows.next().map_err(&fail)? {
            let text: String = row.get(0).map_err(&fail)?;
            f(of_json(&text)?)?;
        }
        Ok(())
    }

    /// The row of a slot in a run.
    pub fn row(&self, run: &str, slot: &str) -> Result<Option<SlotRow>, FleetError> {
        let query = "SELECT row FROM slots WHERE slot = ?1 AND run = ?2";
        let text: Option<String> =
            self.connection.query_row(query, [slot, run], |r| r.get(0)).optional().map_err(self.fail("find a slot"))?;
        text.map(|t| of_json(&t)).transpose()
    }
}
