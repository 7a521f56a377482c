//! The verbs of Isoform: arguments in, one call of the library, a document or files out.
//!
//! Each verb is declared once, by the arguments of its module. The program `isoform` takes them as
//! words ([`program`]), other callers as values ([`call`]). Callers may pass objects in memory in
//! place of files ([`memory`]), and get the result itself with its document ([`Product`]).
#![forbid(unsafe_code)]

mod arguments;
mod brep;
mod compare;
mod completions;
mod context;
mod convert;
mod disk;
mod eval;
mod failure;
mod fit;
mod formula;
mod functions;
mod gallery;
mod help;
mod implicitize;
mod inputs;
mod inspect;
mod interrupt;
mod kind;
mod labels;
mod language;
mod layers;
pub mod memory;
mod mesh;
mod model;
mod outcome;
mod parameterize;
mod parameters;
mod product;
mod progress;
mod recognize;
mod recover;
mod recover_folder;
mod render;
mod report;
mod request;
mod scan;
mod serve;
mod solids;
mod spline;
#[cfg(not(target_family = "wasm"))]
mod studio;
mod table;
mod terminal;
mod terms;
mod triangulate;
mod view;
mod watchdog;

use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use context::{Context, Global};
use failure::{DONE, INTERNAL, NO_RESULT, USAGE};
pub use failure::{Failure, Place};
pub use fit::job::Job as FittedScan;
use help::Extent;
use inputs::Inputs;
use isoform::report::Document;
use isoform::{FitOptions, FitScanError, MeshModelError, MeshModelOptions};
pub use outcome::Outcome;
use outcome::document as document_of;
pub use product::{Product, Statement};
pub use progress::{Listener, OnProgress};
use serde_json::{Map, Value, json};
pub use spline::file as function_file;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use terminal::{fail, to_stdout};
pub use terms::read_terms;
use watchdog::Writing;

/// Isoform makes dimensions, CAD solids and meshes of scans, programs and formulas, and checks each
/// result.
#[derive(Parser)]
#[command(name = "isoform", version, max_term_width = 110)]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Recover(Box<recover::Args>),
    Fit(Box<fit::Args>),
    Mesh(Box<mesh::Args>),
    Brep(Box<brep::Args>),
    Parameterize(Box<parameterize::Args>),
    Triangulate(Box<triangulate::Args>),
    Implicitize(implicitize::Args),
    Recognize(recognize::Args),
    Eval(eval::Args),
    Inspect(inspect::Args),
    Convert(convert::Args),
    Compare(Box<compare::Args>),
    View(view::Args),
    Render(Box<render::Args>),
    #[cfg(not(target_family = "wasm"))]
    Studio(studio::Args),
    Functions(functions::Args),
    Run(request::RunArgs),
    Schema(request::SchemaArgs),
    /// Prints the completion script of a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

impl Verb {
    /// True if it has many short parallel loops, as fits have.
    fn has_short_loops(&self) -> bool {
        match self {
            Self::Recover(_) | Self::Fit(_) => true,
            Self::Mesh(_)
            | Self::Brep(_)
            | Self::Parameterize(_)
            | Self::Triangulate(_)
            | Self::Implicitize(_)
            | Self::Recognize(_)
            | Self::Eval(_)
            | Self::Inspect(_)
            | Self::Convert(_)
            | Self::Compare(_)
            | Self::View(_)
            | Self::Render(_)
            | Self::Functions(_)
            | Self::Run(_)
            | Self::Schema(_)
            | Self::Completions { .. } => false,
            #[cfg(not(target_family = "wasm"))]
            Self::Studio(_) => false,
        }
    }
}

