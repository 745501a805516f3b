-- Second opinion before arming: refuses to arm while h2nav says that something is wrong.
--
-- h2nav sends NAMED_VALUE_INT "h2_arm" once a second (output.arming_opinion: true):
--   1  nothing is wrong with what could be judged,
--   0  nothing is known yet,
--  -n  n things are wrong,
-- and before it, unless it is 1, a TUNNEL message that says what.
-- The applet is one of ArduPilot's auxiliary authorizations. It can only keep a vehicle from being
-- armed, as any pre-arm check can; it never disarms, and it does nothing once the vehicle is armed.
-- While h2nav is silent it refuses as well: remove the file to fly without a companion.
--
-- Needs SCR_ENABLE 1 and ArduPilot 4.5 or newer. What it does not promise: docs/preflight.md.

local NAME = "h2_arm"
local COMPONENT = 191            -- output.component_id of h2nav
local SILENT_MS = 3500
local PERIOD_MS = 200
local HEARTBEAT = 0
local NAMED_VALUE_INT = 252
local TUNNEL = 385
local REASON_TYPE = 0xE832
local REASON_SIZE = 34           -- ArduPilot shows 41 characters
local QUEUE = 20

local auth_id = arming:get_aux_auth_id()
local heard_ms = nil             -- its opinion
local alive_ms = nil             -- its heartbeat
local opinion = 0
local reason = ""

-- Text of a TUNNEL: type, two targets, length, bytes.
local function reason_in(payload)
  local kind, _, _, length = string.unpack("<I2BBB", payload)
  if kind ~= REASON_TYPE then
    return reason
  end
  return payload:sub(6, 5 + math.min(length, REASON_SIZE))
end

-- A message as ArduPilot hands it to scripts: checksum (2 bytes), magic, length, two flag bytes,
-- sequence, system, component, id (3 bytes), payload.
local function take(message)
  if #message < 12 then
    return
  end
  local _, _, _, _, system, component, id = string.unpack("<BBBBxBBI3", message, 3)
  if component ~= COMPONENT then
    return
  end
  local own = param:get("MAV_SYSID") or param:get("SYSID_THISMAV")
  if own ~= nil and system ~= own then
    return
  end
  -- Zeros at the end of a payload are not sent.
  local payload = message:sub(13) .. string.rep("\0", 18)
  if id == HEARTBEAT then
    alive_ms = millis()
  elseif id == TUNNEL then
    reason = reason_in(payload)
  elseif id == NAMED_VALUE_INT then
    local _, value, name = string.unpack("<I4i4c10", payload)
    if name:match("^[^%z]*") == NAME then
      heard_ms, opinion = millis(), value
    end
  end
end

local function receive()
  for _ = 1, QUEUE do
    local message = mavlink:receive_chan()
    if message == nil then
      return
    end
    take(message)
  end
end

local function is_recent(ms)
  return ms ~= nil and (millis() - ms) <= SILENT_MS
end

-- Why arming is refused; nil if it is not.
local function refusal()
  if not is_recent(heard_ms) then
    if is_recent(alive_ms) then
      return "output.arming_opinion is off"
    end
    return heard_ms == nil and "not heard since the start" or "it has fallen silent"
  elseif opinion > 0 then
    return nil
  elseif reason ~= "" then
    return reason
  end
  return opinion == 0 and "knows nothing yet" or string.format("%d wrong, see messages", -opinion)
end

local function judge()
  local text = refusal()
  if text == nil then
    arming:set_aux_auth_passed(auth_id)
  else
    arming:set_aux_auth_failed(auth_id, "h2nav: " .. text)
  end
end

function update()
  receive()
  if not arming:is_armed() then
    judge()
  end
  return update, PERIOD_MS
end

if auth_id == nil then
  gcs:send_text(4, "h2nav_arming: no authorization is free")
  return
end
mavlink:init(QUEUE, 3)
mavlink:register_rx_msgid(HEARTBEAT)
mavlink:register_rx_msgid(NAMED_VALUE_INT)
mavlink:register_rx_msgid(TUNNEL)
return update()
