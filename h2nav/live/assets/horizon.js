// An artificial horizon with the heading below it.
import { at, element, make } from "./elements.js";
import { degrees, signed } from "./words.js";

const PITCH = 2.2; // units of the picture per degree
const TAPE = 1.5;

export class Horizon {
  constructor(figure) {
    this.figure = figure;
    const place = at(`#${figure.id} .horizon`);
    this.picture = make("svg", { viewBox: "-100 -100 200 212", role: "img" }, place);
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
      const [kind, reach] = angle ? ["ladder", half] : ["edge", 400];
      make("line", { class: kind, x1: -reach, x2: reach, y1: y, y2: y }, this.ball);
      if (angle && angle % 20 === 0) {
        for (const x of [-32, 32]) make("text", { x, y: y + 3 }, marks, String(Math.abs(angle)));
      }
    }
  }

  drawScale() {
    for (const angle of [-60, -45, -30, -20, -10, 0, 10, 20, 30, 45, 60]) {
      const end = angle % 30 ? -87 : -90;
      const transform = `rotate(${angle})`;
      make("line", { class: "scale", y1: -82, y2: end, transform }, this.picture);
    }
  }

  drawTape() {
    const clip = `${this.figure.id}-tape`;
    const box = { x: -75, y: 90, width: 150, height: 21 };
    make("rect", box, make("clipPath", { id: clip }, this.picture));
    const window = make("g", { "clip-path": `url(#${clip})` }, this.picture);
    make("rect", { ...box, class: "box" }, window);
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
    const spoken = `roll ${values[0]}, pitch ${values[1]}, heading ${values[2]}`;
    this.picture.setAttribute("aria-label", spoken);
  }
}
