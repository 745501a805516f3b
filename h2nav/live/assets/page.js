"use strict";
// Draws what `events` sends: attitudes ten times a second, an overview twice a second. Whatever came
// from an autopilot is set as text, never as markup.

const STATES = {
  no_link: ["No link", "The link to the autopilot is down."],
  no_autopilot: ["No autopilot", "No autopilot is heard on the link."],
  no_imu: ["No samples", "No inertial samples come from the autopilot."],
  aligning: ["Aligning", "The first attitude is being found."],
  active: ["Active", "The attitude is estimated and sent."],
  degraded: ["Degraded", "The attitude that is sent cannot be trusted at present."],
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
const NO_VELOCITY_S = 3;
const SHOWN_S = 120;
const LIMIT = 3; // deviations
const PITCH = 2.2; // units of the picture per degree
const TAPE = 1.5;

const at = (selector) => document.querySelector(selector);

function make(tag, attributes, parent, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}

function element(tag, text, className = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  made.className = className;
  return made;
}

function fixed(value, digits) {
  if (value === null || value === undefined) return "–";
  const text = value.toFixed(digits);
  return text.replace("-", Number(text) === 0 ? "" : "−");
}

const degrees = (value, digits = 1) => `${fixed(value, digits)}°`;
const signed = (value) => (value > 0 ? "+" : "") + degrees(value);

function span(seconds) {
  if (seconds < 60) return `${Math.floor(seconds)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.floor(seconds % 60)} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

const ago = (seconds) => (seconds < 1 ? "now" : `${span(seconds)} ago`);

function bytes(count) {
  if (count < 1e3) return `${count.toFixed(0)} B`;
  return count < 1e6 ? `${(count / 1e3).toFixed(1)} kB` : `${(count / 1e6).toFixed(1)} MB`;
}

class Horizon {
  constructor(figure) {
    this.figure = figure;
    this.picture = make("svg", { viewBox: "-100 -100 200 212", role: "img" }, at(`#${figure.id} .horizon`));
    const clip = `${figure.id}-round`;
    make("circle", { r: 92 }, make("clipPath", { id: clip }, this.picture));
    const round = make("g", { "clip-path": `url(#${clip})` }, this.picture);
    this.ball = make("g", { class: "ball" }, round);
    this.drawBall();
    this.turned = make("g", {}, round);
    make("path", { class: "pointer", d: "M0-80l5 9h-10z" }, this.turned);
    this.drawScale();
    make("path", { class: "plane", d: "M-52 0h26l8 9m36 0l8-9h26" }, this.picture);
    make("circle", { class: "dot", r: 3 }, this.picture);
    make("circle", { class: "rim", r: 92 }, this.picture);
    this.drawTape();
    this.angles = ["roll", "pitch", "heading"].map((name) => {
      const cell = document.createElement("div");
      const value = element("dd", "–");
      cell.append(element("dt", name), value);
      figure.querySelector(".angles").append(cell);
      return value;
    });
  }

  drawBall() {
    const wide = { x: -400, width: 800, height: 400 };
    make("rect", { ...wide, y: -400, class: "sky" }, this.ball);
    make("rect", { ...wide, y: 0, class: "earth" }, this.ball);
    const marks = make("g", { class: "marks" }, this.ball);
    for (let angle = -80; angle <= 80; angle += 10) {
      const half = angle % 20 ? 10 : 22;
      const y = -angle * PITCH;
      const kind = angle ? "ladder" : "edge";
      make("line", { class: kind, x1: angle ? -half : -400, x2: angle ? half : 400, y1: y, y2: y }, this.ball);
      if (angle && angle % 20 === 0) {
        for (const x of [-32, 32]) make("text", { x, y: y + 3 }, marks, String(Math.abs(angle)));
      }
    }
  }

  drawScale() {
    for (const angle of [-60, -45, -30, -20, -10, 0, 10, 20, 30, 45, 60]) {
      const end = angle % 30 ? -87 : -90;
      make("line", { class: "scale", y1: -82, y2: end, transform: `rotate(${angle})` }, this.picture);
    }
  }

  drawTape() {
    const clip = `${this.figure.id}-tape`;
    make("rect", { x: -75, y: 90, width: 150, height: 21 }, make("clipPath", { id: clip }, this.picture));
    const window = make("g", { "clip-path": `url(#${clip})` }, this.picture);
    make("rect", { class: "box", x: -75, y: 90, width: 150, height: 21 }, window);
    this.tape = make("g", { class: "tape" }, window);
    const names = { 0: "N", 90: "E", 180: "S", 270: "W" };
    for (let angle = -60; angle <= 420; angle += 10) {
      const x = angle * TAPE;
      const around = (angle + 360) % 360;
      make("line", { x1: x, x2: x, y1: 91, y2: angle % 30 ? 94 : 97 }, this.tape);
      if (angle % 30 === 0) make("text", { x, y: 107 }, this.tape, names[around] ?? String(around));
    }
    make("path", { class: "index", d: "M-5 90h10l-5 7z" }, this.picture);
  }

  // Shows an attitude; `absent` says why there is none.
  show(attitude, sigmas, absent) {
    this.figure.classList.toggle("absent", absent !== "");
    this.figure.dataset.absent = absent;
    if (!attitude) return;
    const { roll_deg: roll, pitch_deg: pitch, heading_deg: heading } = attitude;
    this.ball.setAttribute("transform", `rotate(${-roll}) translate(0 ${pitch * PITCH})`);
    this.turned.setAttribute("transform", `rotate(${-roll})`);
    this.tape.setAttribute("transform", `translate(${-heading * TAPE} 0)`);
    const values = [signed(roll), signed(pitch), degrees(heading)];
    this.angles.forEach((cell, place) => {
      cell.textContent = values[place];
      if (sigmas[place]) cell.append(element("small", sigmas[place]));
    });
    this.picture.setAttribute("aria-label", `roll ${values[0]}, pitch ${values[1]}, heading ${values[2]}`);
  }
}

