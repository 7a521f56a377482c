//! Implicit splines in numbers: what a file of one holds.

use crate::Point3;

/// A level in numbers, for files.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelData {
    /// Cells that hold data and are refined to this level.
    pub cells: Vec<[i32; 3]>,
    /// Coefficients of the B-splines that touch one of them, of the first level those of all,
    /// ordered by z, then y, then x.
    pub coefficients: Vec<f64>,
}

/// An implicit spline in numbers, for files.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineData {
    /// The tri-degree.
    pub degree: usize,
    /// The lower corner of the lattice.
    pub corner: Point3,
    /// Edge length of the first level's cells.
    pub spacing: f64,
    /// Cells of the first level along the axes.
    pub count: [i32; 3],
    /// The levels, coarse to fine.
    pub levels: Vec<LevelData>,
}
