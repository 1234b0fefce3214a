//! A job's `[[actor]]` tables and its `[animation]`.

use std::collections::BTreeSet;
use std::path::Path;

use super::super::job::{Actor, ActorBody, Animation};
use super::super::keys::motion::{
    ACTOR_LABEL, ACTOR_NAME, ACTOR_NODE, ACTOR_SCENE, ACTOR_TRAJECTORY, ACTORS, ANIMATION, CLIPS,
    CLIPS_START, LOOP,
};
use super::super::keys::placing::PLACE;
use super::super::plausibility;
use super::super::table::Table;
use super::placing::placing;
use super::pose_files::PoseFiles;
use super::trajectory::{Given, of_actor};
use crate::source::portable;
use crate::source::words::quoted;

/// The actors of a job, each with its trajectory as it is read; of one whose place is drawn, a trajectory that it does not have.
/// Those that have something wrong, which is reported, are left out.
pub(super) fn actors(job: &Table<'_>, files: &PoseFiles, folder: &Path) -> (Vec<Actor>, Vec<Given>) {
    let Some(tables) = job.read(&ACTORS) else { return Default::default() };
    let (mut names, mut nodes) = (BTreeSet::new(), BTreeSet::new());
    let mut found = Vec::new();
    for t in &tables.value {
        let (name, scene, node, label) =
            (t.read(&ACTOR_NAME), t.read(&ACTOR_SCENE), t.read(&ACTOR_NODE), t.read(&ACTOR_LABEL));
        let given = t.read(&ACTOR_TRAJECTORY).map(|t| of_actor(&t.value, files));
        let place = t.read(&PLACE).and_then(|t| placing(&t.value));
        report_ways(t);
        if let Some(name) = name.filter(|name| !names.insert(name.value)) {
            let message = format!("two actors are called {}", quoted(name.value));
            t.report().error(name.span, message, "expected another name", None);
        }
        let (body, span) = match (scene, node) {
            (Some(scene), None) => {
                if let Some(doubt) = plausibility::home_folder(ACTOR_SCENE.name(), scene.value) {
                    t.report().doubt(scene.span, doubt);
                }
                let as_written = portable(scene.value);
                (ActorBody::File { path: folder.join(scene.value), as_written }, scene.span)
            }
            (None, Some(node)) => {
                if !nodes.insert(node.value) {
                    let message = format!("two actors are the node {}", quoted(node.value));
                    t.report().error(node.span, message, "expected another node", None);
                }
                (ActorBody::Node(node.value.to_owned()), node.span)
            }
            (Some(scene), Some(node)) => {
                let span = t.report().later(scene.span, node.span);
                let message = "an actor has a file or is a node of the scene, and this has both";
                t.report().error(span, message, "one too many", None);
                continue;
            }
            (None, None) => {
                if !t.has(&ACTOR_SCENE) && !t.has(&ACTOR_NODE) {
                    let help =
                        "add `scene = \"car.glb\"`, a file, or `node = \"Car\"`, a node of the job's scene";
                    let label = "needs `scene` or `node`";
                    t.report().error(t.span, "`[[actor]]` has nothing that moves", label, Some(help.into()));
                }
                continue;
            }
        };
        if let (ActorBody::Node(_), true) = (&body, t.has(&PLACE)) {
            let help = "give it a file of its own with `scene`, or a `trajectory`";
            let message = "a place is drawn for a file, and this is a node of the scene";
            t.report().error(t.span_of(&PLACE), message, "", Some(help.into()));
        }
        let given = given.or(place.is_some().then(|| Given::at_origin(t.span_of(&PLACE))));
        let (Some(name), Some(given)) = (name, given) else { continue };
        let actor = Actor {
            name: name.value.to_owned(),
            body,
            trajectory: given.trajectory.clone(),
            placing: place,
            label: label.map(|label| label.value),
            place: t.report().place(span),
        };
        found.push((actor, given));
    }
    found.into_iter().unzip()
}

/// Reports an actor that has no way of being somewhere, or two.
fn report_ways(t: &Table<'_>) {
    match [t.has(&ACTOR_TRAJECTORY), t.has(&PLACE)] {
        [false, false] => {
            let help = "add `trajectory = { file = \"car.csv\" }`, or `place = { on = \"floor\" }`, which is drawn at random";
            let label = "needs `trajectory` or `place`";
            t.report().error(t.span, "`[[actor]]` has no `trajectory`", label, Some(help.into()));
        }
        [true, true] => {
            let span = t.report().later(t.span_of(&ACTOR_TRAJECTORY), t.span_of(&PLACE));
            let message = "an actor has a trajectory or stands at a place that is drawn, and this has both";
            t.report().error(span, message, "one too many", None);
        }
        _ => {}
    }
}

/// The job's `[animation]`.
pub(super) fn animation(job: &Table<'_>) -> Animation {
    let Some(t) = job.read(&ANIMATION).map(|t| t.value) else {
        return Animation::default();
    };
    let clips = t.read(&CLIPS).map(|clips| {
        let clips = clips.value.iter().map(|clip| (clip.value.to_owned(), t.report().place(clip.span)));
        clips.collect()
    });
    Animation { clips, is_looped: t.value(&LOOP), start_s: t.value(&CLIPS_START) }
}
