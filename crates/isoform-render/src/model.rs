//! Intersection of lines of sight with the surface of a model: its function, not a mesh of it.
//!
//! The box of the model is divided into cells (an octree) wherever interval arithmetic cannot
//! exclude surface, and each cell stores the pieces of the function that may decide in it, with
//! ranges of their gradients. A ray visits the cells from front to back. Within a cell it advances
//! by |f| over the largest slope along it, as f cannot vanish in between (Kalra and Barr, SIGGRAPH
//! 1989), but at least by [`FINEST`]; where slopes are unbounded, stretches are halved as long
//! as intervals of f contain 0. The intersection is then bracketed by two values of opposite signs
//! and found to rounding.
//!
//! The first hit is found unless the solid, or a gap in it, is thinner along the ray than
//! [`FINEST`] times the diagonal of the box, which is a fraction of a pixel.

use crate::camera::{Ray, along, unit};
use isoform::Control;
use isoform::Stopped;
use isoform::geom::{Aabb, Csg, Point3, Solid, dot, inverse_direction};
use isoform::mesh::features::{FeatureOptions, find};
use isoform::num::Interval;
use rayon::prelude::*;
use std::fmt;

/// Fraction of the box's diagonal below which a stretch of a ray is decided by the signs at its
/// ends.
pub const FINEST: f64 = 1.0 / 131_072.0;
/// Maximum number of stretches of a ray that are examined within a cell; the rest is decided by the
/// signs at its ends.
const MAX_STRETCHES: usize = 4096;
/// Distances before a point at which its normal is evaluated in turn, in diagonals of the box.
const NORMAL_OFFSETS: [f64; 3] = [0.0, 1e-9, 1e-6];

/// Cell of the box.
#[derive(Clone, Copy, Debug)]
enum OctreeCell {
    /// No surface passes; true if the cell is inside.
    Whole(bool),
    /// Surface may pass: index of its leaf.
    Leaf(u32),
    /// Divided into eight: index of the first child.
    Split(u32),
}

/// Cell that surface may pass.
#[derive(Clone, Debug)]
struct CellPieces {
    /// Tree of its pieces; numbers are indices in `pieces`.
    tree: Csg,
    pieces: Vec<u32>,
    /// Ranges of the gradients of all pieces; `None` if one is unknown.
    slopes: Option<Vec<[Interval; 3]>>,
}

/// Cell to be classified.
struct OpenCell {
    slot: usize,
    region: Aabb,
    tree: Csg,
}

/// Classification of a cell.
enum CellClass {
    Whole(bool),
    /// Tree of a cell that surface may pass; with the ranges of its pieces' gradients if they were
    /// computed and are known.
    Open(Csg, Option<Vec<[Interval; 3]>>),
}

/// Solid prepared for rays.
pub(crate) struct Model {
    solid: Box<dyn Solid>,
    /// Box that is shown.
    pub(crate) bounds: Aabb,
    /// True if the box cuts the solid; otherwise it contains the whole surface.
    is_cut: bool,
    cells: Vec<OctreeCell>,
    leaves: Vec<CellPieces>,
}

impl fmt::Debug for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Model")
            .field("bounds", &self.bounds)
            .field("cells", &self.cells.len())
            .finish_non_exhaustive()
    }
}

/// Intersection of a ray with a model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ModelHit {
    pub(crate) t: f64,
    /// Piece of the solid; `None` on a cap.
    pub(crate) piece: Option<u32>,
}

/// Buffers for the computation along a ray.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    values: Vec<f64>,
    ranges: Vec<Interval>,
    stack: Vec<(u32, Aabb)>,
}

