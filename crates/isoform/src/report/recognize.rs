//! Report of a recognition.

use isoform_geom::{Point3, Quadric};
use isoform_recognize::{
    Blend, Entity, Face, Feature, FeatureKind, Layout, Pattern, Recognition, Relation, Snap,
    Symmetry, SymmetryKind, Widening, features,
};
use serde::Serialize;

/// Report of `recognize`: the surfaces that a scan or a CAD mesh consists of. Lengths are in the
/// scan's unit, points are `[x, y, z]`; indices count from 0.
#[derive(Clone, Debug, Serialize)]
pub struct RecognizeReport {
    /// Name of the verb: `recognize`.
    pub verb: &'static str,
    /// Number of points examined.
    pub points: usize,
    /// Standard deviation of the points along the normal; if `form` is true, the tolerance within
    /// which the surfaces were found.
    pub noise: f64,
    /// True if the form of the object deviates from the surfaces by more than the noise of the
    /// points.
    pub form: bool,
    /// Share of the points on entities that meet others without an edge and are not blends. If it
    /// is large, the entities approximate a free form.
    pub free: f64,
    /// Surfaces, those with most points first; of labels given by hand in ascending order of these.
    pub entities: Vec<EntityReport>,
    /// Connected pieces of the surfaces.
    pub faces: Vec<RecognizedFaceReport>,
    /// Holes, bosses, slots and pockets, with their depths.
    pub features: Vec<FeatureReport>,
    /// Relations between two surfaces each, such as parallel axes.
    pub relations: Vec<RelationReport>,
    /// Rows and circles of equal surfaces.
    pub patterns: Vec<PatternReport>,
    /// Mirrors and rotations of all or nearly all surfaces.
    pub symmetries: Vec<SymmetryReport>,
    /// Surfaces that round the edge of others.
    pub blends: Vec<BlendReport>,
    /// Changes by which the relations were made exact; `None` if that was not requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub snap: Option<SnapReport>,
    /// Number of points without a surface.
    pub n_unassigned: usize,
    /// Computing time, in seconds.
    pub seconds: f64,
}

/// Surface with the points that it explains.
#[derive(Clone, Debug, Serialize)]
pub struct EntityReport {
    /// Index of the surface, as in labels and relations.
    pub id: usize,
    /// Kind of surface: `plane`, `sphere`, `cylinder`, `cone` or `torus`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Parameters of the surface.
    pub parameters: Parameters,
    /// Standard deviations of the parameters.
    pub sd: Parameters,
    /// Outer side: +1 if the outside is away from the centre or axis, or along a plane's normal; −1
    /// if it is the other side, as in a hole; 0 if the points do not decide.
    pub outward: i8,
    /// Range of its points along the axis, from the point, the apex or the centre; `None` for
    /// planes and spheres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extent: Option<[f64; 2]>,
    /// Number of points that it explains.
    pub n_points: usize,
    /// Root mean square distance of these points from it.
    pub rms: f64,
    /// Label that these points were given by hand; `None` if they were found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub label: Option<u32>,
    /// True if it explains these points within the noise; `None` if they were found, since it does
    /// then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explained: Option<bool>,
}

/// Connected piece of a surface.
#[derive(Clone, Debug, Serialize)]
pub struct RecognizedFaceReport {
    /// Index of the face, as in labels.
    pub id: usize,
    /// Index of its surface.
    pub entity: usize,
    /// Number of its points.
    pub n_points: usize,
    /// Indices of the adjacent faces.
    pub beside: Vec<usize>,
    /// Border of a flat face: closed polygons, counterclockwise seen from outside, holes clockwise;
    /// of points to within their spacing. Absent for curved faces.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub border: Vec<Vec<Point3>>,
}

/// Hole, boss, slot or pocket. Lengths are between the surfaces that bound it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FeatureReport {
    /// Kind of feature: `hole`, `boss`, `slot` or `pocket`.
    pub kind: &'static str,
    /// Indices of the faces that bound it.
    pub faces: Vec<usize>,
    /// Middle of its mouth, or of the base of a boss.
    pub point: Point3,
    /// Unit vector from there into it.
    pub direction: Point3,
    /// Depth, or height of a boss.
    pub depth: f64,
    /// True if its other end is open; `None` for bosses and pockets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub through: Option<bool>,
    /// Radius of a boss, or of the narrowest cylinder of a hole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Distance between the sides of a slot, or the nearer sides of a pocket.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<f64>,
    /// Distance between the ends of a slot, or the other sides of a pocket.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// Wider parts of a hole, from the mouth on.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub widenings: Vec<WideningReport>,
}

