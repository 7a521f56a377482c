//! Samples of a zero set given by its values alone: nodes of a grid near it are projected by Newton
//! steps along the gradient, and thinned to one per cell and sheet.

use isoform_geom::{Aabb, ParamField, Point3, distance_squared, dot};
use std::ops::Range;

/// Margin of the sampled box on every side of the data's, as a share of the diagonal: enough to
/// detect surface beyond the data.
pub(super) const BOX_MARGIN_SHARE: f64 = 0.08;
/// Maximum number of surface samples: up to it the cells have distinct keys and fit into memory.
pub const MAX_SURFACE_SAMPLES: usize = 2_000_000;

/// Returns near-uniform points of the zero set of a field that is close to a distance, in a box
/// somewhat larger than `region`; about `wanted` of them, at most [`MAX_SURFACE_SAMPLES`], if the
/// area of the surface is that of the box.
///
/// ```
/// use isoform_fit::surface_samples;
/// use isoform_geom::{Aabb, ParamField, Point3, norm};
///
/// /// a[0] − |p|: a ball about the origin.
/// struct Ball;
/// impl ParamField for Ball {
///     fn dim(&self) -> usize {
///         1
///     }
///     fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
///         points.iter().zip(out).for_each(|(p, f)| *f = a[0] - norm(*p));
///     }
///     fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
///         self.values(points, a, out);
///         jac.fill(1.0);
///     }
///     fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], g: &mut [Point3]) {
///         self.values(points, a, out);
///         points.iter().zip(g).for_each(|(p, g)| *g = p.map(|v| -v / norm(*p)));
///     }
/// }
///
/// let region = Aabb { lo: [-1.0; 3], hi: [1.0; 3] };
/// let points = surface_samples(&Ball, &[1.0], region, 2000);
/// assert!(points.iter().all(|p| (norm(*p) - 1.0).abs() < 1e-9));
/// // The enlarged box has sides of 2.55, the ball less than a third of its surface.
/// assert!(points.len() > 400 && points.len() < 2000);
/// ```
pub fn surface_samples(
    field: &dyn ParamField,
    a: &[f64],
    region: Aabb,
    wanted: usize,
) -> Vec<Point3> {
    match SampleGrid::around(region, wanted.min(MAX_SURFACE_SAMPLES)) {
        Some(grid) => grid.samples(field, a),
        None => Vec::new(),
    }
}

/// Cells of a box that is somewhat larger than a region.
struct SampleGrid {
    lo: Point3,
    hi: Point3,
    size: Point3,
    /// Approximate edge length of a cell.
    cell: f64,
    counts: [usize; 3],
}

impl SampleGrid {
    /// Makes a grid in which the surface of the box itself meets `wanted` cells; `None` for an
    /// empty box.
    fn around(region: Aabb, wanted: usize) -> Option<Self> {
        let margin = BOX_MARGIN_SHARE * region.diagonal();
        if !(margin > 0.0 && margin.is_finite()) || wanted == 0 {
            return None;
        }
        let lo = region.lo.map(|v| v - margin);
        let size: Point3 = std::array::from_fn(|i| region.hi[i] - region.lo[i] + 2.0 * margin);
        let area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
        let cell = (area / wanted as f64).sqrt();
        Some(Self {
            lo,
            hi: std::array::from_fn(|i| lo[i] + size[i]),
            size,
            cell,
            counts: size.map(|s| ((s / cell).ceil() as usize).max(2)),
        })
    }

    fn samples(&self, field: &dyn ParamField, a: &[f64]) -> Vec<Point3> {
        let start = self.nodes_near(field, a);
        let mut points = start.clone();
        descend(field, a, &mut points);
        let mut f = vec![0.0; points.len()];
        field.values(&points, a, &mut f);
        let all = points.iter().zip(&start).zip(&f);
        // On the surface to one per cent of a cell.
        let good = all.filter(|((p, s), f)| f.abs() < 1e-2 * self.cell && self.is_near(p, s));
        self.thinned(good.map(|((p, _), _)| (self.key(p), *p)).collect())
    }

