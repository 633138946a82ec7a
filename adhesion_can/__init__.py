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
    from adhesion_can.api.calibration import calibrate as calibrate
    from adhesion_can.api.configuration import load_configuration as load_configuration
    from adhesion_can.api.diagnosis import diagnose as diagnose
    from adhesion_can.api.evaluation import evaluate as evaluate
    from adhesion_can.api.identification import identify as identify
    from adhesion_can.api.replay import SetpointTable as SetpointTable
    from adhesion_can.api.replay import replay as replay
    from adhesion_can.api.simulation import SimulatedDrive as SimulatedDrive
    from adhesion_can.api.simulation import simulate as simulate
    from adhesion_can.bus.frame import Frame as Frame
    from adhesion_can.calibration.fit import Calibration as Calibration
    from adhesion_can.config.configuration import Configuration as Configuration
    from adhesion_can.diagnosis.evaluate import Evaluation as Evaluation
    from adhesion_can.diagnosis.result import Diagnosis as Diagnosis
    from adhesion_can.errors import AdhesionCanError as AdhesionCanError
    from adhesion_can.estimation.batch_result import BatchResult as BatchResult
    from adhesion_can.estimation.extended.model import ExtendedModel as ExtendedModel
    from adhesion_can.estimation.tracker.tracker import Tracker as Tracker
    from adhesion_can.physics.estimate import Estimate as Estimate
    from adhesion_can.physics.samples import Samples as Samples
    from adhesion_can.recordings.recording import Recording as Recording
    from adhesion_can.service.core import ServiceCore as ServiceCore

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

__all__ = ["__version__"]
__all__ += list(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_MODULES])
