//! Approximation of a smooth surface by a B-spline, over a part of it that is a graph.
//!
//! Heights above the points of a lattice are found by Newton's method, starting from the triangles
//! and going outward from there as far as the function is a graph. The coefficients are fitted to
//! them by least squares; where no heights are known the third differences of the coefficients are
//! kept small. The surface extends beyond the part, so that edges lie inside its domain.

use isoform_geom::brep::{Axes, Basis, Graph};
use isoform_geom::{Field, Point3, cross, dot, norm, sub};
use isoform_num::linalg::banded_solve;
use std::collections::VecDeque;

/// Degree of the splines: with 5 the error falls with the sixth power of the width of the spans.
const SPLINE_DEGREE: usize = 5;
/// Numbers of spans along the longer side that are tried, one after another.
const SPAN_COUNTS: [usize; 7] = [4, 6, 9, 13, 19, 28, 40];

/// A part of a smooth surface.
pub(crate) struct HeightRegion<'a> {
    /// Function whose zero set it is.
    pub(crate) field: &'a dyn Field,
    /// Corners of its triangles.
    pub(crate) triangles: Vec<[Point3; 3]>,
    /// Direction in which it is a graph.
    pub(crate) direction: Point3,
}

impl HeightRegion<'_> {
    /// Returns a spline within `tolerance` at samples of the part, and turned by at most `turn`
    /// (radians) as far as more spans reduce the angle; `None` if the finest is farther away, or
    /// the part is not a graph.
    pub(crate) fn fit(&self, tolerance: f64, turn: f64) -> Option<Graph> {
        let frame = self.frame();
        let local: Vec<[Point3; 3]> = self
            .triangles
            .iter()
            .map(|t| t.map(|p| frame.local(p)))
            .collect();
        let domain = domain(&local);
        let (mut last, mut near) = (f64::INFINITY, None);
        for spans in SPAN_COUNTS {
            let mut best: Option<(Graph, [f64; 2])> = None;
            for lattice in HeightLattice::for_spans(domain, spans) {
                let heights = lattice.heights(self.field, &frame, &local);
                let graph = lattice.least_squares(frame, &heights)?;
                let found = self.worst(&graph);
                if best.as_ref().is_none_or(|b| found[0] < b.1[0]) {
                    best = Some((graph, found));
                }
                if found[0] <= tolerance && found[1] <= turn {
                    break;
                }
            }
            let (graph, [off, turned]) = best?;
            let is_near = off <= tolerance;
            if is_near && turned <= turn {
                return Some(graph);
            }
            // The deciding measure: the distance, or the angle once the distance is small enough.
            let worst = if is_near { turned / turn } else { off };
            let is_first = is_near && near.is_none();
            // Beyond 13 spans the error has to fall to 0.6 of the one before: it falls to a tenth
            // if the surface is smooth, and to a half where its curvature jumps. Before, it may
            // rise: a coarse lattice has few points on a narrow part.
            if spans > 13 && !is_first && worst > 0.6 * last {
                return near;
            }
            last = worst;
            if is_near {
                near = Some(graph);
            }
        }
        // The angle still falls: on a smaller part it gets small enough.
        None
    }

    /// Returns a frame with z along the direction and x along the longest side.
    fn frame(&self) -> Axes {
        let center = self.triangles[0][0];
        let axes = Axes::along(center, self.direction);
        let (mut xx, mut xy, mut yy, mut mean) = (0.0, 0.0, 0.0, [0.0; 2]);
        let count = 3.0 * self.triangles.len() as f64;
        let points = || self.triangles.as_flattened().iter().map(|p| axes.local(*p));
        for [x, y, _] in points() {
            mean[0] += x / count;
            mean[1] += y / count;
        }
        for [x, y, _] in points() {
            let (x, y) = (x - mean[0], y - mean[1]);
            xx += x * x;
            xy += x * y;
            yy += y * y;
        }
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let x = axes.vector([angle.cos(), angle.sin(), 0.0]);
        let middle = axes.point([mean[0], mean[1], 0.0]);
        Axes {
            origin: middle,
            ..axes.turned(x)
        }
    }

    /// Returns the largest distance of the graph from the function, to first order, above samples
    /// of the triangles, and the largest sine between their normals.
    fn worst(&self, graph: &Graph) -> [f64; 2] {
        let shares = [
            [1.0 / 3.0, 1.0 / 3.0],
            [0.5, 0.5],
            [0.0, 0.5],
            [0.5, 0.0],
            [0.02, 0.02],
            [0.96, 0.02],
            [0.02, 0.96],
        ];
        let mut worst = [0.0f64; 2];
        for [a, b, c] in &self.triangles {
            for [s, t] in shares {
                let p: Point3 = std::array::from_fn(|k| (1.0 - s - t) * a[k] + s * b[k] + t * c[k]);
                let [x, y, _] = graph.axes.local(p);
                let jet = self.field.jet(graph.point([x, y]));
                let (length, n) = (norm(jet.g), graph.area_vector([x, y]));
                let off = jet.v.abs() / length;
                let turned = norm(cross(jet.g, n)) / (length * norm(n));
                for (worst, found) in worst.iter_mut().zip([off, turned]) {
                    *worst = if found.is_nan() {
                        f64::INFINITY
                    } else {
                        worst.max(found)
                    };
                }
            }
        }
        worst
    }
}

