//! The glTF loader with third-party files. Conforming files load with the right number of triangles, and hostile ones are
//! refused quickly and quietly. The files are not part of the project; BEAMCAST_CORPUS names their folder.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::hostile_scenes::{open, open_in_time};

fn corpus() -> Option<PathBuf> {
    let folder = std::env::var_os("BEAMCAST_CORPUS").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: BEAMCAST_CORPUS not set");
    }
    folder
}

/// The rows of an INDEX.tsv, without the header.
fn index(folder: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(folder.join("INDEX.tsv")).expect("the corpus has an index");
    text.lines().skip(1).map(|line| line.split('\t').map(str::to_owned).collect()).collect()
}

/// The rows of valid/INDEX.tsv that contradict the text of glTF, with the right answers.
const CORRECTIONS: [(&str, Result<u64, &str>); 4] = [
    // The default scene is the second one, whose mesh has two triangles. The index counts all scenes.
    ("SampleAssets/Models/MultipleScenes/glTF-Embedded/MultipleScenes.gltf", Ok(2)),
    // The file has 125 instances of a box. The index ignores EXT_mesh_gpu_instancing.
    ("SampleAssets/Models/SimpleInstancing/glTF-Binary/SimpleInstancing.glb", Ok(125 * 12)),
    // The tool that made the index could not read meshopt's compression.
    ("gltf-transform/packages/extensions/test/in/BoxMeshopt.glb", Ok(12)),
    // The positions are 16-bit integers, without the extension KHR_mesh_quantization that would allow them.
    ("cesium-native/CesiumGltfContent/test/data/cubeQuantized.glb", Err("KHR_mesh_quantization")),
];

#[test]
fn valid_files_load_with_all_their_triangles() {
    let Some(corpus) = corpus() else { return };
    let folder = corpus.join("valid");
    let rows = index(&folder);
    assert!(CORRECTIONS.iter().all(|(name, _)| rows.iter().any(|row| row[0] == *name)));
    let mut wrong = Vec::new();
    for row in rows {
        let name = &row[0];
        let correction = CORRECTIONS.iter().find(|(corrected, _)| corrected == name);
        let expected = correction.map_or_else(|| Ok(row[1].parse().unwrap()), |(_, expected)| *expected);
        // Triangles of zero area are left out of the scene but count here.
        let found =
            open(&folder.join(name)).map(|l| l.scene.triangle_count() + l.scene.geometry.skipped_triangles);
        match (found, expected) {
            (Ok(found), Ok(expected)) if found == expected => {}
            (Err(error), Err(expected)) if error.to_string().contains(expected) => {}
            (found, expected) => wrong.push(format!("{name}: {found:?}, not {expected:?}")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_strip_has_zero_area_triangles_to_join_its_sides() {
    let Some(corpus) = corpus() else { return };
    let path = corpus.join("valid/cesium-native/CesiumGltfContent/test/data/cubeStrip.glb");
    let scene = open(&path).unwrap().scene;
    assert_eq!((scene.triangle_count(), scene.geometry.skipped_triangles), (12, 6));
}

/// Files of malformed/handmade whose faults do not concern the geometry, such as those in names and images.
const HARMLESS: [&str; 10] = [
    "image_absolute.gltf",
    "image_empty.gltf",
    "names_duplicate.gltf",
    "names_hostile.gltf",
    "png_bomb_20000.gltf",
    "png_dim_2p31.gltf",
    "req_instancing.gltf",
    "rotation_unnormalised.gltf",
    "sparse_count_0.gltf",
    "translation_1e39.gltf", // beyond f32, but the scene is moved to its own centre in f64
];

#[test]
fn malformed_files_neither_panic_nor_hang() {
    let Some(corpus) = corpus() else { return };
    let folder = corpus.join("malformed");
    let mut wrong = Vec::new();
    let mut slowest = (Duration::ZERO, String::new());
    for row in index(&folder) {
        let name = &row[0];
        let start = Instant::now();
        let result = open_in_time(&folder.join(name));
        slowest = slowest.max((start.elapsed(), name.clone()));
        if let Err(error) = &result
            && (error.problem.contains("error in beamcast") || error.problem.is_empty())
        {
            wrong.push(error.to_string());
        }
        if let Some(name) = name.strip_prefix("handmade/")
            && result.is_ok() != HARMLESS.contains(&name)
        {
            wrong.push(format!("{name}: {:?}", result.map(|l| l.scene.triangle_count())));
        }
    }
    println!("slowest: {slowest:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
