//! Edges near points of the surface, and the curvature of its faces there.
//!
//! An edge is the curve in which two pieces intersect such that the tree, for all combinations of
//! their signs with the other signs kept, is inside in one sector (convex) or in three (concave).
//! The Laplacian of the distance from a face is the divergence of its unit normal, computed by
//! differences along the surface.

use super::finder::FootFinder;
use super::search::{FootSearch, MAX_DISTANCE_RATIO, first_order};
use crate::block::LANES;
use isoform_geom::{Edge, Foot, Nearby, Point3, cross, distance_squared, dot, norm};

/// Maximum number of pieces near a point whose signs are combined, one bit of a mask for each
/// combination. More near pieces are more than an edge.
const MAX_SIGN_PIECES: usize = 5;
/// Masks of all combinations of signs of [`MAX_SIGN_PIECES`] pieces: bit c of mask i is the sign of
/// piece i in combination c.
const COMBINATIONS: [u32; MAX_SIGN_PIECES] = [
    0xAAAA_AAAA,
    0xCCCC_CCCC,
    0xF0F0_F0F0,
    0xFF00_FF00,
    0xFFFF_0000,
];

/// Distances from a point within which edges are sought.
struct EdgeReach {
    /// Half width of the strip along an edge.
    strip: f64,
    /// Minimum width of an edge.
    least: f64,
}

