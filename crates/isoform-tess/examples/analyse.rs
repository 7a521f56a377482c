//! Prints what is known exactly about the maps in JSON files {"X": "…", "Y": "…", "Z": "…", "W":
//! "…"}.
//!
//! ```text
//! cargo run --release -p isoform-tess --example analyse MAP.json …
//! ```

use isoform_algebra::Poly;
use isoform_control::Control;
use isoform_io::read_map;
use isoform_tess::{
    Algebraic, BinaryForm, Budget, CurveKind, Map, MapOptions, RealPart, Seam, VARIABLES, analyse,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    if paths.is_empty() {
        return Err("usage: analyse MAP.json …".into());
    }
    for path in paths {
        println!("{path}");
        match read_map(&std::fs::read_to_string(&path)?) {
            Ok(map) => print_map(map.polynomials),
            Err(error) => println!("  {error}; {}", error.hint()),
        }
    }
    Ok(())
}

fn print_map(polynomials: [Poly; 4]) {
    match Map::new(polynomials, MapOptions::default()) {
        Ok(map) => print_analysis(&map),
        Err(error) => println!("  {error}; {}", error.hint()),
    }
}

fn text(p: &Poly) -> String {
    let text = p.display(&VARIABLES).to_string();
    if text.len() > 100 {
        format!(
            "degree {}, {} terms, {} …",
            p.total_degree(),
            p.terms().len(),
            &text[..60]
        )
    } else {
        text
    }
}

fn row(values: &[Algebraic]) -> String {
    values
        .iter()
        .map(Algebraic::to_string)
        .collect::<Vec<_>>()
        .join(" : ")
}

fn print_analysis(map: &Map) {
    let found = analyse(map, &Budget::default(), &Control::default());
    for (name, form) in isoform_tess::KEYS.iter().zip(map.forms()) {
        println!("  {name} = {}", text(form));
    }
    if let Some(d) = found.degrees {
        println!(
            "  degree {}, surface of degree {}, {} preimages, base multiplicity {}",
            d.degree, d.implicit_degree, d.map_degree, d.base_multiplicity
        );
    }
    if let Some(implicit) = &found.implicit {
        let equation = implicit.equation.to_string();
        println!(
            "  F = {}",
            if equation.len() > 150 {
                format!("{} terms", implicit.equation.terms().len())
            } else {
                equation
            }
        );
    }
    for (curve, n) in found.pole.iter().flatten() {
        println!("  pole: {} (multiplicity {n})", text(curve));
    }
    for base in found.base_points.iter().flatten() {
        println!(
            "  base point ({}) in the chart {}",
            row(&base.point),
            base.chart.name()
        );
        print_seam(&base.seam, 4);
    }
    for curve in found.singular.iter().flat_map(|s| &s.curves) {
        let kind = match &curve.kind {
            CurveKind::Contracted(c) => {
                let points: Vec<String> =
                    c.points().iter().map(|p| format!("({})", row(p))).collect();
                format!(
                    "contracted to {}",
                    if points.is_empty() {
                        "complex points".to_owned()
                    } else {
                        points.join(", ")
                    }
                )
            }
            CurveKind::Ramified => "ramified".to_owned(),
            CurveKind::Double => "double".to_owned(),
        };
        let real = match &curve.real {
            RealPart::Curve => "real arcs".to_owned(),
            RealPart::NoArc => "no real arc".to_owned(),
            RealPart::Points(points) => {
                format!(
                    "real points only: [{}]",
                    points
                        .iter()
                        .map(|p| format!("({})", row(p)))
                        .collect::<Vec<_>>()
                        .join(", ")
                )
            }
        };
        let in_double = curve.in_double.map_or("?".to_owned(), |n| n.to_string());
        println!(
            "  {}: {kind}; {real}; multiplicity {in_double} in D, {} in J",
            text(&curve.curve),
            curve.in_minors
        );
    }
    for finding in &found.findings {
        println!("  unproven: {finding}");
    }
    let seconds: Vec<String> = found
        .seconds
        .iter()
        .map(|(phase, s)| format!("{phase} {s:.4}"))
        .collect();
    println!("  seconds: {}", seconds.join(", "));
}

fn print_seam(seam: &Seam, indent: usize) {
    let form = |f: &BinaryForm| {
        let d = f.degree();
        let terms = f
            .coefficients
            .iter()
            .enumerate()
            .filter(|(_, c)| !c.is_zero());
        let terms: Vec<String> = terms
            .map(|(j, c)| format!("{c}·a^{}b^{j}", d - j))
            .collect();
        if terms.is_empty() {
            "0".to_owned()
        } else {
            terms.join(" + ")
        }
    };
    println!(
        "{:indent$}multiplicity {}, seam of degree {}:",
        "",
        seam.multiplicity,
        seam.curve[0].degree()
    );
    println!(
        "{:indent$}  ({})",
        "",
        seam.curve.each_ref().map(form).join(" : ")
    );
    for near in &seam.near {
        println!(
            "{:indent$}infinitely near in the direction ({}):",
            "",
            row(&near.direction)
        );
        print_seam(&near.seam, indent + 2);
    }
}
