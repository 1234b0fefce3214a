//! The folder that a run writes, and the record of the files that are in it.
//!
//! While a run lasts, its record is `journal.jsonl`, or `journal-I-of-N.jsonl` for each of its parts: see [`record`]. When all
//! frames are finished, the manifest is made of it, and it is removed. So a folder has a manifest or a journal, and the
//! folders of a run, of a run that was resumed, and of parts that were merged are the same byte for byte.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::plan::{Item, Output, Plan, Shard};
use super::record::{self, Header, Line, Merged, Reader, Writer};
use super::session::Session;
use super::table::Table;
use crate::config::{InputFile, Job};
use crate::error::Error;
use crate::output::recorded::read_manifest;
use crate::output::{
    Destination, EncodeError, Format, GrowingFile, Manifest, Note, SensorFrame, Stream, WrittenFile,
    json_lines,
};
use crate::scene::SourceFile;

/// What a run does with what is in its folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Nothing of the run may be there.
    New,
    /// What is there is replaced, and what else an earlier run has written is removed.
    Overwrite,
    /// A run that was stopped goes on.
    Resume,
}

/// The record of a run, from which the manifest is made.
pub struct Journal {
    destination: Destination,
    start: Start,
    shard: Shard,
    name: String,
    header: Option<Header>,
    writer: Option<Writer>,
    /// The frames that are finished.
    frames: u64,
    /// The files into which all frames go. Frames are added to them while others are recorded.
    pub streams: Streams,
    tables: Vec<Table>,
}

/// The files into which all frames of a run go, open.
#[derive(Default)]
pub struct Streams(Vec<(Box<dyn Stream>, GrowingFile, Vec<String>)>);

impl Streams {
    /// Adds a frame. Frames come in the order of the plan.
    ///
    /// # Errors
    /// [`Error::Output`] about a file, such as when the frame does not fit its format.
    pub fn add(&mut self, frame: &SensorFrame) -> Result<(), Error> {
        for (stream, file, _) in &mut self.0 {
            stream.add(frame, file).map_err(|e| Error::output(file.path(), e))?;
        }
        Ok(())
    }
}

/// What an earlier run has done already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Done {
    /// So many frames are finished: the first ones of the plan.
    Frames(u64),
    /// The folder has its manifest, so that nothing is left to do.
    All,
}

