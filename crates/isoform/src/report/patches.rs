//! The report of rational patches on an implicit surface.

use super::Seconds;
use crate::{Coverage, PatchFinding};
use isoform_geom::{Aabb, NormalForm, Point3, Quadric};
use isoform_patch::{Inner, Method, Options, Parameterized, Phase};
use serde::Serialize;

/// Of boxes in which a margin is not proved, and of singular points, there may be thousands: this
/// many are told.
const MOST_PLACES: usize = 100;

/// Everything that is known of patches.
#[derive(Clone, Debug, Serialize)]
pub struct PatchesReport {
    /// Whether everything asked for is kept.
    pub ok: bool,
    /// `parameterize`.
    pub verb: &'static str,
    /// The surface's file or name.
    pub model: String,
    /// Degrees in u and in v.
    pub degree: [usize; 2],
    /// Where surface was wanted.
    #[serde(rename = "box")]
    pub region: BoxReport,
    /// The solver.
    pub method: &'static str,
    /// What the term L measures: `lengths` or `tangents`.
    pub inner: &'static str,
    /// Of everything random.
    pub seed: u64,
    /// Seconds by phase.
    pub seconds: Seconds,
    /// One by patch.
    pub patches: Vec<PatchReport>,
    /// How a cover covers the surface.
    pub coverage: Option<CoverageReport>,
    /// Files written.
    pub files: Vec<String>,
    /// What a reader should know, what is not kept included.
    pub warnings: Vec<String>,
}

/// A box.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BoxReport {
    /// Its lower corner.
    pub lo: Point3,
    /// Its upper corner.
    pub hi: Point3,
}

impl From<&Aabb> for BoxReport {
    fn from(region: &Aabb) -> Self {
        Self {
            lo: region.lo,
            hi: region.hi,
        }
    }
}

/// A patch; the terms are those of the paper's objective.
#[derive(Clone, Debug, Serialize)]
pub struct PatchReport {
    /// S = I + ω_J J + ω_L L + ω_R R + ω_E E.
    #[serde(rename = "S")]
    pub s: f64,
    /// Squared distances from the surface.
    #[serde(rename = "I")]
    pub i: f64,
    /// Control weights.
    #[serde(rename = "J")]
    pub j: f64,
    /// Lengths of tangents inside.
    #[serde(rename = "L")]
    pub l: f64,
    /// Regularity of the sides.
    #[serde(rename = "R")]
    pub r: f64,
    /// Lengths of the sides.
    #[serde(rename = "E")]
    pub e: f64,
    /// Wanted length in u.
    pub l1: f64,
    /// Wanted length in v.
    pub l2: f64,
    /// The factors ω at the end.
    pub weights: WeightsReport,
    /// Steps of the solver.
    pub newton_steps: usize,
    /// Steps of growing.
    pub extrapolation_steps: usize,
    /// Proved bound on the distance from the surface.
    pub max_distance: Option<f64>,
    /// Largest distance of samples.
    pub sampled_distance: f64,
    /// Root of the mean square distance of samples.
    pub rms_distance: f64,
    /// Whether it is proved not to fold over.
    pub unfolded: bool,
    /// Smallest and largest control weight.
    pub control_weights: [f64; 2],
    /// Whether the weight is proved to be positive.
    pub weight_is_positive: bool,
    /// Area in the region.
    pub area: f64,
    /// Whether it lies on the surface to rounding.
    pub exact: bool,
    /// The quadric or torus that it lies on.
    pub entity: Option<Entity>,
    /// Where it began.
    pub seed_point: Point3,
}

/// The factors ω of the paper's objective.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub struct WeightsReport {
    /// Of J.
    pub j: f64,
    /// Of L.
    pub l: f64,
    /// Of R.
    pub r: f64,
    /// Of E.
    pub e: f64,
}

/// How a cover covers the surface.
#[derive(Clone, Debug, Serialize)]
pub struct CoverageReport {
    /// Samples on a patch.
    pub covered: usize,
    /// All samples, but for those left out.
    pub samples: usize,
    /// What was proved of a margin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin: Option<MarginReport>,
    /// What was left out near singular points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<LeftOutReport>,
}

/// What is proved of the margin of a cover.
#[derive(Clone, Debug, Serialize)]
pub struct MarginReport {
    /// The depth asked for.
    pub length: f64,
    /// Whether all of the surface in the region is as deep inside of a patch.
    pub proved: bool,
    /// The largest distance of the surface from the places that are as deep.
    pub max_distance: Option<f64>,
    /// Boxes for which it could not be proved.
    pub open: usize,
    /// Some of them.
    pub boxes: Vec<BoxReport>,
}

/// What a cover leaves out near singular points.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOutReport {
    /// Samples left out.
    pub samples: usize,
    /// How near they are to a singular point.
    pub distance: f64,
    /// Singular points.
    pub singular_points: usize,
    /// Some of them.
    pub points: Vec<Point3>,
}

