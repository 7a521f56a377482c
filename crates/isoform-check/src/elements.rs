//! Shape of the elements: angles, ratios, edge lengths, and the Jacobian of curved tetrahedra.

use super::defects::Lowest;
use super::stars::blocks;
use super::{Defects, Options, Place};
use crate::quality::{OBTUSE_WEIGHT, Shape, cosines, degrees, sines, triangle_cosines};
use isoform_geom::{Mesh, Point3, TET_EDGES, cross, distance_squared, dot, norm, sub};
use rayon::prelude::*;

/// Number of elements in a task.
const ELEMENTS_PER_TASK: usize = 4096;
/// Distance of a mid node from the midpoint of its edge, in lengths of the edge, up to which the
/// edge counts as straight. This only saves time: the Jacobian of a straight tetrahedron is
/// constant, and that of a nearly straight one varies by a share of this order.
const STRAIGHT_EDGE_TOLERANCE: f64 = 1e-12;
/// Samples of the Jacobian: (λ₁, λ₂, λ₃) of the corners, the midpoints of the edges, and the
/// centre.
#[rustfmt::skip]
const JACOBIAN_SAMPLES: [Point3; 11] = [
    [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0],
    [0.5, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5],
    [0.25, 0.25, 0.25],
];

/// Edge lengths; each edge counts once per element that has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lengths {
    /// Shortest edge.
    pub min: f64,
    /// Mean length.
    pub mean: f64,
    /// Longest edge.
    pub max: f64,
}

/// Shape of the triangles of the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleQuality {
    /// Smallest angle, in degrees.
    pub angle_min: f64,
    /// Largest angle, in degrees.
    pub angle_max: f64,
    /// Largest aspect ratio: longest edge × half the perimeter / (2√3 × area); 1 for a regular
    /// triangle.
    pub aspect_max: f64,
    /// Edge lengths.
    pub edges: Lengths,
    /// Triangles with the smallest angles; the value is the angle in degrees.
    pub worst: Vec<Place>,
}

/// Shape of the tetrahedra, with straight edges between their corners.
#[derive(Clone, Debug, PartialEq)]
pub struct TetQuality {
    /// Smallest dihedral angle, in degrees.
    pub dihedral_min: f64,
    /// Largest dihedral angle, in degrees.
    pub dihedral_max: f64,
    /// Number of dihedral angles in each ten degrees: [0, 10), [10, 20), … [170, 180].
    pub histogram: [u64; 18],
    /// Smallest biased minimum sine of the dihedral angles, see [`Shape::biased_minimum_sine`].
    pub biased_sine_min: f64,
    /// Mean of the biased minimum sines.
    pub biased_sine_mean: f64,
    /// Smallest radius ratio 3r/R, see [`Shape::radius_ratio`].
    pub radius_ratio_min: f64,
    /// Mean radius ratio.
    pub radius_ratio_mean: f64,
    /// Largest aspect ratio, see [`Shape::aspect`].
    pub aspect_max: f64,
    /// Mean aspect ratio.
    pub aspect_mean: f64,
    /// Tetrahedra with the largest aspect ratios, which are their values.
    pub worst_aspect: Vec<Place>,
    /// Smallest scaled Jacobian, see [`Shape::scaled_jacobian`].
    pub scaled_jacobian_min: f64,
    /// Mean scaled Jacobian.
    pub scaled_jacobian_mean: f64,
    /// Tetrahedra with the smallest scaled Jacobians, which are their values.
    pub worst_jacobian: Vec<Place>,
    /// Edge lengths.
    pub edges: Lengths,
    /// Tetrahedra with the smallest biased minimum sines; the value is that sine.
    pub worst: Vec<Place>,
}

