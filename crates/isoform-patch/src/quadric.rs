//! The quadric, or torus, that an exact patch lies on, by its name.

use crate::normal_form::Diagonal;
use crate::torus::torus;
use isoform_geom::{
    NormalForm, Point3, Quadric, QuadricKind, RationalPatch, Tangents, dot, norm, sub,
};
use isoform_num::linalg::symmetric_eigen;

/// Samples in each direction.
const SAMPLES: usize = 15;
/// Singular values below this share of the largest are 0: rounding leaves 10⁻¹⁵ or so.
const ZERO: f64 = 1e-13;
/// Columns with a smaller cosine are orthogonal.
const ORTHOGONAL: f64 = 1e-15;
/// Sweeps of rotations; some ten are needed.
const SWEEPS: usize = 40;
/// Two eigenvalues of a quadric's matrix that differ by less than this are the same.
const SAME: f64 = 1e-8;

/// The quadric on which a patch lies to rounding, if it lies on one and on one only, else the
/// torus.
pub fn quadric(patch: &RationalPatch) -> Option<Quadric> {
    let at = |i: usize| i as f64 / (SAMPLES - 1) as f64;
    let samples: Vec<Tangents> = (0..SAMPLES * SAMPLES)
        .map(|k| patch.tangents(at(k / SAMPLES), at(k % SAMPLES)))
        .collect();
    let points: Vec<Point3> = samples.iter().map(|t| t.point).collect();
    let count = points.len() as f64;
    let center: Point3 = std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
    let scale = points
        .iter()
        .map(|p| norm(sub(*p, center)))
        .fold(0.0, f64::max);
    if scale == 0.0 || !scale.is_finite() {
        return None;
    }
    let local: Vec<Point3> = points
        .iter()
        .map(|p| sub(*p, center).map(|v| v / scale))
        .collect();
    if let (Some(normal), true) = null(local.clone(), ZERO) {
        return Some(Quadric::Plane {
            normal,
            offset: dot(normal, center),
        });
    }
    let global = |p: Point3| -> Point3 { std::array::from_fn(|k| center[k] + scale * p[k]) };
    let monomials = local
        .iter()
        .map(|&[x, y, z]| [x * x, y * y, z * z, x * y, y * z, z * x, x, y, z, 1.0]);
    let (Some(a), _) = null(monomials.collect(), ZERO) else {
        let normals: Vec<Point3> = samples
            .iter()
            .map(|t| t.normal())
            .map(|n| n.map(|v| v / norm(n)))
            .collect();
        return match torus(&local, &normals)? {
            Quadric::Torus {
                center,
                axis,
                major,
                minor,
            } => Some(Quadric::Torus {
                center: global(center),
                axis,
                major: scale * major,
                minor: scale * minor,
            }),
            other => Some(other),
        };
    };
    let matrix = [
        a[0],
        0.5 * a[3],
        0.5 * a[5],
        0.5 * a[3],
        a[1],
        0.5 * a[4],
        0.5 * a[5],
        0.5 * a[4],
        a[2],
    ];
    let (mut values, vectors) = symmetric_eigen(&matrix, 3);
    let (mut b, mut constant) = ([0.5 * a[6], 0.5 * a[7], 0.5 * a[8]], a[9]);
    // With a sign that makes two of the three positive.
    if values[1] < 0.0 {
        (b, constant) = (b.map(|v| -v), -constant);
        values.iter_mut().for_each(|v| *v = -*v);
    }
    let size = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let same = |i: usize, j: usize| (values[i] - values[j]).abs() <= SAME * size;
    let vector = |k: usize| -> Point3 { std::array::from_fn(|i| vectors[3 * k + i]) };
    let along: [f64; 3] = std::array::from_fn(|k| dot(vector(k), b));
    // Which eigenvalue stands alone; the other two are the same.
    let alone = (0..3).find(|&k| same((k + 1) % 3, (k + 2) % 3));
    let equation = Diagonal {
        values: [values[0], values[1], values[2]],
        vectors: [0, 1, 2].map(vector),
        along,
        constant,
    };
    let form = equation.normal_form(SAME).map(|f| NormalForm {
        center: global(f.center),
        measures: match f.kind {
            QuadricKind::EllipticCone => f.measures,
            _ => f.measures.map(|m| scale * m),
        },
        ..f
    });
    let other = Quadric::Other {
        form,
        origin: center,
        scale,
        coefficients: a,
    };
    let Some(alone) = alone else {
        return Some(other);
    };
    let (twice, single) = (values[(alone + 1) % 3], values[alone]);
    if twice <= SAME * size {
        return Some(other);
    }
    // The middle in the plane of the two equal ones.
    let (i, j) = ((alone + 1) % 3, (alone + 2) % 3);
    let flat: Point3 =
        std::array::from_fn(|k| -(along[i] * vector(i)[k] + along[j] * vector(j)[k]) / twice);
    let rest = constant - (along[i] * along[i] + along[j] * along[j]) / twice;
    if single.abs() <= SAME * size {
        let is_cylinder = along[alone].abs() <= SAME * size && rest < 0.0;
        return Some(if is_cylinder {
            Quadric::Cylinder {
                point: global(flat),
                axis: vector(alone),
                radius: scale * (-rest / twice).sqrt(),
            }
        } else {
            other
        });
    }
    let middle: Point3 =
        std::array::from_fn(|k| flat[k] - along[alone] / single * vector(alone)[k]);
    let rest = rest - along[alone] * along[alone] / single;
    if same(alone, i) && rest < 0.0 {
        return Some(Quadric::Sphere {
            center: global(middle),
            radius: scale * (-rest / twice).sqrt(),
        });
    }
    if single < 0.0 && rest.abs() <= SAME * size {
        return Some(Quadric::Cone {
            apex: global(middle),
            axis: vector(alone),
            half_angle: (-single / twice).sqrt().atan(),
        });
    }
    Some(other)
}

