//! Region growing: regions grow from a seed along neighbours, as far as a surface explains the
//! points.

use crate::chart::{Primitive, PrimitiveDistances, PrimitiveKind};
use crate::cloud::{Cloud, MAX_NEIGHBOURS, thinned};
use crate::cost::Cost;
use crate::fit::{Precision, fit, mean, squares};
use crate::local::moments;
use crate::noise::{CHANCE_DEVIATIONS, MAX_EXACT_NOISE};
use crate::start::{Axis, squares_left, start_about, starts};
use isoform_geom::{KdTree, Point3, dot, sub};
use isoform_num::linalg::symmetric_eigen_3;
use std::collections::HashSet;

/// Minimum |cosine| between the normal of a point and that of the surface: 55°. Normals near an
/// edge are the mean of both sides, 45° off at a right angle.
pub(crate) const MIN_NORMAL_AGREEMENT: f64 = 0.57;
/// Maximum number of points in a fit of a growing region: the error of such a fit is far below the
/// tolerance.
const MAX_FITTED_POINTS: usize = 200;
/// Minimum number of neighbours in a set, the point itself included, that tell a row from a face: a
/// parabola passes through three.
const MIN_ROW_POINTS: usize = 4;

/// Points that a surface explains.
#[derive(Clone, Debug)]
pub(crate) struct SurfaceRegion {
    pub(crate) surface: Primitive,
    pub(crate) points: Vec<u32>,
    /// Interior points: those nearly all of whose neighbours belong to the region, so that edges
    /// with other faces are left out. All points if too few are interior.
    pub(crate) core: Vec<u32>,
}

/// Grows regions of a kind of surface from the points of a seed, and returns the largest over all
/// first guesses, which include surfaces about the axes of others nearby. Points for which
/// `is_free` is false stay out.
pub(crate) fn grow(
    cloud: &Cloud,
    seed: &[u32],
    axes: &[Axis],
    kind: PrimitiveKind,
    noise: f64,
    is_free: &(impl Fn(u32) -> bool + Sync),
) -> Option<SurfaceRegion> {
    let (points, normals) = (cloud.at(seed), cloud.normals_at(seed));
    let precision = match noise < MAX_EXACT_NOISE {
        true => Precision::Full,
        false => Precision::Rough,
    };
    let mut best: Option<SurfaceRegion> = None;
    // A surface that truly lies about the axis follows the points before any fit.
    // The axis is known to a part of the noise. More fits many surfaces that lie elsewhere, which
    // takes a third of the time.
    let most = (3.0 * noise).powi(2) * points.len() as f64;
    let coaxial = axes
        .iter()
        .filter_map(|axis| start_about(kind, &points, *axis))
        .filter(|start| squares(start, &points) <= most);
    for start in starts(kind, &points, &normals).into_iter().chain(coaxial) {
        let Some((surface, left)) = fit(&start, &points, precision) else {
            continue;
        };
        let free = (points.len() - kind.parameters()).max(1) as f64;
        // The first fit is uncertain with few points.
        if left > (2.0 * noise).powi(2) * free {
            continue;
        }
        let Some(region) = spread(cloud, seed, surface, noise, is_free) else {
            continue;
        };
        if best
            .as_ref()
            .is_none_or(|b| region.points.len() > b.points.len())
        {
            best = Some(region);
        }
    }
    best
}

/// Returns true if a surface explains a point.
fn explains(surface: &PrimitiveDistances<'_>, cloud: &Cloud, i: u32, tolerance: f64) -> bool {
    let p = cloud.points[i as usize];
    surface.at(p).abs() <= tolerance
        && dot(surface.normal(p), cloud.normals[i as usize]).abs() >= MIN_NORMAL_AGREEMENT
}

