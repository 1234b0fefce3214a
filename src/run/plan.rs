//! The frames, files and memory that a job asks for, found and checked before anything is cast.

use std::collections::BTreeSet;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::memory::{self, Holding};
use super::table::Table;
use crate::config::{Job, MountedSensor};
use crate::error::Error;
use crate::output::{FileNames, Format, LEAST_DIGITS, Manifest, SensorFrames};
use crate::scene::Scene;
use crate::sensor::Sensor;

/// The frames that a job casts and the files that they become. Its size does not depend on the number of frames.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The sensors, in the job's order.
    sensors: Vec<Planned>,
    shard: Shard,
    /// The formats with files for each frame.
    formats: Vec<Format>,
    /// The files into which all frames go.
    pub streams: Vec<Output>,
    /// The tables that have rows of all frames.
    pub tables: Vec<Table>,
    /// The most slices of a frame, for each of which what bends has a shape of its own.
    slices: usize,
    /// Rays of all frames.
    pub rays: u64,
    /// An upper estimate of the memory that the frames take with everything that is made of them, in bytes. The memory of
    /// the scene comes on top.
    pub bytes: u64,
}

/// A sensor of a plan.
#[derive(Clone, Debug)]
struct Planned {
    name: String,
    /// The numbers of the frames.
    frames: Range<u64>,
    /// The frames that the job has of the sensor.
    of: u64,
    /// The digits of the numbers in the names of files.
    digits: usize,
    /// The files of each frame: a format, and the number of the file among those of the format.
    files: Vec<(Format, usize)>,
}

/// The frames of a job that a run casts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// The numbers of the frames; those that a sensor does not have are left out.
    pub frames: Range<u64>,
    /// The part of these frames.
    pub shard: Shard,
}

impl Selection {
    /// All frames.
    pub const ALL: Self = Self { frames: 0..u64::MAX, shard: Shard::WHOLE };
    /// The first frame of each sensor.
    pub const FIRST: Self = Self { frames: 0..1, shard: Shard::WHOLE };
}

/// A part of a run, of which several processes each cast one: frame k belongs to part k mod `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// The number of the part, from 0.
    pub index: u64,
    /// The number of parts, at least 1.
    pub count: u64,
}

impl Shard {
    /// The only part of a run that is not parted.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// The least frame of the part that is not less than `frame`.
    pub fn first_from(self, frame: u64) -> Option<u64> {
        let Self { index, count } = self;
        frame.checked_add((index + count - frame % count) % count)
    }

    /// The number of the part's frames among the frames of a range.
    pub fn count_in(self, frames: &Range<u64>) -> u64 {
        match self.first_from(frames.start) {
            Some(first) if first < frames.end => (frames.end - 1 - first) / self.count + 1,
            _ => 0,
        }
    }
}

/// A frame of a sensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// The index of the sensor in the job.
    pub sensor: usize,
    /// The frame's number, from 0.
    pub frame: u64,
    /// The files that the frame is written to.
    pub outputs: Vec<Output>,
}

/// A file that one frame is written to, or all frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// The file's format.
    pub format: Format,
    /// The number of the file among those that the format makes of a frame, from 0.
    pub file: usize,
    /// The file's path in the output folder, with forward slashes.
    pub name: String,
}

