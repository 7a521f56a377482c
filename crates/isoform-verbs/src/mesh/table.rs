//! The result for people: the certificate as a short table, and the parts.

use super::work::{MadeMesh, Written, place};
use crate::table::line;
use isoform::RegionCertificate;
use isoform::check::{Certificate, Failure, OppositeSides, Place};
use isoform::geom::Mesh;
use isoform::mesh::{Layers, Warning};
use isoform::report::brief;

/// Returns the text of the verb: the mesh, its certificate and the written files.
pub(crate) fn text(made: &MadeMesh) -> String {
    let layers = made.mesh.options.layers.as_ref();
    let mut text = line("size", size(made))
        + &line("region", region(made))
        + &layers.map_or(String::new(), |layers| line("layers", thicknesses(layers)))
        + &of_mesh(&made.mesh.meshed.mesh, &made.mesh.certificate);
    text.extend(made.mesh.regions.iter().map(of_region));
    let open = left_open(&made.mesh.meshed.warnings);
    text.extend(open.iter().map(|what| line("LEFT OPEN", what.clone())));
    let verdict = verdict(made.mesh.holds(), !open.is_empty());
    let seconds: f64 = made.seconds.iter().map(|s| s.1).sum();
    text += &line("certificate", format!("{verdict}; {} s", brief(seconds)));
    text + &wrote(&made.written)
}

/// Returns true if the certificate holds, and whether that is all: where something is left open,
/// the exit code is 3 though every figure is as it should be.
fn verdict(holds: bool, is_open: bool) -> &'static str {
    match (holds, is_open) {
        (false, _) => "does not hold",
        (true, true) => "holds of the mesh itself, but something is left open",
        (true, false) => "holds",
    }
}

/// Returns the warnings of the mesher: each kind once, with its places.
fn left_open(warnings: &[Warning]) -> Vec<String> {
    let mut kinds: Vec<(&Warning, usize)> = Vec::new();
    for warning in warnings {
        match kinds
            .iter_mut()
            .find(|(first, _)| first.kind == warning.kind)
        {
            Some((_, count)) => *count += 1,
            None => kinds.push((warning, 1)),
        }
    }
    let told = |(first, count): (&Warning, usize)| {
        let kind = &first.kind;
        match first.at {
            Some(at) if count > 1 => {
                format!("{kind}: {count} places, the first at {}", place(at))
            }
            Some(at) => format!("{kind}, at {}", place(at)),
            None => kind.to_string(),
        }
    };
    kinds.into_iter().map(told).collect()
}

/// Returns the line with the written files.
pub(crate) fn wrote(written: &[Written]) -> String {
    let without = |w: &Written| {
        w.warnings
            .iter()
            .map(|w| format!("; {w}"))
            .collect::<String>()
    };
    written
        .iter()
        .map(|w| line("wrote", format!("{} ({}){}", w.path, w.format, without(w))))
        .collect()
}

/// Returns the counts of a mesh and the figures of its certificate.
pub(crate) fn of_mesh(mesh: &Mesh, certificate: &Certificate) -> String {
    let mut lines = vec![line("mesh", what(mesh))];
    lines.extend(
        figures(certificate)
            .into_iter()
            .map(|(name, text)| line(name, text)),
    );
    if !mesh.parts.is_empty() {
        let faces = [&mesh.triangle_parts[..], &mesh.quad_parts].concat();
        lines.push(line("parts", counted(&mesh.parts, &faces)));
    }
    if mesh.regions.len() > 1 {
        lines.push(line("regions", counted(&mesh.regions, &mesh.tet_regions)));
    }
    lines.extend(failed(certificate));
    lines.concat()
}

/// Returns the figures of a region.
fn of_region(region: &RegionCertificate) -> String {
    let certificate = &region.certificate;
    let tets = certificate.volume.as_ref().map_or(0, |v| v.tets);
    let volume = certificate.surface.as_ref().map_or(0.0, |s| s.volume);
    let text = format!(
        "{}: {tets} tetrahedra, volume {}",
        region.name,
        brief(volume)
    );
    let mut lines = vec![line("in region", text)];
    lines.extend(failed(certificate));
    lines.concat()
}

/// Returns the claims of the certificate that fail.
fn failed(certificate: &Certificate) -> Vec<String> {
    let tell = |failure: &Failure| {
        let at = |p: &Place| format!(", the first at {}", place(p.at));
        let at = failure.place.as_ref().map_or(String::new(), at);
        line("FAILED", format!("{failure}{at}"))
    };
    certificate.failures().iter().map(tell).collect()
}

