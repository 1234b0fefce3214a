//! The pipeline of a run: while a frame is cast, the frames before it are encoded, and the files of those before them are written.
//!
//! The thread that calls casts the frames one after the other. It is none of the pool's threads, so it waits while these work. A
//! frame that is cast is encoded by the pool, in all formats at the same time. A thread of its own writes the files, so that
//! no thread of the pool waits for the disk, and records the frames in their order. While the disk flushes the files of one
//! frame, more frames may come: their files are flushed together.
//!
//! Two frames are in memory, and [`frames_waiting`] bounds the files that are not on the disk yet, so that a slow disk holds the
//! casting up. The files are the same with any number of threads.

use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde_json::Map;

use super::interrupt::Interrupt;
use super::terminal::Writing;
use crate::config::Job;
use crate::error::Error;
use crate::output::{FileMemory, SensorFrame, StagedFile, WrittenFile};
use crate::run::journal::Streams;
use crate::run::memory::{FRAMES_IN_FLIGHT, frames_waiting};
use crate::run::record::{Line, Loss};
use crate::run::{Item, Journal, Output, Plan, Session};
use crate::scan::Frame;

/// What the frames of a run are cast with and written by.
pub struct Pipeline<'r> {
    pub session: &'r Session,
    pub plan: &'r Plan,
    /// The folders besides the scene's own in which files of drawn scenes may lie.
    pub scene_folders: &'r [PathBuf],
    pub interrupt: &'r Interrupt,
    pub writing: &'r Writing,
}

/// The times that the stages of a run took. They overlap.
#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    /// Casting, by the clock of the thread that waits for it.
    pub cast: Duration,
    /// Encoding, added up over the frames.
    pub encode: Duration,
    /// Writing files, flushing them, and recording frames.
    pub write: Duration,
}

/// What is called with each frame whose files are on the disk, in the order of the plan.
pub type Tell<'t> = dyn FnMut(&Item, Line) -> Result<(), Error> + Send + 't;

/// A frame that is encoded.
struct Encoded {
    item: Item,
    /// The contents of the files of `line`.
    contents: Vec<Vec<u8>>,
    line: Line,
}

/// The end of encoding a frame: its files, an error, or a panic.
type Outcome = thread::Result<Result<Encoded, Error>>;

