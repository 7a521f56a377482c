//! Report of a triangulated rational surface.

use super::{Seconds, WrittenFile};
use crate::Topology;
use isoform_algebra::CurveTopology;
use isoform_geom::Point3;
use isoform_tess::{
    Analysis, BasePoint, Claim, CurveKind, CutCurve, DoubleArc, KEYS, Map, Mode, RealBorder,
    RealPart, Surface, TriangulateOptions, VARIABLES, Verdict, VertexKind,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// Report of `triangulate`: a rational surface, its triangles and the claims about them. Lengths
/// are in units of space, points are `[x, y, z]`; exact numbers are texts.
#[derive(Clone, Debug, Serialize)]
pub struct TriangulateReport {
    /// True if every claim holds.
    pub ok: bool,
    /// Name of the verb: `triangulate`.
    pub verb: &'static str,
    /// The map, or the patches.
    pub map: MapReport,
    /// Half the width of the box around the origin, exactly.
    #[serde(rename = "box")]
    pub half_width: String,
    /// True if the box was computed from bounds of the surface, false if it was given.
    pub box_chosen: bool,
    /// Corners of the polygon of parameters (s, t) to which the surface is restricted, exactly;
    /// `None` for the whole plane.
    pub region: Option<Vec<[String; 2]>>,
    /// Number of patches; `None` for a map.
    pub patches: Option<usize>,
    /// Treatment of sheets that cross: `glued` or `normalised`.
    pub mode: &'static str,
    /// Largest allowed distance of the triangles from the surface.
    pub tolerance: f64,
    /// Largest allowed length of an edge.
    pub longest: f64,
    /// Degree of the implicit equation; of patches, the largest. `None` if unknown.
    pub surface_degree: Option<usize>,
    /// Topology of the triangles.
    pub topology: TopologyReport,
    /// Numbers of points and triangles.
    pub counts: SurfaceCounts,
    /// Files that were written.
    pub files: Vec<WrittenFile>,
    /// Facts and claims about the surface.
    #[serde(flatten)]
    pub surface: SurfaceReport,
}

/// Map in a report.
#[derive(Clone, Debug, Serialize)]
pub struct MapReport {
    /// Name of the file.
    pub file: String,
    /// Degree of the map; of patches, the largest.
    pub degree: Option<usize>,
    /// Common factor by which X, Y, Z and W were divided; `None` if they had none.
    pub removed: Option<String>,
}

/// Topology of a set of triangles.
#[derive(Clone, Debug, Serialize)]
pub struct TopologyReport {
    /// Euler characteristic: vertices − edges + triangles.
    pub euler: i64,
    /// Number of connected components.
    pub components: usize,
    /// Number of connected components of the boundary, which consists of the edges of one triangle.
    pub boundary_loops: usize,
    /// Number of edges of more than two triangles.
    pub edges_of_more_than_two: usize,
}

/// Size of a triangle mesh.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceCounts {
    /// Number of points.
    pub points: usize,
    /// Number of triangles.
    pub triangles: usize,
}

/// Facts and claims about a rational surface.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceReport {
    /// True if every claim holds.
    pub certified: bool,
    /// Findings against the claims, a sentence each.
    pub unproven: Vec<String>,
    /// Claims that were decided, each with its basis.
    pub claims: Vec<ClaimReport>,
    /// Degree of the map: number of parameters of a general point of the surface; 0 if unknown.
    pub map_degree: usize,
    /// True if the map is improper: its degree exceeds 1. `None` otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub improper: Option<bool>,
    /// Number of drawn parameters of each general point; `None` unless the map is improper.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameters_drawn: Option<usize>,
    /// Orientation of the triangles.
    pub winding: WindingReport,
    /// Border of the real image of an improper map; `None` if none is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub real_border: Option<RealBorderReport>,
    /// Indices, from 0, of the patches whose image is a curve or a point; they are left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub collapsed_patches: Vec<u32>,
    /// Real base points, at which X, Y, Z and W vanish.
    pub base_points: Vec<BasePointReport>,
    /// Topology of the pole curve W = 0.
    pub pole_components: PoleReport,
    /// True if the double curve was found and drawn completely.
    pub double_curve_complete: bool,
    /// Arcs of the double curve, in which sheets of the surface meet.
    pub double_curve: Vec<DoubleArcReport>,
    /// Real curves of the parameter plane whose images are points.
    pub contracted: Vec<ContractedReport>,
    /// Arcs of the surface that only complex parameters reach, as polylines.
    pub solitary_arcs: Vec<Vec<Point3>>,
    /// Computing time by phase, in seconds.
    pub seconds: Seconds,
}

