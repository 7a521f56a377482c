//! Newton's method onto one, two and three pieces at once.
//!
//! Pieces are measured by their first-order distance d = g/|∇g|; steps are the shortest ones that
//! make all linearised distances zero. An iteration ends when a step is as short as rounding makes
//! it ([`rounding`], times the condition of the step), or after many steps at a few times that
//! length.

mod touching;

pub(crate) use touching::{branch, onto_touching};

use isoform_geom::{Point3, Solid, cross, dot, norm, sub};

/// Maximum number of steps of every iteration; a handful is usual.
const MAX_FEATURE_NEWTON_STEPS: usize = 40;
/// Minimum sine between the normals of two pieces that meet in a curve: below it, a step in the
/// normal plane of the curve would be rounding errors divided by the sine.
const MIN_CURVE_SINE: f64 = 1e-7;
/// Minimum determinant of the normals of three pieces that meet in a point: below it they touch,
/// and a step would be rounding errors divided by it.
const MIN_POINT_DETERMINANT: f64 = 1e-9;

/// First-order distance and normal of a piece near its zero set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PieceDistance {
    /// g/|∇g|.
    pub(crate) d: f64,
    /// ∇g/|∇g|.
    pub(crate) n: Point3,
}

/// Returns a + s b.
pub(crate) fn add_scaled(a: Point3, b: Point3, s: f64) -> Point3 {
    std::array::from_fn(|i| a[i] + s * b[i])
}

/// Returns the vector divided by its length; the vector itself if that is 0.
pub(crate) fn unit(a: Point3) -> Point3 {
    let l = norm(a);
    if l > 0.0 { a.map(|v| v / l) } else { a }
}

/// Returns a piece's distance and normal; `None` where the gradient vanishes or is not finite.
pub(crate) fn normalised(solid: &dyn Solid, piece: u32, p: Point3) -> Option<PieceDistance> {
    let (v, g) = solid.gradient(piece, p);
    let length = norm(g);
    (length > 0.0 && length.is_finite() && v.is_finite()).then(|| PieceDistance {
        d: v / length,
        n: g.map(|c| c / length),
    })
}

