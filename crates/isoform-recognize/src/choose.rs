//! Model selection: the simplest kind of surface that explains a region as well as any other.

use crate::chart::{Primitive, PrimitiveKind};
use crate::cloud::Cloud;
use crate::fit::{Precision, fit, squares};
use crate::grow::{SurfaceRegion, are_rows, correlation, grow, peeled};
use crate::noise::{CHANCE_DEVIATIONS, MAX_EXACT_NOISE};
use crate::start::{Axis, bent_squares};
use isoform_geom::dot;
use rayon::prelude::*;

/// Sizes of the sets of neighbours that regions grow from: small sets lie within small faces, large
/// ones reveal curvature in noise. The flag restricts a set to neighbours with similar normals,
/// which keeps it on one side of an edge.
const SEED_SET_SIZES: [(usize, bool); 5] = [
    (48, true),
    (24, true),
    (12, true),
    (128, false),
    (48, false),
];

/// Standard deviation of the points, and its uncertainty.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise {
    pub(crate) deviation: f64,
    /// Factor by which the true deviation may exceed `deviation`.
    pub(crate) slack: f64,
    /// True if `deviation` is a tolerance of form, larger than the noise of the points. Distances
    /// of neighbours are then correlated, which does not count against a surface.
    pub(crate) is_form: bool,
}

impl Noise {
    /// Returns true if regions may be tested for borders that belong to other surfaces. Exact
    /// points of other surfaces are never taken, and distances under a tolerance of form do not
    /// average to zero.
    pub(crate) fn can_peel(self) -> bool {
        // More noise carries the points of other faces over strips as wide as small faces are: the
        // borders of these are all off.
        !self.is_form && (MAX_EXACT_NOISE..0.003).contains(&self.deviation)
    }

    /// Returns the share of the variance per point below which a difference in Σ r² is irrelevant:
    /// two such surfaces are equally good.
    fn material(self) -> f64 {
        if self.is_form {
            // Residuals are then the form of a real object, which one surface of many follows
            // better in part. With less, balls come as tori, with 1 shallow cones as cylinders.
            0.25
        } else {
            // Surfaces whose distance is below a tenth of the noise (squared here) are one to any
            // use; without this bound a form error of a scan would count as evidence.
            0.01
        }
    }
}

/// Returns the minimum number of points of an entity by kind: more than five times the number of
/// parameters. With fewer, curved kinds follow any smooth scrap.
pub(crate) fn least_points(kind: PrimitiveKind, noise: f64) -> usize {
    let is_exact = noise < MAX_EXACT_NOISE;
    match kind {
        PrimitiveKind::Plane => {
            if is_exact {
                16
            } else {
                35
            }
        }
        PrimitiveKind::Sphere => {
            if is_exact {
                20
            } else {
                70
            }
        }
        PrimitiveKind::Cylinder => {
            if is_exact {
                24
            } else {
                50
            }
        }
        PrimitiveKind::Cone => {
            if is_exact {
                30
            } else {
                70
            }
        }
        PrimitiveKind::Torus => {
            if is_exact {
                40
            } else {
                80
            }
        }
    }
}

/// Returns true if a surface with `more` additional parameters is justified by the decrease of Σ r²
/// from `simple` to `bent` on equal points.
pub(crate) fn is_called_for(
    more: usize,
    points: usize,
    simple: f64,
    bent: f64,
    parameters: usize,
    noise: Noise,
) -> bool {
    let n = points as f64;
    let free = points.saturating_sub(parameters).max(1) as f64;
    let variance = noise.deviation.powi(2).max(bent / free);
    let gain = (simple - bent) / variance;
    // Each parameter costs ln n, as in Bayes's criterion. The eight more are for the many kinds
    // that are tried at many places: by chance a gain of 30 is passed once in 10⁶ trials.
    let asked = more as f64 * n.ln() + 8.0;
    gain > asked.max(noise.material() * n)
}

/// Returns true if a surface with `more` additional parameters could be justified at all: by one
/// that leaves Σ r² = 0.
pub(crate) fn may_be_called_for(more: usize, points: usize, simple: f64, noise: Noise) -> bool {
    is_called_for(more, points, simple, 0.0, 0, noise)
}