/// Claim about the surface.
#[derive(Clone, Debug, Serialize)]
pub struct ClaimReport {
    /// Name of the claim.
    pub claim: String,
    /// Basis of the claim: `exact`, `bounded`, `floating` or `assumed`.
    pub basis: String,
    /// True if the claim was tested and nothing contradicts it; an assumption does not hold.
    pub holds: bool,
    /// Statement of a claim that holds; else the reason for the assumption, or the findings.
    pub text: String,
}

/// Orientation of the triangles of a surface.
#[derive(Clone, Debug, Serialize)]
pub struct WindingReport {
    /// True if neighbours traverse every common edge in opposite directions.
    pub oriented: bool,
    /// True if all pieces are orientable; otherwise neighbours traverse the edges of the cut in one
    /// direction.
    pub orientable: bool,
    /// Number of pieces: sets of triangles that are connected by neighbours on one sheet.
    pub pieces: usize,
    /// Number of pieces whose normals point outward; the normals of other orientable pieces are
    /// ∂φ/∂s × ∂φ/∂t.
    pub outward: usize,
    /// Cut through the pieces that are not orientable.
    pub cut: Vec<CutReport>,
}

/// Border of the real image of an improper map.
#[derive(Clone, Debug, Serialize)]
pub struct RealBorderReport {
    /// Forms in s, t and w that vanish along the folds: the curves of parameters along which the
    /// map folds the plane.
    pub folds: Vec<String>,
    /// Images of the folds in the box, as polylines.
    pub lines: Vec<Vec<Point3>>,
    /// Dimension of the families of complex parameters that reach the real points beyond the
    /// border.
    pub complex_dimension: usize,
    /// Maps onto the points beyond the border with real parameters that are known: the
    /// texts of X, Y, Z and W.
    pub beyond: Vec<BTreeMap<&'static str, String>>,
}

/// Part of the cut along one curve.
#[derive(Clone, Debug, Serialize)]
pub struct CutReport {
    /// Name of the curve.
    pub along: String,
    /// Number of its edges.
    pub edges: usize,
    /// Points of the cut, as polylines.
    pub lines: Vec<Vec<Point3>>,
}

/// Base point of a map.
#[derive(Clone, Debug, Serialize)]
pub struct BasePointReport {
    /// Name of the affine chart of the parameter plane.
    pub chart: &'static str,
    /// Homogeneous coordinates s : t : w of the point.
    pub point: [f64; 3],
    /// Multiplicity: the least order at which X, Y, Z and W vanish.
    pub multiplicity: usize,
    /// Number of blow-ups that resolve it.
    pub blowups: usize,
}

/// Components of the curve W = 0 in the real projective plane.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PoleReport {
    /// Number of closed components that bound a disk.
    pub ovals: usize,
    /// Number of closed components that do not bound a disk, such as lines.
    pub pseudolines: usize,
    /// Number of components with points where more than two branches end.
    pub singular: usize,
    /// Number of isolated points.
    pub isolated: usize,
}

/// Arc of the double curve.
#[derive(Clone, Debug, Serialize)]
pub struct DoubleArcReport {
    /// Points of the arc, in order.
    pub points: Vec<Point3>,
    /// Number of sheets that meet in it.
    pub sheets: usize,
}

/// Curve of parameters whose image is a point.
#[derive(Clone, Debug, Serialize)]
pub struct ContractedReport {
    /// Form in s, t and w that vanishes along the curve.
    pub curve: String,
    /// Image of the curve; null if it is at infinity.
    pub point: Option<Point3>,
}

/// Parameters of the corners of each triangle and the kind of each vertex, in the order of the
/// mesh: the content of a file next to it.
#[derive(Clone, Debug, Serialize)]
pub struct Sidecar<'a> {
    /// Version of the file format: 1.
    pub schema: u32,
    /// Unit triangle of parameters of each triangle, from 0 to 3: ±u, ±v.
    pub chart: &'a [u8],
    /// Coordinates u and v of the corners of each triangle in its unit triangle.
    pub corners: &'a [[[f64; 2]; 3]],
    /// Kind of each vertex: `ordinary`, `box`, `double`, `seam`, `contracted`, `cusp` or `border`.
    pub kind: Vec<&'static str>,
    /// Rows of the matrix from the homogeneous coordinates of `corners` to (s, t, w); `None` if the
    /// parameters were not normalised.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<[[f64; 3]; 3]>,
    /// Index of the patch of each triangle; empty for a map.
    #[serde(skip_serializing_if = "<[u32]>::is_empty")]
    pub patch: &'a [u32],
}

