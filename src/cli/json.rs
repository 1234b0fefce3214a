//! The JSON documents that commands print, for scripts. docs/json.md describes every key of them.

use serde_json::{Map, Value};

/// A JSON document that a command prints. Its format is a number, which grows when a key changes its meaning or goes away. A new
/// key does not change it.
#[derive(Clone, Copy, Debug)]
pub struct Document {
    format: u32,
}

/// `beamcast bench --json`.
pub const BENCH: Document = Document { format: 1 };
/// `beamcast bench --end-to-end --json`.
pub const BENCH_END_TO_END: Document = Document { format: 1 };
/// `beamcast check --json FILE`.
pub const CHECK: Document = Document { format: 1 };
/// `beamcast convert --json`.
pub const CONVERT: Document = Document { format: 1 };
/// `beamcast diff --json`.
pub const DIFF: Document = Document { format: 1 };
/// `beamcast explain --json`.
pub const EXPLAIN: Document = Document { format: 1 };
/// `beamcast info --json`.
pub const INFO: Document = Document { format: 2 };
/// `beamcast kernels --json`.
pub const KERNELS: Document = Document { format: 1 };
/// `beamcast lint --json`.
pub const LINT: Document = Document { format: 1 };
/// `beamcast merge --json`.
pub const MERGE: Document = Document { format: 1 };
/// `beamcast presets --json`.
pub const PRESETS: Document = Document { format: 1 };
/// `beamcast scan --json`.
pub const SCAN: Document = Document { format: 1 };
/// `beamcast scan --dry-run --json`.
pub const SCAN_PLAN: Document = Document { format: 1 };
/// Each line of `beamcast scan --json-lines`.
pub const SCAN_FRAME: Document = Document { format: 1 };
/// `beamcast selftest --json`.
pub const SELFTEST: Document = Document { format: 1 };
/// `beamcast selftest --datasheet --json`.
pub const SELFTEST_DATASHEET: Document = Document { format: 1 };
/// `beamcast verify --json`.
pub const VERIFY: Document = Document { format: 1 };

impl Document {
    /// The document with the keys of `content`, which is a table.
    pub fn of(self, content: Value) -> Value {
        let mut document = Map::from_iter([("format".to_owned(), self.format.into())]);
        if let Value::Object(keys) = content {
            document.extend(keys);
        }
        Value::Object(document)
    }
}
