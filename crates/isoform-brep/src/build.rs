//! Construction of faces, edges and vertices from a labelled mesh and the surfaces of its parts.

use crate::charts::SmoothFace;
use crate::curves::{CurveRequest, curve};
use crate::cut::{ChartSets, Cut, LabelledMesh, crossing, cuts_of, imprint, outlines};
use crate::fit::normal_of;
use crate::locus::Locus;
use crate::measure::of_loops;
use crate::newton::{POINT_TOLERANCE, gap};
use crate::piece::SmoothPiece;
use crate::pieces::Pieces;
use crate::place::place;
use crate::seams::{largest_angle, seam};
use crate::shells::solids;
use crate::tolerance::largest_kink;
use crate::topology::{
    BorderChain, Topology, TriangleSide, across_sides, components, ends_of, sides_of,
};
use crate::vertices::{open_contacts, vertex};
use crate::{BrepError, Control, collapse, reading, revolution};
use isoform_control::Stopped;
use isoform_geom::brep::{Brep, Coedge, Edge, Face, Graph, Surface};
use isoform_geom::{Aabb, Frame, Point3, UnionFind, cross, dot, norm, sub};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Tolerance of splines, as a share of the requested one: edges and samples do not cover
/// everything.
const SPLINE_TOLERANCE_SHARE: f64 = 0.25;

/// A boundary representation, and the triangles that represent its faces.
#[derive(Clone, Debug)]
pub struct MeshedBrep {
    /// The solids.
    pub brep: Brep,
    /// Nodes of the triangles, on the faces' surfaces except for edges that were divided.
    pub points: Vec<Point3>,
    /// Triangles of the mesh, divided along cuts.
    pub triangles: Vec<[u32; 3]>,
    /// Face of each triangle.
    pub face_of: Vec<u32>,
    /// Loci that intersect in each edge: two surfaces or functions; one of them is a cut if the
    /// edge divides a face, or a limit if two functions join smoothly.
    pub(crate) meeting: Vec<[Locus; 2]>,
    /// Loci of the faces on both sides of each edge.
    pub(crate) beside: Vec<[Locus; 2]>,
    /// Part of the mesh that each triangle belongs to.
    pub part_of: Vec<u32>,
    /// Names of the parts of the mesh.
    pub part_names: Vec<String>,
    /// Largest side of the box of the model.
    pub size: f64,
    /// Points of contact in place of which the mesh had a border, with the largest distance of its
    /// nodes from each.
    pub contacts: Vec<(Point3, f64)>,
}

impl MeshedBrep {
    /// Returns true if all faces lie on exact surfaces, none on an approximating spline.
    pub fn is_exact(&self) -> bool {
        self.brep.faces.iter().all(|f| !f.surface.is_near_only())
    }

    /// Returns the solids, given in coordinates of a frame, in space. The loci of edges are
    /// dropped: a `check` must come before.
    #[must_use]
    pub fn placed(self, frame: &Frame) -> Self {
        let out = |p: &Point3| frame.out(*p);
        Self {
            brep: self.brep.placed(frame),
            points: self.points.iter().map(out).collect(),
            meeting: Vec::new(),
            beside: Vec::new(),
            contacts: self.contacts.iter().map(|(p, by)| (out(p), *by)).collect(),
            ..self
        }
    }
}

