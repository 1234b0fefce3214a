//! The command line: one file a subcommand. stdout carries data, stderr people.

pub mod diagnostics;
pub mod lint;

use std::process::ExitCode;

/// Runs the tool on the process's arguments.
pub fn main() -> ExitCode {
    ExitCode::FAILURE
}
