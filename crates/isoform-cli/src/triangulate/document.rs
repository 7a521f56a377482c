//! The documents of a triangulated surface: the report, the sidecar, and what --json prints.

use super::Made;
use crate::output;
use isoform::algebra::CurveTopology;
use isoform::tess::{
    Analysis, BasePoint, CurveKind, DoubleArc, Grade, Kind, Mode, RealPart, Surface, VARIABLES,
};
use serde_json::{Map, Value, json};

/// The name of a way to treat sheets that cross.
pub(super) fn mode(mode: Mode) -> &'static str {
    match mode {
        Mode::Glued => "glued",
        Mode::Normalised => "normalised",
    }
}

/// What --json prints: the report, and what was asked for and made.
pub(super) fn document(made: &Made) -> Value {
    let (options, topology) = (&made.options, &made.topology);
    let files: Vec<Value> = made
        .written
        .iter()
        .map(|w| json!({"path": w.path, "format": w.format, "warnings": w.warnings}))
        .collect();
    let mut json = json!({
        "ok": made.is_certified(),
        "verb": "triangulate",
        "map": {
            "file": made.name,
            "degree": made.maps.iter().map(isoform::tess::Map::degree).max(),
            "removed": made.maps.first().and_then(|m| m.removed()).map(|f| f.display(&VARIABLES).to_string()),
        },
        "box": options.half_width.to_string(),
        "box_chosen": made.is_chosen,
        "region": options.domain.as_ref().map(|d| d.corners().iter().map(|c| c.each_ref().map(ToString::to_string)).collect::<Vec<_>>()),
        "patches": if made.patches.is_empty() { Value::Null } else { made.patches.len().into() },
        "mode": mode(options.mode),
        "tolerance": options.mesh.tolerance,
        "longest": options.mesh.longest,
        "surface_degree": made.analyses.iter().filter_map(|a| a.degrees).map(|d| d.implicit_degree).max(),
        "topology": {
            "euler": topology.euler, "components": topology.components, "boundary_loops": topology.boundary_loops,
            "edges_of_more_than_two": topology.crowded_edges,
        },
        "counts": {"points": made.surface.points.len(), "triangles": made.surface.triangles.len()},
        "files": files,
    });
    output::add(&mut json, report(made));
    json
}

/// The file of the report.
pub(super) fn file(made: &Made) -> Vec<u8> {
    let mut json = json!({"schema": 1});
    output::add(&mut json, report(made));
    let mut bytes = serde_json::to_vec_pretty(&json).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

/// What is known of the surface. All but `seconds` is the same each time.
fn report(made: &Made) -> Value {
    let surface = &made.surface;
    let all = || made.analyses.iter();
    // What is unknown is among the findings, or not in the domain.
    let pole = all()
        .filter_map(|a| a.pole_topology)
        .fold(CurveTopology::default(), |a, b| CurveTopology {
            ovals: a.ovals + b.ovals,
            pseudolines: a.pseudolines + b.pseudolines,
            singular: a.singular + b.singular,
            isolated: a.isolated + b.isolated,
        });
    let mut json = json!({
        "certified": made.is_certified(),
        "unproven": surface.findings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "claims": surface.claims().iter().map(|g| claim(surface, *g)).collect::<Vec<_>>(),
        "map_degree": made.map_degree(),
    });
    if made.map_degree() > 1 {
        json["improper"] = true.into();
        json["parameters_drawn"] = surface.sheets.into();
    }
    let rest = json!({
        "base_points": all().filter_map(|a| a.base_points.as_ref()).flatten().map(base_point).collect::<Vec<_>>(),
        "pole_components": pole_components(&pole),
        "double_curve_complete": surface.is_double_curve_known,
        "double_curve": surface.double_curve.iter().map(double_arc).collect::<Vec<_>>(),
        "contracted": all()
            .flat_map(contracted)
            .map(|(curve, at)| json!({"curve": curve, "point": at}))
            .collect::<Vec<_>>(),
        "solitary_arcs": surface.solitary_arcs,
        "seconds": made.seconds.iter().map(|(phase, s)| ((*phase).to_owned(), json!(s))).collect::<Map<_, _>>(),
    });
    output::add(&mut json, rest);
    json
}

/// A claim, its basis, whether it holds, and in words what holds or what is open.
fn claim(surface: &Surface, grade: Grade) -> Value {
    let Grade { claim, basis } = grade;
    let against = surface.findings.iter().filter(|f| f.claim() == claim);
    let open: Vec<String> = against.map(ToString::to_string).collect();
    let text = match &open[..] {
        [] => claim.statement().to_owned(),
        open => open.join("; "),
    };
    json!({
        "claim": claim.to_string(),
        "basis": basis.to_string(),
        "holds": open.is_empty(),
        "text": text,
    })
}

fn base_point(p: &BasePoint) -> Value {
    json!({"chart": p.chart.name(), "point": p.to_f64(), "multiplicity": p.multiplicity(), "blowups": p.seam.blowups()})
}

fn pole_components(pole: &CurveTopology) -> Value {
    json!({"ovals": pole.ovals, "pseudolines": pole.pseudolines, "singular": pole.singular, "isolated": pole.isolated})
}

fn double_arc(arc: &DoubleArc) -> Value {
    json!({"points": arc.points, "sheets": arc.sheets})
}

/// Real curves of the parameter plane that are contracted, each with one of the points, and once
/// with all that are at infinity: nothing for these.
pub(super) fn contracted(analysis: &Analysis) -> Vec<(String, Option<[f64; 3]>)> {
    let mut list = Vec::new();
    for c in analysis.singular.iter().flat_map(|s| &s.curves) {
        let (CurveKind::Contracted(to), RealPart::Curve) = (&c.kind, &c.real) else {
            continue;
        };
        for [x, y, z, _] in to.points() {
            let at = (!to.at_infinity()).then(|| [x, y, z].map(|v| v.to_f64()));
            let entry = (c.curve.display(&VARIABLES).to_string(), at);
            if !list.contains(&entry) {
                list.push(entry);
            }
        }
    }
    list
}

/// The sidecar: charts and corners by triangle, kinds by vertex, in the order of the mesh.
pub(super) fn sidecar(surface: &Surface) -> Vec<u8> {
    let kinds: Vec<&str> = surface.kinds.iter().map(|&k| kind(k)).collect();
    let mut json =
        json!({"schema": 1, "chart": surface.charts, "corners": surface.corners, "kind": kinds});
    if let Some(frame) = surface.frame {
        json["frame"] = json!(frame);
    }
    if !surface.patches.is_empty() {
        json["patch"] = json!(surface.patches);
    }
    let mut bytes = serde_json::to_vec(&json).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

fn kind(kind: Kind) -> &'static str {
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
