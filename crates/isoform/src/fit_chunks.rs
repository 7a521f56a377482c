//! Fit of a HyperFun program to a cloud in chunks, which need not fit into one machine's memory.

use crate::fit_scan::{
    PosedFit, ScanTask, fix_parameters, has_clutter, inner_options, template_constructor,
};
use crate::template::{CloudExtent, Rotation};
use crate::{
    ConstrainedTemplate, FitOptions, FitScanError, FitScanWarning, FrepTemplate, ScanFit,
    TemplateError, fit_scan,
};
use isoform_control::Control;
use isoform_field::hyperfun::{Model, Pose};
use isoform_fit::chunks::{ChunkQuery, Chunks, Cloud, decode_count_and_bounds, evaluate_chunk};
use isoform_fit::{FitError, Method, Scan, Template};
use isoform_geom::{Aabb, Point3, PointCloud, recentering_origin, sub};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Owner of chunks of points, in this process or elsewhere.
pub trait ChunkSource: Sync {
    /// Returns the number of chunks.
    fn len(&self) -> usize;
    /// Returns true if the number of chunks is 0.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Calls `message` for each chunk; passes the message, if there is one, to the chunk, and its
    /// answer, which a [`ChunkReader`] computes, to `each`, in the order of the chunks. Returns
    /// false if a chunk has no answer: the fit then ends with [`FitError::Stopped`], and the source
    /// knows the reason.
    fn ask(
        &self,
        message: &mut dyn FnMut(usize) -> Option<Vec<u8>>,
        each: &mut dyn FnMut(usize, &[u8]),
    ) -> bool;
}

/// Reader that answers messages to chunks; it keeps a program, and the template that it last
/// compiled.
pub struct ChunkReader {
    model: Model,
    last: Mutex<Option<CompiledTemplate>>,
}

/// Recipe, and its template.
type CompiledTemplate = (Vec<f64>, Arc<FrepTemplate>);

/// Reason why a chunk has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AnswerError {
    /// The message is not of this version.
    #[error("the message is none of this version of Isoform")]
    Message,
    /// The number of points of the chunk has changed.
    #[error("{found} points, where there were {expected} before")]
    Changed {
        /// Number of points now.
        found: usize,
        /// Number of points in the first answer.
        expected: u64,
    },
    /// The program cannot be a template.
    #[error(transparent)]
    Template(#[from] TemplateError),
}

/// Marker of an unknown number of points of a chunk.
const UNKNOWN_POINT_COUNT: u64 = u64::MAX;

impl ChunkReader {
    /// Creates the reader for the program of a fit.
    pub fn new(model: Model) -> Self {
        let last = Mutex::new(None);
        Self { model, last }
    }

    /// Returns the answer of a chunk to a message; `points` are those of the chunk, in the
    /// coordinates of their file.
    ///
    /// # Errors
    /// [`AnswerError`] if the message is not valid, or the chunk has changed.
    pub fn answer(&self, message: &[u8], mut points: Vec<Point3>) -> Result<Vec<u8>, AnswerError> {
        let words: Vec<u64> = message
            .as_chunks()
            .0
            .iter()
            .map(|bytes| u64::from_le_bytes(*bytes))
            .collect();
        let (expected, words) = words.split_first().ok_or(AnswerError::Message)?;
        let found = points.len();
        if ![found as u64, UNKNOWN_POINT_COUNT].contains(expected) {
            let expected = *expected;
            return Err(AnswerError::Changed { found, expected });
        }
        let (origin, recipe, question) = parsed_message(words).ok_or(AnswerError::Message)?;
        if origin != [0.0; 3] {
            points.iter_mut().for_each(|p| *p = sub(*p, origin));
        }
        let template = self.template(recipe)?;
        Ok(bytes(&evaluate_chunk(&question, &points, &*template)))
    }

    /// Returns the template of a recipe; of an empty one, the program without a pose.
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
            FrepTemplate::from_recipe(&self.model, &recipe).ok_or(AnswerError::Message)?
        };
        let template = Arc::new(template?);
        *last = Some((recipe, Arc::clone(&template)));
        Ok(template)
    }
}

/// Returns a message: the number of points, the origin to subtract from them, the length of a
/// recipe and the recipe, and a question.
fn message(count: u64, origin: Point3, recipe: &[f64], question: &ChunkQuery) -> Vec<u8> {
    let mut words = vec![count];
    words.extend(origin.iter().map(|v| v.to_bits()));
    words.push(recipe.len() as u64);
    words.extend(recipe.iter().map(|v| v.to_bits()));
    words.extend(question.to_words());
    bytes(&words)
}

/// Splits the words of a [`message`] after the first into origin, recipe and question; `None` if
/// they are not valid.
fn parsed_message(words: &[u64]) -> Option<(Point3, Vec<f64>, ChunkQuery)> {
    let (origin, rest) = words.split_first_chunk::<3>()?;
    let (count, rest) = rest.split_first()?;
    let (recipe, rest) = rest.split_at_checked(usize::try_from(*count).ok()?)?;
    let recipe = recipe.iter().map(|v| f64::from_bits(*v)).collect();
    Some((
        origin.map(f64::from_bits),
        recipe,
        ChunkQuery::from_words(rest)?,
    ))
}

