//! Report of a mesh and of its certificate.

use super::Seconds;
use super::quality::{FacetsReport, QualityReport, WallsReport};
use crate::{ModelMesh, RegionCertificate};
use isoform_check::{
    Certificate, Coverage, Defects, Deviation, Distances, Failure, Lengths, OppositeSides, Surface,
};
use isoform_geom::{Mesh, Point3};
use isoform_mesh::{Layers, Warning};
use serde::Serialize;

/// Report of `mesh`: the mesh of a model and its certificate. Lengths are in model units, points
/// are `[x, y, z]`.
#[derive(Clone, Debug, Serialize)]
pub struct MeshReport {
    /// True if the certificate of the whole holds and, with several regions, that of each.
    pub ok: bool,
    /// Name of the verb: `mesh`.
    pub verb: &'static str,
    /// The model that was meshed.
    pub model: ModelName,
    /// Target length of edges; with varying sizes, the largest one.
    pub size: f64,
    /// Largest distance of a face from the surface that was requested; `None` if sizes are uniform.
    pub grade: Option<f64>,
    /// Order of the elements: 1, or 2 with nodes at the midpoints of edges.
    pub order: u32,
    /// Layers of wedges that were requested; `None` without layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<LayersReport>,
    /// Lower and upper corner of the box that was meshed.
    pub region: [Point3; 2],
    /// True if interval arithmetic proves that nothing of the solid lies outside of the box.
    pub region_certified: bool,
    /// True if interval arithmetic proves that all feature curves were found.
    pub features_certified: bool,
    /// Names of the parts of the surface at which the box cuts the solid.
    pub caps: Vec<String>,
    /// Groups and counts of the mesh.
    #[serde(flatten)]
    pub contents: ContentsReport,
    /// Certificate of the mesh; its failures include those of the regions.
    pub certificate: CertificateReport,
    /// Certificates of the regions; empty for a mesh of one region.
    pub region_certificates: Vec<RegionReport>,
    /// Files that were written.
    pub files: Vec<WrittenFile>,
    /// Places at which the mesh may differ from the request.
    pub warnings: Vec<WarningReport>,
    /// Further remarks, a sentence each.
    pub notes: Vec<String>,
    /// Computing time by phase, in seconds.
    pub seconds: Seconds,
}

/// Layers of wedges along parts of the surface, in model units.
#[derive(Clone, Debug, Serialize)]
pub struct LayersReport {
    /// Parts as requested: names, or patterns of names.
    pub parts: Vec<String>,
    /// Thickness of the layer on the surface.
    pub first: f64,
    /// Ratio of the thickness of each layer to that of the layer before it.
    pub growth: f64,
    /// Number of layers.
    pub count: usize,
    /// Total thickness of all layers.
    pub thickness: f64,
}

impl LayersReport {
    fn new(layers: &Layers) -> Self {
        Self {
            parts: layers.parts.clone(),
            first: layers.first,
            growth: layers.growth,
            count: layers.count,
            thickness: layers.thickness(),
        }
    }
}

/// Certificate of one region of a mesh.
#[derive(Clone, Debug, Serialize)]
pub struct RegionReport {
    /// Name of the region.
    pub name: String,
    /// Certificate of the region, checked as a mesh of its own.
    pub certificate: CertificateReport,
}

impl RegionReport {
    fn new(region: &RegionCertificate) -> Self {
        let mut certificate = CertificateReport::new(&region.certificate);
        certificate.quality = certificate.quality.map(QualityReport::without_numbers);
        Self {
            name: region.name.clone(),
            certificate,
        }
    }
}

/// Model of a report.
#[derive(Clone, Debug, Serialize)]
pub struct ModelName {
    /// Name of the model, or of its file.
    pub file: String,
    /// Name of the object within the program.
    pub object: String,
    /// Values of the parameters of the object, in its order.
    pub parameters: Vec<f64>,
    /// Unit of length; `None` if unknown.
    pub unit: Option<String>,
}

/// File that was written.
#[derive(Clone, Debug, Serialize)]
pub struct WrittenFile {
    /// Path of the file.
    pub path: String,
    /// Name of the format.
    pub format: &'static str,
    /// Content that the format cannot hold, a sentence each.
    pub warnings: Vec<String>,
}

