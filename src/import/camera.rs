//! A calibrated camera: OpenCV's calibration files, and ROS's camera_info, as the package camera_calibration writes it or as a
//! message is printed.
//!
//! Both count pixels from the centre of the top left pixel, which is (0, 0) there and (0.5, 0.5) here: principal points move
//! by half a pixel. Distortion is OpenCV's: `plumb_bob` (k1, k2, p1, p2, k3) and `rational_polynomial` (and k4, k5, k6), or
//! `equidistant`, its fisheye model (k1 … k4).

use super::fields::Fields;
use super::file::File;
use super::writer::Toml;
use crate::config::keys::sensor::{FISHEYE, PINHOLE, camera};
use crate::source::Spanned;
use crate::source::tree::Value;

/// A file with any of these keys is a camera's.
pub(super) const KEYS: [&str; 6] =
    ["camera_matrix", "Camera_Matrix", "image_width", "image_Width", "distortion_model", "camera_name"];

/// The names of one key in files of camera_calibration, in OpenCV's old and new samples, and in a ROS message.
const WIDTH: &[&str] = &["image_width", "image_Width", "width"];
const HEIGHT: &[&str] = &["image_height", "image_Height", "height"];
const MATRIX: &[&str] = &["camera_matrix", "Camera_Matrix", "K", "k"];
const DISTORTION: &[&str] =
    &["distortion_coefficients", "Distortion_Coefficients", "distortion", "dist_coeffs", "D", "d"];

/// Most rows and most columns of an image.
const MOST_PIXELS: u32 = 1_000_000;

pub(super) fn write(file: File<'_>, toml: &mut Toml) -> Option<()> {
    let document = file.document()?;
    let top = Fields::new(file, "", &document)?;
    let width = named(&top, WIDTH, "the number of the image's columns")
        .and_then(|key| top.integer(key, 1, MOST_PIXELS));
    let height = named(&top, HEIGHT, "the number of the image's rows")
        .and_then(|key| top.integer(key, 1, MOST_PIXELS));
    let matrix = named(&top, MATRIX, "the camera's matrix: fx 0 cx, 0 fy cy, 0 0 1")
        .and_then(|key| intrinsics(&top, key));
    let lens = lens(&top);
    let (width, height, [fx, cx, fy, cy], lens) = (width?, height?, matrix?, lens?);
    if file.has_errors() {
        return None;
    }

    let name = top.text("camera_name").map_or(String::new(), |name| format!(" {name}"));
    toml.comment(&format!("The camera{name} of {}.", file.short_name()));
    toml.comment(
        "\nUsed: size, camera matrix, distortion. The file counts pixels from the centre of the top left pixel, which is \
         (0.5, 0.5) here, so cx_px and cy_px are half a pixel more than in the file.",
    );
    if top.get("rectification_matrix").is_some()
        || top.get("projection_matrix").is_some()
        || top.get("P").is_some()
    {
        toml.comment(
            "Left out: the rectification and the projection matrix, which apply to undistorted images.",
        );
    }
    toml.comment("Not in the file, and to be checked: rate and range limits (none are set).");
    toml.table(if lens.is_fisheye { FISHEYE.name() } else { PINHOLE.name() });
    toml.integer(camera::WIDTH.name(), width);
    toml.integer(camera::HEIGHT.name(), height);
    use camera::{CX, CY, FX, FY};
    for (key, value) in [(&FX, fx), (&FY, fy), (&CX, cx + 0.5), (&CY, cy + 0.5)] {
        toml.number(key.name(), value);
    }
    if !lens.coefficients.is_empty() {
        let key = if lens.is_fisheye { &camera::FISHEYE_DISTORTION } else { &camera::DISTORTION };
        toml.numbers(key.name(), &lens.coefficients);
    }
    Some(())
}

/// The name that the file has for a key that must be there; `meaning` completes the sentence "`key` is …".
fn named<'k>(top: &Fields<'_>, names: &[&'k str], meaning: &str) -> Option<&'k str> {
    names.iter().copied().find(|name| top.get(name).is_some()).or_else(|| {
        top.need(names[0], meaning);
        None
    })
}

/// A matrix: a list of numbers, or a table whose `data` is one.
fn numbers(top: &Fields<'_>, key: &str) -> Option<Spanned<Vec<f64>>> {
    if matches!(top.get(key)?.value, Value::Array(_)) {
        return top.numbers(key);
    }
    let table = top.table(key)?;
    table.need("data", "the matrix's numbers, row by row")?;
    table.numbers("data")
}

/// fx, cx, fy, cy of a camera's matrix, in pixels.
fn intrinsics(top: &Fields<'_>, key: &str) -> Option<[f64; 4]> {
    let Spanned { value: numbers, span } = numbers(top, key)?;
    let file = top.file();
    let &[fx, skew, cx, a, fy, cy, b, c, one] = &numbers[..] else {
        let message = format!("`{key}` has {} numbers", numbers.len());
        return file.fail(span, message, "expected 9: three rows of three", None);
    };
    if !(fx > 0.0 && fy > 0.0) {
        let help = "a camera that is not calibrated has zeros here".to_owned();
        return file.fail(
            span,
            format!("the focal lengths are {fx} and {fy} pixels"),
            "expected more than 0",
            help,
        );
    }
    if [skew, a, b, c] != [0.0; 4] || one != 1.0 {
        let label = "expected fx 0 cx, 0 fy cy, 0 0 1: pixels without skew";
        return file.fail(span, format!("`{key}` is no matrix of a pinhole camera"), label, None);
    }
    Some([fx, cx, fy, cy])
}

struct LensKeys {
    is_fisheye: bool,
    /// The coefficients in OpenCV's order; none if the lens does not distort.
    coefficients: Vec<f64>,
}

fn lens(top: &Fields<'_>) -> Option<LensKeys> {
    let file = top.file();
    let is_fisheye = match top.text("distortion_model") {
        Some("equidistant" | "fisheye") => true,
        None | Some("plumb_bob" | "rational_polynomial" | "none") => {
            matches!(top.text("fisheye_model"), Some("1" | "true"))
        }
        Some(_) => {
            let message = "the distortion model is unknown";
            let label = "expected plumb_bob, rational_polynomial or equidistant";
            return file.fail(top.span("distortion_model"), message, label, None);
        }
    };
    let key = DISTORTION.iter().copied().find(|key| top.get(key).is_some());
    let Spanned { value: values, span } = match key {
        Some(key) => numbers(top, key)?,
        None if is_fisheye => {
            named(top, DISTORTION, "the list of the fisheye's k1 to k4");
            return None;
        }
        None => Spanned { value: Vec::new(), span: file.whole() },
    };
    // A pinhole's list may end with OpenCV's coefficients of the thin prism and of the tilt, which are often all 0.
    let (most, fits) =
        if is_fisheye { (4, values.len() == 4) } else { (8, matches!(values.len(), 0 | 4 | 5 | 8)) };
    let more = values.get(most..).unwrap_or_default();
    if !fits && (more.is_empty() || more.iter().any(|x| *x != 0.0)) {
        let expected = if is_fisheye { "4: k1 k2 k3 k4" } else { "4, 5 or 8: k1 k2 p1 p2 k3 k4 k5 k6" };
        let message = format!("the file has {} distortion coefficients", values.len());
        return file.fail(span, message, format!("expected {expected}"), None);
    }
    let is_ideal = !is_fisheye && values.iter().all(|x| *x == 0.0);
    let coefficients = if is_ideal { Vec::new() } else { values.into_iter().take(most).collect() };
    Some(LensKeys { is_fisheye, coefficients })
}
