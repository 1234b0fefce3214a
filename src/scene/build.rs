//! From meshes and where they are placed to a [`Scene`]: one space, one numbering.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::arrangement::{Arrangement, Placement, Scene, crushes_to_a_line, is_invertible};
use super::bounds::Bounds;
use super::corners::MeshCorners;
use super::flatten::{Flattened, Gathered, Numbers, half_step, is_degenerate, rounded};
use super::geometry::{Geometry, Mesh, Part};
use super::mover::{Mover, reach};
use super::regions::{self, Region};
use super::rounding::Rounding;
use super::source::{SceneBuildError, SceneBuilder, SourceInstance, SourceMesh};
use super::steps::origin_step;
use crate::motion::{Link, Motion};

impl SceneBuilder {
    /// Makes the scene: finds its centre, flattens the meshes that are placed once into mesh 0 or, where that would move
    /// vertices too far, into [regions](Geometry::regions), rounds to f32, and leaves out triangles of zero area and the
    /// vertices that no triangle uses.
    pub fn build(mut self) -> Result<Scene, SceneBuildError> {
        let mut uses = vec![0_u32; self.meshes.len()];
        for instance in &self.instances {
            uses[instance.mesh] = uses[instance.mesh].saturating_add(1);
        }
        // A map without a precise inverse (a scale of zero along an axis) leaves no space of its own to trace in, unless it changes.
        let is_shared =
            |i: &SourceInstance| i.changes() || uses[i.mesh] > 1 && is_invertible(&i.world_from_mesh);

        let mut survey = Survey::of(&self, &is_shared)?;
        let Stored { mut centre, mut skipped, mut rounding, regions } = self.store_flat(&survey, &uses)?;
        rounding.file_m = survey.file_m;
        rounding.file_object = survey.file_object as u32;
        let mut regions = regions.into_iter();
        let first = regions.next().unwrap_or_default();
        centre += first.centre;
        let mut next_triangle = first.mesh.triangles.len() as u64;
        let mut meshes = vec![first.mesh];
        let mut placements = vec![Placement::FIXED];
        let mut reach = 0.0_f64;
        for Region { centre: region, mesh } in regions {
            // Both centres are short binary fractions, so this is exact.
            let offset = region - first.centre;
            reach = reach.max(offset.abs().max_element());
            let scene_from_region = DAffine3::from_translation(offset);
            placements.push(Placement::new(meshes.len() as u32, next_triangle as u32, 0, scene_from_region));
            next_triangle += mesh.triangles.len() as u64;
            meshes.push(mesh);
        }
        let regions = meshes.len() as u32;

        // The stored meshes of each source mesh that is shared: one that keeps its shape, and one that bends.
        let mut stored = vec![[None, None]; self.meshes.len()];
        let bending: BTreeSet<usize> =
            self.instances.iter().filter(|i| i.deformer.is_some()).map(|i| i.mesh).collect();
        let is_kept_twice = |i: &SourceInstance| uses[i.mesh] > 1 && bending.contains(&i.mesh);
        let mut movers = Vec::new();
        for index in std::mem::take(&mut survey.shared) {
            let instance = &self.instances[index];
            let kept: &mut Option<Kept> =
                &mut stored[instance.mesh][usize::from(instance.deformer.is_some())];
            let kept = match kept {
                Some(known) => known,
                None => {
                    let source = &mut self.meshes[instance.mesh];
                    let source =
                        if is_kept_twice(instance) { source.clone() } else { std::mem::take(source) };
                    let (mesh, known) = keep(source, index, instance.deformer.is_some())?;
                    meshes.push(mesh);
                    kept.insert(Kept { mesh: (meshes.len() - 1) as u32, ..known })
                }
            };
            skipped += kept.left_out;
            let count = meshes[kept.mesh as usize].triangles.len() as u64;
            if count == 0 {
                continue;
            }
            if next_triangle + count > u64::from(u32::MAX) {
                return Err(SceneBuildError::TooManyTriangles { count: next_triangle + count });
            }
            let scene_from_mesh = DAffine3::from_translation(-centre) * instance.world_from_mesh;
            if !instance.changes() || is_invertible(&scene_from_mesh) {
                placements.push(Placement::new(
                    kept.mesh,
                    next_triangle as u32,
                    index as u32,
                    scene_from_mesh,
                ));
            }
            if instance.changes() {
                let at_rest = || Arc::new(Motion { links: vec![Link::Fixed(instance.world_from_mesh)] });
                movers.push(Mover {
                    mesh: kept.mesh,
                    first_triangle: next_triangle as u32,
                    object: index as u32,
                    motion: instance.motion.clone().unwrap_or_else(at_rest),
                    deformer: instance.deformer.clone(),
                    vertices: kept.vertices.clone(),
                    reach: kept.reach,
                });
            }
            next_triangle += count;
        }
        if next_triangle > u64::from(u32::MAX) {
            return Err(SceneBuildError::TooManyTriangles { count: next_triangle });
        }
        if next_triangle == 0 {
            return Err(SceneBuildError::Empty { skipped });
        }
        let geometry = Geometry {
            centre,
            meshes,
            regions,
            origin_step_m: origin_step(reach),
            rounding,
            objects: self.instances.into_iter().map(|instance| instance.object).collect(),
            groups: self.groups,
            materials: self.materials,
            movers,
            triangle_ids: next_triangle as u32,
            skipped_triangles: skipped,
            files: self.files,
            ..Geometry::default()
        };
        let arrangement = Arrangement { placements, ..Arrangement::default() };
        Ok(Scene { geometry: Arc::new(geometry), arrangement: Arc::new(arrangement), ..Scene::default() })
    }

