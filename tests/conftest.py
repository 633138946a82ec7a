"""What many tests share: where the real data lie, and quiet hypothesis runs."""

import os
import signal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "quiet", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.load_profile("quiet")
# For tools/mutation: the same examples in each run, and no search for the smallest one that fails.
settings.register_profile(
    "mutation",
    settings.get_profile("quiet"),
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),
    report_multiple_bugs=False,
)

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def realdata():
    """Folder of the real measurements; skips where it is absent."""
    named = os.environ.get("ADHESION_CAN_REALDATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "realdata"
    if not folder.is_dir():
        pytest.skip(f"no real data: neither $ADHESION_CAN_REALDATA nor {folder.name} beside us")
    return folder


@pytest.fixture
def restored_signals():
    """Handlers of the signals that `run` takes over, put back after a run in this process."""
    numbers = (
        *(signal.SIGINT, signal.SIGTERM, signal.SIGHUP),
        *(signal.SIGQUIT, signal.SIGUSR1, signal.SIGUSR2),
    )
    handlers = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)
