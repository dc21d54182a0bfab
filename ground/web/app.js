// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The page's frame: the token, the bar above, the views beside, keys, the palette. Start reading here.

import { Api, ApiError } from "./api.js";
import { dialog, h, set_class, set_text, shape, svg, toast } from "./dom.js";
import { search, span_text, time_text, value_text } from "./format.js";
import { Model } from "./model.js";
import * as commands from "./views/commands.js";
import * as events from "./views/events.js";
import * as files from "./views/files.js";
import * as gaps from "./views/gaps.js";
import * as layouts from "./views/layouts.js";
import * as link from "./views/link.js";
import * as parameters from "./views/parameters.js";
import * as plots from "./views/plots.js";
import * as schedule from "./views/schedule.js";

/** Each view is {title, show(main, context, path, query)}; `icon` is a path in a box of 24. The digit of its place is its key. */
const views = [
  { name: "overview", ...layouts, icon: "M3 3h8v10H3zM13 3h8v6h-8zM13 11h8v10h-8zM3 15h8v6H3z" },
  { name: "parameters", ...parameters, icon: "M3 5h18v2H3zM3 11h18v2H3zM3 17h18v2H3z" },
  { name: "plots", ...plots, icon: "M3 3h2v16h16v2H3zM7 15l4-6 4 3 5-8 1.6 1-6 9.8-4-3L8.6 16z" },
  { name: "commands", ...commands, icon: "M3 4h18v16H3zM5 6v12h14V6zM7 9l4 3-4 3zM12 14h5v2h-5z" },
  { name: "events", ...events, icon: "M12 2 2 21h20zM11 9h2v6h-2zM11 16.5h2v2h-2z" },
  { name: "files", ...files, icon: "M3 5h7l2 2h9v13H3zM5 9v9h14V9zM7 16l3-4 2 2 3-4 3 6z" },
  { name: "schedule", ...schedule, icon: "M12 2a10 10 0 1 0 .01 0zM12 4a8 8 0 1 1-.01 0zM11 6h2v6.2l4 2.4-1 1.7-5-3z" },
  { name: "gaps", ...gaps, icon: "M2 10h7v4H2zM11 10h3v4h-3zM18 10h4v4h-4zM2 4h20v2H2zM2 18h20v2H2z" },
  {
    name: "link",
    ...link,
    icon: "M4 20h16v2H4zM11 12h2v8h-2zM12 4a5 5 0 0 1 5 5h-2a3 3 0 0 0-6 0H7a5 5 0 0 1 5-5zM12 0a9 9 0 0 1 9 9h-2a7 7 0 0 0-14 0H3a9 9 0 0 1 9-9z",
  },
];

const main = document.getElementById("main");
let context = null;
let shown = null; // AbortController of the view that is shown

// --- the token ---

function token_of_address() {
  const match = /^#token=([^&]+)/.exec(location.hash);
  if (match) {
    sessionStorage.setItem("srfs.token", decodeURIComponent(match[1]));
    history.replaceState(null, "", location.pathname + location.search);
  }
  return sessionStorage.getItem("srfs.token") ?? "";
}

function ask_for_token(why) {
  const input = h("input", { type: "password", autocomplete: "off", required: true, "aria-label": "Token" });
  main.replaceChildren(
    h(
      "form.welcome",
      {
        onsubmit: (event) => {
          event.preventDefault();
          sessionStorage.setItem("srfs.token", input.value.trim());
          location.reload();
        },
      },
      h("h1", {}, "SRFS ground"),
      h("p", {}, why),
      h(
        "p.hint",
        {},
        "srfs-ground serve --web prints an address with the token; STATE/web.json has both: one that commands, one that only observes.",
      ),
      input,
      h("button.primary", {}, "Open"),
    ),
  );
  input.focus();
}

// --- the bar ---

