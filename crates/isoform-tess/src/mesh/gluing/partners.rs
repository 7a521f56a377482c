//! The partners of a vertex: the other parameters with its image, on all pieces.

use super::CLOSE;
use super::Track;
use super::pieces::{Knot, Piece, Pieces};
use crate::mesh::chart::Chart;
use crate::mesh::geometry::distance;
use crate::mesh::names::{ClassId, key};
use crate::mesh::opening::Openings;
use crate::mesh::places::{distance2, in_plane, on_side};
use crate::mesh::stretch::Columns;
use crate::surface::Point3;
use isoform_geom::{dot, norm, sub};

/// The distance from the end of an arc, in the parameters, at which a place that rounding puts onto
/// the wall there may be: what is on an arc with a vertical tangent is half the digits from its
/// end.
const AT_END: f64 = 1e-7;
/// The distance from a chord in space up to which a partner is looked for beside it, in tolerances.
const BESIDE: f64 = 2.0;
/// The least and the greatest share of a segment at which Newton's method starts.
const START: [f64; 2] = [0.02, 0.98];
/// The length by which Newton's method may leave the unit square on its way.
const OUTSIDE: f64 = 0.1;
/// The most steps of Newton's method.
const STEPS: usize = 60;
/// The residual, per half width of the box, below which Newton's method has come to its end.
const FOUND: f64 = 1e-13;
/// The residual, per half width of the box, below which Newton's method has come to its end if a
/// step no longer halves it.
const STUCK: f64 = 1e-10;
/// The residual that is enough on folds, where difference quotients take the place of derivatives.
const FOUND_ON_FOLD: f64 = 1e-12;
/// The length beyond the ends of a segment, in the parameters, in which a partner may be for
/// rounding.
const BEYOND: f64 = 1e-10;
/// The distance from a curve, in the parameters, up to which a place is on it.
const ON_CURVE: f64 = 1e-8;
/// A partner that is nearer to a vertex than this, in the parameters, is that vertex.
const ONE: f64 = 1e-10;
/// A vertex that nothing needs moves onto a partner that is nearer than this, per length of the
/// segment beside it.
const MOVED: f64 = 0.35;

/// A point in space, with the parameter that it was found by.
#[derive(Clone, Copy)]
struct Target {
    image: Point3,
    parameter: [f64; 3],
    class: ClassId,
}

