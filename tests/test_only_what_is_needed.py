"""What a scene does not ask for costs nothing: shown by counts of calls and lists of arrays, not clocks."""

from __future__ import annotations

import pytest
import scenes
from sandboil import Elastic, Gravity, Numerics, Output, Rayleigh, Region, Scene, Shaking, Simulation, box


def at_the_end(scene: Scene) -> Simulation:
    simulation = Simulation(scene, threads=1)
    simulation.run_stage()
    simulation.run_stage()
    assert simulation.is_complete
    return simulation


def elastic_column(**changes: object) -> Scene:
    ground = Region(
        "rock", box(x=(0, 0.5), y=(0, 4)), scenes.ROCK, hydraulic_conductivity=1e-4, Gs=2.67, porosity=0.4
    )
    return scenes.column(**({"regions": [ground]} | changes))


def test_the_whole_scene_uses_everything() -> None:
    simulation = at_the_end(scenes.column())
    needed = {"pore_pressure", "soil_state", "base", "pressure_envelope", "strain_envelope"}
    assert needed <= simulation.arrays().keys()
    counters = simulation.counters()
    shaken = simulation.steps
    assert counters["flow_calls"] == counters["base_calls"] == shaken
    assert counters["plastic_updates"] == shaken * simulation.stress_nodes
    assert min(counters["substeps"], counters["evaluations"]) >= counters["plastic_updates"] > 0


def test_a_dry_column_has_no_water() -> None:
    simulation = at_the_end(scenes.dry_column())
    assert not {"pore_pressure", "pressure_envelope"} & simulation.arrays().keys()
    assert simulation.counters()["flow_calls"] == 0
    assert simulation.flow_scheme == "none"
    assert not {"excess_pore_pressure", "pore_pressure", "r_u"} & set(simulation.field_names)
    assert simulation.dt_limit == "drained compression wave"


def test_water_sets_the_time_step_only_where_there_is_water() -> None:
    """The same soil skeleton: dry it is stepped by its own wave, under water by that of soil and water."""
    soil = Elastic(E=2.0e4, nu=0.3)
    ground = Region("soil", box(x=(0, 0.5), y=(0, 4)), soil, Gs=2.67, porosity=0.4)
    unfiltered = Numerics(velocity_filter=0.0)
    dry = at_the_end(scenes.dry_column(regions=[ground], numerics=unfiltered))
    wet = at_the_end(scenes.column(regions=[ground], numerics=unfiltered))
    assert dry.dt_limit == "drained compression wave"
    assert wet.dt_limit == "undrained compression wave"
    stiffness = soil.bulk_modulus + 4.0 / 3.0 * soil.shear_modulus
    # 0.99 h sqrt(rho/(K + 4G/3)) times the factor of safety, h = 1.4 x 0.25 m.
    density = 0.6 * 2.67 * 10.0 / 9.81
    assert dry.dt == pytest.approx(0.6 * 0.99 * 0.35 * (density / stiffness) ** 0.5, rel=1e-6)
    assert wet.dt < 0.5 * dry.dt


def test_an_elastic_column_has_no_sand() -> None:
    simulation = at_the_end(elastic_column())
    assert "soil_state" not in simulation.arrays()
    counters = simulation.counters()
    assert counters["plastic_updates"] == counters["substeps"] == counters["evaluations"] == 0
    assert counters["flow_calls"] > 0


def test_without_shaking_there_is_no_dashpot_and_no_flow() -> None:
    simulation = Simulation(scenes.column(stages=[Gravity()]), threads=1)
    simulation.run_stage()
    assert not {"base", "pore_pressure", "soil_state", "pressure_envelope"} & simulation.arrays().keys()
    counters = simulation.counters()
    assert counters["base_calls"] == counters["flow_calls"] == counters["plastic_updates"] == 0
    assert counters["steps"] > 0
    assert simulation.base_impedance is None
    time, histories = simulation.take_histories()
    assert not len(time)
    assert not histories


def test_impermeable_ground_has_no_diffusion() -> None:
    regions = [
        Region(region.name, region.shape, region.material, Gs=region.Gs) for region in scenes.column().regions
    ]
    assert at_the_end(scenes.column(regions=regions)).flow_scheme == "undrained"


def test_output_that_is_not_asked_for_is_not_kept() -> None:
    spare = Output(envelopes=[], stress_paths=False)
    simulation = at_the_end(elastic_column(output=spare))
    assert not {"pressure_envelope", "strain_envelope"} & simulation.arrays().keys()
    assert simulation.envelope("r_u") is None
    assert simulation.envelope("gamma_max") is None
    _, histories = simulation.take_histories()
    assert set(histories) == {
        *(f"{name}_{axis}" for name in ("acceleration", "velocity", "displacement") for axis in "xy"),
        "excess_pore_pressure",
    }


def test_the_printed_operators_are_not_carried_unless_asked_for() -> None:
    assert "printed_stress" not in at_the_end(elastic_column()).arrays()
    printed = at_the_end(elastic_column(numerics=Numerics(operators="printed")))
    assert "printed_stress" in printed.arrays()


def test_damping_that_is_not_asked_for_is_not_computed() -> None:
    plain = at_the_end(elastic_column())
    assert "viscous_stress" not in plain.arrays()
    assert plain.undamped_dt is None
    rayleigh = Rayleigh(ratio=0.05, frequencies=(1.0, 10.0))
    damped = at_the_end(
        elastic_column(stages=[Gravity(), Shaking(scenes.PULSE, duration=0.8, rayleigh=rayleigh)])
    )
    assert damped.arrays()["viscous_stress"] > 0
    assert damped.undamped_dt == pytest.approx(plain.dt)
    assert damped.dt < plain.dt


def test_inertia_is_corrected_only_while_shaking_and_only_if_asked_for() -> None:
    plain = at_the_end(elastic_column())
    assert "inertia_correction" not in plain.arrays()
    assert plain.counters()["inertia_corrections"] == 0
    corrected = Simulation(elastic_column(numerics=Numerics(dispersion_correction=True)), threads=1)
    corrected.run_stage()
    assert "inertia_correction" not in corrected.arrays()
    assert corrected.counters()["inertia_corrections"] == 0
    corrected.run_stage()
    assert corrected.arrays()["inertia_correction"] > 0
    assert corrected.counters()["inertia_corrections"] == corrected.steps
    assert corrected.dt < plain.dt


def test_small_strain_builds_the_geometry_once_per_wall() -> None:
    """The particle lists are built for the fixed base and the compliant one, then only as soil moves."""
    weak = scenes.PULSE.scaled(pga_g=0.001)
    simulation = Simulation(elastic_column().with_motion(weak), threads=1)
    simulation.run_stage()
    # The fixed base's came with the section.
    assert simulation.counters()["geometry_builds"] == 0
    simulation.run_stage()
    assert simulation.counters()["geometry_builds"] == 1
