//! Certificate of a boundary representation: searches for everything that could be wrong with it.
//!
//! Counts are exact; distances, angles and areas are taken at samples.

use crate::build::MeshedBrep;
use crate::locus::{Distance, Locus};
use crate::measure::{Measure, of_face, total};
use crate::newton::{POINT_TOLERANCE, meet};
use crate::reading::deviations;
use crate::shells::volume;
use crate::tolerance::{READER_TOLERANCE, largest_kink, worse};
use crate::topology::ends_of;
use crate::whole::Boundary;
use isoform_control::{Control, Stopped};
use isoform_geom::brep::{Brep, Ellipsoid, Surface};
use isoform_geom::{Aabb, Frame, Point3, Solid, cross, dot, middle, norm, sub};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt;

/// Number of samples of a piece of an edge.
const SAMPLES_PER_PIECE: usize = 8;
/// Minimum length of an edge, and of the root of the area of a face, in reader tolerances.
const MIN_LENGTH_IN_TOLERANCES: f64 = 10.0;

/// A defect, or a question left open.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// Edges that are not in two loops, once in each direction.
    OpenEdges(usize),
    /// The Euler numbers of the faces and of the mesh differ.
    Euler {
        /// Euler number of the faces.
        found: i64,
        /// Euler number of the mesh.
        mesh: i64,
    },
    /// Faces with handles, or without a border: their Euler number is not 2 less their loops.
    NotPlanar(usize),
    /// Edges leave the domain of the spline of their face.
    OffDomain(String),
    /// Edges or vertices leave the surfaces of their faces.
    Gap(f64),
    /// A face leaves the function of its part.
    Distance {
        /// Name of the face.
        face: String,
        /// Distance in model units.
        by: f64,
    },
    /// Normals differ along an edge that should be smooth (degrees).
    Kink(f64),
    /// The image of an edge in the parameters of a face, which readers interpolate, leaves it.
    Reading {
        /// Distance in model units.
        by: f64,
        /// Start of the edge.
        at: Point3,
    },
    /// The volume differs from the limit of the meshes.
    Volume {
        /// Volume of the faces.
        found: f64,
        /// Limit of the volumes of meshes.
        limit: f64,
    },
    /// The area of a face differs from that of its triangles.
    Area {
        /// Name of the face.
        face: String,
        /// Area of the face.
        found: f64,
        /// Area of its triangles.
        mesh: f64,
    },
    /// An edge is shorter than ten tolerances.
    ShortEdge {
        /// Length of the edge.
        length: f64,
        /// Start of the edge.
        at: Point3,
    },
    /// A face is smaller than ten tolerances squared.
    SmallFace {
        /// Name of the face.
        face: String,
        /// Area of the face.
        area: f64,
    },
    /// The model has surface that is on no face: features smaller than the triangles of the mesh.
    Missed {
        /// Point of that surface.
        at: Point3,
        /// Distance of the nearest face.
        by: f64,
    },
    /// An edge or a vertex is not on the surface of the model, although it is on the pieces that
    /// meet there: a part smaller than the triangles of the mesh cuts it off.
    OffModel {
        /// The point.
        at: Point3,
        /// Distance from the model.
        by: f64,
    },
    /// A question that the mesh leaves open.
    Mesh(String),
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OpenEdges(n) => write!(f, "{n} edges are not between two faces"),
            Self::Euler { found, mesh } => {
                write!(f, "the Euler number is {found}, that of the mesh {mesh}")
            }
            Self::NotPlanar(n) => write!(f, "{n} faces have a handle, or no border"),
            Self::OffDomain(face) => write!(f, "the face {face} leaves the domain of its spline"),
            Self::Gap(by) => write!(f, "an edge is {by:.2e} away from a surface of its faces"),
            Self::Distance { face, by } => {
                write!(f, "the face {face} is {by:.2e} away from the model")
            }
            Self::Kink(angle) => write!(f, "a smooth edge has a kink of {angle:.2e} degrees"),
            Self::Reading { by, at } => write!(
                f,
                "readers see the edge at ({}, {}, {}) up to {by:.2e} away: they interpolate it in \
                 the parameters of its faces",
                at[0], at[1], at[2]
            ),
            Self::Volume { found, limit } => {
                write!(
                    f,
                    "the volume is {found}, that of finer meshes tends to {limit}"
                )
            }
            Self::Area { face, found, mesh } => {
                write!(
                    f,
                    "the face {face} has the area {found}, its triangles {mesh}"
                )
            }
            Self::ShortEdge { length, at } => write!(
                f,
                "an edge at ({}, {}, {}) is only {length:.2e} long: readers may lose it",
                at[0], at[1], at[2]
            ),
            Self::SmallFace { face, area } => {
                write!(
                    f,
                    "the face {face} has an area of {area:.2e} only: readers may lose it"
                )
            }
            Self::Missed { at, by } => write!(
                f,
                "the model has surface at ({}, {}, {}), {by:.2e} away from the faces: a part is \
                 smaller than the triangles of the mesh; a smaller --size shows it",
                at[0], at[1], at[2]
            ),
            Self::OffModel { at, by } => write!(
                f,
                "an edge ends or runs at ({}, {}, {}), {by:.2e} away from the model: a part is \
                 smaller than the triangles of the mesh; a smaller --size shows it",
                at[0], at[1], at[2]
            ),
            Self::Mesh(what) => write!(f, "the mesh: {what}"),
        }
    }
}

