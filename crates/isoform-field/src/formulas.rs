//! Formulas of the HyperFun library's functions, in terms of [`Ops`].

use crate::library::{Axis, Library, Native};
use crate::ops::{Binary, Ops, SetOp, Unary};

impl Library {
    /// Returns the value as defined by HyperFun.
    pub fn algebraic<O: Ops>(self, o: &mut O, args: &[O::V]) -> O::V {
        debug_assert_eq!(args.len(), self.arity());
        if !self.is_primitive() {
            return self.combination(o, args);
        }
        let u: [O::V; 3] = std::array::from_fn(|i| o.sub(&args[i], &args[i + 3]));
        let n = &args[6..];
        match self {
            Self::Sphere => ball(o, &u, &n[0]),
            Self::Cylinder(axis) => cylinder(o, axis, &u, &n[0]),
            Self::Torus(axis) => torus(o, axis, &u, n),
            Self::Ellipsoid => quadric(o, &[(&u[0], &n[0]), (&u[1], &n[1]), (&u[2], &n[2])]),
            Self::EllipticCylinder(axis) => {
                let (i, j) = others(axis);
                quadric(o, &[(&u[i], &n[0]), (&u[j], &n[1])])
            }
            Self::Block => block(o, args, &u),
            Self::Cone(axis) => cone(o, axis, &u, &n[0]),
            Self::EllipticCone(axis) => elliptic_cone(o, axis, &u, n),
            Self::Superellipsoid => superellipsoid(o, &u, n),
            Self::DistanceCone(axis) => {
                let p = axis_distance(o, axis, &u);
                let (_, _, h) = axis.indices();
                cone_distance(o, &u[h], &p, &n[0])
            }
            Self::DistanceCylinder => {
                let (dir, r) = (&n[..3], &n[3]);
                let d = distance_to_line(o, &u, dir);
                o.sub(r, &d)
            }
            Self::DistanceTorus(axis) => {
                let (_, _, h) = axis.indices();
                let p = axis_distance(o, axis, &u);
                torus_distance(o, &p, &u[h], &n[0], &n[1])
            }
            Self::DistanceEllipsoid => o.native(Native::EllipsoidDistance, &[&u[..], n].concat()),
            Self::BlendUnion
            | Self::BlendIntersection
            | Self::DistanceBlendUnion
            | Self::DistanceBlendIntersection
            | Self::SardfUnion
            | Self::SardfIntersection => unreachable!("it has been taken above"),
        }
    }

    /// Returns the value of a blend or SARDF operation of two values.
    fn combination<O: Ops>(self, o: &mut O, args: &[O::V]) -> O::V {
        let (f, g) = (&args[0], &args[1]);
        match self {
            Self::BlendUnion => {
                let s = o.set(SetOp::RUnion, f, g);
                let d = displacement(o, args);
                o.add(&s, &d)
            }
            Self::BlendIntersection => {
                let s = o.set(SetOp::RIntersection, f, g);
                let d = displacement(o, args);
                o.add(&s, &d)
            }
            Self::DistanceBlendIntersection => circular_intersection(o, f, g, &args[2]),
            Self::DistanceBlendUnion => {
                let (mf, mg) = (o.neg(f), o.neg(g));
                let b = circular_intersection(o, &mf, &mg, &args[2]);
                o.neg(&b)
            }
            Self::SardfIntersection => sardf_intersection(o, f, g, &args[2], &args[3]),
            Self::SardfUnion => {
                let (mf, mg) = (o.neg(f), o.neg(g));
                let b = sardf_intersection(o, &mf, &mg, &args[2], &args[3]);
                o.neg(&b)
            }
            Self::Sphere
            | Self::Ellipsoid
            | Self::Torus(_)
            | Self::Cylinder(_)
            | Self::EllipticCylinder(_)
            | Self::Block
            | Self::Cone(_)
            | Self::EllipticCone(_)
            | Self::Superellipsoid
            | Self::DistanceCone(_)
            | Self::DistanceCylinder
            | Self::DistanceTorus(_)
            | Self::DistanceEllipsoid => unreachable!("it is a primitive"),
        }
    }

