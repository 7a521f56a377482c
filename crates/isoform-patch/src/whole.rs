//! The whole surface that a patch belongs to: one smooth function, or smooth parts joined by minima
//! and maxima.

use crate::singular::Avoided;
use isoform_geom::{Aabb, Csg, Field, Parts, Point3, cross, dot, norm, sub};
use isoform_num::Interval;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Where it is looked on which side of an edge a part is, in the scale given.
const ASIDE: f64 = 1e-6;
/// What the octree reaches beyond the region, in its edges.
const MARGIN: f64 = 0.3;
/// Halvings of its cells.
const DEEPEST: usize = 6;
/// Cells with so few parts are not divided.
const FEW: usize = 2;
/// Newton steps onto an edge.
const STEPS: usize = 20;
/// Foot points on edges are found to this, in the scale given.
const ON_EDGE: f64 = 1e-11;
/// A value below this, in lengths and in the scale given, is none: the place is on the surface.
const ON_SURFACE: f64 = 1e-9;
/// Functions whose normals differ by a sine below this do not meet in an edge that could be found.
const TANGENTIAL: f64 = 1e-3;

/// A smooth function with where it counts.
struct Part<'f> {
    piece: u32,
    field: &'f dyn Field,
    /// The first part with the same function, as far as is known: the surface goes on smoothly from
    /// one to the other.
    function: usize,
    limits: Vec<&'f dyn Field>,
}

/// A surface as parts; a single field is one of them.
pub(crate) struct Whole<'f> {
    parts: Vec<Part<'f>>,
    /// What matters anywhere.
    all: Arc<Local>,
    /// An octree; its root is the first cell.
    cells: Vec<Cell>,
}

/// What matters in a cell.
struct Local {
    tree: Csg,
    /// The pieces of the tree with those of their parts that may count.
    pieces: Vec<(u32, Vec<usize>)>,
}

/// What decides the sign in a region.
pub(crate) struct Within {
    /// The tree without what cannot.
    pub(crate) tree: Csg,
    /// Its parts, each function once.
    pub(crate) parts: Vec<usize>,
    /// Whether no other part there has the same function.
    pub(crate) alone: Vec<bool>,
}

struct Cell {
    region: Aabb,
    local: Arc<Local>,
    /// The first of eight cells that this one is divided into.
    children: Option<usize>,
}

impl Local {
    fn parts(&self, piece: u32) -> &[usize] {
        self.pieces
            .iter()
            .find(|p| p.0 == piece)
            .map_or(&[], |p| &p.1)
    }
}

/// Where a place lies outside of a part.
#[derive(Clone, Copy)]
pub(crate) struct Beyond<'f> {
    /// How far the surface is, to first order, or how far the part's limit.
    pub(crate) by: f64,
    /// What vanishes at the edge of the part there.
    pub(crate) edge: &'f dyn Field,
}

/// A part of a whole on which a patch grows.
#[derive(Clone, Copy)]
pub(crate) struct On<'f> {
    pub(crate) whole: &'f Whole<'f>,
    pub(crate) part: usize,
    /// What it stays away from.
    pub(crate) near_singular: NearSingular<'f>,
}

/// What a patch does near singular points.
#[derive(Clone, Copy)]
pub(crate) enum NearSingular<'f> {
    /// It goes on, and what cannot be proved is cut off.
    Cross,
    /// The same, but it is soon given up: there is another way.
    Try,
    /// It stays away from them.
    Avoid(&'f Avoided),
}

impl<'f> NearSingular<'f> {
    /// What is avoided.
    pub(crate) fn avoided(self) -> Option<&'f Avoided> {
        match self {
            Self::Avoid(avoided) => Some(avoided),
            Self::Cross | Self::Try => None,
        }
    }
}

impl<'f> Whole<'f> {
    /// The zero set of one function.
    pub(crate) fn of_field(field: &'f dyn Field) -> Self {
        let local = Arc::new(Local {
            tree: Csg::Piece(0),
            pieces: vec![(0, vec![0])],
        });
        Self {
            parts: vec![Part {
                piece: 0,
                field,
                function: 0,
                limits: Vec::new(),
            }],
            all: local.clone(),
            cells: vec![Cell {
                region: Aabb::EMPTY,
                local,
                children: None,
            }],
        }
    }