impl Pipeline<'_> {
    /// Casts the frames of the plan after the first `skipped`, writes their files and records them in the journal.
    ///
    /// # Errors
    /// The first error in the order of the frames, which ends the run: the frames before it are recorded.
    pub fn run(&self, skipped: u64, journal: &mut Journal, tell: &mut Tell) -> Result<Times, Error> {
        let (encoding, streams) = (Mutex::default(), Mutex::new(std::mem::take(&mut journal.streams)));
        // The writer gives back the memory of files, into which later ones are encoded.
        let memory = &FileMemory::default();
        let job = &self.session.job;
        let files = FRAMES_IN_FLIGHT + frames_waiting(&job.sensors, &job.output.formats);
        let (give_room, room) = sync_channel(files);
        for _ in 0..files {
            let _ = give_room.send(());
        }
        let (send, encoded) = channel();
        let recorded = &mut *journal;
        // What the writer owns ends with it, so that nobody waits for room in vain.
        let write = move || self.write_all(encoded, give_room, memory, recorded, tell);
        let (cast, written) = thread::scope(|threads| {
            let writer = thread::Builder::new().name("writer".into()).spawn_scoped(threads, write);
            let writer = writer.map_err(|e| Error::Usage(format!("a thread can't be had: {e}")))?;
            let encode = |session: &Session, item: Item, frame: &Frame, send: &Sender<Outcome>| {
                let work = AssertUnwindSafe(|| self.encode(session, item, frame, memory, &streams));
                let (encoded, time) = timed(|| catch_unwind(work));
                *encoding.lock().unwrap_or_else(PoisonError::into_inner) += time;
                // Nobody receives it after an error.
                let _ = send.send(encoded);
            };
            // The sender ends with the tasks that hold a clone of it, and then the writer ends.
            let encode = &encode;
            let cast = rayon::in_place_scope(move |pool| {
                self.cast_all(skipped, &room, |session, item, frame, give_back| {
                    let send = send.clone();
                    pool.spawn(move |_| {
                        encode(&session, item, &frame, &send);
                        let _ = give_back.send(frame);
                    });
                })
            });
            let written = writer.join().unwrap_or_else(|panic| resume_unwind(panic));
            Ok::<_, Error>((cast, written))
        })?;
        journal.streams = streams.into_inner().unwrap_or_else(PoisonError::into_inner);
        let write = written?;
        self.interrupt.check()?;
        let encode = encoding.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Times { cast: cast?, encode, write })
    }

    /// Casts the frames, each into memory that was given back, as soon as there is room for its files. `encode` is given each with its
    /// session and its item, and gives the memory back. Returns the time of casting.
    fn cast_all<'s>(
        &'s self,
        skipped: u64,
        room: &Receiver<()>,
        encode: impl Fn(Cow<'s, Session>, Item, Frame, SyncSender<Frame>),
    ) -> Result<Duration, Error> {
        let (give_back, free) = sync_channel(FRAMES_IN_FLIGHT);
        for _ in 1..FRAMES_IN_FLIGHT {
            let _ = give_back.send(Frame::default());
        }
        let (mut frame, mut casting) = (Frame::default(), Duration::ZERO);
        let skipped = usize::try_from(skipped).unwrap_or(usize::MAX);
        for item in self.plan.items(&self.session.job).skip(skipped) {
            if room.recv().is_err() {
                break;
            }
            let session = self.session.of_frame(item.frame, self.scene_folders)?;
            let (is_whole, cast) = timed(|| session.cast_into(&mut frame, &item, self.interrupt.progress()));
            casting += cast;
            if !is_whole {
                break;
            }
            // The memory is free when the frame before this one is encoded, so frames are encoded in their order.
            let Ok(next) = free.recv() else { break };
            encode(session, item, std::mem::replace(&mut frame, next), give_back.clone());
        }
        Ok(casting)
    }

    /// Encodes a frame in all its formats at the same time, and adds it to the files of the run.
    fn encode(
        &self,
        session: &Session,
        item: Item,
        frame: &Frame,
        memory: &FileMemory,
        streams: &Mutex<Streams>,
    ) -> Result<Encoded, Error> {
        let Self { interrupt, writing, .. } = self;
        let Some(truth) = session.truth(&item, frame, interrupt.progress()) else {
            return Err(interrupt.check().err().unwrap_or(Error::Interrupted { signal: 0 }));
        };
        let seen =
            SensorFrame { file_memory: Some(memory), ..session.frame_with_truth(&item, frame, &truth) };
        let encode = |output: &Output| -> Result<(WrittenFile, Vec<u8>, u64), Error> {
            interrupt.check()?;
            writing.begin();
            let (content, lost) = session.encode(output, &seen)?;
            Ok((WrittenFile::of(&output.name, &content), content, lost))
        };
        // The first error in the order of the formats counts, whichever came first.
        let files: Vec<Result<_, Error>> = item.outputs.par_iter().map(encode).collect();
        let (mut outputs, mut contents, mut lost) = (Vec::new(), Vec::new(), Vec::new());
        for file in files {
            let (output, content, values) = file?;
            if values > 0 {
                lost.push(Loss { path: output.path.clone(), values });
            }
            outputs.push(output);
            contents.push(content);
        }
        streams.lock().unwrap_or_else(PoisonError::into_inner).add(&seen)?;
        let (rows, drawn) = (truth.rows.clone(), drawn_by(&session.job));
        let line = Line { lost, rows, drawn, ..Line::of(&item, &seen, outputs) };
        Ok(Encoded { item, contents, line })
    }

    /// Writes the files of frames as they come, records the frames, and makes room for as many. Returns the time of that.
    fn write_all(
        &self,
        encoded: Receiver<Outcome>,
        give_room: SyncSender<()>,
        memory: &FileMemory,
        journal: &mut Journal,
        tell: &mut Tell,
    ) -> Result<Duration, Error> {
        let mut writing = Duration::ZERO;
        while let Ok(first) = encoded.recv() {
            // A panic ends the run: the thread that casts would wait for ever for room for the frame's files.
            let frames = std::iter::once(first).chain(encoded.try_iter());
            let batch: Vec<_> =
                frames.map(|frame| frame.unwrap_or_else(|panic| resume_unwind(panic))).collect();
            let count = batch.len();
            let (written, time) = timed(|| self.write_batch(batch, memory, journal, tell));
            writing += time;
            written?;
            for _ in 0..count {
                let _ = give_room.send(());
            }
        }
        Ok(writing)
    }

    /// Writes the files of frames, flushes all of them to the disk, and then gives them their names and records the frames. The
    /// frames before one that fails are recorded.
    fn write_batch(
        &self,
        batch: Vec<Result<Encoded, Error>>,
        memory: &FileMemory,
        journal: &mut Journal,
        tell: &mut Tell,
    ) -> Result<(), Error> {
        self.interrupt.check()?;
        let mut failure = None;
        let recorded = self.interrupt.uncut(|| {
            let mut frames = Vec::new();
            for encoded in batch {
                let staged = encoded.and_then(|encoded| Staged::of(encoded, journal, memory));
                match staged {
                    Ok(staged) => frames.push(staged),
                    Err(e) => {
                        failure = Some(e);
                        break;
                    }
                }
            }
            let sync = |frame: &Staged| frame.files.iter().try_for_each(StagedFile::sync);
            let unflushed =
                frames.iter().position(|frame| sync(frame).map_err(|e| failure = Some(e)).is_err());
            frames.truncate(unflushed.unwrap_or(frames.len()));
            let mut recorded = Vec::new();
            for Staged { item, files, line } in frames {
                files.into_iter().try_for_each(StagedFile::commit)?;
                journal.record(&line)?;
                recorded.push((item, line));
            }
            Ok::<_, Error>(recorded)
        })?;
        for (item, line) in recorded {
            self.writing.frame(line.outputs.len() as u64);
            tell(&item, line)?;
        }
        failure.map_or(Ok(()), Err)
    }
}

