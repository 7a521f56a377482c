//! The report of a mesh and of its certificate.

use super::Seconds;
use crate::{ModelMesh, RegionCertificate};
use isoform_check::{
    Certificate, Coverage, Defects, Deviation, Distances, Failure, Lengths, OppositeSides,
};
use isoform_geom::{Mesh, Point3};
use isoform_mesh::{Layers, Warning};
use serde::Serialize;

/// Everything that is known of the mesh of a model.
#[derive(Clone, Debug, Serialize)]
pub struct MeshReport {
    /// Whether the certificate holds.
    pub ok: bool,
    /// `mesh`.
    pub verb: &'static str,
    /// What was meshed.
    pub model: ModelName,
    /// Length of edges asked for.
    pub size: f64,
    /// How far a face may leave the surface, if that was asked for.
    pub grade: Option<f64>,
    /// 1, or 2 with nodes in the middles of edges.
    pub order: u32,
    /// The layers of wedges that were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<LayersReport>,
    /// The box in which the solid lies.
    pub region: [Point3; 2],
    /// Whether it is proved that nothing of the solid lies outside of it.
    pub region_certified: bool,
    /// Whether it is proved that all feature curves were found.
    pub features_certified: bool,
    /// The parts where a box cuts the solid.
    pub caps: Vec<String>,
    /// Groups and counts.
    #[serde(flatten)]
    pub contents: ContentsReport,
    /// What is proved of the mesh.
    pub certificate: CertificateReport,
    /// What is proved of each of its regions, if there are several.
    pub region_certificates: Vec<RegionReport>,
    /// Files written.
    pub files: Vec<WrittenFile>,
    /// Where the mesh may not be what was asked for.
    pub warnings: Vec<WarningReport>,
    /// What else is good to know.
    pub notes: Vec<String>,
    /// Seconds by phase.
    pub seconds: Seconds,
}