    /// Stores the meshes that are placed once, in one region or several.
    fn store_flat(&mut self, survey: &Survey, uses: &[u32]) -> Result<Stored, SceneBuildError> {
        let centre = survey.centre;
        let is_large = self.needs_regions(survey);
        let mut stored = Stored { centre, skipped: survey.hidden, ..Stored::default() };
        let mut flat = Region::default();
        let (mut gathered, mut numbers) = (Gathered::default(), Numbers::default());
        for flattened in &survey.flattened {
            let instance = &self.instances[flattened.instance];
            let source = &mut self.meshes[instance.mesh];
            stored.skipped += gathered.add(flattened, source, &instance.world_from_mesh, centre)?;
            if uses[instance.mesh] == 1 {
                *source = SourceMesh::default(); // Frees its memory, which is not needed again.
            }
            if !is_large {
                let all = 0..gathered.triangles.len() as u32;
                let store = |v: u32| rounded(gathered.positions[v as usize]);
                let left_out = gathered.store(all, store, &mut flat.mesh, &mut stored.rounding, &mut numbers);
                stored.skipped += left_out;
                gathered.clear();
                if flat.mesh.positions.len().max(flat.mesh.triangles.len()) > u32::MAX as usize {
                    let count = flat.mesh.triangles.len() as u64;
                    return Err(SceneBuildError::TooManyTriangles { count });
                }
            }
        }
        stored.regions = if is_large {
            let (regions, left_out) = regions::split(&gathered, &mut stored.rounding);
            stored.skipped += left_out;
            regions
        } else {
            vec![flat]
        };
        Ok(stored)
    }

    /// Whether rounding would move a vertex of a mesh that is placed once by more than [`Rounding::LIMIT_M`].
    fn needs_regions(&self, survey: &Survey) -> bool {
        let bounds = survey.flattened.iter().fold(Bounds::EMPTY, |all, one| all.union(one.bounds));
        let reach = (bounds.low - survey.centre).abs().max((bounds.high - survey.centre).abs()).max_element();
        if bounds.is_empty() || half_step(reach as f32) <= Rounding::LIMIT_M {
            return false;
        }
        survey.flattened.iter().any(|flattened| {
            let SourceInstance { mesh, world_from_mesh, .. } = &self.instances[flattened.instance];
            let source = &self.meshes[*mesh];
            let from_mesh = DAffine3::from_translation(-survey.centre) * *world_from_mesh;
            let used = source.triangles().filter(|&t| flattened.counts(source, world_from_mesh, t)).flatten();
            let mut errors = used.map(|v| rounded(from_mesh.transform_point3(source.position(v))).1);
            errors.any(|error| error > Rounding::LIMIT_M)
        })
    }
}

/// The meshes that are placed once, as they are stored.
#[derive(Default)]
struct Stored {
    /// The point that the regions' centres count from.
    centre: DVec3,
    regions: Vec<Region>,
    skipped: u64,
    rounding: Rounding,
}

