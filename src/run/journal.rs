//! The folder that a run writes, and the record of the files that are in it.

use std::path::PathBuf;

use super::plan::{Output, Plan};
use super::session::Session;
use crate::config::{InputFile, Job};
use crate::error::Error;
use crate::output::recorded::Folder;
use crate::output::{Destination, Format, GrowingFile, Kind, Manifest, SensorFrame, Stream, WrittenFile};
use crate::scene::SourceFile;

/// The record of a run: the files that were written, in order. The manifest is made from it.
pub struct Journal {
    destination: Destination,
    /// The files that the manifest of an earlier run lists.
    old: Vec<String>,
    written: Vec<WrittenFile>,
    streams: Vec<(Box<dyn Stream>, GrowingFile)>,
}

impl Journal {
    /// The journal of a run that is about to begin. Nothing is written yet.
    ///
    /// # Errors
    /// [`Error::Output`] about the first folder or file that is in the way. Files that are there already are in the way
    /// unless `overwrite` is given.
    pub fn check(job: &Job, plan: &Plan, overwrite: bool) -> Result<Self, Error> {
        let destination = Destination::check(&job.output.dir, plan.output_names(), overwrite)?;
        // A manifest that can't be read lists nothing that could be removed.
        let old = match Folder::open(&job.output.dir) {
            Ok(folder) if overwrite => {
                folder.outputs().filter(|name| is_of_a_run(name)).map(str::to_owned).collect()
            }
            _ => Vec::new(),
        };
        Ok(Self { destination, old, written: Vec::new(), streams: Vec::new() })
    }

    /// The files that the run will write, in order.
    pub fn paths(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.destination.paths()
    }

    /// The files of an earlier run that the run will remove, because its own manifest will not list them.
    pub fn paths_to_remove(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.destination.old_paths(&self.old)
    }

    /// Makes the folders, removes the manifest of an earlier run, then the files that it lists and this run does not write, and
    /// opens the files into which all frames go. The manifest goes first, so that there is at no time a manifest that lists a
    /// file that is gone.
    ///
    /// # Errors
    /// [`Error::Output`] about the folder or the file.
    pub fn begin(&mut self, plan: &Plan) -> Result<(), Error> {
        self.destination.prepare(Manifest::NAME)?;
        self.destination.remove_old(&self.old)?;
        for Output { format, name } in &plan.streams {
            if let Kind::Stream(stream) = format.spec.kind {
                self.streams.push((stream(), self.destination.open(name)?));
            }
        }
        Ok(())
    }

    /// Adds a frame to the files into which all frames go.
    ///
    /// # Errors
    /// [`Error::Output`] about the file, such as when the frame does not fit its format.
    pub fn add(&mut self, frame: &SensorFrame) -> Result<(), Error> {
        for (stream, file) in &mut self.streams {
            stream.add(frame, file).map_err(|e| Error::output(file.path(), e))?;
        }
        Ok(())
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

    /// Finishes the files into which all frames went, and writes the manifest. A folder that has a manifest is complete.
    ///
    /// # Errors
    /// [`Error::Output`] about the file.
    pub fn finish(&mut self, session: &Session) -> Result<(), Error> {
        for (mut stream, mut file) in self.streams.drain(..) {
            stream.finish(&mut file).map_err(|e| Error::output(file.path(), e))?;
            self.written.push(file.finish()?);
        }
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
            labels: &job.labels,
            scene: session.scene(),
            outputs: &self.written,
        };
        self.destination.write(Manifest::NAME, &manifest.encode())?;
        Ok(())
    }
}

/// Whether a path is one that a run gives an output: `SENSOR/000000.exr`, or `run.exr` for a file of all frames. A manifest is a
/// file that anybody may have written, and `--overwrite` removes no other file of its folder because of it.
fn is_of_a_run(name: &str) -> bool {
    let stem_before = |format: Format| name.strip_suffix(format.ending())?.strip_suffix('.');
    let is_frame = |(sensor, frame): (&str, &str)| {
        !sensor.contains('/') && frame.len() >= 6 && frame.bytes().all(|b| b.is_ascii_digit())
    };
    let is_output = |stem: &str| stem == "run" || stem.split_once('/').is_some_and(is_frame);
    Format::all().filter_map(stem_before).any(is_output)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_outputs_are_outputs_of_a_run() {
        for name in ["top/000000.exr", "front_left/1234567.ply", "run.png", "top/000000.depth16.png"] {
            assert!(is_of_a_run(name), "{name}");
        }
        for name in [
            "src/main.rs",
            "a.exr",
            "a/b/000000.exr",
            "top/notes.exr",
            "top/00000.exr",
            "top/000000",
            "top/000000.mine.png",
            "000000.exr",
        ] {
            assert!(!is_of_a_run(name), "{name}");
        }
    }
}
