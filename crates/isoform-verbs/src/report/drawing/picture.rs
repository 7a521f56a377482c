//! Visible parts of the model along parallel rays.
//!
//! Rays march towards the model by its own distance, through the cells of the [`Shell`] only; a
//! sign change brackets the surface, and regula falsi finds it. All rays of a view go in step, so
//! that the function is evaluated at many points at a time.

use super::subject::{DrawnModel, Shell, outward};
use isoform::geom::{Aabb, Point3, dot, inverse_direction};
use std::borrow::Borrow;

/// A direction of view: axes of the paper and the direction to the viewer, orthonormal.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// Name in the caption.
    pub(super) name: &'static str,
    /// Names of the horizontal and the vertical axis, for the caption.
    pub(super) axes: &'static str,
    /// Direction to the right on the paper.
    pub(super) right: Point3,
    /// Direction up on the paper.
    pub(super) up: Point3,
    /// Direction to the viewer.
    pub(super) toward: Point3,
    /// The cut: nothing nearer to the viewer than this is drawn.
    pub(super) cut: Option<f64>,
}

/// 1/√2, a component of the isometric axes.
const R2: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// 1/√3, a component of the isometric axes.
const R3: f64 = 0.577_350_269_189_625_8;
/// 1/√6, a component of the isometric axes.
const R6: f64 = 0.408_248_290_463_863;

impl View {
    const fn new(
        name: &'static str,
        axes: &'static str,
        right: Point3,
        up: Point3,
        toward: Point3,
    ) -> Self {
        Self {
            name,
            axes,
            right,
            up,
            toward,
            cut: None,
        }
    }
    /// From the front, along y.
    pub(super) const FRONT: Self = Self::new(
        "Front",
        "x →, z ↑",
        [1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, -1.0, 0.0],
    );
    /// From the right, against x.
    pub(super) const SIDE: Self = Self::new(
        "Right",
        "y →, z ↑",
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
    );
    /// From above, against z.
    pub(super) const TOP: Self = Self::new(
        "Top",
        "x →, y ↑",
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    );
    /// Isometric, from the right, the front and above.
    pub(super) const ABOVE: Self = Self::new(
        "Isometric",
        "from above",
        [R2, R2, 0.0],
        [-R6, R6, 2.0 * R6],
        [R3, -R3, R3],
    );
    /// Isometric, from the left, behind and below.
    pub(super) const BELOW: Self = Self::new(
        "Isometric",
        "from below, behind",
        [-R2, -R2, 0.0],
        [-R6, R6, 2.0 * R6],
        [-R3, R3, -R3],
    );
    /// A point on the paper, and its distance to the viewer's side.
    pub(super) fn project(&self, p: Point3) -> [f64; 3] {
        [dot(self.right, p), dot(self.up, p), dot(self.toward, p)]
    }
    /// The point of a place on the paper and a depth.
    fn back(&self, [u, v, w]: [f64; 3]) -> Point3 {
        std::array::from_fn(|k| u * self.right[k] + v * self.up[k] + w * self.toward[k])
    }
    /// The box on the paper, and in depth.
    pub(super) fn extent(&self, region: &Aabb) -> ([f64; 3], [f64; 3]) {
        let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in 0..8 {
            let p: Point3 = std::array::from_fn(|k| {
                if corner >> k & 1 == 0 {
                    region.lo[k]
                } else {
                    region.hi[k]
                }
            });
            for (k, c) in self.project(p).into_iter().enumerate() {
                (lo[k], hi[k]) = (lo[k].min(c), hi[k].max(c));
            }
        }
        (lo, hi)
    }
}

/// Intersection of a ray with the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    /// Coordinate toward the viewer.
    pub(super) depth: f64,
    /// Outward, in the axes of the view.
    pub(super) normal: Point3,
    /// The piece of the model, or [`CUT`].
    pub(super) part: u32,
}

/// The piece of a face that the picture's own cut makes.
pub(super) const CUT: u32 = u32::MAX;

/// Traces rays of one view.
pub(super) struct Tracer<'a> {
    pub(super) subject: &'a DrawnModel<'a>,
    pub(super) shell: &'a Shell,
    pub(super) view: View,
    /// Depth of the starts of the rays, at the cut or above the box.
    top: f64,
}

/// A ray on its way.
struct Ray {
    /// Number of the ray in its picture.
    index: usize,
    /// Start of the ray.
    from: Point3,
    /// Parameter of the place.
    t: f64,
    /// Parameter at which the ray leaves the box.
    end: f64,
    /// The last place outside.
    outside: Option<(f64, f64)>,
    /// The first place inside, with the distance there.
    inside: Option<(f64, f64)>,
}