/// Returns the boundary representation of the solid whose surface the pieces are. Faces on splines
/// are at most `tolerance` (model units) away from their functions, at samples.
///
/// Adjacent pieces of one surface are one face, named after the parts that have more than a tenth
/// of it.
///
/// # Errors
/// Fails if the mesh is not closed, faces touch without an angle, no splines fit a smooth face, or
/// the work is stopped.
pub fn brep(
    pieces: Pieces,
    tolerance: f64,
    control: &Control<'_>,
) -> Result<MeshedBrep, BrepError> {
    control.begin("faces")?;
    let Pieces { mesh, list, names } = pieces;
    let [x, y, z] = Aabb::from_points(&mesh.points).size();
    let size = x.max(y).max(z);
    let across = across_sides(&mesh.triangles)?;
    // Surfaces that differ by less than this are one.
    let sheets = Sheets::new(&mesh, &list, &names, &across, 1e-10 * size);
    let mesh = sheets.labelled(mesh, &across);
    let mut builder = Builder {
        sheets: &sheets,
        pieces: &list,
        part_names: &names,
        mesh,
        across,
        apexes: BTreeSet::new(),
        revolved: BTreeMap::new(),
        graphs: Vec::new(),
        contacts: Vec::new(),
        tolerance,
        size,
    };
    builder.collapse()?;
    builder.find_revolved();
    builder.find_apexes();
    control.begin("cuts")?;
    builder.cut(control)?;
    control.begin("edges")?;
    builder.build(control)
}

/// Sheets: the loci of pieces, with adjacent pieces on one surface merged.
struct Sheets {
    /// Sheet of each piece.
    of_piece: Vec<u32>,
    /// First piece of each sheet.
    pieces: Vec<u32>,
    loci: Vec<Locus>,
    /// Part of the representation that each sheet belongs to.
    parts: Vec<u32>,
    /// Names of the parts of the representation.
    names: Vec<String>,
}

impl Sheets {
    /// Merges adjacent pieces that lie on one surface within `same`.
    fn new(
        mesh: &LabelledMesh,
        list: &[SmoothPiece],
        parts: &[String],
        across: &[[TriangleSide; 3]],
        same: f64,
    ) -> Self {
        let mut meet = BTreeSet::new();
        let mut area = vec![0.0; list.len()];
        for (t, &piece) in mesh.sheets.iter().enumerate() {
            area[piece as usize] += norm(normal_of(&mesh.corners(t as u32)));
            let others = across[t].iter().map(|s| mesh.sheets[s.0 as usize]);
            meet.extend(others.filter(|o| piece < *o).map(|o| (piece, o)));
        }
        let holds = |surface: &Surface, points: &[Point3]| {
            points.iter().all(|p| surface.distance(*p).0.abs() <= same)
        };
        let points = |k: usize| &list[k].nodes;
        let is_one = |a: usize, b: usize| match (&list[a].locus, &list[b].locus) {
            _ if list[a].function.is_some() && list[a].function == list[b].function => true,
            (Locus::Exact(s), Locus::Exact(t)) => {
                s.name() == t.name() && holds(s, points(b)) && holds(t, points(a))
            }
            _ => false,
        };
        let mut sets = UnionFind::new(list.len());
        for (a, b) in meet {
            if is_one(a as usize, b as usize) {
                sets.unite(a, b);
            }
        }
        let up: Vec<usize> = (0..list.len() as u32)
            .map(|k| sets.root(k) as usize)
            .collect();
        let mut made = Self {
            of_piece: vec![0; list.len()],
            pieces: Vec::new(),
            loci: Vec::new(),
            parts: Vec::new(),
            names: Vec::new(),
        };
        for k in (0..list.len()).filter(|k| up[*k] == *k) {
            let sheet = made.loci.len() as u32;
            let own: Vec<usize> = (k..list.len()).filter(|j| up[*j] == k).collect();
            let whole: f64 = own.iter().map(|j| area[*j]).sum();
            let mut of: Vec<&str> = Vec::new();
            for j in own {
                made.of_piece[j] = sheet;
                let name = parts[list[j].part as usize].as_str();
                // A part with less than a tenth of a shared surface does not name it: slivers next
                // to a blend belong to the part that continues.
                if area[j] >= 0.1 * whole && !of.contains(&name) {
                    of.push(name);
                }
            }
            made.pieces.push(k as u32);
            made.loci.push(list[k].locus.clone());
            made.name(of.join("+"));
        }
        made
    }

