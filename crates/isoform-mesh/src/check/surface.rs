//! Topology of the surface: exact, by indices only.
//!
//! Everything is read off the triangles around each node: an edge belongs to the node with its
//! lower index, and a node's fans are the parts of its triangles that hang together across edges of
//! exactly two triangles.

use super::boxes::BoxTree;
use super::exact::{is_flat, volume_sign};
use super::stars::{Stars, blocks};
use super::{Defects, Options, Place};
use isoform_geom::{Aabb, Point3, cross, dot, norm, sub};
use rayon::prelude::*;

/// Nodes or triangles per task.
const TASK: usize = 8192;
/// Directions that are tried for a ray that meets no edge; each fails only by a coincidence.
const RAYS: u32 = 32;

/// Topology and measure of the surface.
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
    /// Edges of two triangles that run along them in the same direction.
    pub misoriented_edges: Defects,
    /// Nodes whose triangles are not one fan (or one open fan).
    pub pinched_nodes: Defects,
    /// Triangles whose corners another triangle before them has, too.
    pub repeated_triangles: Defects,
    /// Triangles with a corner twice; they are left out of everything else.
    pub degenerate_triangles: Defects,
    /// Triangles whose corners lie exactly on a line.
    pub flat_triangles: Defects,
    /// Feature edges of the mesh that are no edges of its triangles.
    pub loose_edges: Defects,
    /// Nodes − edges + triangles.
    pub euler: i64,
    /// Number of shells: parts that hang together by nodes.
    pub shells: usize,
    /// Number of shells that enclose a positive volume: the components of the solid. The others
    /// bound cavities.
    pub components: usize,
    /// Shells whose orientation contradicts where they lie: a component that is not in the open, or
    /// a cavity that is not in exactly one component more than it leaves. The value is the number
    /// of times that the other shells wind around them. Only looked for on closed surfaces that are
    /// manifold.
    pub misplaced_shells: Defects,
    /// The shells with the largest area, no more than [`Options::places`].
    pub largest: Vec<Shell>,
    /// Enclosed volume.
    pub volume: f64,
    /// Area.
    pub area: f64,
}

/// A part of the surface that hangs together by nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shell {
    /// Its lowest node.
    pub node: u32,
    /// Number of triangles.
    pub triangles: usize,
    /// Nodes − edges + triangles.
    pub euler: i64,
    /// Number of handles, of a closed and consistently oriented manifold.
    pub genus: Option<u64>,
    /// Enclosed volume; negative around a cavity.
    pub volume: f64,
    /// Area.
    pub area: f64,
}

