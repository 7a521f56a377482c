//! Isolated outliers, found by the distance to their neighbours.
//!
//! A point is isolated when the mean distance d to its [`NEIGHBOURS`] nearest neighbours is far
//! above the median of log d, by [`DEVIATIONS`] robust deviations. Scans of uneven density have
//! sparse regions that are not outliers: a candidate is kept if its neighbours lie in a plane with
//! it and are as sparse as itself. Clusters are not isolated; the loss of the polish is for them.

use isoform_geom::{KdTree, Point3, dot, sub};
use isoform_num::linalg::symmetric_eigen;

/// Neighbours whose mean distance is taken. Fewer let pairs of outliers pass, more cut into edges
/// of the scan.
const NEIGHBOURS: usize = 8;
/// Robust standard deviations of log d above its median.
const DEVIATIONS: f64 = 3.0;
/// A candidate lies at least this many median distances from its neighbours, however even the scan.
const LEAST_RATIO: f64 = 1.5;
/// Share of the variance of a neighbourhood across its plane; 1/3 for a ball, 0 for a plane.
const FLATNESS: f64 = 0.02;
/// A sparse but flat neighbourhood is sparse throughout: d no more than this times that of the
/// neighbours.
const EVENNESS: f64 = 1.5;
/// Most points in the tree: the spacing of larger clouds is that of a sample.
const MOST: usize = 200_000;
/// Points whose distances give median and deviation.
const SAMPLE: usize = 1024;
/// Points whose neighbours' deviations from planes tell the local noise.
const PROBES: usize = 150;
/// Share of isolated points from which the data count as having outliers; scans without them show
/// next to none.
pub(crate) const HAS_OUTLIERS: f64 = 0.01;
/// Off the plane of its neighbours is a point farther from it than this many of their own
/// deviations...
const OFF_PLANE: f64 = 4.0;
/// ... and than this share of the spacing, which curved surfaces stay within.
const OFF_SPACINGS: f64 = 0.3;
/// More than this share is never dropped before the search.
pub(crate) const MOST_DROPPED: f64 = 0.4;

/// What is known about the neighbourhood of points.
pub(crate) struct Neighbourhood {
    /// Tree over the points, or over a sample of them.
    pub(crate) tree: KdTree,
    /// Median of the mean distance to the neighbours.
    pub(crate) spacing: f64,
    sample: Vec<Point3>,
    threshold: f64,
    /// Mean distances of the first points in the random order.
    known: Vec<f64>,
}

impl Neighbourhood {
    /// `order` is a random order of the points.
    pub(crate) fn new(points: &[Point3], order: &[u32]) -> Self {
        let sample: Vec<Point3> = if points.len() <= MOST {
            points.to_vec()
        } else {
            order[..MOST].iter().map(|&i| points[i as usize]).collect()
        };
        let tree = KdTree::new(&sample);
        let mut found = Vec::new();
        let known: Vec<f64> = order
            .iter()
            .take(SAMPLE)
            .map(|&i| mean_distance(&tree, points[i as usize], &mut found))
            .collect();
        let mut d: Vec<f64> = known.iter().filter(|d| **d > 0.0).map(|d| d.ln()).collect();
        if d.is_empty() {
            return Self {
                tree,
                spacing: 0.0,
                sample,
                threshold: f64::INFINITY,
                known,
            };
        }
        let centre = median(&mut d);
        let mut off: Vec<f64> = d.iter().map(|v| (v - centre).abs()).collect();
        let spread = 1.4826 * median(&mut off);
        let threshold = (centre + (DEVIATIONS * spread).max(LEAST_RATIO.ln())).exp();
        Self {
            tree,
            spacing: centre.exp(),
            sample,
            threshold,
            known,
        }
    }

