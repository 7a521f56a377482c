//! Choice of the kind of surface through given points.

use crate::chart::{Primitive, PrimitiveKind};
use crate::choose::{Noise, is_called_for, least_points, may_be_called_for};
use crate::cloud::{Cloud, thinned};
use crate::fit::{Precision, fit, fit_weighted, squares};
use crate::share::MembershipWeights;
use crate::start::{Axis, start_about, starts};
use isoform_geom::Point3;

/// Returns the simplest kind of surface that explains the points as well as any other.
pub(crate) fn best_kind(
    cloud: &Cloud,
    shares: &MembershipWeights,
    surface: &Primitive,
    noise: Noise,
) -> Primitive {
    let allowed = AllowedSurfaces {
        least_points: &|kind| least_points(kind, noise.deviation),
        is_allowed: &|_| true,
    };
    simplest_kind(cloud, shares, Some(surface), noise, &allowed).unwrap_or(*surface)
}

/// Surfaces among which a kind is chosen.
pub(crate) struct AllowedSurfaces<'a> {
    /// Minimum number of points of a kind.
    pub(crate) least_points: &'a dyn Fn(PrimitiveKind) -> usize,
    /// True if a fitted surface may be taken.
    pub(crate) is_allowed: &'a dyn Fn(&Primitive) -> bool,
}

/// Returns the surface through the points of the simplest kind that explains them as well as any
/// other; `known` is a surface near it. `None` if no surface is allowed.
pub(crate) fn simplest_kind(
    cloud: &Cloud,
    shares: &MembershipWeights,
    known: Option<&Primitive>,
    noise: Noise,
    allowed: &AllowedSurfaces<'_>,
) -> Option<Primitive> {
    let (of, weights): (Vec<u32>, Vec<f64>) = shares.iter().copied().unzip();
    let points = cloud.at(&of);
    let count = weights.iter().sum::<f64>() as usize;
    let mut best: Option<(Primitive, f64)> = None;
    for kind in PrimitiveKind::ALL.iter().copied() {
        if count < (allowed.least_points)(kind) {
            continue;
        }
        let asked = |simple: Primitive| kind.parameters() - simple.kind.parameters();
        if best.is_some_and(|(s, more)| !may_be_called_for(asked(s), count, more, noise)) {
            continue;
        }
        let start = match known.filter(|surface| surface.kind == kind) {
            Some(surface) => Some(*surface),
            None => first_guess(cloud, shares, kind),
        };
        let full = |s: Primitive| fit_weighted(&s, &points, Some(&weights), Precision::Full);
        let Some((fitted, squares)) = start
            .and_then(full)
            .filter(|(s, _)| s.is_wider_than(noise.deviation) && (allowed.is_allowed)(s))
        else {
            continue;
        };
        let is_better = best.is_none_or(|(simple, more): (Primitive, f64)| {
            is_called_for(
                asked(simple),
                count,
                more,
                squares,
                kind.parameters(),
                noise,
            )
        });
        if is_better {
            best = Some((fitted, squares));
        }
    }
    best.map(|b| b.0)
}

/// Returns the cone about one of some axes that follows points best; with its axis given it has two
/// parameters of its own.
pub(crate) fn coaxial_cone(points: &[Point3], axes: &[Axis]) -> Option<Primitive> {
    let about = |axis: &Axis| start_about(PrimitiveKind::Cone, points, *axis);
    let cones = axes
        .iter()
        .filter_map(about)
        .map(|s| (s, squares(&s, points)));
    cones.min_by(|a, b| a.1.total_cmp(&b.1)).map(|c| c.0)
}

/// Returns a cone that explains points as well as a sphere does, or a cylinder if it is as good;
/// `None` if the sphere is better.
pub(crate) fn zone(
    cloud: &Cloud,
    shares: &MembershipWeights,
    sphere: &Primitive,
    noise: Noise,
) -> Option<Primitive> {
    let (of, weights): (Vec<u32>, Vec<f64>) = shares.iter().copied().unzip();
    let points = cloud.at(&of);
    let full = |s: Primitive| fit_weighted(&s, &points, Some(&weights), Precision::Full);
    let (_, before) = full(*sphere)?;
    let cone = first_guess(cloud, shares, PrimitiveKind::Cone).and_then(full)?;
    if cone.1 > before {
        return None;
    }
    let cylinder = first_guess(cloud, shares, PrimitiveKind::Cylinder).and_then(full);
    let simple = cylinder.filter(|c| !is_called_for(1, points.len(), c.1, cone.1, 6, noise));
    Some(simple.unwrap_or(cone).0)
}

/// Returns a surface of a kind through a sample of the points that mostly belong to it.
fn first_guess(
    cloud: &Cloud,
    shares: &MembershipWeights,
    kind: PrimitiveKind,
) -> Option<Primitive> {
    let own: Vec<u32> = shares.iter().filter(|s| s.1 > 0.5).map(|s| s.0).collect();
    guess(cloud, &own, kind)
}

/// Returns a surface of a kind through a sample of points.
pub(crate) fn guess(cloud: &Cloud, own: &[u32], kind: PrimitiveKind) -> Option<Primitive> {
    let some: Vec<u32> = thinned(own.len(), 400).map(|k| own[k]).collect();
    let (points, normals) = (cloud.at(&some), cloud.normals_at(&some));
    starts(kind, &points, &normals)
        .iter()
        .filter_map(|s| fit(s, &points, Precision::Rough))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|s| s.0)
}
