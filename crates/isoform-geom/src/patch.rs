//! Rational tensor-product Bézier patches.

use crate::{Aabb, Gram, Point3, cross, dot};

/// Rational patch p = (x/w, y/w, z/w) over \[0, 1\]²: p*(u, v) = Σ Bᵢᵐ(u) Bⱼⁿ(v) cᵢⱼ with
/// homogeneous control points cᵢⱼ ∈ ℝ⁴, whose first three coordinates are multiplied by the weight
/// (Wurm, Jüttler and Kim 2003, section 2.1).
///
/// ```
/// use isoform_geom::RationalPatch;
/// // A quarter of the unit circle, as the only row of a ruled surface of height 2.
/// let s = 0.5f64.sqrt();
/// let arc = |z: f64| [[1.0, 0.0, z, 1.0], [s, s, s * z, s], [0.0, 1.0, z, 1.0]];
/// let patch = RationalPatch::new((1, 2), [arc(0.0), arc(2.0)].concat())?;
/// let [x, y, z] = patch.point(0.5, 0.3);
/// assert!((x * x + y * y - 1.0).abs() < 1e-15 && (z - 1.0).abs() < 1e-15);
/// # Ok::<(), isoform_geom::PatchError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RationalPatch {
    degree: (usize, usize),
    control: Vec<[f64; 4]>,
}

/// Reason for which control points do not form a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatchError {
    /// A degree is 0.
    Degree(usize, usize),
    /// The number of control points is not (m + 1)(n + 1).
    Count {
        /// Number of control points given.
        found: usize,
        /// Number of control points required.
        wanted: usize,
    },
    /// The control point with this index has a coordinate that is not finite.
    NotFinite(usize),
}

impl std::fmt::Display for PatchError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Degree(m, n) => write!(f, "degree {m},{n}: both must be at least 1"),
            Self::Count { found, wanted } => {
                write!(f, "{found} control points, {wanted} are needed")
            }
            Self::NotFinite(i) => write!(f, "control point {i} is not finite"),
        }
    }
}
impl std::error::Error for PatchError {}

/// Point of a patch with its first derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangents {
    /// Point p.
    pub point: Point3,
    /// Derivative ∂p/∂u.
    pub u: Point3,
    /// Derivative ∂p/∂v.
    pub v: Point3,
    /// Weight w.
    pub weight: f64,
}

impl Tangents {
    /// Returns pᵤ × pᵥ, whose length is the area element.
    pub fn normal(&self) -> Point3 {
        cross(self.u, self.v)
    }

    /// Returns the Gauss–Newton step (δu, δv) towards the foot of a point at the offset `r` from
    /// [`point`](Self::point). If pᵤ and pᵥ are parallel, it is very long and has to be truncated.
    ///
    /// ```
    /// use isoform_geom::RationalPatch;
    ///
    /// // On a plane one step leads to the foot, here from (0, 0) to (0.25, 0.5).
    /// let plane = RationalPatch::planar((1, 1), [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    /// let tangents = plane.tangents(0.5, 0.5);
    /// let there = plane.point(0.75, 1.0);
    /// let r = isoform_geom::sub([there[0], there[1], 7.0], tangents.point);
    /// assert_eq!(tangents.step_to_foot(r), (0.25, 0.5));
    /// ```
    pub fn step_to_foot(&self, r: Point3) -> (f64, f64) {
        let gram = Gram::from_vectors(self.u, self.v);
        let [du, dv] = gram.solve_bounded([dot(self.u, r), dot(self.v, r)]);
        (du, dv)
    }
}

/// Evaluates the Bernstein polynomials B₀ⁿ(t) … Bₙⁿ(t) and their derivatives.
pub fn bernstein(n: usize, t: f64) -> (Vec<f64>, Vec<f64>) {
    let (mut b, mut d) = (vec![0.0; n + 1], vec![0.0; n + 1]);
    basis(t, &mut b, &mut d);
    (b, d)
}

/// Evaluates the Bernstein polynomials and their derivatives into `b` and `d`, whose length is the
/// degree plus 1.
fn basis(t: f64, b: &mut [f64], d: &mut [f64]) {
    let n = b.len() - 1;
    b[0] = 1.0;
    d.fill(0.0);
    for k in 1..=n {
        if k == n {
            for i in 0..n {
                d[i] -= n as f64 * b[i];
                d[i + 1] += n as f64 * b[i];
            }
        }
        // Descending order, so that b[i − 1] still has its value of degree k − 1.
        b[k] = t * b[k - 1];
        for i in (1..k).rev() {
            b[i] = (1.0 - t) * b[i] + t * b[i - 1];
        }
        b[0] *= 1.0 - t;
    }
}