impl Plan {
    /// Plans the chosen frames of a job whose run holds so much in memory at the same time.
    ///
    /// # Errors
    /// [`Error::Usage`] if a frame does not fit one of its formats, or if the frames do not fit into the machine's memory, or if
    /// none is chosen.
    pub fn of(job: &Job, selection: &Selection, holding: Holding) -> Result<Self, Error> {
        if let Some(problem) = format_problems(job).into_iter().next() {
            return Err(Error::Usage(problem));
        }
        let shard = selection.shard;
        let (streams, formats): (Vec<Format>, Vec<Format>) =
            job.output.formats.iter().partition(|format| format.is_of_run());
        let of_run = |format: Format| {
            let name = format.stream_files().into_iter().next()?;
            Some(Output { format, file: 0, name })
        };
        let streams = streams.into_iter().filter_map(of_run).collect();
        let mut plan = Self {
            sensors: Vec::new(),
            shard,
            formats,
            streams,
            tables: Table::of(job),
            slices: 1,
            rays: 0,
            bytes: 0,
        };
        let mut longest = 0;
        for (index, MountedSensor { name, sensor, .. }) in job.sensors.iter().enumerate() {
            let first = job.capture(index, 0);
            if !first.is_frozen {
                plan.slices = plan.slices.max(first.window().slices(job.sequence.slice_s));
            }
            let all = job.sequence.frames_of(sensor);
            longest = longest.max(all);
            let frames = selection.frames.start.min(all)..selection.frames.end.min(all);
            let (rows, columns) = (sensor.pattern.rows() as u64, sensor.pattern.columns() as u64);
            let of_frame = rows.checked_mul(columns);
            let rays = of_frame.and_then(|rays| rays.checked_mul(shard.count_in(&frames)));
            let too_many =
                || Error::Usage(format!("sensor {name:?} has too many rays: {rows} × {columns} a frame"));
            plan.rays = rays.and_then(|rays| plan.rays.checked_add(rays)).ok_or_else(too_many)?;
            let digits = all
                .saturating_sub(1)
                .checked_ilog10()
                .map_or(1, |digits| digits as usize + 1)
                .max(LEAST_DIGITS);
            let files = files_of(&plan.formats, job, sensor);
            plan.sensors.push(Planned { name: name.clone(), frames, of: all, digits, files });
        }
        if plan.sensors.iter().all(|planned| planned.frames.is_empty()) {
            let Range { start, end } = selection.frames;
            let problem = format!(
                "the job has no frames {start}..{end}: its sensors have at most {longest}, counted from 0"
            );
            return Err(Error::Usage(problem));
        }
        for (index, MountedSensor { name, .. }) in job.sensors.iter().enumerate() {
            let alone = memory::of_frames(&job.sensors[index..=index], &[1], &job.output.formats, holding);
            memory::check(&format!("a frame of sensor {name:?}"), alone)?;
        }
        let counts: Vec<u64> = plan.sensors.iter().map(|planned| shard.count_in(&planned.frames)).collect();
        let of_frames = memory::of_frames(&job.sensors, &counts, &job.output.formats, holding);
        plan.bytes = memory::of_tables(&job.sensors).saturating_add(of_frames);
        memory::check("the rig", plan.bytes)?;
        Ok(plan)
    }

    /// Checks that the scene's labels fit the formats, and that the scene fits into the machine's memory beside the frames.
    ///
    /// # Errors
    /// [`Error::Usage`] with the label, or with the estimate.
    pub fn check_scene(&self, scene: &Scene) -> Result<(), Error> {
        let formats = self.formats.iter().copied().chain(self.streams.iter().map(|output| output.format));
        if let Some(problem) = label_problem(formats, scene) {
            return Err(Error::Usage(problem));
        }
        let of_scene = memory::of_scene(scene) + memory::of_shapes(scene, self.slices);
        memory::check("the job with its scene", self.bytes.saturating_add(of_scene))
    }

    /// The frames of the job that was planned, in the order in which they are cast: by the times at which they start, and at
    /// the same time in the order of the sensors.
    pub fn items<'p>(&'p self, job: &'p Job) -> impl Iterator<Item = Item> + 'p {
        let next = move |sensor: usize, from: u64| {
            let frame =
                self.shard.first_from(from).filter(|frame| *frame < self.sensors[sensor].frames.end)?;
            Some((job.capture(sensor, frame).start_s, frame))
        };
        let mut waiting: Vec<Option<(f64, u64)>> = self
            .sensors
            .iter()
            .enumerate()
            .map(|(sensor, planned)| next(sensor, planned.frames.start))
            .collect();
        std::iter::from_fn(move || {
            let of_sensor = |(sensor, next): (usize, &Option<(f64, u64)>)| {
                next.map(|(start_s, frame)| (start_s, sensor, frame))
            };
            let earliest = waiting.iter().enumerate().filter_map(of_sensor);
            let (_, sensor, frame) = earliest.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
            waiting[sensor] = next(sensor, frame + 1);
            Some(self.item(sensor, frame))
        })
    }

