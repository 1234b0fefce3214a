//! Ouster's metadata: the JSON that a sensor sends on request, and that is stored beside recordings.
//!
//! The lookup table of the vendor's SDK computes a point from a range r (README of ouster-sdk; the sensor's software manual,
//! "Lidar range to XYZ"). With W columns, the encoder's angle θe = 2π(1 − column/W), θa = −beam_azimuth_angles, φ =
//! beam_altitude_angles, and (nx, nz) from beam_to_lidar_transform, in millimetres:
//!
//! ```text
//! n = √(nx² + nz²) if nz ≠ 0, else nx
//! x = (r − n)·cos(θe + θa)·cos φ + nx·cos θe
//! y = (r − n)·sin(θe + θa)·cos φ + nx·sin θe
//! z = (r − n)·sin φ + nz
//! ```
//!
//! lidar_to_sensor_transform then transforms the point to the sensor frame, whose x axis is forward: half a turn about z and an
//! offset `up` along z. So the head's azimuth is θe plus half a turn, the beams' origin in the head's frame is
//! (nx, 0, nz + up), and ranges are counted from n before that origin.

use super::fields::Fields;
use super::file::File;
use super::lidar::Lidar;
use super::writer::Toml;
use crate::source::{Span, Spanned};

/// The tables of nested metadata. Flat metadata has all their keys in `top`.
struct Metadata<'a> {
    top: Fields<'a>,
    beams: Option<Fields<'a>>,
    lidar: Option<Fields<'a>>,
    format: Option<Fields<'a>>,
    about: Option<Fields<'a>>,
    settings: Option<Fields<'a>>,
}

impl<'a> Metadata<'a> {
    fn beams(&self) -> &Fields<'a> {
        self.beams.as_ref().unwrap_or(&self.top)
    }

    fn lidar(&self) -> &Fields<'a> {
        self.lidar.as_ref().unwrap_or(&self.top)
    }

    fn about(&self, key: &str) -> Option<&'a str> {
        self.about.as_ref().unwrap_or(&self.top).text(key)
    }
}

/// The table that a sensor answered to a command. Firmware before 1.14 did not know all commands, and the SDK's client stores
/// what it answered instead: `"error: Command not recognized."`.
fn answer<'a>(top: &Fields<'a>, key: &str) -> Option<Fields<'a>> {
    match top.text(key) {
        Some(text) if text.starts_with("error") => None,
        _ => top.table(key),
    }
}

pub(super) fn write(file: File<'_>, toml: &mut Toml) -> Option<()> {
    let document = file.document()?;
    let top = Fields::new(file, "", &document)?;
    let metadata = Metadata {
        beams: top.table("beam_intrinsics"),
        lidar: top.table("lidar_intrinsics"),
        format: answer(&top, "lidar_data_format").or_else(|| answer(&top, "data_format")),
        about: top.table("sensor_info"),
        settings: top.table("config_params"),
        top,
    };
    let beams = beams(&metadata);
    let mode = mode(&metadata);
    let origin = origin(&metadata);
    let (turn_deg, up_mm) = lidar_to_sensor(&metadata)?;
    let (beams, mode, origin) = (beams?, mode?, origin?);
    let window = window(&metadata, mode.columns)?;
    let shifts = shifts(&metadata, beams.altitudes.len(), mode.columns)?;
    let is_full_turn = window.count == mode.columns;
    if file.has_errors() {
        return None;
    }

    let model = metadata.about("prod_line").unwrap_or("unknown model");
    let serial = metadata.about("prod_sn").unwrap_or("unknown");
    let firmware = metadata.about("image_rev").or(metadata.about("build_rev")).unwrap_or("unknown");
    toml.comment(&format!(
        "Ouster {model}, serial number {serial}, firmware {firmware}: {}.",
        file.short_name()
    ));
    toml.comment(&format!(
        "\nUsed: the altitudes and azimuths of the {} beams, beam_to_lidar_transform or lidar_origin_to_beam_origin_mm \
         (beams start on a circle around the axis; ranges count from the axis, as the unit's do), \
         lidar_to_sensor_transform, the mode. Ouster's beam azimuths are clockwise, so they have the opposite sign below.",
        beams.altitudes.len()
    ));
    for note in [&beams.note, &origin.note, &window.note].into_iter().flatten() {
        toml.comment(note);
    }
    toml.comment(match (&shifts, is_full_turn) {
        (Some(_), true) => {
            "The image is staggered, as measured. With layout = \"destaggered\" it is the one of the SDK's destagger: \
             pixel_shift_by_row is the unit's own, for this number of columns."
        }
        (Some(_), false) => {
            "Left out: pixel_shift_by_row, since the columns of less than a turn do not wrap around."
        }
        (None, _) => "Not in the file: pixel_shift_by_row. A destaggered image moves rows as the azimuths say.",
    });
    toml.comment(
        "Left out: the pose of the IMU, addresses, clocks and other settings. Not in the file, and to be checked: range \
         limits (none are set).",
    );
    toml.line("\n# The ring of a cloud counts beams from the top, as in Ouster's drivers.");
    let position = [origin.nx / 1e3, 0.0, (origin.nz + up_mm) / 1e3];
    // The encoder's angle at column 0 is a full turn.
    let azimuth = |column: u32| turn_deg - 360.0 * f64::from(column) / f64::from(mode.columns);
    let count = window.count;
    let sector = match count == mode.columns {
        true => (turn_deg, turn_deg - 360.0),
        // A sector of less than a turn has its last column at its end. One column alone still needs a sector.
        false => (azimuth(window.first), azimuth(window.first + (count - 1).max(1))),
    };
    let lidar = Lidar {
        origins_m: Some(vec![position; beams.altitudes.len()]),
        range_offset_m: origin.n / 1e3,
        pixel_shifts: shifts.filter(|_| is_full_turn),
        columns: count,
        sector_deg: Some(sector),
        rate_hz: f64::from(mode.rate_hz),
        ..Lidar::usual(beams.altitudes, beams.azimuths.iter().map(|a| -a).collect())
    };
    lidar.write("file", toml);
    Some(())
}

