//! 3MF (3MF Consortium, "3D Manufacturing Format core specification" 1.3): what a package is to
//! build, as vertices and triangles.
//!
//! A package is a ZIP archive whose model is XML. The model has objects, meshes or objects put
//! together of others, and a list of those to be built, each with an affine map. All of them are
//! taken, in the order of the list; where the model is divided among several parts of the package
//! (production extension), those parts are read, too. Where there is one mesh, its base materials
//! are the parts; where there are several, each is a part, or as many as it has materials. Slices,
//! lattices, colours and textures are passed over.
//!
//! What a few bytes could make large is bounded: what the members unpack to (see `unzip`), and how
//! much copies of objects come to.

mod model;
mod tags;
mod transform;

use crate::collect::{Collector, Parts};
use crate::format::Sniff;
use crate::input::{Input, Result};
use crate::mesh::attribute;
use crate::unzip::{Archive, Problem};
use crate::{At, ErrorKind, ReadError, ReadOptions, ReadReport};
use isoform_geom::PointCloud;
use model::{Component, MaterialId, Model, Object};
use std::collections::{BTreeMap, BTreeSet};
use tags::{Tag, Tags};
use transform::Transform;

/// The name of the format in the registries.
pub(crate) const NAME: &str = "3mf";
/// Units of length in our words and in those of 3MF.
pub(crate) const UNITS: [(&str, &str); 6] = [
    ("mm", "millimeter"),
    ("um", "micron"),
    ("cm", "centimeter"),
    ("m", "meter"),
    ("in", "inch"),
    ("ft", "foot"),
];
/// What failed, as the errors of this reader say.
const WHAT: &str = "cannot read the 3MF package";
/// What to try.
const HINT: &str = "export the model again, or as STL or OBJ";
/// Where the model is in almost all packages.
const USUAL: &str = "3D/3dmodel.model";
/// The relations of the package, one of which leads to the model, and what its type ends in.
const RELATIONS: [&str; 2] = ["_rels/.rels", "/2013/01/3dmodel"];
/// Deepest nesting of objects in objects. More is a circle, or meant to do harm.
const DEEPEST: u32 = 64;
/// Most vertices, triangles and objects that copies of objects may come to, in all, if the file
/// does not hold as many itself: half a gigabyte of them.
const MOST_COPIES: u64 = 16_000_000;

/// A ZIP archive; yes, where one of its first members is a model.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    let has = |name: &[u8]| {
        head.windows(name.len())
            .any(|w| w.eq_ignore_ascii_case(name))
    };
    if !head.starts_with(b"PK\x03\x04") {
        Sniff::No
    } else if has(b"3d/") && has(b".model") {
        Sniff::Yes
    } else if has(b"[Content_Types].xml") {
        Sniff::Maybe
    } else {
        Sniff::No
    }
}

/// The points and the triangles.
pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    read_parts(input, options, report).map(|(cloud, _)| cloud)
}

/// The points, the triangles and their groups.
pub(crate) fn read_parts(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<(PointCloud, Parts)> {
    let package = Package::read(input)?;
    report.units = Some(package.root().unit.to_owned());
    package.warn(report);
    let mut collector = Collector::new(options);
    collector.mesh(options);
    let unlisted = package.unlisted();
    let items = match package.root().items.as_slice() {
        [] => &unlisted,
        items => items,
    };
    let placed = package.placed(items).map_err(|p| error(input, p))?;
    Filler::new(&mut collector, placed.len()).take_all(&placed);
    collector.finish_with_parts(input, options, report)
}

fn error(input: &Input<'_>, problem: Problem) -> ReadError {
    input.error(problem.kind, At::File, WHAT, problem.why, HINT)
}

/// All model parts of a package by their names.
struct Package {
    models: BTreeMap<String, Model>,
    /// The name of the part that says what is to be built.
    root: String,
}

/// An object of the package in its place.
struct Placed<'p> {
    model: &'p Model,
    id: u32,
    object: &'p Object,
    transform: Option<Transform>,
}

impl Package {
    /// Reads the model and all parts that its objects lie in.
    fn read(input: &mut Input<'_>) -> Result<Self> {
        let mut archive = Archive::open(input)?;
        let Some(root) = find_model(&mut archive, input)? else {
            let why = "there is no model in the archive: it is no 3MF package";
            return Err(error(input, Problem::new(ErrorKind::Header, why)));
        };
        let mut models = BTreeMap::new();
        let mut wanted = BTreeSet::from([root.clone()]);
        while let Some(name) = wanted.pop_first() {
            if models.contains_key(&name) {
                continue;
            }
            let model = archive.read(input, &name, |text| model::read(&mut Tags::new(text)))?;
            let components = model.objects.values().flat_map(|o| &o.components);
            let paths = components
                .chain(&model.items)
                .filter_map(|c| c.path.as_deref());
            for path in paths {
                let found = archive.find(path);
                let Some(found) = found.filter(|f| *f == path) else {
                    let why = format!("the model needs {path}, which is not in the package");
                    return Err(error(input, Problem::new(ErrorKind::Corrupt, why)));
                };
                if !models.contains_key(found) {
                    wanted.insert(found.to_owned());
                }
            }
            models.insert(name, model);
        }
        Ok(Self { models, root })
    }

