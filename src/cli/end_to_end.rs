//! `beamcast bench --end-to-end`: what the stages of a run cost, and how fast they are together.

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use serde_json::{Value, json};

use super::interrupt::Interrupt;
use super::job::{SceneArgs, load_scene};
use super::json;
use super::pipeline::{Pipeline, timed};
use super::terminal::{Terminal, Writing};
use crate::config::Job;
use crate::error::Error;
use crate::output::{Destination, Manifest, StagedFile, WrittenFile};
use crate::run::record::Line;
use crate::run::{Bytes, Holding, Item, Journal, Plan, Selection, Session, Start, Statistics};
use crate::scan::Frame;
use crate::source::words::counted;

/// The frames to run, and the way in which they are measured.
pub struct Settings<'a> {
    /// The frames.
    pub selection: Selection,
    /// The folder in which a scratch folder is made. If there is none: the folder of the job's outputs, whose disk the job writes to.
    pub scratch: Option<&'a Path>,
    /// The most frames of which the stages are timed each by itself.
    pub samples: usize,
    pub scenes: &'a SceneArgs,
    pub json: bool,
}

/// Writes the frames of a job to a scratch folder, and tells what that took and what each stage takes by itself.
///
/// # Errors
/// The errors of the job, the scene and the folder.
pub fn run(mut job: Job, settings: Settings, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let home = settings.scratch.map_or_else(|| nearest_folder(&job.output.dir), Path::to_path_buf);
    let scratch = scratch_in(&home)?;
    job.output.dir = scratch.path().to_path_buf();
    let plan = Plan::of(&job, &settings.selection, Holding::Files)?;
    let mut journal = Journal::check(&job, &plan, Start::New)?;
    let (loaded, load) = timed(|| load_scene(&mut job, settings.scenes, terminal));
    let scene = loaded?.scene;
    plan.check_scene(&scene)?;
    let (session, build) = timed(|| Session::open(job, &scene));
    let scene_folders = &settings.scenes.allowed_folders;
    let stages = Stages::of(&session, &plan, &settings, &home, &interrupt)?;
    // The rays of the samples are not those of the run.
    interrupt.progress().rays_done.store(0, Ordering::Relaxed);

    journal.begin(&session, &plan, &mut |_, _| ())?;
    let writing = Writing::of(plan.files_of_frames() + 1, plan.frames());
    let (session, plan, interrupt) = (&session, &plan, &interrupt);
    let pipeline = Pipeline { session, plan, scene_folders, interrupt, writing: &writing };
    let mut bytes = 0;
    let work = || {
        let tell = &mut |_: &Item, line: Line| {
            bytes += line.outputs.iter().map(|file| file.bytes).sum::<u64>();
            Ok(())
        };
        pipeline.run(0, &mut journal, tell)?;
        interrupt.uncut(|| journal.finish())
    };
    let progress = interrupt.progress();
    let (of_run, wall) = timed(|| terminal.with_progress_and_files(plan.rays, progress, &writing, work));
    bytes += of_run?.iter().map(|file| file.bytes).sum::<u64>();
    let report = Report { frames: plan.frames(), bytes, load, build, wall, stages };
    match settings.json {
        true => terminal.json(&json::BENCH_END_TO_END.of(report.as_json())),
        false => terminal.data(&report.as_text()),
    }
}

/// A folder that removes itself.
fn scratch_in(home: &Path) -> Result<tempfile::TempDir, Error> {
    let made = tempfile::Builder::new().prefix("beamcast-bench-").tempdir_in(home);
    made.map_err(|e| {
        Error::output(home, format!("can't hold a scratch folder: {e}; --scratch DIR names another"))
    })
}

/// The nearest folder above a path that is there.
fn nearest_folder(path: &Path) -> PathBuf {
    let is_there = |folder: &&Path| folder.is_dir();
    path.ancestors().find(is_there).map_or_else(|| PathBuf::from("."), Path::to_path_buf)
}