/// Certificate of a boundary representation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certificate {
    /// Vertices − edges + Euler numbers of the faces.
    pub euler: i64,
    /// Largest distance of points of edges, and of vertices, from the surfaces that meet there.
    pub gap: f64,
    /// Largest such distance at edges between exact surfaces only.
    pub exact_gap: f64,
    /// Largest distance of samples from the function of the part, by face.
    pub distances: Vec<f64>,
    /// Largest angle between the normals of faces along edges that are smooth (degrees).
    pub smooth_angle: f64,
    /// Measures by face.
    pub faces: Vec<Measure>,
    /// Total area, volume and first moments, about `center`.
    pub total: Measure,
    /// Point that moments are taken about.
    pub center: Point3,
    /// Limit of the volumes of finer meshes.
    pub mesh_limit: f64,
    /// Length of the shortest edge.
    pub shortest_edge: f64,
    /// Area of the smallest face.
    pub smallest_face: f64,
    /// True if readers of files reconstruct all edges within their tolerance, whatever the gaps.
    pub is_read_alike: bool,
    /// Defects, and questions left open.
    pub failures: Vec<Finding>,
}

impl Certificate {
    /// Returns true if the list of failures is empty.
    pub fn holds(&self) -> bool {
        self.failures.is_empty()
    }
    /// Returns the centroid of the volume.
    pub fn centroid(&self) -> Point3 {
        let Measure { volume, moment, .. } = self.total;
        std::array::from_fn(|k| self.center[k] + moment[k] / volume)
    }
}

impl Certificate {
    /// Returns the certificate of the solids, given in coordinates of a frame, in space. Gaps grow
    /// by the rounding of coordinates there.
    #[must_use]
    pub fn placed(self, frame: &Frame) -> Self {
        let moved = |m: &Measure| Measure {
            moment: frame.turned(m.moment),
            ..*m
        };
        let center = frame.out(self.center);
        let rounding = 4.0 * f64::EPSILON * (norm(center) + norm(frame.translation));
        Self {
            center,
            gap: self.gap + rounding,
            exact_gap: self.exact_gap + rounding,
            faces: self.faces.iter().map(moved).collect(),
            total: moved(&self.total),
            failures: self.failures.into_iter().map(|f| f.placed(frame)).collect(),
            ..self
        }
    }
}

impl Finding {
    /// Returns the finding with its position, given in a frame, in space.
    fn placed(mut self, frame: &Frame) -> Self {
        if let Self::Reading { at, .. }
        | Self::ShortEdge { at, .. }
        | Self::Missed { at, .. }
        | Self::OffModel { at, .. } = &mut self
        {
            *at = frame.out(*at);
        }
        self
    }
}

