//! The complete pipeline from a map to the triangles of its surface in a box: analysis, deck
//! transformations, double curve, region, triangles.

use crate::analysis::{Analysis, Running, analyse, analyse_clear};
use crate::claim::{
    Basis, Claim, Decisions, OF_ANALYSIS, OF_DECK, OF_DOUBLE_CURVE, OF_REGION, OF_SURFACE, Verdict,
};
use crate::deck::Deck;
use crate::double_curve::DoubleCurve;
use crate::equation::Equation;
use crate::finding::{Finding, Phase};
use crate::joined::join;
use crate::map::Map;
pub use crate::mesh::matching::Crossing;
use crate::mesh::matching::matching;
use crate::mesh::{Changes, Curves, TRIANGLES, mesh};
use crate::patch::Patch;
use crate::real_border::RealBorder;
use crate::region::{Region, Triangle, is_clear};
use crate::surface::{Mode, Point3, Surface, TriangulateError, TriangulateOptions};
use isoform_algebra::ArrangementError;
use isoform_control::{Control, Stopped};
use isoform_geom::Aabb;

/// Findings against a surface so far, and the verdicts on claims.
#[derive(Default)]
struct Judgement {
    findings: Vec<Finding>,
    decisions: Decisions,
}

/// An analysed map with the parameters that it sends into a box: everything but the triangles.
pub struct Prepared<'a> {
    map: &'a Map,
    options: &'a TriangulateOptions,
    /// Analysis of the map; its `seconds` include those of the triangles.
    pub analysis: Analysis,
    curves: Curves,
    region: Region,
    solitary: Vec<Vec<Point3>>,
    sheets: usize,
    judgement: Judgement,
    /// Border of the real image, without lines.
    border: RealBorder,
    changes: Changes,
}

