//! Newton's method onto one, two and three pieces at once.
//!
//! Pieces count by their distance to first order, d = g/|∇g|; steps are the shortest ones that make
//! all linearised distances zero.

use isoform_geom::{Point3, Solid, across, cross, dot, norm, sub};

const STEPS: usize = 40;

/// A piece near its zero set, to first order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distance {
    /// g/|∇g|.
    pub(crate) d: f64,
    /// ∇g/|∇g|.
    pub(crate) n: Point3,
}

/// a + s b.
pub(crate) fn along(a: Point3, b: Point3, s: f64) -> Point3 {
    std::array::from_fn(|i| a[i] + s * b[i])
}

pub(crate) fn unit(a: Point3) -> Point3 {
    let l = norm(a);
    if l > 0.0 { a.map(|v| v / l) } else { a }
}

/// None where the gradient vanishes or is no number.
pub(crate) fn normalised(solid: &dyn Solid, piece: u32, p: Point3) -> Option<Distance> {
    let (v, g) = solid.gradient(piece, p);
    let length = norm(g);
    (length > 0.0 && length.is_finite() && v.is_finite()).then(|| Distance {
        d: v / length,
        n: g.map(|c| c / length),
    })
}

/// Rounding of a point's coordinates.
pub(crate) fn rounding(p: Point3) -> f64 {
    f64::EPSILON * p.into_iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// The point of one piece near `p`, at most `reach` away.
pub(crate) fn onto_one(solid: &dyn Solid, piece: u32, p: Point3, reach: f64) -> Option<Point3> {
    let mut q = p;
    for _ in 0..STEPS {
        let g = normalised(solid, piece, q)?;
        q = along(q, g.n, -g.d);
        if norm(sub(q, p)) > reach {
            return None;
        }
        if g.d.abs() <= 2.0 * rounding(q) + 1e-15 * reach {
            return Some(q);
        }
    }
    None
}

/// A common point of two pieces near `p`, at most `reach` away, and their normals there.
pub(crate) fn onto_two(
    solid: &dyn Solid,
    [i, j]: [u32; 2],
    p: Point3,
    reach: f64,
) -> Option<(Point3, [Point3; 2])> {
    let mut q = p;
    for step in 0..STEPS {
        let (a, b) = (normalised(solid, i, q)?, normalised(solid, j, q)?);
        let c = dot(a.n, b.n);
        let sine = norm(cross(a.n, b.n));
        if sine < 1e-7 {
            return None;
        }
        let s2 = sine * sine;
        let (x, y) = ((c * b.d - a.d) / s2, (c * a.d - b.d) / s2);
        let mut move_by: Point3 = std::array::from_fn(|k| x * a.n[k] + y * b.n[k]);
        let length = norm(move_by);
        if length > reach {
            move_by = move_by.map(|v| v * reach / length);
        }
        q = along(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        let noise = (2.0 * rounding(q) + 1e-16 * reach) / sine;
        if length <= noise || (step > 8 && length <= 32.0 * noise) {
            return Some((q, [a.n, b.n]));
        }
    }
    None
}

/// A common point of three pieces near `p`, at most `reach` away, and the determinant of their
/// normals there.
///
/// Where the pieces touch each other the determinant is about 0 and the point good to half the
/// digits.
pub(crate) fn onto_three(
    solid: &dyn Solid,
    [i, j, k]: [u32; 3],
    p: Point3,
    reach: f64,
) -> Option<(Point3, f64)> {
    let mut q = p;
    for step in 0..STEPS {
        let (a, b, c) = (
            normalised(solid, i, q)?,
            normalised(solid, j, q)?,
            normalised(solid, k, q)?,
        );
        let (bc, ca, ab) = (cross(b.n, c.n), cross(c.n, a.n), cross(a.n, b.n));
        let det = dot(a.n, bc);
        if det.abs() < 1e-9 {
            // The last steps before were short where this is a touching point.
            let far = [a.d, b.d, c.d]
                .into_iter()
                .fold(0.0, |m: f64, d| m.max(d.abs()));
            return (step > 0 && far < 1e-10 * reach).then_some((q, det));
        }
        let mut move_by: Point3 =
            std::array::from_fn(|m| -(a.d * bc[m] + b.d * ca[m] + c.d * ab[m]) / det);
        let length = norm(move_by);
        if length > reach {
            move_by = move_by.map(|v| v * reach / length);
        }
        q = along(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        let noise = (4.0 * rounding(q) + 1e-16 * reach) / det.abs();
        if length <= noise || (step > 12 && length <= 64.0 * noise) {
            return Some((q, det));
        }
    }
    None
}

/// Where a piece `k` touches the curve of `i` and `j`: there its distance along the curve has an
/// extremum that is 0. None if it is not.
pub(crate) fn onto_touching(
    solid: &dyn Solid,
    pair: [u32; 2],
    k: u32,
    p: Point3,
    reach: f64,
) -> Option<Point3> {
    let slope = |q: Point3| -> Option<(Point3, Point3, f64)> {
        let (q, [a, b]) = onto_two(solid, pair, q, reach)?;
        let t = unit(cross(a, b));
        Some((q, t, dot(t, normalised(solid, k, q)?.n)))
    };
    let (mut q0, t, mut f0) = slope(p)?;
    let (mut q1, mut t1, mut f1) = slope(along(q0, t, 0.01 * reach))?;
    for _ in 0..STEPS {
        let step = dot(sub(q1, q0), t1);
        if f1 == f0 || step == 0.0 {
            break;
        }
        let next = -f1 * step / (f1 - f0);
        if !next.is_finite() || next.abs() > reach {
            return None;
        }
        (q0, f0) = (q1, f1);
        (q1, t1, f1) = slope(along(q1, t1, next))?;
        if norm(sub(q1, p)) > reach {
            return None;
        }
        if next.abs() <= 4.0 * rounding(q1) + 1e-14 * reach {
            break;
        }
    }
    (normalised(solid, k, q1)?.d.abs() <= 1e-9 * reach).then_some(q1)
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
        let (a, b) = (shape(solid, i, q)?, shape(solid, j, q)?);
        let side = if dot(a.n, b.n) < 0.0 { -1.0 } else { 1.0 };
        let [e1, e2] = across(a.n);
        let difference = along(a.n, b.n, -side);
        let turn = |e: Point3| -> Point3 {
            let (u, v) = (a.turn(e), b.turn(e));
            std::array::from_fn(|m| u[m] - side * v[m])
        };
        // Lengths into the angles' units: a cell is about as large as the reach.
        let w = 1.0 / reach;
        let rows = [
            (a.n.map(|v| v * w), a.d * w),
            (b.n.map(|v| v * w), b.d * w),
            (turn(e1), dot(e1, difference)),
            (turn(e2), dot(e2, difference)),
        ];
        let move_by = least_squares(&rows)?;
        q = along(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        if norm(move_by) <= 64.0 * rounding(q) + 1e-14 * reach {
            let (a, b) = (shape(solid, i, q)?, shape(solid, j, q)?);
            if a.d.abs().max(b.d.abs()) > 1e-10 * reach || norm(cross(a.n, b.n)) > 1e-6 {
                return None;
            }
            let [e1, e2] = across(a.n);
            let form = |u: Point3, v: Point3| dot(u, a.turn(v)) - side * dot(u, b.turn(v));
            let (xx, xy, yy) = (
                form(e1, e1),
                0.5 * (form(e1, e2) + form(e2, e1)),
                form(e2, e2),
            );
            // Eigenvalues m ± r; indefinite where they differ in sign, by a margin.
            let (m, r) = (
                0.5 * (xx + yy),
                (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt(),
            );
            let (high, low) = (m + r, m - r);
            if !(high > 1e-3 * r && low < -1e-3 * r && r * reach > 1e-6) {
                return None;
            }
            let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
            let main: Point3 = std::array::from_fn(|k| angle.cos() * e1[k] + angle.sin() * e2[k]);
            let other = cross(a.n, main);
            let (x, y) = ((-low).sqrt(), high.sqrt());
            return Some((
                q,
                [1.0, -1.0].map(|s| unit(std::array::from_fn(|k| x * main[k] + s * y * other[k]))),
            ));
        }
    }
    None
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
pub(crate) fn least_squares(rows: &[(Point3, f64)]) -> Option<Point3> {
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
    if det.is_nan() || det.abs() <= 1e-14 * trace * trace * trace {
        return None;
    }
    Some(std::array::from_fn(|i| {
        (minors[0][i] * b[0] + minors[1][i] * b[1] + minors[2][i] * b[2]) / det
    }))
}
