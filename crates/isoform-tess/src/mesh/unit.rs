//! A unit triangle's part of the surface: refined, and joined with those of the others.

use super::glued::Glued;
use super::gluing::Gluing;
use super::in_chart::InChart;
use super::names::{Name, Ray, key};
use super::plane::{Ended, Measure, Plane};
use super::strips::{PathVertex, around, between};
use super::*;
use crate::fan::Direction;
use crate::region::FOLD;
use crate::surface::Kind;
use rayon::iter::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};
use std::collections::BTreeMap;

/// The part of the region in a unit triangle.
pub(super) struct Unit {
    pub(super) quadrant: usize,
    pub(super) plane: Plane,
    /// Triangles with a base point as the first corner, in whose place strips are put.
    pub(super) at_apex: Vec<[u32; 3]>,
    /// The fans of base points, by vertex.
    pub(super) apexes: BTreeMap<usize, usize>,
    /// Corners of the rectangles around base points, by vertex and fan.
    pub(super) rays: BTreeMap<(usize, usize), Ray>,
    pub(super) findings: Vec<Finding>,
}

/// A triangle: its vertices, their parameters, the sides of the domain that they are on.
type Made = ([u32; 3], [[f64; 2]; 3], [u64; 3]);

/// What lies between two rays of a base point, from the rectangle to the seam.
struct Strip {
    fan: usize,
    apex: [f64; 2],
    rays: [Ray; 2],
    /// On the rectangle, and the vertices that other triangles have put on the edge between them.
    ends: [PathVertex; 2],
    way: Vec<PathVertex>,
}

/// The surface as far as it is made, and its vertices by name; those that no other unit triangle
/// has by the quadrant and their place in it, too.
struct Joined<'a> {
    surface: Surface,
    gluing: &'a Gluing,
    vertices: BTreeMap<(Name, usize, usize), u32>,
}

impl<'a> Joined<'a> {
    fn new(surface: Surface, gluing: &'a Gluing) -> Self {
        Self {
            surface,
            gluing,
            vertices: BTreeMap::new(),
        }
    }
    fn vertex(
        &mut self,
        key: (Name, usize, usize),
        make: impl FnOnce() -> (Point3, u8, Kind),
    ) -> u32 {
        let surface = &mut self.surface;
        *self.vertices.entry(key).or_insert_with(|| {
            let (point, faces, kind) = make();
            surface.points.push(point);
            surface.faces.push(faces);
            let is_double = matches!(key.0, Name::Double(k) if self.gluing.is_double(k));
            surface.double.push(is_double);
            surface.kinds.push(kind);
            surface.points.len() as u32 - 1
        })
    }
    /// The vertex of a name that all unit triangles share.
    fn shared(&mut self, name: Name, point: Point3, faces: u8, kind: Kind) -> u32 {
        self.vertex((name, 0, 0), || (point, faces, kind))
    }
}

/// What is not proved of triangles, by how their refinement ended.
fn complaints(ended: Ended) -> impl Iterator<Item = Finding> {
    let all = [
        (ended.unsound, Finding::SignUnproved),
        (ended.clashes, Finding::EdgesClash),
        (ended.coarse, Finding::TooCoarse),
    ];
    all.into_iter().filter(|c| c.0 > 0).map(|c| c.1)
}

/// The unit triangles, refined.
pub(super) struct Refined {
    units: Vec<Unit>,
}

impl Refined {
    /// Refines unit triangles and puts further vertices into them.
    pub(super) fn new(glued: &Glued<'_>, mut units: Vec<Unit>, further: &[Place]) -> Self {
        glued.refine(&mut units);
        glued.put(further, &mut units);
        Self { units }
    }
    /// The surface that the unit triangles make up together.
    pub(super) fn joined(self, glued: &Glued<'_>) -> Surface {
        let surface = Surface {
            findings: glued.openings.findings.clone(),
            ..Surface::default()
        };
        let mut joined = Joined::new(surface, &glued.gluing);
        for unit in self.units {
            glued.add(unit, &mut joined);
        }
        joined.surface
    }
}

