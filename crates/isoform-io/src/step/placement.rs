//! Where a named surface stands, turned so that its seam and its poles are away from the patch.

use isoform_geom::{Point3, Quadric, RationalPatch, dot, norm, sub};

/// Where a patch is looked at, in each direction.
const SAMPLES: usize = 9;
/// A patch must stay so far from a seam: the cosine of the angle.
const AWAY: f64 = 0.98;
/// The cosine of the angle within which a patch on a sphere must stay.
const NEAR: f64 = 0.17;

/// Axes: an origin, the direction of z, and that of x.
pub(super) struct Placement {
    pub(super) origin: Point3,
    pub(super) z: Point3,
    pub(super) x: Point3,
}

/// A named surface as an entity.
pub(super) struct Placed {
    pub(super) entity: &'static str,
    pub(super) axes: Placement,
    /// What follows the axes.
    pub(super) numbers: Vec<f64>,
    /// Whether its normal is on the side of ∂p/∂u × ∂p/∂v.
    pub(super) agrees: bool,
}

/// The surface about the patch; none where the patch comes near a pole, an apex or the seam,
/// wherever these are put, and for quadrics without an entity.
pub(super) fn place(surface: &Quadric, patch: &RationalPatch) -> Option<Placed> {
    let at = |i: usize| i as f64 / (SAMPLES - 1) as f64;
    let points: Vec<Point3> = (0..SAMPLES * SAMPLES)
        .map(|k| patch.point(at(k / SAMPLES), at(k % SAMPLES)))
        .collect();
    let middle = patch.tangents(0.5, 0.5);
    let outward = middle.normal();
    match *surface {
        Quadric::Plane { normal, offset } => {
            let x = unit(across(middle.u, normal))?;
            let origin = normal.map(|v| offset * v);
            Some(Placed {
                entity: "PLANE",
                axes: Placement {
                    origin,
                    z: normal,
                    x,
                },
                numbers: Vec::new(),
                agrees: dot(normal, outward) > 0.0,
            })
        }
        Quadric::Sphere { center, radius } => {
            let out = unit(sub(middle.point, center))?;
            let z = unit(across(middle.v, out))?;
            let x = out.map(|v| -v);
            // Within 80° of the middle there is neither pole nor seam.
            let far = points
                .iter()
                .all(|p| dot(sub(*p, center), out) > NEAR * radius);
            let placed = Placed {
                entity: "SPHERICAL_SURFACE",
                axes: Placement {
                    origin: center,
                    z,
                    x,
                },
                numbers: vec![radius],
                agrees: dot(out, outward) > 0.0,
            };
            far.then_some(placed)
        }
        Quadric::Cylinder {
            point,
            axis,
            radius,
        } => {
            let out = unit(across(sub(middle.point, point), axis))?;
            let x = out.map(|v| -v);
            let far = points.iter().all(|p| away(across(sub(*p, point), axis), x));
            let axes = Placement {
                origin: point,
                z: axis,
                x,
            };
            let placed = Placed {
                entity: "CYLINDRICAL_SURFACE",
                axes,
                numbers: vec![radius],
                agrees: dot(out, outward) > 0.0,
            };
            far.then_some(placed)
        }
        Quadric::Cone {
            apex,
            axis,
            half_angle,
        } => {
            // The axis towards the patch, and the circle about it at the patch's middle.
            let height = dot(sub(middle.point, apex), axis);
            let z = axis.map(|v| v * height.signum());
            let height = height.abs();
            let out = unit(across(sub(middle.point, apex), z))?;
            let x = out.map(|v| -v);
            let far = points.iter().all(|p| {
                let d = sub(*p, apex);
                dot(d, z) > (1.0 - AWAY) * height && away(across(d, z), x)
            });
            let origin = std::array::from_fn(|k| apex[k] + height * z[k]);
            let (sin, cos) = half_angle.sin_cos();
            let normal: Point3 = std::array::from_fn(|k| cos * out[k] - sin * z[k]);
            let numbers = vec![height * half_angle.tan(), half_angle];
            let placed = Placed {
                entity: "CONICAL_SURFACE",
                axes: Placement { origin, z, x },
                numbers,
                agrees: dot(normal, outward) > 0.0,
            };
            far.then_some(placed)
        }
        Quadric::Torus {
            center,
            axis,
            major,
            minor,
        } => {
            // Only about the axis can the seam be put opposite to the patch; along the tube it is
            // the outer equator.
            let out = unit(across(sub(middle.point, center), axis))?;
            let x = out.map(|v| -v);
            let tube = |p: Point3| -> Option<Point3> {
                let round = unit(across(sub(p, center), axis))?;
                Some(std::array::from_fn(|k| p[k] - center[k] - major * round[k]))
            };
            let normal = unit(tube(middle.point)?)?;
            let far = points.iter().all(|p| {
                away(across(sub(*p, center), axis), x)
                    && tube(*p).is_some_and(|d| away(d, normal.map(|v| -v)))
            });
            let axes = Placement {
                origin: center,
                z: axis,
                x,
            };
            let placed = Placed {
                entity: "TOROIDAL_SURFACE",
                axes,
                numbers: vec![major, minor],
                agrees: dot(normal, outward) > 0.0,
            };
            // With a tube that reaches the axis it is another entity, which few readers know.
            (far && minor < AWAY * major).then_some(placed)
        }
        // STEP has no entity for the others.
        Quadric::Other { .. } => None,
    }
}

/// Whether a vector is not along the seam.
fn away(d: Point3, seam: Point3) -> bool {
    dot(d, seam) < AWAY * norm(d)
}

/// The part of a vector at right angles to a unit vector.
fn across(d: Point3, n: Point3) -> Point3 {
    let along = dot(d, n);
    let flat: Point3 = std::array::from_fn(|k| d[k] - along * n[k]);
    // Exactly at right angles matters to readers: once more, against what the first difference has
    // left.
    let left = dot(flat, n);
    std::array::from_fn(|k| flat[k] - left * n[k])
}

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
        // Stereographic from the point (0, 0, 1/2), within 2 atan(a) of it.
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
