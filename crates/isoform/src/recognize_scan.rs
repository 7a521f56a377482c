//! Surfaces recognised in scans.

use crate::CornerError;
use crate::facets::{check_corners, with_points};
use isoform_control::{Control, Stopped};
use isoform_geom::PointCloud;
use isoform_recognize::{
    Error, Options, Proposal, ProposeError, Recognition, Snap, propose, recognize,
    recognize_facets, snap,
};
use std::borrow::Cow;

/// About how many points are taken on the faces of a CAD mesh. Fewer leave small faces bare,
/// more take longer.
const ON_FACES: usize = 20_000;

/// Why a scan is not recognised.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecognizeError {
    /// A triangle has a corner that is no point.
    #[error(transparent)]
    Corner(#[from] CornerError),
    /// The stage has no result.
    #[error(transparent)]
    Stage(#[from] Error),
}

/// What was recognised, and in which points.
#[derive(Clone, Debug)]
pub struct Recognized<'a> {
    /// The points: those of the scan; of a CAD mesh further ones on its flat faces, after its own.
    pub scan: Cow<'a, PointCloud>,
    /// The entities, and the labels of these points.
    pub recognition: Recognition,
}

impl Recognized<'_> {
    /// A HyperFun template of the entities, for [`fit_scan`](crate::fit_scan) to polish.
    ///
    /// # Errors
    /// [`ProposeError`].
    pub fn template(&self, title: &str, control: &Control<'_>) -> Result<Proposal, ProposeError> {
        propose(&self.scan, &self.recognition, title, control)
    }

    /// Refits all entities together so that their relations hold exactly; says what that changed.
    ///
    /// # Errors
    /// [`Stopped`]; nothing is changed then.
    pub fn snap(&mut self, control: &Control<'_>) -> Result<Snap, Stopped> {
        let (recognition, snap) = snap(&self.scan, &self.recognition, control)?;
        self.recognition = recognition;
        Ok(snap)
    }
}

/// Recognises planes, spheres, cylinders, cones and tori in a scan or a CAD mesh.
///
/// A mesh most of whose facets are chords of such surfaces, with their vertices on them, is one of
/// a CAD model and is recognised by its triangles; any other by its vertices, as a cloud.
///
/// ```
/// use isoform::geom::{PointCloud, Quadric};
/// use isoform::{Control, RecognizeOptions, recognize_scan};
/// // Points of a sphere of radius 2 about (10, 0, 0).
/// let point = |i: u32| {
///     let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 500.0 - 1.0);
///     let r = (1.0 - z * z).sqrt();
///     [10.0 + 2.0 * r * t.cos(), 2.0 * r * t.sin(), 2.0 * z]
/// };
/// let scan = PointCloud::from_points((0..1000).map(point).collect());
/// let found = recognize_scan(&scan, &RecognizeOptions::default(), &Control::default())?;
/// let Quadric::Sphere { radius, .. } = found.recognition.entities[0].surface else { panic!() };
/// assert!((radius - 2.0).abs() < 1e-9);
/// # Ok::<(), isoform::RecognizeError>(())
/// ```
///
/// # Errors
/// [`RecognizeError`].
pub fn recognize_scan<'a>(
    scan: &'a PointCloud,
    options: &Options,
    control: &Control<'_>,
) -> Result<Recognized<'a>, RecognizeError> {
    check_corners(scan)?;
    if !scan.triangles.is_empty()
        && let Some(found) = recognize_facets(scan, ON_FACES, options, control)?
    {
        return Ok(Recognized {
            scan: Cow::Owned(with_points(scan, &found.inside)),
            recognition: found.recognition,
        });
    }
    Ok(Recognized {
        scan: Cow::Borrowed(scan),
        recognition: recognize(scan, options, control)?,
    })
}
