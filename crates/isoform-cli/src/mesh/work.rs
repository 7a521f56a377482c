//! The one way to a mesh, for `mesh` and `recover`: model, solid, mesh, certificate.

use super::Settings;
use super::files::Written;
use super::sizes;
use crate::interrupt;
use crate::output::{Context, DONE, Failure, NO_RESULT, PARTIAL};
use crate::progress::Progress;
use isoform::check::{Certificate, Limits};
use isoform::field::SolidError;
use isoform::field::hyperfun::Model;
use isoform::geom::{Mesh, Point3, Solid};
use isoform::mesh::features::ExtentError;
use isoform::mesh::{Control, MeshError, Meshed, Options, Warning, mean_edge, own_sizes};
use isoform::{certified_adaptation, certified_mesh};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// What to mesh.
#[derive(Debug)]
pub(crate) struct Subject {
    /// For messages.
    pub(crate) name: String,
    pub(crate) model: Model,
    pub(crate) values: Vec<f64>,
    /// Unit of its lengths.
    pub(crate) unit: Option<String>,
}

/// A mesh with all that is known of it.
pub(crate) struct Made {
    pub(crate) name: String,
    pub(crate) object: String,
    pub(crate) values: Vec<f64>,
    pub(crate) unit: Option<String>,
    pub(crate) options: Options,
    pub(crate) meshed: Meshed,
    pub(crate) certificate: Certificate,
    /// Where the mesh may not be what was asked for.
    pub(crate) warnings: Vec<Warning>,
    /// What else is good to know.
    pub(crate) notes: Vec<&'static str>,
    pub(crate) written: Vec<Written>,
    /// Seconds by phase.
    pub(crate) seconds: Vec<(String, f64)>,
}

impl Made {
    /// 0, or 3 where the certificate fails or something was left open, or 130.
    pub(crate) fn exit(&self) -> u8 {
        match () {
            () if interrupt::happened() => interrupt::INTERRUPTED,
            () if self.certificate.is_ok() && self.warnings.is_empty() => DONE,
            () => PARTIAL,
        }
    }
    /// Says all warnings on stderr.
    pub(crate) fn say(&self, context: &Context) {
        self.warnings.iter().for_each(|w| context.warn(sentence(w)));
        self.notes.iter().for_each(|n| context.warn(n));
    }
}

/// A warning with its place.
fn sentence(warning: &Warning) -> String {
    match warning.at {
        Some([x, y, z]) => format!("{} at ({x}, {y}, {z})", warning.message),
        None => warning.message.clone(),
    }
}

/// Phases as they come, each with the time it took.
struct Phases {
    started: Mutex<Vec<(String, Instant)>>,
    progress: Progress,
}

/// All phases in their order, for the bar.
const PHASES: [&str; 15] = [
    "check",
    "extent",
    "lattice",
    "features",
    "sizes",
    "surface",
    "optimisation",
    "assembly",
    "second order",
    "checking tetrahedra",
    "measuring tetrahedra",
    "checking the surface",
    "looking for self-intersections",
    "measuring distances",
    "looking for features",
];

impl Phases {
    fn new(context: &Context) -> Self {
        Self {
            started: Mutex::default(),
            progress: Progress::new(context),
        }
    }
    fn enter(&self, phase: &str) {
        self.started
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push((phase.to_owned(), Instant::now()));
        if let Some(i) = PHASES.iter().position(|p| *p == phase) {
            self.progress.show(phase, i as f64 / PHASES.len() as f64);
        }
    }
    /// Seconds of each; the last one lasts until now.
    fn seconds(self) -> Vec<(String, f64)> {
        let started = self
            .started
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let ends = started
            .iter()
            .skip(1)
            .map(|s| s.1)
            .chain(std::iter::once(Instant::now()));
        let took = started
            .iter()
            .zip(ends)
            .map(|((name, start), end)| (name.clone(), (end - *start).as_secs_f64()));
        took.filter(|(name, _)| name != "done").collect()
    }
}

