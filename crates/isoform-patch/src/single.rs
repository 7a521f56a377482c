//! One patch: seed, growth, exactness, tolerance, proof.

use crate::distance::{Distances, distances_on};
use crate::exact::make_exact;
use crate::feet::reached;
use crate::fold;
use crate::grow::{Grown, Growth, Pace};
use crate::objective::{Inner, Method, Objective};
use crate::options::{Error, Options};
use crate::surface::Seed;
use crate::unit::UnitBox;
use crate::whole::{NearSingular, On, Whole};
use crate::{MOST_DEGREE, surface};
use isoform_geom::{Field, Parts, Point3, Quadric, norm, sub};
use std::f64::consts::FRAC_PI_4;
use std::time::Instant;

/// A patch whose samples are this near to the surface, in diagonals of the region, is exact to
/// rounding,
const EXACT: f64 = 1e-12;
/// if it is proved to be this near everywhere: where it passes a self-intersection, or the function
/// is no polynomial, proofs end here.
const PROVED: f64 = 1e-6;
/// Seeds of its own that the tool tries until one admits a patch.
const OTHER_SEEDS: u64 = 8;
/// The share of the time that growing may take: the rest is for the proof.
const GROWING_TIME: f64 = 0.6;
/// How much shorter patches become, in turn, at each side where nothing can be proved.
const RETREATS: [f64; 4] = [0.02, 0.03, 0.05, 0.1];

/// A bound more times the sampled distance is loose,
const LOOSE: f64 = 3.0;
/// and sides are taken back so often for a tighter one,
const TRIMMINGS: usize = 4;
/// unless it is below this share of the region's diagonal.
const ROUNDING: f64 = 1e-13;

