//! Kind, axes and measures of a quadric from its equation.
//!
//! The equation is given in diagonal form, Σ λₖ yₖ² + 2 Σ bₖ yₖ + c = 0 ([`Diagonal`]). A direction
//! is called round if λₖ ≠ 0, and flat if λₖ = 0. Completing squares removes the terms of degree 1
//! in the round directions; then the number of flat directions and the signs of λₖ determine the
//! kind:
//!
//! - no flat direction: ellipsoid, hyperboloid or cone;
//! - one: elliptic or hyperbolic cylinder, or, if bₖ ≠ 0 along it, a paraboloid;
//! - two: parabolic cylinder.

use isoform_geom::{NormalForm, Point3, QuadricKind, cross};

/// Equation Σ λₖ yₖ² + 2 Σ bₖ yₖ + c = 0 in coordinates yₖ = eₖ·x along orthonormal vectors eₖ.
#[derive(Clone, Copy)]
pub(crate) struct Diagonal {
    pub(crate) values: [f64; 3],
    pub(crate) vectors: [Point3; 3],
    pub(crate) along: [f64; 3],
    pub(crate) constant: f64,
}

impl Diagonal {
    /// Returns the normal form; `None` for planes and equations without a real surface. Values of
    /// at most `zero` times the largest |λₖ| count as 0.
    pub(crate) fn normal_form(&self, zero: f64) -> Option<NormalForm> {
        let size = self.values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let is_zero = |x: f64| x.abs() <= zero * size;
        let (round, flat): (Vec<usize>, Vec<usize>) =
            (0..3).partition(|&k| !is_zero(self.values[k]));
        let (center, rest) = self.about_center(&round);
        match (&round[..], &flat[..]) {
            (_, []) => self.with_center(center, rest, is_zero(rest)),
            (&[i, j], &[k]) if is_zero(self.along[k]) => {
                self.cylinder([i, j, k], center, rest, is_zero(rest))
            }
            (&[i, j], &[k]) => Some(self.paraboloid([i, j, k], center, rest)),
            (&[k], &[i, j]) => self.parabolic_cylinder([k, i, j], center, rest, &is_zero),
            _ => None,
        }
    }

    /// Returns the point about which the round directions have no terms of degree 1, and the
    /// constant term there.
    fn about_center(&self, round: &[usize]) -> (Point3, f64) {
        let place = |k: usize| -self.along[k] / self.values[k];
        let mut center = [0.0; 3];
        for &k in round {
            for i in 0..3 {
                center[i] += place(k) * self.vectors[k][i];
            }
        }
        let rest = self.constant + round.iter().map(|&k| self.along[k] * place(k)).sum::<f64>();
        (center, rest)
    }

    /// Assembles the normal form of a kind, with the axes in a given order.
    fn form(
        &self,
        kind: QuadricKind,
        center: Point3,
        order: [usize; 3],
        measures: [f64; 3],
    ) -> NormalForm {
        NormalForm {
            kind,
            center,
            axes: order.map(|k| self.vectors[k]),
            measures,
        }
    }

    /// Returns the normal form of Σ λₖ yₖ² + rest = 0 about the centre.
    fn with_center(&self, center: Point3, rest: f64, is_cone: bool) -> Option<NormalForm> {
        if is_cone {
            return self.cone(center);
        }
        // The denominators qₖ of Σ yₖ² / qₖ = 1.
        let squares = self.values.map(|v| -rest / v);
        let positive = squares.iter().filter(|q| **q > 0.0).count();
        let kind = match positive {
            3 => QuadricKind::Ellipsoid,
            2 => QuadricKind::HyperboloidOfOneSheet,
            1 => QuadricKind::HyperboloidOfTwoSheets,
            _ => return None,
        };
        // The axis whose sign differs from the other two comes last.
        let mut order = [0, 1, 2];
        order.sort_by_key(|&k| (squares[k] > 0.0) == (positive == 1));
        let measures = order.map(|k| squares[k].abs().sqrt());
        Some(self.form(kind, center, order, measures))
    }

    /// Returns the normal form of Σ λₖ yₖ² = 0 about the apex; `None` if only the apex is real.
    fn cone(&self, apex: Point3) -> Option<NormalForm> {
        let positive = (0..3).filter(|&k| self.values[k] > 0.0).count();
        let alone = (0..3).find(|&k| (self.values[k] > 0.0) == (positive == 1))?;
        if positive % 3 == 0 {
            return None;
        }
        let [i, j] = [(alone + 1) % 3, (alone + 2) % 3];
        let slope = |k: usize| (-self.values[alone] / self.values[k]).sqrt();
        let measures = [slope(i), slope(j), 0.0];
        Some(self.form(QuadricKind::EllipticCone, apex, [i, j, alone], measures))
    }

