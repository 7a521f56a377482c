//! Ways in which a view can show a dimension, with their quality.
//!
//! A lane is a dimension line outside the view, between two extension lines; a leader is an arrow
//! within the view that leads to a label on its right.

use super::super::dimensions::DimensionForm;
use super::super::subject::Sample;
use super::placed::PlacedView;
use isoform::geom::{Point3, dot};

/// A dimension that a view will show.
pub(super) enum DimensionMark {
    /// Dimension line below the view, or (true) on its left; from, to: coordinates along it; the
    /// beginnings of the two extension lines across it.
    Lane {
        is_upright: bool,
        ends: [f64; 2],
        begin: [f64; 2],
    },
    /// Arrow from one place to another with a label on the right of the view.
    Leader {
        from: Option<[f64; 2]>,
        to: [f64; 2],
        has_center: bool,
    },
}

/// A dimension as one view could show it, and how well.
pub(super) struct Offer {
    /// The larger the better; the view with the best offer shows the dimension.
    pub(super) merit: f64,
    pub(super) shown: DimensionMark,
}

/// Fewest samples of a moving face that must be seen in a view.
const FEWEST_SEEN: usize = 2;

/// Returns the ways in which a view can show a form; angles are chosen so that leaders do not
/// cross.
pub(super) fn offer(
    view: &PlacedView<'_>,
    form: &DimensionForm,
    samples: &[Sample],
    turn: usize,
) -> Option<Offer> {
    match form {
        DimensionForm::Linear {
            along,
            from,
            to,
            near,
            far,
        } => linear_offer(view, *along, [*from, *to], [near, far], samples),
        DimensionForm::Round {
            center,
            axis,
            rim,
            is_diameter,
            radius,
            ..
        } => round_offer(view, (*center, *axis, *radius), rim, *is_diameter, turn),
        DimensionForm::Offset { length, places } => offset_offer(view, *length, places),
        DimensionForm::Place(places) => place_offer(view, places),
        DimensionForm::Nothing | DimensionForm::Tied => None,
    }
}

/// The samples that a view shows.
fn seen<'s>(view: &PlacedView<'_>, samples: &'s [Sample]) -> Vec<&'s Sample> {
    let picture = view.picture();
    samples
        .iter()
        .filter(|s| picture.shows(s.at, s.normal))
        .collect()
}

/// Offers a length along a direction: a lane if it is vertical or horizontal on paper, a leader
/// along it if it is oblique, nothing if it is foreshortened or its far end is hidden.
fn linear_offer(
    view: &PlacedView<'_>,
    along: Point3,
    [from, to]: [f64; 2],
    [near, far]: [&[Sample]; 2],
    samples: &[Sample],
) -> Option<Offer> {
    let [eu, ev, ew] = view.picture().view.project(along);
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
            shown: DimensionMark::Leader {
                from: Some(view.at(foot)),
                to: view.at(tip),
                has_center: false,
            },
        });
    }
    let at_foot = at_foot(near, samples, along, [from, to]);
    let tip = nearest_to_lane(view, is_upright, &ends)?;
    let foot = nearest_to_lane(view, is_upright, &at_foot).unwrap_or(tip);
    let coordinate = |t: f64| {
        let p = view.flat([eu * t, ev * t]);
        if is_upright { p[1] } else { p[0] }
    };
    Some(Offer {
        merit: 1.0 + 0.5 * share,
        shown: DimensionMark::Lane {
            is_upright,
            ends: [coordinate(from), coordinate(to)],
            begin: [foot, tip].map(|v| if is_upright { v } else { -v }),
        },
    })
}

/// The samples where a length begins: the given ones, else all that lie on its lower level.
fn at_foot<'s>(
    near: &'s [Sample],
    samples: &'s [Sample],
    along: Point3,
    [from, to]: [f64; 2],
) -> Vec<&'s Sample> {
    if !near.is_empty() {
        return near.iter().collect();
    }
    let slack = 0.01 * (to - from);
    let is_level = |s: &&Sample| (dot(s.at, along) - from).abs() < slack;
    samples.iter().filter(is_level).collect()
}

/// Returns the distance of the samples from the side of the lane: vertical lanes stand on the left,
/// others below.
fn nearest_to_lane(view: &PlacedView<'_>, is_upright: bool, samples: &[&Sample]) -> Option<f64> {
    let across = samples.iter().map(|s| {
        let [x, y] = view.at(s.at);
        if is_upright { x } else { -y }
    });
    across.min_by(f64::total_cmp)
}

/// Directions of leaders, in degrees, one after the other.
const TURNS: [f64; 7] = [35.0, -30.0, 62.0, -58.0, 8.0, 80.0, -80.0];

/// Offers a radius or diameter: along the axis as an arrow from the centre, across the axis, where
/// it merits less, to the outermost line.
fn round_offer(
    view: &PlacedView<'_>,
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
    let c = view.at(center);
    let angle = TURNS[turn % TURNS.len()].to_radians();
    let best = toward_angle(view, visible, c, angle)?;
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
        shown: DimensionMark::Leader {
            from: Some(from),
            to: tip,
            has_center: !is_diameter,
        },
    })
}

/// The sample that lies most nearly in a direction from the centre.
fn toward_angle<'s>(
    view: &PlacedView<'_>,
    rim: Vec<&'s Sample>,
    center: [f64; 2],
    angle: f64,
) -> Option<&'s Sample> {
    let wanted = [angle.cos(), -angle.sin()];
    let merit_of = |s: &Sample| {
        let p = view.at(s.at);
        let d = [p[0] - center[0], p[1] - center[1]];
        (d[0] * wanted[0] + d[1] * wanted[1]) / d[0].hypot(d[1]).max(1e-9)
    };
    rim.into_iter()
        .max_by(|a, b| merit_of(a).total_cmp(&merit_of(b)))
}

/// Returns the points of a sloping wall at which it has the radius itself.
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

/// Offers a wall or a bead where it is seen edge-on, at the sample farthest to the right.
fn offset_offer(view: &PlacedView<'_>, length: f64, places: &[Sample]) -> Option<Offer> {
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
            let [u, v, _] = picture.view.project(s.at);
            u + 0.3 * v
        };
        right(a).total_cmp(&right(b))
    })?;
    let begin: Point3 = std::array::from_fn(|k| rightmost.at[k] - length * rightmost.normal[k]);
    let is_cut = picture.view.cut.is_some();
    Some(Offer {
        merit: if is_cut { 0.95 } else { 0.8 },
        shown: DimensionMark::Leader {
            from: Some(view.at(begin)),
            to: view.at(rightmost.at),
            has_center: false,
        },
    })
}

/// Offers an arrow to the place that moves most, by the share of such places that are seen.
fn place_offer(view: &PlacedView<'_>, places: &[Sample]) -> Option<Offer> {
    let few = &places[..places.len().min(400)];
    let visible = seen(view, few);
    let first = visible.iter().max_by(|a, b| {
        let right = |s: &Sample| view.at(s.at)[0];
        right(a).total_cmp(&right(b))
    })?;
    Some(Offer {
        merit: 0.4 + 0.4 * visible.len() as f64 / few.len() as f64,
        shown: DimensionMark::Leader {
            from: None,
            to: view.at(first.at),
            has_center: false,
        },
    })
}
