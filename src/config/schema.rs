//! Tables as JSON Schema (draft-07), for editors that complete and check TOML by it.
//!
//! The schema never refuses a value that the reader takes, and the reader finds more: lists whose lengths differ, files
//! that are not there.

use serde_json::{Map, Value, json};

use super::parse;
use super::table::{AnyKey, TableKeys};

/// The schema of a kind of file.
pub(super) fn document(title: &str, keys: &'static TableKeys) -> Value {
    let mut schema = Map::new();
    schema.insert("$schema".into(), "http://json-schema.org/draft-07/schema#".into());
    schema.insert("title".into(), title.into());
    schema.extend(table(keys, false));
    Value::Object(schema)
}

/// The schema of a table. Where a preset may give a part of the table, no key is required: `is_partial`.
pub(super) fn table(keys: &'static TableKeys, is_partial: bool) -> Map<String, Value> {
    let is_partial = is_partial || keys.is_partial;
    let property = |key: &&'static dyn AnyKey| {
        let facts = key.facts();
        let mut value = key.kind().schema(is_partial);
        value.insert("description".into(), facts.about.into());
        if let Some(default) = facts.default.and_then(parse::constant) {
            value.insert("default".into(), parse::node_to_json(&default));
        }
        (facts.name.to_owned(), Value::Object(value))
    };
    let properties: Map<String, Value> = keys.keys.iter().map(property).collect();
    let mut table = Map::new();
    table.insert("type".into(), "object".into());
    table.insert("properties".into(), properties.into());
    table.insert("additionalProperties".into(), false.into());
    let required: Vec<_> = keys.required().collect();
    if !required.is_empty() && !is_partial {
        table.insert("required".into(), json!(required));
    }
    let groups: Vec<Value> =
        keys.groups().map(|group| group.iter().map(|key| complete(*key)).collect()).collect();
    match (groups.as_slice(), keys.unless) {
        ([], _) => {}
        ([one_of], None) => {
            table.insert("oneOf".into(), one_of.clone());
        }
        ([one_of], Some(other)) => {
            table.insert("if".into(), json!({ "not": { "required": [other.name()] } }));
            table.insert("then".into(), json!({ "oneOf": one_of }));
        }
        (several, _) => {
            let all = several.iter().map(|one_of| json!({ "oneOf": one_of })).collect();
            table.insert("allOf".into(), all);
        }
    }
    table
}

/// The condition that a key is there and, if a preset could have given a part of its table, that the table is complete.
fn complete(key: &'static dyn AnyKey) -> Value {
    let name = key.name();
    match key.kind().tables().as_slice() {
        [table] if table.is_partial => {
            let required: Vec<_> = table.required().collect();
            json!({ "required": [name], "properties": { name: { "required": required } } })
        }
        _ => json!({ "required": [name] }),
    }
}
