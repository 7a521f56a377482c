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

/// A polynomial fitted to points in numbers, for files.
///
/// With q = (p − `origin`)/`unit`, f(p) = Σ c qxⁱ qyʲ qzᵏ over all i + j + k ≤ `degree`. A lattice of
/// cells says where the points were.
#[derive(Clone, Debug, PartialEq)]
pub struct PolynomialData {
    /// The total degree.
    pub degree: usize,
    /// Where q = 0 is.
    pub origin: Point3,
    /// The unit of length of q, a power of two.
    pub unit: f64,
    /// The coefficients, by the [`exponents`](Self::exponents).
    pub coefficients: Vec<f64>,
    /// The lower corner of the lattice.
    pub corner: Point3,
    /// Edge length of its cells.
    pub spacing: f64,
    /// Cells along the axes.
    pub count: [i32; 3],
    /// Cells that hold points.
    pub cells: Vec<[i32; 3]>,
}

impl PolynomialData {
    /// The exponents \[i, j, k\] of all monomials up to a total degree, ordered by k, then j, then i.
    pub fn exponents(degree: usize) -> Vec<[u16; 3]> {
        let d = degree as u16;
        let lines = (0..=d).flat_map(|k| (0..=d - k).map(move |j| (j, k)));
        lines
            .flat_map(|(j, k)| (0..=d - k - j).map(move |i| [i, j, k]))
            .collect()
    }
}
