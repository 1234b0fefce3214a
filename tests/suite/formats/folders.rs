//! The folders of data sets: KITTI's and nuScenes'.

use beamcast::output::Format;

use super::{asked, camera, format, frame, lidar, seen};

/// The points of a frame and their labels lie in files of their own, in the same order.
#[test]
fn a_sequence_of_kitti_has_points_and_labels_in_files_of_their_own() {
    let (lidar, camera, frame) = (lidar(), camera(), frame());
    let kitti = format("kitti", "");
    let names = |file| kitti.frame_file(file).unwrap().path.of("top", "000012");
    let all: Vec<String> = (0..kitti.frame_files()).map(names).collect();
    let expected = [
        "top/velodyne/000012.bin",
        "top/labels/000012.label",
        "top/label_2/000012.txt",
        "top/calib/000012.txt",
    ];
    assert_eq!(all, expected);
    assert!(all.iter().all(|name| kitti.frame_of(name) == Some(("top", "000012"))));
    for (sensor, is_camera) in [(&lidar, false), (&camera, true)] {
        let seen = seen(sensor, &frame);
        let [points, labels] = [0, 1].map(|file| kitti.encode_file(file, &seen).unwrap());
        let labels: Vec<u32> =
            labels.chunks(4).map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap())).collect();
        assert_eq!(labels, [1 << 16 | 3, 300 << 16, 2 << 16 | 70, 3 << 16 | 3]);
        let points: Vec<f32> =
            points.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
        let places = [(0, 0, 1.5), (0, 2, 2.0004), (0, 2, 2.75), (1, 2, 70.25)];
        assert_eq!(points.len(), 4 * places.len());
        for (point, (row, column, range_m)) in points.chunks(4).zip(places) {
            let [x, y, z] = seen.point(row, column, range_m).unwrap().to_array().map(|v| v as f32);
            // A camera's optical axis is forward, and its y is down.
            let expected = if is_camera { [z, -x, -y, 0.5] } else { [x, y, z, 0.5] };
            assert_eq!(point, expected);
        }
        for (file, is_made) in [(0, true), (1, true), (2, is_camera), (3, is_camera)] {
            assert_eq!(kitti.makes_frame_file(file, sensor, true), is_made, "{file}");
            assert_eq!(kitti.makes_frame_file(file, sensor, false), file < 2, "{file}");
        }
    }
    assert!(kitti.check_label(65_535).is_ok() && kitti.check_instances(65_535).is_ok());
    let told = [kitti.check_label(65_536), kitti.check_instances(65_536)].map(|e| e.unwrap_err().to_string());
    assert!(told.iter().all(|told| told.contains("at most 65535")), "{told:?}");
    assert!(kitti.loses(&lidar).unwrap().contains("no time"));
}

/// A LiDAR has clouds, a camera pictures, and labels lie beside clouds if they are asked for.
#[test]
fn a_scene_of_nuscenes_has_clouds_and_pictures_and_its_labels_if_asked() {
    let (lidar, camera, frame) = (lidar(), camera(), frame());
    let (plain, labelled) = (format("nuscenes", ""), format("nuscenes", ", lidarseg = true"));
    let made = |format: &Format, sensor| {
        let files = (0..format.frame_files()).filter(|file| format.makes_frame_file(*file, sensor, false));
        files.map(|file| format.frame_file(file).unwrap().path.of("top", "000000")).collect::<Vec<_>>()
    };
    let cloud = "nuscenes/samples/top/000000.pcd.bin";
    assert_eq!(made(&plain, &lidar), [cloud]);
    assert_eq!(made(&labelled, &lidar), [cloud, "nuscenes/lidarseg/v1.0-beamcast/top-000000_lidarseg.bin"]);
    assert_eq!(made(&labelled, &camera), ["nuscenes/samples/top/000000.color.png"]);
    for name in made(&labelled, &lidar) {
        assert_eq!(labelled.frame_of(&name), Some(("top", "000000")));
    }
    let seen = seen(&lidar, &frame);
    let points: Vec<f32> = plain
        .encode(&seen)
        .unwrap()
        .chunks(4)
        .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
        .collect();
    // Rings count from the lowest beam.
    let fields: Vec<_> = points.chunks(5).map(|point| [point[3], point[4]]).collect();
    assert_eq!(fields, [[0.5, 1.0], [0.5, 1.0], [0.5, 1.0], [0.5, 0.0]]);
    let first = seen.point(0, 0, 1.5).unwrap().to_array().map(|v| v as f32);
    assert_eq!(points[..3], first);
    assert_eq!(labelled.encode_file(2, &seen).unwrap(), [3, 0, 70, 3]);
    assert!(plain.check_label(256).is_ok() && labelled.check_label(255).is_ok());
    assert!(labelled.check_label(256).unwrap_err().to_string().contains("at most 255"));
    assert!(plain.loses(&camera).unwrap().contains("without depth"));
    let refused = asked("[{ format = \"nuscenes\", scene = \"\" }]").unwrap_err();
    assert!(refused.contains("`scene` is an empty string"), "{refused}");
}
