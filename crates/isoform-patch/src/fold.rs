//! Folds: places where a patch turns back along the surface, so that its normal is reversed there.
//!
//! A patch whose points are all within a tolerance of the surface may still fold over: its normal n
//! = pᵤ × pᵥ then turns against ∇F while its points stay near. The proof subdivides the patch into
//! cells. For the homogeneous patch (X, w), n w³ is the polynomial w Xᵤ × Xᵥ − wᵥ Xᵤ × X − wᵤ X ×
//! Xᵥ of degree (3m − 1, 3n − 1). Its Bernstein coefficients are computed once, as intervals, and
//! halved with the cells. On a cell, every normal is a positive combination of them; so n·∇F has
//! one sign if their products with a box around the gradient have one sign.
//!
//! Where ∇F may vanish, as along a self-intersection, n·∇F may change its sign without a fold.
//! There all normals of the cell must lie within 45° of one direction.

use crate::cells::{ParameterBox, corners_of, half_of, halve_net, lengths_between, middle_of};
use crate::compose::binomial;
use crate::places::grid;
use isoform_control::Control;
use isoform_geom::{Aabb, Field, Point3, RationalPatch, dot, norm};
use isoform_num::{Interval, Real};
use std::f64::consts::FRAC_1_SQRT_2;

/// Number of grid points in each direction at which normals are compared: sufficient for folds
/// wider than a sixteenth of the patch; narrower ones are left to the proof.
const FOLD_SAMPLES: usize = 17;

/// Part of a patch with its normals.
struct FoldCell {
    /// Control points (X, Y, Z, w) relative to the centre of the patch.
    control: Vec<[Interval; 4]>,
    /// Bernstein coefficients of n w³.
    normals: Vec<[Interval; 3]>,
    place: ParameterBox,
    /// Number of halvings that led to the cell.
    depth: u32,
}

/// Returns the side, of u = 0, u = 1, v = 0 and v = 1, nearest to a fold, detected from two
/// neighbouring samples with opposed normals; `None` if no fold is detected. Of several folds, the
/// one nearest to its side counts, and of equal distances the first.
pub(crate) fn seen(patch: &RationalPatch) -> Option<usize> {
    let normal = |(u, v): (f64, f64)| patch.tangents(u, v).normal();
    let normals: Vec<Point3> = grid(FOLD_SAMPLES).map(normal).collect();
    let mut first: Option<(usize, usize)> = None;
    for k in 0..FOLD_SAMPLES * FOLD_SAMPLES {
        let steps = [(k / FOLD_SAMPLES, FOLD_SAMPLES), (k % FOLD_SAMPLES, 1)];
        for (direction, (i, step)) in steps.into_iter().enumerate() {
            if i + 1 == FOLD_SAMPLES || dot(normals[k], normals[k + step]) >= 0.0 {
                continue;
            }
            // Number of steps from the nearer side.
            let (far, upper) = (i.min(FOLD_SAMPLES - 2 - i), i >= FOLD_SAMPLES / 2);
            if first.is_none_or(|f| far < f.0) {
                first = Some((far, 2 * direction + usize::from(upper)));
            }
        }
    }
    first.map(|f| f.1)
}

/// Proves that a patch does not fold over on the surface `field` = 0; if that fails, returns the
/// parameters of a place where it may.
pub(crate) fn prove_none(
    field: &dyn Field,
    patch: &RationalPatch,
    control: &Control<'_>,
) -> Result<(), (f64, f64)> {
    let degree = patch.degree();
    let origin = patch.point(0.5, 0.5);
    let points = about(patch, origin);
    let mut pending = vec![FoldCell {
        normals: normals(&points, degree),
        control: points,
        place: [(0.0, 1.0); 2],
        depth: 0,
    }];
    let mut looked_at = 0;
    while let Some(cell) = pending.pop() {
        looked_at += 1;
        if is_unfolded(field, &cell, origin) {
            continue;
        }
        // Most patches need fewer than 500 cells, which are examined even when time is over.
        let is_late = looked_at >= 500 && control.is_stopped();
        // 20 halvings leave cells of a thousandth of the patch in each direction: with fewer,
        // strongly curved places would count as folds, and more only take time on folds. 20 000
        // cells are a hundred times what a patch on a smooth surface takes.
        if cell.depth == 20 || looked_at == 20_000 || is_late {
            return Err(middle_of(cell.place));
        }
        pending.extend(cell.halves(degree));
    }
    Ok(())
}

