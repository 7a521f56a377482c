//! Interfaces of implicit functions for all stages: values, derivatives, bounds, and distances with
//! foot points.
//!
//! - [`Field`]: a function of space. [`ParamField`]: a function with parameters, for fits.
//! - [`DistanceField`]: a distance with parameters that also has the *foot* of each point, the
//!   nearest point of the surface.

use crate::{Aabb, Point3};
use isoform_num::{Interval, Jet2, Jet3, Real};

/// Function of space; inside is `value ≥ 0`, the outward normal is −∇f/|∇f|.
pub trait Field: Send + Sync {
    /// Returns f(p).
    fn value(&self, p: Point3) -> f64;
    /// Returns f with its gradient and Hessian.
    fn jet(&self, p: Point3) -> Jet2;
    /// Returns an interval that contains f over the whole region; [`Interval::ALL`] by default.
    fn bounds(&self, _region: Aabb) -> Interval {
        Interval::ALL
    }
    /// Evaluates f at many points. Implementations override this for speed.
    fn values(&self, points: &[Point3], out: &mut [f64]) {
        for (p, v) in points.iter().zip(out) {
            *v = self.value(*p);
        }
    }
    /// Evaluates 2-jets at many points. Implementations override this for speed.
    fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        for (p, j) in points.iter().zip(out) {
            *j = self.jet(*p);
        }
    }
    /// Returns f with all derivatives up to order 3; `None` by default.
    fn jet3(&self, _p: Point3) -> Option<Jet3> {
        None
    }
    /// Returns enclosures of f near a point: of f and its derivatives up to order 2 at the point,
    /// and of the third derivatives over the region, which contains the point; `None` by default.
    fn expansion(&self, _at: Point3, _region: Aabb) -> Option<Expansion> {
        None
    }
    /// Returns the terms of f if f is a polynomial; `None` by default.
    fn terms(&self) -> Option<Terms<'_>> {
        None
    }
}

/// Polynomial in p, where the point of space is (x, y, z) = `origin` + `unit` p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terms<'a> {
    /// Terms c xⁱyʲzᵏ in coordinates of p, as ([i, j, k], c).
    pub list: &'a [([u16; 3], f64)],
    /// Point of space with p = 0.
    pub origin: Point3,
    /// Unit of length of p, in model units.
    pub unit: f64,
}

/// Enclosures of a function's derivatives: up to order 2 at a point, of order 3 in a region about
/// it. By Taylor's theorem they enclose f in the region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion {
    /// Value f at the point.
    pub value: Interval,
    /// Gradient ∇f at the point.
    pub gradient: [Interval; 3],
    /// Second derivatives xx, xy, xz, yy, yz, zz at the point.
    pub hessian: [Interval; 6],
    /// Third derivatives xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz in the region.
    pub third: [Interval; 10],
}

impl Expansion {
    /// Returns the expansion with respect to coordinates q, where p = `unit` q + a constant:
    /// derivatives of order k are multiplied by `unit`ᵏ.
    #[must_use]
    pub fn in_units(&self, unit: Interval) -> Self {
        Self {
            value: self.value,
            gradient: self.gradient.map(|g| unit * g),
            hessian: self.hessian.map(|h| unit * unit * h),
            third: self.third.map(|t| unit * unit * unit * t),
        }
    }
    /// Returns the expansion about the point at the offset `by` in the region, by Taylor's theorem
    /// with the third derivatives of the region, which does not change.
    #[must_use]
    pub fn moved(&self, by: [Interval; 3]) -> Self {
        // δᵀHδ/2 + Tδδδ/6 = δᵀ(H + Tδ/3)δ/2. The interval encloses 1/3, which is not a double.
        let share = Interval::new((1.0f64 / 3.0).next_down(), (1.0f64 / 3.0).next_up());
        let value = (0..3).fold(self.value, |sum, i| {
            let bent = (0..3).fold(Interval::constant(0.0), |sum, j| {
                let slope = self.hessian[Self::SECOND[i][j]] + share * self.third_along(i, j, by);
                sum + slope * by[j]
            });
            sum + (self.gradient[i] + Interval::constant(0.5) * bent) * by[i]
        });
        let mut hessian = self.hessian;
        for (i, row) in Self::SECOND.iter().enumerate() {
            for (j, place) in row.iter().enumerate().skip(i) {
                hessian[*place] = self.hessian[*place] + self.third_along(i, j, by);
            }
        }
        Self {
            value,
            gradient: self.gradient_at(by),
            hessian,
            third: self.third,
        }
    }

