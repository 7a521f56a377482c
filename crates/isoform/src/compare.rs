//! Two-sided distances between any two of points, meshes, models and solids of exact faces.
//!
//! Meshes, models and solids are sampled evenly; samples of solids lie on their exact faces. The
//! distance of a point from points, or from a mesh, is that of the nearest point or triangle; from
//! a solid, that of its exact faces and edges, among those on which the nearest samples lie; from a
//! model, its metric function, which is the distance to first order. Samples of meshes and solids
//! lie near a model: they are projected to its surface by Newton's method on the metric function,
//! and the length of the projection is their distance.

mod align;
mod faces;
mod nearest;
mod sides;

pub use faces::FaceDistances;

use crate::facets::{CornerError, check_corners};
use crate::{ExactSolid, FrepTemplate, SplineDistance, parameter_values};
use faces::by_face;
use isoform_cad::PreparedShape;
use isoform_field::SolidError;
use isoform_fit::{MAX_SURFACE_SAMPLES, Parameter, Template, surface_samples};
use isoform_geom::cad::Placement;
use isoform_geom::{
    Aabb, KdTree, ParamField, Point3, PointCloud, cross, dot, norm, on_triangle, sub,
};
pub(crate) use nearest::TriangleTree;
use rayon::prelude::*;
use serde::Serialize;
pub(crate) use sides::{Sides, volume};

/// Number of nearest samples of a solid whose faces are measured; they nearly always include the
/// nearest face. With fewer, that may be missed, and the distance overestimated.
const NEAREST_SOLID_SAMPLES: usize = 32;
/// Minimum number of points that a thread takes at a time, so that scheduling is negligible.
const MIN_POINTS_PER_THREAD: usize = 512;

/// Minimum number of samples of a triangle, so that no triangle is missed, however small.
const MIN_SAMPLES_PER_TRIANGLE: f64 = 4.0;

