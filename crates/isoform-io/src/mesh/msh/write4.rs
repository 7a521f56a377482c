//! Writer of version 4.1.
//!
//! Nodes belong to the smallest entity on which they lie: a corner, else a curve, a part or a
//! region. Elements are written in one block per entity and type. [`FieldWriter`] hides the
//! difference between text and binary fields.

use super::{PhysicalNames, element_type, volume_in_gmsh_order};
use crate::mesh::boundary::parts_of_regions;
use crate::mesh::group::{
    Groups, edge, face, face_count, face_part, volume, volume_count, volume_region,
};
use crate::mesh::options::MeshWriteOptions;
use crate::mesh::out::Out;
use isoform_geom::{Aabb, Mesh, Point3};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::{self, Write};

/// Writer of text or binary fields.
struct FieldWriter<'o> {
    out: Out<'o>,
    /// True if fields are binary, in little-endian order.
    binary: bool,
}

impl FieldWriter<'_> {
    /// Writes an integer of 32 bits.
    fn int(&mut self, v: i32) {
        match self.binary {
            true => self.out.bytes(&v.to_le_bytes()),
            false => self.out.int(v).str(" "),
        };
    }
    /// Writes a count or tag of 64 bits.
    fn size(&mut self, v: usize) {
        match self.binary {
            true => self.out.bytes(&(v as u64).to_le_bytes()),
            false => self.out.int(v).str(" "),
        };
    }
    /// Writes a double.
    fn double(&mut self, v: f64) {
        match self.binary {
            true => self.out.bytes(&v.to_le_bytes()),
            false => self.out.float(v).str(" "),
        };
    }
    /// Writes a box: lower corner, then upper corner.
    fn bounds(&mut self, bounds: &Aabb) {
        let corners = bounds.lo.iter().chain(&bounds.hi);
        corners.for_each(|&v| self.double(v));
    }
    /// Ends a line of text.
    fn end(&mut self) -> io::Result<()> {
        if self.binary {
            self.out.end()
        } else {
            self.out.line()
        }
    }
    /// Writes the line that starts a section, which is text even in binary files.
    fn section(&mut self, name: &str) -> io::Result<()> {
        self.out.str("$").str(name).line()
    }
    /// Writes the line that ends a section.
    fn close(&mut self, name: &str) -> io::Result<()> {
        if self.binary {
            self.out.str("\n");
        }
        self.out.str("$End").str(name).line()
    }
}

/// Elements of each dimension by entity, and nodes by the smallest entity on which they lie.
struct MeshEntities {
    /// Elements of curves, surfaces and volumes.
    groups: [Groups; 3],
    /// Nodes by the entity that owns them.
    nodes: Groups,
    /// Number of entities by dimension.
    count: [usize; 4],
}

impl MeshEntities {
    /// Determines the entities of a mesh; a mesh without elements has one surface for its nodes.
    fn from_mesh(mesh: &Mesh) -> Self {
        let groups = [
            Groups::curves(mesh),
            Groups::parts(mesh),
            Groups::regions(mesh),
        ];
        let mut count = [
            mesh.corners.len(),
            groups[0].len(),
            groups[1].len(),
            groups[2].len(),
        ];
        if count == [0; 4] {
            count[2] = 1; // nodes lie on an entity
        }
        let all: usize = count.iter().sum();
        let owner = owners(mesh, count);
        Self {
            groups,
            nodes: Groups::new(&owner, all, mesh.points.len()),
            count,
        }
    }
    /// Returns the elements of entity `i` of a dimension from 1 to 3.
    fn elements(&self, dim: usize, i: usize) -> &[u32] {
        let group = &self.groups[dim - 1];
        if i < group.len() {
            group.elements(i)
        } else {
            &[]
        }
    }
    /// Returns dimension and tag of an entity, given its index among all entities.
    fn name(&self, mut entity: usize) -> (usize, usize) {
        let mut dim = 0;
        while entity >= self.count[dim] {
            entity -= self.count[dim];
            dim += 1;
        }
        (dim, entity + 1)
    }
}

