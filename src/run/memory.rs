//! Memory: how much this process may have, and estimates of how much a run needs.

use std::fmt;

use crate::config::MountedSensor;
use crate::error::Error;
use crate::output::Format;
use crate::scan::{Frame, Waveforms};
use crate::scene::Scene;
use crate::sensor::{DepthSensing, Pattern, Pulse, RayTable, Sensor, StereoMethod};
use crate::source::memory::kilobytes_of;
pub use crate::source::memory::of_machine;
use crate::truth::SurfaceMotion;

/// The frames, and the things made of them, that a run holds in memory at the same time. They decide how much it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holding {
    /// One frame after the other, and nothing that outlives it.
    Frame,
    /// A frame that is encoded in the job's formats at the same time, beside it the next one, which is being cast, and files that
    /// wait for the disk.
    Files,
    /// One frame after the other, and the image of it.
    Image,
    /// The views of all frames, and the page that shows them.
    Views,
    /// The frames of one moment, held to expectations.
    Check {
        /// Whether they are held to a baseline, or made one, too: with the image of one frame at a time, and the image of its
        /// baseline and the pixels that differ.
        compared: bool,
        /// Whether there is a page: with the views and the baselines of the frames that it shows.
        page: bool,
        /// Whether expectations need ideal scans of sensors that are not ideal.
        detection: bool,
    },
}

/// Bytes that a frame of a sensor takes for each pixel.
pub fn frame_bytes_a_pixel(sensor: &Sensor) -> u64 {
    Frame::bytes_a_pixel(sensor) as u64
}

/// Frames that a run of many holds at the same time: one that is cast, and one that is encoded.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// The frames of which the files may wait for the disk while two more are cast and encoded. There are many of small frames, so
/// that one flush of the disk serves all that have come meanwhile.
pub fn frames_waiting(sensors: &[MountedSensor], formats: &[Format]) -> usize {
    const MOST_BYTES: u64 = 16 << 20;
    const MOST: u64 = 64;
    let bytes = |mounted: &MountedSensor| {
        pixels(&mounted.sensor).saturating_mul(file_bytes_a_ray(&mounted.sensor, formats))
    };
    let largest = sensors.iter().map(bytes).max().unwrap_or(0).max(1);
    (MOST_BYTES / largest).clamp(1, MOST) as usize
}

/// Bytes that the files of a frame take for each ray.
fn file_bytes_a_ray(sensor: &Sensor, formats: &[Format]) -> u64 {
    formats.iter().map(|format| format.file_bytes_a_ray(sensor)).sum()
}

/// Bytes that a frame takes for each pixel with what is known of it beside its returns.
fn held_bytes_a_pixel(sensor: &Sensor, formats: &[Format]) -> u64 {
    let asked =
        |asks: fn(&Format) -> bool, bytes: usize| if formats.iter().any(asks) { bytes as u64 } else { 0 };
    frame_bytes_a_pixel(sensor)
        + asked(|format| format.tells_waveforms(), Waveforms::bytes_a_pixel(sensor))
        + asked(|format| format.tells_motion(), size_of::<SurfaceMotion>())
        + asked(|format| format.tells_colors(), size_of::<[f32; 3]>())
}

/// Bytes that a view takes for each point: three coordinates of 32 bits.
const POINT_BYTES: u64 = 12;

/// Bytes that the numbers of a view take in the text of a page for each ray. They are compressed: this is a street's, and of a
/// simpler scene they take less.
const TEXT_BYTES_A_RAY: u64 = 10;

/// The text of a page is put together of the texts of its parts.
const COPIES_OF_TEXT: u64 = 2;

/// Bytes that an image with all channels takes for each pixel: as many as in an EXR that is not compressed.
fn image_bytes_a_ray(sensor: &Sensor) -> u64 {
    Format::EXR.file_bytes_a_ray(sensor)
}

/// Pixels of a sensor's frame. Too many to count give the largest number.
fn pixels(sensor: &Sensor) -> u64 {
    (sensor.pattern.rows() as u64).saturating_mul(sensor.pattern.columns() as u64)
}

/// The memory that one frame of a sensor takes, in bytes, with the directions of a distorted camera's pixels.
pub fn of_frame(sensor: &Sensor) -> u64 {
    let directions = match &sensor.pattern {
        Pattern::Camera(camera) => camera.table_bytes(),
        _ => 0,
    };
    let frame = pixels(sensor).saturating_mul(frame_bytes_a_pixel(sensor));
    frame.saturating_add(directions).saturating_add(matching_bytes(sensor))
}

