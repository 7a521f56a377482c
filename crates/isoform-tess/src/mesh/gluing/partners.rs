//! Partners of a vertex: the other parameters with its image, on all pieces.

use super::SAME_IMAGE_DISTANCE;
use super::Track;
use super::pieces::{CurvePiece, CurvePieces, PieceVertex};
use crate::mesh::chart::Chart;
use crate::mesh::geometry::distance;
use crate::mesh::names::{ClassId, key};
use crate::mesh::opening::Openings;
use crate::mesh::places::{distance2, in_plane, on_side};
use crate::mesh::stretch::Columns;
use crate::surface::Point3;
use isoform_geom::{dot, norm, sub};

/// Minimum and maximum fraction of a segment at which Newton's method starts.
const START: [f64; 2] = [0.02, 0.98];
/// Length by which iterates of Newton's method may leave the unit square, in the parameters.
const MAX_OVERSHOOT: f64 = 0.1;
/// Maximum number of steps of Newton's method to a partner.
const MAX_PARTNER_STEPS: usize = 60;
/// Distance from a curve, in the parameters, up to which a place is on it.
const ON_CURVE_DISTANCE: f64 = 1e-8;

/// Point in space, with the parameter at which it was found.
#[derive(Clone, Copy)]
struct Target {
    image: Point3,
    parameter: [f64; 3],
    class: ClassId,
}

impl CurvePieces<'_> {
    /// Finds the partners of a vertex, and assigns a class to it and to them.
    pub(super) fn join(&mut self, k: usize, j: usize, class: ClassId) {
        let open = self.open;
        let knot = &mut self.pieces[k].knots[j];
        knot.class = Some(class);
        let own = knot.key;
        let target = Target {
            image: knot.image,
            parameter: knot.parameter,
            class,
        };
        for piece in &mut self.pieces {
            // Existing vertices, including other ends of pieces that meet in this parameter.
            for knot in &mut piece.knots {
                if (knot.fixed || knot.class.is_some() || knot.key == own)
                    && knot.class.is_none_or(|c| c == class)
                    && open.are_partners(knot, &target)
                {
                    knot.class = Some(class);
                }
            }
            // All partners on seams are directions already.
            if !piece.is_seam() {
                open.insert_partners(piece, &target);
            }
        }
    }
}

impl Openings<'_> {
    /// Returns true if a vertex coincides with another one, and both may be one.
    fn are_partners(&self, knot: &PieceVertex, target: &Target) -> bool {
        distance(knot.image, target.image) < SAME_IMAGE_DISTANCE * self.atlas.half_width
            && self.curves.may_share(target.parameter, knot.parameter)
    }

    /// Inserts the partners of a vertex into the segments of a piece.
    fn insert_partners(&self, piece: &mut CurvePiece, target: &Target) {
        let mut i = 1;
        while i < piece.knots.len() {
            let is_there = [i - 1, i].map(|k| piece.knots[k].class == Some(target.class));
            if is_there == [false; 2]
                && let Some(at) = self.partner(piece, i, target.image)
                && self
                    .curves
                    .may_share(target.parameter, in_plane(piece.q, at))
            {
                insert(piece, i, at, target);
            }
            i += 1;
        }
    }

    /// Returns the parameter next to a segment of a piece with a given image, if there is one.
    fn partner(&self, piece: &CurvePiece, i: usize, image: Point3) -> Option<[f64; 2]> {
        let (a, b) = (&piece.knots[i - 1], &piece.knots[i]);
        let (place, off) = foot([a.image, b.image], image)?;
        // Partners are searched for up to two tolerances from the chord.
        if off > 2.0 * self.atlas.options.tolerance {
            return None;
        }
        if self.is_fold(piece) {
            return self.partner_on_fold(piece, i, image, place);
        }
        let s = place.clamp(START[0], START[1]);
        let start = [0, 1].map(|k| a.at[k] + s * (b.at[k] - a.at[k]));
        let half_width = self.atlas.half_width;
        let at = newton(&self.atlas.charts[piece.q], start, image, half_width)?;
        let (x, from, to) = (piece.along(at), piece.along(a.at), piece.along(b.at));
        // Rounding may place a partner beyond an end of the segment.
        (x > from - 1e-10 && x < to + 1e-10 && self.is_on(piece, at)).then(|| piece.onto(at))
    }

    /// Returns the parameter with a given image on a fold, across which the map has no derivative:
    /// the search follows the curve, from a place between the ends of the segment.
    fn partner_on_fold(
        &self,
        piece: &CurvePiece,
        i: usize,
        image: Point3,
        place: f64,
    ) -> Option<[f64; 2]> {
        /// Half the step of difference quotients along the segment: slopes need few digits for
        /// Newton's method to converge.
        const DIFFERENCE_STEP: f64 = 1e-4;
        let ends = [i - 1, i].map(|k| piece.knots[k].at);
        let at = |t: f64| {
            self.on_curve_of(
                piece,
                [0, 1].map(|k| ends[0][k] + t * (ends[1][k] - ends[0][k])),
            )
        };
        let value = |t: f64| self.atlas.charts[piece.q].at(at(t));
        let mut t = place.clamp(START[0], START[1]);
        for _ in 0..MAX_PARTNER_STEPS {
            let rest = sub(image, value(t));
            // Difference quotients replace derivatives here, so that a larger residual suffices.
            if norm(rest) < 1e-12 * self.atlas.half_width {
                return (t > 0.0 && t < 1.0).then(|| piece.onto(at(t)));
            }
            let slope = sub(value(t + DIFFERENCE_STEP), value(t - DIFFERENCE_STEP))
                .map(|x| x / (2.0 * DIFFERENCE_STEP));
            t += dot(slope, rest) / dot(slope, slope);
            if !(-MAX_OVERSHOOT..=1.0 + MAX_OVERSHOOT).contains(&t) {
                return None;
            }
        }
        None
    }

    /// Returns true if a parameter is on the curve of a piece, and not on another one that crosses
    /// it.
    fn is_on(&self, piece: &CurvePiece, at: [f64; 2]) -> bool {
        match piece.track {
            Track::Arc(q, slab, i) => {
                let a = &self.atlas.region.triangles[q].arrangement;
                match Columns::new(a, slab).at(at[0], i) {
                    Some(v) => (v - at[1]).abs() < ON_CURVE_DISTANCE,
                    // On a wall up to rounding, where other arcs may end, too.
                    None => [0, piece.knots.len() - 1]
                        .iter()
                        // A point of an arc with a vertical tangent is known to half of the digits
                        // near its end.
                        .any(|&k| distance2(piece.knots[k].at, at) < 1e-7),
                }
            }
            Track::Wall(..) => (piece.knots[0].at[0] - at[0]).abs() < ON_CURVE_DISTANCE,
            Track::Side(side, ..) => {
                distance2(on_side(side, piece.along(at)), at) < ON_CURVE_DISTANCE
            }
            Track::Seam(..) => false,
        }
    }
}

