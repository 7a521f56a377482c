//! Rational patches as JSON: the file that `isoform parameterize` writes, and NURBS surfaces.
//!
//! A file is {"patches": \[{"degree": \[m, n\], "control": rows}, …\]}, where row i contains the
//! homogeneous control points \[x·w, y·w, z·w, w\] of j = 0 … n; "control" may be replaced by rows
//! of "points" \[x, y, z\] and of "weights". A file may also contain {"nurbs": \[{"degree": \[p,
//! q\], "knots_u": …, "knots_v": …, "points": …, "weights": …}, …\]}, or be one such surface alone.
//! Other keys are ignored.
//!
//! Numbers are the exact values of their doubles. Values computed from them here, products with
//! weights and Bézier points between knots, are exact too: common sides of neighbours agree digit
//! by digit.

mod nurbs;

use isoform_algebra::RBig;
use isoform_geom::{PatchError, Point3, RationalPatch};
use serde_json::{Value, json};

/// Maximum sum of the two degrees of a patch: the largest degree of a map for which exact analysis
/// is feasible. With a larger bound, files could be read but not processed.
const MAX_DEGREE_SUM: u64 = 64;

/// Reason why a JSON document is not a valid file of patches.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: {problem}")]
pub struct PatchFileError {
    /// Patch or surface, and its key.
    pub at: String,
    /// Description of the problem.
    pub problem: String,
}

/// Result of reading a file of patches.
type Result<T> = std::result::Result<T, PatchFileError>;

/// Returns an error at a position of the document.
fn wrong<T>(at: impl Into<String>, problem: impl Into<String>) -> Result<T> {
    Err(PatchFileError {
        at: at.into(),
        problem: problem.into(),
    })
}

/// Homogeneous control points x·w, y·w, z·w, w.
#[derive(Clone, Debug, PartialEq)]
pub enum ControlPoints {
    /// Doubles of the file.
    Doubles(Vec<[f64; 4]>),
    /// Exact results: products with weights, or Bézier points of a NURBS surface.
    Exact(Vec<[RBig; 4]>),
}

impl ControlPoints {
    /// Returns the number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::Doubles(points) => points.len(),
            Self::Exact(points) => points.len(),
        }
    }
    /// Returns true without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Returns all points as exact numbers.
    ///
    /// # Panics
    /// If a double is not finite; those that [`read_patches`] gives are.
    pub fn exact(&self) -> Vec<[RBig; 4]> {
        match self {
            Self::Doubles(points) => points.iter().map(|p| p.map(exact)).collect(),
            Self::Exact(points) => points.clone(),
        }
    }
    /// Returns all points, rounded to doubles.
    pub fn doubles(&self) -> Vec<[f64; 4]> {
        match self {
            Self::Doubles(points) => points.clone(),
            Self::Exact(points) => points
                .iter()
                .map(|p| p.each_ref().map(|x| x.to_f64().value()))
                .collect(),
        }
    }
}

/// Converts a double exactly to a rational number.
fn exact(x: f64) -> RBig {
    RBig::try_from(x).expect("control points are finite")
}

/// Patch read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FilePatch {
    /// `patch 3`, or `nurbs 1, span 2 1`: counted from 1.
    pub name: String,
    /// Degrees m and n, each at least 1, with a sum of at most 64.
    pub degree: [usize; 2],
    /// (m + 1)(n + 1) control points, row by row of i = 0 … m.
    pub control: ControlPoints,
}

impl FilePatch {
    /// Returns the patch in doubles: those of the file, or the exact results rounded.
    ///
    /// # Errors
    /// [`PatchError`] if a number is too large for a double.
    pub fn patch(&self) -> std::result::Result<RationalPatch, PatchError> {
        let [m, n] = self.degree;
        RationalPatch::new((m, n), self.control.doubles())
    }
}

/// Patch to be written to a file, with its distance to the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchRecord {
    /// The patch.
    pub patch: RationalPatch,
    /// Largest distance to the surface: a proved bound if `certified`, else the largest sampled
    /// one.
    pub max_distance: f64,
    /// True if the distance is proved and the patch has no folds.
    pub certified: bool,
    /// Root mean square distance.
    pub rms_distance: f64,
    /// Point of the surface from which the patch was grown.
    pub seed_point: Point3,
}

