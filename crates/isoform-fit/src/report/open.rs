//! Groups of parameters that the data leave open, with the reason.

use crate::phrases::listed;
use std::fmt;

/// Parameters that the data leave open together.
#[derive(Clone, Debug, PartialEq)]
pub struct UndeterminedGroup {
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Reason.
    pub why: Why,
}

/// Reason for which the data leave parameters open; `Display` writes a sentence.
///
/// ```
/// use isoform_fit::Why;
///
/// let why = Why::Unseen {
///     parameters: vec!["depth".into(), "draft".into()],
///     pieces: vec!["floor".into()],
/// };
/// assert_eq!(why.to_string(), "depth and draft are not determined: no points near floor");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Why {
    /// Pieces that the parameters move have no points near them.
    Unseen {
        /// Names of the parameters.
        parameters: Vec<String>,
        /// Names of the pieces.
        pieces: Vec<String>,
    },
    /// A move of the parameters changes no distance, although all pieces have points.
    Unheld {
        /// Names of the parameters.
        parameters: Vec<String>,
    },
}

impl Why {
    /// Chooses the reason from the unseen pieces that the parameters move.
    pub(crate) fn new(parameters: Vec<String>, pieces: Vec<String>) -> Self {
        if pieces.is_empty() {
            Self::Unheld { parameters }
        } else {
            Self::Unseen { parameters, pieces }
        }
    }
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Unseen { parameters, .. } | Self::Unheld { parameters }) = self;
        let is_one = parameters.len() == 1;
        let verb = if is_one { "is" } else { "are" };
        write!(f, "{} {verb} not determined: ", listed(parameters))?;
        match self {
            Self::Unseen { pieces, .. } => write!(f, "no points near {}", listed(pieces)),
            Self::Unheld { .. } if is_one => f.write_str("the points leave it open"),
            Self::Unheld { .. } => f.write_str("the points leave a common direction open"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_parameter_is_and_two_are() {
        let unheld = |names: &[&str]| Why::Unheld {
            parameters: names.iter().map(|n| (*n).to_owned()).collect(),
        };
        assert_eq!(
            unheld(&["turn"]).to_string(),
            "turn is not determined: the points leave it open"
        );
        assert_eq!(
            unheld(&["x", "y"]).to_string(),
            "x and y are not determined: the points leave a common direction open"
        );
    }
}