/// Returns the box of x and of y, with a margin.
fn domain(local: &[[Point3; 3]]) -> [[f64; 2]; 2] {
    let ends = [0, 1].map(|k| {
        let all = local.as_flattened().iter().map(|p| p[k]);
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| {
            [lo.min(v), hi.max(v)]
        })
    });
    let longer = ends.iter().map(|[lo, hi]| hi - lo).fold(0.0, f64::max);
    ends.map(|[lo, hi]| {
        // The bound by the longer side keeps a margin for narrow parts.
        let margin = (0.06 * (hi - lo)).max(0.015 * longer);
        [lo - margin, hi + margin]
    })
}

/// A point of the lattice with its height and slope.
type LatticeHeight = (usize, f64, [f64; 2]);

/// Points of a rectangle at which heights are computed.
struct HeightLattice {
    domain: [[f64; 2]; 2],
    /// Numbers of spans in x and in y.
    spans: [usize; 2],
}

impl HeightLattice {
    /// Returns lattices with spans of about one width in both directions, and, on a narrow part
    /// (sides of at least 4 to 1), also with equal numbers: tubes bend across much more than along.
    fn for_spans(domain: [[f64; 2]; 2], spans: usize) -> Vec<Self> {
        let sides = domain.map(|[lo, hi]| hi - lo);
        let width = sides[0].max(sides[1]) / spans as f64;
        let one_width = sides.map(|side| ((side / width).ceil() as usize).clamp(1, spans));
        let mut all = vec![one_width];
        // A larger ratio would leave out fillets; a smaller one fits many parts twice.
        if one_width[0].min(one_width[1]) * 4 <= spans {
            all.push([spans; 2]);
        }
        all.into_iter()
            .map(|spans| Self { domain, spans })
            .collect()
    }

    fn count(&self, k: usize) -> usize {
        // Three points of the lattice in each span.
        self.spans[k] * 3 + 1
    }

    fn step(&self, k: usize) -> f64 {
        let [lo, hi] = self.domain[k];
        (hi - lo) / (self.count(k) - 1) as f64
    }

    fn at(&self, k: usize, i: usize) -> f64 {
        self.domain[k][0] + self.step(k) * i as f64
    }

    /// Returns the heights above the points; `None` where the surface is not a graph.
    fn heights(&self, field: &dyn Field, axes: &Axes, local: &[[Point3; 3]]) -> Vec<Option<f64>> {
        let [nx, ny] = [0, 1].map(|k| self.count(k));
        let mut heights: Vec<Option<f64>> = vec![None; nx * ny];
        let near = 2.0 * self.step(0).max(self.step(1));
        let mut queue = VecDeque::new();
        let put =
            |n: usize, guess: f64, queue: &mut VecDeque<LatticeHeight>, heights: &mut Vec<_>| {
                let at = [self.at(0, n / ny), self.at(1, n % ny)];
                if let Some((z, slope)) = height(field, axes, at, guess, near) {
                    heights[n] = Some(z);
                    queue.push_back((n, z, slope));
                }
            };
        for corners in local {
            for (n, guess) in self.below(corners) {
                if heights[n].is_none() {
                    put(n, guess, &mut queue, &mut heights);
                }
            }
        }
        if queue.is_empty() {
            // All triangles lie between the points of a coarse lattice: start at the point nearest
            // to a corner.
            let p = local[0][0];
            let i = [0, 1].map(|k| ((p[k] - self.domain[k][0]) / self.step(k)).round() as usize);
            put(i[0] * ny + i[1], p[2], &mut queue, &mut heights);
        }
        while let Some((n, z, slope)) = queue.pop_front() {
            let (i, j) = (n / ny, n % ny);
            let beside = [
                (i > 0).then(|| (n - ny, -slope[0] * self.step(0))),
                (i + 1 < nx).then(|| (n + ny, slope[0] * self.step(0))),
                (j > 0).then(|| (n - 1, -slope[1] * self.step(1))),
                (j + 1 < ny).then(|| (n + 1, slope[1] * self.step(1))),
            ];
            for (m, rise) in beside.into_iter().flatten() {
                if heights[m].is_none() {
                    put(m, z + rise, &mut queue, &mut heights);
                }
            }
        }
        heights
    }

