//! Covering a surface: patches are added until all of it in the region lies on one (the future work
//! of Wurm, Jüttler and Kim 2003, section 5).
//!
//! The surface is represented by samples: random points of the region, projected. Each round starts
//! a few patches at uncovered samples that are far from the covered ones and from one another, and
//! grows them in parallel on the caller's rayon pool. At the end, redundant patches are removed.
//! The result depends neither on the number of threads nor on their timing.
//!
//! With a margin, samples must lie a little deeper inside patches than the margin; then the margin
//! is proved for the whole surface. Further patches are started where the proof fails.
//!
//! Terms: an *open* sample lies on no patch yet; a *seed* is the sample at which a patch starts; a
//! sample is *left out* if it lies near a singular point and no patch was found for it.

mod margin;
mod rounds;
mod samples;

use crate::options::{Covering, Error, Options};
use crate::parameterized::Parameterized;
use crate::progress::MonotoneProgress;
use crate::unit::UnitBox;
use crate::whole::Whole;
use isoform_control::Control;
use isoform_geom::{Aabb, Field, Parts, Point3};
use rounds::CoverState;

/// Result of the proof that the surface lies inside patches by a margin.
#[derive(Clone, Debug)]
pub struct Depth {
    /// Required depth, in model units.
    pub margin: f64,
    /// Upper bound on the distance from any point of the surface in the region to a point of a
    /// patch at that depth; `None` if some boxes are open.
    pub distance: Option<f64>,
    /// Boxes in which the depth could not be proved.
    pub open: Vec<Aabb>,
}

/// Patches and the part of the surface that they cover.
#[derive(Clone, Debug)]
pub struct Cover {
    /// The patches, in the order in which they were chosen.
    pub patches: Vec<Parameterized>,
    /// Number of surface points by which coverage was measured.
    pub samples: usize,
    /// Number of samples that lie on a patch within the tolerance and, with a margin, deep enough.
    pub covered: usize,
    /// Number of further samples, not counted in `samples`, that were left out near singular
    /// points.
    pub left_out: usize,
    /// Singular points around which samples were left out; of singular curves, sample points. Empty
    /// if nothing was left out.
    pub singular: Vec<Point3>,
    /// Radius around singular points within which samples may be left out, in model units.
    pub apart: f64,
    /// Result of the proof of the margin; `None` if no margin was required.
    pub depth: Option<Depth>,
}

impl Cover {
    /// Maps a cover from the unit box to model space; `field` returns the function of a part.
    fn out<'f>(
        self,
        unit: &UnitBox,
        covering: &Covering,
        field: impl Fn(usize) -> &'f dyn Field,
    ) -> Self {
        let out = |made: Parameterized| {
            let part = field(made.part);
            unit.made_out(made, part)
        };
        let depth = self.depth.map(|depth| Depth {
            margin: covering.margin.unwrap_or(0.0),
            distance: depth.distance.map(|d| unit.length_out(d)),
            open: depth.open.iter().map(|b| unit.region_out(b)).collect(),
        });
        Self {
            patches: self.patches.into_iter().map(out).collect(),
            singular: self.singular.into_iter().map(|p| unit.out(p)).collect(),
            apart: unit.length_out(self.apart),
            depth,
            ..self
        }
    }
}

/// Covers the surface in the region with patches that keep the tolerance.
///
/// Patches grow in parallel on the threads of the current rayon pool; the result does not depend on
/// their number. Once the control stops the work, no further patch is started, and the existing
/// patches cover a part of the surface. Progress is reported in the phases `samples`, `cover` and,
/// with a margin, `margin`.
///
/// ```
/// use isoform_control::Control;
/// use isoform_field::Polynomial;
/// use isoform_geom::Aabb;
/// use isoform_patch::{Covering, Options, cover, reached};
///
/// // The plane x + y + z = 0 in a box.
/// let plane = Polynomial::new([([1, 0, 0], 1.0), ([0, 1, 0], 1.0), ([0, 0, 1], 1.0)]);
/// let region = Aabb { lo: [-0.5, -0.5, -1.0], hi: [0.5, 0.5, 1.0] };
/// let options = Options::new((1, 1), 1e-3, region);
/// let made = cover(&plane, &options, &Covering::default(), &Control::default())?;
/// assert_eq!(made.covered, made.samples);
/// // The origin is one of the points that are covered.
/// assert!(made.patches.iter().any(|p| reached(&p.grown.patch, &[[0.0; 3]], 1e-3)[0]));
/// # Ok::<(), isoform_patch::Error>(())
/// ```
///
/// # Errors
/// Options that are out of range or without a tolerance, surfaces on which no patch is found, and
/// [`Error::Stopped`] if the control stopped the work before there was a patch.
pub fn cover(
    field: &dyn Field,
    options: &Options,
    covering: &Covering,
    control: &Control<'_>,
) -> Result<Cover, Error> {
    options.check()?;
    covering.check()?;
    let unit = UnitBox::new(&options.region);
    let (inside, options) = (unit.field(field), unit.options(options));
    let within = unit.covering(covering);
    let whole = Whole::of_field(&inside);
    MonotoneProgress::during(control, |control| {
        cover_whole(&whole, &options, &within, control)
    })
    .map(|cover| cover.out(&unit, covering, |_| field))
    .map_err(|error| unit.error_out(error))
}

/// Covers a surface of several parts: each patch stays on one part and ends at its edges. A margin
/// is measured but not proved, and points nearer to an edge than the margin may lie less deep. See
/// [`cover`].
///
/// # Errors
///
/// Those of [`cover`].
pub fn cover_parts(
    parts: &Parts,
    options: &Options,
    covering: &Covering,
    control: &Control<'_>,
) -> Result<Cover, Error> {
    options.check()?;
    covering.check()?;
    let unit = UnitBox::new(&options.region);
    let (inside, options) = (unit.parts(parts), unit.options(options));
    let whole = Whole::of_parts(&inside, &options.region);
    let within = unit.covering(covering);
    MonotoneProgress::during(control, |control| {
        cover_whole(&whole, &options, &within, control)
    })
    .map(|cover| {
        let field = |part: usize| parts.parts[part].field.as_ref();
        cover.out(&unit, covering, field)
    })
    .map_err(|error| unit.error_out(error))
}

fn cover_whole(
    whole: &Whole<'_>,
    options: &Options,
    covering: &Covering,
    control: &Control<'_>,
) -> Result<Cover, Error> {
    let mut work = CoverState::new(whole, options, covering, *control)?;
    // At most four sets of samples: each detects gaps between the samples of those before.
    work.cover_samples(4);
    if work.patches.is_empty() {
        control.check()?;
        return Err(work.last_error);
    }
    control.report("cover", 1.0);
    work.keep_needed();
    let depth = covering.margin.map(|margin| {
        if whole.is_single() {
            work.prove_margin(margin)
        } else {
            Depth {
                margin,
                distance: None,
                open: vec![options.region],
            }
        }
    });
    let (covered, left_out) = (work.covered(), work.left_out());
    Ok(Cover {
        samples: work.samples.len() - left_out,
        covered,
        left_out,
        singular: if left_out > 0 {
            work.singular
        } else {
            Vec::new()
        },
        apart: work.apart,
        depth,
        patches: work.patches.into_iter().map(|p| p.made).collect(),
    })
}
