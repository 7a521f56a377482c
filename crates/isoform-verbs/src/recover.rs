//! `isoform recover`: from points to a fitted model and a report, in one go. Without a template one
//! is proposed from what is recognised in the scan.

use crate::context::Context;
use crate::failure::{DONE, Failure};
use crate::fit::settings::Settings;
use crate::fit::work as fit_work;
use crate::fit::{document, files, job, solid, table};
use crate::gallery;
use crate::kind;
use crate::labels;
use crate::language::Language;
use crate::mesh::work::{self, MadeMesh, MeshInput, Shape};
use crate::mesh::{self, files::MeshTarget};
use crate::model;
use crate::outcome::Outcome;
use crate::product::Product;
use crate::recognize;
use crate::recover_folder as folder;
use crate::solids;
use crate::watchdog;
use isoform::field::hyperfun::Model;
use isoform::fit::{ClutterKind, Estimate, Finding, Fit, Status, Template};
use isoform::geom::Point3;
use isoform::recognize::{Entity, LabelFacts, stand_on};
use isoform::{MeshModelOptions, Proposal, RecognizeOptions, ScanFit, ScanLabels};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The template that is fitted to the built-in scan.
const TEMPLATE: &str = "cup";
/// Name of a template that is made from the scan.
const PROPOSED: &str = "proposed template";
/// Points in which entities are recognised at most: all are fitted. More find smaller faces, and
/// take longer.
const RECOGNIZED: usize = 100_000;

/// Recovers a model from a scan: fit, deviations, mesh and report in one go
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform recover
  isoform recover scan.ply
  isoform recover scan.ply bottle -o bottle.hf -o report.html
  isoform recover scan.ply part.hf -o part.inp --size 0.5
  isoform recover scan.ply part.hf -o part.step
  isoform recover scan.ply -o results/
  isoform recover scan.ply --labels edited.ply --kind 3=cylinder -o part.step

Without arguments the scan of a cup that the program carries is fitted. Without a template the
planes, spheres, cylinders, cones and tori of the scan are recognised (see recognize), and the
template made of them is fitted. Without -o, fitted.hf, deviation.ply and report.html go to the
folder isoform-recover/NAME, NAME being that of the scan (NAME-2 for another scan of that name;
scan.txt says which it is), and with -o FOLDER/ to that folder; and part.step, the solid of exact
faces for CAD, if SCAN is given, the fit is accepted and the certificate of the solid holds. What
an earlier run left in the folder of the scan is removed first. With -o part.msh, .inp, .vtu, .stl
and the like the fitted model is meshed, see mesh; with -o part.step or part.brep.json it becomes
a solid, see brep: of a fit that is in doubt only with --force. A solid may take five minutes;
--time-limit sets another limit. Exit codes are those of fit, and 3 where the mesh or a solid
asked for is not certified or a proposed template leaves a fiftieth of the points, a face that was
recognised, or a side that was not seen, or a parameter of it is at a bound. Where a stage fails
the code is its own, and what was made before it is written.")]
pub(crate) struct Args {
    /// The points [default: the scan of a cup that is built in]
    scan: Option<PathBuf>,
    /// The template: a HyperFun file or a name out of `fit --list` [default: made of what is
    /// recognised]
    template: Option<PathBuf>,
    #[command(flatten)]
    given: labels::Given,
    #[command(flatten)]
    options: Settings,
    #[command(flatten)]
    mesh: mesh::settings::Settings,
    /// Write a file; by its ending: .hf, .ply, .xyz, .csv, .html, .json, a solid: .step,
    /// .brep.json, or a mesh: .msh, .inp, .vtu, .stl, ...; or, to FOLDER/, what there is without -o
    #[arg(short, long, value_name = "FILE|FOLDER/")]
    output: Vec<PathBuf>,
}

