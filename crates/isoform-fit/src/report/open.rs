//! Groups of parameters that the data leave open, with the reason.

use super::PartStatistics;
use crate::deviation::Surface;
use crate::identify::Knowledge;
use crate::objective::jacobian;
use crate::task::Task;
use crate::words::listed;
use std::fmt;

/// A derivative above this moves the surface.
const MOVES: f64 = 1e-6;
/// A piece with fewer points than this has none to speak of.
const FEW: usize = 4;
/// A piece with more than this share of its surface uncovered has no data to speak of, either.
const UNCOVERED: f64 = 0.8;

/// Parameters that the data leave open together.
#[derive(Clone, Debug, PartialEq)]
pub struct Open {
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
    fn new(parameters: Vec<String>, pieces: Vec<String>) -> Self {
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

/// Derivatives of the metric residual at samples of the surface.
struct Moves<'a> {
    surface: &'a Surface,
    /// Derivatives by sample and parameter.
    jacobian: Vec<f64>,
    dim: usize,
}

impl Moves<'_> {
    /// Returns true if one of some parameters moves a piece.
    fn is_moved(&self, piece: usize, parameters: &[usize]) -> bool {
        let rows = self.jacobian.chunks_exact(self.dim);
        let mut places = self.surface.parts.iter().zip(rows);
        places.any(|(part, row)| {
            *part as usize == piece && parameters.iter().any(|&i| row[i].abs() > MOVES)
        })
    }
}

impl Task<'_> {
    /// Returns the open groups, each with the pieces without data that its parameters move.
    pub(super) fn open(
        &self,
        knowledge: &Knowledge,
        a: &[f64],
        surface: &Surface,
        stats: &[PartStatistics],
    ) -> Vec<Open> {
        if knowledge.open.is_empty() {
            return Vec::new();
        }
        let moves = self.moves_of_surface(a, surface);
        let groups = knowledge.open.iter();
        groups.map(|g| self.open_group(g, &moves, stats)).collect()
    }

    fn moves_of_surface<'b>(&self, a: &[f64], surface: &'b Surface) -> Moves<'b> {
        Moves {
            surface,
            jacobian: jacobian(self.template.metric(), &surface.points, a),
            dim: a.len(),
        }
    }

    /// Names a group of variables along one open direction.
    fn open_group(&self, group: &[usize], moves: &Moves<'_>, stats: &[PartStatistics]) -> Open {
        let indices = self.moved_by(group);
        let all = self.template.parameters();
        let parameters: Vec<String> = indices.iter().map(|&i| all[i].name.clone()).collect();
        let unseen = stats
            .iter()
            .enumerate()
            .filter(|(k, s)| is_unseen(s) && moves.is_moved(*k, &indices));
        let pieces: Vec<String> = unseen.map(|(_, s)| s.name.clone()).collect();
        Open {
            why: Why::new(parameters.clone(), pieces),
            parameters,
        }
    }

    /// Returns the parameters that some variables move, ascending.
    fn moved_by(&self, group: &[usize]) -> Vec<usize> {
        let columns = group.iter().flat_map(|&k| self.space.column(k));
        let mut indices: Vec<usize> = columns.map(|c| c.0).collect();
        indices.sort_unstable();
        indices.dedup();
        indices
    }
}

/// Returns true if a piece has almost no data: fewer than four points, or more than 80 % of its
/// surface uncovered.
fn is_unseen(s: &PartStatistics) -> bool {
    s.count < FEW || s.uncovered.is_some_and(|u| u > UNCOVERED)
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
