//! Surfaces in minimal parameters: distances, their derivatives, and changes of the parameters.

use isoform_geom::{Point3, Quadric, cross, dot, norm, sub};

/// Step of central differences, in radians and diagonals: about the cube root of the rounding.
pub(crate) const DIFFERENCE_STEP: f64 = 1e-6;
/// Standard deviation that rounding causes in a parameter, in radians and diagonals.
pub(crate) const ROUNDING_DEVIATION: f64 = 1e-8;
/// Maximum number of parameters of a surface: those of a torus.
pub(crate) const MAX_PARAMETERS: usize = 7;

/// A row of the Jacobian; entries beyond the surface's own parameters are 0.
pub(crate) type ParameterRow = [f64; MAX_PARAMETERS];

/// Maximum radius, in diagonals of the scan: over the diagonal its arc has a sagitta of an eighth
/// of a thousandth of the diagonal, and a plane fits as well.
const MAX_RADIUS: f64 = 1000.0;
/// Minimum radius, in standard deviations of the noise. Blobs of points within three deviations are
/// followed by circles of two; a larger bound loses fillets.
pub(crate) const MIN_RADIUS_DEVIATIONS: f64 = 4.0;

/// Kinds of surfaces, ordered by their number of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PrimitiveKind {
    /// Plane.
    Plane,
    /// Sphere.
    Sphere,
    /// Cylinder of revolution.
    Cylinder,
    /// Cone of revolution.
    Cone,
    /// Torus.
    Torus,
}

impl PrimitiveKind {
    /// Kinds with their names, those of [`Quadric::name`].
    pub const NAMED: [(&'static str, Self); 5] = [
        ("plane", Self::Plane),
        ("sphere", Self::Sphere),
        ("cylinder", Self::Cylinder),
        ("cone", Self::Cone),
        ("torus", Self::Torus),
    ];

    /// Returns the name.
    pub fn name(self) -> &'static str {
        Self::NAMED[self as usize].0
    }

    pub(crate) const ALL: &'static [Self; 5] = &[
        Self::Plane,
        Self::Sphere,
        Self::Cylinder,
        Self::Cone,
        Self::Torus,
    ];

    /// Returns the kinds with fewer parameters.
    pub(crate) fn simpler(self) -> &'static [Self] {
        &Self::ALL[..self as usize]
    }

    /// Returns the range of the minimal parameters that are lengths.
    pub(crate) fn lengths(self) -> std::ops::Range<usize> {
        match self {
            Self::Plane => 2..3,
            Self::Sphere => 0..4,
            Self::Cylinder | Self::Cone => 2..5,
            Self::Torus => 2..7,
        }
    }

    /// Returns the number of parameters of the kind.
    pub(crate) fn parameters(self) -> usize {
        match self {
            Self::Plane => 3,
            Self::Sphere => 4,
            Self::Cylinder => 5,
            Self::Cone => 6,
            Self::Torus => 7,
        }
    }
}

/// A surface about a reference point of its own. A cone is given by its radius at that point, so
/// that it passes into a cylinder without a singularity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Primitive {
    pub(crate) kind: PrimitiveKind,
    /// Reference point: a point of the plane, the centre, or a point of the axis.
    pub(crate) place: Point3,
    /// Unit normal of the plane, or unit vector along the axis.
    pub(crate) axis: Point3,
    /// Radius; of a cone that at `place`, of a torus that of its circle.
    pub(crate) size: f64,
    /// Half angle of a cone (radians), positive if it widens along the axis; radius of a torus's
    /// tube.
    pub(crate) other: f64,
}

/// Cylindrical coordinates of a point about an axis.
struct CylindricalPoint {
    /// Coordinate along the axis.
    height: f64,
    /// Distance from the axis.
    radius: f64,
    /// Unit vector away from the axis; an arbitrary normal of it for points on the axis.
    away: Point3,
}

/// Evaluator of the distances of many points from one surface.
pub(crate) struct PrimitiveDistances<'a> {
    surface: &'a Primitive,
    /// Sine and cosine of a cone's half angle; 0 and 1 of other kinds.
    sin: f64,
    cos: f64,
}