    /// Returns the unit-gradient forms of a primitive, one per smooth side with the side's name,
    /// whose minimum is the primitive (a block is the intersection of six half spaces); empty if no
    /// closed form is known. They are valid if the point's coordinates are a rigid image of space.
    pub fn metric<O: Ops>(self, o: &mut O, args: &[O::V]) -> Vec<(&'static str, O::V)> {
        if !self.is_primitive() {
            return Vec::new();
        }
        let u: [O::V; 3] = std::array::from_fn(|i| o.sub(&args[i], &args[i + 3]));
        let n = &args[6..];
        let one = |v| vec![("", v)];
        match self {
            Self::Sphere => {
                let (r, d2) = (o.abs(&n[0]), squares(o, &u));
                let d = o.sqrt(&d2);
                one(o.sub(&r, &d))
            }
            Self::Cylinder(axis) => {
                let (r, p) = (o.abs(&n[0]), axis_distance(o, axis, &u));
                one(o.sub(&r, &p))
            }
            Self::Torus(axis) | Self::DistanceTorus(axis) => {
                let (_, _, h) = axis.indices();
                let p = axis_distance(o, axis, &u);
                let r = o.abs(&n[1]);
                one(torus_distance(o, &p, &u[h], &n[0], &r))
            }
            Self::Cone(axis) | Self::DistanceCone(axis) => {
                let (_, _, h) = axis.indices();
                let p = axis_distance(o, axis, &u);
                let r = o.abs(&n[0]);
                one(cone_distance(o, &u[h], &p, &r))
            }
            Self::Block => sides_of_block(o, args),
            Self::DistanceCylinder | Self::DistanceEllipsoid => one(self.algebraic(o, args)),
            // No closed form is known for the first ones; the others are not primitives.
            Self::Ellipsoid
            | Self::EllipticCylinder(_)
            | Self::EllipticCone(_)
            | Self::Superellipsoid
            | Self::BlendUnion
            | Self::BlendIntersection
            | Self::DistanceBlendUnion
            | Self::DistanceBlendIntersection
            | Self::SardfUnion
            | Self::SardfIntersection => Vec::new(),
        }
    }
}

/// Returns the two other coordinates in ascending order (HyperFun's order of half axes).
fn others(axis: Axis) -> (usize, usize) {
    match axis {
        Axis::X => (1, 2),
        Axis::Y => (0, 2),
        Axis::Z => (0, 1),
    }
}

/// Returns R² − |u|².
fn ball<O: Ops>(o: &mut O, u: &[O::V; 3], r: &O::V) -> O::V {
    let r2 = o.square(r);
    let d2 = squares(o, u);
    o.sub(&r2, &d2)
}

/// Returns R² − p², p the distance to the axis.
fn cylinder<O: Ops>(o: &mut O, axis: Axis, u: &[O::V; 3], r: &O::V) -> O::V {
    let (p, q, _) = axis.indices();
    let (r2, p2, q2) = (o.square(r), o.square(&u[p]), o.square(&u[q]));
    let s = o.sub(&r2, &p2);
    o.sub(&s, &q2)
}

/// Returns r² − |u|² − R² + 2 R p for R, r = n, p the distance to the axis.
fn torus<O: Ops>(o: &mut O, axis: Axis, u: &[O::V; 3], n: &[O::V]) -> O::V {
    let p = axis_distance(o, axis, u);
    let (r2, d2, big2) = (o.square(&n[1]), squares(o, u), o.square(&n[0]));
    let rp = o.mul(&n[0], &p);
    let rp = o.scale(2.0, &rp);
    let s = o.sub(&r2, &d2);
    let s = o.sub(&s, &big2);
    o.add(&s, &rp)
}

/// Returns the R-intersection of the slabs (xᵢ − vᵢ)(vᵢ + dᵢ − xᵢ), for x, v, d = args and u = x −
/// v.
fn block<O: Ops>(o: &mut O, args: &[O::V], u: &[O::V; 3]) -> O::V {
    let t: [O::V; 3] = std::array::from_fn(|i| {
        let end = o.add(&args[i + 3], &args[i + 6]);
        let up = o.sub(&end, &args[i]);
        o.mul(&u[i], &up)
    });
    let s = o.set(SetOp::RIntersection, &t[0], &t[1]);
    o.set(SetOp::RIntersection, &s, &t[2])
}

