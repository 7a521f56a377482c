//! Deviation in both directions: of the data from the model, and of the model's surface from the
//! data.
//!
//! A small residual of the data says nothing about surface that no data support: a template may run
//! away from its scan and still pass through all points. So the model's own surface is sampled
//! inside a box somewhat larger than the data's: nodes of a grid near the zero set are drawn to it
//! by Newton steps along the gradient, thinned to one per cell, and each is asked for its nearest
//! datum.

use crate::Template;
use crate::outliers::{Neighbourhood, median};
use isoform_geom::{Aabb, KdTree, ParamField, Point3, dot};

/// The box is larger than the data's by this share of its diagonal on every side: enough to see
/// surface leave.
const MARGIN: f64 = 0.08;
/// Uncovered is a sample farther than this many spacings of the data there from all data. Where
/// points are spread at random, one place in 10⁷ is farther than 2.
const SPACINGS: f64 = 2.5;
/// Of the samples of the surface: any number does.
const SEED: u64 = 51;
/// And by more than this many deviations of the noise, which in dense scans exceeds the spacing.
const NOISES: f64 = 4.0;
/// Newton steps towards the surface.
const STEPS: usize = 4;

/// Distances of the used data from the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DataToModel {
    /// Root of the mean square.
    pub rms: f64,
    /// 95 % are nearer.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

/// Distances of the model's surface from the data.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModelToData {
    /// 95 % of the samples are nearer to a datum.
    pub p95: f64,
    /// Share of the samples that no data support.
    pub share_uncovered: f64,
    /// Distance from which a sample counts as such.
    pub uncovered_from: f64,
    /// Samples of the surface.
    pub samples: usize,
    /// Share of the samples outside the data's own box (by more than the noise): large where the
    /// model runs away.
    pub share_outside: f64,
}

/// Samples of the surface with the distance to the nearest datum.
pub(crate) struct Surface {
    pub(crate) points: Vec<Point3>,
    /// Part of the model by sample.
    pub(crate) parts: Vec<u32>,
    /// Unit inward normals; empty where the template has no foot points.
    pub(crate) inward: Vec<Point3>,
    /// Whether no data are near, by sample.
    pub(crate) bare: Vec<bool>,
    pub(crate) summary: ModelToData,
}

/// Distances as the residuals say, over the points whose flag in `left_out` is not set.
pub(crate) fn data_to_model(residuals: &[f64], left_out: &[bool]) -> DataToModel {
    let mut d: Vec<f64> = residuals
        .iter()
        .zip(left_out)
        .filter(|(r, out)| !**out && r.is_finite())
        .map(|(r, _)| r.abs())
        .collect();
    if d.is_empty() {
        return DataToModel::default();
    }
    let rms = (d.iter().map(|v| v * v).sum::<f64>() / d.len() as f64).sqrt();
    let at = percentile_index(d.len());
    let p95 = *d.select_nth_unstable_by(at, f64::total_cmp).1;
    DataToModel {
        rms,
        p95,
        max: d.iter().copied().fold(0.0, f64::max),
    }
}

fn percentile_index(n: usize) -> usize {
    ((0.95 * n as f64).ceil() as usize).clamp(1, n) - 1
}

/// What the surface is measured against.
pub(crate) struct Data<'a> {
    pub(crate) bounds: Aabb,
    pub(crate) near: &'a Neighbourhood,
    pub(crate) noise: f64,
}

