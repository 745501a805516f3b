-- Second opinion before arming: refuses to arm while h2nav says that something is wrong.
--
-- h2nav sends NAMED_VALUE_INT "h2_arm" once a second (output.arming_opinion: true):
--   1  nothing is wrong with what could be judged,
--   0  nothing is known yet,
--  -n  n things are wrong; STATUSTEXT says which.
-- The applet is one of ArduPilot's auxiliary authorizations. It can only keep a vehicle from being
-- armed, as any pre-arm check can; it never disarms, and it does nothing once the vehicle is armed.
-- While h2nav is silent it refuses as well: remove the file to fly without a companion.
--
-- Needs SCR_ENABLE 1 and ArduPilot 4.5 or newer. What it does not promise: docs/preflight.md.

local NAME = "h2_arm"
local COMPONENT = 191            -- output.component_id of h2nav
local SILENT_MS = 3500
local PERIOD_MS = 200
local NAMED_VALUE_INT = 252
local QUEUE = 10

local auth_id = arming:get_aux_auth_id()
local heard_ms = nil
local opinion = 0

-- A message as ArduPilot hands it to scripts: checksum (2 bytes), magic, length, two flag bytes,
-- sequence, system, component, id (3 bytes), payload.
local function decode(message)
  if #message < 12 then
    return nil
  end
  local _, _, _, _, system, component, id = string.unpack("<BBBBxBBI3", message, 3)
  if id ~= NAMED_VALUE_INT or component ~= COMPONENT then
    return nil
  end
  local own = param:get("MAV_SYSID") or param:get("SYSID_THISMAV")
  if own ~= nil and system ~= own then
    return nil
  end
  -- Zeros at the end of a payload are not sent.
  local payload = message:sub(13) .. string.rep("\0", 18)
  local _, value, name = string.unpack("<I4i4c10", payload)
  if name:match("^[^%z]*") ~= NAME then
    return nil
  end
  return value
end

local function receive()
  for _ = 1, QUEUE do
    local message = mavlink:receive_chan()
    if message == nil then
      return
    end
    local value = decode(message)
    if value ~= nil then
      heard_ms = millis()
      opinion = value
    end
  end
end

local function judge()
  if heard_ms == nil or (millis() - heard_ms) > SILENT_MS then
    arming:set_aux_auth_failed(auth_id, "h2nav is silent")
  elseif opinion > 0 then
    arming:set_aux_auth_passed(auth_id)
  elseif opinion == 0 then
    arming:set_aux_auth_failed(auth_id, "h2nav knows nothing yet")
  else
    arming:set_aux_auth_failed(auth_id, string.format("h2nav: %d wrong, see messages", -opinion))
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
mavlink:init(QUEUE, 1)
mavlink:register_rx_msgid(NAMED_VALUE_INT)
return update()
