//! Joint refit of all entities such that their relations hold exactly.
//!
//! Each entity's own fit minimises the sum of squares of its distances, divided by their variance,
//! at its parameters p₀. The total over all entities is minimised subject to g(p) = 0, where g
//! holds the relations: p₀ moves by −W (b + Gᵀ λ), (G W Gᵀ) λ = g − G W b, with the covariance W of
//! p₀, the derivatives G of g, and the gradient b = Jᵀ (r(p) − r(p₀)) of the true distances r;
//! steps are repeated to rounding (Gauss–Newton; J is that at p₀). The covariance afterwards is P W
//! Pᵀ with P = 1 − W Gᵀ (G W Gᵀ)⁻¹ G.
//!
//! Relations implied by others are left out of g. A condition without which the sum would be less
//! by more than χ² allows contradicts the points: its relations are dropped, worst first.

use crate::accuracy::variance;
use crate::chart::{MAX_PARAMETERS, ParameterRow, Primitive, PrimitiveKind, ROUNDING_DEVIATION};
use crate::cloud::{Cloud, Scaling, sorted};
use crate::entity::{Recognition, Relation};
use crate::fit::{mean, squares};
use crate::noise::MAX_EXACT_NOISE;
use crate::recognize::deviations_of;
use crate::relations::{PairFrame, UncertainSurface, failure, relation};
use crate::segment::Segmentation;
use conditions::{Condition, conditions, split};
use entity::{SnapEntity, snap_entity};
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, PointCloud};
use solve::EquationSystem;

mod conditions;
mod entity;
mod solve;

/// Changes made by [`snap`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snap {
    /// Largest motion of each entity at its points along their normals, in the scan's unit.
    pub moved: Vec<f64>,
    /// Root mean square distance of all entities' points before and after.
    pub rms: [f64; 2],
    /// Increase of the sum of squares, in variances of the points: χ² with `conditions` degrees of
    /// freedom if the relations are true.
    pub chi_squared: f64,
    /// Number of independent equations that hold now.
    pub conditions: usize,
    /// Relations that contradict the points or one another, as they were found.
    pub dropped: Vec<Relation>,
}

/// Refits the entities recognised in a scan so that their relations hold to rounding; relations
/// that cannot hold are dropped.
///
/// # Errors
/// [`Stopped`].
pub fn snap(
    scan: &PointCloud,
    found: &Recognition,
    control: &Control<'_>,
) -> Result<(Recognition, Snap), Stopped> {
    control.begin("snap")?;
    let (places, index) = sorted(&scan.points);
    let Some(mut scaling) = Scaling::from_points(&places) else {
        return Ok((found.clone(), Snap::default()));
    };
    let mut members = vec![Vec::new(); found.entities.len()];
    let mut labels = vec![None; places.len()];
    for (place, label) in index.iter().zip(&found.labels) {
        labels[*place as usize] = *label;
    }
    for (p, label) in places.iter().zip(&labels) {
        if let Some(l) = label {
            members[*l as usize].push(scaling.apply(*p));
        }
    }
    for k in 0..3 {
        scaling.origin[k] += scan.origin[k];
    }
    let all = members.into_iter().enumerate();
    let owns: Vec<SnapEntity> = all
        .map(|(i, p)| snap_entity(found, i, p, &scaling))
        .collect();
    let (relations, dropped, solved) = consistent(&owns, &found.relations, control)?;
    let new = report(found, &owns, relations, &solved, &scaling);
    let snap = Snap {
        dropped,
        ..changes(&owns, &solved, &scaling)
    };
    Ok((new, snap))
}

/// Returns the surfaces of entities refitted together so that relations hold, though the points may
/// contradict them; an error with a relation that the others exclude.
pub(crate) fn imposed(
    cloud: &Cloud,
    found: &Segmentation,
    relations: &[Relation],
) -> Result<Vec<Primitive>, Relation> {
    let own = |(label, members): (usize, &Vec<u32>)| {
        let points = cloud.at(members);
        let surface = found.surfaces[label].about(mean(&points));
        let variance = variance(found, label, &surface, &points);
        (surface, points, variance.max(MAX_EXACT_NOISE.powi(2)))
    };
    let all: Vec<_> = found.members().iter().enumerate().map(own).collect();
    // Only the ratios of the variances count. All are made large against the rounding that
    // equations allow for.
    let least = all.iter().map(|own| own.2).fold(f64::INFINITY, f64::min);
    let owns = all.into_iter().map(|(surface, points, variance)| {
        let variance = 1e-6 * variance / least;
        SnapEntity {
            known: UncertainSurface::from_points(surface, &points, variance),
            sigma: variance.sqrt(),
            points,
        }
    });
    let owns: Vec<SnapEntity> = owns.collect();
    let (solved, _) = solve(&owns, &conditions(relations, owns.len()));
    let off = |r: &&Relation| {
        let pair = r.entities.map(|i| &solved.surfaces[i]);
        let off = failure(r.kind, &PairFrame::from_pair(pair), pair).size();
        off.is_nan() || off > ROUNDING_DEVIATION
    };
    match relations.iter().find(off) {
        Some(relation) => Err(*relation),
        None => Ok(solved.surfaces),
    }
}

