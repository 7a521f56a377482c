//! Edges of parts: the distance of points beyond them, and the nearest ones.

use super::{FunctionPart, GrowthPart, ON_PART_DISTANCE, Whole};
use crate::places::{moved, normalized};
use isoform_geom::{Aabb, Field, Point3, cross, dot, norm, sub};

/// Sine of the angle between normals below which two functions are tangent, so that no edge can be
/// located.
const MIN_EDGE_SINE: f64 = 1e-3;

/// Violation of an edge of a part by a point.
#[derive(Clone, Copy)]
pub(crate) struct EdgeViolation<'f> {
    /// Distance of the surface to first order, or of the part's limit.
    pub(crate) by: f64,
    /// Function that vanishes on the violated edge.
    pub(crate) edge: &'f dyn Field,
}

impl<'f> FunctionPart<'f> {
    /// Returns the most violated limit; `None` if no limit is negative.
    fn worst_limit(&self, p: Point3) -> Option<EdgeViolation<'f>> {
        let mut worst: Option<EdgeViolation<'f>> = None;
        for limit in &self.limits {
            let j = limit.jet(p);
            let by = -j.v / norm(j.g);
            if by > worst.map_or(0.0, |w| w.by) {
                worst = Some(EdgeViolation { by, edge: *limit });
            }
        }
        worst
    }
}

impl<'f> Whole<'f> {
    /// Returns the violation of the part's edge by a point on the part's zero set; `None` if the
    /// edge is not violated or that cannot be determined.
    pub(crate) fn beyond(&self, part: usize, p: Point3) -> Option<EdgeViolation<'f>> {
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
        let sharp = EdgeViolation {
            by: found.distance.abs() - j.v.abs() / norm(j.g),
            edge: other.field,
        };
        match self.least_limit(own, p) {
            // The distance from a constant, which vanishes nowhere, is infinite.
            Some(limit) if limit.by >= sharp.by || !sharp.by.is_finite() => Some(limit),
            _ => (sharp.by > 0.0).then_some(sharp),
        }
    }

    /// Returns the limit of the part nearby with the given function that the point violates least;
    /// `None` if one of these parts is valid. At smooth joins the distance is 0 on both sides and
    /// does not show the violation.
    fn least_limit(&self, own: &FunctionPart<'f>, p: Point3) -> Option<EdgeViolation<'f>> {
        let local = self.local(Aabb { lo: p, hi: p });
        let near = local.pieces.iter().flat_map(|piece| &piece.1);
        let mut least: Option<Option<EdgeViolation<'f>>> = None;
        for &k in near {
            let same = &self.parts[k];
            if same.function != own.function {
                continue;
            }
            let worst = same.worst_limit(p);
            let by = |w: Option<EdgeViolation<'f>>| w.map_or(0.0, |w| w.by);
            if least.is_none_or(|l| by(l) > by(worst)) {
                least = Some(worst);
            }
        }
        least.flatten()
    }

    /// Returns the nearest point of the part's edge that Newton's method finds from a point on the
    /// part, and the function that vanishes there.
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
                && self.first_order(q).0.abs() <= ON_PART_DISTANCE * scale
                && self.ends_at(own, edge, q, scale)
            {
                best = Some((d, q, edge));
            }
        }
        best.map(|(_, q, edge)| (q, edge))
    }

    /// Returns the functions that may vanish at edges of a part: other functions, and limits of
    /// parts with its own function.
    fn edges_of<'s>(
        &'s self,
        own: &'s FunctionPart<'f>,
    ) -> impl Iterator<Item = &'f dyn Field> + 's {
        let others = self.parts.iter().enumerate();
        let others = others.filter(|(k, o)| o.function == *k && o.function != own.function);
        let same = self.parts.iter().filter(|o| o.function == own.function);
        let limits = same.flat_map(|o| o.limits.iter().copied());
        others.map(|(_, o)| o.field).chain(limits)
    }

    /// Returns true if the part lies on exactly one side of an edge.
    fn ends_at(&self, own: &FunctionPart<'f>, edge: &dyn Field, q: Point3, scale: f64) -> bool {
        let (f, g) = (own.field.jet(q).g, edge.jet(q).g);
        let across = cross(f, cross(f, g));
        let step = 1e-6 * scale / norm(across);
        let is_there = |sign: f64| {
            let p = moved(q, sign * step, across);
            self.parts[self.first_order(p).1].function == own.function
        };
        is_there(1.0) != is_there(-1.0)
    }
}

/// Returns the point at which two functions vanish to which Newton's method with steps of least
/// length leads; `None` if it does not converge.
fn onto_both(f: &dyn Field, g: &dyn Field, from: Point3, scale: f64) -> Option<Point3> {
    let mut p = from;
    for _ in 0..20 {
        let (a, b) = (f.jet(p), g.jet(p));
        let (aa, ab, bb) = (dot(a.g, a.g), dot(a.g, b.g), dot(b.g, b.g));
        let determinant = aa * bb - ab * ab;
        if determinant.is_nan() || determinant <= (MIN_EDGE_SINE * MIN_EDGE_SINE) * aa * bb {
            return None;
        }
        let (s, t) = (
            (bb * a.v - ab * b.v) / determinant,
            (aa * b.v - ab * a.v) / determinant,
        );
        let step: Point3 = std::array::from_fn(|k| s * a.g[k] + t * b.g[k]);
        let length = norm(step);
        // The linear models are not trusted for longer steps.
        let damped = (0.2 * scale / length).min(1.0);
        p = std::array::from_fn(|k| p[k] - damped * step[k]);
        if length <= 1e-11 * scale {
            return Some(p);
        }
        if !p.iter().all(|v| v.is_finite()) {
            return None;
        }
    }
    None
}

impl<'f> GrowthPart<'f> {
    /// Returns the violation of the part's edge by a point.
    pub(crate) fn beyond(&self, p: Point3) -> Option<EdgeViolation<'f>> {
        self.whole.beyond(self.part, p)
    }
    /// Returns unit vectors along an edge at a point of it, and from there to the side of the edge
    /// on which `towards` lies; `None` if the functions are tangent.
    pub(crate) fn along(
        &self,
        edge: &dyn Field,
        at: Point3,
        towards: Point3,
    ) -> Option<[Point3; 2]> {
        let (f, g) = (self.field().jet(at).g, edge.jet(at).g);
        let t = cross(f, g);
        let length = norm(t);
        if length.is_nan() || length <= MIN_EDGE_SINE * norm(f) * norm(g) {
            return None;
        }
        let t = t.map(|v| v / length);
        let n = normalized(f);
        let inward = cross(n, t);
        // The side of the part is that of `towards`.
        let sign = if dot(inward, sub(towards, at)) < 0.0 {
            -1.0
        } else {
            1.0
        };
        Some([t.map(|v| sign * v), inward.map(|v| sign * v)])
    }
}