    fn root(&self) -> &Model {
        &self.models[&self.root]
    }

    /// Warns of what is passed over.
    fn warn(&self, report: &mut ReadReport) {
        for name in self.models.values().flat_map(|m| &m.unknown) {
            report.warn(format!(
                "the model needs the extension {name}, which is passed over"
            ));
        }
        let unit = self.root().unit;
        if self.models.values().any(|m| m.unit != unit) {
            report.warn(format!(
                "parts of the package state other units; {unit} is taken for all"
            ));
        }
        if self.root().items.is_empty() && !self.root().objects.is_empty() {
            report.warn("nothing is to be built: all objects were taken that no other one holds");
        }
    }

    /// The objects with meshes that are to be built, each in its place.
    fn placed<'a>(
        &'a self,
        items: &'a [Component],
    ) -> std::result::Result<Vec<Placed<'a>>, Problem> {
        let mut costs = Costs {
            package: self,
            known: BTreeMap::new(),
        };
        let mut total = 0_u64;
        for item in items {
            total = total.saturating_add(costs.of(&self.root, item, 0)?.count);
        }
        let objects = self.models.values().flat_map(|m| m.objects.values());
        let held: u64 = objects.map(Object::cost).sum();
        if total > MOST_COPIES.max(held) {
            let why = "copies of its objects come to more than 16 million vertices and triangles";
            return Err(Problem::new(ErrorKind::TooLarge, why));
        }
        let mut placed = Vec::new();
        for item in items {
            self.place(&self.root, item, None, &mut placed)?;
        }
        Ok(placed)
    }

    /// The objects that are part of no other: what is taken where nothing is to be built.
    fn unlisted(&self) -> Vec<Component> {
        let root = self.root();
        let components = root.objects.values().flat_map(|o| &o.components);
        let used: BTreeSet<u32> = components.map(|c| c.object).collect();
        let free = root.objects.keys().filter(|id| !used.contains(id));
        free.map(|&object| Component {
            path: None,
            object,
            transform: None,
        })
        .collect()
    }

    /// The object that a component of a model part names, with the part that it is in.
    fn object<'a>(
        &'a self,
        part: &'a str,
        component: &'a Component,
    ) -> std::result::Result<(&'a str, &'a Object), Problem> {
        let part = component.path.as_deref().unwrap_or(part);
        let model = self.models.get(part);
        let object = model.and_then(|m| m.objects.get(&component.object));
        object.map(|o| (part, o)).ok_or_else(|| {
            let why = format!("there is no object {} in {part}", component.object);
            Problem::new(ErrorKind::Index, why)
        })
    }

    /// Adds the meshes of a component, which is put into its place by its own map and then by that
    /// of what it belongs to.
    fn place<'a>(
        &'a self,
        part: &'a str,
        component: &'a Component,
        outer: Option<Transform>,
        placed: &mut Vec<Placed<'a>>,
    ) -> std::result::Result<(), Problem> {
        let (part, object) = self.object(part, component)?;
        let own = component.transform.as_deref().copied();
        let transform = match (own, outer) {
            (Some(own), Some(outer)) => Some(own.then(&outer)),
            (own, outer) => own.or(outer),
        };
        if !object.vertices.is_empty() {
            placed.push(Placed {
                model: &self.models[part],
                id: component.object,
                object,
                transform,
            });
        }
        let mut inner = object.components.iter();
        inner.try_for_each(|c| self.place(part, c, transform, placed))
    }
}

/// The name of the part that holds the model: as the relations of the package say, or where it
/// usually is, or the first one that is a model by its name.
fn find_model(archive: &mut Archive, input: &mut Input<'_>) -> Result<Option<String>> {
    let relations = archive.find(RELATIONS[0]).map(str::to_owned);
    if let Some(relations) = relations {
        let target = archive.read(input, &relations, |text| target(&mut Tags::new(text)))?;
        let found = target.and_then(|t| archive.find(&t).map(str::to_owned));
        if found.is_some() {
            return Ok(found);
        }
    }
    let is_model = |n: &&str| n.to_ascii_lowercase().ends_with(".model");
    let found = archive
        .find(USUAL)
        .or_else(|| archive.names().find(is_model));
    Ok(found.map(str::to_owned))
}

/// The name of the part that the relation to the model leads to.
fn target(tags: &mut Tags<'_>) -> std::result::Result<Option<String>, Problem> {
    while let Some(tag) = tags.next()? {
        if let Tag::Open { attributes, .. } = tag
            && attribute(attributes, "Type").is_some_and(|t| t.ends_with(RELATIONS[1]))
            && let Some(target) = attribute(attributes, "Target")
        {
            return Ok(Some(target.trim_start_matches('/').to_owned()));
        }
    }
    Ok(None)
}

/// What an object comes to with all that it is put together of.
#[derive(Clone, Copy)]
struct Cost {
    /// Vertices, triangles and objects.
    count: u64,
    /// Levels of objects in objects.
    height: u32,
}

