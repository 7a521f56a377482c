//! Seams: curves where two pieces touch along a third one.
//!
//! Example: the side of a box passes smoothly into a cylinder where the end face of the box, which
//! is not part of the surface, crosses both. No two bounding pieces meet at an angle there, so that
//! neither the surface nor its two pieces locate the curve: Newton's method towards a tangential
//! intersection loses half of the digits. The third piece meets both at an angle: the *seam* is its
//! intersection with one of them, and one of the two bounds the solid on each side of it.

use super::{MAX_TANGENT_SINE, On, Surface, is_skin};
use crate::features::newton::add_scaled;
use crate::lattice::CELL_EDGE;
use crate::points::unit;
use crate::refine::{curvature, turn_size};
use isoform_geom::{Point3, cross, norm, sub};
use std::sync::atomic::Ordering;

/// Distance from a seam at which the bounding piece is determined, in local cells. Closer, both
/// pieces are equal to rounding; farther away, other pieces may begin.
const SEAM_PROBE_DISTANCE: f64 = 0.02;
/// Largest distance of a point from its seam, in local cells: more than vertices are snapped.
const MAX_SEAM_DISTANCE: f64 = 1.0;
/// Distance from a seam at which its pieces must still be close, and their largest separation
/// there, both in local cells. If they part sooner, a radius is smaller than a cell, since cells
/// are not refined below a fraction of the size: triangles would not fit between this seam and the
/// next, and vertices held on both spoil the mesh.
const SEAM_CONTACT_LIMITS: [f64; 2] = [0.5, 0.15];