impl PrimitiveDistances<'_> {
    /// Returns [`Primitive::distance`].
    #[inline]
    pub(crate) fn at(&self, p: Point3) -> f64 {
        let surface = self.surface;
        let d = sub(p, surface.place);
        match surface.kind {
            PrimitiveKind::Plane => return dot(d, surface.axis),
            PrimitiveKind::Sphere => return norm(d) - surface.size,
            PrimitiveKind::Cylinder | PrimitiveKind::Cone | PrimitiveKind::Torus => {}
        }
        let height = dot(d, surface.axis);
        let across: Point3 = std::array::from_fn(|k| d[k] - height * surface.axis[k]);
        let r = norm(across) - surface.size;
        match surface.kind {
            PrimitiveKind::Cone => r * self.cos - height * self.sin,
            PrimitiveKind::Torus => length(r, height) - surface.other,
            _ => r,
        }
    }

    /// Returns [`Primitive::normal`].
    pub(crate) fn normal(&self, p: Point3) -> Point3 {
        let surface = self.surface;
        let along = |q: &CylindricalPoint, r: f64, h: f64| -> Point3 {
            std::array::from_fn(|k| r * q.away[k] + h * surface.axis[k])
        };
        match surface.kind {
            PrimitiveKind::Plane => surface.axis,
            PrimitiveKind::Sphere => {
                let d = sub(p, surface.place);
                let length = norm(d).max(f64::MIN_POSITIVE);
                d.map(|x| x / length)
            }
            PrimitiveKind::Cylinder => surface.around(p).away,
            PrimitiveKind::Cone => along(&surface.around(p), self.cos, -self.sin),
            PrimitiveKind::Torus => {
                let q = surface.around(p);
                let (r, h) = (q.radius - surface.size, q.height);
                let length = length(r, h).max(f64::MIN_POSITIVE);
                along(&q, r / length, h / length)
            }
        }
    }
}

/// Evaluator of distances with their derivatives by the parameters of [`Primitive::moved`].
pub(crate) struct DistanceJacobian<'a> {
    surface: &'a Primitive,
    /// The two vectors of [`Primitive::frame`].
    across: [Point3; 2],
    /// Sine and cosine of a cone's half angle; 0 and 1 of other kinds.
    sin: f64,
    cos: f64,
}

impl DistanceJacobian<'_> {
    /// Returns the distance of a point and its derivatives. `kind` is that of the surface: a loop
    /// for a kind known at compile time takes half the time.
    #[inline(always)]
    pub(crate) fn at(&self, kind: PrimitiveKind, p: Point3) -> (f64, ParameterRow) {
        let [e, f] = &self.across;
        let surface = self.surface;
        let d = sub(p, surface.place);
        let height = dot(d, surface.axis);
        match kind {
            PrimitiveKind::Plane => {
                let row = [dot(d, *e), dot(d, *f), -1.0, 0.0, 0.0, 0.0, 0.0];
                return (height, row);
            }
            PrimitiveKind::Sphere => {
                let length = at_least(norm(d));
                let n = d.map(|x| x / length);
                let row = [-n[0], -n[1], -n[2], -1.0, 0.0, 0.0, 0.0];
                return (length - surface.size, row);
            }
            PrimitiveKind::Cylinder | PrimitiveKind::Cone | PrimitiveKind::Torus => {}
        }
        let v: Point3 = std::array::from_fn(|k| d[k] - height * surface.axis[k]);
        let radius = norm(v);
        // On the axis, which has no direction away from it, tilts and shifts change nothing.
        let divisor = at_least(radius);
        let (ue, uf) = (dot(v, *e) / divisor, dot(v, *f) / divisor);
        let r = radius - surface.size;
        if kind == PrimitiveKind::Torus {
            let length = at_least(length(r, height));
            let tilt = height * surface.size / length;
            let n: Point3 = std::array::from_fn(|k| {
                let away = (ue * e[k] + uf * f[k]) * r;
                (away + height * surface.axis[k]) / length
            });
            let row = [tilt * ue, tilt * uf, -n[0], -n[1], -n[2], -r / length, -1.0];
            return (length - surface.other, row);
        }
        let (sin, cos) = (self.sin, self.cos);
        let tilt = -(height * cos + radius * sin);
        let turn = match kind {
            PrimitiveKind::Cone => -r * sin - height * cos,
            _ => 0.0,
        };
        let row = [tilt * ue, tilt * uf, -ue * cos, -uf * cos, -cos, turn, 0.0];
        (r * cos - height * sin, row)
    }
}

