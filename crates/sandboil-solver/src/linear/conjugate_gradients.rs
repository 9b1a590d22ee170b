//! Preconditioned conjugate gradients.

/// An element of a vector: a number, or the unknowns of one node.
pub trait Element: Copy {
    /// Nothing.
    const ZERO: Self;
    /// Scalar product.
    fn dot(&self, other: &Self) -> f64;
    /// `self + factor * other`.
    fn plus(&self, factor: f64, other: &Self) -> Self;
}

impl Element for f64 {
    const ZERO: Self = 0.0;

    fn dot(&self, other: &Self) -> f64 {
        self * other
    }

    fn plus(&self, factor: f64, other: &Self) -> Self {
        self + factor * other
    }
}

impl<const N: usize> Element for [f64; N] {
    const ZERO: Self = [0.0; N];

    fn dot(&self, other: &Self) -> f64 {
        self.iter().zip(other).map(|(a, b)| a * b).sum()
    }

    fn plus(&self, factor: f64, other: &Self) -> Self {
        std::array::from_fn(|e| self[e] + factor * other[e])
    }
}

/// Norm of the residual `r` that the iteration reduces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Norm {
    /// `r . r`.
    Residual,
    /// `r . P r` with the preconditioner `P`: closer to the error of the solution.
    Preconditioned,
}

/// When an iteration ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// The norm of the residual.
    pub norm: Norm,
    /// Residual at which the solution is accepted, over that at the start.
    pub tolerance: f64,
    /// Most iterations.
    pub iterations: usize,
}

/// Solves a system with a symmetric positive definite matrix from zero. `matrix` gives the product of the matrix and a
/// vector, `preconditioner` that of an approximate inverse, which is symmetric and positive definite too.
///
/// # Errors
/// The last iterate, if the iteration does not converge within the limits or a matrix is not positive definite.
pub fn conjugate_gradients<E: Element>(
    matrix: impl Fn(&[E]) -> Vec<E>,
    mut preconditioner: impl FnMut(&[E]) -> Vec<E>,
    right_hand_side: &[E],
    limits: Limits,
) -> Result<Vec<E>, Vec<E>> {
    let mut solution = vec![E::ZERO; right_hand_side.len()];
    let mut residual = right_hand_side.to_vec();
    let mut direction = preconditioner(&residual);
    let mut slope = dot(&residual, &direction);
    let size = |residual: &[E], slope: f64| match limits.norm {
        Norm::Residual => dot(residual, residual),
        Norm::Preconditioned => slope,
    };
    let enough = limits.tolerance * limits.tolerance * size(&residual, slope);
    if slope == 0.0 {
        return Ok(solution);
    }
    // Neither a negative slope nor one that is not a number belongs to a positive definite matrix.
    if !(slope > 0.0) {
        return Err(solution);
    }
    for _ in 0..limits.iterations {
        let image = matrix(&direction);
        let length = slope / dot(&direction, &image);
        if !length.is_finite() {
            return Err(solution);
        }
        for i in 0..solution.len() {
            solution[i] = solution[i].plus(length, &direction[i]);
            residual[i] = residual[i].plus(-length, &image[i]);
        }
        let next = preconditioner(&residual);
        let before = std::mem::replace(&mut slope, dot(&residual, &next));
        if size(&residual, slope) <= enough {
            return Ok(solution);
        }
        for (direction, next) in direction.iter_mut().zip(next) {
            *direction = next.plus(slope / before, direction);
        }
    }
    Err(solution)
}

fn dot<E: Element>(a: &[E], b: &[E]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { norm: Norm::Residual, tolerance: 1e-12, iterations: 100 };

    /// `-x[i-1] + (2 + i) x[i] - x[i+1]`.
    fn chain(x: &[f64]) -> Vec<f64> {
        let at = |i: usize| x.get(i).copied().unwrap_or(0.0);
        (0..x.len()).map(|i| (2.0 + i as f64) * x[i] - at(i.wrapping_sub(1)) - at(i + 1)).collect()
    }

    fn diagonal(x: &[f64]) -> Vec<f64> {
        x.iter().enumerate().map(|(i, x)| x / (2.0 + i as f64)).collect()
    }

    #[test]
    fn solves_in_either_norm() {
        let exact: Vec<f64> = (0..30).map(|i| f64::from(i).sin()).collect();
        for norm in [Norm::Residual, Norm::Preconditioned] {
            let found = conjugate_gradients(chain, diagonal, &chain(&exact), Limits { norm, ..LIMITS });
            for (found, exact) in found.unwrap().iter().zip(&exact) {
                assert!((found - exact).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn unknowns_of_a_node_make_no_difference() {
        let exact: Vec<f64> = (0..30).map(|i| f64::from(i).cos()).collect();
        let of_nodes =
            |by: fn(&[f64]) -> Vec<f64>| move |x: &[[f64; 3]]| by(x.as_flattened()).as_chunks().0.to_vec();
        let right_hand_side = of_nodes(chain)(exact.as_chunks().0);
        let found = conjugate_gradients(of_nodes(chain), of_nodes(diagonal), &right_hand_side, LIMITS);
        for (found, exact) in found.unwrap().as_flattened().iter().zip(&exact) {
            assert!((found - exact).abs() < 1e-10);
        }
    }

    #[test]
    fn what_cannot_be_solved_is_an_error() {
        let few = Limits { iterations: 2, ..LIMITS };
        assert!(conjugate_gradients(chain, diagonal, &[1.0; 30], few).is_err());
        let negative = |x: &[f64]| x.iter().map(|x| -x).collect::<Vec<f64>>();
        assert!(conjugate_gradients(chain, negative, &[1.0; 30], LIMITS).is_err());
        assert!(conjugate_gradients(chain, diagonal, &[f64::NAN; 30], LIMITS).is_err());
        assert_eq!(conjugate_gradients(chain, diagonal, &[0.0; 3], LIMITS), Ok(vec![0.0; 3]));
    }
}