/// Alternates between collecting points and fitting until nothing changes.
fn spread(
    cloud: &Cloud,
    seed: &[u32],
    mut surface: Primitive,
    noise: f64,
    is_free: &(impl Fn(u32) -> bool + Sync),
) -> Option<SurfaceRegion> {
    let mut points = seed.to_vec();
    let mut is_whole = false;
    for _ in 0..24 {
        // The surface is known well enough to be extrapolated as far again; a small seed gains a
        // ring of ten points.
        let most = (points.len() as f64 * 1.7) as usize + 10;
        let (new, reached_end) = collect(cloud, &points, &surface, noise, most, is_free);
        if new.len() < kind_least(surface.kind) || new.len() * 2 < points.len() {
            return None;
        }
        let is_twice_whole = reached_end && is_whole;
        let is_same = new == points;
        is_whole = reached_end;
        points = new;
        if is_twice_whole && is_same {
            break;
        }
        let some = cloud.at(&sample(&points));
        let next = fit(&surface, &some, Precision::Rough)?.0;
        let has_moved = moves([&surface, &next], &some, noise);
        surface = next;
        if is_twice_whole && !has_moved {
            break;
        }
    }
    let core = core(cloud, &points, surface.kind);
    let some = cloud.at(&sample(&core));
    let precision = match noise < MAX_EXACT_NOISE {
        true => Precision::Full,
        false => Precision::Rough,
    };
    let (surface, squares) = fit(&surface, &some, precision)?;
    let free = some.len().saturating_sub(surface.kind.parameters()).max(1) as f64;
    (squares <= (1.35 * noise).powi(2) * free).then_some(SurfaceRegion {
        surface,
        points,
        core,
    })
}

/// Returns true if a surface has moved by more than a tenth of its uncertainty, that of a fit to
/// these points: a root mean square of σ √(m/n) with n points and m parameters. A region whose
/// surface stays gains and loses points of its border for ever.
fn moves([before, after]: [&Primitive; 2], points: &[Point3], noise: f64) -> bool {
    let (before_at, after_at) = (before.distances(), after.distances());
    let by = |p: &Point3| after_at.at(*p) - before_at.at(*p);
    let squares: f64 = points.iter().map(|p| by(p).powi(2)).sum();
    squares > 0.01 * noise * noise * after.kind.parameters() as f64
}

/// Removes from a region the layers of its borders whose mean distance from its surface is
/// significant. Points of the adjacent face lie within the tolerance next to an edge, or far along
/// a fillet, and bend the surface. Only together do they show that they belong to another surface:
/// the mean over a border of a hundred points resolves a tenth of the noise.
pub(crate) fn peeled(cloud: &Cloud, region: SurfaceRegion, noise: f64) -> SurfaceRegion {
    let (mut kept, mut surface) = (region.points.clone(), region.surface);
    let mut is_in = vec![false; cloud.points.len()];
    kept.iter().for_each(|i| is_in[*i as usize] = true);
    // The strip of a fillet is some points wide.
    for _ in 0..12 {
        let mut is_off = false;
        for border in borders(cloud, &kept, &is_in) {
            let distance = |i: &u32| surface.distance(cloud.points[*i as usize]);
            let sum: f64 = border.iter().map(distance).sum();
            // A smaller bound peels faces that are whole, a larger one leaves strips of others that
            // bend the surface.
            if sum.abs() > CHANCE_DEVIATIONS * noise * (border.len() as f64).sqrt() {
                border.iter().for_each(|i| is_in[*i as usize] = false);
                is_off = true;
            }
        }
        if !is_off {
            break;
        }
        kept.retain(|i| is_in[*i as usize]);
        match fit(&surface, &cloud.at(&sample(&kept)), Precision::Rough) {
            Some((next, _)) if kept.len() >= kind_least(surface.kind) => surface = next,
            _ => return region,
        }
    }
    SurfaceRegion {
        core: core(cloud, &kept, surface.kind),
        surface,
        points: kept,
    }
}

/// Returns the points of a region that have neighbours outside it, by connected parts.
fn borders(cloud: &Cloud, points: &[u32], is_in: &[bool]) -> Vec<Vec<u32>> {
    let is_border = |i: u32| cloud.near(i).iter().any(|j| !is_in[*j as usize]);
    let all: Vec<u32> = points.iter().copied().filter(|i| is_border(*i)).collect();
    cloud.connected(&all)
}

