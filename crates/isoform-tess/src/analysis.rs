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

/// What an analysis may cost.
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
    /// What the real pole curve consists of, the line at infinity included where W vanishes on it.
    pub pole_topology: Option<CurveTopology>,
    /// Double, ramified and contracted curves.
    pub singular: Option<Singular>,
    /// The parameters that a general plane of space has on the double curve, with multiplicities,
    /// those on blown up base points too.
    pub double_section: Option<usize>,
    /// Real lines that conjugate base points are blown up to.
    pub seam_lines: Vec<SeamLine>,
    /// What could not be proven; empty if everything was.
    pub findings: Vec<Finding>,
    /// Whether only what a region without poles needs was looked for.
    pub(crate) is_local: bool,
    /// Seconds that the phases took, in their order.
    pub seconds: Vec<(&'static str, f64)>,
}

impl Analysis {
    fn stopped(&mut self, phase: Phase) {
        self.findings.push(Finding::Stopped(phase));
    }
    /// What it claims. Nothing is claimed of the whole plane where only a region was analysed, nor
    /// of what there was no time for: findings say that.
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
pub fn analyse(map: &Map, budget: &Budget, control: &Control<'_>) -> Analysis {
    let mut found = Analysis::default();
    let enough = control.for_seconds(budget.seconds);
    let mut clock = Instant::now();
    let mut lap = |found: &mut Analysis, phase: &'static str| {
        found.seconds.push((phase, clock.elapsed().as_secs_f64()));
        clock = Instant::now();
    };

    // Complex ones too: their multiplicities prove the degrees.
    let classes = Classes::new(map, false, control);
    match &classes {
        Ok(classes) => {
            found.base_points = Some(classes.real());
            match seam_lines(classes, control) {
                Ok((lines, others)) => {
                    found.seam_lines = lines;
                    if others {
                        found.findings.push(Finding::ComplexSeamUntraced);
                    }
                }
                Err(Stopped) => found.stopped(Phase::ComplexSeams),
            }
        }
        Err(Stopped) => found.stopped(Phase::BasePoints),
    }
    lap(&mut found, "base points");

    match map.forms()[3].factor(control) {
        Ok(factors) => found.pole = Some(factors),
        Err(error) => {
            assert_eq!(error, FactorError::Stopped, "a form in three variables");
            found.stopped(Phase::Pole);
        }
    }
    lap(&mut found, "pole");

    match curve_topology(&map.forms()[3], control) {
        Ok(topology) => found.pole_topology = Some(topology),
        Err(error) => found.findings.push(Finding::PoleTopology(error)),
    }
    lap(&mut found, "pole topology");

    let sum = classes.as_ref().ok().map(|c| c.sum_of_powers(1));
    degrees(
        map,
        classes.ok().map(|c| c.multiplicity()),
        control,
        &mut found,
    );
    found.double_section = sum.and_then(|sum| double_section(map, found.degrees?, sum));
    lap(&mut found, "degrees");

    match found.degrees {
        _ if budget.implicit_degree == 0 => {}
        Some(degrees) if degrees.implicit_degree <= budget.implicit_degree => {
            match implicit(map.affine(), budget.implicit_degree, &enough) {
                Ok(equation) => found.implicit = equation,
                Err(error) => found.findings.push(Finding::NoEquation(error)),
            }
        }
        Some(degrees) => {
            found.findings.push(Finding::DegreeAboveLimit {
                degree: degrees.implicit_degree,
                limit: budget.implicit_degree,
            });
        }
        None => found.findings.push(Finding::SurfaceDegreeUnknown),
    }
    if let (Some(counted), Some(equation)) = (found.degrees, &found.implicit)
        && counted != equation.degrees
    {
        found.findings.push(Finding::DegreeContradicted);
    }
    lap(&mut found, "implicit equation");

    match singular(map, found.implicit.as_ref(), &enough) {
        Ok(curves) => found.singular = Some(curves),
        Err(Stopped) => found.stopped(Phase::SingularCurves),
    }
    lap(&mut found, "singular curves");
    found
}

/// What a domain in which the map is proved to have no pole needs to be known of: contracted curves
/// and cuspidal edges.
pub(crate) fn analyse_clear(map: &Map, control: &Control<'_>) -> Analysis {
    let mut found = Analysis {
        is_local: true,
        ..Analysis::default()
    };
    let clock = Instant::now();
    match singular(map, None, control) {
        Ok(curves) => found.singular = Some(curves),
        Err(Stopped) => found.stopped(Phase::ContractedCurves),
    }
    found
        .seconds
        .push(("singular curves", clock.elapsed().as_secs_f64()));
    found
}

/// What a general plane of space has on the double curve of a proper map.
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

/// Counts the degrees and proves their product by the base points.
fn degrees(
    map: &Map,
    base_multiplicity: Option<usize>,
    control: &Control<'_>,
    found: &mut Analysis,
) {
    match map_degrees(map.affine(), control) {
        Ok(degrees) => found.degrees = Some(degrees),
        Err(MapError::Stopped) => found.stopped(Phase::MapDegree),
        Err(error) => found.findings.push(Finding::DegreeUnknown(error)),
    }
    if let Some(degrees) = found.degrees {
        let counted = degrees.base_multiplicity;
        match base_multiplicity {
            Some(sum) if sum != counted => {
                found.findings.push(Finding::DegreeRefuted {
                    counted,
                    found: sum,
                });
            }
            None => found.findings.push(Finding::DegreeCounted),
            Some(_) => {}
        }
    }
}