/// Returns control points (X − w `origin`, w): products of coordinates far from 0 would lose
/// digits.
fn about(patch: &RationalPatch, origin: Point3) -> Vec<[Interval; 4]> {
    let exact = Interval::constant;
    let moved = |c: &[f64; 4]| {
        std::array::from_fn(|k| match k {
            3 => exact(c[3]),
            _ => exact(c[k]) - exact(origin[k]) * exact(c[3]),
        })
    };
    patch.control().iter().map(moved).collect()
}

/// Returns true if all normals of a cell point to one side of the surface, or are nearly parallel
/// where ∇F may vanish.
fn is_unfolded(field: &dyn Field, cell: &FoldCell, origin: Point3) -> bool {
    let Some(gradient) = gradient(field, cell, origin) else {
        return false;
    };
    has_one_sign(&cell.normals, &gradient)
        || (gradient.iter().all(|g| g.contains(0.0)) && are_alike(&cell.normals))
}

/// Returns true if the products of all normals with a box around the gradient are positive, or all
/// are negative.
fn has_one_sign(normals: &[[Interval; 3]], gradient: &[Interval; 3]) -> bool {
    let mut signs = (true, true);
    for n in normals {
        let product = n[0] * gradient[0] + n[1] * gradient[1] + n[2] * gradient[2];
        signs = (signs.0 && product.lo() > 0.0, signs.1 && product.hi() < 0.0);
        if signs == (false, false) {
            return false;
        }
    }
    true
}

/// Returns true if all normals lie within 45° of one direction: two of them are then less than a
/// right angle apart, so that the cell cannot turn back.
fn are_alike(normals: &[[Interval; 3]]) -> bool {
    let mean = normals.iter().fold([0.0; 3], |sum, n| {
        std::array::from_fn(|k| sum[k] + 0.5 * (n[k].lo() + n[k].hi()))
    });
    let length = norm(mean);
    if !(length > 0.0 && length.is_finite()) {
        return false;
    }
    let axis = mean.map(|v| Interval::constant(v / length));
    normals.iter().all(|n| {
        let along = n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2];
        let size = |v: &Interval| v.lo().abs().max(v.hi().abs());
        let long = norm([size(&n[0]), size(&n[1]), size(&n[2])]);
        // The factor 1 + 1e-12 allows for the rounding of the axis and of the length.
        along.lo() > FRAC_1_SQRT_2 * long * (1.0 + 1e-12)
    })
}

/// Returns a box around ∇F on a cell; `None` if F cannot be expanded or w may vanish.
fn gradient(field: &dyn Field, cell: &FoldCell, origin: Point3) -> Option<[Interval; 3]> {
    let region = cell.region(origin)?;
    let at: Point3 = std::array::from_fn(|k| 0.5 * region.lo[k] + 0.5 * region.hi[k]);
    let reach = |k: usize| Interval::new(region.lo[k], region.hi[k]) - Interval::constant(at[k]);
    let expansion = field.expansion(at, region)?;
    Some(expansion.gradient_at(std::array::from_fn(reach)))
}

impl FoldCell {
    /// Returns a box around the cell; `None` if w may vanish.
    fn region(&self, origin: Point3) -> Option<Aabb> {
        let mut region = Aabb::EMPTY;
        for c in &self.control {
            if c[3].lo() <= 0.0 {
                return None;
            }
            let p: [Interval; 3] =
                std::array::from_fn(|k| c[k] / c[3] + Interval::constant(origin[k]));
            region.add(p.map(|v| v.lo()));
            region.add(p.map(|v| v.hi()));
        }
        Some(region)
    }

    /// Returns the halves across the longer direction.
    fn halves(&self, (m, n): (usize, usize)) -> [Self; 2] {
        let corners = corners_of(&self.control, (m, n))
            .map(|c| [c[0], c[1], c[2]].map(|v| v.lo() / c[3].lo()));
        let (along_u, along_v) = lengths_between(corners);
        let in_u = along_u >= along_v;
        [false, true].map(|upper| {
            let (mut control, mut normals) = (self.control.clone(), self.normals.clone());
            halve_net(&mut control, (m, n), in_u, upper, mean);
            halve_net(&mut normals, (3 * m - 1, 3 * n - 1), in_u, upper, mean);
            let mut place = self.place;
            let range = &mut place[usize::from(!in_u)];
            *range = half_of(*range, upper);
            Self {
                control,
                normals,
                place,
                depth: self.depth + 1,
            }
        })
    }
}

/// Returns the midpoint of two points.
fn mean<const K: usize>(a: [Interval; K], b: [Interval; K]) -> [Interval; K] {
    std::array::from_fn(|k| Interval::constant(0.5) * (a[k] + b[k]))
}