/// A patch with what is known of it.
#[derive(Clone, Debug)]
pub struct Parameterized {
    /// The patch and the way to it.
    pub grown: Grown,
    /// The part of the surface it lies on; 0 where that is one function.
    pub part: usize,
    /// How far it is from the surface.
    pub distances: Distances,
    /// Whether it is proved not to fold over: that it shows one side to where F grows, except
    /// across self-intersections, where its normals turn little.
    pub is_unfolded: bool,
    /// How often it was made shorter until its distance could be proved.
    pub shortenings: usize,
    /// Whether S keeps its bound.
    pub is_within_limit: bool,
    /// Whether the time was over before the patch was as large as it gets.
    pub is_late: bool,
    /// Whether the patch lies on the surface, to rounding.
    pub is_exact: bool,
    /// The quadric on which an exact patch lies, if it does.
    pub quadric: Option<Quadric>,
    /// Seconds by phase.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Edges nearer than this, in edges of the region, are where patches start.
const AT_EDGE: f64 = 0.01;
/// Along an edge nearer than this, in radii of curvature, patches start also where they do not
/// start at it.
const NEAR_EDGE: f64 = 0.3;
/// Places of a part among which the one farthest from its edges is chosen to start at, and places
/// tried for them.
const CHOICE: (usize, usize) = (8, 4000);

/// Grows one patch on the surface `field` = 0, and proves how far from it the patch is.
pub fn parameterize(field: &dyn Field, options: &Options) -> Result<Parameterized, Error> {
    check(options)?;
    let unit = UnitBox::of(&options.region);
    parameterize_in_unit_box(&unit.field(field), &unit.options(options))
        .map(|made| unit.made_out(made, field))
        .map_err(|error| unit.error_out(error))
}

fn parameterize_in_unit_box(field: &dyn Field, options: &Options) -> Result<Parameterized, Error> {
    let whole = Whole::of_field(field);
    let on = On {
        whole: &whole,
        part: 0,
        near_singular: NearSingular::Cross,
    };
    let mut clock = Clock::default();
    if let Some(p) = options.seed_point {
        let seed = surface::given(field, p, &options.region)?;
        clock.phase("seed");
        return turned(on, seed, options, clock);
    }
    let mut made = Err(Error::NoSurface);
    for other in 0..OTHER_SEEDS {
        let seed = surface::chosen(
            field,
            options.seed.wrapping_add(other << 32),
            &options.region,
        )?;
        clock.phase("seed");
        made = turned(on, seed, options, std::mem::take(&mut clock));
        // Where the function has an edge projections end on it.
        if !matches!(made, Err(Error::NoPatch { .. })) {
            break;
        }
    }
    made
}

/// Only one that is so many times as large is larger: where directions are alike, rounding is not
/// to decide.
const CLEARLY: f64 = 1.01;

/// Grows a patch; with a tolerance along the lines of curvature, between them, and along the seed's
/// own directions, and at other paces, and takes the largest: which of them it is depends on the
/// place.
fn turned(
    on: On<'_>,
    seed: Seed,
    options: &Options,
    mut clock: Clock,
) -> Result<Parameterized, Error> {
    let Some(tolerance) = options.tolerance.filter(|_| !options.exact) else {
        return grown(on, seed, None, (options, Pace::of(options)), clock);
    };
    let scale = options.region.diagonal();
    let frame = |angle: f64| surface::frame(on.field(), seed.point, angle, scale);
    // What is proved counts first.
    let worth = |p: &Parameterized| {
        (
            p.is_unfolded && p.distances.bound.is_some_and(|b| b <= tolerance),
            p.grown.area(&options.region),
        )
    };
    let along = frame(0.0)?;
    let own = (seed.tangents != along.tangents).then_some((seed, Pace::EVEN));
    let starts = [
        Some((along, Pace::EVEN)),
        Some((frame(FRAC_PI_4)?, Pace::EVEN)),
        own,
        Some((seed, Pace::STEADY)),
        Some((seed, Pace::QUICK)),
    ];
    let mut grown: Vec<(f64, Growth<'_>)> = Vec::new();
    let mut made = Err(Error::NoPatch { at: seed.point });
    for (start, pace) in starts.into_iter().flatten() {
        match grow(on, start, None, (options, pace)) {
            Ok(growth) => {
                let is_late = growth.is_late;
                grown.push((growth.area(&options.region), growth));
                if is_late {
                    break;
                }
            }
            Err(error) => made = Err(error),
        }
    }
    clock.phase("grow");
    // Proofs only make patches smaller: the largest goes first, and those that cannot become the
    // largest any more are not proved.
    while let Some(most) = grown.iter().map(|g| g.0).reduce(f64::max) {
        if made.as_ref().is_ok_and(|m| {
            let (keeps, area) = worth(m);
            m.is_late || (keeps && most <= CLEARLY * area)
        }) {
            break;
        }
        let next = (grown.iter().position(|g| CLEARLY * g.0 >= most)).unwrap_or(0);
        let other = proved(grown.remove(next).1, options, std::mem::take(&mut clock));
        made = match (made, other) {
            (Ok(a), Ok(b)) => {
                let (x, y) = (worth(&a), worth(&b));
                let seconds = both(&a.seconds, &b.seconds);
                Ok(Parameterized {
                    seconds,
                    ..if y.0 && !x.0 || y.0 == x.0 && y.1 > CLEARLY * x.1 {
                        b
                    } else {
                        a
                    }
                })
            }
            (Err(_), b) => b,
            (a, Err(_)) => a,
        };
    }
    made
}

/// The times of two runs together, by phase.
fn both(a: &[(&'static str, f64)], b: &[(&'static str, f64)]) -> Vec<(&'static str, f64)> {
    let of = |name: &str| b.iter().filter(|p| p.0 == name).map(|p| p.1).sum::<f64>();
    a.iter().map(|p| (p.0, p.1 + of(p.0))).collect()
}

/// Grows one patch on one of the parts of a surface, as far as its edges, and proves how far from
/// the surface it is.
///
/// The patch stays on the part on which its seed lies; it reaches beyond the edges of the part by
/// less than the tolerance.
pub fn parameterize_part(parts: &Parts, options: &Options) -> Result<Parameterized, Error> {
    check(options)?;
    let unit = UnitBox::of(&options.region);
    let inside = unit.options(options);
    parameterize_part_in_unit_box(&unit.parts(parts), &inside)
        .map(|made| {
            let part = made.part;
            unit.made_out(made, parts.parts[part].field.as_ref())
        })
        .map_err(|error| unit.error_out(error))
}

fn parameterize_part_in_unit_box(parts: &Parts, options: &Options) -> Result<Parameterized, Error> {
    let whole = Whole::of_parts(parts, &options.region);
    let (part, point) = match options.seed_point {
        Some(p) => nearest(&whole, p, options).ok_or(Error::FarSeed { at: p })?,
        None => chosen(&whole, options).ok_or(Error::NoSurface)?,
    };
    at(&whole, part, point, options, NearSingular::Cross)
}

/// The point of the surface that a place leads to, with its part.
fn nearest(whole: &Whole<'_>, p: Point3, options: &Options) -> Option<(usize, Point3)> {
    let scale = options.region.diagonal();
    let mut best: Option<(f64, usize, Point3)> = None;
    for part in 0..whole.len() {
        let foot = surface::project(whole.field(part), p, scale)
            .filter(|q| surface::contains(&options.region, *q));
        let Some(q) = foot.filter(|q| whole.is_on(part, *q, scale)) else {
            continue;
        };
        let d = norm(sub(q, p));
        if best.is_none_or(|b| d < b.0) {
            best = Some((d, part, q));
        }
    }
    best.map(|b| (b.1, b.2))
}

/// A random point of the surface, far from edges.
fn chosen(whole: &Whole<'_>, options: &Options) -> Option<(usize, Point3)> {
    let (mut random, scale) = (
        surface::Random::new(options.seed),
        options.region.diagonal(),
    );
    let mut best: Option<(f64, usize, Point3)> = None;
    let mut found = 0;
    for _ in 0..CHOICE.1 {
        let Some((part, q)) = nearest(whole, random.place(&options.region), options) else {
            continue;
        };
        let d = whole
            .nearest_edge(part, q, scale)
            .map_or(f64::INFINITY, |(e, _)| norm(sub(e, q)));
        if best.is_none_or(|b| d > b.0) {
            best = Some((d, part, q));
        }
        found += 1;
        if found == CHOICE.0 {
            break;
        }
    }
    best.map(|b| (b.1, b.2))
}

/// Grows a patch about a point of a part.
pub(crate) fn at(
    whole: &Whole<'_>,
    part: usize,
    point: Point3,
    options: &Options,
    near_singular: NearSingular<'_>,
) -> Result<Parameterized, Error> {
    let mut clock = Clock::default();
    let on = On {
        whole,
        part,
        near_singular,
    };
    let (scale, unit) = (
        options.region.diagonal(),
        options.region.size().into_iter().fold(0.0, f64::max),
    );
    let own = surface::frame(on.field(), point, 0.0, scale)?;
    let (mut seed, mut from) = (own, None);
    if let Some((foot, edge)) = (!whole.is_single())
        .then(|| whole.nearest_edge(part, point, scale))
        .flatten()
        && let Some(tangents) = on.along(edge, foot, point)
    {
        let far = norm(sub(foot, point));
        if far <= AT_EDGE * unit {
            seed = Seed {
                point: foot,
                tangents,
                ..seed
            };
            from = Some(edge);
        } else if far * seed.curvature <= NEAR_EDGE {
            seed = Seed {
                tangents: in_plane(tangents, on.field().jet(point).g),
                ..seed
            };
        }
    }
    let ridge = (whole.is_single())
        .then(|| surface::ridge(on.field(), point, scale))
        .flatten();
    if let Some(ridge) = ridge {
        seed = surface::frame(on.field(), ridge, 0.0, scale)?;
    }
    clock.phase("seed");
    let made = grown(on, seed, from, (options, Pace::of(options)), clock);
    let keeps = |p: &Parameterized| {
        p.is_unfolded
            && p.distances
                .bound
                .is_some_and(|b| options.tolerance.is_none_or(|t| b <= t))
    };
    let serves = |p: &Parameterized| {
        keeps(p)
            && options
                .tolerance
                .is_none_or(|t| reached(&p.grown.patch, &[point], t)[0])
    };
    if (from.is_none() && ridge.is_none()) || made.as_ref().is_ok_and(serves) {
        return made;
    }
    // Where nothing fits at the edge or ridge, or does not come as far as the point: about the
    // point itself.
    let start = if ridge.is_some() {
        own
    } else {
        let tangents = in_plane(seed.tangents, on.field().jet(point).g);
        Seed { tangents, ..own }
    };
    let again = grown(
        on,
        start,
        None,
        (options, Pace::of(options)),
        Clock::default(),
    );
    if ridge.is_some() || again.as_ref().is_ok_and(keeps) || made.is_err() {
        again
    } else {
        made
    }
}

/// Tangents turned into the plane with a normal.
fn in_plane(tangents: [Point3; 2], normal: Point3) -> [Point3; 2] {
    let n = normal.map(|v| v / norm(normal));
    let d = isoform_geom::dot(tangents[0], n);
    let t: Point3 = std::array::from_fn(|k| tangents[0][k] - d * n[k]);
    let t = t.map(|v| v / norm(t));
    [t, isoform_geom::cross(n, t)]
}

/// Grows a patch and proves how far from the surface it is.
fn grown<'f>(
    on: On<'f>,
    seed: Seed,
    edge: Option<&'f dyn Field>,
    (options, pace): (&Options, Pace),
    mut clock: Clock,
) -> Result<Parameterized, Error> {
    let growth = grow(on, seed, edge, (options, pace))?;
    clock.phase("grow");
    proved(growth, options, clock)
}

/// Grows a patch, exact if that is asked for; nothing is proved of it.
fn grow<'f>(
    on: On<'f>,
    seed: Seed,
    edge: Option<&'f dyn Field>,
    (options, pace): (&Options, Pace),
) -> Result<Growth<'f>, Error> {
    let (asked, options) = (options, &options.relaxed());
    let (whole, field) = (on.whole, on.field());
    // A patch that ends at edges would leave them.
    let to_be_exact = options.exact && whole.is_single();
    // Tori and cylinders have exact patches of low degree only along their lines of curvature.
    let seed = if to_be_exact {
        surface::frame(field, seed.point, 0.0, options.region.diagonal())?
    } else {
        seed
    };
    if options.method == Method::Newton && field.jet3(seed.point).is_none() {
        return Err(Error::NoThirdDerivatives);
    }
    // Patches along edges get long: L, which is about squared lengths, would not care for the
    // shorter ones.
    let inner = if whole.is_single() {
        options.inner
    } else {
        Inner::Tangents
    };
    let objective =
        |degree| Objective::new(field, degree, options.method, options.nodes).with_inner(inner);
    // A patch without a bound is worth less than a smaller one.
    let growing = options
        .deadline
        .map(|d| (Instant::now(), d))
        .map(|(now, d)| now + (d.saturating_duration_since(now)).mul_f64(GROWING_TIME));
    let mut growth = Growth::start(
        objective(options.degree),
        on,
        seed,
        edge,
        (
            &Options {
                deadline: growing,
                ..*options
            },
            pace,
        ),
    )?;
    growth.grow_to_limit();
    growth.options.deadline = options.deadline;
    if to_be_exact {
        make_exact(&mut growth, |degree, share| {
            let small = Options {
                degree,
                limit: share * asked.limit,
                tolerance: None,
                ..*asked
            };
            let options = if share < 1.0 {
                small
            } else {
                Options { degree, ..*options }
            };
            let mut other = Growth::start(
                objective(degree),
                on,
                seed,
                None,
                (&options, Pace::of(&options)),
            )
            .ok()?;
            other.grow_to_limit();
            Some(other)
        });
    }
    Ok(growth)
}

