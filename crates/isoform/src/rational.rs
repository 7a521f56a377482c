//! Rational surfaces with a last look at their triangles.

use isoform_algebra::RBig;
use isoform_check::{self as check, Intersections, Place, certify};
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh};
use isoform_tess::{
    Analysis, Budget, Claim, Crossing, Domain, Finding, Frame, Map, MapError, Mode, Patch, Point3,
    Prepared, Stopped, Surface, TriangulateOptions, join_patches,
};
use std::time::Instant;

/// How often the surface is made again, finer where its implicit equation finds triangles far away.
const NEARER: usize = 2;
/// How often it is made again where triangles cross, by all changes together: with other vertices,
/// or finer.
const ROUNDS: usize = 12;
/// How many times a finer tolerance may be no better than what was there before.
const IN_VAIN: usize = 2;
/// More pairs of triangles that cross than this are no accident of sheets that are close together.
const MOST: usize = 2000;

/// What is changed where triangles cross.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    /// Both sheets get the corners of the other's triangles.
    Corners,
    /// And what lies between them.
    Places,
    /// The tolerance is divided.
    Finer,
}

impl Change {
    /// What comes after it, if fewer triangles crossed, or not.
    fn next(self, is_fewer: bool) -> Self {
        match self {
            _ if is_fewer => Self::Corners,
            Self::Finer => Self::Corners,
            Self::Corners => Self::Places,
            Self::Places => Self::Finer,
        }
    }
}

/// [`isoform_tess::triangulate`]; where sheets are joined, triangles that cross all the same are
/// found exactly. The surface is made again with the vertices of both sheets in both of them, or
/// with a finer tolerance there; pairs that are left are said to cross.
///
/// Parameters far from their place are brought there first ([`Frame`]): what is said of them is said
/// of the map's own, but for the corners of triangles, whose frame the surface names.
///
/// # Errors
/// [`Stopped`].
pub fn rational_surface(
    map: &Map,
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Analysis), Stopped> {
    let Some(frame) = Frame::of(map) else {
        return surface_in_place(map, options, control);
    };
    let inner = TriangulateOptions {
        domain: options.domain.as_ref().map(|d| frame.domain(d)),
        ..options.clone()
    };
    let (mut surface, analysis) = surface_in_place(&frame.map(map), &inner, control)?;
    surface.frame = Some(frame.matrix());
    Ok((surface, frame.analysis(analysis)))
}

/// The surface of a map whose parameters are in their place.
fn surface_in_place(
    map: &Map,
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Analysis), Stopped> {
    let mut prepared = Prepared::new(map, options, control)?;
    let mut surface = prepared.surface(control);
    if prepared.may_decompose()
        && surface.findings.iter().any(is_ill_drawn)
        && prepared.decompose(control).is_ok()
    {
        surface = prepared.surface(control);
    }
    for _ in 0..NEARER {
        let far = prepared.far(&surface);
        if far.is_empty() || !surface.is_certified() || control.is_stopped() {
            break;
        }
        prepared.refine(&far);
        let next = prepared.surface(control);
        if !next.is_certified() {
            break;
        }
        surface = next;
    }
    let mut is_embedded = surface.triangles.is_empty();
    if options.mode == Mode::Glued && !is_embedded {
        let mut seconds = 0.0;
        let mut look = |surface: &Surface| {
            let clock = Instant::now();
            let found = crossings(surface, control);
            seconds += clock.elapsed().as_secs_f64();
            found
        };
        let mut found = look(&surface);
        // What was changed so far is changed in the next round, too, whatever came of it: what is
        // kept is the best.
        let mut last: Option<(Surface, Intersections)> = None;
        let mut change = Change::Corners;
        let mut in_vain = 0;
        for _ in 0..ROUNDS {
            let (tried, i) = match (&last, &found) {
                (Some((tried, i)), _) => (tried, i),
                (None, Some(i)) => (&surface, i),
                (None, None) => break,
            };
            // What is open for other reasons is not mended by this.
            let is_hopeless =
                !tried.is_certified() || tried.triangles.len() > options.mesh.triangles / 2;
            if i.pairs.is_empty()
                || !i.complete
                || is_hopeless
                || in_vain == IN_VAIN
                || control.is_stopped()
            {
                break;
            }
            match change {
                Change::Finer => prepared.refine(&boxes(tried, i)),
                _ => prepared.match_sheets(tried, &pairs(i, change == Change::Places)),
            }
            let next = prepared.surface(control);
            if !next.is_certified() && change != Change::Finer {
                // Other vertices did harm.
                change = Change::Finer;
                continue;
            }
            let Some(crossing) = look(&next) else { break };
            let is_fewer = crossing.pairs.count < i.pairs.count;
            let is_better = next.is_certified()
                && found
                    .as_ref()
                    .is_none_or(|f| crossing.pairs.count < f.pairs.count);
            in_vain += usize::from(change == Change::Finer && !is_better);
            change = change.next(is_fewer);
            if is_better {
                surface = next.clone();
                found = Some(crossing.clone());
                in_vain = 0;
            }
            last = Some((next, crossing));
        }
        surface.grades.push(Claim::Crossings.into());
        surface.findings.extend(found_crossing(found.as_ref()));
        let embedded = |i: &Intersections| i.complete && i.pairs.is_empty();
        is_embedded = found.as_ref().is_some_and(embedded);
        prepared.analysis.seconds.push(("crossings", seconds));
    }
    if surface.sheets > 1 {
        surface.grades.push(Claim::Sheets.into());
        if !is_embedded {
            surface.findings.push(Finding::SheetsUponEachOther);
        }
    }
    Ok((surface, prepared.analysis))
}

