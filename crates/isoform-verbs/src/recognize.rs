//! `isoform recognize`: planes, spheres, cylinders, cones and tori of a scan.

use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::{Failure, INPUT, NO_RESULT};
use crate::labels;
use crate::memory;
use crate::outcome::{self, Outcome};
use crate::product::Product;
use crate::{mesh, scan, solids};
use isoform::geom::{Column, PointCloud};
use isoform::recognize::{Error, LabelFacts, ProposeError};
use isoform::report::{
    FeatureReport, LayoutReport, MotionReport, Parameters, PatternReport, RecognizeReport,
    SnapReport, SymmetryReport, brief,
};
use isoform::{
    Control, Proposal, RecognizeError, RecognizeOptions, Recognized, ScanLabels, recognize_scan,
    recognize_scan_labels,
};
use isoform_render::{OUTLIER, part_color};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Finds the planes, spheres, cylinders, cones and tori that a scan consists of
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform recognize scan.ply
  isoform recognize scan.ply -o entities.json -o labels.ply
  isoform recognize scan.ply -o part.hf && isoform fit scan.ply --template part.hf -o fitted.hf
  isoform recognize part.stl --min-points 100 --json
  isoform recognize scan.ply --snap -o entities.json -o part.hf
  isoform recognize scan.ply --labels edited.ply --kind 3=cylinder -o entities.json
  isoform recognize scan.ply --labels labels.ply --relate coaxial=2,5 -o part.hf

Each entity comes with the standard deviations of its parameters; relations (parallel, perpendicular,
coaxial, coplanar, concentric, equal_radius) are those that hold within the uncertainty, and so are
patterns (three and more equal entities in a row or on a circle) and symmetries (mirrors and rotations
of the entities). Holes, bosses, slots and pockets come with their depths. labels.ply holds the points with the number of their entity, -1 for none. Of CAD
meshes points inside the flat faces are taken as well.

Exit code: 0, also where nothing is found; 2 for unreadable input or too few points, 4 where they lie
on one line, 130 after Ctrl-C.")]
pub(crate) struct Args {
    /// The points: any format that `isoform inspect` reads (- for stdin)
    scan: PathBuf,
    /// Standard deviation of points from their surface; if it is larger than their noise, tolerance
    /// of the object's form [default: estimated from the points]
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    tol: Option<f64>,
    /// Minimum number of points of an entity [default: as many as are evidence of it]
    #[arg(long, value_name = "N", conflicts_with = "labels")]
    min_points: Option<usize>,
    #[command(flatten)]
    given: labels::Given,
    /// Refit all entities together so that their relations hold exactly; those that contradict the
    /// points are dropped, and templates are written from these entities [default: each entity as
    /// its own points have it]
    #[arg(long)]
    snap: bool,
    /// Format of the scan, where its name does not tell it
    #[arg(long, value_name = "FORMAT")]
    from: Option<String>,
    /// Write a file, by its ending: .json the entities, .ply, .xyz or .csv the points with their
    /// entities, .hf a template of them for `fit`
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
}

/// The share of points on surfaces without edges between them from which a form is said to be free:
/// half; parts with a taper or two have less.
const FREE: f64 = 0.5;

pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    check(args)?;
    let started = Instant::now();
    let cloud = scan::read_vertices(&args.scan, args.from.as_deref(), context)?;
    let options = RecognizeOptions {
        noise: args.tol,
        min_points: args.min_points,
    };
    let mut found = match args.given.read(&cloud, context)? {
        None => recognised(&cloud, &args.scan, &options, context)?,
        Some(labels) => labelled(
            &cloud,
            (&labels, &args.given.facts()),
            &args.scan,
            &options,
            context,
        )?,
    };
    let snap = match args.snap {
        true => Some(snapped(&mut found, &args.scan, context)?),
        false => None,
    };
    let mut report = RecognizeReport::new(
        &found.recognition,
        &found.scan.points,
        started.elapsed().as_secs_f64(),
    );
    report.snap = snap;
    if report.free >= FREE {
        context.warn(format_args!(
            "{}: {:.0} % of the points lie on surfaces that meet without an edge: a free form, of \
             which these tell no sizes; `isoform implicitize` follows it",
            args.scan.display(),
            100.0 * report.free
        ));
    }
    let json = outcome::json_of(&report);
    for path in &args.output {
        let bytes = match path.extension().and_then(|e| e.to_str()) {
            Some("json") => outcome::document(true, json.clone()),
            Some("hf") => proposal(&found, &args.scan, context)?.program.into_bytes(),
            _ => points_with_entities(&found, path)?,
        };
        disk::write_file(path, &bytes)?;
    }
    context.hand_over(|| Product::Entities(Box::new(found.into_owned())));
    Ok(Outcome::new(outcome::exit(true), json, Vec::new(), || {
        text(&report, &args.output)
    }))
}

/// Finds out before the work whether every file can be written.
fn check(args: &Args) -> Result<(), Failure> {
    let scan = args.scan.display();
    solids::refuse(&args.output, None, |path| {
        format!("isoform recover {scan} -o {path}")
    })?;
    for path in &args.output {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        let is_known = matches!(&*ending, "json" | "hf") || scan::is_points(path);
        if !is_known {
            let message = format!("{}: no result is written with this ending", path.display());
            let hint = match mesh::files::is_mesh(path) {
                true => format!("isoform recover {scan} -o {}", path.display()),
                false => "-o with .json, .ply, .xyz, .csv or .hf".to_owned(),
            };
            return Err(Failure::usage(message).hint(hint));
        }
        disk::check_folder(path)?;
    }
    Ok(())
}

/// Makes the relations exact; those that are dropped are said.
fn snapped(
    found: &mut Recognized<'_>,
    scan: &Path,
    context: &Context,
) -> Result<SnapReport, Failure> {
    let snap = found
        .snap(&context.control())
        .map_err(|e| failure(Error::Stopped(e).into(), scan))?;
    let report = SnapReport::new(&snap);
    for r in &report.dropped {
        let [a, b] = r.entities;
        context.warn(format_args!(
            "{}: entities {a} and {b} are not {} when all relations hold: that relation is dropped",
            scan.display(),
            r.kind.replace('_', " ")
        ));
    }
    Ok(report)
}

/// Returns the colour of a point by its entity, as pictures have it.
fn entity_color(label: &Option<u32>) -> [u8; 3] {
    label.map_or(OUTLIER, |entity| part_color(entity as usize))
}

/// The points with their entities, in the format of the file's ending.
fn points_with_entities(found: &Recognized<'_>, path: &Path) -> Result<Vec<u8>, Failure> {
    let label = |l: &Option<u32>| l.map_or(-1.0, f64::from);
    let column = |name: &str, labels: &[Option<u32>]| Column {
        name: name.to_owned(),
        values: labels.iter().map(label).collect(),
    };
    let cloud = PointCloud {
        points: found.scan.points.clone(),
        origin: found.scan.origin,
        colors: found.recognition.labels.iter().map(entity_color).collect(),
        columns: vec![
            column("entity", &found.recognition.labels),
            column("face", &found.recognition.face_labels),
        ],
        ..PointCloud::default()
    };
    scan::points_file(path, &cloud)
}

/// Recognises the primitives of a scan, with progress on the terminal.
pub(crate) fn recognised<'a>(
    cloud: &'a PointCloud,
    scan: &Path,
    options: &RecognizeOptions,
    context: &Context,
) -> Result<Recognized<'a>, Failure> {
    let find = |control: &Control<'_>| recognize_scan(cloud, options, control);
    with_progress(context, find).map_err(|e| failure(e, scan))
}

