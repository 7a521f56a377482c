//! Resolution of ties to free parameters.

use crate::{FitError, Parameter, Tie};

/// A parameter as a constant and terms (index, factor) of free parameters.
#[derive(Clone, Default)]
pub(super) struct ParameterRow {
    pub(super) constant: f64,
    pub(super) terms: Vec<(usize, f64)>,
}

impl ParameterRow {
    /// Returns true if this row is the free parameter i itself.
    pub(super) fn is_variable(&self, i: usize) -> bool {
        self.terms == [(i, 1.0)]
    }
}

/// Returns the rows of all parameters. Ties take precedence over fixed values, and are followed
/// through other ties.
pub(super) fn rows(parameters: &[Parameter]) -> Result<Vec<ParameterRow>, FitError> {
    let mut ties = Ties {
        parameters,
        rows: vec![None; parameters.len()],
    };
    for i in 0..parameters.len() {
        ties.resolve(i, 0)?;
    }
    Ok(ties.rows.into_iter().flatten().collect())
}

/// The parameters, and the rows resolved so far.
struct Ties<'a> {
    parameters: &'a [Parameter],
    rows: Vec<Option<ParameterRow>>,
}

impl Ties<'_> {
    /// Returns the row of parameter i, which was reached through `depth` ties.
    fn resolve(&mut self, i: usize, depth: usize) -> Result<&ParameterRow, FitError> {
        if self.rows[i].is_none() {
            let row = self.row(i, depth)?;
            if !row.constant.is_finite() {
                return Err(FitError::NotFinite {
                    what: "a fixed or tied value",
                    index: i,
                });
            }
            self.rows[i] = Some(row);
        }
        Ok(self.rows[i].as_ref().expect("just resolved"))
    }

    fn row(&mut self, i: usize, depth: usize) -> Result<ParameterRow, FitError> {
        let p = &self.parameters[i];
        if depth > self.parameters.len() {
            return Err(FitError::Tie {
                name: p.name.clone(),
            });
        }
        match (&p.tie, p.fixed) {
            (Some(tie), _) => self.tied(i, tie, depth),
            (None, Some(v)) => Ok(ParameterRow {
                constant: v,
                terms: Vec::new(),
            }),
            (None, None) => Ok(ParameterRow {
                constant: 0.0,
                terms: vec![(i, 1.0)],
            }),
        }
    }

    /// Returns the row of a tied parameter, from the rows of its sources.
    fn tied(&mut self, i: usize, tie: &Tie, depth: usize) -> Result<ParameterRow, FitError> {
        let mut constant = tie.constant;
        let mut sum = vec![0.0; self.parameters.len()];
        for &(j, factor) in &tie.terms {
            if j >= self.parameters.len() || j == i || !factor.is_finite() {
                return Err(FitError::Tie {
                    name: self.parameters[i].name.clone(),
                });
            }
            let source = self.resolve(j, depth + 1)?;
            constant += factor * source.constant;
            for &(k, t) in &source.terms {
                sum[k] += factor * t;
            }
        }
        let terms = sum.into_iter().enumerate().filter(|(_, v)| *v != 0.0);
        Ok(ParameterRow {
            constant,
            terms: terms.collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Kind;

    fn free() -> Parameter {
        Parameter::new("p", Kind::Number)
    }

    fn tied(constant: f64, terms: &[(usize, f64)]) -> Parameter {
        let terms = terms.to_vec();
        Parameter {
            tie: Some(Tie { constant, terms }),
            ..free()
        }
    }

    #[test]
    fn ties_are_followed_through_ties() {
        // p0 = 1 + 2 p1, p1 = 3 + p2: p0 = 7 + 2 p2.
        let rows = rows(&[tied(1.0, &[(1, 2.0)]), tied(3.0, &[(2, 1.0)]), free()]);
        let rows = rows.expect("no circle");
        assert_eq!(
            (rows[0].constant, &rows[0].terms[..]),
            (7.0, &[(2, 2.0)][..])
        );
        assert!(rows[2].is_variable(2) && !rows[1].is_variable(1));
    }

    #[test]
    fn circles_are_refused() {
        let circle = [tied(0.0, &[(1, 1.0)]), tied(0.0, &[(0, 1.0)])];
        assert!(matches!(rows(&circle), Err(FitError::Tie { .. })));
    }
}