    /// A frame of a sensor with its files.
    fn item(&self, sensor: usize, frame: u64) -> Item {
        let Planned { name, digits, files, .. } = &self.sensors[sensor];
        let number = format!("{frame:0digits$}");
        let output = |&(format, file): &(Format, usize)| {
            Some(Output { format, file, name: format.frame_file(file)?.path.of(name, &number) })
        };
        Item { sensor, frame, outputs: files.iter().filter_map(output).collect() }
    }

    /// The names of the files of all frames, with those that are written beside them.
    pub fn stream_files(&self) -> impl Iterator<Item = String> {
        self.streams.iter().flat_map(|stream| stream.format.stream_files())
    }

    /// The part of the run that the plan is for.
    pub fn shard(&self) -> Shard {
        self.shard
    }

    /// The frames of the whole run, whatever part of it the plan is for.
    pub fn sensors(&self) -> Vec<SensorFrames> {
        let frames = |Planned { name, frames, of, .. }: &Planned| SensorFrames {
            sensor: name.clone(),
            first: frames.start,
            count: frames.end - frames.start,
            of: *of,
        };
        self.sensors.iter().map(frames).collect()
    }

    /// The number of frames of a sensor, by its index in the job.
    pub fn frames_of(&self, sensor: usize) -> u64 {
        self.shard.count_in(&self.sensors[sensor].frames)
    }

    /// The number of the files of all frames and of the run, its manifest among them.
    pub fn files(&self) -> u64 {
        let made_at_the_end = if self.shard == Shard::WHOLE { self.tables.len() + 1 } else { 0 };
        self.files_of_frames().saturating_add((self.stream_files().count() + made_at_the_end) as u64)
    }

    /// The number of files of single frames.
    pub fn files_of_frames(&self) -> u64 {
        let of_sensor = |(sensor, planned): (usize, &Planned)| {
            self.frames_of(sensor).saturating_mul(planned.files.len() as u64)
        };
        self.sensors.iter().enumerate().map(of_sensor).fold(0, u64::saturating_add)
    }

    /// The number of frames of all sensors.
    pub fn frames(&self) -> u64 {
        (0..self.sensors.len()).map(|sensor| self.frames_of(sensor)).sum()
    }
}

impl FileNames for Plan {
    fn folders(&self) -> BTreeSet<String> {
        let has_frames = |planned: &&Planned| !planned.frames.is_empty();
        let of_frames = self.sensors.iter().filter(has_frames).flat_map(|planned| {
            let path = |&(format, file): &(Format, usize)| {
                Some(format.frame_file(file)?.path.of(&planned.name, FIRST))
            };
            planned.files.iter().filter_map(path).filter_map(|path| Some(path.rsplit_once('/')?.0.to_owned()))
        });
        let of_tables = self.tables.iter().map(|table| table.folder().to_owned());
        let of_streams = self.stream_files().filter_map(|name| Some(name.rsplit_once('/')?.0.to_owned()));
        of_frames.chain(of_tables.filter(|folder| !folder.is_empty())).chain(of_streams).collect()
    }

