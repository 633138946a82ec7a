"""One export of each FMU for all tests of the folder, for this machine."""

import shutil
from contextlib import contextmanager
from types import SimpleNamespace
from zipfile import ZipFile

import pytest

from adhesion_can.config import load_configuration
from adhesion_can.fmu import library
from adhesion_can.fmu.contents import KINDS, FmuContents
from adhesion_can.fmu.export import export_fmu


@pytest.fixture(scope="session")
def library_cache(tmp_path_factory):
    """Folder in which compiled libraries are kept."""
    return tmp_path_factory.mktemp("cache")


@contextmanager
def quickly(cache):
    """With the machine's own compiler where there is one: Zig builds its own C library first."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        if shutil.which("cc"):
            patch.setattr(library, "_has_zig", lambda: False)
        elif not library._has_zig():
            pytest.skip("needs a C compiler: cc or the extra 'fmu'")
        if library.own_platform() is None:
            pytest.skip("FMI 2.0 has no name for this platform")
        yield


@pytest.fixture
def quick_compiler(library_cache):
    """The quicker of the compilers."""
    with quickly(library_cache):
        yield


@pytest.fixture(scope="session")
def fmus(library_cache, tmp_path_factory):
    """Paths of the three FMUs by kind."""
    folder, config = tmp_path_factory.mktemp("fmus"), load_configuration()
    paths = {kind: folder / f"{kind}.fmu" for kind in KINDS}
    with quickly(library_cache):
        for kind, path in paths.items():
            export_fmu(FmuContents(kind, config), path, [library.own_platform()])
    return paths


@pytest.fixture(scope="session")
def unpacked(fmus, tmp_path_factory):
    """Folders of the unpacked FMUs by kind, with a blank and a percent sign in their path."""
    found = {}
    for kind, path in fmus.items():
        found[kind] = tmp_path_factory.mktemp("a 5% slip") / kind
        with ZipFile(path) as archive:
            archive.extractall(found[kind])
    return found


@pytest.fixture
def host(unpacked):
    """Makes instances of an FMU in FMPy, and frees them; their messages are in `host.said`."""
    fmi2 = pytest.importorskip("fmpy.fmi2", reason="needs the extra 'test'")
    fmpy = pytest.importorskip("fmpy")
    said, made = [], []

    def log(_environment, _name, _status, _category, message):
        said.append(message.decode())

    def instantiate(kind, folder=None, guid=None):
        description = fmpy.read_model_description(folder or unpacked[kind])
        one = fmi2.FMU2Slave(
            guid=guid or description.guid,
            unzipDirectory=str(folder or unpacked[kind]),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=f"a {kind}",
        )
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(log)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        one.callbacks_of_the_test = callbacks
        one.instantiate(callbacks=callbacks)
        one.references = {v.name: v.valueReference for v in description.modelVariables}
        made.append(one)
        return one

    def initialize(kind, **start):
        one = instantiate(kind)
        one.setupExperiment(startTime=0.0)
        put(one, **start)
        one.enterInitializationMode()
        one.exitInitializationMode()
        return one

    yield SimpleNamespace(
        instantiate=instantiate, initialize=initialize, put=put, read=read, said=said
    )
    for one in made:
        one.freeInstance()


def put(one, **values):
    """Set numbers; an int as an Integer."""
    for name, value in values.items():
        setter = one.setInteger if isinstance(value, int) else one.setReal
        setter([one.references[name]], [value])


def read(one, *names):
    """Numbers of real variables."""
    return one.getReal([one.references[name] for name in names])
