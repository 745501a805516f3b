// Draws the pictures of a review with uPlot, on a shared time axis.
(() => {
"use strict";
const review = JSON.parse(document.getElementById("review").textContent);
const END = review.duration_s;
const scheme = matchMedia("(prefers-color-scheme: dark)");
let isPrinted = false; // paper is light
const isDark = () => scheme.matches && !isPrinted;
const painted = (colour) => isDark() ? review.dark[colour] ?? colour : colour;
const ink = {}; // the page's own colours, by the name of the variable
function inked() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["text", "soft", "grid", "found", "shade", "paper"])
    ink[name] = style.getPropertyValue(`--${name}`).trim();
}
const DASHES = {dashed: [6, 4], dotted: [2, 3]};
const shown = {from: 0, to: END};
let selected = null; // span of the finding that was clicked
const timed = [], all = [];

const bytes = (text) => Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
const floats = (text) => new Float32Array(bytes(text).buffer);
// uPlot takes null, not NaN, for missing values.
const known = (values) => values.some(Number.isNaN)
  ? Array.from(values, (value) => Number.isNaN(value) ? null : value) : values;
const decoded = (text) => known(floats(text));
const isNarrow = () => window.innerWidth < 600;

const grids = new Map();
function times(points, [from, to] = [0, END]) {
  const key = `${points} ${from} ${to}`;
  if (!grids.has(key)) {
    const step = (to - from) / points;
    grids.set(key, Float64Array.from({length: points}, (_, k) => from + (k + 0.5) * step));
  }
  return grids.get(key);
}

// --- time axis ----------------------------------------------------------------------------------
function show(from, to) {
  const least = Math.min(0.2, END);
  const width = Math.min(Math.max(to - from, least), END);
  shown.from = Math.min(Math.max(from, 0), END - width);
  shown.to = shown.from + width;
  for (const plot of timed) plot.setScale("x", {min: shown.from, max: shown.to});
  tell();
}

function tell() {
  const digits = shown.to - shown.from < 20 ? 1 : 0;
  document.getElementById("shown").textContent =
    `${shown.from.toFixed(digits)} to ${shown.to.toFixed(digits)} s`;
  for (const part of document.querySelectorAll("[data-track]")) {
    const isOut = Number(part.dataset.to) < shown.from || Number(part.dataset.from) > shown.to;
    part.classList.toggle("out", isOut);
  }
}

function followed(plot, key) {
  if (key !== "x") return;
  const {min, max} = plot.scales.x;
  if (Math.abs(min - shown.from) + Math.abs(max - shown.to) > 1e-6) show(min, max);
}

// --- our own drawing -----------------------------------------------------------------------------
function inside(plot, draw) {
  const {ctx, bbox} = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.textAlign = "left";
  draw(ctx, bbox, uPlot.pxRatio, (t) => plot.valToPos(t, "x", true));
  ctx.restore();
}

// Text in a bar, cut to the available width.
function written(ctx, text, left, right, middle, ratio) {
  const room = right - left - 6 * ratio;
  if (room < 14 * ratio) return;
  let fits = text;
  while (fits && ctx.measureText(fits).width > room) fits = fits.slice(0, -1);
  if (fits.length > 2 || fits === text) ctx.fillText(fits, left + 3 * ratio, middle);
}

function eachMode(plot, draw) {
  inside(plot, (ctx, box, ratio, x) => {
    for (const [from, to, name, colour] of review.modes) {
      const left = Math.max(x(from), box.left), right = Math.min(x(to), box.left + box.width);
      if (right > left) draw(ctx, box, ratio, {left, right, name, colour});
    }
  });
}

function backdrop(plot) {
  eachMode(plot, (ctx, box, _, {left, right, colour}) => {
    ctx.fillStyle = painted(colour);
    ctx.fillRect(left, box.top, right - left, box.height);
  });
}

function modeNames(plot) {
  eachMode(plot, (ctx, box, ratio, {left, right, name}) => {
    ctx.font = `${11 * ratio}px sans-serif`;
    ctx.textBaseline = "top";
    ctx.fillStyle = ink.soft;
    written(ctx, name, left, right, box.top + 2 * ratio, ratio);
  });
}

