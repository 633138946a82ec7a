"""Diagnosing a drive: hide an effect in a simulated drive, find it, use the extended model.

    python diagnose.py [DURATION_S]

On the command line the same is

    adhesion-can simulate --scenario sweep --duration 240 --effect load_dependence --log drive.log
    adhesion-can diagnose drive.log --extended model.toml --html diagnosis.html
    adhesion-can replay drive.log --model model.toml
"""

import sys

import adhesion_can


def main(duration_s: float = 120.0) -> None:
    # A good drive sweeps the slip beyond the peak in traction and braking, with coasting between.
    size = 4e-12  # share of the adhesion that is lost per squared load, 1/N^2
    drive = adhesion_can.simulate("sweep", duration_s, effects={"load_dependence": size})
    log = drive.write("drive.log")

    diagnosis = adhesion_can.diagnose(log)
    print(f"verdict: {diagnosis.verdict}")
    for cause in diagnosis.causes:
        print(f"named:   {cause.effect}, {cause.title}")
        for one in cause.parameters:
            value = f"{one.name} = {one.value:.4g} +- {one.std:.2g} {one.unit}"
            print(f"         {value} (hidden: {size:g})")
        print(f"rivals:  {', '.join(cause.rivals) or 'none that these data could mean instead'}")
    gain = diagnosis.gain
    if gain is None:
        sys.exit("this drive is too short to hold anything back: give it 60 s or more")
    low, high = gain.interval
    print(
        f"gain:    RMSE {gain.rmse_before:.4f} -> {gain.rmse_after:.4f} on held-out data, "
        f"{gain.percent:.1f} % (95 % interval {low:.1f} to {high:.1f} %)"
    )

    # The service with the model: its setpoints hold for the load at hand.
    plain, extended = adhesion_can.replay(log), adhesion_can.replay(log, model=diagnosis.model)
    for name, table in (("plain", plain), ("with the model", extended)):
        share = (table["status"] == "TRACKING").mean()
        doubt = (table["doubt"] == "AXLE_LOAD").mean()
        print(f"{name:15}TRACKING {share:4.0%} of the time, doubt about the axle load {doubt:4.0%}")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
