//! Surfaces of faces.

use super::{CadCurve, NurbsSurface, Placement};
use crate::brep::Axes;
use crate::{Point3, cross, norm, sub};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// Point of a surface with the derivatives up to the second order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceJet {
    /// Point.
    pub p: Point3,
    /// ∂p/∂u.
    pub u: Point3,
    /// ∂p/∂v.
    pub v: Point3,
    /// ∂²p/∂u².
    pub uu: Point3,
    /// ∂²p/∂u∂v.
    pub uv: Point3,
    /// ∂²p/∂v².
    pub vv: Point3,
}

impl SurfaceJet {
    /// Returns ∂p/∂u × ∂p/∂v.
    pub fn normal(&self) -> Point3 {
        cross(self.u, self.v)
    }
}

/// Surface in parameter form, with the parameters of ISO 10303-42; angles are in radians.
#[derive(Clone, Debug, PartialEq)]
pub enum CadSurface {
    /// Plane z = 0 of the frame; u and v are x and y.
    Plane(Axes),
    /// Cylinder with its radius; u is the angle about z, and v is z.
    Cylinder(Axes, f64),
    /// Cone with the radius at z = 0 and the half angle; u is the angle about z, and v is z.
    Cone(Axes, f64, f64),
    /// Sphere with its radius; u is the longitude and v the latitude.
    Sphere(Axes, f64),
    /// Torus with its major and minor radius; u is the angle about z, and v that about the tube,
    /// from the outer equator.
    Torus(Axes, f64, f64),
    /// Profile revolved about z of the frame; u is the angle, and v the parameter of the profile.
    Revolved(Axes, CadCurve),
    /// Profile moved along a vector; u is the parameter of the profile, and v the multiple of the
    /// vector.
    Extruded(CadCurve, Point3),
    /// Rational B-spline.
    Nurbs(Arc<NurbsSurface>),
}

