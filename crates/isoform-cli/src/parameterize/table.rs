//! The result for people.

use super::Made;
use crate::mesh::table::line;
use isoform::patch::{Parameterized, Phase, Quadric};
use isoform::report::{brief, solver_name};

/// The patches, what is proved of them, and where they went.
pub(super) fn text(made: &Made) -> String {
    let (m, n) = made.options.degree;
    let mut text = line("surface", made.name.clone())
        + &line(
            "degree",
            format!("{m},{n}; {}", solver_name(made.options.method)),
        );
    if let Some(c) = &made.coverage {
        text += &line(
            "cover",
            format!(
                "{} patches on which {} of {} samples of the surface lie",
                made.patches.len(),
                c.covered,
                c.samples
            ),
        );
        if c.left_out > 0 {
            text += &line(
                "left out",
                format!(
                    "{} samples nearer than {} to one of {} singular points",
                    c.left_out,
                    brief(c.apart),
                    c.singular.len()
                ),
            );
        }
        if let Some((depth, distance)) = c.depth.as_ref().and_then(|d| Some((d, d.distance?))) {
            let (margin, distance) = (brief(depth.margin), brief(distance));
            text += &line(
                "margin",
                format!(
                    "all of the surface in the box{} is {margin} or more inside of a patch, at \
                     most {distance} from it, proved",
                    if c.left_out > 0 { " but that" } else { "" }
                ),
            );
        }
        let worst = made
            .patches
            .iter()
            .filter_map(|p| p.distances.bound)
            .fold(0.0, f64::max);
        text += &line("distance", format!("at most {}, proved", brief(worst)));
    }
    for p in &made.patches {
        if made.coverage.is_none() {
            text += &patch(p, made);
        }
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

fn patch(p: &Parameterized, made: &Made) -> String {
    let (g, t) = (&p.grown, &p.grown.terms);
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
    let terms = format!(
        "{} with I {}, J {}, L {}, R {}, E {}",
        brief(g.sum()),
        brief(t.i),
        brief(t.j),
        brief(t.l),
        brief(t.r),
        brief(t.e)
    );
    line("seed", format!("({x}, {y}, {z})"))
        + &line("steps", steps)
        + &line("S", terms)
        + &line(
            "distance",
            format!("{bound}; root mean square {}", brief(p.distances.rms)),
        )
        + &line(
            "area",
            format!("{} in the box", brief(g.area(&made.options.region))),
        )
        + &line(
            "weights",
            format!("{} to {} at the control points", brief(least), brief(most)),
        )
        + &if p.is_exact {
            line(
                "exact",
                format!("the patch lies on the surface, to rounding{}", entity(p)),
            )
        } else {
            String::new()
        }
}

/// Which surface that is.
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
        Some(Quadric::Other { form: Some(f), .. }) => {
            let [x, y, z] = f.center;
            let kind = f.kind.name();
            let article = if kind.starts_with('e') { "an" } else { "a" };
            let measures = ["a", "b", "c"]
                .iter()
                .zip(f.measures)
                .take(f.kind.measures());
            let measures: Vec<String> = measures.map(|(n, m)| format!("{n} = {m:.12}")).collect();
            let measures = measures.join(", ");
            format!(": {article} {kind} about ({x:.12}, {y:.12}, {z:.12}), {measures}")
        }
        Some(quadric) => format!(": a {}", quadric.name()),
        None => String::new(),
    }
}
