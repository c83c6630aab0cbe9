"""show(): inline in notebooks, otherwise in a browser, or in a file."""

from __future__ import annotations

import html
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.drawing import viewer as viewer_module
from geodesic_ocp.drawing.actors import model_actor
from geodesic_ocp.drawing.scene import Playback, Scene
from geodesic_ocp.drawing.viewer import Viewer, show

ARM = go.human_arm("right")
STILL = Playback(
    "an <arm>", (Scene("arm", np.zeros(1), (model_actor(ARM, np.zeros((1, ARM.dof))),)),), {}
)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """Addresses that a browser was asked for."""
    addresses: list[str] = []
    monkeypatch.setattr(
        viewer_module.webbrowser, "open", lambda address: bool(addresses.append(address)) or True
    )
    monkeypatch.setattr(viewer_module.tempfile, "mkdtemp", lambda prefix: str(tmp_path))
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    return addresses


def pretend_shell(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """IPython runs with a shell of this class."""
    ipython = ModuleType("IPython")
    ipython.get_ipython = type(name, (), {})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", ipython)


def test_a_script_opens_a_browser(opened: list[str], tmp_path: Path) -> None:
    viewer = show(STILL)
    assert opened == [(tmp_path / "viewer.html").as_uri()]
    assert (tmp_path / "viewer.html").read_text(encoding="utf-8") == viewer.html()


@pytest.mark.slow
def test_a_notebook_displays_the_value_and_opens_nothing(
    opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pretend_shell(monkeypatch, "ZMQInteractiveShell")
    viewer = show(STILL, height=500)
    assert not opened
    frame = viewer._repr_html_()
    assert frame.startswith("<iframe srcdoc=")
    assert "height: 500px" in frame
    # Within quotes, a page is a page again once its entities are read.
    assert html.unescape(frame.split('"')[1]) == viewer.html()


def test_the_terminal_of_ipython_opens_a_browser(
    opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pretend_shell(monkeypatch, "TerminalInteractiveShell")
    show(STILL)
    assert len(opened) == 1


def test_a_file_is_written_and_opened_only_if_wanted(opened: list[str], tmp_path: Path) -> None:
    file = tmp_path / "arm.HTML"
    show(STILL, file=file, title="renamed")
    assert not opened
    assert "<title>renamed</title>" in file.read_text(encoding="utf-8")
    show(STILL, file=file, open_browser=True)
    assert opened == [file.as_uri()]
    show(STILL, open_browser=False)
    assert len(opened) == 1


def test_without_a_browser_the_page_is_named(
    opened: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(viewer_module.webbrowser, "open", lambda address: False)
    assert Viewer(STILL).open() == tmp_path / "viewer.html"
    assert str(tmp_path / "viewer.html") in capsys.readouterr().out


def test_the_title_is_text() -> None:
    page = Viewer(STILL).html()
    assert "<title>an &lt;arm&gt;</title>" in page
    assert "<h1>an &lt;arm&gt;</h1>" in page
    assert "an <arm>" not in page


@pytest.mark.slow
def test_models_are_shown_by_their_type(opened: list[str]) -> None:
    viewer = show(ARM, go.human_arm("left"), open_browser=False)
    assert len(viewer.playback.scenes) == 2
    with pytest.raises(TypeError, match="float"):
        show(1.0)
    assert not opened


@pytest.mark.parametrize("name", ["arm.obj", "arm"])
def test_other_suffixes_name_the_known_ones(name: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.html, \.mp4, \.gif, \.webp, \.png"):
        show(STILL, file=tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_page_that_cannot_be_written_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(OSError, match="absent"):
        Viewer(STILL).save(tmp_path / "absent" / "arm.html")
    file = tmp_path / "arm.html"
    file.write_text("before")
    monkeypatch.setattr(Path, "replace", _refuse)
    with pytest.raises(OSError, match="disk is full"):
        Viewer(STILL).save(file)
    assert [each.name for each in tmp_path.iterdir()] == ["arm.html"]
    assert file.read_text() == "before"


def _refuse(*_: object) -> None:
    raise OSError("the disk is full")


def test_pictures_are_drawn_by_the_video_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = ModuleType("geodesic_ocp.drawing.save_video")
    calls: list[tuple[object, ...]] = []

    def save_video(playback: Playback, path: Path, **options: object) -> Path:
        calls.append((playback, path, options))
        return path

    module.save_video = save_video  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    file = tmp_path / "arm.mp4"
    assert Viewer(STILL).save(file, speed=2.0) == file
    default = {"rate": 25.0, "width": 960, "at": None, "layers": None, "progress": None}
    assert calls.pop() == (STILL, file, default | {"speed": 2.0})
    chosen = {"at": 0.5, "layers": ("frames",), "progress": lambda label, done, total: None}
    Viewer(STILL).save(tmp_path / "arm.png", **chosen)  # type: ignore[arg-type]
    assert calls.pop() == (STILL, tmp_path / "arm.png", default | {"speed": 1.0} | chosen)


@pytest.mark.slow
def test_layers_are_shown_at_first(tmp_path: Path) -> None:
    """In what is shown, or in a file alone."""
    usual = show(ARM, open_browser=False)
    wanted = ("frames", "mobility ellipsoids")
    assert set(wanted) <= set(usual.playback.layers) & set(usual.playback.hidden)
    viewer = show(ARM, layers=wanted, open_browser=False)
    assert not set(wanted) & set(viewer.playback.hidden)
    page = usual.save(tmp_path / "arm.html", layers=wanted).read_text(encoding="utf-8")
    assert page == viewer.html()
    assert page != usual.html()
    one = show(ARM, layers="frames", open_browser=False).playback
    assert set(one.layers) - set(one.hidden) == {"frames"}
    with pytest.raises(ValueError, match=r"layers: 'walls' must be one of .*frames, mobility"):
        show(ARM, layers=["frames", "walls"], open_browser=False)
    with pytest.raises(ValueError, match="layers: 'walls'"):
        usual.save(tmp_path / "no.html", layers=["walls"])
    with pytest.raises(ValueError, match=r"at is the time of a \.png"):
        usual.save(tmp_path / "no.html", at=0.0)
    assert not (tmp_path / "no.html").exists()


def test_a_viewer_is_short_when_printed() -> None:
    assert repr(Viewer(STILL)) == "Viewer(Playback('an <arm>', 1 scenes, 0 to 0))"
