//! The objects of a job's scene that have boxes and tracks.

use crate::config::Job;
use crate::scene::Scene;
use crate::trace::AnyTracer;
use crate::truth::Targets;

/// The objects of a job's scene that boxes are made for, with a tracer over nothing but them.
#[derive(Debug)]
pub(super) struct Tracked {
    pub targets: Targets,
    /// `None` if there are no boxes to be made.
    pub alone: Option<AnyTracer>,
}

impl Tracked {
    /// `None` if the job asks for no boxes and no tracks.
    pub fn of(job: &Job, scene: &Scene) -> Option<Self> {
        let choice =
            job.truth.boxes.or(job.output.formats.iter().any(|f| f.tells_tracks()).then(Default::default))?;
        let targets = Targets::of(scene, choice);
        let alone = (job.truth.boxes.is_some() && !targets.is_empty()).then(|| {
            let only = scene.only(|object| targets.track_of(object).is_some());
            AnyTracer::build(&only, job.kernel)
        });
        Some(Self { targets, alone })
    }
}
