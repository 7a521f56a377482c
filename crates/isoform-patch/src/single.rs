//! Construction of one patch: seed, growth, exactness, tolerance, proof.

mod attempt;
mod certify;
mod place;

pub(crate) use place::at;

use crate::options::{Error, Options};
use crate::parameterized::{Clock, Parameterized};
use crate::progress::MonotoneProgress;
use crate::surface::{self, Seed};
use crate::unit::UnitBox;
use crate::whole::{GrowthPart, NearSingular, Whole};
use attempt::turned;
use isoform_control::Control;
use isoform_geom::{Field, Parts};

/// Grows one patch on the surface `field` = 0 and proves a bound on its distance from the surface.
///
/// For a surface of parts see [`parameterize_part`], for several patches [`crate::cover`].
///
/// Progress is reported in the phases `seed`, `grow` and `certify`.
///
/// ```
/// use isoform_control::Control;
/// use isoform_field::Polynomial;
/// use isoform_geom::Aabb;
/// use isoform_patch::{Options, parameterize};
///
/// // x² + y² + z² = 1/4
/// let sphere = Polynomial::new([
///     ([2, 0, 0], 1.0),
///     ([0, 2, 0], 1.0),
///     ([0, 0, 2], 1.0),
///     ([0, 0, 0], -0.25),
/// ]);
/// let options = Options {
///     seed_point: Some([0.0, 0.0, 0.5]),
///     ..Options::new((2, 2), 1e-3, Aabb { lo: [-0.5; 3], hi: [0.5; 3] })
/// };
/// let made = parameterize(&sphere, &options, &Control::default())?;
/// assert!(made.distances.bound.is_some_and(|b| b <= 1e-3) && made.is_unfolded);
/// let p = made.grown.patch.point(0.3, 0.8);
/// let radius = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
/// assert!((radius - 0.5).abs() <= 1e-3);
/// # Ok::<(), isoform_patch::Error>(())
/// ```
///
/// # Errors
/// Options that are out of range, seeds from which no patch meets the requirements, and
/// [`Error::Stopped`] if the control stopped the search for a seed.
pub fn parameterize(
    field: &dyn Field,
    options: &Options,
    control: &Control<'_>,
) -> Result<Parameterized, Error> {
    options.check()?;
    let unit = UnitBox::new(&options.region);
    let (inside, options) = (unit.field(field), unit.options(options));
    MonotoneProgress::during(control, |control| {
        parameterize_in_unit_box(&inside, &options, control)
    })
    .map(|made| unit.made_out(made, field))
    .map_err(|error| unit.error_out(error))
}

fn parameterize_in_unit_box(
    field: &dyn Field,
    options: &Options,
    control: &Control<'_>,
) -> Result<Parameterized, Error> {
    control.report("seed", 0.0);
    let whole = Whole::of_field(field);
    let attempt = |seed: Seed, mut clock: Clock| {
        clock.phase("seed");
        control.report("seed", 1.0);
        let on = GrowthPart {
            whole: &whole,
            part: 0,
            near_singular: NearSingular::Cross,
        };
        turned(on, seed, options, clock, control)
    };
    let mut clock = Clock::default();
    if let Some(p) = options.seed_point {
        let seed = surface::given(field, p, &options.region)?;
        return attempt(seed, clock);
    }
    let mut made = Err(Error::NoSurface);
    for other in 0..8u64 {
        let number = options.seed.wrapping_add(other << 32);
        let seed = surface::chosen(field, number, &options.region, control)?;
        made = attempt(seed, std::mem::take(&mut clock));
        // Where the function has an edge, projections end on it and no patch starts.
        if !matches!(made, Err(Error::NoPatch { .. })) {
            break;
        }
    }
    made
}

/// Grows one patch on one part of a surface, up to the part's edges, and proves a bound on its
/// distance from the surface.
///
/// The patch stays on the part on which its seed lies; it extends beyond the edges of the part by
/// less than the tolerance.
///
/// # Errors
///
/// Options that are out of range, seeds from which no patch meets the requirements, and
/// [`Error::Stopped`] if the control stopped the search for a seed.
pub fn parameterize_part(
    parts: &Parts,
    options: &Options,
    control: &Control<'_>,
) -> Result<Parameterized, Error> {
    options.check()?;
    let unit = UnitBox::new(&options.region);
    let inside = unit.options(options);
    let moved = unit.parts(parts);
    MonotoneProgress::during(control, |control| {
        parameterize_part_in_unit_box(&moved, &inside, control)
    })
    .map(|made| {
        let part = made.part;
        unit.made_out(made, parts.parts[part].field.as_ref())
    })
    .map_err(|error| unit.error_out(error))
}

fn parameterize_part_in_unit_box(
    parts: &Parts,
    options: &Options,
    control: &Control<'_>,
) -> Result<Parameterized, Error> {
    control.report("seed", 0.0);
    let whole = Whole::of_parts(parts, &options.region);
    let place = match options.seed_point {
        Some(p) => place::nearest(&whole, p, options).ok_or(Error::FarSeed { at: p })?,
        None => place::chosen(&whole, options, control)?,
    };
    let on = GrowthPart {
        whole: &whole,
        part: place.part,
        near_singular: NearSingular::Cross,
    };
    at(on, place.point, options, control)
}
