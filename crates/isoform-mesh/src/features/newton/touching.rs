//! Points where a third piece touches the curve of two others, or where two pieces touch.

use super::{MAX_FEATURE_NEWTON_STEPS, add_scaled, normalised, onto_two, rounding, unit};
use isoform_geom::{Point3, Solid, cross, dot, norm, orthonormal_complement, sub};

/// A point of a curve, its tangent, and the slope of a third piece along it.
struct CurveSlope {
    at: Point3,
    tangent: Point3,
    slope: f64,
}

/// Finds the point where a piece `k` touches the curve of `i` and `j`: an extremum of the distance
/// from `k` along the curve. `None` if the distance is not 0 there.
pub(crate) fn onto_touching(
    solid: &dyn Solid,
    pair: [u32; 2],
    k: u32,
    p: Point3,
    reach: f64,
) -> Option<Point3> {
    let slope = |q: Point3| {
        let (at, [a, b]) = onto_two(solid, pair, q, reach)?;
        let tangent = unit(cross(a, b));
        let slope = dot(tangent, normalised(solid, k, at)?.n);
        Some(CurveSlope { at, tangent, slope })
    };
    let mut last = slope(p)?;
    // First step of the secant method.
    let mut here = slope(add_scaled(last.at, last.tangent, 0.01 * reach))?;
    for _ in 0..MAX_FEATURE_NEWTON_STEPS {
        let step = dot(sub(here.at, last.at), here.tangent);
        if here.slope == last.slope || step == 0.0 {
            break;
        }
        let next = -here.slope * step / (here.slope - last.slope);
        if !next.is_finite() || next.abs() > reach {
            return None;
        }
        let ahead = slope(add_scaled(here.at, here.tangent, next))?;
        last = std::mem::replace(&mut here, ahead);
        if norm(sub(here.at, p)) > reach {
            return None;
        }
        if next.abs() <= 4.0 * rounding(here.at) + 1e-14 * reach {
            break;
        }
    }
    // At a larger distance the third piece misses the curve.
    (normalised(solid, k, here.at)?.d.abs() <= 1e-9 * reach).then_some(here.at)
}

