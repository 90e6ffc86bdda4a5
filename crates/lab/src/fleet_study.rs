//! Studies of the fleet: they run the program `servotune` as other processes, so that time, memory and kills are those of a real run.
//!
//! In: the folder for results. Out: `fleet.md`, `fleet_shared.md`, `fleet_scale.md`. Work is done in a temporary folder.

use super::StudyError;
use serde_json::Value;
use servotune::document::{read_text, write_text};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A folder for the work, gone afterwards.
pub(super) struct Place(PathBuf);

impl Place {
    pub(super) fn new(name: &str) -> Result<Place, StudyError> {
        let folder = std::env::temp_dir().join(format!("servotune-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder)
            .map_err(|source| StudyError::Child { what: "make a folder".into(), source })?;
        Ok(Place(folder))
    }

    pub(super) fn at(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The program `servotune` of the same build, with these words.
pub(super) fn program(words: &[&str]) -> Result<Command, StudyError> {
    let fail = |source| StudyError::Child { what: "find this program".into(), source };
    let file = std::env::current_exe().map_err(fail)?.with_file_name("servotune");
    if !file.exists() {
        return Err(StudyError::NoProgram { file });
    }
    let mut c = Command::new(file);
    c.args(words).stdin(Stdio::null()).stderr(Stdio::null());
    Ok(c)
}

/// Runs the program with `--json` and gives its document; a run that could not be done is an error.
fn json(words: &[&str]) -> Result<Value, StudyError> {
    let fail = |source| StudyError::Child { what: words.join(" "), source };
    let out = program(words)?.arg("--json").output().map_err(fail)?;
    Ok(serde_json::from_slice(&out.stdout)?)
}

pub(super) fn text(path: &Path) -> String {
    path.display().to_string()
}

pub(super) fn number(v: &Value, key: &str) -> f64 {
    v[key].as_f64().unwrap_or(f64::NAN)
}

/// One run of FLEET.toml.
pub(super) fn run(fleet: &Path, out: &Path, more: &[&str]) -> Result<Value, StudyError> {
    let (fleet, out) = (text(fleet), text(out));
    let mut words = vec!["fleet", "run", &fleet, "--out", &out];
    words.extend(more);
    json(&words)
}

pub(super) fn twin(out: &Path, more: &[&str]) -> Result<(), StudyError> {
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
pub(super) fn machine() -> String {
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
    let (slots, own) = (number(s, "slots"), number(s, "own"));
    let share = |x: f64| format!("{:.1} %, {:.1} %", 100.0 * x / own, 100.0 * x / slots);
    let mut t = format!(
        "Of {slots} slots to be served {own} can be: they keep proven gains or have a proven table of their own. Shares are of those {own}, then of all {slots}.\n\n\
         | tables | slots served | no choice of as many candidates serves more than |\n|---|---|---|\n"
    );
    for c in s["curve"].as_array().into_iter().flatten() {
        let k = c["tables"].as_array().map_or(0, Vec::len);
        let (served, most) = (number(c, "served"), number(c, "at_most"));
        t += &format!("| {k} | {served} ({}) | {most} ({}) |\n", share(served), share(most));
    }
    t += "\n| another way | slots served |\n|---|---|\n";
    for (way, key) in [
        ("gains as they stand in each slot today", "today"),
        ("the one table of FLEET.toml for all slots", "base"),
        ("a table of its own for each slot", "own"),
        ("all shared candidates together", "coverable"),
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

/// Full reports kept with the page of the floor.
const REPORTS: usize = 4;

/// 64 testers of 16 slots from raw files, three runs of the same floor.
pub fn floor(out: &Path, say: &mut dyn FnMut(&str)) -> Result<Vec<PathBuf>, StudyError> {
    let place = Place::new("floor")?;
    let result = place.at("out");
    let store = text(&place.at("fleet.db"));
    let mut runs = Vec::new();
    for age in ["0", "6", "12"] {
        let floor = place.at(&format!("floor{age}"));
        say(&format!("floor: measurement {age}"));
        twin(&floor, &["--testers", "64", "--run", age])?;
        // One store for all three, beside their folders.
        let file = floor.join("FLEET.toml");
        write_text(&file, &format!("store = {store:?}\n{}", read_text(&file)?))?;
        let pages = REPORTS.to_string();
        runs.push(run(&file, &result, &["--run", &format!("age-{age}"), "--pages", &pages])?);
    }
    let last = &runs[runs.len() - 1];
    let lines = |name: &str, n: usize| -> Result<String, StudyError> {
        Ok(read_text(&result.join(name))?.lines().take(n).collect::<Vec<_>>().join("\n"))
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as f64;
    let tuned: f64 = last["verdicts"]["tuned"].as_f64().unwrap_or(f64::NAN);
    let certified = number(last, "certified");
    let mut rows = String::new();
    for (v, age) in runs.iter().zip(["0", "6", "12"]) {
        rows += &format!(
            "| {age} | {} | {:.0} | {:.0} | {:.1} | {:.1} | {:.0} | {} |\n",
            v["slots"],
            number(v, "seconds"),
            number(v, "cpu_s"),
            number(v, "slots_per_s"),
            number(v, "slots") * threads / number(v, "slots_stage_cpu_s"),
            number(v, "peak_memory_mib"),
            verdicts(v)
        );
    }
    let page = format!(
        "# 16 x 64 slots, from raw files to tables and report\n\n\
         Made by `lab fleet --out results`. A made-up floor (`specs/fleet.md`, \"The made-up floor\") is measured three times, ages 0, 6 and 12; each\n\
         time all 1024 slots go from their files through gate, identification, judgement and tuning into one store. Every table stands two\n\
         temperatures and two drawn plants. {}\n\n\
         | age | slots | wall (s) | processor (s) | slots/s of the run | slots/s of every slot alone | peak MiB | verdicts |\n|---|---|---|---|---|---|---|---|\n{rows}\n\
         Slots/s of the run counts all: pilots, the library, every slot, explanations of untunable slots, shared tables. \"Every slot alone\" is the stage from a slot's files to its\n\
         accepted and certified table, per processor time: what {threads} cores without other work do.\n\n\
         The page of the last run, with the reports of its {REPORTS} worst slots: `fleet.html`, written beside this page by the command.\n\n\
         Second opinion, last run: of {tuned} tables of tuned slots the prover of `specs/certificate.md` certifies {certified} ({:.1} %): on the identified plant, the\n\
         drawn plants and at each temperature every limit of a margin is kept at every frequency. The others keep them on the measured curve, and miss one on a\n\
         model by what the model leaves over; `slots.csv` says which.\n\n## Shared tables, last run\n\n{}\n\
         ## Work list, its first lines\n\n```text\n{}\n```\n\n## Drift over the three runs, its first lines\n\n```text\n{}\n```\n",
        machine(),
        100.0 * certified / tuned,
        coverage(last),
        lines("work_list.csv", 16)?,
        lines("drift.csv", 8)?
    );
    let mut files = vec![out.join("fleet.md"), out.join("fleet.html")];
    write_text(&files[0], &page)?;
    write_text(&files[1], &read_text(&result.join("fleet.html"))?)?;
    // Reports that the page leads to; those of an earlier page have no reader any more.
    let _ = std::fs::remove_dir_all(out.join("slots"));
    for file in last["files"].as_array().into_iter().flatten().filter_map(Value::as_str).map(Path::new) {
        if let (Some("slots"), Some(name)) = (file.parent().and_then(|p| p.file_name()?.to_str()), file.file_name()) {
            files.push(out.join("slots").join(name));
            write_text(&files[files.len() - 1], &read_text(file)?)?;
        }
    }
    Ok(files)
}

/// Coverage over K for a thousand slots.
pub fn shared(out: &Path, say: &mut dyn FnMut(&str)) -> Result<Vec<PathBuf>, StudyError> {
    let place = Place::new("shared")?;
    let floor = place.at("floor");
    say("shared: 1000 slots");
    twin(&floor, &["--slots", "1000"])?;
    let v = run(&floor.join("FLEET.toml"), &place.at("out"), &[])?;
    let s = &v["shared"];
    let words = |of: &str| {
        let enough = |c: &&Value| number(c, "served") >= 0.99 * number(s, of);
        match s["curve"].as_array().into_iter().flatten().find(enough) {
            Some(c) => format!("{} serve 99 %", c["tables"].as_array().map_or(0, Vec::len)),
            None => "99 % is not reached".into(),
        }
    };
    let (can, all) = (words("own"), words("slots"));
    let page = format!(
        "# Shared tables for 1000 slots\n\n\
         Made by `lab fleet-shared --out results`. {}\n\n\
         A slot counts as served where the table meets every limit of `specs/limits/floor.toml` as measured, at 18 and 30 deg C, and on two plants\n\
         drawn from its model's covariance. Slots that the gate sends to repair or to a person are not among them. Verdicts: {}.\n\n{}\n\
         Aim: 99 % with at most 8 tables. Of the slots that any table serves: {can}. Of all slots to be served: {all}, since what no table of its own serves no shared\n\
         one can; `fleet run` explains each of those slots and what would have to change in it.\n\n\
         How the tables come about: `specs/fleet.md`, \"Shared tables\". \"Groups\" is cluster-then-tune: k-means on ln P(jw) of the pilots, a table with the most room for\n\
         each group's most different members, every slot bound to its nearest group. The tables are candidates from a sample of 192 slots, completed on the\n\
         slots that the sample's tables leave.\n",
        machine(),
        verdicts(&v),
        coverage(&v)
    );
    let files = vec![out.join("fleet_shared.md")];
    write_text(&files[0], &page)?;
    Ok(files)
}

/// Slots per second and memory over the size of the floor. The page is written again after each size.
pub fn scale(out: &Path, sizes: &[usize], say: &mut dyn FnMut(&str)) -> Result<Vec<PathBuf>, StudyError> {
    let place = Place::new("scale")?;
    let page = out.join("fleet_scale.md");
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as f64;
    let (mut runs, mut slots) = (String::new(), String::new());
    for &size in sizes {
        say(&format!("scale: {size} slots"));
        let floor = place.at(&format!("floor{size}"));
        twin(&floor, &["--slots", &size.to_string()])?;
        let result = place.at(&format!("out{size}"));
        let v = run(&floor.join("FLEET.toml"), &result, &[])?;
        let store = std::fs::metadata(result.join("fleet.db")).map_or(f64::NAN, |m| m.len() as f64 / 1048576.0);
        let (seconds, files, cpu) = (number(&v, "seconds"), number(&v, "files_seconds"), number(&v, "cpu_s"));
        let (memory, stage, stage_cpu) =
            (number(&v, "peak_memory_mib"), number(&v, "slots_stage_s"), number(&v, "slots_stage_cpu_s"));
        let n = size as f64;
        runs += &format!(
            "| {size} | {seconds:.0} | {cpu:.0} | {:.1} | {files:.1} | {memory:.0} | {store:.0} | {} |\n",
            n / seconds,
            verdicts(&v)
        );
        slots += &format!(
            "| {size} | {stage:.0} | {:.1} | {stage_cpu:.0} | {:.1} | {:.0} % |\n",
            n / stage,
            n * threads / stage_cpu,
            100.0 * number(&v, "loading_thread_s") / (stage * threads)
        );
        let times = 1e7 / n;
        let ahead = format!(
            "A floor of 10 000 000 slots, a hundred times 100 000, by the largest run above in proportion: {:.0} h on one such machine, a store of {:.0} GiB.",
            (seconds + files) * times / 3600.0,
            store * times / 1024.0,
        );
        let asked = 1e5 / n;
        let missed = if asked > 1.0 {
            format!(
                "100 000 slots were not run for this page: in proportion to {size} they take {:.0} min at the rate that the other work left, {:.0} min on {threads} cores without other work, and\n\
                 memory is not what stands in their way.\n\n",
                (seconds + files) * asked / 60.0,
                cpu * asked / threads / 60.0
            )
        } else {
            String::new()
        };
        let done: Vec<String> = sizes.iter().take_while(|s| **s != size).chain([&size]).map(usize::to_string).collect();
        let text = format!(
            "# How a run grows with the floor\n\n\
             Made by `lab fleet-scale --sizes {} --out results`. Slots are made up when they are needed, which is part of the time. {}\n\n\
             ## The stage that grows: every slot\n\n\
             Each slot is drawn, goes through gate, identification, judgement, tuning, proof and the second prover, and is stored. Aim: 100 slots/s on 2 cores.\n\n\
             | slots | wall (s) | slots/s | processor (s) | slots/s on {threads} cores without other work | share of drawing slots |\n|---|---|---|---|---|---|\n{slots}\n\
             The fifth column is slots times cores over processor seconds: what the same work takes where nobody else uses the cores.\n\n\
             ## The whole run\n\n\
             With pilots, library, explanations of untunable slots (40 at most) and shared tables. Aim: below 1024 MiB.\n\n\
             | slots | wall (s) | processor (s) | slots/s | files after it (s) | peak MiB | store MiB | verdicts |\n|---|---|---|---|---|---|---|---|\n{runs}\n\
             {missed}{BEFORE}\n{AHEAD}\n{ahead}\n",
            done.join(","),
            machine()
        );
        write_text(&page, &text)?;
        let _ = std::fs::remove_dir_all(&result);
    }
    Ok(vec![page])
}

/// Where the costs and what brought them down are told.
const BEFORE: &str = "Where the time goes, and what it was before: `specs/fleet.md`, \"Speed\".\n";

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
