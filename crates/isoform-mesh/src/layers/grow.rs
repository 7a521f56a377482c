//! Wedges between the surface of the core and that of the solid.

use crate::error::MeshError;
use crate::options::Layers;
use crate::points::{along, unique, unit};
use crate::surface::{first_order_at, newton, zero_in};
use isoform_geom::{Aabb, Mesh, Point3, Solid, dot, norm, sub};
use std::collections::{BTreeMap, HashMap, HashSet};

/// Steps of Newton's method onto the solid's surface, at most; some five are usual.
const STEPS: usize = 50;
/// Distance from the solid's surface, as a share of the diagonal, from which a node is not on it:
/// what the certificate takes for rounding.
const OFF: f64 = 1e-9;
/// Cosine of the angle between normals above which a part meets another one smoothly: 30 degrees,
/// at which columns are twice as long as layers are thick.
const SMOOTH: f64 = 0.866;
/// Thicknesses over which the ways of nodes turn into those of an edge: more lean farther into
/// faces, less squeeze them near edges into which the solid turns by more than half a turn.
const TURNING: f64 = 2.0;
/// Rounds in which ways follow those of their neighbours, at most; a round carries them by one
/// edge, and layers are seldom as thick as a dozen edges.
const TURNS: usize = 300;
/// Change of the ways, in thicknesses, below which they are settled.
const STILL: f64 = 1e-4;
/// The least share of its thickness that is left to the last layer. With less, thicknesses are
/// shares of what there is: offsets of surfaces that bend much are thinner than asked for.
const LEAST_LAST: f64 = 0.3;

/// The pieces of the surface that a node of the core lies on.
#[derive(Clone, Default)]
struct Stand {
    /// Those with layers.
    layered: Vec<u32>,
    /// Those without.
    others: Vec<u32>,
}

impl Stand {
    /// All pieces.
    fn all(&self) -> Vec<u32> {
        self.layered.iter().chain(&self.others).copied().collect()
    }
}

/// A neighbour whose way that of a node follows.
struct Neighbour {
    node: usize,
    /// What it counts for: one over the square of its distance.
    weight: f64,
    /// How its way leans as seen from the node's pieces, where it lies on more of them.
    end: Option<Point3>,
}

/// A mesh with layers.
pub(crate) struct Grown {
    pub(crate) mesh: Mesh,
    /// How thick all layers are where they are thinnest, and a place there.
    pub(crate) thinnest: Option<(f64, Point3)>,
}

/// What layers are grown with.
struct Grower<'a> {
    solid: &'a dyn Solid,
    layers: &'a Layers,
    /// Whether each piece of the solid has layers.
    layered: &'a [bool],
    /// The piece of each part of the mesh, if it is one.
    pieces: Vec<Option<u32>>,
    /// Whether each part has layers.
    is_layered: Vec<bool>,
    /// Below this distance a node is on a piece: rounding.
    zero: f64,
    /// Above this distance it is not.
    off: f64,
}

/// Grows layers of wedges from the surface of a core to that of its solid: of a mesh of the core
/// one of the solid is made.
///
/// # Errors
/// [`MeshError::LayersEnd`] where parts without layers meet those with some in no edge on which
/// layers could stand.
pub(crate) fn grow(
    core: &Mesh,
    solid: &dyn Solid,
    layered: &[bool],
    layers: &Layers,
    region: Aabb,
) -> Result<Grown, MeshError> {
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
        off: OFF * region.diagonal(),
    };
    let stands = grower.stands(core);
    grower.check_others(core, &stands)?;
    let columns = grower.columns(core, stands)?;
    let thin = columns
        .iter()
        .min_by(|a, b| a.1.reach.total_cmp(&b.1.reach));
    Ok(Grown {
        mesh: grower.filled(core, &columns),
        thinnest: thin.map(|(&v, column)| (column.reach, core.points[v as usize])),
    })
}

/// What nodes of the core stand on, of those on parts with layers.
type Stands = BTreeMap<u32, Stand>;

/// The nodes over a node of the core.
struct Column {
    /// From the surface of the solid to that of the core.
    nodes: Vec<Point3>,
    /// How far the core is from the surface there.
    reach: f64,
}

