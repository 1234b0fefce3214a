//! Hesai's angle and firetime corrections, the CSV files that come with a unit.
//!
//! The manuals give Cartesian coordinates as x = r·cos ε·sin a, y = r·cos ε·cos a, z = r·sin ε. The angle a is the rotor's
//! azimuth, counted clockwise from the y axis, seen from above, plus the channel's azimuth correction. The unit's y axis, where
//! a is 0, becomes the sensor's x axis (forward), and its −x axis the sensor's y axis (left): azimuths change their sign, and
//! so do the corrections.
//!
//! The rotor turns on until a channel fires, which adds to the channel's azimuth: HesaiLidar_SDK_2.0 adds 360·rate·t for a
//! firing time t, which counts from the block's time and is negative in some units.

use std::collections::BTreeMap;

use super::file::File;
use super::lidar::{Lidar, MOST_BEAMS, Turn};
use super::writer::Toml;
use crate::config::keys::sensor::rotating::MOST_PHASES;
use crate::source::csv::Row;
use crate::source::words::counted;

/// The longest time in microseconds that lies between two firing times of a column: that of a turn's 90 columns at 10 Hz. A
/// larger one is in another unit.
const LONGEST_COLUMN_US: f64 = 1111.2;

/// Whether a first line in lower case is that of an angle correction. Newer files begin with a line of their version, and
/// their header follows.
pub(super) fn is_header(first: &[String]) -> bool {
    is_column_header(first) || is_version(first)
}

/// Whether a line is a version such as `EEFF,1,1`.
fn is_version(cells: &[String]) -> bool {
    cells[0] == "eeff"
}

/// Whether a line names the columns of an angle correction, however it writes them: `Channel,Elevation,Azimuth`,
/// `Laser id,…`, `LaserID,…`, with units behind the names.
fn is_column_header(cells: &[String]) -> bool {
    let letters = |cell: &String| cell.chars().filter(char::is_ascii_alphanumeric).collect::<String>();
    let [channel, elevation, azimuth, ..] = cells else { return false };
    matches!(letters(channel).as_str(), "channel" | "channelid" | "ch" | "laser" | "laserid" | "id")
        && letters(elevation).starts_with("elevation")
        && letters(azimuth).starts_with("azimuth")
}

/// Whether a line is the SHA-256 of those before it: 64 hexadecimal digits and nothing else. Newer units end their files so.
fn is_hash(row: &Row<'_>) -> bool {
    let [first, rest @ ..] = &row.cells[..] else { return false };
    let is_hex = first.text.len() == 64 && first.text.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_hex && rest.iter().all(|cell| cell.text.is_empty())
}

/// The lines of a file without the hash at their end.
fn lines<'a>(file: File<'a>) -> Vec<Row<'a>> {
    let mut lines: Vec<Row<'_>> = file.rows().collect();
    if lines.last().is_some_and(is_hash) {
        lines.pop();
    }
    lines
}

pub(super) fn write(file: File<'_>, firetimes: Option<File<'_>>, toml: &mut Toml) -> Option<()> {
    let angles = angles(file);
    let times = firetimes.map(firing_times);
    let angles = angles?;
    let times = match times {
        Some(times) => Some(times?),
        None => None,
    };
    if let (Some(times), Some(of_times)) = (&times, firetimes) {
        check_times(file, &angles, of_times, times)?;
    }

    toml.comment(&format!("A Hesai LiDAR with {} channels: {}.", angles.len(), file.short_name()));
    toml.comment(
        "\nUsed: the elevation and the azimuth correction of each channel. Hesai counts azimuths clockwise from its y axis, \
         which is the x axis (forward) here, so the corrections have the opposite sign below.",
    );
    match (&times, firetimes) {
        (Some(times), Some(of_times)) => {
            toml.comment(&format!(
                "The firing times are from {}, {}. They count from the block's time, which is the column's here.",
                of_times.short_name(),
                times.unit
            ));
            if let Some(note) = &times.note {
                toml.comment(note);
            }
        }
        _ => toml
            .comment("Not known: firing times, which are in a file of their own (--firetimes imports it)."),
    }
    toml.comment(
        "Not in the file, and to be checked: the optical centre, which is taken to be on the axis (the presets of Hesai's \
         models have it), columns and rate (the usual values), range limits (none are set).",
    );
    let is_at128 = is_at128(&angles);
    if is_at128 {
        toml.comment(
            "\nThese are the angles of an AT128, which sees a sector of 120 degrees by three mirrors on its rotor, and no full \
             turn. The sector is set below. Left out: the mirrors' own corrections, which are in the unit's .dat file, and \
             the pace of the unit, which sweeps the sector in 50 ms and then waits as long; here a sweep takes 33 ms.",
        );
    }
    toml.line("\n# The ring of a cloud counts channels from 0, in the order of the file.");
    let channels: Vec<u32> = angles.keys().copied().collect();
    let (elevations, corrections): (Vec<f64>, Vec<f64>) = angles.into_values().unzip();
    let offsets = corrections.into_iter().map(|correction| -correction).collect();
    let lidar = Lidar::usual(elevations, offsets);
    let lidar = match times {
        Some(times) => lidar.firing_in_turns(&turns(&channels, &times.phases)),
        None => lidar,
    };
    let lidar = if is_at128 {
        // A tenth of a degree from column to column, both ends of the sector included.
        Lidar { columns: 1201, sector_deg: Some((60.0, -60.0)), ..lidar }
    } else {
        lidar
    };
    lidar.write("file", toml);
    Some(())
}

