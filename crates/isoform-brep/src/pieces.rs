//! From the labels of a mesh to the smooth pieces of its surface, and what each lies on.
//!
//! A part of a mesh has one smooth function, or several that join smoothly: the flat top of a plate,
//! the blend and the wall of a boss have one label and three functions. The limits of these divide
//! the part ([`SmoothPart::limits`]).

use crate::BrepError;
use crate::cut::{Cut, Labelled, crossing, imprint};
use crate::locus::{Distance, Locus};
use crate::surfaces::{Part, Recognize};
use crate::topology::ends_of;
use isoform_geom::{Aabb, Field, Mesh, Parts, Point3, SmoothPart, Solid, dot, middle};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Limits whose values differ by no more than this share of the largest are one, or opposite.
const SAME: f64 = 1e-12;
/// Fewer nodes away from the borders of a piece say nothing of its surface.
const FEW: usize = 12;
/// Limits of one part that divide it, at most: further ones are left alone.
const MOST: usize = 64;

/// A smooth piece of a surface.
#[derive(Clone)]
pub(crate) struct Piece {
    /// The part of the mesh that it belongs to.
    pub(crate) part: u32,
    /// What it lies on.
    pub(crate) locus: Locus,
    /// Nodes on it, away from its borders if it has such.
    pub(crate) nodes: Vec<Point3>,
    /// What may bound it within its part.
    pub(crate) limits: Vec<Arc<dyn Field>>,
    /// The number of its function, if it has one: equal for pieces of one function.
    pub(crate) function: Option<usize>,
}

/// The surface of a solid as triangles that are labelled by the smooth pieces that they lie on.
pub struct Pieces {
    pub(crate) mesh: Labelled,
    pub(crate) list: Vec<Piece>,
    /// Names of the parts of the mesh.
    pub(crate) names: Vec<String>,
}

/// The smooth pieces of the surface of a solid: its labelled mesh, divided where the functions of a
/// part change, with the surface or function of each. `smooth` are the parts of the solid's pieces,
/// if there are such; what belongs to none of them has to lie on a surface that `recognize` knows.
///
/// # Errors
/// [`BrepError::NoSurface`], [`BrepError::OffSurface`] or [`BrepError::Spindle`] where a part has
/// neither a surface nor a smooth function.
pub fn pieces(
    mesh: &Mesh,
    solid: &dyn Solid,
    smooth: Option<&Parts>,
    recognize: &Recognize<'_>,
) -> Result<Pieces, BrepError> {
    let mut labelled = Labelled {
        points: mesh.points.clone(),
        triangles: mesh.triangles.clone(),
        parts: mesh.triangle_parts.clone(),
        sheets: mesh.triangle_parts.clone(),
        components: mesh.triangle_parts.clone(),
        charts: vec![0; mesh.triangles.len()],
        cuts: Vec::new(),
    };
    let mut found: Vec<Found<'_>> = Vec::new();
    for (part, name) in mesh.parts.iter().enumerate() {
        let piece = solid.names().iter().position(|n| n == name).unwrap_or(0) as u32;
        let of_piece = |p: &&SmoothPart| p.piece == piece;
        let branches: Vec<&SmoothPart> =
            smooth.map_or(Vec::new(), |s| s.parts.iter().filter(of_piece).collect());
        let part = part as u32;
        if branches.iter().all(|p| p.function == branches[0].function) {
            let own = own(&labelled, part);
            label(&mut labelled, &own, found.len());
            found.push(Found {
                part,
                piece,
                branches: branches.into_iter().take(1).collect(),
            });
            continue;
        }
        let of =
            Seams::new(&labelled, part, Whole { solid, piece }, &branches).divide(&mut labelled);
        for (branches, triangles) in of.into_values() {
            label(&mut labelled, &triangles, found.len());
            found.push(Found {
                part,
                piece,
                branches,
            });
        }
    }
    labelled.charts = vec![0; labelled.triangles.len()];
    let mut list = Vec::with_capacity(found.len());
    for (found, nodes) in found.iter().zip(found_nodes(&labelled, &found)) {
        let name = &mesh.parts[found.part as usize];
        list.push(found.piece(nodes, name, mesh.bounds(), solid, recognize)?);
    }
    share_surfaces(&mut list);
    Ok(Pieces {
        mesh: labelled,
        list,
        names: mesh.parts.clone(),
    })
}

/// Labels triangles by their piece.
fn label(mesh: &mut Labelled, triangles: &[u32], piece: usize) {
    for t in triangles {
        mesh.sheets[*t as usize] = piece as u32;
    }
}

/// A piece, before it is known what it lies on.
struct Found<'a> {
    part: u32,
    /// The piece of the solid.
    piece: u32,
    /// The smooth parts of its function, if there are such.
    branches: Vec<&'a SmoothPart>,
}