/// Returns the smallest entity on which each node lies, as an index among all entities: points,
/// curves, surfaces and volumes.
fn owners(mesh: &Mesh, count: [usize; 4]) -> Vec<u32> {
    let curves = count[0];
    let surfaces = curves + count[1];
    let volumes = surfaces + count[2];
    let last = volumes + count[3] - 1;
    let mut owner = vec![last as u32; mesh.points.len()];
    let mut own = |nodes: &[u32], entity: usize| {
        for &n in nodes {
            owner[n as usize] = entity as u32;
        }
    };
    // Large entities first, so that smaller ones overwrite them.
    for i in 0..volume_count(mesh) {
        let (nodes, n) = volume(mesh, i);
        let region = volume_region(mesh, i).unwrap_or(0);
        own(&nodes[..n], volumes + region as usize);
    }
    for i in 0..face_count(mesh) {
        let (nodes, n) = face(mesh, i);
        let part = face_part(mesh, i).unwrap_or(0);
        own(&nodes[..n], surfaces + part as usize);
    }
    for i in 0..mesh.edges.len() {
        let (nodes, n) = edge(mesh, i);
        let curve = mesh.edge_curves.get(i).copied().unwrap_or(0);
        own(&nodes[..n], curves + curve as usize);
    }
    for (i, &c) in mesh.corners.iter().enumerate() {
        own(&[c], i);
    }
    owner
}

/// Writes the sections: format, physical names, entities, nodes, elements.
pub(in crate::mesh) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let binary = options.ascii == Some(false);
    let mut out = FieldWriter {
        out: Out::new(out),
        binary,
    };
    out.out
        .str("$MeshFormat\n4.1 ")
        .int(i32::from(binary))
        .str(" 8")
        .line()?;
    if binary {
        out.out.bytes(&1_i32.to_le_bytes()).line()?;
    }
    out.out.str("$EndMeshFormat").line()?;
    let physical = PhysicalNames::from_mesh(mesh);
    physical.write(&mut out.out)?;
    let entities = MeshEntities::from_mesh(mesh);
    write_entities(mesh, &entities, &physical, &mut out)?;
    write_nodes(mesh, &entities.nodes, &entities, &mut out)?;
    write_elements(mesh, &entities, &mut out)?;
    write_periodic(mesh, &mut out)?;
    out.out.flush()
}

/// Writes the section of entities: points, then curves, surfaces and volumes with their boxes,
/// physical group and bounding entities.
fn write_entities(
    mesh: &Mesh,
    entities: &MeshEntities,
    physical: &PhysicalNames,
    out: &mut FieldWriter<'_>,
) -> io::Result<()> {
    out.section("Entities")?;
    entities.count.iter().for_each(|&n| out.size(n));
    out.end()?;
    for (i, &c) in mesh.corners.iter().enumerate() {
        out.int(i as i32 + 1);
        mesh.points[c as usize].iter().for_each(|&v| out.double(v));
        out.size(1);
        out.int(1);
        out.end()?;
    }
    let volumes = match entities.count[3] {
        0 => Vec::new(),
        _ => parts_of_regions(mesh),
    };
    let bounding = [Vec::new(), curves_of_parts(mesh, entities), volumes];
    for dim in 1..4 {
        for i in 0..entities.count[dim] {
            out.int(i as i32 + 1);
            out.bounds(&bounds(mesh, dim, entities.elements(dim, i)));
            out.size(usize::from(physical.has(dim)));
            if physical.has(dim) {
                out.int(i as i32 + 1);
            }
            let around = bounding[dim - 1].get(i).map_or(&[][..], Vec::as_slice);
            out.size(around.len());
            around.iter().for_each(|&b| out.int(b as i32 + 1));
            out.end()?;
        }
    }
    out.close("Entities")
}

/// Returns the curves that bound each part.
fn curves_of_parts(mesh: &Mesh, entities: &MeshEntities) -> Vec<Vec<u32>> {
    let mut found = vec![Vec::new(); entities.count[2]];
    for (i, curve) in mesh.curves.iter().enumerate().take(entities.count[1]) {
        let [a, b] = curve.parts;
        let parts = if a == b {
            &curve.parts[..1]
        } else {
            &curve.parts[..]
        };
        for &part in parts {
            if let Some(list) = found.get_mut(part as usize) {
                list.push(i as u32);
            }
        }
    }
    found
}

/// Part on the upper side of a periodic cell with its translate on the lower side, and the pairs of
/// corresponding nodes (upper, lower).
struct PeriodicLink {
    parts: [u32; 2],
    shift: Point3,
    nodes: Vec<[u32; 2]>,
}

