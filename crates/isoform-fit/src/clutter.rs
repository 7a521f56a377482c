//! What lies beside a part: other objects, and the tables and walls that it stands at.

use crate::evidence::FAR;
use crate::feet::KeptFeet;
use crate::judge::Finding;
use crate::outliers::Neighbourhood;
use crate::polish::Polish;
use crate::report::Fit;
use crate::{Template, settle};
use isoform_geom::{KdTree, Point3, across, cross, dot, sub};

/// Points that are looked at.
const LOOKED_AT: usize = 3000;
/// Points nearer than this many spacings (of the points looked at) belong together.
const TOGETHER: f64 = 4.0;
/// Planes tried: of a plane with a twentieth of the points near a seed, 60 find one in twenty.
const PLANES: usize = 200;
/// Half thickness of a plane at first, as a share of the size: rough normals of a few points stray
/// by as much.
const THICK: f64 = 0.012;
/// Half thickness then, in robust deviations of the points beyond the others: noise stays within,
/// a flange that stands on the table does not.
const THICK_DEVIATIONS: f64 = 5.0;
/// Neighbours that a plane is laid through.
const NEIGHBOURS: usize = 12;
/// Points beyond the others that make a plane a table, at least this share of all.
const LEAST: f64 = 0.005;
/// A table reaches beyond the other points by this share of their own extent.
const BEYOND: f64 = 0.03;
/// All but this share of the other points lie on one side of a table.
const UNDER: f64 = 0.02;
/// Planes taken away one after the other: a table and two walls.
const MOST_PLANES: usize = 3;

/// Components of fewer points are stray points that came together, no objects.
const SMALL: usize = 10;

/// Why a point is not the part's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beside {
    /// On a plane that has the other points on one side and reaches beyond them.
    Plane,
    /// Apart from the largest component of what is left.
    Apart,
    /// One of a few points apart; or, where there are many such, isolated or off the plane of its
    /// neighbours. An outlier.
    Stray,
}

/// Points of a scan that are not of its part.
pub struct Clutter<'a> {
    /// Tells strays, if there are many.
    strays: Option<&'a Neighbourhood>,
    n_strays: usize,
    planes: Vec<Plane>,
    /// Points looked at that are on no such plane, and what their components are: none for the
    /// part, which is the largest one.
    rest: Vec<Point3>,
    tree: KdTree,
    component: Vec<Option<Beside>>,
    looked_at: usize,
}

impl<'a> Clutter<'a> {
    /// Looks at the first points in `order`, a random order of them all. Few points have no clutter
    /// that could be told.
    pub(crate) fn find(
        points: &[Point3],
        order: &[u32],
        near: &'a Neighbourhood,
        has_strays: bool,
    ) -> Self {
        let some = order.iter().take(LOOKED_AT).map(|&i| points[i as usize]);
        let mut rest: Vec<Point3> = some.collect();
        let looked_at = rest.len();
        let (strays, mut found) = (has_strays.then_some(near), Vec::new());
        if let Some(near) = strays {
            rest.retain(|p| !near.is_stray(*p, &mut found));
        }
        let n_strays = looked_at - rest.len();
        // A sample is sparser than the points.
        let spacing = near.spacing * (points.len() as f64 / looked_at.max(1) as f64).sqrt();
        let mut planes = Vec::new();
        while planes.len() < MOST_PLANES && rest.len() >= 4 * NEIGHBOURS {
            let Some(plane) = Plane::find(&rest) else {
                break;
            };
            rest.retain(|p| !plane.holds(*p));
            planes.push(plane);
        }
        let tree = KdTree::new(&rest);
        Self {
            component: components(&rest, &tree, TOGETHER * spacing),
            strays,
            n_strays,
            planes,
            rest,
            tree,
            looked_at,
        }
    }

