//! Attempts from one seed: patches along several directions and with several policies, of which the
//! largest is taken.

use super::certify::certified;
use crate::exact::make_exact;
use crate::grow::{GROWING, Growth, GrowthStart, StepSizePolicy};
use crate::objective::Objective;
use crate::options::{Error, Options};
use crate::parameterized::{Clock, Parameterized, both_times};
use crate::surface::{self, Seed};
use crate::terms::{Inner, Method};
use crate::whole::GrowthPart;
use isoform_control::Control;
use std::f64::consts::FRAC_PI_4;
use std::time::Instant;

/// Factor by which a patch must exceed the area of another to count as larger: between directions
/// that are equally good, rounding must not decide.
const MIN_AREA_RATIO: f64 = 1.01;

/// Grows patches from a seed and returns the largest. With a tolerance they grow along the lines of
/// curvature, at 45° to them and along the seed's own directions, and with several policies, as the
/// best choice depends on the surface.
pub(super) fn turned(
    on: GrowthPart<'_>,
    seed: Seed,
    options: &Options,
    mut clock: Clock,
    control: &Control<'_>,
) -> Result<Parameterized, Error> {
    let start = |seed: Seed, pace: StepSizePolicy| GrowthStart {
        on,
        seed,
        edge: None,
        pace,
        control: *control,
        shares: [0.0, 1.0],
    };
    if options.tolerance.is_none() || options.exact {
        return grown(
            start(seed, StepSizePolicy::for_options(options)),
            options,
            clock,
        );
    }
    let scale = options.region.diagonal();
    let frame = |angle: f64| surface::frame(on.field(), seed.point, angle, scale);
    let along = frame(0.0)?;
    let own = (seed.tangents != along.tangents).then_some((seed, StepSizePolicy::EVEN));
    let starts = [
        Some((along, StepSizePolicy::EVEN)),
        Some((frame(FRAC_PI_4)?, StepSizePolicy::EVEN)),
        own,
        Some((seed, StepSizePolicy::STEADY)),
        Some((seed, StepSizePolicy::QUICK)),
    ];
    let starts: Vec<_> = starts.into_iter().flatten().collect();
    let count = starts.len() as f64;
    let starts = starts
        .into_iter()
        .enumerate()
        .map(|(k, (seed, pace))| GrowthStart {
            shares: [k as f64 / count, (k + 1) as f64 / count],
            ..start(seed, pace)
        });
    let mut candidates = Candidates::grown(starts, options);
    clock.phase("grow");
    let none = Err(Error::NoPatch { at: seed.point });
    candidates.largest(none, options, clock)
}

/// Grown patches whose distances are not proved yet.
struct Candidates<'f> {
    /// Patches with their areas in the region.
    list: Vec<(f64, Growth<'f>)>,
    /// Error of the last attempt that failed.
    error: Option<Error>,
}

impl<'f> Candidates<'f> {
    /// Grows one patch for each start, until time is over.
    fn grown(starts: impl Iterator<Item = GrowthStart<'f>>, options: &Options) -> Self {
        let mut all = Self {
            list: Vec::new(),
            error: None,
        };
        for start in starts {
            match grow(start, options) {
                Ok(growth) => {
                    let is_late = growth.is_late;
                    all.list.push((growth.area(&options.region), growth));
                    if is_late {
                        break;
                    }
                }
                Err(error) => all.error = Some(error),
            }
        }
        all
    }

    /// Returns the largest patch after proof. As proofs only make patches smaller, the largest goes
    /// first, and those that can no longer become the largest are not proved.
    fn largest(
        &mut self,
        none: Result<Parameterized, Error>,
        options: &Options,
        mut clock: Clock,
    ) -> Result<Parameterized, Error> {
        let mut made = self.error.map_or(none, Err);
        while let Some(most) = self.list.iter().map(|g| g.0).reduce(f64::max) {
            let is_enough = made.as_ref().is_ok_and(|m| {
                let worth = PatchRank::new(m, options);
                m.is_late || (worth.keeps && most <= MIN_AREA_RATIO * worth.area)
            });
            if is_enough {
                break;
            }
            let next = (self.list.iter().position(|g| MIN_AREA_RATIO * g.0 >= most)).unwrap_or(0);
            let other = certified(self.list.remove(next).1, std::mem::take(&mut clock));
            made = match (made, other) {
                (Ok(a), Ok(b)) => Ok(better(a, b, options)),
                (Err(_), b) => b,
                (a, Err(_)) => a,
            };
        }
        made
    }
}

