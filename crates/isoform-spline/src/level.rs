//! One level of a truncated hierarchical B-spline.
//!
//! A level is a lattice of cells with half the spacing of the coarser level. It contains the cells
//! near the data that were refined, and a coefficient for every B-spline that touches one of them.
//! A B-spline that touches a refined cell with data is *active*: its coefficient is an unknown. The
//! other coefficients follow from the coarser level by the two-scale relation, so that the function
//! keeps its smoothness where levels meet (truncation: Giannelli, Jüttler and Speleers 2012).

use crate::bspline::{self, MAX_DEGREE, Parents};
use crate::keys::{IndexSet, LatticeIndex, key};

/// Cells, B-splines and coefficients of a level.
#[derive(Clone, Debug)]
pub(crate) struct SplineLevel {
    /// Edge length of a cell.
    pub(crate) spacing: f64,
    /// Cells of the level.
    pub(crate) cells: IndexSet,
    /// True if the next level covers the cell, by cell.
    pub(crate) is_refined: Vec<bool>,
    /// B-splines that touch a cell of the level.
    pub(crate) nodes: IndexSet,
    /// True if the coefficient is an unknown, by B-spline.
    pub(crate) is_active: Vec<bool>,
    /// Coefficients, by B-spline.
    pub(crate) coefficients: Vec<f64>,
}

/// Iterates over the indices from lo to hi, both included, x fastest.
pub(crate) fn block(lo: LatticeIndex, hi: LatticeIndex) -> impl Iterator<Item = LatticeIndex> {
    (lo[2]..=hi[2]).flat_map(move |z| {
        (lo[1]..=hi[1]).flat_map(move |y| (lo[0]..=hi[0]).map(move |x| [x, y, z]))
    })
}

/// Returns the B-splines that touch one of the cells.
fn nodes_of(cells: impl Iterator<Item = LatticeIndex>, degree: usize) -> IndexSet {
    let mut list = Vec::new();
    for cell in cells {
        list.extend(block(cell, cell.map(|v| v + degree as i32)).map(key));
        if list.len() > 1 << 24 {
            list.sort_unstable();
            list.dedup();
        }
    }
    IndexSet::new(list)
}

impl SplineLevel {
    /// Returns the coarsest level: all cells of a box, all coefficients 0 and unknown.
    pub(crate) fn coarsest(count: LatticeIndex, spacing: f64, degree: usize) -> Self {
        let cells = IndexSet::new(block([0; 3], count.map(|v| v - 1)).map(key).collect());
        let nodes = nodes_of(cells.places(), degree);
        Self {
            spacing,
            is_refined: vec![false; cells.len()],
            is_active: vec![true; nodes.len()],
            coefficients: vec![0.0; nodes.len()],
            cells,
            nodes,
        }
    }

    /// Returns the next level with these cells as those with data; their parents are cells of this
    /// level with data.
    pub(crate) fn refined(
        &mut self,
        data: &[LatticeIndex],
        count: LatticeIndex,
        degree: usize,
    ) -> Self {
        let reach = degree as i32;
        let (mut parents, mut last) = (Vec::new(), None);
        for cell in data {
            let lo = cell.map(|v| (v - reach).max(0) >> 1);
            let hi = std::array::from_fn(|i| (cell[i] + reach).min(count[i] - 1) >> 1);
            // Neighbours often ask for the same cells.
            if last.replace((lo, hi)) != Some((lo, hi)) {
                parents.extend(block(lo, hi).map(key));
            }
            if parents.len() > 1 << 24 {
                parents.sort_unstable();
                parents.dedup();
            }
        }
        let parents = IndexSet::new(parents);
        let mut list = Vec::with_capacity(8 * parents.len());
        for parent in parents.places() {
            let at = self.cells.find(parent).expect("levels are nested");
            self.is_refined[at] = true;
            let lo = parent.map(|v| 2 * v);
            list.extend(block(lo, lo.map(|v| v + 1)).map(key));
        }
        let cells = IndexSet::new(list);
        let nodes = nodes_of(cells.places(), degree);
        let mut is_active = vec![false; nodes.len()];
        for cell in data {
            for node in block(*cell, cell.map(|v| v + reach)) {
                is_active[nodes.find(node).expect("data lies in a cell")] = true;
            }
        }
        let mut next = Self {
            spacing: 0.5 * self.spacing,
            is_refined: vec![false; cells.len()],
            coefficients: vec![0.0; nodes.len()],
            is_active,
            cells,
            nodes,
        };
        next.inherit(self, degree, |_| true);
        next
    }

