//! Results of recognition: surfaces in the terms of CAD systems, and their relations.

use isoform_geom::{Point3, Quadric};

/// A surface recognised in a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Entity {
    /// The surface: a plane, sphere, cylinder, cone or torus. A cone's axis points from the apex
    /// into the nappe that holds the points.
    pub surface: Quadric,
    /// Standard deviations of its parameters.
    pub deviations: Deviations,
    /// Outer side, by the normals of its points: +1 if the outward normal is that of the surface
    /// (away from the centre, the axis, the circle of a torus; along a plane's normal), −1 if it is
    /// opposite, as in a hole, 0 if the normals do not decide.
    pub outward: i8,
    /// Number of points that it explains.
    pub points: usize,
    /// Root mean square of their distances.
    pub rms: f64,
    /// Range of its points along the axis, from the centre, the apex or the point of the axis; 0
    /// for planes and spheres.
    pub extent: [f64; 2],
    /// Label that the points were given by hand; `None` if they were found.
    pub label: Option<u32>,
    /// False if its points were given by hand, and no kind of surface explains them within the
    /// noise, or not the kind asked for.
    pub is_explained: bool,
}

/// Standard deviations of an entity's parameters, from the covariance of the fit; 0 for parameters
/// that the kind lacks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviations {
    /// Standard deviation of each component of the plane's normal or the axis.
    pub direction: Point3,
    /// Standard deviation of each component of the centre, the apex or the point of the axis.
    pub place: Point3,
    /// Standard deviation of a plane's offset, a radius, a half angle or the major radius.
    pub size: f64,
    /// Standard deviation of the minor radius.
    pub minor: f64,
}

impl Deviations {
    /// Deviations of a surface that its points do not determine.
    pub(crate) const OPEN: Self = Self {
        direction: [f64::INFINITY; 3],
        place: [f64::INFINITY; 3],
        size: f64::INFINITY,
        minor: f64::INFINITY,
    };
}

/// A connected piece of an entity: two coplanar flat ends are two faces of one plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// Index of its entity.
    pub entity: usize,
    /// Number of its points.
    pub points: usize,
    /// Indices of the adjacent faces, ascending.
    pub beside: Vec<usize>,
    /// Border of a flat face: closed polygons, counterclockwise seen from outside, holes clockwise.
    /// Of points, it is known to within their spacing. Empty for curved faces.
    pub border: Vec<Vec<Point3>>,
}

/// Kind of a geometric relation between two entities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RelationKind {
    /// The directions (normal of a plane, axis of the others) are equal.
    Parallel,
    /// The directions are at right angles.
    Perpendicular,
    /// The axes are one line.
    Coaxial,
    /// Two pieces of one plane.
    Coplanar,
    /// The centres are one point.
    Concentric,
    /// Two cylinders or two spheres of one radius.
    EqualRadius,
    /// The surfaces touch: along a line or a circle, spheres also in a point. Stated alone: surfaces
    /// found to touch are [`Blend`]s.
    Tangent,
}

impl RelationKind {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::Parallel,
        Self::Perpendicular,
        Self::Coaxial,
        Self::Coplanar,
        Self::Concentric,
        Self::EqualRadius,
        Self::Tangent,
    ];

    /// Returns the name of the kind, as documents and options have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parallel => "parallel",
            Self::Perpendicular => "perpendicular",
            Self::Coaxial => "coaxial",
            Self::Coplanar => "coplanar",
            Self::Concentric => "concentric",
            Self::EqualRadius => "equal_radius",
            Self::Tangent => "tangent",
        }
    }
}

/// A relation that holds within the uncertainty, or that was given by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relation {
    /// Kind of the relation.
    pub kind: RelationKind,
    /// The indices of the two entities.
    pub entities: [usize; 2],
    /// Deviation from the relation: radians for directions, lengths for places and radii.
    pub deviation: f64,
}

