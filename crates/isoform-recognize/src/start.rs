//! Initial guesses of surfaces from points and their normals.

use crate::chart::{Primitive, PrimitiveKind, frame, unit};
use crate::fit::mean;
use isoform_geom::{Point3, cross, dot, norm, sub};
use isoform_num::linalg::{cholesky, cholesky_solve, symmetric_eigen};

/// Returns initial guesses for a kind of surface; several if the points are ambiguous.
pub(crate) fn starts(kind: PrimitiveKind, points: &[Point3], normals: &[Point3]) -> Vec<Primitive> {
    match kind {
        PrimitiveKind::Plane => vec![plane(points)],
        PrimitiveKind::Sphere => sphere(points).into_iter().collect(),
        PrimitiveKind::Cylinder => axes(points, normals)
            .into_iter()
            .filter_map(|axis| cylinder(points, axis))
            .collect(),
        PrimitiveKind::Cone => cones(points, normals),
        PrimitiveKind::Torus => tori(points, normals),
    }
}

/// An axis: a point of it and its direction.
pub(crate) type Axis = (Point3, Point3);

/// Returns the initial guess for a kind of surface about a known axis: a straight line or a circle
/// through the profile of the points, whatever the normals are. `None` for kinds without an axis.
pub(crate) fn start_about(kind: PrimitiveKind, points: &[Point3], axis: Axis) -> Option<Primitive> {
    match kind {
        PrimitiveKind::Plane | PrimitiveKind::Sphere => None,
        PrimitiveKind::Cylinder | PrimitiveKind::Cone => cone_about(kind, points, axis),
        PrimitiveKind::Torus => torus_about(points, axis.0, axis.1),
    }
}

/// Returns the cone about an axis, or the cylinder: the regression line of the radius over the
/// height.
fn cone_about(kind: PrimitiveKind, points: &[Point3], (place, axis): Axis) -> Option<Primitive> {
    let middle = dot(sub(mean(points), place), axis);
    let profile = points.iter().map(|p| {
        let d = sub(*p, place);
        (norm(cross(d, axis)), dot(d, axis) - middle)
    });
    let (mut radius, mut slope, mut squares) = (0.0, 0.0, 0.0);
    for (r, h) in profile {
        radius += r / points.len() as f64;
        slope += r * h;
        squares += h * h;
    }
    let surface = Primitive {
        kind,
        place: std::array::from_fn(|k| place[k] + middle * axis[k]),
        axis,
        size: radius,
        other: match kind {
            PrimitiveKind::Cone => (slope / squares).atan(),
            _ => 0.0,
        },
    };
    surface.is_proper().then_some(surface)
}

/// Returns the least-squares plane.
pub(crate) fn plane(points: &[Point3]) -> Primitive {
    let place = mean(points);
    let mut moments = [0.0; 9];
    for p in points {
        add_square(&mut moments, sub(*p, place));
    }
    Primitive::plane(place, least_direction(&moments))
}

fn add_square(moments: &mut [f64; 9], d: Point3) {
    for a in 0..3 {
        for b in 0..3 {
            moments[3 * a + b] += d[a] * d[b];
        }
    }
}

fn least_direction(moments: &[f64; 9]) -> Point3 {
    let (_, vectors) = symmetric_eigen(moments, 3);
    [vectors[0], vectors[1], vectors[2]]
}

/// Returns the sphere of least algebraic distance: |x|² = 2 c·x + k is linear in c and k.
fn sphere(points: &[Point3]) -> Option<Primitive> {
    let about = mean(points);
    let rows = points.iter().map(|p| {
        let d = sub(*p, about);
        ([2.0 * d[0], 2.0 * d[1], 2.0 * d[2], 1.0], dot(d, d))
    });
    let [x, y, z, k] = least_squares(rows)?;
    let size = (k + x * x + y * y + z * z).sqrt();
    let surface = Primitive {
        kind: PrimitiveKind::Sphere,
        place: std::array::from_fn(|i| about[i] + [x, y, z][i]),
        axis: [0.0, 0.0, 1.0],
        size,
        other: 0.0,
    };
    surface.is_proper().then_some(surface)
}

/// Returns the sphere of least algebraic distance with its centre on an axis.
pub(crate) fn centred_sphere(points: &[Point3], (place, axis): Axis) -> Option<Primitive> {
    let rows = points.iter().map(|p| {
        let d = sub(*p, place);
        ([2.0 * dot(d, axis), 1.0], dot(d, d))
    });
    let [h, k] = least_squares(rows)?;
    let surface = Primitive {
        kind: PrimitiveKind::Sphere,
        place: std::array::from_fn(|i| place[i] + h * axis[i]),
        axis: [0.0, 0.0, 1.0],
        size: (k + h * h).sqrt(),
        other: 0.0,
    };
    surface.is_proper().then_some(surface)
}

