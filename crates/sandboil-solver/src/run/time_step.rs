//! The largest stable time step, by measured limits, and what sets it.

use crate::{
    section::description::{Model, Operators},
    skeleton::rayleigh::Rayleigh,
    weights::lattice::lattice,
};
use sandboil_sph::{
    Vec2, WendlandQuintic,
    operators::{corrected_gradient, laplacian_factor},
};

/// Limit of the skeleton wave over `h / c_d` with free surfaces: 0.994 at h = 1.4 dx, where it is least.
pub const DRAINED_COEFFICIENT: f64 = 0.99;
/// Largest factor of dispersion-corrected inertia on the squared frequency of any wave: the limit becomes `0.71 h / c_d`
/// (0.713 at h = 1.4 dx and Poisson's ratio zero, where it is least).
pub const CORRECTED_RESPONSE: f64 = (DRAINED_COEFFICIENT / 0.71) * (DRAINED_COEFFICIENT / 0.71);
/// The same on the rates of the velocity filter (2.53 at h = 1.4 dx).
pub const CORRECTED_FILTER: f64 = 2.55;
/// Limit of the undrained wave over `h / c_u`, surfaces at prescribed pressure.
pub const UNDRAINED_COEFFICIENT: f64 = 1.7;
/// The same where pressure is prescribed nowhere: undrained soil.
pub const FREE_UNDRAINED_COEFFICIENT: f64 = 0.9;
/// Damping ratio of the fastest wave by a unit of artificial viscosity: its rate is at most `2 alpha c / h`.
pub const VISCOSITY_RATIO: f64 = 0.5;
/// Share of the lattice's drainage that is left to a few nodes of flowing ground which touch each other alone: through the
/// surface, `2/dx^2` of up to `8/dx^2`.
pub const FREE_SURFACE_DRAINAGE: f64 = 0.25;
/// Explicit diffusion: `dt <= 0.65 dx^2 C / k`.
pub const DIFFUSION_COEFFICIENT: f64 = 0.65;
/// Largest eigenvalue of the velocity filter over `xi C_s / dx`.
pub const FILTER_EIGENVALUE: f64 = 1.05;
/// Largest shear-wave over compression-wave speed of a soil: that of Poisson's ratio zero.
pub const LARGEST_SPEED_RATIO: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Damping ratio of the fastest wave above which its viscous part alone, `dt < 1/(xi w)`, allows less than the wave,
/// `dt < 2/w`.
pub const VISCOUS_RATIO: f64 = 0.5;
/// Wave numbers sampled along an axis and along a diagonal of the lattice.
pub const SPECTRUM_SAMPLES: u32 = 24;
/// Bisections of the implicit limit: one part in a thousand.
pub const BISECTIONS: u32 = 12;
/// What limits the time step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Criterion {
    /// Compression wave of the drained skeleton.
    #[default]
    DrainedWave,
    /// Compression wave with the pore water's stiffness.
    UndrainedWave,
    /// Compression wave whose pore water drains in part within a step (implicit diffusion).
    DrainingWave,
    /// Explicit diffusion of pore pressure.
    Diffusion,
    /// Viscous stress of Rayleigh damping.
    Damping,
}

impl Criterion {
    /// In the user's words.
    pub fn name(self) -> &'static str {
        match self {
            Self::DrainedWave => "drained compression wave",
            Self::UndrainedWave => "undrained compression wave",
            Self::DrainingWave => "partly drained compression wave",
            Self::Diffusion => "explicit pore-pressure diffusion",
            Self::Damping => "Rayleigh damping of the shortest waves",
        }
    }
}

/// A limit of the time step.
#[derive(Debug, Clone, Copy, Default)]
pub struct TimeLimit {
    /// Longest stable time step, s.
    pub dt: f64,
    /// What sets it.
    pub criterion: Criterion,
}

impl TimeLimit {
    /// The shorter of two, the first of equal ones.
    #[must_use]
    pub fn least(self, other: Self) -> Self {
        if other.dt < self.dt { other } else { self }
    }
}

