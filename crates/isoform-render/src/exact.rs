//! Exact points and normals of the patches and maps that triangles approximate.

use crate::camera::{Ray, along};
use isoform::geom::{Point3, RationalPatch, Tangents, cross, dot, norm, sub};
use isoform::tess::{Map, Surface as MapSurface};

/// Signs of s and t in the four unit triangles of the parameter plane.
const QUADRANTS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];

/// Surface with parameters.
#[derive(Clone, Debug)]
pub(crate) enum Exact {
    /// Patches, by index.
    Patches(Vec<RationalPatch>),
    /// Unit triangles of a map, by index.
    Map(Forms),
}

impl Exact {
    /// Returns the point with given parameters, and its derivatives.
    pub(crate) fn at(&self, chart: u32, [u, v]: [f64; 2]) -> Tangents {
        match self {
            Self::Patches(patches) => patches[chart as usize].tangents(u, v),
            Self::Map(forms) => forms.at(chart as usize, u, v),
        }
    }

    /// Returns the distance along a ray and the normal at its intersection with the surface near
    /// the parameters `start`, by Newton's method for o + t d = p(u, v); `None` if it does not
    /// converge to a point of the patch or triangle.
    pub(crate) fn onto(&self, ray: &Ray, chart: u32, start: [f64; 2]) -> Option<(f64, Point3)> {
        let mut at = start;
        let mut now = self.at(chart, at);
        for _ in 0..8 {
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
        // Parameters end at the sides of patches, where the triangles end, too.
        let is_on = at.iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(v));
        (is_on && size > 0.0 && size.is_finite() && t.is_finite())
            .then(|| (t, normal.map(|v| v / size)))
    }
}

/// Four forms of a map over the projective plane.
#[derive(Clone, Debug)]
pub(crate) struct Forms {
    /// Terms of X, Y, Z and W in s and t: both exponents and the coefficient.
    terms: [Vec<([i32; 2], f64)>; 4],
    degree: i32,
    /// Rows of the matrix that maps coordinates of the unit triangles to coordinates of the map.
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

    /// Evaluates a form at (s : t : w), with its three derivatives.
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

    /// Returns the point with parameters u and v of a unit triangle, and its derivatives.
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

/// Returns the normal of a triangle, whose length is twice the area.
pub(crate) fn facet_normal([a, b, c]: [Point3; 3]) -> Point3 {
    cross(sub(b, a), sub(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform::tess::{MapOptions, TriangulateOptions};
    use isoform::{Control, triangulate_map};

    #[test]
    fn places_of_a_map_are_those_of_its_triangles() {
        let texts = ["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"];
        let map = Map::parse(texts, MapOptions::default()).expect("a map");
        let options = TriangulateOptions::around(2.into());
        let (surface, _) = triangulate_map(&map, &options, &Control::default()).expect("triangles");
        let exact = Exact::Map(Forms::new(&map, &surface));
        for (k, triangle) in surface.triangles.iter().enumerate().step_by(7) {
            for (corner, uv) in triangle.iter().zip(&surface.corners[k]) {
                let there = exact.at(u32::from(surface.charts[k]), *uv);
                let away = norm(sub(there.point, surface.points[*corner as usize]));
                assert!(away < 1e-9, "{away}");
                // The normal of the unit sphere is the point itself; the line at infinity maps to
                // one pole.
                let normal = there.normal();
                if norm(normal) > 1e-6 {
                    let n = crate::camera::unit(normal);
                    assert!(dot(n, there.point).abs() > 1.0 - 1e-9);
                }
            }
        }
    }
}
