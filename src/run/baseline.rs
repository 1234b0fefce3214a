//! The folder of a job's baseline: compared with a run, and accepted from one.

use std::fs;
use std::path::{Path, PathBuf};

use crate::check::{
    Baseline, Changes, Failure, MAX_PIXEL_BYTES, Outcome, SensorOutcome, SensorRecord, Settings, Snapshot,
    StoredPixels, judge,
};
use crate::config::Job;
use crate::error::{Error, Problem};
use crate::output::{CHANNEL_NAMES, Destination};
use crate::scene::Scene;
use crate::source::{Place, Unreadable, read_file};

/// The largest `baseline.json` that is read, and written: that of a street has some 10 kB, and one of a hundred thousand
/// beams has 4 MB.
const MAX_BASELINE_BYTES: u64 = 8 << 20;

/// The largest file of a sensor's pixels that is read: what the pixels take if nothing about them can be compressed.
fn most_pixel_bytes(taken: &Snapshot) -> u64 {
    const SLACK: u64 = 1 << 20;
    const BYTES_A_VALUE: u64 = 16;
    let (pixels, channels) = (taken.image.pixels() as u64, taken.image.channels.len() as u64);
    pixels.saturating_mul(BYTES_A_VALUE.saturating_mul(channels)).saturating_add(SLACK)
}

/// Whether a record lists only channels that the run has, or that another run of the tool may have had. Each one that it
/// lists is unpacked.
fn has_known_channels(accepted: &SensorRecord, taken: &Snapshot) -> bool {
    let is_known =
        |name: &String| taken.record.channels.contains_key(name) || CHANNEL_NAMES.contains(&name.as_str());
    accepted.channels.keys().chain(accepted.kept.keys()).all(is_known)
}

/// The folder of a job's baseline: `street.baseline/` for `street.toml`.
pub fn folder_of(job: &Path) -> PathBuf {
    job.with_extension("baseline")
}

/// The command that accepts a job as it is.
fn accept_command(job: &Job) -> String {
    format!("`beamcast check --accept {}` accepts the job as it is now", job.path.display())
}

/// The table of a sensor in the job.
fn written_at(job: &Job, sensor: &str) -> Option<Place> {
    let index = job.sensors.iter().position(|mounted| mounted.name == sensor)?;
    job.places.tables.get(index).cloned()
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
        Err(problem) => return outcome.problems.push(format!("{problem}; {command}").into()),
    };
    let records: Vec<SensorRecord> = taken.iter().map(|taken| taken.record.clone()).collect();
    let changes = Changes::between(&baseline, &Baseline::of(&job.resolved, scene, records));
    outcome.changes = changes.all();
    let default = Settings::default();
    let settings = job.check.as_ref().unwrap_or(&default);
    for taken in taken {
        let name = &taken.record.name;
        let Some(accepted) = baseline.sensors.iter().find(|record| record.name == *name) else {
            outcome.problems.push(Failure {
                sentence: format!("the baseline has no sensor {name}; {command}"),
                place: written_at(job, name),
            });
            continue;
        };
        let pixels = folder.join(Baseline::pixels_name(name));
        let kept = || -> Result<StoredPixels, Problem> {
            let read = read_file(&pixels, most_pixel_bytes(taken))
                .map_err(|problem| format!("{}: {problem}", pixels.display()))?;
            let is_known = has_known_channels(accepted, taken);
            let kept = is_known.then(|| StoredPixels::unpack(&read, accepted)).flatten();
            kept.ok_or_else(|| format!("{} is not what was accepted", pixels.display()).into())
        };
        let judged = judge(taken, accepted, kept, settings, &changes, &command);
        outcome.sensors.push(SensorOutcome { written_at: written_at(job, name), ..judged });
    }
    for accepted in &baseline.sensors {
        if !taken.iter().any(|taken| taken.record.name == accepted.name) {
            let name = &accepted.name;
            outcome
                .problems
                .push(format!("the job has no sensor {name} any more, the baseline does; {command}").into());
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
        let baseline = self.files.last().map_or(0, |(_, content)| content.len() as u64);
        if baseline > MAX_BASELINE_BYTES {
            let problem =
                format!("would have {baseline} bytes, more than the {MAX_BASELINE_BYTES} that are read");
            return Err(Error::output(self.folder.join(Baseline::NAME), problem));
        }
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
