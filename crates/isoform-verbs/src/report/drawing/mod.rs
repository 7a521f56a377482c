//! The drawing of a fitted model: views of it in its own frame, with its dimensions, and the points
//! of the scan that can be seen in the views.
//!
//! No mesh is made: each view is traced by parallel rays ([`picture`]), lines are found between
//! rays that meet different faces ([`outline`]), and what a parameter measures is read off the
//! motion of the surface when it grows ([`dimensions`]). The [`sheet`]s put views, lines and
//! dimensions on paper.

mod dimensions;
mod outline;
mod picture;
mod sheet;
mod subject;

use crate::fit::job::Job;
use isoform::fit::Template;
use outline::OutlineLine;
use picture::{CUT, Picture, Tracer, View};
use rayon::prelude::*;
use subject::{DrawnModel, Sample, Shell};

/// Pixels along the longest side of a view. Lines are found within 1/32 of a pixel; features below
/// one may be missed. The time grows with the square: 0.1 s for a simple part.
const PIXELS: f64 = 160.0;
/// Pixels along the longest side for programs that run line by line, which is some hundred times
/// slower.
const FEW_PIXELS: f64 = 56.0;

/// A view with its lines.
struct Drawn {
    picture: Picture,
    lines: Vec<OutlineLine>,
}

/// Everything that is drawn of a model.
struct Drawing<'a> {
    /// The fit.
    job: &'a Job,
    /// The fitted model.
    subject: DrawnModel<'a>,
    /// Points of its surface.
    samples: Vec<Sample>,
    /// From above.
    top: Drawn,
    /// From the front.
    front: Drawn,
    /// View from the side; `None` if it shows no more than the view from the front.
    side: Option<Drawn>,
    /// Section; `None` for a model without holes and hollows in its middle plane.
    section: Option<Drawn>,
    /// Isometric, from above.
    above: Drawn,
    /// Isometric, from below and behind.
    below: Drawn,
}

/// Draws the sheet with the dimensions and the sheet with the points; `None` if the model has no
/// surface near the data.
pub(crate) fn sheets(job: &Job, limit: f64) -> Option<[String; 2]> {
    let subject = DrawnModel::new(job);
    let shell = subject.shell()?;
    let samples = subject.project(&shell);
    let section = View {
        name: "Section",
        axes: "x →, z ↑",
        cut: Some(-middle_of(&shell)),
        ..View::FRONT
    };
    let views = [
        View::FRONT,
        View::SIDE,
        View::TOP,
        View::ABOVE,
        View::BELOW,
        section,
    ];
    let all: Vec<Option<Drawn>> = views
        .into_par_iter()
        .map(|view| drawn(&subject, &shell, view))
        .collect();
    let [front, side, top, above, below, section] = <[Option<Drawn>; 6]>::try_from(all).ok()?;
    let (front, side) = (front?, side?);
    let drawing = Drawing {
        job,
        side: (!is_alike(&front.picture, &side.picture)).then_some(side),
        section: section.filter(|s| tells_more(&s.picture, &front.picture)),
        top: top?,
        front,
        above: above?,
        below: below?,
        samples,
        subject,
    };
    let values = job.found.fit.values();
    let own = job.found.template.frep.model().n_params();
    let forms = dimensions::forms(
        &drawing.subject,
        &drawing.samples,
        &job.found.template as &dyn Template,
        &values,
        own,
    );
    Some([
        sheet::dimensioned(&drawing, &forms),
        sheet::with_points(&drawing, limit),
    ])
}

/// Draws a view with its lines; `None` if its rays miss the model.
fn drawn(subject: &DrawnModel<'_>, shell: &Shell, view: View) -> Option<Drawn> {
    let tracer = Tracer::new(subject, shell, view);
    let most = if subject.is_slow { FEW_PIXELS } else { PIXELS };
    let (lo, hi) = view.extent(&shell.region);
    let pixel = (hi[0] - lo[0]).max(hi[1] - lo[1]) / most;
    let picture = Picture::new(&tracer, pixel);
    picture.bounds()?;
    let lines = outline::lines(&picture, &tracer);
    Some(Drawn { picture, lines })
}

/// Returns the position of the section: the middle of the frame if the model lies around it, else
/// the middle of the model.
fn middle_of(shell: &Shell) -> f64 {
    let (lo, hi) = (shell.region.lo[1], shell.region.hi[1]);
    let share = -lo / (hi - lo);
    if (0.3..0.7).contains(&share) {
        0.0
    } else {
        0.5 * (lo + hi)
    }
}

/// Maximum share of sampled places in which two equal pictures may differ by chance.
const CHANCE: f64 = 0.01;
/// Places across and up at which two views are compared.
const PLACES: usize = 80;

/// Returns true if two views look alike, as the views of a turned part do.
fn is_alike(a: &Picture, b: &Picture) -> bool {
    let (Some(own), Some(other)) = (a.bounds(), b.bounds()) else {
        return false;
    };
    let apart = own.iter().zip(other).map(|(x, y)| (x - y).abs());
    if apart.fold(0.0, f64::max) > 1.5 * a.pixel {
        return false;
    }
    let place = |k: usize, lo: f64, hi: f64| lo + (hi - lo) * (k as f64 + 0.5) / PLACES as f64;
    let differs = |i: usize| {
        let at = [
            place(i % PLACES, own[0], own[1]),
            place(i / PLACES, own[2], own[3]),
        ];
        match (a.seen(at), b.seen(at)) {
            (Some(a), Some(b)) => isoform::geom::dot(a.normal, b.normal) < 0.95,
            (None, None) => false,
            _ => true,
        }
    };
    let n = PLACES * PLACES;
    let count = (0..n).filter(|i| differs(*i)).count();
    // Outlines may lie half a pixel apart.
    (count as f64) < 2.0 * CHANCE * n as f64
}

/// Returns true if the section is more than the silhouette filled.
fn tells_more(section: &Picture, front: &Picture) -> bool {
    let open = section
        .hits
        .iter()
        .zip(&front.hits)
        .filter(|(s, f)| f.is_some() && s.is_none_or(|s| s.part != CUT));
    open.count() as f64 > CHANCE * front.hits.len() as f64
}
