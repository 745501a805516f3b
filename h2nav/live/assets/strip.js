import { at, element, make } from "./elements.js";
import { degrees, signed } from "./words.js";

const SHOWN_S = 120;
const LIMIT = 3; // deviations
const LONGEST_GAP_S = 2;

// Points without a gap between them: gaps in the data are not drawn.
function runs(points) {
  const found = [];
  let last_s = -Infinity;
  for (const point of points) {
    if (point.t_s - last_s > LONGEST_GAP_S) found.push([]);
    found.at(-1).push(point);
    last_s = point.t_s;
  }
  return found;
}

// The difference of the last two minutes, with its expected band.
export class Strip {
  constructor(part) {
    this.part = part;
    this.box = at(`#${part}`);
    this.points = [];
    const chart = this.box.querySelector(".chart");
    const view = { preserveAspectRatio: "none", viewBox: `0 0 ${SHOWN_S} 100` };
    this.picture = make("svg", view, chart);
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
    const shown = this.part === "tilt" ? degrees : signed; // a tilt has no sign
    this.box.querySelector("output").textContent = shown(value);
    let words = "no attitude to compare with";
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
    // The band may be much wider than any difference; at its narrowest it is fully visible.
    const narrowest = sure.length ? LIMIT * Math.min(...sure.map((point) => point.sigma)) : 0;
    const top = 1.15 * Math.max(1, narrowest, ...known.map((point) => Math.abs(point.value)));
    const low = this.part === "tilt" ? 0 : -top;
    const x = (point) => (SHOWN_S - (now_s - point.t_s)).toFixed(1);
    const y = (value) => ((100 * (top - value)) / (top - low)).toFixed(1);
    const edge = (sign) => (point) =>
      `${x(point)} ${y(Math.min(top, Math.max(low, sign * LIMIT * point.sigma)))}`;
    const line = (run) => `M${run.map((point) => `${x(point)} ${y(point.value)}`).join("L")}`;
    const area = (run) => `M${[...run.map(edge(1)), ...run.map(edge(-1)).reverse()].join("L")}Z`;
    this.curve.setAttribute("d", runs(known).map(line).join(""));
    this.band.setAttribute("d", runs(sure).map(area).join(""));
    this.zero.setAttribute("y1", y(0));
    this.zero.setAttribute("y2", y(0));
    this.legend.replaceChildren(
      element("span", "2 min ago"),
      element("span", `${degrees(low, 0)} to ${degrees(top, 0)}`),
      element("span", "now"),
    );
  }
}
