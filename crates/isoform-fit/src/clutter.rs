//! Clutter around a part: other objects, and the tables and walls that it touches.

pub(crate) mod kind;
mod plane;

use self::kind::ClutterKind;
use self::plane::Plane;
use crate::Template;
use crate::feet::CachedFeet;
use crate::outliers::Neighbourhood;
use crate::point_distances::{PointDistances, measure_points};
use crate::polish::Polish;
use crate::report::Fit;
use crate::report::finding::Finding;
use crate::thresholds::FAR_DEVIATIONS;
use isoform_geom::{KdTree, Point3};

/// A classifier of the points of a scan that do not belong to its part.
pub struct Clutter<'a> {
    /// Classifier of stray points; `None` if there are few of them.
    strays: Option<&'a Neighbourhood>,
    n_strays: usize,
    planes: Vec<Plane>,
    /// Sampled points on none of the planes.
    rest: Vec<Point3>,
    tree: KdTree,
    /// Class of the component of each of these points; `None` for the largest component, the part.
    component: Vec<Option<ClutterKind>>,
    n_sampled: usize,
}

impl<'a> Clutter<'a> {
    /// Analyses the first points of a random order; `count` is the number of all points. Samples of
    /// fewer than 48 points are not searched for planes.
    pub(crate) fn find(
        (points, order): (&[Point3], &[u32]),
        count: usize,
        near: &'a Neighbourhood,
        has_strays: bool,
    ) -> Self {
        // A sample suffices; every trial plane is compared with all of its points.
        let some = order.iter().take(3000).map(|&i| points[i as usize]);
        let mut rest: Vec<Point3> = some.collect();
        let n_sampled = rest.len();
        let strays = has_strays.then_some(near);
        if let Some(near) = strays {
            let mut found = Vec::new();
            rest.retain(|p| !near.is_stray(*p, &mut found));
        }
        let n_strays = n_sampled - rest.len();
        // A sample is sparser than the points.
        let spacing = near.spacing * (count as f64 / n_sampled.max(1) as f64).sqrt();
        let planes = take_planes(&mut rest);
        let tree = KdTree::new(&rest);
        Self {
            // Points nearer than four spacings of the sample are connected.
            component: components(&rest, &tree, 4.0 * spacing),
            strays,
            n_strays,
            planes,
            rest,
            tree,
            n_sampled,
        }
    }

    /// Returns the share of the sampled points that are clutter of this kind.
    pub fn share(&self, why: ClutterKind) -> f64 {
        let of_component = self.component.iter().filter(|c| **c == Some(why)).count();
        let count = match why {
            ClutterKind::Stray => self.n_strays + of_component,
            ClutterKind::Plane => self.n_sampled - self.n_strays - self.rest.len(),
            ClutterKind::Apart => of_component,
        };
        count as f64 / self.n_sampled.max(1) as f64
    }

    /// Returns the planes whose points surround the part, each as a point and its unit normal.
    pub fn supports(&self) -> impl Iterator<Item = (Point3, Point3)> + '_ {
        let around = self.planes.iter().filter(|plane| plane.is_around);
        around.map(|plane| (plane.at, plane.normal))
    }

    /// Returns true if a point lies on a plane that surrounds the part, within its outline or
    /// beyond.
    pub fn is_on_support(&self, p: Point3) -> bool {
        let mut around = self.planes.iter().filter(|plane| plane.is_around);
        around.any(|plane| plane.is_level(p))
    }

    /// Classifies a point; `None` if it belongs to the part.
    pub fn classify(&self, p: Point3) -> Option<ClutterKind> {
        let is_stray = |near: &Neighbourhood| near.is_stray(p, &mut Vec::new());
        if self.strays.is_some_and(is_stray) {
            return Some(ClutterKind::Stray);
        }
        if self.planes.iter().any(|plane| plane.holds(p)) {
            return Some(ClutterKind::Plane);
        }
        let nearest = self.tree.nearest(p);
        nearest.and_then(|(i, _)| self.component[i])
    }
}

impl Clutter<'_> {
    /// Flags the fitted points that lie on a plane of the clutter, within its outline, and far off
    /// the model.
    pub fn fringe(&self, fit: &Fit, points: &[Point3]) -> Vec<bool> {
        let limit = FAR_DEVIATIONS * Polish::scale(&fit.residuals);
        let is_level = |p: &Point3| self.planes.iter().any(|plane| plane.is_level(*p));
        let all = points.iter().zip(&fit.residuals);
        all.map(|(p, r)| (r.is_nan() || r.abs() > limit) && is_level(p))
            .collect()
    }
}

impl std::fmt::Debug for Clutter<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Clutter")
            .field("on_planes", &self.share(ClutterKind::Plane))
            .field("apart", &self.share(ClutterKind::Apart))
            .field("strays", &self.share(ClutterKind::Stray))
            .finish()
    }
}

impl Fit {
    /// Extends the fit of some points to all: `kinds` holds the kind of clutter for which a point
    /// was left out, by point. Points left out get residuals and parts, but no weight; stray ones
    /// count as outliers.
    pub fn with_left_out(
        mut self,
        template: &dyn Template,
        points: &[Point3],
        kinds: &[Option<ClutterKind>],
    ) -> Self {
        let measured = measure_left_out(template, &self.values(), points, kinds);
        let n = measured.residuals.len();
        let strays = kinds
            .iter()
            .filter(|b| **b == Some(ClutterKind::Stray))
            .count();
        self.residuals = merged(kinds, &self.residuals, &measured.residuals);
        self.parts = merged(kinds, &self.parts, &measured.parts());
        self.weights = merged(kinds, &self.weights, &vec![0.0; n]);
        self.outliers = merged(kinds, &self.outliers, &vec![true; n]);
        self.n_points = points.len();
        self.n_outliers += strays;
        self.n_left_out = n - strays;
        if strays > 0 {
            // The strays that remain near the part may form groups by chance.
            self.drop_findings(|f| matches!(f, Finding::Together { .. }));
        }
        self
    }
}