    /// Assigns the last sheet to the part of the representation with this name.
    fn name(&mut self, name: String) {
        let known = self.names.iter().position(|n| *n == name);
        let part = known.unwrap_or_else(|| {
            self.names.push(name);
            self.names.len() - 1
        });
        self.parts.push(part as u32);
    }

    /// Returns the mesh, labelled by sheets and their components.
    fn labelled(&self, mesh: LabelledMesh, across: &[[TriangleSide; 3]]) -> LabelledMesh {
        let pieces = mesh.sheets.iter();
        let of: Vec<u32> = pieces.map(|p| self.of_piece[*p as usize]).collect();
        let (components, count) = components(across, |a, b| of[a as usize] == of[b as usize]);
        LabelledMesh {
            charts: vec![0; of.len()],
            sets: ChartSets::default(),
            sheets: of,
            components,
            cuts: vec![Vec::new(); count],
            ..mesh
        }
    }
}

struct Builder<'a> {
    sheets: &'a Sheets,
    pieces: &'a [SmoothPiece],
    part_names: &'a [String],
    mesh: LabelledMesh,
    across: Vec<[TriangleSide; 3]>,
    /// Nodes at apexes of cones.
    apexes: BTreeSet<u32>,
    /// Smooth components that are surfaces of revolution.
    revolved: BTreeMap<u32, Surface>,
    /// Splines of charts, each with a triangle of its chart.
    graphs: Vec<(u32, Arc<Graph>)>,
    /// Points in place of which the mesh had a border, with the largest distance of its nodes from
    /// each.
    contacts: Vec<(Point3, f64)>,
    /// Maximum distance of splines from functions, in model units.
    tolerance: f64,
    size: f64,
}

