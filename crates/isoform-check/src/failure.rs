//! Failures of a certificate: defects that no mesh may have, and measures beyond their limits.

use super::{Certificate, Defects, Distances, Place};

/// A defect, or a measure beyond its limit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct Failure {
    /// Kind of failure, as hyphenated words; codes are stable between versions.
    pub code: &'static str,
    /// Description of the failure.
    pub message: String,
    /// Number of defects of the kind.
    pub count: usize,
    /// Place of the first or worst defect; `None` if the failure is not local.
    pub place: Option<Place>,
    /// Further places, as many as were kept.
    pub others: Vec<Place>,
}

/// Collector of failures.
#[derive(Default)]
struct List(Vec<Failure>);

impl List {
    /// Adds a failure if there is any defect of the kind; `one` and `many` name it after the
    /// number.
    fn none(&mut self, code: &'static str, defects: &Defects, one: &str, many: &str) {
        if defects.count > 0 {
            let message = format!(
                "{} {}",
                defects.count,
                if defects.count == 1 { one } else { many }
            );
            self.0.push(Failure {
                code,
                message,
                count: defects.count,
                place: defects.places.first().cloned(),
                others: defects.places.iter().skip(1).cloned().collect(),
            });
        }
    }
    /// Adds one failure.
    fn add(&mut self, code: &'static str, message: String, place: Option<Place>) {
        self.0.push(Failure {
            code,
            message,
            count: 1,
            place,
            others: Vec::new(),
        });
    }
    /// Adds a failure if a measure is below `limit` or NaN.
    fn at_least(
        &mut self,
        code: &'static str,
        what: &str,
        value: f64,
        limit: f64,
        place: Option<&Place>,
    ) {
        if value.is_nan() || value < limit {
            self.add(
                code,
                format!("{what} is {value:.6}, below {limit}"),
                place.cloned(),
            );
        }
    }
    /// Adds a failure if a distance exceeds `limit`.
    fn at_most(&mut self, code: &'static str, what: &str, distances: &Distances, limit: f64) {
        if distances.max > limit {
            let message = format!("{what} is {:.3e}, above {limit:.3e}", distances.max);
            self.add(code, message, distances.worst.clone());
        }
    }
}

/// Returns all defects of a certificate and all measures beyond their limits.
pub(super) fn failures(c: &Certificate) -> Vec<Failure> {
    let mut list = List::default();
    for malformed in &c.malformed {
        list.add("malformed", malformed.to_string(), None);
    }
    surface(c, &mut list);
    intersections(c, &mut list);
    volume(c, &mut list);
    wedges(c, &mut list);
    dihedral_angles(c, &mut list);
    shape(c, &mut list);
    deviation(c, &mut list);
    coverage(c, &mut list);
    opposite(c, &mut list);
    if !c.complete {
        list.add(
            "incomplete",
            "the checks were stopped before their end".to_owned(),
            None,
        );
    }
    if c.malformed.is_empty() && c.complete && c.surface.is_none() {
        list.add("empty", "the mesh has no elements".to_owned(), None);
    }
    list.0
}

/// Adds the defects of the surface's topology.
fn surface(c: &Certificate, list: &mut List) {
    if let Some(s) = &c.surface {
        if !c.limits.has_border {
            list.none(
                "open-edge",
                &s.open_edges,
                "edge of one triangle only",
                "edges of one triangle only",
            );
        }
        list.none(
            "crowded-edge",
            &s.crowded_edges,
            "edge of more than two triangles",
            "edges of more than two triangles",
        );
        let (one, many) = (
            "edge between triangles of opposite orientation",
            "edges between triangles of opposite orientation",
        );
        list.none("misoriented-edge", &s.misoriented_edges, one, many);
        let (one, many) = (
            "node where the surface is pinched",
            "nodes where the surface is pinched",
        );
        list.none("pinched-node", &s.pinched_nodes, one, many);
        list.none(
            "repeated-triangle",
            &s.repeated_triangles,
            "repeated triangle",
            "repeated triangles",
        );
        list.none(
            "degenerate-triangle",
            &s.degenerate_triangles,
            "triangle with a corner twice",
            "triangles with a corner twice",
        );
        list.none(
            "flat-triangle",
            &s.flat_triangles,
            "triangle without area",
            "triangles without area",
        );
        let (one, many) = (
            "feature edge that is no edge of a triangle",
            "feature edges that are no edges of triangles",
        );
        list.none("loose-edge", &s.loose_edges, one, many);
        let (one, many) = (
            "shell that is turned the wrong way for its place",
            "shells that are turned the wrong way for their place",
        );
        list.none("misplaced-shell", &s.misplaced_shells, one, many);
    }
}

/// Adds the self-intersections of the surface.
fn intersections(c: &Certificate, list: &mut List) {
    let Some(i) = &c.intersections else { return };
    list.none(
        "self-intersection",
        &i.pairs,
        "pair of triangles that intersect",
        "pairs of triangles that intersect",
    );
    if !i.complete && c.complete {
        list.add(
            "self-intersections-uncounted",
            "too many self-intersections to find them all".to_owned(),
            None,
        );
    }
}