/// Proves how far from the surface a patch is, and that it does not fold over; it is made smaller
/// where that fails.
fn proved(
    mut growth: Growth<'_>,
    options: &Options,
    mut clock: Clock,
) -> Result<Parameterized, Error> {
    let options = &options.relaxed();
    let (on, seed_point) = (growth.on(), growth.seed_point());
    let whole = on.whole;
    let proved = growth.keep_tolerance();
    if proved.is_none() && matches!(on.near_singular, NearSingular::Try) {
        return Err(Error::NoPatch { at: seed_point });
    }
    let (mut known, mut place) = distances_on(
        whole,
        &growth.patch,
        options.tolerance,
        proved,
        options.deadline,
    );
    // A patch that keeps the tolerance is proved not to fold over, too.
    let mut fold = proved
        .is_none()
        .then(|| growth.prove_unfolded().err())
        .flatten();
    // Where nothing can be proved, of a smaller patch it may be.
    for share in RETREATS {
        if (known.bound.is_some() && fold.is_none()) || growth.is_over() {
            break;
        }
        let left = match fold {
            Some(place) => growth.leave(place, share),
            None => growth.retreat(share),
        };
        if !left {
            break;
        }
        (known, place) = distances_on(
            whole,
            &growth.patch,
            options.tolerance,
            None,
            options.deadline,
        );
        fold = growth.prove_unfolded().err();
    }
    // A side that comes over an edge between samples makes a bound that these do not show.
    let is_loose = |d: &Distances| {
        d.bound
            .is_some_and(|b| b > LOOSE * d.sampled + ROUNDING * options.region.diagonal())
    };
    for _ in 0..TRIMMINGS {
        if whole.is_single() || !is_loose(&known) || growth.is_over() {
            break;
        }
        let before = growth.state();
        growth.trim_finely(
            known.sampled.max(ROUNDING * options.region.diagonal()),
            place,
        );
        if growth.is_as(&before) {
            break;
        }
        let (trimmed, its_place) = distances_on(
            whole,
            &growth.patch,
            options.tolerance,
            None,
            options.deadline,
        );
        if trimmed
            .bound
            .is_none_or(|b| known.bound.is_some_and(|k| b >= k))
        {
            growth.settle(before);
            break;
        }
        (known, place) = (trimmed, its_place);
        fold = growth.prove_unfolded().err();
    }
    if fold.is_some() && fold::seen(&growth.patch).is_some() {
        return Err(Error::Folded { at: seed_point });
    }
    clock.phase("certify");
    let is_within_limit = growth.is_within_limit();
    let diagonal = options.region.diagonal();
    // Proofs on parts need not come near rounding, which their samples show to first order only.
    let proved = if whole.is_single() { PROVED } else { EXACT };
    let is_exact =
        known.sampled <= EXACT * diagonal && known.bound.is_some_and(|b| b <= proved * diagonal);
    Ok(Parameterized {
        part: on.part,
        quadric: None,
        is_late: growth.is_late,
        shortenings: growth.shortenings,
        grown: growth.finish(),
        distances: known,
        is_unfolded: fold.is_none(),
        is_within_limit,
        is_exact,
        seconds: clock.seconds,
    })
}

