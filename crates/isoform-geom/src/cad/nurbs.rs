//! Rational B-spline curves and surfaces (L. Piegl and W. Tiller, The NURBS Book, 1997, chapters 2
//! to 4).

use super::{Placement, SurfaceJet};
use crate::{Aabb, Point3, norm, sub};

/// Maximum degree. CAD systems stop at 25.
pub const MAX_DEGREE: usize = 25;

/// Maximum distance of the ends of a closed spline, relative to the extent of its control points:
/// files hold coordinates with seven digits or more.
const CLOSURE_TOLERANCE: f64 = 1e-7;

/// Values of the nonzero basis functions, with their first and second derivatives.
type Basis = [[f64; MAX_DEGREE + 1]; 3];

/// Reason why a spline is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NurbsError {
    /// The degree is 0 or exceeds [`MAX_DEGREE`].
    #[error("its degree must be 1 to 25")]
    Degree,
    /// The number of knots is not that of control points + degree + 1.
    #[error("the numbers of knots, of control points and the degree do not agree")]
    Counts,
    /// Knots descend, are not finite, or bound an empty domain.
    #[error("its knots must be finite and ascend")]
    Knots,
    /// A knot within the domain occurs more often than the degree says: the spline would break.
    #[error("a knot within its domain occurs more often than its degree")]
    Multiplicity,
    /// A weight is not positive, or a coordinate is not finite.
    #[error("its weights must be positive and its points finite")]
    Control,
}

/// Knots of one direction.
#[derive(Clone, Debug, PartialEq)]
struct Knots {
    degree: usize,
    values: Vec<f64>,
}

impl Knots {
    fn new(degree: usize, values: Vec<f64>, controls: usize) -> Result<Self, NurbsError> {
        if !(1..=MAX_DEGREE).contains(&degree) {
            return Err(NurbsError::Degree);
        }
        if controls <= degree || values.len() != controls + degree + 1 {
            return Err(NurbsError::Counts);
        }
        let ascend = values.windows(2).all(|w| w[0] <= w[1]);
        if !ascend || values.iter().any(|v| !v.is_finite()) {
            return Err(NurbsError::Knots);
        }
        let [lo, hi] = [values[degree], values[controls]];
        if !(hi - lo).is_finite() || lo >= hi {
            return Err(NurbsError::Knots);
        }
        let breaks = values
            .windows(degree + 1)
            .any(|w| w[0] == w[degree] && w[0] > lo && w[0] < hi);
        if breaks {
            return Err(NurbsError::Multiplicity);
        }
        Ok(Self { degree, values })
    }

    fn domain(&self) -> [f64; 2] {
        let end = self.values.len() - self.degree - 1;
        [self.values[self.degree], self.values[end]]
    }

    /// Returns the distinct knots within the domain, its ends included.
    fn breaks(&self) -> Vec<f64> {
        let end = self.values.len() - self.degree - 1;
        let mut breaks = self.values[self.degree..=end].to_vec();
        breaks.dedup();
        breaks
    }

    /// Returns the index of the knot at which the interval of a parameter begins.
    fn span(&self, t: f64) -> usize {
        let last = self.values.len() - self.degree - 2;
        let mut span = self.values.partition_point(|k| *k <= t);
        span = span.saturating_sub(1).clamp(self.degree, last);
        // An interval of length zero has no basis.
        while self.values[span] >= self.values[span + 1] && span > self.degree {
            span -= 1;
        }
        while self.values[span] >= self.values[span + 1] && span < last {
            span += 1;
        }
        span
    }

    /// Returns the nonzero basis functions with two derivatives, and the index of the first.
    fn basis(&self, t: f64) -> (usize, Basis) {
        let [lo, hi] = self.domain();
        let (p, t) = (self.degree, t.clamp(lo, hi));
        let (span, knots) = (self.span(t), &self.values);
        // Rows of degrees p − 2, p − 1 and p; row q begins with function span − q.
        let mut rows = [[0.0; MAX_DEGREE + 1]; 3];
        let mut row = [0.0; MAX_DEGREE + 1];
        row[0] = 1.0;
        for q in 0..=p {
            if q > 0 {
                let mut saved = 0.0;
                for r in 0..q {
                    let (right, left) = (knots[span + r + 1], knots[span + 1 + r - q]);
                    let share = row[r] / (right - left);
                    row[r] = saved + (right - t) * share;
                    saved = (t - left) * share;
                }
                row[q] = saved;
            }
            if q + 2 >= p {
                rows[q + 2 - p] = row;
            }
        }
        let first = self.derivative(span, p, &rows[1]);
        let mut second = [0.0; MAX_DEGREE + 1];
        if p >= 2 {
            second = self.derivative(span, p, &self.derivative(span, p - 1, &rows[0]));
        }
        (span - p, [rows[2], first, second])
    }

