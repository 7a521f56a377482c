//! Who may use whom: the table in docs/architecture.md is what the manifests say.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

type Uses = BTreeMap<String, BTreeSet<String>>;

/// Names of our crates in a manifest's section.
fn ours(manifest: &str, section: &str) -> BTreeSet<String> {
    let mut inside = false;
    let mut names = BTreeSet::new();
    for line in manifest.lines().map(str::trim) {
        if line.starts_with('[') {
            inside = line == section;
        } else if inside && line.starts_with("isoform") {
            let name = line.split(['.', ' ', '=']).next().unwrap_or_default();
            names.insert(name.to_owned());
        }
    }
    names
}

/// The rows `| isoform-x | what it holds | num, geom |` of a table; "all above" are the crates of the
/// rows before it, but for those that are for development only and named in no row's last column.
fn table(text: &str) -> Uses {
    let mut rows = Uses::new();
    for line in text.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let &["", name, _, uses, ""] = cells.as_slice() else {
            continue;
        };
        if name != "isoform" && !name.starts_with("isoform-") {
            continue;
        }
        let used = match uses {
            "" => BTreeSet::new(),
            "all above" => rows.keys().cloned().collect(),
            "isoform" => BTreeSet::from(["isoform".to_owned()]),
            list => list.split(", ").map(|n| format!("isoform-{n}")).collect(),
        };
        rows.insert(name.to_owned(), used);
    }
    rows
}

#[test]
fn dependencies_are_those_of_the_table() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let text = fs::read_to_string(root.join("docs/architecture.md")).expect("the page");
    let mut manifests = Uses::new();
    for entry in fs::read_dir(root.join("crates")).expect("the folder of crates") {
        let folder = entry.expect("an entry").path();
        let Ok(manifest) = fs::read_to_string(folder.join("Cargo.toml")) else {
            continue;
        };
        let name = folder.file_name().expect("a folder").to_string_lossy();
        let quoted = format!("name = \"{name}\"");
        assert!(manifest.contains(&quoted), "{name}: another crate's folder");
        manifests.insert(name.into_owned(), ours(&manifest, "[dependencies]"));
    }
    assert_eq!(table(&text), manifests, "table (left), manifests (right)");
}

#[test]
fn the_reader_of_manifests_reads() {
    let manifest = "[package]\nname = \"isoform-x\"\n[dependencies]\nisoform-fit.workspace = true\n\
        serde = \"1\"\n[dev-dependencies]\nisoform-io = { path = \"\" }\n";
    let only = |name: &str| BTreeSet::from([name.to_owned()]);
    assert_eq!(ours(manifest, "[dependencies]"), only("isoform-fit"));
    assert_eq!(ours(manifest, "[dev-dependencies]"), only("isoform-io"));
}

#[test]
fn the_reader_of_tables_reads() {
    let rows = table(
        "| crate | holds | uses |\n|---|---|---|\n| isoform-a | x | |\n| isoform-b | y | a |\n| isoform | z | all above |\n",
    );
    assert_eq!(rows["isoform-a"], BTreeSet::new());
    assert_eq!(rows["isoform-b"], BTreeSet::from(["isoform-a".to_owned()]));
    assert_eq!(rows["isoform"].len(), 2);
}
