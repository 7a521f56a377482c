//! Template in which the caller fixes some of the parameters.

use crate::FrepTemplate;
use isoform_fit::{Parameter, Template};
use isoform_geom::{DistanceField, Frame, ParamField, Point3};

/// Reason why starts, bounds or fixed values are not valid for the parameters of a template.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// The index exceeds the number of parameters.
    #[error("there is no parameter {index}; the template has {}: {}", names.len(), names.join(", "))]
    NoSuchIndex {
        /// The index, from 1.
        index: usize,
        /// Names of the parameters.
        names: Vec<String>,
    },
    /// No parameter has the name.
    #[error("no parameter is called {name}; there are {}", names.join(", "))]
    NoSuchName {
        /// The name.
        name: String,
        /// Names of the parameters.
        names: Vec<String>,
    },
    /// A parameter is fixed twice.
    #[error("{name} is held twice")]
    FixedTwice {
        /// Name of the parameter.
        name: String,
    },
    /// A parameter has two intervals of bounds.
    #[error("{name} has bounds already")]
    BoundTwice {
        /// Name of the parameter.
        name: String,
    },
    /// A parameter is fixed at a value outside of its bounds.
    #[error("{name} is held at {value}, which is not from {lo} to {hi}")]
    FixedOutside {
        /// Name of the parameter.
        name: String,
        /// Value at which it is fixed.
        value: f64,
        /// Lower bound.
        lo: f64,
        /// Upper bound.
        hi: f64,
    },
    /// The name of a parameter is empty.
    #[error("the name of a parameter is empty; there are {}", names.join(", "))]
    NoName {
        /// Names of the parameters.
        names: Vec<String>,
    },
    /// The number of start values differs from the number of parameters.
    #[error(
        "{found} values for {} parameters{}",
        names.len(),
        if names.len() > *own { format!(" (or {own}, without the pose)") } else { String::new() }
    )]
    StartLength {
        /// Number of values given.
        found: usize,
        /// Number of parameters of the program itself, without the pose.
        own: usize,
        /// Names of the parameters.
        names: Vec<String>,
    },
}

/// Lower and upper bound of each parameter, in the template's coordinates; `None` for those of the
/// template.
pub type Bounds = Vec<Option<(f64, f64)>>;

/// [`FrepTemplate`] with fixed parameters, in the coordinates of a file: points are fitted relative
/// to an origin, by which the translations of a pose differ from those in the file.
pub struct ConstrainedTemplate {
    /// Template with all parameters free.
    pub frep: FrepTemplate,
    /// Shift of each parameter: the number to add to its value to get that in the file's
    /// coordinates. It is the origin for the translations of a pose, else 0.
    pub shift: Vec<f64>,
    parameters: Vec<Parameter>,
}

impl Template for ConstrainedTemplate {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn algebraic(&self) -> &dyn ParamField {
        self.frep.algebraic()
    }
    fn metric(&self) -> &dyn ParamField {
        self.frep.metric()
    }
    fn distance(&self) -> Option<&dyn DistanceField> {
        self.frep.distance()
    }
    fn frame(&self, a: &[f64]) -> Frame {
        self.frep.frame(a)
    }
    fn part_names(&self) -> &[String] {
        self.frep.part_names()
    }
    fn recipe(&self) -> Vec<f64> {
        self.frep.recipe()
    }
    fn parts(&self, points: &[Point3], a: &[f64], out: &mut [u32]) {
        self.frep.parts(points, a, out);
    }
}

impl ConstrainedTemplate {
    /// Creates the template with all parameters free, for points relative to `origin`.
    pub fn new(frep: FrepTemplate, origin: Point3) -> Self {
        let parameters = frep.parameters().to_vec();
        let own = frep.model().n_params();
        let shift = |(i, p): (usize, &Parameter)| match p.name.as_str() {
            _ if i < own => 0.0,
            "pose_x" => origin[0],
            "pose_y" => origin[1],
            "pose_z" => origin[2],
            _ => 0.0,
        };
        let shift = parameters.iter().enumerate().map(shift).collect();
        Self {
            frep,
            shift,
            parameters,
        }
    }

