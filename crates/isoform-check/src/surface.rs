//! Topology of the surface, determined exactly from indices.
//!
//! Everything is derived from the triangles around each node (`fans`): an edge belongs to the node
//! with its lower index, and a node's fans are the parts of its triangles that are connected across
//! edges of exactly two triangles. Parts of the surface that are connected by nodes are shells
//! (`shells`).

mod fans;
mod shells;

use super::boxes::BoxTree;
use super::exact::is_flat;
use super::stars::{Stars, blocks};
use super::{Defects, Options, Place};
use fans::{FanBuffers, FanRun, Surroundings};
use isoform_geom::Point3;
use rayon::prelude::*;
use shells::{Shells, misplaced};

/// Number of nodes or triangles in a task.
const ITEMS_PER_TASK: usize = 8192;

/// Topology, volume and area of the surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Number of triangles.
    pub triangles: usize,
    /// Number of nodes in triangles.
    pub nodes: usize,
    /// Number of edges.
    pub edges: usize,
    /// Edges of one triangle.
    pub open_edges: Defects,
    /// Edges of more than two triangles.
    pub crowded_edges: Defects,
    /// Edges of two triangles that run along them in one direction.
    pub misoriented_edges: Defects,
    /// Nodes whose triangles do not form a single fan, closed or open.
    pub pinched_nodes: Defects,
    /// Triangles with the corners of an earlier triangle.
    pub repeated_triangles: Defects,
    /// Triangles with a repeated corner; all other counts leave them out.
    pub degenerate_triangles: Defects,
    /// Triangles whose corners are exactly collinear.
    pub flat_triangles: Defects,
    /// Feature edges of the mesh that are not edges of its triangles.
    pub loose_edges: Defects,
    /// Euler characteristic: nodes − edges + triangles.
    pub euler: i64,
    /// Number of shells: parts connected by nodes.
    pub shells: usize,
    /// Number of shells that enclose a positive volume: the components of the solid. The others
    /// bound cavities.
    pub components: usize,
    /// Shells whose orientation contradicts their position: a component that does not lie outside,
    /// or a cavity that does not lie in exactly one component more than in cavities. The value is
    /// the winding number of the other shells around them. Tested only on closed manifold surfaces.
    pub misplaced_shells: Defects,
    /// Shells with the largest area, at most [`Options::places`].
    pub largest: Vec<Shell>,
    /// Enclosed volume, if the surface is closed.
    pub volume: f64,
    /// Area.
    pub area: f64,
}

/// A part of the surface that is connected by nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shell {
    /// Lowest node of the shell.
    pub node: u32,
    /// Number of triangles.
    pub triangles: usize,
    /// Euler characteristic: nodes − edges + triangles.
    pub euler: i64,
    /// Number of handles; `None` unless the shell is a closed, consistently oriented manifold.
    pub genus: Option<u64>,
    /// Enclosed volume; negative around a cavity.
    pub volume: f64,
    /// Area.
    pub area: f64,
}

impl Surface {
    /// Returns the enclosed volume; `None` if the surface has a border.
    pub fn enclosed(&self) -> Option<f64> {
        self.open_edges.is_empty().then_some(self.volume)
    }

    /// Returns true if the surface is a closed and consistently oriented manifold without repeated
    /// or degenerate triangles.
    pub fn is_closed_manifold(&self) -> bool {
        [
            &self.open_edges,
            &self.crowded_edges,
            &self.misoriented_edges,
            &self.pinched_nodes,
            &self.repeated_triangles,
            &self.degenerate_triangles,
        ]
        .iter()
        .all(|d| d.is_empty())
    }
}

/// Triangles of a surface.
#[derive(Clone, Copy)]
pub(super) struct Triangles<'m> {
    pub(super) points: &'m [Point3],
    pub(super) triangles: &'m [[u32; 3]],
}

impl Triangles<'_> {
    /// Returns the point of a node.
    fn point(&self, node: u32) -> Point3 {
        self.points[node as usize]
    }
    /// Returns the points of a triangle's corners.
    pub(super) fn corners(&self, t: [u32; 3]) -> [Point3; 3] {
        t.map(|i| self.point(i))
    }
}

/// Returns true if a triangle has a repeated corner.
fn is_degenerate(t: &[u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[2] == t[0]
}

/// Returns the midpoint of an edge.
fn middle(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|i| 0.5 * a[i] + 0.5 * b[i])
}