/// Warning with a place.
#[derive(Clone, Debug, Serialize)]
pub struct WarningReport {
    /// Description of the problem.
    pub message: String,
    /// Point at which it was met; `None` if it concerns the whole mesh.
    pub at: Option<Point3>,
}

/// Groups and counts of a mesh. Groups have the tags that they have in files: from 1 in the order
/// of the mesh.
#[derive(Clone, Debug, Serialize)]
pub struct ContentsReport {
    /// Parts of the surface.
    pub parts: Vec<PartGroup>,
    /// Regions of the volume.
    pub regions: Vec<RegionGroup>,
    /// Feature curves.
    pub curves: Vec<CurveGroup>,
    /// Positions of the corners.
    pub corners: Vec<Point3>,
    /// Numbers of elements and groups.
    pub counts: Counts,
}

/// Part of the surface.
#[derive(Clone, Debug, Serialize)]
pub struct PartGroup {
    /// Number of the part in files, from 1.
    pub tag: usize,
    /// Name of the part.
    pub name: String,
    /// Number of its triangles.
    pub triangles: usize,
    /// Number of its quadrilaterals; `None` in a mesh without layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quads: Option<usize>,
}

/// Region of the volume.
#[derive(Clone, Debug, Serialize)]
pub struct RegionGroup {
    /// Number of the region in files, from 1.
    pub tag: usize,
    /// Name of the region.
    pub name: String,
    /// Number of its tetrahedra.
    pub tets: usize,
}

/// Feature curve, along which two parts of the surface meet.
#[derive(Clone, Debug, Serialize)]
pub struct CurveGroup {
    /// Number of the curve in files, from 1.
    pub tag: usize,
    /// Name of the curve.
    pub name: String,
    /// Number of its edges.
    pub edges: usize,
    /// Tags of the two parts that meet along the curve.
    pub parts: [u32; 2],
}

/// Numbers of elements and groups of a mesh.
#[derive(Clone, Debug, Serialize)]
pub struct Counts {
    /// Number of nodes.
    pub points: usize,
    /// Number of triangles of the surface.
    pub triangles: usize,
    /// Number of quadrilaterals of the surface; `None` in a mesh without layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quads: Option<usize>,
    /// Number of tetrahedra.
    pub tets: usize,
    /// Number of wedges; `None` in a mesh without layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wedges: Option<usize>,
    /// Number of edges on feature curves.
    pub edges: usize,
    /// Number of parts of the surface.
    pub parts: usize,
    /// Number of feature curves.
    pub curves: usize,
    /// Number of corners.
    pub corners: usize,
}

/// Results of all checks of a mesh. Fields of checks that do not apply, or were not reached, are
/// `None`. Lengths are in model units.
#[derive(Clone, Debug, Serialize)]
pub struct CertificateReport {
    /// True if the list of failures is empty and all checks ran to their end.
    pub ok: bool,
    /// True if all checks ran to their end.
    pub complete: bool,
    /// Defects, and measures beyond their limits.
    pub failures: Vec<FailureReport>,
    /// True if every edge of the surface has two triangles or more.
    pub closed: Option<bool>,
    /// True if no edge has more than two triangles, the triangles of each node form one fan, and no
    /// triangle is degenerate or repeated.
    pub manifold: Option<bool>,
    /// True if neighbouring triangles are oriented consistently, and all shells outward.
    pub oriented: Option<bool>,
    /// Euler characteristic of the surface: vertices − edges + faces.
    pub euler: Option<i64>,
    /// Number of connected parts of the surface.
    pub shells: Option<usize>,
    /// Number of connected parts of the solid.
    pub components: Option<usize>,
    /// Volume enclosed by the surface, in cubic units; `None` if the surface has a border.
    pub volume: Option<f64>,
    /// Area of the surface, in square units.
    pub area: Option<f64>,
    /// Number of pairs of triangles that intersect.
    pub self_intersections: Option<usize>,
    /// Number of tetrahedra that are inverted or flat.
    pub inverted: Option<usize>,
    /// Smallest and largest angle of the triangles, in degrees.
    pub triangle_angles: Option<[f64; 2]>,
    /// Lengths of the edges of the tetrahedra; of the triangles in a mesh of the surface alone.
    pub edge_lengths: Option<LengthsReport>,
    /// Smallest and largest dihedral angle of the tetrahedra, in degrees.
    pub dihedral_angles: Option<[f64; 2]>,
    /// Number of dihedral angles in each ten degrees: 0 to 10, …, 170 to 180.
    pub dihedral_histogram: Option<Vec<u64>>,
    /// Radius ratio of the tetrahedra, 3 × inradius / circumradius: 1 for a regular one, 0 for a
    /// flat one.
    pub radius_ratio: Option<RatioReport>,
    /// Shape of the tetrahedra in the measures of finite element programs.
    pub quality: Option<QualityReport>,
    /// Layers of elements through the walls; `None` for a surface alone, or without walls.
    pub walls: Option<WallsReport>,
    /// Facets of each part of the surface.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub facets: Vec<FacetsReport>,
    /// Ratio (≥ 1) of the mean edge lengths of neighbouring tetrahedra: 0.999 quantile over all
    /// faces.
    pub size_ratio: Option<f64>,
    /// Distances of the mesh from the solid.
    pub distance: Option<DeviationReport>,
    /// Coverage of the solid's feature curves and corners by the mesh.
    pub features: Option<FeaturesReport>,
    /// Comparison of the opposite sides of a unit cell, one entry per periodic axis.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub opposite: Vec<OppositeReport>,
    /// Smallest scaled Jacobian of the tetrahedra, in a mesh of order 2.
    pub scaled_jacobian: Option<f64>,
    /// Smallest scaled Jacobian of the wedges, in a mesh with layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wedge_jacobian: Option<f64>,
}

