//! The scaled quadratic model at a point, its trust region, and the steps that it proposes.
//!
//! ```text
//!          bound
//!   x ------→|        direct: the step cut to the ball
//!         ↙  |        reflected: its part beyond the bound, mirrored
//!            |        down: steepest descent in the scaled variables
//! ```
//!
//! In the scaled variables x̂ = D⁻¹x the model is g·p + ½ pᵀMp with g = D Jᵀr and M = D JᵀJ D + C;
//! D and C are defined in the documentation of the parent module.

use crate::bounds::Bounds;
use crate::objective::ModelPoint;
use crate::vector::{dot, norm, scale, times};
use isoform_num::linalg::{cholesky, cholesky_solve};

/// The model, its trust region and the current step.
pub(super) struct TrustRegion {
    n: usize,
    radius: f64,
    /// D, the scaling of each variable.
    scale: Vec<f64>,
    /// D Jᵀr.
    gradient: Vec<f64>,
    /// D JᵀJ D + C.
    matrix: Vec<f64>,
    /// Diagonal of C, a curvature that the function itself does not have.
    curve: Vec<f64>,
    factor: Vec<f64>,
    /// Current step, scaled.
    scaled: Vec<f64>,
    scratch: Vec<f64>,
    /// Current step, unscaled.
    pub(super) step: Vec<f64>,
    damping: f64,
    exact: bool,
    /// Number of steps refused in a row.
    pub(super) refused: usize,
}

/// A step in the scaled variables, and the value of the model there.
struct ScaledStep {
    step: Vec<f64>,
    value: f64,
}

/// Start of a step, and the share of the way to a bound that it may cover.
struct BoundedStart<'a> {
    x: &'a [f64],
    bounds: Bounds<'a>,
    share: f64,
}

impl BoundedStart<'_> {
    /// Returns the greatest length along a direction that meets a bound and the ball at these
    /// lengths.
    fn most(&self, to_edge: f64, to_ball: f64) -> f64 {
        if to_edge < to_ball {
            self.share * to_edge
        } else {
            to_ball
        }
    }
}

/// Bracket of the damping μ of an exact step.
struct DampingBracket {
    /// Least damping above rounding.
    floor: f64,
    lower: f64,
    upper: f64,
}

impl DampingBracket {
    /// Makes a bracket; `reach` is |g| / Δ, above which no step reaches the ball.
    fn new(floor: f64, reach: f64) -> Self {
        Self {
            floor,
            lower: floor,
            upper: reach + floor,
        }
    }

    fn holds(&self, mu: f64) -> bool {
        mu > self.lower && mu < self.upper
    }

    /// Returns the last damping, if it is in the bracket.
    fn start(&self, last: f64) -> f64 {
        if self.holds(last) { last } else { self.floor }
    }

    /// Returns a damping above one that leaves the matrix indefinite.
    fn raised(&mut self, mu: f64) -> f64 {
        self.lower = self.lower.max(mu);
        (mu * 10.0).max(1e-3 * (self.lower * self.upper).sqrt())
    }

    /// Narrows the bracket by a damping and the length of its step.
    fn narrow(&mut self, mu: f64, is_short: bool) {
        if is_short {
            self.upper = self.upper.min(mu);
        } else {
            self.lower = self.lower.max(mu);
        }
    }

    /// Returns the geometric mean, not too near to zero.
    fn middle(&self) -> f64 {
        (self.lower * self.upper).sqrt().max(1e-3 * self.upper)
    }
}

impl TrustRegion {
    pub(super) fn new(n: usize, radius: f64, exact: bool) -> Self {
        let zero = vec![0.0; n];
        Self {
            n,
            radius,
            scale: zero.clone(),
            gradient: zero.clone(),
            matrix: vec![0.0; n * n],
            curve: zero.clone(),
            factor: vec![0.0; n * n],
            scaled: zero.clone(),
            scratch: zero.clone(),
            step: zero,
            damping: 0.0,
            exact,
            refused: 0,
        }
    }

    /// Sets gradient and matrix at a point. Returns the largest gradient component scaled by its
    /// distance to the bound.
    pub(super) fn set(&mut self, at: &ModelPoint, bounds: Bounds<'_>) -> f64 {
        let slope = self.set_scale(at, bounds);
        let n = self.n;
        for i in 0..n {
            for j in 0..n {
                self.matrix[i * n + j] = self.scale[i] * at.matrix[i * n + j] * self.scale[j];
            }
            self.matrix[i * n + i] += self.curve[i];
        }
        slope
    }

