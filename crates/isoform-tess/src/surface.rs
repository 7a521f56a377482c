//! The whole way from a map to the triangles of its surface in a box.

use crate::analysis::{Analysis, Budget, analyse, analyse_clear};
use crate::claim::{Basis, Claim, Grade, graded};
use crate::deck::Deck;
use crate::domain::Domain;
use crate::double_curve::DoubleCurve;
use crate::equation::Equation;
use crate::finding::{Finding, Phase};
use crate::joined::join;
use crate::map::Map;
pub use crate::mesh::matching::Crossing;
use crate::mesh::matching::matching;
use crate::mesh::{Changes, Curves, mesh};
use crate::patch::Patch;
use crate::region::{Region, Triangle, is_clear};
use isoform_algebra::{ArrangementError, RBig};
use isoform_control::{Control, Stopped};
use isoform_geom::Aabb;
pub use isoform_geom::Point3;
use std::collections::BTreeMap;
use std::time::Instant;

/// Whether sheets that cross are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// They are not: two vertices may share a position on the double curve, and every edge has one
    /// or two triangles.
    Normalised,
    /// They are cut and joined along the double curve, whose edges have four triangles or more.
    Glued,
}

/// How fine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// Largest distance of the middles of triangles and edges from the surface, in units of space.
    pub tolerance: f64,
    /// Largest length of edges.
    pub longest: f64,
    /// Number of triangles at which refinement stops.
    pub triangles: usize,
}

/// What to make of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangulateOptions {
    /// Half the width of the box around the origin.
    pub half_width: RBig,
    /// The part of the parameter plane to which the surface is restricted: all of it if there is
    /// none.
    pub domain: Option<Domain>,
    /// Whether sheets that cross are joined.
    pub mode: Mode,
    /// How fine.
    pub mesh: MeshOptions,
    /// What the exact analysis may cost.
    pub budget: Budget,
}

/// What a vertex is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Of the surface, nothing special.
    Ordinary,
    /// On a face of the box.
    Box,
    /// Where sheets meet.
    Double,
    /// On the seam curve of a base point.
    Seam,
    /// The one image of a whole curve.
    Contracted,
    /// On a curve or in a point where the rank of the map drops.
    Cusp,
    /// On a side of the domain, or on a fold of an improper map.
    Border,
}

/// An arc in which sheets of the surface meet.
#[derive(Clone, Debug, PartialEq)]
pub struct DoubleArc {
    /// Its vertices.
    pub points: Vec<Point3>,
    /// How many sheets meet in it.
    pub sheets: usize,
}

/// Triangles of a surface in a box.
#[derive(Clone, Debug, Default)]
pub struct Surface {
    /// Vertices.
    pub points: Vec<Point3>,
    /// What they are.
    pub kinds: Vec<Kind>,
    /// Corners of the triangles.
    pub triangles: Vec<[u32; 3]>,
    /// The unit triangle that each lies in, as in [`isoform_algebra::QUADRANTS`].
    pub charts: Vec<u8>,
    /// u and v of its corners there.
    pub corners: Vec<[[f64; 2]; 3]>,
    /// Rows of the matrix that takes what these stand for to (s, t, w), where parameters were not
    /// left as they are.
    pub frame: Option<[[f64; 3]; 3]>,
    /// The patch that each triangle is of, where patches were joined.
    pub patches: Vec<u32>,
    /// Arcs in which real sheets meet.
    pub double_curve: Vec<DoubleArc>,
    /// Real points of the surface that only conjugate parameters reach, as polylines.
    pub solitary_arcs: Vec<Vec<Point3>>,
    /// What is not proved; empty if everything is. A claim with a finding does not hold.
    pub findings: Vec<Finding>,
    /// What is claimed of the surface as far as it was made: [`Surface::claims`] has all of it.
    pub grades: Vec<Grade>,
    /// Whether the double curve was looked for and drawn to the end, as sheets that are to be
    /// joined need it.
    pub is_double_curve_known: bool,
    /// Whether it is certain that the map sends no parameters into the box: then there are no
    /// triangles to be had.
    pub is_outside: bool,
    /// How many of the parameters that are drawn lead to a general point, complex ones included: 1
    /// for a proper map, and for an improper one of which a fundamental domain is drawn; 0 if it is
    /// unknown.
    pub sheets: usize,
    /// The faces of the box that each vertex is on, as bits, and whether sheets meet there.
    pub(crate) faces: Vec<u8>,
    /// The sides of the domain that the corners of the triangles are on, as bits; a fold counts as
    /// the first side.
    pub(crate) borders: Vec<[u64; 3]>,
    pub(crate) double: Vec<bool>,
}

/// Edges from the lesser vertex to the greater: how many triangles they have, and whether they lie
/// on a side of the domain in one of them.
pub(crate) type Edges = BTreeMap<[u32; 2], (usize, bool)>;

