//! Clouds for surveyors: LAS, LAZ and E57.

use std::fs;
use std::io::Cursor;

use beamcast::frame::Pose;
use beamcast::motion::Trajectory;
use beamcast::output::{CloudFrame, SensorFrame};
use beamcast::scan::{Cause, Frame, Return};
use beamcast::sensor::Capture;
use glam::DVec3;

use super::{Room, f32_at, format, frame, hit, lidar, seen, u32_at};

/// The header and the records of variable length of a LAS, and its points.
fn las(file: &[u8]) -> (&[u8], Vec<&[u8]>) {
    let points = u32_at(file, 96) as usize;
    let length = usize::from(u16::from_le_bytes([file[105], file[106]]));
    assert_eq!((&file[..4], &file[24..26], file[104], u32_at(file, 100)), (&b"LASF"[..], &[1, 4][..], 6, 2));
    (&file[..points], file[points..].chunks(length).collect())
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap())
}

/// Far from the world's origin, coordinates are as exact as near it.
#[test]
fn a_las_has_every_return_in_even_steps() {
    let (sensor, frame) = (lidar(), frame());
    let far = Trajectory::Fixed(Pose { translation: DVec3::new(5e5, 5.4e6, 100.0), ..Pose::IDENTITY });
    let capture = Capture { start_s: 3.0, ..Capture::new(&sensor, Pose::IDENTITY, &far, 0, 0).of_rig(4) };
    let world = SensorFrame { cloud_frame: CloudFrame::World, ..SensorFrame::new(capture, &frame, "top") };
    let file = format("las", ", scale = 0.001").encode(&world).unwrap();
    let (header, points) = las(&file);
    assert_eq!((points.len(), points[0].len()), (4, 30 + 22));
    assert_eq!([131, 155, 163, 171].map(|at| f64_at(header, at)), [0.001, 5e5, 5.4e6, 100.0]);
    let pixels = [(0, 0, 1.5), (0, 2, 2.0004), (0, 2, 2.75), (1, 2, 70.25)];
    for (point, (row, column, range_m)) in points.iter().zip(pixels) {
        let expected = world.point(row, column, range_m).unwrap() - DVec3::new(5e5, 5.4e6, 100.0);
        let steps = [0, 4, 8].map(|at| u32_at(point, at) as i32);
        assert_eq!(steps, (expected / 0.001).round().to_array().map(|step| step as i32));
        assert_eq!(f64_at(point, 22), 3.0 + world.capture.time_s(row, column).unwrap());
        assert_eq!((u32_at(point, 32) as usize, f32_at(point, 44)), (column, range_m as f32));
    }
    assert_eq!(points.iter().map(|p| p[14]).collect::<Vec<_>>(), [0x11, 0x21, 0x22, 0x11]);
    assert_eq!(
        points.iter().map(|p| (p[16], u32_at(p, 40))).collect::<Vec<_>>(),
        [(3, 3), (0, 0), (70, 70), (3, 3)]
    );
    assert_eq!(points.iter().map(|p| u32_at(p, 36)).collect::<Vec<_>>(), [1, 300, 2, 3]);
    assert!(points.iter().all(|p| u16_at(p, 12) == 32768 && u16_at(p, 20) == 5));
}

#[test]
fn labels_that_no_class_holds_are_in_the_extra_dimension_only() {
    let sensor = lidar();
    let bright = Return { intensity: 1.5, ..hit(1.0, 0, 256) };
    let dark = Return { intensity: f32::NAN, ..hit(1.0, 0, 255) };
    let frame = Frame::from_pixels(
        2,
        3,
        [
            (Cause::Surface, &[bright][..]),
            (Cause::Surface, &[dark]),
            (Cause::Nothing, &[]),
            (Cause::Nothing, &[]),
            (Cause::Nothing, &[]),
            (Cause::Nothing, &[]),
        ],
    );
    let file = format("las", "").encode(&seen(&sensor, &frame)).unwrap();
    let points = las(&file).1;
    let label = |point: &&[u8]| (point[16], u32_at(point, 40), u16_at(point, 12));
    assert_eq!(points.iter().map(label).collect::<Vec<_>>(), [(0, 256, 65535), (255, 255, 0)]);
}