function make_bar(model) {
  const bar = document.getElementById("bar");
  const item = (name, title, href) => {
    const value = h("span.value");
    const symbol = h("span.symbol");
    const element = h(`a.item.${name}`, { href, title }, symbol, h("span.name", {}, name), value);
    let kind = null;
    return {
      element,
      set(text, new_kind) {
        set_text(value, text);
        if (kind === new_kind) return;
        kind = new_kind;
        element.className = `item ${name} ${kind ?? ""}`;
        symbol.replaceChildren(...(kind ? [shape(kind)] : []));
      },
    };
  };
  const mode = item("mode", "Mode of the satellite", "#/overview");
  const link_item = item("link", "Line to the station, newest packet", "#/link");
  const limits = item("limits", "Values outside their limits", "#/parameters?only=limits");
  const event = item("events", "Events of severity medium or high that nobody has acknowledged", "#/events?only=open");
  const command = item("command", "Last telecommand", "#/commands");
  const clock = h("time.clock", { title: "UTC, by the server's clock" });
  bar.replaceChildren(
    h(
      "a.brand",
      { href: "#/overview", "aria-label": "Overview" },
      h("img", { src: "icon.svg", alt: "", width: 24, height: 24 }),
      h("span.mission", {}, mission_name(model.dictionary.mission)),
    ),
    mode.element,
    link_item.element,
    limits.element,
    event.element,
    command.element,
    h("span.gap"),
    clock,
    h("button.quiet.find", { onclick: open_palette, title: "Find anything (Ctrl K)" }, "Find", h("kbd", {}, "Ctrl K")),
    h(
      "button.quiet.theme",
      { onclick: next_theme, title: "Dark, light, or as the system (t)", "aria-label": "Colours" },
      svg(
        "svg",
        { viewBox: "0 0 16 16", class: "shape", "aria-hidden": "true" },
        svg("path", { d: "M8 1.5a6.5 6.5 0 1 0 .01 0zM8 3v10a5 5 0 0 0 0-10z", "fill-rule": "evenodd" }),
      ),
    ),
    h("button.quiet", { onclick: show_help, title: "Keys and state of this page (?)", "aria-label": "Help" }, "?"),
  );
  const show = () => show_bar(model, { mode, link: link_item, limits, event, command, clock });
  for (const topic of ["values", "station", "events", "commands", "second", "connection"]) model.on(topic, show);
  show();
}

function mission_name(mission) {
  return mission?.name ?? (mission?.spacecraft_id !== undefined ? `Spacecraft ${mission.spacecraft_id}` : "SRFS");
}

function show_bar(model, items) {
  const { mode, age_ms, stale } = model.mode_news();
  const old = stale && age_ms !== null ? `, ${span_text(age_ms)} ago` : "";
  items.mode.set(mode + old, stale ? "stale" : mode === "nominal" ? "ok" : "yellow");
  const newest = Math.min(...[...model.structures.values()].map((one) => model.age(one)), Infinity);
  if (model.connection.state !== "open") items.link.set("no server", "red");
  else if (model.line === "closed") items.link.set("line closed", "red");
  else if (newest === Infinity) items.link.set("no packet yet", "stale");
  else items.link.set(newest < 3000 ? "live" : `${span_text(newest)} ago`, newest < 15000 ? "ok" : newest < 60000 ? "yellow" : "red");
  const out = model.out_of_limits();
  const red = out.filter((one) => one.limit === "red").length;
  const of_old = out.filter((one) => one.stale).length;
  const count = red ? `${red} red, ${out.length - red} yellow` : `${out.length} yellow`;
  const silent = model.is_silent();
  items.limits.set(
    out.length ? count + (of_old ? `, ${of_old} of old values` : "") : silent ? "old values alone" : "all within",
    red ? "red" : out.length ? "yellow" : silent ? "stale" : "ok",
  );
  const open = model.events.filter((one) => !one.acknowledged && (one.severity === "medium" || one.severity === "high"));
  items.event.set(
    open.length ? `${open.length} open` : "none open",
    open.some((one) => one.severity === "high") ? "red" : open.length ? "yellow" : "ok",
  );
  const last = model.commands[0];
  items.command.set(last ? `${last.name}: ${last.verdict}` : "none", last ? (last.failed ? "failed" : last.final ? "done" : "wait") : null);
  const clock = `${new Date(model.now()).toISOString().slice(0, 19).replace("T", " ")} UTC`;
  set_text(items.clock, clock);
  const title = `${red ? `◆ ${red} red - ` : ""}${context.view_title ?? "SRFS ground"}`; // seen also when another tab is open
  if (document.title !== title) document.title = title;
  show_banner(model);
}

