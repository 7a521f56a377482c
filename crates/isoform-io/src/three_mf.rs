//! 3MF (3MF Consortium, "3D Manufacturing Format core specification" 1.3): reader of the build of a
//! package as vertices and triangles.
//!
//! A package is a ZIP archive with an XML model. The model has objects, which are meshes or
//! assemblies of other objects, and a list of build items, each with an affine map. All items are
//! read, in the order of the list, also from other parts of the package if the model is split
//! (production extension). The base materials of a single mesh become its parts; of several meshes
//! each becomes a part, or one part per material. Slices, lattices, colours and textures are
//! skipped.
//!
//! Two limits guard against small files that expand enormously: the decompressed size of the
//! members (see `unzip`), and the total size of all copies of objects.

mod functions;
pub(crate) mod implicit;
mod model;
mod tags;
mod transform;

use crate::collect::{Collector, TriangleParts};
use crate::format::Sniff;
use crate::input::{Input, Result};
use crate::unzip::{Archive, Problem};
use crate::xml::attribute;
use crate::{At, ErrorKind, ReadError, ReadOptions, ReadReport};
use isoform_geom::PointCloud;
use model::{Component, MaterialId, ModelObject, ModelPart};
use std::collections::{BTreeMap, BTreeSet};
use tags::{Tag, Tags};
use transform::Transform;

/// Name of the format in the registries.
pub(crate) const FORMAT_NAME: &str = "3mf";
/// Units of length: names in this crate and in 3MF.
pub(crate) const UNIT_NAMES: [(&str, &str); 6] = [
    ("mm", "millimeter"),
    ("um", "micron"),
    ("cm", "centimeter"),
    ("m", "meter"),
    ("in", "inch"),
    ("ft", "foot"),
];
const THREE_MF_FAILURE: &str = "cannot read the 3MF package";
const THREE_MF_HINT: &str = "export the model again, or as STL or OBJ";
const LEVEL_SET_HINT: &str = "isoform mesh, brep, parameterize, eval, compare, view or render take \
    it like a HyperFun program; isoform mesh FILE -o part.ply makes a mesh of it";
/// Usual name of the model part.
const USUAL_MODEL_PART: &str = "3D/3dmodel.model";
/// Part with the relationships of the package, and the end of the type of the relationship to the
/// model.
const MODEL_RELATIONSHIP: [&str; 2] = ["_rels/.rels", "/2013/01/3dmodel"];
/// Maximum nesting depth of objects. Deeper nesting is a cycle or malicious.
const MAX_NESTING_DEPTH: u32 = 64;
/// Maximum total number of vertices, triangles and objects of all copies, unless the file itself
/// has more: half a gigabyte of them.
const MAX_EXPANDED_ITEMS: u64 = 16_000_000;

/// Returns `Yes` for a ZIP archive if one of its first members is a model.
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

/// Reads points and triangles.
pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    read_parts(input, options, report).map(|(cloud, _)| cloud)
}

/// Reads points, triangles and their groups.
pub(crate) fn read_parts(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<(PointCloud, TriangleParts)> {
    let package = Package::read(input)?;
    report.units = Some(package.root().unit.to_owned());
    for warning in package.passed_over() {
        report.warn(warning);
    }
    package.warn_of_levels(report);
    let mut collector = Collector::new(options);
    collector.mesh(options);
    let unlisted = package.unlisted();
    let items = match package.root().items.as_slice() {
        [] => &unlisted,
        items => items,
    };
    let placed = package.placed(items).map_err(|p| error(input, p))?;
    if placed.is_empty() && package.has_levels() {
        return Err(input.error(
            ErrorKind::UnsupportedFormat,
            At::File,
            THREE_MF_FAILURE,
            "its objects are level sets of functions, and it has no triangles",
            LEVEL_SET_HINT,
        ));
    }
    PartFiller::new(&mut collector, placed.len()).take_all(&placed);
    collector.finish_with_parts(input, options, report)
}

fn error(input: &Input<'_>, problem: Problem) -> ReadError {
    input.error(
        problem.kind,
        At::File,
        THREE_MF_FAILURE,
        problem.why,
        THREE_MF_HINT,
    )
}

/// Model parts of a package by name.
struct Package {
    models: BTreeMap<String, ModelPart>,
    /// Name of the root model part, which has the build items.
    root: String,
}

/// Object of the package with its transform.
struct PlacedObject<'p> {
    model: &'p ModelPart,
    id: u32,
    object: &'p ModelObject,
    transform: Option<Transform>,
}

