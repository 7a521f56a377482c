//! Meshing of unit cells: sizes that fit, solids continued periodically, sides as solids, and
//! checks that opposite sides match.

use crate::complex::edge;
use crate::distance::{distance_at, first_order};
use crate::lattice::CELL_EDGE;
use crate::names::AXES;
use crate::torus::{SIDE_TOLERANCE_FACTOR, Torus};
use isoform_geom::{Aabb, Csg, Mesh, Opposite, Point3, Solid, TRIANGLE_EDGES};
use isoform_num::{Interval, Jet2};
use std::collections::{BTreeMap, HashMap};

/// Minimum number of lattice cells from one side to the other. Stars of vertices must not reach
/// around the torus; with fewer than six they may, and eight leave room for collapsed edges.
const MIN_CELLS_PER_PERIOD: usize = 8;
/// Distance from the surface, in side tolerances, beyond which a point is clearly inside or
/// outside: smaller ones may be rounding of numbers in the model.
const CLEAR_DISTANCE_FACTOR: f64 = 1e4;
/// Relative position of the samples in their parts of the side, off the round numbers common in
/// models.
const SAMPLE_OFFSETS: [f64; 2] = [0.382, 0.618];

/// Returns the largest edge length at which enough cells fit along each periodic axis.
pub(crate) fn largest_size(torus: &Torus) -> f64 {
    let size = torus.region.size();
    let edges = torus
        .repeating()
        .map(|i| size[i] / MIN_CELLS_PER_PERIOD as f64);
    edges.fold(f64::INFINITY, f64::min) / CELL_EDGE
}

/// Returns sample points on the lower sides, about `size` apart.
pub(crate) fn side_samples(torus: &Torus, size: f64) -> Vec<Point3> {
    let (lo, extent) = (torus.region.lo, torus.region.size());
    // At most a million points, about a second for a model of a hundred parts.
    let count = extent.map(|l| ((l / size).ceil() as usize).clamp(MIN_CELLS_PER_PERIOD, 1000));
    let mut places = Vec::new();
    for axis in torus.repeating() {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for i in 0..count[u] {
            for j in 0..count[v] {
                let mut p = lo;
                p[u] += extent[u] * (i as f64 + SAMPLE_OFFSETS[0]) / count[u] as f64;
                p[v] += extent[v] * (j as f64 + SAMPLE_OFFSETS[1]) / count[v] as f64;
                places.push(p);
            }
        }
    }
    places
}

/// Records the pairs of nodes on opposite sides of a mesh. Mid nodes on upper sides are moved to
/// match those on the lower ones, since separate projections differ by rounding.
pub(crate) fn pair_sides(torus: &Torus, mesh: &mut Mesh) {
    for axis in torus.repeating() {
        pair_mids(torus, mesh, axis);
    }
    let sides = torus
        .repeating()
        .map(|axis| mesh.opposite_nodes(torus.region, axis));
    mesh.opposite = sides.collect();
}

/// Moves the mid nodes of the upper side across an axis to match those of the lower side.
fn pair_mids(torus: &Torus, mesh: &mut Mesh, axis: usize) {
    let corners = mesh.opposite_nodes(torus.region, axis).nodes;
    let below: HashMap<u32, u32> = corners.iter().map(|&[a, b]| (b, a)).collect();
    let mut middle: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for (t, mids) in mesh.triangles.iter().zip(&mesh.triangle_mids) {
        for ([i, j], &mid) in TRIANGLE_EDGES.into_iter().zip(mids) {
            middle.insert(edge(t[i], t[j]), mid);
        }
    }
    let (lo, hi) = (torus.region.lo[axis], torus.region.hi[axis]);
    for (&[a, b], &upper) in &middle {
        let ends = [a, b].map(|v| below.get(&v).copied());
        if let [Some(a), Some(b)] = ends
            && let Some(&lower) = middle.get(&edge(a, b))
        {
            mesh.points[lower as usize][axis] = lo;
            mesh.points[upper as usize] = mesh.points[lower as usize];
            mesh.points[upper as usize][axis] = hi;
        }
    }
}

/// Returns the sides across the periodic axes as solids.
pub(crate) fn sides_of(torus: Torus) -> Vec<Side> {
    let side = |axis: usize| {
        let name = |end: &str| format!("cap.{}_{end}", AXES[axis]);
        Side {
            torus,
            axis,
            names: [name("max"), name("min")],
            tree: Csg::Piece(0),
        }
    };
    torus.repeating().map(side).collect()
}

/// Reason why a solid cannot be meshed as a unit cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Misfit {
    /// A point is inside, and the opposite one is outside.
    Differs,
    /// The surface lies in a side: the solid ends there.
    InSide,
}