/// Returns the corners of a face.
fn corners(mesh: &Mesh, i: usize) -> Vec<u32> {
    let (nodes, n) = face(mesh, i);
    nodes[..if n == 4 { 4 } else { 3 }].to_vec()
}

/// Sorts indices, for the comparison of faces.
fn sorted(mut nodes: Vec<u32>) -> Vec<u32> {
    nodes.sort_unstable();
    nodes
}

/// Returns the pairs of corresponding parts of a periodic cell.
fn links(mesh: &Mesh) -> Vec<PeriodicLink> {
    let part = |k: usize| face_part(mesh, k).unwrap_or(0);
    let part_of: HashMap<Vec<u32>, u32> = (0..face_count(mesh))
        .map(|k| (sorted(corners(mesh, k)), part(k)))
        .collect();
    let mut links = Vec::new();
    for sides in &mesh.opposite {
        let lower: HashMap<u32, u32> = sides.nodes.iter().map(|&[a, b]| (b, a)).collect();
        let mut nodes: BTreeMap<[u32; 2], BTreeSet<[u32; 2]>> = BTreeMap::new();
        for k in 0..face_count(mesh) {
            let image = corners(mesh, k)
                .into_iter()
                .map(|v| lower.get(&v).copied())
                .collect::<Option<Vec<_>>>();
            let Some(image) = image else {
                continue;
            };
            if let Some(&below) = part_of.get(&sorted(image)) {
                let (all, n) = face(mesh, k);
                let pairs = all[..n].iter().filter_map(|v| Some([*v, *lower.get(v)?]));
                nodes.entry([part(k), below]).or_default().extend(pairs);
            }
        }
        let Some(&[a, b]) = sides.nodes.first() else {
            continue;
        };
        let shift =
            std::array::from_fn(|i| mesh.points[b as usize][i] - mesh.points[a as usize][i]);
        links.extend(nodes.into_iter().map(|(parts, nodes)| PeriodicLink {
            parts,
            shift,
            nodes: nodes.into_iter().collect(),
        }));
    }
    links
}

/// Writes the section of periodic entities, if the mesh is a periodic cell: for each part on an
/// upper side its translate on the lower side, the translation, and the nodes of both.
fn write_periodic(mesh: &Mesh, out: &mut FieldWriter<'_>) -> io::Result<()> {
    // Spares meshes that are not periodic, the majority, a list of their triangles.
    if mesh.opposite.is_empty() {
        return Ok(());
    }
    let links = links(mesh);
    if links.is_empty() {
        return Ok(());
    }
    out.section("Periodic")?;
    out.size(links.len());
    out.end()?;
    for PeriodicLink {
        parts,
        shift,
        nodes,
    } in links
    {
        [2, parts[0] as i32 + 1, parts[1] as i32 + 1]
            .iter()
            .for_each(|&v| out.int(v));
        out.end()?;
        // Affine map, by rows, that takes the lower part to the upper one.
        out.size(16);
        for i in 0..4 {
            let row = [0, 1, 2].map(|j| if i == j { 1.0 } else { 0.0 });
            row.iter().for_each(|&v| out.double(v));
            out.double(if i < 3 { shift[i] } else { 1.0 });
        }
        out.end()?;
        out.size(nodes.len());
        out.end()?;
        for pair in nodes {
            pair.iter().for_each(|&v| out.size(v as usize + 1));
            out.end()?;
        }
    }
    out.close("Periodic")
}

/// Returns the bounding box of elements; a point at the origin without elements.
fn bounds(mesh: &Mesh, dim: usize, elements: &[u32]) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    let mut add = |nodes: &[u32]| {
        nodes
            .iter()
            .for_each(|&n| bounds.add(mesh.points[n as usize]))
    };
    for &e in elements {
        with_nodes(mesh, dim, e as usize, &mut add);
    }
    if bounds.is_empty() {
        Aabb {
            lo: [0.0; 3],
            hi: [0.0; 3],
        }
    } else {
        bounds
    }
}

/// Calls `visit` with the nodes of an element of a dimension.
fn with_nodes(mesh: &Mesh, dim: usize, i: usize, visit: &mut impl FnMut(&[u32])) {
    match dim {
        1 => {
            let (nodes, n) = edge(mesh, i);
            visit(&nodes[..n]);
        }
        2 => {
            let (nodes, n) = face(mesh, i);
            visit(&nodes[..n]);
        }
        _ => {
            let (nodes, n) = volume_in_gmsh_order(mesh, i);
            visit(&nodes[..n]);
        }
    }
}

