//! Report of rational patches on an implicit surface.

use super::Seconds;
use crate::{Coverage, PatchFinding};
use isoform_geom::{Aabb, NormalForm, Point3, Quadric};
use isoform_patch::{Inner, Method, Options, Parameterized, Phase};
use serde::Serialize;

/// Maximum number of places listed, both of boxes in which a margin is not proved and of singular
/// points, of which there may be thousands.
const MAX_LISTED_PLACES: usize = 100;

/// Report of `parameterize`: rational patches on an implicit surface, with proved distances.
/// Lengths are in model units, points are `[x, y, z]`.
#[derive(Clone, Debug, Serialize)]
pub struct PatchesReport {
    /// True if every requirement of the options is met.
    pub ok: bool,
    /// Name of the verb: `parameterize`.
    pub verb: &'static str,
    /// Name of the surface, or of its file.
    pub model: String,
    /// Degrees of the patches in u and in v.
    pub degree: [usize; 2],
    /// Box in which patches were requested.
    #[serde(rename = "box")]
    pub region: BoxReport,
    /// Name of the solver: `gauss-newton`, `frozen` or `newton`.
    pub method: &'static str,
    /// Integrand of the term L: `lengths` or `tangents`.
    pub inner: &'static str,
    /// Seed of the pseudo-random numbers.
    pub seed: u64,
    /// Computing time by phase, in seconds.
    pub seconds: Seconds,
    /// Patches, in the order in which they were made.
    pub patches: Vec<PatchReport>,
    /// Coverage of the surface by the patches; `None` if a single patch was requested.
    pub coverage: Option<CoverageReport>,
    /// Paths of the files that were written.
    pub files: Vec<String>,
    /// Warnings, a sentence each; requirements that are not met are among them.
    pub warnings: Vec<String>,
}

/// Box with edges along the axes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BoxReport {
    /// Lower corner.
    pub lo: Point3,
    /// Upper corner.
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

/// Patch, with the terms of the objective of Wurm, Jüttler and Kim (2003), equation (1).
#[derive(Clone, Debug, Serialize)]
pub struct PatchReport {
    /// Objective S = I + ω_J J + ω_L L + ω_R R + ω_E E.
    #[serde(rename = "S")]
    pub s: f64,
    /// Term I: mean squared distance from the surface, to first order.
    #[serde(rename = "I")]
    pub i: f64,
    /// Term J: control weights.
    #[serde(rename = "J")]
    pub j: f64,
    /// Term L: lengths of the tangents inside of the patch.
    #[serde(rename = "L")]
    pub l: f64,
    /// Term R: angles between the tangents.
    #[serde(rename = "R")]
    pub r: f64,
    /// Term E: distances of the corners from their targets.
    #[serde(rename = "E")]
    pub e: f64,
    /// Target l₁ of the squared length of ∂p/∂u.
    pub l1: f64,
    /// Target l₂ of the squared length of ∂p/∂v.
    pub l2: f64,
    /// Final factors ω of the terms.
    pub weights: WeightsReport,
    /// Number of steps of the solver.
    pub newton_steps: usize,
    /// Number of steps by which the patch was extrapolated.
    pub extrapolation_steps: usize,
    /// Proved upper bound on the distance of any point of the patch from the surface; `None` if
    /// none could be proved.
    pub max_distance: Option<f64>,
    /// Largest distance of samples of the patch from the surface.
    pub sampled_distance: f64,
    /// Root mean square distance of samples of the patch from the surface.
    pub rms_distance: f64,
    /// True if the patch is proved not to fold over.
    pub unfolded: bool,
    /// Smallest and largest control weight.
    pub control_weights: [f64; 2],
    /// True if the denominator of the patch is proved to be positive.
    pub weight_is_positive: bool,
    /// Area of the patch within the box, to a few per cent.
    pub area: f64,
    /// True if the patch lies on the surface to rounding.
    pub exact: bool,
    /// Quadric or torus on which an exact patch lies; `None` if it lies on neither.
    pub entity: Option<Entity>,
    /// Point of the surface from which the patch was grown.
    pub seed_point: Point3,
}

/// Factors ω of the objective's terms.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub struct WeightsReport {
    /// Factor ω_J of the control weights.
    pub j: f64,
    /// Factor ω_L of the lengths of tangents.
    pub l: f64,
    /// Factor ω_R of the angles between tangents.
    pub r: f64,
    /// Factor ω_E of the corners.
    pub e: f64,
}

/// Coverage of a surface by patches, measured by samples of the surface.
#[derive(Clone, Debug, Serialize)]
pub struct CoverageReport {
    /// Number of samples that lie on a patch and, with a margin, deep enough.
    pub covered: usize,
    /// Number of samples, those near singular points left out.
    pub samples: usize,
    /// Result of the proof of the margin; `None` if no margin was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin: Option<MarginReport>,
    /// Surface left out near singular points; `None` if all of it counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<LeftOutReport>,
}

