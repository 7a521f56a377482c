//! The arrangement of plane algebraic curves in the unit triangle u ≥ 0, v ≥ 0, u + v ≤ 1, exactly:
//! a cylindrical decomposition.
//!
//! Over every critical u (a vertical tangent or singular point of a curve, an intersection of two,
//! an intersection with a side) stands a [`Wall`] with the points of the curves on it; between two
//! walls lies a [`Slab`], in which the curves are disjoint graphs over u. Which arc ends in which
//! point is decided by lines v = c between the points of a wall, which no curve crosses as far as a
//! u close enough to the wall (G. E. Collins, 1975; D. S. Arnon, G. E. Collins, S. McCallum, SIAM
//! J. Comput. 13, 1984). No genericity is assumed: several critical points may share a wall, and a
//! curve may contain the wall.
//!
//! Four triangles, one per quadrant of (s, t), make up the projective plane.
//!
//! ```text
//!  1 +.              wall    a vertical line over a critical u
//!    |  `.           slab    what lies between two walls
//!    |  |  `.        arc     a piece of a curve, or a side, that crosses a slab
//!  v |--+-.--|`.     stack   the numbers v over a critical u at which curves meet the line
//!    |  |  `-+-- `.  separator  a number between two points of a wall
//!  0 +--+----+-----+
//!    0      u      1
//! ```

mod critical;
mod curve;
mod stack;
mod work;

use crate::float_roots::{Number, Wide, proved_roots};
use crate::poly::Poly;
use crate::resultant::ResultantError;
use crate::roots::RealRoot;
use critical::critical_values;
use curve::{Curve, Terms, over, roots_between_sides};
use dashu_ratio::RBig;
use isoform_control::Control;
use isoform_num::Interval;
use std::collections::BTreeMap;
use work::{ArrangementWork, PreparedWall};

/// Index of the variable that changes from wall to wall.
const U: usize = 0;
/// Index of the variable along a wall.
const V: usize = 1;

/// Reason why an arrangement could not be computed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ArrangementError {
    /// Two curves share a component.
    #[error("curves {0} and {1} share a component")]
    CommonComponent(usize, usize),
    /// A polynomial that is zero.
    #[error("curve {0} is the whole plane")]
    Zero(usize),
    /// More than two variables, or stopped.
    #[error(transparent)]
    Resultant(#[from] ResultantError),
}

/// A place on a wall that a curve or a side goes through.
#[derive(Clone, Debug)]
pub struct WallPoint {
    /// Lower bound of v: no other point of the wall is in \[lo, hi\].
    pub lo: RBig,
    /// Upper bound of v.
    pub hi: RBig,
    /// The curves that go through it, ascending; [`Arrangement::lower`] and [`Arrangement::upper`]
    /// among them.
    pub curves: Vec<usize>,
}

/// A vertical line over a critical u, within the triangle.
#[derive(Clone, Debug)]
pub struct Wall {
    /// The critical value.
    pub u: RealRoot,
    /// Points from the side v = 0 to the side u + v = 1, both of which have one. At u = 1 both
    /// coincide.
    pub points: Vec<WallPoint>,
    /// Curves that contain the whole line.
    pub vertical: Vec<usize>,
}

/// A piece of a curve between two walls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arc {
    /// The index of the curve.
    pub curve: usize,
    /// The point of the left wall in which the arc ends.
    pub left: usize,
    /// The point of the right wall in which the arc ends.
    pub right: usize,
}

/// The part of the triangle between two neighbouring walls: wall k is on the left of slab k.
#[derive(Clone, Debug)]
pub struct Slab {
    /// A rational u strictly between the walls.
    pub u: RBig,
    /// The arcs from bottom to top; the first is the side v = 0, the last the side u + v = 1.
    pub arcs: Vec<Arc>,
    /// A rational v strictly between each arc and the next, at `u`.
    pub between: Vec<RBig>,
}

