//! Surfaces without crossing triangles: a surface with crossings is triangulated again.
//!
//! First both sheets get each other's vertices at a crossing, then further vertices in between,
//! then a finer tolerance ([`Change`]), until no triangles cross or no change helps; crossings that
//! remain are reported. Crossing triangles are found by the certificate of meshes ([`certify`]), by
//! exact signs.

use crate::analysis::{Analysis, Running};
use crate::claim::Claim;
use crate::domain::Domain;
use crate::finding::Finding;
use crate::frame::Frame;
use crate::map::{Map, MapError};
use crate::patch::Patch;
use crate::surface::{Mode, Point3, Surface, TriangulateError, TriangulateOptions};
use crate::triangulate::{Crossing, Prepared, join_patches};
use isoform_algebra::RBig;
use isoform_check::{Place, certify};
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh};

/// Maximum number of repetitions because of crossing triangles, over all kinds of change.
const MAX_CROSSING_ROUNDS: usize = 12;

/// Maximum number of crossing pairs that are repaired: more are not an accident of sheets that are
/// close together.
const MAX_CROSSING_PAIRS: usize = 2000;

/// The crossing triangles of a surface.
struct Crossings {
    /// Number of pairs found.
    count: usize,
    /// True if no pairs were left out.
    is_complete: bool,
    /// The first [`MAX_CROSSING_PAIRS`] pairs, each with a point at which they cross.
    pairs: Vec<Crossing>,
}

impl Crossings {
    /// Finds the crossing triangles; `None` if the time is over before the search ends.
    fn find(surface: &Surface, control: &Control<'_>) -> Option<Self> {
        if control.is_stopped() {
            return None;
        }
        let mesh = Mesh {
            points: surface.points.clone(),
            triangles: surface.triangles.clone(),
            ..Mesh::default()
        };
        let options = isoform_check::Options {
            places: MAX_CROSSING_PAIRS,
            pairs: MAX_CROSSING_PAIRS,
            ..isoform_check::Options::default()
        };
        let found = certify(&mesh, None, &options, &silent(control)).intersections?;
        if control.is_stopped() {
            return None;
        }
        let pair = |p: &Place| {
            let triangles = <[u32; 2]>::try_from(p.elements.as_slice()).ok()?;
            Some(Crossing {
                triangles,
                point: Some(p.at),
            })
        };
        Some(Self {
            count: found.pairs.count,
            is_complete: found.complete,
            pairs: found.pairs.places.iter().filter_map(pair).collect(),
        })
    }
    fn are_none(&self) -> bool {
        self.is_complete && self.pairs.is_empty()
    }
}

/// Name under which the search for crossings and their repair are reported to the control.
const CROSSINGS: &str = "crossings";

/// Returns the control of work that is a part of a phase, or a repetition: it reports no progress.
fn silent<'a>(control: &Control<'a>) -> Control<'a> {
    Control {
        progress: None,
        ..*control
    }
}

/// A change of the triangulation to remove crossings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    /// Insertion of the corners of the crossing triangles into the respective other sheet.
    Corners,
    /// Insertion of the crossing points, in addition.
    Places,
    /// Division of the tolerance.
    Finer,
}

impl Change {
    /// Returns the next change; `is_fewer` tells if the last one reduced the number of crossings.
    fn next(self, is_fewer: bool) -> Self {
        match self {
            _ if is_fewer => Self::Corners,
            Self::Finer => Self::Corners,
            Self::Corners => Self::Places,
            Self::Places => Self::Finer,
        }
    }
}

