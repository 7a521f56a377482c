//! Tracing of lines of sight.

use crate::camera::{Ray, Sight, along};
use crate::color::Color;
use crate::layer::{Body, Layer, Scene};
use crate::marks::Marks;
use crate::model::Scratch;
use crate::shade::{self, flat, lit};
use crate::surface::{MIN_INCIDENCE_SINE, OnSurface, Surface};
use isoform::geom::{Point3, dot};

/// Cosine of the angle, 30°, above which neighbouring normals or facets of one part form an edge.
pub(crate) const FOLD_COSINE: f64 = 0.866;
/// Part number of caps, which belong to no part.
pub(crate) const CAP_PART: u32 = u32::MAX;

/// Visible point of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VisiblePoint {
    pub(crate) point: Point3,
    pub(crate) depth: f64,
    /// Unit normal towards the eye.
    pub(crate) normal: Point3,
    pub(crate) layer: u16,
    /// Part of the layer; [`CAP_PART`] for a cap.
    pub(crate) part: u32,
    /// Index of the colour within the part.
    pub(crate) tone: u16,
    /// Band of brightness in drawings of open surfaces; 0 on solids.
    pub(crate) band: u8,
    /// Size of a pixel there, in model units.
    pub(crate) pixel: f64,
}

impl VisiblePoint {
    /// Returns the class of the area to which it belongs in a drawing.
    pub(crate) fn class(&self) -> AreaClass {
        AreaClass {
            layer: self.layer,
            part: self.part,
            tone: self.tone,
            band: self.band,
        }
    }
}

/// Class of an area of one colour: a layer, a part of it, one of the part's colours, and a band of
/// brightness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct AreaClass {
    pub(crate) layer: u16,
    pub(crate) part: u32,
    pub(crate) tone: u16,
    pub(crate) band: u8,
}

/// Sample of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PictureSample {
    pub(crate) color: [f32; 3],
    /// Visible surface; `None` for the background and for marks.
    pub(crate) seen: Option<VisiblePoint>,
    pub(crate) is_mark: bool,
}

/// Border between two neighbouring samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Border {
    /// No border.
    None,
    /// The first is in front of the second, or the second is empty.
    Before,
    /// The second is in front of the first, or the first is empty.
    Behind,
    /// Edge of both.
    Edge,
}

impl PictureSample {
    /// Returns the border between two samples.
    pub(crate) fn border(&self, other: &Self) -> Border {
        if self.is_mark || other.is_mark {
            Border::None
        } else {
            border(self.seen.as_ref(), other.seen.as_ref())
        }
    }

    /// Returns true if a pixel between the two needs more samples.
    pub(crate) fn differs(&self, other: &Self) -> bool {
        let is_unlike = (0..3).any(|k| (self.color[k] - other.color[k]).abs() > 20.0);
        is_unlike || self.is_mark != other.is_mark || self.border(other) != Border::None
    }
}

/// Returns the border between two neighbouring visible points.
pub(crate) fn border(a: Option<&VisiblePoint>, b: Option<&VisiblePoint>) -> Border {
    let (a, b) = match (a, b) {
        (None, None) => return Border::None,
        (Some(_), None) => return Border::Before,
        (None, Some(_)) => return Border::Behind,
        (Some(a), Some(b)) => (a, b),
    };
    let step = isoform::geom::sub(b.point, a.point);
    let length = dot(step, step).sqrt();
    let off = dot(a.normal, step).abs().max(dot(b.normal, step).abs());
    // Points more than three pixels apart belong to two surfaces, one in front of the other, unless
    // the step between them lies nearly in the planes of both.
    if length > 3.0 * a.pixel.min(b.pixel) && off > 0.3 * length {
        return if a.depth < b.depth {
            Border::Before
        } else {
            Border::Behind
        };
    }
    let turn = dot(a.normal, b.normal);
    let is_one = a.layer == b.layer && a.part == b.part;
    let is_cap = (a.part == CAP_PART) != (b.part == CAP_PART);
    // 30° within a part, 10° between two parts.
    if is_cap || turn < if is_one { FOLD_COSINE } else { 0.985 } {
        Border::Edge
    } else {
        Border::None
    }
}

