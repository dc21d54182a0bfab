// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Telecommands: the list, the form of one, and what became of those that were sent.

import { h, set_class, set_text, shape, walk_by_keys } from "../dom.js";
import { search, span_text, time_text } from "../format.js";
import { CommandForm } from "../parts/command_form.js";
import { verdict } from "../parts/panels.js";

export const title = "Commands";

export function show(main, context, [name], query) {
  const list = h("div.telecommands", { "aria-label": "Telecommands" });
  const form = h("div.form");
  const history = h("section.panel.history", { "aria-label": "History" });
  main.append(h("div.columns", {}, list, form, history));
  make_list(context, list, name);
  show_form(context, form, name, Object.fromEntries(query));
  make_history(context, history);
}

function make_list(context, element, chosen) {
  const { model, signal } = context;
  const input = h("input", { type: "search", placeholder: "Find a telecommand  /", "aria-label": "Find a telecommand" });
  const list = h("ul");
  const rows = new Map(
    model.dictionary.telecommands.map((one) => {
      const reason = h("span.reason");
      const link = h(
        "a",
        { href: `#/commands/${one.name}`, title: one.description, "aria-current": one.name === chosen ? "true" : null },
        one.hazardous ? shape("red", "hazardous") : h("span.shape"),
        h("span", {}, one.name),
        reason,
      );
      return [one.name, { telecommand: one, reason, element: h("li", {}, link), link }];
    }),
  );
  const filter = () => {
    const found = search(model.dictionary.telecommands, input.value, (one) => `${one.name} ${one.description}`);
    list.replaceChildren(...found.map((one) => rows.get(one.name).element));
    if (!found.length) list.replaceChildren(h("li.hint", {}, "No such telecommand."));
  };
  const refuse = () => {
    for (const row of rows.values()) {
      const why = model.refusal(row.telecommand);
      set_text(row.reason, why);
      set_class(row.element, "refused", why);
    }
  };
  input.addEventListener("input", filter);
  input.addEventListener("keydown", (event) => {
    if (event.key === "Enter") list.querySelector("a")?.click();
  });
  walk_by_keys(list, "a");
  for (const topic of ["values", "station", "connection"]) model.on(topic, refuse, signal);
  filter();
  refuse();
  element.replaceChildren(input, list);
  list.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" });
}

function show_form(context, element, name, values) {
  const telecommand = context.model.telecommand_of.get(name);
  if (!telecommand) {
    element.replaceChildren(
      h(
        "p.hint.empty",
        {},
        name
          ? `The dictionary has no telecommand "${name}".`
          : "Choose a telecommand. It is checked against the dictionary while you fill it in, and nothing is sent before you say so.",
      ),
    );
    return;
  }
  const form = new CommandForm(context, telecommand, values);
  element.replaceChildren(form.element);
  if (matchMedia("(min-width: 60em)").matches) form.element.querySelector("input, select")?.focus({ preventScroll: true });
}

function make_history(context, element) {
  const { model, signal } = context;
  const body = h("ol.sent");
  element.append(h("h2", {}, "Sent"), body);
  const open = new Set();
  const shown = new Map();
  const update = () => {
    if (shown.size > 2000) shown.clear();
    const now = model.commands.slice(0, 100).map((command) => {
      const key = `${command.request} ${command.name} ${command.sent.slice(0, 16)}`;
      const state = `${command.verdict} ${command.stages.length} ${(command.arguments ?? []).join()} ${open.has(key)}`;
      const known = shown.get(key);
      if (known?.state === state) return known.element;
      const row = history_row(context, command, open.has(key), () => {
        open.has(key) ? open.delete(key) : open.add(key);
        update();
      });
      shown.set(key, { state, element: row });
      return row;
    });
    if (now.some((row, i) => body.children[i] !== row) || body.children.length !== now.length) {
      const focus = [...body.children].findIndex((row) => row.contains(document.activeElement));
      body.replaceChildren(...(now.length ? now : [h("li.hint", {}, "Nothing was sent yet.")]));
      if (focus >= 0) body.children[focus]?.querySelector("button")?.focus();
    }
  };
  model.on("commands", update, signal);
  update();
}

function history_row(context, command, is_open, toggle) {
  const ended = command.stages.at(-1);
  const took = ended ? span_text(Math.max(0, ended.elapsed_ms ?? Date.parse(ended.time) - Date.parse(command.sent))) : "";
  const row = h(
    "li",
    {
      dataset: {
        request: command.request ?? "",
        name: command.name,
        verdict: command.final ? (command.failed ? "failed" : "completed") : "open",
      },
    },
    h(
      "button.row",
      { onclick: toggle, "aria-expanded": String(is_open) },
      verdict(command),
      h("time", {}, time_text(command.sent, context.model.now())),
      h("strong", {}, command.name),
      h("span.arguments", {}, (command.arguments ?? []).join(" ")),
      h("span.word", {}, command.verdict),
      h("span.took", {}, took),
    ),
  );
  if (!is_open) return row;
  const stages = [{ stage: "sent", time: command.sent }, ...command.stages];
  row.append(
    h(
      "div.stages",
      {},
      h(
        "ol",
        {},
        ...stages.map((stage) =>
          h(
            "li",
            {},
            shape(/fail|reject|timed|not_sent|unknown/.test(stage.stage) ? "failed" : "done"),
            h("span", {}, stage.stage + (stage.step !== undefined && stage.step !== null ? ` ${stage.step}` : "")),
            h("time", {}, stage.time.slice(11, 23)),
            stage.text ? h("span.text", {}, `${stage.name ?? ""} ${stage.text}`) : null,
          ),
        ),
      ),
      h(
        "p.hint",
        {},
        [`request ${command.request}`, command.ad ? "AD service" : "", command.who ? `by ${command.who}` : ""].filter(Boolean).join(", "),
      ),
      h("button.quiet", { onclick: () => context.command(command.name, argument_values(command)) }, "Fill in again"),
    ),
  );
  return row;
}

function argument_values(command) {
  return Object.fromEntries((command.arguments ?? []).map((text) => [text.slice(0, text.indexOf("=")), text.slice(text.indexOf("=") + 1)]));
}