/// Samples the surface of the template in a box larger than the data's and measures it against the
/// data.
pub(crate) fn model_to_data(
    template: &dyn Template,
    a: &[f64],
    data: &Data<'_>,
    samples: usize,
) -> Surface {
    let (points, parts, inward) = surface_of(template, a, data, samples);
    let from = (SPACINGS * data.near.spacing).max(NOISES * data.noise);
    let mut distances = Vec::with_capacity(points.len());
    let mut bare = Vec::with_capacity(points.len());
    let mut found = Vec::new();
    for p in &points {
        let Some((at, squared)) = data.near.tree.nearest(*p) else {
            distances.push(f64::INFINITY);
            bare.push(true);
            continue;
        };
        let d = squared.sqrt();
        distances.push(d);
        // Where data are sparse everywhere, more distance is no sign of a gap.
        bare.push(d > from && d > SPACINGS * data.near.spacing_at(at, &mut found));
    }
    let mut summary = ModelToData {
        samples: points.len(),
        uncovered_from: from,
        ..ModelToData::default()
    };
    if !points.is_empty() {
        let n = points.len() as f64;
        let mut d = distances.clone();
        let at = percentile_index(d.len());
        summary.p95 = *d.select_nth_unstable_by(at, f64::total_cmp).1;
        summary.share_uncovered = bare.iter().filter(|b| **b).count() as f64 / n;
        let (lo, hi) = (data.bounds.lo, data.bounds.hi);
        let is_outside = |p: &&Point3| (0..3).any(|i| p[i] < lo[i] - from || p[i] > hi[i] + from);
        summary.share_outside = points.iter().filter(is_outside).count() as f64 / n;
    }
    Surface {
        points,
        parts,
        inward,
        bare,
        summary,
    }
}

/// Places of the surface in a box larger than the data's, with the part that each is on and the
/// inward normal.
fn surface_of(
    template: &dyn Template,
    a: &[f64],
    data: &Data<'_>,
    wanted: usize,
) -> (Vec<Point3>, Vec<u32>, Vec<Point3>) {
    let Some(distance) = template.distance() else {
        let points = sample(template.metric(), a, data.bounds, wanted).0;
        let mut parts = vec![0; points.len()];
        template.parts(&points, a, &mut parts);
        return (points, parts, Vec::new());
    };
    // In the model's own frame, so that the places are alike in all poses.
    let frame = template.frame(a);
    let (lo, hi) = (data.bounds.lo, data.bounds.hi);
    let is_in = |p: &&Point3| (0..3).all(|i| (lo[i]..=hi[i]).contains(&p[i]));
    let trusted = data.near.sampled().iter().filter(is_in);
    let within = trusted.map(|p| frame.within(*p));
    let mut region = Aabb::of(&within.collect::<Vec<_>>());
    let margin = MARGIN * region.diagonal();
    for i in 0..3 {
        region.lo[i] -= margin;
        region.hi[i] += margin;
    }
    let places = distance.area_samples(a, &frame, region, wanted, SEED);
    (
        places.iter().map(|f| f.at).collect(),
        places.iter().map(|f| f.pieces[0]).collect(),
        places.iter().map(|f| f.inward).collect(),
    )
}

/// Near-uniform points of the zero set of a field that is close to a distance, in a box somewhat
/// larger than `region`; about `wanted` of them if the surface is like that of the box.
pub fn surface_samples(
    field: &dyn ParamField,
    a: &[f64],
    region: Aabb,
    wanted: usize,
) -> Vec<Point3> {
    sample(field, a, region, wanted).0
}

