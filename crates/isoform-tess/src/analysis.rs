//! Exact facts about a map, found before it is triangulated.

use crate::base::{BasePoint, Classes};
use crate::claim::{Basis, Claim, Verdict};
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

/// Limits of an analysis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Maximum degree of an implicit equation; above it self-intersections are not searched for.
    /// With 0 the search is skipped without a finding.
    pub implicit_degree: usize,
    /// True if the whole parameter plane is analysed even for a surface over a part of it that
    /// provably contains no pole.
    pub everywhere: bool,
    /// Seconds from the start for the implicit equation, the singular curves, the points and arcs
    /// on them, and the decomposition of the parameters by double curves, together. A certificate
    /// needs all of them; the results of a cut-off phase depend on the machine.
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

/// Exact facts about a map. A part that could not be computed is `None`, and `findings` says why.
#[derive(Clone, Debug, Default)]
pub struct Analysis {
    /// Degrees of the map and of the surface.
    pub degrees: Option<MapDegrees>,
    /// The implicit equation.
    pub implicit: Option<Implicit>,
    /// The real base points.
    pub base_points: Option<Vec<BasePoint>>,
    /// Factors of W as a form in (s, t, w), irreducible over Q, with multiplicities: the pole
    /// curve.
    pub pole: Option<Vec<(Poly, usize)>>,
    /// Components of the real pole curve, including the line at infinity if W vanishes on it.
    pub pole_topology: Option<CurveTopology>,
    /// Double, ramified and contracted curves.
    pub singular: Option<Singular>,
    /// Number of parameters that a general plane of space has on the double curve, counted with
    /// multiplicity and including those on blown-up base points.
    pub double_section: Option<usize>,
    /// Real lines to which conjugate base points are blown up.
    pub seam_lines: Vec<SeamLine>,
    /// Questions that could not be decided; empty if all were.
    pub findings: Vec<Finding>,
    /// True if only the facts were computed that a region without poles needs.
    pub(crate) is_local: bool,
    /// Duration of each phase in seconds, in the order of the phases.
    pub seconds: Vec<(&'static str, f64)>,
}

/// A running phase: its start time, and the control to which its beginning and end are reported.
pub(crate) struct Running<'a> {
    phase: &'static str,
    since: Instant,
    control: &'a Control<'a>,
}

impl<'a> Running<'a> {
    /// Begins a phase.
    pub(crate) fn new(phase: &'static str, control: &'a Control<'a>) -> Self {
        control.report(phase, 0.0);
        Self {
            phase,
            since: Instant::now(),
            control,
        }
    }
}

impl Analysis {
    /// Ends a phase: adds its seconds to those recorded for it before.
    pub(crate) fn took(&mut self, running: Running<'_>) {
        let seconds = running.since.elapsed().as_secs_f64();
        running.control.report(running.phase, 1.0);
        match self
            .seconds
            .iter_mut()
            .find(|known| known.0 == running.phase)
        {
            Some(known) => known.1 += seconds,
            None => self.seconds.push((running.phase, seconds)),
        }
    }
    fn stopped(&mut self, phase: Phase) {
        self.findings.push(Finding::Stopped(phase));
    }
    /// Returns the verdicts on the claims of [`OF_ANALYSIS`](crate::claim::OF_ANALYSIS).
    pub(crate) fn verdicts(&self) -> [Verdict; 5] {
        const REGION: &str = "W has no zero over the region, and the rest is not drawn";
        let exact = Verdict::Holds(Basis::Exact);
        let of_base_points = exact.or_open(self.base_points.is_some());
        // The base points prove the product of the degrees, and an implicit equation one of them;
        // without it they are counted at pseudo-random points modulo primes.
        let degree = match self.implicit {
            Some(_) => exact,
            None => Verdict::Holds(Basis::Floating),
        };
        [
            of_base_points.or_not(!self.is_local, REGION),
            of_base_points.or_not(!self.is_local, REGION),
            Claim::Pole.usual().or_not(!self.is_local, REGION),
            degree.or_not(!self.is_local, REGION),
            exact.or_open(self.singular.is_some()),
        ]
    }
}

/// Analyses a map. The result is deterministic except for `seconds`, unless `control` or
/// [`Budget::seconds`] intervenes. The phases are reported to the control.
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

    let running = Running::new("base points", control);
    // Complex ones too: their multiplicities prove the degrees.
    let classes = Classes::new(map, false, control).ok();
    found.find_base_points(classes.as_ref(), control);
    found.took(running);

    let running = Running::new("pole", control);
    match map.forms()[3].factor(control) {
        Ok(factors) => found.pole = Some(factors),
        Err(error) => {
            assert_eq!(error, FactorError::Stopped, "a form in three variables");
            found.stopped(Phase::Pole);
        }
    }
    found.took(running);

    let running = Running::new("pole topology", control);
    match curve_topology(&map.forms()[3], control) {
        Ok(topology) => found.pole_topology = Some(topology),
        Err(error) => found.findings.push(Finding::PoleTopology(error)),
    }
    found.took(running);

    let running = Running::new("degrees", control);
    found.find_degrees(map, classes.as_ref().map(Classes::multiplicity), control);
    let sum = classes.as_ref().map(|c| c.sum_of_powers(1));
    found.double_section = sum.and_then(|sum| double_section(map, found.degrees?, sum));
    found.took(running);

    let running = Running::new("implicit equation", control);
    found.find_implicit(map, budget, &enough);
    found.took(running);

    found.find_singular(map, &enough, Phase::SingularCurves);
    found
}

/// Returns the facts needed over a domain in which the map provably has no pole: contracted curves
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
    /// Finds the real base points, and the lines to which complex ones are blown up.
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
    /// Computes the implicit equation, if its degree is within the limit.
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
    /// Finds the singular curves; `phase` is the phase reported as unfinished if the time is over.
    fn find_singular(&mut self, map: &Map, control: &Control<'_>, phase: Phase) {
        let running = Running::new("singular curves", control);
        match singular(map, self.implicit.as_ref(), control) {
            Ok(curves) => self.singular = Some(curves),
            Err(Stopped) => self.stopped(phase),
        }
        self.took(running);
    }
}

/// Returns the number of points that a general plane of space has on the double curve of a proper
/// map.
///
/// For a surface of degree d, the image of a map of degree n with base points of multiplicities mᵢ,
/// infinitely near ones included, the double curve of parameters has the class (d − 4)·H − K by
/// adjunction for the conductor, with H the class of plane sections and K the canonical class of
/// the blown-up plane. Its intersection number with H is d (d − 4) + 3 n − Σ mᵢ.
fn double_section(map: &Map, degrees: MapDegrees, sum: usize) -> Option<usize> {
    let d = degrees.implicit_degree;
    let count = (d * d + 3 * map.degree()).checked_sub(4 * d + sum);
    count.filter(|_| degrees.map_degree == 1)
}
