//! The double curve in space: traced as arcs of pairs, or found along the curves of parameters.

use crate::analysis::Analysis;
use crate::base::Seam;
use crate::claim::{Basis, Claim, Verdict};
use crate::complex::{Form, rounded};
use crate::double::{Fibres, curves_of, pinch_points, solitary_arcs};
use crate::field::Algebraic;
use crate::finding::{Finding, Phase};
use crate::map::Map;
use crate::mesh::traced::TracedCurve;
use crate::pairs::{self, Expected, Pairs};
use crate::singular::{CurveKind, Singular, SingularCurve};
use crate::surface::{Mode, Point3, TriangulateOptions};
use isoform_control::{Control, Stopped};

/// Curves in space.
type Polylines = Vec<Vec<Point3>>;

/// Reasons why claims do not apply.
const NO_CURVE: &str = "there is no double curve";
const NOT_JOINED: &str = "sheets that cross are not joined";

/// Results of the search for the double curve, besides its equation.
pub(crate) struct DoubleCurve {
    /// Real parameters at which pairs of real parameters turn into conjugate pairs.
    pub(crate) pinches: Vec<[f64; 3]>,
    /// Fibres, which distinguish a real parameter alone from one that meets conjugate ones.
    pub(crate) fibres: Option<Fibres>,
    /// Arcs of real points that only conjugate parameters reach.
    pub(crate) solitary: Polylines,
    /// Arcs with both parameters; `None` if the curve of parameters is used instead.
    pub(crate) traced: Option<TracedCurve>,
    /// True if the arcs replace an implicit equation that is not known.
    pub(crate) needs_no_equation: bool,
    pub(crate) findings: Vec<Finding>,
    /// Verdicts on the claims of [`OF_DOUBLE_CURVE`](crate::claim::OF_DOUBLE_CURVE).
    pub(crate) verdicts: [Verdict; 3],
}

impl DoubleCurve {
    pub(crate) fn new(
        map: &Map,
        analysis: &Analysis,
        options: &TriangulateOptions,
        control: &Control<'_>,
    ) -> Self {
        let mut found = Self {
            pinches: Vec::new(),
            fibres: None,
            solitary: Vec::new(),
            traced: None,
            needs_no_equation: false,
            findings: Vec::new(),
            verdicts: [Verdict::Open; 3],
        };
        let Some(singular) = &analysis.singular else {
            return found;
        };
        let given = DoubleCurveInput {
            map,
            analysis,
            singular,
            options,
            half_width: options.half_width.to_f64().value(),
        };
        let is_proper = analysis.degrees.is_some_and(|d| d.map_degree == 1);
        let may_trace = is_proper && options.domain.is_none();
        let traced = match may_trace {
            true => given.arcs(control).unwrap_or(None),
            false => None,
        };
        match traced {
            Some((traced, solitary)) => found.take_arcs(traced, solitary, &given, control),
            None => found.search(&given, control),
        }
        found
    }

    /// Sets the verdicts for arcs traced in floating point. If the double curve provably has no
    /// component, pinch points and solitary arcs do not exist either.
    fn judge_arcs(&mut self, is_known: bool, is_glued: bool, has_curve: bool) {
        let may_have_points = !is_known || has_curve;
        let floating = Verdict::Holds(Basis::Floating);
        let curves = match is_known {
            true => Claim::DoubleCurves.usual(),
            false => floating,
        };
        self.verdicts = [
            curves,
            floating
                .or_not(may_have_points, NO_CURVE)
                .or_not(is_glued, NOT_JOINED),
            floating.or_not(may_have_points, NO_CURVE),
        ];
    }
    /// Takes everything from traced arcs.
    fn take_arcs(
        &mut self,
        traced: TracedCurve,
        solitary: Polylines,
        given: &DoubleCurveInput,
        control: &Control<'_>,
    ) {
        let &DoubleCurveInput {
            map,
            singular,
            half_width,
            ..
        } = given;
        let glued = given.options.mode == Mode::Glued;
        let is_known = singular.double.is_some();
        self.judge_arcs(is_known, glued, curves_of(map, singular).next().is_some());
        self.pinches = traced.arcs.pinches();
        let scale = |x: Point3| x.map(|x| x * half_width);
        self.solitary = solitary
            .into_iter()
            .map(|part| part.into_iter().map(scale).collect())
            .collect();
        if glued && traced.arcs.is_any_covered() {
            self.fibres = Fibres::new(map, singular, half_width, control).ok();
        }
        let may_stand = glued && !traced.arcs.is_any_cut_off() && given.may_stand();
        self.needs_no_equation = !is_known && (may_stand || !glued);
        self.traced = may_stand.then_some(traced);
        self.add_seam_lines(given);
    }