/// Side of a comparison.
#[derive(Clone, Copy, Debug)]
pub enum Side<'a> {
    /// Points.
    Points(&'a PointCloud),
    /// Triangles of a cloud.
    Mesh(&'a PointCloud),
    /// Surface of a model with these values of its parameters; missing values are those of
    /// [`parameter_values`], and those of a pose without motion.
    Model(&'a FrepTemplate, &'a [f64]),
    /// Surface of an implicit spline.
    Spline(&'a SplineDistance),
    /// Faces of a solid.
    Solid(&'a ExactSolid),
    /// Faces of a shape of a CAD file.
    Shape(&'a PreparedShape),
}

/// Distances of the points of one side from the other side, in the unit of the coordinates; NaN, in
/// JSON null, if none of them has a distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Distances {
    /// Root mean square distance.
    pub rms: f64,
    /// Mean distance.
    pub mean: f64,
    /// 95th percentile of the distances.
    pub p95: f64,
    /// Largest distance.
    pub max: f64,
    /// Number of points.
    pub samples: usize,
    /// Number of points at which the other side's function is not a number; the statistics leave
    /// them out.
    pub undefined: usize,
}

/// Reason why two sides cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// Two models are given without a region.
    #[error("two models need a box in which to compare them")]
    NoRegion,
    /// A side has no points, or no surface in the region.
    #[error("the {0} has no points there")]
    Empty(&'static str),
    /// A coordinate of a point is NaN or infinite.
    #[error("point {point} of the {side} is not finite (from 0)")]
    NotFinite {
        /// Side: `first` or `second`.
        side: &'static str,
        /// Index of the point, from 0.
        point: usize,
    },
    /// A triangle has a corner that is not the index of a point.
    #[error("the {side}: {error}")]
    Corner {
        /// Side: `first` or `second`.
        side: &'static str,
        /// The corner.
        error: CornerError,
    },
    /// More values than parameters were given.
    #[error("{found} values for the {expected} parameters of the {side}")]
    Parameters {
        /// Side: `first` or `second`.
        side: &'static str,
        /// Number of parameters of the template.
        expected: usize,
        /// Number of values given.
        found: usize,
    },
    /// A parameter has no value.
    #[error("the {side}: {error}")]
    Values {
        /// Side: `first` or `second`.
        side: &'static str,
        /// The parameter.
        error: SolidError,
    },
}

/// Distances between two sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Distances of the first side from the second.
    pub there: Distances,
    /// Distances of the second side from the first.
    pub back: Distances,
    /// Distances of the first side from each face of the second: of a solid, or the parts of a
    /// model; empty for other sides.
    pub faces: Vec<FaceDistances>,
}

/// Returns the distances of `a` from `b`, and of `b` from `a`, in the coordinates of the files.
/// Models are sampled in `region`, by default the bounding box of the other side, somewhat
/// enlarged. About `samples` points are taken of meshes, models and solids, two million at most
/// ([`MAX_SURFACE_SAMPLES`]), with some on each triangle of a mesh.
///
/// # Errors
/// [`CompareError`] if a side is invalid or has no points, or if two models are given without a
/// region.
pub fn compare(
    a: Side,
    b: Side,
    region: Option<Aabb>,
    samples: usize,
) -> Result<Comparison, CompareError> {
    let samples = samples.min(MAX_SURFACE_SAMPLES);
    let (a, b) = (
        CheckedSide::new(a, "first")?,
        CheckedSide::new(b, "second")?,
    );
    let mut from_a = a.sampled(region.or(b.bounds()), samples)?;
    let mut from_b = b.sampled(region.or(a.bounds()), samples)?;
    for (model, sampled, other) in [(&a, &mut from_a, &b), (&b, &mut from_b, &a)] {
        if let (
            CheckedSide::Model(field, values, _),
            CheckedSide::Solid(_) | CheckedSide::Shape(_),
        ) = (model, other)
        {
            sampled.points = settled(&sampled.points, *field, values);
        }
    }
    for (sampled, side) in [(&from_a, "first"), (&from_b, "second")] {
        if sampled.points.is_empty() {
            return Err(CompareError::Empty(side));
        }
    }
    let there = distances(&from_a.points, &b, &from_b, a.is_near());
    let back = distances(&from_b.points, &a, &from_a, b.is_near());
    Ok(Comparison {
        faces: by_face(&b, &from_b, &from_a.points, &there),
        there: summary(&there),
        back: summary(&back),
    })
}

/// Distances of points from the other side, with the motion that brought them there.
#[derive(Clone, Debug)]
pub struct Deviations {
    /// Points of the first side in the coordinates of the second, after the motion.
    pub points: Vec<Point3>,
    /// Distance of each point from the second side; not finite where it has none.
    pub values: Vec<f64>,
    /// True if distances are negative inside of the second side: of a model or a closed surface.
    pub is_signed: bool,
    /// Motion of the points; `None` if none was asked for.
    pub motion: Option<Placement>,
}

/// Returns the distances of the points of `a` from `b`, about `samples` of them unless `a` is
/// points. With `align`, `a` is first moved as a rigid body to where the sum of the squared
/// distances of at most 20,000 of its points is least.
///
/// # Errors
/// As [`compare`].
pub fn deviations(
    a: Side,
    b: Side,
    samples: usize,
    align: bool,
) -> Result<Deviations, CompareError> {
    let samples = samples.min(MAX_SURFACE_SAMPLES);
    let (a, b) = (
        CheckedSide::new(a, "first")?,
        CheckedSide::new(b, "second")?,
    );
    let mut points = a.sampled(b.bounds(), samples)?.points;
    if points.is_empty() {
        return Err(CompareError::Empty("first"));
    }
    let mut around = Aabb::from_points(&points);
    if align {
        // A model is sampled wherever the points may be brought to.
        around.add(around.lo.map(|v| v - around.diagonal()));
        around.add(around.hi.map(|v| v + around.diagonal()));
    }
    let other = b.sampled(Some(around), samples)?;
    let tree = (!other.owner.is_empty()).then(|| TriangleTree::new(&other.triangles));
    let sides = tree
        .as_ref()
        .and_then(|tree| Sides::new(tree, &other.triangles));
    let from_b = |points: &[Point3]| {
        let unsigned = distances(points, &b, &other, a.is_near());
        signed(points, unsigned, &b, sides.as_ref())
    };
    let rough = |points: &[Point3]| match (&tree, &sides) {
        (Some(tree), Some(sides)) => {
            let sign = |(p, d): (&Point3, f64)| if sides.is_inside(*p) { -d } else { d };
            points
                .par_iter()
                .zip(tree.distances(points))
                .map(sign)
                .collect()
        }
        (Some(tree), None) => tree.distances(points),
        (None, _) => from_b(points),
    };
    let motion = align.then(|| align::best_fit(&points, &other.points, &rough, &from_b));
    if let Some(motion) = &motion {
        points = align::moved(&points, motion);
    }
    Ok(Deviations {
        values: from_b(&points),
        points,
        is_signed: matches!(b, CheckedSide::Model(..)) || sides.is_some(),
        motion,
    })
}

/// Returns distances from a side with the sign of the points: negative inside.
fn signed(
    points: &[Point3],
    distances: Vec<f64>,
    side: &CheckedSide,
    sides: Option<&Sides>,
) -> Vec<f64> {
    if let CheckedSide::Model(metric, values, _) = side {
        let mut f = vec![0.0; points.len()];
        metric.values(points, values, &mut f);
        let sign = |(d, f): (f64, f64)| if f > 0.0 { -d } else { d };
        return distances.into_iter().zip(f).map(sign).collect();
    }
    let Some(sides) = sides else {
        return distances;
    };
    let sign = |(p, d): (&Point3, f64)| {
        let is_inside = match side {
            // Between a face and its triangles only the face tells.
            CheckedSide::Shape(shape) if d <= shape.deviation() => {
                shape.signed_distance(*p).is_some_and(|d| d < 0.0) != sides.is_inverted
            }
            CheckedSide::Solid(solid) if d <= solid.facets().deviation => {
                let near = sides.nearest(*p);
                near.is_some_and(|(triangle, at, normal)| {
                    let face = solid.facets().face_of[triangle] as usize;
                    dot(sub(*p, solid.skin().nearest(face, *p, at)), normal) < 0.0
                })
            }
            _ => sides.is_inside(*p),
        };
        if is_inside { -d } else { d }
    };
    points.par_iter().zip(distances).map(sign).collect()
}

/// Validated side: points are absolute and finite, corners of triangles are indices of points, and
/// a model has a value for each parameter.
enum CheckedSide<'a> {
    Points(Vec<Point3>),
    Mesh(Vec<Point3>, &'a [[u32; 3]]),
    /// Metric function, values, and the template unless it is a spline.
    Model(&'a dyn ParamField, Vec<f64>, Option<&'a FrepTemplate>),
    Solid(&'a ExactSolid),
    Shape(&'a PreparedShape),
}

impl<'a> CheckedSide<'a> {
    fn new(given: Side<'a>, side: &'static str) -> Result<Self, CompareError> {
        Ok(match given {
            Side::Points(cloud) => Self::Points(absolute(cloud, side)?),
            Side::Mesh(mesh) => {
                check_corners(mesh).map_err(|error| CompareError::Corner { side, error })?;
                Self::Mesh(absolute(mesh, side)?, &mesh.triangles)
            }
            Side::Model(template, given) => {
                let values = all_values(template, given, side)?;
                Self::Model(template.metric(), values, Some(template))
            }
            Side::Spline(spline) => Self::Model(spline, Vec::new(), None),
            Side::Solid(solid) => Self::Solid(solid),
            Side::Shape(shape) => Self::Shape(shape),
        })
    }

    /// Returns true if the points of the side lie near a model that it approximates.
    fn is_near(&self) -> bool {
        matches!(self, Self::Mesh(..) | Self::Solid(_) | Self::Shape(_))
    }

    fn bounds(&self) -> Option<Aabb> {
        match self {
            Self::Points(points) | Self::Mesh(points, _) => Some(Aabb::from_points(points)),
            Self::Model(..) => None,
            Self::Solid(solid) => Some(Aabb::from_points(&solid.facets().points)),
            Self::Shape(shape) => Some(shape.bounds()),
        }
    }

    fn sampled(&self, region: Option<Aabb>, wanted: usize) -> Result<SideSamples, CompareError> {
        Ok(match self {
            Self::Points(points) => SideSamples {
                points: points.clone(),
                ..SideSamples::default()
            },
            Self::Model(metric, values, _) => {
                let region = region.ok_or(CompareError::NoRegion)?;
                SideSamples {
                    points: surface_samples(*metric, values, region, wanted),
                    ..SideSamples::default()
                }
            }
            Self::Mesh(corners, triangles) => SideSamples::of_mesh(corners, triangles, wanted),
            Self::Solid(solid) => SideSamples::of_solid(solid, wanted),
            Self::Shape(shape) => SideSamples::of_shape(shape, wanted),
        })
    }
}

/// Returns the points of a cloud in the file's coordinates.
fn absolute(cloud: &PointCloud, side: &'static str) -> Result<Vec<Point3>, CompareError> {
    let points: Vec<Point3> = (0..cloud.points.len()).map(|i| cloud.absolute(i)).collect();
    let is_wrong = |p: &Point3| p.iter().any(|v| !v.is_finite());
    match points.iter().position(is_wrong) {
        Some(point) => Err(CompareError::NotFinite { side, point }),
        None => Ok(points),
    }
}

/// Returns the values of all parameters of a template, those of its pose included.
fn all_values(
    template: &FrepTemplate,
    given: &[f64],
    side: &'static str,
) -> Result<Vec<f64>, CompareError> {
    let parameters = template.parameters();
    let (expected, found) = (parameters.len(), given.len());
    if found > expected {
        return Err(CompareError::Parameters {
            side,
            expected,
            found,
        });
    }
    let own = template.model().n_params();
    let mut values = parameter_values(template.model(), &given[..found.min(own)])
        .map_err(|error| CompareError::Values { side, error })?;
    let unmoved = |p: &Parameter| if p.name == "pose_scale" { 1.0 } else { 0.0 };
    let pose = |i: usize| {
        given
            .get(i)
            .copied()
            .unwrap_or_else(|| unmoved(&parameters[i]))
    };
    values.extend((own..expected).map(pose));
    Ok(values)
}

/// Samples of a side; of a mesh or solid with the triangle of each.
#[derive(Default)]
struct SideSamples {
    points: Vec<Point3>,
    triangles: Vec<[Point3; 3]>,
    owner: Vec<u32>,
}

impl SideSamples {
    fn of_mesh(corners: &[Point3], triangles: &[[u32; 3]], wanted: usize) -> Self {
        let triangles = triangles.iter().map(|t| t.map(|v| corners[v as usize]));
        let mut out = Self {
            triangles: triangles.collect(),
            ..Self::default()
        };
        let area = |t: &[Point3; 3]| 0.5 * norm(cross(sub(t[1], t[0]), sub(t[2], t[0])));
        let total: f64 = out.triangles.iter().map(area).sum();
        let mut owed = 0.0;
        for (i, t) in out.triangles.iter().enumerate().filter(|_| total > 0.0) {
            // Every triangle has some samples, so that none is missed; samples of a solid also
            // serve to find its nearest faces.
            owed += (area(t) / total * wanted as f64).max(MIN_SAMPLES_PER_TRIANGLE);
            while owed >= 1.0 {
                owed -= 1.0;
                out.points.push(on_triangle(out.points.len() as u32, *t));
                out.owner.push(i as u32);
            }
        }
        out
    }

    /// Samples the triangles of the faces, and projects the samples to the exact faces.
    fn of_solid(solid: &ExactSolid, wanted: usize) -> Self {
        let (facets, skin) = (solid.facets(), solid.skin());
        let mut out = Self::of_mesh(&facets.points, &facets.triangles, wanted);
        for (p, t) in out.points.iter_mut().zip(&out.owner) {
            *p = skin.nearest(facets.face_of[*t as usize] as usize, *p, *p);
        }
        out
    }

    /// Samples the triangles of the faces of a shape, and projects the samples to the exact faces.
    fn of_shape(shape: &PreparedShape, wanted: usize) -> Self {
        let facets = shape.facets();
        // Each of them costs a search: no more than are wanted.
        let step =
            (MIN_SAMPLES_PER_TRIANGLE * facets.triangles.len() as f64 / wanted as f64).ceil();
        let mut out = Self::of_mesh(&facets.points, &facets.triangles, wanted);
        let step = step.max(1.0) as usize;
        out.points = out.points.into_iter().step_by(step).collect();
        out.owner = out.owner.into_iter().step_by(step).collect();
        let nearest = |p: &mut Point3| {
            if let Some(near) = shape.nearest(*p) {
                *p = near.point;
            }
        };
        out.points.par_iter_mut().for_each(nearest);
        out
    }
}

/// Returns the distance of each point from a shape; infinite if its square overflows.
fn to_shape(points: &[Point3], shape: &PreparedShape) -> Vec<f64> {
    let points = points.par_iter().with_min_len(MIN_POINTS_PER_THREAD);
    points
        .map(|p| shape.nearest(*p).map_or(f64::INFINITY, |n| n.distance))
        .collect()
}

/// Returns the distance of each point from a solid: from the faces on which its nearest samples
/// lie.
fn to_solid(points: &[Point3], solid: &ExactSolid, sampled: &SideSamples) -> Vec<f64> {
    let (tree, skin) = (KdTree::new(&sampled.points), solid.skin());
    let distance = |(found, faces): &mut (Vec<_>, Vec<u32>), p: &Point3| {
        tree.nearest_k(*p, NEAREST_SOLID_SAMPLES, found);
        faces.clear();
        let mut least = f64::INFINITY;
        for (_, i) in found {
            let i = *i as usize;
            // A point whose squared distances overflow has no neighbours.
            let Some(owner) = sampled.owner.get(i) else {
                continue;
            };
            let face = solid.facets().face_of[*owner as usize];
            if !faces.contains(&face) {
                faces.push(face);
                let foot = skin.nearest(face as usize, *p, sampled.points[i]);
                least = least.min(norm(sub(*p, foot)));
            }
        }
        least
    };
    let points = points.par_iter().with_min_len(MIN_POINTS_PER_THREAD);
    points
        .map_init(|| (Vec::new(), Vec::new()), distance)
        .collect()
}

/// Returns the distance of each point; not finite if it has none. With `exactly`, points are
/// projected to the surface of a model.
fn distances(
    points: &[Point3],
    to: &CheckedSide,
    sampled: &SideSamples,
    exactly: bool,
) -> Vec<f64> {
    if let CheckedSide::Model(metric, values, _) = to {
        if exactly {
            return feet(points, *metric, values);
        }
        let mut f = vec![0.0; points.len()];
        metric.values(points, values, &mut f);
        return f.into_iter().map(f64::abs).collect();
    }
    if let CheckedSide::Solid(solid) = to {
        return to_solid(points, solid, sampled);
    }
    if let CheckedSide::Shape(shape) = to {
        return to_shape(points, shape);
    }
    if !sampled.owner.is_empty() {
        return TriangleTree::new(&sampled.triangles).distances(points);
    }
    let tree = KdTree::new(&sampled.points);
    let nearest = |p: &Point3| tree.nearest(*p).map_or(f64::INFINITY, |(_, d)| d.sqrt());
    points
        .par_iter()
        .with_min_len(MIN_POINTS_PER_THREAD)
        .map(nearest)
        .collect()
}

/// Number of Newton steps: each doubles the digits, and points near the surface begin with some.
const PROJECTION_STEPS: usize = 6;

/// Returns the distance of each point from its projection to the zero set by Newton's method along
/// gradients; the absolute value of the field where the method diverges.
fn feet(points: &[Point3], field: &dyn ParamField, a: &[f64]) -> Vec<f64> {
    let (at, first) = newton(points, field, a);
    let distance = |((p, q), f): ((&Point3, &Point3), &f64)| {
        let d = norm(sub(*p, *q));
        if d <= 2.0 * f.abs() { d } else { f.abs() }
    };
    points.iter().zip(&at).zip(&first).map(distance).collect()
}

/// Projects points near a model to its surface; points where Newton's method diverges stay. Next to
/// edges, samples of a model are off its surface, which would count as a distance from a solid, as
/// that is exact.
fn settled(points: &[Point3], field: &dyn ParamField, a: &[f64]) -> Vec<Point3> {
    let (at, first) = newton(points, field, a);
    let settle = |((p, q), f): ((&Point3, &Point3), &f64)| {
        if norm(sub(*p, *q)) <= 2.0 * f.abs() {
            *q
        } else {
            *p
        }
    };
    points.iter().zip(&at).zip(&first).map(settle).collect()
}

/// Applies Newton's method to points; also returns the initial values of the field.
fn newton(points: &[Point3], field: &dyn ParamField, a: &[f64]) -> (Vec<Point3>, Vec<f64>) {
    let mut at = points.to_vec();
    let (mut f, mut g) = (vec![0.0; at.len()], vec![[0.0; 3]; at.len()]);
    let mut first = Vec::new();
    for _ in 0..PROJECTION_STEPS {
        field.gradients(&at, a, &mut f, &mut g);
        if first.is_empty() {
            first.clone_from(&f);
        }
        for ((p, f), g) in at.iter_mut().zip(&f).zip(&g) {
            let step = f / dot(*g, *g);
            if step.is_finite() {
                *p = std::array::from_fn(|k| p[k] - step * g[k]);
            }
        }
    }
    (at, first)
}

fn summary(distances: &[f64]) -> Distances {
    let finite = distances.iter().copied().filter(|d| d.is_finite());
    let mut d: Vec<f64> = finite.collect();
    let (samples, undefined) = (distances.len(), distances.len() - d.len());
    if d.is_empty() {
        return Distances {
            rms: f64::NAN,
            mean: f64::NAN,
            p95: f64::NAN,
            max: f64::NAN,
            samples,
            undefined,
        };
    }
    let n = d.len() as f64;
    let rms = (d.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
    let mean = d.iter().sum::<f64>() / n;
    let max = d.iter().copied().fold(0.0, f64::max);
    let at = ((0.95 * n).ceil() as usize).clamp(1, d.len()) - 1;
    let p95 = *d.select_nth_unstable_by(at, f64::total_cmp).1;
    Distances {
        rms,
        mean,
        p95,
        max,
        samples,
        undefined,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::hyperfun::{Mode, Model, Pose};

    /// Returns the distances in both directions.
    fn both(
        a: Side,
        b: Side,
        region: Option<Aabb>,
        samples: usize,
    ) -> Result<(Distances, Distances), CompareError> {
        let found = compare(a, b, region, samples)?;
        Ok((found.there, found.back))
    }

    fn square(z: f64) -> PointCloud {
        let points = vec![[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
        PointCloud {
            points,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..PointCloud::default()
        }
    }

    /// A tetrahedron of edges of different lengths, which no rotation takes to itself.
    fn tetrahedron() -> PointCloud {
        let points = vec![[0.0; 3], [5.0, 0.0, 0.0], [1.0, 3.0, 0.0], [0.5, 0.5, 2.0]];
        PointCloud {
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            ..PointCloud::from_points(points)
        }
    }

    #[test]
    fn deviations_are_negative_inside() {
        let tetrahedron = tetrahedron();
        let points = vec![
            [1.0, 1.0, 0.1],
            [1.0, 1.0, -0.3],
            [0.0, 0.0, -2.0],
            [9.0, 0.0, 0.0],
        ];
        let cloud = PointCloud::from_points(points);
        let found = deviations(Side::Points(&cloud), Side::Mesh(&tetrahedron), 100, false);
        let found = found.expect("comparable");
        assert!(found.is_signed && found.motion.is_none());
        for (value, expected) in found.values.iter().zip([-0.1, 0.3, 2.0, 4.0]) {
            assert!((value - expected).abs() < 1e-14, "{:?}", found.values);
        }
        // An open surface has no inside.
        let open = PointCloud {
            triangles: tetrahedron.triangles[..3].to_vec(),
            ..tetrahedron
        };
        let found = deviations(Side::Points(&cloud), Side::Mesh(&open), 100, false);
        let found = found.expect("comparable");
        assert!(!found.is_signed && found.values.iter().all(|v| *v >= 0.0));
    }

    /// Points of a tetrahedron, turned and far away, come back to their places.
    #[test]
    fn moved_points_come_back() {
        let tetrahedron = tetrahedron();
        let samples = SideSamples::of_mesh(&tetrahedron.points, &tetrahedron.triangles, 300);
        let mut random = isoform_num::Random::new(11);
        for _ in 0..isoform_testdata::cases(10, 1) {
            let z = [(); 3].map(|()| random.unit() - 0.5);
            let z = z.map(|v| v / norm(z));
            let origin = [(); 3].map(|()| 1e3 * random.unit());
            let frame = isoform_geom::brep::Axes::along(origin, z);
            let home = isoform_geom::brep::Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
            let moved = Placement::between(&home, &frame);
            let points: Vec<Point3> = samples.points.iter().map(|p| moved.point(*p)).collect();
            let cloud = PointCloud::from_points(points);
            let found = deviations(Side::Points(&cloud), Side::Mesh(&tetrahedron), 1000, true);
            let found = found.expect("comparable");
            let pairs = found.points.iter().zip(&samples.points);
            let off = pairs.map(|(p, q)| norm(sub(*p, *q))).fold(0.0, f64::max);
            assert!(off < 1e-6, "{off}");
            let back = found.motion.expect("a motion").after(&moved);
            assert!(norm(back.shift) < 1e-6, "{back:?}");
        }
    }

    #[test]
    fn parallel_squares() {
        let (a, b) = (square(0.0), square(0.25));
        let (ab, ba) = both(Side::Mesh(&a), Side::Mesh(&b), None, 500).expect("comparable");
        assert!(
            (ab.rms - 0.25).abs() < 1e-12 && (ab.max - 0.25).abs() < 1e-12 && ab.p95 == ba.p95,
            "{ab:?}"
        );
        let (pa, _) = both(Side::Points(&a), Side::Mesh(&b), None, 500).expect("comparable");
        assert_eq!((pa.samples, pa.max), (4, 0.25));
    }

    /// A block whose right side lies 0.05 off: no other face is off, and one has no points.
    #[test]
    fn distances_are_told_by_faces() {
        let text = "my_model(x[3], a[1]) { left = x[1]; right = 1 - x[1]; front = x[2];
            back = 1 - x[2]; low = x[3]; high = 1 - x[3];
            my_model = left & right & front & back & low & high; }";
        let model = Model::parse(text, Mode::Default).expect("a program");
        let template = FrepTemplate::with_pose(&model, Pose::None, &[]).expect("a template");
        let at = |i: u32| f64::from(i) / 10.0;
        let side = |x: f64| (1..10).flat_map(move |i| (1..10).map(move |j| [x, at(i), at(j)]));
        let front = (1..10).flat_map(|i| (1..10).map(move |j| [at(i), 0.0, at(j)]));
        let points = side(0.0).chain(side(1.05)).chain(front).collect();
        let cloud = PointCloud::from_points(points);
        let found = compare(
            Side::Points(&cloud),
            Side::Model(&template, &[]),
            None,
            1000,
        );
        let faces = found.expect("comparable").faces;
        let of = |name: &str| {
            let face = faces.iter().find(|f| f.face == name);
            face.map(|f| f.distances).expect(name)
        };
        // The sides that are coordinates alone have no names of their own.
        let exact = faces.iter().filter(|f| f.distances.max == 0.0);
        assert_eq!(
            exact.map(|f| f.distances.samples).collect::<Vec<_>>(),
            [81, 81]
        );
        let right = of("right");
        assert!((right.max - 0.05).abs() < 1e-12 && (right.rms - 0.05).abs() < 1e-12);
        assert_eq!((right.samples, of("high").samples), (81, 0));
        assert!(of("high").max.is_nan());
    }

    #[test]
    fn a_ball_and_its_points() {
        let text =
            "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }";
        let model = Model::parse(text, Mode::Default).expect("a program");
        let template = FrepTemplate::with_pose(&model, Pose::None, &[]).expect("a template");
        let points = (0..400).map(|i| {
            let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 200.0 - 1.0);
            let r = (1.0 - z * z).sqrt();
            [2.0 * r * t.cos(), 2.0 * r * t.sin(), 2.0 * z]
        });
        let cloud = PointCloud::from_points(points.collect());
        let (to_model, to_points) = both(
            Side::Points(&cloud),
            Side::Model(&template, &[2.1]),
            None,
            1000,
        )
        .expect("comparable");
        assert!((to_model.rms - 0.1).abs() < 5e-3, "{to_model:?}");
        assert!(to_points.max < 0.5 && to_points.p95 >= 0.1, "{to_points:?}");
        let side = Side::Model(&template, &[2.1]);
        assert_eq!(both(side, side, None, 1000), Err(CompareError::NoRegion));
    }

    #[test]
    fn a_mesh_is_measured_on_the_function() {
        // The algebraic sphere's function is not a distance.
        let text = "my_model(x[3], a[1]) { my_model = 4 - x[1]^2 - x[2]^2 - x[3]^2; }";
        let model = Model::parse(text, Mode::Default).expect("a program");
        let template = FrepTemplate::with_pose(&model, Pose::None, &[]).expect("a template");
        let points = vec![[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
        let mesh = PointCloud {
            triangles: vec![[0, 1, 2]],
            ..PointCloud::from_points(points)
        };
        let region = Aabb {
            lo: [-3.0; 3],
            hi: [3.0; 3],
        };
        let (there, _) = both(
            Side::Mesh(&mesh),
            Side::Model(&template, &[0.0]),
            Some(region),
            20_000,
        )
        .expect("comparable");
        let farthest = 2.0 - 2.0 / 3.0_f64.sqrt();
        assert!(
            there.max <= farthest + 1e-12 && there.max > 0.99 * farthest,
            "{there:?}"
        );
    }

    fn half() -> FrepTemplate {
        let text = "my_model(x[3], a[1]) { my_model = 2*sqrt(x[1]) - x[1]^2 - x[2]^2 - x[3]^2; }";
        let model = Model::parse(text, Mode::Default).expect("a program");
        FrepTemplate::with_pose(&model, Pose::None, &[]).expect("a template")
    }

    #[test]
    fn points_without_a_distance_are_counted() {
        let cloud = PointCloud::from_points(
            (0..400)
                .map(|i| [f64::from(i % 2) - 0.5, f64::from(i) / 400.0, 0.25])
                .collect(),
        );
        let half = half();
        let (there, back) =
            both(Side::Points(&cloud), Side::Model(&half, &[]), None, 1000).expect("comparable");
        assert_eq!(
            (there.samples, there.undefined, back.undefined),
            (400, 200, 0)
        );
        assert!(there.max.is_finite());
        let beyond = PointCloud::from_points(vec![[-1.0, 0.0, 0.0]]);
        let region = cloud.bounds();
        let (none, _) = both(
            Side::Points(&beyond),
            Side::Model(&half, &[]),
            Some(region),
            1000,
        )
        .expect("comparable");
        assert!(none.max.is_nan() && (none.samples, none.undefined) == (1, 1));
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let good = square(0.0);
        let of = |a: &PointCloud| both(Side::Mesh(&good), Side::Mesh(a), None, 100);
        for wrong in [f64::NAN, f64::INFINITY] {
            let mut bad = square(0.0);
            bad.points[3][1] = wrong;
            let error = CompareError::NotFinite {
                side: "second",
                point: 3,
            };
            assert_eq!(of(&bad), Err(error));
        }
        let mut bad = square(0.0);
        bad.triangles[1][0] = 4;
        let error = CornerError {
            triangle: 1,
            corner: 4,
            points: 4,
        };
        let side = "second";
        assert_eq!(of(&bad), Err(CompareError::Corner { side, error }));
        let many = both(
            Side::Points(&good),
            Side::Model(&half(), &[1.0, 2.0]),
            None,
            100,
        );
        let error = CompareError::Parameters {
            side,
            expected: 1,
            found: 2,
        };
        assert_eq!(many, Err(error));
    }

    #[test]
    fn samples_are_bounded() {
        let (points, mesh) = (square(0.0), square(0.25));
        let of = both(Side::Points(&points), Side::Mesh(&mesh), None, usize::MAX);
        let (_, back) = of.expect("comparable");
        assert!(back.samples.abs_diff(MAX_SURFACE_SAMPLES) <= 8);
    }
}
