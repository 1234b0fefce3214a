//! Part of a run that is written with a session that stays open. A program that writes many parts, as each node of a cluster does,
//! reads its job and builds the tracer once.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::interrupt::Interrupt;
use super::pipeline::Pipeline;
use super::terminal::Writing;
use super::threads;
use crate::config::Job;
use crate::error::Error;
use crate::output::WrittenFile;
use crate::run::journal::Done;
use crate::run::record::Line;
use crate::run::{Holding, Item, Journal, Plan, Selection, Session, Start};

/// Part of a run, checked and not begun.
pub struct Part<'s> {
    session: Session,
    plan: Plan,
    journal: Journal,
    scene_folders: &'s [PathBuf],
}

/// The outcome of writing a part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// The frames of the part, of all sensors.
    pub frames: u64,
    /// The frames of these that an earlier run had finished.
    pub earlier: u64,
    /// The files of the other frames.
    pub files: u64,
    /// The bytes of these files.
    pub bytes: u64,
}

/// Starts the threads that parts are written on, for the rest of the process.
///
/// # Errors
/// [`Error::Usage`] if there can't be so many, or if the process has started them already.
pub fn start_threads(threads: u16) -> Result<(), Error> {
    threads::Args::of(threads).start()
}

impl<'s> Part<'s> {
    /// A part that will be written to a folder, or gone on with, as `beamcast scan --resume` does. The files of scenes that are drawn
    /// may lie in `scene_folders` besides the scene's own.
    ///
    /// # Errors
    /// Those of [`Plan::of`], [`Plan::check_scene`] and [`Journal::check`].
    pub fn of(
        session: &Session,
        selection: &Selection,
        folder: &Path,
        scene_folders: &'s [PathBuf],
    ) -> Result<Self, Error> {
        let mut job = Job::clone(&session.job);
        job.output.dir = crate::run::paths::tidy(folder);
        let plan = Plan::of(&job, selection, Holding::Files)?;
        let journal = Journal::check(&job, &plan, Start::Resume)?;
        plan.check_scene(session.scene())?;
        let mut session = session.clone();
        session.job = Arc::new(job);
        Ok(Self { session, plan, journal, scene_folders })
    }

    /// The frames of the part, of all sensors.
    pub fn frames(&self) -> u64 {
        self.plan.frames()
    }

    /// Writes the frames that are not finished, on the process's threads. The thread that calls must be none of these.
    ///
    /// # Errors
    /// Those of [`Journal::begin`] and [`Session::of_frame`], and [`Error::Output`] about a file.
    pub fn write(self) -> Result<Written, Error> {
        let Self { session, plan, mut journal, scene_folders } = self;
        let mut written = Written { frames: plan.frames(), ..Written::default() };
        written.earlier = match journal.begin(&session, &plan, &mut |_, _| {})? {
            Done::Frames(frames) => frames,
            Done::All => return Ok(Written { earlier: written.frames, ..written }),
        };
        let (interrupt, writing) = (Interrupt::default(), Writing::of(plan.files_of_frames(), plan.frames()));
        let (session, plan, interrupt, writing) = (&session, &plan, &interrupt, &writing);
        let mut tell = |_: &Item, line: Line| {
            written.files += line.outputs.len() as u64;
            written.bytes += line.outputs.iter().map(|WrittenFile { bytes, .. }| bytes).sum::<u64>();
            Ok(())
        };
        Pipeline { session, plan, scene_folders, interrupt, writing }.run(
            written.earlier,
            &mut journal,
            &mut tell,
        )?;
        journal.finish()?;
        Ok(written)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::load_job;
    use crate::run::{Shard, load_scene, merge::merge};

    #[test]
    fn parts_of_an_open_session_make_the_run_in_one_piece() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/room_vlp16.toml");
        let overrides = ["sensor.vlp16.rotating.columns=36", "sequence.frames=5", "output.formats=[\"npy\"]"];
        let mut job = load_job(&path, &overrides.map(str::to_owned)).unwrap();
        let scene = load_scene(&mut job, &[]).unwrap().scene;
        let session = Session::open(job, &scene);
        let folder = tempfile::tempdir().unwrap();
        let (whole, parts) = (folder.path().join("whole"), folder.path().join("parts"));
        let write = |shard, folder: &Path| {
            let selection = Selection { shard, ..Selection::ALL };
            Part::of(&session, &selection, folder, &[]).and_then(Part::write)
        };
        let all = write(Shard::WHOLE, &whole).unwrap();
        assert_eq!((all.frames, all.earlier), (5, 0));
        let [one, two] = [0, 1].map(|index| write(Shard { index, count: 2 }, &parts).unwrap());
        assert_eq!([one.frames, two.frames], [3, 2]);
        assert_eq!((one.files + two.files, one.bytes + two.bytes), (all.files, all.bytes));
        let again = write(Shard { index: 0, count: 2 }, &parts).unwrap();
        assert_eq!(again, Written { earlier: 3, files: 0, bytes: 0, ..one });
        merge(&parts).unwrap();
        for name in ["manifest.json", "vlp16/000004.npy"] {
            assert_eq!(std::fs::read(whole.join(name)).unwrap(), std::fs::read(parts.join(name)).unwrap());
        }
        assert_eq!(write(Shard::WHOLE, &whole).unwrap().earlier, 5);
        let refused = write(Shard { index: 0, count: 2 }, &whole).unwrap_err();
        assert!(refused.to_string().contains("a part replaces no run"), "{refused}");
    }
}