/// Columns by their nodes of the core.
type Columns = BTreeMap<u32, Column>;

impl Grower<'_> {
    /// Whether a triangle of the core has layers.
    fn has_layers(&self, core: &Mesh, triangle: usize) -> bool {
        let part = core.triangle_parts.get(triangle);
        part.is_some_and(|&part| self.is_layered[part as usize])
    }

    /// Distance of a place to the surface of the solid, with the piece that decides it.
    fn value(&self, p: Point3) -> (f64, u32) {
        let of = |piece| first_order_at(self.solid, piece, p);
        self.solid.tree().value_and_piece(&of)
    }

    /// Looks for triangles of parts without layers that are not on the solid's surface: those of a
    /// part that the core goes on along where the layers of another one would have to end.
    fn check_others(&self, core: &Mesh, stands: &Stands) -> Result<(), MeshError> {
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

    /// The error of layers that end at a piece, near a place: those on the nearest piece with some.
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

    /// What the nodes on parts with layers stand on.
    fn stands(&self, core: &Mesh) -> Stands {
        let triangles = core.triangles.iter().enumerate();
        let layered = triangles.clone().filter(|(k, _)| self.has_layers(core, *k));
        let nodes = layered.flat_map(|(_, triangle)| *triangle);
        let mut stands: Stands = nodes.map(|v| (v, Stand::default())).collect();
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

    /// The nearest place on some pieces: on the first three, which meet in a point.
    fn foot(&self, pieces: &[u32], from: Point3) -> Option<Point3> {
        let pieces = &pieces[..pieces.len().min(3)];
        let mut p = from;
        for _ in 0..STEPS {
            let (step, off) = newton(&|i, p| self.solid.gradient(i, p), pieces, p)?;
            if off <= self.zero {
                return Some(p);
            }
            p = sub(p, step);
        }
        None
    }

    /// The columns of nodes between the core and the solid's surface.
    fn columns(&self, core: &Mesh, stands: Stands) -> Result<Columns, MeshError> {
        let nodes: Vec<u32> = stands.keys().copied().collect();
        let stands: Vec<Stand> = stands.into_values().collect();
        let ways = self.ways(core, &nodes, &stands);
        let columns = nodes.iter().zip(&stands).zip(ways);
        let column = |((&v, stand), way)| {
            let top = core.points[v as usize];
            Ok((v, self.column(top, way, stand)?))
        };
        columns.map(column).collect()
    }

    /// The way from a place to the nearest one on some pieces; none where there is none.
    fn way(&self, pieces: &[u32], from: Point3) -> Point3 {
        let foot = self.foot(pieces, from);
        foot.map_or([0.0; 3], |p| sub(p, from))
    }

    /// The ways from nodes of the core to the solid's surface.
    ///
    /// On a face this is the way to the nearest place. Where the core's edges are not where the
    /// nearest places of the solid's edges are, faces of the two are not equally wide: ways *lean*
    /// towards the edge, less the farther it is, over [`TURNING`] thicknesses. Along edges they
    /// lean towards corners likewise, and faces follow edges that do.
    fn ways(&self, core: &Mesh, nodes: &[u32], stands: &[Stand]) -> Vec<Point3> {
        let all: Vec<Vec<u32>> = stands.iter().map(Stand::all).collect();
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

    /// How the ways of some nodes lean: as the mean of their neighbours, and none at all.
    fn leans(&self, n: usize, followers: &[usize], near: &[Vec<Neighbour>]) -> Vec<Point3> {
        let thickness = self.layers.thickness();
        // A neighbour one reach away weighs as much as not leaning at all.
        let upright = (TURNING * thickness).powi(-2);
        let mut leans = vec![[0.0; 3]; n];
        for _ in 0..TURNS {
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
            if change <= STILL * thickness {
                break;
            }
        }
        leans
    }

    /// The neighbours of each node of the core that its way follows: those along an edge which lie
    /// on all pieces that the node lies on. A corner follows none.
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

    /// Where a column stands on the surface of the solid, its node of the core at `top`.
    fn base(&self, top: Point3, way: Point3, stand: &Stand) -> Result<Point3, MeshError> {
        let mut others = stand.others.iter();
        if let Some(&smooth) = others.find(|i| self.is_smooth(stand, **i, top)) {
            return Err(self.ends(smooth, top));
        }
        if let Some(&piece) = stand.others.first()
            && self.value(top).0 > self.off
        {
            // The core goes on along the piece where the solid does not end at it.
            return Err(self.ends(piece, top));
        }
        let from = std::array::from_fn(|i| top[i] + way[i]);
        let foot = self.foot(&stand.all(), from);
        let on_surface = |p: &Point3| self.value(*p).0.abs() <= self.off;
        let base = foot.filter(on_surface);
        base.ok_or_else(|| self.no_room(stand, foot, top))
    }

    /// The nodes of one column, from the surface of the solid to the node of the core.
    fn column(&self, top: Point3, way: Point3, stand: &Stand) -> Result<Column, MeshError> {
        let base = self.base(top, way, stand)?;
        let reach = self.reach(stand, base, top);
        let mut nodes: Vec<Point3> = self
            .shares(reach)
            .into_iter()
            .map(|share| along(base, top, share))
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

    /// Whether a piece without layers meets one with some so smoothly that columns on it would lie
    /// almost along the surface.
    fn is_smooth(&self, stand: &Stand, other: u32, p: Point3) -> bool {
        let normal = |piece: u32| unit(self.solid.gradient(piece, p).1);
        let n = normal(other);
        let mut normals = stand.layered.iter().map(|&piece| normal(piece));
        normals.any(|m| dot(n, m) > SMOOTH)
    }

    /// The error of a node of the core whose parts have no surface of the solid over it: they end
    /// sooner, at one without layers, or the layers are too thick for what is there. `base` is the
    /// nearest place on the parts, if they meet at all.
    fn no_room(&self, stand: &Stand, base: Option<Point3>, top: Point3) -> MeshError {
        let decided = base.map(|base| self.value(base).1);
        match decided.filter(|&piece| !self.layered[piece as usize]) {
            Some(piece) if stand.others.is_empty() => self.ends(piece, top),
            _ => MeshError::NoRoom {
                thickness: self.layers.thickness(),
                at: Some(top),
            },
        }
    }

    /// How far a node of the core is from the surface, as the mean over its pieces with layers.
    fn reach(&self, stand: &Stand, base: Point3, top: Point3) -> f64 {
        let feet = stand.layered.iter().filter_map(|&i| self.foot(&[i], top));
        let distances: Vec<f64> = feet.map(|q| norm(sub(top, q))).collect();
        match distances.len() {
            0 => norm(sub(top, base)),
            n => distances.iter().sum::<f64>() / n as f64,
        }
    }

    /// Where the nodes of a column are, as shares of its reach: layers have the thickness asked
    /// for, all but the last one, which ends where the core begins.
    fn shares(&self, reach: f64) -> Vec<f64> {
        let heights = self.layers.heights();
        let n = self.layers.count;
        let last = heights[n] - heights[n - 1];
        let whole = match reach - heights[n - 1] >= LEAST_LAST * last {
            true => reach,
            false => heights[n],
        };
        let inner = heights[..n].iter().map(|h| h / whole);
        inner.chain([1.0]).collect()
    }

    /// The mesh of the core with its columns as wedges.
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

    /// Wedges over the triangles with layers, which move to the solid's surface.
    fn wedges(&self, core: &Mesh, nodes: &HashMap<u32, Vec<u32>>, mesh: &mut Mesh) {
        for (k, triangle) in core.triangles.iter().enumerate() {
            if !self.has_layers(core, k) {
                continue;
            }
            let [a, b, c] = triangle.map(|v| &nodes[&v]);
            mesh.triangles[k] = [a[0], b[0], c[0]];
            // The base of a wedge looks into the solid.
            let wedge = |i: usize| [a[i], c[i], b[i], a[i + 1], c[i + 1], b[i + 1]];
            mesh.wedges.extend((0..self.layers.count).map(wedge));
        }
    }

    /// Quadrilaterals on parts without layers, where columns stand.
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

    /// Edges and corners on parts with layers move to the solid's surface; curves that end there
    /// go on along columns.
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