impl Surface {
    /// Whether nothing was found against any claim.
    pub fn is_certified(&self) -> bool {
        self.findings.is_empty()
    }
    /// Whether nothing was found against a claim.
    pub fn holds(&self, claim: Claim) -> bool {
        self.findings.iter().all(|f| f.claim() != claim)
    }
    /// What is claimed, each claim once, with the basis on which it was decided: also those that
    /// do not hold.
    pub fn claims(&self) -> Vec<Grade> {
        let open = self.findings.iter().map(|f| f.claim().into());
        graded(self.grades.iter().copied().chain(open))
    }
    /// Its edges; `borders` has the sides of the domain that count for the corners of each
    /// triangle, as bits.
    pub(crate) fn edges(&self, borders: &[[u64; 3]]) -> Edges {
        let mut edges = Edges::new();
        for (t, bits) in self.triangles.iter().zip(borders) {
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (count, is_border) = edges.entry([t[i].min(t[j]), t[i].max(t[j])]).or_default();
                *count += 1;
                *is_border |= bits[i] & bits[j] != 0;
            }
        }
        edges
    }
    /// How many edges have one triangle, and lie neither in a face of the box nor on a side of the
    /// domain.
    pub(crate) fn open_edges(&self, edges: &Edges) -> usize {
        let same_face = |e: &[u32; 2]| self.faces[e[0] as usize] & self.faces[e[1] as usize] != 0;
        edges
            .iter()
            .filter(|(e, (n, is_border))| *n == 1 && !is_border && !same_face(e))
            .count()
    }
    /// Whether both ends of an edge are on the double curve.
    pub(crate) fn is_double(&self, edge: &[u32; 2]) -> bool {
        edge.iter().all(|&v| self.double[v as usize])
    }
}

/// The parameters of a surface in a box, decomposed by curves.
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

/// How far triangles may be from the surface by its implicit equation, in tolerances.
const FAR: f64 = 1.5;

/// A map analysed, and the parameters that it sends into a box: all but the triangles.
pub struct Prepared<'a> {
    map: &'a Map,
    options: &'a TriangulateOptions,
    /// What is known of the map; `seconds` of the triangles, too.
    pub analysis: Analysis,
    curves: Curves,
    region: Region,
    solitary: Vec<Vec<Point3>>,
    sheets: usize,
    findings: Vec<Finding>,
    grades: Vec<Grade>,
    changes: Changes,
}

