//! Feature curves and corners of a solid, and its box.
//!
//! A feature curve is where two pieces vanish together, both bound the solid, and their normals
//! differ. [`find`] looks for them in three steps. Cells of an octree are dropped where intervals
//! prove that fewer than two pieces can decide the sign (`octree`), so that the cost grows with the
//! curves' length and not with the volume. In the cells that are left (`search`) Newton's method
//! finds corners, where three pieces or two curves meet, and points of curves (`newton`); what they
//! are is read off the tree with the pieces made linear (`junction`). From corner to corner, and
//! from points that no curve has come by yet, curves are followed (`trace`). At the end intervals
//! prove, as far as they can, that nothing was left out (`proof`).
//!
//! - A *sheet* is a plane that one or several pieces have in common at a point.
//! - A *half-line* is a feature curve as it leaves a corner.
//! - A *leaf* is a cell of the octree that may hold features and is not split any more.

mod apex;
mod complement;
mod extent;
mod junction;
pub(crate) mod newton;
pub(crate) mod octree;
mod proof;
mod search;
mod trace;

pub use complement::Complement;
pub use extent::{Extent, ExtentError, START, extent, extent_within};

use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};
use search::Search;

/// What [`find`] is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureOptions {
    /// Typical distance of mesh points to come: cells are half as large.
    pub size: f64,
    /// By how much the chords of a curve's points may miss it, as a part of the size.
    pub chord: f64,
    /// Normals that differ by less make no feature (radians).
    pub smallest_angle: f64,
    /// Cells that may be looked at.
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

/// Why a point is a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CornerKind {
    /// Three or more pieces meet.
    Meeting,
    /// A piece touches the curve of two others.
    Tangent,
    /// Curves of the same two pieces cross, where the pieces have a common normal.
    Branch,
    /// A piece goes over smoothly into another one beside the curve.
    Seam,
    /// The curve fades out: the pieces' normals become equal.
    Fading,
    /// The tip of a cone: the gradient of a piece vanishes or jumps. It may have no curve.
    Apex,
}

/// A point where curves end.
#[derive(Clone, Debug, PartialEq)]
pub struct Corner {
    /// Where.
    pub point: Point3,
    /// The pieces that vanish there and matter, ascending.
    pub pieces: Vec<u32>,
    /// Why.
    pub kind: CornerKind,
}

impl Corner {
    /// Whether a mesh must have a node there: not where a curve fades out, or goes on with another
    /// piece in the same direction.
    pub fn needs_node(&self) -> bool {
        !matches!(self.kind, CornerKind::Fading | CornerKind::Seam)
    }
}

/// A curve where two pieces meet at an angle.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureCurve {
    /// The pieces, ascending. Where several coincide along the curve, the first of them stands for
    /// all.
    pub pieces: [u32; 2],
    /// Points in order, on both pieces up to rounding. The last point of a closed curve repeats the
    /// first.
    pub points: Vec<Point3>,
    /// Whether it ends where it began.
    pub closed: bool,
    /// The corners at the ends of the curve: none if it is closed without a corner, and none where
    /// it leaves the region.
    pub corners: [Option<u32>; 2],
    /// Least and greatest angle between the pieces' normals (radians): 0 is smooth, π a knife's
    /// edge or a slit.
    pub angles: [f64; 2],
}

/// What [`find`] found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// Ends of curves.
    pub corners: Vec<Corner>,
    /// The curves.
    pub curves: Vec<FeatureCurve>,
    /// Whether intervals prove that there is no feature farther than one and a half sizes from
    /// those found. It does not prove that no two curves run closer together than that, and pieces
    /// that coincide at samples count as one.
    pub certified: bool,
    /// Cells where the proof is missing.
    pub uncertified: Vec<Aabb>,
    /// Cells where the proof is missing because two pieces run along each other, as at the seams of
    /// blends. At samples they meet without an angle; intervals of values cannot tell.
    pub tangential: Vec<Aabb>,
    /// Whether the search came to its end: not stopped, the budget not spent, no curve given up.
    pub complete: bool,
    /// Cells looked at.
    pub cells: usize,
}

impl Features {
    /// Corners that are tips of cones.
    pub(crate) fn apexes(&self) -> Vec<Corner> {
        self.of_kind(CornerKind::Apex)
    }
    /// Corners in which a piece touches the curve of two others.
    pub(crate) fn contacts(&self) -> Vec<Corner> {
        self.of_kind(CornerKind::Tangent)
    }
    fn of_kind(&self, kind: CornerKind) -> Vec<Corner> {
        let is_one = |c: &&Corner| c.kind == kind;
        self.corners.iter().filter(is_one).cloned().collect()
    }
}

/// All feature curves and corners of a solid in a region.
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
    Search::new(solid, region, options, control).run()
}
