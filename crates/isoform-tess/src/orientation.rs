//! Orientation of a surface: its triangles are turned by their relative turns, and each piece as a
//! whole outward, or by the orientation of the parameters.

use crate::finding::Finding;
use crate::surface::{Point3, Surface};
use crate::winding::{Relative, Winding, sorted};
use isoform_algebra::QUADRANTS;
use isoform_geom::{Aabb, cross, norm, sub};
use std::collections::BTreeMap;

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
    /// or is not known because of rounding and, with a border, the distance of the triangles from
    /// the surface: closed triangles enclose a volume of their own.
    fn sign(&self, tolerance: f64) -> f64 {
        let half = |k: usize| 0.5 * self.bounds.size()[k];
        let change: f64 = (0..3).map(|k| half(k) * self.area[k].abs()).sum();
        // Each term has the rounding error of a few operations, and the sum that of all terms
        // before it.
        let rounding = |size: f64| (self.terms + 16.0) * f64::EPSILON * size;
        let is_closed = change <= rounding(self.bounds.diagonal() * self.whole);
        let distance = if is_closed { 0.0 } else { tolerance };
        let error = rounding(self.size) + 3.0 * distance * self.whole;
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
    use crate::winding::{CutCurve, Neighbours};

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
        surface_within(0.0, points, triangles)
    }
    fn surface_within(tolerance: f64, points: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Surface {
        let (n, count) = (points.len(), triangles.len());
        let mut s = Surface {
            double: vec![false; n],
            charts: vec![0; count],
            corners: vec![[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]; count],
            borders: vec![[0; 3]; count],
            tolerance,
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

    /// An octahedron far from the origin, with any of its triangles turned, has the volume 4/3,
    /// however coarse it may be.
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
            let triangles: Vec<[u32; 3]> = all.iter().enumerate().map(turn).collect();
            for tolerance in [0.0, 9.0] {
                let s = surface_within(tolerance, Vec::clone(&points), triangles.clone());
                assert!((volume(&s) - 4.0 / 3.0).abs() < 1e-12, "{turned}");
                assert_eq!((s.winding.pieces, s.winding.outward), (1, 1));
                assert!(s.winding.is_orientable() && s.findings.is_empty());
            }
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
}
