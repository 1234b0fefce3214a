//! The terminal: messages and progress go to stderr, data goes to stdout.

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::Value;

use super::diagnostics;
use crate::error::Error;
use crate::scan::Progress;
use crate::scene::Notice;
use crate::source::words::{escaped, harmless_json, on_one_line, without_commands};
use crate::source::{Diagnostic, Severity};

/// The flags that every subcommand has.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Messages")]
pub struct Args {
    /// Show nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Show more: every file that is read and written
    #[arg(short, long, global = true)]
    verbose: bool,
    /// Colour in messages; `auto` means on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_enum, default_value_t, value_name = "WHEN")]
    color: Color,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Color {
    #[default]
    Auto,
    Always,
    Never,
}

/// The way to the user, as the flags have set it.
#[derive(Clone, Copy, Debug)]
pub struct Terminal {
    quiet: bool,
    verbose: bool,
    color: bool,
}

impl Terminal {
    /// Reads the flags, and `NO_COLOR` (any value but the empty one; see no-color.org).
    pub fn new(args: &Args) -> Self {
        let color = match args.color {
            Color::Always => true,
            Color::Never => false,
            Color::Auto => {
                let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
                let dumb = std::env::var_os("TERM").is_some_and(|value| value == "dumb");
                io::stderr().is_terminal() && !no_color && !dumb
            }
        };
        Self { quiet: args.quiet, verbose: args.verbose, color }
    }

    /// Shows the error that ends the run.
    pub fn error(&self, error: &Error) {
        match error {
            Error::Config(problems) | Error::Inputs(problems) => self.problems(problems),
            other => self.labelled("error", "1;31", other),
        }
    }

    /// Shows problems of a file that do not stop the run, unless quiet.
    pub fn warn_of(&self, problems: &[Diagnostic]) {
        if !self.quiet && !problems.is_empty() {
            self.problems(problems);
        }
    }

    fn problems(&self, problems: &[Diagnostic]) {
        to_stderr(&without_commands(diagnostics::render(problems, self.color).trim_end()));
    }

    /// Shows a warning, unless quiet.
    pub fn warn(&self, warning: impl Display) {
        if !self.quiet {
            self.labelled("warning", "1;33", warning);
        }
    }

    /// Shows what is to be known about a scene: warnings unless quiet, notes if `--verbose` asks for details.
    pub fn notices(&self, notices: &[Notice]) {
        for notice in notices {
            match notice.severity {
                Severity::Note if self.verbose => self.labelled("note", "1;32", notice),
                Severity::Note => {}
                Severity::Warning | Severity::Error => self.warn(notice),
            }
        }
    }

    /// Shows a message, unless quiet.
    pub fn say(&self, text: impl Display) {
        if !self.quiet {
            to_stderr(&on_one_line(&text.to_string()));
        }
    }

    /// Shows lines in which no name has a line feed, unless quiet.
    pub fn say_lines(&self, lines: &str) {
        if !self.quiet {
            to_stderr(&escaped(lines.trim_end()));
        }
    }

    /// Shows a detail, if `--verbose` asks for details.
    pub fn detail(&self, text: impl Display) {
        if self.verbose {
            to_stderr(&on_one_line(&text.to_string()));
        }
    }

    fn labelled(&self, label: &str, ansi: &str, text: impl Display) {
        let text = on_one_line(&text.to_string());
        if self.color {
            to_stderr(&format!("\x1b[{ansi}m{label}\x1b[0m: {text}"));
        } else {
            to_stderr(&format!("{label}: {text}"));
        }
    }

