//! Conjugate gradients.

use crate::linear::banded::BandedLu;

/// Solution with a symmetric positive matrix, told by what it makes of a vector; none if it takes more than `most` iterations.
pub fn conjugate_gradients(
    matrix: &impl Fn(&[f64]) -> Vec<f64>,
    preconditioner: &mut BandedLu,
    right_hand_side: &[f64],
    tolerance: f64,
    most: usize,
) -> Option<Vec<f64>> {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let mut solution = vec![0.0; right_hand_side.len()];
    let mut residual = right_hand_side.to_vec();
    let mut direction = residual.clone();
    preconditioner.solve(&mut direction);
    let mut measure = dot(&residual, &direction);
    let wanted = tolerance * tolerance * measure;
    if measure == 0.0 {
        return Some(solution);
    }
    // A positive matrix gives nothing else: whatever does not has no solution to trust.
    if !(measure > 0.0) {
        return None;
    }
    for _ in 0..most {
        let image = matrix(&direction);
        let length = measure / dot(&direction, &image);
        if !length.is_finite() {
            return None;
        }
        for i in 0..solution.len() {
            solution[i] += length * direction[i];
            residual[i] -= length * image[i];
        }
        let mut next = residual.clone();
        preconditioner.solve(&mut next);
        let before = std::mem::replace(&mut measure, dot(&residual, &next));
        if measure <= wanted {
            return Some(solution);
        }
        for (direction, next) in direction.iter_mut().zip(next) {
            *direction = next + measure / before * *direction;
        }
    }
    None
}
