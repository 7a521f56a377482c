//! A domain of the parameter plane to which a surface is restricted: a simple polygon with rational
//! corners.

use crate::map::Map;
use dashu_base::Sign;
use isoform_algebra::{Poly, QUADRANTS, RBig};

/// Maximum number of corners of a domain: a vertex stores its sides as the bits of a `u64`.
pub const MAX_CORNERS: usize = 64;

/// A point (s, t) of the parameter plane.
pub type Parameters = [RBig; 2];

/// A closed simple polygon in (s, t).
#[derive(Clone, Debug, PartialEq)]
pub struct Domain {
    /// Corners, counterclockwise; side k leads from corner k to the next one.
    corners: Vec<Parameters>,
}

/// Reason why corners do not form a simple polygon.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DomainError {
    /// Fewer than three corners.
    #[error("{found} corners are too few: a polygon has three or more")]
    TooFew {
        /// Number of corners.
        found: usize,
    },
    /// More than [`MAX_CORNERS`].
    #[error("{found} corners are too many: there may be {MAX_CORNERS}")]
    TooMany {
        /// Number of corners.
        found: usize,
    },
    /// All corners are collinear.
    #[error("the region has no area")]
    NoArea,
    /// Two sides, counted from 1, meet in a point that is not their common corner.
    #[error("sides {first} and {second} of the polygon meet")]
    Crossing {
        /// First of the two sides.
        first: usize,
        /// Second of the two sides.
        second: usize,
    },
}

/// Returns twice the signed area of a triangle, positive if it is counterclockwise.
fn area(a: &Parameters, b: &Parameters, c: &Parameters) -> RBig {
    (&b[0] - &a[0]) * (&c[1] - &a[1]) - (&b[1] - &a[1]) * (&c[0] - &a[0])
}
/// Returns the sign as −1, 0 or 1.
fn signum(x: &RBig) -> i8 {
    match x.sign() {
        _ if x.is_zero() => 0,
        Sign::Positive => 1,
        Sign::Negative => -1,
    }
}
/// Returns true if a point of the line through a and b lies between them, ends included.
fn is_between(p: &Parameters, a: &Parameters, b: &Parameters) -> bool {
    (0..2).all(|k| (&p[k] - &a[k]) * (&p[k] - &b[k]) <= RBig::ZERO)
}
/// Returns true if two segments have a common point.
fn meet([a, b]: [&Parameters; 2], [c, d]: [&Parameters; 2]) -> bool {
    let [p, q] = [c, d].map(|x| signum(&area(a, b, x)));
    let [r, s] = [a, b].map(|x| signum(&area(c, d, x)));
    let touches = [(p, c, a, b), (q, d, a, b), (r, a, c, d), (s, b, c, d)]
        .into_iter()
        .any(|(o, x, y, z)| o == 0 && is_between(x, y, z));
    touches || p * q < 0 && r * s < 0
}

