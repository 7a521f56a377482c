//! Graphs of bivariate functions that are tensor-product B-splines.

use super::Axes;
use crate::{Point3, cross, dot};
use isoform_num::Svd;
use std::array::from_fn;

/// Surface z = h(x, y) over a rectangle, in coordinates of a frame, where h is a tensor-product
/// B-spline. The parameters are x and y themselves, so that projection along z needs no iteration.
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    /// Frame of the coordinates x, y and z.
    pub axes: Axes,
    /// Degree in x and in y, at most 7.
    pub degree: usize,
    /// Knot vectors of x and of y, ascending, with degree + 1 equal knots at both ends.
    pub knots: [Vec<f64>; 2],
    /// Coefficients of h: number i·n + j belongs to B-spline i of x and B-spline j of y, n the
    /// number of B-splines of y.
    pub heights: Vec<f64>,
}

/// Value of h with its first and second derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Height {
    /// Value of h.
    pub value: f64,
    /// Gradient: ∂h/∂x and ∂h/∂y.
    pub slope: [f64; 2],
    /// Second derivatives: ∂²h/∂x², ∂²h/∂x∂y and ∂²h/∂y².
    pub second: [f64; 3],
}

/// Line of a graph along which x is constant: a spline of y.
pub struct GraphLine<'a> {
    graph: &'a Graph,
    x: f64,
    /// Coefficients of h and of ∂h/∂x.
    heights: [Vec<f64>; 2],
}

impl GraphLine<'_> {
    /// Returns the point and ∂p/∂x × ∂p/∂y at y.
    pub fn area_element(&self, y: f64) -> (Point3, Point3) {
        let graph = self.graph;
        let basis = Basis::at(&graph.knots[1], graph.degree, y);
        let own = basis.first..=basis.first + graph.degree;
        let sum = |which: usize, order: usize| -> f64 {
            let terms = self.heights[which][own.clone()].iter();
            terms.zip(&basis.values[order]).map(|(c, b)| c * b).sum()
        };
        let point = graph.axes.point([self.x, y, sum(0, 0)]);
        (point, graph.axes.vector([-sum(1, 0), -sum(0, 1), 1.0]))
    }
}

/// Maximum number of B-splines that do not vanish at a point: the maximum degree plus 1.
const MAX_ACTIVE_SPLINES: usize = 8;

/// Values of the B-splines that do not vanish at a parameter.
pub struct Basis {
    /// Index of the first one.
    pub first: usize,
    /// Values, first and second derivatives; the first degree + 1 entries of each are used.
    pub values: [[f64; MAX_ACTIVE_SPLINES]; 3],
}

impl Basis {
    /// Evaluates the B-splines of a degree (at most 7) at `t`, by the recursion of Cox and de Boor;
    /// the outermost polynomials are continued beyond the ends of the knots.
    pub fn at(knots: &[f64], degree: usize, t: f64) -> Self {
        let last = knots.len() - degree - 2;
        let inner = &knots[degree + 1..=last];
        let span = degree + inner.partition_point(|k| *k <= t);
        let mut levels = [[0.0; MAX_ACTIVE_SPLINES]; 3];
        let mut n = [0.0; MAX_ACTIVE_SPLINES];
        n[0] = 1.0;
        for p in 1..=degree {
            if p + 2 > degree {
                levels[degree + 1 - p] = n;
            }
            let mut saved = 0.0;
            for r in 0..p {
                let (right, left) = (knots[span + r + 1], knots[span + r + 1 - p]);
                let share = n[r] / (right - left);
                n[r] = saved + (right - t) * share;
                saved = (t - left) * share;
            }
            n[p] = saved;
        }
        let first = span - degree;
        let mut values = [n, [0.0; MAX_ACTIVE_SPLINES], [0.0; MAX_ACTIVE_SPLINES]];
        // First derivatives are differences of the B-splines of one degree less, second ones
        // differences of differences of those of two degrees less.
        let difference = |lower: &[f64; MAX_ACTIVE_SPLINES], p: usize| {
            let mut out = [0.0; MAX_ACTIVE_SPLINES];
            let from = span - p;
            for (j, out) in out.iter_mut().enumerate().take(p + 1) {
                let width = |i: usize| knots[i + p] - knots[i];
                let left = if j > 0 {
                    lower[j - 1] / width(from + j)
                } else {
                    0.0
                };
                let right = if j < p {
                    lower[j] / width(from + j + 1)
                } else {
                    0.0
                };
                *out = p as f64 * (left - right);
            }
            out
        };
        if degree >= 1 {
            values[1] = difference(&levels[1], degree);
        }
        if degree >= 2 {
            values[2] = difference(&difference(&levels[2], degree - 1), degree);
        }
        Self { first, values }
    }
}