impl<'a> Prepared<'a> {
    /// Analyses a map and finds the parameters of its surface in a box.
    ///
    /// # Errors
    /// [`Stopped`], if not even the region of parameters was found in time.
    pub fn new(
        map: &'a Map,
        options: &'a TriangulateOptions,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let enough = control.for_seconds(options.budget.seconds);
        let domain = options.domain.as_ref();
        let is_local = options.mode == Mode::Normalised
            && !options.budget.everywhere
            && domain.is_some_and(|d| is_clear(map, &options.half_width, d));
        let mut analysis = if is_local {
            analyse_clear(map, control)
        } else {
            analyse(map, &options.budget, control)
        };
        let mut findings = analysis.findings.clone();
        let mut grades = analysis.grades();
        let map_degree = analysis.degrees.map_or(0, |d| d.map_degree);
        let base_points = analysis.base_points.as_deref().unwrap_or_default();
        let deck = match map_degree > 1 && domain.is_none() {
            true => Deck::new(map, base_points, &enough).unwrap_or_else(|Stopped| {
                findings.push(Finding::Stopped(Phase::DeckTransformations));
                None
            }),
            false => None,
        };
        grades.extend(deck.iter().flat_map(|d| deck_grades(d, base_points.len())));
        let clock = Instant::now();
        let glued = options.mode == Mode::Glued;
        let double = DoubleCurve::new(map, &analysis, options, &enough);
        if double.needs_no_equation {
            findings.retain(|f| f.claim() != Claim::DoubleCurves);
        }
        findings.extend(double.findings);
        grades.extend(double.grades);
        analysis
            .seconds
            .push(("double curve", clock.elapsed().as_secs_f64()));
        let clock = Instant::now();
        let mut curves = Curves::new(
            &analysis,
            glued,
            deck.clone(),
            double.pinches,
            double.fibres,
            double.traced,
        );
        let within = |curves: &Curves, control: &Control<'_>| {
            region(map, options, curves, deck.as_ref(), control)
        };
        let region = match within(&curves, if glued { &enough } else { control }) {
            Ok(region) => region,
            // Better sheets that cross than nothing.
            Err(_) if glued => {
                findings.push(Finding::SheetsNotJoined);
                curves = Curves::new(&analysis, false, deck.clone(), Vec::new(), None, None);
                within(&curves, control).map_err(|_| Stopped)?
            }
            Err(_) => return Err(Stopped),
        };
        analysis
            .seconds
            .push(("region", clock.elapsed().as_secs_f64()));
        grades.push(Claim::Region.into());
        if region.is_clear {
            grades.push(Claim::Weights.into());
        }
        Ok(Self {
            map,
            options,
            analysis,
            curves,
            region,
            solitary: double.solitary,
            sheets: map_degree / deck.as_ref().map_or(1, Deck::order),
            findings,
            grades,
            changes: Changes::default(),
        })
    }

    /// Whether the double curve was traced, and its parameters are not decomposed by its equation,
    /// which is known.
    pub fn may_decompose(&self) -> bool {
        let singular = self.analysis.singular.as_ref();
        self.curves.is_traced() && singular.is_some_and(|s| s.double.is_some())
    }

    /// Decomposes the parameters by the equation of the double curve, where arcs stood for it.
    ///
    /// # Errors
    /// [`Stopped`]: then nothing is changed.
    pub fn decompose(&mut self, control: &Control<'_>) -> Result<(), Stopped> {
        let traced = self.curves.decompose(&self.analysis);
        let clock = Instant::now();
        let found = region(self.map, self.options, &self.curves, None, control);
        let seconds = clock.elapsed().as_secs_f64();
        self.analysis.seconds.push(("region again", seconds));
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

    /// The triangles; `findings` repeats what the analysis could not prove.
    pub fn surface(&mut self, control: &Control<'_>) -> Surface {
        let clock = Instant::now();
        let mut surface = mesh(
            self.map,
            &self.region,
            &self.analysis,
            &self.curves,
            &self.options.mesh,
            &self.changes,
            control,
        );
        let seconds = clock.elapsed().as_secs_f64();
        match self
            .analysis
            .seconds
            .iter_mut()
            .find(|s| s.0 == "triangles")
        {
            Some(known) => known.1 += seconds,
            None => self.analysis.seconds.push(("triangles", seconds)),
        }
        surface.solitary_arcs.clone_from(&self.solitary);
        let is_inside = |t: &Triangle| t.inside.iter().flatten().any(|inside| *inside);
        surface.sheets = self.sheets;
        surface.is_outside = !self.region.triangles.iter().any(is_inside);
        surface.findings.extend(self.findings.iter().cloned());
        surface.grades.extend(&self.grades);
        surface
    }

    /// Boxes of triangles that are too far from the surface, as its implicit equation says to first
    /// order, if that is known. They are near enough to the sheet that they stand for; but where
    /// sheets touch, what looks at the equation alone finds them farther away.
    pub fn far(&self, surface: &Surface) -> Vec<[Point3; 2]> {
        let Some(implicit) = &self.analysis.implicit else {
            return Vec::new();
        };
        let equation = Equation::new(implicit);
        let corners = |t: &[u32; 3]| t.map(|v| surface.points[v as usize]);
        let is_far = |[p, q, r]: &[Point3; 3]| {
            let center: Point3 = std::array::from_fn(|k| (p[k] + q[k] + r[k]) / 3.0);
            equation
                .distance(center)
                .is_some_and(|d| d > FAR * self.options.mesh.tolerance)
        };
        surface
            .triangles
            .iter()
            .map(corners)
            .filter(is_far)
            .map(|t| Aabb::of(&t))
            .map(|b| [b.lo, b.hi])
            .collect()
    }

    /// Divides the tolerance by four in and around boxes, given by their least and greatest
    /// coordinates: for the next [`Prepared::surface`].
    pub fn refine(&mut self, boxes: &[[Point3; 2]]) {
        self.changes
            .fineness
            .refine(boxes, self.options.half_width.to_f64().value());
        self.changes.matched.clear();
    }

    /// Gives the sheets of triangles that cross each other's vertices, in the next
    /// [`Prepared::surface`], up to a change of tolerance. Pairs of triangles of `surface`.
    pub fn match_sheets(&mut self, surface: &Surface, pairs: &[Crossing]) {
        let half_width = self.options.half_width.to_f64().value();
        self.changes
            .matched
            .extend(matching(self.map, half_width, surface, pairs));
    }
}

/// What is claimed of the deck transformations of a map with so many real base points.
fn deck_grades(deck: &Deck, base_points: usize) -> [Grade; 2] {
    let domain = Grade {
        claim: Claim::FundamentalDomain,
        // What is blown up to a fold is known exactly; at other base points directions are tried.
        basis: match base_points == deck.folded.len() {
            true => Basis::Exact,
            false => Claim::FundamentalDomain.basis(),
        },
    };
    [Claim::DeckTransformations.into(), domain]
}

/// Analyses a map and triangulates its surface in a box. The analysis says in `seconds` how long
/// the triangulation took, too; the surface repeats in `findings` what the analysis could not
/// prove.
///
/// # Errors
/// [`Stopped`], if not even the region of parameters was found in time.
pub fn triangulate(
    map: &Map,
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Analysis), Stopped> {
    let mut prepared = Prepared::new(map, options, control)?;
    let surface = prepared.surface(control);
    Ok((surface, prepared.analysis))
}

/// One surface of the surfaces of patches, each over [0, 1]² and in the same box: joined along
/// sides with the same control points.
///
/// # Panics
/// If there are not as many surfaces as patches.
pub fn join_patches(patches: &[Patch], surfaces: Vec<Surface>, half_width: f64) -> Surface {
    assert_eq!(patches.len(), surfaces.len(), "a surface for every patch");
    join(patches, surfaces, half_width)
}