// The difference of the last two minutes, in the band that is expected.
class Strip {
  constructor(part) {
    this.part = part;
    this.box = at(`#${part}`);
    this.points = [];
    const chart = this.box.querySelector(".chart");
    this.picture = make("svg", { preserveAspectRatio: "none", viewBox: `0 0 ${SHOWN_S} 100` }, chart);
    this.band = make("path", { class: "band" }, this.picture);
    this.zero = make("line", { class: "zero", x2: SHOWN_S }, this.picture);
    this.curve = make("path", { class: "curve" }, this.picture);
    make("rect", { class: "frame", width: SHOWN_S, height: 100 }, this.picture);
    this.legend = document.createElement("small");
    chart.append(this.legend);
  }

  add(difference, t_s) {
    const value = difference ? difference[`${this.part}_deg`] : null;
    const sigma = difference ? difference[`sigma_${this.part}_deg`] : null;
    this.points.push({ t_s, value, sigma });
    this.points = this.points.filter((point) => t_s - point.t_s <= SHOWN_S);
    this.say(difference, value, sigma);
    this.draw(t_s);
  }

  say(difference, value, sigma) {
    const isBeyond = value !== null && sigma !== null && Math.abs(value) > LIMIT * sigma;
    this.box.classList.toggle("beyond", isBeyond);
    this.box.querySelector("output").textContent = value === null ? "–" : this.part === "tilt" ? degrees(value) : signed(value);
    let words = "nothing to compare with just now";
    if (value !== null) {
      words = sigma === null ? "no deviation is known" : `one deviation is ${degrees(sigma)}: `;
      if (sigma !== null) words += isBeyond ? "beyond what is expected" : "within what is expected";
      const verdict = difference[`${this.part}_verdict`];
      if (verdict === "h2nav" || verdict === "autopilot") words += `; GPS supports ${verdict}`;
    }
    this.box.querySelector("p").textContent = words;
  }

