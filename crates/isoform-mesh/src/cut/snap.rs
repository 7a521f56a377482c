//! Snapping: lattice vertices are moved to nearby corners, curves and the surface.

use super::{Cutter, ITEMS_PER_STOP_CHECK};
use crate::points::lerp;
use crate::surface::On;
use crate::torus::Torus;
use isoform_geom::{Point3, norm, sub};
use rayon::prelude::*;

/// Worst biased sines that a snap to a corner, a curve, and the surface may leave. Higher values
/// cause more cuts and short edges; lower ones flat tetrahedra that only the optimiser can repair.
const MIN_SNAP_QUALITIES: [f64; 3] = [0.01, 0.04, 0.1];
/// Largest distance of a snap to a curve or corner, in cells. Voronoi cells of the lattice extend
/// to 0.559.
const MAX_FEATURE_SNAP_DISTANCE: f64 = 0.56;
/// Fractions of the long and the short lattice edges next to a vertex within which the vertex is
/// moved instead of cutting (Labelle and Shewchuk, table 1).
const SURFACE_SNAP_FRACTIONS: [f64; 2] = [0.25, 0.41];
/// Maximum number of pieces near a vertex for which corners are tried, since the number of triples
/// is cubic; others are left to the cutting.
const MAX_CORNER_PIECES: usize = 6;

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
            if k.is_multiple_of(ITEMS_PER_STOP_CHECK) && self.control.is_stopped() {
                return;
            }
            let Candidate { v, on, at, .. } = found;
            if !self.is_free(v as usize) {
                continue;
            }
            if on.len() == 3 {
                // Corners that are equal to rounding.
                let same = 1e-6 * self.cell[v as usize];
                if corners.iter().any(|&q| norm(sub(q, at)) < same)
                    || self.worst_if(v, at) < MIN_SNAP_QUALITIES[0]
                {
                    continue;
                }
                corners.push(at);
            } else if self.is_crowded(v, on, at) || self.worst_if(v, at) < MIN_SNAP_QUALITIES[1] {
                continue;
            }
            self.place(v, at, on);
        }
    }

    /// Returns corners and points of curves within reach of vertices, in the order in which they
    /// are tried.
    fn candidates(&self) -> Vec<Candidate> {
        let found: Vec<Vec<Candidate>> = (0..self.complex.points.len() as u32)
            .into_par_iter()
            .map(|v| {
                if self.frozen[v as usize] || self.control.is_stopped() {
                    Vec::new()
                } else {
                    self.features_near(v, MAX_FEATURE_SNAP_DISTANCE * self.cell[v as usize])
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

    /// Returns true if a neighbour on this curve is close to a point.
    fn is_crowded(&mut self, v: u32, on: On, at: Point3) -> bool {
        // Minimum distance, in cells, between neighbours on one curve.
        let close = 0.5 * self.cell[v as usize];
        self.neighbours(v).iter().any(|&w| {
            let near = |torus: Torus| torus.nearest(self.complex.point(w), at);
            let p = (self.complex.torus).map_or_else(|| self.complex.point(w), near);
            on.is_within(&self.on[w as usize]) && norm(sub(p, at)) < close
        })
    }

    /// Returns corners and curve points within reach of a vertex.
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
                if pieces.len() <= MAX_CORNER_PIECES {
                    for &c in &pieces[..j] {
                        found.extend(self.candidate(v, &[c, b, a], reach));
                    }
                }
            }
        }
        found
    }

    /// Returns the nearest common point of the pieces, if it is an edge or corner of the solid
    /// within reach.
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
        let on = On::from_pieces(on);
        holds.then_some(Candidate {
            distance,
            v,
            on,
            at,
        })
    }

    /// Moves vertices close to the surface onto it, nearest first.
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
            if k.is_multiple_of(ITEMS_PER_STOP_CHECK) && self.control.is_stopped() {
                return;
            }
            if let Some(w) = self.nearest_across(v)
                && let Some((q, piece)) = self.nearest_on_surface(v, w)
                && self.worst_if(v, q) >= MIN_SNAP_QUALITIES[2]
            {
                self.place(v, q, self.on[v as usize].with(piece).unwrap_or_default());
            }
        }
    }

    /// Returns true if a vertex is close to the surface, but not on it, and free to move.
    fn may_snap(&self, v: usize) -> bool {
        let f = self.value[v];
        f != 0.0
            // Vertices farther away, in cells, are not snapped.
            && f.abs() < 0.5 * self.cell[v]
            && !self.frozen[v]
            && self.is_free(v)
            && self.on[v].len() < 3
            && !self.is_elsewhere(v)
    }

    /// Returns true if a vertex is held by sides of a unit cell only, or by no piece.
    fn is_free(&self, v: usize) -> bool {
        self.surface.holds_only_sides(&self.on[v])
    }

    /// Returns true if a vertex lies where the surface of the layer in focus does not matter:
    /// outside of the whole, or in an earlier region.
    fn is_elsewhere(&self, v: usize) -> bool {
        let value = |layer: usize| self.surface.value_in(layer, self.complex.points[v]).0;
        let focus = self.surface.focus;
        focus > 0 && (value(0) < 0.0 || (1..focus).any(|layer| value(layer) > 0.0))
    }

    /// Returns the neighbour on the other side of the surface whose edge is crossed nearest to the
    /// vertex; `None` if no crossing is near enough.
    fn nearest_across(&mut self, v: u32) -> Option<u32> {
        let (f, a) = (self.value[v as usize], self.cell[v as usize]);
        let mut least: Option<(f64, u32)> = None;
        for w in self.neighbours(v) {
            let g = self.value[w as usize];
            if f * g < 0.0 {
                // Short edges have √3/2, long ones 1 in cells.
                let long = self.complex.edge_length(v, w) > 0.94 * a;
                // Values, also infinite ones, count as two cells at most.
                let share = f.abs() / (f.abs() + g.abs().min(2.0 * a));
                let limit = if long {
                    SURFACE_SNAP_FRACTIONS[0]
                } else {
                    SURFACE_SNAP_FRACTIONS[1]
                };
                if share < limit && least.is_none_or(|l| share < l.0) {
                    least = Some((share, w));
                }
            }
        }
        least.map(|l| l.1)
    }

    /// Returns a point of the surface for a vertex, with the piece there: the nearest one if it is
    /// close, else one from the edge to a neighbour on the other side.
    fn nearest_on_surface(&self, v: u32, across: u32) -> Option<(Point3, u32)> {
        let surface = self.surface;
        let [p, q] = self.complex.points_of([v, across]);
        let f = self.value[v as usize];
        let (_, piece) = surface.value(p);
        let with = |piece: u32| self.on[v as usize].with(piece);
        let nearest = surface.project(with(piece)?.slice(), p).filter(|&q| {
            // The edges of the lattice are longer.
            norm(sub(p, q)) < 0.6 * self.cell[v as usize]
                && surface.value(q).0.abs() <= surface.zero
        });
        if let Some(q) = nearest {
            return Some((q, piece));
        }
        let g = self.value[across as usize];
        let (t, piece) = surface.root((p, f), (q, g))?;
        let q = surface.project(with(piece)?.slice(), lerp(p, q, t))?;
        Some((q, piece))
    }
}