/// Bytes that a camera which matches images takes while it does: its matcher and an ideal frame of each imager. 0 for other
/// sensors.
fn matching_bytes(sensor: &Sensor) -> u64 {
    let Some(DepthSensing::Stereo(stereo)) = &sensor.measurement.depth else { return 0 };
    let StereoMethod::Match(matching) = &stereo.method else { return 0 };
    let matcher = matching.settings.memory_bytes(sensor.pattern.columns(), sensor.pattern.rows());
    let frames = pixels(sensor).saturating_mul(2 * Frame::BYTES_A_PIXEL as u64);
    matcher.saturating_add(frames)
}

/// An upper estimate of the memory that the frames of a rig take, so many of each sensor, with everything that is made of them,
/// in bytes. Too many rays to count give the largest number.
pub fn of_frames(sensors: &[MountedSensor], frames: &[u64], formats: &[Format], holding: Holding) -> u64 {
    let (mut largest, mut all) = (0, 0_u64);
    let frames_of_all = frames.iter().fold(0, |all: u64, frames| all.saturating_add(*frames));
    let waiting = frames_waiting(sensors, formats) as u64;
    for (MountedSensor { sensor, .. }, &frames) in sensors.iter().zip(frames) {
        let frame = frame_bytes_a_pixel(sensor);
        let image = image_bytes_a_ray(sensor);
        let view = image + POINT_BYTES;
        let (once, kept) = match holding {
            Holding::Frame => (frame, 0),
            Holding::Files => {
                let frames = frames_of_all.min(FRAMES_IN_FLIGHT as u64);
                let files = frames_of_all.saturating_sub(1).min(waiting) * file_bytes_a_ray(sensor, formats);
                let encoded: u64 = formats.iter().map(|format| format.encoding_bytes_a_ray(sensor)).sum();
                (held_bytes_a_pixel(sensor, formats) * frames + encoded + files, 0)
            }
            Holding::Image => (frame + image, 0),
            Holding::Views => (frame, view + COPIES_OF_TEXT * TEXT_BYTES_A_RAY),
            Holding::Check { compared, page, detection } => {
                // A channel's list of pixels that differ takes as much as the channel.
                let once = if compared { 2 * image } else { 0 };
                let shown = if page { view } else { 0 };
                // A page shows the baseline, too.
                let baseline = if compared && page { image } else { 0 };
                let needs_ideal = detection && !sensor.measurement.is_ideal();
                let ideal = if needs_ideal { Frame::BYTES_A_PIXEL as u64 } else { 0 };
                (once, frame + ideal + baseline + shown)
            }
        };
        let rays = pixels(sensor);
        largest = largest.max(rays.saturating_mul(once).saturating_add(matching_bytes(sensor)));
        all = all.saturating_add(rays.saturating_mul(kept).saturating_mul(frames));
    }
    all.saturating_add(largest)
}

/// An upper estimate of the memory that a rig takes from when its frames were checked until the page with its views is written,
/// in bytes. `compared` says that the page has its baselines, too.
pub fn of_page(sensors: &[MountedSensor], compared: bool) -> u64 {
    let of_sensor = |MountedSensor { sensor, .. }: &MountedSensor| {
        let image = image_bytes_a_ray(sensor);
        let images = if compared { 2 } else { 1 };
        let view = images * image + POINT_BYTES + COPIES_OF_TEXT * images * TEXT_BYTES_A_RAY;
        pixels(sensor).saturating_mul(view)
    };
    sensors.iter().map(of_sensor).fold(0, u64::saturating_add)
}

/// The memory that the tables of a rig take, in bytes: tables of rays, and the directions of the pixels of distorted cameras. A
/// table of rays that sensors share counts once.
pub fn of_tables(sensors: &[MountedSensor]) -> u64 {
    let mut tables: Vec<&RayTable> = Vec::new();
    let mut directions = 0_u64;
    for MountedSensor { sensor, .. } in sensors {
        match &sensor.pattern {
            Pattern::Rays(table) if !tables.iter().any(|known| known.shares_rays_with(table)) => {
                tables.push(table);
            }
            Pattern::Camera(camera) => directions = directions.saturating_add(camera.table_bytes()),
            _ => {}
        }
    }
    let rays: u64 = tables.iter().map(|table| (table.len() * size_of::<Pulse>()) as u64).sum();
    rays.saturating_add(directions)
}

/// Bytes that a stored triangle takes in the scene and in the tracer's hierarchy, and a vertex beside them. These and the next
/// ones were measured: meshes of 20 000 to a million triangles with half a vertex to three vertices a triangle, and up to
/// 200 000 placements, take between 0.8 and 1.3 times the estimate.
const TRIANGLE_BYTES: u64 = 130;
const VERTEX_BYTES: u64 = 22;

/// Bytes that building takes for each triangle of the parts that are built at the same time, and the triangles of these.
const BUILDING_BYTES: u64 = 90;
const TRIANGLES_BEING_BUILT: u64 = 1 << 16;

