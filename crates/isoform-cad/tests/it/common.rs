//! Reading of test files.

use isoform_cad::{Control, PreparedShape, ShapeError};
use isoform_io::{ShapeFile, StepContent, read_step};
use std::collections::BTreeMap;
use std::path::Path;

/// Reads the shape of a file.
pub(crate) fn read(path: &Path) -> ShapeFile {
    let text = std::fs::read_to_string(path).expect("a file");
    match read_step(&text) {
        Ok(StepContent::Shape(file)) => *file,
        other => panic!("{}: {other:?}", path.display()),
    }
}

/// Triangulates a shape.
pub(crate) fn prepared(file: ShapeFile) -> Result<PreparedShape, ShapeError> {
    PreparedShape::new(file.shape, None, &Control::default())
}

/// Returns the number of sides of triangles that are not passed once in each direction.
pub(crate) fn open_sides(shape: &PreparedShape) -> usize {
    let mut passed: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for t in &shape.facets().triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *passed.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    passed.values().filter(|n| **n != 0).count()
}
