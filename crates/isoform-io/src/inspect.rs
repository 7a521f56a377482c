//! Summary of a cloud.

use crate::ReadReport;
use isoform_geom::{Aabb, KdTree, PointCloud};

/// Number of points whose nearest neighbour is searched: the rank of the sample median is within
/// 3 % of the true one (binomial, 99 %).
const MAX_SPACING_QUERIES: usize = 2000;

/// Name and range of a per-point value.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnRange {
    /// Name.
    pub name: String,
    /// Smallest value that is not NaN; NaN if all are.
    pub min: f64,
    /// Largest value that is not NaN; NaN if all are.
    pub max: f64,
    /// Number of NaN values.
    pub missing: usize,
}

/// Unit of length with its justification.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitGuess {
    /// `m`, `mm`, `in`, …; empty if unknown.
    pub unit: String,
    /// True if the file states the unit; otherwise it is a guess.
    pub is_stated: bool,
    /// Justification, one sentence.
    pub reason: String,
}

/// Summary of a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Inspection {
    /// Name of the format.
    pub format: &'static str,
    /// Number of points.
    pub points: usize,
    /// Number of points of the file, valid or not.
    pub rows: u64,
    /// Number of points dropped because a coordinate is not finite.
    pub dropped_points: u64,
    /// Number of points equal to an earlier one in all coordinates.
    pub duplicates: usize,
    /// True if the cloud is a random sample of the file.
    pub subsampled: bool,
    /// Bounding box relative to the origin of the cloud; empty without points.
    pub bounds: Aabb,
    /// Origin that was subtracted from the file's coordinates.
    pub origin: [f64; 3],
    /// Diagonal of the box.
    pub diagonal: f64,
    /// Median distance to the nearest distinct point, over a sample of points; `None` without two
    /// distinct points.
    pub spacing: Option<f64>,
    /// True if the cloud has normals.
    pub has_normals: bool,
    /// True if the cloud has colours.
    pub has_colors: bool,
    /// Number of triangles.
    pub triangles: usize,
    /// Other per-point values.
    pub columns: Vec<ColumnRange>,
    /// Unit of length.
    pub unit: UnitGuess,
    /// Warnings of the reader.
    pub warnings: Vec<String>,
}

/// Summarises a cloud, in O(n log n).
pub fn inspect(cloud: &PointCloud, report: &ReadReport) -> Inspection {
    let bounds = cloud.bounds();
    Inspection {
        format: report.format,
        points: cloud.points.len(),
        rows: report.rows,
        dropped_points: report.dropped_points,
        duplicates: duplicates(cloud),
        subsampled: report.subsampled,
        bounds,
        origin: cloud.origin,
        diagonal: if bounds.is_empty() {
            0.0
        } else {
            bounds.diagonal()
        },
        spacing: spacing(cloud),
        has_normals: !cloud.normals.is_empty(),
        has_colors: !cloud.colors.is_empty(),
        triangles: cloud.triangles.len(),
        columns: cloud.columns.iter().map(column_range).collect(),
        unit: guess_unit(cloud, &bounds, report),
        warnings: report.warnings.clone(),
    }
}

/// Determines only the unit of length, which is cheap. `bounds` is the box of the cloud, or of a
/// larger one of which it is a sample.
pub fn inspect_unit(cloud: &PointCloud, bounds: &Aabb, report: &ReadReport) -> UnitGuess {
    guess_unit(cloud, bounds, report)
}

/// Counts points that repeat an earlier one bit by bit (0 and −0 count as equal).
fn duplicates(cloud: &PointCloud) -> usize {
    let mut keys: Vec<[u64; 3]> = cloud
        .points
        .iter()
        .map(|p| p.map(|v| (v + 0.0).to_bits()))
        .collect();
    keys.sort_unstable();
    keys.windows(2).filter(|w| w[0] == w[1]).count()
}