    /// Share of the points looked at that are beside the part for this reason.
    pub fn share(&self, why: Beside) -> f64 {
        let of_component = self.component.iter().filter(|c| **c == Some(why)).count();
        let count = match why {
            Beside::Stray => self.n_strays + of_component,
            Beside::Plane => self.looked_at - self.n_strays - self.rest.len(),
            Beside::Apart => of_component,
        };
        count as f64 / self.looked_at.max(1) as f64
    }

    /// Whether a point is beside the part, and why.
    pub fn of(&self, p: Point3) -> Option<Beside> {
        if self
            .strays
            .is_some_and(|near| near.is_stray(p, &mut Vec::new()))
        {
            return Some(Beside::Stray);
        }
        if self.planes.iter().any(|plane| plane.holds(p)) {
            return Some(Beside::Plane);
        }
        let nearest = self.tree.nearest(p);
        nearest.and_then(|(i, _)| self.component[i])
    }
}

impl Clutter<'_> {
    /// What is left of the planes beside the part, within its outline: which of the points that
    /// were fitted lie on such a plane and far off the model.
    pub fn fringe(&self, fit: &Fit, points: &[Point3]) -> Vec<bool> {
        let limit = FAR * Polish::scale(&fit.residuals);
        let is_level = |p: &Point3| self.planes.iter().any(|plane| plane.is_level(*p));
        let all = points.iter().zip(&fit.residuals);
        all.map(|(p, r)| (r.is_nan() || r.abs() > limit) && is_level(p))
            .collect()
    }
}

impl std::fmt::Debug for Clutter<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Clutter")
            .field("on_planes", &self.share(Beside::Plane))
            .field("apart", &self.share(Beside::Apart))
            .field("strays", &self.share(Beside::Stray))
            .finish()
    }
}

impl Fit {
    /// The fit of some points as one of all: those with a reason in `beside` were left out. They
    /// get residuals and parts, but no weight; strays count as outliers.
    pub fn with_left_out(
        mut self,
        template: &dyn Template,
        points: &[Point3],
        beside: &[Option<Beside>],
    ) -> Self {
        let left_out: Vec<Point3> = points
            .iter()
            .zip(beside)
            .filter(|(_, b)| b.is_some())
            .map(|(p, _)| *p)
            .collect();
        let distance = template.distance().map(KeptFeet::new);
        let measured = settle::measured(template, distance.as_ref(), &left_out, &self.values());
        fn merged<T: Copy>(beside: &[Option<Beside>], kept: &[T], left_out: &[T]) -> Vec<T> {
            let (mut kept, mut left_out) = (kept.iter(), left_out.iter());
            let of = |b: &Option<Beside>| match b {
                Some(_) => left_out.next(),
                None => kept.next(),
            };
            beside
                .iter()
                .map(of)
                .map(|v| *v.expect("a value by point"))
                .collect()
        }
        let n = left_out.len();
        let strays = beside.iter().filter(|b| **b == Some(Beside::Stray)).count();
        self.residuals = merged(beside, &self.residuals, &measured.residuals);
        self.parts = merged(beside, &self.parts, &measured.parts());
        self.weights = merged(beside, &self.weights, &vec![0.0; n]);
        self.outliers = merged(beside, &self.outliers, &vec![true; n]);
        self.n_points = points.len();
        self.n_outliers += strays;
        self.n_left_out = n - strays;
        if strays > 0 {
            // Those that remain near the part may lie together by chance.
            self.drop_findings(|f| matches!(f, Finding::Together { .. }));
        }
        self
    }
}

/// A plane with the outline of what stands on it.
struct Plane {
    at: Point3,
    normal: Point3,
    thick: f64,
    /// Two unit directions in the plane.
    axes: [Point3; 2],
    /// Convex hull of the other points seen along the normal, counterclockwise.
    outline: Vec<[f64; 2]>,
    /// How far beyond the outline a point must be.
    beyond: f64,
}