/// Returns a length that is safe as a divisor: one instruction, for which `max` takes three.
fn at_least(length: f64) -> f64 {
    match length > f64::MIN_POSITIVE {
        true => length,
        false => f64::MIN_POSITIVE,
    }
}

/// Returns √(x² + y²) of lengths in diagonals, which cannot overflow; `hypot` takes four times as
/// long.
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

impl Primitive {
    /// Returns the plane through a point with a unit normal.
    pub(crate) fn plane(place: Point3, normal: Point3) -> Self {
        Self {
            kind: PrimitiveKind::Plane,
            place,
            axis: normal,
            size: 0.0,
            other: 0.0,
        }
    }

    /// Returns two unit vectors that form an orthonormal frame with the axis.
    pub(crate) fn frame(&self) -> [Point3; 2] {
        frame(self.axis)
    }

    fn around(&self, p: Point3) -> CylindricalPoint {
        let d = sub(p, self.place);
        let height = dot(d, self.axis);
        let v: Point3 = std::array::from_fn(|k| d[k] - height * self.axis[k]);
        let radius = norm(v);
        let away = match radius > 0.0 {
            true => v.map(|x| x / radius),
            false => self.frame()[0],
        };
        CylindricalPoint {
            height,
            radius,
            away,
        }
    }

    /// Returns the signed distance: positive on the side of the normal, away from the centre or
    /// axis.
    pub(crate) fn distance(&self, p: Point3) -> f64 {
        self.distances().at(p)
    }

