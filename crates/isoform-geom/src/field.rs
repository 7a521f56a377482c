//! Implicit functions as the stages see them: values, derivatives, bounds, and distances with their
//! feet.
//!
//! - [`Field`]: one function of space. [`ParamField`]: a family of them, for fits.
//! - [`DistanceField`]: a family that also knows the *foot* of a point, its nearest place of the
//!   surface.

use crate::{Aabb, Point3};
use isoform_num::{Interval, Jet2, Jet3, Real};

/// A function of space; inside is `value ≥ 0`, the outward normal is −∇f/|∇f|.
pub trait Field: Send + Sync {
    /// f(p).
    fn value(&self, p: Point3) -> f64;
    /// f with gradient and Hessian.
    fn jet(&self, p: Point3) -> Jet2;
    /// An interval that holds f over the whole region; proves nothing by default.
    fn bounds(&self, _region: Aabb) -> Interval {
        Interval::ALL
    }
    /// f at many points; override to go fast.
    fn values(&self, points: &[Point3], out: &mut [f64]) {
        for (p, v) in points.iter().zip(out) {
            *v = self.value(*p);
        }
    }
    /// 2-jets at many points; override to go fast.
    fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        for (p, j) in points.iter().zip(out) {
            *j = self.jet(*p);
        }
    }
    /// f with all derivatives to order 3; nothing by default.
    fn jet3(&self, _p: Point3) -> Option<Jet3> {
        None
    }
    /// What can be proved of f near a point: intervals for its derivatives there, and for the third
    /// ones in the whole region, which holds the point. Nothing by default.
    fn expansion(&self, _at: Point3, _region: Aabb) -> Option<Expansion> {
        None
    }
    /// The terms of an f that is a polynomial; nothing by default.
    fn terms(&self) -> Option<Terms<'_>> {
        None
    }
}

/// A polynomial in p, where the point of space is (x, y, z) = `origin` + `unit` p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terms<'a> {
    /// Terms c xⁱyʲzᵏ, as ([i, j, k], c).
    pub list: &'a [([u16; 3], f64)],
    /// Where p = 0 is.
    pub origin: Point3,
    /// The unit of length of p.
    pub unit: f64,
}

/// Intervals for a function's derivatives: to order 2 at a point, of order 3 in a region about it.
/// By Taylor's theorem they enclose f in the region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion {
    /// f at the point.
    pub value: Interval,
    /// ∇f at the point.
    pub gradient: [Interval; 3],
    /// Second derivatives xx, xy, xz, yy, yz, zz at the point.
    pub hessian: [Interval; 6],
    /// Third derivatives xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz in the region.
    pub third: [Interval; 10],
}

impl Expansion {
    /// The expansion by coordinates q where p = `unit` q + a constant: each order of derivatives
    /// brings a factor.
    #[must_use]
    pub fn in_units(&self, unit: Interval) -> Self {
        Self {
            value: self.value,
            gradient: self.gradient.map(|g| unit * g),
            hessian: self.hessian.map(|h| unit * unit * h),
            third: self.third.map(|t| unit * unit * unit * t),
        }
    }
    /// The expansion about the point that is away `by`, in the same region: by Taylor's theorem
    /// with the third derivatives of the region.
    #[must_use]
    pub fn moved(&self, by: [Interval; 3]) -> Self {
        // δᵀHδ/2 + Tδδδ/6 is half of δ times (H + Tδ/3)δ; a third is no number.
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

    /// ∇f at all places of the region whose offset from the point is in `by`.
    pub fn gradient_at(&self, by: [Interval; 3]) -> [Interval; 3] {
        std::array::from_fn(|i| {
            self.gradient[i]
                + (0..3).fold(Interval::constant(0.0), |sum, j| {
                    let half = Interval::constant(0.5) * self.third_along(i, j, by);
                    sum + (self.hessian[Self::SECOND[i][j]] + half) * by[j]
                })
        })
    }

    /// Σₖ ∂³f/∂xᵢ∂xⱼ∂xₖ δₖ.
    fn third_along(&self, i: usize, j: usize, by: [Interval; 3]) -> Interval {
        (0..3).fold(Interval::constant(0.0), |sum, k| {
            sum + self.third[Self::THIRD[i][j][k]] * by[k]
        })
    }

    /// Where ∂²f/∂xᵢ∂xⱼ is among the six second derivatives.
    pub const SECOND: [[usize; 3]; 3] = isoform_num::SECOND;
    /// Where ∂³f/∂xᵢ∂xⱼ∂xₖ is among the ten third derivatives.
    pub const THIRD: [[[usize; 3]; 3]; 3] = isoform_num::THIRD;
}

/// A function of space with parameters a: the residual of a fit.
pub trait ParamField: Send + Sync {
    /// Number of parameters.
    fn dim(&self) -> usize;
    /// f(pᵢ, a) for all points.
    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]);
    /// f(pᵢ, a) and its derivatives by the parameters, point by point: `jac[i * dim + j]` =
    /// ∂f(pᵢ)/∂aⱼ.
    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]);
    /// Weighted normal equations: Σ wᵢ fᵢ², Jᵀ W f into `gradient` (dim) and Jᵀ W J into `hessian`
    /// (dim × dim, full symmetric).
    /// `weights` empty means all 1; where one is 0 nothing is added, whatever f is there. The sums
    /// run in a fixed order: the same bits each time. Override to go fast.
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
    /// f(pᵢ, a) and its gradient in space, point by point.
    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]);
    /// Σ wᵢ fᵢ², in the same order of summation as [`ParamField::normal_equations`].
    /// Override to go fast.
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