/// Entities that satisfy the conditions.
struct SnapSolution {
    surfaces: Vec<Primitive>,
    steps: Vec<ParameterRow>,
    covariances: Vec<[ParameterRow; MAX_PARAMETERS]>,
    conditions: usize,
}

/// Returns the relations that hold together, those that do not, and the entities.
fn consistent(
    owns: &[SnapEntity],
    relations: &[Relation],
    control: &Control<'_>,
) -> Result<(Vec<Relation>, Vec<Relation>, SnapSolution), Stopped> {
    let is_known = |r: &&Relation| {
        let of = |i: usize| owns[i].known.covariance[0][0].is_finite();
        r.entities.into_iter().all(of)
    };
    let mut kept: Vec<Relation> = relations.iter().filter(is_known).copied().collect();
    let mut dropped = Vec::new();
    loop {
        control.check()?;
        let conditions = conditions(&kept, owns.len());
        let (solved, worst) = solve(owns, &conditions);
        let Some(worst) = worst else {
            return Ok((kept, dropped, solved));
        };
        let (without, held) = split(kept, &conditions, worst, owns.len());
        dropped.extend(without);
        kept = held;
    }
}

/// Returns the entities under conditions, and the condition that contradicts most; `None` if all
/// are consistent.
fn solve(owns: &[SnapEntity], conditions: &[Condition]) -> (SnapSolution, Option<usize>) {
    let mut steps = vec![[0.0; MAX_PARAMETERS]; owns.len()];
    let moved = |steps: &[ParameterRow]| -> Vec<Primitive> {
        let all = owns.iter().zip(steps);
        all.map(|(o, s)| o.known.surface.moved(s)).collect()
    };
    let (mut surfaces, mut system, mut lambda) = (moved(&steps), None, Vec::new());
    // Four or five steps are usual.
    for _ in 0..30 {
        let gradients: Vec<ParameterRow> = owns
            .iter()
            .zip(&surfaces)
            .map(|(o, s)| o.gradient(s))
            .collect();
        let now = EquationSystem::new(owns, &steps, conditions);
        let change;
        (lambda, change) = now.step(owns, &gradients);
        let mut largest = 0.0_f64;
        for (step, by) in steps.iter_mut().zip(&change) {
            for (s, d) in step.iter_mut().zip(by) {
                *s += d;
                largest = largest.max(d.abs());
            }
        }
        surfaces = moved(&steps);
        system = Some(now);
        if largest < 1e-15 || !largest.is_finite() {
            break;
        }
    }
    let system = system.expect("there is one step at least");
    let off = |k: usize| {
        let [i, j] = conditions[k].entities;
        let worst = conditions[k].values([&surfaces[i], &surfaces[j]]);
        let size = |v: f64| if v.is_nan() { f64::INFINITY } else { v.abs() };
        worst.into_iter().map(size).fold(0.0, f64::max)
    };
    // Conditions that others seemed to imply, but do not.
    // In radians and diagonals.
    let open = (0..conditions.len()).filter(|k| off(*k) > 1e-12);
    let worst = open.max_by(|a, b| off(*a).total_cmp(&off(*b)));
    let worst = worst.or_else(|| system.contradiction(&lambda));
    let solved = SnapSolution {
        covariances: system.covariances(owns),
        conditions: system.rank(),
        surfaces,
        steps,
    };
    (solved, worst)
}

