//! Reports of the verbs, as types that serialize: the content of `--json`, and of the results of a
//! library user.
//!
//! All values but the computing times are reproducible. Values that do not apply, or were not
//! reached, are `None`, which is null in JSON; numbers that are not finite are null, too. The
//! program adds some keys to these reports: `schema` (the version of the format), `ok` and, for
//! verbs that write files, `outputs` (their paths).

mod brep;
mod compare;
mod fit;
mod implicitize;
mod inspect;
mod mesh;
mod nominal;
mod patches;
mod quality;
mod recognize;
mod shape;
mod solid;
mod surface;

pub use brep::{BrepCertificateReport, BrepReport, FaceReport};
pub use compare::{CompareReport, ComparedFaceReport, SideReport};
pub use fit::{
    About, DataToModelReport, EvidenceReport, FitReport, ModelCoverage, OtherMinimumReport,
    ParameterReport, PartReport, PoseReport, ScanReport, TemplateReport, TwoSidedReport,
    UndeterminedReport,
};
pub use implicitize::{ImplicitizeReport, NormalsReport};
pub use inspect::{ColumnReport, InspectReport, UnitReport};
pub use mesh::{
    CertificateReport, ContentsReport, Counts, CurveGroup, DeviationReport, DistancesReport,
    FailureReport, FeaturesReport, LayersReport, LengthsReport, MeshReport, ModelName,
    OppositeReport, PartGroup, RatioReport, RegionGroup, RegionReport, WarningReport, WrittenFile,
};
pub use patches::{
    AboutPatches, BoxReport, CoverageReport, Entity, LeftOutReport, MarginReport, PatchReport,
    PatchesReport, WeightsReport, solver_name,
};
pub use quality::{AspectReport, FacetsReport, QualityReport, WallsReport, WorstElement};
pub use recognize::{
    BlendReport, EntityReport, FeatureReport, LayoutReport, MotionReport, Parameters,
    PatternReport, RecognizeReport, RecognizedFaceReport, RelationReport, SnapReport,
    SymmetryReport, WideningReport,
};
pub use shape::ShapeReport;
pub use solid::{SolidFaceReport, SolidReport, StatedReport};
pub use surface::{
    AboutSurface, BasePointReport, ClaimReport, ContractedReport, CutReport, DoubleArcReport,
    MapReport, PoleReport, RealBorderReport, Sidecar, SurfaceCounts, SurfaceReport, TopologyReport,
    TriangulateReport, WindingReport, contracted, folds, map_degree, mode_name,
};

pub(crate) use nominal::nominal;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// Document of `--json`: a report after the version of the format and a flag of success. In JSON, a
/// report's own key `ok` replaces that flag.
///
/// ```
/// use isoform::report::Document;
/// let report = std::collections::BTreeMap::from([("verb", "fit")]);
/// let json = serde_json::to_value(Document::new(true, report))?;
/// assert_eq!(json.to_string(), r#"{"schema":1,"ok":true,"verb":"fit"}"#);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, serde::Serialize)]
pub struct Document<T> {
    /// Version of the format: 1.
    pub schema: u32,
    /// True if there is a result.
    pub ok: bool,
    /// The report.
    #[serde(flatten)]
    pub report: T,
}

impl<T> Document<T> {
    /// Creates a document of the current format.
    pub fn new(ok: bool, report: T) -> Self {
        Self {
            schema: 1,
            ok,
            report,
        }
    }
}

/// Computing time by phase, in seconds, in the order in which the phases ran; an object in JSON.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seconds(pub Vec<(String, f64)>);

impl Seconds {
    /// Creates the list from names and seconds.
    pub fn from_phases(phases: &[(&str, f64)]) -> Self {
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

/// Formats a number with four significant digits.
///
/// ```
/// use isoform::report::brief;
/// assert_eq!([0.1 + 0.2, 12345.678, 1.5e-9].map(brief), ["0.3000", "12346", "1.500e-9"]);
/// ```
pub fn brief(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    let digits = 3 - v.abs().log10().floor() as i32;
    if (-3..=7).contains(&digits) {
        format!("{v:.*}", digits.max(0) as usize)
    } else {
        format!("{v:.3e}")
    }
}

/// Returns a number; `None` if it is not finite.
fn finite(v: f64) -> Option<f64> {
    v.is_finite().then_some(v)
}
