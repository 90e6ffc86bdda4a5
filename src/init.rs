//! `servotune init`: a set of commented files and a made-up sweep that run at once.

use super::start_arguments::InitArguments;
use super::starter::Starter;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::document::FileSet;
use std::path::PathBuf;

#[derive(Serialize)]
struct Written {
    schema: &'static str,
    folder: PathBuf,
    position_unit: &'static str,
    command_unit: &'static str,
    files: Vec<PathBuf>,
    /// To be run in the folder.
    commands: Vec<String>,
}

pub(super) fn run(a: &InitArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let starter = Starter::of(a.machine);
    let texts = starter.texts()?;
    let names: Vec<PathBuf> = texts.iter().map(|(name, _)| a.folder.join(name)).collect();
    // Somebody's own sweep or spec may stand there: a beginning never writes over it.
    if let Some(there) = names.iter().find(|file| file.symlink_metadata().is_ok()) {
        return Err(Failure::AlreadyThere { file: there.clone() });
    }
    let mut files = FileSet::default();
    for (file, (_, text)) in names.iter().zip(texts) {
        files.write(file, text);
    }
    files.commit()?;
    let commands = starter.commands();
    let [position_unit, command_unit] = starter.units;
    let text = format!(
        "{}: {} files for {}.\nRun next:\n\n  cd {}\n  {}\n\nEvery key: {}; your own sweep goes to the place of sweep.csv.\n",
        a.folder.display(),
        names.len(),
        starter.about,
        a.folder.display(),
        commands.join("\n  "),
        a.folder.join("specs").display(),
    );
    let folder = a.folder.clone();
    let schema = "servotune.init/1";
    screen.result(&Written { schema, folder, position_unit, command_unit, files: names, commands }, &text)?;
    Ok(Ending::Accepted)
}