/// Known surfaces, and the label of each point.
#[derive(Clone, Copy, Default)]
pub(crate) struct KnownSurfaces<'a> {
    pub(crate) surfaces: &'a [Primitive],
    pub(crate) labels: &'a [u32],
}

impl KnownSurfaces<'_> {
    /// Returns the axes of the surfaces that some points lie on.
    pub(crate) fn axes(self, points: &[u32]) -> Vec<Axis> {
        let label = |i: &u32| self.labels.get(*i as usize).copied();
        let mut labels: Vec<u32> = points.iter().filter_map(label).collect();
        labels.sort_unstable();
        labels.dedup();
        let surfaces = labels.iter().filter_map(|l| self.surfaces.get(*l as usize));
        surfaces
            .filter(|s| s.is_round())
            .map(|s| (s.place, s.axis))
            .collect()
    }
}

/// Sets of free points about a seed from which regions grow.
struct SeedSets {
    near: Vec<u32>,
    /// Points with normals similar to the seed's.
    alike: Vec<u32>,
    /// Axes of known surfaces nearby, about which chamfers, fillets and bores mostly lie.
    axes: Vec<Axis>,
}

impl SeedSets {
    fn about(
        cloud: &Cloud,
        seed: u32,
        known: KnownSurfaces<'_>,
        is_free: &impl Fn(u32) -> bool,
    ) -> Self {
        let mut near = cloud.around(seed, 128);
        let axes = known.axes(&near);
        near.retain(|i| is_free(*i));
        let normal = cloud.normals[seed as usize];
        // Similar normals differ by at most 40°.
        let is_alike = |i: &&u32| dot(cloud.normals[**i as usize], normal).abs() >= 0.77;
        let alike = near.iter().filter(is_alike).copied().collect();
        Self { near, alike, axes }
    }

    fn all(&self) -> Vec<&[u32]> {
        SEED_SET_SIZES
            .iter()
            .map(|(size, is_smooth)| (*size, if *is_smooth { &self.alike } else { &self.near }))
            .filter(|(size, from)| *size <= from.len())
            .map(|(size, from)| &from[..size])
            .collect()
    }
}

/// Returns the region about a seed, of the kind that its points justify.
pub(crate) fn best_region(
    cloud: &Cloud,
    seed: u32,
    kinds: &[PrimitiveKind],
    noise: Noise,
    known: KnownSurfaces<'_>,
    is_free: &(impl Fn(u32) -> bool + Sync),
) -> Option<SurfaceRegion> {
    let sets = SeedSets::about(cloud, seed, known, is_free);
    let grown = |kind: PrimitiveKind| largest(cloud, &sets, kind, noise, is_free);
    let (first, others) = kinds.split_first()?;
    let simple = grown(*first);
    if simple
        .as_ref()
        .is_some_and(|r| is_plainly_flat(cloud, r, noise))
    {
        return simple;
    }
    let bent: Vec<Option<SurfaceRegion>> = others.par_iter().map(|kind| grown(*kind)).collect();
    choose(cloud, [simple].into_iter().chain(bent).flatten(), noise)
}

/// Returns the largest region of a kind that follows its points, from the first set that grows well
/// beyond itself.
fn largest(
    cloud: &Cloud,
    sets: &SeedSets,
    kind: PrimitiveKind,
    noise: Noise,
    is_free: &(impl Fn(u32) -> bool + Sync),
) -> Option<SurfaceRegion> {
    let mut best: Option<SurfaceRegion> = None;
    for set in sets.all() {
        let Some(region) = grow(cloud, set, &sets.axes, kind, noise.deviation, is_free) else {
            continue;
        };
        let region = match noise.can_peel() {
            true => peeled(cloud, region, noise.deviation),
            false => region,
        };
        if region.points.len() < least_points(kind, noise.deviation)
            || !follows(
                cloud,
                [&region.core, &region.points],
                &region.surface,
                noise,
            )
            || cloud.is_exact(noise.deviation) && are_rows(cloud, &region.points)
        {
            continue;
        }
        // A region that has grown to three times its seed needs no other seed.
        let has_grown = region.points.len() >= 3 * set.len();
        if best
            .as_ref()
            .is_none_or(|b| region.points.len() > b.points.len())
        {
            best = Some(region);
        }
        if has_grown {
            break;
        }
    }
    best
}