impl Model {
    /// Prepares a solid within a box.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn new(
        solid: Box<dyn Solid>,
        bounds: Aabb,
        is_cut: bool,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let mut model = Self {
            cells: vec![OctreeCell::Whole(false)],
            leaves: Vec::new(),
            solid,
            bounds,
            is_cut,
        };
        let mut open = vec![OpenCell {
            slot: 0,
            region: bounds,
            tree: model.solid.tree().clone(),
        }];
        // Seven halvings leave cells of a hundredth of the box; more cells cost more time than they
        // save.
        let (max_depth, max_cells) = (7, 400_000);
        for depth in 0..=max_depth {
            control.check()?;
            let is_last = depth == max_depth || model.cells.len() + 8 * open.len() > max_cells;
            let judged: Vec<CellClass> = open.par_iter().map(|o| model.judge(o, is_last)).collect();
            let mut next = Vec::new();
            for (o, judged) in open.iter().zip(judged) {
                match judged {
                    CellClass::Whole(inside) => model.cells[o.slot] = OctreeCell::Whole(inside),
                    CellClass::Open(tree, slopes) => {
                        let only = slopes.as_deref().filter(|s| s.len() == 1);
                        let is_simple = depth >= 3 && only.is_some_and(|s| is_narrow(&s[0]));
                        if is_last || is_simple {
                            model.cells[o.slot] = model.leaf(&tree, slopes);
                        } else {
                            model.divide(o, &tree, &mut next);
                        }
                    }
                }
            }
            open = next;
        }
        Ok(model)
    }

    /// Returns the names of the pieces.
    pub(crate) fn names(&self) -> &[String] {
        self.solid.names()
    }

    /// Adds a leaf.
    fn leaf(&mut self, tree: &Csg, slopes: Option<Vec<[Interval; 3]>>) -> OctreeCell {
        let pieces = pieces_of(tree);
        self.leaves.push(CellPieces {
            tree: renumbered(tree, &pieces),
            pieces,
            slopes,
        });
        OctreeCell::Leaf(self.leaves.len() as u32 - 1)
    }

    /// Divides a cell into eight.
    fn divide(&mut self, o: &OpenCell, tree: &Csg, next: &mut Vec<OpenCell>) {
        let first = self.cells.len();
        self.cells[o.slot] = OctreeCell::Split(first as u32);
        self.cells.resize(first + 8, OctreeCell::Whole(false));
        for i in 0..8 {
            next.push(OpenCell {
                slot: first + i,
                region: octant(&o.region, i),
                tree: tree.clone(),
            });
        }
    }

    /// Determines if surface may pass a cell, and which pieces may decide there.
    fn judge(&self, o: &OpenCell, is_last: bool) -> CellClass {
        let pieces = pieces_of(&o.tree);
        let mut ranges = vec![Interval::ALL; pieces.len()];
        if pieces.len() > 1 {
            // A piece may be left out only where the others have values: those of `bounds` may be
            // undefined in a part of the cell.
            self.solid.value_bounds(&pieces, o.region, &mut ranges);
        } else {
            self.solid.bounds(&pieces, o.region, &mut ranges);
        }
        let range = |piece: u32| match pieces.binary_search(&piece) {
            Ok(k) => ranges[k],
            Err(_) => Interval::ALL,
        };
        let (tree, whole) = o.tree.deciding_with_range(&range);
        if whole.lo() > 0.0 || whole.hi() < 0.0 {
            return CellClass::Whole(whole.lo() > 0.0);
        }
        let left = pieces_of(&tree);
        let slopes = if is_last || left.len() == 1 {
            let each = left.iter().map(|p| self.solid.slopes(*p, o.region));
            each.collect()
        } else {
            None
        };
        CellClass::Open(tree, slopes)
    }

    /// Returns the value of a leaf's pieces at a point; NaN counts as outside.
    fn value(&self, leaf: &CellPieces, p: Point3, scratch: &mut Scratch) -> f64 {
        scratch.values.resize(leaf.pieces.len(), 0.0);
        self.solid.values(&leaf.pieces, &[p], &mut scratch.values);
        let v = leaf.tree.value(&|k| scratch.values[k as usize]);
        if v.is_nan() { -f64::MIN_POSITIVE } else { v }
    }

    /// Returns the first intersection of a ray with the surface between two distances. `cap` is
    /// true if the ray begins at a cut: then a start inside is a cap. `None` for `cap` leaves cuts
    /// open.
    pub(crate) fn meet(
        &self,
        ray: &Ray,
        [from, to]: [f64; 2],
        cap: Option<bool>,
        scratch: &mut Scratch,
    ) -> Option<ModelHit> {
        let inverse = inverse_direction(ray.d);
        let [near, far] = self.bounds.crossing(ray.o, inverse);
        let is_cap = cap.is_some_and(|begins| begins || (self.is_cut && near > from));
        let (from, to) = (near.max(from), far.min(to));
        if from >= to {
            return None;
        }
        let mut walk = RayWalk {
            model: self,
            ray,
            is_inside: None,
            is_cap,
        };
        let mirror = (0..3).fold(0, |m, k| m | usize::from(ray.d[k] < 0.0) << k);
        let mut stack = std::mem::take(&mut scratch.stack);
        stack.clear();
        stack.push((0, self.bounds));
        let mut met = None;
        while let Some((cell, region)) = stack.pop() {
            let [a, b] = region.crossing(ray.o, inverse);
            let (a, b) = (a.max(from), b.min(to));
            if a > b {
                continue;
            }
            met = match self.cells[cell as usize] {
                OctreeCell::Whole(inside) => walk.enter(inside, a, None),
                OctreeCell::Leaf(leaf) => walk.pass(&self.leaves[leaf as usize], [a, b], scratch),
                OctreeCell::Split(first) => {
                    let front = (0..8).map(|i| i ^ mirror);
                    let children = front.map(|i| (first + i as u32, octant(&region, i)));
                    stack.extend(children.rev());
                    None
                }
            };
            if met.is_some() {
                break;
            }
        }
        scratch.stack = stack;
        met
    }

    /// Returns the curves in which faces meet at an angle.
    pub(crate) fn features(&self, control: &Control<'_>) -> Vec<Vec<Point3>> {
        let options = FeatureOptions {
            size: self.bounds.diagonal() / 60.0,
            ..FeatureOptions::default()
        };
        let found = find(self.solid.as_ref(), self.bounds, &options, control);
        found.curves.into_iter().map(|c| c.points).collect()
    }

    /// Returns the outward unit normal of a piece at a point of a ray. If the formula has no
    /// derivative there, as for roots of zero, it is evaluated slightly before the point; zero if
    /// that fails, too.
    pub(crate) fn normal(&self, piece: u32, ray: &Ray, t: f64) -> Point3 {
        let size = self.bounds.diagonal();
        let places = NORMAL_OFFSETS
            .iter()
            .map(|share| along(ray.o, ray.d, t - share * size));
        let normal = |p| {
            let (_, g) = self.solid.gradient(piece, p);
            unit(g.map(|v| -v))
        };
        let mut known = places.map(normal).filter(|n| *n != [0.0; 3]);
        known.next().unwrap_or([0.0; 3])
    }
}

