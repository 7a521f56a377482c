//! Points where pieces touch: a third piece the curve of two others, or two pieces each other.

use super::{STEPS, along, normalised, onto_two, rounding, unit};
use isoform_geom::{Point3, Solid, across, cross, dot, norm, sub};

/// First step along the curve, in shares of the reach, of the secant method for its extremum.
const FIRST: f64 = 0.01;
/// Distance, in shares of the reach, below which the third piece touches the curve.
const TOUCHES: f64 = 1e-9;
/// Distance, in shares of the reach, within which both pieces vanish at a branch point.
const ON_BOTH: f64 = 1e-10;
/// Sine within which their normals are parallel there.
const PARALLEL: f64 = 1e-6;
/// The two relative curvatures must have different signs, and each must differ from 0 by more than
/// this share of the larger.
const INDEFINITE: f64 = 1e-3;
/// Two pieces are one surface if their relative curvature times the reach is below this.
const CURVED: f64 = 1e-6;

/// A point of a curve, its tangent, and the slope of a third piece along it.
struct Slope {
    at: Point3,
    tangent: Point3,
    slope: f64,
}

/// Where a piece `k` touches the curve of `i` and `j`: the distance from `k` along the curve has an
/// extremum there, and is 0. None if the extremum is not 0.
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
        Some(Slope { at, tangent, slope })
    };
    let mut last = slope(p)?;
    let mut here = slope(along(last.at, last.tangent, FIRST * reach))?;
    for _ in 0..STEPS {
        let step = dot(sub(here.at, last.at), here.tangent);
        if here.slope == last.slope || step == 0.0 {
            break;
        }
        let next = -here.slope * step / (here.slope - last.slope);
        if !next.is_finite() || next.abs() > reach {
            return None;
        }
        let ahead = slope(along(here.at, here.tangent, next))?;
        last = std::mem::replace(&mut here, ahead);
        if norm(sub(here.at, p)) > reach {
            return None;
        }
        if next.abs() <= 4.0 * rounding(here.at) + 1e-14 * reach {
            break;
        }
    }
    (normalised(solid, k, here.at)?.d.abs() <= TOUCHES * reach).then_some(here.at)
}

/// A point where two pieces vanish and their normals are parallel, and the directions in which
/// their common curves leave it.
///
/// Gauss–Newton on (dᵢ, dⱼ, e₁·(nᵢ ∓ nⱼ), e₂·(nᵢ ∓ nⱼ)) with e₁, e₂ across nᵢ. Near the point the
/// pieces differ by the quadratic form of their relative curvature; where it is indefinite two
/// curves cross, in the directions where it is zero.
pub(crate) fn branch(
    solid: &dyn Solid,
    [i, j]: [u32; 2],
    p: Point3,
    reach: f64,
) -> Option<(Point3, [Point3; 2])> {
    let mut q = p;
    for _ in 0..STEPS {
        let pair = Pair(shape(solid, i, q)?, shape(solid, j, q)?);
        let move_by = pair.step_to_branch(reach)?;
        let side = pair.side();
        q = along(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        if norm(move_by) <= 64.0 * rounding(q) + 1e-14 * reach {
            let pair = Pair(shape(solid, i, q)?, shape(solid, j, q)?);
            return Some((q, pair.directions(side, reach)?));
        }
    }
    None
}

/// Two surfaces to second order at a point.
struct Pair(Shape, Shape);

impl Pair {
    /// Whether the normals agree (1) or are opposite (−1).
    fn side(&self) -> f64 {
        if dot(self.0.n, self.1.n) < 0.0 {
            -1.0
        } else {
            1.0
        }
    }

    /// The step of Gauss–Newton towards a common point with a common normal.
    fn step_to_branch(&self, reach: f64) -> Option<Point3> {
        let (Self(a, b), side) = (self, self.side());
        let [e1, e2] = across(a.n);
        let difference = along(a.n, b.n, -side);
        let turn = |e: Point3| -> Point3 {
            let (u, v) = (a.turn(e), b.turn(e));
            std::array::from_fn(|m| u[m] - side * v[m])
        };
        // Lengths into the angles' units: a cell is about as large as the reach.
        let w = 1.0 / reach;
        least_squares(&[
            (a.n.map(|v| v * w), a.d * w),
            (b.n.map(|v| v * w), b.d * w),
            (turn(e1), dot(e1, difference)),
            (turn(e2), dot(e2, difference)),
        ])
    }

    /// The directions in which the difference of curvatures is 0, if the pieces vanish here with a
    /// common normal and it is indefinite by a margin.
    fn directions(&self, side: f64, reach: f64) -> Option<[Point3; 2]> {
        let Self(a, b) = self;
        if a.d.abs().max(b.d.abs()) > ON_BOTH * reach || norm(cross(a.n, b.n)) > PARALLEL {
            return None;
        }
        let [e1, e2] = across(a.n);
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
        if !(high > INDEFINITE * r && low < -INDEFINITE * r && r * reach > CURVED) {
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
struct Shape {
    d: f64,
    n: Point3,
    /// H/|∇g|.
    h: [Point3; 3],
}

impl Shape {
    /// How the normal's component along `e` changes with the point.
    fn turn(&self, e: Point3) -> Point3 {
        let e = along(e, self.n, -dot(e, self.n));
        std::array::from_fn(|i| dot(self.h[i], e))
    }
}

/// The piece to second order; none where the gradient vanishes or the Hessian is no number.
fn shape(solid: &dyn Solid, piece: u32, p: Point3) -> Option<Shape> {
    let j = solid.jet(piece, p);
    let length = norm(j.g);
    let h = std::array::from_fn(|r| std::array::from_fn(|c| j.second(r, c) / length));
    (length > 0.0 && length.is_finite() && j.h.iter().all(|v| v.is_finite())).then(|| Shape {
        d: j.v / length,
        n: j.g.map(|v| v / length),
        h,
    })
}

/// The x with the least Σ (rᵢ·x + fᵢ)²; none where the rows do not determine it.
fn least_squares(rows: &[(Point3, f64)]) -> Option<Point3> {
    /// Determinant of the normal equations, in cubes of their trace, below which it is rounding.
    const SINGULAR: f64 = 1e-14;
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
    if det.is_nan() || det.abs() <= SINGULAR * trace * trace * trace {
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
        let saddle = Shape {
            d: 0.0,
            n: [0.0, 0.0, 1.0],
            h: [[-2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0; 3]],
        };
        let plane = Shape {
            d: 0.0,
            n: [0.0, 0.0, 1.0],
            h: [[0.0; 3]; 3],
        };
        let pair = Pair(saddle, plane);
        let [u, v] = pair.directions(pair.side(), 1.0).expect("two curves");
        assert!(dot(u, v).abs() < 1e-14);
        assert!((u[0].abs() - 0.5f64.sqrt()).abs() < 1e-14 && u[2] == 0.0);
    }
}
