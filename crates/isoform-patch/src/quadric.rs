//! Quadric or torus on which an exact patch lies.
//!
//! The equation of second degree through samples is the null vector of their monomials. Spheres,
//! cylinders and cones have two eigenvalues that are equal up to rounding; their centres and radii
//! are computed with one of these for both, so that the eigenvectors, which rounding then
//! determines, do not matter. All other quadrics are classified by their normal form.

use crate::normal_form::Diagonal;
use crate::null::null;
use crate::places::{grid, normalized};
use crate::torus::torus;
use isoform_geom::{
    NormalForm, Point3, Quadric, QuadricKind, RationalPatch, Tangents, dot, norm, sub,
};
use isoform_num::linalg::symmetric_eigen;

/// Fraction of the largest singular value below which singular values count as 0: rounding leaves
/// about 10⁻¹⁵.
const SINGULAR_VALUE_TOLERANCE: f64 = 1e-13;
/// Fraction of the largest eigenvalue below which differences of eigenvalues of a quadric's matrix
/// count as 0.
const EIGENVALUE_TOLERANCE: f64 = 1e-8;

/// Returns the quadric on which a patch lies to rounding if that is unique, else the torus; `None`
/// if it lies on neither.
///
/// ```
/// use isoform_geom::{Quadric, RationalPatch};
/// use isoform_patch::quadric;
///
/// let flat = RationalPatch::planar((2, 2), [0.0, 0.0, 3.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
/// let Some(Quadric::Plane { normal, offset }) = quadric(&flat) else {
///     panic!("it is a plane")
/// };
/// assert!((offset / normal[2] - 3.0).abs() < 1e-12);
///
/// // z = x y
/// let control = vec![[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0], [1.0; 4]];
/// let saddle = RationalPatch::new((1, 1), control).expect("four points");
/// assert_eq!(quadric(&saddle).map(|q| q.name()), Some("hyperbolic paraboloid"));
/// ```
pub fn quadric(patch: &RationalPatch) -> Option<Quadric> {
    let samples: Vec<Tangents> = grid(15).map(|(u, v)| patch.tangents(u, v)).collect();
    let points: Vec<Point3> = samples.iter().map(|t| t.point).collect();
    let normals: Vec<Point3> = samples.iter().map(|t| normalized(t.normal())).collect();
    quadric_through(&points, &normals)
}

/// Returns the quadric through points, to rounding, if that is unique, else the torus that also has
/// the given normals; `None` if there is neither. Normals have length 1; their signs do not matter.
///
/// ```
/// use isoform_patch::quadric_through;
///
/// let on = |i: i32| {
///     let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 20.0);
///     [2.0 * t.cos(), 2.0 * t.sin(), z]
/// };
/// let points: Vec<_> = (0..40).map(on).collect();
/// let normals: Vec<_> = points.iter().map(|p| [0.5 * p[0], 0.5 * p[1], 0.0]).collect();
/// assert_eq!(quadric_through(&points, &normals).map(|q| q.name()), Some("cylinder"));
/// ```
pub fn quadric_through(points: &[Point3], normals: &[Point3]) -> Option<Quadric> {
    let frame = SampleFrame::around(points)?;
    let local: Vec<Point3> = points.iter().map(|p| frame.local(*p)).collect();
    if let Some(normal) = null(local.clone(), SINGULAR_VALUE_TOLERANCE) {
        return Some(Quadric::Plane {
            normal,
            offset: dot(normal, frame.center),
        });
    }
    let monomials = local
        .iter()
        .map(|&[x, y, z]| [x * x, y * y, z * z, x * y, y * z, z * x, x, y, z, 1.0]);
    if let Some(coefficients) = null(monomials.collect(), SINGULAR_VALUE_TOLERANCE) {
        let equation = Equation::new(coefficients);
        let named = equation.of_revolution(&frame);
        return named.or_else(|| Some(equation.by_normal_form(&frame)));
    }
    Some(frame.torus_out(torus(&local, normals)?))
}

/// Coordinates in which samples lie around the origin and within the unit sphere.
struct SampleFrame {
    center: Point3,
    scale: f64,
}

impl SampleFrame {
    /// Computes the frame of samples; `None` if they are one point or not finite.
    fn around(points: &[Point3]) -> Option<Self> {
        let count = points.len() as f64;
        let center: Point3 =
            std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
        let far = points.iter().map(|p| norm(sub(*p, center)));
        let scale = far.fold(0.0, f64::max);
        (scale != 0.0 && scale.is_finite()).then_some(Self { center, scale })
    }

    fn local(&self, p: Point3) -> Point3 {
        sub(p, self.center).map(|v| v / self.scale)
    }

    fn out(&self, p: Point3) -> Point3 {
        std::array::from_fn(|k| self.center[k] + self.scale * p[k])
    }

    fn torus_out(&self, torus: Quadric) -> Quadric {
        match torus {
            Quadric::Torus {
                center,
                axis,
                major,
                minor,
            } => Quadric::Torus {
                center: self.out(center),
                axis,
                major: self.scale * major,
                minor: self.scale * minor,
            },
            other => other,
        }
    }