    /// Sets D, C and D Jᵀr. Returns the largest |g| v.
    fn set_scale(&mut self, at: &ModelPoint, bounds: Bounds<'_>) -> f64 {
        let g = &at.gradient;
        let mut slope: f64 = 0.0;
        for i in 0..self.n {
            // Descent approaches the upper bound if the gradient is negative.
            let gap = bounds.gap(&at.x, i, -g[i]);
            let has_bound = gap.is_finite();
            let v = if has_bound { gap.max(1e-14) } else { 1.0 };
            slope = slope.max(g[i].abs() * v);
            self.scale[i] = v.sqrt();
            self.curve[i] = if has_bound { g[i].abs() } else { 0.0 };
            self.gradient[i] = self.scale[i] * g[i];
        }
        slope
    }

    /// MINPACK's cosine test, with components scaled by the distance to the bound that they
    /// approach.
    pub(super) fn is_stationary(&self, at: &ModelPoint, tolerance: f64) -> bool {
        (0..self.n).all(|i| {
            let near = (self.scale[i] * self.scale[i]).min(1.0);
            let column = at.matrix[i * self.n + i];
            at.gradient[i].abs() * near <= tolerance * (column * at.value).sqrt()
        })
    }

    /// Computes `step` and returns its predicted fall; `None` if the system has no finite solution.
    pub(super) fn step(&mut self, x: &[f64], bounds: Bounds<'_>, share: f64) -> Option<f64> {
        let is_solved = if self.exact { self.solve() } else { self.cut() };
        if !is_solved {
            return None;
        }
        let direct = times(&self.scale, &self.scaled);
        let stride = bounds.stride(x, &direct);
        // After two refusals in a row a cut step also competes with the gradient, which leads down
        // in the end.
        let value = if stride > 1.0 && (self.exact || self.refused < 2) {
            self.step = direct;
            self.value(&self.scaled)
        } else {
            let best = self.best(&BoundedStart { x, bounds, share }, &direct, stride);
            self.step = times(&self.scale, &best.step);
            self.scaled = best.step;
            best.value
        };
        Some(-value).filter(|fall| *fall > 0.0)
    }

    /// Returns the best of the direct step up to the bound, its reflection there, and steepest
    /// descent. `stride` is the share of the direct step at which it meets the bound.
    fn best(&self, inside: &BoundedStart<'_>, direct: &[f64], stride: f64) -> ScaledStep {
        let (stride, share) = if stride > 1.0 {
            (1.0, 1.0)
        } else {
            (stride, inside.share)
        };
        let on_bound: Vec<f64> = self.scaled.iter().map(|v| v * stride).collect();
        let mut best = self.proposal(on_bound.iter().map(|v| v * share).collect());
        let mirrored = (share < 1.0).then(|| {
            let reflected = self.reflected(inside, direct, stride);
            self.beyond(inside, &on_bound, &reflected, stride)
        });
        let others = mirrored.flatten().into_iter().chain([self.down(inside)]);
        for other in others {
            if other.value < best.value {
                best = other;
            }
        }
        best
    }

    fn proposal(&self, step: Vec<f64>) -> ScaledStep {
        ScaledStep {
            value: self.value(&step),
            step,
        }
    }

    /// Returns the reflection of the direct step: the components that meet a bound at `stride`
    /// change their sign.
    fn reflected(&self, inside: &BoundedStart<'_>, direct: &[f64], stride: f64) -> Vec<f64> {
        let meets = |i: usize| {
            let gap = inside.bounds.gap(inside.x, i, direct[i]);
            direct[i] != 0.0 && gap / direct[i].abs() <= stride
        };
        let turned = self.scaled.iter().enumerate();
        turned
            .map(|(i, v)| if meets(i) { -v } else { *v })
            .collect()
    }

