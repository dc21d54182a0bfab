// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// What the page knows: newest values, events, telecommands, files, the station. Fed by the API, read by the views.

import { ApiError, Stream } from "./api.js";

const paint_every_ms = 80;
const events_max = 2000;
const commands_max = 500;
const latencies_max = 2000;
const files_max = 1000;
const under_way = ["progress", "started", "metadata received", "fault", "suspended", "resumed", "checkpoint failed"];
const stream_types = [
  "tm_packet",
  "beacon",
  "event",
  "tc_stage",
  "cop",
  "file",
  "keys",
  "stats",
  "transfers",
  "line",
  "note",
  "schedule",
  "time_report",
  "pong",
  "retrieval_done",
];

export class Model {
  constructor(api) {
    this.api = api;
    this.dictionary = { telecommands: [], structures: [], events: [] };
    this.structures = new Map(); // name -> {name, definition, time, fields, units, limits, arrived}
    this.events = []; // newest first
    this.commands = []; // newest first
    this.own = new Set(); // tokens of what this page sent
    this.files = new Map(); // id of the transfer -> its newest object
    this.reports = new Map(); // structure -> newest reports that were asked for, newest first
    this.station = {};
    this.stats = {};
    this.cop = {};
    this.keys = null;
    this.schedule = null;
    this.line = "unknown";
    this.connection = { state: "connecting", since: Date.now() };
    this.latencies = []; // ms from the arrival of a packet to its painting
    this.packets = 0;
    this.clock_ahead_ms = 0; // of the server, before this browser
    this.listeners = new Map();
    this.dirty = new Set();
    this.unpainted = [];
    this.timers = {};
  }

  // --- who is told ---

  /** Calls @p listener after a change of @p topic, at most every 80 ms: values, events, commands, files, station, connection, schedule,
   *  reports, second (each second). "packet" is different: called at once, with each packet. Ends with @p signal. */
  on(topic, listener, signal) {
    if (!this.listeners.has(topic)) this.listeners.set(topic, new Set());
    this.listeners.get(topic).add(listener);
    signal?.addEventListener("abort", () => this.listeners.get(topic).delete(listener));
  }

  changed(topic) {
    this.dirty.add(topic);
    if (this.painting) return;
    this.painting = true;
    // A hidden page gets no animation frames, and has nothing to paint; its model goes on.
    setTimeout(() => (document.hidden ? this.#paint() : requestAnimationFrame(() => this.#paint())), paint_every_ms);
  }

  #paint() {
    const topics = [...this.dirty];
    this.dirty.clear();
    this.painting = false;
    for (const topic of topics) this.#call(topic);
    const now = performance.now();
    for (const arrived of this.unpainted) this.latencies.push(now - arrived);
    this.unpainted.length = 0;
    if (this.latencies.length > latencies_max) this.latencies.splice(0, this.latencies.length - latencies_max);
  }

  #call(topic, ...values) {
    for (const listener of this.listeners.get(topic) ?? []) {
      try {
        listener(...values);
      } catch (error) {
        console.error(topic, error);
      }
    }
  }

  /** Now, by the server's clock. */
  now() {
    return Date.now() + this.clock_ahead_ms;
  }

  // --- the beginning, and every new connection ---

  async start() {
    this.dictionary = await this.api.get("dictionary");
    this.index_dictionary();
    await this.#find_access();
    await this.refresh();
    await Promise.all([this.load_events(), this.load_commands(), this.load_transfers()]);
    this.stream = new Stream(this.api, stream_types, {
      object: (type, object, id) => this.take(type, object, id),
      state: (state) => this.#connection(state),
    });
    this.stream.open(this.latest_id);
    setInterval(() => this.#call("second"), 1000);
    setInterval(() => this.refresh_station().catch(() => {}), 15000);
    setInterval(() => this.load_events().catch(() => {}), 60000); // what others have acknowledged
  }

  /** Whether the token may command: encoding alone is for those, too. */
  async #find_access() {
    try {
      await this.api.post("telecommands", { name: this.dictionary.telecommands[0]?.name, check: true });
    } catch (error) {
      this.access = error.status === 403 ? "observe" : "command";
    }
  }

  index_dictionary() {
    const by_name = (list) => new Map(list.map((entry) => [entry.name, entry]));
    this.telecommand_of = by_name(this.dictionary.telecommands);
    this.structure_of = by_name(this.dictionary.structures);
    this.parameter_of = new Map();
    for (const structure of this.dictionary.structures)
      for (const parameter of structure.parameters) this.parameter_of.set(`${structure.name}.${parameter.name}`, parameter);
  }

