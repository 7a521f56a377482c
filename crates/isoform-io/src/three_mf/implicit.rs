//! Models of level sets: implicit functions of 3MF as HyperFun programs ("3MF Volumetric and
//! Implicit Extensions" 1.0.0).
//!
//! A level set is negative inside, a program positive: the model is the negated function within the
//! mesh that bounds it, moved to its place in the build. Where the function is undefined the file's
//! `fallbackvalue` decides; 0 counts as outside there, since a solid ends where it has no interior.

mod domain;
mod graph;
mod nodes;
mod print;
mod region;
mod translate;
mod write;

pub use graph::{ScalarFunction, ScalarGraph, ScalarId, ScalarNode, ScalarOperation};
pub use write::{ImplicitModel, write_implicit};

use super::model::ModelObject;
use super::transform::Transform;
use super::{Component, Package, PlacedObject, Sniff, sniff};
use crate::input::{Input, Result, parse_number, shorten};
use crate::xml::attribute;
use crate::{At, ErrorKind, ReadError, Source};
use isoform_geom::Point3;
use region::HalfSpace;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use translate::Translator;

/// Number of bytes by which packages are recognized.
const HEAD_BYTES: usize = 4096;
const IMPLICIT_FAILURE: &str = "cannot read the implicit model";
const EXPORT_HINT: &str = "export the model again, or as a mesh";
const MESH_HINT: &str = "export the model as a mesh from the program that made it, or replace the \
    node by a formula";
const REGION_HINT: &str =
    "set meshbboxonly=\"true\" at the level set, or give it a box as its mesh";
/// Maximum number of level sets of a build, copies included.
const MAX_LEVEL_SETS: usize = 10_000;
/// Maximum length of a title, in characters.
const MAX_TITLE_LENGTH: usize = 200;
/// Function value where the file's is undefined and its `fallbackvalue` is 0: outside, since a
/// program has its 0 inside.
const UNDEFINED_LEVEL: f64 = 1.0;

/// A model of level sets as a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImplicitProgram {
    /// The program in HyperFun.
    pub text: String,
    /// Unit of length, as named in this crate.
    pub units: String,
    /// Elements passed over, and doubtful ones.
    pub warnings: Vec<String>,
}

/// Reason why a model cannot be read.
#[derive(Debug)]
struct Obstacle {
    kind: ErrorKind,
    why: String,
    hint: &'static str,
}

impl Obstacle {
    fn new(kind: ErrorKind, why: impl Into<String>) -> Self {
        let hint = match kind {
            ErrorKind::UnsupportedFormat => MESH_HINT,
            _ => EXPORT_HINT,
        };
        let why = why.into();
        Self { kind, why, hint }
    }

    fn corrupt(why: String) -> Self {
        Self::new(ErrorKind::Corrupt, why)
    }

    fn unsupported(why: String) -> Self {
        Self::new(ErrorKind::UnsupportedFormat, why)
    }

    /// The obstacle of a region that is not an intersection of half spaces.
    fn region(why: &str) -> Self {
        Self {
            hint: REGION_HINT,
            ..Self::unsupported(why.to_owned())
        }
    }

    fn error(self, input: &Input<'_>) -> ReadError {
        let Self { kind, why, hint } = self;
        input.error(kind, At::File, IMPLICIT_FAILURE, why, hint)
    }
}

/// Returns true for a 3MF package that builds a level set.
pub fn is_implicit(source: Source<'_>) -> bool {
    let Ok(mut input) = Input::open(source) else {
        return false;
    };
    let Ok(Some(package)) = open(&mut input) else {
        return false;
    };
    let is_level = |placed: &PlacedObject<'_>| placed.object.level_set.is_some();
    let built = package.built();
    let placed = package.contents(&built);
    placed.is_ok_and(|placed| placed.iter().any(is_level))
}

