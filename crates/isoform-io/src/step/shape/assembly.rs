//! Assemblies: which representation holds which parts, and where.
//!
//! Representations that a plain relationship joins are one node. A node holds solids and surfaces,
//! and other nodes in their places: by CONTEXT_DEPENDENT_SHAPE_REPRESENTATION or MAPPED_ITEM. Nodes
//! that no other holds are the roots.

use super::placed::{append, size};
use super::topology::{is_part, part, reference_of};
use super::units::{UNSTATED, Units, name_of};
use super::{Result, ShapeFile, ShapeReader, frame};
use crate::solids::wrong;
use crate::step::parse::Value;
use isoform_geom::UnionFind;
use isoform_geom::brep::Axes;
use isoform_geom::cad::{Placement, Shape};
use std::collections::{BTreeMap, BTreeSet};

/// Maximum depth of assemblies within assemblies.
const MAX_ASSEMBLY_DEPTH: usize = 64;
/// Size of all placed parts that any file may have, in numbers: half a gigabyte. Beyond it the size
/// is bounded by the length of the file.
const FREE_SIZE: usize = 1 << 22;
/// Items of representations that are not part of the shape, and that no remark names.
const SILENT: [&str; 4] = [
    "AXIS2_PLACEMENT_3D",
    "STYLED_ITEM",
    "OVER_RIDING_STYLED_ITEM",
    "ITEM_DEFINED_TRANSFORMATION",
];

/// AssemblyNode in its place within another.
struct Child {
    node: usize,
    place: Placement,
}

/// Representations that are one, with what they hold.
#[derive(Default)]
struct AssemblyNode {
    /// Solids and surfaces, with their units.
    parts: Vec<(u64, Units)>,
    children: Vec<Child>,
}

struct Assembler<'r, 'f> {
    reader: &'r ShapeReader<'f>,
    nodes: Vec<AssemblyNode>,
    /// Indices of nodes by the numbers of their representations.
    node_of: BTreeMap<u64, usize>,
    /// Names of products by the numbers of their representations.
    names: BTreeMap<u64, String>,
    made: ShapeFile,
    /// Parts that have been read, in their own units.
    read: BTreeMap<u64, Shape>,
    /// Nodes that have been placed.
    visited: BTreeSet<usize>,
    /// Number of coedges, faces and control points of edges that may still be read.
    budget: usize,
    /// Size of parts that may still be placed.
    room: usize,
    /// Unit of length of the result in metres.
    unit: f64,
}

/// Reads all parts of a file in their places; `length` is that of its text in bytes.
pub(super) fn assemble(reader: &ShapeReader, length: usize) -> Result<ShapeFile> {
    let representations = representations(reader);
    let mut assembler = Assembler {
        reader,
        nodes: Vec::new(),
        node_of: BTreeMap::new(),
        names: BTreeMap::new(),
        made: ShapeFile::default(),
        read: BTreeMap::new(),
        visited: BTreeSet::new(),
        // Edges that share a curve count it each time.
        budget: length.saturating_mul(4),
        room: FREE_SIZE + length,
        unit: UNSTATED.length,
    };
    assembler.join(&representations)?;
    assembler.find_names();
    assembler.fill(&representations)?;
    assembler.find_places()?;
    assembler.place_all()?;
    let name = name_of(assembler.unit);
    name.unwrap_or("mm").clone_into(&mut assembler.made.unit);
    Ok(assembler.made)
}

/// Returns the numbers of representations of shapes: instances with a list of items and a context.
fn representations(reader: &ShapeReader) -> Vec<u64> {
    let mut all = BTreeSet::new();
    for (name, numbers) in &reader.named {
        // Others hold styles, dimensions or curves in parameter planes.
        let is_shape = name.ends_with("SHAPE_REPRESENTATION") && !name.contains("DEPENDENT");
        if is_shape {
            all.extend(numbers);
        }
    }
    let has_items = |n: &u64| items(reader, *n).is_some();
    all.into_iter().filter(has_items).collect()
}

/// Returns the items and the context of a representation.
fn items(reader: &ShapeReader, number: u64) -> Option<(Vec<u64>, u64)> {
    let records = reader.file.instances.get(&number)?;
    let holds = |arguments: &[Value]| {
        let Some(Value::List(list)) = arguments.get(1) else {
            return None;
        };
        let items: Option<Vec<u64>> = list.iter().map(|v| reference_of(Some(v))).collect();
        Some((items?, reference_of(arguments.get(2))?))
    };
    records.iter().find_map(|r| holds(&r.arguments))
}

