//! Cameras with the conventions of the viewer page: equal cameras show equal views.

use isoform::geom::{Aabb, Point3, cross, dot, norm, sub};

/// Default vertical angle of view, in degrees.
pub const FOV: f64 = 35.0;

/// Camera of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position of the eye; with parallel rays, a point of the central ray.
    pub position: Point3,
    /// Point at the centre of the picture.
    pub target: Point3,
    /// Direction that points up in the picture, not parallel to the line of sight.
    pub up: Point3,
    /// True if rays are parallel.
    pub orthographic: bool,
    /// Vertical angle of view in degrees; for perspective.
    pub fov: f64,
    /// Height of the picture in model units; for parallel rays.
    pub height: f64,
}

/// Reason for which a camera shows nothing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// A number, or a difference of two, is NaN or infinite.
    #[error("the camera's numbers are not all finite")]
    NotFinite,
    /// Position and target coincide, so the direction of sight is undefined.
    #[error("the camera is where it looks at")]
    AtTarget,
    /// The angle of view is out of range.
    #[error("an angle of view of {0} degrees: it must be above 0 and below 180")]
    Fov(f64),
}

/// Standard direction of sight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// View from the right, the front and above.
    Iso,
    /// View along +y: x to the right, z up.
    Front,
    /// View along −y.
    Back,
    /// View along −x: y to the right, z up.
    Right,
    /// View along +x.
    Left,
    /// View along −z: x to the right, y up.
    Top,
    /// View along +z.
    Bottom,
}

impl View {
    /// All views with their names.
    pub const ALL: [(&'static str, Self); 7] = [
        ("iso", Self::Iso),
        ("front", Self::Front),
        ("back", Self::Back),
        ("right", Self::Right),
        ("left", Self::Left),
        ("top", Self::Top),
        ("bottom", Self::Bottom),
    ];

    /// Returns the direction from the target to the eye. Top and bottom are tilted slightly, so
    /// that the z axis still determines the up direction.
    fn direction(self) -> Point3 {
        match self {
            Self::Iso => [1.0, -1.3, 0.9],
            Self::Front => [0.0, -1.0, 0.0],
            Self::Back => [0.0, 1.0, 0.0],
            Self::Right => [1.0, 0.0, 0.0],
            Self::Left => [-1.0, 0.0, 0.0],
            Self::Top => [0.0, -1e-3, 1.0],
            Self::Bottom => [0.0, -1e-3, -1.0],
        }
    }
}

impl Camera {
    /// Returns a camera for which a box fills a picture with the given ratio of width to height.
    ///
    /// ```
    /// use isoform::geom::Aabb;
    /// use isoform_render::{Camera, View};
    /// let cube = Aabb { lo: [-1.0; 3], hi: [1.0; 3] };
    /// let camera = Camera::fitted(&cube, View::Front, 1.0, 35.0, true);
    /// assert_eq!((camera.target, camera.height), ([0.0; 3], 2.12));
    /// ```
    pub fn fitted(bounds: &Aabb, view: View, aspect: f64, fov: f64, orthographic: bool) -> Self {
        let from = unit(view.direction());
        let target = bounds.center();
        let diagonal = bounds.diagonal();
        let size = if diagonal > 0.0 { diagonal } else { 1.0 };
        let mut camera = Self {
            position: along(target, from, size),
            target,
            up: [0.0, 0.0, 1.0],
            orthographic,
            fov,
            height: 1.0,
        };
        let [right, up, ahead] = camera.axes();
        let slope = (0.5 * fov).to_radians().tan();
        let (mut half, mut away) = (0.0_f64, 1e-3 * size);
        for i in 0..8 {
            let corner = std::array::from_fn(|k| [bounds.lo, bounds.hi][i >> k & 1][k]);
            let c = sub(corner, target);
            let reach = dot(c, up).abs().max(dot(c, right).abs() / aspect);
            half = half.max(reach);
            away = away.max(reach / slope - dot(c, ahead));
        }
        // Leaves three per cent of the height free on each side.
        let margin = 1.06;
        camera.height = if half > 0.0 {
            2.0 * margin * half
        } else {
            size
        };
        camera.position = along(target, from, margin * away);
        camera
    }

