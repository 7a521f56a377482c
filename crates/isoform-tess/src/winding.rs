//! Winding of the triangles: neighbours on one sheet traverse their common edge in opposite
//! directions.
//!
//! Which triangles are neighbours is determined by the parameters: where sheets cross, an edge has
//! four triangles, two of each sheet. A piece is a set of triangles that are connected by
//! neighbours. Relative turns of its triangles are determined by the edges of a spanning tree,
//! edges inside the parameter plane first. Either all other edges agree with them, or the piece
//! contains a Möbius band; edges that disagree form the cut.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Curve on the surface to which a cut belongs, in the order in which edges enter the spanning
/// tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CutCurve {
    /// A curve of finite parameters.
    Finite,
    /// The line at infinity of the parameters.
    Infinite,
    /// The curve to which a base point is blown up.
    Seam,
    /// The border of the fundamental domain of deck transformations.
    FundamentalDomain,
    /// A side shared by patches.
    Sides,
}

impl fmt::Display for CutCurve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Finite => "finite parameters",
            Self::Infinite => "infinite parameters (w = 0)",
            Self::Seam => "the seam of a base point",
            Self::FundamentalDomain => "the border of the fundamental domain",
            Self::Sides => "a side of patches",
        })
    }
}

/// An edge of the cut: its neighbours traverse it in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CutEdge {
    /// Vertices of the edge, the smaller index first.
    pub vertices: [u32; 2],
    /// Curve to which the edge belongs.
    pub along: CutCurve,
}

/// The winding of the triangles of a surface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Winding {
    /// Number of pieces: sets of triangles that are connected by neighbours on one sheet.
    pub pieces: usize,
    /// Number of pieces whose triangles are turned outward: those whose enclosed volume has one
    /// sign as seen from every point of the box around them. Other orientable pieces are oriented
    /// by the parameters, with the normal ∂φ/∂s × ∂φ/∂t.
    pub outward: usize,
    /// Number of pieces that contain a Möbius band.
    pub unorientable: usize,
    /// Edges that neighbours traverse in one direction.
    pub cut: Vec<CutEdge>,
}

impl Winding {
    /// Returns true if all pieces are orientable.
    pub fn is_orientable(&self) -> bool {
        self.unorientable == 0
    }
    /// Returns the cut as polylines, grouped by the curves to which they belong.
    pub fn cut_lines(&self) -> Vec<(CutCurve, Vec<Vec<u32>>)> {
        let mut by_curve: BTreeMap<CutCurve, BTreeSet<[u32; 2]>> = BTreeMap::new();
        for edge in &self.cut {
            by_curve
                .entry(edge.along)
                .or_default()
                .insert(edge.vertices);
        }
        let lines = |(along, edges)| (along, polylines(&edges));
        by_curve.into_iter().map(lines).collect()
    }
    /// Renumbers the vertices of the cut; edges at removed vertices are dropped.
    pub(crate) fn renumber(&mut self, mut new: impl FnMut(u32) -> Option<u32>) {
        let mut edge = |e: &CutEdge| {
            let [a, b] = e.vertices;
            Some(CutEdge {
                vertices: sorted([new(a)?, new(b)?]),
                ..*e
            })
        };
        self.cut = self.cut.iter().filter_map(&mut edge).collect();
    }
    /// Moves a vertex onto a neighbour. Two edges of a triangle between them become one, which is
    /// cut if exactly one of them was.
    pub(crate) fn contract(&mut self, from: u32, to: u32) {
        let is_moved = |e: &CutEdge| e.vertices.contains(&from);
        let (moved, mut cut): (Vec<_>, Vec<_>) = self.cut.iter().copied().partition(is_moved);
        for edge in moved {
            let other = edge.vertices[usize::from(edge.vertices[0] == from)];
            let vertices = sorted([other, to]);
            match cut.iter().position(|e| e.vertices == vertices) {
                Some(k) => drop(cut.remove(k)),
                None if other != to => cut.push(CutEdge { vertices, ..edge }),
                None => {}
            }
        }
        self.cut = cut;
    }
}

