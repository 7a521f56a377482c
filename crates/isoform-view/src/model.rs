//! Models as tapes in the document of a page.

use isoform::LiveModel;
use isoform::field::{Binary, Join, Native, SetOp, Tape, TapeStep, Unary};
use serde_json::{Value, json};

/// Maximum number of steps of a tape from which a shader is made: compilers of shaders take seconds
/// for more.
const MAX_SHADER_STEPS: usize = 4000;

/// Returns true if a page can draw a model by a shader: its tape is short enough and has no
/// iterations that shaders lack. Steps that serve only the last two results, which measure, are
/// ignored.
pub(crate) fn can_be_drawn(model: &LiveModel) -> bool {
    let tape = &model.readings.tape;
    let steps: Vec<TapeStep> = tape.steps().collect();
    let first = tape.constants().len() + tape.dimension() + tape.n_params();
    let mut need = vec![false; first + steps.len()];
    for slot in &tape.results()[..tape.n_results() - 2] {
        need[*slot as usize] = true;
    }
    let mut count = 0;
    for (k, step) in steps.iter().enumerate().rev() {
        if !need[first + k] {
            continue;
        }
        if matches!(
            step,
            TapeStep::Native(
                Native::SardfRoot | Native::PerlinNoise | Native::Imported(_),
                _
            )
        ) {
            return false;
        }
        count += 1;
        for slot in step.arguments() {
            need[slot as usize] = true;
        }
    }
    count <= MAX_SHADER_STEPS
}

/// Returns the layer of a model with adjustable parameters.
pub(crate) fn layer(name: &str, title: Option<&str>, model: &LiveModel) -> Value {
    let parameters: Vec<Value> = model
        .parameters
        .iter()
        .map(|p| {
            json!({
                "index": p.index, "name": p.name, "description": p.description, "unit": p.unit,
                "value": p.value, "lower": p.lower, "upper": p.upper, "shift": p.shift,
                "isOpen": p.is_open,
            })
        })
        .collect();
    let tree: Vec<Value> = model
        .readings
        .tree
        .iter()
        .map(|join| match join {
            Join::Part(part) => json!(part),
            Join::Min => json!("min"),
            Join::Max => json!("max"),
        })
        .collect();
    json!({
        "kind": "model",
        "name": name,
        "title": title,
        "count": 1,
        "tape": tape(&model.readings.tape),
        "tree": tree,
        "parts": model.readings.part_names,
        "values": model.values,
        "parameters": parameters,
        "bounds": [model.bounds.lo, model.bounds.hi],
        "isCut": model.is_cut,
        "isSurface": model.is_surface,
        "isLoose": model.is_loose,
        "origin": model.origin,
    })
}

/// Returns a tape: constants, then for each step its name and its arguments.
fn tape(tape: &Tape) -> Value {
    let steps: Vec<Value> = tape
        .steps()
        .map(|step| match step {
            TapeStep::Unary(op, u) => json!([unary(op), u]),
            TapeStep::Binary(op, u, v) => json!([binary(op), u, v]),
            TapeStep::Set(op, u, v) => json!([set(op), u, v]),
            TapeStep::PowI(u, n) => json!(["powi", u, n]),
            TapeStep::Select(c, u, v) => json!(["select", c, u, v]),
            TapeStep::Native(function, list) => {
                let mut all = vec![json!(native(&function))];
                all.extend(list.iter().map(|slot| json!(slot)));
                Value::from(all)
            }
        })
        .collect();
    // Numbers that JSON cannot represent are written as words.
    let constants: Vec<Value> = tape
        .constants()
        .iter()
        .map(|c| {
            if c.is_finite() {
                json!(c)
            } else {
                json!(word(*c))
            }
        })
        .collect();
    json!({
        "inputs": tape.dimension(),
        "parameters": tape.n_params(),
        "constants": constants,
        "steps": steps,
        "uniform": tape.uniform_steps(),
        "results": tape.results(),
    })
}

/// Returns the JavaScript name of a number that JSON cannot represent.
fn word(number: f64) -> &'static str {
    if number.is_nan() {
        "NaN"
    } else if number > 0.0 {
        "Infinity"
    } else {
        "-Infinity"
    }
}

/// Returns the page's name of a function of one argument.
fn unary(op: Unary) -> &'static str {
    match op {
        Unary::Neg => "neg",
        Unary::Abs => "abs",
        Unary::Square => "square",
        Unary::Sqrt => "sqrt",
        Unary::Exp => "exp",
        Unary::Ln => "ln",
        Unary::Sin => "sin",
        Unary::Cos => "cos",
        Unary::Tan => "tan",
        Unary::Asin => "asin",
        Unary::Acos => "acos",
        Unary::Atan => "atan",
        Unary::Sinh => "sinh",
        Unary::Cosh => "cosh",
        Unary::Tanh => "tanh",
        Unary::Floor => "floor",
        Unary::Ceil => "ceil",
        Unary::Trunc => "trunc",
        Unary::Sign => "sign",
    }
}

/// Returns the page's name of a function of two arguments.
fn binary(op: Binary) -> &'static str {
    match op {
        Binary::Add => "add",
        Binary::Sub => "sub",
        Binary::Mul => "mul",
        Binary::Div => "div",
        Binary::Pow => "pow",
        Binary::Atan2 => "atan2",
        Binary::Less => "less",
        Binary::LessEq => "lesseq",
    }
}

/// Returns the page's name of a set operation.
fn set(op: SetOp) -> &'static str {
    match op {
        SetOp::RUnion => "runion",
        SetOp::RIntersection => "rintersection",
        SetOp::Max => "max",
        SetOp::Min => "min",
    }
}

/// Returns the page's name of a function that is computed by iteration or has no closed form.
fn native(function: &Native) -> &'static str {
    match function {
        Native::EllipsoidDistance => "ellipsoid",
        Native::SardfRoot => "sardfroot",
        Native::Fmod => "fmod",
        Native::PerlinNoise => "perlin",
        // `can_be_drawn` refuses it.
        Native::Imported(_) => unreachable!(),
    }
}

#[cfg(test)]
mod tests {
    /// Returns the names that the functions above give to operations.
    fn names() -> Vec<&'static str> {
        let here = include_str!("model.rs");
        let functions = &here[here.find("fn unary").expect("the first of them")..];
        let functions = &functions[..functions.find("mod tests").expect("the tests")];
        functions.split('"').skip(1).step_by(2).collect()
    }

    /// A page rejects an operation that it does not know; an operation without a range is never
    /// pruned.
    #[test]
    fn the_page_knows_every_operation() {
        let files = [
            ("tape.ts", include_str!("../../../web/src/tape.ts")),
            ("interval.ts", include_str!("../../../web/src/interval.ts")),
            ("glsl.ts", include_str!("../../../web/src/glsl.ts")),
        ];
        let names = names();
        assert_eq!((names[0], names[names.len() - 1]), ("neg", "perlin"));
        for (file, text) in files {
            let words = text.split(|c: char| !c.is_ascii_alphanumeric());
            let words: std::collections::BTreeSet<&str> = words.collect();
            for name in &names {
                let is_known = words.contains(name) || file != "tape.ts" && NATIVE.contains(name);
                assert!(is_known, "{name} is not in {file}");
            }
        }
    }

    /// Functions without a range, which are drawn as triangles.
    const NATIVE: [&str; 4] = ["ellipsoid", "sardfroot", "fmod", "perlin"];
}