    /// Returns an evaluator of the distances of many points.
    pub(crate) fn distances(&self) -> PrimitiveDistances<'_> {
        let (sin, cos) = self.slope();
        PrimitiveDistances {
            surface: self,
            sin,
            cos,
        }
    }

    /// Returns the sine and cosine of a cone's half angle; 0 and 1 of other kinds.
    pub(crate) fn slope(&self) -> (f64, f64) {
        match self.kind {
            PrimitiveKind::Cone => self.other.sin_cos(),
            _ => (0.0, 1.0),
        }
    }

    /// Returns the gradient of the distance, a unit vector.
    pub(crate) fn normal(&self, p: Point3) -> Point3 {
        self.distances().normal(p)
    }

    /// Returns the largest absolute curvature near a point.
    pub(crate) fn curvature(&self, p: Point3) -> f64 {
        let radius = match self.kind {
            PrimitiveKind::Plane => return 0.0,
            PrimitiveKind::Sphere | PrimitiveKind::Cylinder => self.size,
            PrimitiveKind::Cone => self.around(p).radius / self.other.cos(),
            PrimitiveKind::Torus => self.other,
        };
        radius.abs().recip()
    }

    /// Returns the nearest point of the surface.
    pub(crate) fn foot(&self, p: Point3) -> Point3 {
        let (d, n) = (self.distance(p), self.normal(p));
        std::array::from_fn(|k| p[k] - d * n[k])
    }

    /// Returns an evaluator of the derivatives of the distances of many points.
    pub(crate) fn rows(&self) -> DistanceJacobian<'_> {
        let (sin, cos) = self.slope();
        DistanceJacobian {
            surface: self,
            across: self.frame(),
            sin,
            cos,
        }
    }

    /// Returns the surface after a step of its parameters: the axis tilted along the two vectors of
    /// the frame, the reference point moved (of a plane along its normal, of cylinders and cones
    /// across the axis), the sizes changed.
    pub(crate) fn moved(&self, step: &ParameterRow) -> Self {
        let [e, f] = self.frame();
        let tilted = || {
            unit(std::array::from_fn(|k| {
                self.axis[k] + step[0] * e[k] + step[1] * f[k]
            }))
        };
        let mut new = *self;
        match self.kind {
            PrimitiveKind::Plane => {
                new.axis = tilted();
                new.place = std::array::from_fn(|k| self.place[k] + step[2] * self.axis[k]);
            }
            PrimitiveKind::Sphere => {
                new.place = std::array::from_fn(|k| self.place[k] + step[k]);
                new.size += step[3];
            }
            PrimitiveKind::Cylinder | PrimitiveKind::Cone => {
                new.axis = tilted();
                let shift = |k: usize| step[2] * e[k] + step[3] * f[k];
                new.place = std::array::from_fn(|k| self.place[k] + shift(k));
                new.size += step[4];
                new.other += step[5];
            }
            PrimitiveKind::Torus => {
                new.axis = tilted();
                new.place = std::array::from_fn(|k| self.place[k] + step[2 + k]);
                new.size += step[5];
                new.other += step[6];
            }
        }
        new
    }

    /// Returns the surface with its reference point moved to the projection of `p` onto its plane
    /// or axis.
    pub(crate) fn about(&self, p: Point3) -> Self {
        let mut new = *self;
        match self.kind {
            PrimitiveKind::Plane => {
                let d = self.distance(p);
                new.place = std::array::from_fn(|k| p[k] - d * self.axis[k]);
            }
            PrimitiveKind::Cylinder | PrimitiveKind::Cone => {
                let h = dot(sub(p, self.place), self.axis);
                new.place = std::array::from_fn(|k| self.place[k] + h * self.axis[k]);
                if self.kind == PrimitiveKind::Cone {
                    new.size += h * self.other.tan();
                }
            }
            PrimitiveKind::Sphere | PrimitiveKind::Torus => {}
        }
        new
    }

    /// Returns the surface in a unit of length that is `factor` times as small.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let other = match self.kind {
            PrimitiveKind::Cone => self.other,
            _ => factor * self.other,
        };
        Self {
            place: self.place.map(|x| factor * x),
            size: factor * self.size,
            other,
            ..*self
        }
    }

    /// Returns true if the surface has an axis.
    pub(crate) fn is_round(&self) -> bool {
        matches!(
            self.kind,
            PrimitiveKind::Cylinder | PrimitiveKind::Cone | PrimitiveKind::Torus
        )
    }

    /// Returns true if the parameters are valid: finite, radii positive and bounded, the half angle
    /// of a cone below a right angle.
    pub(crate) fn is_proper(&self) -> bool {
        let are_finite = self.place.iter().chain(&self.axis).all(|x| x.is_finite());
        let radius = |r: f64| r > 0.0 && r < MAX_RADIUS;
        are_finite
            && match self.kind {
                PrimitiveKind::Plane => true,
                PrimitiveKind::Sphere | PrimitiveKind::Cylinder => radius(self.size),
                // Cones of a larger half angle, 86°, are planes.
                PrimitiveKind::Cone => self.other.abs() < 1.5 && self.size.abs() < MAX_RADIUS,
                // Also for a tube that passes its axis (a spindle torus).
                PrimitiveKind::Torus => radius(self.size) && radius(self.other),
            }
    }

    /// Returns the sizes, radii and the half angle of a cone (radians), each with its index among
    /// the minimal parameters.
    pub(crate) fn sizes(&self) -> Vec<(usize, f64)> {
        match self.kind {
            PrimitiveKind::Plane => Vec::new(),
            PrimitiveKind::Sphere => vec![(3, self.size)],
            PrimitiveKind::Cylinder => vec![(4, self.size)],
            PrimitiveKind::Cone => vec![(5, self.other)],
            PrimitiveKind::Torus => vec![(5, self.size), (6, self.other)],
        }
    }

    /// Returns true if the radius is large enough to be distinguished from noise. A tube whose
    /// radius is twice the noise follows any blob of points better than a face does.
    pub(crate) fn is_wider_than(&self, noise: f64) -> bool {
        let radius = match self.kind {
            PrimitiveKind::Plane | PrimitiveKind::Cone => f64::INFINITY,
            PrimitiveKind::Sphere | PrimitiveKind::Cylinder => self.size,
            PrimitiveKind::Torus => self.other,
        };
        radius >= MIN_RADIUS_DEVIATIONS * noise
    }

    /// Returns the surface in units `unit` times as large about another origin, in the terms of CAD
    /// systems.
    pub(crate) fn quadric(&self, unit: f64, origin: Point3) -> Quadric {
        let at = |p: Point3| -> Point3 { std::array::from_fn(|k| p[k] * unit + origin[k]) };
        let place = at(self.place);
        match self.kind {
            PrimitiveKind::Plane => Quadric::Plane {
                normal: self.axis,
                offset: dot(self.axis, place),
            },
            PrimitiveKind::Sphere => Quadric::Sphere {
                center: place,
                radius: self.size * unit,
            },
            PrimitiveKind::Cylinder => Quadric::Cylinder {
                point: place,
                axis: self.axis,
                radius: self.size * unit,
            },
            PrimitiveKind::Cone => Quadric::Cone {
                apex: at(self.apex()),
                axis: self.axis.map(|x| x * self.other.signum()),
                half_angle: self.other.abs(),
            },
            PrimitiveKind::Torus => Quadric::Torus {
                center: place,
                axis: self.axis,
                major: self.size * unit,
                minor: self.other * unit,
            },
        }
    }

    /// Returns the range of the points' coordinates along the axis, from the apex of a cone,
    /// otherwise from the reference point; 0 for planes and spheres.
    pub(crate) fn extent(&self, points: &[Point3]) -> [f64; 2] {
        let from = match self.kind {
            PrimitiveKind::Plane | PrimitiveKind::Sphere => return [0.0; 2],
            PrimitiveKind::Cone => self.apex(),
            PrimitiveKind::Cylinder | PrimitiveKind::Torus => self.place,
        };
        let heights = points.iter().map(|p| dot(sub(*p, from), self.axis));
        heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], h| {
            [lo.min(h), hi.max(h)]
        })
    }

    /// Returns a cone's apex.
    pub(crate) fn apex(&self) -> Point3 {
        let h = -self.size / self.other.tan();
        std::array::from_fn(|k| self.place[k] + h * self.axis[k])
    }
}

