//! The folder of a job's baseline: compared with a run, and accepted from one.

use std::fs;
use std::path::{Path, PathBuf};

use crate::check::{
    Baseline, Changes, MAX_PIXEL_BYTES, Outcome, SensorRecord, Settings, Snapshot, StoredPixels, judge,
};
use crate::config::Job;
use crate::error::{Error, Problem};
use crate::output::Destination;
use crate::scene::Scene;
use crate::source::{Unreadable, read_file};

/// The largest file of a baseline that is read.
const MAX_BASELINE_BYTES: u64 = 8 << 30;

/// The folder of a job's baseline: `street.baseline/` for `street.toml`.
pub fn folder_of(job: &Path) -> PathBuf {
    job.with_extension("baseline")
}

/// The command that accepts a job as it is.
fn accept_command(job: &Job) -> String {
    format!("`beamcast check --accept {}` accepts the job as it is now", job.path.display())
}

/// Compares what was taken of a job's frames with the job's baseline, and adds the result to the outcome.
pub fn compare(job: &Job, scene: &Scene, taken: &[Snapshot], outcome: &mut Outcome) {
    let folder = folder_of(&job.path);
    let command = accept_command(job);
    let path = folder.join(Baseline::NAME);
    let baseline = match read_file(&path, MAX_BASELINE_BYTES) {
        Ok(bytes) => Baseline::decode(&bytes).map_err(|problem| format!("{} {problem}", path.display())),
        Err(Unreadable::Missing) => Err(format!("there is no {}", path.display())),
        Err(problem) => Err(format!("{}: {problem}", path.display())),
    };
    let baseline = match baseline {
        Ok(baseline) => baseline,
        Err(problem) => return outcome.problems.push(format!("{problem}; {command}")),
    };
    let records: Vec<SensorRecord> = taken.iter().map(|taken| taken.record.clone()).collect();
    let changes = Changes::between(&baseline, &Baseline::of(&job.resolved, scene, records));
    outcome.changes = changes.all();
    let default = Settings::default();
    let settings = job.check.as_ref().unwrap_or(&default);
    for taken in taken {
        let name = &taken.record.name;
        let Some(accepted) = baseline.sensors.iter().find(|record| record.name == *name) else {
            outcome.problems.push(format!("the baseline has no sensor {name}; {command}"));
            continue;
        };
        let pixels = folder.join(Baseline::pixels_name(name));
        let kept = || -> Result<StoredPixels, Problem> {
            let read = read_file(&pixels, MAX_BASELINE_BYTES)
                .map_err(|problem| format!("{}: {problem}", pixels.display()))?;
            let kept = StoredPixels::unpack(&read, accepted);
            kept.ok_or_else(|| format!("{} is not what was accepted", pixels.display()).into())
        };
        outcome.sensors.push(judge(taken, accepted, kept, settings, &changes, &command));
    }
    for accepted in &baseline.sensors {
        if !taken.iter().any(|taken| taken.record.name == accepted.name) {
            let name = &accepted.name;
            outcome
                .problems
                .push(format!("the job has no sensor {name} any more, the baseline does; {command}"));
        }
    }
}

/// The files that make a run the baseline of its job.
#[derive(Clone, Debug)]
pub struct Acceptance {
    folder: PathBuf,
    /// The names of the files in the folder, with their contents. The baseline itself is last, so that the folder is
    /// complete if it is there.
    files: Vec<(String, Vec<u8>)>,
}

impl Acceptance {
    /// Packs what was taken of a job's frames.
    pub fn of(job: &Job, scene: &Scene, taken: &mut [Snapshot]) -> Self {
        let no_tolerances = Default::default();
        let tolerances = job.check.as_ref().map_or(&no_tolerances, |settings| &settings.tolerances);
        let mut files: Vec<(String, Vec<u8>)> = taken
            .iter_mut()
            .map(|taken| (Baseline::pixels_name(&taken.record.name), taken.pack(tolerances)))
            .collect();
        let records = taken.iter().map(|taken| taken.record.clone()).collect();
        files.push((Baseline::NAME.to_owned(), Baseline::of(&job.resolved, scene, records).encode()));
        Self { folder: folder_of(&job.path), files }
    }

    /// Sentences about files that are large for a repository.
    pub fn warnings(&self) -> Vec<String> {
        let of_pixels = self.files.iter().filter(|(name, _)| name != Baseline::NAME);
        let large = of_pixels.filter(|(_, content)| content.len() > MAX_PIXEL_BYTES);
        let warning = |(name, content): &(String, Vec<u8>)| {
            format!(
                "{} takes {} bytes: wider tolerances in `[check]` would take less",
                self.folder.join(name).display(),
                content.len()
            )
        };
        large.map(warning).collect()
    }

    /// Whether the folder holds just these files already.
    pub fn is_there(&self) -> bool {
        let is_same = |(name, content): &(String, Vec<u8>)| {
            let old = read_file(&self.folder.join(name), content.len() as u64);
            old.is_ok_and(|old| old == *content)
        };
        self.files.iter().all(is_same)
    }

    /// Writes the files, and removes the pixels of sensors that the job no longer has.
    ///
    /// # Errors
    /// [`Error::Output`] about a file that can't be written.
    pub fn write(&self) -> Result<(), Error> {
        let names = self.files.iter().map(|(name, _)| name.clone()).collect();
        let mut destination = Destination::check(&self.folder, names, true)?;
        destination.prepare(Baseline::NAME)?;
        for (name, content) in &self.files {
            destination.write(name, content)?;
        }
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.ends_with(".pixels") && !self.files.iter().any(|(file, _)| *file == name) {
                // A file that can't be removed does no harm.
                let _ = fs::remove_file(entry.path());
            }
        }
        Ok(())
    }
}
