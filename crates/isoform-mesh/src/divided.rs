//! A solid divided into regions by other solids, as one list of pieces.
//!
//! The *whole* is what is meshed; each *divider* takes what of the whole lies in it and in no
//! divider before it, and what is left is a region of its own. *Layer* 0 is the whole, layer k the
//! divider k: each has a tree, and all share the numbers of the pieces, so that a vertex can be
//! held on a piece of the whole and on one of a divider at once.

use crate::lattice::Lattice;
use crate::surface::LayerCells;
use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::{Interval, Jet2};
use std::collections::HashSet;

/// A region of a solid: what of it lies in another solid.
#[derive(Clone, Copy)]
pub struct Region<'a> {
    /// What it is called.
    pub name: &'a str,
    /// Where it is, within the solid that is meshed.
    pub solid: &'a dyn Solid,
}

/// The solids of all layers, with numbers for all their pieces.
pub(crate) struct Divided<'a> {
    solids: Vec<&'a dyn Solid>,
    /// The first piece of each layer.
    first: Vec<u32>,
    names: Vec<String>,
    trees: Vec<Csg>,
}

impl<'a> Divided<'a> {
    /// A whole and what divides it. Pieces of dividers whose names are taken get that of the
    /// divider before theirs.
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

    /// Adds a layer behind all others. Names of pieces that are taken get the prefix.
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

    /// The layers: the whole and the dividers.
    pub(crate) fn layers(&'a self) -> Vec<Layer<'a>> {
        let layers = 0..self.solids.len();
        layers.map(|layer| Layer { of: self, layer }).collect()
    }

    /// The layers with the cells of their lattices; none if there is but the whole.
    pub(crate) fn with_cells<'l>(&self, lattices: &'l [Lattice]) -> Vec<LayerCells<'l>> {
        let cells = self.first.iter().zip(lattices);
        match lattices.len() {
            0 | 1 => Vec::new(),
            _ => cells
                .map(|(&first, lattice)| LayerCells { lattice, first })
                .collect(),
        }
    }

    /// The layer that a piece belongs to.
    fn layer_of(&self, piece: u32) -> usize {
        self.first.partition_point(|&f| f <= piece) - 1
    }

    /// The pieces `which`, one layer after the other: the places in `which`, and the pieces by the
    /// numbers of their own solid.
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

    /// What a function of pieces gives, for the layers one after the other; each piece has `n`
    /// numbers.
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

/// A tree whose pieces have other numbers.
fn shifted(tree: &Csg, by: u32) -> Csg {
    let all = |children: &[Csg]| children.iter().map(|c| shifted(c, by)).collect();
    match tree {
        Csg::Piece(i) => Csg::Piece(i + by),
        Csg::Min(children) => Csg::Min(all(children)),
        Csg::Max(children) => Csg::Max(all(children)),
    }
}

/// One layer of a divided solid: its own tree, and the pieces of all.
#[derive(Clone, Copy)]
pub(crate) struct Layer<'a> {
    of: &'a Divided<'a>,
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

/// What of a solid belongs to one of its regions, as a solid of its own: what lies in the whole and
/// in the region's solid, and in that of no region before it. Faces towards those have the names
/// that they have in [`crate::mesh_regions`].
///
/// The last region, behind all that are given, is what is left.
pub struct RegionSolid<'a> {
    all: Divided<'a>,
    /// Names of the pieces, then of their negatives.
    names: Vec<String>,
    tree: Csg,
    /// Layers whose solids count, then those that count negatively.
    layers: [Vec<usize>; 2],
}

impl<'a> RegionSolid<'a> {
    /// Region number `k`.
    pub fn new(whole: &'a dyn Solid, regions: &[Region<'a>], k: usize) -> Self {
        let all = Divided::new(whole, regions);
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

    /// The layer that holds the pieces.
    fn layer(&self) -> Layer<'_> {
        Layer {
            of: &self.all,
            layer: 0,
        }
    }

    /// A piece by its number in the layers, and its sign.
    fn piece(&self, piece: u32) -> (u32, f64) {
        let n = self.all.names.len() as u32;
        if piece < n {
            (piece, 1.0)
        } else {
            (piece - n, -1.0)
        }
    }

    /// The piece of the layers that a piece is, or is the negative of.
    pub(crate) fn undivided(&self, piece: u32) -> u32 {
        self.piece(piece).0
    }

    /// What a function of the layers' pieces gives, with `n` numbers each; `negate` turns those of
    /// negatives.
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

/// A tree of the negatives of a tree's pieces, which have numbers higher by `by`: negative where
/// that is positive.
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