  /** Newest values and the station as the server knows them. */
  async refresh() {
    await this.refresh_station();
    const latest = await this.api.get("latest");
    if (latest.id !== undefined && latest.id !== null) this.latest_id = String(latest.id);
    const age = (received) => performance.now() - Math.max(0, this.now() - Date.parse(received));
    for (const [name, newest] of Object.entries(latest.values ?? {})) {
      const known = this.structures.get(name);
      if (known && known.time > newest.time) continue;
      this.structures.set(name, {
        name,
        time: newest.time,
        fields: newest.fields,
        units: newest.units ?? {},
        limits: newest.limits ?? {},
        arrived: age(newest.received),
      });
    }
    this.changed("values");
  }

  async refresh_station() {
    const asked = Date.now();
    this.station = await this.api.get("station");
    if (this.station.server_time) this.clock_ahead_ms = Date.parse(this.station.server_time) - (asked + Date.now()) / 2;
    this.line = this.station.line ?? this.line;
    if (this.station.cop) this.cop = this.station.cop;
    if (this.station.keys) this.keys = this.station.keys;
    if (this.station.counters) this.stats = { ...this.station.counters, ...this.stats };
    this.changed("station");
  }

  async load_events() {
    const events = await this.api.get("events", { limit: 500 });
    const known = new Map(this.events.map((event) => [event_key(event), event]));
    for (const event of events) known.set(event_key(event), Object.assign(known.get(event_key(event)) ?? {}, event));
    this.events = [...known.values()].sort(newest_first).slice(0, events_max);
    this.changed("events");
  }

  async load_commands() {
    const commands = await this.api.get("commands", { limit: 200 });
    this.commands = commands.sort((a, b) => (a.sent < b.sent ? 1 : a.sent > b.sent ? -1 : b.id - a.id));
    this.changed("commands");
  }

  async load_schedule() {
    this.schedule = await this.api.get("schedule").catch(() => this.schedule);
    this.changed("schedule");
  }

  /** Those of the archive; one without an end that is not under way has ended unseen. */
  async load_transfers() {
    const [rows, live] = await Promise.all([this.api.get("transfers", { limit: 300 }), this.api.get("transfers", { live: true })]);
    for (const row of rows) this.#take_file(row);
    const running = new Set(live.map((file) => file.id));
    for (const file of this.files.values()) {
      if (!file.ended && !running.has(file.id)) Object.assign(file, { ended: true, success: false, condition: "its end was not seen" });
    }
    for (const file of live) this.#take_file(file);
  }

