// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Parameters: every structure of the dictionary with its newest values, limits and age.

import { h, set_class, set_text, shape, svg, walk_by_keys } from "../dom.js";
import { bounds_text, breakable, span_text, time_text, value_text } from "../format.js";
import { PlotData } from "../parts/plot_data.js";

export const title = "Parameters";

export function show(main, context, path, query) {
  const { model, signal } = context;
  const input = h("input", {
    type: "search",
    placeholder: "Filter by name, unit or description  /",
    "aria-label": "Filter",
    value: query.get("filter") ?? "",
  });
  const only = h(
    "select",
    { "aria-label": "Which values", value: null },
    ...[
      ["all", "All values"],
      ["limits", "Outside limits"],
      ["stale", "Stale"],
      ["changed", "Changed in the last minute"],
    ].map(([value, text]) => h("option", { value }, text)),
  );
  only.value = query.get("only") ?? "all";
  const count = h("span.hint", { role: "status" });
  const sections = h("div.structures");
  const detail = h("aside.detail", { hidden: true, "aria-label": "The parameter" });
  main.append(h("div.tools", {}, input, only, count), h("div.split", {}, sections, detail));
  const table = new Table(context, sections, (name) => show_detail(context, detail, name));
  const filter = () => {
    table.filter = { words: input.value.toLowerCase().split(/\s+/).filter(Boolean), only: only.value };
    set_text(count, `${table.apply()} shown`);
  };
  input.addEventListener("input", filter);
  only.addEventListener("change", filter);
  walk_by_keys(sections, "tr[tabindex]");
  model.on(
    "values",
    () => {
      const has_new = table.update();
      if (has_new || only.value !== "all") filter();
    },
    signal,
  );
  model.on("second", () => table.ages(), signal);
  table.update();
  filter();
  if (query.get("show")) show_detail(context, detail, query.get("show"), table);
}

/** The sections. Only rows whose value changed are touched, and only in sections that can be seen. */
class Table {
  constructor(context, element, open) {
    Object.assign(this, { model: context.model, element, open });
    this.sections = new Map();
    this.filter = { words: [], only: "all" };
    this.observer = new IntersectionObserver(
      (entries) => {
        for (const entry of entries) {
          const section = this.sections.get(entry.target.dataset.name);
          section.seen = entry.isIntersecting;
          if (section.seen) this.#fill(section);
        }
      },
      { rootMargin: "300px" },
    );
    context.signal.addEventListener("abort", () => this.observer.disconnect());
  }

  /** @return whether a structure came for the first time */
  update() {
    const before = this.sections.size;
    for (const newest of this.model.structures.values()) {
      const section = this.sections.get(newest.name) ?? this.#make_section(newest);
      if (section.painted === newest.time && section.fields === newest.fields) continue;
      section.newest = newest;
      if (section.seen) this.#fill(section);
    }
    return this.sections.size > before;
  }