fn bytes(words: &[u64]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Chunks, relative to an origin.
struct LocatedChunks<'a> {
    source: &'a dyn ChunkSource,
    counts: Vec<usize>,
    /// Bounding box of all points in the coordinates of their files.
    bounds: Aabb,
    origin: Point3,
    control: &'a Control<'a>,
}

impl Chunks for LocatedChunks<'_> {
    fn counts(&self) -> &[usize] {
        &self.counts
    }
    fn ask(
        &self,
        template: Option<&dyn Template>,
        question: &mut dyn FnMut(usize) -> Option<ChunkQuery>,
        each: &mut dyn FnMut(usize, &[u64]),
    ) -> bool {
        let recipe = template.map_or_else(Vec::new, Template::recipe);
        let mut sent = |chunk: usize| {
            let question = question(chunk)?;
            let is_first = question == ChunkQuery::Look;
            let count = if is_first {
                UNKNOWN_POINT_COUNT
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

impl<'a> LocatedChunks<'a> {
    /// Asks all chunks for their numbers of points and bounding boxes.
    fn new(source: &'a dyn ChunkSource, control: &'a Control<'a>) -> Result<Self, FitScanError> {
        let mut located = Self {
            source,
            counts: vec![0; source.len()],
            bounds: Aabb::from_points(&[]),
            origin: [0.0; 3],
            control,
        };
        let (mut counts, mut bounds) = (located.counts.clone(), located.bounds);
        let is_whole = located.ask(
            None,
            &mut |_| Some(ChunkQuery::Look),
            &mut |chunk, words| {
                let (count, its) = decode_count_and_bounds(words);
                counts[chunk] = count;
                for i in 0..3 {
                    bounds.lo[i] = bounds.lo[i].min(its.lo[i]);
                    bounds.hi[i] = bounds.hi[i].max(its.hi[i]);
                }
            },
        );
        (located.counts, located.bounds) = (counts, bounds);
        if is_whole {
            Ok(located)
        } else {
            Err(FitError::Stopped.into())
        }
    }

    /// Returns the bounding box relative to the origin.
    fn relative_bounds(&self) -> Aabb {
        Aabb {
            lo: sub(self.bounds.lo, self.origin),
            hi: sub(self.bounds.hi, self.origin),
        }
    }
}

impl CloudExtent for LocatedChunks<'_> {
    fn moments(&self) -> Option<[f64; 9]> {
        Cloud::moments(self, self.relative_bounds().center())
    }
    fn bounds_along(&self, base: &Rotation) -> Aabb {
        Cloud::extents(self, base)
    }
}

/// Fits a HyperFun program to a cloud in chunks. The result is that of [`fit_scan`] for all their
/// points, in the order of the chunks, up to rounding.
///
/// A cloud of at most 200,000 points is gathered, and fitted like one that came in one piece, with
/// a result identical to the last bit. Of a larger cloud, a sample of that size is gathered, in
/// which the fit looks for neighbours; all other data are sums over chunks
/// ([`isoform_fit::chunks`]). The points and residuals of the result are then those of the sample,
/// triangles of meshes are ignored, and clutter next to the part is reported but not left out.
///
/// # Errors
/// [`FitScanError`] as for [`fit_scan`], for other methods than the default, as these need all
/// points in each step, and [`FitError::Stopped`] if a chunk has no answer.
pub fn fit_chunks(
    source: &dyn ChunkSource,
    model: &Model,
    options: &FitOptions,
    control: &Control<'_>,
) -> Result<ScanFit, FitScanError> {
    let started = Instant::now();
    let mut located = LocatedChunks::new(source, control)?;
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
    located.origin = recentering_origin(&located.bounds);
    let make_template = template_constructor(model, options, located.origin);
    let mut warnings = Vec::new();
    let mut template = ConstrainedTemplate::new(make_template(&located)?, located.origin);
    if located.origin != [0.0; 3] && !template.can_move() {
        located.origin = [0.0; 3];
        warnings.push(FitScanWarning::FarAndFixed);
        template = ConstrainedTemplate::new(make_template(&located)?, located.origin);
    }
    fix_parameters(&mut template, options)?;
    let task = ScanTask {
        options,
        inner: inner_options(&template, options)?,
        control,
        origin: located.origin,
        make_template: &make_template,
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

/// Returns the fit, and the sample in which it looked for neighbours.
fn fitted(
    located: &LocatedChunks<'_>,
    task: &ScanTask<'_>,
    template: ConstrainedTemplate,
) -> Result<(PointCloud, PosedFit), FitScanError> {
    let mut cloud = Cloud::new(located, located.relative_bounds(), task.inner.seed)?;
    let scan = Scan::of_cloud(&mut cloud, &task.inner, task.control);
    let posed = task.fit_in_pose(&scan, located, template)?;
    let sample = PointCloud {
        origin: located.origin,
        ..PointCloud::from_points(scan.into_points())
    };
    Ok((sample, posed))
}
