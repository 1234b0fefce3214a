//! Scenes too large for one centre: vertices keep their digits, regions have no seams, and nothing else changes.

use beamcast::rng::Rng;
use beamcast::scene::{
    Material, Object, Rounding, Scene, SceneBuilder, SourceInstance, SourceMesh, SourcePart,
};
use beamcast::trace::{BruteForce, Origins, Rays, Tracer};
use glam::{DAffine3, DVec3};

use crate::shapes::{alone, cuboid, mesh, placed, quad, soup, sphere};
use crate::trace::{agrees, cast, rotated, target, tracers};

/// A place with coordinates counted from the middle of the Earth, and one in a national grid.
const EARTH: DVec3 = DVec3::new(6_378_137.137, 2_345_678.291, 1_234_567.413);
const GRID: DVec3 = DVec3::new(501_234.567, 5_412_345.678, 432.1);

fn at(place: DVec3) -> DAffine3 {
    DAffine3::from_translation(place)
}

/// A square wall that faces −x, 5 m ahead of the place that it is put to.
fn wall() -> SourceMesh {
    quad([(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)].map(|(y, z)| DVec3::new(5.0, y, z)))
}

/// A level grid of squares with whole coordinates, so that the file rounds nothing.
fn level_grid(cells: u32, size: f32) -> SourceMesh {
    let mut grid = mesh(vec![], vec![]);
    let half = cells as f32 * size / 2.0;
    for y in 0..=cells {
        for x in 0..=cells {
            grid.positions.push([x as f32 * size - half, y as f32 * size - half, 0.0]);
        }
    }
    for y in 0..cells {
        for x in 0..cells {
            let at = |dx: u32, dy: u32| (y + dy) * (cells + 1) + x + dx;
            grid.parts[0].triangles.extend([[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]);
        }
    }
    grid
}

/// Looks along x from a place, and returns the range of what is there.
fn range_ahead(scene: &Scene, from: DVec3) -> f64 {
    let directions = [DVec3::new(1.0, 0.01, 0.02), DVec3::X];
    let hits = cast(&Tracer::build(scene), &Rays::unlimited(Origins::Common(from), &directions));
    let [oblique, ahead] = [0, 1].map(|ray| hits[ray].expect("the ray meets the wall").t);
    // The wall is square to x, along which both directions have the length 1.
    assert!((oblique - ahead).abs() < 1e-6, "{oblique} {ahead}");
    ahead
}

/// The cases farfrac_plus_degenerate_origin, utm_plus_degenerate_origin and prec_single_degtri, and their neighbours.
#[test]
fn triangles_without_area_move_nothing() {
    let zero = DVec3::ZERO;
    let somewhere = DVec3::new(5e6, -3.0, 1e3);
    // Three equal corners, two equal corners, and three corners on a line.
    for corners in [[zero; 3], [zero, DVec3::X, DVec3::X], [zero, DVec3::X, DVec3::X * 3.0], [somewhere; 3]] {
        let corners = corners.map(|c| c.as_vec3().to_array());
        for place in [EARTH, GRID] {
            let flat = mesh(corners.to_vec(), vec![[0, 1, 2]]);
            let turned = rotated(DVec3::new(1.0, 2.0, 3.0), 0.7, DVec3::ONE, DVec3::ZERO);
            let mut in_one = wall();
            in_one.positions.extend(corners);
            in_one.parts[0].triangles.push([4, 5, 6]);
            for scene in [
                placed(vec![wall(), flat.clone()], vec![(0, at(place)), (1, DAffine3::IDENTITY)]),
                placed(vec![wall(), flat], vec![(0, at(place)), (1, turned)]),
                placed(vec![in_one.clone()], vec![(0, at(place))]),
                placed(
                    vec![in_one.clone(), level_grid(1, 1.0)],
                    vec![(0, at(place)), (0, at(place + DVec3::Y)), (1, at(place))],
                ),
            ] {
                assert!((range_ahead(&scene, place) - 5.0).abs() < 1e-6);
                assert_eq!(scene.geometry.regions, 1);
                assert!(scene.geometry.skipped_triangles >= 1);
                assert!((scene.geometry.centre - place).length() < 10.0, "{}", scene.geometry.centre);
                assert_eq!(scene.geometry.rounding.crushed_triangles, 0);
            }
        }
    }
}

/// The case farfrac_plus_small_origin.
#[test]
fn one_far_triangle_costs_the_others_nothing() {
    let small = mesh(vec![[0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]], vec![[0, 1, 2]]);
    for place in [EARTH, GRID, DVec3::new(0.0, 2e9, 0.3)] {
        let scene = placed(vec![wall(), small.clone()], vec![(0, at(place)), (1, DAffine3::IDENTITY)]);
        assert_eq!((scene.geometry.regions, scene.geometry.skipped_triangles), (2, 0));
        // Half the last digit of f64 at the place, for the wall, the sensor and the scene's centre.
        let digit = f64::EPSILON * place.abs().max_element();
        assert!((range_ahead(&scene, place) - 5.0).abs() < 1e-6 + 2.0 * digit);
        assert!((range_ahead(&scene, DVec3::new(-0.7, 0.0123, 0.0234)) - 0.7).abs() < 1e-6 + 2.0 * digit);
        assert!(scene.geometry.rounding.stored_m < 1e-6);
    }
}

/// The case extent_unused_vertex, for a mesh that is placed once and one that is placed twice.
#[test]
fn vertices_that_no_triangle_uses_are_not_stored() {
    let mut spare = wall();
    spare.positions.insert(0, [1000.0, 0.0, f32::NAN]);
    spare.positions.push([1e30, 0.0, 0.0]);
    spare.parts[0].triangles = vec![[1, 2, 3], [1, 3, 4]];
    let once = placed(vec![spare.clone()], vec![(0, DAffine3::IDENTITY)]);
    assert_eq!(once.geometry.meshes[0].positions.len(), 4);
    let twice = placed(vec![spare], vec![(0, DAffine3::IDENTITY), (0, at(DVec3::Z * 10.0))]);
    assert_eq!(twice.geometry.meshes[1].positions.len(), 4);
    for scene in [once, twice] {
        assert!((scene.geometry.centre.x - 5.0).abs() < 1.0);
        assert_eq!(range_ahead(&scene, DVec3::ZERO), 5.0);
    }
}

/// A wall of 12 km, as one mesh of small triangles that are parallel to no axis, and the plane that it is in.
#[test]
fn one_mesh_of_many_kilometres_is_as_precise_as_its_regions() {
    let grid = level_grid(40, 300.0);
    for place in [EARTH, GRID, DVec3::ZERO] {
        let map = rotated(DVec3::new(1.0, 2.0, -0.5), 0.8, DVec3::ONE, place);
        let scene = placed(vec![grid.clone()], vec![(0, map)]);
        assert!(scene.geometry.regions > 10, "{}", scene.geometry.regions);
        assert_eq!((scene.triangle_count(), scene.geometry.skipped_triangles), (3200, 0));
        let rounding = scene.geometry.rounding.stored_m;
        assert!(rounding > 1e-6 && rounding <= 1.0 / f64::from(1 << 15), "{rounding:e}");
        let normal = map.matrix3 * DVec3::Z;
        let mut random = Rng::new(3);
        let mut hits = 0;
        for _ in 0..40 {
            let over = DVec3::new(random.signed() * 5990.0, random.signed() * 5990.0, 0.0);
            let origin = map.transform_point3(over + DVec3::Z * (1.0 + 200.0 * random.unit()));
            let directions: Vec<_> = (0..40).map(|_| (random.point() * 0.7 - normal).normalize()).collect();
            let rays = Rays::unlimited(Origins::Common(origin), &directions);
            for (hit, d) in cast(&Tracer::build(&scene), &rays).into_iter().zip(&directions) {
                let t = normal.dot(place - origin) / normal.dot(*d);
                let Some(hit) = hit else { continue };
                hits += 1;
                // The vertices' rounding along the normal, and f64's at such coordinates.
                let bound = 3_f64.sqrt() * rounding + 8.0 * f64::EPSILON * (place.abs().max_element() + 6e3);
                assert!((hit.t - t).abs() <= bound / normal.dot(*d).abs(), "{} {t}", hit.t);
            }
        }
        assert!(hits > 1200, "{hits}");
    }
}

/// A closed sphere whose triangles have all sizes: some have been divided near a corner, so that triangles of a metre share
/// vertices and edges with triangles of kilometres.
fn uneven_sphere(radius: f64) -> SourceMesh {
    let mut shape = sphere(radius, DVec3::ZERO, 2);
    let mut triangles = std::mem::take(&mut shape.parts[0].triangles);
    for index in (0..triangles.len()).step_by(5) {
        let [a, b, c] = triangles[index];
        let point = |v: u32| DVec3::from(shape.positions[v as usize].map(f64::from));
        let near = |towards: DVec3| {
            let p = point(a) + (towards - point(a)) * (2.0 / radius);
            (p * (radius / p.length())).as_vec3().to_array()
        };
        let middle = (point(b) + point(c)) / 2.0;
        let positions = [near(middle), near((point(c) + middle) / 2.0)];
        let p = shape.positions.len() as u32;
        shape.positions.extend(positions);
        let q = p + 1;
        triangles[index] = [a, b, p];
        triangles.extend([[b, c, p], [a, p, q], [p, c, q], [c, a, q]]);
    }
    shape.parts[0].triangles = triangles;
    shape
}

/// Splits a mesh's vertices, so that no two triangles share an index, as exporters do along seams.
fn unindexed(mesh: &SourceMesh) -> SourceMesh {
    let triangles = &mesh.parts[0].triangles;
    let positions = triangles.iter().flatten().map(|&v| mesh.positions[v as usize]).collect();
    let count = triangles.len() as u32;
    crate::shapes::mesh(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

#[test]
fn closed_meshes_have_no_leaks_between_regions() {
    let mut random = Rng::new(71);
    for (shape, radius) in
        [(sphere(4e3, DVec3::ZERO, 3), 4e3), (uneven_sphere(5e3), 5e3), (unindexed(&uneven_sphere(3e5)), 3e5)]
    {
        for offset in [DVec3::ZERO, EARTH] {
            let map = rotated(random.direction(), random.unit(), DVec3::ONE, offset);
            let scene = placed(vec![shape.clone()], vec![(0, map)]);
            assert!(scene.geometry.regions > 4, "{}", scene.geometry.regions);
            for (name, tracer) in tracers(&scene) {
                for batch in 0..12 {
                    let origin = offset + random.point() * radius * 0.5;
                    let directions: Vec<_> = (0..128).map(|_| target(&scene, &mut random) - origin).collect();
                    let origins: Vec<_> =
                        directions.iter().map(|_| origin + random.point() * radius * 1e-5).collect();
                    let origins =
                        if batch % 2 == 0 { Origins::Common(origin) } else { Origins::Each(&origins) };
                    let hits = cast(&tracer, &Rays::unlimited(origins, &directions));
                    if let Some(leak) = hits.iter().position(Option::is_none) {
                        panic!("{name}: radius {radius}, from {origin:?} along {:?}", directions[leak]);
                    }
                }
            }
        }
    }
}

/// Regions, meshes that are placed more than once, and an empty place between them.
fn mixed() -> Scene {
    let turn = rotated(DVec3::new(1.0, 1.0, 0.3), 0.4, DVec3::ONE, GRID);
    placed(
        vec![level_grid(20, 300.0), sphere(40.0, DVec3::ZERO, 1), soup(&mut Rng::new(2), 60, 1.0), wall()],
        vec![
            (0, turn),
            (1, turn * at(DVec3::new(2000.3, 10.7, 30.1))),
            (1, turn * at(DVec3::new(-2900.1, -150.9, 10.2))),
            (2, turn * at(DVec3::new(2000.7, 60.1, 60.6)) * DAffine3::from_scale(DVec3::splat(40.0))),
            (3, at(GRID + DVec3::new(0.0, 0.0, 9e4))),
        ],
    )
}

#[test]
fn regions_agree_with_brute_force() {
    let scene = mixed();
    assert!(scene.geometry.regions > 4 && scene.geometry.meshes.len() > scene.geometry.regions as usize);
    assert!(agrees(&scene, 40, 5, 500.0) > 500);
    assert!(agrees(&alone(uneven_sphere(2e4)), 20, 6, 1e4) > 500);
    // From so far away that a coordinate of the origin has fewer digits than those of the regions.
    let far = DVec3::new(3e11, -2e11, 1e11) + GRID;
    let mut random = Rng::new(8);
    let directions: Vec<_> = (0..64).map(|_| (target(&scene, &mut random) - far).normalize()).collect();
    let rays = Rays::unlimited(Origins::Common(far), &directions);
    for (name, tracer) in tracers(&scene) {
        assert_eq!(cast(&tracer, &rays), cast(&BruteForce(&scene), &rays), "{name}");
    }
}

/// Every triangle keeps its object and material, and ids count up without a gap.
#[test]
fn triangles_keep_their_surfaces_in_regions() {
    let shape = |material: u32| {
        let mut grid = level_grid(12, 500.0);
        let second = grid.parts[0].triangles.split_off(100);
        grid.parts[0].material = material;
        grid.parts.push(SourcePart { triangles: second, material: 2, ..SourcePart::default() });
        grid
    };
    let turn = |z: f64| rotated(DVec3::new(0.2, 0.1, 1.0), 0.3, DVec3::ONE, EARTH + DVec3::Z * z);
    let instance = |mesh: usize, z: f64| SourceInstance {
        mesh,
        world_from_mesh: turn(z),
        object: Object { name: format!("{z}"), ..Object::default() },
        ..SourceInstance::default()
    };
    let builder = SceneBuilder {
        meshes: vec![shape(0), shape(1)],
        instances: vec![instance(0, 0.0), instance(1, 40.0)],
        materials: vec![Material::default(); 3],
        files: vec![],
        groups: vec![],
    };
    let scene = builder.build().unwrap();
    assert!(scene.geometry.regions > 4);
    let mut next = 0;
    let mut counts = std::collections::BTreeMap::new();
    for (index, placement) in scene.arrangement.placements.iter().enumerate() {
        assert_eq!(placement.first_triangle, next);
        let mesh = scene.mesh(placement.mesh);
        next += mesh.triangles.len() as u32;
        for triangle in 0..mesh.triangles.len() as u32 {
            let surface = scene.surface(index as u32, triangle);
            *counts.entry((surface.object, surface.material)).or_insert(0) += 1;
            // The two grids are 40 m apart along z.
            let corners = mesh.triangles[triangle as usize].map(|v| {
                let p = DVec3::from(mesh.positions[v as usize].map(f64::from));
                let world = placement.scene_from_mesh().transform_point3(p) + scene.geometry.centre;
                turn(40.0 * f64::from(surface.object)).inverse().transform_point3(world).z
            });
            assert!(corners.iter().all(|z| z.abs() < 1e-3), "{corners:?} of {surface:?}");
        }
    }
    let expected = [((0, 0), 100), ((0, 2), 188), ((1, 1), 100), ((1, 2), 188)];
    assert_eq!(counts.into_iter().collect::<Vec<_>>(), expected);
}

#[test]
fn scenes_that_lose_nothing_stay_in_one_region() {
    for scene in [
        alone(cuboid([-3.0; 3], [3.0; 3])),
        // Whole metres have few digits.
        placed(vec![level_grid(10, 2000.0)], vec![(0, at(DVec3::new(5e5, 5.4e6, 430.0)))]),
        // Below 2 km, half a step of f32 is less than the limit.
        placed(vec![sphere(1990.0, DVec3::ZERO, 2)], vec![(0, at(GRID))]),
    ] {
        assert_eq!((scene.geometry.regions, scene.geometry.origin_step_m), (1, 0.0));
        assert_eq!(scene.arrangement.placements.len(), 1);
        assert!(scene.geometry.rounding.stored_m <= Rounding::LIMIT_M);
    }
}

/// Regions cost memory, so there are not many more of them than triangles are worth. What that costs in digits is told.
#[test]
fn a_thin_scatter_of_triangles_makes_few_regions() {
    let mut random = Rng::new(4);
    let mut scatter = mesh(vec![], vec![]);
    for i in 0..3000 {
        let p = (random.point() * 4e6).as_vec3().to_array();
        scatter.positions.extend([p, [p[0] + 9.0, p[1], p[2]], [p[0], p[1] + 9.0, p[2]]]);
        scatter.parts[0].triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let map = rotated(DVec3::new(1.0, 2.0, 0.1), 0.4, DVec3::ONE, DVec3::ZERO);
    let scene = placed(vec![scatter], vec![(0, map)]);
    assert_eq!(scene.geometry.regions, 1024);
    let rounding = scene.geometry.rounding;
    assert!(rounding.stored_m > Rounding::LIMIT_M && rounding.stored_m < 0.02, "{rounding:?}");
    assert_eq!(rounding.notices(|_| String::new()).len(), 2, "{rounding:?}");
}

/// A long triangle is rounded as its size demands, and small ones beside it are not.
#[test]
fn a_long_triangle_is_rough_and_its_neighbours_are_not() {
    let long = quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0)));
    let stretch = rotated(DVec3::new(1.0, 2.0, 3.0), 0.1, DVec3::splat(61_234.567), GRID);
    let place = GRID + DVec3::new(40_000.123, 41_000.456, 50_000.789);
    let scene = placed(vec![long, wall()], vec![(0, stretch), (1, at(place))]);
    assert!((range_ahead(&scene, place) - 5.0).abs() < 1e-6);
    let rounding = scene.geometry.rounding;
    assert!(rounding.stored_m > Rounding::LIMIT_M && rounding.stored_m < 0.005, "{rounding:?}");
    assert_eq!(rounding.stored_object, 0);
    let notices = rounding.notices(|object| format!("object {object}"));
    assert_eq!(notices.len(), 1);
    assert!(notices[0].to_string().starts_with("object 0: vertices are rounded by up to "), "{}", notices[0]);
}

/// The case far_f32_vertices: the file's own numbers have no more digits, which is told; short numbers lose none.
#[test]
fn the_rounding_of_the_file_is_told() {
    let of = |x: f32, scale: f64| {
        let corners = [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        let scene = placed(
            vec![mesh(corners.to_vec(), vec![[0, 1, 2]])],
            vec![(0, DAffine3::from_scale(DVec3::splat(scale)))],
        );
        (scene.geometry.rounding.file_m, scene.geometry.rounding.notices(|_| "node 0".to_owned()))
    };
    let (error, notices) = of(12_958_101.0, 1.0);
    assert_eq!(error, 0.5);
    assert!(notices[0].to_string().starts_with("node 0: the file's own vertices are off by up to 500.0 mm"));
    assert_eq!(of(12_958_101.0, 1e-3).0, 0.5e-3);
    assert_eq!(of(12_958_096.0, 1.0).1, []);
    assert_eq!(of(5000.0, 1.0), (0.0, vec![]));
    assert_eq!(of(1234.567, 1.0).1, []);
    assert_eq!(of(5234.567, 1.0).1.len(), 1);
}

/// Where a vertex lies on the edge of a longer triangle, exporters close the gap with a triangle of no area. When the mesh is
/// turned and rounded, that has the area of the gap.
#[test]
fn fillers_without_area_still_close_gaps() {
    // A box whose front edge has a vertex in its middle on one side only.
    let mut shape = cuboid([-1.0, -1.0, -1.0], [2.0, 1.0, 1.0]);
    let triangles = &mut shape.parts[0].triangles;
    let place = triangles.iter().position(|t| *t == [0, 2, 1]).unwrap();
    // The edge from 0 to 1 is divided in the triangle [0, 2, 1], and not in its neighbour.
    let middle = [0.37, -1.0, -1.0];
    shape.positions.push(middle);
    triangles[place] = [0, 2, 8];
    triangles.extend([[8, 2, 1], [0, 8, 1]]);
    let mut random = Rng::new(13);
    for offset in [DVec3::ZERO, EARTH] {
        for scale in [1.0, 3e3] {
            let map = rotated(random.direction(), random.unit(), DVec3::splat(scale), offset);
            let scene = placed(vec![shape.clone()], vec![(0, map)]);
            let origin = map.transform_point3(DVec3::new(0.1, 0.2, 0.3));
            let directions: Vec<_> = (0..2000)
                .map(|ray| {
                    let along = DVec3::new(-1.0 + 3.0 * f64::from(ray) / 2000.0, -1.0, -1.0);
                    map.transform_point3(along) - origin + random.point() * scale * 1e-7
                })
                .collect();
            let hits = cast(&Tracer::build(&scene), &Rays::unlimited(Origins::Common(origin), &directions));
            assert!(hits.iter().all(Option::is_some), "scale {scale}");
        }
    }
}
