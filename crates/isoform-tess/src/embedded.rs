//! Surfaces whose triangles do not cross: where they do, the surface is made again.
//!
//! Both sheets get each other's vertices there, then further vertices in between, then a finer
//! tolerance ([`Change`]), until no triangles cross or nothing helps any more; what is left is
//! said. Triangles that cross are found by the certificate of meshes ([`certify`]), by exact signs.

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

/// The number of times that the surface is made again, finer where its implicit equation finds
/// triangles far away.
const NEARER: usize = 2;
/// The number of times that the surface is made again where triangles cross, by all changes
/// together.
const ROUNDS: usize = 12;
/// The number of times that a finer tolerance may be no better than the tolerance before.
const IN_VAIN: usize = 2;

/// More pairs of triangles that cross than this are no accident of sheets that are close together.
const MOST: usize = 2000;

/// The triangles of a surface that cross.
struct Crossings {
    /// The number of pairs that were found.
    count: usize,
    /// Whether these are all.
    is_complete: bool,
    /// The first [`MOST`] of the pairs, each with a point in which they cross.
    pairs: Vec<Crossing>,
}

impl Crossings {
    /// None if there was no time to look for all of them.
    fn of(surface: &Surface, control: &Control<'_>) -> Option<Self> {
        if control.is_stopped() {
            return None;
        }
        let mesh = Mesh {
            points: surface.points.clone(),
            triangles: surface.triangles.clone(),
            ..Mesh::default()
        };
        let options = isoform_check::Options {
            places: MOST,
            pairs: MOST,
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

/// The phase in which triangles that cross are looked for and mended, as its progress is told.
const CROSSINGS: &str = "crossings";

/// The control of work that is a part of a phase, or that is done again: it tells nothing.
fn silent<'a>(control: &Control<'a>) -> Control<'a> {
    Control {
        progress: None,
        ..*control
    }
}

/// A change where triangles cross.
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
    /// The next change, if fewer triangles crossed, or not.
    fn next(self, is_fewer: bool) -> Self {
        match self {
            _ if is_fewer => Self::Corners,
            Self::Finer => Self::Corners,
            Self::Corners => Self::Places,
            Self::Places => Self::Finer,
        }
    }
}