/// Kind of defect, or measure beyond its limit.
#[derive(Clone, Debug, Serialize)]
pub struct FailureReport {
    /// Kind of failure, as hyphenated words that are stable between versions.
    pub code: &'static str,
    /// Description of the failure, one sentence.
    pub message: String,
    /// Number of defects of this kind.
    pub count: usize,
    /// Place of the first or worst of them; `None` if the failure is not local.
    pub at: Option<Point3>,
    /// Nodes or elements at that place; `None` if it has none, and for the failure of a region, as
    /// regions number theirs anew.
    pub elements: Option<Vec<u32>>,
}

/// Statistics of edge lengths, in model units.
#[derive(Clone, Debug, Serialize)]
pub struct LengthsReport {
    /// Shortest edge.
    pub min: f64,
    /// Mean length.
    pub mean: f64,
    /// Longest edge.
    pub max: f64,
}

/// Statistics of a ratio over all elements.
#[derive(Clone, Debug, Serialize)]
pub struct RatioReport {
    /// Smallest ratio.
    pub min: f64,
    /// Mean ratio.
    pub mean: f64,
}

/// Distances of the mesh from the solid, in model units.
#[derive(Clone, Debug, Serialize)]
pub struct DeviationReport {
    /// Distances of the nodes of the surface from the parts that they lie on.
    pub nodes: DistancesReport,
    /// Distances of the mid nodes of the surface, in a mesh of order 2.
    pub mid_nodes: DistancesReport,
    /// Distances of the nodes on feature curves from both surfaces that meet there.
    pub curves: DistancesReport,
    /// Distances of samples of the faces: the chord error.
    pub faces: DistancesReport,
    /// Number of nodes on parts that do not bound the solid there.
    pub misclassified: usize,
}

/// Statistics of the distances of points, in model units.
#[derive(Clone, Debug, Serialize)]
pub struct DistancesReport {
    /// Number of points.
    pub count: usize,
    /// Largest distance; null in JSON if it is infinite.
    pub max: f64,
    /// Root mean square distance.
    pub rms: f64,
    /// Place of the largest distance; `None` without points.
    pub at: Option<Point3>,
}

/// Comparison of two opposite sides of a unit cell.
#[derive(Clone, Debug, Serialize)]
pub struct OppositeReport {
    /// Axis across which the sides lie: x, y or z.
    pub axis: char,
    /// Number of pairs of matching nodes.
    pub nodes: usize,
    /// Number of pairs of matching triangles.
    pub triangles: usize,
    /// Number of nodes and triangles without a partner.
    pub apart: usize,
}

