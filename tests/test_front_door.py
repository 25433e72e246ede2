"""The names that a program may lean on: there, light to import, and readable in help()."""

import pydoc
import subprocess
import sys

import pytest

import intervis

NAMES = [
    "Scene",
    "Sight",
    "Sensor",
    "Explanation",
    "explain",
    "visible_mask",
    "VISIBLE",
    "OCCLUDED",
    "UNKNOWN",
    "show",
    "analyze",
    "Analysis",
    "Settings",
    "open_drive",
    "Drive",
    "Frame",
    "Camera",
    "IntervisError",
    "ArgumentError",
    "PointsError",
    "PoseError",
    "CameraError",
    "SettingsError",
    "DriveError",
    "CalibrationError",
    "ScanError",
    "SceneError",
    "OutputError",
    "MissingExtraError",
]


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_there_and_listed(name):
    assert getattr(intervis, name) is not None
    assert name in intervis.__all__
    assert name in dir(intervis)


def test_subpackages_are_there_without_importing_them_first():
    asked = "import intervis; print(intervis.sight.Scene is intervis.Scene, intervis.VISIBLE)"
    said = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True
    ).stdout
    assert said.split() == ["True", "1"]


def test_the_import_alone_loads_nothing_heavy():
    asked = (
        "import sys, intervis; print(*(name for name in ('numpy', 'numba') if name in sys.modules))"
    )
    said = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True
    ).stdout
    assert said.split() == []


def test_the_three_states_are_the_numbers_of_the_interface():
    assert (intervis.VISIBLE, intervis.OCCLUDED, intervis.UNKNOWN) == (1, 0, -1)


def test_every_error_is_an_intervis_error():
    errors = [value for name in NAMES if isinstance(value := getattr(intervis, name), type)]
    errors = [error for error in errors if issubclass(error, Exception)]
    assert len(errors) == 12
    assert all(issubclass(error, intervis.IntervisError) for error in errors)


@pytest.mark.parametrize("name", ["Scene", "analyze", "open_drive", "explain", "visible_mask"])
def test_help_names_array_arguments_and_does_not_expand_them(name):
    text = pydoc.render_doc(getattr(intervis, name), renderer=pydoc.plaintext)
    assert "_NestedSequence" not in text
    if name != "open_drive":
        assert "ArrayLike" in text


def test_the_package_runs_as_a_module():
    said = subprocess.run(
        [sys.executable, "-m", "intervis", "--version"], capture_output=True, text=True, check=True
    ).stdout
    assert said.strip() == f"intervis {intervis.__version__}"


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'sigth'"):
        _ = intervis.sigth
