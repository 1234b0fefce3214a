//! The folders of KITTI's odometry benchmark with the labels of SemanticKITTI, and the boxes of KITTI's object benchmark.
//!
//! The folder of a sensor is a sequence. KITTI gives poses of its left camera, and `Tr` in `calib.txt` leads from the points to
//! that. Here `Tr` only turns axes, from x forward, y left, z up to x right, y down, z forward, so that the camera of the
//! convention is where the sensor is, and inv(Tr)·P·Tr is the pose of the sensor, as readers of LiDARs compute it.
//!
//! Sources: the development kits of KITTI's odometry and object benchmarks (Geiger, Lenz and Urtasun, CVPR 2012), and the API of
//! SemanticKITTI (Behley et al., ICCV 2019).

use std::io::Write;

use glam::{DMat3, DVec3};

use super::format::{
    Asked, Content, Encode, EncodeError, Folder, FormatSpec, FrameFile, FramePath, Kind, Notes, RunFile,
    field,
};
use super::id::id_of;
use super::options::Options;
use super::sensor_frame::{CloudFrame, SensorFrame};
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::sensor::{Pattern, Sensor};
use crate::truth::BoxTruth;

/// A sequence of KITTI for each sensor.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "kitti",
    about: "KITTI's folders: an odometry sequence for each sensor, with SemanticKITTI's labels, and a camera's boxes",
    content: Content::Files(&[
        field(
            "SENSOR/velodyne/000000.bin",
            "float32 × 4",
            "a point: x, y, z in m (forward, left, up), and intensity, 0 to 1",
        ),
        field(
            "SENSOR/labels/000000.label",
            "uint32",
            "of the same point: instance · 65536 + label; from 1 and from 0",
        ),
        field(
            "SENSOR/poses.txt",
            "12 numbers a frame",
            "rows of the 3 × 4 pose P of a frame in the first one; x right, y down, z forward",
        ),
        field("SENSOR/times.txt", "a number a frame", "s since the first frame"),
        field(
            "SENSOR/calib.txt",
            "12 numbers a line",
            "`Tr` of the points' axes to those of the poses: a point's pose is inv(Tr)·P·Tr. A camera's projection is P0 to P3, other sensors have [I 0]",
        ),
        field(
            "SENSOR/label_2/000000.txt",
            "15 fields a line",
            "a camera's boxes, if the job asks for boxes; `occluded` is 0 below 10 % hidden, 1 below 50 %, else 2",
        ),
        field(
            "SENSOR/calib/000000.txt",
            "numbers",
            "the same calibration as the object benchmark has it, with the boxes",
        ),
    ]),
    read_by: "NumPy",
    loses: |_, _| Some(LOSES.to_owned()),
    most_label: |_| u16::MAX.into(),
    most_instance: |_| u16::MAX.into(),
    encoding_bytes_a_ray: bytes_a_ray,
    file_bytes_a_ray: bytes_a_ray,
    kind: Kind::Folder(Folder {
        of_frame: &[
            FrameFile {
                path: FramePath { stem: "SENSOR/velodyne/FRAME", ending: "bin" },
                is_made: |_| true,
                encode: Encode::Whole(|frame, _| points(frame)),
            },
            FrameFile {
                path: FramePath { stem: "SENSOR/labels/FRAME", ending: "label" },
                is_made: |_| true,
                encode: Encode::Whole(|frame, _| labels(frame)),
            },
            FrameFile {
                path: FramePath { stem: "SENSOR/label_2/FRAME", ending: "txt" },
                is_made: has_boxes,
                encode: Encode::Whole(|frame, _| Ok(boxes(frame).into_bytes())),
            },
            FrameFile {
                path: FramePath { stem: "SENSOR/calib/FRAME", ending: "txt" },
                is_made: has_boxes,
                encode: Encode::Whole(|frame, _| Ok(object_calibration(frame).into_bytes())),
            },
        ],
        of_run: &[
            RunFile { path: "SENSOR/poses.txt", is_made: |_| true, write: write_poses },
            RunFile { path: "SENSOR/times.txt", is_made: |_| true, write: write_times },
            RunFile { path: "SENSOR/calib.txt", is_made: |_| true, write: write_calibration },
        ],
        note: |frame, _| note(frame),
    }),
    ..FormatSpec::PLAIN
};

const LOSES: &str = "the points have no time, ring, column, range or number of return, and pixels without a return are left out: \
                     \"exr\", \"npy\" or \"pcd\" beside it hold these";

const BYTES_PER_POINT: usize = 4 * 4;
const BYTES_PER_LABEL: usize = 4;

fn bytes_a_ray(sensor: &Sensor, _: &Options) -> u64 {
    ((BYTES_PER_POINT + BYTES_PER_LABEL) * sensor.most_returns()) as u64
}