impl Domain {
    /// Creates a polygon from its corners (s, t), in either direction of traversal. The first
    /// corner may be repeated at the end.
    ///
    /// ```
    /// use isoform_algebra::RBig;
    /// use isoform_tess::{Domain, DomainError};
    ///
    /// let corners = |list: &[[i64; 2]]| list.iter().map(|p| p.map(RBig::from)).collect();
    /// let arrow = Domain::polygon(corners(&[[0, 0], [2, 1], [0, 2], [1, 1]]))?;
    /// assert_eq!(arrow.bounds(), [[0.into(), 2.into()], [0.into(), 2.into()]]);
    /// // A bow tie is not simple: its first and third sides cross.
    /// let bow_tie = Domain::polygon(corners(&[[0, 0], [1, 1], [1, 0], [0, 1]]));
    /// assert_eq!(bow_tie, Err(DomainError::Crossing { first: 1, second: 3 }));
    /// # Ok::<(), DomainError>(())
    /// ```
    ///
    /// # Errors
    /// [`DomainError`].
    pub fn polygon(mut corners: Vec<Parameters>) -> Result<Self, DomainError> {
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        let n = corners.len();
        if n < 3 {
            return Err(DomainError::TooFew { found: n });
        }
        if n > MAX_CORNERS {
            return Err(DomainError::TooMany { found: n });
        }
        let is_flat = |a: usize, k: usize| area(&corners[0], &corners[a], &corners[k]).is_zero();
        if (0..n).all(|k| is_flat(1, k) && is_flat(2, k)) {
            return Err(DomainError::NoArea);
        }
        let polygon = Self { corners };
        let mut pairs = (0..n).flat_map(|first| (first + 1..n).map(move |second| (first, second)));
        if let Some((first, second)) = pairs.find(|&(k, l)| polygon.do_sides_meet(k, l)) {
            return Err(DomainError::Crossing {
                first: first + 1,
                second: second + 1,
            });
        }
        let mut corners = polygon.corners;
        if signed_area(&corners) < RBig::ZERO {
            corners.reverse();
        }
        Ok(Self { corners })
    }
    /// Returns true if two sides have a common point other than the corner between them, or if one
    /// of them has zero length.
    fn do_sides_meet(&self, first: usize, second: usize) -> bool {
        let ([a, b], [c, d]) = (self.side(first), self.side(second));
        if a == b || c == d {
            true
        } else if second == first + 1 {
            // Adjacent sides may share only the corner between them.
            area(a, b, d).is_zero() && !is_between(b, a, d)
        } else if first == 0 && second + 1 == self.corners.len() {
            area(c, d, b).is_zero() && !is_between(d, c, b)
        } else {
            meet([a, b], [c, d])
        }
    }
    /// Creates the rectangle s₀ ≤ s ≤ s₁, t₀ ≤ t ≤ t₁; the bounds may be given in either order.
    ///
    /// # Errors
    /// [`DomainError::NoArea`].
    pub fn rectangle([s0, s1]: [RBig; 2], [t0, t1]: [RBig; 2]) -> Result<Self, DomainError> {
        if s0 == s1 || t0 == t1 {
            return Err(DomainError::NoArea);
        }
        Self::polygon(vec![
            [s0.clone(), t0.clone()],
            [s1.clone(), t0],
            [s1, t1.clone()],
            [s0, t1],
        ])
    }
    /// Returns the corners, counterclockwise.
    pub fn corners(&self) -> &[Parameters] {
        &self.corners
    }
    /// Returns the ends of a side.
    pub(crate) fn side(&self, k: usize) -> [&Parameters; 2] {
        [
            &self.corners[k],
            &self.corners[(k + 1) % self.corners.len()],
        ]
    }
    /// Returns the minimum and maximum of s, and of t.
    pub fn bounds(&self) -> [[RBig; 2]; 2] {
        [0, 1].map(|k| {
            let all = || self.corners.iter().map(|c| c[k].clone());
            [all().min(), all().max()].map(|x| x.expect("a domain has corners"))
        })
    }
    /// Returns the lines of the sides, as forms in (s, t, w).
    pub(crate) fn lines(&self) -> Vec<Poly> {
        let line = |k: usize| {
            let [[s0, t0], [s1, t1]] = self.side(k);
            let (ds, dt) = (s1 - s0, t1 - t0);
            let terms = [
                (Poly::var(1), ds.clone()),
                (Poly::var(0), -dt.clone()),
                (Poly::var(2), dt * s0 - ds * t0),
            ];
            let scaled = terms.into_iter().map(|(p, c)| p.scale(&c));
            scaled.fold(Poly::zero(), |sum, p| sum + p).primitive()
        };
        (0..self.corners.len()).map(line).collect()
    }
    /// Returns true if a point that lies on no line of a side is inside, by the parity of
    /// crossings.
    pub(crate) fn contains(&self, p: &Parameters) -> bool {
        let crosses = |k: usize| {
            let [a, b] = self.side(k);
            let up = b[1] > a[1];
            (a[1] > p[1]) != (b[1] > p[1]) && (area(a, b, p) > RBig::ZERO) == up
        };
        (0..self.corners.len()).filter(|&k| crosses(k)).count() % 2 == 1
    }
    /// Returns true if a point (s : t : w) that is not next to a side is outside.
    pub(crate) fn is_outside(&self, [s, t, w]: [f64; 3]) -> bool {
        match [s / w, t / w].map(RBig::try_from) {
            [Ok(s), Ok(t)] => !self.contains(&[s, t]),
            _ => true,
        }
    }
    /// Returns the side that holds a point in its interior.
    pub(crate) fn side_at(&self, p: &Parameters) -> Option<usize> {
        (0..self.corners.len()).find(|&k| {
            let [a, b] = self.side(k);
            p != a && p != b && is_between(p, a, b) && area(a, b, p).is_zero()
        })
    }
}

