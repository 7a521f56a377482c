//! Octree of the cells that may hold a feature: cells in which two pieces can be zero and decide
//! the sign.

use super::newton::{normalised, onto_one};
use crate::decide::{Local, NarrowedTree, Scratch};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm};
use rayon::prelude::*;
use std::ops::Range;

/// Size of the cells that are searched for tips of cones, in sizes.
const COARSE_CELL_SIZE: f64 = 4.0;
/// Maximum size of a leaf, in sizes.
const MAX_LEAF_SIZE: f64 = 0.5;
/// Minimum cosine between normals within a nearly flat cell, 35 degrees.
const MIN_FLAT_COSINE: f64 = 0.82;
/// Points of a cell at which surfaces are compared, in its own coordinates from −1 to 1: no two are
/// collinear with the centre.
pub(crate) const CELL_PROBES: [Point3; 4] = [
    [0.71, 0.37, -0.53],
    [-0.43, 0.67, 0.59],
    [0.31, -0.73, 0.41],
    [-0.61, -0.29, -0.67],
];
/// Rounding error relative to the largest coordinate, and the number of such errors by which two
/// pieces of one surface may differ.
const COINCIDENCE_ROUNDINGS: [f64; 2] = [1e-15, 64.0];

/// A cell with the part of the solid that matters in it.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) cell: Aabb,
    pub(crate) local: Local,
    children: Range<u32>,
}

/// A cell that is not split further.
#[derive(Clone, Debug)]
pub(crate) struct Leaf {
    pub(crate) cell: Aabb,
    pub(crate) local: Local,
    /// Pieces in the cell; of coincident pieces only the first.
    pub(crate) surfaces: Vec<u32>,
    /// True if the surfaces are nearly flat here, so that two of them have at most one curve in
    /// common.
    pub(crate) simple: bool,
}

/// Cells by levels, from the region down to the leaves.
#[derive(Debug)]
pub(crate) struct Octree {
    nodes: Vec<Node>,
    pub(crate) leaves: Vec<Leaf>,
    /// Cells of [`COARSE_CELL_SIZE`] sizes, or larger ones where a single piece matters, with the
    /// pieces that matter.
    pub(crate) coarse: Vec<(Aabb, Local)>,
    /// Cells that were not examined because the budget was spent.
    pub(crate) skipped: Vec<Aabb>,
    pub(crate) visited: usize,
}

/// A part of a cell in which a piece matters.
struct CellPart {
    node: Node,
    /// True if more than one surface may matter there.
    holds_more: bool,
}

/// Outcome of the examination of a cell.
enum CellFate {
    Leaf(Leaf),
    Split(Vec<CellPart>),
}

impl Octree {
    pub(crate) fn new(
        solid: &dyn Solid,
        region: Aabb,
        size: f64,
        budget: usize,
        control: &Control<'_>,
    ) -> Self {
        let mut tree = Self::of_region(solid, region, size);
        let mut level = 0..tree.nodes.len();
        while !level.is_empty() {
            if tree.visited > budget || control.is_stopped() {
                tree.skip(level);
                break;
            }
            let nodes = tree.nodes[level.clone()].par_iter();
            let fates: Vec<CellFate> = nodes
                .with_min_len(32)
                .map_init(
                    || Scratch::new(solid),
                    |scratch, node| match control.is_stopped() {
                        true => CellFate::Split(Vec::new()),
                        false => fate(solid, node, size, scratch),
                    },
                )
                .collect();
            if control.is_stopped() {
                tree.skip(level);
                break;
            }
            let first = tree.nodes.len();
            for (i, fate) in level.zip(fates) {
                match fate {
                    CellFate::Leaf(leaf) => tree.leaves.push(leaf),
                    CellFate::Split(parts) => tree.add(i, parts, size),
                }
            }
            level = first..tree.nodes.len();
        }
        tree
    }