/// Surface, with everything that its report states.
#[derive(Clone, Copy, Debug)]
pub struct AboutSurface<'a> {
    /// Name of the file of the map.
    pub file: &'a str,
    /// The map, or the map of each patch.
    pub maps: &'a [Map],
    /// Exact facts about each map.
    pub analyses: &'a [Analysis],
    /// Number of patches; 0 for a map.
    pub patches: usize,
    /// Options of the triangulation.
    pub options: &'a TriangulateOptions,
    /// True if the box was computed from bounds of the surface, false if it was given.
    pub is_box_chosen: bool,
    /// Triangles of the surface.
    pub surface: &'a Surface,
    /// Triangles of the points that only complex parameters reach.
    pub beyond: &'a [Surface],
    /// Topology of the triangles.
    pub topology: &'a Topology,
    /// Computing time by phase, in seconds.
    pub seconds: &'a [(&'a str, f64)],
}

impl TriangulateReport {
    /// Creates the report of a surface and of the files that were written.
    pub fn new(about: &AboutSurface<'_>, files: Vec<WrittenFile>) -> Self {
        let (options, topology) = (about.options, about.topology);
        let surface = SurfaceReport::new(about);
        let all = || about.beyond.iter().chain([about.surface]);
        let removed = about.maps.first().and_then(Map::removed);
        let degrees = about.analyses.iter().filter_map(|a| a.degrees);
        let corners = |d: &isoform_tess::Domain| {
            let texts = d
                .corners()
                .iter()
                .map(|c| c.each_ref().map(ToString::to_string));
            texts.collect()
        };
        Self {
            ok: surface.certified,
            verb: "triangulate",
            map: MapReport {
                file: about.file.to_owned(),
                degree: about.maps.iter().map(Map::degree).max(),
                removed: removed.map(|f| f.display(&VARIABLES).to_string()),
            },
            half_width: options.half_width.to_string(),
            box_chosen: about.is_box_chosen,
            region: options.domain.as_ref().map(corners),
            patches: (about.patches > 0).then_some(about.patches),
            mode: mode_name(options.mode),
            tolerance: options.mesh.tolerance,
            longest: options.mesh.longest,
            surface_degree: degrees.map(|d| d.implicit_degree).max(),
            topology: TopologyReport {
                euler: topology.euler,
                components: topology.components,
                boundary_loops: topology.boundary_loops,
                edges_of_more_than_two: topology.crowded_edges,
            },
            counts: SurfaceCounts {
                points: all().map(|s| s.points.len()).sum(),
                triangles: all().map(|s| s.triangles.len()).sum(),
            },
            files,
            surface,
        }
    }
}

impl SurfaceReport {
    /// Creates the facts and claims about a surface.
    pub fn new(about: &AboutSurface<'_>) -> Self {
        let surface = about.surface;
        let all = || about.analyses.iter();
        let map_degree = map_degree(about.analyses);
        let is_improper = map_degree > 1;
        let unproven = surface.findings.iter().map(ToString::to_string);
        let beyond = about.beyond.iter().flat_map(|s| &s.findings);
        let beyond = beyond.map(|f| format!("complex parameters: {f}"));
        Self {
            certified: surface.is_certified() && about.beyond.iter().all(Surface::is_certified),
            unproven: unproven.chain(beyond).collect(),
            claims: surface
                .certificate()
                .decided()
                .map(|(claim, verdict)| ClaimReport::new(surface, claim, verdict))
                .collect(),
            map_degree,
            improper: is_improper.then_some(true),
            parameters_drawn: is_improper.then_some(surface.sheets),
            winding: WindingReport::new(surface),
            real_border: RealBorderReport::new(surface),
            collapsed_patches: surface.collapsed.clone(),
            base_points: all()
                .filter_map(|a| a.base_points.as_ref())
                .flatten()
                .map(BasePointReport::new)
                .collect(),
            // Unknown curves are among the findings, or outside of the domain.
            pole_components: PoleReport::sum(all().filter_map(|a| a.pole_topology)),
            double_curve_complete: surface.is_double_curve_known,
            double_curve: surface
                .double_curve
                .iter()
                .map(DoubleArcReport::new)
                .collect(),
            contracted: all().flat_map(contracted).collect(),
            solitary_arcs: surface.solitary_arcs.clone(),
            seconds: Seconds::from_phases(about.seconds),
        }
    }
}

/// Returns the number of parameters of a general point of the surface; 0 if that is unknown.
pub fn map_degree(analyses: &[Analysis]) -> usize {
    let degrees = analyses.iter().filter_map(|a| a.degrees);
    degrees.map(|d| d.map_degree).max().unwrap_or(0)
}