/// A LAZ has the records of the LAS, read by LASzip's port.
#[test]
fn a_laz_has_the_points_of_the_las() {
    let (sensor, frame) = (lidar(), frame());
    let seen = seen(&sensor, &frame);
    let [plain, packed] = ["las", "laz"].map(|name| format(name, ", motion = true").encode(&seen).unwrap());
    let points = las(&plain).1.concat();
    let (start, length) = (u32_at(&packed, 96) as usize, usize::from(u16_at(&packed, 53 + 375)));
    assert_eq!((packed[104], &packed[375 + 2..375 + 16]), (0x86, &b"laszip encoded"[..]));
    let description = laz::LazVlr::from_buffer(&packed[375 + 54..][..length]).unwrap();
    let mut cursor = Cursor::new(&packed[..]);
    cursor.set_position(start as u64);
    let mut again = vec![0; points.len()];
    laz::LasZipDecompressor::new(cursor, description).unwrap().decompress_many(&mut again).unwrap();
    assert_eq!(again, points);
}

/// An E57, read by another program.
#[test]
fn an_e57_has_every_return_and_the_pose() {
    let (sensor, frame) = (lidar(), frame());
    let seen = seen(&sensor, &frame);
    let read = |cloud_frame, options: &str| {
        let file = format("e57", options).encode(&SensorFrame { cloud_frame, ..seen }).unwrap();
        e57::E57Reader::new(Cursor::new(file)).unwrap()
    };
    let mut reader = read(CloudFrame::Sensor, ", returns = true, crs = 'LOCAL_CS[\"site\"]'");
    assert_eq!(reader.coordinate_metadata(), Some("LOCAL_CS[\"site\"]"));
    let cloud = reader.pointclouds()[0].clone();
    let points: Vec<e57::RawValues> = reader.pointcloud_raw(&cloud).unwrap().map(Result::unwrap).collect();
    let pixels = [(0, 0, 1.5, [0, 1]), (0, 2, 2.0004, [0, 2]), (0, 2, 2.75, [1, 2]), (1, 2, 70.25, [0, 1])];
    assert_eq!(points.len(), pixels.len());
    for (values, (row, column, range_m, returns)) in points.into_iter().zip(pixels) {
        let [x, y, z] = seen.point(row, column, range_m).unwrap().as_vec3().to_array();
        let time_s = seen.capture.time_s(row, column).unwrap();
        let mut expected: Vec<_> = [x, y, z].map(e57::RecordValue::Single).to_vec();
        expected.extend([e57::RecordValue::Integer(0), e57::RecordValue::Single(0.5)]);
        expected.extend([row, column].map(|index| e57::RecordValue::Integer(index as i64)));
        expected.push(e57::RecordValue::Double(time_s));
        expected.extend(returns.map(e57::RecordValue::Integer));
        assert_eq!(values, expected);
    }
    let (pose, told) = (seen.world_from_sensor(), cloud.transform.unwrap());
    assert_eq!([told.translation.x, told.translation.y, told.translation.z], pose.translation.to_array());
    let q = [told.rotation.x, told.rotation.y, told.rotation.z, told.rotation.w];
    let again = Pose::from_quaternion(pose.translation, q).unwrap();
    assert!(q[3] >= 0.0 && (again.rotation - pose.rotation).abs_diff_eq(glam::DMat3::ZERO, 1e-15));

    let mut reader = read(CloudFrame::World, "");
    let cloud = reader.pointclouds()[0].clone();
    let first = reader.pointcloud_raw(&cloud).unwrap().next().unwrap().unwrap();
    let world = SensorFrame { cloud_frame: CloudFrame::World, ..seen };
    let expected = world.point(0, 0, 1.5).unwrap().to_array().map(e57::RecordValue::Double);
    assert_eq!((first.len(), &first[..3]), (7, &expected[..]));
    // What differs has another identifier.
    let guids = |reader: &e57::E57Reader<Cursor<Vec<u8>>>| {
        [reader.guid().to_owned(), reader.pointclouds()[0].guid.clone().unwrap()]
    };
    let all = [guids(&reader), guids(&read(CloudFrame::Body, "")), guids(&read(CloudFrame::World, ""))];
    assert!(all[0] != all[1] && all[0] == all[2] && all[0][0] != all[0][1], "{all:?}");
}