    fn form_out(&self, form: NormalForm) -> NormalForm {
        NormalForm {
            center: self.out(form.center),
            measures: match form.kind {
                QuadricKind::EllipticCone => form.measures,
                _ => form.measures.map(|m| self.scale * m),
            },
            ..form
        }
    }
}

/// Equation of second degree in its principal axes, with the sign that makes two of three
/// eigenvalues positive.
struct Equation {
    coefficients: [f64; 10],
    diagonal: Diagonal,
}

impl Equation {
    /// Diagonalises an equation given by its coefficients of x², y², z², xy, yz, zx, x, y, z and 1.
    fn new(a: [f64; 10]) -> Self {
        let [xy, yz, zx] = [a[3], a[4], a[5]].map(|v| 0.5 * v);
        let matrix = [a[0], xy, zx, xy, a[1], yz, zx, yz, a[2]];
        let (mut values, vectors) = symmetric_eigen(&matrix, 3);
        let (mut b, mut constant) = ([0.5 * a[6], 0.5 * a[7], 0.5 * a[8]], a[9]);
        if values[1] < 0.0 {
            (b, constant) = (b.map(|v| -v), -constant);
            values.iter_mut().for_each(|v| *v = -*v);
        }
        let vector = |k: usize| -> Point3 { std::array::from_fn(|i| vectors[3 * k + i]) };
        Self {
            coefficients: a,
            diagonal: Diagonal {
                values: [values[0], values[1], values[2]],
                vectors: [0, 1, 2].map(vector),
                along: std::array::from_fn(|k| dot(vector(k), b)),
                constant,
            },
        }
    }

    /// Returns the largest |λₖ|.
    fn size(&self) -> f64 {
        let values = self.diagonal.values.iter();
        values.fold(0.0f64, |m, v| m.max(v.abs()))
    }

    fn by_normal_form(&self, frame: &SampleFrame) -> Quadric {
        Quadric::Other {
            form: self
                .diagonal
                .normal_form(EIGENVALUE_TOLERANCE)
                .map(|f| frame.form_out(f)),
            origin: frame.center,
            scale: frame.scale,
            coefficients: self.coefficients,
        }
    }

    /// Returns the sphere, cylinder or cone; `None` if the quadric is none of these.
    fn of_revolution(&self, frame: &SampleFrame) -> Option<Quadric> {
        let size = self.size();
        let is_zero = |v: f64| v.abs() <= EIGENVALUE_TOLERANCE * size;
        let values = self.diagonal.values;
        let same = |i: usize, j: usize| is_zero(values[i] - values[j]);
        // Index of the eigenvalue that differs from the other two, which are equal.
        let alone = (0..3).find(|&k| same((k + 1) % 3, (k + 2) % 3))?;
        let reduced = ReducedEquation::new(&self.diagonal, alone);
        if reduced.twice <= EIGENVALUE_TOLERANCE * size {
            return None;
        }
        if is_zero(reduced.single) {
            let is_cylinder = is_zero(self.diagonal.along[alone]) && reduced.rest < 0.0;
            return is_cylinder.then(|| reduced.cylinder(frame));
        }
        let centred = reduced.with_center();
        if same(alone, (alone + 1) % 3) && centred.rest < 0.0 {
            return Some(centred.sphere(frame));
        }
        let is_cone = centred.single < 0.0 && is_zero(centred.rest);
        is_cone.then(|| centred.cone(frame))
    }
}

/// Equation with two equal eigenvalues, about a point.
struct ReducedEquation {
    point: Point3,
    /// Eigenvector of the single eigenvalue.
    axis: Point3,
    /// Double eigenvalue.
    twice: f64,
    /// Single eigenvalue.
    single: f64,
    /// Half the coefficient of degree 1 along the axis.
    along: f64,
    /// Constant term.
    rest: f64,
}

impl ReducedEquation {
    /// Moves the origin to the point that has no terms of degree 1 in the plane of the double
    /// eigenvalue.
    fn new(equation: &Diagonal, alone: usize) -> Self {
        let (i, j) = ((alone + 1) % 3, (alone + 2) % 3);
        let Diagonal {
            values,
            vectors,
            along,
            constant,
        } = equation;
        let twice = values[i];
        Self {
            point: std::array::from_fn(|k| {
                -(along[i] * vectors[i][k] + along[j] * vectors[j][k]) / twice
            }),
            axis: vectors[alone],
            twice,
            single: values[alone],
            along: along[alone],
            rest: constant - (along[i] * along[i] + along[j] * along[j]) / twice,
        }
    }

    /// Moves the origin to the point that has no terms of degree 1.
    fn with_center(self) -> Self {
        Self {
            point: std::array::from_fn(|k| self.point[k] - self.along / self.single * self.axis[k]),
            rest: self.rest - self.along * self.along / self.single,
            ..self
        }
    }