/// A frame whose files are written, but not flushed.
struct Staged {
    item: Item,
    files: Vec<StagedFile>,
    line: Line,
}

impl Staged {
    /// Writes the files of a frame, and gives their memory back.
    fn of(encoded: Encoded, journal: &Journal, memory: &FileMemory) -> Result<Self, Error> {
        let Encoded { item, contents, line } = encoded;
        let write = |(output, content): (&Output, Vec<u8>)| {
            let file = journal.destination().stage(&output.name, &content);
            memory.give_back(output.format.name(), content);
            file
        };
        let files = item.outputs.iter().zip(contents).map(write).collect::<Result<_, _>>()?;
        Ok(Self { item, files, line })
    }
}

/// What a job draws for its frame.
fn drawn_by(job: &Job) -> Map<String, serde_json::Value> {
    if job.is_drawn_by_frame() { job.drawn.clone() } else { Map::new() }
}

/// Does work and tells how long it took.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let done = work();
    (done, start.elapsed())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config::load_job;
    use crate::output::{EncodeError, Format, FormatSpec, Kind};
    use crate::run::{Holding, Selection, Start, load_scene};

    /// The frame that the formats below can't encode.
    const BAD: u64 = 5;

    const FAILS: FormatSpec = FormatSpec {
        name: "fails",
        about: "fails at a frame",
        ending: "fails",
        kind: Kind::File(|seen, _| match seen.capture.frame {
            BAD => Err(EncodeError::new("this frame does not fit".to_owned())),
            frame => Ok(frame.to_string().into_bytes()),
        }),
        ..FormatSpec::PLAIN
    };

    const PANICS: FormatSpec = FormatSpec {
        name: "panics",
        about: "panics at a frame",
        ending: "panics",
        kind: Kind::File(|seen, _| match seen.capture.frame {
            BAD => panic!("this frame is a trap"),
            frame => Ok(frame.to_string().into_bytes()),
        }),
        ..FormatSpec::PLAIN
    };

    /// Runs 40 frames of a small sensor in a format, and gives what comes of it and the numbers of the frames that were told of.
    fn run(spec: &'static FormatSpec) -> (thread::Result<Result<Times, Error>>, Vec<u64>) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/room_vlp16.toml");
        let overrides = ["sensor.vlp16.rotating.columns=36", "sequence.frames=40"].map(str::to_owned);
        let mut job = load_job(&path, &overrides).unwrap();
        let folder = tempfile::tempdir().unwrap();
        job.output.dir = folder.path().to_owned();
        job.output.formats = vec![Format::of(spec)];
        let plan = Plan::of(&job, &Selection::ALL, Holding::Files).unwrap();
        let mut journal = Journal::check(&job, &plan, Start::New).unwrap();
        let scene = load_scene(&mut job, &[]).unwrap().scene;
        let session = Session::open(job, &scene);
        journal.begin(&session, &plan, &mut |_, _| unreachable!()).unwrap();
        let (interrupt, writing) = (Interrupt::default(), Writing::of(40, 40));
        let (session, plan) = (&session, &plan);
        let pipeline =
            Pipeline { session, plan, scene_folders: &[], interrupt: &interrupt, writing: &writing };
        let mut told = Vec::new();
        let mut tell = |item: &Item, line: Line| {
            assert!(
                folder.path().join(&line.outputs[0].path).exists(),
                "a file has its name when it is told of"
            );
            told.push(item.frame);
            Ok(())
        };
        let outcome = catch_unwind(AssertUnwindSafe(|| pipeline.run(0, &mut journal, &mut tell)));
        (outcome, told)
    }

    #[test]
    fn the_frames_before_one_that_fails_are_written() {
        let (outcome, told) = run(&FAILS);
        let error = outcome.unwrap().unwrap_err().to_string();
        assert!(error.contains("this frame does not fit") && error.contains("000005.fails"), "{error}");
        assert_eq!(told, (0..BAD).collect::<Vec<_>>());
    }

    #[test]
    fn a_panic_ends_a_run() {
        let (outcome, told) = run(&PANICS);
        let message = *outcome.unwrap_err().downcast::<&str>().unwrap();
        assert_eq!(message, "this frame is a trap");
        assert!(told.iter().copied().eq(0..told.len() as u64) && told.len() as u64 <= BAD, "{told:?}");
    }
}