struct Beams {
    altitudes: Vec<f64>,
    azimuths: Vec<f64>,
    note: Option<String>,
}

fn beams(metadata: &Metadata<'_>) -> Option<Beams> {
    let fields = metadata.beams();
    let file = fields.file();
    let node = fields.need("beam_altitude_angles", "the list of the beams' elevations in degrees");
    fields.need("beam_azimuth_angles", "the list of the beams' azimuths in degrees");
    let altitudes = fields.numbers("beam_altitude_angles");
    let azimuths = fields.numbers("beam_azimuth_angles");
    node?;
    let (Spanned { value: altitudes, span }, Spanned { value: azimuths, span: of_azimuths }) =
        (altitudes?, azimuths?);
    if altitudes.len() != azimuths.len() {
        let message = format!("there are {} altitudes and {} azimuths", altitudes.len(), azimuths.len());
        return file.fail(of_azimuths, message, "expected as many as `beam_altitude_angles`", None);
    }
    if let Some(steep) = altitudes.iter().find(|a| a.abs() > 90.0) {
        let message = format!("a beam has an altitude of {steep} degrees");
        return file.fail(span, message, "expected -90 to 90", None);
    }
    if let Some(far) = azimuths.iter().find(|a| a.abs() > 360.0) {
        let message = format!("a beam has an azimuth of {far} degrees");
        return file.fail(of_azimuths, message, "expected -360 to 360", None);
    }
    // Firmware before 1.14 lists 64 beams for every sensor, with zeros for the beams that the sensor lacks.
    let listed = altitudes.len();
    let (altitudes, azimuths): (Vec<f64>, Vec<f64>) =
        altitudes.into_iter().zip(azimuths).filter(|beam| *beam != (0.0, 0.0)).unzip();
    if altitudes.is_empty() {
        let help =
            "the sensor was not calibrated or not running when it wrote this: request the metadata again"
                .to_owned();
        return file.fail(span, "every beam's angles are 0", "expected the beams' angles", help);
    }
    let expected = metadata.format.as_ref().and_then(|f| f.integer("pixels_per_column", 1, 1024));
    if let Some(expected) = expected.filter(|n| *n as usize != altitudes.len()) {
        let message = format!("there are {} beams, but `pixels_per_column` is {expected}", altitudes.len());
        return file.fail(span, message, format!("expected {expected}"), None);
    }
    let unused = listed - altitudes.len();
    let note = (unused > 0).then(|| {
        format!("Left out: {unused} of {listed} listed beams, whose angles are both 0, since this unit does not have them.")
    });
    Some(Beams { altitudes, azimuths, note })
}

