//! Start points: the part on which they lie, and the start of patches at edges and ridges.

use super::attempt::grown;
use crate::feet::reached;
use crate::grow::{GrowthStart, StepSizePolicy};
use crate::options::{Error, Options};
use crate::parameterized::{Clock, Parameterized};
use crate::places::{contains, normalized};
use crate::surface::{self, Seed};
use crate::whole::{GrowthPart, Whole};
use isoform_control::Control;
use isoform_geom::{Field, Point3, cross, dot, norm, sub};

/// Point of the surface with the part on which it lies.
#[derive(Clone, Copy)]
pub(super) struct SurfacePlace {
    pub(super) part: usize,
    pub(super) point: Point3,
}

/// Returns the point of the surface nearest to a point, among its projections to all parts.
pub(super) fn nearest(whole: &Whole<'_>, p: Point3, options: &Options) -> Option<SurfacePlace> {
    let scale = options.region.diagonal();
    let mut best: Option<(f64, SurfacePlace)> = None;
    for part in 0..whole.len() {
        let foot =
            surface::project(whole.field(part), p, scale).filter(|q| contains(&options.region, *q));
        let Some(point) = foot.filter(|q| whole.is_on(part, *q, scale)) else {
            continue;
        };
        let d = norm(sub(point, p));
        if best.is_none_or(|b| d < b.0) {
            best = Some((d, SurfacePlace { part, point }));
        }
    }
    best.map(|b| b.1)
}

/// Returns a random point of the surface, far from edges. If the control stops the search, returns
/// the best so far, or an error if there is none.
pub(super) fn chosen(
    whole: &Whole<'_>,
    options: &Options,
    control: &Control<'_>,
) -> Result<SurfacePlace, Error> {
    let mut random = surface::Random::new(options.seed);
    let scale = options.region.diagonal();
    let mut best: Option<(f64, SurfacePlace)> = None;
    let mut found = 0;
    for _ in 0..surface::MAX_RANDOM_POINTS {
        if control.is_stopped() {
            return best.map(|b| b.1).ok_or(Error::Stopped);
        }
        let Some(place) = nearest(whole, random.place(&options.region), options) else {
            continue;
        };
        let edge = whole.nearest_edge(place.part, place.point, scale);
        let d = edge.map_or(f64::INFINITY, |(e, _)| norm(sub(e, place.point)));
        if best.is_none_or(|b| d > b.0) {
            best = Some((d, place));
        }
        found += 1;
        if found == surface::SEED_CANDIDATES {
            break;
        }
    }
    best.map(|b| b.1).ok_or(Error::NoSurface)
}

/// Start of a patch around a point.
struct Approach<'f> {
    seed: Seed,
    /// Function that vanishes on the edge on which the seed lies; `None` if it lies on none.
    edge: Option<&'f dyn Field>,
    /// True if the seed lies on a ridge.
    is_ridge: bool,
}

impl<'f> Approach<'f> {
    /// Starts at an edge or a ridge nearby, if there is one, else around the point's own seed.
    fn new(on: GrowthPart<'f>, point: Point3, own: Seed, options: &Options) -> Result<Self, Error> {
        if !on.whole.is_single() {
            return Ok(Self::at_edge(on, point, own, options));
        }
        let scale = options.region.diagonal();
        let ridge = surface::ridge(on.field(), point, scale);
        let seed = match ridge {
            Some(ridge) => surface::frame(on.field(), ridge, 0.0, scale)?,
            None => own,
        };
        Ok(Self {
            seed,
            edge: None,
            is_ridge: ridge.is_some(),
        })
    }

    /// Starts at an edge that is very near, and along one that is near.
    fn at_edge(on: GrowthPart<'f>, point: Point3, own: Seed, options: &Options) -> Self {
        let scale = options.region.diagonal();
        let (mut seed, mut from) = (own, None);
        if let Some((foot, edge)) = on.whole.nearest_edge(on.part, point, scale)
            && let Some(tangents) = on.along(edge, foot, point)
        {
            let far = norm(sub(foot, point));
            // The patch starts at an edge within a hundredth of the region, and along one within
            // 0.3 radii of curvature.
            if far <= 0.01 * options.edge() {
                seed = Seed {
                    point: foot,
                    tangents,
                    ..seed
                };
                from = Some(edge);
            } else if far * seed.curvature <= 0.3 {
                seed.tangents = in_plane(tangents, on.field().jet(point).g);
            }
        }
        Self {
            seed,
            edge: from,
            is_ridge: false,
        }
    }
}

/// Grows a patch around a point of a part.
pub(crate) fn at(
    on: GrowthPart<'_>,
    point: Point3,
    options: &Options,
    control: &Control<'_>,
) -> Result<Parameterized, Error> {
    let mut clock = Clock::default();
    let own = surface::frame(on.field(), point, 0.0, options.region.diagonal())?;
    let approach = Approach::new(on, point, own, options)?;
    clock.phase("seed");
    control.report("seed", 1.0);
    let start = GrowthStart {
        on,
        seed: approach.seed,
        edge: approach.edge,
        pace: StepSizePolicy::for_options(options),
        control: *control,
        shares: [0.0, 1.0],
    };
    let made = grown(start, options, clock);
    let serves = |p: &Parameterized| p.keeps(options) && comes_to(p, point, options);
    let is_own = approach.edge.is_none() && !approach.is_ridge;
    if is_own || made.as_ref().is_ok_and(serves) {
        return made;
    }
    // If no patch fits at the edge or ridge, or none reaches the point, the patch starts around the
    // point itself.
    let seed = if approach.is_ridge {
        own
    } else {
        let tangents = in_plane(approach.seed.tangents, on.field().jet(point).g);
        Seed { tangents, ..own }
    };
    let about = GrowthStart {
        seed,
        edge: None,
        ..start
    };
    let again = grown(about, options, Clock::default());
    let is_better = again.as_ref().is_ok_and(|p| p.keeps(options));
    if approach.is_ridge || is_better || made.is_err() {
        again
    } else {
        made
    }
}

/// Returns true if a patch reaches a point, or if no tolerance is set by which to judge that.
fn comes_to(made: &Parameterized, point: Point3, options: &Options) -> bool {
    let comes = |t: f64| reached(&made.grown.patch, &[point], t)[0];
    options.tolerance.is_none_or(comes)
}

/// Rotates tangents into the plane with a given normal.
fn in_plane(tangents: [Point3; 2], normal: Point3) -> [Point3; 2] {
    let n = normalized(normal);
    let d = dot(tangents[0], n);
    let t: Point3 = std::array::from_fn(|k| tangents[0][k] - d * n[k]);
    let t = normalized(t);
    [t, cross(n, t)]
}
