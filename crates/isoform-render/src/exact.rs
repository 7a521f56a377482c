//! The surfaces that triangles stand for: places and normals of patches and maps themselves.

use crate::camera::{Ray, along};
use isoform::geom::{Point3, RationalPatch, Tangents, cross, dot, norm, sub};
use isoform::tess::{Map, Surface as MapSurface};

/// Steps of Newton's method from a triangle to the surface.
const STEPS: usize = 8;
/// The signs of s and t in the four unit triangles of the plane of parameters.
const QUADRANTS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];

/// A surface with parameters.
#[derive(Clone, Debug)]
pub(crate) enum Exact {
    /// Patches, by number.
    Patches(Vec<RationalPatch>),
    /// The unit triangles of a map, by number.
    Map(Forms),
}

impl Exact {
    /// The place of parameters, with its derivatives.
    pub(crate) fn at(&self, chart: u32, [u, v]: [f64; 2]) -> Tangents {
        match self {
            Self::Patches(patches) => patches[chart as usize].tangents(u, v),
            Self::Map(forms) => forms.at(chart as usize, u, v),
        }
    }

    /// Where a ray meets the surface near the place `start`, which it meets nearly: how far along
    /// the ray, and the normal. Newton's method for o + t d = p(u, v).
    pub(crate) fn onto(&self, ray: &Ray, chart: u32, start: [f64; 2]) -> Option<(f64, Point3)> {
        let mut at = start;
        let mut now = self.at(chart, at);
        for _ in 0..STEPS {
            let n = now.normal();
            let det = dot(n, ray.d);
            if det == 0.0 || !det.is_finite() {
                return None;
            }
            let t = dot(n, sub(now.point, ray.o)) / det;
            let (du, dv) = now.step_to_foot(sub(along(ray.o, ray.d, t), now.point));
            at = [at[0] + du, at[1] + dv];
            now = self.at(chart, at);
            if du.abs() + dv.abs() < 1e-13 {
                break;
            }
        }
        let normal = now.normal();
        let size = norm(normal);
        let t = dot(sub(now.point, ray.o), ray.d);
        // The places of patches end at their sides, where the triangles end, too.
        let is_on = at.iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(v));
        (is_on && size > 0.0 && size.is_finite() && t.is_finite())
            .then(|| (t, normal.map(|v| v / size)))
    }
}

/// The four forms of a map over the projective plane.
#[derive(Clone, Debug)]
pub(crate) struct Forms {
    /// Terms of X, Y, Z and W in s and t: both exponents and the coefficient.
    terms: [Vec<([i32; 2], f64)>; 4],
    degree: i32,
    /// Rows of the matrix behind the unit triangles' own coordinates.
    frame: [Point3; 3],
}

impl Forms {
    pub(crate) fn new(map: &Map, surface: &MapSurface) -> Self {
        let terms = map.affine().each_ref().map(|p| {
            let terms = p.to_f64().into_iter();
            terms
                .map(|(e, c)| ([i32::from(e[0]), i32::from(e[1])], c))
                .collect()
        });
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Self {
            terms,
            degree: map.degree() as i32,
            frame: surface.frame.unwrap_or(identity),
        }
    }

    /// A form at (s : t : w), with its derivatives by the three.
    fn form(&self, k: usize, [s, t, w]: Point3) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for ([i, j], c) in &self.terms[k] {
            let r = self.degree - i - j;
            // n xⁿ⁻¹, and 0 for n = 0.
            let slope = |x: f64, n: i32| {
                if n > 0 {
                    f64::from(n) * x.powi(n - 1)
                } else {
                    0.0
                }
            };
            let (p, q, h) = (s.powi(*i), t.powi(*j), w.powi(r));
            sum[0] += c * p * q * h;
            sum[1] += c * slope(s, *i) * q * h;
            sum[2] += c * p * slope(t, *j) * h;
            sum[3] += c * p * q * slope(w, r);
        }
        sum
    }

    /// The place of u and v of a unit triangle.
    fn at(&self, chart: usize, u: f64, v: f64) -> Tangents {
        let [s, t] = QUADRANTS[chart % 4];
        let through = |h: Point3| self.frame.map(|row| dot(row, h));
        let base = through([s * u, t * v, 1.0 - u - v]);
        let ways = [through([s, 0.0, -1.0]), through([0.0, t, -1.0])];
        let forms: [[f64; 4]; 4] = std::array::from_fn(|k| self.form(k, base));
        let weight = forms[3][0];
        let point: Point3 = std::array::from_fn(|k| forms[k][0] / weight);
        let along = |way: Point3| -> Point3 {
            let slope = |k: usize| dot([forms[k][1], forms[k][2], forms[k][3]], way);
            std::array::from_fn(|k| (slope(k) - point[k] * slope(3)) / weight)
        };
        Tangents {
            point,
            u: along(ways[0]),
            v: along(ways[1]),
            weight,
        }
    }
}

/// The normal of a triangle, as long as twice its area.
pub(crate) fn facet_normal([a, b, c]: [Point3; 3]) -> Point3 {
    cross(sub(b, a), sub(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform::tess::{Options, TriangulateOptions};
    use isoform::{Control, triangulate_map};

    #[test]
    fn places_of_a_map_are_those_of_its_triangles() {
        let texts = ["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"];
        let map = Map::parse(texts, Options::default()).expect("a map");
        let options = TriangulateOptions::around(2.into());
        let (surface, _) = triangulate_map(&map, &options, &Control::default()).expect("triangles");
        let exact = Exact::Map(Forms::new(&map, &surface));
        for (k, triangle) in surface.triangles.iter().enumerate().step_by(7) {
            for (corner, uv) in triangle.iter().zip(&surface.corners[k]) {
                let there = exact.at(u32::from(surface.charts[k]), *uv);
                let away = norm(sub(there.point, surface.points[*corner as usize]));
                assert!(away < 1e-9, "{away}");
                // Of the unit sphere the normal is the place itself; all of infinity is one pole.
                let normal = there.normal();
                if norm(normal) > 1e-6 {
                    let n = crate::camera::unit(normal);
                    assert!(dot(n, there.point).abs() > 1.0 - 1e-9);
                }
            }
        }
    }
}
