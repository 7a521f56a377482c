//! Patterns: equal entities in a row at equal distances, and on a circle at equal angles.
//!
//! Chains grow from two or three neighbours by the next entity at its predicted place, as long as a
//! common fit (one surface, moved on by the pitch) is consistent with all entities together and one
//! by one.

mod chain;
mod circles;
mod rows;
mod sites;

use crate::chart::Primitive;
use crate::entity::{Layout, Pattern};
use crate::relations::EntitySet;
use chain::Chain;
use isoform_geom::{Point3, cross, norm, sub};
use sites::{MAX_STEP_ERROR, Sites, classes};

/// Returns the patterns among entities; lengths are in units of `unit` about `origin`.
pub(crate) fn patterns(set: &EntitySet<'_>, (unit, origin): (f64, Point3)) -> Vec<Pattern> {
    let mut found = Vec::new();
    for class in classes(set.known, set.outward, set.noise) {
        let sites = Sites::new(set.known, &class);
        let rows = accepted(rows::rows(&sites), &sites, Vec::new());
        let all = accepted(circles::circles(&sites, &rows), &sites, rows);
        found.extend(all.iter().map(|c| pattern(c, &sites, unit, origin)));
    }
    found.sort_by(|a, b| (b.members.len(), &a.members).cmp(&(a.members.len(), &b.members)));
    found
}

/// Adds chains, longest first, that do not follow from others.
fn accepted(mut new: Vec<Chain>, sites: &Sites<'_>, mut all: Vec<Chain>) -> Vec<Chain> {
    new.sort_by(|a, b| {
        let length = b.members.len().cmp(&a.members.len());
        let has_axis = |c: &Chain| c.circle.is_some_and(|c| c.coaxial.is_some());
        length
            .then(has_axis(b).cmp(&has_axis(a)))
            .then(a.pitch(sites).total_cmp(&b.pitch(sites)))
            .then(a.members.cmp(&b.members))
    });
    for chain in new {
        let is_part = all.iter().any(|c| chain.is_part_of(c));
        if !is_part && !is_implied(&chain, &all) {
            all.push(chain);
        }
    }
    all
}

/// Returns true if a chain follows from a grid or a circle: a row of members of other rows whose
/// step is a sum of theirs; a square, or three about an axis, in rows; a circle each of whose
/// members is in a row with its neighbour; an arc that branches off another circle.
fn is_implied(chain: &Chain, all: &[Chain]) -> bool {
    let of = |m: usize| {
        let holds = move |r: &&Chain| r.circle.is_none() && r.members.contains(&m);
        all.iter().filter(holds)
    };
    let Some(circle) = chain.circle else {
        return chain.members.iter().all(|m| of(*m).count() > 0) && is_made(chain.step, all);
    };
    let n = chain.members.len();
    let is_beside = |k: usize| {
        let beside = [(k + 1) % n, (k + n - 1) % n].map(|b| chain.members[b]);
        of(chain.members[k]).any(|r| beside.iter().any(|b| r.members.contains(b)))
    };
    // Circles of at most four members come from grids.
    let is_square = n <= 4 && chain.members.iter().all(|m| of(*m).count() > 0);
    let leaves = |c: &Chain| {
        let shared = chain.members.iter().filter(|m| c.members.contains(m));
        // An arc that shares three members with another circle is a worse guess of that one.
        c.circle.is_some() && shared.count() >= 3
    };
    let is_branch = !circle.is_closed && all.iter().any(leaves);
    is_square || (0..n).all(is_beside) || is_branch
}

/// Returns true if a step is a sum of small multiples of the steps of two rows that are not
/// parallel.
fn is_made(step: Point3, all: &[Chain]) -> bool {
    let steps: Vec<Point3> = all
        .iter()
        .filter(|r| r.circle.is_none())
        .map(|r| r.step)
        .collect();
    // The step of a diagonal contains at most three of each row.
    let multiples = || (-3..=3).filter(|k| *k != 0).map(f64::from);
    let is_sum = |p: &Point3, q: &Point3| {
        multiples().any(|a| {
            multiples().any(|b| {
                let off = |k: usize| step[k] - a * p[k] - b * q[k];
                norm(std::array::from_fn(off)) <= MAX_STEP_ERROR * norm(step)
            })
        })
    };
    let are_across =
        |p: &Point3, q: &Point3| norm(cross(*p, *q)) > MAX_STEP_ERROR * norm(*p) * norm(*q);
    let mut pairs = steps.iter().flat_map(|p| steps.iter().map(move |q| (p, q)));
    pairs.any(|(p, q)| are_across(p, q) && is_sum(p, q))
}