/// An entity that rounds the edge of others with a constant radius: it touches them along curves.
#[derive(Clone, Debug, PartialEq)]
pub struct Blend {
    /// The cylinder, torus or sphere.
    pub entity: usize,
    /// The two or more entities that it touches.
    pub between: Vec<usize>,
    /// Radius of the blend; of a torus that of the tube.
    pub radius: f64,
}

/// Equal entities at equal distances or angles, within the uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    /// Entities at each place, in order: pieces of one plane or bore share a place.
    pub members: Vec<Vec<usize>>,
    /// Layout of the places.
    pub layout: Layout,
    /// Largest distance of an entity from its place, in the scan's unit.
    pub deviation: f64,
}

/// Layout of the members of a pattern; lengths in the scan's unit, angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layout {
    /// Equidistant places on a line.
    Row {
        /// Unit vector from a member to the next; across the axes of cylinders and cones.
        direction: Point3,
        /// Distance from a member to the next.
        spacing: f64,
        /// Standard deviation of the spacing.
        spacing_deviation: f64,
    },
    /// Places on a circle at equal angles.
    Circle {
        /// Point of its axis: the centre, at the height of the first member.
        center: Point3,
        /// Unit vector along its axis, about which members follow one another anticlockwise.
        axis: Point3,
        /// Radius of the pitch circle.
        radius: f64,
        /// Standard deviation of the radius.
        radius_deviation: f64,
        /// Angle from a member to the next.
        angle: f64,
        /// Standard deviation of the angle; 0 if the circle is closed.
        angle_deviation: f64,
        /// True if members occupy a full turn, false if they are on an arc.
        is_closed: bool,
        /// Entity whose axis is that of the circle; `None` if no entity has it.
        coaxial: Option<usize>,
    },
}

/// A motion of space that maps the entities to one another, within the uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Symmetry {
    /// The motion.
    pub kind: SymmetryKind,
    /// Image of each entity; `None` for entities without one, which are few and hold at most a
    /// twentieth of the points.
    pub images: Vec<Option<usize>>,
    /// Largest deviation of an entity's place or size from its image's, in the scan's unit.
    pub deviation: f64,
}

/// A motion, in the scan's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SymmetryKind {
    /// Reflection in the plane normal · x = offset.
    Mirror {
        /// Unit normal of the plane.
        normal: Point3,
        /// Offset of the plane.
        offset: f64,
    },
    /// Rotation about an axis by a full turn over `order`, or by any angle.
    Rotation {
        /// Point of the axis.
        point: Point3,
        /// Unit vector along the axis.
        axis: Point3,
        /// Order of the rotation; `None` for a body of revolution.
        order: Option<u32>,
    },
}

/// Result of recognition in a scan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recognition {
    /// Entities, those with most points first; of labels given by hand in ascending order of these.
    pub entities: Vec<Entity>,
    /// Index of the entity of each point of the scan.
    pub labels: Vec<Option<u32>>,
    /// Connected pieces of the entities, by entity, those with most points first.
    pub faces: Vec<Face>,
    /// Index of the face of each point of the scan; also `None` in scraps of an entity with fewer
    /// points than an entity needs.
    pub face_labels: Vec<Option<u32>>,
    /// Unit normals of the points, outwards.
    pub normals: Vec<Point3>,
    /// Relations that hold.
    pub relations: Vec<Relation>,
    /// Rows and circles of equal entities.
    pub patterns: Vec<Pattern>,
    /// Symmetries of all or nearly all entities.
    pub symmetries: Vec<Symmetry>,
    /// Entities that are blends of others.
    pub blends: Vec<Blend>,
    /// Standard deviation of the points along the normal, estimated from them; the tolerance if
    /// [`is_form`](Self::is_form) is true.
    pub noise: f64,
    /// True if the scan gives the sides of the normals, or is a mesh; otherwise rays determine
    /// them.
    pub is_oriented: bool,
    /// True if the form of the object deviates from its entities by more than the noise. Then
    /// `noise` is the tolerance within which they were found.
    pub is_form: bool,
    /// Share of the points on entities that meet others without an edge and are not blends. If it
    /// is large, the entities approximate a free form, and their sizes are not those of a part.
    pub free: f64,
}
