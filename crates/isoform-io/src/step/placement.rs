//! Placement of named surfaces such that seam and poles are away from the patch.

use isoform_geom::{Point3, Quadric, RationalPatch, Tangents, dot, norm, sub};

/// Number of samples of a patch in each direction.
const SAMPLES_PER_SIDE: usize = 9;
/// Cosine of the minimum angle between a patch and a seam.
const MAX_SEAM_COSINE: f64 = 0.98;
/// Cosine of the maximum angle between a patch on a sphere and its middle (80°), as seen from the
/// centre.
const MIN_SPHERE_COSINE: f64 = 0.17;

/// Axes: an origin, and the directions of z and x.
pub(super) struct AxisPlacement {
    pub(super) origin: Point3,
    pub(super) z: Point3,
    pub(super) x: Point3,
}

/// Named surface as a STEP entity.
pub(super) struct PlacedSurface {
    /// Name of the entity in the schema.
    pub(super) entity: &'static str,
    /// Position and orientation.
    pub(super) axes: AxisPlacement,
    /// Parameters that follow the axes, such as radii.
    pub(super) numbers: Vec<f64>,
    /// True if the normal agrees with ∂p/∂u × ∂p/∂v.
    pub(super) agrees: bool,
}

/// Samples of a patch.
struct PatchSamples {
    /// Points on a uniform grid of parameters.
    points: Vec<Point3>,
    /// Point and tangents at the middle.
    middle: Tangents,
    /// Normal at the middle.
    outward: Point3,
}

impl PatchSamples {
    /// Samples a patch on a square grid of parameters.
    fn from_patch(patch: &RationalPatch) -> Self {
        let at = |i: usize| i as f64 / (SAMPLES_PER_SIDE - 1) as f64;
        let middle = patch.tangents(0.5, 0.5);
        Self {
            points: (0..SAMPLES_PER_SIDE * SAMPLES_PER_SIDE)
                .map(|k| patch.point(at(k / SAMPLES_PER_SIDE), at(k % SAMPLES_PER_SIDE)))
                .collect(),
            outward: middle.normal(),
            middle,
        }
    }
    /// Returns true if the patch stays away from the half-plane of the seam about an axis.
    fn is_away_from_seam(&self, origin: Point3, axis: Point3, seam: Point3) -> bool {
        self.points
            .iter()
            .all(|p| is_away_from(perpendicular(sub(*p, origin), axis), seam))
    }
}

/// Places a surface for a patch. Returns `None` if every placement puts a pole, an apex or the seam
/// near the patch, and for quadrics without an entity.
pub(super) fn place(surface: &Quadric, patch: &RationalPatch) -> Option<PlacedSurface> {
    let view = PatchSamples::from_patch(patch);
    match *surface {
        Quadric::Plane { normal, offset } => plane(&view, normal, offset),
        Quadric::Sphere { center, radius } => sphere(&view, center, radius),
        Quadric::Cylinder {
            point,
            axis,
            radius,
        } => cylinder(&view, point, axis, radius),
        Quadric::Cone {
            apex,
            axis,
            half_angle,
        } => cone(&view, apex, axis, half_angle),
        Quadric::Torus {
            center,
            axis,
            major,
            minor,
        } => torus(&view, center, axis, [major, minor]),
        // STEP lacks entities for other quadrics.
        Quadric::Other { .. } => None,
    }
}

/// Places a plane; x is the direction of u at the middle of the patch.
fn plane(view: &PatchSamples, normal: Point3, offset: f64) -> Option<PlacedSurface> {
    let x = unit(perpendicular(view.middle.u, normal))?;
    let origin = normal.map(|v| offset * v);
    Some(PlacedSurface {
        entity: "PLANE",
        axes: AxisPlacement {
            origin,
            z: normal,
            x,
        },
        numbers: Vec::new(),
        agrees: dot(normal, view.outward) > 0.0,
    })
}

/// Places a sphere: its equator passes through the middle of the patch, and its seam is opposite.
fn sphere(view: &PatchSamples, center: Point3, radius: f64) -> Option<PlacedSurface> {
    let out = unit(sub(view.middle.point, center))?;
    let z = unit(perpendicular(view.middle.v, out))?;
    let x = out.map(|v| -v);
    // Poles and seam are at least 90° from the middle; the patch must stay within 80°.
    let is_near = |p: &Point3| dot(sub(*p, center), out) > MIN_SPHERE_COSINE * radius;
    view.points.iter().all(is_near).then(|| PlacedSurface {
        entity: "SPHERICAL_SURFACE",
        axes: AxisPlacement {
            origin: center,
            z,
            x,
        },
        numbers: vec![radius],
        agrees: dot(out, view.outward) > 0.0,
    })
}

/// Places a cylinder with the seam opposite to the middle of the patch.
fn cylinder(
    view: &PatchSamples,
    point: Point3,
    axis: Point3,
    radius: f64,
) -> Option<PlacedSurface> {
    let out = unit(perpendicular(sub(view.middle.point, point), axis))?;
    let x = out.map(|v| -v);
    view.is_away_from_seam(point, axis, x)
        .then(|| PlacedSurface {
            entity: "CYLINDRICAL_SURFACE",
            axes: AxisPlacement {
                origin: point,
                z: axis,
                x,
            },
            numbers: vec![radius],
            agrees: dot(out, view.outward) > 0.0,
        })
}

