//! The command line: one file for each subcommand. Data goes to stdout, messages for people to stderr.

mod bench;
mod check;
mod convert;
mod datasheet;
mod depth_quality;
pub mod diagnostics;
mod diff;
mod end_to_end;
mod explain;
mod facts;
mod film;
mod frames;
mod import;
mod info;
mod init;
mod interrupt;
mod job;
mod json;
mod kernels;
mod lint;
mod merge;
mod outline;
pub mod part;
mod parts;
mod pipeline;
mod presets;
mod recording;
mod scan;
mod schema;
mod selftest;
mod shell;
mod terminal;
mod threads;
mod verify;
mod view;

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::error::Error;
use terminal::Terminal;

#[derive(Debug, Parser)]
#[command(name = "beamcast", version, about, arg_required_else_help = true)]
#[command(after_help = "Exit codes: 0 fine, 1 a difference, 2 usage or configuration, 3 scene, 4 output, \
                        129, 130 and 143 stopped by a signal.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    terminal: terminal::Args,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a job: cast its sensors' beams against its scene, and write the frames
    Scan(scan::Args),
    /// Make the parts of a run one, which `scan --shard` has written to one folder
    Merge(merge::Args),
    /// Hold a scan's folder to its manifest: each file's length and hash, missing files and unknown ones
    Verify(verify::Args),
    /// Check jobs, sensor files and scenes without running them, and say which facts follow from them
    Lint(lint::Args),
    /// Run jobs, and hold their frames to baselines and expectations
    Check(check::Args),
    /// Compare two outputs, channel by channel: images, clouds, folders, or jobs, which are run
    Diff(diff::Args),
    /// Write recorded clouds or images in another format: a file, or every frame of a folder
    Convert(convert::Args),
    /// Tell the story of one pulse: where it goes, what it meets, what comes back, and why it is reported so
    Explain(explain::Args),
    /// Time a job: loading, building and casting, each apart, or all until the files are on the disk
    Bench(bench::Args),
    /// List the built-in sensors, or show one
    Presets(presets::Args),
    /// Cast sensors' own patterns at planes, a box, a wedge and a ball, and hold the ranges to closed forms
    Selftest(selftest::Args),
    /// Show frames as one HTML page: range images, and a cloud to turn
    View(view::Args),
    /// Make an animated picture, or a contact sheet, of the previews of a scan
    Film(film::Args),
    /// Compare the ray-triangle methods that `[trace] kernel` chooses from: speed, errors, leaks
    Kernels(kernels::Args),
    /// Write a job to start from, with a comment on every line
    Init(init::Args),
    /// Make a sensor file of a unit's calibration: Ouster, Velodyne, Hesai, RoboSense, ROS and OpenCV cameras, tables of rays
    Import(import::Args),
    /// Say what a file holds: a job, a sensor file, a scene, a range image, a cloud, or a scan's folder
    Info(info::Args),
    /// Print the JSON Schema of jobs or sensor files, with which editors complete and check them
    Schema(schema::Args),
    /// Print a shell's completion script
    Completions(shell::CompletionsArgs),
    /// Print the manual page
    Man,
}

/// Runs the tool on the process's arguments.
pub fn main() -> ExitCode {
    ExitCode::from(main_with(std::env::args_os()))
}

/// Runs the tool on arguments, of which the first is the program's name, and returns the exit code. A process can do so once,
/// because the tool sets up the threads of the process and watches its signals.
pub fn main_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    interrupt::outlive_file_limits();
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(shown) => return show(&shown),
    };
    let terminal = Terminal::new(&cli.terminal);
    match run(&cli.command, &terminal) {
        Ok(()) => 0,
        Err(error) => {
            terminal.error(&error);
            error.exit_code()
        }
    }
}

/// Shows help, the version, or what is wrong with the arguments.
fn show(shown: &clap::Error) -> u8 {
    match shown.print().and_then(|()| io::stdout().flush()) {
        // A reader that has gone away has read enough.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            let error = Error::output("stdout", error);
            let _ = writeln!(io::stderr(), "error: {error}");
            error.exit_code()
        }
        _ => u8::try_from(shown.exit_code()).unwrap_or(2),
    }
}

impl Command {
    /// The threads that the subcommand works on, if it works on many.
    fn threads(&self) -> Option<threads::Args> {
        match self {
            Self::Scan(args) => Some(args.threads()),
            Self::Check(args) => Some(args.threads),
            Self::Diff(args) => Some(args.threads),
            Self::Explain(args) => Some(args.threads()),
            Self::Bench(args) => Some(args.threads()),
            Self::Lint(_) | Self::Selftest(_) | Self::View(_) | Self::Kernels(_) | Self::Convert(_) => {
                Some(threads::Args::default())
            }
            Self::Info(_) | Self::Presets(_) => Some(threads::Args::default()),
            Self::Init(_) | Self::Import(_) | Self::Schema(_) | Self::Film(_) => None,
            Self::Merge(_) | Self::Verify(_) => None,
            Self::Completions(_) | Self::Man => None,
        }
    }
}

fn run(command: &Command, terminal: &Terminal) -> Result<(), Error> {
    if let Some(threads) = command.threads() {
        threads.start()?;
    }
    match command {
        Command::Scan(args) => scan::run(args, terminal),
        Command::Lint(args) => lint::run(args, terminal),
        Command::Merge(args) => merge::run(args, terminal),
        Command::Verify(args) => verify::run(args, terminal),
        Command::Check(args) => check::run(args, terminal),
        Command::Diff(args) => diff::run(args, terminal),
        Command::Convert(args) => convert::run(args, terminal),
        Command::Explain(args) => explain::run(args, terminal),
        Command::Bench(args) => bench::run(args, terminal),
        Command::Selftest(args) => selftest::run(args, terminal),
        Command::View(args) => view::run(args, terminal),
        Command::Film(args) => film::run(args, terminal),
        Command::Kernels(args) => kernels::run(args, terminal),
        Command::Presets(args) => presets::run(args, terminal),
        Command::Init(args) => init::run(args, terminal),
        Command::Import(args) => import::run(args, terminal),
        Command::Info(args) => info::run(args, terminal),
        Command::Schema(args) => schema::run(args, terminal),
        Command::Completions(args) => shell::completions(args, Cli::command(), terminal),
        Command::Man => shell::man(Cli::command(), terminal),
    }
}
