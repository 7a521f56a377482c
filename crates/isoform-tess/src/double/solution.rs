//! Real points of space with non-real parameters: solutions of f = 0, Im φ = 0, by Gauss–Newton.

use super::source::{Image, Source, Values, real_image};
use crate::complex::{C, V, along, dot, frame, in_frame, normalised};

/// Most steps of Gauss–Newton.
const STEPS: usize = 12;
/// The rounding errors of the forms' values, whose coefficients are at most 1.
const ROUNDING: f64 = 1e-15;
/// The largest residual of a solution, before what rounding adds to it.
const RESIDUAL: f64 = 1e-11;
/// How many times the rounding errors a residual may be.
const ROUNDINGS: f64 = 4.0;
/// Singular values below this are zero: nothing is divided by them.
const NO_VALUE: f64 = 1e-300;
/// Steps longer than this, in the affine chart around a point, lead to another solution.
const FARTHEST: f64 = 0.3;
/// Near base points steps in the stiff directions come first, and longer ones in the others after
/// them: steps may get longer by this factor.
const LONGER: f64 = 2.0;
/// Steps up to this length may be longer than those before.
const SHORT: f64 = 1e-3;
/// A step below this ends the iteration: convergence is quadratic.
const DONE: f64 = 1e-10;
/// A step below this ends the iteration where steps do not get much shorter any more.
const NEARLY_DONE: f64 = 1e-6;
/// Steps that are not shorter than this share of the step before do not converge quadratically.
const STALLED: f64 = 0.3;
/// Most sweeps of rotations: they converge quadratically, too.
const SWEEPS: usize = 30;
/// Columns whose cosine is below this are orthogonal to rounding.
const ORTHOGONAL: f64 = 1e-15;

/// A real point of space on the image of a source: a solution of f = 0, Im φ = 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub(super) p: V,
    /// In the direction of the solutions nearby, of norm 1; either of the two.
    pub(super) tangent: V,
    pub(super) image: Image,
}

impl State {
    /// Whether the point is in the box.
    pub(super) fn is_inside(&self) -> bool {
        (0..3).all(|i| self.image[i].abs() <= self.image[3].abs())
    }
    /// The point, in half widths of the box.
    pub(super) fn point(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.image[i] / self.image[3])
    }
    /// A point at a distance along the tangent.
    pub(super) fn ahead(&self, by: f64) -> V {
        normalised(&along(&self.p, &self.tangent, by))
    }
    /// The same solution with the other tangent.
    pub(super) fn reversed(mut self) -> Self {
        self.tangent = self.tangent.map(|c| -c);
        self
    }
}

/// A singular value, its right singular vector, and the product of its left singular vector with the
/// right-hand side.
type Singular = (f64, [f64; 4], f64);

/// The singular values of a matrix of five rows, given by its four columns, in descending order: by
/// rotations of the columns (M. R. Hestenes, 1958), which find small values to their own precision.
fn singular_values(mut columns: [[f64; 5]; 4], right: &[f64; 5]) -> [Singular; 4] {
    let mut vectors: [[f64; 4]; 4] = Default::default();
    for (i, row) in vectors.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for _ in 0..SWEEPS {
        let mut is_rotated = false;
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            if let Some((c, s)) = rotation(&columns[i], &columns[j]) {
                is_rotated = true;
                rotate(&mut columns, [i, j], c, s);
                rotate(&mut vectors, [i, j], c, s);
            }
        }
        if !is_rotated {
            break;
        }
    }
    let mut found = [0, 1, 2, 3].map(|i| {
        let size = product(&columns[i], &columns[i]).sqrt();
        let share = if size > 0.0 {
            product(&columns[i], right) / size
        } else {
            0.0
        };
        (size, vectors[i], share)
    });
    found.sort_by(|x, y| y.0.total_cmp(&x.0));
    found
}

fn product(x: &[f64; 5], y: &[f64; 5]) -> f64 {
    (0..5).map(|k| x[k] * y[k]).sum::<f64>()
}

/// The cosine and the sine of the rotation that makes two columns orthogonal, unless they are.
fn rotation(a: &[f64; 5], b: &[f64; 5]) -> Option<(f64, f64)> {
    let (p, q, r) = (product(a, a), product(b, b), product(a, b));
    if r.abs() <= ORTHOGONAL * (p * q).sqrt() || r == 0.0 {
        return None;
    }
    let zeta = (q - p) / (2.0 * r);
    let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    Some((c, c * t))
}

fn rotate<const N: usize>(rows: &mut [[f64; N]; 4], [i, j]: [usize; 2], c: f64, s: f64) {
    for k in 0..N {
        let (x, y) = (rows[i][k], rows[j][k]);
        (rows[i][k], rows[j][k]) = (c * x - s * y, s * x + c * y);
    }
}

