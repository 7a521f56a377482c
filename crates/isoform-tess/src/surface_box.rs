//! The box around a rational surface that is provably bounded.

use crate::domain::{Domain, bounds_over};
use crate::map::Map;
use crate::patch::{Patch, patch_bounds};
use isoform_algebra::{Exponents, Poly, RBig};
use isoform_geom::Point3;

/// Ratio of the box to the extent of the surface: without a margin, extreme points would lie on
/// faces of the box; with a much larger one, the default tolerance would be coarse.
const BOX_MARGIN_FACTOR: f64 = 1.01;

/// Number of directions in which a map is sampled for a box that shows it.
const SHOWN_DIRECTIONS: usize = 4096;

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

    /// Returns a box that shows a map of the whole plane: three times the median of the largest
    /// coordinate over all directions (s : t : w), and not more than the largest of all.
    pub fn showing(map: &Map) -> Option<Self> {
        let forms = map.forms().each_ref().map(Poly::to_f64);
        let value = |form: &[(Exponents, f64)], p: Point3| {
            let term = |(e, c): &(Exponents, f64)| {
                let powers = p.iter().zip(e).map(|(x, n)| x.powi(i32::from(*n)));
                c * powers.product::<f64>()
            };
            form.iter().map(term).sum::<f64>()
        };
        // A spiral of equal areas on a hemisphere; W = 0 at no regular position.
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let direction = |i: usize| {
            let z = (i as f64 + 0.5) / SHOWN_DIRECTIONS as f64;
            let (r, angle) = ((1.0 - z * z).sqrt(), golden * i as f64);
            [r * angle.cos(), r * angle.sin(), z]
        };
        let coordinate = |i: usize| -> f64 {
            let p = direction(i);
            let [x, y, z, w] = forms.each_ref().map(|form| value(form, p));
            [x, y, z]
                .into_iter()
                .fold(0.0, |m: f64, v| m.max((v / w).abs()))
        };
        let mut sizes: Vec<f64> = (0..SHOWN_DIRECTIONS).map(coordinate).collect();
        sizes.retain(|v| v.is_finite());
        sizes.sort_by(f64::total_cmp);
        let median = *sizes.get(sizes.len() / 2)?;
        let half = (3.0 * median).min(*sizes.last()?);
        let extent = || [RBig::try_from(-half), RBig::try_from(half)];
        let [Ok(lo), Ok(hi)] = extent() else {
            return None;
        };
        Self::around(&[[lo, hi], [RBig::ZERO, RBig::ZERO], [RBig::ZERO, RBig::ZERO]])
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
