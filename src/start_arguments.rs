//! The words of `init`, `check`, `completions` and `export`.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// A machine of some kind to begin with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum MachineKind {
    /// A spiral writer's slot (track, V; 25 kHz)
    Spiral,
    /// A linear stage on air bearings (um, A; 10 kHz)
    Stage,
    /// A scan mirror (rad, V; 100 kHz)
    Galvo,
    /// The voice coil of a disk drive (track, A; 20 kHz)
    Vcm,
    /// A motor with its load on a soft coupling (rad, A; 8 kHz)
    Motor,
}

/// A commented set of files and a made-up sweep that run at once
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune init stage mystage
  servotune init spiral slot07

Writes sweep, controller, spec, a README with the commands to run, and the pages of every key (specs/). Nothing that is there is written over.")]
pub(super) struct InitArguments {
    /// What machine
    #[arg(value_enum, value_name = "MACHINE")]
    pub machine: MachineKind,
    /// Folder to write to
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// What a file is, whether it is right, and what it means in words
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune check sweep.csv controller.toml spec.toml
  servotune check plant.toml controller.toml --json
  servotune check mycase floor/FLEET.toml gate.json

Knows sweeps, plants, controllers, specs, profiles, gain tables, case folders, records, FLEET.toml, gate.json and certificates. Given plants and
controllers it also says the margins of each pair. Exit codes: 0 all are right, 1 one is not, 2 one cannot be read or is none of these.")]
pub(super) struct CheckArguments {
    /// Files, or folders with a case.toml
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
}

/// Completions for a shell, or the manual page, on stdout
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune completions bash > ~/.local/share/bash-completion/completions/servotune
  servotune completions zsh > ~/.zfunc/_servotune
  servotune completions man > ~/.local/share/man/man1/servotune.1")]
pub(super) struct CompletionsArguments {
    /// For what
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: ShellWord,
}

/// A shell, or the manual page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ShellWord {
    Bash,
    Zsh,
    Fish,
    #[value(name = "powershell")]
    PowerShell,
    Man,
}

/// The keys of a file as a JSON schema, for editors that complete and check them
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune schema spec > spec.schema.json
  servotune schema plant > plant.schema.json
  servotune schema --page

The page is specs/keys.md, which `servotune init` writes too.")]
pub(super) struct SchemaArguments {
    /// Of which file
    #[arg(value_enum, value_name = "FILE", required_unless_present = "page")]
    pub file: Option<SchemaFile>,
    /// Every key of every file as a page (Markdown), with --json every schema
    #[arg(long, conflicts_with = "file")]
    pub page: bool,
}

/// A file with keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum SchemaFile {
    /// plant.toml
    Plant,
    /// controller.toml
    Controller,
    /// gains.toml
    Gains,
    /// spec.toml
    Spec,
    /// profile.toml
    Profile,
    /// case.toml
    Case,
    /// FLEET.toml
    Fleet,
}

/// A gain table as code for a firmware, a PLC or MATLAB, with a test vector; a plant for MATLAB, python-control or as JSON
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune export gains.toml --as c --out controller.h
  servotune export gains.toml --as fixed --word-length 24 --plant plant.toml --out controller_fixed.h
  servotune export gains.toml --as st --out controller.st
  servotune export gains.toml --as matlab --out controller.m
  servotune export plant.toml --as matlab --out plant.m
  servotune export plant.toml --as python --out plant.py

fixed rounds every coefficient to a word and measures what that does: to the controller's response, to its command, and with --plant to the margins.
A plant goes out as matlab, python, zpk, tf or ss, and is read back before it is said to be right; every command takes these files as a plant too.")]
pub(super) struct ExportArguments {
    /// Gain table, controller or plant (gains.toml, controller.toml, plant.toml)
    #[arg(value_name = "FILE")]
    pub gains: PathBuf,
    /// What to write
    #[arg(long = "as", value_enum, value_name = "FORM")]
    pub form: ExportForm,
    /// File to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Name in the code; servo for a controller and P for a plant where absent
    #[arg(long, value_name = "NAME", value_parser = identifier)]
    pub name: Option<String>,
    /// Bits of a coefficient, for --as fixed
    #[arg(long, value_name = "BITS", default_value_t = 32, value_parser = clap::value_parser!(u32).range(12..=32))]
    pub word_length: u32,
    /// Plant (plant.toml) whose margins are judged with the rounded coefficients, for --as fixed
    #[arg(long, value_name = "PLANT")]
    pub plant: Option<PathBuf>,
    /// Replace what stands at the place of an output; it is kept under another name, which is said
    #[arg(long)]
    pub force: bool,
}

/// Form of the code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ExportForm {
    /// C99 header, double precision
    C,
    /// C99 header, integers
    Fixed,
    /// IEC 61131-3 structured text
    St,
    /// MATLAB function of a controller, MATLAB script of a plant (zpk)
    Matlab,
    /// Plant for python-control (state space)
    Python,
    /// Plant as JSON: zeros, poles, gain
    Zpk,
    /// Plant as JSON: numerator and denominator
    Tf,
    /// Plant as JSON: A, B, C, D
    Ss,
}

/// A name that C, structured text and MATLAB all take.
fn identifier(text: &str) -> Result<String, String> {
    let good = text.len() <= 40
        && text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if good {
        Ok(text.to_owned())
    } else {
        Err(format!("found `{text}`; expected a letter, then letters, digits and `_`, 40 at most"))
    }
}
