//! One level of a truncated hierarchical B-spline.
//!
//! A level is a lattice of cells with half the spacing of the level before. It holds the cells near
//! the data that were asked to be refined, and a coefficient for every B-spline that touches one of
//! them. A B-spline that touches a refined cell with data is *active*: its coefficient is an
//! unknown of its own. The coefficients of the others follow from the level before by the two-scale
//! relation, so that the function stays as smooth where levels meet (truncation: Giannelli, Jüttler
//! and Speleers 2012).

use crate::bspline::{self, MAX_DEGREE, Parents};
use crate::keys::{Keys, Place, key};

/// Cells, B-splines and coefficients of a level.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Length of a cell's edge.
    pub(crate) spacing: f64,
    /// Cells of the level.
    pub(crate) cells: Keys,
    /// Whether the next level covers a cell.
    pub(crate) is_refined: Vec<bool>,
    /// B-splines that touch a cell of the level.
    pub(crate) nodes: Keys,
    /// Which of them have an unknown of their own.
    pub(crate) is_active: Vec<bool>,
    /// Coefficients of all of them.
    pub(crate) coefficients: Vec<f64>,
}

/// The places lo, …, hi, both included, along three axes.
pub(crate) fn block(lo: Place, hi: Place) -> impl Iterator<Item = Place> {
    (lo[2]..=hi[2]).flat_map(move |z| {
        (lo[1]..=hi[1]).flat_map(move |y| (lo[0]..=hi[0]).map(move |x| [x, y, z]))
    })
}

/// B-splines that touch one of the cells.
fn nodes_of(cells: impl Iterator<Item = Place>, degree: usize) -> Keys {
    let mut list = Vec::new();
    for cell in cells {
        list.extend(block(cell, cell.map(|v| v + degree as i32)).map(key));
        if list.len() > 1 << 24 {
            list.sort_unstable();
            list.dedup();
        }
    }
    Keys::new(list)
}

impl Level {
    /// The coarsest level: all cells of a box, all coefficients 0 and unknown.
    pub(crate) fn coarsest(count: Place, spacing: f64, degree: usize) -> Self {
        let cells = Keys::new(block([0; 3], count.map(|v| v - 1)).map(key).collect());
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

    /// The next level with these cells of half the spacing as those with data. Their parents are
    /// cells of this level with data.
    pub(crate) fn refined(&mut self, data: &[Place], count: Place, degree: usize) -> Self {
        let reach = degree as i32;
        let mut list = Vec::new();
        for cell in data {
            let lo = cell.map(|v| (v - reach).max(0) & !1);
            let hi = std::array::from_fn(|i| (cell[i] + reach).min(count[i] - 1) | 1);
            list.extend(block(lo, hi).map(key));
            if list.len() > 1 << 24 {
                list.sort_unstable();
                list.dedup();
            }
        }
        let cells = Keys::new(list);
        for cell in cells.places().filter(|c| c.iter().all(|v| v & 1 == 0)) {
            let parent = self
                .cells
                .find(cell.map(|v| v / 2))
                .expect("levels are nested");
            self.is_refined[parent] = true;
        }
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

    /// Takes coefficients from the level before by the two-scale relation, for the B-splines that
    /// `which` chooses by number.
    pub(crate) fn inherit(&mut self, coarse: &Self, degree: usize, which: impl Fn(usize) -> bool) {
        let parents = bspline::parents(degree);
        for i in (0..self.nodes.len()).filter(|i| which(*i)) {
            self.coefficients[i] = coarse.combined(self.nodes.at(i), &parents);
        }
    }

    /// The coefficient of a fine B-spline in this level's function.
    fn combined(&self, fine: Place, parents: &[Parents; 2]) -> f64 {
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

    /// Numbers of unknowns.
    pub(crate) fn unknowns(&self) -> usize {
        self.is_active.iter().filter(|a| **a).count()
    }

    /// The numbers of the first of d + 1 consecutive B-splines in x, for the (d + 1)² pairs of y
    /// and z, that touch a cell.
    pub(crate) fn runs(&self, cell: Place, degree: usize) -> Runs {
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

impl Level {
    /// The coefficients of the B-splines that touch a cell, x fastest.
    pub(crate) fn of_cell(&self, cell: Place, degree: usize) -> [f64; CELL] {
        let n = degree + 1;
        let mut out = [0.0; CELL];
        for (line, first) in self.runs(cell, degree)[..n * n].iter().enumerate() {
            let first = *first as usize;
            out[line * n..(line + 1) * n].copy_from_slice(&self.coefficients[first..first + n]);
        }
        out
    }
}

/// B-splines that touch a cell, at most.
pub(crate) const CELL: usize = (MAX_DEGREE + 1) * (MAX_DEGREE + 1) * (MAX_DEGREE + 1);

/// See [`Level::runs`].
pub(crate) type Runs = [u32; (MAX_DEGREE + 1) * (MAX_DEGREE + 1)];
