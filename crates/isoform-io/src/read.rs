//! Reading of points in any format.

use crate::choose::choose;
use crate::input::{Input, Result};
use crate::options::{MeshPoints, ReadOptions, ReadReport};
use crate::{Source, sample};
use isoform_geom::PointCloud;

/// Reads points or a mesh.
///
/// `format` is a name or an ending from [`formats`](crate::formats) and overrides recognition by
/// name and content.
///
/// ```
/// use isoform_io::{ReadOptions, Source, read};
/// let source = Source::Bytes { name: "-", bytes: b"x y z\n0 0 1\n2.5 0 nan\n1e-3 4 5\n" };
/// let (cloud, report) = read(source, None, &ReadOptions::default())?;
/// assert_eq!(cloud.points, [[0.0, 0.0, 1.0], [0.001, 4.0, 5.0]]);
/// assert_eq!((report.format, report.dropped_points), ("xyz", 1));
/// # Ok::<(), isoform_io::ReadError>(())
/// ```
pub fn read(
    source: Source<'_>,
    format: Option<&str>,
    options: &ReadOptions,
) -> Result<(PointCloud, ReadReport)> {
    let mut input = Input::open(source)?;
    let mut warnings = Vec::new();
    let format = choose(&mut input, format, &mut warnings)?;
    let mut report = ReadReport::new(format.name, input.name.clone());
    report.warnings = warnings;
    let cloud = (format.read)(&mut input, options, &mut report)?;
    let cloud = match options.mesh {
        MeshPoints::Samples(n) if !cloud.triangles.is_empty() => {
            report.subsampled = true;
            sample::surface_samples(
                &cloud,
                options.max_points.map_or(n, |max| max.min(n)),
                options.seed,
                &mut report,
            )
        }
        _ => cloud,
    };
    if cloud.points.is_empty() {
        report.warn("there are no points in the file");
    }
    Ok((cloud, report))
}