/// The times of the stages, each by itself: sums over the frames that were sampled.
#[derive(Default)]
struct Stages {
    frames: u32,
    /// On one thread.
    cast: Duration,
    /// The truth of a frame beside its returns, and its statistics.
    truth: Duration,
    /// The formats, by their names.
    encode: Vec<(&'static str, Duration)>,
    hash: Duration,
    /// Handing the files to the system.
    write: Duration,
    /// Waiting until they are on the disk.
    flush: Duration,
}

impl Stages {
    /// Times the stages of the first frames of a plan on a thread of their own, so that nothing overlaps.
    fn of(
        session: &Session,
        plan: &Plan,
        settings: &Settings,
        home: &Path,
        interrupt: &Interrupt,
    ) -> Result<Self, Error> {
        let scratch = scratch_in(home)?;
        let job = &session.job;
        let names: Vec<String> = plan
            .items(job)
            .take(settings.samples)
            .flat_map(|item| item.outputs)
            .map(|output| output.name)
            .collect();
        let mut destination = Destination::check(scratch.path(), names, false)?;
        destination.prepare(Manifest::NAME)?;
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let alone = alone.map_err(|e| Error::Usage(format!("a thread can't be had: {e}")))?;
        let mut stages = Self::default();
        let mut frame = Frame::default();
        for item in plan.items(job).take(settings.samples) {
            let session = session.of_frame(item.frame, &settings.scenes.allowed_folders)?;
            let mut cast =
                || alone.install(|| timed(|| session.cast_into(&mut frame, &item, interrupt.progress())));
            if stages.frames == 0 {
                cast(); // into memory that is new
            }
            stages.cast += cast().1;
            // A frame is cut off by a signal only.
            interrupt.check()?;
            let files = alone.install(|| stages.encode(&session, &item, &frame, interrupt))?;
            let (staged, time) = timed(|| -> Result<Vec<StagedFile>, Error> {
                files.iter().map(|(file, content)| destination.stage(&file.path, content)).collect()
            });
            let staged = staged?;
            stages.write += time;
            let (flushed, time) = timed(|| staged.iter().try_for_each(StagedFile::sync));
            stages.flush += time;
            flushed?;
            stages.frames += 1;
        }
        Ok(stages)
    }

    /// Times the stages between the cast of a frame and its files, of which it gives those of the frame alone.
    fn encode(
        &mut self,
        session: &Session,
        item: &Item,
        frame: &Frame,
        interrupt: &Interrupt,
    ) -> Result<Vec<(WrittenFile, Vec<u8>)>, Error> {
        let (truth, time) = timed(|| {
            black_box(Statistics::of(frame));
            session.truth(item, frame, interrupt.progress())
        });
        self.truth += time;
        interrupt.check()?;
        let truth = truth.unwrap_or_default();
        let seen = session.frame_with_truth(item, frame, &truth);
        let mut files = Vec::new();
        for output in &item.outputs {
            let (encoded, time) = timed(|| session.encode(output, &seen));
            self.add_format(output.format.name(), time);
            let (content, _) = encoded?;
            let (file, time) = timed(|| WrittenFile::of(&output.name, &content));
            self.hash += time;
            files.push((file, content));
        }
        for format in session.job.output.formats.iter().filter(|format| format.is_of_run()) {
            let (encoded, time) = timed(|| format.encode(&seen));
            encoded.map_err(|e| Error::output(session.job.output.dir.join(format.name()), e))?;
            self.add_format(format.name(), time);
        }
        Ok(files)
    }

    fn add_format(&mut self, name: &'static str, time: Duration) {
        match self.encode.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => *sum += time,
            None => self.encode.push((name, time)),
        }
    }

    /// The stages that processors work on, and those that wait for the system, in seconds a frame.
    fn rows(&self) -> [Vec<(String, f64)>; 2] {
        let mean = |sum: Duration| sum.as_secs_f64() / f64::from(self.frames.max(1));
        let of = |name: &str, sum| (name.to_owned(), mean(sum));
        let encode = self.encode.iter().map(|(name, sum)| (format!("encode {name}"), mean(*sum)));
        let begin = [of("cast", self.cast), of("truth", self.truth)];
        let processors = begin.into_iter().chain(encode).chain([of("hash", self.hash)]).collect();
        [processors, vec![of("write", self.write), of("flush", self.flush)]]
    }
}

/// What was measured.
struct Report {
    frames: u64,
    bytes: u64,
    load: Duration,
    build: Duration,
    /// The time of all frames, from the first ray to the manifest.
    wall: Duration,
    stages: Stages,
}

/// A part of the time in which a stage is busy from which on it is what bounds a run: nothing that waits for it can be faster.
const BOUNDS: f64 = 0.8;

impl Report {
    fn frame_s(&self) -> f64 {
        self.wall.as_secs_f64() / self.frames.max(1) as f64
    }

    /// The seconds a frame that the stages take one after the other on one thread, by processors and by the disk.
    fn work_s(&self) -> [f64; 2] {
        self.stages.rows().map(|rows| rows.iter().map(|(_, s)| s).sum())
    }