/// Tolerance of the squared lengths and of the cosine of a frame's directions. They are computed
/// from rounded control points, which determine them less accurately the flatter the graph is.
const FITTED_FRAME_TOLERANCE: f64 = 1e-6;
/// Ratio of the smallest to the largest singular value of the control points at or below which they
/// count as flat: the unit length of the directions then determines their components across the
/// plane more accurately than the points do.
const FLATNESS_RATIO: f64 = 1e-6;

/// Returns the directions x and y along which points have the given coordinates, by least squares:
/// the sums of (uₖ·b / σₖ) vₖ. If the points are flat, the components along their normal v₃ are
/// those that make x and y orthogonal and of length 1.
fn directions(svd: &Svd<Vec<f64>, 3>, sides: &[Vec<f64>; 2]) -> [Point3; 2] {
    let share = |k: usize, b: &[f64]| {
        let size = svd.values[k];
        if size > 0.0 {
            svd.along(k, b) / size
        } else {
            0.0
        }
    };
    let shares = sides.each_ref().map(|b| [0, 1, 2].map(|k| share(k, b)));
    let mut across = shares.map(|s| s[2]);
    if svd.values[2] <= FLATNESS_RATIO * svd.values[0] {
        let [[a, b, p], [c, d, q]] = shares;
        let rest = |e: f64, f: f64| (1.0 - e * e - f * f).max(0.0).sqrt();
        let (u, mut v) = (rest(a, b), rest(c, d));
        if a * c + b * d > 0.0 {
            v = -v;
        }
        let side = if u * p + v * q < 0.0 { -1.0 } else { 1.0 };
        across = [side * u, side * v];
    }
    [0, 1].map(|i| {
        let parts = [shares[i][0], shares[i][1], across[i]];
        from_fn(|j| (0..3).map(|k| parts[k] * svd.right[k][j]).sum())
    })
}

