//! The folder of nuScenes (Caesar et al., CVPR 2020), as its development kit loads it: a scene with the clouds of LiDARs, pictures
//! of cameras, and tables of JSON.
//!
//! ```text
//! layout     the paths of the folder, and the options
//! note       what the tables need to know of a frame
//! timeline   the samples of a scene, and the frames that belong to each
//! tables     the tables, and their tokens
//! ```

mod layout;
mod note;
mod tables;
mod timeline;

use super::color;
use super::format::{
    Asked, Content, Encode, EncodeError, Folder, FormatSpec, FrameFile, Kind, RunFile, field,
};
use super::options::Options;
use super::picture::{Picture, check_sides};
use super::sensor_frame::SensorFrame;
use crate::sensor::{Pattern, Sensor};
use layout::{CLOUD, LABELS, LIDARSEG, MAP, PICTURE, SCENE};

/// A table of this name that every run has, with the function of `tables` that makes its rows.
macro_rules! table {
    ($name:literal, $rows:ident) => {
        RunFile {
            path: concat!("nuscenes/v1.0-beamcast/", $name, ".json"),
            is_made: |_| true,
            write: |notes, file| tables::write(notes, file, tables::$rows),
        }
    };
}

/// A scene of nuScenes. Every frame of the sensor that has the fewest is a sample, with the frame of every other sensor that is
/// nearest in time as its key frame; all other frames are sweeps.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "nuscenes",
    about: "nuScenes' folder: a scene with clouds, pictures, poses and boxes, for its development kit",
    content: Content::Files(&[
        field(
            "nuscenes/samples/SENSOR/000000.pcd.bin",
            "float32 × 5",
            "a LiDAR's point: x, y, z in m (forward, left, up), intensity, 0 to 1, and ring, from 0",
        ),
        field(
            "nuscenes/samples/SENSOR/000000.color.png",
            "8-bit",
            "a camera's picture, as the format `color` has it",
        ),
        field(
            "nuscenes/lidarseg/v1.0-beamcast/SENSOR-000000_lidarseg.bin",
            "uint8",
            "the label of the same point, with the option `lidarseg`",
        ),
        field(
            "nuscenes/v1.0-beamcast/*.json",
            "tables",
            "the kit's tables; a sensor's name is its channel. Boxes are there if the job asks for boxes, one for each sample and object",
        ),
        field("nuscenes/maps/none.png", "8-bit", "an empty map, which the kit has to find"),
    ]),
    read_by: "nuscenes-devkit",
    options: &[SCENE, LIDARSEG],
    check: |sensor, _| check(sensor),
    loses: |sensor, _| Some(loses(sensor).to_owned()),
    most_label: |options| if options.is_set(&LIDARSEG) { u8::MAX.into() } else { u32::MAX },
    encoding_bytes_a_ray: bytes_a_ray,
    file_bytes_a_ray: bytes_a_ray,
    kind: Kind::Folder(Folder {
        of_frame: &[
            FrameFile {
                path: CLOUD,
                is_made: |asked| !is_camera(asked),
                encode: Encode::Whole(|frame, _| points(frame)),
            },
            FrameFile { path: PICTURE, is_made: is_camera, encode: Encode::Whole(color::encode) },
            FrameFile {
                path: LABELS,
                is_made: |asked| !is_camera(asked) && has_labels(asked),
                encode: Encode::Whole(|frame, _| labels(frame)),
            },
        ],
        of_run: &[
            table!("attribute", nothing),
            table!("calibrated_sensor", calibrated_sensors),
            table!("category", categories),
            table!("ego_pose", ego_poses),
            table!("instance", instances),
            table!("log", log),
            table!("map", map),
            table!("sample", samples),
            table!("sample_annotation", annotations),
            table!("sample_data", sample_data),
            table!("scene", scene),
            table!("sensor", sensors),
            table!("visibility", visibilities),
            RunFile { is_made: has_labels, ..table!("lidarseg", lidarseg) },
            RunFile {
                path: MAP,
                is_made: |_| true,
                write: |_, file| Ok(file.write_all(&Picture::new(1, 1, [0; 3]).to_png()?)?),
            },
        ],
        note: |frame, options| note::Noted::of(frame, options).text(),
    }),
    ..FormatSpec::PLAIN
};

fn is_camera(asked: &Asked) -> bool {
    asked.sensor.pattern.is_camera()
}

fn has_labels(asked: &Asked) -> bool {
    asked.options.is_set(&LIDARSEG)
}

fn check(sensor: &Sensor) -> Result<(), EncodeError> {
    match sensor.pattern {
        Pattern::Orthographic(_) => Err(EncodeError::new("it has no cameras of parallel rays")),
        Pattern::Camera(_) => check_sides(sensor),
        _ => Ok(()),
    }
}

fn loses(sensor: &Sensor) -> &'static str {
    if sensor.pattern.is_camera() {
        "a camera's frame is a picture, without depth and ids: \"exr\" or \"npz\" beside it hold these"
    } else {
        "the points have no time, column, range, instance or number of return, and pixels without a return are left out: \"exr\", \
         \"npy\" or \"pcd\" beside it hold these"
    }
}

const BYTES_PER_POINT: usize = 5 * 4;

fn bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    if sensor.pattern.is_camera() {
        return (color::FORMAT.encoding_bytes_a_ray)(sensor, options);
    }
    // A label takes a byte.
    ((BYTES_PER_POINT + usize::from(options.is_set(&LIDARSEG))) * sensor.most_returns()) as u64
}

/// The points in the frame of the job's clouds.
fn points(frame: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
    let mut file = Vec::with_capacity(frame.frame.return_count() * BYTES_PER_POINT);
    frame.each_point(|point| {
        let [x, y, z] = point.position_m;
        // A ring is a whole number that a float of 32 bits has exactly.
        let fields = [x, y, z, point.hit.intensity, point.ring as f32];
        file.extend_from_slice(fields.map(f32::to_le_bytes).as_flattened());
        Ok(())
    })?;
    Ok(file)
}

fn labels(frame: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
    let mut file = Vec::with_capacity(frame.frame.return_count());
    frame.each_point(|point| {
        let label = point.hit.label;
        file.push(u8::try_from(label).map_err(|_| {
            EncodeError::new(format!("a label of lidarseg is at most {}, and can't be {label}", u8::MAX))
        })?);
        Ok(())
    })?;
    Ok(file)
}
