// Draws what `events` sends: attitudes ten times a second, an overview twice a second, texts when
// they are new.
import { at, element } from "./elements.js";
import { showFigures } from "./figures.js";
import { Horizon } from "./horizon.js";
import { Strip } from "./strip.js";
import { ago, degrees, fixed, span } from "./words.js";

const STATES = {
  no_link: ["No link", "The link to the autopilot is down."],
  no_autopilot: ["No autopilot", "No autopilot sends heartbeats on the link."],
  no_imu: ["No samples", "The autopilot sends no usable IMU samples."],
  aligning: ["Aligning", "The first attitude is being determined."],
  active: ["Active", "The attitude is estimated and sent."],
  degraded: ["Degraded", "The attitude that is sent cannot be trusted."],
};
const TESTS = {
  velocity_ratio: "velocity",
  force_ratio: "gravity",
  field_ratio: "compass",
  turn_ratio: "gyro",
};
const AWAY_MS = 2000;
const SILENT_S = 2;
const OLD_S = 1.5;

const ours = new Horizon(at("#ours"));
const theirs = new Horizon(at("#theirs"));
const strips = [new Strip("tilt"), new Strip("heading")];
let heard_ms = -Infinity;
let silent_s = 0;
let latest = null;
let overview = null;
let told = { findings: [], lines: [], heard_ms: 0 };

function showAttitudes(data) {
  latest = data;
  silent_s = data.silent_s;
  const mine = data.h2nav;
  const sigmas = mine ? sigmaTexts(mine) : [];
  ours.show(mine, sigmas, mine && mine.age_s < OLD_S ? "" : "no estimate");
  const other = data.autopilot;
  theirs.show(other, [], other && other.age_s < OLD_S ? "" : "no data");
  const message = other?.source === "AHRS2" ? "AHRS2" : "ATTITUDE";
  at("#theirs .source").textContent = other ? `(${message})` : "";
}

function sigmaTexts(mine) {
  const tilt = mine.sigma_tilt_deg === null ? "" : `± ${degrees(mine.sigma_tilt_deg)}`;
  const heading = mine.sigma_heading_deg === null ? "" : `± ${degrees(mine.sigma_heading_deg)}`;
  return [tilt, tilt, mine.has_north ? heading : "no north yet"];
}

function showState() {
  const header = at("#state");
  const away_ms = performance.now() - heard_ms;
  let state = overview?.status?.state ?? overview?.health?.state ?? "waiting";
  let [word, sentence] = STATES[state] ?? ["Waiting", "No data from h2nav yet."];
  const reason = overview?.status?.reason ?? overview?.health?.reason ?? "";
  if (away_ms > AWAY_MS) {
    [state, word, sentence] = ["away", "No connection", "h2nav has not answered yet."];
    if (Number.isFinite(away_ms)) {
      sentence = `h2nav has not answered for ${span(away_ms / 1e3)}; what is shown is old.`;
    }
  } else if (silent_s > SILENT_S) {
    sentence = `h2nav has said nothing for ${span(silent_s)}; what is shown is old.`;
    [state, word] = ["silent", "Silent"];
  } else if (reason) {
    sentence = state === "degraded" ? `${sentence} Cause: ${reason}.` : `${sentence} (${reason})`;
  }
  const isOld = state === "away" || state === "silent";
  document.body.classList.toggle("old", isOld);
  setText(at("#word"), word);
  setText(at("#sentence"), sentence);
  const alarms = isOld || !overview ? [] : troubles(overview, reason);
  header.dataset.state = state;
  header.classList.toggle("wrong", alarms.length > 0);
  const shown = [...at("#alarms").children].map((item) => item.textContent);
  if (shown.join("\n") !== alarms.join("\n")) {
    at("#alarms").replaceChildren(...alarms.map((text) => element("li", text)));
  }
  document.title = `${word} · h2nav`;
}

