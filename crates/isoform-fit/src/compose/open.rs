//! Groups of parameters that the data leave open, and the pieces without data that they move.

use crate::deviation::SampledSurface;
use crate::identify::Knowledge;
use crate::report::open::{UndeterminedGroup, Why};
use crate::report::parts::PartStatistics;
use crate::residuals::{MOVING_DERIVATIVE, jacobian};
use crate::task::Task;

/// Derivatives of the metric residual at samples of the surface.
struct SurfaceDerivatives<'a> {
    surface: &'a SampledSurface,
    /// Derivatives by sample and parameter.
    jacobian: Vec<f64>,
    dim: usize,
}

impl SurfaceDerivatives<'_> {
    /// Returns true if one of some parameters moves a piece.
    fn is_moved(&self, piece: usize, parameters: &[usize]) -> bool {
        let rows = self.jacobian.chunks_exact(self.dim);
        let mut places = self.surface.parts.iter().zip(rows);
        places.any(|(part, row)| {
            *part as usize == piece && parameters.iter().any(|&i| row[i].abs() > MOVING_DERIVATIVE)
        })
    }
}

impl Task<'_> {
    /// Returns the open groups, each with the pieces without data that its parameters move.
    pub(super) fn open(
        &self,
        knowledge: &Knowledge,
        a: &[f64],
        surface: &SampledSurface,
        stats: &[PartStatistics],
    ) -> Vec<UndeterminedGroup> {
        if knowledge.open.is_empty() {
            return Vec::new();
        }
        let moves = self.moves_of_surface(a, surface);
        let groups = knowledge.open.iter();
        groups.map(|g| self.open_group(g, &moves, stats)).collect()
    }

    fn moves_of_surface<'b>(
        &self,
        a: &[f64],
        surface: &'b SampledSurface,
    ) -> SurfaceDerivatives<'b> {
        SurfaceDerivatives {
            surface,
            jacobian: jacobian(self.template.metric(), &surface.points, a),
            dim: a.len(),
        }
    }

    /// Names a group of variables along one open direction.
    fn open_group(
        &self,
        group: &[usize],
        moves: &SurfaceDerivatives<'_>,
        stats: &[PartStatistics],
    ) -> UndeterminedGroup {
        let indices = self.moved_by(group);
        let all = self.template.parameters();
        let parameters: Vec<String> = indices.iter().map(|&i| all[i].name.clone()).collect();
        let unseen = stats
            .iter()
            .enumerate()
            .filter(|(k, s)| is_unseen(s) && moves.is_moved(*k, &indices));
        let pieces: Vec<String> = unseen.map(|(_, s)| s.name.clone()).collect();
        UndeterminedGroup {
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
    s.count < 4 || s.uncovered.is_some_and(|u| u > 0.8)
}