impl Plane {
    /// The plane with most points beyond the others; none where no plane has enough.
    fn find(points: &[Point3]) -> Option<Self> {
        let centre = mean(points);
        let reach = |p: &Point3| dot(sub(*p, centre), sub(*p, centre)).sqrt();
        let size = points.iter().map(reach).fold(0.0, f64::max);
        let tree = KdTree::new(points);
        let mut found = Vec::new();
        let mut best: Option<(usize, Self)> = None;
        for seed in points.iter().step_by(points.len().div_ceil(PLANES)) {
            tree.nearest_k(*seed, NEIGHBOURS, &mut found);
            let at = |k: usize| points[found[k].1 as usize];
            let (u, v) = (at(NEIGHBOURS / 3), at(NEIGHBOURS - 1));
            let normal = cross(sub(u, *seed), sub(v, *seed));
            let Some(plane) = Self::about(points, *seed, normal, THICK * size) else {
                continue;
            };
            let count = points.iter().filter(|p| plane.holds(**p)).count();
            let least = (LEAST * points.len() as f64).max(1.0) as usize;
            if count > best.as_ref().map_or(least, |b| b.0) {
                best = Some((count, plane));
            }
        }
        best.map(|b| b.1)
    }

    /// The plane near a point and normal, as far as it has the other points on one side: roughly
    /// first, then as thin as the noise of what lies beyond them.
    fn about(points: &[Point3], at: Point3, normal: Point3, thick: f64) -> Option<Self> {
        let length = dot(normal, normal).sqrt();
        if length <= 0.0 {
            return None;
        }
        let rough = refined(points, at, normal.map(|v| v / length), 2.0 * thick)?;
        let rough = Self::with_outline(points, rough, thick)?;
        let beyond: Vec<Point3> = points.iter().copied().filter(|p| rough.holds(*p)).collect();
        if beyond.len() < NEIGHBOURS {
            return None;
        }
        let (at, normal, _) = crate::outliers::plane(&beyond)?;
        let mut off: Vec<f64> = beyond
            .iter()
            .map(|p| dot(sub(*p, at), normal).abs())
            .collect();
        let deviation = 1.4826 * crate::outliers::median(&mut off);
        let thin = (THICK_DEVIATIONS * deviation).clamp(1e-6 * thick, thick);
        Self::with_outline(points, (at, normal), thin)
    }

    fn with_outline(points: &[Point3], plane: (Point3, Point3), thick: f64) -> Option<Self> {
        let (at, normal) = plane;
        let height = |p: &Point3| dot(sub(*p, at), normal);
        let above = points.iter().filter(|p| height(p) > thick).count() as f64;
        let below = points.iter().filter(|p| height(p) < -thick).count() as f64;
        let others = above + below;
        if others < 0.2 * points.len() as f64 || above.min(below) > UNDER * others {
            return None;
        }
        let side = if above > below { 1.0 } else { -1.0 };
        let mut this = Self {
            at,
            normal,
            thick,
            axes: across(normal),
            outline: Vec::new(),
            beyond: 0.0,
        };
        let off = points.iter().filter(|p| side * height(p) > thick);
        this.outline = hull(off.map(|p| this.flat(*p)).collect());
        let (lo, hi) = this.outline.iter().fold(
            ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]),
            |(lo, hi), p| {
                (
                    std::array::from_fn(|i| lo[i].min(p[i])),
                    std::array::from_fn(|i| hi[i].max(p[i])),
                )
            },
        );
        this.beyond = BEYOND * (hi[0] - lo[0]).hypot(hi[1] - lo[1]);
        Some(this)
    }

    fn flat(&self, p: Point3) -> [f64; 2] {
        self.axes.map(|axis| dot(sub(p, self.at), axis))
    }

    /// Whether a point is on the plane.
    fn is_level(&self, p: Point3) -> bool {
        dot(sub(p, self.at), self.normal).abs() <= self.thick
    }

    /// Whether a point is on the plane, beyond the outline.
    fn holds(&self, p: Point3) -> bool {
        if !self.is_level(p) {
            return false;
        }
        let q = self.flat(p);
        let n = self.outline.len();
        (0..n).any(|i| {
            let (a, b) = (self.outline[i], self.outline[(i + 1) % n]);
            let (u, v) = ([b[0] - a[0], b[1] - a[1]], [q[0] - a[0], q[1] - a[1]]);
            // The outward normal of a counterclockwise side is on its right.
            let out = u[1] * v[0] - u[0] * v[1];
            out > self.beyond * u[0].hypot(u[1])
        })
    }
}