/// Returns the recognition with the new surfaces.
fn report(
    found: &Recognition,
    owns: &[SnapEntity],
    mut relations: Vec<Relation>,
    solved: &SnapSolution,
    scaling: &Scaling,
) -> Recognition {
    let mut new = found.clone();
    for (i, entity) in new.entities.iter_mut().enumerate() {
        let points = &owns[i].points;
        let surface = solved.surfaces[i];
        if points.is_empty() || solved.steps[i] == [0.0; MAX_PARAMETERS] {
            continue;
        }
        entity.surface = surface.quadric(scaling.unit, scaling.origin);
        entity.deviations = deviations_of(&surface, &solved.covariances[i], scaling);
        entity.rms = (squares(&surface, points) / points.len() as f64).sqrt() * scaling.unit;
        entity.extent = surface.extent(points).map(|h| h * scaling.unit);
    }
    for blend in &mut new.blends {
        let s = &solved.surfaces[blend.entity];
        let radius = if s.kind == PrimitiveKind::Torus {
            s.other
        } else {
            s.size
        };
        blend.radius = radius * scaling.unit;
    }
    for r in &mut relations {
        let pair = r.entities.map(|i| &solved.surfaces[i]);
        let size = failure(r.kind, &PairFrame::from_pair(pair), pair).size();
        *r = relation(r.kind, r.entities, size, scaling.unit);
    }
    new.relations = relations;
    new
}

/// Returns the motion of the entities, and its cost.
fn changes(owns: &[SnapEntity], solved: &SnapSolution, scaling: &Scaling) -> Snap {
    let (mut sums, mut count, mut chi_squared) = ([0.0; 2], 0, 0.0);
    let mut moved = Vec::new();
    for (o, s) in owns.iter().zip(&solved.surfaces) {
        let way = |p: &Point3| (s.distance(*p) - o.known.surface.distance(*p)).abs();
        moved.push(o.points.iter().map(way).fold(0.0, f64::max) * scaling.unit);
        sums[0] += squares(&o.known.surface, &o.points);
        sums[1] += squares(s, &o.points);
        count += o.points.len();
    }
    for (o, (s, step)) in owns.iter().zip(solved.surfaces.iter().zip(&solved.steps)) {
        let gradient = o.gradient(s);
        chi_squared += (0..MAX_PARAMETERS)
            .map(|k| gradient[k] * step[k])
            .sum::<f64>();
    }
    Snap {
        moved,
        rms: sums.map(|s| (s / f64::max(f64::from(count as u32), 1.0)).sqrt() * scaling.unit),
        chi_squared,
        conditions: solved.conditions,
        dropped: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::entity::RelationKind;
    use crate::fit::covariance;

    /// Returns a square of side 1 through the origin, tilted, with known errors.
    fn square(tilt: f64) -> SnapEntity {
        let sigma = 1e-3;
        let axis = [tilt.sin(), 0.0, tilt.cos()];
        let surface = Primitive::plane([0.0; 3], axis);
        let [e, f] = surface.frame();
        let at = |k: i32| f64::from(k) / 10.0 - 0.5;
        let cells = (0..11).flat_map(|i| (0..11).map(move |j| [at(i), at(j)]));
        let points: Vec<Point3> = cells
            .map(|[u, v]| std::array::from_fn(|k| u * e[k] + v * f[k]))
            .collect();
        let unit = covariance(&surface, &points).expect("all is determined");
        SnapEntity {
            known: UncertainSurface {
                surface,
                covariance: unit.map(|row| row.map(|x| x * sigma * sigma)),
            },
            points,
            sigma,
        }
    }

    fn parallel(entities: [usize; 2]) -> Relation {
        Relation {
            kind: RelationKind::Parallel,
            entities,
            deviation: 0.0,
        }
    }

    /// A tilt has a deviation of 3e-4 here: one of 5e-4 may be zero, one of 0.05 is not.
    #[test]
    fn relations_that_contradict_the_points_are_dropped_and_no_others() {
        let owns = [0.0, 5e-4, 0.05].map(square);
        let all = [[0, 1], [0, 2], [1, 2]].map(parallel);
        let (kept, dropped, solved) =
            consistent(&owns, &all, &Control::default()).expect("nothing stops it");
        let pairs = |of: &[Relation]| of.iter().map(|r| r.entities).collect::<Vec<_>>();
        assert_eq!(pairs(&kept), [[0, 1]]);
        assert_eq!(pairs(&dropped), [[0, 2], [1, 2]]);
        let [a, b] = [0, 1].map(|i| solved.surfaces[i].axis);
        // Both are known equally well, and meet in the middle.
        assert!((a[0] - 2.5e-4).abs() < 1e-9 && (a[0] - b[0]).abs() < 1e-15);
        assert_eq!(solved.surfaces[2], owns[2].known.surface);
    }

    /// Two entities of one direction determine it √2 times as well as one.
    #[test]
    fn conditions_share_what_is_known() {
        let owns = [0.0, 0.0].map(square);
        let (.., solved) =
            consistent(&owns, &[parallel([0, 1])], &Control::default()).expect("nothing stops it");
        let share = solved.covariances[0][0][0] / owns[0].known.covariance[0][0];
        assert!((share - 0.5).abs() < 1e-6, "{share}");
    }
}