    /// Returns enclosures of ∇f at all points of the region whose offset from the point is in `by`.
    pub fn gradient_at(&self, by: [Interval; 3]) -> [Interval; 3] {
        std::array::from_fn(|i| {
            self.gradient[i]
                + (0..3).fold(Interval::constant(0.0), |sum, j| {
                    let half = Interval::constant(0.5) * self.third_along(i, j, by);
                    sum + (self.hessian[Self::SECOND[i][j]] + half) * by[j]
                })
        })
    }

    /// Returns Σₖ ∂³f/∂xᵢ∂xⱼ∂xₖ δₖ.
    fn third_along(&self, i: usize, j: usize, by: [Interval; 3]) -> Interval {
        (0..3).fold(Interval::constant(0.0), |sum, k| {
            sum + self.third[Self::THIRD[i][j][k]] * by[k]
        })
    }

    /// Index of ∂²f/∂xᵢ∂xⱼ among the six second derivatives.
    pub const SECOND: [[usize; 3]; 3] = isoform_num::SECOND;
    /// Index of ∂³f/∂xᵢ∂xⱼ∂xₖ among the ten third derivatives.
    pub const THIRD: [[[usize; 3]; 3]; 3] = isoform_num::THIRD;
}

/// Function of space with parameters a, such as the residual of a fit.
pub trait ParamField: Send + Sync {
    /// Returns the number of parameters.
    fn dim(&self) -> usize;
    /// Computes f(pᵢ, a) for all points.
    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]);
    /// Computes f(pᵢ, a) and its derivatives with respect to the parameters, point by point: `jac[i
    /// * dim + j]` = ∂f(pᵢ)/∂aⱼ.
    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]);
    /// Computes the weighted normal equations: returns Σ wᵢ fᵢ², writes Jᵀ W f into `gradient`
    /// (dim) and Jᵀ W J into `hessian` (dim × dim, full symmetric). Empty `weights` are all 1;
    /// points of weight 0 add nothing, even if f is NaN there. The order of summation is fixed, so
    /// that results are reproducible bit for bit. Implementations override this for speed.
    fn normal_equations(
        &self,
        points: &[Point3],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64 {
        let m = self.dim();
        let (mut f, mut jac) = (vec![0.0; points.len()], vec![0.0; points.len() * m]);
        self.jacobian(points, a, &mut f, &mut jac);
        normal_equations_of(&f, &jac, weights, gradient, hessian)
    }
    /// Computes f(pᵢ, a) and its gradient in space, point by point.
    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]);
    /// Returns Σ wᵢ fᵢ², summed in the order of [`ParamField::normal_equations`]. Implementations
    /// override this for speed.
    fn sum_of_squares(&self, points: &[Point3], weights: &[f64], a: &[f64]) -> f64 {
        let mut f = vec![0.0; points.len()];
        self.values(points, a, &mut f);
        let terms = f.iter().enumerate().map(|(i, f)| match weights.get(i) {
            Some(0.0) => 0.0,
            Some(w) => w * f * f,
            None => f * f,
        });
        terms.sum()
    }
}