    fn contains(&self, name: &str) -> bool {
        let is_table = || self.tables.iter().any(|table| table.name() == name);
        if name == Manifest::NAME || is_table() {
            return self.shard == Shard::WHOLE;
        }
        let is_of = |planned: &Planned, (format, file): (Format, usize)| {
            let frame_of = || format.frame_file(file)?.path.frame_of(name);
            let Some((sensor, digits)) = frame_of() else { return false };
            let frame: Option<u64> = digits.parse().ok();
            sensor == planned.name
                && digits.len() == planned.digits
                && frame.is_some_and(|frame| {
                    planned.frames.contains(&frame) && frame % self.shard.count == self.shard.index
                })
        };
        self.stream_files().any(|known| known == name)
            || self.sensors.iter().any(|planned| planned.files.iter().any(|&file| is_of(planned, file)))
    }
}

/// The digits of a number with which the folder of a frame's file is found. All frames have the same.
const FIRST: &str = "000000";

/// The files of each frame of a sensor: a format, and the number of the file among those of the format.
fn files_of(formats: &[Format], job: &Job, sensor: &Sensor) -> Vec<(Format, usize)> {
    let has_boxes = job.truth.boxes.is_some();
    let is_made = |&(format, file): &(Format, usize)| format.makes_frame_file(file, sensor, has_boxes);
    let all = formats.iter().flat_map(|format| (0..format.frame_files()).map(|file| (*format, file)));
    all.filter(is_made).collect()
}

/// Sentences about the sensors whose frames do not fit a format of the job.
pub fn format_problems(job: &Job) -> Vec<String> {
    let mut problems = Vec::new();
    for MountedSensor { name, sensor, .. } in &job.sensors {
        for format in &job.output.formats {
            if let Err(problem) = format.check(sensor) {
                problems.push(format!("sensor {name:?} has no {}: {problem}", format.name()));
            }
        }
    }
    problems
}