/// Returns the place of the foot of the perpendicular from a point on the line of a segment, 0 and
/// 1 at the ends, and the distance of the point from the segment; `None` for a segment of length 0.
fn foot([p, q]: [Point3; 2], image: Point3) -> Option<(f64, f64)> {
    let (d, x) = (sub(q, p), sub(image, p));
    let length = dot(d, d);
    if length == 0.0 {
        return None;
    }
    let t = dot(d, x) / length;
    let off = x
        .iter()
        .zip(d)
        .map(|(x, d)| (x - t.clamp(0.0, 1.0) * d).powi(2))
        .sum::<f64>()
        .sqrt();
    Some((t, off))
}

/// Returns the Gauss–Newton step in the parameters: the solution of the normal equations of the
/// derivatives by u and v for a residual.
#[inline]
fn gauss_newton([by_u, by_v]: [Point3; 2], rest: Point3) -> [f64; 2] {
    let (e, f, g) = (dot(by_u, by_u), dot(by_u, by_v), dot(by_v, by_v));
    let (p, q) = (dot(by_u, rest), dot(by_v, rest));
    let det = e * g - f * f;
    [(g * p - f * q) / det, (e * q - f * p) / det]
}

/// Returns a parameter with a given image, by the Gauss–Newton method; `None` if it diverges.
fn newton(chart: &Chart, start: [f64; 2], image: Point3, half_width: f64) -> Option<[f64; 2]> {
    let mut at = start;
    let mut last = f64::INFINITY;
    for _ in 0..MAX_PARTNER_STEPS {
        let rest = sub(image, chart.at(at));
        let residual = norm(rest);
        let [_, by_u, by_v] = chart.tangents(at);
        let delta = gauss_newton([by_u, by_v], rest);
        if !residual.is_finite() || delta.iter().any(|d| !d.is_finite()) {
            return None;
        }
        // A residual is small relative to the box; a larger one suffices where steps no longer
        // halve it.
        if residual < 1e-13 * half_width
            || (residual < 1e-10 * half_width && residual >= 0.5 * last)
        {
            return Some(at);
        }
        last = residual;
        at = [at[0] + delta[0], at[1] + delta[1]];
        if at
            .iter()
            .any(|x| !(-MAX_OVERSHOOT..=1.0 + MAX_OVERSHOOT).contains(x))
        {
            return None;
        }
    }
    None
}

/// Inserts a partner between two vertices of a piece, or moves one of them there if it is not
/// needed at its place.
fn insert(piece: &mut CurvePiece, i: usize, at: [f64; 2], target: &Target) {
    let new = PieceVertex {
        at,
        parameter: in_plane(piece.q, at),
        key: key(piece.name(at), piece.q, at),
        image: target.image,
        fixed: false,
        class: Some(target.class),
    };
    let length = distance(piece.knots[i - 1].image, piece.knots[i].image);
    for knot in &mut piece.knots[i - 1..=i] {
        // Places nearer than 1e-10 in the parameters are one.
        if distance2(knot.at, at) < 1e-10 {
            // The partner exists already, or is the vertex itself, which has its class.
            knot.class = knot.class.or(new.class);
            return;
        }
        let is_free = !knot.fixed && knot.class.is_none();
        // A vertex that is not needed moves onto a near partner, relative to the length of the
        // segment.
        if is_free && distance(knot.image, new.image) < 0.35 * length {
            *knot = new;
            return;
        }
    }
    piece.knots.insert(i, new);
}