/// Replaces Bézier points over \[0, 1\] by those over \[a, b\], which may extend beyond \[0, 1\]:
/// the k-th is the blossom at (a, …, a, b, …, b).
fn reparameterize(points: &mut [[f64; 4]], a: f64, b: f64) {
    let n = points.len() - 1;
    let blossom = |k: usize| {
        let mut c = points.to_vec();
        for level in 0..n {
            let t = if level < n - k { a } else { b };
            for i in 0..n - level {
                for d in 0..4 {
                    c[i][d] = (1.0 - t) * c[i][d] + t * c[i + 1][d];
                }
            }
        }
        c[0]
    };
    let new: Vec<[f64; 4]> = (0..=n).map(blossom).collect();
    points.copy_from_slice(&new);
}

/// Returns the Bézier points of a curve after degree elevation to `degree`.
fn raised(points: &[[f64; 4]], degree: usize) -> Vec<[f64; 4]> {
    let mut points = points.to_vec();
    while points.len() <= degree {
        let n = points.len();
        let blend = |i: usize| {
            let t = i as f64 / n as f64;
            let (before, at) = (points[i.saturating_sub(1)], points[i.min(n - 1)]);
            std::array::from_fn(|d| t * before[d] + (1.0 - t) * at[d])
        };
        points = (0..=n).map(blend).collect();
    }
    points
}

impl RationalPatch {
    /// Returns the patch of degree (m, n) in (u, v) with the control points `control[i * (n + 1) +
    /// j]` = cᵢⱼ.
    pub fn new(degree: (usize, usize), control: Vec<[f64; 4]>) -> Result<Self, PatchError> {
        // A saturated product never equals the length of a list.
        let [m, n] = [degree.0, degree.1].map(|d| d.saturating_add(1));
        let wanted = m.saturating_mul(n);
        if degree.0 == 0 || degree.1 == 0 {
            return Err(PatchError::Degree(degree.0, degree.1));
        }
        if control.len() != wanted {
            return Err(PatchError::Count {
                found: control.len(),
                wanted,
            });
        }
        if let Some(i) = control
            .iter()
            .position(|c| c.iter().any(|v| !v.is_finite()))
        {
            return Err(PatchError::NotFinite(i));
        }
        Ok(Self { degree, control })
    }

    /// Returns the parallelogram with corner `origin` and sides `u`, `v`, with all weights 1.
    ///
    /// # Panics
    /// If a degree is 0.
    pub fn planar(degree: (usize, usize), origin: Point3, u: Point3, v: Point3) -> Self {
        let (m, n) = degree;
        let at = |i: usize, j: usize| {
            let (s, t) = (i as f64 / m as f64, j as f64 / n as f64);
            [0, 1, 2, 3].map(|k| {
                if k == 3 {
                    1.0
                } else {
                    origin[k] + s * u[k] + t * v[k]
                }
            })
        };
        let control = (0..=m)
            .flat_map(|i| (0..=n).map(move |j| at(i, j)))
            .collect();
        Self::new(degree, control).expect("degrees of at least 1 and finite points")
    }

    /// Returns the degrees (m, n) in u and v.
    pub fn degree(&self) -> (usize, usize) {
        self.degree
    }
    /// Returns all control points, row by row: cᵢⱼ at i (n + 1) + j.
    pub fn control(&self) -> &[[f64; 4]] {
        &self.control
    }
    /// Returns the control points for changes; they must stay finite.
    pub fn control_mut(&mut self) -> &mut [[f64; 4]] {
        &mut self.control
    }

    /// Returns p*(u, v) with its first derivatives by u and by v.
    pub fn homogeneous(&self, u: f64, v: f64) -> [[f64; 4]; 3] {
        let (m, n) = (self.degree.0 + 1, self.degree.1 + 1);
        let (mut few, mut many) = ([0.0; 40], Vec::new());
        let all = if 2 * (m + n) <= few.len() {
            &mut few[..2 * (m + n)]
        } else {
            many.resize(2 * (m + n), 0.0);
            &mut many[..]
        };
        let (in_u, in_v) = all.split_at_mut(2 * m);
        let ((a, da), (b, db)) = (in_u.split_at_mut(m), in_v.split_at_mut(n));
        basis(u, a, da);
        basis(v, b, db);
        let mut h = [[0.0; 4]; 3];
        for (i, row) in self.control.chunks(self.degree.1 + 1).enumerate() {
            for (j, c) in row.iter().enumerate() {
                let factors = [a[i] * b[j], da[i] * b[j], a[i] * db[j]];
                for (h, f) in h.iter_mut().zip(factors) {
                    for k in 0..4 {
                        h[k] += f * c[k];
                    }
                }
            }
        }
        h
    }
    /// Returns p(u, v).
    pub fn point(&self, u: f64, v: f64) -> Point3 {
        self.tangents(u, v).point
    }
    /// Returns p(u, v) with its first derivatives.
    pub fn tangents(&self, u: f64, v: f64) -> Tangents {
        let [h, hu, hv] = self.homogeneous(u, v);
        let weight = h[3];
        let point: Point3 = std::array::from_fn(|k| h[k] / weight);
        let along = |d: [f64; 4]| std::array::from_fn(|k| (d[k] - point[k] * d[3]) / weight);
        Tangents {
            point,
            u: along(hu),
            v: along(hv),
            weight,
        }
    }

