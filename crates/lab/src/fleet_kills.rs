//! The study of kills: a run is killed at random instants, again and again, and ends as if nobody had touched it.
//!
//! In: the folder for results, how many kills. Out: `fleet_kills.md`.

use super::StudyError;
use super::fleet_study::{Place, machine, number, program, run, text, twin};
use servotune::document::{read_text, write_text};
use servotune::numeric::random::Random;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Slots of the floor that is killed.
const KILLED_SLOTS: &str = "96";

/// Files that must be equal to the last byte.
const COMPARED: [&str; 6] =
    ["slots.csv", "slots.jsonl", "coverage.csv", "shared.json", "work_list.csv", "untunable.json"];

fn bytes(folder: &Path) -> Result<Vec<Vec<u8>>, StudyError> {
    let read = |name: &&str| {
        std::fs::read(folder.join(name)).map_err(|source| StudyError::Child { what: format!("read {name}"), source })
    };
    COMPARED.iter().map(read).collect()
}

/// Kills a run at random instants until it has been killed `kills` times; every finished run is compared with an undisturbed one.
pub fn kills(out: &Path, kills: usize, say: &mut dyn FnMut(&str)) -> Result<Vec<PathBuf>, StudyError> {
    let place = Place::new("kills")?;
    let floor = place.at("floor");
    twin(&floor, &["--slots", KILLED_SLOTS])?;
    let fleet = floor.join("FLEET.toml");
    let smaller = read_text(&fleet)?.replace("pilots = 32\nscouts = 192", "pilots = 4\nscouts = 8\ncandidates = 12");
    write_text(&fleet, &smaller.replace("most = 12", "most = 8"))?;
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
            let fail = |source| StudyError::Child { what: "start a run".into(), source };
            let mut child = program(&[
                "fleet", "run", &words[0], "--out", &words[1], "--chunk", "8", "--run", "one", "--pages", "0",
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
                unsound += usize::from(!servotune_fleet::Store::check(&file, None)?.problems.is_empty());
                let store = servotune_fleet::Store::open(&file)?;
                let rows = store.runs()?.first().map_or(Ok(0), |r| store.count_done(&r.run))?;
                // What was committed must still be there.
                lost += most.saturating_sub(rows);
                most = most.max(rows);
                before += usize::from(rows > 0);
            }
            if done % 50 == 0 {
                say(&format!("kills: {done} of {kills}"));
            }
        }
        let store = servotune_fleet::Store::open(&result.join("fleet.db"))?;
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
         Made by `lab fleet-kills --out results`. A run of {KILLED_SLOTS} slots (4 pilots, 8 scouts, chunks of 8) is killed by SIGKILL at instants drawn evenly over 0 to\n\
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
