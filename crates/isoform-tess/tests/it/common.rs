//! The collection of rational surfaces in tests/data/zoo.

use isoform_io::read_map;
use isoform_tess::{Map, Options};
use serde_json::Value;

/// Name, facts and map of every valid surface.
pub(crate) fn zoo() -> Vec<(String, Value, Map)> {
    let mut found = Vec::new();
    for path in isoform_testdata::files("zoo", "json") {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        let facts: Value = serde_json::from_str(&text).expect("JSON");
        let name = isoform_testdata::stem(&path);
        match read_map(&text).map(|file| Map::new(file.polynomials, Options::default())) {
            Ok(Ok(map)) => {
                assert_eq!(facts["valid"], true, "{name}");
                found.push((name, facts, map));
            }
            Ok(Err(error)) => assert_eq!(facts["valid"], false, "{name}: {error}"),
            Err(error) => assert_eq!(facts["valid"], false, "{name}: {error}"),
        }
    }
    assert_eq!(found.len(), 34, "the valid surfaces of the zoo");
    found
}
