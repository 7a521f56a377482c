//! Two-sided deviation between any two of points, meshes and models.
//!
//! The distance from points is the distance from the nearest point; from a mesh, from the nearest
//! triangle (the triangles of the nearest samples are measured exactly); from a model, its metric
//! reading, which is the distance to first order. Points of meshes, which lie near, are brought to
//! the model's surface by Newton's method on that reading, and the way is measured. Meshes and
//! models are sampled evenly.

use crate::FrepTemplate;
use crate::facets::on_triangle;
use isoform_fit::{Template, surface_samples};
use isoform_geom::{Aabb, KdTree, ParamField, Point3, PointCloud, cross, dot, norm, sub};
use serde::Serialize;

/// Number of nearest samples of a mesh whose triangles are measured: the nearest triangle is nearly
/// always among them.
const NEAREST: usize = 32;

/// Smallest number of samples of a triangle.
const LEAST: f64 = 4.0;

/// One of the two things.
#[derive(Clone, Copy, Debug)]
pub enum Side<'a> {
    /// Points as they are.
    Points(&'a PointCloud),
    /// The triangles of a cloud.
    Mesh(&'a PointCloud),
    /// The surface of a model with these values.
    Model(&'a FrepTemplate, &'a [f64]),
}

/// Distances of one side's points from the other side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Distances {
    /// Root of the mean square.
    pub rms: f64,
    /// Mean.
    pub mean: f64,
    /// 95 % are nearer.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Points asked.
    pub samples: usize,
}

/// Why there is nothing to compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// Two models have no box of their own.
    #[error("two models need a box in which to compare them")]
    NoRegion,
    /// No point, or no surface in the box.
    #[error("the {0} has no points there")]
    Empty(&'static str),
}

/// Distances from the first to the second, and from the second to the first. Models are looked at
/// in `region`, by default the box of the other side (somewhat enlarged); coordinates are those of
/// the files.
pub fn compare(
    a: Side,
    b: Side,
    region: Option<Aabb>,
    samples: usize,
) -> Result<(Distances, Distances), CompareError> {
    let box_of = |s: &Side| match s {
        Side::Points(c) | Side::Mesh(c) => Some(Aabb::of(&absolute(c))),
        Side::Model(..) => None,
    };
    let (own_a, own_b) = (box_of(&a), box_of(&b));
    let from_a = sampled(&a, region.or(own_b), samples)?;
    let from_b = sampled(&b, region.or(own_a), samples)?;
    let empty = |points: &[Point3], which| {
        if points.is_empty() {
            Err(CompareError::Empty(which))
        } else {
            Ok(())
        }
    };
    empty(&from_a.points, "first")?;
    empty(&from_b.points, "second")?;
    let is_mesh = |s: &Side| matches!(s, Side::Mesh(_));
    let there = distances(&from_a.points, &b, &from_b, is_mesh(&a));
    let back = distances(&from_b.points, &a, &from_a, is_mesh(&b));
    Ok((summary(&there), summary(&back)))
}

/// The points in the coordinates of their file.
fn absolute(cloud: &PointCloud) -> Vec<Point3> {
    (0..cloud.points.len()).map(|i| cloud.absolute(i)).collect()
}

/// Points of a side; of a mesh with the triangle of each.
struct Sampled {
    points: Vec<Point3>,
    /// The corners of each triangle.
    triangles: Vec<[Point3; 3]>,
    /// By point, its triangle; empty if there are none.
    owner: Vec<u32>,
}

/// Samples of a side: `wanted` ones of a mesh or of a model's surface in the region, or its points.
fn sampled(side: &Side, region: Option<Aabb>, wanted: usize) -> Result<Sampled, CompareError> {
    let mut out = Sampled {
        points: Vec::new(),
        triangles: Vec::new(),
        owner: Vec::new(),
    };
    match side {
        Side::Points(cloud) => out.points = absolute(cloud),
        Side::Model(template, values) => {
            let region = region.ok_or(CompareError::NoRegion)?;
            out.points = surface_samples(template.metric(), values, region, wanted);
        }
        Side::Mesh(mesh) => {
            let corners = absolute(mesh);
            out.triangles = mesh
                .triangles
                .iter()
                .map(|t| t.map(|v| corners[v as usize]))
                .collect();
            out.sample_triangles(wanted);
        }
    }
    Ok(out)
}

impl Sampled {
    /// Samples the triangles by area. Every triangle has some samples, so that none is overlooked
    /// where nearest triangles are sought.
    fn sample_triangles(&mut self, wanted: usize) {
        let area = |t: &[Point3; 3]| 0.5 * norm(cross(sub(t[1], t[0]), sub(t[2], t[0])));
        let total: f64 = self.triangles.iter().map(area).sum();
        let mut owed = 0.0;
        for (i, t) in self.triangles.iter().enumerate().filter(|_| total > 0.0) {
            owed += (area(t) / total * wanted as f64).max(LEAST);
            while owed >= 1.0 {
                owed -= 1.0;
                self.points.push(on_triangle(self.points.len() as u32, *t));
                self.owner.push(i as u32);
            }
        }
    }