    /// A surface of parts; in the region it is known well what matters where.
    pub(crate) fn of_parts(parts: &'f Parts, region: &Aabb) -> Self {
        let list: Vec<Part<'f>> = parts
            .parts
            .iter()
            .map(|p| Part {
                piece: p.piece,
                field: p.field.as_ref(),
                function: p.function,
                limits: p.limits.iter().map(AsRef::as_ref).collect(),
            })
            .collect();
        let numbers: BTreeSet<u32> = parts.tree.pieces().into_iter().collect();
        let pieces = numbers
            .into_iter()
            .map(|piece| {
                (
                    piece,
                    (0..list.len())
                        .filter(|&k| list[k].piece == piece)
                        .collect(),
                )
            })
            .collect();
        // Patches reach beyond the region.
        let more = region.size().map(|s| MARGIN * s);
        let region = Aabb {
            lo: std::array::from_fn(|k| region.lo[k] - more[k]),
            hi: std::array::from_fn(|k| region.hi[k] + more[k]),
        };
        let local = Arc::new(Local {
            tree: parts.tree.clone(),
            pieces,
        });
        let mut whole = Self {
            parts: list,
            all: local.clone(),
            cells: vec![Cell {
                region,
                local,
                children: None,
            }],
        };
        whole.divide(0, 0);
        whole
    }

    /// Divides a cell until few parts are left.
    fn divide(&mut self, cell: usize, depth: usize) {
        let region = self.cells[cell].region;
        // Without surface in it, what matters is what did before.
        let Some(local) = self.narrow(&self.cells[cell].local, region) else {
            return;
        };
        let parts: usize = local.pieces.iter().map(|p| p.1.len()).sum();
        let local = Arc::new(local);
        self.cells[cell].local = local.clone();
        if parts <= FEW || depth == DEEPEST {
            return;
        }
        let first = self.cells.len();
        self.cells[cell].children = Some(first);
        for octant in 0..8 {
            let middle = |k: usize| 0.5 * (region.lo[k] + region.hi[k]);
            let upper = |k: usize| octant >> k & 1 == 1;
            let region = Aabb {
                lo: std::array::from_fn(|k| if upper(k) { middle(k) } else { region.lo[k] }),
                hi: std::array::from_fn(|k| if upper(k) { region.hi[k] } else { middle(k) }),
            };
            self.cells.push(Cell {
                region,
                local: local.clone(),
                children: None,
            });
        }
        for child in first..first + 8 {
            self.divide(child, depth + 1);
        }
    }

    /// What matters in a region, of what matters in one that holds it; none where there is no
    /// surface.
    fn narrow(&self, of: &Local, region: Aabb) -> Option<Local> {
        let known: Vec<(u32, Vec<usize>, Interval)> = of
            .pieces
            .iter()
            .map(|(piece, parts)| {
                let parts = self.possible(parts, region);
                let range = self.hull(&parts, region);
                (*piece, parts, range)
            })
            .collect();
        let range = |piece: u32| {
            known
                .iter()
                .find(|k| k.0 == piece)
                .map_or(Interval::ALL, |k| k.2)
        };
        let tree = narrowed(&of.tree, &range).ok()?;
        let left: BTreeSet<u32> = tree.pieces().into_iter().collect();
        Some(Local {
            tree,
            pieces: known
                .into_iter()
                .filter(|k| left.contains(&k.0))
                .map(|k| (k.0, k.1))
                .collect(),
        })
    }

    /// The smallest cell that holds a region.
    fn local(&self, region: Aabb) -> &Local {
        let holds = |cell: &Cell| {
            (0..3).all(|k| cell.region.lo[k] <= region.lo[k] && region.hi[k] <= cell.region.hi[k])
        };
        let mut at = &self.cells[0];
        if !holds(at) {
            return &self.all;
        }
        while let Some(child) = at
            .children
            .and_then(|first| self.cells[first..first + 8].iter().find(|c| holds(c)))
        {
            at = child;
        }
        &at.local
    }

