//! Curves of the parameters, other than those from the box, by which a region is decomposed.

use super::traced::TracedCurve;
use crate::analysis::Analysis;
use crate::deck::Deck;
use crate::double::Fibres;
use crate::field::{Algebraic, vanishes};
use crate::singular::{CurveKind, RealPart, SingularCurve};
use crate::surface::Point3;
use isoform_algebra::Poly;

/// Curves, other than those from the box, by which a region is decomposed. The sides of the unit
/// triangles are stored as flags, as every decomposition contains them.
#[derive(Default)]
pub(crate) struct Curves {
    pub(super) contracted: Vec<(Poly, Vec<Point3>)>,
    pub(super) double: Vec<Poly>,
    /// Cuspidal edges.
    pub(super) creased: Vec<Poly>,
    pub(super) double_sides: [bool; 3],
    /// True if sheets that cross are joined.
    pub(super) glued: bool,
    /// Deck transformations; the border of their fundamental domain is joined with itself.
    pub(super) deck: Option<Deck>,
    pub(super) pinches: Vec<[f64; 3]>,
    /// Isolated real points of singular curves.
    pub(super) isolated: Vec<[f64; 3]>,
    /// Fibres, which distinguish a real parameter alone from one that meets conjugate ones.
    pub(super) fibres: Option<Fibres>,
    /// The double curve, if it was traced and is not to be decomposed.
    pub(super) traced: Option<TracedCurve>,
}

impl Curves {
    /// Collects the contracted curves; if sheets are joined, double curves and cuspidal edges, too.
    pub(crate) fn new(
        analysis: &Analysis,
        glued: bool,
        deck: Option<Deck>,
        pinches: Vec<[f64; 3]>,
        fibres: Option<Fibres>,
        traced: Option<TracedCurve>,
    ) -> Self {
        let is_fold = |c: &Poly| deck.as_ref().is_some_and(|d| d.folds.curves.contains(c));
        let mut found = Self {
            glued,
            pinches,
            fibres,
            ..Self::default()
        };
        let all = analysis.singular.as_ref().map_or(&[][..], |s| &s.curves);
        for c in all {
            if let RealPart::Points(points) = &c.real
                && glued
            {
                found.add_isolated(points, all);
            }
            let side = (0..3).find(|&k| c.curve.is_associate(&Poly::var(k)));
            match (&c.kind, side) {
                (CurveKind::Contracted(to), None) if !to.at_infinity() => {
                    let images: Vec<Point3> = to
                        .points()
                        .iter()
                        .map(|p| [0, 1, 2].map(|k| p[k].to_f64() / p[3].to_f64()))
                        .collect();
                    if !images.is_empty() {
                        found.contracted.push((c.curve.clone(), images));
                    }
                }
                (CurveKind::Double, _) if glued && traced.is_none() && c.is_double_arc() => {
                    found.add_double(&c.curve);
                }
                (CurveKind::Ramified, None)
                    if glued && matches!(c.real, RealPart::Curve) && !is_fold(&c.curve) =>
                {
                    found.creased.push(c.curve.clone())
                }
                _ => {}
            }
        }
        for border in deck.iter().map(|d| &d.seams) {
            (0..3).for_each(|k| found.double_sides[k] |= border.sides[k]);
        }
        found.deck = deck;
        found.traced = traced;
        found
    }
    /// Adds isolated points of a curve, except those on contracted curves, which have the image of
    /// these anyway.
    fn add_isolated(&mut self, points: &[[Algebraic; 3]], all: &[SingularCurve]) {
        let is_contracted = |p: &&[Algebraic; 3]| {
            let mut curves = all
                .iter()
                .filter(|c| matches!(c.kind, CurveKind::Contracted(_)));
            curves.any(|c| vanishes(&c.curve, p))
        };
        let others = points.iter().filter(|p| !is_contracted(p));
        self.isolated
            .extend(others.map(|p| p.each_ref().map(Algebraic::to_f64)));
    }
    /// Returns the curves along which the border of a fundamental domain is joined with itself.
    pub(super) fn seams(&self) -> &[Poly] {
        self.deck.as_ref().map_or(&[], |d| &d.seams.curves)
    }
    /// Returns true if vertices may have several parameters.
    pub(super) fn is_joined(&self) -> bool {
        self.glued || self.deck.is_some()
    }
    /// Returns true if sheets are joined along double curves.
    pub(crate) fn is_glued(&self) -> bool {
        self.glued
    }
    /// Returns true if traced arcs replace the double curves of parameters.
    pub(crate) fn is_traced(&self) -> bool {
        self.traced.is_some()
    }
    /// Replaces double curves of parameters by traced arcs.
    pub(crate) fn trace(&mut self, traced: Option<TracedCurve>) {
        self.traced = traced;
        self.double.clear();
        self.double_sides = [false; 3];
    }
    /// Replaces traced arcs by double curves of parameters, and returns the arcs.
    pub(crate) fn decompose(&mut self, analysis: &Analysis) -> Option<TracedCurve> {
        let curves = analysis.singular.as_ref().map_or(&[][..], |s| &s.curves);
        for c in curves.iter().filter(|c| c.is_double_arc()) {
            self.add_double(&c.curve);
        }
        self.traced.take()
    }
    fn add_double(&mut self, curve: &Poly) {
        match (0..3).find(|&k| curve.is_associate(&Poly::var(k))) {
            Some(k) => self.double_sides[k] = true,
            None => self.double.push(curve.clone()),
        }
    }
    /// Returns the curves as forms in (s, t, w).
    pub(crate) fn forms(&self) -> Vec<Poly> {
        let contracted = self.contracted.iter().map(|c| &c.0);
        contracted
            .chain(&self.double)
            .chain(&self.creased)
            .chain(self.seams())
            .cloned()
            .collect()
    }
}
