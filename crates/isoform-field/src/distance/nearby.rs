//! Edges near places of the surface, and the curvature of its faces there.
//!
//! An edge is where two pieces cross and the tree over the signs of both, all others kept, is
//! inside in one sector (convex) or in three (concave). The bend of a face is the divergence of its
//! unit normal, by differences over a step along the surface.

use super::{Finder, STRAYED, Try, first_order};
use crate::block::LANES;
use isoform_geom::{Edge, Foot, Nearby, Point3, cross, distance_squared, dot, norm};

/// Number of pieces near a place whose signs are combined, one bit of a mask for each combination.
/// Where more are near, there is more than an edge.
const MOST_NEAR: usize = 5;
/// All combinations of the signs of [`MOST_NEAR`] pieces: bit c of mask i is the sign of piece i
/// in combination c.
const COMBINATIONS: [u32; MOST_NEAR] = [
    0xAAAA_AAAA,
    0xCCCC_CCCC,
    0xF0F0_F0F0,
    0xFF00_FF00,
    0xFFFF_0000,
];

/// The distances from a place within which edges are sought.
struct Reach {
    /// The half width of the strip along an edge.
    strip: f64,
    /// The least width of an edge.
    least: f64,
}

impl Finder<'_> {
    /// As [`isoform_geom::DistanceField::nearby`].
    pub(super) fn nearby(&mut self, places: &[Foot], reach: f64, strip: f64, out: &mut [Nearby]) {
        let points: Vec<Point3> = places.iter().map(|f| f.at).collect();
        let (mut tries, crowds) = self.meetings(places, &points, [reach, strip], out);
        self.descend(&points, &mut tries);
        let sound = self.on_surface(&tries);
        let met: Vec<usize> = (0..tries.len()).filter(|&t| sound[t]).collect();
        let reach = Reach {
            strip,
            least: Edge::LEAST * reach,
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

    /// Writes whether a place has faces within reach, and returns the tries to meet the surface
    /// where the place's own face and another one within the strip cross, each with the number of
    /// faces in reach.
    fn meetings(
        &mut self,
        places: &[Foot],
        points: &[Point3],
        [reach, strip]: [f64; 2],
        out: &mut [Nearby],
    ) -> (Vec<Try>, Vec<usize>) {
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
                    tries.push(Try {
                        most: STRAYED * strip,
                        ..Try::new(i, [own, k, k], 2, points[i])
                    });
                    crowds.push(count);
                }
            }
        }
        (tries, crowds)
    }

    /// The edge that a try met, in lane l of the block that was asked last, as it is seen from
    /// `point` with `crowd` faces in reach.
    fn edge(
        &mut self,
        met: &Try,
        point: Point3,
        crowd: usize,
        l: usize,
        reach: &Reach,
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

    /// Distance to the nearest face but for two that meet in lane l, at most `far`; where too many
    /// faces are that near to tell which of them matter, the distance within `near`.
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

    /// The pieces within reach of lane l of the block that was asked last, but for `own`, which may
    /// be of the surface there: the pieces that decide the tree for some signs of all that are near.
    /// `None` where too many are near.
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
        if near.len() > MOST_NEAR {
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

    /// By combination of the signs of the pieces in `near`, whether lane l is inside.
    fn combined(&self, near: &[u32], l: usize) -> u32 {
        let leaf = |off: &crate::block::Row| if off.0[l] > 0.0 { u32::MAX } else { 0 };
        let mut leaves: Vec<u32> = self.off.iter().map(leaf).collect();
        for (k, mask) in near.iter().zip(COMBINATIONS) {
            leaves[*k as usize] = mask;
        }
        self.solid.is_inside(&mut Vec::new(), &leaves)
    }

    /// The angle through the material between two pieces whose common curve lane l is on; `None`
    /// where they do not make an edge.
    fn angle(&self, pieces: [u32; 2], [m, n]: [Point3; 2], l: usize) -> Option<f64> {
        let inside = self.combined(&pieces, l) & 0b1111;
        let between = norm(cross(m, n)).atan2(dot(m, n));
        match inside {
            0b1000 => Some(std::f64::consts::PI - between),
            0b1110 => Some(std::f64::consts::PI + between),
            _ => None,
        }
    }

    /// As [`isoform_geom::DistanceField::bends`].
    pub(super) fn bends(&mut self, places: &[Foot], step: f64, out: &mut [f64]) {
        let mut by_piece: Vec<Vec<usize>> = vec![Vec::new(); self.solid.sheets.len()];
        for (i, foot) in places.iter().enumerate() {
            by_piece[foot.pieces[0] as usize].push(i);
        }
        let (mut along, mut at) = (Vec::new(), Vec::new());
        for (k, own) in by_piece.iter().enumerate().filter(|(_, o)| !o.is_empty()) {
            along.clear();
            at.clear();
            for (c, &i) in own.iter().enumerate() {
                // To either side in turn: the errors of neighbouring places cancel.
                let side = if c % 2 == 0 { step } else { -step };
                for t in tangents(places[i].inward) {
                    along.push((i, t.map(|v| v / side)));
                    at.push(std::array::from_fn(|x| places[i].at[x] + side * t[x]));
                }
                out[i] = 0.0;
            }
            self.evaluate(k, &at, |c, _, gradient| {
                let (i, by) = along[c];
                // At the place itself the normal has no part along.
                out[i] += dot(first_order(1.0, gradient).1, by);
            });
        }
    }
}

/// Two directions that make a right-handed frame with a unit vector.
fn tangents(n: Point3) -> [Point3; 2] {
    // The cross product with the axis that n is least along is far from zero.
    let least = (0..3).fold(0, |b, i| if n[i].abs() < n[b].abs() { i } else { b });
    let axis = std::array::from_fn(|i| f64::from(u8::from(i == least)));
    let u = cross(n, axis);
    let u = u.map(|v| v / norm(u).max(1e-300));
    [u, cross(n, u)]
}
