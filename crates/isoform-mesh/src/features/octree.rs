//! Cells that may hold a feature: where two pieces can be zero and decide the sign.

use super::newton::{normalised, onto_one};
use crate::decide::{Local, Narrowed, Scratch};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm};
use rayon::prelude::*;
use std::ops::Range;

/// Cells are widened by this part of their size when they are bounded, so that a feature on a face
/// belongs to the cells on both sides.
const SLACK: f64 = 1e-5;
/// Where cells are gone over for apexes, in sizes.
const COARSE: f64 = 4.0;
/// Largest leaves, in sizes.
const LEAF: f64 = 0.5;
/// Levels below size/2 for cells in which three surfaces may meet.
const CORNER_LEVELS: u32 = 2;
/// Levels below size/2 for cells in which a surface turns by more than [`TURN`]: features of
/// size/32 are still found.
const CURVED_LEVELS: u32 = 4;
/// Cosine of the angle by which normals may turn within a simple cell, 35 degrees.
const TURN: f64 = 0.82;
/// Where in a cell surfaces are compared, in its own coordinates from −1 to 1: no two on a line
/// with the centre.
pub(crate) const PROBES: [Point3; 4] = [
    [0.71, 0.37, -0.53],
    [-0.43, 0.67, 0.59],
    [0.31, -0.73, 0.41],
    [-0.61, -0.29, -0.67],
];
/// In a small cell, surfaces do not meet in a corner if the sine between them is below this (3.4
/// degrees).
const PARALLEL: f64 = 0.06;
/// Sine of the normals at a cell's centre above which two pieces are surely not one surface.
const DIFFERENT: f64 = 0.3;
/// Pieces nearer than this part of a cell at all probes are one surface.
const SAME: f64 = 1e-8;
/// Rounding, as a part of the largest coordinate; and how many such roundings two pieces of one
/// surface may differ by.
const ROUNDING: [f64; 2] = [1e-15, 64.0];
/// Sides of a cell longer than this part of its longest one are halved.
const LONG: f64 = 0.6;
/// Cells that a thread takes at once.
const CHUNK: usize = 32;

/// A cell with the part of the solid that matters in it.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) cell: Aabb,
    pub(crate) local: Local,
    children: Range<u32>,
}

/// A cell that is not split any more.
#[derive(Clone, Debug)]
pub(crate) struct Leaf {
    pub(crate) cell: Aabb,
    pub(crate) local: Local,
    /// The pieces in the cell; of pieces that coincide only the first.
    pub(crate) surfaces: Vec<u32>,
    /// Whether the surfaces are nearly flat here, so that two of them have at most one curve in
    /// common.
    pub(crate) simple: bool,
}

/// Cells by levels, from the region down to the leaves.
#[derive(Debug)]
pub(crate) struct Octree {
    nodes: Vec<Node>,
    pub(crate) leaves: Vec<Leaf>,
    /// Cells of [`COARSE`] times the size, or larger where a single piece matters, with the pieces
    /// that do.
    pub(crate) coarse: Vec<(Aabb, Local)>,
    /// Cells that were not looked at: the budget was spent.
    pub(crate) skipped: Vec<Aabb>,
    pub(crate) visited: usize,
}

/// A part of a cell in which a piece matters.
struct Part {
    node: Node,
    /// Whether more than one surface may.
    holds_more: bool,
}

