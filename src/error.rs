//! The errors of beamcast, sorted by who can mend them. Each kind has its own exit code.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::source::Diagnostic;

/// The cause that an [`Error`] carries: an `io::Error`, an error of encoding or reading a format, or a plain text.
pub type Problem = Box<dyn std::error::Error + Send + Sync>;

/// Every error that stops beamcast.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A job or a sensor file is wrong. The list holds every problem that was found, at least one.
    #[error("{}", .0.iter().map(Diagnostic::to_string).collect::<Vec<_>>().join("\n"))]
    Config(Vec<Diagnostic>),
    /// A scene, or another input that was to be looked at, cannot be read. The list holds every problem that was found in all
    /// the inputs.
    #[error("{}", .0.iter().map(Diagnostic::to_string).collect::<Vec<_>>().join("\n"))]
    Inputs(Vec<Diagnostic>),
    /// The command line asks for something that is impossible.
    #[error("{0}")]
    Usage(String),
    /// A scene cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A file that the user asked to read, compare or show cannot be read.
    #[error("{}: {problem}", path.display())]
    Input {
        /// The file or folder.
        path: PathBuf,
        /// The problem with the file, and what would be right. The message includes it.
        #[source]
        problem: Problem,
    },
    /// An output cannot be written.
    #[error("{}: {problem}", path.display())]
    Output {
        /// The file or folder.
        path: PathBuf,
        /// The problem with the file, and what would be right. The message includes it.
        #[source]
        problem: Problem,
    },
    /// The run succeeded but found a difference or a failed expectation. The details were printed before.
    #[error("{0}")]
    Difference(String),
    /// A signal asked the program to stop. No file is half-written.
    #[error("stopped by signal {signal}")]
    Interrupted {
        /// The signal's number: 1 for SIGHUP, 2 for SIGINT, 15 for SIGTERM.
        signal: i32,
    },
}

impl Error {
    /// An [`Error::Input`] about `path`.
    pub fn input(path: impl AsRef<Path>, problem: impl Into<Problem>) -> Self {
        Self::Input { path: path.as_ref().to_path_buf(), problem: problem.into() }
    }

    /// An [`Error::Output`] about `path`.
    pub fn output(path: impl AsRef<Path>, problem: impl Into<Problem>) -> Self {
        Self::Output { path: path.as_ref().to_path_buf(), problem: problem.into() }
    }

    /// The exit code of the process: 1 for a difference, 2 for usage or configuration, 3 for a scene or an input, 4 for an
    /// output, 128 + the signal's number for an interrupt.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Difference(_) => 1,
            Self::Config(_) | Self::Usage(_) => 2,
            Self::Inputs(_) | Self::Scene(_) | Self::Input { .. } => 3,
            Self::Output { .. } => 4,
            Self::Interrupted { signal } => 128 + *signal as u8,
        }
    }
}

/// A scene that cannot be used: the file, the element in it, the problem, and what would be right.
#[derive(Debug, thiserror::Error)]
pub struct SceneError {
    /// The path of the scene's file as the user wrote it.
    pub path: PathBuf,
    /// The element, such as `mesh 3 "wall", primitive 0, accessor 7`. It is empty if the problem concerns the file as a
    /// whole.
    pub element: String,
    /// The problem with the element.
    pub problem: String,
    /// A hint that says what would be right.
    pub help: Option<String>,
    /// The error of the operating system that caused the problem, if there is one.
    pub source: Option<std::io::Error>,
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.path.display())?;
        if !self.element.is_empty() {
            write!(f, "{}: ", self.element)?;
        }
        f.write_str(&self.problem)?;
        if let Some(help) = &self.help {
            write!(f, " ({help})")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error as _;
    use std::io;

    use super::*;

    #[test]
    fn errors_about_files_keep_what_caused_them() {
        let error = Error::output("a.exr", io::Error::from(io::ErrorKind::StorageFull));
        assert_eq!(error.to_string(), format!("a.exr: {}", io::Error::from(io::ErrorKind::StorageFull)));
        let cause = error.source().and_then(|cause| cause.downcast_ref::<io::Error>());
        assert_eq!(cause.map(io::Error::kind), Some(io::ErrorKind::StorageFull));
        assert_eq!(Error::input("a.exr", "is not a file").to_string(), "a.exr: is not a file");
    }
}
