//! Bent surfaces that reach over edges, given up for the simpler ones of which they took more than
//! there is.
//!
//! Where noise is large a plane with a strip of the next face is a sphere, and follows its points.
//! That shows only when what is left over has a surface of its own, too.

use crate::chart::{Kind, Surface};
use crate::choose::{Noise, follows, least_points};
use crate::cloud::Cloud;
use crate::grow::trimmed;
use crate::kinds::guess;

/// The share of its points that a simpler surface keeps at least.
const KEPT: f64 = 0.6;

/// A simpler surface through most of the points of an entity, and these.
pub(crate) fn simpler(
    cloud: &Cloud,
    members: &[u32],
    surface: &Surface,
    noise: Noise,
) -> Option<(Surface, Vec<u32>)> {
    let of = |kind: &Kind| {
        let start = guess(cloud, members, *kind)?;
        let (surface, kept) = trimmed(cloud, members, &start, noise.deviation);
        let is_most = kept.len() as f64 >= KEPT * members.len() as f64;
        let is_enough = kept.len() >= least_points(*kind, noise.deviation);
        let is_good = is_most && is_enough && follows(cloud, [&kept; 2], &surface, noise);
        is_good.then_some((surface, kept))
    };
    surface.kind.simpler().iter().find_map(of)
}