  draw(now_s) {
    const known = this.points.filter((point) => point.value !== null);
    const sure = known.filter((point) => point.sigma !== null);
    // The band may become much wider than any difference; at its narrowest it is seen whole.
    const narrowest = sure.length ? LIMIT * Math.min(...sure.map((point) => point.sigma)) : 0;
    const top = 1.15 * Math.max(1, narrowest, ...known.map((point) => Math.abs(point.value)));
    const low = this.part === "tilt" ? 0 : -top;
    const x = (point) => (SHOWN_S - (now_s - point.t_s)).toFixed(1);
    const y = (value) => ((100 * (top - value)) / (top - low)).toFixed(1);
    let curve = "";
    let pen = "M";
    for (const point of this.points) {
      if (point.value === null) pen = "M";
      else {
        curve += `${pen}${x(point)} ${y(point.value)}`;
        pen = "L";
      }
    }
    const edge = (sign) => (point) =>
      `${x(point)} ${y(Math.min(top, Math.max(low, sign * LIMIT * point.sigma)))}`;
    const above = sure.map(edge(1));
    const below = sure.map(edge(-1)).reverse();
    this.curve.setAttribute("d", curve);
    this.band.setAttribute("d", sure.length ? `M${[...above, ...below].join("L")}Z` : "");
    this.zero.setAttribute("y1", y(0));
    this.zero.setAttribute("y2", y(0));
    this.legend.replaceChildren(
      element("span", "2 min ago"), element("span", `${degrees(low, 0)} to ${degrees(top, 0)}`), element("span", "now"),
    );
  }
}

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
  theirs.show(other, [], other && other.age_s < OLD_S ? "" : "not told");
  at("#theirs .source").textContent = other ? `(${other.source === "AHRS2" ? "AHRS2" : "ATTITUDE"})` : "";
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
  let [word, sentence] = STATES[state] ?? ["Waiting", "Nothing has come from h2nav yet."];
  const reason = overview?.status?.reason ?? overview?.health?.reason ?? "";
  if (away_ms > AWAY_MS) {
    const since = Number.isFinite(away_ms) ? ` for ${span(away_ms / 1e3)}; what is shown is old` : "";
    [state, word, sentence] = ["away", "No connection", `h2nav has not answered${since}.`];
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

// What is wrong besides the cause of the state, which is not said twice.
function troubles({ alarms, velocity: last, holding }, reason) {
  const told = alarms.filter((text) => !reason.includes(text));
  if (last && last.age_s > NO_VELOCITY_S) {
    const held = holding.length ? `held by ${holding.join(" and ")}` : "the gyro's alone";
    told.push(`no velocity of the ${last.source} for ${span(last.age_s)}; the attitude is ${held}`);
  }
  return told;
}

// A text that stays is not set again: a screen reader would read it again.
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
    cell.append(meter, element("span", ratio === null ? "–" : fixed(ratio, 2), ratio >= 1 ? "warn" : ""));
    return [element("dt", name), cell];
  });
  at("#ratios").replaceChildren(...rows);
}

// Both with the ages that they have by now.
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
  at("#findings ol").replaceChildren(...(items.length ? items : [element("li", "Nothing is wrong so far.")]));
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

function showFigures(data) {
  const rows = [
    samples(data), sent(data), refused(data), held(data), velocity(data), recording(data), link(data),
    process(data), vehicle(data),
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
  return ["attitude held by", holding.length ? holding.join(", ") : "the gyro alone", !holding.length];
}

function velocity({ velocity: last }) {
  if (!last) return ["velocity", "none so far", false];
  const isLost = last.age_s > NO_VELOCITY_S;
  return ["velocity", isLost ? `none for ${span(last.age_s)}` : `comes from the ${last.source}`, isLost];
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
  const parts = isKnown ? [`${bytes(rates.bytes_in)}/s in, ${bytes(rates.bytes_out)}/s out`] : ["up"];
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

let source = null;
let opened_ms = 0;

function listen() {
  opened_ms = performance.now();
  source = new EventSource("events");
  const heed = (name, show) => source.addEventListener(name, (event) => {
    heard_ms = performance.now();
    show(JSON.parse(event.data));
    showState();
  });
  heed("attitudes", showAttitudes);
  heed("overview", showOverview);
  heed("told", (data) => {
    told = { ...data, heard_ms };
    showTold();
  });
}

listen();
// A stream that was refused is not tried again by itself, and one whose other end vanished may hang.
setInterval(() => {
  showState();
  const isStuck = performance.now() - Math.max(heard_ms, opened_ms) > 5 * AWAY_MS;
  if (source.readyState === EventSource.CLOSED || (isStuck && source.readyState === EventSource.OPEN)) {
    source.close();
    listen();
  }
}, 500);
