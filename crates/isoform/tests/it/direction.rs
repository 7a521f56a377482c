//! Dependencies between crates: the table in docs/architecture.md agrees with the manifests, and
//! stages never use one another.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

type Uses = BTreeMap<String, BTreeSet<String>>;

/// Crates that must not use one another: the stages, and the functions on which they work.
const APART: [&str; 10] = [
    "isoform-brep",
    "isoform-cad",
    "isoform-field",
    "isoform-fit",
    "isoform-io",
    "isoform-mesh",
    "isoform-patch",
    "isoform-recognize",
    "isoform-spline",
    "isoform-tess",
];

/// Returns the names of this workspace's crates in a manifest's section.
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

/// Returns the rows `| isoform-x | content | num, geom |` of a table; "all above" stands for the
/// crates of the rows before it, except those that are for development only and that no other row
/// uses.
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
            list => {
                let crate_of = |name: &str| match name {
                    "isoform" => name.to_owned(),
                    name => format!("isoform-{name}"),
                };
                list.split(", ").map(crate_of).collect()
            }
        };
        rows.insert(name.to_owned(), used);
    }
    rows
}

/// Returns the dependencies in the manifests of all crates.
fn manifests() -> Uses {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
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
    manifests
}

/// Returns the first two crates of [`APART`] of which one uses the other, directly or indirectly.
fn first_that_meet(uses: &Uses) -> Option<(&str, &str)> {
    APART.into_iter().find_map(|stage| {
        let mut reached: Vec<&str> = vec![stage];
        let mut next = 0;
        while next < reached.len() {
            for used in &uses[reached[next]] {
                if !reached.contains(&used.as_str()) {
                    reached.push(used);
                }
            }
            next += 1;
        }
        let other = reached[1..].iter().find(|used| APART.contains(used))?;
        Some((stage, *other))
    })
}

#[test]
fn dependencies_are_those_of_the_table() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/architecture.md");
    let text = fs::read_to_string(page).expect("the page");
    assert_eq!(table(&text), manifests(), "table (left), manifests (right)");
}

/// A dependency between two stages would pass the comparison above once the table lists it, too.
#[test]
fn stages_do_not_use_one_another() {
    assert_eq!(first_that_meet(&manifests()), None);
}

#[test]
fn stages_that_meet_are_found() {
    let mut uses = manifests();
    let mut add = |crate_: &str, used: &str| {
        let known = uses.get_mut(crate_).expect("a crate");
        known.insert(used.to_owned());
    };
    add("isoform-check", "isoform-tess");
    assert_eq!(
        first_that_meet(&uses),
        Some(("isoform-mesh", "isoform-tess"))
    );
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

/// Enums of warnings and findings: (crate, file, enum).
const TOLD: [(&str, &str, &str); 6] = [
    ("isoform-mesh", "error.rs", "WarningKind"),
    ("isoform-fit", "report/warning.rs", "Warning"),
    ("isoform-fit", "report/finding.rs", "Finding"),
    ("isoform-brep", "check.rs", "Finding"),
    ("isoform-tess", "finding.rs", "Finding"),
    ("isoform", "mesh_model.rs", "MeshNote"),
];

/// Returns the variants of an enum in a text.
fn variants<'t>(text: &'t str, name: &str) -> Vec<&'t str> {
    let start = text.find(&format!("pub enum {name} {{")).expect("the enum");
    let body = &text[start..];
    let body = &body[..body.find("\n}").expect("its end")];
    let is_variant = |l: &&str| {
        let inner = l.strip_prefix("    ").unwrap_or_default();
        inner.starts_with(|c: char| c.is_ascii_uppercase())
    };
    let word = |l: &'t str| {
        let l = l.trim();
        &l[..l
            .find(|c: char| !c.is_ascii_alphanumeric())
            .unwrap_or(l.len())]
    };
    body.lines().filter(is_variant).map(word).collect()
}

/// Returns all source files of a folder.
fn sources(folder: &Path) -> String {
    let mut all = String::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            all += &sources(&path);
        } else if path.extension().is_some_and(|e| e == "rs") {
            all += &fs::read_to_string(&path).expect("a source");
        }
    }
    all
}

/// Warnings that are never raised have been forgotten by their stage.
#[test]
fn every_warning_is_raised() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for (name, file, of) in TOLD {
        let folder = crates.join(name).join("src");
        let text = fs::read_to_string(folder.join(file)).expect("the file");
        // The library's front end and the verbs raise some of the stages' warnings.
        let fronts = ["isoform/src", "isoform-verbs/src"].map(|f| sources(&crates.join(f)));
        let all = sources(&folder) + &fronts.concat();
        let found = variants(&text, of);
        assert!(found.len() > 3, "{name}: {of} has variants");
        for variant in found {
            let named = format!("{of}::{variant}");
            // In its own file a variant is written as Self, except where it is raised.
            let own = format!("Self::{variant}");
            let is_raised = all.contains(&named) || text.matches(&own).count() > 1;
            assert!(is_raised, "{name}: {named} is never raised");
        }
    }
}
