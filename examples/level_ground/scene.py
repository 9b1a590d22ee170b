"""The level ground of scene.toml in Python; scene.toml names the sources. Running this file computes it."""

import sandboil as sb

# name, bottom and top (m), then Dr, G0 and hpo of PM4Sand
LAYERS = [
    ("layer 1", (12, 20), sb.PM4Sand(Dr=0.35, G0=476, hpo=0.53)),
    ("layer 2", (6, 12), sb.PM4Sand(Dr=0.55, G0=677, hpo=0.40)),
    ("layer 3", (0, 6), sb.PM4Sand(Dr=0.75, G0=890, hpo=0.63)),
]

scene = sb.Scene(
    spacing=0.2,
    gravity=9.81,
    water=sb.Water(unit_weight=10.0, bulk_modulus=1.0e6),
    water_table=sb.WaterTable(depth=0),
    regions=[
        sb.Region(name, sb.box(x=(0, 1), y=y), sand, hydraulic_conductivity=1e-3, Gs=2.67, K0=0.5)
        for name, y, sand in LAYERS
    ],
    sides=sb.Periodic(),
    stages=[
        sb.Gravity(),
        sb.Shaking(sb.Motion.synthetic(pga_g=0.47), base=sb.CompliantBase(), duration=40.0),
    ],
    output=sb.Output(depths=[4, 11, 17], history_dt=0.005, field_dt=0.25),
)

if __name__ == "__main__":
    run = sb.run(scene, "out/level_ground")
    print(run.summary())
