"""The work of a fleet before it starts: what each unit is analysed with."""

import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from adhesion_can.api.calibration import require_calibration_roles
from adhesion_can.config import Configuration
from adhesion_can.errors import InputError, suggest
from adhesion_can.fleet.dataset import Kept
from adhesion_can.fleet.schema import STEPS
from adhesion_can.fleet.units import Unit
from adhesion_can.fleet.work import Task, hash_settings

LoadConfiguration = Callable[[Path | None], Configuration]
"""Function from the path of a configuration file, or None, to the configuration."""


def read_steps(text: str) -> tuple[str, ...]:
    """Steps of the option `--steps`, in the order in which they are taken.

    Raises:
        InputError: A name is no step.

    """
    given = [name.strip() for name in text.split(",") if name.strip()]
    for name in given:
        if name not in STEPS:
            fix = suggest(name, STEPS) or f"known: {', '.join(STEPS)}"
            raise InputError(f"--steps {text}", f"no step {name!r}", fix)
    if not given:
        raise InputError("--steps", "no step is given", f"name some of {','.join(STEPS)}")
    return tuple(step for step in STEPS if step in given)


@dataclass(frozen=True, slots=True)
class Plan:
    """Units, and what they are analysed with.

    Attributes:
        units: Units in their order.
        out: Path or URL of the data set.
        steps: Steps to take.
        configurations: Configuration by the path of its file; None: that of the command.

    """

    units: Sequence[Unit]
    out: str
    steps: tuple[str, ...]
    configurations: Mapping[str | None, Configuration]

    def tasks(self, kept: Mapping[str, Kept], *, again: bool = False) -> Iterator[Task]:
        """Tasks of the units.

        Args:
            kept: Complete units of the data set by their paths.
            again: Whether units that failed are analysed again though nothing has changed.

        """
        pickled = {path: pickle.dumps(config) for path, config in self.configurations.items()}
        for unit in self.units:
            config = self.configurations[unit.config]
            settings = hash_settings(unit, config, self.steps)
            yield Task(
                *(unit, self.out, self.steps, pickled[unit.config], settings),
                *(kept.get(unit.path), again),
            )


def make_plan(
    units: Sequence[Unit], out: str, steps: tuple[str, ...], load: LoadConfiguration
) -> Plan:
    """Plan whose configurations suffice for its steps.

    Args:
        units: Units in their order.
        out: Path or URL of the data set.
        steps: Steps to take.
        load: Function that loads a configuration.

    Raises:
        ConfigError: A configuration cannot be read, or lacks a role that a step needs.

    """
    paths = dict.fromkeys(unit.config for unit in units)
    configs = {path: load(None if path is None else Path(path)) for path in paths}
    for config in configs.values():
        if {"replay", "identify", "diagnose"} & set(steps):
            config.require_identification()
        if "calibrate" in steps:
            require_calibration_roles(config)
        config.find_estimator()
    return Plan(units, out, steps, configs)
