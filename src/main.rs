//! The command-line tool; see [`beamcast::cli`].

fn main() -> std::process::ExitCode {
    beamcast::cli::main()
}
