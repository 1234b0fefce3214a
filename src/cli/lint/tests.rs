//! Tests of what `lint` says.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};

use super::*;
use crate::angle::Angle;
use crate::scene::{Material, Object, SceneBuilder, SourceInstance, SourceMesh, SourcePart};
use crate::sensor::{Beam, RangeLimits, RingOrder};

fn lidar(elevations: &[f64], columns: usize, sector: (f64, f64)) -> Sensor {
    let beam = |(index, e): (usize, &f64)| Beam {
        elevation: Angle::deg(*e),
        azimuth_offset: Angle::default(),
        time_s: index as f64 * 1e-6,
        file_index: index,
    };
    let beams = elevations.iter().enumerate().map(beam).collect();
    let sector = (Angle::deg(sector.0), Angle::deg(sector.1));
    let pattern = Pattern::Rotating(Rotating::new(beams, columns, sector, 10.0).unwrap());
    Sensor { pattern, range: RangeLimits { min_m: 0.5, max_m: 50.0 }, ring: RingOrder::Row }
}

#[test]
fn facts_of_a_lidar() {
    let facts = SensorFacts::new(
        Some("top"),
        &lidar(&[10.0, -20.0, 8.0], 360, (180.0, -180.0)),
        &Format::all().collect::<Vec<_>>(),
    );
    assert_eq!((facts.rows, facts.columns, facts.rays_per_frame), (3, 360, 1080));
    assert_eq!((tidy(facts.horizontal_fov_deg), facts.elevation_deg.map(tidy)), (360.0, [-20.0, 10.0]));
    assert_eq!(facts.azimuth_step_deg.map(tidy), Some(1.0));
    assert_eq!(facts.elevation_step_deg.map(|s| s.map(tidy)), Some([2.0, 28.0]));
    assert_eq!(facts.points_per_second, Some(10_800.0));
    assert_eq!(facts.max_range_m, Some(50.0));
    // The last column fires after 359/360 of a tenth of a second, the last beam 2 µs later.
    assert!((facts.frame_s - (0.1 * 359.0 / 360.0 + 2e-6)).abs() < 1e-12);
    assert_eq!(facts.output_bytes["exr"], 1080 * 40);
    assert_eq!(facts.frame_bytes, 1080 * Frame::BYTES_A_PIXEL as u64);
    let mut text = String::new();
    facts.write(&mut text);
    assert!(text.contains("3 rows × 360 columns, 1,080 rays a frame\n"), "{text}");
    assert!(text.contains("1° × 2° to 28°\n"), "{text}");
}

#[test]
fn facts_of_a_sector_and_of_one_beam() {
    let facts = SensorFacts::new(None, &lidar(&[1.0], 91, (45.0, -45.0)), &[Format::PLY]);
    assert_eq!(tidy(facts.horizontal_fov_deg), 90.0);
    assert_eq!(facts.azimuth_step_deg.map(tidy), Some(1.0));
    assert_eq!(facts.elevation_step_deg, None);
    assert_eq!(facts.output_bytes.len(), 1);
}

#[test]
fn facts_of_a_camera() {
    let pattern = Pattern::Camera(Camera::new((640, 480), (320.0, 240.0), (320.0, 240.0), None).unwrap());
    let sensor = Sensor { pattern, range: RangeLimits::default(), ring: RingOrder::Row };
    let facts = SensorFacts::new(None, &sensor, &Format::all().collect::<Vec<_>>());
    assert_eq!(tidy(facts.horizontal_fov_deg), 90.0);
    assert_eq!(facts.elevation_deg.map(tidy), [-45.0, 45.0]);
    let step = 2.0 * libm::atan(0.5 / 320.0).to_degrees();
    assert!((facts.azimuth_step_deg.unwrap() - step).abs() < 1e-12);
    assert_eq!((facts.max_range_m, facts.points_per_second, facts.frame_s), (None, None, 0.0));
    assert_eq!(facts.output_bytes["exr"], 640 * 480 * 44);
}

#[test]
fn facts_of_a_scene() {
    let part = SourcePart { triangles: vec![[0, 1, 2], [0, 2, 3]], material: 0 };
    let square = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let placed = |label, x| SourceInstance {
        mesh: 0,
        world_from_mesh: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)),
        object: Object { job_label: Some(label), ..Object::default() },
    };
    let builder = SceneBuilder {
        meshes: vec![SourceMesh { positions: square, parts: vec![part] }],
        instances: vec![placed(7, 0.0), placed(3, 2.0), placed(7, 4.0)],
        materials: vec![Material::default()],
        files: vec![],
    };
    let facts = SceneFacts::new("a.glb", &builder.build().unwrap());
    assert_eq!((facts.triangles, facts.stored_triangles, facts.instances), (6, 2, 3));
    assert_eq!(facts.labels, [3, 7]);
    assert_eq!(facts.extent_m, [[0.0, 5.0], [0.0, 1.0], [0.0, 0.0]]);
    let mut text = String::new();
    facts.write(&mut text);
    assert!(text.contains("extent        x 0 to 5, y 0 to 1, z 0 to 0 m\n"), "{text}");
    assert!(text.contains("labels        3, 7\n"), "{text}");
    let json = serde_json::to_value(&facts).unwrap();
    assert_eq!((&json["path"], &json["triangles"]), (&"a.glb".into(), &6.into()));
}

#[test]
fn numbers_are_readable() {
    assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
    assert_eq!(
        [0, 999, 1500, 99_949, 123_456, 2_000_000_000].map(bytes),
        ["0 B", "999 B", "1.5 kB", "99.9 kB", "123 kB", "2.0 GB"]
    );
    assert_eq!(tidy(-0.00001).to_string(), "0");
}

#[test]
fn a_folder_is_walked_in_order_and_everything_wrong_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    let camera = "[pinhole]\nwidth_px = 4\nheight_px = 3\nhfov_deg = 90\n";
    write("sensors/good.toml", camera);
    write("b.toml", &camera.replace("hfov_deg", "hfov_rad"));
    write(".hidden/c.toml", "nonsense");
    write("a.toml", "scene = 'romo.glb'\noutput.dir = 'out'\n[[sensor]]\npreset = 'sensors/good.toml'\n");
    write("room.glb", "");
    let (facts, diagnostics) = examine(&[folder.path().to_path_buf()]);
    assert_eq!(facts.len(), 1);
    assert_eq!((facts[0].kind, facts[0].sensors[0].rays_per_frame), ("sensor", 12));
    let told: BTreeMap<_, _> = diagnostics
        .iter()
        .map(|d| (d.path.file_name().unwrap().to_str().unwrap(), d.help.as_deref().unwrap()))
        .collect();
    let expected =
        [("b.toml", "did you mean `hfov_deg`, in degrees?"), ("romo.glb", "did you mean `room.glb`?")];
    assert_eq!(told, BTreeMap::from(expected));

    let empty = tempfile::tempdir().unwrap();
    let (_, diagnostics) = examine(&[empty.path().to_path_buf()]);
    assert_eq!(diagnostics[0].message, "the folder has no *.toml files");
}