/// Returns the median distance to the nearest distinct point, over at most [`MAX_SPACING_QUERIES`]
/// points; `None` if all coincide.
fn spacing(cloud: &PointCloud) -> Option<f64> {
    let tree = KdTree::new(&cloud.points);
    let mut rng = fastrand::Rng::with_seed(1);
    let n = cloud.points.len();
    let queries = (0..n.min(MAX_SPACING_QUERIES)).map(|i| {
        if n <= MAX_SPACING_QUERIES {
            i
        } else {
            // An index of 64 bits: one of 32 would be another number.
            rng.u64(0..n as u64) as usize
        }
    });
    let mut found = Vec::new();
    let mut distances: Vec<f64> = queries
        .filter_map(|i| {
            // Copies of the point itself come first; scanners do not make more than nine.
            tree.nearest_k(cloud.points[i], 10, &mut found);
            found.iter().map(|f| f.0.sqrt()).find(|d| *d > 0.0)
        })
        .collect();
    let middle = distances.len() / 2;
    (!distances.is_empty()).then(|| *distances.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Returns the range of a column and its number of missing values (NaN).
fn column_range(column: &isoform_geom::Column) -> ColumnRange {
    let good = column.values.iter().copied().filter(|v| !v.is_nan());
    ColumnRange {
        name: column.name.clone(),
        min: good.clone().fold(f64::NAN, f64::min),
        max: good.clone().fold(f64::NAN, f64::max),
        missing: column.values.len() - good.count(),
    }
}

/// Range of extents of parts drawn in inches. Parts outside it are not tested for inches.
const INCH_PART_EXTENTS: std::ops::Range<f64> = 0.2..120.0;
/// Minimum number of vertices at one level that indicate a flat face; fewer may be chance.
const MIN_LEVEL_VERTICES: usize = 6;
/// Minimum number of levels at odd fractions of an inch that indicate inches. No CAD file in
/// millimetres or metres that we have seen has three.
const MIN_INCH_LEVELS: usize = 3;

/// Returns the unit that the file states, else the one suggested by extent and levels of a mesh.
fn guess_unit(cloud: &PointCloud, bounds: &Aabb, report: &ReadReport) -> UnitGuess {
    if let Some(unit) = &report.units {
        return UnitGuess {
            unit: unit.clone(),
            is_stated: true,
            reason: format!("the {} file says so", report.format),
        };
    }
    let extent = bounds.size().into_iter().fold(0.0, f64::max);
    let guess = |unit: &str, reason: String| UnitGuess {
        unit: unit.into(),
        is_stated: false,
        reason,
    };
    if INCH_PART_EXTENTS.contains(&extent)
        && let Some(reason) = inches(cloud, bounds)
    {
        return guess("in", reason);
    }
    match extent {
        _ if bounds.is_empty() || extent == 0.0 => guess(
            "",
            "without an extent there is nothing to guess from".into(),
        ),
        0.01..2.0 => guess(
            "m",
            format!("a guess: the extent of {extent:.4} would be a usual part in metres"),
        ),
        2.0..5.0 => guess(
            "",
            format!("the extent of {extent:.4} may be metres, inches or millimetres"),
        ),
        5.0..5000.0 => guess(
            "mm",
            format!("a guess: the extent of {extent:.1} would be a usual part in millimetres"),
        ),
        5000.0.. => guess(
            "",
            format!("the extent of {extent:.4e} is too large to tell millimetres from metres"),
        ),
        _ => guess(
            "",
            format!("the extent of {extent:.4e} is too small to guess from"),
        ),
    }
}

/// Tests whether the flat faces of a mesh lie at fractions of an inch: multiples of 1/32 that are
/// not multiples of 0.05, which designs in millimetres or metres do not use. Scanned points are
/// inconclusive.
fn inches(cloud: &PointCloud, bounds: &Aabb) -> Option<String> {
    let mut is_vertex = vec![false; cloud.points.len()];
    for i in cloud.triangles.as_flattened() {
        *is_vertex.get_mut(*i as usize)? = true;
    }
    let mut odd: Vec<f64> = Vec::new();
    for axis in 0..3 {
        let vertices = (0..cloud.points.len()).filter(|i| is_vertex[*i]);
        let levels = levels(vertices.map(|i| cloud.absolute(i)[axis]).collect());
        let thirty_seconds: Vec<f64> = levels
            .into_iter()
            .filter(|v| is_multiple(*v, 32.0))
            .collect();
        // The layers of a grid of 32nds are not designed faces.
        if thirty_seconds.len() as f64 <= 0.5 * (32.0 * bounds.size()[axis] + 1.0) {
            let found = thirty_seconds
                .into_iter()
                .filter(|v| !is_multiple(*v, 20.0));
            odd.extend(found.map(f64::abs));
        }
    }
    odd.sort_by(f64::total_cmp);
    odd.dedup_by(|a, b| (*a - *b).abs() < 1e-3);
    (odd.len() >= MIN_INCH_LEVELS).then(|| {
        let few: Vec<String> = odd.iter().take(3).map(f64::to_string).collect();
        format!(
            "a guess: {} flat faces lie at 32nds of an inch, such as {}",
            odd.len(),
            few.join(", ")
        )
    })
}

/// Returns the coordinates that many of the values share.
fn levels(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
        .chunk_by(|a, b| b - a < 1e-6)
        .filter(|level| level.len() >= MIN_LEVEL_VERTICES)
        .map(|level| level[0])
        .collect()
}

/// Returns true if a coordinate, from a file with six digits, is a multiple of 1/`per_unit`.
fn is_multiple(v: f64, per_unit: f64) -> bool {
    (v * per_unit - (v * per_unit).round()).abs() < 2e-6 * per_unit
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::Column;

    #[test]
    fn a_grid_with_a_copy() {
        let mut points: Vec<[f64; 3]> = (0..100)
            .map(|i| [f64::from(i % 10) * 0.5, f64::from(i / 10) * 0.5, 0.0])
            .collect();
        points.push([0.0, -0.0, 0.0]);
        let columns = vec![Column {
            name: "t".into(),
            values: [vec![f64::NAN; 100], vec![2.0]].concat(),
        }];
        let cloud = PointCloud {
            points,
            columns,
            ..PointCloud::default()
        };
        let mut report = ReadReport::new("xyz", "t.xyz".into());
        let seen = inspect(&cloud, &report);
        assert_eq!(
            (seen.points, seen.duplicates, seen.spacing),
            (101, 1, Some(0.5))
        );
        assert_eq!(
            (
                seen.columns[0].min,
                seen.columns[0].max,
                seen.columns[0].missing
            ),
            (2.0, 2.0, 100)
        );
        assert!(seen.unit.unit.is_empty() && seen.unit.reason.contains("inches"));
        report.units = Some("in".into());
        assert!(inspect(&cloud, &report).unit.is_stated);
    }

    /// Returns boxes with one corner at the origin, six times each vertex, as a mesh.
    fn boxes(sizes: &[[f64; 3]]) -> PointCloud {
        let corners = sizes.iter().flat_map(|s| {
            (0..48).map(move |i| std::array::from_fn(|k| if i >> k & 1 == 1 { s[k] } else { 0.0 }))
        });
        let points: Vec<[f64; 3]> = corners.collect();
        let triangles = (0..points.len() as u32 / 3)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        PointCloud {
            points,
            triangles,
            ..PointCloud::default()
        }
    }

    #[test]
    fn units_by_size_and_by_fractions() {
        let guess = |cloud: &PointCloud| {
            let report = ReadReport::new("stl", "t.stl".into());
            inspect_unit(cloud, &cloud.bounds(), &report)
        };
        let unit = |cloud: &PointCloud| guess(cloud).unit;
        let inch = boxes(&[[5.0, 2.4375, 1.375], [0.8125, 0.625, 1.0]]);
        let said = guess(&inch);
        assert!(
            said.unit == "in" && !said.is_stated && said.reason.contains("0.625, 0.8125, 1.375"),
            "{said:?}"
        );
        // Without triangles these points are a scan, which is inconclusive.
        let mut scan = inch.clone();
        scan.triangles.clear();
        assert_eq!(unit(&scan), "mm");
        // Quarters and halves are common in millimetres; so are few odd fractions.
        assert_eq!(unit(&boxes(&[[10.0, 2.5, 1.25], [0.75, 5.5, 1.0]])), "mm");
        assert_eq!(
            unit(&boxes(&[[10.0, 2.0625, 1.375], [3.0, 5.5, 1.0]])),
            "mm"
        );
        // Layers of a grid.
        let layers: Vec<[f64; 3]> = (1..=32).map(|i| [f64::from(i) / 32.0; 3]).collect();
        assert_eq!(unit(&boxes(&layers)), "m");
        assert_eq!(unit(&boxes(&[[3.0, 1.0, 1.0]])), "");
    }

    #[test]
    fn nothing() {
        let seen = inspect(
            &PointCloud::default(),
            &ReadReport::new("xyz", "t.xyz".into()),
        );
        assert_eq!((seen.points, seen.spacing, seen.diagonal), (0, None, 0.0));
    }
}
