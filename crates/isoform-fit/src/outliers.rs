//! Isolated outliers, found by the distance to their neighbours.
//!
//! A point is isolated if log d of the mean distance d to its [`SPACING_NEIGHBOURS`] nearest
//! neighbours is above the median by three robust deviations. Scans of uneven density have sparse
//! regions that are not outliers: a candidate is kept if its neighbours lie in a plane with it and
//! have similar distances. Clusters are not isolated; they are left to the loss of the polish.

use isoform_geom::{KdTree, Point3, dot, sub};
use isoform_num::linalg::symmetric_eigen;

/// Number of neighbours whose mean distance is taken. With fewer, pairs of outliers pass; with
/// more, edges of the scan are cut.
const SPACING_NEIGHBOURS: usize = 8;
/// Maximum number of points in the tree: the spacing of larger clouds is that of a sample.
pub(crate) const MAX_TREE_POINTS: usize = 200_000;
/// Number of points whose distances give median and deviation.
const SPACING_SAMPLE_POINTS: usize = 1024;
/// Ratio of the standard deviation of normal numbers to the median of their absolute values.
pub(crate) const DEVIATION_PER_MEDIAN: f64 = 1.4826;
/// Share of isolated points above which the data count as having outliers; scans without outliers
/// have almost none.
pub(crate) const MIN_OUTLIER_SHARE: f64 = 0.01;
/// Largest share of points that is dropped before the search.
pub(crate) const MAX_DROPPED_SHARE: f64 = 0.4;

/// Nearest-neighbour statistics of points.
pub(crate) struct Neighbourhood {
    /// Tree over the points, or over a sample of them.
    pub(crate) tree: KdTree,
    /// Median of the mean distance to the neighbours.
    pub(crate) spacing: f64,
    sample: Vec<Point3>,
    threshold: f64,
    /// Mean distances of the first points in the random order to their neighbours.
    known: Vec<f64>,
}

/// Standard deviation of neighbours from planes through them: the noise with the contribution of
/// curvature and edges at the density of the points.
pub(crate) struct LocalNoise {
    /// Median over the neighbourhoods.
    pub(crate) typical: f64,
    /// First decile, mostly without that contribution.
    pub(crate) least: f64,
}

/// A plane of best fit.
pub(crate) struct BestPlane {
    pub(crate) at: Point3,
    pub(crate) normal: Point3,
    /// Root of the mean square distance of the points.
    rms: f64,
}

impl BestPlane {
    /// Returns the signed distance of a point.
    pub(crate) fn height(&self, p: Point3) -> f64 {
        dot(sub(p, self.at), self.normal)
    }
}

impl Neighbourhood {
    /// Analyses points; `order` is a random order of them.
    pub(crate) fn new(points: &[Point3], order: &[u32]) -> Self {
        let sample: Vec<Point3> = if points.len() <= MAX_TREE_POINTS {
            points.to_vec()
        } else {
            order[..MAX_TREE_POINTS]
                .iter()
                .map(|&i| points[i as usize])
                .collect()
        };
        let first = order
            .iter()
            .take(SPACING_SAMPLE_POINTS)
            .map(|&i| points[i as usize]);
        let first: Vec<Point3> = first.collect();
        Self::with_tree(sample, first)
    }

    /// Analyses a sample in a random order.
    pub(crate) fn of_sample(sample: Vec<Point3>) -> Self {
        let first = sample[..SPACING_SAMPLE_POINTS.min(sample.len())].to_vec();
        Self::with_tree(sample, first)
    }

    /// Builds the tree of `sample`, and computes the spacing from the points `first`.
    fn with_tree(sample: Vec<Point3>, first: Vec<Point3>) -> Self {
        let tree = KdTree::new(&sample);
        let mut found = Vec::new();
        let first = first.into_iter();
        let known: Vec<f64> = first.map(|p| mean_distance(&tree, p, &mut found)).collect();
        let (spacing, threshold) = spacing_and_threshold(&known);
        Self {
            tree,
            spacing,
            sample,
            threshold,
            known,
        }
    }

