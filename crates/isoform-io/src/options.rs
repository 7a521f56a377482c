//! How to read and write, and what is reported of it: options and reports of all formats.

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
    /// ([`PointCloud::origin`](isoform_geom::PointCloud::origin)). Nothing is rounded.
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
    /// Returns the report of points that were not read from a file.
    pub fn of_memory(format: &'static str, points: usize) -> Self {
        Self {
            rows: points as u64,
            ..Self::new(format, String::new())
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

/// How to write.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// PLY as text instead of binary.
    pub ascii: bool,
    /// Unit of length to state in the file, where the format can.
    pub units: Option<String>,
}

/// What did not go into the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WriteReport {
    /// Name of the format.
    pub format: &'static str,
    /// One sentence each.
    pub warnings: Vec<String>,
}