/// Runs the verb: fits, writes the results, then makes the solid and the mesh of the fitted model.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let is_proposed = args.scan.is_some() && args.template.is_none();
    let named = if is_proposed { PROPOSED } else { TEMPLATE };
    let template = args.template.clone().unwrap_or_else(|| named.into());
    let settings = &args.options;
    let read = || gallery::template(&template, &settings.language, context);
    let model = if is_proposed { None } else { Some(read()?) };
    args.check_labels(is_proposed)?;
    let mut outputs = Outputs::new(args, context)?;
    let scan = match &args.scan {
        Some(path) => fit_work::read_scan(path, None, None, context)?,
        None => embedded(),
    };
    let labels = args.given.read(&scan.cloud, context)?;
    // What is wrong with the template or the scan is said before a folder is made.
    outputs.make_folders(args, context)?;
    let (scan, model, proposal) = match model {
        Some(model) => (scan, model, None),
        None => {
            let labels = labels.map(|labels| (labels, args.given.facts()));
            let alone = standing_alone(scan, labels, &settings.keep(), context)?;
            let (model, proposal) = proposed(&alone, &settings.language, context)?;
            (alone.scan, model, Some((proposal, alone.supports)))
        }
    };
    let mut job = watchdog::stage("fit", || {
        let is_measured = proposal.is_some();
        fit_work::run(scan, (&template, &model, is_measured), settings, context)
    })?;
    if let Some((EntityProposal { proposal, .. }, supports)) = &proposal {
        add_findings(&mut job.found.fit, proposal);
        stand_on_planes(&mut job.found, supports);
    }
    let written = files::write(&mut job, &outputs.results, context)?;
    if !context.global.json {
        job.warnings.iter().for_each(|w| context.warn(w));
    }
    let mut told = RecoverResult::new(&job, &written);
    if let Some((proposal, _)) = &proposal {
        told.add_proposal(proposal);
    }
    told.print(context)?;
    if !outputs.solid.paths.is_empty() {
        told.add_solid(solid::tell(
            &job,
            &settings.language,
            &outputs.solid,
            context,
        ));
    }
    told.print(context)?;
    if !outputs.meshes.is_empty() {
        context.say("meshing the fitted model");
        let mesh = || {
            fitted_mesh(
                &job,
                &settings.language,
                &args.mesh,
                &outputs.meshes,
                context,
            )
        };
        told.add_made(watchdog::stage("mesh of the fitted model", mesh), context);
    }
    context.hand_over(|| Product::Fit(Box::new(job)));
    Ok(told.outcome())
}

impl Args {
    /// Checks that labels are given where a template is made of them.
    fn check_labels(&self, is_proposed: bool) -> Result<(), Failure> {
        if self.given.labels.is_none() || is_proposed {
            return Ok(());
        }
        let message = "--labels are for templates that are made of a scan";
        Err(Failure::usage(message).hint("isoform recover SCAN --labels FILE"))
    }
}

/// Labels given by hand, with what is stated about them.
type LabelsGiven = Option<(ScanLabels, LabelFacts)>;

/// A scan without the planes on which its part stands.
struct StandingAlone {
    scan: fit_work::Scan,
    /// Labels of its points.
    labels: LabelsGiven,
    /// Those planes: a point and the unit normal of each.
    supports: Vec<(Point3, Point3)>,
}

/// Takes the planes off that a part stands at, unless they are to be kept.
fn standing_alone(
    scan: fit_work::Scan,
    labels: LabelsGiven,
    keep: &[ClutterKind],
    context: &Context,
) -> Result<StandingAlone, Failure> {
    let standing = match keep.contains(&ClutterKind::Plane) {
        true => None,
        false => isoform::without_supports(&scan.cloud, &context.control())
            .map_err(|e| recognize::failure(e.into(), Path::new(&scan.name)))?,
    };
    let Some(standing) = standing else {
        return Ok(StandingAlone {
            scan,
            labels,
            supports: Vec::new(),
        });
    };
    context.warn(format_args!(
        "{}: {:.1} % of the points lie on planes that reach beyond the part, such as a table, and \
         are left out; --keep-planes keeps them",
        scan.name,
        100.0 * standing.left_out as f64 / scan.cloud.points.len() as f64,
    ));
    let labels = labels.map(|(labels, mut facts)| {
        let (labels, lost) = labels.select(&standing.kept);
        for label in &lost {
            context.warn(format_args!(
                "{}: label {label} is on a plane that is left out",
                scan.name
            ));
        }
        facts.remove(&lost);
        (labels, facts)
    });
    let cloud = standing.part;
    Ok(StandingAlone {
        scan: fit_work::Scan { cloud, ..scan },
        labels,
        supports: standing.supports,
    })
}