impl Surface {
    /// Whether it is a closed and consistently oriented manifold without repeated or degenerate
    /// triangles.
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

/// What one run of nodes has.
#[derive(Default)]
struct Run {
    nodes: usize,
    open: Defects,
    crowded: Defects,
    misoriented: Defects,
    pinched: Defects,
    repeated: Defects,
    /// Number of edges at each node of the run that belong to it, by shells.
    edges: Vec<(u32, u32)>,
    /// Shells with an edge or node that is not as in a closed manifold.
    broken: Vec<u32>,
}

/// An edge at a node as a triangle has it: other end, triangle, whether the triangle runs from the
/// node to the other end.
type Spoke = (u32, u32, bool);

fn is_degenerate(t: &[u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[2] == t[0]
}

/// Which triangles have no area, by index or exactly on a line.
pub(super) fn without_area(points: &[Point3], triangles: &[[u32; 3]]) -> Vec<bool> {
    triangles
        .par_iter()
        .map(|t| is_degenerate(t) || is_flat(t.map(|i| points[i as usize])))
        .collect()
}

/// Topology and measure of a surface with feature edges; `flat` is [`without_area`] of it, and the
/// tree that of its triangles.
pub(super) fn examine(
    points: &[Point3],
    triangles: &[[u32; 3]],
    features: &[[u32; 2]],
    flat: &[bool],
    tree: &BoxTree,
    options: &Options<'_>,
) -> Surface {
    let room = options.places;
    let mut surface = Surface {
        triangles: triangles.len(),
        ..Surface::default()
    };
    for (k, t) in triangles.iter().enumerate().filter(|&(k, _)| flat[k]) {
        let place = || Place {
            at: points[t[0] as usize],
            nodes: t.to_vec(),
            elements: vec![k as u32],
            value: 0.0,
        };
        if is_degenerate(t) {
            &mut surface.degenerate_triangles
        } else {
            &mut surface.flat_triangles
        }
        .add(room, place);
    }
    let shell_of = Shells::new(points.len(), triangles);
    let stars = Stars::new(points.len(), triangles);
    for &[a, b] in features {
        if a == b
            || !stars
                .of(a as usize)
                .iter()
                .any(|&k| triangles[k as usize].contains(&b))
        {
            let at = middle(points[a as usize], points[b as usize]);
            surface.loose_edges.add(room, || Place {
                at,
                nodes: vec![a, b],
                ..Place::default()
            });
        }
    }
    let runs: Vec<Run> = blocks(points.len(), TASK)
        .into_par_iter()
        .map(|range| {
            let (mut run, mut work) = (Run::default(), Work::default());
            for node in range {
                work.examine(points, triangles, &stars, node, room, &mut run, &shell_of);
            }
            run
        })
        .collect();
    let mut shells = shell_of.measure(points, triangles);
    let mut broken = vec![false; shells.len()];
    for run in runs {
        surface.nodes += run.nodes;
        surface.open_edges.append(room, run.open);
        surface.crowded_edges.append(room, run.crowded);
        surface.misoriented_edges.append(room, run.misoriented);
        surface.pinched_nodes.append(room, run.pinched);
        surface.repeated_triangles.append(room, run.repeated);
        for (shell, edges) in run.edges {
            surface.edges += edges as usize;
            shells[shell as usize].euler += 1 - i64::from(edges);
        }
        run.broken
            .into_iter()
            .for_each(|shell| broken[shell as usize] = true);
    }
    for (shell, broken) in shells.iter_mut().zip(broken) {
        shell.euler += shell.triangles as i64;
        shell.genus = if broken {
            None
        } else {
            u64::try_from((2 - shell.euler) / 2).ok()
        };
        surface.euler += shell.euler;
        surface.volume += shell.volume;
        surface.area += shell.area;
        surface.components += usize::from(shell.volume > 0.0);
    }
    surface.shells = shells.len();
    if surface.is_closed_manifold() {
        surface.misplaced_shells = misplaced(points, triangles, &shells, &shell_of, tree, room);
    }
    shells.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.node.cmp(&b.node)));
    shells.truncate(room);
    surface.largest = shells;
    surface
}

/// Memory that is used again for each node.
#[derive(Default)]
struct Work {
    spokes: Vec<Spoke>,
    /// Union-find over the triangles around the node.
    fan: Vec<u32>,
    apexes: Vec<([u32; 2], u32)>,
}