/// Coverage of the solid's feature curves and corners by the mesh.
#[derive(Clone, Debug, Serialize)]
pub struct FeaturesReport {
    /// Total length of the feature curves, in model units.
    pub length: f64,
    /// Share of that length with edges of the mesh, from 0 to 1.
    pub covered: f64,
    /// Number of stretches of the curves without edges.
    pub uncovered: usize,
    /// Number of corners.
    pub corners: usize,
    /// Number of corners without a node.
    pub corners_missed: usize,
    /// Largest distance of a corner from the nearest node, in model units.
    pub corner_distance: f64,
}

impl MeshReport {
    /// Creates the report of a meshed model, with the files that were written and the computing
    /// time.
    pub fn new(
        made: &ModelMesh,
        model: ModelName,
        files: Vec<WrittenFile>,
        seconds: Seconds,
    ) -> Self {
        let (mesh, meshed) = (&made.meshed.mesh, &made.meshed);
        Self {
            ok: made.holds(),
            verb: "mesh",
            model,
            size: made.options.size,
            grade: made.options.grade,
            order: mesh.order(),
            layers: made.options.layers.as_ref().map(LayersReport::new),
            region: [meshed.region.lo, meshed.region.hi],
            region_certified: meshed.region_certified,
            features_certified: meshed.features.certified,
            caps: meshed.caps.clone(),
            contents: ContentsReport::new(mesh),
            certificate: certificate_of(made),
            region_certificates: made.regions.iter().map(RegionReport::new).collect(),
            files,
            warnings: meshed.warnings.iter().map(WarningReport::new).collect(),
            notes: made.notes().iter().map(ToString::to_string).collect(),
            seconds,
        }
    }
}

/// Returns the certificate of the whole, with the failures of its regions added. Elements of
/// regions are left out, since regions number theirs anew.
fn certificate_of(made: &ModelMesh) -> CertificateReport {
    let mut report = CertificateReport::new(&made.certificate);
    report.ok = made.holds();
    for region in &made.regions {
        let failures = CertificateReport::new(&region.certificate).failures;
        report
            .failures
            .extend(failures.into_iter().map(|failure| FailureReport {
                message: format!("region {}: {}", region.name, failure.message),
                elements: None,
                ..failure
            }));
    }
    report
}

impl WarningReport {
    fn new(warning: &Warning) -> Self {
        Self {
            message: warning.kind.to_string(),
            at: warning.at,
        }
    }
}

impl ContentsReport {
    /// Lists the groups of a mesh and counts their elements.
    pub fn new(mesh: &Mesh) -> Self {
        let of_layers = |count: usize| mesh.has_layers().then_some(count);
        let parts = counted(mesh.parts.len(), &mesh.triangle_parts);
        let quads = counted(mesh.parts.len(), &mesh.quad_parts);
        let regions = counted(mesh.regions.len(), &mesh.tet_regions);
        let curves = counted(mesh.curves.len(), &mesh.edge_curves);
        let corner = |&v: &u32| mesh.points[v as usize];
        Self {
            parts: (mesh
                .parts
                .iter()
                .zip(parts.into_iter().zip(quads))
                .enumerate())
            .map(|(i, (name, (triangles, quads)))| PartGroup {
                tag: i + 1,
                name: name.clone(),
                triangles,
                quads: of_layers(quads),
            })
            .collect(),
            regions: (mesh.regions.iter().zip(regions).enumerate())
                .map(|(i, (name, tets))| RegionGroup {
                    tag: i + 1,
                    name: name.clone(),
                    tets,
                })
                .collect(),
            curves: (mesh.curves.iter().zip(curves).enumerate())
                .map(|(i, (curve, edges))| CurveGroup {
                    tag: i + 1,
                    name: curve.name.clone(),
                    edges,
                    parts: curve.parts.map(|p| p + 1),
                })
                .collect(),
            corners: mesh.corners.iter().map(corner).collect(),
            counts: Counts {
                points: mesh.points.len(),
                triangles: mesh.triangles.len(),
                quads: of_layers(mesh.quads.len()),
                tets: mesh.tets.len(),
                wedges: of_layers(mesh.wedges.len()),
                edges: mesh.edges.len(),
                parts: mesh.parts.len(),
                curves: mesh.curves.len(),
                corners: mesh.corners.len(),
            },
        }
    }
}

/// Counts the elements with each of `groups` labels.
fn counted(groups: usize, labels: &[u32]) -> Vec<usize> {
    let mut counts = vec![0; groups];
    for &label in labels {
        counts[label as usize] += 1;
    }
    counts
}

