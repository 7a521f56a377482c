//! The documents of patches: their file, the trace, and what --json prints.

use super::{Coverage, Made};
use isoform::patch::{Grown, Inner, Method, NormalForm, Parameterized, Phase, Quadric};
use serde_json::{Map, Value, json};

/// The file of the patches. The same each time.
pub(super) fn patches(made: &Made) -> Vec<u8> {
    let list: Vec<Value> = made.patches.iter().map(patch).collect();
    let mut bytes = serde_json::to_vec(&json!({"schema": 1, "patches": list})).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

fn patch(p: &Parameterized) -> Value {
    let (m, n) = p.grown.patch.degree();
    let rows: Vec<Value> = p
        .grown
        .patch
        .control()
        .chunks(n + 1)
        .map(|row| json!(row))
        .collect();
    json!({
        "degree": [m, n],
        "control": rows,
        // Without a proof the largest sampled distance, and `certified` says so.
        "max_distance": p.distances.bound.unwrap_or(p.distances.sampled),
        "certified": p.distances.bound.is_some() && p.is_unfolded,
        "rms_distance": p.distances.rms,
        "seed_point": p.grown.seed_point,
    })
}

/// Every step of a patch.
pub(super) fn trace(grown: &Grown) -> String {
    let mut text = "phase,step,S,I,J,L,R,E,l1,l2,wJ,wL,wR,wE\n".to_owned();
    for (step, r) in grown.trace.iter().enumerate() {
        let phase = if r.phase == Phase::Newton {
            "newton"
        } else {
            "grow"
        };
        let (t, w) = (&r.terms, &r.weights);
        let numbers = [
            r.sum,
            t.i,
            t.j,
            t.l,
            t.r,
            t.e,
            r.lengths.0,
            r.lengths.1,
            w.j,
            w.l,
            w.r,
            w.e,
        ];
        text += &format!("{phase},{}", step + 1);
        for v in numbers {
            text += &format!(",{v:?}");
        }
        text.push('\n');
    }
    text
}

/// What --json prints.
pub(super) fn document(made: &Made) -> Value {
    let options = &made.options;
    let list: Vec<Value> = made.patches.iter().map(|p| report(p, made)).collect();
    json!({
        "ok": made.failures().is_empty(),
        "verb": "parameterize",
        "model": made.name,
        "degree": [options.degree.0, options.degree.1],
        "box": {"lo": options.region.lo, "hi": options.region.hi},
        "method": method(options.method),
        "inner": if options.inner == Inner::Tangents { "tangents" } else { "lengths" },
        "seed": options.seed,
        "seconds": made.seconds.iter().map(|(phase, s)| ((*phase).to_owned(), json!(s))).collect::<Map<_, _>>(),
        "patches": list,
        "coverage": made.coverage.as_ref().map(coverage),
        "files": made.written,
        "warnings": made.warnings,
    })
}

/// How a surface is covered. Of boxes in which a margin is not proved there may be thousands: the
/// first hundred are told, as of singular points.
fn coverage(c: &Coverage) -> Value {
    const MOST: usize = 100;
    let mut told = json!({"covered": c.covered, "samples": c.samples});
    if let Some(depth) = &c.depth {
        let boxes = depth.open.iter().take(MOST);
        told["margin"] = json!({
            "length": depth.margin,
            "proved": depth.distance.is_some(),
            "max_distance": depth.distance,
            "open": depth.open.len(),
            "boxes": boxes.map(|b| json!({"lo": b.lo, "hi": b.hi})).collect::<Vec<_>>(),
        });
    }
    if c.left_out > 0 {
        told["left_out"] = json!({
            "samples": c.left_out,
            "distance": c.apart,
            "singular_points": c.singular.len(),
            "points": c.singular.iter().take(MOST).collect::<Vec<_>>(),
        });
    }
    told
}

/// The name of a solver.
pub(super) fn method(method: Method) -> &'static str {
    match method {
        Method::GaussNewton => "gauss-newton",
        Method::Frozen => "frozen",
        Method::Newton => "newton",
    }
}

fn report(p: &Parameterized, made: &Made) -> Value {
    let (g, t, w) = (&p.grown, &p.grown.terms, &p.grown.weights);
    let (least, most) = g.patch.control_weights();
    json!({
        "S": g.sum(),
        "I": t.i,
        "J": t.j,
        "L": t.l,
        "R": t.r,
        "E": t.e,
        "l1": g.targets.l1,
        "l2": g.targets.l2,
        "weights": {"J": w.j, "L": w.l, "R": w.r, "E": w.e},
        "newton_steps": g.count(Phase::Newton),
        "extrapolation_steps": g.count(Phase::Grow),
        "max_distance": p.distances.bound,
        "sampled_distance": p.distances.sampled,
        "rms_distance": p.distances.rms,
        "unfolded": p.is_unfolded,
        "control_weights": [least, most],
        "weight_is_positive": g.patch.weight_is_positive(8),
        "area": g.area(&made.options.region),
        "exact": p.is_exact,
        "entity": p.quadric.as_ref().map(entity),
        "seed_point": g.seed_point,
    })
}

/// The surface that an exact patch lies on.
fn entity(q: &Quadric) -> Value {
    match q {
        Quadric::Plane { normal, offset } => {
            json!({"kind": q.name(), "normal": normal, "offset": offset})
        }
        Quadric::Sphere { center, radius } => {
            json!({"kind": q.name(), "center": center, "radius": radius})
        }
        Quadric::Cylinder {
            point,
            axis,
            radius,
        } => json!({"kind": q.name(), "point": point, "axis": axis, "radius": radius}),
        Quadric::Cone {
            apex,
            axis,
            half_angle,
        } => json!({"kind": q.name(), "apex": apex, "axis": axis, "half_angle": half_angle}),
        Quadric::Torus {
            center,
            axis,
            major,
            minor,
        } => {
            json!({"kind": q.name(), "center": center, "axis": axis, "major_radius": major, "minor_radius": minor})
        }
        Quadric::Other {
            form,
            origin,
            scale,
            coefficients,
        } => {
            let measures = |f: &NormalForm| f.measures[..f.kind.measures()].to_vec();
            json!({
                "kind": q.name(),
                "center": form.map(|f| f.center),
                "axes": form.map(|f| f.axes),
                "measures": form.as_ref().map(measures),
                "origin": origin,
                "scale": scale,
                "coefficients": coefficients,
            })
        }
    }
}
