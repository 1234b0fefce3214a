//! Hesai's angle and firetime corrections, the CSV files that come with a unit.
//!
//! The manuals give Cartesian coordinates as x = r·cos ε·sin a, y = r·cos ε·cos a, z = r·sin ε. The angle a is the rotor's
//! azimuth, counted clockwise from the y axis, seen from above, plus the channel's azimuth correction. The unit's y axis, where
//! a is 0, becomes the sensor's x axis (forward), and its −x axis the sensor's y axis (left): azimuths change their sign, and
//! so do the corrections.
//!
//! The rotor turns on until a channel fires, which adds to the channel's azimuth.

use std::collections::BTreeMap;

use super::file::File;
use super::lidar::Lidar;
use super::writer::Toml;
use crate::source::csv::Row;
use crate::source::tree::count;

/// Most channels of a file.
const MOST_CHANNELS: u32 = 4096;

/// Whether a header in lower case is that of an angle correction.
pub(super) fn is_header(header: &[String]) -> bool {
    matches!(
        header.iter().map(String::as_str).collect::<Vec<_>>()[..],
        ["channel" | "laser id", "elevation", "azimuth", ..]
    )
}

pub(super) fn write(file: File<'_>, firetimes: Option<File<'_>>, toml: &mut Toml) -> Option<()> {
    let angles = angles(file);
    let times = firetimes.map(firing_times);
    let angles = angles?;
    let times = match times {
        Some(times) => Some(times?),
        None => None,
    };
    // The firing times of the channels in their order, shifted so that the earliest is 0.
    let mut of_channels = Vec::new();
    if let (Some(times), Some(of_times)) = (&times, firetimes) {
        let missing: Vec<String> =
            angles.keys().filter(|c| !times.us.contains_key(c)).map(u32::to_string).collect();
        if !missing.is_empty() {
            let message = format!("the file has no firing time of channel {}", missing.join(", "));
            let help = format!("{} lists {} channels", file.short_name(), angles.len());
            return of_times.fail(of_times.whole(), message, "", help);
        }
        of_channels = angles.keys().filter_map(|channel| times.us.get(channel).copied()).collect();
    }
    let first = of_channels.iter().copied().fold(f64::INFINITY, f64::min);
    let of_channels: Vec<f64> = of_channels.iter().map(|t| rounded(t - first)).collect();

    toml.comment(&format!("A Hesai LiDAR with {} channels: {}.", angles.len(), file.short_name()));
    toml.comment(
        "\nUsed: the elevation and the azimuth correction of each channel. Hesai counts azimuths clockwise from its y axis, \
         which is the x axis (forward) here, so the corrections have the opposite sign below.",
    );
    match (&times, firetimes) {
        (Some(times), Some(of_times)) => {
            let moved = if first == 0.0 {
                String::new()
            } else {
                format!(", counted from the earliest ({first} µs)")
            };
            toml.comment(&format!("The firing times are from {}{moved}.", of_times.short_name()));
            if let Some(note) = &times.note {
                toml.comment(note);
            }
        }
        _ => toml
            .comment("Not known: firing times, which are in a file of their own (--firetimes imports it)."),
    }
    toml.comment(
        "Not in the file, and to be checked: columns and rate (the usual values), range limits (none are set).",
    );
    toml.line("\n# The ring of a cloud counts channels from 0, in the order of the file.");
    let (elevations, corrections): (Vec<f64>, Vec<f64>) = angles.into_values().unzip();
    let offsets = corrections.into_iter().map(|correction| -correction).collect();
    let lidar = Lidar::usual(elevations, offsets);
    let lidar = if times.is_some() { lidar.firing_at(of_channels) } else { lidar };
    lidar.write("file", toml);
    Some(())
}

/// Rounds a difference of two times to 10⁻⁶ µs, which removes the rounding errors of the subtraction: files have three
/// decimals of a microsecond.
fn rounded(us: f64) -> f64 {
    (us * 1e6).round() / 1e6
}

/// Elevation and azimuth correction in degrees by channel.
fn angles(file: File<'_>) -> Option<BTreeMap<u32, (f64, f64)>> {
    let mut lines = file.rows();
    let Some(header) = lines.next() else { return file.fail(file.whole(), "the file is empty", "", None) };
    if !is_header(&header.lowercase()) {
        let label = "expected the columns Channel, Elevation, Azimuth";
        return file.fail(header.span, "this is no angle correction", label, None);
    }
    let mut angles = BTreeMap::new();
    for row in lines {
        let Some(channel) = channel(file, &row, 3) else { continue };
        let elevation = row.cells[1].number(file.report, "Elevation");
        let azimuth = row.cells[2].number(file.report, "Azimuth");
        if let Some(steep) = elevation.filter(|e| e.abs() > 90.0) {
            let message = format!("channel {channel} has an elevation of {steep} degrees");
            file.fail::<()>(row.cells[1].span, message, "expected -90 to 90", None);
        }
        if let Some(far) = azimuth.filter(|a| a.abs() > 360.0) {
            let message = format!("channel {channel} has an azimuth correction of {far} degrees");
            file.fail::<()>(row.cells[2].span, message, "expected -360 to 360", None);
        }
        if let (Some(elevation), Some(azimuth)) = (elevation, azimuth)
            && angles.insert(channel, (elevation, azimuth)).is_some()
        {
            file.fail::<()>(row.span, format!("channel {channel} is listed twice"), "", None);
        }
    }
    if angles.is_empty() && !file.has_errors() {
        return file.fail(file.whole(), "the file lists no channel", "", None);
    }
    (!file.has_errors()).then_some(angles)
}

