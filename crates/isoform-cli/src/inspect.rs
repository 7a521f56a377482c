//! `isoform inspect`: what is in a file of points or a mesh.

use crate::fit::table::brief;
use crate::mesh::{document, table};
use crate::output::{Context, DONE, Failure, Outcome};
use crate::scan;
use isoform::check::{Options, certify};
use isoform::io::{Inspection, MeshPoints, inspect};
use isoform::mesh::Control;
use serde_json::json;
use std::path::PathBuf;

/// Says what is in a file of points or a mesh
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform inspect scan.laz --json
  isoform inspect part.msh

Gives counts, box, spacing, normals, colours, further columns, the unit (stated or guessed, with the reason) and
everything odd that was met. Of a mesh (msh, vtu, inp, ...) groups, topology, self-intersections and angles.")]
pub(crate) struct Args {
    /// The file: PLY, XYZ, CSV, OBJ, OFF, STL, PCD, LAS, LAZ, E57, MSH, VTU, INP (- for stdin)
    file: PathBuf,
    /// Its format, where neither name nor content tell it
    #[arg(long, value_name = "FORMAT")]
    from: Option<String>,
    /// Look at no more than that many points, a seeded random sample
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    max_points: Option<u64>,
}

pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    if scan::is_mesh(&args.file, args.from.as_deref()) {
        return mesh(args, context);
    }
    let max = args
        .max_points
        .map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    let (cloud, report) = scan::read_points(
        &args.file,
        args.from.as_deref(),
        max,
        MeshPoints::Vertices,
        context,
    )?;
    let seen = inspect(&cloud, &report);
    let absolute = |p: [f64; 3]| std::array::from_fn::<f64, 3, _>(|k| p[k] + seen.origin[k]);
    let bounds =
        (!seen.bounds.is_empty()).then(|| [absolute(seen.bounds.lo), absolute(seen.bounds.hi)]);
    let columns: Vec<_> = seen
        .columns
        .iter()
        .map(|c| json!({"name": c.name, "min": c.min, "max": c.max, "missing": c.missing}))
        .collect();
    let json = json!({
        "verb": "inspect", "file": args.file.display().to_string(), "format": seen.format, "points": seen.points, "rows": seen.rows,
        "dropped": seen.dropped_points, "duplicates": seen.duplicates, "subsampled": seen.subsampled, "bounds": bounds,
        "origin": seen.origin, "diagonal": seen.diagonal, "spacing": seen.spacing, "normals": seen.has_normals, "colors": seen.has_colors,
        "triangles": seen.triangles, "columns": columns,
        "unit": {"name": Some(&seen.unit.unit).filter(|u| !u.is_empty()), "stated": seen.unit.is_stated, "reason": seen.unit.reason},
        "warnings": seen.warnings,
    });
    for w in seen.warnings.iter().filter(|_| !context.global.json) {
        context.warn(w);
    }
    Ok(Outcome {
        exit: DONE,
        json,
        stdout: text(&args.file.display().to_string(), &seen, bounds).into_bytes(),
    })
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
    document::add(&mut json, document::contents(&mesh));
    json["certificate"] = document::certificate(&certificate);
    json["warnings"] = json!(report.warnings);
    let text = format!(
        "{file}: {}\n{}",
        report.format,
        table::of_mesh(&mesh, &certificate)
    );
    Ok(Outcome {
        exit: DONE,
        json,
        stdout: text.into_bytes(),
    })
}

fn text(file: &str, seen: &Inspection, bounds: Option<[[f64; 3]; 2]>) -> String {
    let mut text = format!("{file}: {}, {} points", seen.format, seen.points);
    if seen.rows != seen.points as u64 {
        text += &format!(" of {} in the file", seen.rows);
    }
    text.push('\n');
    let mut line = |name: &str, value: String| text += &format!("  {name:<11}{value}\n");
    if seen.triangles > 0 {
        line("triangles", seen.triangles.to_string());
    }
    if let Some([lo, hi]) = bounds {
        for k in 0..3 {
            line(
                ["x", "y", "z"][k],
                format!("{} to {}   ({})", lo[k], hi[k], brief(hi[k] - lo[k])),
            );
        }
    }
    line("diagonal", brief(seen.diagonal));
    line("spacing", seen.spacing.map_or("none".to_owned(), brief));
    line(
        "unit",
        format!(
            "{} ({})",
            if seen.unit.unit.is_empty() {
                "unknown"
            } else {
                &seen.unit.unit
            },
            seen.unit.reason
        ),
    );
    let with = [(seen.has_normals, "normals"), (seen.has_colors, "colours")];
    let with: Vec<&str> = with.iter().filter(|w| w.0).map(|w| w.1).collect();
    line(
        "with",
        if with.is_empty() {
            "positions alone".to_owned()
        } else {
            with.join(", ")
        },
    );
    for c in &seen.columns {
        line(
            "column",
            format!(
                "{} from {} to {}{}",
                c.name,
                brief(c.min),
                brief(c.max),
                if c.missing > 0 {
                    format!(", {} missing", c.missing)
                } else {
                    String::new()
                }
            ),
        );
    }
    if seen.dropped_points > 0 {
        line(
            "dropped",
            format!("{} points that are not finite", seen.dropped_points),
        );
    }
    if seen.duplicates > 0 {
        line("duplicates", seen.duplicates.to_string());
    }
    text
}
