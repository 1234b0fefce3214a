//! The command line: one file a subcommand. stdout carries data, stderr people.

use std::process::ExitCode;

/// Runs the tool on the process's arguments.
pub fn main() -> ExitCode {
    ExitCode::FAILURE
}