/// Places a cone with its origin at the height of the middle of the patch, and the seam opposite.
fn cone(view: &PatchSamples, apex: Point3, axis: Point3, half_angle: f64) -> Option<PlacedSurface> {
    // Axis towards the patch, and the circle about it through the middle of the patch.
    let height = dot(sub(view.middle.point, apex), axis);
    let z = axis.map(|v| v * height.signum());
    let height = height.abs();
    let out = unit(perpendicular(sub(view.middle.point, apex), z))?;
    let x = out.map(|v| -v);
    let is_beyond_apex = |p: &Point3| dot(sub(*p, apex), z) > (1.0 - MAX_SEAM_COSINE) * height;
    if !view.points.iter().all(is_beyond_apex) || !view.is_away_from_seam(apex, z, x) {
        return None;
    }
    let origin = std::array::from_fn(|k| apex[k] + height * z[k]);
    let (sin, cos) = half_angle.sin_cos();
    let normal: Point3 = std::array::from_fn(|k| cos * out[k] - sin * z[k]);
    Some(PlacedSurface {
        entity: "CONICAL_SURFACE",
        axes: AxisPlacement { origin, z, x },
        numbers: vec![height * half_angle.tan(), half_angle],
        agrees: dot(normal, view.outward) > 0.0,
    })
}

/// Places a torus with the seam about the axis opposite to the middle of the patch.
fn torus(
    view: &PatchSamples,
    center: Point3,
    axis: Point3,
    [major, minor]: [f64; 2],
) -> Option<PlacedSurface> {
    // Only the seam about the axis can be moved; the seam along the tube is the outer equator.
    let out = unit(perpendicular(sub(view.middle.point, center), axis))?;
    let x = out.map(|v| -v);
    let from_tube = |p: Point3| -> Option<Point3> {
        let round = unit(perpendicular(sub(p, center), axis))?;
        Some(std::array::from_fn(|k| p[k] - center[k] - major * round[k]))
    };
    let normal = unit(from_tube(view.middle.point)?)?;
    let behind = normal.map(|v| -v);
    let is_in_front = |p: &Point3| from_tube(*p).is_some_and(|d| is_away_from(d, behind));
    // A self-intersecting torus is another entity (DEGENERATE_TOROIDAL_SURFACE), which few readers
    // support.
    let fits = minor < MAX_SEAM_COSINE * major
        && view.is_away_from_seam(center, axis, x)
        && view.points.iter().all(is_in_front);
    fits.then(|| PlacedSurface {
        entity: "TOROIDAL_SURFACE",
        axes: AxisPlacement {
            origin: center,
            z: axis,
            x,
        },
        numbers: vec![major, minor],
        agrees: dot(normal, view.outward) > 0.0,
    })
}

/// Returns true if a vector does not have the direction of the seam.
fn is_away_from(d: Point3, seam: Point3) -> bool {
    dot(d, seam) < MAX_SEAM_COSINE * norm(d)
}

/// Returns the component of a vector perpendicular to a unit vector.
fn perpendicular(d: Point3, n: Point3) -> Point3 {
    let along = dot(d, n);
    let flat: Point3 = std::array::from_fn(|k| d[k] - along * n[k]);
    // Readers require exact perpendicularity: a second projection removes the rounding error of the
    // first.
    let left = dot(flat, n);
    std::array::from_fn(|k| flat[k] - left * n[k])
}

/// Normalises a vector; `None` if its length is zero or not finite.
fn unit(d: Point3) -> Option<Point3> {
    let length = norm(d);
    (length > 0.0 && length.is_finite()).then(|| d.map(|v| v / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orthogonal_axes_and_sides() {
        let patch =
            RationalPatch::planar((1, 1), [0.0, 0.0, 0.3], [1.0, 0.2, 0.0], [0.0, 1.0, 0.0]);
        let placed = place(
            &Quadric::Plane {
                normal: [0.0, 0.0, -1.0],
                offset: -0.3,
            },
            &patch,
        )
        .expect("a plane");
        assert!(!placed.agrees && dot(placed.axes.x, placed.axes.z) == 0.0);
        assert_eq!(placed.axes.origin, [-0.0, -0.0, 0.3]);
    }

    #[test]
    fn patches_beyond_a_pole_stay_splines() {
        // Stereographic projection from the point (0, 0, 1/2), within 2 atan(a) of it.
        let cap = |a: f64| {
            let (one, s, s2) = ([1.0; 3], [-a, 0.0, a], [a * a, -a * a, a * a]);
            let at = |i: usize, j: usize| {
                let r2 = s2[i] * one[j] + one[i] * s2[j];
                [
                    s[i] * one[j],
                    one[i] * s[j],
                    0.5 * (one[i] * one[j] - r2),
                    1.0 + r2,
                ]
            };
            RationalPatch::new((2, 2), (0..9).map(|k| at(k / 3, k % 3)).collect()).expect("a patch")
        };
        let sphere = Quadric::Sphere {
            center: [0.0; 3],
            radius: 0.5,
        };
        assert!(
            place(&sphere, &cap(0.5)).is_some()
                && place(&sphere, &cap(1.0)).is_none()
                && place(&sphere, &cap(2.0)).is_none()
        );
    }
}
