import importlib

import pytest

import pepper_drake._former_names as former


@pytest.mark.parametrize(("old", "new"), former._MODULES.items())
def test_a_former_module_is_its_successor(old, new):
    with pytest.warns(DeprecationWarning, match="is now"):
        former_module = (
            former._FormerModules()
            .find_spec(old, None)
            .loader.create_module(importlib.machinery.ModuleSpec(old, None))
        )
    assert former_module is importlib.import_module(new)


def test_what_is_set_on_a_former_module_is_set_on_its_successor(monkeypatch):
    former_module = importlib.import_module("pepper_drake.systems.camera_model")
    successor = importlib.import_module("pepper_drake.systems.sensing.camera_model")
    assert successor.__spec__.name == successor.__name__
    monkeypatch.setattr(former_module, "apply_depth_noise", "patched")
    assert successor.apply_depth_noise == "patched"


def test_former_names_are_found_in_former_modules():
    module = importlib.import_module("pepper_drake.perception.approach")
    assert module.DepthView is module.DepthFrame