    /// The parts that matter somewhere; of those with the same function the first.
    pub(crate) fn relevant(&self) -> Vec<usize> {
        let leaves = self.cells.iter().filter(|c| c.children.is_none());
        let all: BTreeSet<usize> = leaves
            .filter_map(|c| self.narrow(&c.local, c.region))
            .flat_map(|l| l.pieces.into_iter().flat_map(|p| p.1))
            .map(|k| self.parts[k].function)
            .collect();
        all.into_iter().collect()
    }

    /// Number of parts.
    pub(crate) fn len(&self) -> usize {
        self.parts.len()
    }
    /// Whether there is one function without limits only.
    pub(crate) fn is_single(&self) -> bool {
        self.parts.len() == 1 && self.parts[0].limits.is_empty()
    }
    /// The function of a part.
    pub(crate) fn field(&self, part: usize) -> &'f dyn Field {
        self.parts[part].field
    }

    /// The one of the parts of a piece that counts at a place.
    fn counting(&self, parts: &[usize], p: Point3) -> Option<usize> {
        if let [one] = parts {
            return Some(*one);
        }
        let least = |k: usize| {
            self.parts[k]
                .limits
                .iter()
                .map(|l| l.value(p))
                .fold(f64::INFINITY, f64::min)
        };
        parts
            .iter()
            .copied()
            .map(|k| (k, least(k)))
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
            .map(|k| k.0)
    }

    /// The signed distance to first order, and the part that decides it.
    pub(crate) fn first_order(&self, p: Point3) -> (f64, usize) {
        let of = |field: &dyn Field| {
            let j = field.jet(p);
            j.v / norm(j.g)
        };
        if self.is_single() {
            return (of(self.parts[0].field), 0);
        }
        let local = self.local(Aabb { lo: p, hi: p });
        let all: Vec<(u32, f64, usize)> = local
            .pieces
            .iter()
            .map(|(piece, parts)| {
                self.counting(parts, p)
                    .map_or((*piece, f64::NAN, 0), |part| {
                        (*piece, of(self.parts[part].field), part)
                    })
            })
            .collect();
        let find = |piece: u32| {
            all.iter()
                .find(|a| a.0 == piece)
                .map_or((f64::NAN, 0), |a| (a.1, a.2))
        };
        let (value, piece) = local.tree.value_and_piece(&|piece| find(piece).0);
        (value, find(piece).1)
    }

    /// Whether a place on the zero set of a part is on the surface, and on that part of it.
    pub(crate) fn is_on(&self, part: usize, p: Point3, scale: f64) -> bool {
        if self.is_single() {
            return true;
        }
        let (value, decides) = self.first_order(p);
        let is_within = || self.parts[part].limits.iter().all(|l| l.value(p) >= 0.0);
        value.abs() <= ON_SURFACE * scale
            && (self.parts[decides].function == self.parts[part].function || is_within())
    }

    /// Where a place on a part is beyond the part's edge; none where it is not, and where it cannot
    /// be said.
    pub(crate) fn beyond(&self, part: usize, p: Point3) -> Option<Beyond<'f>> {
        if self.is_single() {
            return None;
        }
        let own = &self.parts[part];
        let (value, decides) = self.first_order(p);
        let other = &self.parts[decides];
        if other.function == own.function {
            return None;
        }
        // Beyond a limit of the part that is the least beyond its own; at smooth joins the distance
        // says nothing yet.
        let local = self.local(Aabb { lo: p, hi: p });
        let mut least: Option<Option<Beyond<'f>>> = None;
        for same in local
            .pieces
            .iter()
            .flat_map(|piece| &piece.1)
            .map(|&k| &self.parts[k])
            .filter(|o| o.function == own.function)
        {
            let mut worst: Option<Beyond<'f>> = None;
            for limit in &same.limits {
                let j = limit.jet(p);
                let by = -j.v / norm(j.g);
                if by > worst.map_or(0.0, |w| w.by) {
                    worst = Some(Beyond { by, edge: *limit });
                }
            }
            if least.is_none_or(|l| l.map_or(0.0, |l| l.by) > worst.map_or(0.0, |w| w.by)) {
                least = Some(worst);
            }
        }
        let j = own.field.jet(p);
        let sharp = Beyond {
            by: value.abs() - j.v.abs() / norm(j.g),
            edge: other.field,
        };
        match least.flatten() {
            // From a constant, which vanishes nowhere, the distance is infinite.
            Some(limit) if limit.by >= sharp.by || !sharp.by.is_finite() => Some(limit),
            _ => (sharp.by > 0.0).then_some(sharp),
        }
    }

    /// The nearest point of the part's edge that Newton's method finds from a place on it, with
    /// what vanishes there.
    pub(crate) fn nearest_edge(
        &self,
        part: usize,
        p: Point3,
        scale: f64,
    ) -> Option<(Point3, &'f dyn Field)> {
        let own = &self.parts[part];
        let others = self
            .parts
            .iter()
            .enumerate()
            .filter(|(k, o)| o.function == *k && o.function != own.function)
            .map(|(_, o)| o.field);
        let limits = self
            .parts
            .iter()
            .filter(|o| o.function == own.function)
            .flat_map(|o| o.limits.iter().copied());
        let mut best: Option<(f64, Point3, &'f dyn Field)> = None;
        for edge in others.chain(limits) {
            let Some(q) = onto_both(own.field, edge, p, scale) else {
                continue;
            };
            let d = norm(sub(q, p));
            if best.is_none_or(|b| d < b.0)
                && self.first_order(q).0.abs() <= ON_SURFACE * scale
                && self.ends_at(own, edge, q, scale)
            {
                best = Some((d, q, edge));
            }
        }
        best.map(|(_, q, edge)| (q, edge))
    }

    /// Whether a part is there on one side of an edge, and not on the other.
    fn ends_at(&self, own: &Part<'f>, edge: &dyn Field, q: Point3, scale: f64) -> bool {
        let (f, g) = (own.field.jet(q).g, edge.jet(q).g);
        let across = cross(f, cross(f, g));
        let step = ASIDE * scale / norm(across);
        let is_there = |sign: f64| {
            let p: Point3 = std::array::from_fn(|k| q[k] + sign * step * across[k]);
            self.parts[self.first_order(p).1].function == own.function
        };
        is_there(1.0) != is_there(-1.0)
    }

    /// What decides the sign in a region.
    pub(crate) fn within(&self, region: Aabb) -> Option<Within> {
        if self.is_single() {
            return Some(Within {
                tree: Csg::Piece(0),
                parts: vec![0],
                alone: vec![true],
            });
        }
        let local = self.narrow(self.local(region), region)?;
        let (mut parts, mut alone): (Vec<usize>, Vec<bool>) = (Vec::new(), Vec::new());
        for k in local.pieces.into_iter().flat_map(|p| p.1) {
            let is_same = |o: &usize| {
                self.parts[*o].piece == self.parts[k].piece
                    && std::ptr::addr_eq(self.parts[*o].field, self.parts[k].field)
            };
            match parts.iter().position(is_same) {
                Some(same) => alone[same] = false,
                None => {
                    parts.push(k);
                    alone.push(true);
                }
            }
        }
        Some(Within {
            tree: local.tree,
            parts,
            alone,
        })
    }

    /// The parts of a list that may count somewhere in a region.
    fn possible(&self, parts: &[usize], region: Aabb) -> Vec<usize> {
        parts
            .iter()
            .copied()
            .filter(|&k| {
                self.parts[k]
                    .limits
                    .iter()
                    .all(|l| l.bounds(region).hi() >= 0.0)
            })
            .collect()
    }
    fn hull(&self, parts: &[usize], region: Aabb) -> Interval {
        let all = parts.iter().map(|&k| self.parts[k].field.bounds(region));
        all.reduce(|a, b| a.hull(&b)).unwrap_or(Interval::ALL)
    }
    /// Where none of these is negative a part counts.
    pub(crate) fn limits(&self, part: usize) -> &[&'f dyn Field] {
        &self.parts[part].limits
    }
    /// The piece of a part.
    pub(crate) fn piece(&self, part: usize) -> u32 {
        self.parts[part].piece
    }

    /// A range of the function at a place.
    pub(crate) fn range_at(&self, p: Point3) -> Interval {
        let region = Aabb { lo: p, hi: p };
        let local = self.local(region);
        local
            .tree
            .range(&|piece| self.hull(&self.possible(local.parts(piece), region), region))
    }
}