/// Result of advancing along a ray.
enum MarchResult {
    /// The sign changes between two points.
    Met([(f64, f64); 2]),
    /// The sign does not change up to a point with about this value.
    Through((f64, f64)),
    /// The sign does not change up to a point, and the stretch continues.
    Open((f64, f64)),
}

/// State of a ray while it passes cells.
struct RayWalk<'a> {
    model: &'a Model,
    ray: &'a Ray,
    /// True if the ray is inside; `None` before its first cell.
    is_inside: Option<bool>,
    is_cap: bool,
}

impl RayWalk<'_> {
    /// Advances to a point that is inside or outside. Detects crossings that rounding hides between
    /// two cells.
    fn enter(&mut self, inside: bool, t: f64, piece: Option<u32>) -> Option<ModelHit> {
        let before = self.is_inside.replace(inside);
        match before {
            None if inside && self.is_cap => Some(ModelHit { t, piece: None }),
            Some(before) if before != inside => {
                let piece = piece.or_else(|| Some(self.nearest_piece(t)));
                Some(ModelHit { t, piece })
            }
            _ => None,
        }
    }

    /// Returns the piece that determines the whole solid at a point.
    fn nearest_piece(&self, t: f64) -> u32 {
        let tree = self.model.solid.tree();
        let pieces = pieces_of(tree);
        let mut values = vec![0.0; pieces.len()];
        let p = along(self.ray.o, self.ray.d, t);
        self.model.solid.values(&pieces, &[p], &mut values);
        let value = |k: u32| pieces.binary_search(&k).map_or(f64::NAN, |k| values[k]);
        tree.value_and_piece(&value).1
    }

    fn at(&self, leaf: &CellPieces, t: f64, scratch: &mut Scratch) -> f64 {
        let p = along(self.ray.o, self.ray.d, t);
        self.model.value(leaf, p, scratch)
    }

    /// Passes a cell that may contain surface.
    fn pass(
        &mut self,
        leaf: &CellPieces,
        [a, b]: [f64; 2],
        scratch: &mut Scratch,
    ) -> Option<ModelHit> {
        let first = self.at(leaf, a, scratch);
        if let Some(met) = self.enter(first >= 0.0, a, Some(leaf.pieces[0])) {
            return Some(self.named(leaf, met, scratch));
        }
        let ends = [(a, first), (b, f64::NAN)];
        let rates = leaf
            .slopes
            .as_ref()
            .and_then(|s| finite_rates(s, self.ray.d));
        let found = match rates.map(|rates| self.march(leaf, ends, rates, scratch)) {
            Some(MarchResult::Met(found)) => Some(found),
            Some(MarchResult::Through(_)) => None,
            // The bounds are wide here: narrower ones, along the ray alone, are worth their time.
            Some(MarchResult::Open(there)) => self.search(leaf, [there, ends[1]], scratch),
            None => self.search(leaf, ends, scratch),
        };
        let t = self.enclosed(leaf, found?, scratch);
        let met = ModelHit {
            t,
            piece: Some(leaf.pieces[0]),
        };
        Some(self.named(leaf, met, scratch))
    }

    /// Sets the piece that decides at the intersection.
    fn named(&self, leaf: &CellPieces, met: ModelHit, scratch: &mut Scratch) -> ModelHit {
        if met.piece.is_none() || leaf.pieces.len() == 1 {
            return met;
        }
        self.at(leaf, met.t, scratch);
        let values = &scratch.values;
        let (_, k) = leaf.tree.value_and_piece(&|k| values[k as usize]);
        ModelHit {
            piece: Some(leaf.pieces[k as usize]),
            ..met
        }
    }

    /// Advances from one point to another, where the rate of the value along the ray lies between
    /// two bounds; it only skips stretches on which the value cannot vanish.
    fn march(
        &self,
        leaf: &CellPieces,
        [first, last]: [(f64, f64); 2],
        [least, most]: [f64; 2],
        scratch: &mut Scratch,
    ) -> MarchResult {
        let end = last.0;
        if least > 0.0 || most < 0.0 {
            let last = (end, self.at(leaf, end, scratch));
            let is_met = (first.1 >= 0.0) != (last.1 >= 0.0);
            return if is_met {
                MarchResult::Met([first, last])
            } else {
                MarchResult::Through(last)
            };
        }
        let finest = FINEST * self.model.bounds.diagonal();
        let (mut t, mut value) = first;
        for _ in 0..24 {
            let rate = if value >= 0.0 { -least } else { most };
            if rate <= 0.0 || t >= end {
                return MarchResult::Through((end, value));
            }
            let next = (t + (value.abs() / rate).max(finest)).min(end);
            let there = self.at(leaf, next, scratch);
            if (there >= 0.0) != (value >= 0.0) {
                return MarchResult::Met([(t, value), (next, there)]);
            }
            (t, value) = (next, there);
        }
        MarchResult::Open((t, value))
    }

    /// Returns the first two points with opposite signs. Stretches that intervals cannot exclude
    /// are marched along if the slope has bounds, and otherwise halved.
    fn search(
        &self,
        leaf: &CellPieces,
        [first, last]: [(f64, f64); 2],
        scratch: &mut Scratch,
    ) -> Option<[(f64, f64); 2]> {
        let finest = FINEST * self.model.bounds.diagonal();
        let mut begin = first;
        let mut ends = vec![last.0];
        for count in 0..MAX_STRETCHES {
            let end = *ends.last()?;
            let stretch = [begin.0, end];
            if !self.is_open(leaf, stretch, scratch) {
                // The sign is constant: that of the value before.
                begin = (end, begin.1);
                ends.pop();
                continue;
            }
            // Ranges of gradients cost more than those of values: they are computed every second
            // time.
            let is_worth = ends.len() % 2 == 1 && end - begin.0 > finest;
            if let Some(rates) = self.rates(leaf, stretch).filter(|_| is_worth) {
                match self.march(leaf, [begin, (end, f64::NAN)], rates, scratch) {
                    MarchResult::Met(found) => return Some(found),
                    MarchResult::Through(there) => {
                        begin = there;
                        ends.pop();
                        continue;
                    }
                    MarchResult::Open(there) => begin = there,
                }
            }
            let middle = 0.5 * (begin.0 + end);
            let is_long = end - begin.0 > finest && middle > begin.0 && middle < end;
            if is_long && count + 1 < MAX_STRETCHES {
                ends.push(middle);
                continue;
            }
            let there = (end, self.at(leaf, end, scratch));
            if (there.1 >= 0.0) != (begin.1 >= 0.0) {
                return Some([begin, there]);
            }
            begin = there;
            ends.pop();
        }
        None
    }

    /// Returns true if intervals cannot exclude a change of sign along a stretch.
    fn is_open(&self, leaf: &CellPieces, stretch: [f64; 2], scratch: &mut Scratch) -> bool {
        let region = self.region(stretch);
        scratch.ranges.resize(leaf.pieces.len(), Interval::ALL);
        let solid = &self.model.solid;
        solid.bounds(&leaf.pieces, region, &mut scratch.ranges);
        let range = leaf.tree.range(&|k| scratch.ranges[k as usize]);
        range.lo() <= 0.0 && range.hi() >= 0.0
    }

    /// Returns bounds of the rate of the value along a stretch; `None` if there are none.
    fn rates(&self, leaf: &CellPieces, stretch: [f64; 2]) -> Option<[f64; 2]> {
        let region = self.region(stretch);
        let each = leaf
            .pieces
            .iter()
            .map(|p| self.model.solid.slopes(*p, region));
        let slopes: Vec<[Interval; 3]> = each.collect::<Option<_>>()?;
        finite_rates(&slopes, self.ray.d)
    }

    /// Returns the box of a stretch.
    fn region(&self, stretch: [f64; 2]) -> Aabb {
        Aabb::from_points(&stretch.map(|t| along(self.ray.o, self.ray.d, t)))
    }

    /// Returns the root between two points of opposite signs, by the Illinois variant of regula
    /// falsi with bisections where it is slow.
    fn enclosed(&self, leaf: &CellPieces, ends: [(f64, f64); 2], scratch: &mut Scratch) -> f64 {
        let [(mut a, mut fa), (mut b, mut fb)] = ends;
        let is_inside = fa >= 0.0;
        // Bisection alone needs 60 steps.
        for k in 0..100 {
            let chord = (a * fb - b * fa) / (fb - fa);
            let is_between = chord > a && chord < b;
            let m = if k % 3 == 2 || !is_between {
                0.5 * (a + b)
            } else {
                chord
            };
            if m <= a || m >= b {
                break;
            }
            let fm = self.at(leaf, m, scratch);
            if (fm >= 0.0) == is_inside {
                (a, fa) = (m, fm);
                fb *= 0.5;
            } else {
                (b, fb) = (m, fm);
                fa *= 0.5;
            }
            if b - a <= 4.0 * f64::EPSILON * a.abs().max(b.abs()) {
                break;
            }
        }
        0.5 * (a + b)
    }
}

