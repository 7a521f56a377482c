//! The collection of rational surfaces in `../shared/zoo`.

use isoform_tess::{Map, Options};
use serde_json::Value;
use std::path::Path;

/// Name, facts and map of every valid surface; nothing where the collection is absent.
pub(crate) fn zoo() -> Vec<(String, Value, Map)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/zoo");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        println!("skipped: {} is absent", folder.display());
        return Vec::new();
    };
    let mut paths: Vec<_> = entries
        .flatten()
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "json"))
        .collect();
    paths.sort();
    let mut found = Vec::new();
    for path in paths {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        let facts: Value = serde_json::from_str(&text).expect("JSON");
        let name = path
            .file_stem()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        match Map::from_json(&text, Options::default()) {
            Ok(map) => {
                assert_eq!(facts["valid"], true, "{name}");
                found.push((name, facts, map));
            }
            Err(error) => assert_eq!(facts["valid"], false, "{name}: {error}"),
        }
    }
    found
}