/// Jacobians of tetrahedra with mid nodes.
///
/// The Jacobian is a cubic polynomial. Scaled values are divided by its largest absolute value at
/// the eleven samples (corners, midpoints of edges, centre).
#[derive(Clone, Debug, PartialEq)]
pub struct CurvedQuality {
    /// Number of tetrahedra with curved edges.
    pub curved: usize,
    /// Smallest scaled Jacobian at the samples.
    pub scaled_jacobian_min: f64,
    /// Tetrahedra with a Jacobian ≤ 0 at a sample; the value is the scaled Jacobian.
    pub negative: Defects,
    /// Tetrahedra that are positive at all samples, but with a coefficient ≤ 0 in the Bernstein
    /// form of the Jacobian, so that they are not proved positive everywhere (Johnen, Remacle and
    /// Geuzaine, 2013, "Geometrical Validity of Curvilinear Finite Elements").
    pub unproved: Defects,
    /// Tetrahedra with the smallest scaled Jacobians, which are their values.
    pub worst: Vec<Place>,
}

/// Minimum, sum and maximum of values.
#[derive(Clone, Copy)]
struct ValueRange {
    min: f64,
    sum: f64,
    max: f64,
}

impl ValueRange {
    /// Range without values.
    const EMPTY: Self = Self {
        min: f64::INFINITY,
        sum: 0.0,
        max: f64::NEG_INFINITY,
    };
    /// Adds a value.
    fn add(&mut self, value: f64) {
        self.min = self.min.min(value);
        self.sum += value;
        self.max = self.max.max(value);
    }
    /// Adds the range of later values.
    fn append(&mut self, later: Self) {
        self.min = self.min.min(later.min);
        self.sum += later.sum;
        self.max = self.max.max(later.max);
    }
}

/// Partial sums over elements, joined in the order of the mesh.
struct ElementSums {
    /// Number of elements.
    elements: usize,
    /// Cosines of angles.
    cosine: ValueRange,
    /// Number of dihedral angles in each ten degrees.
    histogram: [u64; 18],
    /// Biased minimum sines.
    sine: ValueRange,
    /// Radius ratios.
    ratio: ValueRange,
    /// Aspect ratios.
    aspect: ValueRange,
    /// Scaled Jacobians.
    jacobian: ValueRange,
    /// Edge lengths.
    edge: ValueRange,
    /// Elements with the lowest values.
    worst: Lowest,
    /// Elements with the largest aspect ratios, by their negatives.
    worst_aspect: Lowest,
    /// Elements with the lowest scaled Jacobians.
    worst_jacobian: Lowest,
}

impl ElementSums {
    /// Returns the sums over zero elements.
    fn new() -> Self {
        Self {
            elements: 0,
            cosine: ValueRange::EMPTY,
            histogram: [0; 18],
            sine: ValueRange::EMPTY,
            ratio: ValueRange::EMPTY,
            aspect: ValueRange::EMPTY,
            jacobian: ValueRange::EMPTY,
            edge: ValueRange::EMPTY,
            worst: Lowest::default(),
            worst_aspect: Lowest::default(),
            worst_jacobian: Lowest::default(),
        }
    }
    /// Adds the sums over later elements.
    fn append(&mut self, room: usize, later: Self) {
        let Self {
            elements,
            cosine,
            histogram,
            sine,
            ratio,
            aspect,
            jacobian,
            edge,
            worst,
            worst_aspect,
            worst_jacobian,
        } = later;
        self.elements += elements;
        for (a, b) in self.histogram.iter_mut().zip(histogram) {
            *a += b;
        }
        self.cosine.append(cosine);
        self.sine.append(sine);
        self.ratio.append(ratio);
        self.aspect.append(aspect);
        self.jacobian.append(jacobian);
        self.edge.append(edge);
        self.worst.append(room, worst);
        self.worst_aspect.append(room, worst_aspect);
        self.worst_jacobian.append(room, worst_jacobian);
    }
    /// Returns the edge lengths of elements with `edges` edges each.
    fn lengths(&self, edges: usize) -> Lengths {
        Lengths {
            min: self.edge.min,
            mean: self.edge.sum / (edges * self.elements).max(1) as f64,
            max: self.edge.max,
        }
    }
}

/// Sums `one` over `n` elements, in parallel.
fn sums(n: usize, room: usize, one: impl Fn(&mut ElementSums, usize) + Sync) -> ElementSums {
    let parts: Vec<ElementSums> = blocks(n, ELEMENTS_PER_TASK)
        .into_par_iter()
        .map(|range| {
            let mut part = ElementSums {
                elements: range.len(),
                ..ElementSums::new()
            };
            range.for_each(|k| one(&mut part, k));
            part
        })
        .collect();
    let mut all = ElementSums::new();
    parts.into_iter().for_each(|part| all.append(room, part));
    all
}

