//! Patterns: equal entities in a row at equal distances, and on a circle at equal angles.
//!
//! Chains grow from two or three neighbours by the next entity at its predicted place, as long as a
//! common fit (one surface, moved on by the pitch) is consistent with all entities together and one
//! by one.

mod chain;
mod circles;
mod rows;
mod sites;

use crate::chart::Surface;
use crate::entity::{Layout, Pattern};
use crate::symmetry::Set;
use chain::Chain;
pub(crate) use chain::turned;
use isoform_geom::{Point3, cross, norm, sub};
use sites::{Sites, classes};

/// Maximum multiple of each of two rows' steps in the step of a diagonal.
const STEPS: i32 = 3;
const OFF: f64 = 0.05;
/// Circles of this many members and less come from grids.
const SQUARE: usize = 4;
/// An arc that has this many members with another circle in common is a worse guess of that.
const ARC: usize = 3;

/// Returns the patterns among entities; lengths are in units of `unit` about `origin`.
pub(crate) fn patterns(set: &Set<'_>, (unit, origin): (f64, Point3)) -> Vec<Pattern> {
    let mut found = Vec::new();
    for class in classes(set.known, set.outward, set.noise) {
        let sites = Sites::of(set.known, &class);
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
    let is_square = n <= SQUARE && chain.members.iter().all(|m| of(*m).count() > 0);
    let leaves = |c: &Chain| {
        let shared = chain.members.iter().filter(|m| c.members.contains(m));
        c.circle.is_some() && shared.count() >= ARC
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
    let multiples = || (-STEPS..=STEPS).filter(|k| *k != 0).map(f64::from);
    let is_sum = |p: &Point3, q: &Point3| {
        multiples().any(|a| {
            multiples().any(|b| {
                let off = |k: usize| step[k] - a * p[k] - b * q[k];
                norm(std::array::from_fn(off)) <= OFF * norm(step)
            })
        })
    };
    let are_across = |p: &Point3, q: &Point3| norm(cross(*p, *q)) > OFF * norm(*p) * norm(*q);
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
            let foot = Surface::about(&circle.line, chain.first.place).place;
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
    use crate::chart::{Kind, MOST, frame};
    use crate::relations::Known;
    use std::f64::consts::TAU;

    /// Standard deviations of the parameters in these tests.
    const SIGMA: f64 = 1e-4;

    fn surface(kind: Kind, place: Point3, axis: Point3) -> Surface {
        Surface {
            kind,
            place,
            axis,
            size: 0.05,
            other: if kind == Kind::Torus { 0.01 } else { 0.4 },
        }
    }

    /// Patterns of surfaces, each moved by up to a deviation or so in all parameters.
    fn found(surfaces: &[Surface]) -> Vec<Pattern> {
        let mut random = isoform_num::Random::new(3);
        let known = |s: &Surface| {
            let mut covariance = [[0.0; MOST]; MOST];
            (0..s.kind.parameters()).for_each(|k| covariance[k][k] = SIGMA * SIGMA);
            Known {
                surface: s.moved(&[(); MOST].map(|()| SIGMA * random.symmetric())),
                covariance,
            }
        };
        let known: Vec<Known> = surfaces.iter().map(known).collect();
        let set = Set {
            known: &known,
            outward: &vec![1; known.len()],
            points: &[],
            noise: SIGMA,
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
        for kind in [Kind::Sphere, Kind::Cylinder, Kind::Cone, Kind::Torus] {
            let all: Vec<Surface> = places(5, axis)
                .into_iter()
                .enumerate()
                .map(|(k, p)| {
                    // Cones may begin at different heights, and axes point either way.
                    let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                    let mut s = surface(kind, p, axis.map(|x| sign * x));
                    if kind == Kind::Cone {
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
                is_closed && (radius - 0.3).abs() < 3.0 * SIGMA,
                "{pattern:?}"
            );
            assert!(pattern.deviation > 0.0 && pattern.deviation < 4.0 * SIGMA);
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
        for kind in [Kind::Sphere, Kind::Torus] {
            let at = |k: f64| surface(kind, axis.map(|x| 0.07 * k * x), axis);
            let all: Vec<Surface> = [3.0, 0.0, 2.0, 1.0, 5.0].map(at).to_vec();
            let [pattern] = &found(&all)[..] else {
                panic!("{kind:?}: {:?}", found(&all));
            };
            assert_eq!(pattern.members, [[0], [2], [3], [1]]);
            let Layout::Row { spacing, .. } = pattern.layout else {
                panic!("{pattern:?}");
            };
            assert!((spacing - 0.07).abs() < 3.0 * SIGMA);
        }
    }

    #[test]
    fn pieces_of_one_bore_are_one_member_and_other_radii_none() {
        let at = |x: f64, z: f64| surface(Kind::Cylinder, [x, 0.0, z], [0.0, 0.0, 1.0]);
        let mut all = [at(0.0, 0.0), at(0.1, 0.0), at(0.2, 0.0), at(0.1, 0.3)].to_vec();
        let members = |all: &[Surface]| -> Vec<Vec<Vec<usize>>> {
            found(all).into_iter().map(|p| p.members).collect()
        };
        assert_eq!(members(&all), [[vec![0], vec![1, 3], vec![2]]]);
        all[2].size += 20.0 * SIGMA;
        assert_eq!(members(&all), [] as [Vec<Vec<usize>>; 0]);
    }
}