/// Criteria of comparison, the first one first.
struct PatchRank {
    keeps: bool,
    area: f64,
}

impl PatchRank {
    fn new(made: &Parameterized, options: &Options) -> Self {
        Self {
            keeps: made.keeps(options),
            area: made.grown.area(&options.region),
        }
    }
}

/// Returns the better of two patches, with the times of both.
fn better(a: Parameterized, b: Parameterized, options: &Options) -> Parameterized {
    let (x, y) = (PatchRank::new(&a, options), PatchRank::new(&b, options));
    let seconds = both_times(&a.seconds, &b.seconds);
    let is_b = y.keeps && !x.keeps || y.keeps == x.keeps && y.area > MIN_AREA_RATIO * x.area;
    Parameterized {
        seconds,
        ..if is_b { b } else { a }
    }
}

/// Grows a patch and proves a bound on its distance from the surface.
pub(super) fn grown(
    start: GrowthStart<'_>,
    options: &Options,
    mut clock: Clock,
) -> Result<Parameterized, Error> {
    let growth = grow(start, options)?;
    clock.phase("grow");
    certified(growth, clock)
}

/// Grows a patch, exact if the options require it, without a proof.
fn grow<'f>(mut start: GrowthStart<'f>, asked: &Options) -> Result<Growth<'f>, Error> {
    let options = &asked.relaxed();
    let (is_single, field) = (start.on.whole.is_single(), start.on.field());
    // An exact patch would leave the edges at which it ends.
    let to_be_exact = options.exact && is_single;
    if to_be_exact {
        // Tori and cylinders have exact patches of low degree only along their lines of curvature.
        let scale = options.region.diagonal();
        start.seed = surface::frame(field, start.seed.point, 0.0, scale)?;
    }
    if options.method == Method::Newton && field.jet3(start.seed.point).is_none() {
        return Err(Error::NoThirdDerivatives);
    }
    let growing = GrowthStart {
        control: growing_time(&start.control),
        ..start
    };
    let mut growth = Growth::start(
        objective(start.on, options.degree, options),
        growing,
        options,
    )?;
    growth.grow_to_limit();
    growth.control = start.control;
    growth.control.report(GROWING, start.shares[1]);
    if to_be_exact {
        make_exact(&mut growth, |degree, share| {
            grow_another(start, degree, share, asked)
        });
    }
    Ok(growth)
}

/// Creates the objective for patches of a degree.
fn objective<'f>(on: GrowthPart<'f>, degree: (usize, usize), options: &Options) -> Objective<'f> {
    // Patches along edges get long: L in squared lengths would be dominated by the long direction.
    let inner = if on.whole.is_single() {
        options.inner
    } else {
        Inner::Tangents
    };
    Objective::new(on.field(), degree, options.method, options.nodes).with_inner(inner)
}

/// Returns a control that leaves 40 % of the time for the proof: a patch without a bound is worth
/// less than a smaller one.
fn growing_time<'f>(control: &Control<'f>) -> Control<'f> {
    let Some(deadline) = control.deadline else {
        return *control;
    };
    let now = Instant::now();
    control.until(now + deadline.saturating_duration_since(now).mul_f64(0.6))
}

/// Grows a patch of another degree from which an exact one is sought. With a `share` below 1 it
/// grows to that fraction of the bound on S, otherwise to the limits of the options.
fn grow_another<'f>(
    start: GrowthStart<'f>,
    degree: (usize, usize),
    share: f64,
    asked: &Options,
) -> Option<Growth<'f>> {
    let options = if share < 1.0 {
        Options {
            degree,
            limit: share * asked.limit,
            tolerance: None,
            ..*asked
        }
    } else {
        Options {
            degree,
            ..asked.relaxed()
        }
    };
    let start = GrowthStart {
        edge: None,
        pace: StepSizePolicy::for_options(&options),
        ..start
    };
    let objective = objective(start.on, degree, &asked.relaxed());
    let mut other = Growth::start(objective, start, &options).ok()?;
    other.grow_to_limit();
    Some(other)
}