/// Takes the time of phases.
struct Clock {
    since: Instant,
    seconds: Vec<(&'static str, f64)>,
}

impl Default for Clock {
    fn default() -> Self {
        Self {
            since: Instant::now(),
            seconds: Vec::new(),
        }
    }
}

impl Clock {
    /// A phase has ended.
    fn phase(&mut self, name: &'static str) {
        self.seconds
            .push((name, self.since.elapsed().as_secs_f64()));
        self.since = Instant::now();
    }
}

pub(crate) fn check(options: &Options) -> Result<(), Error> {
    let (m, n) = options.degree;
    if !(1..=MOST_DEGREE).contains(&m) || !(1..=MOST_DEGREE).contains(&n) {
        return Err(Error::Degree(m, n));
    }
    let size = options.region.size();
    if !size.iter().all(|s| *s > 0.0 && s.is_finite()) {
        return Err(Error::Region);
    }
    for (name, value) in [
        ("the bound on S", Some(options.limit)),
        ("the tolerance", options.tolerance),
    ] {
        if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
            return Err(Error::Option { name, value });
        }
    }
    if let Some(p) = options
        .seed_point
        .filter(|p| !p.iter().all(|v| v.is_finite()))
    {
        return Err(Error::NotFinite { at: p });
    }
    Ok(())
}
