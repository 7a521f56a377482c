//! Marks, whose size is given in pixels: points as discs, curves as lines. They are sorted by the
//! pixels that they may cover.

use crate::camera::Sight;
use crate::color::Color;
use crate::layer::{Body, Layer, Scene};
use isoform::geom::Point3;

/// Distance by which marks are moved towards the eye so that those on a surface are visible: a
/// fraction of their depth, or of the scene's diagonal with parallel rays.
const MARK_LIFT_SHARE: f64 = 0.002;

/// Disc, or line between two points of the picture.
#[derive(Clone, Copy, Debug)]
struct Mark {
    ends: [[f64; 2]; 2],
    depths: [f64; 2],
    radius: f64,
    color: Color,
}

/// All marks of a picture.
#[derive(Debug, Default)]
pub(crate) struct Marks {
    marks: Vec<Mark>,
    /// Start of each pixel's list in `lists`, with the total length at the end.
    starts: Vec<u32>,
    lists: Vec<u32>,
    size: [usize; 2],
}

/// Returns the radius of points, in pixels: the fewer, the larger.
fn radius(count: usize) -> f64 {
    match count {
        300_001.. => 1.0,
        30_001.. => 1.5,
        61.. => 2.0,
        _ => 4.0,
    }
}

impl Marks {
    /// Collects the marks of a scene as seen by a camera.
    pub(crate) fn new(scene: &Scene, sight: &Sight, size: [u32; 2]) -> Self {
        let nearer = MARK_LIFT_SHARE * scene.bounds().diagonal();
        let mut marks = Vec::new();
        for layer in &scene.layers {
            of_layer(layer, scene, sight, nearer, &mut marks);
        }
        let size = size.map(|v| v as usize);
        let mut all = Self {
            marks,
            size,
            ..Self::default()
        };
        all.sort();
        all
    }

    /// Returns the range of pixels that a mark may cover; `None` if it is outside the picture.
    fn reach(&self, mark: &Mark) -> Option<[[usize; 2]; 2]> {
        let mut ends = [[0; 2]; 2];
        for k in 0..2 {
            let (a, b) = (mark.ends[0][k], mark.ends[1][k]);
            let (lo, hi) = (a.min(b) - mark.radius, a.max(b) + mark.radius);
            if !(hi >= 0.0 && lo < self.size[k] as f64) {
                return None;
            }
            ends[0][k] = lo.max(0.0) as usize;
            ends[1][k] = (hi as usize).min(self.size[k] - 1);
        }
        Some(ends)
    }

    /// Builds the lists: counts, then fills.
    fn sort(&mut self) {
        let mut count = vec![0_u32; self.size[0] * self.size[1] + 1];
        let pixels = |all: &Self, mark: &Mark| -> Vec<usize> {
            let Some([lo, hi]) = all.reach(mark) else {
                return Vec::new();
            };
            let row = |y: usize| (lo[0]..=hi[0]).map(move |x| (x, y));
            let near = (lo[1]..=hi[1]).flat_map(row);
            let is_near = |(x, y): &(usize, usize)| {
                let middle = [*x as f64 + 0.5, *y as f64 + 0.5];
                mark.place(middle).1 <= mark.radius + 0.75
            };
            near.filter(is_near)
                .map(|(x, y)| y * all.size[0] + x)
                .collect()
        };
        for mark in &self.marks {
            for pixel in pixels(self, mark) {
                count[pixel + 1] += 1;
            }
        }
        for k in 1..count.len() {
            count[k] += count[k - 1];
        }
        let mut next = count.clone();
        let mut lists = vec![0; count.last().copied().unwrap_or(0) as usize];
        for (i, mark) in self.marks.iter().enumerate() {
            for pixel in pixels(self, mark) {
                lists[next[pixel] as usize] = i as u32;
                next[pixel] += 1;
            }
        }
        (self.starts, self.lists) = (count, lists);
    }

    /// Returns depth and colour of the nearest mark at a point of the picture; `None` if there is
    /// no mark.
    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> Option<(f64, Color)> {
        if self.marks.is_empty() || x < 0.0 || y < 0.0 {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        if column >= self.size[0] || row >= self.size[1] {
            return None;
        }
        let pixel = row * self.size[0] + column;
        let list = &self.lists[self.starts[pixel] as usize..self.starts[pixel + 1] as usize];
        let mut best: Option<(f64, Color)> = None;
        for i in list {
            let mark = &self.marks[*i as usize];
            let (share, away) = mark.place([x, y]);
            let depth = mark.depths[0] + share * (mark.depths[1] - mark.depths[0]);
            if away <= mark.radius && best.is_none_or(|(d, _)| depth < d) {
                best = Some((depth, mark.color));
            }
        }
        best
    }
}

impl Mark {
    /// Returns the nearest point of the line, as a fraction of the line, and its distance.
    fn place(&self, [x, y]: [f64; 2]) -> (f64, f64) {
        let [a, b] = self.ends;
        let (d, e) = ([b[0] - a[0], b[1] - a[1]], [x - a[0], y - a[1]]);
        let length = d[0] * d[0] + d[1] * d[1];
        let share = if length > 0.0 {
            ((d[0] * e[0] + d[1] * e[1]) / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (share, (e[0] - share * d[0]).hypot(e[1] - share * d[1]))
    }
}

/// Adds the marks of a layer.
fn of_layer(layer: &Layer, scene: &Scene, sight: &Sight, nearer: f64, marks: &mut Vec<Mark>) {
    let seen = |p: Point3, lift: f64| -> Option<([f64; 2], f64)> {
        let is_left = scene.section.is_none_or(|s| s.keeps(p));
        let at = sight.project(p).filter(|_| is_left)?;
        let depth = sight.depth(p);
        let own = if sight.camera.orthographic {
            nearer
        } else {
            depth * MARK_LIFT_SHARE
        };
        let is_near = at.iter().all(|v| v.abs() < 1e9);
        is_near.then_some((at, depth - own.max(lift)))
    };
    if let Body::Points {
        points,
        colors,
        lift,
    } = &layer.body
    {
        let radius = radius(points.len());
        for (i, p) in points.iter().enumerate() {
            if let Some((at, depth)) = seen(*p, *lift) {
                let color = colors[i.min(colors.len() - 1)];
                marks.push(Mark {
                    ends: [at; 2],
                    depths: [depth; 2],
                    radius,
                    color,
                });
            }
        }
    }
    for curve in &layer.curves {
        for pair in curve.points.windows(2) {
            if let (Some(a), Some(b)) = (seen(pair[0], 0.0), seen(pair[1], 0.0)) {
                marks.push(Mark {
                    ends: [a.0, b.0],
                    depths: [a.1, b.1],
                    radius: 0.6,
                    color: curve.color,
                });
            }
        }
    }
}
