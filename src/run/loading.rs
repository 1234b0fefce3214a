//! The reading of scenes as jobs have them.

use std::path::{Path, PathBuf};

use super::paths::tidy;
use crate::config::{Actor, ActorBody, Animation, InScene, Job};
use crate::error::SceneError;
use crate::scene::gltf;
use crate::source::suggest::missing_file_help;

/// How the clips of actors' own files play. The names of clips are those of the job's scene: all clips of an actor's file play.
pub(super) fn clips_of_actors(job: &Job) -> gltf::Clips {
    let Animation { is_looped, start_s, .. } = job.animation;
    gltf::Clips { names: None, is_looped, start_s }
}

/// Reads a job's scene with those of its actors that are meant.
///
/// # Errors
/// With the element of the file that is wrong.
pub(super) fn read_scene(
    job: &Job,
    allowed_folders: &[PathBuf],
    is_meant: impl Fn(&Actor) -> bool,
) -> Result<gltf::Loaded, SceneError> {
    let Animation { clips, is_looped, start_s } = &job.animation;
    let names = clips.as_ref().map(|clips| clips.iter().map(|(name, _)| name.clone()).collect());
    let of_scene = gltf::Clips { names, is_looped: *is_looped, start_s: *start_s };
    let of_actors = clips_of_actors(job);
    let actors = job.actors.iter().filter(|actor| is_meant(actor));
    let actors = actors.map(|Actor { name, body, trajectory, label, .. }| {
        let model = match body {
            ActorBody::File { path, as_written } => {
                gltf::Model::File { path, display_name: as_written, clips: &of_actors }
            }
            ActorBody::Node(name) => gltf::Model::Node(name),
        };
        gltf::Actor { name, model, trajectory, label: *label }
    });
    let places = job.from_scene.iter().map(|asked| match &asked.wanted {
        InScene::Node(name) => gltf::Place::Node(name),
        InScene::Camera(name) => gltf::Place::Camera(name),
    });
    let options = gltf::Options {
        scene_name: job.scene_name.as_deref(),
        up: job.up,
        labels: &job.labels,
        optics: &job.materials,
        allowed_folders,
        clips: &of_scene,
        actors: &actors.collect::<Vec<_>>(),
        places: &places.collect::<Vec<_>>(),
        start_s: job.sequence.start_s,
    };
    open_scene(&job.scene_path, &job.scene_as_written, &options)
}

/// Reads a scene. The error about a scene that isn't there suggests files that are.
///
/// # Errors
/// With the element of the file that is wrong.
pub(super) fn open_scene(
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