    /// Prints data as it is, in which no text is from elsewhere. It is no error if the reader has gone away: it has read enough.
    ///
    /// # Errors
    /// [`Error::Output`] when stdout can't be written to for another reason.
    pub fn data(&self, text: &str) -> Result<(), Error> {
        let mut stdout = io::stdout().lock();
        match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
            Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::output("stdout", e)),
            _ => Ok(()),
        }
    }

    /// Prints lines on stdout in which no name from elsewhere has a line feed. Characters that a terminal acts on are
    /// escaped, and so is what a CI server takes for a command.
    ///
    /// # Errors
    /// As [`Terminal::data`].
    pub fn print(&self, text: &str) -> Result<(), Error> {
        self.data(&escaped(text))
    }

    /// Prints JSON on stdout.
    ///
    /// # Errors
    /// As [`Terminal::data`].
    pub fn json(&self, value: &Value) -> Result<(), Error> {
        self.data(&harmless_json(&format!("{value:#}\n")))
    }

    /// Prints JSON on one line of stdout.
    ///
    /// # Errors
    /// As [`Terminal::data`].
    pub fn json_line(&self, value: &Value) -> Result<(), Error> {
        self.data(&harmless_json(&format!("{value}\n")))
    }

    /// Gives GitHub the commands of a report, on stdout unless that is taken.
    ///
    /// # Errors
    /// As [`Terminal::data`].
    pub fn commands(&self, commands: &str, is_stdout_taken: bool) -> Result<(), Error> {
        if is_stdout_taken {
            let _ = io::stderr().lock().write_all(commands.as_bytes());
            return Ok(());
        }
        self.data(commands)
    }

    /// Whether there are progress bars.
    pub fn has_bar(&self) -> bool {
        !self.quiet && io::stderr().is_terminal()
    }

    /// Works, with a progress bar over `rays` rays if stderr is a terminal.
    pub fn with_progress<T>(&self, rays: u64, progress: &Progress, work: impl FnOnce() -> T) -> T {
        self.with_progress_and_files(rays, progress, &Writing::of(0, 0), work)
    }

    /// Works, with a progress bar over `rays` rays if stderr is a terminal. It says what goes on: casting, or writing which file.
    pub fn with_progress_and_files<T>(
        &self,
        rays: u64,
        progress: &Progress,
        writing: &Writing,
        work: impl FnOnce() -> T,
    ) -> T {
        if !self.has_bar() {
            return work();
        }
        let bar = ProgressBar::new(rays);
        if let Ok(style) =
            ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} % of {human_len} rays{prefix}")
        {
            bar.set_style(style);
        }
        let done = AtomicBool::new(false);
        thread::scope(|scope| {
            let draw = || {
                while !done.load(Ordering::Relaxed) {
                    let cast = progress.rays_done.load(Ordering::Relaxed);
                    bar.set_message(writing.words());
                    bar.set_prefix(writing.rate(bar.elapsed()) + &time_left(cast, rays, bar.elapsed()));
                    bar.set_position(cast);
                    thread::sleep(Duration::from_millis(50));
                }
                bar.finish_and_clear();
            };
            // Where the system gives no thread, there is no bar.
            let _drawing = thread::Builder::new().spawn_scoped(scope, draw);
            let _done = SetOnDrop(&done);
            work()
        })
    }
}

/// The time that is left, if so many of all rays took so long with the files that were written meanwhile: `, 12 s left`. Nothing
/// at the start, when nothing is known, and at the end, when only files may be left to write.
fn time_left(cast: u64, rays: u64, elapsed: Duration) -> String {
    if cast == 0 || cast >= rays {
        return String::new();
    }
    let seconds = elapsed.as_secs_f64() * (rays - cast) as f64 / cast as f64;
    match seconds.ceil() as u64 {
        seconds if seconds < 120 => format!(", {seconds} s left"),
        seconds => format!(", {} min left", seconds.div_ceil(60)),
    }
}

/// The files and frames that a run writes, as far as it has come.
#[derive(Debug)]
pub struct Writing {
    files: u64,
    frames: u64,
    begun: AtomicU64,
    ended: AtomicU64,
    frames_done: AtomicU64,
}

