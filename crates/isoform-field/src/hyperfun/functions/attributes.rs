//! Attribute functions: colours and other values attached to a shape.

use super::{Call, FormulaError, Outcome, shapes};
use crate::hyperfun::formula::{E, norm2};
use crate::hyperfun::machine::Machine;
use crate::library::Native;

/// Returns lo + (hi − lo) (1 + sin(f t))/2.
pub(super) fn wave<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let (lo, hi) = (c.n(1).min(&c.n(2)), c.n(1).max(&c.n(2)));
    Ok(&lo + (hi - &lo) * (1.0 + (c.n(3) * c.n(0)).sin()) * 0.5)
}

/// Returns (g + m)/(2m) with the amplitude's bound m = (2.17/1.17)³.
pub(super) fn noise_g<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let bound = (2.17f64 / 1.17).powi(3);
    let g = shapes::noise(c, &c.c(1.0), &c.n(1), &c.n(2));
    Ok((g + bound) / (2.0 * bound))
}

/// Writes block or gap attributes for a lattice of cells of block and gap from the origin; a point
/// is in a block if it is strictly inside on all axes.
pub(super) fn checker_board<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let mut inside = c.c(1.0);
    for i in 0..3 {
        let (x, block) = (c.item(0, i), c.item(1, i));
        let cell = &block + c.item(2, i);
        let origin = (&x / &cell).floor() * cell;
        inside = inside.and(&origin.less(&x)).and(&x.less(&(origin + block)));
    }
    if c.len(4) == c.len(5) {
        for k in 0..c.len(3).min(c.len(4)) {
            let v = inside.select(&c.item(4, k), &c.item(5, k));
            c.put(3, k, v);
        }
    }
    Ok(c.c(1.0))
}

/// Returns f1 | f2 and, if it exceeds −1e-6, writes in1 where f1 ≥ 0 > f2, in2 where f2 ≥ 0 > f1,
/// else the combination of both chosen by `op`.
pub(super) fn union<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let (f, g) = (c.n(0), c.n(1));
    let op = (c.need(5, "the operation")? + 0.5).floor();
    let u = f.union(&g);
    let (zero, written) = (c.c(0.0), c.c(-1e-6).less(&u));
    let first = zero.less_eq(&f).and(&g.less(&zero));
    let second = zero.less_eq(&g).and(&f.less(&zero));
    for k in 0..c.len(2).min(c.len(3)).min(c.len(4)) {
        let (a, b) = (c.item(3, k), c.item(4, k));
        let both = match op {
            0.0 => a.clone(),
            1.0 => b.clone(),
            2.0 => &a + &b,
            3.0 => a.min(&b),
            4.0 => a.max(&b),
            _ => c.item(2, k),
        };
        let v = first.select(&a, &second.select(&b, &both));
        c.put_where(&written, 2, k, &v);
    }
    Ok(u)
}

/// Writes three numbers into an array where f ≥ 0.
pub(super) fn set_color<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let inside = c.c(0.0).less_eq(&c.n(0));
    for k in 0..3 {
        let v = c.n(k + 2);
        c.put_where(&inside, 1, k, &v);
    }
    Ok(c.c(1.0))
}

/// Copies an array into another one where f ≥ 0.
pub(super) fn set_attributes<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let inside = c.c(0.0).less_eq(&c.n(0));
    for k in 0..c.len(1).min(c.len(2)) {
        let v = c.item(2, k);
        c.put_where(&inside, 1, k, &v);
    }
    Ok(c.c(1.0))
}

/// Mixes two arrays by w = (t − t0)/(t1 − t0), clamped to \[0, 1\]; returns w unclamped.
pub(super) fn mix<'c, M: Machine>(c: &mut Call<'c, M>, smooth: bool) -> Outcome<'c, M> {
    let w = (c.n(3) - c.n(4)) / (c.n(5) - c.n(4));
    let held = w.clamp(0.0, 1.0);
    let held = if smooth { cubic(&held) } else { held };
    for k in 0..c.len(0).min(c.len(1)).min(c.len(2)) {
        let (a, b) = (c.item(1, k), c.item(2, k));
        c.put(0, k, (1.0 - &held) * a + &held * b);
    }
    Ok(w)
}

/// Returns 3w² − 2w³.
fn cubic<'c, M: Machine>(w: &E<'c, M>) -> E<'c, M> {
    w.square() * (3.0 - 2.0 * w)
}

