//! Files that are held in memory: what Python or a page hands to a verb in place of a file.
//!
//! A mounted object has a path of its own, which verbs take like any other. The name in it is what
//! documents and messages say: [`plain`] takes the rest away.

use crate::failure::Failure;
use crate::outcome::Outcome;
use isoform::SplineDistance;
use isoform::field::hyperfun::Model;
use isoform::geom::{Mesh, PointCloud};
use isoform::io::ReadReport;
use isoform::tess::{Analysis, Map, Surface};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// An object in place of a file.
#[derive(Clone)]
pub enum Object {
    /// Bytes of a file whose format the ending tells: `hf`, `json`, `brep.json`, ...
    Bytes {
        /// Ending of its path, without the dot.
        ending: &'static str,
        /// Content.
        bytes: Arc<Vec<u8>>,
    },
    /// A program with the object that was chosen of it.
    Program(Arc<Model>),
    /// Points as a reader gives them, with its report.
    Points(Arc<PointCloud>, Arc<ReadReport>),
    /// A mesh with its groups, and its unit of length.
    Mesh(Arc<Mesh>, Option<String>),
    /// A function fitted to points.
    Function(Arc<SplineDistance>),
    /// A triangulated rational surface in a box about the origin.
    Map(Arc<MapObject>),
}

/// A rational surface with its triangles.
pub struct MapObject {
    /// The map.
    pub map: Map,
    /// Surface of the object.
    pub surface: Surface,
    /// The analysis of its singularities.
    pub analysis: Analysis,
    /// Half the width of the box.
    pub half_width: f64,
}

impl Object {
    /// Returns what it is, in a few words.
    fn what(&self) -> &'static str {
        match self {
            Self::Bytes { .. } => "a file in memory",
            Self::Program(_) => "a HyperFun program",
            Self::Points(..) => "points",
            Self::Mesh(..) => "a mesh",
            Self::Function(_) => "a function of isoform implicitize",
            Self::Map(_) => "a triangulated map",
        }
    }

    /// Returns the failure of a verb that takes `wanted`, and was given this.
    pub(crate) fn instead_of(&self, wanted: &str, path: &Path) -> Failure {
        let message = format!("{}: {}, not {wanted}", name(path), self.what());
        Failure::input("other-kind", message)
    }

    /// Returns the object of a text with an ending.
    pub fn text(ending: &'static str, text: impl Into<Vec<u8>>) -> Self {
        Self::Bytes {
            ending,
            bytes: Arc::new(text.into()),
        }
    }

    /// Returns the ending that tells readers its kind.
    fn ending(&self) -> &'static str {
        match self {
            Self::Bytes { ending, .. } => ending,
            Self::Program(_) => "hf",
            Self::Points(..) => "ply",
            Self::Mesh(..) => "msh",
            Self::Function(..) | Self::Map(..) => "json",
        }
    }
}

/// Endings of objects.
const ENDINGS: [&str; 8] = [
    "brep.json",
    "json",
    "html",
    "hf",
    "msh",
    "ply",
    "png",
    "svg",
];

/// Objects by their paths.
static OBJECTS: Mutex<BTreeMap<PathBuf, Object>> = Mutex::new(BTreeMap::new());
/// Number of the next object.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// Brackets around the number in front of a name; an empty pair stands before the ending. These
/// code points are noncharacters (Unicode, section 23.7), so names do not contain them.
const OPEN: char = '\u{fdd0}';
const CLOSE: char = '\u{fdd1}';

/// An object that can be read as long as this lives.
pub struct Mounted(PathBuf);

impl Mounted {
    /// Mounts an object under a name.
    pub fn new(name: &str, object: Object) -> Self {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let ending = object.ending();
        let path = PathBuf::from(format!("{OPEN}{number}{CLOSE}{name}{OPEN}{CLOSE}.{ending}"));
        let mut objects = OBJECTS.lock().unwrap_or_else(PoisonError::into_inner);
        objects.insert(path.clone(), object);
        Self(path)
    }

    /// Returns the bytes, empty unless a verb has written them or they were given.
    pub fn bytes(&self) -> Vec<u8> {
        match find(&self.0) {
            Some(Object::Bytes { bytes, .. }) => Vec::clone(&bytes),
            _ => Vec::new(),
        }
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Mounted {
    fn drop(&mut self) {
        let mut objects = OBJECTS.lock().unwrap_or_else(PoisonError::into_inner);
        objects.remove(&self.0);
    }
}

/// Returns the object of a path.
pub(crate) fn find(path: &Path) -> Option<Object> {
    let objects = OBJECTS.lock().unwrap_or_else(PoisonError::into_inner);
    objects.get(path).cloned()
}

/// Writes to an object; returns false if none has this path.
pub(crate) fn write(path: &Path, content: &[u8]) -> bool {
    let mut objects = OBJECTS.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(Object::Bytes { bytes, .. }) = objects.get_mut(path) else {
        return false;
    };
    *bytes = Arc::new(content.to_vec());
    true
}

/// True if there is a file or an object of this path.
pub(crate) fn exists(path: &Path) -> bool {
    find(path).is_some() || path.exists()
}

/// Returns the name of a file: its path, or what an object is called.
pub(crate) fn name(path: &Path) -> String {
    plain(&path.to_string_lossy())
}

/// Returns a text with the names of objects in place of their paths.
pub fn plain(text: &str) -> String {
    let mut parts = text.split(OPEN);
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let rest = match part.split_once(CLOSE) {
            Some(("", rest)) => ENDINGS
                .iter()
                .find_map(|ending| rest.strip_prefix('.')?.strip_prefix(ending))
                .unwrap_or(rest),
            Some((_, rest)) => rest,
            None => part,
        };
        plain += rest;
    }
    plain
}

/// Returns a document with the names of objects in place of their paths.
fn plain_json(json: Value) -> Value {
    match json {
        Value::String(text) => plain(&text).into(),
        Value::Array(items) => items.into_iter().map(plain_json).collect(),
        Value::Object(fields) => fields
            .into_iter()
            .map(|(k, v)| (k, plain_json(v)))
            .collect(),
        other => other,
    }
}

impl Outcome {
    /// Replaces the paths of objects by their names.
    pub(crate) fn plain(mut self) -> Self {
        self.json = plain_json(self.json);
        self
    }
}

impl Failure {
    /// Replaces the paths of objects by their names.
    pub(crate) fn plain(mut self) -> Self {
        for text in [&mut self.message, &mut self.why, &mut self.hint] {
            *text = plain(text);
        }
        if let Some(file) = &mut self.place.file {
            *file = name(file).into();
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_files_while_they_are_mounted() {
        let mounted = Mounted::new("ball", Object::text("hf", "my_model"));
        let path = mounted.path().to_owned();
        assert!(exists(&path) && path.extension().is_some_and(|e| e == "hf"));
        assert_eq!(plain(&format!("{}: wrong", path.display())), "ball: wrong");
        drop(mounted);
        assert!(!exists(&path));
    }
}