    /// Returns the normal form of λᵢ yᵢ² + λⱼ yⱼ² + rest = 0 along the axis k; `None` for a line, a
    /// pair of planes, or no real surface.
    fn cylinder(
        &self,
        [i, j, k]: [usize; 3],
        center: Point3,
        rest: f64,
        is_flat: bool,
    ) -> Option<NormalForm> {
        let square = |k: usize| -rest / self.values[k];
        let (kind, order) = match (square(i) > 0.0, square(j) > 0.0) {
            _ if is_flat => return None,
            (true, true) => (QuadricKind::EllipticCylinder, [i, j, k]),
            (true, false) => (QuadricKind::HyperbolicCylinder, [i, j, k]),
            (false, true) => (QuadricKind::HyperbolicCylinder, [j, i, k]),
            (false, false) => return None,
        };
        let measure = |k: usize| square(k).abs().sqrt();
        let measures = [measure(order[0]), measure(order[1]), 0.0];
        Some(self.form(kind, center, order, measures))
    }

    /// Returns the normal form of λᵢ yᵢ² + λⱼ yⱼ² + 2 b yₖ + rest = 0 about the point with yₖ = 0.
    fn paraboloid(&self, [i, j, k]: [usize; 3], foot: Point3, rest: f64) -> NormalForm {
        let b = self.along[k];
        let height = -rest / (2.0 * b);
        let vertex = std::array::from_fn(|x| foot[x] + height * self.vectors[k][x]);
        let radius = |k: usize| -b / self.values[k];
        let is_elliptic = (radius(i) > 0.0) == (radius(j) > 0.0);
        let kind = match is_elliptic {
            true => QuadricKind::EllipticParaboloid,
            false => QuadricKind::HyperbolicParaboloid,
        };
        // The z axis points to the side on which an elliptic paraboloid lies; the x axis lies in
        // the plane in which a hyperbolic one opens upward.
        let down = is_elliptic && radius(i) < 0.0;
        let order = if !is_elliptic && radius(i) < 0.0 {
            [j, i, k]
        } else {
            [i, j, k]
        };
        let measures = [radius(order[0]).abs(), radius(order[1]).abs(), 0.0];
        let mut form = self.form(kind, vertex, order, measures);
        if down {
            form.axes[2] = form.axes[2].map(|x| -x);
        }
        form
    }

