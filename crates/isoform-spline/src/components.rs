//! Pieces of the surface, with data and without.

use crate::bspline;
use crate::keys::{Place, key};
use crate::surface::ImplicitSpline;
use isoform_geom::{Point3, PolynomialData, UnionFind};
use rayon::prelude::*;

/// How many pieces the surface f = 0 has within the spline's box, counted by cells: two pieces that
/// pass through one cell count as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Components {
    /// Pieces with data.
    pub with_data: usize,
    /// Pieces without, or that pass beside points: extra branches, as two functions of one surface
    /// may have.
    pub without_data: usize,
}

/// What is known of a cell that the surface passes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sight {
    /// It holds points.
    Held,
    /// It shares a face with one that does.
    Beside,
    /// Neither.
    Unseen,
}

/// The least share of the seen cells of a piece that hold points. Surfaces through points reach a
/// half and more, however few there are; what passes beside them is seen from cells beside.
const HELD: f64 = 0.3;

/// Places along an edge of a cell where the sign is looked at.
const PLACES: usize = 3;

pub(crate) fn components(spline: &ImplicitSpline) -> Components {
    let degree = spline.degree();
    let rows: [bspline::Row; PLACES] =
        std::array::from_fn(|i| bspline::values(degree, i as f64 / (PLACES - 1) as f64));
    let mut sets = UnionFind::new(0);
    let mut sights = Vec::new();
    // Per level and cell the set of a cell that the surface passes through.
    let mut of_cell: Vec<Vec<Option<u32>>> = Vec::new();
    for (l, level) in spline.levels().iter().enumerate() {
        let mut mine = vec![None; level.cells.len()];
        for (i, cell) in level.cells.places().enumerate() {
            if !level.is_refined[i] && changes_sign(&level.of_cell(cell, degree), degree, &rows) {
                mine[i] = Some(sets.add());
                sights.push(sight(cell, |c| spline.holds(l, c)));
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
    counted(&mut sets, &sights)
}

/// How a cell is seen.
fn sight(cell: Place, holds: impl Fn(Place) -> bool) -> Sight {
    let beside = |axis: usize, step: i32| {
        let mut beside = cell;
        beside[axis] += step;
        beside[axis] >= 0 && holds(beside)
    };
    if holds(cell) {
        Sight::Held
    } else if (0..3).any(|k| beside(k, -1) || beside(k, 1)) {
        Sight::Beside
    } else {
        Sight::Unseen
    }
}

/// The pieces that sets make of their members, by how these are seen.
fn counted(sets: &mut UnionFind, sights: &[Sight]) -> Components {
    // Per root: members that hold data, and members beside.
    let mut seen = vec![[0u32; 2]; sights.len()];
    let mut roots = Vec::new();
    for (i, sight) in (0u32..).zip(sights) {
        let root = sets.root(i);
        if root == i {
            roots.push(root);
        }
        match sight {
            Sight::Held => seen[root as usize][0] += 1,
            Sight::Beside => seen[root as usize][1] += 1,
            Sight::Unseen => {}
        }
    }
    let has_data = |root: &&u32| {
        let [held, beside] = seen[**root as usize].map(f64::from);
        held > 0.0 && held >= HELD * (held + beside)
    };
    let with_data = roots.iter().filter(has_data).count();
    Components {
        with_data,
        without_data: roots.len() - with_data,
    }
}

/// Pieces of a polynomial's surface in the lattice that says where points were.
pub(crate) fn of_lattice(
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
        let holds = |at: Place| lattice.cells.binary_search_by_key(&key(at), |c| key(*c));
        sights.push(sight(place, |at| holds(at).is_ok()));
        for axis in (0..3).filter(|k| cell[*k] > 0) {
            let mut before = cell;
            before[axis] -= 1;
            if let Some(other) = of_cell[number(before)] {
                sets.unite(set, other);
            }
        }
    }
    counted(&mut sets, &sights)
}

/// The set of the cell that covers a place of a level, of this level or a coarser one; finer ones
/// look for this one themselves.
fn leaf_set(
    spline: &ImplicitSpline,
    of_cell: &[Vec<Option<u32>>],
    l: usize,
    cell: Place,
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

/// Whether f has both signs at the places of a cell.
fn changes_sign(c: &[f64], degree: usize, rows: &[bspline::Row; PLACES]) -> bool {
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
