//! The command `isoform`: arguments in, one library call, a document or files out.
#![forbid(unsafe_code)]

mod compare;
mod convert;
mod eval;
mod fit;
mod gallery;
mod inspect;
mod interrupt;
mod mesh;
mod model;
mod output;
mod parameterize;
mod progress;
mod recover;
mod report;
mod scan;
mod triangulate;

use clap::{CommandFactory, Parser, Subcommand};
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
    Parameterize(Box<parameterize::Args>),
    Triangulate(Box<triangulate::Args>),
    Eval(eval::Args),
    Inspect(inspect::Args),
    Convert(convert::Args),
    Compare(Box<compare::Args>),
    /// Prints the completion script of a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

fn run(verb: Verb, context: &Context) -> Result<Outcome, Failure> {
    match verb {
        Verb::Recover(args) => recover::run(&args, context),
        Verb::Fit(args) => fit::run(&args, context),
        Verb::Mesh(args) => mesh::run(&args, context),
        Verb::Parameterize(args) => parameterize::run(&args, context),
        Verb::Triangulate(args) => triangulate::run(&args, context),
        Verb::Inspect(args) => inspect::run(&args, context),
        Verb::Convert(args) => convert::run(&args, context),
        Verb::Compare(args) => compare::run(&args, context),
        Verb::Eval(args) => eval::run(&args, context),
        Verb::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "isoform", &mut script);
            Ok(Outcome::text(script))
        }
    }
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return output::usage(&error),
    };
    let context = Context::new(cli.global);
    output::finish(&context, || run(cli.verb, &context))
}