    /// Returns the derivatives of the functions of degree q, by values of those of degree q − 1.
    fn derivative(&self, span: usize, q: usize, below: &[f64]) -> [f64; MAX_DEGREE + 1] {
        let knots = &self.values;
        let share = |r: usize| {
            // Function r of degree q − 1 begins at knot span − q + 1 + r.
            let begin = span + 1 + r - q;
            q as f64 * below[r] / (knots[begin + q] - knots[begin])
        };
        let mut out = [0.0; MAX_DEGREE + 1];
        for r in 0..=q {
            let left = if r > 0 { share(r - 1) } else { 0.0 };
            let right = if r < q { share(r) } else { 0.0 };
            out[r] = left - right;
        }
        out
    }
}

/// Returns homogeneous coordinates of points with weights.
fn homogeneous(points: &[Point3], weights: Option<&[f64]>) -> Result<Vec<[f64; 4]>, NurbsError> {
    if weights.is_some_and(|w| w.len() != points.len()) {
        return Err(NurbsError::Counts);
    }
    let control: Vec<[f64; 4]> = (0..points.len())
        .map(|i| {
            let w = weights.map_or(1.0, |w| w[i]);
            let [x, y, z] = points[i].map(|v| v * w);
            [x, y, z, w]
        })
        .collect();
    let is_valid = |c: &[f64; 4]| c.iter().all(|v| v.is_finite()) && c[3] > 0.0;
    if !control.iter().all(is_valid) {
        return Err(NurbsError::Control);
    }
    Ok(control)
}

fn placed(control: &[[f64; 4]], by: &Placement) -> Vec<[f64; 4]> {
    let place = |c: &[f64; 4]| {
        let moved = by.vector([c[0], c[1], c[2]]);
        let [x, y, z] = std::array::from_fn(|k| moved[k] + c[3] * by.shift[k]);
        [x, y, z, c[3]]
    };
    control.iter().map(place).collect()
}

fn add(to: &mut [f64; 4], factor: f64, c: &[f64; 4]) {
    (0..4).for_each(|k| to[k] += factor * c[k]);
}

fn point(c: [f64; 4]) -> Point3 {
    [c[0] / c[3], c[1] / c[3], c[2] / c[3]]
}

/// Rational B-spline curve.
#[derive(Clone, Debug, PartialEq)]
pub struct NurbsCurve {
    knots: Knots,
    /// Control points in homogeneous coordinates: w x, w y, w z, w.
    control: Vec<[f64; 4]>,
    /// True if both ends are one point.
    is_closed: bool,
}