/// Returns the numbers of elements, nodes, curves and corners.
fn what(mesh: &Mesh) -> String {
    let elements = [
        ("tetrahedra", mesh.tets.len()),
        ("wedges", mesh.wedges.len()),
        ("quadrilaterals", mesh.quads.len()),
    ];
    let there = elements.into_iter().filter(|(_, count)| *count > 0);
    let elements: String = there.map(|(name, n)| format!("{n} {name}, ")).collect();
    format!(
        "{elements}{} triangles, {} nodes, order {}; {} curves, {} corners",
        mesh.triangles.len(),
        mesh.points.len(),
        mesh.order(),
        mesh.curves.len(),
        mesh.corners.len()
    )
}

/// Returns the edge length, and the grade if one is set.
fn size(made: &MadeMesh) -> String {
    let grade = made.mesh.options.grade.map_or(String::new(), |e| {
        format!(", smaller where faces would be {e} off")
    });
    format!("{}{grade}", made.mesh.options.size)
}

/// Returns the thickness of each layer and of all, with their faces.
fn thicknesses(layers: &Layers) -> String {
    let last = layers.first * layers.growth.powi(layers.count as i32 - 1);
    format!(
        "{} of {} to {}, {} together, on {}",
        layers.count,
        layers.first,
        brief(last),
        brief(layers.thickness()),
        layers.parts.join(", ")
    )
}

/// The box that was meshed, and whether it is proved to hold all of the model.
fn region(made: &MadeMesh) -> String {
    let r = made.mesh.meshed.region;
    let axis = |k: usize| format!("{} to {}", brief(r.lo[k]), brief(r.hi[k]));
    let proved = if made.mesh.meshed.region_certified {
        ""
    } else {
        " (not proved)"
    };
    format!("{}, {}, {}{proved}", axis(0), axis(1), axis(2))
}

/// Names with the numbers of their elements.
fn counted(names: &[String], labels: &[u32]) -> String {
    let mut counts = vec![0_usize; names.len()];
    for &label in labels {
        counts[label as usize] += 1;
    }
    let named = names.iter().zip(counts);
    let named: Vec<String> = named.map(|(name, n)| format!("{name} ({n})")).collect();
    named.join(", ")
}

/// Returns the measured figures of the certificate.
fn figures(c: &Certificate) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    if let Some(s) = &c.surface {
        lines.push((
            "topology",
            format!(
                "Euler number {}, {} shells, {} components",
                s.euler, s.shells, s.components
            ),
        ));
        lines.push((
            "measure",
            format!("volume {}, area {}", brief(s.volume), brief(s.area)),
        ));
    }
    if let Some(i) = &c.intersections {
        lines.push((
            "meets itself",
            if i.pairs.is_empty() {
                "nowhere".to_owned()
            } else {
                format!("{} pairs", i.pairs.count)
            },
        ));
    }
    lines.extend(shapes(c));
    lines.extend(fidelity(c));
    lines
}

/// The shapes of the elements: angles, radius ratios and Jacobians.
fn shapes(c: &Certificate) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    if let Some(q) = &c.tets {
        let angles = format!(
            "dihedral {:.2} to {:.2} degrees",
            q.dihedral_min, q.dihedral_max
        );
        lines.push((
            "tetrahedra",
            format!(
                "{angles}, radius ratio at least {:.2}, {:.2} in the mean",
                q.radius_ratio_min, q.radius_ratio_mean
            ),
        ));
    }
    if let Some(w) = &c.wedges {
        lines.push((
            "wedges",
            format!("scaled Jacobian at least {:.2}", w.scaled_jacobian_min),
        ));
    }
    if let Some(q) = &c.curved {
        lines.push((
            "curved",
            format!("scaled Jacobian at least {:.2}", q.scaled_jacobian_min),
        ));
    }
    if let Some(t) = &c.triangles {
        lines.push((
            "triangles",
            format!("angles {:.2} to {:.2} degrees", t.angle_min, t.angle_max),
        ));
    }
    lines
}

/// Returns the distance of the mesh from the model, and the covered share of the model's edges and
/// corners.
fn fidelity(c: &Certificate) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    if let Some(d) = &c.deviation {
        let nodes = d.nodes.max.max(d.curves.max).max(d.mids.max);
        lines.push((
            "distance",
            format!(
                "nodes at most {}, faces at most {}, {} in the mean",
                brief(nodes),
                brief(d.faces.max),
                brief(d.faces.rms)
            ),
        ));
    }
    if let Some(f) = &c.coverage {
        lines.push((
            "features",
            format!(
                "{:.3} % of {} covered, {} of {} corners",
                100.0 * f.covered,
                brief(f.length),
                f.corners - f.missed_corners.count,
                f.corners
            ),
        ));
    }
    if !c.opposite.is_empty() {
        let of = |sides: &OppositeSides| {
            let axis = ["x", "y", "z"][sides.axis];
            format!(
                "{axis}: {} nodes, {} triangles",
                sides.nodes, sides.triangles
            )
        };
        let all: Vec<String> = c.opposite.iter().map(of).collect();
        lines.push(("opposite", all.join("; ")));
    }
    lines
}
