//! The one way to a mesh, for `mesh` and `recover`: model, solid, mesh, certificate.

use super::regions::NamedRegion;
use super::settings::Settings;
use super::sizes;
use crate::context::Context;
use crate::failure::{Failure, NO_RESULT};
use crate::outcome;
use crate::progress::Progress;
use isoform::check::Limits;
use isoform::field::SolidError;
use isoform::field::hyperfun::Model;
use isoform::geom::{Mesh, Point3};
use isoform::mesh::features::ExtentError;
use isoform::mesh::{MeshError, Options, Warning};
use isoform::report::brief;
use isoform::{
    Control, Implicit, MeshModelError, MeshModelOptions, ModelMesh, RegionModel, Unseen,
    adapt_to_model, mesh_model_regions, mesh_spline,
};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Input of the mesher: a shape with its name.
#[derive(Debug)]
pub(crate) struct MeshInput {
    /// For messages.
    pub(crate) name: String,
    pub(crate) shape: Shape,
    /// The regions that a program is to be meshed in; none for one.
    pub(crate) regions: Vec<NamedRegion>,
    /// Unit of its lengths.
    pub(crate) unit: Option<String>,
}

/// Shape that can be meshed.
#[derive(Debug)]
pub(crate) enum Shape {
    /// A program with the values of its parameters.
    Model(Box<Model>, Vec<f64>),
    /// A function fitted to points.
    Spline(Box<Implicit>, Unseen),
}

/// A mesh with all that is known of it.
pub(crate) struct MadeMesh {
    pub(crate) name: String,
    /// Object of the program that was meshed.
    pub(crate) object: String,
    /// Values of the parameters.
    pub(crate) values: Vec<f64>,
    /// Unit of its lengths.
    pub(crate) unit: Option<String>,
    /// The mesh with its certificate.
    pub(crate) mesh: ModelMesh,
    /// Files that it went to.
    pub(crate) written: Vec<Written>,
    /// Seconds by phase.
    pub(crate) seconds: Vec<(String, f64)>,
}

impl MadeMesh {
    /// 0, or 3 where the certificate fails or something was left open, or 130.
    pub(crate) fn exit(&self) -> u8 {
        outcome::exit(self.mesh.is_as_asked())
    }
    /// Says all warnings on stderr.
    pub(crate) fn say(&self, context: &Context) {
        for warning in &self.mesh.meshed.warnings {
            context.warn(sentence(warning));
        }
        for note in self.mesh.notes() {
            context.warn(note);
        }
    }
}

/// A warning with its place.
fn sentence(warning: &Warning) -> String {
    match warning.at {
        Some([x, y, z]) => format!("{} at ({x}, {y}, {z})", warning.kind),
        None => warning.kind.to_string(),
    }
}

/// A file that was written.
pub(crate) struct Written {
    pub(crate) path: String,
    pub(crate) format: &'static str,
    /// Data that the format cannot hold.
    pub(crate) warnings: Vec<String>,
}

/// Phases as they come, each with the time it took.
pub(crate) struct Phases<'c> {
    /// Phases with the time at which each began.
    started: Mutex<Vec<(String, Instant)>>,
    progress: Progress<'c>,
}

/// All phases in their order, for the bar.
const PHASES: [&str; 21] = [
    "check",
    "extent",
    "lattice",
    "features",
    "sizes",
    "surface",
    "optimisation",
    "assembly",
    "second order",
    "layers",
    "checking tetrahedra",
    "measuring tetrahedra",
    "checking the surface",
    "looking for self-intersections",
    "measuring distances",
    "looking for features",
    "recognition",
    "faces",
    "cuts",
    "edges",
    "checking the solid",
];

