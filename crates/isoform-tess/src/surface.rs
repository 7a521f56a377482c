//! The surface of a map in a box: its options and its triangles.

use crate::analysis::Budget;
use crate::claim::{Certificate, Claim, Decisions, Verdict};
use crate::domain::Domain;
use crate::finding::Finding;
use crate::real_border::RealBorder;
use crate::region::FOLD_BIT;
use crate::surface_box::SurfaceBox;
use crate::winding::{Winding, polylines};
use isoform_algebra::RBig;
use isoform_control::Stopped;
pub use isoform_geom::Point3;
use std::collections::{BTreeMap, BTreeSet};

/// Treatment of sheets that cross.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Sheets pass through one another: two vertices may share a position on the double curve, and
    /// every edge has one or two triangles.
    Normalised,
    /// Sheets are cut and joined along the double curve, whose edges have four triangles or more.
    Glued,
}

/// Fineness of the triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// Maximum distance of the middles of triangles and edges from the surface, in units of space:
    /// positive.
    pub tolerance: f64,
    /// Maximum length of edges, in units of space: positive.
    pub longest: f64,
    /// Number of triangles at which refinement stops.
    pub triangles: usize,
}

impl MeshOptions {
    /// Tolerance of [`MeshOptions::around`], in half widths: a quarter of a thousandth of the
    /// width.
    pub const TOLERANCE: f64 = 5e-4;
    /// Longest edge of [`MeshOptions::around`], in half widths.
    pub const LONGEST: f64 = 0.25;
    /// Number of triangles of [`MeshOptions::around`].
    pub const TRIANGLES: usize = 400_000;

    /// Returns options with a tolerance and longest edges in proportion to half the width of a
    /// surface or of its box.
    pub fn around(half_width: f64) -> Self {
        Self {
            tolerance: Self::TOLERANCE * half_width,
            longest: Self::LONGEST * half_width,
            triangles: Self::TRIANGLES,
        }
    }
}

/// Options of a triangulation.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangulateOptions {
    /// Half the width of the box around the origin, in units of space: positive, and within the
    /// range of doubles.
    pub half_width: RBig,
    /// Part of the parameter plane to which the surface is restricted; `None` for the whole plane.
    pub domain: Option<Domain>,
    /// Treatment of sheets that cross.
    pub mode: Mode,
    /// Fineness of the triangles.
    pub mesh: MeshOptions,
    /// Limits of the exact analysis.
    pub budget: Budget,
}

impl TriangulateOptions {
    /// Time limit of the exact analysis, in seconds. Surfaces that take longer mostly take hours,
    /// and are drawn without the results that are missing. With less, surfaces of degree 8 are cut
    /// off on slow machines; with twice as much, a glued surface may take more than two minutes.
    pub const EXACT_SECONDS: f64 = 60.0;

    /// Returns the options for the whole surface in the box \[−B, B\]³ around the origin, with B =
    /// `half_width` > 0, and joined sheets, with [`MeshOptions::around`] it and
    /// [`Self::EXACT_SECONDS`].
    ///
    /// ```
    /// use isoform_tess::{Mode, TriangulateOptions};
    ///
    /// let options = TriangulateOptions::around(2.into());
    /// assert_eq!((options.mesh.tolerance, options.mesh.longest), (1e-3, 0.5));
    /// // Sheets may also be left to pass through one another.
    /// let options = TriangulateOptions { mode: Mode::Normalised, ..options };
    /// assert_eq!(options.domain, None);
    /// ```
    pub fn around(half_width: RBig) -> Self {
        let mesh = MeshOptions::around(half_width.to_f64().value());
        let budget = Budget {
            seconds: Self::EXACT_SECONDS,
            ..Budget::default()
        };
        Self {
            half_width,
            domain: None,
            mode: Mode::Glued,
            mesh,
            budget,
        }
    }

