//! Splitting of edges that cross curves of the solid, and of faces that contain a corner.

use super::{Aligner, Cuttable, common, edges_of, shared};
use crate::points::{centroid, lerp};
use crate::surface::meet_at_an_angle;
use isoform_geom::{Point3, TRIANGLE_EDGES, distance_squared, dot, norm, sub};

/// Distance of a crossing from a vertex, in lengths of the edge, within which the vertex is moved
/// there instead of splitting the edge.
const MAX_SNAP_FRACTION: f64 = 0.25;
/// Smallest and largest fraction of an edge at which it is split for a curve.
const SPLIT_FRACTIONS_AT_CURVE: [f64; 2] = [0.02, 0.98];
/// Smallest and largest fraction of an edge at which it is split for a corner.
const SPLIT_FRACTIONS_AT_CORNER: [f64; 2] = [0.1, 0.9];

/// Feature of the solid crossed by an edge between vertices without a common piece.
enum EdgeCrossing {
    /// A curve of the solid: the fraction of the edge, and the point of the curve.
    Curve(f64, Point3),
    /// A seam between pieces that touch tangentially.
    Smooth,
    /// Neither was found.
    Unknown,
}

impl<M: Cuttable> Aligner<'_, M> {
    /// Splits edges between vertices without a common piece; returns their number.
    pub(super) fn split_edges(&mut self) -> usize {
        let edges = edges_of(&self.mesh.faces()).into_iter();
        edges.filter(|&ends| self.split_at_curve(ends)).count()
    }

    /// Splits an edge where it crosses a curve, or moves an end there. Returns true if it did.
    fn split_at_curve(&mut self, ends: [u32; 2]) -> bool {
        if !self.is_across(ends) {
            return false;
        }
        let (t, q) = match self.crossing(ends) {
            EdgeCrossing::Curve(t, q) => (t, q),
            EdgeCrossing::Smooth => {
                self.smooth.insert(ends);
                return false;
            }
            EdgeCrossing::Unknown => {
                self.give_up(ends);
                return false;
            }
        };
        let on = self.vanishing(q);
        // A vertex next to the curve is moved there: a split would leave a short edge.
        let close = [(ends[0], t), (ends[1], 1.0 - t)]
            .into_iter()
            .find(|&(k, share)| share < MAX_SNAP_FRACTION && self.is_free(k));
        if let Some((k, _)) = close
            && shared(&on, &self.on[k as usize]).is_some()
            && self.hold(k, q, on.clone())
        {
            return true;
        }
        let is_split = self.split(
            ends,
            t.clamp(SPLIT_FRACTIONS_AT_CURVE[0], SPLIT_FRACTIONS_AT_CURVE[1]),
            q,
            on,
        );
        if !is_split {
            self.give_up(ends);
        }
        is_split
    }

    /// Returns true if both ends of an edge lie on pieces but share none, and the edge was not
    /// classified before.
    fn is_across(&self, ends: [u32; 2]) -> bool {
        let [a, b] = ends.map(|v| &self.on[v as usize]);
        shared(a, b).is_none()
            && !a.is_empty()
            && !b.is_empty()
            && !self.smooth.contains(&ends)
            && !self.given_up.contains(&ends)
    }

    fn give_up(&mut self, ends: [u32; 2]) {
        if self.given_up.insert(ends) {
            let [p, q] = ends.map(|v| self.at(v));
            self.lost.push(lerp(p, q, 0.5));
        }
    }

    /// Returns true if a vertex does not lie on an edge of the solid.
    fn is_free(&self, v: u32) -> bool {
        let (p, on) = (self.at(v), &self.on[v as usize]);
        let no_edge = |a: u32, b: u32| a == b || !self.surface.is_edge([a, b], p);
        self.surface.solid.tree().pieces().len() > 1
            && on.iter().all(|&a| on.iter().all(|&b| no_edge(a, b)))
    }

    /// Finds the feature of the solid that an edge crosses.
    fn crossing(&self, ends: [u32; 2]) -> EdgeCrossing {
        let [p, q] = ends.map(|v| self.at(v));
        let Some((x, there)) = self.turning_point(ends) else {
            return EdgeCrossing::Unknown;
        };
        let (mut best, mut is_smooth): (Option<(f64, Point3)>, bool) = (None, true);
        for &a in &self.on[ends[0] as usize] {
            for &b in &there {
                is_smooth &= !meet_at_an_angle(self.surface.solid, [a, b], x);
                let Some(y) = self.surface.project(&[a, b], x) else {
                    continue;
                };
                let d = norm(sub(x, y));
                if d < norm(sub(p, q))
                    && best.is_none_or(|best| d < best.0)
                    && self.is_on_curve([a, b], y)
                {
                    best = Some((d, y));
                }
            }
        }
        match best {
            Some((_, y)) => {
                let e = sub(q, p);
                EdgeCrossing::Curve((dot(sub(y, p), e) / dot(e, e)).clamp(0.0, 1.0), y)
            }
            None if is_smooth => EdgeCrossing::Smooth,
            None => EdgeCrossing::Unknown,
        }
    }

    /// Bisects an edge for the point where the nearest surface point leaves the pieces of the first
    /// end. Returns it with the pieces behind it; `None` if the edge is too far from the surface.
    fn turning_point(&self, ends: [u32; 2]) -> Option<(Point3, Vec<u32>)> {
        let [p, q] = ends.map(|v| self.at(v));
        let here = &self.on[ends[0] as usize];
        let (mut lo, mut hi) = (0.0, 1.0);
        let mut there = self.on[ends[1] as usize].clone();
        // Newton's method refines the result of the bisection.
        for _ in 0..30 {
            let m = 0.5 * (lo + hi);
            let (_, on) = self.nearest(lerp(p, q, m))?;
            if shared(&on, here).is_some() {
                lo = m;
            } else {
                (hi, there) = (m, on);
            }
        }
        Some((lerp(p, q, 0.5 * (lo + hi)), there))
    }

    /// Splits faces that contain a corner of the solid: each two of their vertices have a common
    /// piece, but not all three. Returns their number.
    pub(super) fn split_faces(&mut self) -> usize {
        let faces = self.mesh.faces().into_iter();
        faces
            .filter(|&f| self.may_hold_corner(f) && self.split_at_corner(f))
            .count()
    }

    /// Returns true if each two vertices of a face have a common piece, but not all three. If two
    /// have none, edges around it are split first, and the face is tried again.
    fn may_hold_corner(&self, f: [u32; 3]) -> bool {
        let on = f.map(|v| self.on[v as usize].as_slice());
        let meet = |[i, j]: [usize; 2]| shared(on[i], on[j]).is_some();
        !self.has_smooth_edge(f) && common(on).is_empty() && TRIANGLE_EDGES.into_iter().all(meet)
    }

    /// Splits the edge of a face that is nearest to the corner next to its centroid, and moves the
    /// new vertex there.
    fn split_at_corner(&mut self, f: [u32; 3]) -> bool {
        let p = f.map(|v| self.at(v));
        let Some(k) = self.free_corner_near(p) else {
            return false;
        };
        let c = self.corners[k].at;
        let nearest = TRIANGLE_EDGES
            .map(|[i, j]| {
                let e = sub(p[j], p[i]);
                let t = dot(sub(c, p[i]), e) / dot(e, e);
                let t = t.clamp(SPLIT_FRACTIONS_AT_CORNER[0], SPLIT_FRACTIONS_AT_CORNER[1]);
                (distance_squared(lerp(p[i], p[j], t), c), [f[i], f[j]], t)
            })
            .into_iter()
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, ends, share)) = nearest
            && self.mesh.faces().contains(&f)
            && self.split(ends, share, c, self.corners[k].pieces.clone())
        {
            self.corners[k].is_taken = true;
            return true;
        }
        false
    }

    /// Returns the corner without a vertex that is nearest to the centroid of a triangle, within
    /// the length of its longest edge.
    fn free_corner_near(&self, p: [Point3; 3]) -> Option<usize> {
        let middle = centroid(p);
        let length = |i: usize| norm(sub(p[i], p[(i + 1) % 3]));
        let size = (0..3).map(length).fold(0.0, f64::max);
        let off = |k: &usize| distance_squared(self.corners[*k].at, middle);
        (0..self.corners.len())
            .filter(|k| !self.corners[*k].is_taken && off(k) < size * size)
            .min_by(|a, b| off(a).total_cmp(&off(b)))
    }
}