function chosen(plot) {
  if (!selected) return;
  inside(plot, (ctx, box, ratio, x) => {
    const left = x(selected[0]), width = Math.max(x(selected[1]) - left, 2 * ratio);
    ctx.fillStyle = ink.shade;
    ctx.fillRect(left, box.top, width, box.height);
    ctx.strokeStyle = ink.found;
    ctx.setLineDash([]);
    ctx.lineWidth = ratio;
    ctx.strokeRect(left, box.top - ratio, width, box.height + 2 * ratio);
  });
}

// Moments: lines through every picture over time, with their names in the picture of an event.
function moments(isNamed) {
  return (plot) => inside(plot, (ctx, box, ratio, x) => {
    ctx.font = `${11 * ratio}px sans-serif`;
    ctx.textBaseline = "bottom";
    const ends = [];  // of the names on each line
    for (const [t, text, colour] of review.marks) {
      const at = x(t);
      if (at < box.left - 1 || at > box.left + box.width + 1) continue;
      ctx.strokeStyle = ctx.fillStyle = painted(colour);
      ctx.setLineDash(colour === review.impact ? [] : [2 * ratio, 3 * ratio]);
      ctx.lineWidth = (colour === review.impact ? 2 : 1) * ratio;
      ctx.beginPath();
      ctx.moveTo(at, box.top);
      ctx.lineTo(at, box.top + box.height);
      ctx.stroke();
      if (!isNamed) continue;
      const width = ctx.measureText(text).width + 8 * ratio;
      const left = Math.min(at + 4 * ratio, box.left + box.width - width);
      const found = ends.findIndex((end) => end <= left);
      const line = found < 0 ? ends.length : found;
      ends[line] = left + width;
      ctx.fillText(text, left, box.top + box.height - (3 + 13 * line) * ratio);
    }
  });
}

function marked(marks, scale) {
  return (plot) => inside(plot, (ctx, box, ratio) => {
    ctx.strokeStyle = ctx.fillStyle = ink.text;
    ctx.setLineDash([5 * ratio, 4 * ratio]);
    ctx.lineWidth = ratio;
    ctx.font = `${11 * ratio}px sans-serif`;
    for (const [value, text] of marks) {
      const at = plot.valToPos(value, scale, true);
      ctx.beginPath();
      if (scale === "y") {
        ctx.moveTo(box.left, at);
        ctx.lineTo(box.left + box.width, at);
        ctx.stroke();
        ctx.textAlign = "right";
        const isHigh = at - box.top < 16 * ratio;
        ctx.textBaseline = isHigh ? "top" : "bottom";
        ctx.fillText(text, box.left + box.width - 4 * ratio, at + (isHigh ? 2 : -2) * ratio);
      } else {
        ctx.moveTo(at, box.top);
        ctx.lineTo(at, box.top + box.height);
        ctx.stroke();
        ctx.textAlign = "left";
        ctx.textBaseline = "top";
        ctx.fillText(text, at + 3 * ratio, box.top + 2 * ratio);
      }
    }
  });
}

// --- kinds of pictures --------------------------------------------------------------------------
function axes(x_text, y_text, digits, more = {}, hasTime = true) {
  const text = () => ink.text, line = {stroke: () => ink.grid, width: 1};
  const plain = {stroke: text, grid: line, ticks: line,
    font: "12px sans-serif", labelFont: "12px sans-serif"};
  return [
    {...plain, size: hasTime ? 32 : 6, space: isNarrow() ? 60 : 80,
      values: !hasTime ? (_, ticks) => ticks.map(() => "") : (_, ticks) => ticks.map((tick) => `${+tick.toFixed(3)} ${x_text}`)},
    {...plain, size: isNarrow() ? 50 : 66, label: y_text, labelSize: 16, labelGap: 0,
      values: (_, ticks) => ticks.map((tick) => tick === null ? "" : `${+tick.toPrecision(6)}`),
      ...more},
  ];
}