/// Meshes a model and certifies the mesh.
pub(crate) fn make(
    subject: &Subject,
    settings: &Settings,
    given: Option<&Mesh>,
    context: &Context,
) -> Result<Made, Failure> {
    let name = &subject.name;
    let phases = Phases::new(context);
    phases.enter("model");
    let (solid, is_run) =
        isoform::solid_of(&subject.model, &subject.values).map_err(|e| no_solid(&e, name))?;
    let solid = solid.as_ref();
    if is_run && settings.region.is_none() {
        // Nothing bounds such a program: the search for its box would have to look everywhere.
        let message =
            format!("{name}: the program is no expression, so that its box cannot be found");
        return Err(Failure::usage(message)
            .why("a loop or an index depends on the point")
            .hint("--box=-1,-1,-1,1,1,1 around it"));
    }
    let show = |phase: &str, _: f64| phases.enter(phase);
    let control = Control {
        cancelled: Some(interrupt::watch()),
        deadline: context.deadline,
        progress: Some(&show),
    };
    let mut options =
        options(solid, settings, given, &control).map_err(|e| failure(&e, name, None))?;
    options.sizes = settings
        .sizes
        .as_deref()
        .map(|path| sizes::read(path, context))
        .transpose()?;
    if let Some(mesh) =
        given.filter(|m| m.tets.is_empty() && settings.size.is_none() && settings.sizes.is_none())
    {
        // A surface keeps its smaller triangles where it has them.
        options.sizes = Some(own_sizes(mesh));
    }
    let limits = settings.angles.map_or(Limits::default(), |a| Limits {
        dihedral_min: a.0[0],
        dihedral_max: a.0[1],
        ..Limits::default()
    });
    let made = match given {
        Some(mesh) => certified_adaptation(mesh, solid, &options, limits, &control),
        None => certified_mesh(solid, &options, limits, &control),
    };
    let (meshed, certificate) = made.map_err(|e| failure(&e, name, Some(&options)))?;
    let warnings = warnings(&meshed, is_run);
    let notes = notes(&meshed, &certificate);
    Ok(Made {
        name: name.clone(),
        object: subject.model.name().to_owned(),
        values: subject.values.clone(),
        unit: subject.unit.clone(),
        options,
        meshed,
        certificate,
        warnings,
        notes,
        written: Vec::new(),
        seconds: phases.seconds(),
    })
}

/// Longest edges of a surface that keeps its own sizes, in mean lengths: the long triangles of CAD
/// systems do not stay.
const LONGEST: f64 = 1.5;

fn options(
    solid: &dyn Solid,
    settings: &Settings,
    given: Option<&Mesh>,
    control: &Control<'_>,
) -> Result<Options, MeshError> {
    let usual = Options::default();
    Ok(Options {
        size: match (settings.size, given) {
            (Some(size), _) => size,
            (None, Some(mesh)) if mesh.tets.is_empty() => LONGEST * mean_edge(mesh),
            (None, Some(mesh)) => mean_edge(mesh),
            (None, None) => isoform::default_size_within(solid, settings.region, control)?,
        },
        grade: settings.grade,
        sizes: None,
        order: settings.order.unwrap_or(usual.order),
        surface_only: settings.surface_only,
        region: settings.region,
        angles: settings.angles.map_or(usual.angles, |a| a.0),
        memory: settings
            .memory
            .map_or(usual.memory, |gib| (gib * f64::from(1 << 30)) as u64),
    })
}

/// What the mesher says, and that nothing is proved of programs that are run.
fn warnings(meshed: &Meshed, is_run: bool) -> Vec<Warning> {
    let mut warnings = meshed.warnings.clone();
    if is_run {
        let message = "the program is no expression: it was meshed as one smooth part, its edges are rounded and nothing is proved";
        warnings.push(Warning {
            message: message.to_owned(),
            at: None,
        });
    }
    warnings
}