/// Returns true if a plane is large and shows no curvature, so that other kinds need not be tried.
fn is_plainly_flat(cloud: &Cloud, region: &SurfaceRegion, noise: Noise) -> bool {
    let surface = &region.surface;
    // 150 points of the core of a plane show a bend if there is one.
    if surface.kind != PrimitiveKind::Plane || region.core.len() < 150 {
        return false;
    }
    let points = cloud.at(&region.core);
    let before = squares(surface, &points);
    let after = bent_squares(surface, &points);
    !is_called_for(1, points.len(), before, after, 6, noise)
}

/// Returns the simplest of regions, given by rising kind, that no other one beats.
fn choose(
    cloud: &Cloud,
    regions: impl Iterator<Item = SurfaceRegion>,
    noise: Noise,
) -> Option<SurfaceRegion> {
    let mut best: Option<SurfaceRegion> = None;
    for region in regions {
        best = match best {
            None => Some(region),
            Some(simple) if beats(cloud, &region, &simple, noise) => Some(region),
            simple => simple,
        };
    }
    best
}

/// Returns true if a surface follows its points up to independent noise: those of its core, or all
/// of them. Along edges all points include strips of other faces; the core of a face behind a thin
/// wall consists of points whose neighbours happen to have similar noise.
pub(crate) fn follows(
    cloud: &Cloud,
    [core, points]: [&[u32]; 2],
    surface: &Primitive,
    noise: Noise,
) -> bool {
    let is_one = |points: &[u32]| {
        is_near(cloud, points, surface, noise)
            && (noise.is_form
                || is_rounding(cloud, points, surface)
                || is_independent(correlation(cloud, points, surface)))
    };
    is_one(core) || is_one(points)
}

/// Returns true if points are off a surface by no more than rounding (that of the modeller
/// included), which may be correlated between neighbours.
fn is_rounding(cloud: &Cloud, points: &[u32], surface: &Primitive) -> bool {
    // Rounded points may deviate by 1.2 deviations of rounding (root mean square).
    let most = MAX_EXACT_NOISE.max(1.2 * cloud.grid);
    squares(surface, &cloud.at(points)) <= most * most * points.len() as f64
}

/// Returns true if points deviate by no more than the noise.
fn is_near(cloud: &Cloud, points: &[u32], surface: &Primitive, noise: Noise) -> bool {
    let parameters = surface.kind.parameters();
    let free = points.len().saturating_sub(parameters).max(1) as f64;
    let rms = (squares(surface, &cloud.at(points)) / free).sqrt() / noise.deviation;
    surface.is_wider_than(noise.deviation)
        && rms <= noise.slack + CHANCE_DEVIATIONS / (2.0 * free).sqrt()
}

fn is_independent((correlation, deviation): (f64, f64)) -> bool {
    correlation <= 0.045 + CHANCE_DEVIATIONS * deviation
}

/// Returns true if a region of a kind with more parameters explains the points better.
fn beats(cloud: &Cloud, bent: &SurfaceRegion, simple: &SurfaceRegion, noise: Noise) -> bool {
    // A kind with more parameters also wins if it explains 1.6 times as many points: the simpler
    // one is then a strip of it.
    if bent.core.len() as f64 >= 1.6 * simple.core.len() as f64 {
        return true;
    }
    if bent.core.len() * 10 < simple.core.len() * 9 {
        return false;
    }
    let points = cloud.at(&simple.core);
    let before = squares(&simple.surface, &points);
    let [p, q] = [simple, bent].map(|r| r.surface.kind.parameters());
    if !may_be_called_for(q - p, points.len(), before, noise) {
        return false;
    }
    let Some((_, after)) = fit(&bent.surface, &points, Precision::Rough) else {
        return false;
    };
    is_called_for(q - p, points.len(), before, after, q, noise)
}