impl Assembler<'_, '_> {
    /// Makes one node of representations that are joined without a transformation.
    fn join(&mut self, representations: &[u64]) -> Result<()> {
        let index: BTreeMap<u64, u32> = representations.iter().copied().zip(0..).collect();
        let mut same = UnionFind::new(representations.len());
        for name in [
            "SHAPE_REPRESENTATION_RELATIONSHIP",
            "REPRESENTATION_RELATIONSHIP",
        ] {
            for number in self.reader.all(name) {
                let moves = "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION";
                if self.reader.find(*number, moves).is_some() {
                    continue;
                }
                let given = self.reader.record(*number, name)?;
                let ends = [2, 3].map(|k| reference_of(given.record.arguments.get(k)));
                let ends = ends.map(|n| n.and_then(|n| index.get(&n).copied()));
                if let [Some(a), Some(b)] = ends {
                    same.unite(a, b);
                }
            }
        }
        let mut roots: BTreeMap<u32, usize> = BTreeMap::new();
        for (number, i) in &index {
            let next = roots.len();
            let node = *roots.entry(same.root(*i)).or_insert(next);
            self.node_of.insert(*number, node);
        }
        self.nodes.resize_with(roots.len(), AssemblyNode::default);
        Ok(())
    }

    /// Finds the names of the products of representations.
    fn find_names(&mut self) {
        for number in self.reader.all("SHAPE_DEFINITION_REPRESENTATION") {
            let of = |n: u64, name: &str, k: usize| {
                let given = self.reader.find(n, name)?;
                reference_of(given.record.arguments.get(k))
            };
            let product = || {
                let shape = of(*number, "SHAPE_DEFINITION_REPRESENTATION", 0)?;
                let definition = of(shape, "PRODUCT_DEFINITION_SHAPE", 2)?;
                let formation = self.reader.first(definition).ok()?.record.arguments.get(2);
                let formation = self.reader.first(reference_of(formation)?).ok()?;
                let product = reference_of(formation.record.arguments.get(2))?;
                let given = self.reader.find(product, "PRODUCT")?;
                let name = given.text(1).ok().filter(|n| !n.is_empty());
                name.or(given.text(0).ok()).map(str::to_owned)
            };
            let representation = of(*number, "SHAPE_DEFINITION_REPRESENTATION", 1);
            if let (Some(representation), Some(name)) = (representation, product()) {
                self.names.insert(representation, name);
            }
        }
    }

    /// Distributes the items of representations over the nodes.
    fn fill(&mut self, representations: &[u64]) -> Result<()> {
        let mut remarked = BTreeSet::new();
        let mut first_unit = None;
        for number in representations {
            let Some((list, context)) = items(self.reader, *number) else {
                continue;
            };
            let units = self.reader.units(context)?;
            let node = self.node_of[number];
            for item in list {
                let kind = self.reader.kind(item);
                if is_part(kind) {
                    first_unit.get_or_insert(units.length);
                    self.nodes[node].parts.push((item, units));
                } else if kind == "MAPPED_ITEM" {
                    self.add_mapped(item, node, units)?;
                } else if !SILENT.contains(&kind) && remarked.insert(item) {
                    let at = self.reader.at(item);
                    let kinds = self.reader.kinds(item);
                    self.made.remarks.push(format!("{at} {kinds} is left out"));
                }
            }
        }
        let unit = first_unit.unwrap_or(UNSTATED.length);
        // Lengths in a unit without a name are converted.
        self.unit = if name_of(unit).is_some() { unit } else { 1e-3 };
        Ok(())
    }

    /// Adds the representation of a mapped item, in its place.
    fn add_mapped(&mut self, item: u64, node: usize, units: Units) -> Result<()> {
        let given = self.reader.record(item, "MAPPED_ITEM")?;
        let map = self
            .reader
            .record(given.reference(1)?, "REPRESENTATION_MAP")?;
        let (origin, source) = (map.reference(0)?, map.reference(1)?);
        let Some(child) = self.node_of.get(&source).copied() else {
            return Err(map.wrong("its representation is not read"));
        };
        let from = self.axes(origin, self.units_of(source)?)?;
        let place = self.target(given.reference(2)?, &from, units)?;
        self.nodes[node].children.push(Child { node: child, place });
        Ok(())
    }

