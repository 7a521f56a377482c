//! Unit box: every patch is grown around the origin in units of the region's largest edge, so that
//! neither the unit of length nor the position of a model matters.
//!
//! The weights of S are given for a unit cube (Wurm, Jüttler and Kim 2003, Table 2), and control
//! points (x w, y w, z w, w) of patches far from the origin make an ill-conditioned problem for
//! Newton's method.
//!
//! A point p of the box is at c + e p in space, with the centre c and the largest edge e of the
//! region. Options and functions are transformed into the box ([`UnitBox::options`],
//! [`UnitBox::field`]); patches, distances and errors are transformed back. Rounding in the
//! transformation back moves points: the tolerance is reduced by that amount beforehand, and the
//! bound is increased by it afterwards.

use crate::distance::Distances;
use crate::fold;
use crate::grown::Grown;
use crate::options::{Covering, Error, Options};
use crate::parameterized::Parameterized;
use crate::quadric::quadric;
use isoform_control::Control;
use isoform_geom::{Aabb, Expansion, Field, Parts, Point3, RationalPatch, SmoothPart, Terms, norm};
use isoform_num::{Interval, Jet2, Jet3, Real};
use std::ops::Deref;
use std::sync::Arc;

/// Fraction of the largest coordinate in space by which tolerances are reduced for the rounding of
/// coordinates in the transformation out of the unit box: twice the error.
const COORDINATE_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Unit box: a point p of it is at `center` + `edge` p in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct UnitBox {
    center: Point3,
    edge: f64,
}

impl UnitBox {
    /// Returns the unit box of a region.
    pub(crate) fn new(region: &Aabb) -> Self {
        Self {
            center: std::array::from_fn(|k| 0.5 * region.lo[k] + 0.5 * region.hi[k]),
            edge: region.size().into_iter().fold(0.0, f64::max),
        }
    }

    /// Transforms a point to space.
    pub(crate) fn out(&self, p: Point3) -> Point3 {
        std::array::from_fn(|k| self.center[k] + self.edge * p[k])
    }
    /// Transforms a point into the unit box.
    fn within(&self, p: Point3) -> Point3 {
        std::array::from_fn(|k| (p[k] - self.center[k]) / self.edge)
    }
    /// Returns intervals that contain a box, transformed to space.
    fn all_out(&self, region: &Aabb) -> [Interval; 3] {
        std::array::from_fn(|k| {
            let at = Interval::new(region.lo[k], region.hi[k]);
            Interval::constant(self.center[k]) + Interval::constant(self.edge) * at
        })
    }

    /// Transforms a length to space and adds the amount by which rounding may increase a distance.
    pub(crate) fn length_out(&self, length: f64) -> f64 {
        let far = norm(self.center) + self.edge;
        self.edge * length * (1.0 + 1e-12) + COORDINATE_ROUNDING * far
    }
    /// Transforms a box to space.
    pub(crate) fn region_out(&self, region: &Aabb) -> Aabb {
        Aabb {
            lo: self.out(region.lo),
            hi: self.out(region.hi),
        }
    }
    /// Transforms the options of a cover into the unit box. The margin is increased by the rounding
    /// of the transformation to space.
    pub(crate) fn covering(&self, covering: &Covering) -> Covering {
        let far = norm(self.center) + self.edge;
        let margin = |m: f64| (m * (1.0 + 1e-12) + 2.0 * COORDINATE_ROUNDING * far) / self.edge;
        Covering {
            margin: covering.margin.map(margin),
            apart: covering.apart.map(|a| a / self.edge),
            ..*covering
        }
    }

    /// Wraps a function of space as a function of the unit box.
    pub(crate) fn field<F>(&self, field: F) -> InUnitBox<F> {
        InUnitBox { field, unit: *self }
    }

    /// Wraps the parts of a surface as parts in the unit box.
    pub(crate) fn parts(&self, parts: &Parts) -> Parts {
        // Parts are compared by the addresses of their functions.
        let mut known: Vec<(Arc<dyn Field>, Arc<dyn Field>)> = Vec::new();
        let mut moved = |field: &Arc<dyn Field>| -> Arc<dyn Field> {
            if let Some(k) = known.iter().find(|k| Arc::ptr_eq(&k.0, field)) {
                return k.1.clone();
            }
            let inside: Arc<dyn Field> = Arc::new(self.field(field.clone()));
            known.push((field.clone(), inside.clone()));
            inside
        };
        let part = |p: &SmoothPart| SmoothPart {
            piece: p.piece,
            field: moved(&p.field),
            limits: p.limits.iter().map(&mut moved).collect(),
            function: p.function,
        };
        Parts {
            tree: parts.tree.clone(),
            parts: parts.parts.iter().map(part).collect(),
        }
    }

