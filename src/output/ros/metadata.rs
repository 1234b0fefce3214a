//! `metadata.yaml`, by which rosbag2 knows the files and topics of a bag's folder: version 5 of it, as of ROS 2 Humble.

use std::fmt::Write as _;

use super::mcap::{Channel, Mcap};

/// The file's content.
pub(super) fn metadata(bag: &Mcap, file: &str) -> String {
    let (first, last) = bag.times().unwrap_or_default();
    let messages: u64 = bag.channels().iter().map(|channel| channel.messages).sum();
    let duration = last - first;
    let mut text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: {duration}\n  \
         starting_time:\n    nanoseconds_since_epoch: {first}\n  message_count: {messages}\n"
    );
    text.push_str("  topics_with_message_count:\n");
    for Channel { topic, schema, qos, messages } in bag.channels() {
        // A JSON text is a YAML text.
        let [topic, qos] = [topic.as_str(), qos].map(|text| serde_json::Value::from(text).to_string());
        let _ = write!(
            text,
            "    - topic_metadata:\n        name: {topic}\n        type: {schema}\n        serialization_format: cdr\n        \
             offered_qos_profiles: {qos}\n      message_count: {messages}\n"
        );
    }
    let _ = write!(
        text,
        "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {file}\n  files:\n    - path: {file}\n      \
         starting_time:\n        nanoseconds_since_epoch: {first}\n      duration:\n        nanoseconds: {duration}\n      \
         message_count: {messages}\n"
    );
    text
}
