//! The report of a recognition.

use isoform_geom::{Point3, Quadric};
use isoform_recognize::{
    Blend, Entity, Face, Layout, Pattern, Recognition, Relation, RelationKind, Snap, Symmetry,
    SymmetryKind,
};
use serde::Serialize;

/// What was recognised in a scan; lengths in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct RecognizeReport {
    /// `recognize`.
    pub verb: &'static str,
    /// The points looked at.
    pub points: usize,
    /// The deviation of points along the normal; the tolerance of form, where `form` says so.
    pub noise: f64,
    /// Whether the object's form deviates from the surfaces by more than the noise of the points.
    pub form: bool,
    /// The share of the points on entities that meet others without an edge and round none.
    pub free: f64,
    /// The surfaces, those with most points first.
    pub entities: Vec<EntityReport>,
    /// The connected pieces of the surfaces.
    pub faces: Vec<FaceReport>,
    /// How they lie to one another.
    pub relations: Vec<RelationReport>,
    /// Rows and circles of equal entities.
    pub patterns: Vec<PatternReport>,
    /// Mirrors and rotations of all or nearly all entities.
    pub symmetries: Vec<SymmetryReport>,
    /// Entities that round the edge of others.
    pub blends: Vec<BlendReport>,
    /// What making the relations exact changed, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub snap: Option<SnapReport>,
    /// The points that no entity explains.
    pub n_unassigned: usize,
    /// The time that it took.
    pub seconds: f64,
}

/// A surface.
#[derive(Clone, Debug, Serialize)]
pub struct EntityReport {
    /// What labels and relations call it.
    pub id: usize,
    /// `plane`, `sphere`, `cylinder`, `cone` or `torus`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Its parameters.
    pub parameters: Parameters,
    /// Their standard deviations.
    pub sd: Parameters,
    /// +1 where the outside is away from the centre or axis, or along a plane's normal; −1 where it
    /// is the other side, as in a hole; 0 where the points do not tell.
    pub outward: i8,
    /// The points that it explains.
    pub n_points: usize,
    /// The root mean square of their distances.
    pub rms: f64,
}

/// A connected piece of a surface.
#[derive(Clone, Debug, Serialize)]
pub struct FaceReport {
    /// Index of the face, as in labels.
    pub id: usize,
    /// Index of its entity.
    pub entity: usize,
    /// Number of its points.
    pub n_points: usize,
    /// Indices of the faces at its boundary.
    pub beside: Vec<usize>,
}

/// Parameters of a surface, or their deviations.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Parameters {
    /// normal · x = d.
    Plane {
        /// The unit normal.
        normal: Point3,
        /// d.
        d: f64,
    },
    /// A sphere.
    Sphere {
        /// Its centre.
        center: Point3,
        /// Its radius.
        radius: f64,
    },
    /// A cylinder.
    Cylinder {
        /// A point of the axis.
        point: Point3,
        /// The unit vector along the axis.
        axis: Point3,
        /// Its radius.
        radius: f64,
    },
    /// A cone.
    Cone {
        /// Its apex.
        apex: Point3,
        /// The unit vector along the axis, into the nappe.
        axis: Point3,
        /// The angle between axis and surface, in radians.
        half_angle: f64,
    },
    /// A torus.
    Torus {
        /// Its centre.
        center: Point3,
        /// The unit vector along the axis.
        axis: Point3,
        /// The radius of the circle.
        major_radius: f64,
        /// The radius of the tube.
        minor_radius: f64,
    },
}

/// A relation of two entities.
#[derive(Clone, Debug, Serialize)]
pub struct RelationReport {
    /// `parallel`, `perpendicular`, `coaxial`, `coplanar`, `concentric` or `equal_radius`.
    pub kind: &'static str,
    /// The two.
    pub entities: [usize; 2],
    /// By how much it fails: radians for directions, lengths for places and radii.
    pub deviation: f64,
}

/// Equal entities at equal distances or angles.
#[derive(Clone, Debug, Serialize)]
pub struct PatternReport {
    /// The entities at each place, in order.
    pub members: Vec<Vec<usize>>,
    /// How they are laid out.
    #[serde(flatten)]
    pub layout: LayoutReport,
    /// How far an entity is off its place at most.
    pub deviation: f64,
}

