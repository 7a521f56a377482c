//! Half spaces: one for each entity, and separators for regions that the entities' surfaces do not
//! separate, in the coordinates of the part's frame.

use super::corner::CornerWall;
use crate::chart::{Primitive, PrimitiveKind};
use isoform_geom::{Aabb, Point3};

/// Origin of a half space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum HalfSpaceSource {
    /// The entity of this index.
    Entity(usize),
    /// The corner that the entity of this index rounds.
    Corner(usize),
    /// The plane through the centre or axis of an entity (its index), normal to an axis of the
    /// frame.
    Through(usize, usize),
    /// The cylinder through the circle of a torus (its index).
    Around(usize),
    /// A side of the data's box along an axis of the frame (true: the upper one), where no face was
    /// seen.
    Side(usize, bool),
}

impl HalfSpaceSource {
    /// Returns the index of the entity that it belongs to.
    pub(super) fn entity(self) -> Option<usize> {
        match self {
            Self::Entity(i) | Self::Corner(i) | Self::Through(i, _) | Self::Around(i) => Some(i),
            Self::Side(..) => None,
        }
    }
}

/// A half space bounded by a surface, intersected with walls.
#[derive(Clone, Debug)]
pub(super) struct HalfSpace {
    pub(super) surface: Primitive,
    /// 1 if the half space lies on the side of the surface's normal, −1 if on the other.
    pub(super) sign: f64,
    pub(super) source: HalfSpaceSource,
    pub(super) walls: Vec<CornerWall>,
}

impl HalfSpace {
    /// Returns the distance from the surface or a wall, positive inside.
    pub(super) fn value(&self, p: Point3) -> f64 {
        let own = self.sign * self.surface.distance(p);
        self.walls
            .iter()
            .fold(own, |least, w| least.min(w.value(p)))
    }

    /// Returns the corner within walls that an entity rounds.
    pub(super) fn corner(surface: &Primitive, number: usize, walls: Vec<CornerWall>) -> Self {
        Self {
            surface: *surface,
            sign: 1.0,
            source: HalfSpaceSource::Corner(number),
            walls,
        }
    }

    /// Returns the half space of an entity: for a plane the side of the material, for other
    /// surfaces that of their axis or centre.
    pub(super) fn of_entity(surface: &Primitive, outward: f64, number: usize) -> Self {
        let is_along = surface.kind == PrimitiveKind::Plane && outward < 0.0;
        Self {
            surface: *surface,
            sign: if is_along { 1.0 } else { -1.0 },
            source: HalfSpaceSource::Entity(number),
            walls: Vec::new(),
        }
    }

    /// Returns the side of a plane away from its normal, which is an axis of the frame.
    fn below(place: Point3, axis: usize, source: HalfSpaceSource) -> Self {
        let mut normal = [0.0; 3];
        normal[axis] = 1.0;
        Self {
            surface: Primitive::plane(place, normal),
            sign: -1.0,
            source,
            walls: Vec::new(),
        }
    }
}

/// Returns half spaces that may be needed in addition to those of the entities. Where a sphere
/// continues into a cylinder, or a torus into a plane, no entity's surface separates them; where
/// nothing was seen, the box of the data is the boundary.
pub(super) fn separators(surfaces: &[Primitive], bounds: &Aabb) -> Vec<HalfSpace> {
    let mut halves = Vec::new();
    for (i, s) in surfaces.iter().enumerate() {
        if s.kind == PrimitiveKind::Plane {
            continue;
        }
        if s.kind == PrimitiveKind::Torus {
            halves.push(HalfSpace {
                surface: Primitive {
                    kind: PrimitiveKind::Cylinder,
                    ..*s
                },
                sign: -1.0,
                source: HalfSpaceSource::Around(i),
                walls: Vec::new(),
            });
        }
        for k in 0..3 {
            // Planes through the axis of a cylinder or cone; also the plane of a torus's circle.
            let cosine = s.axis[k].abs();
            let suits = match s.kind {
                PrimitiveKind::Sphere => true,
                PrimitiveKind::Torus => cosine == 1.0 || cosine == 0.0,
                _ => cosine == 0.0,
            };
            if suits {
                halves.push(HalfSpace::below(s.place, k, HalfSpaceSource::Through(i, k)));
            }
        }
    }
    for k in 0..3 {
        let low = HalfSpace::below(bounds.lo, k, HalfSpaceSource::Side(k, false));
        halves.push(HalfSpace { sign: 1.0, ..low });
        halves.push(HalfSpace::below(
            bounds.hi,
            k,
            HalfSpaceSource::Side(k, true),
        ));
    }
    halves
}
