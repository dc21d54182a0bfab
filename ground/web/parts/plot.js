// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// <time-plot>: parameters over time on a canvas. A lane for each unit, so that no two scales share an axis; bands from minimum to maximum
// where the archive gives minutes; limit lines; events as marks. The element draws, its owner brings the points:
//
//   plot.set_series([{name, unit, limits, points: [{t, v} | {t, v, low, high}]}]);  plot.set_marks([{t, severity, text}]);
//   plot.set_range(from, to);  "range" event: the user wants another one ({from, to} in detail);  "follow" event: back to now
//
// Pointer: drag zooms, shift and drag moves, the wheel zooms, a double click follows again. Keys: arrows move the cursor, shift and arrows
// the range, + and - zoom, Home follows.

import { svg } from "../dom.js";
import { span_text, value_text } from "../format.js";

const left_px = 64,
  right_px = 14,
  top_px = 18,
  bottom_px = 24,
  lane_gap_px = 14;
const dashes = [[], [7, 3], [2, 3], [9, 3, 2, 3], [4, 2], [12, 4]];
const colours = 6; // --series-1 ... --series-6 of the style sheet

export class TimePlot extends HTMLElement {
  constructor() {
    super();
    this.series = [];
    this.marks = [];
    this.range = { from: Date.now() - 600000, to: Date.now() };
    this.cursor = null;
    this.drag = null;
    this.pointers = new Map();
  }