/// A template made of what is recognised in a scan, or in some of its points, or of labels given by
/// hand.
fn proposed(
    alone: &StandingAlone,
    language: &Language,
    context: &Context,
) -> Result<(Model, EntityProposal), Failure> {
    let path = Path::new(&alone.scan.name);
    let options = RecognizeOptions::default();
    let cloud = &alone.scan.cloud;
    let sample;
    let mut found = match &alone.labels {
        Some((labels, facts)) => {
            sample = labels.sample(cloud, RECOGNIZED);
            let (cloud, labels) = match &sample {
                Some((cloud, labels)) => (cloud, labels),
                None => (cloud, labels),
            };
            recognize::labelled(cloud, (labels, facts), path, &options, context)?.into_owned()
        }
        None => {
            let sample = isoform::sample_of(cloud, RECOGNIZED);
            let cloud = sample.as_ref().unwrap_or(cloud);
            recognize::recognised(cloud, path, &options, context)?.into_owned()
        }
    };
    found.supports.clone_from(&alone.supports);
    let proposal = recognize::proposal(&found, path, context)?;
    let model = model::parse(Path::new(PROPOSED), &proposal.program, language, context)?;
    let label = |e: &Entity| Some((e.label?, e.is_explained));
    let entities = &found.recognition.entities;
    let labels = alone
        .labels
        .as_ref()
        .map(|_| entities.iter().filter_map(label).collect());
    Ok((model, EntityProposal { proposal, labels }))
}

/// Adds the findings against a fit of a proposed template. Its bounds lie about what was
/// recognised: a parameter that runs into one contradicts the recognition.
fn add_findings(fit: &mut Fit, proposal: &Proposal) {
    for gap in proposal.faults(fit.isolated) {
        let what = format!("template: {gap}");
        fit.add_finding(Finding::Incomplete { what });
    }
    let is_known = |f: &Finding| matches!(f, Finding::AtBounds { .. });
    let at_bound = fit
        .parameters
        .iter()
        .filter(|p| p.status == Status::AtBound);
    let names: Vec<String> = at_bound.map(|p| p.name.clone()).collect();
    if !names.is_empty() && !fit.findings.iter().any(is_known) {
        fit.add_finding(Finding::AtBounds { names });
    }
}

/// Puts the faces on which the part stands where the planes under it are: they are held in a frame
/// that the fit has moved.
fn stand_on_planes(found: &mut ScanFit, supports: &[(Point3, Point3)]) {
    let Some(place) = found.placement() else {
        return;
    };
    let extent = found.own_extent();
    for (at, normal) in supports {
        let mut bounds = extent;
        let (at, normal) = (place.framed(*at), place.turned_back(*normal));
        let (axis, is_upper) = stand_on(&mut bounds, at, normal);
        let (side, end) = match is_upper {
            true => ("high", bounds.hi),
            false => ("low", bounds.lo),
        };
        let name = format!("unseen_{}_{side}", ["x", "y", "z"][axis]);
        let is_it = |p: &Estimate| p.name == name && p.status == Status::Fixed;
        let Some(i) = found.fit.parameters.iter().position(is_it) else {
            continue;
        };
        let mut ties = found
            .template
            .parameters()
            .iter()
            .filter_map(|p| p.tie.as_ref());
        if !ties.any(|tie| tie.terms.iter().any(|term| term.0 == i)) {
            found.fit.parameters[i].value = end[axis];
        }
    }
}

