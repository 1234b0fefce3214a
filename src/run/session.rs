//! A job with its scene and its tracer, which casts the job's frames.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::loading::read_scene;
use super::memory;
use super::places;
use super::plan::{Item, Output};
use super::tracked::Tracked;
use crate::config::{Job, MountedSensor, OutputSettings};
use crate::error::Error;
use crate::output::{LossyContent, Names, SensorFrame};
use crate::plausibility;
use crate::scan::{self, Frame, Progress, Story};
use crate::scene::{Scene, gltf};
use crate::sensor::{Capture, Measurement, Sensor};
use crate::source::Diagnostic;
use crate::trace::{AnyTracer, Cast};

/// Reads a job's scene with its actors, and puts the bodies and sensors of the job whose places the scene decides there. The
/// files may lie in their own scene's folder and in those that are allowed besides.
///
/// The places that the job draws for its actors are found, and are in [`Job::drawn`] then.
///
/// # Errors
/// [`Error::Scene`] with the element of the file that is wrong, and [`Error::Config`] if an actor finds no place.
pub fn load_scene(job: &mut Job, allowed_folders: &[PathBuf]) -> Result<gltf::Loaded, Error> {
    places::draw(job, allowed_folders)?;
    let mut loaded = read_scene(job, allowed_folders, |_| true)?;
    loaded.scene.environment = job.environment;
    job.settle(&loaded.places);
    Ok(loaded)
}

/// A job, ready to be cast: with the tracer of its kernel over its scene. Its clones share everything, and go to any thread.
#[derive(Clone, Debug)]
pub struct Session {
    /// The job.
    pub job: Arc<Job>,
    tracer: AnyTracer,
    /// What boxes and tracks are made for, if the job asks for them.
    pub(super) tracked: Option<Arc<Tracked>>,
}

impl Session {
    /// Builds the tracer of a job over the job's scene.
    pub fn open(job: impl Into<Arc<Job>>, scene: &Scene) -> Self {
        let job = job.into();
        let tracer = AnyTracer::build(scene, job.kernel);
        Self::new(job, tracer)
    }

    /// A job with a tracer that was built for its kernel over its scene. Jobs with the same of both can share it.
    pub fn new(job: impl Into<Arc<Job>>, tracer: AnyTracer) -> Self {
        let job = job.into();
        let tracked = Tracked::of(&job, tracer.scene()).map(Arc::new);
        Self { job, tracer, tracked }
    }

