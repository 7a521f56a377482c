//! Functions of programs and polynomials, as surfaces for patches; and patches as faces for CAD, as
//! records and as triangles.

use isoform_algebra::{ParseError, Poly};
use isoform_field::hyperfun::Model;
use isoform_field::{
    Bound, Graph, Polynomial, Residual, RunField, SolidError, Tape, parameter_values,
};
use isoform_geom::{Column, Field, Mesh, Parts, RationalPatch, dot};
use isoform_io::{PatchRecord, StepFace};
use isoform_patch::{Parameterized, foot_distances};

/// Names of the coordinates in polynomials.
pub const COORDINATES: [&str; 3] = ["x", "y", "z"];

/// Returns a model with the values `a` of its parameters as a function of space, as the program
/// states it (not as a distance), and true if its program must be run statement by statement, so
/// that nothing can be proved about it. Missing values are those of [`parameter_values`].
///
/// # Errors
/// [`SolidError::Dimension`], [`SolidError::Parameters`].
pub fn field_of(model: &Model, a: &[f64]) -> Result<(Box<dyn Field>, bool), SolidError> {
    // Also refuses other dimensions than 3 and other numbers of values, which cannot be evaluated.
    let run = RunField::new(model, a)?;
    let mut graph = Graph::new();
    match model.compile(&mut graph) {
        Ok(root) => {
            let tape = Tape::new(&graph, &[root], 3, model.n_params());
            let a = parameter_values(model, a)?;
            Ok((Box::new(Bound::new(Residual::new(tape), &a)), false))
        }
        Err(_) => Ok((Box::new(run), true)),
    }
}

/// Returns the smooth parts of a model with the values `a` of its parameters, for patches that end
/// at its edges; `None` if its program is not an expression, or if it has one part or too many.
pub fn parts_of(model: &Model, a: &[f64]) -> Option<Parts> {
    isoform_field::parts_of(model, a)
        .ok()
        .filter(|parts| parts.parts.len() > 1)
}

/// Magnitude of a polynomial's largest coefficient below which the polynomial is scaled; it is also
/// scaled above the inverse. Squares of gradients then stay within the range of doubles.
const MIN_LARGEST_COEFFICIENT: f64 = 1.0 / (1u128 << 100) as f64;

/// Parses a polynomial in x, y and z with rational coefficients, or an equation of two, and rounds
/// the coefficients to nearest;
/// `None` if one is beyond the range of doubles, or the polynomial is constant. If the largest
/// coefficient is above 2¹⁰⁰ or below 2⁻¹⁰⁰, the polynomial is divided by it before rounding: that
/// does not change its surface, and makes multiples of a polynomial equal.
///
/// ```
/// use isoform::geom::Field;
/// let sphere = isoform::polynomial("x^2 + y^2 + z^2 - 1/4")?.expect("a surface");
/// assert_eq!(sphere.value([0.5, 0.0, 0.0]), 0.0);
/// # Ok::<(), isoform::algebra::ParseError>(())
/// ```
///
/// # Errors
/// [`ParseError`] if the text is not a polynomial.
pub fn polynomial(text: &str) -> Result<Option<Polynomial>, ParseError> {
    Ok(rounded_polynomial(&Poly::parse_equation(
        text,
        &COORDINATES,
    )?))
}

/// Rounds the coefficients of a polynomial, as [`polynomial`] does.
pub(crate) fn rounded_polynomial(exact: &Poly) -> Option<Polynomial> {
    let mut terms = rounded(exact);
    let usable = !exact.is_constant() && terms.iter().all(|t| t.1.is_finite());
    // Squares of gradients must be finite, and not 0.
    let by_size = |a: &&(_, f64), b: &&(_, f64)| a.1.abs().total_cmp(&b.1.abs());
    if let Some((e, c)) = exact.to_f64().iter().max_by(by_size).copied()
        && usable
        && !(MIN_LARGEST_COEFFICIENT..=1.0 / MIN_LARGEST_COEFFICIENT).contains(&c.abs())
        && let Some(scaled) = exact.div_exact(&Poly::constant(exact.coefficient(e)))
    {
        terms = rounded(&scaled);
    }
    usable.then(|| Polynomial::new(terms))
}

/// Returns the terms of a polynomial in three variables, rounded to nearest.
fn rounded(exact: &Poly) -> Vec<([u16; 3], f64)> {
    let terms = exact.to_f64().into_iter();
    terms.map(|(e, c)| ([e[0], e[1], e[2]], c)).collect()
}

/// Returns patches as faces for STEP, with their normals to the outside, where the function falls.
/// Exact patches carry the quadric on which they lie.
pub fn step_faces(field: &dyn Field, patches: &[Parameterized]) -> Vec<StepFace> {
    let face = |(i, p): (usize, &Parameterized)| {
        let patch = if is_outward(field, &p.grown.patch) {
            p.grown.patch.clone()
        } else {
            p.grown.patch.transposed()
        };
        StepFace {
            name: format!("patch {}", i + 1),
            patch,
            surface: p.quadric.filter(|_| p.is_exact),
        }
    };
    patches.iter().enumerate().map(face).collect()
}