    /// Reads a frame in metres.
    fn axes(&self, number: u64, units: Units) -> Result<Axes> {
        let axes = self.reader.axes(number)?;
        Ok(Axes {
            origin: axes.origin.map(|v| v * units.length),
            ..axes
        })
    }

    /// Returns the transformation from a frame to the target of a mapped item, in metres; `units`
    /// are those of the target.
    fn target(&self, target: u64, from: &Axes, units: Units) -> Result<Placement> {
        let Some(operator) = self
            .reader
            .find(target, "CARTESIAN_TRANSFORMATION_OPERATOR_3D")
        else {
            return Ok(Placement::between(from, &self.axes(target, units)?));
        };
        // Plain: name, name, description, x, y, origin, scale, z.
        let arguments = &operator.record.arguments;
        let direction = |k: usize| match reference_of(arguments.get(k)) {
            Some(n) => self.reader.direction(n).map(Some),
            None => Ok(None),
        };
        let (x, y, z) = (direction(3)?, direction(4)?, direction(7)?);
        let origin = self.reader.point(operator.reference(5)?)?;
        let origin = origin.map(|v| v * units.length);
        let scale = match arguments.get(6) {
            Some(Value::Number(scale)) => *scale,
            _ => 1.0,
        };
        let z = z.unwrap_or([0.0, 0.0, 1.0]);
        let to = frame(origin, z, Some(x.unwrap_or([1.0, 0.0, 0.0])));
        let to = to.ok_or_else(|| operator.wrong("its directions are parallel"))?;
        let is_mirrored = y.is_some_and(|y| isoform_geom::dot(y, to.y()) < 0.0);
        if is_mirrored || scale <= 0.0 {
            return Err(operator.wrong("mirrored placements are not read"));
        }
        let mut place = Placement::between(from, &to);
        let origin = from.origin;
        place.scale = scale;
        let moved = place.point(origin);
        place.shift = std::array::from_fn(|k| place.shift[k] + to.origin[k] - moved[k]);
        Ok(place)
    }

    fn units_of(&self, representation: u64) -> Result<Units> {
        match items(self.reader, representation) {
            Some((_, context)) => self.reader.units(context),
            None => Ok(UNSTATED),
        }
    }

    /// Finds the places of representations within others.
    fn find_places(&mut self) -> Result<()> {
        for number in self.reader.all("CONTEXT_DEPENDENT_SHAPE_REPRESENTATION") {
            let given = self
                .reader
                .record(*number, "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION")?;
            let (relation, shape) = (given.reference(0)?, given.reference(1)?);
            let ends = self
                .reader
                .record(relation, "REPRESENTATION_RELATIONSHIP")?;
            let moves = "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION";
            let moves = self.reader.record(relation, moves)?;
            let by = self
                .reader
                .record(moves.reference(0)?, "ITEM_DEFINED_TRANSFORMATION")?;
            let [mut child, mut parent] = [ends.reference(2)?, ends.reference(3)?];
            let mut frames = [by.reference(2)?, by.reference(3)?];
            if self.is_swapped(shape, child, parent) {
                (child, parent) = (parent, child);
                frames.reverse();
            }
            let at = [child, parent].map(|n| self.node_of.get(&n).copied());
            let [Some(node), Some(within)] = at else {
                return Err(ends.wrong("its representations are not read"));
            };
            let from = self.axes(frames[0], self.units_of(child)?)?;
            let to = self.axes(frames[1], self.units_of(parent)?)?;
            let place = Placement::between(&from, &to);
            self.nodes[within].children.push(Child { node, place });
        }
        Ok(())
    }

