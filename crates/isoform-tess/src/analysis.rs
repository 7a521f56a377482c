//! Everything that is known exactly about a map before it is triangulated.

use crate::base::{BasePoint, Classes};
use crate::claim::{Basis, Claim, Grade};
use crate::complex_seams::{SeamLine, seam_lines};
use crate::finding::{Finding, Phase};
use crate::map::Map;
use crate::singular::{Singular, singular};
use isoform_algebra::{
    CurveTopology, DEFAULT_MAX_DEGREE, FactorError, Implicit, MapDegrees, MapError, Poly,
    curve_topology, implicit, map_degrees,
};
use isoform_control::{Control, Stopped};
use std::time::Instant;

/// The limits of an analysis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Largest degree of an implicit equation; beyond it self-intersections are not looked for.
    /// With 0 nothing is said of them.
    pub implicit_degree: usize,
    /// Whether the whole plane of parameters is analysed for a surface over a part of it that is
    /// proved to hold no pole.
    pub everywhere: bool,
    /// Seconds from the start for the implicit equation, the singular curves, points and arcs on
    /// them, and the decomposition of the parameters by double curves, together: a certificate
    /// needs all of them. What is cut off depends on the machine.
    pub seconds: f64,
}

impl Default for Budget {
    fn default() -> Self {
        Self {
            implicit_degree: DEFAULT_MAX_DEGREE,
            everywhere: true,
            seconds: f64::INFINITY,
        }
    }
}

/// Exact facts about a map; a part that was not to be had is `None`, and `findings` says so.
#[derive(Clone, Debug, Default)]
pub struct Analysis {
    /// Degrees of the map and of the surface.
    pub degrees: Option<MapDegrees>,
    /// The implicit equation.
    pub implicit: Option<Implicit>,
    /// The real base points.
    pub base_points: Option<Vec<BasePoint>>,
    /// The factors of W as a form in (s, t, w), irreducible over Q, with multiplicities: the pole
    /// curve.
    pub pole: Option<Vec<(Poly, usize)>>,
    /// The components of the real pole curve, the line at infinity included where W vanishes on it.
    pub pole_topology: Option<CurveTopology>,
    /// Double, ramified and contracted curves.
    pub singular: Option<Singular>,
    /// The parameters that a general plane of space has on the double curve, with multiplicities,
    /// those on blown up base points too.
    pub double_section: Option<usize>,
    /// Real lines that conjugate base points are blown up to.
    pub seam_lines: Vec<SeamLine>,
    /// The findings: questions that could not be decided; empty if all were.
    pub findings: Vec<Finding>,
    /// Whether only what a region without poles needs was looked for.
    pub(crate) is_local: bool,
    /// Seconds that the phases took, in their order.
    pub seconds: Vec<(&'static str, f64)>,
}

impl Analysis {
    /// Adds the seconds from some instant until now to the seconds of a phase.
    pub(crate) fn took(&mut self, phase: &'static str, since: Instant) {
        let seconds = since.elapsed().as_secs_f64();
        match self.seconds.iter_mut().find(|known| known.0 == phase) {
            Some(known) => known.1 += seconds,
            None => self.seconds.push((phase, seconds)),
        }
    }
    fn stopped(&mut self, phase: Phase) {
        self.findings.push(Finding::Stopped(phase));
    }
    /// The claims of the analysis. Nothing is claimed of the whole plane where only a region was
    /// analysed, nor of what there was no time for: findings say that.
    pub(crate) fn grades(&self) -> Vec<Grade> {
        let is_double_known = |s: &Singular| s.double.is_some();
        let asked = [
            (Claim::CriticalCurves, self.singular.is_some()),
            (
                Claim::DoubleCurves,
                self.singular.as_ref().is_some_and(is_double_known),
            ),
            (Claim::BasePoints, self.base_points.is_some()),
            (Claim::ComplexSeams, self.base_points.is_some()),
            (Claim::Pole, !self.is_local),
        ];
        let asked = asked.into_iter().filter(|c| c.1);
        let mut grades: Vec<Grade> = asked.map(|c| c.0.into()).collect();
        if self.is_local {
            return grades;
        }
        // The base points prove the product of the degrees, and an implicit equation one of them;
        // without it they are counted at pseudo-random points modulo primes.
        grades.push(Grade {
            claim: Claim::MapDegree,
            basis: match self.implicit {
                Some(_) => Claim::MapDegree.basis(),
                None => Basis::Floating,
            },
        });
        grades
    }
}

/// Analyses a map. Everything but `seconds` is the same each time, unless `control` or
/// [`Budget::seconds`] intervenes.
///
/// ```
/// use isoform_tess::{Budget, Control, Map, analyse};
///
/// // A sphere without its pole: the parameters s and t are the slopes of lines through the pole.
/// let map = Map::parse(["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"], Default::default())?;
/// let found = analyse(&map, &Budget::default(), &Control::default());
/// assert!(found.findings.is_empty());
/// let implicit = found.implicit.expect("an equation");
/// assert_eq!(implicit.degrees.implicit_degree, 2);
/// // Two complex base points prove that 2² − 2 = 1 · 2, and none is real.
/// assert_eq!(implicit.degrees.base_multiplicity, 2);
/// assert_eq!(found.base_points.map(|points| points.len()), Some(0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn analyse(map: &Map, budget: &Budget, control: &Control<'_>) -> Analysis {
    let mut found = Analysis::default();
    let enough = control.for_seconds(budget.seconds);

