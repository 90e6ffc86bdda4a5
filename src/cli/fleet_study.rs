//! Studies of the fleet: they run this very program as other processes, so that time, memory and kills are those of a real run.
//!
//! In: the folder for results. Out: `fleet.md`, `fleet_shared.md`, `fleet_scale.md`, `fleet_kills.md`. Work is done in a temporary folder.

use super::{Failure, Screen};
use crate::document::{read_text, write_text};
use crate::numeric::random::Random;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A folder for the work, gone afterwards.
struct Place(PathBuf);

impl Place {
    fn new(name: &str) -> Result<Place, Failure> {
        let folder = std::env::temp_dir().join(format!("servotune-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).map_err(|source| Failure::Child { what: "make a folder".into(), source })?;
        Ok(Place(folder))
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// This program with these words.
fn program(words: &[&str]) -> Result<Command, Failure> {
    let fail = |source| Failure::Child { what: "find this program".into(), source };
    let mut c = Command::new(std::env::current_exe().map_err(fail)?);
    c.args(words).stdin(Stdio::null()).stderr(Stdio::null());
    Ok(c)
}

/// Runs this program with `--json` and gives its document; a run that could not be done is an error.
fn json(words: &[&str]) -> Result<Value, Failure> {
    let fail = |source| Failure::Child { what: words.join(" "), source };
    let out = program(words)?.arg("--json").output().map_err(fail)?;
    serde_json::from_slice(&out.stdout).map_err(|source| Failure::Json { source })
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

fn number(v: &Value, key: &str) -> f64 {
    v[key].as_f64().unwrap_or(f64::NAN)
}

/// One run of FLEET.toml.
fn run(fleet: &Path, out: &Path, more: &[&str]) -> Result<Value, Failure> {
    let (fleet, out) = (text(fleet), text(out));
    let mut words = vec!["fleet", "run", &fleet, "--out", &out];
    words.extend(more);
    json(&words)
}

fn twin(out: &Path, more: &[&str]) -> Result<(), Failure> {
    let out = text(out);
    let mut words = vec!["twin", "fleet", "--out", &out];
    words.extend(more);
    json(&words).map(|_| ())
}

fn verdicts(v: &Value) -> String {
    let words = ["keeps", "tuned", "untunable", "repair", "inspect", "failed"];
    words.iter().map(|w| format!("{} {w}", v["verdicts"][w])).collect::<Vec<_>>().join(", ")
}

/// What every page says about the machine that it was measured on.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    format!(
        "Machine: {cores} cores, shared with other work while this was measured (load average when the page was written: {}).",
        std::fs::read_to_string("/proc/loadavg")
            .unwrap_or_else(|_| "unknown".into())
            .split(' ')
            .take(3)
            .collect::<Vec<_>>()
            .join(" ")
    )
}

/// The coverage table of a run.
fn coverage(v: &Value) -> String {
    let s = &v["shared"];
    let slots = number(s, "slots");
    let share = |x: f64| format!("{:.1} %", 100.0 * x / slots);
    let mut t =
        String::from("| tables | slots served | no choice of as many candidates serves more than |\n|---|---|---|\n");
    for c in s["curve"].as_array().into_iter().flatten() {
        let k = c["tables"].as_array().map_or(0, Vec::len);
        let (served, most) = (number(c, "served"), number(c, "at_most"));
        t += &format!("| {k} | {served} ({}) | {most} ({}) |\n", share(served), share(most));
    }
    t += &format!("\n| another way | slots served of {slots} |\n|---|---|\n");
    for (way, key) in [
        ("gains as they stand in each slot today", "today"),
        ("the one table of FLEET.toml for all slots", "base"),
        ("a table of its own for each slot", "own"),
        ("any candidate of the library", "coverable"),
    ] {
        t += &format!("| {way} | {} ({}) |\n", number(s, key), share(number(s, key)));
    }
    for g in s["groups"].as_array().into_iter().flatten() {
        let (k, served) = (g[0].as_u64().unwrap_or(0), g[1].as_f64().unwrap_or(f64::NAN));
        t += &format!(
            "| {k} groups of machines that look alike, one table each, each slot with its group's | {served} ({}) |\n",
            share(served)
        );
    }
    t
}

/// 64 testers of 16 slots from raw files, three runs of the same floor.
pub(super) fn floor(out: &Path, screen: &mut Screen) -> Result<Vec<PathBuf>, Failure> {
    let place = Place::new("floor")?;
    let result = place.at("out");
    let store = text(&place.at("fleet.db"));
    let mut runs = Vec::new();
    for age in ["0", "6", "12"] {
        let floor = place.at(&format!("floor{age}"));
        screen.say(&format!("floor: measurement {age}"));
        twin(&floor, &["--testers", "64", "--run", age])?;
        // One store for all three, beside their folders.
        let file = floor.join("FLEET.toml");
        write_text(&file, &format!("store = {store:?}\n{}", read_text(&file)?))?;
        runs.push(run(&file, &result, &["--run", &format!("age-{age}")])?);
    }
    let last = &runs[runs.len() - 1];
    let lines = |name: &str, n: usize| -> Result<String, Failure> {
        Ok(read_text(&result.join(name))?.lines().take(n).collect::<Vec<_>>().join("\n"))
    };
    let mut rows = String::new();
    for (v, age) in runs.iter().zip(["0", "6", "12"]) {
        rows += &format!(
            "| {age} | {} | {:.1} | {:.1} | {:.0} | {} |\n",
            v["slots"],
            number(v, "seconds"),
            number(v, "slots_per_s"),
            number(v, "peak_memory_mib"),
            verdicts(v)
        );
    }
    let page = format!(
        "# 16 x 64 slots, from raw files to tables and report\n\n\
         Made by `servotune study fleet --out results`. A made-up floor (`specs/fleet.md`, \"The made-up floor\") is measured three times, ages 0, 6 and 12; each\n\
         time all 1024 slots go from their files through gate, identification, judgement and tuning into one store. Every table stands two\n\
         temperatures and two drawn plants. {}\n\n\
         | age | slots | s | slots/s | peak MiB | verdicts |\n|---|---|---|---|---|---|\n{rows}\n\
         The page of the last run: [fleet.html](fleet.html).\n\n## Shared tables, last run\n\n{}\n\
         ## Work list, its first lines\n\n```text\n{}\n```\n\n## Drift over the three runs, its first lines\n\n```text\n{}\n```\n",
        machine(),
        coverage(last),
        lines("work_list.csv", 16)?,
        lines("drift.csv", 8)?
    );
    let files = vec![out.join("fleet.md"), out.join("fleet.html")];
    write_text(&files[0], &page)?;
    write_text(&files[1], &read_text(&result.join("fleet.html"))?)?;
    Ok(files)
}

/// Coverage over K for a thousand slots.
pub(super) fn shared(out: &Path, screen: &mut Screen) -> Result<Vec<PathBuf>, Failure> {
    let place = Place::new("shared")?;
    let floor = place.at("floor");
    screen.say("shared: 1000 slots");
    twin(&floor, &["--slots", "1000"])?;
    let v = run(&floor.join("FLEET.toml"), &place.at("out"), &[])?;
    let s = &v["shared"];
    let enough = s["curve"].as_array().into_iter().flatten().find(|c| number(c, "served") >= 0.99 * number(s, "slots"));
    let words = match enough {
        Some(c) => format!("{} tables serve 99 %", c["tables"].as_array().map_or(0, Vec::len)),
        None => "99 % was not reached".into(),
    };
    let page = format!(
        "# Shared tables for 1000 slots\n\n\
         Made by `servotune study fleet-shared --out results`. {}\n\n\
         A slot counts as served where the table meets every limit of `specs/limits/floor.toml` as measured, at 18 and 30 deg C, and on two plants\n\
         drawn from its model's covariance. Slots that the gate sends to repair or to a person are not among them. Verdicts: {}.\n\n{}\n\
         Aim: 99 % with at most 8 tables; {words}.\n",
        machine(),
        verdicts(&v),
        coverage(&v)
    );
    let files = vec![out.join("fleet_shared.md")];
    write_text(&files[0], &page)?;
    Ok(files)
}

/// Slots per second and memory over the size of the floor.
pub(super) fn scale(out: &Path, sizes: &[usize], screen: &mut Screen) -> Result<Vec<PathBuf>, Failure> {
    let place = Place::new("scale")?;
    let mut rows = String::new();
    let mut last: Option<(usize, f64, f64, f64)> = None;
    for &size in sizes {
        screen.say(&format!("scale: {size} slots"));
        let floor = place.at(&format!("floor{size}"));
        twin(&floor, &["--slots", &size.to_string()])?;
        let result = place.at(&format!("out{size}"));
        let v = run(&floor.join("FLEET.toml"), &result, &[])?;
        let store = std::fs::metadata(result.join("fleet.db")).map_or(f64::NAN, |m| m.len() as f64 / 1048576.0);
        let (seconds, files) = (number(&v, "seconds"), number(&v, "files_seconds"));
        let memory = number(&v, "peak_memory_mib");
        rows += &format!(
            "| {size} | {seconds:.1} | {files:.1} | {:.1} | {memory:.0} | {store:.0} | {} |\n",
            number(&v, "slots_per_s"),
            verdicts(&v)
        );
        last = Some((size, seconds + files, memory, store));
        let _ = std::fs::remove_dir_all(&result);
    }
    let mut ahead = String::new();
    if let Some((size, seconds, memory, store)) = last {
        let times = 10_000_000.0 / size as f64;
        ahead = format!(
            "A floor of 10 000 000 slots, a hundred times 100 000, by the largest run above in proportion: {:.0} h on one such machine, a store of {:.0} GiB,\n\
             {:.0} MiB of memory and what the last steps hold for each slot.\n",
            seconds * times / 3600.0,
            store * times / 1024.0,
            memory
        );
    }
    let page = format!(
        "# How a run grows with the floor\n\n\
         Made by `servotune study fleet-scale --out results`. Slots are made up when they are needed, which is part of the time. {}\n\n\
         | slots | run (s) | files (s) | slots/s | peak MiB | store MiB | verdicts |\n|---|---|---|---|---|---|---|\n{rows}\n\
         Slots/s counts all of a run: pilots, every slot, explanations, shared tables. Aim: 100 slots/s on 2 cores, below 1024 MiB.\n\n\
         {AHEAD}\n{ahead}",
        machine()
    );
    let files = vec![out.join("fleet_scale.md")];
    write_text(&files[0], &page)?;
    Ok(files)
}

/// What fails first, in the order of its coming.
const AHEAD: &str = "## What fails first when the fleet is a hundred times larger\n\n\
1. Time: it grows with the number of slots, the store and the memory do not stand in its way. More processes on one store share the chunks\n\
   (`tests/fleet_run.rs`), as long as they see one file system with working locks: one machine, or a few on one server.\n\
2. The store: one writer at a time. A chunk of 64 rows is one transaction with one flush; a disk of 100 flushes a second ends at 6400 slots a\n\
   second, far beyond what the cores of one machine work out.\n\
3. The page and the drift table, which hold a line for each slot up to 20 000 and 200 000; beyond that the page samples, the drift leaves out.\n\n\
**The plan for many machines.** A slot's row depends on the slot, the settings and the library alone. So the work spreads as a map: (1) one machine makes the\n\
library; (2) tables of slots, partitioned by tester, go out as Parquet; every worker runs the same function on its partition and hands back rows as\n\
Parquet; (3) one machine reads them into the store, chooses the shared tables and writes the files. Apache DataFusion Ballista runs step 2 where the\n\
function is registered on every executor; its limits for such functions are in the project's notes on dependencies. Each partition is idempotent by run,\n\
slot and digest, so that a partition done twice changes nothing.\n";

/// Slots of the floor that is killed.
const KILLED_SLOTS: &str = "32";

/// Files that must be equal to the last byte.
const COMPARED: [&str; 6] =
    ["slots.csv", "slots.jsonl", "coverage.csv", "shared.json", "work_list.csv", "untunable.json"];

fn bytes(folder: &Path) -> Result<Vec<Vec<u8>>, Failure> {
    let read = |name: &&str| {
        std::fs::read(folder.join(name)).map_err(|source| Failure::Child { what: format!("read {name}"), source })
    };
    COMPARED.iter().map(read).collect()
}

/// Kills a run at random instants until it has been killed `kills` times; every finished run is compared with an undisturbed one.
pub(super) fn kills(out: &Path, kills: usize, screen: &mut Screen) -> Result<Vec<PathBuf>, Failure> {
    let place = Place::new("kills")?;
    let floor = place.at("floor");
    twin(&floor, &["--slots", KILLED_SLOTS])?;
    let fleet = floor.join("FLEET.toml");
    let smaller = read_text(&fleet)?.replace("pilots = 32", "pilots = 4\ncandidates = 12");
    write_text(&fleet, &smaller.replace("most = 16", "most = 8"))?;
    let calm = run(&fleet, &place.at("calm"), &[])?;
    let whole = number(&calm, "seconds") + number(&calm, "files_seconds");
    let wanted = bytes(&place.at("calm"))?;
    let mut random = Random::new(1);
    let (mut done, mut finished, mut before, mut unsound, mut lost, mut doubled, mut differ) = (0, 0, 0, 0, 0, 0, 0);
    while done < kills {
        let result = place.at(&format!("killed{finished}"));
        let words = [text(&fleet), text(&result)];
        let mut most = 0usize;
        loop {
            let fail = |source| Failure::Child { what: "start a run".into(), source };
            let mut child = program(&[
                "fleet", "run", &words[0], "--out", &words[1], "--chunk", "2", "--run", "one", "--pages", "0",
            ])?
            .stdout(Stdio::null())
            .spawn()
            .map_err(fail)?;
            let wait = Duration::from_secs_f64(random.between(0.0, 0.6 * whole));
            let begun = Instant::now();
            let ended = loop {
                if child.try_wait().map_err(fail)?.is_some() {
                    break true;
                }
                if begun.elapsed() >= wait || done >= kills {
                    break false;
                }
                std::thread::sleep(Duration::from_millis(1));
            };
            if ended {
                break;
            }
            if done >= kills {
                child.wait().map_err(fail)?;
                break;
            }
            child.kill().map_err(fail)?;
            child.wait().map_err(fail)?;
            done += 1;
            let file = result.join("fleet.db");
            if file.exists() {
                let store = crate::fleet::Store::open(&file)?;
                unsound += usize::from(!store.sound()?);
                let rows = store.runs()?.first().map_or(Ok(0), |r| store.count_done(&r.run))?;
                // What was committed must still be there.
                lost += most.saturating_sub(rows);
                most = most.max(rows);
                before += usize::from(rows > 0);
            }
            if done % 50 == 0 {
                screen.say(&format!("kills: {done} of {kills}"));
            }
        }
        let store = crate::fleet::Store::open(&result.join("fleet.db"))?;
        let runs = store.runs()?;
        doubled += runs.len().saturating_sub(1);
        let name = runs.first().map(|r| r.run.clone()).unwrap_or_default();
        let mut names = std::collections::BTreeSet::new();
        store.each_row(&name, None, |r| {
            doubled += usize::from(!names.insert(r.id()));
            Ok(())
        })?;
        lost += KILLED_SLOTS.parse::<usize>().unwrap_or(0).saturating_sub(names.len());
        differ += usize::from(bytes(&result)? != wanted);
        finished += 1;
        let _ = std::fs::remove_dir_all(&result);
    }
    let page = format!(
        "# {kills} kills at random instants\n\n\
         Made by `servotune study fleet-kills --out results`. A run of {KILLED_SLOTS} slots (4 pilots, chunks of 2) is killed by SIGKILL at instants drawn evenly over 0 to\n\
         0.6 of the time that an undisturbed run takes ({whole:.1} s), started again, killed again, until it ends; then the next run begins. {}\n\n\
         | what | count |\n|---|---|\n| kills | {done} |\n| of them with rows already in the store | {before} |\n| runs that ended | {finished} |\n\
         | stores that failed the database's own check after a kill | {unsound} |\n| slots lost | {lost} |\n| slots or runs doubled | {doubled} |\n\
         | runs whose files differ from the undisturbed one | {differ} |\n\n\
         Compared byte by byte: {}. Full disk, power cut and two processes on one store: `tests/fleet_run.rs`.\n",
        machine(),
        COMPARED.join(", ")
    );
    let files = vec![out.join("fleet_kills.md")];
    write_text(&files[0], &page)?;
    Ok(files)
}