/// The decomposition of the unit triangle by curves.
///
/// ```
/// use isoform_algebra::{Arrangement, Poly};
/// use isoform_control::Control;
///
/// // The diagonal u = v leaves the triangle at (1/2, 1/2).
/// let diagonal = Poly::parse("u - v", &["u", "v"])?;
/// let found = Arrangement::new(&[diagonal], &Control::default())?;
/// let walls: Vec<f64> = found.walls.iter().map(|w| w.u.to_f64()).collect();
/// assert_eq!(walls, [0.0, 0.5, 1.0]);
/// let curves = |slab: usize| found.slabs[slab].arcs.iter().map(|a| a.curve).collect::<Vec<_>>();
/// assert_eq!(curves(0), [found.lower(), 0, found.upper()]);
/// assert_eq!(curves(1), [found.lower(), found.upper()]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Arrangement {
    curves: Vec<Poly>,
    /// The curves' terms with coefficients known to rounding, and to twice as many digits.
    terms: Vec<Terms<Interval>>,
    wide: Vec<Terms<Wide>>,
    /// True if each curve contains the sides u = 0, v = 0, u + v = 1.
    pub sides: Vec<[bool; 3]>,
    /// The walls from u = 0 to u = 1, both included.
    pub walls: Vec<Wall>,
    /// The slabs between neighbouring walls, one fewer than walls.
    pub slabs: Vec<Slab>,
}

impl Arrangement {
    /// Decomposes the unit triangle by the zero sets of polynomials in variables 0 (u) and 1 (v).
    /// They are made squarefree; no two may share a component other than a side.
    ///
    /// # Errors
    /// [`ArrangementError`].
    pub fn new(curves: &[Poly], control: &Control<'_>) -> Result<Self, ArrangementError> {
        let mut sides = Vec::new();
        let mut prepared = Vec::new();
        for (k, f) in curves.iter().enumerate() {
            if f.is_zero() {
                return Err(ArrangementError::Zero(k));
            }
            let (rest, has) = without_sides(f);
            sides.push(has);
            prepared.push(Curve::new(rest, control)?);
        }
        let critical = critical_values(&prepared, control)?;
        let mut work = ArrangementWork::new(prepared);
        let last = critical.len() - 1;
        let mut standing: Vec<PreparedWall> = Vec::new();
        for (k, u) in critical.into_iter().enumerate() {
            let wall = work.wall(u, control)?;
            if k == 0 || k == last || !wall.is_regular() {
                standing.push(wall);
            }
        }
        let pairs = standing.windows(2);
        let slabs: Result<Vec<Slab>, ResultantError> =
            pairs.map(|w| work.slab(&w[0], &w[1], control)).collect();
        let slabs = slabs?;
        let (mut curves, mut terms, mut wide) = (Vec::new(), Vec::new(), Vec::new());
        for c in work.curves {
            curves.push(c.rest);
            terms.push(c.terms);
            wide.push(c.wide);
        }
        Ok(Self {
            curves,
            terms,
            wide,
            sides,
            walls: standing.into_iter().map(|s| s.wall).collect(),
            slabs,
        })
    }

