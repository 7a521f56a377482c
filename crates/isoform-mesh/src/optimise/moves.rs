//! Moves of vertices to better positions: freely within the solid, by projection on pieces.

use super::holds::Hold;
use super::{MIN_FACING_COSINE, MIN_GAIN, Optimiser};
use crate::complex::Face;
use crate::measure::{VertexStar, biased_sine, smallest_sine};
use crate::points::{midpoint, unit};
use crate::surface::On;
use isoform_geom::{Point3, cross, dot};
use rayon::prelude::*;

/// Maximum number of steps of a move.
const MAX_MOVE_STEPS: usize = 4;
/// Number of batches of vertices: positions are proposed together within a batch, so that the
/// result does not depend on threads. Neighbours seldom share one of eight batches, and where they
/// do the second one is checked again.
const VERTEX_BATCHES: u32 = 8;

/// Buffers for the move of a vertex.
#[derive(Default)]
pub(super) struct MoveBuffers {
    star: Vec<u32>,
    faces: Vec<Face>,
    around: VertexStar,
}

/// A position with the worst measure around a vertex there.
#[derive(Clone, Copy)]
struct RatedPosition {
    at: Point3,
    worst: f64,
}

/// Returns the batch of a vertex, by the leading three bits of a multiplicative hash.
fn batch_of(v: u32) -> u32 {
    v.wrapping_mul(0x9E37_79B9) >> 29
}