impl Graph {
    /// Returns the number of B-splines of y.
    pub fn columns(&self) -> usize {
        self.knots[1].len() - self.degree - 1
    }
    /// Returns the number of B-splines of x.
    pub fn rows(&self) -> usize {
        self.knots[0].len() - self.degree - 1
    }
    /// Returns the intervals of x and of y.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|k| {
            let knots = &self.knots[k];
            [knots[0], knots[knots.len() - 1]]
        })
    }
    /// Returns h and its derivatives at x and y.
    pub fn height(&self, [x, y]: [f64; 2]) -> Height {
        let p = self.degree;
        let [u, v] = [(0, x), (1, y)].map(|(k, t)| Basis::at(&self.knots[k], p, t));
        let columns = self.columns();
        let mut made = Height::default();
        for i in 0..=p {
            let from = (u.first + i) * columns + v.first;
            let row = &self.heights[from..=from + p];
            let along =
                |d: usize| -> f64 { row.iter().zip(&v.values[d]).map(|(c, b)| c * b).sum() };
            let [value, slope, second] = [along(0), along(1), along(2)];
            let [b, db, ddb] = [u.values[0][i], u.values[1][i], u.values[2][i]];
            made.value += b * value;
            made.slope[0] += db * value;
            made.slope[1] += b * slope;
            made.second[0] += ddb * value;
            made.second[1] += db * slope;
            made.second[2] += b * second;
        }
        made
    }
    /// Returns the signed distance from the surface to first order: the height above it divided by
    /// the length of the normal (−∂h/∂x, −∂h/∂y, 1); and the unit normal.
    pub fn distance(&self, p: Point3) -> (f64, Point3) {
        let [x, y, z] = self.axes.local(p);
        let Height { value, slope, .. } = self.height([x, y]);
        let length = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
        let normal = [-slope[0], -slope[1], 1.0].map(|v| v / length);
        ((z - value) / length, self.axes.vector(normal))
    }
    /// Returns the second derivative of the distance along a tangent.
    pub fn bending(&self, p: Point3, along: Point3) -> f64 {
        let [x, y, _] = self.axes.local(p);
        let Height { slope, second, .. } = self.height([x, y]);
        let [a, b] = [dot(along, self.axes.x), dot(along, self.axes.y())];
        let [xx, xy, yy] = second;
        let length = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
        -(xx * a * a + 2.0 * xy * a * b + yy * b * b) / length
    }
    /// Returns the point of the surface at x and y.
    pub fn point(&self, [x, y]: [f64; 2]) -> Point3 {
        self.axes.point([x, y, self.height([x, y]).value])
    }
    /// Returns ∂p/∂x × ∂p/∂y.
    pub fn area_vector(&self, at: [f64; 2]) -> Point3 {
        let [a, b] = self.height(at).slope;
        self.axes.vector([-a, -b, 1.0])
    }
    /// Returns the line at x.
    pub fn line(&self, x: f64) -> GraphLine<'_> {
        let basis = Basis::at(&self.knots[0], self.degree, x);
        let columns = self.columns();
        let sum = |order: usize, j: usize| -> f64 {
            let term =
                |i: usize| basis.values[order][i] * self.heights[(basis.first + i) * columns + j];
            (0..=self.degree).map(term).sum()
        };
        let heights = [0, 1].map(|order| (0..columns).map(|j| sum(order, j)).collect());
        GraphLine {
            graph: self,
            x,
            heights,
        }
    }
    /// Returns the Greville abscissae of each coefficient: x and y of its control point.
    fn greville(&self) -> Vec<[f64; 2]> {
        let means = |k: usize| -> Vec<f64> {
            let knots = &self.knots[k];
            let count = knots.len() - self.degree - 1;
            let mean = |i: usize| knots[i + 1..=i + self.degree].iter().sum::<f64>();
            (0..count).map(|i| mean(i) / self.degree as f64).collect()
        };
        let (xs, ys) = (means(0), means(1));
        let pairs = xs.iter().flat_map(|x| ys.iter().map(move |y| [*x, *y]));
        pairs.collect()
    }
    /// Returns the control points in the order of the coefficients; their x and y are the Greville
    /// abscissae.
    pub fn control(&self) -> Vec<Point3> {
        let all = self.greville().into_iter();
        all.zip(&self.heights)
            .map(|([x, y], h)| self.axes.point([x, y, *h]))
            .collect()
    }
    /// Returns the graph with these control points ([`Self::control`]): its frame is the one in
    /// which their x and y are the Greville abscissae, by least squares; `None` if the
    /// least-squares frame is not orthonormal. Flat control points admit two frames, both with this
    /// surface. The knots have the form of [`Graph::knots`].
    pub fn of_control(degree: usize, knots: [Vec<f64>; 2], control: &[Point3]) -> Option<Self> {
        let axes = Axes {
            origin: [0.0; 3],
            z: [0.0; 3],
            x: [0.0; 3],
        };
        let mut graph = Self {
            axes,
            degree,
            knots,
            heights: vec![0.0; control.len()],
        };
        let at = graph.greville();
        let count = control.len() as f64;
        let mean_of = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / count;
        let center: Point3 = from_fn(|k| mean_of(&mut control.iter().map(|p| p[k])));
        let columns = [0, 1, 2].map(|k| control.iter().map(|p| p[k] - center[k]).collect());
        let svd: Svd<Vec<f64>, 3> = Svd::new(columns);
        let middle = [0, 1].map(|k| mean_of(&mut at.iter().map(|g| g[k])));
        let sides = [0, 1].map(|k| at.iter().map(|g| g[k] - middle[k]).collect::<Vec<f64>>());
        let [x, y] = directions(&svd, &sides);
        let lengths = [dot(x, x), dot(y, y), 1.0 + dot(x, y)];
        if lengths
            .iter()
            .any(|l| (l - 1.0).abs() > FITTED_FRAME_TOLERANCE || l.is_nan())
        {
            return None;
        }
        let x = x.map(|v| v / lengths[0].sqrt());
        let z = cross(x, y);
        let z = z.map(|v| v / dot(z, z).sqrt());
        let origin = from_fn(|k| center[k] - middle[0] * x[k] - middle[1] * cross(z, x)[k]);
        graph.axes = Axes { origin, z, x };
        let heights = control.iter().map(|p| graph.axes.local(*p)[2]);
        graph.heights = heights.collect();
        Some(graph)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{norm, sub};

    /// Returns a clamped knot vector with the given inner knots.
    fn knots(degree: usize, inner: &[f64]) -> Vec<f64> {
        let end = |t: f64| std::iter::repeat_n(t, degree + 1);
        end(0.0)
            .chain(inner.iter().copied())
            .chain(end(2.0))
            .collect()
    }

    #[test]
    fn the_basis_adds_to_one_and_its_derivatives_are_differences() {
        for degree in 2..=5 {
            let knots = knots(degree, &[0.3, 1.1, 1.2]);
            for t in [0.0, 0.1, 0.3, 0.9, 1.15, 1.9, 2.0] {
                let b = Basis::at(&knots, degree, t);
                let sums = b.values.map(|v| v.iter().sum::<f64>());
                assert!((sums[0] - 1.0).abs() < 1e-13, "{degree} {t} {sums:?}");
                assert!(sums[1].abs() < 1e-11 && sums[2].abs() < 1e-9, "{sums:?}");
            }
            // All samples are in one knot span: differences are those of one polynomial.
            let (t, h) = (0.7, 1e-4);
            let [a, b, c] = [t - h, t, t + h].map(|t| Basis::at(&knots, degree, t).values);
            for j in 0..=degree {
                assert!(((c[0][j] - a[0][j]) / (2.0 * h) - b[1][j]).abs() < 1e-6);
                let second = (c[0][j] - 2.0 * b[0][j] + a[0][j]) / (h * h);
                assert!((second - b[2][j]).abs() < 1e-5, "{second} {}", b[2][j]);
            }
        }
    }

    #[test]
    fn control_points_carry_the_plane_and_distances_are_those_of_the_surface() {
        let axes = Axes::along([0.3, -0.2, 0.1], [0.6, 0.0, 0.8]);
        let degree = 3;
        let mut graph = Graph {
            axes,
            degree,
            knots: [knots(degree, &[0.5]), knots(degree, &[0.4, 1.3])],
            heights: vec![0.0; 5 * 6],
        };
        // If the heights are a linear function of the Greville abscissae, h is that function.
        let flat = graph.control();
        graph.heights = flat
            .iter()
            .map(|p| {
                let [x, y, _] = axes.local(*p);
                0.5 * x - 0.25 * y + 0.1
            })
            .collect();
        for at in [[0.0, 0.0], [0.7, 1.9], [2.0, 1.3]] {
            let h = graph.height(at);
            assert!((h.value - (0.5 * at[0] - 0.25 * at[1] + 0.1)).abs() < 1e-14);
            assert!((h.slope[0] - 0.5).abs() + (h.slope[1] + 0.25).abs() < 1e-13);
            let p = graph.point(at);
            let n = graph.area_vector(at);
            let off = from_fn(|k| p[k] + 0.3 * n[k] / norm(n));
            let (d, normal) = graph.distance(off);
            assert!((d - 0.3).abs() < 1e-14, "{d}");
            assert!(norm(sub(normal, n.map(|v| v / norm(n)))) < 1e-14);
        }
    }

    /// Returns z = x/2 + bend (x² + y)/4 over a rectangle, with one inner knot.
    fn bent(bend: f64) -> Graph {
        let mut graph = Graph {
            axes: Axes::along([0.3, -0.2, 0.1], [0.6, 0.0, 0.8]),
            degree: 3,
            knots: [knots(3, &[0.5]), knots(3, &[0.4, 1.3])],
            heights: Vec::new(),
        };
        let heights = graph.greville().into_iter();
        graph.heights = heights.map(|[x, y]| bend * (x * x + y) / 4.0).collect();
        graph
    }

    #[test]
    fn control_points_tell_the_frame_or_one_as_good() {
        for bend in [1.0, 1e-3, 1e-6, 1e-8, 1e-10, 1e-13, 0.0] {
            let graph = bent(bend);
            let control = graph.control();
            let again = Graph::of_control(3, graph.knots.clone(), &control).expect("a graph");
            for (p, q) in control.iter().zip(again.control()) {
                assert!(norm(sub(*p, q)) < 1e-14, "{bend}: {p:?} {q:?}");
            }
            // The frame of a flat graph may be mirrored.
            assert!(bend < 1e-6 || dot(again.axes.z, graph.axes.z) > 1.0 - 1e-12);
        }
        let other = bent(1.0);
        let stretched = other
            .control()
            .iter()
            .map(|p| p.map(|v| 2.0 * v))
            .collect::<Vec<_>>();
        assert_eq!(Graph::of_control(3, other.knots, &stretched), None);
    }
}