impl Found<'_> {
    /// Whether a point is where the function is that of the piece.
    fn holds(&self, p: Point3) -> bool {
        let all = |b: &&SmoothPart| b.limits.iter().all(|l| l.value(p) >= 0.0);
        self.branches.iter().any(all)
    }

    /// The piece with its surface or function.
    fn piece(
        &self,
        nodes: Vec<Point3>,
        name: &str,
        bounds: Aabb,
        solid: &dyn Solid,
        recognize: &Recognize<'_>,
    ) -> Result<Piece, BrepError> {
        let smooth = self.branches.first();
        let function = |p: Point3| match smooth {
            Some(smooth) => {
                let jet = smooth.field.jet(p);
                (jet.v, jet.g)
            }
            None => solid.gradient(self.piece, p),
        };
        let of = Part {
            function: &function,
            bounds,
            name,
        };
        let locus = match (of.surface(&nodes, recognize), smooth) {
            (Ok(surface), _) => Locus::Exact(surface),
            (Err(error @ BrepError::Spindle { .. }), _) | (Err(error), None) => {
                return Err(error);
            }
            (Err(_), Some(smooth)) => Locus::Zero(smooth.field.clone()),
        };
        let limits = self.branches.iter().flat_map(|b| b.limits.iter().cloned());
        Ok(Piece {
            part: self.part,
            locus,
            nodes,
            limits: limits.collect(),
            function: smooth.map(|s| s.function),
        })
    }
}

/// The nodes that each piece is recognised from: those where its own function is the one that counts,
/// or, of a part with one function, those that it shares with no other piece: where pieces join
/// smoothly nodes lie near the seam, not on it. All nodes where only a few are left.
fn found_nodes(mesh: &Labelled, found: &[Found<'_>]) -> Vec<Vec<Point3>> {
    let mut of: Vec<Vec<u32>> = vec![Vec::new(); mesh.points.len()];
    for (corners, piece) in mesh.triangles.iter().zip(&mesh.sheets) {
        for v in corners {
            if !of[*v as usize].contains(piece) {
                of[*v as usize].push(*piece);
            }
        }
    }
    let (mut inner, mut all) = (vec![Vec::new(); found.len()], vec![Vec::new(); found.len()]);
    for (v, labels) in of.iter().enumerate() {
        let p = mesh.points[v];
        for piece in labels.iter().map(|k| *k as usize) {
            all[piece].push(p);
            let of = &found[piece];
            let has_limits = of.branches.iter().any(|b| !b.limits.is_empty());
            if if has_limits {
                of.holds(p)
            } else {
                labels.len() == 1
            } {
                inner[piece].push(p);
            }
        }
    }
    let each = inner.into_iter().zip(all);
    each.map(|(inner, all)| if inner.len() < FEW { all } else { inner })
        .collect()
}

/// Pieces of one function lie on one surface: a sliver takes it from a larger piece.
fn share_surfaces(list: &mut [Piece]) {
    let known: BTreeMap<usize, Locus> = list
        .iter()
        .filter(|p| p.locus.surface().is_some())
        .filter_map(|p| Some((p.function?, p.locus.clone())))
        .collect();
    for piece in list.iter_mut().filter(|p| p.locus.surface().is_none()) {
        if let Some(locus) = piece.function.and_then(|f| known.get(&f)) {
            piece.locus = locus.clone();
        }
    }
}

/// A question that divides a part: a limit, whose negative may be another one.
struct Question {
    limit: Arc<dyn Field>,
    /// Values at nodes of the part.
    values: Vec<f64>,
}

impl Question {
    /// Whether it is answered differently at nodes of the part.
    fn divides(&self) -> bool {
        let has = |positive: bool| self.values.iter().any(|v| (*v > 0.0) == positive);
        has(true) && has(false)
    }
}

/// Where the functions of a part change.
struct Seams<'a> {
    part: u32,
    whole: Whole<'a>,
    branches: Vec<&'a SmoothPart>,
    questions: Vec<Question>,
    /// By branch, the questions and whether each limit is the question itself, or its negative.
    asked: Vec<Vec<(usize, bool)>>,
}

/// A piece of a solid with all of its functions.
struct Whole<'a> {
    solid: &'a dyn Solid,
    piece: u32,
}

impl Distance for Whole<'_> {
    fn distance(&self, p: Point3) -> (f64, Point3) {
        let (value, g) = self.solid.gradient(self.piece, p);
        let length = dot(g, g).sqrt();
        (-value / length, g.map(|v| -v / length))
    }
}

