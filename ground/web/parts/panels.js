// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The panels of layouts (layouts/*.json): {"panel": NAME, "width": 1 to 12, ...}. Each is a function (context, options) that returns an element
// and keeps it current until context.signal. context: {model, api, signal, go(path), command(name, arguments)}.

import { dialog, h, limit_shape, panel, set_class, set_text, shape } from "../dom.js";
import { breakable, span_text, time_text, value_text, version_text } from "../format.js";
import "./attitude.js";
import { swatch } from "./plot.js";
import { PlotData } from "./plot_data.js";

/** Makes what @p options describes. Another name than the known ones is shown as such: a layout may be of a newer page. */
export function make_panel(context, options) {
  const make = panels[options.panel];
  const element = make
    ? make(context, options)
    : panel(
        options.title ?? "Unknown panel",
        h("p.hint", {}, `This page has no panel "${options.panel}". It has ${Object.keys(panels).join(", ")}.`),
      );
  element.classList.add(`width-${Math.min(12, Math.max(1, options.width ?? 4))}`);
  return element;
}

function follow(context, topics, show) {
  for (const topic of topics) context.model.on(topic, show, context.signal);
  show();
}

// --- rows of name and value, made once and changed in place ---

class Rows {
  constructor(kind = "plain") {
    this.element = h(`dl.rows.${kind}`);
    this.rows = new Map();
  }

  set(name, text, { kind = "", title = "" } = {}) {
    let row = this.rows.get(name);
    if (!row) {
      row = { symbol: h("span.symbol"), text: h("span"), kind: null };
      row.value = h("dd", {}, row.symbol, row.text);
      this.rows.set(name, row);
      this.element.append(h("dt", {}, name), row.value);
    }
    set_text(row.text, text);
    if (row.kind !== kind) {
      row.kind = kind;
      row.value.className = kind;
      row.symbol.replaceChildren(...(kind ? [shape(kind)] : []));
    }
    if (title) row.value.title = title;
  }
}

function health_panel(context, options) {
  const { model } = context;
  const mode = h("div.big");
  const why = h("div.why");
  const rows = new Rows();
  follow(context, ["values", "second"], () => {
    const field = (name) => model.field("health", name);
    const { mode: now, age_ms, stale } = model.mode_news();
    const old = stale && age_ms !== null ? `, ${span_text(age_ms)} ago` : "";
    mode.replaceChildren(shape(stale ? "stale" : now === "nominal" ? "ok" : "yellow"), h("span", {}, now + old));
    set_class(mode, "yellow", now !== "nominal" && !stale);
    set_text(
      why,
      [field("reason") ?? model.field("beacon", "mode_reason"), field("since") ? `since ${time_text(field("since"))}` : ""]
        .filter(Boolean)
        .join(", ") || "no report of the health yet",
    );
    rows.set("commanded", field("commanded") ?? "unknown");
    rows.set("present causes", field("present") || "none", { kind: field("present") ? "yellow" : "" });
    rows.set("shed", field("shed") || "nothing", { kind: field("shed") ? "yellow" : "" });
    const waiting = Object.entries(model.structures.get("health")?.fields ?? {})
      .filter(([name, value]) => name.startsWith("node_obeys.") && value === "pending")
      .map(([name]) => name.slice(11));
    rows.set("does not obey yet", waiting.join(", ") || "none", { kind: waiting.length ? "yellow" : "" });
    rows.set(
      "boots, last cause",
      `${value_text(model.field("beacon", "boot_count"))}, ${value_text(model.field("beacon", "reset_cause"))}`,
    );
  });
  return panel(options.title ?? "Mode and why", mode, why, rows.element);
}

function next_panel(context, options) {
  const { model } = context;
  const rows = new Rows();
  follow(context, ["values", "second"], () => {
    const health = model.structures.get("health");
    const beacon = model.structures.get("beacon");
    const left = (structure, name) =>
      structure && typeof structure.fields[name] === "number" ? structure.fields[name] * 1000 - model.age(structure) : null;
    const step = left(health, "next_in_s");
    rows.set("automatic step", health?.fields.next || "none known");
    rows.set("in", step === null ? (health?.fields.next ? "waits for a measurement" : "-") : span_text(Math.max(0, step)));
    const loss = left(beacon, "command_loss_s");
    rows.set("command loss in", loss === null ? "unknown" : span_text(Math.max(0, loss)), {
      kind: loss !== null && loss < 3600000 ? "yellow" : "",
    });
    const due = left(beacon, "next_scheduled_in_s");
    rows.set(
      "next scheduled",
      due === null ? "none" : `function ${beacon.fields.next_scheduled_function} in ${span_text(Math.max(0, due))}`,
    );
  });
  return panel(options.title ?? "Next", rows.element);
}

