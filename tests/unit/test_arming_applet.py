"""The applet for ArduPilot's scripting, run by Lua 5.3 with bindings that behave as ArduPilot's."""

import json
import subprocess

import pytest
from needs import REPOSITORY, need_program
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire import outbound

APPLET = REPOSITORY / "packaging" / "ardupilot" / "h2nav_arming.lua"
NOT_HEARD = "h2nav: not heard since the start"
SILENT = "h2nav: it has fallen silent"
# What the autopilot offers to scripts; each turn delivers messages, then runs the applet once.
BINDINGS = """
local turns, armed, now = dofile(arg[2]), false, 0
local waiting, failed, passes = {}, nil, false
arming = {
  get_aux_auth_id = function() if turns.none_free then return nil end return 7 end,
  set_aux_auth_failed = function(_, id, text) assert(id == 7); failed, passes = text, false end,
  set_aux_auth_passed = function(_, id) assert(id == 7); failed, passes = nil, true end,
  is_armed = function() return armed end,
  disarm = function() error("it must not disarm") end,
  arm = function() error("it must not arm") end,
}
gcs = { send_text = function(_, level, text) io.stderr:write(text) end }
param = { get = function(_, name) if name == "SYSID_THISMAV" then return 1 end return nil end }
mavlink = {
  init = function(_, size, ids) assert(size > 0 and ids == 3) end,
  register_rx_msgid = function(_, id) return id == 0 or id == 252 or id == 385 or error(id) end,
  receive_chan = function() return table.remove(waiting, 1) end,
}
millis = function() return now end
local run = loadfile(arg[1])
local update = run
for _, turn in ipairs(turns) do
  now, armed = turn.ms, turn.armed or false
  for _, hex in ipairs(turn) do
    local bytes = hex:gsub("..", function(pair) return string.char(tonumber(pair, 16)) end)
    waiting[#waiting + 1] = bytes
  end
  local following, pause = update()
  if following then assert(pause > 0); update = following end
  print(passes and "passes" or (failed or "undecided"))
end
"""


def message(value, *, name=b"h2_arm", component=191, system=1):
    """As ArduPilot hands a message to a script: the checksum first."""
    if name == b"h2_arm":
        return framed(outbound.arming_opinion(value), component, system)
    return framed(mavlink.MAVLink_named_value_int_message(0, name, value), component, system)


def framed(packed, component=191, system=1):
    frame = packed.pack(mavlink.MAVLink(None, system, component))
    return (frame[-2:] + frame[:-2]).hex()


def said(tmp_path, turns, *, none_free=False):
    lua = need_program("lua5.3")
    bindings, data = tmp_path / "bindings.lua", tmp_path / "turns.lua"
    bindings.write_text(BINDINGS)
    rows = ", ".join(
        f"{{ms={ms}, armed={str(armed).lower()}, {', '.join(map(json.dumps, hexes))}}}"
        for ms, armed, hexes in turns
    )
    data.write_text(f"return {{none_free={str(none_free).lower()}, {rows}}}")
    done = subprocess.run(
        [lua, bindings, APPLET, data], capture_output=True, text=True, check=True, timeout=20
    )
    return done.stdout.splitlines(), done.stderr


@pytest.mark.parametrize(
    ("value", "expected"),
    [(1, "passes"), (0, "h2nav: knows nothing yet"), (-2, "h2nav: 2 wrong, see messages")],
)
def test_it_says_what_h2nav_says(tmp_path, value, expected):
    lines, _ = said(tmp_path, [(1000, False, [message(value)])])
    assert lines == [expected]


@pytest.mark.parametrize(
    ("reason", "shown"),
    [
        ("compass 1 is off by 62 deg", "h2nav: compass 1 is off by 62 deg"),
        # What ArduPilot keeps of an authorization's text ends after 41 characters.
        ("x" * 60, f"h2nav: {'x' * 34}"),
    ],
)
def test_it_says_which_fault(tmp_path, reason, shown):
    hexes = [framed(outbound.arming_reason(reason)), message(-1)]
    assert said(tmp_path, [(1000, False, hexes)])[0] == [shown]
    assert len(shown) <= 41


def test_another_tunnel_is_no_reason(tmp_path):
    other = mavlink.MAVLink_tunnel_message(0, 0, 40_000, 3, [*b"abc", *bytes(125)])
    assert said(tmp_path, [(1000, False, [framed(other), message(-1)])])[0] == [
        "h2nav: 1 wrong, see messages"
    ]


def test_switched_off_is_not_silence(tmp_path):
    alive = framed(outbound.heartbeat(mavlink.MAV_STATE_ACTIVE))
    assert said(tmp_path, [(1000, False, [alive])])[0] == ["h2nav: output.arming_opinion is off"]


def test_silence_is_no_consent(tmp_path):
    turns = [(0, False, []), (1000, False, [message(1)]), (4000, False, []), (5000, False, [])]
    assert said(tmp_path, turns)[0] == [NOT_HEARD, "passes", "passes", SILENT]


def test_others_are_not_heard(tmp_path):
    others = [
        message(1, component=1),
        message(1, system=2),
        message(1, name=b"other"),
        message(1)[:20],
    ]
    assert said(tmp_path, [(1000, False, others)])[0] == [NOT_HEARD]


def test_in_flight_it_does_nothing(tmp_path):
    turns = [(1000, False, [message(1)]), (2000, True, [message(-1)]), (9000, True, [])]
    assert said(tmp_path, turns)[0] == ["passes", "passes", "passes"]


def test_without_a_free_authorization_it_says_so_and_ends(tmp_path):
    assert "no authorization is free" in said(tmp_path, [(0, False, [])], none_free=True)[1]