/// Layers of wedges along parts of the surface.
#[derive(Clone, Debug, Serialize)]
pub struct LayersReport {
    /// The parts as they were asked for: names, or patterns of them.
    pub parts: Vec<String>,
    /// Thickness of the layer on the surface.
    pub first: f64,
    /// Thickness of each layer over that of the one before.
    pub growth: f64,
    /// How many layers there are.
    pub count: usize,
    /// Thickness of all of them together.
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

/// What is proved of a region of a mesh.
#[derive(Clone, Debug, Serialize)]
pub struct RegionReport {
    /// The region.
    pub name: String,
    /// Its certificate, as that of a mesh of its own.
    pub certificate: CertificateReport,
}

impl RegionReport {
    fn new(region: &RegionCertificate) -> Self {
        Self {
            name: region.name.clone(),
            certificate: CertificateReport::new(&region.certificate),
        }
    }
}

/// The model of a mesh.
#[derive(Clone, Debug, Serialize)]
pub struct ModelName {
    /// Its file or name.
    pub file: String,
    /// The object of the program.
    pub object: String,
    /// The values of its parameters.
    pub parameters: Vec<f64>,
    /// The unit of its lengths, if known.
    pub unit: Option<String>,
}

/// A file that was written.
#[derive(Clone, Debug, Serialize)]
pub struct WrittenFile {
    /// Its path.
    pub path: String,
    /// Its format.
    pub format: &'static str,
    /// What the format does not hold.
    pub warnings: Vec<String>,
}

/// A warning with its place.
#[derive(Clone, Debug, Serialize)]
pub struct WarningReport {
    /// What is wrong.
    pub message: String,
    /// Where.
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
    /// Places of corners.
    pub corners: Vec<Point3>,
    /// Counts of everything.
    pub counts: Counts,
}

/// A part of the surface.
#[derive(Clone, Debug, Serialize)]
pub struct PartGroup {
    /// Its number in files.
    pub tag: usize,
    /// Its name.
    pub name: String,
    /// Its triangles.
    pub triangles: usize,
    /// Its quadrilaterals, in a mesh with layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quads: Option<usize>,
}

/// A region of the volume.
#[derive(Clone, Debug, Serialize)]
pub struct RegionGroup {
    /// Its number in files.
    pub tag: usize,
    /// Its name.
    pub name: String,
    /// Its tetrahedra.
    pub tets: usize,
}

/// A feature curve.
#[derive(Clone, Debug, Serialize)]
pub struct CurveGroup {
    /// Its number in files.
    pub tag: usize,
    /// Its name.
    pub name: String,
    /// Its edges.
    pub edges: usize,
    /// The tags of the parts that meet there.
    pub parts: [u32; 2],
}

/// Counts of what a mesh consists of.
#[derive(Clone, Debug, Serialize)]
pub struct Counts {
    /// Nodes.
    pub points: usize,
    /// Triangles of the surface.
    pub triangles: usize,
    /// Quadrilaterals of the surface, in a mesh with layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quads: Option<usize>,
    /// Tetrahedra.
    pub tets: usize,
    /// Wedges, in a mesh with layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wedges: Option<usize>,
    /// Edges on feature curves.
    pub edges: usize,
    /// Parts of the surface.
    pub parts: usize,
    /// Feature curves.
    pub curves: usize,
    /// Corners.
    pub corners: usize,
}

/// The figures of a certificate.
#[derive(Clone, Debug, Serialize)]
pub struct CertificateReport {
    /// Whether everything that must hold does.
    pub ok: bool,
    /// Whether all of it was looked at.
    pub complete: bool,
    /// What does not hold.
    pub failures: Vec<FailureReport>,
    /// Whether every edge of the surface has two triangles.
    pub closed: Option<bool>,
    /// Whether the surface is a manifold.
    pub manifold: Option<bool>,
    /// Whether all triangles face outwards.
    pub oriented: Option<bool>,
    /// Euler number of the surface.
    pub euler: Option<i64>,
    /// Connected pieces of the surface.
    pub shells: Option<usize>,
    /// Connected pieces of the solid.
    pub components: Option<usize>,
    /// Volume inside of the surface.
    pub volume: Option<f64>,
    /// Area of the surface.
    pub area: Option<f64>,
    /// Pairs of triangles that intersect.
    pub self_intersections: Option<usize>,
    /// Tetrahedra that are inverted or flat.
    pub inverted: Option<usize>,
    /// Smallest and largest angle of triangles, in degrees.
    pub triangle_angles: Option<[f64; 2]>,
    /// Lengths of edges.
    pub edge_lengths: Option<LengthsReport>,
    /// Smallest and largest dihedral angle, in degrees.
    pub dihedral_angles: Option<[f64; 2]>,
    /// Dihedral angles by ten degrees.
    pub dihedral_histogram: Option<Vec<u64>>,
    /// Three times the inscribed radius by the circumscribed one.
    pub radius_ratio: Option<RatioReport>,
    /// Largest ratio of neighbouring sizes.
    pub size_ratio: Option<f64>,
    /// Distances from the function.
    pub distance: Option<DeviationReport>,
    /// How much of the solid's curves and corners the mesh has.
    pub features: Option<FeaturesReport>,
    /// Opposite sides of a unit cell.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub opposite: Vec<OppositeReport>,
    /// Smallest scaled Jacobian of elements of order 2.
    pub scaled_jacobian: Option<f64>,
    /// Smallest scaled Jacobian of wedges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wedge_jacobian: Option<f64>,
}

/// What does not hold.
#[derive(Clone, Debug, Serialize)]
pub struct FailureReport {
    /// A word for it.
    pub code: &'static str,
    /// A sentence.
    pub message: String,
    /// How often.
    pub count: usize,
    /// One of the places.
    pub at: Option<Point3>,
    /// The elements there.
    pub elements: Option<Vec<u32>>,
}

/// Lengths of edges.
#[derive(Clone, Debug, Serialize)]
pub struct LengthsReport {
    /// Shortest.
    pub min: f64,
    /// Mean.
    pub mean: f64,
    /// Longest.
    pub max: f64,
}

/// A ratio over all elements.
#[derive(Clone, Debug, Serialize)]
pub struct RatioReport {
    /// Smallest.
    pub min: f64,
    /// Mean.
    pub mean: f64,
}

/// Distances of the mesh from the function.
#[derive(Clone, Debug, Serialize)]
pub struct DeviationReport {
    /// Of nodes of the surface.
    pub nodes: DistancesReport,
    /// Of nodes in the middles of edges.
    pub mid_nodes: DistancesReport,
    /// Of nodes on feature curves, from the curves.
    pub curves: DistancesReport,
    /// Of points within faces.
    pub faces: DistancesReport,
    /// Nodes inside of the mesh that are outside of the solid.
    pub misclassified: usize,
}

/// Distances of some points.
#[derive(Clone, Debug, Serialize)]
pub struct DistancesReport {
    /// How many.
    pub count: usize,
    /// Largest.
    pub max: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Where the largest is.
    pub at: Option<Point3>,
}

/// Two opposite sides of a unit cell.
#[derive(Clone, Debug, Serialize)]
pub struct OppositeReport {
    /// The axis across which they lie: x, y or z.
    pub axis: char,
    /// Pairs of nodes.
    pub nodes: usize,
    /// Pairs of triangles.
    pub triangles: usize,
    /// Nodes and triangles without a partner.
    pub apart: usize,
}

/// How much of the solid's curves and corners the mesh has.
#[derive(Clone, Debug, Serialize)]
pub struct FeaturesReport {
    /// Length of the curves.
    pub length: f64,
    /// Length that edges of the mesh cover.
    pub covered: f64,
    /// Places that they do not.
    pub uncovered: usize,
    /// Corners.
    pub corners: usize,
    /// Corners without a node.
    pub corners_missed: usize,
    /// Largest distance of a corner from its node.
    pub corner_distance: f64,
}

impl MeshReport {
    /// What `made` says of a model, with the files that were written and the seconds it took.
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

/// The certificate of the whole, with what does not hold of its regions: their elements are numbers
/// of their own meshes, and are left out.
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
    /// Groups and counts of a mesh.
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

/// How many elements have each of `groups` labels.
fn counted(groups: usize, labels: &[u32]) -> Vec<usize> {
    let mut counts = vec![0; groups];
    for &label in labels {
        counts[label as usize] += 1;
    }
    counts
}

impl CertificateReport {
    /// The figures of a certificate.
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
            volume: s.map(|s| s.volume),
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