/// Searches sample points on the lower sides for a reason why the solid cannot be meshed as a unit
/// cell; returns it with the axis across which the sides lie, and the point.
pub(crate) fn misfit(
    solid: &dyn Solid,
    torus: &Torus,
    places: &[Point3],
) -> Option<(Misfit, usize, Point3)> {
    torus.repeating().find_map(|axis| {
        let (lo, hi) = (torus.region.lo[axis], torus.region.hi[axis]);
        let on_side: Vec<Point3> = places.iter().copied().filter(|p| p[axis] == lo).collect();
        let with = |p: Point3, x: f64| -> Point3 {
            std::array::from_fn(|i| if i == axis { x } else { p[i] })
        };
        let signs = |x: f64| {
            let moved: Vec<Point3> = on_side.iter().map(|p| with(*p, x)).collect();
            let mut values = vec![0.0; moved.len()];
            solid.sign_values(&moved, &mut values);
            values
        };
        let distance = |p: Point3| distance_at(solid, p).abs();
        // Surfaces that lie in a side show slightly inside the box: 10⁻⁶ box lengths away from the
        // side, far more than rounding and less than any wall.
        let within = 1e-6 * (hi - lo);
        let pairs = [[lo, hi], [lo + within, hi - within]].map(|ends| ends.map(signs));
        let nearest = |k: usize| {
            let ends = [lo, hi].map(|x| distance(with(on_side[k], x)));
            ends[0].min(ends[1])
        };
        let of = |k: usize| {
            let are_apart = |[f, g]: &[Vec<f64>; 2]| f[k] * g[k] < 0.0;
            let is_misfit = |misfit: Misfit| match misfit {
                Misfit::Differs => {
                    are_apart(&pairs[0]) && nearest(k) > CLEAR_DISTANCE_FACTOR * torus.near
                }
                Misfit::InSide => {
                    are_apart(&pairs[1]) && nearest(k) <= torus.near / SIDE_TOLERANCE_FACTOR
                }
            };
            let found = [Misfit::Differs, Misfit::InSide]
                .into_iter()
                .find(|m| is_misfit(*m));
            found.map(|misfit| (misfit, axis, on_side[k]))
        };
        (0..on_side.len()).find_map(of)
    })
}

/// Returns, per axis, the pair of opposite nodes with the surface at one side and clearly off the
/// other: the axis, the point of the largest distance, and this distance.
pub(crate) fn apart(solid: &dyn Solid, torus: &Torus, mesh: &Mesh) -> Vec<(usize, Point3, f64)> {
    let distance = |v: u32| distance_at(solid, mesh.points[v as usize]).abs();
    // Nodes off the surface cannot be compared, and solids of thousands of pieces are slow.
    let caps: Vec<String> = sides_of(*torus).into_iter().flat_map(|s| s.names).collect();
    let is_cap: Vec<bool> = mesh.parts.iter().map(|name| caps.contains(name)).collect();
    let mut is_on_surface = vec![false; mesh.points.len()];
    for (t, &part) in mesh.triangles.iter().zip(&mesh.triangle_parts) {
        for v in t.iter().filter(|_| !is_cap[part as usize]) {
            is_on_surface[*v as usize] = true;
        }
    }
    let farthest = |sides: &Opposite| {
        let nodes = sides.nodes.iter();
        let bounding = nodes.filter(|pair| pair.iter().any(|&v| is_on_surface[v as usize]));
        let pairs = bounding.map(|pair| (pair[0], pair.map(distance)));
        let on_one = pairs.filter(|(_, [a, b])| a.min(*b) <= torus.near / SIDE_TOLERANCE_FACTOR);
        let off = on_one.map(|(v, [a, b])| (mesh.points[v as usize], a.max(b)));
        let found = off.max_by(|a, b| a.1.total_cmp(&b.1))?;
        (found.1 > CLEAR_DISTANCE_FACTOR * torus.near).then_some((sides.axis, found.0, found.1))
    };
    mesh.opposite.iter().filter_map(farthest).collect()
}

/// A solid continued periodically outside of its box.
pub(crate) struct PeriodicSolid<'a> {
    solid: &'a dyn Solid,
    torus: Torus,
    names: Vec<String>,
}

impl<'a> PeriodicSolid<'a> {
    /// Continues a solid, which may be clipped at sides across other axes. Its own sides across the
    /// periodic axes no longer count as pieces: their names are freed for [`sides_of`].
    pub(crate) fn new(solid: &'a dyn Solid, torus: Torus) -> Self {
        let sides = sides_of(torus);
        let is_side = |name: &String| sides.iter().any(|side| side.names.contains(name));
        let free = |name: &String| match is_side(name) {
            true => format!("no {name}"),
            false => name.clone(),
        };
        Self {
            solid,
            torus,
            names: solid.names().iter().map(free).collect(),
        }
    }

