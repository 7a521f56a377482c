//! Convolution surfaces with the Cauchy kernel k(r) = 1/(1 + S²r²)² (McCormack, Sherstyuk: Creating
//! and rendering convolution surfaces, Computer Graphics Forum 17, 1998). Each value is the sum of
//! the integrals over the elements minus T.

use super::{Call, FormulaError, Outcome};
use crate::hyperfun::formula::{E, E3, cross, dot, minus, norm2};
use crate::hyperfun::machine::Machine;

/// Returns Σ k(r) − T.
pub(super) fn point<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let x = c.point(0);
    let mut sum = -c.n(3);
    for i in 0..c.len(1) / 3 {
        let r2 = norm2(&minus(&x, &c.triple(1, i)));
        sum = sum + 1.0 / (1.0 + c.item(2, i).square() * r2).square();
    }
    Ok(sum)
}

/// Returns Σ ∫ k − T over the segments from points of array 1 to points of array 2.
pub(super) fn line<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let x = c.point(0);
    let mut sum = -c.n(4);
    for i in 0..c.len(1) / 3 {
        sum = sum + segment(&x, &c.triple(1, i), &c.triple(2, i), &c.item(3, i));
    }
    Ok(sum)
}

/// Returns Σ ∫ k − T over the segments of a polyline.
pub(super) fn curve<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let x = c.point(0);
    let mut sum = -c.n(3);
    for i in 0..(c.len(1) / 3).saturating_sub(1) {
        sum = sum + segment(&x, &c.triple(1, i), &c.triple(1, i + 1), &c.item(2, i));
    }
    Ok(sum)
}

/// Returns ∫ k along a segment of length L; h is the projection of x − begin on its direction:
/// h/(2p²(p²+S²h²)) + (L−h)/(2p²q²) + (atan(Sh/p) + atan(S(L−h)/p))/(2Sp³) with p² = 1 + S²(R²−h²),
/// q² = 1 + S²(R²+L²−2Lh). A segment of length 0 gives 0.
fn segment<'c, M: Machine>(
    x: &E3<'c, M>,
    begin: &E3<'c, M>,
    end: &E3<'c, M>,
    s: &E<'c, M>,
) -> E<'c, M> {
    let (d, u) = (minus(end, begin), minus(x, begin));
    let l2 = norm2(&d);
    let there = l2.constant(0.0).less(&l2);
    let l = there.select(&l2, &l2.constant(1.0)).sqrt();
    let h = dot(&u, &d) / &l;
    let (r2, s2) = (norm2(&u), s.square());
    let p2 = 1.0 + &s2 * (&r2 - h.square());
    let q2 = 1.0 + &s2 * (r2 + l.square() - 2.0 * (&l * &h));
    let p = p2.sqrt();
    let rest = &l - &h;
    let first = &h / (2.0 * &p2 * (&p2 + s2 * h.square()));
    let second = &rest / (2.0 * &p2 * q2);
    let angles = (s * &h / &p).atan() + (s * rest / &p).atan();
    let value = first + second + angles / (2.0 * s * p2 * p);
    there.select(&value, &value.constant(0.0))
}

/// Returns Σ ∫ k − T over triangles given by their corners.
pub(super) fn triangle<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let x = c.point(0);
    let mut sum = -c.n(3);
    for i in 0..c.len(1) / 9 {
        let corners = [0, 1, 2].map(|k| c.triple(1, 3 * i + k));
        sum = sum + surface(&x, &corners, &c.item(2, i));
    }
    Ok(sum)
}

/// Returns Σ ∫ k − T over the triangles of a mesh, whose indices count from 1.
pub(super) fn mesh<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let x = c.point(0);
    let points = c.len(1) / 3;
    let mut sum = -c.n(4);
    for i in 0..c.len(2) / 3 {
        let mut at = [0; 3];
        for (k, at) in at.iter_mut().enumerate() {
            *at = corner(c, i, k, points)?;
        }
        sum = sum + surface(&x, &at.map(|k| c.triple(1, k)), &c.item(3, i));
    }
    Ok(sum)
}

/// Returns the index, from 0, of corner k of triangle i among `points` points.
fn corner<M: Machine>(
    c: &Call<'_, M>,
    i: usize,
    k: usize,
    points: usize,
) -> Result<usize, FormulaError> {
    let Some(index) = c.item(2, 3 * i + k).known() else {
        return Err(FormulaError {
            message: "a corner's index depends on the point or the parameters".to_owned(),
            unknown: true,
        });
    };
    let index = (index + 0.5).floor();
    if !(1.0..=points as f64).contains(&index) {
        return c.fail(format!(
            "triangle {} has the corner {index}; there are the points 1 to {points}",
            i + 1
        ));
    }
    Ok(index as usize - 1)
}