/// The channel of a row, which must have at least `cells` fields.
fn channel(file: File<'_>, row: &Row<'_>, cells: usize) -> Option<u32> {
    if row.cells.len() < cells {
        let message = format!("the line has {}", count(row.cells.len(), "field"));
        return file.fail(row.span, message, format!("expected {cells}"), None);
    }
    row.cells[0].integer(file.report, "Channel", 1, MOST_CHANNELS)
}

/// When the channels fire, counted from the start of their column.
struct FiringTimes {
    /// Microseconds by channel.
    us: BTreeMap<u32, f64>,
    /// A comment on the part of the file that a sensor file cannot express.
    note: Option<String>,
}

/// Reads a firetime correction, of which Hesai has four layouts.
fn firing_times(file: File<'_>) -> Option<FiringTimes> {
    let lines: Vec<Row<'_>> = file.rows().collect();
    let word = |line: usize| lines.get(line).map_or(String::new(), |row| row.cells[0].text.to_lowercase());
    let has_header =
        |name: &str| lines.get(2).is_some_and(|row| row.cells[0].text.eq_ignore_ascii_case(name));
    let made = if word(0) == "channel" {
        one_time_each(file, &lines[1..])
    } else if word(0) == "operational state" && word(1) == "azimuth state" {
        by_state(file, &lines, 0, 1.0)
    } else if word(1) == "operation mode" && has_header("angle state") {
        by_state(file, &lines, 1, 1e-3)
    } else if word(0) == "eeff" && has_header("loop1") {
        by_loop(file, &lines[3..])
    } else {
        let label = "expected the header `Channel,fire time(us)`, or the states or loops of a newer unit";
        return file.fail(file.whole(), "this is no known firetime correction", label, None);
    };
    (!file.has_errors()).then_some(made)
}

/// Reads the layout `Channel,fire time(us)` of PandarXT, PandarQT and Pandar40P.
fn one_time_each(file: File<'_>, lines: &[Row<'_>]) -> FiringTimes {
    let mut us = BTreeMap::new();
    for row in lines {
        let Some(channel) = channel(file, row, 2) else { continue };
        let Some(time) = row.cells[1].number(file.report, "fire time") else { continue };
        if us.insert(channel, time).is_some() {
            file.fail::<()>(row.span, format!("channel {channel} is listed twice"), "", None);
        }
    }
    FiringTimes { us, note: None }
}

/// Reads the layout with one column for each pair of an operational state and an azimuth state. OT128 gives microseconds, and
/// `-` where a channel does not fire. Pandar128 gives nanoseconds, 0 where a channel does not fire, and each state twice, for
/// far and for near targets. `modes` is the line of the operational states.
fn by_state(file: File<'_>, lines: &[Row<'_>], modes: usize, us_per_unit: f64) -> FiringTimes {
    let mode = lines[modes].cells.get(1).map_or("", |cell| cell.text);
    let is_of_mode = |column: usize| lines[modes].cells.get(column).is_some_and(|cell| cell.text == mode);
    let is_silent = |text: &str| text == "-" || (us_per_unit < 1.0 && text == "0");
    let mut us = BTreeMap::new();
    for row in &lines[modes + 2..] {
        let Some(channel) = channel(file, row, 2) else { continue };
        let fires =
            row.cells.iter().enumerate().skip(1).find(|(c, cell)| is_of_mode(*c) && !is_silent(cell.text));
        let Some((_, cell)) = fires else { continue };
        let Some(time) = cell.number(file.report, "firing time") else { continue };
        if us.insert(channel, time * us_per_unit).is_some() {
            file.fail::<()>(row.span, format!("channel {channel} is listed twice"), "", None);
        }
    }
    let note = format!(
        "Left out: the unit fires some channels in some azimuth states only. Here each channel fires in every column, at \
         the time of the first azimuth state of operational state {mode} in which it fires."
    );
    FiringTimes { us, note: Some(note) }
}

/// Reads the layout of QT128: pairs of channel and time, one pair of columns a loop, padded with zeros.
fn by_loop(file: File<'_>, lines: &[Row<'_>]) -> FiringTimes {
    let mut us = BTreeMap::new();
    let loops = lines.iter().map(|row| row.cells.len() / 2).max().unwrap_or(0);
    for of_loop in 0..loops {
        for row in lines {
            let [channel, time] = match row.cells.get(2 * of_loop..2 * of_loop + 2) {
                Some([channel, time]) if channel.text != "0" && !time.text.is_empty() => [channel, time],
                _ => continue,
            };
            let channel = channel.integer(file.report, "channel", 1, MOST_CHANNELS);
            let time = time.number(file.report, "firing time");
            if let (Some(channel), Some(time)) = (channel, time) {
                us.entry(channel).or_insert(time);
            }
        }
    }
    let note = "Left out: the unit alternates between loops of different channels. Here each channel fires in every column, \
                at the time of the first loop in which it fires.";
    FiringTimes { us, note: Some(note.to_owned()) }
}