    /// Returns the normal form of λ yₖ² + 2 (bᵢ yᵢ + bⱼ yⱼ) + rest = 0 about the point with yᵢ = yⱼ
    /// = 0.
    fn parabolic_cylinder(
        &self,
        [k, i, j]: [usize; 3],
        foot: Point3,
        rest: f64,
        is_zero: &dyn Fn(f64) -> bool,
    ) -> Option<NormalForm> {
        let slope = self.along[i].hypot(self.along[j]);
        if is_zero(slope) {
            return None;
        }
        let [p, q] = [i, j].map(|k| self.along[k] / slope);
        let radius = -slope / self.values[k];
        let sign = radius.signum();
        let up: Point3 = std::array::from_fn(|x| p * self.vectors[i][x] + q * self.vectors[j][x]);
        let height = -rest / (2.0 * slope);
        let across = self.vectors[k];
        let up_turned = up.map(|x| sign * x);
        Some(NormalForm {
            kind: QuadricKind::ParabolicCylinder,
            center: std::array::from_fn(|x| foot[x] + height * up[x]),
            axes: [across, cross(up_turned, across), up_turned],
            measures: [radius.abs(), 0.0, 0.0],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::dot;

    /// Orthonormal frame without zeros.
    const FRAME: [Point3; 3] = [
        [2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0],
        [-2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0],
        [1.0 / 3.0, -2.0 / 3.0, 2.0 / 3.0],
    ];
    const PLACE: Point3 = [0.3, -0.2, 0.7];

    /// Returns the equation Σ λₖ xₖ² + 2 Σ bₖ xₖ + c = 0 in coordinates along the frame about the
    /// centre.
    fn diagonal(values: [f64; 3], b: [f64; 3], c: f64) -> Diagonal {
        let at = FRAME.map(|e| dot(e, PLACE));
        let along = [0, 1, 2].map(|k| b[k] - values[k] * at[k]);
        let constant = c
            + (0..3)
                .map(|k| values[k] * at[k] * at[k] - 2.0 * b[k] * at[k])
                .sum::<f64>();
        Diagonal {
            values,
            vectors: FRAME,
            along,
            constant,
        }
    }

    /// Evaluates the equation of a normal form at a point.
    fn value(form: &NormalForm, p: Point3) -> f64 {
        let d = isoform_geom::sub(p, form.center);
        let [x, y, z] = form.axes.map(|e| dot(e, d));
        let [a, b, c] = form.measures;
        let square = |x: f64, a: f64| x * x / (a * a);
        match form.kind {
            QuadricKind::Ellipsoid => square(x, a) + square(y, b) + square(z, c) - 1.0,
            QuadricKind::HyperboloidOfOneSheet => square(x, a) + square(y, b) - square(z, c) - 1.0,
            QuadricKind::HyperboloidOfTwoSheets => square(x, a) + square(y, b) - square(z, c) + 1.0,
            QuadricKind::EllipticCone => square(x, a) + square(y, b) - z * z,
            QuadricKind::EllipticCylinder => square(x, a) + square(y, b) - 1.0,
            QuadricKind::HyperbolicCylinder => square(x, a) - square(y, b) - 1.0,
            QuadricKind::ParabolicCylinder => x * x / a - 2.0 * z,
            QuadricKind::EllipticParaboloid => x * x / a + y * y / b - 2.0 * z,
            QuadricKind::HyperbolicParaboloid => x * x / a - y * y / b - 2.0 * z,
        }
    }

    /// Each kind, with both signs of the equation: the normal form vanishes where the equation
    /// does, as one is a multiple of the other, and has the measures from which the equation was
    /// made.
    #[test]
    fn kinds_and_measures() {
        use QuadricKind::*;
        let cases = [
            (
                Ellipsoid,
                [1.0 / 4.0, 1.0, 1.0 / 9.0],
                [0.0; 3],
                -1.0,
                [2.0, 1.0, 3.0],
            ),
            (
                HyperboloidOfOneSheet,
                [0.25, -1.0, 1.0 / 9.0],
                [0.0; 3],
                -1.0,
                [2.0, 3.0, 1.0],
            ),
            (
                HyperboloidOfTwoSheets,
                [0.25, -1.0, 1.0 / 9.0],
                [0.0; 3],
                1.0,
                [2.0, 3.0, 1.0],
            ),
            (
                EllipticCone,
                [0.25, -1.0, 1.0 / 9.0],
                [0.0; 3],
                0.0,
                [3.0, 2.0, 0.0],
            ),
            (
                EllipticCylinder,
                [0.25, 0.0, 1.0],
                [0.0; 3],
                -1.0,
                [2.0, 1.0, 0.0],
            ),
            (
                HyperbolicCylinder,
                [-0.25, 0.0, 1.0],
                [0.0; 3],
                -1.0,
                [1.0, 2.0, 0.0],
            ),
            (
                ParabolicCylinder,
                [0.0, 0.5, 0.0],
                [-0.6, 0.0, 0.8],
                0.0,
                [2.0, 0.0, 0.0],
            ),
            (
                EllipticParaboloid,
                [0.5, 0.0, 0.25],
                [0.0, 1.0, 0.0],
                0.0,
                [2.0, 4.0, 0.0],
            ),
            (
                HyperbolicParaboloid,
                [0.5, 0.0, -0.25],
                [0.0, 1.0, 0.0],
                0.0,
                [4.0, 2.0, 0.0],
            ),
        ];
        for (kind, values, b, c, measures) in cases {
            for sign in [1.0, -1.0] {
                let [values, b] = [values, b].map(|x| x.map(|x| sign * x));
                let equation = diagonal(values, b, sign * c);
                let form = equation.normal_form(1e-8).expect("a quadric");
                assert_eq!(form.kind, kind);
                for k in 0..3 {
                    assert!((form.measures[k] - measures[k]).abs() < 1e-12, "{form:?}");
                    for j in 0..3 {
                        let product = dot(form.axes[k], form.axes[j]);
                        assert!((product - f64::from(u8::from(j == k))).abs() < 1e-12);
                    }
                }
                let of = |p: Point3| {
                    let y = FRAME.map(|e| dot(e, p));
                    let terms =
                        (0..3).map(|k| values[k] * y[k] * y[k] + 2.0 * equation.along[k] * y[k]);
                    terms.sum::<f64>() + equation.constant
                };
                let points = [
                    [1.0, 0.2, -0.5],
                    [-0.4, 2.0, 0.3],
                    [0.1, -1.1, 3.0],
                    [2.0, 1.0, 0.7],
                ];
                let ratios = points.map(|p| of(p) / value(&form, p));
                for ratio in ratios {
                    assert!(
                        (ratio / ratios[0] - 1.0).abs() < 1e-10,
                        "{kind:?} {ratios:?}"
                    );
                }
            }
        }
    }

    /// Planes, a line, a point and the empty set have no normal form.
    #[test]
    fn what_is_no_quadric() {
        let cases = [
            ([1.0, 1.0, 1.0], [0.0; 3], 1.0),
            ([1.0, 2.0, 1.0], [0.0; 3], 0.0),
            ([1.0, -1.0, 0.0], [0.0; 3], 0.0),
            ([1.0, 1.0, 0.0], [0.0; 3], 1.0),
            ([1.0, 0.0, 0.0], [0.0; 3], -1.0),
            ([0.0; 3], [1.0, 0.0, 0.0], 1.0),
        ];
        for (values, b, c) in cases {
            assert_eq!(
                diagonal(values, b, c).normal_form(1e-8),
                None,
                "{values:?} {c}"
            );
        }
    }
}