function reach(picture) {
  return (plot, min, max) => {
    let low = min ?? 0, high = max ?? 1;
    if (picture.at_least) [low, high] = [Math.min(low, picture.at_least[0]), Math.max(high, picture.at_least[1])];
    const size = Math.max(Math.abs(low), Math.abs(high));
    for (const [value] of picture.limits)
      if (Math.abs(value) <= 4 * size) [low, high] = [Math.min(low, value), Math.max(high, value)];
    const room = 0.06 * (high - low) || 0.5 * 10 ** -picture.digits;
    return [low === 0 && picture.at_least ? 0 : low - room, high + room];
  };
}

const around = (degrees) => (degrees % 360 + 360) % 360;

function series(traces, unit, digits, sparse, told = (value) => value) {
  const made = [], data = [], bands = [];
  for (const trace of traces) {
    const at = made.length + 1;
    made.push({
      label: trace.label, stroke: () => painted(trace.colour), width: trace.dash ? 1.6 : 1.3, auto: trace.sets_range,
      dash: DASHES[trace.dash], tag: trace.tag, points: {show: sparse, size: 5},
      value: (_, value, __, at) => at === null || at === undefined ? "" :
        value === null || value === undefined ? "–" : `${told(value).toFixed(digits)} ${unit}`,
    });
    data.push(decoded(trace.values));
    if (!trace.low) continue;
    for (const edge of [trace.high, trace.low]) {
      made.push({label: "", stroke: "transparent", width: 0, class: "edge", auto: false,
        points: {show: false}, of: at});
      data.push(decoded(edge));
    }
    bands.push({series: [at + 1, at + 2], fill: () => `${painted(trace.colour)}${isDark() ? "40" : "26"}`});
  }
  return {made, data, bands};
}

// The edges of a band are shown with its line.
function edges(plot, at, change) {
  if (change.show === undefined) return;
  plot.series.forEach((one, k) => {
    if (one.of === at && one.show !== change.show) plot.setSeries(k, {show: change.show});
  });
}

// The legend shows values under the pointer, and only names elsewhere.
function pointed(plot) {
  plot.root.classList.toggle("pointed", plot.cursor.idx !== null && plot.cursor.left >= 0);
}

// A line's name in its colour and dash.
const legend = {live: true, markers: {
  width: 3, dash: (plot, k) => plot.series[k].dash ? (plot.series[k].dash[0] < 4 ? "dotted" : "dashed") : "solid",
  fill: () => "transparent",
}};

// The tags of lines, where these are furthest apart.
function tagged(plot) {
  const tags = plot.series.map((one, k) => [one, k]).filter(([one]) => one.tag && one.show);
  if (!tags.length) return;
  inside(plot, (ctx, box, ratio, x) => {
    const [from, to] = plot.series[0].idxs;
    let best = null, widest = -1;
    for (let part = 1; part < 40; part++) {
      const at = Math.round(from + (to - from) * part / 40);
      const places = tags.filter(([, k]) => plot.data[k][at] != null)
        .map(([one, k]) => [plot.valToPos(plot.data[k][at], "y", true), one]).sort((a, b) => a[0] - b[0]);
      const gap = Math.min(14 * ratio, ...places.slice(1).map((place, k) => place[0] - places[k][0]));
      const room = places.length + gap / (14 * ratio);
      if (places.length && room > widest) [best, widest] = [{at, places}, room];
    }
    if (!best) return;
    ctx.font = `bold ${11 * ratio}px sans-serif`;
    ctx.textBaseline = "middle";
    ctx.textAlign = "center";
    ctx.lineWidth = 4 * ratio;
    ctx.setLineDash([]);
    ctx.strokeStyle = ink.paper;
    let free = box.top + 7 * ratio;
    for (const [y, one] of best.places) {
      const middle = Math.max(y, free), left = x(plot.data[0][best.at]);
      free = middle + 11 * ratio;
      ctx.strokeText(one.tag, left, middle);
      ctx.fillStyle = one.stroke(plot);
      ctx.fillText(one.tag, left, middle);
    }
  });
}

const clock = {label: "time", class: "clock", value: (_, t) => t === null || t === undefined ? "" : `${t.toFixed(1)} s`};