/// Returns the distances to the six sides of a block. A block of negative size extends below its
/// corner, since the formula is symmetric in the two ends of a slab.
fn sides_of_block<O: Ops>(o: &mut O, args: &[O::V]) -> Vec<(&'static str, O::V)> {
    let names = [["x_min", "x_max"], ["y_min", "y_max"], ["z_min", "z_max"]];
    let mut sides = Vec::with_capacity(6);
    for i in 0..3 {
        let n = &args[i + 6];
        let size = o.abs(n);
        let shift = o.sub(n, &size);
        let shift = o.scale(0.5, &shift);
        let low = o.add(&args[i + 3], &shift);
        let high = o.add(&low, &size);
        sides.push((names[i][0], o.sub(&args[i], &low)));
        sides.push((names[i][1], o.sub(&high, &args[i])));
    }
    sides
}

/// Returns h² − (p/R)², h the coordinate along the axis and p the distance to it.
fn cone<O: Ops>(o: &mut O, axis: Axis, u: &[O::V; 3], r: &O::V) -> O::V {
    let (p, q, h) = axis.indices();
    let (h2, p2, q2) = (o.square(&u[h]), o.square(&u[p]), o.square(&u[q]));
    let s = o.add(&p2, &q2);
    let r2 = o.square(r);
    let s = o.div(&s, &r2);
    o.sub(&h2, &s)
}

/// Returns h² − (first other coordinate / a)² − (second / b)² for a, b = n.
fn elliptic_cone<O: Ops>(o: &mut O, axis: Axis, u: &[O::V; 3], n: &[O::V]) -> O::V {
    let (i, j) = others(axis);
    let (_, _, h) = axis.indices();
    let q = quadric(o, &[(&u[i], &n[0]), (&u[j], &n[1])]);
    let h2 = o.square(&u[h]);
    let s = o.add(&h2, &q);
    o.offset(&s, -1.0)
}

/// Returns u·u.
fn squares<O: Ops>(o: &mut O, u: &[O::V; 3]) -> O::V {
    let q: [O::V; 3] = std::array::from_fn(|i| o.square(&u[i]));
    let s = o.add(&q[0], &q[1]);
    o.add(&s, &q[2])
}

/// Returns the distance to the axis.
fn axis_distance<O: Ops>(o: &mut O, axis: Axis, u: &[O::V; 3]) -> O::V {
    let (p, q, _) = axis.indices();
    let (p2, q2) = (o.square(&u[p]), o.square(&u[q]));
    let s = o.add(&p2, &q2);
    o.sqrt(&s)
}

/// Returns 1 − Σ (uᵢ/aᵢ)².
fn quadric<O: Ops>(o: &mut O, terms: &[(&O::V, &O::V)]) -> O::V {
    let mut s = o.constant(1.0);
    for (u, a) in terms {
        let t = o.div(u, a);
        let t = o.square(&t);
        s = o.sub(&s, &t);
    }
    s
}

/// Returns 1 − (|u₁/a|^(2/s2) + |u₂/b|^(2/s2))^(s2/s1) − |u₃/d|^(2/s1) for a, b, d, s1, s2 = n.
fn superellipsoid<O: Ops>(o: &mut O, u: &[O::V; 3], n: &[O::V]) -> O::V {
    let two = o.constant(2.0);
    let (e1, e2) = (o.div(&two, &n[3]), o.div(&two, &n[4]));
    let ratio = o.div(&n[4], &n[3]);
    let a = scaled_power(o, &u[0], &n[0], &e2);
    let b = scaled_power(o, &u[1], &n[1], &e2);
    let c = scaled_power(o, &u[2], &n[2], &e1);
    let s = o.add(&a, &b);
    let s = power_from_zero(o, &s, &ratio);
    let one = o.constant(1.0);
    let s = o.sub(&one, &s);
    o.sub(&s, &c)
}

/// Returns |u/a|^e.
fn scaled_power<O: Ops>(o: &mut O, u: &O::V, a: &O::V, e: &O::V) -> O::V {
    let t = o.div(u, a);
    let t = o.abs(&t);
    power_from_zero(o, &t, e)
}

/// Returns t^e for t ≥ 0, with 0^e = 0 and derivative 0 there.
fn power_from_zero<O: Ops>(o: &mut O, t: &O::V, e: &O::V) -> O::V {
    let zero = o.constant(0.0);
    let tiny = o.constant(f64::MIN_POSITIVE);
    let positive = o.less(&zero, t);
    let safe = o.select(&positive, t, &tiny);
    let p = o.binary(Binary::Pow, &safe, e);
    o.select(&positive, &p, &zero)
}