/// Calls the verb.
fn run(verb: Verb, context: &Context) -> Result<Outcome, Failure> {
    match verb {
        Verb::Recover(args) => recover::run(&args, context),
        Verb::Fit(args) => fit::run(&args, context),
        Verb::Mesh(args) => mesh::run(&args, context),
        Verb::Brep(args) => brep::run(&args, context),
        Verb::Parameterize(args) => parameterize::run(&args, context),
        Verb::Triangulate(args) => triangulate::run(&args, context),
        Verb::Implicitize(args) => implicitize::run(&args, context),
        Verb::Recognize(args) => recognize::run(&args, context),
        Verb::Inspect(args) => inspect::run(&args, context),
        Verb::Convert(args) => convert::run(&args, context),
        Verb::Compare(args) => compare::run(&args, context),
        Verb::View(args) => view::run(&args, context),
        Verb::Render(args) => render::run(&args, context),
        #[cfg(not(target_family = "wasm"))]
        Verb::Studio(args) => studio::run(&args, context),
        Verb::Eval(args) => eval::run(&args, context),
        Verb::Functions(args) => functions::run(&args),
        // It has been read in the place of these arguments.
        Verb::Run(_) => Err(Failure::usage("a request cannot run another one")),
        Verb::Schema(args) => {
            let command = command(Extent::Whole);
            if args.page {
                return Ok(Outcome::text(request::page(&command).into_bytes()));
            }
            let schema = request::schema(args.verb.as_deref(), &command)?;
            Ok(Outcome::json(schema))
        }
        Verb::Completions { shell } => {
            let script = completions::script(shell, &mut command(Extent::Whole));
            Ok(Outcome::text(script))
        }
    }
}

/// Returns the declaration of all verbs, arranged for help.
fn command(extent: Extent) -> Command {
    help::arranged(Cli::command(), extent)
}

/// Arguments as read, and the files among them that are read.
type Parsed = (Cli, Result<Inputs, Failure>);

/// Reads the arguments. Those of `isoform run` are a file of others; global options may stand in it,
/// or on the command line.
fn parse(words: impl IntoIterator<Item = OsString>) -> Result<Parsed, clap::Error> {
    let mut words: Vec<OsString> = words.into_iter().collect();
    // `isoform help hfBlock`: clap's help knows verbs only. `mesh` is both.
    if let [_, help, name] = words.as_mut_slice()
        && help == "help"
        && let Some(name) = name.to_str()
        && functions::is_function(name)
        && command(Extent::Short).find_subcommand(name).is_none()
    {
        *help = OsString::from("functions");
    }
    let extent = match words.iter().any(|word| word == "-h") {
        true => Extent::Short,
        false => Extent::Whole,
    };
    let matches = command(extent).try_get_matches_from(words)?;
    let cli = Cli::from_arg_matches(&matches)?;
    let Verb::Run(args) = &cli.verb else {
        let inputs = inputs_of(&matches, None, cli.global.force);
        return Ok((cli, inputs));
    };
    let words = match request::read(&args.file, &command(Extent::Whole)) {
        Ok(words) => words,
        Err(failure) => return Ok((cli, Err(failure))),
    };
    let program = std::iter::once(OsString::from("isoform"));
    let inner = command(Extent::Whole).try_get_matches_from(program.chain(words))?;
    let mut asked = Cli::from_arg_matches(&inner)?;
    let (global, of_request) = (&cli.global, &mut asked.global);
    of_request.json |= global.json;
    of_request.quiet |= global.quiet;
    of_request.force |= global.force;
    of_request.verbose = global.verbose.max(of_request.verbose);
    of_request.threads = global.threads.or(of_request.threads);
    of_request.time_limit = global.time_limit.or(of_request.time_limit);
    let is_given = matches.subcommand().is_some_and(|(_, run)| {
        run.value_source("seed") == Some(clap::parser::ValueSource::CommandLine)
    });
    if is_given {
        of_request.seed = global.seed;
    }
    let inputs = inputs_of(&inner, Some(&args.file), asked.global.force);
    Ok((asked, inputs))
}

/// Returns the files that a verb reads.
fn inputs_of(
    matches: &clap::ArgMatches,
    request: Option<&Path>,
    force: bool,
) -> Result<Inputs, Failure> {
    match matches.subcommand() {
        Some((_, verb)) => Inputs::new(verb, request, force),
        None => Ok(Inputs::default()),
    }
}