/// Returns min(max(t, a), b).
pub(super) fn clamp<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    Ok(c.n(0).max(&c.n(1)).min(&c.n(2)))
}

/// Returns a − b trunc(a/b), plus b where that is negative.
pub(super) fn modulo<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let (a, b) = (c.n(0), c.n(1));
    let r = &a - &b * (&a / &b).trunc();
    Ok(r.below(0.0).select(&(&r + b), &r))
}

/// Returns 1 where a ≤ f ≤ b, else 0; a and b are swapped in strict mode, as in the reference
/// implementation.
pub(super) fn pulse<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let (lo, hi) = if c.strict {
        (c.n(2), c.n(1))
    } else {
        (c.n(1), c.n(2))
    };
    Ok(lo.less_eq(&c.n(0)).and(&c.n(0).less_eq(&hi)))
}

/// Returns 3w² − 2w³ with w = (t − t0)/(t1 − t0) clamped to \[0, 1\].
pub(super) fn smooth_step<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let w = (c.n(3) - c.n(4)) / (c.n(5) - c.n(4));
    Ok(cubic(&w.clamp(0.0, 1.0)))
}

/// Writes row i for entryᵢ ≤ t < entryᵢ₊₁, the last row for t above the last entry, and the first
/// row below the first entry (in strict mode the last row). `smooth` interpolates between rows i
/// and i + 1.
pub(super) fn look_up<'c, M: Machine>(c: &mut Call<'c, M>, smooth: bool) -> Outcome<'c, M> {
    let (t, width, rows) = (c.n(0), c.len(1), table_rows(c, 1, 2, 3)?);
    let outside = if c.strict { rows - 1 } else { 0 };
    for k in 0..width {
        let row = |i: usize| c.item(2, i * width + k);
        let mut v = row(outside);
        for i in 0..rows {
            let here = if smooth && i + 1 < rows {
                let w = (&t - c.item(3, i)) / (c.item(3, i + 1) - c.item(3, i));
                (1.0 - &w) * row(i) + &w * row(i + 1)
            } else {
                row(i)
            };
            v = c.item(3, i).less_eq(&t).select(&here, &v);
        }
        c.put(1, k, v);
    }
    Ok(c.c(1.0))
}

/// Returns the number of rows of the size of `out` in the table, at most one per entry.
fn table_rows<M: Machine>(
    c: &mut Call<'_, M>,
    out: usize,
    table: usize,
    entries: usize,
) -> Result<usize, FormulaError> {
    let rows = (c.len(table) / c.len(out)).min(c.len(entries));
    if rows == 0 {
        return c.fail(format!(
            "the table has {} items, less than one row of {}",
            c.len(table),
            c.len(out)
        ));
    }
    c.spend((rows * c.len(out)) as u64)?;
    Ok(rows)
}

/// Evaluates the Catmull-Rom spline through the rows of knots except the first and last, w = (t −
/// t0)/(t1 − t0) (K − 3). Outside \[t0, t1\] it is constant (in strict mode the first or last row).
pub(super) fn spline<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let (width, knots) = (c.len(0), c.len(1) / c.len(0));
    if knots < 4 {
        return c.fail(format!(
            "a spline needs 4 rows of knots of {width} items each"
        ));
    }
    c.spend((width * knots) as u64)?;
    let (t, spans) = (c.n(2), knots - 3);
    let w = (&t - c.n(3)) / (c.n(4) - c.n(3)) * spans as f64;
    let held = w.clamp(0.0, spans as f64);
    for k in 0..width {
        let row = |i: usize| c.item(1, i * width + k);
        let span = |i: usize| {
            let u = &held - i as f64;
            let (a, b, d, e) = (row(i), row(i + 1), row(i + 2), row(i + 3));
            let third = -&a + 3.0 * &b - 3.0 * &d + &e;
            let second = 2.0 * &a - 5.0 * &b + 4.0 * &d - e;
            0.5 * (2.0 * b + &u * ((d - a) + &u * (second + &u * third)))
        };
        let mut v = span(0);
        for i in 1..spans {
            v = held.constant(i as f64).less_eq(&held).select(&span(i), &v);
        }
        if c.strict {
            v = t
                .less(&c.n(3))
                .select(&row(0), &c.n(4).less(&t).select(&row(knots - 1), &v));
        }
        c.put(0, k, v);
    }
    Ok(c.c(1.0))
}

