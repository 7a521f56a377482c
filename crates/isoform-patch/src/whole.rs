//! Surface to which a patch belongs: one smooth function, or smooth parts joined by minima and
//! maxima.
//!
//! Terms: a *piece* is a leaf of the tree of minima and maxima; a *part* is a smooth function of a
//! piece with *limits*, further functions that are all nonnegative where the part is valid; parts
//! with one *function* continue each other smoothly; an *edge* of a part is where another function
//! begins to determine the surface, or where a limit vanishes.

mod edge;
mod octree;

pub(crate) use edge::EdgeViolation;

use crate::singular::AvoidedPoints;
use isoform_geom::{Aabb, Csg, Field, Parts, Point3, norm};
use isoform_num::Interval;
use octree::{LocalParts, Octree, OctreeCell};
use std::collections::BTreeSet;

/// Distance, in units of the given scale, below which a point counts as on the surface. Points come
/// from Newton's method on another function than the deciding one, so this is larger than the
/// residual of that method.
const ON_PART_DISTANCE: f64 = 1e-9;

/// Smooth function with the region in which it is valid.
struct FunctionPart<'f> {
    piece: u32,
    field: &'f dyn Field,
    /// First part known to have an equal function, into which the surface continues smoothly.
    function: usize,
    limits: Vec<&'f dyn Field>,
}

impl FunctionPart<'_> {
    /// Returns the smallest value of the part's limits at `p`; infinite if it has none. The part is
    /// not valid where it is negative.
    fn least_limit(&self, p: Point3) -> f64 {
        let limits = self.limits.iter().map(|l| l.value(p));
        limits.fold(f64::INFINITY, f64::min)
    }

    /// Returns true unless the part is provably invalid throughout a region.
    fn may_count_in(&self, region: Aabb) -> bool {
        (self.limits.iter()).all(|l| l.bounds(region).hi() >= 0.0)
    }
}

/// Surface made of parts; a single field is one part.
pub(crate) struct Whole<'f> {
    parts: Vec<FunctionPart<'f>>,
    /// Parts that matter anywhere.
    all: LocalParts,
    octree: Octree,
}

/// Parts that can determine the sign in a region.
pub(crate) struct PartsInRegion {
    /// Tree without the pieces that cannot.
    pub(crate) tree: Csg,
    /// Parts of the tree, each function once.
    pub(crate) parts: Vec<usize>,
    /// True, by part, if no other part there has an equal function.
    pub(crate) alone: Vec<bool>,
}

/// Part that determines the sign at a point.
#[derive(Clone, Copy)]
struct DecidingPart {
    /// Signed distance to first order.
    distance: f64,
    part: usize,
}

/// Part of a surface on which a patch grows.
#[derive(Clone, Copy)]
pub(crate) struct GrowthPart<'f> {
    pub(crate) whole: &'f Whole<'f>,
    pub(crate) part: usize,
    /// Policy near singular points.
    pub(crate) near_singular: NearSingular<'f>,
}

impl<'f> GrowthPart<'f> {
    /// Returns the function of the part.
    pub(crate) fn field(&self) -> &'f dyn Field {
        self.whole.field(self.part)
    }
}

/// Policy of a patch near singular points.
#[derive(Clone, Copy)]
pub(crate) enum NearSingular<'f> {
    /// Grows across them; what cannot be proved is cut off.
    Cross,
    /// Grows across them with a small effort of proof, as there is an alternative.
    Try,
    /// Avoids them.
    Avoid(&'f AvoidedPoints),
}

impl<'f> NearSingular<'f> {
    /// Returns the points to be avoided; `None` if there are none.
    pub(crate) fn avoided(self) -> Option<&'f AvoidedPoints> {
        match self {
            Self::Avoid(avoided) => Some(avoided),
            Self::Cross | Self::Try => None,
        }
    }
}

impl<'f> Whole<'f> {
    /// Returns the zero set of one function.
    pub(crate) fn of_field(field: &'f dyn Field) -> Self {
        let all = LocalParts {
            tree: Csg::Piece(0),
            pieces: vec![(0, vec![0])],
        };
        Self {
            parts: vec![FunctionPart {
                piece: 0,
                field,
                function: 0,
                limits: Vec::new(),
            }],
            octree: Octree::of_one(OctreeCell::new(Aabb::EMPTY, all.clone())),
            all,
        }
    }

    /// Returns a surface of parts, with an octree over the region.
    pub(crate) fn of_parts(parts: &'f Parts, region: &Aabb) -> Self {
        let list = parts.parts.iter().map(|p| FunctionPart {
            piece: p.piece,
            field: p.field.as_ref(),
            function: p.function,
            limits: p.limits.iter().map(AsRef::as_ref).collect(),
        });
        let list: Vec<FunctionPart<'f>> = list.collect();
        let numbers: BTreeSet<u32> = parts.tree.pieces().into_iter().collect();
        let of = |piece: u32| {
            let all = 0..list.len();
            all.filter(|&k| list[k].piece == piece).collect()
        };
        let all = LocalParts {
            tree: parts.tree.clone(),
            pieces: (numbers.into_iter())
                .map(|piece| (piece, of(piece)))
                .collect(),
        };
        let mut whole = Self {
            parts: list,
            octree: Octree::of_one(OctreeCell::new(octree::around(region), all.clone())),
            all,
        };
        whole.divide(0, 0);
        whole
    }