/// Reads the level sets that a 3MF package builds as one HyperFun program; `None` if the file is not a
/// package, or builds none.
///
/// # Errors
/// [`ReadError`] if the package is damaged, or a function needs images,
/// distances to meshes, or a bounding mesh that is not convex.
pub fn read_implicit(source: Source<'_>) -> Result<Option<ImplicitProgram>> {
    let mut input = Input::open(source)?;
    let Some(package) = open(&mut input)? else {
        return Ok(None);
    };
    let built = package.built();
    let placed = match package.contents(&built) {
        Ok(placed) => placed,
        Err(problem) => return Err(super::error(&input, problem)),
    };
    if placed.iter().all(|p| p.object.level_set.is_none()) {
        return Ok(None);
    }
    match program(&package, &placed) {
        Ok(program) => Ok(Some(program)),
        Err(obstacle) => Err(obstacle.error(&input)),
    }
}

/// Reads a package; `None` if the file is none.
fn open(input: &mut Input<'_>) -> Result<Option<Package>> {
    let head = input.head(HEAD_BYTES)?;
    match sniff(&head) {
        Sniff::No => Ok(None),
        _ => Package::read(input).map(Some),
    }
}

impl Package {
    /// Returns the items to be built: the listed ones, else the objects that no other one holds nor
    /// has as its bounds.
    fn built(&self) -> Vec<Component> {
        let root = self.root();
        if !root.items.is_empty() {
            return root.items.clone();
        }
        let sets = root.objects.values().filter_map(|o| o.level_set.as_deref());
        let bounds: BTreeSet<u32> = sets
            .filter_map(|set| super::model::whole(set, "meshid").ok())
            .collect();
        let mut items = self.unlisted();
        items.retain(|item| !bounds.contains(&item.object));
        items
    }
}

/// Returns the program of the objects of a build.
fn program(
    package: &Package,
    placed: &[PlacedObject<'_>],
) -> std::result::Result<ImplicitProgram, Obstacle> {
    let model = placed[0].model;
    if placed.len() > MAX_LEVEL_SETS {
        let why = format!("the build has more than {MAX_LEVEL_SETS} level sets");
        return Err(Obstacle::new(ErrorKind::TooLarge, why));
    }
    let mut translator = Translator::new(model);
    let mut regions = BTreeMap::new();
    let mut levels = Vec::with_capacity(placed.len());
    let mut hints = BTreeSet::new();
    for one in placed {
        if !std::ptr::eq(one.model, model) {
            let why = "its level sets are in several parts of the package";
            return Err(Obstacle::unsupported(why.to_owned()));
        }
        let set = LevelSet::of_object(one)?;
        hints.extend(set.warning());
        let region = match regions.entry(one.id) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert(set.region()?),
        };
        levels.push(set.placed(&mut translator, one, region)?);
    }
    let Translator {
        mut graph,
        mut names,
        warnings: said,
        ..
    } = translator;
    let guards = domain::guards(&mut graph);
    let undefined = domain::undefined(&mut graph, &guards);
    let root = union(&mut graph, &mut names, &levels, &undefined);
    if graph.is_full() {
        let why = "its functions come to more than 1000000 operations";
        return Err(Obstacle::new(ErrorKind::TooLarge, why));
    }
    let units = package.root().unit.to_owned();
    let (body, result) = print::statements(&graph, &guards, &names, root);
    let titles: BTreeSet<String> = placed.iter().map(|p| one_line(&p.object.name)).collect();
    let titles: Vec<String> = titles.into_iter().filter(|t| !t.is_empty()).collect();
    let title = match one_line(&titles.join(", ")).as_str() {
        "" => String::new(),
        title => format!("-- @title {title}\n"),
    };
    let text = format!(
        "{title}-- @unit {units}\n\
         my_model(x[3], a[1])\n{{\n{body}  my_model = {result};\n}}\n"
    );
    let mut warnings = package.passed_over();
    warnings.extend(hints);
    warnings.extend(said.into_iter().map(str::to_owned));
    Ok(ImplicitProgram {
        text,
        units,
        warnings,
    })
}

