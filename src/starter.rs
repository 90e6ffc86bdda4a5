//! The sets of files that `servotune init` writes: one machine a kind, every file with comments, and the pages of every key.

use super::Failure;
use super::start_arguments::MachineKind;
use servotune::document::parse_toml;
use servotune::frf::write_bod;
use servotune::lti::{Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::twin::plants::{log_grid, measure};
use std::path::Path;

/// Noise of a sweep that is made here (ratio), and its seed.
const NOISE: f64 = 0.01;
const SEED: u64 = 1;

/// One machine's set.
pub(super) struct Starter {
    /// What the machine is, in a line.
    pub about: &'static str,
    /// Units of position and command.
    pub units: [&'static str; 2],
    /// Its sweep.
    sweep: Swept,
    /// The other files.
    files: &'static [(&'static str, &'static str)],
}

/// Where a sweep comes from.
enum Swept {
    /// It stands in a file.
    Text(&'static str),
    /// It is taken from a made-up plant: its document, first and last frequency (Hz).
    Of(&'static str, [f64; 2]),
}

/// Pages that say what every key means.
const PAGES: [(&str, &str); 11] = [
    ("specs/keys.md", include_str!("../specs/keys.md")),
    ("specs/files.md", include_str!("../specs/files.md")),
    ("specs/tuning.md", include_str!("../specs/tuning.md")),
    ("specs/frf.md", include_str!("../specs/frf.md")),
    ("specs/conventions.md", include_str!("../specs/conventions.md")),
    ("specs/identification.md", include_str!("../specs/identification.md")),
    ("specs/margins.md", include_str!("../specs/margins.md")),
    ("specs/pes.md", include_str!("../specs/pes.md")),
    ("specs/certificate.md", include_str!("../specs/certificate.md")),
    ("specs/mismatch.md", include_str!("../specs/mismatch.md")),
    ("specs/effects.md", include_str!("../specs/effects.md")),
];

impl Starter {
    /// The set of a kind.
    pub(super) fn of(kind: MachineKind) -> Starter {
        match kind {
            MachineKind::Spiral => Starter {
                about: "a spiral writer's slot, 25 kHz, its write judged by the DFT of its position error",
                units: ["track", "V"],
                sweep: Swept::Of(include_str!("../specs/machines/tunable.toml"), [40.0, 5000.0]),
                files: &[
                    ("controller.toml", include_str!("../specs/controllers/nominal.toml")),
                    ("profile.toml", include_str!("../specs/profiles/spiral.toml")),
                    ("spec.toml", include_str!("../specs/limits/paper.toml")),
                ],
            },
            MachineKind::Stage => Starter {
                about: "a linear stage, 12 kg on air bearings, 10 kHz",
                units: ["um", "A"],
                sweep: Swept::Text(include_str!("../examples/stage/sweep.csv")),
                files: &[
                    ("controller.toml", include_str!("../examples/stage/controller.toml")),
                    ("spec.toml", include_str!("../examples/stage/spec.toml")),
                ],
            },
            MachineKind::Galvo => Starter {
                about: "a scan mirror, 100 kHz, one line of a raster",
                units: ["rad", "V"],
                sweep: Swept::Text(include_str!("../examples/galvo/sweep.csv")),
                files: &[
                    ("controller.toml", include_str!("../examples/galvo/controller.toml")),
                    ("profile.toml", include_str!("../examples/galvo/profile.toml")),
                    ("spec.toml", include_str!("../examples/galvo/spec.toml")),
                ],
            },
            MachineKind::Vcm => Starter {
                about: "the voice coil of a disk drive, 20 kHz, track following",
                units: ["track", "A"],
                sweep: Swept::Text(include_str!("../examples/vcm/sweep.csv")),
                files: &[
                    ("controller.toml", include_str!("../examples/vcm/controller.toml")),
                    ("spec.toml", include_str!("../examples/vcm/spec.toml")),
                ],
            },
            MachineKind::Motor => Starter {
                about: "a motor with its load on a soft coupling, 8 kHz",
                units: ["rad", "A"],
                sweep: Swept::Of(include_str!("../examples/motor/plant.toml"), [2.0, 2500.0]),
                files: &[
                    ("controller.toml", include_str!("../examples/motor/controller.toml")),
                    ("spec.toml", include_str!("../examples/motor/spec.toml")),
                ],
            },
        }
    }

    /// Every file by its name in the folder.
    pub(super) fn texts(&self) -> Result<Vec<(String, String)>, Failure> {
        let mut all = vec![("sweep.csv".to_owned(), self.sweep()?), ("README.md".to_owned(), self.readme())];
        // The profile stands beside the spec here.
        let own = |text: &str| text.replace("../profiles/spiral.toml", "profile.toml");
        all.extend(self.files.iter().map(|(name, text)| ((*name).to_owned(), own(text))));
        all.extend(PAGES.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())));
        Ok(all)
    }

    fn sweep(&self) -> Result<String, Failure> {
        let (document, [low, high]) = match self.sweep {
            Swept::Text(text) => return Ok(text.to_owned()),
            Swept::Of(document, band) => (document, band),
        };
        let file = Path::new("plant.toml");
        let plant = Plant::try_from(parse_toml::<PlantFile>(file, document)?)?;
        let taken = measure(&plant, &log_grid(low, high, 480), NOISE, &mut Random::new(SEED))?;
        let mut rows = Vec::new();
        write_bod(&taken, &mut rows)?;
        let [position, command] = self.units;
        let head = format!(
            "# Swept sine, position ({position}) over command ({command}), hold divided out; made up, {} % noise\n",
            100.0 * NOISE
        );
        Ok(head + &String::from_utf8_lossy(&rows).replace('\t', ","))
    }

    /// The commands to run next, in the folder.
    pub(super) fn commands(&self) -> Vec<String> {
        let [position, command] = self.units;
        let units = format!("--position-unit {position} --command-unit {command}");
        let mut all = vec![
            "servotune check sweep.csv controller.toml spec.toml".to_owned(),
            "servotune margins --frf sweep.csv --controller controller.toml".to_owned(),
            format!("servotune identify sweep.csv {units} --out plant.toml"),
            "servotune tune --plant plant.toml --spec spec.toml --controller controller.toml --out gains.toml --report report.html"
                .to_owned(),
            "servotune verify gains.toml --plant plant.toml --spec spec.toml".to_owned(),
        ];
        if self.files.iter().any(|(name, _)| *name == "profile.toml") {
            all.push("servotune simulate --plant plant.toml --controller gains.toml --profile profile.toml".to_owned());
        }
        all.push("servotune export gains.toml --as c --out controller.h".to_owned());
        all
    }

    fn readme(&self) -> String {
        let [position, command] = self.units;
        format!(
            "# {}\n\nMade-up files to begin with: position in {position}, command in {command}. Put your own sweep at the place of `sweep.csv`, what your machine runs at that of\n\
             `controller.toml`, what it must reach into `spec.toml`, and run the same commands in this folder:\n\n```sh\n{}\n```\n\n\
             | file | what | every key |\n|---|---|---|\n\
             | `sweep.csv` | swept sine: frequency, magnitude, phase | `specs/frf.md` |\n\
             | `controller.toml` | what runs today; its `sample_time_s` is the clock | `specs/files.md` |\n\
             | `spec.toml` | what tuning must reach and what it makes smallest | `specs/tuning.md` |\n\
             | `plant.toml` | the model, written by `identify` | `specs/files.md` |\n\
             | `gains.toml` | the new gains, written by `tune` with a certificate beside it | `specs/certificate.md` |\n",
            first_upper(self.about),
            self.commands().join("\n"),
        )
    }
}

fn first_upper(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}
