//! `isoform brep`: solids of exact faces for CAD, with a certificate.

use crate::mesh::Settings;
use crate::mesh::table::line;
use crate::mesh::work::{Phases, no_mesh, place};
use crate::model::Language;
use crate::output::{self, Context, Failure, NO_RESULT, Outcome};
use crate::watchdog::Writing;
use crate::{eval, gallery, interrupt, scan};
use isoform::brep::{BrepError, Finding};
use isoform::geom::Aabb;
use isoform::io::{SolidOptions, SolidProperties, StepOptions, step_solids, write_step_solids};
use isoform::report::{BrepReport, ModelName, Seconds, brief};
use isoform::{BrepModelError, Control, MeshModelOptions, ModelBrep, brep_model};
use std::path::{Path, PathBuf};

/// Writes a model as a solid of exact faces for CAD (STEP)
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform brep part.hf -o part.step
  isoform brep part.hf --params 2,0.5 --units mm --ap214 -o part.step
  isoform brep part.hf --box=-1,-1,-1,1,1,1 -o half.step --json

Faces lie on the planes, cylinders, cones, spheres and tori of the model itself, not on triangles; faces that meet
share one edge, edges that meet one vertex. Every solid comes with a certificate: closed, with the topology of the
mesh, how far edges leave their faces, and volume and area by integrals without a mesh. A face that goes round is cut
in two, or more; its charts are named part#chart1 and so on. See docs/brep.md.

Exit code: 0, or 3 if the certificate fails or the mesh leaves something open (the file is written all the same, but
never with a shell that is not closed), 4 where there is no such solid, 2 for unreadable input, 130 after Ctrl-C.")]
pub(crate) struct Args {
    /// The model: a HyperFun file (- for stdin), or the name of a built-in template
    model: PathBuf,
    /// The values of the parameters a, in their order; missing ones are as annotated, else 0
    #[arg(long, value_name = "NUMBERS", allow_hyphen_values = true, value_parser = eval::parameters)]
    params: Option<eval::Parameters>,
    /// Cut off what does not lie in this box: x,y,z of the lower and of the upper corner; the cuts
    /// are planes named cap.x_min ...
    #[arg(long = "box", value_name = "NUMBERS", allow_hyphen_values = true, value_parser = output::region)]
    region: Option<Aabb>,
    /// Length of the edges of the mesh that the topology comes from [default: a fortieth of the
    /// diagonal]
    #[arg(long, value_name = "LENGTH", value_parser = output::positive)]
    size: Option<f64>,
    /// How far faces may be from the model, in its units [default: 1e-6 of its largest side]; exact
    /// faces are 1e-8 of it or nearer, whatever is asked for
    #[arg(long, value_name = "LENGTH", value_parser = output::positive)]
    tol: Option<f64>,
    /// Unit of length to state: um, mm, cm, m, in or ft [default: as annotated, else mm]
    #[arg(long, value_name = "UNIT")]
    units: Option<String>,
    /// Write the older AP214 instead of AP242
    #[arg(long)]
    ap214: bool,
    /// Write a STEP file (.step, .stp; - for stdout); may be repeated
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    #[command(flatten)]
    language: Language,
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    check_targets(args, context)?;
    let name = args.model.display().to_string();
    let model = gallery::template(&args.model, &args.language, context)?;
    let values = eval::values(&model, args.params.as_ref().map_or(&[], |p| &p.0))?;
    let phases = Phases::new(context);
    let show = |phase: &str, _: f64| phases.enter(phase);
    let control = Control {
        progress: Some(&show),
        ..context.control()
    };
    let mut options = MeshModelOptions {
        size: args.size,
        ..MeshModelOptions::default()
    };
    options.mesh.region = args.region;
    let made = brep_model(&model, &values, &options, args.tol, &control)
        .map_err(|e| no_brep(&e, &name, args.region))?;
    for failure in &made.certificate.failures {
        context.warn(failure);
    }
    for note in made.mesh.notes() {
        context.warn(note);
    }
    let unit = model.info().unit.clone();
    let units = args.units.clone().or_else(|| unit.clone());
    let seconds = Seconds(phases.seconds());
    let (files, stdout) = write(&made, args, units, &name)?;
    let about = ModelName {
        file: name,
        object: model.name().to_owned(),
        parameters: values,
        unit,
    };
    let report = BrepReport::new(&made, about, files, seconds);
    let json = output::json_of(&report);
    let exit = output::exit(made.certificate.holds());
    Ok(Outcome::of(exit, json, stdout, || text(&report)))
}

/// Finds out before the work whether every file can be written.
fn check_targets(args: &Args, context: &Context) -> Result<(), Failure> {
    for path in args.output.iter().filter(|p| *p != Path::new("-")) {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        if !["step", "stp"].contains(&ending.to_ascii_lowercase().as_str()) {
            let path = path.display();
            let message = format!("{path}: solids are not written with this ending");
            return Err(Failure::usage(message).hint("a name that ends in .step or .stp"));
        }
        output::check_folder(path)?;
    }
    if args.output.is_empty() {
        context.note("no -o: nothing will be written");
    }
    Ok(())
}