/// Writes a file of patches. Equal patches give equal bytes.
///
/// ```
/// use isoform_geom::RationalPatch;
/// use isoform_io::{PatchRecord, read_patches, write_patches};
/// let patch = RationalPatch::planar((1, 2), [0.0; 3], [0.1, 0.0, 0.0], [0.0, 1.0, 0.0]);
/// let record = PatchRecord {
///     patch: patch.clone(),
///     max_distance: 0.0,
///     certified: true,
///     rms_distance: 0.0,
///     seed_point: [0.05, 0.5, 0.0],
/// };
/// let bytes = write_patches(&[record]);
/// let again = read_patches(&serde_json::from_slice(&bytes)?)?;
/// assert_eq!((again.len(), again[0].patch()?), (1, patch));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_patches(records: &[PatchRecord]) -> Vec<u8> {
    let list: Vec<Value> = records.iter().map(record).collect();
    let mut bytes = json!({"schema": 1, "patches": list})
        .to_string()
        .into_bytes();
    bytes.push(b'\n');
    bytes
}

/// Returns the JSON entry of a patch.
fn record(r: &PatchRecord) -> Value {
    let (m, n) = r.patch.degree();
    let rows: Vec<Value> = r
        .patch
        .control()
        .chunks(n + 1)
        .map(|row| json!(row))
        .collect();
    json!({
        "degree": [m, n],
        "control": rows,
        "max_distance": r.max_distance,
        "certified": r.certified,
        "rms_distance": r.rms_distance,
        "seed_point": r.seed_point,
    })
}

/// Returns true if a JSON document contains patches or NURBS surfaces, not a map.
pub fn is_patch_file(json: &Value) -> bool {
    ["patches", "nurbs", "knots_u"]
        .iter()
        .any(|key| json.get(key).is_some())
}

/// Reads the patches of a document, at least one; patches of NURBS surfaces follow the others.
///
/// # Errors
/// [`PatchFileError`].
pub fn read_patches(json: &Value) -> Result<Vec<FilePatch>> {
    let mut patches = Vec::new();
    for (k, value) in listed(json, "patches")?.iter().enumerate() {
        patches.push(bezier(value, &format!("patch {}", k + 1))?);
    }
    let alone = json.get("knots_u").map(|_| json);
    let mut room = nurbs::MAX_CONTROL_POINTS;
    for (k, value) in listed(json, "nurbs")?.iter().chain(alone).enumerate() {
        let pieces = nurbs::pieces(value, &format!("nurbs {}", k + 1), room)?;
        room -= pieces.iter().map(|p| p.control.len()).sum::<usize>();
        patches.extend(pieces);
    }
    if patches.is_empty() {
        return wrong("the file", "no patch is in it");
    }
    Ok(patches)
}

/// Returns the list of a key; empty if the key is missing.
fn listed<'j>(json: &'j Value, key: &str) -> Result<&'j [Value]> {
    match json.get(key) {
        None => Ok(&[]),
        Some(Value::Array(list)) => Ok(list),
        Some(_) => wrong(key, "a list is expected"),
    }
}

/// Parses a Bézier patch.
fn bezier(value: &Value, at: &str) -> Result<FilePatch> {
    let degree @ [m, n] = degree(value, at)?;
    let net = ControlNet::parse(value, at)?;
    if [net.rows, net.columns] != [m + 1, n + 1] {
        let problem = format!(
            "{} × {} points are expected, {} × {} are there",
            m + 1,
            n + 1,
            net.rows,
            net.columns
        );
        return wrong(format!("{at}, control"), problem);
    }
    Ok(FilePatch {
        name: at.to_owned(),
        degree,
        control: net.control,
    })
}

/// Parses the degrees in u and v, both at least 1.
fn degree(value: &Value, at: &str) -> Result<[usize; 2]> {
    let list = value.get("degree").and_then(Value::as_array);
    let at = format!("{at}, degree");
    let Some([m, n]) = list.map(Vec::as_slice) else {
        return wrong(at, "two whole numbers are expected");
    };
    match [m, n].map(Value::as_u64) {
        [Some(m), Some(n)] if m > 0 && n > 0 && m.saturating_add(n) <= MAX_DEGREE_SUM => {
            Ok([m as usize, n as usize])
        }
        [Some(_), Some(_)] => wrong(
            at,
            format!("both are at least 1, and at most {MAX_DEGREE_SUM} together"),
        ),
        _ => wrong(at, "two whole numbers are expected"),
    }
}