    /// Finds the pinch points, exactly.
    fn search_pinches(&mut self, map: &Map, control: &Control<'_>) {
        match pinch_points(map, control) {
            Ok(points) => {
                let rounded = |p: &[Algebraic; 3]| p.each_ref().map(Algebraic::to_f64);
                self.pinches = points.iter().map(rounded).collect();
            }
            Err(Stopped) => self.findings.push(Finding::Stopped(Phase::PinchPoints)),
        }
    }
    /// Finds pinch points exactly, and solitary arcs by sections of the curves of parameters.
    fn search(&mut self, given: &DoubleCurveInput, control: &Control<'_>) {
        let &DoubleCurveInput {
            map,
            analysis,
            singular,
            options,
            half_width,
        } = given;
        let glued = options.mode == Mode::Glued;
        let degrees = analysis.degrees;
        let map_degree = degrees.map_or(0, |d| d.map_degree);
        let is_double = |c: &SingularCurve| matches!(c.kind, CurveKind::Double);
        let has_double = singular.curves.iter().any(is_double);
        self.verdicts = [
            Claim::DoubleCurves
                .usual()
                .or_open(singular.double.is_some())
                .or_not(glued || singular.double.is_some(), NOT_JOINED),
            Claim::PinchPoints
                .usual()
                .or_not(has_double, NO_CURVE)
                .or_not(glued, NOT_JOINED),
            Verdict::NotApplicable("no parameters that are drawn lead to solitary arcs"),
        ];
        if glued && has_double {
            self.search_pinches(map, control);
            self.fibres = Fibres::new(map, singular, half_width, control).ok();
        }
        // No parameters of a domain lead to solitary arcs, and planes and quadrics have none.
        // For an improper map complex parameters reach whole regions, which are not drawn.
        let is_smooth = degrees.is_some_and(|d| d.implicit_degree <= 2);
        if options.domain.is_none() && !(map_degree > 1 && (is_smooth || !glued)) {
            let tolerance = options.mesh.tolerance;
            let (arcs, problems) = solitary_arcs(map, singular, half_width, tolerance, control);
            self.solitary = arcs;
            // Without a curve to follow, the absence of solitary arcs is exact.
            let has_base = analysis.base_points.as_ref().is_some_and(|b| !b.is_empty());
            let may_have = curves_of(map, singular).next().is_some() || has_base;
            self.verdicts[2] = Claim::SolitaryArcs.usual().or_not(may_have, NO_CURVE);
            self.findings.extend(problems);
            self.add_seam_lines(given);
        }
    }

    /// Adds the lines to which conjugate base points are blown up.
    fn add_seam_lines(&mut self, given: &DoubleCurveInput) {
        for line in &given.analysis.seam_lines {
            if line.is_met(given.map, given.singular) {
                self.findings.push(Finding::ComplexSeamMet);
            } else {
                self.solitary
                    .extend(line.within(given.half_width).map(Vec::from));
            }
        }
    }
}

/// Input of the search for the double curve.
struct DoubleCurveInput<'a> {
    map: &'a Map,
    analysis: &'a Analysis,
    singular: &'a Singular,
    options: &'a TriangulateOptions,
    half_width: f64,
}