/// Returns the vertices of an edge, the smaller index first.
pub(crate) fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Joins edges to polylines, which end where one edge or more than two meet; a closed polyline has
/// its first vertex repeated at its end.
pub(crate) fn polylines(edges: &BTreeSet<[u32; 2]>) -> Vec<Vec<u32>> {
    let mut around: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for &[a, b] in edges {
        around.entry(a).or_default().insert(b);
        around.entry(b).or_default().insert(a);
    }
    let ends: BTreeSet<u32> = around
        .iter()
        .filter(|(_, next)| next.len() != 2)
        .map(|(v, _)| *v)
        .collect();
    let mut lines = Vec::new();
    let starts: Vec<u32> = ends.iter().chain(around.keys()).copied().collect();
    for start in starts {
        while let Some(mut next) = around[&start].first().copied() {
            let mut line = vec![start];
            loop {
                let last = line[line.len() - 1];
                for (a, b) in [(last, next), (next, last)] {
                    around.entry(a).or_default().remove(&b);
                }
                line.push(next);
                if next == start || ends.contains(&next) {
                    break;
                }
                match around[&next].first() {
                    Some(&after) => next = after,
                    None => break,
                }
            }
            lines.push(line);
        }
    }
    lines
}

/// Two neighbours and their common edge: triangles, or sets of triangles with known relative turns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Neighbours {
    pub(crate) along: CutCurve,
    pub(crate) edge: [u32; 2],
    pub(crate) of: [u32; 2],
    /// True if both traverse the edge in one direction.
    pub(crate) same_way: bool,
}

/// A union-find forest with the turn of each member relative to the smallest one of its set.
struct Turns {
    /// Parent of each member, with true if the two are turned against each other; roots are their
    /// own parents.
    up: Vec<(u32, bool)>,
}

impl Turns {
    fn new(n: usize) -> Self {
        let up = (0..n as u32).map(|k| (k, false)).collect();
        Self { up }
    }
    /// Returns the smallest member of the set, and the turn relative to it.
    fn root(&mut self, mut i: u32) -> (u32, bool) {
        let mut turned = false;
        loop {
            let (next, turn) = self.up[i as usize];
            if next == i {
                return (i, turned);
            }
            let (after, again) = self.up[next as usize];
            // Path halving.
            self.up[i as usize] = (after, turn ^ again);
            turned ^= turn ^ again;
            i = after;
        }
    }
    /// Unites the sets of two members; returns false if they are in one set already with the
    /// opposite turn.
    fn unite(&mut self, [a, b]: [u32; 2], turned: bool) -> bool {
        let ((a, at), (b, bt)) = (self.root(a), self.root(b));
        let turn = at ^ bt ^ turned;
        if a == b {
            return !turn;
        }
        self.up[a.max(b) as usize] = (a.min(b), turn);
        true
    }
}

/// Relative turns of triangles, or of sets of triangles.
pub(crate) struct Relative {
    /// Piece of each triangle or set.
    pub(crate) pieces: Vec<u32>,
    /// True for those that are to be turned.
    pub(crate) turned: Vec<bool>,
    /// True for pieces that are not orientable.
    pub(crate) unorientable: Vec<bool>,
    pub(crate) cut: Vec<CutEdge>,
}

impl Relative {
    /// Computes the turns of a number of triangles, or sets, from their neighbours.
    pub(crate) fn new(count: usize, mut neighbours: Vec<Neighbours>) -> Self {
        neighbours.sort_by_key(|n| (n.along, n.edge, n.of));
        let mut turns = Turns::new(count);
        let mut cut = Vec::new();
        for n in &neighbours {
            if !turns.unite(n.of, n.same_way) {
                cut.push((n.of[0], n));
            }
        }
        let mut numbers = BTreeMap::new();
        let (mut pieces, mut turned) = (Vec::new(), Vec::new());
        for k in 0..count as u32 {
            let (root, turn) = turns.root(k);
            let next = numbers.len() as u32;
            pieces.push(*numbers.entry(root).or_insert(next));
            turned.push(turn);
        }
        let mut unorientable = vec![false; numbers.len()];
        for &(k, _) in &cut {
            unorientable[pieces[k as usize] as usize] = true;
        }
        let edge = |n: &Neighbours| CutEdge {
            vertices: n.edge,
            along: n.along,
        };
        Self {
            pieces,
            turned,
            unorientable,
            cut: cut.iter().map(|c| edge(c.1)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_joined_to_polylines() {
        let edges = BTreeSet::from([[0, 1], [1, 2], [4, 5], [5, 6], [4, 6], [2, 7], [2, 8]]);
        let lines = polylines(&edges);
        let expected: [&[u32]; 4] = [&[0, 1, 2], &[2, 7], &[2, 8], &[4, 5, 6, 4]];
        assert_eq!(lines, expected);
    }
}