  #make_section(newest) {
    const structure = this.model.structure_of.get(newest.name);
    const body = h("tbody");
    const age = h("span.age");
    const element = h(
      "section.panel.structure",
      { dataset: { name: newest.name }, "aria-label": newest.name },
      h("h2", {}, newest.name, h("span.subsystem", {}, structure?.subsystem ?? ""), age),
      h("table.compact", {}, body),
    );
    const section = { element, body, age, newest, rows: new Map(), seen: false };
    const names = [...this.sections.keys(), newest.name].sort();
    const after = names[names.indexOf(newest.name) + 1];
    this.element.insertBefore(element, after ? this.sections.get(after).element : null);
    this.sections.set(newest.name, section);
    // Rows exist from the start, so that filters and the length of the page are right; values come when the section is seen.
    for (const field of Object.keys(newest.fields)) this.#make_row(section, field);
    this.observer.observe(element);
    return section;
  }

  #make_row(section, field) {
    const name = `${section.newest.name}.${field}`;
    const definition = this.model.definition(section.newest.name, field) ?? {};
    const value = h("span");
    const symbol = h("span.symbol");
    const row = {
      field,
      name,
      definition,
      value,
      symbol,
      value_cell: h("td.number.value", {}, symbol, value),
      shown: undefined,
      limit: "",
      changed: -Infinity,
    };
    const limits = definition.limits;
    row.bar = limits && !definition.enum ? limit_bar(limits) : null;
    row.element = h(
      "tr",
      {
        tabindex: 0,
        title: definition.description ?? "",
        onclick: () => this.open(name),
        onkeydown: (event) => event.key === "Enter" && this.open(name),
      },
      h("th", { scope: "row" }, breakable(field)),
      row.value_cell,
      h("td.unit", {}, section.newest.units[field] ?? definition.unit ?? ""),
      h("td.bar", {}, row.bar?.element),
    );
    row.words = `${name} ${definition.unit ?? ""} ${definition.description ?? ""}`.toLowerCase();
    section.rows.set(field, row);
    section.body.append(row.element);
    return row;
  }

  #fill(section) {
    const { newest } = section;
    section.painted = newest.time;
    section.fields = newest.fields;
    for (const [field, value] of Object.entries(newest.fields)) {
      const row = section.rows.get(field) ?? this.#make_row(section, field);
      const limit = newest.limits[field] === "red" || newest.limits[field] === "yellow" ? newest.limits[field] : "";
      if (row.shown !== value) {
        if (row.shown !== undefined) row.changed = performance.now();
        row.shown = value;
        set_text(row.value, value_text(value));
        row.bar?.set(value);
      }
      if (row.limit !== limit) {
        row.limit = limit;
        row.value_cell.className = `number value ${limit}`;
        row.symbol.replaceChildren(...(limit ? [shape(limit, limit)] : []));
        row.value_cell.title = limit ? `outside its ${limit === "red" ? "hard" : "soft"} limits (${limit})` : "";
      }
    }
    this.#age(section);
  }

  #age(section) {
    const stale = this.model.is_stale(section.newest);
    const structure = this.model.structure_of.get(section.newest.name);
    set_text(
      section.age,
      `${span_text(this.model.age(section.newest))} old${structure?.interval_s > 0.1 ? `, every ${structure.interval_s} s` : ""}${stale ? ", STALE" : ""}`,
    );
    set_class(section.element, "stale", stale);
  }

  ages() {
    for (const section of this.sections.values()) if (section.seen) this.#age(section);
  }

  /** Hides what the filter leaves out. @return how many rows are left */
  apply() {
    const { words, only } = this.filter;
    const now = performance.now();
    let left = 0;
    for (const section of this.sections.values()) {
      const stale = this.model.is_stale(section.newest);
      let any = false;
      for (const row of section.rows.values()) {
        const limit = section.newest.limits[row.field];
        const wanted =
          words.every((word) => row.words.includes(word)) &&
          (only === "all" ||
            (only === "limits" && (limit === "red" || limit === "yellow")) ||
            (only === "stale" && stale) ||
            (only === "changed" && now - row.changed < 60000));
        if (row.element.hidden === wanted) row.element.hidden = !wanted;
        any = any || wanted;
        left += wanted;
      }
      if (section.element.hidden === any) section.element.hidden = !any;
    }
    return left;
  }
}