/// Returns s and t of a point of a unit triangle, if they are finite.
pub(crate) fn parameters(quadrant: usize, [u, v]: [&RBig; 2]) -> Option<Parameters> {
    let w = RBig::ONE - u - v;
    let [s, t] = QUADRANTS[quadrant].map(RBig::from);
    (!w.is_zero()).then(|| [s * u / &w, t * v / w])
}

/// Bernstein coefficients of a polynomial in s and t over a rectangle, in rows by s.
#[derive(Clone)]
struct Net {
    columns: usize,
    coefficients: Vec<RBig>,
}

impl Net {
    fn new(p: &Poly, degree: [usize; 2], [[s0, s1], [t0, t1]]: &[[RBig; 2]; 2]) -> Self {
        let linear =
            |a: &RBig, b: &RBig, k: usize| Poly::constant(a.clone()) + Poly::var(k).scale(&(b - a));
        let q = p.compose(&[linear(s0, s1, 0), linear(t0, t1, 1)]);
        let [m, n] = degree;
        let mut c = vec![RBig::ZERO; (m + 1) * (n + 1)];
        for (e, x) in q.terms() {
            c[usize::from(e[0]) * (n + 1) + usize::from(e[1])] =
                RBig::from(x.clone()) / RBig::from(q.denominator().clone());
        }
        let mut net = Self {
            columns: n + 1,
            coefficients: c,
        };
        // Conversion from powers: the k-th Bernstein coefficient is the sum of aᵢ·(k over i)/(n
        // over i).
        net.each(true, from_powers);
        net.each(false, from_powers);
        net
    }
    /// Applies a function to every row, or to every column.
    fn each(&mut self, rows: bool, mut f: impl FnMut(&mut [RBig])) {
        let (columns, lines) = (self.columns, self.coefficients.len() / self.columns);
        let (outer, inner) = if rows {
            (lines, columns)
        } else {
            (columns, lines)
        };
        let place = |o: usize, i: usize| {
            if rows {
                o * columns + i
            } else {
                i * columns + o
            }
        };
        for o in 0..outer {
            let mut line: Vec<RBig> = (0..inner)
                .map(|i| self.coefficients[place(o, i)].clone())
                .collect();
            f(&mut line);
            for (i, x) in line.into_iter().enumerate() {
                self.coefficients[place(o, i)] = x;
            }
        }
    }
    /// Returns the coefficients over the two halves of the range of s, or of t.
    fn halves(&self, by_t: bool) -> [Self; 2] {
        [false, true].map(|second| {
            let mut half = self.clone();
            half.each(by_t, |line| halve(line, second));
            half
        })
    }
}