    /// Returns the parts that matter in the octree; of parts with one function the first.
    pub(crate) fn relevant(&self) -> Vec<usize> {
        let all: BTreeSet<usize> = (self.octree.leaves())
            .filter_map(|c| self.narrow(&c.local, c.region))
            .flat_map(|l| l.pieces.into_iter().flat_map(|p| p.1))
            .map(|k| self.parts[k].function)
            .collect();
        all.into_iter().collect()
    }

    /// Returns the number of parts.
    pub(crate) fn len(&self) -> usize {
        self.parts.len()
    }
    /// Returns true if the surface is one function without limits.
    pub(crate) fn is_single(&self) -> bool {
        self.parts.len() == 1 && self.parts[0].limits.is_empty()
    }
    /// Returns the function of a part.
    pub(crate) fn field(&self, part: usize) -> &'f dyn Field {
        self.parts[part].field
    }
    /// Returns the limits of a part, which is valid where none of them is negative.
    pub(crate) fn limits(&self, part: usize) -> &[&'f dyn Field] {
        &self.parts[part].limits
    }
    /// Returns the piece of a part.
    pub(crate) fn piece(&self, part: usize) -> u32 {
        self.parts[part].piece
    }

    /// Returns the valid part of a piece at a point; `None` if the piece has no parts there.
    fn counting(&self, parts: &[usize], p: Point3) -> Option<usize> {
        if let [one] = parts {
            return Some(*one);
        }
        let least = parts.iter().map(|&k| (k, self.parts[k].least_limit(p)));
        least
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
            .map(|k| k.0)
    }

    /// Returns the signed distance to first order, and the part that determines it.
    pub(crate) fn first_order(&self, p: Point3) -> (f64, usize) {
        let found = self.deciding(p);
        (found.distance, found.part)
    }

    fn deciding(&self, p: Point3) -> DecidingPart {
        let of = |part: usize| {
            let j = self.parts[part].field.jet(p);
            DecidingPart {
                distance: j.v / norm(j.g),
                part,
            }
        };
        if self.is_single() {
            return of(0);
        }
        let none = DecidingPart {
            distance: f64::NAN,
            part: 0,
        };
        let local = self.local(Aabb { lo: p, hi: p });
        let all: Vec<(u32, DecidingPart)> = local
            .pieces
            .iter()
            .map(|(piece, parts)| (*piece, self.counting(parts, p).map_or(none, of)))
            .collect();
        let find = |piece: u32| all.iter().find(|a| a.0 == piece).map_or(none, |a| a.1);
        let (distance, piece) = local.tree.value_and_piece(&|piece| find(piece).distance);
        DecidingPart {
            distance,
            ..find(piece)
        }
    }

    /// Returns true if a point of the zero set of a part lies on the surface and on that part of
    /// it.
    pub(crate) fn is_on(&self, part: usize, p: Point3, scale: f64) -> bool {
        if self.is_single() {
            return true;
        }
        let found = self.deciding(p);
        let is_within = || self.parts[part].limits.iter().all(|l| l.value(p) >= 0.0);
        found.distance.abs() <= ON_PART_DISTANCE * scale
            && (self.parts[found.part].function == self.parts[part].function || is_within())
    }

    /// Returns the parts that can determine the sign in a region; `None` if it contains no surface.
    pub(crate) fn within(&self, region: Aabb) -> Option<PartsInRegion> {
        if self.is_single() {
            return Some(PartsInRegion {
                tree: Csg::Piece(0),
                parts: vec![0],
                alone: vec![true],
            });
        }
        let local = self.narrow(self.local(region), region)?;
        let (mut parts, mut alone): (Vec<usize>, Vec<bool>) = (Vec::new(), Vec::new());
        for k in local.pieces.into_iter().flat_map(|p| p.1) {
            match parts.iter().position(|o| self.are_one_function(*o, k)) {
                Some(same) => alone[same] = false,
                None => {
                    parts.push(k);
                    alone.push(true);
                }
            }
        }
        Some(PartsInRegion {
            tree: local.tree,
            parts,
            alone,
        })
    }

    /// Returns true if two parts of one piece have equal functions.
    fn are_one_function(&self, a: usize, b: usize) -> bool {
        let (a, b) = (&self.parts[a], &self.parts[b]);
        a.piece == b.piece && std::ptr::addr_eq(a.field, b.field)
    }

    /// Returns the parts of a list that may be valid in a region.
    fn possible(&self, parts: &[usize], region: Aabb) -> Vec<usize> {
        let may_count = |k: &usize| self.parts[*k].may_count_in(region);
        parts.iter().copied().filter(may_count).collect()
    }
    fn hull(&self, parts: &[usize], region: Aabb) -> Interval {
        let all = parts.iter().map(|&k| self.parts[k].field.bounds(region));
        all.reduce(|a, b| a.hull(&b)).unwrap_or(Interval::ALL)
    }

    /// Returns a range of the function at a point.
    pub(crate) fn range_at(&self, p: Point3) -> Interval {
        let region = Aabb { lo: p, hi: p };
        let local = self.local(region);
        local
            .tree
            .range(&|piece| self.hull(&self.possible(local.parts(piece), region), region))
    }
}
