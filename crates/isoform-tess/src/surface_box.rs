//! The box around a rational surface that is provably bounded.

use crate::domain::{Domain, bounds_over};
use crate::map::Map;
use crate::patch::{Patch, patch_bounds};
use isoform_algebra::{Poly, RBig};

/// Ratio of the box to the extent of the surface: without a margin, extreme points would lie on
/// faces of the box; with a much larger one, the default tolerance would be coarse.
const BOX_MARGIN_FACTOR: f64 = 1.01;

/// A box around the origin that contains a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceBox {
    /// Half the width of the box, rounded up to two digits.
    pub half_width: RBig,
    /// Half the largest width of the surface itself, the unit of tolerances.
    pub size: f64,
}

impl SurfaceBox {
    /// Returns the box around a map over a domain; `None` if W is not proved to keep its sign
    /// there, or if the surface is too large or too small for doubles.
    ///
    /// ```
    /// use isoform_algebra::RBig;
    /// use isoform_tess::{Domain, Map, MapOptions, SurfaceBox};
    /// let paraboloid = Map::parse(["s", "t", "s^2 + t^2", "1"], MapOptions::default())?;
    /// let square = || [RBig::ZERO, RBig::ONE];
    /// let domain = Domain::rectangle(square(), square())?;
    /// let around = SurfaceBox::of_map(&paraboloid, &domain).expect("no pole");
    /// assert_eq!((around.half_width.to_string(), around.size), ("21/10".to_owned(), 1.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of_map(map: &Map, domain: &Domain) -> Option<Self> {
        Self::around(&bounds_over(map, domain)?)
    }

    /// Returns the box around patches; `None` if their weights are not proved to keep their sign,
    /// or if they are too large or too small for doubles.
    pub fn of_patches(patches: &[Patch]) -> Option<Self> {
        Self::around(&patch_bounds(patches)?)
    }

    fn around(bounds: &[[RBig; 2]; 3]) -> Option<Self> {
        let near = bounds
            .each_ref()
            .map(|b| b.each_ref().map(RBig::to_f64_fast));
        let farthest = near.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        let widths = near.iter().map(|[lo, hi]| 0.5 * (hi - lo));
        let size = widths.fold(0.0, f64::max);
        let exponent = (BOX_MARGIN_FACTOR * farthest).log10().floor() as i32 - 1;
        let digits = (BOX_MARGIN_FACTOR * farthest / 10f64.powi(exponent)).ceil();
        let text = format!("{digits:.0}e{exponent}");
        let half_width = Poly::parse(&text, &[]).ok()?.as_constant()?;
        let near = half_width.to_f64_fast();
        (near > 0.0 && near.is_normal()).then_some(Self { half_width, size })
    }
}
