//! Connected components of the surface, with and without data.

use crate::bspline;
use crate::keys::{LatticeIndex, key};
use crate::surface::ImplicitSpline;
use isoform_geom::{Point3, PolynomialData, UnionFind};
use rayon::prelude::*;

/// Number of connected components of the surface f = 0 in the spline's box. Components that pass
/// through a common cell are counted as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Components {
    /// Components that pass through cells with data.
    pub with_data: usize,
    /// Components without data, or that only pass close to points: extra branches, as two functions
    /// with equal zero sets may have.
    pub without_data: usize,
}

/// Data points of a cell that the surface passes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CellEvidence {
    /// The cell contains points.
    Inside,
    /// The cell shares a face with one that contains points.
    Neighbour,
    /// Neither the cell nor a neighbour contains points.
    None,
}

/// Minimum share of cells with points among the cells of a component that contain or touch points.
/// True components reach at least half, also in thin samples; an extra branch mostly passes through
/// face neighbours of cells with points.
const MIN_DATA_SHARE: f64 = 0.3;

/// Samples of the sign of f along an edge of a cell.
const SIGN_SAMPLES: usize = 3;

pub(crate) fn components(spline: &ImplicitSpline) -> Components {
    let degree = spline.degree();
    let rows: [bspline::SplineRow; SIGN_SAMPLES] =
        std::array::from_fn(|i| bspline::values(degree, i as f64 / (SIGN_SAMPLES - 1) as f64));
    let mut sets = UnionFind::new(0);
    let mut sights = Vec::new();
    // Component set of each cell that the surface passes through, by level.
    let mut of_cell: Vec<Vec<Option<u32>>> = Vec::new();
    for (l, level) in spline.levels().iter().enumerate() {
        let mut mine = vec![None; level.cells.len()];
        for (i, cell) in level.cells.places().enumerate() {
            if !level.is_refined[i]
                && changes_sign(&level.cell_coefficients(cell, degree), degree, &rows)
            {
                mine[i] = Some(sets.add());
                sights.push(cell_evidence(cell, |c| spline.holds(l, c)));
            }
        }
        of_cell.push(mine);
    }
    for (l, level) in spline.levels().iter().enumerate() {
        for (i, cell) in level.cells.places().enumerate() {
            let Some(set) = of_cell[l][i] else { continue };
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut beside = cell;
                    beside[axis] += step;
                    if let Some(other) = leaf_set(spline, &of_cell, l, beside) {
                        sets.unite(set, other);
                    }
                }
            }
        }
    }
    count_components(&mut sets, &sights)
}

/// Classifies a cell by the data in it and in its face neighbours.
fn cell_evidence(cell: LatticeIndex, holds: impl Fn(LatticeIndex) -> bool) -> CellEvidence {
    let beside = |axis: usize, step: i32| {
        let mut beside = cell;
        beside[axis] += step;
        beside[axis] >= 0 && holds(beside)
    };
    if holds(cell) {
        CellEvidence::Inside
    } else if (0..3).any(|k| beside(k, -1) || beside(k, 1)) {
        CellEvidence::Neighbour
    } else {
        CellEvidence::None
    }
}

/// Counts the components with and without data, given the classification of their cells.
fn count_components(sets: &mut UnionFind, sights: &[CellEvidence]) -> Components {
    // Cells with data and cells next to data, by root.
    let mut seen = vec![[0u32; 2]; sights.len()];
    let mut roots = Vec::new();
    for (i, cell_evidence) in (0u32..).zip(sights) {
        let root = sets.root(i);
        if root == i {
            roots.push(root);
        }
        match cell_evidence {
            CellEvidence::Inside => seen[root as usize][0] += 1,
            CellEvidence::Neighbour => seen[root as usize][1] += 1,
            CellEvidence::None => {}
        }
    }
    let has_data = |root: &&u32| {
        let [held, beside] = seen[**root as usize].map(f64::from);
        held > 0.0 && held >= MIN_DATA_SHARE * (held + beside)
    };
    let with_data = roots.iter().filter(has_data).count();
    Components {
        with_data,
        without_data: roots.len() - with_data,
    }
}

/// Counts the components of a polynomial's surface on the lattice that records which cells had
/// points.
pub(crate) fn lattice_components(
    lattice: &PolynomialData,
    value: impl Fn(Point3) -> f64 + Sync,
) -> Components {
    let count = lattice.count.map(|c| c as usize);
    let corners = count.map(|c| c + 1);
    let is_inside: Vec<bool> = (0..corners.iter().product())
        .into_par_iter()
        .map(|i: usize| {
            let at = [
                i % corners[0],
                i / corners[0] % corners[1],
                i / (corners[0] * corners[1]),
            ];
            let place = |k: usize| lattice.corner[k] + lattice.spacing * at[k] as f64;
            value(std::array::from_fn(place)) >= 0.0
        })
        .collect();
    let crosses = |[x, y, z]: [usize; 3]| {
        let at = |k: usize| {
            let (x, y, z) = (x + (k & 1), y + (k >> 1 & 1), z + (k >> 2));
            is_inside[(z * corners[1] + y) * corners[0] + x]
        };
        (1..8).any(|k| at(k) != at(0))
    };
    let number = |[x, y, z]: [usize; 3]| (z * count[1] + y) * count[0] + x;
    let mut sets = UnionFind::new(0);
    let mut sights = Vec::new();
    let mut of_cell = vec![None; count.iter().product()];
    for i in 0..of_cell.len() {
        let cell = [
            i % count[0],
            i / count[0] % count[1],
            i / (count[0] * count[1]),
        ];
        if !crosses(cell) {
            continue;
        }
        let set = sets.add();
        of_cell[i] = Some(set);
        let place = cell.map(|v| v as i32);
        let holds = |at: LatticeIndex| lattice.cells.binary_search_by_key(&key(at), |c| key(*c));
        sights.push(cell_evidence(place, |at| holds(at).is_ok()));
        for axis in (0..3).filter(|k| cell[*k] > 0) {
            let mut before = cell;
            before[axis] -= 1;
            if let Some(other) = of_cell[number(before)] {
                sets.unite(set, other);
            }
        }
    }
    count_components(&mut sets, &sights)
}

/// Returns the set of the leaf that contains a cell of level `l`, on this or a coarser level. Pairs
/// with finer cells are found from the finer side.
fn leaf_set(
    spline: &ImplicitSpline,
    of_cell: &[Vec<Option<u32>>],
    l: usize,
    cell: LatticeIndex,
) -> Option<u32> {
    let mut cell = cell;
    for l in (0..=l).rev() {
        if let Some(i) = spline.levels()[l].cells.find(cell) {
            return of_cell[l][i];
        }
        cell = cell.map(|v| v >> 1);
    }
    None
}

/// Returns true if f has both signs at the samples of a cell.
fn changes_sign(c: &[f64], degree: usize, rows: &[bspline::SplineRow; SIGN_SAMPLES]) -> bool {
    let n = degree + 1;
    let (lo, hi) = c[..n * n * n]
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(*v), hi.max(*v))
        });
    if lo > 0.0 || hi < 0.0 {
        return false;
    }
    let mut signs = [false; 2];
    for z in rows {
        for y in rows {
            for x in rows {
                let mut f = 0.0;
                for k in 0..n {
                    for j in 0..n {
                        let line = &c[(k * n + j) * n..][..n];
                        let along: f64 = line.iter().zip(x).map(|(c, b)| c * b).sum();
                        f += along * y[j] * z[k];
                    }
                }
                signs[usize::from(f >= 0.0)] = true;
            }
        }
    }
    signs == [true; 2]
}