    /// Returns the best continuation from the bound along the reflected step; `None` without room
    /// for one.
    fn beyond(
        &self,
        inside: &BoundedStart<'_>,
        on_bound: &[f64],
        reflected: &[f64],
        stride: f64,
    ) -> Option<ScaledStep> {
        let at = self.place(inside, on_bound);
        let to_edge = inside.bounds.stride(&at, &times(&self.scale, reflected));
        let to_ball = self.to_ball(on_bound, reflected);
        let reach = to_ball.min(to_edge);
        let least = (1.0 - inside.share) * stride / reach;
        let most = inside.most(to_edge, to_ball);
        if !(reach > 0.0 && least <= most) {
            return None;
        }
        let slope = dot(&self.gradient, reflected) + self.cross(on_bound, reflected);
        let t = lowest(0.5 * self.cross(reflected, reflected), slope, least, most);
        let both = on_bound.iter().zip(reflected);
        Some(self.proposal(both.map(|(p, r)| p + t * r).collect()))
    }

    /// Returns the point that a scaled step leads to, clamped to the bounds.
    fn place(&self, inside: &BoundedStart<'_>, step: &[f64]) -> Vec<f64> {
        let Bounds { lo, hi } = inside.bounds;
        let moved = inside.x.iter().zip(&self.scale).zip(step);
        let place = moved.map(|((x, scale), p)| x + scale * p).enumerate();
        place.map(|(i, v)| v.clamp(lo[i], hi[i])).collect()
    }

    /// Returns the step of steepest descent in the scaled variables, to the minimum of the model
    /// along it.
    fn down(&self, inside: &BoundedStart<'_>) -> ScaledStep {
        let down: Vec<f64> = self.gradient.iter().map(|v| -v).collect();
        let to_ball = self.radius / norm(&down);
        let to_edge = inside.bounds.stride(inside.x, &times(&self.scale, &down));
        let most = inside.most(to_edge, to_ball);
        let curve = 0.5 * self.cross(&down, &down);
        let t = lowest(curve, -dot(&down, &down), 0.0, most);
        self.proposal(down.iter().map(|v| v * t).collect())
    }

    /// Returns the t at which p + t q leaves the ball.
    fn to_ball(&self, p: &[f64], q: &[f64]) -> f64 {
        let (a, b) = (dot(q, q), dot(p, q));
        let c = dot(p, p) - self.radius * self.radius;
        (-b + (b * b - a * c).max(0.0).sqrt()) / a
    }

    /// Returns g·p + ½ pᵀMp.
    fn value(&self, p: &[f64]) -> f64 {
        dot(&self.gradient, p) + 0.5 * self.cross(p, p)
    }

    /// Returns pᵀMq.
    fn cross(&self, p: &[f64], q: &[f64]) -> f64 {
        self.matrix
            .chunks_exact(self.n)
            .zip(p)
            .map(|(row, v)| v * dot(row, q))
            .sum()
    }

    /// Returns the largest diagonal element of M.
    fn largest(&self) -> f64 {
        let diagonal = (0..self.n).map(|i| self.matrix[i * self.n + i]);
        diagonal.fold(f64::MIN_POSITIVE, f64::max)
    }

    /// Sets `scaled` to the solution of (M + μI) p = −g. Returns its length; `None` if the matrix
    /// is not positive definite.
    fn damped(&mut self, mu: f64) -> Option<f64> {
        let n = self.n;
        self.factor.copy_from_slice(&self.matrix);
        for i in 0..n {
            self.factor[i * n + i] += mu;
            self.scaled[i] = -self.gradient[i];
        }
        cholesky(&mut self.factor, n).then(|| {
            cholesky_solve(&self.factor, n, &mut self.scaled);
            norm(&self.scaled)
        })
    }

    /// Shortens `scaled`, of length `norm`, to the radius if it is longer.
    fn cut_to_ball(&mut self, norm: f64) {
        if norm > self.radius {
            scale(&mut self.scaled, self.radius / norm);
        }
    }

    /// Sets `scaled` to the Gauss-Newton step, cut to the ball. Returns false if it is not finite.
    fn cut(&mut self) -> bool {
        // The least μ keeps open directions still. Up to 1e-5 makes no difference to success, 1e-4
        // loses a fifth of the starts.
        let mut mu = 1e-8 * self.largest();
        while mu.is_finite() {
            if let Some(norm) = self.damped(mu) {
                self.cut_to_ball(norm);
                return norm.is_finite();
            }
            mu *= 100.0;
        }
        false
    }

