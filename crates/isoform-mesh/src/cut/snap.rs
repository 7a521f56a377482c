//! Vertices of the lattice are moved to corners, curves and the surface, where that is near.

use super::{Cutter, LOOK};
use crate::points::along;
use crate::surface::On;
use crate::torus::Torus;
use isoform_geom::{Point3, norm, sub};
use rayon::prelude::*;

/// Worst measure that a snap to a corner, a curve, the surface may leave. Higher: more cuts and
/// short edges; lower: flat tetrahedra that only the optimiser can mend.
const SNAP_QUALITY: [f64; 3] = [0.01, 0.04, 0.1];
/// Farthest snap to a curve or corner, in cells. Voronoi cells of the lattice reach 0.559.
const SNAP_REACH: f64 = 0.56;
/// Farthest that a vertex is snapped to the nearest point of the surface, in cells; the edges of
/// the lattice are longer.
const SURFACE_REACH: f64 = 0.6;
/// Value, in cells, from which a vertex is too far from the surface to be snapped to it.
const NEAR: f64 = 0.5;
/// Share of an edge next to a vertex within which the vertex is moved instead of cutting: long and
/// short edges of the lattice (Labelle and Shewchuk, table 1).
const WARP: [f64; 2] = [0.25, 0.41];
/// Length in cells from which an edge is a long one: between √3/2 of the short ones and 1.
const LONG: f64 = 0.94;
/// Values of more than this many cells, infinite ones too, count as this many.
const DECIDED: f64 = 2.0;
/// Distance, in cells, below which two corners are one.
const SAME_CORNER: f64 = 1e-6;
/// The least distance, in cells, between neighbours on one curve.
const APART: f64 = 0.5;
/// With more pieces than this near a vertex, corners are left to the cutting: the number of triples
/// to try grows with the third power.
const CROWDED: usize = 6;

/// A corner or a point of a curve within reach of a vertex.
struct Candidate {
    distance: f64,
    v: u32,
    on: On,
    at: Point3,
}

