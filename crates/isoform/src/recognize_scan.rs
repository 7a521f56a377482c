//! Recognition of surfaces in scans.

use crate::CornerError;
use crate::facets::{FacesError, check_corners, points_on_faces, with_points};
use crate::fit_scan::MAX_LEFT_OUT_SHARE;
use isoform_control::{Control, Stopped};
use isoform_fit::{FitError, Scan};
use isoform_geom::{Point3, PointCloud};
use isoform_num::Random;
use isoform_recognize::{
    Error, LabelsError, Options, Proposal, ProposeError, Recognition, Snap, propose, recognize,
    recognize_facets, snap,
};
use std::borrow::Cow;

/// Approximate number of points that are sampled on the faces of a CAD mesh. Fewer leave small
/// faces without points, more take longer.
const FACE_SAMPLES: usize = 20_000;

/// Reason why recognition in a scan failed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecognizeError {
    /// A triangle has a corner that is not the index of a point.
    #[error(transparent)]
    Corner(#[from] CornerError),
    /// The recognition has no result.
    #[error(transparent)]
    Stage(#[from] Error),
    /// Labels given by hand become no entities.
    #[error(transparent)]
    Labels(LabelsError),
}

impl From<LabelsError> for RecognizeError {
    fn from(error: LabelsError) -> Self {
        match error {
            LabelsError::Scan(error) => error.into(),
            error => Self::Labels(error),
        }
    }
}

impl From<FacesError> for RecognizeError {
    fn from(error: FacesError) -> Self {
        match error {
            FacesError::Corner(error) => error.into(),
            FacesError::Stopped(stopped) => Error::from(stopped).into(),
        }
    }
}

/// Result of recognition, with the points in which it was made.
#[derive(Clone, Debug)]
pub struct Recognized<'a> {
    /// Points of the scan; of a CAD mesh, followed by points inside its faces.
    pub scan: Cow<'a, PointCloud>,
    /// Recognised surfaces, and their labels of these points.
    pub recognition: Recognition,
    /// Planes on which the part stands, whose points were left out: a point and the unit normal of
    /// each. They close a template where no face was scanned.
    pub supports: Vec<(Point3, Point3)>,
}

impl Recognized<'_> {
    /// Copies the points, if they are borrowed.
    pub fn into_owned(self) -> Recognized<'static> {
        Recognized {
            scan: Cow::Owned(self.scan.into_owned()),
            recognition: self.recognition,
            supports: self.supports,
        }
    }

    /// Proposes a HyperFun template of the surfaces, for [`fit_scan`](crate::fit_scan) to refine.
    ///
    /// # Errors
    /// [`ProposeError`] if the surfaces do not bound a solid, or on a stop.
    pub fn template(&self, title: &str, control: &Control<'_>) -> Result<Proposal, ProposeError> {
        propose(
            &self.scan,
            &self.recognition,
            &self.supports,
            title,
            control,
        )
    }

    /// Refits all surfaces together so that their relations hold exactly; returns the changes.
    ///
    /// # Errors
    /// [`Stopped`]; then nothing is changed.
    pub fn snap(&mut self, control: &Control<'_>) -> Result<Snap, Stopped> {
        let (recognition, snap) = snap(&self.scan, &self.recognition, control)?;
        self.recognition = recognition;
        Ok(snap)
    }
}

/// Recognises planes, spheres, cylinders, cones and tori in a scan or a CAD mesh.
///
/// A mesh most of whose facets are chords of such surfaces, with their vertices on them, is one of
/// a CAD model, and its triangles are used; of other meshes only the vertices are, as a cloud.
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
/// [`RecognizeError`] if a triangle is not valid, there are too few points, or on a stop.
pub fn recognize_scan<'a>(
    scan: &'a PointCloud,
    options: &Options,
    control: &Control<'_>,
) -> Result<Recognized<'a>, RecognizeError> {
    check_corners(scan)?;
    if !scan.triangles.is_empty()
        && let Some(found) = recognize_facets(scan, FACE_SAMPLES, options, control)?
    {
        return Ok(Recognized {
            scan: Cow::Owned(with_points(scan, &found.inside)),
            recognition: found.recognition,
            supports: Vec::new(),
        });
    }
    Ok(Recognized {
        scan: Cow::Borrowed(scan),
        recognition: recognize(scan, options, control)?,
        supports: Vec::new(),
    })
}

/// Scan without the planes on which its part stands.
#[derive(Clone, Debug)]
pub struct SeparatedPart {
    /// Points that are left.
    pub part: PointCloud,
    /// Planes on which the part stands: a point and the unit normal of each, in the file's
    /// coordinates.
    pub supports: Vec<(Point3, Point3)>,
    /// Indices of these points in the scan.
    pub kept: Vec<u32>,
    /// Number of points left out.
    pub left_out: usize,
}

/// Removes the planes that have the other points on one side and extend beyond them all round, such
/// as the table under a part. `None` if there are none, or if few points would be left; also for
/// CAD meshes.
///
/// # Errors
/// [`FacesError`] if a triangle is not valid, or on a stop.
pub fn without_supports(
    scan: &PointCloud,
    control: &Control<'_>,
) -> Result<Option<SeparatedPart>, FacesError> {
    if points_on_faces(scan, FACE_SAMPLES, control)?.is_some() {
        return Ok(None);
    }
    let ready = match Scan::new(&scan.points, &isoform_fit::Options::default(), control) {
        Ok(ready) => ready,
        Err(FitError::Stopped) => return Err(FacesError::Stopped(Stopped)),
        Err(_) => return Ok(None),
    };
    let clutter = ready.clutter();
    let is_part = |i: &u32| !clutter.is_on_support(scan.points[*i as usize]);
    let kept: Vec<u32> = (0..scan.points.len() as u32).filter(is_part).collect();
    let is_most = kept.len() as f64 >= (1.0 - MAX_LEFT_OUT_SHARE) * scan.points.len() as f64;
    if kept.len() == scan.points.len() || !is_most {
        return Ok(None);
    }
    let absolute =
        |(at, normal): (Point3, Point3)| (std::array::from_fn(|k| at[k] + scan.origin[k]), normal);
    Ok(Some(SeparatedPart {
        left_out: scan.points.len() - kept.len(),
        part: scan.select(&kept),
        kept,
        supports: clutter.supports().map(absolute).collect(),
    }))
}

/// Returns about `wanted` points of a scan, drawn at random with a fixed seed; `None` if it has no
/// more points than that.
pub fn sample_of(scan: &PointCloud, wanted: usize) -> Option<PointCloud> {
    let count = scan.points.len();
    if count <= wanted {
        return None;
    }
    let mut random = Random::new(1);
    let share = wanted as f64 / count as f64;
    let drawn: Vec<u32> = (0..count as u32)
        .filter(|_| random.unit() < share)
        .collect();
    Some(scan.select(&drawn))
}
