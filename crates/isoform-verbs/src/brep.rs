//! `isoform brep`: solids of exact faces for CAD, with a certificate.

use crate::arguments;
use crate::context::Context;
use crate::failure::{Failure, NO_RESULT};
use crate::gallery;
use crate::language::Language;
use crate::memory;
use crate::mesh::settings::Settings;
use crate::mesh::work::{Phases, no_mesh, place};
use crate::model::SolidModel;
use crate::outcome::{self, Outcome};
use crate::parameters::Given;
use crate::product::Product;
use crate::product::Statement;
use crate::solids;
use crate::table::{line, measure};
use isoform::brep::{BrepError, SplineRefusal};
use isoform::field::hyperfun::Model;
use isoform::geom::Aabb;
use isoform::report::{BrepReport, ModelName, Seconds, brief};
use isoform::{BrepModelError, Control, MeshModelOptions, ModelBrep, brep_model};
use std::path::PathBuf;

/// Writes a model as a solid of exact faces for CAD (STEP)
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform brep part.hf -o part.step
  isoform brep part.hf --params 2,0.5 --units mm --ap214 -o part.step
  isoform brep part.hf --box=-1,-1,-1,1,1,1 -o half.step --json
  isoform brep part.hf -o part.step -o part.brep.json

Faces lie on the planes, cylinders, cones, spheres and tori of the model itself, not on triangles; faces that meet
share one edge, edges that meet one vertex. Every solid comes with a certificate: closed, with the topology of the
mesh, how far edges leave their faces, and volume and area by integrals without a mesh. A face that goes round is cut
in two, or more; its charts are named part#chart1 and so on. See docs/brep.md.

Exit code: 0, or 3 if the certificate fails or the mesh leaves something open (the file is written all the same, but
never with a shell that is not closed), 4 where there is no such solid, 2 for unreadable input, 130 after Ctrl-C.")]
pub(crate) struct Args {
    /// The model: a HyperFun file (- for stdin), a formula, or the name of a built-in template
    model: PathBuf,
    #[command(flatten)]
    given: Given,
    /// Cut off what does not lie in this box: x,y,z of the lower and of the upper corner; the cuts
    /// are planes named cap.x_min ...
    #[arg(long = "box", value_name = "NUMBERS", allow_hyphen_values = true, value_parser = arguments::region)]
    region: Option<Aabb>,
    /// Length of the edges of the mesh that the topology comes from [default: a fortieth of the
    /// diagonal]
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    size: Option<f64>,
    /// Largest distance of faces from the model, in its units [default: 1e-6 of its largest side];
    /// exact faces are within 1e-8 of it, whatever the value
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    tol: Option<f64>,
    /// Unit of length to state: um, mm, cm, m, in or ft [default: as annotated, else mm]
    #[arg(long, value_name = "UNIT")]
    units: Option<String>,
    /// Write the older AP214 instead of AP242
    #[arg(long)]
    ap214: bool,
    /// Write a STEP file (.step, .stp; - for stdout), or our own form without loss (.brep.json);
    /// may be repeated
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    #[command(flatten)]
    language: Language,
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    solids::check(&args.output)?;
    if args.output.is_empty() {
        context.note("no -o: nothing will be written");
    }
    let name = memory::name(&args.model);
    let model = gallery::model(&args.model, &args.language, context)?;
    let solid = model.solid(&args.model, &args.given, args.region, context)?;
    let SolidModel {
        model,
        values,
        region,
        ..
    } = solid;
    let subject = SolidInput {
        name,
        unit: model.info().unit.clone(),
        model,
        values,
    };
    let mut options = MeshModelOptions {
        size: args.size,
        ..MeshModelOptions::default()
    };
    options.mesh.region = region;
    let made = make(subject, &options, args.tol, &context.control(), context)?;
    made.say(context);
    let subject = &made.subject;
    let said = Statement {
        ap214: args.ap214,
        ..Statement::named_after(
            &subject.name,
            args.units.clone().or_else(|| subject.unit.clone()),
        )
    };
    let (files, stdout) = solids::write(&made.solid, &args.output, &said, &subject.name, context)?;
    let report = made.report(files);
    let json = outcome::json_of(&report);
    let outcome = Outcome::new(made.exit(), json, stdout, || text(&report));
    context.hand_over(|| Product::Solids(Box::new(made.solid), said));
    Ok(outcome)
}

/// Input of a solid: a model with its values and region.
pub(crate) struct SolidInput {
    /// For messages.
    pub(crate) name: String,
    pub(crate) model: Model,
    /// The values of its parameters.
    pub(crate) values: Vec<f64>,
    /// Unit of its lengths.
    pub(crate) unit: Option<String>,
}

/// A solid with all that is known of it.
pub(crate) struct MadeSolid {
    subject: SolidInput,
    pub(crate) solid: ModelBrep,
    seconds: Vec<(String, f64)>,
}

