//! Open3D's `PinholeCameraIntrinsic` as JSON: `width`, `height` and `intrinsic_matrix`, which is written column by column. It is
//! the whole file, or the key `intrinsic` of a `PinholeCameraParameters`, or the metadata of a recording. The pinhole has no
//! distortion.

use super::super::fields::Fields;
use super::calibration::{Calibration, LensKeys, check_focal, from_corner, size};
use crate::source::Spanned;
use crate::source::tree::Value;

const MATRIX: &str = "intrinsic_matrix";

pub(super) fn read(fields: &Fields<'_>) -> Option<Calibration> {
    if fields.get(MATRIX).is_none() && fields.get("intrinsic").is_some() {
        let mut found = read(&fields.table("intrinsic")?)?;
        found.notes.push("Left out: the extrinsic matrix; the camera's pose goes into the job.".to_owned());
        return Some(found);
    }
    let size = size(fields, ["width", "height"]);
    fields.need(MATRIX, "the camera's matrix: fx 0 0, 0 fy 0, cx cy 1, column by column");
    let matrix = matrix(fields);
    let ([width, height], [fx, fy, cx, cy]) = (size?, matrix?);
    let focal = check_focal(fields, MATRIX, [fx, fy])?;
    Some(Calibration {
        width,
        height,
        focal,
        principal: from_corner([cx, cy]),
        lens: LensKeys::pinhole(Vec::new()),
        used: "size, intrinsic_matrix (column by column)".to_owned(),
        notes: Vec::new(),
    })
}

/// fx, fy, cx, cy. A list of nine is column by column, as Open3D writes it. Where it is a list of three rows, or where its zeros
/// stand as in rows, as in files that were written by hand, it is row by row: no matrix of a camera fits both.
fn matrix(fields: &Fields<'_>) -> Option<[f64; 4]> {
    let file = fields.file();
    let Spanned { value: m, span } = match &fields.get(MATRIX)?.value {
        Value::Array(rows) if rows.iter().any(|row| matches!(row.value, Value::Array(_))) => {
            fields.numbers_of_rows(MATRIX)?
        }
        _ => fields.numbers(MATRIX)?,
    };
    let (fx, fy, cx, cy, zeros, one) = match m[..] {
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, one] if (cx, cy) != (0.0, 0.0) => {
            (fx, fy, cx, cy, [0.0; 4], one)
        }
        [fx, a, b, c, fy, d, cx, cy, one] => (fx, fy, cx, cy, [a, b, c, d], one),
        _ => {
            let message = format!("`{}` has {} numbers", fields.path(MATRIX), m.len());
            return file.fail(span, message, "expected 9: three columns of three", None);
        }
    };
    if zeros != [0.0; 4] || one != 1.0 {
        let message = format!("`{}` is no matrix of a pinhole camera", fields.path(MATRIX));
        return file.fail(span, message, "expected fx 0 0, 0 fy 0, cx cy 1: pixels without skew", None);
    }
    Some([fx, fy, cx, cy])
}