/// Returns an octant of a box.
fn octant(region: &Aabb, i: usize) -> Aabb {
    let middle = region.center();
    let is_upper = |k: usize| i >> k & 1 == 1;
    Aabb {
        lo: std::array::from_fn(|k| if is_upper(k) { middle[k] } else { region.lo[k] }),
        hi: std::array::from_fn(|k| if is_upper(k) { region.hi[k] } else { middle[k] }),
    }
}

/// Returns the pieces of a tree, sorted and without duplicates.
fn pieces_of(tree: &Csg) -> Vec<u32> {
    let mut pieces = tree.pieces();
    pieces.sort_unstable();
    pieces.dedup();
    pieces
}

/// Replaces the numbers of pieces by their indices in a list.
fn renumbered(tree: &Csg, pieces: &[u32]) -> Csg {
    let all = |list: &[Csg]| list.iter().map(|c| renumbered(c, pieces)).collect();
    match tree {
        Csg::Piece(i) => Csg::Piece(pieces.binary_search(i).unwrap_or(0) as u32),
        Csg::Min(list) => Csg::Min(all(list)),
        Csg::Max(list) => Csg::Max(all(list)),
    }
}

/// Returns bounds of the rate of a minimum or maximum of pieces along a direction; `None` if they
/// are not finite.
fn finite_rates(slopes: &[[Interval; 3]], d: Point3) -> Option<[f64; 2]> {
    let mut bounds = [f64::INFINITY, f64::NEG_INFINITY];
    for s in slopes {
        let (mut lo, mut hi, mut size) = (0.0, 0.0, 0.0);
        for k in 0..3 {
            let (a, b) = (s[k].lo() * d[k], s[k].hi() * d[k]);
            (lo, hi) = (lo + a.min(b), hi + a.max(b));
            size += a.abs().max(b.abs());
        }
        // More than the rounding of three products and their sum.
        let slack = 8.0 * f64::EPSILON * size;
        // NaN must not be lost in a minimum.
        if !(lo.is_finite() && hi.is_finite()) {
            return None;
        }
        bounds = [bounds[0].min(lo - slack), bounds[1].max(hi + slack)];
    }
    Some(bounds)
}

