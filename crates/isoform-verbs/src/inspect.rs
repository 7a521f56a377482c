//! `isoform inspect`: what is in a file of points, of a mesh or of solids.

use crate::brep;
use crate::context::Context;
use crate::failure::{DONE, Failure};
use crate::kind;
use crate::mesh::table as mesh_table;
use crate::outcome::{self, Outcome};
use crate::product::Product;
use crate::solids::FoundSolids;
use crate::table::{line, measure};
use crate::{scan, solids};
use isoform::check::{Options, certify};
use isoform::io::{ColumnRange, Inspection, MeshPoints, ShapeFile, SolidFile, inspect};
use isoform::mesh::Control;
use isoform::report::{
    CertificateReport, ContentsReport, InspectReport, ShapeReport, SolidReport, brief,
};
use isoform::{SurfaceMeasures, surface_measures};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Says what is in a file of points, a mesh or a solid
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform inspect scan.laz --json
  isoform inspect part.msh
  isoform inspect part.step

Gives counts, box, spacing, normals, colours, further columns, the unit (stated or guessed, with the reason) and
everything odd that was met. Of a mesh (msh, vtu, inp, ...) groups, topology, self-intersections and angles. Of a solid (STEP of any program,
.brep.json) faces by kind, volume, area, centroid and gaps, and those that a file of isoform brep states.")]
pub(crate) struct Args {
    /// The file: PLY, XYZ, CSV, OBJ, OFF, STL, 3MF, PCD, LAS, LAZ, E57, MSH, VTU, INP, STEP or
    /// .brep.json (- for stdin)
    file: PathBuf,
    /// Format of the file, if neither name nor content determine it
    #[arg(long, value_name = "FORMAT")]
    from: Option<String>,
    /// Look at no more than that many points, a seeded random sample
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    max_points: Option<u64>,
}

/// Runs the verb: certifies meshes with groups, and inspects other files as points.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    if scan::is_mesh(&args.file, args.from.as_deref()) {
        return mesh(args, context);
    }
    if args.from.is_none()
        && let Some(file) = solids::find(&args.file)?
    {
        return match file {
            FoundSolids::Own(file) => Ok(solid(&args.file, &file)),
            FoundSolids::Shape(file) => shape(&args.file, *file, context),
        };
    }
    let max = args
        .max_points
        .map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    let (cloud, read) = scan::read_points(
        &args.file,
        args.from.as_deref(),
        max,
        MeshPoints::Vertices,
        context,
    )?;
    let seen = inspect(&cloud, &read);
    let file = args.file.display().to_string();
    let has_surface = !cloud.triangles.is_empty();
    let surface = has_surface.then(|| surface_measures(&cloud.points, &cloud.triangles));
    let report = InspectReport::new(&file, &seen, surface);
    for w in seen.warnings.iter().filter(|_| !context.global.json) {
        context.warn(w);
    }
    let outcome = Outcome {
        exit: DONE,
        json: outcome::json_of(&report),
        stdout: text(&file, &seen, &report).into_bytes(),
    };
    context.hand_over(|| Product::Points(cloud, read));
    Ok(outcome)
}

/// A mesh: its groups, and what a certificate can say without the function.
fn mesh(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let (mesh, report) = scan::read_mesh_file(&args.file, args.from.as_deref())?;
    let certificate = certify(
        &mesh,
        None,
        &Options::default(),
        &Control {
            deadline: context.deadline,
            ..Control::default()
        },
    );
    if !context.global.json {
        report.warnings.iter().for_each(|w| context.warn(w));
    }
    let bounds = mesh.bounds();
    let file = args.file.display().to_string();
    let mut json = json!({
        "verb": "inspect", "file": file, "format": report.format, "dropped": report.dropped_points,
        "bounds": (!bounds.is_empty()).then_some([bounds.lo, bounds.hi]), "unit": report.units,
    });
    outcome::add(&mut json, outcome::json_of(&ContentsReport::new(&mesh)));
    json["certificate"] = outcome::json_of(&CertificateReport::new(&certificate));
    json["warnings"] = json!(report.warnings);
    let text = format!(
        "{file}: {}\n{}",
        report.format,
        mesh_table::of_mesh(&mesh, &certificate, report.units.as_deref())
    );
    Ok(Outcome {
        exit: DONE,
        json,
        stdout: text.into_bytes(),
    })
}

/// Reports on solids: their faces, and measured properties next to stated ones.
fn solid(path: &Path, file: &SolidFile) -> Outcome {
    let name = path.display().to_string();
    let report = SolidReport::new(&name, kind::solid_format(path), file);
    let kinds = brep::kinds(report.faces.iter().map(|f| f.kind));
    let stated = &report.stated;
    let unit = report.unit.as_deref();
    let beside = |measured: f64, stated: f64, power| {
        let [measured, stated] = [measured, stated].map(|v| measure(v, unit, power));
        format!("{measured} (stated {stated})")
    };
    let [x, y, z] = report.centroid.map(brief);
    let lines = [
        ("name", report.name.clone()),
        (
            "unit",
            report.unit.clone().unwrap_or_else(|| "unknown".to_owned()),
        ),
        (
            "solids",
            format!("{} with {} voids", report.solids, report.voids),
        ),
        ("faces", format!("{} ({kinds})", report.faces.len())),
        (
            "edges",
            format!("{}, {} vertices", report.edges, report.vertices),
        ),
        ("volume", beside(report.volume, stated.volume, 3)),
        ("area", beside(report.area, stated.area, 2)),
        ("centroid", format!("({x}, {y}, {z})")),
        (
            "gaps",
            format!("{:.1e} at edges (stated {:.1e})", report.gap, stated.gap),
        ),
    ];
    let lines = lines.map(|(name, text)| line(name, text)).concat();
    Outcome {
        exit: DONE,
        json: outcome::json_of(&report),
        stdout: format!("{name}: {}\n{lines}", report.format).into_bytes(),
    }
}

