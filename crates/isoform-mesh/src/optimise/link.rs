//! The link condition: decides if an edge can be collapsed without changing the topology.

use crate::complex::{BOUNDARY, Complex, NONE, Ring, edge};

/// Symbolic vertex beyond the boundary, joined to each boundary face.
const BEYOND_VERTEX: u32 = NONE;
/// Symbolic vertex joined to each face of a wall between regions: a collapse must also keep the
/// topology of the walls.
const WALL_VERTEX: u32 = NONE - 1;

/// Returns true if pulling one vertex onto the other leaves the complex a manifold: the link
/// condition (Dey, Edelsbrunner, Guha and Nekhayev, Topology preserving edge contraction, 1999).
/// The intersection of the links of both must be the link of their edge.
///
/// Vertices alone do not decide: where the solid is thin, three vertices of the surface may have
/// edges on it and yet an inner face, and its collapse would leave two sheets that meet in an edge.
pub(super) fn keeps_topology(complex: &Complex, ends: [(u32, &[u32]); 2], ring: &Ring) -> bool {
    let [mine, theirs] = ends.map(|(v, star)| Link::of_vertex(complex, v, star));
    let both = Link::of_edge(complex, ring);
    common(&mine.vertices, &theirs.vertices).eq(both.vertices.iter())
        && common(&mine.edges, &theirs.edges).eq(both.edges.iter())
        && common(&mine.triangles, &theirs.triangles).next().is_none()
}

/// Returns the common elements of two sorted lists.
fn common<'l, T: Ord>(a: &'l [T], b: &'l [T]) -> impl Iterator<Item = &'l T> {
    a.iter().filter(|x| b.binary_search(x).is_ok())
}

/// Link of a vertex or an edge: the opposite simplices, sorted.
#[derive(Default)]
struct Link {
    vertices: Vec<u32>,
    edges: Vec<[u32; 2]>,
    triangles: Vec<[u32; 3]>,
}

impl Link {
    fn of_vertex(complex: &Complex, v: u32, star: &[u32]) -> Self {
        let mut link = Self::default();
        for &t in star {
            let place = complex.place(t, v);
            link.triangles.push(complex.face(t, place));
            for i in (0..4).filter(|&i| i != place) {
                let apex = if complex.adjacent[t as usize][i] >= BOUNDARY {
                    BEYOND_VERTEX
                } else if complex.owns(t, i) {
                    WALL_VERTEX
                } else {
                    continue;
                };
                let face = complex.face(t, i);
                link.triangles
                    .push(face.map(|k| if k == v { apex } else { k }));
            }
        }
        for f in &mut link.triangles {
            f.sort_unstable();
            let [a, b, c] = *f;
            link.edges.extend([[a, b], [a, c], [b, c]]);
            link.vertices.extend([a, b, c]);
        }
        link.triangles.sort_unstable();
        link.edges.sort_unstable();
        link.edges.dedup();
        link.vertices.sort_unstable();
        link.vertices.dedup();
        link
    }

    fn of_edge(complex: &Complex, ring: &Ring) -> Self {
        let mut link = Self {
            vertices: ring.link.clone(),
            edges: ring.link.windows(2).map(|l| edge(l[0], l[1])).collect(),
            triangles: Vec::new(),
        };
        let (first, last) = (ring.link[0], ring.link[ring.link.len() - 1]);
        if ring.closed {
            link.edges.push(edge(first, last));
        } else {
            link.vertices.push(BEYOND_VERTEX);
            link.edges
                .extend([[first, BEYOND_VERTEX], [last, BEYOND_VERTEX]]);
        }
        if complex.is_divided() {
            let arcs = complex.arcs(ring);
            let walls = if ring.closed && arcs.len() > 1 { 0 } else { 1 };
            for arc in arcs.iter().skip(walls) {
                link.vertices.push(WALL_VERTEX);
                link.edges.push(edge(arc.link[0], WALL_VERTEX));
            }
            link.vertices.dedup();
        }
        link.vertices.sort_unstable();
        link.edges.sort_unstable();
        link
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::Point3;

    /// A fan of tetrahedra around the upright edge from 0 to 1; vertex 2 is one of its link.
    fn around(n: u32) -> (Complex, Ring) {
        let mut points: Vec<Point3> = vec![[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
        for k in 0..n {
            let a = std::f64::consts::TAU * f64::from(k) / f64::from(n);
            points.push([a.cos(), a.sin(), 0.0]);
        }
        let tets = (0..n).map(|k| [0, 1, 2 + k, 2 + (k + 1) % n]).collect();
        let complex = Complex::new(points, tets);
        let mut ring = Ring::default();
        complex.ring(0, 0, 1, &mut ring);
        (complex, ring)
    }

    #[test]
    fn an_inner_edge_between_boundary_vertices_does_not_collapse() {
        let (mut complex, ring) = around(5);
        assert!(ring.closed);
        let (mut a, mut b) = (Vec::new(), Vec::new());
        complex.star(0, &mut a);
        complex.star(1, &mut b);
        assert!(!keeps_topology(&complex, [(0, &a), (1, &b)], &ring));
        // Edges of the boundary do: from the bottom to a vertex of the equator.
        let mut open = Ring::default();
        assert!(complex.ring_of(0, 2, &mut open) && !open.closed);
        complex.star(2, &mut b);
        assert!(keeps_topology(&complex, [(0, &a), (2, &b)], &open));
    }
}
