"""The command line, geodesic-ocp: its commands, their exit codes, and files of settings."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from importlib.metadata import version
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

from cyclopts import App, ArgumentCollection, CycloptsError, Parameter
from cyclopts.config import Dict

from geodesic_ocp.cli.terminal import Interrupts
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.records import read_structured

_EXIT = """Exit codes: 0 done; 1 a check failed, a retargeting is no success, some of many
recordings were left out, or an error in a problem's own code, shown whole; 2 wrong input, named in
one line; 3 a solver or integration failed; 130 interrupted."""
_EXTRA = "pip install 'geodesic_ocp["  # in messages about packages that are not installed
# A command is imported when it is called, so that none waits for the packages of another.
_COMMANDS = {
    "analyse": ("analyse:analyse", "Cut recordings into geodesic synergies; compare baselines."),
    "retarget": ("retarget:retarget", "Transfer the synergies of a recording to a robot."),
    "fit": ("fit:fit", "Estimate parameters of the metric from recordings."),
    "study": ("study:study", "Compute statistics over the subjects of many recordings."),
    "demo": ("retarget:demo", "Analyse the bundled recording."),
    "solve": ("solve:solve", "Solve and plot the problems that a Python file defines."),
    "show": ("show:show", "Show recordings, results and robots in 3-D and in motion."),
    "check": ("info:check", "Check the installation against known geodesics."),
    "align": ("align:align", "Show and save how a robot's arm is aligned with a person's."),
    "check-trajectory": (
        "check_trajectory:check_trajectory",
        "Check that a robot can execute a trajectory.",
    ),
    "models": ("info:models", "List the available models and back ends, or describe one."),
    "info": ("info:info", "Show versions, compilers and settings; clear the cache."),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command, and return the exit code."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    with Interrupts.noted():
        try:
            found = new_app()(tokens, exit_on_error=False, print_error=False)
            return int(found or 0) if tokens else 2
        except KeyboardInterrupt:
            return _failed("interrupted", 130)
        except BrokenPipeError:  # the reader of the output, such as `head`, has seen enough
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except CycloptsError as error:
            return _failed(f"{error} (--help lists the options)", 2)
        except Exception as error:
            # CasADi turns a Ctrl-C inside any of its functions into errors of many kinds.
            if Interrupts.seen:
                return _failed("interrupted", 130)
            if isinstance(error, (ValueError, OSError)):
                return _failed(_with_files(error, tokens), 2)
            if isinstance(error, GeodesicOcpError):
                return _failed(error, 3)
            if isinstance(error, ImportError) and _EXTRA in str(error):
                return _failed(error, 2)
            raise


def new_app() -> App:
    """Return the parser of all commands."""
    app = App(
        name="geodesic-ocp",
        help="Geodesics of mechanical systems, and human arm motion as sequences of them.",
        help_epilogue=_EXIT,
        help_format="markdown",
        version=f"geodesic-ocp {version('geodesic_ocp')}",
        default_parameter=Parameter(negative_iterable="", negative_none=""),
        config=_settings_file,
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    for name, (place, text) in _COMMANDS.items():
        app.command(f"geodesic_ocp.cli.{place}", name=name, help=text)
    return app


def _settings_file(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Take options that are not given from the file that --settings names."""
    given = [each.tokens[0] for each in arguments if each.name == "--settings" and each.tokens]
    if not given:
        return
    file = Path(given[0].value)
    found = read_structured(file, "table of settings")
    names = [name for each in arguments for name in each.names if name not in each.negatives]
    known = {name.lstrip("-").replace("-", "_"): name for name in names}
    if not isinstance(found, dict):
        raise ValueError(f"--settings {file}: unknown settings: not a table")
    settings: dict[str, Any] = {}
    for key, value in found.items():
        name = known.get(str(key).replace("-", "_"), "").lstrip("-")
        if not name or name in settings:
            wrong = "given twice" if name else "unknown settings"
            near = [] if name else get_close_matches(str(key), known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"--settings {file}: {wrong}: {key!r}{hint}")
        settings[name] = value
    Dict(settings, source=str(file), use_commands_as_keys=False)(app, commands, arguments)


def _with_files(error: Exception, tokens: Sequence[str]) -> str:
    """Return the message of an error, and the files among the options that it is about, unless it
    names them; of a file of settings, also those.
    """
    words = chain(*(each.split("=", 1) for each in tokens))
    message = str(error)
    endings = []
    for option, file in pairwise(words):
        if not option.startswith("--") or file in message or not Path(file).is_file():
            continue
        if option == "--settings":
            found = read_structured(Path(file), "table of settings")
            meant = [f"{key} = {each!r}" for key, each in found.items() if _is_about(message, key)]
            endings.append(f"the settings of {file}" + (f": {', '.join(meant)}" if meant else ""))
        elif _is_about(message, option.lstrip("-")):
            endings.append(f"{option} {file}")
    return f"{message} (with {', and '.join(endings)})" if endings else message


def _is_about(message: str, key: str) -> bool:
    """Return whether a message names an option or setting, or the first word of its name."""
    words = (key.replace("-", "_"), key.replace("_", "-"), re.split("[-_]", key)[0])
    return any(re.search(rf"\b{re.escape(word)}\b", message) for word in words)


def _failed(reason: object, code: int) -> int:
    print("geodesic-ocp: error:", " ".join(str(reason).split()), file=sys.stderr)
    return code