/// What is known of a scene before anything is stored.
struct Survey {
    /// The middle of the bounds of all triangles that have an area and do not move (for a shared mesh: of the corners of its own
    /// bounds), rounded to a multiple of a power of two that is at most a sixteenth of the largest half extent. So vertices with short
    /// coordinates, as people and exporters write them, are stored exactly, and a scene that is centred on its own origin
    /// stays there.
    centre: DVec3,
    /// The instances that are flattened, and those that stay in their own space.
    flattened: Vec<Flattened>,
    shared: Vec<usize>,
    /// The number of triangles of instances that are scaled to nothing.
    hidden: u64,
    /// As in [`Rounding`].
    file_m: f64,
    file_object: usize,
}

impl Survey {
    fn of(
        builder: &SceneBuilder,
        is_shared: &dyn Fn(&SourceInstance) -> bool,
    ) -> Result<Self, SceneBuildError> {
        let mut survey = Self {
            centre: DVec3::ZERO,
            flattened: Vec::new(),
            shared: Vec::new(),
            hidden: 0,
            file_m: 0.0,
            file_object: 0,
        };
        // The bounds and the rounding of each shared mesh.
        let mut own = vec![None; builder.meshes.len()];
        let (mut all, mut moving) = (Bounds::EMPTY, Bounds::EMPTY);
        let (mut farthest, mut largest) = (0, 0.0);
        for (index, instance) in builder.instances.iter().enumerate() {
            let source = &builder.meshes[instance.mesh];
            let map = &instance.world_from_mesh;
            if crushes_to_a_line(map) && !instance.changes() {
                // Scaling to nothing is a way to hide an object. It costs no memory, however many objects are hidden so.
                survey.hidden += source.triangle_count();
                continue;
            }
            let (bounds, error) = if is_shared(instance) {
                survey.shared.push(index);
                let (bounds, error): (Bounds, f64) = *own[instance.mesh].get_or_insert_with(|| {
                    let solid = || source.triangles().filter(|&t| !is_degenerate(source.corners(t)));
                    let corners = solid().flatten().map(|v| source.position(v));
                    (corners.fold(Bounds::EMPTY, Bounds::with), source.rounding(solid()))
                });
                let corners = bounds.corners().filter(|_| !bounds.is_empty());
                (corners.map(|p| map.transform_point3(p)).fold(Bounds::EMPTY, Bounds::with), error)
            } else {
                let flattened = Flattened::new(index, source, map);
                let error = source.rounding(source.triangles().filter(|&t| flattened.counts(source, map, t)));
                let bounds = flattened.bounds;
                survey.flattened.push(flattened);
                (bounds, error)
            };
            if bounds.is_empty() {
                continue;
            }
            if bounds.largest() > largest {
                (farthest, largest) = (index, bounds.largest());
            }
            match instance.changes() {
                true => moving = moving.union(bounds),
                false => all = all.union(bounds),
            }
            let m = &map.matrix3;
            let stretch = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
            if error * stretch > survey.file_m {
                (survey.file_m, survey.file_object) = (error * stretch, index);
            }
        }
        let both = all.union(moving);
        if !both.is_empty() {
            let half_extent = both.half_extent();
            // In this form an infinite extent, and one that is no number, is too large.
            let in_reach = half_extent <= SceneBuilder::MAX_COORDINATE_M;
            if !in_reach {
                let SourceInstance { mesh, world_from_mesh, .. } = &builder.instances[farthest];
                let position = builder.meshes[*mesh].farthest(world_from_mesh);
                return Err(SceneBuildError::TooFar { instance: farthest, position });
            }
            // What moves is stored in spaces of its own, so it does not count unless there is nothing else.
            let counts = if all.is_empty() { moving } else { all };
            survey.centre = centre_of(&counts);
        }
        Ok(survey)
    }
}

/// The middle of bounds that are not empty, rounded to a multiple of a power of two that is at most a sixteenth of their largest half
/// extent.
pub(super) fn centre_of(bounds: &Bounds) -> DVec3 {
    bounds.middle(power_of_two_below(bounds.half_extent()) / 16.0)
}

/// The largest power of two that is at most `x`; 0 for 0.
fn power_of_two_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000)
}

/// A mesh that is stored in its own space.
#[derive(Clone)]
struct Kept {
    /// Index into the stored meshes.
    mesh: u32,
    /// The number of triangles that were left out.
    left_out: u64,
    /// As in [`Mover`].
    vertices: Arc<[u32]>,
    reach: f64,
}

