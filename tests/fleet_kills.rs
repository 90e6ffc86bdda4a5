//! A run that is killed goes on where it was; the study `fleet-kills` does this five hundred times.
#![allow(clippy::unwrap_used)]

use servotune_fleet::Store;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Kills of this test; instants are spread over the run, they need not be the same each time.
const KILLS: u64 = 4;

fn run(fleet: &Path, out: &Path) -> Command {
    let mut c = Command::new(env!("CARGO_BIN_EXE_servotune"));
    c.args(["fleet", "run"]).arg(fleet).arg("--out").arg(out).args(["--run", "one", "--chunk", "1", "--pages", "0"]);
    c.stdout(Stdio::null()).stderr(Stdio::null());
    c
}

#[test]
fn killed_runs_end_with_the_bytes_of_an_undisturbed_one() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fleet_kills");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let specs = Path::new(env!("CARGO_MANIFEST_DIR")).join("specs");
    let fleet = folder.join("FLEET.toml");
    let text = format!(
        "spec = {:?}\ncontroller = {:?}\n[input]\ntwin = {{ slots = 5, seed = 5 }}\n[robust]\ndraws = 1\n[tables]\npilots = 1\ncandidates = 4\nmost = 2\n\
         [untunable]\nexplained = 1\n",
        specs.join("limits/floor.toml"),
        specs.join("controllers/nominal.toml"),
    );
    std::fs::write(&fleet, text).unwrap();
    let (calm, killed) = (folder.join("calm"), folder.join("killed"));
    let code = run(&fleet, &calm).status().unwrap().code();
    assert!(matches!(code, Some(0 | 1)), "{code:?}");
    let mut kills = 0;
    for i in 0..KILLS {
        let mut child = run(&fleet, &killed).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(150 + 400 * i));
        if child.try_wait().unwrap().is_none() {
            child.kill().unwrap();
            kills += 1;
        }
        child.wait().unwrap();
        if killed.join("fleet.db").exists() {
            assert!(Store::check(&killed.join("fleet.db"), None).unwrap().problems.is_empty());
        }
    }
    // The first instant is before any run of five slots can have ended.
    assert!(kills >= 1);
    assert!(matches!(run(&fleet, &killed).status().unwrap().code(), Some(0 | 1)));
    for name in
        ["slots.csv", "slots.jsonl", "coverage.csv", "shared.json", "work_list.csv", "untunable.json", "fleet.html"]
    {
        assert_eq!(std::fs::read(calm.join(name)).unwrap(), std::fs::read(killed.join(name)).unwrap(), "{name}");
    }
    let store = Store::open(&killed.join("fleet.db")).unwrap();
    assert_eq!((store.runs().unwrap().len(), store.count_done("one").unwrap()), (1, 5));
}
