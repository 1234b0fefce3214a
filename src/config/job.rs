//! Jobs and sensor files as they are read.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use crate::check::Settings;
use crate::check::expect::Expectation;
use crate::error::Error;
use crate::frame::{Pose, UpAxis};
use crate::motion::{Motion, Trajectory};
use crate::output::{CloudFrame, CloudTime, Format};
use crate::scene::{Environment, Optics};
use crate::sensor::{Capture, Measurement, Published, Sensor};
use crate::source::{Diagnostic, Place};
use crate::trace::methods::Method;
use crate::truth;

/// A job: a rig of sensors, a scene, and the outputs to write.
#[derive(Clone, Debug)]
pub struct Job {
    /// The job's file, as the user named it.
    pub path: PathBuf,
    /// The scene's file, resolved against the job's folder.
    pub scene_path: PathBuf,
    /// The scene's file as the job writes it; the last part of an absolute path.
    pub scene_as_written: String,
    /// The name of one of the file's scenes; its default scene if absent.
    pub scene_name: Option<String>,
    /// The upward axis of the scene's file.
    pub up: UpAxis,
    /// Semantic labels by the names of nodes or materials.
    pub labels: BTreeMap<String, u32>,
    /// How surfaces send light back, by the names of materials, nodes or labels.
    pub materials: Vec<Optics>,
    /// The air and the sun.
    pub environment: Environment,
    /// The seed of all random numbers.
    pub seed: u64,
    /// The method that decides what a beam hits; the exact definition if absent.
    pub kernel: Option<&'static Method>,
    /// The rig; at least one sensor.
    pub sensors: Vec<MountedSensor>,
    /// The pose of the body in the world over time.
    pub trajectory: Trajectory,
    /// What moves in the scene along trajectories.
    pub actors: Vec<Actor>,
    /// How the scene's own clips play.
    pub animation: Animation,
    /// The places that the scene's file decides: until [`load_scene`](crate::run::load_scene) has asked it, they are at the world's origin.
    pub from_scene: Vec<FromScene>,
    /// The frames, and their times.
    pub sequence: Sequence,
    /// The outputs to write.
    pub output: OutputSettings,
    /// What is written about frames beside their returns.
    pub truth: TruthSettings,
    /// The channels that are held to the baseline, and how closely: `None` if the job has no `[check]`.
    pub check: Option<Settings>,
    /// The expectations of what the sensors see.
    pub expectations: Vec<Expectation>,
    /// The files that the job was read from, each once: the job's own, then sensor files, then tables of rays.
    pub inputs: Vec<InputFile>,
    /// The job with its sensors' files merged in, as the manifest tells it: the keys that were given, without defaults,
    /// without the output's folder and without absolute paths.
    pub resolved: serde_json::Value,
    /// The values that the job drew, by their keys: those of the run, and in the job of a frame those of the frame. Places of
    /// actors are among them as soon as [`load_scene`](crate::run::load_scene) has found them.
    pub drawn: serde_json::Map<String, serde_json::Value>,
    /// The number of the frames that this is the job of, if it is a job of single frames ([`Job::of_frame`]).
    pub frame: Option<u64>,
    /// The way to the jobs of single frames, if `[random]` draws values for each.
    pub(crate) by_frame: Option<ByFrame>,
    /// Where the values stand in the job's files, for what is found out about them later.
    pub places: Places,
    /// Problems that don't stop the job.
    pub warnings: Vec<Diagnostic>,
}

/// The way from a job to those of its frames.
#[derive(Clone)]
pub(crate) struct ByFrame {
    /// Whether the scene may differ from frame to frame: something else is drawn than of a sensor or the trajectory.
    pub changes_scene: bool,
    /// Makes the job of a frame.
    pub make: Arc<MakeJob>,
}

type MakeJob = dyn Fn(&Job, u64) -> Result<Job, Error> + Send + Sync;

impl fmt::Debug for ByFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ByFrame").field("changes_scene", &self.changes_scene).finish_non_exhaustive()
    }
}

impl Job {
    /// Puts each body and sensor whose place the scene's file decides where it is. The maps to the world are in the order of
    /// [`Job::from_scene`], which is empty then.
    pub(crate) fn settle(&mut self, places: &[Motion]) {
        for (asked, motion) in std::mem::take(&mut self.from_scene).into_iter().zip(places) {
            let trajectory = Trajectory::Chain(Arc::new(motion.clone()));
            match asked.owner {
                Owner::Body => {
                    self.trajectory = trajectory.fixed_pose().map_or(trajectory, Trajectory::Fixed)
                }
                Owner::Sensor(index) => {
                    self.sensors[index].body_from_sensor = trajectory.pose_at(self.sequence.start_s);
                }
            }
        }
    }

