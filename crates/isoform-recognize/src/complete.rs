//! Small faces of exact points: faces with as few points as evidence permits, counting points that
//! belong to adjacent faces.
//!
//! Regions of small faces do not grow from neighbourhoods, which reach beyond them. Of exact points
//! the fewest that determine a surface define it, and each further point lies on it by chance only
//! with the probability rounding / (size of the face).

use crate::chart::{Primitive, PrimitiveDistances, PrimitiveKind};
use crate::choose::follows;
use crate::cloud::{Cloud, MAX_NEIGHBOURS, thinned};
use crate::cost::Cost;
use crate::fit::{Precision, covariance, fit};
use crate::grow::are_rows;
use crate::labels::UNLABELLED;
use crate::profile::{PlanePoint, ProfileCurve};
use crate::segment::{Limits, MIN_EVIDENCE, NOISE_SLACK, Segmentation};
use crate::start::{plane, starts};
use crate::sweep::Sweep;
use isoform_control::{Control, Stopped};
use isoform_geom::{Aabb, KdTree, Point3};
use rayon::prelude::*;

/// Minimum number of points on a surface in addition to those that determine it.
const MIN_EXCESS_POINTS: usize = 4;

/// A surface through a few points.
struct SurfaceTrial {
    surface: Primitive,
    /// Number of values that the points determined; the other parameters are those of known
    /// entities.
    values: usize,
}

/// The best surface about a seed.
struct SurfaceCandidate {
    seed: u32,
    tried: SurfaceTrial,
    /// Number of nearby points on the surface beyond those that determine it.
    more: usize,
}

impl Segmentation {
    /// Adds the faces that exact points without an entity lie on, together with nearby points.
    pub(crate) fn complete(
        &mut self,
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        if !cloud.is_exact(self.noise) || self.is_form {
            return Ok(());
        }
        for _ in 0..3 {
            control.check()?;
            let open = OpenPoints::new(cloud, &self.labels);
            let sweeps = self.sweeps();
            let seeds: Vec<u32> = thinned(open.of.len(), 4000).map(|k| open.of[k]).collect();
            let mut found: Vec<SurfaceCandidate> = seeds
                .par_iter()
                .filter_map(|seed| self.best_about(cloud, &open, *seed, &sweeps))
                .collect();
            found.sort_by_key(|f| (std::cmp::Reverse(f.more), f.seed));
            let mut is_new = false;
            for f in found {
                is_new |= self.accept(cloud, &open, limits, &f);
            }
            if !is_new {
                break;
            }
        }
        Ok(())
    }

    /// Returns the surface through the seed and points near it that most of the other points nearby
    /// lie on.
    fn best_about(
        &self,
        cloud: &Cloud,
        open: &OpenPoints,
        seed: u32,
        sweeps: &[Sweep],
    ) -> Option<SurfaceCandidate> {
        // Surfaces are tried on the 40 points around the seed. They pass through some of the nine
        // nearest without an entity.
        let mut near = cloud.around(seed, 40);
        let is_open = |i: &u32| self.labels[*i as usize] == UNLABELLED && *i != seed;
        let mut through: Vec<u32> = near.iter().copied().filter(is_open).take(9).collect();
        if through.len() < 9 {
            through = open.nearest(cloud, seed, 9);
            near.extend(open.nearest(cloud, seed, 40));
            near.sort_unstable();
            near.dedup();
        }
        let open = cloud.at(&through);
        let near = cloud.at(&near);
        let tolerance = Cost::with_noise(self.noise).reach();
        let mut best: Option<SurfaceCandidate> = None;
        let mut try_it = |tried: SurfaceTrial| {
            let distances = tried.surface.distances();
            let met = near.iter().filter(|p| distances.at(**p).abs() <= tolerance);
            let more = met.count().saturating_sub(tried.values);
            if more >= MIN_EXCESS_POINTS && best.as_ref().is_none_or(|b| more > b.more) {
                best = Some(SurfaceCandidate { seed, tried, more });
            }
        };
        let p = cloud.points[seed as usize];
        for sweep in sweeps {
            surfaces_through(sweep, p, &open)
                .into_iter()
                .for_each(&mut try_it);
        }
        for (k, a) in open.iter().enumerate() {
            for (l, b) in open.iter().enumerate().skip(k + 1) {
                try_it(SurfaceTrial {
                    surface: plane(&[p, *a, *b]),
                    values: 3,
                });
                for c in &open[l + 1..] {
                    let spheres = starts(PrimitiveKind::Sphere, &[p, *a, *b, *c], &[]);
                    spheres.into_iter().for_each(|surface| {
                        try_it(SurfaceTrial { surface, values: 4 });
                    });
                }
            }
        }
        best
    }

