//! The views on paper: shades, lines, hatching, dimensions and points.

use super::dimensions::Form;
use super::outline::Kind;
use super::picture::{CUT, Picture};
use super::subject::Sample;
use super::{Drawing, Drawn, png};
use crate::fit::table;
use crate::report::svg::escaped;
use isoform::geom::{Point3, dot};
use isoform::io::deviation_colors;
use std::fmt::Write;

/// Longest side of a view on paper.
const SIZE: f64 = 250.0;
/// Distance of a dimension line from the view and from the next one: below, and on the left, where
/// names stand over values.
const LANES: [f64; 2] = [27.0, 38.0];
/// Height of a label of two lines.
const LABEL: f64 = 32.0;
/// Space between a view and its labels.
const GAP: f64 = 26.0;
/// Least width of a sheet.
const NARROWEST: f64 = 860.0;
/// Space about a panel.
const AIR: f64 = 16.0;
/// Width of a letter of the labels, on average and a little more.
const LETTER: f64 = 6.7;
/// Tones of the shading.
const TONES: usize = 40;

/// The lightest tone of a face, and by how much the darkest is darker in red, green and blue.
#[derive(Clone, Copy)]
struct Paint {
    light: f64,
    range: [f64; 3],
}

const PAPER: Paint = Paint {
    light: 250.0,
    range: [160.0, 138.0, 112.0],
};
/// Behind points: both ends of the colours and their white middle stand out from it.
const GREY: Paint = Paint {
    light: 168.0,
    range: [52.0, 48.0, 42.0],
};

/// A view at its place on the paper.
struct Placed<'a> {
    drawn: &'a Drawn,
    /// Paper units per unit of the model.
    scale: f64,
    /// Where the view's own origin (u, v) = 0 comes to lie.
    origin: [f64; 2],
}