    /// A frame of a sensor before it is cast: the sensor, its pulses, and where and when they are sent from.
    pub fn capture(&self, sensor: usize, frame: u64) -> Capture<'_> {
        let index = sensor as u32;
        let MountedSensor { sensor, body_from_sensor, trigger_s, .. } = &self.sensors[sensor];
        Capture::new(sensor, *body_from_sensor, &self.trajectory, frame, self.seed)
            .of_rig(index)
            .in_sequence(self.sequence.start_s + trigger_s, self.sequence.is_frozen)
    }

    /// Whether frames differ from each other by what is drawn for each of them.
    pub fn is_drawn_by_frame(&self) -> bool {
        self.by_frame.is_some() || self.has_places_by_frame()
    }

    /// Whether the scene may differ from frame to frame.
    pub fn has_drawn_scenes(&self) -> bool {
        self.by_frame.as_ref().is_some_and(|frames| frames.changes_scene) || self.has_places_by_frame()
    }

    /// Whether an actor has a place of its own in each frame.
    fn has_places_by_frame(&self) -> bool {
        self.actors.iter().filter_map(|actor| actor.placing.as_ref()).any(|placing| !placing.is_of_run)
    }

    /// The job of the frames of this number: this job, with what its `[random]` draws for them. The places of its actors are drawn
    /// when its scene is loaded.
    ///
    /// # Errors
    /// [`Error::Config`] if a drawn value makes the job invalid, with the key, the value and the frame.
    pub fn of_frame(&self, frame: u64) -> Result<Cow<'_, Self>, Error> {
        let job = match &self.by_frame {
            None if !self.has_places_by_frame() => return Ok(Cow::Borrowed(self)),
            None => self.clone(),
            Some(frames) => (frames.make)(self, frame)?,
        };
        Ok(Cow::Owned(Self { frame: Some(frame), ..job }))
    }
}

/// A thing that moves in the scene along a trajectory.
#[derive(Clone, Debug)]
pub struct Actor {
    /// The name; unique in the job.
    pub name: String,
    /// What moves.
    pub body: ActorBody,
    /// The pose of the thing's own frame in the world over time. If its place is drawn, it is at the world's origin until
    /// [`load_scene`](crate::run::load_scene) has found it one.
    pub trajectory: Trajectory,
    /// How its place is drawn, if it is.
    pub placing: Option<Placing>,
    /// Its semantic label, instead of what the job's labels and the file say.
    pub label: Option<u32>,
    /// Where the job names what moves.
    pub place: Place,
}

/// How the place of an [`Actor`] is drawn: on a surface of the scene, upright, and where it meets nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Placing {
    /// The surface.
    pub on: SurfaceName,
    /// Where the job names the surface.
    pub place: Place,
    /// The part of the surface that counts: from and to along x and y of the world, in metres.
    pub zone_m: [[f64; 2]; 2],
    /// The least and the most yaw, in degrees: so the pose that is drawn can be written into a job, and read as the same bits.
    pub yaw_deg: [f64; 2],
    /// The least distance from the actor's box to the scene and to the boxes of other actors, in metres.
    pub clearance_m: f64,
    /// The height above the actor's origin up to which it meets nothing, in metres.
    pub lift_m: f64,
    /// Whether all frames have the same place.
    pub is_of_run: bool,
}

/// How a job names a surface of its scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SurfaceName {
    /// Objects or materials with this name, where a `*` at the end stands for anything. If there are none: what has the label that
    /// the job's `[labels]` gives this name.
    Name(String),
    /// Everything with this semantic label.
    Label(u32),
}

/// What moves as an [`Actor`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ActorBody {
    /// All of a file.
    File {
        /// The file, resolved against the job's folder.
        path: PathBuf,
        /// The file as the job writes it; the last part of an absolute path.
        as_written: String,
    },
    /// The node of the job's scene with this name, and all below it.
    Node(String),
}

/// The job's `[animation]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// The names of the clips that play, and where each is written; `None`: all clips of the scene.
    pub clips: Option<Vec<(String, Place)>>,
    /// Whether a clip begins again at its end, and has done so before.
    pub is_looped: bool,
    /// The time at which the clips begin, in seconds.
    pub start_s: f64,
}

/// A place that the scene's file decides.
#[derive(Clone, Debug)]
pub struct FromScene {
    /// Whose place it is.
    pub owner: Owner,
    /// What of the scene is there.
    pub wanted: InScene,
    /// Where the job asks for it.
    pub place: Place,
}

/// Whose place a scene's file decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// The body's, over time.
    Body,
    /// That of the sensor with this index, while the body is at the world's origin.
    Sensor(usize),
}

/// A thing of a scene's file whose place is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum InScene {
    /// The node of this name: its motion.
    Node(String),
    /// The camera of this name, or of the node of this name that has a camera: the pose of its body frame, x forward and z up, at
    /// the job's first moment.
    Camera(String),
}

/// Where the values of a job stand in its files.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// The scene's name.
    pub scene: Place,
    /// For each sensor what says where it stands: its pose, else the body's, else the sensor's table.
    pub sensors: Vec<Place>,
    /// The table of each sensor.
    pub tables: Vec<Place>,
    /// The formats.
    pub formats: Vec<Place>,
    /// The expectations.
    pub expectations: Vec<Place>,
}