/// Returns the mean of points.
fn middle<const N: usize>(p: [Point3; N]) -> Point3 {
    std::array::from_fn(|i| p.iter().map(|p| p[i]).sum::<f64>() / N as f64)
}

/// Returns the places of the worst elements; `value` converts the sorting key into the reported
/// value.
fn places<const N: usize>(
    worst: &Lowest,
    points: &[Point3],
    elements: &[[u32; N]],
    value: impl Fn(f64) -> f64,
) -> Vec<Place> {
    let place = |&(v, k): &(f64, u32)| {
        let t = elements[k as usize];
        Place {
            at: middle(t.map(|i| points[i as usize])),
            nodes: t.to_vec(),
            elements: vec![k],
            value: value(v),
        }
    };
    worst.items.iter().map(place).collect()
}

/// Returns the lengths of the edges of a triangle.
#[inline]
fn edge_lengths(p: [Point3; 3]) -> [f64; 3] {
    [
        norm(sub(p[1], p[0])),
        norm(sub(p[2], p[1])),
        norm(sub(p[0], p[2])),
    ]
}

impl ElementSums {
    /// Adds the shape of a triangle.
    fn add_triangle(&mut self, room: usize, k: u32, p: [Point3; 3]) {
        let c = triangle_cosines(p);
        let (high, low) = (c[0].max(c[1]).max(c[2]), c[0].min(c[1]).min(c[2]));
        self.cosine.add(high);
        self.cosine.add(low);
        let e = edge_lengths(p);
        let longest = e[0].max(e[1]).max(e[2]);
        let perimeter = e[0] + e[1] + e[2];
        let area2 = norm(cross(sub(p[1], p[0]), sub(p[2], p[0])));
        let sum = self.edge.sum + perimeter;
        e.into_iter().for_each(|e| self.edge.add(e));
        self.edge.sum = sum;
        let aspect = longest * perimeter / (2.0 * 3f64.sqrt() * area2.max(f64::MIN_POSITIVE));
        self.aspect.add(aspect);
        self.worst.add(room, -high, k);
    }

    /// Adds the shape of a tetrahedron; `bounds` are the limits of the histogram's bins, as
    /// cosines.
    fn add_tetrahedron(&mut self, room: usize, k: u32, shape: &Shape, bounds: &[f64; 17]) {
        let (cosines, sines) = (cosines(shape), sines(shape));
        let mut worst = f64::INFINITY;
        for (c, sine) in cosines.into_iter().zip(sines) {
            self.cosine.add(c);
            self.histogram[bounds.iter().map(|&b| usize::from(c <= b)).sum::<usize>()] += 1;
            worst = worst.min(sine * if c < 0.0 { OBTUSE_WEIGHT } else { 1.0 });
        }
        self.sine.add(worst);
        let ratio = shape.radius_ratio();
        self.ratio.add(ratio);
        let aspect = shape.aspect();
        self.aspect.add(aspect);
        self.worst_aspect.add(room, -aspect, k);
        let jacobian = shape.scaled_jacobian();
        self.jacobian.add(jacobian);
        self.worst_jacobian.add(room, jacobian, k);
        for e in shape.edges {
            self.edge.add(e);
        }
        self.worst.add(room, worst, k);
    }
}

/// Measures the shape of the triangles; `None` without triangles.
pub(super) fn triangles(
    points: &[Point3],
    triangles: &[[u32; 3]],
    options: &Options<'_>,
) -> Option<TriangleQuality> {
    let room = options.places;
    let all = sums(triangles.len(), room, |s, k| {
        s.add_triangle(room, k as u32, triangles[k].map(|i| points[i as usize]));
    });
    (all.elements > 0).then(|| TriangleQuality {
        angle_min: degrees(all.cosine.max),
        angle_max: degrees(all.cosine.min),
        aspect_max: all.aspect.max,
        edges: all.lengths(3),
        worst: places(&all.worst, points, triangles, |v| degrees(-v)),
    })
}