impl Journal {
    /// The journal of a run that is about to begin. Nothing is written yet.
    ///
    /// # Errors
    /// [`Error::Output`] about the first folder or file that is in the way; [`Error::Usage`] if a run with these formats can't be
    /// parted or resumed.
    pub fn check(job: &Job, plan: &Plan, start: Start) -> Result<Self, Error> {
        let (shard, folder) = (plan.shard(), &job.output.dir);
        if let Some(stream) = plan.streams.first()
            && (shard != Shard::WHOLE || start == Start::Resume)
        {
            let (format, name) = (stream.format.name(), &stream.name);
            return Err(Error::Usage(format!(
                "all frames go into one {format}, {name}, so the run can be neither parted nor resumed: \
                 leave the format out, or run it whole"
            )));
        }
        let name = record::name_of(shard);
        let is_finished = fs::symlink_metadata(folder.join(Manifest::NAME)).is_ok();
        let refuse = |name: &str, problem: &str| Err(Error::output(folder.join(name), problem));
        if shard != Shard::WHOLE && is_finished {
            return refuse(
                Manifest::NAME,
                "is of a run that is finished, and a part replaces no run: --out DIR writes elsewhere",
            );
        }
        for (other, path) in record::all_in(folder) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match start {
                Start::Overwrite if shard == Shard::WHOLE || other == shard => {}
                Start::Resume if other == shard => {}
                Start::New if other == shard => {
                    return refuse(
                        &name,
                        "is of a run that was stopped; --resume goes on with it, --overwrite begins anew",
                    );
                }
                _ if other.count != shard.count => {
                    let problem = match (other, shard) {
                        (Shard::WHOLE, _) => {
                            "is of a whole run that was stopped, and this is a part of one".to_owned()
                        }
                        (other, Shard::WHOLE) => {
                            format!(
                                "is one of {} parts of a run: `beamcast merge` makes a whole of them",
                                other.count
                            )
                        }
                        (other, shard) => {
                            format!("is one of {} parts, and this is one of {}", other.count, shard.count)
                        }
                    };
                    return refuse(&name, &problem);
                }
                _ => {}
            }
        }
        let destination = Destination::check(folder, plan.clone(), start != Start::New)?;
        let (header, writer, streams) = (None, None, Streams::default());
        let tables = plan.tables.clone();
        Ok(Self { destination, start, shard, name, header, writer, frames: 0, streams, tables })
    }

    /// Calls `each` with the path of each file of an earlier run that the run will remove, because its own manifest will not list
    /// it.
    pub fn paths_to_remove(&self, mut each: impl FnMut(PathBuf)) {
        if self.start == Start::Overwrite && self.shard == Shard::WHOLE {
            let old = Old::open(self.destination.folder());
            // A file that can't be read to its end lists nothing more that could be removed.
            let _ = old.names(&mut |name| {
                self.destination.old_path(name).into_iter().for_each(&mut each);
                Ok(())
            });
        }
    }

    /// Makes the folders, finds out what is done already or removes what an earlier run has written, and opens the files into
    /// which all frames go. An old manifest goes first, so that there is at no time a manifest that lists a file that is gone.
    /// `each` is told of each frame of an unfinished run that is done already, in the order of the plan.
    ///
    /// # Errors
    /// [`Error::Output`] about the folder or the file, such as one of a run of another job.
    pub fn begin(
        &mut self,
        session: &Session,
        plan: &Plan,
        each: &mut dyn FnMut(&Item, Line),
    ) -> Result<Done, Error> {
        let sensors = plan.sensors();
        let tables = plan.tables.iter().map(|table| table.name().to_owned()).collect();
        let own = Header::new(sensors, self.shard, tables, head_of(session, plan));
        let folder = self.destination.folder().to_path_buf();
        let old = (self.start == Start::Overwrite && self.shard == Shard::WHOLE).then(|| Old::open(&folder));
        if self.start == Start::Resume && is_finished_as(&folder, &own)? {
            // A run that was stopped at the last moment has left its journal.
            self.destination.remove(&self.name)?;
            return Ok(Done::All);
        }
        match self.shard {
            Shard::WHOLE => self.destination.prepare(Manifest::NAME)?,
            _ => self.destination.prepare_shared()?,
        }
        if let Some(old) = old {
            // What can't be read of an old manifest or journal lists nothing that could be removed.
            old.names(&mut |name| self.destination.remove_old(name))?;
            for (_, path) in record::all_in(&folder) {
                self.destination.remove(&path.file_name().unwrap_or_default().to_string_lossy())?;
            }
        }
        let path = folder.join(&self.name);
        let found = match self.start {
            Start::Resume if path.exists() => Reader::open(&path)?,
            _ => None,
        };
        self.writer = Some(match found {
            Some(reader) => {
                if let Some(difference) = own.difference(&reader.header) {
                    let problem =
                        format!("{difference}; --overwrite begins anew, --out DIR writes elsewhere");
                    return Err(Error::output(path, problem));
                }
                let bytes = self.take_up(reader, session, plan, each);
                Writer::resume(&path, bytes)?
            }
            None => Writer::create(&path, &own)?,
        });
        self.header = Some(own);
        let sensors: Vec<_> = session.job.sensors.iter().map(|mounted| &mounted.sensor).collect();
        for Output { format, name, .. } in &plan.streams {
            if let Some(stream) = format.stream(&sensors) {
                let beside = format.stream_files().into_iter().skip(1).collect();
                self.streams.0.push((stream, self.destination.open(name)?, beside));
            }
        }
        Ok(Done::Frames(self.frames))
    }

    /// Tells of the frames of a journal as far as they are those of the plan, in its order, and their files are there. Returns
    /// the bytes of the journal that hold.
    fn take_up(
        &mut self,
        mut reader: Reader,
        session: &Session,
        plan: &Plan,
        each: &mut dyn FnMut(&Item, Line),
    ) -> u64 {
        let folder = self.destination.folder();
        let is_there = |file: &WrittenFile| {
            let found = fs::symlink_metadata(folder.join(&file.path));
            found.is_ok_and(|found| found.is_file() && found.len() == file.bytes)
        };
        let mut bytes = reader.bytes();
        for item in plan.items(&session.job) {
            let Some(line) = reader.next() else { break };
            let is_planned = line.sensor == session.sensor(&item).name
                && line.frame == item.frame
                && line
                    .outputs
                    .iter()
                    .map(|file| &file.path)
                    .eq(item.outputs.iter().map(|output| &output.name));
            if !is_planned || !line.outputs.iter().all(is_there) {
                break;
            }
            self.frames += 1;
            bytes = reader.bytes();
            each(&item, line);
        }
        bytes
    }

    /// The folder, to write a frame's files to. They count when the frame is recorded.
    pub fn destination(&self) -> &Destination {
        &self.destination
    }

    /// Records a frame whose files are written, and which was added to the files into which all frames go. Frames come in the order
    /// of the plan.
    ///
    /// # Errors
    /// [`Error::Output`] about the journal.
    pub fn record(&mut self, line: &Line) -> Result<(), Error> {
        if let Some(writer) = &mut self.writer {
            writer.write(line)?;
        }
        self.frames += 1;
        Ok(())
    }

    /// Finishes the files into which all frames went, writes the manifest, and removes the journal. A folder that has a manifest
    /// is complete. Returns the files of all frames. Of a part of a run nothing is left to do: [`merge`](super::merge::merge) needs its journal.
    ///
    /// # Errors
    /// [`Error::Output`] about the file.
    pub fn finish(&mut self) -> Result<Vec<WrittenFile>, Error> {
        let mut of_run = Vec::new();
        for (mut stream, mut file, beside) in std::mem::take(&mut self.streams).0 {
            stream.finish(&mut file).map_err(|e| Error::output(file.path(), e))?;
            let head = stream.head();
            if !head.is_empty() {
                file.replace_head(&head).map_err(|e| Error::output(file.path(), e))?;
            }
            of_run.push(file.finish()?);
            for (name, content) in beside.iter().zip(stream.beside()) {
                of_run.push(self.destination.write(name, &content)?);
            }
        }
        self.writer = None;
        // No manifest lists a file that a power cut could take. A journal may: such a frame is cast again.
        self.destination.flush();
        if self.shard != Shard::WHOLE {
            return Ok(of_run);
        }
        let Some(header) = &self.header else { return Ok(of_run) };
        let path = self.destination.folder().join(&self.name);
        let lines = || Ok(Merged::of(Reader::open(&path)?.into_iter().collect()));
        let of_run = write_end(&self.destination, header, &self.tables, &lines, of_run)?;
        self.destination.remove(&self.name)?;
        Ok(of_run)
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        // A run that stopped before its first frame was finished leaves nothing behind.
        if self.writer.take().is_some() && self.frames == 0 {
            let _ = self.destination.remove(&self.name);
        }
    }
}

