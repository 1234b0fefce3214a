//! The frames, files and memory that a job asks for, found and checked before anything is cast.

use super::memory::{self, Holding};
use crate::config::{Job, MountedSensor};
use crate::error::Error;
use crate::output::{Format, Kind, Manifest};
use crate::scene::Scene;
use crate::sensor::Capture;

/// The frames that a job casts and the files that they become.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The frames, in the order in which they are cast.
    pub items: Vec<Item>,
    /// The files into which all frames go.
    pub streams: Vec<Output>,
    /// Rays of all frames.
    pub rays: u64,
    /// An upper estimate of the memory that the frames take with everything that is made of them, in bytes. The memory of
    /// the scene comes on top.
    pub bytes: u64,
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
    /// The file's path in the output folder, with forward slashes.
    pub name: String,
}

impl Item {
    /// The frame of a job before it is cast: the sensor, its pulses, and where they are sent from.
    pub fn capture<'j>(&self, job: &'j Job) -> Capture<'j> {
        let MountedSensor { sensor, body_from_sensor, .. } = &job.sensors[self.sensor];
        Capture::new(sensor, *body_from_sensor, &job.trajectory, self.frame, job.seed)
    }
}

impl Plan {
    /// Plans a job whose run holds so much in memory at the same time.
    ///
    /// # Errors
    /// [`Error::Usage`] if a frame does not fit one of its formats, or if the frames do not fit into the machine's memory.
    pub fn of(job: &Job, holding: Holding) -> Result<Self, Error> {
        if let Some(problem) = format_problems(job).into_iter().next() {
            return Err(Error::Usage(problem));
        }
        let mut plan = Self { items: Vec::new(), streams: Vec::new(), rays: 0, bytes: 0 };
        for (index, MountedSensor { name, sensor, .. }) in job.sensors.iter().enumerate() {
            let (rows, columns) = (sensor.pattern.rows() as u64, sensor.pattern.columns() as u64);
            let rays = rows.checked_mul(columns).and_then(|rays| plan.rays.checked_add(rays));
            let too_many = || Error::Usage(format!("sensor {name:?} has too many rays: {rows} × {columns}"));
            plan.rays = rays.ok_or_else(too_many)?;
            let alone = memory::of_frames(&job.sensors[index..=index], &job.output.formats, holding);
            memory::check(&format!("a frame of sensor {name:?}"), alone)?;
            let frame = 0;
            let output =
                |&format: &Format| Output { format, name: format!("{name}/{frame:06}.{}", format.ending()) };
            let a_file_a_frame = |format: &&Format| matches!(format.spec.kind, Kind::File(_));
            let outputs = job.output.formats.iter().filter(a_file_a_frame).map(output).collect();
            plan.items.push(Item { sensor: index, frame, outputs });
        }
        let streams = job.output.formats.iter().filter(|format| matches!(format.spec.kind, Kind::Stream(_)));
        plan.streams =
            streams.map(|&format| Output { format, name: format!("run.{}", format.ending()) }).collect();
        plan.bytes = memory::of_tables(&job.sensors).saturating_add(memory::of_frames(
            &job.sensors,
            &job.output.formats,
            holding,
        ));
        memory::check("the rig", plan.bytes)?;
        Ok(plan)
    }

    /// Checks that the scene's labels fit the formats, and that the scene fits into the machine's memory beside the frames.
    ///
    /// # Errors
    /// [`Error::Usage`] with the label, or with the estimate.
    pub fn check_scene(&self, scene: &Scene) -> Result<(), Error> {
        let outputs = self.items.iter().flat_map(|item| &item.outputs).chain(&self.streams);
        if let Some(problem) = label_problem(outputs.map(|output| output.format), scene) {
            return Err(Error::Usage(problem));
        }
        memory::check("the job with its scene", self.bytes.saturating_add(memory::of_scene(scene)))
    }

    /// The paths of all outputs in the output folder; the manifest is the last.
    pub fn output_names(&self) -> Vec<String> {
        let outputs = self.items.iter().flat_map(|item| &item.outputs);
        outputs
            .chain(&self.streams)
            .map(|output| output.name.clone())
            .chain([Manifest::NAME.to_owned()])
            .collect()
    }
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
