"""Service, locomotive and creep controller as FMUs, coupled by FMPy.

    python fmu.py [DURATION_S]

At each communication point an output is set to all inputs of its name, then all FMUs step. Names of
the three agree, so no list of connections is needed.
"""

import subprocess
import sys
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from adhesion_can.fmu.library import own_platform

KINDS = ("service", "controller", "locomotive")
STEP_US = 2000
TRACKING = 1
"""Number of the status, as the description's enumeration has it."""


class Part:
    """An FMU at work."""

    def __init__(self, path: Path, start: dict[str, float]) -> None:
        description = read_model_description(path)
        self.variables = {one.name: one for one in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=path.stem,
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.set(start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def names(self, causality: str) -> list[str]:
        """Names of the inputs, outputs or parameters."""
        return [name for name, one in self.variables.items() if one.causality == causality]

    def get(self) -> dict[str, float]:
        """Values of all outputs."""
        values: dict[str, float] = {}
        for kind in ("Real", "Integer"):
            names = [n for n in self.names("output") if self._is_of(n, kind)]
            references = [self.variables[name].valueReference for name in names]
            get = self.fmu.getReal if kind == "Real" else self.fmu.getInteger
            values |= zip(names, get(references), strict=True) if names else {}
        return values

    def set(self, values: dict[str, float]) -> None:
        """Set those of the values that it has as inputs or parameters."""
        names = [*self.names("input"), *self.names("parameter")]
        for kind in ("Real", "Integer"):
            known = [n for n in names if n in values and self._is_of(n, kind)]
            references = [self.variables[name].valueReference for name in known]
            put = self.fmu.setReal if kind == "Real" else self.fmu.setInteger
            if known:
                put(references, [values[name] for name in known])

    def _is_of(self, name: str, kind: str) -> bool:
        # An enumeration is set and got as an Integer.
        return (self.variables[name].type == "Real") is (kind == "Real")

    def step(self, t_us: int) -> None:
        """Advance by one step."""
        self.fmu.doStep(currentCommunicationPoint=t_us / 1e6, communicationStepSize=STEP_US / 1e6)

    def close(self) -> None:
        """End its process."""
        self.fmu.terminate()
        self.fmu.freeInstance()


def outputs_of(parts: list[Part]) -> dict[str, float]:
    """Values of all outputs by name."""
    return {name: value for part in parts for name, value in part.get().items()}


def couple(parts: list[Part], duration_s: float) -> tuple[float, float]:
    """Share of the steps in TRACKING, and mean adhesion that the locomotive used."""
    tracking = used = 0.0
    steps = round(duration_s * 1e6 / STEP_US)
    values = outputs_of(parts)
    for number in range(steps):
        for part in parts:
            part.set(values)
        for part in parts:
            part.step(number * STEP_US)
        values = outputs_of(parts)
        tracking += values["status"] == TRACKING
        used += values["true_adhesion_used"]
    return tracking / steps, used / steps


def main(duration_s: float) -> None:
    """Export the three FMUs into this folder and couple them."""
    paths = [Path(f"{kind}.fmu") for kind in KINDS]
    for kind, path in zip(KINDS, paths, strict=True):
        words = ["-m", "adhesion_can.cli.main", "export", "--fmu", kind, str(path)]
        words += ["--platform", str(own_platform())]  # without it: for every platform
        subprocess.run([sys.executable, *words], check=True)
    parts = [Part(path, {"duration": duration_s}) for path in paths]
    try:
        tracking, used = couple(parts, duration_s)
    finally:
        for part in parts:
            part.close()
    print(f"TRACKING {100 * tracking:.3f} % of the steps")
    print(f"mean adhesion used {used!r}")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0)