impl Pieces<'_> {
    /// Finds the partners of a vertex and gives them, and it, a class.
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
            // Vertices that are there already, other ends of pieces that meet in the same parameter
            // among them.
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
    /// Whether a vertex is where another one is, and they may be one.
    fn are_partners(&self, knot: &Knot, target: &Target) -> bool {
        distance(knot.image, target.image) < CLOSE * self.atlas.half_width
            && self.curves.may_share(target.parameter, knot.parameter)
    }

    /// Puts the partners of a vertex into the segments of a piece.
    fn insert_partners(&self, piece: &mut Piece, target: &Target) {
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

    /// The parameter near to a segment of a piece with a given image, if there is one.
    fn partner(&self, piece: &Piece, i: usize, image: Point3) -> Option<[f64; 2]> {
        let (a, b) = (&piece.knots[i - 1], &piece.knots[i]);
        let (place, off) = foot([a.image, b.image], image)?;
        if off > BESIDE * self.atlas.options.tolerance {
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
        (x > from - BEYOND && x < to + BEYOND && self.is_on(piece, at)).then(|| piece.onto(at))
    }

    /// The parameter with a given image on a fold, across which the map has no derivative: along
    /// the curve alone, from a place between the ends of the segment.
    fn partner_on_fold(
        &self,
        piece: &Piece,
        i: usize,
        image: Point3,
        place: f64,
    ) -> Option<[f64; 2]> {
        /// Half the step of difference quotients along the segment: they need no more digits for
        /// each step to gain some.
        const STEP: f64 = 1e-4;
        let ends = [i - 1, i].map(|k| piece.knots[k].at);
        let at = |t: f64| {
            self.on_curve_of(
                piece,
                [0, 1].map(|k| ends[0][k] + t * (ends[1][k] - ends[0][k])),
            )
        };
        let value = |t: f64| self.atlas.charts[piece.q].at(at(t));
        let mut t = place.clamp(START[0], START[1]);
        for _ in 0..STEPS {
            let rest = sub(image, value(t));
            if norm(rest) < FOUND_ON_FOLD * self.atlas.half_width {
                return (t > 0.0 && t < 1.0).then(|| piece.onto(at(t)));
            }
            let slope = sub(value(t + STEP), value(t - STEP)).map(|x| x / (2.0 * STEP));
            t += dot(slope, rest) / dot(slope, slope);
            if !(-OUTSIDE..=1.0 + OUTSIDE).contains(&t) {
                return None;
            }
        }
        None
    }

    /// Whether a parameter is on the curve of a piece, not on another one that crosses it.
    fn is_on(&self, piece: &Piece, at: [f64; 2]) -> bool {
        match piece.track {
            Track::Arc(q, slab, i) => {
                let a = &self.atlas.region.triangles[q].arrangement;
                match Columns::new(a, slab).at(at[0], i) {
                    Some(v) => (v - at[1]).abs() < ON_CURVE,
                    // On a wall but for rounding, where other arcs may end, too.
                    None => [0, piece.knots.len() - 1]
                        .iter()
                        .any(|&k| distance2(piece.knots[k].at, at) < AT_END),
                }
            }
            Track::Wall(..) => (piece.knots[0].at[0] - at[0]).abs() < ON_CURVE,
            Track::Side(side, ..) => distance2(on_side(side, piece.along(at)), at) < ON_CURVE,
            Track::Seam(..) => false,
        }
    }
}

/// Where the foot of the perpendicular from a point is on a segment's line, 0 and 1 at the ends,
/// and how far the point is from the segment. None for a segment of no length.
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

/// The step in the parameters that leaves the least of a residual: the solution of the normal
/// equations of the derivatives by u and v.
#[inline]
fn gauss_newton([by_u, by_v]: [Point3; 2], rest: Point3) -> [f64; 2] {
    let (e, f, g) = (dot(by_u, by_u), dot(by_u, by_v), dot(by_v, by_v));
    let (p, q) = (dot(by_u, rest), dot(by_v, rest));
    let det = e * g - f * f;
    [(g * p - f * q) / det, (e * q - f * p) / det]
}

/// A parameter with a given image, by the method of Gauss and Newton; None if it leads away.
fn newton(chart: &Chart, start: [f64; 2], image: Point3, half_width: f64) -> Option<[f64; 2]> {
    let mut at = start;
    let mut last = f64::INFINITY;
    for _ in 0..STEPS {
        let rest = sub(image, chart.at(at));
        let residual = norm(rest);
        let [_, by_u, by_v] = chart.tangents(at);
        let delta = gauss_newton([by_u, by_v], rest);
        if !residual.is_finite() || delta.iter().any(|d| !d.is_finite()) {
            return None;
        }
        if residual < FOUND * half_width
            || (residual < STUCK * half_width && residual >= 0.5 * last)
        {
            return Some(at);
        }
        last = residual;
        at = [at[0] + delta[0], at[1] + delta[1]];
        if at.iter().any(|x| !(-OUTSIDE..=1.0 + OUTSIDE).contains(x)) {
            return None;
        }
    }
    None
}

/// Puts a partner between two vertices of a piece, or moves one of them there that is not needed
/// where it is.
fn insert(piece: &mut Piece, i: usize, at: [f64; 2], target: &Target) {
    let new = Knot {
        at,
        parameter: in_plane(piece.q, at),
        key: key(piece.name(at), piece.q, at),
        image: target.image,
        fixed: false,
        class: Some(target.class),
    };
    let length = distance(piece.knots[i - 1].image, piece.knots[i].image);
    for knot in &mut piece.knots[i - 1..=i] {
        if distance2(knot.at, at) < ONE {
            // There already; or the vertex itself, which has its class.
            knot.class = knot.class.or(new.class);
            return;
        }
        let is_free = !knot.fixed && knot.class.is_none();
        if is_free && distance(knot.image, new.image) < MOVED * length {
            *knot = new;
            return;
        }
    }
    piece.knots.insert(i, new);
}
