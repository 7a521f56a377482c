//! Winding of the triangles: neighbours on one sheet traverse their common edge in opposite
//! directions.
//!
//! Which triangles are neighbours is determined by the parameters: where sheets cross, an edge has
//! four triangles, two of each sheet. A piece is a set of triangles that are connected by
//! neighbours. Relative turns of its triangles are determined by the edges of a spanning tree,
//! edges inside the parameter plane first. Either all other edges agree with them, or the piece
//! contains a Möbius band; edges that disagree form the cut.

use crate::finding::Finding;
use crate::surface::{Point3, Surface};
use isoform_algebra::QUADRANTS;
use isoform_geom::{Aabb, cross, norm, sub};
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
    /// True if all pieces are orientable.
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

/// Twice the vector area, six times the volume as seen from the centre of the box, and the box of a
/// piece.
struct Extent {
    bounds: Aabb,
    area: Point3,
    volume: f64,
    /// Sum of the absolute values of the terms of the volume.
    size: f64,
    terms: f64,
    /// Twice the area.
    whole: f64,
}

impl Extent {
    const NONE: Self = Self {
        bounds: Aabb::EMPTY,
        area: [0.0; 3],
        volume: 0.0,
        size: 0.0,
        terms: 0.0,
        whole: 0.0,
    };
    fn add(&mut self, corners: [Point3; 3]) {
        let center = self.bounds.center();
        let [p, q, r] = corners.map(|x| sub(x, center));
        let n = cross(sub(q, p), sub(r, p));
        self.whole += norm(n);
        for k in 0..3 {
            self.area[k] += n[k];
            self.volume += p[k] * n[k];
            self.size += (p[k] * n[k]).abs();
            self.terms += 1.0;
        }
    }
    /// Returns 1 or −1 if the volume has this sign as seen from every point of the box, or is zero
    /// as from the apex of a cone; the volume is affine in the point. Returns 0 if its sign varies,
    /// or is not known because of rounding and the distance of the triangles from the surface.
    fn sign(&self, tolerance: f64) -> f64 {
        let half = |k: usize| 0.5 * self.bounds.size()[k];
        let change: f64 = (0..3).map(|k| half(k) * self.area[k].abs()).sum();
        // Each term has the rounding error of a few operations, and the sum that of all terms
        // before it.
        let rounding = (self.terms + 16.0) * f64::EPSILON * self.size;
        let error = rounding + 3.0 * tolerance * self.whole;
        let size = self.volume.abs();
        if size > error && size + error >= change {
            self.volume.signum()
        } else {
            0.0
        }
    }
}