/// Whether a sensor's frames have boxes: those of a camera whose image KITTI's projection describes.
fn has_boxes(asked: &Asked) -> bool {
    asked.has_boxes && intrinsics(asked.sensor).is_some()
}

/// Whether the cloud's points are in a camera's optical frame, and have to be turned.
fn is_optical(frame: &SensorFrame) -> bool {
    frame.cloud_frame == CloudFrame::Sensor && frame.capture.sensor.pattern.is_camera()
}

/// The points in the frame of the job's clouds, in which x is forward, y left and z up for every sensor.
fn points(frame: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
    let is_optical = is_optical(frame);
    let mut file = Vec::with_capacity(frame.frame.return_count() * BYTES_PER_POINT);
    frame.each_point(|point| {
        let [x, y, z] = point.position_m;
        // Axes that are exchanged round nothing. Adding 0 makes a negative zero positive.
        let [x, y, z] = if is_optical { [z, 0.0 - x, 0.0 - y] } else { [x, y, z] };
        file.extend_from_slice([x, y, z, point.hit.intensity].map(f32::to_le_bytes).as_flattened());
        Ok(())
    })?;
    Ok(file)
}

fn labels(frame: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
    let mut file = Vec::with_capacity(frame.frame.return_count() * BYTES_PER_LABEL);
    let half = |number: u32, what: &str| {
        u16::try_from(number).map_err(|_| {
            EncodeError::new(format!("the {what} of a .label is at most {}, and can't be {number}", u16::MAX))
        })
    };
    frame.each_point(|point| {
        let (label, instance) =
            (half(point.hit.label, "label")?, half(id_of(point.hit.instance), "instance")?);
        file.extend_from_slice(&(u32::from(instance) << 16 | u32::from(label)).to_le_bytes());
        Ok(())
    })?;
    Ok(file)
}

/// The pose of the points in the world.
fn world_from_points(frame: &SensorFrame) -> Pose {
    let world_from_cloud = frame.world_from_points();
    if is_optical(frame) { world_from_cloud * BODY_FROM_OPTICAL.inverse() } else { world_from_cloud }
}

/// The focal lengths and the principal point of a camera in pixels, whose centres are at whole numbers.
pub(super) fn intrinsics(sensor: &Sensor) -> Option<[f64; 4]> {
    let Pattern::Camera(camera) = &sensor.pattern else { return None };
    let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.principal_px());
    Some([fx, fy, cx - 0.5, cy - 0.5])
}

/// The facts of a frame that the sequence's files need: its time, the rows of its pose, and the intrinsics of a camera.
fn note(frame: &SensorFrame) -> String {
    let time_s = frame.capture.cast_at_s(frame.reference_s().unwrap_or(0.0));
    let pose = rows_of(&world_from_points(frame));
    let camera = intrinsics(frame.capture.sensor);
    line([time_s].into_iter().chain(pose).chain(camera.into_iter().flatten()))
}

/// A note that is read again.
struct Noted {
    time_s: f64,
    world_from_points: Pose,
    camera: Option<[f64; 4]>,
}

/// The number of numbers in a note that has no camera.
const NUMBERS: usize = 13;

impl Noted {
    fn of(note: &str) -> Result<Self, EncodeError> {
        let damaged = || EncodeError::new(format!("the journal's note of a frame is damaged: {note:?}"));
        let numbers: Result<Vec<f64>, _> = note.split(' ').map(str::parse).collect();
        let numbers = numbers.map_err(|_| damaged())?;
        let Some((&[time_s, xx, xy, xz, x, yx, yy, yz, y, zx, zy, zz, z], rest)) =
            numbers.split_first_chunk::<NUMBERS>()
        else {
            return Err(damaged());
        };
        let rotation =
            DMat3::from_cols(DVec3::new(xx, yx, zx), DVec3::new(xy, yy, zy), DVec3::new(xz, yz, zz));
        let camera = rest.try_into().ok();
        Ok(Self { time_s, world_from_points: Pose { rotation, translation: DVec3::new(x, y, z) }, camera })
    }
}

/// The poses of all frames in the first, which is the identity.
fn write_poses(notes: &Notes, file: &mut dyn Write) -> Result<(), EncodeError> {
    let mut first_from_world: Option<Pose> = None;
    for note in notes()? {
        let world_from_points = Noted::of(&note.text)?.world_from_points;
        let first_from_points = match first_from_world {
            Some(first_from_world) => first_from_world * world_from_points,
            None => {
                first_from_world = Some(world_from_points.inverse());
                Pose::IDENTITY
            }
        };
        let pose = BODY_FROM_OPTICAL.inverse() * first_from_points * BODY_FROM_OPTICAL;
        writeln!(file, "{}", line(rows_of(&pose)))?;
    }
    Ok(())
}

