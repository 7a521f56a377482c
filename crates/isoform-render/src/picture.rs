//! Pictures: samples of the scene, more of them where something changes, and thin dark lines at
//! edges and outlines.
//!
//! Each pixel has one sample at its centre. If that differs from a neighbour's (by surface,
//! direction or colour), the pixel gets a grid of 4 × 4 samples. The pattern is fixed and each
//! pixel is computed on its own, so that pictures do not depend on the number of threads, and
//! pixels within one flat colour have exactly that colour.

use crate::camera::{Camera, Sight};
use crate::color::Color;
use crate::layer::Scene;
use crate::marks::Marks;
use crate::model::Scratch;
use crate::shade;
use crate::trace::{Border, PictureSample, Tracer};
use isoform::{Control, Stopped};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of samples along each side of a pixel where something changes.
const SAMPLES_PER_SIDE: usize = 4;
/// Width of the frame around a band, in pixels, whose samples its lines need.
const APRON_WIDTH: usize = 2;
/// Width of outlines, in pixels, on the surface in front.
const OUTLINE_WIDTH: f64 = 0.9;

/// Style of pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Style {
    /// Colour of the background.
    pub background: Color,
    /// True if edges and outlines are drawn.
    pub lines: bool,
    /// True if cuts by a section or a box are closed by caps; otherwise they are open.
    pub caps: bool,
    /// True if caps are hatched.
    pub hatch: bool,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            background: [255; 3],
            lines: true,
            caps: true,
            hatch: false,
        }
    }
}

/// Picture, as rows of pixels from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Colours, width times height of them.
    pub pixels: Vec<Color>,
}

impl Picture {
    /// Returns a picture of one colour.
    pub fn blank(size: [u32; 2], color: Color) -> Self {
        let count = size[0] as usize * size[1] as usize;
        Self {
            size,
            pixels: vec![color; count],
        }
    }

    /// Returns the colour of a pixel.
    ///
    /// # Panics
    ///
    /// If the pixel is outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> Color {
        self.pixels[y as usize * self.size[0] as usize + x as usize]
    }

    /// Copies another picture into this one; parts outside are clipped.
    pub fn put(&mut self, other: &Self, [x, y]: [u32; 2]) {
        let width = (self.size[0].saturating_sub(x)).min(other.size[0]) as usize;
        for row in 0..other.size[1].min(self.size[1].saturating_sub(y)) as usize {
            let to = (y as usize + row) * self.size[0] as usize + x as usize;
            let from = row * other.size[0] as usize;
            self.pixels[to..to + width].copy_from_slice(&other.pixels[from..from + width]);
        }
    }

    /// Blends a colour into a pixel by a fraction; pixels outside the picture are ignored.
    pub(crate) fn mix(&mut self, [x, y]: [i64; 2], color: Color, share: f64) {
        let [width, height] = self.size.map(i64::from);
        if (0..width).contains(&x) && (0..height).contains(&y) {
            let pixel = &mut self.pixels[(y * width + x) as usize];
            *pixel = std::array::from_fn(|k| {
                let (a, b) = (f64::from(pixel[k]), f64::from(color[k]));
                (a + share * (b - a)).round() as u8
            });
        }
    }
}

/// Renders a scene.
///
/// # Errors
/// [`Stopped`].
pub fn render(
    scene: &Scene,
    camera: &Camera,
    size: [u32; 2],
    style: &Style,
    control: &Control<'_>,
) -> Result<Picture, Stopped> {
    control.begin("drawing")?;
    let sight = Sight::new(*camera, size);
    let marks = Marks::new(scene, &sight, size);
    let tracer = Tracer {
        scene,
        sight: &sight,
        marks: &marks,
        background: style.background,
        has_caps: style.caps,
        is_hatched: style.hatch,
    };
    let [width, height] = size.map(|v| v as usize);
    let rows = (40_000 / width.max(1)).clamp(1, 32);
    let done = AtomicUsize::new(0);
    let bands: Vec<Vec<Color>> = (0..height)
        .step_by(rows)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|top| {
            control.check()?;
            let band = Band::new(&tracer, width, [top, (top + rows).min(height)], control)?;
            let colors = band.colors(style);
            let count = done.fetch_add(rows, Ordering::Relaxed) + rows;
            control.report("drawing", (count as f64 / height as f64).min(1.0));
            Ok(colors)
        })
        .collect::<Result<_, Stopped>>()?;
    Ok(Picture {
        size,
        pixels: bands.concat(),
    })
}

/// Several rows of a picture with the pixels around them.
struct Band {
    /// Width including the apron, in pixels.
    width: usize,
    /// Height including the apron, in pixels.
    height: usize,
    /// Sample at the centre of each pixel.
    coarse: Vec<PictureSample>,
    /// Start of the samples of a pixel in `fine`, plus 1; 0 if it has a single sample.
    index: Vec<u32>,
    fine: Vec<PictureSample>,
}

