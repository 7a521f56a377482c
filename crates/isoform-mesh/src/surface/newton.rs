//! Newton's method onto one, two or three pieces at once, and roots on segments.

use isoform_geom::{Point3, cross, dot, norm};

/// Returns the shortest step to the common zero of the linearised pieces, and the largest distance
/// from one of them; `None` if a gradient vanishes, or if they are linearly dependent.
///
/// With unit normals a, b, c and distances u, v, w the step is u a for one piece; α a + β b with
/// a·x = u, b·x = v for two; and for three (u b×c + v c×a + w a×b)/det.
pub(crate) fn newton(
    gradient: &dyn Fn(u32, Point3) -> (f64, Point3),
    pieces: &[u32],
    p: Point3,
) -> Option<(Point3, f64)> {
    let mut rows = [([0.0; 3], 0.0); 3];
    let mut off = 0.0f64;
    for (row, &piece) in rows.iter_mut().zip(pieces) {
        let (g, d) = gradient(piece, p);
        let n = norm(d);
        if !(n > 0.0 && n.is_finite() && g.is_finite()) {
            return None;
        }
        *row = (d.map(|v| v / n), g / n);
        off = off.max((g / n).abs());
    }
    let [a, b, c] = rows;
    let step = match pieces.len() {
        1 => a.0.map(|x| x * a.1),
        2 => step_to_line(a, b)?,
        3 => step_to_point(a, b, c)?,
        _ => return None,
    };
    Some((step, off))
}

/// A plane: its unit normal, and its distance from the current point along that.
type Plane = (Point3, f64);

/// Returns the shortest step to the line of intersection of two planes.
#[inline]
fn step_to_line((a, u): Plane, (b, v): Plane) -> Option<Point3> {
    let k = dot(a, b);
    let det = 1.0 - k * k;
    // Parallel pieces: the step along the sum of their normals would be arbitrarily long by
    // rounding. `det` is the squared sine of their angle.
    if det < 1e-10 {
        return None;
    }
    let (alpha, beta) = ((u - k * v) / det, (v - k * u) / det);
    Some(std::array::from_fn(|i| alpha * a[i] + beta * b[i]))
}

/// Returns the step to the point of intersection of three planes.
#[inline]
fn step_to_point((a, u): Plane, (b, v): Plane, (c, w): Plane) -> Option<Point3> {
    let det = dot(a, cross(b, c));
    // Normals that are coplanar to rounding.
    if det.abs() < 1e-8 {
        return None;
    }
    let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
    Some(std::array::from_fn(|i| {
        (u * bc[i] + v * ca[i] + w * ab[i]) / det
    }))
}

/// A root bracket in [0, 1], reduced by the Illinois method: regula falsi that halves the value at
/// a retained end.
pub(super) struct Bracket {
    lower: (f64, f64),
    upper: (f64, f64),
    /// End that was moved last.
    moved: BracketEnd,
}

#[derive(Clone, Copy, PartialEq)]
enum BracketEnd {
    None,
    Lower,
    Upper,
}

impl Bracket {
    /// Maximum number of steps, always sufficient to reach neighbouring numbers.
    pub(super) const MAX_BRACKET_STEPS: usize = 100;

    /// Creates a bracket from the values at 0 and 1.
    pub(super) fn new(at_0: f64, at_1: f64) -> Self {
        Self {
            lower: (0.0, at_0),
            upper: (1.0, at_1),
            moved: BracketEnd::None,
        }
    }

    /// Returns true if a position lies strictly between the ends.
    #[inline]
    pub(super) fn holds(&self, m: f64) -> bool {
        m > self.lower.0 && m < self.upper.0
    }

    /// Returns the estimated root: on the chord if that lies inside, else the midpoint.
    #[inline]
    pub(super) fn guess(&self) -> f64 {
        let ((s, fs), (t, ft)) = (self.lower, self.upper);
        let m = if fs.is_finite() && ft.is_finite() {
            (s * ft - t * fs) / (ft - fs)
        } else {
            0.5 * (s + t)
        };
        if self.holds(m) { m } else { 0.5 * (s + t) }
    }

    /// Replaces one end by a point in between with its value.
    #[inline]
    pub(super) fn narrow(&mut self, m: f64, v: f64) {
        if (v > 0.0) == (self.lower.1 > 0.0) {
            self.lower = (m, v);
            if self.moved == BracketEnd::Lower {
                self.upper.1 *= 0.5;
            }
            self.moved = BracketEnd::Lower;
        } else {
            self.upper = (m, v);
            if self.moved == BracketEnd::Upper {
                self.lower.1 *= 0.5;
            }
            self.moved = BracketEnd::Upper;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The planes x = 1, y = 2, z = 3, as values and gradients of any length.
    fn planes(i: u32, p: Point3) -> (f64, Point3) {
        let k = i as usize;
        let mut g = [0.0; 3];
        g[k] = 2.0;
        (2.0 * (p[k] - (k + 1) as f64), g)
    }

    #[test]
    fn one_step_leads_to_planes() {
        for pieces in [&[0][..], &[0, 2], &[0, 1, 2]] {
            let (step, off) = newton(&planes, pieces, [0.0; 3]).expect("transversal");
            for k in 0..3u32 {
                let goal = if pieces.contains(&k) {
                    -f64::from(k + 1)
                } else {
                    0.0
                };
                assert!((step[k as usize] - goal).abs() < 1e-15);
            }
            assert!((off - f64::from(pieces[pieces.len() - 1] + 1)).abs() < 1e-15);
        }
        assert!(newton(&planes, &[1, 1], [0.0; 3]).is_none());
    }

    #[test]
    fn a_bracket_closes_on_a_root() {
        let f = |x: f64| x * x * x - 0.3;
        let mut bracket = Bracket::new(f(0.0), f(1.0));
        let mut m = bracket.guess();
        for _ in 0..30 {
            if f(m).abs() < 1e-15 || !bracket.holds(m) {
                break;
            }
            bracket.narrow(m, f(m));
            m = bracket.guess();
        }
        assert!((m - 0.3f64.cbrt()).abs() < 1e-14);
    }
}