/// Returns patches as records for their file. A patch is certified if its distance is bounded by
/// proof and it is proved not to fold over. Without a bound, the record states the largest distance
/// of samples.
///
/// ```
/// use isoform::geom::Aabb;
/// use isoform::io::write_patches;
/// use isoform::patch::Options;
/// use isoform::{Control, ImplicitSurface, parameterize_surface, patch_records};
///
/// let sphere = ImplicitSurface::of_polynomial("x^2 + y^2 + z^2 - 1/4")?.expect("a surface");
/// let options = Options::new((2, 2), 1e-3, Aabb { lo: [-0.5; 3], hi: [0.5; 3] });
/// let patch = parameterize_surface(&sphere, &options, &Control::default())?;
/// let records = patch_records(std::slice::from_ref(&patch));
/// assert!(records[0].certified);
/// assert_eq!(Some(records[0].max_distance), patch.distances.bound);
/// let file = write_patches(&records); // the bytes of patches.json
/// # assert!(!file.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn patch_records(patches: &[Parameterized]) -> Vec<PatchRecord> {
    let record = |p: &Parameterized| PatchRecord {
        patch: p.grown.patch.clone(),
        max_distance: p.distances.bound.unwrap_or(p.distances.sampled),
        certified: p.distances.bound.is_some() && p.is_unfolded,
        rms_distance: p.distances.rms,
        seed_point: p.grown.seed_point,
    };
    patches.iter().map(record).collect()
}

/// Triangulates patches: two triangles for each of `squares`² squares of the domain, a part for
/// each patch, oriented counterclockwise from outside, where the function falls. Columns of the
/// mesh hold u, v and the distance from the surface at every node.
///
/// # Panics
/// If `squares` is 0.
pub fn patch_mesh(field: &dyn Field, patches: &[Parameterized], squares: usize) -> Mesh {
    assert!(squares > 0, "a grid has squares");
    let mut mesh = Mesh::default();
    let (mut us, mut vs) = (Vec::new(), Vec::new());
    for (number, p) in patches.iter().enumerate() {
        let patch = &p.grown.patch;
        let first = mesh.points.len() as u32;
        for (u, v) in grid(squares) {
            mesh.points.push(patch.point(u, v));
            us.push(u);
            vs.push(v);
        }
        let triangles = grid_triangles(first, squares, is_outward(field, patch));
        mesh.triangles.extend(triangles);
        let count = 2 * squares * squares;
        mesh.triangle_parts
            .extend(std::iter::repeat_n(number as u32, count));
        mesh.parts.push(format!("patch {}", number + 1));
    }
    let distances = foot_distances(field, &mesh.points);
    let column = |name: &str, values| Column {
        name: name.to_owned(),
        values,
    };
    mesh.columns = vec![
        column("u", us),
        column("v", vs),
        column("distance", distances),
    ];
    mesh
}

/// Returns the parameters of the nodes of a grid of `squares`² squares over the unit square.
fn grid(squares: usize) -> impl Iterator<Item = (f64, f64)> {
    let side = squares + 1;
    (0..side * side).map(move |k| {
        (
            (k / side) as f64 / squares as f64,
            (k % side) as f64 / squares as f64,
        )
    })
}

/// Returns two triangles for each square of the grid whose nodes begin at number `first`,
/// counterclockwise in u and v or clockwise.
fn grid_triangles(
    first: u32,
    squares: usize,
    counterclockwise: bool,
) -> impl Iterator<Item = [u32; 3]> {
    let side = squares + 1;
    (0..squares * squares).flat_map(move |k| {
        let corner =
            |i: usize, j: usize| first + ((k / squares + i) * side + k % squares + j) as u32;
        let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        if counterclockwise {
            [[a, b, c], [a, c, d]]
        } else {
            [[a, c, b], [a, d, c]]
        }
    })
}

/// Returns true if ∂p/∂u × ∂p/∂v at the centre points to the side where the function falls.
fn is_outward(field: &dyn Field, patch: &RationalPatch) -> bool {
    let middle = patch.tangents(0.5, 0.5);
    dot(middle.normal(), field.jet(middle.point).g) <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Control, ImplicitSurface, parameterize_surface};
    use isoform_geom::Aabb;
    use isoform_patch::Options;

    /// A record is certified only with a bound and without a fold, and states the largest known
    /// distance.
    #[test]
    fn records_say_what_is_proved() {
        let sphere = ImplicitSurface::of_polynomial("x^2 + y^2 + z^2 - 1/4")
            .expect("a polynomial")
            .expect("a surface");
        let region = Aabb {
            lo: [-0.5; 3],
            hi: [0.5; 3],
        };
        let options = Options::new((2, 2), 1e-2, region);
        let made = parameterize_surface(&sphere, &options, &Control::default()).expect("a patch");
        let (mut folded, mut unbounded) = (made.clone(), made.clone());
        folded.is_unfolded = false;
        unbounded.distances.bound = None;
        let sampled = made.distances.sampled;
        let bound = made.distances.bound.expect("a bound");
        let found = patch_records(&[made, folded, unbounded]);
        let known: Vec<_> = found
            .iter()
            .map(|r| (r.certified, r.max_distance))
            .collect();
        assert_eq!(known, [(true, bound), (false, bound), (false, sampled)]);
    }
}