/// Near-uniform samples of the zero set in the enlarged box, about as many as asked for, and the
/// size of the cells they come from.
fn sample(field: &dyn ParamField, a: &[f64], data: Aabb, wanted: usize) -> (Vec<Point3>, f64) {
    let margin = MARGIN * data.diagonal();
    if !(margin > 0.0 && margin.is_finite()) || wanted == 0 {
        return (Vec::new(), 0.0);
    }
    let lo: Point3 = std::array::from_fn(|i| data.lo[i] - margin);
    let size: Point3 = std::array::from_fn(|i| data.hi[i] - data.lo[i] + 2.0 * margin);
    // A surface like that of the box itself has as many cells as wanted.
    let area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
    let cell = (area / wanted as f64).sqrt();
    let counts: [usize; 3] = std::array::from_fn(|i| ((size[i] / cell).ceil() as usize).max(2));
    let mut nodes = Vec::with_capacity(counts.iter().product());
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                nodes.push([(i, 0), (j, 1), (k, 2)].map(|(at, axis)| {
                    lo[axis] + size[axis] * (at as f64 + 0.5) / counts[axis] as f64
                }));
            }
        }
    }
    let mut f = vec![0.0; nodes.len()];
    field.values(&nodes, a, &mut f);
    // Half a cell's diagonal: every surface cell has a node that near.
    let mut points: Vec<Point3> = nodes
        .iter()
        .zip(&f)
        .filter(|(_, f)| f.abs() < 0.87 * cell)
        .map(|(p, _)| *p)
        .collect();
    let start = points.clone();
    let mut f = vec![0.0; points.len()];
    let mut g = vec![[0.0; 3]; points.len()];
    for _ in 0..STEPS {
        field.gradients(&points, a, &mut f, &mut g);
        for ((p, f), g) in points.iter_mut().zip(&f).zip(&g) {
            let gg = dot(*g, *g);
            if gg > 0.0 && gg.is_finite() {
                for i in 0..3 {
                    p[i] -= f * g[i] / gg;
                }
            }
        }
    }
    field.values(&points, a, &mut f);
    let hi: Point3 = std::array::from_fn(|i| lo[i] + size[i]);
    let mut keyed: Vec<(u64, Point3)> = Vec::with_capacity(points.len());
    for ((p, s), f) in points.iter().zip(&start).zip(&f) {
        let moved = isoform_geom::distance_squared(*p, *s).sqrt();
        let is_inside = (0..3).all(|i| p[i] >= lo[i] && p[i] <= hi[i]);
        if f.abs() < 1e-2 * cell && moved < 1.8 * cell && is_inside {
            let key = (0..3).fold(0_u64, |key, i| {
                key * 4_194_304 + ((p[i] - lo[i]) / cell) as u64
            });
            keyed.push((key, *p));
        }
    }
    keyed.sort_by(|a, b| {
        a.0.cmp(&b.0)
            .then(a.1[0].total_cmp(&b.1[0]))
            .then(a.1[1].total_cmp(&b.1[1]))
            .then(a.1[2].total_cmp(&b.1[2]))
    });
    // A cell may hold two sheets (a thin wall): those count twice, points of one sheet once.
    let mut kept: Vec<(u64, Point3)> = Vec::with_capacity(keyed.len());
    for (key, p) in keyed {
        let near = kept
            .iter()
            .rev()
            .take_while(|k| k.0 == key)
            .any(|k| isoform_geom::distance_squared(k.1, p) < 0.25 * cell * cell);
        if !near {
            kept.push((key, p));
        }
    }
    (kept.into_iter().map(|k| k.1).collect(), cell)
}

/// Correlation of the residuals of sampled points with that of their nearest neighbours: near 0 for
/// noise, near 1 for a bad model.
pub(crate) fn neighbour_correlation(
    points: &[Point3],
    residuals: &[f64],
    left_out: &[bool],
    tree: &KdTree,
    order: &[u32],
) -> f64 {
    const PROBES: usize = 400;
    // A tree over a part of the points has other indices.
    if tree.len() != points.len() {
        return 0.0;
    }
    let (mut xy, mut xx) = (0.0, 0.0);
    let mut all: Vec<f64> = residuals
        .iter()
        .map(|r| r.abs())
        .filter(|r| r.is_finite())
        .collect();
    let most = 5.0 * median(&mut all);
    let mut found = Vec::new();
    for &i in order.iter().take(PROBES) {
        let i = i as usize;
        tree.nearest_k(points[i], 2, &mut found);
        let Some(j) = found.iter().map(|f| f.1 as usize).find(|j| *j != i) else {
            continue;
        };
        if !left_out[i] && !left_out[j] {
            let (u, v) = (
                residuals[i].clamp(-most, most),
                residuals[j].clamp(-most, most),
            );
            xy += u * v;
            xx += 0.5 * (u * u + v * v);
        }
    }
    if xx > 0.0 { xy / xx } else { 0.0 }
}