/// Reports on the shape of a STEP file of another program.
fn shape(path: &Path, mut file: ShapeFile, context: &Context) -> Result<Outcome, Failure> {
    let name = path.display().to_string();
    let shape = solids::prepared(path, &mut file, None, context)?;
    let report = ShapeReport::new(&name, &file, &shape);
    let kinds = brep::kinds(report.faces.iter().map(|f| f.kind));
    let unit = Some(report.unit.as_str());
    let [lo, hi] = report.bounds;
    let side = |k: usize| format!("{} to {}", brief(lo[k]), brief(hi[k]));
    let none = || "none: there is no solid".to_owned();
    let volume = report.volume.map_or_else(none, |v| measure(v, unit, 3));
    let centroid = report.centroid.map_or_else(none, |c| {
        let [x, y, z] = c.map(brief);
        format!("({x}, {y}, {z})")
    });
    let mut area = measure(report.area, unit, 2);
    if report.by_triangles > 0 {
        let count = report.by_triangles;
        let off = brief(shape.deviation());
        area += &format!(" ({count} faces by triangles within {off} of them)");
    }
    let lines = [
        ("name", report.name.clone()),
        (
            "written by",
            format!("{} ({})", report.program, report.schema),
        ),
        ("unit", report.unit.clone()),
        ("parts", report.parts.to_string()),
        (
            "solids",
            format!(
                "{} with {} voids, {} surfaces",
                report.solids, report.voids, report.surfaces
            ),
        ),
        ("faces", format!("{} ({kinds})", report.faces.len())),
        (
            "edges",
            format!(
                "{} ({} open), {} vertices",
                report.edges, report.open_edges, report.vertices
            ),
        ),
        ("x", side(0)),
        ("y", side(1)),
        ("z", side(2)),
        ("volume", volume),
        ("area", area),
        ("centroid", centroid),
        ("gaps", format!("{:.1e} at edges", report.gap)),
    ];
    let lines = lines.map(|(name, text)| line(name, text)).concat();
    Ok(Outcome {
        exit: DONE,
        json: outcome::json_of(&report),
        stdout: format!("{name}: {}\n{lines}", report.format).into_bytes(),
    })
}

/// The points, with a line for each thing that is known of them.
fn text(file: &str, seen: &Inspection, report: &InspectReport) -> String {
    let mut text = format!("{file}: {}, {} points", seen.format, seen.points);
    if seen.rows != seen.points as u64 {
        text += &format!(" of {} in the file", seen.rows);
    }
    text.push('\n');
    for (name, value) in lines(seen, report) {
        text += &format!("  {name:<11}{value}\n");
    }
    text
}

/// Names with their values.
fn lines(seen: &Inspection, report: &InspectReport) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    if seen.triangles > 0 {
        lines.push(("triangles", seen.triangles.to_string()));
    }
    lines.extend(report.surface.as_ref().map(|s| ("surface", surface(s))));
    if let Some([lo, hi]) = report.bounds {
        for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
            let length = brief(hi[k] - lo[k]);
            lines.push((name, format!("{} to {}   ({length})", lo[k], hi[k])));
        }
    }
    let unit = match seen.unit.unit.as_str() {
        "" => "unknown",
        unit => unit,
    };
    lines.extend([
        ("diagonal", brief(seen.diagonal)),
        ("spacing", seen.spacing.map_or("none".to_owned(), brief)),
        ("unit", format!("{unit} ({})", seen.unit.reason)),
        ("with", with(seen)),
    ]);
    lines.extend(seen.columns.iter().map(|c| ("column", column(c))));
    if seen.dropped_points > 0 {
        let count = seen.dropped_points;
        lines.push(("dropped", format!("{count} points that are not finite")));
    }
    if seen.duplicates > 0 {
        lines.push(("duplicates", seen.duplicates.to_string()));
    }
    lines
}

/// A surface in words: closed with its volume, or what is wrong with its edges.
fn surface(s: &SurfaceMeasures) -> String {
    let area = format!("area {}", brief(s.area));
    if let Some(volume) = s.volume {
        let facing = if volume < 0.0 { ", facing inward" } else { "" };
        return format!("closed{facing}, {area}, volume {}", brief(volume.abs()));
    }
    let faults = [
        (s.open_edges, "of one triangle"),
        (s.crowded_edges, "of more than two"),
        (
            s.misoriented_edges,
            "between triangles of opposite orientation",
        ),
    ];
    let faults = faults.iter().filter(|fault| fault.0 > 0);
    let faults: Vec<String> = faults.map(|(count, of)| format!("{count} {of}")).collect();
    let state = if s.open_edges > 0 {
        "open"
    } else {
        "no border"
    };
    format!("{state}, {area}; edges: {}", faults.join(", "))
}

/// The name of a column and the range of its values.
fn column(c: &ColumnRange) -> String {
    let missing = if c.missing > 0 {
        format!(", {} missing", c.missing)
    } else {
        String::new()
    };
    let (min, max) = (brief(c.min), brief(c.max));
    format!("{} from {min} to {max}{missing}", c.name)
}

/// Returns the columns other than positions, in words.
fn with(seen: &Inspection) -> String {
    let with = [(seen.has_normals, "normals"), (seen.has_colors, "colours")];
    let with: Vec<&str> = with.iter().filter(|w| w.0).map(|w| w.1).collect();
    if with.is_empty() {
        "positions alone".to_owned()
    } else {
        with.join(", ")
    }
}
