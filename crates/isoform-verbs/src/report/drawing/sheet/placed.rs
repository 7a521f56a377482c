//! A view at its place on the paper: shades, lines and hatching.

use super::super::Drawn;
use super::super::outline::LineKind;
use super::super::picture::{CUT, Hit, Picture};
use isoform::geom::{Point3, dot};
use isoform_render::write_indexed_png;
use std::fmt::Write;

/// Tones of the shading.
const TONES: usize = 40;

/// The tones of faces: the lightest, and by how much the darkest is darker in red, green and blue.
#[derive(Clone, Copy)]
pub(super) struct Paint {
    /// Grey of the lightest tone, from 0 to 255.
    light: f64,
    /// Difference between the brightest and the darkest tone in red, green and blue.
    range: [f64; 3],
}

/// The paint of faces on the sheet with dimensions.
pub(super) const PAPER: Paint = Paint {
    light: 250.0,
    range: [160.0, 138.0, 112.0],
};
/// Behind points: both ends of the colours and their white middle stand out from it.
pub(super) const GREY: Paint = Paint {
    light: 168.0,
    range: [52.0, 48.0, 42.0],
};

impl Paint {
    /// The colours of all tones; the first is the paper's.
    fn palette(self) -> Vec<[u8; 3]> {
        (0..TONES)
            .map(|k| match k {
                0 => [255; 3],
                _ => {
                    let dark = k as f64 / (TONES - 1) as f64;
                    self.range.map(|d| (self.light - d * dark) as u8)
                }
            })
            .collect()
    }
}

/// The tone of a pixel under light from the upper left.
fn tone(hit: Option<&Hit>) -> u8 {
    let light = [-0.42, 0.56, 0.71];
    match hit {
        Some(h) if h.part != CUT => {
            let bright = 0.35 + 0.65 * dot(h.normal, light).max(0.0);
            1 + ((1.0 - bright.min(1.0)) * (TONES - 2) as f64).round() as u8
        }
        _ => 0,
    }
}

/// A view at its place on the paper.
pub(super) struct PlacedView<'a> {
    pub(super) drawn: &'a Drawn,
    /// Paper units per unit of the model.
    pub(super) scale: f64,
    /// Position of the view's own origin (u, v) = 0 on the paper.
    pub(super) origin: [f64; 2],
}

impl PlacedView<'_> {
    /// The view's own picture.
    pub(super) fn picture(&self) -> &Picture {
        &self.drawn.picture
    }
    /// A place of the view on the paper; y grows downwards there.
    pub(super) fn flat(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [
            self.origin[0] + self.scale * u,
            self.origin[1] - self.scale * v,
        ]
    }
    /// A point of the model on the paper.
    pub(super) fn at(&self, p: Point3) -> [f64; 2] {
        let [u, v, _] = self.picture().view.project(p);
        self.flat([u, v])
    }
    /// Left, right, top and bottom on the paper.
    pub(super) fn bounds(&self) -> [f64; 4] {
        let [a, b, c, d] = self.picture().bounds().unwrap_or_default();
        let (lo, hi) = (self.flat([a, d]), self.flat([b, c]));
        [lo[0], hi[0], lo[1], hi[1]]
    }

    /// Hatching and lines.
    pub(super) fn lines(&self) -> String {
        let mut svg = self.hatching();
        for (kind, class) in [
            (LineKind::Border, "border"),
            (LineKind::Edge, "edge"),
            (LineKind::Outline, "outline"),
        ] {
            let mut path = String::new();
            for line in self.drawn.lines.iter().filter(|l| l.kind == kind) {
                for (i, p) in line.points.iter().enumerate() {
                    let [x, y] = self.flat(*p);
                    let _ = write!(path, "{}{x:.2} {y:.2}", if i == 0 { "M" } else { "L" });
                }
            }
            if !path.is_empty() {
                let _ = write!(svg, "<path class=\"{class}\" d=\"{path}\"/>");
            }
        }
        svg
    }

    /// Light from the upper left, as a small picture.
    pub(super) fn shades(&self, paint: Paint) -> String {
        let picture = self.picture();
        let pixels: Vec<u8> = picture.hits.iter().map(|hit| tone(hit.as_ref())).collect();
        let size = [picture.width as u32, picture.height as u32];
        let bytes = write_indexed_png(size, &pixels, &paint.palette()).unwrap_or_default();
        let side = self.scale * picture.pixel;
        let corner = self.flat(picture.first);
        format!(
            "<image x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
            corner[0] - 0.5 * side,
            corner[1] - 0.5 * side,
            side * picture.width as f64,
            side * picture.height as f64,
            isoform_view::base64(&bytes)
        )
    }

    /// Lines at 45° on the faces of the cut.
    fn hatching(&self) -> String {
        let picture = self.picture();
        let (w, h) = (picture.width as f64, picture.height as f64);
        // Seven paper units between lines, whatever the scale.
        let pause = (7.0 / (self.scale * picture.pixel)).max(2.0);
        let mut path = String::new();
        let mut offset = -h;
        while offset < w {
            self.hatch(&mut path, offset);
            offset += pause;
        }
        if path.is_empty() {
            return path;
        }
        format!("<path class=\"hatch\" d=\"{path}\"/>")
    }

    /// One line of the hatching, whose lower end lies `offset` pixels to the right of the corner.
    fn hatch(&self, path: &mut String, offset: f64) {
        let picture = self.picture();
        let pixel = picture.pixel;
        let h = picture.height as f64;
        let place = |t: f64| {
            [
                picture.first[0] + pixel * (offset + t),
                picture.first[1] - pixel * (h - t),
            ]
        };
        let (mut t, mut from) = (0.0, None);
        while t <= h + 1.0 {
            let is_cut = picture.seen(place(t)).is_some_and(|h| h.part == CUT);
            match (is_cut, from) {
                (true, None) => from = Some(t),
                (false, Some(start)) => {
                    let (a, b) = (self.flat(place(start)), self.flat(place(t - 0.25)));
                    let _ = write!(path, "M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1]);
                    from = None;
                }
                _ => {}
            }
            t += 0.25;
        }
    }

    /// The name of the view and its axes, as a text at a place.
    pub(super) fn caption(&self, x: f64, y: f64) -> String {
        let view = &self.picture().view;
        format!(
            "<text class=\"view\" x=\"{x:.1}\" y=\"{y:.1}\">{} <tspan class=\"soft\">{}</tspan></text>",
            view.name, view.axes
        )
    }
}