/// Result of a call.
pub struct Answer {
    /// Exit code, document and text.
    pub outcome: Outcome,
    /// The result in memory, of verbs that make one.
    pub product: Option<Product>,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}

/// Calls a verb from another part of the process, with its arguments by their names in requests
/// (`isoform schema`). The work runs on the caller's pool of threads.
///
/// # Errors
/// [`Failure`] if the arguments do not say what to do, or the work has no result.
pub fn call(
    verb: &str,
    arguments: &Map<String, Value>,
    listener: Listener,
) -> Result<Answer, Failure> {
    let words = request::words(verb, arguments, &command(Extent::Whole)).map_err(Failure::plain)?;
    let program = std::iter::once(OsString::from("isoform"));
    let (cli, inputs) = parse(program.chain(words)).map_err(refused)?;
    let mut context = Context::new(cli.global, Some(listener));
    let result = watchdog::stage("", || {
        context.inputs = inputs?;
        run(cli.verb, &context)
    });
    let outcome = result.map_err(Failure::plain)?;
    let (product, warnings) = context.into_parts();
    Ok(Answer {
        outcome: outcome.plain(),
        product,
        warnings,
    })
}

/// Returns the document of `--json` as text: a report behind the version of the form. `exit` is the
/// code that comes with it.
pub fn document(exit: u8, report: Value) -> String {
    let ok = ![NO_RESULT, INTERNAL].contains(&exit);
    outcome::json_of(&Document::new(ok, report)).to_string()
}

/// Returns the JSON schema of requests, as text.
pub fn schema() -> String {
    let schema = request::schema(None, &command(Extent::Whole));
    schema.map_or_else(|_| String::new(), |schema| schema.to_string())
}

/// Reads the arguments of a verb without its inputs.
fn parsed(verb: &str, arguments: &Map<String, Value>) -> Result<(Verb, Context), Failure> {
    parsed_for(verb, arguments, None)
}

/// Reads the arguments of a verb without its inputs, for a listener.
fn parsed_for(
    verb: &str,
    arguments: &Map<String, Value>,
    listener: Option<Listener>,
) -> Result<(Verb, Context), Failure> {
    let words = request::words(verb, arguments, &command(Extent::Whole)).map_err(Failure::plain)?;
    let program = std::iter::once(OsString::from("isoform"));
    let (cli, _) = parse(program.chain(words)).map_err(refused)?;
    Ok((cli.verb, Context::new(cli.global, listener)))
}

/// Returns the options of a fit with these arguments of `fit`, of which `scan` and `template` may
/// be any.
///
/// # Errors
/// [`Failure`] if the arguments do not say what to do.
pub fn fit_options(arguments: &Map<String, Value>) -> Result<FitOptions, Failure> {
    match parsed("fit", arguments)? {
        (Verb::Fit(args), context) => args.fit_options(&context).map_err(Failure::plain),
        _ => Err(Failure::internal("arguments")),
    }
}

/// Returns the options of a mesh with these arguments of `mesh`, of which `model` may be any.
///
/// # Errors
/// [`Failure`] if the arguments do not say what to do.
pub fn mesh_options(arguments: &Map<String, Value>) -> Result<MeshModelOptions, Failure> {
    match parsed("mesh", arguments)? {
        (Verb::Mesh(args), context) => args.mesh_options(&context).map_err(Failure::plain),
        _ => Err(Failure::internal("arguments")),
    }
}

/// Converts an error of a fit to a failure that names the scan and the template.
pub fn fit_failure(error: &FitScanError, scan: &str, template: &str) -> Failure {
    fit::work::failure(error, scan, Path::new(template), None)
}

/// Converts an error of meshing to a failure that names the model.
pub fn mesh_failure(error: &MeshModelError, name: &str) -> Failure {
    mesh::work::no_mesh(error, name, &mesh::settings::Settings::default())
}

/// Returns the failure of arguments that clap refuses: the first paragraph of what it says.
fn refused(error: clap::Error) -> Failure {
    let text = error.render().to_string();
    let lines = text.lines().map(str::trim).take_while(|l| !l.is_empty());
    let message = lines.collect::<Vec<_>>().join(" ");
    let message = memory::plain(message.trim_start_matches("error: "));
    Failure::usage(message).hint("isoform --help")
}

