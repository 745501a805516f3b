"""``h2nav status``: shows the state of the running daemon, as its panel does."""

import argparse
import json
import socket
from pathlib import Path
from typing import Any

from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput, TaskFailed
from h2nav.host.runtime_folder import USUAL_SOCKET, own_socket
from h2nav.service.health import ServiceState

PATIENCE_S = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.epilog = (
        "Exit status: 0 when the attitude is estimated and sent (state active), 1 when it is not, "
        "or when no daemon answers."
    )
    place = parser.add_mutually_exclusive_group()
    place.add_argument(
        "--socket",
        type=Path,
        metavar="PATH",
        help=f"events.socket (default: of your own daemon, or {USUAL_SOCKET})",
    )
    place.add_argument(
        "-c", "--config", type=Path, metavar="CONFIG.yaml", help="configuration that names it"
    )
    parser.add_argument("--json", action="store_true", help="print the daemon's answer as JSON")


def run(args: argparse.Namespace) -> int:
    """Asks the daemon and shows its state; returns 0 if it is active."""
    found = _asked(_socket(args))
    status = found["status"]
    if args.json:
        print_json(found)
    else:
        print("\n".join(_lines(found)))
    return 0 if status["state"] == ServiceState.ACTIVE.value else 1


def _socket(args: argparse.Namespace) -> Path:
    if args.config is None:
        return args.socket or _present_socket()
    # Reading a configuration costs twice the rest of this command.
    from h2nav.apps import configuration

    named = configuration.read(args.config).events.socket
    if not named:
        raise BadInput(f"{args.config}: events.socket: empty; name one, such as {USUAL_SOCKET}")
    return Path(named)


def _present_socket() -> Path:
    """The socket of this user's daemon, or else of the service."""
    own = own_socket()
    return own if own is not None and own.exists() else USUAL_SOCKET


def _asked(path: Path) -> dict[str, Any]:
    """Reads the daemon's first events: program, status, open findings.

    Raises:
        TaskFailed: no daemon answers there.
    """
    found: dict[str, Any] = {"started": {}, "status": None, "findings": []}
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as end:
        end.settimeout(PATIENCE_S)
        try:
            end.connect(str(path))
            with end.makefile("r", encoding="utf-8", newline="\n") as lines:
                for line in lines:
                    if _is_complete(found, json.loads(line)):
                        break
        except (OSError, ValueError) as error:
            raise TaskFailed(_no_answer(path, error)) from error
        except (AttributeError, LookupError, TypeError):
            raise TaskFailed(f"{path}: no daemon of h2nav answers there") from None
    if found["status"] is None:
        raise TaskFailed(f"{path}: the daemon closed the connection")
    return found


def _is_complete(found: dict[str, Any], event: dict[str, Any]) -> bool:
    """Adds an event; returns True once all open findings of the status have arrived."""
    kind = event.pop("event")
    if kind == "finding":
        found["findings"].append(event)
    elif kind in ("started", "status"):
        found[kind] = event
    status = found["status"]
    return status is not None and len(found["findings"]) >= len(status["open_findings"])


def _no_answer(path: Path, error: Exception) -> str:
    if isinstance(error, PermissionError):
        return f"{path}: permission denied; run as root or in the daemon's group (h2nav)"
    if isinstance(error, FileNotFoundError | ConnectionRefusedError):
        return (
            f"{path}: no daemon listens there; `systemctl status h2nav` says whether it runs, and "
            "events.socket in its configuration where"
        )
    return f"{path}: {error}"


def _lines(found: dict[str, Any]) -> list[str]:
    started, status = found["started"], found["status"]
    kernels = f"{started.get('kernels', 'unknown')} kernels"
    head = f"h2nav {started.get('version', '')} on {started.get('link', '')}, {kernels}"
    findings = [
        f"{each['severity']}: {each['source']}: {each['text']} (since {each['from_s']:.0f} s)"
        for each in found["findings"]
    ]
    return [head, *status.get("panel", [status["state"]]), *findings]