    /// Deviation of some points' neighbours from the planes through them, the median and the first
    /// decile: the noise with, and mostly without, what curvature and edges add at this density.
    pub(crate) fn local_noise(&self, points: &[Point3], order: &[u32]) -> (f64, f64) {
        let mut found = Vec::new();
        let mut off: Vec<f64> = order
            .iter()
            .take(PROBES)
            .filter_map(|&i| {
                self.tree
                    .nearest_k(points[i as usize], 2 * NEIGHBOURS, &mut found);
                let around: Vec<Point3> = found
                    .iter()
                    .map(|&(_, i)| self.sample[i as usize])
                    .collect();
                plane(&around).map(|(_, _, rms)| rms)
            })
            .collect();
        let typical = median(&mut off);
        off.sort_unstable_by(f64::total_cmp);
        (typical, off.get(off.len() / 10).copied().unwrap_or(0.0))
    }

    /// The points of the tree.
    pub(crate) fn sampled(&self) -> &[Point3] {
        &self.sample
    }

    /// Mean distance of a point of the tree to its neighbours.
    pub(crate) fn spacing_at(&self, at: usize, found: &mut Vec<(f64, u32)>) -> f64 {
        mean_distance(&self.tree, self.sample[at], found)
    }

    /// Whether the point, the k-th in the random order, is isolated.
    fn is_isolated(&self, p: Point3, k: usize, found: &mut Vec<(f64, u32)>) -> bool {
        if self.known.get(k).is_some_and(|d| *d <= self.threshold) {
            return false;
        }
        let d = mean_distance(&self.tree, p, found);
        if d <= self.threshold {
            return false;
        }
        let around: Vec<Point3> = found
            .iter()
            .map(|&(_, i)| self.sample[i as usize])
            .collect();
        if flatness(&around) > FLATNESS {
            return true;
        }
        let mut theirs: Vec<f64> = around
            .iter()
            .map(|q| mean_distance(&self.tree, *q, found))
            .collect();
        d > EVENNESS * median(&mut theirs)
    }

    /// The first `want` points in `order` that are not isolated, and the share of isolated ones
    /// among those looked at.
    pub(crate) fn keep(&self, points: &[Point3], order: &[u32], want: usize) -> (Vec<Point3>, f64) {
        let (mut kept, mut seen, mut found) = (Vec::with_capacity(want), 0, Vec::new());
        for (k, &i) in order.iter().enumerate() {
            if kept.len() == want {
                break;
            }
            seen += 1;
            if !self.is_isolated(points[i as usize], k, &mut found) {
                kept.push(points[i as usize]);
            }
        }
        let share = 1.0 - kept.len() as f64 / seen.max(1) as f64;
        if share > HAS_OUTLIERS {
            // With outliers about, sparse regions get no benefit of the doubt.
            kept.retain(|p| !self.is_stray(*p, &mut found));
        }
        (kept, share)
    }

    /// Whether a point is sparse, whatever its neighbours are, or off their plane: an outlier where
    /// there are many.
    pub(crate) fn is_stray(&self, p: Point3, found: &mut Vec<(f64, u32)>) -> bool {
        self.is_off_plane(p, found) || mean_distance(&self.tree, p, found) > self.threshold
    }

    /// Points that lie off a fitted model while their neighbours do not: outliers. Where neighbours
    /// are off together, the model is.
    pub(crate) fn drop_lone(
        &self,
        points: &mut Vec<Point3>,
        limit: f64,
        residuals: &dyn Fn(&[Point3]) -> Vec<f64>,
    ) {
        let off = residuals(points);
        let mut found = Vec::new();
        let mut at = 0;
        points.retain(|p| {
            at += 1;
            if off[at - 1].abs() <= limit {
                return true;
            }
            self.tree.nearest_k(*p, NEIGHBOURS + 1, &mut found);
            let around: Vec<Point3> = found
                .iter()
                .map(|&(_, i)| self.sample[i as usize])
                .filter(|q| q != p)
                .collect();
            let alike = residuals(&around)
                .iter()
                .filter(|r| r.abs() > limit)
                .count();
            2 * alike > around.len()
        });
    }

