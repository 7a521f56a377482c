//! Sizes where features crowd: corners and curves closer together than the mesh would have them.

use crate::features::Features;
use isoform_geom::{KdTree, Point3, distance_squared, norm, sub};

/// Edges per distance between two corners: lattice points are moved by up to 0.56 cells, so that
/// two corners must be more than two cells apart to stay off each other's neighbours.
const CORNERS: f64 = 2.2;
/// The same between curves.
const CURVES: f64 = 1.0;
/// Edges per turn of a closed curve.
const LOOP: f64 = 8.0;
/// Smallest share of the size asked for: features closer than that are left to the cutting.
const LEAST: f64 = 0.25;
/// Neighbours of a place on a curve that are looked at.
const NEAR: usize = 12;

/// Places with the edge length wanted there.
pub(crate) struct Crowd {
    tree: KdTree,
    places: Vec<Point3>,
    sizes: Vec<f64>,
    /// Beyond it no place matters.
    reach: f64,
}

impl Crowd {
    /// Places where features are closer together than a mesh of this size resolves.
    pub(crate) fn new(features: &Features, size: f64) -> Self {
        let mut places: Vec<Point3> = Vec::new();
        let mut sizes: Vec<f64> = Vec::new();
        let mut add = |p: Point3, s: f64| {
            if s < size {
                places.push(p);
                sizes.push(s.max(LEAST * size));
            }
        };
        let corners: Vec<Point3> = features.corners.iter().map(|c| c.point).collect();
        let tree = KdTree::new(&corners);
        let mut found = Vec::new();
        for p in &corners {
            tree.nearest_k(*p, 2, &mut found);
            if let Some(&(d, _)) = found.get(1) {
                add(*p, d.sqrt() / CORNERS);
            }
        }
        // Curves, resampled evenly.
        let mut samples: Vec<Point3> = Vec::new();
        let mut of: Vec<u32> = Vec::new();
        for (k, curve) in features.curves.iter().enumerate() {
            let length: f64 = curve.points.windows(2).map(|w| norm(sub(w[1], w[0]))).sum();
            if curve.closed {
                let s = length / LOOP;
                curve.points.iter().for_each(|p| add(*p, s));
            }
            let mut since = f64::INFINITY;
            for w in curve.points.windows(2) {
                since += norm(sub(w[1], w[0]));
                if since > 0.2 * size.min(length / 5.0) {
                    samples.push(std::array::from_fn(|i| 0.5 * (w[0][i] + w[1][i])));
                    of.push(k as u32);
                    since = 0.0;
                }
            }
        }
        let tree = KdTree::new(&samples);
        for (p, &k) in samples.iter().zip(&of) {
            let mine = &features.curves[k as usize];
            tree.nearest_k(*p, NEAR, &mut found);
            for &(d, other) in &found {
                let theirs = &features.curves[of[other as usize] as usize];
                let d = d.sqrt();
                if of[other as usize] == k || d >= CURVES * size {
                    continue;
                }
                // Curves part at the corner that they share; there they are close without crowding.
                let shared = mine
                    .corners
                    .iter()
                    .flatten()
                    .filter(|c| theirs.corners.iter().flatten().any(|o| o == *c));
                let parting = shared
                    .map(|&c| norm(sub(features.corners[c as usize].point, *p)))
                    .fold(f64::INFINITY, f64::min);
                if d < 0.4 * parting {
                    add(*p, d / CURVES);
                }
            }
        }
        Self {
            tree: KdTree::new(&places),
            places,
            sizes,
            reach: size,
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.sizes.is_empty()
    }

    /// Edge length wanted at a point; infinite away from crowded places. Sizes grow as fast as the
    /// distance to a place does.
    /// `last` keeps the place that decided: those asked for one after the other are near each
    /// other, as a rule.
    pub(crate) fn size_at(&self, p: Point3, last: &mut Vec<(f64, u32)>) -> f64 {
        let size = |d: f64, i: u32| self.sizes[i as usize].max(d.sqrt());
        let mut wanted = f64::INFINITY;
        if let Some(&(_, i)) = last.first() {
            wanted = size(distance_squared(self.places[i as usize], p), i);
        }
        let within = |wanted: f64| wanted.min(self.reach).powi(2);
        self.tree.near(p, within(wanted), &mut |d, i| {
            let s = size(d, i);
            if s < wanted {
                wanted = s;
                last.clear();
                last.push((d, i));
            }
            within(wanted)
        });
        if wanted < self.reach {
            wanted
        } else {
            f64::INFINITY
        }
    }
}