/// Returns the points of a region whose locally averaged distances are within chance, and the
/// surface fitted to them. Single points within the tolerance do not contradict a surface that they
/// leave gradually, at a fillet or an edge, and many of them bend it until it follows.
pub(crate) fn trimmed(
    cloud: &Cloud,
    points: &[u32],
    surface: &Primitive,
    noise: f64,
) -> (Primitive, Vec<u32>) {
    let (mut kept, mut now) = (points.to_vec(), *surface);
    if noise < MAX_EXACT_NOISE {
        return (now, kept);
    }
    // The mean over neighbours of neighbours has the deviation of 23 independent distances, by
    // simulation of points in a plane. Of ten thousand places one reaches four deviations by
    // chance; a bound above five includes fillets.
    let most = 5.0 * noise / 23.0_f64.sqrt();
    for _ in 0..6 {
        let off = smoothed(cloud, points, &now);
        let worst = off.iter().fold(0.0, |w: f64, x| w.max(x.abs()));
        if worst <= most {
            break;
        }
        let limit = most.max(worst / 2.0);
        kept = (points.iter().zip(&off))
            .filter(|(_, x)| x.abs() <= limit)
            .map(|(i, _)| *i)
            .collect();
        let fitted = fit(&now, &cloud.at(&sample(&kept)), Precision::Rough);
        match fitted {
            Some((next, _)) if kept.len() * 2 >= points.len() => now = next,
            _ => return (*surface, points.to_vec()),
        }
    }
    (now, kept)
}

/// Returns the distances of points from a surface, smoothed twice by the mean over the neighbours
/// among them.
fn smoothed(cloud: &Cloud, points: &[u32], surface: &Primitive) -> Vec<f64> {
    let mut at = vec![f64::NAN; cloud.points.len()];
    for i in points {
        at[*i as usize] = surface.distance(cloud.points[*i as usize]);
    }
    for _ in 0..2 {
        let mean = |i: &u32| {
            let near = cloud.near(*i).iter().chain([i]).map(|j| at[*j as usize]);
            let (sum, count) = near
                .filter(|x| !x.is_nan())
                .fold((0.0, 0.0), |(s, c), x| (s + x, c + 1.0));
            sum / count
        };
        let means: Vec<f64> = points.iter().map(mean).collect();
        points
            .iter()
            .zip(&means)
            .for_each(|(i, x)| at[*i as usize] = *x);
    }
    points.iter().map(|i| at[*i as usize]).collect()
}

/// Returns the points nearly all of whose neighbours belong to the region; all points if these are
/// fewer than three times the parameters.
pub(crate) fn core(cloud: &Cloud, points: &[u32], kind: PrimitiveKind) -> Vec<u32> {
    let mut is_in = vec![false; cloud.points.len()];
    points.iter().for_each(|i| is_in[*i as usize] = true);
    let is_inner = |i: &u32| {
        let near = cloud.near(*i);
        // One neighbour may be an outlier.
        near.iter().filter(|j| !is_in[**j as usize]).count() <= 1
    };
    let core: Vec<u32> = points.iter().copied().filter(is_inner).collect();
    if core.len() < 3 * kind.parameters() {
        points.to_vec()
    } else {
        core
    }
}

/// Returns the correlation between the distances of neighbours, and its standard deviation for
/// independent noise. It is Moran's coefficient: 0 for independent noise, towards 1 if the surface
/// does not follow the points. Neighbours are those whose projections onto the surface are near:
/// points nearest in space have similar distances wherever noise is as large as the spacing.
pub(crate) fn correlation(cloud: &Cloud, points: &[u32], surface: &Primitive) -> (f64, f64) {
    let at = cloud.at(points);
    let distances: Vec<f64> = at.iter().map(|p| surface.distance(*p)).collect();
    let foot = |(p, r): (&Point3, &f64)| -> Point3 {
        let n = surface.normal(*p);
        std::array::from_fn(|k| p[k] - r * n[k])
    };
    let feet: Vec<Point3> = at.iter().zip(&distances).map(foot).collect();
    let tree = KdTree::new(&feet);
    let (mut products, mut pairs, mut near) = (0.0, 0.0, Vec::new());
    // The correlation of 2000 points is known to 2 %. Of each the point itself and six neighbours
    // are found: more reach farther, where distances are less alike.
    for i in (0..feet.len()).step_by(feet.len().div_ceil(2000).max(1)) {
        tree.nearest_k(feet[i], 7, &mut near);
        for (_, j) in near.iter().filter(|f| f.1 as usize != i) {
            products += distances[i] * distances[*j as usize];
            pairs += 1.0;
        }
    }
    let squares: f64 = distances.iter().map(|r| r * r).sum();
    if pairs == 0.0 || squares == 0.0 {
        return (0.0, 1.0);
    }
    // Most pairs are counted from both ends.
    let mean = squares / distances.len() as f64;
    (products / pairs / mean, (2.0_f64 / pairs).sqrt())
}

