"""Joint trajectories for other tools: LeRobot, players of MCAP, and rerun.

Each function returns the content of a file, from times (k,) [s], arrays (k, n) by "position",
"velocity", "acceleration" and, if known, "effort", names of the n joints, and the rate [Hz], None
of uneven samples.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array

NANO = 1_000_000_000


def lerobot(
    time: Array, arrays: Mapping[str, Array], names: Sequence[str], rate: float | None
) -> bytes:
    """Return one episode of a LeRobot data set, as Parquet.

    `observation.state` is the position of a frame and `action` that of the next one. The schema's
    metadata `info` is JSON with `fps` and `features`, as in LeRobot's `meta/info.json`.

    Raises:
        ValueError: the samples are not evenly spaced.
        ImportError: pyarrow is missing.
    """
    if rate is None:
        raise ValueError("LeRobot needs evenly spaced samples: resample with `at_rate`")
    parquet = library(".parquet")
    pa = import_module("pyarrow")
    position = arrays["position"].astype(np.float32)
    count = len(time)
    vectors = {"observation.state": position, "action": np.vstack([position[1:], position[-1:]])}
    columns = {
        name: pa.FixedSizeListArray.from_arrays(values.ravel(), len(names))
        for name, values in vectors.items()
    }
    columns["timestamp"] = pa.array((time - time[0]).astype(np.float32))
    frames = np.arange(count)
    columns |= {"frame_index": pa.array(frames), "index": pa.array(frames)}
    columns |= {each: pa.array(np.zeros_like(frames)) for each in ("episode_index", "task_index")}
    feature = {"dtype": "float32", "shape": [len(names)], "names": list(names)}
    info = json.dumps({"fps": rate, "features": dict.fromkeys(vectors, feature)})
    stream = io.BytesIO()
    parquet.write_table(pa.table(columns).replace_schema_metadata({"info": info}), stream)
    return stream.getvalue()


def mcap(
    time: Array, arrays: Mapping[str, Array], names: Sequence[str], rate: float | None
) -> bytes:
    """Return an MCAP log of /joint_states, with the fields of sensor_msgs/msg/JointState, as JSON.

    Raises:
        ImportError: mcap is missing.
    """
    stream = io.BytesIO()
    numbers = {"type": "array", "items": {"type": "number"}}
    stamp = {each: {"type": "integer"} for each in ("sec", "nanosec")}
    header = {"stamp": {"type": "object", "properties": stamp}, "frame_id": {"type": "string"}}
    fields = {
        "header": {"type": "object", "properties": header},
        "name": {"type": "array", "items": {"type": "string"}},
        **dict.fromkeys(("position", "velocity", "effort"), numbers),
    }
    schema = json.dumps({"type": "object", "properties": fields}).encode()
    writer = library(".mcap").Writer(stream)
    writer.start()
    kind = writer.register_schema("sensor_msgs/msg/JointState", "jsonschema", schema)
    channel = writer.register_channel("/joint_states", "json", kind)
    for sample, instant in enumerate(np.round(time * NANO).astype(int).tolist()):
        seconds, nanoseconds = divmod(instant, NANO)
        message: dict[str, Any] = {
            "header": {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": ""},
            "name": list(names),
        }
        for each in ("position", "velocity", "effort"):
            message[each] = arrays[each][sample].tolist() if each in arrays else []
        writer.add_message(channel, instant, json.dumps(message).encode(), instant, sample)
    writer.finish()
    return stream.getvalue()


def rerun(
    time: Array, arrays: Mapping[str, Array], names: Sequence[str], rate: float | None
) -> bytes:
    """Return a recording of rerun: a series of numbers over `time` for KIND/JOINT.

    Raises:
        ImportError: rerun-sdk is missing.
    """
    rr = library(".rrd")
    recording = rr.RecordingStream("geodesic_ocp trajectory")
    memory = recording.memory_recording()
    index = rr.TimeColumn("time", duration=time)
    for kind, values in arrays.items():
        for name, column in zip(names, values.T, strict=True):
            series = rr.Scalars.columns(scalars=column)
            rr.send_columns(f"{kind}/{name}", [index], series, recording=recording)
    return bytes(memory.drain_as_bytes())


EXPORTS: Mapping[str, Callable[..., bytes]] = {".parquet": lerobot, ".mcap": mcap, ".rrd": rerun}
_MODULES = {".parquet": "pyarrow.parquet", ".mcap": "mcap.writer", ".rrd": "rerun"}


def library(suffix: str) -> Any:
    """Return the module that writes files with a suffix.

    Raises:
        ImportError: its package is missing.
    """
    try:
        return import_module(_MODULES[suffix])
    except ImportError as error:
        extra = "pip install 'geodesic_ocp[exports]'"
        raise ImportError(f"{suffix} needs {_MODULES[suffix]}: {extra} ({error})") from error
