//! Objects of JSON.

use serde_json::{Map, Value as Json};

/// The keys of a JSON object that is written out; no keys for any other value.
pub(super) fn object(value: Json) -> Map<String, Json> {
    match value {
        Json::Object(map) => map,
        _ => Map::new(),
    }
}