/// Writes all files; gives back their names, and what is for stdout.
fn write(
    made: &ModelBrep,
    args: &Args,
    units: Option<String>,
    name: &str,
) -> Result<(Vec<String>, Vec<u8>), Failure> {
    let is_open = |f: &Finding| matches!(f, Finding::OpenEdges(_));
    if made.certificate.failures.iter().any(is_open) {
        let failure = Failure::new(NO_RESULT, "open", format!("{name}: a shell is not closed"));
        return Err(failure.hint("a smaller --size"));
    }
    let total = &made.certificate.total;
    let properties = SolidProperties {
        volume: total.volume,
        area: total.area,
        centroid: made.certificate.centroid(),
        gap: made.certificate.gap,
    };
    let product = Path::new(name).file_stem().unwrap_or_default();
    let options = SolidOptions {
        step: StepOptions {
            units,
            name: product.to_string_lossy().into_owned(),
            time: None,
        },
        ap214: args.ap214,
    };
    let _writing = Writing::new();
    let (mut files, mut stdout) = (Vec::new(), Vec::new());
    let brep = &made.built.brep;
    for path in &args.output {
        if path == Path::new("-") {
            let text = step_solids(brep, &properties, &options);
            stdout = text.map_err(|e| scan::unwritable(&e))?.into_bytes();
        } else {
            write_step_solids(brep, &properties, path, &options)
                .map_err(|e| scan::unwritable(&e))?;
            files.push(path.display().to_string());
        }
    }
    Ok((files, stdout))
}

/// Why there is no solid of exact faces.
fn no_brep(error: &BrepModelError, name: &str, region: Option<Aabb>) -> Failure {
    let none = |code| Failure::new(NO_RESULT, code, format!("{name}: {error}"));
    match error {
        BrepModelError::Mesh(e) => {
            let settings = Settings {
                region,
                ..Settings::default()
            };
            no_mesh(e, name, &settings)
        }
        BrepModelError::Brep(BrepError::Stopped) if interrupt::happened() => {
            Failure::new(interrupt::INTERRUPTED, "interrupted", error.to_string())
        }
        BrepModelError::Brep(e) => match e {
            BrepError::Stopped => none("time-limit").hint("a longer --time-limit"),
            BrepError::NoSurface { .. } | BrepError::Spindle { .. } => none("not-exact")
                .why("only faces of these kinds are written as solids")
                .hint("isoform parameterize --cover writes patches of any surface"),
            BrepError::OffSurface { .. } => none("off-surface")
                .why("parts thinner than its triangles, or surfaces that touch, confuse a mesh")
                .hint("a smaller --size"),
            BrepError::NoCurve { at, .. } => none("tangent").somewhere(*at).why(format!(
                "surfaces that touch smoothly have no well-defined edge, here at {}",
                place(*at)
            )),
            BrepError::NoVertex { at } => none("corner")
                .somewhere(*at)
                .why(format!("at {}", place(*at)))
                .hint("a smaller --size"),
            _ => none("not-closed").hint("a smaller --size"),
        },
        _ => none("brep"),
    }
}

/// The result for people.
fn text(report: &BrepReport) -> String {
    let mut kinds: Vec<(&str, usize)> = Vec::new();
    for face in &report.faces {
        match kinds.iter_mut().find(|k| k.0 == face.kind) {
            Some(kind) => kind.1 += 1,
            None => kinds.push((face.kind, 1)),
        }
    }
    let kinds: Vec<String> = kinds.iter().map(|(k, n)| format!("{n} {k}")).collect();
    let worst = report.faces.iter().map(|f| f.max_distance);
    let worst = worst.fold(0.0, f64::max);
    let seconds: f64 = report.seconds.0.iter().map(|s| s.1).sum();
    let verdict = if report.ok { "holds" } else { "does not hold" };
    let mut lines = vec![
        line(
            "solids",
            format!("{} with {} voids", report.solids, report.voids),
        ),
        line(
            "faces",
            format!("{} ({})", report.faces.len(), kinds.join(", ")),
        ),
        line(
            "edges",
            format!("{}, {} vertices", report.edges, report.vertices),
        ),
        line("volume", report.volume.to_string()),
        line("area", report.area.to_string()),
        line(
            "gaps",
            format!("{:.1e} at edges, {worst:.1e} from the model", report.gap),
        ),
        line("certificate", format!("{verdict}; {} s", brief(seconds))),
    ];
    let failures = report.certificate.failures.iter();
    lines.extend(failures.map(|f| line("FAILED", f.clone())));
    lines.extend(report.files.iter().map(|f| line("wrote", f.clone())));
    lines.concat()
}