    /// Returns the options for whole patches in the box that contains them, without joining their
    /// sheets: different patches are not cut where they cross. The fineness is
    /// [`MeshOptions::around`] the size of the patches, wherever they lie, and the time limit
    /// [`Self::EXACT_SECONDS`].
    ///
    /// ```
    /// use isoform_tess::{Mode, SurfaceBox, TriangulateOptions};
    ///
    /// // Patches of width 2 far from the origin.
    /// let around = SurfaceBox { half_width: 100.into(), size: 1.0 };
    /// let options = TriangulateOptions::of_patches(&around);
    /// assert_eq!((options.mode, options.mesh.longest), (Mode::Normalised, 0.25));
    /// ```
    pub fn of_patches(around: &SurfaceBox) -> Self {
        Self {
            mode: Mode::Normalised,
            mesh: MeshOptions::around(around.size),
            ..Self::around(around.half_width.clone())
        }
    }

    /// Returns an error if an option is out of range.
    pub(crate) fn check(&self) -> Result<(), TriangulateError> {
        let half_width = self.half_width.to_f64().value();
        let all = [
            ("half the width of the box", half_width, f64::MAX),
            ("the tolerance", self.mesh.tolerance, f64::INFINITY),
            ("the longest edge", self.mesh.longest, f64::INFINITY),
        ];
        let is_wrong = |&(_, value, most): &(_, f64, f64)| !(value > 0.0 && value <= most);
        match all.into_iter().find(is_wrong) {
            Some((name, value, _)) => Err(TriangulateError::Option { name, value }),
            None => Ok(()),
        }
    }
}

/// Reason why a triangulation has no result.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TriangulateError {
    /// An option is out of range.
    #[error("{name} is {value}, which is out of range")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Value of the option, to the nearest double.
        value: f64,
    },
    /// The control stopped the work before the region of parameters was found.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for TriangulateError {
    fn from(Stopped: Stopped) -> Self {
        Self::Stopped
    }
}

/// Kind of a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VertexKind {
    /// Interior vertex.
    Ordinary,
    /// Vertex on a face of the box.
    Box,
    /// Vertex on the double curve, where sheets meet.
    Double,
    /// Vertex on the seam curve of a base point.
    Seam,
    /// The common image of a whole contracted curve.
    Contracted,
    /// Vertex on a curve, or at a point, at which the rank of the map drops.
    Cusp,
    /// Vertex on a side of the domain, or on a fold of an improper map.
    Border,
}

/// An arc of the double curve, in which sheets of the surface meet.
#[derive(Clone, Debug, PartialEq)]
pub struct DoubleArc {
    /// Vertices of the arc.
    pub points: Vec<Point3>,
    /// Number of sheets that meet in it.
    pub sheets: usize,
}

/// Triangles of a surface in a box.
///
/// Vertices are numbered below `points.len()`, and triangles below `triangles.len()`; lists of
/// properties of vertices or of triangles have these lengths.
#[derive(Clone, Debug, Default)]
pub struct Surface {
    /// Positions of the vertices.
    pub points: Vec<Point3>,
    /// Kind of each vertex.
    pub kinds: Vec<VertexKind>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Unit triangle of parameters that contains each triangle, as in
    /// [`isoform_algebra::QUADRANTS`].
    pub charts: Vec<u8>,
    /// Coordinates u and v of the corners of each triangle there.
    pub corners: Vec<[[f64; 2]; 3]>,
    /// Rows of the matrix that maps the homogeneous coordinates of `corners` to (s, t, w), if the
    /// parameters were normalised ([`Frame`](crate::Frame)).
    pub frame: Option<[[f64; 3]; 3]>,
    /// Patch of each triangle, if patches were joined.
    pub patches: Vec<u32>,
    /// Winding of the triangles.
    pub winding: Winding,
    /// Patches whose image is a curve or a point; they have no triangles.
    pub collapsed: Vec<u32>,
    /// Border of the real image of an improper map.
    pub real_border: RealBorder,
    /// Arcs in which real sheets meet.
    pub double_curve: Vec<DoubleArc>,
    /// Real points of the surface that only conjugate parameters reach, as polylines.
    pub solitary_arcs: Vec<Vec<Point3>>,
    /// Findings; empty if everything is proved. A claim with a finding does not hold.
    pub findings: Vec<Finding>,
    /// Verdicts of the stages, without the findings; [`Surface::certificate`] combines both.
    pub(crate) decisions: Decisions,
    /// True if the double curve was found and drawn completely, as needed for joining sheets.
    pub is_double_curve_known: bool,
    /// True if the surface provably misses the box; then an empty mesh is correct.
    pub is_outside: bool,
    /// Number of drawn parameters that lead to one general point, complex ones included: 1 for a
    /// proper map, and for an improper one of which a fundamental domain is drawn; 0 if it is
    /// unknown.
    pub sheets: usize,
    /// Piece to which each triangle belongs, see [`Winding::pieces`].
    pub(crate) pieces: Vec<u32>,
    /// Maximum distance of triangles from the surface that was requested.
    pub(crate) tolerance: f64,
    /// Faces of the box on which each vertex lies, as bits.
    pub(crate) faces: Vec<u8>,
    /// Sides of the domain on which the corners of the triangles lie, as bits; a fold counts as the
    /// first side.
    pub(crate) borders: Vec<[u64; 3]>,
    /// True for each vertex on the double curve.
    pub(crate) double: Vec<bool>,
}