/// The place of the coordinate of the largest absolute value, the last of several.
fn largest_of(x: &[f64]) -> usize {
    let places = 0..x.len();
    let found = places.max_by(|&i, &j| x[i].abs().total_cmp(&x[j].abs()));
    found.expect("coordinates")
}

/// Three vectors orthogonal to a unit vector: all columns but one of the reflection that takes it to
/// ∓ a coordinate vector.
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

/// A linear form with real coefficients of the values of the forms, and its gradient.
fn combined(v: &Values, weights: &Image) -> (C, V) {
    let sum = |x: [C; 4]| (0..4).fold(C::ZERO, |sum, i| sum + x[i].times(weights[i]));
    let gradient = [0, 1, 2].map(|k| sum(v.dg.map(|dg| dg[k])));
    (sum(v.g), gradient)
}

/// f = 0, Im φ = 0 linearised at a point: five real equations for the four real coordinates of a
/// step, in a frame at the point.
struct Linearised {
    frame: [V; 2],
    columns: [[f64; 5]; 4],
    right: [f64; 5],
    image: Image,
    /// The rounding errors of the equations: the forms are small near base points, theirs are not.
    rounding: f64,
}

impl Linearised {
    /// None at base points.
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
            rounding: ROUNDING / c.norm(),
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
    /// The equation that the real part of a value is 0.
    fn set_real(&mut self, row: usize, value: C, gradient: &V) {
        self.right[row] = value.re;
        for i in 0..2 {
            let k = dot(gradient, &self.frame[i]);
            (self.columns[2 * i][row], self.columns[2 * i + 1][row]) = (k.re, -k.im);
        }
    }
    /// The equation that the imaginary part of a value is 0.
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
    /// Real coordinates as a vector.
    fn vector(&self, x: &[f64; 4]) -> V {
        in_frame(&self.frame, [C::new(x[0], x[1]), C::new(x[2], x[3])])
    }
}

/// The shortest step to a solution, along three singular vectors: the fourth is the tangent.
fn shortest_step(found: &[Singular; 4]) -> [f64; 4] {
    let mut d = [0.0; 4];
    for (size, vector, product) in &found[..3] {
        if *size > NO_VALUE {
            for i in 0..4 {
                d[i] -= product / size * vector[i];
            }
        }
    }
    d
}

impl Source {
    /// The nearest solution of f = 0, Im φ = 0, by the method of Gauss and Newton.
    pub(super) fn settle(&self, start: &V) -> Option<State> {
        let mut p = *start;
        let mut is_done = false;
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let system = Linearised::at(self, &p)?;
            let found = singular_values(system.columns, &system.right);
            let residual = system.residual();
            if is_done || residual < system.rounding {
                let is_solution = residual < RESIDUAL + ROUNDINGS * system.rounding;
                return is_solution.then(|| State {
                    p,
                    tangent: system.vector(&found[3].1),
                    image: system.image,
                });
            }
            let d = shortest_step(&found);
            let size = d.iter().map(|x| x * x).sum::<f64>().sqrt();
            if !size.is_finite() || size > FARTHEST || size > (LONGER * last).max(SHORT) {
                return None;
            }
            p = normalised(&along(&p, &system.vector(&d), 1.0));
            is_done = size < DONE || size < NEARLY_DONE && size > STALLED * last;
            last = size;
        }
        None
    }
    /// The solution between two, half way in the parameters.
    pub(super) fn settle_between(&self, a: &State, b: &State) -> Option<State> {
        self.settle(&normalised(&along(&a.p, &b.p, 1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The columns are orthogonal, of lengths 4, 3, 2, 1 in some order: these are the singular
    /// values; mixed by a rotation they still are.
    #[test]
    fn singular_values_of_a_rotated_diagonal() {
        let mut columns = [[0.0; 5]; 4];
        for (i, size) in [2.0, 4.0, 1.0, 3.0].into_iter().enumerate() {
            columns[i][i + 1] = size;
        }
        rotate(&mut columns, [0, 1], 0.6, 0.8);
        rotate(&mut columns, [1, 3], 0.8, -0.6);
        let right = [0.0, 1.0, 0.0, 0.0, 0.0];
        let found = singular_values(columns, &right);
        for (k, (size, vector, _)) in found.iter().enumerate() {
            assert!((size - (4 - k) as f64).abs() < 1e-14, "{size}");
            let length = vector.iter().map(|x| x * x).sum::<f64>();
            assert!((length - 1.0).abs() < 1e-14);
        }
        let shares = found.map(|f| f.2.abs());
        assert!((shares[2] - 1.0).abs() < 1e-14, "{shares:?}");
    }

    #[test]
    fn reflections_are_orthogonal() {
        let image = [0.1, -0.7, 0.5, 0.5];
        for a in across(&image) {
            let dot = (0..4).map(|i| a[i] * image[i]).sum::<f64>();
            assert!(dot.abs() < 1e-15, "{dot}");
        }
    }
}