impl Optimiser<'_> {
    /// Returns a better position for a vertex, if there is one.
    pub(super) fn better_place(&self, v: u32, moving: &mut MoveBuffers) -> Option<Point3> {
        let Hold::On(on) = self.hold[v as usize] else {
            return None;
        };
        if on.len() > 2 {
            return None;
        }
        self.collect_star(v, &on, moving)?;
        let around = &mut moving.around;
        let start = self.point(v);
        let first = around.worst(start, f64::NEG_INFINITY);
        if on.is_empty() {
            let last = self.climb_freely(start, first, around);
            return (last.worst > first + MIN_GAIN).then_some(last.at);
        }
        let mut places = [start; MAX_MOVE_STEPS];
        let mut n = 0;
        let mut last = RatedPosition {
            at: start,
            worst: first,
        };
        while n < MAX_MOVE_STEPS
            && let Some(next) = self.step(&on, last, around)
        {
            places[n] = next.at;
            n += 1;
            last = next;
        }
        // The last position counts that is still valid when it is projected onto the surface up to
        // rounding.
        places[..n].iter().rev().find_map(|&p| {
            let p = self.surface.project(on.slice(), p)?;
            let is_better = around.worst(p, first + MIN_GAIN) > first + MIN_GAIN;
            (is_better && self.may_stand(v, p, &moving.faces)).then_some(p)
        })
    }

    /// Collects the tetrahedra and the faces of the surface around a vertex.
    fn collect_star(&self, v: u32, on: &On, moving: &mut MoveBuffers) -> Option<()> {
        let MoveBuffers {
            star,
            faces,
            around,
        } = moving;
        self.complex.star_shared(v, star);
        faces.clear();
        if !on.is_empty() {
            self.add_faces_at(star, v, faces);
        }
        around.clear();
        for &t in star.iter() {
            around.push(self.corners_seen_from(v, t), self.complex.place(t, v));
        }
        for (f, _) in faces.iter() {
            let x = f.iter().position(|&k| k == v)?;
            let [_, a, b] = self
                .complex
                .seen_from(v, self.points_of([v, f[(x + 1) % 3], f[(x + 2) % 3]]));
            around.push_face([a, b]);
        }
        Some(())
    }

    /// Returns the corners of a tetrahedron as seen from one of them.
    #[inline]
    fn corners_seen_from(&self, v: u32, t: u32) -> [Point3; 4] {
        let mut corners = self.complex.corners(t);
        if self.complex.torus.is_some() {
            let place = self.complex.place(t, v);
            corners.swap(0, place);
            corners = self.complex.seen_from(v, corners);
            corners.swap(0, place);
        }
        corners
    }

    /// Returns the best position for a vertex within the solid.
    fn climb_freely(&self, start: Point3, first: f64, around: &mut VertexStar) -> RatedPosition {
        let mut last = RatedPosition {
            at: start,
            worst: first,
        };
        if first < self.enough {
            // In most cases equal to a search by gradients, and far cheaper.
            let at = around.centre(start);
            let worst = around.worst(at, first + MIN_GAIN);
            if worst > first + MIN_GAIN {
                last = RatedPosition { at, worst };
            }
        }
        for _ in 0..MAX_MOVE_STEPS {
            match self.step(&On::default(), last, around) {
                Some(next) => last = next,
                None => break,
            }
        }
        last
    }

    /// Returns a better position than the last one, in the direction in which the worst tetrahedra
    /// improve; `None` if the last one is good enough, or no better one is found.
    fn step(&self, on: &On, last: RatedPosition, around: &mut VertexStar) -> Option<RatedPosition> {
        let RatedPosition { at, worst } = last;
        if worst >= self.enough || worst.is_nan() {
            return None;
        }
        let (direction, step) = around.direction(at, worst, self.tangent(on, at))?;
        let mut found = None;
        let (mut s, mut bound) = (step, worst + MIN_GAIN);
        // Step lengths are halved.
        for _ in 0..6 {
            let raw = std::array::from_fn(|i| at[i] + s * direction[i]);
            // One step of Newton's method suffices to judge a position; the chosen one is projected
            // onto the surface up to rounding.
            let place = if on.is_empty() {
                Some(raw)
            } else {
                self.surface.nearer(on.slice(), raw)
            };
            if let Some(at) = place {
                let worst = around.worst(at, bound);
                if worst > bound {
                    found = Some(RatedPosition { at, worst });
                    bound = worst;
                } else if found.is_some() {
                    break;
                }
            }
            s *= 0.5;
        }
        found
    }

    /// Returns the projection of vectors onto the directions in which a vertex may move.
    fn tangent(&self, on: &On, p: Point3) -> impl Fn(Point3) -> Point3 + use<> {
        let normal = |k: usize| unit(self.surface.gradient(on.slice()[k], p).1);
        let n = on.len();
        // The normal of a piece, or the tangent of a curve.
        let axis = match n {
            0 => [0.0; 3],
            1 => normal(0),
            _ => unit(cross(normal(0), normal(1))),
        };
        move |g| {
            let c = dot(g, axis);
            match n {
                0 => g,
                1 => std::array::from_fn(|i| g[i] - c * axis[i]),
                _ => axis.map(|x| c * x),
            }
        }
    }

    /// Returns true if a vertex of the surface may stand at `p`: all pieces that hold it vanish
    /// there and its faces face outward.
    fn may_stand(&self, v: u32, p: Point3, faces: &[Face]) -> bool {
        let at = self.with(v, p);
        !self.is_off(v, p)
            && faces.iter().all(|&(f, label)| {
                let c = self.facing(self.complex.together(f.map(&at)), label);
                c >= MIN_FACING_COSINE || c >= self.facing(self.points_of(f), label)
            })
    }

    /// Returns the positions of vertices, with `v` at `p`.
    fn with(&self, v: u32, p: Point3) -> impl Fn(u32) -> Point3 {
        move |k| if k == v { p } else { self.point(k) }
    }

    /// Returns the worst measure of tetrahedra and faces, with `v` at `p`.
    pub(super) fn worst_at(&self, v: u32, p: Point3, star: &[u32], faces: &[Face]) -> f64 {
        let at = self.with(v, p);
        let mut worst = f64::INFINITY;
        for &t in star {
            worst = worst.min(biased_sine(
                self.complex
                    .together(self.complex.tets[t as usize].map(&at)),
            ));
        }
        for (f, _) in faces {
            worst = worst.min(smallest_sine(self.complex.together(f.map(&at))));
        }
        worst
    }

    /// Moves vertices where that improves the worst tetrahedron at them. Returns the number of
    /// moves.
    pub(super) fn smooth(&mut self, vertices: &[u32]) -> usize {
        let mut moved = 0;
        for batch in 0..VERTEX_BATCHES {
            let these: Vec<u32> = vertices
                .iter()
                .copied()
                .filter(|&v| batch_of(v) == batch)
                .collect();
            let places = self.better_places(&these);
            for (&v, place) in these.iter().zip(&places) {
                if let Some(p) = *place
                    && self.move_if_better(v, p)
                {
                    moved += 1;
                }
            }
        }
        moved
    }

    /// Returns better positions for vertices, provided that the others stay.
    fn better_places(&self, vertices: &[u32]) -> Vec<Option<Point3>> {
        let propose = |moving: &mut MoveBuffers, &v: &u32| {
            if self.control.is_stopped() {
                None
            } else {
                self.better_place(v, moving)
            }
        };
        vertices
            .par_iter()
            .with_min_len(64)
            .map_init(MoveBuffers::default, propose)
            .collect()
    }

    /// Moves a vertex if its surroundings improve. Returns true if it moved.
    fn move_if_better(&mut self, v: u32, p: Point3) -> bool {
        let mut star = std::mem::take(&mut self.scratch.star);
        self.complex.star(v, &mut star);
        let faces = self.faces_at(&star, v);
        let before = self.worst_at(v, self.point(v), &star, &faces);
        let is_better = self.worst_at(v, p, &star, &faces) > before;
        if is_better {
            self.complex.points[v as usize] = p;
            self.touched[v as usize] = self.clock;
            self.suspects.extend_from_slice(&star);
        }
        self.scratch.star = star;
        is_better
    }

    /// Returns the midpoint of an edge.
    pub(super) fn middle_of(&self, [a, b]: [u32; 2]) -> Point3 {
        let [p, q] = self.points_of([a, b]);
        midpoint(p, q)
    }
}
