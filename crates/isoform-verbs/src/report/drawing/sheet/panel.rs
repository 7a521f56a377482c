//! A view with its dimensions: the room that they need, and how they are drawn.

use super::super::Drawn;
use super::offers::DimensionMark;
use super::placed::PlacedView;
use crate::report::svg::escaped;
use std::fmt::Write;

/// Space about a panel.
pub(super) const AIR: f64 = 16.0;

/// Distance of a dimension line from the view and from the next one: below, and on the left, where
/// names stand over values.
const LANES: [f64; 2] = [27.0, 38.0];
/// Height of a label of two lines.
const LABEL: f64 = 32.0;
/// Space between a view and its labels.
const GAP: f64 = 26.0;
/// Width of a letter of the labels, on average and a little more.
const LETTER: f64 = 6.7;
/// The name of a parameter and its value.
pub(super) struct Label {
    pub(super) name: String,
    pub(super) value: String,
}

impl Label {
    /// Width on paper, the name over the value.
    fn width(&self) -> f64 {
        LETTER * self.name.chars().count().max(self.value.chars().count()) as f64
    }
}

/// A view with what it shows.
pub(super) struct Panel<'a> {
    /// The view.
    pub(super) placed: PlacedView<'a>,
    /// Dimensions of the panel with their labels.
    pub(super) shown: Vec<(DimensionMark, Label)>,
}

