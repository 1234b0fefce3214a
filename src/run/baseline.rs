//! The folder of a job's baseline: compared with a run, and accepted from one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::check::{
    Baseline, Changes, Failure, MAX_PIXEL_BYTES, Outcome, SensorOutcome, SensorRecord, Settings, Snapshot,
    StoredPixels, Tolerance, judge,
};
use crate::config::{Job, MountedSensor};
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

/// The baseline of a job, with which its frames are compared one after the other.
pub struct Comparison {
    folder: PathBuf,
    command: String,
    baseline: Baseline,
    changes: Changes,
    settings: Settings,
    /// The frames that were compared, each with the numbers of its returns.
    compared: BTreeSet<(String, u64, usize)>,
}

impl Comparison {
    /// Reads the baseline of a job, and adds to the outcome what changed since it was accepted. `None` if it can't be read: the
    /// outcome then says so.
    pub fn open(job: &Job, scene: &Scene, outcome: &mut Outcome) -> Option<Self> {
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
            Err(problem) => {
                outcome.problems.push(format!("{problem}; {command}").into());
                return None;
            }
        };
        let of_sensor = |mounted: &MountedSensor| SensorRecord::of_sensor(&mounted.name, &mounted.sensor);
        let records = job.sensors.iter().map(of_sensor).collect();
        let changes = Changes::between(&baseline, &Baseline::of(&job.resolved, scene, records));
        outcome.changes = changes.all();
        let settings = job.check.clone().unwrap_or_default();
        Some(Self { folder, command, baseline, changes, settings, compared: BTreeSet::new() })
    }

    /// Compares what was taken of a frame of the job, and adds the result to the outcome. The pixels of the baseline stay with it
    /// only if a page shows them.
    pub fn compare(&mut self, job: &Job, taken: &Snapshot, page: bool, outcome: &mut Outcome) {
        let SensorRecord { name, frame, number, .. } = &taken.record;
        self.compared.insert((name.clone(), *frame, *number));
        let of_frame: Vec<&SensorRecord> =
            self.baseline.sensors.iter().filter(|r| r.name == *name && r.frame == *frame).collect();
        let Some(&accepted) = of_frame.iter().find(|record| record.number == *number) else {
            if *number > 0 && of_frame.is_empty() {
                return; // the first returns told of it
            }
            let has_sensor = self.baseline.sensors.iter().any(|record| record.name == *name);
            let what = match (number, has_sensor) {
                (0, false) => format!("sensor {name}"),
                (0, true) => format!("frame {frame} of sensor {name}"),
                _ => format!("returns of sensor {name} beyond the first of a pixel"),
            };
            let sentence = format!("the baseline has no {what}; {}", self.command);
            // A sensor that is missing is told once.
            if !outcome.problems.iter().any(|problem| problem.sentence == sentence) {
                outcome.problems.push(Failure { sentence, place: written_at(job, name) });
            }
            return;
        };
        let pixels = self.folder.join(Baseline::pixels_name(accepted));
        let kept = || -> Result<StoredPixels, Problem> {
            let read = read_file(&pixels, most_pixel_bytes(taken))
                .map_err(|problem| format!("{}: {problem}", pixels.display()))?;
            let is_known = has_known_channels(accepted, taken);
            let kept = is_known.then(|| StoredPixels::unpack(&read, accepted)).flatten();
            kept.ok_or_else(|| format!("{} is not what was accepted", pixels.display()).into())
        };
        let judged = judge(taken, accepted, kept, &self.settings, &self.changes, &self.command);
        let mut judged = SensorOutcome { written_at: written_at(job, name), ..judged };
        // A page shows the first returns.
        if !page || *number > 0 {
            judged.baseline = None;
        }
        // The sentences are written, and the numbers of the pixels are needed no more.
        judged.channels.iter_mut().for_each(|channel| channel.pixels = Vec::new());
        outcome.sensors.push(judged);
    }

    /// Adds to the outcome what the baseline has and the job has not.
    pub fn finish(self, job: &Job, outcome: &mut Outcome) {
        let command = &self.command;
        let mut told = BTreeSet::new();
        for SensorRecord { name, frame, number, .. } in &self.baseline.sensors {
            if self.compared.contains(&(name.clone(), *frame, *number)) {
                continue;
            }
            if *number > 0 {
                // Where the first returns are compared, the sensor reports fewer than it did.
                if self.compared.contains(&(name.clone(), *frame, 0)) && told.insert((name, true)) {
                    let sentence = format!(
                        "the baseline has more returns of a pixel of sensor {name} than the sensor reports; {command}"
                    );
                    outcome.problems.push(Failure { sentence, place: written_at(job, name) });
                }
                continue;
            }
            let is_sensor = job.sensors.iter().any(|sensor| sensor.name == *name);
            if !is_sensor && told.insert((name, false)) {
                let sentence = format!("the job has no sensor {name} any more, the baseline does; {command}");
                outcome.problems.push(sentence.into());
            } else if is_sensor {
                let sentence = format!(
                    "frame {frame} of sensor {name} is in the baseline, and the job does not compare it any more; {command}"
                );
                outcome.problems.push(Failure { sentence, place: written_at(job, name) });
            }
        }
    }
}

/// The files that make a run the baseline of its job.
#[derive(Clone, Debug)]
pub struct Acceptance {
    folder: PathBuf,
    tolerances: BTreeMap<String, Tolerance>,
    records: Vec<SensorRecord>,
    /// The names of the files in the folder, with their contents. The baseline itself is last, so that the folder is
    /// complete if it is there.
    files: Vec<(String, Vec<u8>)>,
}

impl Acceptance {
    /// The files of a run of which nothing is taken yet.
    pub fn of(job: &Job) -> Self {
        let tolerances =
            job.check.as_ref().map_or_else(BTreeMap::new, |settings| settings.tolerances.clone());
        Self { folder: folder_of(&job.path), tolerances, files: Vec::new(), records: Vec::new() }
    }

    /// Packs what was taken of a frame.
    pub fn add(&mut self, mut taken: Snapshot) {
        let pixels = taken.pack(&self.tolerances);
        self.files.push((Baseline::pixels_name(&taken.record), pixels));
        self.records.push(taken.record);
    }

    /// Completes the baseline.
    pub fn finish(&mut self, job: &Job, scene: &Scene) {
        let baseline = Baseline::of(&job.resolved, scene, std::mem::take(&mut self.records));
        self.files.push((Baseline::NAME.to_owned(), baseline.encode()));
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
        let names: Vec<String> = self.files.iter().map(|(name, _)| name.clone()).collect();
        let mut destination = Destination::check(&self.folder, names, true)?;
        destination.prepare(Baseline::NAME)?;
        for (name, content) in &self.files {
            destination.write(name, content)?;
        }
        destination.flush();
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