impl CadSurface {
    /// Returns the name of the kind, such as `cylinder`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Plane(_) => "plane",
            Self::Cylinder(..) => "cylinder",
            Self::Cone(..) => "cone",
            Self::Sphere(..) => "sphere",
            Self::Torus(..) => "torus",
            Self::Revolved(..) => "revolved",
            Self::Extruded(..) => "extruded",
            Self::Nurbs(_) => "spline",
        }
    }
    /// Returns the point at parameters, with the derivatives up to the second order.
    pub fn at(&self, [u, v]: [f64; 2]) -> SurfaceJet {
        let turned = |axes: &Axes, profile: [Point3; 3]| {
            let (s, c) = u.sin_cos();
            let turn = |[x, y, z]: Point3| [c * x - s * y, s * x + c * y, z];
            let across = |[x, y, _]: Point3| [-s * x - c * y, c * x - s * y, 0.0];
            let inward = |[x, y, _]: Point3| [-c * x + s * y, -s * x - c * y, 0.0];
            let [p, d, dd] = profile;
            SurfaceJet {
                p: axes.point(turn(p)),
                u: axes.vector(across(p)),
                v: axes.vector(turn(d)),
                uu: axes.vector(inward(p)),
                uv: axes.vector(across(d)),
                vv: axes.vector(turn(dd)),
            }
        };
        match self {
            Self::Plane(axes) => SurfaceJet {
                p: axes.point([u, v, 0.0]),
                u: axes.x,
                v: axes.y(),
                ..SurfaceJet::default()
            },
            Self::Cylinder(axes, r) => turned(axes, [[*r, 0.0, v], [0.0, 0.0, 1.0], [0.0; 3]]),
            Self::Cone(axes, r, angle) => {
                let slope = angle.tan();
                turned(axes, [[r + v * slope, 0.0, v], [slope, 0.0, 1.0], [0.0; 3]])
            }
            Self::Sphere(axes, r) => {
                let (s, c) = v.sin_cos();
                let at = [r * c, 0.0, r * s];
                turned(axes, [at, [-r * s, 0.0, r * c], at.map(|x| -x)])
            }
            Self::Torus(axes, major, minor) => {
                let (s, c) = (minor * v.sin(), minor * v.cos());
                let profile = [[major + c, 0.0, s], [-s, 0.0, c], [-c, 0.0, -s]];
                turned(axes, profile)
            }
            Self::Revolved(axes, curve) => {
                let [p, d, dd] = curve.at(v);
                let [d, dd] = [d, dd].map(|d| axes.vector_local(d));
                turned(axes, [axes.local(p), d, dd])
            }
            Self::Extruded(curve, way) => {
                let [p, d, dd] = curve.at(u);
                SurfaceJet {
                    p: std::array::from_fn(|k| p[k] + v * way[k]),
                    u: d,
                    v: *way,
                    uu: dd,
                    ..SurfaceJet::default()
                }
            }
            Self::Nurbs(spline) => spline.at([u, v]),
        }
    }
    /// Returns the first and last parameter of u and of v; infinite without a bound.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        let all = [f64::NEG_INFINITY, f64::INFINITY];
        match self {
            Self::Plane(_) => [all, all],
            Self::Cylinder(..) => [[0.0, TAU], all],
            Self::Cone(_, r, angle) => {
                let apex = -r / angle.tan();
                let side = if *angle > 0.0 {
                    [apex, f64::INFINITY]
                } else {
                    [f64::NEG_INFINITY, apex]
                };
                [[0.0, TAU], side]
            }
            Self::Sphere(..) => [[0.0, TAU], [-FRAC_PI_2, FRAC_PI_2]],
            Self::Torus(..) => [[0.0, TAU], [0.0, TAU]],
            Self::Revolved(_, curve) => [[0.0, TAU], curve.domain()],
            Self::Extruded(curve, _) => [curve.domain(), all],
            Self::Nurbs(spline) => spline.domain(),
        }
    }
    /// Returns the periods of u and v; `None` where the surface does not close.
    pub fn periods(&self) -> [Option<f64>; 2] {
        match self {
            Self::Plane(_) => [None; 2],
            Self::Cylinder(..) | Self::Cone(..) | Self::Sphere(..) => [Some(TAU), None],
            Self::Torus(..) => [Some(TAU); 2],
            Self::Revolved(_, curve) => [Some(TAU), curve.period()],
            Self::Extruded(curve, _) => [curve.period(), None],
            Self::Nurbs(spline) => spline.periods(),
        }
    }
    /// Returns the lines of one parameter that are single points: the direction that is constant, 0
    /// for u and 1 for v, and its value.
    pub fn poles(&self) -> Vec<(usize, f64)> {
        match self {
            Self::Sphere(..) => vec![(1, -FRAC_PI_2), (1, FRAC_PI_2)],
            Self::Cone(_, r, angle) => vec![(1, -r / angle.tan())],
            Self::Revolved(axes, curve) => poles_of_profile(axes, curve),
            Self::Nurbs(spline) => spline.poles().to_vec(),
            _ => Vec::new(),
        }
    }
    /// Returns the values of u (0) or v (1) between which the surface is smooth, the ends of its
    /// domain included; empty if it is smooth everywhere.
    pub fn breaks(&self, direction: usize) -> Vec<f64> {
        match (self, direction) {
            (Self::Nurbs(spline), _) => spline.breaks(direction),
            (Self::Revolved(_, CadCurve::Nurbs(c)), 1)
            | (Self::Extruded(CadCurve::Nurbs(c), _), 0) => c.breaks(),
            _ => Vec::new(),
        }
    }
    /// Returns the parameters of all points of the surface at which its normal leads to `p`, for
    /// surfaces with a formula; `None` for the others. On the axis any angle is returned.
    pub fn feet(&self, p: Point3) -> Option<Vec<[f64; 2]>> {
        let opposite = |u: f64| if u > 0.0 { u - PI } else { u + PI };
        Some(match self {
            Self::Plane(axes) => {
                let [x, y, _] = axes.local(p);
                vec![[x, y]]
            }
            Self::Cylinder(axes, _) => {
                let [x, y, z] = axes.local(p);
                let u = y.atan2(x);
                vec![[u, z], [opposite(u), z]]
            }
            Self::Cone(axes, r, angle) => {
                let [x, y, z] = axes.local(p);
                let (s, c) = angle.sin_cos();
                let (u, out) = (y.atan2(x), x.hypot(y));
                // Along the lines of the cone in the half-planes of u and of its opposite.
                let foot = |out: f64| c * (c * z + s * (out - r));
                vec![[u, foot(out)], [opposite(u), foot(-out)]]
            }
            Self::Sphere(axes, _) => {
                let [x, y, z] = axes.local(p);
                let (u, v) = (y.atan2(x), z.atan2(x.hypot(y)));
                vec![[u, v], [opposite(u), -v]]
            }
            Self::Torus(axes, major, _) => {
                let [x, y, z] = axes.local(p);
                let (u, out) = (y.atan2(x), x.hypot(y));
                let v = z.atan2(out - major);
                let w = z.atan2(-out - major);
                let (far, back) = (opposite(u), opposite(w));
                vec![[u, v], [u, opposite(v)], [far, w], [far, back]]
            }
            _ => return None,
        })
    }
    /// Returns the surface in another place.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Self {
        match self {
            Self::Plane(axes) => Self::Plane(by.axes(axes)),
            Self::Cylinder(axes, r) => Self::Cylinder(by.axes(axes), by.scale * r),
            Self::Cone(axes, r, angle) => Self::Cone(by.axes(axes), by.scale * r, *angle),
            Self::Sphere(axes, r) => Self::Sphere(by.axes(axes), by.scale * r),
            Self::Torus(axes, major, minor) => {
                Self::Torus(by.axes(axes), by.scale * major, by.scale * minor)
            }
            Self::Revolved(axes, curve) => Self::Revolved(by.axes(axes), curve.placed(by)),
            Self::Extruded(curve, way) => Self::Extruded(curve.placed(by), by.vector(*way)),
            Self::Nurbs(spline) => Self::Nurbs(Arc::new(spline.placed(by))),
        }
    }
}