    /// Whether the neighbours lie in a plane and the point does not: an outlier too near the
    /// surface to be isolated. At edges the neighbours lie in no plane, so that edges stay.
    fn is_off_plane(&self, p: Point3, found: &mut Vec<(f64, u32)>) -> bool {
        self.tree.nearest_k(p, NEIGHBOURS + 1, found);
        let around: Vec<Point3> = found
            .iter()
            .map(|&(_, i)| self.sample[i as usize])
            .filter(|q| *q != p)
            .collect();
        let Some((centre, normal, rms)) = plane(&around) else {
            return false;
        };
        dot(sub(p, centre), normal).abs() > (OFF_PLANE * rms).max(OFF_SPACINGS * self.spacing)
    }
}

/// Mean distance to the nearest neighbours, the point itself left out if it is in the tree.
fn mean_distance(tree: &KdTree, p: Point3, found: &mut Vec<(f64, u32)>) -> f64 {
    tree.nearest_k(p, NEIGHBOURS + 1, found);
    let others = &found[found.len().min(1)..];
    others.iter().map(|f| f.0.sqrt()).sum::<f64>() / others.len().max(1) as f64
}

/// Least share of the variance of the points along one direction.
fn flatness(points: &[Point3]) -> f64 {
    let (w, _) = symmetric_eigen(&scatter(points).1, 3);
    let sum: f64 = w.iter().sum();
    if sum > 0.0 {
        (w[0] / sum).max(0.0)
    } else {
        0.0
    }
}

/// Mean and scatter matrix.
fn scatter(points: &[Point3]) -> (Point3, [f64; 9]) {
    let n = points.len().max(1) as f64;
    let mut centre = [0.0; 3];
    for p in points {
        for i in 0..3 {
            centre[i] += p[i] / n;
        }
    }
    let mut c = [0.0; 9];
    for p in points {
        let d = sub(*p, centre);
        for i in 0..3 {
            for j in 0..3 {
                c[3 * i + j] += d[i] * d[j];
            }
        }
    }
    (centre, c)
}

/// The plane of best fit: a point, the normal and the root of the mean square distance; none for a
/// line or less.
pub(crate) fn plane(points: &[Point3]) -> Option<(Point3, Point3, f64)> {
    let (centre, c) = scatter(points);
    let (w, v) = symmetric_eigen(&c, 3);
    let is_plane = points.len() > 4 && w[1] > 1e-3 * w[2];
    is_plane.then(|| {
        (
            centre,
            [v[0], v[1], v[2]],
            (w[0].max(0.0) / (points.len() - 3) as f64).sqrt(),
        )
    })
}

/// Upper median; reorders.
pub(crate) fn median(v: &mut [f64]) -> f64 {
    if v.is_empty() {
        return 0.0;
    }
    let at = v.len() / 2;
    *v.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(n: usize, density: impl Fn(f64) -> f64) -> Vec<Point3> {
        let mut random = fastrand::Rng::with_seed(3);
        let mut points = Vec::new();
        while points.len() < n {
            let (u, v) = (random.f64(), random.f64());
            if random.f64() < density(u) {
                points.push([u, v, 1e-4 * random.f64()]);
            }
        }
        points
    }
    fn share(points: &[Point3]) -> f64 {
        let order: Vec<u32> = (0..points.len() as u32).collect();
        Neighbourhood::new(points, &order)
            .keep(points, &order, points.len())
            .1
    }

    #[test]
    fn uneven_density_is_no_reason() {
        assert!(share(&plane(5000, |_| 1.0)) < 2e-3);
        // 20 times sparser at one end.
        assert!(share(&plane(5000, |u| 0.05 + 0.95 * u)) < 5e-3);
        assert!(share(&plane(5000, |u| if u < 0.3 { 0.02 } else { 1.0 })) < 5e-3);
    }

    #[test]
    fn a_cloud_around_a_plane_is_found() {
        let mut points = plane(5000, |_| 1.0);
        let mut random = fastrand::Rng::with_seed(4);
        points.extend((0..500).map(|_| [random.f64(), random.f64(), random.f64() - 0.5]));
        random.shuffle(&mut points);
        let found = share(&points);
        assert!(found > 0.7 / 11.0 && found < 1.0 / 11.0, "{found}");
    }
}