/// Makes the entities of labels given by hand; those that do not explain their points are said.
pub(crate) fn labelled<'a>(
    cloud: &'a PointCloud,
    (labels, facts): (&ScanLabels, &LabelFacts),
    scan: &Path,
    options: &RecognizeOptions,
    context: &Context,
) -> Result<Recognized<'a>, Failure> {
    let find =
        |control: &Control<'_>| recognize_scan_labels(cloud, labels, facts, options, control);
    let found = with_progress(context, find).map_err(|e| failure(e, scan))?;
    labels::warn(&found, scan, facts, context);
    Ok(found)
}

/// Runs some work with progress on the terminal.
fn with_progress<T>(context: &Context, work: impl FnOnce(&Control<'_>) -> T) -> T {
    let progress = context.progress();
    let show = |phase: &str, done: f64| progress.show(phase, done);
    work(&Control {
        progress: Some(&show),
        ..context.control()
    })
}

/// The template of what was recognised; what it lacks is said.
pub(crate) fn proposal(
    found: &Recognized<'_>,
    scan: &Path,
    context: &Context,
) -> Result<Proposal, Failure> {
    let name = memory::name(Path::new(scan.file_stem().unwrap_or_default()));
    let proposal = found
        .template(&format!("Proposed for {name}"), &context.control())
        .map_err(|e| no_template(&e, scan))?;
    for gap in &proposal.gaps {
        context.warn(format_args!("template of {}: {gap}", scan.display()));
    }
    Ok(proposal)
}

fn no_template(error: &ProposeError, scan: &Path) -> Failure {
    let message = format!("{}: {error}", scan.display());
    Failure::new(NO_RESULT, "no-template", message)
        .hint("isoform implicitize, which needs no entities")
}

pub(crate) fn failure(error: RecognizeError, scan: &Path) -> Failure {
    let message = format!("{}: {error}", scan.display());
    match error {
        RecognizeError::Stage(Error::Line) => Failure::new(NO_RESULT, "no-surface", message),
        RecognizeError::Stage(Error::Stopped(_)) => Failure::stopped(message, ""),
        RecognizeError::Labels(error) => labels::failure(&error, message),
        _ => {
            Failure::new(INPUT, "points", message).hint("isoform inspect says what the file holds")
        }
    }
}

/// A feature in words.
fn feature(f: &FeatureReport) -> String {
    let size = match (f.radius, f.width.zip(f.length)) {
        (Some(radius), _) => format!("radius {}", brief(radius)),
        (_, Some((width, length))) => format!("{} by {}", brief(width), brief(length)),
        _ => String::new(),
    };
    let reach = match (f.kind, f.through) {
        ("boss", _) => "height",
        (_, Some(true)) => "through",
        _ => "depth",
    };
    let widenings = f.widenings.iter().map(|w| {
        let angle = w.half_angle.map_or_else(String::new, |a| {
            format!(" of {}°", brief(2.0 * a.to_degrees()))
        });
        let (kind, radius, depth) = (w.kind, brief(w.radius), brief(w.depth));
        format!(", {kind}{angle} radius {radius} depth {depth}")
    });
    let widenings: String = widenings.collect();
    let faces: Vec<String> = f.faces.iter().map(usize::to_string).collect();
    let (kind, depth, faces) = (f.kind, brief(f.depth), faces.join(", "));
    format!("{kind:<9} {size}, {reach} {depth}{widenings} (faces {faces})\n")
}

/// The report for people.
fn text(report: &RecognizeReport, outputs: &[PathBuf]) -> String {
    let mut text = format!(
        "{} points, {} {}: {} entities, {} points without\n",
        report.points,
        if report.form { "form within" } else { "noise" },
        brief(report.noise),
        report.entities.len(),
        report.n_unassigned
    );
    for e in &report.entities {
        let label = e
            .label
            .map_or_else(String::new, |l| format!(" label {l:<4}"));
        text += &format!(
            "{:>4}{label} {:<9} {:>7} points, rms {:<9} {}\n",
            e.id,
            e.kind,
            e.n_points,
            brief(e.rms),
            sizes(&e.parameters, &e.sd)
        );
    }
    report.features.iter().for_each(|f| text += &feature(f));
    report.patterns.iter().for_each(|p| text += &pattern(p));
    report.symmetries.iter().for_each(|s| text += &symmetry(s));
    if let Some(snap) = &report.snap {
        text += &format!(
            "relations made exact: {} equations, {} relations dropped, rms {} (before {}), \
             moved {} at most\n",
            snap.conditions,
            snap.dropped.len(),
            brief(snap.rms_after),
            brief(snap.rms_before),
            brief(snap.moved.iter().copied().fold(0.0, f64::max))
        );
    }
    for path in outputs {
        text += &format!("wrote {}\n", path.display());
    }
    text
}

/// A line on a row or a circle.
fn pattern(pattern: &PatternReport) -> String {
    let ids = pattern.members.iter().map(|m| numbers(m, "+"));
    let ids: Vec<String> = ids.collect();
    let layout = match pattern.layout {
        LayoutReport::Linear {
            spacing,
            spacing_sd,
            ..
        } => format!(
            "in a row, spacing {} ± {}",
            brief(spacing),
            brief(spacing_sd)
        ),
        LayoutReport::Circular {
            radius,
            radius_sd,
            angle,
            closed,
            ..
        } => format!(
            "on {}, radius {} ± {}, every {}°",
            if closed { "a circle" } else { "an arc" },
            brief(radius),
            brief(radius_sd),
            brief(angle.to_degrees())
        ),
    };
    format!("pattern: {} {layout}: {}\n", ids.len(), ids.join(" "))
}

/// A line on a mirror or a rotation.
fn symmetry(symmetry: &SymmetryReport) -> String {
    let point = |p: &[f64; 3]| format!("({}, {}, {})", brief(p[0]), brief(p[1]), brief(p[2]));
    let motion = match &symmetry.motion {
        MotionReport::Mirror { normal, d } => {
            format!("mirror, normal {}, d {}", point(normal), brief(*d))
        }
        MotionReport::Rotation { axis, order, .. } => format!(
            "{}, axis {}",
            order.map_or_else(
                || "body of revolution".to_owned(),
                |n| format!("rotation of order {n}")
            ),
            point(axis)
        ),
    };
    let without = match symmetry.unmatched.as_slice() {
        [] => String::new(),
        some => format!(", without {}", numbers(some, " ")),
    };
    format!("symmetry: {motion}{without}\n")
}

fn numbers(ids: &[usize], between: &str) -> String {
    let all: Vec<String> = ids.iter().map(usize::to_string).collect();
    all.join(between)
}

/// Returns the sizes of an entity with their standard deviations, and its position.
fn sizes(parameters: &Parameters, sd: &Parameters) -> String {
    let point = |p: &[f64; 3]| format!("({}, {}, {})", brief(p[0]), brief(p[1]), brief(p[2]));
    let of = |value: &f64, sd: &f64| format!("{} ± {}", brief(*value), brief(*sd));
    use Parameters::{Cone, Cylinder, Plane, Sphere, Torus};
    match (parameters, sd) {
        (Plane { normal, d }, Plane { d: sd, .. }) => {
            format!("normal {}, d {}", point(normal), of(d, sd))
        }
        (Sphere { center, radius }, Sphere { radius: sd, .. }) => {
            format!("radius {}, centre {}", of(radius, sd), point(center))
        }
        (Cylinder { axis, radius, .. }, Cylinder { radius: sd, .. }) => {
            format!("radius {}, axis {}", of(radius, sd), point(axis))
        }
        (
            Cone {
                axis, half_angle, ..
            },
            Cone { half_angle: sd, .. },
        ) => format!(
            "half angle {}°, axis {}",
            of(&half_angle.to_degrees(), &sd.to_degrees()),
            point(axis)
        ),
        (
            Torus {
                major_radius,
                minor_radius,
                ..
            },
            Torus {
                major_radius: major,
                minor_radius: minor,
                ..
            },
        ) => format!(
            "radii {}, {}",
            of(major_radius, major),
            of(minor_radius, minor)
        ),
        _ => String::new(),
    }
}
