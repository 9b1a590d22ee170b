//! Direct solver for the implicit diffusion of pore pressure: reverse Cuthill-McKee order, banded LU factors.
//!
//! The matrix is diagonally dominant (positive pair factors, positive storage), so no pivoting is needed, and
//! the factors are kept while time step, conductivity and geometry stay.

use sandboil_sph::Csr;

/// LU factors of a banded matrix in its own ordering.
#[derive(Debug, Clone)]
pub struct BandedLu {
    order: Vec<u32>,
    half_band: usize,
    /// Row-major band: row `i` holds columns `i - half_band ..= i + half_band`.
    band: Vec<f64>,
    inverse_pivot: Vec<f64>,
    work: Vec<f64>,
}

impl BandedLu {
    /// Factors the square matrix. Returns `None` when a pivot vanishes or is not finite.
    pub fn factor(matrix: &Csr<f64>) -> Option<Self> {
        let n = matrix.rows();
        let order = reverse_cuthill_mckee(matrix);
        let mut place = vec![0_usize; n];
        for (position, &row) in order.iter().enumerate() {
            place[row as usize] = position;
        }
        let half_band = (0..n)
            .flat_map(|row| matrix.iter_row(row).map(move |(column, _)| (row, column)))
            .map(|(row, column)| place[row].abs_diff(place[column]))
            .max()
            .unwrap_or(0);
        let width = 2 * half_band + 1;
        let mut band = vec![0.0; n * width];
        for row in 0..n {
            for (column, &value) in matrix.iter_row(row) {
                band[place[row] * width + place[column] + half_band - place[row]] = value;
            }
        }
        let mut inverse_pivot = vec![0.0; n];
        for pivot in 0..n {
            let value = band[pivot * width + half_band];
            if value == 0.0 || !value.is_finite() {
                return None;
            }
            inverse_pivot[pivot] = 1.0 / value;
            let reach = half_band.min(n - 1 - pivot);
            let (above, below) = band.split_at_mut((pivot + 1) * width);
            let pivot_row = &above[pivot * width + half_band + 1..pivot * width + half_band + 1 + reach];
            for step in 1..=reach {
                let row = &mut below[(step - 1) * width..step * width];
                let factor = row[half_band - step] * inverse_pivot[pivot];
                row[half_band - step] = factor;
                if factor != 0.0 {
                    for (target, source) in row[half_band - step + 1..].iter_mut().zip(pivot_row) {
                        *target -= factor * source;
                    }
                }
            }
        }
        Some(Self { order, half_band, band, inverse_pivot, work: vec![0.0; n] })
    }

    /// Replaces the right-hand side by the solution.
    pub fn solve(&mut self, right_hand_side: &mut [f64]) {
        let n = self.order.len();
        let width = 2 * self.half_band + 1;
        for (slot, &row) in self.work.iter_mut().zip(&self.order) {
            *slot = right_hand_side[row as usize];
        }
        for row in 0..n {
            let reach = self.half_band.min(row);
            let factors = &self.band[row * width + self.half_band - reach..row * width + self.half_band];
            let known: f64 = factors.iter().zip(&self.work[row - reach..row]).map(|(a, b)| a * b).sum();
            self.work[row] -= known;
        }
        for row in (0..n).rev() {
            let reach = self.half_band.min(n - 1 - row);
            let first = row * width + self.half_band + 1;
            let factors = &self.band[first..first + reach];
            let known: f64 = factors.iter().zip(&self.work[row + 1..=row + reach]).map(|(a, b)| a * b).sum();
            self.work[row] = (self.work[row] - known) * self.inverse_pivot[row];
        }
        for (&value, &row) in self.work.iter().zip(&self.order) {
            right_hand_side[row as usize] = value;
        }
    }

    /// Bytes held by the factors.
    pub fn bytes(&self) -> usize {
        size_of_val(self.band.as_slice()) + 2 * size_of_val(self.work.as_slice())
    }
}

/// Breadth-first order from a node of least degree, reversed; ties by index, so it is the same on every run.
fn reverse_cuthill_mckee(matrix: &Csr<f64>) -> Vec<u32> {
    let n = matrix.rows();
    let degree = |row: usize| matrix.row(row).0.len();
    let mut seen = vec![false; n];
    let mut by_degree: Vec<usize> = (0..n).collect();
    by_degree.sort_by_key(|&row| degree(row));
    let mut order: Vec<u32> = Vec::with_capacity(n);
    for seed in by_degree {
        if seen[seed] {
            continue;
        }
        seen[seed] = true;
        let mut head = order.len();
        order.push(u32::try_from(seed).unwrap_or(u32::MAX));
        while head < order.len() {
            let row = order[head] as usize;
            head += 1;
            let mut next: Vec<u32> =
                matrix.row(row).0.iter().copied().filter(|&c| !seen[c as usize]).collect();
            next.sort_by_key(|&c| degree(c as usize));
            for column in next {
                seen[column as usize] = true;
                order.push(column);
            }
        }
    }
    order.reverse();
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn solves_what_it_factored(n in 1_usize..40, seed in prop::collection::vec(-1.0_f64..1.0, 40 * 3), x in prop::collection::vec(-1.0_f64..1.0, 40)) {
            // A dominant matrix with far links, so that the ordering has something to do.
            let mut matrix = Csr::with_capacity(n, 4 * n);
            for row in 0..n {
                let mut entries = vec![(u32::try_from(row).unwrap(), 4.0)];
                for k in 0..3 {
                    entries.push((u32::try_from((row * 7 + k * 11 + 1) % n).unwrap(), seed[row * 3 + k]));
                }
                matrix.push_row(&mut entries);
            }
            let mut rhs: Vec<f64> = (0..n).map(|row| matrix.iter_row(row).map(|(c, v)| v * x[c]).sum()).collect();
            BandedLu::factor(&matrix).unwrap().solve(&mut rhs);
            for (found, expected) in rhs.iter().zip(&x) {
                prop_assert!((found - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_vanishing_pivot_is_reported() {
        let mut matrix = Csr::with_capacity(1, 1);
        matrix.push_row(&mut [(0, 0.0)]);
        assert!(BandedLu::factor(&matrix).is_none());
    }
}
