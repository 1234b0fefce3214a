//! A job with its scene and its tracer, which casts the job's frames.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::paths::tidy;
use super::plan::{Item, Output};
use crate::config::{Job, MountedSensor, OutputSettings};
use crate::error::{Error, SceneError};
use crate::output::{Names, SensorFrame};
use crate::plausibility;
use crate::scan::{self, Frame, Progress};
use crate::scene::{Scene, gltf};
use crate::sensor::Capture;
use crate::source::Diagnostic;
use crate::source::suggest::missing_file_help;
use crate::trace::{AnyTracer, Cast};

/// Reads a job's scene, whose files may lie in its own folder and in those that are allowed besides.
///
/// # Errors
/// With the element of the file that is wrong.
pub fn load_scene(job: &Job, allowed_folders: &[PathBuf]) -> Result<gltf::Loaded, SceneError> {
    let options = gltf::Options {
        scene_name: job.scene_name.as_deref(),
        up: job.up,
        labels: &job.labels,
        allowed_folders,
    };
    open_scene(&job.scene_path, &job.scene_as_written, &options)
}

/// Reads a scene. The error about a scene that isn't there suggests files that are.
///
/// # Errors
/// With the element of the file that is wrong.
pub fn open_scene(
    path: &Path,
    as_written: &str,
    options: &gltf::Options,
) -> Result<gltf::Loaded, SceneError> {
    gltf::load(path, as_written, options).map_err(|error| {
        let shown = tidy(path);
        let help = if path.exists() { None } else { missing_file_help(as_written, &shown) };
        SceneError { path: shown, help: help.or(error.help), ..error }
    })
}

/// A job, ready to be cast: with the tracer of its kernel over its scene. Its clones share everything, and go to any thread.
#[derive(Clone, Debug)]
pub struct Session {
    /// The job.
    pub job: Arc<Job>,
    tracer: AnyTracer,
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
        Self { job: job.into(), tracer }
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
        self.cast_with(&self.tracer, item, progress)
    }

    /// Casts a frame into the memory of an earlier one, which it replaces. Returns false when `progress` was cancelled; the
    /// frame is then of no use.
    pub fn cast_into(&self, frame: &mut Frame, item: &Item, progress: &Progress) -> bool {
        scan::scan_into(frame, self.scene(), &self.tracer, &self.capture(item), progress)
    }

    /// Casts a frame with another tracer over the job's scene. `None` when `progress` was cancelled.
    pub fn cast_with(&self, tracer: &impl Cast, item: &Item, progress: &Progress) -> Option<Frame> {
        scan::scan(self.scene(), tracer, &self.capture(item), progress)
    }

    /// A frame before it is cast: the sensor, its pulses, and where they are sent from.
    pub fn capture(&self, item: &Item) -> Capture<'_> {
        item.capture(&self.job)
    }

    /// A frame that was cast, with everything that is known about where it came from.
    pub fn sensor_frame<'f>(&'f self, item: &Item, frame: &'f Frame) -> SensorFrame<'f> {
        let name = &self.sensor(item).name;
        let names = Names { objects: &self.scene().geometry.objects, labels: Some(&self.job.labels) };
        let OutputSettings { cloud_frame, legend, .. } = self.job.output;
        SensorFrame { capture: self.capture(item), frame, name, cloud_frame, names, legend }
    }

    /// The content of a frame's file.
    ///
    /// # Errors
    /// [`Error::Output`] if the frame does not fit the format.
    pub fn encode(&self, output: &Output, frame: &SensorFrame) -> Result<Vec<u8>, Error> {
        let content = output.format.encode(frame);
        content.map_err(|e| Error::output(self.job.output.dir.join(&output.name), e))
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