impl Writing {
    /// A run that will write so many files, of so many frames.
    pub fn of(files: u64, frames: u64) -> Self {
        let [begun, ended, frames_done] = [0; 3].map(AtomicU64::new);
        Self { files, frames, begun, ended, frames_done }
    }

    /// Counts a file that is begun.
    pub fn begin(&self) {
        self.begun.fetch_add(1, Ordering::Relaxed);
    }

    /// Writes the next file, which is of no frame.
    pub fn file<T>(&self, write: impl FnOnce() -> T) -> T {
        self.begin();
        let written = write();
        self.ended.fetch_add(1, Ordering::Relaxed);
        written
    }

    /// Counts a frame whose files, so many, are written. Returns how many frames there are.
    pub fn frame(&self, files: u64) -> u64 {
        self.ended.fetch_add(files, Ordering::Relaxed);
        self.frames_done.fetch_add(1, Ordering::Relaxed) + 1
    }

    /// What goes on: `casting`, `writing 3 of 12 files`, or of several frames `3 of 100 frames`. The texts of a run are equally
    /// long, so that the bar stands still.
    fn words(&self) -> String {
        let [begun, ended, frames] =
            [&self.begun, &self.ended, &self.frames_done].map(|count| count.load(Ordering::Relaxed));
        if self.frames > 1 {
            let width = self.frames.to_string().len();
            return format!("{frames:>width$} of {} frames", self.frames);
        }
        let text = |begun: u64| format!("writing {begun} of {} files", self.files);
        let width = if self.files > 0 { text(self.files).len() } else { 0 };
        let words = if begun > ended { text(begun) } else { "casting".to_owned() };
        format!("{words:<width$}")
    }

    /// The frames a second, of several frames: `, 3.2 frames/s`.
    fn rate(&self, elapsed: Duration) -> String {
        match self.frames_done.load(Ordering::Relaxed) {
            done if done > 0 && self.frames > 1 => {
                format!(", {:.1} frames/s", done as f64 / elapsed.as_secs_f64().max(1e-3))
            }
            _ => String::new(),
        }
    }

    /// A line about a long run for those who see no bar: `37 of 1000 frames, 1.2 frames/s, 12 min left`.
    pub fn line(&self, elapsed: Duration) -> String {
        let done = self.frames_done.load(Ordering::Relaxed);
        format!("{}{}{}", self.words(), self.rate(elapsed), time_left(done, self.frames, elapsed))
    }
}

/// Ends the thread of the progress bar, even if the work panics.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Writes a line to stderr. A stderr that is closed is no reason to stop.
fn to_stderr(line: &str) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writing_is_told_file_by_file_and_only_while_it_lasts() {
        let writing = Writing::of(12, 1);
        assert_eq!(writing.words().trim_end(), "casting");
        let told: Vec<_> = (0..10).map(|_| writing.file(|| writing.words())).collect();
        assert_eq!([&told[0], &told[9]], ["writing 1 of 12 files ", "writing 10 of 12 files"]);
        assert_eq!(writing.words(), "casting               ", "casting goes on");
        assert_eq!(Writing::of(0, 0).words(), "casting");
    }

    #[test]
    fn of_several_frames_their_number_is_told() {
        let writing = Writing::of(36, 12);
        assert_eq!(writing.line(Duration::from_secs(2)), " 0 of 12 frames");
        assert_eq!([3, 3, 3].map(|files| writing.frame(files)), [1, 2, 3]);
        assert_eq!(writing.line(Duration::from_secs(2)), " 3 of 12 frames, 1.5 frames/s, 6 s left");
    }

    #[test]
    fn the_time_left_is_told_when_something_is_known() {
        let after_10_s = |cast| time_left(cast, 1000, Duration::from_secs(10));
        assert_eq!([0, 1000, 1001].map(after_10_s), ["", "", ""]);
        assert_eq!([1, 100, 999].map(after_10_s), [", 167 min left", ", 90 s left", ", 1 s left"]);
    }
}