    /// Returns the surface over \[u₀, u₁\] × \[v₀, v₁\]; parts beyond \[0, 1\]² extrapolate it.
    pub fn part(&self, u: (f64, f64), v: (f64, f64)) -> Self {
        let (m, n) = self.degree;
        let mut control = self.control.clone();
        for row in control.chunks_mut(n + 1) {
            reparameterize(row, v.0, v.1);
        }
        let mut column = vec![[0.0; 4]; m + 1];
        for j in 0..=n {
            for i in 0..=m {
                column[i] = control[i * (n + 1) + j];
            }
            reparameterize(&mut column, u.0, u.1);
            for i in 0..=m {
                control[i * (n + 1) + j] = column[i];
            }
        }
        Self {
            degree: self.degree,
            control,
        }
    }
    /// Returns the two halves of the patch in u, or in v.
    pub fn halves(&self, along_u: bool) -> [Self; 2] {
        let whole = (0.0, 1.0);
        [(0.0, 0.5), (0.5, 1.0)].map(|half| {
            if along_u {
                self.part(half, whole)
            } else {
                self.part(whole, half)
            }
        })
    }

    /// Returns the patch with degrees elevated to (m, n).
    ///
    /// # Panics
    /// If a degree is below the present one.
    pub fn elevated(&self, (m, n): (usize, usize)) -> Self {
        let (m0, n0) = self.degree;
        assert!(m >= m0 && n >= n0, "degrees {m}, {n} below {m0}, {n0}");
        let rows: Vec<Vec<[f64; 4]>> = self
            .control
            .chunks(n0 + 1)
            .map(|row| raised(row, n))
            .collect();
        let columns: Vec<Vec<[f64; 4]>> = (0..=n)
            .map(|j| raised(&rows.iter().map(|row| row[j]).collect::<Vec<_>>(), m))
            .collect();
        let control = (0..=m)
            .flat_map(|i| columns.iter().map(move |column| column[i]))
            .collect();
        Self {
            degree: (m, n),
            control,
        }
    }

    /// Returns the surface with u and v exchanged, which reverses its normal.
    pub fn transposed(&self) -> Self {
        let (m, n) = self.degree;
        let control = (0..=n)
            .flat_map(|j| (0..=m).map(move |i| self.control[i * (n + 1) + j]))
            .collect();
        Self {
            degree: (n, m),
            control,
        }
    }

