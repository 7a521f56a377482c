//! Sums over points in chunks, for the polish.

use super::cloud::{Cloud, PointSet};
use super::question::{ChunkQuery, LossWeights, Mask, Reading, ResidualRequest};
use super::wire::WordReader;
use crate::polish::PolishSums;
use crate::space::Space;
use crate::{Loss, Objective, Template};

/// The points of the final fit, in chunks.
pub(crate) struct ChunkSums<'a> {
    pub(crate) cloud: &'a Cloud<'a>,
    pub(crate) template: &'a dyn Template,
    pub(crate) space: &'a Space,
    pub(crate) mask: Mask,
    /// Returns the residuals of a sample of the points at some parameters, which locate order
    /// statistics.
    pub(crate) some: &'a dyn Fn(&[f64]) -> Vec<f64>,
}

/// Residual function of all sums.
const READING: Reading = Reading::Distance;

impl<'a> ChunkSums<'a> {
    fn objective(&self, by: Option<LossWeights>) -> Box<dyn Objective + '_> {
        Box::new(ChunkResiduals { sums: self, by })
    }

    fn scale(&self, a: &[f64]) -> f64 {
        let some = (self.some)(a);
        let sizes = self
            .cloud
            .sizes(self.template, (READING, a), PointSet::Fitted, &some);
        sizes.scale
    }

    /// Asks for a sum over the fitted points at some parameters.
    fn ask(
        &self,
        a: &[f64],
        question: impl Fn(ResidualRequest, Mask) -> ChunkQuery,
        each: impl FnMut(WordReader<'_>),
    ) -> bool {
        let masked = |asked| question(asked, self.mask.clone());
        let cloud: &'a Cloud<'a> = self.cloud;
        cloud.ask_residuals(self.template, (READING, a), PointSet::Fitted, masked, each)
    }

    /// Returns Σ ρ at some parameters.
    fn loss(&self, a: &[f64], scale: f64) -> f64 {
        let mut sum = 0.0;
        let question = |asked, mask| ChunkQuery::Losses(asked, scale, mask);
        self.ask(a, question, |mut words| sum += words.number());
        sum
    }
}

impl PolishSums for ChunkSums<'_> {
    fn count(&self) -> usize {
        self.cloud.n_fitted()
    }
    fn squares(&self) -> Box<dyn Objective + '_> {
        self.objective(None)
    }
    fn reweighted(
        &self,
        x: &[f64],
        loss: Loss,
        scale: &dyn Fn(Option<f64>) -> f64,
        is_free: bool,
    ) -> (f64, Box<dyn Objective + '_>) {
        let a = self.space.parameters(x);
        let scale = scale(is_free.then(|| self.scale(&a)));
        (scale, self.objective(Some(LossWeights { a, loss, scale })))
    }
    fn losses(&self, places: [&[f64]; 2]) -> [f64; 2] {
        let places = places.map(|x| self.space.parameters(x));
        let [before, after] = [0, 1].map(|k| self.scale(&places[k]));
        let scale = after.max(before);
        places.map(|a| self.loss(&a, scale))
    }
}

/// Σ w r² over the points of the final fit.
struct ChunkResiduals<'a> {
    sums: &'a ChunkSums<'a>,
    by: Option<LossWeights>,
}

impl Objective for ChunkResiduals<'_> {
    fn dim(&self) -> usize {
        self.sums.space.len()
    }
    fn value(&mut self, x: &[f64]) -> f64 {
        let a = self.sums.space.parameters(x);
        let mut sum = 0.0;
        let question = |asked, mask| ChunkQuery::Sum(asked, self.by.clone(), mask);
        let is_whole = self.sums.ask(&a, question, |mut words| {
            sum += words.number();
        });
        if is_whole { sum } else { f64::INFINITY }
    }
    fn model(&mut self, x: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let a = self.sums.space.parameters(x);
        let n = a.len();
        let (mut sum, mut g, mut h) = (0.0, vec![0.0; n], vec![0.0; n * n]);
        let question = |asked, mask| ChunkQuery::Normal(asked, self.by.clone(), mask);
        let is_whole = self.sums.ask(&a, question, |mut words| {
            sum += words.number();
            for (sums, more) in [(&mut g, words.numbers()), (&mut h, words.numbers())] {
                sums.iter_mut().zip(more).for_each(|(sum, v)| *sum += v);
            }
        });
        self.sums.space.pull_back(&g, &h, gradient, hessian);
        if is_whole { sum } else { f64::INFINITY }
    }
    fn step_limit(&self, x: &[f64], p: &[f64]) -> f64 {
        self.sums.space.step_limit(x, p)
    }
}