/// Returns true if the gradient hardly turns: then most rays meet the surface in a cell at most
/// once.
fn is_narrow(slopes: &[Interval; 3]) -> bool {
    let middle = slopes.map(|s| 0.5 * (s.lo() + s.hi()));
    let widths = slopes.map(|s| 0.5 * (s.hi() - s.lo()));
    let (size, width) = (dot(middle, middle), dot(widths, widths));
    width < 0.01 * size
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform::field::hyperfun::{Mode, Model as Program};

    fn model(body: &str, half: f64) -> Model {
        let text = format!("m(x[3], a[1]) {{ array c[3]; c = [0, 0, 0]; {body} }}");
        let program = Program::parse(&text, Mode::Default).expect("a program");
        let (solid, _) = isoform::solid_of(&program, &[1.0]).expect("a solid");
        let bounds = Aabb {
            lo: [-half; 3],
            hi: [half; 3],
        };
        Model::new(solid, bounds, false, &Control::default()).expect("no end")
    }

    fn first(model: &Model, o: Point3, toward: Point3) -> Option<f64> {
        let d = unit(isoform::geom::sub(toward, o));
        let ray = Ray { o, d, from: 0.0 };
        let whole = [0.0, f64::INFINITY];
        let met = model.meet(&ray, whole, Some(false), &mut Scratch::default());
        met.map(|m| m.t)
    }

    /// Returns the distance to the unit ball around 0.
    fn ball(o: Point3, toward: Point3) -> Option<f64> {
        let d = unit(isoform::geom::sub(toward, o));
        let (b, c) = (dot(o, d), dot(o, o) - 1.0);
        (b * b >= c).then(|| -b - (b * b - c).sqrt())
    }

    /// A piece that is undefined in a part of a cell does not hide another one there.
    #[test]
    fn undefined_pieces_hide_nothing() {
        let part = model("m = max(hfSphere(x, c, 0.8), 2 + sqrt(x[1] + 0.75));", 1.1);
        let t = first(&part, [-3.0, 0.0, 0.0], [0.0; 3]).expect("the ball");
        assert!((t - 2.2).abs() < 1e-9, "{t}");
    }

    #[test]
    fn a_ball_is_met_where_it_is() {
        let sphere = model("m = hfSphere(x, c, 1);", 1.1);
        let mut random = fastrand::Rng::with_seed(7);
        let mut seen = 0;
        for _ in 0..3000 {
            let o = [3.0, -2.5, 1.5];
            let toward = [(); 3].map(|()| 2.4 * random.f64() - 1.2);
            let (found, want) = (first(&sphere, o, toward), ball(o, toward));
            match (found, want) {
                (Some(t), Some(w)) => assert!((t - w).abs() < 1e-9, "{t} {w}"),
                (None, None) => {}
                // Rays that graze it within a fraction of a pixel may miss it.
                (_, w) => assert!(w.is_some(), "met beside the ball"),
            }
            seen += usize::from(found.is_some() && want.is_some());
        }
        assert!(seen > 1000, "{seen}");
    }

    #[test]
    fn thin_walls_are_not_lost() {
        // A shell of relative thickness 1e-4, which no grid of cells would resolve.
        let body = "m = min(hfSphere(x, c, 1), -hfSphere(x, c, 0.9999));";
        let shell = model(body, 1.1);
        for i in 0..500 {
            let toward = [0.001 * f64::from(i) - 0.3, 0.0007 * f64::from(i), 0.2];
            let (o, want) = (
                [0.3, 0.2, 5.0],
                ball([0.3, 0.2, 5.0], toward).expect("a hit"),
            );
            let t = first(&shell, o, toward).expect("the shell");
            assert!((t - want).abs() < 1e-9, "{toward:?}: {t} {want}");
        }
    }

    #[test]
    fn an_axis_through_corners_of_cells_is_no_gap() {
        let cube = model(
            "m = min(min(1 - abs(x[1]), 1 - abs(x[2])), 1 - abs(x[3]));",
            2.0,
        );
        for p in [[0.0, 0.0], [0.5, 0.5], [0.25, -0.75], [1.0 - 1e-9, 0.5]] {
            let t = first(&cube, [p[0], p[1], 4.0], [p[0], p[1], 0.0]).expect("the cube");
            assert!((t - 3.0).abs() < 1e-12, "{p:?} {t}");
        }
        assert_eq!(
            first(&cube, [1.0 + 1e-9, 0.5, 4.0], [1.0 + 1e-9, 0.5, 0.0]),
            None
        );
    }

    #[test]
    fn what_is_inside_at_a_cut_is_a_cap() {
        let sphere = model("m = hfSphere(x, c, 1);", 1.1);
        let ray = Ray {
            o: [0.2, 0.1, 5.0],
            d: [0.0, 0.0, -1.0],
            from: 0.0,
        };
        let met = |cap| sphere.meet(&ray, [4.5, 9.0], cap, &mut Scratch::default());
        let capped = met(Some(true)).expect("a cap");
        assert!(capped.piece.is_none() && capped.t == 4.5, "{capped:?}");
        let open = met(None).expect("the other side");
        let want = 5.0 + (1.0_f64 - 0.05).sqrt();
        assert!(
            open.piece.is_some() && (open.t - want).abs() < 1e-9,
            "{open:?}"
        );
    }
}
