//! The report on a file of points.

use isoform_geom::Point3;
use isoform_io::Inspection;
use serde::Serialize;

/// What is in a file of points.
#[derive(Clone, Debug, Serialize)]
pub struct InspectReport {
    /// `inspect`.
    pub verb: &'static str,
    /// The file.
    pub file: String,
    /// Its format.
    pub format: &'static str,
    /// Points read.
    pub points: usize,
    /// Points in the file.
    pub rows: u64,
    /// Points that are not finite.
    pub dropped: u64,
    /// Points that are there twice.
    pub duplicates: usize,
    /// Whether only a sample of the points was taken.
    pub subsampled: bool,
    /// Lower and upper corner of their box.
    pub bounds: Option<[Point3; 2]>,
    /// What was subtracted from all points.
    pub origin: Point3,
    /// Diagonal of their box.
    pub diagonal: f64,
    /// Typical distance of neighbours.
    pub spacing: Option<f64>,
    /// Whether there are normals.
    pub normals: bool,
    /// Whether there are colours.
    pub colors: bool,
    /// Triangles.
    pub triangles: usize,
    /// Further columns.
    pub columns: Vec<ColumnReport>,
    /// The unit of lengths.
    pub unit: UnitReport,
    /// Everything odd that was met.
    pub warnings: Vec<String>,
}

/// A further column of a file of points.
#[derive(Clone, Debug, Serialize)]
pub struct ColumnReport {
    /// Its name.
    pub name: String,
    /// Its smallest value.
    pub min: f64,
    /// Its largest value.
    pub max: f64,
    /// Values that are not there.
    pub missing: usize,
}

/// The unit of lengths.
#[derive(Clone, Debug, Serialize)]
pub struct UnitReport {
    /// Its name, if known.
    pub name: Option<String>,
    /// Whether the file states it.
    pub stated: bool,
    /// How it is known.
    pub reason: String,
}

impl InspectReport {
    /// What was seen in a file.
    pub fn new(file: &str, seen: &Inspection) -> Self {
        let absolute = |p: Point3| std::array::from_fn(|k| p[k] + seen.origin[k]);
        let bounds = [seen.bounds.lo, seen.bounds.hi].map(absolute);
        let columns = seen.columns.iter().map(|c| ColumnReport {
            name: c.name.clone(),
            min: c.min,
            max: c.max,
            missing: c.missing,
        });
        Self {
            verb: "inspect",
            file: file.to_owned(),
            format: seen.format,
            points: seen.points,
            rows: seen.rows,
            dropped: seen.dropped_points,
            duplicates: seen.duplicates,
            subsampled: seen.subsampled,
            bounds: (!seen.bounds.is_empty()).then_some(bounds),
            origin: seen.origin,
            diagonal: seen.diagonal,
            spacing: seen.spacing,
            normals: seen.has_normals,
            colors: seen.has_colors,
            triangles: seen.triangles,
            columns: columns.collect(),
            unit: UnitReport {
                name: Some(seen.unit.unit.clone()).filter(|unit| !unit.is_empty()),
                stated: seen.unit.is_stated,
                reason: seen.unit.reason.clone(),
            },
            warnings: seen.warnings.clone(),
        }
    }
}