impl NurbsCurve {
    /// Creates a curve of control points, of their weights (1 if `None`) and of knots, each as
    /// often as it counts.
    ///
    /// # Errors
    /// [`NurbsError`].
    pub fn new(
        degree: usize,
        knots: Vec<f64>,
        points: &[Point3],
        weights: Option<&[f64]>,
    ) -> Result<Self, NurbsError> {
        let knots = Knots::new(degree, knots, points.len())?;
        let control = homogeneous(points, weights)?;
        let mut spline = Self {
            knots,
            control,
            is_closed: false,
        };
        let ends = spline.domain().map(|t| spline.at(t)[0]);
        spline.is_closed = norm(sub(ends[0], ends[1])) <= closure_distance(points);
        Ok(spline)
    }
    /// Returns the length of the domain if both ends are one point, else `None`.
    pub fn period(&self) -> Option<f64> {
        let [first, last] = self.domain();
        self.is_closed.then_some(last - first)
    }
    /// Returns the first and last parameter.
    pub fn domain(&self) -> [f64; 2] {
        self.knots.domain()
    }
    /// Returns the degree.
    pub fn degree(&self) -> usize {
        self.knots.degree
    }
    /// Returns the distinct knots of the domain, its ends included.
    pub fn breaks(&self) -> Vec<f64> {
        self.knots.breaks()
    }
    /// Returns the knots within the domain at which the curve may have a corner.
    pub fn kinks(&self) -> Vec<f64> {
        let (p, knots) = (self.knots.degree, &self.knots.values);
        let [lo, hi] = self.domain();
        let full = knots.windows(p).filter(|w| w[0] == w[p - 1]);
        let mut kinks: Vec<f64> = full.map(|w| w[0]).filter(|t| *t > lo && *t < hi).collect();
        kinks.dedup();
        kinks
    }
    /// Returns the control points.
    pub fn control(&self) -> impl Iterator<Item = Point3> + '_ {
        self.control.iter().map(|c| point(*c))
    }
    /// Returns the point at a parameter, with the first and second derivatives. Beyond its domain a
    /// closed spline continues from the start, another stays at its end.
    pub fn at(&self, t: f64) -> [Point3; 3] {
        let t = wrapped(t, self.domain(), self.is_closed);
        let (first, basis) = self.knots.basis(t);
        let mut sums = [[0.0; 4]; 3];
        for r in 0..=self.knots.degree {
            for (sum, basis) in sums.iter_mut().zip(&basis) {
                add(sum, basis[r], &self.control[first + r]);
            }
        }
        let [a, da, dda] = sums;
        let p = point(a);
        let d: Point3 = std::array::from_fn(|k| (da[k] - da[3] * p[k]) / a[3]);
        let dd = std::array::from_fn(|k| (dda[k] - 2.0 * da[3] * d[k] - dda[3] * p[k]) / a[3]);
        [p, d, dd]
    }
    /// Returns the curve in another place.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Self {
        Self {
            knots: self.knots.clone(),
            control: placed(&self.control, by),
            is_closed: self.is_closed,
        }
    }
}

/// Rational B-spline surface.
#[derive(Clone, Debug, PartialEq)]
pub struct NurbsSurface {
    knots: [Knots; 2],
    /// Control points in homogeneous coordinates; v runs faster than u.
    control: Vec<[f64; 4]>,
    /// True for a direction in which both sides are one curve.
    is_closed: [bool; 2],
    /// Sides that are single points: the direction that is constant there, and its value.
    poles: Vec<(usize, f64)>,
}