// Faults other than the cause of the state, which is already shown.
function troubles({ alarms, preflight = [] }, reason) {
  const onGround = preflight.map((text) => `before arming: ${text}`);
  return [...alarms.filter((text) => !reason.includes(text)), ...onGround];
}

// An unchanged text is not set again: a screen reader would read it again.
function setText(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

function showOverview(data) {
  overview = data;
  const now_s = performance.now() / 1e3;
  for (const strip of strips) strip.add(latest ? latest.difference : null, now_s);
  setText(at("#version"), `h2nav ${data.version}`);
  showRatios(data.status);
  showTold();
  showLanes(data.lanes);
  showFigures(data);
}

function showRatios(status) {
  const rows = Object.entries(TESTS).flatMap(([field, name]) => {
    const ratio = status ? status[field] : null;
    const cell = document.createElement("dd");
    const meter = document.createElement("meter");
    Object.assign(meter, { min: 0, max: 2, low: 0.5, high: 1, optimum: 0, value: ratio ?? 0 });
    meter.setAttribute("aria-label", name);
    cell.append(meter, element("span", fixed(ratio, 2), ratio >= 1 ? "warn" : ""));
    return [element("dt", name), cell];
  });
  at("#ratios").replaceChildren(...rows);
}

// Both with their present ages.
function showTold() {
  const since_s = (performance.now() - told.heard_ms) / 1e3;
  showFindings(told.findings, since_s);
  showLines(told.lines, since_s);
}

function showFindings(findings, since_s) {
  const items = findings.map((finding) => {
    const item = element("li", "", finding.severity);
    item.classList.toggle("open", finding.is_open);
    const isNamed = finding.text.startsWith(finding.source);
    const began = `began ${ago(finding.age_s + since_s)}`;
    const ended = `${began}, lasted ${span(finding.to_s - finding.from_s)}`;
    item.append(
      element("b", isNamed ? finding.text : `${finding.source}: ${finding.text}`),
      element("span", finding.evidence),
      element("small", finding.is_open ? `now; ${began}` : ended),
    );
    return item;
  });
  if (!items.length) items.push(element("li", "No findings so far."));
  at("#findings ol").replaceChildren(...items);
}

function showLines(lines, since_s) {
  const items = lines.map((line) => {
    const item = element("li", "", line.level);
    item.append(element("small", ago(line.age_s + since_s)), element("span", line.text));
    return item;
  });
  at("#lines ol").replaceChildren(...items);
}

function showLanes(lanes) {
  at("#lanes").hidden = lanes.length < 2;
  const rows = lanes.map((lane) => {
    const row = element("tr", "", lane.sent ? "sent" : "");
    const cells = [
      `${lane.imu}${lane.sent ? " (sent)" : ""}`, lane.message, `${fixed(lane.rate_hz, 0)} Hz`,
      lane.ratio === null ? "bad" : fixed(lane.ratio, 2), fixed(lane.field_ratio, 2),
      degrees(lane.tilt_apart_deg), degrees(lane.heading_apart_deg),
    ];
    row.append(...cells.map((cell) => element("td", cell)));
    return row;
  });
  at("#lanes tbody").replaceChildren(...rows);
}

let source = null;
let opened_ms = 0;

function listen() {
  opened_ms = performance.now();
  source = new EventSource("events");
  const listen = (name, show) => source.addEventListener(name, (event) => {
    heard_ms = performance.now();
    show(JSON.parse(event.data));
    showState();
  });
  listen("attitudes", showAttitudes);
  listen("overview", showOverview);
  listen("told", (data) => {
    told = { ...data, heard_ms };
    showTold();
  });
}

listen();
// A refused stream does not reconnect by itself; one whose peer vanished may hang.
setInterval(() => {
  showState();
  const isStuck = performance.now() - Math.max(heard_ms, opened_ms) > 5 * AWAY_MS;
  const { readyState } = source;
  if (readyState === EventSource.CLOSED || (isStuck && readyState === EventSource.OPEN)) {
    source.close();
    listen();
  }
}, 500);