/// Result of the proof that the surface lies inside patches by a margin.
#[derive(Clone, Debug, Serialize)]
pub struct MarginReport {
    /// Requested depth, in model units: the distance from the border of a patch.
    pub length: f64,
    /// True if every point of the surface in the box is proved to lie that deep inside a patch.
    pub proved: bool,
    /// Proved upper bound on the distance of the surface from points of patches at that depth;
    /// `None` if some boxes are open.
    pub max_distance: Option<f64>,
    /// Number of boxes in which the depth could not be proved.
    pub open: usize,
    /// The first of these boxes, at most 100.
    pub boxes: Vec<BoxReport>,
}

/// Surface that a cover leaves out near singular points.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOutReport {
    /// Number of samples left out.
    pub samples: usize,
    /// Radius around singular points within which samples may be left out, in model units.
    pub distance: f64,
    /// Number of singular points; of singular curves, sample points count.
    pub singular_points: usize,
    /// The first of these points, at most 100.
    pub points: Vec<Point3>,
}

/// Plane, quadric or torus on which an exact patch lies, by its kind; lengths in model units.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Entity {
    /// Plane normal · x = offset.
    Plane {
        /// Name of the kind: `plane`.
        kind: &'static str,
        /// Unit normal.
        normal: Point3,
        /// Signed distance of the plane from the origin along the normal.
        offset: f64,
    },
    /// Sphere.
    Sphere {
        /// Name of the kind: `sphere`.
        kind: &'static str,
        /// Centre.
        center: Point3,
        /// Radius.
        radius: f64,
    },
    /// Cylinder of revolution.
    Cylinder {
        /// Name of the kind: `cylinder`.
        kind: &'static str,
        /// Point of the axis.
        point: Point3,
        /// Unit vector along the axis.
        axis: Point3,
        /// Radius.
        radius: f64,
    },
    /// Cone of revolution.
    Cone {
        /// Name of the kind: `cone`.
        kind: &'static str,
        /// Apex.
        apex: Point3,
        /// Unit vector along the axis.
        axis: Point3,
        /// Angle between the axis and the lines of the cone, in radians.
        half_angle: f64,
    },
    /// Torus.
    Torus {
        /// Name of the kind: `torus`.
        kind: &'static str,
        /// Centre.
        center: Point3,
        /// Unit vector along the axis.
        axis: Point3,
        /// Radius of the circle of the tube's centres.
        major_radius: f64,
        /// Radius of the tube.
        minor_radius: f64,
    },
    /// Another quadric Σ aᵢ mᵢ = 0, with the monomials x², y², z², xy, yz, zx, x, y, z, 1 in
    /// coordinates about `origin`, in units of `scale`; and its normal form.
    Other {
        /// Name of the kind, such as `ellipsoid`; `quadric` if it is unknown.
        kind: &'static str,
        /// Centre, apex or vertex; `None` if the kind is unknown.
        center: Option<Point3>,
        /// Orthonormal axes of the normal form, one per row; `None` if the kind is unknown.
        axes: Option<[Point3; 3]>,
        /// Semi-axes, or the other measures of the normal form; `None` if the kind is unknown.
        measures: Option<Vec<f64>>,
        /// Origin of the equation's coordinates.
        origin: Point3,
        /// Unit of these coordinates, in model units.
        scale: f64,
        /// Coefficients aᵢ of the equation.
        coefficients: [f64; 10],
    },
}

/// Patches, with everything that their report states.
#[derive(Clone, Copy, Debug)]
pub struct AboutPatches<'a> {
    /// Name of the surface, or of its file.
    pub model: &'a str,
    /// Options of the patches.
    pub options: &'a Options,
    /// The patches.
    pub patches: &'a [Parameterized],
    /// Coverage of the surface; `None` for a single patch.
    pub coverage: Option<&'a Coverage>,
    /// Requirements that are not met.
    pub findings: &'a [PatchFinding],
    /// Paths of the files that were written.
    pub files: &'a [String],
    /// Warnings, a sentence each.
    pub warnings: &'a [String],
    /// Computing time by phase, in seconds.
    pub seconds: &'a [(&'a str, f64)],
}

impl PatchesReport {
    /// Creates the report of patches.
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
            seconds: Seconds::from_phases(about.seconds),
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
            entity: p.quadric.as_ref().map(Entity::from_quadric),
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
                .take(MAX_LISTED_PLACES)
                .map(BoxReport::from)
                .collect(),
        });
        let left_out = (c.left_out > 0).then(|| LeftOutReport {
            samples: c.left_out,
            distance: c.apart,
            singular_points: c.singular.len(),
            points: c.singular.iter().take(MAX_LISTED_PLACES).copied().collect(),
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
    /// Creates the description of a quadric or torus.
    pub fn from_quadric(quadric: &Quadric) -> Self {
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

/// Returns the name of a solver, as the option `--method` takes it.
pub fn solver_name(method: Method) -> &'static str {
    match method {
        Method::GaussNewton => "gauss-newton",
        Method::Frozen => "frozen",
        Method::Newton => "newton",
    }
}