impl Builder<'_> {
    /// Contracts borders that represent one point.
    fn collapse(&mut self) -> Result<(), BrepError> {
        loop {
            let (mesh, loci) = (&self.mesh, &self.sheets.loci);
            let chains = self.topology().chains;
            let Some(found) = collapse::find(mesh, &self.across, &chains, loci, self.size) else {
                return Ok(());
            };
            self.contacts.push(found.extent(mesh));
            collapse::contract(&mut self.mesh, &self.across, &found, loci);
            self.across = across_sides(&self.mesh.triangles)?;
        }
    }

    /// Finds the smooth components that are surfaces of revolution.
    fn find_revolved(&mut self) {
        for component in 0..self.mesh.cuts.len() as u32 {
            let Some(first) = self.first_of(component) else {
                continue;
            };
            let locus = &self.sheets.loci[self.mesh.sheets[first] as usize];
            if locus.surface().is_none()
                && let Some(surface) = self.as_revolved(component, locus)
            {
                self.revolved.insert(component, surface);
            }
        }
    }

    /// Returns the first triangle of a component.
    fn first_of(&self, component: u32) -> Option<usize> {
        let mut of = self.mesh.components.iter();
        of.position(|c| *c == component)
    }

    /// Returns the surface of a triangle, if it is exact or one of revolution.
    fn surface_of(&self, t: usize) -> Option<&Surface> {
        let revolved = self.revolved.get(&self.mesh.components[t]);
        revolved.or_else(|| self.sheets.loci[self.mesh.sheets[t] as usize].surface())
    }

    /// Moves nodes to the tips of surfaces that they represent: nodes at a tip, and the node of a
    /// face nearest to its tip if it is only a few edges away and all surfaces that meet in it pass
    /// through the tip, which a mesh may cut off.
    fn find_apexes(&mut self) {
        for (apex, far, v, edge) in self.nearest_to_apexes().into_values() {
            let corners = self.mesh.triangles.iter().enumerate();
            let mut around = corners.filter(|(_, c)| c.contains(&v)).map(|c| c.0);
            // A node within a millionth of the size of the apex is the apex.
            let near = 1e-6 * self.size;
            let meets = |t: usize| self.surface_of(t).is_some_and(|s| gap([s], apex) <= near);
            // A mesh cuts off up to three of its edges from the tip of a cone.
            if far <= near || (far <= 3.0 * edge && around.all(meets)) {
                self.mesh.points[v as usize] = apex;
                self.apexes.insert(v);
            }
        }
    }

    /// Returns by component and tip of its surface: the tip, the distance of the nearest node, this
    /// node, and its longest edge.
    fn nearest_to_apexes(&self) -> BTreeMap<(u32, usize), (Point3, f64, u32, f64)> {
        let mut nearest = BTreeMap::new();
        for (t, corners) in self.mesh.triangles.iter().enumerate() {
            let tips = self.surface_of(t).map_or_else(Vec::new, Surface::tips);
            for ((tip, apex), k) in tips
                .into_iter()
                .enumerate()
                .flat_map(|a| (0..3).map(move |k| (a, k)))
            {
                let [p, q] = ends_of(corners, k).map(|v| self.mesh.points[v as usize]);
                let (far, edge) = (norm(sub(p, apex)), norm(sub(p, q)));
                let v = corners[k as usize];
                let first = (apex, far, v, edge);
                let best = nearest
                    .entry((self.mesh.components[t], tip))
                    .or_insert(first);
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

    /// Cuts the components that wrap around, one after another, each away from the vertices that
    /// the previous ones made.
    fn cut(&mut self, control: &Control<'_>) -> Result<(), BrepError> {
        let mut topology = self.topology();
        for component in 0..self.mesh.cuts.len() as u32 {
            let Some(first) = self.first_of(component) else {
                continue;
            };
            let sheet = self.mesh.sheets[first] as usize;
            match &self.sheets.loci[sheet] {
                Locus::Exact(Surface::Plane(_)) => {}
                Locus::Exact(surface) => {
                    if self.cut_exact(component, first, surface, &topology)? {
                        topology = self.topology();
                    }
                }
                Locus::Zero(field) => {
                    if let Some(surface) = self.revolved.get(&component).cloned() {
                        self.cut_exact(component, first, &surface, &topology)?;
                        topology = self.topology();
                        continue;
                    }
                    let smooth = SmoothFace {
                        component,
                        field,
                        tolerance: SPLINE_TOLERANCE_SHARE * self.tolerance,
                        // Two splines meet in an edge, and their angles are sampled: each gets less
                        // than half of the allowed kink.
                        turn: 0.4 * largest_kink(self.tolerance, self.size).to_radians(),
                    };
                    let made = smooth.charts(&mut self.mesh, &mut self.across, control)?;
                    let made = made.map_err(|why| BrepError::NoSpline {
                        part: self.name(sheet).to_owned(),
                        why,
                    })?;
                    let made = made.into_iter().map(|(t, g)| (t, Arc::new(g)));
                    self.graphs.extend(made);
                    topology = self.topology();
                }
            }
        }
        Ok(())
    }

    /// Returns the surface of revolution that a smooth component is; `None` if it is not one.
    fn as_revolved(&self, component: u32, locus: &Locus) -> Option<Surface> {
        let own = self.triangles_of(component);
        let triangles = own.into_iter().map(|t| self.mesh.corners(t));
        let triangles: Vec<[Point3; 3]> = triangles.collect();
        let exact = self.sheets.loci.iter().filter_map(Locus::surface);
        let axes = exact.filter_map(|surface| match surface {
            Surface::Cylinder(axes, _) | Surface::Cone(axes, ..) | Surface::Torus(axes, ..) => {
                Some(*axes)
            }
            _ => None,
        });
        let piece = revolution::ProfileInput {
            locus,
            triangles: &triangles,
            axes: &axes.collect::<Vec<_>>(),
            tolerance: SPLINE_TOLERANCE_SHARE * self.tolerance,
            size: self.size,
        };
        piece.revolved()
    }

    /// Cuts a component on an exact surface, if it wraps around. Returns true if it was cut.
    fn cut_exact(
        &mut self,
        component: u32,
        first: usize,
        surface: &Surface,
        topology: &Topology,
    ) -> Result<bool, BrepError> {
        let vertices = self.vertices(topology);
        let is_vertex = |v: u32| vertices.contains(&v);
        let face = topology.face_of[first] as usize;
        let own = &topology.loops[face..=face];
        let mut outline = outlines(&topology.chains, own, &is_vertex).remove(0);
        outline.triangles = self.triangles_of(component);
        let locus = Locus::Exact(surface.clone());
        let cuts = cuts_of(&self.mesh, surface, &outline);
        if cuts.is_empty() {
            return Ok(false);
        }
        for cut in cuts {
            let cuts = &mut self.mesh.cuts[component as usize];
            let number = cuts.len() as u32;
            let cut = Locus::Exact(cut);
            cuts.push(cut.clone());
            let cut = Cut {
                own: &self.triangles_of(component),
                number,
                locus: &cut,
                crossing: &|ends| crossing(ends, &locus, &cut),
                is_vertex: &is_vertex,
            };
            imprint(&mut self.mesh, &cut);
        }
        self.across = across_sides(&self.mesh.triangles)?;
        Ok(true)
    }

    fn triangles_of(&self, component: u32) -> Vec<u32> {
        let of = &self.mesh.components;
        let all = 0..of.len() as u32;
        all.filter(|t| of[*t as usize] == component).collect()
    }

    /// Returns the name of a sheet.
    fn name(&self, sheet: usize) -> &str {
        &self.sheets.names[self.sheets.parts[sheet] as usize]
    }

    /// Returns the junctions, without those that were only put on closed chains.
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

    fn build(&self, control: &Control<'_>) -> Result<MeshedBrep, BrepError> {
        let topology = self.topology();
        let mut meeting: Vec<[Locus; 2]> = topology
            .chains
            .iter()
            .map(|chain| self.meeting(chain))
            .collect::<Result<_, _>>()?;
        let placed = self.place_vertices(&topology, &meeting)?;
        let mut brep = Brep {
            vertices: placed.vertices,
            parts: self.sheets.names.clone(),
            ..Brep::default()
        };
        let edges = topology.chains.par_iter().zip(&meeting);
        let edges = edges.map(|(chain, surfaces)| {
            control.check()?;
            self.edge(chain, surfaces, &placed.number, &brep.vertices)
        });
        let edges: Vec<Result<Edge, BrepError>> = edges.collect();
        brep.edges = edges.into_iter().collect::<Result<_, _>>()?;
        for (chain, surfaces) in topology.chains.iter().zip(&mut meeting) {
            let [t, other] = self.beside(chain).map(|t| self.mesh.components[t as usize]);
            if let Some(surface) = self.revolved.get(&t)
                && t == other
            {
                surfaces[0] = Locus::Exact(surface.clone());
            }
        }
        self.add_faces(&topology, &mut brep, control)?;
        let mut beside: Vec<[Locus; 2]> = topology.chains.iter().map(|c| self.loci(c)).collect();
        for parted in open_contacts(&placed.contacts, &mut brep, &meeting, self.size) {
            meeting.push(meeting[parted].clone());
            beside.push(beside[parted].clone());
        }
        for divided in reading::divide(&mut brep, self.size, control)? {
            meeting.push(meeting[divided].clone());
            beside.push(beside[divided].clone());
        }
        let mesh = &self.mesh;
        brep.solids = solids(
            &mesh.points,
            &mesh.triangles,
            &self.across,
            &topology.face_of,
        )?;
        Ok(MeshedBrep {
            brep,
            points: mesh.points.clone(),
            triangles: mesh.triangles.clone(),
            face_of: topology.face_of,
            meeting,
            beside,
            part_of: mesh.parts.clone(),
            part_names: self.part_names.to_vec(),
            size: self.size,
            contacts: self.contacts.clone(),
        })
    }

    /// Returns the loci that intersect in a chain: those of two sheets, or of one and a cut, or of
    /// one and the limit along which it joins the other smoothly.
    fn meeting(&self, chain: &BorderChain) -> Result<[Locus; 2], BrepError> {
        let [t, other] = self.beside(chain);
        let sheets = self.sheets_beside(chain);
        let [a, b] = &self.loci(chain);
        if sheets[0] == sheets[1] {
            let cut = self.mesh.cut_between(t, other);
            return cut
                .map(|cut| [a.clone(), cut.clone()])
                .ok_or_else(|| self.no_curve(sheets, chain));
        }
        let nodes = chain.nodes.iter();
        let points: Vec<Point3> = nodes.map(|v| self.mesh.points[*v as usize]).collect();
        let inner = if points.len() > 2 {
            &points[1..points.len() - 1]
        } else {
            &points[..]
        };
        let angle = largest_angle([a, b], inner);
        // Neighbours whose normals differ by at most 0.02 (radians) all along a border join
        // smoothly there: their edge is not their intersection.
        if angle > 0.02 {
            return Ok([a.clone(), b.clone()]);
        }
        let pieces = sheets.map(|s| &self.pieces[self.sheets.pieces[s] as usize]);
        let on = if b.surface().is_some() { b } else { a };
        // Surfaces that meet at an angle below 1e-3 (radians) and along no limit have no edge: at a
        // larger one roundings grow at most a thousandfold.
        seam(pieces, [a, b], &points)
            .map(|limit| [on.clone(), limit])
            .or_else(|| (angle > 1e-3).then(|| [a.clone(), b.clone()]))
            .ok_or_else(|| self.no_curve(sheets, chain))
    }

    /// Returns the triangles on both sides of the first edge of a chain.
    fn beside(&self, chain: &BorderChain) -> [u32; 2] {
        let (t, k) = chain.sides[0];
        [t, self.across[t as usize][k as usize].0]
    }

    /// Returns the sheets on both sides of a chain.
    fn sheets_beside(&self, chain: &BorderChain) -> [usize; 2] {
        self.beside(chain)
            .map(|t| self.mesh.sheets[t as usize] as usize)
    }

    /// Returns the loci of the sheets on both sides of a chain.
    fn loci(&self, chain: &BorderChain) -> [Locus; 2] {
        self.sheets_beside(chain)
            .map(|s| self.sheets.loci[s].clone())
    }

    fn no_curve(&self, sheets: [usize; 2], chain: &BorderChain) -> BrepError {
        BrepError::NoCurve {
            parts: sheets.map(|s| self.name(s).to_owned()),
            at: self.mesh.points[chain.nodes[chain.nodes.len() / 2] as usize],
        }
    }

    /// Places the vertices on all surfaces that meet there.
    fn place_vertices(
        &self,
        topology: &Topology,
        meeting: &[[Locus; 2]],
    ) -> Result<VertexTable, BrepError> {
        let mut around: BTreeMap<u32, Vec<Locus>> = BTreeMap::new();
        for (chain, surfaces) in topology.chains.iter().zip(meeting) {
            for v in [chain.nodes[0], chain.nodes[chain.nodes.len() - 1]] {
                let all = around.entry(v).or_default();
                for surface in surfaces {
                    if !all.contains(surface) {
                        all.push(surface.clone());
                    }
                }
            }
        }
        let mut placed = VertexTable::default();
        for (v, surfaces) in around {
            let at = self.mesh.points[v as usize];
            let (p, is_contact) = if self.apexes.contains(&v) {
                (at, false)
            } else {
                vertex(&surfaces, at, self.size)
            };
            let reach = 0.05 * self.size;
            // A function has no gradient at a tip; its surface was tested instead.
            let is_off = |s: &Locus| {
                let by = gap([s], p);
                by > POINT_TOLERANCE * self.size
                    && !(self.apexes.contains(&v) && s.surface().is_none())
            };
            if surfaces.iter().any(is_off) || norm(sub(p, at)) > reach {
                return Err(BrepError::NoVertex { at });
            }
            let number = placed.vertices.len() as u32;
            placed.number.insert(v, number);
            placed.vertices.push(p);
            placed.contacts.extend(is_contact.then_some(number));
        }
        Ok(placed)
    }

    fn edge(
        &self,
        chain: &BorderChain,
        surfaces: &[Locus; 2],
        number: &BTreeMap<u32, u32>,
        vertices: &[Point3],
    ) -> Result<Edge, BrepError> {
        let last = chain.nodes.len() - 1;
        let ends = [chain.nodes[0], chain.nodes[last]].map(|v| number[&v]);
        let between: Vec<Point3> = chain.nodes[1..last]
            .iter()
            .map(|v| self.mesh.points[*v as usize])
            .collect();
        let wanted = CurveRequest {
            surfaces: [&surfaces[0], &surfaces[1]],
            ends: ends.map(|v| vertices[v as usize]),
            between: &between,
            size: self.size,
        };
        let curve = curve(&wanted);
        let curve = curve.ok_or_else(|| self.no_curve(self.sheets_beside(chain), chain))?;
        Ok(Edge { curve, ends })
    }

    /// Adds the faces with their loops; edges are numbered as the chains.
    fn add_faces(
        &self,
        topology: &Topology,
        brep: &mut Brep,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); topology.faces];
        for (t, face) in topology.face_of.iter().enumerate() {
            triangles[*face as usize].push(t as u32);
        }
        let graphs: BTreeMap<u32, &Arc<Graph>> = self
            .graphs
            .iter()
            .map(|(t, graph)| (topology.face_of[*t as usize], graph))
            .collect();
        let mut charts = vec![0; self.sheets.names.len()];
        let mut faces = Vec::with_capacity(topology.faces);
        for (f, (own, loops)) in triangles.iter().zip(&topology.loops).enumerate() {
            let sheet = self.mesh.sheets[own[0] as usize] as usize;
            let exact = self.surface_of(own[0] as usize).cloned();
            let exact = exact.unwrap_or_else(|| Surface::Graph(graphs[&(f as u32)].clone()));
            let (surface, agrees) = self.placed(own, &exact);
            let coedge = |&(edge, forward): &(u32, bool)| Coedge { edge, forward };
            let loops = loops.iter().map(|l| l.iter().map(coedge).collect());
            let part = self.sheets.parts[sheet];
            let face = Face {
                surface,
                agrees,
                part,
                chart: charts[part as usize],
                loops: loops.collect(),
            };
            charts[part as usize] += 1;
            faces.push(face);
        }
        let of: &Brep = brep;
        faces
            .par_iter_mut()
            .try_for_each(|face| put_outer_first(of, face, control))?;
        brep.faces = faces;
        Ok(())
    }

    /// Returns the surface of a face with its frame placed, and true if the surface's normal points
    /// outward.
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
        let sides = sides_of(&self.mesh.triangles, own);
        let placed = place(surface, points, &sides, outward);
        let [a, b, c] = corners(&largest).map(|v| points[v as usize]);
        let middle = isoform_geom::middle([a, b, c]);
        let agrees = dot(placed.distance(middle).1, outward) > 0.0;
        (placed, agrees)
    }
}

/// The vertices.
#[derive(Default)]
struct VertexTable {
    vertices: Vec<Point3>,
    /// Index of the vertex of each node of the mesh.
    number: BTreeMap<u32, u32>,
    /// Indices of the vertices at which a surface touches the curve of two others.
    contacts: BTreeSet<u32>,
}

/// Makes the loop with the largest area the outer one.
fn put_outer_first(brep: &Brep, face: &mut Face, control: &Control<'_>) -> Result<(), Stopped> {
    if face.loops.len() < 2 {
        return Ok(());
    }
    let areas = of_loops(brep, face, face.surface.axes().origin, control)?;
    let outer = (0..areas.len()).max_by(|a, b| areas[*a].area.total_cmp(&areas[*b].area));
    if let Some(outer) = outer {
        face.loops[..=outer].rotate_right(1);
    }
    Ok(())
}
