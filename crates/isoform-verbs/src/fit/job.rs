//! A fit with its scan, its template and its settings.

use crate::outcome::exit;
use isoform::fit::Method;
use isoform::io::{ReadReport, UnitGuess};
use isoform::{CadDialect, ScanFit};
use std::path::Path;

/// A fit with all that went into it.
pub struct Job {
    /// Name of the scan.
    pub(crate) scan: String,
    /// Report of its reader.
    pub(crate) read: ReadReport,
    /// The fit, in the library's words.
    pub(crate) found: ScanFit,
    /// Name of the template.
    pub(crate) template_name: String,
    /// Unit of the scan, and how it is known.
    pub(crate) unit: UnitGuess,
    /// True if the model is written in the template's own coordinates.
    pub(crate) is_own_frame: bool,
    /// Language of .py files.
    pub(crate) dialect: CadDialect,
    /// Seed of the search.
    pub(crate) seed: u64,
    /// Method of the search.
    pub(crate) method: Method,
    /// Seconds by phase, reading first.
    pub(crate) seconds: Vec<(&'static str, f64)>,
    /// All warnings: of reading, of the template, of the fit.
    pub(crate) warnings: Vec<String>,
}

impl Job {
    /// Returns a fit of points that were not read from a file, with their report; the names of the
    /// points and of the template are for documents.
    pub fn new(
        found: ScanFit,
        (scan, template): (String, String),
        read: ReadReport,
        (method, seed): (Method, u64),
    ) -> Self {
        let unit = found.unit(&read, &template);
        Self {
            scan,
            warnings: found.all_warnings(&read, &unit),
            read,
            template_name: template,
            unit,
            is_own_frame: false,
            dialect: CadDialect::Build123d,
            seed,
            method,
            seconds: found.seconds.clone(),
            found,
        }
    }
    /// Returns the fit.
    pub fn found(&self) -> &ScanFit {
        &self.found
    }
    /// The unit of a parameter.
    pub(crate) fn unit_of(&self, i: usize) -> Option<String> {
        let length = Some(self.unit.unit.as_str()).filter(|unit| !unit.is_empty());
        self.found.unit_of(i, length)
    }
    /// The fitted program, in the coordinates that are asked for.
    pub(crate) fn program(&self) -> String {
        match self.is_own_frame {
            true => self.found.own_program(),
            false => self.found.program(),
        }
    }
    /// The name of the scan's file, without its ending.
    pub(crate) fn part_name(&self) -> String {
        let name = Path::new(&self.scan).file_stem().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }
    /// 0, or 3 where the fit is refused or not complete, or 130.
    pub(crate) fn exit(&self) -> u8 {
        exit(self.found.fit.acceptable && self.found.fit.complete)
    }
}