    /// Transforms the options into the unit box.
    pub(crate) fn options(&self, options: &Options) -> Options {
        let far = norm(self.center) + self.edge;
        let tolerance =
            |t: f64| ((1.0 - 1e-12) * t - COORDINATE_ROUNDING * far).max(0.5 * t) / self.edge;
        Options {
            region: Aabb {
                lo: self.within(options.region.lo),
                hi: self.within(options.region.hi),
            },
            seed_point: options.seed_point.map(|p| self.within(p)),
            tolerance: options.tolerance.map(tolerance),
            ..*options
        }
    }

    /// Transforms a patch to space; returns also an upper bound on the distance by which rounding
    /// moves its points, which is infinite if a control weight is not positive.
    fn patch_out(&self, patch: &RationalPatch) -> (RationalPatch, f64) {
        let (mut out, mut moved) = (patch.clone(), 0.0f64);
        for c in out.control_mut() {
            let w = c[3];
            let mut off = [0.0; 3];
            for k in 0..3 {
                let x = Interval::constant(self.edge) * Interval::constant(c[k])
                    + Interval::constant(self.center[k]) * Interval::constant(w);
                c[k] = self.edge * c[k] + self.center[k] * w;
                off[k] = (x.hi() - c[k]).max(c[k] - x.lo());
            }
            moved = moved.max(if w > 0.0 {
                norm(off) / w * (1.0 + 1e-12)
            } else {
                f64::INFINITY
            });
        }
        (out, moved)
    }

    /// Transforms a patch made in the unit box to space. There it is proved again, with the
    /// function of its part, that it does not fold over.
    pub(crate) fn made_out(&self, made: Parameterized, part: &dyn Field) -> Parameterized {
        let (patch, moved) = self.patch_out(&made.grown.patch);
        let length = |v: f64| self.edge * v;
        let d = made.distances;
        let sampled = length(d.sampled);
        let bound = d.bound.map(|b| (length(b) + moved) * (1.0 + 1e-12));
        Parameterized {
            distances: Distances {
                bound: bound.filter(|b| b.is_finite()).map(|b| b.max(sampled)),
                sampled,
                rms: length(d.rms),
            },
            is_unfolded: made.is_unfolded && is_unfolded(part, &patch),
            quadric: if made.is_exact { quadric(&patch) } else { None },
            grown: Grown {
                patch,
                seed_point: self.out(made.grown.seed_point),
                ..made.grown
            },
            ..made
        }
    }

    /// Transforms the point of an error to space.
    pub(crate) fn error_out(&self, mut error: Error) -> Error {
        if let Error::FarSeed { at }
        | Error::Singular { at }
        | Error::NotFinite { at }
        | Error::NoPatch { at }
        | Error::Folded { at } = &mut error
        {
            *at = self.out(*at);
        }
        error
    }
}

/// Returns true if a patch is proved not to fold over.
fn is_unfolded(field: &dyn Field, patch: &RationalPatch) -> bool {
    fold::prove_none(field, patch, &Control::default()).is_ok()
}

/// Function of space as a function of the unit box.
pub(crate) struct InUnitBox<F> {
    /// Function in space.
    field: F,
    unit: UnitBox,
}

impl<F> InUnitBox<F> {
    /// Transforms the derivatives of a jet in space to coordinates of the unit box.
    fn jet_of(&self, j: Jet2) -> Jet2 {
        j.in_units(self.unit.edge)
    }
}

