// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The HTTP API of `srfs-ground serve` (openapi.yaml beside this file): requests with the token, and the stream.

const retry_ms = [300, 600, 1200, 2000];
const repeat_ms = [300, 1000, 2500]; // of an order without an answer: the server knows its key, and carries it out once
const order_patience_ms = 15000;
const silent_after_ms = 25000; // the server writes at least a comment every 10 s

/** A request that the server answered with an error. `status` is the HTTP code, `answer` its JSON object. 0: no answer at all. */
export class ApiError extends Error {
  constructor(status, answer) {
    super(answer.error || `the server answered ${status}`);
    this.status = status;
    this.answer = answer;
  }
}

export function new_key() {
  const octets = crypto.getRandomValues(new Uint8Array(16));
  return [...octets].map((octet) => octet.toString(16).padStart(2, "0")).join("");
}

/** Asks again where no answer came, until @p signal. */
async function repeated(ask, signal) {
  for (const pause of repeat_ms) {
    try {
      return await ask();
    } catch (error) {
      if (signal.aborted) throw error;
    }
    await new Promise((done) => setTimeout(done, pause));
  }
  return ask();
}

export class Api {
  constructor(token) {
    this.token = token;
  }

  /** @p key: that of an order which is repeated; a new order gets a new one. */
  async request(path, { method = "GET", body, raw = false, key = new_key() } = {}) {
    const headers = { Authorization: `Bearer ${this.token}` };
    if (method !== "GET") headers["Idempotency-Key"] = key;
    if (body !== undefined && !(body instanceof Blob)) {
      headers["Content-Type"] = "application/json";
      body = JSON.stringify(body);
    }
    // What waits (a browser has six connections to a server) must not go up later.
    const signal = AbortSignal.timeout(body instanceof Blob ? 600_000 : order_patience_ms);
    const ask = () => fetch(`api/v1/${path}`, { method, headers, body, cache: "no-store", signal });
    const response = await (method === "GET" ? ask() : repeated(ask, signal)).catch(() => {
      const error =
        method === "GET"
          ? "the server does not answer"
          : "no answer: not known whether it was sent, see the list. The same order again is safe: the server carries it out once";
      throw new ApiError(0, { error });
    });
    if (!response.ok) {
      let answer = {};
      try {
        answer = await response.json();
      } catch {
        /* an error without JSON: the code says it */
      }
      throw new ApiError(response.status, answer);
    }
    return raw ? response : response.json();
  }

  get(path, query = {}) {
    const given = Object.entries(query).filter(([, value]) => value !== undefined && value !== null && value !== "");
    return this.request(given.length ? `${path}?${new URLSearchParams(given)}` : path);
  }

  post(path, body = {}, key = new_key()) {
    return this.request(path, { method: "POST", body, key });
  }

  async file(name, view) {
    const response = await this.request(`files/${encodeURIComponent(name)}${view ? `?view=${view}` : ""}`, { raw: true });
    return response.blob();
  }
}

/** The stream of everything that comes. It opens itself again where it ended: `id` counts the archive's packets, so nothing is lost and
 *  nothing comes twice. @p types: events of the stream; @p on: {object(type, object, id), state("open"|"broken", why)}. */
export class Stream {
  constructor(api, types, on) {
    this.api = api;
    this.types = types;
    this.on = on;
    this.last = null;
    this.failures = 0;
  }

  open(after) {
    this.last = after ?? this.last;
    this.#connect();
  }

  #connect() {
    this.source?.close();
    const query = new URLSearchParams({ token: this.api.token });
    if (this.last !== null) query.set("after", this.last);
    const source = new EventSource(`api/v1/stream?${query}`);
    this.source = source;
    source.onopen = () => {
      this.failures = 0;
      this.#heard();
      this.on.state("open");
    };
    source.onerror = () => this.#again();
    for (const type of this.types) source.addEventListener(type, (message) => this.#take(type, message));
  }

  #take(type, message) {
    this.#heard();
    if (message.lastEventId) this.last = message.lastEventId;
    let object;
    try {
      object = JSON.parse(message.data);
    } catch {
      return;
    }
    this.on.object(type, object, message.lastEventId);
  }

  /** A connection that is dead without an error is noticed, too: statistics come every 5 s. */
  #heard() {
    clearTimeout(this.silence);
    this.silence = setTimeout(() => this.#again(), silent_after_ms);
  }

  #again() {
    this.source.close();
    clearTimeout(this.silence);
    clearTimeout(this.retry);
    this.on.state("broken");
    this.retry = setTimeout(() => this.#connect(), retry_ms[Math.min(this.failures++, retry_ms.length - 1)]);
  }
}