impl DoubleCurveInput<'_> {
    /// Returns the arcs of the double curve and their solitary parts; `None` unless all of them
    /// were found.
    fn arcs(&self, control: &Control<'_>) -> Result<Option<(TracedCurve, Polylines)>, Stopped> {
        let Some(expected) = self.expected() else {
            return Ok(None);
        };
        let fine = pairs::Fineness {
            // Chords of traced arcs may use 0.3 of the tolerance.
            tolerance: 0.3 * self.options.mesh.tolerance / self.half_width,
            longest: self.options.mesh.longest / self.half_width,
        };
        let pairs = Pairs::new(self.map, self.half_width);
        let arcs = pairs::arcs(&pairs, fine, &expected, control)?;
        let solitary = arcs.solitary().filter(|_| arcs.lost == 0);
        Ok(solitary.map(|parts| (TracedCurve { pairs, arcs }, parts)))
    }

    /// Returns the number of parameters that a general plane of space has on the double curve;
    /// `None` if there are cuspidal edges.
    ///
    /// Without base points each curve of parameters has a degree of its own degree times that of
    /// the map; then the part at infinity, which is not drawn, need not be counted.
    fn expected(&self) -> Option<Expected> {
        let (analysis, singular) = (self.analysis, self.singular);
        let is_ramified = |c: &&SingularCurve| matches!(c.kind, CurveKind::Ramified);
        let is_free = analysis.degrees.is_some_and(|d| d.base_multiplicity == 0);
        if is_free && singular.double.is_some() {
            if self.finite_curves().any(|c| is_ramified(&c)) {
                return None;
            }
            let is_double = |c: &&SingularCurve| matches!(c.kind, CurveKind::Double);
            let curves = self.finite_curves().filter(is_double);
            let degree: usize = curves.map(|c| c.curve.total_degree()).sum();
            return Some(Expected {
                parameters: degree * self.map.degree(),
                is_finite: true,
                curves: Vec::new(),
            });
        }
        if singular.curves.iter().any(|c| is_ramified(&c)) {
            return None;
        }
        Some(Expected {
            parameters: analysis.double_section?,
            is_finite: false,
            curves: self.simple_curves().unwrap_or_default(),
        })
    }

    /// Returns the curves of parameters with finite images, if exactly two sheets cross along each
    /// of them, and no real base point is blown up to a curve that may be double by itself. Lines
    /// are not: they have one parameter for each point.
    fn simple_curves(&self) -> Option<Vec<(Form, usize)>> {
        fn is_simple(seam: &Seam) -> bool {
            seam.curve[0].degree() <= 1 && seam.near.iter().all(|near| is_simple(&near.seam))
        }
        let mut base_points = self.analysis.base_points.iter().flatten();
        if self.singular.double.is_none() || !base_points.all(|b| is_simple(&b.seam)) {
            return None;
        }
        let mut found = Vec::new();
        for c in self.finite_curves() {
            match c.kind {
                CurveKind::Double if c.in_double == Some(1) => {
                    let [terms] = rounded([&c.curve]);
                    found.push((Form::new(terms), c.curve.total_degree()));
                }
                CurveKind::Contracted(_) => {}
                _ => return None,
            }
        }
        Some(found)
    }

    /// Returns true if arcs may replace the curve of parameters: if it has no other special curves,
    /// and its degree is high.
    fn may_stand(&self) -> bool {
        // More than two sheets meet, or they touch, along a curve with a higher multiplicity in
        // D.
        let is_double =
            |c: &SingularCurve| matches!(c.kind, CurveKind::Double) && c.in_double == Some(1);
        let degree: usize = self.finite_curves().map(|c| c.curve.total_degree()).sum();
        // Above degree 8, the topology of parameter curves takes longer to compute than the curves
        // take to trace: those of quadratic maps have degree 3, of general cubic maps 18.
        self.finite_curves().all(is_double) && (degree > 8 || self.singular.double.is_none())
    }

    /// Iterates over the singular curves, without those that the map sends to infinity, where
    /// nothing is drawn.
    fn finite_curves(&self) -> impl Iterator<Item = &SingularCurve> {
        let w = &self.map.forms()[3];
        let is_finite = |c: &&SingularCurve| !w.is_multiple_of(&c.curve);
        self.singular.curves.iter().filter(is_finite)
    }
}
