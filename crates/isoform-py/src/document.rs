//! The documents of `--json`, as text that Python reads.

use isoform::report::Document;
use serde::Serialize;

/// A report of the library with what the command line puts before it.
pub(crate) fn text(report: &impl Serialize) -> String {
    let document = serde_json::to_value(Document::new(true, report));
    document.expect("reports have texts for keys").to_string()
}

/// A report as the command line writes it to a file.
pub(crate) fn file(report: &impl Serialize) -> String {
    #[derive(Serialize)]
    struct File<'a, T> {
        schema: u32,
        #[serde(flatten)]
        report: &'a T,
    }
    let document = serde_json::to_value(File { schema: 1, report });
    document.expect("reports have texts for keys").to_string()
}