/// Converts RGB to HSV, with the hue in degrees from red; in strict mode it is negative between red
/// and magenta.
pub(super) fn rgb_to_hsv<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let [r, g, b] = c.point(0);
    let (low, high) = (r.min(&g).min(&b), r.max(&g).max(&b));
    let (zero, one) = (c.c(0.0), c.c(1.0));
    let range = &high - &low;
    let coloured = zero.less(&range);
    let d = coloured.select(&range, &one);
    let of_red = (&g - &b) / &d;
    let of_green = 2.0 + (&b - &r) / &d;
    let of_blue = 4.0 + (&r - &g) / &d;
    // The largest component determines the hue; of two equal ones green precedes red, blue green,
    // and red blue.
    let blue = high.less_eq(&b).and(&r.less(&b));
    let green = high.less_eq(&g).and(&b.less(&g));
    let hue = blue.select(&of_blue, &green.select(&of_green, &of_red));
    let mut hue = 60.0 * coloured.select(&hue, &zero);
    if !c.strict {
        hue = hue.below(0.0).select(&(&hue + 360.0), &hue);
    }
    let positive = zero.less(&high);
    let saturation = positive.select(&(range / positive.select(&high, &one)), &zero);
    c.put_point(1, [hue, saturation, high]);
    Ok(c.c(1.0))
}

/// Converts HSV to RGB, by piecewise linear ramps over the hue.
pub(super) fn hsv_to_rgb<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let [h, s, v] = c.point(0);
    let h = &h - 360.0 * (&h / 360.0).floor();
    let zero = c.c(0.0);
    let (first, second) = (h.below(120.0), h.below(240.0));
    let up = |from: f64| (&h - from) / 60.0;
    let down = |to: f64| (to - &h) / 60.0;
    let ramps = [
        first.select(&down(120.0), &second.select(&zero, &up(240.0))),
        first.select(&up(0.0), &second.select(&down(240.0), &zero)),
        first.select(&zero, &second.select(&up(120.0), &down(360.0))),
    ];
    let one = c.c(1.0);
    c.put_point(1, ramps.map(|r| (1.0 - &s + &s * r.min(&one)) * &v));
    Ok(c.c(1.0))
}

fn perlin<'c, M: Machine>(p: &[E<'c, M>; 3]) -> E<'c, M> {
    p[0].native(Native::PerlinNoise, &[&p[1], &p[2]])
}

pub(super) fn noise_p<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    Ok(perlin(&c.point(0)))
}

/// Returns Σ |noise(f x)|/f for f = freq, freq/2, … ≥ 1.
pub(super) fn turbulence<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let mut f = c.need(1, "the frequency")?;
    let x = c.point(0);
    let mut sum = c.c(0.0);
    while f >= 1.0 && f.is_finite() {
        c.spend(1)?;
        sum = sum + perlin(&x.clone().map(|v| f * v)).abs() / f;
        f *= 0.5;
    }
    Ok(sum)
}

/// Writes row i where entryᵢ ≤ p < entryᵢ₊₁; elsewhere the output is unchanged.
fn by_chance<'c, M: Machine>(
    c: &mut Call<'c, M>,
    p: &E<'c, M>,
    table: usize,
    entries: usize,
) -> Result<(), FormulaError> {
    let (width, rows) = (c.len(1), table_rows(c, 1, table, entries)?);
    for i in 0..rows.min(c.len(entries).saturating_sub(1)) {
        let here = c
            .item(entries, i)
            .less_eq(p)
            .and(&p.less(&c.item(entries, i + 1)));
        for k in 0..width {
            let v = c.item(table, i * width + k);
            c.put_where(&here, 1, k, &v);
        }
    }
    Ok(())
}

/// Writes a row by the fraction of the distance to 0, a pattern of this implementation: the
/// reference's is not documented.
pub(super) fn circles<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let r = norm2(&c.point(0)).sqrt();
    let p = &r - r.floor();
    by_chance(c, &p, 2, 3)?;
    Ok(c.c(1.0))
}

/// Writes a row by noise scaled to \[0, 1\], a pattern of this implementation: the reference's is
/// unfinished.
pub(super) fn crackles<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let f = c.n(2);
    let p = 0.5 * (1.0 + perlin(&c.point(0).map(|v| &f * v)));
    let p = p.clamp(0.0, 1.0 - f64::EPSILON);
    by_chance(c, &p, 3, 4)?;
    Ok(c.c(1.0))
}
