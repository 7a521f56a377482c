//! A solid divided into regions by other solids, as one list of pieces.
//!
//! The *whole* is the solid to be meshed; each *divider* claims the part of the whole that lies in
//! it and in no earlier divider, and the remainder is a region of its own. *Layer* 0 is the whole,
//! layer k is divider k: each has its own tree, and all share one numbering of the pieces, so that
//! a vertex can be held on a piece of the whole and one of a divider at once.

use crate::lattice::Lattice;
use crate::surface::LayerCells;
use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::{Interval, Jet2};
use std::collections::HashSet;

/// A region of a solid: the part of it that lies in another solid.
#[derive(Clone, Copy)]
pub struct Region<'a> {
    /// Name of the region.
    pub name: &'a str,
    /// Solid whose intersection with the meshed solid is the region.
    pub solid: &'a dyn Solid,
}

/// Solids of all layers, with one numbering of their pieces.
pub(crate) struct DividedSolid<'a> {
    solids: Vec<&'a dyn Solid>,
    /// First piece of each layer.
    first: Vec<u32>,
    names: Vec<String>,
    trees: Vec<Csg>,
}

impl<'a> DividedSolid<'a> {
    /// Combines a whole and its dividers. A piece whose name is already in use is prefixed by the
    /// name of its divider.
    pub(crate) fn new(whole: &'a dyn Solid, regions: &[Region<'a>]) -> Self {
        let mut this = Self {
            solids: Vec::new(),
            first: Vec::new(),
            names: Vec::new(),
            trees: Vec::new(),
        };
        this.add(whole, "");
        for region in regions {
            this.add(region.solid, region.name);
        }
        this
    }

    /// Appends a layer. Names of pieces that are already in use get the prefix.
    pub(crate) fn add(&mut self, solid: &'a dyn Solid, prefix: &str) {
        let first = self.names.len() as u32;
        let taken: HashSet<String> = self.names.iter().cloned().collect();
        for name in solid.names() {
            let mut free = name.clone();
            while taken.contains(&free) {
                free = format!("{prefix}.{free}");
            }
            self.names.push(free);
        }
        self.trees.push(shifted(solid.tree(), first));
        self.first.push(first);
        self.solids.push(solid);
    }

    /// Returns the layers: the whole and the dividers.
    pub(crate) fn layers(&'a self) -> Vec<Layer<'a>> {
        let layers = 0..self.solids.len();
        layers.map(|layer| Layer { of: self, layer }).collect()
    }

    /// Returns the layers with the cells of their lattices; empty if the whole is the only one.
    pub(crate) fn with_cells<'l>(&self, lattices: &'l [Lattice]) -> Vec<LayerCells<'l>> {
        let cells = self.first.iter().zip(lattices);
        match lattices.len() {
            0 | 1 => Vec::new(),
            _ => cells
                .map(|(&first, lattice)| LayerCells { lattice, first })
                .collect(),
        }
    }

    /// Returns the layer of a piece.
    fn layer_of(&self, piece: u32) -> usize {
        self.first.partition_point(|&f| f <= piece) - 1
    }

    /// Groups the pieces `which` by layer: (layer, positions in `which`, piece indices in the
    /// layer's own solid).
    fn by_layer(&self, which: &[u32]) -> Vec<(usize, Vec<usize>, Vec<u32>)> {
        let mut found = Vec::new();
        for layer in 0..self.solids.len() {
            let places = (0..which.len()).filter(|&k| self.layer_of(which[k]) == layer);
            let places: Vec<usize> = places.collect();
            let own = places.iter().map(|&k| which[k] - self.first[layer]);
            let own: Vec<u32> = own.collect();
            if !own.is_empty() {
                found.push((layer, places, own));
            }
        }
        found
    }

    /// Evaluates a function of pieces layer by layer; it yields `n` numbers per piece.
    fn gathered<T: Copy>(
        &self,
        which: &[u32],
        n: usize,
        out: &mut [T],
        of: impl Fn(&dyn Solid, &[u32], &mut [T]),
    ) {
        if let [first, ..] = *which
            && let layer = self.layer_of(first)
            && which.iter().all(|&piece| self.layer_of(piece) == layer)
        {
            let own: Vec<u32> = which
                .iter()
                .map(|piece| piece - self.first[layer])
                .collect();
            return of(self.solids[layer], &own, &mut out[..n * which.len()]);
        }
        for (layer, places, own) in self.by_layer(which) {
            let mut part: Vec<T> = out[..n * own.len()].to_vec();
            of(self.solids[layer], &own, &mut part);
            for (from, to) in places.into_iter().enumerate() {
                out[n * to..n * (to + 1)].copy_from_slice(&part[n * from..n * (from + 1)]);
            }
        }
    }
}