/// Analyses a map and triangulates its surface in a box. The analysis says in `seconds` how long
/// the triangulation took, too; the surface repeats in `findings` what the analysis could not
/// prove.
///
/// Where sheets are joined, triangles that cross all the same are found exactly. The surface is
/// made again with the vertices of both sheets in both of them, or with a finer tolerance there;
/// pairs that are left are findings.
///
/// Parameters far from their place are brought there first ([`Frame`]): what is said of them is
/// said of the map's own, but for the corners of triangles, whose frame the surface names.
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
/// // Vertices are on it, the north pole at infinite parameters among them, and V − E + F = 2.
/// let radius = |p: &[f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
/// assert!(surface.points.iter().all(|p| (radius(p) - 1.0).abs() < 1e-12));
/// assert!(surface.points.contains(&[0.0, 0.0, 1.0]));
/// assert_eq!(2 * surface.points.len(), surface.triangles.len() + 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The control hears of the phases in `seconds` of the analysis.
///
/// # Errors
/// Options that are out of range, and [`TriangulateError::Stopped`], if not even the region of
/// parameters was found in time.
pub fn triangulate(
    map: &Map,
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Analysis), TriangulateError> {
    options.check()?;
    let Some(frame) = Frame::of(map) else {
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

/// The surface of a map whose parameters are in their place.
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

/// The finding about crossings, or about no time to look for them.
fn crossing_finding(found: Option<&Crossings>) -> Option<Finding> {
    match found {
        Some(c) if !c.is_complete => Some(Finding::CrossingsAbove(c.pairs.len())),
        Some(c) if c.pairs.is_empty() => None,
        Some(c) => Some(Finding::Crossings(c.count)),
        None => Some(Finding::CrossingsUnknown),
    }
}

/// A surface and its triangles that cross.
struct Tried {
    surface: Surface,
    crossings: Crossings,
}

impl Tried {
    /// Whether nothing crosses, or what crosses, or is open for other reasons, is not mended by
    /// other vertices.
    fn is_final(&self, options: &TriangulateOptions) -> bool {
        self.crossings.pairs.is_empty()
            || !self.crossings.is_complete
            || !self.surface.is_certified()
            || self.surface.triangles.len() > options.mesh.triangles / 2
    }
    /// The triangles that cross, without the points where they do.
    fn triangles(&self) -> Vec<Crossing> {
        let without = |c: &Crossing| Crossing { point: None, ..*c };
        self.crossings.pairs.iter().map(without).collect()
    }
    /// The boxes of the triangles that cross.
    fn boxes(&self) -> Vec<[Point3; 2]> {
        let s = &self.surface;
        let of_triangle = |t: u32| {
            let b = Aabb::of(&s.triangles[t as usize].map(|v| s.points[v as usize]));
            [b.lo, b.hi]
        };
        let triangles = self.crossings.pairs.iter().flat_map(|c| c.triangles);
        triangles.map(of_triangle).collect()
    }
}

impl Prepared<'_> {
    /// A surface made again, finer where its implicit equation finds triangles far away.
    fn nearer(&mut self, mut surface: Surface, control: &Control<'_>) -> Surface {
        for _ in 0..NEARER {
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
    /// The triangles of a surface that cross; none if there was no time to look for all of them.
    fn crossings(&mut self, surface: &Surface, control: &Control<'_>) -> Option<Crossings> {
        let control = silent(control);
        let running = Running::new(CROSSINGS, &control);
        let found = Crossings::of(surface, &control);
        self.analysis.took(running);
        found
    }
    /// Changes what the next surface is made with, where the triangles of one cross.
    fn change(&mut self, change: Change, tried: &Tried) {
        match change {
            Change::Finer => self.refine(&tried.boxes()),
            Change::Corners => self.match_sheets(&tried.surface, &tried.triangles()),
            Change::Places => self.match_sheets(&tried.surface, &tried.crossings.pairs),
        }
    }
    /// The best surface that is found, with its triangles that cross; none if there was no time to
    /// look for them.
    fn without_crossings(
        &mut self,
        surface: Surface,
        control: &Control<'_>,
    ) -> (Surface, Option<Crossings>) {
        control.report(CROSSINGS, 0.0);
        let Some(crossings) = self.crossings(&surface, control) else {
            return (surface, None);
        };
        let mut best = Tried { surface, crossings };
        // Changes so far are made in the next round, too, whatever came of them: what is kept is
        // the best. The last one is kept beside it where it is not the best.
        let mut last: Option<Tried> = None;
        let mut change = Change::Corners;
        let mut in_vain = 0;
        for round in 1..=ROUNDS {
            let tried = last.as_ref().unwrap_or(&best);
            if tried.is_final(self.options()) || in_vain == IN_VAIN || control.is_stopped() {
                break;
            }
            control.report(CROSSINGS, round as f64 / (ROUNDS + 1) as f64);
            self.change(change, tried);
            let surface = self.surface(&silent(control));
            if !surface.is_certified() && change != Change::Finer {
                // Other vertices did harm.
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
            let next = Tried { surface, crossings };
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

/// Why patches have no triangles.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatchesError {
    /// One of them is no surface.
    #[error("{name}: {error}")]
    Map {
        /// The patch.
        name: String,
        /// Why it is none.
        error: MapError,
    },
    /// A number among the options is out of its range.
    #[error("{name} is {value}, which is out of range")]
    Option {
        /// The option.
        name: &'static str,
        /// Its value, to the nearest double.
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

/// The options for each of several patches: the unit square as domain, only contracted curves of
/// what is proved clear, and no equation where sheets are not looked at.
fn of_one_patch(options: &TriangulateOptions) -> TriangulateOptions {
    let mut options = options.clone();
    options.domain = Domain::rectangle([RBig::ZERO, RBig::ONE], [RBig::ZERO, RBig::ONE]).ok();
    options.budget.everywhere = false;
    if options.mode == Mode::Normalised {
        options.budget.implicit_degree = 0;
    }
    options
}

/// Triangulates patches, each over [0, 1]², as one mesh, as [`triangulate`] does: joined along the
/// sides that they have in common. The domain of the options is not looked at. Of a patch that is
/// proved to have no pole and to lie in the box only contracted curves are looked for, unless its
/// sheets are to be joined. Patches whose image is a curve or a point are left out
/// ([`Surface::collapsed`]), if there are others; maps and analyses are of the others. [`TriangulateOptions::of_patches`] are those of the program.
///
/// The control hears of the phases in `seconds` of the analyses: each patch is as much of them.
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
            // A span of zero width in space: the surface is complete without it.
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
    // Sides of what has no triangles are no sides that others have in common.
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