impl<'a> Prepared<'a> {
    /// Analyses a map and finds the parameters of its surface in a box.
    ///
    /// # Errors
    /// Options that are out of range, and [`TriangulateError::Stopped`] if not even the region of
    /// parameters was found in time.
    pub fn new(
        map: &'a Map,
        options: &'a TriangulateOptions,
        control: &Control<'_>,
    ) -> Result<Self, TriangulateError> {
        options.check()?;
        let enough = control.for_seconds(options.budget.seconds);
        let mut analysis = if needs_no_plane(map, options) {
            analyse_clear(map, control)
        } else {
            analyse(map, &options.budget, control)
        };
        let mut judgement = Judgement {
            findings: analysis.findings.clone(),
            decisions: Decisions::default(),
        };
        judgement.decisions.decide(OF_ANALYSIS, analysis.verdicts());
        let map_degree = analysis.degrees.map_or(0, |d| d.map_degree);
        let deck = judgement.deck(map, options, &analysis, &enough);
        let running = Running::new("double curve", control);
        let double = DoubleCurve::new(map, &analysis, options, &enough);
        if double.needs_no_equation {
            let is_of_double = |f: &Finding| f.claim() == Claim::DoubleCurves;
            judgement.findings.retain(|f| !is_of_double(f));
        }
        judgement.findings.extend(double.findings);
        judgement.decisions.decide(OF_DOUBLE_CURVE, double.verdicts);
        analysis.took(running);
        let running = Running::new("region", control);
        let is_glued = options.mode == Mode::Glued;
        let mut curves = Curves::new(
            &analysis,
            is_glued,
            deck.clone(),
            double.pinches,
            double.fibres,
            double.traced,
        );
        let within = |curves: &Curves, control: &Control<'_>| {
            region(map, options, curves, deck.as_ref(), control)
        };
        let region = match within(&curves, if is_glued { &enough } else { control }) {
            Ok(region) => region,
            // A surface with crossing sheets is better than none.
            Err(_) if is_glued => {
                judgement.findings.push(Finding::SheetsNotJoined);
                curves = Curves::new(&analysis, false, deck.clone(), Vec::new(), None, None);
                within(&curves, control).map_err(|_| Stopped)?
            }
            Err(_) => return Err(TriangulateError::Stopped),
        };
        analysis.took(running);
        let weights = Claim::Weights
            .usual()
            .or_not(region.is_clear, "W may have zeros, which are cut out");
        let verdicts = [weights, Claim::Region.usual()];
        judgement.decisions.decide(OF_REGION, verdicts);
        let border = region
            .deck
            .as_ref()
            .map(|deck| RealBorder::new(map, deck, control));
        Ok(Self {
            map,
            options,
            analysis,
            curves,
            region,
            border: border.unwrap_or_default(),
            solitary: double.solitary,
            sheets: map_degree / deck.as_ref().map_or(1, Deck::order),
            judgement,
            changes: Changes::default(),
        })
    }
    fn half_width(&self) -> f64 {
        self.options.half_width.to_f64().value()
    }
    /// Returns the options of the surface.
    pub(crate) fn options(&self) -> &TriangulateOptions {
        self.options
    }

    /// Returns true if the double curve was traced, while its equation, by which the parameters
    /// could be decomposed, is known.
    pub fn may_decompose(&self) -> bool {
        let singular = self.analysis.singular.as_ref();
        self.curves.is_traced() && singular.is_some_and(|s| s.double.is_some())
    }

    /// Decomposes the parameters by the equation of the double curve, in place of traced arcs.
    ///
    /// # Errors
    /// [`Stopped`]; then nothing is changed.
    pub fn decompose(&mut self, control: &Control<'_>) -> Result<(), Stopped> {
        let traced = self.curves.decompose(&self.analysis);
        let running = Running::new("region again", control);
        let found = region(self.map, self.options, &self.curves, None, control);
        self.analysis.took(running);
        match found {
            Ok(region) => {
                self.region = region;
                Ok(())
            }
            Err(_) => {
                self.curves.trace(traced);
                Err(Stopped)
            }
        }
    }

    /// Triangulates the surface; `findings` repeats what the analysis could not prove.
    pub fn surface(&mut self, control: &Control<'_>) -> Surface {
        let running = Running::new(TRIANGLES, control);
        let mut surface = mesh(
            self.map,
            &self.region,
            &self.analysis,
            &self.curves,
            &self.options.mesh,
            &self.changes,
            control,
        );
        self.analysis.took(running);
        surface.solitary_arcs.clone_from(&self.solitary);
        if self.region.deck.is_some() {
            surface.real_border = RealBorder {
                lines: surface.fold_lines(),
                ..self.border.clone()
            };
        }
        let is_inside = |t: &Triangle| t.inside.iter().flatten().any(|inside| *inside);
        surface.sheets = self.sheets;
        surface.is_outside = !self.region.triangles.iter().any(is_inside);
        surface
            .findings
            .extend(self.judgement.findings.iter().cloned());
        surface.findings.extend(surface.lack());
        surface.decisions.decide_all(&self.judgement.decisions);
        let one = Verdict::NotApplicable("it is the surface of one map");
        let apart = Verdict::NotApplicable("triangles that cross were not looked for");
        let sheets = Claim::Sheets.usual().or_not(
            self.region.deck.is_some() && !self.curves.is_glued(),
            "one of the parameters of each point is drawn, or sheets may cross",
        );
        surface.decisions.decide(OF_SURFACE, [one, apart, sheets]);
        surface
    }

    /// Returns the boxes of triangles that are too far from the surface by its implicit equation,
    /// to first order, if that is known. These triangles are near their own sheet; but where sheets
    /// touch, a test of the equation alone would find them too far away.
    pub fn far(&self, surface: &Surface) -> Vec<[Point3; 2]> {
        let Some(implicit) = &self.analysis.implicit else {
            return Vec::new();
        };
        let equation = Equation::new(implicit);
        // The equation gives the distance to first order only, and only centres of triangles are
        // tested: distances may exceed the tolerance by half.
        let far = 1.5 * self.options.mesh.tolerance;
        let is_far = |[p, q, r]: &[Point3; 3]| {
            let center: Point3 = std::array::from_fn(|k| (p[k] + q[k] + r[k]) / 3.0);
            equation.distance(center).is_some_and(|d| d > far)
        };
        let corners = |t: &[u32; 3]| t.map(|v| surface.points[v as usize]);
        let found = surface.triangles.iter().map(corners).filter(is_far);
        found
            .map(|t| Aabb::from_points(&t))
            .map(|b| [b.lo, b.hi])
            .collect()
    }

    /// Divides the tolerance by four in and around boxes, given by their minimum and maximum
    /// coordinates, for the next [`Prepared::surface`].
    pub fn refine(&mut self, boxes: &[[Point3; 2]]) {
        let half_width = self.half_width();
        self.changes.fineness.refine(boxes, half_width);
        self.changes.matched.clear();
    }

    /// Inserts the vertices of crossing triangles into each other's sheets in the next
    /// [`Prepared::surface`], up to a change of tolerance; `pairs` are triangles of `surface`.
    pub fn match_sheets(&mut self, surface: &Surface, pairs: &[Crossing]) {
        let places = matching(self.map, self.half_width(), surface, pairs);
        self.changes.matched.extend(places);
    }
}