    /// The parts of the run's time in which the threads and the disk are busy.
    fn busy(&self) -> [f64; 2] {
        let [processors, disk] = self.work_s().map(|s| s / self.frame_s().max(1e-12));
        [processors / rayon::current_num_threads() as f64, disk]
    }

    /// What bounds the run: the disk, or of the stages that processors work on the one that takes most.
    fn bound(&self) -> String {
        let [processors, disk] = self.busy();
        if disk > BOUNDS && disk > processors {
            return "the disk".to_owned();
        }
        let [rows, _] = self.stages.rows();
        let most = rows.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        most.map_or_else(String::new, |(name, _)| name)
    }

    fn as_json(&self) -> Value {
        let rows = self.stages.rows().into_iter().flatten();
        let stages: Vec<Value> = rows.map(|(stage, s)| json!({ "stage": stage, "frame_s": s })).collect();
        let (wall_s, [processors, disk]) = (self.wall.as_secs_f64(), self.busy());
        json!({
            "load_s": self.load.as_secs_f64(),
            "build_s": self.build.as_secs_f64(),
            "frames": self.frames,
            "bytes": self.bytes,
            "wall_s": wall_s,
            "frames_per_s": self.frames as f64 / wall_s,
            "bytes_per_s": self.bytes as f64 / wall_s,
            "threads": rayon::current_num_threads(),
            "stages": stages,
            "threads_busy": processors,
            "disk_busy": disk,
            "overlap": self.work_s().iter().sum::<f64>() / self.frame_s(),
            "bound_by": self.bound(),
        })
    }

    fn as_text(&self) -> String {
        let (threads, frame_s) = (rayon::current_num_threads(), self.frame_s());
        let mut text = format!(
            "load      {:.3} s\nbuild     {:.3} s\n",
            self.load.as_secs_f64(),
            self.build.as_secs_f64()
        );
        let _ = writeln!(text, "a frame, each stage by itself on one thread:");
        let rows = self.stages.rows().into_iter().flatten();
        for (name, s) in rows {
            let _ = writeln!(text, "  {name:<24}{:9.2} ms", s * 1e3);
        }
        let [processors, disk] = self.busy().map(|part| 100.0 * part);
        let _ = writeln!(
            text,
            "together  {:.2} ms a frame: {} in {:.3} s on {}, {:.1} frames/s, {}/s",
            frame_s * 1e3,
            counted(self.frames, "frame"),
            self.wall.as_secs_f64(),
            counted(threads as u64, "thread"),
            1.0 / frame_s.max(1e-12),
            Bytes((self.bytes as f64 / self.wall.as_secs_f64().max(1e-12)) as u64),
        );
        let overlap = self.work_s().iter().sum::<f64>() / frame_s.max(1e-12);
        let _ = writeln!(
            text,
            "overlap   {overlap:.2} stages at a time; the threads are busy {processors:.0} % of the time, the disk {disk:.0} %"
        );
        let _ = writeln!(text, "bound by  {}", self.bound());
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(cast_ms: u64, exr_ms: u64, flush_ms: u64, wall_ms: u64) -> Report {
        let ms = Duration::from_millis;
        let stages = Stages {
            frames: 10,
            cast: ms(cast_ms * 10),
            encode: vec![("exr", ms(exr_ms * 10))],
            flush: ms(flush_ms * 10),
            ..Stages::default()
        };
        let [load, build] = [ms(1), ms(2)];
        Report { frames: 100, bytes: 1_000_000, load, build, wall: ms(wall_ms * 100), stages }
    }

    #[test]
    fn what_takes_most_bounds_a_run_and_the_disk_where_it_is_always_busy() {
        assert_eq!(report(60, 40, 10, 100).bound(), "cast");
        assert_eq!(report(40, 60, 10, 100).bound(), "encode exr");
        assert_eq!(report(4, 6, 99, 100).bound(), "the disk");
        assert_eq!(report(4, 6, 50, 100).bound(), "encode exr", "half the time the disk waits, too");
        let one = report(60, 40, 10, 100);
        assert_eq!(one.work_s().map(|s| (s * 1e6).round()), [100e3, 10e3]);
        assert_eq!(one.as_json()["frames_per_s"], 10.0);
        let text = one.as_text();
        assert!(text.contains("encode exr") && text.contains("10.0 frames/s, 100.0 kB/s"), "{text}");
    }
}