/// Checks a boundary representation. Edges and faces on splines may be `tolerance` away from one
/// another and from the model, in model units; exact ones by a tenth of the readers' tolerance, and
/// no more than `tolerance`. `witnesses` are points of the model's surface that have to be on
/// faces, `open` is what the certificate of the mesh leaves open.
///
/// # Errors
/// [`Stopped`].
pub fn check(
    built: &MeshedBrep,
    solid: &dyn Solid,
    tolerance: f64,
    witnesses: &[Point3],
    open: Vec<String>,
    control: &Control<'_>,
) -> Result<Certificate, Stopped> {
    let MeshedBrep { brep, size, .. } = built;
    let mut made = Certificate {
        center: Aabb::from_points(&brep.vertices).center(),
        is_read_alike: true,
        failures: open.into_iter().map(Finding::Mesh).collect(),
        ..Certificate::default()
    };
    examine_topology(built, &mut made);
    examine_domains(brep, &mut made);
    let limit = (0.1 * READER_TOLERANCE * size).min(tolerance);
    examine_edges(built, [limit, tolerance], &mut made, control)?;
    let faces = || (0..brep.faces.len()).into_par_iter();
    let distance = |f| {
        control.check()?;
        Ok(distance_of_face(built, solid, f))
    };
    made.distances = faces().map(distance).collect::<Result<_, Stopped>>()?;
    let measure = |f| of_face(brep, f, made.center, control);
    made.faces = faces().map(measure).collect::<Result<_, _>>()?;
    made.total = total(&made.faces);
    examine_measures(built, &mut made);
    examine_places(built, solid, tolerance, &mut made);
    let moved: Vec<Point3> = witnesses
        .iter()
        .map(|p| on_model(solid, *p, POINT_TOLERANCE * size))
        .collect();
    examine_witnesses(built, &moved, [limit, tolerance], &mut made);
    for (f, &by) in made.distances.iter().enumerate() {
        let is_spline = brep.faces[f].surface.is_near_only();
        if by > if is_spline { tolerance } else { limit } {
            let face = brep.face_name(f);
            made.failures.push(Finding::Distance { face, by });
        }
    }
    Ok(made)
}

/// Checks the uses of edges, and Euler numbers.
fn examine_topology(built: &MeshedBrep, made: &mut Certificate) {
    let brep = &built.brep;
    let mut uses = vec![[0usize; 2]; brep.edges.len()];
    let faces = brep.faces.iter();
    for coedge in faces.flat_map(|f| f.loops.iter().flatten()) {
        uses[coedge.edge as usize][usize::from(coedge.forward)] += 1;
    }
    let open = uses.iter().filter(|u| **u != [1, 1]).count();
    if open > 0 {
        made.failures.push(Finding::OpenEdges(open));
    }
    let of_faces: i64 = brep.faces.iter().map(|f| 2 - f.loops.len() as i64).sum();
    made.euler = brep.vertices.len() as i64 - brep.edges.len() as i64 + of_faces;
    let mesh = euler(&built.triangles);
    if made.euler != mesh {
        let found = made.euler;
        made.failures.push(Finding::Euler { found, mesh });
    }
    let mut own = vec![Vec::new(); brep.faces.len()];
    for (t, f) in built.face_of.iter().enumerate() {
        own[*f as usize].push(built.triangles[t]);
    }
    let is_planar = |f: usize| {
        let loops = brep.faces[f].loops.len() as i64;
        loops > 0 && open_euler(&own[f]) == 2 - loops
    };
    let bad = (0..own.len()).filter(|f| !is_planar(*f)).count();
    if bad > 0 {
        made.failures.push(Finding::NotPlanar(bad));
    }
}

/// Checks that points of the edges of faces lie in the domains of their splines.
fn examine_domains(brep: &Brep, made: &mut Certificate) {
    for (f, face) in brep.faces.iter().enumerate() {
        let is_in = |p: Point3| match &face.surface {
            Surface::Graph(graph) => {
                let at = graph.axes.local(p);
                let domain = graph.domain();
                (0..2).all(|k| domain[k][0] < at[k] && at[k] < domain[k][1])
            }
            Surface::Revolved(turned) => {
                let [first, last] = turned.domain();
                let at = turned.parameters(p)[1];
                // A curve ends at a tip, so that no upper or lower bound applies.
                let tips = turned.tips();
                (tips[0] || first < at) && (tips[1] || at < last)
            }
            Surface::Ellipsoid(ball) => {
                let at = ball.in_chart(p);
                at.iter().all(|v| v.abs() < Ellipsoid::CHART_HALF_WIDTH)
            }
            _ => true,
        };
        let edges = face.loops.iter().flatten().map(|c| c.edge);
        let all_in = |e: u32| {
            let mut along = samples(&brep.breaks(e)).into_iter();
            along.all(|s| is_in(brep.along(e, s).0))
        };
        if !edges.into_iter().all(all_in) {
            made.failures.push(Finding::OffDomain(brep.face_name(f)));
        }
    }
}

/// Returns nodes − edges + triangles.
fn euler(triangles: &[[u32; 3]]) -> i64 {
    let mut nodes: Vec<u32> = triangles.as_flattened().to_vec();
    let mut edges: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(|t| (0..3).map(|k| ends_of(t, k)).collect::<Vec<_>>())
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    nodes.sort_unstable();
    nodes.dedup();
    edges.sort_unstable();
    edges.dedup();
    nodes.len() as i64 - edges.len() as i64 + triangles.len() as i64
}

