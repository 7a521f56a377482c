//! Sizes where features crowd: corners and curves closer together than the mesh would have them.

use crate::features::{FeatureCurve, Features};
use crate::points::midpoint;
use isoform_geom::{KdTree, Point3, distance_squared, norm, sub};

/// Edges per distance between two corners: lattice points are moved by up to 0.56 cells, so that
/// two corners must be more than two cells apart to stay off each other's neighbours.
const CORNERS: f64 = 2.2;
/// Edges per distance between two curves.
const CURVES: f64 = 1.0;
/// Edges per turn of a closed curve.
const LOOP: f64 = 8.0;
/// Smallest share of the size asked for: features closer than that are left to the cutting.
const LEAST: f64 = 0.25;
/// Neighbours of a place on a curve that are looked at.
const NEAR: usize = 12;
/// Distance between places on a curve, in sizes asked for or fifths of the curve's length,
/// whichever is shorter.
const SPACING: f64 = 0.2;
/// Curves part at the corner that they share; there they are close without crowding, as long as
/// they are farther from each other than this share of the way to the corner.
const PARTING: f64 = 0.4;

/// Places with the edge length wanted there.
pub(crate) struct Crowd {
    tree: KdTree,
    wishes: Wishes,
}

/// Edge lengths wanted by place.
struct Wishes {
    places: Vec<Point3>,
    sizes: Vec<f64>,
    /// The edge length away from all places; a place farther off than this does not matter.
    size: f64,
}

impl Wishes {
    fn add(&mut self, p: Point3, s: f64) {
        if s < self.size {
            self.places.push(p);
            self.sizes.push(s.max(LEAST * self.size));
        }
    }

    /// Corners next to each other.
    fn add_corners(&mut self, features: &Features) {
        let corners: Vec<Point3> = features.corners.iter().map(|c| c.point).collect();
        let tree = KdTree::new(&corners);
        let mut found = Vec::new();
        for p in &corners {
            tree.nearest_k(*p, 2, &mut found);
            if let Some(&(d, _)) = found.get(1) {
                self.add(*p, d.sqrt() / CORNERS);
            }
        }
    }

    /// Closed curves that are short.
    fn add_loops(&mut self, features: &Features) {
        for curve in features.curves.iter().filter(|c| c.closed) {
            let s = length(curve) / LOOP;
            curve.points.iter().for_each(|p| self.add(*p, s));
        }
    }

    /// Curves next to each other.
    fn add_curves(&mut self, features: &Features) {
        let samples = Samples::of(features, self.size);
        let tree = KdTree::new(&samples.points);
        let mut found = Vec::new();
        for (&p, &k) in samples.points.iter().zip(&samples.curves) {
            tree.nearest_k(p, NEAR, &mut found);
            for &(d, other) in &found {
                let (d, other) = (d.sqrt(), samples.curves[other as usize]);
                if other != k
                    && d < CURVES * self.size
                    && d < PARTING * way_to_shared_corner(features, [k, other], p)
                {
                    self.add(p, d / CURVES);
                }
            }
        }
    }
}

/// Points on all curves, spaced evenly, each with its curve.
struct Samples {
    points: Vec<Point3>,
    curves: Vec<usize>,
}

impl Samples {
    fn of(features: &Features, size: f64) -> Self {
        let mut samples = Self {
            points: Vec::new(),
            curves: Vec::new(),
        };
        for (k, curve) in features.curves.iter().enumerate() {
            let spacing = SPACING * size.min(length(curve) / 5.0);
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

/// The distance from a point to the nearest corner that two curves share, infinite if they share
/// none.
fn way_to_shared_corner(features: &Features, pair: [usize; 2], p: Point3) -> f64 {
    let [mine, theirs] = pair.map(|k| &features.curves[k].corners);
    mine.iter()
        .flatten()
        .filter(|c| theirs.iter().flatten().any(|o| o == *c))
        .map(|&c| norm(sub(features.corners[c as usize].point, p)))
        .fold(f64::INFINITY, f64::min)
}

impl Crowd {
    /// Places where features of one solid or another are closer together than a mesh of this size
    /// resolves, and others with the edge length wanted there.
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

    /// Of places with the edge length wanted there, where `size` is that elsewhere.
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

    /// The places with the edge length wanted at each.
    pub(crate) fn places(&self) -> Vec<(Point3, f64)> {
        let sizes = self.wishes.sizes.iter().copied();
        self.wishes.places.iter().copied().zip(sizes).collect()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.wishes.sizes.is_empty()
    }

    /// The edge length wanted at a point; infinite away from crowded places. At the distance d from
    /// a place it is at least d. `last` keeps the place that decided, as the next point asked for
    /// mostly lies nearby.
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