function onTime(options, height, window) {
  const from = window ? window[0] : shown.from, to = window ? window[1] : shown.to;
  return {
    height, legend, ...options,
    scales: {x: {time: false, range: (_, min, max) => [min, max], min: from, max: to}, ...options.scales},
    cursor: {
      sync: {key: "time", scales: ["x", null], filters: {pub: (type) => type === "mousemove" || type === "mouseleave"}},
      drag: {x: !window, y: false}, focus: {prox: -1},
      bind: {dblclick: () => () => window || show(0, END)},
    },
    hooks: {
      ...options.hooks, setScale: window ? [] : [followed], drawClear: [backdrop], setLegend: [pointed],
      draw: [...(options.hasModes === false ? [] : [modeNames]), chosen, moments(options.isNamed), tagged, ...(options.hooks?.draw ?? [])],
    },
  };
}

function lines(picture, lane) {
  const {made, data, bands} = series(picture.traces, picture.unit, picture.digits, false,
    picture.goes_round ? around : undefined);
  const points = data.length ? data[0].length : 2;
  const side = lane ? `${picture.title}, ${picture.unit}` : picture.unit;
  const height = lane ? (isNarrow() ? 120 : 128) + 26 * lane.isLast : isNarrow() ? 200 : 240;
  return [onTime({
    series: [clock, ...made], bands,
    axes: axes("s", side, picture.digits, picture.goes_round
      ? {values: (_, ticks) => ticks.map((tick) => `${+around(tick).toPrecision(6)}`), incrs: [0.1, 0.5, 1, 2, 5, 10, 15, 30, 45, 90, 180]} : {},
      !lane || lane.isLast),
    scales: {y: {range: reach(picture)}}, isNamed: lane?.isFirst, hasModes: !lane || lane.isFirst,
    hooks: {draw: [marked(picture.limits, "y")], setSeries: [edges]},
  }, height, picture.window), [times(points, picture.window ?? undefined), ...data]];
}

function curves(picture) {
  const x = floats(picture.x);
  const {made, data, bands} = series(picture.traces, picture.unit, picture.digits, x.length < 60);
  const scale = picture.is_logarithmic ? {distr: 3}
    : {range: reach({limits: [], digits: picture.digits, at_least: null})};
  return [{
    height: isNarrow() ? 220 : 260, bands, legend,
    series: [{label: picture.x_text, class: "clock", value: (_, v) => v === null || v === undefined ? "" : `${+v.toFixed(1)}`}, ...made],
    axes: axes("", picture.unit, picture.digits,
      picture.is_logarithmic ? {values: (_, t) => t.map((v) => v === null ? "" : `${+v.toPrecision(2)}`)} : {}),
    scales: {x: {time: false}, y: scale}, cursor: {drag: {x: true, y: false}},
    hooks: {draw: [marked(picture.marks, "x")], setSeries: [edges], setLegend: [pointed]},
  }, [x, ...data]];
}

// Nothing is as the page: from white over blue to black, in print as well; on a dark page to white.
const SHADES = [[255, 255, 255], [158, 202, 225], [49, 130, 189], [8, 48, 107], [10, 10, 10]];
const DARK_SHADES = [[20, 23, 28], [8, 48, 107], [49, 130, 189], [158, 202, 225], [255, 255, 255]];
function between(stops, share) {
  const place = share * (stops.length - 1), from = Math.min(Math.floor(place), stops.length - 2);
  return stops[from].map((part, k) => part + (place - from) * (stops[from + 1][k] - part));
}

