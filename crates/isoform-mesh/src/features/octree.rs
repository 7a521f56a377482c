//! Cells that may hold a feature: where two pieces can be zero and decide the sign.

use super::newton::{normalised, onto_one};
use crate::decide::{Local, Narrowed, Scratch};
use crate::mesher::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm};
use rayon::prelude::*;

/// Cells are widened by this part of their size when they are bounded, so that a feature on a face belongs to the cells on both sides.
const SLACK: f64 = 1e-5;
/// Levels below size/2 for cells in which three surfaces may meet.
const CORNER_LEVELS: u32 = 2;
/// Levels below size/2 for cells in which a surface turns by more than [`TURN`]: features of size/32 are still found.
const CURVED_LEVELS: u32 = 4;
/// Cosine of the angle by which normals may turn within a simple cell, 35 degrees.
const TURN: f64 = 0.82;
/// Where in a cell surfaces are compared, in its own coordinates from −1 to 1: no two on a line with the centre.
pub(crate) const PROBES: [Point3; 4] = [[0.71, 0.37, -0.53], [-0.43, 0.67, 0.59], [0.31, -0.73, 0.41], [-0.61, -0.29, -0.67]];
/// Pieces nearer than this part of a cell at all probes are one surface.
const SAME: f64 = 1e-8;

#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) cell: Aabb,
    pub(crate) local: Local,
    children: std::ops::Range<u32>,
}

/// A cell that is not split any more.
#[derive(Clone, Debug)]
pub(crate) struct Leaf {
    pub(crate) cell: Aabb,
    pub(crate) local: Local,
    /// Pieces of different surfaces; of coinciding ones the first.
    pub(crate) surfaces: Vec<u32>,
    /// Whether the surfaces are nearly flat here: two of them then have one curve in common at most.
    pub(crate) simple: bool,
}

#[derive(Debug)]
pub(crate) struct Octree {
    nodes: Vec<Node>,
    pub(crate) leaves: Vec<Leaf>,
    /// Cells in which a single piece matters.
    pub(crate) singles: Vec<(Aabb, u32)>,
    /// Cells that were not looked at: the budget was spent.
    pub(crate) skipped: Vec<Aabb>,
    pub(crate) visited: usize,
}

enum Fate {
    Drop,
    Single(u32),
    Leaf(Leaf),
    Split(Vec<(Aabb, Narrowed)>),
}

impl Octree {
    pub(crate) fn new(solid: &dyn Solid, region: Aabb, size: f64, budget: usize, control: &Control<'_>) -> Self {
        let mut scratch = Scratch::new(solid);
        let mut tree = Self { nodes: Vec::new(), leaves: Vec::new(), singles: Vec::new(), skipped: Vec::new(), visited: 1 };
        if let Narrowed::Mixed(local) = Local::everywhere(solid).narrow(solid, slack(region), &mut scratch) {
            tree.nodes.push(Node { cell: region, local, children: 0..0 });
        }
        let mut level = 0..tree.nodes.len();
        while !level.is_empty() {
            if tree.visited > budget || control.is_stopped() {
                tree.skipped.extend(tree.nodes[level.clone()].iter().map(|n| n.cell));
                break;
            }
            let fates: Vec<Fate> = tree.nodes[level.clone()]
                .par_iter()
                .with_min_len(32)
                .map_init(|| Scratch::new(solid), |scratch, node| fate(solid, node, size, scratch))
                .collect();
            let first = tree.nodes.len();
            for (i, fate) in level.clone().zip(fates) {
                match fate {
                    Fate::Drop => {}
                    Fate::Single(piece) => tree.singles.push((tree.nodes[i].cell, piece)),
                    Fate::Leaf(leaf) => tree.leaves.push(leaf),
                    Fate::Split(children) => {
                        tree.visited += children.len();
                        let start = tree.nodes.len() as u32;
                        for (cell, narrowed) in children {
                            if let Narrowed::Mixed(local) = narrowed {
                                if local.pieces.len() == 1 {
                                    tree.singles.push((cell, local.pieces[0]));
                                } else {
                                    tree.nodes.push(Node { cell, local, children: 0..0 });
                                }
                            }
                        }
                        tree.nodes[i].children = start..tree.nodes.len() as u32;
                        // An inner node all of whose children were dropped holds no feature: it must not look like a leaf.
                        if tree.nodes[i].children.is_empty() {
                            tree.nodes[i].local = Local { tree: tree.nodes[i].local.tree.clone(), pieces: [].into() };
                        }
                    }
                }
            }
            level = first..tree.nodes.len();
        }
        tree
    }

