//! Interpretation of a parameter as a dimension: the motion of the surface as the parameter grows
//! shows the length that it measures.
//!
//! A point p of the surface with outward normal n moves by w n per unit of a parameter a; w is
//! called the speed. If a is a length and w is 1, then p − a w n is the beginning of the length: a
//! point of the axis of a radius, the foot of a height, the other side of a wall. If w is ½ on two
//! sides, a is the distance between them.
//!
//! - linear: all fast points move along one direction, by 1 on one side or by ½ on two;
//! - round: the beginnings p − a w n crowd in few places, the centres;
//! - offset: the beginnings lie on the other side of a wall, or amid a rod;
//! - place: none of these; the parameter is only shown where it acts.
//!
//! A level is a value of p · direction at which many points lie.

use super::subject::{DrawnModel, Sample};
use isoform::fit::{Kind, Template};
use isoform::geom::{Point3, dot, norm, sub};
use isoform::num::linalg::symmetric_eigen;

/// Dimension that a parameter measures, with the places where it can be shown.
#[derive(Clone, Debug)]
pub(super) enum DimensionForm {
    /// A length along a direction, from one side to the other; the foot may be bare of surface.
    Linear {
        along: Point3,
        from: f64,
        to: f64,
        near: Vec<Sample>,
        far: Vec<Sample>,
    },
    /// A radius or diameter about a centre; the axis is none for a ball.
    Round {
        center: Point3,
        axis: Option<Point3>,
        rim: Vec<Sample>,
        is_diameter: bool,
        radius: f64,
        /// Number of equal features.
        count: usize,
    },
    /// A length from the surface along its normal: a wall, a bead's radius.
    Offset { length: f64, places: Vec<Sample> },
    /// Anything else: where the surface moves most, fastest first.
    Place(Vec<Sample>),
    /// The surface does not move.
    Nothing,
    /// The parameter follows others, which are drawn.
    Tied,
}

/// Minimum speed of points that are considered, as a share of the fastest: slower points lie on
/// blends and on sides that are dragged along, whose normals point elsewhere.
const FAST: f64 = 0.9;
/// Speeds within this of 1 or ½ are taken for it. Slanted walls move by the cosine of their slope
/// (14° at 0.03), other measures by other speeds.
const SPEED: f64 = 0.06;
/// Cosine of the angle within which normals are said to lead along a direction.
const ALONG: f64 = 0.9;
/// Levels within this share of the model's size are one.
const LEVEL: f64 = 0.005;
/// Minimum share of the moving points that must fit a form; some of the others lie near edges.
const MOST: f64 = 0.75;
/// Share that must have a speed, or normals about an axis: a sheet's thickness changes with its
/// radius, and moves a floor too.
const SOME: f64 = 0.6;
/// Sine of the angle to the plane of a round within which normals lie in it.
const ABOUT: f64 = 0.3;
/// Most rounds of one kind that are counted.
const MOST_ROUNDS: usize = 24;

/// A point of the surface that a parameter moves.
struct Moved {
    sample: Sample,
    /// Way along the normal per unit of the parameter.
    speed: f64,
}

/// Returns the form of each of the model's own parameters.
pub(super) fn forms(
    subject: &DrawnModel<'_>,
    samples: &[Sample],
    template: &dyn Template,
    values: &[f64],
    own: usize,
) -> Vec<DimensionForm> {
    let motions = subject.motions(samples);
    let size = extent(samples);
    (0..own)
        .map(|k| {
            let moved: Vec<Moved> = samples
                .iter()
                .zip(&motions)
                .map(|(s, m)| Moved {
                    sample: *s,
                    speed: m[k],
                })
                .filter(|m| m.speed.abs() > 0.02)
                .collect();
            let still: Vec<Sample> = samples
                .iter()
                .zip(&motions)
                .filter(|(_, m)| m[k].abs() < 0.02)
                .map(|(s, _)| *s)
                .collect();
            let parameter = &template.parameters()[k];
            if parameter.tie.is_some() {
                return DimensionForm::Tied;
            }
            checked(
                form(&moved, &still, parameter.kind, values[k], size),
                subject,
            )
        })
        .collect()
}