/// Level set at its place in the build.
#[derive(Debug)]
struct PlacedLevel {
    /// Value of the function, negative inside.
    level: ScalarId,
    /// Value where the function is undefined.
    fallback: f64,
    /// Functions of the sides of the region, positive inside.
    sides: Vec<ScalarId>,
}

/// Returns the union of level sets, positive inside.
fn union(
    graph: &mut ScalarGraph,
    names: &mut HashMap<ScalarId, String>,
    levels: &[PlacedLevel],
    undefined: &HashMap<ScalarId, ScalarId>,
) -> ScalarId {
    let mut whole = None;
    for one in levels {
        let mut value = one.level;
        if let Some(&undefined) = undefined.get(&value) {
            let fallback = match one.fallback {
                0.0 => UNDEFINED_LEVEL,
                other => other,
            };
            let (zero, fallback) = (graph.constant(0.0), graph.constant(fallback));
            value = graph.choice([zero, undefined], fallback, value);
        }
        let mut all = graph.negative(value);
        for &side in &one.sides {
            names.entry(side).or_insert_with(|| "limit".to_owned());
            all = graph.binary(ScalarOperation::Min, all, side);
        }
        whole = Some(match whole {
            None => all,
            Some(whole) => graph.binary(ScalarOperation::Max, whole, all),
        });
    }
    whole.unwrap_or_else(|| graph.constant(-1.0))
}

/// Returns a name without line breaks and other controls, and not longer than a line or two.
fn one_line(name: &str) -> String {
    let plain = name.trim().chars().take(MAX_TITLE_LENGTH);
    plain
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

/// Returns the beginning of a variable's name that resembles a name in the file.
fn variable_name(name: &str) -> String {
    let letters = name.chars().take(24).map(|c| match c {
        c if c.is_ascii_alphanumeric() => c.to_ascii_lowercase(),
        _ => '_',
    });
    let name: String = letters.collect();
    let name = name.trim_matches('_');
    match name.chars().next() {
        Some(c) if c.is_ascii_alphabetic() => name.to_owned(),
        _ => "t".to_owned(),
    }
}

/// Level set of an object.
#[derive(Debug)]
struct LevelSet<'p> {
    /// Number of the object.
    id: u32,
    function: u32,
    channel: &'p str,
    /// From the object's coordinates to those of the function; `None` for the identity.
    transform: Option<Transform>,
    /// Smallest size of features to be considered, in the unit of the file.
    feature_size: f64,
    /// Function value where the function is undefined.
    fallback: f64,
    mesh: &'p ModelObject,
    is_box: bool,
}

impl<'p> LevelSet<'p> {
    /// Parses the level set of an object.
    fn of_object(placed: &PlacedObject<'p>) -> std::result::Result<Self, Obstacle> {
        let id = placed.id;
        let Some(text) = placed.object.level_set.as_deref() else {
            let why = format!("object {id} is a mesh, and others are level sets");
            return Err(Obstacle::unsupported(why));
        };
        let wrong = |why: String| Obstacle::corrupt(format!("level set of object {id}: {why}"));
        let whole = |key: &str| super::model::whole(text, key).map_err(|(_, why)| wrong(why));
        let number = |key: &str, usual: f64| match attribute(text, key) {
            None => Ok(usual),
            Some(value) => parse_number(value.trim())
                .filter(|v| v.is_finite())
                .ok_or_else(|| wrong(format!("{key}=\"{}\" is no number", shorten(value)))),
        };
        let transform = attribute(text, "transform").map(|value| {
            let why = || wrong(format!("\"{}\" is no transform", shorten(value)));
            Transform::parse(value)
                .filter(Transform::is_finite)
                .ok_or_else(why)
        });
        let mesh = whole("meshid")?;
        let found = placed.model.objects.get(&mesh);
        let Some(mesh) = found.filter(|o| !o.vertices.is_empty()) else {
            return Err(wrong(format!("there is no mesh {mesh}")));
        };
        let flag = attribute(text, "meshbboxonly").unwrap_or("false").trim();
        Ok(Self {
            id,
            function: whole("functionid")?,
            channel: attribute(text, "channel").unwrap_or("").trim(),
            transform: transform.transpose()?,
            feature_size: number("minfeaturesize", 0.0)?,
            fallback: number("fallbackvalue", 0.0)?,
            mesh,
            is_box: matches!(flag, "true" | "1"),
        })
    }