    /// Returns true if a relationship names the assembly first, as its product definitions say.
    fn is_swapped(&self, shape: u64, first: u64, second: u64) -> bool {
        let of = |n: u64, name: &str, k: usize| {
            let given = self.reader.find(n, name)?;
            reference_of(given.record.arguments.get(k))
        };
        let Some(usage) = of(shape, "PRODUCT_DEFINITION_SHAPE", 2) else {
            return false;
        };
        let part = of(usage, "NEXT_ASSEMBLY_USAGE_OCCURRENCE", 4);
        let Some(part) = part else { return false };
        // Representations of the part's definition.
        let mut own = BTreeSet::new();
        for number in self.reader.all("SHAPE_DEFINITION_REPRESENTATION") {
            let name = "SHAPE_DEFINITION_REPRESENTATION";
            let shape = of(*number, name, 0);
            let definition = shape.and_then(|s| of(s, "PRODUCT_DEFINITION_SHAPE", 2));
            if definition == Some(part)
                && let Some(representation) = of(*number, name, 1)
                && let Some(node) = self.node_of.get(&representation)
            {
                own.insert(*node);
            }
        }
        let is_own = |n: u64| self.node_of.get(&n).is_some_and(|n| own.contains(n));
        !is_own(first) && is_own(second)
    }

    /// Places the parts of all roots, and those parts that no representation holds.
    fn place_all(&mut self) -> Result<()> {
        let mut is_child = vec![false; self.nodes.len()];
        for child in self.nodes.iter().flat_map(|n| &n.children) {
            is_child[child.node] = true;
        }
        let mut names: BTreeMap<usize, String> = BTreeMap::new();
        for (number, name) in &self.names {
            if let Some(node) = self.node_of.get(number) {
                names.entry(*node).or_insert_with(|| name.clone());
            }
        }
        let whole = Placement::scaling(1.0 / self.unit);
        for node in (0..self.nodes.len()).filter(|n| !is_child[*n]) {
            self.place(node, &whole, &names, 0)?;
        }
        if self.visited.len() < self.nodes.len() {
            return Err(wrong("assembly", "parts are within one another"));
        }
        self.place_loose()
    }

    /// Places the parts of a node and of those within it. `by` takes metres to the result.
    fn place(
        &mut self,
        node: usize,
        by: &Placement,
        names: &BTreeMap<usize, String>,
        depth: usize,
    ) -> Result<()> {
        if depth > MAX_ASSEMBLY_DEPTH {
            let problem = "parts are within one another, or too deep in assemblies";
            return Err(wrong("assembly", problem));
        }
        // Each visit counts, so that empty assemblies within one another end, too.
        self.spend(16, "assembly".to_owned())?;
        self.visited.insert(node);
        let parts = std::mem::take(&mut self.nodes[node].parts);
        let name = names.get(&node).map_or("", String::as_str);
        for (number, units) in &parts {
            // A product, rather than a factor near one, where the units agree.
            let factor = units.length;
            let scale = if factor == self.unit && by.scale == 1.0 / self.unit {
                1.0
            } else {
                by.scale * factor
            };
            self.place_part(*number, *units, &Placement { scale, ..*by }, name)?;
        }
        self.made.parts += usize::from(!parts.is_empty());
        self.nodes[node].parts = parts;
        for k in 0..self.nodes[node].children.len() {
            let Child { node: child, place } = self.nodes[node].children[k];
            self.place(child, &by.after(&place), names, depth + 1)?;
        }
        Ok(())
    }

    fn spend(&mut self, size: usize, at: String) -> Result<()> {
        let left = self.room.checked_sub(size);
        self.room = left.ok_or_else(|| wrong(at, "the placed parts are too many for this file"))?;
        Ok(())
    }

    fn place_part(&mut self, number: u64, units: Units, by: &Placement, name: &str) -> Result<()> {
        if !self.read.contains_key(&number) {
            let read = part(self.reader, number, units, &mut self.budget)?;
            self.read.insert(number, read);
        }
        self.spend(size(&self.read[&number]), self.reader.at(number))?;
        append(&mut self.made.shape, &self.read[&number], by, name);
        Ok(())
    }

    /// Places the solids that no representation holds, as they are.
    fn place_loose(&mut self) -> Result<()> {
        let mut loose = Vec::new();
        for name in [
            "MANIFOLD_SOLID_BREP",
            "BREP_WITH_VOIDS",
            "FACETED_BREP",
            "SHELL_BASED_SURFACE_MODEL",
        ] {
            let all = self.reader.all(name).iter().copied();
            loose.extend(all.filter(|n| !self.read.contains_key(n)));
        }
        for number in loose {
            let at = self.reader.at(number);
            let kind = self.reader.kind(number);
            let remark = format!("{at} {kind} is in no representation, and taken as it is");
            self.made.remarks.push(remark);
            self.place_part(number, UNSTATED, &Placement::IDENTITY, "")?;
            self.made.parts += 1;
        }
        Ok(())
    }
}
