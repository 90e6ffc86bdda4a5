//! Runs in the store: begun, filled slot by slot, finished.
//!
//! In: rows in any order, from any number of processes. Out: rows in order, streamed. A row is keyed by run and place; what is already
//! there is left alone, so that work done twice is kept once.

use super::explain::Explained;
use super::row::{SlotRow, Verdict};
use super::seal::{EXPLAINED, PARTS, PILOTS, RUNS, SLOTS, Sealed, maybe, stop, text};
use super::{FleetError, Store};
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, params};
use serde::Serialize;
use serde::de::DeserializeOwned;
use servotune::document::check_name;
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
    /// Digest of their names, in order; empty for a run of an earlier version.
    pub list: String,
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

fn run_of(r: &rusqlite::Row<'_>) -> Result<Run, rusqlite::Error> {
    RUNS.hold(r)?;
    Ok(Run {
        seq: r.get(0)?,
        run: r.get(1)?,
        config: r.get(2)?,
        slots: r.get::<_, i64>(3)?.unsigned_abs() as usize,
        started: r.get(4)?,
        who: r.get(5)?,
        list: r.get(6)?,
        finished: r.get(7)?,
    })
}

/// A run by its name.
pub(super) fn run_named(c: &Connection, name: &str) -> Result<Option<Run>, rusqlite::Error> {
    c.query_row(&format!("{} WHERE t.run = ?1", RUNS.select()), [name], run_of).optional()
}

fn put_run(c: &Connection, verb: &str, run: &Run) -> Result<(), rusqlite::Error> {
    let Run { seq, run, config, slots, started, who, list, finished } = run;
    let slots = Value::Integer(*slots as i64);
    let values = vec![
        Value::Integer(*seq),
        text(run.as_str()),
        text(config.as_str()),
        slots,
        text(started.as_str()),
        text(who.as_str()),
        text(list.as_str()),
        maybe(finished.as_deref()),
    ];
    RUNS.put(c, verb, values).map(|_| ())
}

/// What a run works on, by which it is told whether it may go on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// Digest of settings, spec, gains, gate and program.
    pub config: String,
    /// Slots.
    pub slots: usize,
    /// Digest of their names, in order.
    pub list: String,
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
    fn word(self) -> &'static str {
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
    fn table(self) -> &'static Sealed {
        match self {
            Places::Pilots => &PILOTS,
            Places::Explained => &EXPLAINED,
        }
    }
}

impl Store {
    /// All runs, oldest first.
    pub fn runs(&self) -> Result<Vec<Run>, FleetError> {
        let fail = self.fail("list its runs");
        let mut query = self.connection.prepare(&format!("{} ORDER BY t.seq", RUNS.select())).map_err(&fail)?;
        let rows = query.query_map([], run_of).map_err(&fail)?;
        rows.collect::<Result<_, _>>().map_err(&fail)
    }

    /// A run by its name.
    pub fn run(&self, name: &str) -> Result<Run, FleetError> {
        match run_named(&self.connection, name).map_err(self.fail("find a run"))? {
            Some(run) => Ok(run),
            None => {
                let names: Vec<String> = self.runs()?.into_iter().map(|r| r.run).collect();
                Err(FleetError::NoRun { run: name.to_owned(), found: names.join(", ") })
            }
        }
    }

    /// Begins a run, or goes on with it: by its name; without one the last run where it has the same inputs and is not finished, else a new
    /// one. A name that stands for other inputs is refused: other settings, or another list of slots.
    pub fn begin(&mut self, name: Option<&str>, inputs: &Inputs, stamp: &Stamp) -> Result<Run, FleetError> {
        if let Some(name) = name {
            check_name(name).map_err(|source| FleetError::Name { what: "name of the run".into(), source })?;
        }
        let run = self.write("begin a run", |c| {
            let last = c.query_row(&format!("{} ORDER BY t.seq DESC LIMIT 1", RUNS.select()), [], run_of).optional()?;
            let same = |r: &Run| r.config == inputs.config && r.slots == inputs.slots && r.list == inputs.list;
            let seq = last.as_ref().map_or(0, |r| r.seq) + 1;
            let name = match (name, last) {
                (Some(name), _) => name.to_owned(),
                (None, Some(r)) if same(&r) && r.finished.is_none() => r.run,
                (None, _) => format!("run-{seq:04}"),
            };
            if let Some(run) = run_named(c, &name)? {
                return Ok(run);
            }
            let Inputs { config, slots, list } = inputs.clone();
            let (started, who) = (stamp.at.clone(), stamp.who.clone());
            let run = Run { seq, run: name, config, slots, started, who, list, finished: None };
            put_run(c, "INSERT", &run)?;
            Ok(run)
        })?;
        let other = |key, stored: String, found: String| {
            Err(FleetError::OtherInputs { run: run.run.clone(), key, stored, found })
        };
        if run.config != inputs.config {
            return other("settings", run.config.clone(), inputs.config.clone());
        }
        if run.slots != inputs.slots {
            return other("slots", run.slots.to_string(), inputs.slots.to_string());
        }
        if run.list != inputs.list {
            return other("another list of slots, with the digest", run.list.clone(), inputs.list.clone());
        }
        Ok(run)
    }

    /// Says that a run is finished, once.
    pub fn finish(&mut self, run: &str, stamp: &Stamp) -> Result<(), FleetError> {
        self.write("finish a run", |c| {
            if let Some(found) = run_named(c, run)?.filter(|r| r.finished.is_none()) {
                put_run(c, "REPLACE", &Run { finished: Some(stamp.at.clone()), ..found })?;
            }
            c.execute("DELETE FROM claims WHERE run = ?1", [run])
        })?;
        Ok(())
    }