/// Returns a chain as a pattern in the scan's unit.
fn pattern(chain: &Chain, sites: &Sites<'_>, unit: f64, origin: Point3) -> Pattern {
    let layout = match chain.circle {
        None => Layout::Row {
            direction: crate::chart::unit(chain.step),
            spacing: norm(chain.step) * unit,
            spacing_deviation: chain.deviations[0] * unit,
        },
        Some(circle) => {
            let foot = Primitive::about(&circle.line, chain.first.place).place;
            let radius = norm(sub(chain.first.place, foot));
            Layout::Circle {
                center: std::array::from_fn(|k| foot[k] * unit + origin[k]),
                axis: circle.line.axis,
                radius: radius * unit,
                radius_deviation: chain.deviations[0] * unit,
                angle: circle.angle,
                angle_deviation: chain.deviations[1],
                is_closed: circle.is_closed,
                coaxial: circle.coaxial,
            }
        }
    };
    Pattern {
        members: chain.members.iter().map(|m| sites.entities(*m)).collect(),
        layout,
        deviation: chain.off * unit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{MAX_PARAMETERS, PrimitiveKind, frame};
    use crate::relations::UncertainSurface;
    use std::f64::consts::TAU;

    /// Standard deviations of the parameters in these tests.
    const PARAMETER_DEVIATION: f64 = 1e-4;

    fn surface(kind: PrimitiveKind, place: Point3, axis: Point3) -> Primitive {
        Primitive {
            kind,
            place,
            axis,
            size: 0.05,
            other: if kind == PrimitiveKind::Torus {
                0.01
            } else {
                0.4
            },
        }
    }

    /// Patterns of surfaces, each moved by up to a deviation or so in all parameters.
    fn found(surfaces: &[Primitive]) -> Vec<Pattern> {
        let mut random = isoform_num::Random::new(3);
        let known = |s: &Primitive| {
            let mut covariance = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
            (0..s.kind.parameters())
                .for_each(|k| covariance[k][k] = PARAMETER_DEVIATION * PARAMETER_DEVIATION);
            UncertainSurface {
                surface: s.moved(
                    &[(); MAX_PARAMETERS].map(|()| PARAMETER_DEVIATION * random.symmetric()),
                ),
                covariance,
            }
        };
        let known: Vec<UncertainSurface> = surfaces.iter().map(known).collect();
        let set = EntitySet {
            known: &known,
            outward: &vec![1; known.len()],
            points: &[],
            noise: PARAMETER_DEVIATION,
        };
        patterns(&set, (1.0, [0.0; 3]))
    }

    /// Returns places on a circle about an axis.
    fn places(n: usize, axis: Point3) -> Vec<Point3> {
        let [e, f] = frame(axis);
        let place = |k: usize| {
            let (sin, cos) = (TAU * k as f64 / n as f64).sin_cos();
            std::array::from_fn(|i| 0.1 + 0.3 * (cos * e[i] + sin * f[i]))
        };
        (0..n).map(place).collect()
    }

    #[test]
    fn balls_cones_and_tori_on_a_circle_are_one() {
        let axis = crate::chart::unit([1.0, -2.0, 0.5]);
        for kind in [
            PrimitiveKind::Sphere,
            PrimitiveKind::Cylinder,
            PrimitiveKind::Cone,
            PrimitiveKind::Torus,
        ] {
            let all: Vec<Primitive> = places(5, axis)
                .into_iter()
                .enumerate()
                .map(|(k, p)| {
                    // Cones may begin at different heights, and axes point either way.
                    let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                    let mut s = surface(kind, p, axis.map(|x| sign * x));
                    if kind == PrimitiveKind::Cone {
                        s.other *= sign;
                        s.size += 0.01 * k as f64;
                    }
                    s
                })
                .collect();
            let [pattern] = &found(&all)[..] else {
                panic!("{kind:?}: {:?}", found(&all));
            };
            let Layout::Circle {
                radius, is_closed, ..
            } = pattern.layout
            else {
                panic!("{pattern:?}");
            };
            assert!(
                is_closed && (radius - 0.3).abs() < 3.0 * PARAMETER_DEVIATION,
                "{pattern:?}"
            );
            assert!(pattern.deviation > 0.0 && pattern.deviation < 4.0 * PARAMETER_DEVIATION);
            // One out of the circle: what is left of five is an arc of four.
            let mut off = all.clone();
            off[2].place = std::array::from_fn(|k| all[2].place[k] * 1.05 - 0.005);
            let members: Vec<usize> = found(&off).iter().map(|p| p.members.len()).collect();
            assert_eq!(members, [4], "{kind:?}");
        }
    }

    #[test]
    fn tori_along_an_axis_and_balls_on_a_line_are_rows() {
        let axis = crate::chart::unit([1.0, -2.0, 0.5]);
        for kind in [PrimitiveKind::Sphere, PrimitiveKind::Torus] {
            let at = |k: f64| surface(kind, axis.map(|x| 0.07 * k * x), axis);
            let all: Vec<Primitive> = [3.0, 0.0, 2.0, 1.0, 5.0].map(at).to_vec();
            let [pattern] = &found(&all)[..] else {
                panic!("{kind:?}: {:?}", found(&all));
            };
            assert_eq!(pattern.members, [[0], [2], [3], [1]]);
            let Layout::Row { spacing, .. } = pattern.layout else {
                panic!("{pattern:?}");
            };
            assert!((spacing - 0.07).abs() < 3.0 * PARAMETER_DEVIATION);
        }
    }

    #[test]
    fn pieces_of_one_bore_are_one_member_and_other_radii_none() {
        let at = |x: f64, z: f64| surface(PrimitiveKind::Cylinder, [x, 0.0, z], [0.0, 0.0, 1.0]);
        let mut all = [at(0.0, 0.0), at(0.1, 0.0), at(0.2, 0.0), at(0.1, 0.3)].to_vec();
        let members = |all: &[Primitive]| -> Vec<Vec<Vec<usize>>> {
            found(all).into_iter().map(|p| p.members).collect()
        };
        assert_eq!(members(&all), [[vec![0], vec![1, 3], vec![2]]]);
        all[2].size += 20.0 * PARAMETER_DEVIATION;
        assert_eq!(members(&all), [] as [Vec<Vec<usize>>; 0]);
    }
}