/// The columns of the cycle, with a time for each channel in their order.
fn turns(channels: &[u32], phases: &[BTreeMap<u32, f64>]) -> Vec<Turn> {
    let turn = |phase: &BTreeMap<u32, f64>| {
        let silent = (0..channels.len()).filter(|beam| !phase.contains_key(&channels[*beam])).collect();
        let times_us = channels.iter().map(|channel| phase.get(channel).copied().unwrap_or(0.0)).collect();
        Turn { times_us, silent }
    };
    phases.iter().map(turn).collect()
}

/// Whether the channels are those of an AT128: 128 between 12.93 and −12.47 degrees, in steps of a fifth of a degree
/// (PandarAT128.csv of tier4/nebula). No model with a full turn has such.
fn is_at128(angles: &BTreeMap<u32, (f64, f64)>) -> bool {
    let elevations = || angles.values().map(|(elevation, _)| *elevation);
    let (high, low) = (elevations().fold(f64::MIN, f64::max), elevations().fold(f64::MAX, f64::min));
    angles.len() == 128
        && (12.0..14.0).contains(&high)
        && (-14.0..-12.0).contains(&low)
        && angles.values().all(|(_, azimuth)| azimuth.abs() < 10.0)
}

/// Refuses firing times that leave a channel out, or that are in another unit than they say.
fn check_times(
    file: File<'_>,
    angles: &BTreeMap<u32, (f64, f64)>,
    of_times: File<'_>,
    times: &FiringTimes,
) -> Option<()> {
    let fires = |channel: &u32| times.phases.iter().any(|phase| phase.contains_key(channel));
    let missing: Vec<String> = angles.keys().filter(|c| !fires(c)).map(u32::to_string).collect();
    if !missing.is_empty() {
        let message = format!("the file has no firing time of channel {}", missing.join(", "));
        let help = format!("{} lists {} channels", file.short_name(), angles.len());
        return of_times.fail(of_times.whole(), message, "", help);
    }
    let all = || times.phases.iter().flat_map(BTreeMap::values).copied();
    let (first, last) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    let farthest = last.max(-first);
    if farthest > LONGEST_COLUMN_US {
        let message =
            format!("firing times reach {farthest} µs from the block's time, and no column lasts so long");
        let help = "if they are nanoseconds, say so in the header: `Channel,fire time(ns)`".to_owned();
        return of_times.fail(of_times.whole(), message, "in another unit?", help);
    }
    Some(())
}

