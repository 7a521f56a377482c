//! Covering: patches until all of the surface in the region lies on one (the future work of Wurm,
//! Jüttler and Kim 2003, section 5).
//!
//! The surface is known by samples: random places of the region, projected. Each round starts a few
//! patches at uncovered samples far from what is covered and from one another, grown side by side
//! on the threads of the rayon pool in which the caller runs; in the end, patches that others make
//! superfluous are left out. The result depends neither on the number of threads nor on the time
//! that they take.
//!
//! With a margin, samples have to lie as deep inside of patches, and a little deeper; then that is
//! proved of the whole surface. Where the proof fails, other patches are started.
//!
//! Words: an *open* sample lies on no patch yet; a *seed* is the sample at which a patch starts; a
//! sample is *left out* if it lies near a singular point and no patch was found for it.

mod margin;
mod rounds;
mod samples;

use crate::options::{Covering, Error, Options};
use crate::parameterized::Parameterized;
use crate::progress::Rising;
use crate::unit::UnitBox;
use crate::whole::Whole;
use isoform_control::Control;
use isoform_geom::{Aabb, Field, Parts, Point3};
use rounds::Work;

/// Sets of samples that are covered in turn.
const MOST_ROUNDS: usize = 4;

/// What is known of the depth at which the surface lies inside of patches.
#[derive(Clone, Debug)]
pub struct Depth {
    /// The depth asked for.
    pub margin: f64,
    /// If all of the surface in the region is proved to be as deep: no point of it is farther than
    /// this from the place of its patch that is as deep.
    pub distance: Option<f64>,
    /// Boxes for which that could not be proved.
    pub open: Vec<Aabb>,
}

/// Patches with what they cover.
#[derive(Clone, Debug)]
pub struct Cover {
    /// The patches, in the order in which they were chosen.
    pub patches: Vec<Parameterized>,
    /// Points of the surface by which coverage was measured.
    pub samples: usize,
    /// How many of them lie on a patch, within the tolerance, and, with a margin, as deep.
    pub covered: usize,
    /// Samples besides that were left out near singular points.
    pub left_out: usize,
    /// Singular points, if something was left out about them: of curves of such points, some.
    pub singular: Vec<Point3>,
    /// What was left out is nearer than this to one of them.
    pub apart: f64,
    /// With a margin, what was proved of it.
    pub depth: Option<Depth>,
}

impl Cover {
    /// A cover made in the unit box, in space; `field` gives the functions of parts.
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
/// Patches grow side by side on the threads of the current rayon pool; the result does not depend
/// on their number. Once the control ends the work, no patch is started any more: those that there
/// are cover a part of the surface. The control hears of the phases `samples`, `cover` and, with a
/// margin, `margin`.
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
/// [`Error::Stopped`] where the control ended the work before there was one.
pub fn cover(
    field: &dyn Field,
    options: &Options,
    covering: &Covering,
    control: &Control<'_>,
) -> Result<Cover, Error> {
    options.check()?;
    covering.check()?;
    let unit = UnitBox::of(&options.region);
    let (inside, options) = (unit.field(field), unit.options(options));
    let within = unit.covering(covering);
    let whole = Whole::of_field(&inside);
    Rising::during(control, |control| {
        cover_whole(&whole, &options, &within, control)
    })
    .map(|cover| cover.out(&unit, covering, |_| field))
    .map_err(|error| unit.error_out(error))
}

/// Covers a surface of parts: each patch stays on one, and ends at its edges. Nothing is proved of
/// a margin then, and points nearer to an edge than that may lie less deep. See [`cover`].
///
/// # Errors
/// Those of [`cover`].
pub fn cover_parts(
    parts: &Parts,
    options: &Options,
    covering: &Covering,
    control: &Control<'_>,
) -> Result<Cover, Error> {
    options.check()?;
    covering.check()?;
    let unit = UnitBox::of(&options.region);
    let (inside, options) = (unit.parts(parts), unit.options(options));
    let whole = Whole::of_parts(&inside, &options.region);
    let within = unit.covering(covering);
    Rising::during(control, |control| {
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
    let mut work = Work::new(whole, options, covering, *control)?;
    work.cover_samples(MOST_ROUNDS);
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