/// Computes the sums of [`ParamField::normal_equations`] from the values and derivatives at all
/// points.
pub fn normal_equations_of(
    f: &[f64],
    jac: &[f64],
    weights: &[f64],
    gradient: &mut [f64],
    hessian: &mut [f64],
) -> f64 {
    let m = gradient.len();
    gradient.fill(0.0);
    hessian.fill(0.0);
    let mut sum = 0.0;
    // Blocks of points are stored by columns: products of whole columns are fast.
    let mut columns = vec![[0.0; COLUMN_POINTS]; m + 1];
    let mut weighted = columns.clone();
    for (c, f) in f.chunks(COLUMN_POINTS).enumerate() {
        let first = c * COLUMN_POINTS;
        if f.len() < COLUMN_POINTS {
            columns.iter_mut().for_each(|c| c.fill(0.0));
            weighted.iter_mut().for_each(|c| c.fill(0.0));
        }
        for (l, f) in f.iter().enumerate() {
            let w = weights.get(first + l).copied().unwrap_or(1.0);
            let row = &jac[(first + l) * m..(first + l + 1) * m];
            for (j, v) in row.iter().chain([f]).enumerate() {
                // A value of weight 0 may be NaN.
                (columns[j][l], weighted[j][l]) = if w == 0.0 { (0.0, 0.0) } else { (*v, w * v) };
            }
        }
        sum += product(&weighted[m], &columns[m]);
        for j in 0..m {
            gradient[j] += product(&weighted[j], &columns[m]);
            for k in 0..=j {
                hessian[j * m + k] += product(&weighted[j], &columns[k]);
            }
        }
    }
    for j in 0..m {
        for k in 0..j {
            hessian[k * m + j] = hessian[j * m + k];
        }
    }
    sum
}

/// Normal equations of some points: Σ w f², Jᵀ W f and Jᵀ W J.
pub type NormalEquations = (f64, Vec<f64>, Vec<f64>);

/// Adds the normal equations of subsets of the points in order, so that the sum does not depend on
/// the threads that computed them.
pub fn add_normal_equations(
    pieces: impl IntoIterator<Item = NormalEquations>,
    gradient: &mut [f64],
    hessian: &mut [f64],
) -> f64 {
    gradient.fill(0.0);
    hessian.fill(0.0);
    let mut sum = 0.0;
    for (s, g, h) in pieces {
        sum += s;
        gradient.iter_mut().zip(g).for_each(|(sum, v)| *sum += v);
        hessian.iter_mut().zip(h).for_each(|(sum, v)| *sum += v);
    }
    sum
}

/// Number of points whose rows are multiplied together: a column fills a few vector registers, and
/// the columns of dozens of parameters stay within the cache.
const COLUMN_POINTS: usize = 32;

/// Returns Σ aₗ bₗ, as eight partial sums that vector instructions compute at once.
fn product(a: &[f64; COLUMN_POINTS], b: &[f64; COLUMN_POINTS]) -> f64 {
    let mut sums = [0.0; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum()
}

/// Foot of a point: the nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Signed distance, positive inside.
    pub distance: f64,
    /// Nearest point of the surface.
    pub at: Point3,
    /// Unit inward normal: the gradient of the distance.
    pub inward: Point3,
    /// Pieces that meet at the foot; the first `order` entries are used.
    pub pieces: [u32; 3],
    /// Number of pieces that meet at the foot: 1 on a face, 2 on an edge, 3 at a corner; 0 if no
    /// foot was found and the distance is of first order.
    pub order: u8,
    /// Coefficients of the pieces' inward normals in `inward`.
    pub shares: [f64; 3],
}

impl Foot {
    /// Returns the foot of a point that lies on a face itself.
    pub fn on_face(at: Point3, inward: Point3, piece: u32) -> Self {
        Self {
            distance: 0.0,
            at,
            inward,
            pieces: [piece; 3],
            order: 1,
            shares: [1.0, 0.0, 0.0],
        }
    }

    /// Placeholder for a foot before it is computed.
    pub const NONE: Self = Self {
        distance: f64::NAN,
        at: [f64::NAN; 3],
        inward: [0.0; 3],
        pieces: [0; 3],
        order: 0,
        shares: [0.0; 3],
    };
}

/// Surroundings of a point of a surface, on the scale of the noise of measured points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nearby {
    /// Only the face of the point itself is near.
    Face,
    /// One edge is near, and only its two faces: two half-planes, on this scale.
    Edge(Edge),
    /// More faces are near: at corners, thin walls, and faces that touch.
    Much,
}