  connectedCallback() {
    if (this.canvas) return;
    this.canvas = document.createElement("canvas");
    this.readout = document.createElement("div");
    this.readout.className = "readout";
    this.readout.hidden = true;
    this.append(this.canvas, this.readout);
    this.tabIndex = 0;
    this.setAttribute("role", "img");
    this.observer = new ResizeObserver(() => this.#resize());
    this.observer.observe(this);
    this.#listen();
  }

  disconnectedCallback() {
    this.observer?.disconnect();
  }

  set_series(series) {
    this.series = series;
    this.draw();
  }

  set_marks(marks) {
    this.marks = marks;
    this.draw();
  }

  set_range(from, to) {
    this.range = { from, to };
    this.draw();
  }

  /** Draws once, in the next frame, however often it is asked for. */
  draw() {
    if (this.waiting || !this.canvas) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      if (this.isConnected && this.width > left_px + right_px + 20) this.#draw();
    });
  }

  #resize() {
    const box = this.getBoundingClientRect();
    const scale = window.devicePixelRatio || 1;
    this.width = box.width;
    this.height = box.height;
    this.canvas.width = Math.round(box.width * scale);
    this.canvas.height = Math.round(box.height * scale);
    this.canvas.getContext("2d").setTransform(scale, 0, 0, scale, 0, 0);
    this.draw();
  }

  // --- geometry ---

  #x(t) {
    return left_px + ((t - this.range.from) / (this.range.to - this.range.from)) * (this.width - left_px - right_px);
  }

  #t(x) {
    return this.range.from + ((x - left_px) / (this.width - left_px - right_px)) * (this.range.to - this.range.from);
  }

  /** The lanes: {unit, series, top, height, low, high}. */
  #lanes() {
    const units = [...new Set(this.series.map((one) => one.unit ?? ""))];
    const all = this.height - top_px - bottom_px - lane_gap_px * (Math.max(units.length, 1) - 1);
    const height = all / Math.max(units.length, 1);
    return units.map((unit, i) => {
      const series = this.series.filter((one) => (one.unit ?? "") === unit);
      return { unit, series, top: top_px + i * (height + lane_gap_px), height, ...extent(series, this.range) };
    });
  }

  // --- drawing ---

  #draw() {
    const style = getComputedStyle(this);
    const colour = (name) => style.getPropertyValue(name).trim();
    const ctx = this.canvas.getContext("2d");
    ctx.clearRect(0, 0, this.width, this.height);
    ctx.font = `${Math.max(10, parseFloat(style.fontSize) * 0.82)}px ${style.fontFamily}`;
    ctx.textBaseline = "middle";
    const lanes = this.#lanes();
    this.lanes = lanes;
    this.#draw_times(ctx, colour);
    for (const lane of lanes) this.#draw_lane(ctx, lane, colour);
    this.#draw_marks(ctx, colour);
    if (this.drag?.mode === "zoom") this.#draw_selection(ctx, colour);
    if (this.cursor !== null) this.#draw_cursor(ctx, colour);
    this.#describe();
  }

  #draw_lane(ctx, lane, colour) {
    const y = (v) => lane.top + lane.height * (1 - (v - lane.low) / (lane.high - lane.low));
    ctx.lineWidth = 1;
    ctx.strokeStyle = colour("--line");
    ctx.fillStyle = colour("--dim");
    ctx.textAlign = "right";
    for (const tick of value_ticks(lane.low, lane.high, Math.max(3, Math.floor(lane.height / 34)))) {
      line(ctx, left_px, y(tick), this.width - right_px, y(tick));
      ctx.fillText(tick_text(tick, lane.high - lane.low), left_px - 6, y(tick));
    }
    ctx.textAlign = "left";
    if (lane.unit) ctx.fillText(`[${lane.unit}]`, 4, lane.top - 8);
    ctx.save();
    ctx.beginPath();
    ctx.rect(left_px, lane.top - 1, this.width - left_px - right_px, lane.height + 2);
    ctx.clip();
    if (lane.series.length <= 2) for (const one of lane.series) this.#draw_limits(ctx, one, y, colour);
    for (const one of lane.series) this.#draw_series(ctx, one, y, colour);
    ctx.restore();
  }

  #draw_limits(ctx, one, y, colour) {
    const limits = one.limits ?? {};
    for (const [key, value] of Object.entries(limits)) {
      if (value === null || value === undefined) continue;
      const red = key.startsWith("red");
      ctx.strokeStyle = colour(red ? "--red" : "--yellow");
      ctx.fillStyle = ctx.strokeStyle;
      ctx.setLineDash(red ? [] : [5, 4]);
      ctx.globalAlpha = 0.75;
      line(ctx, left_px, y(value), this.width - right_px, y(value));
      ctx.textAlign = red ? "left" : "right"; // apart, where the lines are near
      ctx.fillText(
        `${red ? "red" : "yellow"} ${key.endsWith("low") ? "≥" : "≤"} ${value}`,
        red ? left_px + 6 : this.width - right_px - 6,
        y(value) + (key.endsWith("low") ? -7 : 7),
      );
      ctx.globalAlpha = 1;
      ctx.setLineDash([]);
    }
  }

  #draw_series(ctx, one, y, colour) {
    const index = this.series.indexOf(one);
    ctx.strokeStyle = colour(`--series-${(index % colours) + 1}`);
    ctx.fillStyle = ctx.strokeStyle;
    ctx.setLineDash(dashes[index % dashes.length]);
    ctx.lineWidth = 1.6;
    const points = visible(one.points, this.range);
    const break_ms = break_after(points);
    if (points.some((p) => p.low !== undefined)) this.#draw_band(ctx, points, y, break_ms);
    ctx.beginPath();
    let before = null;
    for (const point of points) {
      if (point.v === null) {
        before = null;
        continue;
      }
      const px = this.#x(point.t),
        py = y(point.v);
      if (before === null || point.t - before > break_ms) ctx.moveTo(px, py);
      else ctx.lineTo(px, py);
      before = point.t;
    }
    ctx.stroke();
    ctx.setLineDash([]);
    if (points.length <= (this.width - left_px) / 14)
      for (const point of points) if (point.v !== null) dot(ctx, this.#x(point.t), y(point.v), 2.2);
    const last = points.findLast((p) => p.v !== null);
    if (last) dot(ctx, this.#x(last.t), y(last.v), 3);
  }

  #draw_band(ctx, points, y, break_ms) {
    ctx.globalAlpha = 0.22;
    let run = [];
    const flush = () => {
      if (run.length) {
        ctx.beginPath();
        for (const p of run) ctx.lineTo(this.#x(p.t), y(p.high));
        for (const p of run.reverse()) ctx.lineTo(this.#x(p.t), y(p.low));
        ctx.fill();
      }
      run = [];
    };
    for (const point of points) {
      if (point.low === undefined || (run.length && point.t - run[run.length - 1].t > break_ms)) flush();
      if (point.low !== undefined) run.push(point);
    }
    flush();
    ctx.globalAlpha = 1;
  }

  #draw_times(ctx, colour) {
    const { from, to } = this.range;
    const y = this.height - bottom_px;
    ctx.strokeStyle = colour("--line");
    ctx.fillStyle = colour("--dim");
    ctx.textAlign = "center";
    const step = time_step(to - from, (this.width - left_px - right_px) / 90);
    for (let t = Math.ceil(from / step) * step; t <= to; t += step) {
      line(ctx, this.#x(t), top_px, this.#x(t), y);
      const iso = new Date(t).toISOString();
      ctx.fillText(step >= 86400000 ? iso.slice(5, 10) : step >= 60000 ? iso.slice(11, 16) : iso.slice(11, 19), this.#x(t), y + 12);
    }
  }

  #draw_marks(ctx, colour) {
    for (const mark of this.marks) {
      if (mark.t < this.range.from || mark.t > this.range.to) continue;
      const x = this.#x(mark.t);
      ctx.fillStyle = colour({ high: "--red", medium: "--yellow", low: "--accent" }[mark.severity] ?? "--dim");
      ctx.beginPath();
      ctx.moveTo(x - 4, 2);
      ctx.lineTo(x + 4, 2);
      ctx.lineTo(x, 10);
      ctx.fill();
      if (mark.severity !== "medium" && mark.severity !== "high") continue;
      ctx.globalAlpha = 0.35;
      ctx.fillRect(x - 0.5, 10, 1, this.height - bottom_px - 10);
      ctx.globalAlpha = 1;
    }
  }

  #draw_selection(ctx, colour) {
    ctx.fillStyle = colour("--accent");
    ctx.globalAlpha = 0.18;
    ctx.fillRect(Math.min(this.drag.x, this.drag.now), top_px, Math.abs(this.drag.now - this.drag.x), this.height - top_px - bottom_px);
    ctx.globalAlpha = 1;
  }

  #draw_cursor(ctx, colour) {
    const x = this.#x(this.cursor);
    ctx.strokeStyle = colour("--text");
    ctx.globalAlpha = 0.6;
    line(ctx, x, top_px, x, this.height - bottom_px);
    ctx.globalAlpha = 1;
    for (const lane of this.lanes) {
      for (const one of lane.series) {
        const point = nearest(one.points, this.cursor);
        if (!point || point.v === null) continue;
        ctx.fillStyle = colour(`--series-${(this.series.indexOf(one) % colours) + 1}`);
        dot(ctx, this.#x(point.t), lane.top + lane.height * (1 - (point.v - lane.low) / (lane.high - lane.low)), 4);
      }
    }
    this.#show_readout();
  }

  #show_readout() {
    const rows = [new Date(this.cursor).toISOString().slice(0, 19).replace("T", " ")];
    for (const one of this.series) {
      const point = nearest(one.points, this.cursor);
      if (!point) continue;
      const band = point.low === undefined ? "" : `  (${value_text(point.low)} … ${value_text(point.high)})`;
      rows.push(`${one.name}: ${value_text(point.v)} ${one.unit ?? ""}${band}`);
    }
    const near = (this.range.to - this.range.from) * (6 / this.width);
    for (const mark of this.marks.filter((m) => Math.abs(m.t - this.cursor) < near).slice(0, 3)) rows.push(`▾ ${mark.text}`);
    this.readout.replaceChildren(...rows.map((row) => Object.assign(document.createElement("div"), { textContent: row })));
    this.readout.hidden = false;
    const x = this.#x(this.cursor);
    this.readout.classList.toggle("left", x > this.width / 2);
    this.readout.style.left = x > this.width / 2 ? "auto" : `${x + 10}px`;
    this.readout.style.right = x > this.width / 2 ? `${this.width - x + 10}px` : "auto";
  }

  #describe() {
    const newest = this.series.map((one) => `${one.name} ${value_text(one.points.at(-1)?.v)} ${one.unit ?? ""}`).join("; ");
    const text = `Plot of ${span_text(this.range.to - this.range.from)}: ${newest}`;
    if (this.getAttribute("aria-label") !== text) this.setAttribute("aria-label", text);
  }

  // --- the user ---

  #want(from, to) {
    if (to - from < 1000) return;
    this.range = { from, to };
    this.draw();
    this.dispatchEvent(new CustomEvent("range", { detail: { from, to } }));
  }

  #zoom(factor, around) {
    const { from, to } = this.range;
    this.#want(around - (around - from) * factor, around + (to - around) * factor);
  }

  #listen() {
    const at = (event) => Math.min(Math.max(event.clientX - this.getBoundingClientRect().left, left_px), this.width - right_px);
    this.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      this.setPointerCapture(event.pointerId);
      this.drag = { mode: event.shiftKey ? "move" : "zoom", x: at(event), now: at(event), range: this.range };
    });
    this.addEventListener("pointermove", (event) => {
      this.cursor = this.#t(at(event));
      if (this.drag) this.drag.now = at(event);
      if (this.drag?.mode === "move") {
        const shift = ((this.drag.x - this.drag.now) / (this.width - left_px - right_px)) * (this.drag.range.to - this.drag.range.from);
        this.range = { from: this.drag.range.from + shift, to: this.drag.range.to + shift };
      }
      this.draw();
    });
    this.addEventListener("pointerup", () => {
      const drag = this.drag;
      this.drag = null;
      if (drag?.mode === "zoom" && Math.abs(drag.now - drag.x) > 6)
        this.#want(this.#t(Math.min(drag.x, drag.now)), this.#t(Math.max(drag.x, drag.now)));
      else if (drag?.mode === "move") this.#want(this.range.from, this.range.to);
      this.draw();
    });
    this.addEventListener("pointerleave", () => {
      this.cursor = null;
      this.readout.hidden = true;
      this.draw();
    });
    this.addEventListener("dblclick", () => this.dispatchEvent(new CustomEvent("follow")));
    this.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey && document.activeElement !== this) return; // the wheel scrolls the page, unless the plot has the focus
        event.preventDefault();
        this.#zoom(event.deltaY > 0 ? 1.25 : 0.8, this.#t(at(event)));
      },
      { passive: false },
    );
    this.addEventListener("keydown", (event) => this.#on_key(event));
  }

  #on_key(event) {
    const { from, to } = this.range;
    const step = ((to - from) / this.width) * 12;
    const middle = this.cursor ?? (from + to) / 2;
    const direction = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (direction && event.shiftKey) this.#want(from + direction * step * 8, to + direction * step * 8);
    else if (direction) this.cursor = Math.min(to, Math.max(from, middle + direction * step));
    else if (event.key === "+" || event.key === "=") this.#zoom(0.7, middle);
    else if (event.key === "-") this.#zoom(1.4, middle);
    else if (event.key === "Home" || event.key === "Escape") this.dispatchEvent(new CustomEvent("follow"));
    else return;
    event.preventDefault();
    this.draw();
  }
}