/// Computes the distances of the points that were left out.
fn measure_left_out(
    template: &dyn Template,
    a: &[f64],
    points: &[Point3],
    kinds: &[Option<ClutterKind>],
) -> PointDistances {
    let all = points.iter().zip(kinds);
    let left_out = all.filter(|(_, b)| b.is_some()).map(|(p, _)| *p);
    let distance = template.distance().map(CachedFeet::new);
    measure_points(
        template,
        distance.as_ref(),
        &left_out.collect::<Vec<_>>(),
        a,
    )
}

/// Merges values of kept points and of those left out, in the order of all points.
fn merged<T: Copy>(kinds: &[Option<ClutterKind>], kept: &[T], left_out: &[T]) -> Vec<T> {
    let (mut kept, mut left_out) = (kept.iter(), left_out.iter());
    let of = |b: &Option<ClutterKind>| match b {
        Some(_) => left_out.next(),
        None => kept.next(),
    };
    let values = kinds.iter().map(of);
    values.map(|v| *v.expect("a value by point")).collect()
}

/// Removes the points on tables and walls. Returns these planes, at most three: a table and two
/// walls.
fn take_planes(points: &mut Vec<Point3>) -> Vec<Plane> {
    let mut planes = Vec::new();
    while planes.len() < 3 && points.len() >= 48 {
        let Some(plane) = Plane::find(points) else {
            break;
        };
        points.retain(|p| !plane.holds(*p));
        planes.push(plane);
    }
    planes
}

/// Classifies each point by its connected component: `None` in the largest one, else `Stray` in
/// components of fewer than ten points, else `Apart`.
fn components(points: &[Point3], tree: &KdTree, reach: f64) -> Vec<Option<ClutterKind>> {
    let mut component = vec![usize::MAX; points.len()];
    let mut sizes: Vec<usize> = Vec::new();
    for start in 0..points.len() {
        if component[start] == usize::MAX {
            let own = sizes.len();
            sizes.push(flood(points, tree, reach, start, own, &mut component));
        }
    }
    let largest = (0..sizes.len()).rev().max_by_key(|&k| sizes[k]);
    let kind = |k: usize| match sizes[k] {
        _ if Some(k) == largest => None,
        0..10 => Some(ClutterKind::Stray),
        _ => Some(ClutterKind::Apart),
    };
    component.into_iter().map(kind).collect()
}

/// Assigns the number `own` to the component of a point. Returns its number of points.
fn flood(
    points: &[Point3],
    tree: &KdTree,
    reach: f64,
    start: usize,
    own: usize,
    component: &mut [usize],
) -> usize {
    let (mut size, mut open) = (0, vec![start]);
    component[start] = own;
    while let Some(i) = open.pop() {
        size += 1;
        tree.near(points[i], reach * reach, &mut |_, j| {
            let j = j as usize;
            if component[j] == usize::MAX {
                component[j] = own;
                open.push(j);
            }
            reach * reach
        });
    }
    size
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::dot;

    fn with_sphere<T>(more: impl Iterator<Item = Point3>, look: impl Fn(&Clutter<'_>) -> T) -> T {
        let mut random = fastrand::Rng::with_seed(5);
        let mut points: Vec<Point3> = Vec::new();
        while points.len() < 2000 {
            let p: Point3 = std::array::from_fn(|_| 2.0 * random.f64() - 1.0);
            let r = dot(p, p).sqrt();
            if r < 1.0 && r > 0.1 {
                points.push(p.map(|v| v / r));
            }
        }
        points.extend(more);
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        random.shuffle(&mut order);
        let near = Neighbourhood::new(&points, &order);
        look(&Clutter::find(
            (&points, &order),
            points.len(),
            &near,
            false,
        ))
    }

    #[test]
    fn a_ball_alone_has_nothing_beside_it() {
        with_sphere(std::iter::empty(), |alone| {
            let shares = [ClutterKind::Plane, ClutterKind::Apart, ClutterKind::Stray]
                .map(|b| alone.share(b));
            assert_eq!(shares, [0.0; 3]);
        });
    }

    #[test]
    fn a_table_is_found() {
        let mut random = fastrand::Rng::with_seed(6);
        let mut table = || [6.0 * random.f64() - 3.0, 6.0 * random.f64() - 3.0, -1.0];
        with_sphere((0..500).map(|_| table()), |found| {
            // A circle of 1.08 radii about the ball's foot covers π 1.08² / 36 of the table.
            let share = found.share(ClutterKind::Plane);
            assert!((share - 0.2 * (1.0 - 0.102)).abs() < 0.01, "{found:?}");
            assert_eq!(found.classify([2.0, 2.0, -1.0]), Some(ClutterKind::Plane));
            assert_eq!(found.classify([0.3, 0.3, -0.9]), None);
        });
    }

    #[test]
    fn another_object_is_found() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut of_blob = |low: f64| low + 0.3 * random.f64();
        let blob = (0..200).map(|_| [of_blob(4.0), of_blob(0.0), of_blob(0.0)]);
        with_sphere(blob, |found| {
            let share = found.share(ClutterKind::Apart);
            assert!((share - 200.0 / 2200.0).abs() < 0.005, "{found:?}");
            assert_eq!(found.classify([4.1, 0.1, 0.1]), Some(ClutterKind::Apart));
            assert_eq!(found.classify([1.0, 0.0, 0.0]), None);
        });
    }
}