/// How the members of a pattern are laid out.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum LayoutReport {
    /// In a row.
    Linear {
        /// The unit vector from a member to the next.
        direction: Point3,
        /// The distance from a member to the next.
        spacing: f64,
        /// Its standard deviation.
        spacing_sd: f64,
    },
    /// On a circle.
    Circular {
        /// The centre of the pitch circle.
        center: Point3,
        /// The unit vector along its axis; members follow one another anticlockwise about it.
        axis: Point3,
        /// The radius of the pitch circle.
        radius: f64,
        /// Its standard deviation.
        radius_sd: f64,
        /// From a member to the next, in radians.
        angle: f64,
        /// Its standard deviation; 0 where members go round.
        angle_sd: f64,
        /// Whether members go round once.
        closed: bool,
        /// The entity whose axis is that of the circle, if there is one.
        coaxial: Option<usize>,
    },
}

/// A mirror or a rotation that maps entities to one another.
#[derive(Clone, Debug, Serialize)]
pub struct SymmetryReport {
    /// Which.
    #[serde(flatten)]
    pub motion: MotionReport,
    /// The image of each entity; null for those of `unmatched`.
    pub images: Vec<Option<usize>>,
    /// Entities without an image: few, with at most a twentieth of the points.
    pub unmatched: Vec<usize>,
    /// How far an entity's place or size is off its image's at most.
    pub deviation: f64,
}

/// A mirror or a rotation.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum MotionReport {
    /// In the plane normal · x = d.
    Mirror {
        /// The unit normal.
        normal: Point3,
        /// d.
        d: f64,
    },
    /// By a full turn over the order.
    Rotation {
        /// A point of the axis.
        point: Point3,
        /// The unit vector along it.
        axis: Point3,
        /// Into how many parts a full turn is divided; null where any angle will do.
        order: Option<u32>,
    },
}

/// An entity that rounds the edge of others with a constant radius.
#[derive(Clone, Debug, Serialize)]
pub struct BlendReport {
    /// The cylinder, torus or sphere.
    pub entity: usize,
    /// Those that it touches.
    pub between: Vec<usize>,
    /// Its radius.
    pub radius: f64,
}

/// What making the relations exact changed.
#[derive(Clone, Debug, Serialize)]
pub struct SnapReport {
    /// For each entity how far it moved at most at its points, along their normals.
    pub moved: Vec<f64>,
    /// The root mean square distance of the entities' points before.
    pub rms_before: f64,
    /// That after.
    pub rms_after: f64,
    /// By how much the sum of squares rose, in variances of the points: of χ² with `conditions`
    /// degrees of freedom where the relations are true.
    pub chi_squared: f64,
    /// The independent equations that the relations are.
    pub conditions: usize,
    /// Relations that contradict the points or one another, as they were found.
    pub dropped: Vec<RelationReport>,
}

impl SnapReport {
    /// The report of a snap.
    pub fn new(snap: &Snap) -> Self {
        Self {
            moved: snap.moved.clone(),
            rms_before: snap.rms[0],
            rms_after: snap.rms[1],
            chi_squared: snap.chi_squared,
            conditions: snap.conditions,
            dropped: snap.dropped.iter().map(RelationReport::new).collect(),
        }
    }
}

impl PatternReport {
    fn new(pattern: &Pattern) -> Self {
        Self {
            members: pattern.members.clone(),
            layout: LayoutReport::new(&pattern.layout),
            deviation: pattern.deviation,
        }
    }
}

impl LayoutReport {
    fn new(layout: &Layout) -> Self {
        match *layout {
            Layout::Row {
                direction,
                spacing,
                spacing_deviation,
            } => Self::Linear {
                direction,
                spacing,
                spacing_sd: spacing_deviation,
            },
            Layout::Circle {
                center,
                axis,
                radius,
                radius_deviation,
                angle,
                angle_deviation,
                is_closed,
                coaxial,
            } => Self::Circular {
                center,
                axis,
                radius,
                radius_sd: radius_deviation,
                angle,
                angle_sd: angle_deviation,
                closed: is_closed,
                coaxial,
            },
        }
    }
}