/// Returns S³ times ∫ k over a triangle; the factor is that of the reference implementation, for
/// which models are written.
///
/// In polar coordinates about the foot of x the inner integral is elementary, and each edge gives
/// d/(2 c² S w) (atan(S l₁/w) − atan(S l₀/w)): d the distance of the foot to the edge's line
/// (positive on the inner side), l₀ and l₁ the ends along it, z the distance to the plane, c² = 1 +
/// S²z², w² = c² + S²d². Area 0 is the only singular case.
fn surface<'c, M: Machine>(x: &E3<'c, M>, corners: &[E3<'c, M>; 3], s: &E<'c, M>) -> E<'c, M> {
    let [a, b, d] = corners;
    let normal = cross(&minus(b, a), &minus(d, a));
    let n2 = norm2(&normal);
    let zero = n2.constant(0.0);
    let there = zero.less(&n2);
    let one = n2.constant(1.0);
    let length = there.select(&n2, &one).sqrt();
    let n: E3<'c, M> = normal.map(|v| v / &length);
    let z = dot(&minus(x, a), &n);
    let c2 = 1.0 + (s * z).square();
    let mut sum = zero.clone();
    for i in 0..3 {
        let (from, to) = (&corners[i], &corners[(i + 1) % 3]);
        let edge = minus(to, from);
        let l = there.select(&norm2(&edge), &one).sqrt();
        let e: E3<'c, M> = edge.map(|v| v / &l);
        let u = minus(x, from);
        let along = dot(&u, &e);
        let inner = dot(&u, &cross(&n, &e));
        let w = (&c2 + (s * &inner).square()).sqrt();
        let turn = (s * (l - &along) / &w).atan() + (s * along / &w).atan();
        sum = sum + inner / w * turn;
    }
    let value = s.square() * sum / (2.0 * c2);
    there.select(&value, &zero)
}

/// Returns Σ ∫ k − T over the angles of arcs, in radians (not over their lengths, as in the
/// reference implementation).
///
/// In the arc's frame 1 + S²r² = A − C(φ) with A = 1 + S²(|u|² + R²), C = 2S²R(u₁ cos φ + u₂ sin
/// φ), and with D = −dC/dφ and Δ² = A² − C² − D² the integral is D/((A−C)Δ²) + A/Δ³ (φ + 2
/// atan(D/(A + Δ − C))), continuous for all φ.
pub(super) fn arc<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let x = c.point(0);
    let mut sum = -c.n(7);
    let degree = std::f64::consts::PI / 180.0;
    for i in 0..c.len(1) / 3 {
        let (radius, s) = (c.item(2, i), c.item(6, i));
        let theta = degree * c.item(3, i).min(&c.c(360.0));
        let u = turned_back(
            &minus(&x, &c.triple(1, i)),
            &c.triple(4, i),
            &(degree * c.item(5, i)),
        );
        let s2 = s.square();
        let a = 1.0 + &s2 * (norm2(&u) + radius.square());
        let k = 2.0 * (s2 * radius);
        let (k1, k2) = (&k * &u[0], &k * &u[1]);
        let delta2 = a.square() - k1.square() - k2.square();
        let delta = delta2.sqrt();
        let at = |phi: &E<'c, M>| {
            let (sin, cos) = (phi.sin(), phi.cos());
            let big = &k1 * &cos + &k2 * &sin;
            let slope = &k1 * sin - &k2 * cos;
            let turn = phi + 2.0 * (&slope / (&a + &delta - &big)).atan();
            slope / ((&a - big) * &delta2) + &a / (&delta2 * &delta) * turn
        };
        sum = sum + at(&theta) - at(&c.c(0.0));
    }
    Ok(sum)
}

/// Rotates u by −angle about an axis (Rodrigues); an axis of length 0 leaves u unchanged.
fn turned_back<'c, M: Machine>(u: &E3<'c, M>, axis: &E3<'c, M>, angle: &E<'c, M>) -> E3<'c, M> {
    let n2 = norm2(axis);
    let zero = n2.constant(0.0);
    let there = zero.less(&n2);
    let length = there.select(&n2, &n2.constant(1.0)).sqrt();
    let k: E3<'c, M> = axis.clone().map(|v| v / &length);
    let (sin, cos) = (
        there.select(&angle.sin(), &zero),
        there.select(&angle.cos(), &zero.constant(1.0)),
    );
    let (side, along) = (cross(&k, u), dot(&k, u) * (1.0 - &cos));
    std::array::from_fn(|i| &u[i] * &cos - &side[i] * &sin + &k[i] * &along)
}

/// Returns Σ ∫ k − T over segments with S = 1/R for R < 1, else 1. The sum is clamped to 1 after
/// each segment; T is the field at the distance R from the last segment, perpendicularly to it at
/// its end.
pub(super) fn line_r<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let (x, r) = (c.point(0), c.n(3));
    let one = c.c(1.0);
    let s = r.below(1.0).select(&(1.0 / &r), &one);
    let (mut sum, mut threshold) = (c.c(0.0), c.c(0.0));
    for i in 0..c.len(1) / 3 {
        let (begin, end) = (c.triple(1, i), c.triple(2, i));
        sum = (sum + segment(&x, &begin, &end, &s)).min(&one);
        let l2 = norm2(&minus(&end, &begin));
        let (l, s2) = (l2.sqrt(), s.square());
        let p2 = 1.0 + &s2 * r.square();
        let q2 = 1.0 + s2 * (r.square() + l2);
        let p = p2.sqrt();
        threshold = &l / (2.0 * &p2 * q2) + (&s * l / &p).atan() / (2.0 * &s * p2 * p);
    }
    Ok(sum - threshold)
}