impl FootFinder<'_> {
    /// Computes [`isoform_geom::DistanceField::nearby`].
    pub(super) fn nearby(&mut self, places: &[Foot], reach: f64, strip: f64, out: &mut [Nearby]) {
        let points: Vec<Point3> = places.iter().map(|f| f.at).collect();
        let (mut tries, crowds) = self.meetings(places, &points, [reach, strip], out);
        self.descend(&points, &mut tries);
        let sound = self.on_surface(&tries);
        let met: Vec<usize> = (0..tries.len()).filter(|&t| sound[t]).collect();
        let reach = EdgeReach {
            strip,
            least: Edge::MIN_WIDTH_RATIO * reach,
        };
        for met in met.chunks(LANES) {
            let at: Vec<Point3> = met.iter().map(|&t| tries[t].q).collect();
            self.first_order(&at);
            for (l, &t) in met.iter().enumerate() {
                let i = tries[t].point as usize;
                if let Some(edge) = self.edge(&tries[t], points[i], crowds[t], l, &reach) {
                    out[i] = Nearby::Edge(edge);
                }
            }
        }
    }

    /// Classifies points without other faces within reach, and returns the searches for
    /// intersections of each point's own face with another one within the strip, and the number of
    /// faces within reach for each search.
    fn meetings(
        &mut self,
        places: &[Foot],
        points: &[Point3],
        [reach, strip]: [f64; 2],
        out: &mut [Nearby],
    ) -> (Vec<FootSearch>, Vec<usize>) {
        let (mut tries, mut crowds) = (Vec::new(), Vec::new());
        for (c, chunk) in points.chunks(LANES).enumerate() {
            self.first_order(chunk);
            for l in 0..chunk.len() {
                let i = c * LANES + l;
                let own = places[i].pieces[0];
                out[i] = Nearby::Much;
                if places[i].order == 0 {
                    continue;
                }
                let Some(near) = self.others(&[own], l, reach) else {
                    continue;
                };
                if near.is_empty() {
                    out[i] = Nearby::Face;
                }
                let count = near.len();
                for k in self.others(&[own], l, strip).unwrap_or(near) {
                    tries.push(FootSearch {
                        most: MAX_DISTANCE_RATIO * strip,
                        ..FootSearch::new(i, [own, k, k], 2, points[i])
                    });
                    crowds.push(count);
                }
            }
        }
        (tries, crowds)
    }

    /// Returns the edge that a search found, in lane l of the last block, for a `point` with
    /// `crowd` faces within reach.
    fn edge(
        &mut self,
        met: &FootSearch,
        point: Point3,
        crowd: usize,
        l: usize,
        reach: &EdgeReach,
    ) -> Option<Edge> {
        let [own, other, _] = met.pieces;
        let third = self.third([own, other], l, 2.0 * reach.strip, 2.0 * reach.least);
        let width = 0.5 * third;
        let away = distance_squared(point, met.q).sqrt();
        if width < reach.least || (away > width && crowd != 1) {
            return None;
        }
        let inward = [own, other].map(|k| self.normal(k as usize, l));
        let angle = self.angle([own, other], inward, l)?;
        Some(Edge {
            at: met.q,
            pieces: [own, other],
            inward,
            width,
            is_near: crowd > 0,
            angle,
        })
    }

    /// Returns the distance from the nearest face other than the two that meet in lane l, at most
    /// `far`; if too many faces are within `far`, the search is limited to `near`, and the distance
    /// is 0 if it fails again.
    fn third(&self, own: [u32; 2], l: usize, far: f64, near: f64) -> f64 {
        let nearest = |faces: &[u32], most: f64| {
            let off = faces.iter().map(|k| self.off[*k as usize].0[l].abs());
            off.fold(most, f64::min)
        };
        match self.others(&own, l, far) {
            Some(faces) => nearest(&faces, far),
            None => match self.others(&own, l, near) {
                Some(faces) => nearest(&faces, near),
                None => 0.0,
            },
        }
    }

    /// Returns the pieces other than `own` within reach of lane l of the last block that may belong
    /// to the surface there: those that decide the tree for some signs of all near pieces. `None`
    /// if too many are near.
    fn others(&self, own: &[u32], l: usize, reach: f64) -> Option<Vec<u32>> {
        let is_near = |k: &u32| self.off[*k as usize].0[l].abs() <= reach;
        let count = self.off.len() as u32;
        let others: Vec<u32> = (0..count)
            .filter(|k| is_near(k) && !own.contains(k))
            .collect();
        if others.is_empty() {
            return Some(others);
        }
        let near: Vec<u32> = own.iter().chain(&others).copied().collect();
        if near.len() > MAX_SIGN_PIECES {
            return None;
        }
        let inside = self.combined(&near, l);
        let decides = |k: &u32| {
            let i = near.iter().position(|n| n == k).expect("it is near");
            let with = inside & COMBINATIONS[i];
            with >> (1 << i) != inside & !COMBINATIONS[i]
        };
        Some(others.into_iter().filter(decides).collect())
    }

    /// Returns, as bits by combination of the signs of the pieces in `near`, the combinations for
    /// which lane l is inside.
    fn combined(&self, near: &[u32], l: usize) -> u32 {
        let leaf = |off: &crate::block::Row| if off.0[l] > 0.0 { u32::MAX } else { 0 };
        let mut leaves: Vec<u32> = self.off.iter().map(leaf).collect();
        for (k, mask) in near.iter().zip(COMBINATIONS) {
            leaves[*k as usize] = mask;
        }
        self.solid.is_inside(&mut Vec::new(), &leaves)
    }

    /// Returns the angle through the material between two pieces that intersect in lane l; `None`
    /// if they do not form an edge.
    fn angle(&self, pieces: [u32; 2], [m, n]: [Point3; 2], l: usize) -> Option<f64> {
        let inside = self.combined(&pieces, l) & 0b1111;
        let between = norm(cross(m, n)).atan2(dot(m, n));
        match inside {
            0b1000 => Some(std::f64::consts::PI - between),
            0b1110 => Some(std::f64::consts::PI + between),
            _ => None,
        }
    }

    /// Computes [`isoform_geom::DistanceField::bends`].
    pub(super) fn bends(&mut self, places: &[Foot], step: f64, out: &mut [f64]) {
        let mut by_piece: Vec<Vec<usize>> = vec![Vec::new(); self.solid.pieces.len()];
        for (i, foot) in places.iter().enumerate() {
            by_piece[foot.pieces[0] as usize].push(i);
        }
        let (mut along, mut at) = (Vec::new(), Vec::new());
        for (k, own) in by_piece.iter().enumerate().filter(|(_, o)| !o.is_empty()) {
            along.clear();
            at.clear();
            for (c, &i) in own.iter().enumerate() {
                // Alternating sides: the errors at neighbouring points cancel.
                let side = if c % 2 == 0 { step } else { -step };
                for t in tangents(places[i].inward) {
                    along.push((i, t.map(|v| v / side)));
                    at.push(std::array::from_fn(|x| places[i].at[x] + side * t[x]));
                }
                out[i] = 0.0;
            }
            self.evaluate(k, &at, |c, _, gradient| {
                let (i, by) = along[c];
                // At the point itself the normal has no tangential component.
                out[i] += dot(first_order(1.0, gradient).1, by);
            });
        }
    }
}

/// Returns two directions that form a right-handed orthonormal frame with a unit vector.
fn tangents(n: Point3) -> [Point3; 2] {
    // The cross product with the axis of the smallest component of n is far from zero.
    let least = (0..3).fold(0, |b, i| if n[i].abs() < n[b].abs() { i } else { b });
    let axis = std::array::from_fn(|i| f64::from(u8::from(i == least)));
    let u = cross(n, axis);
    let u = u.map(|v| v / norm(u).max(1e-300));
    [u, cross(n, u)]
}
