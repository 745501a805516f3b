// The list of flights: asks for a page of rows, draws it, and asks again while it is looked at.
const ROWS = 100;
const AGAIN_MS = 5000;
const TYPING_MS = 200;

const at = (id) => document.getElementById(id);
const asked = { sort: "date", order: "down", offset: 0 };
let last = "";
let timer = 0;
let asking = 0;
let token = sessionStorage.getItem("h2nav-token") || "";
let unlocked = false;
let largest = 0;
// A link may bring the token; it does not stay in the address.
if (location.hash.startsWith("#token=")) {
  keepToken(decodeURIComponent(location.hash.slice(7)));
  history.replaceState(null, "", location.pathname + location.search);
}

// Name, key of the sort (none: not sortable), first order, how a cell is drawn.
const COLUMNS = [
  ["Date, UTC", "date", "down", "date", date],
  ["Flight", "name", "up", "name", name],
  ["Airframe", "airframe", "up", "", (row) => [row.airframe || row.vehicle]],
  ["Duration", "duration", "down", "number", (row) => [duration(row.duration_s)]],
  ["Distance", "distance", "down", "number", (row) => [distance(row.distance_m)]],
  ["Verdict", "verdict", "up", "verdict", verdict],
  ["Worst finding", "worst", "up", "", worst],
  ["Firmware", "firmware", "up", "", (row) => [row.firmware]],
  ["Files", "size", "down", "files", files],
];

