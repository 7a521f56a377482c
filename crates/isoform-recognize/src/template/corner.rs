//! Corners of blends: the material that a blend removes from a sharp convex edge, or adds to a
//! sharp concave one.
//!
//! A ball that rolls along an edge touches its faces on rays from its centre. The region between
//! these rays and outside the ball is the sliver between the blend and the sharp edge, extended
//! beyond the faces. It is one region for each blend, and half spaces of the other entities need
//! not bound it. It does not end at the faces: two regions that end on one plane would leave a
//! sheet there.

use super::frame::PartFrame;
use crate::blends::MAX_TOUCH_OFFSET;
use crate::chart::{Primitive, PrimitiveKind};
use crate::entity::Blend;
use isoform_geom::{Point3, dot};

/// A half space that bounds a corner.
#[derive(Clone, Debug)]
pub(super) struct CornerWall {
    surface: Primitive,
    /// 1 if the half space lies on the side of the surface's normal, −1 if on the other.
    sign: f64,
    pub(super) role: WallRole,
}

/// The role of a wall in the template.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum WallRole {
    /// Beyond the centre of a blend (its index) along an axis of a system, upwards if true.
    Beyond(usize, [usize; 2], bool),
    /// Beyond the circle of a torus, outwards if true.
    Around(bool),
}

impl CornerWall {
    /// Returns the distance from the surface, positive inside the half space.
    pub(super) fn value(&self, p: Point3) -> f64 {
        self.sign * self.surface.distance(p)
    }

    fn plane(place: Point3, row: Point3, is_above: bool, role: WallRole) -> Self {
        Self {
            surface: Primitive::plane(place, row),
            sign: if is_above { 1.0 } else { -1.0 },
            role,
        }
    }

    /// Returns the outside or inside of the cylinder through the circle of a torus.
    fn around(torus: &Primitive, is_outside: bool) -> Self {
        Self {
            surface: Primitive {
                kind: PrimitiveKind::Cylinder,
                ..*torus
            },
            sign: if is_outside { 1.0 } else { -1.0 },
            role: WallRole::Around(is_outside),
        }
    }
}

/// Returns the walls of the corner that a blend rounds; `None` if the surfaces that it touches are
/// not along the axes of one system of coordinates.
pub(super) fn walls(blend: &Blend, blends: &[Blend], frame: &PartFrame) -> Option<Vec<CornerWall>> {
    let corner = CornerBlend {
        blend,
        blends,
        frame,
        surface: &frame.surfaces[blend.entity],
    };
    match corner.surface.kind {
        PrimitiveKind::Cylinder => corner.between_planes(2),
        PrimitiveKind::Sphere => corner.between_planes(3),
        PrimitiveKind::Torus => corner.about_axis(),
        PrimitiveKind::Plane | PrimitiveKind::Cone => None,
    }
}

/// A blend with the entities that it may touch.
struct CornerBlend<'a> {
    blend: &'a Blend,
    blends: &'a [Blend],
    frame: &'a PartFrame,
    surface: &'a Primitive,
}

impl CornerBlend<'_> {
    /// Returns the planes that it touches, with their axes: its neighbours, and those of adjacent
    /// blends.
    fn planes(&self) -> Vec<(usize, [usize; 2])> {
        let of_next = self
            .blends
            .iter()
            .filter(|b| self.blend.between.contains(&b.entity))
            .flat_map(|b| &b.between);
        let mut all: Vec<usize> = self.blend.between.iter().chain(of_next).copied().collect();
        all.sort_unstable();
        all.dedup();
        let touches = |i: &usize| {
            let s = &self.frame.surfaces[*i];
            let off = (s.distance(self.surface.place).abs() - self.blend.radius).abs();
            s.kind == PrimitiveKind::Plane && off <= MAX_TOUCH_OFFSET * self.blend.radius
        };
        let along = |i: usize| self.frame.along[i].map(|(system, axis)| (i, [system, axis]));
        all.into_iter().filter(touches).filter_map(along).collect()
    }

    /// Returns the walls between planes along `count` axes of one system.
    fn between_planes(&self, count: usize) -> Option<Vec<CornerWall>> {
        let planes = self.planes();
        let (system, own) = match self.surface.kind {
            PrimitiveKind::Cylinder => self.frame.along[self.blend.entity]?,
            _ => (planes.first()?.1[0], 3),
        };
        let mut used = Vec::new();
        let mut walls = Vec::new();
        for (plane, way) in planes {
            if way[0] != system || way[1] == own {
                continue;
            }
            if used.contains(&way[1]) {
                return None;
            }
            used.push(way[1]);
            walls.push(self.towards(plane, way));
        }
        (used.len() == count).then_some(walls)
    }

    /// Returns the wall beyond the centre towards a plane.
    fn towards(&self, plane: usize, way: [usize; 2]) -> CornerWall {
        let row = self.frame.systems[way[0]].rows[way[1]];
        let place = self.frame.surfaces[plane].place;
        let is_up = dot(row, place) > dot(row, self.surface.place);
        let role = WallRole::Beyond(self.blend.entity, way, is_up);
        CornerWall::plane(self.surface.place, row, is_up, role)
    }

    /// Returns the walls of a torus between a plane across its axis and a cylinder about it.
    fn about_axis(&self) -> Option<Vec<CornerWall>> {
        let (surfaces, torus) = (&self.frame.surfaces, self.surface);
        let (system, axis) = self.frame.along[self.blend.entity]?;
        let row = self.frame.systems[system].rows[axis];
        let is_across = |i: &&usize| {
            surfaces[**i].kind == PrimitiveKind::Plane
                && self.frame.along[**i] == Some((system, axis))
        };
        let plane = *self.blend.between.iter().find(is_across)?;
        let is_coaxial = |i: &&usize| {
            let s = &surfaces[**i];
            let off: Point3 = std::array::from_fn(|k| s.place[k] - torus.place[k]);
            let along = dot(off, row);
            let beside = (dot(off, off) - along * along).max(0.0).sqrt();
            s.kind == PrimitiveKind::Cylinder
                && self.frame.along[**i] == Some((system, axis))
                && beside <= MAX_TOUCH_OFFSET * self.blend.radius
        };
        let cylinder = *self.blend.between.iter().find(is_coaxial)?;
        let is_wider = surfaces[cylinder].size > torus.size;
        let mut walls = vec![
            CornerWall::around(torus, is_wider),
            self.towards(plane, [system, axis]),
        ];
        // If the cylinder is itself a blend, the region ends where its corner does.
        if let Some(edge) = self.blends.iter().find(|b| b.entity == cylinder) {
            let of_edge = self::walls(edge, self.blends, self.frame)?;
            walls.extend(of_edge);
        }
        Some(walls)
    }
}