/// The sums of [`ParamField::normal_equations`], from values and derivatives of all points.
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
    // By columns of some points at a time: products of whole columns are fast.
    let mut columns = vec![[0.0; COLUMN]; m + 1];
    let mut weighted = columns.clone();
    for (c, f) in f.chunks(COLUMN).enumerate() {
        let first = c * COLUMN;
        if f.len() < COLUMN {
            columns.iter_mut().for_each(|c| c.fill(0.0));
            weighted.iter_mut().for_each(|c| c.fill(0.0));
        }
        for (l, f) in f.iter().enumerate() {
            let w = weights.get(first + l).copied().unwrap_or(1.0);
            let row = &jac[(first + l) * m..(first + l + 1) * m];
            for (j, v) in row.iter().chain([f]).enumerate() {
                // Where the weight is 0 the value may be NaN.
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

/// Adds the normal equations of pieces of the points, in their order: the sum does not depend on
/// which thread computed a piece.
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

/// Points whose rows are multiplied together: they fill a few registers, and stay within the cache
/// for dozens of parameters.
const COLUMN: usize = 32;

/// Σ aₗ bₗ, in an order that vector units like.
fn product(a: &[f64; COLUMN], b: &[f64; COLUMN]) -> f64 {
    let mut sums = [0.0; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum()
}

/// The foot of a point: the nearest place of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Signed distance, positive inside.
    pub distance: f64,
    /// The nearest point of the surface.
    pub at: Point3,
    /// Unit inward direction: the gradient of the distance.
    pub inward: Point3,
    /// Pieces that meet there; the first `order` count.
    pub pieces: [u32; 3],
    /// 1 on a face, 2 on an edge, 3 at a corner; 0 where no foot point was found and the distance
    /// is of first order.
    pub order: u8,
    /// Shares of the pieces' inward normals in the direction.
    pub shares: [f64; 3],
}

impl Foot {
    /// A place on a face.
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

    /// The foot before it is known.
    pub const NONE: Self = Self {
        distance: f64::NAN,
        at: [f64::NAN; 3],
        inward: [0.0; 3],
        pieces: [0; 3],
        order: 0,
        shares: [0.0; 3],
    };
}

/// The surroundings of a place of a surface, on the scale of the noise of measured points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nearby {
    /// Only the face that the place is on.
    Face,
    /// An edge that no third face is near: two half planes, on this scale.
    Edge(Edge),
    /// More: corners, thin walls, faces that touch.
    Much,
}

/// The place of an edge nearest to a place on one of its faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// The place on the edge.
    pub at: Point3,
    /// The face of the place on the surface, and the other face of the edge.
    pub pieces: [u32; 2],
    /// Their unit inward normals.
    pub inward: [Point3; 2],
    /// Up to this distance from the edge its two faces extend, and the nearest edge to places on
    /// them is this one.
    pub width: f64,
    /// Whether a face other than its own is within reach of the place.
    pub is_near: bool,
    /// Angle between the faces through the material: less than π where it is convex.
    pub angle: f64,
}

impl Edge {
    /// The least width, in units of the reach.
    pub const LEAST: f64 = 0.75;
}

/// A rigid frame: its place p is at `translation` + `rotation` p in space.
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
    /// Rotation matrix by rows.
    pub rotation: [Point3; 3],
    /// The origin of the frame, in space.
    pub translation: Point3,
}

impl Frame {
    /// The frame of space itself.
    pub const SPACE: Self = Self {
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [0.0; 3],
    };
    /// A place of the frame, in space.
    pub fn out(&self, p: Point3) -> Point3 {
        let turned = self.turned(p);
        std::array::from_fn(|i| self.translation[i] + turned[i])
    }
    /// A direction of the frame, in space.
    pub fn turned(&self, v: Point3) -> Point3 {
        self.rotation.map(|row| crate::dot(row, v))
    }
    /// A place of space, in the frame.
    pub fn within(&self, p: Point3) -> Point3 {
        let d = crate::sub(p, self.translation);
        std::array::from_fn(|j| (0..3).map(|i| self.rotation[i][j] * d[i]).sum())
    }
}

/// A signed distance to the surface of a solid with parameters, positive inside, that knows where
/// the nearest places are.
pub trait DistanceField: ParamField {
    /// The nearest place of the surface to each point.
    ///
    /// # Panics
    /// If `out` is shorter than `points` or `a` than the parameters.
    fn feet(&self, points: &[Point3], a: &[f64], out: &mut [Foot]);
    /// The derivatives of the distance by the parameters where its feet are known, row by row as
    /// [`ParamField::jacobian`] gives them. Of each foot its place, pieces and shares are used.
    ///
    /// # Panics
    /// If `jac` is shorter than the feet times the parameters.
    fn jacobian_of(&self, feet: &[Foot], a: &[f64], jac: &mut [f64]);
    /// [`ParamField::normal_equations`] where the feet of the points are known.
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
    /// The surroundings of each place of the surface. Other faces count within `reach` of it, and
    /// disturb an edge within twice [`Edge::LEAST`] of that. Edges are met up to `strip` away.
    fn nearby(&self, places: &[Foot], a: &[f64], reach: f64, strip: f64) -> Vec<Nearby>;
    /// The Laplacian of the distance to the face of each place, at the place: its two curvatures'
    /// sum, positive where the solid is hollow. From differences over `step`.
    fn bends(&self, places: &[Foot], a: &[f64], step: f64) -> Vec<f64>;
    /// Random places of the surface in a region of a frame, on its faces, spread evenly by area:
    /// about as many as wanted, or fewer where there is little surface. A solid that moves with the
    /// frame gets the places moved along.
    fn area_samples(
        &self,
        a: &[f64],
        frame: &Frame,
        region: Aabb,
        wanted: usize,
        seed: u64,
    ) -> Vec<Foot>;
}
