"""adhesion-can: the wheel/rail adhesion curve, identified online from a CAN bus.

`__all__` lists the public interface; every other module is private and may move. A name is
imported when it is first used, so that importing the package costs nothing.

    >>> import numpy as np
    >>> import adhesion_can
    >>> slip = np.linspace(0.001, 0.2, 500)
    >>> adhesion = 0.4 * (1 - np.exp(-40 * slip)) - 0.06 * slip
    >>> result = adhesion_can.identify(slip, adhesion)
    >>> round(result.whole.mu_max, 4), round(result.whole.lambda_m, 4)
    (0.3901, 0.1396)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from adhesion_can.version import __version__

if TYPE_CHECKING:
    from adhesion_can.api.calibration import calibrate
    from adhesion_can.api.configuration import load_configuration
    from adhesion_can.api.diagnosis import diagnose
    from adhesion_can.api.evaluation import evaluate
    from adhesion_can.api.identification import identify
    from adhesion_can.api.replay import SetpointTable, replay
    from adhesion_can.api.simulation import SimulatedDrive, simulate
    from adhesion_can.bus.frame import Frame
    from adhesion_can.calibration.fit import Calibration
    from adhesion_can.config.configuration import Configuration
    from adhesion_can.diagnosis.evaluate import Evaluation
    from adhesion_can.diagnosis.result import Diagnosis
    from adhesion_can.errors import AdhesionCanError
    from adhesion_can.estimation.batch_result import BatchResult
    from adhesion_can.estimation.extended.model import ExtendedModel
    from adhesion_can.estimation.tracker.tracker import Tracker
    from adhesion_can.physics.estimate import Estimate
    from adhesion_can.physics.samples import Samples
    from adhesion_can.recordings.recording import Recording
    from adhesion_can.service.core import ServiceCore

__all__ = [
    "AdhesionCanError",
    "BatchResult",
    "Calibration",
    "Configuration",
    "Diagnosis",
    "Estimate",
    "Evaluation",
    "ExtendedModel",
    "Frame",
    "Recording",
    "Samples",
    "ServiceCore",
    "SetpointTable",
    "SimulatedDrive",
    "Tracker",
    "__version__",
    "calibrate",
    "diagnose",
    "evaluate",
    "identify",
    "load_configuration",
    "replay",
    "simulate",
]

_MODULES = {
    "AdhesionCanError": "errors",
    "BatchResult": "estimation.batch_result",
    "Calibration": "calibration.fit",
    "Configuration": "config.configuration",
    "Diagnosis": "diagnosis.result",
    "Estimate": "physics.estimate",
    "Evaluation": "diagnosis.evaluate",
    "ExtendedModel": "estimation.extended.model",
    "Frame": "bus.frame",
    "Recording": "recordings.recording",
    "Samples": "physics.samples",
    "ServiceCore": "service.core",
    "SetpointTable": "api.replay",
    "SimulatedDrive": "api.simulation",
    "Tracker": "estimation.tracker.tracker",
    "calibrate": "api.calibration",
    "diagnose": "api.diagnosis",
    "evaluate": "api.evaluation",
    "identify": "api.identification",
    "load_configuration": "api.configuration",
    "replay": "api.replay",
    "simulate": "api.simulation",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_MODULES])