/// An offset is a length that can be shown if it begins at the other side of a wall, or amid a rod
/// or bead of that radius; else it is only said where it acts.
fn checked(form: DimensionForm, subject: &DrawnModel<'_>) -> DimensionForm {
    let DimensionForm::Offset { length, places } = form else {
        return form;
    };
    let begins: Vec<Point3> = places
        .iter()
        .map(|s| std::array::from_fn(|k| s.at[k] - length * s.normal[k]))
        .collect();
    let is_true = |d: f64| d.abs().min((d.abs() - length).abs()) < 0.05 * length;
    let true_ones: Vec<Sample> = places
        .iter()
        .zip(subject.distances(&begins))
        .filter(|(_, d)| is_true(*d))
        .map(|(s, _)| *s)
        .collect();
    if true_ones.len() as f64 > 0.5 * places.len() as f64 {
        DimensionForm::Offset {
            length,
            places: true_ones,
        }
    } else {
        DimensionForm::Place(places)
    }
}

/// The size of the model: the diagonal of its samples.
fn extent(samples: &[Sample]) -> f64 {
    isoform::geom::Aabb::from_points(samples.iter().map(|s| &s.at)).diagonal()
}

/// Determines the form of a parameter from the motion of the surface.
fn form(moved: &[Moved], still: &[Sample], kind: Kind, value: f64, size: f64) -> DimensionForm {
    if moved.is_empty() {
        return DimensionForm::Nothing;
    }
    let fast = fastest(moved);
    let measured = match kind {
        Kind::Length | Kind::Number if value > 0.0 => length(&fast, still, value, size),
        Kind::X => position(moved, 0, value, size),
        Kind::Y => position(moved, 1, value, size),
        Kind::Z => position(moved, 2, value, size),
        _ => None,
    };
    measured.unwrap_or_else(|| {
        let mut places: Vec<&Moved> = fast;
        places.sort_by(|a, b| b.speed.abs().total_cmp(&a.speed.abs()));
        DimensionForm::Place(places.iter().map(|m| m.sample).collect())
    })
}

/// The points that move about as fast as the fastest, of which 2 % are left out of account, because
/// they lie on edges and tips.
fn fastest(moved: &[Moved]) -> Vec<&Moved> {
    let mut speeds: Vec<f64> = moved.iter().map(|m| m.speed.abs()).collect();
    speeds.sort_by(f64::total_cmp);
    let top = speeds[(speeds.len() - 1) * 49 / 50];
    moved
        .iter()
        .filter(|m| m.speed.abs() > FAST * top)
        .collect()
}

/// Speed 1 or ½, if that is what most points have.
fn common_speed(fast: &[&Moved]) -> Option<f64> {
    [1.0, 0.5].into_iter().find(|w| {
        let near = fast.iter().filter(|m| (m.speed.abs() - w).abs() < SPEED);
        near.count() as f64 > SOME * fast.len() as f64
    })
}

/// A length as the first form that fits: linear, round, offset.
fn length(fast: &[&Moved], still: &[Sample], value: f64, size: f64) -> Option<DimensionForm> {
    let speed = common_speed(fast)?;
    linear(fast, still, value, speed, size)
        .or_else(|| round(fast, value, speed, size))
        .or_else(|| {
            (speed == 1.0 && value < 0.6 * size).then(|| DimensionForm::Offset {
                length: value,
                places: fast.iter().map(|m| heading(m)).collect(),
            })
        })
}

/// The sample with the direction in which it moves in place of its normal.
fn heading(m: &Moved) -> Sample {
    Sample {
        at: m.sample.at,
        normal: m.sample.normal.map(|v| v * m.speed.signum()),
    }
}

/// All move along one direction: by 1 on one side or by ½ apart.
fn linear(
    fast: &[&Moved],
    still: &[Sample],
    value: f64,
    speed: f64,
    size: f64,
) -> Option<DimensionForm> {
    let headings: Vec<Point3> = fast.iter().map(|m| heading(m).normal).collect();
    let along = common_direction(&headings)?;
    let side = |sign: f64| -> Vec<Sample> {
        let group = fast.iter().zip(&headings);
        let group = group.filter(|(_, h)| sign * dot(**h, along) > ALONG);
        group.map(|(m, _)| m.sample).collect()
    };
    let (ahead, behind) = (side(1.0), side(-1.0));
    if speed != 1.0 {
        two_sided(&behind, &ahead, along, value, size)
    } else if ahead.len() < behind.len() {
        one_sided(behind, still, along.map(|v| -v), value, size)
    } else {
        one_sided(ahead, still, along, value, size)
    }
}

/// Returns the number of headings along `e` or against it.
fn aligned(headings: &[Point3], e: Point3) -> usize {
    headings
        .iter()
        .filter(|h| dot(**h, e).abs() > ALONG)
        .count()
}