/// Writes the section of nodes: a block for each entity that owns some, with all numbers before all
/// coordinates.
fn write_nodes(
    mesh: &Mesh,
    nodes: &Groups,
    entities: &MeshEntities,
    out: &mut FieldWriter<'_>,
) -> io::Result<()> {
    let n = mesh.points.len();
    out.section("Nodes")?;
    [nodes.filled().count(), n, n.min(1), n]
        .iter()
        .for_each(|&v| out.size(v));
    out.end()?;
    for (entity, nodes) in nodes.filled() {
        let (dim, tag) = entities.name(entity);
        [dim, tag, 0].iter().for_each(|&v| out.int(v as i32));
        out.size(nodes.len());
        out.end()?;
        for &i in nodes {
            out.size(i as usize + 1);
            out.end()?;
        }
        for &i in nodes {
            mesh.points[i as usize].iter().for_each(|&v| out.double(v));
            out.end()?;
        }
    }
    out.close("Nodes")
}

/// Writes the section of elements: points, each in a block of its own, then a block for every
/// entity and element type. Elements are numbered from 1 by dimension and in the order of the mesh.
fn write_elements(
    mesh: &Mesh,
    entities: &MeshEntities,
    out: &mut FieldWriter<'_>,
) -> io::Result<()> {
    let counts = [
        mesh.corners.len(),
        mesh.edges.len(),
        face_count(mesh),
        volume_count(mesh),
    ];
    let n: usize = counts.iter().sum();
    let filled = (1..4).map(|dim| blocks(mesh, entities, dim).count());
    let blocks_in_all = counts[0] + filled.sum::<usize>();
    out.section("Elements")?;
    [blocks_in_all, n, n.min(1), n]
        .iter()
        .for_each(|&v| out.size(v));
    out.end()?;
    for (i, &c) in mesh.corners.iter().enumerate() {
        [0, i + 1, 15].iter().for_each(|&v| out.int(v as i32));
        out.size(1);
        out.end()?;
        out.size(i + 1);
        out.size(c as usize + 1);
        out.end()?;
    }
    let mut before = counts[0];
    for dim in 1..4 {
        for (i, elements) in blocks(mesh, entities, dim) {
            let block = ElementBlock {
                dim,
                tag: i as i32 + 1,
                elements,
                before,
            };
            block.write(mesh, out)?;
        }
        before += counts[dim];
    }
    out.close("Elements")
}

/// Returns the elements of every non-empty entity of a dimension by type, with the index of the
/// entity: triangles before quadrilaterals, tetrahedra before wedges.
fn blocks<'e>(
    mesh: &Mesh,
    entities: &'e MeshEntities,
    dim: usize,
) -> impl Iterator<Item = (usize, &'e [u32])> {
    let simplices = [mesh.edges.len(), mesh.triangles.len(), mesh.tets.len()][dim - 1];
    let filled = entities.groups[dim - 1].filled();
    filled
        .flat_map(move |(i, elements)| {
            let first_other = elements.partition_point(|e| (*e as usize) < simplices);
            let (simplices, others) = elements.split_at(first_other);
            [(i, simplices), (i, others)]
        })
        .filter(|(_, elements)| !elements.is_empty())
}

/// Elements of one type in an entity.
struct ElementBlock<'m> {
    /// Dimension of the entity.
    dim: usize,
    /// Tag of the entity, from 1.
    tag: i32,
    /// Elements, at least one.
    elements: &'m [u32],
    /// Number of elements of smaller dimensions, which are numbered first.
    before: usize,
}

impl ElementBlock<'_> {
    /// Writes the header of the block, whose type is that of its first element, and the elements.
    fn write(&self, mesh: &Mesh, out: &mut FieldWriter<'_>) -> io::Result<()> {
        let mut size = 0;
        with_nodes(mesh, self.dim, self.elements[0] as usize, &mut |nodes| {
            size = nodes.len()
        });
        [self.dim as i32, self.tag, element_type(self.dim, size)]
            .iter()
            .for_each(|&v| out.int(v));
        out.size(self.elements.len());
        out.end()?;
        for &e in self.elements {
            out.size(self.before + e as usize + 1);
            with_nodes(mesh, self.dim, e as usize, &mut |nodes| {
                nodes.iter().for_each(|&v| out.size(v as usize + 1))
            });
            out.end()?;
        }
        Ok(())
    }
}