/// Writes the tables of a run and then its manifest, from the run's lines and the files of all frames. `lines` reads them from the
/// beginning, so that none are kept.
///
/// # Errors
/// [`Error::Output`] about the file; the errors of `lines`.
pub(super) fn write_end(
    destination: &Destination,
    header: &Header,
    tables: &[Table],
    lines: &dyn Fn() -> Result<Option<Merged>, Error>,
    mut of_run: Vec<WrittenFile>,
) -> Result<Vec<WrittenFile>, Error> {
    for table in tables {
        let mut file = destination.open(table.name())?;
        let notes = || -> Result<Box<dyn Iterator<Item = Note> + '_>, EncodeError> {
            let lines = lines().map_err(|e| EncodeError::new(e.to_string()))?.into_iter().flatten();
            Ok(Box::new(lines.flat_map(|line| notes_for(table, line))))
        };
        table.write(&notes, &mut file).map_err(|e| Error::output(file.path(), e))?;
        of_run.push(file.finish()?);
    }
    // The frames of a sensor follow each other, so what is drawn for a frame is told of the first sensor that comes to it.
    let mut next = 0;
    let drawn = lines()?.into_iter().flatten().filter_map(|line| {
        let is_first = line.frame >= next && !line.drawn.is_empty();
        next = next.max(line.frame + 1);
        is_first.then_some((line.frame, line.drawn))
    });
    let mut file = destination.open(Manifest::NAME)?;
    let outputs = lines()?.into_iter().flatten().flat_map(|line| line.outputs).chain(of_run.iter().cloned());
    Manifest::write(&header.manifest, outputs, drawn, &mut file)
        .map_err(|e| Error::output(file.path(), e))?;
    file.finish()?;
    Ok(of_run)
}

/// What a frame has noted for a table.
fn notes_for(table: &Table, mut line: Line) -> Vec<Note> {
    if table.sensor().is_some_and(|sensor| sensor != line.sensor) {
        return Vec::new();
    }
    let files: Vec<String> = line.outputs.into_iter().map(|file| file.path).collect();
    let rows = line.rows.remove(table.key()).unwrap_or_default();
    rows.into_iter().map(|text| Note { text, files: files.clone() }).collect()
}