/// Sizes of two blocks that tell the allocator how much freed memory to keep. The first is the
/// largest that glibc learns from: smaller ones come from the heap from then on, and up to twice as
/// much that is free at its end stays. The second makes the heap grow once, not by 128 KiB each
/// time.
const KEPT: [usize; 2] = [(32 << 20) - 4096, 16 << 20];

/// Has the allocator keep freed memory for the next stage: a fit of ten thousand points spends a
/// twentieth of its time on pages that come and go. The blocks are never touched and cost none.
fn keep_freed_memory() {
    for size in KEPT {
        drop(std::hint::black_box(Vec::<u8>::with_capacity(size)));
    }
}

/// Runs a verb and prints its outcome or failure.
fn finish(
    context: &mut Context,
    verb: impl FnOnce(&mut Context) -> Result<Outcome, Failure>,
) -> ExitCode {
    let result = watchdog::stage("", || verb(context));
    let _over = Writing::new();
    match result {
        Ok(outcome) => {
            let bytes = if context.global.json && outcome.json.is_null() {
                Vec::new()
            } else if context.global.json {
                document_of(![NO_RESULT, INTERNAL].contains(&outcome.exit), outcome.json)
            } else {
                outcome.stdout
            };
            match to_stdout(&bytes) {
                Ok(()) => ExitCode::from(outcome.exit),
                Err(error) => fail(false, &Failure::file(Path::new("stdout"), "write", &error)),
            }
        }
        Err(failure) => fail(context.global.json, &failure),
    }
}

/// Prints why clap refuses arguments, or the help, and returns the exit code.
fn usage(error: clap::Error) -> ExitCode {
    let _ = error.print();
    if !error.use_stderr() {
        return ExitCode::from(DONE);
    }
    if std::env::args_os().any(|a| a == "--json") {
        let failure = refused(error);
        let _ = to_stdout(&document_of(false, json!({"error": failure.json()})));
    }
    ExitCode::from(USAGE)
}

/// Is the program: reads the arguments of the process, does the work on the terminal, and returns
/// the exit code.
pub fn program() -> ExitCode {
    let (cli, inputs) = match parse(std::env::args_os()) {
        Ok(parsed) => parsed,
        Err(error) => return usage(error),
    };
    let mut context = Context::new(cli.global, None);
    context.begin();
    let has_short_loops = cli.verb.has_short_loops();
    if has_short_loops {
        keep_freed_memory();
        context.whole = Some(progress::Whole::new());
    }
    let work = || {
        finish(&mut context, |context| {
            context.inputs = inputs?;
            run(cli.verb, context)
        })
    };
    // A fit has many short parallel loops: a thread of the pool does all of its work, as each loop
    // of another thread would wait for the pool to wake up, some 30 µs. Verbs with long loops leave
    // the pool to them: a thread that took part could not ask whether the time is over.
    if has_short_loops {
        rayon::scope(|_| work())
    } else {
        work()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform::io::formats;

    /// Texts that list formats of points name all of them.
    #[test]
    fn texts_name_every_format_of_points() {
        let command = command(Extent::Whole);
        let help = |verb: &str, argument: &str| {
            let verb = command.find_subcommand(verb).expect("a verb");
            let found = verb.get_arguments().find(|a| a.get_id() == argument);
            let help = found.and_then(|a| a.get_help()).expect("its help");
            help.to_string()
        };
        let (_, table) = include_str!("../../../README.md")
            .split_once("## Formats")
            .expect("the section");
        let texts = [
            ("fit --help", help("fit", "scan")),
            ("inspect --help", help("inspect", "file")),
            ("README.md", table.to_owned()),
        ];
        for (place, text) in texts {
            for format in formats() {
                let name = format.name.to_uppercase();
                assert!(text.contains(&name), "{name} is missing in {place}: {text}");
            }
        }
    }
}
