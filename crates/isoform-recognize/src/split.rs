//! Splitting of surfaces that bend over an edge into the faces there.

use crate::chart::{Primitive, PrimitiveKind};
use crate::choose::{KnownSurfaces, Noise, best_region, is_called_for, least_points};
use crate::cloud::Cloud;
use crate::cost::Cost;
use crate::grow::SurfaceRegion;
use crate::kinds::best_kind;
use crate::share::MembershipWeights;
use rayon::prelude::*;

/// Number of seeds that are tried for each part.
const SEEDS_PER_FACE: usize = 6;

/// Maximum relative change of its points, and of the noise, at which an entity that could not be
/// split is not tried again: labels at borders fluctuate. A smaller limit tries most entities in
/// each round, a larger one skips entities that have changed.
const MAX_RELATIVE_CHANGE: f64 = 0.02;

/// Sets of points that could not be split.
#[derive(Clone)]
pub(crate) struct FailedSplits {
    /// Last set that each point was in.
    last: Vec<Option<u32>>,
    sets: Vec<FailedSplit>,
}

/// A set of points that could not be split.
#[derive(Clone)]
struct FailedSplit {
    kind: PrimitiveKind,
    size: usize,
    noise: f64,
}

impl FailedSplits {
    /// Creates an empty collection for a number of points.
    pub(crate) fn new(points: usize) -> Self {
        Self {
            last: vec![None; points],
            sets: Vec::new(),
        }
    }

    /// Adds a set that could not be split at the given noise.
    pub(crate) fn add(&mut self, kind: PrimitiveKind, members: &[u32], noise: f64) {
        let set = Some(self.sets.len() as u32);
        members.iter().for_each(|i| self.last[*i as usize] = set);
        let size = members.len();
        self.sets.push(FailedSplit { kind, size, noise });
    }

    /// Returns true if points are nearly those of one set, on a surface of the given kind, with
    /// nearly its noise.
    pub(crate) fn holds(&self, kind: PrimitiveKind, members: &[u32], noise: f64) -> bool {
        // A set of nearly all points mostly contains the middle one; otherwise it is tried again.
        let Some(set) = members
            .get(members.len() / 2)
            .and_then(|i| self.last[*i as usize])
        else {
            return false;
        };
        let tried = &self.sets[set as usize];
        let is_in = |i: &&u32| self.last[**i as usize] == Some(set);
        let common = members.iter().filter(is_in).count() as f64;
        let least = (1.0 - MAX_RELATIVE_CHANGE) * members.len().max(tried.size) as f64;
        let is_like = (noise - tried.noise).abs() <= MAX_RELATIVE_CHANGE * tried.noise;
        tried.kind == kind && is_like && common >= least
    }
}

/// Returns the surfaces of simpler kinds that explain the points of an entity better than its own;
/// `None` if there are none.
pub(crate) fn split(
    cloud: &Cloud,
    members: &[u32],
    surface: &Primitive,
    kinds: &[PrimitiveKind],
    noise: Noise,
) -> Option<Vec<SurfaceRegion>> {
    if kinds.is_empty() || members.is_empty() {
        return None;
    }
    let mut is_free = vec![false; cloud.points.len()];
    members.iter().for_each(|i| is_free[*i as usize] = true);
    let mut parts: Vec<SurfaceRegion> = Vec::new();
    let mut left = members.to_vec();
    // An entity is split into three faces at most.
    while parts.len() < 3 && !left.is_empty() {
        // Seeds evenly spread over the remaining points, which are sorted by their coordinates.
        let seed = |k: usize| left[(2 * k + 1) * left.len() / (2 * SEEDS_PER_FACE)];
        let is_open = |i: u32| is_free[i as usize];
        let region = (0..SEEDS_PER_FACE).into_par_iter().find_map_first(|k| {
            best_region(
                cloud,
                seed(k),
                kinds,
                noise,
                KnownSurfaces::default(),
                &is_open,
            )
        });
        let Some(region) = region else { break };
        for i in &region.points {
            is_free[*i as usize] = false;
        }
        left.retain(|i| is_free[*i as usize]);
        parts.push(region);
    }
    let explained = (members.len() - left.len()) as f64;
    // The parts have to explain 85 % of the points.
    let is_whole = parts.len() > 1 && explained >= 0.85 * members.len() as f64;
    (is_whole && is_better(cloud, members, surface, &mut parts, noise)).then_some(parts)
}

/// Returns true if parts explain the points better than one surface. Assigns each point to the
/// nearest part, and gives each part the kind that its points justify.
fn is_better(
    cloud: &Cloud,
    members: &[u32],
    surface: &Primitive,
    parts: &mut [SurfaceRegion],
    noise: Noise,
) -> bool {
    let most = Cost::with_noise(noise.deviation).reach().powi(2);
    let one: f64 = squares_of(cloud, members, &[*surface], most);
    for _ in 0..3 {
        share_out(cloud, members, parts);
        for part in parts.iter_mut() {
            if part.points.len() < least_points(PrimitiveKind::Plane, noise.deviation) {
                return false;
            }
            let shares: MembershipWeights = part.points.iter().map(|i| (*i, 1.0)).collect();
            part.surface = best_kind(cloud, &shares, &part.surface, noise);
        }
    }
    let surfaces: Vec<Primitive> = parts.iter().map(|p| p.surface).collect();
    let many = squares_of(cloud, members, &surfaces, most);
    let all: usize = surfaces.iter().map(|s| s.kind.parameters()).sum();
    let more = all.saturating_sub(surface.kind.parameters());
    is_called_for(more, members.len(), one, many, all, noise)
}

/// Returns Σ of squared distances to the nearest of surfaces, each at most `most`.
fn squares_of(cloud: &Cloud, members: &[u32], surfaces: &[Primitive], most: f64) -> f64 {
    let square = |i: &u32| {
        let p = cloud.points[*i as usize];
        let squares = surfaces.iter().map(|s| s.distance(p).powi(2));
        squares.fold(most, f64::min)
    };
    members.iter().map(square).sum()
}

/// Assigns each point to the nearest part.
fn share_out(cloud: &Cloud, members: &[u32], parts: &mut [SurfaceRegion]) {
    let mut points = vec![Vec::new(); parts.len()];
    for i in members {
        let p = cloud.points[*i as usize];
        let distance = |k: &usize| parts[*k].surface.distance(p).abs();
        let nearest = (0..parts.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        points[nearest.unwrap_or(0)].push(*i);
    }
    for (part, points) in parts.iter_mut().zip(points) {
        part.points = points;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entities_that_changed_are_tried_again() {
        let mut whole = FailedSplits::new(1000);
        let all: Vec<u32> = (0..500).collect();
        assert!(!whole.holds(PrimitiveKind::Torus, &all, 1.0));
        whole.add(PrimitiveKind::Torus, &all, 1.0);
        assert!(whole.holds(PrimitiveKind::Torus, &all, 1.01));
        assert!(whole.holds(PrimitiveKind::Torus, &all[5..], 1.0));
        assert!(!whole.holds(PrimitiveKind::Cone, &all, 1.0));
        assert!(!whole.holds(PrimitiveKind::Torus, &all, 0.9));
        assert!(!whole.holds(PrimitiveKind::Torus, &all[20..], 1.0));
        let more: Vec<u32> = (0..520).collect();
        assert!(!whole.holds(PrimitiveKind::Torus, &more, 1.0));
        assert!(!whole.holds(PrimitiveKind::Torus, &[], 1.0));
    }
}