/// Steps that a ray may take: ten times what one along the diagonal of the shell takes at its
/// slowest, a quarter of a cell at a time.
const MOST_STEPS: usize = 4000;
/// Most steps of the search for a crossing that is bracketed by a cell or less; two do where the
/// distance is smooth.
const CROSSING_STEPS: usize = 10;
/// A crossing is found at this share of a cell, far less than the pixel that lines need.
const CLOSE: f64 = 2e-4;

impl<'a> Tracer<'a> {
    pub(super) fn new(subject: &'a DrawnModel<'a>, shell: &'a Shell, view: View) -> Self {
        let (_, hi) = view.extent(&shell.region);
        Self {
            subject,
            shell,
            view,
            top: view.cut.unwrap_or(hi[2]).min(hi[2]),
        }
    }

    /// Returns the intersections of the rays at these places of the paper.
    pub(super) fn trace(&self, rays: &[[f64; 2]]) -> Vec<Option<Hit>> {
        let mut hits = vec![None; rays.len()];
        let inverse = inverse_direction(self.view.toward.map(|v| -v));
        let mut active: Vec<Ray> = rays
            .iter()
            .enumerate()
            .filter_map(|(index, [u, v])| {
                let from = self.view.back([*u, *v, self.top]);
                let [enter, end] = self.shell.region.crossing(from, inverse);
                let t = enter.max(0.0);
                (t < end).then_some(Ray {
                    index,
                    from,
                    t,
                    end,
                    outside: None,
                    inside: None,
                })
            })
            .collect();
        self.cut_faces(&mut active, &mut hits);
        let mut found = self.march(active);
        self.cross(&mut found);
        self.describe(&found, &mut hits);
        hits
    }

    /// Goes along the rays from cell to cell, and within cells by the distance, until they are
    /// inside; the rays that come inside.
    fn march(&self, mut active: Vec<Ray>) -> Vec<Ray> {
        let down = self.view.toward.map(|v| -v);
        let mut found = Vec::new();
        for _ in 0..MOST_STEPS {
            active.retain_mut(|r| match self.shell.next(r.from, down, r.t, r.end) {
                Some(t) => {
                    r.t = t;
                    true
                }
                None => false,
            });
            if active.is_empty() {
                break;
            }
            let values = self.along(&active);
            let mut rest = Vec::with_capacity(active.len());
            for (mut r, v) in active.into_iter().zip(values) {
                if v >= 0.0 {
                    r.inside = Some((r.t, v));
                    found.push(r);
                } else {
                    r.outside = Some((r.t, v));
                    let cell = self.shell.cell;
                    r.t += (0.8 * v.abs()).clamp(cell / 4.0, 2.0 * cell);
                    rest.push(r);
                }
            }
            active = rest;
        }
        found
    }

    /// The distances where the rays are.
    fn along<R: Borrow<Ray>>(&self, rays: &[R]) -> Vec<f64> {
        let down = self.view.toward.map(|v| -v);
        let at = |r: &R| -> Point3 {
            let r: &Ray = r.borrow();
            std::array::from_fn(|k| r.from[k] + r.t * down[k])
        };
        self.subject
            .distances(&rays.iter().map(at).collect::<Vec<_>>())
    }

    /// Rays that start inside meet the cut.
    fn cut_faces(&self, active: &mut Vec<Ray>, hits: &mut [Option<Hit>]) {
        let is_open = self.view.cut.is_some() || self.touches_box();
        if !is_open {
            return;
        }
        let values = self.along(active);
        let mut values = values.into_iter();
        active.retain(|r| {
            let is_inside = values.next().is_some_and(|v| v >= 0.0);
            if is_inside {
                hits[r.index] = Some(Hit {
                    depth: self.top - r.t,
                    normal: [0.0, 0.0, 1.0],
                    part: CUT,
                });
            }
            !is_inside
        });
    }

    /// Returns true if all rays enter the box through one face: those of views along an axis.
    fn touches_box(&self) -> bool {
        self.view.toward.iter().filter(|v| **v != 0.0).count() == 1
    }