impl SymmetryReport {
    fn new(symmetry: &Symmetry) -> Self {
        let images = symmetry.images.iter().enumerate();
        Self {
            motion: match symmetry.kind {
                SymmetryKind::Mirror { normal, offset } => {
                    MotionReport::Mirror { normal, d: offset }
                }
                SymmetryKind::Rotation { point, axis, order } => {
                    MotionReport::Rotation { point, axis, order }
                }
            },
            unmatched: images.filter(|i| i.1.is_none()).map(|i| i.0).collect(),
            images: symmetry.images.clone(),
            deviation: symmetry.deviation,
        }
    }
}

impl BlendReport {
    fn new(blend: &Blend) -> Self {
        Self {
            entity: blend.entity,
            between: blend.between.clone(),
            radius: blend.radius,
        }
    }
}

impl RecognizeReport {
    /// The report of a recognition that took some seconds.
    pub fn new(found: &Recognition, seconds: f64) -> Self {
        let entities = found.entities.iter().enumerate();
        let faces = found.faces.iter().enumerate();
        Self {
            verb: "recognize",
            points: found.labels.len(),
            noise: found.noise,
            form: found.is_form,
            free: found.free,
            entities: entities.map(|(id, e)| EntityReport::new(id, e)).collect(),
            faces: faces.map(|(id, face)| FaceReport::new(id, face)).collect(),
            relations: found.relations.iter().map(RelationReport::new).collect(),
            patterns: found.patterns.iter().map(PatternReport::new).collect(),
            symmetries: found.symmetries.iter().map(SymmetryReport::new).collect(),
            blends: found.blends.iter().map(BlendReport::new).collect(),
            snap: None,
            n_unassigned: found.labels.iter().filter(|l| l.is_none()).count(),
            seconds,
        }
    }
}

impl FaceReport {
    fn new(id: usize, face: &Face) -> Self {
        Self {
            id,
            entity: face.entity,
            n_points: face.points,
            beside: face.beside.clone(),
        }
    }
}

impl EntityReport {
    fn new(id: usize, entity: &Entity) -> Self {
        Self {
            id,
            kind: entity.surface.name(),
            parameters: Parameters::of(entity),
            sd: Parameters::deviations(entity),
            outward: entity.outward,
            n_points: entity.points,
            rms: entity.rms,
        }
    }
}

impl Parameters {
    fn of(entity: &Entity) -> Self {
        match entity.surface {
            Quadric::Plane { normal, offset } => Self::Plane { normal, d: offset },
            Quadric::Sphere { center, radius } => Self::Sphere { center, radius },
            Quadric::Cylinder {
                point,
                axis,
                radius,
            } => Self::Cylinder {
                point,
                axis,
                radius,
            },
            Quadric::Cone {
                apex,
                axis,
                half_angle,
            } => Self::Cone {
                apex,
                axis,
                half_angle,
            },
            Quadric::Torus {
                center,
                axis,
                major,
                minor,
            } => Self::Torus {
                center,
                axis,
                major_radius: major,
                minor_radius: minor,
            },
            Quadric::Other { .. } => unreachable!("entities are of the five kinds"),
        }
    }

    fn deviations(entity: &Entity) -> Self {
        let d = entity.deviations;
        match Self::of(entity) {
            Self::Plane { .. } => Self::Plane {
                normal: d.direction,
                d: d.size,
            },
            Self::Sphere { .. } => Self::Sphere {
                center: d.place,
                radius: d.size,
            },
            Self::Cylinder { .. } => Self::Cylinder {
                point: d.place,
                axis: d.direction,
                radius: d.size,
            },
            Self::Cone { .. } => Self::Cone {
                apex: d.place,
                axis: d.direction,
                half_angle: d.size,
            },
            Self::Torus { .. } => Self::Torus {
                center: d.place,
                axis: d.direction,
                major_radius: d.size,
                minor_radius: d.minor,
            },
        }
    }
}

impl RelationReport {
    fn new(relation: &Relation) -> Self {
        Self {
            kind: match relation.kind {
                RelationKind::Parallel => "parallel",
                RelationKind::Perpendicular => "perpendicular",
                RelationKind::Coaxial => "coaxial",
                RelationKind::Coplanar => "coplanar",
                RelationKind::Concentric => "concentric",
                RelationKind::EqualRadius => "equal_radius",
            },
            entities: relation.entities,
            deviation: relation.deviation,
        }
    }
}