/// Returns the rounding error of a point's coordinates.
pub(crate) fn rounding(p: Point3) -> f64 {
    f64::EPSILON * p.into_iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// Shortens a step to `reach`; returns it with its original length.
fn limited(step: Point3, reach: f64) -> (Point3, f64) {
    let length = norm(step);
    if length > reach {
        (step.map(|v| v * reach / length), length)
    } else {
        (step, length)
    }
}

/// Returns the point of one piece near `p`; `None` if none is found within `reach`.
pub(crate) fn onto_one(solid: &dyn Solid, piece: u32, p: Point3, reach: f64) -> Option<Point3> {
    onto_one_within(solid, piece, p, reach, 1e-15 * reach)
}

/// Returns a point of one piece, or a point nearer to it than the tolerance, like [`onto_one`].
pub(crate) fn onto_one_within(
    solid: &dyn Solid,
    piece: u32,
    p: Point3,
    reach: f64,
    tolerance: f64,
) -> Option<Point3> {
    let mut q = p;
    for _ in 0..MAX_FEATURE_NEWTON_STEPS {
        let g = normalised(solid, piece, q)?;
        q = add_scaled(q, g.n, -g.d);
        if norm(sub(q, p)) > reach {
            return None;
        }
        if g.d.abs() <= 2.0 * rounding(q) + tolerance {
            return Some(q);
        }
    }
    None
}

/// Returns a common point of two pieces near `p`, at most `reach` away, and their normals there;
/// `None` if the iteration fails.
pub(crate) fn onto_two(
    solid: &dyn Solid,
    [i, j]: [u32; 2],
    p: Point3,
    reach: f64,
) -> Option<(Point3, [Point3; 2])> {
    let mut q = p;
    for step in 0..MAX_FEATURE_NEWTON_STEPS {
        let (a, b) = (normalised(solid, i, q)?, normalised(solid, j, q)?);
        let sine = norm(cross(a.n, b.n));
        if sine < MIN_CURVE_SINE {
            return None;
        }
        let (move_by, length) = limited(step_to_line(a, b, sine), reach);
        q = add_scaled(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        let noise = (2.0 * rounding(q) + 1e-16 * reach) / sine;
        // After many steps, the iteration may alternate within a few roundings.
        if length <= noise || (step > 8 && length <= 32.0 * noise) {
            return Some((q, [a.n, b.n]));
        }
    }
    None
}

/// Returns the shortest step to the line in which two linearised pieces vanish: x nₐ + y n_b with
/// the sine s and cosine c between the normals, x = (c d_b − dₐ)/s², y = (c dₐ − d_b)/s².
#[inline]
fn step_to_line(a: PieceDistance, b: PieceDistance, sine: f64) -> Point3 {
    let c = dot(a.n, b.n);
    let s2 = sine * sine;
    let (x, y) = ((c * b.d - a.d) / s2, (c * a.d - b.d) / s2);
    std::array::from_fn(|k| x * a.n[k] + y * b.n[k])
}

/// Returns a common point of three pieces near `p`, at most `reach` away, and the determinant of
/// their normals there; `None` if the iteration fails.
///
/// Where the pieces touch each other the determinant is about 0, and the point is accurate to half
/// the digits.
pub(crate) fn onto_three(
    solid: &dyn Solid,
    [i, j, k]: [u32; 3],
    p: Point3,
    reach: f64,
) -> Option<(Point3, f64)> {
    let mut q = p;
    for step in 0..MAX_FEATURE_NEWTON_STEPS {
        let a = normalised(solid, i, q)?;
        let b = normalised(solid, j, q)?;
        let c = normalised(solid, k, q)?;
        let (bc, ca, ab) = (cross(b.n, c.n), cross(c.n, a.n), cross(a.n, b.n));
        let det = dot(a.n, bc);
        if det.abs() < MIN_POINT_DETERMINANT {
            // The last steps before were short where this is a touching point.
            let distances = [a.d, b.d, c.d].into_iter();
            let far = distances.fold(0.0, |m: f64, d| m.max(d.abs()));
            // Newton's method finds touching points to half the digits, and distances, being of
            // second order, to nearly all of them.
            return (step > 0 && far < 1e-10 * reach).then_some((q, det));
        }
        let to_point = |m: usize| -(a.d * bc[m] + b.d * ca[m] + c.d * ab[m]) / det;
        let (move_by, length) = limited(std::array::from_fn(to_point), reach);
        q = add_scaled(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        let noise = (4.0 * rounding(q) + 1e-16 * reach) / det.abs();
        // After many steps, the iteration may alternate within a few roundings.
        if length <= noise || (step > 12 && length <= 64.0 * noise) {
            return Some((q, det));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::Pieces;
    use isoform_field::hyperfun::{Mode, Model};

    #[test]
    fn common_points_in_closed_form() {
        // A ball of radius 2 cut by the planes x = 1 and y = 1.
        let program = "cut(x[3], a[1]) { \
            cut = (4 - x[1]^2 - x[2]^2 - x[3]^2) & (1 - x[1]) & (1 - x[2]); }";
        let model = Model::parse(program, Mode::Default).expect("a program");
        let none = vec![0.0; model.n_params()];
        let solid = Pieces::of_model(&model, &none).expect("a solid");
        let pieces = solid.tree().pieces();
        let [ball, x, y] = pieces[..] else {
            panic!("three pieces, not {pieces:?}")
        };
        let near = [1.1, 0.9, 1.3];
        let (p, det) = onto_three(&solid, [ball, x, y], near, 1.0).expect("a corner");
        assert!(norm(sub(p, [1.0, 1.0, 2f64.sqrt()])) < 1e-14, "{p:?}");
        // Normals −p/2, −e₁, −e₂: the determinant is half the third coordinate.
        assert!((det.abs() - 0.5 * 2f64.sqrt()).abs() < 1e-14);
        let (p, _) = onto_two(&solid, [x, y], near, 1.0).expect("an edge");
        assert!(norm(sub(p, [1.0, 1.0, 1.3])) < 1e-14, "{p:?}");
        let p = onto_one(&solid, x, near, 1.0).expect("a face");
        assert!(norm(sub(p, [1.0, 0.9, 1.3])) < 1e-14, "{p:?}");
        assert!(onto_one(&solid, x, [3.0, 0.0, 0.0], 1.0).is_none());
    }
}
