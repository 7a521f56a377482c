//! The report of a triangulated rational surface.

use super::{Seconds, WrittenFile};
use crate::Topology;
use isoform_algebra::CurveTopology;
use isoform_geom::Point3;
use isoform_tess::{
    Analysis, BasePoint, Claim, CurveKind, CutCurve, DoubleArc, KEYS, Kind, Map, Mode, RealBorder,
    RealPart, Surface, TriangulateOptions, VARIABLES, Verdict,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// What was asked for and made of a rational surface, and what is known of it.
#[derive(Clone, Debug, Serialize)]
pub struct TriangulateReport {
    /// Whether every claim holds.
    pub ok: bool,
    /// `triangulate`.
    pub verb: &'static str,
    /// The map.
    pub map: MapReport,
    /// Half the width of the box, exactly.
    #[serde(rename = "box")]
    pub half_width: String,
    /// Whether the box was not given, but comes from bounds of the surface.
    pub box_chosen: bool,
    /// Corners of the domain of parameters, exactly.
    pub region: Option<Vec<[String; 2]>>,
    /// Patches; none for a map.
    pub patches: Option<usize>,
    /// `glued` or `normalised`.
    pub mode: &'static str,
    /// Largest distance of triangles from the surface.
    pub tolerance: f64,
    /// Longest edge.
    pub longest: f64,
    /// Degree of the implicit equation.
    pub surface_degree: Option<usize>,
    /// What the triangles consist of.
    pub topology: TopologyReport,
    /// Points and triangles.
    pub counts: SurfaceCounts,
    /// Files written.
    pub files: Vec<WrittenFile>,
    /// What is known of the surface.
    #[serde(flatten)]
    pub surface: SurfaceReport,
}

/// A map in a report.
#[derive(Clone, Debug, Serialize)]
pub struct MapReport {
    /// Its file.
    pub file: String,
    /// Its degree; of patches the largest.
    pub degree: Option<usize>,
    /// The common factor that X, Y, Z and W were divided by.
    pub removed: Option<String>,
}

/// What triangles consist of.
#[derive(Clone, Debug, Serialize)]
pub struct TopologyReport {
    /// Vertices less edges plus triangles.
    pub euler: i64,
    /// Connected pieces.
    pub components: usize,
    /// Closed curves of edges with one triangle.
    pub boundary_loops: usize,
    /// Edges of more than two triangles.
    pub edges_of_more_than_two: usize,
}

/// Counts of a surface.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceCounts {
    /// Points.
    pub points: usize,
    /// Triangles.
    pub triangles: usize,
}

/// What is known of a rational surface.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceReport {
    /// Whether every claim holds.
    pub certified: bool,
    /// What stands against claims, a sentence each.
    pub unproven: Vec<String>,
    /// Every claim with its basis.
    pub claims: Vec<ClaimReport>,
    /// How many parameters reach a general point of the surface; 0 if unknown.
    pub map_degree: usize,
    /// True where that is more than one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub improper: Option<bool>,
    /// Of improper maps, how many parameters of each point are drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameters_drawn: Option<usize>,
    /// The winding of the triangles.
    pub winding: WindingReport,
    /// The border of the real image of an improper map, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub real_border: Option<RealBorderReport>,
    /// The numbers, from 0, of patches that are a curve or a point, and are left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub collapsed_patches: Vec<u32>,
    /// Points at which X, Y, Z and W vanish.
    pub base_points: Vec<BasePointReport>,
    /// The curve W = 0.
    pub pole_components: PoleReport,
    /// Whether all of the double curve is known.
    pub double_curve_complete: bool,
    /// Pieces of the double curve.
    pub double_curve: Vec<DoubleArcReport>,
    /// Curves of parameters that go to points.
    pub contracted: Vec<ContractedReport>,
    /// Real double curves with complex parameters.
    pub solitary_arcs: Vec<Vec<Point3>>,
    /// Seconds by phase.
    pub seconds: Seconds,
}

/// A claim.
#[derive(Clone, Debug, Serialize)]
pub struct ClaimReport {
    /// Its name.
    pub claim: String,
    /// `exact`, `bounded`, `floating` or `assumed`.
    pub basis: String,
    /// True if nothing stands against it, and something could: what is assumed does not hold.
    pub holds: bool,
    /// What holds, why it is assumed, or what is open, in words.
    pub text: String,
}

/// The winding of triangles.
#[derive(Clone, Debug, Serialize)]
pub struct WindingReport {
    /// True if neighbours run opposite ways along every common edge.
    pub oriented: bool,
    /// True if all pieces are orientable: else neighbours run the same way along the cut.
    pub orientable: bool,
    /// Pieces: triangles that are connected by neighbours on one sheet.
    pub pieces: usize,
    /// Those whose normals point outward; others that are orientable have ∂φ/∂s × ∂φ/∂t.
    pub outward: usize,
    /// The cut through pieces that are not orientable.
    pub cut: Vec<CutReport>,
}

