//! The study of the readers: changed files, and the largest inputs with their time and memory.
//!
//! In: the folder for results, how many changed files. Out: `reliability_readers.md`. The largest inputs go to this very program as another process, so that time and
//! memory are those of a real run; memory is the peak that the system reports while the process lives (Linux; elsewhere 0).

use super::StudyError;
use super::fleet_study::{Place, machine, program, text};
use crate::reader_mutations;
use nalgebra::Complex;
use servotune::document::write_text;
use servotune::lti::FrequencyResponse;
use servotune::numeric::random::Random;
use servotune::recording::gzip;
use servotune::twin::{MachineClass, nominal_controller, paper_machine};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

const SEED: u64 = 19;
/// What a changed file may take, and a large one.
const TRIAL: Duration = Duration::from_secs(20);
const LARGE: Duration = Duration::from_secs(120);

/// One large input.
struct Measured {
    what: &'static str,
    code: i32,
    seconds: f64,
    peak_mb: f64,
    before: &'static str,
}

/// The first trial found the figures called before (issue of 22 November 2026).
pub fn readers(out: &Path, runs: usize, say: &mut dyn FnMut(&str)) -> Result<Vec<PathBuf>, StudyError> {
    let place = Place::new("readers")?;
    let begun = Instant::now();
    let tallies = reader_mutations(runs, SEED, &place.at("trials"), TRIAL, say)?;
    let seconds = begun.elapsed().as_secs_f64();
    let large = large(&place, say)?;
    let mut page = format!(
        "# Readers under changed files and large ones\n\n\
         Made by `lab reliability-readers --out results` (seed {SEED}, {} changed files, {seconds:.0} s). {}\n\n\
         A changed file is one that the reader accepts, with a number, a line, a word, a column or bytes changed, cut, repeated or moved, or with a channel killed;\n\
         what is accepted goes on to margins, identification, simulation or proof. A hang is a trial of more than {} s. A wrong acceptance is a loop called stable from a\n\
         sweep with a killed channel, a table, spec or profile proved beside a certificate of another, a limit on a band without a bin, an identified plant that is none,\n\
         a probability outside 0 to 1. First trial, from outside: 8690 runs, 7 panics, 15 over their limit.\n\n\
         | reader | runs | accepted | refused | panics | hangs | wrong | slowest (s) | longest refusal (characters) |\n|---|---|---|---|---|---|---|---|---|\n",
        tallies.iter().map(|t| t.runs).sum::<usize>(),
        machine(),
        TRIAL.as_secs()
    );
    // Writing to a String cannot fail.
    for t in &tallies {
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {} | {} | {} | {:.2} | {} |",
            t.reader,
            t.runs,
            t.accepted,
            t.refused,
            t.panics.len(),
            t.hangs.len(),
            t.wrong.len(),
            t.slowest_s,
            t.longest_refusal
        );
    }
    for found in tallies.iter().flat_map(|t| t.panics.iter().chain(&t.hangs).chain(&t.wrong)) {
        let _ = writeln!(page, "\n- {found}");
    }
    page += "\n## The largest inputs\n\n| input | exit code | time (s) | peak memory (MB) | first trial |\n|---|---|---|---|---|\n";
    for m in &large {
        let _ = writeln!(page, "| {} | {} | {:.2} | {:.0} | {} |", m.what, m.code, m.seconds, m.peak_mb, m.before);
    }
    page += "\nTimes are wall times on a machine shared with others. The first trial's times are of processor seconds, on another machine.\n";
    let files = vec![out.join("reliability_readers.md")];
    write_text(&files[0], &page)?;
    Ok(files)
}

/// A sweep of the healthy machine, `points` even in the logarithm, 0.3 % noise, as `.bod`.
fn sweep(points: usize) -> Result<String, StudyError> {
    let plant = paper_machine(MachineClass::Healthy)?;
    let mut random = Random::new(points as u64);
    let mut out = "Frequency (Hz)\tMagnitude (dB)\tPhase (deg)\n".to_owned();
    for k in 0..points {
        let hz = 40.0 * 125f64.powf(k as f64 / (points - 1) as f64);
        let noise = Complex::new(1.0 + 0.003 * random.normal(), 0.003 * random.normal());
        let v = plant.at(TAU * hz) * noise;
        let _ = writeln!(out, "{hz}\t{}\t{}", 20.0 * v.norm().log10(), v.arg().to_degrees());
    }
    Ok(out)
}

