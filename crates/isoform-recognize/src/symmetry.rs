//! Symmetries: reflections and rotations that map all or nearly all entities to one another.
//!
//! Candidates come from pairs of entities and from axes. A candidate maps each entity to the equal
//! one that is nearest to its image; its plane or axis is then fitted by least squares over all
//! pairs, and entities whose difference from their image exceeds their uncertainty are removed,
//! worst first. Finally the images of points have to be near points.

mod candidates;
mod cover;
mod motion;

use crate::chart::{MAX_PARAMETERS, Primitive, PrimitiveKind, ROUNDING_DEVIATION};
use crate::compare::{
    ModelFit, Observation, Whitener, add_covariance, difference, fit_model, is_angle,
};
use crate::entity::{Pattern, Symmetry, SymmetryKind};
use crate::relations::{EntitySet, MAX_DIRECTION_DEVIATION, MAX_PLACE_DEVIATION, UncertainSurface};
use candidates::{lines_of_mirrors, lines_of_patterns, lines_of_surfaces, mirrors};
use cover::Cover;
use isoform_geom::{Point3, dot, norm, sub};
use motion::Motion;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Bounds on the entities without an image: maximum share of the points, maximum share of the
/// entities, and a number of entities that is always allowed.
const WITHOUT_IMAGE_LIMITS: (f64, f64, usize) = (0.05, 0.1, 2);
/// Maximum difference between an entity and an image that are matched, in radians and diagonals.
const MAX_IMAGE_DIFFERENCE: (f64, f64) = (0.03, 0.02);
/// Number of entities, those with most points, that candidates are made from.
const MAX_SOURCE_ENTITIES: usize = 24;

/// Returns the symmetries of all or nearly all entities; lengths in units of `unit` about `origin`.
pub(crate) fn symmetries(
    set: &EntitySet<'_>,
    patterns: &[Pattern],
    (unit, origin): (f64, Point3),
) -> Vec<Symmetry> {
    let whole: usize = set.points.iter().map(Vec::len).sum();
    let search = SymmetrySearch {
        set,
        cover: Cover::new(set.points),
        most_without: (
            (WITHOUT_IMAGE_LIMITS.0 * whole as f64) as usize,
            WITHOUT_IMAGE_LIMITS
                .2
                .max((WITHOUT_IMAGE_LIMITS.1 * set.known.len() as f64) as usize),
        ),
    };
    let surfaces: Vec<Primitive> = set.known.iter().map(|k| k.surface).collect();
    let mut found = search.distinct(
        mirrors(&surfaces, MAX_SOURCE_ENTITIES)
            .into_iter()
            .map(Motion::mirror),
    );
    let mut lines = lines_of_surfaces(&surfaces, MAX_SOURCE_ENTITIES);
    lines.extend(lines_of_patterns(patterns, unit, origin));
    let planes: Vec<Primitive> = found.iter().map(|f| f.motion.element).collect();
    lines.extend(lines_of_mirrors(&planes));
    let rotations = search.rotations(&lines);
    found.extend(rotations.into_iter().filter(|f| !f.is_product(&planes)));
    let symmetries = found.into_iter().map(|f| f.into_symmetry(unit, origin));
    symmetries.collect()
}

/// A motion under which the set is symmetric.
struct SymmetryMatch {
    motion: Motion,
    images: Vec<Option<usize>>,
    off: f64,
}

impl SymmetryMatch {
    /// Returns true if the motion is a half turn and the product of two reflections in
    /// perpendicular planes.
    fn is_product(&self, mirrors: &[Primitive]) -> bool {
        let line = &self.motion.element;
        let holds = |m: &&Primitive| {
            dot(m.axis, line.axis).abs() < MAX_IMAGE_DIFFERENCE.0
                && m.distance(line.place).abs() < MAX_IMAGE_DIFFERENCE.1
        };
        let through: Vec<&Primitive> = mirrors.iter().filter(holds).collect();
        let is_right = |a: &&Primitive| {
            let mut others = through.iter();
            others.any(|b| dot(a.axis, b.axis).abs() < MAX_IMAGE_DIFFERENCE.0)
        };
        self.motion.order == Some(2) && through.iter().any(is_right)
    }

    /// Returns true if each entity has an image.
    fn is_whole(&self) -> bool {
        self.images.iter().all(Option::is_some)
    }