/// The direction, out of a few headings and the axes of the frame, that most headings lead along;
/// none if too few do.
fn common_direction(headings: &[Point3]) -> Option<Point3> {
    let tries = 7.min(headings.len());
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let some = (0..tries).map(|i| headings[i * headings.len() / tries]);
    let along = some.chain(axes).max_by_key(|e| aligned(headings, *e))?;
    let is_common = aligned(headings, along) as f64 >= MOST * headings.len() as f64;
    is_common.then_some(along)
}

/// A length whose far side moves and whose foot rests.
fn one_sided(
    moved: Vec<Sample>,
    still: &[Sample],
    along: Point3,
    value: f64,
    size: f64,
) -> Option<DimensionForm> {
    let (to, is_middle) = level(&moved, still, along, value, size)?;
    let far = if is_middle {
        moved
    } else {
        at_level(&moved, along, to, size)
    };
    Some(DimensionForm::Linear {
        along,
        from: to - value,
        to,
        near: Vec::new(),
        far,
    })
}

/// A length both of whose sides move, apart.
fn two_sided(
    behind: &[Sample],
    ahead: &[Sample],
    along: Point3,
    value: f64,
    size: f64,
) -> Option<DimensionForm> {
    let to = ahead
        .iter()
        .map(|s| dot(s.at, along))
        .max_by(f64::total_cmp)?;
    let from = behind
        .iter()
        .map(|s| dot(s.at, along))
        .min_by(f64::total_cmp)?;
    ((to - from - value).abs() < 0.02 * value).then(|| DimensionForm::Linear {
        along,
        from,
        to,
        near: at_level(behind, along, from, size),
        far: at_level(ahead, along, to, size),
    })
}

/// The samples near a level.
fn at_level(samples: &[Sample], along: Point3, level: f64, size: f64) -> Vec<Sample> {
    let near = |s: &&Sample| (dot(s.at, along) - level).abs() < 2.0 * LEVEL * size;
    samples.iter().filter(near).copied().collect()
}

/// The level that a length leads to, and whether it is the middle of a hole or boss that moves as
/// one. Where several levels move, it is the one for which there is a face to measure from that
/// does not; else the one that most points have.
fn level(
    moved: &[Sample],
    still: &[Sample],
    along: Point3,
    value: f64,
    size: f64,
) -> Option<(f64, bool)> {
    let mut levels: Vec<f64> = moved.iter().map(|s| dot(s.at, along)).collect();
    levels.sort_by(f64::total_cmp);
    let footing = |at: f64| {
        let foot = still.iter().filter(|s| {
            (dot(s.at, along) - at + value).abs() < LEVEL * size
                && dot(s.normal, along).abs() > ALONG
        });
        foot.count().min(4)
    };
    // A dome has its level at its top.
    let groups = levels.chunk_by(|a, b| b - a < LEVEL * size);
    let mut found: Vec<(usize, f64, bool)> =
        groups.map(|g| (g.len(), g[g.len() - 1], false)).collect();
    let forward = moved.iter().filter(|s| dot(s.normal, along) > 0.0).count();
    if (1..moved.len()).contains(&forward) {
        let middle = 0.5 * (levels[0] + levels[levels.len() - 1]);
        found.push((levels.len(), middle, true));
    }
    found
        .into_iter()
        .max_by_key(|(n, at, _)| (footing(*at), *n))
        .map(|(_, at, is_middle)| (at, is_middle))
}

/// All have their beginnings in few places, seen along the axis of their normals.
fn round(fast: &[&Moved], value: f64, speed: f64, size: f64) -> Option<DimensionForm> {
    let axis = axis(fast);
    let fast: Vec<&Moved> = fast
        .iter()
        .filter(|m| axis.is_none_or(|z| dot(z, m.sample.normal).abs() < ABOUT))
        .copied()
        .collect();
    let begins: Vec<Point3> = fast.iter().map(|m| beginning(m, value, axis)).collect();
    let groups = crowds(&begins, value, size)?;
    let held: usize = groups.iter().map(Vec::len).sum();
    let is_true = (held as f64) > MOST * fast.len() as f64 && groups.len() <= MOST_ROUNDS;
    let best = groups.iter().max_by_key(|g| g.len()).filter(|_| is_true)?;
    let firsts: Vec<Point3> = groups.iter().map(|g| begins[g[0]]).collect();
    if !are_apart(&firsts, value) {
        return None;
    }
    let mut center = mean(best.iter().map(|i| begins[*i]));
    if let Some(z) = axis {
        let height = dot(z, mean(best.iter().map(|i| fast[*i].sample.at)));
        center = std::array::from_fn(|k| center[k] + height * z[k]);
    }
    Some(DimensionForm::Round {
        center,
        axis,
        rim: best.iter().map(|i| fast[*i].sample).collect(),
        is_diameter: speed != 1.0,
        radius: speed * value,
        count: groups.len(),
    })
}