    /// Returns true if the template can be moved as a whole, so that it follows its data.
    pub fn can_move(&self) -> bool {
        self.parameters[self.frep.model().n_params()..]
            .iter()
            .any(|p| p.name == "pose_x")
    }

    fn names(&self) -> Vec<String> {
        self.parameters.iter().map(|p| p.name.clone()).collect()
    }

    /// Returns the index of a parameter given by its name (ignoring case), 1-based number, or
    /// `a[number]`.
    ///
    /// # Errors
    /// [`ParameterError::NoName`], [`ParameterError::NoSuchName`] or
    /// [`ParameterError::NoSuchIndex`].
    pub fn index(&self, key: &str) -> Result<usize, ParameterError> {
        if key.trim().is_empty() {
            let names = self.names();
            return Err(ParameterError::NoName { names });
        }
        let by_name = |p: &Parameter| p.name.eq_ignore_ascii_case(key);
        if let Some(i) = self.parameters.iter().position(by_name) {
            return Ok(i);
        }
        let low = key.to_ascii_lowercase();
        let number = low
            .strip_prefix("a[")
            .and_then(|k| k.strip_suffix(']'))
            .unwrap_or(&low);
        match number.trim().parse::<usize>() {
            Ok(i) if (1..=self.parameters.len()).contains(&i) => Ok(i - 1),
            Ok(index) => Err(ParameterError::NoSuchIndex {
                index,
                names: self.names(),
            }),
            Err(_) => Err(ParameterError::NoSuchName {
                name: key.to_owned(),
                names: self.names(),
            }),
        }
    }

    /// Fixes parameters, each given as for [`Self::index`], at values in the file's coordinates.
    ///
    /// # Errors
    /// The index in `fixed` of the first parameter that cannot be fixed, and the reason.
    pub fn fix(&mut self, fixed: &[(String, f64)]) -> Result<(), (usize, ParameterError)> {
        let mut held = Vec::new();
        for (k, (key, value)) in fixed.iter().enumerate() {
            let i = self.index(key).map_err(|error| (k, error))?;
            let p = &mut self.parameters[i];
            if held.contains(&i) {
                let name = p.name.clone();
                return Err((k, ParameterError::FixedTwice { name }));
            }
            held.push(i);
            p.fixed = Some(value - self.shift[i]);
            p.tie = None;
        }
        Ok(())
    }

    /// Converts start values from the file's coordinates; those of the pose may be left out.
    ///
    /// # Errors
    /// [`ParameterError::StartLength`] if the number of values is wrong.
    pub fn start(&self, values: &[f64]) -> Result<Vec<f64>, ParameterError> {
        let (own, n) = (self.frep.model().n_params(), self.parameters.len());
        if values.len() != n && values.len() != own {
            return Err(ParameterError::StartLength {
                found: values.len(),
                own,
                names: self.names(),
            });
        }
        let of_pose = |p: &Parameter| {
            p.start
                .unwrap_or(if p.name == "pose_scale" { 1.0 } else { 0.0 })
        };
        let start = |(i, p): (usize, &Parameter)| match values.get(i) {
            Some(value) => value - self.shift[i],
            None => of_pose(p),
        };
        Ok(self.parameters.iter().enumerate().map(start).collect())
    }

    /// Converts intervals in the file's coordinates, each given for a parameter as for
    /// [`Self::index`], to bounds of all parameters. A fixed parameter must lie within its
    /// interval.
    ///
    /// # Errors
    /// The index in `intervals` of the first that is wrong, and the reason.
    pub fn bounds(
        &self,
        intervals: &[(String, (f64, f64))],
    ) -> Result<Bounds, (usize, ParameterError)> {
        let mut bounds = vec![None; self.parameters.len()];
        for (k, (key, (lo, hi))) in intervals.iter().enumerate() {
            let i = self.index(key).map_err(|error| (k, error))?;
            if bounds[i].is_some() {
                let name = self.parameters[i].name.clone();
                return Err((k, ParameterError::BoundTwice { name }));
            }
            self.check_fixed(i, *lo, *hi).map_err(|error| (k, error))?;
            bounds[i] = Some((lo - self.shift[i], hi - self.shift[i]));
        }
        Ok(bounds)
    }

