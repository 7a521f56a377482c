//! The way in: options, report, and one function for all formats.

use crate::input::{Input, Result};
use crate::{Source, registry, sample};
use isoform_geom::PointCloud;

/// Which points to take of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MeshPoints {
    /// The vertices, with the triangles.
    #[default]
    Vertices,
    /// That many random points on the triangles, uniform by area. A file without triangles gives
    /// its points.
    Samples(usize),
}

/// How to read.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// Keep at most that many points: a uniform random sample, drawn while reading, in the order of
    /// the file.
    pub max_points: Option<usize>,
    /// Seed of all randomness; the same seed gives the same points.
    pub seed: u64,
    /// Vertices or samples of meshes.
    pub mesh: MeshPoints,
    /// Move clouds that are further than 1000 diagonals from the origin to a rounded centre
    /// ([`PointCloud::origin`]). Nothing is rounded.
    pub recenter: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            max_points: None,
            seed: 1,
            mesh: MeshPoints::Vertices,
            recenter: true,
        }
    }
}

/// What was met on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadReport {
    /// Name of the format (`ply`, `xyz`, …).
    pub format: &'static str,
    /// Name of the file.
    pub file: String,
    /// Points the header announces, if it does.
    pub declared: Option<u64>,
    /// Points in the file, good or bad.
    pub rows: u64,
    /// Points that were dropped because a coordinate is not finite.
    pub dropped_points: u64,
    /// Triangles that were dropped because they use such a point.
    pub dropped_triangles: u64,
    /// Whether the cloud is a random part of what the file holds, or random points on its
    /// triangles.
    pub subsampled: bool,
    /// Unit of length, if the file states one: `m`, `mm`, `in`, `ft`, …
    pub units: Option<String>,
    /// Everything odd, one sentence each.
    pub warnings: Vec<String>,
}

impl ReadReport {
    pub(crate) fn new(format: &'static str, file: String) -> Self {
        Self {
            format,
            file,
            declared: None,
            rows: 0,
            dropped_points: 0,
            dropped_triangles: 0,
            subsampled: false,
            units: None,
            warnings: Vec::new(),
        }
    }
    /// A warning, unless it was given already or there are a hundred.
    pub(crate) fn warn(&mut self, text: impl Into<String>) {
        let text = text.into();
        if self.warnings.len() < 100 && !self.warnings.contains(&text) {
            self.warnings.push(text);
        }
    }
}

/// Reads points or a mesh.
///
/// `format` is a name or an ending out of [`formats`](crate::formats) and overrides the guess by
/// the file's name and content.
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
    let format = registry::choose(&mut input, format, &mut warnings)?;
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
