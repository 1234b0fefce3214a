//! `beamcast completions` and `beamcast man`: the command line, told to shells and to `man`.

use std::ffi::OsStr;

use clap::builder::{PossibleValue, TypedValueParser};

use super::terminal::Terminal;
use crate::config::presets;
use crate::error::Error;

/// A parser of arguments that takes what `parser` takes, and tells shells some words to complete.
#[derive(Clone, Copy)]
pub struct Suggesting<P> {
    parser: P,
    words: fn() -> Vec<&'static str>,
}

/// A parser that suggests words.
pub fn suggesting<P>(parser: P, words: fn() -> Vec<&'static str>) -> Suggesting<P> {
    Suggesting { parser, words }
}

/// A parser that suggests the built-in sensors.
pub fn presets_or<P>(parser: P) -> Suggesting<P> {
    suggesting(parser, || presets::BUILT_IN.iter().map(|(name, _)| *name).collect())
}

impl<P: TypedValueParser> TypedValueParser for Suggesting<P> {
    type Value = P::Value;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<Self::Value, clap::Error> {
        self.parser.parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new((self.words)().into_iter().map(PossibleValue::new)))
    }
}

/// The arguments of `beamcast completions`.
#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

/// Prints a shell's completion script for the program `command` on stdout.
///
/// # Errors
/// If stdout can't be written to.
pub fn completions(
    args: &CompletionsArgs,
    mut command: clap::Command,
    terminal: &Terminal,
) -> Result<(), Error> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "beamcast", &mut script);
    terminal.data(&String::from_utf8_lossy(&script))
}

/// Prints the manual page of the program `command` on stdout, with the synopsis and the options of each subcommand.
///
/// # Errors
/// If stdout can't be written to.
pub fn man(mut command: clap::Command, terminal: &Terminal) -> Result<(), Error> {
    let mut page = Vec::new();
    let failed = |error| Error::output("stdout", error);
    // Only a command that is built gives its subcommands their whole names and the flags that all have.
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
        // The sections of a subcommand are subsections of the page.
        page.extend_from_slice(String::from_utf8_lossy(&text).replace("\n.SH ", "\n.SS ").as_bytes());
    }
    terminal.data(&String::from_utf8_lossy(&page))
}