/// Tracer of a scene.
#[derive(Debug)]
pub(crate) struct Tracer<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) sight: &'a Sight,
    pub(crate) marks: &'a Marks,
    pub(crate) background: Color,
    /// True if there are caps.
    pub(crate) has_caps: bool,
    pub(crate) is_hatched: bool,
}

/// Nearest point so far, with its shaded colour.
struct NearestHit {
    t: f64,
    /// Distance by which other layers may be in front of it and still be hidden by it.
    lift: f64,
    seen: VisiblePoint,
    color: [f64; 3],
}

impl NearestHit {
    /// Returns the key by which two points are compared.
    fn order(&self) -> f64 {
        self.t - self.lift
    }
}

impl Tracer<'_> {
    /// Returns the sample at a point of the picture.
    pub(crate) fn sample(&self, at: [f64; 2], scratch: &mut Scratch) -> PictureSample {
        let nearest = self.nearest(at, scratch);
        let depth = nearest.as_ref().map_or(f64::INFINITY, |n| n.seen.depth);
        let single = |c: [f64; 3]| c.map(|v| v.clamp(0.0, 255.0) as f32);
        if let Some((_, color)) = self.marks.at(at).filter(|(d, _)| *d < depth) {
            return PictureSample {
                color: single(flat(color)),
                seen: None,
                is_mark: true,
            };
        }
        match nearest {
            Some(n) => PictureSample {
                color: single(n.color),
                seen: Some(n.seen),
                is_mark: false,
            },
            None => PictureSample {
                color: single(flat(self.background)),
                seen: None,
                is_mark: false,
            },
        }
    }

    /// Returns the visible surface, without marks.
    pub(crate) fn seen(&self, at: [f64; 2], scratch: &mut Scratch) -> Option<VisiblePoint> {
        self.nearest(at, scratch).map(|n| n.seen)
    }

    fn nearest(&self, at: [f64; 2], scratch: &mut Scratch) -> Option<NearestHit> {
        let ray = self.sight.ray(at);
        let (range, is_cut) = match &self.scene.section {
            Some(section) => section.clip(&ray)?,
            None => ([ray.from, f64::INFINITY], false),
        };
        let mut best: Option<NearestHit> = None;
        for (k, layer) in self.scene.layers.iter().enumerate() {
            let to = best
                .as_ref()
                .map_or(f64::INFINITY, |b| b.order() + layer.most_lift());
            let place = LayerRay {
                tracer: self,
                ray,
                range: [range[0], range[1].min(to)],
                is_cut,
                at,
                layer: k as u16,
            };
            let found = match &layer.body {
                Body::Model { .. } => place.on_model(layer, scratch),
                Body::Surface(surface) => place.on_surface(surface),
                Body::Points { .. } => None,
            };
            if let Some(found) =
                found.filter(|f| best.as_ref().is_none_or(|b| f.order() < b.order()))
            {
                best = Some(found);
            }
        }
        best
    }
}

/// Line of sight through a layer.
struct LayerRay<'a> {
    tracer: &'a Tracer<'a>,
    ray: Ray,
    range: [f64; 2],
    /// True if it begins at the plane of the section.
    is_cut: bool,
    /// Pixel coordinates.
    at: [f64; 2],
    layer: u16,
}