/// Returns the key of an object that differs from an optional one by two letters at most.
fn misspelt<'v>(value: &'v Value, wanted: &str) -> Option<&'v str> {
    let mut keys = value.as_object()?.keys();
    let is_near = |key: &&String| strsim::osa_distance(&key.to_lowercase(), wanted) <= 2;
    keys.find(is_near).map(String::as_str)
}

/// Grid of control points, at least one.
struct ControlNet {
    rows: usize,
    columns: usize,
    control: ControlPoints,
}

impl ControlNet {
    /// Parses `control`, or `points` and `weights`.
    fn parse(value: &Value, at: &str) -> Result<Self> {
        if value.get("control").is_some() {
            Self::homogeneous(value, at)
        } else {
            Self::weighted(value, at)
        }
    }

    /// Parses control points that are already multiplied by their weights, as this crate writes
    /// them.
    fn homogeneous(value: &Value, at: &str) -> Result<Self> {
        let rows = rows(value, "control", at)?;
        let mut control = Vec::with_capacity(rows.len() * rows[0].len());
        for (i, p) in rows.iter().flat_map(|r| r.iter()).enumerate() {
            control.push(point(p, || format!("{at}, control point {}", i + 1))?);
        }
        Ok(Self {
            rows: rows.len(),
            columns: rows[0].len(),
            control: ControlPoints::Doubles(control),
        })
    }

    /// Multiplies points by their weights, which default to 1.
    fn weighted(value: &Value, at: &str) -> Result<Self> {
        let points = rows(value, "points", at)?;
        let weights = match value.get("weights") {
            None => match misspelt(value, "weights") {
                Some(key) => return wrong(format!("{at}, {key}"), "did you mean weights?"),
                None => None,
            },
            Some(_) => Some(rows(value, "weights", at)?),
        };
        let shape = |rows: &[&[Value]]| [rows.len(), rows[0].len()];
        if weights.as_ref().is_some_and(|w| shape(w) != shape(&points)) {
            let problem = "as many are expected as there are points";
            return wrong(format!("{at}, weights"), problem);
        }
        let mut control = Vec::with_capacity(points.len() * points[0].len());
        for (i, row) in points.iter().enumerate() {
            for (j, p) in row.iter().enumerate() {
                let place = format!("{} {}", i + 1, j + 1);
                let p: Point3 = point(p, || format!("{at}, point {place}"))?;
                let w = match &weights {
                    None => 1.0,
                    Some(w) => weight(&w[i][j], || format!("{at}, weight {place}"))?,
                };
                let (p, w) = (p.map(exact), exact(w));
                control.push([&p[0] * &w, &p[1] * &w, &p[2] * &w, w]);
            }
        }
        Ok(Self {
            rows: points.len(),
            columns: points[0].len(),
            control: ControlPoints::Exact(control),
        })
    }
}

/// Parses rows of equal length, at least one row with one entry.
fn rows<'a>(value: &'a Value, key: &str, at: &str) -> Result<Vec<&'a [Value]>> {
    let rows: Option<Vec<&[Value]>> = value.get(key).and_then(Value::as_array).and_then(|rows| {
        rows.iter()
            .map(|r| r.as_array().map(Vec::as_slice))
            .collect()
    });
    let rows = rows.unwrap_or_default();
    let columns = rows.first().map_or(0, |r| r.len());
    if columns == 0 || rows.iter().any(|r| r.len() != columns) {
        return wrong(format!("{at}, {key}"), "rows of one length are expected");
    }
    Ok(rows)
}

/// Parses a finite number.
fn weight(value: &Value, at: impl Fn() -> String) -> Result<f64> {
    number(value).map_or_else(|| wrong(at(), "a number is expected"), Ok)
}

/// Parses N finite numbers.
fn point<const N: usize>(value: &Value, at: impl Fn() -> String) -> Result<[f64; N]> {
    let list = numbers(Some(value)).map_or_else(|problem| wrong(at(), problem), Ok)?;
    let count = list.len();
    list.try_into()
        .or_else(|_| wrong(at(), format!("{N} numbers are expected, {count} are there")))
}

/// Parses a list of finite numbers.
fn numbers(value: Option<&Value>) -> std::result::Result<Vec<f64>, &'static str> {
    value
        .and_then(Value::as_array)
        .and_then(|list| list.iter().map(number).collect())
        .ok_or("a list of numbers is expected")
}

/// Returns the finite number of a value; `None` for any other value.
fn number(value: &Value) -> Option<f64> {
    value.as_f64().filter(|x| x.is_finite())
}

#[cfg(test)]
mod tests;