/// Marks the triangles without area, by index or exactly collinear.
pub(super) fn without_area(of: Triangles<'_>) -> Vec<bool> {
    of.triangles
        .par_iter()
        .map(|t| is_degenerate(t) || is_flat(of.corners(*t)))
        .collect()
}

/// Examines the topology of a surface with feature edges, and measures it; `flat` is
/// [`without_area`] of it, and `tree` that of its triangles.
pub(super) fn examine(
    of: Triangles<'_>,
    features: &[[u32; 2]],
    flat: &[bool],
    tree: &BoxTree,
    options: &Options<'_>,
) -> Surface {
    let room = options.places;
    let mut surface = Surface {
        triangles: of.triangles.len(),
        ..Surface::default()
    };
    surface.add_without_area(of, flat, room);
    let around = Surroundings {
        of,
        stars: Stars::new(of.points.len(), of.triangles),
        shells: Shells::new(of),
        room,
    };
    surface.add_loose_edges(&around, features);
    let runs: Vec<FanRun> = blocks(of.points.len(), ITEMS_PER_TASK)
        .into_par_iter()
        .map(|range| {
            let (mut run, mut work) = (FanRun::default(), FanBuffers::default());
            for node in range {
                around.look_at(node, &mut work, &mut run);
            }
            run
        })
        .collect();
    let mut shells = around.shells.measure(of);
    surface.add_runs(runs, &mut shells, room);
    surface.shells = shells.len();
    if surface.is_closed_manifold() {
        surface.misplaced_shells = misplaced(of, &shells, &around.shells, tree, room);
    }
    shells.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.node.cmp(&b.node)));
    shells.truncate(room);
    surface.largest = shells;
    surface
}

impl Surface {
    /// Adds the triangles without area: degenerate by index, or collinear by exact sign.
    fn add_without_area(&mut self, of: Triangles<'_>, flat: &[bool], room: usize) {
        for (k, t) in of.triangles.iter().enumerate().filter(|&(k, _)| flat[k]) {
            let defects = if is_degenerate(t) {
                &mut self.degenerate_triangles
            } else {
                &mut self.flat_triangles
            };
            defects.add(room, || Place {
                at: of.point(t[0]),
                nodes: t.to_vec(),
                elements: vec![k as u32],
                value: 0.0,
            });
        }
    }

    /// Adds the feature edges that are not edges of triangles.
    fn add_loose_edges(&mut self, around: &Surroundings<'_>, features: &[[u32; 2]]) {
        for &[a, b] in features {
            if a == b || !around.has_edge(a, b) {
                self.loose_edges.add(around.room, || Place {
                    at: middle(around.of.point(a), around.of.point(b)),
                    nodes: vec![a, b],
                    ..Place::default()
                });
            }
        }
    }

    /// Adds the defects of the runs of nodes, and completes the shells by their edges.
    fn add_runs(&mut self, runs: Vec<FanRun>, shells: &mut [Shell], room: usize) {
        let mut broken = vec![false; shells.len()];
        for run in runs {
            self.nodes += run.nodes;
            self.open_edges.append(room, run.open);
            self.crowded_edges.append(room, run.crowded);
            self.misoriented_edges.append(room, run.misoriented);
            self.pinched_nodes.append(room, run.pinched);
            self.repeated_triangles.append(room, run.repeated);
            for (shell, edges) in run.edges {
                self.edges += edges as usize;
                shells[shell as usize].euler += 1 - i64::from(edges);
            }
            for shell in run.broken {
                broken[shell as usize] = true;
            }
        }
        for (shell, broken) in shells.iter_mut().zip(broken) {
            shell.euler += shell.triangles as i64;
            shell.genus = if broken { None } else { genus(shell.euler) };
            self.add_shell(shell);
        }
    }

    /// Adds the measures of a shell.
    fn add_shell(&mut self, shell: &Shell) {
        self.euler += shell.euler;
        self.volume += shell.volume;
        self.area += shell.area;
        self.components += usize::from(shell.volume > 0.0);
    }
}

/// Returns the number of handles of a closed orientable surface: χ = 2 − 2g; `None` if χ > 2.
fn genus(euler: i64) -> Option<u64> {
    u64::try_from((2 - euler) / 2).ok()
}