/// Makes a mesh of `source` without transforming it. If it bends, a triangle that has no area now may have one later, so only those
/// are left out that never have one.
fn keep(source: SourceMesh, instance: usize, bends: bool) -> Result<(Mesh, Kept), SceneBuildError> {
    let mut mesh = Mesh::default();
    let mut left_out = 0;
    let mut corners = MeshCorners::default();
    let mut is_used = vec![false; source.positions.len()];
    for part in &source.parts {
        let first_triangle = mesh.triangles.len() as u32;
        for (index, &triangle) in part.triangles.iter().enumerate() {
            let [a, b, c] = triangle;
            let is_nothing =
                if bends { a == b || b == c || c == a } else { is_degenerate(source.corners(triangle)) };
            if is_nothing {
                left_out += 1;
                continue;
            }
            for v in triangle {
                SceneBuilder::check_reach(source.position(v), instance)?;
                is_used[v as usize] = true;
            }
            corners.push(mesh.triangles.len(), &part.corners, index, false);
            mesh.triangles.push(triangle);
        }
        if mesh.triangles.len() as u32 > first_triangle {
            mesh.parts.push(Part { first_triangle, material: part.material, object: 0 });
        }
    }
    mesh.corners = Arc::new(corners);
    mesh.positions = source.positions;
    let mut vertices = Vec::new();
    if bends {
        vertices.extend((0..is_used.len() as u32).filter(|&v| is_used[v as usize]));
    }
    if is_used.contains(&false) {
        let mut number = vec![0; is_used.len()];
        let mut next = 0;
        for (number, &is_used) in number.iter_mut().zip(&is_used) {
            *number = next;
            next += u32::from(is_used);
        }
        for triangle in &mut mesh.triangles {
            *triangle = triangle.map(|v| number[v as usize]);
        }
        let mut is_used = is_used.into_iter();
        mesh.positions.retain(|_| is_used.next() == Some(true));
        mesh.positions.shrink_to_fit();
    }
    let kept = Kept { mesh: 0, left_out, vertices: vertices.into(), reach: reach(&mesh.positions) };
    Ok((mesh, kept))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::flatten::f64_from;
    use crate::scene::{Material, SourcePart};

    fn square() -> SourceMesh {
        SourceMesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            parts: vec![SourcePart {
                triangles: vec![[0, 1, 2], [0, 2, 3], [1, 1, 2]],
                material: 0,
                ..SourcePart::default()
            }],
        }
    }

    fn at(mesh: usize, world_from_mesh: DAffine3) -> SourceInstance {
        SourceInstance { mesh, world_from_mesh, ..SourceInstance::default() }
    }

    fn builder(meshes: Vec<SourceMesh>, instances: Vec<SourceInstance>) -> SceneBuilder {
        SceneBuilder {
            meshes,
            instances,
            materials: vec![Material::default()],
            files: vec![],
            groups: vec![],
        }
    }

    fn moved(x: f64, y: f64, z: f64) -> DAffine3 {
        DAffine3::from_translation(DVec3::new(x, y, z))
    }

    #[test]
    fn a_mesh_placed_once_is_flattened_around_the_centre() {
        let far = DVec3::new(4.5e5, 5.4e6, 200.0);
        let scene = builder(vec![square()], vec![at(0, DAffine3::from_translation(far))]).build().unwrap();
        assert_eq!((scene.geometry.meshes.len(), scene.arrangement.placements.len()), (1, 1));
        assert_eq!(scene.geometry.skipped_triangles, 1);
        assert_eq!(scene.triangle_count(), 2);
        // The offset is not rounded to f32, so corners are exact.
        let corner = scene.geometry.meshes[0].positions[2];
        assert_eq!(scene.geometry.centre + f64_from(corner), far + DVec3::new(1.0, 1.0, 0.0));
        assert!(corner.iter().all(|c| c.abs() <= 0.6));
    }

    #[test]
    fn a_scene_about_its_origin_is_left_where_it_is() {
        let scene = builder(vec![square()], vec![at(0, moved(-0.5, -0.5, 0.0))]).build().unwrap();
        assert_eq!(scene.geometry.centre, DVec3::ZERO);
    }

    #[test]
    fn a_mesh_placed_twice_is_stored_once() {
        let instances =
            vec![at(0, moved(0.0, 0.0, 0.0)), at(1, moved(9.0, 0.0, 0.0)), at(0, moved(0.0, 5.0, 0.0))];
        let scene = builder(vec![square(), square()], instances).build().unwrap();
        assert_eq!(scene.geometry.meshes.len(), 2);
        assert_eq!(scene.geometry.stored_triangle_count(), 4);
        assert_eq!(scene.triangle_count(), 6);
        let firsts: Vec<_> =
            scene.arrangement.placements.iter().map(|p| (p.first_triangle, p.first_object)).collect();
        // Meshes that are placed once come first; objects keep the document's order.
        assert_eq!(firsts, [(0, 0), (2, 0), (4, 2)]);
        assert_eq!(scene.surface(0, 1).object, 1);
        assert_eq!(scene.surface(1, 1).object, 0);
        assert_eq!(scene.surface(2, 0).object, 2);
        // The mesh has one zero-area triangle, which counts each time that it is placed.
        assert_eq!(scene.geometry.skipped_triangles, 3);
    }

    #[test]
    fn mirroring_keeps_fronts_in_front() {
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let scene = builder(vec![square()], vec![at(0, mirror)]).build().unwrap();
        let mesh = &scene.geometry.meshes[0];
        let [a, b, c] = mesh.triangles[0].map(|v| f64_from(mesh.positions[v as usize]));
        assert!((b - a).cross(c - a).z > 0.0, "the square still faces up");
    }

    #[test]
    fn a_placement_that_cannot_be_undone_is_flattened() {
        let crushed = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
        let scene =
            builder(vec![square()], vec![at(0, crushed), at(0, moved(0.0, 0.0, 3.0))]).build().unwrap();
        assert_eq!(scene.arrangement.placements.len(), 2);
        assert_eq!(scene.geometry.meshes[0].triangles.len(), 2);
        assert_eq!(scene.triangle_count(), 4);
        let nothing = DAffine3::from_scale(DVec3::ZERO);
        let error = builder(vec![square()], vec![at(0, nothing), at(0, nothing)]).build().unwrap_err();
        assert_eq!(error, SceneBuildError::Empty { skipped: 6 });
    }

    #[test]
    fn an_instance_scaled_to_nothing_takes_no_part() {
        // A thousand hidden instances far away change neither the centre nor the memory.
        let mut hidden = moved(1e6, 0.0, 0.0) * DAffine3::from_scale(DVec3::new(0.0, 1.0, 0.0));
        hidden.matrix3.z_axis = hidden.matrix3.y_axis;
        let mut instances = vec![at(0, hidden); 1000];
        instances.push(at(0, moved(-0.5, -0.5, 0.0)));
        let scene = builder(vec![square()], instances).build().unwrap();
        assert_eq!(scene.geometry.centre, DVec3::ZERO);
        assert_eq!((scene.triangle_count(), scene.geometry.skipped_triangles), (2, 3001));
        assert_eq!((scene.geometry.objects.len(), scene.arrangement.placements.len()), (1001, 2));
        assert!(scene.geometry.meshes[0].positions.is_empty());
        assert_eq!(scene.surface(1, 0).object, 1000);
    }

    #[test]
    fn a_vertex_too_far_away_is_refused() {
        let mut far = square();
        far.positions[2][0] = 1e13;
        let error = builder(vec![far], vec![at(0, DAffine3::IDENTITY)]).build().unwrap_err();
        assert!(matches!(error, SceneBuildError::TooFar { instance: 0, .. }), "{error}");
        let overflow = DAffine3::from_scale(DVec3::splat(f64::MAX)) * moved(9.0, 9.0, 9.0);
        let error = builder(vec![square()], vec![at(0, overflow)]).build().unwrap_err();
        assert!(matches!(error, SceneBuildError::TooFar { .. }), "{error}");
    }

    #[test]
    fn labels_are_the_jobs_then_the_files() {
        let mut scene = builder(vec![square()], vec![at(0, DAffine3::IDENTITY)]).build().unwrap();
        let surface = scene.surface(0, 0);
        assert_eq!(scene.label(surface), 0);
        Arc::make_mut(&mut scene.geometry).objects[0].file_label = Some(1);
        assert_eq!(scene.label(surface), 1);
        Arc::make_mut(&mut scene.geometry).materials[0].job_label = Some(2);
        assert_eq!(scene.label(surface), 2);
        Arc::make_mut(&mut scene.geometry).objects[0].job_label = Some(3);
        assert_eq!(scene.label(surface), 3);
    }
}