/// How pore pressure takes part in the limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum PressureCoupling {
    /// No water, or frozen pressure.
    None,
    /// Explicit or no diffusion.
    Explicit,
    /// Implicit diffusion.
    Implicit,
}

/// How the pressure operators of Eq. 7 see waves on the undeformed lattice.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PressureSpectrum {
    /// Pairs of eigenvalues, 1/m2: of the divergence followed by its transpose, and of the Laplacian.
    eigenvalues: Vec<(f64, f64)>,
}

impl PressureSpectrum {
    /// Samples the spectrum of the model's lattice.
    pub fn new(model: &Model) -> Self {
        let kernel = WendlandQuintic::new(model.smoothing_length());
        let members = lattice(model, Vec2::zeros());
        let corrected = corrected_gradient(&members, kernel).unwrap_or_default();
        let factor = laplacian_factor(&members, &corrected);
        let diagonal = Vec2::new(1.0 / model.spacing.x, 1.0 / model.spacing.y);
        let directions = [Vec2::new(0.0, diagonal.y), Vec2::new(diagonal.x, 0.0), diagonal]
            .map(|d| d * std::f64::consts::PI);
        let eigenvalues = directions
            .iter()
            .flat_map(|d| {
                (1..=SPECTRUM_SAMPLES).map(move |k| d * (f64::from(k) / f64::from(SPECTRUM_SAMPLES)))
            })
            .map(|wave| {
                let gradient: Vec2 =
                    members.iter().zip(&corrected).map(|(m, g)| g * wave.dot(&m.offset).sin()).sum();
                let laplacian: f64 = members
                    .iter()
                    .zip(&factor)
                    .map(|(m, f)| 2.0 * f * (1.0 - wave.dot(&m.offset).cos()))
                    .sum();
                (gradient.norm_squared(), laplacian)
            })
            .collect();
        Self { eigenvalues }
    }

    /// Largest share of the stability bound that implicitly diffused pressure takes at a step `dt`: a mode that
    /// flips sign each step is bounded by `s/4 + q / (2 (2 + kappa lambda dt)) < 1`, with `s` and `q` the
    /// skeleton's and the water's squared frequencies times `dt^2`.
    fn share(&self, stiffness_over_density: f64, diffusivity: f64, dt: f64) -> f64 {
        self.eigenvalues
            .iter()
            .map(|(gradient, laplacian)| {
                stiffness_over_density * gradient * dt * dt / (2.0 * (2.0 + diffusivity * laplacian * dt))
            })
            .fold(0.0, f64::max)
    }
}

/// Damping ratio of the velocity filter's largest eigenvalue on the fastest wave, of frequency `2 c_d / h`; the
/// printed set has none.
pub fn filter_ratio(model: &Model) -> f64 {
    if model.numerics.operators == Operators::Printed {
        return 0.0;
    }
    let damping = FILTER_EIGENVALUE * model.numerics.velocity_filter * LARGEST_SPEED_RATIO;
    0.25 * damping * model.numerics.smoothing_ratio
}

/// What a damping ratio of the fastest wave leaves of its limit `dt_0 = 2/w`.
///
/// A leapfrog with damping `2 xi w` on the lagging velocity is stable while `(dt/dt_0)^2 + 2 xi (dt/dt_0) < 1`.
pub fn left_by_damping(ratio: f64) -> f64 {
    (1.0 + ratio * ratio).sqrt() - ratio
}

/// What the limit of the time step depends on beside the soil.
#[derive(Clone, Copy)]
pub struct Limits<'a> {
    /// How pore pressure takes part.
    pub coupling: PressureCoupling,
    /// Spectrum of the pressure operators, read with implicit diffusion only.
    pub spectrum: &'a PressureSpectrum,
    /// Rayleigh damping, which acts on the skeleton alone: its rate is that of the skeleton's fastest wave, whatever the
    /// water adds to the frequency.
    pub rayleigh: Option<&'a Rayleigh>,
    /// Whether inertia is corrected for dispersion.
    pub is_corrected: bool,
    /// Coefficient of the artificial viscosity, 1.
    pub viscosity: f64,
    /// Whether the pressure of nodes below the surface is tied to it; else no pressure is prescribed within a step.
    pub surface_is_tied: bool,
}