/// Point of an edge nearest to a point on one of its faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Position on the edge.
    pub at: Point3,
    /// Face of the point on the surface, and the other face of the edge.
    pub pieces: [u32; 2],
    /// Unit inward normals of the two faces at the edge.
    pub inward: [Point3; 2],
    /// Distance from the edge, in model units, up to which its two faces extend and no other edge
    /// is nearer to points on them.
    pub width: f64,
    /// True if a face other than its own is within reach of the point.
    pub is_near: bool,
    /// Angle between the faces through the material, in radians: less than π at a convex edge.
    pub angle: f64,
}

impl Edge {
    /// Minimum width, in units of the reach.
    pub const MIN_WIDTH_RATIO: f64 = 0.75;
}

/// Rigid frame: its point p lies at `translation` + `rotation` p in space.
///
/// ```
/// use isoform_geom::Frame;
///
/// // A quarter turn about z, then a shift along x.
/// let frame = Frame {
///     rotation: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
///     translation: [5.0, 0.0, 0.0],
/// };
/// assert_eq!(frame.out([2.0, 0.0, 0.0]), [5.0, 2.0, 0.0]);
/// assert_eq!(frame.within([5.0, 2.0, 0.0]), [2.0, 0.0, 0.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Rotation matrix, row by row.
    pub rotation: [Point3; 3],
    /// Origin of the frame, in space.
    pub translation: Point3,
}

impl Frame {
    /// Frame of space itself: the identity.
    pub const SPACE: Self = Self {
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [0.0; 3],
    };
    /// Maps a point of the frame to space.
    pub fn out(&self, p: Point3) -> Point3 {
        let turned = self.turned(p);
        std::array::from_fn(|i| self.translation[i] + turned[i])
    }
    /// Maps a direction of the frame to space.
    pub fn turned(&self, v: Point3) -> Point3 {
        self.rotation.map(|row| crate::dot(row, v))
    }
    /// Maps a point of space to the frame.
    pub fn within(&self, p: Point3) -> Point3 {
        let d = crate::sub(p, self.translation);
        std::array::from_fn(|j| (0..3).map(|i| self.rotation[i][j] * d[i]).sum())
    }
}

/// Signed distance from the surface of a solid with parameters, positive inside, with foot points.
pub trait DistanceField: ParamField {
    /// Computes the nearest point of the surface to each point.
    ///
    /// # Panics
    /// If `out` is shorter than `points` or `a` than the parameters.
    fn feet(&self, points: &[Point3], a: &[f64], out: &mut [Foot]);
    /// Computes the derivatives of the distance with respect to the parameters from known feet, row
    /// by row as in [`ParamField::jacobian`]. Only the place, the pieces and the shares of each
    /// foot are used.
    ///
    /// # Panics
    /// If `jac` is shorter than the feet times the parameters.
    fn jacobian_of(&self, feet: &[Foot], a: &[f64], jac: &mut [f64]);
    /// Computes [`ParamField::normal_equations`] from known feet of the points.
    ///
    /// # Panics
    /// If `gradient` or `hessian` is too short.
    fn normal_equations_at(
        &self,
        feet: &[Foot],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64;
    /// Returns the surroundings of each point of the surface. Other faces count if they are within
    /// `reach`; they disturb an edge if they are within twice [`Edge::MIN_WIDTH_RATIO`] times the
    /// reach. Edges are found up to the distance `strip`.
    fn nearby(&self, places: &[Foot], a: &[f64], reach: f64, strip: f64) -> Vec<Nearby>;
    /// Computes the Laplacian of the distance from the face of each point, at the point, by
    /// differences over `step`: the sum of the principal curvatures, positive where the solid is
    /// concave.
    fn bends(&self, places: &[Foot], a: &[f64], step: f64) -> Vec<f64>;
    /// Returns random points of the surface in a region of a frame, on its faces, distributed
    /// uniformly by area: about `wanted`, or fewer if there is little surface. If the solid moves
    /// with the frame, so do the points.
    fn area_samples(
        &self,
        a: &[f64],
        frame: &Frame,
        region: Aabb,
        wanted: usize,
        seed: u64,
    ) -> Vec<Foot>;
}
