//! The built-in sensors, and the modes of a sensor file.

use std::path::Path;

use super::section;
use super::tree::{self, Entry, Node, Table, Value};
use crate::source::suggest::{list, nearest, quoted};
use crate::source::{Report, Span};

macro_rules! built_in {
    ($($name:literal),* $(,)?) => {
        /// The built-in sensors: their names, and their files' texts.
        pub const BUILT_IN: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../configs/sensors/", $name, ".toml")))),*];
    };
}
built_in![
    "azure/kinect",
    "hesai/pandar128",
    "hesai/pandar64",
    "hesai/qt64",
    "hesai/xt-32",
    "ideal/camera",
    "kinect/v1",
    "kinect/v2",
    "livox/avia",
    "livox/mid-360",
    "livox/mid-40",
    "livox/mid-70",
    "ouster/os0-128",
    "ouster/os0-32",
    "ouster/os0-64",
    "ouster/os1-128",
    "ouster/os1-32",
    "ouster/os1-64",
    "ouster/os2-128",
    "ouster/os2-32",
    "ouster/os2-64",
    "realsense/d435",
    "robosense/helios",
    "robosense/rs16",
    "robosense/rs32",
    "velodyne/hdl-32e",
    "velodyne/puck-128",
    "velodyne/vlp-16",
    "velodyne/vlp-16-hi-res",
    "velodyne/vlp-32c",
];

/// The text of a built-in sensor.
pub fn text(name: &str) -> Option<&'static str> {
    BUILT_IN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Whether a preset's name is that of a file: all that ends in `.toml`.
pub(super) fn is_file(preset: &str) -> bool {
    Path::new(preset).extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// What to say of a name that no built-in sensor has.
pub(super) fn near_name(name: &str) -> Option<String> {
    let names = || BUILT_IN.iter().map(|(name, _)| *name);
    // A model without its vendor is near enough.
    let model = |name: &'static str| name.rsplit('/').next().unwrap_or(name);
    let near = nearest(name, names())
        .or_else(|| nearest(name, names().map(model)).and_then(|m| names().find(|n| model(n) == m)));
    Some(match near {
        Some(near) => format!("did you mean {}?", quoted(near)),
        None => "`beamcast presets` lists them".to_owned(),
    })
}

/// Reports a preset that is neither a built-in sensor nor a file.
pub(super) fn report_unknown(report: &Report, name: &str, span: Span, path: &Path) {
    let help =
        if path.exists() { Some("a sensor file's name ends in `.toml`".to_owned()) } else { near_name(name) };
    let message = format!("there is no built-in sensor {}", quoted(name));
    report.error(span, message, "expected its name, or a path that ends in `.toml`", help);
}

/// Reports what can be no modes.
pub(super) fn check_modes(report: &Report, table: &Table) {
    let complain = |what: &str, node: &Node| {
        let message = format!("{what} is {}", section::describe(&node.value));
        let help = "such as `[modes.2048x10.rotating]`, then `columns = 2048`";
        report.error(node.span, message, "expected a table", Some(help.into()));
    };
    match table.get("modes").map(|entry| (&entry.node, &entry.node.value)) {
        Some((_, Value::Table(modes))) => {
            for (name, entry) in modes.iter().filter(|(_, e)| !matches!(e.node.value, Value::Table(_))) {
                complain(&format!("the mode {}", quoted(name)), &entry.node);
            }
        }
        Some((node, _)) => complain("`modes`", node),
        None => {}
    }
}

/// Takes the modes out of a sensor file's table, by their names. What is no table is left there: it was reported.
pub(super) fn take_modes(table: &mut Table) -> Vec<(String, Node)> {
    let is_modes = matches!(table.get("modes").map(|e| &e.node.value), Some(Value::Table(modes))
        if modes.values().all(|mode| matches!(mode.node.value, Value::Table(_))));
    if !is_modes {
        return Vec::new();
    }
    match table.remove("modes") {
        Some(Entry { node: Node { value: Value::Table(modes), .. }, .. }) => {
            modes.into_iter().map(|(name, entry)| (name, entry.node)).collect()
        }
        _ => Vec::new(),
    }
}

/// Lays the mode that a job asks for over its sensor's table.
pub(super) fn choose_mode(report: &Report, table: &mut Table, modes: Vec<(String, Node)>, wanted: &Node) {
    let Value::String(name) = &wanted.value else { return }; // reported when it's read
    if let Some((_, mode)) = modes.iter().find(|(known, _)| known == name) {
        return lay_mode(report, table, mode);
    }
    let names = || modes.iter().map(|(name, _)| name.as_str());
    let help = match (nearest(name, names()), modes.is_empty()) {
        (_, true) => "this sensor has no modes: leave it out".to_owned(),
        (Some(near), _) => format!("did you mean {}?", quoted(near)),
        (None, _) => format!("its modes are {}", list(names(), "and")),
    };
    report.error(wanted.span, format!("the sensor has no mode {}", quoted(name)), "", Some(help));
}

/// Lays a mode over its sensor's table.
pub(super) fn lay_mode(report: &Report, table: &mut Table, mode: &Node) {
    if let Value::Table(mode_table) = &mode.value {
        // Making the section reports the keys that a mode shouldn't have.
        section::Section::new(report, &section::MODE, mode_table, mode.span);
        tree::lay_over(report, table, mode_table.clone());
    }
}