    /// Returns the points below a triangle, with its height there.
    fn below(&self, [a, b, c]: &[Point3; 3]) -> Vec<(usize, f64)> {
        let range = |k: usize| {
            let (lo, hi) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            let to = |v: f64| (v - self.domain[k][0]) / self.step(k);
            to(lo).ceil() as usize..=(to(hi).floor().max(0.0) as usize).min(self.count(k) - 1)
        };
        let area = |p: &[f64], q: &[f64], r: &[f64]| {
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        };
        let whole = area(a, b, c);
        let mut found = Vec::new();
        for i in range(0) {
            for j in range(1) {
                let p = [self.at(0, i), self.at(1, j)];
                let w = [area(&p, b, c), area(a, &p, c), area(a, b, &p)].map(|v| v / whole);
                if w.iter().all(|v| *v >= 0.0) {
                    let z = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
                    found.push((i * self.count(1) + j, z));
                }
            }
        }
        found
    }

    /// Returns the graph by least squares.
    fn least_squares(&self, axes: Axes, heights: &[Option<f64>]) -> Option<Graph> {
        let knots = [0, 1].map(|k| self.knots(k));
        let columns = knots[1].len() - SPLINE_DEGREE - 1;
        let rows = knots[0].len() - SPLINE_DEGREE - 1;
        let (count, band) = (rows * columns, SPLINE_DEGREE * columns + SPLINE_DEGREE);
        let mut matrix = vec![0.0; count * (band + 1)];
        let mut right = vec![0.0; count];
        let bases = [0, 1].map(|k| -> Vec<Basis> {
            let each =
                (0..self.count(k)).map(|i| Basis::at(&knots[k], SPLINE_DEGREE, self.at(k, i)));
            each.collect()
        });
        let ny = self.count(1);
        for (n, z) in heights.iter().enumerate() {
            let Some(z) = z else { continue };
            let (u, v) = (&bases[0][n / ny], &bases[1][n % ny]);
            let mut row = [(0, 0.0); (SPLINE_DEGREE + 1) * (SPLINE_DEGREE + 1)];
            for i in 0..=SPLINE_DEGREE {
                for j in 0..=SPLINE_DEGREE {
                    let column = (u.first + i) * columns + v.first + j;
                    row[i * (SPLINE_DEGREE + 1) + j] = (column, u.values[0][i] * v.values[0][j]);
                }
            }
            add_row(&mut matrix, &mut right, band, &row, *z);
        }
        // Known heights outweigh this weight of the third differences; without it coefficients far
        // from the part would be undetermined. With 1e-7 errors of 1e-9 are twice as large.
        let weight = 1e-9_f64.sqrt();
        let third = [-1.0, 3.0, -3.0, 1.0].map(|c| c * weight);
        for i in 0..rows {
            for j in 0..columns {
                for (stride, fits) in [(columns, i + 3 < rows), (1, j + 3 < columns)] {
                    if fits {
                        let from = i * columns + j;
                        let row = [0, 1, 2, 3].map(|k| (from + k * stride, third[k]));
                        add_row(&mut matrix, &mut right, band, &row, 0.0);
                    }
                }
            }
        }
        banded_solve(&mut matrix, band, &mut right).then_some(Graph {
            axes,
            degree: SPLINE_DEGREE,
            knots,
            heights: right,
        })
    }

    fn knots(&self, k: usize) -> Vec<f64> {
        let [lo, hi] = self.domain[k];
        let inner = (1..self.spans[k]).map(|i| lo + (hi - lo) * i as f64 / self.spans[k] as f64);
        let end = |t: f64| std::iter::repeat_n(t, SPLINE_DEGREE + 1);
        end(lo).chain(inner).chain(end(hi)).collect()
    }
}

/// Adds an equation to banded normal equations: row i of the matrix holds columns i to i + band.
fn add_row(matrix: &mut [f64], right: &mut [f64], band: usize, row: &[(usize, f64)], value: f64) {
    for (n, &(i, a)) in row.iter().enumerate() {
        right[i] += a * value;
        for &(j, b) in &row[n..] {
            matrix[i * (band + 1) + j - i] += a * b;
        }
    }
}

/// Returns the value and the gradient of the function in coordinates of the frame.
fn gradient(field: &dyn Field, axes: &Axes, p: Point3) -> (f64, Point3) {
    let jet = field.jet(axes.point(p));
    (jet.v, [axes.x, axes.y(), axes.z].map(|e| dot(jet.g, e)))
}

/// Returns the slope of the surface of a function with the gradient g.
fn slope(g: Point3) -> [f64; 2] {
    [-g[0] / g[2], -g[1] / g[2]]
}

