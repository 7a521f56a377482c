//! Who may use whom: stages never use one another, and nobody uses what stands above.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Every crate with the ones of ours that it may use.
const MAY_USE: [(&str, &[&str]); 13] = [
    ("isoform-num", &[]),
    ("isoform-algebra", &["isoform-num"]),
    ("isoform-geom", &["isoform-num"]),
    ("isoform-field", &["isoform-num", "isoform-geom"]),
    (
        "isoform-fit",
        &["isoform-num", "isoform-geom", "isoform-field"],
    ),
    ("isoform-patch", &["isoform-num", "isoform-geom"]),
    (
        "isoform-tess",
        &["isoform-num", "isoform-geom", "isoform-algebra"],
    ),
    ("isoform-mesh", &["isoform-num", "isoform-geom"]),
    (
        "isoform-io",
        &[
            "isoform-geom",
            "isoform-algebra",
            "isoform-field",
            "isoform-num",
        ],
    ),
    ("isoform-cli", &["isoform"]),
    ("isoform-testdata", &[]),
    ("isoform-view", &["isoform"]),
    ("isoform-zoo", &["isoform-geom", "isoform-field"]),
];

/// Names of our crates in a manifest's section.
fn ours(manifest: &str, section: &str) -> Vec<String> {
    let mut inside = false;
    let mut names = Vec::new();
    for line in manifest.lines().map(str::trim) {
        if line.starts_with('[') {
            inside = line == section;
        } else if inside && line.starts_with("isoform") {
            names.push(
                line.split(['.', ' ', '='])
                    .next()
                    .unwrap_or_default()
                    .to_owned(),
            );
        }
    }
    names
}

#[test]
fn dependencies_point_downwards() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let rules: BTreeMap<&str, &[&str]> = MAY_USE.into_iter().collect();
    let mut seen = 0;
    for entry in fs::read_dir(crates).expect("the folder of crates") {
        let folder = entry.expect("an entry").path();
        let Ok(manifest) = fs::read_to_string(folder.join("Cargo.toml")) else {
            continue;
        };
        let name = folder
            .file_name()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        assert!(
            manifest.contains(&format!("name = \"{name}\"")),
            "{name}: folder and crate differ in name"
        );
        seen += 1;
        for used in ours(&manifest, "[dependencies]") {
            if name == "isoform" {
                assert!(
                    ![
                        "isoform-cli",
                        "isoform-testdata",
                        "isoform-view",
                        "isoform-zoo"
                    ]
                    .contains(&used.as_str()),
                    "isoform uses {used}"
                );
            } else {
                let allowed = rules
                    .get(name.as_str())
                    .unwrap_or_else(|| panic!("{name} is not in the table of this test"));
                assert!(allowed.contains(&used.as_str()), "{name} uses {used}");
            }
        }
    }
    assert!(seen >= 7, "only {seen} crates were found");
}

#[test]
fn the_reader_of_manifests_reads() {
    let manifest = "[package]\nname = \"isoform-x\"\n[dependencies]\nisoform-fit.workspace = true\nserde = \"1\"\n[dev-dependencies]\nisoform-io = { path = \"\" }\n";
    assert_eq!(ours(manifest, "[dependencies]"), ["isoform-fit"]);
    assert_eq!(ours(manifest, "[dev-dependencies]"), ["isoform-io"]);
}
