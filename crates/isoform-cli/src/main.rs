//! The command `isoform`: arguments in, one library call, a document or files out.
#![forbid(unsafe_code)]

mod brep;
mod compare;
mod completions;
mod convert;
mod eval;
mod fit;
mod gallery;
mod implicitize;
mod inputs;
mod inspect;
mod interrupt;
mod kind;
mod layers;
mod mesh;
mod model;
mod output;
mod parameterize;
mod parameters;
mod progress;
mod recognize;
mod recover;
mod recover_folder;
mod render;
mod report;
mod scan;
mod serve;
mod solids;
mod spline;
mod triangulate;
mod view;
mod watchdog;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use inputs::Inputs;
use output::{Context, Failure, Global, Outcome};
use std::process::ExitCode;

/// Isoform: one shape, many forms.
///
/// Carries shapes between point clouds, implicit functions, patches and meshes, each way checked.
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
    /// Prints the completion script of a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
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
        Verb::Eval(args) => eval::run(&args, context),
        Verb::Completions { shell } => {
            let script = completions::script(shell, &mut Cli::command());
            Ok(Outcome::text(script))
        }
    }
}

/// The arguments, and the files among them that are read.
fn parse() -> Result<(Cli, Result<Inputs, Failure>), clap::Error> {
    let matches = Cli::command().try_get_matches()?;
    let cli = Cli::from_arg_matches(&matches)?;
    let inputs = match matches.subcommand() {
        Some((_, verb)) => Inputs::of(verb, cli.global.force),
        None => Ok(Inputs::default()),
    };
    Ok((cli, inputs))
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

/// Reads the arguments, does the work and reports what comes of it by the exit code.
fn main() -> ExitCode {
    let (cli, inputs) = match parse() {
        Ok(parsed) => parsed,
        Err(error) => return output::usage(&error),
    };
    let mut context = Context::new(cli.global);
    let is_fit = matches!(cli.verb, Verb::Fit(_) | Verb::Recover(_));
    if is_fit {
        keep_freed_memory();
        context.whole = Some(progress::Whole::new());
    }
    let work = || {
        output::finish(&mut context, |context| {
            context.inputs = inputs?;
            run(cli.verb, context)
        })
    };
    // A fit has many short parallel loops: a thread of the pool does all of its work, as each loop
    // of another thread would wait for the pool to wake up, some 30 µs. Verbs with long loops leave
    // the pool to them: a thread that took part could not ask whether the time is over.
    if is_fit {
        rayon::scope(|_| work())
    } else {
        work()
    }
}