    /// Estimates the noise from planes through the neighbours of 150 points.
    pub(crate) fn local_noise(&self, points: &[Point3], order: &[u32]) -> LocalNoise {
        let mut found = Vec::new();
        let mut deviation = |i: &u32| {
            let p = points[*i as usize];
            self.tree.nearest_k(p, 2 * SPACING_NEIGHBOURS, &mut found);
            best_plane(&self.places(&found)).map(|plane| plane.rms)
        };
        let probes = order.iter().take(150);
        let mut off: Vec<f64> = probes.filter_map(&mut deviation).collect();
        let typical = median(&mut off);
        off.sort_unstable_by(f64::total_cmp);
        LocalNoise {
            typical,
            least: off.get(off.len() / 10).copied().unwrap_or(0.0),
        }
    }

    /// Returns the points of the tree.
    pub(crate) fn into_sample(self) -> Vec<Point3> {
        self.sample
    }

    /// Returns the points of the tree.
    pub(crate) fn sampled(&self) -> &[Point3] {
        &self.sample
    }

    /// Returns the points of the tree with the indices found.
    fn places(&self, found: &[(f64, u32)]) -> Vec<Point3> {
        found.iter().map(|f| self.sample[f.1 as usize]).collect()
    }

    /// Returns the neighbours of a point, without the point itself.
    fn others(&self, p: Point3, found: &mut Vec<(f64, u32)>) -> Vec<Point3> {
        self.tree.nearest_k(p, SPACING_NEIGHBOURS + 1, found);
        let mut others = self.places(found);
        others.retain(|q| *q != p);
        others
    }

    /// Returns the mean distance of a point of the tree to its neighbours.
    pub(crate) fn spacing_at(&self, at: usize, found: &mut Vec<(f64, u32)>) -> f64 {
        mean_distance(&self.tree, self.sample[at], found)
    }

    /// Returns true if the point, the k-th in the random order, is isolated.
    fn is_isolated(&self, p: Point3, k: usize, found: &mut Vec<(f64, u32)>) -> bool {
        if self.known.get(k).is_some_and(|d| *d <= self.threshold) {
            return false;
        }
        let d = mean_distance(&self.tree, p, found);
        if d <= self.threshold {
            return false;
        }
        let around = self.places(found);
        // The variance across the plane of a neighbourhood is 1/3 of all for a ball, 0 for a plane.
        if flatness(&around) > 0.02 {
            return true;
        }
        // A sparse but flat neighbourhood is kept if its points are about equally sparse.
        let theirs = around.iter().map(|q| mean_distance(&self.tree, *q, found));
        d > 1.5 * median(&mut theirs.collect::<Vec<_>>())
    }

    /// Returns the first `want` points in `order` that are not isolated, and the share of isolated
    /// ones among the points examined.
    pub(crate) fn keep(&self, points: &[Point3], order: &[u32], want: usize) -> (Vec<Point3>, f64) {
        let (mut kept, mut seen, mut found) =
            (Vec::with_capacity(want.min(order.len())), 0, Vec::new());
        for (k, p) in order.iter().map(|&i| points[i as usize]).enumerate() {
            if kept.len() == want {
                break;
            }
            seen += 1;
            if !self.is_isolated(p, k, &mut found) {
                kept.push(p);
            }
        }
        let share = 1.0 - kept.len() as f64 / seen.max(1) as f64;
        if share > MIN_OUTLIER_SHARE {
            // If there are outliers, sparse points are dropped, whatever their neighbours are.
            kept.retain(|p| !self.is_stray(*p, &mut found));
        }
        (kept, share)
    }

    /// Returns true if a point is sparse, whatever its neighbours are, or off their plane: an
    /// outlier in scans with many.
    pub(crate) fn is_stray(&self, p: Point3, found: &mut Vec<(f64, u32)>) -> bool {
        self.is_off_plane(p, found) || mean_distance(&self.tree, p, found) > self.threshold
    }

