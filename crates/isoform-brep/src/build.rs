//! From a labelled mesh and the surfaces of its parts to faces, edges and vertices.

use crate::curves::{Wanted, curve};
use crate::cut::{Labelled, cuts_of, imprint, outlines};
use crate::measure::of_loops;
use crate::newton::{gap, meet};
use crate::place::place;
use crate::shells::solids;
use crate::topology::{Chain, Side, Topology, across_sides, components, ends_of};
use crate::{BrepError, Control};
use isoform_geom::brep::{Brep, Coedge, Edge, Face, Surface};
use isoform_geom::{Mesh, Point3, cross, dot, norm, sub};
use std::collections::{BTreeMap, BTreeSet};

/// Surfaces whose points are this near to one another, in sizes of the model, are one.
const SAME: f64 = 1e-10;
/// A node of the mesh this near to the apex of a cone, in sizes, is the apex.
const APEX: f64 = 1e-6;
/// A mesh cuts off no more than this of the tip of a cone, in lengths of its edges there.
const TIP: f64 = 3.0;
/// A vertex is this near to all of its surfaces, in sizes.
const ON: f64 = 1e-9;

/// A boundary representation, and the triangles that stand for its faces.
#[derive(Clone, Debug)]
pub struct Built {
    /// The solids.
    pub brep: Brep,
    /// Nodes of the triangles, on the faces' surfaces but for edges that were divided.
    pub points: Vec<Point3>,
    /// Triangles of the mesh, divided along cuts.
    pub triangles: Vec<[u32; 3]>,
    /// The face of each.
    pub face_of: Vec<u32>,
    /// The two surfaces that meet in each edge; one is a cut where an edge divides a face.
    pub meeting: Vec<[Surface; 2]>,
    /// By part of the representation, the part of the mesh whose function stands for it.
    pub functions: Vec<String>,
    /// The largest side of the box of the model.
    pub size: f64,
}

/// The boundary representation of the solid that a labelled surface mesh stands for; `surfaces` are
/// those of its parts.
///
/// Parts of one surface that run on into one another are one face, named after all of them.
///
/// # Errors
/// If the mesh is not closed, faces touch without an angle, or the work is stopped.
pub fn brep(mesh: &Mesh, surfaces: &[Surface], control: &Control<'_>) -> Result<Built, BrepError> {
    control.begin("faces")?;
    let [x, y, z] = mesh.bounds().size();
    let size = x.max(y).max(z);
    let across = across_sides(&mesh.triangles)?;
    let sheets = sheets(mesh, surfaces, &across, SAME * size);
    let labelled = labelled(mesh, &sheets, &across);
    let mut builder = Builder {
        surfaces: &sheets.surfaces,
        names: &sheets.names,
        functions: &sheets.functions,
        mesh: labelled,
        across,
        apexes: BTreeSet::new(),
        size,
    };
    builder.find_apexes();
    control.begin("cuts")?;
    builder.cut()?;
    control.begin("edges")?;
    builder.build(control)
}

/// Surfaces with the names of the parts that lie on them.
struct Sheets {
    /// The sheet of each part.
    of_part: Vec<u32>,
    surfaces: Vec<Surface>,
    names: Vec<String>,
    /// The name of the first part of each.
    functions: Vec<String>,
}

/// Parts that are neighbours on one surface are one sheet.
fn sheets(mesh: &Mesh, surfaces: &[Surface], across: &[[Side; 3]], same: f64) -> Sheets {
    let parts = surfaces.len();
    let mut points: Vec<Vec<Point3>> = vec![Vec::new(); parts];
    let mut meet = BTreeSet::new();
    for (t, corners) in mesh.triangles.iter().enumerate() {
        let part = mesh.triangle_parts[t];
        points[part as usize].extend(corners.map(|v| mesh.points[v as usize]));
        let others = across[t].iter().map(|s| mesh.triangle_parts[s.0 as usize]);
        meet.extend(others.filter(|o| part < *o).map(|o| (part, o)));
    }
    let holds = |surface: &Surface, points: &[Point3]| {
        points.iter().all(|p| surface.distance(*p).0.abs() <= same)
    };
    let mut up: Vec<usize> = (0..parts).collect();
    for (a, b) in meet {
        let (a, b) = (a as usize, b as usize);
        let is_one = surfaces[a].name() == surfaces[b].name()
            && holds(&surfaces[a], &points[b])
            && holds(&surfaces[b], &points[a]);
        if is_one {
            let (from, to) = (up[a].max(up[b]), up[a].min(up[b]));
            up.iter_mut().filter(|u| **u == from).for_each(|u| *u = to);
        }
    }
    let mut made = Sheets {
        of_part: vec![0; parts],
        surfaces: Vec::new(),
        names: Vec::new(),
        functions: Vec::new(),
    };
    for k in 0..parts {
        if up[k] == k {
            made.of_part[k] = made.surfaces.len() as u32;
            made.surfaces.push(surfaces[k]);
            made.names.push(mesh.parts[k].clone());
            made.functions.push(mesh.parts[k].clone());
        } else {
            let sheet = made.of_part[up[k]];
            made.of_part[k] = sheet;
            let name = &mut made.names[sheet as usize];
            name.push('+');
            name.push_str(&mesh.parts[k]);
        }
    }
    made
}

