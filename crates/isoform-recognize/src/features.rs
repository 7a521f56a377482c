//! Features of a recognised part: holes, bosses, slots and pockets, with their depths.
//!
//! Bands are faces on cylinders and cones, as far as their points reach along the axis. An adjacent
//! plane across the axis ends a band: a hollow one with a floor if it faces into the band, else
//! with a mouth; another one with a cap if it faces away, else with a base. Ends are then in the
//! plane, to its accuracy. Small floors and caps without a face of their own are seen by their
//! points.

use crate::entity::Recognition;
use band::{Band, bands};
use chain::Chain;
use isoform_geom::{Point3, Quadric, cross, dot, norm, sub};
use planes::{Plane, planes};
use std::collections::BTreeSet;

mod band;
mod chain;
mod planes;

/// A feature of a part; lengths in the scan's unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// Kind and sizes.
    pub kind: FeatureKind,
    /// Faces that bound it.
    pub faces: BTreeSet<usize>,
    /// Middle of its mouth, or of the base of a boss.
    pub point: Point3,
    /// Unit vector from there into it: into the material, or along a boss.
    pub direction: Point3,
    /// Depth, or height of a boss.
    pub depth: f64,
}

/// Kind of a feature, with its sizes.
#[derive(Clone, Debug, PartialEq)]
pub enum FeatureKind {
    /// A round hole.
    Hole {
        /// Radius of its narrowest cylinder.
        radius: f64,
        /// True if its other end is open.
        is_through: bool,
        /// Counterbores and countersinks, from the mouth on.
        widenings: Vec<Widening>,
    },
    /// A round boss on a base.
    Boss {
        /// Radius.
        radius: f64,
    },
    /// A slot with two round ends.
    Slot {
        /// Distance between its sides.
        width: f64,
        /// Distance between its ends.
        length: f64,
        /// True if it has no floor.
        is_through: bool,
    },
    /// A pocket with a floor and two pairs of parallel sides.
    Pocket {
        /// Distance between the nearer pair of sides.
        width: f64,
        /// Distance between the other pair.
        length: f64,
    },
}

/// A wider part of a hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Widening {
    /// Radius at its outer end.
    pub radius: f64,
    /// Length along the axis.
    pub depth: f64,
    /// Half angle of a countersink (radians); `None` for a counterbore.
    pub half_angle: Option<f64>,
    /// True if it is at the mouth, false if it is at the other end.
    pub is_at_mouth: bool,
}

/// Returns the features of a recognised part, by the faces of its points: holes, bosses, slots,
/// pockets.
pub fn features(points: &[Point3], found: &Recognition) -> Vec<Feature> {
    let part = Part::new(points, found);
    let mut all = part.holes();
    all.extend(part.bosses());
    all.extend(part.slots());
    all.extend(part.pockets());
    all
}

/// The faces of a part that bound features.
struct Part<'a> {
    found: &'a Recognition,
    bands: Vec<Band>,
    planes: Vec<Plane>,
}

impl<'a> Part<'a> {
    fn new(points: &[Point3], found: &'a Recognition) -> Self {
        let mut members = vec![Vec::new(); found.faces.len()];
        for (p, face) in points.iter().zip(&found.face_labels) {
            if let Some(face) = face {
                members[*face as usize].push(*p);
            }
        }
        let planes = planes(&members, found);
        let mut bands = bands(&members, found);
        for band in &mut bands {
            band.end_in(&planes, &beside(found, band.face));
            band.end_in_points(points);
        }
        Self {
            found,
            bands,
            planes,
        }
    }

    /// Returns round holes: chains of hollow bands about one axis, one after the other.
    fn holes(&self) -> Vec<Feature> {
        let is_hollow = |b: &&Band| b.is_hollow && b.is_round();
        let mut left: Vec<&Band> = self.bands.iter().filter(is_hollow).collect();
        let mut all = Vec::new();
        while let Some(first) = left.pop() {
            let mut chain = vec![first];
            while let Some(next) = left
                .iter()
                .position(|b| chain.iter().any(|own| own.continues(b)))
            {
                chain.push(left.swap_remove(next));
            }
            all.extend(Chain::new(chain).and_then(|chain| chain.hole()));
        }
        all.sort_by(|a, b| a.faces.cmp(&b.faces));
        all
    }

    /// Returns bosses: convex bands with a base around one end, and a cap at the other.
    fn bosses(&self) -> Vec<Feature> {
        let boss = |b: &Band| {
            let is_boss = !b.is_hollow && b.is_round() && b.half_angle == 0.0;
            let base = (0..2).find(|k| b.has_base(*k) && b.ends[1 - *k].is_closed)?;
            let faces = [b.ends[0].plane, b.ends[1].plane].into_iter().flatten();
            is_boss.then(|| Feature {
                kind: FeatureKind::Boss {
                    radius: b.radius_at(0.0),
                },
                faces: faces.chain([b.face]).collect(),
                point: b.at(b.ends[base].height),
                direction: b.inward(base),
                depth: b.length(),
            })
        };
        self.bands.iter().filter_map(boss).collect()
    }

    /// Returns slots: two hollow half cylinders of one radius, joined by two parallel sides.
    fn slots(&self) -> Vec<Feature> {
        let is_end = |b: &&Band| b.is_hollow && b.half_angle == 0.0 && b.is_half();
        let ends: Vec<&Band> = self.bands.iter().filter(is_end).collect();
        let mut all = Vec::new();
        for (k, a) in ends.iter().enumerate() {
            for b in &ends[k + 1..] {
                all.extend(self.slot(a, b));
            }
        }
        all
    }