/// Edges, smaller vertex first, with the number of their triangles, and true if they lie on a side
/// of the domain in one of these.
pub(crate) type Edges = BTreeMap<[u32; 2], (usize, bool)>;

impl Surface {
    /// Returns true if no claim is open. A surface without triangles is certified only if it
    /// provably misses the box.
    pub fn is_certified(&self) -> bool {
        self.certificate().is_closed() && (!self.triangles.is_empty() || self.is_outside)
    }
    /// Returns the finding against a surface that should have triangles, but has none.
    pub(crate) fn lack(&self) -> Option<Finding> {
        (self.triangles.is_empty() && !self.is_outside).then_some(Finding::NoTriangles)
    }
    /// Returns true if no finding contradicts a claim.
    pub fn holds(&self, claim: Claim) -> bool {
        self.findings.iter().all(|f| f.claim() != claim)
    }
    /// Returns the verdicts on all claims: a claim with a finding is open.
    pub fn certificate(&self) -> Certificate {
        Certificate::new(|claim| match self.holds(claim) {
            true => self.decisions.verdict(claim),
            false => Verdict::Open,
        })
    }
    /// Returns the edges of the triangles; `borders` are the sides of the domain that count for the
    /// corners of each triangle, as bits.
    pub(crate) fn edges(&self, borders: &[[u64; 3]]) -> Edges {
        let mut edges = Edges::new();
        for (t, bits) in self.triangles.iter().zip(borders) {
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (count, is_border) = edges.entry([t[i].min(t[j]), t[i].max(t[j])]).or_default();
                *count += 1;
                *is_border |= bits[i] & bits[j] != 0;
            }
        }
        edges
    }
    /// Returns the number of edges with one triangle that lie neither in a face of the box nor on a
    /// side of the domain.
    pub(crate) fn open_edges(&self, edges: &Edges) -> usize {
        let same_face = |e: &[u32; 2]| self.faces[e[0] as usize] & self.faces[e[1] as usize] != 0;
        edges
            .iter()
            .filter(|(e, (n, is_border))| *n == 1 && !is_border && !same_face(e))
            .count()
    }
    /// Returns the folds in which the surface ends, as polylines.
    pub(crate) fn fold_lines(&self) -> Vec<Vec<Point3>> {
        let folds: Vec<[u64; 3]> = self
            .borders
            .iter()
            .map(|b| b.map(|x| x & FOLD_BIT))
            .collect();
        let edges = self.edges(&folds);
        let ends = edges.iter().filter(|(_, (n, is_fold))| *n == 1 && *is_fold);
        let ends: BTreeSet<[u32; 2]> = ends.map(|e| *e.0).collect();
        let at = |line: Vec<u32>| line.iter().map(|&v| self.points[v as usize]).collect();
        polylines(&ends).into_iter().map(at).collect()
    }
    /// Returns true if both ends of an edge are on the double curve.
    pub(crate) fn is_double(&self, edge: &[u32; 2]) -> bool {
        edge.iter().all(|&v| self.double[v as usize])
    }
}
