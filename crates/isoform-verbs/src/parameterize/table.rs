//! The result for people.

use super::MadePatches;
use crate::table::line;
use isoform::Coverage;
use isoform::patch::{Grown, NormalForm, Parameterized, Phase, Quadric};
use isoform::report::{brief, solver_name};

/// The patches, what is proved of them, and where they went.
pub(super) fn text(made: &MadePatches) -> String {
    let (m, n) = made.options.degree;
    let method = solver_name(made.options.method);
    let mut text = line("surface", made.name.clone());
    text += &line("degree", format!("{m},{n}; {method}"));
    match &made.coverage {
        Some(coverage) => text += &cover(coverage, made),
        None => text.extend(made.patches.iter().map(|p| patch(p, made))),
    }
    for finding in made.findings() {
        text += &line("NOT KEPT", finding.to_string());
    }
    let seconds: f64 = made.seconds.iter().map(|s| s.1).sum();
    text += &line("time", format!("{} s", brief(seconds)));
    made.written
        .iter()
        .fold(text, |text, path| text + &line("wrote", path.clone()))
}

/// Returns the share of the surface that the patches cover, and their distance from it.
fn cover(c: &Coverage, made: &MadePatches) -> String {
    let count = made.patches.len();
    let (covered, samples) = (c.covered, c.samples);
    let mut text = line(
        "cover",
        format!("{count} patches on which {covered} of {samples} samples of the surface lie"),
    );
    if c.left_out > 0 {
        let (left_out, apart, points) = (c.left_out, brief(c.apart), c.singular.len());
        text += &line(
            "left out",
            format!("{left_out} samples nearer than {apart} to one of {points} singular points"),
        );
    }
    text += &margin(c);
    let bounds = made.patches.iter().filter_map(|p| p.distances.bound);
    let worst = bounds.fold(0.0, f64::max);
    text + &line("distance", format!("at most {}, proved", brief(worst)))
}

/// Returns the proved depth of the surface inside the patches.
fn margin(c: &Coverage) -> String {
    let Some(depth) = &c.depth else {
        return String::new();
    };
    let Some(distance) = depth.distance else {
        return String::new();
    };
    let (margin, distance) = (brief(depth.margin), brief(distance));
    let but = if c.left_out > 0 { " but that" } else { "" };
    line(
        "margin",
        format!(
            "all of the surface in the box{but} is {margin} or more inside of a patch, at most \
             {distance} from it, proved"
        ),
    )
}

/// The lines of a single patch: where it started, the work, its terms and its distance.
fn patch(p: &Parameterized, made: &MadePatches) -> String {
    let g = &p.grown;
    let [x, y, z] = g.seed_point.map(brief);
    let bound = p.distances.bound.map_or("not proved".to_owned(), |b| {
        format!("at most {}, proved", brief(b))
    });
    let (least, most) = g.patch.control_weights();
    let steps = format!(
        "{} extrapolations, {} Newton steps",
        g.count(Phase::Grow),
        g.count(Phase::Newton)
    );
    let area = format!("{} in the box", brief(g.area(&made.options.region)));
    let distance = format!("{bound}; root mean square {}", brief(p.distances.rms));
    let (least, most) = (brief(least), brief(most));
    let weights = format!("{least} to {most} at the control points");
    let mut lines = vec![
        ("seed", format!("({x}, {y}, {z})")),
        ("steps", steps),
        ("S", terms(g)),
        ("distance", distance),
        ("area", area),
        ("weights", weights),
    ];
    if p.is_exact {
        let entity = entity(p);
        let exact = format!("the patch lies on the surface, to rounding{entity}");
        lines.push(("exact", exact));
    }
    lines
        .into_iter()
        .map(|(name, text)| line(name, text))
        .collect()
}

/// The objective S and its terms.
fn terms(g: &Grown) -> String {
    let t = &g.terms;
    format!(
        "{} with I {}, J {}, L {}, R {}, E {}",
        brief(g.sum()),
        brief(t.i),
        brief(t.j),
        brief(t.l),
        brief(t.r),
        brief(t.e)
    )
}

/// The name of the quadric or torus that the patch lies on, with its measures.
fn entity(p: &Parameterized) -> String {
    match &p.quadric {
        Some(Quadric::Sphere {
            center: [x, y, z],
            radius,
        }) => {
            format!(": a sphere about ({x:.12}, {y:.12}, {z:.12}) of radius {radius:.12}")
        }
        Some(Quadric::Cylinder { radius, .. }) => format!(": a cylinder of radius {radius:.12}"),
        Some(Quadric::Torus {
            center: [x, y, z],
            major,
            minor,
            ..
        }) => {
            format!(
                ": a torus about ({x:.12}, {y:.12}, {z:.12}) of radii {major:.12} and {minor:.12}"
            )
        }
        Some(Quadric::Other {
            form: Some(form), ..
        }) => canonical(form),
        Some(quadric) => format!(": a {}", quadric.name()),
        None => String::new(),
    }
}

/// The kind, the centre and the measures of a quadric.
fn canonical(form: &NormalForm) -> String {
    let [x, y, z] = form.center;
    let kind = form.kind.name();
    let article = if kind.starts_with('e') { "an" } else { "a" };
    let names = ["a", "b", "c"].iter().take(form.kind.measures());
    let measures: Vec<String> = names
        .zip(form.measures)
        .map(|(name, measure)| format!("{name} = {measure:.12}"))
        .collect();
    let measures = measures.join(", ");
    format!(": {article} {kind} about ({x:.12}, {y:.12}, {z:.12}), {measures}")
}