    fn slot(&self, a: &Band, b: &Band) -> Option<Feature> {
        let [r, s] = [a, b].map(|band| band.radius_at(0.0));
        let (middle, way) = (a.at(a.middle()), sub(b.at(b.middle()), a.at(a.middle())));
        let along = dot(way, a.axis);
        let across: Point3 = std::array::from_fn(|k| way[k] - along * a.axis[k]);
        let distance = norm(across);
        let is_pair = norm(cross(a.axis, b.axis)) < a.slack / a.length() + 0.01
            && (r - s).abs() < a.slack
            && along.abs() < a.slack + b.slack
            && distance > a.slack;
        let beside = |band: &Band| beside(self.found, band.face);
        let (of_a, of_b) = (beside(a), beside(b));
        // Sides face each other.
        let side = |p: &&Plane| {
            let off = sub(middle, p.middle);
            let is_along =
                dot(p.normal, a.axis).abs() < 0.1 && dot(p.normal, across).abs() < 0.1 * distance;
            of_a.contains(&p.face) && of_b.contains(&p.face) && is_along && dot(p.normal, off) > 0.0
        };
        let sides: Vec<usize> = self.planes.iter().filter(side).map(|p| p.face).collect();
        if !is_pair || sides.len() != 2 {
            return None;
        }
        let floor = (0..2).find(|k| a.ends[*k].is_closed || b.ends[*k].is_closed);
        let mouth = floor.map_or(1, |k| 1 - k);
        let floors = floor.and_then(|k| a.ends[k].plane.or(b.ends[k].plane));
        let faces = [a.face, b.face].into_iter().chain(sides).chain(floors);
        let top = a.at(a.ends[mouth].height);
        Some(Feature {
            kind: FeatureKind::Slot {
                width: r + s,
                length: distance + r + s,
                is_through: floor.is_none(),
            },
            faces: faces.collect(),
            point: std::array::from_fn(|k| top[k] + across[k] / 2.0),
            direction: a.inward(mouth),
            depth: a.length(),
        })
    }

    /// Returns pockets: planes from which two pairs of sides rise that face each other.
    fn pockets(&self) -> Vec<Feature> {
        self.planes
            .iter()
            .filter_map(|floor| self.pocket(floor))
            .collect()
    }

    fn pocket(&self, floor: &Plane) -> Option<Feature> {
        let beside = beside(self.found, floor.face);
        let is_wall = |p: &&Plane| {
            let rise = dot(sub(p.middle, floor.middle), floor.normal);
            let is_inward = dot(p.normal, sub(floor.middle, p.middle)) > 0.0;
            beside.contains(&p.face)
                && dot(p.normal, floor.normal).abs() < 0.1
                && rise > 0.0
                && is_inward
        };
        let walls: Vec<&Plane> = self.planes.iter().filter(is_wall).collect();
        let mut pairs = Vec::new();
        for (k, a) in walls.iter().enumerate() {
            for b in &walls[k + 1..] {
                if dot(a.normal, b.normal) < -0.99 {
                    let distance = dot(sub(b.middle, a.middle), a.normal);
                    let middle = dot(a.middle, a.normal) + distance / 2.0;
                    pairs.push((distance, [a.face, b.face], a.normal, middle));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (width, first, along, _) = *pairs.first()?;
        let (length, second, ..) = *pairs.iter().find(|p| dot(p.2, along).abs() < 0.1)?;
        // The mouth is the lowest plane above the floor that faces alike and continues a wall.
        let of_walls: Vec<BTreeSet<usize>> = [first, second]
            .concat()
            .iter()
            .map(|wall| self::beside(self.found, *wall))
            .collect();
        let height = |p: &Plane| dot(sub(p.middle, floor.middle), floor.normal);
        let is_mouth = |p: &&Plane| {
            dot(p.normal, floor.normal) > 0.99
                && height(p) > 0.0
                && of_walls.iter().any(|of| of.contains(&p.face))
        };
        let tops = self.planes.iter().filter(is_mouth).map(height);
        let depth = tops.fold(f64::INFINITY, f64::min);
        let sides = first.into_iter().chain(second);
        let mut point: Point3 = std::array::from_fn(|k| floor.middle[k] + depth * floor.normal[k]);
        for (.., normal, middle) in pairs.iter().filter(|p| p.1 == first || p.1 == second) {
            let off = middle - dot(point, *normal);
            point = std::array::from_fn(|k| point[k] + off * normal[k]);
        }
        depth.is_finite().then(|| Feature {
            kind: FeatureKind::Pocket { width, length },
            faces: sides.chain([floor.face]).collect(),
            point,
            direction: floor.normal.map(|v| -v),
            depth,
        })
    }
}

/// Returns the faces adjacent to a face, directly or across a blend.
fn beside(found: &Recognition, face: usize) -> BTreeSet<usize> {
    let is_blend = |f: usize| {
        found
            .blends
            .iter()
            .any(|b| b.entity == found.faces[f].entity)
    };
    let mut all: BTreeSet<usize> = found.faces[face].beside.iter().copied().collect();
    for other in &found.faces[face].beside {
        if is_blend(*other) {
            all.extend(&found.faces[*other].beside);
        }
    }
    all.remove(&face);
    all
}

/// Returns the surface of the entity of a face.
fn surface(found: &Recognition, face: usize) -> &Quadric {
    &found.entities[found.faces[face].entity].surface
}
