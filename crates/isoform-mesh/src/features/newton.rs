//! Newton's method onto one, two and three pieces at once.
//!
//! Pieces count by their distance to first order, d = g/|∇g|; steps are the shortest ones that make
//! all linearised distances zero. Iterations end where a step is as short as rounding makes it
//! ([`rounding`], times the condition of the step), or is no longer than a few times that after
//! many steps.

mod touching;

pub(crate) use touching::{branch, onto_touching};

use isoform_geom::{Point3, Solid, cross, dot, norm, sub};

/// Steps of every iteration, at most; a handful is usual.
const STEPS: usize = 40;
/// Two pieces are parallel if the sine between them is below this: a step in the normal plane of
/// their curve would be rounding errors divided by the sine.
const PARALLEL: f64 = 1e-7;
/// Three pieces touch if the determinant of their normals is below this: a step would be rounding
/// errors divided by it.
const TOUCHING: f64 = 1e-9;
/// Distance, as a share of the reach, within which three pieces that touch count as meeting. There
/// Newton's method finds places to half the digits, and distances, being of second order, to nearly
/// all of them.
const MEETING: f64 = 1e-10;
/// Steps after which an iteration onto two pieces may end with steps of a few roundings.
const PATIENCE_TWO: usize = 8;
/// Steps after which an iteration onto three pieces may end with steps of a few roundings.
const PATIENCE_THREE: usize = 12;
/// After many steps onto two pieces the last step may be this many roundings long, as it goes back
/// and forth.
const LOOSE_TWO: f64 = 32.0;
/// After many steps onto three pieces the last step may be this many roundings long.
const LOOSE_THREE: f64 = 64.0;

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

/// The vector divided by its length; the vector itself where that is 0.
pub(crate) fn unit(a: Point3) -> Point3 {
    let l = norm(a);
    if l > 0.0 { a.map(|v| v / l) } else { a }
}

/// A piece's distance and normal; none where the gradient vanishes or is no number.
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

/// A step no longer than `reach`, with the length that it had.
fn limited(step: Point3, reach: f64) -> (Point3, f64) {
    let length = norm(step);
    if length > reach {
        (step.map(|v| v * reach / length), length)
    } else {
        (step, length)
    }
}

/// The point of one piece near `p`, at most `reach` away.
pub(crate) fn onto_one(solid: &dyn Solid, piece: u32, p: Point3, reach: f64) -> Option<Point3> {
    onto_one_within(solid, piece, p, reach, 1e-15 * reach)
}

/// A point of one piece, or a place nearer to it than the tolerance, as [`onto_one`] finds it.
pub(crate) fn onto_one_within(
    solid: &dyn Solid,
    piece: u32,
    p: Point3,
    reach: f64,
    tolerance: f64,
) -> Option<Point3> {
    let mut q = p;
    for _ in 0..STEPS {
        let g = normalised(solid, piece, q)?;
        q = along(q, g.n, -g.d);
        if norm(sub(q, p)) > reach {
            return None;
        }
        if g.d.abs() <= 2.0 * rounding(q) + tolerance {
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
        let sine = norm(cross(a.n, b.n));
        if sine < PARALLEL {
            return None;
        }
        let (move_by, length) = limited(step_to_line(a, b, sine), reach);
        q = along(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        let noise = (2.0 * rounding(q) + 1e-16 * reach) / sine;
        if length <= noise || (step > PATIENCE_TWO && length <= LOOSE_TWO * noise) {
            return Some((q, [a.n, b.n]));
        }
    }
    None
}

/// The shortest way to the line in which two linearised pieces vanish: x nₐ + y n_b with the sine s
/// and cosine c between the normals, x = (c d_b − dₐ)/s², y = (c dₐ − d_b)/s².
#[inline]
fn step_to_line(a: Distance, b: Distance, sine: f64) -> Point3 {
    let c = dot(a.n, b.n);
    let s2 = sine * sine;
    let (x, y) = ((c * b.d - a.d) / s2, (c * a.d - b.d) / s2);
    std::array::from_fn(|k| x * a.n[k] + y * b.n[k])
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
        let a = normalised(solid, i, q)?;
        let b = normalised(solid, j, q)?;
        let c = normalised(solid, k, q)?;
        let (bc, ca, ab) = (cross(b.n, c.n), cross(c.n, a.n), cross(a.n, b.n));
        let det = dot(a.n, bc);
        if det.abs() < TOUCHING {
            // The last steps before were short where this is a touching point.
            let distances = [a.d, b.d, c.d].into_iter();
            let far = distances.fold(0.0, |m: f64, d| m.max(d.abs()));
            return (step > 0 && far < MEETING * reach).then_some((q, det));
        }
        let to_point = |m: usize| -(a.d * bc[m] + b.d * ca[m] + c.d * ab[m]) / det;
        let (move_by, length) = limited(std::array::from_fn(to_point), reach);
        q = along(q, move_by, 1.0);
        if norm(sub(q, p)) > reach {
            return None;
        }
        let noise = (4.0 * rounding(q) + 1e-16 * reach) / det.abs();
        if length <= noise || (step > PATIENCE_THREE && length <= LOOSE_THREE * noise) {
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
