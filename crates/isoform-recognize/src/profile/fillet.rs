//! Fillets in a profile: arcs that touch the lines on both sides.
//!
//! In noise a short line follows the middle of an arc nearly as well, and the adjacent faces take
//! its ends. An arc tangent to both has one parameter of its own, a line two.

use super::curve::{PlanePoint, ProfileCurve, inner, minus, norm};
use super::piece::{Price, ProfilePiece};

/// Replaces lines between two others by fillets if that shortens the description.
pub(super) fn fill(points: &[PlanePoint], price: &Price<'_>, pieces: &mut [ProfilePiece]) {
    for k in 1..pieces.len().saturating_sub(1) {
        let three = &mut pieces[k - 1..=k + 1];
        let Some(corner) = LineCorner::between(points, three) else {
            continue;
        };
        let all: Vec<u32> = (three.iter())
            .flat_map(|piece| piece.points.iter().copied())
            .collect();
        let own = |piece: &ProfilePiece| -> f64 {
            let distance = |i: &u32| piece.curve.distance(points[*i as usize]);
            let each = piece.points.iter().map(distance);
            each.map(|r| price.of_distance(r)).sum()
        };
        let line: f64 = three.iter().map(own).sum();
        let cost = |arc: &Arc| -> f64 {
            let distance = |i: &u32| corner.place(points[*i as usize], arc).1;
            all.iter().map(distance).map(|r| price.of_distance(r)).sum()
        };
        // This geometric series yields the best radius to 4 %, and the fit in space refines it.
        let arcs = (-12..=12).filter_map(|n| {
            let arc = corner.arc(1.08_f64.powi(n))?;
            let kind = price.kind_of_arc(&arc.curve())?;
            Some((cost(&arc), kind, arc))
        });
        let Some((best, kind, arc)) = arcs.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            continue;
        };
        if best >= line + price.of_number(three[1].points.len()) {
            continue;
        }
        let mut parts: [Vec<u32>; 3] = Default::default();
        for i in &all {
            parts[corner.place(points[*i as usize], &arc).0].push(*i);
        }
        for (piece, part) in three.iter_mut().zip(parts) {
            piece.points = part;
        }
        (three[1].kind, three[1].curve) = (kind, arc.curve());
    }
}

/// Corner of two lines of a profile, cut by a third.
struct LineCorner {
    at: PlanePoint,
    /// Unit directions away from the corner along both lines, and how far their points extend.
    sides: [(PlanePoint, f64); 2],
    /// Unit direction of the bisector, and the sine and cosine of half the angle.
    inwards: PlanePoint,
    sin: f64,
    cos: f64,
    /// Radius of the arc whose middle lies on the third line.
    radius: f64,
}

/// An arc tangent to both lines of a corner.
struct Arc {
    center: PlanePoint,
    radius: f64,
    /// Distance of its points of contact from the corner.
    from: f64,
}

impl Arc {
    fn curve(&self) -> ProfileCurve {
        ProfileCurve::Circle(self.center, self.radius)
    }
}

impl LineCorner {
    fn between(points: &[PlanePoint], pieces: &[ProfilePiece]) -> Option<Self> {
        let [
            ProfileCurve::Line(p, d),
            ProfileCurve::Line(middle, cut),
            ProfileCurve::Line(q, e),
        ] = [0, 1, 2].map(|k| pieces[k].curve)
        else {
            return None;
        };
        let cross = d[0] * e[1] - d[1] * e[0];
        // At edges flatter than 17° arcs and lines do not differ.
        if cross.abs() < 0.3 {
            return None;
        }
        let t = ((q[0] - p[0]) * e[1] - (q[1] - p[1]) * e[0]) / cross;
        let at = [p[0] + t * d[0], p[1] + t * d[1]];
        let away = |mean: PlanePoint| {
            let v = minus(mean, at);
            let length = norm(v);
            v.map(|x| x / length)
        };
        let [a, b] = [away(p), away(q)];
        let reach = |piece: &ProfilePiece, along: PlanePoint| {
            let far = |i: &u32| inner(minus(points[*i as usize], at), along);
            (along, piece.points.iter().map(far).fold(0.0, f64::max))
        };
        let sum = [a[0] + b[0], a[1] + b[1]];
        let (cos, inwards) = (norm(sum) / 2.0, sum.map(|x| x / norm(sum)));
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        // Along the bisector the third line lies this far from the corner; an arc of radius r lies
        // r / sin − r from it.
        let across = [-cut[1], cut[0]];
        let off = inner(minus(middle, at), across) / inner(inwards, across);
        let radius = off / (1.0 / sin - 1.0);
        (radius > 0.0 && radius.is_finite()).then(|| Self {
            at,
            sides: [reach(&pieces[0], a), reach(&pieces[2], b)],
            inwards,
            sin,
            cos,
            radius,
        })
    }

