//! What the verbs find, as types that serialize: `--json` prints them, a library user reads them.
//!
//! Everything but the seconds is the same each time. What does not apply, or was not reached, is
//! none, and null in JSON; so are numbers that are not finite.

mod fit;
mod mesh;

pub use fit::{
    Coverage, FitReport, OpenReport, OtherMinimumReport, ParameterReport, PartReport, PoseReport,
    ScanReport, TemplateReport, TwoSided, loss_name, method_name,
};
pub use mesh::{
    CertificateReport, ContentsReport, Counts, CurveGroup, DeviationReport, DistancesReport,
    FailureReport, FeaturesReport, LengthsReport, MeshReport, ModelName, PartGroup, RatioReport,
    RegionGroup, WarningReport, WrittenFile,
};

use serde::ser::{Serialize, SerializeMap, Serializer};

/// Seconds by phase, in the order in which the phases ran; an object in JSON.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seconds(pub Vec<(String, f64)>);

impl Seconds {
    /// From names that are known in advance.
    pub fn of(phases: &[(&str, f64)]) -> Self {
        let named = phases.iter().map(|&(name, s)| (name.to_owned(), s));
        Self(named.collect())
    }
}

impl Serialize for Seconds {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (phase, seconds) in &self.0 {
            map.serialize_entry(phase, seconds)?;
        }
        map.end()
    }
}

/// A number, or none where it is not finite.
fn finite(v: f64) -> Option<f64> {
    v.is_finite().then_some(v)
}