/// A sentence about the largest label of a scene, or about its objects, if they do not fit one of the formats.
pub fn label_problem(formats: impl Iterator<Item = Format>, scene: &Scene) -> Option<String> {
    let largest = scene.labels().last().copied().unwrap_or(0);
    let objects = scene.geometry.objects.len();
    let check = |format: Format| format.check_label(largest).and_then(|()| format.check_instances(objects));
    let problem = |format: Format| Some((format, check(format).err()?));
    let (format, problem) = formats.into_iter().find_map(problem)?;
    Some(format!("the scene has no {}: {problem}", format.name()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config::{Length, load_job};

    /// A job with a LiDAR of 10 Hz and a camera of 25 Hz.
    fn job(length: Length) -> Job {
        let folder = tempfile::tempdir().unwrap();
        let text = "scene = \"a.glb\"\n[[sensor]]\nname = \"top\"\n[sensor.rotating]\nelevations_deg = [0.0]\ncolumns = 8\n\
                    rate_hz = 10.0\n[[sensor]]\nname = \"front\"\n[sensor.pinhole]\nwidth_px = 4\nheight_px = 2\n\
                    hfov_deg = 60.0\nrate_hz = 25.0\n[output]\ndir = \"out\"\nformats = [\"exr\", \"png\"]\n";
        let path = folder.path().join("job.toml");
        std::fs::write(&path, text).unwrap();
        let mut job = load_job(Path::new(&path), &[]).unwrap();
        job.sequence.length = length;
        job
    }

    fn items(job: &Job, frames: Range<u64>, shard: Shard) -> Vec<(usize, u64)> {
        let plan = Plan::of(job, &Selection { frames, shard }, Holding::Files).unwrap();
        let items: Vec<_> = plan.items(job).map(|item| (item.sensor, item.frame)).collect();
        assert_eq!(plan.frames(), items.len() as u64);
        items
    }

    #[test]
    fn frames_come_in_the_order_of_their_times() {
        let job = job(Length::Duration(0.2));
        let all = items(&job, 0..u64::MAX, Shard::WHOLE);
        // The LiDAR's frames start at 0 and 100 ms, the camera's at 0, 40, 80, 120 and 160 ms. A frame at 200 ms is too late.
        assert_eq!(all, [(0, 0), (1, 0), (1, 1), (1, 2), (0, 1), (1, 3), (1, 4)]);
        assert_eq!(items(&job, 1..3, Shard::WHOLE), [(1, 1), (1, 2), (0, 1)]);
        let problem =
            Plan::of(&job, &Selection { frames: 5..9, ..Selection::ALL }, Holding::Files).unwrap_err();
        assert_eq!(
            problem.to_string(),
            "the job has no frames 5..9: its sensors have at most 5, counted from 0"
        );
    }

    #[test]
    fn shards_part_the_frames_whatever_is_chosen_of_them() {
        let job = job(Length::Frames(37));
        for (frames, count) in [(0..u64::MAX, 3), (0..37, 16), (5..29, 7), (36..37, 2), (0..37, 100)] {
            let whole = items(&job, frames.clone(), Shard::WHOLE);
            let mut parts: Vec<_> =
                (0..count).flat_map(|index| items(&job, frames.clone(), Shard { index, count })).collect();
            parts.sort_by(|a, b| {
                let start = |(sensor, frame): &(usize, u64)| job.capture(*sensor, *frame).start_s;
                start(a).total_cmp(&start(b)).then(a.0.cmp(&b.0))
            });
            assert_eq!(parts, whole, "{frames:?} in {count}");
        }
    }

    #[test]
    fn the_numbers_of_a_sequence_have_the_same_number_of_digits() {
        let first = |frames: u64| {
            let job = job(Length::Frames(frames));
            let plan = Plan::of(&job, &Selection { frames: 7..8, ..Selection::ALL }, Holding::Files).unwrap();
            let item = plan.items(&job).next().unwrap();
            item.outputs.into_iter().map(|output| output.name).collect::<Vec<_>>()
        };
        assert_eq!(first(8), ["front/000007.exr", "front/000007.png"]);
        assert_eq!(first(1_000_000), ["front/000007.exr", "front/000007.png"]);
        assert_eq!(first(1_000_001), ["front/0000007.exr", "front/0000007.png"]);
    }

    #[test]
    fn a_plan_knows_its_files_without_a_list() {
        let job = job(Length::Frames(12));
        let shard = Shard { index: 1, count: 5 };
        for selection in
            [Selection::ALL, Selection { frames: 3..8, shard }, Selection { frames: 0..12, shard }]
        {
            let plan = Plan::of(&job, &selection, Holding::Files).unwrap();
            let names: Vec<String> =
                plan.items(&job).flat_map(|item| item.outputs).map(|output| output.name).collect();
            for sensor in ["top", "front", "rear"] {
                for (frame, ending) in
                    (0..20).flat_map(|frame| [(frame, "exr"), (frame, "png"), (frame, "ply")])
                {
                    let name = format!("{sensor}/{frame:06}.{ending}");
                    assert_eq!(plan.contains(&name), names.contains(&name), "{name} {selection:?}");
                }
            }
            for name in ["top/00003.exr", "top/0000003.exr", "top/+00003.exr", "top", "top/", "000003.exr"] {
                assert!(!plan.contains(name), "{name}");
            }
            assert_eq!(plan.contains("manifest.json"), selection.shard == Shard::WHOLE);
        }
    }

    #[test]
    fn a_duration_has_the_frames_that_start_within_it() {
        let frames = |duration_s| {
            let job = job(Length::Duration(duration_s));
            [0, 1].map(|sensor| job.sequence.frames_of(&job.sensors[sensor].sensor))
        };
        assert_eq!(frames(0.1), [1, 3]);
        assert_eq!(frames(0.1 + 1e-9), [2, 3]);
        assert_eq!(frames(1e-9), [1, 1]);
        for tenths in 1..2000_u64 {
            let duration_s = tenths as f64 / 10.0;
            assert_eq!(frames(duration_s)[0], tenths, "{duration_s} s");
        }
    }
}