    /// Computes coefficients from the coarser level by the two-scale relation, for the B-splines
    /// selected by `which`.
    pub(crate) fn inherit(&mut self, coarse: &Self, degree: usize, which: impl Fn(usize) -> bool) {
        let parents = bspline::parents(degree);
        for i in (0..self.nodes.len()).filter(|i| which(*i)) {
            self.coefficients[i] = coarse.combined(self.nodes.at(i), &parents);
        }
    }

    /// Returns the coefficient of a fine B-spline in this level's function.
    fn combined(&self, fine: LatticeIndex, parents: &[Parents; 2]) -> f64 {
        let axis = fine.map(|v| parents[(v & 1) as usize]);
        let first: [i64; 3] = std::array::from_fn(|k| i64::from(fine[k] >> 1) + axis[k].first);
        let mut sum = 0.0;
        for c in 0..axis[2].count {
            for b in 0..axis[1].count {
                let weight = axis[2].weights[c] * axis[1].weights[b];
                for a in 0..axis[0].count {
                    let at = [a, b, c];
                    let node = std::array::from_fn(|k| (first[k] + at[k] as i64) as i32);
                    let i = self
                        .nodes
                        .find(node)
                        .expect("parents touch the parent cell");
                    sum += weight * axis[0].weights[a] * self.coefficients[i];
                }
            }
        }
        sum
    }

    /// Returns the number of unknowns.
    pub(crate) fn unknowns(&self) -> usize {
        self.is_active.iter().filter(|a| **a).count()
    }

    /// Returns, for the (d + 1)² pairs of y and z, the position of the first of the d + 1
    /// consecutive B-splines in x that touch a cell.
    pub(crate) fn runs(&self, cell: LatticeIndex, degree: usize) -> RunStarts {
        let mut runs = [0; (MAX_DEGREE + 1) * (MAX_DEGREE + 1)];
        for c in 0..=degree {
            for b in 0..=degree {
                let node = [cell[0], cell[1] + b as i32, cell[2] + c as i32];
                runs[c * (degree + 1) + b] =
                    self.nodes
                        .find(node)
                        .expect("B-splines of a cell are there") as u32;
            }
        }
        runs
    }
}

impl SplineLevel {
    /// Returns the coefficients of the B-splines that touch a cell, x fastest.
    pub(crate) fn cell_coefficients(
        &self,
        cell: LatticeIndex,
        degree: usize,
    ) -> [f64; MAX_CELL_SPLINES] {
        let n = degree + 1;
        let mut out = [0.0; MAX_CELL_SPLINES];
        for (line, first) in self.runs(cell, degree)[..n * n].iter().enumerate() {
            let first = *first as usize;
            out[line * n..(line + 1) * n].copy_from_slice(&self.coefficients[first..first + n]);
        }
        out
    }
}

/// Maximum number of B-splines that touch a cell.
pub(crate) const MAX_CELL_SPLINES: usize = (MAX_DEGREE + 1) * (MAX_DEGREE + 1) * (MAX_DEGREE + 1);

/// Positions returned by [`SplineLevel::runs`].
pub(crate) type RunStarts = [u32; (MAX_DEGREE + 1) * (MAX_DEGREE + 1)];