/// Elevation and azimuth correction in degrees by channel.
fn angles(file: File<'_>) -> Option<BTreeMap<u32, (f64, f64)>> {
    let lines = lines(file);
    let Some(first) = lines.first() else { return file.fail(file.whole(), "the file is empty", "", None) };
    let header = usize::from(is_version(&first.lowercase()));
    if !lines.get(header).is_some_and(|row| is_column_header(&row.lowercase())) {
        let label = "expected the columns Channel, Elevation, Azimuth";
        let span = lines.get(header).unwrap_or(first).span;
        return file.fail(span, "this is no angle correction", label, None);
    }
    let mut angles = BTreeMap::new();
    for row in &lines[header + 1..] {
        let Some(channel) = channel(file, row, 3, 1) else { continue };
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

/// The channel of a row, which must have at least `cells` fields. The first channel is number `first`.
fn channel(file: File<'_>, row: &Row<'_>, cells: usize, first: u32) -> Option<u32> {
    if row.cells.len() < cells {
        let message = format!("the line has {}", counted(row.cells.len(), "field"));
        return file.fail(row.span, message, format!("expected {cells}"), None);
    }
    row.cells[0].integer(file.report, "Channel", first, MOST_BEAMS)
}

/// When the channels fire, counted from the block's time.
struct FiringTimes {
    /// Microseconds by channel, for each column of the cycle: one if all columns are alike. A channel that is not there does
    /// not fire in the column.
    phases: Vec<BTreeMap<u32, f64>>,
    /// The unit as the file describes it, for a comment.
    unit: &'static str,
    /// A comment on the part of the file that is left out.
    note: Option<String>,
}

/// Reads a firetime correction, of which Hesai has five layouts.
fn firing_times(file: File<'_>) -> Option<FiringTimes> {
    let lines = lines(file);
    let word = |line: usize| lines.get(line).map_or(String::new(), |row| row.cells[0].text.to_lowercase());
    let has_header =
        |name: &str| lines.get(2).is_some_and(|row| row.cells[0].text.eq_ignore_ascii_case(name));
    let names_channels = matches!(word(0).as_str(), "channel" | "laser id" | "laser_id" | "laserid");
    let made = if names_channels && lines[0].cells.len() > 2 {
        one_column_a_loop(file, &lines)
    } else if names_channels {
        one_time_each(file, &lines)
    } else if word(0) == "operational state" && word(1) == "azimuth state" {
        Some(by_state(file, &lines, 0, 1.0))
    } else if word(1) == "operation mode" && has_header("angle state") {
        Some(by_state(file, &lines, 1, 1e-3))
    } else if word(0) == "eeff" && has_header("loop1") {
        by_loop(file, &lines[3..])
    } else {
        let label = "expected the header `Channel,fire time(us)`, or the states or loops of a newer unit";
        return file.fail(file.whole(), "this is no known firetime correction", label, None);
    };
    made.filter(|_| !file.has_errors())
}

/// The microseconds of a unit that a header names, and what is said of it. Headers write `fire time(us)`, `fire time(μs)`,
/// `firetime/us` or no unit.
fn unit_of(file: File<'_>, header: &Row<'_>) -> Option<(f64, &'static str)> {
    let text = header.cells.last().map_or("", |cell| cell.text).to_lowercase();
    let unit = text.rsplit(['(', '/', '[', '_', ' ']).next().unwrap_or_default();
    match unit.trim_end_matches([')', ']']) {
        "us" | "μs" | "µs" => Some((1.0, "in microseconds")),
        "ns" => Some((1e-3, "in nanoseconds")),
        "ms" | "s" => file.fail(
            header.span,
            "firing times are in microseconds or nanoseconds",
            "another unit",
            "a column lasts less than a millisecond".to_owned(),
        ),
        _ => Some((1.0, "whose header names no unit: they are taken for microseconds")),
    }
}

/// Reads the layout `Channel,fire time(us)` of PandarXT, PandarQT, Pandar40P and Pandar64.
fn one_time_each(file: File<'_>, lines: &[Row<'_>]) -> Option<FiringTimes> {
    let (us_per_unit, unit) = unit_of(file, &lines[0])?;
    let mut us = BTreeMap::new();
    for row in &lines[1..] {
        let Some(channel) = channel(file, row, 2, 1) else { continue };
        let Some(time) = row.cells[1].number(file.report, "fire time") else { continue };
        insert(file, row, &mut us, channel, time * us_per_unit);
    }
    Some(FiringTimes { phases: vec![us], unit, note: None })
}

/// Reads the layout `laser_id,loop0_firetime,loop1_firetime`, with a column of times for each column of the cycle. Channels
/// count from 0 or from 1.
fn one_column_a_loop(file: File<'_>, lines: &[Row<'_>]) -> Option<FiringTimes> {
    let (us_per_unit, unit) = unit_of(file, &lines[0])?;
    let loops = lines[0].cells.len() - 1;
    check_loops(file, &lines[0], loops)?;
    let from_zero = lines[1..].iter().any(|row| row.cells[0].text == "0");
    let mut phases = vec![BTreeMap::new(); loops];
    for row in &lines[1..] {
        let Some(channel) = channel(file, row, loops + 1, u32::from(!from_zero)) else { continue };
        let channel = channel + u32::from(from_zero);
        for (of_loop, phase) in phases.iter_mut().enumerate() {
            let cell = &row.cells[of_loop + 1];
            if cell.text == "-" {
                continue;
            }
            if let Some(time) = cell.number(file.report, "firing time") {
                insert(file, row, phase, channel, time * us_per_unit);
            }
        }
    }
    Some(FiringTimes { phases, unit, note: None })
}