/// Returns h sin t − p cos t with tan t = R, for h = |axis coordinate|.
fn cone_distance<O: Ops>(o: &mut O, h: &O::V, p: &O::V, r: &O::V) -> O::V {
    let h = o.abs(h);
    let rh = o.mul(r, &h);
    let s = o.sub(&rh, p);
    let r2 = o.square(r);
    let q = o.offset(&r2, 1.0);
    let q = o.sqrt(&q);
    o.div(&s, &q)
}

/// Returns r − √((p − R)² + h²).
fn torus_distance<O: Ops>(o: &mut O, p: &O::V, h: &O::V, big: &O::V, r: &O::V) -> O::V {
    let d = o.sub(p, big);
    let (d2, h2) = (o.square(&d), o.square(h));
    let s = o.add(&d2, &h2);
    let s = o.sqrt(&s);
    o.sub(r, &s)
}

/// Returns |dir × u| / |dir|.
fn distance_to_line<O: Ops>(o: &mut O, u: &[O::V; 3], dir: &[O::V]) -> O::V {
    let c: [O::V; 3] = std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (a, b) = (o.mul(&dir[j], &u[k]), o.mul(&dir[k], &u[j]));
        o.sub(&a, &b)
    });
    let d: [O::V; 3] = std::array::from_fn(|i| dir[i].clone());
    let (c2, d2) = (squares(o, &c), squares(o, &d));
    let (c1, d1) = (o.sqrt(&c2), o.sqrt(&d2));
    o.div(&c1, &d1)
}

/// Returns a0 / (1 + (f/a1)² + (g/a2)²).
fn displacement<O: Ops>(o: &mut O, args: &[O::V]) -> O::V {
    let (p, q) = (o.div(&args[0], &args[3]), o.div(&args[1], &args[4]));
    let (p2, q2) = (o.square(&p), o.square(&q));
    let s = o.offset(&p2, 1.0);
    let s = o.add(&s, &q2);
    o.div(&args[2], &s)
}

/// Returns the minimum for |f − g| > r, else (2s − 4r + √((2s − 4r)² − 8 (f² + g² + r² − 2 r s))) /
/// 4 with s = f + g.
fn circular_intersection<O: Ops>(o: &mut O, f: &O::V, g: &O::V, r: &O::V) -> O::V {
    let s = o.add(f, g);
    let (s2, r4) = (o.scale(2.0, &s), o.scale(4.0, r));
    let b = o.sub(&s2, &r4);
    let (f2, g2, r2, b2) = (o.square(f), o.square(g), o.square(r), o.square(&b));
    let rs = o.mul(r, &s2);
    let c = o.add(&f2, &g2);
    let c = o.add(&c, &r2);
    let c = o.sub(&c, &rs);
    let c8 = o.scale(8.0, &c);
    let disc = o.sub(&b2, &c8);
    let zero = o.constant(0.0);
    // Rounding may make the discriminant negative at the ends of the blend.
    let disc = o.max(&disc, &zero);
    let root = o.sqrt(&disc);
    let sum = o.add(&b, &root);
    let blend = o.scale(0.25, &sum);
    let d = o.sub(f, g);
    let d = o.abs(&d);
    let apart = o.less(r, &d);
    let m = o.min(f, g);
    o.select(&apart, &m, &blend)
}

/// Returns the signed approximate real distance function of an intersection (Fayolle, Pasko,
/// Schmitt). All branches are built, and conditions select one. Values below 1e-7 count as 0.
fn sardf_intersection<O: Ops>(o: &mut O, f: &O::V, g: &O::V, r: &O::V, alpha: &O::V) -> O::V {
    let zero = o.constant(0.0);
    let small = |o: &mut O, v: &O::V| {
        let (limit, a, zero) = (o.constant(1e-7), o.abs(v), o.constant(0.0));
        let is = o.less(&a, &limit);
        o.select(&is, &zero, v)
    };
    let (f, g) = (small(o, f), small(o, g));
    let m = o.min(&f, &g);
    let negative = sardf_both_negative(o, &f, &g, alpha);
    let positive = sardf_both_positive(o, &f, &g, r, &m);
    let (fp, gp) = (o.less(&zero, &f), o.less(&zero, &g));
    let (fn_, gn) = (o.less(&f, &zero), o.less(&g, &zero));
    let (both_p, both_n) = (o.mul(&fp, &gp), o.mul(&fn_, &gn));
    // For values of different signs the result is the negative one, for a zero min(other, 0): the
    // minimum in both cases.
    let rest = o.select(&both_n, &negative, &m);
    o.select(&both_p, &positive, &rest)
}

