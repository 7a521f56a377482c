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
use isoform_geom::{Field, Mesh, Parts, Point3, SmoothPart, Solid, dot, middle};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Limits whose values differ by no more than this share of the largest are one, or opposite.
const SAME: f64 = 1e-12;
/// Limits of one part that divide it, at most: further ones are left alone.
const MOST: usize = 64;

/// A smooth piece of a surface.
#[derive(Clone)]
pub(crate) struct Piece {
    /// The part of the mesh that it belongs to.
    pub(crate) part: u32,
    /// What it lies on.
    pub(crate) locus: Locus,
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
    let mut found: Vec<(u32, Option<&SmoothPart>)> = Vec::new();
    for (part, name) in mesh.parts.iter().enumerate() {
        let piece = solid.names().iter().position(|n| n == name).unwrap_or(0) as u32;
        let of_piece = |p: &&SmoothPart| p.piece == piece;
        let own: Vec<&SmoothPart> =
            smooth.map_or(Vec::new(), |s| s.parts.iter().filter(of_piece).collect());
        let is_one = own.iter().all(|p| p.function == own[0].function);
        let labels: BTreeMap<u32, usize> = if is_one {
            BTreeMap::new()
        } else {
            Seams::new(&labelled, part as u32, &own).divide(&mut labelled)
        };
        let base = found.len() as u32;
        if labels.is_empty() {
            found.push((part as u32, own.first().copied()));
        }
        let mut numbers: BTreeMap<usize, u32> = BTreeMap::new();
        for t in 0..labelled.triangles.len() {
            if labelled.components[t] != part as u32 {
                continue;
            }
            let branch = labels.get(&(t as u32)).copied();
            labelled.sheets[t] = branch.map_or(base, |branch| {
                *numbers.entry(own[branch].function).or_insert_with(|| {
                    found.push((part as u32, Some(own[branch])));
                    found.len() as u32 - 1
                })
            });
        }
    }
    labelled.charts = vec![0; labelled.triangles.len()];
    let mut nodes: Vec<Vec<u32>> = vec![Vec::new(); found.len()];
    for (corners, piece) in labelled.triangles.iter().zip(&labelled.sheets) {
        nodes[*piece as usize].extend_from_slice(corners);
    }
    let list = found
        .into_iter()
        .zip(nodes)
        .map(|((part, smooth), mut nodes)| {
            nodes.sort_unstable();
            nodes.dedup();
            let points: Vec<Point3> = nodes.iter().map(|v| labelled.points[*v as usize]).collect();
            let name = &mesh.parts[part as usize];
            let whole = solid.names().iter().position(|n| n == name).unwrap_or(0) as u32;
            let function = |p: Point3| match smooth {
                Some(smooth) => {
                    let jet = smooth.field.jet(p);
                    (jet.v, jet.g)
                }
                None => solid.gradient(whole, p),
            };
            let of = Part {
                function: &function,
                bounds: mesh.bounds(),
                name,
            };
            let locus = match (of.surface(&points, recognize), smooth) {
                (Ok(surface), _) => Locus::Exact(surface),
                (Err(error @ BrepError::Spindle { .. }), _) | (Err(error), None) => {
                    return Err(error);
                }
                (Err(_), Some(smooth)) => Locus::Zero(smooth.field.clone()),
            };
            Ok(Piece {
                part,
                locus,
                limits: smooth.map_or(Vec::new(), |s| s.limits.clone()),
                function: smooth.map(|s| s.function),
            })
        });
    let list = list.collect::<Result<_, BrepError>>()?;
    Ok(Pieces {
        mesh: labelled,
        list,
        names: mesh.parts.clone(),
    })
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
    branches: &'a [&'a SmoothPart],
    questions: Vec<Question>,
    /// By branch, the questions and whether each limit is the question itself, or its negative.
    asked: Vec<Vec<(usize, bool)>>,
}

impl<'a> Seams<'a> {
    fn new(mesh: &Labelled, part: u32, branches: &'a [&'a SmoothPart]) -> Self {
        let mut nodes: Vec<u32> = own(mesh, part)
            .into_iter()
            .flat_map(|t| mesh.triangles[t as usize])
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut made = Self {
            part,
            branches,
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

    /// Divides the part where its questions are answered differently; the branch of each of its
    /// triangles.
    fn divide(&self, mesh: &mut Labelled) -> BTreeMap<u32, usize> {
        for (k, question) in self.questions.iter().enumerate() {
            if !question.divides() {
                continue;
            }
            let locus = Locus::Zero(question.limit.clone());
            let cross = |ends: [Point3; 2]| {
                let half = std::array::from_fn(|i| 0.5 * (ends[0][i] + ends[1][i]));
                let branch = self.branches[self.branch_at(half)];
                crossing(ends, &Locus::Zero(branch.field.clone()), &locus)
            };
            let cut = Cut {
                own: &own(mesh, self.part),
                bit: k as u32,
                locus: &locus,
                crossing: &cross,
                is_vertex: &|_| false,
            };
            let _new = imprint(mesh, &cut);
        }
        let triangles = own(mesh, self.part).into_iter();
        triangles.map(|t| (t, self.branch_of(mesh, t))).collect()
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
