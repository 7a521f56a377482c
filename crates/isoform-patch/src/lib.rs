//! Approximate rational parameterization of implicit surfaces.
//!
//! E. Wurm, B. Jüttler, M.-S. Kim: Approximate Rational Parameterization of Implicitly Defined Surfaces (2003). A rational
//! tensor-product Bézier patch is fitted to a surface F = 0 by minimising S = I + ω_J J + ω_L L + ω_R R + ω_E E, and grown from a small
//! piece of a tangent plane until S reaches a bound. Any [`Field`] with derivatives will do.
#![forbid(unsafe_code)]

mod grow;
mod local;
mod objective;
mod options;
mod solver;
mod surface;

pub use grow::{Grown, Phase, Row};
pub use objective::{Derivatives, Evaluated, K, Method, Objective, Targets, Terms, Weights};
pub use options::{Error, Options, PAPER_LIMIT};

use isoform_geom::Field;

/// The largest degree: beyond it, systems are large and nothing is gained.
pub const MOST_DEGREE: usize = 8;

/// Grows one patch.
pub fn parameterize(field: &dyn Field, options: &Options) -> Result<Grown, Error> {
    check(field, options)?;
    let seed = match options.seed_point {
        Some(p) => surface::given(field, p, &options.region)?,
        None => surface::chosen(field, options.seed, &options.region)?,
    };
    if options.method == Method::Newton && field.jet3(seed.point).is_none() {
        return Err(Error::NoThirdDerivatives);
    }
    let objective = Objective::new(field, options.degree, options.method, options.nodes);
    let mut growth = grow::Growth::start(objective, seed, options)?;
    growth.to_limit();
    Ok(growth.finish())
}

fn check(_: &dyn Field, options: &Options) -> Result<(), Error> {
    let (m, n) = options.degree;
    if !(1..=MOST_DEGREE).contains(&m) || !(1..=MOST_DEGREE).contains(&n) {
        return Err(Error::Degree(m, n));
    }
    let size = options.region.size();
    if !size.iter().all(|s| *s > 0.0 && s.is_finite()) {
        return Err(Error::Region);
    }
    for (name, value) in [("the bound on S", Some(options.limit)), ("the tolerance", options.tolerance)] {
        if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
            return Err(Error::Option { name, value });
        }
    }
    if let Some(p) = options.seed_point.filter(|p| !p.iter().all(|v| v.is_finite())) {
        return Err(Error::NotFinite { at: p });
    }
    Ok(())
}
