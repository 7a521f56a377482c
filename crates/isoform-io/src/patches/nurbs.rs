//! Decomposition of NURBS surfaces into Bézier patches, one per pair of non-empty knot intervals.
//!
//! The Bézier points of a B-spline of degree p between the knots a and b are its polar form
//! (blossom) at a and b: the i-th one at p − i times a and i times b, by de Boor's recursion.

use super::{ControlNet, FilePatch, Result, degree, numbers, wrong};
use isoform_algebra::RBig;
use serde_json::Value;

/// Maximum number of Bézier patches of a NURBS surface. Real ones have thousands; without a bound a
/// small file could request unlimited memory.
const MAX_PATCHES: usize = 100_000;
/// Maximum number of control points of all patches of a file, of about 200 bytes each: 40 per patch
/// at [`MAX_PATCHES`], so that only high degrees reach this limit first.
pub(super) const MAX_CONTROL_POINTS: usize = 40 * MAX_PATCHES;

/// Homogeneous control point of rational numbers.
type ExactPoint = [RBig; 4];

/// Knots of one direction.
struct KnotVector {
    degree: usize,
    values: Vec<RBig>,
}

impl KnotVector {
    /// Parses the knots of a key, for a number of control points in their direction.
    fn parse(value: &Value, key: &str, at: &str, degree: usize, points: usize) -> Result<Self> {
        let at = format!("{at}, {key}");
        let knots = numbers(value.get(key)).or_else(|problem| wrong(&at, problem))?;
        match problem(&knots, degree, points) {
            Some(problem) => wrong(at, problem),
            None => Ok(Self {
                degree,
                values: knots.into_iter().map(super::exact).collect(),
            }),
        }
    }
    /// Returns the indices of the knots that begin a non-empty interval.
    fn spans(&self) -> Vec<usize> {
        (self.degree..self.values.len() - self.degree - 1)
            .filter(|&i| self.values[i] < self.values[i + 1])
            .collect()
    }
    /// Returns the Bézier points of a B-spline between knot k and the next.
    fn segment(&self, points: &[ExactPoint], k: usize) -> Vec<ExactPoint> {
        (0..=self.degree)
            .map(|i| self.bezier_point(points, k, i))
            .collect()
    }
    /// Returns the i-th Bézier point: the polar form at p − i times knot k and i times the next.
    fn bezier_point(&self, points: &[ExactPoint], k: usize, i: usize) -> ExactPoint {
        let (p, knots) = (self.degree, &self.values);
        // d[j] belongs to point k − p + j.
        let mut d: Vec<ExactPoint> = points[k - p..=k].to_vec();
        for r in 1..=p {
            let x = if r <= p - i { &knots[k] } else { &knots[k + 1] };
            for j in (r..=p).rev() {
                let (lo, hi) = (&knots[k - p + j], &knots[k + j - r + 1]);
                let share = (x - lo) / (hi - lo);
                d[j] = std::array::from_fn(|c| {
                    &d[j - 1][c] * (RBig::ONE - &share) + &d[j][c] * &share
                });
            }
        }
        d.swap_remove(p)
    }
}

/// Returns the problem of knots for a number of points; `None` if they are valid.
fn problem(knots: &[f64], degree: usize, points: usize) -> Option<String> {
    let wanted = points + degree + 1;
    Some(if points <= degree {
        format!("{points} points are too few for degree {degree}")
    } else if knots.len() != wanted {
        format!("{wanted} knots are expected, {} are there", knots.len())
    } else if knots.windows(2).any(|w| w[0] > w[1]) {
        "knots must not decrease".to_owned()
    } else if knots[degree] == knots[points] {
        "the knots leave no interval".to_owned()
    } else if knots.windows(degree + 2).any(|w| w[0] == w[degree + 1]) {
        format!("a knot occurs more than {} times", degree + 1)
    } else {
        return None;
    })
}

/// Returns the Bézier patches of a surface, with at most `room` control points.
pub(super) fn pieces(value: &Value, at: &str, room: usize) -> Result<Vec<FilePatch>> {
    let degree @ [p, q] = degree(value, at)?;
    let net = ControlNet::parse(value, at)?;
    let u = KnotVector::parse(value, "knots_u", at, p, net.rows)?;
    let v = KnotVector::parse(value, "knots_v", at, q, net.columns)?;
    let (in_u, in_v) = (u.spans(), v.spans());
    check_size(in_u.len() * in_v.len(), degree, room).or_else(|problem| wrong(at, problem))?;
    let points = net.control.exact();
    let mut patches = Vec::with_capacity(in_u.len() * in_v.len());
    for (a, &k) in in_u.iter().enumerate() {
        let strip = strip(&u, &points, net.columns, k);
        for (b, &l) in in_v.iter().enumerate() {
            let control = strip.iter().flat_map(|row| v.segment(row, l)).collect();
            patches.push(FilePatch {
                name: format!("{at}, span {} {}", a + 1, b + 1),
                degree,
                control: super::ControlPoints::Exact(control),
            });
        }
    }
    Ok(patches)
}

/// Refuses surfaces with too many Bézier patches before any of them is computed.
fn check_size(patches: usize, [p, q]: [usize; 2], room: usize) -> std::result::Result<(), String> {
    if patches > MAX_PATCHES {
        return Err(format!("more than {MAX_PATCHES} patches"));
    }
    if patches * (p + 1) * (q + 1) > room {
        return Err(format!("more than {MAX_CONTROL_POINTS} control points"));
    }
    Ok(())
}

/// Returns the rows of control points between knot k in u and the next: Bézier in u, B-splines in
/// v.
fn strip(u: &KnotVector, points: &[ExactPoint], columns: usize, k: usize) -> Vec<Vec<ExactPoint>> {
    let mut rows = vec![Vec::with_capacity(columns); u.degree + 1];
    for j in 0..columns {
        let column: Vec<ExactPoint> = points.iter().skip(j).step_by(columns).cloned().collect();
        for (row, point) in rows.iter_mut().zip(u.segment(&column, k)) {
            row.push(point);
        }
    }
    rows
}