impl<'c> Phases<'c> {
    pub(crate) fn new(context: &'c Context) -> Self {
        Self {
            started: Mutex::default(),
            progress: context.progress().of_short_phases(),
        }
    }
    /// A phase begins.
    pub(crate) fn enter(&self, phase: &str) {
        self.started
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push((phase.to_owned(), Instant::now()));
        if let Some(i) = PHASES.iter().position(|p| *p == phase) {
            self.progress.show(phase, i as f64 / PHASES.len() as f64);
        }
    }
    /// A phase that tells its share: the bar is the phase's own.
    pub(crate) fn share(&self, phase: &str, done: f64) {
        let mut started = self.started.lock().unwrap_or_else(PoisonError::into_inner);
        if started.last().is_none_or(|last| last.0 != phase) {
            started.push((phase.to_owned(), Instant::now()));
        }
        self.progress.show(phase, done);
    }
    /// Seconds of each; the last one lasts until now.
    pub(crate) fn seconds(self) -> Vec<(String, f64)> {
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
    subject: &MeshInput,
    settings: &Settings,
    given: Option<&Mesh>,
    context: &Context,
) -> Result<MadeMesh, Failure> {
    let name = &subject.name;
    let options = options(settings, context)?;
    let phases = Phases::new(context);
    let show = |phase: &str, _: f64| phases.enter(phase);
    let control = Control {
        progress: Some(&show),
        ..context.control()
    };
    let made = match (&subject.shape, given) {
        (Shape::Model(model, values), Some(mesh)) => {
            adapt_to_model(mesh, model, values, &options, &control)
        }
        (Shape::Model(model, values), None) => {
            let named = subject.regions.iter().map(|region| RegionModel {
                name: &region.name,
                model: &region.model,
                values: &region.values,
            });
            let regions: Vec<RegionModel<'_>> = named.collect();
            mesh_model_regions(model, values, &regions, &options, &control)
        }
        (Shape::Spline(spline, unseen), _) => mesh_spline(spline, *unseen, &options, &control),
    };
    let (object, values) = match &subject.shape {
        Shape::Model(model, values) => (model.name().to_owned(), values.clone()),
        Shape::Spline(..) => ("surface".to_owned(), Vec::new()),
    };
    let mesh = made.map_err(|e| no_mesh(&e, name, settings))?;
    Ok(MadeMesh {
        name: name.clone(),
        object,
        values,
        unit: subject.unit.clone(),
        mesh,
        written: Vec::new(),
        seconds: phases.seconds(),
    })
}

/// Converts an error of meshing a model to a failure.
pub(crate) fn no_mesh(error: &MeshModelError, name: &str, settings: &Settings) -> Failure {
    match error {
        MeshModelError::Solid(e) => no_solid(e, name),
        MeshModelError::Mesh(e) => failure(e, name, settings),
        MeshModelError::Region { name, error } => {
            let failure = Failure::input("region", format!("region {name}: {error}"));
            match error {
                SolidError::NoSurface { .. } => failure.hint("leave it out of --regions"),
                _ => failure,
            }
        }
        MeshModelError::Jump(jump) => Failure::new(NO_RESULT, "jump", format!("{name}: {error}"))
            .somewhere(jump.at)
            .why("a function that jumps through 0 has no surface there that could be followed")
            .hint("a union or intersection of solids in place of the jump"),
        MeshModelError::InsideOut { .. } => {
            Failure::new(NO_RESULT, "unbounded", format!("{name}: {error}"))
                .why("the function is negative inside and positive all around")
                .hint("write -f, or --box to mesh what lies outside")
        }
        e => Failure::usage(format!("{name}: {e}"))
            .why("a loop or an index depends on the point")
            .hint("--box=-1,-1,-1,1,1,1 around it"),
    }
}

/// Converts the settings to options of the library.
pub(super) fn options(settings: &Settings, context: &Context) -> Result<MeshModelOptions, Failure> {
    let usual = Options::default();
    let sizes = settings.sizes.as_deref();
    Ok(MeshModelOptions {
        size: settings.size,
        limits: settings.angles.map_or(Limits::default(), |a| Limits {
            dihedral_min: a.0[0],
            dihedral_max: a.0[1],
            ..Limits::default()
        }),
        mesh: Options {
            grade: settings.grade,
            sizes: sizes.map(|path| sizes::read(path, context)).transpose()?,
            order: settings.order.unwrap_or(usual.order),
            surface_only: settings.surface_only,
            region: settings.region,
            start: settings.start.unwrap_or(usual.start),
            periodic: settings.periodic,
            layers: settings.layers.clone(),
            angles: settings.angles.map_or(usual.angles, |a| a.0),
            memory: settings
                .memory
                .map_or(usual.memory, |gib| (gib * f64::from(1 << 30)) as u64),
            ..usual
        },
    })
}

/// Makes the failure of a program that is not a solid.
fn no_solid(error: &SolidError, name: &str) -> Failure {
    let message = format!("{name}: {error}");
    match error {
        SolidError::NoSurface { inside: true } => Failure::new(NO_RESULT, "unbounded", message)
            .hint("inside is where f >= 0: a sign, perhaps"),
        SolidError::NoSurface { inside: false } => Failure::new(NO_RESULT, "empty", message)
            .hint("inside is where f >= 0: a sign, or other --params"),
        SolidError::Fails(e) => Failure::input("run", &e.message)
            .at(Path::new(name), e.line, e.column)
            .hint("correct the program, or its parameters: it stops there at every point"),
        SolidError::Dimension { .. } => {
            Failure::input("dimension", message).hint("--object with one of three coordinates")
        }
        _ => Failure::input("model", message),
    }
}

/// Makes the failure of a model without a bounded region to mesh.
fn no_extent(error: &ExtentError, name: &str, has_box: bool) -> Failure {
    let none = |code| Failure::new(NO_RESULT, code, format!("{name}: {error}"));
    match error {
        ExtentError::Empty { .. } if has_box => none("empty")
            .why("nothing of it lies in the --box")
            .hint("another --box, or none"),
        ExtentError::Empty { certified } => {
            let why = if *certified {
                "intervals prove f < 0 within a million units"
            } else {
                "no point with f >= 0 was found"
            };
            none("empty")
                .why(why)
                .hint("other --params, --box around where it is, or isoform eval: inside is f >= 0")
        }
        ExtentError::Unbounded { .. } => {
            none("unbounded").hint("--box=-1,-1,-1,1,1,1 to cut it off there")
        }
        _ => Failure::usage(format!("{name}: {error}")).hint("a smaller --box"),
    }
}

/// Converts an error of the mesher to a failure.
fn failure(error: &MeshError, name: &str, settings: &Settings) -> Failure {
    let none = |code| Failure::new(NO_RESULT, code, format!("{name}: {error}"));
    match error {
        MeshError::Extent(ExtentError::Stopped) | MeshError::Stopped => {
            Failure::stopped(format!("{name}: {error}"), ", or a larger --size")
        }
        MeshError::NotANumber { at } | MeshError::Extent(ExtentError::NotANumber { at }) => {
            none("not-a-number")
                .somewhere(*at)
                .hint("--box around the part where it is one")
        }
        MeshError::Extent(extent) => no_extent(extent, name, settings.region.is_some()),
        MeshError::Option { name, .. } => Failure::usage(error.to_string()).hint(argument(name)),
        MeshError::Memory { .. } if settings.periodic.contains(&true) => none("memory")
            .why("a unit cell has eight cells of the lattice along its shortest edge")
            .hint("a larger --size, or a --box whose edges differ less"),
        MeshError::Memory {
            size,
            needed,
            allowed,
        } => {
            let fits = size * (*needed as f64 / (*allowed).max(1) as f64).cbrt();
            let fits = brief(fits);
            none("memory").hint(format!("--size {fits}, or --memory with more GiB"))
        }
        MeshError::NoMemory { .. } => none("memory").hint("a larger --size, or --blocks"),
        MeshError::TooCoarse { size } => {
            none("too-coarse").hint(format!("--size {}, or other --params", 0.5 * size))
        }
        MeshError::RegionName { .. } => Failure::usage(error.to_string()).hint("--regions"),
        MeshError::NoBox => Failure::usage(error.to_string()).hint("--box around the unit cell"),
        MeshError::InSide { at, .. } => none("in-side")
            .somewhere(*at)
            .hint("a --box that begins elsewhere: a cell may begin anywhere"),
        MeshError::NotPeriodic { at, .. } => none("not-periodic")
            .somewhere(*at)
            .why("a unit cell goes on at the opposite side as it ends")
            .hint("another --box, or --periodic with the axes along which the model repeats"),
        MeshError::NoLayers { .. } => none("no-layers").hint("leave --layers or the other out"),
        MeshError::NoPart { .. } => {
            none("no-part").hint("--layers with one of these, or with a pattern, as 'wall*'")
        }
        MeshError::LayersEnd { other, at, .. } => none("layers-end")
            .somewhere(*at)
            .why("layers end on a part that stands on theirs at an edge")
            .hint(format!("--layers with {other} as well")),
        MeshError::NoRoom { at, .. } => {
            let failure = none("no-room");
            let failure = at.iter().fold(failure, |f, at| f.somewhere(*at));
            failure.hint("thinner or fewer layers: a smaller --first or --layer-count")
        }
        MeshError::NoSlopes { .. } => none("no-slopes")
            .why("layers are offsets of the surface, which slopes bound")
            .hint("--layers with other parts"),
        MeshError::Blocks { .. } => Failure::usage(error.to_string()).hint("--blocks"),
        MeshError::Apart { at, .. } => none("apart")
            .somewhere(*at)
            .why("the mesher decided otherwise on the two sides")
            .hint("fewer --blocks, or another --size"),
        MeshError::Input { .. } => Failure::input("mesh", format!("{name}: {error}"))
            .hint("tetrahedra, or a closed surface of triangles, near the model"),
        MeshError::Internal { what } => Failure::internal("mesh").why(what),
    }
}

/// The arguments that say an option of the library.
fn argument(option: &str) -> String {
    match option {
        "number of layers" => "--layer-count".to_owned(),
        "layers' first thickness" => "--first".to_owned(),
        "layers' growth" => "--growth".to_owned(),
        "layers' thickness" => "--first, --growth or --layer-count".to_owned(),
        name => format!("--{name}"),
    }
}

/// Returns a point in words.
pub(crate) fn place(at: Point3) -> String {
    format!("({}, {}, {})", at[0], at[1], at[2])
}