function heat(picture) {
  const t = floats(picture.t_s), levels = bytes(picture.levels), rows = picture.rows;
  const canvas = document.createElement("canvas");
  canvas.width = t.length;
  canvas.height = rows;
  let isDarkNow;
  const shaded = () => {
    if (isDarkNow === isDark()) return;
    isDarkNow = isDark();
    const image = new ImageData(t.length, rows);
    const colours = Array.from({length: 256}, (_, level) => between(isDarkNow ? DARK_SHADES : SHADES, level / 255));
    for (let column = 0; column < t.length; column++)
      for (let row = 0; row < rows; row++)
        image.data.set([...colours[levels[column * rows + row]], 255], 4 * ((rows - 1 - row) * t.length + column));
    canvas.getContext("2d").putImageData(image, 0, 0);
  };
  const steps = Array.from(t.slice(1), (v, k) => v - t[k]).sort((a, b) => a - b);
  const usual = steps.length ? steps[steps.length >> 1] : END;
  const half = (k) => (k < t.length - 1 ? Math.min(t[k + 1] - t[k], 2 * usual) : usual) / 2;
  const draw = (plot) => inside(plot, (ctx, box, ratio, x) => {
    shaded();
    ctx.imageSmoothingEnabled = false;
    for (let k = 0; k < t.length; k++) {
      const left = Math.floor(x(t[k] - half(k - 1 < 0 ? k : k - 1))), right = Math.ceil(x(t[k] + half(k)));
      if (right < box.left || left > box.left + box.width) continue;
      ctx.drawImage(canvas, k, 0, 1, rows, left, box.top, Math.max(right - left, 1), box.height);
    }
  });
  const nearest = (time) => t.reduce((best, v, k) => Math.abs(v - time) < Math.abs(t[best] - time) ? k : best, 0);
  const strongest = (plot, _, __, at) => {
    if (at === null || at === undefined || !t.length) return "";
    const column = nearest(plot.data[0][at]);
    const part = levels.subarray(column * rows, (column + 1) * rows);
    const row = part.reduce((best, v, k) => v > part[best] ? k : best, 0);
    return part[row] ? `${((row + 1) / rows * picture.to_hz).toFixed(0)} Hz` : "–";
  };
  const grid = times(2000);
  const options = onTime({
    series: [clock, {label: "strongest", stroke: () => painted("#0072b2"), value: strongest}],
    axes: axes("s", "Hz", 0), scales: {y: {range: () => [0, picture.to_hz]}},
  }, isNarrow() ? 190 : 220);
  options.hooks.drawClear = [];
  options.hooks.draw = [draw, chosen];
  return [options, [grid, new Array(grid.length).fill(null)]];
}

function rows(picture, lane) {
  const step = lane ? 34 : 40, bar = lane ? 15 : 20, count = picture.rows.length;
  const draw = (plot) => inside(plot, (ctx, box, ratio, x) => {
    picture.rows.forEach(([label, spans, colours], k) => {
      const top = box.top + k * step * ratio, right = box.left + box.width;
      ctx.font = `${11 * ratio}px sans-serif`;
      ctx.textBaseline = "middle";
      ctx.fillStyle = ink.soft;
      ctx.fillText(label, box.left + 3 * ratio, top + 8 * ratio);
      spans.forEach(([from, to, name], n) => {
        const left = Math.max(x(from), box.left), end = Math.min(x(to), right);
        if (x(to) < box.left || left > right) return;
        ctx.fillStyle = painted(colours[n]);
        ctx.fillRect(left, top + 16 * ratio, Math.max(end - left, 2 * ratio), bar * ratio);
        ctx.fillStyle = ink.text;
        // A short bar's name may extend to the next bar, and at the end to the left.
        const next = Math.min(n + 1 < spans.length ? Math.max(x(spans[n + 1][0]), end) : right, right);
        const width = ctx.measureText(name).width + 6 * ratio, middle = top + (16 + bar / 2) * ratio;
        const isLast = n + 1 === spans.length && next - left < width && end - left < 20 * ratio;
        if (isLast && (n === 0 || x(spans[n - 1][1]) < left - width)) ctx.fillText(name, left - width, middle);
        else written(ctx, name, left, next, middle, ratio);
      });
    });
  });
  const named = (spans) => (plot, _, __, at) => {
    const t = at === null || at === undefined ? null : plot.data[0][at];
    // A bar without duration is hit within some pixels.
    const near = t === null ? 0 : 4 * (plot.scales.x.max - plot.scales.x.min) / plot.bbox.width;
    return t === null ? "" : spans.filter(([from, to]) => from - near <= t && t <= to + near).map((span) => span[2]).join(", ");
  };
  // A row without a label continues the one above it.
  const labelled = [];
  for (const [label, spans] of picture.rows)
    if (label) labelled.push([label, [...spans]]);
    else labelled.at(-1)[1].push(...spans);
  const grid = times(2000, picture.window ?? undefined), nothing = new Array(grid.length).fill(null);
  const options = onTime({
    series: [clock, ...labelled.map(([label, spans]) => ({label, stroke: () => ink.soft, value: named(spans)}))],
    axes: axes("s", "", 0, {values: (_, ticks) => ticks.map(() => ""), grid: {show: false}, ticks: {show: false}}),
    scales: {y: {range: () => [0, 1]}},
  }, step * count + 34 + 8, picture.window);
  options.hooks.drawClear = [];
  options.hooks.draw = [chosen, draw, moments(false)];
  return [options, [grid, ...labelled.map(() => nothing)]];
}

