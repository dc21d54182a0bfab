// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The form of a telecommand, made from the dictionary. What is right is decided by the server alone: each change is encoded there
// (check: true), and only what it encodes can be sent. Ranges and enumerations here only help to fill it in.

import { new_key } from "../api.js";
import { h, set_text, shape, toast } from "../dom.js";
import { bounds_text, parse_time } from "../format.js";

const check_after_ms = 120;

export class CommandForm {
  /** @param values  arguments to begin with, by name */
  constructor(context, telecommand, values) {
    Object.assign(this, { context, telecommand });
    this.fields = telecommand.arguments.map((argument) => make_field(context.model, argument, values[argument.name]));
    this.when = h("input", {
      type: "text",
      placeholder: "now; +10m, or UTC as 2026-11-26 20:57:00",
      "aria-label": "When",
      autocomplete: "off",
      value: values["@at"] ?? "",
    });
    this.ad = h("input", { type: "checkbox" });
    this.ad_words = h("span");
    this.unanswered = null; // {key, text} of an order without an answer: the same one again has its key
    this.confirm = h("input", {
      type: "text",
      autocomplete: "off",
      spellcheck: "false",
      "aria-label": `Type ${telecommand.name} to arm it`,
    });
    this.problem = h("p.problem", { role: "alert" });
    this.octets = h("output.octets");
    this.refusal = h("p.refusal");
    // No submit button: Enter in a field sends nothing.
    this.send = h("button.primary.send", { type: "button", onclick: () => this.submit() }, telecommand.hazardous ? "Arm and send" : "Send");
    this.element = this.#make();
    this.checked = false;
    context.model.on("values", () => this.#show_refusal(), context.signal);
    context.model.on("connection", () => this.#on_connection(), context.signal);
    context.model.on("station", () => this.#on_station(), context.signal);
    this.#on_station();
    this.check();
  }

  #make() {
    const { telecommand } = this;
    const facts = [
      `${telecommand.node}, service ${telecommand.service},${telecommand.subtype}`,
      telecommand.timeout_s ? `completes within ${telecommand.timeout_s} s` : "",
      { idempotent: "may be repeated", by_id: "a repeat is recognised", at_most_once: "never repeated" }[telecommand.repeat] ??
        telecommand.repeat,
      modes_text(this.context.model, telecommand),
    ]
      .filter(Boolean)
      .join(" · ");
    const form = h(
      "form.command",
      {
        dataset: { name: telecommand.name },
        onsubmit: (event) => event.preventDefault(),
        oninput: () => this.#changed(),
        novalidate: true,
      },
      h("h2", {}, telecommand.hazardous ? shape("red", "hazardous") : null, telecommand.name),
      h("p", {}, telecommand.description),
      h("p.hint", {}, facts),
      this.refusal,
      ...this.fields.map((field) => field.element),
      h(
        "label.argument",
        {},
        h("span.name", {}, "when"),
        this.when,
        h("span.hint", {}, "The spacecraft releases it at this time. Empty: now."),
      ),
      h("label.check", {}, this.ad, this.ad_words),
    );
    if (telecommand.hazardous)
      form.append(
        h(
          "fieldset.hazard",
          {},
          h("legend", {}, shape("red"), "Hazardous"),
          h(
            "p",
            {},
            "It runs only when it was armed with exactly these arguments. Type its name to arm and send it: ",
            h("code", {}, telecommand.name),
          ),
          this.confirm,
        ),
      );
    form.append(this.problem, h("footer", {}, this.send, h("kbd", {}, "Ctrl Enter"), this.octets));
    form.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) {
        event.preventDefault();
        if (!event.repeat) this.submit();
      }
    });
    return form;
  }

  /** What would be posted. A field that is left at its default is left out. */
  body() {
    const values = {};
    for (const field of this.fields) if (field.value() !== null) values[field.argument.name] = field.value();
    const body = { name: this.telecommand.name, arguments: values };
    if (this.when.value.trim()) {
      const at = parse_time(this.when.value, this.context.model.now());
      if (at === null) throw new Error("when: +30s, +10m, +2h, or UTC as 2026-11-26 20:57:00");
      body.at = new Date(at).toISOString();
    }
    if (this.ad.checked) body.ad = true;
    return body;
  }

  #changed() {
    this.checked = false;
    this.#show_send();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.check(), check_after_ms);
  }

  /** Has the server encode it. */
  async check() {
    const turn = (this.turn = Symbol("check"));
    let why = "",
      octets = "";
    try {
      octets = (await this.context.api.post("telecommands", { ...this.body(), check: true })).octets ?? "";
    } catch (error) {
      why = error.message;
    }
    if (this.turn !== turn) return;
    this.checked = !why;
    set_text(this.problem, why);
    set_text(this.octets, octets ? `${octets.length / 2} octets: ${octets}` : "");
    const named = /argument '([^']+)'/.exec(why)?.[1];
    for (const field of this.fields) field.input.setAttribute("aria-invalid", String(field.argument.name === named));
    this.element.dataset.checked = why ? "refused" : "good";
    this.#show_send();
  }

  #on_connection() {
    this.#show_refusal();
    if (this.context.model.connection.state === "open" && !this.checked) this.check();
  }

  /** The AD service is one for all pages of this server: while it is on, every telecommand goes by it, in the order of the pages' sending. */
  #on_station() {
    const is_on = this.context.model.cop.service === "on";
    if (is_on !== this.ad.disabled) Object.assign(this.ad, { disabled: is_on, checked: is_on });
    set_text(this.ad_words, `with guaranteed delivery (AD service${is_on ? ": on, for all pages of this server" : ""})`);
    this.#show_refusal();
  }

  #show_refusal() {
    const why = this.context.model.refusal(this.telecommand);
    if (why === this.why) return;
    this.why = why;
    this.refusal.replaceChildren(...(why ? [shape("yellow"), why] : []));
    this.refusal.hidden = !why;
    this.#show_send();
  }

  #show_send() {
    const armed = !this.telecommand.hazardous || this.confirm.value.trim() === this.telecommand.name;
    // What the page knows of mode and nodes may be old: that warns, and stops nobody.
    const obstacle = this.context.model.obstacle();
    this.send.disabled = !this.checked || !armed || Boolean(obstacle) || this.sending;
    set_text(this.send, this.telecommand.hazardous ? "Arm and send" : this.why && !obstacle ? "Send anyway" : "Send");
    this.send.title = this.why || (this.checked ? (armed ? "" : "Type the name to arm it") : "The arguments are not right yet");
  }

  async submit() {
    if (this.send.disabled) return;
    this.sending = true;
    this.#show_send();
    const { model, api } = this.context;
    try {
      const body = this.body();
      if (this.telecommand.hazardous) Object.assign(body, { arm: true, confirm: this.confirm.value.trim() });
      const text = JSON.stringify(body);
      if (this.unanswered?.text !== text) this.unanswered = { key: new_key(), text };
      const answer = await api.post("telecommands", body, this.unanswered.key);
      this.unanswered = null;
      toast(`${this.telecommand.name} is on its way`);
      this.confirm.value = "";
      model.own.add(answer.token);
      this.on_sent?.(answer);
      await new Promise((done) => setTimeout(done, 1000)); // a double click sends once
    } catch (error) {
      // The key stays: a refused order is not remembered, and of one that may be under way no second one is sent. Where the server itself does
      // not know, the operator decides: the next click is a new order.
      if (error.answer?.outcome === "unknown") this.unanswered = null;
      set_text(this.problem, error.message);
      toast(`${this.telecommand.name}: ${error.message}`, "failed");
    }
    this.sending = false;
    this.#show_send();
  }
}

