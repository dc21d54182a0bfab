// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The points of a <time-plot>: the history of its parameters from the archive, then what comes live.

import { first_at } from "./plot.js";

const points_max = 20000; // of a series; the oldest go first
const redraw_ms = 250;

/** Fills @p plot with @p names until @p signal. @p options: {span_ms, on_follow(following)}. */
export class PlotData {
  constructor(model, plot, names, span_ms, signal) {
    Object.assign(this, { model, plot, names, span_ms, signal });
    this.follows = true;
    this.with_events = true;
    this.series = names.map((name) => this.#empty(name));
    model.on("packet", (packet) => this.#take(packet), signal);
    model.on("events", () => this.#mark(), signal);
    plot.addEventListener("range", ({ detail }) => this.show(detail.from, detail.to), { signal });
    plot.addEventListener("follow", () => this.follow(this.span_ms), { signal });
    const timer = setInterval(() => this.#tick(), redraw_ms);
    signal.addEventListener("abort", () => clearInterval(timer));
  }

  #empty(name) {
    const dot = name.indexOf(".");
    const definition = this.model.definition(name.slice(0, dot), name.slice(dot + 1)) ?? {};
    return {
      name,
      structure: name.slice(0, dot),
      field: name.slice(dot + 1),
      unit: definition.unit ?? "",
      limits: definition.limits ?? {},
      labels: definition.enum,
      points: [],
    };
  }

  /** The last @p span_ms, moving. */
  follow(span_ms) {
    this.span_ms = span_ms;
    this.follows = true;
    this.on_follow?.(true);
    return this.#load(this.model.now() - span_ms, this.model.now());
  }

  /** A range that stands still. */
  show(from, to) {
    this.follows = false;
    this.on_follow?.(false);
    return this.#load(from, to);
  }

  async #load(from, to) {
    const load = (this.load = Symbol("load"));
    this.plot.set_range(from, to);
    await Promise.all(
      this.series.map(async (one) => {
        const iso = (t) => new Date(t).toISOString();
        try {
          const history = await this.model.api.get("history", {
            parameter: one.name,
            from: iso(from),
            to: this.follows ? undefined : iso(to),
            points: 2000,
          });
          if (this.load !== load || this.signal.aborted) return;
          const points = history.points.map((point) => this.#point(one, point)).sort((a, b) => a.t - b.t);
          const newer = points.length ? one.points.slice(first_at(one.points, points.at(-1).t + 1)) : one.points;
          one.points = this.follows ? points.concat(newer) : points;
          if (history.unit) one.unit = history.unit;
          one.error = undefined;
        } catch (error) {
          one.error = error.message;
        }
      }),
    );
    if (this.load !== load || this.signal.aborted) return;
    this.#mark();
    this.plot.set_series(this.series);
    this.on_loaded?.();
  }

  #point(one, point) {
    const t = Date.parse(point.time);
    if (point.mean !== undefined) return { t, v: point.mean, low: point.min, high: point.max };
    return { t, v: number_of(point.value, one.labels) };
  }

  #take(packet) {
    for (const one of this.series) {
      if (packet.structure !== one.structure || !(one.field in packet.fields)) continue;
      const point = { t: Date.parse(packet.time), v: number_of(packet.fields[one.field], one.labels) };
      const last = one.points.at(-1);
      if (!last || point.t > last.t) one.points.push(point);
      else if (one.points[first_at(one.points, point.t)]?.t !== point.t) one.points.splice(first_at(one.points, point.t), 0, point);
      if (one.points.length > points_max) one.points.splice(0, one.points.length - points_max);
      this.fresh = true;
    }
  }

  #mark() {
    const marks = this.with_events
      ? this.model.events.map((e) => ({ t: Date.parse(e.time), severity: e.severity, text: `${e.event}: ${e.text}` }))
      : [];
    this.plot.set_marks(marks.filter((mark) => mark.t >= this.plot.range.from && mark.t <= this.plot.range.to));
  }

  #tick() {
    if (!this.follows || document.hidden) return;
    // A pixel is the least that can be seen to move.
    const pixel_ms = this.span_ms / Math.max(100, this.plot.width ?? 100);
    const now = this.model.now();
    if (!this.fresh && now - this.plot.range.to < pixel_ms) return;
    this.fresh = false;
    if (!this.plot.drag) this.plot.set_range(now - this.span_ms, now);
  }
}

/** The number that a plot shows: of a label its number, of a truth 0 or 1, of "0x1f" its value. */
export function number_of(value, labels) {
  if (typeof value === "number") return value;
  if (typeof value === "boolean") return Number(value);
  if (value === null || value === undefined) return null;
  if (labels && value in labels) return labels[value];
  const number = Number(value);
  return Number.isNaN(number) ? null : number;
}
