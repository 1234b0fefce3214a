//! Hesai's angle and firetime corrections, the CSV files that come with a unit.
//!
//! The manuals' Cartesian coordinates are x = r·cos ε·sin a, y = r·cos ε·cos a, z = r·sin ε, where a is the rotor's azimuth,
//! clockwise seen from above from the y axis, plus the channel's azimuth correction. The unit's y axis, where a is 0, becomes
//! the sensor's x (forward), and its −x the sensor's y (left): azimuths change their sign, and so do the corrections.
//!
//! A firing time moves a channel's azimuth on by what the rotor turns in it.

use std::collections::BTreeMap;

use super::file_name;
use super::lidar::Lidar;
use super::report::Report;
use super::table::{Row, rows};
use super::writer::Toml;

/// Most channels of a file.
const MOST_CHANNELS: u32 = 4096;

/// The columns of an angle correction, by what may stand in its head.
pub(super) fn is_head(head: &[String]) -> bool {
    matches!(
        head.iter().map(String::as_str).collect::<Vec<_>>()[..],
        ["channel" | "laser id", "elevation", "azimuth", ..]
    )
}

pub(super) fn write(report: &Report, firetimes: Option<&Report>, toml: &mut Toml) -> Option<()> {
    let angles = angles(report);
    let times = firetimes.map(firing_times);
    let angles = angles?;
    let times = match times {
        Some(times) => Some(times?),
        None => None,
    };
    // One time a channel, the earliest at 0.
    let mut of_channels = Vec::new();
    if let (Some(times), Some(file)) = (&times, firetimes) {
        let missing: Vec<String> =
            angles.keys().filter(|c| !times.us.contains_key(c)).map(u32::to_string).collect();
        if !missing.is_empty() {
            let message = format!("no firing time of channel {}", missing.join(", "));
            let help = format!("{} lists {} channels", file_name(report.name()), angles.len());
            return file.error(0..0, message, "", help);
        }
        of_channels = angles.keys().filter_map(|channel| times.us.get(channel).copied()).collect();
    }
    let first = of_channels.iter().copied().fold(f64::INFINITY, f64::min);
    let of_channels: Vec<f64> = of_channels.iter().map(|t| rounded(t - first)).collect();

    toml.comment(&format!("A Hesai LiDAR with {} channels: {}.", angles.len(), file_name(report.name())));
    toml.comment(
        "\nUsed: elevation and azimuth correction of each channel. Hesai counts azimuths clockwise from its y axis, which \
         is forward (x) here: the corrections have the other sign below.",
    );
    match (&times, firetimes) {
        (Some(times), Some(file)) => {
            let moved = if first == 0.0 {
                String::new()
            } else {
                format!(", counted from the earliest ({first} µs)")
            };
            toml.comment(&format!("Firing times: {}{moved}.", file_name(file.name())));
            if let Some(note) = &times.note {
                toml.comment(note);
            }
        }
        _ => toml.comment(
            "Not known: firing times, which are in a file of their own (import it with --firetimes).",
        ),
    }
    toml.comment(
        "Not in the file, and to be checked: columns and rate (the usual ones), range limits (none).",
    );
    toml.line("\n# A cloud's ring counts channels, from 0.");
    let (elevations, corrections): (Vec<f64>, Vec<f64>) = angles.into_values().unzip();
    let offsets = corrections.into_iter().map(|correction| -correction).collect();
    let lidar = Lidar::usual(elevations, offsets);
    let lidar = if times.is_some() { lidar.firing_at(of_channels) } else { lidar };
    lidar.write("file", toml);
    Some(())
}

/// Differences of decimals, without the dust that binary leaves: files have three decimals of a microsecond.
fn rounded(us: f64) -> f64 {
    (us * 1e6).round() / 1e6
}

/// Elevation and azimuth correction in degrees by channel.
fn angles(report: &Report) -> Option<BTreeMap<u32, (f64, f64)>> {
    let mut lines = rows(report.text());
    let Some(head) = lines.next() else { return report.error(0..0, "the file is empty", "", None) };
    let names: Vec<String> = head.cells.iter().map(|cell| cell.text.to_lowercase()).collect();
    if !is_head(&names) {
        let label = "expected the columns Channel, Elevation, Azimuth";
        return report.error(head.span, "this is no angle correction", label, None);
    }
    let mut angles = BTreeMap::new();
    for row in lines {
        let Some(channel) = channel(report, &row, 3) else { continue };
        let elevation = row.cells[1].number(report, "Elevation");
        let azimuth = row.cells[2].number(report, "Azimuth");
        if let Some(steep) = elevation.filter(|e| e.abs() > 90.0) {
            let message = format!("channel {channel} has an elevation of {steep} degrees");
            report.error::<()>(row.cells[1].span.clone(), message, "expected -90 to 90", None);
        }
        if let Some(far) = azimuth.filter(|a| a.abs() > 360.0) {
            let message = format!("channel {channel} has an azimuth correction of {far} degrees");
            report.error::<()>(row.cells[2].span.clone(), message, "expected -360 to 360", None);
        }
        if let (Some(elevation), Some(azimuth)) = (elevation, azimuth)
            && angles.insert(channel, (elevation, azimuth)).is_some()
        {
            report.error::<()>(row.span, format!("channel {channel} is listed twice"), "", None);
        }
    }
    if angles.is_empty() && !report.has_errors() {
        return report.error(0..0, "the file lists no channel", "", None);
    }
    (!report.has_errors()).then_some(angles)
}

