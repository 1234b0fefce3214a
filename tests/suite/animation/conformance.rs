//! Third-party files against the reading of `keyframes`. The files are not part of the project; BEAMCAST_CORPUS names their
//! folder.

use beamcast::scene::gltf::{Clips, Options, load};
use glam::DVec3;

use super::keyframes::Reading;
use super::{plain, world_at};

const FILES: [&str; 10] = [
    "InterpolationTest/glTF-Binary/InterpolationTest.glb",
    "BoxAnimated/glTF-Binary/BoxAnimated.glb",
    "RiggedSimple/glTF-Binary/RiggedSimple.glb",
    "RiggedFigure/glTF-Binary/RiggedFigure.glb",
    "SimpleMorph/glTF-Embedded/SimpleMorph.gltf",
    "SimpleSkin/glTF-Embedded/SimpleSkin.gltf",
    "AnimatedMorphCube/glTF-Binary/AnimatedMorphCube.glb",
    "AnimatedMorphCube/glTF-Quantized/AnimatedMorphCube.gltf",
    "Fox/glTF-Binary/Fox.glb",
    "RecursiveSkeletons/glTF-Binary/RecursiveSkeletons.glb",
];

/// The times at which files are compared, as parts of a clip's length: before it, in it, and after it.
const TIMES: [f64; 6] = [-0.1, 0.11, 0.37, 0.5, 0.83, 1.2];

#[test]
fn every_vertex_is_where_the_keyframes_put_it() {
    let Some(corpus) = std::env::var_os("BEAMCAST_CORPUS") else {
        println!("skipped: BEAMCAST_CORPUS not set");
        return;
    };
    for name in FILES {
        let path = std::path::Path::new(&corpus).join("valid/SampleAssets/Models").join(name);
        let reading = Reading::open(&path);
        let clips = reading.json["animations"].as_array().unwrap();
        for (number, clip) in clips.iter().enumerate() {
            let names = clip["name"].as_str().map(|name| vec![name.to_owned()]);
            assert!(names.is_some() || clips.len() == 1, "{name}: clips without names");
            let clips = Clips { names, ..Clips::default() };
            let loaded = load(&path, name, &Options { clips: &clips, ..plain() }).unwrap();
            let length = reading.length(number);
            let mut farthest = 0.0_f64;
            for time in TIMES.map(|part| part * length) {
                let found = world_at(&loaded.scene, time);
                let expected = reading.at(number, time);
                assert_eq!(found.len(), expected.len(), "{name}: meshes");
                for (object, (found, expected)) in found.iter().zip(expected).enumerate() {
                    // A position is rounded to f32 when it is read, with each of its targets, with the weights of its joints, in
                    // the space of the mesh, in that of the bones, and in that of the scene: each time by 2⁻²⁴ of numbers that
                    // are as large as `size`, or a few times that where spaces have origins of their own. There are fewer than 16
                    // such roundings.
                    let tolerance = 16.0 / f64::from(1 << 24) * expected.size.max(1e-3);
                    let mut next = found.iter();
                    for triangle in &expected.triangles {
                        let corners = triangle.map(DVec3::from_array);
                        let [a, b, c] = corners;
                        let Some(nearest) = next.as_slice().first() else {
                            assert!(
                                (b - a).cross(c - a).length() < tolerance,
                                "{name}: a triangle is missing"
                            );
                            continue;
                        };
                        let off = (0..3).map(|i| (nearest[i] - corners[i]).length()).fold(0.0, f64::max);
                        if off > tolerance && (b - a).cross(c - a).length() < tolerance {
                            continue; // It has no area, and was left out.
                        }
                        assert!(
                            off <= tolerance,
                            "{name}, {clips:?}, {time} s, object {object}: off by {off} > {tolerance}"
                        );
                        farthest = farthest.max(off);
                        next.next();
                    }
                    assert_eq!(next.len(), 0, "{name}: more triangles than the file has");
                }
            }
            let movers = &loaded.scene.geometry.movers;
            let bending = movers.iter().filter(|mover| mover.deformer.is_some()).count();
            println!("{name} {number}: {} move, {bending} of them bend; off by {farthest:e}", movers.len());
        }
    }
}