/// The times of all frames since the first.
fn write_times(notes: &Notes, file: &mut dyn Write) -> Result<(), EncodeError> {
    let mut first_s = None;
    for note in notes()? {
        let time_s = Noted::of(&note.text)?.time_s;
        writeln!(file, "{}", line([time_s - *first_s.get_or_insert(time_s)]))?;
    }
    Ok(())
}

/// The calibration of the sequence, which is that of its first frame.
fn write_calibration(notes: &Notes, file: &mut dyn Write) -> Result<(), EncodeError> {
    let Some(note) = notes()?.next() else { return Ok(()) };
    let camera = Noted::of(&note.text)?.camera;
    writeln!(file, "{}Tr: {}", projections(camera), line(rows_of(&BODY_FROM_OPTICAL.inverse())))?;
    Ok(())
}

/// The lines of the projections of KITTI's four cameras, of which there is one: they are all the same.
fn projections(camera: Option<[f64; 4]>) -> String {
    let [fx, fy, cx, cy] = camera.unwrap_or([1.0, 1.0, 0.0, 0.0]);
    let numbers = line([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
    (0..4).map(|camera| format!("P{camera}: {numbers}\n")).collect()
}

/// The calibration of a frame of the object benchmark. Its `imu` is the body that the camera is mounted on.
fn object_calibration(frame: &SensorFrame) -> String {
    let rectified = line(DMat3::IDENTITY.to_cols_array());
    let optical_from_points = line(rows_of(&BODY_FROM_OPTICAL.inverse()));
    let points_from_body = line(rows_of(&frame.capture.body_from_sensor.inverse()));
    format!(
        "{}R0_rect: {rectified}\nTr_velo_to_cam: {optical_from_points}\nTr_imu_to_velo: {points_from_body}\n",
        projections(intrinsics(frame.capture.sensor))
    )
}

/// The boxes that a camera sees, one a line.
fn boxes(frame: &SensorFrame) -> String {
    frame.boxes.unwrap_or_default().iter().map(|found| box_line(frame, found)).collect()
}

/// The share of a box's pixels that something hides from which it counts as partly occluded, and as largely occluded. KITTI's
/// people judged by eye, so these are this program's own.
const OCCLUDED_FROM: [f64; 2] = [0.1, 0.5];

/// A box in a camera's optical frame: type, truncated, occluded, alpha, the bounds in the image, height, width, length, the
/// centre of its bottom, and its turn about the camera's y axis.
fn box_line(frame: &SensorFrame, found: &BoxTruth) -> String {
    let BoxTruth { target, oriented, world_from_sensor, .. } = found;
    let optical_from_box =
        BODY_FROM_OPTICAL.inverse() * world_from_sensor.inverse() * oriented.world_from_box;
    let [length, width, height] = oriented.size_m.to_array();
    let bottom = optical_from_box.point(DVec3::new(0.0, 0.0, -0.5 * height));
    // A length along x is turned by 0. The turn goes from z toward x, because y is down.
    let ahead = optical_from_box.rotation.x_axis;
    let rotation_y = libm::atan2(-ahead.z, ahead.x);
    let alpha = wrapped(rotation_y - libm::atan2(bottom.x, bottom.z));
    let occluded = OCCLUDED_FROM.iter().filter(|from| found.occlusion() >= **from).count();
    let bounds = found.projected_px.or(found.shown.as_ref().and_then(|shown| shown.bounds_px));
    // KITTI counts from the centre of the first pixel, and has -1 for what is not known.
    let bounds = bounds.map_or([-1.0; 4], |bounds| bounds.map(|edge| edge - 0.5));
    let place = [height, width, length].into_iter().chain(bottom.to_array()).chain([rotation_y]);
    format!(
        "{} {} {occluded} {}\n",
        type_of(frame, target.label, &target.name),
        line([found.truncation]),
        line([alpha].into_iter().chain(bounds).chain(place)),
    )
}

/// The word for a box's type: that of its label, or the object's name, without blanks.
fn type_of(frame: &SensorFrame, label: u32, name: &str) -> String {
    let of_label = || {
        let words = frame.names.labels?;
        words.iter().find(|(_, number)| **number == label).map(|(word, _)| word.as_str())
    };
    let word = if label == 0 { None } else { of_label() }.unwrap_or(name);
    let word: String = word.split_whitespace().collect::<Vec<_>>().join("_");
    // KITTI's own word for everything else.
    if word.is_empty() { "Misc".to_owned() } else { word }
}

/// An angle from -π to π that points the same way.
fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    match angle {
        angle if angle > PI => angle - TAU,
        angle if angle < -PI => angle + TAU,
        angle => angle,
    }
}

/// The first three rows of a pose's matrix.
fn rows_of(pose: &Pose) -> [f64; 12] {
    let [x, y, z] = [0, 1, 2].map(|row| {
        let [a, b, c] = pose.rotation.row(row).to_array();
        [a, b, c, pose.translation[row]]
    });
    [x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3], z[0], z[1], z[2], z[3]]
}

