// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// What the archive has and what it misses, on a time line; retrieval from the stores on board.

import { attempt, h, svg, table, toast } from "../dom.js";
import { parse_time, span_text, time_text } from "../format.js";
import { time_step } from "../parts/plot.js";

export const title = "Gaps";
const row_px = 26,
  left_px = 150,
  top_px = 40;
const spans = [
  ["1 h", 1],
  ["6 h", 6],
  ["1 d", 24],
  ["7 d", 168],
  ["30 d", 720],
];

export function show(main, context) {
  const { model, api, signal } = context;
  const state = { hours: 6, gaps: [], passes: [] };
  const retrieval = make_retrieval(context);
  const line = h("div.timeline");
  const body = h("tbody");
  main.append(
    h(
      "div.tools",
      {},
      make_tabs(state, () => load()),
    ),
    retrieval.element,
    h("section.panel", { "aria-label": "Time line" }, h("h2", {}, "Time line"), line),
    h(
      "section.panel",
      { "aria-label": "Gaps" },
      h("h2", {}, "Gaps"),
      table("compact.wide", ["Source", "From", "To", "Missing", "State", "Attempts", ""], body),
    ),
  );
  const draw = () => {
    line.replaceChildren(time_line(state, model.now(), line.clientWidth || 900, retrieval.choose));
    const newest = [...state.gaps].sort((a, b) => (a.from < b.from ? 1 : -1)).slice(0, 300);
    body.replaceChildren(...newest.map((gap) => gap_row(gap, model.now(), retrieval.choose)));
    if (!newest.length) body.append(h("tr", {}, h("td", { colspan: 7 }, "The archive misses nothing that it knows of.")));
  };
  const load = async () => {
    const from = new Date(model.now() - state.hours * 3600000).toISOString();
    const loaded = await attempt(async () => {
      [state.gaps, state.passes] = await Promise.all([api.get("gaps", { from }), api.get("passes", { from })]);
    });
    if (loaded && !signal.aborted) draw();
  };
  const timer = setInterval(load, 10000);
  signal.addEventListener("abort", () => clearInterval(timer));
  new ResizeObserver(() => !signal.aborted && draw()).observe(line);
  load();
}

function make_tabs(state, load) {
  const tabs = h("div.tabs", { role: "group", "aria-label": "Length" });
  const choose = (event, hours) => {
    state.hours = hours;
    for (const one of tabs.children) one.setAttribute("aria-pressed", String(one === event.target));
    load();
  };
  tabs.append(
    ...spans.map(([text, hours]) =>
      h("button", { "aria-pressed": String(hours === state.hours), onclick: (event) => choose(event, hours) }, text),
    ),
  );
  return tabs;
}

function gap_row(gap, now, choose) {
  const around = () => choose(Date.parse(gap.from) - 1000, Date.parse(gap.to) + 1000);
  return h(
    "tr",
    {},
    h("th", { scope: "row" }, gap.source),
    h("td", {}, time_text(gap.from, now)),
    h("td", {}, time_text(gap.to, now)),
    h("td.number", {}, `${gap.missing ?? "unknown"}${gap.count ? ` of ${gap.count}` : ""}`),
    h("td", {}, gap.state),
    h("td.number", {}, String(gap.attempts ?? 0)),
    h("td", {}, h("button.quiet", { onclick: around }, "Choose")),
  );
}

/** The form that orders a retrieval: {element, choose(from, to)}. */
function make_retrieval(context) {
  const { model, api } = context;
  const from = h("input.time", { "aria-label": "From", placeholder: "from: 2h or UTC" });
  const to = h("input.time", { "aria-label": "To", placeholder: "to: UTC, empty: now" });
  const stores = (model.dictionary.stores ?? []).map((one) => one.name ?? one);
  const store = h("select", { "aria-label": "Store" }, ...stores.map((name) => h("option", { value: name }, name)));
  const disabled = !model.may_command();
  const fill = () => attempt(() => api.post("gaps/fill"), "The gaps are being filled, while packets come");
  const order = (event) => {
    event.preventDefault();
    order_retrieval(context, from.value, to.value, store.value);
  };
  const element = h(
    "form.tools",
    { onsubmit: order },
    h("strong", {}, "Retrieve"),
    from,
    to,
    store,
    h("button.primary", { disabled }, "Retrieve"),
    h("button", { type: "button", disabled, onclick: fill }, "Fill all gaps"),
    h("span.hint", {}, "Drag over the time line to choose a time."),
  );
  const text_of = (t) => new Date(t).toISOString().slice(0, 19);
  const choose = (begin, end) => {
    from.value = text_of(begin);
    to.value = text_of(end);
  };
  return { element, choose };
}

