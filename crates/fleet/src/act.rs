//! Approve, apply, roll back: a list of slots all or none, the store and the installed files as one.
//!
//! In: an [`Order`]. Out: revisions, and files in the folders of the slots. What an apply or a rollback is about to do stands in the store before the
//! first file takes its name, with the bytes that stood there; when the last one has, the revisions are added. Whoever opens the store next
//! after a kill finds what was begun and ends it ([`Store::heal`]). One process at a time does this, under a lock that dies with it.

use super::claims::install_lock;
use super::installed::{self, Target};
use super::order::{Carried, End, Healed, Order, Step, plan, step_of};
use super::revision::{Action, New, Revision, add, chain, in_slot, keep_table};
use super::seal::{ACT_FILES, ACTS, damaged, maybe, stop, text};
use super::store_run::Stamp;
use super::{FleetError, Store};
use rusqlite::Connection;
use rusqlite::types::Value;
use servotune::document::sha256_hex;

/// An act as the store has it.
#[derive(Clone, Debug)]
struct Act {
    id: i64,
    action: Action,
    stamp: Stamp,
    why: String,
    steps: Vec<Step>,
}

impl Store {
    /// Approves, applies or rolls back. What must come before is asked for; a table that a later run judged otherwise is refused.
    pub fn carry_out(&mut self, order: &Order<'_>) -> Result<Carried, FleetError> {
        let _lock = install_lock(&self.file, true)?;
        let waiting = self.heal_locked()?;
        let (mut carried, mut steps) = (Carried::default(), Vec::new());
        let id = self.write("begin an act", |c| {
            (carried, steps) = plan(c, order, &waiting)?;
            if steps.iter().all(|s| s.folder.is_none()) {
                let act = Act::of(0, order, &steps);
                carried.revisions = act.conclude(c)?;
                return Ok(None);
            }
            for step in &mut steps {
                if let Some(target) = step.target().map_err(stop)?
                    && let Some(bytes) = target.bytes().map_err(stop)?
                {
                    let sha256 = sha256_hex(&bytes);
                    keep_table(c, &sha256, &bytes)?;
                    step.before = Some(sha256);
                }
            }
            Act::of(0, order, &steps).begin(c).map(Some)
        })?;
        let Some(id) = id else { return Ok(carried) };
        let act = Act::of(id, order, &steps);
        if let Err(error) = self.install(&act) {
            // Nothing stays of it; where not even that can be done, it waits for the next command.
            return Err(match self.undo(&act) {
                Ok(()) => error,
                Err(_) => {
                    let slot = act.steps.iter().map(|s| s.slot.as_str()).collect::<Vec<_>>().join(", ");
                    FleetError::Unfinished { slot, action: order.action.word(), why: error.to_string() }
                }
            });
        }
        carried.revisions = self.write("end an act", |c| act.conclude(c))?;
        for step in &act.steps {
            carried.files.extend(step.target()?.map(|t| t.file));
        }
        Ok(carried)
    }

    /// Ends what dead processes have begun: does it, or undoes it where it cannot be done. Nothing where a living process is at work.
    pub fn heal(&mut self) -> Result<Vec<Healed>, FleetError> {
        if self.begun()?.is_empty() {
            return Ok(Vec::new());
        }
        match install_lock(&self.file, false)? {
            Some(_lock) => self.heal_locked(),
            None => Ok(Vec::new()),
        }
    }

    /// What was begun and has not ended, by words.
    pub fn unfinished(&self) -> Result<Vec<Healed>, FleetError> {
        let waits = || End::Waits("nothing can be written to the store here".into());
        Ok(self.begun()?.iter().map(|a| a.healed(waits())).collect())
    }

    fn heal_locked(&mut self) -> Result<Vec<Healed>, FleetError> {
        let mut all = Vec::new();
        for act in self.begun()? {
            let end = match self.install(&act) {
                Ok(()) => {
                    self.write("end an act", |c| act.conclude(c))?;
                    End::Done
                }
                Err(FleetError::Damaged { file, what }) => return Err(FleetError::Damaged { file, what }),
                Err(error) => match self.undo(&act) {
                    Ok(()) => End::Undone(error.to_string()),
                    Err(_) => End::Waits(error.to_string()),
                },
            };
            all.push(act.healed(end));
        }
        Ok(all)
    }

    fn begun(&self) -> Result<Vec<Act>, FleetError> {
        begun(&self.connection).map_err(self.fail("read what was begun"))
    }

    /// Gives every file of an act its bytes: all are written under other names first, so that a full disk is met before any takes its own.
    fn install(&self, act: &Act) -> Result<(), FleetError> {
        let mut ready = Vec::new();
        for step in &act.steps {
            let Some(target) = step.target()? else { continue };
            target.clear();
            let now = target.bytes()?.map(|b| sha256_hex(&b));
            if now.as_deref() == Some(&step.sha256) {
                continue;
            }
            if now.is_some() && now != step.before {
                return Err(FleetError::ChangedMeanwhile { file: target.file, action: act.action.word() });
            }
            ready.push(installed::stage(&target, &self.table(&step.sha256)?)?);
        }
        ready.into_iter().try_for_each(|t| t.place().map(|_| ()).map_err(FleetError::from))
    }

