//! The surface of a map in a box: the options, and the triangles.

use crate::analysis::Budget;
use crate::claim::{Certificate, Claim, Decisions, Verdict};
use crate::domain::Domain;
use crate::finding::Finding;
use crate::real_border::RealBorder;
use crate::surface_box::SurfaceBox;
use crate::winding::Winding;
use isoform_algebra::RBig;
use isoform_control::Stopped;
pub use isoform_geom::Point3;
use std::collections::BTreeMap;

/// Whether sheets that cross are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// They pass through one another: two vertices may share a position on the double curve, and
    /// every edge has one or two triangles.
    Normalised,
    /// They are cut and joined along the double curve, whose edges have four triangles or more.
    Glued,
}

/// The fineness of the triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// Largest distance of the middles of triangles and edges from the surface, in units of space:
    /// positive.
    pub tolerance: f64,
    /// Largest length of edges, in units of space: positive.
    pub longest: f64,
    /// Number of triangles at which refinement stops.
    pub triangles: usize,
}

impl MeshOptions {
    /// The tolerance of [`MeshOptions::around`], in half widths: a quarter of a thousandth of the
    /// width.
    pub const TOLERANCE: f64 = 5e-4;
    /// The longest edge of [`MeshOptions::around`], in half widths.
    pub const LONGEST: f64 = 0.25;
    /// The number of triangles of [`MeshOptions::around`].
    pub const TRIANGLES: usize = 400_000;

    /// A tolerance and longest edges in proportion to half the width of a surface or of its box.
    pub fn around(half_width: f64) -> Self {
        Self {
            tolerance: Self::TOLERANCE * half_width,
            longest: Self::LONGEST * half_width,
            triangles: Self::TRIANGLES,
        }
    }
}

/// The options of a triangulation.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangulateOptions {
    /// Half the width of the box around the origin, in units of space: positive, and neither too
    /// large nor too small for doubles.
    pub half_width: RBig,
    /// The part of the parameter plane to which the surface is restricted: all of it if there is
    /// none.
    pub domain: Option<Domain>,
    /// Whether sheets that cross are joined.
    pub mode: Mode,
    /// The fineness.
    pub mesh: MeshOptions,
    /// The limits of the exact analysis.
    pub budget: Budget,
}

impl TriangulateOptions {
    /// The seconds of the exact analysis: surfaces that take longer mostly take hours, and are
    /// drawn without what would be found then. With less, surfaces of degree 8 are cut off on slow
    /// machines; with twice as much, a glued surface may take more than two minutes.
    pub const EXACT_SECONDS: f64 = 60.0;

    /// All of a surface in the box \[−B, B\]³ around the origin, with B = `half_width` > 0, its
    /// sheets joined: with [`MeshOptions::around`] it and [`Self::EXACT_SECONDS`].
    ///
    /// ```
    /// use isoform_tess::{Mode, TriangulateOptions};
    ///
    /// let options = TriangulateOptions::around(2.into());
    /// assert_eq!((options.mesh.tolerance, options.mesh.longest), (1e-3, 0.5));
    /// Sheets may also be left as they are.
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

    /// All of some patches in the box that holds them, their sheets left as they are: different
    /// patches are not cut where they cross. With [`MeshOptions::around`] the size of the patches,
    /// wherever they lie, and [`Self::EXACT_SECONDS`].
    ///
    /// ```
    /// use isoform_tess::{Mode, SurfaceBox, TriangulateOptions};
    ///
    /// Patches of width 2 far from the origin.
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

    /// Refuses what is out of range.
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

/// Why there is no surface.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TriangulateError {
    /// A number among the options is out of its range.
    #[error("{name} is {value}, which is out of range")]
    Option {
        /// The option.
        name: &'static str,
        /// Its value, to the nearest double.
        value: f64,
    },
    /// The control ended the work before the region of parameters was found.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for TriangulateError {
    fn from(Stopped: Stopped) -> Self {
        Self::Stopped
    }
}

/// The kind of a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Of the surface, nothing special.
    Ordinary,
    /// On a face of the box.
    Box,
    /// Where sheets meet.
    Double,
    /// On the seam curve of a base point.
    Seam,
    /// The one image of a whole curve.
    Contracted,
    /// On a curve or in a point where the rank of the map drops.
    Cusp,
    /// On a side of the domain, or on a fold of an improper map.
    Border,
}