/** The line of a series in a legend, with its dashes. */
export function swatch(index) {
  return svg(
    "svg",
    { viewBox: "0 0 26 8", class: "swatch", "aria-hidden": "true" },
    svg("path", {
      d: "M0 4H26",
      class: `stroke-${(index % colours) + 1}`,
      "stroke-dasharray": dashes[index % dashes.length].join(" ") || null,
    }),
  );
}

function line(ctx, x1, y1, x2, y2) {
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  ctx.lineTo(x2, y2);
  ctx.stroke();
}

function dot(ctx, x, y, r) {
  ctx.beginPath();
  ctx.arc(x, y, r, 0, 2 * Math.PI);
  ctx.fill();
}

/** Index of the first point at @p t or later; points are in order. */
export function first_at(points, t) {
  let low = 0,
    high = points.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (points[middle].t < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** The points of a range, and one beside it on each side. */
function visible(points, { from, to }) {
  return points.slice(Math.max(0, first_at(points, from) - 1), first_at(points, to) + 1);
}

function nearest(points, t) {
  const at = first_at(points, t);
  const before = points[at - 1],
    after = points[at];
  if (!before || !after) return before ?? after;
  return t - before.t < after.t - t ? before : after;
}

/** A line is not drawn over a gap: what is longer than five usual steps. */
export function break_after(points) {
  if (points.length < 3) return Infinity;
  const steps = points
    .slice(1)
    .map((p, i) => p.t - points[i].t)
    .sort((a, b) => a - b);
  return Math.max(1000, steps[steps.length >> 1] * 5);
}

export function extent(series, range) {
  let low = Infinity,
    high = -Infinity;
  for (const one of series) {
    for (const point of visible(one.points, range)) {
      if (point.v === null) continue;
      low = Math.min(low, point.low ?? point.v);
      high = Math.max(high, point.high ?? point.v);
    }
  }
  if (low > high) return { low: 0, high: 1 };
  // A limit that is near belongs into the picture; one that is far would flatten the line.
  const size = high - low || Math.abs(high) * 0.02 || 1;
  for (const one of series)
    for (const limit of Object.values(one.limits ?? {}))
      if (limit !== null && limit !== undefined && limit > low - size && limit < high + size) {
        low = Math.min(low, limit);
        high = Math.max(high, limit);
      }
  const margin = (high - low) * 0.08 || size / 2;
  return { low: low - margin, high: high + margin };
}

export function value_ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= rough);
  const ticks = [];
  for (let i = Math.ceil(low / step); i * step <= high; ++i) ticks.push(i * step);
  return ticks;
}

function tick_text(tick, size) {
  if (tick !== 0 && (Math.abs(tick) >= 1e6 || Math.abs(tick) < 1e-4)) return tick.toExponential(1);
  return tick.toFixed(Math.max(0, Math.min(6, 2 - Math.floor(Math.log10(size)) - 1)));
}

const time_steps_s = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400, 172800, 604800];
export function time_step(span_ms, most) {
  return (time_steps_s.find((s) => span_ms / (s * 1000) <= most) ?? 2592000) * 1000;
}

customElements.define("time-plot", TimePlot);