    /// Refuses bounds, in the file's coordinates, that exclude the value of a fixed parameter.
    fn check_fixed(&self, i: usize, lo: f64, hi: f64) -> Result<(), ParameterError> {
        let p = &self.parameters[i];
        let Some(relative) = p.fixed else {
            return Ok(());
        };
        let (low, high) = (lo - self.shift[i], hi - self.shift[i]);
        if relative >= low && relative <= high {
            return Ok(());
        }
        Err(ParameterError::FixedOutside {
            name: p.name.clone(),
            value: relative + self.shift[i],
            lo,
            hi,
        })
    }
}

impl std::fmt::Debug for ConstrainedTemplate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ConstrainedTemplate")
            .field("frep", &self.frep)
            .field("shift", &self.shift)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::hyperfun::{Mode, Model};

    fn ball() -> ConstrainedTemplate {
        let text = "-- @pose translate
            my_model(x[3], a[2]) {
                array c[3];
                c = [0, 0, 0];
                my_model = hfSphere(x, c, a[1] + a[2]);
            }";
        let model = Model::parse(text, Mode::Default).expect("a program");
        let points = [[0.0; 3], [1.0; 3]];
        let frep = FrepTemplate::new(&model, &points).expect("a template");
        ConstrainedTemplate::new(frep, [10.0, 20.0, 30.0])
    }

    #[test]
    fn parameters_have_names_and_numbers() {
        let ball = ball();
        for (key, i) in [("POSE_X", 2), ("a[1]", 0), ("2", 1), ("pose_z", 4)] {
            assert_eq!(ball.index(key), Ok(i), "{key}");
        }
        for key in ["6", "0", "radius"] {
            assert!(ball.index(key).is_err(), "{key}");
        }
    }

    #[test]
    fn values_are_those_of_the_file() {
        let mut ball = ball();
        assert!(ball.can_move());
        assert_eq!(ball.fix(&[("pose_y".to_owned(), 21.0)]), Ok(()));
        assert_eq!(ball.parameters()[3].fixed, Some(1.0));
        let start = ball.start(&[1.0, 2.0, 10.5, 20.5, 30.5]).expect("five");
        assert_eq!(start, [1.0, 2.0, 0.5, 0.5, 0.5]);
        let bounds = ball.bounds(&[("pose_x".to_owned(), (9.0, 12.0))]);
        assert_eq!(bounds.expect("a name")[2], Some((-1.0, 2.0)));
    }

    #[test]
    fn what_does_not_suit_is_refused() {
        let mut ball = ball();
        let twice = [("1".to_owned(), 1.0), ("a[1]".to_owned(), 2.0)];
        let (place, error) = ball.fix(&twice).expect_err("held twice");
        assert!(place == 1 && matches!(error, ParameterError::FixedTwice { .. }));
        let twice = [("1".to_owned(), (0.0, 1.0)), ("1".to_owned(), (0.0, 2.0))];
        let (place, error) = ball.bounds(&twice).expect_err("two intervals");
        assert!(place == 1 && matches!(error, ParameterError::BoundTwice { .. }));
        let outside = [("1".to_owned(), (2.0, 3.0))];
        let (_, error) = ball.bounds(&outside).expect_err("held at 1");
        assert_eq!(
            error.to_string(),
            "a[1] is held at 1, which is not from 2 to 3"
        );
        let error = ball.index(" ").expect_err("no name");
        assert!(
            error
                .to_string()
                .starts_with("the name of a parameter is empty; there are ")
        );
        let error = ball.start(&[1.0]).expect_err("one value");
        assert!(matches!(
            error,
            ParameterError::StartLength {
                found: 1,
                own: 2,
                ..
            }
        ));
    }
}