    /// Adds a surface with the points that are reached on it from its seed, along neighbours or, on
    /// a face that is narrower than the spacing, along open points. Returns true if it was added.
    fn accept(
        &mut self,
        cloud: &Cloud,
        open: &OpenPoints,
        limits: Limits,
        found: &SurfaceCandidate,
    ) -> bool {
        let mut ways = [None, Some(open)].into_iter();
        self.labels[found.seed as usize] == UNLABELLED
            && ways.any(|open| self.accept_reached(cloud, open, limits, found))
    }

    /// Adds a surface with the points that are reached on it, if these are sufficient evidence.
    /// Returns true if it was added.
    fn accept_reached(
        &mut self,
        cloud: &Cloud,
        along: Option<&OpenPoints>,
        limits: Limits,
        found: &SurfaceCandidate,
    ) -> bool {
        let tolerance = Cost::with_noise(self.noise).reach();
        let reached = |surface: &Primitive| {
            let distances = surface.distances();
            reached(cloud, along, found.seed, &distances, tolerance)
        };
        let first = reached(&found.tried.surface);
        let fitted = fit(&found.tried.surface, &cloud.at(&first), Precision::Full);
        let Some((surface, _)) = fitted else {
            return false;
        };
        let of = reached(&surface);
        let open: Vec<u32> = of
            .iter()
            .copied()
            .filter(|i| self.labels[*i as usize] == UNLABELLED)
            .collect();
        let points = cloud.at(&of);
        let size = Aabb::from_points(&points).diagonal();
        // A surface costs as many numbers as it has values, and saves one for each point.
        let saved = open.len() as f64 - found.tried.values as f64;
        let is_evidence = saved * (size / self.noise).ln() > MIN_EVIDENCE
            && of.len() >= (surface.kind.parameters() + MIN_EXCESS_POINTS).max(limits.min_points);
        if !is_evidence
            || are_rows(cloud, &of)
            || !follows(cloud, [&of; 2], &surface, self.deviation(NOISE_SLACK))
            || !is_determined(&surface, &points, self.noise, size)
        {
            return false;
        }
        // Pieces of one surface are one entity.
        let explains = |s: &Primitive| {
            let distances = s.distances();
            points.iter().all(|p| distances.at(*p).abs() <= tolerance)
        };
        let known = self.surfaces.iter().position(explains);
        let label = known.unwrap_or(self.surfaces.len()) as u32;
        if known.is_none() {
            self.surfaces.push(surface);
        }
        open.iter().for_each(|i| self.labels[*i as usize] = label);
        true
    }
}

/// Returns the surfaces that a motion leaves invariant, or that lie across it, through a point and
/// up to two of the others.
fn surfaces_through(sweep: &Sweep, p: Point3, others: &[Point3]) -> Vec<SurfaceTrial> {
    let mut all = Vec::new();
    let mut add = |kind: PrimitiveKind, curve: ProfileCurve, values: usize| {
        let surface = sweep.surface(kind, &curve);
        all.extend(surface.map(|surface| SurfaceTrial { surface, values }));
    };
    let is_about = matches!(sweep, Sweep::About(_));
    let (slope, arc) = match is_about {
        true => (PrimitiveKind::Cone, PrimitiveKind::Torus),
        false => (PrimitiveKind::Plane, PrimitiveKind::Cylinder),
    };
    let at = sweep.section(p);
    if is_about {
        add(PrimitiveKind::Plane, ProfileCurve::Line(at, [0.0, 1.0]), 1);
        add(
            PrimitiveKind::Cylinder,
            ProfileCurve::Line(at, [1.0, 0.0]),
            1,
        );
    }
    let others: Vec<PlanePoint> = others.iter().map(|q| sweep.section(*q)).collect();
    for (k, q) in others.iter().enumerate() {
        let way = [q[0] - at[0], q[1] - at[1]];
        let length = way[0].hypot(way[1]);
        add(slope, ProfileCurve::Line(at, way.map(|x| x / length)), 2);
        if is_about {
            let center = (at[0] + q[0] + (q[1] * q[1] - at[1] * at[1]) / way[0]) / 2.0;
            let radius = (at[0] - center).hypot(at[1]);
            add(
                PrimitiveKind::Sphere,
                ProfileCurve::Circle([center, 0.0], radius),
                2,
            );
        }
        for r in &others[k + 1..] {
            let (center, radius) = circle([at, *q, *r]);
            add(arc, ProfileCurve::Circle(center, radius), 3);
        }
    }
    if let Sweep::Along(direction) = sweep {
        all.push(SurfaceTrial {
            surface: Primitive::plane(p, *direction),
            values: 1,
        });
    }
    all
}