impl<F: Deref<Target: Field> + Send + Sync> Field for InUnitBox<F> {
    fn value(&self, p: Point3) -> f64 {
        self.field.value(self.unit.out(p))
    }
    fn jet(&self, p: Point3) -> Jet2 {
        self.jet_of(self.field.jet(self.unit.out(p)))
    }
    fn bounds(&self, region: Aabb) -> Interval {
        self.field.bounds(Aabb::spanned(self.unit.all_out(&region)))
    }
    fn values(&self, points: &[Point3], out: &mut [f64]) {
        let points: Vec<Point3> = points.iter().map(|p| self.unit.out(*p)).collect();
        self.field.values(&points, out);
    }
    fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        let points: Vec<Point3> = points.iter().map(|p| self.unit.out(*p)).collect();
        self.field.jets(&points, out);
        out.iter_mut().for_each(|j| *j = self.jet_of(*j));
    }
    fn jet3(&self, p: Point3) -> Option<Jet3> {
        let jet = self.field.jet3(self.unit.out(p))?;
        Some(jet.in_units(self.unit.edge))
    }
    fn expansion(&self, at: Point3, region: Aabb) -> Option<Expansion> {
        // The image of `at` in space is not a floating-point number; the expansion around a number
        // nearby is widened to contain it.
        let place = self.unit.all_out(&Aabb { lo: at, hi: at });
        let near = self.unit.out(at);
        let space = Aabb::spanned(self.unit.all_out(&region));
        let off = std::array::from_fn(|k| {
            let off = place[k] - Interval::constant(near[k]);
            off.lo().abs().max(off.hi().abs())
        });
        let e = widened(&self.field.expansion(near, space)?, off);
        Some(e.in_units(Interval::constant(self.unit.edge)))
    }
    fn terms(&self) -> Option<Terms<'_>> {
        let terms = self.field.terms()?;
        // One such transformation suffices, as unit boxes are not nested.
        (terms.origin == [0.0; 3] && terms.unit == 1.0).then_some(Terms {
            origin: self.unit.center,
            unit: self.unit.edge,
            ..terms
        })
    }
}

/// Widens an expansion to hold also around points whose coordinates differ by up to `off`: by the
/// mean value theorem, from third derivatives upward. As the points differ by roundings only, the
/// signs of their differences, which [`Expansion::moved`] takes into account at ten times the cost,
/// need not be known.
fn widened(e: &Expansion, off: Point3) -> Expansion {
    let size = |i: &Interval| i.lo().abs().max(i.hi().abs());
    let mut hessian = e.hessian;
    for (i, row) in Expansion::SECOND.iter().enumerate() {
        for (j, &place) in row.iter().enumerate().skip(i) {
            let by = along(|k| size(&e.third[Expansion::THIRD[i][j][k]]), off);
            hessian[place] = wider(e.hessian[place], by);
        }
    }
    let gradient = std::array::from_fn(|i| {
        let by = along(|k| size(&hessian[Expansion::SECOND[i][k]]), off);
        wider(e.gradient[i], by)
    });
    let by = along(|k| size(&gradient[k]), off);
    Expansion {
        value: wider(e.value, by),
        gradient,
        hessian,
        third: e.third,
    }
}

/// Returns an upper bound of Σ sizeₖ offₖ: three products of two rounded factors, rounded upward at
/// the end.
fn along(size: impl Fn(usize) -> f64, off: Point3) -> f64 {
    let sum: f64 = (0..3).map(|k| size(k) * off[k]).sum();
    sum * (1.0 + 8.0 * f64::EPSILON) + f64::MIN_POSITIVE
}

/// Returns an interval extended by `by` on both sides.
fn wider(i: Interval, by: f64) -> Interval {
    i + Interval::new(-by, by)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A widened expansion contains those around all points within the offset, and is not much
    /// wider than necessary.
    #[test]
    fn widened_expansions_hold_those_nearby() {
        let f = isoform_field::Polynomial::new([
            ([3, 0, 0], 1.0),
            ([1, 2, 0], -2.0),
            ([0, 1, 1], 0.5),
            ([0, 0, 3], 4.0),
        ]);
        let (at, off) = ([0.3, -0.2, 0.7], [1e-3, 2e-3, 5e-4]);
        let region = Aabb {
            lo: at.map(|v| v - 0.1),
            hi: at.map(|v| v + 0.1),
        };
        let wide = widened(&f.expansion(at, region).expect("an expansion"), off);
        for corner in 0..8 {
            let sign = |k: usize| [-1.0, 1.0][corner >> k & 1];
            let near: Point3 = std::array::from_fn(|k| at[k] + sign(k) * off[k]);
            let there = f.expansion(near, region).expect("an expansion");
            let all = |e: &Expansion| [&[e.value][..], &e.gradient, &e.hessian].concat();
            for (held, by) in all(&there).iter().zip(all(&wide)) {
                assert!(by.lo() <= held.lo() && held.hi() <= by.hi());
                assert!(by.hi() - by.lo() < 0.1);
            }
        }
    }
}