/// Makes a solid, for `brep`, `fit` and `recover`. `tolerance` bounds the distance of faces from
/// the model; `None` takes the default.
pub(crate) fn make(
    subject: SolidInput,
    options: &MeshModelOptions,
    tolerance: Option<f64>,
    control: &Control<'_>,
    context: &Context,
) -> Result<MadeSolid, Failure> {
    let phases = Phases::new(context);
    let show = |phase: &str, _: f64| phases.enter(phase);
    let control = Control {
        progress: Some(&show),
        ..*control
    };
    let SolidInput { model, values, .. } = &subject;
    let solid = brep_model(model, values, options, tolerance, &control)
        .map_err(|e| no_brep(&e, &subject.name, options.mesh.region))?;
    Ok(MadeSolid {
        subject,
        solid,
        seconds: phases.seconds(),
    })
}

impl MadeSolid {
    /// 0, or 3 where the certificate does not hold, or 130.
    pub(crate) fn exit(&self) -> u8 {
        outcome::exit(self.solid.certificate.holds())
    }
    /// Says all that is left open on stderr.
    pub(crate) fn say(&self, context: &Context) {
        for failure in &self.solid.certificate.failures {
            context.warn(failure);
        }
        for note in self.solid.mesh.notes() {
            context.warn(note);
        }
    }
    /// The report, with the files that the solid went to.
    pub(crate) fn report(&self, files: Vec<String>) -> BrepReport {
        let about = ModelName {
            file: self.subject.name.clone(),
            object: self.subject.model.name().to_owned(),
            parameters: self.subject.values.clone(),
            unit: self.subject.unit.clone(),
        };
        BrepReport::new(&self.solid, about, files, Seconds(self.seconds.clone()))
    }
}

/// Converts an error of the stage to a failure that names the model.
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
        BrepModelError::Brep(e) => match e {
            BrepError::Stopped => Failure::stopped(format!("{name}: {error}"), ""),
            BrepError::NoSurface { .. } | BrepError::Spindle { .. } => none("not-exact")
                .why("only faces of these kinds are written as solids")
                .hint("isoform parameterize --cover writes patches of any surface"),
            BrepError::OffSurface { .. } => none("off-surface")
                .why("parts thinner than its triangles, or surfaces that touch, confuse a mesh")
                .hint("a smaller --size"),
            BrepError::NoSpline { why, .. } => no_spline(none("no-spline"), *why, name),
            BrepError::NoCurve { at, .. } => none("tangent")
                .somewhere(*at)
                .why(format!(
                    "at {} they touch smoothly, where an edge is not well-defined, or a step between \
                     them is smaller than the triangles of the mesh",
                    place(*at)
                ))
                .hint("a smaller --size"),
            BrepError::NoVertex { at } => none("corner")
                .somewhere(*at)
                .why(format!("at {}", place(*at)))
                .hint("a smaller --size"),
            _ => none("not-closed").hint("a smaller --size"),
        },
        _ => none("brep"),
    }
}

/// Completes the failure of a part without splines.
fn no_spline(failure: Failure, why: SplineRefusal, name: &str) -> Failure {
    match why {
        SplineRefusal::TooFar { .. } => failure
            .why("the tolerance is smaller than what splines reach there")
            .hint("a larger --tol"),
        _ => failure
            .why("each spline face is a height over a plane, and its few triangles tell no plane")
            .hint(format!(
                "a smaller --size; isoform mesh {name} -o part.3mf (or part.stl) writes triangles"
            )),
    }
}

/// Returns the number of faces of each kind in words, in the order of first occurrence.
pub(crate) fn kinds<'k>(faces: impl Iterator<Item = &'k str>) -> String {
    let mut kinds: Vec<(&str, usize)> = Vec::new();
    for face in faces {
        match kinds.iter_mut().find(|k| k.0 == face) {
            Some(kind) => kind.1 += 1,
            None => kinds.push((face, 1)),
        }
    }
    let kinds: Vec<String> = kinds.iter().map(|(k, n)| format!("{n} {k}")).collect();
    kinds.join(", ")
}

/// The result for people.
pub(crate) fn text(report: &BrepReport) -> String {
    let kinds = kinds(report.faces.iter().map(|f| f.kind));
    let worst = report.faces.iter().map(|f| f.max_distance);
    let worst = worst.fold(0.0, f64::max);
    let seconds: f64 = report.seconds.0.iter().map(|s| s.1).sum();
    let unit = report.model.unit.as_deref();
    let verdict = if report.ok { "holds" } else { "does not hold" };
    let mut lines = vec![
        line(
            "solids",
            format!("{} with {} voids", report.solids, report.voids),
        ),
        line("faces", format!("{} ({kinds})", report.faces.len())),
        line(
            "edges",
            format!("{}, {} vertices", report.edges, report.vertices),
        ),
        line("volume", measure(report.volume, unit, 3)),
        line("area", measure(report.area, unit, 2)),
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