/// Returns the Bernstein coefficients of w Xᵤ × Xᵥ − wᵥ Xᵤ × X − wᵤ X × Xᵥ.
fn normals(control: &[[Interval; 4]], degree: (usize, usize)) -> Vec<[Interval; 3]> {
    let coordinate = |k: usize| Bernstein {
        degree,
        values: control.iter().map(|c| c[k]).collect(),
    };
    let x: [Bernstein; 4] = std::array::from_fn(coordinate);
    let xu = [0, 1, 2, 3].map(|k| x[k].derivative_u());
    let xv = [0, 1, 2, 3].map(|k| x[k].derivative_v());
    let coordinate = |i: usize, j: usize| {
        let both = x[3].times(&minor(&xu, &xv, i, j));
        both.minus(&xv[3].times(&minor(&xu, &x, i, j)))
            .minus(&xu[3].times(&minor(&x, &xv, i, j)))
    };
    let [a, b, c] = [coordinate(1, 2), coordinate(2, 0), coordinate(0, 1)];
    (0..a.values.len())
        .map(|k| [a.values[k], b.values[k], c.values[k]])
        .collect()
}

/// Returns the coordinate aᵢ bⱼ − aⱼ bᵢ of a cross product.
fn minor(a: &[Bernstein; 4], b: &[Bernstein; 4], i: usize, j: usize) -> Bernstein {
    a[i].times(&b[j]).minus(&a[j].times(&b[i]))
}

/// Polynomial of degree (m, n), as its Bernstein coefficients.
struct Bernstein {
    degree: (usize, usize),
    values: Vec<Interval>,
}

impl Bernstein {
    /// Differentiates by u: m times the differences of neighbours in u.
    fn derivative_u(&self) -> Self {
        let (m, n) = self.degree;
        let factor = Interval::constant(m as f64);
        let step = |k: usize| factor * (self.values[k + n + 1] - self.values[k]);
        Self {
            degree: (m - 1, n),
            values: (0..m * (n + 1)).map(step).collect(),
        }
    }
    /// Differentiates by v: n times the differences of neighbours in v.
    fn derivative_v(&self) -> Self {
        let (m, n) = self.degree;
        let factor = Interval::constant(n as f64);
        let step = |k: usize| factor * (self.values[k + 1] - self.values[k]);
        let at = |i: usize| (0..n).map(move |j| i * (n + 1) + j);
        Self {
            degree: (m, n - 1),
            values: (0..=m).flat_map(at).map(step).collect(),
        }
    }
    /// Subtracts a polynomial of equal degree.
    fn minus(&self, other: &Self) -> Self {
        let values = self.values.iter().zip(&other.values).map(|(a, b)| *a - *b);
        Self {
            degree: self.degree,
            values: values.collect(),
        }
    }
    /// Multiplies two polynomials: the coefficients are sums of products weighted by [`shares`].
    fn times(&self, other: &Self) -> Self {
        let ((m, n), (k, l)) = (self.degree, other.degree);
        let (in_u, in_v) = (shares(m, k), shares(n, l));
        let mut values = vec![Interval::constant(0.0); (m + k + 1) * (n + l + 1)];
        for (a, i) in self.values.iter().zip(0..) {
            for (b, j) in other.values.iter().zip(0..) {
                let ((iu, iv), (ju, jv)) = ((i / (n + 1), i % (n + 1)), (j / (l + 1), j % (l + 1)));
                let out = &mut values[(iu + ju) * (n + l + 1) + iv + jv];
                *out = *out + in_u[iu][ju] * in_v[iv][jv] * *a * *b;
            }
        }
        Self {
            degree: (m + k, n + l),
            values,
        }
    }
}