/// Returns the height above x and y within `near` of a guess, and its slope.
fn height(
    field: &dyn Field,
    axes: &Axes,
    [x, y]: [f64; 2],
    guess: f64,
    near: f64,
) -> Option<(f64, [f64; 2])> {
    let mut z = guess;
    let mut last = f64::INFINITY;
    for _ in 0..12 {
        let (value, g) = gradient(field, axes, [x, y, z]);
        let length = dot(g, g).sqrt();
        // Also false if a value is NaN.
        // The normal has to keep this cosine with z.
        if !(g[2].abs() >= 0.2 * length && length > 0.0) {
            return None;
        }
        let step = value / g[2];
        if step.abs() >= 0.5 * last && step.abs() <= 1e-12 * near {
            return Some((z, slope(g)));
        }
        z -= step;
        if (z - guess).abs() > near || z.is_nan() {
            return None;
        }
        if step == 0.0 {
            return Some((z, slope(g)));
        }
        last = step.abs();
    }
    (last <= 1e-10 * near).then(|| (z, slope(gradient(field, axes, [x, y, z]).1)))
}

/// Returns the axis of the smallest cone that contains some directions, by the iteration of Bădoiu
/// and Clarkson (2003), and the cosine of its half angle.
pub(crate) fn cone(normals: &[Point3]) -> (Point3, f64) {
    let unit = |v: Point3| {
        let length = dot(v, v).sqrt();
        v.map(|v| v / length)
    };
    let mut axis = normals[0];
    for k in 0..100 {
        let far = normals
            .iter()
            .min_by(|a, b| dot(**a, axis).total_cmp(&dot(**b, axis)));
        let far = far.unwrap_or(&axis);
        let share = 1.0 / f64::from(k + 2);
        let moved: Point3 = std::array::from_fn(|i| (1.0 - share) * axis[i] + share * far[i]);
        if dot(moved, moved) < 1e-12 {
            break;
        }
        axis = unit(moved);
    }
    let least = normals.iter().map(|n| dot(*n, axis));
    (axis, least.fold(f64::INFINITY, f64::min))
}

/// Returns the normal of a triangle, as long as twice its area.
pub(crate) fn normal_of([a, b, c]: &[Point3; 3]) -> Point3 {
    cross(sub(*b, *a), sub(*c, *a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::norm;
    use isoform_num::Jet2;

    /// 1 − |p|².
    struct Ball;

    impl Field for Ball {
        fn value(&self, p: Point3) -> f64 {
            1.0 - dot(p, p)
        }
        fn jet(&self, p: Point3) -> Jet2 {
            Jet2 {
                v: self.value(p),
                g: p.map(|v| -2.0 * v),
                h: [-2.0, 0.0, 0.0, -2.0, 0.0, -2.0],
            }
        }
    }

    /// Returns the cap of the unit sphere about `direction` within a square of half width 0.45, as
    /// triangles.
    fn cap(direction: Point3) -> HeightRegion<'static> {
        let axes = Axes::along([0.0; 3], direction);
        let n = 12;
        let at = |i: usize, j: usize| {
            let [x, y] = [i, j].map(|k| 0.9 * k as f64 / n as f64 - 0.45);
            axes.point([x, y, (1.0 - x * x - y * y).sqrt()])
        };
        let squares = (0..n * n).map(|k| (k / n, k % n));
        let triangles = squares.flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        HeightRegion {
            field: &Ball,
            triangles: triangles.collect(),
            direction,
        }
    }

    #[test]
    fn a_cap_of_a_sphere_is_met_to_any_tolerance() {
        let region = cap([0.6, 0.0, 0.8]);
        let spans = |tolerance: f64| {
            let graph = region.fit(tolerance, 1.0).expect("a sphere is smooth");
            for p in region.triangles.as_flattened() {
                let [x, y, _] = graph.axes.local(*p);
                let off = (norm(graph.point([x, y])) - 1.0).abs();
                assert!(off <= tolerance, "{off:e} for {tolerance:e}");
            }
            graph.rows() - SPLINE_DEGREE
        };
        let (coarse, fine) = (spans(1e-5), spans(1e-8));
        // The order is six in the end: a thousandth of the error takes less than five times the
        // spans.
        assert!(coarse < fine && fine < 5 * coarse, "{coarse} {fine}");
    }

    #[test]
    fn the_smallest_cone_has_its_closed_form() {
        let (sin, cos) = 0.7f64.sin_cos();
        let ring = (0..9).map(|k| {
            let (s, c) = f64::from(k).sin_cos();
            [sin * c, sin * s, cos]
        });
        // Many directions on one side do not pull the middle over.
        let more = std::iter::repeat_n([sin, 0.0, cos], 50);
        let (axis, cosine) = cone(&ring.chain(more).collect::<Vec<_>>());
        assert!((axis[2] - 1.0).abs() < 1e-3, "{axis:?}");
        assert!((cosine - cos).abs() < 0.03, "{cosine} {cos}");
    }
}