/// Measures the shape of the tetrahedra; `None` without tetrahedra.
pub(super) fn tets(
    points: &[Point3],
    tets: &[[u32; 4]],
    options: &Options<'_>,
) -> Option<TetQuality> {
    let room = options.places;
    let bounds: [f64; 17] = std::array::from_fn(|k| (10.0 * (k + 1) as f64).to_radians().cos());
    let all = sums(tets.len(), room, |s, k| {
        let shape = Shape::new(tets[k].map(|i| points[i as usize]));
        s.add_tetrahedron(room, k as u32, &shape, &bounds);
    });
    let mean = |sum: f64| sum / all.elements as f64;
    (all.elements > 0).then(|| TetQuality {
        dihedral_min: degrees(all.cosine.max),
        dihedral_max: degrees(all.cosine.min),
        histogram: all.histogram,
        biased_sine_min: all.sine.min,
        biased_sine_mean: mean(all.sine.sum),
        radius_ratio_min: all.ratio.min,
        radius_ratio_mean: mean(all.ratio.sum),
        aspect_max: all.aspect.max,
        aspect_mean: mean(all.aspect.sum),
        worst_aspect: places(&all.worst_aspect, points, tets, |v| -v),
        scaled_jacobian_min: all.jacobian.min,
        scaled_jacobian_mean: mean(all.jacobian.sum),
        worst_jacobian: places(&all.worst_jacobian, points, tets, |v| v),
        edges: all.lengths(6),
        worst: places(&all.worst, points, tets, |v| v),
    })
}

/// Returns the columns of the Jacobian matrix at the four corners, between which they are linear.
///
/// With X = Σ λᵢ(2λᵢ − 1)Pᵢ + 4 Σ λₐλᵦMₐᵦ, the derivative by λᵢ at corner c is 3P꜀ for i = c and
/// 4Mᵢ꜀ − Pᵢ otherwise; the columns are its differences from the derivative by λ₀.
fn columns(p: [Point3; 4], m: [Point3; 6]) -> [[Point3; 3]; 4] {
    let o = p[0];
    let (p, m) = (p.map(|x| sub(x, o)), m.map(|x| sub(x, o)));
    let mut g = [[[0.0; 3]; 4]; 4];
    for c in 0..4 {
        g[c][c] = p[c].map(|v| 3.0 * v);
    }
    for ([a, b], m) in TET_EDGES.into_iter().zip(m) {
        g[a][b] = std::array::from_fn(|i| 4.0 * m[i] - p[b][i]);
        g[b][a] = std::array::from_fn(|i| 4.0 * m[i] - p[a][i]);
    }
    g.map(|g| [1, 2, 3].map(|k| sub(g[k], g[0])))
}

/// Returns the determinant of three columns.
fn determinant([a, b, c]: [Point3; 3]) -> f64 {
    dot(a, cross(b, c))
}

/// Returns the minimum and the largest absolute value of the Jacobian at the samples.
fn sampled(columns: &[[Point3; 3]; 4]) -> (f64, f64) {
    let (mut least, mut size) = (f64::INFINITY, 0.0f64);
    for [r, s, t] in JACOBIAN_SAMPLES {
        let l = [1.0 - r - s - t, r, s, t];
        let j = determinant(
            [0, 1, 2]
                .map(|k| std::array::from_fn(|i| (0..4).map(|c| l[c] * columns[c][k][i]).sum())),
        );
        (least, size) = (least.min(j), size.max(j.abs()));
    }
    (least, size)
}

/// Returns the smallest Bernstein coefficient of the Jacobian. Since det Σ λ… is trilinear in the
/// corners of its columns, each coefficient is the mean of the determinants over the orders of its
/// three corners.
fn bernstein_min(columns: &[[Point3; 3]; 4]) -> f64 {
    let det =
        |i: usize, j: usize, k: usize| determinant([columns[i][0], columns[j][1], columns[k][2]]);
    let mut least = f64::INFINITY;
    for i in 0..4 {
        for j in i..4 {
            for k in j..4 {
                let sum = det(i, j, k)
                    + det(i, k, j)
                    + det(j, i, k)
                    + det(j, k, i)
                    + det(k, i, j)
                    + det(k, j, i);
                least = least.min(sum / 6.0);
            }
        }
    }
    least
}

