// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Events, newest first, with filters and acknowledgement.

import { h, set_text, shape, table, toast, walk_by_keys } from "../dom.js";
import { time_text } from "../format.js";
import { severity_rank, severity_shape } from "../parts/panels.js";

export const title = "Events";
const shown_max = 400;

export function show(main, context, path, query) {
  const { model, signal } = context;
  const filter = make_filter(query);
  const count = h("span.hint", { role: "status" });
  const body = h("tbody");
  const wanted = () => model.events.filter(filter.wants);
  const all = h(
    "button",
    {
      onclick: () =>
        acknowledge(
          context,
          wanted()
            .slice(0, shown_max)
            .filter((one) => !one.acknowledged),
        ),
    },
    "Acknowledge all shown",
  );
  main.append(
    h("div.tools", {}, ...filter.elements, operator_input(), all, count),
    table("events", ["", "Time (UTC)", "Severity", "Source", "Event", "Text", ""], body),
    h("button.quiet", { onclick: () => load_older(context) }, "Older ones"),
  );
  const nothing = h("tr", {}, h("td", { colspan: 7 }, "No such event."));
  const rows = new Map(); // event -> {state, element}: a row that did not change stays
  const row_of = (event) => {
    const state = JSON.stringify(event.acknowledged ?? null) + event.id;
    if (rows.get(event)?.state !== state) rows.set(event, { state, element: event_row(context, event) });
    return rows.get(event).element;
  };
  const update = () => {
    const events = wanted();
    if (rows.size > 5000) rows.clear();
    replace_rows(body, events.length ? events.slice(0, shown_max).map(row_of) : [nothing]);
    set_text(count, `${events.length} events${events.length > shown_max ? `, ${shown_max} shown` : ""}`);
  };
  filter.on_change = update;
  walk_by_keys(body, "tr");
  model.on("events", update, signal);
  update();
}

/** {elements, wants(event), on_change} */
function make_filter(query) {
  const input = h("input", { type: "search", placeholder: "Filter by text, name or source  /", "aria-label": "Filter" });
  const texts = { info: "all severities", low: "low and above", medium: "medium and above", high: "high" };
  const severity = h(
    "select",
    { "aria-label": "Least severity" },
    ...Object.entries(texts).map(([value, text]) => h("option", { value }, text)),
  );
  const open_only = h("input", { type: "checkbox" });
  open_only.checked = query.get("only") === "open";
  if (open_only.checked) severity.value = "medium";
  const filter = { elements: [input, severity, h("label.check", {}, open_only, "not acknowledged")] };
  filter.wants = (event) => {
    const text = `${event.text} ${event.event} ${event.source}`.toLowerCase();
    const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
    return (
      severity_rank(event.severity) >= severity_rank(severity.value) &&
      !(open_only.checked && event.acknowledged) &&
      words.every((word) => text.includes(word))
    );
  };
  for (const control of [input, severity, open_only]) control.addEventListener("input", () => filter.on_change());
  return filter;
}

/** Who acknowledges; kept in this browser. */
function operator_input() {
  const input = h("input.operator", {
    placeholder: "Your name",
    "aria-label": "Your name, for acknowledgements",
    maxlength: 60,
    value: localStorage.getItem("srfs.operator") ?? "",
  });
  input.addEventListener("input", () => localStorage.setItem("srfs.operator", input.value.trim()));
  return input;
}

/** Only when they differ; the focus stays at its place. */
function replace_rows(body, rows) {
  if (rows.length === body.children.length && rows.every((row, i) => body.children[i] === row)) return;
  const at = [...body.children].indexOf(document.activeElement?.closest("tr"));
  body.replaceChildren(...rows);
  if (at >= 0) body.children[Math.min(at, body.children.length - 1)]?.focus();
}

function event_row(context, event) {
  const ack = event.acknowledged
    ? h(
        "span.hint",
        { title: `by ${event.acknowledged.who}, ${event.acknowledged.time}` },
        shape("done", "acknowledged"),
        time_text(event.acknowledged.time),
      )
    : h("button.quiet.ack", { onclick: () => acknowledge(context, [event]), disabled: !context.model.may_command() }, "Acknowledge");
  return h(
    `tr.${event.severity}`,
    {
      tabindex: 0,
      onkeydown: (pressed) => {
        if (pressed.key === "a" && !event.acknowledged) acknowledge(context, [event]);
      },
    },
    h("td", {}, shape(severity_shape(event.severity))),
    h("td", {}, h("time", {}, time_text(event.time, context.model.now()))),
    h("td", {}, event.severity),
    h("td", {}, event.source),
    h("td.name", {}, event.event ?? ""),
    h("td.text", {}, event.text ?? ""),
    h("td", {}, ack),
  );
}

async function acknowledge({ api, model }, events) {
  for (const event of events) {
    if (event.id === undefined) await model.load_events(); // the archive gives it its number
    const known = model.events.find((one) => one.apid === event.apid && one.sequence === event.sequence && one.time === event.time);
    if (known?.id === undefined) continue;
    try {
      const answer = await api.post(`events/${known.id}/acknowledge`, { who: localStorage.getItem("srfs.operator") || "web" });
      known.acknowledged = { who: answer.who, time: new Date(model.now()).toISOString() };
    } catch (error) {
      if (error.status === 409)
        await model.load_events(); // somebody was faster
      else toast(`The event cannot be acknowledged: ${error.message}`, "failed");
      if (error.status !== 409) break;
    }
  }
  model.changed("events");
}

async function load_older({ api, model }) {
  const oldest = model.events.at(-1);
  const older = await api.get("events", { to: oldest?.time, limit: 500 }).catch((error) => {
    toast(error.message, "failed");
    return [];
  });
  const before = model.events.length;
  for (const event of older) model.take("event", event);
  if (model.events.length === before) toast("There are no older events in the archive");
}
