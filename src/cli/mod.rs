//! The command line: one file a subcommand. stdout carries data, stderr people.

mod bench;
pub mod diagnostics;
mod interrupt;
mod kernels;
pub mod lint;
mod pipeline;
mod presets;
mod scan;
mod terminal;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::error::Error;
use terminal::Terminal;

#[derive(Debug, Parser)]
#[command(name = "beamcast", version, about, arg_required_else_help = true)]
#[command(after_help = "Exit codes: 0 fine, 1 a difference, 2 usage or configuration, 3 scene, 4 output, \
                        130 and 143 stopped by a signal.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    terminal: terminal::Args,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a job: cast its sensors' beams against its scene and write what they see
    Scan(scan::Args),
    /// Check jobs, sensor files and scenes without running them, and say what follows from them
    Lint(lint::Args),
    /// Time a job: loading, building and casting apart
    Bench(bench::Args),
    /// List the built-in sensors, or show one
    Presets(presets::Args),
    /// Compare the ray-triangle methods that `[trace] kernel` chooses from: speed, errors, leaks
    Kernels(kernels::Args),
}

/// Runs the tool on the process's arguments.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let terminal = Terminal::new(&cli.terminal);
    match run(&cli.command, &terminal) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            terminal.error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(command: &Command, terminal: &Terminal) -> Result<(), Error> {
    match command {
        Command::Scan(args) => scan::run(args, terminal),
        Command::Lint(args) => lint::run(args, terminal.color()),
        Command::Bench(args) => bench::run(args, terminal),
        Command::Kernels(args) => kernels::run(args, terminal),
        Command::Presets(args) => presets::run(args, terminal),
    }
}