// --- touch --------------------------------------------------------------------------------------
// One finger moves the time axis, two stretch it; the picture follows the fingers.
const fingers = new Map(); // by pointer: its position, and the time below it, s
let touched = null, isDue = false;

function timeUnder(x) {
  const {left, width} = touched.getBoundingClientRect();
  return shown.from + (x - left) / width * (shown.to - shown.from);
}

function hold() {
  for (const finger of fingers.values()) finger.time = timeUnder(finger.x);
}

function pulled() {
  isDue = false;
  const [one, other] = fingers.values();
  if (!one) return;
  const {left, width} = touched.getBoundingClientRect();
  let seconds = (shown.to - shown.from) / width; // of a pixel
  if (other) {
    const stretched = (other.time - one.time) / (other.x - one.x);
    if (!(stretched > 0 && stretched < Infinity)) return;
    seconds = stretched;
  }
  const from = one.time - (one.x - left) * seconds;
  show(from, from + seconds * width);
}

function touchable(over) {
  over.style.touchAction = "pan-y";
  over.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "touch" || fingers.size === 2) return;
    if (over !== touched) fingers.clear();
    touched = over;
    fingers.set(event.pointerId, {x: event.clientX});
    hold();
  });
}

document.addEventListener("pointermove", (event) => {
  const finger = fingers.get(event.pointerId);
  if (!finger) return;
  finger.x = event.clientX;
  if (!isDue) requestAnimationFrame(pulled);
  isDue = true;
});

for (const end of ["pointerup", "pointercancel"])
  document.addEventListener(end, (event) => { if (fingers.delete(event.pointerId)) hold(); });

// --- the page -----------------------------------------------------------------------------------
const kinds = {lines, curves, heat, rows};

function made(place) {
  const picture = review.pictures[Number(place.dataset.picture)];
  const stack = place.closest(".stack");
  const lanes = stack && [...stack.querySelectorAll(".plot")];
  const lane = lanes && {isFirst: place === lanes[0], isLast: place === lanes.at(-1)};
  const [options, data] = kinds[picture.kind](picture, lane);
  const plot = new uPlot({...options, width: place.clientWidth}, data, place);
  const isTimed = picture.kind !== "curves" && !picture.window;
  if (isTimed) {
    timed.push(plot);
    touchable(plot.over);
  }
  all.push({place, plot});
  for (const name of plot.root.querySelectorAll(".u-series:not(.clock) th")) {
    name.tabIndex = 0;
    name.setAttribute("role", "button");
    name.setAttribute("aria-pressed", "true");
  }
  place.classList.add("drawn", picture.kind);
  // On narrow screens lanes of the same lines show their names once.
  const names = (one) => one?.traces?.map((trace) => trace.label).join();
  const above = lane && !lane.isFirst && review.pictures[Number(place.dataset.picture) - 1];
  place.classList.toggle("same", Boolean(above) && names(above) === names(picture));
  new ResizeObserver(() => {
    if (place.clientWidth && place.clientWidth !== plot.width) plot.setSize({width: place.clientWidth, height: plot.height});
  }).observe(place);
  if (isTimed) plot.setScale("x", {min: shown.from, max: shown.to});
}

async function drawn(places) {
  for (const place of places) {
    if (!place.classList.contains("drawn")) made(place);
    await new Promise((resolve) => setTimeout(resolve));
  }
}

