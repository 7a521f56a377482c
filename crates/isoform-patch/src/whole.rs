//! The whole surface that a patch belongs to: one smooth function, or smooth parts joined by minima and maxima.

use isoform_geom::{Aabb, Csg, Field, Parts, Point3, cross, dot, norm, sub};
use isoform_num::Interval;

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
    limits: Vec<&'f dyn Field>,
}

/// A surface as parts; a single field is one of them.
pub(crate) struct Whole<'f> {
    tree: Csg,
    parts: Vec<Part<'f>>,
    /// By piece, its parts.
    pieces: Vec<Vec<usize>>,
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
}

impl<'f> Whole<'f> {
    /// The zero set of one function.
    pub(crate) fn of_field(field: &'f dyn Field) -> Self {
        Self { tree: Csg::Piece(0), parts: vec![Part { piece: 0, field, limits: Vec::new() }], pieces: vec![vec![0]] }
    }

    /// A surface of parts.
    pub(crate) fn of_parts(parts: &'f Parts) -> Self {
        let list: Vec<Part<'f>> = parts
            .parts
            .iter()
            .map(|p| Part { piece: p.piece, field: p.field.as_ref(), limits: p.limits.iter().map(AsRef::as_ref).collect() })
            .collect();
        let count = parts.tree.pieces().into_iter().max().map_or(0, |p| p as usize + 1);
        let pieces = (0..count).map(|piece| (0..list.len()).filter(|&k| list[k].piece as usize == piece).collect()).collect();
        Self { tree: parts.tree.clone(), parts: list, pieces }
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

    /// The part of a piece that counts at a place.
    fn counting(&self, piece: u32, p: Point3) -> Option<usize> {
        let parts = &self.pieces[piece as usize];
        if let [one] = parts.as_slice() {
            return Some(*one);
        }
        let least = |k: usize| self.parts[k].limits.iter().map(|l| l.value(p)).fold(f64::INFINITY, f64::min);
        parts.iter().copied().map(|k| (k, least(k))).max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).map(|k| k.0)
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
        let all: Vec<(f64, usize)> = (0..self.pieces.len())
            .map(|piece| self.counting(piece as u32, p).map_or((f64::NAN, 0), |part| (of(self.parts[part].field), part)))
            .collect();
        let (value, piece) = self.tree.value_and_piece(&|piece| all[piece as usize].0);
        (value, all[piece as usize].1)
    }

    /// Whether a place on the zero set of a part is on the surface, and on that part of it.
    pub(crate) fn is_on(&self, part: usize, p: Point3, scale: f64) -> bool {
        if self.is_single() {
            return true;
        }
        let (value, _) = self.first_order(p);
        value.abs() <= ON_SURFACE * scale && self.parts[part].limits.iter().all(|l| l.value(p) >= 0.0)
    }

    /// Where a place on a part is beyond the part's edge; none where it is not, and where it cannot be said.
    pub(crate) fn beyond(&self, part: usize, p: Point3) -> Option<Beyond<'f>> {
        if self.is_single() {
            return None;
        }
        let own = &self.parts[part];
        let mut worst: Option<Beyond<'f>> = None;
        let mut see = |by: f64, edge: &'f dyn Field| {
            if by > worst.map_or(0.0, |w| w.by) {
                worst = Some(Beyond { by, edge });
            }
        };
        for limit in &own.limits {
            let j = limit.jet(p);
            see(-j.v / norm(j.g), *limit);
        }
        let (value, decides) = self.first_order(p);
        if self.parts[decides].piece != own.piece {
            see(value.abs(), self.parts[decides].field);
        }
        worst
    }

    /// The nearest point of the part's edge that Newton's method finds from a place on it, with what vanishes there.
    pub(crate) fn nearest_edge(&self, part: usize, p: Point3, scale: f64) -> Option<(Point3, &'f dyn Field)> {
        let own = &self.parts[part];
        let others = self.parts.iter().filter(|o| o.piece != own.piece).map(|o| (o.field, false));
        let mut best: Option<(f64, Point3, &'f dyn Field)> = None;
        for (edge, is_limit) in others.chain(own.limits.iter().map(|l| (*l, true))) {
            let Some(q) = onto_both(own.field, edge, p, scale) else { continue };
            let d = norm(sub(q, p));
            // At a limit the surface goes on smoothly: it needs to be near there, too.
            let is_there = self.first_order(q).0.abs() <= ON_SURFACE * scale
                && (is_limit || own.limits.iter().all(|l| l.value(q) >= -ON_SURFACE * scale * norm(l.jet(q).g)));
            if is_there && best.is_none_or(|b| d < b.0) {
                best = Some((d, q, edge));
            }
        }
        best.map(|(_, q, edge)| (q, edge))
    }

    /// What decides the sign in a region: the tree without what cannot, and its parts.
    pub(crate) fn within(&self, region: Aabb) -> Option<(Csg, Vec<usize>)> {
        if self.is_single() {
            return Some((self.tree.clone(), vec![0]));
        }
        let possible: Vec<Vec<usize>> = self.pieces.iter().map(|parts| self.possible(parts, region)).collect();
        let ranges: Vec<Interval> = possible.iter().map(|parts| self.hull(parts, region)).collect();
        let tree = narrowed(&self.tree, &|piece| ranges[piece as usize]).ok()?;
        let parts = tree.pieces().into_iter().flat_map(|piece| possible[piece as usize].iter().copied()).collect();
        Some((tree, parts))
    }

    /// The parts of a list that may count somewhere in a region.
    fn possible(&self, parts: &[usize], region: Aabb) -> Vec<usize> {
        parts.iter().copied().filter(|&k| self.parts[k].limits.iter().all(|l| l.bounds(region).hi() >= 0.0)).collect()
    }
    fn hull(&self, parts: &[usize], region: Aabb) -> Interval {
        let all = parts.iter().map(|&k| self.parts[k].field.bounds(region));
        all.reduce(|a, b| a.hull(&b)).unwrap_or(Interval::ALL)
    }
    /// The piece of a part.
    pub(crate) fn piece(&self, part: usize) -> u32 {
        self.parts[part].piece
    }

    /// A range of the function at a place.
    pub(crate) fn range_at(&self, p: Point3) -> Interval {
        let region = Aabb { lo: p, hi: p };
        self.tree.range(&|piece| self.hull(&self.possible(&self.pieces[piece as usize], region), region))
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
        _ => Ok(if is_min { Csg::Min(kept) } else { Csg::Max(kept) }),
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
        let (s, t) = ((bb * a.v - ab * b.v) / determinant, (aa * b.v - ab * a.v) / determinant);
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
    /// Unit vectors along an edge at a point of it, and from there into the side of the part on which `towards` lies.
    pub(crate) fn along(&self, edge: &dyn Field, at: Point3, towards: Point3) -> Option<[Point3; 2]> {
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
        let sign = if dot(inward, sub(towards, at)) < 0.0 { -1.0 } else { 1.0 };
        Some([t.map(|v| sign * v), inward.map(|v| sign * v)])
    }
}
