//! Requests of verbs from the page, with their progress.

use super::project::{is_inside, is_plain};
use crate::failure::{DONE, Failure};
use crate::help::Extent;
use crate::outcome;
use crate::progress::Listener;
use crate::{command, inputs, request};
use hyper::body::Bytes;
use isoform::report::Document;
use serde_json::{Map, Value, json};
use std::ffi::OsString;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::UnboundedSender;

/// Time between messages about the progress of one phase.
const PAUSE: Duration = Duration::from_millis(60);
/// Arguments of the global kind that a request of the page may not have, and `serve`, which would
/// begin another server.
const REFUSED: [&str; 2] = ["serve", "threads"];

/// Request of a verb.
pub(super) struct Request {
    /// Name of the verb.
    pub(super) verb: String,
    /// Arguments by their names.
    pub(super) arguments: Map<String, Value>,
    /// Words of its command line.
    words: Vec<OsString>,
}

/// Reads a request, which stays in the folder of the project.
pub(super) fn read(bytes: &[u8]) -> Result<Request, Failure> {
    let asked = serde_json::from_slice(bytes).map_err(|e| Failure::usage(e.to_string()))?;
    let Value::Object(mut fields) = asked else {
        return Err(Failure::usage("an object is expected"));
    };
    let Some(Value::String(verb)) = fields.shift_remove("verb") else {
        return Err(Failure::usage("the key `verb` is missing"));
    };
    if let Some(key) = REFUSED.iter().find(|key| fields.contains_key(**key)) {
        return Err(Failure::usage(format!(
            "a request of the page has no `{key}`"
        )));
    }
    let words = request::words(&verb, &fields, &command(Extent::Whole))?;
    check(&words)?;
    Ok(Request {
        verb,
        arguments: fields,
        words,
    })
}

/// Checks that a request reads and writes in the folder of the project alone.
fn check(words: &[OsString]) -> Result<(), Failure> {
    let program = std::iter::once(OsString::from("isoform"));
    let all = program.chain(words.iter().cloned());
    let matches = command(Extent::Whole)
        .try_get_matches_from(all)
        .map_err(crate::refused)?;
    let Some((_, verb)) = matches.subcommand() else {
        return Ok(());
    };
    match inputs::paths(verb).find(|(_, path)| !(is_inside(path) && is_plain(path))) {
        Some((name, path)) => {
            let message = format!("{name}: {} is not in the project", path.display());
            Err(Failure::usage(message).hint("drop the file onto the page, which copies it there"))
        }
        None => Ok(()),
    }
}

/// Returns the command line of a request.
fn line(words: &[OsString]) -> String {
    let quoted = |word: &OsString| {
        let word = word.to_string_lossy();
        let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
        if !word.is_empty() && word.chars().all(is_plain) {
            word.into_owned()
        } else {
            format!("'{}'", word.replace('\'', "'\\''"))
        }
    };
    let words: Vec<String> = words.iter().map(quoted).collect();
    format!("isoform {}", words.join(" "))
}

/// Does the work of a request; every message is a line of JSON: `command`, `progress`, and at the
/// end `answer` or `failure`.
pub(super) fn run(bytes: &[u8], messages: &UnboundedSender<Bytes>, is_left: Arc<AtomicBool>) {
    let send = |message: Value| {
        // The other side may be gone, which also cancels the work.
        let _ = messages.send(format!("{message}\n").into());
    };
    let request = match read(bytes) {
        Ok(request) => request,
        Err(failure) => return refuse(&failure, messages),
    };
    send(json!({"command": line(&request.words)}));
    let progress = Arc::new(Mutex::new((String::new(), Instant::now())));
    let sender = messages.clone();
    let listener = Listener {
        cancelled: is_left,
        progress: Box::new(move |phase: &str, done: f64| {
            let mut last = progress.lock().unwrap_or_else(PoisonError::into_inner);
            if last.0 == phase && last.1.elapsed() < PAUSE {
                return;
            }
            *last = (phase.to_owned(), Instant::now());
            let message = json!({"progress": {"phase": phase, "done": done.clamp(0.0, 1.0)}});
            let _ = sender.send(format!("{message}\n").into());
        }),
    };
    send(
        match crate::call(&request.verb, &request.arguments, listener) {
            Ok(answer) => {
                let is_ok = answer.outcome.exit == DONE;
                let document = outcome::json_of(&Document::new(is_ok, answer.outcome.json));
                json!({"answer": {
                    "exit": answer.outcome.exit,
                    "document": document,
                    "warnings": answer.warnings,
                }})
            }
            Err(failure) => refusal(&failure),
        },
    );
}

/// Sends a failure in the place of an answer.
pub(super) fn refuse(failure: &Failure, messages: &UnboundedSender<Bytes>) {
    let _ = messages.send(format!("{}\n", refusal(failure)).into());
}

/// Returns the message of a failure.
pub(super) fn refusal(failure: &Failure) -> Value {
    let mut document = failure.json();
    document["exit"] = failure.exit.into();
    json!({"failure": document})
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_stay_in_the_folder() {
        for bad in [
            r#"{"verb": "inspect", "file": "/etc/passwd"}"#,
            r#"{"verb": "inspect", "file": "../a.ply"}"#,
            r#"{"verb": "mesh", "model": "a.hf", "output": ["/a.stl"]}"#,
            r#"{"verb": "mesh", "model": "-"}"#,
            r#"{"verb": "view", "file": ["a.ply"], "serve": true}"#,
            r#"{"verb": "studio"}"#,
            r#"{"verb": "run", "file": "a"}"#,
            r#"{"verb": "mesh"}"#,
            "[]",
            "",
        ] {
            assert!(read(bad.as_bytes()).is_err(), "{bad}");
        }
        let good = r#"{"verb": "mesh", "model": "x^2 + y^2 + z^2 = 1", "output": ["a b.stl"]}"#;
        let Ok(request) = read(good.as_bytes()) else {
            panic!("{good}");
        };
        let text = line(&request.words);
        assert_eq!(
            text,
            "isoform mesh '--output=a b.stl' -- 'x^2 + y^2 + z^2 = 1'"
        );
    }
}
