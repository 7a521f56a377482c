//! Encoding of queries and answers as words of 64 bits: floats by their bits, lists after their
//! lengths.

use isoform_geom::Point3;

/// A writer of words.
#[derive(Default)]
pub(super) struct WordWriter(pub(super) Vec<u64>);

impl WordWriter {
    pub(super) fn word(&mut self, word: u64) {
        self.0.push(word);
    }
    pub(super) fn count(&mut self, count: usize) {
        self.word(count as u64);
    }
    pub(super) fn number(&mut self, number: f64) {
        self.word(number.to_bits());
    }
    /// Writes numbers without their count.
    pub(super) fn each(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|v| self.number(*v));
    }
    pub(super) fn point(&mut self, p: Point3) {
        self.each(&p);
    }
    pub(super) fn words(&mut self, words: &[u64]) {
        self.count(words.len());
        self.0.extend_from_slice(words);
    }
    pub(super) fn numbers(&mut self, numbers: &[f64]) {
        self.count(numbers.len());
        self.each(numbers);
    }
}

/// A reader of words. Beyond the end it returns zeros and sets `is_short`.
pub(super) struct WordReader<'a> {
    words: &'a [u64],
    pub(super) is_short: bool,
}

impl<'a> WordReader<'a> {
    pub(super) fn new(words: &'a [u64]) -> Self {
        Self {
            words,
            is_short: false,
        }
    }
    /// Returns the unread words.
    pub(super) fn rest(&self) -> &'a [u64] {
        self.words
    }
    pub(super) fn word(&mut self) -> u64 {
        let Some((first, rest)) = self.words.split_first() else {
            self.is_short = true;
            return 0;
        };
        self.words = rest;
        *first
    }
    pub(super) fn count(&mut self) -> usize {
        self.word() as usize
    }
    pub(super) fn number(&mut self) -> f64 {
        f64::from_bits(self.word())
    }
    pub(super) fn point(&mut self) -> Point3 {
        std::array::from_fn(|_| self.number())
    }
    pub(super) fn words(&mut self) -> Vec<u64> {
        let count = self.count();
        let Some((these, rest)) = self.words.split_at_checked(count) else {
            self.is_short = true;
            return Vec::new();
        };
        self.words = rest;
        these.to_vec()
    }
    pub(super) fn numbers(&mut self) -> Vec<f64> {
        let words = self.words().into_iter();
        words.map(f64::from_bits).collect()
    }
    /// Reads an index and returns the value at it.
    pub(super) fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        let at = self.count();
        self.is_short |= at >= values.len();
        values[at.min(values.len() - 1)]
    }
}