    /// Returns the index of the side v = 0 among curves.
    pub fn lower(&self) -> usize {
        self.curves.len()
    }
    /// Returns the index of the side u + v = 1 among curves.
    pub fn upper(&self) -> usize {
        self.curves.len() + 1
    }
    /// Returns v on every arc of a slab over some u strictly between its walls, from bottom to top,
    /// with a relative error of 1e-13; `None` if u is not between them.
    pub fn arcs_over(&self, slab: usize, u: &RBig) -> Option<Vec<f64>> {
        let [left, right] = [slab, slab + 1].map(|k| self.walls[k].u.cmp_rational(u));
        if !(left.is_lt() && right.is_gt()) {
            return None;
        }
        let arcs = &self.slabs[slab].arcs;
        let top = RBig::ONE - u;
        let mut roots: BTreeMap<usize, std::vec::IntoIter<f64>> = BTreeMap::new();
        let mut value = |curve: usize| {
            let over = roots.entry(curve).or_insert_with(|| {
                let count = arcs.iter().filter(|a| a.curve == curve).count();
                let near = self.near_roots(curve, u, &top, count);
                let roots = near.unwrap_or_else(|| self.exact_roots(curve, u, &top));
                assert_eq!(roots.len(), count, "as many roots as arcs over a slab");
                roots.into_iter()
            });
            over.next()
        };
        let height = |arc: &Arc| match arc.curve.checked_sub(self.lower()) {
            None => value(arc.curve),
            Some(0) => Some(0.0),
            Some(_) => Some(top.to_f64().value()),
        };
        arcs.iter().map(height).collect()
    }
    /// Returns the roots of a curve over u between 0 and `top`, correctly rounded.
    fn exact_roots(&self, curve: usize, u: &RBig, top: &RBig) -> Vec<f64> {
        roots_between_sides(&self.curves[curve], u, top)
            .map(|r| r.to_f64())
            .collect()
    }
    /// Returns the roots if they are proved in floating point: with the digits of doubles where
    /// these suffice, and with twice as many for curves of high degree.
    fn near_roots(&self, curve: usize, u: &RBig, top: &RBig, count: usize) -> Option<Vec<f64>> {
        let (x, top) = (u.to_f64().value(), top.to_f64().value());
        // Values of u that are doubles are met exactly.
        let is_double = RBig::try_from(x).is_ok_and(|x| x == *u);
        let around = match is_double {
            true => Interval::new(x, x),
            false => Interval::new(x.next_down(), x.next_up()),
        };
        let near = over(&self.terms[curve], U, around);
        proved_roots(&near, top, count).or_else(|| {
            let wide = || over(&self.wide[curve], U, Wide::exact(x));
            is_double.then(|| proved_roots(&wide(), top, count))?
        })
    }
    /// Returns the polynomial of a curve, squarefree, without sides and vertical lines.
    pub fn curve(&self, k: usize) -> &Poly {
        &self.curves[k]
    }
}

/// Returns the squarefree part of a curve without the sides u = 0, v = 0 and u + v = 1, and which
/// of these it contains.
fn without_sides(f: &Poly) -> (Poly, [bool; 3]) {
    let (u, v) = (Poly::var(U), Poly::var(V));
    let upper = &u + &v - Poly::one();
    let mut rest = f.squarefree_part();
    let has = [u, v, upper].map(|side| {
        let quotient = rest.div_exact(&side);
        let divides = quotient.is_some();
        rest = quotient.unwrap_or_else(|| std::mem::take(&mut rest));
        divides
    });
    (rest, has)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    /// A curve that is dropped from the arrangement causes a panic: its arcs are missed, not left
    /// out.
    #[test]
    #[should_panic(expected = "as many roots as arcs over a slab")]
    fn a_curve_that_is_dropped_is_noticed() {
        let circle = Poly::parse("64*(u - 1/4)^2 + 64*(v - 1/4)^2 - 1", &["u", "v"]);
        let circle = circle.expect("a polynomial");
        let mut a = Arrangement::new(&[circle], &Control::default()).expect("not stopped");
        let middle = RBig::ONE / RBig::from(4);
        let slab = (0..a.slabs.len())
            .find(|&k| a.arcs_over(k, &middle).is_some_and(|arcs| arcs.len() == 4))
            .expect("the circle's arcs between the sides");
        a.curves[0] = Poly::one();
        a.terms[0] = vec![([0, 0], Interval::new(1.0, 1.0))];
        a.wide[0] = vec![([0, 0], Wide::exact(1.0))];
        let _ = a.arcs_over(slab, &middle);
    }

    /// Every loop of growing precision checks whether to stop.
    #[test]
    fn decompositions_can_be_stopped_anywhere() {
        let p = |text| Poly::parse(text, &["u", "v"]).expect("a polynomial");
        let curves = [
            p("u^3 - v^2 + 1/7*u*v"),
            p("(u - 1/3)^2 + v^2 - 1/16"),
            p("3*u - v"),
        ];
        let whole = Arrangement::new(&curves, &Control::default()).expect("not stopped");
        let mut stopped = 0;
        for microseconds in [0, 20, 50, 100, 200, 500, 1000, 2000, 5000] {
            let end = Instant::now() + Duration::from_micros(microseconds);
            match Arrangement::new(&curves, &Control::default().until(end)) {
                Ok(found) => assert_eq!(found.slabs.len(), whole.slabs.len()),
                Err(error) => {
                    let expected = ArrangementError::Resultant(ResultantError::Stopped);
                    assert_eq!(error, expected, "after {microseconds} µs");
                    stopped += 1;
                }
            }
        }
        assert!(stopped > 0);
    }
}
