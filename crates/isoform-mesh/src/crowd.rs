//! Sizes at close features: corners and curves nearer to each other than the mesh size.

use crate::features::{FeatureCurve, Features};
use crate::points::midpoint;
use isoform_geom::{KdTree, Point3, distance_squared, norm, sub};

/// Points with target edge lengths.
pub(crate) struct Crowd {
    tree: KdTree,
    wishes: Wishes,
}

/// Target edge lengths by position.
struct Wishes {
    places: Vec<Point3>,
    sizes: Vec<f64>,
    /// Edge length elsewhere; points farther away than this do not matter.
    size: f64,
}

impl Wishes {
    fn add(&mut self, p: Point3, s: f64) {
        if s < self.size {
            self.places.push(p);
            // Features closer than that are left to the cutting.
            self.sizes.push(s.max(0.25 * self.size));
        }
    }

    /// Adds corners next to each other.
    fn add_corners(&mut self, features: &Features) {
        let corners: Vec<Point3> = features.corners.iter().map(|c| c.point).collect();
        let tree = KdTree::new(&corners);
        let mut found = Vec::new();
        for p in &corners {
            tree.nearest_k(*p, 2, &mut found);
            if let Some(&(d, _)) = found.get(1) {
                // Lattice points are moved by up to 0.56 cells: two corners must be more than two
                // cells apart to stay off each other's neighbours.
                self.add(*p, d.sqrt() / 2.2);
            }
        }
    }

    /// Adds short closed curves.
    fn add_loops(&mut self, features: &Features) {
        for curve in features.curves.iter().filter(|c| c.closed) {
            // Eight edges per turn of a closed curve.
            let s = length(curve) / 8.0;
            curve.points.iter().for_each(|p| self.add(*p, s));
        }
    }

    /// Adds curves next to each other.
    fn add_curves(&mut self, features: &Features) {
        let samples = Samples::from_features(features, self.size);
        let tree = KdTree::new(&samples.points);
        let mut found = Vec::new();
        for (&p, &k) in samples.points.iter().zip(&samples.curves) {
            tree.nearest_k(p, 12, &mut found);
            for &(d, other) in &found {
                let (d, other) = (d.sqrt(), samples.curves[other as usize]);
                if other != k
                    && d < self.size
                    // Curves diverge from a shared corner; there they are close without crowding.
                    && d < 0.4 * way_to_shared_corner(features, [k, other], p)
                {
                    self.add(p, d);
                }
            }
        }
    }
}

/// Evenly spaced points on all curves, each with its curve.
struct Samples {
    points: Vec<Point3>,
    curves: Vec<usize>,
}

impl Samples {
    fn from_features(features: &Features, size: f64) -> Self {
        let mut samples = Self {
            points: Vec::new(),
            curves: Vec::new(),
        };
        for (k, curve) in features.curves.iter().enumerate() {
            // Spacing of the samples, in sizes or fifths of the length of the curve.
            let spacing = 0.2 * size.min(length(curve) / 5.0);
            let mut since = f64::INFINITY;
            for w in curve.points.windows(2) {
                since += norm(sub(w[1], w[0]));
                if since > spacing {
                    samples.points.push(midpoint(w[0], w[1]));
                    samples.curves.push(k);
                    since = 0.0;
                }
            }
        }
        samples
    }
}

fn length(curve: &FeatureCurve) -> f64 {
    curve.points.windows(2).map(|w| norm(sub(w[1], w[0]))).sum()
}

/// Returns the distance from a point to the nearest common corner of two curves; infinite without
/// one.
fn way_to_shared_corner(features: &Features, pair: [usize; 2], p: Point3) -> f64 {
    let [mine, theirs] = pair.map(|k| &features.curves[k].corners);
    mine.iter()
        .flatten()
        .filter(|c| theirs.iter().flatten().any(|o| o == *c))
        .map(|&c| norm(sub(features.corners[c as usize].point, p)))
        .fold(f64::INFINITY, f64::min)
}

impl Crowd {
    /// Collects the points where features of any one solid are closer together than a mesh of this
    /// size resolves, and `others`, given with the target edge length there.
    pub(crate) fn new(solids: &[&Features], others: &[(Point3, f64)], size: f64) -> Self {
        let mut wishes = Wishes {
            places: others.iter().map(|p| p.0).collect(),
            sizes: others.iter().map(|p| p.1).collect(),
            size,
        };
        for features in solids {
            wishes.add_corners(features);
            wishes.add_loops(features);
            wishes.add_curves(features);
        }
        Self {
            tree: KdTree::new(&wishes.places),
            wishes,
        }
    }

    /// Creates target edge lengths at given points; `size` is the length elsewhere.
    pub(crate) fn of_places(places: &[(Point3, f64)], size: f64) -> Self {
        let wishes = Wishes {
            places: places.iter().map(|p| p.0).collect(),
            sizes: places.iter().map(|p| p.1).collect(),
            size,
        };
        Self {
            tree: KdTree::new(&wishes.places),
            wishes,
        }
    }

    /// Returns the points with the target edge length at each.
    pub(crate) fn places(&self) -> Vec<(Point3, f64)> {
        let sizes = self.wishes.sizes.iter().copied();
        self.wishes.places.iter().copied().zip(sizes).collect()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.wishes.sizes.is_empty()
    }

    /// Returns the target edge length at a point; infinite away from close features. At distance d
    /// from a recorded point it is at least d. `last` caches the deciding point, since the next
    /// query is usually close.
    pub(crate) fn size_at(&self, p: Point3, last: &mut Vec<(f64, u32)>) -> f64 {
        let (reach, wishes) = (self.wishes.size, &self.wishes);
        let size = |d: f64, i: u32| wishes.sizes[i as usize].max(d.sqrt());
        let mut wanted = f64::INFINITY;
        if let Some(&(_, i)) = last.first() {
            wanted = size(distance_squared(wishes.places[i as usize], p), i);
        }
        let within = |wanted: f64| wanted.min(reach).powi(2);
        self.tree.near(p, within(wanted), &mut |d, i| {
            let s = size(d, i);
            if s < wanted {
                wanted = s;
                last.clear();
                last.push((d, i));
            }
            within(wanted)
        });
        if wanted < reach {
            wanted
        } else {
            f64::INFINITY
        }
    }
}
