//! The parameters of a HyperFun program from a cloud in chunks that no machine holds whole.

use crate::fit_scan::{Posed, Task, has_clutter, hold, inner_options, posing};
use crate::template::{Outline, Rotation};
use crate::{
    FitOptions, FitScanError, FitScanWarning, FrepTemplate, HeldTemplate, ScanFit, TemplateError,
    fit_scan,
};
use isoform_control::Control;
use isoform_field::hyperfun::{Model, Pose};
use isoform_fit::chunks::{Chunks, Cloud, Question, answer, looked};
use isoform_fit::{FitError, Method, Scan, Template};
use isoform_geom::{Aabb, Point3, PointCloud, far_center, sub};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Whoever has the chunks, here or elsewhere.
pub trait ChunkSource: Sync {
    /// Number of chunks.
    fn len(&self) -> usize;
    /// Whether there is no chunk.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Passes a message to each chunk that there is one for, and its answer, which [`ChunkReader`]
    /// makes, to `each`, in the order of the chunks. False where a chunk has no answer: the fit
    /// ends soon, with [`FitError::Stopped`], and the source knows why.
    fn ask(
        &self,
        message: &mut dyn FnMut(usize) -> Option<Vec<u8>>,
        each: &mut dyn FnMut(usize, &[u8]),
    ) -> bool;
}

/// Answers messages to chunks: a program, and what it was last compiled to.
pub struct ChunkReader {
    model: Model,
    last: Mutex<Option<Compiled>>,
}

/// A recipe, and the template of it.
type Compiled = (Vec<f64>, Arc<FrepTemplate>);

/// Why a chunk has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AnswerError {
    /// The message is none of this version.
    #[error("the message is none of this version of Isoform")]
    Message,
    /// The chunk is not what it was.
    #[error("{found} points, where there were {expected} before")]
    Changed {
        /// Points now.
        found: usize,
        /// Points when it was looked at first.
        expected: u64,
    },
    /// The program is no template.
    #[error(transparent)]
    Template(#[from] TemplateError),
}

/// The number of points of a chunk that has not been looked at.
const UNKNOWN: u64 = u64::MAX;

impl ChunkReader {
    /// For the program of a fit.
    pub fn new(model: Model) -> Self {
        let last = Mutex::new(None);
        Self { model, last }
    }

    /// The answer of a chunk of these points, in the coordinates of their file.
    ///
    /// # Errors
    /// [`AnswerError`].
    pub fn answer(&self, message: &[u8], mut points: Vec<Point3>) -> Result<Vec<u8>, AnswerError> {
        let words: Vec<u64> = message
            .as_chunks()
            .0
            .iter()
            .map(|bytes| u64::from_le_bytes(*bytes))
            .collect();
        let (expected, words) = words.split_first().ok_or(AnswerError::Message)?;
        let found = points.len();
        if ![found as u64, UNKNOWN].contains(expected) {
            let expected = *expected;
            return Err(AnswerError::Changed { found, expected });
        }
        let (origin, recipe, question) = opened(words).ok_or(AnswerError::Message)?;
        if origin != [0.0; 3] {
            points.iter_mut().for_each(|p| *p = sub(*p, origin));
        }
        let template = self.template(recipe)?;
        Ok(bytes(&answer(&question, &points, &*template)))
    }

    /// The template of a recipe; without one that of the program as it is.
    fn template(&self, recipe: Vec<f64>) -> Result<Arc<FrepTemplate>, AnswerError> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, template)) = &*last
            && (recipe.is_empty() || *known == recipe)
        {
            return Ok(Arc::clone(template));
        }
        let template = if recipe.is_empty() {
            FrepTemplate::with_pose(&self.model, Pose::None, &[])
        } else {
            FrepTemplate::of_recipe(&self.model, &recipe).ok_or(AnswerError::Message)?
        };
        let template = Arc::new(template?);
        *last = Some((recipe, Arc::clone(&template)));
        Ok(template)
    }
}

/// The words of a message: how many points there are, what is subtracted from them, a recipe after
/// its length, a question.
fn message(count: u64, origin: Point3, recipe: &[f64], question: &Question) -> Vec<u8> {
    let mut words = vec![count];
    words.extend(origin.iter().map(|v| v.to_bits()));
    words.push(recipe.len() as u64);
    words.extend(recipe.iter().map(|v| v.to_bits()));
    words.extend(question.to_words());
    bytes(&words)
}

/// What [`message`] made words of, but for the first.
fn opened(words: &[u64]) -> Option<(Point3, Vec<f64>, Question)> {
    let (origin, rest) = words.split_first_chunk::<3>()?;
    let (count, rest) = rest.split_first()?;
    let (recipe, rest) = rest.split_at_checked(usize::try_from(*count).ok()?)?;
    let recipe = recipe.iter().map(|v| f64::from_bits(*v)).collect();
    Some((
        origin.map(f64::from_bits),
        recipe,
        Question::from_words(rest)?,
    ))
}

fn bytes(words: &[u64]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Chunks about an origin.
struct Located<'a> {
    source: &'a dyn ChunkSource,
    counts: Vec<usize>,
    /// The box of all points in the coordinates of their files.
    bounds: Aabb,
    origin: Point3,
    control: &'a Control<'a>,
}

