// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Overview: a layout of panels. Those of the page are files (layouts/*.json); those of the operator are in the browser.

import { h } from "../dom.js";
import { edit_layout, layout_problem, make_panel, own_layouts } from "../parts/panels.js";

export const title = "Overview";

async function read_json(path) {
  const response = await fetch(path);
  if (!response.ok) throw new Error(`${path}: ${response.status}`);
  return response.json();
}

export async function show(main, context, [wanted = "overview"]) {
  const own = own_layouts();
  let names = [],
    layout = own[wanted],
    problem = "";
  try {
    names = await read_json("layouts/index.json");
    if (!layout) layout = await read_json(`layouts/${encodeURIComponent(wanted)}.json`);
    problem = layout.title && Array.isArray(layout.panels) ? "" : layout_problem(layout, context.model);
  } catch (error) {
    problem = `The layout "${wanted}" cannot be read: ${error.message}`;
  }
  if (context.signal.aborted) return;
  const all = [...new Set([...names, ...Object.keys(own)])];
  const tabs = h(
    "div.tabs",
    { role: "group", "aria-label": "Layouts" },
    ...all.map((name) =>
      h(
        "a",
        { href: `#/overview/${name}`, "aria-current": name === wanted ? "page" : null },
        own[name] ? `${own[name].title} *` : name === wanted && layout ? layout.title : name,
      ),
    ),
    h(
      "button.quiet",
      { onclick: () => edit_layout(context, wanted, layout ?? { title: "New", panels: [] }, (name) => context.go(`overview/${name}`)) },
      "Edit layout",
    ),
  );
  if (problem) {
    main.append(tabs, h("p.problem", {}, problem));
    return;
  }
  main.append(tabs, h("div.grid", {}, ...layout.panels.map((options) => make_panel(context, options))));
}