impl NurbsSurface {
    /// Creates a surface of control points, v running faster than u, of their weights (1 if `None`)
    /// and of the knots of u and v, each as often as it counts.
    ///
    /// # Errors
    /// [`NurbsError`].
    pub fn new(
        degrees: [usize; 2],
        knots: [Vec<f64>; 2],
        points: &[Point3],
        weights: Option<&[f64]>,
    ) -> Result<Self, NurbsError> {
        let [u, v] = knots;
        let count = |knots: &[f64], degree: usize| knots.len().checked_sub(degree + 1);
        if degrees.iter().any(|d| *d > MAX_DEGREE) {
            return Err(NurbsError::Degree);
        }
        let counts = count(&u, degrees[0]).zip(count(&v, degrees[1]));
        let (rows, columns) = counts.ok_or(NurbsError::Counts)?;
        if rows.checked_mul(columns) != Some(points.len()) {
            return Err(NurbsError::Counts);
        }
        let knots = [
            Knots::new(degrees[0], u, rows)?,
            Knots::new(degrees[1], v, columns)?,
        ];
        let control = homogeneous(points, weights)?;
        let mut spline = Self {
            knots,
            control,
            is_closed: [false; 2],
            poles: Vec::new(),
        };
        spline.find_closure(closure_distance(points));
        Ok(spline)
    }
    /// Finds sides that meet or that are single points, up to a distance.
    fn find_closure(&mut self, tolerance: f64) {
        for k in 0..2 {
            let [lo, hi] = self.domain()[k];
            let side = |at: f64| -> Vec<Point3> {
                let across = samples(&self.breaks(1 - k), self.degree(1 - k) + 1);
                let place = |t: f64| if k == 0 { [at, t] } else { [t, at] };
                across.into_iter().map(|t| self.at(place(t)).p).collect()
            };
            let sides = [side(lo), side(hi)];
            let near = |p: &Point3, q: &Point3| norm(sub(*p, *q)) <= tolerance;
            let is_closed = sides[0].iter().zip(&sides[1]).all(|(p, q)| near(p, q));
            for (at, side) in [lo, hi].into_iter().zip(&sides) {
                if side.iter().all(|p| near(p, &side[0])) {
                    self.poles.push((k, at));
                }
            }
            self.is_closed[k] = is_closed;
        }
    }
    /// Returns the lengths of the domain in closed directions, `None` in others.
    pub fn periods(&self) -> [Option<f64>; 2] {
        [0, 1].map(|k| {
            let [lo, hi] = self.domain()[k];
            self.is_closed[k].then_some(hi - lo)
        })
    }
    /// Returns the sides that are single points: the direction that is constant, 0 for u and 1 for
    /// v, and its value.
    pub fn poles(&self) -> &[(usize, f64)] {
        &self.poles
    }
    /// Returns the first and last parameter of u and of v.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        [self.knots[0].domain(), self.knots[1].domain()]
    }
    /// Returns the distinct knots of u (0) or v (1) within the domain, its ends included.
    pub fn breaks(&self, direction: usize) -> Vec<f64> {
        self.knots[direction].breaks()
    }
    /// Returns the degree of u (0) or v (1).
    pub fn degree(&self, direction: usize) -> usize {
        self.knots[direction].degree
    }
    /// Returns the control points.
    pub fn control(&self) -> impl Iterator<Item = Point3> + '_ {
        self.control.iter().map(|c| point(*c))
    }
    /// Returns the point at parameters, with the derivatives up to the second order. Beyond its
    /// domain a closed direction continues from the start, another stays at its end.
    pub fn at(&self, [u, v]: [f64; 2]) -> SurfaceJet {
        let domain = self.domain();
        let u = wrapped(u, domain[0], self.is_closed[0]);
        let v = wrapped(v, domain[1], self.is_closed[1]);
        let (first_u, basis_u) = self.knots[0].basis(u);
        let (first_v, basis_v) = self.knots[1].basis(v);
        let columns = self.knots[1].values.len() - self.knots[1].degree - 1;
        // Orders of derivatives of the sums, and the sums.
        const ORDERS: [[usize; 2]; 6] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];
        let mut sums = [[0.0; 4]; 6];
        for i in 0..=self.knots[0].degree {
            let mut along = [[0.0; 4]; 3];
            for j in 0..=self.knots[1].degree {
                let c = &self.control[(first_u + i) * columns + first_v + j];
                for (sum, basis) in along.iter_mut().zip(&basis_v) {
                    add(sum, basis[j], c);
                }
            }
            for (sum, [a, b]) in sums.iter_mut().zip(ORDERS) {
                add(sum, basis_u[a][i], &along[b]);
            }
        }
        let [s, su, sv, suu, suv, svv] = sums;
        let (p, w) = (point(s), s[3]);
        let first = |d: [f64; 4]| -> Point3 { std::array::from_fn(|k| (d[k] - d[3] * p[k]) / w) };
        let (pu, pv) = (first(su), first(sv));
        let second = |dd: [f64; 4], a: [f64; 4], b: [f64; 4], pa: Point3, pb: Point3| -> Point3 {
            std::array::from_fn(|k| (dd[k] - a[3] * pb[k] - b[3] * pa[k] - dd[3] * p[k]) / w)
        };
        SurfaceJet {
            p,
            u: pu,
            v: pv,
            uu: second(suu, su, su, pu, pu),
            uv: second(suv, su, sv, pu, pv),
            vv: second(svv, sv, sv, pv, pv),
        }
    }
    /// Returns the surface in another place.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Self {
        Self {
            knots: self.knots.clone(),
            control: placed(&self.control, by),
            is_closed: self.is_closed,
            poles: self.poles.clone(),
        }
    }
}

/// Returns a parameter within the domain: shifted by periods if the spline is closed.
fn wrapped(t: f64, [lo, hi]: [f64; 2], is_closed: bool) -> f64 {
    if is_closed && !(lo..=hi).contains(&t) {
        lo + (t - lo).rem_euclid(hi - lo)
    } else {
        t
    }
}

/// Returns the distance up to which points of a spline count as one.
fn closure_distance(points: &[Point3]) -> f64 {
    CLOSURE_TOLERANCE * Aabb::from_points(points).diagonal()
}

/// Returns some values in each interval, and the ends.
fn samples(breaks: &[f64], each: usize) -> Vec<f64> {
    let mut all = vec![breaks[0]];
    for w in breaks.windows(2) {
        all.extend((1..=each).map(|k| w[0] + (w[1] - w[0]) * k as f64 / each as f64));
    }
    all
}