impl Band {
    fn new(
        tracer: &Tracer<'_>,
        width: usize,
        [top, bottom]: [usize; 2],
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let (width, height) = (width + 2 * APRON_WIDTH, bottom - top + 2 * APRON_WIDTH);
        let place = |pixel: usize| {
            let (x, y) = (pixel % width, pixel / width + top);
            [x as f64 - APRON_WIDTH as f64, y as f64 - APRON_WIDTH as f64]
        };
        let mut scratch = Scratch::default();
        let mut sample = |[x, y]: [f64; 2]| tracer.sample([x, y], &mut scratch);
        let middle = |[x, y]: [f64; 2]| [x + 0.5, y + 0.5];
        let mut coarse = Vec::with_capacity(width * height);
        for row in 0..height {
            control.check()?;
            let pixels = row * width..(row + 1) * width;
            coarse.extend(pixels.map(|k| sample(middle(place(k)))));
        }
        let mut band = Self {
            width,
            height,
            coarse,
            index: Vec::new(),
            fine: Vec::new(),
        };
        band.index = vec![0; width * height];
        let own = |k: usize| (k as f64 + 0.5) / SAMPLES_PER_SIDE as f64;
        for pixel in 0..width * height {
            if pixel % width == 0 {
                control.check()?;
            }
            if !band.is_mixed(pixel) {
                continue;
            }
            band.index[pixel] = band.fine.len() as u32 + 1;
            let [x, y] = place(pixel);
            for k in 0..SAMPLES_PER_SIDE * SAMPLES_PER_SIDE {
                band.fine.push(sample([
                    x + own(k % SAMPLES_PER_SIDE),
                    y + own(k / SAMPLES_PER_SIDE),
                ]));
            }
        }
        Ok(band)
    }

    /// Returns true if a pixel differs from one of its neighbours; pixels at the end of the apron
    /// do not count.
    fn is_mixed(&self, pixel: usize) -> bool {
        let (x, y) = (pixel % self.width, pixel / self.width);
        if x == 0 || y == 0 || x + 1 == self.width || y + 1 == self.height {
            return false;
        }
        let around = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| (x, y)));
        let own = &self.coarse[pixel];
        around
            .map(|(x, y)| y * self.width + x)
            .any(|k| k != pixel && own.differs(&self.coarse[k]))
    }

    /// Returns the sample at a point of the fine grid.
    fn at(&self, x: usize, y: usize) -> &PictureSample {
        let pixel = y / SAMPLES_PER_SIDE * self.width + x / SAMPLES_PER_SIDE;
        match self.index[pixel] {
            0 => &self.coarse[pixel],
            first => {
                &self.fine[first as usize - 1
                    + y % SAMPLES_PER_SIDE * SAMPLES_PER_SIDE
                    + x % SAMPLES_PER_SIDE]
            }
        }
    }

    /// Returns the colours of the rows without the apron.
    fn colors(&self, style: &Style) -> Vec<Color> {
        let reach = reach();
        let mut colors = Vec::new();
        for y in APRON_WIDTH..self.height - APRON_WIDTH {
            for x in APRON_WIDTH..self.width - APRON_WIDTH {
                let pixel = y * self.width + x;
                let color = if self.index[pixel] == 0 {
                    self.coarse[pixel].color
                } else {
                    self.mean([x, y], style.lines.then_some(&reach))
                };
                colors.push(color.map(|v| v.round() as u8));
            }
        }
        colors
    }

    /// Returns the mean of a pixel's samples, with the lines on them.
    fn mean(&self, [x, y]: [usize; 2], reach: Option<&Vec<([i32; 2], bool)>>) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for k in 0..SAMPLES_PER_SIDE * SAMPLES_PER_SIDE {
            let place = [
                x * SAMPLES_PER_SIDE + k % SAMPLES_PER_SIDE,
                y * SAMPLES_PER_SIDE + k / SAMPLES_PER_SIDE,
            ];
            let sample = self.at(place[0], place[1]);
            let share = reach.map_or(0.0, |reach| self.line(place, sample, reach));
            for (sum, (own, line)) in sum.iter_mut().zip(sample.color.iter().zip(shade::LINE)) {
                *sum += own + share * (f32::from(line) - own);
            }
        }
        sum.map(|v| v / (SAMPLES_PER_SIDE * SAMPLES_PER_SIDE) as f32)
    }

    /// Returns the opacity of a line at a sample.
    fn line(&self, [x, y]: [usize; 2], own: &PictureSample, reach: &[([i32; 2], bool)]) -> f32 {
        if own.seen.is_none() {
            return 0.0;
        }
        for ([dx, dy], is_near) in reach {
            let (x, y) = (x as i32 + dx, y as i32 + dy);
            match own.border(self.at(x as usize, y as usize)) {
                Border::Before => return 0.85,
                Border::Edge if *is_near => return 0.7,
                _ => {}
            }
        }
        0.0
    }
}

/// Returns the offsets on the fine grid from which a line may reach a point, nearest first, each
/// with true if an edge reaches as far, too.
fn reach() -> Vec<([i32; 2], bool)> {
    let most = (OUTLINE_WIDTH * SAMPLES_PER_SIDE as f64).floor() as i32;
    let away = |[x, y]: [i32; 2]| f64::from(x * x + y * y).sqrt() / SAMPLES_PER_SIDE as f64;
    let all = (-most..=most).flat_map(|y| (-most..=most).map(move |x| [x, y]));
    let mut places: Vec<[i32; 2]> = all
        .filter(|p| *p != [0, 0] && away(*p) <= OUTLINE_WIDTH)
        .collect();
    places.sort_by(|a, b| away(*a).total_cmp(&away(*b)).then(a.cmp(b)));
    // Half the width of edges, which are drawn on both surfaces, in pixels.
    let edge = 0.55;
    places.into_iter().map(|p| (p, away(p) <= edge)).collect()
}