/// Wider part of a hole.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct WideningReport {
    /// Kind: `counterbore` or `countersink`.
    pub kind: &'static str,
    /// Place: `mouth`, or `bottom` for the other end of a hole that goes through.
    pub end: &'static str,
    /// Radius at its outer end.
    pub radius: f64,
    /// Length along the axis.
    pub depth: f64,
    /// Half angle of a countersink, in radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_angle: Option<f64>,
}

/// Parameters of a surface, or their standard deviations; a vector of deviations has one per
/// component.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Parameters {
    /// Plane normal · x = d.
    Plane {
        /// Unit normal.
        normal: Point3,
        /// Offset d.
        d: f64,
    },
    /// Sphere.
    Sphere {
        /// Centre.
        center: Point3,
        /// Radius.
        radius: f64,
    },
    /// Cylinder of revolution.
    Cylinder {
        /// Point of the axis.
        point: Point3,
        /// Unit vector along the axis.
        axis: Point3,
        /// Radius.
        radius: f64,
    },
    /// Cone of revolution.
    Cone {
        /// Apex.
        apex: Point3,
        /// Unit vector along the axis, from the apex into the nappe that holds the points.
        axis: Point3,
        /// Angle between the axis and the surface, in radians.
        half_angle: f64,
    },
    /// Torus.
    Torus {
        /// Centre.
        center: Point3,
        /// Unit vector along the axis.
        axis: Point3,
        /// Radius of the circle of the tube's centres.
        major_radius: f64,
        /// Radius of the tube.
        minor_radius: f64,
    },
}

/// Relation between two surfaces.
#[derive(Clone, Debug, Serialize)]
pub struct RelationReport {
    /// Kind of relation: `parallel`, `perpendicular`, `coaxial`, `coplanar`, `concentric` or
    /// `equal_radius`.
    pub kind: &'static str,
    /// Indices of the two surfaces.
    pub entities: [usize; 2],
    /// Deviation from the relation: in radians for directions, a length for positions and radii.
    pub deviation: f64,
}

/// Equal surfaces at equal distances or angles.
#[derive(Clone, Debug, Serialize)]
pub struct PatternReport {
    /// Indices of the surfaces at each position, in order; pieces of one plane or bore share a
    /// position.
    pub members: Vec<Vec<usize>>,
    /// Layout of the positions.
    #[serde(flatten)]
    pub layout: LayoutReport,
    /// Largest distance of a surface from its position.
    pub deviation: f64,
}

/// Layout of the members of a pattern.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum LayoutReport {
    /// Row: equidistant positions on a line.
    Linear {
        /// Unit vector from a member to the next.
        direction: Point3,
        /// Distance from a member to the next.
        spacing: f64,
        /// Standard deviation of the spacing.
        spacing_sd: f64,
    },
    /// Positions on a circle at equal angles.
    Circular {
        /// Centre of the pitch circle.
        center: Point3,
        /// Unit vector along the circle's axis, about which members follow one another
        /// anticlockwise.
        axis: Point3,
        /// Radius of the pitch circle.
        radius: f64,
        /// Standard deviation of the radius.
        radius_sd: f64,
        /// Angle from a member to the next, in radians.
        angle: f64,
        /// Standard deviation of the angle; 0 if the circle is closed.
        angle_sd: f64,
        /// True if the members occupy the full circle, false if they are on an arc.
        closed: bool,
        /// Index of a surface whose axis is that of the circle; `None` if no surface has it.
        coaxial: Option<usize>,
    },
}

/// Mirror or rotation that maps the surfaces to one another.
#[derive(Clone, Debug, Serialize)]
pub struct SymmetryReport {
    /// The motion.
    #[serde(flatten)]
    pub motion: MotionReport,
    /// Index of the image of each surface; null for those in `unmatched`.
    pub images: Vec<Option<usize>>,
    /// Indices of the surfaces without an image: few, with at most a twentieth of the points.
    pub unmatched: Vec<usize>,
    /// Largest deviation of a surface's position or size from its image's.
    pub deviation: f64,
}

/// Mirror or rotation.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum MotionReport {
    /// Reflection in the plane normal · x = d.
    Mirror {
        /// Unit normal.
        normal: Point3,
        /// Offset d.
        d: f64,
    },
    /// Rotation about an axis by a full turn divided by the order.
    Rotation {
        /// Point of the axis.
        point: Point3,
        /// Unit vector along the axis.
        axis: Point3,
        /// Order of the rotation; null if any angle will do.
        order: Option<u32>,
    },
}

