//! Wedges between the surface of the core and that of the solid.

use crate::distance::{first_order_at, zero_in};
use crate::error::MeshError;
use crate::options::Layers;
use crate::points::{lerp, unique, unit};
use crate::surface::newton;
use isoform_geom::{Aabb, Mesh, Point3, Solid, dot, norm, sub};
use std::collections::{BTreeMap, HashMap, HashSet};

/// Distance over which the ways of nodes turn into those of an edge, in thicknesses: a larger one
/// makes ways lean farther into faces, a smaller one squeezes layers near concave edges.
const LEAN_RANGE_THICKNESSES: f64 = 2.0;
/// Maximum number of rounds in which ways are averaged over neighbours; a round carries them by one
/// edge, and layers are seldom as thick as a dozen edges.
const MAX_LEAN_ROUNDS: usize = 300;
/// Minimum share of its thickness that is left to the last layer. With less, all layers are scaled
/// to the available thickness: offsets of strongly curved surfaces are thinner than requested.
const MIN_LAST_LAYER_SHARE: f64 = 0.3;

/// Pieces of the surface on which a node of the core lies.
#[derive(Clone, Default)]
struct NodePieces {
    /// Pieces with layers.
    layered: Vec<u32>,
    /// Pieces without layers.
    others: Vec<u32>,
}

impl NodePieces {
    /// Returns all pieces.
    fn all(&self) -> Vec<u32> {
        self.layered.iter().chain(&self.others).copied().collect()
    }
}

/// A neighbour that the way of a node follows.
struct Neighbour {
    node: usize,
    /// Weight in the average: one over the square of its distance.
    weight: f64,
    /// Fixed lean of the neighbour's way as seen from the node's pieces, if the neighbour lies on
    /// more of them.
    end: Option<Point3>,
}

/// A mesh with layers.
pub(crate) struct LayeredMesh {
    pub(crate) mesh: Mesh,
    /// Minimum total thickness of the layers, and a point where it occurs.
    pub(crate) thinnest: Option<(f64, Point3)>,
}

/// Context in which layers are grown.
struct Grower<'a> {
    solid: &'a dyn Solid,
    layers: &'a Layers,
    /// Flag per piece of the solid: true if it has layers.
    layered: &'a [bool],
    /// Piece of each part of the mesh; `None` if the part is not a piece.
    pieces: Vec<Option<u32>>,
    /// Flag per part: true if it has layers.
    is_layered: Vec<bool>,
    /// Distance up to which a node is on a piece: rounding.
    zero: f64,
    /// Distance above which a node is off a piece.
    off: f64,
}

/// Grows layers of wedges from the surface of a core to that of its solid; converts a mesh of the
/// core to one of the solid.
///
/// # Errors
/// [`MeshError::LayersEnd`] where parts without layers meet those with layers, but not in an edge
/// on which layers could stand.
pub(crate) fn grow(
    core: &Mesh,
    solid: &dyn Solid,
    layered: &[bool],
    layers: &Layers,
    region: Aabb,
) -> Result<LayeredMesh, MeshError> {
    let number: HashMap<&str, u32> = (0u32..)
        .zip(solid.names())
        .map(|(i, name)| (name.as_str(), i))
        .collect();
    let pieces: Vec<Option<u32>> = core
        .parts
        .iter()
        .map(|part| number.get(part.as_str()).copied())
        .collect();
    let of = |piece: &Option<u32>| piece.is_some_and(|i| layered[i as usize]);
    let grower = Grower {
        solid,
        layers,
        layered,
        is_layered: pieces.iter().map(of).collect(),
        pieces,
        zero: zero_in(region),
        // The certificate takes this for rounding.
        off: 1e-9 * region.diagonal(),
    };
    let stands = grower.stands(core);
    grower.check_others(core, &stands)?;
    let columns = grower.columns(core, stands)?;
    let thin = columns
        .iter()
        .min_by(|a, b| a.1.reach.total_cmp(&b.1.reach));
    Ok(LayeredMesh {
        mesh: grower.filled(core, &columns),
        thinnest: thin.map(|(&v, column)| (column.reach, core.points[v as usize])),
    })
}