function link_panel(context, options) {
  const { model } = context;
  const rows = new Rows("marked"); // each with room for a symbol
  follow(context, ["station", "values", "second", "connection"], () => {
    const { stats, cop } = model;
    const newest = Math.min(...[...model.structures.values()].map((one) => model.age(one)), Infinity);
    rows.set("line", model.line, { kind: model.line === "open" ? "ok" : "red" });
    const locked = stats.locked ?? model.station.locked;
    rows.set(
      "frames",
      `${locked ? "in step" : "none"}; ${stats.frames ?? 0}, ${stats.bad_frames ?? 0} bad, ${stats.lost_frames ?? 0} lost`,
      { kind: locked ? (stats.bad_frames || stats.lost_frames ? "yellow" : "ok") : "red" },
    );
    if (stats.authenticated) {
      const refused = (stats.forged_frames ?? 0) + (stats.replayed_frames ?? 0) + (stats.old_frames ?? 0);
      rows.set("authentic", `${stats.frames ?? 0} verified, ${refused} refused`, {
        kind: refused ? "red" : "ok",
        title: `${stats.forged_frames ?? 0} forged, ${stats.replayed_frames ?? 0} replayed, ${stats.old_frames ?? 0} too old`,
      });
    }
    rows.set("last packet", newest === Infinity ? "never" : `${span_text(newest)} ago`, {
      kind: newest > 60000 ? "red" : newest > 15000 ? "yellow" : "ok",
    });
    rows.set("AD service", `${cop.service ?? "unknown"}${cop.outstanding ? `, ${cop.outstanding} outstanding` : ""}`, {
      kind: cop.problem ? "yellow" : "",
      title: cop.problem ?? "",
    });
    const clcw = cop.clcw;
    rows.set("FARM-1", clcw ? `V(R) ${clcw.vr}${clcw.lockout ? ", LOCKOUT" : ""}${clcw.wait ? ", wait" : ""}` : "no CLCW", {
      kind: clcw?.lockout ? "red" : "",
    });
    rows.set("keys", keys_text(model.keys));
  });
  return panel(options.title ?? "Link", rows.element);
}

export function keys_text(keys) {
  if (!keys) return "unknown";
  const set = typeof keys === "string" ? keys : keys.set;
  if (set) return `set ${set}`;
  return keys["sdls_spi.bd"] === undefined ? "unknown" : `SPI ${keys["sdls_spi.bd"]}`; // as the beacon says; the server has not changed them
}

function limits_panel(context, options) {
  const { model } = context;
  const list = h("ul.limits");
  const count = h("span.count");
  let shown = "";
  follow(context, ["values"], () => {
    const out = model.out_of_limits();
    const text = out.map((one) => `${one.name}=${value_text(one.value)}${one.limit}`).join();
    if (text === shown && shown) return;
    shown = text;
    set_text(count, out.length ? String(out.length) : "");
    list.replaceChildren(
      ...(out.length
        ? out
            .slice(0, options.most ?? 30)
            .map((one) =>
              h(
                `li.${one.limit}`,
                {},
                h(
                  "a",
                  { href: `#/parameters?show=${one.name}` },
                  limit_shape(one.limit),
                  h("span.name", {}, breakable(one.name)),
                  h("span.value", {}, `${value_text(one.value)} ${one.unit}`),
                  h("span.word", {}, one.limit),
                ),
              ),
            )
        : [h("li.none", {}, shape("ok"), "All values are within their limits.")]),
    );
    if (out.length > (options.most ?? 30))
      list.append(h("li", {}, h("a", { href: "#/parameters?only=limits" }, `${out.length - (options.most ?? 30)} more`)));
  });
  const element = panel(options.title ?? "Limits out", list);
  element.querySelector("h2").append(count);
  return element;
}