/// Numbers with all their digits, each the shortest text that is read as the same number. Adding 0 makes a negative zero positive.
fn line(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(|number| format!("{:?}", number + 0.0)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::super::format::Note;
    use super::*;
    use crate::angle::Angle;

    fn note_of(time_s: f64, pose: &Pose, camera: &[f64]) -> String {
        line([time_s].into_iter().chain(rows_of(pose)).chain(camera.iter().copied()))
    }

    fn written(notes: &[String], write: fn(&Notes, &mut dyn Write) -> Result<(), EncodeError>) -> String {
        let mut file = Vec::new();
        let note = |text: &String| Note { text: text.clone(), files: Vec::new() };
        write(&|| Ok(Box::new(notes.iter().map(note))), &mut file).unwrap();
        String::from_utf8(file).unwrap()
    }

    fn pose(x: f64, yaw_deg: f64) -> Pose {
        Pose::from_rpy(DVec3::new(x, 2.0, 0.5), Angle::deg(1.0), Angle::deg(-2.0), Angle::deg(yaw_deg))
    }

    /// As the API of SemanticKITTI reads them: inv(Tr)·P·Tr is the pose of the points in the first frame.
    #[test]
    fn poses_lead_from_the_points_of_a_frame_to_those_of_the_first() {
        let poses = [pose(100.0, 30.0), pose(103.0, 75.0), pose(90.0, -170.0)];
        let notes: Vec<String> = poses.iter().map(|pose| note_of(7.5, pose, &[])).collect();
        let numbers = |text: &str| -> Vec<f64> { text.split(' ').map(|n| n.parse().unwrap()).collect() };
        let lines = written(&notes, write_poses);
        let calibration = written(&notes, write_calibration);
        let tr = calibration.lines().find_map(|line| line.strip_prefix("Tr: ")).unwrap();
        let of_rows = |rows: &[f64]| {
            let column = |i: usize| DVec3::new(rows[i], rows[4 + i], rows[8 + i]);
            Pose { rotation: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
        };
        let tr = of_rows(&numbers(tr));
        // Forward is the camera's z, left its -x, and up its -y.
        assert_eq!(tr.point(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(-2.0, -3.0, 1.0));
        assert_eq!(lines.lines().next().unwrap(), "1.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0 0.0");
        for (line, world_from_points) in lines.lines().zip(&poses) {
            let first_from_points = tr.inverse() * of_rows(&numbers(line)) * tr;
            let expected = poses[0].inverse() * *world_from_points;
            // Coordinates of 100 m have steps of 1.4e-14 m, and a few roundings add up.
            let (p, q) = (DVec3::new(3.0, -4.0, 5.0), 1e-12);
            assert!((first_from_points.point(p) - expected.point(p)).length() < q, "{line}");
        }
    }

    #[test]
    fn times_begin_at_the_first_frame() {
        let notes = [2.25, 2.5, 12.75].map(|time_s| note_of(time_s, &Pose::IDENTITY, &[]));
        assert_eq!(written(&notes, write_times), "0.0\n0.25\n10.5\n");
        for write in [write_poses, write_times, write_calibration] {
            assert_eq!(written(&[], write), "", "a sensor without frames");
        }
    }

    #[test]
    fn a_camera_has_its_own_projection_and_others_have_none() {
        let camera = note_of(0.0, &Pose::IDENTITY, &[200.0, 210.0, 79.5, 44.5]);
        let text = written(&[camera], write_calibration);
        assert!(text.contains("P2: 200.0 0.0 79.5 0.0 0.0 210.0 44.5 0.0 0.0 0.0 1.0 0.0\n"), "{text}");
        let text = written(&[note_of(0.0, &Pose::IDENTITY, &[])], write_calibration);
        assert!(text.starts_with("P0: 1.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0 0.0\n"), "{text}");
    }

    #[test]
    fn a_damaged_note_is_told() {
        for note in ["", "1 2 3", "0 1 0 0 0 0 1 0 0 0 0 1 x"] {
            assert!(Noted::of(note).is_err(), "{note}");
        }
    }

    #[test]
    fn angles_are_turned_to_the_half_turns_around_0() {
        use std::f64::consts::PI;
        for (angle, expected) in [(0.5, 0.5), (PI, PI), (1.5 * PI, -0.5 * PI), (-1.25 * PI, 0.75 * PI)] {
            assert!((wrapped(angle) - expected).abs() < 1e-15);
        }
    }
}