/// A tree without what does not change its sign where the pieces have these ranges, or its sign.
fn narrowed(tree: &Csg, range: &impl Fn(u32) -> Interval) -> Result<Csg, bool> {
    let (children, is_min) = match tree {
        Csg::Piece(i) => {
            let r = range(*i);
            return if r.lo() > 0.0 {
                Err(true)
            } else if r.hi() < 0.0 {
                Err(false)
            } else {
                Ok(tree.clone())
            };
        }
        Csg::Min(children) => (children, true),
        Csg::Max(children) => (children, false),
    };
    let mut kept = Vec::new();
    for child in children {
        match narrowed(child, range) {
            Ok(child) => kept.push(child),
            // A minimum is positive where all are, negative where one is.
            Err(positive) if positive != is_min => return Err(positive),
            Err(_) => {}
        }
    }
    match kept.len() {
        0 => Err(is_min),
        1 => Ok(kept.remove(0)),
        _ => Ok(if is_min {
            Csg::Min(kept)
        } else {
            Csg::Max(kept)
        }),
    }
}

/// The point where two functions vanish that Newton's method with least steps leads to.
fn onto_both(f: &dyn Field, g: &dyn Field, from: Point3, scale: f64) -> Option<Point3> {
    let mut p = from;
    for _ in 0..STEPS {
        let (a, b) = (f.jet(p), g.jet(p));
        let (aa, ab, bb) = (dot(a.g, a.g), dot(a.g, b.g), dot(b.g, b.g));
        let determinant = aa * bb - ab * ab;
        if determinant.is_nan() || determinant <= (TANGENTIAL * TANGENTIAL) * aa * bb {
            return None;
        }
        let (s, t) = (
            (bb * a.v - ab * b.v) / determinant,
            (aa * b.v - ab * a.v) / determinant,
        );
        let step: Point3 = std::array::from_fn(|k| s * a.g[k] + t * b.g[k]);
        let length = norm(step);
        let damped = (0.2 * scale / length).min(1.0);
        p = std::array::from_fn(|k| p[k] - damped * step[k]);
        if length <= ON_EDGE * scale {
            return Some(p);
        }
        if !p.iter().all(|v| v.is_finite()) {
            return None;
        }
    }
    None
}

impl<'f> On<'f> {
    /// The function of the part.
    pub(crate) fn field(&self) -> &'f dyn Field {
        self.whole.field(self.part)
    }
    /// Where a place is beyond the part's edge.
    pub(crate) fn beyond(&self, p: Point3) -> Option<Beyond<'f>> {
        self.whole.beyond(self.part, p)
    }
    /// Unit vectors along an edge at a point of it, and from there into the side of the part on
    /// which `towards` lies.
    pub(crate) fn along(
        &self,
        edge: &dyn Field,
        at: Point3,
        towards: Point3,
    ) -> Option<[Point3; 2]> {
        let (f, g) = (self.field().jet(at).g, edge.jet(at).g);
        let t = cross(f, g);
        let length = norm(t);
        if length.is_nan() || length <= TANGENTIAL * norm(f) * norm(g) {
            return None;
        }
        let t = t.map(|v| v / length);
        let n = f.map(|v| v / norm(f));
        let inward = cross(n, t);
        // The side on which the part is: by the place, or by where the part counts.
        let sign = if dot(inward, sub(towards, at)) < 0.0 {
            -1.0
        } else {
            1.0
        };
        Some([t.map(|v| sign * v), inward.map(|v| sign * v)])
    }
}