/** What stops an operator, in words, above everything. */
function show_banner(model) {
  const banner = document.getElementById("banner");
  const gone = model.connection.state === "broken" && Date.now() - model.connection.since > 800;
  const text = gone
    ? `The server does not answer, since ${span_text(Date.now() - model.connection.since)}. Values are old; the page goes on when it is back. (srfs-ground serve --web)`
    : model.connection.state === "open" && model.line === "closed"
      ? "The line to the station is closed. The server opens it again as soon as it is there."
      : "";
  banner.hidden = !text;
  set_text(banner, text);
  set_class(document.body, "disconnected", gone);
}

// --- views ---

function make_nav() {
  const nav = document.getElementById("nav");
  nav.replaceChildren(
    ...views.map((view, i) =>
      h(
        "a",
        { href: `#/${view.name}`, title: `${view.title} (${i + 1})`, dataset: { view: view.name } },
        svg("svg", { viewBox: "0 0 24 24", "aria-hidden": "true" }, svg("path", { d: view.icon, "fill-rule": "evenodd" })),
        h("span", {}, view.title),
        h("kbd", {}, String(i + 1)),
      ),
    ),
  );
}

function show_view() {
  const [path, query] = (location.hash.slice(2) || "overview").split("?");
  const [name, ...rest] = path.split("/").map(decodeURIComponent);
  const view = views.find((one) => one.name === name) ?? views[0];
  shown?.abort();
  shown = new AbortController();
  for (const link_of of document.querySelectorAll("#nav a")) {
    if (link_of.dataset.view === view.name) link_of.setAttribute("aria-current", "page");
    else link_of.removeAttribute("aria-current");
  }
  document.title = `${view.title} - SRFS ground`;
  context.view_title = document.title;
  main.className = `view-${view.name}`;
  main.replaceChildren();
  main.scrollTop = 0;
  view.show(main, { ...context, signal: shown.signal }, rest, new URLSearchParams(query));
}

export function go(path) {
  if (location.hash === `#/${path}`) show_view();
  else location.hash = `#/${path}`;
}

function on_address() {
  if (!location.hash.startsWith("#token=")) return show_view();
  token_of_address(); // another token was pasted into the open page
  return location.reload();
}

// --- keys, palette, help ---

function on_key(event) {
  if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "k") {
    event.preventDefault();
    open_palette();
    return;
  }
  if (
    event.ctrlKey ||
    event.metaKey ||
    event.altKey ||
    event.target.matches("input, textarea, select") ||
    document.querySelector("dialog[open]")
  )
    return;
  if (/^[1-9]$/.test(event.key) && views[event.key - 1]) go(views[event.key - 1].name);
  else if (event.key === "/") {
    const field = main.querySelector("input[type=search]");
    if (field) {
      event.preventDefault();
      field.focus();
    }
  } else if (event.key === "t") next_theme();
  else if (event.key === "?") show_help();
}

function open_palette() {
  if (document.querySelector("dialog[open]")) return;
  const { model } = context;
  const items = [
    ...views.map((view) => ({ kind: "view", name: view.title, path: view.name })),
    ...model.dictionary.telecommands.map((one) => ({
      kind: "telecommand",
      name: one.name,
      more: one.description,
      path: `commands/${one.name}`,
    })),
    ...[...model.structures.values()].flatMap((one) =>
      Object.keys(one.fields).map((field) => ({
        kind: "parameter",
        name: `${one.name}.${field}`,
        path: `parameters?show=${one.name}.${field}`,
      })),
    ),
  ];
  const list = h("ul", { role: "listbox", "aria-label": "Found" });
  const input = h("input", {
    type: "search",
    role: "combobox",
    "aria-expanded": "true",
    "aria-label": "Find a view, a telecommand or a parameter",
    placeholder: "View, telecommand or parameter …",
  });
  let found = [],
    at = 0;
  const show = () => {
    found = search(items, input.value, (one) => `${one.name} ${one.kind}`).slice(0, 12);
    at = Math.max(0, Math.min(at, found.length - 1));
    list.replaceChildren(
      ...found.map((one, i) =>
        h(
          "li",
          { role: "option", "aria-selected": String(i === at), onclick: () => choose(i) },
          h("span.kind", {}, one.kind),
          h("strong", {}, one.name),
          one.kind === "parameter" ? h("span.more", {}, value_text(model.value(one.name)?.value)) : h("span.more", {}, one.more ?? ""),
        ),
      ),
    );
  };
  const choose = (i) => {
    box.close();
    if (found[i]) go(found[i].path);
  };
  input.addEventListener("input", () => {
    at = 0;
    show();
  });
  input.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step) {
      event.preventDefault();
      at += step;
      show();
    }
    if (event.key === "Enter") {
      event.preventDefault();
      choose(at);
    }
  });
  const box = dialog("Find", input, list);
  box.classList.add("palette");
  show();
  input.focus();
}

