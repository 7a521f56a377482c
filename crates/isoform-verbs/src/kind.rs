//! Kinds of files with the verbs that take them, for the failures of verbs that take other kinds.

use crate::failure::Failure;
use crate::language::{Language, parse};
use crate::memory;
use isoform::io::{
    FileKind, MAP_KEYS, Source, file_kind, is_implicit, is_patch_file, is_polynomial_file,
    is_solid_file, is_spline_file, mesh_format_named,
};
use serde_json::Value;
use std::path::Path;

/// First bytes that tell the format of a file.
const HEAD: usize = 4096;

/// Kind of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    /// A HyperFun program, or level sets of 3MF, which are read as one.
    Program,
    /// Points or a mesh, in this format.
    File(FileKind),
    /// A solid of exact faces: STEP, or our own form.
    Solid,
    /// A function of `isoform implicitize`.
    Fitted,
    /// A polynomial in x, y and z.
    Polynomial,
    /// Rational patches.
    Patches,
    /// A rational map.
    Map,
    /// JSON of another kind.
    Json,
}

/// The first bytes of a file, as far as they tell its format.
pub(crate) fn head(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.len().min(HEAD)]
}

impl Kind {
    /// Returns the kind of a file by its content, or by its name if the content does not determine
    /// it. `head` holds its first bytes, `text` the whole.
    pub(crate) fn detect(path: &Path, head: &[u8], text: &str) -> Option<Self> {
        if is_step(path) || text.trim_start().starts_with("ISO-10303-21") {
            return Some(Self::Solid);
        }
        if text.trim_start().starts_with('{')
            && let Ok(json) = serde_json::from_str(text)
        {
            return Some(Self::of_json(&json));
        }
        if parse(text, &Language::default()).is_ok() || is_level_sets(path) {
            return Some(Self::Program);
        }
        file_kind(&path.to_string_lossy(), head).map(Self::File)
    }

    /// Returns the kind of a JSON document.
    pub(crate) fn of_json(json: &Value) -> Self {
        if is_solid_file(json) {
            Self::Solid
        } else if is_fitted(json) {
            Self::Fitted
        } else if is_patch_file(json) {
            Self::Patches
        } else if MAP_KEYS.iter().all(|key| json.get(*key).is_some()) {
            Self::Map
        } else if json.get("F").is_some() {
            Self::Polynomial
        } else {
            Self::Json
        }
    }

    /// The failure of a verb that takes `wanted`, and was given this.
    pub(crate) fn instead_of(self, wanted: &str, path: &Path) -> Failure {
        let what = self.what();
        let message = format!("{}: {what}, not {wanted}", path.display());
        let mut failure = Failure::input("other-kind", message);
        failure.place.file = Some(path.to_owned());
        failure.hint(self.takers())
    }

    /// Returns a description in a few words.
    fn what(self) -> String {
        match self {
            Self::Program => "a HyperFun program".to_owned(),
            Self::File(FileKind::Points(f)) if mesh_format_named(f.name).is_some() => {
                format!("a file of points or of a mesh ({})", f.title)
            }
            Self::File(FileKind::Points(f)) => format!("a file of points ({})", f.title),
            Self::File(FileKind::Mesh(f)) => format!("a mesh ({})", f.title),
            Self::File(FileKind::Foreign(what)) => {
                what.split(';').next().unwrap_or_default().to_owned()
            }
            Self::Solid => "a solid of exact faces".to_owned(),
            Self::Fitted => "a function of isoform implicitize".to_owned(),
            Self::Polynomial => "a polynomial in x, y and z".to_owned(),
            Self::Patches => "a file of rational patches".to_owned(),
            Self::Map => "a rational map of two parameters".to_owned(),
            Self::Json => "a JSON file".to_owned(),
        }
    }

    /// The verbs that take it.
    fn takers(self) -> &'static str {
        match self {
            Self::Program => {
                "isoform mesh, brep, parameterize, eval, compare, view or render; isoform fit SCAN \
                 --template with it"
            }
            Self::File(FileKind::Points(f)) if mesh_format_named(f.name).is_some() => {
                "isoform fit, recover, recognize, implicitize, inspect, compare, convert, view or \
                 render; isoform mesh MODEL --adapt with it"
            }
            Self::File(FileKind::Points(_)) => {
                "isoform fit, recover, recognize, implicitize, inspect, compare, convert, view or \
                 render"
            }
            Self::File(FileKind::Mesh(_)) => {
                "isoform inspect, compare, convert, view or render; isoform mesh MODEL --adapt \
                 with it; isoform convert makes an .stl of its surface, which all take that take \
                 points"
            }
            Self::File(FileKind::Foreign(what)) => {
                what.split_once(';').map_or("", |(_, hint)| hint.trim())
            }
            Self::Solid => "isoform mesh, inspect, compare, view or render",
            Self::Fitted => "isoform mesh, eval, parameterize, compare, view or render",
            Self::Polynomial => "isoform mesh, brep, parameterize, eval, compare, view or render",
            Self::Patches | Self::Map => "isoform triangulate, view or render",
            Self::Json => "",
        }
    }
}

/// Kinds of files of solids.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum SolidKind {
    /// STEP.
    Step,
    /// The lossless form of this program.
    Own,
}

/// Returns the kind of a file of solids, by its name.
pub(crate) fn solid_kind(path: &Path) -> Option<SolidKind> {
    let name = path.file_name().unwrap_or_default();
    let name = name.to_string_lossy().to_ascii_lowercase();
    let has = |ending: &str| name.ends_with(ending);
    if has(".step") || has(".stp") {
        Some(SolidKind::Step)
    } else if has(".brep.json") {
        Some(SolidKind::Own)
    } else {
        None
    }
}

/// Returns true if solids are written to files of this name.
pub(crate) fn is_solid(path: &Path) -> bool {
    solid_kind(path).is_some()
}

/// Returns true for the name of a STEP file, which always states a unit.
pub(crate) fn is_step(path: &Path) -> bool {
    solid_kind(path) == Some(SolidKind::Step)
}

/// Returns the format of a file of solids, for people and reports.
pub(crate) fn solid_format(path: &Path) -> &'static str {
    match solid_kind(path) {
        Some(SolidKind::Step) => "step",
        _ => "brep.json",
    }
}

/// Returns true if a path ends as names of files do, and formulas do not: with a point and a word.
pub(crate) fn is_named_file(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy());
    ending.is_some_and(|e| {
        e.starts_with(|c: char| c.is_ascii_alphabetic())
            && e.chars().all(|c| c.is_ascii_alphanumeric())
    })
}

/// Returns true if a file has an ending.
fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// Returns true if the ending of a file says JSON.
pub(crate) fn is_json(path: &Path) -> bool {
    has_ending(path, "json")
}

/// Returns true if a file holds a model: by its name a HyperFun program, by its content level sets
/// of 3MF.
pub(crate) fn is_model(path: &Path) -> bool {
    has_ending(path, "hf") || is_level_sets(path)
}

/// Returns true for a 3MF package that builds level sets.
fn is_level_sets(path: &Path) -> bool {
    has_ending(path, "3mf") && memory::find(path).is_none() && is_implicit(Source::Path(path))
}

/// Returns true for a document that `isoform implicitize` writes.
pub(crate) fn is_fitted(json: &Value) -> bool {
    is_spline_file(json) || is_polynomial_file(json)
}