/// Analyses a map and triangulates its surface in a box. The analysis includes the duration of the
/// triangulation in `seconds`; the surface repeats in `findings` what the analysis could not prove.
///
/// Where sheets are joined, the remaining crossings of triangles are found exactly. The surface is
/// triangulated again with the vertices of both sheets in each of them, or with a finer tolerance
/// there; pairs that remain are findings.
///
/// Badly scaled parameters are normalised first ([`Frame`]). All results refer to the parameters of
/// the given map, except the corners of triangles, whose frame is stored in the surface.
///
/// ```
/// use isoform_tess::{Claim, Control, Map, TriangulateOptions, triangulate};
///
/// // The unit sphere by stereographic projection.
/// let map = Map::parse(["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"], Default::default())?;
/// let mut options = TriangulateOptions::around(2.into());
/// options.mesh.tolerance = 0.02;
/// let (surface, analysis) = triangulate(&map, &options, &Control::default())?;
/// assert!(surface.is_certified() && surface.holds(Claim::Crossings));
/// assert_eq!(analysis.degrees.map(|d| (d.map_degree, d.implicit_degree)), Some((1, 2)));
/// // Its vertices lie on it, including the north pole at infinite parameters, and V − E + F = 2.
/// let radius = |p: &[f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
/// assert!(surface.points.iter().all(|p| (radius(p) - 1.0).abs() < 1e-12));
/// assert!(surface.points.contains(&[0.0, 0.0, 1.0]));
/// assert_eq!(2 * surface.points.len(), surface.triangles.len() + 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The phases in `seconds` of the analysis are reported to the control.
///
/// # Errors
/// Options that are out of range, and [`TriangulateError::Stopped`] if not even the region of
/// parameters was found in time.
pub fn triangulate(
    map: &Map,
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Analysis), TriangulateError> {
    options.check()?;
    let Some(frame) = Frame::find(map) else {
        return in_place(map, options, control);
    };
    let inner = TriangulateOptions {
        domain: options.domain.as_ref().map(|d| frame.domain(d)),
        ..options.clone()
    };
    let (mut surface, analysis) = in_place(&frame.map(map), &inner, control)?;
    surface.frame = Some(frame.matrix());
    frame.curves(&mut surface.real_border.folds);
    Ok((surface, frame.analysis(analysis)))
}

/// Triangulates the surface of a map whose parameters are normalised.
fn in_place(
    map: &Map,
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Analysis), TriangulateError> {
    let mut prepared = Prepared::new(map, options, control)?;
    let mut surface = prepared.surface(control);
    let again = silent(control);
    if prepared.may_decompose()
        && surface.findings.iter().any(is_ill_drawn)
        && prepared.decompose(control).is_ok()
    {
        surface = prepared.surface(&again);
    }
    surface = prepared.nearer(surface, &again);
    let mut is_embedded = surface.triangles.is_empty();
    if options.mode == Mode::Glued && !is_embedded {
        let found;
        (surface, found) = prepared.without_crossings(surface, control);
        control.report(CROSSINGS, 1.0);
        is_embedded = found.as_ref().is_some_and(Crossings::are_none);
        surface
            .decisions
            .decide([Claim::Crossings], [Claim::Crossings.usual()]);
        surface.findings.extend(crossing_finding(found.as_ref()));
    }
    if surface.sheets > 1 {
        surface
            .decisions
            .decide([Claim::Sheets], [Claim::Sheets.usual()]);
        if !is_embedded {
            surface.findings.push(Finding::OverlappingSheets);
        }
    }
    Ok((surface, prepared.analysis))
}

/// Returns true if a finding concerns the drawing in the parameters: other arcs may do better.
fn is_ill_drawn(finding: &Finding) -> bool {
    let claims = [Claim::Drawing, Claim::Partners, Claim::Edges, Claim::Shapes];
    claims.contains(&finding.claim())
}

/// Returns the finding about crossings, or about missing time to find them.
fn crossing_finding(found: Option<&Crossings>) -> Option<Finding> {
    match found {
        Some(c) if !c.is_complete => Some(Finding::CrossingsAbove(c.pairs.len())),
        Some(c) if c.pairs.is_empty() => None,
        Some(c) => Some(Finding::Crossings(c.count)),
        None => Some(Finding::CrossingsUnknown),
    }
}

/// A surface and its crossing triangles.
struct CrossingAttempt {
    surface: Surface,
    crossings: Crossings,
}

impl CrossingAttempt {
    /// Returns true if no triangles cross, or if the remaining findings cannot be repaired by other
    /// vertices.
    fn is_final(&self, options: &TriangulateOptions) -> bool {
        self.crossings.pairs.is_empty()
            || !self.crossings.is_complete
            || !self.surface.is_certified()
            || self.surface.triangles.len() > options.mesh.triangles / 2
    }
    /// Returns the crossing triangles without their points of crossing.
    fn triangles(&self) -> Vec<Crossing> {
        let without = |c: &Crossing| Crossing { point: None, ..*c };
        self.crossings.pairs.iter().map(without).collect()
    }
    /// Returns the bounding boxes of the crossing triangles.
    fn boxes(&self) -> Vec<[Point3; 2]> {
        let s = &self.surface;
        let of_triangle = |t: u32| {
            let b = Aabb::from_points(&s.triangles[t as usize].map(|v| s.points[v as usize]));
            [b.lo, b.hi]
        };
        let triangles = self.crossings.pairs.iter().flat_map(|c| c.triangles);
        triangles.map(of_triangle).collect()
    }
}