/** {argument, input, element, value()}; value() is null for an empty field: the default counts, or the server says that it is missing. */
function make_field(model, argument, given) {
  const preset = given ?? "";
  const default_text = argument.default === undefined || argument.default === null ? "" : String(argument.default);
  const choices = argument.enum
    ? Object.keys(argument.enum)
    : argument.type === "bool" || argument.type === "boolean"
      ? ["true", "false"]
      : null;
  let input;
  if (choices) {
    input = h(
      "select",
      {},
      ...(default_text || !preset ? [h("option", { value: "" }, default_text ? `${default_text} (default)` : "choose …")] : []),
      ...choices.map((text) => h("option", { value: text }, argument.enum ? `${text}  (${argument.enum[text]})` : text)),
    );
  } else {
    const names = reference_names(model, argument.reference);
    const id = `list-${argument.name}-${Math.random().toString(36).slice(2)}`;
    input = h("input", {
      type: "text",
      inputmode: /^[uif]\d/.test(argument.type) && !argument.reference ? "decimal" : null,
      autocomplete: "off",
      spellcheck: "false",
      placeholder: default_text || (argument.type === "time" ? "2026-11-26T20:57:00Z" : ""),
      list: names.length ? id : null,
    });
    if (names.length) input.after_list = h("datalist", { id }, ...names.map((value) => h("option", { value })));
  }
  input.value = preset;
  const hint = [
    argument.type,
    bounds_text(argument.min, argument.max),
    argument.length ? `at most ${argument.length} octets` : "",
    argument.reference ? `name of a ${argument.reference.replace(/_/g, " ")}` : "",
    default_text && !choices ? `default ${default_text}` : "",
    argument.type === "text" && default_text ? '"" for an empty text' : "",
  ]
    .filter(Boolean)
    .join(", ");
  const element = h(
    "label.argument",
    { dataset: { argument: argument.name } },
    h("span.name", {}, argument.name),
    h("span.input", {}, input, input.after_list, argument.unit ? h("span.unit", {}, argument.unit) : null),
    h("span.hint", {}, `${argument.description ?? ""} (${hint})`),
  );
  return { argument, input, element, value: () => (input.value === "" ? null : input.value === '""' ? "" : input.value) };
}

/** The modes in which it runs, when these are not all. */
function modes_text(model, telecommand) {
  const all = Object.keys(model.definition("health", "mode")?.enum ?? {});
  const modes = telecommand.modes ?? [];
  return modes.length && modes.length < all.length ? `only in mode ${modes.join(", ")}` : "";
}

function reference_names(model, reference) {
  const { dictionary } = model;
  const names = (list) => (list ?? []).map((one) => one.name ?? one);
  switch (reference) {
    case "structure":
      return names(dictionary.structures);
    case "event":
      return names(dictionary.events);
    case "event_or_none":
      return ["none", ...names(dictionary.events)];
    case "store":
      return names(dictionary.stores);
    case "parameter":
      return names(dictionary.parameters);
    case "telemetry":
      return [...model.structures.values()].flatMap((one) => Object.keys(one.fields).map((field) => `${one.name}.${field}`));
    default:
      return [];
  }
}
