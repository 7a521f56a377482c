//! The files that a run reads, which nothing may be written over without --force.
//!
//! Inputs and outputs are found among the arguments by their type, for all verbs at once: an
//! argument that is a path is an input, unless it is one of [`WRITTEN`]. So a new verb is covered;
//! only an argument with a new name must be added to that list, or to `READ` of the test.

use crate::failure::Failure;
use clap::ArgMatches;
use std::fs;
use std::path::{Path, PathBuf, absolute};

/// Arguments that name files to write.
const WRITTEN: [&str; 6] = ["output", "trace", "figure", "report", "sidecar", "domain"];

/// A file as the system knows it, whatever it was called by.
#[derive(Debug, PartialEq, Eq)]
struct Identity {
    /// Absolute path without links.
    path: PathBuf,
    /// Device and number of the file. Hard links to one file share both, though their paths differ.
    number: Option<(u64, u64)>,
}

impl Identity {
    /// Returns the identity of a file; `None` for missing files, and for devices and pipes, which
    /// nothing overwrites.
    fn read(path: &Path) -> Option<Self> {
        let about = fs::metadata(path).ok().filter(fs::Metadata::is_file)?;
        Some(Self {
            path: fs::canonicalize(path).or_else(|_| absolute(path)).ok()?,
            number: number(&about),
        })
    }
    fn is(&self, other: &Self) -> bool {
        self.path == other.path || (self.number.is_some() && self.number == other.number)
    }
}

/// Device and number of a file; other systems tell none.
#[cfg(unix)]
fn number(about: &fs::Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((about.dev(), about.ino()))
}

#[cfg(not(unix))]
fn number(_: &fs::Metadata) -> Option<(u64, u64)> {
    None
}

/// Input files of a run, and the permission to overwrite them.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    /// Files that are read, as they were named.
    files: Vec<(PathBuf, Identity)>,
    /// Files that the arguments name for writing.
    outputs: Vec<PathBuf>,
    /// True if outputs may take the place of inputs (--force).
    force: bool,
}

impl Inputs {
    /// The files that the arguments of a verb name. Fails where an output is one of them.
    /// `request` is a file that named them.
    pub(crate) fn new(
        verb: &ArgMatches,
        request: Option<&Path>,
        force: bool,
    ) -> Result<Self, Failure> {
        let (outputs, files): (Vec<_>, Vec<_>) =
            paths(verb).partition(|(argument, _)| WRITTEN.contains(argument));
        let request = request.map(|path| ("request", path.to_owned()));
        let files = files.into_iter().chain(request).filter_map(|(_, path)| {
            let identity = Identity::read(&path)?;
            Some((path, identity))
        });
        let inputs = Self {
            files: files.collect(),
            outputs: outputs.into_iter().map(|(_, path)| path).collect(),
            force,
        };
        inputs
            .outputs
            .iter()
            .try_for_each(|output| inputs.allow(output))?;
        Ok(inputs)
    }

    /// Checks that a file may be written. Outputs other than arguments must be checked before the
    /// work.
    pub(crate) fn allow(&self, output: &Path) -> Result<(), Failure> {
        let Some(written) = Identity::read(output).filter(|_| !self.force) else {
            return Ok(());
        };
        match self.files.iter().find(|(_, read)| read.is(&written)) {
            Some((input, _)) => Err(overwritten(input, output)),
            None => Ok(()),
        }
    }

    /// Checks that a file which an input names is not one of the files to write.
    pub(crate) fn check_named(&self, input: &Path) -> Result<(), Failure> {
        let Some(read) = Identity::read(input).filter(|_| !self.force) else {
            return Ok(());
        };
        let is_it = |output: &&PathBuf| Identity::read(output).is_some_and(|to| to.is(&read));
        match self.outputs.iter().find(is_it) {
            Some(output) => Err(overwritten(input, output)),
            None => Ok(()),
        }
    }
}

/// Returns the failure of a file to write that is an input.
fn overwritten(input: &Path, output: &Path) -> Failure {
    let message = format!("{} would be overwritten", output.display());
    let mut failure = Failure::new(crate::failure::USAGE, "overwrites-input", message);
    failure.place.file = Some(output.to_owned());
    let why = if input == output {
        "it is an input of this run".to_owned()
    } else {
        format!("it is {}, an input of this run", input.display())
    };
    failure
        .why(why)
        .hint("-o with another name, or --force to overwrite it")
}

/// The arguments of a verb that are paths, with their names.
pub(crate) fn paths(verb: &ArgMatches) -> impl Iterator<Item = (&str, PathBuf)> {
    verb.ids().flat_map(|id| {
        // Groups and arguments of other types have no paths.
        let given = verb.try_get_many::<PathBuf>(id.as_str()).ok().flatten();
        given
            .into_iter()
            .flatten()
            .map(|path| (id.as_str(), path.clone()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arguments that name files to read.
    const READ: [&str; 13] = [
        "scan", "template", "bounds", "model", "points", "sizes", "adapt", "map", "file", "first",
        "second", "project", "labels",
    ];

    #[test]
    fn every_path_of_every_verb_is_read_or_written() {
        let command = crate::command(crate::help::Extent::Whole);
        let mut seen = Vec::new();
        for verb in command.get_subcommands() {
            for argument in verb.get_arguments() {
                let id = argument.get_id().as_str();
                if argument.get_value_parser().type_id() != std::any::TypeId::of::<PathBuf>() {
                    continue;
                }
                seen.push(id);
                assert!(
                    READ.contains(&id) != WRITTEN.contains(&id),
                    "isoform {}: is the file of `{id}` read, or written (see WRITTEN)?",
                    verb.get_name()
                );
            }
        }
        // Had the types changed, nothing would have been looked at.
        for id in READ.iter().chain(&WRITTEN) {
            assert!(seen.contains(id), "no verb has `{id}` any more");
        }
    }
}