impl Surface<'_> {
    /// Returns the seam near `p` along which two pieces touch: the first of the two, and the piece
    /// that separates them; `None` if no piece does. Among coincident separating pieces the first
    /// counts, so that a seam has a unique name.
    pub(crate) fn seam_of(&self, pair: [u32; 2], p: Point3) -> Option<[u32; 2]> {
        let reduced = self.reduced_in(self.common_layer(&pair)?, p)?;
        if !self.seams || pair.iter().any(|&i| is_skin(i)) || reduced.pieces.len() < 3 {
            return None;
        }
        let kept = pair[0].min(pair[1]);
        let seam_with = |&by: &u32| {
            let q = self.project(&[kept, by], p)?;
            let off = norm(sub(p, q));
            let is_here = off < MAX_SEAM_DISTANCE * self.lattice.a
                && self.touch_at(pair, by, q)
                && off < MAX_SEAM_DISTANCE * self.cell_at(pair, q);
            is_here.then_some((off, by))
        };
        let others = reduced.pieces.iter().filter(|i| !pair.contains(i));
        let nearer = |best: (f64, u32), next: (f64, u32)| {
            if next.0 < best.0 - self.zero {
                next
            } else {
                best
            }
        };
        let nearest = others.filter_map(seam_with).reduce(nearer)?;
        self.has_seams.store(true, Ordering::Relaxed);
        Some([kept, nearest.1])
    }

    /// Returns the pieces onto which a vertex is projected: touching pieces are replaced by one of
    /// them and the piece that separates them.
    pub(crate) fn parted(&self, on: On, p: Point3) -> On {
        let pieces = on.slice();
        let pairs = (0..pieces.len()).flat_map(|k| (0..k).map(move |j| [pieces[j], pieces[k]]));
        let seams: Vec<[u32; 2]> = pairs.filter_map(|pair| self.seam_of(pair, p)).collect();
        let Some(&[kept, _]) = seams.first() else {
            return on;
        };
        let rest = pieces
            .iter()
            .filter(|&&i| i != kept && !self.are_parallel([kept, i], p));
        let by = seams.iter().map(|seam| &seam[1]);
        let mut parted = vec![kept];
        parted.extend(rest.chain(by));
        On::from_pieces(&parted)
    }

    /// Returns true if two pieces meet at `p` in an edge of the solid, or in a seam.
    pub(crate) fn is_curve(&self, pair: [u32; 2], p: Point3) -> bool {
        self.is_edge(pair, p) || self.is_seam(pair, p)
    }

    /// Returns true if one of two pieces touches a third one at `p` along the other.
    pub(crate) fn is_seam(&self, pair: [u32; 2], p: Point3) -> bool {
        let layer = self.common_layer(&pair);
        let Some(reduced) = layer.and_then(|layer| self.reduced_in(layer, p)) else {
            return false;
        };
        let others = reduced.pieces.iter().copied();
        others
            .filter(|i| !pair.contains(i) && self.distance(*i, p) == 0.0)
            .any(|i| pair.iter().any(|&a| self.is_seam_beside([a, i], pair, p)))
    }

    /// Returns true if the three pieces meet at `p` in a corner of the solid, or a seam ends there.
    /// Two pieces that touch along a seam do not locate a corner: the piece that separates them
    /// does.
    pub(crate) fn is_corner_or_end(&self, on: [u32; 3], p: Point3) -> bool {
        let pairs = [[on[0], on[1]], [on[1], on[2]], [on[2], on[0]]];
        let are_separated =
            |&pair: &[u32; 2]| self.are_parallel(pair, p) && self.seam_of(pair, p).is_some();
        (self.is_corner(&on, p) && !pairs.iter().any(are_separated)) || self.is_seams_end(pairs, p)
    }

    /// Returns true if a seam of one of the pairs of three pieces ends at `p`.
    fn is_seams_end(&self, pairs: [[u32; 2]; 3], p: Point3) -> bool {
        let step = SEAM_PROBE_DISTANCE * self.lattice.a;
        pairs.into_iter().any(|pair| {
            let n = pair.map(|k| self.gradient(k, p).1);
            let t = unit(cross(n[0], n[1]));
            let is_there = |s: f64| {
                let q = self.project(&pair, add_scaled(p, t, s));
                q.is_some_and(|q| self.are_bounded_at(&pair, q) && self.is_seam(pair, q))
            };
            is_there(step) != is_there(-step)
        })
    }

    /// Returns true if the seam of two pieces that touch at `p` is the given pair.
    fn is_seam_beside(&self, touching: [u32; 2], pair: [u32; 2], p: Point3) -> bool {
        self.are_parallel(touching, p)
            && self
                .seam_of(touching, p)
                .is_some_and(|seam| seam.iter().all(|i| pair.contains(i)))
    }

    /// Returns the estimated edge length of the cells at a point of two pieces, from their
    /// curvature; cells may be smaller for other reasons.
    fn cell_at(&self, pieces: [u32; 2], p: Point3) -> f64 {
        if !self.bends {
            return self.lattice.a;
        }
        let bends = pieces.map(|i| curvature(&self.solid.jet(i, p)));
        let radius = 1.0 / bends[0].max(bends[1]);
        let size = self.lattice.a / CELL_EDGE;
        CELL_EDGE * turn_size(radius, size).min(size)
    }

    pub(super) fn are_parallel(&self, pair: [u32; 2], p: Point3) -> bool {
        let [n, m] = pair.map(|i| unit(self.gradient(i, p).1));
        norm(cross(n, m)) <= MAX_TANGENT_SINE
    }

    /// Returns true if two pieces touch at `p` where a third one crosses them, and one of them
    /// bounds the solid on one side of that, the other on the other side.
    fn touch_at(&self, [a, b]: [u32; 2], by: u32, p: Point3) -> bool {
        let [n, m, across] = [a, b, by].map(|i| unit(self.gradient(i, p).1));
        if self.distance(b, p) != 0.0
            || norm(cross(n, m)) > MAX_TANGENT_SINE
            // The separating piece must cross at an angle of more than 11 degrees, or the seam is
            // ill-conditioned.
            || norm(cross(n, across)) < 0.2
        {
            return false;
        }
        let w = unit(cross(n, cross(n, across)));
        let cell = self.cell_at([a, b], p);
        let parting = |s: f64| {
            let q = add_scaled(p, w, s * SEAM_CONTACT_LIMITS[0] * cell);
            (self.distance(a, q) - self.distance(b, q)).abs()
        };
        if parting(1.0).max(parting(-1.0)) > SEAM_CONTACT_LIMITS[1] * cell {
            return false;
        }
        let step = SEAM_PROBE_DISTANCE * cell;
        let bounds = self.bounding([a, b, by], p, [step, -step].map(|s| add_scaled(p, w, s)));
        bounds.into_iter().any(|[here, there, without]| {
            let are_both = [here, there] == [a, b] || [here, there] == [b, a];
            are_both && without != here
        })
    }

    /// Returns the pieces that bound the solid at two points next to a seam, and the one at the
    /// first point if the separating piece had the opposite sign there: once for each way in which
    /// the seam may end in other pieces at `p`.
    fn bounding(&self, seam: [u32; 3], p: Point3, places: [Point3; 2]) -> Vec<[u32; 3]> {
        let Some(reduced) = self.reduced_in(self.layer_of(seam[0]), p) else {
            return Vec::new();
        };
        let reach = norm(sub(places[0], p));
        // Pieces in which the seam may end: both sides of each are tried.
        let is_close = |i: &u32| {
            !seam.contains(i)
                && self.distance(*i, p).abs() < reach
                && !self.are_parallel([*i, seam[2]], p)
        };
        let ends: Vec<u32> = reduced.pieces.iter().copied().filter(is_close).collect();
        let by = seam[2];
        let bounding = |signs: u32| {
            let value = |i: u32, q: Point3| match ends.iter().position(|&e| e == i) {
                Some(at) if signs >> at & 1 == 1 => -f64::MAX,
                Some(_) => f64::MAX,
                None => self.distance(i, q),
            };
            let decides = |v: &dyn Fn(u32) -> f64| reduced.tree.value_and_piece(&v).1;
            let [here, there] = places;
            let turned = |i| {
                if i == by {
                    -value(i, here)
                } else {
                    value(i, here)
                }
            };
            [
                decides(&|i| value(i, here)),
                decides(&|i| value(i, there)),
                decides(&turned),
            ]
        };
        // Each piece in which the seam may end doubles the work; a corner has one or two.
        (0..1 << ends.len().min(3)).map(bounding).collect()
    }
}