    /// Regula falsi, with halved values for the end that stays (Illinois).
    fn cross(&self, rays: &mut [Ray]) {
        let enough = CLOSE * self.shell.cell;
        let mut open: Vec<&mut Ray> = rays.iter_mut().collect();
        for _ in 0..CROSSING_STEPS {
            open.retain(|r| match (r.outside, r.inside) {
                (Some((a, _)), Some((b, v))) => v > enough && b - a > enough,
                _ => false,
            });
            for r in &mut open {
                if let (Some((a, fa)), Some((b, fb))) = (r.outside, r.inside) {
                    r.t = a + (b - a) * (-fa / (fb - fa)).clamp(0.02, 0.98);
                }
            }
            let values = self.along(&open);
            for (r, v) in open.iter_mut().zip(values) {
                let at = (r.t, v);
                if let (Some(a), Some(b)) = (&mut r.outside, &mut r.inside) {
                    if v >= 0.0 {
                        *b = at;
                        a.1 *= 0.5;
                    } else {
                        *a = at;
                        b.1 *= 0.5;
                    }
                }
            }
        }
        for r in rays {
            r.t = r.inside.map_or(r.t, |b| b.0);
        }
    }

    /// The depth, the normal and the part where each ray meets the surface.
    fn describe(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let down = self.view.toward.map(|v| -v);
        let points: Vec<Point3> = rays
            .iter()
            .map(|r| std::array::from_fn(|k| r.from[k] + r.t * down[k]))
            .collect();
        let (_, rows) = self.subject.gradients(&points);
        let parts = self.subject.parts(&points);
        for ((r, g), part) in rays.iter().zip(rows).zip(parts) {
            hits[r.index] = Some(Hit {
                depth: self.top - r.t,
                normal: self.view.project(outward(g)),
                part,
            });
        }
    }
}

/// Picture of a view: the visible point at each pixel.
pub(super) struct Picture {
    pub(super) view: View,
    /// Pixels in a row.
    pub(super) width: usize,
    /// Rows.
    pub(super) height: usize,
    /// Side of a pixel.
    pub(super) pixel: f64,
    /// The middle of the first pixel, above on the left.
    pub(super) first: [f64; 2],
    /// Intersection of each pixel's ray, row by row from above.
    pub(super) hits: Vec<Option<Hit>>,
}

/// Pixels of air about the model.
const AIR: f64 = 2.0;

impl Picture {
    pub(super) fn new(tracer: &Tracer<'_>, pixel: f64) -> Self {
        let (lo, hi) = tracer.view.extent(&tracer.shell.region);
        let width = ((hi[0] - lo[0]) / pixel + 2.0 * AIR).ceil() as usize;
        let height = ((hi[1] - lo[1]) / pixel + 2.0 * AIR).ceil() as usize;
        let mut picture = Self {
            view: tracer.view,
            width,
            height,
            pixel,
            first: [
                0.5 * (lo[0] + hi[0]) - 0.5 * pixel * (width - 1) as f64,
                0.5 * (lo[1] + hi[1]) + 0.5 * pixel * (height - 1) as f64,
            ],
            hits: Vec::new(),
        };
        let rays: Vec<[f64; 2]> = (0..width * height)
            .map(|i| picture.place(i % width, i / width))
            .collect();
        picture.hits = tracer.trace(&rays);
        picture
    }

    /// Returns the position of a pixel on the paper.
    pub(super) fn place(&self, column: usize, row: usize) -> [f64; 2] {
        [
            self.first[0] + self.pixel * column as f64,
            self.first[1] - self.pixel * row as f64,
        ]
    }

    /// Returns the visible point at a place of the paper.
    pub(super) fn seen(&self, [u, v]: [f64; 2]) -> Option<Hit> {
        let column = ((u - self.first[0]) / self.pixel).round();
        let row = ((self.first[1] - v) / self.pixel).round();
        let is_within =
            (0.0..self.width as f64).contains(&column) && (0.0..self.height as f64).contains(&row);
        is_within
            .then(|| self.hits[row as usize * self.width + column as usize])
            .flatten()
    }

    /// Returns true if a point of the model is not hidden by another part of it; the ray starts
    /// slightly above the surface.
    pub(super) fn shows(&self, at: Point3, normal: Point3) -> bool {
        let off: Point3 = std::array::from_fn(|k| at[k] + 1.5 * self.pixel * normal[k]);
        let [u, v, w] = self.view.project(off);
        self.view.cut.is_none_or(|cut| w <= cut + 1.6 * self.pixel)
            && self
                .seen([u, v])
                .is_none_or(|hit| hit.depth <= w + 0.5 * self.pixel)
    }

    /// Returns the box of all intersections on the paper; `None` if there are none.
    pub(super) fn bounds(&self) -> Option<[f64; 4]> {
        let mut b = [
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        for (i, hit) in self.hits.iter().enumerate() {
            if hit.is_some() {
                let [u, v] = self.place(i % self.width, i / self.width);
                b = [b[0].min(u), b[1].max(u), b[2].min(v), b[3].max(v)];
            }
        }
        (b[0] <= b[1]).then_some(b)
    }
}
