//! Faces, chains of edges and loops of a labelled closed mesh.
//!
//! A *border* is an edge of the mesh between triangles of different labels. Triangles that are
//! connected without crossing a border are a face. A *junction* is a node where the number of
//! borders is not two, or that is declared one; between junctions borders form *chains*, each with
//! one face on its left and one on its right. A chain without a junction is divided into two.

use crate::BrepError;
use isoform_geom::{Point3, UnionFind, distance_squared};
use std::collections::BTreeSet;

/// A triangle and the index of one of its sides: side k runs from corner k to corner k + 1.
pub(crate) type TriangleSide = (u32, u8);

/// Returns the side of the other triangle, by triangle and side.
pub(crate) fn across_sides(triangles: &[[u32; 3]]) -> Result<Vec<[TriangleSide; 3]>, BrepError> {
    let mut sides: Vec<([u32; 2], bool, TriangleSide)> = Vec::with_capacity(3 * triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3u8 {
            let [a, b] = ends_of(corners, k);
            sides.push(([a.min(b), a.max(b)], a < b, (t as u32, k)));
        }
    }
    sides.sort_unstable();
    let mut across = vec![[(0, 0); 3]; triangles.len()];
    for same in sides.chunk_by(|a, b| a.0 == b.0) {
        let [a, b] = same else {
            return Err(BrepError::NotClosed);
        };
        if a.1 == b.1 {
            return Err(BrepError::NotClosed);
        }
        across[a.2.0 as usize][a.2.1 as usize] = b.2;
        across[b.2.0 as usize][b.2.1 as usize] = a.2;
    }
    Ok(across)
}

/// Returns the nodes from which and to which a side runs.
pub(crate) fn ends_of(corners: &[u32; 3], k: u8) -> [u32; 2] {
    [corners[k as usize], corners[(k as usize + 1) % 3]]
}

/// Returns the length of the longest side of triangles.
pub(crate) fn longest_side(triangles: impl Iterator<Item = [Point3; 3]>) -> f64 {
    let squares = triangles.flat_map(|[a, b, c]| {
        let sides = [(a, b), (b, c), (c, a)];
        sides.map(|(p, q)| distance_squared(p, q))
    });
    squares.fold(0.0, f64::max).sqrt()
}

/// Returns the sides of some triangles.
pub(crate) fn sides_of(triangles: &[[u32; 3]], own: &[u32]) -> Vec<[u32; 2]> {
    let corners = own.iter().map(|t| &triangles[*t as usize]);
    corners
        .flat_map(|c| (0..3).map(move |k| ends_of(c, k)))
        .collect()
}