/** Words and shapes of the states of nodes. */
const state_shapes = { active: "ok", inactive: "yellow", unconfigured: "yellow", transition: "wait", absent: "red", finalized: "red" };

export function nodes_of(model) {
  const fields = model.structures.get("beacon")?.fields ?? {};
  return Object.keys(fields)
    .filter((name) => name.startsWith("node_state."))
    .map((name) => {
      const node = name.slice(11);
      return {
        node,
        state: fields[name],
        restarts: fields[`node_restarts.${node}`],
        version: version_text(fields[`node_version.${node}`]),
        obeys: model.field("health", `node_obeys.${node}`),
        shape: state_shapes[fields[name]] ?? "stale",
      };
    });
}

function nodes_panel(context, options) {
  const { model } = context;
  const body = h("tbody");
  let shown = "";
  follow(context, ["values"], () => {
    const nodes = nodes_of(model);
    const text = JSON.stringify(nodes);
    if (text === shown) return;
    shown = text;
    body.replaceChildren(
      ...nodes.map((one) =>
        h(
          "tr",
          {},
          h("th", { scope: "row" }, one.node),
          h(`td.state.${one.shape}`, {}, shape(one.shape), one.state),
          h("td.number", { class: one.restarts ? "number attention" : "number" }, value_text(one.restarts)),
          h("td", {}, one.obeys === "no_order" ? "-" : (one.obeys ?? "-")),
          h("td.number", {}, one.version),
        ),
      ),
    );
    if (!nodes.length) body.replaceChildren(h("tr", {}, h("td", { colspan: 5 }, "No beacon yet. It comes every 30 s, in every mode.")));
  });
  return panel(
    options.title ?? "Nodes of the ring",
    h(
      "table.compact",
      {},
      h("thead", {}, h("tr", {}, ...["Node", "State", "Restarts", "Obeys", "Version"].map((name) => h("th", { scope: "col" }, name)))),
      body,
    ),
  );
}

/** Of the reports that ring.report_faults orders, each once. */
function deaths_of_ledger(model) {
  const faults = new Map((model.reports.get("ring_fault") ?? []).map((packet) => [packet.fields.sequence, packet.fields]));
  return [...faults.values()]
    .filter((f) => !f.recovered)
    .map((f) => ({
      node: f.node,
      t: Number(f.utc_s) * 1000,
      words: [
        f.cause || f.fault,
        `found by ${f.observer}`,
        f.outcome,
        typeof f.active_ms === "number" ? `active again after ${span_text(f.active_ms)}` : "",
      ]
        .filter(Boolean)
        .join("; "),
    }));
}

function deaths_of_events(model) {
  return model.events
    .filter((event) => event.event === "ring.node_restarted" || event.event === "ring.version_failed")
    .map((event) => ({ node: event.fields?.node ?? "", t: Date.parse(event.time), words: event.text }));
}

function deaths_panel(context, options) {
  const { model } = context;
  const list = h("ol.deaths");
  const hint = h("p.hint");
  follow(context, ["reports", "events"], () => {
    const deaths = [...deaths_of_ledger(model), ...deaths_of_events(model)].sort((a, b) => b.t - a.t).slice(0, options.most ?? 8);
    list.replaceChildren(
      ...deaths.map((one) =>
        h(
          "li",
          {},
          shape("red"),
          h("strong", {}, one.node),
          h("time", {}, time_text(new Date(one.t).toISOString(), model.now())),
          h("span", {}, one.words),
        ),
      ),
    );
    set_text(hint, deaths.length ? "" : "No death is known here.");
  });
  const ask = h("button.quiet", { onclick: () => context.command("ring.report_faults", {}) }, "Ask for the ledger");
  return panel(options.title ?? "Last deaths", list, hint, ask);
}