    /// Returns a camera at one point directed at another; z is up, or y if the camera looks along
    /// z.
    pub fn looking(
        position: Point3,
        target: Point3,
        fov: f64,
        orthographic: bool,
    ) -> Result<Self, CameraError> {
        let away = norm(sub(target, position));
        let mut camera = Self {
            position,
            target,
            up: [0.0, 0.0, 1.0],
            orthographic,
            fov,
            height: 2.0 * away * (0.5 * fov).to_radians().tan(),
        };
        if away > 0.0 && is_parallel(sub(target, position), camera.up) {
            camera.up = [0.0, 1.0, 0.0];
        }
        camera.check()?;
        Ok(camera)
    }

    /// Checks that the camera shows anything.
    pub fn check(&self) -> Result<(), CameraError> {
        let numbers = [self.position, self.target, self.up];
        let ahead = sub(self.target, self.position);
        if !(self.fov > 0.0 && self.fov < 180.0) {
            return Err(CameraError::Fov(self.fov));
        }
        let is_finite = numbers.as_flattened().iter().all(|v| v.is_finite());
        if !is_finite || !norm(ahead).is_finite() || !self.height.is_finite() {
            return Err(CameraError::NotFinite);
        }
        // Points that differ by rounding only give no direction, either.
        let size = norm(self.position).max(norm(self.target));
        if norm(ahead) <= 4.0 * f64::EPSILON * size || self.height <= 0.0 {
            return Err(CameraError::AtTarget);
        }
        Ok(())
    }

    /// Returns the unit vectors to the right, up and ahead.
    pub fn axes(&self) -> [Point3; 3] {
        let ahead = unit(sub(self.target, self.position));
        let up = if is_parallel(ahead, self.up) {
            if ahead[1].abs() < 0.9 {
                [0.0, 1.0, 0.0]
            } else {
                [1.0, 0.0, 0.0]
            }
        } else {
            self.up
        };
        let right = unit(cross(ahead, up));
        [right, cross(right, ahead), ahead]
    }
}

/// Returns true if two vectors are parallel or antiparallel: then one as `up` does not determine a
/// rotation about the other.
fn is_parallel(a: Point3, b: Point3) -> bool {
    norm(cross(unit(a), unit(b))) < 1e-9
}

/// Returns a vector scaled to length 1; zero stays zero. It is scaled by its largest component
/// first, as squares of 1e±200 overflow or underflow.
pub(crate) fn unit(a: Point3) -> Point3 {
    let largest = a.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return [0.0; 3];
    }
    let a = a.map(|v| v / largest);
    let size = norm(a);
    a.map(|v| v / size)
}

/// Returns o + t d.
pub(crate) fn along(o: Point3, d: Point3, t: f64) -> Point3 {
    std::array::from_fn(|k| o[k] + t * d[k])
}

/// Line of sight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// Origin; with parallel rays, any point of the ray.
    pub(crate) o: Point3,
    /// Unit direction.
    pub(crate) d: Point3,
    /// Distance along the ray at which seeing begins.
    pub(crate) from: f64,
}

/// Projection of a camera and a picture: maps pixels to lines of sight, and points to pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    pub(crate) camera: Camera,
    pub(crate) right: Point3,
    pub(crate) up: Point3,
    pub(crate) ahead: Point3,
    /// Half the height of the picture: a slope, or a length with parallel rays.
    half: f64,
    size: [f64; 2],
}

impl Sight {
    pub(crate) fn new(camera: Camera, size: [u32; 2]) -> Self {
        let [right, up, ahead] = camera.axes();
        let half = if camera.orthographic {
            0.5 * camera.height
        } else {
            (0.5 * camera.fov).to_radians().tan()
        };
        Self {
            camera,
            right,
            up,
            ahead,
            half,
            size: size.map(f64::from),
        }
    }

