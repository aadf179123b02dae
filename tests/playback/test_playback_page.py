import base64
import html
import re

import pytest
import umsgpack

from pepper_drake.errors import InputError
from pepper_drake.playback.bodies import replay_frames
from pepper_drake.playback.drawing import draw
from pepper_drake.playback.loading import load_motion
from pepper_drake.playback.page import show, standalone_page


def messages(page):
    encoded = re.findall(r'^"([A-Za-z0-9+/=]+)",?$', page, flags=re.MULTILINE)
    return [umsgpack.unpackb(base64.b64decode(text)) for text in encoded]


def test_a_page_holds_the_viewer_all_shapes_and_the_animation(runs):
    commands = draw([replay_frames(load_motion(run)) for run in runs])
    page = standalone_page(commands, "low & <high>")
    assert "MeshCat" in page
    assert "<title>low &amp; &lt;high&gt;</title>" in page
    assert "http://" not in page.split("</script>")[-2], "it needs no network"
    drawn = messages(page)
    assert len(drawn) == len(commands)
    kinds = {message["type"] for message in drawn}
    assert kinds == {"delete", "set_object", "set_transform", "set_property"} | {
        "set_animation",
        "set_control",
    }
    shapes = {
        geometry["type"]
        for message in drawn
        if message["type"] == "set_object"
        for geometry in message["object"]["geometries"]
    }
    assert {"BoxGeometry", "CylinderGeometry", "SphereGeometry", "LatheGeometry"} <= shapes
    (marker,) = [
        message["object"]["object"]
        for message in drawn
        if message.get("path", "").startswith("/pepper_drake/1/goal_object/")
        and message["type"] == "set_object"
        and message["object"]["object"]["type"] == "_meshfile_object"
    ]
    assert marker["resources"]["marker.png"].startswith("data:image/png;base64,")


def test_a_notebooks_cell_holds_the_whole_page(runs):
    cell = show(runs, height=300, from_arm=True)
    assert "height: 300px" in cell.data
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', cell.data).group(1))
    assert page.startswith("<!DOCTYPE html>")
    assert "<title>low, high</title>" in page
    assert len(messages(page)) > 100


def test_one_run_need_not_be_in_a_list(runs):
    assert "low" in show(str(runs[0])).data


def test_a_cell_says_what_is_wrong_with_a_path(tmp_path):
    with pytest.raises(InputError, match="nothing to play back"):
        show(tmp_path)