/// The costs of objects, each found once, so that this is quick where expanding them would never
/// end.
struct Costs<'p> {
    package: &'p Package,
    /// By model part and number, of those that have been counted.
    known: BTreeMap<(&'p str, u32), Cost>,
}

impl<'p> Costs<'p> {
    /// The cost of a component at a depth.
    fn of(
        &mut self,
        part: &'p str,
        component: &'p Component,
        depth: u32,
    ) -> std::result::Result<Cost, Problem> {
        let (part, object) = self.package.object(part, component)?;
        let key = (part, component.object);
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let mut cost = Cost {
            count: object.cost(),
            height: 0,
        };
        for inner in &object.components {
            // A circle never comes to the end where heights are known.
            let inner = if depth < DEEPEST {
                self.of(part, inner, depth + 1)?
            } else {
                return Err(too_deep());
            };
            cost.count = cost.count.saturating_add(inner.count);
            cost.height = cost.height.max(inner.height + 1);
        }
        if cost.height > DEEPEST {
            return Err(too_deep());
        }
        self.known.insert(key, cost);
        Ok(cost)
    }
}

fn too_deep() -> Problem {
    let why = format!("objects hold one another in a circle, or more than {DEEPEST} levels deep");
    Problem::new(ErrorKind::Corrupt, why)
}

impl Object {
    /// What the object itself comes to.
    fn cost(&self) -> u64 {
        1 + self.vertices.len() as u64 + self.triangles.len() as u64
    }
}

/// Puts placed objects into a collector, with their parts.
struct Filler<'c> {
    collector: &'c mut Collector,
    /// Whether several meshes are to be told apart.
    are_many: bool,
    /// How often each label was given.
    labels: BTreeMap<String, u32>,
}

impl<'c> Filler<'c> {
    fn new(collector: &'c mut Collector, count: usize) -> Self {
        Self {
            collector,
            are_many: count > 1,
            labels: BTreeMap::new(),
        }
    }

    fn take_all(&mut self, placed: &[Placed<'_>]) {
        for one in placed {
            let parts = self.parts(one);
            self.take(one, &parts);
        }
    }

    /// Takes the vertices and the triangles of a mesh.
    fn take(&mut self, placed: &Placed<'_>, parts: &BTreeMap<Option<MaterialId>, u32>) {
        let Placed {
            object, transform, ..
        } = placed;
        let first = self.collector.rows;
        for &p in &object.vertices {
            self.collector.offer(transform.map_or(p, |t| t.apply(p)));
        }
        let is_mirrored = transform.is_some_and(|t| t.is_mirror());
        for (i, corners) in object.triangles.iter().enumerate() {
            let material = object.materials.get(i).copied().flatten();
            if let Some(&part) = parts.get(&material) {
                self.collector.set_part(part);
            }
            let mut corners = corners.map(|c| first + u64::from(c));
            if is_mirrored {
                corners.swap(1, 2);
            }
            self.collector.polygon(&corners, At::File);
        }
    }

    /// The parts of a mesh by material: of the only one its materials, in the order of their
    /// groups, and none without materials; of several each by itself.
    fn parts(&mut self, placed: &Placed<'_>) -> BTreeMap<Option<MaterialId>, u32> {
        let Placed { model, object, .. } = placed;
        let label = if self.are_many {
            Some(self.label(placed))
        } else {
            None
        };
        let mut used: Vec<Option<MaterialId>> = object.materials.clone();
        used.resize(object.triangles.len(), None);
        used.sort_unstable();
        used.dedup();
        let name = |(group, place): MaterialId| model.materials.get(&group)?.get(place as usize);
        let named: Vec<u32> = used.iter().flatten().map(|m| m.0).collect();
        let mut parts = BTreeMap::new();
        if !self.are_many {
            // All names of a group that is used, so that what was written comes back.
            let groups = model.materials.iter().filter(|g| named.contains(g.0));
            for (&group, names) in groups {
                for (place, name) in (0..).zip(names) {
                    let part = self.collector.add_part(name);
                    parts.insert(Some((group, place)), part);
                }
            }
        }
        // Colours, of which there may be many, are no parts.
        let mut by_name = BTreeMap::new();
        for material in used {
            let text = match (&label, material.and_then(name)) {
                (Some(label), Some(name)) => format!("{label}.{name}"),
                (Some(label), None) => label.clone(),
                (None, None) if !parts.is_empty() => "no material".to_owned(),
                (None, _) => continue,
            };
            let new = || self.collector.add_part(&text);
            let part = *by_name.entry(text.clone()).or_insert_with(new);
            parts.insert(material, part);
        }
        parts
    }

    /// A name for a mesh, which no other one has.
    fn label(&mut self, placed: &Placed<'_>) -> String {
        let name = match placed.object.name.trim() {
            "" => format!("object {}", placed.id),
            name => name.to_owned(),
        };
        let count = self.labels.entry(name.clone()).or_default();
        *count += 1;
        match count {
            1 => name,
            n => format!("{name} ({n})"),
        }
    }
}