    /// Puts back what stood in the folders before an act, and ends it without revisions.
    fn undo(&mut self, act: &Act) -> Result<(), FleetError> {
        for step in &act.steps {
            let Some(target) = step.target()? else { continue };
            let now = target.bytes()?.map(|b| sha256_hex(&b));
            if now.as_deref() != Some(&step.sha256) || now == step.before {
                continue;
            }
            match &step.before {
                Some(sha256) => installed::stage(&target, &self.table(sha256)?)?.place().map(|_| ())?,
                None => target.remove()?,
            }
        }
        self.write("end an act", |c| act.end(c, "undone"))
    }
}

impl Step {
    fn target(&self) -> Result<Option<Target>, FleetError> {
        self.folder.as_deref().map(|folder| Target::of(folder, &self.slot)).transpose()
    }
}

impl Act {
    fn of(id: i64, order: &Order<'_>, steps: &[Step]) -> Act {
        Act { id, action: order.action, stamp: order.stamp.clone(), why: order.why.into(), steps: steps.to_vec() }
    }

    fn values(&self, id: i64, ended: Option<&str>) -> Vec<Value> {
        let Stamp { who, at } = &self.stamp;
        let words = [self.action.word(), who.as_str(), at.as_str(), self.why.as_str()].map(text);
        [Value::Integer(id)].into_iter().chain(words).chain([maybe(ended)]).collect()
    }

    /// Writes down what is about to be done; gives its number.
    fn begin(&self, c: &Connection) -> Result<i64, rusqlite::Error> {
        let query = "SELECT coalesce((SELECT seq FROM sqlite_sequence WHERE name = 'acts'), 0) + 1";
        let id: i64 = c.query_row(query, [], |r| r.get(0))?;
        ACTS.put(c, "INSERT", self.values(id, None))?;
        for s in &self.steps {
            let folder = s.folder.as_ref().map(|f| f.to_string_lossy().into_owned());
            let words =
                [Some(s.slot.as_str()), folder.as_deref(), Some(s.sha256.as_str()), s.before.as_deref()].map(maybe);
            let values = [Value::Integer(id)].into_iter().chain(words).chain([Value::Integer(s.stands_on)]);
            ACT_FILES.put(c, "INSERT", values.collect())?;
        }
        Ok(id)
    }

    /// Adds the revisions, and before each what was found in the folder that nobody knew of.
    fn conclude(&self, c: &Connection) -> Result<Vec<Revision>, rusqlite::Error> {
        let mut added = Vec::with_capacity(self.steps.len());
        for s in &self.steps {
            let before = chain(c, &s.slot)?;
            let Some(base) = before.iter().find(|r| r.id == s.stands_on) else {
                return Err(stop(damaged(format!("revision {} of {} is not there", s.stands_on, s.slot))));
            };
            let known = in_slot(&before).map(|r| r.sha256.as_str());
            let strange = s.before.as_deref().filter(|b| Some(*b) != known && *b != s.sha256);
            if let Some(sha256) = strange {
                let folder = s.folder.as_deref().map(|f| f.display().to_string()).unwrap_or_default();
                let why = format!("stood in {folder}");
                add(
                    c,
                    &New { slot: &s.slot, action: Action::Found, sha256, run: None, why: &why, inputs: "" },
                    &self.stamp,
                )?;
            }
            let new = New {
                slot: &s.slot,
                action: self.action,
                sha256: &s.sha256,
                run: base.run.as_deref(),
                why: &self.why,
                inputs: &base.inputs,
            };
            add(c, &new, &self.stamp)?;
            added.extend(chain(c, &s.slot)?.pop());
        }
        if self.id > 0 {
            self.end(c, "done")?;
        }
        Ok(added)
    }

    fn end(&self, c: &Connection, how: &str) -> Result<(), rusqlite::Error> {
        ACTS.put(c, "REPLACE", self.values(self.id, Some(how))).map(|_| ())
    }

    fn healed(&self, end: End) -> Healed {
        let Stamp { who, at } = self.stamp.clone();
        let slots = self.steps.iter().map(|s| s.slot.clone()).collect();
        Healed { action: self.action.word().into(), slots, who, at, end }
    }
}

/// Acts that have not ended, oldest first.
fn begun(c: &Connection) -> Result<Vec<Act>, rusqlite::Error> {
    let mut all = Vec::new();
    let mut query = c.prepare(&format!("{} WHERE t.ended IS NULL ORDER BY t.id", ACTS.select()))?;
    let mut rows = query.query([])?;
    while let Some(r) = rows.next()? {
        ACTS.hold(r)?;
        let action = if r.get::<_, String>(1)? == "rollback" { Action::Rollback } else { Action::Apply };
        let (id, stamp) = (r.get(0)?, Stamp { who: r.get(2)?, at: r.get(3)? });
        all.push(Act { id, action, stamp, why: r.get(4)?, steps: steps(c, id)? });
    }
    Ok(all)
}

fn steps(c: &Connection, act: i64) -> Result<Vec<Step>, rusqlite::Error> {
    let mut query = c.prepare_cached(&format!("{} WHERE t.act = ?1 ORDER BY t.slot", ACT_FILES.select()))?;
    let rows = query.query_map([act], step_of)?;
    rows.collect()
}
