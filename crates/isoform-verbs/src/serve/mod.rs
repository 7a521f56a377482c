//! `isoform view --serve`: the page of files that change, for browsers of this machine.
//!
//! One thread makes pages: it looks at the files' length and times, and makes a new page when they
//! have changed and come to rest. Another one ([`pages`]) gives browsers the newest page that
//! could be made, and tells them when there is another, or why there is none. Who is answered at
//! all is decided in [`door`].

#[cfg(not(target_family = "wasm"))]
mod door;
#[cfg_attr(target_family = "wasm", path = "unserved.rs")]
mod pages;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod server;
mod stamps;

use crate::context::Context;
use crate::failure::{self, DONE, Failure};
use crate::interrupt;
use crate::outcome::Outcome;
use crate::watchdog;
use isoform_view::Page;
use pages::Pages;
use serde_json::{Value, json};
use stamps::Stamps;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Interval at which files are checked. They are checked once more after a change, to see that they
/// are complete: editors and other programs write a file in several steps.
const LOOK: Duration = Duration::from_millis(120);
/// Files that do not come to rest for this many looks are read nevertheless.
const RESTLESS: usize = 20;

/// Serves what `make` makes of the files, until Ctrl-C.
pub(crate) fn run(
    files: &[PathBuf],
    port: u16,
    context: &Context,
    make: impl Fn() -> Result<(Page, Vec<Value>), Failure>,
) -> Result<Outcome, Failure> {
    if files.iter().any(|file| file == Path::new("-")) {
        let failure = Failure::usage("--serve cannot follow stdin");
        return Err(failure.hint("isoform view - -o PAGE.html"));
    }
    interrupt::watch();
    let make = || make_of(files, &make);
    let mut seen = Stamps::read(files);
    let (page, layers) = make()?;
    let site = Pages::open(port, &page).map_err(|e| no_port(&e))?;
    let text = format!("{}\n", site.address());
    context.announce(
        json!({"verb": "view", "address": site.address(), "layers": layers}),
        text,
    )?;
    while let Some(now) = next(files, &seen) {
        seen = now;
        match make() {
            Ok((page, _)) => site.show(&page),
            Err(_) if interrupt::happened() => break,
            Err(failure) => {
                context.complain(&failure);
                site.fail(&failure.text());
            }
        }
    }
    Ok(Outcome {
        exit: DONE,
        json: Value::Null,
        stdout: Vec::new(),
    })
}

/// Returns the failure of a server that cannot begin.
pub(crate) fn no_port(error: &io::Error) -> Failure {
    let failure = Failure::new(failure::NO_RESULT, "port", format!("cannot serve: {error}"));
    failure.hint("another --port, or none: a free one is taken")
}

/// A page of files; what goes wrong is said, and never the end of the server. Reading a pipe in
/// the place of a file might take for ever.
fn make_of(
    files: &[PathBuf],
    make: &impl Fn() -> Result<(Page, Vec<Value>), Failure>,
) -> Result<(Page, Vec<Value>), Failure> {
    for file in files {
        if file.metadata().is_ok_and(|about| !about.is_file()) {
            let message = format!("{}: not a file that can be followed", file.display());
            return Err(Failure::input("file", message));
        }
    }
    watchdog::stage("", make)
}

/// Waits until the files are others than those seen, and at rest; none after Ctrl-C.
fn next(files: &[PathBuf], seen: &Stamps) -> Option<Stamps> {
    let mut last = Stamps::read(files);
    let mut restless = 0;
    loop {
        std::thread::sleep(LOOK);
        if interrupt::happened() {
            return None;
        }
        let now = Stamps::read(files);
        let is_at_rest = now == last || restless >= RESTLESS;
        if now != *seen && is_at_rest {
            return Some(now);
        }
        restless = if is_at_rest { 0 } else { restless + 1 };
        last = now;
    }
}