    /// A part of a run.
    pub(super) fn part<T: DeserializeOwned>(&self, run: &str, part: Part) -> Result<Option<T>, FleetError> {
        let query = format!("{} WHERE t.run = ?1 AND t.part = ?2", PARTS.select());
        let found = |r: &rusqlite::Row<'_>| PARTS.hold(r).and_then(|()| r.get::<_, String>(2));
        let text = self.connection.query_row(&query, [run, part.word()], found).optional();
        text.map_err(self.fail("read a part of a run"))?.map(|t| of_json(&t)).transpose()
    }

    /// Keeps a part of a run, unless it is there.
    pub(super) fn keep_part(&mut self, run: &str, part: Part, value: &impl Serialize) -> Result<(), FleetError> {
        let values = vec![text(run), text(part.word()), text(json(value)?)];
        self.write("keep a part of a run", |c| PARTS.put(c, "INSERT OR IGNORE", values))?;
        Ok(())
    }

    /// What stands in a table of places, by place.
    pub(super) fn places<T: DeserializeOwned>(&self, run: &str, places: Places) -> Result<Vec<(usize, T)>, FleetError> {
        let fail = self.fail("read a part of a run");
        let table = places.table();
        let query = format!("{} WHERE t.run = ?1 ORDER BY t.place", table.select());
        let mut query = self.connection.prepare(&query).map_err(&fail)?;
        let found = |r: &rusqlite::Row<'_>| {
            table.hold(r)?;
            Ok((r.get::<_, i64>(1)?.unsigned_abs() as usize, r.get::<_, String>(2)?))
        };
        let rows = query.query_map([run], found).map_err(&fail)?;
        rows.map(|row| row.map_err(&fail).and_then(|(place, text)| Ok((place, of_json(&text)?)))).collect()
    }

    /// Which places are there.
    pub(super) fn places_done(&self, run: &str, places: Places) -> Result<BTreeSet<usize>, FleetError> {
        let fail = self.fail("read a part of a run");
        let query = format!("SELECT place FROM {} WHERE run = ?1", places.table().table);
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
        let found = found.iter().map(|(p, f)| place_values(run, *p, f)).collect::<Result<Vec<_>, _>>()?;
        let served = served.iter().map(|r| row_values(run, r)).collect::<Result<Vec<_>, _>>()?;
        self.write("add explanations", |c| {
            found.into_iter().try_for_each(|v| EXPLAINED.put(c, "INSERT OR IGNORE", v).map(|_| ()))?;
            served.into_iter().try_for_each(|v| SLOTS.put(c, "REPLACE", v).map(|_| ()))
        })
    }

    /// Adds to a table of places; what is there stays.
    pub(super) fn add_places<T: Serialize>(
        &mut self,
        run: &str,
        places: Places,
        found: &[(usize, T)],
    ) -> Result<(), FleetError> {
        let found = found.iter().map(|(p, f)| place_values(run, *p, f)).collect::<Result<Vec<_>, _>>()?;
        self.write("add to a run", |c| {
            found.into_iter().try_for_each(|v| places.table().put(c, "INSERT OR IGNORE", v).map(|_| ()))
        })
    }

    /// Adds rows in one transaction; a row that is there stays as it is.
    pub fn add_rows(&mut self, run: &str, rows: &[SlotRow]) -> Result<(), FleetError> {
        let rows = rows.iter().map(|r| row_values(run, r)).collect::<Result<Vec<_>, _>>()?;
        self.write("add slots", |c| rows.into_iter().try_for_each(|v| SLOTS.put(c, "INSERT OR IGNORE", v).map(|_| ())))
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

    /// Hands every row of a run to `f`, in order, one at a time; with a verdict those of that verdict. Every row is held to its seal.
    pub fn each_row(
        &self,
        run: &str,
        verdict: Option<Verdict>,
        mut f: impl FnMut(SlotRow) -> Result<(), FleetError>,
    ) -> Result<(), FleetError> {
        let fail = self.fail("read slots");
        let query = format!("{} WHERE t.run = ?1 ORDER BY t.place", SLOTS.select());
        let mut query = self.connection.prepare(&query).map_err(&fail)?;
        let mut rows = query.query([run]).map_err(&fail)?;
        while let Some(row) = rows.next().map_err(&fail)? {
            // Chosen here and not by the database: a verdict that has changed must not pass for another one.
            let row = slot_row(row).map_err(&fail)?;
            if verdict.is_none_or(|v| v == row.verdict) {
                f(row)?;
            }
        }
        Ok(())
    }

    /// The row of a slot in a run.
    pub fn row(&self, run: &str, slot: &str) -> Result<Option<SlotRow>, FleetError> {
        let query = format!("{} WHERE t.slot = ?1 AND t.run = ?2", SLOTS.select());
        self.connection.query_row(&query, [slot, run], slot_row).optional().map_err(self.fail("find a slot"))
    }
}

/// A row read by the `SELECT` of [`SLOTS`].
pub(super) fn slot_row(row: &rusqlite::Row<'_>) -> Result<SlotRow, rusqlite::Error> {
    SLOTS.hold(row)?;
    of_json(&row.get::<_, String>(5)?).map_err(stop)
}

fn row_values(run: &str, row: &SlotRow) -> Result<Vec<Value>, FleetError> {
    let place = Value::Integer(row.index as i64);
    let words = [row.id(), row.digest.clone(), row.verdict.word().to_owned(), json(row)?].map(Value::Text);
    Ok([text(run), place].into_iter().chain(words).collect())
}

fn place_values(run: &str, place: usize, found: &impl Serialize) -> Result<Vec<Value>, FleetError> {
    Ok(vec![text(run), Value::Integer(place as i64), text(json(found)?)])
}