/// Returns the Euler number of the interior of a face: −(inner edges) + triangles + inner nodes.
/// A disc has 1, and each further border reduces the number by one, also if borders meet in a node.
fn open_euler(triangles: &[[u32; 3]]) -> i64 {
    let mut count: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for corners in triangles {
        for k in 0..3 {
            let [a, b] = ends_of(corners, k);
            *count.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let inner = count.values().filter(|n| **n == 2).count() as i64;
    let mut nodes: Vec<u32> = triangles.as_flattened().to_vec();
    nodes.sort_unstable();
    nodes.dedup();
    let mut border: Vec<u32> = count
        .iter()
        .filter(|c| *c.1 == 1)
        .flat_map(|c| *c.0)
        .collect();
    border.sort_unstable();
    border.dedup();
    // The interior is an open surface: its number is that of the closed one with disjoint borders.
    (nodes.len() - border.len()) as i64 - inner + triangles.len() as i64
}

/// Checks gaps, lengths and angles along edges; the limits are those of exact edges, and of others.
fn examine_edges(
    built: &MeshedBrep,
    limits: [f64; 2],
    made: &mut Certificate,
    control: &Control<'_>,
) -> Result<(), Stopped> {
    let (brep, size) = (&built.brep, built.size);
    let mut sides: Vec<Vec<EdgeSide<'_>>> = vec![Vec::new(); brep.edges.len()];
    for face in &brep.faces {
        for coedge in face.loops.iter().flatten() {
            let sense = if face.agrees { 1.0 } else { -1.0 };
            sides[coedge.edge as usize].push((&face.surface, sense));
        }
    }
    made.shortest_edge = f64::INFINITY;
    let examined = sides.par_iter().enumerate();
    let examined: Vec<AlongEdge> = examined
        .map(|(e, sides)| examine_edge(built, e as u32, sides))
        .collect();
    for (e, (sides, found)) in sides.iter().zip(examined).enumerate() {
        made.gap = made.gap.max(found.gap);
        made.smooth_angle = made.smooth_angle.max(found.angle);
        if !sides.iter().any(|s| s.0.is_near_only()) {
            made.exact_gap = made.exact_gap.max(found.gap);
        }
        made.shortest_edge = made.shortest_edge.min(found.length);
        if found.length < MIN_LENGTH_IN_TOLERANCES * READER_TOLERANCE * size {
            let (length, at) = (found.length, brep.ends(e as u32)[0]);
            made.failures.push(Finding::ShortEdge { length, at });
        }
    }
    if made.gap > limits[1] {
        made.failures.push(Finding::Gap(made.gap));
    } else if made.exact_gap > limits[0] {
        made.failures.push(Finding::Gap(made.exact_gap));
    }
    if made.smooth_angle > largest_kink(limits[1], size) {
        made.failures.push(Finding::Kink(made.smooth_angle));
    }
    let seen = deviations(brep, control)?.into_iter().enumerate();
    // Edges may lie off their surfaces by a gap, which is checked separately.
    if let Some((e, by)) = seen.max_by(|a, b| a.1.total_cmp(&b.1)) {
        made.is_read_alike = by <= READER_TOLERANCE * size;
        if by > READER_TOLERANCE * size + limits[1] {
            let at = brep.ends(e as u32)[0];
            made.failures.push(Finding::Reading { by, at });
        }
    }
    Ok(())
}

/// The surface of a face at an edge, and the sign of its own normal against the outward one.
type EdgeSide<'a> = (&'a Surface, f64);

/// Measurements along an edge: the largest gap, the length, and the largest angle of a smooth edge
/// (degrees).
#[derive(Default)]
struct AlongEdge {
    gap: f64,
    length: f64,
    angle: f64,
}

fn examine_edge(built: &MeshedBrep, e: u32, sides: &[EdgeSide<'_>]) -> AlongEdge {
    let brep = &built.brep;
    let mut found = AlongEdge::default();
    let mut last: Option<Point3> = None;
    for s in samples(&brep.breaks(e)) {
        let p = brep.along(e, s).0;
        let all = sides.iter().map(|s| s.0);
        found.gap = worse(found.gap, crate::newton::gap(all, p));
        found.gap = worse(found.gap, crate::newton::gap(&built.meeting[e as usize], p));
        found.length += last.map_or(0.0, |q| norm(sub(p, q)));
        last = Some(p);
        if let [(a, sense_a), (b, sense_b)] = sides
            && 0.0 < s
            && s < 1.0
        {
            let n = [a, b].map(|s| s.distance(p).1);
            let cos = sense_a * sense_b * dot(n[0], n[1]);
            let angle = norm(cross(n[0], n[1])).atan2(cos).to_degrees();
            // Faces that meet at less than five degrees are meant to be smooth.
            if angle < 5.0 {
                // An edge of the model itself, at a small angle, is not a kink.
                let own = angle_between(&built.beside[e as usize], p);
                found.angle = found.angle.max((angle - own).abs());
            }
        }
    }
    for (s, end) in [0.0, 1.0].into_iter().zip(brep.ends(e)) {
        found.gap = worse(found.gap, norm(sub(brep.along(e, s).0, end)));
    }
    found
}

/// Returns the angle at which two loci cross at a point (degrees).
fn angle_between(loci: &[Locus; 2], p: Point3) -> f64 {
    let [a, b] = loci.each_ref().map(|l| l.distance(p).1);
    norm(cross(a, b)).atan2(dot(a, b).abs()).to_degrees()
}

/// Returns parameters along an edge, several in each of its pieces, with both ends.
fn samples(breaks: &[f64]) -> Vec<f64> {
    let within = |w: &[f64]| {
        let (a, b) = (w[0], w[1]);
        (0..SAMPLES_PER_PIECE).map(move |k| a + (b - a) * k as f64 / SAMPLES_PER_PIECE as f64)
    };
    let inner = breaks.windows(2).flat_map(within);
    inner.chain(breaks.last().copied()).collect()
}

/// Returns the largest distance of a face from the function of its part: |F| / |∇F| at points of
/// the surface near the middles of its triangles.
fn distance_of_face(built: &MeshedBrep, solid: &dyn Solid, face: usize) -> f64 {
    let MeshedBrep { brep, .. } = built;
    let surface = &brep.faces[face].surface;
    let own: Vec<usize> = (0..built.triangles.len())
        .filter(|t| built.face_of[*t] as usize == face)
        .collect();
    // About 200 triangles of a face are compared.
    let every = own.len().div_ceil(200).max(1);
    let mut worst = 0.0f64;
    for t in own.into_iter().step_by(every) {
        let name = &built.part_names[built.part_of[t] as usize];
        let Some(piece) = solid.names().iter().position(|n| n == name) else {
            return f64::INFINITY;
        };
        let corners = built.triangles[t].map(|v| built.points[v as usize]);
        let p = meet([surface], middle(corners));
        let (value, g) = solid.gradient(piece as u32, p);
        worst = worse(worst, value.abs() / norm(g));
    }
    worst
}

/// Checks that edges and vertices are on the surface of the model, not only on the pieces that meet
/// there.
fn examine_places(built: &MeshedBrep, solid: &dyn Solid, tolerance: f64, made: &mut Certificate) {
    let brep = &built.brep;
    let along = (0..brep.edges.len() as u32).flat_map(|e| {
        let places = samples(&brep.breaks(e)).into_iter();
        places.map(move |s| brep.along(e, s).0)
    });
    let places = brep.vertices.iter().copied().chain(along);
    let off = places.map(|p| (p, Boundary(solid).distance(p).0.abs()));
    let worst = off.max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((at, by)) = worst.filter(|w| w.1.is_nan() || w.1 > tolerance) {
        made.failures.push(Finding::OffModel { at, by });
    }
}

/// Returns a witness; if it is farther than `near` from the surface of the model, the point of that
/// surface next to it, since a piece extends beyond the one that bounds it. If no such point is
/// found the witness is returned unchanged: it is not shown to be wrong.
fn on_model(solid: &dyn Solid, witness: Point3, near: f64) -> Point3 {
    let model = Boundary(solid);
    let is_on = |p: Point3| model.distance(p).0.abs() <= near;
    if is_on(witness) {
        return witness;
    }
    let moved = meet([&model], witness);
    if is_on(moved) { moved } else { witness }
}

/// Checks that points of the model's surface are on faces; the limits are those of exact faces, and
/// of splines.
fn examine_witnesses(
    built: &MeshedBrep,
    witnesses: &[Point3],
    limits: [f64; 2],
    made: &mut Certificate,
) {
    let mut boxes = vec![Aabb::from_points([]); built.brep.faces.len()];
    for (corners, f) in built.triangles.iter().zip(&built.face_of) {
        for v in corners {
            boxes[*f as usize].add(built.points[*v as usize]);
        }
    }
    let faces: Vec<(Aabb, &Surface)> = boxes
        .into_iter()
        .zip(built.brep.faces.iter().map(|f| &f.surface))
        .collect();
    // A face may extend beyond its nodes by less than this: what the chords of its borders cut off.
    let reach = 0.02 * built.size;
    // The distance of the nearest face, and true if it is too large.
    let next = |p: Point3| {
        let near = faces.iter().filter(|(own, _)| {
            (0..3).all(|i| own.lo[i] - reach <= p[i] && p[i] <= own.hi[i] + reach)
        });
        near.map(|(_, surface)| {
            let by = surface.distance(p).0.abs();
            let is_spline = surface.is_near_only();
            (by, by > limits[usize::from(is_spline)])
        })
        .min_by(|a, b| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0)))
    };
    let far = witnesses.iter().find_map(|&at| match next(at) {
        Some((_, false)) => None,
        Some((by, true)) => Some(Finding::Missed { at, by }),
        None => Some(Finding::Missed { at, by: reach }),
    });
    made.failures.extend(far);
}

