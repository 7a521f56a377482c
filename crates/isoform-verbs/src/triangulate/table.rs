//! The result for people.

use super::MadeSurface;
use crate::mesh::table::wrote;
use crate::table::line;
use isoform::algebra::CurveTopology;
use isoform::report::{brief, contracted, folds, mode_name};
use isoform::tess::{BasePoint, Basis, Claim, Domain, Mode, RealBorder, Surface, Verdict};
use std::path::PathBuf;

/// The surface, its mesh, what is proved, and where it went.
pub(super) fn text(made: &MadeSurface, beside: &[&Option<PathBuf>]) -> String {
    let seconds: f64 = made.drawn.seconds.iter().map(|s| s.1).sum();
    let mut text = line("map", map(made));
    if let Some(domain) = made.drawn.options.domain.as_ref() {
        text += &line("region", region(domain));
    }
    text += &line("box", in_box(made));
    if let ([analysis], []) = (&made.drawn.analyses[..], &made.drawn.patches[..]) {
        text += &line("base points", base_points(analysis.base_points.as_deref()));
        text += &line("pole", pole(analysis.pole_topology.as_ref()));
        text += &line("double curve", double_curve(made));
    }
    text += &contracted_curves(made);
    text += &real_border(made);
    text += &mesh(made);
    text += &certificate(made);
    text += &line("time", format!("{} s", brief(seconds)));
    text += &wrote(&made.written);
    for path in beside.iter().copied().flatten() {
        text += &line("wrote", path.display().to_string());
    }
    text
}

/// The topology of the triangles and their number.
fn mesh(made: &MadeSurface) -> String {
    let (surface, topology) = (&made.drawn.surface, &made.drawn.topology);
    let parts = [
        format!("Euler number {}", topology.euler),
        count(topology.components, "component"),
        count(topology.boundary_loops, "boundary loop"),
    ];
    let triangles = count(surface.triangles.len(), "triangle");
    let vertices = surface.points.len();
    line("topology", parts.join(", "))
        + &line("winding", winding(surface))
        + &line("mesh", format!("{triangles}, {vertices} vertices"))
}

/// Returns how triangles are turned against their neighbours, and in space.
fn winding(surface: &Surface) -> String {
    let winding = &surface.winding;
    if !surface.holds(Claim::Winding) {
        return "not consistent".to_owned();
    }
    if !winding.is_orientable() {
        let cut = winding.cut_lines().into_iter().map(|(along, lines)| {
            let edges = lines.iter().map(|l| l.len() - 1).sum();
            format!("{} along {along}", count(edges, "edge"))
        });
        let cut: Vec<String> = cut.collect();
        let cut = cut.join(", ");
        return format!("not orientable: consistent but for a cut of {cut}");
    }
    let sides = match winding.outward {
        0 => "normals as \u{2202}/\u{2202}s \u{d7} \u{2202}/\u{2202}t".to_owned(),
        n if n == winding.pieces => "normals outward".to_owned(),
        n => format!("normals of {n} of {} pieces outward", winding.pieces),
    };
    format!("consistent, {sides}")
}

/// Returns true if the surface is certified, each finding that stands against it, and the claims.
fn certificate(made: &MadeSurface) -> String {
    let verdict = if made.is_certified() {
        "certified"
    } else {
        "not certified:"
    };
    let mut text = line("certificate", verdict.to_owned());
    for finding in &made.drawn.surface.findings {
        text += &line("", finding.to_string());
    }
    for finding in made.drawn.beyond.iter().flat_map(|s| &s.findings) {
        text += &line("", format!("complex parameters: {finding}"));
    }
    text + &line("claims", claims(&made.drawn.surface))
}

/// The degrees of the map, or how many patches there are.
fn map(made: &MadeSurface) -> String {
    match made.drawn.patches.len() {
        0 => degrees(made),
        n => format!(
            "{}, of degree {} or less",
            count(n, "patch").replace("patchs", "patches"),
            degree(made)
        ),
    }
}