    /// Creates the tree of the root alone; it is empty if no piece matters in the region.
    fn of_region(solid: &dyn Solid, region: Aabb, size: f64) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            leaves: Vec::new(),
            coarse: Vec::new(),
            skipped: Vec::new(),
            visited: 1,
        };
        let mut scratch = Scratch::new(solid);
        let all = Local::everywhere(solid);
        if let NarrowedTree::Mixed(local) = all.narrow(solid, slack(region), &mut scratch) {
            if longest(&region) <= COARSE_CELL_SIZE * size {
                tree.coarse.push((region, local.clone()));
            }
            tree.nodes.push(Node {
                cell: region,
                local,
                children: 0..0,
            });
        }
        tree
    }

    /// Records the cells of a level as not examined.
    fn skip(&mut self, level: Range<usize>) {
        let cells = self.nodes[level].iter().map(|n| n.cell);
        self.skipped.extend(cells);
    }

    /// Adds the parts of a cell.
    fn add(&mut self, i: usize, parts: Vec<CellPart>, size: f64) {
        let is_coarse = longest(&self.nodes[i].cell) > COARSE_CELL_SIZE * size;
        self.visited += 8;
        let start = self.nodes.len() as u32;
        for CellPart { node, holds_more } in parts {
            if is_coarse && (!holds_more || longest(&node.cell) <= COARSE_CELL_SIZE * size) {
                self.coarse.push((node.cell, node.local.clone()));
            }
            if holds_more {
                self.nodes.push(node);
            }
        }
        self.nodes[i].children = start..self.nodes.len() as u32;
        // An inner node without children holds no feature: it must not look like a leaf.
        if self.nodes[i].children.is_empty() {
            self.nodes[i].local = Local {
                tree: self.nodes[i].local.tree.clone(),
                pieces: [].into(),
            };
        }
    }

    /// Returns the part of the solid that matters at a point; `None` where no feature can be.
    pub(crate) fn at(&self, p: Point3) -> Option<&Local> {
        let mut node = self.nodes.first().filter(|n| holds(&n.cell, p))?;
        while !node.children.is_empty() {
            node = self.nodes[node.children.start as usize..node.children.end as usize]
                .iter()
                .find(|n| holds(&n.cell, p))?;
        }
        (node.local.pieces.len() > 1).then_some(&node.local)
    }
}

/// Returns true if a point lies in a cell, or on its border.
pub(crate) fn holds(cell: &Aabb, p: Point3) -> bool {
    (0..3).all(|i| cell.lo[i] <= p[i] && p[i] <= cell.hi[i])
}

/// Widens a cell by its slack.
pub(crate) fn slack(cell: Aabb) -> Aabb {
    // So a feature on a face belongs to the cells on both sides.
    cell.widened(1e-5 * longest(&cell))
}

/// Returns the longest side of a cell.
pub(crate) fn longest(cell: &Aabb) -> f64 {
    cell.size().into_iter().fold(0.0, f64::max)
}

/// Halves a cell along all long sides.
pub(crate) fn split(cell: Aabb) -> impl Iterator<Item = Aabb> {
    // Sides much shorter than the longest one stay.
    let (size, center, long) = (cell.size(), cell.center(), 0.6 * longest(&cell));
    let cut: [bool; 3] = std::array::from_fn(|i| size[i] > long);
    let is_upper = |part: usize, i: usize| part >> i & 1 == 1;
    (0..8usize)
        .filter(move |&k| (0..3).all(|i| cut[i] || !is_upper(k, i)))
        .map(move |k| {
            let mut part = cell;
            for i in (0..3).filter(|&i| cut[i]) {
                if is_upper(k, i) {
                    part.lo[i] = center[i];
                } else {
                    part.hi[i] = center[i];
                }
            }
            part
        })
}

/// Examines a cell: it is a leaf if it is small enough for the surfaces in it.
fn fate(solid: &dyn Solid, node: &Node, size: f64, scratch: &mut Scratch) -> CellFate {
    let side = longest(&node.cell);
    if side > MAX_LEAF_SIZE * size || node.local.pieces.len() < 2 {
        return CellFate::Split(parts(solid, node, scratch));
    }
    let levels = (MAX_LEAF_SIZE * size / side).log2().floor() as u32;
    let surfaces = surfaces(solid, &node.local.pieces, node.cell);
    let simple = surfaces
        .iter()
        .all(|i| is_nearly_flat(solid, *i, node.cell));
    // Cells in which three surfaces may meet are two levels smaller.
    let meet =
        levels < 2 && surfaces.len() > 2 && directions(solid, &surfaces, node.cell.center()) > 2;
    // Cells with a curved surface are up to four levels smaller: features of size/32 are still
    // found.
    if surfaces.len() > 1 && (meet || (!simple && levels < 4)) {
        return CellFate::Split(parts(solid, node, scratch));
    }
    CellFate::Leaf(Leaf {
        cell: node.cell,
        local: node.local.clone(),
        surfaces,
        simple,
    })
}