/// Converts coefficients of powers to Bernstein coefficients.
fn from_powers(line: &mut [RBig]) {
    let n = line.len() - 1;
    let binomial = |n: usize, k: usize| {
        (0..k).fold(RBig::ONE, |b, i| b * RBig::from(n - i) / RBig::from(i + 1))
    };
    let scaled: Vec<RBig> = line
        .iter()
        .enumerate()
        .map(|(i, a)| a / binomial(n, i))
        .collect();
    for (k, x) in line.iter_mut().enumerate() {
        *x = (0..=k).fold(RBig::ZERO, |sum, i| sum + &scaled[i] * binomial(k, i));
    }
}
/// Computes the Bernstein coefficients over the first or second half, by de Casteljau's algorithm.
fn halve(line: &mut [RBig], second: bool) {
    let n = line.len();
    let half = RBig::from(2);
    for level in 1..n {
        if second {
            for i in 0..n - level {
                line[i] = (&line[i] + &line[i + 1]) / &half;
            }
        } else {
            for i in (level..n).rev() {
                line[i] = (&line[i] + &line[i - 1]) / &half;
            }
        }
    }
}

/// Returns bounds of the image of a map over a domain, the minimum and maximum of each coordinate;
/// `None` unless W is proved to have no zero in the rectangle around the domain.
pub fn bounds_over(map: &Map, domain: &Domain) -> Option<[[RBig; 2]; 3]> {
    image_bounds(map.affine(), &domain.bounds())
}

/// Returns twice the signed area of a polygon, positive if it is counterclockwise.
fn signed_area(corners: &[Parameters]) -> RBig {
    (1..corners.len() - 1)
        .map(|k| area(&corners[0], &corners[k], &corners[k + 1]))
        .fold(RBig::ZERO, |a, b| a + b)
}

/// Returns the minimum and maximum of x/w, y/w and z/w of the control points over a rectangle of
/// the parameters: bounds of the image. `None` unless W is proved to have no zero there. The
/// polynomials are in s and t.
pub(crate) fn image_bounds(
    polynomials: &[Poly; 4],
    rectangle: &[[RBig; 2]; 2],
) -> Option<[[RBig; 2]; 3]> {
    let degree = [0, 1].map(|k| polynomials.iter().map(|p| p.degree(k)).max().unwrap_or(0));
    let nets = polynomials
        .each_ref()
        .map(|p| Net::new(p, degree, rectangle));
    let mut bounds: Option<[[RBig; 2]; 3]> = None;
    // Four halvings of each of the two parameters: cells of a sixteenth.
    let mut stack = vec![(nets, 8)];
    while let Some((nets, depth)) = stack.pop() {
        if has_one_sign(&nets[3].coefficients) {
            for k in 0..nets[3].coefficients.len() {
                let [x, y, z, w] = nets.each_ref().map(|n| &n.coefficients[k]);
                include(&mut bounds, [x / w, y / w, z / w]);
            }
        } else if depth == 0 {
            return None;
        } else {
            let halves = nets.each_ref().map(|n| n.halves(depth % 2 == 0));
            for k in 0..2 {
                stack.push((halves.each_ref().map(|h| h[k].clone()), depth - 1));
            }
        }
    }
    bounds
}

/// Returns true if all numbers have one sign and none is 0.
fn has_one_sign(numbers: &[RBig]) -> bool {
    let first = signum(&numbers[0]);
    first != 0 && numbers.iter().all(|x| signum(x) == first)
}