impl ClaimReport {
    fn new(surface: &Surface, claim: Claim, verdict: Verdict) -> Self {
        let basis = |verdict| match verdict {
            Verdict::Holds(basis) => basis.to_string(),
            _ => "assumed".to_owned(),
        };
        let against = surface.findings.iter().filter(|f| f.claim() == claim);
        let open: Vec<String> = against.map(ToString::to_string).collect();
        let statement = claim.statement();
        let (basis, text) = match verdict {
            Verdict::Assumed(why) => (basis(verdict), format!("{statement}: {why}")),
            Verdict::Open if open.is_empty() => {
                (basis(claim.usual()), "this was not decided".to_owned())
            }
            Verdict::Open => (basis(claim.usual()), open.join("; ")),
            _ => (basis(verdict), statement.to_owned()),
        };
        Self {
            claim: claim.to_string(),
            basis,
            holds: matches!(verdict, Verdict::Holds(_)),
            text,
        }
    }
}

impl RealBorderReport {
    fn new(surface: &Surface) -> Option<Self> {
        let border = &surface.real_border;
        let map = |m: &Map| {
            let texts = m
                .affine()
                .each_ref()
                .map(|p| p.display(&VARIABLES).to_string());
            KEYS.into_iter().zip(texts).collect()
        };
        (!border.is_empty()).then(|| Self {
            folds: folds(border),
            lines: border.lines.clone(),
            complex_dimension: 2,
            beyond: border.beyond.iter().map(map).collect(),
        })
    }
}

/// Returns the forms of the curves of parameters along which an improper map folds the plane.
pub fn folds(border: &RealBorder) -> Vec<String> {
    let text = |f: &isoform_algebra::Poly| f.display(&VARIABLES).to_string();
    border.folds.iter().map(text).collect()
}

impl WindingReport {
    fn new(surface: &Surface) -> Self {
        let winding = &surface.winding;
        let at = |line: &Vec<u32>| line.iter().map(|&v| surface.points[v as usize]).collect();
        let part = |(along, lines): (CutCurve, Vec<Vec<u32>>)| CutReport {
            along: along.to_string(),
            edges: lines.iter().map(|l| l.len() - 1).sum(),
            lines: lines.iter().map(at).collect(),
        };
        Self {
            oriented: winding.cut.is_empty() && surface.holds(Claim::Winding),
            orientable: winding.is_orientable(),
            pieces: winding.pieces,
            outward: winding.outward,
            cut: winding.cut_lines().into_iter().map(part).collect(),
        }
    }
}

impl BasePointReport {
    fn new(p: &BasePoint) -> Self {
        Self {
            chart: p.chart.name(),
            point: p.to_f64(),
            multiplicity: p.multiplicity(),
            blowups: p.seam.blowups(),
        }
    }
}

impl PoleReport {
    fn sum(poles: impl Iterator<Item = CurveTopology>) -> Self {
        let none = Self {
            ovals: 0,
            pseudolines: 0,
            singular: 0,
            isolated: 0,
        };
        poles.fold(none, |sum, pole| Self {
            ovals: sum.ovals + pole.ovals,
            pseudolines: sum.pseudolines + pole.pseudolines,
            singular: sum.singular + pole.singular,
            isolated: sum.isolated + pole.isolated,
        })
    }
}

impl DoubleArcReport {
    fn new(arc: &DoubleArc) -> Self {
        Self {
            points: arc.points.clone(),
            sheets: arc.sheets,
        }
    }
}

/// Returns the real curves of the parameter plane that are contracted: once with each of their
/// points, and once with all points at infinity.
pub fn contracted(analysis: &Analysis) -> Vec<ContractedReport> {
    let mut list: Vec<ContractedReport> = Vec::new();
    for c in analysis.singular.iter().flat_map(|s| &s.curves) {
        let (CurveKind::Contracted(to), RealPart::Curve) = (&c.kind, &c.real) else {
            continue;
        };
        for [x, y, z, _] in to.points() {
            let point = (!to.at_infinity()).then(|| [x, y, z].map(|v| v.to_f64()));
            let curve = c.curve.display(&VARIABLES).to_string();
            if !list.iter().any(|l| l.curve == curve && l.point == point) {
                list.push(ContractedReport { curve, point });
            }
        }
    }
    list
}

impl<'a> Sidecar<'a> {
    /// Creates the sidecar of a surface.
    pub fn new(surface: &'a Surface) -> Self {
        Self {
            schema: 1,
            chart: &surface.charts,
            corners: &surface.corners,
            kind: surface.kinds.iter().map(|&k| kind_name(k)).collect(),
            frame: surface.frame,
            patch: &surface.patches,
        }
    }
}

/// Returns the name of a kind of vertices.
fn kind_name(kind: VertexKind) -> &'static str {
    match kind {
        VertexKind::Ordinary => "ordinary",
        VertexKind::Box => "box",
        VertexKind::Double => "double",
        VertexKind::Seam => "seam",
        VertexKind::Contracted => "contracted",
        VertexKind::Cusp => "cusp",
        VertexKind::Border => "border",
    }
}

/// Returns the name of a treatment of sheets that cross, as the option `--mode` takes it.
pub fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Glued => "glued",
        Mode::Normalised => "normalised",
    }
}