/// Bytes that a placement takes while the hierarchy over all placements is built.
const PLACEMENT_BYTES: u64 = 690;

/// Bytes that a triangle takes in a shape of a mesh that bends and in its hierarchy: a figure of 1336 triangles in 1000 slices took
/// 75 for each with its vertices.
const SHAPE_TRIANGLE_BYTES: u64 = 60;

/// An estimate of the memory that the shapes of what bends take during a frame of so many slices, in bytes.
pub fn of_shapes(scene: &Scene, slices: usize) -> u64 {
    let bending = scene.geometry.movers.iter().filter(|mover| mover.deformer.is_some());
    let of_shape = bending.map(|mover| {
        let mesh = &scene.geometry.meshes[mover.mesh as usize];
        mesh.triangles.len() as u64 * SHAPE_TRIANGLE_BYTES
            + mesh.positions.len() as u64 * VERTEX_BYTES
            + PLACEMENT_BYTES
    });
    of_shape.sum::<u64>().saturating_mul(slices as u64)
}

/// An estimate of the memory that a scene and its tracer take at most, in bytes.
pub fn of_scene(scene: &Scene) -> u64 {
    let triangles = scene.geometry.stored_triangle_count();
    let vertices: u64 = scene.geometry.meshes.iter().map(|mesh| mesh.positions.len() as u64).sum();
    // A placement of meshes that are placed once is part of the scene's first mesh.
    let placements = scene.arrangement.placements.len().saturating_sub(1) as u64;
    triangles * TRIANGLE_BYTES
        + vertices * VERTEX_BYTES
        + triangles.min(TRIANGLES_BEING_BUILT) * BUILDING_BYTES
        + placements * PLACEMENT_BYTES
        + scene.appearance_bytes()
}

/// Refuses work that needs more memory than the process may have. `what` names the work, such as `a frame of sensor "top"`.
///
/// # Errors
/// [`Error::Usage`] with the estimate.
pub fn check(what: &str, needed: u64) -> Result<(), Error> {
    check_against(what, needed, of_machine())
}

fn check_against(what: &str, needed: u64, memory: Option<u64>) -> Result<(), Error> {
    match memory {
        Some(memory) if needed > memory => Err(Error::Usage(format!(
            "{what} takes about {} ({needed} bytes), and this machine has {} ({memory} bytes): \
             fewer rows or columns would fit",
            Bytes(needed),
            Bytes(memory)
        ))),
        _ => Ok(()),
    }
}

/// Bytes that the numbers of recorded files may take where images are made, compared or shown of them: that takes about five
/// times as much, which was measured on an image of 16384 × 16384 pixels.
pub fn for_recordings() -> u64 {
    const COPIES: u64 = 5;
    of_machine().map_or(u64::MAX, |machine| machine / COPIES)
}

/// The most memory that this process held at any time, in bytes, where the system says so.
pub fn peak() -> Option<u64> {
    kilobytes_of("/proc/self/status", "VmHWM:")
}