/// Measures the Jacobians of tetrahedra with mid nodes; `None` if the mesh has none.
pub(super) fn curved(mesh: &Mesh, options: &Options<'_>) -> Option<CurvedQuality> {
    let room = options.places;
    if mesh.tet_mids.is_empty() {
        return None;
    }
    let parts: Vec<(CurvedQuality, Lowest)> = blocks(mesh.tets.len(), ELEMENTS_PER_TASK)
        .into_par_iter()
        .map(|range| {
            let (mut part, mut worst) = (CurvedQuality::none(), Lowest::default());
            range.for_each(|k| part.add(mesh, k, room, &mut worst));
            (part, worst)
        })
        .collect();
    if parts.is_empty() {
        return None;
    }
    let (mut all, mut worst) = (CurvedQuality::none(), Lowest::default());
    for (part, low) in parts {
        worst.append(room, low);
        all.append(room, part);
    }
    all.worst = places(&worst, &mesh.points, &mesh.tets, |v| v);
    Some(all)
}

/// Returns true if all mid nodes are the midpoints of their edges.
fn is_straight(p: [Point3; 4], m: [Point3; 6]) -> bool {
    TET_EDGES.iter().zip(m).all(|(&[a, b], m)| {
        distance_squared(middle([p[a], p[b]]), m)
            <= STRAIGHT_EDGE_TOLERANCE * STRAIGHT_EDGE_TOLERANCE * distance_squared(p[a], p[b])
    })
}

impl CurvedQuality {
    /// Adds the counts and defects of later tetrahedra.
    fn append(&mut self, room: usize, later: Self) {
        self.curved += later.curved;
        self.scaled_jacobian_min = self.scaled_jacobian_min.min(later.scaled_jacobian_min);
        self.negative.append(room, later.negative);
        self.unproved.append(room, later.unproved);
    }

    /// Returns the quality of an empty set of tetrahedra.
    fn none() -> Self {
        Self {
            curved: 0,
            scaled_jacobian_min: 1.0,
            negative: Defects::default(),
            unproved: Defects::default(),
            worst: Vec::new(),
        }
    }

