//! Actors with files of their own, which are merged into the scene.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DAffine3;

use super::options::{Actor, Clips};
use crate::motion::{Link, Motion, Trajectory};
use crate::scene::geometry::{Group, Object};
use crate::scene::source::{SceneBuilder, SourceInstance, SourceMesh};

/// The files of actors that were read, each once for each way in which its clips are played.
#[derive(Default)]
pub(super) struct Casts {
    casts: Vec<Cast>,
}

/// A file as it stands at the world's origin, in the scene that it was merged into.
struct Cast {
    path: PathBuf,
    clips: Clips,
    /// The instances, with the numbers that meshes have in the scene.
    instances: Vec<SourceInstance>,
    /// The number of the first material of the file in the scene.
    first_material: u32,
    /// The numbers of its meshes in the scene.
    meshes: Vec<usize>,
}

impl Casts {
    /// The number of the cast of a file whose clips are played in this way.
    pub fn find(&self, path: &Path, clips: &Clips) -> Option<usize> {
        self.casts.iter().position(|cast| cast.path == path && cast.clips == *clips)
    }

    /// Adds the content of a file to a scene, but does not place it yet. Meshes are shared with earlier casts of the same file.
    pub fn add(
        &mut self,
        path: &Path,
        clips: &Clips,
        mut content: SceneBuilder,
        scene: &mut SceneBuilder,
    ) -> usize {
        let earlier = self.casts.iter().find(|cast| cast.path == path);
        let first_material = earlier.map_or(scene.materials.len() as u32, |cast| cast.first_material);
        let known: Vec<usize> = earlier.map_or(Vec::new(), |cast| cast.meshes.clone());
        if earlier.is_none() {
            scene.materials.append(&mut content.materials);
        }
        for file in content.files {
            if !scene.files.contains(&file) {
                scene.files.push(file);
            }
        }
        let mut meshes = Vec::with_capacity(content.meshes.len());
        for mut mesh in content.meshes {
            mesh.parts.iter_mut().for_each(|part| part.material += first_material);
            let same = known.iter().find(|&&known| is_same(&scene.meshes[known], &mesh));
            meshes.push(same.copied().unwrap_or_else(|| {
                scene.meshes.push(mesh);
                scene.meshes.len() - 1
            }));
        }
        let instances = content.instances.into_iter();
        let instances = instances.map(|instance| SourceInstance { mesh: meshes[instance.mesh], ..instance });
        let cast = Cast {
            path: path.to_path_buf(),
            clips: clips.clone(),
            instances: instances.collect(),
            first_material,
            meshes,
        };
        self.casts.push(cast);
        self.casts.len() - 1
    }

    /// Places a cast as an actor.
    pub fn place(&self, cast: usize, actor: &Actor, start_s: f64, scene: &mut SceneBuilder) {
        let link = rigid(actor.trajectory);
        let first = scene.instances.len() as u32;
        for instance in &self.casts[cast].instances {
            let from_actor = match &instance.motion {
                Some(motion) => motion.links.clone(),
                None => vec![Link::Fixed(instance.world_from_mesh)],
            };
            let motion = Motion { links: std::iter::once(link.clone()).chain(from_actor).collect() };
            let world_from_mesh = motion.map_at(start_s);
            let is_fixed = motion.links.iter().all(Link::is_fixed);
            scene.instances.push(SourceInstance {
                mesh: instance.mesh,
                world_from_mesh,
                motion: Some(Arc::new(motion)).filter(|_| !is_fixed),
                deformer: instance.deformer.clone(),
                object: object(actor, &instance.object),
            });
        }
        let objects: Vec<u32> = (first..scene.instances.len() as u32).collect();
        let of_first = scene.instances.get(first as usize).map(|instance| &instance.object);
        scene.groups.push(Group {
            name: actor.name.to_owned(),
            label: actor.label.or_else(|| of_first.and_then(|object| object.job_label.or(object.file_label))),
            objects,
            world_from_group: Arc::new(Motion { links: vec![link] }),
        });
    }
}

/// The link of a trajectory.
pub(super) fn rigid(trajectory: &Trajectory) -> Link {
    match trajectory.fixed_pose() {
        Some(pose) => Link::Fixed(DAffine3 { matrix3: pose.rotation, translation: pose.translation }),
        None => Link::Rigid(trajectory.clone()),
    }
}

/// An object of an actor: `car/wheel`, or `car` if it has no name.
fn object(actor: &Actor, object: &Object) -> Object {
    let name = match &object.name[..] {
        "" => actor.name.to_owned(),
        name => format!("{}/{name}", actor.name),
    };
    Object { name, job_label: actor.label.or(object.job_label), ..*object }
}

fn is_same(a: &SourceMesh, b: &SourceMesh) -> bool {
    let bits = |positions: &[[f32; 3]]| -> Vec<u32> {
        positions.as_flattened().iter().map(|x| x.to_bits()).collect()
    };
    let parts = a.parts.iter().zip(&b.parts);
    a.parts.len() == b.parts.len()
        && a.positions.len() == b.positions.len()
        && bits(&a.positions) == bits(&b.positions)
        && parts
            .into_iter()
            .all(|(a, b)| a.material == b.material && a.triangles == b.triangles && a.corners == b.corners)
}