impl LayerRay<'_> {
    fn found(&self, t: f64, normal: Point3, part: u32, color: [f64; 3]) -> NearestHit {
        let point = along(self.ray.o, self.ray.d, t);
        let depth = self.tracer.sight.depth(point);
        let normal = if dot(normal, self.ray.d) > 0.0 {
            normal.map(|v| -v)
        } else {
            normal
        };
        let seen = VisiblePoint {
            point,
            depth,
            normal,
            layer: self.layer,
            part,
            tone: 0,
            band: 0,
            pixel: self.tracer.sight.pixel(depth),
        };
        NearestHit {
            t,
            lift: 0.0,
            seen,
            color,
        }
    }

    fn lit(&self, color: Color, normal: Point3) -> [f64; 3] {
        lit(color, normal, self.ray.d, self.tracer.sight)
    }

    fn band(&self, normal: Point3) -> u8 {
        shade::band(normal, self.ray.d, self.tracer.sight)
    }

    /// Returns a point of a cap: flat, with hatches if enabled.
    fn cap(&self, t: f64, normal: Point3, color: Color) -> NearestHit {
        let mut color = flat(color);
        // Distance between hatch lines and their width, in pixels, horizontally.
        let (distance, width) = (9.0, 1.0);
        let phase = (self.at[0] + self.at[1]).rem_euclid(distance);
        if self.tracer.is_hatched && phase < width {
            color = color.map(|v| 0.66 * v);
        }
        self.found(t, normal, CAP_PART, color)
    }

    fn on_model(&self, layer: &Layer, scratch: &mut Scratch) -> Option<NearestHit> {
        let Body::Model {
            model,
            colors,
            is_surface,
        } = &layer.body
        else {
            return None;
        };
        let has_caps = self.tracer.has_caps && !is_surface;
        let cap = has_caps.then_some(self.is_cut);
        let met = model.meet(&self.ray, self.range, cap, scratch)?;
        let Some(piece) = met.piece else {
            let normal = match &self.tracer.scene.section {
                Some(section) if self.is_cut && met.t == self.range[0] => section.normal(),
                _ => self.ray.d,
            };
            return Some(self.cap(met.t, normal, shade::CAP));
        };
        let normal = model.normal(piece, &self.ray, met.t);
        let own = colors.as_ref().map(|c| c[piece as usize]);
        let is_back = *is_surface && dot(normal, self.ray.d) > 0.0;
        let usual = if is_back { shade::BACK } else { shade::MODEL };
        let color = self.lit(own.unwrap_or(usual), normal);
        let mut found = self.found(met.t, normal, piece, color);
        if *is_surface {
            found.seen.tone = u16::from(is_back);
            found.seen.band = self.band(normal);
        }
        Some(found)
    }

    fn on_surface(&self, surface: &Surface) -> Option<NearestHit> {
        if self.is_cut
            && self.tracer.has_caps
            && let Some(cut) = surface.cap(&self.ray, self.range[0])
            && self.range[0] < self.range[1]
        {
            let section = self.tracer.scene.section.as_ref()?;
            let Some((on, cut)) = cut.zip(surface.cut()) else {
                return Some(self.cap(self.range[0], section.normal(), shade::CAP));
            };
            let color = cut.fill(on.part, 0);
            let mut cap = self.cap(self.range[0], section.normal(), color);
            cap.color = self.wired(cap.color, cut, &on);
            return Some(cap);
        }
        let section = self.tracer.scene.section.as_ref();
        let on = surface.meet(&self.ray, self.range, section)?;
        let color = self.lit(surface.color(&on.meeting), on.normal);
        let color = self.wired(color, surface, &on);
        let mut found = self.found(on.t, on.normal, on.part, color);
        found.lift = surface.lift / dot(on.normal, self.ray.d).abs().max(MIN_INCIDENCE_SINE);
        found.seen.tone = surface.tone(&on.meeting);
        let kind = self.tracer.scene.layers[self.layer as usize].kind;
        if ["map", "patches"].contains(&kind) {
            found.seen.band = self.band(on.normal);
        }
        Some(found)
    }

    /// Blends the edges of the triangle, one pixel wide, into a colour.
    fn wired(&self, color: [f64; 3], surface: &Surface, on: &OnSurface) -> [f64; 3] {
        if !surface.has_edges {
            return color;
        }
        let corners = surface.corners(on.meeting.triangle);
        let [Some(a), Some(b), Some(c)] = corners.map(|p| self.tracer.sight.project(p)) else {
            return color;
        };
        let area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
        let mut nearest = f64::INFINITY;
        let mut least = f64::INFINITY;
        for (share, [p, q]) in on.meeting.shares.iter().zip([[b, c], [c, a], [a, b]]) {
            let height = area / (q[0] - p[0]).hypot(q[1] - p[1]).max(1e-300);
            nearest = nearest.min(share * height);
            least = least.min(height);
        }
        let line = (1.0 - nearest).clamp(0.0, 1.0);
        // Edges fade in while the height of the triangle grows from 3 to 9 pixels.
        let size = ((least - 3.0) / (9.0 - 3.0)).clamp(0.0, 1.0);
        color.map(|v| v * (1.0 - 0.3 * line * size))
    }
}
