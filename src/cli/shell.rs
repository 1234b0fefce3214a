//! `beamcast completions` and `beamcast man`: what shells and `man` want to know of the command line.

use clap::CommandFactory;

use super::Cli;
use super::terminal::Terminal;
use crate::error::Error;

/// The arguments of `beamcast completions`.
#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

/// Prints a shell's completion script on stdout.
///
/// # Errors
/// If stdout can't be written to.
pub fn completions(args: &CompletionsArgs, terminal: &Terminal) -> Result<(), Error> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "beamcast", &mut script);
    terminal.data(&String::from_utf8_lossy(&script))
}

/// Prints the manual page on stdout: the program's, then each subcommand's synopsis and options.
///
/// # Errors
/// If stdout can't be written to.
pub fn man(terminal: &Terminal) -> Result<(), Error> {
    let mut page = Vec::new();
    let failed = |error| Error::output("stdout", error);
    // Built, so that the subcommands know their whole names and the flags that all have.
    let mut command = Cli::command();
    command.build();
    let whole = clap_mangen::Man::new(command.clone());
    whole.render(&mut page).map_err(failed)?;
    for subcommand in command.get_subcommands().filter(|c| c.get_name() != "help") {
        let name = subcommand.get_name().to_uppercase();
        page.extend_from_slice(format!(".SH \"BEAMCAST {name}\"\n").as_bytes());
        let part = clap_mangen::Man::new(subcommand.clone());
        let mut text = Vec::new();
        part.render_description_section(&mut text).map_err(failed)?;
        part.render_synopsis_section(&mut text).map_err(failed)?;
        part.render_options_section(&mut text).map_err(failed)?;
        // Sections of the part are subsections of the page.
        page.extend_from_slice(String::from_utf8_lossy(&text).replace("\n.SH ", "\n.SS ").as_bytes());
    }
    terminal.data(&String::from_utf8_lossy(&page))
}
