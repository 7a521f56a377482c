//! Rows of equal surfaces at equal distances.

use super::chain::Chain;
use super::sites::{MAX_STEP_ERROR, Sites};
use isoform_geom::norm;
use std::collections::BTreeSet;

/// Returns the longest rows from each pair of places.
pub(super) fn rows(sites: &Sites<'_>) -> Vec<Chain> {
    let mut found = Vec::new();
    let mut known = BTreeSet::new();
    for i in 0..sites.count() {
        // In larger fields places beyond the 40 nearest are ignored.
        for j in sites.near(i, 40) {
            if known.contains(&(i, j)) {
                continue;
            }
            if let Some(row) = longest(sites, i, j) {
                for pair in row.members.windows(2) {
                    known.insert((pair[0], pair[1]));
                    known.insert((pair[1], pair[0]));
                }
                found.push(row);
            }
        }
    }
    found
}

/// Returns the row extended both ways from two places.
fn longest(sites: &Sites<'_>, i: usize, j: usize) -> Option<Chain> {
    let mut row = Chain::row(sites, vec![i, j]);
    while let Some(longer) = grown(sites, &row) {
        row = longer;
    }
    row.members.reverse();
    let mut row = Chain::row(sites, row.members);
    while let Some(longer) = grown(sites, &row) {
        row = longer;
    }
    if row.members.len() < 3 {
        return None;
    }
    // The direction is that from the end of the smaller index, for either start.
    if row.members.first() > row.members.last() {
        row.members.reverse();
    }
    Chain::row(sites, row.members).fitted(sites)
}

/// Returns the row with the next member, if the fit is consistent.
fn grown(sites: &Sites<'_>, row: &Chain) -> Option<Chain> {
    let n = row.members.len();
    let (before, last) = (row.members[n - 2], row.members[n - 1]);
    let step = sites.way(before, last);
    let next = sites.at(last, step, MAX_STEP_ERROR * norm(step))?;
    if row.members.contains(&next) {
        return None;
    }
    let members = [row.members.as_slice(), &[next]].concat();
    Chain::row(sites, members).fitted(sites)
}