    let clock = Instant::now();
    // Complex ones too: their multiplicities prove the degrees.
    let classes = Classes::new(map, false, control).ok();
    found.find_base_points(classes.as_ref(), control);
    found.took("base points", clock);

    let clock = Instant::now();
    match map.forms()[3].factor(control) {
        Ok(factors) => found.pole = Some(factors),
        Err(error) => {
            assert_eq!(error, FactorError::Stopped, "a form in three variables");
            found.stopped(Phase::Pole);
        }
    }
    found.took("pole", clock);

    let clock = Instant::now();
    match curve_topology(&map.forms()[3], control) {
        Ok(topology) => found.pole_topology = Some(topology),
        Err(error) => found.findings.push(Finding::PoleTopology(error)),
    }
    found.took("pole topology", clock);

    let clock = Instant::now();
    found.find_degrees(map, classes.as_ref().map(Classes::multiplicity), control);
    let sum = classes.as_ref().map(|c| c.sum_of_powers(1));
    found.double_section = sum.and_then(|sum| double_section(map, found.degrees?, sum));
    found.took("degrees", clock);

    let clock = Instant::now();
    found.find_implicit(map, budget, &enough);
    found.took("implicit equation", clock);

    found.find_singular(map, &enough, Phase::SingularCurves);
    found
}

/// What a domain in which the map is proved to have no pole needs to be known of: contracted curves
/// and cuspidal edges.
pub(crate) fn analyse_clear(map: &Map, control: &Control<'_>) -> Analysis {
    let mut found = Analysis {
        is_local: true,
        ..Analysis::default()
    };
    found.find_singular(map, control, Phase::ContractedCurves);
    found
}

/// The phases.
impl Analysis {
    /// The real base points, and the lines that complex ones are blown up to.
    fn find_base_points(&mut self, classes: Option<&Classes>, control: &Control<'_>) {
        let Some(classes) = classes else {
            self.stopped(Phase::BasePoints);
            return;
        };
        self.base_points = Some(classes.real());
        match seam_lines(classes, control) {
            Ok((lines, are_others)) => {
                self.seam_lines = lines;
                if are_others {
                    self.findings.push(Finding::ComplexSeamUntraced);
                }
            }
            Err(Stopped) => self.stopped(Phase::ComplexSeams),
        }
    }
    /// Counts the degrees and proves their product by the squared multiplicities of base points.
    fn find_degrees(&mut self, map: &Map, base_multiplicity: Option<usize>, control: &Control<'_>) {
        match map_degrees(map.affine(), control) {
            Ok(degrees) => self.degrees = Some(degrees),
            Err(MapError::Stopped) => self.stopped(Phase::MapDegree),
            Err(error) => self.findings.push(Finding::DegreeUnknown(error)),
        }
        let Some(counted) = self.degrees.map(|d| d.base_multiplicity) else {
            return;
        };
        match base_multiplicity {
            Some(found) if found != counted => {
                self.findings
                    .push(Finding::DegreeRefuted { counted, found });
            }
            None => self.findings.push(Finding::DegreeCounted),
            Some(_) => {}
        }
    }
    /// The implicit equation, if its degree is not too high.
    fn find_implicit(&mut self, map: &Map, budget: &Budget, control: &Control<'_>) {
        let limit = budget.implicit_degree;
        if limit == 0 {
            return;
        }
        let Some(degrees) = self.degrees else {
            self.findings.push(Finding::SurfaceDegreeUnknown);
            return;
        };
        let degree = degrees.implicit_degree;
        if degree > limit {
            let above = Finding::DegreeAboveLimit { degree, limit };
            self.findings.push(above);
            return;
        }
        match implicit(map.affine(), limit, control) {
            Ok(equation) => self.implicit = equation,
            Err(error) => self.findings.push(Finding::NoEquation(error)),
        }
        if self.implicit.as_ref().is_some_and(|e| e.degrees != degrees) {
            self.findings.push(Finding::DegreeContradicted);
        }
    }
    /// The singular curves; `phase` is what a lack of time leaves open.
    fn find_singular(&mut self, map: &Map, control: &Control<'_>, phase: Phase) {
        let clock = Instant::now();
        match singular(map, self.implicit.as_ref(), control) {
            Ok(curves) => self.singular = Some(curves),
            Err(Stopped) => self.stopped(phase),
        }
        self.took("singular curves", clock);
    }
}

/// The points of a general plane of space on the double curve of a proper map.
///
/// Of a surface of degree d, the image of a map of degree n with base points of multiplicities mᵢ,
/// infinitely near ones included, the double curve of parameters is (d − 4)·H − K by adjunction for
/// the conductor, with planes H and the canonical class K of the blown up plane. It meets H in
/// d (d − 4) + 3 n − Σ mᵢ points.
fn double_section(map: &Map, degrees: MapDegrees, sum: usize) -> Option<usize> {
    let d = degrees.implicit_degree;
    let count = (d * d + 3 * map.degree()).checked_sub(4 * d + sum);
    count.filter(|_| degrees.map_degree == 1)
}