impl Prepared<'_> {
    /// Triangulates a surface again, with a finer tolerance where its implicit equation finds
    /// triangles far away.
    fn nearer(&mut self, mut surface: Surface, control: &Control<'_>) -> Surface {
        // The surface is triangulated at most twice more, finer where its implicit equation finds
        // triangles too far away.
        for _ in 0..2 {
            let far = self.far(&surface);
            if far.is_empty() || !surface.is_certified() || control.is_stopped() {
                break;
            }
            self.refine(&far);
            let next = self.surface(control);
            if !next.is_certified() {
                break;
            }
            surface = next;
        }
        surface
    }
    /// Finds the crossing triangles of a surface; `None` if the time is over before the search
    /// ends.
    fn crossings(&mut self, surface: &Surface, control: &Control<'_>) -> Option<Crossings> {
        let control = silent(control);
        let running = Running::new(CROSSINGS, &control);
        let found = Crossings::find(surface, &control);
        self.analysis.took(running);
        found
    }
    /// Applies a change to the preparation of the next surface, where the triangles of one cross.
    fn change(&mut self, change: Change, tried: &CrossingAttempt) {
        match change {
            Change::Finer => self.refine(&tried.boxes()),
            Change::Corners => self.match_sheets(&tried.surface, &tried.triangles()),
            Change::Places => self.match_sheets(&tried.surface, &tried.crossings.pairs),
        }
    }
    /// Returns the best surface found, with its crossing triangles; `None` in their place if there
    /// was no time to find them.
    fn without_crossings(
        &mut self,
        surface: Surface,
        control: &Control<'_>,
    ) -> (Surface, Option<Crossings>) {
        control.report(CROSSINGS, 0.0);
        let Some(crossings) = self.crossings(&surface, control) else {
            return (surface, None);
        };
        let mut best = CrossingAttempt { surface, crossings };
        // Earlier changes stay in effect in the next round, whether they helped or not. The best
        // surface is the result; the last one is kept in addition if it is not the best.
        let mut last: Option<CrossingAttempt> = None;
        let mut change = Change::Corners;
        let mut in_vain = 0;
        for round in 1..=MAX_CROSSING_ROUNDS {
            let tried = last.as_ref().unwrap_or(&best);
            // Two finer tolerances without improvement end the search.
            if tried.is_final(self.options()) || in_vain == 2 || control.is_stopped() {
                break;
            }
            control.report(CROSSINGS, round as f64 / (MAX_CROSSING_ROUNDS + 1) as f64);
            self.change(change, tried);
            let surface = self.surface(&silent(control));
            if !surface.is_certified() && change != Change::Finer {
                // Other vertices made it worse.
                change = Change::Finer;
                continue;
            }
            let Some(crossings) = self.crossings(&surface, control) else {
                break;
            };
            let is_fewer = crossings.count < tried.crossings.count;
            let is_better = surface.is_certified() && crossings.count < best.crossings.count;
            in_vain += usize::from(change == Change::Finer && !is_better);
            change = change.next(is_fewer);
            let next = CrossingAttempt { surface, crossings };
            if is_better {
                (best, last) = (next, None);
                in_vain = 0;
            } else {
                last = Some(next);
            }
        }
        (best.surface, Some(best.crossings))
    }
}

/// Reason why patches have no triangles.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatchesError {
    /// One of the patches is not a surface.
    #[error("{name}: {error}")]
    Map {
        /// Name of the patch.
        name: String,
        /// Reason why it is not a surface.
        error: MapError,
    },
    /// An option is out of range.
    #[error("{name} is {value}, which is out of range")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Value of the option, to the nearest double.
        value: f64,
    },
    /// The time was over.
    #[error("stopped")]
    Stopped,
}