fn notes(meshed: &Meshed, certificate: &Certificate) -> Vec<&'static str> {
    let mut notes = Vec::new();
    let is_pinched = certificate
        .surface
        .as_ref()
        .is_some_and(|s| !s.pinched_nodes.is_empty() || !s.crowded_edges.is_empty());
    if is_pinched {
        notes.push(
            "bodies touch without crossing: the solid has no surface there that a mesh could \
             follow; move them apart, or into each other",
        );
    }
    if !meshed.caps.is_empty() {
        notes.push("the box cuts the solid: the cuts are parts named cap");
    }
    if !meshed.region_certified {
        notes.push("nothing more of the solid was found far outside of its box, but that is not proved; --box says where to look");
    }
    if !meshed.features.certified {
        notes.push(
            "it is not proved that every feature curve was found; a smaller --size looks closer",
        );
    }
    notes
}

fn no_solid(error: &SolidError, name: &str) -> Failure {
    let message = format!("{name}: {error}");
    match error {
        SolidError::NoSurface { inside: true } => Failure::new(NO_RESULT, "unbounded", message)
            .hint("inside is where f >= 0: a sign, perhaps"),
        SolidError::NoSurface { inside: false } => Failure::new(NO_RESULT, "empty", message)
            .hint("inside is where f >= 0: a sign, or other --params"),
        SolidError::Dimension { .. } => {
            Failure::input("dimension", message).hint("--object with one of three coordinates")
        }
        _ => Failure::input("model", message),
    }
}

/// Why there is no mesh.
fn failure(error: &MeshError, name: &str, options: Option<&Options>) -> Failure {
    let none = |code| Failure::new(NO_RESULT, code, format!("{name}: {error}"));
    match error {
        MeshError::Extent(ExtentError::Empty { .. })
            if options.is_some_and(|o| o.region.is_some()) =>
        {
            none("empty")
                .why("nothing of it lies in the --box")
                .hint("another --box, or none")
        }
        MeshError::Extent(ExtentError::Empty { certified }) => {
            let why = if *certified {
                "intervals prove f < 0 within a million units"
            } else {
                "no point with f >= 0 was found"
            };
            none("empty")
                .why(why)
                .hint("other --params, or isoform eval to see values; inside is where f >= 0")
        }
        MeshError::Extent(ExtentError::Unbounded { .. }) => {
            none("unbounded").hint("--box=-1,-1,-1,1,1,1 to cut it off there")
        }
        MeshError::Extent(ExtentError::Start { .. }) => {
            Failure::usage(format!("{name}: {error}")).hint("a smaller --box")
        }
        MeshError::Option { name, .. } => {
            Failure::usage(error.to_string()).hint(format!("--{name}"))
        }
        MeshError::Memory {
            size,
            needed,
            allowed,
        } => {
            let fits = size * (*needed as f64 / (*allowed).max(1) as f64).cbrt();
            none("memory").hint(format!("--size {fits:.2}, or --memory with more GiB"))
        }
        MeshError::NotANumber { at } | MeshError::Extent(ExtentError::NotANumber { at }) => {
            none("not-a-number")
                .somewhere(*at)
                .hint("--box around the part where it is one")
        }
        MeshError::TooCoarse { .. } => none("too-coarse").hint(finer(options)),
        MeshError::Input { .. } => Failure::input("mesh", format!("{name}: {error}"))
            .hint("tetrahedra, or a closed surface of triangles, near the model"),
        MeshError::Internal { what } => Failure::internal("mesh").why(what),
        MeshError::Stopped | MeshError::Extent(ExtentError::Stopped) if interrupt::happened() => {
            Failure::new(interrupt::INTERRUPTED, "interrupted", error.to_string())
        }
        MeshError::Stopped | MeshError::Extent(ExtentError::Stopped) => none("time-limit")
            .why("the time limit was over before there was a mesh")
            .hint("a longer --time-limit, or a larger --size"),
    }
}

fn finer(options: Option<&Options>) -> String {
    options.map_or("a smaller --size".to_owned(), |o| {
        format!("--size {}", 0.5 * o.size)
    })
}

/// Where something is, in words.
pub(crate) fn place(at: Point3) -> String {
    format!("({}, {}, {})", at[0], at[1], at[2])
}