    /// Returns the warning of a size of features.
    fn warning(&self) -> Option<String> {
        (self.feature_size > 0.0).then(|| {
            format!(
                "object {} states features of {}: a mesh of it needs a size not above that",
                self.id, self.feature_size
            )
        })
    }

    /// Returns the region in which the function counts, in the object's coordinates.
    fn region(&self) -> std::result::Result<Vec<HalfSpace>, Obstacle> {
        match self.is_box {
            true => region::of_box(self.mesh),
            false => region::of_convex(self.mesh),
        }
    }

    /// Adds the level set at its place in the build.
    fn placed(
        &self,
        translator: &mut Translator<'p>,
        placed: &PlacedObject<'p>,
        region: &[HalfSpace],
    ) -> std::result::Result<PlacedLevel, Obstacle> {
        let graph = &mut translator.graph;
        let mut point = [0, 1, 2].map(|i| graph.coordinate(i));
        if let Some(transform) = placed.transform {
            let inverse = transform.inverse().ok_or_else(|| {
                let why = format!("the transform of object {} has no inverse", self.id);
                Obstacle::corrupt(why)
            })?;
            let (back, origin) = inverse;
            point = affine(graph, &back, Some(origin), None, point);
        }
        let sides = region.iter().map(|side| side.level(graph, point)).collect();
        let at = match self.transform {
            Some(Transform { axes, origin }) => affine(graph, &axes, None, Some(origin), point),
            None => point,
        };
        Ok(PlacedLevel {
            level: translator.level(self.function, self.channel, at)?,
            fallback: self.fallback,
            sides,
        })
    }
}

/// Returns the image of a point: the `before`-hand shifted coordinates times the rows of a matrix,
/// plus a shift.
fn affine(
    graph: &mut ScalarGraph,
    rows: &[Point3; 3],
    before: Option<Point3>,
    after: Option<Point3>,
    mut point: [ScalarId; 3],
) -> [ScalarId; 3] {
    use ScalarOperation::{Add, Mul, Sub};
    if let Some(origin) = before {
        for (p, o) in point.iter_mut().zip(origin) {
            let o = graph.constant(o);
            *p = graph.binary(Sub, *p, o);
        }
    }
    std::array::from_fn(|k| {
        let mut sum = graph.constant(0.0);
        for (p, row) in point.iter().zip(rows).filter(|(_, row)| row[k] != 0.0) {
            let factor = graph.constant(row[k]);
            let term = graph.binary(Mul, *p, factor);
            sum = graph.binary(Add, sum, term);
        }
        match after {
            Some(origin) => {
                let shift = graph.constant(origin[k]);
                graph.binary(Add, sum, shift)
            }
            None => sum,
        }
    })
}

impl Transform {
    /// Returns true if all numbers are finite.
    fn is_finite(&self) -> bool {
        let mut numbers = self.axes.as_flattened().iter().chain(&self.origin);
        numbers.all(|v| v.is_finite())
    }

    /// Returns the rows of the inverse matrix and the origin that is subtracted before; `None` if
    /// the inverse does not exist.
    fn inverse(&self) -> Option<([Point3; 3], Point3)> {
        let [x, y, z] = self.axes;
        let columns = [
            isoform_geom::cross(y, z),
            isoform_geom::cross(z, x),
            isoform_geom::cross(x, y),
        ];
        let determinant = isoform_geom::dot(x, columns[0]);
        let rows = std::array::from_fn(|i| columns.map(|c| c[i] / determinant));
        let inverse = Self {
            axes: rows,
            origin: self.origin,
        };
        (determinant != 0.0 && inverse.is_finite()).then_some((rows, self.origin))
    }
}