/// Returns the indices of the components of triangles that are connected across sides where
/// `is_open`, and their number.
pub(crate) fn components(
    across: &[[TriangleSide; 3]],
    is_open: impl Fn(u32, u32) -> bool,
) -> (Vec<u32>, usize) {
    let mut sets = UnionFind::new(across.len());
    for (t, others) in across.iter().enumerate() {
        for (other, _) in others {
            if is_open(t as u32, *other) {
                sets.unite(t as u32, *other);
            }
        }
    }
    let mut number = vec![u32::MAX; across.len()];
    let mut count = 0;
    let of = (0..across.len() as u32)
        .map(|t| {
            let root = sets.root(t) as usize;
            if number[root] == u32::MAX {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect();
    (of, count as usize)
}

/// Borders between two junctions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct BorderChain {
    /// Nodes from junction to junction.
    pub(crate) nodes: Vec<u32>,
    /// Sides along it, of the face on its left.
    pub(crate) sides: Vec<TriangleSide>,
    /// Faces on its left and on its right.
    pub(crate) faces: [u32; 2],
}

/// Faces, chains and loops.
#[derive(Debug, Default)]
pub(crate) struct Topology {
    /// Face of each triangle.
    pub(crate) face_of: Vec<u32>,
    /// Number of faces.
    pub(crate) faces: usize,
    /// Chains of borders.
    pub(crate) chains: Vec<BorderChain>,
    /// Loops by face: chains, each with true if it is passed forward.
    pub(crate) loops: Vec<Vec<Vec<(u32, bool)>>>,
}

impl Topology {
    /// Builds the topology of triangles with labels; `junctions` are nodes declared to be
    /// junctions.
    pub(crate) fn new(
        points: &[Point3],
        triangles: &[[u32; 3]],
        across: &[[TriangleSide; 3]],
        is_border: impl Fn(u32, u32) -> bool,
        junctions: &BTreeSet<u32>,
    ) -> Self {
        let (face_of, faces) = components(across, |a, b| !is_border(a, b));
        let mut walk = BorderWalk {
            points,
            triangles,
            across,
            face_of: &face_of,
            borders: vec![Vec::new(); points.len()],
            chain_of: vec![[None; 3]; triangles.len()],
            chains: Vec::new(),
        };
        walk.find_borders(&is_border);
        walk.chain_up(junctions);
        let loops = walk.loops(faces);
        Self {
            chains: walk.chains,
            loops,
            face_of,
            faces,
        }
    }
}

/// State of following borders.
struct BorderWalk<'a> {
    points: &'a [Point3],
    triangles: &'a [[u32; 3]],
    across: &'a [[TriangleSide; 3]],
    face_of: &'a [u32],
    /// Sides on borders that leave each node.
    borders: Vec<Vec<TriangleSide>>,
    /// Chain of each side on a border, true if the side runs along it, and its position in it.
    chain_of: Vec<[Option<(u32, bool, usize)>; 3]>,
    chains: Vec<BorderChain>,
}

impl BorderWalk<'_> {
    fn find_borders(&mut self, is_border: &impl Fn(u32, u32) -> bool) {
        for (t, others) in self.across.iter().enumerate() {
            for k in 0..3u8 {
                if is_border(t as u32, others[k as usize].0) {
                    let from = ends_of(&self.triangles[t], k)[0];
                    self.borders[from as usize].push((t as u32, k));
                }
            }
        }
    }

    fn to(&self, (t, k): TriangleSide) -> u32 {
        ends_of(&self.triangles[t as usize], k)[1]
    }

    fn opposite(&self, (t, k): TriangleSide) -> TriangleSide {
        self.across[t as usize][k as usize]
    }

    /// Makes chains from all junctions, then of closed borders without one.
    fn chain_up(&mut self, declared: &BTreeSet<u32>) {
        let mut is_junction: Vec<bool> = self
            .borders
            .iter()
            .enumerate()
            .map(|(v, b)| !b.is_empty() && (b.len() != 2 || declared.contains(&(v as u32))))
            .collect();
        for v in 0..self.borders.len() {
            if is_junction[v] {
                self.chains_from(v, &is_junction);
            }
        }
        for v in 0..self.borders.len() {
            let Some(&first) = self.borders[v].first() else {
                continue;
            };
            if self.chain_of[first.0 as usize][first.1 as usize].is_none() {
                let far = self.farthest_along(v as u32, first);
                is_junction[v] = true;
                is_junction[far as usize] = true;
                self.chains_from(v, &is_junction);
                self.chains_from(far as usize, &is_junction);
            }
        }
    }

    /// Returns the node of a closed chain that is farthest from its first.
    fn farthest_along(&self, start: u32, first: TriangleSide) -> u32 {
        let from = self.points[start as usize];
        let (mut best, mut side) = ((0.0, start), first);
        loop {
            let v = self.to(side);
            if v == start {
                return best.1;
            }
            let d = distance_squared(from, self.points[v as usize]);
            if d > best.0 {
                best = (d, v);
            }
            side = self.next_of(side);
        }
    }

    /// Returns the side that continues from the end of one at which only two borders meet.
    fn next_of(&self, side: TriangleSide) -> TriangleSide {
        let back = self.opposite(side);
        let leaving = &self.borders[self.to(side) as usize];
        let on = leaving.iter().find(|s| **s != back);
        *on.expect("two borders leave a node that is no junction")
    }

    fn chains_from(&mut self, v: usize, is_junction: &[bool]) {
        for first in self.borders[v].clone() {
            if self.chain_of[first.0 as usize][first.1 as usize].is_some() {
                continue;
            }
            let (mut sides, mut nodes) = (vec![first], vec![v as u32, self.to(first)]);
            while let Some(&last) = nodes.last()
                && !is_junction[last as usize]
            {
                let next = self.next_of(sides[sides.len() - 1]);
                sides.push(next);
                nodes.push(self.to(next));
            }
            self.add(nodes, sides);
        }
    }

    fn add(&mut self, nodes: Vec<u32>, sides: Vec<TriangleSide>) {
        let chain = self.chains.len() as u32;
        let back = self.opposite(sides[0]);
        for (i, &(t, k)) in sides.iter().enumerate() {
            self.chain_of[t as usize][k as usize] = Some((chain, true, i));
            let (t, k) = self.opposite((t, k));
            self.chain_of[t as usize][k as usize] = Some((chain, false, i));
        }
        let faces = [sides[0], back].map(|(t, _)| self.face_of[t as usize]);
        self.chains.push(BorderChain {
            nodes,
            sides,
            faces,
        });
    }

    /// Returns the next side on the border of a face.
    fn around(&self, (t, k): TriangleSide) -> TriangleSide {
        let mut side = (t, (k + 1) % 3);
        while self.chain_of[side.0 as usize][side.1 as usize].is_none() {
            let (t, k) = self.opposite(side);
            side = (t, (k + 1) % 3);
        }
        side
    }

    fn loops(&self, faces: usize) -> Vec<Vec<Vec<(u32, bool)>>> {
        let mut loops = vec![Vec::new(); faces];
        let mut done = vec![[false; 3]; self.triangles.len()];
        for t in 0..self.triangles.len() as u32 {
            for k in 0..3u8 {
                let is_new = |s: TriangleSide| !done[s.0 as usize][s.1 as usize];
                if !self.begins_chain((t, k)) || !is_new((t, k)) {
                    continue;
                }
                let mut around = Vec::new();
                let mut side = (t, k);
                while !done[side.0 as usize][side.1 as usize] {
                    done[side.0 as usize][side.1 as usize] = true;
                    if self.begins_chain(side)
                        && let Some((chain, forward, _)) =
                            self.chain_of[side.0 as usize][side.1 as usize]
                    {
                        around.push((chain, forward));
                    }
                    side = self.around(side);
                }
                loops[self.face_of[t as usize] as usize].push(around);
            }
        }
        loops
    }

    /// Returns true if a side is the first of its chain in a loop.
    fn begins_chain(&self, (t, k): TriangleSide) -> bool {
        match self.chain_of[t as usize][k as usize] {
            Some((_, true, i)) => i == 0,
            Some((chain, false, i)) => i + 1 == self.chains[chain as usize].sides.len(),
            None => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an octahedron, the two halves of which have a label each.
    fn octahedron() -> (Vec<Point3>, Vec<[u32; 3]>) {
        let points = vec![
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ];
        let ring = |k: u32| (k, (k + 1) % 4);
        let up = (0..4).map(|k| [ring(k).0, ring(k).1, 4]);
        let down = (0..4).map(|k| [ring(k).1, ring(k).0, 5]);
        (points, up.chain(down).collect())
    }

    #[test]
    fn a_ring_without_a_junction_becomes_two_chains() {
        let (points, triangles) = octahedron();
        let across = across_sides(&triangles).expect("closed");
        let label = |t: u32| t / 4;
        let is_border = |a: u32, b: u32| label(a) != label(b);
        let made = Topology::new(&points, &triangles, &across, is_border, &BTreeSet::new());
        assert_eq!((made.faces, made.chains.len()), (2, 2));
        assert_eq!(made.chains[0].nodes, [0, 1, 2]);
        for loops in &made.loops {
            assert_eq!(loops.iter().map(Vec::len).collect::<Vec<_>>(), [2]);
        }
        // Each chain is passed once in each direction.
        let mut uses: Vec<(u32, bool)> = made.loops.concat().concat();
        uses.sort_unstable();
        assert_eq!(uses, [(0, false), (0, true), (1, false), (1, true)]);
    }

    #[test]
    fn a_face_that_meets_itself_in_a_node_keeps_two_loops_apart() {
        // Opposite triangles of the upper half against all others: they meet in node 4 only.
        let (points, triangles) = octahedron();
        let across = across_sides(&triangles).expect("closed");
        let label = |t: u32| u32::from(t == 0 || t == 2);
        let is_border = |a: u32, b: u32| label(a) != label(b);
        let made = Topology::new(&points, &triangles, &across, is_border, &BTreeSet::new());
        assert_eq!(made.faces, 3);
        let sizes: Vec<usize> = made.loops.iter().map(Vec::len).collect();
        assert_eq!(sizes, [1, 1, 1]);
    }

    #[test]
    fn an_open_mesh_is_refused() {
        let (_, triangles) = octahedron();
        assert!(across_sides(&triangles[1..]).is_err());
    }
}