    /// Drops points off a fitted model whose neighbours are not: outliers. If most neighbours are
    /// off, too, the model is wrong.
    pub(crate) fn drop_lone(
        &self,
        points: &mut Vec<Point3>,
        limit: f64,
        residuals: &dyn Fn(&[Point3]) -> Vec<f64>,
    ) {
        let mut off = residuals(points).into_iter();
        let mut found = Vec::new();
        points.retain(|p| {
            let r = off.next().expect("a residual by point");
            r.abs() <= limit || {
                let around = self.others(*p, &mut found);
                let theirs = residuals(&around);
                let alike = theirs.iter().filter(|r| r.abs() > limit).count();
                2 * alike > around.len()
            }
        });
    }

    /// Returns true if the neighbours lie in a plane and the point does not: an outlier too near
    /// the surface to be isolated. At edges the neighbours lie in no plane, so edges are kept. The
    /// point is off by four of the neighbours' deviations and by 0.3 spacings, more than curved
    /// surfaces are.
    fn is_off_plane(&self, p: Point3, found: &mut Vec<(f64, u32)>) -> bool {
        best_plane(&self.others(p, found)).is_some_and(|plane| {
            let limit = (4.0 * plane.rms).max(0.3 * self.spacing);
            plane.height(p).abs() > limit
        })
    }
}

/// Returns the median of mean distances, and the threshold above which a point can be isolated:
/// three robust deviations of the logarithm, and at least 1.5 medians for even scans.
fn spacing_and_threshold(known: &[f64]) -> (f64, f64) {
    let positive = known.iter().filter(|d| **d > 0.0);
    let mut logs: Vec<f64> = positive.map(|d| d.ln()).collect();
    if logs.is_empty() {
        return (0.0, f64::INFINITY);
    }
    let centre = median(&mut logs);
    let mut off: Vec<f64> = logs.iter().map(|v| (v - centre).abs()).collect();
    let spread = robust_deviation(&mut off);
    let threshold = (centre + (3.0 * spread).max(1.5_f64.ln())).exp();
    (centre.exp(), threshold)
}

/// Returns the mean distance to the nearest neighbours, without the point itself if it is in the
/// tree.
fn mean_distance(tree: &KdTree, p: Point3, found: &mut Vec<(f64, u32)>) -> f64 {
    tree.nearest_k(p, SPACING_NEIGHBOURS + 1, found);
    let others = &found[found.len().min(1)..];
    others.iter().map(|f| f.0.sqrt()).sum::<f64>() / others.len().max(1) as f64
}

/// Returns the smallest share of the variance of points along a direction.
fn flatness(points: &[Point3]) -> f64 {
    let (w, _) = symmetric_eigen(&scatter(points).1, 3);
    let sum: f64 = w.iter().sum();
    if sum > 0.0 {
        (w[0] / sum).max(0.0)
    } else {
        0.0
    }
}

/// Returns the mean and the scatter matrix.
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

/// Fits a plane; `None` if the points are on a line, or too few.
pub(crate) fn best_plane(points: &[Point3]) -> Option<BestPlane> {
    let (at, c) = scatter(points);
    let (w, v) = symmetric_eigen(&c, 3);
    let is_plane = points.len() > 4 && w[1] > 1e-3 * w[2];
    is_plane.then(|| BestPlane {
        at,
        normal: [v[0], v[1], v[2]],
        rms: (w[0].max(0.0) / (points.len() - 3) as f64).sqrt(),
    })
}

/// Returns the standard deviation of numbers about zero, from the median of their absolute values;
/// reorders them.
pub(crate) fn robust_deviation(sizes: &mut [f64]) -> f64 {
    DEVIATION_PER_MEDIAN * median(sizes)
}

/// Returns the upper median; reorders the numbers.
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
