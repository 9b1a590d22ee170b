//! Particle operators as weights: each function takes the stencil of one point and returns the factors on the values of
//! its members. The weights apply to any field.
//!
//! Equation numbers are those of Mhaski & Ramana (2025), CMES 142(1).

use crate::{
    Mat2, Vec2, WendlandQuintic,
    neighbours::{NeighbourList, Period, Source},
};
use nalgebra::Matrix3;
use std::ops::AddAssign;

/// Error for a stencil from which no operator can be formed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OperatorError {
    /// No gradient can be formed: too few neighbours, or all of them on one line.
    #[error("fewer than four neighbours or all on one line")]
    Degenerate,
}

/// A member of a point's stencil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Member {
    /// Index of the real node whose value is used.
    pub owner: u32,
    /// Index of the source: the node itself or one of its images.
    pub source: u32,
    /// Whether the member is the mirror image of that node.
    pub mirrored: bool,
    /// `x_ji = x_j - x_i`, m.
    pub offset: Vec2,
    /// Volume per unit thickness of the node, m2.
    pub volume: f64,
}

/// All members of the stencil of one query point, inside the support of the kernel.
pub fn stencil(
    list: &NeighbourList,
    query: usize,
    at: Vec2,
    sources: &[Source],
    volume: &[f64],
    kernel: WendlandQuintic,
    period: Option<Period>,
) -> Vec<Member> {
    list.of(query)
        .iter()
        .filter_map(|pair| {
            let source = &sources[pair.source as usize];
            let offset = pair.offset(at, sources, period);
            (offset.norm_squared() < kernel.support() * kernel.support()).then(|| Member {
                owner: source.owner,
                source: pair.source,
                mirrored: source.mirrored,
                offset,
                volume: volume[source.owner as usize],
            })
        })
        .collect()
}

/// Weight of one node in the gradient at a stress node.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct GradientWeight {
    /// `g_sj`, 1/m: `grad f = sum f_j g_sj`.
    pub gradient: Vec2,
    /// `w_sj / sum w`: share in the weighted mean (for the velocity filter).
    pub share: f64,
}

impl AddAssign for GradientWeight {
    fn add_assign(&mut self, other: Self) {
        self.gradient += other.gradient;
        self.share += other.share;
    }
}

/// Kernel-weighted linear least-squares fit over a stencil. It is exact for linear fields, also at boundaries.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquaresFit {
    mean: Vec2,
    covariance: Mat2,
    inverse: Mat2,
    shares: Vec<f64>,
}

impl LeastSquaresFit {
    /// Smallest determinant of the position covariance, in units of `h^4`, for a fit (0.077 inside a lattice, 0.009 in
    /// its corner, 0 on a line).
    const LEAST_DETERMINANT: f64 = 0.004;
    /// Smallest number of members of a fit: three determine it, the fourth makes it more reliable.
    const FEWEST_MEMBERS: usize = 4;

    /// Fits the stencil.
    ///
    /// # Errors
    /// [`OperatorError::Degenerate`] for fewer than four members or members on a line.
    pub fn new(members: &[Member], kernel: WendlandQuintic) -> Result<Self, OperatorError> {
        if members.len() < Self::FEWEST_MEMBERS {
            return Err(OperatorError::Degenerate);
        }
        let weights: Vec<f64> = members.iter().map(|m| kernel.value(m.offset.norm())).collect();
        let total: f64 = weights.iter().sum();
        let shares: Vec<f64> = weights.iter().map(|w| w / total).collect();
        let mean: Vec2 = members.iter().zip(&shares).map(|(m, share)| m.offset * *share).sum();
        let covariance: Mat2 = members
            .iter()
            .zip(&shares)
            .map(|(m, share)| (m.offset - mean) * (m.offset - mean).transpose() * *share)
            .sum();
        let h = kernel.smoothing_length();
        // NaN must take the error branch too.
        if !(covariance.determinant() > Self::LEAST_DETERMINANT * h.powi(4)) {
            return Err(OperatorError::Degenerate);
        }
        let inverse = covariance.try_inverse().ok_or(OperatorError::Degenerate)?;
        Ok(Self { mean, covariance, inverse, shares })
    }

    /// Position covariance of the stencil, m2.
    pub fn covariance(&self) -> Mat2 {
        self.covariance
    }

