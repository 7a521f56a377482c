//! Unit and warnings of a fitted scan.

use crate::ScanFit;
use isoform_fit::{ClutterKind, Warning};
use isoform_io::{ReadReport, UnitGuess, inspect_unit};

impl ScanFit {
    /// Returns the unit of a scan with the reader's report `read`: that of its file, else that of
    /// the program, called `template`, else a guess. Bounds and starts of a program are numbers in
    /// its unit and would not suit a scan in another one.
    pub fn unit(&self, read: &ReadReport, template: &str) -> UnitGuess {
        let seen = inspect_unit(&self.cloud, &self.bounds, read);
        match &self.template.frep.model().info().unit {
            Some(unit) if !seen.is_stated => UnitGuess {
                unit: unit.clone(),
                is_stated: true,
                reason: format!("the template {template} says so"),
            },
            _ => seen,
        }
    }

    /// Returns all warnings: of the reader, the template, the unit and the fit. Options are named
    /// as on the command line.
    pub fn all_warnings(&self, read: &ReadReport, unit: &UnitGuess) -> Vec<String> {
        let mut warnings = read.warnings.clone();
        warnings.extend(self.warnings.iter().map(ToString::to_string));
        if let Some(said) = &self.template.frep.model().info().unit
            && !unit.unit.is_empty()
            && *said != unit.unit
        {
            warnings.push(format!(
                "the template is written in {said}, the scan in {} ({}); values are in the scan's \
                 unit",
                unit.unit, unit.reason
            ));
        }
        warnings.extend(self.fit.warnings.iter().map(sentence));
        warnings
    }
}

/// Returns a warning of the fit, with the option that keeps the points that were left out.
fn sentence(warning: &Warning) -> String {
    let option = match warning {
        Warning::Beside { why, .. } => match why {
            ClutterKind::Plane => "--keep-planes",
            ClutterKind::Apart => "--keep-apart",
            ClutterKind::Stray => "--no-outlier-filter",
        },
        other => return other.to_string(),
    };
    format!("{warning}; {option} fits them, too")
}
