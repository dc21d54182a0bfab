// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Plots of any parameters, from the archive and live. The address holds what is shown: #/plots?p=A,B&p=C&span=60

import { h, set_class, set_text, toast } from "../dom.js";
import { parse_time, search, value_text } from "../format.js";
import { download } from "../parts/panels.js";
import { swatch } from "../parts/plot.js";
import { PlotData } from "../parts/plot_data.js";

export const title = "Plots";
const spans = [
  ["5 min", 5],
  ["10 min", 10],
  ["1 h", 60],
  ["6 h", 360],
  ["1 d", 1440],
  ["7 d", 10080],
  ["30 d", 43200],
];

export function show(main, context, path, query) {
  const plots = query.getAll("p").map((names) => names.split(",").filter(Boolean));
  const minutes = Number(query.get("span")) || 10;
  const to_address = (changed, span = minutes) => {
    const wanted = new URLSearchParams(changed.filter((names) => names.length).map((names) => ["p", names.join(",")]));
    if (span !== minutes || query.get("span")) wanted.set("span", span);
    context.go(`plots?${wanted}`);
  };
  const tools = h(
    "div.tools",
    {},
    picker(context, "Add a plot of …", (name) => to_address([...plots, [name]])),
    h(
      "div.tabs",
      { role: "group", "aria-label": "Length" },
      ...spans.map(([text, span]) =>
        h("button", { "aria-pressed": String(span === minutes), onclick: () => to_address(plots, span) }, text),
      ),
    ),
  );
  main.append(tools);
  if (!plots.length)
    main.append(h("p.hint.empty", {}, "Choose a parameter. Drag in a plot zooms, shift and drag moves, a double click goes back to now."));
  plots.forEach((names, i) =>
    main.append(one_plot(context, names, minutes, plots.length, (changed) => to_address(plots.map((old, k) => (k === i ? changed : old))))),
  );
}

/** An input that finds a parameter. */
function picker(context, placeholder, chosen) {
  const { model } = context;
  const id = `names-${Math.random().toString(36).slice(2)}`;
  const all = [...model.structures.values()].flatMap((one) => Object.keys(one.fields).map((field) => `${one.name}.${field}`));
  const list = h("datalist", { id });
  const input = h("input", { type: "search", list: id, placeholder, "aria-label": placeholder });
  const offer = () =>
    list.replaceChildren(
      ...search(all, input.value, (name) => name)
        .slice(0, 40)
        .map((value) => h("option", { value })),
    );
  input.addEventListener("input", () => {
    if (all.includes(input.value)) {
      const name = input.value;
      input.value = "";
      chosen(name);
      return;
    }
    offer();
  });
  input.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    const [best] = search(all, input.value, (name) => name);
    if (best) {
      input.value = "";
      chosen(best);
    } else toast(`No parameter "${input.value}"`, "failed");
  });
  offer();
  return h("span.picker", {}, input, list);
}

function one_plot(context, names, minutes, plots, change) {
  const { model, signal } = context;
  const plot = document.createElement("time-plot");
  const data = new PlotData(model, plot, names, minutes * 60000, signal);
  const now = h("button.now", { onclick: () => data.follow(minutes * 60000) }, "Live");
  data.on_follow = (follows) => {
    set_class(now, "on", follows);
    set_text(now, follows ? "Live" : "Back to now");
  };
  const problem = h("p.problem");
  data.on_loaded = () => {
    const failed = data.series.filter((one) => one.error);
    set_text(problem, failed.map((one) => `${one.name}: ${one.error}`).join("; "));
  };
  const marks = h("input", { type: "checkbox", checked: true });
  marks.addEventListener("change", () => {
    data.with_events = marks.checked;
    data.show(plot.range.from, plot.range.to);
  });
  const legend = h(
    "div.legend",
    {},
    ...names.map((name, i) => legend_entry(context, name, i, () => change(names.filter((one) => one !== name)))),
  );
  const add = picker(context, "Add to this plot …", (name) => change([...new Set([...names, name])]));
  const element = h(
    `section.panel.plot.${plots === 1 ? "one" : "several"}`,
    { "aria-label": names.join(", ") },
    h("header", {}, legend, add),
    plot,
    problem,
    h(
      "footer",
      {},
      now,
      range_form(context, minutes, data),
      h("label.check", {}, marks, "Events"),
      h("button.quiet", { onclick: () => save_csv(data.series, plot.range) }, "CSV"),
      h("button.quiet", { onclick: () => change([]) }, "Remove plot"),
    ),
  );
  requestAnimationFrame(() => data.follow(minutes * 60000));
  return element;
}

function legend_entry({ model, signal }, name, index, remove) {
  const value = h("output");
  const update = () => {
    const newest = model.value(name);
    set_text(value, newest ? `${value_text(newest.value)} ${newest.unit}` : "");
  };
  model.on("values", update, signal);
  update();
  return h(
    "span",
    {},
    swatch(index),
    h("a", { href: `#/parameters?show=${name}` }, name),
    value,
    h("button.quiet", { "aria-label": `Remove ${name}`, onclick: remove }, "×"),
  );
}

/** From and to of a plot that stands still. */
function range_form({ model }, minutes, data) {
  const from = h("input.time", { placeholder: "from: 2h or UTC", "aria-label": "From" });
  const to = h("input.time", { placeholder: "to: now or UTC", "aria-label": "To" });
  const show_range = (event) => {
    event.preventDefault();
    const begin = parse_time(from.value || `${minutes}m`, model.now());
    const end = /^(now)?$/.test(to.value.trim()) ? model.now() : parse_time(to.value, model.now());
    if (begin === null || end === null || begin >= end) toast("Times: 10m, 2h, 3d, or UTC as 2026-11-26 20:57; from before to", "failed");
    else data.show(begin, end);
  };
  return h("form", { onsubmit: show_range }, from, to, h("button", {}, "Show"));
}

/** What the plot shows as comma-separated values: time, parameter, value, and minimum and maximum of minutes. */
function save_csv(series, { from, to }) {
  const rows = ["time,parameter,value,min,max,unit"];
  for (const one of series)
    for (const p of one.points)
      if (p.t >= from && p.t <= to)
        rows.push(`${new Date(p.t).toISOString()},${one.name},${p.v ?? ""},${p.low ?? ""},${p.high ?? ""},${one.unit}`);
  download("plot.csv", new Blob([rows.join("\n") + "\n"], { type: "text/csv" }));
}