/// The corners of a region of parameters.
fn region(domain: &Domain) -> String {
    let corners = domain.corners().iter();
    let corners: Vec<String> = corners.map(|[s, t]| format!("({s}, {t})")).collect();
    corners.join(" ")
}

/// The box, the fineness of the mesh in it, and the mode.
fn in_box(made: &MadeSurface) -> String {
    let mesh = &made.drawn.options.mesh;
    let chosen = if made.drawn.is_box_chosen {
        ", chosen to hold all of it,"
    } else {
        ""
    };
    format!(
        "{}{chosen} about the origin in x, y and z; tolerance {}, edges up to {}; {}",
        made.half_width,
        mesh.tolerance,
        mesh.longest,
        mode_name(made.drawn.options.mode)
    )
}

/// A line for each curve of parameters that the map contracts to points. The real components of one
/// curve may be contracted to several conjugate points.
fn contracted_curves(made: &MadeSurface) -> String {
    if !made.drawn.patches.is_empty() {
        return String::new();
    }
    let curves: Vec<_> = made.drawn.analyses.iter().flat_map(contracted).collect();
    let curves = curves.chunk_by(|a, b| a.curve == b.curve);
    curves
        .enumerate()
        .map(|(i, of_one)| {
            let points: Vec<String> = of_one.iter().map(|c| point(c.point)).collect();
            let name = if i == 0 { "contracted" } else { "" };
            let (curve, points) = (&of_one[0].curve, points.join(" and "));
            line(name, format!("{curve} = 0 to {points}"))
        })
        .collect()
}

/// The border of the real image of an improper map.
fn real_border(made: &MadeSurface) -> String {
    let border = &made.drawn.surface.real_border;
    if border.is_empty() {
        return String::new();
    }
    let folds = equations(border);
    let mut text = format!("of the real image: {}", count(border.lines.len(), "line"));
    if !folds.is_empty() {
        text += &format!(" ({})", folds.join(", "));
    }
    text += "; beyond are complex parameters";
    let triangles: usize = made.drawn.beyond.iter().map(|s| s.triangles.len()).sum();
    if !made.drawn.beyond.is_empty() {
        text += &format!(": {}", count(triangles, "triangle"));
    }
    line("border", text)
}

/// A point for people; contracted curves may go to infinity.
fn point(at: Option<[f64; 3]>) -> String {
    match at {
        None => "a point at infinity".to_owned(),
        Some([x, y, z]) => format!("({x}, {y}, {z})"),
    }
}

/// Returns the number of claims by basis, and the unproved claims.
fn claims(surface: &Surface) -> String {
    let certificate = surface.certificate();
    let named = |is_it: &dyn Fn(Verdict) -> bool| -> Vec<String> {
        let these = certificate.decided().filter(|(_, verdict)| is_it(*verdict));
        these.map(|(claim, _)| claim.to_string()).collect()
    };
    let mut parts = Vec::new();
    let mut tell = |claims: Vec<String>, how: &str, is_listed: bool| {
        let list = match is_listed {
            true => format!(" ({})", claims.join(", ")),
            false => String::new(),
        };
        if !claims.is_empty() {
            parts.push(format!("{} {how}{list}", claims.len()));
        }
    };
    for basis in Basis::ALL {
        let is_on = |verdict| verdict == Verdict::Holds(basis);
        tell(named(&is_on), in_words(basis), basis == Basis::Floating);
    }
    let assumed = named(&|verdict| matches!(verdict, Verdict::Assumed(_)));
    tell(assumed, "assumed", true);
    tell(named(&|verdict| verdict == Verdict::Open), "open", false);
    parts.join(", ")
}

/// Returns a basis in words.
fn in_words(basis: Basis) -> &'static str {
    match basis {
        Basis::Exact => "proved exactly",
        Basis::Bounded => "proved with bounds on rounding",
        Basis::Floating => "checked in floating point, not proved",
    }
}