impl Work {
    #[expect(
        clippy::too_many_arguments,
        reason = "one loop body, called from one place"
    )]
    fn examine(
        &mut self,
        points: &[Point3],
        triangles: &[[u32; 3]],
        stars: &Stars,
        node: usize,
        room: usize,
        run: &mut Run,
        shells: &Shells,
    ) {
        let around = stars.of(node);
        let u = node as u32;
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
        if self.spokes.is_empty() {
            return;
        }
        run.nodes += 1;
        let shell = shells.of[node];
        self.spokes.sort_unstable();
        self.fan.clear();
        self.fan.extend(0..around.len() as u32);
        let mut fans = self.spokes.len() / 2;
        let (mut edges, mut whole) = (0, true);
        for group in self.spokes.chunk_by(|a, b| a.0 == b.0) {
            if let [a, b] = group {
                let (a, b) = (root(&mut self.fan, a.1), root(&mut self.fan, b.1));
                if a != b {
                    self.fan[a.max(b) as usize] = a.min(b);
                    fans -= 1;
                }
            }
            let w = group[0].0;
            if w < u {
                continue;
            }
            edges += 1;
            let place = || Place {
                at: middle(points[node], points[w as usize]),
                nodes: vec![u, w],
                elements: group.iter().map(|s| around[s.1 as usize]).collect(),
                value: group.len() as f64,
            };
            let defects = match group {
                [_] => &mut run.open,
                [a, b] if a.2 != b.2 => continue,
                [_, _] => &mut run.misoriented,
                _ => &mut run.crowded,
            };
            defects.add(room, place);
            whole = false;
        }
        run.edges.push((shell, edges));
        if fans > 1 {
            let place = || Place {
                at: points[node],
                nodes: vec![u],
                elements: around.to_vec(),
                value: fans as f64,
            };
            run.pinched.add(room, place);
            whole = false;
        }
        self.apexes.sort_unstable();
        for pair in self.apexes.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            let place = || Place {
                at: points[node],
                nodes: vec![u, pair[0].0[0], pair[0].0[1]],
                elements: vec![pair[0].1, pair[1].1],
                value: 0.0,
            };
            run.repeated.add(room, place);
            whole = false;
        }
        if !whole {
            run.broken.push(shell);
        }
    }
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

fn middle(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|i| 0.5 * a[i] + 0.5 * b[i])
}

/// Which nodes hang together.
struct Shells {
    /// Number of the shell of each node that is in a triangle with three corners; shells are
    /// numbered by their lowest nodes.
    of: Vec<u32>,
    /// Lowest node of each shell.
    lowest: Vec<u32>,
}

impl Shells {
    fn new(nodes: usize, triangles: &[[u32; 3]]) -> Self {
        let mut parent: Vec<u32> = (0..nodes as u32).collect();
        let mut used = vec![false; nodes];
        for t in triangles.iter().filter(|t| !is_degenerate(t)) {
            let a = root(&mut parent, t[0]);
            let b = root(&mut parent, t[1]);
            let ab = a.min(b);
            parent[a.max(b) as usize] = ab;
            let c = root(&mut parent, t[2]);
            parent[ab.max(c) as usize] = ab.min(c);
            t.iter().for_each(|&i| used[i as usize] = true);
        }
        // The root is the lowest node, so its number is known when the others are met.
        let (mut of, mut lowest) = (vec![0; nodes], Vec::new());
        for i in 0..nodes {
            let r = root(&mut parent, i as u32) as usize;
            if r == i && used[i] {
                of[i] = lowest.len() as u32;
                lowest.push(i as u32);
            } else {
                of[i] = of[r];
            }
        }
        Self { of, lowest }
    }

    /// Triangles, volume and area of each; volumes about the middle of all, against cancellation.
    fn measure(&self, points: &[Point3], triangles: &[[u32; 3]]) -> Vec<Shell> {
        let o = Aabb::of(triangles.iter().flatten().map(|&i| &points[i as usize])).center();
        let parts: Vec<Vec<(u32, usize, f64, f64)>> = blocks(triangles.len(), TASK)
            .into_par_iter()
            .map(|range| {
                let mut sums: Vec<(u32, usize, f64, f64)> = Vec::new();
                for t in triangles[range].iter().filter(|t| !is_degenerate(t)) {
                    let [a, b, c] = t.map(|i| sub(points[i as usize], o));
                    let n = cross(sub(b, a), sub(c, a));
                    let shell = self.of[t[0] as usize];
                    // Neighbours in the list mostly are neighbours in space.
                    if sums.last().is_none_or(|s| s.0 != shell) {
                        sums.push((shell, 0, 0.0, 0.0));
                    }
                    if let Some(s) = sums.last_mut() {
                        *s = (shell, s.1 + 1, s.2 + dot(a, n) / 6.0, s.3 + 0.5 * norm(n));
                    }
                }
                sums
            })
            .collect();
        let mut shells: Vec<Shell> = self
            .lowest
            .iter()
            .map(|&node| Shell {
                node,
                ..Shell::default()
            })
            .collect();
        for (shell, triangles, volume, area) in parts.into_iter().flatten() {
            let s = &mut shells[shell as usize];
            s.triangles += triangles;
            s.volume += volume;
            s.area += area;
        }
        shells
    }
}