/// Adds the inverted wedges.
fn wedges(c: &Certificate, list: &mut List) {
    if let Some(w) = &c.wedges {
        let (one, many) = (
            "wedge that is not positive everywhere",
            "wedges that are not positive everywhere",
        );
        list.none("inverted-wedge", &w.inverted, one, many);
    }
}

/// Adds the defects of the tetrahedra.
fn volume(c: &Certificate, list: &mut List) {
    if let Some(v) = &c.volume {
        list.none(
            "inverted-tet",
            &v.inverted,
            "inverted tetrahedron",
            "inverted tetrahedra",
        );
        list.none(
            "flat-tet",
            &v.flat,
            "tetrahedron without volume",
            "tetrahedra without volume",
        );
        list.none(
            "crowded-face",
            &v.crowded_faces,
            "face of more than two tetrahedra",
            "faces of more than two tetrahedra",
        );
        let (one, many) = (
            "face with both tetrahedra on one side",
            "faces with both tetrahedra on one side",
        );
        list.none("folded-face", &v.folded_faces, one, many);
        let (one, many) = (
            "outer face that is no triangle of the surface",
            "outer faces that are no triangles of the surface",
        );
        list.none("uncovered-face", &v.uncovered_faces, one, many);
        list.none(
            "inward-triangle",
            &v.inward_triangles,
            "triangle that is turned inward",
            "triangles that are turned inward",
        );
        list.none(
            "inner-triangle",
            &v.inner_triangles,
            "triangle between two tetrahedra",
            "triangles between two tetrahedra",
        );
        let (one, many) = (
            "triangle that is no face of a tetrahedron",
            "triangles that are no faces of a tetrahedron",
        );
        list.none("loose-triangle", &v.loose_triangles, one, many);
        let (one, many) = (
            "mid node that is not that of one edge alone",
            "mid nodes that are not those of one edge alone",
        );
        list.none("mid-node", &v.mid_nodes, one, many);
    }
}

/// Adds distances from the solid beyond their limits, and labels or nodes that do not match the
/// solid.
fn deviation(c: &Certificate, list: &mut List) {
    let Some(d) = &c.deviation else { return };
    if !d.unknown_parts.is_empty() {
        let message = format!(
            "labels that are no parts of the solid: {}",
            d.unknown_parts.join(", ")
        );
        list.add("unknown-part", message, None);
    }
    let limit = c.limits.node_distance * d.diagonal;
    list.at_most(
        "node-off-surface",
        "the distance of a node to its part",
        &d.nodes,
        limit,
    );
    list.at_most(
        "mid-node-off-surface",
        "the distance of a mid node to its part",
        &d.mids,
        limit,
    );
    list.at_most(
        "curve-node-off-surface",
        "the distance of a node on a curve to a part of the curve",
        &d.curves,
        limit,
    );
    list.at_most(
        "chord",
        "the distance of a face to its part",
        &d.faces,
        c.limits.chord,
    );
    let (one, many) = (
        "node on a part where that is not the surface",
        "nodes on parts where those are not the surface",
    );
    list.none("misclassified-node", &d.misclassified, one, many);
}

/// Adds feature curves without edges, and corners without nodes.
fn coverage(c: &Certificate, list: &mut List) {
    let Some(f) = &c.coverage else { return };
    let what = "the share of the feature curves that has edges";
    list.at_least(
        "uncovered-curve",
        what,
        f.covered,
        c.limits.covered,
        f.uncovered.places.first(),
    );
    list.none(
        "missed-corner",
        &f.missed_corners,
        "corner without a node",
        "corners without a node",
    );
}

/// Adds mismatches between opposite sides of a unit cell.
fn opposite(c: &Certificate, list: &mut List) {
    for sides in &c.opposite {
        list.none(
            "sides-apart",
            &sides.apart,
            "node or triangle without a partner on the opposite side",
            "nodes and triangles without a partner on the opposite side",
        );
    }
}

/// Adds dihedral angles beyond their limits.
fn dihedral_angles(c: &Certificate, list: &mut List) {
    let Some(q) = &c.tets else { return };
    let place = q.worst.first();
    list.at_least(
        "small-dihedral-angle",
        "the smallest dihedral angle",
        q.dihedral_min,
        c.limits.dihedral_min,
        place,
    );
    if q.dihedral_max.is_nan() || q.dihedral_max > c.limits.dihedral_max {
        let message = format!(
            "the largest dihedral angle is {:.6}, above {}",
            q.dihedral_max, c.limits.dihedral_max
        );
        list.add("large-dihedral-angle", message, place.cloned());
    }
}

/// Adds angles of triangles and Jacobians of curved tetrahedra below their limits.
fn shape(c: &Certificate, list: &mut List) {
    if let Some(q) = &c.triangles {
        list.at_least(
            "small-angle",
            "the smallest angle of a triangle",
            q.angle_min,
            c.limits.angle_min,
            q.worst.first(),
        );
    }
    if let Some(q) = &c.curved {
        let (one, many) = (
            "tetrahedron with a negative Jacobian",
            "tetrahedra with a negative Jacobian",
        );
        list.none("negative-jacobian", &q.negative, one, many);
        if q.negative.is_empty() {
            let limit = c.limits.scaled_jacobian_min;
            list.at_least(
                "small-jacobian",
                "the smallest scaled Jacobian",
                q.scaled_jacobian_min,
                limit,
                q.worst.first(),
            );
        }
    }
}