    /// The part of the solid that matters at a point; none where no feature can be.
    pub(crate) fn at(&self, p: Point3) -> Option<&Local> {
        let mut node = self.nodes.first().filter(|n| holds(&n.cell, p))?;
        while !node.children.is_empty() {
            node = self.nodes[node.children.start as usize..node.children.end as usize].iter().find(|n| holds(&n.cell, p))?;
        }
        (node.local.pieces.len() > 1).then_some(&node.local)
    }
}

pub(crate) fn holds(cell: &Aabb, p: Point3) -> bool {
    (0..3).all(|i| cell.lo[i] <= p[i] && p[i] <= cell.hi[i])
}

pub(crate) fn slack(cell: Aabb) -> Aabb {
    let by = SLACK * longest(&cell);
    Aabb { lo: cell.lo.map(|v| v - by), hi: cell.hi.map(|v| v + by) }
}

pub(crate) fn longest(cell: &Aabb) -> f64 {
    cell.size().into_iter().fold(0.0, f64::max)
}

/// Halves along all long sides.
pub(crate) fn split(cell: Aabb) -> impl Iterator<Item = Aabb> {
    let (size, center, long) = (cell.size(), cell.center(), 0.6 * longest(&cell));
    let cut: [bool; 3] = std::array::from_fn(|i| size[i] > long);
    (0..8usize).filter(move |k| (0..3).all(|i| cut[i] || k >> i & 1 == 0)).map(move |k| {
        let mut part = cell;
        for i in 0..3 {
            if cut[i] {
                *(if k >> i & 1 == 0 { &mut part.hi[i] } else { &mut part.lo[i] }) = center[i];
            }
        }
        part
    })
}

fn fate(solid: &dyn Solid, node: &Node, size: f64, scratch: &mut Scratch) -> Fate {
    let side = longest(&node.cell);
    match &node.local.pieces[..] {
        [] => return Fate::Drop,
        [one] => return Fate::Single(*one),
        _ => {}
    }
    let mut children = || {
        let parts = split(node.cell).map(|cell| (cell, node.local.narrow(solid, slack(cell), scratch)));
        Fate::Split(parts.collect())
    };
    if side > 0.5 * size {
        return children();
    }
    let levels = (0.5 * size / side).log2().floor() as u32;
    let surfaces = surfaces(solid, &node.local.pieces, node.cell);
    let simple = surfaces.iter().all(|i| is_nearly_flat(solid, *i, node.cell));
    if surfaces.len() > 1 && ((surfaces.len() > 2 && levels < CORNER_LEVELS) || (!simple && levels < CURVED_LEVELS)) {
        return children();
    }
    Fate::Leaf(Leaf { cell: node.cell, local: node.local.clone(), surfaces, simple })
}

/// A point of a cell, from its own coordinates.
pub(crate) fn inside(cell: &Aabb, at: Point3) -> Point3 {
    let (center, size) = (cell.center(), cell.size());
    std::array::from_fn(|i| center[i] + 0.5 * at[i] * size[i])
}

fn is_nearly_flat(solid: &dyn Solid, piece: u32, cell: Aabb) -> bool {
    let Some(here) = normalised(solid, piece, cell.center()) else { return false };
    PROBES.iter().all(|at| normalised(solid, piece, inside(&cell, *at)).is_some_and(|there| dot(here.n, there.n) > TURN))
}

/// One piece for each surface: those that coincide at the probes are one.
pub(crate) fn surfaces(solid: &dyn Solid, pieces: &[u32], cell: Aabb) -> Vec<u32> {
    let center = cell.center();
    let mut found: Vec<(u32, Option<Point3>)> = Vec::with_capacity(pieces.len());
    for piece in pieces {
        let n = normalised(solid, *piece, center).map(|g| g.n);
        let same = |other: &(u32, Option<Point3>)| match (n, other.1) {
            (Some(a), Some(b)) => norm(cross(a, b)) < 0.3 && coincide(solid, other.0, *piece, cell),
            _ => false,
        };
        if !found.iter().any(same) {
            found.push((*piece, n));
        }
    }
    found.into_iter().map(|(i, _)| i).collect()
}

fn coincide(solid: &dyn Solid, a: u32, b: u32, cell: Aabb) -> bool {
    let side = longest(&cell);
    let far = 1e-15 * cell.lo.into_iter().chain(cell.hi).fold(0.0, |m: f64, v| m.max(v.abs()));
    PROBES.iter().all(|at| {
        let q = onto_one(solid, a, inside(&cell, *at), 2.0 * side);
        q.and_then(|q| normalised(solid, b, q)).is_some_and(|g| g.d.abs() <= SAME * side + 64.0 * far)
    })
}