impl Glued<'_> {
    /// Refines unit triangles side by side, to a limit for all of them.
    fn refine(&self, units: &mut [Unit]) {
        let most = if self.openings.halvings < HALVINGS {
            self.atlas.options.triangles.min(OPEN_TRIANGLES)
        } else {
            self.atlas.options.triangles
        };
        units.par_iter_mut().for_each(|u| {
            u.plane.begin(
                most / 4,
                &InChart {
                    glued: self,
                    q: u.quadrant,
                },
                self.atlas.control,
            )
        });
        // Those that need more share what the others leave.
        let (needy, done): (Vec<_>, Vec<_>) =
            (0..units.len()).partition(|&k| units[k].plane.is_waiting());
        for group in [done, needy] {
            let made: usize = units.iter().map(|u| u.plane.triangles.len()).sum();
            let room = most.saturating_sub(made) / group.len().max(1);
            units
                .par_iter_mut()
                .enumerate()
                .filter(|(k, _)| group.contains(k))
                .for_each(|(_, u)| {
                    let most = u.plane.triangles.len() + room;
                    let ended = u.plane.refine(
                        most,
                        &InChart {
                            glued: self,
                            q: u.quadrant,
                        },
                        self.atlas.control,
                    );
                    u.findings.extend(complaints(ended));
                });
        }
    }

    /// Puts further vertices into unit triangles.
    fn put(&self, places: &[Place], units: &mut [Unit]) {
        let most = self.atlas.options.triangles;
        units.par_iter_mut().for_each(|u| {
            let q = u.quadrant;
            let measure = InChart { glued: self, q };
            let here: Vec<Place> = places.iter().filter(|p| p.quadrant == q).copied().collect();
            if !here.is_empty() {
                let ended = u.plane.insert(&here, most, &measure, self.atlas.control);
                u.findings.extend(complaints(ended));
            }
        });
    }

    /// Adds the vertices and triangles of a unit triangle to the surface.
    fn add(&self, unit: Unit, joined: &mut Joined) {
        let (q, plane) = (unit.quadrant, &unit.plane);
        let measure = InChart { glued: self, q };
        joined
            .surface
            .findings
            .extend(unit.findings.iter().cloned());
        let vertex = |k: u32, joined: &mut Joined| {
            let node = &plane.nodes[k as usize];
            let key = match self.merged(q, node) {
                Name::Inner => (Name::Inner, q, k as usize),
                name => (name, 0, 0),
            };
            joined.vertex(key, || {
                let kind = match key.0 {
                    Name::Image(_) => Kind::Contracted,
                    _ if node.faces > 0 => Kind::Box,
                    Name::Double(k) if self.gluing.is_double(k) => Kind::Double,
                    _ if node.borders > 0 => Kind::Border,
                    _ => Kind::Ordinary,
                };
                (measure.image(node), node.faces, kind)
            })
        };
        let mut made: Vec<Made> = Vec::new();
        for t in &plane.triangles {
            let nodes = t.map(|v| &plane.nodes[v as usize]);
            made.push((
                t.map(|v| vertex(v, joined)),
                nodes.map(|n| n.at),
                nodes.map(|n| n.borders),
            ));
        }
        let mut opened = Vec::new();
        for &[p, a, b] in &unit.at_apex {
            let Some(&fan) = unit.apexes.get(&(p as usize)) else {
                continue;
            };
            let ray = |v: u32| unit.rays.get(&(v as usize, fan)).copied();
            let way: Vec<PathVertex> = plane
                .way([a, b])
                .into_iter()
                .map(|v| (vertex(v, joined), plane.nodes[v as usize].at))
                .collect();
            let ends = [a, b].map(|v| (vertex(v, joined), plane.nodes[v as usize].at));
            let apex = plane.nodes[p as usize].at;
            opened.push(ray(a).zip(ray(b)).map(|(a, b)| Strip {
                fan,
                apex,
                rays: [a, b],
                ends,
                way,
            }));
        }
        for strip in opened {
            match strip {
                Some(strip) => made.extend(self.fill(q, &strip, joined)),
                None => joined.surface.findings.push(Finding::StripsLeftOut),
            }
        }
        for (triangle, corners, borders) in made {
            joined.surface.borders.push(borders);
            joined.surface.triangles.push(triangle);
            joined.surface.charts.push(q as u8);
            joined.surface.corners.push(corners);
        }
    }

    /// The triangles of a strip.
    fn fill(
        &self,
        q: usize,
        &Strip {
            fan,
            apex,
            rays,
            ends,
            ref way,
        }: &Strip,
        joined: &mut Joined,
    ) -> Vec<Made> {
        let f = &self.openings.fans[fan];
        // From the rectangle to the seam, with what lies between on a double curve.
        let seam_end = |joined: &mut Joined, d: &Direction, at: [f64; 2]| {
            let (name, point, faces) = self.openings.seam_vertex(fan, d);
            let name = self.gluing.name(&key(name, 0, at)).unwrap_or(name);
            let kind = match (name, faces) {
                (Name::Image(_), _) => Kind::Contracted,
                (_, 1..) => Kind::Box,
                (Name::Double(k), _) if self.gluing.is_double(k) => Kind::Double,
                _ => Kind::Seam,
            };
            let point = match name {
                Name::Image(k) => self.curves.images[k],
                Name::Double(k) => self.gluing.image(k),
                _ => point,
            };
            (joined.shared(name, point, faces, kind), apex)
        };
        let [mut first, second] = [0, 1].map(|i| {
            let (ray, (vertex, at)) = (rays[i], ends[i]);
            let mut path = vec![ends[i]];
            for &(class, at) in self.gluing.spoke(fan, ray, at) {
                let kind = match self.gluing.is_double(class) {
                    true => Kind::Double,
                    false => Kind::Ordinary,
                };
                let image = self.gluing.image(class);
                path.push((joined.shared(Name::Double(class), image, 0, kind), at));
            }
            let d = f
                .directions
                .iter()
                .find(|d| d.key() == ray.0)
                .expect("a direction of the fan");
            let site = self
                .openings
                .sites_in(q)
                .map(|s| s.1)
                .find(|s| s.fan == fan);
            let faces = joined.surface.faces[vertex as usize];
            if path.len() == 1 && joined.surface.kinds[vertex as usize] != Kind::Contracted {
                let on_ray = site.map_or_else(Vec::new, |s| {
                    self.openings.ray(q, s, d, ray.1).points_to_seam(at)
                });
                let kind = if faces > 0 { Kind::Box } else { Kind::Ordinary };
                for (k, x) in on_ray.into_iter().enumerate() {
                    path.push((joined.shared(Name::Ray(fan, ray, k), x, faces, kind), apex));
                }
            }
            path.push(seam_end(joined, d, at));
            path
        });
        let seams: Vec<u32> = [&first, &second]
            .iter()
            .filter_map(|path| path.last())
            .map(|v| v.0)
            .collect();
        // From one seam to another one.
        if let Some(corner) = f
            .sector_between(rays[0], rays[1])
            .and_then(|s| s.corner.as_ref())
        {
            first.push(seam_end(joined, corner, apex));
        }
        // What lies between two rays need not lie in the straight triangle: then the strip has no
        // parameters but those of the base point.
        let is_straight = !f.is_tree()
            || self.atlas.charts[q].keeps_sign([apex, ends[0].1, ends[1].1], f.multiplicity);
        let folds = |ray: Ray| {
            f.directions
                .iter()
                .any(|d| d.key() == ray.0 && f.is_fold(d))
        };
        let first_is_double = joined.surface.double[first[0].0 as usize] || folds(rays[0]);
        // The surface ends in seams and rays along which it is folded.
        let mut folded: Vec<u32> = Vec::new();
        for (k, path) in [&first, &second].into_iter().enumerate() {
            let ray = rays[k];
            if self.openings.is_fold_ray(fan, ray) {
                folded.extend(path.iter().map(|v| v.0));
            }
            if self.openings.folded.contains(&(fan, ray.0.0)) {
                // From its end of the seam to the other one, or to the next seam.
                folded.extend(seams.get(k));
                folded.extend(first.last().map(|v| v.0));
            }
        }
        let border = |v: PathVertex| match folded.contains(&v.0) {
            true => FOLD,
            false => 0,
        };
        let mut made: Vec<Made> = Vec::new();
        let mut push = |t: [PathVertex; 3]| {
            made.push((
                t.map(|t| t.0),
                t.map(|t| if is_straight { t.1 } else { apex }),
                t.map(border),
            ))
        };
        let (mut i, mut j) = (0, 0);
        if !way.is_empty() {
            // Those on the way that bounds the triangles outside have no other edges to vertices
            // that are shared.
            for t in around(
                &joined.surface.points,
                first[1],
                &[&first[..1], way.as_slice(), &second[..1]].concat(),
                second[1],
            ) {
                push(t);
            }
            (i, j) = (1, 1);
        }
        if f.is_tree() {
            between(&joined.surface.points, &first[i..], &second[j..])
                .into_iter()
                .for_each(push);
            return made;
        }
        while i + 1 < first.len() || j + 1 < second.len() {
            // Edges from the seam's end of a double curve to the rectangle: the other diagonals
            // would be there twice where the curve is folded.
            let on_second = i + 1 == first.len() || (j + 1 < second.len() && !first_is_double);
            push([
                first[i],
                second[j],
                if on_second {
                    second[j + 1]
                } else {
                    first[i + 1]
                },
            ]);
            if on_second { j += 1 } else { i += 1 }
        }
        made
    }
}