/// The equations of the folds in which the real image ends.
pub(super) fn equations(border: &RealBorder) -> Vec<String> {
    folds(border).iter().map(|f| format!("{f} = 0")).collect()
}

/// `no boundary loops`, `1 triangle`, `2 triangles`.
pub(super) fn count(n: usize, what: &str) -> String {
    match n {
        0 => format!("no {what}s"),
        1 => format!("1 {what}"),
        n => format!("{n} {what}s"),
    }
}

/// The largest degree of the maps.
fn degree(made: &MadeSurface) -> usize {
    made.drawn
        .maps
        .iter()
        .map(isoform::tess::Map::degree)
        .max()
        .unwrap_or(0)
}

/// The degrees of the map and of the surface that it covers, and how often it does.
fn degrees(made: &MadeSurface) -> String {
    let degree = degree(made);
    match made.drawn.analyses.first().and_then(|a| a.degrees) {
        None => format!("of degree {degree}; how often it covers the surface is unknown"),
        Some(d) if d.map_degree == 1 => format!(
            "of degree {degree}, proper, onto a surface of degree {}",
            d.implicit_degree
        ),
        Some(d) => {
            let drawn = match made.drawn.surface.sheets {
                1 => ", of which one is drawn",
                n if n < d.map_degree => ", of which some are drawn",
                _ => "",
            };
            let [several, onto] = [d.map_degree, d.implicit_degree];
            format!(
                "of degree {degree}, improper: {several} parameters for each point of a surface of \
                 degree {onto}{drawn}"
            )
        }
    }
}

/// The real base points; unknown where the analysis did not come to its end.
fn base_points(points: Option<&[BasePoint]>) -> String {
    let Some(points) = points else {
        return "unknown".to_owned();
    };
    match points {
        [] => "none that is real".to_owned(),
        points => format!(
            "{} real: {}",
            points.len(),
            points.iter().map(base_point).collect::<Vec<_>>().join("; ")
        ),
    }
}

/// The place of a base point, its multiplicity, and how often it is blown up.
fn base_point(p: &BasePoint) -> String {
    let [s, t, w] = p.to_f64().map(brief);
    let mut text = format!("({s} : {t} : {w})");
    if p.multiplicity() > 1 {
        text += &format!(" of multiplicity {}", p.multiplicity());
    }
    if p.seam.blowups() > 0 {
        text += &format!(", blown up {} times more", p.seam.blowups());
    }
    text
}

/// The components of the pole, the curve W = 0.
fn pole(pole: Option<&CurveTopology>) -> String {
    let Some(pole) = pole else {
        return "unknown".to_owned();
    };
    let kinds = [
        (pole.ovals, "oval"),
        (pole.pseudolines, "pseudoline"),
        (pole.singular, "branching component"),
        (pole.isolated, "isolated point"),
    ];
    let parts: Vec<String> = kinds
        .iter()
        .filter(|k| k.0 > 0)
        .map(|&(n, what)| count(n, what))
        .collect();
    if parts.is_empty() {
        "none".to_owned()
    } else {
        parts.join(", ")
    }
}

/// The arcs of the double curve in the box.
fn double_curve(made: &MadeSurface) -> String {
    let (double, solitary) = (
        made.drawn.surface.double_curve.len(),
        made.drawn.surface.solitary_arcs.len(),
    );
    let is_glued = made.drawn.options.mode == Mode::Glued;
    if is_glued && !made.drawn.surface.is_double_curve_known {
        return "not looked for to the end".to_owned();
    }
    match (double, solitary) {
        (0, 0) if !is_glued => "not asked for".to_owned(),
        (0, 0) => "none in the box".to_owned(),
        (n, 0) => count(n, "arc"),
        (n, k) => format!(
            "{}; {} that only conjugate parameters reach",
            count(n, "arc"),
            count(k, "arc")
        ),
    }
}
