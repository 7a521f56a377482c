//! What is recognised: surfaces that CAD systems have a name for, and how they lie to one another.

use isoform_geom::{Point3, Quadric};

/// A surface recognised in a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Entity {
    /// The surface: a plane, sphere, cylinder, cone or torus. A cone's axis points from the apex
    /// into the nappe that holds the points.
    pub surface: Quadric,
    /// Standard deviations of its parameters.
    pub deviations: Deviations,
    /// Which side is outside, by the normals of its points: +1 where the outward normal is that of
    /// the surface (away from the centre, the axis, the circle of a torus; along a plane's normal),
    /// −1 where it is the opposite one, as in a hole, 0 where the normals do not tell.
    pub outward: i8,
    /// How many points it explains.
    pub points: usize,
    /// The root mean square of their distances.
    pub rms: f64,
    /// Where its points begin and end along the axis, from the centre, the apex or the point of the
    /// axis; of planes and spheres 0.
    pub extent: [f64; 2],
}

/// Standard deviations of an entity's parameters, from the covariance of the fit; 0 where a
/// parameter does not exist.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviations {
    /// Of each component of the plane's normal or the axis.
    pub direction: Point3,
    /// Of each component of the centre, the apex or the point of the axis.
    pub place: Point3,
    /// Of a plane's offset, a radius, a half angle or the major radius.
    pub size: f64,
    /// Of the minor radius.
    pub minor: f64,
}

impl Deviations {
    /// The deviations of a surface that its points do not determine.
    pub(crate) const OPEN: Self = Self {
        direction: [f64::INFINITY; 3],
        place: [f64::INFINITY; 3],
        size: f64::INFINITY,
        minor: f64::INFINITY,
    };
}

/// A connected piece of an entity: two flat ends of one height are two faces of one plane.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Face {
    /// Index of its entity.
    pub entity: usize,
    /// Number of its points.
    pub points: usize,
    /// Indices of the faces at its boundary, ascending.
    pub beside: Vec<usize>,
}

/// How two entities lie to one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RelationKind {
    /// Their directions (normal of a plane, axis of the others) are one.
    Parallel,
    /// Their directions are at right angles.
    Perpendicular,
    /// Their axes are one line.
    Coaxial,
    /// Two pieces of one plane.
    Coplanar,
    /// Their centres are one point.
    Concentric,
    /// Two cylinders or two spheres of one radius.
    EqualRadius,
}

/// A relation that holds within the uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relation {
    /// Which.
    pub kind: RelationKind,
    /// The indices of the two entities.
    pub entities: [usize; 2],
    /// By how much it fails: radians for directions, lengths for places and radii.
    pub deviation: f64,
}

/// An entity that rounds the edge of others with a constant radius: it touches them along curves.
#[derive(Clone, Debug, PartialEq)]
pub struct Blend {
    /// The cylinder, torus or sphere.
    pub entity: usize,
    /// The two or more entities that it touches.
    pub between: Vec<usize>,
    /// Its radius; of a torus that of the tube.
    pub radius: f64,
}

/// Equal entities at equal distances or angles, within the uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    /// The entities at each place, in order: pieces of one plane or bore are at one place.
    pub members: Vec<Vec<usize>>,
    /// How they are laid out.
    pub layout: Layout,
    /// How far an entity is off its place at most, in the scan's unit.
    pub deviation: f64,
}

/// How the members of a pattern are laid out; lengths in the scan's unit, angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layout {
    /// On a line.
    Row {
        /// The unit vector from a member to the next; across the axes of cylinders and cones.
        direction: Point3,
        /// The distance from a member to the next.
        spacing: f64,
        /// Its standard deviation.
        spacing_deviation: f64,
    },
    /// On a circle.
    Circle {
        /// A point of its axis: the centre, at the height of the first member.
        center: Point3,
        /// The unit vector along its axis, about which members follow one another anticlockwise.
        axis: Point3,
        /// The radius of the pitch circle.
        radius: f64,
        /// Its standard deviation.
        radius_deviation: f64,
        /// From a member to the next.
        angle: f64,
        /// Its standard deviation; 0 where members go round.
        angle_deviation: f64,
        /// Whether members go round once; else they are on an arc.
        is_closed: bool,
        /// An entity whose axis is that of the circle, where there is one.
        coaxial: Option<usize>,
    },
}

/// A motion of space that maps the entities to one another, within the uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Symmetry {
    /// Which motion.
    pub kind: SymmetryKind,
    /// For each entity its image; none where it has none: such entities are few and hold at most a
    /// twentieth of the points.
    pub images: Vec<Option<usize>>,
    /// How far an entity's place or size is off its image's at most, in the scan's unit.
    pub deviation: f64,
}

/// A motion, in the scan's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SymmetryKind {
    /// In the plane normal · x = offset.
    Mirror {
        /// The unit normal.
        normal: Point3,
        /// The plane's offset.
        offset: f64,
    },
    /// About an axis by a full turn over `order`, or by any angle.
    Rotation {
        /// A point of the axis.
        point: Point3,
        /// The unit vector along it.
        axis: Point3,
        /// Into how many a full turn is divided; none for a body of revolution.
        order: Option<u32>,
    },
}

/// What was recognised in a scan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recognition {
    /// The entities, those with most points first.
    pub entities: Vec<Entity>,
    /// For each point of the scan the index of its entity.
    pub labels: Vec<Option<u32>>,
    /// The connected pieces of the entities, by entity, those with most points first.
    pub faces: Vec<Face>,
    /// For each point of the scan the index of its face; `None` also in scraps of an entity with
    /// fewer points than an entity needs.
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
    /// The standard deviation of the points along the normal, as they show it; the tolerance where
    /// [`is_form`](Self::is_form) says so.
    pub noise: f64,
    /// True if the scan gives the sides of the normals, or is a mesh: else rays tell them.
    pub is_oriented: bool,
    /// Whether the form of the object deviates from its entities by more than the noise, and
    /// `noise` is the tolerance within which they were found.
    pub is_form: bool,
    /// The share of the points that lie on entities which meet others without an edge and round
    /// none: where it is large, these approximate a free form, and their sizes are those of no
    /// part.
    pub free: f64,
}