/// A file that a job was read from, as a manifest lists it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// The name as the user wrote it; the last part of an absolute path, and of the job's own path.
    pub name: String,
    /// The length of the content that was read, in bytes.
    pub bytes: u64,
    /// BLAKE3 of the content that was read, in hexadecimal.
    pub blake3: String,
}

impl InputFile {
    /// The file of this name, which was read once and had this content.
    pub(super) fn new(name: String, content: &[u8]) -> Self {
        let blake3 = blake3::hash(content).to_hex().to_string();
        Self { name, bytes: content.len() as u64, blake3 }
    }
}

/// A sensor of the rig.
#[derive(Clone, Debug)]
pub struct MountedSensor {
    /// The name of the output folder; unique in the job.
    pub name: String,
    /// The sensor.
    pub sensor: Sensor,
    /// Whether it measures by the figures of its preset's data sheet.
    pub is_nominal: bool,
    /// The data sheet of its preset, if the preset has one.
    pub data_sheet: Option<DataSheet>,
    /// The pose of the sensor on the body.
    pub body_from_sensor: Pose,
    /// How much later than the sequence says each frame of this sensor starts, in seconds. A rig's sensors may be triggered
    /// one after the other.
    pub trigger_s: f64,
}

/// The job's `[sequence]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// How many frames there are.
    pub length: Length,
    /// The time at which the first frame starts, in seconds.
    pub start_s: f64,
    /// Whether all pulses of a frame are cast at the frame's start, as if nothing moved during a frame.
    pub is_frozen: bool,
    /// The time whose frame the points of clouds are in.
    pub cloud_time: CloudTime,
    /// The longest time for which a mesh that bends has one shape; a whole frame if absent.
    pub slice_s: Option<f64>,
}

/// How many frames a sequence has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// So many of each sensor, at least 1.
    Frames(u64),
    /// Of each sensor those that start within so many seconds from the sequence's start, by the sensor's own rate.
    Duration(f64),
}

impl Sequence {
    /// The number of frames of a sensor. Without a rate all frames would start at the same time, so there is one.
    pub fn frames_of(&self, sensor: &Sensor) -> u64 {
        match (self.length, sensor.pattern.rate_hz()) {
            (Length::Frames(frames), _) => frames,
            (Length::Duration(_), None) => 1,
            (Length::Duration(duration_s), Some(rate_hz)) => {
                let start_s = |frame| Capture::at_origin(sensor).with_frame(frame).start_s;
                // The start of a frame decides, which is a quotient. The product may be rounded across a whole number.
                let product = libm::ceil((duration_s - start_s(0)) * rate_hz).max(0.0) as u64;
                let near = product.saturating_sub(1)..=product.saturating_add(1);
                near.clone().find(|&frame| start_s(frame) >= duration_s).unwrap_or(*near.end())
            }
        }
    }
}

/// The job's `[output]`.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputSettings {
    /// The folder, resolved against the job's.
    pub dir: PathBuf,
    /// The formats, each once, in the job's order.
    pub formats: Vec<Format>,
    /// The frame of the clouds.
    pub cloud_frame: CloudFrame,
    /// Whether PNG previews have a legend.
    pub legend: bool,
}

/// The job's `[truth]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TruthSettings {
    /// Whether there is a table of poses.
    pub poses: bool,
    /// The objects that there are boxes of, if there are any.
    pub boxes: Option<truth::Choice>,
    /// Whether the boxes of cameras have masks.
    pub masks: bool,
    /// Whether there is a table of what is seen.
    pub visible: bool,
}

/// A sensor file on its own.
#[derive(Clone, Debug)]
pub struct SensorFile {
    /// The file, as the user named it.
    pub path: PathBuf,
    /// The sensor.
    pub sensor: Sensor,
    /// How the sensor measures by its data sheet, if the file has `[nominal]`.
    pub nominal: Option<Nominal>,
    /// The sensor in each of its modes, by their names.
    pub modes: Vec<(String, Sensor)>,
    /// Problems that don't stop a job with it.
    pub warnings: Vec<Diagnostic>,
}

/// How a sensor measures by its data sheet. It measures so where a job says `nominal = true`.
#[derive(Clone, Debug, PartialEq)]
pub struct Nominal {
    /// The data sheet.
    pub data_sheet: DataSheet,
    /// The data sheet's figures, with the sensor's own tables over them.
    pub measurement: Measurement,
}

/// The statements of a data sheet beside the figures by which a sensor measures.
#[derive(Clone, Debug, PartialEq)]
pub struct DataSheet {
    /// The publication.
    pub source: String,
    /// The bounds of what a depth camera finds; none of other sensors.
    pub published: Vec<Published>,
}

/// A file, by its content.
#[derive(Clone, Debug)]
pub enum Config {
    /// A job, with its sensor files.
    Job(Box<Job>),
    /// A sensor file.
    Sensor(Box<SensorFile>),
}
