// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The schedule on board, as the spacecraft reported it last.

import { attempt, h, set_text, table } from "../dom.js";
import { span_text, time_text } from "../format.js";

export const title = "Schedule";

export async function show(main, context) {
  const { model, api, signal } = context;
  const ask = () => attempt(() => api.post("telecommands", { name: "schedule.detail_all", arguments: {} }));
  const form = (name, text) => h("button", { onclick: () => context.command(name, {}) }, text);
  const age = h("span.hint", { role: "status" });
  const body = h("tbody");
  main.append(
    h(
      "div.tools",
      {},
      h("button.primary", { onclick: ask, disabled: !model.may_command() }, "Ask the spacecraft"),
      form("schedule.enable", "Enable …"),
      form("schedule.disable", "Disable …"),
      form("schedule.shift_all", "Shift all …"),
      form("schedule.reset", "Delete all …"),
      age,
    ),
    h(
      "section.panel",
      { "aria-label": "Activities" },
      h("h2", {}, "Activities"),
      table("compact.wide", ["Release (UTC)", "In", "Telecommand", "Group", "Request", ""], body),
    ),
    h("p.hint", {}, 'A telecommand is scheduled by its form: fill in "when".'),
  );
  const update = () => {
    const activities = model.schedule?.activities ?? [];
    set_text(age, model.schedule?.time ? `as of ${time_text(model.schedule.time, model.now())} on board` : "no report yet");
    body.replaceChildren(...activities.map((activity) => activity_row(context, activity)));
    if (!activities.length)
      body.append(h("tr", {}, h("td", { colspan: 6 }, model.schedule ? "The schedule is empty." : "Ask the spacecraft for its schedule.")));
  };
  model.on("schedule", update, signal);
  model.on("second", update, signal);
  update();
  if (!model.schedule) model.load_schedule();
}

function activity_row({ model, command }, activity) {
  const left = Date.parse(activity.release) - model.now();
  const remove = () => command("schedule.delete", { source: activity.source, apid: activity.apid, sequence: activity.sequence });
  return h(
    "tr",
    { class: left < 0 ? "past" : null },
    h("td", {}, time_text(activity.release, model.now())),
    h("td.number", {}, left < 0 ? "past" : span_text(left)),
    h("td", {}, activity.command ?? activity.octets ?? ""),
    h("td.number", {}, String(activity.group ?? 0)),
    h("td.number", {}, `${activity.apid}, ${activity.sequence}`),
    h("td", {}, h("button.quiet", { onclick: remove }, "Delete …")),
  );
}