/// Returns a tree with all piece indices increased by `by`.
fn shifted(tree: &Csg, by: u32) -> Csg {
    let all = |children: &[Csg]| children.iter().map(|c| shifted(c, by)).collect();
    match tree {
        Csg::Piece(i) => Csg::Piece(i + by),
        Csg::Min(children) => Csg::Min(all(children)),
        Csg::Max(children) => Csg::Max(all(children)),
    }
}

/// One layer of a divided solid: its own tree, with the pieces of all layers.
#[derive(Clone, Copy)]
pub(crate) struct Layer<'a> {
    of: &'a DividedSolid<'a>,
    layer: usize,
}

impl Solid for Layer<'_> {
    fn names(&self) -> &[String] {
        &self.of.names
    }
    fn tree(&self) -> &Csg {
        &self.of.trees[self.layer]
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        let of = |solid: &dyn Solid, own: &[u32], out: &mut [f64]| solid.values(own, points, out);
        self.of.gathered(which, points.len(), out, of);
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        let layer = self.of.layer_of(piece);
        self.of.solids[layer].gradient(piece - self.of.first[layer], p)
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        let layer = self.of.layer_of(piece);
        self.of.solids[layer].jet(piece - self.of.first[layer], p)
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        let of =
            |solid: &dyn Solid, own: &[u32], out: &mut [Interval]| solid.bounds(own, region, out);
        self.of.gathered(which, 1, out, of);
    }
    fn value_bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        let of = |solid: &dyn Solid, own: &[u32], out: &mut [Interval]| {
            solid.value_bounds(own, region, out);
        };
        self.of.gathered(which, 1, out, of);
    }
    fn slopes(&self, piece: u32, region: Aabb) -> Option<[Interval; 3]> {
        let layer = self.of.layer_of(piece);
        self.of.solids[layer].slopes(piece - self.of.first[layer], region)
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        self.of.solids[self.layer].sign_values(points, out);
    }
}

/// One region of a divided solid as a solid of its own: the part of the whole that lies in the
/// region's solid, and in that of no earlier region. Its faces on other regions have the names that
/// they have in [`crate::mesh_regions`].
///
/// The last region, after all given ones, is the remainder.
pub struct RegionSolid<'a> {
    all: DividedSolid<'a>,
    /// Names of the pieces, followed by those of their negatives.
    names: Vec<String>,
    tree: Csg,
    /// Layers that contain the region, and layers that exclude it.
    layers: [Vec<usize>; 2],
}