/// Whether a finding is about what was drawn in the parameters: other arcs may do better.
fn is_ill_drawn(finding: &Finding) -> bool {
    let claims = [Claim::Drawing, Claim::Partners, Claim::Edges, Claim::Shapes];
    claims.contains(&finding.claim())
}

/// Why patches have no triangles.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatchesError {
    /// One of them is no surface.
    #[error("{name}: {error}")]
    Map {
        /// Which.
        name: String,
        /// Why.
        error: MapError,
    },
    /// The time was over.
    #[error("stopped")]
    Stopped,
}

/// Patches, each over [0, 1]², as one mesh: joined along the sides that they have in common. The
/// domain of the options is not looked at. Of a patch that is proved to have no pole and to lie in
/// the box only contracted curves are looked for, unless its sheets are to be joined.
///
/// # Errors
/// [`PatchesError`].
pub fn rational_patches(
    patches: &[Patch],
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Vec<(Map, Analysis)>), PatchesError> {
    let unit = || [RBig::ZERO, RBig::ONE];
    let domain = Domain::rectangle(unit(), unit()).ok();
    let is_normalised = options.mode == Mode::Normalised;
    let implicit_degree = if is_normalised {
        0
    } else {
        options.budget.implicit_degree
    };
    let budget = Budget {
        implicit_degree,
        everywhere: false,
        ..options.budget
    };
    let mut options = TriangulateOptions {
        domain,
        budget,
        ..options.clone()
    };
    let (mut surfaces, mut known) = (Vec::new(), Vec::new());
    for patch in patches {
        let map = patch.map().map_err(|error| PatchesError::Map {
            name: patch.name.clone(),
            error,
        })?;
        let (surface, analysis) = surface_in_place(&map, &options, control)
            .map_err(|_: Stopped| PatchesError::Stopped)?;
        options.mesh.triangles = options
            .mesh
            .triangles
            .saturating_sub(surface.triangles.len());
        surfaces.push(surface);
        known.push((map, analysis));
    }
    let mut joined = join_patches(patches, surfaces, options.half_width.to_f64().value());
    if patches.len() > 1 && !is_normalised {
        joined.findings.push(Finding::PatchesNotCut);
    }
    Ok((joined, known))
}

/// What crossings, or that there was no time to look for them, stand against.
fn found_crossing(found: Option<&Intersections>) -> Option<Finding> {
    match found {
        Some(i) if !i.complete => Some(Finding::CrossingsAbove(i.pairs.count.min(MOST))),
        Some(i) if i.pairs.is_empty() => None,
        Some(i) => Some(Finding::Crossings(i.pairs.count)),
        None => Some(Finding::CrossingsUnknown),
    }
}

/// None if there was no time to look for all of them.
fn crossings(surface: &Surface, control: &Control<'_>) -> Option<Intersections> {
    if control.is_stopped() {
        return None;
    }
    let mesh = Mesh {
        points: surface.points.clone(),
        triangles: surface.triangles.clone(),
        ..Mesh::default()
    };
    let options = check::Options {
        places: MOST,
        pairs: MOST,
        ..check::Options::default()
    };
    let silent = Control {
        progress: None,
        ..*control
    };
    certify(&mesh, None, &options, &silent)
        .intersections
        .filter(|_| !control.is_stopped())
}

/// The triangles that cross, with points where they do if `deep`.
fn pairs(found: &Intersections, deep: bool) -> Vec<Crossing> {
    let pair = |p: &Place| {
        let triangles = <[u32; 2]>::try_from(p.elements.as_slice()).ok()?;
        Some(Crossing {
            triangles,
            point: deep.then_some(p.at),
        })
    };
    found.pairs.places.iter().filter_map(pair).collect()
}

/// Around the triangles that cross.
fn boxes(surface: &Surface, found: &Intersections) -> Vec<[Point3; 2]> {
    let triangles = found.pairs.places.iter().flat_map(|p| &p.elements);
    let around =
        |t: &u32| Aabb::of(&surface.triangles[*t as usize].map(|v| surface.points[v as usize]));
    triangles.map(around).map(|b| [b.lo, b.hi]).collect()
}
