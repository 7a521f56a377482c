//! The result for people: the certificate as a short table, and the parts.

use super::work::{MadeMesh, Written, place};
use crate::table::{line, measure};
use isoform::RegionCertificate;
use isoform::check::{Certificate, Failure, OppositeSides, Place};
use isoform::geom::{Mesh, Point3};
use isoform::mesh::{Layers, Warning};
use isoform::report::{CertificateReport, FacetsReport, WallsReport, brief};

/// Returns the text of the verb: the mesh, its certificate and the written files.
pub(crate) fn text(made: &MadeMesh) -> String {
    let layers = made.mesh.options.layers.as_ref();
    let mut text = line("size", size(made))
        + &line("region", region(made))
        + &layers.map_or(String::new(), |layers| line("layers", thicknesses(layers)))
        + &of_mesh(
            &made.mesh.meshed.mesh,
            &made.mesh.certificate,
            made.unit.as_deref(),
        );
    let regions = made.mesh.regions.iter();
    text.extend(regions.map(|region| of_region(region, made.unit.as_deref())));
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

/// Returns the counts of a mesh and the figures of its certificate, with its unit of length.
pub(crate) fn of_mesh(mesh: &Mesh, certificate: &Certificate, unit: Option<&str>) -> String {
    let mut lines = vec![line("mesh", what(mesh))];
    lines.extend(
        figures(certificate, unit)
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
fn of_region(region: &RegionCertificate, unit: Option<&str>) -> String {
    let certificate = &region.certificate;
    let tets = certificate.volume.as_ref().map_or(0, |v| v.tets);
    let volume = certificate.surface.as_ref().map_or(0.0, |s| s.volume);
    let text = format!(
        "{}: {tets} tetrahedra, volume {}",
        region.name,
        measure(volume, unit, 3)
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
fn figures(c: &Certificate, unit: Option<&str>) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    if let Some(s) = &c.surface {
        lines.push((
            "topology",
            format!(
                "Euler number {}, {} shells, {} components",
                s.euler, s.shells, s.components
            ),
        ));
        let area = format!("area {}", measure(s.area, unit, 2));
        lines.push((
            "measure",
            match s.enclosed() {
                Some(volume) => format!("volume {}, {area}", measure(volume, unit, 3)),
                None => format!("{area}, with a border"),
            },
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
    lines.extend(for_analysis(c, unit));
    lines.extend(fidelity(c));
    lines
}

/// Returns what a finite element analysis is judged by: measures of elements, layers through walls,
/// facets of curved faces, and the worst elements.
fn for_analysis(c: &Certificate, unit: Option<&str>) -> Vec<(&'static str, String)> {
    let report = CertificateReport::new(c);
    let mut lines = Vec::new();
    if let Some(q) = &report.quality {
        let (aspect, jacobian) = (&q.aspect_ratio, &q.scaled_jacobian);
        let text = format!(
            "aspect ratio at most {:.2}, {:.2} in the mean; scaled Jacobian at least {:.2}, {:.2} \
             in the mean",
            aspect.max, aspect.mean, jacobian.min, jacobian.mean
        );
        lines.push(("quality", text));
    }
    lines.extend(
        report
            .walls
            .iter()
            .map(|walls| ("walls", layers(walls, unit))),
    );
    lines.extend(coarsest(&report.facets, unit).map(|text| ("facets", text)));
    // Of curved elements the Jacobian within them counts.
    let has_curved = c.curved.as_ref().is_some_and(|q| q.curved > 0);
    let decisive = if has_curved {
        "curved Jacobian"
    } else {
        "scaled Jacobian"
    };
    let worst = report.quality.iter().flat_map(|q| &q.worst);
    for worst in worst.filter(|worst| worst.measure == decisive) {
        let number = worst.element.map_or(String::new(), |k| format!(" {k}"));
        let at = brief_place(worst.at);
        let text = format!("element{number}: {decisive} {:.3}, at {at}", worst.value);
        lines.push(("worst", text));
    }
    lines
}

/// Returns the numbers of layers of elements through the walls.
fn layers(walls: &WallsReport, unit: Option<&str>) -> String {
    format!(
        "{} elements or more through each, {} or more through 95 % of the surface; fewest at {}, \
         where it is {} thick",
        walls.layers_min,
        walls.layers_p5,
        brief_place(walls.at),
        length(walls.thickness, unit)
    )
}

/// Returns the part whose facets follow it most coarsely; `None` if all parts are flat.
fn coarsest(facets: &[FacetsReport], unit: Option<&str>) -> Option<String> {
    let curved = facets.iter().filter(|part| part.radius.is_some());
    let part = curved.max_by(|a, b| a.angle.total_cmp(&b.angle))?;
    let angle = format!("{:.1}", part.angle);
    // Flat parts turn by rounding alone, which this many digits do not show.
    if angle == "0.0" {
        return None;
    }
    let distance = part.distance.map_or(String::new(), |d| {
        format!(", faces at most {} off", length(d, unit))
    });
    Some(format!(
        "coarsest on {}: neighbours turn by up to {angle} degrees, about {:.0} elements around its \
         radius of {}{distance}",
        part.part,
        360.0 / part.angle,
        part.radius.map_or(String::new(), |r| length(r, unit)),
    ))
}

/// Returns a length to four digits, with its unit if it is known.
fn length(v: f64, unit: Option<&str>) -> String {
    match unit.filter(|unit| !unit.is_empty()) {
        Some(unit) => format!("{} {unit}", brief(v)),
        None => brief(v),
    }
}

/// Returns a point to four digits.
fn brief_place(at: Point3) -> String {
    let [x, y, z] = at.map(brief);
    format!("({x}, {y}, {z})")
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