impl Package {
    /// Reads the root model part and all parts that it refers to.
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

    fn root(&self) -> &ModelPart {
        &self.models[&self.root]
    }

    /// Returns warnings of skipped content.
    fn passed_over(&self) -> Vec<String> {
        let unknown = self.models.values().flat_map(|m| &m.unknown);
        let mut warnings: Vec<String> = unknown
            .map(|name| format!("the model needs the extension {name}, which is passed over"))
            .collect();
        let unit = self.root().unit;
        if self.models.values().any(|m| m.unit != unit) {
            warnings.push(format!(
                "parts of the package state other units; {unit} is taken for all"
            ));
        }
        if self.root().items.is_empty() && !self.root().objects.is_empty() {
            warnings.push(
                "nothing is to be built: all objects were taken that no other one holds".to_owned(),
            );
        }
        warnings
    }

    /// Returns true if an object is a level set.
    fn has_levels(&self) -> bool {
        let mut objects = self.models.values().flat_map(|m| m.objects.values());
        objects.any(|object| object.level_set.is_some())
    }

    /// Adds warnings of level sets and functions, which are not meshes.
    fn warn_of_levels(&self, report: &mut ReadReport) {
        if self.has_levels() {
            report.warn("level sets are passed over: they are functions, and have no triangles");
        } else if self.models.values().any(|m| m.needs_functions) {
            report.warn("functions for colours or materials are passed over");
        }
    }