/// An arc in which sheets of the surface meet.
#[derive(Clone, Debug, PartialEq)]
pub struct DoubleArc {
    /// Its vertices.
    pub points: Vec<Point3>,
    /// The number of sheets that meet in it.
    pub sheets: usize,
}

/// Triangles of a surface in a box.
///
/// A vertex has a number below `points.len()`, a triangle one below `triangles.len()`: lists that
/// say what vertices or triangles are have these lengths.
#[derive(Clone, Debug, Default)]
pub struct Surface {
    /// Vertices.
    pub points: Vec<Point3>,
    /// The kind of each vertex.
    pub kinds: Vec<Kind>,
    /// The vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The unit triangle of parameters that each triangle lies in, as in
    /// [`isoform_algebra::QUADRANTS`].
    pub charts: Vec<u8>,
    /// u and v of the corners of each triangle there.
    pub corners: Vec<[[f64; 2]; 3]>,
    /// Rows of the matrix that takes the homogeneous coordinates of `corners` to (s, t, w), where
    /// parameters were moved ([`Frame`](crate::Frame)).
    pub frame: Option<[[f64; 3]; 3]>,
    /// The patch that each triangle is of, where patches were joined.
    pub patches: Vec<u32>,
    /// The winding of the triangles.
    pub winding: Winding,
    /// Patches whose image is a curve or a point: they have no triangles.
    pub collapsed: Vec<u32>,
    /// The border of the real image of an improper map.
    pub real_border: RealBorder,
    /// Arcs in which real sheets meet.
    pub double_curve: Vec<DoubleArc>,
    /// Real points of the surface that only conjugate parameters reach, as polylines.
    pub solitary_arcs: Vec<Vec<Point3>>,
    /// The findings; empty if everything is proved. A claim with a finding does not hold.
    pub findings: Vec<Finding>,
    /// The verdicts of the stages, without the findings: [`Surface::certificate`] has both.
    pub(crate) decisions: Decisions,
    /// Whether the double curve was looked for and drawn to the end, as sheets that are to be
    /// joined need it.
    pub is_double_curve_known: bool,
    /// Whether it is certain that the map sends no parameters into the box: then there are no
    /// triangles to be had.
    pub is_outside: bool,
    /// The number of parameters that are drawn and lead to one general point, complex ones
    /// included: 1 for a proper map, and for an improper one of which a fundamental domain is
    /// drawn; 0 if it is unknown.
    pub sheets: usize,
    /// The piece that each triangle belongs to, see [`Winding::pieces`].
    pub(crate) pieces: Vec<u32>,
    /// The largest distance of triangles from the surface that was asked for.
    pub(crate) tolerance: f64,
    /// The faces of the box that each vertex is on, as bits.
    pub(crate) faces: Vec<u8>,
    /// The sides of the domain that the corners of the triangles are on, as bits; a fold counts as
    /// the first side.
    pub(crate) borders: Vec<[u64; 3]>,
    /// Whether each vertex is on the double curve.
    pub(crate) double: Vec<bool>,
}

/// Edges from the lesser vertex to the greater: how many triangles they have, and whether they lie
/// on a side of the domain in one of them.
pub(crate) type Edges = BTreeMap<[u32; 2], (usize, bool)>;

impl Surface {
    /// True if no claim is open. Without triangles there is nothing to certify, unless it is certain
    /// that there are none to be had.
    pub fn is_certified(&self) -> bool {
        self.certificate().is_closed() && (!self.triangles.is_empty() || self.is_outside)
    }
    /// The finding against a surface that should have triangles, and has none.
    pub(crate) fn lack(&self) -> Option<Finding> {
        (self.triangles.is_empty() && !self.is_outside).then_some(Finding::NoTriangles)
    }
    /// Whether nothing was found against a claim.
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
    /// The edges of the triangles; `borders` has the sides of the domain that count for the corners
    /// of each triangle, as bits.
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
    /// The number of edges that have one triangle, and lie neither in a face of the box nor on a
    /// side of the domain.
    pub(crate) fn open_edges(&self, edges: &Edges) -> usize {
        let same_face = |e: &[u32; 2]| self.faces[e[0] as usize] & self.faces[e[1] as usize] != 0;
        edges
            .iter()
            .filter(|(e, (n, is_border))| *n == 1 && !is_border && !same_face(e))
            .count()
    }
    /// Whether both ends of an edge are on the double curve.
    pub(crate) fn is_double(&self, edge: &[u32; 2]) -> bool {
        edge.iter().all(|&v| self.double[v as usize])
    }
}