/// Returns true if a surface over a domain needs no analysis of the whole plane.
fn needs_no_plane(map: &Map, options: &TriangulateOptions) -> bool {
    let is_clear = |d| is_clear(map, &options.half_width, d);
    options.mode == Mode::Normalised
        && !options.budget.everywhere
        && options.domain.as_ref().is_some_and(is_clear)
}

/// Decomposes the parameters of a surface in a box by curves.
fn region(
    map: &Map,
    options: &TriangulateOptions,
    curves: &Curves,
    deck: Option<&Deck>,
    control: &Control<'_>,
) -> Result<Region, ArrangementError> {
    let (domain, forms) = (options.domain.as_ref(), curves.forms());
    Region::within(map, &options.half_width, domain, deck, &forms, control)
}

impl Judgement {
    /// Finds the deck transformations of an improper map over the whole plane, and records the
    /// verdicts on them.
    fn deck(
        &mut self,
        map: &Map,
        options: &TriangulateOptions,
        analysis: &Analysis,
        control: &Control<'_>,
    ) -> Option<Deck> {
        let is_improper = analysis.degrees.is_some_and(|d| d.map_degree > 1);
        let none = Verdict::NotApplicable("no parameters are exchanged: all of them are drawn");
        self.decisions.decide(OF_DECK, [none; 2]);
        if !is_improper || options.domain.is_some() {
            return None;
        }
        let base_points = analysis.base_points.as_deref().unwrap_or_default();
        let found = Deck::new(map, base_points, control);
        let deck = found.unwrap_or_else(|Stopped| {
            let stopped = Finding::Stopped(Phase::DeckTransformations);
            self.findings.push(stopped);
            None
        })?;
        let verdicts = deck_verdicts(&deck, base_points.len());
        self.decisions.decide(OF_DECK, verdicts);
        Some(deck)
    }
}

/// Returns the verdicts on the claims of [`OF_DECK`], for a map with a number of real base points.
/// Base points that are blown up to a fold are known exactly; at the others, sample directions are
/// tested.
fn deck_verdicts(deck: &Deck, base_points: usize) -> [Verdict; 2] {
    let domain = match base_points == deck.folded.len() {
        true => Verdict::Holds(Basis::Exact),
        false => Claim::FundamentalDomain.usual(),
    };
    [Claim::DeckTransformations.usual(), domain]
}

/// Analyses a map and triangulates its surface in a box once, without the test for crossing
/// triangles that [`triangulate`](crate::triangulate) makes.
///
/// # Errors
/// Options that are out of range, and [`TriangulateError::Stopped`] if not even the region of
/// parameters was found in time.
pub fn triangulate_once(
    map: &Map,
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Analysis), TriangulateError> {
    let mut prepared = Prepared::new(map, options, control)?;
    let surface = prepared.surface(control);
    Ok((surface, prepared.analysis))
}

/// Joins the surfaces of patches, each over [0, 1]² and in one box, along sides with equal control
/// points.
///
/// # Panics
/// If the numbers of surfaces and patches differ.
pub fn join_patches(patches: &[Patch], surfaces: Vec<Surface>, half_width: f64) -> Surface {
    assert_eq!(patches.len(), surfaces.len(), "a surface for every patch");
    join(patches, surfaces, half_width)
}