impl<'a> Seams<'a> {
    fn new(mesh: &Labelled, part: u32, whole: Whole<'a>, branches: &[&'a SmoothPart]) -> Self {
        let mut nodes: Vec<u32> = own(mesh, part)
            .into_iter()
            .flat_map(|t| mesh.triangles[t as usize])
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut made = Self {
            part,
            whole,
            branches: branches.to_vec(),
            questions: Vec::new(),
            asked: Vec::new(),
        };
        for branch in branches {
            let mut asked = Vec::new();
            for limit in &branch.limits {
                let value = |v: &u32| limit.value(mesh.points[*v as usize]);
                asked.extend(made.ask(limit, nodes.iter().map(value).collect()));
            }
            made.asked.push(asked);
        }
        made
    }

    /// The number of the question that a limit answers, and whether it is the question itself.
    fn ask(&mut self, limit: &Arc<dyn Field>, values: Vec<f64>) -> Option<(usize, bool)> {
        let scale = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let near = |sign: f64| {
            let is_near = |known: &Question| {
                let mut each = known.values.iter().zip(&values);
                each.all(|(a, b)| (a - sign * b).abs() <= SAME * scale)
            };
            self.questions.iter().position(is_near)
        };
        if let Some(k) = near(1.0) {
            return Some((k, true));
        }
        if let Some(k) = near(-1.0) {
            return Some((k, false));
        }
        if self.questions.len() >= MOST {
            return None;
        }
        let limit = limit.clone();
        self.questions.push(Question { limit, values });
        Some((self.questions.len() - 1, true))
    }

    /// The branch that holds at a point, as nearly as that can be said.
    fn branch_at(&self, p: Point3) -> usize {
        let least = |b: &usize| {
            let limits = self.branches[*b].limits.iter();
            limits.map(|l| l.value(p)).fold(f64::INFINITY, f64::min)
        };
        let all = 0..self.branches.len();
        all.max_by(|a, b| least(a).total_cmp(&least(b)).then(b.cmp(a)))
            .unwrap_or(0)
    }

    /// Divides the part where its questions are answered differently; by function, its branches and
    /// its triangles.
    fn divide(&self, mesh: &mut Labelled) -> BTreeMap<usize, (Vec<&'a SmoothPart>, Vec<u32>)> {
        for (k, question) in self.questions.iter().enumerate() {
            if !question.divides() {
                continue;
            }
            let locus = Locus::Zero(question.limit.clone());
            let cut = Cut {
                own: &own(mesh, self.part),
                bit: k as u32,
                locus: &locus,
                crossing: &|ends| crossing(ends, &self.whole, &locus),
                is_vertex: &|_| false,
            };
            let _new = imprint(mesh, &cut);
        }
        let mut made: BTreeMap<usize, (Vec<&SmoothPart>, Vec<u32>)> = BTreeMap::new();
        for t in own(mesh, self.part) {
            let function = self.branches[self.branch_of(mesh, t)].function;
            made.entry(function).or_default().1.push(t);
        }
        for &branch in &self.branches {
            if let Some(of) = made.get_mut(&branch.function) {
                of.0.push(branch);
            }
        }
        made
    }

    /// The branch of a triangle, by the sides of the seams that it lies on.
    fn branch_of(&self, mesh: &Labelled, t: u32) -> usize {
        let p = middle(mesh.triangles[t as usize].map(|v| mesh.points[v as usize]));
        let positive = |k: usize| {
            if self.questions[k].divides() {
                // Distances are positive where the limit is negative.
                mesh.charts[t as usize] >> k & 1 == 0
            } else {
                self.questions[k].values.iter().any(|v| *v > 0.0)
            }
        };
        let holds = |b: &usize| {
            self.asked[*b]
                .iter()
                .all(|&(k, is_own)| positive(k) == is_own)
        };
        (0..self.branches.len())
            .find(holds)
            .unwrap_or_else(|| self.branch_at(p))
    }
}

/// The triangles of a part.
fn own(mesh: &Labelled, part: u32) -> Vec<u32> {
    let all = 0..mesh.triangles.len() as u32;
    all.filter(|t| mesh.components[*t as usize] == part)
        .collect()
}

/// The limit along which two pieces join, near some points in order; none if there is none within
/// their distances.
pub(crate) fn seam(pieces: [&Piece; 2], points: &[Point3]) -> Option<Locus> {
    let reach = points
        .windows(2)
        .map(|w| isoform_geom::norm(isoform_geom::sub(w[0], w[1])))
        .fold(0.0, f64::max);
    let limits = pieces.into_iter().flat_map(|p| &p.limits);
    let off = |locus: &Locus| {
        let each = points.iter().map(|p| {
            let (d, n) = locus.distance(*p);
            if dot(n, n) > 0.5 {
                d.abs()
            } else {
                f64::INFINITY
            }
        });
        each.fold(0.0, f64::max)
    };
    let all = limits.map(|l| {
        let locus = Locus::Zero(l.clone());
        (off(&locus), locus)
    });
    let best = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 <= reach).then_some(best.1)
}

/// The largest angle between neighbours' normals along points (radians): how far two loci are from
/// touching.
pub(crate) fn largest_angle(loci: [&Locus; 2], points: &[Point3]) -> f64 {
    let sine = |p: &Point3| {
        let [a, b] = loci.map(|l| l.distance(crate::newton::meet([l], *p)).1);
        isoform_geom::norm(isoform_geom::cross(a, b))
    };
    points.iter().map(sine).fold(0.0, f64::max).min(1.0).asin()
}

/// The sides of some triangles.
pub(crate) fn sides_of(mesh: &Labelled, own: &[u32]) -> Vec<[u32; 2]> {
    let corners = own.iter().map(|t| &mesh.triangles[*t as usize]);
    corners
        .flat_map(|c| (0..3).map(move |k| ends_of(c, k)))
        .collect()
}
