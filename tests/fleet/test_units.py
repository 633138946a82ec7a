"""Which files are units, how their vehicles are called, and what a wrong name or manifest says."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.errors import InputError
from adhesion_can.fleet.units import find_units, read_manifest


@pytest.fixture
def folder(tmp_path):
    for name in ("a/one.log", "a/two.log.gz", "b/c/three.blf", "b/notes.txt", "b/.hidden.log",
                 "out/units/vehicle=a/one.parquet"):  # fmt: skip
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    return tmp_path


def names(units):
    return [(unit.path.rsplit("/", 1)[1], unit.vehicle) for unit in units]


def test_a_folder_gives_what_is_a_recording_by_its_name_and_not_the_data_set(folder):
    found = find_units([str(folder)], None, str(folder / "out"))
    assert names(found) == [("one.log", "a"), ("two.log.gz", "a"), ("three.blf", "c")]


def test_patterns_and_files_are_units_once_in_their_order(folder):
    given = [str(folder / "a" / "two.log.gz"), str(folder / "a" / "*")]
    found = find_units(given, None, str(folder / "out"))
    assert [name for name, _ in names(found)] == ["two.log.gz", "one.log"]


def test_a_relative_path_is_the_same_unit_as_an_absolute_one(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (relative,) = find_units(["a/one.log"], None, "out")
    (absolute,) = find_units([str(folder / "a" / "one.log")], None, "out")
    assert relative == absolute
    assert relative.unit_id == absolute.unit_id
    assert relative.unit_id.startswith("one.log-")


@pytest.mark.parametrize("expression", [r"/(\w+)\.log", r"(?P<day>.*)/(?P<vehicle>\w+)\.log"])
def test_an_expression_finds_the_vehicle_in_the_path(folder, expression):
    (unit,) = find_units([str(folder / "a" / "one.log")], expression, "out")
    assert unit.vehicle == "one"


@pytest.mark.parametrize(
    ("inputs", "expression", "said"),
    [
        (["gone.log"], None, "gone.log: No such file or directory; check the path"),
        (
            ["b/*.asc"],
            None,
            "b/*.asc: no file matches this pattern; check it; in a shell, put it in quotes",
        ),
        (["empty"], None, "empty: no recording in this folder"),
        (["a/one.log"], "(", "not a regular expression"),
        (["a/one.log"], r"loco(\d+)", "finds no vehicle in"),
        (["nowhere://x"], None, "no file system nowhere:// is known"),
    ],
)
def test_a_wrong_input_says_what_to_do(folder, monkeypatch, inputs, expression, said):
    monkeypatch.chdir(folder)
    (folder / "empty").mkdir()
    with pytest.raises(InputError) as error:
        find_units(inputs, expression, "out")
    assert said in str(error.value)


def test_a_manifest_names_vehicle_line_and_place(folder):
    manifest = folder / "units.csv"
    manifest.write_text(
        "path,vehicle,line,latitude,longitude,config\n"
        'a/one.log,"BR 185, no. 7",Gotthard,46.6,-8.5,car.toml\n'
        f"{folder}/a/two.log.gz,loco 2,,,,\n"
    )
    first, second = read_manifest(manifest)
    assert first.vehicle == "BR 185, no. 7"
    assert (first.line, first.latitude_deg, first.longitude_deg) == ("Gotthard", 46.6, -8.5)
    assert first.config == str(folder / "car.toml")
    assert (second.line, second.latitude_deg, second.config) == (None, None, None)
    assert first.path == str(folder / "a" / "one.log")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("path,vehicle\n", "no row"),
        ("path\na/one.log\n", "no column 'vehicle'; the first columns must be path,vehicle"),
        ("path,vehicle,latitud\n", "no column 'latitud' is known; similar names: latitude"),
        ("path,vehicle\na/one.log,\n", "line 2: no vehicle; fill it in"),
        ("path,vehicle\na/gone.log,x\n", "gone.log: No such file or directory"),
        ("path,vehicle\na,x\n", "line 2: a is not a single file; write a row for each recording"),
        ("path,vehicle\na/one.log,x,y\n", "line 2: more cells than columns"),
        ("path,vehicle,latitude\na/one.log,x,north\n", "line 2: latitude 'north'"),
        ("path,vehicle,longitude\na/one.log,x,181\n", "line 2: longitude '181'"),
        ("path,vehicle\na/one.log,x\na/one.log,y\n", "line 3: "),
        ("path,vehicle\n\xff\n", "cannot be read as CSV"),
    ],
)
def test_a_wrong_manifest_says_where_and_what_to_do(folder, text, said):
    manifest = folder / "units.csv"
    manifest.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError) as error:
        read_manifest(manifest)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@given(st.text(st.characters(blacklist_characters="/\0", blacklist_categories=["Cs"]), min_size=1))
def test_an_identity_is_a_plain_file_name(name):
    from adhesion_can.fleet.units import Unit

    identity = Unit(f"/a/{name}", "v").unit_id
    assert identity.replace("-", "").replace(".", "").replace("_", "").isalnum()
    assert identity.isascii()
    assert len(identity) < 80
    assert identity != Unit(f"/b/{name}", "v").unit_id