    /// Returns the symmetry in the scan's unit.
    fn into_symmetry(self, unit: f64, origin: Point3) -> Symmetry {
        let element = self.motion.element;
        let point: Point3 = std::array::from_fn(|k| element.place[k] * unit + origin[k]);
        let kind = match element.kind {
            PrimitiveKind::Plane => SymmetryKind::Mirror {
                normal: element.axis,
                offset: dot(element.axis, point),
            },
            _ => SymmetryKind::Rotation {
                point,
                axis: element.axis,
                order: self.motion.order,
            },
        };
        Symmetry {
            kind,
            images: self.images,
            deviation: self.off * unit,
        }
    }
}

/// The search for symmetries of a set.
struct SymmetrySearch<'a> {
    set: &'a EntitySet<'a>,
    cover: Cover,
    /// Maximum number of points of entities without an image, and maximum number of such entities.
    most_without: (usize, usize),
}

impl SymmetrySearch<'_> {
    /// Returns the candidates that hold, one for each mapping.
    fn distinct(&self, candidates: impl Iterator<Item = Motion>) -> Vec<SymmetryMatch> {
        let candidates: Vec<Motion> = candidates.collect();
        let all: Vec<Option<SymmetryMatch>> =
            candidates.into_par_iter().map(|m| self.tried(m)).collect();
        let mut found: Vec<SymmetryMatch> = Vec::new();
        for one in all.into_iter().flatten() {
            // If two differ only in the omitted entities, the more complete one is kept; axes may
            // point either way.
            let agree = |f: &SymmetryMatch| {
                let mut pairs = f.images.iter().zip(&one.images);
                f.motion.is_near(&one.motion, MAX_IMAGE_DIFFERENCE)
                    && (f.motion.element.kind != PrimitiveKind::Plane
                        || pairs.all(|(a, b)| a == b || a.is_none() || b.is_none()))
            };
            let count = |f: &SymmetryMatch| f.images.iter().flatten().count();
            match found.iter_mut().find(|f| agree(f)) {
                Some(same) if count(same) < count(&one) => *same = one,
                Some(_) => {}
                None => found.push(one),
            }
        }
        found
    }

    /// Returns for each axis the rotation of the highest order, and those whose order does not
    /// divide it.
    fn rotations(&self, lines: &[Primitive]) -> Vec<SymmetryMatch> {
        let mut found: Vec<SymmetryMatch> = Vec::new();
        // A turn by this share of a full one maps only bodies of revolution to themselves.
        let bodies = self.distinct(
            lines
                .iter()
                .map(|l| Motion::turn(*l, 0.381_966 * TAU, None)),
        );
        let is_on = |l: &Primitive, f: &SymmetryMatch| {
            Motion::turn(*l, 0.0, None).is_near(&f.motion, MAX_IMAGE_DIFFERENCE)
        };
        let lines: Vec<Primitive> = lines
            .iter()
            .filter(|l| !bodies.iter().any(|f| f.is_whole() && is_on(l, f)))
            .copied()
            .collect();
        for order in (2..=12).rev() {
            let angle = TAU / f64::from(order);
            let is_left = |l: &&Primitive| {
                let divides = |f: &SymmetryMatch| f.motion.order.is_some_and(|o| o % order == 0);
                !found.iter().any(|f| divides(f) && is_on(l, f))
            };
            let left = lines.iter().filter(is_left);
            let more = self.distinct(left.map(|l| Motion::turn(*l, angle, Some(order))));
            found.extend(more.into_iter().filter(Self::moves_some));
        }
        let is_more =
            |b: &SymmetryMatch| b.is_whole() || !found.iter().any(|f| is_on(&b.motion.element, f));
        let bodies = bodies.into_iter().filter(|b| !Self::moves_some(b));
        let bodies: Vec<SymmetryMatch> = bodies.filter(is_more).collect();
        found.extend(bodies);
        found
    }

    fn moves_some(found: &SymmetryMatch) -> bool {
        let mut all = found.images.iter().enumerate();
        all.any(|(i, image)| image.is_some_and(|j| j != i))
    }

    /// Returns a candidate with its fitted plane or axis; `None` if it does not hold.
    fn tried(&self, mut motion: Motion) -> Option<SymmetryMatch> {
        let (mut out, mut images) = (Vec::new(), self.images(&motion, &[])?);
        for round in 0..4 + images.len() {
            let pairs = self.pairs(&motion, &images);
            let fit = self.fitted(&motion, &pairs)?;
            motion = motion.moved(&fit.theta);
            let excess = fit.excess.iter().enumerate();
            let worst = excess.max_by(|a, b| a.1.total_cmp(b.1))?;
            if *worst.1 > 1.0 && round > 0 {
                out.push(pairs[worst.0].0);
            }
            let next = self.images(&motion, &out)?;
            if next == images && *worst.1 <= 1.0 {
                return match fit.holds() && self.is_determined(&fit, &motion) {
                    true => self.found(motion, images),
                    false => None,
                };
            }
            images = next;
        }
        None
    }

    fn found(&self, motion: Motion, images: Vec<Option<usize>>) -> Option<SymmetryMatch> {
        let is_covered =
            |(i, image): (usize, Option<usize>)| image.filter(|j| self.cover.holds(&motion, i, *j));
        let images = images.into_iter().enumerate().map(is_covered).collect();
        let images = self.one_to_one(&motion, images)?;
        let off = self.largest(&motion, &images);
        Some(SymmetryMatch {
            motion,
            images,
            off,
        })
    }

    /// Returns the entity nearest to the image of each, if few have none; those of `out` have none.
    fn images(&self, motion: &Motion, out: &[usize]) -> Option<Vec<Option<usize>>> {
        let mut without = (0, 0);
        let mut images = Vec::with_capacity(self.set.known.len());
        for i in 0..self.set.known.len() {
            let image = if out.contains(&i) {
                None
            } else {
                self.image(motion, i)
            };
            if image.is_none() {
                without = (without.0 + self.set.points[i].len(), without.1 + 1);
                if without.0 > self.most_without.0 || without.1 > self.most_without.1 {
                    return None;
                }
            }
            images.push(image);
        }
        self.one_to_one(motion, images)
    }

    /// Removes images that several entities share, and those of reflections that are not mutual.
    fn one_to_one(
        &self,
        motion: &Motion,
        images: Vec<Option<usize>>,
    ) -> Option<Vec<Option<usize>>> {
        let mut count = vec![0; images.len()];
        images.iter().flatten().for_each(|j| count[*j] += 1);
        let is_one = |i: usize, j: usize| {
            count[j] == 1 && (motion.element.kind != PrimitiveKind::Plane || images[j] == Some(i))
        };
        let kept = images.iter().enumerate();
        let kept = kept.map(|(i, image)| image.filter(|j| is_one(i, *j)));
        self.enough(kept.collect())
    }

    /// Returns the images, if few enough entities are without one.
    fn enough(&self, images: Vec<Option<usize>>) -> Option<Vec<Option<usize>>> {
        let without = images.iter().zip(self.set.points);
        let without = without.filter(|(i, _)| i.is_none()).map(|(_, p)| p.len());
        let (points, count) = without.fold((0, 0), |(p, n), more| (p + more, n + 1));
        (points <= self.most_without.0 && count <= self.most_without.1).then_some(images)
    }

    /// Returns the entity nearest to the image of this one.
    fn image(&self, motion: &Motion, i: usize) -> Option<usize> {
        let moved = motion.apply(&self.set.known[i].surface);
        let facing = self.set.outward[i];
        let near = |j: usize| {
            let s = &self.set.known[j].surface;
            if s.kind != moved.kind || !faces_alike(s, &moved, facing * self.set.outward[j]) {
                return None;
            }
            distance(s, &moved).map(|d| (d, j))
        };
        let all = (0..self.set.known.len()).filter_map(near);
        all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|n| n.1)
    }

    /// Returns entities of known position with their images; of reflections each pair once.
    fn pairs(&self, motion: &Motion, images: &[Option<usize>]) -> Vec<(usize, usize)> {
        let is_mirror = motion.element.kind == PrimitiveKind::Plane;
        let is_known = |i: usize| self.set.known[i].covariance[0][0].is_finite();
        let all = images.iter().enumerate();
        let all = all.filter_map(|(i, image)| image.map(|j| (i, j)));
        all.filter(|(i, j)| is_known(*i) && is_known(*j) && !(is_mirror && j < i))
            .collect()
    }

    fn fitted(&self, motion: &Motion, pairs: &[(usize, usize)]) -> Option<ModelFit> {
        let observation = |(i, j): &(usize, usize)| {
            let [a, b] = [*i, *j].map(|k| &self.set.known[k]);
            Observation {
                difference: Box::new(move |theta: &[f64]| {
                    difference(&b.surface, &motion.moved(theta).apply(&a.surface))
                }),
                whitener: whitener(motion, a, b, i == j),
            }
        };
        let all: Vec<Observation<'_>> = pairs.iter().map(observation).collect();
        fit_model(motion.freedom(), &all)
    }

    /// Returns true if the plane or axis is known well enough.
    fn is_determined(&self, fit: &ModelFit, motion: &Motion) -> bool {
        (0..motion.freedom()).all(|k| {
            let (least, noises) = if k < 2 {
                MAX_DIRECTION_DEVIATION
            } else {
                MAX_PLACE_DEVIATION
            };
            fit.deviation(k) <= least.max(noises * self.set.noise)
        })
    }

    /// Returns the largest difference of a place or a size from its image's.
    fn largest(&self, motion: &Motion, images: &[Option<usize>]) -> f64 {
        let off = |(i, j): (usize, usize)| {
            let [a, b] = [i, j].map(|k| &self.set.known[k].surface);
            let off = difference(b, &motion.apply(a));
            let lengths = (0..MAX_PARAMETERS).filter(|k| !is_angle(b.kind, *k));
            lengths.map(|k| off[k].abs()).fold(0.0, f64::max)
        };
        let pairs = self.pairs(motion, images).into_iter();
        pairs.map(off).fold(0.0, f64::max)
    }
}