/// The border of the real image of an improper map.
#[derive(Clone, Debug, Serialize)]
pub struct RealBorderReport {
    /// The curves of parameters along which the map folds the plane: the forms are zero there.
    pub folds: Vec<String>,
    /// Their images in the box.
    pub lines: Vec<Vec<Point3>>,
    /// Beyond the border real points are reached by a family of complex parameters of this
    /// dimension.
    pub complex_dimension: usize,
    /// Maps onto these points with real parameters, as far as they are known.
    pub beyond: Vec<BTreeMap<&'static str, String>>,
}

/// A part of the cut.
#[derive(Clone, Debug, Serialize)]
pub struct CutReport {
    /// The curve that it belongs to.
    pub along: String,
    /// The number of its edges.
    pub edges: usize,
    /// Its points, line by line.
    pub lines: Vec<Vec<Point3>>,
}

/// A base point.
#[derive(Clone, Debug, Serialize)]
pub struct BasePointReport {
    /// The affine chart of the parameter plane.
    pub chart: &'static str,
    /// Its homogeneous coordinates s : t : w.
    pub point: [f64; 3],
    /// How often X, Y, Z and W meet there.
    pub multiplicity: usize,
    /// Blow-ups that resolve it.
    pub blowups: usize,
}

/// Pieces of the curve W = 0 in the projective plane.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PoleReport {
    /// Closed curves that bound a disc.
    pub ovals: usize,
    /// Closed curves that do not.
    pub pseudolines: usize,
    /// Connected pieces with singular points.
    pub singular: usize,
    /// Isolated points.
    pub isolated: usize,
}

/// A piece of the double curve.
#[derive(Clone, Debug, Serialize)]
pub struct DoubleArcReport {
    /// Its points.
    pub points: Vec<Point3>,
    /// Sheets that meet there.
    pub sheets: usize,
}

/// A curve of parameters that goes to a point.
#[derive(Clone, Debug, Serialize)]
pub struct ContractedReport {
    /// Its equation.
    pub curve: String,
    /// The point; none at infinity.
    pub point: Option<Point3>,
}

/// Parameters of every triangle's corners, and the kind of every vertex, in the order of the mesh.
#[derive(Clone, Debug, Serialize)]
pub struct Sidecar<'a> {
    /// 1.
    pub schema: u32,
    /// By triangle, the chart of its parameters.
    pub chart: &'a [u8],
    /// By triangle, the parameters of its corners.
    pub corners: &'a [[[f64; 2]; 3]],
    /// By vertex: `ordinary`, `box`, `double`, `seam`, `contracted`, `cusp` or `border`.
    pub kind: Vec<&'static str>,
    /// The projective change of parameters that was drawn in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<[[f64; 3]; 3]>,
    /// By triangle, its patch.
    #[serde(skip_serializing_if = "<[u32]>::is_empty")]
    pub patch: &'a [u32],
}

/// A surface and what is known of it.
#[derive(Clone, Copy, Debug)]
pub struct AboutSurface<'a> {
    /// The file of the map.
    pub file: &'a str,
    /// One map, or one for every patch.
    pub maps: &'a [Map],
    /// What is known of each.
    pub analyses: &'a [Analysis],
    /// Patches; 0 for a map.
    pub patches: usize,
    /// What was asked for.
    pub options: &'a TriangulateOptions,
    /// Whether the box was not given.
    pub is_box_chosen: bool,
    /// The triangles.
    pub surface: &'a Surface,
    /// Those of points that only complex parameters reach.
    pub beyond: &'a [Surface],
    /// What they consist of.
    pub topology: &'a Topology,
    /// Seconds by phase.
    pub seconds: &'a [(&'a str, f64)],
}

impl TriangulateReport {
    /// The report of a surface and of the files that were written.
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
    /// What is known of a surface.
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
            // What is unknown is among the findings, or not in the domain.
            pole_components: PoleReport::sum(all().filter_map(|a| a.pole_topology)),
            double_curve_complete: surface.is_double_curve_known,
            double_curve: surface
                .double_curve
                .iter()
                .map(DoubleArcReport::new)
                .collect(),
            contracted: all().flat_map(contracted).collect(),
            solitary_arcs: surface.solitary_arcs.clone(),
            seconds: Seconds::of(about.seconds),
        }
    }
}

/// How many parameters reach a general point of the surface; 0 if that is unknown.
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

/// The curves of parameters along which an improper map folds the plane.
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

/// Real curves of the parameter plane that are contracted, each with one of the points, and once
/// with all that are at infinity.
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
    /// The sidecar of a surface.
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

/// The word for a kind of vertices.
fn kind_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Ordinary => "ordinary",
        Kind::Box => "box",
        Kind::Double => "double",
        Kind::Seam => "seam",
        Kind::Contracted => "contracted",
        Kind::Cusp => "cusp",
        Kind::Border => "border",
    }
}

/// The word for a way to treat sheets that cross, as `--mode` takes it.
pub fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Glued => "glued",
        Mode::Normalised => "normalised",
    }
}