struct Mode {
    columns: u32,
    rate_hz: u32,
}

/// Columns and rate of `lidar_mode`, such as 1024x10. The data format must give the same columns.
fn mode(metadata: &Metadata<'_>) -> Option<Mode> {
    let in_settings = metadata.settings.as_ref().filter(|s| s.get("lidar_mode").is_some());
    let fields = in_settings.unwrap_or(&metadata.top);
    let file = fields.file();
    let node = fields.need("lidar_mode", "the columns a turn and the turns a second, such as \"1024x10\"")?;
    let text = fields.text("lidar_mode").unwrap_or("");
    let parsed =
        text.split_once('x').and_then(|(columns, rate)| Some((columns.parse().ok()?, rate.parse().ok()?)));
    let valid = parsed.filter(|(columns, rate)| (1..=65_536).contains(columns) && (1..=1000).contains(rate));
    let Some((columns, rate_hz)) = valid else {
        let message = format!("`lidar_mode` is {}", node.value.describe());
        let label = "expected columns and rate, such as \"1024x10\"";
        return file.fail(node.span, message, label, None);
    };
    if let Some(format) = &metadata.format {
        format.need("columns_per_frame", &format!("the columns of a turn: `lidar_mode` says {columns}"))?;
        let given = format.integer("columns_per_frame", 1, 65_536)?;
        if given != columns {
            let message = format!("`columns_per_frame` is {given}, and `lidar_mode` is \"{text}\"");
            return file.fail(format.span("columns_per_frame"), message, format!("expected {columns}"), None);
        }
    }
    Some(Mode { columns, rate_hz })
}

/// The columns by which the SDK moves each row of a destaggered image; `None` within if the file has none.
fn shifts(metadata: &Metadata<'_>, beams: usize, columns: u32) -> Option<Option<Vec<i32>>> {
    let key = "pixel_shift_by_row";
    let Some(format) = metadata.format.as_ref().filter(|format| format.get(key).is_some()) else {
        return Some(None);
    };
    let Spanned { value, span } = format.numbers(key)?;
    if value.len() != beams {
        let message =
            format!("`{}` has {} numbers, and there are {beams} beams", format.path(key), value.len());
        return format.file().fail(span, message, format!("expected {beams}: one a beam"), None);
    }
    let is_shift = |x: &f64| x.fract() == 0.0 && x.abs() < f64::from(columns);
    if let Some(wrong) = value.iter().find(|x| !is_shift(x)) {
        let message = format!("`{}` has {wrong}", format.path(key));
        let label = format!("expected whole numbers of columns, of which there are {columns}");
        return format.file().fail(span, message, label, None);
    }
    Some(Some(value.into_iter().map(|x| x as i32).collect()))
}

struct Window {
    first: u32,
    count: u32,
    note: Option<String>,
}

/// The columns that the unit sends: all of them, or a window from one column to another, which may go past the last column
/// to the first.
fn window(metadata: &Metadata<'_>, columns: u32) -> Option<Window> {
    let given = metadata.format.as_ref().and_then(|f| f.numbers("column_window"));
    let Some(window) = given else {
        return Some(Window { first: 0, count: columns, note: None });
    };
    let is_column = |x: f64| x.fract() == 0.0 && (0.0..f64::from(columns)).contains(&x);
    let (first, last) = match window.value[..] {
        [first, last] if is_column(first) && is_column(last) => (first as u32, last as u32),
        _ => {
            let label = format!("expected the first and the last column, 0 to {}", columns - 1);
            return metadata.top.file().fail(window.span, "this is no window of columns", label, None);
        }
    };
    let count = (last + columns - first) % columns + 1;
    if count == columns {
        return Some(Window { first: 0, count, note: None });
    }
    let note = format!(
        "The unit sends {count} of {columns} columns a turn, from column {first} to column {last} (column_window)."
    );
    Some(Window { first, count, note: Some(note) })
}

/// The origin of the beams in millimetres: nx from the axis and nz up. Ranges are counted from n before it.
struct Origin {
    nx: f64,
    nz: f64,
    n: f64,
    note: Option<String>,
}

