//! Quadrature node: the homogeneous point p* of a patch with its derivatives p*ᵤ and p*ᵥ, as z =
//! (p*, p*ᵤ, p*ᵥ) ∈ ℝ¹².
//!
//! With N the first three coordinates of p* and w its last: p = N/w and pᵤ = (Nᵤ − p wᵤ)/w, and pᵥ
//! likewise.

use crate::terms::{Method, Targets};
use isoform_geom::{Point3, dot};
use isoform_num::Jet2;

/// Vector z with the point and the tangents that it represents.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub(crate) z: [f64; 12],
    pub(crate) point: Point3,
    pub(crate) tangents: [Point3; 2],
}

/// Residuals of L and R.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Residuals {
    /// Difference g₁₁ − l₁.
    pub(crate) u: f64,
    /// Difference g₂₂ − l₂.
    pub(crate) v: f64,
    /// Coefficient g₁₂.
    pub(crate) angle: f64,
}

/// Dependence of a coordinate of a tangent on z.
pub(crate) struct Dependence {
    /// Indices in z of the four numbers on which it depends: Nₖ, w, N_{k,u} and wᵤ, or those for v.
    pub(crate) places: [usize; 4],
    /// First derivatives by the numbers at these indices.
    pub(crate) first: [f64; 4],
}

impl Node {
    /// Computes point and tangents from z; `None` if w ≤ 0.
    pub(crate) fn new(z: [f64; 12]) -> Option<Self> {
        let w = z[3];
        if w.is_nan() || w <= 0.0 {
            return None;
        }
        let point: Point3 = std::array::from_fn(|k| z[k] / w);
        let tangents =
            [4, 8].map(|t| std::array::from_fn(|k| (z[t + k] - point[k] * z[t + 3]) / w));
        Some(Self { z, point, tangents })
    }

    /// Returns w.
    #[inline(always)]
    pub(crate) fn weight(&self) -> f64 {
        self.z[3]
    }

    /// Returns F/|∇F|, and 0 if both vanish.
    #[inline(always)]
    pub(crate) fn distance(&self, jet: &Jet2) -> f64 {
        if jet.v == 0.0 {
            0.0
        } else {
            jet.v / dot(jet.g, jet.g).sqrt()
        }
    }

    #[inline(always)]
    pub(crate) fn residuals(&self, targets: &Targets) -> Residuals {
        let [pu, pv] = self.tangents;
        Residuals {
            u: dot(pu, pu) - targets.l1,
            v: dot(pv, pv) - targets.l2,
            angle: dot(pu, pv),
        }
    }

    /// Transforms derivatives d by p = N/w to derivatives by p*.
    #[inline(always)]
    pub(crate) fn by_homogeneous(&self, d: Point3) -> [f64; 4] {
        let w = self.weight();
        [d[0] / w, d[1] / w, d[2] / w, -dot(d, self.point) / w]
    }

    /// Returns the derivatives of F/|∇F| by p* with |∇F| taken as constant; 0 if ∇F = 0.
    #[inline(always)]
    pub(crate) fn distance_gradient(&self, jet: &Jet2) -> [f64; 4] {
        let length = dot(jet.g, jet.g).sqrt();
        if length == 0.0 {
            return [0.0; 4];
        }
        self.by_homogeneous(jet.g.map(|g| g / length))
    }

    /// Returns the derivatives of F/|∇F| by p*, with |∇F| taken as constant only if the method does
    /// so; 0 if ∇F = 0.
    #[inline(always)]
    pub(crate) fn distance_slope(&self, jet: &Jet2, method: Method) -> [f64; 4] {
        if method == Method::Frozen || dot(jet.g, jet.g).sqrt() == 0.0 {
            return self.distance_gradient(jet);
        }
        self.by_homogeneous(slope_of_distance(jet, self.distance(jet)))
    }

    /// Returns the dependence of coordinate k of pᵤ (`which` = 0) or pᵥ (1) on z.
    pub(crate) fn tangent(&self, which: usize, k: usize) -> Dependence {
        let (w, offset) = (self.weight(), 4 + 4 * which);
        let (wu, p, pu) = (self.z[offset + 3], self.point[k], self.tangents[which][k]);
        Dependence {
            places: [k, 3, offset + k, offset + 3],
            first: [-wu / (w * w), (p * wu / w - pu) / w, 1.0 / w, -p / w],
        }
    }

    /// Returns the second derivatives of that coordinate by these four numbers.
    pub(crate) fn tangent_second(&self, which: usize, k: usize) -> [[f64; 4]; 4] {
        let (w, offset) = (self.weight(), 4 + 4 * which);
        let (n, nu, wu) = (self.z[k], self.z[offset + k], self.z[offset + 3]);
        let (w2, w3) = (w * w, w * w * w);
        let (n_w, w_w, w_nu, w_wu) = (
            2.0 * wu / w3,
            2.0 * nu / w3 - 6.0 * n * wu / (w3 * w),
            -1.0 / w2,
            2.0 * n / w3,
        );
        [
            [0.0, n_w, 0.0, -1.0 / w2],
            [n_w, w_w, w_nu, w_wu],
            [0.0, w_nu, 0.0, 0.0],
            [-1.0 / w2, w_wu, 0.0, 0.0],
        ]
    }
}

/// Returns H v for the Hessian H of F.
#[inline(always)]
pub(crate) fn hessian_times(jet: &Jet2, v: Point3) -> Point3 {
    std::array::from_fn(|i| (0..3).map(|j| jet.second(i, j) * v[j]).sum())
}

/// Returns ∇(F/|∇F|) = ∇F/|∇F| − F H∇F/|∇F|³, for F/|∇F| = r.
#[inline(always)]
pub(crate) fn slope_of_distance(jet: &Jet2, r: f64) -> Point3 {
    let g = jet.g;
    let length = dot(g, g).sqrt();
    let bent = r / (length * length);
    let hg = hessian_times(jet, g);
    std::array::from_fn(|i| g[i] / length - bent * hg[i])
}
