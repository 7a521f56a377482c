//! `isoform studio`: a page that does the work of the verbs, for browsers of this machine.
//!
//! The page asks for work as a request of a verb ([`work`]), for pictures as a scene ([`scene`]),
//! and keeps its files and its state in a folder ([`project`]). [`desk`] answers its requests. The
//! folder is the process's working directory, so that a request is also a command line there.

mod desk;
mod project;
mod scene;
mod work;

use crate::context::Context;
use crate::failure::{DONE, Failure};
use crate::interrupt;
use crate::outcome::Outcome;
use crate::serve::{self, server};
use desk::Desk;
use project::Project;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Interval at which Ctrl-C is checked.
const LOOK: Duration = Duration::from_millis(120);

/// Opens a page in the browser: scan to model, programs, formulas, comparison
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform studio
  isoform studio scan.ply
  isoform studio part.hf --project part
  isoform studio --no-open --port 8080

The page is given to browsers of this machine alone, at an address that nobody guesses. It needs no
network. Files and all steps of the work are kept in the folder of the project: reopening it, also
after a crash, shows the same state. Ctrl-C ends it. What it can do: docs/studio.md.

Exit code: 0; 2 for files that cannot be read or a folder that cannot be written to, 4 where the port
is taken or the project is open already.")]
pub(crate) struct Args {
    /// Files to begin with: scans, programs, meshes or solids
    #[arg(value_name = "FILE")]
    file: Vec<PathBuf>,
    /// The folder of the project [default: isoform-studio/NAME, by the name of the first file]
    #[arg(long, value_name = "FOLDER")]
    project: Option<PathBuf>,
    /// The port of the address [default: one that is free]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Print the address, and open no browser
    #[arg(long)]
    no_open: bool,
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    if context.listener.is_some() {
        return Err(Failure::usage("studio is a program of its own"));
    }
    interrupt::watch();
    let project = Project::open(&args.file, args.project.as_deref(), context)?;
    let folder = project.folder().display().to_string();
    let desk = Desk::new(project, context.global.threads);
    let address = server::open(args.port, desk).map_err(|e| serve::no_port(&e))?;
    context.announce(
        json!({"verb": "studio", "address": address, "project": folder}),
        format!("{address}\n"),
    )?;
    if !args.no_open && !open(&address) {
        context.say("open this address in a browser");
    }
    while !interrupt::happened() {
        std::thread::sleep(LOOK);
    }
    Ok(Outcome {
        exit: DONE,
        json: Value::Null,
        stdout: Vec::new(),
    })
}

/// Opens an address in the browser; returns false if the system has no program for it.
fn open(address: &str) -> bool {
    let words: &[&str] = if cfg!(target_os = "macos") {
        &["open"]
    } else if cfg!(windows) {
        &["rundll32", "url.dll,FileProtocolHandler"]
    } else {
        &["xdg-open"]
    };
    let quiet = Command::new(words[0])
        .args(&words[1..])
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    quiet.is_ok()
}
