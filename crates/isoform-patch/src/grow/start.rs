//! Start patch: a small piece of the tangent plane at the seed.

use super::{Growth, SideState, StepSizePolicy};
use crate::objective::{Evaluated, Objective};
use crate::options::{Error, Options};
use crate::solver::Minimiser;
use crate::surface::Seed;
use crate::whole::GrowthPart;
use isoform_control::Control;
use isoform_geom::{Field, RationalPatch};

/// Start of a patch and its settings.
#[derive(Clone, Copy)]
pub(crate) struct GrowthStart<'f> {
    pub(crate) on: GrowthPart<'f>,
    pub(crate) seed: Seed,
    /// Function that vanishes on the edge on which the seed lies, `None` if it lies on none; the
    /// patch starts to the left of the edge.
    pub(crate) edge: Option<&'f dyn Field>,
    pub(crate) pace: StepSizePolicy,
    pub(crate) control: Control<'f>,
    /// Range of the phase's progress that growing covers.
    pub(crate) shares: [f64; 2],
}

impl<'f> Growth<'f> {
    /// Returns the start patch around a seed.
    pub(crate) fn start(
        objective: Objective<'f>,
        start: GrowthStart<'f>,
        options: &Options,
    ) -> Result<Self, Error> {
        let mut growth = Self::new(objective, start, options);
        let mut size = 0.1 * growth.unit;
        // A patch that is smaller by 2⁻³⁰ would be useless.
        for _ in 0..30 {
            let patch = start.square(options.degree, size);
            if let Some((targets, at)) = growth.retargeted(&patch)
                && growth.is_start(&at)
                && growth.lies_well(&start, &patch)
            {
                let mut sides = growth.sides;
                if let Some(edge) = start.edge {
                    sides[2] = SideState::At(edge);
                }
                growth.set_sides(sides);
                let Some(at) = growth.objective.evaluate_with(&patch, &targets) else {
                    break;
                };
                (growth.patch, growth.at, growth.objective.targets) = (patch, at, targets);
                return Ok(growth);
            }
            size *= 0.5;
        }
        Err(Error::NoPatch {
            at: start.seed.point,
        })
    }

    /// Sets up growing before there is a start patch.
    fn new(objective: Objective<'f>, start: GrowthStart<'f>, options: &Options) -> Self {
        let GrowthStart {
            on,
            seed,
            pace,
            control,
            shares,
            ..
        } = start;
        let [u, v] = seed.tangents;
        let mut growth = Self {
            patch: RationalPatch::planar(options.degree, seed.point, u, v),
            at: Evaluated::default(),
            objective,
            trace: Vec::new(),
            is_late: false,
            shortenings: 0,
            good: None,
            options: *options,
            control,
            shares,
            pace,
            minimiser: Minimiser::new(options.floor),
            seed,
            unit: options.edge(),
            on,
            sides: [SideState::Free; 4],
        };
        let objective = &mut growth.objective;
        objective.weights = options.start;
        if let Some(tolerance) = options.tolerance {
            // Factors of shape terms are not lowered for root mean square distances below a
            // twentieth of the tolerance.
            objective.little = (0.05 * tolerance).powi(2);
            objective.keep_shape_loosely();
            objective.bends = true;
            objective.weigh_border(pace.border);
        }
        growth
    }

    /// Returns true if a planar patch is small enough to start with: at most ten times as far
    /// from the surface as is allowed in the end.
    fn is_start(&self, at: &Evaluated) -> bool {
        let excess = 10.0;
        match self.options.tolerance {
            Some(t) => at.terms.i.sqrt() <= excess * t,
            None => at.terms.i <= excess * self.limit(),
        }
    }

    /// Returns true if a start patch avoids singular points and lies on its part.
    fn lies_well(&self, start: &GrowthStart<'f>, patch: &RationalPatch) -> bool {
        let avoided = start.on.near_singular.avoided();
        let is_single = start.on.whole.is_single();
        !avoided.is_some_and(|a| a.is_near(patch))
            && (is_single
                || Self::starts_within(start.on, patch, self.overlap(), start.edge.is_some()))
    }
}

impl GrowthStart<'_> {
    /// Returns the square of a given edge length in the tangent plane, around the seed or to the
    /// left of its edge.
    fn square(&self, degree: (usize, usize), size: f64) -> RationalPatch {
        let [a, b] = self.seed.tangents.map(|t| t.map(|v| v * size));
        let below = if self.edge.is_some() { 0.0 } else { 0.5 };
        let origin = std::array::from_fn(|k| self.seed.point[k] - (0.5 * a[k] + below * b[k]));
        RationalPatch::planar(degree, origin, a, b)
    }
}