/// Reads the layout with one column for each pair of an operational state and an azimuth state. OT128 gives microseconds, and
/// `-` where a channel does not fire. Pandar128 gives nanoseconds, 0 where a channel does not fire, and each state twice, for
/// far and for near targets. `modes` is the line of the operational states.
fn by_state(file: File<'_>, lines: &[Row<'_>], modes: usize, us_per_unit: f64) -> FiringTimes {
    let mode = lines[modes].cells.get(1).map_or("", |cell| cell.text);
    let is_silent = |text: &str| text == "-" || (us_per_unit < 1.0 && text == "0");
    // The first column of each azimuth state of the first operational state, by the state.
    let mut columns: BTreeMap<u32, usize> = BTreeMap::new();
    for (column, cell) in lines[modes].cells.iter().enumerate().skip(1).filter(|(_, cell)| cell.text == mode)
    {
        let state = lines[modes + 1].cells.get(column).unwrap_or(cell);
        if let Some(state) = state.integer(file.report, "azimuth state", 0, MOST_PHASES as u32 - 1) {
            columns.entry(state).or_insert(column);
        }
    }
    let mut phases = vec![BTreeMap::new(); columns.len()];
    for row in &lines[modes + 2..] {
        let Some(channel) = channel(file, row, 2, 1) else { continue };
        for (phase, column) in phases.iter_mut().zip(columns.values()) {
            let Some(cell) = row.cells.get(*column).filter(|cell| !is_silent(cell.text)) else { continue };
            if let Some(time) = cell.number(file.report, "firing time") {
                insert(file, row, phase, channel, rounded(time * us_per_unit));
            }
        }
    }
    let far = if us_per_unit < 1.0 { ", for far targets where it tells them from near ones" } else { "" };
    let note = format!(
        "They are those of operational state {mode}{far}: the azimuth states are the columns of `cycle`. Other operational \
         states of the unit are left out."
    );
    let unit = if us_per_unit < 1.0 { "in nanoseconds" } else { "in microseconds" };
    FiringTimes { phases, unit, note: Some(note) }
}

/// Reads the layout of QT128: pairs of channel and time, one pair of columns a loop, padded with zeros.
fn by_loop(file: File<'_>, lines: &[Row<'_>]) -> Option<FiringTimes> {
    let mut phases: Vec<BTreeMap<u32, f64>> = Vec::new();
    for row in lines {
        for (of_loop, pair) in row.cells.chunks_exact(2).enumerate() {
            let [channel, time] = pair else { continue };
            if channel.text == "0" || time.text.is_empty() {
                continue;
            }
            check_loops(file, row, of_loop + 1)?;
            let channel = channel.integer(file.report, "channel", 1, MOST_BEAMS);
            let time = time.number(file.report, "firing time");
            if let (Some(channel), Some(time)) = (channel, time) {
                phases.resize_with(phases.len().max(of_loop + 1), BTreeMap::new);
                insert(file, row, &mut phases[of_loop], channel, time);
            }
        }
    }
    let note = "The unit alternates between loops of different channels, which are the columns of `cycle`.";
    Some(FiringTimes { phases, unit: "in microseconds", note: Some(note.to_owned()) })
}

/// Refuses more loops than a cycle has columns.
fn check_loops(file: File<'_>, row: &Row<'_>, loops: usize) -> Option<()> {
    if loops <= MOST_PHASES {
        return Some(());
    }
    let message = format!("the file has {loops} loops or more");
    file.fail(row.span, message, format!("expected at most {MOST_PHASES}: units have two or four"), None)
}

/// Keeps the time of a channel in a column of the cycle.
fn insert(file: File<'_>, row: &Row<'_>, phase: &mut BTreeMap<u32, f64>, channel: u32, time_us: f64) {
    if phase.insert(channel, time_us).is_some() {
        file.fail::<()>(row.span, format!("channel {channel} is listed twice"), "", None);
    }
}

/// Rounds a product to 10⁻⁶ µs, which restores the decimals of a time in nanoseconds.
fn rounded(us: f64) -> f64 {
    (us * 1e6).round() / 1e6
}