impl Chunks for Located<'_> {
    fn counts(&self) -> &[usize] {
        &self.counts
    }
    fn ask(
        &self,
        template: Option<&dyn Template>,
        question: &mut dyn FnMut(usize) -> Option<Question>,
        each: &mut dyn FnMut(usize, &[u64]),
    ) -> bool {
        let recipe = template.map_or_else(Vec::new, Template::recipe);
        let mut sent = |chunk: usize| {
            let question = question(chunk)?;
            let is_first = question == Question::Look;
            let count = if is_first {
                UNKNOWN
            } else {
                self.counts[chunk] as u64
            };
            Some(message(count, self.origin, &recipe, &question))
        };
        let is_whole = self.source.ask(&mut sent, &mut |chunk, answer| {
            let words = answer.as_chunks().0.iter();
            let words: Vec<u64> = words.map(|bytes| u64::from_le_bytes(*bytes)).collect();
            each(chunk, &words);
        });
        if let (false, Some(flag)) = (is_whole, self.control.cancelled) {
            flag.store(true, Ordering::Relaxed);
        }
        is_whole
    }
}

impl<'a> Located<'a> {
    /// Looks at all chunks once.
    fn new(source: &'a dyn ChunkSource, control: &'a Control<'a>) -> Result<Self, FitScanError> {
        let mut located = Self {
            source,
            counts: vec![0; source.len()],
            bounds: Aabb::of(&[]),
            origin: [0.0; 3],
            control,
        };
        let (mut counts, mut bounds) = (located.counts.clone(), located.bounds);
        let is_whole = located.ask(None, &mut |_| Some(Question::Look), &mut |chunk, words| {
            let (count, its) = looked(words);
            counts[chunk] = count;
            for i in 0..3 {
                bounds.lo[i] = bounds.lo[i].min(its.lo[i]);
                bounds.hi[i] = bounds.hi[i].max(its.hi[i]);
            }
        });
        (located.counts, located.bounds) = (counts, bounds);
        if is_whole {
            Ok(located)
        } else {
            Err(FitError::Stopped.into())
        }
    }

    /// The box about the origin.
    fn relative_bounds(&self) -> Aabb {
        Aabb {
            lo: sub(self.bounds.lo, self.origin),
            hi: sub(self.bounds.hi, self.origin),
        }
    }
}

impl Outline for Located<'_> {
    fn moments(&self) -> Option<[f64; 9]> {
        Cloud::moments(self, self.relative_bounds().center())
    }
    fn bounds_along(&self, base: &Rotation) -> Aabb {
        Cloud::extents(self, base)
    }
}

/// Fits a HyperFun program to a cloud in chunks: what [`fit_scan`] finds of all their points, in
/// the order of the chunks, to rounding.
///
/// A cloud of no more points than the sample that the fit looks for neighbours in (200,000) is
/// gathered, and fitted to the last bit as if it had come in one. Of larger ones the sample is
/// gathered, and all else is sums over chunks ([`isoform_fit::chunks`]). Then the points of the
/// result, with their residuals, are the sample; triangles of meshes are not looked at; and clutter
/// beside the part is told of but not left out.
///
/// # Errors
/// [`FitScanError`]; the paper's methods, which see every point each time, are none for clouds in
/// chunks. [`FitError::Stopped`] where a chunk has no answer.
pub fn fit_chunks(
    source: &dyn ChunkSource,
    model: &Model,
    options: &FitOptions,
    control: &Control<'_>,
) -> Result<ScanFit, FitScanError> {
    let started = Instant::now();
    let mut located = Located::new(source, control)?;
    let count = located.counts.iter().sum();
    if count == 0 {
        return Err(FitScanError::NoPoints);
    }
    if Cloud::is_small(count) {
        let points = Cloud::gathered(&located).ok_or(FitError::Stopped)?;
        let cloud = PointCloud::from_points(points).recentred();
        return fit_scan(&cloud, model, options, control);
    }
    if u32::try_from(count).is_err() {
        return Err(FitScanError::TooMany { count });
    }
    if options.fit.method != Method::Default {
        return Err(FitScanError::Method);
    }
    located.origin = far_center(&located.bounds);
    let posed = posing(model, options, located.origin);
    let mut warnings = Vec::new();
    let mut template = HeldTemplate::new(posed(&located)?, located.origin);
    if located.origin != [0.0; 3] && !template.moves() {
        located.origin = [0.0; 3];
        warnings.push(FitScanWarning::FarAndFixed);
        template = HeldTemplate::new(posed(&located)?, located.origin);
    }
    hold(&mut template, options)?;
    let task = Task {
        options,
        inner: inner_options(&template, options)?,
        control,
        origin: located.origin,
        posed: &posed,
    };
    let prepared = started.elapsed().as_secs_f64();
    let (cloud, posed) = fitted(&located, &task, template)?;
    if has_clutter(&posed.fit) {
        warnings.push(FitScanWarning::ClutterFitted);
    }
    let mut seconds = vec![("template", prepared)];
    seconds.extend(posed.fit.seconds.iter().copied());
    Ok(ScanFit {
        cloud,
        bounds: located.relative_bounds(),
        template: posed.template,
        fit: posed.fit,
        warnings,
        seconds,
    })
}

/// The fit, and the sample that it looked for neighbours in.
fn fitted(
    located: &Located<'_>,
    task: &Task<'_>,
    template: HeldTemplate,
) -> Result<(PointCloud, Posed), FitScanError> {
    let mut cloud = Cloud::new(located, located.relative_bounds(), task.inner.seed)?;
    let scan = Scan::of_cloud(&mut cloud, &task.inner, task.control);
    let posed = task.fit_in_pose(&scan, located, template)?;
    let sample = PointCloud {
        origin: located.origin,
        ..PointCloud::from_points(scan.into_points())
    };
    Ok((sample, posed))
}
