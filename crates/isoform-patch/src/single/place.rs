//! Places to start at: on which part they lie, and how a patch about them begins at edges and at
//! ridges.

use super::attempt::grown;
use crate::feet::reached;
use crate::grow::{Pace, Start};
use crate::options::{Error, Options};
use crate::parameterized::{Clock, Parameterized};
use crate::places::{contains, normalized};
use crate::surface::{self, Seed};
use crate::whole::{On, Whole};
use isoform_control::Control;
use isoform_geom::{Field, Point3, cross, dot, norm, sub};

/// Edges nearer than this, in edges of the region, are where patches start.
const AT_EDGE: f64 = 0.01;
/// Along an edge nearer than this, in radii of curvature, patches start also where they do not
/// start at it.
const NEAR_EDGE: f64 = 0.3;
/// Places of a part among which the one farthest from its edges is chosen to start at.
const CHOICE: usize = 8;
/// Random places tried for them.
const PLACES: usize = 4000;

/// A point of the surface with the part on which it lies.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) part: usize,
    pub(super) point: Point3,
}

/// The point of the surface that a place leads to.
pub(super) fn nearest(whole: &Whole<'_>, p: Point3, options: &Options) -> Option<Place> {
    let scale = options.region.diagonal();
    let mut best: Option<(f64, Place)> = None;
    for part in 0..whole.len() {
        let foot =
            surface::project(whole.field(part), p, scale).filter(|q| contains(&options.region, *q));
        let Some(point) = foot.filter(|q| whole.is_on(part, *q, scale)) else {
            continue;
        };
        let d = norm(sub(point, p));
        if best.is_none_or(|b| d < b.0) {
            best = Some((d, Place { part, point }));
        }
    }
    best.map(|b| b.1)
}

/// A random point of the surface, far from edges. Where the time ends the search, the best so far;
/// none is an error.
pub(super) fn chosen(
    whole: &Whole<'_>,
    options: &Options,
    control: &Control<'_>,
) -> Result<Place, Error> {
    let mut random = surface::Random::new(options.seed);
    let scale = options.region.diagonal();
    let mut best: Option<(f64, Place)> = None;
    let mut found = 0;
    for _ in 0..PLACES {
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
        if found == CHOICE {
            break;
        }
    }
    best.map(|b| b.1).ok_or(Error::NoSurface)
}

/// How a patch starts about a point.
struct Approach<'f> {
    seed: Seed,
    /// What vanishes along the edge on which the seed lies, if it lies on one.
    edge: Option<&'f dyn Field>,
    /// Whether the seed lies on a ridge.
    is_ridge: bool,
}

impl<'f> Approach<'f> {
    /// At an edge or a ridge nearby, if there is one; else about the point's own seed.
    fn new(on: On<'f>, point: Point3, own: Seed, options: &Options) -> Result<Self, Error> {
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

    /// At an edge that is very near; along one that is near.
    fn at_edge(on: On<'f>, point: Point3, own: Seed, options: &Options) -> Self {
        let scale = options.region.diagonal();
        let (mut seed, mut from) = (own, None);
        if let Some((foot, edge)) = on.whole.nearest_edge(on.part, point, scale)
            && let Some(tangents) = on.along(edge, foot, point)
        {
            let far = norm(sub(foot, point));
            if far <= AT_EDGE * options.edge() {
                seed = Seed {
                    point: foot,
                    tangents,
                    ..seed
                };
                from = Some(edge);
            } else if far * seed.curvature <= NEAR_EDGE {
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

/// Grows a patch about a point of a part.
pub(crate) fn at(
    on: On<'_>,
    point: Point3,
    options: &Options,
    control: &Control<'_>,
) -> Result<Parameterized, Error> {
    let mut clock = Clock::default();
    let own = surface::frame(on.field(), point, 0.0, options.region.diagonal())?;
    let approach = Approach::new(on, point, own, options)?;
    clock.phase("seed");
    control.report("seed", 1.0);
    let start = Start {
        on,
        seed: approach.seed,
        edge: approach.edge,
        pace: Pace::of(options),
        control: *control,
        shares: [0.0, 1.0],
    };
    let made = grown(start, options, clock);
    let serves = |p: &Parameterized| p.keeps(options) && comes_to(p, point, options);
    let is_own = approach.edge.is_none() && !approach.is_ridge;
    if is_own || made.as_ref().is_ok_and(serves) {
        return made;
    }
    // Where nothing fits at the edge or ridge, or does not come as far as the point: about the
    // point itself.
    let seed = if approach.is_ridge {
        own
    } else {
        let tangents = in_plane(approach.seed.tangents, on.field().jet(point).g);
        Seed { tangents, ..own }
    };
    let about = Start {
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

/// Whether a patch comes as far as a point; true if there is no tolerance to judge that by.
fn comes_to(made: &Parameterized, point: Point3, options: &Options) -> bool {
    let comes = |t: f64| reached(&made.grown.patch, &[point], t)[0];
    options.tolerance.is_none_or(comes)
}

/// Tangents turned into the plane with a normal.
fn in_plane(tangents: [Point3; 2], normal: Point3) -> [Point3; 2] {
    let n = normalized(normal);
    let d = dot(tangents[0], n);
    let t: Point3 = std::array::from_fn(|k| tangents[0][k] - d * n[k]);
    let t = normalized(t);
    [t, cross(n, t)]
}