    /// Adds a tetrahedron, unless it is straight and positive.
    fn add(&mut self, mesh: &Mesh, k: usize, room: usize, worst: &mut Lowest) {
        let t = mesh.tets[k];
        let p = t.map(|i| mesh.points[i as usize]);
        let m = mesh.tet_mids[k].map(|i| mesh.points[i as usize]);
        if is_straight(p, m) && crate::quality::six_volume(p) > 0.0 {
            return;
        }
        self.curved += 1;
        let columns = columns(p, m);
        let (least, size) = sampled(&columns);
        let scaled = if size > 0.0 { least / size } else { 0.0 };
        self.scaled_jacobian_min = self.scaled_jacobian_min.min(scaled);
        worst.add(room, scaled, k as u32);
        let place = || Place {
            at: middle(p),
            nodes: t.to_vec(),
            elements: vec![k as u32],
            value: scaled,
        };
        if scaled.is_nan() || scaled <= 0.0 {
            self.negative.add(room, place);
        } else if bernstein_min(&columns) <= 0.0 {
            self.unproved.add(room, place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: [Point3; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];

    fn mids(p: [Point3; 4]) -> [Point3; 6] {
        TET_EDGES.map(|[a, b]| middle([p[a], p[b]]))
    }

    /// With the mid node of edge 0–1 moved by (d, 0, 0), X = x + 4 λ₀λ₁ d and J = 1 + 4 d (1 − 2r −
    /// s − t): linear, with the values
    /// 1 + 4d, 1 − 4d, 1, 1 at the corners.
    #[test]
    fn jacobian_of_a_tetrahedron_with_one_node_moved() {
        for d in [0.0, 0.1, 0.2, 0.25, 0.3] {
            let mut m = mids(CORNER);
            m[0][0] += d;
            let c = columns(CORNER, m);
            let (least, size) = sampled(&c);
            assert!(
                (least - (1.0 - 4.0 * d)).abs() < 1e-14 && (size - (1.0 + 4.0 * d)).abs() < 1e-14,
                "{least} {size}"
            );
            assert!((bernstein_min(&c) - (1.0 - 4.0 * d)).abs() < 1e-14);
        }
    }

    /// The Bernstein coefficients are a lower bound, and tend to the values: exact at the corners.
    #[test]
    fn bernstein_form_bounds_the_jacobian() {
        let mut seed = 7u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as f64 / (1u64 << 24) as f64 - 0.5
        };
        for _ in 0..200 {
            let m = mids(CORNER).map(|m| m.map(|v| v + 0.4 * next()));
            let c = columns(CORNER, m);
            let bound = bernstein_min(&c);
            let mut least = f64::INFINITY;
            for _ in 0..100 {
                let mut l = [next() + 0.5, next() + 0.5, next() + 0.5, next() + 0.5];
                let sum: f64 = l.iter().sum();
                l = l.map(|v| v / sum);
                let at =
                    |k: usize| std::array::from_fn(|i| (0..4).map(|q| l[q] * c[q][k][i]).sum());
                least = least.min(determinant([at(0), at(1), at(2)]));
            }
            assert!(bound <= least + 1e-12 && bound <= sampled(&c).0 + 1e-12);
        }
    }

    #[test]
    fn shape_of_two_tetrahedra() {
        let mut points = CORNER.to_vec();
        points.push([1.0, 1.0, 1.0]);
        let q = tets(&points, &[[0, 1, 2, 3], [1, 2, 3, 4]], &Options::default()).expect("two");
        // The second one is regular, with edges √2; the first has angles of 90° and 54.7°.
        assert_eq!(q.histogram.iter().sum::<u64>(), 12);
        assert_eq!(
            (
                q.histogram[5],
                q.histogram[7],
                q.histogram[8] + q.histogram[9]
            ),
            (3, 6, 3)
        );
        assert!(
            (q.dihedral_max - 90.0).abs() < 1e-12
                && (q.dihedral_min - 54.735_610_317_245_34).abs() < 1e-12
        );
        assert!(
            (q.edges.max - 2f64.sqrt()).abs() < 1e-15
                && q.edges.min == 1.0
                && q.worst[0].elements == [0]
        );
        assert!((q.edges.mean - (3.0 + 9.0 * 2f64.sqrt()) / 12.0).abs() < 1e-15);
        // In the corner of a cube r = (3 − √3)/6 and the longest edge is √2.
        let aspect = 2f64.sqrt() / (2.0 * 6f64.sqrt() * (3.0 - 3f64.sqrt()) / 6.0);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(q.aspect_max, aspect) && near(q.aspect_mean, 0.5 * (1.0 + aspect)));
        assert!(q.worst_aspect[0].elements == [0] && near(q.worst_aspect[0].value, aspect));
        assert!(near(q.scaled_jacobian_min, 0.5f64.sqrt()));
        assert!(q.worst_jacobian[0].elements == [0] && q.worst_jacobian[1].elements == [1]);
        assert!(tets(&points, &[], &Options::default()).is_none());
    }

    #[test]
    fn shape_of_a_triangle() {
        let points = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 3f64.sqrt(), 0.0]];
        let q = triangles(&points, &[[0, 1, 2]], &Options::default()).expect("one");
        assert!(
            (q.angle_min - 60.0).abs() < 1e-12
                && (q.angle_max - 60.0).abs() < 1e-12
                && (q.aspect_max - 1.0).abs() < 1e-12
        );
        assert!((q.edges.mean - 2.0).abs() < 1e-15 && q.worst[0].nodes == [0, 1, 2]);
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 3f64.sqrt(), 0.0]];
        let q = triangles(&points, &[[0, 1, 2]], &Options::default()).expect("one");
        assert!(
            (q.angle_min - 30.0).abs() < 1e-12
                && (q.angle_max - 90.0).abs() < 1e-12
                && (q.worst[0].value - 30.0).abs() < 1e-12
        );
    }
}
