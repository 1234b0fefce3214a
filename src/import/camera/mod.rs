//! A calibrated camera, in the dialects in which calibrations are written.
//!
//! ```text
//! calibration  what every dialect gives
//! ros          OpenCV's calibration files, and ROS's camera_info
//! kalibr       Kalibr's camchain and camera files
//! open3d       Open3D's PinholeCameraIntrinsic and what holds one
//! librealsense the intrinsics of a stream of librealsense
//! ```
//!
//! All of them count pixels from the centre of the top left pixel, which is (0, 0) there and (0.5, 0.5) here: principal points
//! move by half a pixel. A lens is taken only if its formula is one of beamcast's: OpenCV's pinhole with k1, k2, p1, p2, k3 to
//! k6, and OpenCV's fisheye with k1 to k4.

mod calibration;
mod kalibr;
mod librealsense;
mod open3d;
mod ros;

use super::fields::Fields;
use super::file::File;
use super::writer::Toml;
use crate::config::keys::sensor::{FISHEYE, PINHOLE, camera};
use crate::source::suggest::nearest;
use crate::source::tree::{Node, Value};
use crate::source::words::{list, quoted};
use calibration::Calibration;

pub(super) use ros::KEYS;

/// Reads a camera of its dialect.
type Reader = fn(&Fields<'_>) -> Option<Calibration>;

/// The dialect of a table, by its keys. `None` if it has none that only a camera has.
fn dialect(fields: &Fields<'_>) -> Option<Reader> {
    let has = |keys: &[&str]| keys.iter().all(|key| fields.get(key).is_some());
    match () {
        () if has(&["intrinsic_matrix"]) || fields.get("intrinsic").is_some_and(is_table) => {
            Some(open3d::read)
        }
        () if has(&["ppx"]) || has(&["ppy"]) => Some(librealsense::read),
        () if has(&["camera_model"]) || (has(&["intrinsics", "resolution"])) => Some(kalibr::read),
        () if ros::KEYS.iter().chain(ros::MATRIX).any(|key| has(&[key])) => Some(ros::read),
        () if has(&["fx", "fy"]) => Some(librealsense::read),
        () => None,
    }
}

/// Whether a JSON text has a key of a camera's at any depth.
pub(super) fn is_nested(text: &str) -> bool {
    ["\"intrinsic_matrix\"", "\"ppx\"", "\"camera_matrix\"", "\"K\""].iter().any(|key| text.contains(key))
}

fn is_table(node: &Node) -> bool {
    matches!(node.value, Value::Table(_))
}

/// Writes the sensor file of a camera. `wanted` names one of a file with several cameras; without it the first is taken.
pub(super) fn write(file: File<'_>, wanted: Option<&str>, toml: &mut Toml) -> Option<()> {
    let document = file.document()?;
    let top = Fields::new(file, "", &document)?;
    let found = match (dialect(&top), wanted) {
        (Some(read), None) => read(&top)?,
        (Some(_), Some(wanted)) => {
            let message = format!("the file is one camera, without a name such as {}", quoted(wanted));
            return file.fail(file.whole(), message, "", "leave --camera out".to_owned());
        }
        (None, wanted) => one_of_several(&top, wanted)?,
    };
    if file.has_errors() {
        return None;
    }
    let name = top.text("camera_name").map_or(String::new(), |name| format!(" {name}"));
    toml.comment(&format!("The camera{name} of {}.", file.short_name()));
    toml.comment(&format!(
        "\nUsed: {}. The file counts pixels from the centre of the top left pixel, which is (0.5, 0.5) here, so cx_px and \
         cy_px are half a pixel more than in the file.",
        found.used
    ));
    for note in &found.notes {
        toml.comment(note);
    }
    toml.comment("Not in the file, and to be checked: rate and range limits (none are set).");
    toml.table(if found.lens.is_fisheye { FISHEYE.name() } else { PINHOLE.name() });
    toml.integer(camera::WIDTH.name(), found.width);
    toml.integer(camera::HEIGHT.name(), found.height);
    use camera::{CX, CY, FX, FY};
    let ([fx, fy], [cx, cy]) = (found.focal, found.principal);
    for (key, value) in [(&FX, fx), (&FY, fy), (&CX, cx), (&CY, cy)] {
        toml.number(key.name(), value);
    }
    if !found.lens.coefficients.is_empty() {
        let key = if found.lens.is_fisheye { &camera::FISHEYE_DISTORTION } else { &camera::DISTORTION };
        toml.numbers(key.name(), &found.lens.coefficients);
    }
    Some(())
}

/// One of the cameras of a file whose keys name them, such as cam0 and cam1, or depth and color.
fn one_of_several(top: &Fields<'_>, wanted: Option<&str>) -> Option<Calibration> {
    let file = top.file();
    let cameras: Vec<(&str, Fields<'_>, Reader)> = top
        .keys()
        .filter(|key| top.get(key).is_some_and(is_table))
        .filter_map(|key| {
            let fields = top.table(key)?;
            let read = dialect(&fields)?;
            Some((key, fields, read))
        })
        .collect();
    let names = || cameras.iter().map(|(name, ..)| *name);
    let Some((first, ..)) = cameras.first() else {
        let help = "a camera's calibration has its matrix (`camera_matrix`, `K`, `intrinsic_matrix`) or its focal \
                    lengths (`intrinsics`, or `fx` and `fy`)";
        return file.fail(file.whole(), "the file has no camera's intrinsics", "", help.to_owned());
    };
    let name = wanted.unwrap_or(first);
    let Some((_, fields, read)) = cameras.iter().find(|(known, ..)| *known == name) else {
        let help = match nearest(name, names()) {
            Some(near) => format!("did you mean {}?", quoted(near)),
            None => format!("its cameras are {}", list(names(), "and")),
        };
        return file.fail(file.whole(), format!("the file has no camera {}", quoted(name)), "", help);
    };
    let mut found = read(fields)?;
    if cameras.len() > 1 {
        let all = list(names(), "and");
        let note =
            format!("The file has the cameras {all}. This is {}; --camera takes another.", quoted(name));
        found.notes.insert(0, note);
    }
    Some(found)
}