impl CertificateReport {
    /// Creates the report of a certificate.
    pub fn new(c: &Certificate) -> Self {
        let none = |defects: &[&Defects]| defects.iter().all(|d| d.is_empty());
        let (s, q) = (c.surface.as_ref(), c.tets.as_ref());
        let edges = q.map(|q| &q.edges);
        let of_triangles = || c.triangles.as_ref().map(|t| &t.edges);
        Self {
            ok: c.is_ok(),
            complete: c.complete,
            failures: c.failures().iter().map(FailureReport::new).collect(),
            closed: s.map(|s| none(&[&s.open_edges])),
            manifold: s.map(|s| {
                none(&[
                    &s.crowded_edges,
                    &s.pinched_nodes,
                    &s.repeated_triangles,
                    &s.degenerate_triangles,
                ])
            }),
            oriented: s.map(|s| none(&[&s.misoriented_edges, &s.misplaced_shells])),
            euler: s.map(|s| s.euler),
            shells: s.map(|s| s.shells),
            components: s.map(|s| s.components),
            volume: s.and_then(Surface::enclosed),
            area: s.map(|s| s.area),
            self_intersections: c.intersections.as_ref().map(|i| i.pairs.count),
            inverted: (c.volume.as_ref()).map(|v| v.inverted.count + v.flat.count),
            triangle_angles: (c.triangles.as_ref()).map(|t| [t.angle_min, t.angle_max]),
            edge_lengths: edges.or_else(of_triangles).map(LengthsReport::new),
            dihedral_angles: q.map(|q| [q.dihedral_min, q.dihedral_max]),
            dihedral_histogram: q.map(|q| q.histogram.to_vec()),
            radius_ratio: q.map(|q| RatioReport {
                min: q.radius_ratio_min,
                mean: q.radius_ratio_mean,
            }),
            quality: QualityReport::new(c),
            walls: c.walls.as_ref().map(WallsReport::new),
            facets: FacetsReport::all(c),
            size_ratio: c.volume.as_ref().map(|v| v.size_ratio),
            distance: c.deviation.as_ref().map(DeviationReport::new),
            features: c.coverage.as_ref().map(FeaturesReport::new),
            opposite: c.opposite.iter().map(OppositeReport::new).collect(),
            scaled_jacobian: c.curved.as_ref().map(|q| q.scaled_jacobian_min),
            wedge_jacobian: c.wedges.as_ref().map(|w| w.scaled_jacobian_min),
        }
    }
}

impl FailureReport {
    fn new(failure: &Failure) -> Self {
        let place = failure.place.as_ref();
        Self {
            code: failure.code,
            message: failure.message.clone(),
            count: failure.count,
            at: place.map(|p| p.at),
            elements: place.map(|p| p.elements.clone()),
        }
    }
}

impl LengthsReport {
    fn new(lengths: &Lengths) -> Self {
        Self {
            min: lengths.min,
            mean: lengths.mean,
            max: lengths.max,
        }
    }
}

impl DeviationReport {
    fn new(deviation: &Deviation) -> Self {
        Self {
            nodes: DistancesReport::new(&deviation.nodes),
            mid_nodes: DistancesReport::new(&deviation.mids),
            curves: DistancesReport::new(&deviation.curves),
            faces: DistancesReport::new(&deviation.faces),
            misclassified: deviation.misclassified.count,
        }
    }
}

impl DistancesReport {
    fn new(distances: &Distances) -> Self {
        Self {
            count: distances.count,
            max: distances.max,
            rms: distances.rms,
            at: distances.worst.as_ref().map(|p| p.at),
        }
    }
}

impl OppositeReport {
    fn new(sides: &OppositeSides) -> Self {
        Self {
            axis: ['x', 'y', 'z'][sides.axis],
            nodes: sides.nodes,
            triangles: sides.triangles,
            apart: sides.apart.count,
        }
    }
}

impl FeaturesReport {
    fn new(coverage: &Coverage) -> Self {
        Self {
            length: coverage.length,
            covered: coverage.covered,
            uncovered: coverage.uncovered.count,
            corners: coverage.corners,
            corners_missed: coverage.missed_corners.count,
            corner_distance: coverage.corner_max,
        }
    }
}