/// Returns true if points lie along smooth curves. Rows of a regular sample lie exactly on surfaces
/// that the other points do not lie on; the points of a narrow face are scattered over its width.
pub(crate) fn are_rows(cloud: &Cloud, points: &[u32]) -> bool {
    let of: HashSet<u32> = points.iter().copied().collect();
    let places = cloud.at(points);
    let tree = KdTree::new(&places);
    let mut found = Vec::new();
    let mut is_in_line = |i: &u32| {
        let place = cloud.points[*i as usize];
        let near = cloud.near(*i).iter().filter(|j| of.contains(j));
        let mut beside: Vec<Point3> = near.map(|j| cloud.points[*j as usize]).collect();
        beside.push(place);
        // The points of a face narrower than their spacing have neighbours on other faces.
        if beside.len() < MIN_ROW_POINTS {
            tree.nearest_k(place, MAX_NEIGHBOURS, &mut found);
            beside = found.iter().map(|f| places[f.1 as usize]).collect();
        }
        is_along_curve(&beside, cloud.exact())
    };
    let some: Vec<u32> = sample(points);
    2 * some.iter().filter(|i| is_in_line(i)).count() > some.len()
}

/// Returns true if points lie along a smooth curve: their width is less than a tenth of their
/// length, and a parabola explains it.
fn is_along_curve(points: &[Point3], rounding: f64) -> bool {
    let (variances, axes) = symmetric_eigen_3(&moments(points));
    let [_, width, length] = variances.map(|v| v.max(0.0));
    if width >= 0.1 * 0.1 * length || length == 0.0 {
        return false;
    }
    let middle = mean(points);
    let in_plane = |p: &Point3| {
        let d = sub(*p, middle);
        let u = dot(d, axes[2]) / length.sqrt();
        ([1.0, u, u * u], dot(d, axes[1]))
    };
    // Of scattered points it leaves (n − 2)/n of the squares on average.
    let most = (0.1 * width).max(rounding * rounding * points.len() as f64);
    squares_left(points.iter().map(in_plane)).is_none_or(|left| left <= most)
}

/// Returns the minimum number of points of a region of a kind while it grows: twice its parameters.
fn kind_least(kind: PrimitiveKind) -> usize {
    2 * kind.parameters()
}

/// Returns every m-th point, with m such that at most [`MAX_FITTED_POINTS`] remain.
fn sample(points: &[u32]) -> Vec<u32> {
    let some = thinned(points.len(), MAX_FITTED_POINTS);
    some.map(|k| points[k]).collect()
}

/// Returns the points that the surface explains, reached from others along neighbours, in ascending
/// order, and a flag: true if all of them were reached before there were `most`.
fn collect(
    cloud: &Cloud,
    from: &[u32],
    surface: &Primitive,
    noise: f64,
    most: usize,
    is_free: &(impl Fn(u32) -> bool + Sync),
) -> (Vec<u32>, bool) {
    let tolerance = Cost::with_noise(noise).reach();
    let distances = surface.distances();
    let takes = |i: u32| is_free(i) && explains(&distances, cloud, i, tolerance);
    let mut is_seen = vec![false; cloud.points.len()];
    let mut ring: Vec<u32> = from.iter().copied().filter(|i| takes(*i)).collect();
    ring.iter().for_each(|i| is_seen[*i as usize] = true);
    let mut all = ring.clone();
    while !ring.is_empty() && all.len() < most {
        let mut next = Vec::new();
        for i in &ring {
            for j in cloud.near(*i) {
                if !is_seen[*j as usize] {
                    is_seen[*j as usize] = true;
                    if takes(*j) {
                        next.push(*j);
                    }
                }
            }
        }
        all.extend(&next);
        ring = next;
    }
    (ascending(all, cloud.points.len()), ring.is_empty())
}

/// Sorts distinct numbers below `n`: dense sets by marking them.
fn ascending(mut numbers: Vec<u32>, n: usize) -> Vec<u32> {
    // A sort takes as long as a check of 10 to 20 marks for each number.
    if numbers.len() * 12 < n {
        numbers.sort_unstable();
        return numbers;
    }
    let mut is_in = vec![false; n];
    numbers.iter().for_each(|i| is_in[*i as usize] = true);
    numbers.clear();
    numbers.extend((0..n as u32).filter(|i| is_in[*i as usize]));
    numbers
}