impl Cutter<'_> {
    /// Moves vertices onto corners, then onto curves; of each kind the nearest vertices first.
    pub(super) fn snap_features(&mut self) {
        let mut corners: Vec<Point3> = Vec::new();
        for (k, found) in self.candidates().into_iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return;
            }
            let Candidate { v, on, at, .. } = found;
            if !self.is_free(v as usize) {
                continue;
            }
            if on.len() == 3 {
                let same = SAME_CORNER * self.cell[v as usize];
                if corners.iter().any(|&q| norm(sub(q, at)) < same)
                    || self.worst_if(v, at) < SNAP_QUALITY[0]
                {
                    continue;
                }
                corners.push(at);
            } else if self.is_crowded(v, on, at) || self.worst_if(v, at) < SNAP_QUALITY[1] {
                continue;
            }
            self.place(v, at, on);
        }
    }

    /// Corners and points of curves within reach of vertices, in the order in which they are tried.
    fn candidates(&self) -> Vec<Candidate> {
        let found: Vec<Vec<Candidate>> = (0..self.complex.points.len() as u32)
            .into_par_iter()
            .map(|v| {
                if self.frozen[v as usize] || self.control.is_stopped() {
                    Vec::new()
                } else {
                    self.features_near(v, SNAP_REACH * self.cell[v as usize])
                }
            })
            .collect();
        let mut found: Vec<Candidate> = found.into_iter().flatten().collect();
        found.sort_by(|a, b| {
            let by_kind = b.on.len().cmp(&a.on.len());
            let by_distance = a.distance.total_cmp(&b.distance);
            let rank = |c: &Candidate| self.surface.rank(self.complex.point(c.v));
            let by_rank = || rank(a).cmp(&rank(b));
            by_kind
                .then(by_distance)
                .then_with(by_rank)
                .then(a.v.cmp(&b.v))
        });
        found
    }

    /// Whether a neighbour stands on the same curve close to a place.
    fn is_crowded(&mut self, v: u32, on: On, at: Point3) -> bool {
        let close = APART * self.cell[v as usize];
        self.neighbours(v).iter().any(|&w| {
            let near = |torus: Torus| torus.nearest(self.complex.point(w), at);
            let p = (self.complex.torus).map_or_else(|| self.complex.point(w), near);
            on.is_within(&self.on[w as usize]) && norm(sub(p, at)) < close
        })
    }

    /// Corners and curve points within reach of a vertex.
    fn features_near(&self, v: u32, reach: f64) -> Vec<Candidate> {
        let p = self.complex.point(v);
        let mut found = Vec::new();
        let pieces: Vec<u32> = self
            .surface
            .pieces_near(p)
            .into_iter()
            .filter(|&i| self.surface.distance(i, p).abs() < reach)
            .collect();
        let sides = self.on[v as usize];
        for (i, &a) in pieces.iter().enumerate() {
            for (j, &b) in pieces[..i].iter().enumerate() {
                if let [side, ref more @ ..] = *sides.slice() {
                    // A curve of the solid ends in the side.
                    if more.is_empty() {
                        found.extend(self.candidate(v, &[side, b, a], reach));
                    }
                    continue;
                }
                found.extend(self.candidate(v, &[b, a], reach));
                if pieces.len() <= CROWDED {
                    for &c in &pieces[..j] {
                        found.extend(self.candidate(v, &[c, b, a], reach));
                    }
                }
            }
        }
        found
    }

    /// The point next to a vertex where the pieces meet, if they do in an edge or corner of the
    /// solid within reach.
    fn candidate(&self, v: u32, on: &[u32], reach: f64) -> Option<Candidate> {
        let p = self.complex.point(v);
        let at = self.surface.project(on, p)?;
        let distance = norm(sub(p, at));
        if distance > reach || !self.surface.are_bounded_at(on, at) {
            return None;
        }
        let holds = if on.len() == 2 {
            self.surface.is_curve([on[0], on[1]], at)
        } else {
            self.surface.is_corner_or_end([on[0], on[1], on[2]], at)
        };
        let on = On::of(on);
        holds.then_some(Candidate {
            distance,
            v,
            on,
            at,
        })
    }

    /// Vertices next to the surface are moved onto it, nearest first.
    pub(super) fn snap_surface(&mut self) {
        let mut near: Vec<u32> = (0..self.complex.points.len() as u32)
            .filter(|&v| self.may_snap(v as usize))
            .collect();
        let depth = |v: u32| self.value[v as usize].abs();
        let rank = |v: u32| self.surface.rank(self.complex.point(v));
        near.sort_by(|&u, &v| {
            let by_depth = depth(u).total_cmp(&depth(v));
            by_depth.then_with(|| rank(u).cmp(&rank(v))).then(u.cmp(&v))
        });
        for (k, v) in near.into_iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return;
            }
            if let Some(w) = self.nearest_across(v)
                && let Some((q, piece)) = self.nearest_on_surface(v, w)
                && self.worst_if(v, q) >= SNAP_QUALITY[2]
            {
                self.place(v, q, self.on[v as usize].with(piece).unwrap_or_default());
            }
        }
    }

    /// Whether a vertex near the surface, but not on it, is free to move.
    fn may_snap(&self, v: usize) -> bool {
        let f = self.value[v];
        f != 0.0
            && f.abs() < NEAR * self.cell[v]
            && !self.frozen[v]
            && self.is_free(v)
            && self.on[v].len() < 3
            && !self.is_elsewhere(v)
    }

    /// Whether a vertex is held on nothing, or on sides of a unit cell alone.
    fn is_free(&self, v: usize) -> bool {
        self.surface.holds_only_sides(&self.on[v])
    }

    /// Whether a vertex lies where the surface of the layer in focus does not matter: outside of
    /// the whole, or in a region before the layer's.
    fn is_elsewhere(&self, v: usize) -> bool {
        let value = |layer: usize| self.surface.value_in(layer, self.complex.points[v]).0;
        let focus = self.surface.focus;
        focus > 0 && (value(0) < 0.0 || (1..focus).any(|layer| value(layer) > 0.0))
    }

    /// The neighbour on the other side of the surface whose edge is crossed nearest to the vertex,
    /// if that is near enough.
    fn nearest_across(&mut self, v: u32) -> Option<u32> {
        let (f, a) = (self.value[v as usize], self.cell[v as usize]);
        let mut least: Option<(f64, u32)> = None;
        for w in self.neighbours(v) {
            let g = self.value[w as usize];
            if f * g < 0.0 {
                let long = self.complex.edge_length(v, w) > LONG * a;
                let share = f.abs() / (f.abs() + g.abs().min(DECIDED * a));
                let limit = if long { WARP[0] } else { WARP[1] };
                if share < limit && least.is_none_or(|l| share < l.0) {
                    least = Some((share, w));
                }
            }
        }
        least.map(|l| l.1)
    }

    /// A point of the surface for a vertex, with the piece there: the nearest one if it is near,
    /// else one from the edge to a neighbour on the other side.
    fn nearest_on_surface(&self, v: u32, across: u32) -> Option<(Point3, u32)> {
        let surface = self.surface;
        let [p, q] = self.complex.points_of([v, across]);
        let f = self.value[v as usize];
        let (_, piece) = surface.value(p);
        let with = |piece: u32| self.on[v as usize].with(piece);
        let nearest = surface.project(with(piece)?.slice(), p).filter(|&q| {
            norm(sub(p, q)) < SURFACE_REACH * self.cell[v as usize]
                && surface.value(q).0.abs() <= surface.zero
        });
        if let Some(q) = nearest {
            return Some((q, piece));
        }
        let g = self.value[across as usize];
        let (t, piece) = surface.root((p, f), (q, g))?;
        let q = surface.project(with(piece)?.slice(), along(p, q, t))?;
        Some((q, piece))
    }
}