/// A template made of entities.
struct EntityProposal {
    proposal: Proposal,
    /// Labels of the entities if they were given by hand, each with true if the entity explains its
    /// points.
    labels: Option<Vec<(u32, bool)>>,
}

/// The files to write.
struct Outputs {
    /// Results of the fit.
    results: Vec<PathBuf>,
    /// The solid of the fitted model.
    solid: solid::SolidRequest,
    /// Meshes to write.
    meshes: Vec<MeshTarget>,
    /// Folders for the results that there are without -o.
    folders: Vec<PathBuf>,
}

impl Outputs {
    /// Those that were asked for; folders are not made yet.
    fn new(args: &Args, context: &Context) -> Result<Self, Failure> {
        let (folders, paths): (Vec<PathBuf>, Vec<PathBuf>) = args
            .output
            .iter()
            .cloned()
            .partition(|p| folder::is_folder(p));
        let (solid, paths): (Vec<PathBuf>, Vec<PathBuf>) =
            paths.into_iter().partition(|p| kind::is_solid(p));
        let (results, meshes): (Vec<PathBuf>, Vec<PathBuf>) = paths
            .into_iter()
            .partition(|p| files::is_result(p) || !mesh::files::is_mesh(p));
        files::check(&results)?;
        solids::check(&solid)?;
        let mut options = MeshModelOptions {
            size: args.mesh.size,
            ..MeshModelOptions::default()
        };
        options.mesh.region = args.mesh.region;
        Ok(Self {
            results,
            solid: solid::SolidRequest {
                is_asked: !solid.is_empty(),
                is_forced: context.global.force,
                paths: solid,
                options,
            },
            meshes: mesh::files::targets(&meshes, None, context)?,
            folders,
        })
    }

    /// Makes the folders, and adds what goes there. The scan that is built in is an example of a
    /// fit, which a solid would make three times as long.
    fn make_folders(&mut self, args: &Args, context: &Context) -> Result<(), Failure> {
        let scan = args.scan.as_deref();
        let name = scan.unwrap_or(Path::new(TEMPLATE));
        let folders = match args.output.is_empty() && context.listener.is_none() {
            true => vec![folder::of_scan(name, scan, context)?],
            false => std::mem::take(&mut self.folders),
        };
        for folder in folders {
            folder::begin(&folder, scan, context)?;
            self.results.extend(folder::RESULTS.map(|f| folder.join(f)));
            self.solid
                .paths
                .extend(scan.map(|_| folder.join(folder::SOLID)));
        }
        Ok(())
    }
}

/// Results of the fit, the solid and the mesh, for the outcome.
struct RecoverResult {
    /// Exit code so far.
    exit: u8,
    /// Document so far.
    json: Value,
    /// Table so far.
    text: String,
    /// The files that are written.
    files: Vec<String>,
}