function values_panel(context, options) {
  const { model } = context;
  const body = h("tbody");
  const rows = options.parameters.map((name) => {
    const row = { name, value: h("td.number.value"), unit: h("td.unit"), state: h("td.state"), limit: null };
    row.element = h(
      "tr",
      {},
      h(
        "th",
        { scope: "row" },
        h(
          "a",
          { href: `#/parameters?show=${name}`, title: name },
          (options.names ?? {})[name] ?? breakable(name.slice(name.indexOf(".") + 1)),
        ),
      ),
      row.value,
      row.unit,
      row.state,
    );
    return row;
  });
  body.append(...rows.map((row) => row.element));
  follow(context, ["values", "second"], () =>
    rows.forEach((row) => {
      const newest = model.value(row.name);
      set_text(row.value, newest ? value_text(newest.value) : "no value yet");
      set_text(row.unit, newest?.unit ?? "");
      const limit = newest?.limit === "red" || newest?.limit === "yellow" ? newest.limit : "";
      const state = newest?.stale ? "stale" : limit;
      set_class(row.element, "stale", newest?.stale);
      if (row.limit !== state) {
        row.limit = state;
        row.value.className = `number value ${limit}`;
        row.state.replaceChildren(...(state ? [shape(state), state] : []));
      }
    }),
  );
  return panel(options.title ?? "Values", h("table.compact.values", {}, body));
}

function plot_panel(context, options) {
  const plot = document.createElement("time-plot");
  const span_ms = (options.minutes ?? 10) * 60000;
  const data = new PlotData(context.model, plot, options.parameters, span_ms, context.signal);
  requestAnimationFrame(() => data.follow(span_ms));
  const legend = h("div.legend", {}, ...options.parameters.map((name, i) => h("span", {}, swatch(i), name.slice(name.indexOf(".") + 1))));
  const open = h("a.quiet", { href: `#/plots?p=${options.parameters.join(",")}` }, "Open");
  const element = panel(options.title ?? options.parameters.join(", "), plot, legend);
  element.classList.add("plot");
  element.querySelector("h2").append(open);
  return element;
}

/** The structure that has a quaternion: {structure, prefix}; undefined: none has come. */
function attitude_source(model) {
  for (const newest of model.structures.values())
    for (const field of Object.keys(newest.fields)) if (field.endsWith("attitude.w")) return { newest, prefix: field.slice(0, -1) };
  return undefined;
}

function attitude_panel(context, options) {
  const { model } = context;
  const view = document.createElement("attitude-view");
  const rows = new Rows();
  let shown = null;
  follow(context, ["values"], () => {
    const source = attitude_source(model);
    if (!source || shown === source.newest.time) return;
    shown = source.newest.time;
    const fields = source.newest.fields;
    const vector = (name) => (typeof fields[`${name}.x`] === "number" ? ["x", "y", "z"].map((axis) => fields[`${name}.${axis}`]) : null);
    const q = ["x", "y", "z", "w"].map((axis) => fields[source.prefix + axis]);
    if (q.some((part) => typeof part !== "number")) return;
    view.show({
      q,
      sun: vector("sun_vector"),
      field: vector("magnetic_field_t"),
      eclipse: fields.in_eclipse,
      stale: model.is_stale(source.newest),
    });
    const limit = source.newest.limits.pointing_error_deg;
    rows.set("pointing error", `${value_text(fields.pointing_error_deg)} deg`, {
      kind: limit === "red" || limit === "yellow" ? limit : "",
    });
    rows.set("rate", `${value_text(fields.rate_deg_s)} deg/s`);
    rows.set("mode", value_text(fields.mode));
    rows.set("sun", fields.in_eclipse ? "in eclipse" : "in sight");
  });
  const element = panel(options.title ?? "Attitude", view, rows.element);
  element.classList.add("attitude");
  return element;
}

function events_panel(context, options) {
  const { model } = context;
  const list = h("ol.events");
  follow(context, ["events"], () => {
    const wanted = model.events.filter((event) => !options.severity || severity_rank(event.severity) >= severity_rank(options.severity));
    list.replaceChildren(
      ...wanted
        .slice(0, options.most ?? 40)
        .map((event) =>
          h(
            `li.${event.severity}`,
            {},
            shape(severity_shape(event.severity), event.severity),
            h("time", {}, time_text(event.time, model.now())),
            h("span.text", {}, event.text),
            h("span.source", {}, event.source),
          ),
        ),
    );
    if (!wanted.length) list.replaceChildren(h("li", {}, "No event yet."));
  });
  const element = panel(options.title ?? "Events", list);
  element.classList.add("list");
  element.querySelector("h2").append(h("a.quiet", { href: "#/events" }, "All"));
  return element;
}

const severities = ["info", "low", "medium", "high"];
export const severity_rank = (severity) => severities.indexOf(severity);
export const severity_shape = (severity) => ({ info: "info", low: "info", medium: "yellow", high: "red" })[severity] ?? "info";

