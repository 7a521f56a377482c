//! Recognition of objects that only call another one with moved points, as fitted programs do.

use super::Model;
use super::ast::{ArrayRef, Expr, HEAD_ARRAYS, Link, Object, Operator, Statement};
use super::print::Placement;

/// Tolerance on the orthonormality of the rows of a rotation: rounding of products of rotations.
const ROTATION_TOLERANCE: f64 = 1e-12;

/// Affine function of x, y and z: its linear part, and its value at the origin.
type Affine = ([f64; 3], f64);

impl Model {
    /// Returns the object that this one calls with points moved by a similarity and with its own
    /// parameters, and the placement of that object in the coordinates of this one; `None` for any
    /// other object.
    ///
    /// ```
    /// use isoform_field::hyperfun::{Mode, Model};
    /// let text = "ball(x[3], a[1]) { ball = a[1]^2 - x[1]^2 - x[2]^2 - x[3]^2; }
    /// -- @values b of ball
    /// my_model(x[3], a[1]) {
    ///   array b[1], p[3];
    ///   p[1] = x[2] - 5; p[2] = x[3]; p[3] = x[1];
    ///   b = [2.0];
    ///   my_model = ball(p, b);
    /// }";
    /// let (ball, place) = Model::parse(text, Mode::Default)?.unplaced().expect("a moved ball");
    /// assert_eq!(ball.name(), "ball");
    /// assert_eq!(place.framed([0.0, 5.0, 0.0]), [0.0; 3]);
    /// # Ok::<(), isoform_field::hyperfun::SyntaxError>(())
    /// ```
    pub fn unplaced(&self) -> Option<(Self, Placement)> {
        let object = self.chosen();
        let Expr::Call {
            object: called,
            arguments,
            ..
        } = &object.result
        else {
            return None;
        };
        let defaults = object.defaults?;
        let [(_, points), (_, values)] = arguments[..] else {
            return None;
        };
        if object.dimension() != 3 || values != defaults.array || points == values {
            return None;
        }
        let rows = rows(object, points, values)?;
        let placement = placement(&rows)?;
        let name = &self.program.objects[*called as usize].name;
        Some((self.clone().object(Some(name)).ok()?, placement))
    }
}

/// Returns the coordinates of the moved point, if the body consists of one assignment of each of
/// them and one of the values.
fn rows(object: &Object, points: ArrayRef, values: ArrayRef) -> Option<[Affine; 3]> {
    if (points.id as usize) < HEAD_ARRAYS || points.len != 3 {
        return None;
    }
    let mut rows = [None; 3];
    let mut is_assigned = false;
    for statement in &object.body {
        match statement {
            Statement::AssignItem {
                array,
                index: Expr::Number { value: index, .. },
                value,
            } if *array == points => {
                let row = (1..=3).find(|k| f64::from(*k) == *index)?;
                let coordinate = rows[row as usize - 1].replace(affine(value)?);
                coordinate.is_none().then_some(())?;
            }
            Statement::AssignArray { array, .. } if *array == values && !is_assigned => {
                is_assigned = true;
            }
            _ => return None,
        }
    }
    let [Some(x), Some(y), Some(z)] = rows else {
        return None;
    };
    is_assigned.then_some([x, y, z])
}

/// Returns an expression of constants and coordinates as an affine function of these.
fn affine(expression: &Expr) -> Option<Affine> {
    match expression {
        Expr::Number { value, .. } => Some(([0.0; 3], *value)),
        // x is the first array of every object.
        Expr::Item { array, index, .. } if array.id == 0 => {
            let Expr::Number { value: index, .. } = **index else {
                return None;
            };
            let coordinate = (1..=3).find(|k| f64::from(*k) == index)?;
            let mut linear = [0.0; 3];
            linear[coordinate as usize - 1] = 1.0;
            Some((linear, 0.0))
        }
        Expr::Sign { sign, operand, .. } => {
            let factor = if *sign == "-" { -1.0 } else { 1.0 };
            Some(times(affine(operand)?, factor))
        }
        Expr::Group { inner, .. } => affine(inner),
        Expr::Chain { first, rest } => rest.iter().try_fold(affine(first)?, joined),
        _ => None,
    }
}

/// Applies an operator with its right operand, if the result is affine.
fn joined(left: Affine, link: &Link) -> Option<Affine> {
    let right = affine(&link.operand)?;
    let constant = |f: &Affine| (f.0 == [0.0; 3]).then_some(f.1);
    match link.operator {
        Operator::Add => Some(sum(left, right)),
        Operator::Subtract => Some(sum(left, times(right, -1.0))),
        Operator::Multiply => match (constant(&left), constant(&right)) {
            (_, Some(factor)) => Some(times(left, factor)),
            (Some(factor), None) => Some(times(right, factor)),
            (None, None) => None,
        },
        Operator::Divide => {
            let divisor = constant(&right).filter(|d| *d != 0.0)?;
            Some((left.0.map(|v| v / divisor), left.1 / divisor))
        }
        _ => None,
    }
}

fn times((linear, value): Affine, factor: f64) -> Affine {
    (linear.map(|v| v * factor), value * factor)
}

fn sum(a: Affine, b: Affine) -> Affine {
    (std::array::from_fn(|k| a.0[k] + b.0[k]), a.1 + b.1)
}

/// Returns the similarity p = Rᵀ(x − t)/scale with these coordinates of p; `None` for other affine
/// maps, and for reflections.
fn placement(rows: &[Affine; 3]) -> Option<Placement> {
    let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let scale = 1.0 / dot(&rows[0].0, &rows[0].0).sqrt();
    let axes = rows.map(|row| row.0.map(|v| v * scale));
    let is_unit = |i: usize, j: usize| {
        let wanted = if i == j { 1.0 } else { 0.0 };
        (dot(&axes[i], &axes[j]) - wanted).abs() <= ROTATION_TOLERANCE
    };
    let [x, y, z] = axes;
    let volume = x[0] * (y[1] * z[2] - y[2] * z[1])
        + x[1] * (y[2] * z[0] - y[0] * z[2])
        + x[2] * (y[0] * z[1] - y[1] * z[0]);
    if !(0..3).all(|i| (0..=i).all(|j| is_unit(i, j))) || volume < 0.0 {
        return None;
    }
    // At x = 0, p = −Rᵀt/scale.
    let away: [f64; 3] = std::array::from_fn(|i| -scale * rows[i].1);
    Some(Placement {
        rotation: std::array::from_fn(|j| std::array::from_fn(|i| axes[i][j])),
        translation: std::array::from_fn(|j| (0..3).map(|i| axes[i][j] * away[i]).sum()),
        scale,
    })
}
