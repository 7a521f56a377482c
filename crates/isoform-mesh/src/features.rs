//! Feature curves and corners of a solid, and its bounding box.
//!
//! A feature curve is a curve on which two pieces vanish together, both bound the solid, and their
//! normals differ. [`find`] searches in three steps. Cells of an octree are dropped where intervals
//! prove that fewer than two pieces can decide the sign (`octree`), so that the cost grows with the
//! length of the curves and not with the volume. In the remaining cells (`search`) Newton's method
//! finds corners, where three pieces or two curves meet, and points of curves (`newton`); their
//! kind is read off the tree with linearised pieces (`junction`). Curves are traced from corner to
//! corner, and from points that no traced curve passes yet (`trace`). Finally intervals prove, as
//! far as they can, that no feature was missed (`proof`).
//!
//! - A *sheet* is a common tangent plane of one or several pieces at a point.
//! - A *half-line* is a feature curve as it leaves a corner.
//! - A *leaf* is a cell of the octree that may hold features and is not split further.

mod apex;
mod complement;
mod context;
mod extent;
mod junction;
pub(crate) mod newton;
pub(crate) mod octree;
mod proof;
mod search;
mod trace;

pub use complement::Complement;
pub use extent::{Extent, ExtentError, START, extent, extent_within};

use context::FeatureContext;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};

/// Options of [`find`].
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureOptions {
    /// Typical distance of the mesh points to come, in model units; leaves of the octree are at
    /// most half as large.
    pub size: f64,
    /// Maximum distance between a curve and the chords of its points, as a fraction of the size.
    pub chord: f64,
    /// Minimum angle between normals that makes a feature (radians).
    pub smallest_angle: f64,
    /// Maximum number of cells examined.
    pub cells: usize,
}

impl Default for FeatureOptions {
    fn default() -> Self {
        Self {
            size: 0.1,
            chord: 4e-4,
            smallest_angle: 2.0_f64.to_radians(),
            cells: 20_000_000,
        }
    }
}

/// Reason why a point is a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CornerKind {
    /// Three or more pieces meet.
    Meeting,
    /// A piece touches the curve of two others.
    Tangent,
    /// Curves of two pieces cross at a point where the pieces have a common normal.
    Branch,
    /// Another piece continues a piece smoothly next to the curve.
    Seam,
    /// The curve ends because the pieces' normals become equal.
    Fading,
    /// Tip of a cone: the gradient of a piece vanishes or jumps. Curves need not end there.
    Apex,
}

/// A point where curves end.
#[derive(Clone, Debug, PartialEq)]
pub struct Corner {
    /// Position.
    pub point: Point3,
    /// Indices of the pieces that vanish there and bound the solid, ascending.
    pub pieces: Vec<u32>,
    /// Reason why the point is a corner.
    pub kind: CornerKind,
}

impl Corner {
    /// Returns true if a mesh needs a node there; false where a curve fades out, or where another
    /// piece continues it in an unchanged direction.
    pub fn needs_node(&self) -> bool {
        !matches!(self.kind, CornerKind::Fading | CornerKind::Seam)
    }
}

/// A curve where two pieces meet at an angle.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureCurve {
    /// Indices of the pieces, ascending. Where several coincide along the curve, the first stands
    /// for all.
    pub pieces: [u32; 2],
    /// Points in order, on both pieces up to rounding. The last point of a closed curve repeats the
    /// first.
    pub points: Vec<Point3>,
    /// True if the curve is closed.
    pub closed: bool,
    /// Corners at the ends of the curve; `None` if it is closed without a corner, and at an end
    /// where it leaves the region.
    pub corners: [Option<u32>; 2],
    /// Minimum and maximum angle between the pieces' normals (radians): 0 is smooth, π a knife edge
    /// or a slit.
    pub angles: [f64; 2],
}

/// Feature curves and corners of a solid, and the extent to which they are proved complete.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// Ends of curves, and tips of cones.
    pub corners: Vec<Corner>,
    /// Feature curves.
    pub curves: Vec<FeatureCurve>,
    /// True if intervals prove that no feature is farther than 1.5 sizes from those found. The
    /// proof does not exclude a second curve closer than that, and pieces that coincide at samples
    /// count as one.
    pub certified: bool,
    /// Cells where the proof is missing.
    pub uncertified: Vec<Aabb>,
    /// Cells where the proof is missing because two pieces run along each other, as at the seams of
    /// blends: they meet without an angle at samples, and intervals of values cannot separate them.
    pub tangential: Vec<Aabb>,
    /// True if the search was completed: not stopped, budget not spent, every curve traced to its
    /// end.
    pub complete: bool,
    /// Number of cells examined.
    pub cells: usize,
}

impl Features {
    /// Returns the corners that are tips of cones.
    pub(crate) fn apexes(&self) -> Vec<Corner> {
        self.of_kind(CornerKind::Apex)
    }
    /// Returns the corners in which a piece touches the curve of two others.
    pub(crate) fn contacts(&self) -> Vec<Corner> {
        self.of_kind(CornerKind::Tangent)
    }
    fn of_kind(&self, kind: CornerKind) -> Vec<Corner> {
        let is_one = |c: &&Corner| c.kind == kind;
        self.corners.iter().filter(is_one).cloned().collect()
    }
}

/// Finds all feature curves and corners of a solid in a region.
///
/// Features much smaller than size/32 can be missed within a cell that intervals do not decide; see
/// [`Features::certified`].
///
/// ```
/// use isoform_field::Pieces;
/// use isoform_field::hyperfun::{Mode, Model};
/// use isoform_geom::Aabb;
/// use isoform_mesh::Control;
/// use isoform_mesh::features::{FeatureOptions, find};
///
/// // A cylinder of radius 1 between z = −1 and z = 1 has two circles for edges.
/// let program = "rod(x[3], a[1]) { rod = (1 - x[1]^2 - x[2]^2) & (1 - x[3]) & (x[3] + 1); }";
/// let model = Model::parse(program, Mode::Default)?;
/// let solid = Pieces::of_model(&model, &vec![0.0; model.n_params()])?;
/// let region = Aabb { lo: [-2.0; 3], hi: [2.0; 3] };
/// let options = FeatureOptions { size: 0.25, ..FeatureOptions::default() };
/// let found = find(&solid, region, &options, &Control::default());
/// assert_eq!((found.curves.len(), found.corners.len()), (2, 0));
/// for curve in &found.curves {
///     assert!(curve.closed && (curve.angles[0] - 90f64.to_radians()).abs() < 1e-9);
///     assert!(curve.points.iter().all(|p| (p[0].hypot(p[1]) - 1.0).abs() < 1e-12));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn find(
    solid: &dyn Solid,
    region: Aabb,
    options: &FeatureOptions,
    control: &Control<'_>,
) -> Features {
    let size = options.size;
    let bounds = || region.lo.iter().chain(&region.hi);
    if region.is_empty() || !(size > 0.0 && size.is_finite()) || !bounds().all(|v| v.is_finite()) {
        return Features::default();
    }
    FeatureContext::new(solid, region, options, control).run()
}