/// The unit vector a with a·m = 0 for all rows m, if there is one, and whether it is the only one;
/// singular values below the share `zero` of the largest are 0.
///
/// By Hestenes' one-sided Jacobi method: rotations of the columns of the matrix until they are
/// orthogonal. Moments would square the small singular values, and half of the digits would be
/// lost.
pub(crate) fn null<const N: usize>(mut rows: Vec<[f64; N]>, zero: f64) -> (Option<[f64; N]>, bool) {
    let mut v: [[f64; N]; N] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..N {
            for q in p + 1..N {
                let (mut pp, mut qq, mut pq) = (0.0, 0.0, 0.0);
                for r in &rows {
                    (pp, qq, pq) = (pp + r[p] * r[p], qq + r[q] * r[q], pq + r[p] * r[q]);
                }
                if pq.abs() <= ORTHOGONAL * (pp * qq).sqrt() {
                    continue;
                }
                rotated = true;
                let zeta = (qq - pp) / (2.0 * pq);
                let t = if zeta >= 0.0 { 1.0 } else { -1.0 }
                    / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let c = 1.0 / (1.0 + t * t).sqrt();
                let s = c * t;
                for r in rows.iter_mut().chain(v.iter_mut()) {
                    (r[p], r[q]) = (c * r[p] - s * r[q], s * r[p] + c * r[q]);
                }
            }
        }
        if !rotated {
            break;
        }
    }
    let sizes: [f64; N] =
        std::array::from_fn(|k| rows.iter().map(|r| r[k] * r[k]).sum::<f64>().sqrt());
    let most = sizes.iter().fold(0.0f64, |m, v| m.max(*v));
    let small: Vec<usize> = (0..N).filter(|&k| sizes[k] <= zero * most).collect();
    match small.as_slice() {
        &[k] => (Some(std::array::from_fn(|i| v[i][k])), true),
        _ => (None, false),
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

    /// Arcs about a slanted axis of circles of radius 0.2 about a circle of radius 0.7.
    #[test]
    fn tori_are_named() {
        let s = 0.5f64.sqrt();
        let arc = [[1.0, 0.0, 1.0], [s, s, s], [0.0, 1.0, 1.0]];
        // About the z axis, then turned: x towards z by 3/5, 4/5, then y towards z the same.
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