/// Returns the vector scaled to length 1; a zero vector stays.
pub(crate) fn unit(v: Point3) -> Point3 {
    let length = norm(v);
    if length > 0.0 {
        v.map(|x| x / length)
    } else {
        v
    }
}

/// Returns two unit vectors that form an orthonormal frame with this one.
pub(crate) fn frame(axis: Point3) -> [Point3; 2] {
    // The margin keeps rounding from choosing between components of equal size.
    let is_less = |k: usize, m: usize| axis[k].abs() + 1e-6 < axis[m].abs();
    let least = (0..3).fold(0, |m, k| if is_less(k, m) { k } else { m });
    let mut e = [0.0; 3];
    e[least] = 1.0;
    let f = unit(cross(axis, e));
    [f, cross(axis, f)]
}

/// Returns a vector rotated about a unit vector.
pub(crate) fn turned(v: Point3, axis: Point3, angle: f64) -> Point3 {
    let (sin, cos) = angle.sin_cos();
    let (along, across) = (dot(v, axis), cross(axis, v));
    std::array::from_fn(|k| cos * v[k] + sin * across[k] + (1.0 - cos) * along * axis[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<Primitive> {
        let axis = unit([1.0, 2.0, -0.5]);
        let of = |kind, size, other| Primitive {
            kind,
            place: [0.3, -0.2, 0.1],
            axis,
            size,
            other,
        };
        vec![
            of(PrimitiveKind::Plane, 0.0, 0.0),
            of(PrimitiveKind::Sphere, 0.7, 0.0),
            of(PrimitiveKind::Cylinder, 0.4, 0.0),
            of(PrimitiveKind::Cone, 0.4, 0.3),
            of(PrimitiveKind::Torus, 0.9, 0.25),
        ]
    }

    #[test]
    fn derivatives_are_those_of_the_distance() {
        let p = [0.9, 0.5, -0.4];
        for shape in shapes() {
            let (_, row) = shape.rows().at(shape.kind, p);
            for k in 0..MAX_PARAMETERS {
                let h = 1e-6;
                let at = |s: f64| {
                    let mut step = [0.0; MAX_PARAMETERS];
                    step[k] = s;
                    shape.moved(&step).distance(p)
                };
                let want = match k < shape.kind.parameters() {
                    true => (at(h) - at(-h)) / (2.0 * h),
                    false => 0.0,
                };
                assert!(
                    (row[k] - want).abs() < 1e-8,
                    "{shape:?} {k}: {} {want}",
                    row[k]
                );
            }
        }
    }

    #[test]
    fn normals_are_gradients_and_feet_lie_on_the_surface() {
        let p = [0.9, 0.5, -0.4];
        for shape in shapes() {
            let n = shape.normal(p);
            for k in 0..3 {
                let at = |s: f64| {
                    shape.distance(std::array::from_fn(|j| p[j] + if j == k { s } else { 0.0 }))
                };
                assert!(
                    (n[k] - (at(1e-6) - at(-1e-6)) / 2e-6).abs() < 1e-8,
                    "{shape:?}"
                );
            }
            let d = shape.distance(p);
            assert!(shape.distance(shape.foot(p)).abs() < 1e-14, "{shape:?}");
            assert!((shape.about(p).distance(p) - d).abs() < 1e-14, "{shape:?}");
        }
    }
}