/// The manifest of a session's run, without its outputs.
fn head_of(session: &Session, plan: &Plan) -> String {
    let job = &session.job;
    let read = |file: &InputFile| SourceFile {
        name: file.name.clone(),
        bytes: file.bytes,
        blake3: file.blake3.clone(),
    };
    let inputs: Vec<SourceFile> = job.inputs.iter().map(read).collect();
    let frames = plan.sensors();
    let (scene, labels) = (session.scene(), &job.labels);
    Manifest { job: &job.resolved, seed: job.seed, inputs: &inputs, labels, scene, frames: &frames }.head()
}

/// Whether a folder has a manifest, which must be that of this run.
fn is_finished_as(folder: &Path, own: &Header) -> Result<bool, Error> {
    let path = folder.join(Manifest::NAME);
    let Ok(file) = File::open(&path) else { return Ok(false) };
    let mut head = read_manifest(file, |_| ()).map_err(|e| Error::output(&path, e))?;
    // What was drawn follows from the rest.
    head.as_object_mut().and_then(|head| head.remove("drawn"));
    match record::difference_of_manifests(&own.manifest, &json_lines(&head)) {
        Some(difference) => Err(Error::output(
            path,
            format!("{difference}; --overwrite begins anew, --out DIR writes elsewhere"),
        )),
        None => Ok(true),
    }
}

/// What earlier runs have written to a folder, as far as their manifest and journals say. The files are held open, so that they
/// can be read when they are removed already.
struct Old {
    manifest: Option<File>,
    journals: Vec<Reader>,
}

impl Old {
    fn open(folder: &Path) -> Self {
        let open = |path: PathBuf| Reader::open(&path).ok().flatten();
        let journals = record::all_in(folder).into_iter().filter_map(|(_, path)| open(path)).collect();
        Self { manifest: File::open(folder.join(Manifest::NAME)).ok(), journals }
    }

    /// Calls `each` with the names of all files that are those of runs. The first error ends it.
    fn names(self, each: &mut dyn FnMut(&str) -> Result<(), Error>) -> Result<(), Error> {
        let mut result = Ok(());
        let mut name = |name: &str| {
            if result.is_ok() && is_of_a_run(name) {
                result = each(name);
            }
        };
        if let Some(manifest) = self.manifest {
            // A manifest that can't be read lists nothing more that could be removed.
            let _ = read_manifest(manifest, |output| name(&output.path));
        }
        self.journals
            .into_iter()
            .flatten()
            .flat_map(|line| line.outputs)
            .for_each(|output| name(&output.path));
        result
    }
}

/// Whether a path is one that a run gives an output: that of a frame's file, that of a file of all frames, or that of a table. A
/// manifest is a file that anybody may have written, and `--overwrite` removes no other file of its folder because of it.
pub(super) fn is_of_a_run(name: &str) -> bool {
    // An option may ask for one file of all frames. A folder's format has no ending.
    let of_run = name.strip_prefix("run.").filter(|ending| !ending.is_empty());
    let is_of = |format: Format| {
        format.frame_of(name).is_some()
            || of_run == Some(format.ending())
            || format.spec.stream_files.contains(&name)
    };
    Table::named(name).is_some() || Format::all().any(is_of)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_outputs_are_outputs_of_a_run() {
        for name in [
            "top/000000.exr",
            "front_left/1234567.ply",
            "run.png",
            "top/000000.depth16.png",
            "poses.csv",
            "boxes.jsonl",
            "top/velodyne/000000.bin",
            "top/labels/000000.label",
            "top/poses.txt",
            "bag/bag_0.mcap",
            "bag/metadata.yaml",
        ] {
            assert!(is_of_a_run(name), "{name}");
        }
        for name in [
            "src/main.rs",
            "a.exr",
            "a/b/000000.exr",
            "../000000.exr",
            "/000000.exr",
            "top/notes.exr",
            "top/00000.exr",
            "top/000000",
            "top/000000.mine.png",
            "000000.exr",
            "run.",
            "velodyne/000000.bin",
            "../velodyne/000000.bin",
            "a/b/velodyne/000000.bin",
            "top/velodyne/notes.bin",
            "../poses.txt",
            "bag/notes.yaml",
        ] {
            assert!(!is_of_a_run(name), "{name}");
        }
    }
}