/// Extends bounds to contain a point.
fn include(bounds: &mut Option<[[RBig; 2]; 3]>, point: [RBig; 3]) {
    let Some(bounds) = bounds else {
        *bounds = Some(point.map(|x| [x.clone(), x]));
        return;
    };
    for ([lo, hi], x) in bounds.iter_mut().zip(point) {
        if x < *lo {
            *lo = x;
        } else if x > *hi {
            *hi = x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[[i64; 2]]) -> Vec<Parameters> {
        list.iter().map(|p| p.map(RBig::from)).collect()
    }

    #[test]
    fn polygons_are_simple() {
        let square = Domain::polygon(points(&[[0, 0], [0, 2], [2, 2], [2, 0]])).expect("a square");
        assert_eq!(
            square,
            Domain::rectangle([2, 0].map(RBig::from), [0, 2].map(RBig::from))
                .expect("the same")
                .turned(&square)
        );
        let wrong = |list: &[[i64; 2]]| Domain::polygon(points(list)).expect_err("no polygon");
        assert_eq!(wrong(&[[0, 0], [1, 1]]), DomainError::TooFew { found: 2 });
        assert_eq!(
            wrong(&[[0, 0], [1, 1], [0, 0]]),
            DomainError::TooFew { found: 2 }
        );
        assert_eq!(
            wrong(&[[0, 0], [1, 1], [3, 3], [2, 2]]),
            DomainError::NoArea
        );
        assert_eq!(
            wrong(&[[0, 0], [2, 2], [2, 0], [0, 2]]),
            DomainError::Crossing {
                first: 1,
                second: 3
            }
        );
        assert_eq!(
            wrong(&[[0, 0], [4, 0], [2, 0], [2, 2]]),
            DomainError::Crossing {
                first: 1,
                second: 2
            },
            "a side that goes back"
        );
        assert_eq!(
            wrong(&[[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]]),
            DomainError::Crossing {
                first: 1,
                second: 3
            },
            "a corner on a side"
        );
        assert!(
            Domain::polygon(points(&[[0, 0], [1, 0], [2, 0], [2, 2]])).is_ok(),
            "a corner of half a turn"
        );
    }

    impl Domain {
        /// Rotates the corners so that the first corner of another domain comes first.
        fn turned(mut self, other: &Self) -> Self {
            let k = self
                .corners
                .iter()
                .position(|c| *c == other.corners[0])
                .expect("the corner");
            self.corners.rotate_left(k);
            self
        }
    }

    #[test]
    fn insides_and_sides() {
        // An L-shaped polygon.
        let l = Domain::polygon(points(&[[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]]))
            .expect("a polygon");
        let half = |s: i64, t: i64| [s, t].map(|x| RBig::from(x) / RBig::from(2));
        assert!(l.contains(&half(1, 1)) && l.contains(&half(7, 1)) && l.contains(&half(1, 7)));
        assert!(!l.contains(&half(3, 3)) && !l.contains(&half(-1, 1)) && !l.contains(&half(9, 1)));
        assert_eq!(l.side_at(&half(3, 2)), Some(2));
        assert_eq!(
            (l.side_at(&half(1, 2)), l.side_at(&half(2, 2))),
            (None, None),
            "on the line only; a corner"
        );
        for (k, line) in l.lines().iter().enumerate() {
            let [a, b] = l.side(k);
            assert!(
                [a, b].iter().all(|p| line
                    .eval(&[p[0].clone(), p[1].clone(), RBig::ONE])
                    .is_zero()),
                "{k}"
            );
        }
    }

    #[test]
    fn bounds_of_images() {
        let texts = ["s", "t", "s*t", "2 - s^2"];
        let p = texts.map(|t| Poly::parse(t, &["s", "t"]).expect("a polynomial"));
        let rectangle = |a: i64, b: i64| [[a, b].map(RBig::from), [RBig::ZERO, RBig::from(3)]];
        let [x, y, z] = image_bounds(&p, &rectangle(0, 1)).expect("no pole");
        let is = |[lo, hi]: [RBig; 2], a: f64, b: f64| {
            lo.to_f64().value() <= a && hi.to_f64().value() >= b && hi.to_f64().value() < 2.5 * b
        };
        assert!(is(x, 0.0, 1.0) && is(y, 0.0, 3.0) && is(z, 0.0, 3.0));
        assert!(
            image_bounds(&p, &rectangle(1, 2)).is_none(),
            "a pole inside"
        );
        assert!(image_bounds(&p, &rectangle(2, 3)).is_some(), "W < 0");
    }
}