impl<'a> RegionSolid<'a> {
    /// Creates region number `k`.
    pub fn new(whole: &'a dyn Solid, regions: &[Region<'a>], k: usize) -> Self {
        let all = DividedSolid::new(whole, regions);
        let before = (1..=k.min(regions.len())).collect::<Vec<_>>();
        let inner = std::iter::once(0).chain((k < regions.len()).then_some(k + 1));
        let inner: Vec<usize> = inner.collect();
        let by = all.names.len() as u32;
        let mut names = all.names.clone();
        names.extend(all.names.iter().map(|name| format!("not {name}")));
        let inside = inner.iter().map(|&layer| all.trees[layer].clone());
        let outside = before.iter().map(|&layer| negated(&all.trees[layer], by));
        let tree = Csg::Min(inside.chain(outside).collect());
        Self {
            all,
            names,
            tree,
            layers: [inner, before],
        }
    }

    /// Returns the layer through which pieces are evaluated.
    fn layer(&self) -> Layer<'_> {
        Layer {
            of: &self.all,
            layer: 0,
        }
    }

    /// Returns the index of a piece in the layers, and its sign.
    fn piece(&self, piece: u32) -> (u32, f64) {
        let n = self.all.names.len() as u32;
        if piece < n {
            (piece, 1.0)
        } else {
            (piece - n, -1.0)
        }
    }

    /// Returns the piece of the layers that a piece equals or is the negative of.
    pub(crate) fn undivided(&self, piece: u32) -> u32 {
        self.piece(piece).0
    }

    /// Evaluates a function of the layers' pieces, which yields `n` numbers each; `negate` is
    /// applied for negatives.
    fn signed<T: Copy>(
        &self,
        which: &[u32],
        n: usize,
        out: &mut [T],
        of: impl Fn(&Layer<'_>, &[u32], &mut [T]),
        negate: impl Fn(T) -> T,
    ) {
        let own: Vec<u32> = which.iter().map(|&piece| self.piece(piece).0).collect();
        of(&self.layer(), &own, out);
        for (k, &piece) in which.iter().enumerate() {
            if self.piece(piece).1 < 0.0 {
                for value in &mut out[n * k..n * (k + 1)] {
                    *value = negate(*value);
                }
            }
        }
    }
}

/// Returns the complement of a tree: over the negatives of its pieces, with indices increased by
/// `by`, it is negative where the tree is positive.
pub(crate) fn negated(tree: &Csg, by: u32) -> Csg {
    let all = |children: &[Csg]| children.iter().map(|c| negated(c, by)).collect();
    match tree {
        Csg::Piece(i) => Csg::Piece(i + by),
        Csg::Min(children) => Csg::Max(all(children)),
        Csg::Max(children) => Csg::Min(all(children)),
    }
}

impl Solid for RegionSolid<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        let of = |layer: &Layer<'_>, own: &[u32], out: &mut [f64]| layer.values(own, points, out);
        self.signed(which, points.len(), out, of, |v| -v);
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        let (piece, sign) = self.piece(piece);
        let (v, g) = self.layer().gradient(piece, p);
        (sign * v, g.map(|x| sign * x))
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        let (piece, sign) = self.piece(piece);
        let j = self.layer().jet(piece, p);
        Jet2 {
            v: sign * j.v,
            g: j.g.map(|x| sign * x),
            h: j.h.map(|x| sign * x),
        }
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        let of = |layer: &Layer<'_>, own: &[u32], out: &mut [Interval]| {
            layer.bounds(own, region, out);
        };
        self.signed(which, 1, out, of, |v| -v);
    }
    fn value_bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        let of = |layer: &Layer<'_>, own: &[u32], out: &mut [Interval]| {
            layer.value_bounds(own, region, out);
        };
        self.signed(which, 1, out, of, |v| -v);
    }
    fn slopes(&self, piece: u32, region: Aabb) -> Option<[Interval; 3]> {
        let (piece, sign) = self.piece(piece);
        let slopes = self.layer().slopes(piece, region)?;
        Some(if sign < 0.0 {
            slopes.map(|s| -s)
        } else {
            slopes
        })
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        let mut values = vec![0.0; points.len()];
        out[..points.len()].fill(f64::INFINITY);
        for (layers, sign) in self.layers.iter().zip([1.0, -1.0]) {
            for &layer in layers {
                self.all.solids[layer].sign_values(points, &mut values);
                for (out, value) in out.iter_mut().zip(&values) {
                    *out = out.min(sign * value);
                }
            }
        }
    }
}