/// Finds a point where two pieces vanish with parallel normals, and the directions in which their
/// common curves leave it.
///
/// Gauss–Newton on (dᵢ, dⱼ, e₁·(nᵢ ∓ nⱼ), e₂·(nᵢ ∓ nⱼ)) with e₁, e₂ orthogonal to nᵢ. Near the
/// point the pieces differ by the quadratic form of their relative curvature; where it is
/// indefinite two curves cross, in the directions where it is zero.
pub(crate) fn branch(
    solid: &dyn Solid,
    [i, j]: [u32; 2],
    p: Point3,
    reach: f64,
) -> Option<(Point3, [Point3; 2])> {
    let mut q = p;
    for _ in 0..MAX_FEATURE_NEWTON_STEPS {
        let pair = SurfacePair(shape(solid, i, q)?, shape(solid, j, q)?);
        let move_by = pair.step_to_branch(reach)?;
        let side = pair.side();
        q = add_scaled(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        if norm(move_by) <= 64.0 * rounding(q) + 1e-14 * reach {
            let pair = SurfacePair(shape(solid, i, q)?, shape(solid, j, q)?);
            return Some((q, pair.directions(side, reach)?));
        }
    }
    None
}

/// Two surfaces to second order at a point.
struct SurfacePair(QuadraticSurface, QuadraticSurface);

impl SurfacePair {
    /// Returns 1 if the normals agree, −1 if they are opposite.
    fn side(&self) -> f64 {
        if dot(self.0.n, self.1.n) < 0.0 {
            -1.0
        } else {
            1.0
        }
    }

    /// Returns the Gauss–Newton step towards a common point with a common normal.
    fn step_to_branch(&self, reach: f64) -> Option<Point3> {
        let (Self(a, b), side) = (self, self.side());
        let [e1, e2] = orthonormal_complement(a.n);
        let difference = add_scaled(a.n, b.n, -side);
        let turn = |e: Point3| -> Point3 {
            let (u, v) = (a.turn(e), b.turn(e));
            std::array::from_fn(|m| u[m] - side * v[m])
        };
        // Scale of lengths relative to angles: a cell is about as large as the reach.
        let w = 1.0 / reach;
        least_squares(&[
            (a.n.map(|v| v * w), a.d * w),
            (b.n.map(|v| v * w), b.d * w),
            (turn(e1), dot(e1, difference)),
            (turn(e2), dot(e2, difference)),
        ])
    }

    /// Returns the directions in which the difference of curvatures is 0, if the pieces vanish here
    /// with a common normal and it is indefinite by a margin.
    fn directions(&self, side: f64, reach: f64) -> Option<[Point3; 2]> {
        let Self(a, b) = self;
        // Both pieces vanish here, with parallel normals.
        if a.d.abs().max(b.d.abs()) > 1e-10 * reach || norm(cross(a.n, b.n)) > 1e-6 {
            return None;
        }
        let [e1, e2] = orthonormal_complement(a.n);
        let form = |u: Point3, v: Point3| dot(u, a.turn(v)) - side * dot(u, b.turn(v));
        let (xx, xy, yy) = (
            form(e1, e1),
            0.5 * (form(e1, e2) + form(e2, e1)),
            form(e2, e2),
        );
        // Eigenvalues m ± r.
        let m = 0.5 * (xx + yy);
        let r = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        let (high, low) = (m + r, m - r);
        // The relative curvatures differ in sign, each by a margin from 0. Pieces with less
        // relative curvature over the reach are one surface.
        if !(high > 1e-3 * r && low < -1e-3 * r && r * reach > 1e-6) {
            return None;
        }
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let main: Point3 = std::array::from_fn(|k| angle.cos() * e1[k] + angle.sin() * e2[k]);
        let other = cross(a.n, main);
        let (x, y) = ((-low).sqrt(), high.sqrt());
        Some([1.0, -1.0].map(|s| unit(std::array::from_fn(|k| x * main[k] + s * y * other[k]))))
    }
}

/// A surface to second order.
struct QuadraticSurface {
    d: f64,
    n: Point3,
    /// H/|∇g|.
    h: [Point3; 3],
}

impl QuadraticSurface {
    /// Returns the gradient of the normal's component along `e` by the point.
    fn turn(&self, e: Point3) -> Point3 {
        let e = add_scaled(e, self.n, -dot(e, self.n));
        std::array::from_fn(|i| dot(self.h[i], e))
    }
}

/// Returns the piece to second order; `None` where the gradient vanishes or the Hessian is not
/// finite.
fn shape(solid: &dyn Solid, piece: u32, p: Point3) -> Option<QuadraticSurface> {
    let j = solid.jet(piece, p);
    let length = norm(j.g);
    let h = std::array::from_fn(|r| std::array::from_fn(|c| j.second(r, c) / length));
    (length > 0.0 && length.is_finite() && j.h.iter().all(|v| v.is_finite())).then(|| {
        QuadraticSurface {
            d: j.v / length,
            n: j.g.map(|v| v / length),
            h,
        }
    })
}

/// Returns the x that minimises Σ (rᵢ·x + fᵢ)²; `None` if the rows do not determine it.
fn least_squares(rows: &[(Point3, f64)]) -> Option<Point3> {
    let (mut m, mut b) = ([[0.0; 3]; 3], [0.0; 3]);
    for (r, f) in rows {
        for i in 0..3 {
            for j in 0..3 {
                m[i][j] += r[i] * r[j];
            }
            b[i] -= r[i] * f;
        }
    }
    let minors = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    let det = dot(m[0], minors[0]);
    let trace = m[0][0] + m[1][1] + m[2][2];
    // Smaller determinants of the normal equations are rounding.
    if det.is_nan() || det.abs() <= 1e-14 * trace * trace * trace {
        return None;
    }
    Some(std::array::from_fn(|i| {
        (minors[0][i] * b[0] + minors[1][i] * b[1] + minors[2][i] * b[2]) / det
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_of_more_rows_than_unknowns() {
        // x = 1 and x = 3 are answered by 2.
        let rows = [
            ([1.0, 0.0, 0.0], -1.0),
            ([1.0, 0.0, 0.0], -3.0),
            ([0.0, 2.0, 0.0], 1.0),
            ([0.0, 0.0, 1.0], 0.0),
        ];
        let x = least_squares(&rows).expect("three directions");
        assert!((x[0] - 2.0).abs() < 1e-14 && (x[1] + 0.5).abs() < 1e-14 && x[2].abs() < 1e-14);
        assert!(least_squares(&rows[..3]).is_none());
    }

    #[test]
    fn saddle_and_plane_cross_in_the_diagonals() {
        // z = x² − y² and z = 0 at the origin.
        let saddle = QuadraticSurface {
            d: 0.0,
            n: [0.0, 0.0, 1.0],
            h: [[-2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0; 3]],
        };
        let plane = QuadraticSurface {
            d: 0.0,
            n: [0.0, 0.0, 1.0],
            h: [[0.0; 3]; 3],
        };
        let pair = SurfacePair(saddle, plane);
        let [u, v] = pair.directions(pair.side(), 1.0).expect("two curves");
        assert!(dot(u, v).abs() < 1e-14);
        assert!((u[0].abs() - 0.5f64.sqrt()).abs() < 1e-14 && u[2] == 0.0);
    }
}
