//! Edges and fans of triangles around one node.
//!
//! A fan is a set of a node's triangles that are connected across edges of exactly two triangles. A
//! surface is a manifold at a node if its triangles form one fan, closed or open.

use super::shells::Shells;
use super::{Triangles, is_degenerate, middle};
use crate::stars::Stars;
use crate::{Defects, Place};
use isoform_geom::UnionFind;

/// Results for one run of nodes; the defects are explained at [`Surface`](super::Surface).
#[derive(Default)]
pub(super) struct FanRun {
    /// Number of nodes in triangles.
    pub(super) nodes: usize,
    /// Edges of one triangle.
    pub(super) open: Defects,
    /// Edges of more than two triangles.
    pub(super) crowded: Defects,
    /// Edges of two triangles that run along them in one direction.
    pub(super) misoriented: Defects,
    /// Nodes with more than one fan.
    pub(super) pinched: Defects,
    /// Triangles with the corners of another one.
    pub(super) repeated: Defects,
    /// Number of edges that belong to each node of the run, with the node's shell: (shell, edges).
    pub(super) edges: Vec<(u32, u32)>,
    /// Shells with an edge or node that is not as in a closed manifold.
    pub(super) broken: Vec<u32>,
}

/// An edge at a node, as one triangle has it: (other end, triangle, true if the triangle runs from
/// the node to the other end).
type Spoke = (u32, u32, bool);

/// A triangle at its lowest corner: its other corners in ascending order, and its index.
type Apex = ([u32; 2], u32);

/// Buffers reused for each node.
#[derive(Default)]
pub(super) struct FanBuffers {
    /// Spokes, sorted so that all of one edge are adjacent.
    spokes: Vec<Spoke>,
    /// Union-find over the triangles around the node.
    fan: UnionFind,
    /// Triangles of which the node is the lowest corner.
    apexes: Vec<Apex>,
}

impl FanBuffers {
    /// Collects the spokes and apexes of a node.
    fn collect(&mut self, triangles: &[[u32; 3]], around: &[u32], u: u32) {
        self.spokes.clear();
        self.apexes.clear();
        for (local, &k) in around.iter().enumerate() {
            let t = triangles[k as usize];
            if is_degenerate(&t) {
                continue;
            }
            let at = t.iter().position(|&i| i == u).unwrap_or(0);
            let (next, last) = (t[(at + 1) % 3], t[(at + 2) % 3]);
            self.spokes.push((next, local as u32, true));
            self.spokes.push((last, local as u32, false));
            if u < next && u < last {
                self.apexes.push(([next.min(last), next.max(last)], k));
            }
        }
        self.spokes.sort_unstable();
        self.apexes.sort_unstable();
    }

    /// Counts the fans: parts connected across edges of exactly two triangles.
    fn fans(&mut self, triangles: usize) -> usize {
        self.fan.reset(triangles);
        let mut fans = self.spokes.len() / 2;
        for group in self.spokes.chunk_by(|a, b| a.0 == b.0) {
            if let [a, b] = group {
                fans -= usize::from(self.fan.unite(a.1, b.1));
            }
        }
        fans
    }
}

/// The triangles around each node, and its shell.
pub(super) struct Surroundings<'m> {
    pub(super) of: Triangles<'m>,
    pub(super) stars: Stars,
    pub(super) shells: Shells,
    /// Maximum number of places kept per kind of defect.
    pub(super) room: usize,
}

impl Surroundings<'_> {
    /// Returns true if a triangle has both nodes.
    pub(super) fn has_edge(&self, a: u32, b: u32) -> bool {
        let mut around = self.stars.elements_at(a as usize).iter();
        around.any(|&k| self.of.triangles[k as usize].contains(&b))
    }

    /// Examines one node and its edges to nodes of higher index.
    pub(super) fn look_at(&self, node: usize, work: &mut FanBuffers, run: &mut FanRun) {
        let around = self.stars.elements_at(node);
        work.collect(self.of.triangles, around, node as u32);
        if work.spokes.is_empty() {
            return;
        }
        run.nodes += 1;
        let shell = self.shells.of[node];
        let (edges, mut whole) = self.edges(node, &work.spokes, run);
        run.edges.push((shell, edges));
        let fans = work.fans(around.len());
        if fans > 1 {
            whole = false;
            run.pinched.add(self.room, || Place {
                at: self.of.points[node],
                nodes: vec![node as u32],
                elements: around.to_vec(),
                value: fans as f64,
            });
        }
        whole &= !self.add_repeated(node, &work.apexes, &mut run.repeated);
        if !whole {
            run.broken.push(shell);
        }
    }

    /// Adds the triangles with this lowest node whose other corners belong to another one, too.
    /// Returns true if there are any.
    fn add_repeated(&self, node: usize, apexes: &[Apex], repeated: &mut Defects) -> bool {
        let before = repeated.count;
        for pair in apexes.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            repeated.add(self.room, || Place {
                at: self.of.points[node],
                nodes: vec![node as u32, pair[0].0[0], pair[0].0[1]],
                elements: vec![pair[0].1, pair[1].1],
                value: 0.0,
            });
        }
        repeated.count > before
    }

    /// Counts the edges to nodes of higher index and adds their defects. Also returns true if each
    /// has two triangles that run along it in opposite directions.
    fn edges(&self, node: usize, spokes: &[Spoke], run: &mut FanRun) -> (u32, bool) {
        let (u, around) = (node as u32, self.stars.elements_at(node));
        let (mut edges, mut whole) = (0, true);
        for group in spokes.chunk_by(|a, b| a.0 == b.0) {
            let w = group[0].0;
            if w < u {
                continue;
            }
            edges += 1;
            let defects = match group {
                [_] => &mut run.open,
                [a, b] if a.2 != b.2 => continue,
                [_, _] => &mut run.misoriented,
                _ => &mut run.crowded,
            };
            whole = false;
            defects.add(self.room, || Place {
                at: middle(self.of.points[node], self.of.point(w)),
                nodes: vec![u, w],
                elements: group.iter().map(|s| around[s.1 as usize]).collect(),
                value: group.len() as f64,
            });
        }
        (edges, whole)
    }
}