    /// The distance from the nearest triangle, or from the nearest point if there are none; `near`
    /// is scratch.
    fn distance(&self, tree: &KdTree, p: Point3, near: &mut Vec<(f64, u32)>) -> f64 {
        if self.owner.is_empty() {
            return tree.nearest(p).map_or(f64::INFINITY, |(_, d)| d.sqrt());
        }
        tree.nearest_k(p, NEAREST, near);
        let triangle = |i: usize| &self.triangles[self.owner[i] as usize];
        near.iter()
            .map(|f| to_triangle(p, triangle(f.1 as usize)))
            .fold(f64::INFINITY, f64::min)
    }
}

/// Distances of points from a side; from a model `exactly` by foot points, else by its reading.
fn distances(points: &[Point3], to: &Side, sampled: &Sampled, exactly: bool) -> Vec<f64> {
    if let Side::Model(template, values) = to {
        if exactly {
            return feet(points, template.metric(), values);
        }
        let mut f = vec![0.0; points.len()];
        template.metric().values(points, values, &mut f);
        return f
            .into_iter()
            .map(f64::abs)
            .filter(|d| d.is_finite())
            .collect();
    }
    let tree = KdTree::new(&sampled.points);
    let mut found = Vec::new();
    points
        .iter()
        .map(|p| sampled.distance(&tree, *p, &mut found))
        .collect()
}

/// Number of steps of Newton's method: each doubles the digits, and the first ones begin at a mesh.
const STEPS: usize = 6;

/// The distance of each point from its foot on the zero set, to which Newton's method along
/// gradients leads; the value alone where it leads away.
fn feet(points: &[Point3], field: &dyn ParamField, a: &[f64]) -> Vec<f64> {
    let mut at = points.to_vec();
    let (mut f, mut g) = (vec![0.0; at.len()], vec![[0.0; 3]; at.len()]);
    let mut first = Vec::new();
    for _ in 0..STEPS {
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
    let distance = |((p, q), f): ((&Point3, &Point3), &f64)| {
        let d = norm(sub(*p, *q));
        if d <= 2.0 * f.abs() { d } else { f.abs() }
    };
    points
        .iter()
        .zip(&at)
        .zip(&first)
        .map(distance)
        .filter(|d| d.is_finite())
        .collect()
}

/// Distance of a point from a triangle: to the plane where the foot lies inside, else to the
/// nearest edge.
fn to_triangle(p: Point3, t: &[Point3; 3]) -> f64 {
    let n = cross(sub(t[1], t[0]), sub(t[2], t[0]));
    let is_inside = (0..3).all(|k| dot(cross(sub(t[(k + 1) % 3], t[k]), sub(p, t[k])), n) >= 0.0);
    if is_inside && norm(n) > 0.0 {
        return (dot(sub(p, t[0]), n) / norm(n)).abs();
    }
    let to_edge = |k: usize| to_segment(p, t[k], t[(k + 1) % 3]);
    (0..3).map(to_edge).fold(f64::INFINITY, f64::min)
}

/// Distance of a point from the segment between a and b.
fn to_segment(p: Point3, a: Point3, b: Point3) -> f64 {
    let (e, v) = (sub(b, a), sub(p, a));
    let ee = dot(e, e);
    let s = if ee > 0.0 {
        (dot(v, e) / ee).clamp(0.0, 1.0)
    } else {
        0.0
    };
    norm(sub(v, e.map(|c| s * c)))
}

/// Mean, largest and other figures of distances.
fn summary(distances: &[f64]) -> Distances {
    let mut d: Vec<f64> = distances.to_vec();
    if d.is_empty() {
        return Distances::default();
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
        samples: d.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::hyperfun::{Mode, Model, Pose};

    fn square(z: f64) -> PointCloud {
        let points = vec![[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
        PointCloud {
            points,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..PointCloud::default()
        }
    }

    #[test]
    fn parallel_squares() {
        let (a, b) = (square(0.0), square(0.25));
        let (ab, ba) = compare(Side::Mesh(&a), Side::Mesh(&b), None, 500).expect("comparable");
        assert!(
            (ab.rms - 0.25).abs() < 1e-12 && (ab.max - 0.25).abs() < 1e-12 && ab.p95 == ba.p95,
            "{ab:?}"
        );
        let (pa, _) = compare(Side::Points(&a), Side::Mesh(&b), None, 500).expect("comparable");
        assert_eq!((pa.samples, pa.max), (4, 0.25));
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
        let (to_model, to_points) = compare(
            Side::Points(&cloud),
            Side::Model(&template, &[2.1]),
            None,
            1000,
        )
        .expect("comparable");
        assert!((to_model.rms - 0.1).abs() < 5e-3, "{to_model:?}");
        assert!(to_points.max < 0.5 && to_points.p95 >= 0.1, "{to_points:?}");
        let both = Side::Model(&template, &[2.1]);
        assert_eq!(compare(both, both, None, 1000), Err(CompareError::NoRegion));
    }

    #[test]
    fn a_mesh_is_measured_on_the_function() {
        // The algebraic sphere's reading is no distance.
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
        let (there, _) = compare(
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

    #[test]
    fn distance_of_a_triangle() {
        let t = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(to_triangle([0.2, 0.2, -3.0], &t), 3.0);
        assert_eq!(to_triangle([-3.0, -4.0, 0.0], &t), 5.0);
        assert_eq!(to_triangle([0.5, -2.0, 0.0], &t), 2.0);
    }
}