    /// Gradient weight and share of member `k`.
    pub fn weight(&self, k: usize, member: &Member) -> GradientWeight {
        let share = self.shares[k];
        GradientWeight { gradient: self.inverse * (member.offset - self.mean) * share, share }
    }

    /// Weight of member `k` in the fitted value at the query point.
    pub fn value_weight(&self, k: usize, member: &Member) -> f64 {
        let weight = self.weight(k, member);
        weight.share - weight.gradient.dot(&self.mean)
    }
}

/// `V_j L_i grad_i W_ij` for every member: the corrected kernel gradient times the volume (Eqs 5, 7, 8).
///
/// With `L_i = [sum V_j x_ji (x) grad_i W_ij]^-1` the sum `sum (f_j - f_i) (...)` is exact for linear `f`.
///
/// # Errors
/// [`OperatorError::Degenerate`] where the correction matrix cannot be inverted.
pub fn corrected_gradient(members: &[Member], kernel: WendlandQuintic) -> Result<Vec<Vec2>, OperatorError> {
    let gradients: Vec<Vec2> = members.iter().map(|m| kernel.gradient(m.offset) * m.volume).collect();
    let moment: Mat2 = members.iter().zip(&gradients).map(|(m, g)| g * m.offset.transpose()).sum();
    // Inside a filled domain the moment matrix is near the identity; for one pair it is singular.
    if !(moment.determinant().abs() > LEAST_MOMENT_DETERMINANT) {
        return Err(OperatorError::Degenerate);
    }
    let correction = moment.try_inverse().ok_or(OperatorError::Degenerate)?;
    Ok(gradients.into_iter().map(|g| correction * g).collect())
}

/// Smallest determinant of the kernel moment matrix (1 inside, 0.25 in a lattice corner, 0 on a line).
const LEAST_MOMENT_DETERMINANT: f64 = 0.01;

/// `V_j x_ji . L_i grad_i W_ij / |x_ji|^2` for every member: `V_j F~_ij` of Eq. 7; zero for the point itself.
/// `corrected` is the result of [`corrected_gradient`].
pub fn laplacian_factor(members: &[Member], corrected: &[Vec2]) -> Vec<f64> {
    members
        .iter()
        .zip(corrected)
        .map(|(m, g)| {
            let distance_squared = m.offset.norm_squared();
            if distance_squared > 0.0 { m.offset.dot(g) / distance_squared } else { 0.0 }
        })
        .collect()
}

/// First-order consistent fit of Eq. 9: for each member its weight in the value and in the gradient (1/m).
///
/// # Errors
/// [`OperatorError::Degenerate`] where the moment matrix cannot be inverted.
pub fn consistent_fit(
    members: &[Member],
    kernel: WendlandQuintic,
) -> Result<Vec<(f64, Vec2)>, OperatorError> {
    let h = kernel.smoothing_length();
    // Rows and columns are scaled with h to make the matrix dimensionless.
    let test = |m: &Member| {
        let gradient = kernel.gradient(m.offset) * h;
        nalgebra::Vector3::new(kernel.value(m.offset.norm()), gradient.x, gradient.y) * m.volume
    };
    let moment: Matrix3<f64> = members
        .iter()
        .map(|m| test(m) * nalgebra::RowVector3::new(1.0, m.offset.x / h, m.offset.y / h))
        .sum();
    if members.len() < LeastSquaresFit::FEWEST_MEMBERS
        || !(moment.determinant().abs() > LEAST_MOMENT_DETERMINANT)
    {
        return Err(OperatorError::Degenerate);
    }
    let inverse = moment.try_inverse().ok_or(OperatorError::Degenerate)?;
    Ok(members
        .iter()
        .map(|m| {
            let fit = inverse * test(m);
            (fit.x, Vec2::new(fit.y, fit.z) / h)
        })
        .collect())
}