/// Returns true if the outer sides of two surfaces of one kind agree, as far as they are known.
fn faces_alike(a: &Primitive, b: &Primitive, facing: i8) -> bool {
    let is_against = a.kind == PrimitiveKind::Plane && dot(a.axis, b.axis) < 0.0;
    facing == 0 || (facing < 0) == is_against
}

/// Returns the distance of two surfaces of one kind in parameters and position; `None` beyond
/// [`MAX_IMAGE_DIFFERENCE`].
fn distance(a: &Primitive, b: &Primitive) -> Option<f64> {
    let off = difference(a, b);
    let limit = |k: usize| {
        if is_angle(a.kind, k) {
            MAX_IMAGE_DIFFERENCE.0
        } else {
            MAX_IMAGE_DIFFERENCE.1
        }
    };
    let is_near = (0..a.kind.parameters()).all(|k| off[k].abs() <= limit(k));
    let apart: f64 = off.iter().map(|x| x * x).sum();
    is_near.then(|| (apart + norm(sub(a.place, b.place)).powi(2)).sqrt())
}

/// Returns the whitener for the difference of an entity from the image of another, or of itself:
/// then the covariance is (1 − J) C (1 − J)ᵀ with the derivatives J of the image, in which the
/// directions invariant under the motion vanish.
fn whitener(
    motion: &Motion,
    a: &UncertainSurface,
    b: &UncertainSurface,
    is_same: bool,
) -> Whitener {
    let which: Vec<usize> = (0..b.surface.kind.parameters()).collect();
    let mut sum = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
    if is_same {
        add_covariance(&mut sum, a, |s| {
            let (image, own) = (motion.apply(s), difference(&b.surface, s));
            let of = difference(&b.surface, &image);
            std::array::from_fn(|k| of[k] - own[k])
        });
        let scale = std::array::from_fn(|k| {
            a.covariance[k][k].max(ROUNDING_DEVIATION * ROUNDING_DEVIATION)
        });
        return Whitener::from_covariance(&rounded(sum), &which, Some(&scale));
    }
    add_covariance(&mut sum, a, |s| difference(&b.surface, &motion.apply(s)));
    for (row, more) in sum.iter_mut().zip(&b.covariance) {
        row.iter_mut().zip(more).for_each(|(x, y)| *x += y);
    }
    Whitener::from_covariance(&rounded(sum), &which, None)
}

fn rounded(
    mut covariance: [[f64; MAX_PARAMETERS]; MAX_PARAMETERS],
) -> [[f64; MAX_PARAMETERS]; MAX_PARAMETERS] {
    (0..MAX_PARAMETERS).for_each(|k| covariance[k][k] += ROUNDING_DEVIATION * ROUNDING_DEVIATION);
    covariance
}