impl Placed<'_> {
    fn picture(&self) -> &Picture {
        &self.drawn.picture
    }
    fn flat(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [
            self.origin[0] + self.scale * u,
            self.origin[1] - self.scale * v,
        ]
    }
    fn at(&self, p: Point3) -> [f64; 2] {
        let [u, v, _] = self.picture().view.of(p);
        self.flat([u, v])
    }
    /// Left, right, top and bottom on the paper.
    fn bounds(&self) -> [f64; 4] {
        let [a, b, c, d] = self.picture().bounds().unwrap_or_default();
        let (lo, hi) = (self.flat([a, d]), self.flat([b, c]));
        [lo[0], hi[0], lo[1], hi[1]]
    }

    /// Hatching and lines.
    fn lines(&self) -> String {
        let mut svg = self.hatching();
        for (kind, class) in [
            (Kind::Border, "border"),
            (Kind::Edge, "edge"),
            (Kind::Outline, "outline"),
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
    fn shades(&self, paint: Paint) -> String {
        let picture = self.picture();
        let light = [-0.42, 0.56, 0.71];
        let tone = |hit: &Option<super::picture::Hit>| match hit {
            Some(h) if h.part != CUT => {
                let bright = 0.35 + 0.65 * dot(h.normal, light).max(0.0);
                1 + ((1.0 - bright.min(1.0)) * (TONES - 2) as f64).round() as u8
            }
            _ => 0,
        };
        let pixels: Vec<u8> = picture.hits.iter().map(tone).collect();
        let palette: Vec<[u8; 3]> = (0..TONES)
            .map(|k| match k {
                0 => [255; 3],
                _ => {
                    let dark = k as f64 / (TONES - 1) as f64;
                    paint.range.map(|d| (paint.light - d * dark) as u8)
                }
            })
            .collect();
        let bytes = png::encode(picture.width, &pixels, &palette);
        let side = self.scale * picture.pixel;
        let corner = self.flat(picture.first);
        format!(
            "<image x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
            corner[0] - 0.5 * side,
            corner[1] - 0.5 * side,
            side * picture.width as f64,
            side * picture.height as f64,
            png::base64(&bytes)
        )
    }

    /// Lines at 45° on the faces of the cut.
    fn hatching(&self) -> String {
        let picture = self.picture();
        let is_cut = |u: f64, v: f64| picture.seen([u, v]).is_some_and(|h| h.part == CUT);
        let pixel = picture.pixel;
        let (w, h) = (picture.width as f64, picture.height as f64);
        // Seven paper units between lines, whatever the scale.
        let pause = (7.0 / (self.scale * pixel)).max(2.0);
        let mut path = String::new();
        let mut offset = -h;
        while offset < w {
            let place = |t: f64| {
                [
                    picture.first[0] + pixel * (offset + t),
                    picture.first[1] - pixel * (h - t),
                ]
            };
            let (mut t, mut from) = (0.0, None);
            while t <= h + 1.0 {
                let [u, v] = place(t);
                match (is_cut(u, v), from) {
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
            offset += pause;
        }
        if path.is_empty() {
            return path;
        }
        format!("<path class=\"hatch\" d=\"{path}\"/>")
    }

    fn caption(&self, x: f64, y: f64) -> String {
        let view = &self.picture().view;
        format!(
            "<text class=\"view\" x=\"{x:.1}\" y=\"{y:.1}\">{} <tspan class=\"soft\">{}</tspan></text>",
            view.name, view.axes
        )
    }
}

/// A dimension that a view will show.
enum Shown {
    /// Along the bottom, or (true) up the left side; from, to: coordinates along; where the two
    /// extension lines begin, across.
    Lane {
        is_upright: bool,
        ends: [f64; 2],
        begin: [f64; 2],
    },
    /// An arrow from one place to another with a label beside the view.
    Leader {
        from: Option<[f64; 2]>,
        to: [f64; 2],
        has_center: bool,
    },
}

struct Label {
    name: String,
    value: String,
}

impl Label {
    /// Width on paper, the name over the value.
    fn width(&self) -> f64 {
        LETTER * self.name.chars().count().max(self.value.chars().count()) as f64
    }
}

/// A dimension as one view could show it, and how well.
struct Offer {
    merit: f64,
    shown: Shown,
}

/// Fewest samples of a moving face that must be seen in a view.
const FEWEST_SEEN: usize = 2;

/// What a view can make of a form; angles are taken so that leaders do not cross.
fn offer(view: &Placed<'_>, form: &Form, samples: &[Sample], turn: usize) -> Option<Offer> {
    match form {
        Form::Linear {
            along,
            from,
            to,
            near,
            far,
        } => linear_offer(view, *along, [*from, *to], [near, far], samples),
        Form::Round {
            center,
            axis,
            rim,
            is_diameter,
            radius,
            ..
        } => round_offer(view, (*center, *axis, *radius), rim, *is_diameter, turn),
        Form::Offset { length, places } => offset_offer(view, *length, places),
        Form::Place(places) => place_offer(view, places),
        Form::Nothing => None,
    }
}

fn seen<'s>(view: &Placed<'_>, samples: &'s [Sample]) -> Vec<&'s Sample> {
    let picture = view.picture();
    samples
        .iter()
        .filter(|s| picture.shows(s.at, s.normal))
        .collect()
}

fn linear_offer(
    view: &Placed<'_>,
    along: Point3,
    [from, to]: [f64; 2],
    [near, far]: [&[Sample]; 2],
    samples: &[Sample],
) -> Option<Offer> {
    let [eu, ev, ew] = view.picture().view.of(along);
    let ends = seen(view, far);
    if ew.abs() > 0.05 || ends.len() < FEWEST_SEEN {
        return None;
    }
    let share = ends.len() as f64 / far.len() as f64;
    let is_upright = ev.abs() > 0.999;
    if !is_upright && eu.abs() < 0.999 {
        let tip = ends[ends.len() / 2].at;
        let foot: Point3 = std::array::from_fn(|k| tip[k] - (to - from) * along[k]);
        return Some(Offer {
            merit: 0.6 * share,
            shown: Shown::Leader {
                from: Some(view.at(foot)),
                to: view.at(tip),
                has_center: false,
            },
        });
    }
    // Upright dimensions stand on the left, others below: begin at the sample that is nearest.
    let across = |s: &Sample| {
        let [x, y] = view.at(s.at);
        if is_upright { x } else { -y }
    };
    let first = |s: &[&Sample]| s.iter().map(|s| across(s)).min_by(f64::total_cmp);
    let at_foot: Vec<&Sample> = if near.is_empty() {
        let slack = 0.01 * (to - from);
        let flat = samples
            .iter()
            .filter(|s| (dot(s.at, along) - from).abs() < slack);
        flat.collect()
    } else {
        near.iter().collect()
    };
    let tip = first(&ends)?;
    let foot = first(&at_foot).unwrap_or(tip);
    let coordinate = |t: f64| {
        let p = view.flat([eu * t, ev * t]);
        if is_upright { p[1] } else { p[0] }
    };
    Some(Offer {
        merit: 1.0 + 0.5 * share,
        shown: Shown::Lane {
            is_upright,
            ends: [coordinate(from), coordinate(to)],
            begin: [foot, tip].map(|v| if is_upright { v } else { -v }),
        },
    })
}

/// Directions of leaders, in degrees, one after the other.
const TURNS: [f64; 7] = [35.0, -30.0, 62.0, -58.0, 8.0, 80.0, -80.0];

fn round_offer(
    view: &Placed<'_>,
    (center, axis, radius): (Point3, Option<Point3>, f64),
    rim: &[Sample],
    is_diameter: bool,
    turn: usize,
) -> Option<Offer> {
    let toward = view.picture().view.toward;
    let tilt = axis.map_or(1.0, |z| dot(z, toward).abs());
    // Along the axis a circle is seen; across it the outermost line is as far as the radius.
    if tilt < 0.999 && tilt > 0.05 {
        return None;
    }
    let facing = |s: &&Sample| dot(s.normal, toward).abs() < 0.3;
    let visible: Vec<&Sample> = seen(view, rim).into_iter().filter(facing).collect();
    if visible.len() < FEWEST_SEEN {
        return None;
    }
    let visible = truest(visible, center, axis, radius);
    let middle = if tilt > 0.9 { None } else { axis };
    let angle = TURNS[turn % TURNS.len()].to_radians();
    let wanted = [angle.cos(), -angle.sin()];
    let c = view.at(center);
    let merit_of = |s: &Sample| {
        let p = view.at(s.at);
        let d = [p[0] - c[0], p[1] - c[1]];
        (d[0] * wanted[0] + d[1] * wanted[1]) / d[0].hypot(d[1]).max(1e-9)
    };
    let best = visible
        .into_iter()
        .max_by(|a, b| merit_of(a).total_cmp(&merit_of(b)))?;
    let tip = view.at(best.at);
    // Across the axis the radius begins on the axis beside the tip.
    let begin = match middle {
        Some(z) => {
            let along = dot(z, [0, 1, 2].map(|k| best.at[k] - center[k]));
            view.at(std::array::from_fn(|k| center[k] + along * z[k]))
        }
        None => c,
    };
    let from = if is_diameter && middle.is_none() {
        [2.0 * c[0] - tip[0], 2.0 * c[1] - tip[1]]
    } else {
        begin
    };
    Some(Offer {
        merit: if middle.is_none() { 1.6 } else { 0.7 },
        shown: Shown::Leader {
            from: Some(from),
            to: tip,
            has_center: !is_diameter,
        },
    })
}

/// Of a wall that slopes, the points where it has the radius itself.
fn truest(rim: Vec<&Sample>, center: Point3, axis: Option<Point3>, radius: f64) -> Vec<&Sample> {
    let off = |s: &&Sample| {
        let d: Point3 = std::array::from_fn(|k| s.at[k] - center[k]);
        let along = axis.map_or(0.0, |z| dot(z, d));
        ((dot(d, d) - along * along).max(0.0).sqrt() - radius).abs()
    };
    let true_ones: Vec<&Sample> = rim
        .iter()
        .filter(|s| off(s) < 0.01 * radius)
        .copied()
        .collect();
    if true_ones.is_empty() { rim } else { true_ones }
}

fn offset_offer(view: &Placed<'_>, length: f64, places: &[Sample]) -> Option<Offer> {
    let picture = view.picture();
    let toward = picture.view.toward;
    let edge_on = |s: &&Sample| dot(s.normal, toward).abs() < 0.15;
    // A heading may lead inwards; what hides a point is asked on the side of air.
    let visible = places
        .iter()
        .filter(edge_on)
        .filter(|s| picture.shows(s.at, s.normal) || picture.shows(s.at, s.normal.map(|v| -v)));
    let rightmost = visible.max_by(|a, b| {
        let right = |s: &Sample| {
            let [u, v, _] = picture.view.of(s.at);
            u + 0.3 * v
        };
        right(a).total_cmp(&right(b))
    })?;
    let begin: Point3 = std::array::from_fn(|k| rightmost.at[k] - length * rightmost.normal[k]);
    let is_cut = picture.view.cut.is_some();
    Some(Offer {
        merit: if is_cut { 0.95 } else { 0.8 },
        shown: Shown::Leader {
            from: Some(view.at(begin)),
            to: view.at(rightmost.at),
            has_center: false,
        },
    })
}

fn place_offer(view: &Placed<'_>, places: &[Sample]) -> Option<Offer> {
    let few = &places[..places.len().min(400)];
    let visible = seen(view, few);
    let first = visible.iter().max_by(|a, b| {
        let right = |s: &Sample| view.at(s.at)[0];
        right(a).total_cmp(&right(b))
    })?;
    Some(Offer {
        merit: 0.4 + 0.4 * visible.len() as f64 / few.len() as f64,
        shown: Shown::Leader {
            from: None,
            to: view.at(first.at),
            has_center: false,
        },
    })
}

/// A view with what it shows.
struct Panel<'a> {
    placed: Placed<'a>,
    shown: Vec<(Shown, Label)>,
}

impl<'a> Panel<'a> {
    fn new(drawn: &'a Drawn, scale: f64) -> Self {
        let placed = Placed {
            drawn,
            scale,
            origin: [0.0; 2],
        };
        Self {
            placed,
            shown: Vec::new(),
        }
    }
    fn lanes(&self, upright: bool) -> usize {
        let lanes = self
            .shown
            .iter()
            .filter(|(s, _)| matches!(s, Shown::Lane { is_upright, .. } if *is_upright == upright));
        lanes.count()
    }
    fn leaders(&self) -> impl Iterator<Item = (&Shown, &Label)> {
        self.shown
            .iter()
            .filter(|(s, _)| matches!(s, Shown::Leader { .. }))
            .map(|(s, l)| (s, l))
    }
    /// Space that is needed to the left, to the right, above and below of the view's middle.
    fn needs(&self) -> [f64; 4] {
        let [l, r, t, b] = self.placed.bounds();
        let (w, h) = (0.5 * (r - l), 0.5 * (b - t));
        let label = self.leaders().map(|(_, l)| l.width()).fold(0.0, f64::max);
        let labels = if label > 0.0 { GAP + label } else { 0.0 };
        let stack = 0.5 * LABEL * self.leaders().count() as f64;
        let below = LANES[0] * self.lanes(false) as f64;
        // The text of a lane may be longer than the lane.
        let text = self.shown.iter().filter_map(|(s, label)| match s {
            Shown::Lane {
                is_upright: false, ..
            } => Some(0.5 * LETTER * (label.name.len() + label.value.chars().count() + 2) as f64),
            _ => None,
        });
        let text = text.fold(0.0, f64::max);
        [
            (w + LANES[1] * self.lanes(true) as f64).max(text) + AIR,
            (w + labels).max(text) + AIR,
            h.max(stack).max(self.overhang(-1.0)) + 26.0,
            (h + below).max(stack).max(self.overhang(1.0)) + AIR,
        ]
    }
    /// How far texts of upright lanes reach from the middle of the view, up or down.
    fn overhang(&self, sign: f64) -> f64 {
        let [_, _, t, b] = self.placed.bounds();
        let middle = 0.5 * (t + b);
        let reach = |(shown, label): &(Shown, Label)| match shown {
            Shown::Lane {
                is_upright: true,
                ends,
                ..
            } => sign * (0.5 * (ends[0] + ends[1]) - middle) + 0.5 * label.width(),
            _ => 0.0,
        };
        self.shown.iter().map(reach).fold(0.0, f64::max)
    }
    /// Puts the middle of the view here.
    fn put(&mut self, x: f64, y: f64) {
        let [l, r, t, b] = self.placed.bounds();
        let by = [x - 0.5 * (l + r), y - 0.5 * (t + b)];
        for k in 0..2 {
            self.placed.origin[k] += by[k];
        }
        let moved = |p: &mut [f64; 2]| (0..2).for_each(|k| p[k] += by[k]);
        for (shown, _) in &mut self.shown {
            match shown {
                Shown::Leader { from, to, .. } => {
                    from.iter_mut().for_each(moved);
                    moved(to);
                }
                Shown::Lane {
                    is_upright,
                    ends,
                    begin,
                } => {
                    let (along, across) = if *is_upright { (1, 0) } else { (0, 1) };
                    ends.iter_mut().for_each(|v| *v += by[along]);
                    begin.iter_mut().for_each(|v| *v += by[across]);
                }
            }
        }
    }
    /// Name, dimensions and labels, which go on top of all views.
    fn marks(&self) -> String {
        let [l, _, t, _] = self.placed.bounds();
        let mut svg = self.placed.caption(l, t - 12.0);
        svg += &self.lanes_svg();
        svg += &self.leaders_svg();
        svg
    }

    fn lanes_svg(&self) -> String {
        let [left, _, _, bottom] = self.placed.bounds();
        let mut svg = String::new();
        for upright in [false, true] {
            let mut lanes: Vec<(&[f64; 2], &[f64; 2], &Label)> = self
                .shown
                .iter()
                .filter_map(|(s, label)| match s {
                    Shown::Lane {
                        is_upright,
                        ends,
                        begin,
                    } if *is_upright == upright => Some((ends, begin, label)),
                    _ => None,
                })
                .collect();
            // Short ones inside, so that lines do not cross.
            lanes.sort_by(|a, b| (a.0[0] - a.0[1]).abs().total_cmp(&(b.0[0] - b.0[1]).abs()));
            for (i, (ends, begin, label)) in lanes.into_iter().enumerate() {
                let by = LANES[usize::from(upright)] * (i + 1) as f64;
                let lane = if upright { left - by } else { bottom + by };
                svg += &lane_svg(upright, lane, *ends, *begin, label);
            }
        }
        svg
    }

    fn leaders_svg(&self) -> String {
        let [_, right, top, bottom] = self.placed.bounds();
        let mut leaders: Vec<(&Shown, &Label)> = self.leaders().collect();
        let height = |s: &Shown| match s {
            Shown::Leader { to, .. } => to[1],
            Shown::Lane { .. } => 0.0,
        };
        leaders.sort_by(|a, b| height(a.0).total_cmp(&height(b.0)));
        let n = leaders.len() as f64;
        let middle = 0.5 * (top + bottom);
        let (low, high) = (
            (middle - 0.5 * n * LABEL).min(top),
            (middle + 0.5 * n * LABEL).max(bottom),
        );
        // Each label at the height of its arrow, or as near as the others let it.
        let mut at: Vec<f64> = Vec::new();
        for (i, (s, _)) in leaders.iter().enumerate() {
            let least = at.last().map_or(low + 0.5 * LABEL, |y| y + LABEL);
            let most = high - LABEL * (n - i as f64 - 0.5);
            at.push(height(s).max(least).min(most.max(least)));
        }
        let mut svg = String::new();
        for ((shown, label), y) in leaders.into_iter().zip(at) {
            svg += &leader_svg(shown, label, right + GAP, y);
        }
        svg
    }
}

/// An arrowhead at a point, which points along the direction.
fn head([x, y]: [f64; 2], d: [f64; 2]) -> String {
    let length = d[0].hypot(d[1]).max(1e-9);
    let (u, v) = (d[0] / length, d[1] / length);
    format!(
        "M{x:.1} {y:.1}L{:.1} {:.1}L{:.1} {:.1}Z",
        x - 8.0 * u - 2.4 * v,
        y - 8.0 * v + 2.4 * u,
        x - 8.0 * u + 2.4 * v,
        y - 8.0 * v - 2.4 * u
    )
}

fn lane_svg(is_upright: bool, lane: f64, ends: [f64; 2], begin: [f64; 2], label: &Label) -> String {
    let at = |along: f64, across: f64| {
        if is_upright {
            [across, along]
        } else {
            [along, across]
        }
    };
    let past = if is_upright { -5.0 } else { 5.0 };
    let mut lines = String::new();
    for (end, begin) in ends.into_iter().zip(begin) {
        let (a, b) = (at(end, begin + 0.5 * past), at(end, lane + past));
        let _ = write!(lines, "M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1]);
    }
    let (lo, hi) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    // Arrows of short dimensions come from outside.
    let (reach, sign) = if hi - lo < 20.0 {
        (12.0, -1.0)
    } else {
        (0.0, 1.0)
    };
    let (a, b) = (at(lo - reach, lane), at(hi + reach, lane));
    let _ = write!(lines, "M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1]);
    let (back, forth) = (at(-sign, 0.0), at(sign, 0.0));
    let heads = head(at(lo, lane), back) + &head(at(hi, lane), forth);
    let (name, value) = (escaped(&label.name), escaped(&label.value));
    let middle = at(0.5 * (lo + hi), lane - 5.0);
    let (x, y) = (middle[0], middle[1]);
    let text = if is_upright {
        format!(
            "<text class=\"dim\" text-anchor=\"middle\" transform=\"translate({x:.1} {y:.1}) rotate(-90)\">\
             <tspan class=\"name\" x=\"0\" y=\"-13\">{name}</tspan><tspan x=\"0\" y=\"0\">{value}</tspan></text>"
        )
    } else {
        format!(
            "<text class=\"dim\" text-anchor=\"middle\" x=\"{x:.1}\" y=\"{y:.1}\"><tspan class=\"name\">{name}</tspan> {value}</text>"
        )
    };
    format!("<path class=\"thin\" d=\"{lines}\"/><path class=\"head\" d=\"{heads}\"/>{text}")
}

fn leader_svg(shown: &Shown, label: &Label, x: f64, y: f64) -> String {
    let Shown::Leader {
        from,
        to,
        has_center,
    } = shown
    else {
        return String::new();
    };
    let elbow = [x - 8.0, y];
    let mut lines = format!(
        "M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}",
        to[0],
        to[1],
        elbow[0],
        elbow[1],
        x - 2.0,
        y
    );
    let direction = match from {
        Some(from) => {
            let _ = write!(
                lines,
                "M{:.1} {:.1}L{:.1} {:.1}",
                from[0], from[1], to[0], to[1]
            );
            if *has_center {
                let _ = write!(
                    lines,
                    "M{0:.1} {1:.1}h10M{2:.1} {3:.1}v10",
                    from[0] - 5.0,
                    from[1],
                    from[0],
                    from[1] - 5.0
                );
            }
            [to[0] - from[0], to[1] - from[1]]
        }
        None => [to[0] - elbow[0], to[1] - elbow[1]],
    };
    let mut heads = head(*to, direction);
    if let (Some(from), false) = (from, has_center) {
        heads += &head(*from, direction.map(|v| -v));
    }
    format!(
        "<path class=\"thin\" d=\"{lines}\"/><path class=\"head\" d=\"{heads}\"/>\
         <text class=\"dim\" x=\"{x:.1}\" y=\"{:.1}\"><tspan class=\"name\">{}</tspan><tspan x=\"{x:.1}\" dy=\"14\">{}</tspan></text>",
        y - 2.0,
        escaped(&label.name),
        escaped(&label.value)
    )
}

/// The sheet with views and dimensions.
pub(super) fn dimensioned(drawing: &Drawing<'_>, forms: &[Form]) -> String {
    let scale = scale_of(drawing);
    let mut panels: Vec<Panel<'_>> = [
        Some(&drawing.front),
        drawing.side.as_ref(),
        Some(&drawing.top),
        drawing.section.as_ref(),
    ]
    .into_iter()
    .flatten()
    .map(|d| Panel::new(d, scale))
    .collect();
    let rest = distribute(drawing, forms, &mut panels);
    let [l, r, t, b] = Placed {
        drawn: &drawing.above,
        scale: 1.0,
        origin: [0.0; 2],
    }
    .bounds();
    // The isometric view fits the room of the others.
    let own = SIZE / (r - l).max(b - t).max(f64::MIN_POSITIVE);
    panels.push(Panel::new(&drawing.above, own.min(scale)));
    if drawing.section.is_some() && drawing.side.is_some() {
        panels.push(Panel::new(&drawing.below, own.min(scale)));
    }
    let (width, height) = arrange(drawing, &mut panels);
    let all = || panels.iter();
    let bodies = all().map(|p| p.placed.shades(PAPER) + &p.placed.lines());
    let body: String = bodies.chain(all().map(Panel::marks)).collect();
    let (legend, more) = legend(drawing, forms, &rest, height);
    let total = height + more;
    format!(
        "<svg class=\"sheet\" viewBox=\"0 0 {width:.0} {total:.0}\" role=\"img\" aria-label=\"the fitted model in its own frame, with its dimensions\">\
         <rect class=\"paper\" width=\"{width:.0}\" height=\"{total:.0}\"/>{body}{legend}</svg>"
    )
}

fn scale_of(drawing: &Drawing<'_>) -> f64 {
    let views = [
        Some(&drawing.front),
        drawing.side.as_ref(),
        Some(&drawing.top),
    ];
    let longest = views
        .into_iter()
        .flatten()
        .filter_map(|d| d.picture.bounds())
        .flat_map(|[a, b, c, d]| [b - a, d - c])
        .fold(f64::MIN_POSITIVE, f64::max);
    SIZE / longest
}

/// Gives each dimension to the view that shows it best; the indices of those that none shows.
fn distribute<'a>(drawing: &Drawing<'_>, forms: &[Form], panels: &mut [Panel<'a>]) -> Vec<usize> {
    let mut rest = Vec::new();
    for (i, form) in forms.iter().enumerate() {
        let best = panels
            .iter()
            .enumerate()
            .filter_map(|(k, panel)| {
                let turn = panel.leaders().count();
                let offer = offer(&panel.placed, form, &drawing.samples, turn)?;
                // Views in their order, and those with room before the full ones.
                let full = 0.05 * (k + panel.shown.len()) as f64;
                Some((offer.merit - full, k, offer.shown))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((_, k, shown)) => panels[k].shown.push((shown, label(drawing, form, i))),
            None => rest.push(i),
        }
    }
    rest
}

fn label(drawing: &Drawing<'_>, form: &Form, i: usize) -> Label {
    let job = drawing.job;
    let mark = match form {
        Form::Round {
            is_diameter, count, ..
        } => {
            let sign = if *is_diameter { "⌀ " } else { "R " };
            if *count > 1 {
                format!("{count}× {sign}")
            } else {
                sign.to_owned()
            }
        }
        _ => String::new(),
    };
    Label {
        name: job.found.fit.parameters[i].name.clone(),
        value: mark + &table::reading(job, i).text(),
    }
}

/// Puts top over front and side beside it (third-angle projection), the section below or in the
/// place of the side, isometric views where there is room; width and height of it all.
fn arrange(drawing: &Drawing<'_>, panels: &mut [Panel<'_>]) -> (f64, f64) {
    let mut cells: Vec<(usize, usize)> = vec![(1, 0)];
    if drawing.side.is_some() {
        cells.push((1, 1));
    }
    cells.push((0, 0));
    if drawing.section.is_some() {
        cells.push(if drawing.side.is_some() {
            (2, 0)
        } else {
            (1, 1)
        });
    }
    // The isometric views.
    cells.extend([(0, 1), (2, 1)]);
    let (mut columns, mut rows) = ([[0.0_f64; 2]; 2], [[0.0_f64; 2]; 3]);
    for (panel, (row, column)) in panels.iter().zip(&cells) {
        let [l, r, t, b] = panel.needs();
        let c = &mut columns[*column];
        *c = [c[0].max(l), c[1].max(r)];
        let w = &mut rows[*row];
        *w = [w[0].max(t), w[1].max(b)];
    }
    let centers = |spans: &[[f64; 2]]| -> (Vec<f64>, f64) {
        let mut at = AIR;
        let middles = spans
            .iter()
            .map(|[a, b]| {
                at += a + b;
                at - b
            })
            .collect();
        (middles, at + AIR)
    };
    let ((mut x, mut width), (y, height)) = (centers(&columns), centers(&rows));
    // A narrow sheet would be blown up to the width of the page.
    let more = (NARROWEST - width).max(0.0);
    (x[0], x[1], width) = (x[0] + 0.25 * more, x[1] + 0.75 * more, width + more);
    for (panel, (row, column)) in panels.iter_mut().zip(cells) {
        panel.put(x[column], y[row]);
    }
    (width, height)
}

/// Below the views: what could not be drawn, and how to read the sheet; and its height.
fn legend(drawing: &Drawing<'_>, forms: &[Form], rest: &[usize], from: f64) -> (String, f64) {
    let mut lines = Vec::new();
    for i in rest {
        let label = label(drawing, &forms[*i], *i);
        let why = match forms[*i] {
            Form::Nothing => "does not move the surface",
            _ => "not seen in these views",
        };
        lines.push(format!("{} {} ({why})", label.name, label.value));
    }
    lines.push(
        "Third-angle projection, in the model's own frame. ± is half of the 95 % interval."
            .to_owned(),
    );
    let mut svg = String::new();
    for (i, line) in lines.iter().enumerate() {
        let _ = write!(
            svg,
            "<text class=\"soft\" x=\"{AIR}\" y=\"{:.1}\">{}</text>",
            from + 4.0 + 16.0 * i as f64,
            escaped(line)
        );
    }
    (svg, 16.0 * lines.len() as f64)
}

/// Side of the squares on paper in which one point is drawn, the nearest to the viewer.
const DOT: f64 = 3.0;
/// Colours of the map; more cannot be told apart.
const SHADES: usize = 21;

/// The sheet with the points that can be seen, coloured by their deviation.
pub(super) fn with_points(drawing: &Drawing<'_>, limit: f64) -> String {
    let views = [
        Some(&drawing.front),
        drawing.side.as_ref(),
        Some(&drawing.top),
        drawing
            .section
            .as_ref()
            .filter(|s| shows_inside(&s.picture)),
        Some(&drawing.above),
        Some(&drawing.below),
    ];
    let views: Vec<&Drawn> = views.into_iter().flatten().collect();
    let points = points(drawing);
    let columns = if views.len() > 4 { 3 } else { 2 };
    let side = if columns == 3 { 250.0 } else { 300.0 };
    let (mut svg, mut y, mut width) = (String::new(), AIR, 0.0_f64);
    for row in views.chunks(columns) {
        let scaled: Vec<Placed<'_>> = row.iter().map(|d| fitted(d, side)).collect();
        let height = scaled.iter().map(|p| extent(p)[1]).fold(0.0, f64::max);
        for (i, mut placed) in scaled.into_iter().enumerate() {
            let x = AIR + (side + 2.0 * AIR) * (i as f64 + 0.5);
            let middle = y + 22.0 + 0.5 * height;
            let [l, r, t, b] = placed.bounds();
            placed.origin = [x - 0.5 * (l + r), middle - 0.5 * (t + b)];
            svg += &placed.shades(GREY);
            svg += &dots(&placed, &points, limit);
            svg += &placed.lines();
            svg += &placed.caption(x - 0.5 * side, y + 8.0);
            width = width.max(x + 0.5 * side + 2.0 * AIR);
        }
        y += height + 22.0 + 2.0 * AIR;
    }
    format!(
        "<svg class=\"sheet\" viewBox=\"0 0 {width:.0} {y:.0}\" role=\"img\" aria-label=\"the points of the scan on the fitted model, coloured by their deviation\">\
         <rect class=\"paper\" width=\"{width:.0}\" height=\"{y:.0}\"/>{svg}</svg>"
    )
}

/// Whether a good part of a section is faces behind the cut, where points can lie.
fn shows_inside(section: &Picture) -> bool {
    let hits = section.hits.iter().flatten();
    let behind = hits.clone().filter(|h| h.part != CUT).count();
    behind as f64 > 0.15 * hits.count() as f64
}

fn extent(placed: &Placed<'_>) -> [f64; 2] {
    let [l, r, t, b] = placed.bounds();
    [r - l, b - t]
}

fn fitted(drawn: &Drawn, side: f64) -> Placed<'_> {
    let mut placed = Placed {
        drawn,
        scale: 1.0,
        origin: [0.0; 2],
    };
    let [w, h] = extent(&placed);
    placed.scale = side / w.max(h).max(f64::MIN_POSITIVE);
    placed
}

/// A point in the model's frame with its deviation, NaN for an outlier.
type Point = (Point3, f64);

fn points(drawing: &Drawing<'_>) -> Vec<Point> {
    let job = drawing.job;
    let all = job.found.cloud.points.iter().zip(job.found.deviation());
    all.zip(&job.found.fit.outliers)
        .map(|((p, d), out)| (drawing.subject.framed(*p), if *out { f64::NAN } else { d }))
        .collect()
}

/// The points that no part of the model and no nearer point hides.
fn dots(placed: &Placed<'_>, points: &[Point], limit: f64) -> String {
    let picture = placed.picture();
    let cell = DOT / placed.scale;
    let columns = (picture.width as f64 * picture.pixel / cell).ceil() as usize + 1;
    let rows = (picture.height as f64 * picture.pixel / cell).ceil() as usize + 1;
    let mut nearest: Vec<Option<(f64, f64, [f64; 2])>> = vec![None; columns * rows];
    for (p, d) in points {
        let [u, v, w] = picture.view.of(*p);
        let (c, r) = ((u - picture.first[0]) / cell, (picture.first[1] - v) / cell);
        let is_within = (0.0..columns as f64).contains(&c) && (0.0..rows as f64).contains(&r);
        if !is_within || picture.view.cut.is_some_and(|cut| w > cut + picture.pixel) {
            continue;
        }
        let slot = &mut nearest[r as usize * columns + c as usize];
        if slot.is_none_or(|(depth, ..)| depth < w) {
            *slot = Some((w, *d, [u, v]));
        }
    }
    let mut shades = vec![String::new(); SHADES + 1];
    for (depth, d, uv) in nearest.into_iter().flatten() {
        // Noise puts half of the points below the surface, and slopes turn it into depth.
        let slack = 4.0 * picture.pixel + 2.0 * if d.is_nan() { 0.0 } else { d.abs() };
        if picture.seen(uv).is_some_and(|h| h.depth > depth + slack) {
            continue;
        }
        let shade = if d.is_nan() {
            SHADES
        } else {
            (((d / limit).clamp(-1.0, 1.0) * 0.5 + 0.5) * (SHADES - 1) as f64).round() as usize
        };
        let [x, y] = placed.flat(uv);
        let _ = write!(shades[shade], "M{x:.1} {y:.1}h0");
    }
    let middles: Vec<f64> = (0..SHADES)
        .map(|k| limit * (2.0 * k as f64 / (SHADES - 1) as f64 - 1.0))
        .collect();
    let mut colors = deviation_colors(&middles, limit);
    colors.push([40, 44, 50]);
    let mut svg = String::new();
    for (path, [r, g, b]) in shades.iter().zip(colors).filter(|(s, _)| !s.is_empty()) {
        let _ = write!(
            svg,
            "<path class=\"dot\" stroke=\"#{r:02x}{g:02x}{b:02x}\" stroke-width=\"{DOT}\" d=\"{path}\"/>"
        );
    }
    svg
}
