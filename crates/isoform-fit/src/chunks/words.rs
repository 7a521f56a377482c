//! Questions and answers as words of 64 bits, so that they can be sent: numbers bit by bit, lists
//! after their lengths.

use isoform_geom::Point3;

/// Words being written.
#[derive(Default)]
pub(super) struct Writer(pub(super) Vec<u64>);

impl Writer {
    pub(super) fn word(&mut self, word: u64) {
        self.0.push(word);
    }
    pub(super) fn count(&mut self, count: usize) {
        self.word(count as u64);
    }
    pub(super) fn number(&mut self, number: f64) {
        self.word(number.to_bits());
    }
    /// Numbers whose number is known.
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

/// Words that are read from the first on. There is none behind the last.
pub(super) struct Reader<'a>(pub(super) &'a [u64]);

impl Reader<'_> {
    pub(super) fn word(&mut self) -> Option<u64> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }
    pub(super) fn count(&mut self) -> Option<usize> {
        usize::try_from(self.word()?).ok()
    }
    pub(super) fn number(&mut self) -> Option<f64> {
        self.word().map(f64::from_bits)
    }
    pub(super) fn point(&mut self) -> Option<Point3> {
        Some([self.number()?, self.number()?, self.number()?])
    }
    pub(super) fn words(&mut self) -> Option<Vec<u64>> {
        let count = self.count()?;
        let (these, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(these.to_vec())
    }
    pub(super) fn numbers(&mut self) -> Option<Vec<f64>> {
        let words = self.words()?.into_iter();
        Some(words.map(f64::from_bits).collect())
    }
}