impl Surface {
    /// Turns triangles by their relative turns, and each piece as a whole: outward if its volume
    /// has one sign, else by the orientation of the parameters.
    pub(crate) fn wind(&mut self, relative: &Relative) {
        let pieces = relative.unorientable.len();
        let mut extents: Vec<Extent> = (0..pieces).map(|_| Extent::NONE).collect();
        let mut signs = vec![0.0; pieces];
        let corners = |s: &Self, k: usize| s.triangles[k].map(|v| s.points[v as usize]);
        let triangles = 0..self.triangles.len();
        for k in triangles.clone() {
            if relative.turned[k] {
                self.turn(k);
            }
            let piece = relative.pieces[k] as usize;
            for p in corners(self, k) {
                extents[piece].bounds.add(p);
            }
            if signs[piece] == 0.0 {
                signs[piece] = self.area_of_parameters(k);
            }
        }
        for k in triangles.clone() {
            extents[relative.pieces[k] as usize].add(corners(self, k));
        }
        self.winding = Winding {
            pieces: 0,
            unorientable: relative.unorientable.iter().filter(|u| **u).count(),
            cut: relative.cut.clone(),
            outward: 0,
        };
        for piece in (0..pieces).filter(|&p| !relative.unorientable[p]) {
            let sign = extents[piece].sign(self.tolerance);
            if sign != 0.0 {
                signs[piece] = sign;
                self.winding.outward += 1;
            }
        }
        for k in triangles {
            if signs[relative.pieces[k] as usize] < 0.0 {
                self.turn(k);
            }
        }
        self.pieces.clone_from(&relative.pieces);
        self.count_pieces();
    }
    /// Renumbers the pieces that still have triangles.
    pub(crate) fn count_pieces(&mut self) {
        let mut numbers = BTreeMap::new();
        for piece in &mut self.pieces {
            let next = numbers.len() as u32;
            *piece = *numbers.entry(*piece).or_insert(next);
        }
        self.winding.pieces = numbers.len();
    }
    /// Returns twice the area of a triangle in the plane of (s, t), times a positive number.
    fn area_of_parameters(&self, triangle: usize) -> f64 {
        let [p, q, r] = self.corners[triangle];
        let [s, t] = QUADRANTS[usize::from(self.charts[triangle])];
        let area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        area * (s * t) as f64
    }
    /// Reverses the orientation of a triangle.
    fn turn(&mut self, k: usize) {
        self.triangles[k].swap(1, 2);
        self.corners[k].swap(1, 2);
        self.borders[k].swap(1, 2);
    }
    /// Returns the edges with their triangles, each with true if it traverses the edge from the
    /// smaller vertex to the larger.
    pub(crate) fn uses(&self) -> BTreeMap<[u32; 2], Vec<(u32, bool)>> {
        let mut uses: BTreeMap<[u32; 2], Vec<(u32, bool)>> = BTreeMap::new();
        for (k, t) in self.triangles.iter().enumerate() {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let of_edge = uses.entry(sorted([a, b])).or_default();
                of_edge.push((k as u32, a < b));
            }
        }
        uses
    }
    /// Counts the edges that contradict the winding: edges of two triangles, and of sheets that
    /// cross, have to be traversed equally often in both directions, except on the cut.
    pub(crate) fn check_winding(&mut self) {
        let mut cut: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for edge in &self.winding.cut {
            *cut.entry(edge.vertices).or_default() += 1;
        }
        let is_wrong = |(edge, uses): &(&[u32; 2], &Vec<(u32, bool)>)| {
            let there = uses.iter().filter(|u| u.1).count();
            let more = there.abs_diff(uses.len() - there);
            let cuts = cut.get(*edge).copied().unwrap_or(0);
            // Each cut pair has two more triangles in one direction than in the other.
            match uses.len() {
                2 => more != 2 * (cuts % 2),
                n if n % 2 == 0 && self.is_double(edge) => {
                    more > 2 * cuts || more / 2 % 2 != cuts % 2
                }
                _ => false,
            }
        };
        let wrong = self.uses().iter().filter(is_wrong).count();
        if wrong > 0 {
            self.findings.push(Finding::Winding(wrong));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the neighbours at every edge of two triangles.
    fn neighbours(s: &Surface) -> Vec<Neighbours> {
        let uses = s.uses();
        let two = uses.iter().filter(|(_, u)| u.len() == 2);
        two.map(|(&edge, u)| Neighbours {
            along: CutCurve::Finite,
            edge,
            of: [u[0].0, u[1].0],
            same_way: u[0].1 == u[1].1,
        })
        .collect()
    }
    fn surface(points: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Surface {
        let (n, count) = (points.len(), triangles.len());
        let mut s = Surface {
            double: vec![false; n],
            charts: vec![0; count],
            corners: vec![[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]; count],
            borders: vec![[0; 3]; count],
            points,
            triangles,
            ..Surface::default()
        };
        let relative = Relative::new(count, neighbours(&s));
        s.wind(&relative);
        s.check_winding();
        s
    }
    fn volume(s: &Surface) -> f64 {
        let corners = |t: &[u32; 3]| t.map(|v| s.points[v as usize]);
        let six = |[p, q, r]: [Point3; 3]| isoform_geom::dot(p, cross(q, r));
        s.triangles.iter().map(|t| six(corners(t)) / 6.0).sum()
    }

    /// An octahedron far from the origin, with any of its triangles turned, has the volume 4/3.
    #[test]
    fn closed_pieces_are_turned_outward() {
        let at = |k: usize, x: f64| {
            let mut p = [7.0, -9.0, 11.0];
            p[k] += x;
            p
        };
        let points = (0..6).map(|k| at(k / 2, [1.0, -1.0][k % 2])).collect();
        let all: Vec<[u32; 3]> = (0..8)
            .map(|k| [k & 1, 2 + (k >> 1 & 1), 4 + (k >> 2)])
            .collect();
        for turned in [0usize, 1, 37, 90, 165, 255] {
            let turn = |(k, t): (usize, &[u32; 3])| match turned >> k & 1 {
                0 => *t,
                _ => [t[0], t[2], t[1]],
            };
            let triangles = all.iter().enumerate().map(turn).collect();
            let s: Surface = surface(Vec::clone(&points), triangles);
            assert!((volume(&s) - 4.0 / 3.0).abs() < 1e-12, "{turned}");
            assert_eq!((s.winding.pieces, s.winding.outward), (1, 1));
            assert!(s.winding.is_orientable() && s.findings.is_empty());
        }
    }

    /// Möbius's band of five triangles has one cut edge, and the projective plane of six vertices a
    /// closed cut; a triangle turned afterwards is found.
    #[test]
    fn bands_with_a_twist_have_a_cut() {
        let flat = |n: u32| (0..n).map(|k| [f64::from(k), 0.0, 0.0]).collect::<Vec<_>>();
        let band: Vec<[u32; 3]> = (0..5).map(|k| [k, (k + 1) % 5, (k + 2) % 5]).collect();
        let mut s = surface(flat(5), band);
        assert!(s.findings.is_empty(), "{:?}", s.findings);
        assert_eq!((s.winding.unorientable, s.winding.cut.len()), (1, 1));
        s.turn(0);
        s.check_winding();
        assert!(matches!(s.findings[..], [Finding::Winding(_)]));
        // Five triangles around a vertex, and five more between opposite edges.
        let mut plane: Vec<[u32; 3]> = (0..5).map(|k| [5, k, (k + 1) % 5]).collect();
        plane.extend((0..5).map(|k| [k, (k + 1) % 5, (k + 3) % 5]));
        let s = surface(flat(6), plane);
        assert!(s.findings.is_empty(), "{:?}", s.findings);
        assert_eq!(s.winding.unorientable, 1);
        let lines = s.winding.cut_lines();
        assert!(
            lines
                .iter()
                .flat_map(|l| &l.1)
                .all(|l| l.first() == l.last())
        );
    }

    /// A square is oriented by the parameters; a bowl outward, as seen from all of its box.
    #[test]
    fn open_pieces_have_a_side_or_follow_the_parameters() {
        // The graph z = c (x² + y²) on rings of radii 1 and 2 around the origin.
        let paraboloid = |c: f64| {
            let ring = |r: f64| [[r, 0.0], [0.0, r], [-r, 0.0], [0.0, -r]];
            let all = [[0.0; 2]].into_iter().chain(ring(1.0)).chain(ring(2.0));
            all.map(|[x, y]| [x, y, c * (x * x + y * y)]).collect()
        };
        let around = |k: u32| {
            let [a, b] = [k, k % 4 + 1];
            [[0, a, b], [a, a + 4, b], [b, a + 4, b + 4]]
        };
        let upward: Vec<[u32; 3]> = (1..=4).flat_map(around).collect();
        let flat = surface(paraboloid(0.0), upward.clone());
        assert_eq!((flat.winding.outward, &flat.triangles), (0, &upward));
        let bowl = surface(paraboloid(1.0), upward.clone());
        let downward: Vec<[u32; 3]> = upward.iter().map(|t| [t[0], t[2], t[1]]).collect();
        assert_eq!((bowl.winding.outward, bowl.triangles), (1, downward));
    }

    #[test]
    fn edges_are_joined_to_polylines() {
        let edges = BTreeSet::from([[0, 1], [1, 2], [4, 5], [5, 6], [4, 6], [2, 7], [2, 8]]);
        let lines = polylines(&edges);
        let expected: [&[u32]; 4] = [&[0, 1, 2], &[2, 7], &[2, 8], &[4, 5, 6, 4]];
        assert_eq!(lines, expected);
    }
}