    /// Evaluates a piece at a point; on a side at the image where the piece is nearer.
    ///
    /// For example, a ball that crosses a side is modelled as two balls, each valid at only one of
    /// the sides.
    fn at_nearest<T>(&self, p: Point3, of: impl Fn(Point3) -> (f64, T)) -> (f64, T) {
        let images = self.torus.images(p);
        let mut found = of(images[0]);
        for &image in &images[1..] {
            let next = of(image);
            if next.0.abs() < found.0.abs() {
                found = next;
            }
        }
        found
    }

    /// Computes the hull of the pieces' bounds over the parts of a box, wrapped into one period.
    fn joined(&self, region: Aabb, out: &mut [Interval], of: impl Fn(Aabb, &mut [Interval])) {
        let spans: [Vec<[f64; 2]>; 3] =
            std::array::from_fn(|i| self.torus.spans(i, [region.lo[i], region.hi[i]]));
        let mut part = vec![Interval::ALL; out.len()];
        let mut is_first = true;
        for x in &spans[0] {
            for y in &spans[1] {
                for z in &spans[2] {
                    let lo = [x[0], y[0], z[0]];
                    let hi = [x[1], y[1], z[1]];
                    of(Aabb { lo, hi }, &mut part);
                    for (out, part) in out.iter_mut().zip(&part) {
                        let (lo, hi) = (part.lo(), part.hi());
                        *out = if is_first {
                            *part
                        } else {
                            Interval::new(out.lo().min(lo), out.hi().max(hi))
                        };
                    }
                    is_first = false;
                }
            }
        }
    }
}

impl Solid for PeriodicSolid<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        self.solid.tree()
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        let values = out.chunks_mut(points.len().max(1));
        for (&piece, values) in which.iter().zip(values) {
            for (p, value) in points.iter().zip(values) {
                let of = |p: Point3| {
                    let mut v = [0.0];
                    self.solid.values(&[piece], &[p], &mut v);
                    (v[0], ())
                };
                *value = self.at_nearest(*p, of).0;
            }
        }
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        let of = |p: Point3| {
            let (v, g) = self.solid.gradient(piece, p);
            (first_order(v, g), (v, g))
        };
        self.at_nearest(p, of).1
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        let of = |p: Point3| {
            let jet = self.solid.jet(piece, p);
            (first_order(jet.v, jet.g), jet)
        };
        self.at_nearest(p, of).1
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        self.joined(region, out, |region, out| {
            self.solid.bounds(which, region, out)
        });
    }
    fn value_bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        let of = |region, out: &mut [Interval]| self.solid.value_bounds(which, region, out);
        self.joined(region, out, of);
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        let wrapped: Vec<Point3> = points.iter().map(|p| self.torus.wrapped(*p)).collect();
        self.solid.sign_values(&wrapped, out);
    }
}

/// A side of the box as a solid: its first piece is positive below the upper side and negative
/// above the lower one, its second piece the negative of that.
pub(crate) struct Side {
    torus: Torus,
    axis: usize,
    names: [String; 2],
    tree: Csg,
}

impl Side {
    /// Returns the height of a point above the side, negative below it.
    fn height(&self, p: Point3) -> f64 {
        let (lo, hi) = (
            self.torus.region.lo[self.axis],
            self.torus.region.hi[self.axis],
        );
        let x = self.torus.wrapped(p)[self.axis];
        if x - lo < hi - x { x - lo } else { x - hi }
    }

    fn sign(piece: u32) -> f64 {
        if piece == 0 { -1.0 } else { 1.0 }
    }
}

impl Solid for Side {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        let all = which
            .iter()
            .flat_map(|&piece| points.iter().map(move |p| (piece, p)));
        for (out, (piece, p)) in out.iter_mut().zip(all) {
            *out = Self::sign(piece) * self.height(*p);
        }
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        let mut gradient = [0.0; 3];
        gradient[self.axis] = Self::sign(piece);
        (Self::sign(piece) * self.height(p), gradient)
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        let (v, g) = self.gradient(piece, p);
        Jet2 { v, g, h: [0.0; 6] }
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        let ends = [region.lo[self.axis], region.hi[self.axis]];
        let (lo, hi) = (
            self.torus.region.lo[self.axis],
            self.torus.region.hi[self.axis],
        );
        let half = 0.5 * (hi - lo);
        // The height grows with the coordinate except at the middle of the box, where it falls from
        // half a period to minus half a period.
        let heights = ends.map(|x| {
            let mut p = self.torus.region.lo;
            p[self.axis] = x;
            self.height(p)
        });
        let is_steady = ends[1] - ends[0] < half && heights[0] <= heights[1];
        let [a, b] = if is_steady { heights } else { [-half, half] };
        let slack = self.torus.near;
        for (&piece, out) in which.iter().zip(out) {
            *out = match Self::sign(piece) > 0.0 {
                true => Interval::new(a - slack, b + slack),
                false => Interval::new(-b - slack, -a + slack),
            };
        }
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        self.values(&[0], points, out);
    }
}