/// Clouds without points are whole files.
#[test]
fn a_frame_that_sees_nothing_is_a_cloud_without_points() {
    let sensor = lidar();
    let frame = Frame::from_pixels(2, 3, [(Cause::Nothing, &[][..]); 6]);
    let seen = seen(&sensor, &frame);
    let file = format("las", "").encode(&seen).unwrap();
    assert!(las(&file).1.is_empty());
    let mut reader = e57::E57Reader::new(Cursor::new(format("e57", "").encode(&seen).unwrap())).unwrap();
    let cloud = reader.pointclouds()[0].clone();
    assert_eq!(reader.pointcloud_raw(&cloud).unwrap().count(), 0);
    assert!(format("laz", "").encode(&seen).unwrap().len() > 375);
}

/// A run in one file has the points of all its frames, and the manifest the hash of what is on the disk.
#[test]
fn a_las_of_a_run_has_the_points_of_all_frames() {
    let formats =
        "formats = [{ format = \"las\", per = \"run\" }, { format = \"laz\", per = \"run\" }, \"npy\"]";
    let room = Room::with(&format!("{formats}\n\n[sequence]\nframes = 3"));
    let (code, text) = room.run(&["scan", "job.toml"]);
    assert!(code == 0 && !text.contains("do not fit"), "{text}");
    let out = room.0.path().join("out");
    let file = fs::read(out.join("run.las")).unwrap();
    let points = u32_at(&file, 96) as usize;
    let length = usize::from(u16_at(&file, 105));
    // The frame's number is the last dimension.
    let count =
        |frame: u32| file[points..].chunks(length).filter(|point| u32_at(point, length - 4) == frame).count();
    for frame in 0..3 {
        let npy = fs::read(out.join(format!("top/{frame:06}.npy"))).unwrap();
        let header = 10 + usize::from(u16_at(&npy, 8));
        assert!(count(frame) > 100);
        assert_eq!(count(frame) * 40, npy.len() - header);
    }
    let total: usize = (0..3).map(count).sum();
    assert_eq!(u64::from_le_bytes(file[247..255].try_into().unwrap()), total as u64);
    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    for name in ["run.las", "run.laz"] {
        let hash = blake3::hash(&fs::read(out.join(name)).unwrap()).to_hex();
        assert!(manifest.contains(hash.as_str()), "{name}: {manifest}");
    }
    let (code, text) = room.run(&["scan", "job.toml", "--overwrite", "--resume"]);
    assert!(code != 0, "{text}");
}

/// Clouds in frames that move make no cloud of a run.
#[test]
fn clouds_of_a_run_that_do_not_fit_each_other_are_told() {
    let formats = "formats = [{ format = \"laz\", per = \"run\" }]";
    let drive = "\n\n[trajectory.twist]\nlinear_m_s = [1.0, 0.0, 0.0]\n\n[sequence]\nframes = 2";
    for (output, is_told) in [
        (format!("{formats}{drive}"), true),
        (format!("{formats}\nframe = \"body\"{drive}"), true),
        (format!("{formats}\nframe = \"world\"{drive}"), false),
        (format!("formats = [\"laz\"]{drive}"), false),
        (formats.to_owned(), false),
    ] {
        let (code, text) = Room::with(&output).lint();
        assert_eq!(
            (code, text.contains("the file of all frames, run.laz, has the points of each")),
            (0, is_told),
            "{text}"
        );
    }
}

#[test]
fn a_reference_system_is_wkt() {
    let (code, text) = Room::with("formats = [{ format = \"las\", crs = \"EPSG:25832\" }]").lint();
    assert!(code != 0 && text.contains("`crs` is WKT") && text.contains("job.toml:11"), "{text}");
    let sensor = lidar();
    let frame = frame();
    let file = format("laz", ", crs = 'LOCAL_CS[\"site\"]'").encode(&seen(&sensor, &frame)).unwrap();
    let text = b"LASF_Projection\0\x40\x08\x11\0WKT";
    let at = file.windows(text.len()).position(|window| window == text).unwrap();
    assert_eq!(&file[at + 52..at + 52 + 16], b"LOCAL_CS[\"site\"]");
    assert_eq!(u16_at(&file, 6), 16);
}