    /// Returns the arc with a multiple of the radius of the one on the third line; `None` if it
    /// touches a side beyond its points.
    fn arc(&self, factor: f64) -> Option<Arc> {
        let radius = factor * self.radius;
        let far = radius / self.sin;
        let from = far * self.cos;
        let is_within = self.sides.iter().all(|(_, reach)| from < *reach);
        is_within.then(|| Arc {
            center: std::array::from_fn(|k| self.at[k] + far * self.inwards[k]),
            radius,
            from,
        })
    }

    /// Returns the index of the piece (line, arc, line) that a point belongs to, and its distance
    /// from this piece.
    fn place(&self, p: PlanePoint, arc: &Arc) -> (usize, f64) {
        let d = minus(p, self.at);
        let [a, b] = self.sides.map(|(along, _)| inner(d, along) - arc.from);
        let off = |side: usize| {
            let along = self.sides[side].0;
            d[0] * along[1] - d[1] * along[0]
        };
        match (a > 0.0, b > 0.0) {
            (false, false) => (1, norm(minus(p, arc.center)) - arc.radius),
            (true, false) => (0, off(0)),
            (false, true) => (2, off(1)),
            (true, true) if off(0).abs() < off(1).abs() => (0, off(0)),
            (true, true) => (2, off(1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::PrimitiveKind;
    use crate::profile::curve::CurveFamily;
    use isoform_num::Random;

    /// Returns points of two lines along the axes and of the arc of radius 1 between them; noise
    /// 0.05.
    fn corner(arc: f64) -> Vec<PlanePoint> {
        let mut random = Random::new(3);
        let mut noise = move || 0.05 * (-6.0 + (0..12).map(|_| random.unit()).sum::<f64>());
        let mut points = Vec::new();
        for k in 0..300 {
            let t = arc + 4.0 * f64::from(k) / 300.0;
            points.push([t, noise()]);
            points.push([noise(), t]);
            let (sin, cos) = (f64::from(k) / 300.0 * 90.0_f64.to_radians()).sin_cos();
            let r = arc + noise();
            points.push([arc - r * sin, arc - r * cos]);
        }
        points
    }

    #[test]
    fn a_line_across_an_arc_becomes_the_arc() {
        let points = corner(1.0);
        let is_proper = |_: PrimitiveKind, _: &ProfileCurve| true;
        let shapes = [
            (CurveFamily::Line, PrimitiveKind::Plane),
            (CurveFamily::Circle, PrimitiveKind::Cylinder),
        ];
        let price = Price::new(0.05, &shapes, &is_proper);
        let middle = 1.0 - 0.5_f64.sqrt();
        let line = |place, along| ProfilePiece {
            kind: PrimitiveKind::Plane,
            curve: ProfileCurve::Line(place, along),
            points: Vec::new(),
        };
        let half = 0.5_f64.sqrt();
        let mut pieces = [
            line([3.0, 0.0], [1.0, 0.0]),
            line([middle, middle], [half, -half]),
            line([0.0, 3.0], [0.0, 1.0]),
        ];
        for (p, i) in points.iter().zip(0..) {
            let off = |k: &usize| pieces[*k].curve.distance(*p).abs();
            let nearest = (0..3).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
            pieces[nearest].points.push(i);
        }
        fill(&points, &price, &mut pieces);
        assert_eq!(pieces[1].kind, PrimitiveKind::Cylinder);
        let ProfileCurve::Circle(center, radius) = pieces[1].curve else {
            panic!("no arc");
        };
        assert!((radius - 1.0).abs() < 0.1, "{radius}");
        assert!(norm(minus(center, [1.0, 1.0])) < 0.15, "{center:?}");
    }
}