impl<'a> Panel<'a> {
    pub(super) fn new(drawn: &'a Drawn, scale: f64) -> Self {
        let placed = PlacedView {
            drawn,
            scale,
            origin: [0.0; 2],
        };
        Self {
            placed,
            shown: Vec::new(),
        }
    }
    /// Returns the number of lanes below, or on the left.
    fn lanes(&self, upright: bool) -> usize {
        let lanes = self.shown.iter().filter(
            |(s, _)| matches!(s, DimensionMark::Lane { is_upright, .. } if *is_upright == upright),
        );
        lanes.count()
    }
    /// The leaders with their labels.
    pub(super) fn leaders(&self) -> impl Iterator<Item = (&DimensionMark, &Label)> {
        self.shown
            .iter()
            .filter(|(s, _)| matches!(s, DimensionMark::Leader { .. }))
            .map(|(s, l)| (s, l))
    }
    /// Space that is needed to the left, to the right, above and below of the view's middle.
    pub(super) fn needs(&self) -> [f64; 4] {
        let [l, r, t, b] = self.placed.bounds();
        let (w, h) = (0.5 * (r - l), 0.5 * (b - t));
        let label = self.leaders().map(|(_, l)| l.width()).fold(0.0, f64::max);
        let labels = if label > 0.0 { GAP + label } else { 0.0 };
        let stack = 0.5 * LABEL * self.leaders().count() as f64;
        let below = LANES[0] * self.lanes(false) as f64;
        // The text of a lane may be longer than the lane.
        let text = self.shown.iter().filter_map(|(s, label)| match s {
            DimensionMark::Lane {
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
    /// Returns the extent of the texts of vertical lanes from the middle of the view, up or down.
    fn overhang(&self, sign: f64) -> f64 {
        let [_, _, t, b] = self.placed.bounds();
        let middle = 0.5 * (t + b);
        let reach = |(shown, label): &(DimensionMark, Label)| match shown {
            DimensionMark::Lane {
                is_upright: true,
                ends,
                ..
            } => sign * (0.5 * (ends[0] + ends[1]) - middle) + 0.5 * label.width(),
            _ => 0.0,
        };
        self.shown.iter().map(reach).fold(0.0, f64::max)
    }
    /// Puts the middle of the view here.
    pub(super) fn put(&mut self, x: f64, y: f64) {
        let [l, r, t, b] = self.placed.bounds();
        let by = [x - 0.5 * (l + r), y - 0.5 * (t + b)];
        for k in 0..2 {
            self.placed.origin[k] += by[k];
        }
        let moved = |p: &mut [f64; 2]| (0..2).for_each(|k| p[k] += by[k]);
        for (shown, _) in &mut self.shown {
            match shown {
                DimensionMark::Leader { from, to, .. } => {
                    from.iter_mut().for_each(moved);
                    moved(to);
                }
                DimensionMark::Lane {
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
    pub(super) fn marks(&self) -> String {
        let [l, _, t, _] = self.placed.bounds();
        let mut svg = self.placed.caption(l, t - 12.0);
        svg += &self.lanes_svg();
        svg += &self.leaders_svg();
        svg
    }

    /// Draws the lanes, the shortest next to the view.
    fn lanes_svg(&self) -> String {
        let [left, _, _, bottom] = self.placed.bounds();
        let mut svg = String::new();
        for is_upright in [false, true] {
            for (i, (lane, label)) in self.sorted_lanes(is_upright).into_iter().enumerate() {
                let by = LANES[usize::from(is_upright)] * (i + 1) as f64;
                let at = if is_upright { left - by } else { bottom + by };
                svg += &lane.svg(at, label);
            }
        }
        svg
    }

    /// The lanes below or on the left. Short ones come first, which is inside, so that lines do not
    /// cross.
    fn sorted_lanes(&self, upright: bool) -> Vec<(Lane, &Label)> {
        let lanes = self.shown.iter().filter_map(|(s, label)| match *s {
            DimensionMark::Lane {
                is_upright,
                ends,
                begin,
            } if is_upright == upright => Some((
                Lane {
                    is_upright,
                    ends,
                    begin,
                },
                label,
            )),
            _ => None,
        });
        let mut lanes: Vec<(Lane, &Label)> = lanes.collect();
        lanes.sort_by(|a, b| a.0.length().total_cmp(&b.0.length()));
        lanes
    }

    /// Draws the leaders, their labels stacked on the right in the order of their arrows.
    fn leaders_svg(&self) -> String {
        let [_, right, top, bottom] = self.placed.bounds();
        let mut leaders: Vec<(&DimensionMark, &Label)> = self.leaders().collect();
        let height = |s: &DimensionMark| match s {
            DimensionMark::Leader { to, .. } => to[1],
            DimensionMark::Lane { .. } => 0.0,
        };
        leaders.sort_by(|a, b| height(a.0).total_cmp(&height(b.0)));
        let wanted: Vec<f64> = leaders.iter().map(|l| height(l.0)).collect();
        let heights = stacked(&wanted, top, bottom);
        let drawn = leaders.into_iter().zip(heights);
        drawn
            .map(|((shown, label), y)| leader_svg(shown, label, right + GAP, y))
            .collect()
    }
}

/// Returns the heights of labels next to a view from `top` to `bottom`: each at the height of its
/// arrow, or as near to it as the others allow. The wanted heights ascend.
fn stacked(wanted: &[f64], top: f64, bottom: f64) -> Vec<f64> {
    let n = wanted.len() as f64;
    let middle = 0.5 * (top + bottom);
    let low = (middle - 0.5 * n * LABEL).min(top);
    let high = (middle + 0.5 * n * LABEL).max(bottom);
    let mut at: Vec<f64> = Vec::new();
    for (i, height) in wanted.iter().enumerate() {
        let least = at.last().map_or(low + 0.5 * LABEL, |y| y + LABEL);
        let most = high - LABEL * (n - i as f64 - 0.5);
        at.push(height.max(least).min(most.max(least)));
    }
    at
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

/// A dimension line along the bottom, or up the left side.
struct Lane {
    is_upright: bool,
    /// Coordinates of its ends, along.
    ends: [f64; 2],
    /// Coordinates of the beginnings of its extension lines, across.
    begin: [f64; 2],
}

impl Lane {
    /// The length on paper.
    fn length(&self) -> f64 {
        (self.ends[0] - self.ends[1]).abs()
    }
    /// A place on the paper by its coordinates along the lane and across.
    fn place(&self, along: f64, across: f64) -> [f64; 2] {
        if self.is_upright {
            [across, along]
        } else {
            [along, across]
        }
    }

    /// Draws it at a distance `lane` across.
    fn svg(&self, lane: f64, label: &Label) -> String {
        let ends = self.ends;
        let mut lines = self.extensions(lane);
        let (lo, hi) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        // Arrows of short dimensions come from outside.
        let (reach, sign) = if hi - lo < 20.0 {
            (12.0, -1.0)
        } else {
            (0.0, 1.0)
        };
        lines += &stroke(self.place(lo - reach, lane), self.place(hi + reach, lane));
        let (back, forth) = (self.place(-sign, 0.0), self.place(sign, 0.0));
        let heads = head(self.place(lo, lane), back) + &head(self.place(hi, lane), forth);
        let text = self.text(self.place(0.5 * (lo + hi), lane - 5.0), label);
        format!("<path class=\"thin\" d=\"{lines}\"/><path class=\"head\" d=\"{heads}\"/>{text}")
    }

    /// The lines from the view to a little past the lane.
    fn extensions(&self, lane: f64) -> String {
        let past = if self.is_upright { -5.0 } else { 5.0 };
        let sides = self.ends.into_iter().zip(self.begin);
        sides
            .map(|(end, begin)| {
                let from = self.place(end, begin + 0.5 * past);
                stroke(from, self.place(end, lane + past))
            })
            .collect()
    }

    /// Name and value along the lane: in one line below, in two on the left.
    fn text(&self, [x, y]: [f64; 2], label: &Label) -> String {
        let (name, value) = (escaped(&label.name), escaped(&label.value));
        if self.is_upright {
            format!(
                "<text class=\"dim\" text-anchor=\"middle\" transform=\"translate({x:.1} {y:.1}) rotate(-90)\">\
                 <tspan class=\"name\" x=\"0\" y=\"-13\">{name}</tspan><tspan x=\"0\" y=\"0\">{value}</tspan></text>"
            )
        } else {
            format!(
                "<text class=\"dim\" text-anchor=\"middle\" x=\"{x:.1}\" y=\"{y:.1}\"><tspan class=\"name\">{name}</tspan> {value}</text>"
            )
        }
    }
}

/// A straight line.
fn stroke(a: [f64; 2], b: [f64; 2]) -> String {
    format!("M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1])
}

/// Draws a leader to its label at a place: an elbow, the line, its arrowheads, and a cross at a
/// centre.
fn leader_svg(shown: &DimensionMark, label: &Label, x: f64, y: f64) -> String {
    let DimensionMark::Leader {
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
            lines += &stroke(*from, *to);
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
