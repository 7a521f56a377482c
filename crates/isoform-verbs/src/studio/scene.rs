//! Pictures of files and texts for the page.

use super::work;
use crate::failure::Failure;
use crate::memory::{Mounted, Object};
use crate::progress::Listener;
use crate::view;
use crate::{Verb, parsed_for};
use serde_json::{Map, Value};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Returns the packed scene of a request: the arguments of `view`, with texts among its files as
/// objects of `name` and `text`.
pub(super) fn packed(bytes: &[u8], is_left: Arc<AtomicBool>) -> Result<Vec<u8>, Failure> {
    let asked = serde_json::from_slice(bytes).map_err(|e| Failure::usage(e.to_string()))?;
    let Value::Object(mut fields) = asked else {
        return Err(Failure::usage("an object is expected"));
    };
    let mut mounted = Vec::new();
    if let Some(Value::Array(files)) = fields.get_mut("file") {
        for file in files {
            if let Value::Object(text) = file {
                let held = mount(text)?;
                *file = held.path().to_string_lossy().into();
                mounted.push(held);
            }
        }
    }
    fields.insert("verb".to_owned(), "view".into());
    fields.insert("output".to_owned(), "page.html".into());
    let request = work::read(Value::Object(fields).to_string().as_bytes())?;
    let listener = Listener {
        cancelled: is_left,
        progress: Box::new(|_, _| {}),
    };
    let (verb, context) = parsed_for(&request.verb, &request.arguments, Some(listener))?;
    let Verb::View(args) = verb else {
        return Err(Failure::internal("arguments"));
    };
    let made = crate::watchdog::stage("", || view::made(&args, &context));
    let (page, _) = made.map_err(Failure::plain)?;
    Ok(page.packed())
}

/// Mounts a text as a file.
fn mount(text: &Map<String, Value>) -> Result<Mounted, Failure> {
    let field = |key: &str| text.get(key).and_then(Value::as_str);
    let (Some(name), Some(text)) = (field("name"), field("text")) else {
        return Err(Failure::usage("a text has a name and a text"));
    };
    let ending = match name.rsplit_once('.') {
        Some((_, "hf")) => "hf",
        _ => "json",
    };
    Ok(Mounted::new(name, Object::text(ending, text)))
}
