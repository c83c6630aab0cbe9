"""A recording's markers are fitted better than by its database, and without its noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.fit_markers import fit_markers
from geodesic_ocp.recordings.read_recording import read_markers
from geodesic_ocp.tables import text

KIT = Path(__file__).resolve().parents[4] / "shared" / "data" / "kit"
NAME = "take_book_from_shelf_right_arm_02"
pytestmark = pytest.mark.skipif(
    not (KIT / f"{NAME}.c3d").exists(), reason="the recordings of ../shared/data are not here"
)


@pytest.mark.slow
def test_the_book_s_recording() -> None:
    markers = read_markers(KIT / f"{NAME}.c3d")
    fit = fit_markers(go.human_arm("right"), markers)
    on_arm = [column for column, name in enumerate(fit.segments) if name != "thorax"]
    # The database's own errors, by its conversion's log: 29.9 mm on average, 107 mm at most.
    assert 1e3 * fit.errors[:, on_arm].mean() < 8.0
    assert 1e3 * fit.errors[:, on_arm].max() < 27.0
    # The subject is 1.83 m tall, which nothing in the file of the markers says.
    assert fit.height == pytest.approx(1.83, rel=0.03)
    assert fit.height_from == "from the markers of head and feet"
    database = go.read_motion(KIT / f"{NAME}.xml", fit.motion.joint_names)
    apart = fit.motion.q - database.q
    assert np.sqrt(np.mean(apart**2)) < 0.3
    # Apart from a constant of every joint, which depends on where markers are taken to be:
    assert np.std(apart, axis=0).mean() < 0.15
    noise, known = fit.motion.filtered().filter, database.filtered().filter
    assert noise is not None
    assert known is not None
    assert np.all(noise.noise < 0.1 * known.noise)
    assert fit.motion.trunk is not None
    assert fit.undetermined == ()
    assert "RSHO" in text(fit.table())
    assert len(repr(fit).splitlines()) <= 3
