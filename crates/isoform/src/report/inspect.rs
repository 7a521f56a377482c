//! Report on a file of points.

use crate::SurfaceMeasures;
use isoform_geom::Point3;
use isoform_io::Inspection;
use serde::Serialize;

/// Report of `inspect` on a file of points; lengths in the unit of the file.
#[derive(Clone, Debug, Serialize)]
pub struct InspectReport {
    /// Name of the verb: `inspect`.
    pub verb: &'static str,
    /// Name of the file.
    pub file: String,
    /// Name of the file's format.
    pub format: &'static str,
    /// Number of points read.
    pub points: usize,
    /// Number of points in the file.
    pub rows: u64,
    /// Number of points dropped because a coordinate is not finite.
    pub dropped: u64,
    /// Number of points that are equal to an earlier one in all coordinates.
    pub duplicates: usize,
    /// True if only a random sample of the points was read.
    pub subsampled: bool,
    /// Lower and upper corner of the bounding box, in the file's coordinates; `None` without
    /// points.
    pub bounds: Option<[Point3; 2]>,
    /// Vector that the reader subtracted from all points.
    pub origin: Point3,
    /// Diagonal of the bounding box.
    pub diagonal: f64,
    /// Median distance of a point from its nearest neighbour; `None` without two different points.
    pub spacing: Option<f64>,
    /// True if the file has normals.
    pub normals: bool,
    /// True if the file has colours.
    pub colors: bool,
    /// Number of triangles.
    pub triangles: usize,
    /// Edges, area and volume of the surface; `None` without triangles.
    pub surface: Option<SurfaceMeasures>,
    /// Further values per point.
    pub columns: Vec<ColumnReport>,
    /// Unit of length.
    pub unit: UnitReport,
    /// Warnings of the reader, a sentence each.
    pub warnings: Vec<String>,
}

/// Further value per point of a file.
#[derive(Clone, Debug, Serialize)]
pub struct ColumnReport {
    /// Name of the column.
    pub name: String,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Number of points without a value.
    pub missing: usize,
}

/// Unit of length.
#[derive(Clone, Debug, Serialize)]
pub struct UnitReport {
    /// Name of the unit; `None` if unknown.
    pub name: Option<String>,
    /// True if the file states the unit, false if it is a guess.
    pub stated: bool,
    /// Source of the unit, in words.
    pub reason: String,
}

impl InspectReport {
    /// Creates the report of an inspection.
    pub fn new(file: &str, seen: &Inspection, surface: Option<SurfaceMeasures>) -> Self {
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
            surface,
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
