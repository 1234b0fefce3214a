//! Encoding of point clouds as PCD 0.7, the format of the Point Cloud Library.

use glam::DQuat;

use super::format::{Content, EncodeError, Field, FormatSpec, Kind, field};
use super::id::id_of;
use super::options::{OptionSpec, OptionValues, Options};
use super::points::{MOTION, Point, TERMS, more_bytes, more_fields};
use super::sensor_frame::SensorFrame;
use crate::sensor::Sensor;

/// The fields in their order, without padding. A kind is PCD's letter and size.
static FIELDS: [Field; 9] = [
    field("x", "F4", "m"),
    field("y", "F4", "m"),
    field("z", "F4", "m"),
    field("intensity", "F4", "0 to 1"),
    field("ring", "U2", "from 0"),
    field("time", "F4", "s from the frame's start"),
    field("instance", "U4", "from 1; 0 is nothing"),
    field("label", "U4", "0 is none"),
    field("range", "F4", "m"),
];
const BYTES_PER_POINT: usize = 8 * 4 + 2;

/// The points of a frame, row by row of the range image. The returns of a pixel follow each other, and misses are left out. An
/// organised cloud instead has the first return of each pixel.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "pcd",
    ending: "pcd",
    about: "binary PCD point clouds",
    content: Content::Points(&FIELDS),
    read_by: "pypcd4, Open3D",
    options: &[ORGANISED, MOTION, TERMS],
    check: |sensor, _| check(sensor),
    encoding_bytes_a_ray: bytes_a_ray,
    file_bytes_a_ray: bytes_a_ray,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

const ORGANISED: OptionSpec = OptionSpec {
    name: "organised",
    about: "Whether the cloud has a point for each pixel of the range image, in rows and columns. A pixel without a return has NaN \
            for coordinates and range, and of several returns the first is there.",
    values: OptionValues::Flag { default: false },
};

fn bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    (BYTES_PER_POINT as u64 + more_bytes(sensor, options)) * sensor.most_returns() as u64
}

fn check(sensor: &Sensor) -> Result<(), EncodeError> {
    let rows = sensor.pattern.rows();
    let rings = (0..rows).map(|row| sensor.ring(row)).max().unwrap_or(0);
    match u16::try_from(rings) {
        Ok(_) => Ok(()),
        Err(_) => {
            Err(EncodeError::new(format!("a PCD's ring is at most {}, and can't hold {rings}", u16::MAX)))
        }
    }
}

fn encode(cloud: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let (frame, is_organised) = (cloud.frame, options.is_set(&ORGANISED));
    let (width, height) =
        if is_organised { (frame.columns(), frame.rows()) } else { (frame.return_count(), 1) };
    let more = more_bytes(cloud.capture.sensor, options) as usize;
    let mut file = cloud.memory_of_file(FORMAT.name);
    file.extend_from_slice(header(cloud, width, height, options).as_bytes());
    file.reserve_exact(width * height * (BYTES_PER_POINT + more));
    let add_point = |file: &mut Vec<u8>, point: &Point| -> Result<(), EncodeError> {
        add_point(file, point)?;
        if more > 0 {
            cloud.add_more(point, options, file);
        }
        Ok(())
    };
    if is_organised {
        let fixed = cloud.fixed_cloud_from_sensor();
        for pixel in 0..frame.pixels() {
            let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
            let slots = frame.slots(pixel);
            if slots.is_empty() {
                // All else is 0, as in channels.
                let ring = cloud.capture.sensor.ring(row);
                add(&mut file, [f32::NAN; 3], ring, 0.0, [0.0, f32::NAN], [0, 0])?;
                file.resize(file.len() + more, 0);
            } else {
                let first = slots.start..slots.start + 1;
                cloud
                    .points_of_pixel((row, column), first, fixed, &mut |point| add_point(&mut file, point))?;
            }
        }
    } else {
        cloud.each_point(|point| add_point(&mut file, point))?;
    }
    Ok(file)
}

fn add_point(file: &mut Vec<u8>, point: &Point) -> Result<(), EncodeError> {
    let Point { position_m, ring, time_s, hit, .. } = *point;
    add(file, position_m, ring, time_s, [hit.intensity, hit.range_m as f32], [id_of(hit.instance), hit.label])
}

fn add(
    file: &mut Vec<u8>,
    position_m: [f32; 3],
    ring: usize,
    time_s: f64,
    [intensity, range_m]: [f32; 2],
    [instance, label]: [u32; 2],
) -> Result<(), EncodeError> {
    let ring =
        u16::try_from(ring).map_err(|_| EncodeError::new(format!("a PCD's ring can't hold {ring}")))?;
    let [x, y, z] = position_m.map(f32::to_le_bytes);
    let mut point = [0; BYTES_PER_POINT];
    point[0..4].copy_from_slice(&x);
    point[4..8].copy_from_slice(&y);
    point[8..12].copy_from_slice(&z);
    point[12..16].copy_from_slice(&intensity.to_le_bytes());
    point[16..18].copy_from_slice(&ring.to_le_bytes());
    point[18..22].copy_from_slice(&(time_s as f32).to_le_bytes());
    point[22..26].copy_from_slice(&instance.to_le_bytes());
    point[26..30].copy_from_slice(&label.to_le_bytes());
    point[30..34].copy_from_slice(&range_m.to_le_bytes());
    file.extend_from_slice(&point);
    Ok(())
}

/// The header. The viewpoint turns the points into the world: PCL's viewer shows them there.
fn header(cloud: &SensorFrame, width: usize, height: usize, options: &Options) -> String {
    let more = more_fields(cloud.capture.sensor, options).into_iter();
    let mut fields = FIELDS.to_vec();
    fields.extend(more.map(|(name, is_integer)| field(name, if is_integer { "U4" } else { "F4" }, "")));
    let all = |column: fn(&Field) -> &str| fields.iter().map(column).collect::<Vec<_>>().join(" ");
    let world_from_points = cloud.world_from_points();
    let [tx, ty, tz] = world_from_points.translation.to_array();
    let [qx, qy, qz, qw] = DQuat::from_mat3(&world_from_points.rotation).to_array();
    // Adding 0 makes a negative zero positive.
    let viewpoint = [tx, ty, tz, qw, qx, qy, qz].map(|v| format!("{:?}", v + 0.0)).join(" ");
    let compensation = cloud.compensation().map_or(String::new(), |sentence| format!("# {sentence}\n"));
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\n# frame: {}, metres\n{compensation}VERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {width}\n\
         HEIGHT {height}\nVIEWPOINT {viewpoint}\nPOINTS {}\nDATA binary\n",
        cloud.cloud_frame_in_words(),
        all(|field| field.name),
        all(|field| &field.kind[1..]),
        all(|field| &field.kind[..1]),
        all(|_| "1"),
        width * height,
    )
}