    /// What casts the frames of this number: this session or, if the job draws values for each frame, one of the job with them.
    /// A scene that is drawn is read then; its files may lie in the allowed folders, too.
    ///
    /// # Errors
    /// [`Error::Config`] if a drawn value makes the job invalid or an actor finds no place, [`Error::Scene`] if its scene can't be read, and
    /// [`Error::Usage`] if that does not fit into the machine's memory.
    pub fn of_frame(&self, frame: u64, allowed_folders: &[PathBuf]) -> Result<Cow<'_, Self>, Error> {
        let mut job = match self.job.of_frame(frame)? {
            Cow::Borrowed(_) => return Ok(Cow::Borrowed(self)),
            Cow::Owned(job) => job,
        };
        if !self.job.has_drawn_scenes() {
            return Ok(Cow::Owned(Self::new(job, self.tracer.clone())));
        }
        let scene = load_scene(&mut job, allowed_folders)?.scene;
        memory::check(&format!("the scene of frame {frame}"), memory::of_scene(&scene))?;
        Ok(Cow::Owned(Self::open(job, &scene)))
    }

    /// The job's scene.
    pub fn scene(&self) -> &Scene {
        self.tracer.scene()
    }

    /// Warnings about the job in its scene: it can be run, and is probably not what was meant.
    pub fn doubts(&self) -> Vec<Diagnostic> {
        plausibility::of_job(&self.job, self.scene(), &self.tracer)
    }

    /// What the labels of the scene stand for, in words.
    pub fn label_names(&self) -> BTreeMap<u32, String> {
        self.scene().geometry.label_names(&self.job.labels)
    }

    /// The sensor of an item of the job's plan.
    pub fn sensor(&self, item: &Item) -> &MountedSensor {
        &self.job.sensors[item.sensor]
    }

    /// Casts a frame. `None` when `progress` was cancelled.
    pub fn cast(&self, item: &Item, progress: &Progress) -> Option<Frame> {
        let tracer = self.frame_tracer(item);
        scan::scan(tracer.scene(), &tracer, &self.capture(item), progress)
    }

    /// Casts a frame as if its sensor were ideal: with the same pulses and limits, and the exact range of the first surface on each
    /// ray. `None` when `progress` was cancelled.
    pub fn cast_ideal(&self, item: &Item, progress: &Progress) -> Option<Frame> {
        let tracer = self.frame_tracer(item);
        let sensor = Sensor { measurement: Measurement::default(), ..self.sensor(item).sensor.clone() };
        let capture = Capture { sensor: &sensor, ..self.capture(item) };
        scan::scan(tracer.scene(), &tracer, &capture, progress)
    }

    /// Casts a frame into the memory of an earlier one, which it replaces. It has waveforms if a format of the job tells them. Returns
    /// false when `progress` was cancelled; the frame is then of no use.
    pub fn cast_into(&self, frame: &mut Frame, item: &Item, progress: &Progress) -> bool {
        let tracer = self.frame_tracer(item);
        frame.keep_waveforms(self.job.output.formats.iter().any(|format| format.tells_waveforms()));
        scan::scan_into(frame, tracer.scene(), &tracer, &self.capture(item), progress)
    }

    /// Casts a frame with another tracer over the frame's scene. `None` when `progress` was cancelled.
    pub fn cast_with(
        &self,
        scene: &Scene,
        tracer: &impl Cast,
        item: &Item,
        progress: &Progress,
    ) -> Option<Frame> {
        scan::scan(scene, tracer, &self.capture(item), progress)
    }

    /// The story of the pulse of a pixel of a frame, whose returns are those of the frame that [`Self::cast`] gives. `None` if the
    /// image has no such pixel.
    pub fn explain(&self, item: &Item, row: usize, column: usize) -> Option<Story> {
        let tracer = self.frame_tracer(item);
        scan::explain(tracer.scene(), &tracer, &self.capture(item), row, column)
    }

    /// The tracer for a frame: over the job's scene as it is during that frame.
    pub fn frame_tracer(&self, item: &Item) -> AnyTracer {
        self.arranged(&self.tracer, item)
    }

    /// A tracer over its scene as it is during a frame.
    pub(super) fn arranged(&self, tracer: &AnyTracer, item: &Item) -> AnyTracer {
        let (scene, capture) = (tracer.scene(), self.capture(item));
        if !scene.has_movers() {
            return tracer.clone();
        }
        let arranged = if capture.is_frozen {
            scene.at(capture.start_s)
        } else {
            scene.during(capture.window(), self.job.sequence.slice_s)
        };
        tracer.rearranged(arranged.arrangement)
    }

    /// A frame before it is cast: the sensor, its pulses, and where they are sent from.
    pub fn capture(&self, item: &Item) -> Capture<'_> {
        self.job.capture(item.sensor, item.frame)
    }

    /// A frame that was cast, with everything that is known about where it came from.
    pub fn sensor_frame<'f>(&'f self, item: &Item, frame: &'f Frame) -> SensorFrame<'f> {
        let name = &self.sensor(item).name;
        let names = Names { objects: &self.scene().geometry.objects, labels: Some(&self.job.labels) };
        let OutputSettings { cloud_frame, legend, .. } = self.job.output;
        let cloud_time = self.job.sequence.cloud_time;
        let made = SensorFrame::new(self.capture(item), frame, name);
        let targets = self.tracked.as_ref().map(|tracked| &tracked.targets);
        SensorFrame { cloud_frame, cloud_time, names, legend, targets, ..made }
    }

    /// The content of a frame's file, and the number of the frame's values that the file lost.
    ///
    /// # Errors
    /// [`Error::Output`] if the frame does not fit the format.
    pub fn encode(&self, output: &Output, frame: &SensorFrame) -> Result<LossyContent, Error> {
        let encoded = output.format.encode_counted(output.file, frame);
        encoded.map_err(|e| Error::output(self.job.output.dir.join(&output.name), e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_own_what_they_need_and_go_to_any_thread() {
        // It fails to compile where it fails.
        fn check<T: Clone + Send + Sync + 'static>() {}
        check::<Session>();
    }
}
