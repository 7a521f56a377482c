//! Placement of the frame of a face's surface: seams and poles away from the face.

use crate::cut::{MIN_CAP_COSINE, MIN_ELLIPSOID_CAP_COSINE, cap_direction, gaps_of};
use isoform_geom::brep::{Axes, Revolved, Surface};
use isoform_geom::{Point3, dot, orthonormal_complement, sub};
use std::sync::Arc;

/// Returns the surface with its frame placed for a face, given by the sides of its triangles.
/// `outward` is a normal of the face: the normal of a plane takes its side.
pub(crate) fn place(
    surface: &Surface,
    points: &[Point3],
    sides: &[[u32; 2]],
    outward: Point3,
) -> Surface {
    let nodes = sides.iter().map(|s| points[s[0] as usize]);
    let count = sides.len() as f64;
    let sum = nodes.clone().fold([0.0; 3], |sum: Point3, p| {
        std::array::from_fn(|k| sum[k] + p[k])
    });
    let middle = sum.map(|v| v / count);
    let axes = *surface.axes();
    // The frame turned so that its x, where angles begin, lies in the middle of the gap.
    let seam_free = |axes: Axes| {
        let free = gaps_of(surface, points, sides)[0].0;
        let own = surface.axes();
        axes.turned(own.vector([free.cos(), free.sin(), 0.0]))
    };
    let on_axis = || axes.point([0.0, 0.0, axes.local(middle)[2]]);
    match *surface {
        Surface::Plane(_) => {
            let off = axes.local(middle)[2];
            let origin = std::array::from_fn(|k| middle[k] - off * axes.z[k]);
            let z = if dot(axes.z, outward) < 0.0 {
                axes.z.map(|v| -v)
            } else {
                axes.z
            };
            Surface::Plane(Axes::along(origin, z))
        }
        Surface::Cylinder(_, radius) => Surface::Cylinder(
            seam_free(Axes {
                origin: on_axis(),
                ..axes
            }),
            radius,
        ),
        Surface::Cone(_, radius, half_angle) => {
            let height = axes.local(middle)[2] - surface.base_of_v();
            let z = axes.z.map(|v| v * height.signum());
            let origin = on_axis();
            let radius_there = (radius + axes.local(middle)[2] * half_angle.tan()).abs();
            Surface::Cone(
                seam_free(Axes { origin, z, ..axes }),
                radius_there,
                half_angle,
            )
        }
        Surface::Sphere(_, radius) => {
            let out = nodes.map(|p| sub(p, axes.origin));
            let direction = cap_direction(out, MIN_CAP_COSINE).unwrap_or(axes.x);
            let [z, _] = orthonormal_complement(direction);
            let axes = Axes::along(axes.origin, z).turned(direction.map(|v| -v));
            Surface::Sphere(axes, radius)
        }
        Surface::Torus(_, major, minor) => Surface::Torus(seam_free(axes), major, minor),
        Surface::Ellipsoid(ball) => {
            let out = nodes.map(|p| ball.shrunk(p));
            let direction = cap_direction(out, MIN_ELLIPSOID_CAP_COSINE).unwrap_or([1.0, 0.0, 0.0]);
            Surface::Ellipsoid(ball.facing(direction))
        }
        Surface::Revolved(ref turned) => Surface::Revolved(Arc::new(Revolved {
            axes: seam_free(axes),
            ..Revolved::clone(turned)
        })),
        Surface::Graph(_) => surface.clone(),
    }
}
