//! Measures a mesh: `measure MESH.raw` writes one JSON object. Angles are in degrees; of no
//! elements they are null.

use peers::Raw;

type Vector = [f64; 3];

fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The angle between two vectors, exact to rounding for small and large ones, too.
fn angle(a: Vector, b: Vector) -> f64 {
    let c = cross(a, b);
    dot(c, c).sqrt().atan2(dot(a, b)).to_degrees()
}

/// The six angles between the faces of a tetrahedron: at each edge the angle between the parts of
/// two other edges across it.
fn dihedral_angles(p: [Vector; 4]) -> [f64; 6] {
    [
        [0, 1, 2, 3],
        [0, 2, 1, 3],
        [0, 3, 1, 2],
        [1, 2, 0, 3],
        [1, 3, 0, 2],
        [2, 3, 0, 1],
    ]
    .map(|[i, j, k, l]| {
        let edge = sub(p[j], p[i]);
        angle(cross(edge, sub(p[k], p[i])), cross(edge, sub(p[l], p[i])))
    })
}

/// The three angles of a triangle.
fn angles(p: [Vector; 3]) -> [f64; 3] {
    [[0, 1, 2], [1, 2, 0], [2, 0, 1]].map(|[i, j, k]| angle(sub(p[j], p[i]), sub(p[k], p[i])))
}

/// The smallest and the largest.
fn extremes(all: impl Iterator<Item = f64>) -> String {
    let (lo, hi) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), a| {
        (lo.min(a), hi.max(a))
    });
    if lo <= hi {
        format!("[{lo:.3}, {hi:.3}]")
    } else {
        "null".to_owned()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("measure MESH.raw")?;
    let Raw {
        points,
        triangles,
        tets,
    } = Raw::read(&path)?;
    let dihedral = extremes(
        tets.iter()
            .flat_map(|t| dihedral_angles(t.map(|v| points[v as usize]))),
    );
    let angle = extremes(
        triangles
            .iter()
            .flat_map(|t| angles(t.map(|v| points[v as usize]))),
    );
    let volume: f64 = triangles
        .iter()
        .map(|t| t.map(|v| points[v as usize]))
        .map(|[a, b, c]| dot(a, cross(b, c)) / 6.0)
        .sum();
    println!(
        "{{\"points\": {}, \"triangles\": {}, \"tets\": {}, \"dihedral\": {dihedral}, \"angle\": {angle}, \"volume\": {}}}",
        points.len(),
        triangles.len(),
        tets.len(),
        volume.abs()
    );
    Ok(())
}