/// Maximum distance of the tip of a profile from the axis, relative to its farthest sample: files
/// hold coordinates with seven digits or more.
const TIP_TOLERANCE: f64 = 1e-7;

/// Returns the parameters at which a profile meets the axis: its ends, those of a circle that is
/// centred on the axis, and the point of a line.
fn poles_of_profile(axes: &Axes, curve: &CadCurve) -> Vec<(usize, f64)> {
    let out = |v: f64| {
        let [x, y, _] = axes.local(curve.at(v)[0]);
        x.hypot(y)
    };
    let tips: Vec<f64> = match curve {
        CadCurve::Line(p, d) => {
            let (p, d) = (axes.local(*p), axes.vector_local(*d));
            let across = d[0] * d[0] + d[1] * d[1];
            vec![-(p[0] * d[0] + p[1] * d[1]) / across]
        }
        CadCurve::Circle(frame, _) | CadCurve::Ellipse(frame, ..) => {
            let along = axes.z;
            let t = curve.parameter(std::array::from_fn(|k| frame.origin[k] + along[k]));
            vec![t, t + PI]
        }
        CadCurve::Nurbs(spline) if spline.period().is_none() => spline.domain().to_vec(),
        _ => Vec::new(),
    };
    let [lo, hi] = curve.domain();
    let wide = match curve {
        CadCurve::Line(p, d) => norm(*d) + norm(sub(*p, axes.origin)),
        _ if lo.is_finite() => (0..=16)
            .map(|k| out(lo + (hi - lo) * f64::from(k) / 16.0))
            .fold(0.0, f64::max),
        _ => 0.0,
    };
    let is_tip = |v: &f64| v.is_finite() && out(*v) <= TIP_TOLERANCE * wide;
    tips.into_iter().filter(is_tip).map(|v| (1, v)).collect()
}
