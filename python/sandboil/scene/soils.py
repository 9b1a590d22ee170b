"""Soils: the parameters of the constitutive models, checked and immutable. Stresses in kPa."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator
from pydantic.config import JsonDict

from .. import _core
from .._errors import InvalidInput
from .._model import Model
from .._provided import Provided
from .._refusals import field_remedy
from .._types import NonNegative, Number, Positive

_FRACTION: JsonDict = {"remedy": "it is a fraction, not a percentage: 55 % is written 0.55"}
_NU: JsonDict = {
    "remedy": "nu = 0.5 is incompressible; undrained response comes from the pore water: "
    "keep the drained nu and give the region no hydraulic_conductivity"
}
_DEGREES: JsonDict = {"remedy": "angles are in degrees: sand has 28 to 45"}
_DILATION: JsonDict = {"remedy": "0 keeps volume, phi is associated flow, which dilates more than soil does"}
_COHESION: JsonDict = {
    "remedy": "for soil without friction c is the undrained strength; 0.1 to 1 kPa is an apparent cohesion"
}
_TENSION: JsonDict = {"remedy": "leave it out for the apex c/tan(phi), 0 for soil without tensile strength"}
_SOFTENING: JsonDict = {"remedy": "a shear strain, not a percentage: 5 % is written 0.05"}
_EXPONENT: JsonDict = {"remedy": "about 0.5 for sand; 0 is Elastic"}
_MODULUS: JsonDict = {"remedy": "soils have 1e4 to 1e6 kPa; 50 MPa is written 5e4"}
_RESIDUAL_PART: JsonDict = {"remedy": "at most the peak value, which is the default"}
_SECONDARY: JsonDict = {"remedy": "leave it out for the default of the model"}
_UNDRAINED: JsonDict = {"remedy": "for strength that grows with pressure take DruckerPrager or MohrCoulomb"}
_RESIDUAL: JsonDict = {"remedy": "leave it out for a soil that does not soften"}
# Largest void ratio of any soil that carries load; above it the entry is a slip of units.
_VOID_RATIO_MAX = 10.0
# Largest critical-state friction angle of any sand, degrees; above it the entry is a slip of units.
_PHI_CV_MAX = 50.0


# The sand of a field test with options, by `sandboil.lab`, which tests soils.
calibrated_sand: Provided[[dict[str, float], dict[str, Any]], PM4Sand] = Provided()


class PM4Sand(Model):
    """PM4Sand version 3.1, plane strain (Boulanger and Ziotopoulou 2017, UCD/CGM-17/01).

    Three primary parameters; every secondary one left at None takes the model's own default, which may
    depend on the primary ones and on the stress at initialisation. Long names `relative_density`,
    `shear_modulus_coefficient` and `contraction_rate` are accepted for `Dr`, `G0` and `hpo`.
    Raises :class:`InvalidInput`.
    """

    _label: ClassVar[str] = "material"
    _positional: ClassVar[tuple[str, ...]] = ("Dr", "G0", "hpo")
    _aliases: ClassVar[dict[str, str]] = {
        "relative_density": "Dr",
        "shear_modulus_coefficient": "G0",
        "contraction_rate": "hpo",
    }

    kind: Literal["pm4sand"] = "pm4sand"
    Dr: Number = Field(gt=0.0, le=1.0, description="relative density, fraction", json_schema_extra=_FRACTION)
    G0: Number = Field(
        gt=0.0,
        description="shear modulus coefficient",
        json_schema_extra={"remedy": "400 to 1000: 167 sqrt((N1)60cs + 2.5)"},
    )
    hpo: Number = Field(
        gt=0.0,
        description="contraction rate",
        json_schema_extra={"remedy": "0.1 to 2; sb.lab.calibrate_hpo finds it from a cyclic resistance"},
    )
    p_atm: Positive | None = Field(
        default=None, description="atmospheric pressure, kPa; default 101.3", json_schema_extra=_SECONDARY
    )
    ho: Positive | None = Field(
        default=None, description="ratio of plastic to elastic modulus", json_schema_extra=_SECONDARY
    )
    e_max: Annotated[Number, Field(gt=0.0, le=_VOID_RATIO_MAX)] | None = Field(
        default=None, description="largest void ratio; default 0.8", json_schema_extra=_SECONDARY
    )
    e_min: Positive | None = Field(
        default=None, description="smallest void ratio; default 0.5", json_schema_extra=_SECONDARY
    )
    nb: NonNegative | None = Field(
        default=None, description="bounding surface exponent; default 0.5", json_schema_extra=_SECONDARY
    )
    nd: NonNegative | None = Field(
        default=None, description="dilatancy surface exponent; default 0.1", json_schema_extra=_SECONDARY
    )
    Ado: Positive | None = Field(default=None, description="dilatancy scale", json_schema_extra=_SECONDARY)
    z_max: NonNegative | None = Field(default=None, description="fabric limit", json_schema_extra=_SECONDARY)
    cz: NonNegative | None = Field(
        default=None, description="fabric growth rate; default 250", json_schema_extra=_SECONDARY
    )
    ce: NonNegative | None = Field(
        default=None, description="strain accumulation rate after liquefaction", json_schema_extra=_SECONDARY
    )
    phi_cv: Annotated[Number, Field(gt=0.0, le=_PHI_CV_MAX)] | None = Field(
        default=None,
        description="critical-state friction angle, degrees; default 33",
        json_schema_extra=_SECONDARY,
    )
    nu: Annotated[Number, Field(ge=0.0, lt=0.5)] | None = Field(
        default=None, description="Poisson's ratio; default 0.3", json_schema_extra=_NU
    )
    C_GD: Annotated[Number, Field(ge=1.0)] | None = Field(
        default=None,
        description="degradation of elastic moduli with fabric; default 2",
        json_schema_extra=_SECONDARY,
    )
    C_DR: NonNegative | None = Field(
        default=None, description="rotated dilatancy surface", json_schema_extra=_SECONDARY
    )
    C_kaf: NonNegative | None = Field(
        default=None, description="sustained static shear", json_schema_extra=_SECONDARY
    )
    Q: Positive | None = Field(
        default=None, description="Bolton's Q; default 10", json_schema_extra=_SECONDARY
    )
    R: Positive | None = Field(
        default=None, description="Bolton's R; default 1.5", json_schema_extra=_SECONDARY
    )
    m: Positive | None = Field(
        default=None, description="yield surface radius; default 0.01", json_schema_extra=_SECONDARY
    )
    F_sed_min: Annotated[Number, Field(gt=0.0, le=1.0)] | None = Field(
        default=None, description="floor of the post-shaking stiffness factor", json_schema_extra=_SECONDARY
    )
    p_sed_o: Positive | None = Field(
        default=None,
        description="post-shaking pressure scale, kPa; default p_atm/5",
        json_schema_extra=_SECONDARY,
    )

    # Void ratio limits when none are given (PM4Sand manual; they only turn void ratio into Dr).
    DEFAULT_E_MAX: ClassVar[float] = 0.8
    DEFAULT_E_MIN: ClassVar[float] = 0.5

    if TYPE_CHECKING:

        def __init__(
            self, Dr: float = ..., G0: float = ..., hpo: float = ..., **secondary: float | str | None
        ) -> None: ...

    @classmethod
    def from_spt(cls, N160cs: float, **options: Any) -> PM4Sand:
        """Sand of a clean-sand corrected blow count (N1)60cs, calibrated to a cyclic resistance.

        Dr, G0 and the resistance `crr` in 15 cycles by :func:`sandboil.lab.correlations.estimates` (Idriss
        and Boulanger 2008; Boulanger and Ziotopoulou 2017) unless `options` give them, at the overburden
        `sigma_v0` (kPa, default one atmosphere); `hpo` by :func:`sandboil.lab.calibrate_hpo`, which takes all
        further `options`. Raises :class:`InvalidInput`.
        """
        return calibrated_sand({"N160cs": N160cs}, options)

    @classmethod
    def from_cpt(cls, qc1Ncs: float, **options: Any) -> PM4Sand:
        """Sand of a clean-sand normalised cone resistance q_c1Ncs (Boulanger and Idriss 2014); else as
        :meth:`from_spt`."""
        return calibrated_sand({"qc1Ncs": qc1Ncs}, options)

    @classmethod
    def from_density(cls, Dr: float, **options: Any) -> PM4Sand:
        """Sand of a relative density; all else as :meth:`from_spt` for (N1)60cs = 46 Dr^2."""
        return calibrated_sand({"Dr": Dr}, options)

    @model_validator(mode="after")
    def _void_ratios_ordered(self) -> PM4Sand:
        e_max, e_min = self.void_ratio_limits
        if e_max <= e_min:
            raise InvalidInput(
                "material.e_max", e_max, f"must be greater than e_min = {e_min:g}", "they may be swapped"
            )
        return self

    @property
    def void_ratio_limits(self) -> tuple[float, float]:
        """(e_max, e_min) with the defaults filled in."""
        return (
            self.DEFAULT_E_MAX if self.e_max is None else self.e_max,
            self.DEFAULT_E_MIN if self.e_min is None else self.e_min,
        )

    @property
    def initial_void_ratio(self) -> float:
        """Void ratio at zero strain, e_max - (e_max - e_min) Dr."""
        e_max, e_min = self.void_ratio_limits
        return e_max - (e_max - e_min) * self.Dr

    def core(self, *, gap_memory: bool = False) -> _core.Soil:
        """The sand for the numerical core.

        With `gap_memory` expansion at the pressure floor must be recovered before stress can increase again.
        """
        return _core.Soil.pm4sand(**self.model_dump(exclude={"kind"}), gap_memory=gap_memory)


class _Skeleton(Model):
    """Elastic constants of a soil: G and K, or E and nu (drained)."""

    _label: ClassVar[str] = "material"

    kind: str
    G: Positive | None = Field(default=None, description="shear modulus, kPa", json_schema_extra=_MODULUS)
    K: Positive | None = Field(default=None, description="bulk modulus, kPa", json_schema_extra=_MODULUS)
    E: Positive | None = Field(default=None, description="Young's modulus, kPa", json_schema_extra=_MODULUS)
    nu: Annotated[Number, Field(ge=0.0, lt=0.5)] | None = Field(
        default=None, description="Poisson's ratio", json_schema_extra=_NU
    )

    @model_validator(mode="after")
    def _one_pair(self) -> Self:
        given = {name for name in ("G", "K", "E", "nu") if getattr(self, name) is not None}
        if given not in ({"G", "K"}, {"E", "nu"}):
            raise InvalidInput(
                "material",
                {name: getattr(self, name) for name in sorted(given)},
                "must be given by exactly one pair: G and K, or E and nu",
                "E = 2 G (1 + nu), K = E/(3 (1 - 2 nu))",
            )
        return self

    @property
    def shear_modulus(self) -> float:
        """G in kPa."""
        if self.E is not None and self.nu is not None:
            return self.E / (2.0 * (1.0 + self.nu))
        assert self.G is not None
        return self.G

    @property
    def bulk_modulus(self) -> float:
        """K (three-dimensional) in kPa."""
        if self.E is not None and self.nu is not None:
            return self.E / (3.0 * (1.0 - 2.0 * self.nu))
        assert self.K is not None
        return self.K


class Elastic(_Skeleton):
    """Linear isotropic elasticity by G and K, or by E and nu (drained). Moduli in kPa.

    Raises :class:`InvalidInput` unless exactly one pair is given.
    """

    _positional: ClassVar[tuple[str, ...]] = ("G", "K")

    kind: Literal["elastic"] = "elastic"

    if TYPE_CHECKING:

        def __init__(
            self,
            G: float | None = None,
            K: float | None = None,
            *,
            E: float | None = None,
            nu: float | None = None,
            kind: str = "elastic",
        ) -> None: ...

    def core(self) -> _core.Soil:
        """The soil for the numerical core."""
        return _core.Soil.elastic(G=self.shear_modulus, K=self.bulk_modulus)


class PressureElastic(_Skeleton):
    """Elasticity stiffened by the pressure at rest: G = G_ref (p'/p_ref)^exponent, nu constant.

    G and K, or E and nu, are those at the mean effective stress `p_ref` (kPa, compression positive). Every
    point takes its moduli from its stress when shaking begins and keeps them, so a closed cycle of load costs
    no energy. p' counts as 1 % of `p_ref` at least. Raises :class:`InvalidInput`.
    """

    _positional: ClassVar[tuple[str, ...]] = ("G", "K")

    kind: Literal["pressure_elastic"] = "pressure_elastic"
    exponent: Number = Field(
        default=0.5, ge=0.0, le=1.0, description="exponent of pressure", json_schema_extra=_EXPONENT
    )
    p_ref: Positive = Field(
        default=101.3,
        description="pressure at which the moduli are given, kPa",
        json_schema_extra={"remedy": "101.3 is one atmosphere"},
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            G: float | None = None,
            K: float | None = None,
            *,
            E: float | None = None,
            nu: float | None = None,
            exponent: float = 0.5,
            p_ref: float = 101.3,
            kind: str = "pressure_elastic",
        ) -> None: ...

    def core(self) -> _core.Soil:
        """The soil for the numerical core."""
        return _core.Soil.pressure_elastic(
            G=self.shear_modulus, K=self.bulk_modulus, exponent=self.exponent, p_ref=self.p_ref
        )


class _Plastic(_Skeleton):
    """A soil with strength. The numerical core checks its parameters against one another."""

    if TYPE_CHECKING:

        def core(self) -> _core.Soil: ...

    def _check_set(self) -> None:
        """Refuse an incomplete set of parameters; the core checks the values."""

    @model_validator(mode="after")
    def _accepted_by_the_core(self) -> Self:
        self._check_set()
        try:
            self.core()
        except InvalidInput as error:
            remedy = field_remedy(type(self).model_fields[error.path])
            raise InvalidInput(f"material.{error.path}", error.value, error.allowed, remedy) from None
        return self


def _require_softening_strain(residual: dict[str, float | None], softening_strain: float | None) -> None:
    """A residual strength and the strain at which it is reached are given together or not at all."""
    given = [name for name, value in residual.items() if value is not None]
    if given and softening_strain is None:
        raise InvalidInput(
            "material.softening_strain",
            None,
            f"is required with {given[0]} (plastic shear strain over which strength is lost)",
            "take the shear band's width over the spacing times what a laboratory test shows",
        )
    if softening_strain is not None and not given:
        raise InvalidInput(
            "material.softening_strain",
            softening_strain,
            f"needs a residual strength: {', '.join(residual)}",
            "leave it out for a soil that does not soften",
        )


class _Frictional(_Plastic):
    """A soil whose strength is cohesion and friction."""

    _positional: ClassVar[tuple[str, ...]] = ("c", "phi", "psi")
    _aliases: ClassVar[dict[str, str]] = {"cohesion": "c", "friction_angle": "phi", "dilation_angle": "psi"}

    c: NonNegative = Field(description="cohesion, kPa", json_schema_extra=_COHESION)
    phi: Number = Field(ge=0.0, lt=90.0, description="friction angle, degrees", json_schema_extra=_DEGREES)
    psi: NonNegative = Field(default=0.0, description="dilation angle, degrees", json_schema_extra=_DILATION)
    tension_cutoff: NonNegative | None = Field(
        default=None, description="largest tension, kPa; default c/tan(phi)", json_schema_extra=_TENSION
    )


class DruckerPrager(_Frictional):
    """Drucker-Prager plasticity, non-associated, with cohesion, a tension cut-off and softening.

    Strength by c (kPa), phi and psi (degrees, 0 <= psi <= phi < 90), effective stress. Elasticity by G and K
    or by E and nu. `tension_cutoff` is the largest mean stress in tension, kPa; without it the cone's apex
    c/tan(phi). `matching` "usual" takes the constants of most of the literature, exact in plane strain for
    psi = phi and up to some percent weak below; "general" gives Mohr-Coulomb's plane-strain strength for any
    psi. With residual values strength falls in proportion to plastic shear strain, over `softening_strain`; a
    residual value left out stays at its peak. Long names `cohesion`, `friction_angle` and `dilation_angle`
    are accepted. Raises :class:`InvalidInput`, also for softening steeper than elastic unloading.

    Equations and limits: docs/theory/other_models.md.
    """

    kind: Literal["drucker_prager"] = "drucker_prager"
    matching: Literal["usual", "general"] = "usual"
    c_residual: NonNegative | None = Field(
        default=None, description="cohesion after softening, kPa", json_schema_extra=_RESIDUAL_PART
    )
    phi_residual: NonNegative | None = Field(
        default=None, description="friction angle after softening, degrees", json_schema_extra=_RESIDUAL_PART
    )
    psi_residual: NonNegative | None = Field(
        default=None, description="dilation angle after softening, degrees", json_schema_extra=_DILATION
    )
    softening_strain: Positive | None = Field(
        default=None,
        description="plastic shear strain over which strength is lost",
        json_schema_extra=_SOFTENING,
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            c: float = ...,
            phi: float = ...,
            psi: float = 0.0,
            *,
            G: float | None = None,
            K: float | None = None,
            E: float | None = None,
            nu: float | None = None,
            tension_cutoff: float | None = None,
            matching: str = "usual",
            c_residual: float | None = None,
            phi_residual: float | None = None,
            psi_residual: float | None = None,
            softening_strain: float | None = None,
            kind: str = "drucker_prager",
            **long_names: float,
        ) -> None: ...

    def _check_set(self) -> None:
        names = ("c_residual", "phi_residual", "psi_residual")
        _require_softening_strain({name: getattr(self, name) for name in names}, self.softening_strain)

    def core(self) -> _core.Soil:
        """The soil for the numerical core."""
        return _core.Soil.drucker_prager(
            G=self.shear_modulus,
            K=self.bulk_modulus,
            c=self.c,
            phi=self.phi,
            psi=self.psi,
            matching=self.matching,
            tension_cutoff=self.tension_cutoff,
            c_residual=self.c_residual,
            phi_residual=self.phi_residual,
            psi_residual=self.psi_residual,
            softening_strain=self.softening_strain,
        )


class MohrCoulomb(_Frictional):
    """Mohr-Coulomb plasticity, non-associated, without hardening, with a tension cut-off.

    Strength by c (kPa), phi and psi (degrees, 0 <= psi <= phi < 90), effective stress; all three principal
    stresses count. Elasticity by G and K or by E and nu. `tension_cutoff` is the largest principal stress in
    tension, kPa; without it the apex c/tan(phi). Long names `cohesion`, `friction_angle` and `dilation_angle`
    are accepted. Raises :class:`InvalidInput`.
    """

    kind: Literal["mohr_coulomb"] = "mohr_coulomb"

    if TYPE_CHECKING:

        def __init__(
            self,
            c: float = ...,
            phi: float = ...,
            psi: float = 0.0,
            *,
            G: float | None = None,
            K: float | None = None,
            E: float | None = None,
            nu: float | None = None,
            tension_cutoff: float | None = None,
            kind: str = "mohr_coulomb",
            **long_names: float,
        ) -> None: ...

    def core(self) -> _core.Soil:
        """The soil for the numerical core."""
        return _core.Soil.mohr_coulomb(
            G=self.shear_modulus,
            K=self.bulk_modulus,
            c=self.c,
            phi=self.phi,
            psi=self.psi,
            tension_cutoff=self.tension_cutoff,
        )


class TotalStress(_Plastic):
    """Undrained shear strength Su (kPa) of the soil itself at any pressure, with softening to Sr.

    `criterion` "tresca" bounds the radius of Mohr's circle in the plane and leaves the out-of-plane stress
    elastic; "von_mises" bounds sqrt(J2). With `Sr` strength falls with plastic shear strain kappa:
    `softening` is "exponential", Sr + (Su - Sr) exp(-kappa/softening_strain), or "linear",
    at Sr from `softening_strain` on. Elasticity by G and K or by E and nu.

    Count the stiffness of water once: either the region lies under water, K is the drained bulk modulus and
    the pore water adds its K_f/n; or the section is dry, stress is total and K is the undrained K + K_f/n. Do
    not combine them. Long names `undrained_strength` and `residual_strength` are accepted. Raises
    :class:`InvalidInput`, also for softening steeper than elastic unloading.
    """

    _positional: ClassVar[tuple[str, ...]] = ("Su", "Sr")
    _aliases: ClassVar[dict[str, str]] = {"undrained_strength": "Su", "residual_strength": "Sr"}

    kind: Literal["total_stress"] = "total_stress"
    Su: Positive = Field(description="undrained shear strength, kPa", json_schema_extra=_UNDRAINED)
    Sr: Positive | None = Field(
        default=None, description="residual shear strength, kPa; default Su", json_schema_extra=_RESIDUAL
    )
    softening_strain: Positive | None = Field(
        default=None, description="scale of the plastic shear strain", json_schema_extra=_SOFTENING
    )
    softening: Literal["exponential", "linear"] = "exponential"
    criterion: Literal["tresca", "von_mises"] = "tresca"

    if TYPE_CHECKING:

        def __init__(
            self,
            Su: float = ...,
            Sr: float | None = None,
            *,
            G: float | None = None,
            K: float | None = None,
            E: float | None = None,
            nu: float | None = None,
            softening_strain: float | None = None,
            softening: str = "exponential",
            criterion: str = "tresca",
            kind: str = "total_stress",
            **long_names: float,
        ) -> None: ...

    def _check_set(self) -> None:
        _require_softening_strain({"Sr": self.Sr}, self.softening_strain)

    def core(self) -> _core.Soil:
        """The soil for the numerical core."""
        return _core.Soil.total_stress(
            G=self.shear_modulus,
            K=self.bulk_modulus,
            Su=self.Su,
            criterion=self.criterion,
            softening=self.softening,
            Sr=self.Sr,
            softening_strain=self.softening_strain,
        )


Material = Annotated[
    PM4Sand | Elastic | PressureElastic | DruckerPrager | MohrCoulomb | TotalStress,
    Field(discriminator="kind"),
]


def material(table: dict[str, Any]) -> Material:
    """The soil of a table of `kind` and parameters; :class:`InvalidInput` if there is none."""
    given: dict[str, Any] = {"material": table}
    return _Soil(**given).material


class _Soil(Model):
    _label: ClassVar[str] = "soil"

    material: Material