    fn radius(&self, frame: &SampleFrame) -> f64 {
        frame.scale * (-self.rest / self.twice).sqrt()
    }

    fn cylinder(&self, frame: &SampleFrame) -> Quadric {
        Quadric::Cylinder {
            point: frame.out(self.point),
            axis: self.axis,
            radius: self.radius(frame),
        }
    }

    fn sphere(&self, frame: &SampleFrame) -> Quadric {
        Quadric::Sphere {
            center: frame.out(self.point),
            radius: self.radius(frame),
        }
    }

    fn cone(&self, frame: &SampleFrame) -> Quadric {
        Quadric::Cone {
            apex: frame.out(self.point),
            axis: self.axis,
            half_angle: (-self.single / self.twice).sqrt().atan(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Point3, b: Point3) -> bool {
        norm(sub(a, b)) < 1e-12
    }

    #[test]
    fn planes_and_cylinders_and_cones_are_named() {
        let plane =
            RationalPatch::planar((2, 2), [0.0, 0.0, 0.7], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let Some(Quadric::Plane { normal, offset }) = quadric(&plane) else {
            panic!("{:?}", quadric(&plane))
        };
        assert!(normal[2].abs() > 1.0 - 1e-14 && (offset * normal[2] - 0.7).abs() < 1e-12);
        // A quarter of a circle, of radius r0 below and r1 above.
        let s = 0.5f64.sqrt();
        let ruled = |r0: f64, r1: f64| {
            let arc = |r: f64, z: f64| {
                [
                    [r + 3.0, 1.0, z, 1.0],
                    [s * (r + 3.0), s * (r + 1.0), s * z, s],
                    [3.0, r + 1.0, z, 1.0],
                ]
            };
            RationalPatch::new((1, 2), [arc(r0, 0.0), arc(r1, 1.0)].concat()).expect("a patch")
        };
        let Some(Quadric::Cylinder {
            point,
            axis,
            radius,
        }) = quadric(&ruled(0.4, 0.4))
        else {
            panic!("no cylinder")
        };
        assert!(
            (radius - 0.4).abs() < 1e-12
                && (axis[2].abs() - 1.0).abs() < 1e-12
                && close([point[0], point[1], 0.0], [3.0, 1.0, 0.0])
        );
        let Some(Quadric::Cone {
            apex, half_angle, ..
        }) = quadric(&ruled(0.25, 0.5))
        else {
            panic!("no cone")
        };
        assert!(
            close(apex, [3.0, 1.0, -1.0]) && (half_angle - 0.25f64.atan()).abs() < 1e-12,
            "{apex:?}, {half_angle}"
        );
    }

    /// Arcs around a slanted axis of circles of radius 0.2 around a circle of radius 0.7.
    #[test]
    fn tori_are_named() {
        let s = 0.5f64.sqrt();
        let arc = [[1.0, 0.0, 1.0], [s, s, s], [0.0, 1.0, 1.0]];
        // Around the z axis, then rotated by the angle with sine 3/5 and cosine 4/5: x towards z,
        // then y towards z.
        let mut control = Vec::new();
        for [c, d, w] in arc {
            for [e, f, v] in arc {
                let out = 0.7 * v + 0.2 * e;
                let p = [out * c, out * d, 0.2 * f * w];
                let p = [0.8 * p[0] - 0.6 * p[2], p[1], 0.6 * p[0] + 0.8 * p[2]];
                let p = [p[0], 0.8 * p[1] - 0.6 * p[2], 0.6 * p[1] + 0.8 * p[2]];
                control.push([p[0] + 0.1 * v * w, p[1] - 0.4 * v * w, p[2], v * w]);
            }
        }
        let patch = RationalPatch::new((2, 2), control).expect("a patch");
        let Some(Quadric::Torus {
            center,
            axis,
            major,
            minor,
        }) = quadric(&patch)
        else {
            panic!("{:?}", quadric(&patch))
        };
        let sign = axis[2].signum();
        assert!(
            close(axis.map(|v| sign * v), [-0.6, -0.48, 0.64]) && close(center, [0.1, -0.4, 0.0]),
            "{axis:?}, {center:?}"
        );
        assert!(
            (major - 0.7).abs() < 1e-12 && (minor - 0.2).abs() < 1e-12,
            "{major}, {minor}"
        );
    }

    #[test]
    fn other_surfaces_are_none_or_other() {
        let mut bent = RationalPatch::planar((3, 3), [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        bent.control_mut()[5][2] = 0.5;
        assert_eq!(quadric(&bent), None);
        // z = x y
        let saddle = RationalPatch::new(
            (1, 1),
            vec![
                [0.0, 0.0, 0.0, 1.0],
                [0.0, 1.0, 0.0, 1.0],
                [1.0, 0.0, 0.0, 1.0],
                [1.0, 1.0, 1.0, 1.0],
            ],
        );
        assert_eq!(
            quadric(&saddle.expect("a patch")).map(|q| q.name()),
            Some("hyperbolic paraboloid")
        );
    }
}