/// The place p − a w n where a length begins, moved along the axis into the plane through the
/// origin.
fn beginning(m: &Moved, value: f64, axis: Option<Point3>) -> Point3 {
    let s = &m.sample;
    let begin: Point3 = std::array::from_fn(|k| s.at[k] - value * m.speed * s.normal[k]);
    axis.map_or(begin, |z| sub(begin, z.map(|v| v * dot(z, begin))))
}

/// Clusters beginnings, and returns the indices of each cluster but small ones; `None` if there are
/// far too many clusters.
fn crowds(begins: &[Point3], value: f64, size: f64) -> Option<Vec<Vec<usize>>> {
    // Walls that slope have another radius at each height, and beginnings about the axis by as
    // much; other rounds of the kind are two radii off at least, or they would touch.
    let together = (0.3 * value).max(0.003 * size);
    let close = |i: usize, j: usize| norm(sub(begins[i], begins[j])) < together;
    let mut left: Vec<usize> = (0..begins.len()).collect();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    while let Some(first) = crowded(&left, close) {
        let (group, rest) = left.into_iter().partition(|i| close(*i, first));
        left = rest;
        groups.push(group);
        if groups.len() > 8 * MOST_ROUNDS {
            return None;
        }
    }
    let most = groups.iter().map(Vec::len).max()?;
    groups.retain(|g: &Vec<usize>| g.len() >= 4 && 3 * g.len() > most);
    Some(groups)
}

/// Returns true if no two rounds lie within each other, as the rounds of a torus or of a blend do.
fn are_apart(middles: &[Point3], radius: f64) -> bool {
    let is_apart = |i: usize, j: usize| norm(sub(middles[i], middles[j])) > 1.2 * radius;
    (0..middles.len()).all(|i| (0..i).all(|j| is_apart(i, j)))
}

/// The mean of points.
fn mean(points: impl ExactSizeIterator<Item = Point3> + Clone) -> Point3 {
    let n = points.len() as f64;
    std::array::from_fn(|k| points.clone().map(|p| p[k]).sum::<f64>() / n)
}

/// Candidates for the middle of a round; more find it better where the wall has many radii.
const MIDDLES: usize = 24;

/// One of those with most of the others close by.
fn crowded(all: &[usize], close: impl Fn(usize, usize) -> bool) -> Option<usize> {
    let stride = all.len().div_ceil(MIDDLES).max(1);
    let some = all.iter().copied().step_by(stride);
    some.max_by_key(|i| all.iter().filter(|j| close(*i, **j)).count())
}