impl RecoverResult {
    /// Returns the results of a fit with its written files.
    fn new(job: &job::Job, written: &[PathBuf]) -> Self {
        let files: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
        let mut text = table::text(job);
        for path in &files {
            text += &format!("wrote     {path}\n");
        }
        Self {
            exit: job.exit(),
            json: document::document(job, "recover"),
            text,
            files,
        }
    }
    /// The template was made of the scan.
    fn add_proposal(&mut self, EntityProposal { proposal, labels }: &EntityProposal) {
        let gaps: Vec<String> = proposal.gaps.iter().map(ToString::to_string).collect();
        let used = proposal.used.iter().filter(|u| **u).count();
        self.text = format!(
            "template  made of {used} of {} recognised entities, which explain {:.1} % of the points\n\n{}",
            proposal.used.len(),
            100.0 * proposal.explained,
            self.text
        );
        self.json["proposal"] = json!({
            "entities": proposal.used.len(),
            "entities_used": used,
            "explained": proposal.explained,
            "complete": proposal.is_complete(),
            "gaps": gaps,
        });
        if let Some(labels) = labels {
            let all: Vec<u32> = labels.iter().map(|l| l.0).collect();
            let open = labels.iter().filter(|l| !l.1).map(|l| l.0);
            self.json["proposal"]["labels"] = json!(all);
            self.json["proposal"]["unexplained_labels"] = json!(open.collect::<Vec<u32>>());
        }
    }
    /// Adds the result for the solid.
    fn add_solid(&mut self, told: solid::SolidResult) {
        told.add_to(&mut self.json);
        if self.exit == DONE || told.failure.is_some() {
            self.exit = told.exit;
        }
        self.text += &told.text;
        self.files.extend(told.files);
    }
    /// Adds a mesh. Its exit code counts if the fit succeeded.
    fn add_mesh(&mut self, made: &MadeMesh) {
        self.files
            .extend(made.written.iter().map(|w| w.path.clone()));
        if self.exit == DONE {
            self.exit = made.exit();
        }
        self.json["mesh"] = mesh::document::document(made);
        self.text += &format!("\n{}", mesh::table::text(made));
    }
    /// Adds a mesh, or why there is none.
    fn add_made(&mut self, made: Result<MadeMesh, Failure>, context: &Context) {
        match made {
            Ok(made) => {
                made.say(context);
                self.add_mesh(&made);
            }
            Err(failure) => self.add_failure(failure, context),
        }
    }
    /// Adds the failure of the mesh; the fit and its files remain valid.
    fn add_failure(&mut self, failure: Failure, context: &Context) {
        let failure = no_mesh(failure, &self.files);
        context.complain(&failure);
        self.exit = failure.exit;
        self.json["mesh"] = json!({"ok": false, "error": failure.json()});
        self.json["error"] = failure.json();
    }
    /// Prints what there is of the table: the next stage may take long.
    fn print(&mut self, context: &Context) -> Result<(), Failure> {
        if context.global.json {
            return Ok(());
        }
        context.announce(Value::Null, std::mem::take(&mut self.text))
    }
    /// Returns the outcome of the verb.
    fn outcome(mut self) -> Outcome {
        self.json["outputs"] = json!(self.files);
        Outcome {
            exit: self.exit,
            json: self.json,
            stdout: self.text.into_bytes(),
        }
    }
}

/// Meshes the fitted program and writes the files.
fn fitted_mesh(
    job: &job::Job,
    language: &Language,
    settings: &mesh::settings::Settings,
    targets: &[MeshTarget],
    context: &Context,
) -> Result<MadeMesh, Failure> {
    let (model, values) = solid::fitted_model(job, language)?;
    let subject = MeshInput {
        name: format!("fitted {}", job.template_name),
        shape: Shape::Model(Box::new(model), values),
        regions: Vec::new(),
        unit: solid::unit(job),
    };
    let settings = mesh::settings::Settings {
        start: Some(solid::extent(job)),
        ..settings.clone()
    };
    let mut made = work::make(&subject, &settings, None, context)?;
    mesh::files::write(&mut made, targets)?;
    Ok(made)
}

/// Why the fitted model has no mesh, and what there is of it.
fn no_mesh(mut failure: Failure, written: &[String]) -> Failure {
    let kept = if written.is_empty() {
        "its parameters stand in the table".to_owned()
    } else {
        format!("wrote {}", written.join(", "))
    };
    failure.message = format!(
        "the model was fitted ({kept}), but not meshed: {}",
        failure.message
    );
    failure
}

/// The example scan that the program carries.
fn embedded() -> fit_work::Scan {
    let started = Instant::now();
    let (cloud, report) = isoform::example_scan();
    fit_work::Scan {
        name: isoform::EXAMPLE_SCAN.to_owned(),
        cloud,
        report,
        seconds: started.elapsed().as_secs_f64(),
    }
}