impl From<TriangulateError> for PatchesError {
    fn from(error: TriangulateError) -> Self {
        match error {
            TriangulateError::Option { name, value } => Self::Option { name, value },
            TriangulateError::Stopped => Self::Stopped,
        }
    }
}

/// Returns the options for each of several patches: the unit square as domain, only contracted
/// curves of patches that are proved clear, and no implicit equation if sheets are not compared.
fn of_one_patch(options: &TriangulateOptions) -> TriangulateOptions {
    let mut options = options.clone();
    options.domain = Domain::rectangle([RBig::ZERO, RBig::ONE], [RBig::ZERO, RBig::ONE]).ok();
    options.budget.everywhere = false;
    if options.mode == Mode::Normalised {
        options.budget.implicit_degree = 0;
    }
    options
}

/// Triangulates patches, each over [0, 1]², into one mesh, as [`triangulate`] does, and joins them
/// along common sides. The domain of the options is ignored. For a patch that provably has no pole
/// and lies in the box, only contracted curves are computed, unless its sheets are to be joined.
/// Patches whose image is a curve or a point are left out ([`Surface::collapsed`]) if there are
/// others, also from the list of maps and analyses. [`TriangulateOptions::of_patches`] returns the
/// options of the program.
///
/// The phases in `seconds` of the analyses are reported to the control; each patch has an equal
/// share of them.
///
/// ```
/// use isoform_geom::RationalPatch;
/// use isoform_tess::{Control, Patch, SurfaceBox, TriangulateOptions, triangulate_patches};
///
/// // Two squares of the hyperbolic paraboloid z = x y, which have a side in common.
/// let square = |x: f64| {
///     let corner = |i: f64, j: f64| [x + i, j, (x + i) * j, 1.0];
///     let corners = [corner(0.0, 0.0), corner(0.0, 1.0), corner(1.0, 0.0), corner(1.0, 1.0)];
///     RationalPatch::new((1, 1), corners.to_vec())
/// };
/// let patches = [Patch::from(&square(0.0)?), Patch::from(&square(1.0)?)];
/// let around = SurfaceBox::of_patches(&patches).expect("no pole");
/// let options = TriangulateOptions::of_patches(&around);
/// let (surface, known) = triangulate_patches(&patches, &options, &Control::default())?;
/// assert!(surface.is_certified());
/// assert_eq!(known.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`PatchesError`].
pub fn triangulate_patches(
    patches: &[Patch],
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Vec<(Map, Analysis)>), PatchesError> {
    options.check()?;
    let is_normalised = options.mode == Mode::Normalised;
    let mut options = of_one_patch(options);
    let (mut surfaces, mut known) = (Vec::new(), Vec::new());
    let (mut drawn, mut collapsed) = (Vec::new(), Vec::new());
    for (k, patch) in patches.iter().enumerate() {
        let map = match patch.map() {
            Ok(map) => map,
            // A span without area in space: the surface is complete without it.
            Err(MapError::NotASurface { .. }) if drawn.len() + patches.len() > k + 1 => {
                collapsed.push(k as u32);
                continue;
            }
            Err(error) => {
                let name = patch.name.clone();
                return Err(PatchesError::Map { name, error });
            }
        };
        drawn.push(k as u32);
        let share = |phase: &str, done: f64| {
            control.report(phase, (k as f64 + done) / patches.len() as f64);
        };
        let control = Control {
            progress: control.progress.is_some().then_some(&share as _),
            ..*control
        };
        let (surface, analysis) = in_place(&map, &options, &control)?;
        let made = surface.triangles.len();
        options.mesh.triangles = options.mesh.triangles.saturating_sub(made);
        surfaces.push(surface);
        known.push((map, analysis));
    }
    let half_width = options.half_width.to_f64().value();
    // Sides of patches without triangles cannot be common sides.
    let kept: Vec<_> = drawn.iter().map(|&k| patches[k as usize].clone()).collect();
    let mut joined = join_patches(&kept, surfaces, half_width);
    let given = joined.patches.iter_mut();
    given.for_each(|k| *k = drawn[*k as usize]);
    joined.collapsed = collapsed;
    if drawn.len() > 1 && !is_normalised {
        joined.findings.push(Finding::PatchesNotCut);
    }
    if joined.findings.is_empty() {
        joined.findings.extend(joined.lack());
    }
    Ok((joined, known))
}