/// Returns the SARDF intersection of two negative values: f in the sector f tan α ≤ g, g in the
/// sector g tan α ≤ f, and the arc that joins them between.
fn sardf_both_negative<O: Ops>(o: &mut O, f: &O::V, g: &O::V, alpha: &O::V) -> O::V {
    let (t, d) = sardf_arc(o, f, g, alpha);
    let zero = o.constant(0.0);
    // f/g ≥ 1/t and f/g ≤ t, with both negative: f t ≤ g and f ≥ t g.
    let (ft, gt) = (o.mul(f, &t), o.mul(g, &t));
    let (first, second) = (o.less_eq(&ft, g), o.less_eq(&gt, f));
    // For alpha = 0 both conditions would hold trivially on the axes only; t = 0 has no sectors.
    let has = o.less(&zero, &t);
    let (first, second) = (o.mul(&first, &has), o.mul(&second, &has));
    let d = o.select(&second, g, &d);
    o.select(&first, f, &d)
}

/// Returns t = tan α, and the root d of (1 − t² − 2t) d² + 2t (f + g) d − (f² + g²) = 0 with the
/// negative square root.
fn sardf_arc<O: Ops>(o: &mut O, f: &O::V, g: &O::V, alpha: &O::V) -> (O::V, O::V) {
    let (sum, f2, g2) = (o.add(f, g), o.square(f), o.square(g));
    let s2 = o.add(&f2, &g2);
    let (zero, one) = (o.constant(0.0), o.constant(1.0));
    let t = o.unary(Unary::Tan, alpha);
    let t2 = o.square(&t);
    let two_t = o.scale(2.0, &t);
    let a = o.sub(&one, &t2);
    let a = o.sub(&a, &two_t);
    let b = o.mul(&two_t, &sum);
    let c = o.neg(&s2);
    let ac = o.mul(&a, &c);
    let ac4 = o.scale(4.0, &ac);
    let b2 = o.square(&b);
    let disc = o.sub(&b2, &ac4);
    let disc = o.max(&disc, &zero);
    let root = o.sqrt(&disc);
    let mb = o.neg(&b);
    let num = o.sub(&mb, &root);
    let two_a = o.scale(2.0, &a);
    let d = o.div(&num, &two_a);
    (t, d)
}

/// Returns the SARDF intersection of two positive values: m² for the quartic's root m near the edge
/// and inside its sector, the minimum near the edge outside of the sector, and the circular blend
/// far from the edge.
fn sardf_both_positive<O: Ops>(o: &mut O, f: &O::V, g: &O::V, r: &O::V, m: &O::V) -> O::V {
    let (f2, g2) = (o.square(f), o.square(g));
    let r4 = o.scale(4.0, r);
    let (fq, gq) = (o.div(&f2, &r4), o.div(&g2, &r4));
    let (c1, c2) = (o.less_eq(&fq, g), o.less_eq(&gq, f));
    let inner = o.mul(&c1, &c2);
    let root = o.native(Native::SardfRoot, &[f.clone(), g.clone(), r.clone()]);
    let m2 = o.square(&root);
    let near_value = o.select(&inner, &m2, m);
    let far_value = circular_intersection(o, f, g, r);
    let near = sardf_is_near(o, f, g, r);
    o.select(&near, &near_value, &far_value)
}

/// Returns the condition f ≤ R or g ≤ R or (f ≤ 2R and g ≤ 2R and (f − 2R)² + (g − 2R)² ≥ R²).
fn sardf_is_near<O: Ops>(o: &mut O, f: &O::V, g: &O::V, r: &O::V) -> O::V {
    let r2 = o.scale(2.0, r);
    let (a, b) = (o.less_eq(f, r), o.less_eq(g, r));
    let (c, d) = (o.less_eq(f, &r2), o.less_eq(g, &r2));
    let (df, dg) = (o.sub(f, &r2), o.sub(g, &r2));
    let (df2, dg2) = (o.square(&df), o.square(&dg));
    let circle = o.add(&df2, &dg2);
    let rr = o.square(r);
    let e = o.less_eq(&rr, &circle);
    let corner = o.mul(&c, &d);
    let corner = o.mul(&corner, &e);
    let s = o.add(&a, &b);
    o.add(&s, &corner)
}