/** Where a value lies between its limits. */
function limit_bar(limits) {
  const known = [limits.red_low, limits.yellow_low, limits.yellow_high, limits.red_high].filter((v) => v !== null && v !== undefined);
  if (known.length < 2) return null;
  const low = Math.min(...known),
    high = Math.max(...known),
    margin = (high - low) * 0.12;
  const x = (v) => Math.max(1, Math.min(79, ((v - low + margin) / (high - low + 2 * margin)) * 80));
  const inner = [limits.yellow_low ?? limits.red_low ?? low - margin, limits.yellow_high ?? limits.red_high ?? high + margin];
  const needle = svg("path", { d: "M0 0 4 7-4 7z", class: "needle", transform: "translate(-99 3)" });
  const element = svg(
    "svg",
    { viewBox: "0 0 80 10", class: "limit-bar", "aria-hidden": "true" },
    svg("rect", { x: 0, y: 4, width: 80, height: 2, class: "outside" }),
    svg("rect", { x: x(inner[0]), y: 3, width: Math.max(1, x(inner[1]) - x(inner[0])), height: 4, class: "inside" }),
    needle,
  );
  return {
    element,
    set: (value) => needle.setAttribute("transform", typeof value === "number" ? `translate(${x(value)} 2)` : "translate(-99 2)"),
  };
}

/** One parameter: what the dictionary says about it, and its last hours. */
function show_detail(context, detail, name) {
  const { model } = context;
  detail.ended?.abort();
  const ended = (detail.ended = new AbortController());
  context.signal.addEventListener("abort", () => ended.abort());
  const close = () => {
    ended.abort();
    detail.hidden = true;
  };
  const big = h("div.big");
  const rows = h("dl.rows");
  const plot = document.createElement("time-plot");
  const data = new PlotData(model, plot, [name], 600000, ended.signal);
  const spans = Object.entries({ "10 min": 10, "1 h": 60, "6 h": 360, "1 d": 1440 }).map(([text, minutes]) =>
    h("button", { onclick: () => data.follow(minutes * 60000) }, text),
  );
  const dot = name.indexOf(".");
  const definition = model.definition(name.slice(0, dot), name.slice(dot + 1)) ?? {};
  detail.replaceChildren(
    h("header", {}, h("h2", {}, breakable(name)), h("button.quiet", { "aria-label": "Close", onclick: close }, shape("failed"))),
    big,
    h("p", {}, definition.description ?? ""),
    h(
      "div.tabs",
      { role: "group", "aria-label": "Length of the plot" },
      ...spans,
      h("a.quiet", { href: `#/plots?p=${name}` }, "Open plot"),
    ),
    plot,
    rows,
  );
  detail.hidden = false;
  const update = () => {
    const newest = model.value(name);
    set_text(big, newest ? `${value_text(newest.value)} ${newest.unit}` : "no value yet");
    big.className = `big ${newest?.limit ?? ""}`;
    rows.replaceChildren(...facts_of(model, name, definition, newest).flatMap(([key, text]) => [h("dt", {}, key), h("dd", {}, text)]));
  };
  requestAnimationFrame(() => data.follow(600000));
  model.on("values", update, ended.signal);
  model.on("second", update, ended.signal);
  update();
}

/** [name, text] of what is known about a parameter. */
function facts_of(model, name, definition, newest) {
  const limits = definition.limits ?? {};
  const interval = model.structure_of.get(name.slice(0, name.indexOf(".")))?.interval_s;
  const within = Object.keys(limits).length ? "within limits" : "no limits";
  const state = newest && (newest.limit === "red" || newest.limit === "yellow" ? newest.limit : within);
  const facts = [
    ["state", newest ? state + (newest.stale ? ", stale" : "") : ""],
    ["time on board", newest ? time_text(newest.time) : ""],
    ["age", newest ? span_text(newest.age_ms) : ""],
    ["soft limits", bounds_text(limits.yellow_low, limits.yellow_high)],
    ["hard limits", bounds_text(limits.red_low, limits.red_high)],
    ["type", [definition.type, definition.calibrated ? "calibrated" : ""].filter(Boolean).join(", ")],
    [
      "values",
      Object.entries(definition.enum ?? {})
        .map(([text, number]) => `${number} ${text}`)
        .join(", "),
    ],
    ["interval", interval ? `${interval} s` : ""],
  ];
  return facts.filter(([, text]) => text);
}