fn labelled(mesh: &Mesh, sheets: &Sheets, across: &[[Side; 3]]) -> Labelled {
    let parts = mesh.triangle_parts.iter();
    let of: Vec<u32> = parts.map(|p| sheets.of_part[*p as usize]).collect();
    let (components, count) = components(across, |a, b| of[a as usize] == of[b as usize]);
    Labelled {
        points: mesh.points.clone(),
        triangles: mesh.triangles.clone(),
        charts: vec![0; of.len()],
        sheets: of,
        components,
        cuts: vec![Vec::new(); count],
    }
}

struct Builder<'a> {
    surfaces: &'a [Surface],
    names: &'a [String],
    functions: &'a [String],
    mesh: Labelled,
    across: Vec<[Side; 3]>,
    /// Nodes at apexes of cones.
    apexes: BTreeSet<u32>,
    size: f64,
}

impl Builder<'_> {
    /// Nodes at the apex of the cone that they lie on are moved there, and so is the node of a face
    /// that is nearest to an apex no more than some edges away, if all that meets in it does so at the
    /// apex: a mesh may cut off the tip.
    fn find_apexes(&mut self) {
        for (apex, far, v, edge) in self.nearest_to_apexes().into_values() {
            let corners = self.mesh.triangles.iter().zip(&self.mesh.sheets);
            let mut around = corners.filter(|(c, _)| c.contains(&v)).map(|c| *c.1);
            let near = APEX * self.size;
            let meets = |s: u32| self.surfaces[s as usize].distance(apex).0.abs() <= near;
            if far <= near || (far <= TIP * edge && around.all(meets)) {
                self.mesh.points[v as usize] = apex;
                self.apexes.insert(v);
            }
        }
    }

    /// By component on a cone: the apex, the distance of the nearest node, this node, and the longest
    /// edge there.
    fn nearest_to_apexes(&self) -> BTreeMap<u32, (Point3, f64, u32, f64)> {
        let mut nearest = BTreeMap::new();
        for (t, corners) in self.mesh.triangles.iter().enumerate() {
            let surface = &self.surfaces[self.mesh.sheets[t] as usize];
            let Some(apex) = surface.apex() else { continue };
            for k in 0..3u8 {
                let [p, q] = ends_of(corners, k).map(|v| self.mesh.points[v as usize]);
                let (far, edge) = (norm(sub(p, apex)), norm(sub(p, q)));
                let v = corners[k as usize];
                let first = (apex, far, v, edge);
                let best = nearest.entry(self.mesh.components[t]).or_insert(first);
                if far < best.1 {
                    *best = first;
                } else if v == best.2 {
                    best.3 = best.3.max(edge);
                }
            }
        }
        nearest
    }

    fn topology(&self) -> Topology {
        let mesh = &self.mesh;
        let is_border = |a: u32, b: u32| {
            let (a, b) = (a as usize, b as usize);
            mesh.components[a] != mesh.components[b] || mesh.charts[a] != mesh.charts[b]
        };
        Topology::new(
            &mesh.points,
            &mesh.triangles,
            &self.across,
            is_border,
            &self.apexes,
        )
    }

    /// Cuts the components that go round, one after the other: each is put away from the vertices
    /// that those before it made.
    fn cut(&mut self) -> Result<(), BrepError> {
        let mut topology = self.topology();
        for component in 0..self.mesh.cuts.len() as u32 {
            let of = &self.mesh.components;
            let Some(first) = of.iter().position(|c| *c == component) else {
                continue;
            };
            let surface = self.surfaces[self.mesh.sheets[first] as usize];
            if matches!(surface, Surface::Plane(_)) {
                continue;
            }
            let vertices = self.vertices(&topology);
            let is_vertex = |v: u32| vertices.contains(&v);
            let face = topology.face_of[first] as usize;
            let own = &topology.loops[face..=face];
            let mut outline = outlines(&topology.chains, own, &is_vertex).remove(0);
            let triangles = (0..of.len() as u32).filter(|t| of[*t as usize] == component);
            outline.triangles = triangles.collect();
            let cuts = cuts_of(&self.mesh, &surface, &outline);
            for &cut in &cuts {
                imprint(&mut self.mesh, component, &surface, cut, &is_vertex);
            }
            if !cuts.is_empty() {
                self.across = across_sides(&self.mesh.triangles)?;
                topology = self.topology();
            }
        }
        Ok(())
    }

    /// Junctions, without those that were only put on chains that have none.
    fn vertices(&self, topology: &Topology) -> BTreeSet<u32> {
        let mut ends: BTreeMap<u32, usize> = BTreeMap::new();
        for chain in &topology.chains {
            for v in [chain.nodes[0], chain.nodes[chain.nodes.len() - 1]] {
                *ends.entry(v).or_default() += 1;
            }
        }
        let met = ends.into_iter().filter(|(_, n)| *n != 2).map(|e| e.0);
        met.chain(self.apexes.iter().copied()).collect()
    }

    fn build(&self, control: &Control<'_>) -> Result<Built, BrepError> {
        let topology = self.topology();
        let meeting: Vec<[Surface; 2]> = topology
            .chains
            .iter()
            .map(|chain| self.meeting(chain))
            .collect::<Result<_, _>>()?;
        let (number, vertices) = self.place_vertices(&topology, &meeting)?;
        let mut brep = Brep {
            vertices,
            parts: self.names.to_vec(),
            ..Brep::default()
        };
        for (chain, surfaces) in topology.chains.iter().zip(&meeting) {
            control.check()?;
            let edge = self.edge(chain, surfaces, &number, &brep.vertices)?;
            brep.edges.push(edge);
        }
        self.add_faces(&topology, &mut brep);
        let mesh = &self.mesh;
        brep.solids = solids(
            &mesh.points,
            &mesh.triangles,
            &self.across,
            &topology.face_of,
        )?;
        Ok(Built {
            brep,
            points: mesh.points.clone(),
            triangles: mesh.triangles.clone(),
            face_of: topology.face_of,
            meeting,
            functions: self.functions.to_vec(),
            size: self.size,
        })
    }

    /// The surfaces that meet in a chain: of two sheets, or of one and a cut.
    fn meeting(&self, chain: &Chain) -> Result<[Surface; 2], BrepError> {
        let (t, k) = chain.sides[0];
        let other = self.across[t as usize][k as usize].0;
        let [a, b] = [t, other].map(|t| self.mesh.sheets[t as usize] as usize);
        if a != b {
            return Ok([self.surfaces[a], self.surfaces[b]]);
        }
        let cut = self.mesh.cut_between(t, other);
        cut.map(|cut| [self.surfaces[a], *cut])
            .ok_or_else(|| self.no_curve([a, b], chain))
    }

    fn no_curve(&self, sheets: [usize; 2], chain: &Chain) -> BrepError {
        BrepError::NoCurve {
            parts: sheets.map(|s| self.names[s].clone()),
            at: self.mesh.points[chain.nodes[chain.nodes.len() / 2] as usize],
        }
    }

    /// Vertices on all surfaces that meet there; and their numbers by node.
    fn place_vertices(
        &self,
        topology: &Topology,
        meeting: &[[Surface; 2]],
    ) -> Result<(BTreeMap<u32, u32>, Vec<Point3>), BrepError> {
        let mut around: BTreeMap<u32, Vec<Surface>> = BTreeMap::new();
        for (chain, surfaces) in topology.chains.iter().zip(meeting) {
            for v in [chain.nodes[0], chain.nodes[chain.nodes.len() - 1]] {
                let all = around.entry(v).or_default();
                for surface in surfaces {
                    if !all.contains(surface) {
                        all.push(*surface);
                    }
                }
            }
        }
        let (mut number, mut vertices) = (BTreeMap::new(), Vec::new());
        for (v, surfaces) in around {
            let at = self.mesh.points[v as usize];
            let p = if self.apexes.contains(&v) {
                at
            } else {
                meet(&surfaces, at)
            };
            let reach = 0.05 * self.size;
            if gap(&surfaces, p) > ON * self.size || norm(sub(p, at)) > reach {
                return Err(BrepError::NoVertex { at });
            }
            number.insert(v, vertices.len() as u32);
            vertices.push(p);
        }
        Ok((number, vertices))
    }

    fn edge(
        &self,
        chain: &Chain,
        surfaces: &[Surface; 2],
        number: &BTreeMap<u32, u32>,
        vertices: &[Point3],
    ) -> Result<Edge, BrepError> {
        let last = chain.nodes.len() - 1;
        let ends = [chain.nodes[0], chain.nodes[last]].map(|v| number[&v]);
        let between: Vec<Point3> = chain.nodes[1..last]
            .iter()
            .map(|v| self.mesh.points[*v as usize])
            .collect();
        let wanted = Wanted {
            surfaces: [&surfaces[0], &surfaces[1]],
            ends: ends.map(|v| vertices[v as usize]),
            between: &between,
            size: self.size,
        };
        let curve = curve(&wanted).ok_or_else(|| {
            let (t, k) = chain.sides[0];
            let other = self.across[t as usize][k as usize].0;
            let sheets = [t, other].map(|t| self.mesh.sheets[t as usize] as usize);
            self.no_curve(sheets, chain)
        })?;
        Ok(Edge { curve, ends })
    }

    /// The faces with their loops; edges are numbered as the chains.
    fn add_faces(&self, topology: &Topology, brep: &mut Brep) {
        let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); topology.faces];
        for (t, face) in topology.face_of.iter().enumerate() {
            triangles[*face as usize].push(t as u32);
        }
        let mut charts = vec![0; self.names.len()];
        for (own, loops) in triangles.iter().zip(&topology.loops) {
            let sheet = self.mesh.sheets[own[0] as usize];
            let (surface, agrees) = self.placed(own, &self.surfaces[sheet as usize]);
            let coedge = |&(edge, forward): &(u32, bool)| Coedge { edge, forward };
            let loops = loops.iter().map(|l| l.iter().map(coedge).collect());
            let mut face = Face {
                surface,
                agrees,
                part: sheet,
                chart: charts[sheet as usize],
                loops: loops.collect(),
            };
            put_outer_first(brep, &mut face);
            charts[sheet as usize] += 1;
            brep.faces.push(face);
        }
    }

    /// The surface of a face with its frame placed, and whether its own normal points outward.
    fn placed(&self, own: &[u32], surface: &Surface) -> (Surface, bool) {
        let points = &self.mesh.points;
        let corners = |t: &u32| self.mesh.triangles[*t as usize];
        let normal = |t: &u32| {
            let [a, b, c] = corners(t).map(|v| points[v as usize]);
            cross(sub(b, a), sub(c, a))
        };
        let largest = own
            .iter()
            .max_by(|s, t| norm(normal(s)).total_cmp(&norm(normal(t))));
        let largest = *largest.unwrap_or(&own[0]);
        let outward = normal(&largest);
        let sides: Vec<[u32; 2]> = own
            .iter()
            .flat_map(|t| (0..3).map(|k| ends_of(&corners(t), k)).collect::<Vec<_>>())
            .collect();
        let placed = place(surface, points, &sides, outward);
        let [a, b, c] = corners(&largest).map(|v| points[v as usize]);
        let middle = isoform_geom::middle([a, b, c]);
        (placed, dot(placed.distance(middle).1, outward) > 0.0)
    }
}

/// The loop with the largest area is the outer one.
fn put_outer_first(brep: &Brep, face: &mut Face) {
    let areas = of_loops(brep, face, face.surface.axes().origin);
    let outer = (0..areas.len()).max_by(|a, b| areas[*a].area.total_cmp(&areas[*b].area));
    if let Some(outer) = outer {
        face.loops[..=outer].rotate_right(1);
    }
}