/// Surface that rounds the edge of others with a constant radius.
#[derive(Clone, Debug, Serialize)]
pub struct BlendReport {
    /// Index of the cylinder, torus or sphere.
    pub entity: usize,
    /// Indices of the surfaces that it touches.
    pub between: Vec<usize>,
    /// Radius of the blend; of a torus, that of the tube.
    pub radius: f64,
}

/// Changes by which the relations were made exact.
#[derive(Clone, Debug, Serialize)]
pub struct SnapReport {
    /// Largest motion of each surface at its points, along their normals.
    pub moved: Vec<f64>,
    /// Root mean square distance of the points from their surfaces before.
    pub rms_before: f64,
    /// Root mean square distance of the points from their surfaces after.
    pub rms_after: f64,
    /// Increase of the sum of squares, in variances of the points: χ² with `conditions` degrees of
    /// freedom if the relations are true.
    pub chi_squared: f64,
    /// Number of independent equations that express the relations.
    pub conditions: usize,
    /// Relations that were given up because they contradict the points or one another.
    pub dropped: Vec<RelationReport>,
}

impl SnapReport {
    /// Creates the report of the changes.
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
    /// Creates the report of a recognition in some points, which took `seconds`.
    pub fn new(found: &Recognition, points: &[Point3], seconds: f64) -> Self {
        let entities = found.entities.iter().enumerate();
        let faces = found.faces.iter().enumerate();
        Self {
            verb: "recognize",
            points: found.labels.len(),
            noise: found.noise,
            form: found.is_form,
            free: found.free,
            entities: entities.map(|(id, e)| EntityReport::new(id, e)).collect(),
            faces: faces
                .map(|(id, face)| RecognizedFaceReport::new(id, face))
                .collect(),
            features: features(points, found)
                .iter()
                .map(FeatureReport::new)
                .collect(),
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

impl RecognizedFaceReport {
    fn new(id: usize, face: &Face) -> Self {
        Self {
            id,
            entity: face.entity,
            n_points: face.points,
            beside: face.beside.clone(),
            border: face.border.clone(),
        }
    }
}

impl FeatureReport {
    fn new(feature: &Feature) -> Self {
        let common = Self {
            faces: feature.faces.iter().copied().collect(),
            point: feature.point,
            direction: feature.direction,
            depth: feature.depth,
            ..Self::default()
        };
        match &feature.kind {
            FeatureKind::Hole {
                radius,
                is_through,
                widenings,
            } => Self {
                kind: "hole",
                radius: Some(*radius),
                through: Some(*is_through),
                widenings: widenings.iter().map(WideningReport::new).collect(),
                ..common
            },
            FeatureKind::Boss { radius } => Self {
                kind: "boss",
                radius: Some(*radius),
                ..common
            },
            FeatureKind::Slot {
                width,
                length,
                is_through,
            } => Self {
                kind: "slot",
                width: Some(*width),
                length: Some(*length),
                through: Some(*is_through),
                ..common
            },
            FeatureKind::Pocket { width, length } => Self {
                kind: "pocket",
                width: Some(*width),
                length: Some(*length),
                ..common
            },
        }
    }
}

impl WideningReport {
    fn new(of: &Widening) -> Self {
        Self {
            kind: match of.half_angle {
                Some(_) => "countersink",
                None => "counterbore",
            },
            end: if of.is_at_mouth { "mouth" } else { "bottom" },
            radius: of.radius,
            depth: of.depth,
            half_angle: of.half_angle,
        }
    }
}

impl EntityReport {
    fn new(id: usize, entity: &Entity) -> Self {
        Self {
            id,
            kind: entity.surface.name(),
            parameters: Parameters::from_entity(entity),
            sd: Parameters::deviations(entity),
            outward: entity.outward,
            extent: match entity.surface {
                Quadric::Plane { .. } | Quadric::Sphere { .. } => None,
                _ => Some(entity.extent),
            },
            n_points: entity.points,
            rms: entity.rms,
            label: entity.label,
            explained: entity.label.map(|_| entity.is_explained),
        }
    }
}

impl Parameters {
    fn from_entity(entity: &Entity) -> Self {
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
        match Self::from_entity(entity) {
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
            kind: relation.kind.name(),
            entities: relation.entities,
            deviation: relation.deviation,
        }
    }
}