fn large(place: &Place, say: &mut dyn FnMut(&str)) -> Result<Vec<Measured>, StudyError> {
    let fail = |source| StudyError::Child { what: "make a large input".into(), source };
    let at = |name: &str| text(&place.at(name));
    let put = |name: &str, content: &str| write_text(&place.at(name), content);
    put("plant.toml", include_str!("../../../specs/machines/healthy.toml"))?;
    put("controller.toml", include_str!("../../../specs/controllers/nominal.toml"))?;
    put("profile.toml", include_str!("../../../specs/profiles/spiral.toml"))?;
    put(
        "spec.toml",
        &include_str!("../../../specs/limits/paper.toml").replace("../profiles/spiral.toml", "profile.toml"),
    )?;
    let controller = nominal_controller()?;
    for points in [401, 5000, 50_000, 200_000] {
        put(&format!("s{points}.bod"), &sweep(points)?)?;
    }
    let zeros = gzip(std::io::repeat(0).take(1_000_000_000)).map_err(fail)?;
    std::fs::write(place.at("zeros.csv.gz"), zeros).map_err(fail)?;
    let header = &b"time_s,reference,command,position\n"[..];
    let many = gzip(header.chain(Rows { block: b"0,0,0,0\n".repeat(1 << 17), at: 0, left: 899 })).map_err(fail)?;
    std::fs::write(place.at("rows.csv.gz"), many).map_err(fail)?;
    put("slow.toml", &include_str!("../../../specs/machines/healthy.toml").replacen("37104", "37104e9", 1))?;
    put("far.toml", &include_str!("../../../specs/machines/healthy.toml").replacen("65e-6", "1e5", 1))?;
    let (c, spec, out) = (at("controller.toml"), at("spec.toml"), at("out.toml"));
    let clock = format!("{}", controller.sample_time_s);
    let s = |n: usize| at(&format!("s{n}.bod"));
    let (p, gains) = (at("plant.toml"), at("gains.toml"));
    let work: Vec<(&'static str, Vec<String>, &'static str)> = vec![
        ("identify, 401 points", vec!["identify".into(), s(401), "--out".into(), out.clone()], "0.1 s, 19 MB"),
        ("identify, 5 000 points", vec!["identify".into(), s(5000), "--out".into(), out.clone()], "0.5 s, 21 MB"),
        ("identify, 50 000 points", vec!["identify".into(), s(50_000), "--out".into(), out.clone()], "9.7 s, 135 MB"),
        ("identify, 200 000 points", vec!["identify".into(), s(200_000), "--out".into(), out.clone()], "81 s, 525 MB"),
        (
            "margins --frf, 200 000 points",
            vec!["margins".into(), "--frf".into(), s(200_000), "--controller".into(), c.clone()],
            "1.3 s, 66 MB",
        ),
        (
            "tune --frf, 200 000 points",
            [
                "tune",
                "--frf",
                &s(200_000),
                "--spec",
                &spec,
                "--controller",
                &c,
                "--sample-time-s",
                &clock,
                "--out",
                &gains,
            ]
            .map(str::to_owned)
            .to_vec(),
            "407 s, 526 MB",
        ),
        (
            "record of 1 GB of zeros in 1 MB of gzip",
            ["diagnose", "--plant", &p, "--record", &at("zeros.csv.gz"), "--out", &at("d")].map(str::to_owned).to_vec(),
            "abort at 4 GB",
        ),
        (
            "record of 118 million rows in gzip",
            ["diagnose", "--plant", &p, "--record", &at("rows.csv.gz"), "--out", &at("d")].map(str::to_owned).to_vec(),
            "2.7 GB, abort at 4 GB",
        ),
        (
            "/dev/zero as profile",
            ["simulate", "--plant", &p, "--controller", &c, "--profile", "/dev/zero"].map(str::to_owned).to_vec(),
            "2 GB",
        ),
        (
            "verify, delay of 1e5 s",
            ["verify", &gains, "--plant", &at("far.toml"), "--spec", &spec].map(str::to_owned).to_vec(),
            "20 GB, abort at 4 GB",
        ),
        (
            "verify, damping ratio of 1e9",
            ["verify", &gains, "--plant", &at("slow.toml"), "--spec", &spec].map(str::to_owned).to_vec(),
            "more than 300 s",
        ),
    ];
    let mut all = Vec::new();
    for (what, words, before) in work {
        say(what);
        let (code, seconds, peak_mb) = measure(&words.iter().map(String::as_str).collect::<Vec<_>>())?;
        all.push(Measured { what, code, seconds, peak_mb, before });
    }
    Ok(all)
}

/// A header, then rows over and over.
struct Rows {
    block: Vec<u8>,
    at: usize,
    left: usize,
}

impl Read for Rows {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.at == self.block.len() {
            if self.left == 0 {
                return Ok(0);
            }
            (self.at, self.left) = (0, self.left - 1);
        }
        let count = buffer.len().min(self.block.len() - self.at);
        buffer[..count].copy_from_slice(&self.block[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}

/// Exit code, time (s) and peak memory (MB) of this program with these words; killed at the limit, with code -1.
fn measure(words: &[&str]) -> Result<(i32, f64, f64), StudyError> {
    let fail = |source| StudyError::Child { what: words.join(" "), source };
    let begun = Instant::now();
    let mut child = program(words)?.stdout(Stdio::null()).spawn().map_err(fail)?;
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0.0f64;
    loop {
        if let Some(code) = child.try_wait().map_err(fail)? {
            return Ok((code.code().unwrap_or(-1), begun.elapsed().as_secs_f64(), peak / 1024.0));
        }
        let line = std::fs::read_to_string(&status).unwrap_or_default();
        let kb =
            line.lines().find_map(|l| l.strip_prefix("VmHWM:")?.trim().trim_end_matches(" kB").parse::<f64>().ok());
        peak = peak.max(kb.unwrap_or(0.0));
        if begun.elapsed() > LARGE {
            child.kill().map_err(fail)?;
            child.wait().map_err(fail)?;
            return Ok((-1, begun.elapsed().as_secs_f64(), peak / 1024.0));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
