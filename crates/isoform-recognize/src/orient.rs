//! Orientation of normals by casting rays: an outward ray leaves the solid for good or meets its
//! surface an even number of times, an inward ray an odd number.
//!
//! Propagation along spanning trees of neighbours fails at edges and on thin walls. Rays meet the
//! surfaces of entities exactly; a crossing counts if the entity has points there.

use crate::chart::Primitive;
use crate::cloud::thinned;
use isoform_geom::{Aabb, KdTree, Point3, dot, sub};
use rayon::prelude::*;

/// Minimum step along a ray, in diagonals: surfaces closer to each other are met as one.
const MIN_RAY_STEP: f64 = 2e-4;

/// Turns normals outwards; those of one entity that face one way are turned together. Planes on
/// which the part stands (a point and the normal of each) close it.
pub(crate) fn orient(
    points: &[Point3],
    normals: &mut [Point3],
    labels: &[Option<usize>],
    surfaces: &[Primitive],
    supports: &[(Point3, Point3)],
) {
    let rays = Rays {
        labels,
        surfaces,
        supports,
        tree: KdTree::new(points),
        size: Aabb::from_points(points).diagonal(),
    };
    let spacing = spacing(points, &rays.tree);
    let group = |i: usize| {
        labels[i].map(|l| 2 * l + usize::from(dot(surfaces[l].normal(points[i]), normals[i]) > 0.0))
    };
    let mut groups = vec![Vec::new(); 2 * surfaces.len()];
    for i in 0..points.len() {
        if let Some(g) = group(i) {
            groups[g].push(i);
        }
    }
    let is_turned: Vec<bool> = groups
        .par_iter()
        .map(|of| {
            let votes = thinned(of.len(), 48).map(|k| {
                let i = of[k];
                let [out, back] = [1.0, -1.0].map(|s| {
                    let way = normals[i].map(|x| s * x);
                    rays.crossings(points[i], way, spacing) % 2
                });
                // Equal parities mean that a crossing was missed.
                back as f64 - out as f64
            });
            let votes: Vec<f64> = votes.collect();
            let right: f64 = votes.iter().filter(|v| **v > 0.0).sum();
            let wrong: f64 = -votes.iter().filter(|v| **v < 0.0).sum::<f64>();
            wrong > 2.0 * right
        })
        .collect();
    for (of, _) in groups.iter().zip(&is_turned).filter(|(_, t)| **t) {
        for i in of {
            normals[*i] = normals[*i].map(|x| -x);
        }
    }
}

/// Returns the median distance between a point and the one nearest to it.
fn spacing(points: &[Point3], tree: &KdTree) -> f64 {
    let mut found = Vec::new();
    let mut distances: Vec<f64> = thinned(points.len(), 1000)
        .map(|i| {
            tree.nearest_k(points[i], 2, &mut found);
            found.last().map_or(0.0, |f| f.0.sqrt())
        })
        .collect();
    let half = distances.len() / 2;
    *distances.select_nth_unstable_by(half, f64::total_cmp).1
}

/// The scene that rays are cast in.
struct Rays<'a> {
    labels: &'a [Option<usize>],
    surfaces: &'a [Primitive],
    supports: &'a [(Point3, Point3)],
    tree: KdTree,
    size: f64,
}

impl Rays<'_> {
    /// Returns the number of times that a ray meets the surface of an entity where it has points.
    fn crossings(&self, from: Point3, way: Point3, spacing: f64) -> usize {
        let of = |s: usize| self.crossings_of(s, from, way, spacing);
        // Rays along a plane leave the part before they meet it.
        let is_met = |(at, n): &&(Point3, Point3)| {
            let cosine = dot(way, *n);
            // The part stands on a plane whose normal is within 45° of the ray.
            cosine.abs() > 0.7 && dot(sub(*at, from), *n) * cosine > 0.0
        };
        let supports = self.supports.iter().filter(is_met).count();
        (0..self.surfaces.len()).map(of).sum::<usize>() + supports
    }

    /// Counts the crossings of one surface by sphere tracing: along a ray the distance changes no
    /// faster than the ray advances, so that steps of its size pass no zero.
    fn crossings_of(&self, which: usize, from: Point3, way: Point3, spacing: f64) -> usize {
        let surface = &self.surfaces[which];
        let at = |t: f64| -> Point3 { std::array::from_fn(|k| from[k] + t * way[k]) };
        let (mut t, mut count) = (1e-3 * self.size, 0);
        let mut before = surface.distance(at(t));
        // A ray that takes more steps has left.
        for _ in 0..400 {
            t += before.abs().max(MIN_RAY_STEP * self.size);
            if t > 1.1 * self.size {
                break;
            }
            let now = surface.distance(at(t));
            if (now < 0.0) != (before < 0.0) && self.has_points(which, at(t), spacing) {
                count += 1;
            }
            before = now;
        }
        count
    }

    fn has_points(&self, which: usize, at: Point3, spacing: f64) -> bool {
        let mut found = Vec::new();
        // A surface has points where one of the six nearest is its own, within three spacings.
        self.tree.nearest_k(at, 6, &mut found);
        let limit = (3.0 * spacing + MIN_RAY_STEP * self.size).powi(2);
        found
            .iter()
            .any(|f| f.0 <= limit && self.labels[f.1 as usize] == Some(which))
    }
}
