//! Data of implicit splines, as files hold them.

use crate::Point3;

/// Level of an implicit spline, for files.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelData {
    /// Cells that hold data and are refined to this level.
    pub cells: Vec<[i32; 3]>,
    /// Coefficients of the B-splines whose support meets one of the cells, on the first level of
    /// all B-splines, ordered by z, then y, then x.
    pub coefficients: Vec<f64>,
}

/// Implicit spline, for files.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineData {
    /// Degree in each of x, y and z.
    pub degree: usize,
    /// Lower corner of the lattice.
    pub corner: Point3,
    /// Edge length of the first level's cells, in model units.
    pub spacing: f64,
    /// Number of cells of the first level along each axis.
    pub count: [i32; 3],
    /// Levels, from coarse to fine.
    pub levels: Vec<LevelData>,
}

/// Polynomial fitted to points, for files.
///
/// With q = (p − `origin`)/`unit`, f(p) = Σ c qxⁱ qyʲ qzᵏ over all i + j + k ≤ `degree`. A lattice
/// of cells describes the region of the points.
#[derive(Clone, Debug, PartialEq)]
pub struct PolynomialData {
    /// Total degree.
    pub degree: usize,
    /// Point of space with q = 0.
    pub origin: Point3,
    /// Unit of length of q, in model units, a power of two.
    pub unit: f64,
    /// Coefficients c, in the order of [`exponents`](Self::exponents).
    pub coefficients: Vec<f64>,
    /// Lower corner of the lattice.
    pub corner: Point3,
    /// Edge length of the cells, in model units.
    pub spacing: f64,
    /// Number of cells along each axis.
    pub count: [i32; 3],
    /// Cells that contain points.
    pub cells: Vec<[i32; 3]>,
}

impl PolynomialData {
    /// Returns the exponents \[i, j, k\] of all monomials up to a total degree, ordered by k, then
    /// j, then i.
    pub fn exponents(degree: usize) -> Vec<[u16; 3]> {
        let d = degree as u16;
        let lines = (0..=d).flat_map(|k| (0..=d - k).map(move |j| (j, k)));
        lines
            .flat_map(|(j, k)| (0..=d - k - j).map(move |i| [i, j, k]))
            .collect()
    }
}