function select(button) {
  const from = Number(button.dataset.from), to = Number(button.dataset.to);
  for (const other of document.querySelectorAll(".finding.shown")) other.classList.remove("shown");
  button.parentElement.classList.add("shown");
  selected = [from, to];
  const margin = Math.max(0.3 * (to - from), 3);
  show(from - margin, to + margin);
  for (const {plot} of all) plot.redraw(false);
  document.getElementById(button.dataset.place)?.scrollIntoView({behavior: "smooth", block: "start"});
}

const moves = {
  whole: () => {
    selected = null;
    for (const other of document.querySelectorAll(".finding.shown")) other.classList.remove("shown");
    show(0, END);
    for (const {plot} of all) plot.redraw(false);
  },
  closer: (width) => show(shown.from + width / 4, shown.to - width / 4),
  wider: (width) => show(shown.from - width / 2, shown.to + width / 2),
  back: (width) => show(shown.from - width / 2, shown.to - width / 2),
  on: (width) => show(shown.from + width / 2, shown.to + width / 2),
};

document.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  if (button.dataset.move) moves[button.dataset.move](shown.to - shown.from);
  else if (button.dataset.from) select(button);
});

for (const more of document.querySelectorAll("details"))
  more.addEventListener("toggle", () => { if (more.open) drawn(more.querySelectorAll("[data-picture]")); });

// A name in a legend hides its line, by pointer and by keyboard.
document.addEventListener("click", (event) => {
  const name = event.target.closest(".u-legend th[role=button]");
  if (name) name.setAttribute("aria-pressed", String(!name.parentElement.classList.contains("u-off")));
});
document.addEventListener("keydown", (event) => {
  const name = event.target.closest?.(".u-legend th[role=button]");
  if (!name || (event.key !== "Enter" && event.key !== " ")) return;
  event.preventDefault();
  name.click();
});

// The track in the colours of time or of the flight modes.
const stops = (colours) => colours.map((colour) => [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16)));
const choices = [...document.querySelectorAll("[data-colours]")];
function track() {
  const isMode = choices.find((one) => one.checked)?.value === "mode";
  const ramp = review.early_to_late[Number(isDark())], parts = stops(ramp);
  for (const part of document.querySelectorAll("[data-track]"))
    part.style.stroke = isMode && part.dataset.mode ? painted(part.dataset.mode) : `rgb(${between(parts, Number(part.dataset.share))})`;
  for (const key of document.querySelectorAll("[data-key]")) key.hidden = key.dataset.key !== (isMode ? "mode" : "time");
  for (const key of document.querySelectorAll(".key")) key.style.borderColor = painted(key.dataset.colour);
  for (const scale of document.querySelectorAll(".scale")) scale.style.background = `linear-gradient(to right, ${ramp})`;
}
for (const choice of choices) choice.addEventListener("change", track);

// Another scheme: everything is drawn again in its colours.
function recoloured() {
  inked();
  track();
  for (const {plot} of all) {
    plot.redraw(false);
    plot.root.querySelectorAll(".u-series").forEach((row, k) => {
      const marker = row.querySelector(".u-marker"), one = plot.series[k];
      if (marker && one.stroke && !one.of) marker.style.borderColor = one.stroke(plot, k);
    });
  }
}
scheme.addEventListener("change", recoloured);

// Rows that contain every word of a search.
for (const input of document.querySelectorAll("[data-search]"))
  input.addEventListener("input", () => {
    const words = input.value.toLowerCase().split(/\s+/);
    for (const row of document.querySelectorAll(`#${input.dataset.search} tbody tr`)) {
      const text = row.textContent.toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
    }
  });

// Paper is narrower than most windows; no resize observer runs between this event and the print.
const PAPER = 680;
window.addEventListener("beforeprint", () => {
  isPrinted = true;
  recoloured();
  for (const {plot} of all) plot.setSize({width: PAPER, height: plot.height});
});
window.addEventListener("afterprint", () => {
  isPrinted = false;
  recoloured();
  for (const {place, plot} of all) plot.setSize({width: place.clientWidth, height: plot.height});
});

inked();
track();
tell();
const first = [...document.querySelectorAll("[data-picture]")].filter((place) => !place.closest("details"));
drawn(first).then(() => { document.documentElement.dataset.drawn = Math.round(performance.now()); });
window.review = {shown, timed, show};
})();
