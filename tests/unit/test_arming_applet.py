"""The applet for ArduPilot's scripting, run by Lua 5.3 with bindings that behave as ArduPilot's."""

import json
import subprocess

import pytest
from needs import REPOSITORY, need_program
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire import outbound

APPLET = REPOSITORY / "packaging" / "ardupilot" / "h2nav_arming.lua"
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
  init = function(_, size, ids) assert(size > 0 and ids == 1) end,
  register_rx_msgid = function(_, id) assert(id == 252); return true end,
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
        packed = outbound.arming_opinion(value)
    else:
        packed = mavlink.MAVLink_named_value_int_message(0, name, value)
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
    [(1, "passes"), (0, "h2nav knows nothing yet"), (-2, "h2nav: 2 wrong, see messages")],
)
def test_it_says_what_h2nav_says(tmp_path, value, expected):
    lines, _ = said(tmp_path, [(1000, False, [message(value)])])
    assert lines == [expected]


def test_silence_is_no_consent(tmp_path):
    turns = [(0, False, []), (1000, False, [message(1)]), (4000, False, []), (5000, False, [])]
    assert said(tmp_path, turns)[0] == ["h2nav is silent", "passes", "passes", "h2nav is silent"]


def test_others_are_not_heard(tmp_path):
    others = [
        message(1, component=1),
        message(1, system=2),
        message(1, name=b"other"),
        message(1)[:20],
    ]
    assert said(tmp_path, [(1000, False, others)])[0] == ["h2nav is silent"]


def test_in_flight_it_does_nothing(tmp_path):
    turns = [(1000, False, [message(1)]), (2000, True, [message(-1)]), (9000, True, [])]
    assert said(tmp_path, turns)[0] == ["passes", "passes", "passes"]


def test_without_a_free_authorization_it_says_so_and_ends(tmp_path):
    assert "no authorization is free" in said(tmp_path, [(0, False, [])], none_free=True)[1]
