//! Options and reports of reading and writing, common to all formats.

/// Points to take from a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MeshPoints {
    /// Vertices, with the triangles.
    #[default]
    Vertices,
    /// Given number of random points on the triangles, uniform by area. A file without triangles
    /// gives its points.
    Samples(usize),
}

/// Options of reading.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// Maximum number of points to keep: a uniform random sample, drawn while reading, in the order
    /// of the file.
    pub max_points: Option<usize>,
    /// Random seed; equal seeds give equal points.
    pub seed: u64,
    /// Points to take from meshes: vertices or samples.
    pub mesh: MeshPoints,
    /// True to recentre clouds that are farther than 1000 diagonals from the origin at a rounded
    /// centre ([`PointCloud::origin`](isoform_geom::PointCloud::origin)). Coordinates are not
    /// rounded.
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

/// Report of reading a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadReport {
    /// Name of the format (`ply`, `xyz`, …).
    pub format: &'static str,
    /// Name of the file.
    pub file: String,
    /// Number of points announced by the header; `None` if it announces none.
    pub declared: Option<u64>,
    /// Number of points in the file, valid or not.
    pub rows: u64,
    /// Number of points dropped because a coordinate is not finite.
    pub dropped_points: u64,
    /// Number of triangles dropped because they use such a point.
    pub dropped_triangles: u64,
    /// True if the cloud is a random sample of the points of the file or of its triangles.
    pub subsampled: bool,
    /// Unit of length; `None` if the file states none. `m`, `mm`, `in`, `ft`, …
    pub units: Option<String>,
    /// Warnings, one sentence each.
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
    /// Adds a warning, unless it is already present or there are a hundred.
    pub(crate) fn warn(&mut self, text: impl Into<String>) {
        let text = text.into();
        if self.warnings.len() < 100 && !self.warnings.contains(&text) {
            self.warnings.push(text);
        }
    }
}

/// Options of writing.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// True to write PLY as text instead of binary.
    pub ascii: bool,
    /// Unit of length to be stated in the file, if the format supports it.
    pub units: Option<String>,
}

/// Report of the data that a file omits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WriteReport {
    /// Name of the format.
    pub format: &'static str,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}
