//! The folder that a run writes, and the record of the files that are in it.

use std::path::PathBuf;

use super::plan::{Output, Plan};
use super::session::Session;
use crate::config::{InputFile, Job};
use crate::error::Error;
use crate::output::{Destination, Manifest, WrittenFile};
use crate::scene::SourceFile;

/// The record of a run: the files that were written, in order. The manifest is made from it.
#[derive(Clone, Debug)]
pub struct Journal {
    destination: Destination,
    written: Vec<WrittenFile>,
}

impl Journal {
    /// The journal of a run that is about to begin. Nothing is written yet.
    ///
    /// # Errors
    /// [`Error::Output`] about the first folder or file that is in the way. Files that are there already are in the way
    /// unless `overwrite` is given.
    pub fn check(job: &Job, plan: &Plan, overwrite: bool) -> Result<Self, Error> {
        let destination = Destination::check(&job.output.dir, plan.output_names(), overwrite)?;
        Ok(Self { destination, written: Vec::new() })
    }

    /// The files that the run will write, in order.
    pub fn paths(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.destination.paths()
    }

    /// Makes the folders, and removes the manifest of an earlier run.
    ///
    /// # Errors
    /// [`Error::Output`] about the folder or the manifest.
    pub fn begin(&self) -> Result<(), Error> {
        self.destination.prepare(Manifest::NAME)
    }

    /// Writes a file, whole or not at all, and records it.
    ///
    /// # Errors
    /// [`Error::Output`] about the file.
    pub fn write(&mut self, output: &Output, content: &[u8]) -> Result<(), Error> {
        self.written.push(self.destination.write(&output.name, content)?);
        Ok(())
    }

    /// The files that were written so far.
    pub fn written(&self) -> &[WrittenFile] {
        &self.written
    }

    /// Writes the manifest. A folder that has a manifest is complete.
    ///
    /// # Errors
    /// [`Error::Output`] about the manifest.
    pub fn finish(&self, session: &Session) -> Result<(), Error> {
        let job = &session.job;
        let read = |file: &InputFile| SourceFile {
            name: file.name.clone(),
            bytes: file.bytes,
            blake3: file.blake3.clone(),
        };
        let inputs: Vec<SourceFile> = job.inputs.iter().map(read).collect();
        let manifest = Manifest {
            job: &job.resolved,
            seed: job.seed,
            inputs: &inputs,
            scene: session.scene(),
            outputs: &self.written,
        };
        self.destination.write(Manifest::NAME, &manifest.encode())?;
        Ok(())
    }
}
