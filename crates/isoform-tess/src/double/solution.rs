//! Real points of space with non-real parameters: solutions of f = 0, Im φ = 0, by Gauss–Newton.

use super::source::{Image, Source, Values, real_image};
use crate::complex::{C, V, along, dot, frame, in_frame, normalised};
use crate::homotopy::MAX_CHART_STEP;
use isoform_num::Svd;

/// A real point of space on the image of a source: a solution of f = 0, Im φ = 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct SolutionState {
    pub(super) p: V,
    /// Unit tangent of the curve of solutions; the sign is arbitrary.
    pub(super) tangent: V,
    pub(super) image: Image,
}

impl SolutionState {
    /// Returns true if the point is in the box.
    pub(super) fn is_inside(&self) -> bool {
        (0..3).all(|i| self.image[i].abs() <= self.image[3].abs())
    }
    /// Returns the point, in half widths of the box.
    pub(super) fn point(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.image[i] / self.image[3])
    }
    /// Returns the point at a distance along the tangent.
    pub(super) fn ahead(&self, by: f64) -> V {
        normalised(&along(&self.p, &self.tangent, by))
    }
    /// Reverses the tangent.
    pub(super) fn reversed(mut self) -> Self {
        self.tangent = self.tangent.map(|c| -c);
        self
    }
}

/// Returns the index of the coordinate of largest absolute value, the last of several.
fn largest_of(x: &[f64]) -> usize {
    let places = 0..x.len();
    let found = places.max_by(|&i, &j| x[i].abs().total_cmp(&x[j].abs()));
    found.expect("coordinates")
}

/// Returns three vectors orthogonal to a unit vector: all columns but one of the reflection that
/// maps it to ∓ a coordinate vector.
fn across(image: &Image) -> [Image; 3] {
    let m = largest_of(image);
    let mut n = *image;
    n[m] += image[m].signum();
    let n2 = n.iter().map(|x| x * x).sum::<f64>();
    let column =
        |j: usize| [0, 1, 2, 3].map(|i| f64::from(u8::from(i == j)) - 2.0 * n[i] * n[j] / n2);
    let mut others = (0..4).filter(|&j| j != m);
    [(); 3].map(|()| column(others.next().expect("three other coordinates")))
}

/// Returns a real linear combination of the values of the forms, and its gradient.
fn combined(v: &Values, weights: &Image) -> (C, V) {
    let sum = |x: [C; 4]| (0..4).fold(C::ZERO, |sum, i| sum + x[i].times(weights[i]));
    let gradient = [0, 1, 2].map(|k| sum(v.dg.map(|dg| dg[k])));
    (sum(v.g), gradient)
}

/// Linearisation of f = 0, Im φ = 0 at a point: five real equations for the four real coordinates
/// of a step, in a frame at the point.
struct Linearised {
    frame: [V; 2],
    columns: [[f64; 5]; 4],
    right: [f64; 5],
    image: Image,
    /// Rounding error of the equations. Near base points the forms are small, but their rounding
    /// error is not.
    rounding: f64,
}

impl Linearised {
    /// Linearises the equations at a point; `None` at base points.
    fn at(source: &Source, p: &V) -> Option<Self> {
        let v = source.eval(p);
        let (image, _) = real_image(&v.g)?;
        let (c, dc) = combined(&v, &image);
        let inverse = c.inverse();
        let mut system = Self {
            frame: frame(p),
            columns: [[0.0; 5]; 4],
            right: [0.0; 5],
            image,
            // Values of the forms, whose coefficients are at most 1, have rounding errors of about
            // 1e-15.
            rounding: 1e-15 / c.norm(),
        };
        system.set_real(0, v.f, &v.df);
        system.set_imaginary(1, v.f, &v.df);
        for (row, weights) in across(&image).iter().enumerate() {
            let (g, dg) = combined(&v, weights);
            let u = g * inverse;
            let du = [0, 1, 2].map(|k| (dg[k] - u * dc[k]) * inverse);
            system.set_imaginary(row + 2, u, &du);
        }
        Some(system)
    }
    /// Sets the equation that the real part of a value vanishes.
    fn set_real(&mut self, row: usize, value: C, gradient: &V) {
        self.right[row] = value.re;
        for i in 0..2 {
            let k = dot(gradient, &self.frame[i]);
            (self.columns[2 * i][row], self.columns[2 * i + 1][row]) = (k.re, -k.im);
        }
    }
    /// Sets the equation that the imaginary part of a value vanishes.
    fn set_imaginary(&mut self, row: usize, value: C, gradient: &V) {
        self.right[row] = value.im;
        for i in 0..2 {
            let k = dot(gradient, &self.frame[i]);
            (self.columns[2 * i][row], self.columns[2 * i + 1][row]) = (k.im, k.re);
        }
    }
    fn residual(&self) -> f64 {
        self.right.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
    /// Returns real coordinates as a vector.
    fn vector(&self, x: &[f64; 4]) -> V {
        in_frame(&self.frame, [C::new(x[0], x[1]), C::new(x[2], x[3])])
    }
}

/// Singular value decomposition of the linearised equations.
type Singular = Svd<[f64; 5], 4>;

/// Returns the shortest step to a solution, along three singular vectors; the fourth is the
/// tangent.
fn shortest_step(svd: &Singular, right: &[f64; 5]) -> [f64; 4] {
    let mut d = [0.0; 4];
    for k in 0..3 {
        let size = svd.values[k];
        // The pseudoinverse drops singular values that are zero.
        if size > 1e-300 {
            let share = svd.along(k, right);
            for i in 0..4 {
                d[i] -= share / size * svd.right[k][i];
            }
        }
    }
    d
}

impl Source {
    /// Returns the solution of f = 0, Im φ = 0 next to a point, by the Gauss–Newton method.
    pub(super) fn settle(&self, start: &V) -> Option<SolutionState> {
        let mut p = *start;
        let mut is_done = false;
        let mut last = f64::INFINITY;
        // At most twelve Gauss–Newton steps.
        for _ in 0..12 {
            let system = Linearised::at(self, &p)?;
            let svd = Singular::new(system.columns);
            let residual = system.residual();
            if is_done || residual < system.rounding {
                // The residual may exceed its bound by a few rounding errors.
                let is_solution = residual < 1e-11 + 4.0 * system.rounding;
                return is_solution.then(|| SolutionState {
                    p,
                    tangent: system.vector(&svd.right[3]),
                    image: system.image,
                });
            }
            let d = shortest_step(&svd, &system.right);
            let size = d.iter().map(|x| x * x).sum::<f64>().sqrt();
            // Near base points steps in the stiff directions come first, and longer ones in the
            // other directions after them; short steps may grow by any factor.
            if !size.is_finite() || size > MAX_CHART_STEP || size > (2.0 * last).max(1e-3) {
                return None;
            }
            p = normalised(&along(&p, &system.vector(&d), 1.0));
            // Convergence is quadratic; where it stalls, a larger step must do.
            is_done = size < 1e-10 || size < 1e-6 && size > 0.3 * last;
            last = size;
        }
        None
    }
    /// Returns the solution between two others, starting half way in the parameters.
    pub(super) fn settle_between(
        &self,
        a: &SolutionState,
        b: &SolutionState,
    ) -> Option<SolutionState> {
        self.settle(&normalised(&along(&a.p, &b.p, 1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflections_are_orthogonal() {
        let image = [0.1, -0.7, 0.5, 0.5];
        for a in across(&image) {
            let dot = (0..4).map(|i| a[i] * image[i]).sum::<f64>();
            assert!(dot.abs() < 1e-15, "{dot}");
        }
    }
}