/// Returns the least-squares solution of rows · x = sides.
fn least_squares<const N: usize>(rows: impl Iterator<Item = ([f64; N], f64)>) -> Option<[f64; N]> {
    let mut a = vec![0.0; N * N];
    let mut b = [0.0; N];
    for (row, side) in rows {
        for i in 0..N {
            for j in 0..N {
                a[i * N + j] += row[i] * row[j];
            }
            b[i] += row[i] * side;
        }
    }
    let scale: [f64; N] = std::array::from_fn(|i| a[i * N + i].sqrt().max(f64::MIN_POSITIVE));
    for i in 0..N {
        for j in 0..N {
            a[i * N + j] /= scale[i] * scale[j];
        }
        b[i] /= scale[i];
    }
    if !cholesky(&mut a, N) {
        return None;
    }
    cholesky_solve(&a, N, &mut b);
    let x = std::array::from_fn(|i| b[i] / scale[i]);
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// Returns candidates for the axis of a cylinder: the direction most nearly perpendicular to the
/// normals, and the one along which the points bend least.
fn axes(points: &[Point3], normals: &[Point3]) -> Vec<Point3> {
    let mut moments = [0.0; 9];
    for n in normals {
        add_square(&mut moments, *n);
    }
    let mut axes = vec![least_direction(&moments)];
    if let Some([_, flat]) = curvature_directions(points) {
        axes.push(flat);
    }
    axes
}

/// Returns the principal directions of a quadratic height over the plane of the points, that of the
/// larger curvature first.
fn curvature_directions(points: &[Point3]) -> Option<[Point3; 2]> {
    let plane = plane(points);
    let [e, f] = plane.frame();
    let scale = points
        .iter()
        .map(|p| norm(sub(*p, plane.place)))
        .fold(0.0, f64::max);
    let rows = points.iter().map(|p| {
        let d = sub(*p, plane.place).map(|v| v / scale);
        let (u, v) = (dot(d, e), dot(d, f));
        (quadratic_row(u, v), dot(d, plane.axis))
    });
    let [_, _, _, uu, uv, vv] = least_squares(rows)?;
    let (values, vectors) = symmetric_eigen(&[2.0 * uu, uv, uv, 2.0 * vv], 2);
    let large = usize::from(values[1].abs() > values[0].abs());
    let direction = |k: usize| -> Point3 {
        std::array::from_fn(|i| vectors[2 * k] * e[i] + vectors[2 * k + 1] * f[i])
    };
    Some([direction(large), direction(1 - large)])
}

/// Returns the row of a quadratic height over (u, v).
pub(crate) fn quadratic_row(u: f64, v: f64) -> [f64; 6] {
    [1.0, u, v, u * u, u * v, v * v]
}

/// Returns the sum of squares that the least-squares solution of rows · x = sides leaves.
pub(crate) fn squares_left<const N: usize>(
    rows: impl Iterator<Item = ([f64; N], f64)> + Clone,
) -> Option<f64> {
    let x = least_squares(rows.clone())?;
    let left = |(row, side): ([f64; N], f64)| {
        let found: f64 = row.iter().zip(&x).map(|(a, b)| a * b).sum();
        (side - found).powi(2)
    };
    Some(rows.map(left).sum())
}

/// Returns Σ r² of points from the quadratic height over a plane that fits them best.
pub(crate) fn bent_squares(plane: &Primitive, points: &[Point3]) -> f64 {
    let [e, f] = plane.frame();
    let row = |p: &Point3| {
        let d = sub(*p, plane.place);
        let (u, v) = (dot(d, e), dot(d, f));
        (quadratic_row(u, v), dot(d, plane.axis))
    };
    squares_left(points.iter().map(row)).unwrap_or(f64::INFINITY)
}

/// Returns the cylinder along an axis: a circle of least algebraic distance across it.
pub(crate) fn cylinder(points: &[Point3], axis: Point3) -> Option<Primitive> {
    let about = mean(points);
    let [e, f] = frame(axis);
    let rows = points.iter().map(|p| {
        let d = sub(*p, about);
        let (u, v) = (dot(d, e), dot(d, f));
        ([2.0 * u, 2.0 * v, 1.0], u * u + v * v)
    });
    let [u, v, k] = least_squares(rows)?;
    let surface = Primitive {
        kind: PrimitiveKind::Cylinder,
        place: std::array::from_fn(|i| about[i] + u * e[i] + v * f[i]),
        axis,
        size: (k + u * u + v * v).sqrt(),
        other: 0.0,
    };
    surface.is_proper().then_some(surface)
}

/// Returns cones: one whose normals make a constant angle with the axis and whose tangent planes
/// all pass through the apex, and each cylinder, as a cone with the half angle 0.
fn cones(points: &[Point3], normals: &[Point3]) -> Vec<Primitive> {
    let mut cones: Vec<Primitive> = axes(points, normals)
        .into_iter()
        .filter_map(|axis| cylinder(points, axis))
        .map(|c| Primitive {
            kind: PrimitiveKind::Cone,
            ..c
        })
        .collect();
    let middle = mean(normals);
    let mut moments = [0.0; 9];
    for n in normals {
        add_square(&mut moments, sub(*n, middle));
    }
    let axis = least_direction(&moments);
    let about = mean(points);
    let rows = points
        .iter()
        .zip(normals)
        .map(|(p, n)| (*n, dot(*n, sub(*p, about))));
    if let Some(apex) = least_squares(rows) {
        let apex = std::array::from_fn(|k| apex[k] + about[k]);
        cones.extend(cone_at(apex, axis, points));
    }
    cones
}

/// Returns the cone with this apex and axis, with the mean angle of the points.
fn cone_at(apex: Point3, axis: Point3, points: &[Point3]) -> Option<Primitive> {
    let h: f64 = points.iter().map(|p| dot(sub(*p, apex), axis)).sum();
    let axis = if h < 0.0 { axis.map(|x| -x) } else { axis };
    let angle = points.iter().map(|p| {
        let d = sub(*p, apex);
        norm(cross(d, axis)).atan2(dot(d, axis))
    });
    let cone = Primitive {
        kind: PrimitiveKind::Cone,
        place: apex,
        axis,
        size: 0.0,
        other: angle.sum::<f64>() / points.len() as f64,
    };
    let cone = cone.about(mean(points));
    (cone.is_proper() && cone.size > 0.0).then_some(cone)
}

/// Returns tori: one about the axis of revolution (the normal lines of a surface of revolution meet
/// its axis, which is linear in the coordinates of that line, Pottmann and Wallner 2001), with a
/// circle as its section, and one whose tube has the larger curvature of the points.
fn tori(points: &[Point3], normals: &[Point3]) -> Vec<Primitive> {
    let mut lines = vec![];
    lines.extend(axis_of_revolution(points, normals));
    let mut tori: Vec<Primitive> = lines
        .into_iter()
        .filter_map(|(place, axis)| torus_about(points, place, axis))
        .collect();
    tori.extend(tube(points));
    tori
}

/// Returns a point and the direction of the line that the normal lines meet: ā·(p × n) + a·… = 0.
fn axis_of_revolution(points: &[Point3], normals: &[Point3]) -> Option<(Point3, Point3)> {
    let about = mean(points);
    let scale = points
        .iter()
        .map(|p| norm(sub(*p, about)))
        .fold(0.0, f64::max);
    let mut moments = [0.0; 36];
    for (p, n) in points.iter().zip(normals) {
        let m = cross(sub(*p, about).map(|v| v / scale), *n);
        let row = [m[0], m[1], m[2], n[0], n[1], n[2]];
        for i in 0..6 {
            for j in 0..6 {
                moments[6 * i + j] += row[i] * row[j];
            }
        }
    }
    let (_, v) = symmetric_eigen(&moments, 6);
    let (a, moment) = ([v[0], v[1], v[2]], [v[3], v[4], v[5]]);
    let squared = dot(a, a);
    if squared < 1e-12 {
        return None;
    }
    let foot = cross(a, moment).map(|x| x / squared * scale);
    let place = std::array::from_fn(|k| foot[k] + about[k]);
    Some((place, unit(a)))
}

/// Returns the torus about an axis: the circle of least algebraic distance through (radius,
/// height).
fn torus_about(points: &[Point3], place: Point3, axis: Point3) -> Option<Primitive> {
    let profile = points.iter().map(|p| {
        let d = sub(*p, place);
        let h = dot(d, axis);
        (norm(cross(d, axis)), h)
    });
    let rows = profile.map(|(r, h)| ([2.0 * r, 2.0 * h, 1.0], r * r + h * h));
    let [r, h, k] = least_squares(rows)?;
    let surface = Primitive {
        kind: PrimitiveKind::Torus,
        place: std::array::from_fn(|i| place[i] + h * axis[i]),
        axis,
        size: r,
        other: (k + r * r + h * h).sqrt(),
    };
    surface.is_proper().then_some(surface)
}

/// Returns the torus with the principal curvatures of the points: its tube in the direction of the
/// larger, its circle in the other.
fn tube(points: &[Point3]) -> Option<Primitive> {
    let plane = plane(points);
    let [strong, weak] = curvature_directions(points)?;
    let rows = points.iter().map(|p| {
        let d = sub(*p, plane.place);
        let (u, v) = (dot(d, strong), dot(d, weak));
        ([1.0, u, v, u * u, v * v], dot(d, plane.axis))
    });
    let [c, _, _, uu, vv] = least_squares(rows)?;
    let (k, l) = (2.0 * uu, 2.0 * vv);
    if k == 0.0 || l == 0.0 {
        return None;
    }
    // The centre of the tube's section lies 1/k along the normal, the axis 1/l.
    let axis_at: Point3 = std::array::from_fn(|i| plane.place[i] + (c + 1.0 / l) * plane.axis[i]);
    let surface = Primitive {
        kind: PrimitiveKind::Torus,
        place: axis_at,
        axis: strong,
        size: (1.0 / l - 1.0 / k).abs(),
        other: 1.0 / k.abs(),
    };
    surface.is_proper().then_some(surface)
}
