//! Light, and default colours of surfaces, equal to those of the page.

use crate::camera::{Sight, along, unit};
use crate::color::Color;
use isoform::geom::{Point3, dot};

/// Colour of models.
pub(crate) const MODEL: Color = [132, 160, 190];
/// Colour of the back of surfaces, where their function is positive.
pub(crate) const BACK: Color = [226, 188, 128];
/// Colour of meshes.
pub(crate) const MESH: Color = [158, 170, 164];
/// Colour of maps and patches.
pub(crate) const MAP: Color = [150, 178, 205];
/// Colour of the caps of sections.
pub(crate) const CAP: Color = [224, 164, 88];
/// Colour of points.
pub(crate) const POINT: Color = [176, 84, 12];
/// Colour of outliers, and of points without an entity.
pub const OUTLIER: Color = [96, 96, 102];
/// Colour of edges and outlines.
pub(crate) const LINE: Color = [40, 44, 52];
/// Colour of the double curves of maps.
pub(crate) const DOUBLE: Color = [209, 73, 91];

/// Number of bands of brightness in drawings.
const BANDS: u8 = 6;

/// Returns a colour under a light above and to the left of the eye. Faces are lit on both sides.
pub(crate) fn lit(color: Color, normal: Point3, ray: Point3, sight: &Sight) -> [f64; 3] {
    let (n, light) = faced(normal, ray, sight);
    let diffuse = dot(n, light).max(0.0);
    let half = unit(along(light, ray, -1.0));
    let shine = dot(n, half).max(0.0).powi(40);
    under(color, diffuse).map(|c| c + 255.0 * 0.06 * shine)
}

/// Returns the normal on the side of the eye, and the direction to the light, which differs enough
/// from that of sight for the faces of a block to differ.
fn faced(normal: Point3, ray: Point3, sight: &Sight) -> (Point3, Point3) {
    let to_eye = ray.map(|v| -v);
    let light = unit(along(along(to_eye, sight.up, 0.6), sight.right, -0.4));
    let is_front = dot(normal, to_eye) >= 0.0;
    (if is_front { normal } else { normal.map(|v| -v) }, light)
}

/// Returns a colour under diffuse light of this share.
fn under(color: Color, diffuse: f64) -> [f64; 3] {
    color.map(|c| f64::from(c) * (0.56 + 0.56 * diffuse))
}

/// Returns the band of brightness of a surface under this light, from the darkest, 1.
pub(crate) fn band(normal: Point3, ray: Point3, sight: &Sight) -> u8 {
    let (n, light) = faced(normal, ray, sight);
    let share = f64::from(BANDS) * dot(n, light).max(0.0);
    (1 + share as u8).min(BANDS)
}

/// Returns the colour of a band of brightness; 0 stands for a colour without light.
pub(crate) fn banded(color: Color, band: u8) -> Color {
    let Some(below) = band.checked_sub(1) else {
        return color;
    };
    let diffuse = (f64::from(below) + 0.5) / f64::from(BANDS);
    under(color, diffuse).map(|c| c.clamp(0.0, 255.0).round() as u8)
}

/// Returns a colour without light.
pub(crate) fn flat(color: Color) -> [f64; 3] {
    color.map(f64::from)
}