    /// Returns the smallest and the largest weight of the control points, which bound w on \[0,
    /// 1\]².
    pub fn control_weights(&self) -> (f64, f64) {
        self.control
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), c| {
                (lo.min(c[3]), hi.max(c[3]))
            })
    }
    /// Returns true if w > 0 on \[0, 1\]² follows from the control weights of parts that are
    /// bisected at most `depth` times.
    pub fn weight_is_positive(&self, depth: usize) -> bool {
        let (lo, hi) = self.control_weights();
        // The margin of 1e-14 bounds the rounding errors, two ulps of the largest weight per
        // bisection.
        if lo > 1e-14 * hi {
            return true;
        }
        let (m, n) = self.degree;
        let corners = [0, n, m * (n + 1), m * (n + 1) + n].map(|i| self.control[i][3]);
        if depth == 0 || corners.iter().any(|w| *w <= 0.0) {
            return false;
        }
        let [a, b] = self.halves(true);
        [a, b]
            .iter()
            .flat_map(|half| half.halves(false))
            .all(|quarter| quarter.weight_is_positive(depth - 1))
    }
    /// Returns the bounding box of the control points, which contains the patch; `None` unless all
    /// weights are positive.
    pub fn control_box(&self) -> Option<Aabb> {
        let mut b = Aabb::EMPTY;
        for c in &self.control {
            if c[3] <= 0.0 {
                return None;
            }
            b.add([c[0] / c[3], c[1] / c[3], c[2] / c[3]]);
        }
        Some(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wavy(m: usize, n: usize) -> RationalPatch {
        let at = |i: usize, j: usize| {
            let (s, t) = (i as f64, j as f64);
            let w = 1.0 + 0.3 * (s - 0.7 * t).sin();
            [w * s, w * (t + 0.1 * s * s), w * (s * t).cos(), w]
        };
        RationalPatch::new(
            (m, n),
            (0..=m)
                .flat_map(|i| (0..=n).map(move |j| at(i, j)))
                .collect(),
        )
        .expect("a patch")
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let (p, h) = (wavy(3, 4), 1e-6);
        for (u, v) in [(0.2, 0.9), (0.0, 0.5), (0.7, 1.0)] {
            let t = p.tangents(u, v);
            let (up, um, vp, vm) = (
                p.point(u + h, v),
                p.point(u - h, v),
                p.point(u, v + h),
                p.point(u, v - h),
            );
            for k in 0..3 {
                assert!((t.u[k] - (up[k] - um[k]) / (2.0 * h)).abs() < 1e-8);
                assert!((t.v[k] - (vp[k] - vm[k]) / (2.0 * h)).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn parts_and_extrapolations_are_the_same_surface() {
        let p = wavy(2, 3);
        let q = p.part((-0.2, 0.6), (0.3, 1.4));
        for (s, t) in [(0.0, 0.0), (0.3, 0.8), (1.0, 1.0)] {
            let (a, b) = (q.point(s, t), p.point(-0.2 + 0.8 * s, 0.3 + 1.1 * t));
            for k in 0..3 {
                assert!((a[k] - b[k]).abs() < 1e-13);
            }
        }
        let back = q.part((0.25, 1.5), (-0.3 / 1.1, 0.7 / 1.1));
        for (a, b) in back.control().iter().zip(p.control()) {
            for k in 0..4 {
                assert!((a[k] - b[k]).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn elevated_patches_are_the_same() {
        let (p, q) = (wavy(2, 3), wavy(2, 3).elevated((4, 5)));
        assert_eq!((q.degree(), p.elevated((2, 3))), ((4, 5), p.clone()));
        for (u, v) in [(0.0, 1.0), (0.2, 0.7), (0.9, 0.4)] {
            assert!(
                p.homogeneous(u, v)
                    .iter()
                    .flatten()
                    .zip(q.homogeneous(u, v).iter().flatten())
                    .all(|(a, b)| (a - b).abs() < 1e-13)
            );
        }
    }

    #[test]
    fn transposed_patches_show_the_other_side() {
        let p = wavy(2, 3);
        let q = p.transposed();
        assert_eq!((q.degree(), q.transposed()), ((3, 2), p.clone()));
        assert!(
            p.point(0.2, 0.7)
                .iter()
                .zip(q.point(0.7, 0.2))
                .all(|(a, b)| (a - b).abs() < 1e-15)
        );
    }

    #[test]
    fn weights_are_proved_positive_where_they_are() {
        // w(u) = 1 − 4 c u(1 − u) with the middle coefficient 1 − 2c: positive for c < 1, although
        // that coefficient is not positive for c ≥ 1/2.
        let patch = |c: f64| {
            let row = |w: f64| [[0.0, 0.0, 0.0, w], [0.0, w, 0.0, w]];
            RationalPatch::new((2, 1), [row(1.0), row(1.0 - 2.0 * c), row(1.0)].concat())
                .expect("a patch")
        };
        assert!(patch(0.4).weight_is_positive(0));
        assert!(!patch(0.9).weight_is_positive(0));
        assert!(patch(0.9).weight_is_positive(6));
        assert!(!patch(1.01).weight_is_positive(12));
    }

    #[test]
    fn what_is_no_patch_is_refused() {
        let error = |degree, n: usize, x: f64| {
            RationalPatch::new(degree, vec![[x, 0.0, 0.0, 1.0]; n]).expect_err("no patch")
        };
        assert_eq!(error((0, 2), 3, 0.0), PatchError::Degree(0, 2));
        assert_eq!(
            error((1, 1), 3, 0.0),
            PatchError::Count {
                found: 3,
                wanted: 4
            }
        );
        assert_eq!(error((1, 1), 4, f64::NAN), PatchError::NotFinite(0));
        let most = usize::MAX;
        for degree in [(most, 1), (1, most), (most, most), (most / 2, 3)] {
            let count = PatchError::Count {
                found: 4,
                wanted: most,
            };
            assert_eq!(error(degree, 4, 0.0), count);
        }
    }

    #[test]
    fn bernstein_polynomials_sum_to_one() {
        for n in 1..8 {
            let (b, d) = bernstein(n, 0.3);
            assert!(
                (b.iter().sum::<f64>() - 1.0).abs() < 1e-15 && d.iter().sum::<f64>().abs() < 1e-13
            );
            let mean: f64 = b.iter().enumerate().map(|(i, b)| i as f64 * b).sum();
            assert!((mean - 0.3 * n as f64).abs() < 1e-14);
        }
    }
}
