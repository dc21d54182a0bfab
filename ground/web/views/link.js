// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The link: COP-1, keys, counters of the line.

import { dialog, h, set_text, shape, toast } from "../dom.js";
import { keys_text, make_panel } from "../parts/panels.js";

export const title = "Link";

export function show(main, context) {
  main.append(
    h(
      "div.grid",
      {},
      make_panel(context, { panel: "link", width: 4 }),
      cop_panel(context),
      keys_panel(context),
      counters_panel(context),
      make_panel(context, { panel: "nodes", width: 4 }),
      make_panel(context, { panel: "deaths", width: 4, most: 12 }),
    ),
  );
}

function order(context, path, body, done) {
  return async () => {
    try {
      await context.api.post(path, body());
      toast(done);
    } catch (error) {
      if (error.answer?.under_way) ask_to_drop(context, path, body(), done, error.answer.under_way);
      else toast(error.message, "failed");
    }
  };
}

/** Telecommands of any page are in the hands of the AD service: who ends it is to know. */
function ask_to_drop(context, path, body, done, under_way) {
  const end = async () => {
    await order(context, path, () => ({ ...body, drop: true }), done)();
    box.close();
  };
  const box = dialog(
    "End the AD service",
    h(
      "p",
      {},
      `${under_way} telecommands of the pages of this server are under way by it. What was not transmitted is then not sent; what was is not repeated when it was lost.`,
    ),
    h("footer", {}, h("button.primary", { onclick: end }, "End it now"), h("button", { onclick: () => box.close() }, "Leave it on")),
  );
}

function cop_panel(context) {
  const { model, signal } = context;
  const rows = h("dl.rows");
  const vr = h("input", { type: "number", min: 0, max: 255, value: "0", "aria-label": "V(R)" });
  const buttons = [
    h("button", { onclick: order(context, "cop", () => ({ order: "ad_on" }), "The AD service starts") }, "AD on"),
    h("button", { onclick: order(context, "cop", () => ({ order: "ad_off" }), "The AD service ends") }, "AD off"),
    h("button", { onclick: order(context, "cop", () => ({ order: "unlock" }), "Unlock is sent") }, "Unlock FARM-1"),
    h(
      "span.pair",
      {},
      vr,
      h("button", { onclick: order(context, "cop", () => ({ order: "set_vr", vr: Number(vr.value) }), "Set V(R) is sent") }, "Set V(R)"),
    ),
  ];
  const update = () => {
    const { cop } = model;
    const clcw = cop.clcw ?? {};
    const flags = ["lockout", "wait", "retransmit", "no_rf_available", "no_bit_lock"].filter((name) => clcw[name]);
    const facts = [
      ["AD service", cop.service ?? "unknown"],
      ["FOP-1", cop.state ?? "unknown"],
      ["V(S), NN(R)", `${cop.vs ?? "-"}, ${cop.nnr ?? "-"}`],
      ["outstanding, queued", `${cop.outstanding ?? 0}, ${cop.queued ?? 0}`],
      ["repeated", String(cop.repeated ?? 0)],
      ["CLCW", cop.clcw ? `VC ${clcw.vc}, V(R) ${clcw.vr}, FARM-B ${clcw.farm_b}` : "none yet"],
      ["flags", flags.join(", ") || "none"],
      ["why it ended", cop.problem || "-"],
    ];
    rows.replaceChildren(
      ...facts.flatMap(([name, text]) => [
        h("dt", {}, name),
        h(`dd.${name === "flags" && clcw.lockout ? "red" : "plain"}`, {}, name === "flags" && clcw.lockout ? shape("red") : null, text),
      ]),
    );
    for (const button of buttons) (button.querySelector("button") ?? button).disabled = !model.may_command();
  };
  model.on("station", update, signal);
  update();
  return h(
    "section.panel.width-4",
    { "aria-label": "COP-1" },
    h("h2", {}, "COP-1"),
    h(
      "div.body",
      {},
      rows,
      h("p.hint", {}, "One AD service for all pages of this server: while it is on, their telecommands go by it, in the order in which they were sent."),
      h("div.buttons", {}, ...buttons),
    ),
  );
}

function keys_panel(context) {
  const { model, signal } = context;
  const now = h("div.big");
  const counters = h("dl.rows");
  const choose = (keys) =>
    h(
      "button",
      {
        onclick: () => {
          const box = dialog(
            "Change the keys of the ground",
            h(
              "p",
              {},
              `The ground will use set ${keys} for what it sends. It must be the set that the spacecraft uses: the telecommand ttc.select_keys changes both.`,
            ),
            h(
              "footer",
              {},
              h(
                "button.primary",
                {
                  onclick: async () => {
                    await order(context, "keys", () => ({ keys }), `Keys of set ${keys} are used`)();
                    box.close();
                  },
                },
                `Use set ${keys}`,
              ),
              h("button", { onclick: () => box.close() }, "Leave it"),
            ),
          );
        },
      },
      `Ground: set ${keys} …`,
    );
  const buttons = [h("button", { onclick: () => context.command("ttc.select_keys", {}) }, "ttc.select_keys …"), choose("a"), choose("b")];
  const update = () => {
    set_text(now, keys_text(model.keys));
    const beacon = model.structures.get("beacon")?.fields ?? {};
    counters.replaceChildren(
      ...["bd", "ad"].flatMap((of) => [
        h("dt", {}, `on board, ${of.toUpperCase()}`),
        h(
          "dd",
          {},
          beacon[`sdls_spi.${of}`] === undefined
            ? "no beacon yet"
            : `SPI ${beacon[`sdls_spi.${of}`]}, counter ${beacon[`sdls_counter.${of}`]}`,
        ),
      ]),
    );
    for (const button of buttons) button.disabled = !model.may_command();
  };
  model.on("station", update, signal);
  model.on("values", update, signal);
  update();
  return h(
    "section.panel.width-4",
    { "aria-label": "Keys" },
    h("h2", {}, "Keys (SDLS)"),
    h("div.body", {}, now, counters, h("div.buttons", {}, ...buttons)),
  );
}

function counters_panel(context) {
  const { model, signal } = context;
  const rows = h("dl.rows");
  const update = () => {
    const numbers = Object.entries(model.stats).filter(([, value]) => typeof value === "number");
    rows.replaceChildren(
      ...numbers.flatMap(([name, value]) => [h("dt", {}, name.replace(/_/g, " ")), h("dd.number", {}, value.toLocaleString("en"))]),
    );
    if (!numbers.length) rows.replaceChildren(h("dt", {}, "counters"), h("dd", {}, "come every 5 s"));
  };
  model.on("station", update, signal);
  update();
  return h("section.panel.width-4", { "aria-label": "Counters" }, h("h2", {}, "Counters of the line"), h("div.body", {}, rows));
}
