//! Edges of parts: how far a place is beyond one, and where the nearest one is.

use super::{NO_DISTANCE, On, Part, Whole};
use crate::places::{moved, normalized};
use isoform_geom::{Aabb, Field, Point3, cross, dot, norm, sub};

/// Where it is looked on which side of an edge a part is, in the scale given.
const ASIDE: f64 = 1e-6;
/// Newton steps onto an edge.
const STEPS: usize = 20;
/// Foot points on edges are found to this, in the scale given.
const ON_EDGE: f64 = 1e-11;
/// The longest step towards an edge, in the scale given: farther away linear models are not to be
/// trusted.
const LONGEST: f64 = 0.2;
/// Functions whose normals differ by a sine below this do not meet in an edge that could be found.
const TANGENTIAL: f64 = 1e-3;

/// Where a place lies outside of a part.
#[derive(Clone, Copy)]
pub(crate) struct Beyond<'f> {
    /// How far the surface is, to first order, or how far the part's limit.
    pub(crate) by: f64,
    /// What vanishes at the edge of the part there.
    pub(crate) edge: &'f dyn Field,
}

impl<'f> Part<'f> {
    /// The limit beyond which a place lies farthest; none where no limit is negative.
    fn worst_limit(&self, p: Point3) -> Option<Beyond<'f>> {
        let mut worst: Option<Beyond<'f>> = None;
        for limit in &self.limits {
            let j = limit.jet(p);
            let by = -j.v / norm(j.g);
            if by > worst.map_or(0.0, |w| w.by) {
                worst = Some(Beyond { by, edge: *limit });
            }
        }
        worst
    }
}

impl<'f> Whole<'f> {
    /// Where a place on a part is beyond the part's edge; none where it is not, and where it cannot
    /// be said.
    pub(crate) fn beyond(&self, part: usize, p: Point3) -> Option<Beyond<'f>> {
        if self.is_single() {
            return None;
        }
        let own = &self.parts[part];
        let found = self.deciding(p);
        let other = &self.parts[found.part];
        if other.function == own.function {
            return None;
        }
        let j = own.field.jet(p);
        let sharp = Beyond {
            by: found.distance.abs() - j.v.abs() / norm(j.g),
            edge: other.field,
        };
        match self.least_limit(own, p) {
            // From a constant, which vanishes nowhere, the distance is infinite.
            Some(limit) if limit.by >= sharp.by || !sharp.by.is_finite() => Some(limit),
            _ => (sharp.by > 0.0).then_some(sharp),
        }
    }

    /// Of the parts near a place with a part's function the limit of the one that the place is
    /// least beyond; at smooth joins the distance says nothing yet. None where one counts.
    fn least_limit(&self, own: &Part<'f>, p: Point3) -> Option<Beyond<'f>> {
        let local = self.local(Aabb { lo: p, hi: p });
        let near = local.pieces.iter().flat_map(|piece| &piece.1);
        let mut least: Option<Option<Beyond<'f>>> = None;
        for &k in near {
            let same = &self.parts[k];
            if same.function != own.function {
                continue;
            }
            let worst = same.worst_limit(p);
            let by = |w: Option<Beyond<'f>>| w.map_or(0.0, |w| w.by);
            if least.is_none_or(|l| by(l) > by(worst)) {
                least = Some(worst);
            }
        }
        least.flatten()
    }

    /// The nearest point of the part's edge that Newton's method finds from a place on it, with
    /// what vanishes there.
    pub(crate) fn nearest_edge(
        &self,
        part: usize,
        p: Point3,
        scale: f64,
    ) -> Option<(Point3, &'f dyn Field)> {
        let own = &self.parts[part];
        let mut best: Option<(f64, Point3, &'f dyn Field)> = None;
        for edge in self.edges_of(own) {
            let Some(q) = onto_both(own.field, edge, p, scale) else {
                continue;
            };
            let d = norm(sub(q, p));
            if best.is_none_or(|b| d < b.0)
                && self.first_order(q).0.abs() <= NO_DISTANCE * scale
                && self.ends_at(own, edge, q, scale)
            {
                best = Some((d, q, edge));
            }
        }
        best.map(|(_, q, edge)| (q, edge))
    }

    /// What may vanish at edges of a part: other functions, and limits of parts with its own.
    fn edges_of<'s>(&'s self, own: &'s Part<'f>) -> impl Iterator<Item = &'f dyn Field> + 's {
        let others = self.parts.iter().enumerate();
        let others = others.filter(|(k, o)| o.function == *k && o.function != own.function);
        let same = self.parts.iter().filter(|o| o.function == own.function);
        let limits = same.flat_map(|o| o.limits.iter().copied());
        others.map(|(_, o)| o.field).chain(limits)
    }

    /// Whether a part is there on one side of an edge, and not on the other.
    fn ends_at(&self, own: &Part<'f>, edge: &dyn Field, q: Point3, scale: f64) -> bool {
        let (f, g) = (own.field.jet(q).g, edge.jet(q).g);
        let across = cross(f, cross(f, g));
        let step = ASIDE * scale / norm(across);
        let is_there = |sign: f64| {
            let p = moved(q, sign * step, across);
            self.parts[self.first_order(p).1].function == own.function
        };
        is_there(1.0) != is_there(-1.0)
    }
}

/// The point where two functions vanish that Newton's method with least steps leads to.
fn onto_both(f: &dyn Field, g: &dyn Field, from: Point3, scale: f64) -> Option<Point3> {
    let mut p = from;
    for _ in 0..STEPS {
        let (a, b) = (f.jet(p), g.jet(p));
        let (aa, ab, bb) = (dot(a.g, a.g), dot(a.g, b.g), dot(b.g, b.g));
        let determinant = aa * bb - ab * ab;
        if determinant.is_nan() || determinant <= (TANGENTIAL * TANGENTIAL) * aa * bb {
            return None;
        }
        let (s, t) = (
            (bb * a.v - ab * b.v) / determinant,
            (aa * b.v - ab * a.v) / determinant,
        );
        let step: Point3 = std::array::from_fn(|k| s * a.g[k] + t * b.g[k]);
        let length = norm(step);
        let damped = (LONGEST * scale / length).min(1.0);
        p = std::array::from_fn(|k| p[k] - damped * step[k]);
        if length <= ON_EDGE * scale {
            return Some(p);
        }
        if !p.iter().all(|v| v.is_finite()) {
            return None;
        }
    }
    None
}

impl<'f> On<'f> {
    /// Where a place is beyond the part's edge.
    pub(crate) fn beyond(&self, p: Point3) -> Option<Beyond<'f>> {
        self.whole.beyond(self.part, p)
    }
    /// Unit vectors along an edge at a point of it, and from there into the side of the part on
    /// which `towards` lies.
    pub(crate) fn along(
        &self,
        edge: &dyn Field,
        at: Point3,
        towards: Point3,
    ) -> Option<[Point3; 2]> {
        let (f, g) = (self.field().jet(at).g, edge.jet(at).g);
        let t = cross(f, g);
        let length = norm(t);
        if length.is_nan() || length <= TANGENTIAL * norm(f) * norm(g) {
            return None;
        }
        let t = t.map(|v| v / length);
        let n = normalized(f);
        let inward = cross(n, t);
        // The side on which the part is: by the place, or by where the part counts.
        let sign = if dot(inward, sub(towards, at)) < 0.0 {
            -1.0
        } else {
            1.0
        };
        Some([t.map(|v| sign * v), inward.map(|v| sign * v)])
    }
}
