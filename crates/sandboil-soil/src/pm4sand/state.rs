//! State of a stress point.

use crate::{Deviator, Moduli, SoilError, error::finite};

/// A strain or strain increment, compression positive, in the material frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strain {
    /// Volumetric strain `e_xx + e_yy`.
    pub volume: f64,
    /// In-plane deviator with tensor shear.
    pub deviator: Deviator,
}

impl Strain {
    pub fn scaled(self, factor: f64) -> Self {
        Self { volume: self.volume * factor, deviator: self.deviator * factor }
    }

    /// Largest absolute component of (xx, yy, engineering shear).
    pub fn largest_component(self) -> f64 {
        (0.5 * self.volume.abs() + self.deviator.half_difference.abs()).max(2.0 * self.deviator.xy.abs())
    }
}

/// Three independent components `(xx, yy, xy)`. The apparent initial back-stress ratio is updated component by
/// component and may therefore have a small trace.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Components(pub [f64; 3]);

impl Components {
    pub const ZERO: Self = Self([0.0; 3]);

    pub fn of(tensor: Deviator) -> Self {
        Self([tensor.half_difference, -tensor.half_difference, tensor.xy])
    }

    /// The deviator; it has the same contraction with any traceless direction as the whole tensor.
    #[inline]
    pub fn deviator(self) -> Deviator {
        let [xx, yy, xy] = self.0;
        Deviator { half_difference: 0.5 * (xx - yy), xy }
    }
}

/// Constant stress that replaces the inadmissible part of the initial stress. It is added to the stress returned to the
/// caller. kPa, compression positive.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Offset {
    pub mean: f64,
    pub deviator: Deviator,
    pub out_of_plane: f64,
}

/// State of one PM4Sand stress point, made by [`crate::SoilModel::initialise`]. All tensors are in the material frame,
/// compression positive.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    /// In-plane mean effective stress p, kPa.
    pub(super) mean: f64,
    /// Deviator s, kPa.
    pub(super) deviator: Deviator,
    /// Out-of-plane effective stress, kPa; the model itself does not use it.
    pub(super) out_of_plane: f64,
    pub(super) offset: Offset,
    /// Void ratio at zero strain.
    pub(super) void_ratio_initial: f64,
    /// Volumetric strain since initialisation, compression positive.
    pub(super) volumetric_strain: f64,
    /// Volumetric expansion at the pressure floor that is not yet recovered (gap memory).
    pub(super) gap: f64,
    /// Back-stress ratio alpha.
    pub(super) alpha: Deviator,
    /// Apparent initial back-stress ratio.
    pub(super) alpha_in: Components,
    /// Previous apparent initial back-stress ratio.
    pub(super) alpha_in_previous: Components,
    /// Back-stress ratio at the last reversal.
    pub(super) alpha_in_true: Deviator,
    pub(super) alpha_max: Components,
    pub(super) alpha_min: Components,
    /// Fabric-dilatancy tensor z.
    pub(super) fabric: Deviator,
    /// Fabric at the last reversal.
    pub(super) fabric_in: Deviator,
    /// Cumulative fabric; it never decreases.
    pub(super) fabric_cumulative: f64,
    /// Largest fabric `|z|/sqrt(2)` so far.
    pub(super) fabric_peak: f64,
    /// Mean stress when `|z| p` was largest, kPa.
    pub(super) p_zp: f64,
    /// Largest `|z| p` at a reversal, kPa.
    pub(super) zp_max: f64,
    /// True until a reversal has set `p_zp`.
    pub(super) before_first_reversal: bool,
    pub(super) moduli: Moduli,
    /// Bounding ratio of the last evaluation.
    pub(super) bounding_ratio: f64,
    /// Lower limit of the pressure in the formulas, kPa.
    pub(super) p_min: f64,
    pub(super) fabric_limit: f64,
    pub(super) dilatancy_scale: f64,
    /// Counter-clockwise angle of the material frame, radians.
    pub(super) rotation: f64,
}

impl State {
    /// Void ratio after a volumetric strain (compression positive) since initialisation.
    #[inline]
    pub(super) fn void_ratio_at(&self, volumetric_strain: f64) -> f64 {
        self.void_ratio_initial - (1.0 + self.void_ratio_initial) * volumetric_strain
    }

    /// Returns the state, or an error if one of its quantities is not a finite number.
    pub(super) fn finite(self) -> Result<Self, SoilError> {
        let size = |tensor: Deviator| tensor.half_difference.abs() + tensor.xy.abs();
        let offset = self.offset;
        let out_of_plane = self.out_of_plane + offset.out_of_plane;
        // This sum of absolute values is an upper bound of every component in any frame.
        let stress = (self.mean + offset.mean).abs() + size(self.deviator + offset.deviator);
        finite("stress", stress + out_of_plane.abs())?;
        finite("back-stress ratio", size(self.alpha))?;
        finite("fabric", size(self.fabric) + self.fabric_cumulative)?;
        finite("void ratio", self.void_ratio_at(self.volumetric_strain))?;
        finite("bulk modulus", self.moduli.bulk)?;
        Ok(self)
    }

    /// Whether the initial stress was inadmissible, so that the state has a constant offset stress.
    pub fn has_offset(&self) -> bool {
        self.offset.mean != 0.0 || self.offset.deviator != Deviator::ZERO
    }

    /// In-plane mean effective stress `p = (xx + yy)/2` of the model without the offset, kPa, compression positive.
    pub fn mean_stress(&self) -> f64 {
        self.mean
    }

    /// Back-stress ratio alpha, material frame, compression positive.
    pub fn back_stress_ratio(&self) -> Deviator {
        self.alpha
    }

    /// Apparent initial back-stress ratio, material frame, compression positive.
    pub fn apparent_initial_back_stress_ratio(&self) -> Deviator {
        self.alpha_in.deviator()
    }

    /// Fabric-dilatancy tensor z, material frame, compression positive.
    pub fn fabric(&self) -> Deviator {
        self.fabric
    }

    /// Cumulative fabric.
    pub fn cumulative_fabric(&self) -> f64 {
        self.fabric_cumulative
    }

    /// Fabric limit `z_max`.
    pub fn fabric_limit(&self) -> f64 {
        self.fabric_limit
    }

    /// Dilatancy scale `A_do`.
    pub fn dilatancy_scale(&self) -> f64 {
        self.dilatancy_scale
    }

    /// Lower limit of the pressure in the formulas, kPa. The mean stress itself never falls below a fifth of it.
    pub fn minimum_pressure(&self) -> f64 {
        self.p_min
    }

    /// Volumetric expansion at the pressure floor that is not yet recovered; zero unless gap memory is on.
    pub fn gap_strain(&self) -> f64 {
        self.gap
    }

    /// Counter-clockwise angle by which the material frame has turned, radians.
    pub fn rotation(&self) -> f64 {
        self.rotation
    }
}