/// A surface with a name that an exact patch lies on, by its kind.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Entity {
    /// A plane.
    Plane {
        /// `plane`.
        kind: &'static str,
        /// Unit normal.
        normal: Point3,
        /// Distance from the origin along the normal.
        offset: f64,
    },
    /// A sphere.
    Sphere {
        /// `sphere`.
        kind: &'static str,
        /// Centre.
        center: Point3,
        /// Radius.
        radius: f64,
    },
    /// A cylinder of revolution.
    Cylinder {
        /// `cylinder`.
        kind: &'static str,
        /// A point of the axis.
        point: Point3,
        /// Direction of the axis.
        axis: Point3,
        /// Radius.
        radius: f64,
    },
    /// A cone of revolution.
    Cone {
        /// `cone`.
        kind: &'static str,
        /// Apex.
        apex: Point3,
        /// Direction of the axis.
        axis: Point3,
        /// Angle between axis and lines, in radians.
        half_angle: f64,
    },
    /// A torus.
    Torus {
        /// `torus`.
        kind: &'static str,
        /// Centre.
        center: Point3,
        /// Direction of the axis.
        axis: Point3,
        /// Radius of the circle of centres.
        major_radius: f64,
        /// Radius of the tube.
        minor_radius: f64,
    },
    /// Another quadric, with its normal form if it has one.
    Other {
        /// Its name.
        kind: &'static str,
        /// Centre or apex.
        center: Option<Point3>,
        /// Axes of the normal form, by rows.
        axes: Option<[Point3; 3]>,
        /// Half axes, or the parameters of the normal form.
        measures: Option<Vec<f64>>,
        /// The origin of the equation's coordinates.
        origin: Point3,
        /// Their unit of length.
        scale: f64,
        /// The equation's coefficients.
        coefficients: [f64; 10],
    },
}

/// Patches and what is known of them.
#[derive(Clone, Copy, Debug)]
pub struct AboutPatches<'a> {
    /// The surface's file or name.
    pub model: &'a str,
    /// What was asked for.
    pub options: &'a Options,
    /// The patches.
    pub patches: &'a [Parameterized],
    /// How a cover covers the surface.
    pub coverage: Option<&'a Coverage>,
    /// What is not kept.
    pub findings: &'a [PatchFinding],
    /// Files written.
    pub files: &'a [String],
    /// What a reader should know.
    pub warnings: &'a [String],
    /// Seconds by phase.
    pub seconds: &'a [(&'a str, f64)],
}

impl PatchesReport {
    /// Everything that is known of patches.
    pub fn new(about: &AboutPatches<'_>) -> Self {
        let options = about.options;
        let patches = about.patches.iter();
        Self {
            ok: about.findings.is_empty(),
            verb: "parameterize",
            model: about.model.to_owned(),
            degree: [options.degree.0, options.degree.1],
            region: BoxReport::from(&options.region),
            method: solver_name(options.method),
            inner: match options.inner {
                Inner::Tangents => "tangents",
                Inner::Lengths => "lengths",
            },
            seed: options.seed,
            seconds: Seconds::of(about.seconds),
            patches: patches
                .map(|p| PatchReport::new(p, &options.region))
                .collect(),
            coverage: about.coverage.map(CoverageReport::new),
            files: about.files.to_vec(),
            warnings: about.warnings.to_vec(),
        }
    }
}

impl PatchReport {
    fn new(p: &Parameterized, region: &Aabb) -> Self {
        let (g, t, w) = (&p.grown, &p.grown.terms, &p.grown.weights);
        let (least, most) = g.patch.control_weights();
        Self {
            s: g.sum(),
            i: t.i,
            j: t.j,
            l: t.l,
            r: t.r,
            e: t.e,
            l1: g.targets.l1,
            l2: g.targets.l2,
            weights: WeightsReport {
                j: w.j,
                l: w.l,
                r: w.r,
                e: w.e,
            },
            newton_steps: g.count(Phase::Newton),
            extrapolation_steps: g.count(Phase::Grow),
            max_distance: p.distances.bound,
            sampled_distance: p.distances.sampled,
            rms_distance: p.distances.rms,
            unfolded: p.is_unfolded,
            control_weights: [least, most],
            weight_is_positive: g.patch.weight_is_positive(8),
            area: g.area(region),
            exact: p.is_exact,
            entity: p.quadric.as_ref().map(Entity::of),
            seed_point: g.seed_point,
        }
    }
}

impl CoverageReport {
    fn new(c: &Coverage) -> Self {
        let margin = c.depth.as_ref().map(|depth| MarginReport {
            length: depth.margin,
            proved: depth.distance.is_some(),
            max_distance: depth.distance,
            open: depth.open.len(),
            boxes: depth
                .open
                .iter()
                .take(MOST_PLACES)
                .map(BoxReport::from)
                .collect(),
        });
        let left_out = (c.left_out > 0).then(|| LeftOutReport {
            samples: c.left_out,
            distance: c.apart,
            singular_points: c.singular.len(),
            points: c.singular.iter().take(MOST_PLACES).copied().collect(),
        });
        Self {
            covered: c.covered,
            samples: c.samples,
            margin,
            left_out,
        }
    }
}

impl Entity {
    /// The entity of an exact patch.
    pub fn of(quadric: &Quadric) -> Self {
        let kind = quadric.name();
        match *quadric {
            Quadric::Plane { normal, offset } => Self::Plane {
                kind,
                normal,
                offset,
            },
            Quadric::Sphere { center, radius } => Self::Sphere {
                kind,
                center,
                radius,
            },
            Quadric::Cylinder {
                point,
                axis,
                radius,
            } => Self::Cylinder {
                kind,
                point,
                axis,
                radius,
            },
            Quadric::Cone {
                apex,
                axis,
                half_angle,
            } => Self::Cone {
                kind,
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
                kind,
                center,
                axis,
                major_radius: major,
                minor_radius: minor,
            },
            Quadric::Other {
                form,
                origin,
                scale,
                coefficients,
            } => {
                let measures = |f: &NormalForm| f.measures[..f.kind.measures()].to_vec();
                Self::Other {
                    kind,
                    center: form.map(|f| f.center),
                    axes: form.map(|f| f.axes),
                    measures: form.as_ref().map(measures),
                    origin,
                    scale,
                    coefficients,
                }
            }
        }
    }
}

/// The word for a solver, as `--method` takes it.
pub fn solver_name(method: Method) -> &'static str {
    match method {
        Method::GaussNewton => "gauss-newton",
        Method::Frozen => "frozen",
        Method::Newton => "newton",
    }
}