/// Shells that the others wind around another number of times than their orientation wants: 0 for a
/// component, 1 for a cavity.
///
/// The number is counted along a ray, each passage with its sign, exactly; a ray that meets an edge
/// is given up for another one. A shell that touches others has no such number; touching is an
/// intersection, and reported as one.
fn misplaced(
    points: &[Point3],
    triangles: &[[u32; 3]],
    shells: &[Shell],
    of: &Shells,
    tree: &BoxTree,
    room: usize,
) -> Defects {
    let bounds = Aabb::of(triangles.iter().flatten().map(|&i| &points[i as usize]));
    let windings: Vec<Option<i32>> = shells
        .par_iter()
        .map(|shell| {
            let from = points[shell.node as usize];
            (0..RAYS).find_map(|k| {
                winding(
                    points,
                    triangles,
                    of,
                    tree,
                    shell.node,
                    ray_end(from, &bounds, k),
                )
            })
        })
        .collect();
    let mut defects = Defects::default();
    for (shell, winding) in shells.iter().zip(windings) {
        let wanted = i32::from(shell.volume <= 0.0);
        if winding.is_some_and(|w| w != wanted) {
            defects.add(room, || Place {
                at: points[shell.node as usize],
                nodes: vec![shell.node],
                elements: Vec::new(),
                value: winding.map_or(0.0, f64::from),
            });
        }
    }
    defects
}

/// A point beyond the bounds, nearly along +x so that the ray's box is thin; another one for each
/// k.
fn ray_end(from: Point3, bounds: &Aabb, k: u32) -> Point3 {
    let reach = bounds.diagonal();
    // Two sequences of low discrepancy (golden ratio and √2), as far from rational slopes as
    // numbers get.
    let (s, t) = (
        f64::from(k + 1) * 0.618_033_988_749_894_9,
        f64::from(k + 1) * 0.414_213_562_373_095_03,
    );
    let tilt = 1e-3 * reach * f64::from(k + 1);
    [
        bounds.hi[0] + reach,
        from[1] + tilt * (s.fract() - 0.5),
        from[2] + tilt * (t.fract() - 0.5),
    ]
}

/// How many times the other shells wind around a node; `None` if the segment to the outside meets
/// one of their edges.
fn winding(
    points: &[Point3],
    triangles: &[[u32; 3]],
    of: &Shells,
    tree: &BoxTree,
    node: u32,
    end: Point3,
) -> Option<i32> {
    let from = points[node as usize];
    let (mut count, mut certain) = (0, true);
    tree.query(&Aabb::of(&[from, end]), |k| {
        let t = triangles[k as usize];
        if of.of[t[0] as usize] == of.of[node as usize] {
            return;
        }
        let [a, b, c] = t.map(|i| points[i as usize]);
        let (s, e) = (volume_sign(a, b, c, from), volume_sign(a, b, c, end));
        if s * e > 0 {
            return;
        }
        let sides = [
            volume_sign(from, end, a, b),
            volume_sign(from, end, b, c),
            volume_sign(from, end, c, a),
        ];
        if sides.contains(&1) && sides.contains(&-1) {
            return;
        }
        if s == 0 || e == 0 || sides.contains(&0) {
            certain = false;
        }
        // The ray leaves through a triangle that is counterclockwise seen from its end.
        count += i32::from(e);
    });
    certain.then_some(count)
}