/// The SDK's defaults for metadata of firmware before 1.14: the millimetres from the axis to the beams' origin by the start of
/// the product line.
const DEFAULT_ORIGINS_MM: [(&str, f64); 3] = [("OS-0-", 27.67), ("OS-1-", 15.806), ("OS-2-", 13.762)];

fn origin(metadata: &Metadata<'_>) -> Option<Origin> {
    let fields = metadata.beams();
    if fields.get("beam_to_lidar_transform").is_some() {
        let Spanned { value: m, span } = transform(fields, "beam_to_lidar_transform")?;
        let rotation = [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]];
        if rotation != [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] || m[7] != 0.0 {
            let label = "expected no rotation, and no offset in y";
            let message =
                "the beams are rotated against the head, or start beside its axis, which no known sensor has";
            return fields.file().fail(span, message, label, None);
        }
        let (nx, nz) = (m[3], m[11]);
        let n = if nz == 0.0 { nx } else { (nx * nx + nz * nz).sqrt() };
        return not_negative(fields, span, Origin { nx, nz, n, note: None });
    }
    if let Some(node) = fields.get("lidar_origin_to_beam_origin_mm") {
        let n = fields.number("lidar_origin_to_beam_origin_mm")?;
        return not_negative(fields, node.span, Origin { nx: n, nz: 0.0, n, note: None });
    }
    let line = metadata.about("prod_line").unwrap_or("");
    let Some((_, n)) = DEFAULT_ORIGINS_MM.iter().find(|(prefix, _)| line.starts_with(prefix)) else {
        fields.need(
            "lidar_origin_to_beam_origin_mm",
            "the distance from the axis to the beams' origin; without it, `prod_line` must give the model",
        );
        return None;
    };
    let note = format!(
        "The file has no lidar_origin_to_beam_origin_mm, as is usual before firmware 1.14. The vendor's SDK takes {n} mm for \
         {line}, and so does this file."
    );
    Some(Origin { nx: *n, nz: 0.0, n: *n, note: Some(note) })
}

fn not_negative(fields: &Fields<'_>, span: Span, origin: Origin) -> Option<Origin> {
    if origin.n >= 0.0 {
        return Some(origin);
    }
    let message = format!("beams start {} mm from the axis", origin.n);
    fields.file().fail(span, message, "expected 0 or more", None)
}

/// The turn about z in degrees and the offset along z in millimetres.
fn lidar_to_sensor(metadata: &Metadata<'_>) -> Option<(f64, f64)> {
    let fields = metadata.lidar();
    fields.need(
        "lidar_to_sensor_transform",
        "the pose of the lidar in the sensor frame: 16 numbers, row by row",
    )?;
    let Spanned { value: m, span } = transform(fields, "lidar_to_sensor_transform")?;
    let is_about_z = [m[2], m[6], m[8], m[9]].iter().all(|x| *x == 0.0)
        && m[10] == 1.0
        && (m[0] - m[5]).abs() < 1e-6
        && (m[1] + m[4]).abs() < 1e-6
        && (m[0] * m[0] + m[4] * m[4] - 1.0).abs() < 1e-6;
    if !is_about_z || m[3] != 0.0 || m[7] != 0.0 {
        let label = "expected a turn about z, and an offset along z";
        let help = "put any other rotation and offset into the sensor's pose in the job".to_owned();
        return fields.file().fail(span, "the lidar is tilted, or off its sensor's axis", label, help);
    }
    let turn = libm::atan2(m[4], m[0]).to_degrees();
    Some((if turn <= -180.0 { turn + 360.0 } else { turn }, m[11]))
}

/// A matrix of 4 × 4 numbers, row by row, whose last row is 0 0 0 1.
fn transform(fields: &Fields<'_>, key: &str) -> Option<Spanned<[f64; 16]>> {
    let Spanned { value: numbers, span } = fields.numbers(key)?;
    match <[f64; 16]>::try_from(numbers) {
        Ok(value) if value[12..] == [0.0, 0.0, 0.0, 1.0] => Some(Spanned { value, span }),
        Ok(_) => {
            let message = format!("the last row of `{}` is not 0 0 0 1", fields.path(key));
            fields.file().fail(span, message, "expected a rotation and a translation", None)
        }
        Err(numbers) => {
            let message = format!("`{}` has {} numbers", fields.path(key), numbers.len());
            fields.file().fail(span, message, "expected 16: four rows of four", None)
        }
    }
}