    /// Sets `scaled` to the minimum of the model in the ball, to a tenth of its radius (Moré and
    /// Sorensen's iteration for μ). Returns false if it is not finite.
    fn solve(&mut self) -> bool {
        // Less damping is rounding; this much makes singular systems solvable.
        let mut bracket =
            DampingBracket::new(1e-14 * self.largest(), norm(&self.gradient) / self.radius);
        let mut mu = bracket.start(self.damping);
        let mut last = f64::INFINITY;
        for round in 0..12 {
            let Some(norm) = self.damped(mu) else {
                mu = bracket.raised(mu);
                continue;
            };
            last = norm;
            if !norm.is_finite() {
                return false;
            }
            let is_short = norm < self.radius;
            let is_free = mu <= bracket.floor && norm <= self.radius;
            if is_free || self.is_on_ball(norm) {
                self.damping = mu;
                return true;
            }
            bracket.narrow(mu, is_short);
            let next = mu + self.newton(norm);
            mu = match bracket.holds(next) {
                true => next,
                false if round == 0 && is_short => bracket.floor,
                false => bracket.middle(),
            };
        }
        self.damping = mu;
        if last.is_finite() {
            self.cut_to_ball(last);
        }
        last.is_finite()
    }

    /// Returns true if a step of this length ends near the boundary of the ball.
    fn is_on_ball(&self, norm: f64) -> bool {
        (norm - self.radius).abs() <= 0.1 * self.radius
    }

    /// Returns Newton's step in μ towards |p| = Δ, from the factor LLᵀ of M + μI: (|p|/Δ − 1) |p|²
    /// / |L⁻¹p|².
    fn newton(&mut self, norm: f64) -> f64 {
        let n = self.n;
        self.scratch.copy_from_slice(&self.scaled);
        for i in 0..n {
            let row = &self.factor[i * n..i * n + i];
            let s = self.scratch[i] - dot(row, &self.scratch[..i]);
            self.scratch[i] = s / self.factor[i * n + i];
        }
        (norm / self.radius - 1.0) * norm * norm / dot(&self.scratch, &self.scratch)
    }

    /// Adapts the radius to the quality of the prediction for half of the sum. Returns the ratio of
    /// actual to predicted fall.
    pub(super) fn judge(&mut self, fall: f64, predicted: f64) -> f64 {
        let bent = self.curve.iter().zip(&self.scaled).map(|(c, p)| c * p * p);
        let added: f64 = 0.5 * bent.sum::<f64>();
        let ratio = (fall - added) / predicted;
        let length = norm(&self.scaled);
        if ratio < 0.25 || ratio.is_nan() {
            self.radius = 0.25 * length;
        } else if ratio > 0.75 && length > 0.9 * self.radius {
            self.radius *= 2.0;
        }
        ratio
    }

    /// Shrinks the ball after a step to a point without a finite value.
    pub(super) fn shrink(&mut self) {
        self.refused += 1;
        self.radius = 0.25 * norm(&self.scaled);
    }
}

/// Returns the argument in [least, most] that minimises t (slope + curve t).
fn lowest(curve: f64, slope: f64, least: f64, most: f64) -> f64 {
    let value = |t: f64| t * (slope + curve * t);
    let mut best = if value(least) <= value(most) {
        least
    } else {
        most
    };
    if curve > 0.0 {
        let t = -0.5 * slope / curve;
        if t > least && t < most && value(t) < value(best) {
            best = t;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_lowest_at_its_vertex_or_an_end() {
        // t² − t has its vertex at ½.
        assert_eq!(lowest(1.0, -1.0, 0.0, 2.0), 0.5);
        assert_eq!(lowest(1.0, -1.0, 0.75, 2.0), 0.75);
        // Without curvature the slope decides.
        assert_eq!(lowest(0.0, -1.0, 0.0, 2.0), 2.0);
        assert_eq!(lowest(0.0, 1.0, 0.0, 2.0), 0.0);
    }

    #[test]
    fn a_ray_leaves_the_ball_at_its_radius() {
        let region = TrustRegion::new(2, 2.0, false);
        let t = region.to_ball(&[0.0, 1.0], &[1.0, 0.0]);
        assert!((t - 3f64.sqrt()).abs() < 1e-15);
    }
}
