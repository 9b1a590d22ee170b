//! Compressed sparse rows, the container of all particle operators.

use std::{collections::BTreeMap, ops::AddAssign};

/// A sparse table in compressed-row form. Within a row, columns are in ascending order and unique.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Csr<T> {
    start: Vec<u32>,
    column: Vec<u32>,
    value: Vec<T>,
}

impl<T> Default for Csr<T> {
    fn default() -> Self {
        Self { start: vec![0], column: Vec::new(), value: Vec::new() }
    }
}

impl<T: Copy + AddAssign> Csr<T> {
    /// An empty table with reserved memory for `rows` rows and `entries` entries.
    pub fn with_capacity(rows: usize, entries: usize) -> Self {
        let mut start = Vec::with_capacity(rows + 1);
        start.push(0);
        Self { start, column: Vec::with_capacity(entries), value: Vec::with_capacity(entries) }
    }

    /// Appends a row. Entries with equal column are added in the given order; in this way the weights of images are
    /// added to those of the real node. `entries` is sorted by column.
    pub fn push_row(&mut self, entries: &mut [(u32, T)]) {
        // A stable sort keeps the order of equal columns, so the sums are the same on every run.
        entries.sort_by_key(|&(column, _)| column);
        for &(column, value) in entries.iter() {
            let row_is_open = self.column.len() > self.start[self.start.len() - 1] as usize;
            match self.value.last_mut() {
                Some(last) if row_is_open && self.column[self.column.len() - 1] == column => {
                    *last += value;
                }
                _ => {
                    self.column.push(column);
                    self.value.push(value);
                }
            }
        }
        self.start.push(index(self.column.len()));
    }

    /// The table with additional entries, given by row. Entries with equal column are added.
    #[must_use]
    pub fn with_more(&self, mut more: BTreeMap<usize, Vec<(u32, T)>>) -> Self {
        let mut table = Self::with_capacity(self.rows(), self.entries());
        for row in 0..self.rows() {
            let (columns, values) = self.row(row);
            let mut entries: Vec<(u32, T)> = columns.iter().copied().zip(values.iter().copied()).collect();
            entries.extend(more.remove(&row).unwrap_or_default());
            table.push_row(&mut entries);
        }
        table
    }

    /// The transposed table; `columns` is the number of columns of this table.
    #[must_use]
    pub fn transposed(&self, columns: usize) -> Self {
        let mut start = vec![0_u32; columns + 1];
        for &column in &self.column {
            start[column as usize + 1] += 1;
        }
        for c in 0..columns {
            start[c + 1] += start[c];
        }
        let mut next = start.clone();
        let mut row_of = vec![0_u32; self.column.len()];
        let mut source = vec![0_usize; self.column.len()];
        for row in 0..self.rows() {
            for entry in self.span(row) {
                let slot = &mut next[self.column[entry] as usize];
                row_of[*slot as usize] = index(row);
                source[*slot as usize] = entry;
                *slot += 1;
            }
        }
        let value = source.into_iter().map(|entry| self.value[entry]).collect();
        Self { start, column: row_of, value }
    }
}

impl<T: Copy + std::ops::MulAssign<f64>> Csr<T> {
    /// Multiplies every entry by the factor of its column.
    pub fn scale_by_column(&mut self, factor: &[f64]) {
        for (value, &column) in self.value.iter_mut().zip(&self.column) {
            *value *= factor[column as usize];
        }
    }
}

impl<T: Copy + std::ops::MulAssign<f64>> Csr<T> {
    /// Multiplies every entry by the factor of its row.
    pub fn scale_by_row(&mut self, factor: &[f64]) {
        for (row, factor) in factor.iter().enumerate() {
            let span = self.span(row);
            for value in &mut self.value[span] {
                *value *= *factor;
            }
        }
    }
}

impl<T: Copy> Csr<T> {
    /// Applies a function to every entry.
    pub fn map_values(&mut self, function: impl Fn(T) -> T) {
        for value in &mut self.value {
            *value = function(*value);
        }
    }
}

impl<T> Csr<T> {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.start.len() - 1
    }

    /// Number of stored entries.
    pub fn entries(&self) -> usize {
        self.column.len()
    }

    /// Memory used by the table, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.start.as_slice())
            + size_of_val(self.column.as_slice())
            + size_of_val(self.value.as_slice())
    }

    fn span(&self, row: usize) -> std::ops::Range<usize> {
        self.start[row] as usize..self.start[row + 1] as usize
    }

    /// Columns and values of a row.
    #[inline]
    pub fn row(&self, row: usize) -> (&[u32], &[T]) {
        let span = self.span(row);
        (&self.column[span.clone()], &self.value[span])
    }

    /// Pairs `(column, value)` of a row.
    #[inline]
    pub fn iter_row(&self, row: usize) -> impl Iterator<Item = (usize, &T)> {
        let (columns, values) = self.row(row);
        columns.iter().map(|&c| c as usize).zip(values)
    }
}

/// A table index. Indices have 32 bits to halve the memory traffic.
///
/// # Panics
/// For 2^32 entries or more, which do not fit into memory.
#[allow(clippy::expect_used)] // limited by the machine, not by the input
pub(crate) fn index(position: usize) -> u32 {
    u32::try_from(position).expect("fewer than 2^32 entries")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn equal_columns_are_added_within_a_row_only() {
        let mut table = Csr::with_capacity(2, 4);
        table.push_row(&mut [(3, 1.0), (1, 2.0), (3, 4.0)]);
        table.push_row(&mut [(3, 8.0)]);
        assert_eq!(table.row(0), (&[1_u32, 3][..], &[2.0, 5.0][..]));
        assert_eq!(table.row(1), (&[3_u32][..], &[8.0][..]));
    }

    proptest! {
        #[test]
        fn transposing_twice_is_the_identity(rows in prop::collection::vec(prop::collection::btree_map(0_u32..9, -1.0_f64..1.0, 0..6), 0..8)) {
            let mut table = Csr::with_capacity(rows.len(), 8);
            for row in &rows {
                let mut entries: Vec<_> = row.iter().map(|(&c, &v)| (c, v)).collect();
                table.push_row(&mut entries);
            }
            prop_assert_eq!(table.transposed(9).transposed(rows.len()), table);
        }
    }
}
