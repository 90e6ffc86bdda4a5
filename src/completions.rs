//! `servotune completions`: words for the shells, and the manual page.

use super::arguments::Arguments;
use super::start_arguments::{CompletionsArguments, ShellWord};
use super::{Ending, Failure, Screen};
use clap::CommandFactory;
use clap_complete::{Shell, generate};
use serde::Serialize;

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    text: &'a str,
}

pub(super) fn run(a: &CompletionsArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let mut command = Arguments::command();
    let mut bytes = Vec::new();
    let mut shell = |shell: Shell| generate(shell, &mut command, "servotune", &mut bytes);
    match a.shell {
        ShellWord::Bash => shell(Shell::Bash),
        ShellWord::Zsh => shell(Shell::Zsh),
        ShellWord::Fish => shell(Shell::Fish),
        ShellWord::PowerShell => shell(Shell::PowerShell),
        ShellWord::Man => manual(&mut bytes)?,
    }
    let text = String::from_utf8_lossy(&bytes);
    screen.result(&Document { schema: "servotune.completions/1", text: &text }, &text)?;
    Ok(Ending::Accepted)
}

/// One page: the program, then each command with its options.
fn manual(bytes: &mut Vec<u8>) -> Result<(), Failure> {
    let fail = |source| Failure::Stdout { source };
    let mut command = Arguments::command();
    command.build();
    clap_mangen::Man::new(command.clone()).render(bytes).map_err(fail)?;
    for sub in command.get_subcommands().filter(|c| c.get_name() != "help" && !c.is_hide_set()) {
        let name = format!("servotune {}", sub.get_name());
        let page = clap_mangen::Man::new(sub.clone().display_name(name));
        page.render_name_section(bytes).map_err(fail)?;
        page.render_synopsis_section(bytes).map_err(fail)?;
        page.render_description_section(bytes).map_err(fail)?;
        page.render_options_section(bytes).map_err(fail)?;
        page.render_extra_section(bytes).map_err(fail)?;
    }
    Ok(())
}