function show_help() {
  const { model } = context;
  const key = (keys, what) => [h("dt", {}, ...keys.split(" ").map((one) => h("kbd", {}, one))), h("dd", {}, what)];
  const ms = (part) => {
    const value = model.latency(part);
    return value === null ? "-" : `${Math.round(value)} ms`;
  };
  const box = dialog(
    "Keys and state",
    h(
      "dl.keys",
      {},
      key("1 … 9", "a view"),
      key("Ctrl+K", "find a view, telecommand or parameter"),
      key("/", "search in the view"),
      key("j k", "next and previous row (or arrows)"),
      key("Enter", "open the row"),
      key("a", "acknowledge the event"),
      key("Ctrl+Enter", "send the telecommand"),
      key("+ - Home", "in a plot: zoom, back to now; arrows move the cursor"),
      key("t", "dark, light, as the system"),
      key("?", "this"),
    ),
    h("h3", {}, "State of this page"),
    h(
      "dl.rows",
      {},
      h("dt", {}, "may"),
      h("dd", {}, model.may_command() ? "observe and command" : "observe"),
      h("dt", {}, "packets taken"),
      h("dd", {}, String(model.packets)),
      h("dt", {}, "packet to paint"),
      h("dd.latency", {}, `half within ${ms(0.5)}, 99 % within ${ms(0.99)} (last ${model.latencies.length})`),
      h("dt", {}, "server's clock"),
      h("dd", {}, `${Math.round(model.clock_ahead_ms)} ms ahead of this browser`),
      h("dt", {}, "open since"),
      h("dd", {}, time_text(new Date(model.connection.since).toISOString())),
    ),
  );
  box.classList.add("help");
}

const themes = ["system", "dark", "light"];
function next_theme() {
  set_theme(themes[(themes.indexOf(localStorage.getItem("srfs.theme") ?? "system") + 1) % themes.length]);
}

const dark_system = matchMedia("(prefers-color-scheme: dark)");
function set_theme(theme) {
  localStorage.setItem("srfs.theme", theme);
  document.documentElement.dataset.theme = theme === "system" ? (dark_system.matches ? "dark" : "light") : theme;
  for (const drawn of document.querySelectorAll("time-plot, attitude-view")) drawn.draw();
}

// --- the start ---

async function start() {
  set_theme(localStorage.getItem("srfs.theme") ?? "system");
  const token = token_of_address();
  if (!token) return ask_for_token("Which token does your station have?");
  const api = new Api(token);
  const model = new Model(api);
  context = { api, model, go, command: (name, values) => go(`commands/${name}?${new URLSearchParams(values)}`) };
  for (;;) {
    try {
      await model.start();
      break;
    } catch (error) {
      if (error instanceof ApiError && error.status === 401) return ask_for_token("The server does not know this token.");
      main.replaceChildren(
        h(
          "div.welcome",
          {},
          h("h1", {}, "SRFS ground"),
          h("p", {}, `${error.message}. Asking again …`),
          h("p.hint", {}, "Does srfs-ground serve --web run?"),
        ),
      );
      await new Promise((resolve) => setTimeout(resolve, 1500));
    }
  }
  globalThis.srfs = { model }; // for the browser's console, and to measure
  make_bar(model);
  make_nav();
  set_class(document.body, "observe", !model.may_command());
  model.on("note", (note) => toast(note.message ?? "", note.problem ? "failed" : "info"));
  model.on("stage", (stage, command) => {
    if (stage.final && model.own.has(stage.token) && !stage.arms)
      toast(`${command.name}: ${command.verdict}`, stage.success === false ? "failed" : "info");
  });
  addEventListener("hashchange", on_address);
  addEventListener("keydown", on_key);
  dark_system.addEventListener("change", () => set_theme(localStorage.getItem("srfs.theme") ?? "system"));
  document.querySelector(".skip").addEventListener("click", (event) => {
    event.preventDefault();
    main.focus();
  });
  show_view();
  document.body.classList.add("ready");
}

start();