/// Pieces of the nodes of the core that are on parts with layers, by node.
type PiecesByNode = BTreeMap<u32, NodePieces>;

/// The nodes over a node of the core.
struct Column {
    /// Nodes from the surface of the solid to that of the core.
    nodes: Vec<Point3>,
    /// Distance of the core from the surface there.
    reach: f64,
}

/// Columns by their nodes of the core.
type Columns = BTreeMap<u32, Column>;

impl Grower<'_> {
    /// Returns true if a triangle of the core has layers.
    fn has_layers(&self, core: &Mesh, triangle: usize) -> bool {
        let part = core.triangle_parts.get(triangle);
        part.is_some_and(|&part| self.is_layered[part as usize])
    }

    /// Returns the distance of a point to the surface of the solid, with the piece that decides it.
    fn value(&self, p: Point3) -> (f64, u32) {
        let of = |piece| first_order_at(self.solid, piece, p);
        self.solid.tree().value_and_piece(&of)
    }

    /// Searches for triangles of parts without layers that are off the solid's surface: those of a
    /// part along which the core continues where the layers of another part would have to end.
    fn check_others(&self, core: &Mesh, stands: &PiecesByNode) -> Result<(), MeshError> {
        for (k, triangle) in core.triangles.iter().enumerate() {
            if self.has_layers(core, k) {
                continue;
            }
            for v in triangle.iter().filter(|v| !stands.contains_key(v)) {
                let p = core.points[*v as usize];
                if self.value(p).0.abs() > self.off {
                    let part = core.triangle_parts.get(k).map(|&i| i as usize);
                    let other = part.and_then(|part| self.pieces[part]);
                    return Err(self.ends(other.unwrap_or_else(|| self.value(p).1), p));
                }
            }
        }
        Ok(())
    }

    /// Creates the error of layers that end at a piece, near a point; the layers named are those on
    /// the nearest piece with layers.
    fn ends(&self, other: u32, at: Point3) -> MeshError {
        let distance = |piece: &u32| first_order_at(self.solid, *piece, at).abs();
        let layered = self.pieces.iter().zip(&self.is_layered);
        let layered = layered.filter_map(|(piece, is_layered)| piece.filter(|_| *is_layered));
        let nearest = layered.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let name = |piece: u32| self.solid.names()[piece as usize].clone();
        MeshError::LayersEnd {
            part: nearest.map(name).unwrap_or_default(),
            other: name(other),
            at,
        }
    }

    /// Collects the pieces on which the nodes on parts with layers lie.
    fn stands(&self, core: &Mesh) -> PiecesByNode {
        let triangles = core.triangles.iter().enumerate();
        let layered = triangles.clone().filter(|(k, _)| self.has_layers(core, *k));
        let nodes = layered.flat_map(|(_, triangle)| *triangle);
        let mut stands: PiecesByNode = nodes.map(|v| (v, NodePieces::default())).collect();
        for (k, triangle) in triangles {
            let Some(piece) = self.pieces[core.triangle_parts[k] as usize] else {
                continue;
            };
            for v in triangle {
                if let Some(stand) = stands.get_mut(v) {
                    match self.has_layers(core, k) {
                        true => stand.layered.push(piece),
                        false => stand.others.push(piece),
                    }
                }
            }
        }
        for stand in stands.values_mut() {
            stand.layered = unique(std::mem::take(&mut stand.layered));
            stand.others = unique(std::mem::take(&mut stand.others));
        }
        stands
    }

    /// Returns the nearest point on the first three pieces, which meet in a point; `None` if
    /// Newton's method fails.
    fn foot(&self, pieces: &[u32], from: Point3) -> Option<Point3> {
        let pieces = &pieces[..pieces.len().min(3)];
        let mut p = from;
        // Some five steps of Newton's method are usual.
        for _ in 0..50 {
            let (step, off) = newton(&|i, p| self.solid.gradient(i, p), pieces, p)?;
            if off <= self.zero {
                return Some(p);
            }
            p = sub(p, step);
        }
        None
    }

    /// Returns the columns of nodes between the core and the solid's surface.
    fn columns(&self, core: &Mesh, stands: PiecesByNode) -> Result<Columns, MeshError> {
        let nodes: Vec<u32> = stands.keys().copied().collect();
        let stands: Vec<NodePieces> = stands.into_values().collect();
        let ways = self.ways(core, &nodes, &stands);
        let columns = nodes.iter().zip(&stands).zip(ways);
        let column = |((&v, stand), way)| {
            let top = core.points[v as usize];
            Ok((v, self.column(top, way, stand)?))
        };
        columns.map(column).collect()
    }

    /// Returns the vector from a point to the nearest one on some pieces; 0 if there is none.
    fn way(&self, pieces: &[u32], from: Point3) -> Point3 {
        let foot = self.foot(pieces, from);
        foot.map_or([0.0; 3], |p| sub(p, from))
    }

    /// Returns the vectors ("ways") from nodes of the core to the solid's surface.
    ///
    /// On a face this is the vector to the nearest point. Where the core's edges are not opposite
    /// the nearest points of the solid's edges, faces of the two differ in width: ways *lean*
    /// towards the edge, decreasing with the distance from it, over [`LEAN_RANGE_THICKNESSES`]
    /// thicknesses. Along edges they lean towards corners likewise, and faces follow edges that do.
    fn ways(&self, core: &Mesh, nodes: &[u32], stands: &[NodePieces]) -> Vec<Point3> {
        let all: Vec<Vec<u32>> = stands.iter().map(NodePieces::all).collect();
        let places: Vec<Point3> = nodes.iter().map(|&v| core.points[v as usize]).collect();
        let near = self.neighbours(core, nodes, &all);
        let upright = all.iter().zip(&places).map(|(all, p)| self.way(all, *p));
        let mut ways: Vec<Point3> = upright.collect();
        for pieces in [2, 1] {
            let follows = |v: &usize| all[*v].len() == pieces;
            let followers: Vec<usize> = (0..nodes.len()).filter(follows).collect();
            let neighbour = |v: usize, n: usize| {
                let way = sub(places[n], places[v]);
                let is_end = all[n].len() > pieces;
                Neighbour {
                    node: n,
                    weight: 1.0 / dot(way, way).max(f64::MIN_POSITIVE),
                    end: is_end.then(|| sub(ways[n], self.way(&all[v], places[n]))),
                }
            };
            let of = |&v: &usize| near[v].iter().map(|&n| neighbour(v, n)).collect();
            let near: Vec<Vec<Neighbour>> = followers.iter().map(of).collect();
            let leans = self.leans(nodes.len(), &followers, &near);
            for &v in &followers {
                ways[v] = std::array::from_fn(|i| ways[v][i] + leans[v][i]);
            }
        }
        ways
    }

    /// Returns the leans of the ways of some nodes: weighted means of their neighbours' leans and
    /// of 0.
    fn leans(&self, n: usize, followers: &[usize], near: &[Vec<Neighbour>]) -> Vec<Point3> {
        let thickness = self.layers.thickness();
        // A neighbour one range away weighs as much as an upright way.
        let upright = (LEAN_RANGE_THICKNESSES * thickness).powi(-2);
        let mut leans = vec![[0.0; 3]; n];
        for _ in 0..MAX_LEAN_ROUNDS {
            let mut change = 0.0f64;
            let before = leans.clone();
            for (&v, near) in followers.iter().zip(near) {
                let (mut sum, mut weight) = ([0.0; 3], upright);
                for n in near {
                    let of = n.end.unwrap_or(before[n.node]);
                    sum = std::array::from_fn(|i| sum[i] + n.weight * of[i]);
                    weight += n.weight;
                }
                let next = sum.map(|x| x / weight);
                change = change.max(norm(sub(next, leans[v])));
                leans[v] = next;
            }
            // The ways are settled.
            if change <= 1e-4 * thickness {
                break;
            }
        }
        leans
    }

    /// Returns the neighbours of each node of the core that its way follows: those along an edge
    /// which lie on all pieces of the node. A corner follows none.
    fn neighbours(&self, core: &Mesh, nodes: &[u32], all: &[Vec<u32>]) -> Vec<Vec<usize>> {
        let number: HashMap<u32, usize> = nodes.iter().copied().zip(0..).collect();
        let mut near: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
        for (k, &[a, b, c]) in core.triangles.iter().enumerate() {
            if !self.has_layers(core, k) {
                continue;
            }
            for [u, v] in [[a, b], [b, c], [c, a], [b, a], [c, b], [a, c]] {
                let (u, v) = (number[&u], number[&v]);
                if all[u].len() < 3 && all[u].iter().all(|piece| all[v].contains(piece)) {
                    near[u].push(v);
                }
            }
        }
        near.into_iter().map(unique).collect()
    }

    /// Returns the foot of a column on the surface of the solid, for the node of the core at `top`.
    fn base(&self, top: Point3, way: Point3, stand: &NodePieces) -> Result<Point3, MeshError> {
        let mut others = stand.others.iter();
        if let Some(&smooth) = others.find(|i| self.is_smooth(stand, **i, top)) {
            return Err(self.ends(smooth, top));
        }
        if let Some(&piece) = stand.others.first()
            && self.value(top).0 > self.off
        {
            // The core continues along the piece where the solid does not end at it.
            return Err(self.ends(piece, top));
        }
        let from = std::array::from_fn(|i| top[i] + way[i]);
        let foot = self.foot(&stand.all(), from);
        let on_surface = |p: &Point3| self.value(*p).0.abs() <= self.off;
        let base = foot.filter(on_surface);
        base.ok_or_else(|| self.no_room(stand, foot, top))
    }

    /// Returns the nodes of one column, from the surface of the solid to the node of the core.
    fn column(&self, top: Point3, way: Point3, stand: &NodePieces) -> Result<Column, MeshError> {
        let base = self.base(top, way, stand)?;
        let reach = self.reach(stand, base, top);
        let mut nodes: Vec<Point3> = self
            .shares(reach)
            .into_iter()
            .map(|share| lerp(base, top, share))
            .collect();
        if let ([_, inner @ .., _], false) = (nodes.as_mut_slice(), stand.others.is_empty()) {
            for p in inner {
                *p = self.foot(&stand.others, *p).unwrap_or(*p);
            }
        }
        if let Some(last) = nodes.last_mut() {
            *last = top;
        }
        Ok(Column { nodes, reach })
    }

    /// Returns true if a piece without layers meets one with layers so smoothly that columns on it
    /// would lie almost along the surface.
    fn is_smooth(&self, stand: &NodePieces, other: u32, p: Point3) -> bool {
        let normal = |piece: u32| unit(self.solid.gradient(piece, p).1);
        let n = normal(other);
        let mut normals = stand.layered.iter().map(|&piece| normal(piece));
        // 30 degrees, at which columns are twice as long as layers are thick.
        normals.any(|m| dot(n, m) > 0.866)
    }

    /// Creates the error of a node of the core whose parts have no surface of the solid over it:
    /// they end earlier, at a part without layers, or the layers are too thick. `base` is the
    /// nearest point on the parts, if they meet at all.
    fn no_room(&self, stand: &NodePieces, base: Option<Point3>, top: Point3) -> MeshError {
        let decided = base.map(|base| self.value(base).1);
        match decided.filter(|&piece| !self.layered[piece as usize]) {
            Some(piece) if stand.others.is_empty() => self.ends(piece, top),
            _ => MeshError::NoRoom {
                thickness: self.layers.thickness(),
                at: Some(top),
            },
        }
    }

    /// Returns the distance of a node of the core from the surface, as the mean over its pieces
    /// with layers.
    fn reach(&self, stand: &NodePieces, base: Point3, top: Point3) -> f64 {
        let feet = stand.layered.iter().filter_map(|&i| self.foot(&[i], top));
        let distances: Vec<f64> = feet.map(|q| norm(sub(top, q))).collect();
        match distances.len() {
            0 => norm(sub(top, base)),
            n => distances.iter().sum::<f64>() / n as f64,
        }
    }

    /// Returns the positions of the nodes of a column, as shares of its reach: layers have the
    /// requested thickness, except the last one, which ends at the core.
    fn shares(&self, reach: f64) -> Vec<f64> {
        let heights = self.layers.heights();
        let n = self.layers.count;
        let last = heights[n] - heights[n - 1];
        let whole = match reach - heights[n - 1] >= MIN_LAST_LAYER_SHARE * last {
            true => reach,
            false => heights[n],
        };
        let inner = heights[..n].iter().map(|h| h / whole);
        inner.chain([1.0]).collect()
    }

    /// Returns the mesh of the core with its columns as wedges.
    fn filled(&self, core: &Mesh, columns: &Columns) -> Mesh {
        let mut mesh = core.clone();
        let n = self.layers.count;
        // Nodes of each column, the core's own last.
        let mut nodes: HashMap<u32, Vec<u32>> = HashMap::new();
        for (&v, column) in columns {
            let first = mesh.points.len() as u32;
            mesh.points.extend(&column.nodes[..n]);
            nodes.insert(v, (first..first + n as u32).chain([v]).collect());
        }
        self.wedges(core, &nodes, &mut mesh);
        self.sides(core, &nodes, &mut mesh);
        self.features(core, &nodes, &mut mesh);
        mesh
    }

    /// Adds wedges over the triangles with layers, which move to the solid's surface.
    fn wedges(&self, core: &Mesh, nodes: &HashMap<u32, Vec<u32>>, mesh: &mut Mesh) {
        for (k, triangle) in core.triangles.iter().enumerate() {
            if !self.has_layers(core, k) {
                continue;
            }
            let [a, b, c] = triangle.map(|v| &nodes[&v]);
            mesh.triangles[k] = [a[0], b[0], c[0]];
            // The base of a wedge faces into the solid.
            let wedge = |i: usize| [a[i], c[i], b[i], a[i + 1], c[i + 1], b[i + 1]];
            mesh.wedges.extend((0..self.layers.count).map(wedge));
        }
    }

    /// Adds quadrilaterals on parts without layers, where columns stand.
    fn sides(&self, core: &Mesh, nodes: &HashMap<u32, Vec<u32>>, mesh: &mut Mesh) {
        let mut ends: HashSet<[u32; 2]> = HashSet::new();
        for (k, &[a, b, c]) in core.triangles.iter().enumerate() {
            if self.has_layers(core, k) {
                ends.extend([[a, b], [b, c], [c, a]]);
            }
        }
        for (k, &[a, b, c]) in core.triangles.iter().enumerate() {
            if self.has_layers(core, k) {
                continue;
            }
            for [u, v] in [[a, b], [b, c], [c, a]] {
                if !ends.contains(&[v, u]) {
                    continue;
                }
                let (u, v) = (&nodes[&u], &nodes[&v]);
                for i in 0..self.layers.count {
                    mesh.quads.push([v[i + 1], u[i + 1], u[i], v[i]]);
                    mesh.quad_parts.extend(core.triangle_parts.get(k));
                }
            }
        }
    }

    /// Moves edges and corners on parts with layers to the solid's surface; extends curves that end
    /// there along columns.
    fn features(&self, core: &Mesh, nodes: &HashMap<u32, Vec<u32>>, mesh: &mut Mesh) {
        for (edge, &curve) in core.edges.iter().zip(&core.edge_curves) {
            let parts = core.curves[curve as usize].parts;
            if parts.iter().any(|&part| self.is_layered[part as usize]) {
                continue;
            }
            for column in edge.iter().filter_map(|v| nodes.get(v)) {
                let edges = column.windows(2).map(|pair| [pair[0], pair[1]]);
                mesh.edges.extend(edges);
                mesh.edge_curves.resize(mesh.edges.len(), curve);
            }
        }
        for (k, &curve) in core.edge_curves.iter().enumerate() {
            let parts = core.curves[curve as usize].parts;
            if parts.iter().any(|&part| self.is_layered[part as usize]) {
                mesh.edges[k] = mesh.edges[k].map(|v| nodes.get(&v).map_or(v, |c| c[0]));
            }
        }
        for v in &mut mesh.corners {
            *v = nodes.get(v).map_or(*v, |column| column[0]);
        }
    }
}