/// The direction about which most normals lie, an axis of the frame if one does; none for normals
/// all around.
fn axis(fast: &[&Moved]) -> Option<Point3> {
    let mut scatter = [0.0; 9];
    for m in fast {
        for i in 0..9 {
            scatter[i] += m.sample.normal[i / 3] * m.sample.normal[i % 3];
        }
    }
    let (_, vectors) = symmetric_eigen(&scatter, 3);
    let thinnest = [vectors[0], vectors[1], vectors[2]];
    let about = |z: &Point3| {
        let flat = fast
            .iter()
            .filter(|m| dot(*z, m.sample.normal).abs() < ABOUT);
        flat.count()
    };
    let axes = [thinnest, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let best = axes.into_iter().max_by_key(about)?;
    (about(&best) as f64 > SOME * fast.len() as f64).then_some(best)
}

/// The middle between the least and the largest of some numbers.
fn middle(levels: impl Iterator<Item = f64>) -> f64 {
    let (lo, hi) = levels.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    0.5 * (lo + hi)
}

/// A coordinate: what moves does so as one, and lies there, or its middle does.
fn position(moved: &[Moved], axis: usize, value: f64, size: f64) -> Option<DimensionForm> {
    let wrong = moved
        .iter()
        .filter(|m| (m.speed - m.sample.normal[axis]).abs() > 0.1);
    if wrong.count() as f64 > (1.0 - MOST) * moved.len() as f64 || value.abs() < 0.03 * size {
        return None;
    }
    let levels = moved.iter().map(|m| m.sample.at[axis]);
    let is_middle = (middle(levels) - value).abs() < 0.02 * size;
    let far: Vec<Sample> = moved
        .iter()
        .map(|m| m.sample)
        .filter(|s| is_middle || (s.at[axis] - value).abs() < 0.02 * size)
        .collect();
    let mut along = [0.0; 3];
    along[axis] = value.signum();
    (!far.is_empty()).then_some(DimensionForm::Linear {
        along,
        from: 0.0,
        to: value.abs(),
        near: Vec::new(),
        far,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(at: Point3, normal: Point3, speed: f64) -> Moved {
        Moved {
            sample: Sample { at, normal },
            speed,
        }
    }

    /// A wall of radius 2 about (1, 0, z) for three heights, whose normals lead out (1) or in (-1).
    fn wall(center: f64, side: f64, speed: f64) -> Vec<Moved> {
        (0..90)
            .map(|i| {
                let (t, z) = (f64::from(i) * 0.7, f64::from(i % 3));
                let n = [t.cos(), t.sin(), 0.0];
                let at = [center + 2.0 * n[0], 2.0 * n[1], z];
                moved(at, n.map(|v| side * v), speed)
            })
            .collect()
    }

    #[test]
    fn radii_and_diameters() {
        for (side, speed, value) in [(1.0, 1.0, 2.0), (-1.0, -1.0, 2.0), (1.0, 0.5, 4.0)] {
            let found = form(&wall(1.0, side, speed), &[], Kind::Length, value, 10.0);
            let DimensionForm::Round {
                center,
                axis,
                is_diameter,
                radius,
                count,
                ..
            } = found
            else {
                panic!("{found:?}");
            };
            assert!(
                (center[0] - 1.0).abs() < 1e-9 && center[1].abs() < 1e-9,
                "{center:?}"
            );
            assert!(axis.is_some_and(|z| z[2].abs() > 0.999));
            assert_eq!((is_diameter, radius, count), (value == 4.0, 2.0, 1));
        }
        // Two holes of one radius.
        let mut two = wall(1.0, -1.0, -1.0);
        two.extend(wall(9.0, -1.0, -1.0));
        let found = form(&two, &[], Kind::Length, 2.0, 20.0);
        assert!(
            matches!(found, DimensionForm::Round { count: 2, .. }),
            "{found:?}"
        );
    }

    #[test]
    fn heights_and_places() {
        let plate = |z: f64, up: f64, speed: f64| -> Vec<Moved> {
            let at = (0..20).map(|i| [f64::from(i % 5), f64::from(i / 5), z]);
            at.map(|p| moved(p, [0.0, 0.0, up], speed)).collect()
        };
        let ends = |form: DimensionForm| match form {
            DimensionForm::Linear {
                along, from, to, ..
            } => (along[2], from, to),
            other => panic!("{other:?}"),
        };
        // A height from the foot, and one about the middle.
        let top = plate(3.0, 1.0, 1.0);
        assert_eq!(
            ends(form(&top, &[], Kind::Length, 3.0, 8.0)),
            (1.0, 0.0, 3.0)
        );
        let mut both = plate(1.5, 1.0, 0.5);
        both.extend(plate(-1.5, -1.0, 0.5));
        let (_, from, to) = ends(form(&both, &[], Kind::Length, 3.0, 8.0));
        assert_eq!((from.abs(), to.abs(), to - from), (1.5, 1.5, 3.0));
        // A hole at x = 5 that moves as one is measured to its middle.
        let hole: Vec<Moved> = wall(5.0, -1.0, 1.0)
            .into_iter()
            .map(|m| moved(m.sample.at, m.sample.normal, m.sample.normal[0]))
            .collect();
        let DimensionForm::Linear { from, to, .. } = form(&hole, &[], Kind::Length, 5.0, 12.0)
        else {
            panic!("a place along x");
        };
        assert!(from.abs() < 0.02 && (to - 5.0).abs() < 0.02, "{from} {to}");
        // A ratio is shown where it acts; what acts nowhere is said to.
        assert!(
            matches!(form(&top, &[], Kind::Ratio, 3.0, 8.0), DimensionForm::Place(p) if p.len() == 20)
        );
        assert!(matches!(
            form(&[], &[], Kind::Length, 3.0, 8.0),
            DimensionForm::Nothing
        ));
    }
}