    /// Returns the centres of the cells near the surface.
    fn nodes_near(&self, field: &dyn ParamField, a: &[f64]) -> Vec<Point3> {
        let [across, along, layers] = self.counts;
        // About a million centres at a time bound the memory.
        let step = ((1 << 20) / (across * along)).max(1);
        let mut near = Vec::new();
        let mut f = Vec::new();
        for first in (0..layers).step_by(step) {
            let nodes = self.nodes(first..layers.min(first + step));
            f.resize(nodes.len(), 0.0);
            field.values(&nodes, a, &mut f);
            let is_near = nodes.iter().zip(&f);
            // Half of a cell's diagonal: every cell that the surface crosses is found.
            let is_near = is_near.filter(|(_, f)| f.abs() < 0.87 * self.cell);
            near.extend(is_near.map(|(p, _)| *p));
        }
        near
    }

    /// Returns the centres of the cells of some layers.
    fn nodes(&self, layers: Range<usize>) -> Vec<Point3> {
        let [across, along, _] = self.counts;
        let mut nodes = Vec::with_capacity(across * along * layers.len());
        for k in layers {
            for j in 0..along {
                for i in 0..across {
                    nodes.push(self.node([i, j, k]));
                }
            }
        }
        nodes
    }

    fn node(&self, at: [usize; 3]) -> Point3 {
        std::array::from_fn(|i| {
            self.lo[i] + self.size[i] * (at[i] as f64 + 0.5) / self.counts[i] as f64
        })
    }

    /// Returns true if a point is in the box and not too far from its node to belong to another
    /// one.
    fn is_near(&self, p: &Point3, node: &Point3) -> bool {
        distance_squared(*p, *node).sqrt() < 1.8 * self.cell
            && (0..3).all(|i| p[i] >= self.lo[i] && p[i] <= self.hi[i])
    }

    /// Returns a key of the cell that a point is in, distinct for up to 2²² cells along each axis.
    fn key(&self, p: &Point3) -> u64 {
        let along = |i: usize| ((p[i] - self.lo[i]) / self.cell) as u64;
        (0..3).fold(0, |key, i| key * (1 << 22) + along(i))
    }

    /// Keeps one point of each cell and sheet: a cell may hold the two sheets of a thin wall, which
    /// are at least half a cell apart.
    fn thinned(&self, mut keyed: Vec<(u64, Point3)>) -> Vec<Point3> {
        keyed.sort_by(|a, b| {
            a.0.cmp(&b.0)
                .then(a.1[0].total_cmp(&b.1[0]))
                .then(a.1[1].total_cmp(&b.1[1]))
                .then(a.1[2].total_cmp(&b.1[2]))
        });
        let apart = 0.5 * 0.5 * self.cell * self.cell;
        let mut kept: Vec<(u64, Point3)> = Vec::with_capacity(keyed.len());
        for (key, p) in keyed {
            let mut of_cell = kept.iter().rev().take_while(|k| k.0 == key);
            if !of_cell.any(|k| distance_squared(k.1, p) < apart) {
                kept.push((key, p));
            }
        }
        kept.into_iter().map(|k| k.1).collect()
    }
}

/// Projects points to the zero set by four Newton steps.
fn descend(field: &dyn ParamField, a: &[f64], points: &mut [Point3]) {
    let mut f = vec![0.0; points.len()];
    let mut g = vec![[0.0; 3]; points.len()];
    for _ in 0..4 {
        field.gradients(points, a, &mut f, &mut g);
        for ((p, f), g) in points.iter_mut().zip(&f).zip(&g) {
            newton_step(p, *f, *g);
        }
    }
}

/// Replaces p by p − f g / |g|².
pub(crate) fn newton_step(p: &mut Point3, f: f64, g: Point3) {
    let gg = dot(g, g);
    if gg > 0.0 && gg.is_finite() {
        for i in 0..3 {
            p[i] -= f * g[i] / gg;
        }
    }
}