/// Limit for one region at a skeleton stiffness `K + 4G/3` in kPa, s.
pub fn region_limit(model: &Model, region: usize, skeleton_stiffness: f64, limits: &Limits) -> TimeLimit {
    let Limits { coupling, spectrum, rayleigh, is_corrected, viscosity, surface_is_tied } = *limits;
    let h = model.smoothing_length();
    let (response, filtered) = if is_corrected { (CORRECTED_RESPONSE, CORRECTED_FILTER) } else { (1.0, 1.0) };
    let density = model.mixture_density(region) / response;
    let undamped = |coefficient: f64, stiffness: f64| coefficient * h / (stiffness / density).sqrt();
    let longest = undamped(DRAINED_COEFFICIENT, skeleton_stiffness);
    let rate = rayleigh.map_or(0.0, |damping| damping.rate(2.0 / longest));
    let braked = VISCOSITY_RATIO * viscosity;
    let filter = filter_ratio(model) * filtered / response.sqrt() + braked;
    let viscous = |limit: f64| 0.25 * rate * limit;
    let wave = |coefficient: f64, stiffness: f64, criterion: Criterion| {
        let limit = undamped(coefficient, stiffness);
        let ratio = viscous(limit);
        let named = if ratio > VISCOUS_RATIO { Criterion::Damping } else { criterion };
        TimeLimit { dt: limit * left_by_damping(filter + ratio), criterion: named }
    };
    let drained = wave(DRAINED_COEFFICIENT, skeleton_stiffness, Criterion::DrainedWave);
    if coupling == PressureCoupling::None {
        return drained;
    }
    let water = model.water_stiffness(model.regions[region].porosity);
    let diffusivity = model.pressure_diffusivity(region, |k| k.major);
    let coefficient =
        if diffusivity > 0.0 && surface_is_tied { UNDRAINED_COEFFICIENT } else { FREE_UNDRAINED_COEFFICIENT };
    let undrained = wave(coefficient, skeleton_stiffness + water, Criterion::UndrainedWave);
    let combined = drained.least(undrained);
    if diffusivity == 0.0 {
        return combined;
    }
    if coupling == PressureCoupling::Explicit {
        let area = model.spacing.x.min(model.spacing.y).powi(2);
        let diffusion = DIFFUSION_COEFFICIENT * area / diffusivity;
        let dt = (combined.dt.powi(-2) + diffusion.powi(-2)).powf(-0.5);
        let criterion = if diffusion < combined.dt { Criterion::Diffusion } else { combined.criterion };
        return TimeLimit { dt, criterion };
    }
    let left = left_by_damping(filter + viscous(longest));
    // Across the grain the water drains last.
    let left_open = if surface_is_tied { 1.0 } else { FREE_SURFACE_DRAINAGE };
    let diffusivity = left_open * model.pressure_diffusivity(region, |k| k.minor);
    // Water that drains at grid scale within a step stiffens the short waves no more.
    let at_edge = (UNDRAINED_COEFFICIENT / coefficient).powi(2);
    let stable = |dt: f64| {
        let share = spectrum.share(at_edge * water / density, diffusivity, dt / left);
        (dt / drained.dt).powi(2) + share <= 1.0
    };
    let (mut low, mut high) = (combined.dt.min(drained.dt), drained.dt);
    if !stable(low) {
        return combined;
    }
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if stable(middle) { low = middle } else { high = middle }
    }
    let criterion = if low > 0.99 * drained.dt { drained.criterion } else { Criterion::DrainingWave };
    TimeLimit { dt: low, criterion }
}