    /// Returns the objects with meshes to be built, with their transforms.
    fn placed<'a>(
        &'a self,
        items: &'a [Component],
    ) -> std::result::Result<Vec<PlacedObject<'a>>, Problem> {
        let mut placed = self.contents(items)?;
        placed.retain(|p| !p.object.vertices.is_empty());
        Ok(placed)
    }

    /// Returns the objects with meshes or level sets to be built, with their transforms.
    fn contents<'a>(
        &'a self,
        items: &'a [Component],
    ) -> std::result::Result<Vec<PlacedObject<'a>>, Problem> {
        let mut costs = ObjectSizes {
            package: self,
            known: BTreeMap::new(),
        };
        let mut total = 0_u64;
        for item in items {
            total = total.saturating_add(costs.component(&self.root, item, 0)?.count);
        }
        let objects = self.models.values().flat_map(|m| m.objects.values());
        let held: u64 = objects.map(ModelObject::cost).sum();
        if total > MAX_EXPANDED_ITEMS.max(held) {
            let why = "copies of its objects come to more than 16 million vertices and triangles";
            return Err(Problem::new(ErrorKind::TooLarge, why));
        }
        let mut placed = Vec::new();
        for item in items {
            self.place(&self.root, item, None, &mut placed)?;
        }
        Ok(placed)
    }

    /// Returns the objects that no other object contains; they are built if the list of build items
    /// is empty.
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

    /// Returns the object that a component refers to, with the name of its model part.
    fn object<'a>(
        &'a self,
        part: &'a str,
        component: &'a Component,
    ) -> std::result::Result<(&'a str, &'a ModelObject), Problem> {
        let part = component.path.as_deref().unwrap_or(part);
        let model = self.models.get(part);
        let object = model.and_then(|m| m.objects.get(&component.object));
        object.map(|o| (part, o)).ok_or_else(|| {
            let why = format!("there is no object {} in {part}", component.object);
            Problem::new(ErrorKind::Index, why)
        })
    }

    /// Adds the meshes of a component, transformed by its own map and then by that of the enclosing
    /// object.
    fn place<'a>(
        &'a self,
        part: &'a str,
        component: &'a Component,
        outer: Option<Transform>,
        placed: &mut Vec<PlacedObject<'a>>,
    ) -> std::result::Result<(), Problem> {
        let (part, object) = self.object(part, component)?;
        let own = component.transform.as_deref().copied();
        let transform = match (own, outer) {
            (Some(own), Some(outer)) => Some(own.then(&outer)),
            (own, outer) => own.or(outer),
        };
        if !object.vertices.is_empty() || object.level_set.is_some() {
            placed.push(PlacedObject {
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

/// Returns the name of the model part: as stated by the relationships, else the usual one, else the
/// first part named like a model.
fn find_model(archive: &mut Archive, input: &mut Input<'_>) -> Result<Option<String>> {
    let relations = archive.find(MODEL_RELATIONSHIP[0]).map(str::to_owned);
    if let Some(relations) = relations {
        let target = archive.read(input, &relations, |text| target(&mut Tags::new(text)))?;
        let found = target.and_then(|t| archive.find(&t).map(str::to_owned));
        if found.is_some() {
            return Ok(found);
        }
    }
    let is_model = |n: &&str| n.to_ascii_lowercase().ends_with(".model");
    let found = archive
        .find(USUAL_MODEL_PART)
        .or_else(|| archive.names().find(is_model));
    Ok(found.map(str::to_owned))
}

/// Returns the target of the relationship to the model.
fn target(tags: &mut Tags<'_>) -> std::result::Result<Option<String>, Problem> {
    while let Some(tag) = tags.next()? {
        if let Tag::Open { attributes, .. } = tag
            && attribute(attributes, "Type").is_some_and(|t| t.ends_with(MODEL_RELATIONSHIP[1]))
            && let Some(target) = attribute(attributes, "Target")
        {
            return Ok(Some(target.trim_start_matches('/').to_owned()));
        }
    }
    Ok(None)
}

/// Size of an object with all its components.
#[derive(Clone, Copy)]
struct ObjectSize {
    /// Number of vertices, triangles and objects.
    count: u64,
    /// Number of levels of nested objects.
    height: u32,
}

/// Cache of object sizes. Each is computed once, which is fast even if expansion would be
/// exponential.
struct ObjectSizes<'p> {
    package: &'p Package,
    /// Known sizes by model part and object.
    known: BTreeMap<(&'p str, u32), ObjectSize>,
}

impl<'p> ObjectSizes<'p> {
    /// Returns the size of a component at a nesting depth.
    fn component(
        &mut self,
        part: &'p str,
        component: &'p Component,
        depth: u32,
    ) -> std::result::Result<ObjectSize, Problem> {
        let (part, object) = self.package.object(part, component)?;
        let key = (part, component.object);
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let mut cost = ObjectSize {
            count: object.cost(),
            height: 0,
        };
        for inner in &object.components {
            // A cycle never reaches known heights, so it ends at the depth limit.
            let inner = if depth < MAX_NESTING_DEPTH {
                self.component(part, inner, depth + 1)?
            } else {
                return Err(too_deep());
            };
            cost.count = cost.count.saturating_add(inner.count);
            cost.height = cost.height.max(inner.height + 1);
        }
        if cost.height > MAX_NESTING_DEPTH {
            return Err(too_deep());
        }
        self.known.insert(key, cost);
        Ok(cost)
    }
}

fn too_deep() -> Problem {
    let why = format!(
        "objects hold one another in a circle, or more than {MAX_NESTING_DEPTH} levels deep"
    );
    Problem::new(ErrorKind::Corrupt, why)
}

impl ModelObject {
    /// Returns the size of the object itself.
    fn cost(&self) -> u64 {
        1 + self.vertices.len() as u64 + self.triangles.len() as u64
    }
}

/// Passes placed objects to a collector, with their parts.
struct PartFiller<'c> {
    collector: &'c mut Collector,
    /// True if there are several meshes, which get distinct labels.
    are_many: bool,
    /// Number of uses of each label.
    labels: BTreeMap<String, u32>,
}

impl<'c> PartFiller<'c> {
    fn new(collector: &'c mut Collector, count: usize) -> Self {
        Self {
            collector,
            are_many: count > 1,
            labels: BTreeMap::new(),
        }
    }

    fn take_all(&mut self, placed: &[PlacedObject<'_>]) {
        for one in placed {
            let parts = self.parts(one);
            self.take(one, &parts);
        }
    }

    /// Adds the vertices and the triangles of a mesh.
    fn take(&mut self, placed: &PlacedObject<'_>, parts: &BTreeMap<Option<MaterialId>, u32>) {
        let PlacedObject {
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

    /// Adds the parts of a mesh, and returns them by material. For a single mesh its materials are
    /// the parts, in the order of their groups; it has no parts without materials. Each of several
    /// meshes is one part, or one part per material.
    fn parts(&mut self, placed: &PlacedObject<'_>) -> BTreeMap<Option<MaterialId>, u32> {
        let PlacedObject { model, object, .. } = placed;
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
            // All names of a used group are kept, so that written parts are restored.
            let groups = model.materials.iter().filter(|g| named.contains(g.0));
            for (&group, names) in groups {
                for (place, name) in (0..).zip(names) {
                    let part = self.collector.add_part(name);
                    parts.insert(Some((group, place)), part);
                }
            }
        }
        // Colours, of which there may be many, do not become parts.
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

    /// Returns a unique label for a mesh.
    fn label(&mut self, placed: &PlacedObject<'_>) -> String {
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