function commands_panel(context, options) {
  const { model } = context;
  const list = h("ol.recent");
  follow(context, ["commands"], () => {
    list.replaceChildren(
      ...model.commands
        .slice(0, options.most ?? 40)
        .map((command) =>
          h(
            "li",
            {},
            verdict(command),
            h("time", {}, time_text(command.sent, model.now())),
            h("span.text", {}, `${command.name} ${(command.arguments ?? []).join(" ")}`),
            h("span.word", {}, command.verdict ?? ""),
          ),
        ),
    );
    if (!model.commands.length) list.replaceChildren(h("li", {}, "No telecommand yet."));
  });
  const element = panel(options.title ?? "Telecommands", list);
  element.classList.add("list");
  element.querySelector("h2").append(h("a.quiet", { href: "#/commands" }, "Send"));
  return element;
}

export function verdict(command) {
  if (command.failed) return shape("failed", "failed");
  if (command.final) return shape("done", "completed");
  return shape("wait", "in progress");
}

export const panels = {
  health: health_panel,
  next: next_panel,
  link: link_panel,
  limits: limits_panel,
  nodes: nodes_panel,
  deaths: deaths_panel,
  values: values_panel,
  plot: plot_panel,
  attitude: attitude_panel,
  events: events_panel,
  commands: commands_panel,
};

// --- layouts ---

const own_key = "srfs.layouts";

/** Layouts of the operator's own, in this browser: name -> layout. */
export function own_layouts() {
  try {
    return JSON.parse(localStorage.getItem(own_key)) ?? {};
  } catch {
    return {};
  }
}

export function keep_layout(name, layout) {
  const layouts = own_layouts();
  if (layout) layouts[name] = layout;
  else delete layouts[name];
  localStorage.setItem(own_key, JSON.stringify(layouts));
}

/** Why @p layout cannot be shown; empty: it can. */
export function layout_problem(layout, model) {
  if (!layout || typeof layout.title !== "string" || !Array.isArray(layout.panels)) return 'a layout is {"title": TEXT, "panels": [...]}';
  for (const one of layout.panels) {
    if (!panels[one.panel]) return `no panel "${one.panel}"; there are ${Object.keys(panels).join(", ")}`;
    for (const name of one.parameters ?? []) {
      const dot = name.indexOf(".");
      if (!model.definition(name.slice(0, dot), name.slice(dot + 1))) return `no parameter "${name}"`;
    }
    if (["values", "plot"].includes(one.panel) && !one.parameters?.length) return `"${one.panel}" needs "parameters"`;
  }
  return "";
}

/** A dialog that changes a layout as JSON, and keeps it in this browser. */
export function edit_layout(context, name, layout, done) {
  const text = h("textarea", { rows: 22, spellcheck: "false", "aria-label": "Layout as JSON", value: JSON.stringify(layout, null, 2) });
  const title = h("input", { value: name, "aria-label": "Name", pattern: "[a-z0-9_-]+", required: true });
  const problem = h("p.problem", { role: "alert" });
  const read = () => {
    let value;
    try {
      value = JSON.parse(text.value);
    } catch (error) {
      set_text(problem, error.message);
      return null;
    }
    const why = layout_problem(value, context.model) || (title.validity.valid ? "" : "the name has letters, digits, _ and - only");
    set_text(problem, why);
    return why ? null : value;
  };
  const box = dialog(
    "Layout",
    h("label", {}, "Name", title),
    text,
    problem,
    h(
      "footer",
      {},
      h(
        "button.primary",
        {
          onclick: () => {
            const value = read();
            if (value) {
              keep_layout(title.value, value);
              box.close();
              done(title.value);
            }
          },
        },
        "Keep in this browser",
      ),
      h(
        "button",
        {
          onclick: () => {
            const value = read();
            if (value) download(`${title.value}.json`, new Blob([JSON.stringify(value, null, 2)]));
          },
        },
        "Download",
      ),
      h(
        "button",
        {
          onclick: () => {
            keep_layout(name, null);
            box.close();
            done(name);
          },
        },
        "Forget my copy",
      ),
    ),
  );
}

/** Hands octets to the browser as a file. */
export function download(name, blob) {
  const url = URL.createObjectURL(blob);
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