    /// Returns the line of sight through a point of the picture, in pixels from its upper left
    /// corner.
    pub(crate) fn ray(&self, [x, y]: [f64; 2]) -> Ray {
        let [width, height] = self.size;
        let u = (x - 0.5 * width) / (0.5 * height) * self.half;
        let v = (0.5 * height - y) / (0.5 * height) * self.half;
        let side: Point3 = std::array::from_fn(|k| u * self.right[k] + v * self.up[k]);
        let position = self.camera.position;
        if self.camera.orthographic {
            return Ray {
                o: along(position, side, 1.0),
                d: self.ahead,
                from: f64::NEG_INFINITY,
            };
        }
        Ray {
            o: position,
            d: unit(along(self.ahead, side, 1.0)),
            from: 0.0,
        }
    }

    /// Returns the distance of a point ahead of the eye.
    pub(crate) fn depth(&self, p: Point3) -> f64 {
        dot(sub(p, self.camera.position), self.ahead)
    }

    /// Returns the pixel coordinates of a point; `None` if it is behind the eye.
    pub(crate) fn project(&self, p: Point3) -> Option<[f64; 2]> {
        let r = sub(p, self.camera.position);
        let pixel = self.pixel(dot(r, self.ahead));
        (pixel > 0.0).then(|| {
            [
                0.5 * self.size[0] + dot(r, self.right) / pixel,
                0.5 * self.size[1] - dot(r, self.up) / pixel,
            ]
        })
    }

    /// Returns the size of a pixel at a depth, in model units.
    pub(crate) fn pixel(&self, depth: f64) -> f64 {
        let scale = if self.camera.orthographic { 1.0 } else { depth };
        2.0 * self.half / self.size[1] * scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_and_places_agree() {
        for orthographic in [false, true] {
            let position = [3.0, -2.5, 1.5];
            let camera = Camera::looking(position, [0.2; 3], 30.0, orthographic).expect("a camera");
            let sight = Sight::new(camera, [640, 480]);
            for at in [[0.0, 0.0], [320.0, 240.0], [600.5, 17.25]] {
                let ray = sight.ray(at);
                let there = sight.project(along(ray.o, ray.d, 2.5)).expect("ahead");
                assert!(
                    (0..2).all(|k| (there[k] - at[k]).abs() < 1e-9),
                    "{there:?} {at:?}"
                );
            }
        }
    }

    #[test]
    fn a_box_fills_the_picture() {
        for scale in [1e-6, 1.0, 1e6] {
            let far = [1e3 * scale, 0.0, -7.0 * scale];
            let bounds = Aabb {
                lo: far,
                hi: [far[0] + scale, 2.0 * scale, -5.0 * scale],
            };
            for (_, view) in View::ALL {
                let camera = Camera::fitted(&bounds, view, 1.5, FOV, false);
                let sight = Sight::new(camera, [300, 200]);
                let mut most = 0.0_f64;
                for i in 0..8 {
                    let p = std::array::from_fn(|k| [bounds.lo, bounds.hi][i >> k & 1][k]);
                    let [x, y] = sight.project(p).expect("ahead");
                    most = most
                        .max((x / 150.0 - 1.0).abs())
                        .max((y / 100.0 - 1.0).abs());
                }
                assert!((0.85..0.96).contains(&most), "{view:?} {most}");
            }
        }
    }

    #[test]
    fn senseless_cameras_are_refused() {
        let looking = |p, t| Camera::looking(p, t, FOV, false);
        assert_eq!(looking([1.0; 3], [1.0; 3]), Err(CameraError::AtTarget));
        assert_eq!(
            looking([f64::NAN, 0.0, 0.0], [1.0; 3]),
            Err(CameraError::NotFinite)
        );
        assert_eq!(
            looking([1e300; 3], [-1e300; 3]),
            Err(CameraError::NotFinite)
        );
        let wide = Camera::looking([0.0; 3], [1.0; 3], 180.0, false);
        assert_eq!(wide, Err(CameraError::Fov(180.0)));
        assert_eq!(
            looking([0.0, 0.0, 5.0], [0.0; 3]).expect("a camera").up,
            [0.0, 1.0, 0.0]
        );
    }
}