/// The channel of a row of at least `cells` fields.
fn channel(report: &Report, row: &Row<'_>, cells: usize) -> Option<u32> {
    if row.cells.len() < cells {
        let message = format!("a line of {} fields", row.cells.len());
        return report.error(row.span.clone(), message, format!("expected {cells}"), None);
    }
    row.cells[0].integer(report, "Channel", 1, MOST_CHANNELS)
}

/// When channels fire in a column.
struct FiringTimes {
    us: BTreeMap<u32, f64>,
    /// What was left out.
    note: Option<String>,
}

/// Hesai has four layouts of this file.
fn firing_times(report: &Report) -> Option<FiringTimes> {
    let lines: Vec<Row<'_>> = rows(report.text()).collect();
    let word = |line: usize| lines.get(line).map_or(String::new(), |row| row.cells[0].text.to_lowercase());
    let has_head = |name: &str| lines.get(2).is_some_and(|row| row.cells[0].text.eq_ignore_ascii_case(name));
    let made = if word(0) == "channel" {
        one_time_each(report, &lines[1..])
    } else if word(0) == "operational state" && word(1) == "azimuth state" {
        by_state(report, &lines, 0, 1.0)
    } else if word(1) == "operation mode" && has_head("angle state") {
        by_state(report, &lines, 1, 1e-3)
    } else if word(0) == "eeff" && has_head("loop1") {
        by_loop(report, &lines[3..])
    } else {
        let label = "expected the head `Channel,fire time(us)`, or the states or loops of a newer unit";
        return report.error(0..0, "this is no firetime correction that is known", label, None);
    };
    (!report.has_errors()).then_some(made)
}

/// `Channel,fire time(us)`: PandarXT, PandarQT, Pandar40P.
fn one_time_each(report: &Report, lines: &[Row<'_>]) -> FiringTimes {
    let mut us = BTreeMap::new();
    for row in lines {
        let Some(channel) = channel(report, row, 2) else { continue };
        let Some(time) = row.cells[1].number(report, "fire time") else { continue };
        if us.insert(channel, time).is_some() {
            report.error::<()>(row.span.clone(), format!("channel {channel} is listed twice"), "", None);
        }
    }
    FiringTimes { us, note: None }
}

/// A column an operational and an azimuth state: OT128 (microseconds, `-` where a channel doesn't fire) and Pandar128
/// (nanoseconds, 0 there; and each state twice, for far and for near targets). `modes` is the line of the operational
/// states.
fn by_state(report: &Report, lines: &[Row<'_>], modes: usize, us_per_unit: f64) -> FiringTimes {
    let mode = lines[modes].cells.get(1).map_or("", |cell| cell.text);
    let is_of_mode = |column: usize| lines[modes].cells.get(column).is_some_and(|cell| cell.text == mode);
    let is_silent = |text: &str| text == "-" || (us_per_unit < 1.0 && text == "0");
    let mut us = BTreeMap::new();
    for row in &lines[modes + 2..] {
        let Some(channel) = channel(report, row, 2) else { continue };
        let fires =
            row.cells.iter().enumerate().skip(1).find(|(c, cell)| is_of_mode(*c) && !is_silent(cell.text));
        let Some((_, cell)) = fires else { continue };
        let Some(time) = cell.number(report, "firing time") else { continue };
        if us.insert(channel, time * us_per_unit).is_some() {
            report.error::<()>(row.span.clone(), format!("channel {channel} is listed twice"), "", None);
        }
    }
    let note = format!(
        "Left out: the unit fires some channels in some azimuth states only. Here each fires in every column, at the time \
         of the first state of operational state {mode} in which it does."
    );
    FiringTimes { us, note: Some(note) }
}

/// Pairs of channel and time, a pair of columns a loop: QT128. Padded with zeros.
fn by_loop(report: &Report, lines: &[Row<'_>]) -> FiringTimes {
    let mut us = BTreeMap::new();
    let loops = lines.iter().map(|row| row.cells.len() / 2).max().unwrap_or(0);
    for of_loop in 0..loops {
        for row in lines {
            let [channel, time] = match row.cells.get(2 * of_loop..2 * of_loop + 2) {
                Some([channel, time]) if channel.text != "0" && !time.text.is_empty() => [channel, time],
                _ => continue,
            };
            let channel = channel.integer(report, "channel", 1, MOST_CHANNELS);
            let time = time.number(report, "firing time");
            if let (Some(channel), Some(time)) = (channel, time) {
                us.entry(channel).or_insert(time);
            }
        }
    }
    let note = "Left out: the unit alternates between loops with other channels. Here each fires in every column, at the \
                time of the first loop in which it does.";
    FiringTimes { us, note: Some(note.to_owned()) }
}