/// Returns the weights, by (i, j), with which coefficients i of degree m and j of degree k enter
/// coefficient i + j of their product. Binomials of degrees up to 24 are exact, their quotient is
/// rounded.
fn shares(m: usize, k: usize) -> Vec<Vec<Interval>> {
    let share = |i: usize, j: usize| {
        let product = binomial(m, i) * binomial(k, j);
        let whole = binomial(m + k, i + j);
        Interval::constant(product) / Interval::constant(whole)
    };
    (0..=m)
        .map(|i| (0..=k).map(|j| share(i, j)).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::Polynomial;

    fn plane() -> Polynomial {
        Polynomial::new([([0, 0, 1], 1.0)])
    }

    /// Returns a patch of the plane z = 0 in which x is the function of u with these Bézier points.
    fn flat(x: [f64; 4]) -> RationalPatch {
        let row = |x: f64| [0.0, 0.5, 1.0].map(|y| [x, y, 0.0, 1.0]);
        RationalPatch::new((3, 2), x.map(row).concat()).expect("a patch")
    }

    /// x′ ∝ (1 − u)² b₀ + 2u(1 − u) b₁ + u² b₂ with b = (1, 2t − 1, 1) vanishes for t ≤ 0 only: for
    /// t = 0 at u = 1/2, for t < 0 at both sides of that.
    #[test]
    fn a_patch_folds_where_its_derivative_changes_sign() {
        let of = |t: f64| flat([0.0, 1.0, 2.0 * t, 1.0 + 2.0 * t]);
        for t in [1e-3, 0.1, 0.5] {
            assert_eq!(
                prove_none(&plane(), &of(t), &Control::default()),
                Ok(()),
                "{t}"
            );
            assert_eq!(seen(&of(t)), None);
        }
        for t in [0.0, -1e-6, -0.1] {
            let (u, _) = prove_none(&plane(), &of(t), &Control::default()).expect_err("a fold");
            let root = 0.5 - 0.5 * (-t / (1.0 - t)).sqrt();
            assert!(
                (u - root).abs().min((1.0 - u - root).abs()) < 0.01,
                "{t}: {u}"
            );
        }
        assert!(seen(&of(-0.1)).is_some());
    }

    /// A thin S in the plane x z: its points are within 1e-6 of z = 0 and its tangent vanishes
    /// nowhere, so that only the reversed normal shows the fold.
    #[test]
    fn a_fold_within_the_tolerance_is_one() {
        let mut patch = flat([0.0, 1.0, -0.2, 0.8]);
        for (i, c) in patch.control_mut().iter_mut().enumerate() {
            c[2] = 1e-6 * [0.0, 1.0, 0.0, 1.0][i / 3];
        }
        assert!(prove_none(&plane(), &patch, &Control::default()).is_err());
    }

    /// The planes x = 0 and y = 0 of x y = 0 cross in the z axis, where ∇F vanishes.
    #[test]
    fn a_self_intersection_is_no_fold() {
        let planes = Polynomial::new([([1, 1, 0], 1.0)]);
        let across = |bend: f64| {
            let mut patch =
                RationalPatch::planar((3, 2), [0.0, -0.4, -0.3], [0.0, 0.7, 0.0], [0.0, 0.1, 0.6]);
            for (i, c) in patch.control_mut().iter_mut().enumerate() {
                c[1] += [0.0, bend, -bend, 0.0][i / 3];
            }
            patch
        };
        assert_eq!(
            prove_none(&planes, &across(0.05), &Control::default()),
            Ok(())
        );
        assert!(prove_none(&planes, &across(1.5), &Control::default()).is_err());
    }

    /// The coefficients contain n w³ for rational patches near and far from the origin, on all
    /// parts.
    #[test]
    fn coefficients_are_those_of_normals() {
        for seed in 0..200u32 {
            let wave = |k: u32| f64::from(seed * 37 + k * 101).sin();
            let degree = (1 + seed as usize % 4, 1 + seed as usize / 4 % 3);
            let count = ((degree.0 + 1) * (degree.1 + 1)) as u32;
            let far = [0.0, 1e3][seed as usize % 2];
            let control = (0..count).map(|k| {
                let w = 1.0 + 0.5 * wave(4 * k);
                [wave(4 * k + 1) + far, wave(4 * k + 2), wave(4 * k + 3), 1.0].map(|v| v * w)
            });
            let patch = RationalPatch::new(degree, control.collect()).expect("a patch");
            let origin = patch.point(0.5, 0.5);
            let control = about(&patch, origin);
            let mut cell = FoldCell {
                normals: normals(&control, degree),
                control,
                place: [(0.0, 1.0); 2],
                depth: 0,
            };
            for step in 0..6 {
                let corner = patch.tangents(cell.place[0].0, cell.place[1].0);
                let w3 = corner.weight.powi(3);
                for (held, n) in cell.normals[0].iter().zip(corner.normal()) {
                    let near = 1e-12 * (1.0 + far) * (1.0 + norm(corner.normal()));
                    assert!(
                        held.lo() - near <= n * w3 && n * w3 <= held.hi() + near,
                        "{seed}: {held:?} {n}"
                    );
                }
                let [lower, upper] = cell.halves(degree);
                cell = if step % 2 == 0 { upper } else { lower };
            }
        }
    }
}