/// Compares areas and the volume with those of the mesh.
fn examine_measures(built: &MeshedBrep, made: &mut Certificate) {
    let MeshedBrep {
        brep,
        points,
        triangles,
        face_of,
        size,
        ..
    } = built;
    let mut flat = vec![0.0; brep.faces.len()];
    for (t, corners) in triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|v| points[v as usize]);
        flat[face_of[t] as usize] += 0.5 * norm(cross(sub(b, a), sub(c, a)));
    }
    made.smallest_face = f64::INFINITY;
    for (f, &mesh) in flat.iter().enumerate() {
        let found = made.faces[f].area;
        let face = brep.face_name(f);
        made.smallest_face = made.smallest_face.min(found);
        // Chords of a small face may be long.
        let allowed = 0.15 * mesh + 1e-4 * size * size;
        if found.is_nan() || (found - mesh).abs() > allowed {
            let face = face.clone();
            made.failures.push(Finding::Area { face, found, mesh });
        }
        if found < (MIN_LENGTH_IN_TOLERANCES * READER_TOLERANCE * size).powi(2) {
            made.failures.push(Finding::SmallFace { face, area: found });
        }
    }
    let (limit, change) = limit_of_volume(built);
    made.mesh_limit = limit;
    let found = made.total.volume;
    // A tenth of the change is the accuracy of the extrapolation; nodes next to seams may be off
    // their surfaces, which takes a little more.
    let allowed = 1e-4 * limit.abs() + 0.1 * change;
    if found.is_nan() || (found - made.mesh_limit).abs() > allowed {
        let limit = made.mesh_limit;
        made.failures.push(Finding::Volume { found, limit });
    }
}