function order_retrieval({ api, model }, from_text, to_text, store) {
  const from = parse_time(from_text, model.now());
  const to = to_text.trim() ? parse_time(to_text, model.now()) : model.now();
  if (from === null || to === null || from >= to) {
    toast("Times: 10m, 2h, 3d, or UTC as 2026-11-26 20:57; from before to", "failed");
    return;
  }
  const body = { from: new Date(from).toISOString(), to: new Date(to).toISOString(), store };
  attempt(() => api.post("retrieve", body), `${store} is being retrieved, ${span_text(to - from)}`);
}

/** Rows: contact, then a row for each source with gaps. Gaps are hatched by their state: open, filled, given up. */
function time_line({ hours, gaps, passes }, now, width, choose) {
  const begin = now - hours * 3600000;
  const x = (t) => left_px + ((Math.min(Math.max(t, begin), now) - begin) / (now - begin)) * (width - left_px - 10);
  const sources = [...new Set(gaps.map((gap) => gap.source))].sort();
  const height = top_px + row_px * (sources.length + 1) + 8;
  const drawing = svg("svg", {
    width,
    height,
    class: "lines",
    role: "img",
    "aria-label": `${passes.length} times of contact, ${gaps.length} gaps in ${hours} h`,
  });
  const step = time_step(now - begin, (width - left_px) / 90);
  for (let t = Math.ceil(begin / step) * step; t <= now; t += step) {
    const iso = new Date(t).toISOString();
    drawing.append(
      svg("line", { x1: x(t), x2: x(t), y1: top_px - 8, y2: height, class: "grid-line" }),
      svg("text", { x: x(t), y: 18, class: "tick" }, step >= 86400000 ? iso.slice(5, 10) : iso.slice(11, 16)),
    );
  }
  const row = (i) => top_px + i * row_px;
  drawing.append(svg("text", { x: 8, y: row(0) + 15, class: "label" }, "contact"));
  for (const pass of passes)
    drawing.append(
      bar(
        "pass",
        x(Date.parse(pass.began)),
        x(Date.parse(pass.ended)),
        row(0),
        `contact ${time_text(pass.began)} to ${time_text(pass.ended)}, ${pass.packets} packets`,
      ),
    );
  sources.forEach((source, i) => {
    drawing.append(svg("text", { x: 8, y: row(i + 1) + 15, class: "label" }, source));
    for (const gap of gaps.filter((one) => one.source === source))
      drawing.append(
        bar(
          `gap ${gap.state.replace(/ /g, "-")}`,
          x(Date.parse(gap.from)),
          x(Date.parse(gap.to)),
          row(i + 1),
          `${source}: ${gap.missing ?? "?"} packets missing, ${gap.state}, ${time_text(gap.from)} to ${time_text(gap.to)}`,
        ),
      );
  });
  select_by_drag(drawing, (px) => begin + ((px - left_px) / (width - left_px - 10)) * (now - begin), choose, height);
  return drawing;
}

function bar(kind, x1, x2, y, words) {
  return svg(
    "rect",
    { x: x1, y: y + 3, width: Math.max(3, x2 - x1), height: row_px - 8, rx: 2, class: kind, tabindex: 0 },
    svg("title", {}, words),
  );
}

function select_by_drag(drawing, time_of, choose, height) {
  const mark = svg("rect", { y: top_px - 8, height: height - top_px, width: 0, class: "selection" });
  drawing.append(mark);
  let from = null;
  const at = (event) => event.clientX - drawing.getBoundingClientRect().left;
  drawing.addEventListener("pointerdown", (event) => {
    from = at(event);
    drawing.setPointerCapture(event.pointerId);
  });
  drawing.addEventListener("pointermove", (event) => {
    if (from === null) return;
    mark.setAttribute("x", Math.min(from, at(event)));
    mark.setAttribute("width", Math.abs(at(event) - from));
  });
  drawing.addEventListener("pointerup", (event) => {
    if (from !== null && Math.abs(at(event) - from) > 4) choose(time_of(Math.min(from, at(event))), time_of(Math.max(from, at(event))));
    from = null;
  });
}
