// Figures of samples, recording, link and process: name, text, and whether it is a warning.
import { at, element } from "./elements.js";
import { bytes, fixed, span } from "./words.js";

const NO_VELOCITY_S = 3;

export function showFigures(data) {
  const rows = [
    samples(data), sent(data), refused(data), held(data), velocity(data), recording(data),
    link(data), process(data), vehicle(data),
  ];
  at("#figures dl").replaceChildren(...rows.flatMap(([name, text, isWrong]) => [
    element("dt", name), element("dd", text, isWrong ? "warn" : ""),
  ]));
}

function samples({ health, status }) {
  if (!health || !health.imu_message) return ["samples", "none", true];
  const age = status && status.age_ms !== null ? `, newest ${fixed(status.age_ms, 0)} ms old` : "";
  return ["samples", `${health.imu_message} ${fixed(health.imu_rate_hz, 0)} Hz${age}`, false];
}

function sent({ health, per_s: rates }) {
  const rate = rates.estimates_sent === null ? "" : `${fixed(rates.estimates_sent, 0)} per s, `;
  return ["attitudes sent", health ? `${rate}${health.estimates_sent} so far` : "none", false];
}

function refused({ health, refused: reasons }) {
  const count = health ? health.samples_rejected : 0;
  const why = reasons.map((each) => `${each.reason.replaceAll("_", " ")} ${each.total}`).join(", ");
  return ["refused", `${count} samples${why ? ` (${why})` : ""}`, false];
}

function held({ holding }) {
  const isAlone = holding.length === 0;
  return ["attitude aided by", isAlone ? "the gyro alone" : holding.join(", "), isAlone];
}

function velocity({ velocity: last }) {
  if (!last) return ["velocity", "none so far", false];
  if (last.age_s > NO_VELOCITY_S) return ["velocity", `none for ${span(last.age_s)}`, true];
  return ["velocity", `comes from the ${last.source}`, false];
}

function recording({ recorder, per_s: rates }) {
  if (!recorder) return ["recording", "no log", false];
  const missing = recorder.dropped_queue_full + recorder.lost_disk + recorder.rejected;
  const rate = rates.written === null ? "" : `, ${fixed(rates.written, 0)} messages per s`;
  const lost = missing ? `, ${missing} messages are missing` : "";
  return ["recording", `${bytes(recorder.file_bytes)}${rate}${lost}`, missing > 0];
}

function link({ link: counters, per_s: rates }) {
  if (!counters) return ["link", "–", false];
  const isKnown = rates.bytes_in !== null;
  const flow = isKnown ? `${bytes(rates.bytes_in)}/s in, ${bytes(rates.bytes_out)}/s out` : "up";
  const parts = [flow];
  if (counters.frames_dropped) parts.push(`${counters.frames_dropped} frames dropped`);
  if (counters.opened > 1) parts.push(`opened ${counters.opened} times`);
  return ["link", parts.join(", "), false];
}

function process({ daemon, per_s: rates }) {
  if (!daemon) return ["processor", "–", false];
  const share = rates.cpu_s === null ? "" : `${fixed(100 * rates.cpu_s, 0)} % of a core, `;
  return ["processor", `${share}${bytes(daemon.memory_bytes)} of memory`, false];
}

function vehicle({ health, status }) {
  const name = (status && status.vehicle) || (health && health.autopilot) || "none";
  const armed = health && health.armed ? ", armed" : "";
  const mixed = health && !health.independent ? ", not independent of its estimator" : "";
  return ["vehicle", `${name}${armed}${mixed}`, false];
}