  #connection(state) {
    const was = this.connection.state;
    if (was === state) return;
    this.connection = { state, since: Date.now() };
    this.changed("connection");
    // What is not in the stream of packets (stages, transfers, acknowledgements) is asked for after a new connection.
    if (state === "open" && was === "broken") {
      Promise.all([this.refresh(), this.load_events(), this.load_commands(), this.load_transfers()]).catch(() => {});
    }
  }

  // --- what comes ---

  take(type, object, id) {
    const kind = object.type ?? type;
    if (kind === "tm_packet" || kind === "beacon") this.#take_packet(object);
    else if (kind === "event") this.#take_event({ ...object, id: object.id ?? (id ? Number(id) : undefined) });
    else if (kind === "tc_stage") this.#take_stage(object);
    else if (kind === "cop") {
      if (object.problem && object.problem !== this.cop.problem)
        this.#call("note", { message: `The AD service has ended: ${object.problem}`, problem: true });
      this.cop = object;
      this.changed("station");
    } else if (kind === "keys") {
      this.keys = object.keys;
      this.changed("station");
    } else if (kind === "stats") {
      this.stats = object;
      this.changed("station");
    } else if (kind === "line") {
      this.line = object.line;
      this.changed("station");
      this.refresh_station().catch(() => {});
    } else if (kind === "file" || kind === "transfer") {
      this.#take_file(object);
      if (object.success === false)
        this.#call("note", { message: `${object.name || object.id}: the transfer has failed (${object.condition ?? object.event})`, problem: true });
    } else if (type === "transfers") for (const transfer of object.transfers ?? object) this.#take_file(transfer);
    else if (kind === "schedule")
      this.#later("schedule", () => this.load_schedule()); // a report may have several packets
    else if (kind === "retrieval_done")
      this.#call("note", {
        message: `A retrieval has ended: ${object.received} packets${object.complete ? "" : `, incomplete (${object.packets ?? "unknown"} were sent)`}`,
        problem: !object.complete,
      });
    else if (kind === "note") this.#call("note", object);
  }

  #take_packet(packet) {
    const name = packet.structure;
    if (!name || !packet.fields) return;
    this.packets += 1;
    const structure = this.structure_of.get(name);
    if (!structure || is_report(structure)) this.#take_report(name, packet);
    // A packet of the past, by retrieval, is no newest value.
    const known = this.structures.get(name);
    if (packet.vc !== 1 && !(known && known.time > packet.time)) {
      // One that is replayed after a new connection came then, and not now.
      const age = packet.received ? Math.max(0, this.now() - Date.parse(packet.received)) : 0;
      const arrived = performance.now() - age;
      this.structures.set(name, {
        name,
        time: packet.time,
        fields: packet.fields,
        units: packet.units ?? {},
        limits: packet.limits ?? {},
        arrived,
      });
      if (!document.hidden && !packet.received) this.unpainted.push(arrived);
    }
    this.#call("packet", packet);
    this.changed("values");
  }

  #take_report(name, packet) {
    const reports = this.reports.get(name) ?? [];
    reports.unshift(packet);
    this.reports.set(name, reports.slice(0, 100));
    this.changed("reports");
  }

  #take_event(event) {
    const key = event_key(event);
    if (this.events.slice(0, 200).some((known) => event_key(known) === key)) return;
    const at = this.events.findIndex((known) => known.time <= event.time);
    this.events.splice(at < 0 ? this.events.length : at, 0, event);
    if (this.events.length > events_max) this.events.length = events_max;
    this.#call("event", event);
    this.changed("events");
  }

  /** A stage belongs to the newest telecommand with its request id that has not ended. Arguments and sender come from the archive. */
  #take_stage(stage) {
    let command = this.commands.find((known) => stage.id && known.request === stage.id && !(known.final && stage.stage === "sent"));
    const time = stage.received ?? new Date(this.now()).toISOString();
    if (!command) {
      command = { id: 0, name: stage.command, request: stage.id, sent: time, arguments: null, stages: [], verdict: "sent", final: false };
      this.commands.unshift(command);
      if (this.commands.length > commands_max) this.commands.length = commands_max;
      this.#later("commands", () => this.#complete_commands());
    }
    if (stage.stage !== "sent" && !command.stages.some((known) => known.stage === stage.stage && known.step === stage.step)) {
      command.stages.push({
        stage: stage.stage,
        step: stage.step,
        time,
        code: stage.code,
        name: stage.name,
        text: stage.text,
        elapsed_ms: stage.elapsed_ms,
      });
    }
    command.verdict =
      stage.stage === "progress" ? `progress ${stage.step ?? ""}` : stage.text ? `${stage.stage}: ${stage.text}` : stage.stage;
    if (stage.token) command.token = stage.token;
    command.final = command.final || Boolean(stage.final);
    if (stage.stage === "timed_out") command.timed_out = true;
    else if (command.timed_out && stage.final) command.failed = false; // its end came late
    command.failed = command.failed || stage.success === false;
    if (stage.stage === "scheduled") command.scheduled = true;
    this.#call("stage", stage, command);
    if (this.own.size > 1000) this.own.clear();
    this.changed("commands");
  }

  /** Arguments and senders of telecommands that the stream named, once for all of them. */
  async #complete_commands() {
    const archived = await this.api.get("commands", { limit: 50 }).catch(() => []);
    for (const command of this.commands.filter((known) => !known.id)) {
      const same = (row) =>
        row.request === command.request && row.name === command.name && Math.abs(Date.parse(row.sent) - Date.parse(command.sent)) < 60000;
      const row = archived.find(same);
      if (row) Object.assign(command, { id: row.id, arguments: row.arguments, who: row.who, sent: row.sent, ad: row.ad });
    }
    this.changed("commands");
  }

  /** Once for all that come within 300 ms. */
  #later(name, work) {
    clearTimeout(this.timers[name]);
    this.timers[name] = setTimeout(work, 300);
  }

  /** An object of the stream, or a row of the archive: that one ends with "arrived" or with the condition of its failure. */
  #take_file(file) {
    const known = this.files.get(file.id);
    const ended = !under_way.includes(file.event);
    if (known?.ended && !ended) return; // an older row
    const success = file.success ?? (ended ? file.event === "arrived" : undefined);
    const condition = file.condition ?? (ended && !success ? file.event : undefined);
    const changed = file.time ? Date.parse(file.time) : this.now();
    this.files.set(file.id, { ...known, ...file, ended, success, condition, changed });
    if (this.files.size > files_max) this.files.delete(this.files.keys().next().value);
    this.#call("file", file);
    this.changed("files");
  }

  // --- what follows from it ---

  /** The value of "STRUCTURE.FIELD": {value, unit, limit, time, age_ms, stale}; undefined: none came yet. */
  value(name) {
    const dot = name.indexOf(".");
    const newest = this.structures.get(name.slice(0, dot));
    const field = name.slice(dot + 1);
    if (!newest || !(field in newest.fields)) return undefined;
    return {
      value: newest.fields[field],
      unit: newest.units[field] ?? "",
      limit: newest.limits[field],
      time: newest.time,
      age_ms: this.age(newest),
      stale: this.is_stale(newest),
    };
  }

  field(structure, field) {
    return this.structures.get(structure)?.fields[field];
  }

  age(newest) {
    return performance.now() - newest.arrived;
  }

  /** Nothing came for two and a half of the dictionary's intervals. Reports that are only sent on request are never stale. */
  is_stale(newest) {
    const structure = this.structure_of.get(newest.name);
    if (!structure?.interval_s || is_report(structure)) return false;
    return this.age(newest) > overdue_ms(structure.interval_s);
  }

  /** The dictionary's entry of a field; that of an array for its elements ("temperature_k.battery", "setpoint_k[0]"). */
  definition(structure, field) {
    const exact = this.parameter_of.get(`${structure}.${field}`);
    if (exact) return exact;
    const base = field.endsWith("]") ? field.slice(0, field.lastIndexOf("[")) : field.slice(0, field.lastIndexOf("."));
    return this.parameter_of.get(`${structure}.${base}`);
  }

  /** Values outside their limits, red ones first. */
  out_of_limits() {
    const out = [];
    for (const newest of this.structures.values())
      for (const [field, limit] of Object.entries(newest.limits))
        if (limit === "red" || limit === "yellow")
          out.push({
            name: `${newest.name}.${field}`,
            limit,
            value: newest.fields[field],
            unit: newest.units[field] ?? "",
            stale: this.is_stale(newest),
          });
    return out.sort((a, b) => (a.limit === b.limit ? a.name.localeCompare(b.name) : a.limit === "red" ? -1 : 1));
  }

  /** Of the newest packet that has it: {mode, age_ms, stale}. */
  mode_news() {
    const known = ["health", "beacon"].map((name) => this.structures.get(name)).filter((one) => one?.fields.mode !== undefined);
    const newest = known.sort((a, b) => (a.time < b.time ? 1 : -1))[0];
    if (!newest) return { mode: this.station.mode ?? "unknown", age_ms: null, stale: !this.station.mode };
    const interval_s = this.structure_of.get("health")?.interval_s || 30;
    const age_ms = this.age(newest);
    return { mode: newest.fields.mode, age_ms, stale: age_ms > overdue_ms(interval_s) };
  }

  mode() {
    const { mode } = this.mode_news();
    return mode === "unknown" ? undefined : mode;
  }

  /** Whether there are values, and none of those that come by themselves came in time. */
  is_silent() {
    const regular = [...this.structures.values()].filter((one) => this.structure_of.get(one.name)?.interval_s);
    return regular.length > 0 && regular.every((one) => this.is_stale(one) || is_report(this.structure_of.get(one.name)));
  }

  may_command() {
    return this.access !== "observe";
  }

  /** Why nothing can be sent now; empty: it can. */
  obstacle() {
    if (!this.may_command()) return "this page may only observe";
    if (this.connection.state !== "open") return "the server does not answer";
    return this.line === "closed" ? "the line to the station is closed" : "";
  }

  /** Why this telecommand would be refused, as far as the page knows: its news of mode and nodes may be old. Empty: nothing known is against it. */
  refusal(telecommand) {
    const obstacle = this.obstacle();
    if (obstacle) return obstacle;
    const { mode, stale } = this.mode_news();
    const modes = telecommand.modes ?? [];
    if (modes.length && mode !== "unknown" && !modes.includes(mode))
      return `not allowed in mode ${mode}${stale ? ", the last one known" : ""} (only ${modes.join(", ")})`;
    const state = this.field("beacon", `node_state.${telecommand.node}`);
    if (state === "absent") return `${telecommand.node} is absent: no process of it was heard`;
    if (state && state !== "active" && telecommand.service === 8) return `${telecommand.node} is ${state}`;
    return "";
  }

  latency(part) {
    const sorted = [...this.latencies].sort((a, b) => a - b);
    return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(sorted.length * part))] : null;
  }
}

function overdue_ms(interval_s) {
  return interval_s * 2500 + 2000;
}

function is_report(structure) {
  return structure.kind === "report" || (structure.interval_s > 0 && structure.interval_s <= 0.1);
}

function event_key(event) {
  return `${event.apid} ${event.sequence} ${event.time}`;
}

function newest_first(a, b) {
  return a.time < b.time ? 1 : a.time > b.time ? -1 : b.sequence - a.sequence;
}

export { ApiError };