function element(kind, text, attributes = {}) {
  const made = document.createElement(kind);
  if (text !== undefined) made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

function date(row) {
  if (!row.date) return [];
  const time = element("time", row.date.slice(0, 16).replace("T", " "), { datetime: row.date });
  return [time];
}

function name(row) {
  const short = row.name.split("/").pop();
  const shown = row.page
    ? element("a", short, { href: `flights/${row.id}`, "aria-label": `Review of ${row.name}` })
    : element("span", short);
  // May be broken where its parts join.
  shown.replaceChildren(...short.split("_").flatMap((part, number) =>
    number ? ["_", element("wbr"), part] : [part]));
  const folder = row.name.slice(0, row.name.length - short.length);
  return folder ? [shown, element("small", folder)] : [shown];
}

function verdict(row) {
  const state = row.state === "reviewed" ? [] : [element("small", row.state)];
  if (row.error) return [element("span", row.error), ...state];
  return row.verdict ? [element("span", row.verdict), ...state] : state;
}

function worst(row) {
  if (!row.worst) return [];
  const counts = ["errors", "warnings", "notices"]
    .filter((key) => row[key]).map((key) => `${row[key]} ${row[key] === 1 ? key.slice(0, -1) : key}`);
  return [element("span", row.worst_text), element("small", counts.join(", "))];
}

function files(row) {
  const links = row.files.map((file, number) => {
    const kind = file.includes(".") ? file.split(".").pop().toUpperCase() : "log";
    return element("a", kind, { href: `flights/${row.id}/files/${number}`, download: "",
      "aria-label": `Download ${file}` });
  });
  if (row.document) {
    links.push(element("a", "JSON", { href: `flights/${row.id}/review.json`, download: "",
      "aria-label": `Download the review of ${row.name} as JSON` }));
  }
  if (unlocked) {
    const again = element("button", "Review again", { type: "button",
      "aria-label": `Review ${row.name} again` });
    again.addEventListener("click", () => change("POST", `flights/${row.id}/again`));
    const gone = element("button", "Delete", { type: "button", "aria-label": `Delete ${row.name}` });
    gone.addEventListener("click", () => remove(row));
    links.push(element("br"), ...(row.files.length && row.state !== "waiting" ? [again] : []), gone);
  }
  return [...links, ...(row.size ? [element("small", size(row.size))] : [])];
}

function duration(seconds) {
  if (seconds === null) return "";
  const whole = Math.round(seconds);
  const pad = (value) => String(value).padStart(2, "0");
  const rest = `${pad(Math.floor(whole / 60) % 60)}:${pad(whole % 60)}`;
  return whole >= 3600 ? `${Math.floor(whole / 3600)}:${rest}` : rest;
}

function distance(metres) {
  if (metres === null) return "";
  return metres < 1000 ? `${Math.round(metres)} m` : `${(metres / 1000).toFixed(1)} km`;
}

function size(bytes) {
  return bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

function drawn(row) {
  const line = element("tr", undefined, { "data-id": row.id });
  line.className = row.worst || (row.state === "reviewed" ? "sound" : row.state);
  for (const [head, , , look, cell] of COLUMNS) {
    const box = element("td", undefined, { "data-head": head });
    const content = cell(row);
    const inner = element("span");
    inner.append(...content);
    if (look) box.className = look;
    if (inner.textContent === "") box.classList.add("empty");
    box.append(inner);
    line.append(box);
  }
  return line;
}

function heads() {
  const row = document.querySelector("#list thead tr");
  row.replaceChildren(...COLUMNS.map(([text, key]) => {
    const head = element("th", undefined, { scope: "col", "aria-sort": "none" });
    if (asked.sort === key) {
      head.setAttribute("aria-sort", asked.order === "up" ? "ascending" : "descending");
    }
    const button = element("button", text, { type: "button", "data-sort": key });
    button.addEventListener("click", () => sortBy(key));
    head.append(button);
    return head;
  }));
}

function sortBy(key) {
  const first = COLUMNS.find((column) => column[1] === key)[2];
  const other = asked.order === "up" ? "down" : "up";
  asked.order = asked.sort === key ? other : first;
  asked.sort = key;
  asked.offset = 0;
  at("sort").value = key;
  heads();
  document.querySelector(`#list button[data-sort="${key}"]`).focus();
  ask();
}

function options(box, found, all) {
  const chosen = box.value;
  const wanted = Object.entries(found).map(([value, count]) => [value, `${value} (${count})`]);
  if (chosen && !(chosen in found)) wanted.push([chosen, `${chosen} (0)`]);
  const made = [element("option", all, { value: "" }),
    ...wanted.map(([value, text]) => element("option", text, { value }))];
  const texts = (list) => list.map((each) => each.textContent).join("\n");
  if (texts([...box.options]) === texts(made)) return;
  box.replaceChildren(...made);
  box.value = chosen;
}

function query() {
  const words = { ...asked, limit: ROWS, search: at("search").value };
  for (const id of ["kind", "severity"]) words[id] = at(id).value;
  words.state = at("reviewed").value;
  return new URLSearchParams(words).toString();
}

async function ask() {
  clearTimeout(timer);
  const number = ++asking;
  let text = "";
  try {
    const answer = await fetch(`flights.json?${query()}`, { cache: "no-store", headers: named() });
    if (answer.status === 404) throw new Error("No record of flights is kept here: it needs log.folder.");
    if (!answer.ok) throw new Error(`The list cannot be read (${answer.status}).`);
    text = await answer.text();
    if (number === asking) trouble("");
  } catch (error) {
    if (number === asking) {
      trouble(error instanceof TypeError ? "h2nav does not answer." : error.message);
    }
  }
  if (number !== asking) return;
  if (text && text !== last) show(JSON.parse(text));
  last = text || last;
  timer = setTimeout(ask, document.hidden ? 10 * AGAIN_MS : AGAIN_MS);
}

function show(found) {
  const { flights, total, matching, offset } = found;
  unlocked = found.is_unlocked;
  largest = found.upload_bytes;
  at("changes").hidden = !found.may_be_changed;
  at("lock").hidden = unlocked;
  at("drop").hidden = !unlocked || !largest;
  const body = document.querySelector("#list tbody");
  const focused = document.activeElement;
  const line = focused && focused.closest("#list tbody tr");
  const place = line ? [...line.querySelectorAll("a, button")].indexOf(focused) : -1;
  body.replaceChildren(...flights.map(drawn));
  if (place >= 0) {
    const again = [...body.rows].find((row) => row.dataset.id === line.dataset.id);
    if (again) again.querySelectorAll("a, button")[place]?.focus();
  }
  options(at("kind"), found.kinds, "any");
  options(at("reviewed"), found.states, "any");
  const noun = total === 1 ? "flight" : "flights";
  at("count").textContent = matching === total ? `${total} ${noun}` : `${matching} of ${total} ${noun}`;
  at("live").hidden = !found.has_live_page;
  at("none").hidden = flights.length > 0;
  at("none").textContent = total ? "No flight matches." : "No flights yet.";
  at("pages").hidden = matching <= ROWS;
  at("before").disabled = offset === 0;
  at("after").disabled = offset + flights.length >= matching;
  at("place").textContent = flights.length
    ? `${offset + 1} to ${offset + flights.length} of ${matching}` : "";
}

function trouble(text) {
  at("trouble").hidden = !text;
  if (at("trouble").textContent !== text) at("trouble").textContent = text;
}

function keepToken(text) {
  token = text;
  sessionStorage.setItem("h2nav-token", token);
}

function named() {
  return token ? { Authorization: `Bearer ${token}` } : {};
}

// What the server says besides the number of its status.
async function reason(answer) {
  return (await answer.text()).trim().replace(/^\d+ /, "");
}

// Asks for a change, and draws the list anew.
async function change(method, address) {
  try {
    const answer = await fetch(address, { method, headers: named() });
    if (!answer.ok) throw new Error(await reason(answer));
    await ask();
  } catch (error) {
    trouble(error instanceof TypeError ? "h2nav does not answer." : error.message);
  }
}

function remove(row) {
  at("question").textContent = `Delete ${row.name}, its recordings and its review?`;
  at("sure").returnValue = "no";
  at("sure").onclose = async () => {
    if (at("sure").returnValue !== "yes") return;
    await change("DELETE", `flights/${row.id}`);
    at("search").focus();
  };
  at("sure").showModal();
}

// One after the other: the server takes one at a time.
async function upload(files) {
  for (const file of files) {
    const line = element("li", `${file.name}: uploading`);
    at("uploads").prepend(line);
    try {
      if (file.size > largest) throw new Error(`larger than ${size(largest)}`);
      const answer = await fetch(`flights/uploads?name=${encodeURIComponent(file.name)}`,
        { method: "POST", body: file, headers: named() });
      if (!answer.ok) throw new Error(await reason(answer));
      line.textContent = `${(await answer.json()).name}: uploaded, it is reviewed next`;
    } catch (error) {
      line.className = "failed";
      line.textContent = `${file.name}: ${error instanceof TypeError ? "not taken" : error.message}`;
    }
    await ask();
  }
}

function fromTheStart() {
  asked.offset = 0;
  ask();
}

let typing = 0;
at("asked").addEventListener("submit", (event) => { event.preventDefault(); fromTheStart(); });
at("search").addEventListener("input", () => {
  clearTimeout(typing);
  typing = setTimeout(fromTheStart, TYPING_MS);
});
for (const id of ["kind", "severity", "reviewed"]) at(id).addEventListener("change", fromTheStart);
for (const [text, key] of COLUMNS) at("sort").append(element("option", text, { value: key }));
at("sort").addEventListener("change", () => {
  asked.sort = "";
  sortBy(at("sort").value);
  at("sort").focus();
});
at("reverse").addEventListener("click", () => {
  sortBy(asked.sort);
  at("reverse").focus();
});
at("before").addEventListener("click", () => {
  asked.offset = Math.max(0, asked.offset - ROWS);
  ask();
});
at("after").addEventListener("click", () => {
  asked.offset += ROWS;
  ask();
});
at("lock").addEventListener("submit", async (event) => {
  event.preventDefault();
  keepToken(at("token").value.trim());
  last = "";
  await ask();
  if (!unlocked) trouble("That is not the token.");
  else at("upload").focus();
});
at("upload").addEventListener("change", async () => {
  await upload([...at("upload").files]);
  at("upload").value = "";
});
for (const kind of ["dragover", "dragleave", "drop"]) {
  document.addEventListener(kind, (event) => {
    event.preventDefault();
    at("drop").classList.toggle("over", kind === "dragover" && unlocked);
    if (kind === "drop" && unlocked) upload([...event.dataTransfer.files]);
  });
}
document.addEventListener("visibilitychange", () => { if (!document.hidden) ask(); });
heads();
at("sort").value = asked.sort;
ask();
