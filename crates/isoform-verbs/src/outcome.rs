//! Outcomes of verbs: an exit code, a JSON document, and what goes to stdout without --json.

use crate::failure::{DONE, PARTIAL};
use crate::interrupt;
use isoform::report::Document;
use serde::Serialize;
use serde_json::{Value, json};

/// The exit code of work whose result is there: `DONE` if it is all that was asked for.
pub(crate) fn exit(is_as_asked: bool) -> u8 {
    if interrupt::happened() {
        interrupt::INTERRUPTED
    } else if is_as_asked {
        DONE
    } else {
        PARTIAL
    }
}

/// Result of a verb: exit code, fields of the JSON document, and text for stdout without --json.
pub struct Outcome {
    /// Exit code.
    pub exit: u8,
    /// Fields of the JSON document; null where the verb has printed it.
    pub json: Value,
    /// Bytes for stdout without --json.
    pub stdout: Vec<u8>,
}

impl Outcome {
    /// The outcome of a verb that writes files: a file for stdout takes the place of the table, and
    /// stands as `text` in the document.
    pub(crate) fn new(
        exit: u8,
        mut json: Value,
        file: Vec<u8>,
        table: impl FnOnce() -> String,
    ) -> Self {
        let stdout = if file.is_empty() {
            table().into_bytes()
        } else {
            json["text"] = String::from_utf8_lossy(&file).into();
            file
        };
        Self { exit, json, stdout }
    }
    /// Returns the outcome of a verb whose result is a document, with --json or without.
    pub(crate) fn json(json: Value) -> Self {
        let mut stdout = serde_json::to_vec_pretty(&json).unwrap_or_default();
        stdout.push(b'\n');
        Self {
            exit: DONE,
            json,
            stdout,
        }
    }
    /// The outcome of a verb whose result is a text.
    pub(crate) fn text(stdout: Vec<u8>) -> Self {
        let json = json!({"text": String::from_utf8_lossy(&stdout)});
        Self {
            exit: DONE,
            json,
            stdout,
        }
    }
}

/// One JSON document: schema and ok before the rest.
pub(crate) fn document(ok: bool, fields: Value) -> Vec<u8> {
    let all = json_of(&Document::new(ok, fields));
    let mut bytes = serde_json::to_vec_pretty(&all).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

/// A report as JSON.
pub(crate) fn json_of(report: &impl Serialize) -> Value {
    serde_json::to_value(report).expect("reports have texts for keys")
}

/// Puts the fields of one document behind another's.
pub(crate) fn add(json: &mut Value, more: Value) {
    if let (Value::Object(json), Value::Object(more)) = (json, more) {
        json.extend(more);
    }
}