/// The convex hull, counterclockwise (Andrew's monotone chain).
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut out: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while out.len() > 1 && turn(out[out.len() - 2], out[out.len() - 1], p) <= 0.0 {
                out.pop();
            }
            out.push(p);
        }
        out.pop();
        out
    };
    let mut out = chain(&mut points.iter().copied());
    out.extend(chain(&mut points.iter().rev().copied()));
    out
}

/// What each point's component is: none for the largest, else an object apart or, if it is small,
/// stray points.
fn components(points: &[Point3], tree: &KdTree, reach: f64) -> Vec<Option<Beside>> {
    let mut component = vec![usize::MAX; points.len()];
    let mut sizes: Vec<usize> = Vec::new();
    for start in 0..points.len() {
        if component[start] != usize::MAX {
            continue;
        }
        let own = sizes.len();
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
        sizes.push(size);
    }
    let largest = (0..sizes.len()).rev().max_by_key(|&k| sizes[k]);
    let kind = |k: usize| match sizes[k] {
        _ if Some(k) == largest => None,
        0..SMALL => Some(Beside::Stray),
        _ => Some(Beside::Apart),
    };
    component.into_iter().map(kind).collect()
}

/// The plane through the points near a plane; none where these are few.
fn refined(points: &[Point3], at: Point3, normal: Point3, thick: f64) -> Option<(Point3, Point3)> {
    let near: Vec<Point3> = points
        .iter()
        .copied()
        .filter(|p| dot(sub(*p, at), normal).abs() < thick)
        .collect();
    let (centre, normal, _) = crate::outliers::plane(&near)?;
    Some((centre, normal))
}

fn mean(points: &[Point3]) -> Point3 {
    let n = points.len().max(1) as f64;
    std::array::from_fn(|i| points.iter().map(|p| p[i]).sum::<f64>() / n)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        look(&Clutter::find(&points, &order, &near, false))
    }

    #[test]
    fn a_ball_alone_has_nothing_beside_it() {
        with_sphere(std::iter::empty(), |alone| {
            let shares = [Beside::Plane, Beside::Apart, Beside::Stray].map(|b| alone.share(b));
            assert_eq!(shares, [0.0; 3]);
        });
    }

    #[test]
    fn a_table_is_found() {
        let mut random = fastrand::Rng::with_seed(6);
        let mut table = || [6.0 * random.f64() - 3.0, 6.0 * random.f64() - 3.0, -1.0];
        with_sphere((0..500).map(|_| table()), |found| {
            // A circle of 1.08 radii about the ball's foot covers π 1.08² / 36 of the table.
            let share = found.share(Beside::Plane);
            assert!((share - 0.2 * (1.0 - 0.102)).abs() < 0.01, "{found:?}");
            assert_eq!(found.of([2.0, 2.0, -1.0]), Some(Beside::Plane));
            assert_eq!(found.of([0.3, 0.3, -0.9]), None);
        });
    }

    #[test]
    fn another_object_is_found() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut of_blob = |low: f64| low + 0.3 * random.f64();
        let blob = (0..200).map(|_| [of_blob(4.0), of_blob(0.0), of_blob(0.0)]);
        with_sphere(blob, |found| {
            let share = found.share(Beside::Apart);
            assert!((share - 200.0 / 2200.0).abs() < 0.005, "{found:?}");
            assert_eq!(found.of([4.1, 0.1, 0.1]), Some(Beside::Apart));
            assert_eq!(found.of([1.0, 0.0, 0.0]), None);
        });
    }
}