/// Shepard interpolation of Eq. 10: the weight of every member; their sum is one.
///
/// # Errors
/// [`OperatorError::Degenerate`] without any member.
pub fn interpolation(members: &[Member], kernel: WendlandQuintic) -> Result<Vec<f64>, OperatorError> {
    let weights: Vec<f64> = members.iter().map(|m| m.volume * kernel.value(m.offset.norm())).collect();
    let total: f64 = weights.iter().sum();
    if !(total > 0.0) {
        return Err(OperatorError::Degenerate);
    }
    Ok(weights.into_iter().map(|w| w / total).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A disordered lattice as the stencil of one of its points; `cut` removes one side to make a surface or a corner.
    fn cloud(disorder: &[(f64, f64)], cut: Vec2) -> Vec<Member> {
        let mut members = Vec::new();
        for (k, &(a, b)) in disorder.iter().enumerate() {
            let (column, row) = (k % 9, k / 9);
            let offset = Vec2::new(column as f64 - 4.0 + 0.1 * a, row as f64 - 4.0 + 0.1 * b);
            if offset.x >= cut.x && offset.y <= -cut.y && offset.norm() < 2.8 {
                members.push(Member { owner: 0, source: 0, mirrored: false, offset, volume: 1.0 });
            }
        }
        members
    }

    proptest! {
        #[test]
        fn every_gradient_is_exact_for_linear_fields(disorder in prop::collection::vec((-1.0_f64..1.0, -1.0_f64..1.0), 81),
                                                     corner in 0_u8..3, a in -5.0_f64..5.0, b in -5.0_f64..5.0, c in -5.0_f64..5.0) {
            let kernel = WendlandQuintic::new(1.4);
            let cut = [Vec2::new(-9.0, -9.0), Vec2::new(-9.0, -0.4), Vec2::new(-0.4, -0.4)][corner as usize];
            let members = cloud(&disorder, cut);
            let field = |m: &Member| a + b * m.offset.x + c * m.offset.y;
            let close = |g: Vec2| (g - Vec2::new(b, c)).norm() < 1e-11 * (1.0 + a.abs() + b.abs() + c.abs());

            let fit = LeastSquaresFit::new(&members, kernel).unwrap();
            let gradient: Vec2 = members.iter().enumerate().map(|(k, m)| fit.weight(k, m).gradient * field(m)).sum();
            let value: f64 = members.iter().enumerate().map(|(k, m)| fit.value_weight(k, m) * field(m)).sum();
            prop_assert!(close(gradient) && (value - a).abs() < 1e-11 * (1.0 + a.abs() + b.abs() + c.abs()));

            let corrected = corrected_gradient(&members, kernel).unwrap();
            let gradient: Vec2 = members.iter().zip(&corrected).map(|(m, g)| g * (field(m) - a)).sum();
            prop_assert!(close(gradient));

            let consistent = consistent_fit(&members, kernel).unwrap();
            let gradient: Vec2 = members.iter().zip(&consistent).map(|(m, w)| w.1 * field(m)).sum();
            let value: f64 = members.iter().zip(&consistent).map(|(m, w)| w.0 * field(m)).sum();
            prop_assert!(close(gradient) && (value - a).abs() < 1e-11 * (1.0 + a.abs() + b.abs() + c.abs()));
        }
    }

    #[test]
    fn laplacian_of_a_quadratic_on_a_lattice() {
        // Eq. 7 with unit isotropic k: sum V 2 F~ (H_j - H_i) approaches the Laplacian, 4 for x^2 + y^2.
        let members = cloud(&[(0.0, 0.0); 81], Vec2::new(-9.0, -9.0));
        let kernel = WendlandQuintic::new(1.4);
        let factor = laplacian_factor(&members, &corrected_gradient(&members, kernel).unwrap());
        let laplacian: f64 =
            members.iter().zip(&factor).map(|(m, f)| 2.0 * f * m.offset.norm_squared()).sum();
        assert!((laplacian - 4.0).abs() < 1e-12, "{laplacian}");
    }

    #[test]
    fn a_line_of_nodes_has_no_gradient() {
        let members: Vec<Member> = (-2..=2)
            .map(|k| Member {
                owner: 0,
                source: 0,
                mirrored: false,
                offset: Vec2::new(f64::from(k), 0.0),
                volume: 1.0,
            })
            .collect();
        let kernel = WendlandQuintic::new(1.4);
        assert_eq!(LeastSquaresFit::new(&members, kernel), Err(OperatorError::Degenerate));
        assert_eq!(corrected_gradient(&members, kernel), Err(OperatorError::Degenerate));
        assert_eq!(consistent_fit(&members, kernel), Err(OperatorError::Degenerate));
    }

    #[test]
    fn interpolation_weights_sum_to_one() {
        let members = cloud(&[(0.3, -0.2); 81], Vec2::new(-9.0, -0.4));
        let weights = interpolation(&members, WendlandQuintic::new(1.4)).unwrap();
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        assert_eq!(interpolation(&[], WendlandQuintic::new(1.4)), Err(OperatorError::Degenerate));
    }
}