/// Returns the centre and the radius of the circle through three points; they are not finite if
/// these are collinear.
fn circle([a, b, c]: [PlanePoint; 3]) -> (PlanePoint, f64) {
    let [u, v] = [b, c].map(|q| [q[0] - a[0], q[1] - a[1]]);
    let [uu, vv] = [u, v].map(|w| w[0] * w[0] + w[1] * w[1]);
    let twice = 2.0 * (u[0] * v[1] - u[1] * v[0]);
    let d = [
        (v[1] * uu - u[1] * vv) / twice,
        (u[0] * vv - v[0] * uu) / twice,
    ];
    ([a[0] + d[0], a[1] + d[1]], d[0].hypot(d[1]))
}

/// Points without an entity. Those of a face narrower than their spacing are neighbours only among
/// these.
struct OpenPoints {
    of: Vec<u32>,
    tree: KdTree,
}

impl OpenPoints {
    fn new(cloud: &Cloud, labels: &[u32]) -> Self {
        let all = 0..labels.len() as u32;
        let of: Vec<u32> = all.filter(|i| labels[*i as usize] == UNLABELLED).collect();
        Self {
            tree: KdTree::new(&cloud.at(&of)),
            of,
        }
    }

    /// Returns the nearest of these points, nearest first and without the point itself.
    fn nearest(&self, cloud: &Cloud, i: u32, count: usize) -> Vec<u32> {
        let mut found = Vec::new();
        self.tree
            .nearest_k(cloud.points[i as usize], count + 1, &mut found);
        let all = found.iter().map(|f| self.of[f.1 as usize]);
        all.filter(|j| *j != i).take(count).collect()
    }
}

/// Returns the points on a surface that are connected to a seed along neighbours, those among open
/// points included, in ascending order.
fn reached(
    cloud: &Cloud,
    open: Option<&OpenPoints>,
    seed: u32,
    surface: &PrimitiveDistances<'_>,
    tolerance: f64,
) -> Vec<u32> {
    let mut all = vec![seed];
    let mut is_seen = std::collections::HashSet::from([seed]);
    let mut at = 0;
    while let Some(i) = all.get(at).copied() {
        at += 1;
        let more = open.map(|open| open.nearest(cloud, i, MAX_NEIGHBOURS));
        for j in cloud.near(i).iter().chain(more.iter().flatten()) {
            let is_on = || surface.at(cloud.points[*j as usize]).abs() <= tolerance;
            if is_seen.insert(*j) && is_on() {
                all.push(*j);
            }
        }
    }
    all.sort_unstable();
    all
}

/// Returns true if points determine all parameters of a surface to a small share of their size.
fn is_determined(surface: &Primitive, points: &[Point3], noise: f64, size: f64) -> bool {
    let lengths = surface.kind.lengths();
    covariance(surface, points).is_some_and(|c| {
        (0..surface.kind.parameters()).all(|k| {
            let deviation = c[k][k].sqrt() * noise;
            // Points on a line leave a plane open.
            deviation <= 1e-3 * if lengths.contains(&k) { size } else { 1.0 }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_go_through_three_places() {
        let (center, radius) = circle([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]);
        assert!(center[0].hypot(center[1]) < 1e-15 && (radius - 1.0).abs() < 1e-15);
        assert!(!circle([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).1.is_finite());
    }

    /// A torus, a cone and a sphere about an axis, a cylinder along it.
    #[test]
    fn surfaces_go_through_their_points() {
        let axis = [0.36, 0.48, 0.8];
        let p = [0.3, -0.2, 0.5];
        let others = [[0.1, 0.4, 0.6], [-0.2, 0.3, 0.2]];
        for sweep in [Sweep::About(([0.1, 0.0, -0.3], axis)), Sweep::Along(axis)] {
            let all = surfaces_through(&sweep, p, &others);
            assert!(all.len() >= 4, "{}", all.len());
            for SurfaceTrial { surface, values } in all {
                let on = |q: &[f64; 3]| surface.distance(*q).abs() < 1e-12;
                let count = 1 + others.iter().filter(|q| on(q)).count();
                assert!(on(&p) && count >= values, "{surface:?} {values}");
            }
        }
    }
}