/// Returns the parts of a cell in which a piece matters.
fn parts(solid: &dyn Solid, node: &Node, scratch: &mut Scratch) -> Vec<CellPart> {
    let mut parts = Vec::new();
    for cell in split(node.cell) {
        if let NarrowedTree::Mixed(local) = node.local.narrow(solid, slack(cell), scratch) {
            let holds_more =
                local.pieces.len() > 1 && !is_one_function(solid, &local.pieces, cell, scratch);
            let node = Node {
                cell,
                local,
                children: 0..0,
            };
            parts.push(CellPart { node, holds_more });
        }
    }
    parts
}

/// Returns true if pieces have equal ranges and equal values in a cell. Away from a blend, the
/// pieces over which the blend was distributed are one function.
pub(crate) fn is_one_function(
    solid: &dyn Solid,
    pieces: &[u32],
    cell: Aabb,
    scratch: &Scratch,
) -> bool {
    let first = scratch.range(pieces[0]);
    if pieces[1..].iter().any(|k| scratch.range(*k) != first) {
        return false;
    }
    let points = CELL_PROBES.map(|at| inside(&cell, at));
    let mut values = vec![0.0; pieces.len() * points.len()];
    solid.values(pieces, &points, &mut values);
    let (one, others) = values.split_at(points.len());
    others.chunks(points.len()).all(|v| v == one)
}

/// Counts the different normals of the surfaces at a point.
fn directions(solid: &dyn Solid, surfaces: &[u32], p: Point3) -> usize {
    let mut found: Vec<Point3> = Vec::with_capacity(surfaces.len());
    for g in surfaces.iter().filter_map(|i| normalised(solid, *i, p)) {
        // Within 3.4 degrees surfaces of a small cell do not meet in a corner.
        if found.iter().all(|n| norm(cross(*n, g.n)) > 0.06) {
            found.push(g.n);
        }
    }
    found.len()
}

/// Returns the point of a cell with the given coordinates in the cell.
pub(crate) fn inside(cell: &Aabb, at: Point3) -> Point3 {
    let (center, size) = (cell.center(), cell.size());
    std::array::from_fn(|i| center[i] + 0.5 * at[i] * size[i])
}

/// Returns true if a piece's normals differ little within a cell.
fn is_nearly_flat(solid: &dyn Solid, piece: u32, cell: Aabb) -> bool {
    let Some(here) = normalised(solid, piece, cell.center()) else {
        return false;
    };
    CELL_PROBES.iter().all(|at| {
        normalised(solid, piece, inside(&cell, *at))
            .is_some_and(|there| dot(here.n, there.n) > MIN_FLAT_COSINE)
    })
}

/// Selects one piece per surface: pieces that coincide at the probes are one surface.
pub(crate) fn surfaces(solid: &dyn Solid, pieces: &[u32], cell: Aabb) -> Vec<u32> {
    let center = cell.center();
    let points = CELL_PROBES.map(|at| inside(&cell, at));
    let mut values = vec![0.0; pieces.len() * points.len()];
    solid.values(pieces, &points, &mut values);
    let value = |k: usize| &values[k * points.len()..(k + 1) * points.len()];
    let mut found: Vec<(u32, Option<Point3>)> = Vec::with_capacity(pieces.len());
    for (k, &piece) in pieces.iter().enumerate() {
        if (0..k).any(|l| value(l) == value(k)) {
            continue;
        }
        let n = normalised(solid, piece, center).map(|g| g.n);
        let is_same = |other: &(u32, Option<Point3>)| match (n, other.1) {
            (Some(a), Some(b)) => {
                // Pieces with a larger sine at the centre are surely not one surface.
                norm(cross(a, b)) < 0.3 && coincide(solid, other.0, piece, cell)
            }
            _ => false,
        };
        if !found.iter().any(is_same) {
            found.push((piece, n));
        }
    }
    found.into_iter().map(|(i, _)| i).collect()
}

/// Returns true if one piece vanishes where another one does, at all probes.
fn coincide(solid: &dyn Solid, a: u32, b: u32, cell: Aabb) -> bool {
    let side = longest(&cell);
    let coordinates = cell.lo.into_iter().chain(cell.hi);
    let far = COINCIDENCE_ROUNDINGS[0] * coordinates.fold(0.0, |m: f64, v| m.max(v.abs()));
    CELL_PROBES.iter().all(|at| {
        let q = onto_one(solid, a, inside(&cell, *at), 2.0 * side);
        q.and_then(|q| normalised(solid, b, q))
            .is_some_and(|g| g.d.abs() <= 1e-8 * side + COINCIDENCE_ROUNDINGS[1] * far)
    })
}
