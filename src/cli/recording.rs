//! What `beamcast info` tells of a recording: its topics, and what the messages of those show that are read.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::output::recorded::{Bag, Content, Topic, TopicFrames};
use crate::run::Bytes;
use crate::source::words::{counted, on_one_line};

/// The facts of a recording as JSON and as lines.
pub fn facts(bag: &mut Bag) -> (Value, String) {
    let frames = bag.frames();
    let longest = bag.topics().iter().map(|topic| topic.name.chars().count()).max().unwrap_or(0);
    let width = longest.min(40);
    let (mut rows, mut text) = (Vec::new(), String::new());
    for (topic, frames) in bag.topics().iter().zip(&frames) {
        let messages = counted(topic.messages, "message");
        let _ = write!(text, "    {:<width$} {}", on_one_line(&topic.name), on_one_line(&topic.kind));
        let _ = write!(text, ", {messages}, {}", Bytes(topic.bytes));
        if let Some([first, last]) = topic.times_ns.map(|times| times.map(seconds)) {
            let _ = write!(text, ", {first:.3} s to {last:.3} s");
        }
        text.push('\n');
        text += &frames.as_ref().map_or(String::new(), line_of);
        rows.push(row_of(topic, frames.as_ref()));
    }
    if !bag.is_whole() {
        text += "    the file ends before its footer: it was cut off\n";
    }
    (json!({ "topics": rows, "whole": bag.is_whole() }), text)
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

/// The names and the types of what each point or pixel has.
fn fields_of(content: &Content) -> Vec<(&str, &str)> {
    match content {
        Content::Cloud(cloud) => cloud.fields.iter().map(|field| (field.name.as_str(), field.kind)).collect(),
        Content::Depth(part) => {
            part.image.channels.iter().map(|channel| (channel.name.as_str(), "float")).collect()
        }
    }
}

/// The first and the last stamp, in seconds.
fn stamps_s(frames: &TopicFrames) -> [f64; 2] {
    [frames.first.stamp_ns, frames.last_stamp_ns].map(|ns| ns as f64 * 1e-9)
}

fn line_of(frames: &TopicFrames) -> String {
    let [rows, columns] = frames.first.size;
    let size = match &frames.first.content {
        Content::Depth(_) => format!("depth of {rows} rows × {columns} columns"),
        Content::Cloud(_) if rows == 1 => format!("{columns} points"),
        Content::Cloud(_) => format!("{rows} rows × {columns} points"),
    };
    let [first, last] = stamps_s(frames);
    let fields = fields_of(&frames.first.content);
    let fields: Vec<String> =
        fields.iter().map(|(name, kind)| format!("{} {kind}", on_one_line(name))).collect();
    let frame = on_one_line(&frames.first.frame_id);
    format!("        {size} in {frame}, stamps {first:.3} s to {last:.3} s: {}\n", fields.join(", "))
}

fn row_of(topic: &Topic, frames: Option<&TopicFrames>) -> Value {
    let frames = frames.map(|frames| {
        let [rows, columns] = frames.first.size;
        let field = |(name, kind): (&str, &str)| json!({ "name": name, "kind": kind });
        json!({
            "rows": rows, "columns": columns, "frame_id": frames.first.frame_id, "stamps_s": stamps_s(frames),
            "fields": fields_of(&frames.first.content).into_iter().map(field).collect::<Vec<_>>(),
        })
    });
    json!({
        "name": topic.name, "type": topic.kind, "encoding": topic.encoding, "messages": topic.messages,
        "bytes": topic.bytes, "times_s": topic.times_ns.map(|times| times.map(seconds)), "frames": frames,
    })
}
