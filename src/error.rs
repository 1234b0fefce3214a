//! What can go wrong, sorted by whose it is to mend; each kind has its exit code.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::source::Diagnostic;

/// The error that an [`Error`] passes on: an `io::Error`, what a format has no room for, or words alone.
pub type Problem = Box<dyn std::error::Error + Send + Sync>;

/// Everything that stops beamcast.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A job or sensor file is wrong: every problem found, not only the first. At least one.
    #[error("{}", .0.iter().map(Diagnostic::to_string).collect::<Vec<_>>().join("\n"))]
    Config(Vec<Diagnostic>),
    /// The command line asks for something that can't be.
    #[error("{0}")]
    Usage(String),
    /// A scene can't be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A file that was given to be looked at can't be read.
    #[error("{}: {problem}", path.display())]
    Input {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it, and what would be right. The message includes it.
        #[source]
        problem: Problem,
    },
    /// An output can't be written.
    #[error("{}: {problem}", path.display())]
    Output {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it, and what would be right. The message includes it.
        #[source]
        problem: Problem,
    },
    /// Everything ran, and what was found is not as it should be. What it is has been told.
    #[error("{0}")]
    Difference(String),
    /// A signal asked to stop. Nothing is half-written.
    #[error("stopped by signal {signal}")]
    Interrupted {
        /// The signal's number: 2 for SIGINT, 15 for SIGTERM.
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

    /// The process's exit code: 1 a difference, 2 usage or configuration, 3 scene or input, 4 output, 128 + the signal's number.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Difference(_) => 1,
            Self::Config(_) | Self::Usage(_) => 2,
            Self::Scene(_) | Self::Input { .. } => 3,
            Self::Output { .. } => 4,
            Self::Interrupted { signal } => 128 + *signal as u8,
        }
    }
}

/// A scene that can't be used: the file, the element in it, what is wrong and what would be right.
#[derive(Debug, thiserror::Error)]
pub struct SceneError {
    /// The scene's file as the user named it.
    pub path: PathBuf,
    /// The element, such as `mesh 3 "wall", primitive 0, accessor 7`. Empty for the file as a whole.
    pub element: String,
    /// What is wrong with it.
    pub problem: String,
    /// What would be right.
    pub help: Option<String>,
    /// The error of the operating system that is behind it, if there is one.
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