/// Returns the limit of the volumes of finer meshes, by Richardson extrapolation from the mesh and
/// the one with nodes added on the surfaces at the middles of its edges, and the difference of
/// these two volumes.
fn limit_of_volume(built: &MeshedBrep) -> (f64, f64) {
    let (brep, faces) = (&built.brep, &built.face_of);
    let surface = |t: usize| &brep.faces[faces[t] as usize].surface;
    let mut sides: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (t, corners) in built.triangles.iter().enumerate() {
        for k in 0..3 {
            let [a, b] = ends_of(corners, k);
            sides.entry([a.min(b), a.max(b)]).or_default().push(t);
        }
    }
    let mut points = built.points.clone();
    let mut mids: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for (ends, at) in sides {
        let [p, q] = ends.map(|v| points[v as usize]);
        let half = std::array::from_fn(|k| 0.5 * (p[k] + q[k]));
        let on = meet(at.iter().map(|t| surface(*t)), half);
        mids.insert(ends, points.len() as u32);
        points.push(if norm(sub(on, half)) <= norm(sub(p, q)) {
            on
        } else {
            half
        });
    }
    let mid = |a: u32, b: u32| mids[&[a.min(b), a.max(b)]];
    let fine: Vec<[u32; 3]> = built
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| {
            let (ab, bc, ca) = (mid(a, b), mid(b, c), mid(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        })
        .collect();
    let (coarse, fine) = (volume(&points, &built.triangles), volume(&points, &fine));
    (fine + (fine - coarse) / 3.0, (fine - coarse).abs())
}