/// What becomes of a cell.
enum Fate {
    Leaf(Leaf),
    Split(Vec<Part>),
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
            let fates: Vec<Fate> = nodes
                .with_min_len(CHUNK)
                .map_init(
                    || Scratch::new(solid),
                    |scratch, node| match control.is_stopped() {
                        true => Fate::Split(Vec::new()),
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
                    Fate::Leaf(leaf) => tree.leaves.push(leaf),
                    Fate::Split(parts) => tree.add(i, parts, size),
                }
            }
            level = first..tree.nodes.len();
        }
        tree
    }

    /// The root alone, if a piece matters in the region at all.
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
        if let Narrowed::Mixed(local) = all.narrow(solid, slack(region), &mut scratch) {
            if longest(&region) <= COARSE * size {
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

    /// Leaves the cells of a level unseen.
    fn skip(&mut self, level: Range<usize>) {
        let cells = self.nodes[level].iter().map(|n| n.cell);
        self.skipped.extend(cells);
    }

    /// Adds the parts of a cell.
    fn add(&mut self, i: usize, parts: Vec<Part>, size: f64) {
        let is_coarse = longest(&self.nodes[i].cell) > COARSE * size;
        self.visited += 8;
        let start = self.nodes.len() as u32;
        for Part { node, holds_more } in parts {
            if is_coarse && (!holds_more || longest(&node.cell) <= COARSE * size) {
                self.coarse.push((node.cell, node.local.clone()));
            }
            if holds_more {
                self.nodes.push(node);
            }
        }
        self.nodes[i].children = start..self.nodes.len() as u32;
        // An inner node all of whose children were dropped holds no feature: it must not look like
        // a leaf.
        if self.nodes[i].children.is_empty() {
            self.nodes[i].local = Local {
                tree: self.nodes[i].local.tree.clone(),
                pieces: [].into(),
            };
        }
    }

    /// The part of the solid that matters at a point; none where no feature can be.
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

/// Whether a point lies in a cell, or on its border.
pub(crate) fn holds(cell: &Aabb, p: Point3) -> bool {
    (0..3).all(|i| cell.lo[i] <= p[i] && p[i] <= cell.hi[i])
}

/// A cell widened by its slack.
pub(crate) fn slack(cell: Aabb) -> Aabb {
    cell.widened(SLACK * longest(&cell))
}

/// The longest side of a cell.
pub(crate) fn longest(cell: &Aabb) -> f64 {
    cell.size().into_iter().fold(0.0, f64::max)
}

/// Halves along all long sides.
pub(crate) fn split(cell: Aabb) -> impl Iterator<Item = Aabb> {
    let (size, center, long) = (cell.size(), cell.center(), LONG * longest(&cell));
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

/// Whether a cell is a leaf: small enough for what surfaces do in it.
fn fate(solid: &dyn Solid, node: &Node, size: f64, scratch: &mut Scratch) -> Fate {
    let side = longest(&node.cell);
    if side > LEAF * size || node.local.pieces.len() < 2 {
        return Fate::Split(parts(solid, node, scratch));
    }
    let levels = (LEAF * size / side).log2().floor() as u32;
    let surfaces = surfaces(solid, &node.local.pieces, node.cell);
    let simple = surfaces
        .iter()
        .all(|i| is_nearly_flat(solid, *i, node.cell));
    let meet = levels < CORNER_LEVELS
        && surfaces.len() > 2
        && directions(solid, &surfaces, node.cell.center()) > 2;
    if surfaces.len() > 1 && (meet || (!simple && levels < CURVED_LEVELS)) {
        return Fate::Split(parts(solid, node, scratch));
    }
    Fate::Leaf(Leaf {
        cell: node.cell,
        local: node.local.clone(),
        surfaces,
        simple,
    })
}

/// The parts of a cell in which a piece matters.
fn parts(solid: &dyn Solid, node: &Node, scratch: &mut Scratch) -> Vec<Part> {
    let mut parts = Vec::new();
    for cell in split(node.cell) {
        if let Narrowed::Mixed(local) = node.local.narrow(solid, slack(cell), scratch) {
            let holds_more =
                local.pieces.len() > 1 && !is_one_function(solid, &local.pieces, cell, scratch);
            let node = Node {
                cell,
                local,
                children: 0..0,
            };
            parts.push(Part { node, holds_more });
        }
    }
    parts
}

/// Whether pieces have equal ranges and equal values in a cell. Away from a blend, the pieces that
/// the blend was distributed over are one function.
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
    let points = PROBES.map(|at| inside(&cell, at));
    let mut values = vec![0.0; pieces.len() * points.len()];
    solid.values(pieces, &points, &mut values);
    let (one, others) = values.split_at(points.len());
    others.chunks(points.len()).all(|v| v == one)
}

/// How many different normals the surfaces have at a point.
fn directions(solid: &dyn Solid, surfaces: &[u32], p: Point3) -> usize {
    let mut found: Vec<Point3> = Vec::with_capacity(surfaces.len());
    for g in surfaces.iter().filter_map(|i| normalised(solid, *i, p)) {
        if found.iter().all(|n| norm(cross(*n, g.n)) > PARALLEL) {
            found.push(g.n);
        }
    }
    found.len()
}

/// A point of a cell, from its own coordinates.
pub(crate) fn inside(cell: &Aabb, at: Point3) -> Point3 {
    let (center, size) = (cell.center(), cell.size());
    std::array::from_fn(|i| center[i] + 0.5 * at[i] * size[i])
}

/// Whether a piece's normals differ little within a cell.
fn is_nearly_flat(solid: &dyn Solid, piece: u32, cell: Aabb) -> bool {
    let Some(here) = normalised(solid, piece, cell.center()) else {
        return false;
    };
    PROBES.iter().all(|at| {
        normalised(solid, piece, inside(&cell, *at))
            .is_some_and(|there| dot(here.n, there.n) > TURN)
    })
}

/// One piece for each surface: pieces that coincide at the probes are one surface.
pub(crate) fn surfaces(solid: &dyn Solid, pieces: &[u32], cell: Aabb) -> Vec<u32> {
    let center = cell.center();
    let points = PROBES.map(|at| inside(&cell, at));
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
                norm(cross(a, b)) < DIFFERENT && coincide(solid, other.0, piece, cell)
            }
            _ => false,
        };
        if !found.iter().any(is_same) {
            found.push((piece, n));
        }
    }
    found.into_iter().map(|(i, _)| i).collect()
}

/// Whether one piece vanishes where another one does, at all probes.
fn coincide(solid: &dyn Solid, a: u32, b: u32, cell: Aabb) -> bool {
    let side = longest(&cell);
    let coordinates = cell.lo.into_iter().chain(cell.hi);
    let far = ROUNDING[0] * coordinates.fold(0.0, |m: f64, v| m.max(v.abs()));
    PROBES.iter().all(|at| {
        let q = onto_one(solid, a, inside(&cell, *at), 2.0 * side);
        q.and_then(|q| normalised(solid, b, q))
            .is_some_and(|g| g.d.abs() <= SAME * side + ROUNDING[1] * far)
    })
}
