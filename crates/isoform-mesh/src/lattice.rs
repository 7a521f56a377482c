//! The body-centred cubic lattice over a solid, with the part of the tree that matters in each
//! cell.
//!
//! Cells are decided by intervals from large boxes down: inside, outside, or a reduced tree of the
//! pieces that can still decide the sign there. Only cells of the third kind see the surface; the
//! others are never evaluated at all (Labelle and Shewchuk, Isosurface stuffing, 2007, use the same
//! lattice; the pruning is that of Duff, Interval arithmetic and recursive subdivision, 1992).

use crate::decide::{Sign, reduced};
use isoform_control::Control;
use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::Interval;
use rayon::prelude::*;
use std::collections::HashMap;

/// Cell surely inside.
pub(crate) const IN: u32 = 0;
/// Cell surely outside.
pub(crate) const OUT: u32 = 1;
/// Cells are looked at with this margin (in cells) around them, so that what is found for a cell
/// also holds for vertices moved there.
const MARGIN: f64 = 0.75;
/// Cells per side of the blocks that are shared among threads.
const BLOCK: usize = 16;

/// The cells of the lattice over a box.
#[derive(Debug)]
pub(crate) struct Lattice {
    pub(crate) origin: Point3,
    /// Edge of a cell, the lattice's long edge.
    pub(crate) a: f64,
    /// Cells by axis.
    pub(crate) n: [usize; 3],
    /// [`IN`], [`OUT`], or 2 + index of a reduced tree, x fastest.
    pub(crate) state: Vec<u32>,
    pub(crate) trees: Vec<(Csg, Vec<u32>)>,
}

impl Lattice {
    /// The lattice with cells of edge `a` over the region, which must hold the solid. On a stop by
    /// `control` cells are left undecided, and the lattice must not be used.
    pub(crate) fn new(solid: &dyn Solid, region: Aabb, a: f64, control: &Control<'_>) -> Self {
        // Off the round numbers that models are full of: lattice planes on faces of the solid leave
        // every tie to rounding.
        let offset = [0.618, 0.414, 0.732].map(|o| (1.0 + o) * a);
        let origin: Point3 = std::array::from_fn(|i| region.lo[i] - offset[i]);
        let n: [usize; 3] = std::array::from_fn(|i| {
            ((region.hi[i] + 1.6 * a - origin[i]) / a).ceil().max(3.0) as usize
        });
        let mut lattice = Self {
            origin,
            a,
            n,
            state: vec![OUT; n[0] * n[1] * n[2]],
            trees: Vec::new(),
        };
        let blocks: Vec<[[usize; 2]; 3]> = {
            let ranges = n.map(|n| {
                (0..n)
                    .step_by(BLOCK)
                    .map(|i| [i, (i + BLOCK).min(n)])
                    .collect::<Vec<_>>()
            });
            let mut blocks = Vec::new();
            for &z in &ranges[2] {
                for &y in &ranges[1] {
                    blocks.extend(ranges[0].iter().map(|&x| [x, y, z]));
                }
            }
            blocks
        };
        let all = solid.tree().pieces();
        let found: Vec<Vec<([[usize; 2]; 3], Sign)>> = blocks
            .par_iter()
            .map(|b| {
                let mut found = Vec::new();
                if control.is_stopped() {
                    return found;
                }
                lattice.decide(solid, *b, solid.tree(), &all, &mut found);
                found
            })
            .collect();
        let mut known: HashMap<Csg, u32> = HashMap::new();
        for (cells, sign) in found.into_iter().flatten() {
            let state = match sign {
                Sign::Inside => IN,
                Sign::Outside => OUT,
                Sign::Mixed(tree) => *known.entry(tree).or_insert_with_key(|tree| {
                    lattice.trees.push((tree.clone(), unique(tree.pieces())));
                    lattice.trees.len() as u32 + 1
                }),
            };
            for k in cells[2][0]..cells[2][1] {
                for j in cells[1][0]..cells[1][1] {
                    let row = lattice.at([cells[0][0], j, k]);
                    lattice.state[row..row + cells[0][1] - cells[0][0]].fill(state);
                }
            }
        }
        lattice
    }

    /// Cells that it would take.
    pub(crate) fn cells(region: Aabb, a: f64) -> f64 {
        region.size().iter().map(|s| (s / a + 4.0).ceil()).product()
    }

    fn decide(
        &self,
        solid: &dyn Solid,
        cells: [[usize; 2]; 3],
        tree: &Csg,
        pieces: &[u32],
        found: &mut Vec<([[usize; 2]; 3], Sign)>,
    ) {
        let corner = |k: usize, margin: f64| {
            std::array::from_fn(|i| self.origin[i] + (cells[i][k] as f64 + margin) * self.a)
        };
        let region = Aabb {
            lo: corner(0, -MARGIN),
            hi: corner(1, MARGIN),
        };
        let mut ranges = vec![Interval::ALL; pieces.len()];
        solid.bounds(pieces, region, &mut ranges);
        let range = |i: u32| {
            pieces
                .iter()
                .position(|&p| p == i)
                .map_or(Interval::ALL, |k| ranges[k])
        };
        match reduced(tree, &range) {
            Sign::Mixed(tree) => {
                let size = cells.map(|c| c[1] - c[0]);
                let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
                if size[axis] == 1 {
                    found.push((cells, Sign::Mixed(tree)));
                    return;
                }
                let pieces = unique(tree.pieces());
                let middle = cells[axis][0] + size[axis] / 2;
                for half in [[cells[axis][0], middle], [middle, cells[axis][1]]] {
                    let mut cells = cells;
                    cells[axis] = half;
                    self.decide(solid, cells, &tree, &pieces, found);
                }
            }
            decided => found.push((cells, decided)),
        }
    }

    pub(crate) fn at(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.n[1] + j) * self.n[0] + i
    }
    /// State of a cell; outside the grid there is nothing.
    pub(crate) fn cell(&self, c: [isize; 3]) -> u32 {
        if (0..3).any(|i| c[i] < 0 || c[i] as usize >= self.n[i]) {
            OUT
        } else {
            self.state[self.at(c.map(|v| v as usize))]
        }
    }
    /// State of the cell that holds a point.
    pub(crate) fn state_at(&self, p: Point3) -> u32 {
        self.cell(std::array::from_fn(|i| {
            ((p[i] - self.origin[i]) / self.a).floor() as isize
        }))
    }
    /// Position of a lattice point in half cells: even coordinates are corners of cells, odd ones
    /// centres.
    pub(crate) fn point(&self, half: [usize; 3]) -> Point3 {
        std::array::from_fn(|i| self.origin[i] + 0.5 * self.a * half[i] as f64)
    }
    /// The four tetrahedra around the face between cell `c` and the next one along `axis`, by
    /// lattice points in half cells.
    pub(crate) fn tets(c: [usize; 3], axis: usize) -> [[[usize; 3]; 4]; 4] {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let centre = c.map(|i| 2 * i + 1);
        let mut next = centre;
        next[axis] += 2;
        let corner = |s: usize, t: usize| {
            let mut p = c.map(|i| 2 * i);
            p[axis] += 2;
            p[u] += 2 * s;
            p[v] += 2 * t;
            p
        };
        let q = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        std::array::from_fn(|k| [centre, next, q[k], q[(k + 1) % 4]])
    }
}

pub(crate) fn unique(mut v: Vec<u32>) -> Vec<u32> {
    v.sort_unstable();
    v.dedup();
    v
}