/// Shows a number of bytes in a decimal unit that suits it.
#[derive(Clone, Copy, Debug)]
pub struct Bytes(pub u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const UNITS: [&str; 6] = ["kB", "MB", "GB", "TB", "PB", "EB"];
        if self.0 < 1000 {
            return write!(f, "{} bytes", self.0);
        }
        let mut value = self.0 as f64 / 1e3;
        let mut unit = 0;
        while value >= 999.95 && unit + 1 < UNITS.len() {
            value /= 1e3;
            unit += 1;
        }
        write!(f, "{value:.1} {}", UNITS[unit])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_BYTES_A_RAY: u64 = Frame::BYTES_A_PIXEL as u64;
    use crate::angle::Angle;
    use crate::frame::Pose;
    use crate::sensor::{BrownConrady, Camera, Lens, RangeLimits, RingOrder};

    #[test]
    fn bytes_are_readable() {
        let shown = [0, 999, 1000, 999_949, 999_950, 13_000_000_000, u64::MAX].map(|n| Bytes(n).to_string());
        assert_eq!(shown, ["0 bytes", "999 bytes", "1.0 kB", "999.9 kB", "1.0 MB", "13.0 GB", "18.4 EB"]);
    }

    #[test]
    fn more_memory_than_there_is_is_refused_with_the_estimate() {
        let frame = "a frame of sensor \"top\"";
        assert!(check_against(frame, 1000, Some(1000)).is_ok());
        assert!(check_against(frame, u64::MAX, None).is_ok());
        let error = check_against(frame, 1_500_000, Some(1_000_000)).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let message = error.to_string();
        assert!(message.contains("\"top\" takes about 1.5 MB (1500000 bytes)"), "{message}");
    }

    fn mounted(pattern: Pattern) -> MountedSensor {
        let sensor = Sensor {
            pattern,
            range: RangeLimits::default(),
            ring: RingOrder::Row,
            measurement: Default::default(),
        };
        MountedSensor {
            name: "top".to_owned(),
            sensor,
            is_nominal: false,
            data_sheet: None,
            body_from_sensor: Pose::IDENTITY,
            trigger_s: 0.0,
        }
    }

    #[test]
    fn frames_that_are_kept_add_up_and_others_do_not() {
        let camera = |width| {
            let camera = Camera::from_hfov((width, 10), Angle::deg(90.0), None).unwrap();
            mounted(Pattern::Camera(camera))
        };
        let rig = [camera(10), camera(30)];
        let bytes = |holding| of_frames(&rig, &[1, 1], &[Format::EXR], holding);
        assert_eq!(bytes(Holding::Frame), 300 * FRAME_BYTES_A_RAY);
        assert!(bytes(Holding::Files) > bytes(Holding::Frame));
        let of_many = |holding| of_frames(&rig, &[1000, 1], &[Format::EXR], holding);
        // Of two frames the files of one wait for the disk, and of many those of 64 small ones.
        assert_eq!(of_many(Holding::Files) - bytes(Holding::Files), 63 * 300 * 48);
        assert_eq!(of_many(Holding::Views) - bytes(Holding::Views), 999 * 100 * 80);
        assert_eq!(bytes(Holding::Image), 300 * (48 + FRAME_BYTES_A_RAY));
        let check = |compared, page| bytes(Holding::Check { compared, page, detection: false });
        assert_eq!(check(false, false), 400 * FRAME_BYTES_A_RAY);
        assert_eq!(check(true, false), 400 * FRAME_BYTES_A_RAY + 300 * 96);
        assert!(check(true, true) > check(true, false) && check(false, true) > check(false, false));
        // Only what is not ideal has an ideal scan beside its own.
        let detecting = |rig: &[MountedSensor], detection| {
            of_frames(
                rig,
                &[1, 1],
                &[Format::EXR],
                Holding::Check { compared: false, page: false, detection },
            )
        };
        assert_eq!(detecting(&rig, true), detecting(&rig, false));
        let mut measured = rig.clone();
        measured[1].sensor.measurement.noise = Some(Default::default());
        assert_eq!(detecting(&measured, true) - detecting(&measured, false), 300 * FRAME_BYTES_A_RAY);
        assert!(of_page(&rig, true) > of_page(&rig, false));
        assert!(bytes(Holding::Views) > bytes(Holding::Frame));
    }

    #[test]
    fn the_files_of_small_frames_wait_together() {
        let waiting = |width, height| {
            let camera = Camera::from_hfov((width, height), Angle::deg(90.0), None).unwrap();
            frames_waiting(&[mounted(Pattern::Camera(camera))], &[Format::EXR])
        };
        // An EXR takes 48 bytes a pixel at most.
        assert_eq!([waiting(100, 100), waiting(2000, 50), waiting(8000, 8000)], [34, 3, 1]);
        assert_eq!(frames_waiting(&[], &[]), 64);
    }

    #[test]
    fn a_table_that_sensors_share_counts_once() {
        let pulse = Pulse::new(glam::DVec3::ZERO, glam::DVec3::X, 0.0);
        let table = RayTable::new(vec![pulse; 100], None).unwrap();
        let other = RayTable::new(vec![pulse; 10], None).unwrap();
        let rig = [table.clone(), table, other].map(|table| mounted(Pattern::Rays(table)));
        assert_eq!(of_tables(&rig), 110 * size_of::<Pulse>() as u64);
    }

    #[test]
    fn a_distorted_camera_holds_a_direction_a_pixel_and_an_ideal_one_none() {
        let camera = Camera::from_hfov((30, 10), Angle::deg(60.0), None).unwrap();
        let lens = BrownConrady::new([-0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let distorted = camera.clone().with_lens(Lens::BrownConrady(lens));
        let rig = [camera, distorted].map(|camera| mounted(Pattern::Camera(camera)));
        assert_eq!(of_tables(&rig), 300 * size_of::<glam::DVec3>() as u64);
        assert_eq!(of_frame(&rig[1].sensor) - of_frame(&rig[0].sensor), of_tables(&rig));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_tells_of_its_memory() {
        assert!(of_machine().unwrap() > 1 << 20);
        assert!(peak().unwrap() > 1 << 16);
        assert_eq!(kilobytes_of("/proc/self/status", "NoSuchKey:"), None);
        assert_eq!(kilobytes_of("/nowhere", "MemTotal:"), None);
    }
}
